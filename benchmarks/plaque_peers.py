"""The reference plaque as a user would write it today, in four ways, against this package: seconds at equal error of n.

    pip install py-pde scikit-sundae
    python -m benchmarks.plaque_peers [--repeats 5] > benchmarks/plaque_peers.md

Each peer stands alone in benchmarks/peers/ (what each is, and what was awkward, is told there) and solves the same problem, interfacial.
Of a list of settings the cheapest with an L1 error of n below 5e-4 counts. Errors are against this package's 1600 cells at rtol 1e-8.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
from collections.abc import Callable, Iterator
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.machine import heading
from benchmarks.plaque_lines import error, fraction, solve
from plaque1d.fipy_scheme import FipyScheme
from plaque1d.lines_scheme import RadauLines

TARGET = 5e-4


def peer(name: str, **options: Any) -> Callable[..., tuple[Any, float]]:
    module = importlib.import_module(f"benchmarks.peers.{name}")

    def run(cells: int, setting: Any) -> tuple[Any, float]:
        answer = module.solve(cells, setting, **options)
        return answer["n"], float(answer["seconds"])

    return run


def own(kind: type) -> Callable[..., tuple[Any, float]]:
    def run(cells: int, setting: float) -> tuple[Any, float]:
        scheme, state, seconds = solve(cells, setting, kind=kind)
        return fraction(scheme, state), seconds

    return run


TOLERANCES = (1e-3, 3e-4, 1e-4)


def contenders() -> Iterator[tuple[str, Callable[..., tuple[Any, float]], list[tuple[int, Any]], int]]:
    """Name, function, settings to try, and whether runs are long."""
    grid = [(cells, tolerance) for cells in (42, 45, 50, 60) for tolerance in TOLERANCES]
    yield "this package, lines (default)", own(RadauLines), grid, 0
    yield "this package, FiPy scheme", own(FipyScheme), [(cells, t) for cells in (45, 50) for t in (1e-3, 3e-4, 1e-4)], 1
    yield "plain FiPy script", peer("plain_fipy"), [(80, 260), (100, 250), (120, 245), (160, 240)], 1
    yield "SciPy solve_ivp(BDF), dense", peer("scipy_bdf"), grid, 0
    yield "SciPy solve_ivp(BDF), sparsity given", peer("scipy_bdf", sparsity=True), grid, 0
    coarse = [(cells, tolerance) for cells in (30, 36, 42) for tolerance in TOLERANCES]
    yield "py-pde, LSODA", peer("py_pde"), coarse, 0
    yield "scikit-sundae CVODE, dense", peer("sundae_dense"), grid, 0
    yield "scikit-sundae IDA, dense", peer("sundae_dense", form="dae"), grid, 0
    yield "scikit-sundae IDA, sparse", peer("sundae_dense", form="dae-sparse"), grid, 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    solve(20, 1e-2)  # compiles
    print(f"# Peers at equal error, reference problem to T = 2\n\n{heading()} Median of {repeats} repeats ({min(2, repeats)} of runs of")
    print("seconds); import and compilation excluded.\n")
    print("| code | cells | steps or tolerance | error of n (L1) | s | slower than lines by |\n| --- | --- | --- | --- | --- | --- |")
    fastest = 0.0
    with threadpool_limits(limits=1):
        for name, run, settings, long in contenders():
            found = []
            for cells, setting in settings:
                try:
                    n, seconds = run(cells, setting)
                except RuntimeError:
                    continue
                if error(n, "interfacial") < TARGET:
                    found.append((seconds, cells, setting, error(n, "interfacial")))
            if not found:
                print(f"| {name} | - | - | none of the settings reaches {TARGET:g} | - | - |", flush=True)
                continue
            _, cells, setting, size = min(found)
            seconds = statistics.median(run(cells, setting)[1] for _ in range(min(2, repeats) if long else repeats))
            fastest = fastest or seconds
            print(f"| {name} | {cells} | {setting:g} | {size:.1e} | {seconds:.4f} | {seconds / fastest:.1f} |", flush=True)


if __name__ == "__main__":
    main()
