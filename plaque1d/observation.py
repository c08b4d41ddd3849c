"""What is stored of a state of the plaque: velocities, pressure, wall values and balances, in the slab and in the annulus."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from multiphase.geometry import MovingGrid
from plaque1d import discretisation as fv
from plaque1d import laws as law
from plaque1d import layout
from plaque1d.parameters import PlaqueGeometry

Array = NDArray[np.float64]

SMALLEST_FRACTION = 1e-5
"""Macrophage fraction at the endothelium below which the slip velocity there, V/c, is no longer resolved."""

GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)
FIELDS = ("n", "c", "l", "u_n", "u_m", "p_n")
SCALARS = ("L", "L_rate", "l_wall", "n_wall", "n_total", "c_total", "l_total", "defect_L", "defect_n", "defect_c", "defect_l")


def cell_averages(function: Callable[..., Array], grid: MovingGrid, geometry: PlaqueGeometry, L: float) -> Array:
    """Averages over the cells of a function of x and xi = x/L, by Gauss's rule of three points; of a number, that number."""
    constant = getattr(function, "constant", None)
    if constant is not None:
        return np.full(grid.cells, float(constant))
    share = grid.centres[:, None] + 0.5 * grid.spacing * GAUSS_POINTS
    x = geometry.position(share.ravel(), geometry.size(L))
    values = np.asarray(function(x=x, xi=x / L), dtype=float).reshape(share.shape)
    averages: Array = values @ (0.5 * GAUSS_WEIGHTS)
    return averages


@njit(error_model="numpy")
def _distance(d: layout.Data, share: float, W: float) -> float:
    """Distance from the endothelium within which a share of the wall lies."""
    if not d.annulus:
        return share * W
    return 2.0 * share * W / (d.inner_radius + np.sqrt(d.inner_radius * d.inner_radius + 2.0 * share * W))


@njit(error_model="numpy")
def observe(d: layout.Data, t: float, y: Any, start: Any, gains: Any, fields: Any, scalars: Any) -> None:
    """Fields at the cell centres, and scalars, of the vector `y` of the schemes.

    Parameters
    ----------
    d : plaque1d.discretisation.Data
        Of the stretch of Psi_l(t) that ends at `t`.
    t : float
    y : array
    start : (4,) array
        Integrals of n, c and l, and W, at the start.
    gains : (4,) array
        Integrals over time of the sources of n, of the losses of l, of the influx of modLDL, and of dW/dt.
    fields : (7, N) array
        Filled with `FIELDS`, then the positions of the cell centres.
    scalars : (11,) array
        Filled with `SCALARS`. Amounts are per unit length of endothelium, defects relative to the larger
        of the amount (for the fractions, of W) and what came in.
    """
    N, m = d.cells, d.stride
    W, R_1 = y[m * N], d.inner_radius
    h = 1.0 / N
    n, l = fields[0], fields[2]
    n_total = l_total = 0.0
    for i in range(N):
        n[i], l[i] = y[m * i] / W, y[m * i + 1] / W
        fields[1, i] = 1.0 - n[i]
        fields[6, i] = _distance(d, (i + 0.5) * h, W)
        n_total += y[m * i]
        l_total += y[m * i + 1]
    n_total, l_total = n_total * h, l_total * h
    l_wall = law.wall_concentration(l[0], 0.5 * h * W / R_1, layout.influx(d, t), d.Psi_m)
    V = R_1 * law.growth_rate(l_wall, d.Psi_m)
    n_wall = n[0] - (n[1] - n[0]) / 6.0 if np.isnan(d.n_wall) else d.n_wall
    _velocities_and_pressure(d, y, V, n_wall, fields)
    L = _distance(d, 1.0, W)
    scalars[0], scalars[1], scalars[2], scalars[3] = L, V / (R_1 + L if d.annulus else 1.0), l_wall, n_wall
    c_total = W - n_total
    scalars[4], scalars[5], scalars[6] = n_total / R_1, c_total / R_1, l_total / R_1
    n_gain, l_loss, influx, growth = gains
    for i, total, first, gain, through in (
        (7, W, start[3], growth, abs(growth)),
        (8, n_total, start[0], n_gain, max(abs(n_gain), W)),
        (9, c_total, start[1], growth - n_gain, max(abs(growth + n_gain), W)),
        (10, l_total, start[2], influx - l_loss, abs(influx + l_loss)),
    ):
        scale = max(abs(total), through)
        scalars[i] = (total - first - gain) / scale if scale > 0.0 else 0.0


@njit(error_model="numpy")
def _velocities_and_pressure(d: layout.Data, y: Any, V: float, n_wall: float, fields: Any) -> None:
    """u_n and u_m, averaged from the faces, and p_n from the sum of the momentum balances integrated from the outer wall."""
    N, m = d.cells, d.stride
    W, n = y[m * N], fields[0]
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    outer = d.p_out
    r_p = n_p = m_p = 0.0  # radius, u_n and u_m on the outer face of a cell; with _m on the inner one
    for f in range(N, -1, -1):
        r_m = d.inner_radius + _distance(d, f / N, W) if d.annulus else 1.0
        mixture = V / r_m
        if f == N:
            fraction, slip = n[N - 1] + 0.5 * (n[N - 1] - n[N - 2]), 0.0
        elif f > 0:
            fraction, slip = 0.5 * (n[f - 1] + n[f]), y[m * (f - 1) + 2]
        else:
            fraction = n[0] if np.isnan(d.n_wall) else n_wall  # as the slip equation takes it: p_n is of second order then
            slip = mixture / max(1.0 - fraction, SMALLEST_FRACTION)
        n_m, m_m = law.necrotic_velocity(mixture, fraction, slip), law.macrophage_velocity(mixture, fraction, slip)
        if f == 0:
            n_m = 0.0
        if f < N:
            i, mean = f, 0.5 * (r_m + r_p)
            fields[3, i], fields[4, i] = 0.5 * (n_m + n_p), 0.5 * (m_m + m_p)
            e_n, e_m = mean * N / W * (n_p - n_m), mean * N / W * (m_p - m_m)
            stress = law.extra_stress(fields[2, i], d.A, d.B, d.k)
            if d.annulus:
                hoop_n, hoop_m = 0.5 * (n_m + n_p) / mean, 0.5 * (m_m + m_p) / mean
                c = 1.0 - n[i]
                step = 2.0 * (d.mu_n * n[i] * (e_n - hoop_n) + d.mu_m * c * (e_m - hoop_m)) * W / (N * mean * mean)
                p_n = law.pressure(outer - 0.5 * step, n[i], stress, e_n, e_m, nu_n, nu_m)
                fields[5, i] = p_n + d.lambda_n * n[i] * hoop_n + d.lambda_m * c * hoop_m
                outer -= step
            else:
                fields[5, i] = law.pressure(outer, n[i], stress, e_n, e_m, nu_n, nu_m)
        n_p, m_p, r_p = n_m, m_m, r_m


@njit(error_model="numpy")
def gains(d: layout.Data, y: Any) -> Any:
    """Integrals over time of the sources of n, of the losses of l, of the influx of modLDL, and of dW/dt."""
    size = d.stride * d.cells
    uptake, influx, growth = y[size + 2], y[size + 3], y[size + 4]
    return np.array([d.k_m * uptake, d.k_l * uptake, influx, growth])


@njit(error_model="numpy")
def record(d: layout.Data, t: float, y: Any, slope: Any, start: Any, fields: Any, scalars: Any) -> None:
    """`observe` of a vector on the polynomial of a step, its fractions brought back into [0, 1]; see `multiphase.lines`."""
    fv.bounded(d, y)
    observe(d, t, y, start, gains(d, y), fields, scalars)
