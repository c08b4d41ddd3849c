"""The reference plaque with the method of lines and scipy's BDF.

The state is [L n, L l, L], so that the transport is conservative. The slip velocity is no part of it: `solve_ivp` takes no
algebraic equations, so every right-hand side solves the tridiagonal slip equation. That makes each rate of n depend on all n and l,
and `jac_sparsity` has no exact pattern but a full one. The variant ``sparsity=True`` gives the pattern of the transport at fixed w;
the Jacobian is then approximate, which costs Newton iterations and no accuracy.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded
from scipy.sparse import block_array, csc_matrix, diags

PSI_L, PSI_M = 1.0, 0.5
K_L, K_M = 2.0, 2.0
DRAG = 20.0
NU_N, NU_M = 1.0, 1.0
A, B, POWER = 0.5, 1.0, 1.0
FLOOR = 1e-5
T_END = 2.0


def wall_speed(l_first: float, half_cell: float) -> float:
    """V = Psi_m l_w, where l_w is the positive root of Psi_l = Psi_m l_w^2 - (l_0 - l_w) / half_cell."""
    load = l_first + half_cell * PSI_L
    return PSI_M * 2.0 * load / (1.0 + np.sqrt(1.0 + 4.0 * PSI_M * half_cell * load))


def slip(n: np.ndarray, l: np.ndarray, L: float, V: float) -> np.ndarray:
    """Slip velocity on the interior faces from the difference of the momentum balances."""
    cells = len(n)
    dx = L / cells
    n_cell, c_cell = np.maximum(n, FLOOR), np.maximum(1.0 - n, FLOOR)
    n_mean = np.append(n[0], 0.5 * (n[:-1] + n[1:]))  # faces 0 .. cells - 1, with n_x = 0 at the endothelium
    n_face, c_face = np.maximum(n_mean, FLOOR), np.maximum(1.0 - n_mean, FLOOR)
    w_wall = V / c_face[0]
    stress = (1.0 - n) * A / (1.0 + B * np.maximum(l, 0.0) ** POWER)

    band = np.zeros((3, cells - 1))
    load = -n_face[1:] * np.diff(stress) / dx
    band[1] = DRAG * n_face[1:] * c_face[1:]
    for r, kappa in ((n_face, NU_M * c_cell / dx**2), (c_face, NU_N * n_cell / dx**2)):
        band[1] += r[1:] ** 2 * (kappa[:-1] + kappa[1:])
        coupling = r[:-1] * r[1:] * kappa[:-1]
        band[0, 1:] -= coupling[1:]
        band[2, :-1] -= coupling[1:]
        load[0] += coupling[0] * w_wall
    return solve_banded((1, 1), band, load, overwrite_ab=True, overwrite_b=True, check_finite=False)


def limited_slopes(n: np.ndarray) -> np.ndarray:
    """Monotonised central slopes times the cell width; at the endothelium the parabola with n_x = 0."""
    step = np.diff(n)
    back, ahead = step[:-1], step[1:]
    size = np.minimum(0.5 * np.abs(back + ahead), 2.0 * np.minimum(np.abs(back), np.abs(ahead)))
    inner = np.where(back * ahead > 0.0, np.sign(back) * size, 0.0)
    return np.concatenate([[0.5 * step[0]], inner, [step[-1]]])


def rates(t: float, y: np.ndarray, cells: int) -> np.ndarray:
    """Right-hand side of the method of lines."""
    L = y[-1]
    n, l = y[:cells] / L, y[cells:-1] / L
    c = 1.0 - n
    h = 1.0 / cells
    xi = h * np.arange(1, cells)
    V = wall_speed(l[0], 0.5 * h * L)
    w = slip(n, l, L, V)

    n_face = 0.5 * (n[:-1] + n[1:])
    v = (1.0 - xi) * V - (1.0 - n_face) * w
    wave = v + n_face * w * NU_M / (NU_M * n_face + NU_N * (1.0 - n_face))
    slopes = limited_slopes(n)
    left, right = n[:-1] + 0.5 * slopes[:-1], n[1:] - 0.5 * slopes[1:]
    n_flux = 0.5 * v * (left + right) - 0.5 * np.maximum(np.abs(v), np.abs(wave)) * (right - left)
    l_flux = 0.5 * (1.0 - xi) * V * (l[:-1] + l[1:]) - np.diff(l) / (h * L)

    dy = np.empty_like(y)
    dy[:cells] = -np.diff(n_flux, prepend=0.0, append=0.0) / h + K_M * L * l * c
    dy[cells:-1] = -np.diff(l_flux, prepend=PSI_L, append=0.0) / h - K_L * L * l * c
    dy[-1] = V
    return dy


def pattern(cells: int) -> csc_matrix:
    """Where the Jacobian is not zero at fixed w: the stencils of the fluxes, and the columns of l_0 and L."""

    def band(reach: int) -> csc_matrix:
        return diags([1.0] * (2 * reach + 1), range(-reach, reach + 1), shape=(cells, cells))

    filled = block_array([[band(2), band(0), None], [band(0), band(1), None], [None, None, diags([1.0])]]).tolil()
    filled[:, [cells, 2 * cells]] = 1.0
    return csc_matrix(filled)


def solve(cells: int, tolerance: float, sparsity: bool = False) -> dict[str, object]:
    """Cell values of n and l, and L, at T = 2."""
    xi = (np.arange(cells) + 0.5) / cells
    L = 0.5
    y = np.concatenate([L * (0.1 + 0.05 * np.cos(np.pi * xi) ** 2), np.full(cells, L * 0.2), [L]])
    started = time.perf_counter()
    options = {"jac_sparsity": pattern(cells)} if sparsity else {}
    run = solve_ivp(rates, (0.0, T_END), y, method="BDF", t_eval=[T_END], args=(cells,), rtol=tolerance, atol=tolerance, **options)
    seconds = time.perf_counter() - started
    if not run.success:
        raise RuntimeError(run.message)
    end = run.y[:, -1]
    note = f"{'banded' if sparsity else 'dense'} difference Jacobian, {run.nfev} rates besides those for {run.njev} Jacobians"
    return {"n": end[:cells] / end[-1], "l": end[cells:-1] / end[-1], "L": float(end[-1]), "seconds": seconds, "note": note}
