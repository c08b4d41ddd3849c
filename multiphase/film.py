"""Films of a growing domain: `Film` of one on a 1D grid, `BodyFilm` of one made of triangles."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable
from math import ceil
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from multiphase.errors import ParameterError
from multiphase.model import Panel
from multiphase.plotting.files import checked_path, replacing
from multiphase.plotting.maps import Map, map_height
from multiphase.plotting.marks import columns_of, legend_of
from multiphase.plotting.panels import draw_lines, time_limits
from multiphase.plotting.ring import Ring, radius_axis
from multiphase.plotting.style import STYLE, TITLE_WIDTH, colour_map
from multiphase.plotting.view import Array, View, at_times, limits, time_texts, view_of

if TYPE_CHECKING:
    from multiphase.result import Result

FILMS = (".gif", ".mp4")
FEW_TIMES, SMOOTH_FRAMES, MOST_FRAMES = 40, 100, 150
BAND_PIXELS = 600
WIDTH, RING_WIDTH = 7.0, 4.2  # inches: of a film, and what a round body adds to it
MAP_WIDTH, MAP_MARGINS, BESIDE_WIDTH = 4.0, (1.4, 1.1), 3.4  # of a map, around it (across, along), and of the scalars beside it
MARKED_HIGH = 2.2  # inches of each panel of scalars beside a body with marks, which may be a flat one and have a radius all the same
LEGEND, LEGEND_LINE = 15, 0.2  # characters to an inch of a legend, and inches of each of its lines


class Film:
    """The artists of a film, made once and moved from frame to frame.

    Parameters
    ----------
    view : View
    times : ndarray (frames,)
    """

    def __init__(self, view: View, times: Array) -> None:
        x = view.result.x
        if x is None or view.edges is None or view.wall is None:
            raise ParameterError("", "a film needs fields on a one-dimensional grid, and this result has none; use plot instead.")
        name = _field(view)
        self.times, self.texts, self.view = times, time_texts(times), view
        self.edges, self.x, self.wall = (at_times(view.t, values, times) for values in (view.edges, x, view.wall))
        self.colours = at_times(view.t, view.values[name], times)
        panels = _panels(view, "profile")
        with matplotlib.rc_context(STYLE):
            beside = [] if view.inner is None else [RING_WIDTH / WIDTH]
            widths, heights = [*beside, 1.0, 0.025], [0.8] + [1.0] * len(panels)
            self.figure = Figure(figsize=(WIDTH * (1.0 + sum(beside)), 1.9 + 1.7 * len(panels)), layout="constrained")
            FigureCanvasAgg(self.figure)
            grid = self.figure.add_gridspec(len(heights), len(widths), height_ratios=heights, width_ratios=widths)
            self.ring = self._make_ring(self.figure.add_subplot(grid[:, 0])) if beside else None
            self.band_axes = self.figure.add_subplot(grid[0, -2])
            self._make_band(self.figure.add_subplot(grid[0, -1]))
            self.profiles: list[tuple[Line2D, Array]] = []
            lowest = self.band_axes
            for row, panel in enumerate(panels, start=1):
                lowest = self.figure.add_subplot(grid[row, -2])
                self._make_profiles(panel, lowest)
            lowest.set_xlabel(view.position_label())
            self.title = self.figure.suptitle(" ", parse_math=False)
            self.show(len(times) - 1)
            self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # laid out once: the frames do not jump, and cost half

    def _make_ring(self, axes: Axes) -> Ring:
        """The cross-section of a round body, in the colours of the band, as large from the first frame as it will need."""
        ring = Ring(self.view, self.view.model.film, axes)
        radius_axis(self.view, axes)
        ring.name_hollow(self.view.hollow, 0.8 * RING_WIDTH)
        return ring

    def _make_band(self, bar_axes: Axes) -> None:
        view, axes = self.view, self.band_axes
        low, high = limits(view.values[view.model.film], margin=0.0)
        self.band = axes.imshow(np.zeros((1, BAND_PIXELS)), cmap=colour_map(), vmin=low, vmax=high, aspect="auto", interpolation="nearest")
        (self.wall_line,) = axes.plot([0.0, 0.0], [0.0, 1.0], color="black", linewidth=2.0)
        self.outer_text = axes.text(0.0, 1.03, view.model.ends[1], ha="center", va="bottom", parse_math=False)
        axes.set(xlim=(0.0, view.reach), ylim=(0.0, 1.0), yticks=[])
        axes.spines["right"].set_visible(False)
        axes.set_ylabel(view.model.ends[0].replace(" | ", " |\n"), rotation=0, ha="right", va="center", parse_math=False)
        self.figure.colorbar(self.band, cax=bar_axes).set_label(view.label(view.model.film))

    def _make_profiles(self, panel: Panel, axes: Axes) -> None:
        view = self.view

        def draw(side: Axes, name: str, style: str, colour: str) -> None:
            (line,) = side.plot([], [], style, color=colour)
            self.profiles.append((line, at_times(view.t, view.values[name], self.times)))

        draw_lines(view, panel, axes, draw)
        axes.set_xlim(0.0, view.reach)

    def show(self, frame: int) -> None:
        """Move every artist to `frame`."""
        wall = float(self.wall[frame])
        pixels = (np.arange(BAND_PIXELS) + 0.5) / BAND_PIXELS * wall
        cells = np.searchsorted(self.edges[frame, 1:-1], pixels)
        self.band.set_data(np.ma.masked_invalid(self.colours[frame, cells][None, :]))
        self.band.set_extent((0.0, wall, 0.0, 1.0))
        self.wall_line.set_xdata([wall, wall])
        self.outer_text.set_x(wall)
        if self.ring is not None:
            self.ring.show(self.edges[frame], self.colours[frame])
        for line, values in self.profiles:
            line.set_data(self.x[frame], values[frame])
        self.title.set_text(_title(self.view, self.texts[frame]))


class BodyFilm:
    """The artists of a film of a two-dimensional body, made once and moved from frame to frame.

    Its colours, with scalars against time beside it, on which a dot marks the time of the frame.

    Parameters
    ----------
    view : View
        Of a result on triangles.
    times : ndarray (frames,)
    """

    def __init__(self, view: View, times: Array) -> None:
        if view.body is None:
            raise ParameterError(
                "output.fields", "a film needs the displacement, which this result does not hold; add it to output.fields and run again."
            )
        name = _field(view)
        self.times, self.texts, self.view, self.colours = times, time_texts(times), view, view.values[name]
        panels, rows = _panels(view, "scalar"), range(len(view.t))
        self.dots: list[tuple[Line2D, Array]] = []
        with matplotlib.rc_context(STYLE):
            across, along = MAP_MARGINS
            wide, high = MAP_WIDTH + across, map_height(view, rows, MAP_WIDTH) + along
            beside = [BESIDE_WIDTH] if panels else []
            lines, texts = legend_of(view.marks, bars=True)
            columns = columns_of(texts, round((wide + sum(beside)) * LEGEND))
            below = LEGEND_LINE * ceil(len(texts) / columns)
            self.figure = Figure(
                figsize=(wide + sum(beside), max(high, (MARKED_HIGH if texts else 1.9) * len(panels) + 0.4) + below), layout="constrained"
            )
            FigureCanvasAgg(self.figure)
            if texts:
                self.figure.legend(lines, texts, loc="outside lower center", ncols=columns, frameon=False)
            grid = self.figure.add_gridspec(max(len(panels), 1), 1 + len(beside), width_ratios=[MAP_WIDTH, *(0.6 * w for w in beside)])
            self.map = Map(view, name, self.figure.add_subplot(grid[:, 0]), rows)
            self.map.add_bar()
            for row, panel in enumerate(panels):
                self._make_scalars(panel, self.figure.add_subplot(grid[row, 1]), last=row == len(panels) - 1)
            self.title = self.figure.suptitle(" ", parse_math=False)
            self.show(len(times) - 1)
            self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")

    def _make_scalars(self, panel: Panel, axes: Axes, *, last: bool) -> None:
        view = self.view

        def draw(side: Axes, name: str, style: str, colour: str) -> None:
            side.plot(view.t, view.values[name], style, color=colour, label=name)
            (dot,) = side.plot([], [], "o", color=colour, markersize=5, clip_on=False)
            self.dots.append((dot, at_times(view.t, view.values[name], self.times)))

        draw_lines(view, panel, axes, draw)
        axes.set_xlim(*time_limits(view.t))
        if last:
            axes.set_xlabel(view.time_label())

    def show(self, frame: int) -> None:
        """Move every artist to `frame`."""
        body, here = self.map.body, self.times[frame : frame + 1]
        moved, colours = (at_times(self.view.t, values, here)[0] for values in (body.displacement, self.colours))
        self.map.show(body.rest + moved, colours)
        for dot, values in self.dots:
            dot.set_data(here, values[frame : frame + 1])
        self.title.set_text(_title(self.view, self.texts[frame]))


def _field(view: View) -> str:
    """The field that the film colours."""
    name = view.model.film
    if name not in view.values:
        raise ParameterError(
            "output.fields", f"the film colours {name!r}, which this result does not hold; add it to output.fields and run again."
        )
    return name


def _panels(view: View, kind: str) -> list[Panel]:
    """The first two panels of the model of this kind that the result can show."""
    return [drawn for panel in view.model.panels if panel.kind == kind and (drawn := view.drawn(panel)) is not None][:2]


def _title(view: View, time: str) -> str:
    return textwrap.fill(f"{view.title}, {view.time_text(time)}", TITLE_WIDTH)


def frame_times(t: Array) -> Array:
    """Evenly spaced times of the frames, so that the film runs at an even pace."""
    if t[-1] <= t[0]:
        return t[:1]
    return np.linspace(t[0], t[-1], SMOOTH_FRAMES if len(t) < FEW_TIMES else min(len(t), MOST_FRAMES))


def animate(
    result: Result,
    path: str | os.PathLike[str],
    *,
    fps: int = 12,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a film of the growing domain.

    On a 1D grid its colours are above, profiles below, and beside them the cross-section of a round body. In two dimensions it shows
    the colours on the deformed body, and beside it scalars against time.

    Parameters
    ----------
    result : multiphase.Result
    path : path
        A .gif, or an .mp4 where ffmpeg is installed; replaced only once the film is whole.
    fps : int
        Frames a second, 1 to 60.
    progress : callable(done, total), optional
        Called after each frame.

    Raises
    ------
    ParameterError
        For another suffix, an .mp4 without ffmpeg, or a result without the field that the film colours or without displacement.
    """
    target = checked_path(path, FILMS, "a film")
    if not 1 <= fps <= 60:
        raise ParameterError("fps", f"{fps} frames a second cannot be played; choose a whole number from 1 to 60.")
    if target.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise ParameterError("", f"cannot write {str(target)!r}: ffmpeg was not found; write a .gif instead, or install ffmpeg.")
    view = view_of(result)
    film = (Film if view.result.mesh is None else BodyFilm)(view, frame_times(view.t))
    writer = PillowWriter(fps=fps) if target.suffix.lower() == ".gif" else FFMpegWriter(fps=fps)
    count = len(film.times)
    with replacing(target) as part, matplotlib.rc_context(STYLE), writer.saving(film.figure, str(part), dpi=110):
        for frame in range(count):
            film.show(frame)
            writer.grab_frame()
            if progress is not None:
                progress(frame + 1, count)
