"""Growth of departures from the round shape: linear theory against runs in two dimensions.

    python -m benchmarks.tumour_modes > benchmarks/tumour_modes.md

Two runs of the quarter disk differ by the sign of a small seed r^k cos(k theta) in the cell fraction. Half their difference has no share of
what the mesh itself does to the round shape, which is the same in both.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from benchmarks.machine import heading
from tumour import TumourInitial, TumourParameters, simulate
from tumour.stability import modes

ALPHA, SEED = 0.82, 1e-4
TIMES = (30.0, 40.0, 44.0, 50.0, 55.0, 56.0, 60.0)
KEY = f"""\
The paper's disk, mobility as printed, lambda_alpha = 0, alpha = {ALPHA:g} at first; seeds +-{SEED:g} r^k cos(k theta). `U` is the
coefficient of cos(k theta) in the radial displacement of the surface, per seed, half the difference of the two runs; `rate` that of U/r,
from ln(U/r) between t = 50 and 56, and between 56 and 60. `mesh` is half the sum of the two at t = 60, a length: what the mesh does to
the round shape by itself, amplified. Meshes of the quarter disk are the same in each eighth of the disk, so it is rounding for k < 8.
BDF of order two with fixed steps, newton_tol = 1e-9; linear theory with 200 cells and dt = 0.1."""


def project(result, k: int) -> np.ndarray:
    """The coefficients of cos(k theta) in the radial displacement of the surface of the quarter disk, by time, and the mean radius."""
    x, y = result.mesh.points.T
    on = np.flatnonzero(np.abs(np.hypot(x, y) - 1.0) < 1e-9)
    theta = np.arctan2(y[on], x[on])
    order = np.argsort(theta)
    on, theta = on[order], theta[order]
    d = result["displacement"][:, on]
    radial = d[..., 0] * np.cos(theta) + d[..., 1] * np.sin(theta)
    mean = np.trapezoid(radial, theta, axis=1) / (0.5 * np.pi)
    return np.stack([np.trapezoid(radial * np.cos(k * theta), theta, axis=1) / (0.25 * np.pi), 1.0 + mean])


def plane(k: int, rings: int, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """U per seed, half the sum of both runs, and the radius, by TIMES."""
    runs = []
    for sign in ("+", "-"):
        start = TumourInitial(alpha=f"{ALPHA} {sign} {SEED}*r**{k}*cos({k}*theta)")
        result = simulate(
            TumourParameters.preset("paper"), initial=start, geometry={"kind": "quarter_disk", "dimension": "2d"}, t_end=TIMES[-1],
            cells=rings, dt=dt, newton_tol=1e-9, save_at=TIMES,
        )  # fmt: skip
        rows = np.searchsorted(result.t, TIMES)
        runs.append(project(result, k)[:, rows])
    return 0.5 * (runs[0][0] - runs[1][0]) / SEED, 0.5 * (runs[0][0] + runs[1][0]), runs[0][1]


def rates(U: np.ndarray, r: np.ndarray) -> tuple[float, float]:
    """Mean growth rates of U/r from t = 50 to 56 and from 56 to 60."""
    at = [TIMES.index(t) for t in (50.0, 56.0, 60.0)]
    log = np.log(np.abs(U / r))[at]
    return float(log[1] - log[0]) / 6.0, float(log[2] - log[1]) / 4.0


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rings", type=int, nargs="+", default=[20, 40, 80, 160])
    parser.add_argument("--waves", type=int, nargs="+", default=[2, 4, 6])
    parser.add_argument("--dt", type=float, default=0.25)
    options = parser.parse_args()
    print(f"# Departures from the round shape in two dimensions\n\n{heading()}\n\n{KEY}\n")
    names = [f"U({t:g})" for t in TIMES if t != 55.0]
    print(f"| k | rings, dt | {' | '.join(names)} | mesh | rate 50-56 | rate 56-60 | seconds |\n|{' --- |' * (len(names) + 6)}")
    good = True
    shown = [i for i, t in enumerate(TIMES) if t != 55.0]
    for k in options.waves:
        theory = modes(
            TumourParameters.preset("paper"), initial=TumourInitial(alpha=ALPHA), wave_numbers=[k], t_end=60.0, cells=200, dt=0.1, rows=1
        )
        U = np.array([theory.at(t)[0] for t in TIMES])
        expected = rates(U, np.interp(TIMES, theory.t, theory.radius))
        found = expected
        cells = " | ".join(f"{U[i]:.4f}" for i in shown)
        print(f"| {k} | linear theory | {cells} | | {expected[0]:.4f} | {expected[1]:.4f} | |", flush=True)
        for rings in options.rings:
            began = time.perf_counter()
            U, of_mesh, r = plane(k, rings, options.dt)
            found = rates(U, r)
            cells = " | ".join(f"{U[i]:.4f}" for i in shown)
            took = time.perf_counter() - began
            numbers = f"{cells} | {of_mesh[-1]:.0e} | {found[0]:.4f} | {found[1]:.4f}"
            print(f"| {k} | {rings}, {options.dt:g} | {numbers} | {took:.0f} |", flush=True)
        good &= all(abs(a - b) <= max(0.05 * b, 0.002) for a, b in zip(found, expected, strict=True))
    print(f"\nOn the finest mesh all rates are {'' if good else 'NOT '}within 5 % or 0.002 of the theory's.")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
