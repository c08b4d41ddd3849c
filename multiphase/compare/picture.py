"""The figure of the differences of two results."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from multiphase.compare.differences import Difference
from multiphase.plotting.style import LINE_STYLES, STYLE

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # told apart by colour-blind eyes
SIDES: Any = {"": "-", "A": "--", "B": ":"}
FLOOR = 1e-16
"""What is less, 0 among it, is not shown on a logarithmic axis: the rounding of a number of its own scale."""
DECADES = 7
"""Of a logarithmic axis, from its largest value down: what is less beside it need not be seen."""


def draw(
    differences: Sequence[Difference], scatter: Sequence[Difference], times: Sequence[float], place: str, notes: Sequence[str]
) -> Figure:
    """Differences of fields with their scatter, and of scalars that count, against time; of fields against position where there are
    positions."""
    fields = [entry for entry in differences if entry.kind == "field"]
    scalars = [entry for entry in differences if entry.kind == "scalar" and entry.physical]
    along = [entry for entry in (*fields, *scatter) if entry.along]
    with matplotlib.rc_context(STYLE):
        count = bool(fields) + bool(along) + bool(scalars)
        lines = [line for note in notes for line in textwrap.wrap(note, 48 * count)]
        picture = Figure(figsize=(4.2 * count, 4.3 + 0.14 * len(lines)), layout="constrained")
        FigureCanvasAgg(picture)
        axes = iter(picture.subplots(1, count, squeeze=False)[0])
        if fields:
            shown = [*fields, *scatter]
            _lines(next(axes), shown, "t", "fields: largest over the body", [(times, entry.course) for entry in shown])
        if along:
            label = f"${place}$" if "_" in place else place
            _lines(next(axes), along, label, "fields: over the body, when largest", [_columns(entry) for entry in along])
        if scalars:
            _lines(next(axes), scalars, "t", "scalars", [(times, entry.course) for entry in scalars])
        picture.suptitle("|A - B| over the largest value of either")
        picture.supxlabel("\n".join(lines), parse_math=False, fontsize=6.5, color="0.3")
    return picture


def _columns(entry: Difference) -> tuple[Sequence[float], Sequence[float]]:
    return [place for place, _ in entry.along], [value for _, value in entry.along]


def _lines(
    axes: Axes, entries: Sequence[Difference], label: str, title: str, data: Sequence[tuple[Sequence[float], Sequence[float]]]
) -> None:
    """One line for each entry, its colour that of its name; the scatter of A is dashed, that of B dotted."""
    names = list(dict.fromkeys(entry.name for entry in entries))
    top = 0.0
    for entry, (at, values) in zip(entries, data, strict=True):
        k = names.index(entry.name)
        style = SIDES[entry.side] if entry.side else LINE_STYLES[2 * (k // len(COLOURS)) % 4]
        shown = [value if math.isfinite(value) and value > FLOOR else math.nan for value in values]
        axes.plot(at, shown, color=COLOURS[k % len(COLOURS)], linestyle=style, marker="." if len(at) < 30 else "")
        top = max([top, *(value for value in shown if value > 0.0)])
    if top > 0.0:
        axes.set_yscale("log")
        low = min(value for line in axes.lines for value in np.asarray(line.get_ydata(), dtype=float) if value > 0.0)
        axes.set_ylim(max(0.5 * low, top * 10.0**-DECADES), 2.0 * top)
    else:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no difference", transform=axes.transAxes, ha="center", va="center")
    axes.set_title(title)
    axes.set_xlabel(label)
    axes.set_axisbelow(True)
    axes.grid(which="major", color="0.92", linewidth=0.6)
    handles = [
        Line2D([], [], color=COLOURS[k % len(COLOURS)], linestyle=LINE_STYLES[2 * (k // len(COLOURS)) % 4], label=name)
        for k, name in enumerate(names)
    ]
    sides = dict.fromkeys(entry.side for entry in entries if entry.side)
    handles += [Line2D([], [], color="0.4", linestyle=SIDES[side], label=f"scatter in {side} (rms)") for side in sides]
    axes.legend(handles=handles, frameon=False, fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
