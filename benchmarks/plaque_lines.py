"""The compiled method of lines on the reference problem: error against wall time, time error, cost by cells, the price of a call.

    python -m benchmarks.plaque_lines [--repeats 5] > benchmarks/plaque_lines.md

Reference problem: Psi_l = 1, Psi_m = 0.5, k_l = k_m = 2, b = 20, nu_n = nu_m = 1, A = 0.5, B = 1, k = 1, n(x, 0) = 0.1 + 0.05 cos^2(pi xi),
l(x, 0) = 0.2, L(0) = 0.5, to T = 2; interfacial, or drag with p_out = 1. Space errors are against 1600 cells at rtol 1e-8.
"""

from __future__ import annotations

import argparse
import gc
import resource
import statistics
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from benchmarks.machine import heading
from multiphase.stepping import Control, integrate, start
from plaque1d import PlaqueInitial, PlaqueParameters, simulate
from plaque1d.fipy_scheme import FipyScheme
from plaque1d.lines_scheme import LinesScheme, RadauLines
from plaque1d.parameters import PlaqueGeometry
from plaque1d.semidiscrete import KERNEL

VALUES = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
INITIAL = PlaqueInitial(n="0.1 + 0.05*cos(pi*xi)**2", l=0.2, L=0.5)
FORMS: dict[str, dict[str, Any]] = {"interfacial": {}, "drag": {"momentum": "drag", "p_out": 1.0}}
END = 2.0
FINE = 1600


def problem(form: str) -> PlaqueParameters:
    return PlaqueParameters(**VALUES, **FORMS[form])


def solve(cells: int, rtol: float, form: str = "interfacial", kind: type = RadauLines) -> tuple[Any, Any, float]:
    """Scheme, last state, and wall time of the loop, set-up included."""
    started = time.perf_counter()
    scheme = kind(problem(form), INITIAL, PlaqueGeometry(), cells, rtol)
    control = Control()
    state = integrate(scheme, start(scheme, 0.0, 0.04, control), [END], control)
    return scheme, state, time.perf_counter() - started


@cache
def reference(form: str) -> tuple[Any, Any]:
    """n and L of the converged solution."""
    scheme, state, _ = solve(FINE, 1e-8, form)
    u = state.u[0]
    return u[scheme.n] / u[scheme.size], float(u[scheme.size])


def error(n: Any, form: str) -> float:
    """L1 difference of cell averages of n from the converged ones, which are added up to the faces first."""
    fine, _ = reference(form)
    total = np.concatenate([[0.0], np.cumsum(fine) / FINE])
    cells = len(n)
    at = np.interp(np.arange(cells + 1) / cells, np.arange(FINE + 1) / FINE, total)
    return float(np.mean(np.abs(n - cells * np.diff(at))))


def fraction(scheme: Any, state: Any) -> Any:
    return state.u[0][scheme.n] / state.u[0][scheme.size]


def timed(repeats: int, run: Callable[[], tuple[Any, Any, float]]) -> tuple[Any, Any, float]:
    """The last of `repeats` runs, and the median of their wall times."""
    runs = [run() for _ in range(repeats)]
    return runs[-1][0], runs[-1][1], statistics.median(r[2] for r in runs)


def accuracy(repeats: int) -> None:
    print("## Error against wall time\n\n| form | cells | rtol | error of n (L1) | steps | rejected | iterations | ms |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for form in FORMS:
        for cells, rtol in (
            (25, 1e-3),
            (45, 1e-3),
            (50, 1e-3),
            (100, 1e-3),
            (100, 1e-4),
            (200, 1e-4),
            (200, 1e-5),
            (400, 1e-5),
            (800, 1e-6),
        ):
            scheme, state, seconds = timed(repeats, lambda c=cells, r=rtol, f=form: solve(c, r, f))
            c = state.counters
            rejected = c["rejected_error"] + c["rejected_solver"]
            row = f"{error(fraction(scheme, state), form):.1e} | {c['steps']} | {rejected} | {c['iterations']}"
            print(f"| {form} | {cells} | {rtol:.0e} | {row} | {1e3 * seconds:.2f} |", flush=True)


def time_errors() -> None:
    print("\n## Time error\n\nAgainst the same 100 cells at rtol 1e-11; L1 of n, and of L, over rtol.\n")
    print("| form | rtol | n / rtol | L / rtol | steps |\n| --- | --- | --- | --- | --- |")
    for form in FORMS:
        exact_scheme, exact, _ = solve(100, 1e-11, form)
        for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
            scheme, state, _ = solve(100, rtol, form)
            n = float(np.mean(np.abs(fraction(scheme, state) - fraction(exact_scheme, exact))))
            L = abs(float(state.u[0][scheme.size] - exact.u[0][scheme.size]))
            print(f"| {form} | {rtol:.0e} | {n / rtol:.2g} | {L / rtol:.2g} | {state.counters['steps']} |", flush=True)


def against_fipy(repeats: int) -> None:
    """The cheapest setting of either that has an error of n just below 5e-4."""
    print("\n## FiPy and lines at equal error\n\nThe cheapest of a list of settings with an error of n below 5e-4.\n")
    print("| form | method | cells | rtol | error | s | ratio |\n| --- | --- | --- | --- | --- | --- | --- |")
    for form in FORMS:
        rows = []
        for name, kind, some in (
            ("fipy", FipyScheme, min(repeats, 3)),
            ("lines, bdf2", LinesScheme, repeats),
            ("lines, radau", RadauLines, repeats),
        ):
            best = None
            for cells in (45, 50, 60):
                for rtol in (1e-3, 5e-4, 2e-4, 1e-4):
                    scheme, state, seconds = solve(cells, rtol, form, kind)
                    found = error(fraction(scheme, state), form)
                    if found < 5e-4 and (best is None or seconds < best[3]):
                        best = (cells, rtol, found, seconds)
            assert best is not None
            cells, rtol, found, _ = best
            rows.append((name, cells, rtol, found, timed(some, lambda c=cells, r=rtol, f=form, k=kind: solve(c, r, f, k))[2]))
        for name, cells, rtol, found, seconds in rows:
            print(f"| {form} | {name} | {cells} | {rtol:.0e} | {found:.1e} | {seconds:.5f} | {rows[0][4] / seconds:.0f} |", flush=True)


def agreement() -> None:
    print("\n## FiPy and lines converge to the same solution\n\nFiPy (BDF2) on N cells against lines (Radau) on 2 N; L1 of n.\n")
    print("| form | cells | rtol of FiPy | n | L |\n| --- | --- | --- | --- | --- |")
    for form in FORMS:
        for cells, rtol in ((25, 1e-3), (50, 1e-4), (100, 1e-5), (200, 1e-6)):
            a, last_a, _ = solve(cells, rtol, form, FipyScheme)
            b, last_b, _ = solve(2 * cells, 1e-7, form)
            n = float(np.mean(np.abs(fraction(a, last_a) - fraction(b, last_b).reshape(cells, 2).mean(axis=1))))
            print(f"| {form} | {cells} | {rtol:.0e} | {n:.1e} | {abs(last_a.u[0][a.size] - last_b.u[0][b.size]):.1e} |", flush=True)


def presets(repeats: int) -> None:
    print("\n## Presets at 200 cells, rtol 1e-4\n\n`simulate` with its 51 stored times.\n")
    print("| preset | to | steps | s |\n| --- | --- | --- | --- |")
    for name, end, words in (("mouse", 17039.0, "one year"), ("human", 340788.0, "twenty years"), ("demo", 40.0, "t = 40")):
        parameters, initial = PlaqueParameters.preset(name), PlaqueInitial.preset(name)
        seconds, steps = [], 0
        for _ in range(repeats):
            started = time.perf_counter()
            steps = simulate(parameters, initial=initial, t_end=end, cells=200).stats["steps"]
            seconds.append(time.perf_counter() - started)
        print(f"| {name} | {words} | {steps} | {statistics.median(seconds):.4f} |", flush=True)


def cells(repeats: int) -> None:
    print("\n## Cost by cells, rtol 1e-4\n")
    print("| cells | ms | iterations | µs an iteration and cell | bytes a cell (work space) |\n| --- | --- | --- | --- | --- |")
    for count in (100, 200, 400, 800, 1600, 3200):
        scheme, state, seconds = timed(repeats, lambda c=count: solve(c, 1e-4))
        iterations = state.counters["iterations"]
        size = scheme.workspace_bytes / count
        print(f"| {count} | {1e3 * seconds:.1f} | {iterations} | {1e6 * seconds / iterations / count:.3f} | {size:.0f} |", flush=True)


def call(repeats: int) -> None:
    """`simulate`, with 51 stored times, against the compiled integrator inside it."""
    print("\n## The price of a call\n\n`simulate` with its 51 stored times against the compiled integrator inside it, median.\n")
    print("| cells | rtol | simulate, ms | integrator, ms | over it |\n| --- | --- | --- | --- | --- |")
    compiled, spent = KERNEL.advance, 0.0

    def watched(*arguments: Any) -> Any:
        nonlocal spent
        started = time.perf_counter()
        try:
            return compiled(*arguments)
        finally:
            spent += time.perf_counter() - started

    KERNEL.entries["advance"] = watched
    try:
        for count, rtol in ((50, 1e-3), (100, 1e-4), (200, 1e-4), (200, 1e-5), (800, 1e-4)):
            whole, inside = [], []
            for _ in range(5 * repeats):
                spent, started = 0.0, time.perf_counter()
                simulate(problem("interfacial"), initial=INITIAL, t_end=END, cells=count, rtol=rtol)
                whole.append(time.perf_counter() - started)
                inside.append(spent)
            a, b = statistics.median(whole), statistics.median(inside)
            print(f"| {count} | {rtol:.0e} | {1e3 * a:.2f} | {1e3 * b:.2f} | {100 * (a / b - 1):.0f} % |", flush=True)
    finally:
        KERNEL.entries["advance"] = compiled


def memory() -> None:
    def grown(runs: int) -> float:
        for _ in range(runs):
            simulate(problem("interfacial"), initial=INITIAL, t_end=END, cells=50, rtol=1e-3)
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    before = grown(20)
    print(f"\n1000 runs in one process (50 cells, 51 stored times) grow its peak memory by {grown(1000) - before:.1f} MB.")


def sundials(repeats: int) -> None:
    """IDA on our compiled rates with our compiled tangent, as a sparse matrix."""
    try:
        from benchmarks.sundials import solve_with_ida
    except ImportError:
        return
    print("\n## SUNDIALS on the same equations\n\nIDA (scikit-sundae) with our compiled rates and tangent, sparse LU.\n")
    print("| integrator | cells | rtol | error of n | ms |\n| --- | --- | --- | --- | --- |")
    for count, rtol in ((50, 1e-3), (100, 1e-3), (200, 1e-4), (400, 1e-5)):
        scheme, state, seconds = timed(repeats, lambda c=count, r=rtol: solve(c, r))
        print(f"| radau | {count} | {rtol:.0e} | {error(fraction(scheme, state), 'interfacial'):.1e} | {1e3 * seconds:.1f} |")
        for tolerance in (rtol, 0.1 * rtol):
            n, seconds = solve_with_ida(
                RadauLines(problem("interfacial"), INITIAL, PlaqueGeometry(), count, tolerance), END, tolerance, repeats
            )
            print(f"| IDA | {count} | {tolerance:.0e} | {error(n, 'interfacial'):.1e} | {1e3 * seconds:.1f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    for form in FORMS:
        solve(20, 1e-2, form)  # compiles
    print(f"# Method of lines, reference problem to T = 2\n\n{heading()} Median of {repeats} repeats; import and compilation excluded.\n")
    accuracy(repeats)
    time_errors()
    against_fipy(repeats)
    agreement()
    presets(repeats)
    cells(repeats)
    call(repeats)
    memory()
    sundials(repeats)


if __name__ == "__main__":
    main()
