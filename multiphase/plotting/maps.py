"""Fields of a two-dimensional body in colour, on the body as it is deformed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from multiphase.model import Panel
from multiphase.plotting.marks import BARS, PART_WIDTH, Bars, Sides, columns_of, legend_of
from multiphase.plotting.spread import spread_over
from multiphase.plotting.style import colour_map
from multiphase.plotting.view import ON_TRIANGLES, Array, View, limits, spread_rows, time_texts

MAPS = 4  # times shown in a row of maps
ARROWS = 200  # about as many on a map of a vector
ARROW_STEPS = 1.5  # length of the longest arrow in distances between neighbours
SMALL, SMALL_BARS = 0.7, 45  # on one of them: width of the parts of the surface over that on a larger map, and bars
DECADES = 4  # that logarithmic colours span at most
REST: Any = {"colors": "0.55", "linewidths": 0.9}  # the outline at rest
EDGE: Any = {"colors": "black", "linewidths": 0.6}  # the outline as it is


class Map:
    """A field on the deformed body in smooth colours, with the outlines at rest (grey) and as it is (black), and what marks there are.

    Marks are the parts of the surface and, on the field that films show, bars along the directions of the material. Colours, not
    values, are linear within a triangle: they are true to the scale where neighbouring points have similar values.

    Parameters
    ----------
    view : View
        Of a result that has a `body`.
    name : str
        The field; of a vector its size is shown.
    axes : Axes
        Takes limits that hold the body at rest and at the stored times `rows`, equal scales and names of its axes.
    rows : sequence of int
        The stored times whose values the colours span.
    log : bool
        Colours by the logarithm, at most `DECADES` below the largest value; what is less has the lowest colour.
    is_small : bool
        Fewer bars and thinner lines.
    """

    def __init__(self, view: View, name: str, axes: Axes, rows: Sequence[int], *, log: bool = False, is_small: bool = False) -> None:
        assert view.body is not None
        self.body, self.axes, self.label = view.body, axes, view.short_label(name)
        values = view.values[name]
        self.vector = values.ndim == 3
        norm, self.extend = _colours(self._sizes(values[rows]), log)
        self.floor = norm.vmin if isinstance(norm, LogNorm) else None
        self.triangles = Triangulation(self.body.rest[:, 0], self.body.rest[:, 1], self.body.triangles)
        nothing = np.zeros(len(self.body.rest))
        # In a vector file the colours are pixels, as it would otherwise hold every triangle.
        self.mesh = axes.tripcolor(self.triangles, nothing, shading="gouraud", norm=norm, cmap=colour_map(), rasterized=True)
        axes.add_collection(LineCollection(self._edges(self.body.rest), capstyle="round", **REST), autolim=False)
        self.outline = LineCollection(self._edges(self.body.rest), capstyle="round", **EDGE)
        axes.add_collection(self.outline, autolim=False)
        self.sides = Sides(axes, view.marks, SMALL * PART_WIDTH if is_small else PART_WIDTH)
        self.bars: Bars | None = None
        if view.marks.directions is not None and name == view.model.film:
            self.bars = Bars(axes, self.body, view.marks.directions, SMALL_BARS if is_small else BARS)
        x, y = self.body.window(rows)
        unit = view.bracket("points")
        axes.set(aspect="equal", xlim=x, ylim=y, xlabel=f"x{unit}", ylabel=f"y{unit}")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))

    def _sizes(self, values: Array) -> Array:
        return np.asarray(np.hypot(values[..., 0], values[..., 1])) if self.vector else values

    def _edges(self, positions: Array) -> list[Array]:
        return list(positions[self.body.outline])

    def show(self, positions: Array, values: Array) -> None:
        """Show `values` (points,) or (points, 2) with the points of the body at `positions` (points, 2)."""
        self.triangles.x, self.triangles.y = positions.T
        colours = np.ma.masked_invalid(self._sizes(values))
        self.mesh.set_array(colours if self.floor is None else np.maximum(colours, self.floor))
        self.outline.set_segments(self._edges(positions))
        self.sides.show(positions)
        if self.bars is not None:
            self.bars.show(positions)

    def add_bar(self) -> None:
        """A colour bar as high as the axes, with symbol and unit; a tip says that values below it are shown in the lowest colour."""
        bar = self.axes.figure.colorbar(self.mesh, cax=self.axes.inset_axes((1.04, 0.0, 0.05, 1.0)), extend=self.extend)
        bar.set_label(self.label)

    def add_arrows(self, positions: Array, vectors: Array) -> None:
        """Arrows evenly spread over the body, the longest a little longer than they are apart."""
        found = spread_over(self.body, positions, vectors, ARROWS)
        if found is None:
            return
        points, arrows, step = found
        sizes = np.hypot(*arrows.T)
        largest = float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))
        if largest > 0.0:
            scale: Any = {"angles": "xy", "scale_units": "xy", "units": "xy", "scale": largest / (ARROW_STEPS * step), "width": 0.12 * step}
            self.axes.quiver(*points.T, *arrows.T, pivot="mid", color="white", edgecolor="black", linewidth=0.3, **scale)


def _colours(values: Array, log: bool) -> tuple[Normalize, str]:
    """The scale of colours for `values`, and the end of the colour bar beyond which values lie: "min" or "neither"."""
    low, high = limits(values, margin=0.0)
    top = float(np.max(values, where=np.isfinite(values), initial=0.0))
    if not log or top <= 0.0:
        return Normalize(low, high), "neither"
    inside = values[values >= 10.0**-DECADES * top]
    bottom = float(inside.min())
    extend = "min" if np.any(values < bottom) else "neither"
    if top <= (1.0 + 1e-9) * bottom:
        bottom, top = bottom / np.sqrt(10.0), top * np.sqrt(10.0)
    return LogNorm(bottom, top), extend


def draw_map(view: View, panel: Panel, axes: Axes) -> None:
    """The body at the last stored time."""
    assert view.body is not None
    last, name = len(view.t) - 1, panel.names[0]
    positions, values = view.body.positions(last), view.values[name][last]
    shown = Map(view, name, axes, [last], log=panel.log)
    shown.show(positions, values)
    shown.add_bar()
    if shown.vector:
        shown.add_arrows(positions, values)


def draw_maps(view: View, panel: Panel, body: SubFigure, place: SubplotSpec) -> None:
    """A row of bodies at times evenly spread, on one scale of lengths and one of colours."""
    assert view.body is not None
    name, rows = panel.names[0], spread_rows(view.t, MAPS)
    grid = place.subgridspec(1, MAPS)
    for column, (row, text) in enumerate(zip(rows, time_texts(view.t[rows]), strict=True)):
        axes = body.add_subplot(grid[column])
        shown = Map(view, name, axes, rows, log=panel.log, is_small=True)
        shown.show(view.body.positions(row), view.values[name][row])
        axes.set(xticks=[], xlabel=view.time_text(text))
        if column == 0:
            axes.set_title(panel.title, loc="left", parse_math=False)
        else:
            axes.set(yticks=[], ylabel="")
    shown.add_bar()


def map_height(view: View, rows: Sequence[int], width: float) -> float:
    """Inches that a map needs which is `width` inches wide: as the body is, but neither very flat nor very high."""
    assert view.body is not None
    (left, right), (bottom, top) = view.body.window(rows)
    return float(np.clip(width * (top - bottom) / (right - left), 0.5 * width, 1.5 * width))


def map_legend(view: View, body: SubFigure, panels: Sequence[Panel]) -> None:
    """Above the panels: which time single maps show, what the lines in all of them are, and the marks."""
    lines, texts = [], []
    if any(panel.kind == "map" for panel in panels):
        lines = [Line2D([], [], color=style["colors"], linewidth=style["linewidths"]) for style in (REST, EDGE)]
        (text,) = time_texts(view.t[-1:])
        texts = ["outline at rest", f"at {view.time_text(text)}"]
    more = legend_of(view.marks, bars=any(panel.names == (view.model.film,) for panel in panels if panel.kind in ON_TRIANGLES))
    lines, texts = lines + more[0], texts + more[1]
    if texts:
        body.legend(lines, texts, loc="outside upper center", ncols=columns_of(texts), frameon=False)
