"""The reference plaque with SUNDIALS by scikit-sundae, with residuals in numpy and Jacobians by differences.

``form="ode"``: CVODE on [L n, L l, L], every right-hand side solving the tridiagonal slip equation for w; dense Jacobian.
``form="dae"``: IDA with w as an unknown and the slip equation as an algebraic one; dense Jacobian.
``form="dae-sparse"``: the same with the exact pattern of the Jacobian, which w as an unknown makes possible; columns without a common
row are differenced together and the factors are sparse. The columns of l_0 and L, which every row needs, rule out a band.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.linalg import solve_banded
from scipy.sparse import block_array, csc_matrix, diags
from sksundae.cvode import CVODE
from sksundae.ida import IDA

PSI_L, PSI_M = 1.0, 0.5
K_L, K_M = 2.0, 2.0
DRAG = 20.0
NU_N, NU_M = 1.0, 1.0
A, B, POWER = 0.5, 1.0, 1.0
FLOOR = 1e-5
T_END = 2.0


class Plaque:
    """Finite volumes for the state [L n, L l, L, w], in which w stands on the interior faces; CVODE's state ends before w."""

    def __init__(self, cells: int) -> None:
        self.h = 1.0 / cells
        self.xi = self.h * np.arange(1, cells)
        self.n, self.l, self.L = slice(0, cells), slice(cells, 2 * cells), 2 * cells
        self.w = slice(2 * cells + 1, 3 * cells)
        self.cells, self.size = cells, 3 * cells

    def initial(self) -> np.ndarray:
        """The state at t = 0; IDA finds w."""
        L, y = 0.5, np.zeros(self.size)
        y[self.n] = L * (0.1 + 0.05 * np.cos(np.pi * self.h * (np.arange(self.cells) + 0.5)) ** 2)
        y[self.l], y[self.L] = L * 0.2, L
        return y

    def growth(self, l: np.ndarray, L: float) -> float:
        """V = Psi_m l_w, where l_w is the positive root of Psi_l = Psi_m l_w^2 - (l_0 - l_w) / (h L / 2)."""
        half = 0.5 * self.h * L
        load = l[0] + half * PSI_L
        return PSI_M * 2.0 * load / (1.0 + np.sqrt(1.0 + 4.0 * PSI_M * half * load))

    def slip_system(self, n: np.ndarray, l: np.ndarray, L: float, V: float) -> tuple[np.ndarray, np.ndarray]:
        """The tridiagonal matrix, in bands, and the load of the slip equation on the interior faces."""
        dx = self.h * L
        n_cell, c_cell = np.maximum(n, FLOOR), np.maximum(1.0 - n, FLOOR)
        n_mean = np.append(n[0], 0.5 * (n[:-1] + n[1:]))  # faces 0 .. cells - 1, with n_x = 0 at the endothelium
        n_face, c_face = np.maximum(n_mean, FLOOR), np.maximum(1.0 - n_mean, FLOOR)
        stress = (1.0 - n) * A / (1.0 + B * np.maximum(l, 0.0) ** POWER)
        bands = np.zeros((3, self.cells - 1))
        bands[1] = DRAG * n_face[1:] * c_face[1:]
        load = -n_face[1:] * np.diff(stress) / dx
        for factor, weight in ((n_face, NU_M * c_cell / dx**2), (c_face, NU_N * n_cell / dx**2)):
            bands[1] += factor[1:] ** 2 * (weight[:-1] + weight[1:])
            link = factor[:-1] * factor[1:] * weight[:-1]
            bands[0, 1:] -= link[1:]
            bands[2, :-1] -= link[1:]
            load[0] += link[0] * V / c_face[0]
        return bands, load

    def rates(self, n: np.ndarray, l: np.ndarray, w: np.ndarray, L: float, V: float) -> tuple[np.ndarray, np.ndarray]:
        """Rates of L n and L l."""
        n_face = 0.5 * (n[:-1] + n[1:])
        v = (1.0 - self.xi) * V - (1.0 - n_face) * w
        wave = v + n_face * w * NU_M / (NU_M * n_face + NU_N * (1.0 - n_face))
        step = np.diff(n)
        back, ahead = step[:-1], step[1:]
        size = np.minimum(0.5 * np.abs(back + ahead), 2.0 * np.minimum(np.abs(back), np.abs(ahead)))  # monotonised central slopes
        slopes = np.concatenate([[0.5 * step[0]], np.where(back * ahead > 0.0, np.sign(back) * size, 0.0), [step[-1]]])
        left, right = n[:-1] + 0.5 * slopes[:-1], n[1:] - 0.5 * slopes[1:]
        n_flux = 0.5 * v * (left + right) - 0.5 * np.maximum(np.abs(v), np.abs(wave)) * (right - left)
        l_flux = 0.5 * (1.0 - self.xi) * V * (l[:-1] + l[1:]) - np.diff(l) / (self.h * L)
        met = L * l * (1.0 - n)
        n_rate = -np.diff(n_flux, prepend=0.0, append=0.0) / self.h + K_M * met
        l_rate = -np.diff(l_flux, prepend=PSI_L, append=0.0) / self.h - K_L * met
        return n_rate, l_rate

    def right_side(self, t: float, y: np.ndarray, yp: np.ndarray) -> None:
        """y' = f(t, y), for CVODE."""
        L = y[self.L]
        n, l = y[self.n] / L, y[self.l] / L
        V = self.growth(l, L)
        bands, load = self.slip_system(n, l, L, V)
        w = solve_banded((1, 1), bands, load, overwrite_ab=True, overwrite_b=True, check_finite=False)
        yp[self.n], yp[self.l] = self.rates(n, l, w, L, V)
        yp[self.L] = V

    def residual(self, t: float, y: np.ndarray, yp: np.ndarray, out: np.ndarray) -> None:
        """F(t, y, y') = 0, for IDA."""
        L = y[self.L]
        n, l, w = y[self.n] / L, y[self.l] / L, y[self.w]
        V = self.growth(l, L)
        n_rate, l_rate = self.rates(n, l, w, L, V)
        bands, load = self.slip_system(n, l, L, V)
        out[self.n] = yp[self.n] - n_rate
        out[self.l] = yp[self.l] - l_rate
        out[self.L] = yp[self.L] - V
        out[self.w] = bands[1] * w - load
        out[self.w][:-1] += bands[0, 1:] * w[1:]
        out[self.w][1:] += bands[2, :-1] * w[:-1]

    def pattern(self) -> csc_matrix:
        """Where the Jacobian is not zero. Faces are numbered from 0, between cells 0 and 1."""
        m, f = self.cells, self.cells - 1

        def band(rows: int, columns: int, first: int, last: int) -> csc_matrix:
            offsets = list(range(first, last + 1))
            return diags([1.0] * len(offsets), offsets, shape=(rows, columns))

        blocks = [
            [band(m, m, -2, 2), band(m, m, 0, 0), None, band(m, f, -1, 0)],
            [band(m, m, 0, 0), band(m, m, -1, 1), None, None],
            [None, None, band(1, 1, 0, 0), None],
            [band(f, m, -1, 2), band(f, m, 0, 1), None, band(f, f, -1, 1)],
        ]
        filled = block_array(blocks).tolil()
        filled[:, [self.cells, self.L]] = 1.0
        return csc_matrix(filled)


def solve(cells: int, tolerance: float, form: str = "ode") -> dict[str, object]:
    """Cell values of n and l, and L, at T = 2; `form` is "ode", "dae" or "dae-sparse"."""
    plaque = Plaque(cells)
    y = plaque.initial()
    times = np.array([0.0, T_END])
    started = time.perf_counter()
    control = {"rtol": tolerance, "atol": tolerance, "max_num_steps": 20_000}
    if form == "ode":
        run = CVODE(plaque.right_side, **control).solve(times, y[: plaque.L + 1])
    else:
        if form == "dae-sparse":
            control |= {"linsolver": "sparse", "sparsity": plaque.pattern()}
        algebraic = list(range(plaque.w.start, plaque.w.stop))
        solver = IDA(plaque.residual, algebraic_idx=algebraic, calc_initcond="yp0", **control)
        run = solver.solve(times, y, np.zeros_like(y))
    seconds = time.perf_counter() - started
    if not run.success:
        raise RuntimeError(run.message)
    end = run.y[-1]
    L = float(end[plaque.L])
    note = f"{form}: {run.nfev} residuals besides those for {run.njev} Jacobians"
    return {"n": end[plaque.n] / L, "l": end[plaque.l] / L, "L": L, "seconds": seconds, "note": note}
