"""Error against wall time of a study."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from multiphase.plotting.style import LINE_STYLES, STYLE, TITLE_WIDTH
from multiphase.precision.accuracy import Measurement

if TYPE_CHECKING:
    from multiphase.precision.report import Study

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # told apart by colour-blind eyes
MARKERS = ("o", "s", "^", "D", "v", "P")


def draw(study: Study) -> Figure:
    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(7.0, 5.2), layout="constrained")
        FigureCanvasAgg(picture)
        body: SubFigure = picture.subfigures(1, 1, squeeze=True)  # type: ignore[assignment]
        axes = body.add_subplot()
        rows = [row for row in study.measurements if row.seconds > 0.0 and row.error > 0.0]
        if rows:
            handles = _draw_rows(axes, rows, study.difference)
            body.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, title="numbers beside the points: cells")
        else:
            axes.text(0.5, 0.5, "no run has an error to show", transform=axes.transAxes, ha="center", va="center")
        name = study.scene.model.film
        quantity = study.scene.model.quantities.get(name)
        axes.set_xlabel("wall time of one run [s]")
        axes.set_ylabel(f"error of {f'${quantity.symbol}$' if quantity else name}, relative (mean over cells, largest over times)")
        picture.suptitle(textwrap.fill(study.title, TITLE_WIDTH), parse_math=False)
        footer = [textwrap.fill(line, 120) for line in (*study.about()[1:], *study.setting())]
        picture.supxlabel("\n".join(footer), parse_math=False, fontsize=6.5, color="0.3")
    return picture


def _draw_rows(axes: Axes, rows: Sequence[Measurement], difference: float | None) -> list[Line2D]:
    """Lines of equal rtol in the colour of their method, the Pareto front beneath them, and the floor; returns the legend's lines."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    methods, rtols = list(dict.fromkeys(row.method for row in rows)), sorted({row.rtol for row in rows}, reverse=True)
    front = sorted((row for row in rows if row.pareto), key=lambda row: row.seconds)
    axes.step([row.seconds for row in front], [row.error for row in front], where="post", color="0.8", linewidth=5, zorder=1, label="front")
    handles = []
    for i, method in enumerate(methods):
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)], "markersize": 5}
        handles.append(Line2D([], [], linestyle="", label=method, **style))
        for j, rtol in enumerate(rtols):
            line = [row for row in rows if row.method == method and row.rtol == rtol]
            style["linestyle"] = LINE_STYLES[j % len(LINE_STYLES)]
            axes.plot([row.seconds for row in line], [row.error for row in line], label=f"{method}, rtol = {rtol:g}", **style)
            if j == 0:
                _name_cells(axes, line)
    handles += [
        Line2D([], [], color="black", linestyle=LINE_STYLES[j % len(LINE_STYLES)], label=f"rtol = {rtol:g}") for j, rtol in enumerate(rtols)
    ]
    handles.append(Line2D([], [], color="0.8", linewidth=5, label="Pareto front"))
    if difference:
        axes.axhline(difference, color="black", linewidth=0.8, linestyle=(0, (1, 3)))
        handles.append(Line2D([], [], color="black", linewidth=0.8, linestyle=(0, (1, 3)), label="difference of the references"))
    axes.set_axisbelow(True)
    axes.grid(which="major", color="0.92", linewidth=0.6)
    return handles


def _name_cells(axes: Axes, line: Sequence[Measurement]) -> None:
    """Write the number of cells beside the points of one line."""
    for row in line:
        axes.annotate(str(row.cells), (row.seconds, row.error), xytext=(4, 4), textcoords="offset points", fontsize=7, color="0.3")
