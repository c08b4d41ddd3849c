"""What a disk in two dimensions does when its round shape becomes unstable: runs through the critical time of the linear theory.

    python -m benchmarks.tumour_buckling --figure docs/figures/buckling.png > benchmarks/tumour_buckling.md

Runs start with a small seed r^k cos(k theta) in the cell fraction, or with none, on several meshes. The equations have no inertia. Where
the equilibrium that a run follows ends in a fold, no step leads on; a drag on the motion of the cells, eta d_t in the balance of momentum,
then shows where the body goes.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import heading
from multiphase.errors import SolverError
from multiphase.stepping import Control, State, StepFailure, StopRun, Tracker, integrate, start
from tumour import TumourInitial, TumourParameters, meshes
from tumour.fem.scheme import MiniScheme
from tumour.fem.stability import stiffness
from tumour.meshes.body import boundary_edges
from tumour.meshes.polygons import first_crossing
from tumour.solver import TumourSolver
from tumour.stability import critical_time, modes

Array = np.ndarray

PAPER = TumourParameters.preset("paper")
ALPHA, LAMBDA = 0.82, 0.05
EVERY = 1.0
"""Longest time without a stop, so that no step is longer."""
WAVES = tuple(range(2, 9))
KEY = f"""\
The paper's values, mobility as printed, alpha = {ALPHA:g} at first, and seeds eps r^k cos(k theta) in it; `all k` is the sum of k = 2, 4,
6, 8 on a quarter disk, k = 2 to 8 on a disk. `U` is the coefficient of cos(k theta) in the radial displacement of the surface, over the
angle at rest (on a disk, of any phase), for the k that is largest at the end. t* is the first drained zero of the linear theory (of a
whole disk), and `U(60)`, `U(t*)` are U then; `others then` are the other k and their U. `stiffness` is the least undrained one at the
end, over that at rest. `crosses`: when the surface first crosses itself. BDF of order two with error control (rtol) or steps of dt, none
above {EVERY:g}; newton_tol = 1e-8. Seconds of wall clock on a busy machine."""


class Dragged(MiniScheme):
    """The scheme with a drag on the motion of the cells: ``Div P = eta d_t``, lumped in the points of the mesh, per area at rest."""

    eta = 0.0
    _before: Array | None = None

    def _kernel(self) -> Any:
        kernel = super()._kernel()

        def add(tau: float, nodal: Array, R: Array, values: Array | None) -> None:
            if self._before is None or not 0.0 < tau < np.inf:
                return
            drag = np.zeros((self.count, 5))
            drag[:, :2] = self.eta / tau * self.observation.weights[:, None]
            R[:, :2] += drag[:, :2] * (nodal[:, :2] - self._before)
            if values is not None:
                rows = self.newton.rows
                diagonal = np.flatnonzero(rows.indices == np.repeat(np.arange(len(rows.free)), np.diff(rows.indptr)))
                values[diagonal] += drag.ravel()[rows.free]

        def residual(*arguments: Any) -> int:
            code: int = kernel["residual"](*arguments)
            if code < 0:
                add(arguments[2], arguments[3], arguments[-2], None)
            return code

        def tangent(*arguments: Any) -> int:
            code: int = kernel["tangent"](*arguments)
            if code < 0:
                add(arguments[2], arguments[3], arguments[-2], arguments[-4])
            return code

        class Kernel:
            def __getitem__(self, name: str) -> Any:
                return {"residual": residual, "tangent": tangent}.get(name) or kernel[name]

        return Kernel()

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Any:
        self._before = self.point(past).nodal[:, :2].copy()
        return super().solve(t, alpha, past, guess)

    def explain(self, u: Array) -> str:
        """Nothing: a short step is no sign here that there is none."""
        return ""


class Edge(Tracker):
    """The shape of the surface after every step."""

    def __init__(self, scheme: MiniScheme, *, whole: bool) -> None:
        self._scheme, self._whole = scheme, whole
        x, y = scheme.points.T
        on = np.flatnonzero(np.abs(np.hypot(x, y) - scheme.body.radius) < 1e-9)
        theta = np.arctan2(y[on], x[on])
        order = np.argsort(theta)
        self._on, self._theta = on[order], theta[order]
        self._edges = boundary_edges(scheme.body.mesh.t.T)
        self.t: list[float] = []
        self.U: list[Array] = []
        self.crossed = np.nan
        self.last: State | None = None

    def on_step(self, state: State) -> None:
        d = self._scheme.point(state.u[0]).nodal[:, :2]
        theta, on = self._theta, self._on
        radial = d[on, 0] * np.cos(theta) + d[on, 1] * np.sin(theta)
        if self._whole:
            U = [2.0 * abs(np.mean(radial * np.exp(1j * k * theta))) for k in WAVES]  # equal angles
        else:
            U = [np.trapezoid(radial * np.cos(k * theta), theta) / (0.25 * np.pi) if k % 2 == 0 else 0.0 for k in WAVES]
        self.t.append(state.t)
        self.U.append(np.array(U))
        self.last = state
        if np.isnan(self.crossed) and first_crossing(self._scheme.points + d, self._edges) is not None:
            self.crossed = state.t

    def outline(self) -> Array:
        """The points of the surface now."""
        assert self.last is not None
        return np.asarray((self._scheme.points + self._scheme.point(self.last.u[0]).nodal[:, :2])[self._on])


@dataclass(frozen=True)
class Run:
    """A run: its steps, the modes after each, and how it ended."""

    t: Array
    U: Array
    outline: Array
    stiffness: float
    least_step: float
    failed: bool
    crossed: float
    seconds: float

    @property
    def largest(self) -> int:
        """The k that is largest at the end."""
        return WAVES[int(np.argmax(np.abs(self.U[-1])))]

    def at(self, t: float, k: int) -> float:
        """U of k at a time, nothing after the end."""
        return float(np.interp(t, self.t, self.U[:, WAVES.index(k)], right=np.nan))


def formula(seed: float, waves: Sequence[int]) -> str | float:
    """The cell fraction at first."""
    return f"{ALPHA} + {seed}*(" + " + ".join(f"r**{k}*cos({k}*theta)" for k in waves) + ")" if seed else ALPHA


def run(
    rings: int, *, lam: float = LAMBDA, seed: float = 0.0, waves: Sequence[int] = (4,), whole: bool = False, eta: float = 0.0,
    rtol: float = 1e-4, dt: float | None = None, t_end: float = 80.0, diagnose: bool = True,
) -> Run:  # fmt: skip
    """Grow a disk, or a quarter of it, until t_end or until no step leads on."""
    body = (meshes.disk if whole else meshes.quarter_disk)(1.0, rings)
    scheme = (Dragged if eta else MiniScheme)(
        replace(PAPER, lambda_alpha=lam), TumourInitial(alpha=formula(seed, waves)), body,
        TumourSolver(method="mini", rtol=rtol, newton_tol=min(1e-8, 0.01 * rtol)),
    )  # fmt: skip
    if isinstance(scheme, Dragged):
        scheme.eta = eta
    edge, control = Edge(scheme, whole=whole), Control(dt=dt)
    began, failed = time.perf_counter(), False
    state = start(scheme, 0.0, EVERY, control)
    try:
        integrate(scheme, state, np.arange(EVERY, t_end + 0.5 * EVERY, EVERY).tolist(), control, [edge])
    except SolverError:
        failed = True
    took = time.perf_counter() - began
    stiff = np.nan
    if diagnose and edge.last is not None:
        with contextlib.suppress(StepFailure):
            stiff = stiffness(scheme, edge.last.u[0])[0] / stiffness(scheme, scheme.initial())[0]
    t = np.array(edge.t)
    return Run(t, np.array(edge.U), edge.outline(), stiff, float(np.diff(t[-40:]).min()), failed, edge.crossed, took)


def undrained_zero(rings: int) -> float:
    """When the undrained stiffness of the quarter disk that stays round is 0 on a mesh."""
    scheme = MiniScheme(
        replace(PAPER, lambda_alpha=LAMBDA), TumourInitial(alpha=ALPHA), meshes.quarter_disk(1.0, rings),
        TumourSolver(method="mini", rtol=1e-4, newton_tol=1e-8),
    )  # fmt: skip
    found: list[tuple[float, float]] = []

    class Look(Tracker):
        def on_save(self, state: State, snapshot: Any) -> None:
            found.append((state.t, stiffness(scheme, state.u[0])[0]))
            if found[-1][1] < 0.0:
                raise StopRun("it has passed 0")

    control = Control()
    with contextlib.suppress(StopRun):
        integrate(scheme, start(scheme, 0.0, EVERY, control), np.arange(73.0, 80.0, EVERY).tolist(), control, [Look()])
    (t, s), (last, negative) = found[-2:]
    return t + (last - t) * s / (s - negative)


def number(value: float, form: str) -> str:
    """A number, or nothing."""
    return "" if np.isnan(value) else format(value, form)


def line(found: Run, critical: float, *names: str) -> str:
    """A row of a table."""
    k = found.largest
    others = ", ".join(f"{q}: {u:.0e}" for q, u in zip(WAVES, found.U[-1], strict=True) if q != k and abs(u) > 1e-5)
    cells = [
        *names, str(k), number(found.at(60.0, k), ".1e"), number(found.at(critical, k), ".1e"), f"{found.t[-1]:.2f}",
        f"{found.U[-1][WAVES.index(k)]:.3f}", others, number(found.stiffness, ".3f"),
        f"no step on, last {found.t[-1] - found.t[-2]:.0e}" if found.failed else "completed", number(found.crossed, ".1f"),
        f"{found.seconds:.0f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


HEAD = "k | U(60) | U(t*) | t at the end | U then | others then | stiffness | how | crosses | seconds |"


def table(title: str, columns: str) -> None:
    print(f"\n## {title}\n\n| {columns} | {HEAD}\n|{' --- |' * (columns.count('|') + 1 + HEAD.count('|'))}", flush=True)


def runs_of(rings: Sequence[int], critical: dict[float, float]) -> dict[tuple[Any, ...], Run]:
    """Print the tables of the runs; those that the figure shows, by rings, seed and drag."""
    shown: dict[tuple[Any, ...], Run] = {}
    first = critical[LAMBDA]
    table(f"Quarter disk, lambda_alpha = {LAMBDA:g}, t* = {first:.1f} (k = 4)", "rings | seed | rtol or dt")

    def show(label: str, steps: str, n: int, **options: Any) -> Run:
        found = run(n, **options)
        print(line(found, first, str(n), label, steps), flush=True)
        return found

    fine = max(rings)
    for n in rings:
        for seed in (1e-4, 1e-3) if n > 40 else (1e-4, 1e-3, 1e-2):
            shown[n, seed, 0.0] = show(f"k = 4, {seed:.0e}", "1e-4", n, seed=seed)
    for n in [n for n in rings if n <= 40]:
        show("none", "1e-4", n)
        show("k = 4, -1e-03", "1e-4", n, seed=-1e-3)
        show("all k, 1e-04", "1e-4", n, seed=1e-4, waves=(2, 4, 6, 8))
        show("k = 4, 1e-03", "1e-5", n, seed=1e-3, rtol=1e-5)
        show("k = 4, 1e-03", "dt = 0.25", n, seed=1e-3, dt=0.25, t_end=77.0)

    zeros = ", ".join(f"{undrained_zero(n):.2f} on {n} rings" for n in rings if n <= 40)
    theory = critical_time(replace(PAPER, lambda_alpha=LAMBDA), initial=TumourInitial(alpha=ALPHA), wave_numbers=[4], t_end=80.0, cells=200)
    print(f"\nUndrained stiffness of the round state 0 at t = {zeros}; linear theory {theory.undrained[0]:.2f}.", flush=True)

    table("With a drag, quarter disk, lambda_alpha = 0.05", "rings | eta | seed")
    for n, eta in ((20, 0.01), (40, 0.1), (40, 0.01)):
        if n <= fine:
            found = run(n, eta=eta, seed=1e-3, t_end=80.0 if n == 20 else 75.0)
            shown[n, 1e-3, eta] = found
            print(line(found, first, str(n), f"{eta:g}", "k = 4, 1e-03"), flush=True)

    table("Others", "body | lambda_alpha | t* | rings | seed")
    for lam, whole, n, seed, waves, t_end in (
        (0.3, False, 20, 1e-2, (4,), 100.0), (0.3, False, 40, 1e-2, (4,), 100.0), (0.01, False, 20, 1e-3, (4,), 72.0),
        (0.01, False, 40, 1e-3, (4,), 72.0), (0.05, True, 20, 0.0, (4,), 80.0),
        (0.05, True, 20, 1e-4, WAVES, 80.0),
    ):  # fmt: skip
        if n <= fine:
            label = f"{'all k' if len(waves) > 1 else f'k = {waves[0]}'}, {seed:.0e}" if seed else "none"
            found = run(n, lam=lam, whole=whole, seed=seed, waves=waves, t_end=t_end)
            name = "disk" if whole else "quarter"
            print(line(found, critical[lam], name, f"{lam:g}", number(critical[lam], ".1f"), str(n), label), flush=True)
    return shown


def draw(path: Path, shown: dict[tuple[Any, ...], Run], rings: Sequence[int]) -> None:
    """The amplitude of k = 4 by time beside the linear theory, by mesh and by seed, and outlines."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from multiphase.plotting import STYLE, colour_map

    at, parameters, initial = WAVES.index(4), replace(PAPER, lambda_alpha=LAMBDA), TumourInitial(alpha=ALPHA)
    critical = critical_time(parameters, initial=initial, wave_numbers=[4], t_end=80.0, cells=200).first[0]
    theory = modes(parameters, initial=initial, wave_numbers=[4], t_end=critical, cells=200, dt=0.1, rows=1)
    middle = sorted(rings)[len(rings) // 2]
    places = (0.1, 0.45, 0.8)
    bare, dragged = shown[middle, 1e-3, 0.0], shown[middle, 1e-3, 0.01]

    def steps(ax: Any, found: Run, mark: str, colour: Any, label: str) -> None:
        t, U = found.t, np.abs(found.U[:, at])
        ax.plot(t, U, mark, markersize=3.5, color=colour, label=label, markerfacecolor="none", zorder=3)
        if found.failed:
            ax.plot(t[-1], U[-1], "x", color=colour, markersize=8, markeredgewidth=2.0, zorder=4)

    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(7.2, 5.8), layout="constrained")
        FigureCanvasAgg(picture)
        (by_mesh, by_seed), (jump, surface) = picture.subplots(2, 2)
        for ax in (by_mesh, by_seed, jump):
            ax.axvline(critical, color="0.5", linewidth=0.9, linestyle="--", zorder=0)
            ax.text(critical, 1.0, "t*", transform=ax.get_xaxis_transform(), ha="center", va="bottom", fontsize=8)
            ax.set(xlabel="time t", ylabel="|U| of cos 4θ, in radii at rest")
        for ax, seeds in ((by_mesh, (1e-3,)), (by_seed, (1e-2, 1e-3, 1e-4))):
            for seed in seeds:
                label = "linear theory" if seed == 1e-3 else None
                ax.plot(theory.t, seed * np.abs(theory.amplitude[:, 0]), color="black", linewidth=0.9, label=label)
        for n, mark, place in zip(rings, "o^s", reversed(places), strict=False):
            steps(by_mesh, shown[n, 1e-3, 0.0], mark, colour_map()(place), f"{n} rings")
        for seed, mark, place in zip((1e-2, 1e-3, 1e-4), "s^o", places, strict=True):
            steps(by_seed, shown[middle, seed, 0.0], mark, colour_map()(place), f"seed {seed:.0e}")
        by_mesh.plot([], [], "x", color="black", markersize=8, markeredgewidth=2.0, label="no step leads on")
        by_mesh.set(yscale="log", xlim=(50.0, 80.0), ylim=(2e-4, 2.0))
        by_seed.set(yscale="log", xlim=(58.0, 76.0), ylim=(1e-7, 2.0))
        by_mesh.set_title("Seed 1e-3, by mesh", loc="left")
        by_seed.set_title(f"{middle} rings, by seed", loc="left")
        for (n, _, eta), place, style in zip([key for key in shown if key[0] == middle and key[2]], (0.8, 0.1), ("--", "-"), strict=False):
            found = shown[n, 1e-3, eta]
            jump.plot(found.t, np.abs(found.U[:, at]), style, color=colour_map()(place), linewidth=1.3, label=f"with drag, η = {eta:g}")
        steps(jump, bare, "o", "black", "without")
        jump.set(xlim=(71.0, 75.0), ylim=(0.0, 0.9))
        jump.set_title(f"{middle} rings, seed 1e-3", loc="left")
        surface.plot(*bare.outline.T, "--", color="black", linewidth=1.0, label=f"without drag, t = {bare.t[-1]:.1f}")
        surface.plot(*dragged.outline.T, color=colour_map()(0.1), linewidth=1.3, label=f"with drag, t = {dragged.t[-1]:.1f}")
        surface.set(aspect="equal", xlim=(0.0, 5.8), ylim=(0.0, 6.6), xlabel="x, in radii at rest", ylabel="y, in radii at rest")
        surface.set_title("The surface at the end", loc="left")
        for ax, where in ((by_mesh, "upper left"), (by_seed, "lower left"), (jump, "upper left"), (surface, "upper right")):
            ax.legend(frameon=False, fontsize=8, loc=where)
        picture.savefig(path, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rings", type=int, nargs="+", default=[20, 40, 80])
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    print(f"# Through the loss of symmetry in two dimensions\n\n{heading()}\n\n{KEY}", flush=True)
    critical = {
        lam: critical_time(replace(PAPER, lambda_alpha=lam), initial=TumourInitial(alpha=ALPHA), t_end=100.0, cells=200).first[0]
        for lam in (0.01, 0.05, 0.3)
    }
    shown = runs_of(options.rings, critical)
    if options.figure:
        draw(options.figure, shown, options.rings)
    return 0


if __name__ == "__main__":
    sys.exit(main())
