"""The figure of a cross-check: profiles of both solvers, their differences and the scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from multiphase.plotting.style import LINE_STYLES, STYLE, colour_map

if TYPE_CHECKING:
    from tumour.crosscheck import CrossCheck

SYMBOLS = {"alpha": r"$\alpha$", "C": "$C$", "p": "$p$", "displacement": "$d$, radial part"}
COLOURS = {"radius": "0.5", "alpha": "#0072b2", "C": "#d55e00", "p": "#009e73", "displacement": "#cc79a7"}
SHOWN = 3
"""Times at which profiles are drawn."""
NOTHING = 1e-14
"""Less is rounding, and not shown on a logarithmic axis."""


def draw(check: CrossCheck) -> Figure:
    """Above, averages over the rings at some times: lines are radial, points in two dimensions with bars to the largest deviation round a
    ring. Below, differences and root mean square scatter against time."""
    names = [name for name in check.names if name in SYMBOLS]
    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(max(2.5 * len(names), 8.0), 5.6), layout="constrained")
        FigureCanvasAgg(picture)
        upper, lower = picture.subfigures(2, 1, squeeze=False)[:, 0]
        later = np.flatnonzero(check.times > 0.0)
        rows = np.unique(later[np.linspace(0, len(later) - 1, SHOWN).round().astype(int)])
        for axes, name in zip(np.atleast_1d(upper.subplots(1, len(names))), names, strict=True):
            _profiles(axes, check, name, rows)
        left, right = lower.subplots(1, 2, sharey=True)
        _by_time(left, check, ["radius", *names], "difference, over the largest value")
        _by_time(right, check, names, "scatter round a ring (rms), over the largest value", scatter=True)
        handles = [Line2D([], [], color=COLOURS[name], label=SYMBOLS.get(name, name)) for name in ("radius", *names)]
        lower.legend(handles=handles, loc="outside right center", frameon=False)
        times = ", ".join(f"{check.times[row]:g}" for row in rows)
        picture.suptitle(f"{check.sizes[0]} (points) and the radial solver (lines), t = {times}", parse_math=False)
        if check.refusals:
            picture.supxlabel("no agreement is claimed: " + "; ".join(check.refusals), parse_math=False, fontsize=7)
    return picture


def _profiles(axes: Axes, check: CrossCheck, name: str, rows: NDArray[np.int64]) -> None:
    middles = 0.5 * (check.edges[1:] + check.edges[:-1])
    for k, row in enumerate(rows):
        colour = colour_map()(0.85 * k / max(len(rows) - 1, 1))
        axes.plot(middles, check.radial[name][row], color=colour)
        axes.errorbar(middles, check.plane[name][row], yerr=check.largest[name][row], fmt="o", markersize=3, color=colour, elinewidth=0.8)
    axes.set_title(SYMBOLS[name])
    axes.set_xlabel("$R/R_0$")


def _by_time(axes: Axes, check: CrossCheck, names: list[str], title: str, *, scatter: bool = False) -> None:
    axes.set_yscale("log")
    for name in names:
        values = check.scatter(name) if scatter else check.difference(name)
        shown = np.where((check.times > 0.0) & (values > NOTHING), values, np.nan)
        axes.plot(check.times, shown, color=COLOURS[name], marker="." if len(check.times) < 20 else "", linestyle=LINE_STYLES[0])
    axes.set_title(title)
    axes.set_xlabel("t")
    axes.set_axisbelow(True)
    axes.grid(which="major", color="0.92", linewidth=0.6)
