"""The two-dimensional solver against the radial one on four meshes: the paper's disk, a quarter of it and whole, up to t = 50.

    python -m benchmarks.crosscheck [--rings 10 20 40 80] > benchmarks/crosscheck.md

Scene tumour-disk in two dimensions with a fixed step of 0.05 and Newton's method to 1e-8; radial with 800 cells at rtol = 1e-8. Numbers are
the largest over ten rings of the body at rest, over the largest value of the radial field at that time. What the step adds is measured
by halving it from 0.1 on 20 rings. Two runs at a time, one thread each.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.machine import heading
from multiphase.run import run
from multiphase.scene import load_scene
from tumour.crosscheck import CrossCheck, crosscheck

TIMES = (40.0, 50.0)
KINDS = {"quarter_disk": "Quarter disk", "disk": "Whole disk, free all round"}
STEP = 0.05
NAMES = ("radius", "alpha", "C", "p", "displacement")


def solve(kind: str, rings: int | None, step: float = STEP) -> tuple[Any, float]:
    """The result of tumour-disk, radial without a number of rings, and the seconds it took."""
    sets = [f"geometry.kind={kind}", f"time.end={TIMES[-1]:g}", f"time.save_at=[{', '.join(f'{t:g}' for t in TIMES)}]"]
    if rings is None:
        sets += ["geometry.dimension=radial", "solver.cells=800", "solver.rtol=1e-8"]
    else:
        sets += ["geometry.dimension=2d", f"solver.cells={rings}", f"solver.dt={step:g}", "solver.newton_tol=1e-8"]
    started = time.perf_counter()
    with threadpool_limits(1):
        result = run(load_scene("tumour-disk", sets))
    return result, time.perf_counter() - started


def rows(title: str, numbers: Sequence[int], checks: Sequence[CrossCheck], what: Callable[[CrossCheck, str], Any], row: int) -> list[str]:
    """A table of one quantity of all meshes, and the orders between neighbours."""
    names = [name for name in NAMES if not (title != "difference" and name == "radius")]
    values = np.array([[what(check, name)[row] for name in names] for check in checks])
    lines = [f"| {title}, rings | {' | '.join(names)} |", "| --- |" + " --- |" * len(names)]
    for k, count in enumerate(numbers):
        cells = []
        for j, value in enumerate(values[k]):
            order = f" ({np.log2(values[k - 1, j] / value) / np.log2(count / numbers[k - 1]):.1f})" if k else ""
            cells.append(f"{value:.1e}{order}")
        lines.append(f"| {count} | {' | '.join(cells)} |")
    return [*lines, ""]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rings", type=int, nargs="+", default=[10, 20, 40, 80])
    numbers = sorted(parser.parse_args().rings)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        jobs = {(kind, n): pool.submit(solve, kind, n) for n in reversed(numbers) for kind in reversed(KINDS)}
        radial = pool.submit(solve, "quarter_disk", None)
        doubled = pool.submit(solve, "quarter_disk", 20, 2.0 * STEP)
        found = {key: job.result() for key, job in jobs.items()}
        exact, coarse = radial.result()[0], doubled.result()[0]
    print("# Two dimensions against the radial solver\n")
    print(heading())
    print(f"\n{__doc__.split('> benchmarks/crosscheck.md')[1].strip()} In brackets: observed orders.\n")
    for kind, title in KINDS.items():
        checks = [crosscheck(found[kind, n][0], exact) for n in numbers]
        print(f"## {title}\n\nSeconds: {', '.join(f'{found[kind, n][1]:.0f}' for n in numbers)}.\n")
        for time_ in TIMES:
            row = int(np.flatnonzero(checks[0].times == time_)[0])
            print(f"t = {time_:g}\n")
            for name, what in (
                ("difference", CrossCheck.difference),
                ("scatter (rms)", CrossCheck.scatter),
                ("scatter (largest)", lambda check, field: check.scatter(field, largest=True)),
            ):
                print("\n".join(rows(name, numbers, checks, what, row)))
            asymmetries = [float(found[kind, n][0]["asymmetry"][np.flatnonzero(found[kind, n][0].t == time_)[0]]) for n in numbers]
            print(f"Asymmetry: {', '.join(f'{value:.1e}' for value in asymmetries)}.\n")
    if 20 in numbers:
        check = crosscheck(coarse, exact)
        fine = crosscheck(found["quarter_disk", 20][0], exact)
        moved = [abs(check.radius[0, k] / fine.radius[0, k] - 1.0) / 3.0 for k in (-2, -1)]
        print("## What the step adds\n")
        print(f"On 20 rings, a third of the change from a step of 0.1: {moved[0]:.0e} of the radius at t = 40, {moved[1]:.0e} at t = 50.")


if __name__ == "__main__":
    main()
