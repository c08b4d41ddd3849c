"""The radial tumour: error against wall time, time error, cost by cells, elastic and viscous; FiPy against the method of lines.

    python -m benchmarks.tumour_radial [--repeats 5] > benchmarks/tumour_radial.md

Elastic: the paper's disk (preset paper) to t = 60, through the kink of the contact stress, which cells pass from t = 44 on. Viscous: the
paper's values with mobility "darcy" to t = 60. Errors are relative, of the radius and of alpha and C at the centre (the parabola through
two cells), against the values of 800 and 1600 cells at rtol 1e-7, extrapolated with 1/cells^2.
"""

from __future__ import annotations

import argparse
import statistics
import time
from functools import cache
from typing import Any

import numpy as np

from benchmarks.machine import heading
from multiphase.stepping import Control, Snapshot, State, Tracker, integrate, start
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import ElasticLines, ElasticRadau, ViscousLines, ViscousRadau
from tumour.solver import TumourSolver

END = 60.0
NAMES = {ElasticRadau: "radau", ElasticLines: "bdf2", ViscousRadau: "radau", ViscousLines: "bdf2"}


class Rows(Tracker):
    """Keeps what is stored."""

    def __init__(self) -> None:
        self.kept: list[Snapshot] = []

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.kept.append(snapshot)


def solve(
    kind: Any, shape: str, cells: int, rtol: float, times: tuple[float, ...] = (END,), dt: float | None = None
) -> tuple[Any, Any, float]:
    """Rows at `times`, counters, and wall time of the loop, set-up included."""
    elastic = issubclass(kind, (ElasticRadau, ElasticLines))
    parameters = TumourParameters.preset("paper") if elastic else TumourParameters()
    geometry = TumourGeometry(kind=shape, formulation="lagrangian" if elastic else "eulerian")
    started = time.perf_counter()
    scheme = kind(parameters, TumourInitial(), geometry, TumourSolver(cells=cells, rtol=rtol))
    control, rows = Control(order=2 if dt is None else 1, dt=dt, max_steps=1_000_000), Rows()
    state = integrate(scheme, start(scheme, 0.0, 1.0, control), list(times), control, [rows])
    return rows.kept, state.counters, time.perf_counter() - started


def values(row: Snapshot) -> Any:
    """Radius, and alpha and C at the centre."""
    centre = [f[0] - (f[1] - f[0]) / 8.0 for f in (row.fields["alpha"], row.fields["C"])]
    return np.array([row.scalars["radius"], *centre])


@cache
def reference(kind: Any, shape: str, t: float = END) -> Any:
    """Converged values at t."""
    coarse, fine = (values(solve(kind, shape, cells, 1e-7, (t,))[0][0]) for cells in (800, 1600))
    return fine + (fine - coarse) / 3.0


def accuracy(kinds: tuple[Any, Any], shape: str, repeats: int) -> None:
    exact = reference(kinds[0], shape)
    print(f"\n### {shape}: R = {exact[0]:.5f}, alpha(0) = {exact[1]:.5f}, C(0) = {exact[2]:.5f} at t = {END:g}\n")
    print("| scheme | cells | rtol | R | alpha(0) | C(0) | steps | rejected | iterations | ms |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for kind in kinds:
        for cells, rtol in (
            (50, 1e-3),
            (100, 1e-3),
            (100, 1e-4),
            (200, 1e-3),
            (200, 1e-4),
            (200, 1e-5),
            (400, 1e-4),
            (400, 1e-5),
            (800, 1e-6),
        ):
            runs = [solve(kind, shape, cells, rtol) for _ in range(repeats)]
            report(NAMES[kind], cells, f"{rtol:.0e}", runs, exact)
    if issubclass(kinds[1], ElasticLines):
        runs = [solve(kinds[1], shape, 200, 1e-6, dt=0.5) for _ in range(repeats)]
        report("backward Euler, dt = 0.5", 200, "-", runs, exact)


def report(name: str, cells: int, rtol: str, runs: list[Any], exact: Any) -> None:
    rows, c, _ = runs[-1]
    errors = " | ".join(f"{abs(e):.1e}" for e in values(rows[-1]) / exact - 1.0)
    counts = f"{c['steps']} | {c['rejected_error'] + c['rejected_solver']} | {c['iterations']}"
    print(f"| {name} | {cells} | {rtol} | {errors} | {counts} | {1e3 * statistics.median(r[2] for r in runs):.1f} |", flush=True)


def time_errors() -> None:
    print("\n## Time error\n\nLargest difference of r/R, alpha and C at t = 40 from rtol 1e-9 on the same 200 cells, over rtol; radau.\n")
    print(
        "| rheology | shape | "
        + " | ".join(f"{rtol:.0e}" for rtol in (1e-3, 1e-4, 1e-5, 1e-6))
        + " |\n| --- | --- | --- | --- | --- | --- |"
    )
    for kind, rheology in ((ElasticRadau, "elastic"), (ViscousRadau, "viscous")):
        for shape in ("slab", "disk", "sphere"):
            exact = solve(kind, shape, 200, 1e-9, (40.0,))[0][0]
            ratios = []
            for rtol in (1e-3, 1e-4, 1e-5, 1e-6):
                row = solve(kind, shape, 200, rtol, (40.0,))[0][0]
                errors = [np.abs(row.fields[name] - exact.fields[name]).max() for name in ("alpha", "C")]
                errors.append(np.abs(row.x - exact.x).max() / exact.scalars["radius"])
                ratios.append(f"{max(errors) / rtol:.2g}")
            print(f"| {rheology} | {shape} | " + " | ".join(ratios) + " |", flush=True)


def cost(repeats: int) -> None:
    print("\n## Cost by cells\n\nrtol 1e-4, disk to t = 60, radau.\n\n| rheology | cells | ms | iterations | us / iteration / cell |")
    print("| --- | --- | --- | --- | --- |")
    for kind, rheology in ((ElasticRadau, "elastic"), (ViscousRadau, "viscous")):
        for cells in (100, 200, 400, 800, 1600):
            runs = [solve(kind, "disk", cells, 1e-4) for _ in range(repeats)]
            seconds, iterations = statistics.median(r[2] for r in runs), runs[-1][1]["iterations"]
            print(f"| {rheology} | {cells} | {1e3 * seconds:.1f} | {iterations} | {1e6 * seconds / iterations / cells:.3f} |", flush=True)


def fipy(repeats: int) -> None:
    from tumour.fipy_scheme import FipyScheme

    print("\n## FiPy and lines\n\nViscous, rtol 1e-5, at t = 20: largest difference of alpha and relative difference of R to lines")
    print("on the same cells and extrapolated, and wall times.\n")
    print(
        "| shape | cells | R, same cells | alpha, same cells | R, converged | alpha(0), converged | FiPy, s | lines, s |\n"
        + "| --- " * 8
        + "|"
    )
    for shape in ("slab", "disk", "sphere"):
        exact = reference(ViscousRadau, shape, 20.0)
        for cells in (25, 50, 100, 200, 400):
            lines, _, quick = solve(ViscousRadau, shape, cells, 1e-5, (20.0,))
            runs = [solve(FipyScheme, shape, cells, 1e-5, (20.0,)) for _ in range(repeats if cells <= 100 else 1)]
            row = runs[-1][0][0]
            same = abs(row.scalars["radius"] / lines[0].scalars["radius"] - 1.0)
            alpha = np.abs(row.fields["alpha"] - lines[0].fields["alpha"]).max()
            far = np.abs(values(row) / exact - 1.0)
            seconds = statistics.median(r[2] for r in runs)
            print(
                f"| {shape} | {cells} | {same:.1e} | {alpha:.1e} | {far[0]:.1e} | {far[1]:.1e} | {seconds:.2f} | {quick:.3f} |", flush=True
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    print(f"# The radial tumour\n\n{heading()}\nMedians of {repeats}; import and compilation excluded.")
    for kind in NAMES:
        solve(kind, "disk", 20, 1e-2)
    print("\n## Error against wall time, elastic")
    accuracy((ElasticRadau, ElasticLines), "disk", repeats)
    print("\n## Error against wall time, viscous")
    for shape in ("slab", "disk", "sphere"):
        accuracy((ViscousRadau, ViscousLines), shape, repeats)
    time_errors()
    cost(repeats)
    fipy(min(repeats, 3))


if __name__ == "__main__":
    main()
