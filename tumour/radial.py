r"""The tumour as an elastic body that grows with spherical, axial or planar symmetry: discrete equations, compiled.

The radial reduction of the Lagrangian model, (2.14) to (2.22): a point at R of the body at rest, 0 <= R <= R_0, is at r(R, t). Cells
``R_i <= R <= R_{i+1}`` are equal in R. With ``V = R^m/m`` and ``v = r^m/m`` on the faces (m = 1, 2, 3 for slab, disk, sphere), h the
width of a cell, and Delta the difference over a cell, the cell i has the stretches

    l_r = Delta r / h,      J = Delta v / Delta V,      l_t = (J / l_r)^(1/(m-1))      (1 in the slab),

so that J = l_r l_t^(m-1) exactly and a uniform stretch is one to rounding. Unknowns, cell by cell: ``phi_i = alpha_i J_i`` (cells per
volume at rest), ``C_i``, and ``v_{i+1}`` on its outer face. With ``a = r^(m-1)`` and ``rho`` the middle of a deformed cell,

    d phi_i/dt = J_i q(alpha_i, C_i)                                                                    (2.22b)
    d v_f/dt   = a_f Delta p_f / (zeta_f Delta rho_f),           zeta = 1/M, the mean of both cells     (2.22c)
    0 = [a Delta C/Delta rho]_{i+1} - [a Delta C/Delta rho]_i - Delta v_i Q alpha_i C_i/(1 + Q1_hat C_i)   (2.22d)

The momentum balance (2.22a) gives the pressure. Let ``F_f = dE/dr_f`` be the force that holds face f against the
elastic energy ``E = sum Delta V_i W(l_r, l_t)``, and T = p + alpha Sigma. The work of T in a change of r_f is ``(T_{f-1} - T_f) a_f``, so

    T_f - T_{f-1} = -F_f/a_f    inside,      T_{N-1} = F_N/a_N    at the surface, which is free of traction,

hence ``Delta p_f = -F_f/a_f - Delta(alpha Sigma)`` inside, and ``p_out - p_{N-1} = p_out - F_N/a_N + (alpha Sigma)_{N-1}`` over the last
half cell. At the centre v_0 = 0 and no flux passes. kappa = 0 (zeta = 0) makes the rows of v algebraic: Delta p_f = 0.

Balances: the sum of ``phi_i Delta V_i`` changes by the sum of the sources only, and the volumes ``J_i Delta V_i`` add up to the
body's, whose rate is the flux through the surface, whatever the step and its errors.
The step of the paper's program, ``(J - J_old) alpha + (alpha - alpha_old) J`` for the change of alpha J in backward Euler, differs from
that by ``(J - J_old)(alpha - alpha_old)`` and does not keep the first balance; it is there for comparison (`Data.as_printed`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from multiphase.banded import factor as _factor
from multiphase.banded import solve as _solve
from tumour import laws as law

Array = Any

STRIDE, HALF = 3, 5
"""Unknowns of a cell, and the half-width of the band of their tangent."""
BORDER = 0
INTEGRALS = 1
"""The integral over time of the cells born less those that died, per unit of V."""

FLOOR = 1e-8
"""Least cell fraction in the resistance, which keeps the flow regular where all cells have died."""
MOST_SWOLLEN = 1e9
"""Volume ratio J above which a body has no ceiling: a step that passes it is refused."""
LEAST_SHARE = 0.1
"""Newton changes leave at least this share of the distance to J = 0, alpha = 0 and alpha = 1."""


class Data(NamedTuple):
    """What the kernels need of one scene: sizes, parameters, and the last point for the step as printed."""

    cells: int
    m: int
    R: Array
    V: Array
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
    kink_band: float
    hypoxic: float
    necrotic: float
    as_printed: bool
    rate: float
    old: Array


# Rows of the work space: values in cells (N) or on faces (N + 1).
(_RADIUS, _AREA, _RHO, _J, _ALPHA, _CONTACT, _CONTACT_A, _ZETA, _ZETA_A, _FORCE_M, _FORCE_P, _MM, _MP, _PP, _GAP) = range(15)
WORK_ROWS = 15


@njit(error_model="numpy")
def radius_of(v: float, m: int) -> float:
    """r of ``v = r^m/m``."""
    if m == 1:
        return v
    return np.sqrt(2.0 * v) if m == 2 else np.cbrt(3.0 * v)


@njit(error_model="numpy")
def area_of(r: float, m: int) -> float:
    """``a = r^(m-1)``."""
    if m == 1:
        return 1.0
    return r if m == 2 else r * r


@njit(error_model="numpy")
def hoop_stretch(r_m: float, r_p: float, R_m: float, R_p: float, m: int) -> tuple[float, float, float, float, float, float]:
    """l_t of a cell, its derivatives with respect to the radii of the inner and the outer face, and its second ones (--, -+, ++)."""
    if m == 1:
        return 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if m == 2:
        slope = 1.0 / (R_p + R_m)
        return (r_p + r_m) * slope, slope, slope, 0.0, 0.0, 0.0
    rest = R_p * R_p + R_p * R_m + R_m * R_m
    l_t = np.sqrt((r_p * r_p + r_p * r_m + r_m * r_m) / rest)
    half = 0.5 / (l_t * rest)
    by_m, by_p = (2.0 * r_m + r_p) * half, (2.0 * r_p + r_m) * half
    return l_t, by_m, by_p, 2.0 * half - by_m * by_m / l_t, half - by_m * by_p / l_t, 2.0 * half - by_p * by_p / l_t


@njit(error_model="numpy")
def no_less_than_none(cells: int, volumes: Array, y: Array, born: int) -> None:
    """Bring the cells' amounts ``y[3 i]``, per volume as `volumes` counts it up to each face, back to 0 or more with their sum kept: what
    is missing is taken from all in proportion to what they have. Where none are left, what is missing beyond them are deaths that are
    undone in their integral ``y[born]``, so the balance holds."""
    missing = present = 0.0
    for i in range(cells):
        amount = y[STRIDE * i] * (volumes[i + 1] - volumes[i])
        if amount < 0.0:
            missing -= amount
        else:
            present += amount
    if missing == 0.0:
        return
    share = 1.0 - missing / present if present > missing else 0.0
    if missing > present:
        y[born] += missing - present
    for i in range(cells):
        y[STRIDE * i] = max(y[STRIDE * i], 0.0) * share


@njit(error_model="numpy")
def _face(y: Array, f: int) -> float:
    """v on face f."""
    return y[STRIDE * (f - 1) + 2] if f > 0 else 0.0


@njit(error_model="numpy")
def _contact_slope(d: Data, alpha: float) -> float:
    """d(alpha Sigma)/dalpha, of cells in contact down to `Data.kink_band` below alpha_min."""
    at = max(alpha, d.alpha_min) if alpha > d.alpha_min - d.kink_band else alpha
    return law.contact_pressure_slope(at, d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)


@njit(error_model="numpy")
def _foresee(d: Data, ahead: Array, work: Array) -> None:
    """Take the contact of each cell for as stiff as it is now or will be at `ahead`, whichever is more: an iteration with one tangent
    (`multiphase.radau`) diverges in stiff cells that it takes for slack, and merely slows down in the opposite case."""
    for i in range(d.cells):
        J = (_face(ahead, i + 1) - _face(ahead, i)) / (d.V[i + 1] - d.V[i])
        alpha = ahead[STRIDE * i] / J
        if J > 0.0 and 0.0 < alpha < 1.0:
            work[_CONTACT_A, i] = max(work[_CONTACT_A, i], _contact_slope(d, min(alpha, max(work[_ALPHA, i], d.alpha_min))))


@njit(error_model="numpy")
def _prepare(d: Data, y: Array, work: Array, slopes: bool) -> None:
    """Radii, stretches, forces, contact pressure and resistance of the state `y`, and their slopes if asked for."""
    N, m, h = d.cells, d.m, d.R[1]
    radius, J, alpha = work[_RADIUS], work[_J], work[_ALPHA]
    for f in range(N + 1):
        radius[f] = radius_of(_face(y, f), m)
    for f in range(N + 1):
        work[_AREA, f] = area_of(radius[f], m)
    for i in range(N):
        work[_RHO, i] = 0.5 * (radius[i] + radius[i + 1])
        J[i] = (_face(y, i + 1) - _face(y, i)) / (d.V[i + 1] - d.V[i])
        alpha[i] = y[STRIDE * i] / J[i]
    for f in range(1, N):
        work[_GAP, f] = work[_RHO, f] - work[_RHO, f - 1]
    work[_GAP, 0], work[_GAP, N] = 1.0, radius[N] - work[_RHO, N - 1]
    for i in range(N):
        work[_CONTACT, i] = law.contact_pressure(alpha[i], d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)
        work[_ZETA, i] = law.resistance(law.floored(alpha[i], FLOOR), d.kappa, d.law, d.floor)
    if slopes:
        for i in range(N):
            work[_CONTACT_A, i] = _contact_slope(d, alpha[i])
            slope = law.resistance_slope(law.floored(alpha[i], FLOOR), d.kappa, d.law, d.floor)
            work[_ZETA_A, i] = slope * law.floored_slope(alpha[i], FLOOR)
    for i in range(N):
        volume, l_r = d.V[i + 1] - d.V[i], (radius[i + 1] - radius[i]) / h
        l_t, by_m, by_p, by_mm, by_mp, by_pp = hoop_stretch(radius[i], radius[i + 1], d.R[i], d.R[i + 1], m)
        P_r, P_t = law.elastic_stress(l_r, l_t, m, d.mu, d.lam)
        P_t *= m - 1
        work[_FORCE_M, i], work[_FORCE_P, i] = volume * (P_t * by_m - P_r / h), volume * (P_t * by_p + P_r / h)
        if slopes:
            rr, rt, _, tt = law.elastic_stress_slopes(l_r, l_t, m, d.mu, d.lam)
            rr, rt, tt = rr / (h * h), rt / h, (m - 1) * tt
            work[_MM, i] = volume * (rr - 2.0 * rt * by_m + tt * by_m * by_m + P_t * by_mm)
            work[_PP, i] = volume * (rr + 2.0 * rt * by_p + tt * by_p * by_p + P_t * by_pp)
            work[_MP, i] = volume * (-rr + rt * (by_m - by_p) + tt * by_m * by_p + P_t * by_mp)


@njit(error_model="numpy")
def load_step(d: Data, work: Array, f: int) -> float:
    """Delta T over face f, 1 <= f <= N, T = p + alpha Sigma, that balances the elastic forces; beyond the surface T is 0."""
    force = work[_FORCE_P, f - 1] + (work[_FORCE_M, f] if f < d.cells else 0.0)
    return -force / work[_AREA, f]


@njit(error_model="numpy")
def pressure_step(d: Data, work: Array, f: int) -> float:
    """Delta p over face f, 1 <= f <= N: from cell f - 1 to the next one, or to the surface."""
    step = load_step(d, work, f) + work[_CONTACT, f - 1]
    return step + d.p_out if f == d.cells else step - work[_CONTACT, f]


@njit(error_model="numpy")
def flow_step(d: Data, work: Array, f: int, rate: float) -> float:
    """Delta p over face f that drives the face's ``dv/dt = rate``."""
    return _resistance_of_face(d, work, f) * work[_GAP, f] * rate / work[_AREA, f]


@njit(error_model="numpy")
def _resistance_of_face(d: Data, work: Array, f: int) -> float:
    return work[_ZETA, f - 1] if f == d.cells else 0.5 * (work[_ZETA, f - 1] + work[_ZETA, f])


@njit(error_model="numpy")
def _oxygen(d: Data, y: Array, f: int) -> float:
    """C in cell f; the surface's is C_out."""
    return y[STRIDE * f + 1] if f < d.cells else d.C_out


@njit(error_model="numpy")
def rates(d: Data, t: float, y: Array, out: Array, work: Array) -> None:
    """``M dy/dt``: rates of the balances, residuals of the algebraic rows.

    Parameters
    ----------
    d : Data
    t : float
    y, out : (3 cells + INTEGRALS,) array
    work : (WORK_ROWS, cells + 1) array
    """
    N = d.cells
    _prepare(d, y, work, False)
    born = 0.0
    inner = 0.0
    for i in range(N):
        J, alpha, C = work[_J, i], work[_ALPHA, i], y[STRIDE * i + 1]
        source = J * law.net_growth(alpha, C, d.s1, d.s2, d.s3, d.s4)
        born += source * (d.V[i + 1] - d.V[i])
        if d.as_printed:
            source -= d.rate * (J - d.old[1, i]) * (alpha - d.old[0, i])
        outer = work[_AREA, i + 1] * (_oxygen(d, y, i + 1) - C) / work[_GAP, i + 1]
        taken = (d.V[i + 1] - d.V[i]) * J * law.oxygen_uptake(alpha, C, d.Q, d.Q1_hat)
        out[STRIDE * i] = source
        out[STRIDE * i + 1] = outer - inner - taken
        inner = outer
        step = work[_AREA, i + 1] * pressure_step(d, work, i + 1)
        if d.kappa > 0.0:
            step /= _resistance_of_face(d, work, i + 1) * work[_GAP, i + 1]
        out[STRIDE * i + 2] = step
    out[STRIDE * N] = born


@njit(error_model="numpy")
def tangent(
    d: Data, t: float, y: Array, f_0: Array, jac: Array, columns: Array, rows: Array, corner: Array, q_rows: Array, q_corner: Array,
    work: Array, scratch: Array,
) -> None:  # fmt: skip
    """Derivatives of `rates` at `y`: ``jac[i, j - i + HALF]`` (3 cells, 2 HALF + 1), and that of the integrand, `q_rows` (1, 3 cells).

    At the kink of the contact stress the derivative to the right. With a `Data.kink_band`, `scratch` holds where the step is expected to
    end: see `_foresee`. The border is empty.
    """
    N = d.cells
    _prepare(d, y, work, True)
    if d.kink_band > 0.0:
        _foresee(d, scratch, work)
    jac[:, :] = 0.0
    q_rows[:, :] = 0.0
    for i in range(N):
        volume, J, alpha, C = d.V[i + 1] - d.V[i], work[_J, i], work[_ALPHA, i], y[STRIDE * i + 1]
        q = law.net_growth(alpha, C, d.s1, d.s2, d.s3, d.s4)
        q_a, q_C = law.net_growth_slopes(alpha, C, d.s1, d.s2, d.s3, d.s4)
        u = law.oxygen_uptake(alpha, C, d.Q, d.Q1_hat)
        u_a, u_C = law.oxygen_uptake_slopes(alpha, C, d.Q, d.Q1_hat)
        row = STRIDE * i
        # by phi and J at fixed C: alpha = phi/J, so d alpha = d phi/J - alpha dJ/J
        by_phi, by_J = q_a, q - alpha * q_a
        q_rows[0, row] += volume * by_phi
        q_rows[0, row + 1] += volume * J * q_C
        q_rows[0, row + 2] += by_J
        if i > 0:
            q_rows[0, row - 1] -= by_J
        if d.as_printed:
            grown, moved = J - d.old[1, i], alpha - d.old[0, i]
            by_phi -= d.rate * grown / J
            by_J -= d.rate * (moved - grown * alpha / J)
        jac[row, HALF] += by_phi
        jac[row, HALF + 1] += J * q_C
        jac[row, HALF + 2] += by_J / volume
        if i > 0:
            jac[row, HALF - 1] -= by_J / volume
        row += 1
        jac[row, HALF - 1] -= volume * u_a
        jac[row, HALF] -= volume * J * u_C
        jac[row, HALF + 1] -= u - alpha * u_a
        if i > 0:
            jac[row, HALF - 2] += u - alpha * u_a
    for f in range(1, N + 1):
        _face_tangent(d, y, jac, work, f)


@njit(error_model="numpy")
def _face_tangent(d: Data, y: Array, jac: Array, work: Array, f: int) -> None:
    """Derivatives of the oxygen flux through face f and of the row of v_f."""
    N, m = d.cells, d.m
    r, area, gap = work[_RADIUS, f], work[_AREA, f], work[_GAP, f]
    area_r = 0.0 if m == 1 else 1.0 if m == 2 else 2.0 * r
    # oxygen: the flux leaves cell f - 1 and enters cell f with the opposite sign
    step = _oxygen(d, y, f) - y[STRIDE * (f - 1) + 1]
    flux = area * step / gap
    left = STRIDE * (f - 1) + 1
    right = left + STRIDE
    jac[left, HALF] -= area / gap
    if f < N:
        jac[left, HALF + STRIDE] += area / gap
        jac[right, HALF - STRIDE] += area / gap
        jac[right, HALF] -= area / gap
    # pressure
    row = STRIDE * (f - 1) + 2
    difference = pressure_step(d, work, f)
    zeta = _resistance_of_face(d, work, f)
    force = work[_FORCE_P, f - 1] + (work[_FORCE_M, f] if f < N else 0.0)
    weight = area / (zeta * gap) if d.kappa > 0.0 else area  # the row is weight times the difference of p
    for k in range(-1, 2):
        g = f + k
        if g < 1 or g > N:
            continue
        per_v = 1.0 / work[_AREA, g]  # dr/dv
        gap_r = 0.5 * k if f < N else (0.5 if k == 0 else -0.5)
        flux_r = -flux / gap * gap_r + (area_r * step / gap if k == 0 else 0.0)
        column = STRIDE * (g - 1) + 2
        jac[left, column - left + HALF] += flux_r * per_v
        if f < N:
            jac[right, column - right + HALF] -= flux_r * per_v
        if k == -1:
            force_r = work[_MP, f - 1]
        elif k == 0:
            force_r = work[_PP, f - 1] + (work[_MM, f] if f < N else 0.0)
        else:
            force_r = work[_MP, f]
        step_r = -force_r / area + (force * area_r / (area * area) if k == 0 else 0.0)
        row_r = weight * step_r
        if k == 0:
            row_r += weight * difference * area_r / area
        if d.kappa > 0.0:
            row_r -= weight * difference * gap_r / gap
        jac[row, column - row + HALF] += row_r * per_v
    # fractions: alpha = phi/J of both cells, through the contact pressure and the resistance
    share = 1.0 if f == N else 0.5
    for i in (f - 1, f):
        if i == N:
            continue
        J, alpha, volume = work[_J, i], work[_ALPHA, i], d.V[i + 1] - d.V[i]
        by_alpha = weight * work[_CONTACT_A, i] * (1.0 if i == f - 1 else -1.0)
        if d.kappa > 0.0:
            by_alpha -= weight * difference / zeta * share * work[_ZETA_A, i]
        jac[row, STRIDE * i - row + HALF] += by_alpha / J
        by_v = -by_alpha * alpha / (J * volume)
        jac[row, STRIDE * i + 2 - row + HALF] += by_v
        if i > 0:
            jac[row, STRIDE * (i - 1) + 2 - row + HALF] -= by_v


@njit(error_model="numpy")
def size_of(d: Data, y: Array, e: Array) -> float:
    """The larger of: root mean square error of alpha, and largest error of r over the radius of the body; in units of rtol."""
    N, m = d.cells, d.m
    square = largest = 0.0
    inner = e_inner = 0.0
    for i in range(N):
        outer, e_outer = y[STRIDE * i + 2], e[STRIDE * i + 2]
        volume = d.V[i + 1] - d.V[i]
        J, e_J = (outer - inner) / volume, (e_outer - e_inner) / volume
        change = (e[STRIDE * i] - y[STRIDE * i] / J * e_J) / J
        square += change * change
        largest = max(largest, abs(e_outer) / area_of(radius_of(abs(outer), m), m))
        inner, e_inner = outer, e_outer
    return max(np.sqrt(square / N), largest / radius_of(abs(inner), m)) / d.rtol


@njit(error_model="numpy")
def admit(d: Data, y: Array, work: Array) -> int:
    """Refuses a step after which a cell is turned inside out (1), alpha has left (0, 1) (2), C is negative by more than rtol (3), or a
    cell is swollen beyond all measure (4); 0 otherwise."""
    inner = 0.0
    for i in range(d.cells):
        outer, phi = y[STRIDE * i + 2], y[STRIDE * i]
        J = (outer - inner) / (d.V[i + 1] - d.V[i])
        if not J > 0.0:
            return 1
        if J > MOST_SWOLLEN:
            return 4
        if not (phi > 0.0 and phi < J):
            return 2
        if not y[STRIDE * i + 1] > -d.rtol * max(1.0, d.C_out):
            return 3
        inner = outer
    return 0


@njit(error_model="numpy")
def reach(d: Data, y: Array, change: Array) -> float:
    """Share of a Newton change that keeps J > 0 and 0 < alpha < 1; 0 if `y` itself does not."""
    share = 1.0
    inner = c_inner = 0.0
    for i in range(d.cells):
        outer, c_outer = y[STRIDE * i + 2], change[STRIDE * i + 2]
        volume = d.V[i + 1] - d.V[i]
        J, c_J = (outer - inner) / volume, (c_outer - c_inner) / volume
        phi, c_phi = y[STRIDE * i], change[STRIDE * i]
        for value, moved in ((J, c_J), (phi, c_phi), (J - phi, c_J - c_phi)):
            if not value > 0.0:
                return 0.0
            if value + share * moved < LEAST_SHARE * value:
                share = (1.0 - LEAST_SHARE) * value / -moved
        inner, c_inner = outer, c_outer
    return share


@njit(error_model="numpy")
def _algebraic_change(d: Data, f: Array, jac: Array, change: Array) -> bool:
    """Newton's change of the algebraic unknowns, C and for kappa = 0 also v, the others kept; False where the equations are singular."""
    N = d.cells
    kinds = 1 if d.kappa > 0.0 else 2
    narrow = 1 if kinds == 1 else 3
    band = np.zeros((kinds * N, 3 * narrow + 1))
    right = np.empty(kinds * N)
    pivots = np.empty((2, kinds * N), dtype=np.int64)
    for i in range(N):
        for p in range(kinds):
            row, here = STRIDE * i + 1 + p, kinds * i + p
            right[here] = -f[row]
            for j in range(max(i - 2, 0), min(i + 1, N - 1) + 1):
                for q in range(kinds):
                    there, column = kinds * j + q, STRIDE * j + 1 + q
                    if abs(there - here) <= narrow and abs(column - row) <= HALF:
                        band[here, there - here + narrow] = jac[row, column - row + HALF]
    if not _factor(band, narrow, pivots):
        return False
    _solve(band, narrow, pivots, right)
    change[:] = 0.0
    for i in range(N):
        for p in range(kinds):
            change[STRIDE * i + 1 + p] = right[kinds * i + p]
    return True


@njit(error_model="numpy")
def _take(d: Data, y: Array, change: Array) -> float:
    """Add Newton's change of the algebraic unknowns, which says how large the largest is, over the largest of them."""
    moved = largest = 0.0
    for k in range(STRIDE * d.cells):
        y[k] += change[k]
        if k % STRIDE > 0:
            moved, largest = max(moved, abs(change[k])), max(largest, abs(y[k]))
    return moved / largest


@njit(error_model="numpy")
def project(d: Data, y: Array, f: Array, jac: Array) -> bool:
    """Bring the algebraic unknowns of `y` onto their equations by one iteration with the rates `f` and the tangent `jac` there; True if
    they were so far off that both must be evaluated anew. False, too, where the equations are singular: Newton's method will say so.

    For kappa = 0 positions are algebraic and take as many iterations as the kink of the contact stress wants: what is left of their
    residual would neither fall with the step nor let the stages converge.
    """
    N = d.cells
    change = np.empty(y.size)
    if not _algebraic_change(d, f, jac, change) or reach(d, y, change) < 1.0:
        return False
    moved = _take(d, y, change)
    for k in range(STRIDE * N):  # what was just removed must not be seen by the estimate of the local error
        if k % STRIDE == 1 or (k % STRIDE == 2 and d.kappa == 0.0):
            f[k] = 0.0
    if d.kappa > 0.0 or moved <= 1e-2 * d.rtol:
        return moved > 1e-3
    g, slopes, q_rows = np.empty(y.size), np.empty(jac.shape), np.empty((INTEGRALS, STRIDE * N))
    none, work = np.empty((0, STRIDE * N)), np.empty((WORK_ROWS, N + 1))
    for _ in range(20):
        rates(d, 0.0, y, g, work)
        tangent(d, 0.0, y, g, slopes, none, none, np.empty((0, 0)), q_rows, np.empty((INTEGRALS, 0)), work, y)
        if not _algebraic_change(d, g, slopes, change) or reach(d, y, change) < 1.0 or _take(d, y, change) <= 1e-2 * d.rtol:
            break
    return True


@njit(error_model="numpy")
def settle(d: Data, t: float, y: Array, w: Any) -> None:
    """Bring the algebraic part of `y` onto its equations by Newton's method; `w` is the work space of `multiphase.radau`."""
    change = np.empty(y.size)
    for _ in range(100):
        rates(d, t, y, w.f_0, w.model)
        tangent(d, t, y, w.f_0, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, y)
        if not _algebraic_change(d, w.f_0, w.jac, change):
            return
        share = reach(d, y, change)
        moved = largest = 0.0
        for k in range(STRIDE * d.cells):
            y[k] += share * change[k]
            if k % STRIDE > 0:
                moved, largest = max(moved, abs(change[k])), max(largest, abs(y[k]))
        if share == 0.0 or moved <= 1e-14 * largest:
            return
