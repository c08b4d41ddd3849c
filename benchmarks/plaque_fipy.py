"""The FiPy scheme on the reference problem: error against a converged solution, wall time, and where the time goes.

    python -m benchmarks.plaque_fipy [--repeats 5] > benchmarks/plaque_fipy.md

Reference problem: Psi_l = 1, Psi_m = 0.5, k_l = k_m = 2, b = 20, nu_n = nu_m = 1, A = 0.5, B = 1, k = 1, interfacial,
n(x, 0) = 0.1 + 0.05 cos^2(pi xi), l(x, 0) = 0.2, L(0) = 0.5, to T = 2. Errors are against 1600 cells of the
method of lines at rtol 1e-8.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import multiphase.fipy_newton as scheme_module
from benchmarks.machine import heading
from benchmarks.plaque_reference import INITIAL, problem
from benchmarks.plaque_reference import solve as solve_by_lines
from multiphase.stepping import Control, integrate, start
from plaque1d.fipy_scheme import FipyScheme
from plaque1d.parameters import PlaqueGeometry


class Clock:
    """Adds up the time spent in what it wraps."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any, **options: Any) -> Any:
            started = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds += time.perf_counter() - started

        return timed


class Timed:
    """A FiPy equation whose assembly is timed."""

    def __init__(self, equation: Any, clock: Clock) -> None:
        self.justResidualVector = clock.around(equation.justResidualVector)


def solve(cells: int, rtol: float) -> tuple[FipyScheme, Any, float]:
    """Scheme, final state and wall time of the loop."""
    scheme = FipyScheme(problem("interfacial"), INITIAL, PlaqueGeometry(), cells, rtol)
    control = Control()
    save_at = [0.2 * i for i in range(11)]
    state = start(scheme, 0.0, save_at[1], control)
    started = time.perf_counter()
    with threadpool_limits(limits=1):
        state = integrate(scheme, state, save_at, control)
    return scheme, state, time.perf_counter() - started


def split(cells: int, rtol: float) -> tuple[float, float, float]:
    """Seconds in FiPy's assembly, in the linear solver, and in the rest."""
    assembly, linear = Clock(), Clock()
    original_build, original_splu = FipyScheme._build, scheme_module.splu

    def build(self: FipyScheme, *arguments: Any) -> None:
        original_build(self, *arguments)
        for name in ("_n_equation", "_l_equation", "_w_equation"):
            setattr(self, name, Timed(getattr(self, name), assembly))

    class Factor:
        def __init__(self, matrix: Any) -> None:
            self._factor = linear.around(original_splu)(matrix)
            self.solve = linear.around(self._factor.solve)

    FipyScheme._build, scheme_module.splu = build, Factor  # type: ignore[method-assign, assignment]
    try:
        _, _, total = solve(cells, rtol)
    finally:
        FipyScheme._build, scheme_module.splu = original_build, original_splu  # type: ignore[method-assign]
    return assembly.seconds, linear.seconds, total - assembly.seconds - linear.seconds


def errors(scheme: FipyScheme, state: Any, reference: tuple[Any, Any]) -> tuple[float, float, float]:
    """L1 error of n (per unit xi), of l, and of L."""
    fine, last = reference
    ratio = fine.grid.cells // scheme.grid.cells
    values = []
    for name in ("n", "l"):
        coarse = scheme.observe(state.t, state.u[0]).fields[name]
        exact = fine.observe(last.t, last.u[0]).fields[name].reshape(-1, ratio).mean(axis=1)
        values.append(float(np.mean(np.abs(coarse - exact))))
    return values[0], values[1], abs(float(state.u[0][scheme.size]) - float(last.u[0][fine.size]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    fine, last, _ = solve_by_lines(1600, 1e-8)
    print(f"# FiPy scheme, reference problem to T = 2\n\n{heading()} Median of {repeats} repeats; import excluded.\n")
    print("| cells | rtol | error of n (L1) | error of l (L1) | error of L | steps | rejected | Newton iterations | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for cells, rtol in ((25, 1e-3), (50, 1e-4), (100, 1e-4), (100, 1e-5), (200, 1e-5), (400, 1e-6)):
        runs = [solve(cells, rtol) for _ in range(repeats)]
        scheme, state, _ = runs[0]
        e = errors(scheme, state, (fine, last))
        c = state.counters
        seconds = statistics.median(run[2] for run in runs)
        rejected = c["rejected_error"] + c["rejected_solver"]
        size = f"{e[0]:.1e} | {e[1]:.1e} | {e[2]:.1e}"
        print(f"| {cells} | {rtol:.0e} | {size} | {c['steps']} | {rejected} | {c['iterations']} | {seconds:.2f} |", flush=True)
    print("\nWhere the time goes, 100 cells, rtol 1e-4:\n")
    print("| part | s | share |\n| --- | --- | --- |")
    parts = np.median([split(100, 1e-4) for _ in range(repeats)], axis=0)
    for name, seconds in zip(("FiPy's assembly of the three residuals", "sparse factorisation and solve", "our code"), parts, strict=True):
        print(f"| {name} | {seconds:.2f} | {100 * seconds / parts.sum():.0f} % |")


if __name__ == "__main__":
    main()
