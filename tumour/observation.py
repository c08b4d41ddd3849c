"""What is stored of a state of the tumour, elastic or viscous: fields at the cells, radii, sizes and balances."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tumour import eulerian, radial
from tumour import laws as law

Array = NDArray[np.float64]

GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)
SIZES = {1: "thickness", 2: "area", 3: "volume"}


def scalar_names(m: int) -> tuple[str, ...]:
    """Names of the scalars of a body of dimension m, in the order in which they are filled."""
    return (
        "radius", SIZES[m], "cell_mass", "growth_rate", "doubling_time", "C_min", "necrotic_fraction", "necrotic_radius", "hypoxic_radius",
        "rim_width", "defect_cells", "defect_volume",
    )  # fmt: skip


def cell_averages(function: Callable[..., Array], faces: Array, m: int) -> Array:
    """Averages over the cells of the body at rest of a function of r and xi = r/radius, by Gauss's rule of three points; of a number,
    that number to the last bit, on any cells."""
    constant = getattr(function, "constant", None)
    if constant is not None:
        return np.full(len(faces) - 1, float(constant))
    half = 0.5 * np.diff(faces)[:, None]
    r = 0.5 * (faces[1:] + faces[:-1])[:, None] + half * GAUSS_POINTS
    values = np.asarray(function(r=r.ravel(), xi=r.ravel() / faces[-1]), dtype=float).reshape(r.shape)
    weights = GAUSS_WEIGHTS * r ** (m - 1)
    averages: Array = np.sum(weights * values, axis=1) / np.sum(weights, axis=1)
    return averages


@njit(error_model="numpy")
def radius_below(level: float, R: float, C_out: float, rho: Any, C: Any) -> float:
    """Radius within which oxygen is below a level: 0 if it nowhere is, R if it is at the surface, NaN if there is no level. C is taken as
    linear in r^2 between the points `rho` and out to the surface, and in from the first one: of second order at the centre, too."""
    if np.isnan(level):
        return np.nan
    outer, C_outer = R, C_out
    if C_outer < level:
        return R
    for i in range(len(rho) - 1, -1, -1):
        if C[i] < level:
            share = (level - C[i]) / (C_outer - C[i])
            return np.sqrt(rho[i] * rho[i] + share * (outer * outer - rho[i] * rho[i]))
        outer, C_outer = rho[i], C[i]
    slope = (C[1] - C[0]) / (rho[1] * rho[1] - rho[0] * rho[0])
    if not slope > 0.0:
        return 0.0
    square = rho[0] * rho[0] + (level - C[0]) / slope
    return np.sqrt(square) if square > 0.0 else 0.0


@njit(error_model="numpy")
def fill_scalars(
    m: int, unit: float, levels: Any, C_out: float, R: float, rate: float, cells: float, rho: Any, C: Any, scalars: Any
) -> None:
    """All scalars but the two defects, of a body of radius R that grows with `rate` and holds `cells` per unit of r^m/m."""
    scalars[0] = R
    scalars[1] = unit * R * law.volume_ratio(1.0, R, m) if m > 1 else unit * R
    scalars[2] = unit * m * cells
    scalars[3] = rate
    scalars[4] = np.log(2.0) * R / (m * rate) if rate > 1e-12 * R else np.nan
    scalars[5] = min(C.min(), C_out)
    necrotic = radius_below(levels[0], R, C_out, rho, C)
    scalars[6] = law.volume_ratio(necrotic / R, necrotic / R, m)
    scalars[7] = necrotic
    scalars[8] = radius_below(levels[1], R, C_out, rho, C)
    scalars[9] = R - necrotic


@njit(error_model="numpy")
def elastic_growth(d: radial.Data, t: float, y: Any, out: Any, work: Any) -> float:
    """Rate of the surface's radius. `out` receives the rates; for kappa = 0 the equilibrium is differentiated in time."""
    N = d.cells
    radial.rates(d, t, y, out, work)
    area = radial.area_of(radial.radius_of(y[3 * N - 1], d.m), d.m)
    if d.kappa > 0.0:
        return out[3 * N - 1] / area
    jac, q_rows = np.zeros((3 * N, 2 * radial.HALF + 1)), np.zeros((radial.INTEGRALS, 3 * N))
    empty = np.zeros((0, 3 * N))
    radial.tangent(d, t, y, out, jac, empty, empty, np.zeros((0, 0)), q_rows, np.zeros((radial.INTEGRALS, 0)), work, y)
    moved, change = np.zeros(y.size), np.zeros(y.size)
    for row in range(3 * N):
        for k in range(max(row - radial.HALF, 0), min(row + radial.HALF, 3 * N - 1) + 1):
            if k % 3 == 0 and row % 3 > 0:
                moved[row] += jac[row, k - row + radial.HALF] * out[k]
    if not radial._algebraic_change(d, moved, jac, change):
        return np.nan
    return change[3 * N - 1] / area


@njit(error_model="numpy")
def record_elastic(d: radial.Data, t: float, y: Any, slope: Any, start: Any, fields: Any, scalars: Any) -> None:
    """What is stored of the elastic tumour; see `multiphase.lines`.

    Within a step, growth and pressure follow from the motion along it, `slope`: the momentum balance at a point between would magnify
    what separates that point from the solution by the stiffness of the body.

    Parameters
    ----------
    start : (3,) array
        Cells per V at the start, nothing, and the size of the scene's body per r^m.
    fields : (7, N) array
        Filled with `ELASTIC_FIELDS`, then the positions of the cells' middles.
    scalars : (12,) array
        Filled in the order of `scalar_names`.
    """
    N, m = d.cells, d.m
    work, out = np.empty((radial.WORK_ROWS, N + 1)), np.empty(y.size)
    single = len(slope) == 0
    radial.no_less_than_none(N, d.V, y, 3 * N)
    rate = elastic_growth(d, t, y, out, work) if single else 0.0
    radial._prepare(d, y, work, False)
    if not single:
        rate = slope[3 * N - 1] / work[radial._AREA, N]
    h = d.R[1]
    p, T, J = d.p_out, 0.0, 0.0
    cells = volume = 0.0
    for i in range(N - 1, -1, -1):
        if single:
            p -= radial.pressure_step(d, work, i + 1)
        else:
            p -= radial.flow_step(d, work, i + 1, slope[3 * i + 2])
        J = work[radial._J, i]
        r_m, r_p = work[radial._RADIUS, i], work[radial._RADIUS, i + 1]
        l_r = (r_p - r_m) / h
        l_t = radial.hoop_stretch(r_m, r_p, d.R[i], d.R[i + 1], m)[0]
        P_r, P_t = law.elastic_stress(l_r, l_t, m, d.mu, d.lam)
        T -= radial.load_step(d, work, i + 1)
        P_r, P_t = P_r - T * J / l_r, P_t - T * J / l_t
        fields[0, i], fields[1, i], fields[2, i] = work[radial._ALPHA, i], y[3 * i + 1], p
        fields[3, i] = work[radial._RHO, i] - 0.5 * (d.R[i] + d.R[i + 1])
        fields[4, i], fields[5, i] = J, np.sqrt(P_r * P_r + (m - 1) * P_t * P_t)
        fields[6, i] = work[radial._RHO, i]
        cells += y[3 * i] * (d.V[i + 1] - d.V[i])
        volume += J * (d.V[i + 1] - d.V[i])
    fill_scalars(m, start[2], (d.necrotic, d.hypoxic), d.C_out, work[radial._RADIUS, N], rate, cells, fields[6], fields[1], scalars)
    scalars[10] = (cells - start[0] - y[3 * N]) / max(cells, abs(y[3 * N]))
    scalars[11] = (volume - y[3 * N - 1]) / volume


@njit(error_model="numpy")
def _onto_momentum_and_oxygen(d: eulerian.Data, t: float, y: Any, work: Any) -> None:
    """Bring C, u and V of `y` onto their equations: no error control measures them, and least of all u where cells have died."""
    size = eulerian.STRIDE * d.cells
    out, scratch, jac = np.empty(y.size), np.empty(y.size), np.empty((size, 2 * eulerian.HALF + 1))
    border, integrals = eulerian.BORDER, eulerian.INTEGRALS
    columns, rows, corner = np.empty((border, size)), np.empty((border, size)), np.empty((border, border))
    q_rows, q_corner = np.empty((integrals, size)), np.empty((integrals, border))
    for _ in range(2):
        eulerian.rates(d, t, y, out, work)
        eulerian.tangent(d, t, y, out, jac, columns, rows, corner, q_rows, q_corner, work, scratch)
        if not eulerian.project(d, y, out, jac):
            break


@njit(error_model="numpy")
def record_viscous(d: eulerian.Data, t: float, y: Any, slope: Any, start: Any, fields: Any, scalars: Any) -> None:
    """What is stored of the viscous tumour; see `multiphase.lines`.

    Parameters
    ----------
    start : (3,) array
        Cells and W at the start, and the size of the scene's body per r^m.
    fields : (6, N) array
        Filled with `VISCOUS_FIELDS`, then the positions of the cells' middles.
    scalars : (12,) array
        Filled in the order of `scalar_names`.
    """
    N, m = d.cells, d.m
    work = np.empty((eulerian.WORK_ROWS, N + 1))
    eulerian.bounded(d, y)
    _onto_momentum_and_oxygen(d, t, y, work)
    eulerian._prepare(d, y, work)
    W = y[3 * N]
    R = work[eulerian._RADIUS, N]
    p, cells = d.p_out, 0.0
    for i in range(N - 1, -1, -1):
        p -= eulerian.pressure_step(d, y, work, i + 1)
        r_m, r_p = work[eulerian._RADIUS, i], work[eulerian._RADIUS, i + 1]
        u_m, u_p = eulerian._velocity(y, i), eulerian._velocity(y, i + 1)
        _, by_m, by_p, _, _, _ = radial.hoop_stretch(r_m, r_p, r_m, r_p, m)
        alpha = work[eulerian._ALPHA, i]
        s_r, s_t = law.viscous_stress(alpha, (u_p - u_m) / (r_p - r_m), by_m * u_m + by_p * u_p, m, d.mu, d.lam)
        T = p + work[eulerian._CONTACT, i]
        fields[0, i], fields[1, i], fields[2, i], fields[3, i] = alpha, y[3 * i + 1], p, 0.5 * (u_m + u_p)
        fields[4, i] = np.sqrt((s_r - T) * (s_r - T) + (m - 1) * (s_t - T) * (s_t - T))
        fields[5, i] = 0.5 * (r_m + r_p)
        cells += y[3 * i] * (d.s[i + 1] - d.s[i])
    fill_scalars(m, start[2], (d.necrotic, d.hypoxic), d.C_out, R, y[3 * N - 1], cells, fields[5], fields[1], scalars)
    born, grown = y[3 * N + 2], y[3 * N + 3]
    scalars[10] = (cells - start[0] - born) / max(cells, abs(born))
    scalars[11] = (W - start[1] - grown) / max(W, abs(grown))
