"""A figure of how a growing disk or ball loses its round shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tumour.stability.modes import ModeGrowth
from tumour.stability.stiffness import CriticalTime

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST_SHARE = 1e-2
"""Share of its largest value that U/r must have for its growth rate to be drawn: below, it may change its sign."""


def figure(growth: ModeGrowth, critical: Mapping[float, CriticalTime] | None = None) -> Figure:
    """Draw the growth of departures from the round shape, the stiffness against them, and when it is lost.

    Parameters
    ----------
    growth : ModeGrowth
    critical : mapping of float to CriticalTime, optional
        By lambda_alpha; without it, the stiffness at the last time is drawn by wave number instead.

    Returns
    -------
    matplotlib.figure.Figure
        U/r per seed, its growth rate, the stiffness by time (drained; dashed: undrained), and critical times by lambda_alpha.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from multiphase.plotting import STYLE

    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(7.2, 5.4), layout="constrained")
        FigureCanvasAgg(picture)
        (size, rate), (stiff, last) = picture.subplots(2, 2)
        colours = _colours(growth)
        _draw_growth(size, rate, growth, colours)
        _draw_stiffness(stiff, growth, colours)
        if critical:
            _draw_critical(last, critical)
        else:
            _draw_last(last, growth)
        handles, labels = size.get_legend_handles_labels()
        picture.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 9), frameon=False)
    return picture


def letter(found: ModeGrowth | CriticalTime) -> str:
    """What the numbers of the modes are called: wave numbers k of a disk, degrees l of a ball."""
    return "k" if found.m == 2 else "l"


def _colours(growth: ModeGrowth) -> dict[int, tuple[float, ...]]:
    from multiphase.plotting import colour_map

    waves = growth.wave_numbers.tolist()
    places = np.linspace(0.0, 0.9, len(waves))
    return {k: tuple(colour_map()(place)) for k, place in zip(waves, places, strict=True)}


def _draw_growth(size: Axes, rate: Axes, growth: ModeGrowth, colours: Mapping[int, tuple[float, ...]]) -> None:
    """U/r by time in both left panels: its value, and its rate where it is not about to change its sign."""
    shape, rates = np.abs(growth.shape), growth.rate
    late = growth.t > 0.1 * growth.t[-1]
    for i, k in enumerate(growth.wave_numbers.tolist()):
        drawn = late & (shape[:, i] > LEAST_SHARE * np.nanmax(shape[:, i]))
        size.plot(growth.t[late], shape[late, i], color=colours[k], label=f"{letter(growth)} = {k}")
        rate.plot(growth.t[drawn], rates[drawn, i], color=colours[k])
    size.set(yscale="log", xlabel="time t", ylabel="|U|/r at the surface, per seed")
    size.set_title("Departure from the round shape", loc="left")
    rate.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    rate.set(xlabel="time t", ylabel="growth rate of U/r")
    rate.set_title("Its growth rate", loc="left")


def _draw_stiffness(axes: Axes, growth: ModeGrowth, colours: Mapping[int, tuple[float, ...]]) -> None:
    found = growth.stiffness
    for i, k in enumerate(found.wave_numbers.tolist()):
        axes.plot(found.t, found.drained[:, i], color=colours[k])
        axes.plot(found.t, found.undrained[:, i], "--", color=colours[k], linewidth=0.8)
    axes.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    axes.set(xlabel="time t", ylabel="stiffness / μ (dashed: undrained)")
    axes.set_title("Stiffness", loc="left")


def _draw_critical(axes: Axes, critical: Mapping[float, CriticalTime]) -> None:
    """The first drained zero by lambda_alpha, with its wave number; an arrow up where there is none."""
    for lam, found in critical.items():
        t, k = found.first
        if k:
            axes.plot(t, lam, "o", color="black", markersize=4)
            axes.annotate(f"{letter(found)} = {k}", (t, lam), xytext=(6, -9), textcoords="offset points", fontsize=8)
        else:
            axes.plot(found.t_end, lam, ">", color="0.5", clip_on=False)
            axes.annotate("none", (found.t_end, lam), xytext=(-6, 4), textcoords="offset points", fontsize=8, ha="right")
    firsts = [(found.first[0], lam) for lam, found in critical.items() if found.first[1]]
    axes.plot(*zip(*firsts, strict=True) if firsts else ([], []), color="black", linewidth=0.8, zorder=0)
    axes.set(xlabel="critical time", ylabel="λ")
    axes.margins(x=0.12, y=0.12)
    axes.set_title("When the first stiffness is lost", loc="left")


def _draw_last(axes: Axes, growth: ModeGrowth) -> None:
    found = growth.stiffness
    axes.plot(found.wave_numbers, found.drained[-1], "o-", color="black", label="drained")
    axes.plot(found.wave_numbers, found.undrained[-1], "o--", color="black", linewidth=0.8, markersize=3, label="undrained")
    axes.set(xlabel="wave number k" if found.m == 2 else "degree l", ylabel="stiffness / μ")
    axes.set_title(f"Stiffness at t = {found.t[-1]:g}", loc="left")
    axes.legend(frameon=False)
