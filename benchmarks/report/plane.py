"""The paper's disk in two dimensions, against the radial solution, and the paper's program step by step.

Errors are the largest over all points of the mesh, relative to the largest value, of the displacement (its length), alpha and C, and
relative of the radius (by the area), at t = 20, 40 and 60, against the radial solution of 800 cells at rtol 1e-7. Every run goes to t = 60;
contact is lost from t = 44 on, and the disk is not far from buckling at the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.report.tables import Row
from benchmarks.report.work import LOG, Work, kept, repeated
from multiphase.sparse import load_mkl
from tumour import TumourGeometry, TumourParameters, simulate

TIMES = (20.0, 40.0, 60.0)
NAMES = ("R", "d", "alpha", "C")
PAPER = TumourParameters.preset("paper")
AUTHORS = TumourParameters.preset("authors-disk")
QUARTER = TumourGeometry(kind="quarter_disk", dimension="2d")
AS_MANY = 102
"""Rings of a quarter disk with as many points as the mesh of the paper's program: 10,609 and 10,605."""
FIXED = [(10, 2.0), (20, 2.0), (20, 1.0), (20, 0.5), (20, 0.25), (30, 1.0), (40, 1.0), (40, 0.5), (60, 0.5), (80, 0.5), (80, 0.25)]
EULER = [(20, 1.0), (20, 0.5), (40, 0.25)]
CONTROLLED = [(20, 1e-3), (20, 1e-4), (40, 1e-3), (40, 1e-4), (60, 1e-4)]
RADIAL = [(25, 1e-3), (50, 1e-3), (100, 1e-4), (200, 1e-5)]


@cache
def reference() -> Any:
    """Radii and profiles of displacement, alpha and C over R, by time, of the radial solution."""
    return profiles(simulate(PAPER, t_end=TIMES[-1], geometry="quarter_disk", cells=800, rtol=1e-7, save_at=TIMES))


def profiles(result: Any) -> dict[float, Any]:
    """Of a radial result: radius, and displacement, alpha and C as functions of R, by time."""
    cells = result["alpha"].shape[1]
    R = (np.arange(cells) + 0.5) / cells
    found = {}
    for at in TIMES:
        row = int(np.argmin(np.abs(result.t - at)))
        radius = float(result["radius"][row])
        moved = CubicSpline(np.r_[0.0, R, 1.0], np.r_[0.0, result["displacement"][row], radius - 1.0])
        alpha, C = (CubicSpline(R, result[name][row]) for name in ("alpha", "C"))
        found[at] = radius, moved, alpha, C
    return found


def errors(result: Any) -> dict[str, dict[str, float]]:
    """By time, of radius, displacement, alpha and C."""
    return {f"{at:g}": _errors_at(result, at) for at in TIMES}


def _errors_at(result: Any, at: float) -> dict[str, float]:
    radius, moved, alpha, C = reference()[at]
    row = int(np.argmin(np.abs(result.t - at)))
    if result.mesh is None:
        size, x = result["radius"][row], (np.arange(len(result["alpha"][row])) + 0.5) / len(result["alpha"][row])
        d, R = np.abs(result["displacement"][row] - moved(x)), x
    else:
        points = result.mesh.points
        size, R = np.sqrt(result["area"][row] / result["area"][0]), np.hypot(*points.T)
        exact = points * np.where(R > 0.0, moved(R) / np.maximum(R, 1e-300), 0.0)[:, None]
        d = np.hypot(*(result["displacement"][row] - exact).T)
    fields = {name: np.abs(result[name][row] - f(R)).max() / f(R).max() for name, f in (("alpha", alpha), ("C", C))}
    return {"R": abs(size / radius - 1.0), "d": float(d.max()) / (radius - 1.0)} | {k: float(v) for k, v in fields.items()}


def solvers() -> list[str]:
    """Linear solvers that are there, the fastest first."""
    return (["pardiso"] if load_mkl() is not None else []) + ["superlu"]


def measured(code: str, size: int, setting: str, **options: Any) -> Work:
    def run() -> tuple[Any, float]:
        result = simulate(t_end=TIMES[-1], save_at=TIMES, **options)
        return result, float(result.stats["setup_s"] + result.stats["wall_s"])

    result, seconds, runs = repeated(run)
    by_time, stats = errors(result), result.stats
    spent = stats.get("seconds", {})
    more = {
        "factorisation": sum(spent.get(name, 0.0) for name in ("analyse", "factorise")), "solve": spent.get("solve"),
        "assembly": sum(spent.get(name, 0.0) for name in ("residual", "tangent", "moments")), "tangents": stats.get("assemblies"),
        "unknowns": stats["unknowns"], "R20": _size(result, 0), "R40": _size(result, 1), "R60": _size(result, 2),
    }  # fmt: skip
    named = {f"{name}_{at}": value for at, each in by_time.items() for name, value in each.items()}
    largest = {f"error_{at}": max(each.values()) for at, each in by_time.items()}
    return Work(
        problem="paper's disk", code=code, size=size, setting=setting, seconds=seconds, runs=runs, errors=named, steps=stats["steps"],
        iterations=stats["iterations"], more=largest | more,
    )  # fmt: skip


def _size(result: Any, k: int) -> float:
    row = int(np.argmin(np.abs(result.t - TIMES[k])))
    return float(result["radius"][row] if result.mesh is None else np.sqrt(result["area"][row] / result["area"][0]))


def settings() -> Iterator[tuple[str, int, str, dict[str, Any]]]:
    """Code, rings (cells of the radial solver), setting in words, and what `simulate` is told."""
    for cells, rtol in RADIAL:
        yield "radial (default)", cells, f"rtol {rtol:.0e}", {"geometry": "quarter_disk", "rtol": rtol}
    for linear in solvers():
        plane = {"geometry": QUARTER, "linear": linear}
        for n, dt in FIXED:
            yield f"BDF2, {linear}", n, f"dt {dt:g}", plane | {"time_scheme": "bdf2", "dt": dt}
        for n, rtol in CONTROLLED:
            yield f"BDF2, error control, {linear}", n, f"rtol {rtol:.0e}", plane | {"rtol": rtol}
        for n, dt in EULER:
            yield f"backward Euler, {linear}", n, f"dt {dt:g}", plane | {"time_scheme": "backward-euler", "dt": dt}


def measure(mesh: Path | None = None) -> dict[str, list[Row]]:
    """File plane.csv, and authors.csv: the program of the paper step by step."""
    simulate(PAPER, t_end=1.0, geometry=QUARTER, cells=4)  # compiles
    rows: list[Work] = []
    for code, cells, words, options in settings():
        kept(rows, measured(code, cells, words, parameters=PAPER, cells=cells, **options))
    return {"plane": [row.row() for row in rows], "authors": authors(mesh)}


def authors(mesh: Path | None) -> list[Row]:
    """The preset authors-disk, step by step as the program of the paper: on its mesh, where that is given, else on as many points."""
    own = TumourGeometry(kind="mesh", file=str(mesh), slide_x=("33",), slide_y=("31",)) if mesh is not None else None
    rows: list[Work] = []
    for name, shape in (("its mesh", own), ("structured mesh of as many points", QUARTER)):
        for linear in solvers():
            if shape is None:
                LOG.warning("the mesh of the paper's program is not given (--mesh)")
                continue
            kept(rows, measured(
                f"{name}, {linear}", AS_MANY, "backward Euler, dt 0.5", parameters=AUTHORS, geometry=shape, cells=AS_MANY,
                alpha_step="as-printed", time_scheme="backward-euler", dt=0.5, linear=linear,
            ))  # fmt: skip
    return [row.row() for row in rows]
