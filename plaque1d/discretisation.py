r"""Finite volumes of second order for the plaque, compiled: rates of change and their tangent, slab and annulus, both momentum forms.

Unknowns, cell by cell: ``W n_i, W l_i, w_{i+1}`` (slip on the outer face of the cell) and, for drag in the annulus, the stress
``S_{i+1}`` there; then W and V, and three integrals over time. W is the size of the body per unit length of endothelium in the
slab (W = L) and per radian in the annulus (W = (R_2^2 - R_1^2)/2), in which equal cells are equal in area, r is the radius and
V = dW/dt. The slab is the annulus with r = R_1 = 1 on every face and s = 0 below. With h = 1/N, face f between cells f - 1 and f,

    d(W n_i)/dt = -(F_{i+1} - F_i)/h + k_m W l_i c_i,         F_0 = F_N = 0                              (3.10a)
    d(W l_i)/dt = -(G_{i+1} - G_i)/h - k_l W l_i c_i,         G_0 = R_1 Psi_l, G_N = 0                   (3.10b)
    dW/dt = V,      0 = V - R_1 Psi_m l_wall                                                             (3.9)
    F = v (n_L + n_R)/2 - s (n_R - n_L)/2,                    v = V - r c_f w - xi V,  c_f = (c_{f-1} + c_f)/2
    G = (1 - xi) V (l_{f-1} + l_f)/2 - max(r^2/(h W), |(1 - xi) V|/2) (l_f - l_{f-1})

n_L, n_R come from slopes limited by monotonised central differences, but for smooth extrema (`multiphase.transport`); the inner cell
takes the slope of the parabola with n_xi = 0 (or n = g) at the wall. The velocity takes c as the slip equation does: u_n is O(x) at
the inner wall, so an O(h^2) mismatch there would be an O(h) error of dn/dt.
``s = max(|v|, |v + r n w nu_m/nu|)`` damps the short waves of n, which do not travel with v.

The slip rows are those of `plaque1d.slip`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from multiphase import transport
from multiphase.banded import factor as _factor
from multiphase.banded import solve as _solve
from multiphase.compiled import compiled
from plaque1d import laws as law
from plaque1d import slip as slip_rows
from plaque1d.layout import (
    AHEAD,
    BACK,
    BORDER,
    CC,
    CF,
    CF_N,
    FACE,
    HERE,
    INTEGRALS,
    L_ROW,
    N_ROW,
    NC,
    NF,
    NF_N,
    RADIUS,
    SLOPE,
    STRESS,
    Data,
    influx,
)

Array = Any


def upwinded(diffusive: Any, velocity: Any) -> Any:
    """Coefficient of the difference over a face that keeps a central flux from overshooting: at least half the velocity."""
    return np.maximum(diffusive, 0.5 * np.abs(velocity))


_upwinded = compiled(upwinded)


@njit(error_model="numpy")
def _inner_slope(d: Data, n_0: float, n_1: float) -> tuple[float, float, float]:
    """Slope in the cell at the endothelium and its derivatives with respect to n_0 and n_1: the parabola with n_x = 0 at the wall, or
    through the given value, limited."""
    if np.isnan(d.n_wall):
        return transport.symmetric_slope(n_0, n_1)
    inner, ahead = 2.0 * (n_0 - d.n_wall), n_1 - n_0
    parabola = 1.25 * n_0 - 1.5 * d.n_wall + 0.25 * n_1
    if inner * ahead <= 0.0:
        slope, own, other = 0.0, 0.0, 0.0
    elif abs(parabola) <= 2.0 * abs(inner) and abs(parabola) <= 2.0 * abs(ahead):
        slope, own, other = parabola, 1.25, 0.25
    elif abs(inner) <= abs(ahead):
        slope, own, other = 2.0 * inner, 4.0, 0.0
    else:
        slope, own, other = 2.0 * ahead, -2.0, 2.0
    return transport.end_slope(slope, own, other, n_0 if slope > 0.0 else n_0 - 1.0)


@njit(error_model="numpy")
def _damping(d: Data, v: float, n_f: float, slip: float, nu_n: float, nu_m: float) -> tuple[float, float, float, float]:
    """``s = max(|v|, |short-wave velocity|)`` on a face, and its derivatives with respect to n_f, the slip, and v."""
    n_s = min(max(n_f, d.floor), 1.0 - d.floor)  # keeps the mean viscosity above 0 where the only viscous phase is absent
    wave = law.short_wave_velocity(v, n_s, slip, nu_n, nu_m)
    if abs(wave) > abs(v):
        excess_n, excess_w = law.short_wave_excess_slopes(n_s, slip, nu_n, nu_m)
        if n_s != n_f:
            excess_n = 0.0
        sign = 1.0 if wave >= 0.0 else -1.0
        return abs(wave), sign * (slip + excess_n), sign * (n_f - 1.0 + excess_w), sign
    sign = 1.0 if v >= 0.0 else -1.0
    return abs(v), sign * slip, sign * (n_f - 1.0), sign


@njit(error_model="numpy")
def _prepare(d: Data, y: Array, work: Array) -> None:
    """Fractions, stress, slopes, radii and floored fractions of the state `y`; one loop each, as the compiler vectorises those."""
    N, m = d.cells, d.stride
    W = y[m * N]
    n, l, face = work[N_ROW], work[L_ROW], work[FACE]
    inverse = 1.0 / W
    for i in range(N):
        n[i], l[i] = inverse * y[m * i], inverse * y[m * i + 1]
    for i in range(N):
        work[STRESS, i] = law.extra_stress(l[i], d.A, d.B, d.k)
    for i in range(N):
        work[NC, i], work[CC, i] = law.floored(n[i], d.floor), law.floored(1.0 - n[i], d.floor)
    work[SLOPE, 0] = _inner_slope(d, n[0], n[1])[0]
    for i in range(1, N - 1):
        work[SLOPE, i] = transport.slope(n[i] - n[i - 1], n[i + 1] - n[i], n[i], 1.0 / N)[0]
    work[SLOPE, N - 1] = transport.open_slope(n[N - 1], n[N - 2])[0]
    face[0], face[N] = n[0] if np.isnan(d.n_wall) else d.n_wall, n[N - 1]
    for f in range(1, N):
        face[f] = 0.5 * (n[f - 1] + n[f])
    for f in range(N + 1):
        work[NF, f], work[CF, f] = law.floored(face[f], d.floor), law.floored(1.0 - face[f], d.floor)
    for f in range(N + 1):
        work[RADIUS, f] = np.sqrt(d.inner_radius * d.inner_radius + 2.0 * W * f / N) if d.annulus else 1.0


@njit(error_model="numpy")
def _n_flux(d: Data, y: Array, work: Array, f: int) -> tuple[float, float]:
    """Flux F of n through face f, and its velocity v."""
    n, V = work[N_ROW], y[d.stride * d.cells + 1]
    n_f, slip = 0.5 * (n[f - 1] + n[f]), work[RADIUS, f] * y[d.stride * (f - 1) + 2]
    left, right = n[f - 1] + 0.5 * work[SLOPE, f - 1], n[f] - 0.5 * work[SLOPE, f]
    v = law.relative_velocity(law.necrotic_velocity(V, n_f, slip), f / d.cells, V)
    s = _damping(d, v, n_f, slip, law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m))[0]
    return 0.5 * v * (left + right) - 0.5 * s * (right - left), v


@njit(error_model="numpy")
def _l_transport(d: Data, W: float, V: float, r: float, xi: float) -> tuple[float, float]:
    """Velocity of l through a face, and the coefficient of the difference over it: central, upwind where a cell is too long for that."""
    velocity = law.relative_velocity(V, xi, V)
    return velocity, _upwinded(r * r * d.cells / W, velocity)


@njit(error_model="numpy")
def face_values(d: Data, y: Array, out: Array, work: Array) -> None:
    """On the interior faces: flux of n, its velocity, velocity of l, conductance of l; `out` (4, N + 1), zero at both ends."""
    N, m = d.cells, d.stride
    _prepare(d, y, work)
    out[:, :] = 0.0
    for f in range(1, N):
        out[0, f], out[1, f] = _n_flux(d, y, work, f)
        out[2, f], out[3, f] = _l_transport(d, y[m * N], y[m * N + 1], work[RADIUS, f], f / N)


@njit(error_model="numpy")
def rates(d: Data, t: float, y: Array, out: Array, work: Array) -> None:
    """``M dy/dt``: rates of the balances, residuals of the algebraic rows.

    Parameters
    ----------
    d : Data
    t : float
    y, out : (stride cells + BORDER + INTEGRALS,) array
    work : (WORK_ROWS, cells + 1) array
    """
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    _prepare(d, y, work)
    n, l, radius = work[N_ROW], work[L_ROW], work[RADIUS]
    Psi_l = influx(d, t)
    total = 0.0
    for i in range(N):
        rate = law.uptake(l[i], n[i])
        total += rate
        out[m * i], out[m * i + 1] = d.k_m * W * rate, -d.k_l * W * rate
    out[1] += d.inner_radius * Psi_l / h
    for f in range(1, N):
        flux = _n_flux(d, y, work, f)[0] / h
        out[m * (f - 1)] -= flux
        out[m * f] += flux
        velocity, conductance = _l_transport(d, W, V, radius[f], f * h)
        flux = (0.5 * velocity * (l[f - 1] + l[f]) - conductance * (l[f] - l[f - 1])) / h
        out[m * (f - 1) + 1] -= flux
        out[m * f + 1] += flux
    if d.drag:
        slip_rows.drag_rows(d, y, out, work)
    else:
        slip_rows.interfacial_rows(d, y, out, work)
    out[m * (N - 1) + 2] = y[m * (N - 1) + 2]
    l_wall = law.wall_concentration(l[0], 0.5 * h * W / d.inner_radius, Psi_l, d.Psi_m)
    out[m * N] = V
    out[m * N + 1] = V - d.inner_radius * law.growth_rate(l_wall, d.Psi_m)
    out[m * N + 2], out[m * N + 3], out[m * N + 4] = h * W * total, d.inner_radius * Psi_l, V


@njit(error_model="numpy")
def tangent(
    d: Data, t: float, y: Array, f_0: Array, jac: Array, columns: Array, rows: Array, corner: Array, q_rows: Array, q_corner: Array,
    work: Array, scratch: Array,
) -> None:  # fmt: skip
    """Derivatives of `rates` at `y`, where it is `f_0`: the band exactly, the two columns of W and V by differences.

    Parameters
    ----------
    jac : (stride cells, 4 stride + 1) array
        Band of half-width 2 stride, ``jac[i, j - i + 2 stride]``.
    columns : (BORDER, stride cells) array
        Derivatives of the cell rows with respect to W and V.
    rows : (BORDER, stride cells) array
        Derivatives of the rows of W and V with respect to the cell unknowns.
    corner : (BORDER, BORDER) array
    q_rows, q_corner : (INTEGRALS, stride cells), (INTEGRALS, BORDER) array
        Derivatives of the integrands.
    work, scratch : arrays
        Work space of `rates`, and one vector like y.
    """
    N, m = d.cells, d.stride
    h, W = 1.0 / N, y[m * N]
    half, size = 2 * m, m * N
    for index in range(BORDER):
        kept = y[size + index]
        step = 1e-7 * kept if index == 0 else 1e-4 * abs(kept) + 1e-8 * d.inner_radius * (d.Psi_m * d.l_reference + 1e-6)
        y[size + index] = kept + step
        step = y[size + index] - kept
        rates(d, t, y, scratch, work)
        y[size + index] = kept
        for i in range(size):
            columns[index, i] = (scratch[i] - f_0[i]) / step
        for i in range(BORDER):
            corner[i, index] = (scratch[size + i] - f_0[size + i]) / step
        for i in range(INTEGRALS):
            q_corner[i, index] = (scratch[size + BORDER + i] - f_0[size + BORDER + i]) / step
    _prepare(d, y, work)
    jac[:, :] = 0.0
    rows[:, :] = 0.0
    q_rows[:, :] = 0.0
    n, l = work[N_ROW], work[L_ROW]
    for i in range(N):
        jac[m * i, half] -= d.k_m * l[i]
        jac[m * i, half + 1] += d.k_m * (1.0 - n[i])
        jac[m * i + 1, half - 1] += d.k_l * l[i]
        jac[m * i + 1, half] -= d.k_l * (1.0 - n[i])
        q_rows[0, m * i], q_rows[0, m * i + 1] = -h * l[i], h * (1.0 - n[i])
    _transport_tangent(d, y, jac, work)
    for f in range(N):
        fraction = 0.5 * (n[max(f - 1, 0)] + n[f])
        slope = 1.0
        if f == 0 and not np.isnan(d.n_wall):
            slope = 0.0
        work[NF_N, f], work[CF_N, f] = slope * law.floored_slope(fraction, d.floor), -slope * law.floored_slope(1.0 - fraction, d.floor)
    if d.drag:
        slip_rows.drag_tangent(d, y, jac, work)
    else:
        slip_rows.interfacial_tangent(d, y, jac, work)
    jac[m * (N - 1) + 2, :] = 0.0
    jac[m * (N - 1) + 2, half] = 1.0
    inner, _ = law.wall_concentration_slopes(l[0], 0.5 * h * W / d.inner_radius, influx(d, t), d.Psi_m)
    rows[1, 1] = -d.inner_radius * law.growth_rate(inner, d.Psi_m) / W


@njit(error_model="numpy")
def _transport_tangent(d: Data, y: Array, jac: Array, work: Array) -> None:
    """Derivatives of the fluxes of n and l with respect to n, l and w."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    half = 2 * m
    n, radius = work[N_ROW], work[RADIUS]
    for i in range(N):
        if i == 0:
            _, here, ahead = _inner_slope(d, n[0], n[1])
            work[BACK, 0], work[HERE, 0], work[AHEAD, 0] = 0.0, here, ahead
        elif i == N - 1:
            _, here, back = transport.open_slope(n[i], n[i - 1])
            work[BACK, i], work[HERE, i], work[AHEAD, i] = back, here, 0.0
        else:
            _, back, here, ahead = transport.slope(n[i] - n[i - 1], n[i + 1] - n[i], n[i], h)
            work[BACK, i], work[HERE, i], work[AHEAD, i] = back, here, ahead
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    for f in range(1, N):
        xi, r, i, j = f * h, radius[f], f - 1, f
        n_f, slip = 0.5 * (n[i] + n[j]), r * y[m * i + 2]
        left, right = n[i] + 0.5 * work[SLOPE, i], n[j] - 0.5 * work[SLOPE, j]
        v = law.relative_velocity(law.necrotic_velocity(V, n_f, slip), xi, V)
        s, s_n, s_w, _ = _damping(d, v, n_f, slip, nu_n, nu_m)
        mean, jump = 0.5 * (left + right), right - left
        from_left, from_right = 0.5 * (v + s), 0.5 * (v - s)
        through = 0.5 * (mean * slip - 0.5 * jump * s_n)
        weights = (
            from_left * 0.5 * work[BACK, i],
            from_left * (1.0 + 0.5 * work[HERE, i]) - from_right * 0.5 * work[BACK, j] + through,
            from_left * 0.5 * work[AHEAD, i] + from_right * (1.0 - 0.5 * work[HERE, j]) + through,
            -from_right * 0.5 * work[AHEAD, j],
        )
        row_i, row_j = m * i, m * j
        for k in range(4):
            cell = f - 2 + k
            if 0 <= cell < N:
                value = weights[k] / (h * W)
                jac[row_i, m * cell - row_i + half] -= value
                jac[row_j, m * cell - row_j + half] += value
        value = (mean * (n_f - 1.0) - 0.5 * jump * s_w) * r / h
        jac[row_i, 2 + half] -= value
        jac[row_j, m * i + 2 - row_j + half] += value
        velocity, conductance = _l_transport(d, W, V, r, xi)
        row_i, row_j = m * i + 1, m * j + 1
        for cell, value in ((i, (0.5 * velocity + conductance) / (h * W)), (j, (0.5 * velocity - conductance) / (h * W))):
            jac[row_i, m * cell + 1 - row_i + half] -= value
            jac[row_j, m * cell + 1 - row_j + half] += value


@njit(error_model="numpy")
def size_of(d: Data, y: Array, e: Array) -> float:
    """The largest of: root mean square error of n, of l over its scale, and the relative error of W; in units of rtol."""
    N, m = d.cells, d.stride
    W, e_W = y[m * N], e[m * N]
    square_n = square_l = largest = 0.0
    for i in range(N):
        n, l = y[m * i] / W, y[m * i + 1] / W
        d_n, d_l = (e[m * i] - n * e_W) / W, (e[m * i + 1] - l * e_W) / W
        square_n += d_n * d_n
        square_l += d_l * d_l
        largest = max(largest, abs(l))
    scale = max(largest, 1e-3 * d.l_reference)
    return max(abs(e_W) / W, np.sqrt(square_n / N), np.sqrt(square_l / N) / scale) / d.rtol


@njit(error_model="numpy")
def bounded(d: Data, y: Array) -> None:
    """Bring n back into [0, 1] with its sum kept: what lies outside is taken from, or given to, all cells in proportion to what they
    have, or have room for. Where no macrophages are left, what is beyond them died by an uptake that is undone, so all balances hold."""
    N, m = d.cells, d.stride
    W = y[m * N]
    excess = give = take = 0.0
    outside = False
    for i in range(N):
        amount = y[m * i]
        inside = min(max(amount, 0.0), W)
        outside = outside or inside != amount
        excess += amount - inside
        give += inside
        take += W - inside
    if not outside:
        return
    whole = max(give if excess < 0.0 else take, abs(excess))
    share = excess / whole if whole > 0.0 else 0.0
    beyond = excess - take
    for i in range(N):
        inside = min(max(y[m * i], 0.0), W)
        room = inside if excess < 0.0 else W - inside
        y[m * i] = min(max(inside + room * share, 0.0), W)
        if beyond > 0.0 and d.k_m > 0.0:
            y[m * i + 1] += d.k_l / d.k_m * beyond / N
    if beyond > 0.0 and d.k_m > 0.0:
        y[m * N + BORDER] -= beyond / (N * d.k_m)


@njit(error_model="numpy")
def admit(d: Data, y: Array, work: Array) -> int:
    """Bring n back into [0, 1] with its sum kept. Refuses a step after which n (1) or l (2) has left its range by more than rtol, W is not
    positive (3), or the drag form is ill-posed for want of any viscosity (4); 0 otherwise."""
    N, m = d.cells, d.stride
    W = y[m * N]
    if not W > 0.0:
        return 3
    largest = lowest = 0.0
    for i in range(N):
        amount, l = y[m * i], y[m * i + 1] / W
        if amount < -d.rtol * W or amount > (1.0 + d.rtol) * W:
            return 1
        largest, lowest = max(largest, abs(l)), min(lowest, l)
    if lowest < -d.rtol * max(largest, 1e-3 * d.l_reference):
        return 2
    bounded(d, y)
    if d.drag and law.viscosity(d.mu_n, d.lambda_n) == 0.0 and law.viscosity(d.mu_m, d.lambda_m) == 0.0:
        for i in range(N):
            if law.drag_diffusivity(y[m * i] / W, law.extra_stress(y[m * i + 1] / W, d.A, d.B, d.k), d.p_out) < 0.0:
                return 4
    return 0


@njit(error_model="numpy")
def project(d: Data, y: Array, f: Array, jac: Array) -> bool:
    """Bring w and S of `y` onto their equations, which are linear in them, with the rates `f` and the tangent `jac` there; True if they
    were so far off that both must be evaluated anew. False, too, where the equations are singular: Newton's method will say so."""
    N, m = d.cells, d.stride
    kinds, half = m - 2, 2 * m
    narrow = 2 * kinds - 1
    band = np.zeros((kinds * N, 3 * narrow + 1))
    change = np.empty(kinds * N)
    pivots = np.empty((2, kinds * N), dtype=np.int64)
    for i in range(N):
        for p in range(kinds):
            row, here = m * i + 2 + p, kinds * i + p
            change[here] = -f[row]
            for j in range(max(i - 1, 0), min(i + 1, N - 1) + 1):
                for q in range(kinds):
                    band[here, kinds * j + q - here + narrow] = jac[row, m * j + 2 + q - row + half]
    if not _factor(band, narrow, pivots):
        return False
    _solve(band, narrow, pivots, change)
    moved = largest = 0.0
    for i in range(N):
        for p in range(kinds):
            y[m * i + 2 + p] += change[kinds * i + p]
            f[m * i + 2 + p] = 0.0  # what was just removed must not be seen by the estimate of the local error
        moved, largest = max(moved, abs(change[kinds * i])), max(largest, abs(y[m * i + 2]))
    return moved > 1e-3 * largest


@njit(error_model="numpy")
def settle(d: Data, t: float, y: Array, w: Any) -> None:
    """Bring the algebraic part of `y` (V, w, S) onto its equations; `w` is the work space of `multiphase.radau`."""
    N, m = d.cells, d.stride
    size = m * N
    l_wall = law.wall_concentration(y[1] / y[size], 0.5 * y[size] / (N * d.inner_radius), influx(d, t), d.Psi_m)
    y[size + 1] = d.inner_radius * law.growth_rate(l_wall, d.Psi_m)
    for i in range(size):
        if i % m >= 2:
            y[i] = 0.0
    rates(d, t, y, w.f_0, w.model)
    tangent(d, t, y, w.f_0, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
    project(d, y, w.f_0, w.jac)


@njit(error_model="numpy")
def reach(d: Data, y: Array, change: Array) -> float:
    """Share of a Newton change that may be taken: all of it, or nothing where W would no longer be positive."""
    W = d.stride * d.cells
    return 1.0 if y[W] + change[W] > 0.0 else 0.0
