"""The plaque's reference problem: this package's methods, and the same problem as one would write it today.

The error is that of n at the end, in the mean over the cells (L1); that of L, relative, stands beside it.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterator
from typing import Any

from benchmarks.plaque_reference import END, FORMS, INITIAL, error, fraction, problem, reference, solve, width
from benchmarks.report.tables import Row
from benchmarks.report.work import LOG, Work, kept, repeated
from multiphase.errors import SolverError
from plaque1d.fipy_scheme import FipyScheme
from plaque1d.lines_scheme import LinesScheme, RadauLines
from plaque1d.parameters import PlaqueGeometry

Answer = tuple[Any, float, int | None, int | None]
"""Cell averages of n, L, steps, iterations."""
Code = Callable[[int, float], tuple[Answer, float]]

LINES = [(cells, rtol) for cells in (25, 45, 50, 100, 200, 400, 800) for rtol in (1e-3, 1e-4, 1e-5, 1e-6)]
BDF2 = [(cells, rtol) for cells in (25, 45, 50, 100, 200, 400) for rtol in (1e-3, 2e-4, 1e-5, 1e-6) if cells * rtol < 0.21]
FIPY = [(25, 1e-3), (45, 5e-4), (50, 1e-3), (50, 2e-4), (50, 1e-4), (100, 1e-4), (100, 1e-5), (200, 1e-5), (200, 1e-6)]
PLAIN = [(40, 130), (80, 260), (100, 250), (160, 520)]
OTHERS = [(25, 1e-3), (42, 1e-3), (42, 1e-4), (45, 1e-3), (45, 3e-4), (50, 1e-4), (100, 1e-4), (100, 1e-5), (200, 1e-5), (200, 2e-6)]
PDE = [(15, 1e-3), (30, 1e-4), (36, 1e-4), (60, 1e-5), (120, 1e-6), (130, 1e-6)]
IDA = [(45, 1e-4), (50, 1e-3), (50, 1e-4), (100, 1e-4), (200, 1e-5), (400, 1e-6)]
TIMES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)


def own(kind: type, form: str) -> Code:
    def run(cells: int, rtol: float) -> tuple[Answer, float]:
        scheme, state, seconds = solve(cells, rtol, form, kind)
        return (fraction(scheme, state), width(scheme, state), state.counters["steps"], state.counters["iterations"]), seconds

    return run


def peer(name: str, **options: Any) -> Code:
    def run(cells: int, setting: float) -> tuple[Answer, float]:
        answer = importlib.import_module(f"benchmarks.peers.{name}").solve(cells, setting, **options)
        return (answer["n"], float(answer["L"]), None, None), float(answer["seconds"])

    return run


def ida(cells: int, rtol: float) -> tuple[Answer, float]:
    """SUNDIALS' IDA on our compiled rates and tangent."""
    from benchmarks.sundials import solve_with_ida

    n, L, seconds = solve_with_ida(RadauLines(problem("interfacial"), INITIAL, PlaqueGeometry(), cells, rtol), END, rtol)
    return (n, L, None, None), seconds


def codes() -> Iterator[tuple[str, str, Code, list[Any], str | None]]:
    """Form, name, function, settings, and the module it needs."""
    for form in FORMS:
        yield form, "lines, Radau (default)", own(RadauLines, form), LINES, None
        yield form, "lines, BDF2", own(LinesScheme, form), BDF2, None
        yield form, "FiPy method", own(FipyScheme, form), FIPY, None
    form = "interfacial"
    yield form, "IDA on our rates", ida, IDA, "sksundae"
    yield form, "plain FiPy script", peer("plain_fipy"), PLAIN, None
    yield form, "SciPy BDF, dense", peer("scipy_bdf"), OTHERS, None
    yield form, "SciPy BDF, pattern", peer("scipy_bdf", sparsity=True), OTHERS, None
    yield form, "py-pde, LSODA", peer("py_pde"), PDE, "pde"
    yield form, "CVODE, dense", peer("sundae_dense"), OTHERS, "sksundae"
    yield form, "IDA, dense", peer("sundae_dense", form="dae"), OTHERS[:5], "sksundae"
    yield form, "IDA, sparse", peer("sundae_dense", form="dae-sparse"), OTHERS, "sksundae"


def measure() -> dict[str, list[Row]]:
    """Files plaque.csv and plaque_time.csv."""
    rows: list[Work] = []
    for form in FORMS:
        solve(20, 1e-2, form)  # compiles
        reference(form)
    for form, name, run, settings, module in codes():
        if module is not None and importlib.util.find_spec(module) is None:
            LOG.warning("%s is left out: the module %s is not installed", name, module)
            continue
        for cells, setting in settings:
            try:
                (n, L, steps, iterations), seconds, runs = repeated(lambda r=run, c=cells, s=setting: r(c, s))
            except (RuntimeError, SolverError) as failed:
                LOG.warning("%s, %d cells, %g failed: %s", name, cells, setting, failed)
                continue
            work = Work(
                problem=form, code=name, size=cells, setting=f"{setting} steps" if isinstance(setting, int) else f"rtol {setting:.0e}",
                seconds=seconds, runs=runs, errors={"n": error(n, form)}, steps=steps, iterations=iterations,
                more={"error_L": abs(L / reference(form)[1] - 1.0)},
            )  # fmt: skip
            kept(rows, work)
    return {"plaque": [row.row() for row in rows], "plaque_time": time_errors()}


def time_errors() -> list[Row]:
    """Errors in time over rtol, against the same 100 cells at rtol 1e-11."""
    found: list[Row] = []
    for form in FORMS:
        exact_scheme, exact, _ = solve(100, 1e-11, form)
        for rtol in TIMES:
            scheme, state, _ = solve(100, rtol, form)
            n = float(abs(fraction(scheme, state) - fraction(exact_scheme, exact)).mean())
            L = abs(width(scheme, state) - width(exact_scheme, exact))
            found.append({"problem": form, "rtol": rtol, "n": n / rtol, "L": L / rtol, "steps": state.counters["steps"]})
    return found
