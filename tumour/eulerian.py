r"""The tumour as a viscous fluid of cells in a body whose radius R(t) moves: discrete equations on xi = r/R(t), compiled.

The Eulerian two-phase model of section 2.1, radial, in slab, disk and sphere (m = 1, 2, 3). With ``W = R^m/m`` and the share
``s = xi^m`` of the volume within xi, a cell ``xi_i <= xi <= xi_{i+1}`` (equal in xi) has the volume ``W Delta s``. Unknowns, cell by
cell: ``W alpha_i``, ``C_i``, and the velocity ``u_{i+1}`` of the cells on the outer face; then W and V = dW/dt. With ``a = r^(m-1)``,
``rho`` the middle of a cell and Delta a difference over a face or a cell,

    d(W alpha_i)/dt = -Delta(c alpha)/Delta s + W q(alpha_i, C_i),       c_f = a_f u_f - s_f V,  0 at both ends    (2.1), (2.6)
    0 = [a Delta C/Delta rho]_{i+1} - [a Delta C/Delta rho]_i - W Delta s Q alpha_i C_i/(1 + Q1_hat C_i)
    dW/dt = V,     0 = V - a_N u_N

alpha is taken from the side that c comes from, with limited slopes (`multiphase.transport`); ``c = a u - s V`` is the flux of volume
through the moving face, and as s V is linear in the state, a uniform alpha stays uniform where the cells stand still, whatever V and
the steps.

Momentum (2.4), with the fluid's ``p_r = zeta u``, zeta = 1/M, from the balance of the mixture: a cell has the strain rates
``e_r = Delta u/Delta r`` and e_t with ``e_r + (m-1) e_t = Delta(a u)/(W Delta s)`` exactly, so a uniform growth u ~ r has e_t = e_r to
rounding; the viscous forces ``F_f = d/du_f sum W Delta s (sigma_r e_r + (m-1) sigma_t e_t)/2`` balance the work of T = p + alpha Sigma:

    0 = F_f + a_f ( zeta_f u_f Delta rho_f + Delta(alpha Sigma)_f )                                inside
    0 = F_N + a_N ( zeta_{N-1} u_N Delta rho_N - p_out - (alpha Sigma)_{N-1} )                      at the surface, free of traction

The rows are linear and positive definite in u. alpha is floored in them, which keeps them regular where all cells have died.
kappa = 0 is zeta = 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from multiphase import transport
from multiphase.banded import factor as _factor
from multiphase.banded import solve as _solve
from tumour import laws as law
from tumour.radial import area_of, hoop_stretch, no_less_than_none, radius_of

Array = Any

STRIDE, HALF = 3, 6
"""Unknowns of a cell, and the half-width of the band of their tangent."""
BORDER = 2
"""W and V."""
INTEGRALS = 2
"""Integrals over time of the cells born less those that died, per unit of r^m/m, and of V."""
FLOOR = 1e-8
"""Least cell fraction in the momentum rows; it changes the others by a relative (FLOOR/alpha)^2."""
LEAST_AT_SURFACE = 1e-5
"""Cell fraction at the surface below which a p_out > 0 tears the body apart in finite time."""


class Data(NamedTuple):
    """What the kernels need of one scene."""

    cells: int
    m: int
    s: Array
    mu: float
    lam: float
    kappa: float
    law: int
    floor: float
    gamma: float
    alpha_star: float
    alpha_min: float
    sigma_width: float
    s1: float
    s2: float
    s3: float
    s4: float
    Q: float
    Q1_hat: float
    C_out: float
    p_out: float
    rtol: float
    hypoxic: float
    necrotic: float
    limiter: bool
    least: float


# Rows of the work space: values in cells (N) or on faces (N + 1).
(_ALPHA, _THICK, _THICK_A, _SLOPE, _BACK, _HERE, _AHEAD, _CONTACT, _ZETA, _RADIUS, _AREA, _FORCE_M, _FORCE_P, _MM, _MP, _PP) = range(16)
WORK_ROWS = 16


@njit(error_model="numpy")
def _slopes(d: Data, work: Array) -> None:
    """Slopes of alpha in the cells and their derivatives."""
    N, h = d.cells, 1.0 / d.cells
    alpha, slope = work[_ALPHA], work[_SLOPE]
    for i in range(N):
        if i == 0:
            if d.limiter:
                slope[i], here, ahead = transport.symmetric_slope(alpha[0], alpha[1])
            else:
                slope[i], here, ahead = 0.5 * (alpha[1] - alpha[0]), -0.5, 0.5
            back = 0.0
        elif i == N - 1:
            if d.limiter:
                slope[i], here, back = transport.open_slope(alpha[i], alpha[i - 1])
            else:
                slope[i], here, back = alpha[i] - alpha[i - 1], 1.0, -1.0
            ahead = 0.0
        elif d.limiter:
            slope[i], back, here, ahead = transport.slope(alpha[i] - alpha[i - 1], alpha[i + 1] - alpha[i], alpha[i], h)
        else:
            slope[i], back, here, ahead = 0.5 * (alpha[i + 1] - alpha[i - 1]), -0.5, 0.0, 0.5
        work[_BACK, i], work[_HERE, i], work[_AHEAD, i] = back, here, ahead


@njit(error_model="numpy")
def _prepare(d: Data, y: Array, work: Array) -> None:
    """Fractions, slopes, radii, and in each cell the forces on both faces and their derivatives with respect to the velocities."""
    N, m = d.cells, d.m
    W = y[STRIDE * N]
    R = radius_of(W, m)
    for i in range(N):
        work[_ALPHA, i] = y[STRIDE * i] / W
    for i in range(N):
        alpha = work[_ALPHA, i]
        thick = law.floored(alpha, FLOOR)
        work[_THICK, i], work[_THICK_A, i] = thick, law.floored_slope(alpha, FLOOR)
        work[_CONTACT, i] = law.contact_pressure(alpha, d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)
        work[_ZETA, i] = law.resistance(thick, d.kappa, d.law, d.floor)
    _slopes(d, work)
    for f in range(N + 1):
        work[_RADIUS, f] = R * f / N
        work[_AREA, f] = area_of(work[_RADIUS, f], m)
    step = N / R
    for i in range(N):
        volume = W * (d.s[i + 1] - d.s[i])
        r_m, r_p = work[_RADIUS, i], work[_RADIUS, i + 1]
        _, by_m, by_p, _, _, _ = hoop_stretch(r_m, r_p, r_m, r_p, m)
        u_m, u_p = _velocity(y, i), _velocity(y, i + 1)
        thick = work[_THICK, i]
        _, rr, rt, _, tr, tt = law.viscous_stress_slopes(thick, 0.0, 0.0, m, d.mu, d.lam)
        tr, tt = (m - 1) * tr, (m - 1) * tt
        mm = volume * (step * step * rr - step * by_m * (rt + tr) + by_m * by_m * tt)
        pp = volume * (step * step * rr + step * by_p * (rt + tr) + by_p * by_p * tt)
        mp = volume * (-step * step * rr - step * by_p * rt + step * by_m * tr + by_m * by_p * tt)
        work[_MM, i], work[_PP, i], work[_MP, i] = mm, pp, mp
        work[_FORCE_M, i], work[_FORCE_P, i] = mm * u_m + mp * u_p, mp * u_m + pp * u_p


@njit(error_model="numpy")
def _velocity(y: Array, f: int) -> float:
    """u on face f."""
    return y[STRIDE * (f - 1) + 2] if f > 0 else 0.0


@njit(error_model="numpy")
def _gap(d: Data, work: Array, f: int) -> float:
    """Delta rho over face f: between the middles of two cells, or half a cell at the surface."""
    return work[_RADIUS, 1] if f < d.cells else 0.5 * work[_RADIUS, 1]


@njit(error_model="numpy")
def _face_resistance(d: Data, work: Array, f: int) -> float:
    return work[_ZETA, f - 1] if f == d.cells else 0.5 * (work[_ZETA, f - 1] + work[_ZETA, f])


@njit(error_model="numpy")
def pressure_step(d: Data, y: Array, work: Array, f: int) -> float:
    """Delta p over face f, 1 <= f <= N: from cell f - 1 to the next one, or to the surface."""
    return _face_resistance(d, work, f) * _velocity(y, f) * _gap(d, work, f)


@njit(error_model="numpy")
def _oxygen(d: Data, y: Array, f: int) -> float:
    """C in cell f; the surface's is C_out."""
    return y[STRIDE * f + 1] if f < d.cells else d.C_out


@njit(error_model="numpy")
def face_values(d: Data, y: Array, out: Array, work: Array) -> None:
    """On the interior faces: flux of cells c alpha and its velocity c; `out` (2, N + 1), zero at both ends."""
    N = d.cells
    _prepare(d, y, work)
    out[:, :] = 0.0
    for f in range(1, N):
        out[1, f] = work[_AREA, f] * _velocity(y, f) - d.s[f] * y[STRIDE * N + 1]
        out[0, f] = out[1, f] * _from_upwind(work, f, out[1, f])


@njit(error_model="numpy")
def _from_upwind(work: Array, f: int, c: float) -> float:
    """alpha on face f, from the side that c comes from."""
    if c >= 0.0:
        return work[_ALPHA, f - 1] + 0.5 * work[_SLOPE, f - 1]
    return work[_ALPHA, f] - 0.5 * work[_SLOPE, f]


@njit(error_model="numpy")
def rates(d: Data, t: float, y: Array, out: Array, work: Array) -> None:
    """``M dy/dt``: rates of the balances, residuals of the algebraic rows.

    Parameters
    ----------
    d : Data
    t : float
    y, out : (3 cells + BORDER + INTEGRALS,) array
    work : (WORK_ROWS, cells + 1) array
    """
    N = d.cells
    _prepare(d, y, work)
    W, V = y[STRIDE * N], y[STRIDE * N + 1]
    born = inner = through = 0.0
    for i in range(N):
        f = i + 1
        alpha, C, share = work[_ALPHA, i], y[STRIDE * i + 1], d.s[f] - d.s[i]
        source = W * law.net_growth(alpha, C, d.s1, d.s2, d.s3, d.s4)
        born += share * source
        outer = work[_AREA, f] * (_oxygen(d, y, f) - C) / _gap(d, work, f)
        leaving = 0.0
        if f < N:
            c = work[_AREA, f] * _velocity(y, f) - d.s[f] * V
            leaving = c * _from_upwind(work, f, c)
        out[STRIDE * i] = source - (leaving - through) / share
        out[STRIDE * i + 1] = outer - inner - W * share * law.oxygen_uptake(alpha, C, d.Q, d.Q1_hat)
        inner, through = outer, leaving
        if f < N:
            force = work[_FORCE_P, i] + work[_FORCE_M, f]
            push = pressure_step(d, y, work, f) + work[_CONTACT, f] - work[_CONTACT, i]
        else:
            force = work[_FORCE_P, i]
            push = pressure_step(d, y, work, f) - d.p_out - work[_CONTACT, i]
        out[STRIDE * i + 2] = force + work[_AREA, f] * push
    out[STRIDE * N], out[STRIDE * N + 1] = V, V - work[_AREA, N] * _velocity(y, N)
    out[STRIDE * N + 2], out[STRIDE * N + 3] = born, V


@njit(error_model="numpy")
def tangent(
    d: Data, t: float, y: Array, f_0: Array, jac: Array, columns: Array, rows: Array, corner: Array, q_rows: Array, q_corner: Array,
    work: Array, scratch: Array,
) -> None:  # fmt: skip
    """Derivatives of `rates` at `y`; the column of W by central differences, the rest exactly.

    ``jac[i, j - i + HALF]`` is (3 cells, 2 HALF + 1), `columns` and `rows` (BORDER, 3 cells), `q_rows` (INTEGRALS, 3 cells).
    """
    N = d.cells
    size = STRIDE * N
    W, V = y[size], y[size + 1]
    step = 1e-5 * W
    for sign in (1.0, -1.0):
        y[size] = W + sign * step
        rates(d, t, y, scratch, work)
        weight = 0.5 * sign / step
        for i in range(size):
            columns[0, i] = weight * scratch[i] + (columns[0, i] if sign < 0.0 else 0.0)
        for i in range(BORDER):
            corner[i, 0] = weight * scratch[size + i] + (corner[i, 0] if sign < 0.0 else 0.0)
        for i in range(INTEGRALS):
            q_corner[i, 0] = weight * scratch[size + BORDER + i] + (q_corner[i, 0] if sign < 0.0 else 0.0)
    y[size] = W
    _prepare(d, y, work)
    columns[1, :] = 0.0
    corner[0, 1] = corner[1, 1] = 1.0
    q_corner[0, 1], q_corner[1, 1] = 0.0, 1.0
    jac[:, :] = 0.0
    rows[:, :] = 0.0
    q_rows[:, :] = 0.0
    for i in range(N):
        alpha, C, share = work[_ALPHA, i], y[STRIDE * i + 1], d.s[i + 1] - d.s[i]
        q_a, q_C = law.net_growth_slopes(alpha, C, d.s1, d.s2, d.s3, d.s4)
        u_a, u_C = law.oxygen_uptake_slopes(alpha, C, d.Q, d.Q1_hat)
        row = STRIDE * i
        jac[row, HALF] += q_a
        jac[row, HALF + 1] += W * q_C
        q_rows[0, row], q_rows[0, row + 1] = share * q_a, share * W * q_C
        jac[row + 1, HALF - 1] -= share * u_a
        jac[row + 1, HALF] -= W * share * u_C
    for f in range(1, N + 1):
        left, right = STRIDE * (f - 1) + 1, STRIDE * f + 1
        conductance = work[_AREA, f] / _gap(d, work, f)
        jac[left, HALF] -= conductance
        if f < N:
            jac[left, HALF + STRIDE] += conductance
            jac[right, HALF - STRIDE] += conductance
            jac[right, HALF] -= conductance
            _transport_tangent(d, y, jac, columns, work, f, W, V)
        _momentum_tangent(d, y, jac, work, f, W)
    rows[1, size - 1] = -work[_AREA, N]


@njit(error_model="numpy")
def _transport_tangent(d: Data, y: Array, jac: Array, columns: Array, work: Array, f: int, W: float, V: float) -> None:
    """Derivatives of the flux of cells through face f with respect to W alpha, u and V."""
    row_m, row_p = STRIDE * (f - 1), STRIDE * f
    share_m, share_p = d.s[f] - d.s[f - 1], d.s[f + 1] - d.s[f]
    c = work[_AREA, f] * _velocity(y, f) - d.s[f] * V
    cell, sign = (f - 1, 1.0) if c >= 0.0 else (f, -1.0)
    for k in range(-1, 2):
        other = cell + k
        if 0 <= other < d.cells:
            half = sign * 0.5 * (work[_BACK, cell] if k == -1 else work[_HERE, cell] if k == 0 else work[_AHEAD, cell])
            by_alpha = c * ((1.0 if k == 0 else 0.0) + half) / W
            column = STRIDE * other
            jac[row_m, column - row_m + HALF] -= by_alpha / share_m
            jac[row_p, column - row_p + HALF] += by_alpha / share_p
    by_u = work[_AREA, f] * _from_upwind(work, f, c)
    column = STRIDE * (f - 1) + 2
    jac[row_m, column - row_m + HALF] -= by_u / share_m
    jac[row_p, column - row_p + HALF] += by_u / share_p
    by_V = -d.s[f] * _from_upwind(work, f, c)
    columns[1, row_m] -= by_V / share_m
    columns[1, row_p] += by_V / share_p


@njit(error_model="numpy")
def _momentum_tangent(d: Data, y: Array, jac: Array, work: Array, f: int, W: float) -> None:
    """Derivatives of the momentum row of face f."""
    N, row, area, gap = d.cells, STRIDE * (f - 1) + 2, work[_AREA, f], _gap(d, work, f)
    u = _velocity(y, f)
    jac[row, HALF] += work[_PP, f - 1] + area * _face_resistance(d, work, f) * gap
    if f > 1:
        jac[row, HALF - STRIDE] += work[_MP, f - 1]
    if f < N:
        jac[row, HALF] += work[_MM, f]
        jac[row, HALF + STRIDE] += work[_MP, f]
    for i in (f - 1, f):
        if i == N:
            continue
        alpha, thick = work[_ALPHA, i], work[_THICK, i]
        force = work[_FORCE_P, i] if i == f - 1 else work[_FORCE_M, i]
        by_alpha = force / thick * work[_THICK_A, i]
        mean = 1.0 if f == N else 0.5
        by_alpha += area * mean * law.resistance_slope(thick, d.kappa, d.law, d.floor) * work[_THICK_A, i] * u * gap
        slope = law.contact_pressure_slope(alpha, d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)
        by_alpha += -area * slope if i == f - 1 else area * slope
        jac[row, STRIDE * i - row + HALF] += by_alpha / W


@njit(error_model="numpy")
def size_of(d: Data, y: Array, e: Array) -> float:
    """The larger of the root mean square error of alpha and the relative error of R, in units of rtol."""
    N = d.cells
    W, e_W = y[STRIDE * N], e[STRIDE * N]
    square = 0.0
    for i in range(N):
        change = (e[STRIDE * i] - y[STRIDE * i] / W * e_W) / W
        square += change * change
    return max(np.sqrt(square / N), abs(e_W) / (d.m * W)) / d.rtol


@njit(error_model="numpy")
def bounded(d: Data, y: Array) -> None:
    """Bring alpha back to 0 or more with the sum of cells kept: see `tumour.radial.no_less_than_none`."""
    no_less_than_none(d.cells, d.s, y, STRIDE * d.cells + BORDER)


@njit(error_model="numpy")
def admit(d: Data, y: Array, work: Array) -> int:
    """Refuses a step after which the body has no size (1), alpha is below 0 by more than rtol, or 1 or more (2), or C is negative by more
    than rtol (3), or p_out pulls at a surface without cells (4); 0 otherwise, with alpha brought back to 0 or more."""
    N = d.cells
    W = y[STRIDE * N]
    if not d.least < W:
        return 1
    for i in range(N):
        if not -d.rtol * W <= y[STRIDE * i] < W:
            return 2
        if not y[STRIDE * i + 1] > -d.rtol * max(1.0, d.C_out):
            return 3
    if d.p_out > 0.0 and y[STRIDE * (N - 1)] < LEAST_AT_SURFACE * W:
        return 4
    bounded(d, y)
    return 0


@njit(error_model="numpy")
def reach(d: Data, y: Array, change: Array) -> float:
    """Share of a Newton change that keeps W > 0 and alpha < 1; 0 if `y` itself does not."""
    size = STRIDE * d.cells
    W, c_W = y[size], change[size]
    if not W > 0.0:
        return 0.0
    share = 1.0
    if W + c_W < 0.1 * W:
        share = 0.9 * W / -c_W
    for i in range(d.cells):
        room, moved = W - y[STRIDE * i], c_W - change[STRIDE * i]
        if not room > 0.0:
            return 0.0
        if room + share * moved < 0.1 * room:
            share = 0.9 * room / -moved
    return share


@njit(error_model="numpy")
def _algebraic_change(d: Data, f: Array, jac: Array, change: Array) -> bool:
    """Newton's change of C and u, which do not depend on each other, the rest kept; False where the equations are singular."""
    N = d.cells
    band, right = np.empty((N, 4)), np.empty(N)
    pivots = np.empty((2, N), dtype=np.int64)
    change[:] = 0.0
    for kind in range(1, STRIDE):
        band[:, :] = 0.0
        for i in range(N):
            row = STRIDE * i + kind
            right[i] = -f[row]
            for k in range(-1, 2):
                if 0 <= i + k < N:
                    band[i, k + 1] = jac[row, STRIDE * k + HALF]
        if not _factor(band, 1, pivots):
            return False
        _solve(band, 1, pivots, right)
        for i in range(N):
            change[STRIDE * i + kind] = right[i]
    return True


@njit(error_model="numpy")
def project(d: Data, y: Array, f: Array, jac: Array) -> bool:
    """Bring C and u of `y` onto their equations by one iteration with the rates `f` and the tangent `jac` there, and V with them; True if
    they were so far off that both must be evaluated anew. False, too, where the equations are singular: Newton's method will say so."""
    change = np.empty(y.size)
    if not _algebraic_change(d, f, jac, change):
        return False
    size = STRIDE * d.cells
    moved = largest = 0.0
    for k in range(size):
        y[k] += change[k]
        if k % STRIDE > 0:
            f[k] = 0.0  # what was just removed must not be seen by the estimate of the local error
        if k % STRIDE == 2:
            moved, largest = max(moved, abs(change[k])), max(largest, abs(y[k]))
    f[size + 1] = 0.0
    y[size + 1] = area_of(radius_of(y[size], d.m), d.m) * y[size - 1]
    return moved > 1e-3 * largest


@njit(error_model="numpy")
def settle(d: Data, t: float, y: Array, w: Any) -> None:
    """Bring the algebraic part of `y` onto its equations; `w` is the work space of `multiphase.radau`."""
    change = np.empty(y.size)
    size = STRIDE * d.cells
    for _ in range(100):
        rates(d, t, y, w.f_0, w.model)
        tangent(d, t, y, w.f_0, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
        if not _algebraic_change(d, w.f_0, w.jac, change):
            return
        moved = largest = 0.0
        for k in range(size):
            y[k] += change[k]
            if k % STRIDE > 0:
                moved, largest = max(moved, abs(change[k])), max(largest, abs(y[k]))
        y[size + 1] = area_of(radius_of(y[size], d.m), d.m) * y[size - 1]
        if moved <= 1e-14 * largest:
            return
