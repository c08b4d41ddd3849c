"""Panels of lines over time or position, and of colour over both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from multiphase.errors import ParameterError
from multiphase.model import Panel
from multiphase.plotting.style import LINE_STYLES, colour_map
from multiphase.plotting.view import Array, View, at_times, limits, spread_rows, time_texts

UNIT_COLOURS = ("black", "#b35806")  # of the lines on the left and the right axis
PROFILES = 6  # times shown in a profile panel
COLUMNS = 300  # time columns of a space-time picture, about the pixels it is printed with


def draw_lines(view: View, panel: Panel, axes: Axes, draw: Callable[[Axes, str, str, str], None], rows: Any = slice(None)) -> None:
    """Lay out a panel of lines: an axis for each of at most two units, and line styles with a legend for several names.

    `draw` gets the axes, the name, the line style, and the colour that tells the units apart. The axes span the values at the times `rows`.
    """
    groups: dict[str, list[str]] = {}
    for name in panel.names:
        quantity = view.model.quantities.get(name)
        groups.setdefault(str(sorted(quantity.dimension.items())) if quantity else view.result.unit(name), []).append(name)
    if len(groups) > 2:
        raise ParameterError("panels", f"one panel can show two units, but {', '.join(panel.names)} have {len(groups)}; split the panel.")
    for position, group in enumerate(groups.values()):
        side = axes if position == 0 else axes.twinx()
        if position:
            side.spines["right"].set_visible(True)
        for name in group:
            draw(side, name, LINE_STYLES[panel.names.index(name) % len(LINE_STYLES)], UNIT_COLOURS[position])
        side.set_ylim(*limits(np.concatenate([view.values[name][rows].ravel() for name in group])))
        side.set_ylabel(view.label(*group))
    if len(panel.names) > 1:
        place: Any = "best" if len(groups) == 1 else "lower right"  # "best" does not see the lines of the other axis
        styles = [Line2D([], [], color="black", linestyle=LINE_STYLES[i % len(LINE_STYLES)]) for i in range(len(panel.names))]
        axes.legend(styles, [view.symbol(name) for name in panel.names], loc=place, handlelength=2.4, framealpha=0.8)


def _draw_scalar(view: View, panel: Panel, axes: Axes) -> None:
    def draw(side: Axes, name: str, style: str, colour: str) -> None:
        marker = "o" if len(view.t) == 1 else ""
        side.plot(view.t, view.values[name], style, marker=marker, markersize=4, color=colour, label=name)

    draw_lines(view, panel, axes, draw)
    axes.set_xlim(*time_limits(view.t))
    axes.set_xlabel(view.time_label())


def _profiles(view: View) -> tuple[list[int], list[Any], list[str]]:
    """The stored times that profiles are shown at: their rows, colours and texts."""
    rows = spread_rows(view.t, PROFILES)
    shades = np.linspace(0.0, 0.9, len(rows)) if len(rows) > 1 else [0.0]
    return rows, [colour_map()(shade) for shade in shades], time_texts(view.t[rows])


def profile_legend(view: View, body: SubFigure) -> None:
    """The times of all profiles, below the panels."""
    _, colours, texts = _profiles(view)
    lines = [Line2D([], [], color=colour, linewidth=2) for colour in colours]
    body.legend(lines, texts, title=f"profiles at {view.time_label()}", loc="outside lower center", ncols=PROFILES, frameon=False)


def _draw_profile(view: View, panel: Panel, axes: Axes) -> None:
    positions = view.result.x
    assert positions is not None
    rows, colours, texts = _profiles(view)

    def draw(side: Axes, name: str, style: str, _: str) -> None:
        for row, colour, text in zip(rows, colours, texts, strict=True):
            side.plot(positions[row], view.values[name][row], style, color=colour, label=f"{name}, {view.time_text(text)}")

    draw_lines(view, panel, axes, draw, rows)
    axes.set_xlim(0.0, view.reach)
    axes.set_xlabel(view.position_label())


def time_limits(t: Array) -> tuple[float, float]:
    """Of an axis of the stored times `t`."""
    return (float(t[0]), float(t[-1])) if t[-1] > t[0] else limits(t)


def _draw_spacetime(view: View, panel: Panel, axes: Axes) -> None:
    """Colour over time and position, up to the wall; white beyond it."""
    assert view.edges is not None
    assert view.wall is not None
    name = panel.names[0]
    axes.set_xlabel(view.time_label())
    axes.set_ylabel(view.position_label())
    axes.set_xlim(*time_limits(view.t))
    axes.set_ylim(0.0, view.reach)
    if len(view.t) == 1:
        axes.text(0.5, 0.5, "needs two stored times", transform=axes.transAxes, ha="center", va="center")
        return
    times = np.linspace(view.t[0], view.t[-1], COLUMNS)
    if len(view.t) <= COLUMNS:
        times = np.union1d(times, view.t)
    edges = at_times(view.t, view.edges, times)
    rows = at_times(view.t, view.values[name], 0.5 * (times[1:] + times[:-1]))
    low, high = limits(view.values[name], margin=0.0)
    mesh = axes.pcolormesh(
        np.broadcast_to(times[:, None], edges.shape),
        edges,
        np.ma.masked_invalid(rows),
        cmap=colour_map(),
        vmin=low,
        vmax=high,
        rasterized=True,  # a vector file would otherwise hold every cell at every time
    )
    axes.plot(view.t, view.wall, color="black", linewidth=1.4, label="wall")
    _draw_fronts(view, axes)
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, fraction=0.08)
    bar.set_label(view.label(name))


def _draw_fronts(view: View, axes: Axes) -> None:
    """Positions within the domain by time: white, with a dark edge that sets them off from any colour."""
    edge = [withStroke(linewidth=2.4, foreground="black")]
    for name, style in zip(view.model.fronts, LINE_STYLES[1:], strict=False):
        if name in view.values:
            there = view.values[name] > 0.0
            there[:-1] |= there[1:]  # a front that comes up starts from the inner end
            position = np.where(there, view.values[name], np.nan)
            axes.plot(view.t, position, style, color="white", linewidth=1.2, path_effects=edge, label=name)


DRAW = {"scalar": _draw_scalar, "profile": _draw_profile, "spacetime": _draw_spacetime}
