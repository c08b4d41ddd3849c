"""The radial tumour: error against time, elastic and viscous.

Elastic: the paper's disk (preset paper) to t = 60, through the kink of the contact stress, which cells pass from t = 44 on. Viscous: the
paper's values with mobility "darcy" to t = 60. Errors are relative, of the radius and of alpha and C at the centre (the parabola through
two cells), against the values of 800 and 1600 cells at rtol 1e-7, extrapolated with 1/cells^2.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from benchmarks.report.tables import Row
from benchmarks.report.work import LOG, Work, kept, repeated
from multiphase.stepping import Control, Snapshot, State, Tracker, integrate, start
from tumour.fipy_scheme import FipyScheme
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import ElasticLines, ElasticRadau, ViscousLines, ViscousRadau
from tumour.solver import TumourSolver

END = 60.0
SETTINGS = [(cells, rtol) for cells in (25, 50, 100, 200, 400, 800) for rtol in (1e-3, 1e-4, 1e-5, 1e-6)]
BDF2 = [(cells, rtol) for cells, rtol in SETTINGS if cells < 800 and cells * rtol > 3e-4]
EULER = [(50, 0.5), (200, 0.5), (200, 0.1)]
FIPY = [(25, 1e-3), (25, 1e-4), (50, 1e-5), (100, 1e-3), (100, 1e-4), (200, 1e-5)]
TIMES = (1e-3, 1e-4, 1e-5, 1e-6)
DEFAULT = "lines, Radau (default)"
CHECKED = 40.0  # when errors in time are measured: before contact is lost


class Rows(Tracker):
    """Keeps what is stored."""

    def __init__(self) -> None:
        self.kept: list[Snapshot] = []

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.kept.append(snapshot)


def solve(kind: Any, shape: str, cells: int, rtol: float, end: float = END, dt: float | None = None) -> tuple[tuple[Snapshot, Any], float]:
    """What is seen at the end and the counters, and the wall time of the loop, set-up included; with `dt` by backward Euler."""
    elastic = issubclass(kind, (ElasticRadau, ElasticLines))
    parameters = TumourParameters.preset("paper") if elastic else TumourParameters()
    geometry = TumourGeometry(kind=shape, formulation="lagrangian" if elastic else "eulerian")
    started = time.perf_counter()
    scheme = kind(parameters, TumourInitial(), geometry, TumourSolver(cells=cells, rtol=rtol))
    control, rows = Control(order=2 if dt is None else 1, dt=dt, max_steps=1_000_000), Rows()
    state = integrate(scheme, start(scheme, 0.0, 1.0, control), [end], control, [rows])
    return (rows.kept[-1], state.counters), time.perf_counter() - started


def values(seen: Snapshot) -> Any:
    """Radius, and alpha and C at the centre."""
    centre = [f[0] - (f[1] - f[0]) / 8.0 for f in (seen.fields["alpha"], seen.fields["C"])]
    return np.array([seen.scalars["radius"], *centre])


@cache
def reference(kind: Any, shape: str) -> Any:
    """Converged values at the end."""
    coarse, fine = (values(solve(kind, shape, cells, 1e-7)[0][0]) for cells in (800, 1600))
    return fine + (fine - coarse) / 3.0


def problems() -> Iterator[tuple[str, str, list[tuple[str, Any, list[tuple[int, float]], bool]]]]:
    """Name, shape, and by code: name, scheme, settings, and whether these are fixed steps."""
    elastic: Any = [(DEFAULT, ElasticRadau, SETTINGS, False), ("lines, BDF2", ElasticLines, BDF2, False)]
    viscous: Any = [(DEFAULT, ViscousRadau, SETTINGS, False), ("lines, BDF2", ViscousLines, BDF2, False)]
    yield "elastic disk", "disk", [*elastic, ("lines, backward Euler", ElasticLines, EULER, True)]
    yield "elastic sphere", "sphere", elastic
    yield "viscous disk", "disk", [*viscous, ("FiPy method", FipyScheme, FIPY, False)]
    yield "viscous sphere", "sphere", viscous
    yield "viscous slab", "slab", viscous


def measure() -> dict[str, list[Row]]:
    """Files radial.csv and radial_time.csv."""
    rows: list[Work] = []
    for name, shape, codes in problems():
        exact = reference(codes[0][1], shape)
        LOG.info("%s: R = %.6f, alpha(0) = %.6f, C(0) = %.6f at t = %g", name, *exact, END)
        for code, kind, settings, fixed in codes:
            solve(kind, shape, 20, 1e-2, 1.0)  # compiles
            for cells, number in settings:
                rtol, dt = (1e-6, number) if fixed else (number, None)
                (seen, c), seconds, runs = repeated(lambda k=kind, s=shape, n=cells, r=rtol, d=dt: solve(k, s, n, r, dt=d))
                errors = dict(zip(("R", "alpha", "C"), np.abs(values(seen) / exact - 1.0).tolist(), strict=True))
                work = Work(
                    problem=name, code=code, size=cells, setting=f"dt {number:g}" if fixed else f"rtol {number:.0e}",
                    seconds=seconds, runs=runs, errors=errors, steps=c["steps"], iterations=c["iterations"],
                )  # fmt: skip
                kept(rows, work)
    return {"radial": [row.row() for row in rows], "radial_time": time_errors()}


def time_errors() -> list[Row]:
    """Difference at t = 40 from rtol 1e-9 on the same 200 cells, over rtol, by Radau IIA: the largest of those of r/R, alpha and C, each as
    a root mean square over the cells, and at the worst cell."""
    found: list[Row] = []
    for kind, rheology in ((ElasticRadau, "elastic"), (ViscousRadau, "viscous")):
        for shape in ("slab", "disk", "sphere"):
            exact = solve(kind, shape, 200, 1e-9, CHECKED)[0][0]
            for rtol in TIMES:
                (seen, c), _ = solve(kind, shape, 200, rtol, CHECKED)
                off = [np.abs(seen.fields[name] - exact.fields[name]) / rtol for name in ("alpha", "C")]
                off.append(np.abs(seen.x - exact.x) / exact.scalars["radius"] / rtol)
                mean, worst = (max(float(size(each)) for each in off) for size in (lambda each: np.sqrt(np.mean(each**2)), np.max))
                found.append({"problem": f"{rheology} {shape}", "rtol": rtol, "mean": mean, "worst": worst, "steps": c["steps"]})
    return found
