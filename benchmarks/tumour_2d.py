"""The tumour in two dimensions: the paper's program step by step, and equal accuracy in less time.

    python -m benchmarks.tumour_2d [--repeats 3] [--mesh FILE] > benchmarks/tumour_2d.md

The preset authors-disk is run to t = 60 on the mesh of the paper's program (a file of its repository: quarter_disk_authors.msh, lines 31
bottom, 33 left; without it on a quarter disk of about as many points). Its time depends on the machine most through PARDISO's numerical
factorisation, so that of the whole matrix, bubbles not condensed, is timed beside it. Errors are the largest over all points of the mesh,
of the displacement (its length), alpha and C, and relative of the radius, against the radial solution of 800 cells at rtol 1e-7.
One thread; imports and compilation are not counted.
"""

from __future__ import annotations

import argparse
import statistics
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_array
from threadpoolctl import threadpool_limits

from benchmarks.machine import heading
from multiphase.sparse import load_mkl, open_solver
from tumour import TumourGeometry, TumourParameters, simulate
from tumour.fem import kernel
from tumour.fem.bodies import body_of
from tumour.fem.scheme import MiniScheme
from tumour.parameters import TumourInitial
from tumour.solver import TumourSolver

TIMES = (20.0, 40.0, 60.0)
PAPER = TumourParameters.preset("paper")
AUTHORS = TumourParameters.preset("authors-disk")


@cache
def radial() -> Any:
    """Radii and profiles of displacement, alpha and C over R, by time, of the radial solution."""
    result = simulate(PAPER, t_end=TIMES[-1], geometry="quarter_disk", cells=800, rtol=1e-7, save_at=TIMES)
    R = (np.arange(800) + 0.5) / 800
    found = {}
    for time_ in TIMES:
        row = int(np.argmin(np.abs(result.t - time_)))
        radius = float(result["radius"][row])
        moved = CubicSpline(np.r_[0.0, R, 1.0], np.r_[0.0, result["displacement"][row], radius - 1.0])
        alpha, C = (CubicSpline(R, result[name][row]) for name in ("alpha", "C"))
        found[time_] = radius, moved, alpha, C
    return found


def errors(result: Any, time_: float) -> tuple[float, float, float, float]:
    """Errors of radius, displacement, alpha and C at a time."""
    radius, moved, alpha, C = radial()[time_]
    row = int(np.argmin(np.abs(result.t - time_)))
    points = result.mesh.points
    R = np.hypot(*points.T)
    exact = points * np.where(R > 0.0, moved(R) / np.maximum(R, 1e-300), 0.0)[:, None]
    d = float(np.max(np.hypot(*(result["displacement"][row] - exact).T)))
    return (
        abs(np.sqrt(result["area"][row] / result["area"][0]) / radius - 1.0),
        d,
        float(np.max(np.abs(result["alpha"][row] - alpha(R)))),
        float(np.max(np.abs(result["C"][row] - C(R)))),
    )  # fmt: skip


def geometry(mesh: Path | None) -> TumourGeometry:
    if mesh is not None:
        return TumourGeometry(kind="mesh", file=str(mesh), slide_x=("33",), slide_y=("31",))
    return TumourGeometry(kind="quarter_disk", dimension="2d")


def whole_factorisation(shape: TumourGeometry, cells: int, repeats: int = 5) -> tuple[float, int]:
    """Seconds of PARDISO's numerical factorisation of the whole matrix, bubbles included, and its size."""
    body = body_of(shape, cells)
    scheme = MiniScheme(AUTHORS, TumourInitial(), body, TumourSolver(alpha_step="as-printed", linear="superlu"))
    u = scheme.initial()
    point = scheme.point(u)
    count, triangles = scheme.count, scheme.triangles
    slopes, numbers = np.empty((triangles, kernel.LOCAL, kernel.LOCAL)), np.empty((triangles, kernel.LOCAL), dtype=np.int64)
    x, r, past = np.empty(kernel.LOCAL), np.empty(kernel.LOCAL), np.ones((6, 2))
    e, s, D, B = np.empty(11), np.empty(11), np.zeros((11, 11)), np.zeros((11, kernel.LOCAL))
    past[:, 0] = 0.8
    for n in range(triangles):
        kernel.gather(scheme.elements, point.nodal, point.bubbles, n, x)
        kernel.element_tangent(scheme.constants, scheme.elements, 0.5, n, x, past, e, s, D, B, r, slopes[n])
        numbers[n] = np.r_[(5 * scheme.elements.triangles[n][:, None] + np.arange(5)).ravel(), 5 * count + 2 * n + np.arange(2)]
    size = 5 * count + 2 * triangles
    rows, columns = np.repeat(numbers, kernel.LOCAL, axis=1).ravel(), np.tile(numbers, (1, kernel.LOCAL)).ravel()
    held = np.concatenate([scheme.prescribed.ravel(), np.zeros(2 * triangles, dtype=bool)])
    values = np.where(held[rows] | held[columns], 0.0, slopes.ravel())
    matrix = (
        coo_array((values, (rows, columns)), shape=(size, size)).tocsr()
        + coo_array((held * 1.0, (np.arange(size),) * 2), shape=(size, size)).tocsr()
    )
    matrix.sort_indices()
    solver = open_solver("pardiso", matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
    taken = []
    for _ in range(repeats + 1):
        before = solver.seconds["factorise"]
        solver.factorise(matrix.data)
        taken.append(solver.seconds["factorise"] - before)
    return statistics.median(taken[1:]), size


def run(linear: str, **options: Any) -> Any:
    return simulate(t_end=TIMES[-1], linear=linear, **options)


def split(result: Any) -> str:
    """Columns of the table: wall, by what it was spent on, and what is left for Python."""
    seconds, wall = result.stats["seconds"], result.stats["wall_s"]
    assembly = seconds["residual"] + seconds["tangent"] + seconds["moments"]
    parts = assembly, seconds["analyse"] + seconds["factorise"], seconds["solve"], seconds["observation"]
    rest = wall - sum(parts)
    return " | ".join([f"{wall:.3g}", *(f"{part:.3g}" for part in parts), f"{100.0 * rest / wall:.0f} %"])


def median(repeats: int, **options: Any) -> Any:
    """The run of median wall time."""
    return sorted((run(**options) for _ in range(repeats)), key=lambda result: result.stats["wall_s"])[(repeats - 1) // 2]


def solvers() -> list[str]:
    return (["pardiso"] if load_mkl() is not None else []) + ["superlu"]


def authors(mesh: Path | None, cells: int, repeats: int) -> Any:
    """The paper's program, step by step."""
    shape = geometry(mesh)
    body = body_of(shape, cells)
    unknowns = 5 * body.quality.nodes + 2 * body.quality.triangles
    print(f"\n## Preset authors-disk to t = 60: {body.quality.nodes} points, {body.quality.triangles} triangles, {unknowns} unknowns\n")
    if load_mkl() is not None:
        with threadpool_limits(1):
            seconds, size = whole_factorisation(shape, cells)
        print(f"PARDISO's numerical factorisation of the whole matrix of {size} rows: {seconds:.3f} s.\n")
    print("| linear solver | wall s | assembly | factorisation | solve | output | Python | steps | iterations | tangents |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    kept = None
    for linear in solvers():
        times = 1 if linear == "superlu" else repeats
        result = median(
            times, linear=linear, parameters=AUTHORS, geometry=shape, cells=cells, alpha_step="as-printed", time_scheme="backward-euler",
            dt=0.5, save_at=TIMES,
        )  # fmt: skip
        stats = result.stats
        print(f"| {linear} | {split(result)} | {stats['steps']} | {stats['iterations']} | {stats['assemblies']} |", flush=True)
        kept = kept or result
    return kept


def accuracy(reference: Any, repeats: int) -> None:
    """Errors against wall time of BDF2 on structured quarter disks, beside those of the paper's program."""
    print("\n## Error against wall time\n")
    print("| run | t = 20: R, d, alpha, C | t = 40 | t = 60 | steps | wall s | assembly | factorisation | solve | output | Python |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")

    def row(name: str, result: Any) -> None:
        columns = [" ".join(f"{e:.1e}" for e in errors(result, t)) for t in TIMES]
        print(f"| {name} | {' | '.join(columns)} | {result.stats['steps']} | {split(result)} |", flush=True)

    row("authors' mesh, backward Euler, dt 0.5", reference)
    shape = TumourGeometry(kind="quarter_disk", dimension="2d")
    for cells, dt in ((10, 2.0), (20, 2.0), (20, 1.0), (30, 1.0), (40, 1.0), (40, 0.5), (60, 0.5), (80, 0.5), (40, None), (60, None)):
        for linear in solvers():
            control = {"dt": dt, "time_scheme": "bdf2"} if dt else {"rtol": 1e-4}
            result = median(repeats, linear=linear, parameters=PAPER, geometry=shape, cells=cells, save_at=TIMES, **control)
            name = f"{cells} rings, BDF2, " + (f"dt {dt:g}" if dt else "rtol 1e-4") + f", {linear}"
            row(name, result)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--mesh", type=Path, default=None)
    arguments = parser.parse_args()
    print("# The tumour in two dimensions: error and wall time\n")
    print(heading())
    started = time.perf_counter()
    simulate(PAPER, t_end=1.0, geometry={"kind": "quarter_disk", "dimension": "2d"}, cells=4)
    print(f"\nImport aside, the first run in a process takes {time.perf_counter() - started:.2f} s to load (or make) compiled code.")
    cells = 102
    accuracy(authors(arguments.mesh, cells, arguments.repeats), arguments.repeats)


if __name__ == "__main__":
    main()
