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

The slip rows are balances of force over the area between two cell centres, the difference of both momentum balances (3.8d,e) with the
pressure eliminated. In cell i with faces - and +, mean radius rm, strains ``e_r = a (v_+ - v_-)``, ``e_theta = s (v_+ + v_-)``,
``a = rm/(h W)``, ``s = 1/(2 rm)``, whose sum is exactly ``(r_+ v_+ - r_- v_-)/(h W)``:

    interfacial:  0 = n_f f[c, n w] + c_f f[n, c w] + h W b n_f c_f w + r n_f Delta(c Sigma) - 2 (mu_m n + mu_n c)_f (V/r) Delta n
                  f[phi, v] = d/dv_f of sum over cells of  h W phi ( nu (e_r^2 + e_theta^2)/2 + lambda e_r e_theta )
    drag:         0 = -r Delta(n c T) - (h W / r) mean(n c X) + h W b n_f c_f w - r S Delta n + r Delta(n c Sigma)
                      + 2 (mu_m - mu_n) (V/r) Delta(n c)
                  T = a (z_+ - z_-) + s (y_+ + y_-),  z = (nu_m n + nu_n c) w,  y = (lambda_m n + lambda_n c) w
                  X = 2 (a (m_+ - m_-) - s (m_+ + m_-)),  m = (mu_m n + mu_n c) w
                  0 = S_+ - S_- - (h W/rm) ( -4 (mu_n n + mu_m c) V/rm^3 + (2/rm) Y ),   S_N = p_out
                  Y = mu_m c (a (g_+ - g_-) - s (g_+ + g_-)) - mu_n n (the same with c w for g),  g = n w

``w_0 = V/(R_1 c(0))``, ``w_N = 0``; Delta is the difference over a face (terms with V/r and X, and S other than p_out, belong to the
annulus). Products of fractions in the slip rows are floored, which keeps them regular where a phase vanishes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from multiphase import transport
from multiphase.banded import factor as _factor
from multiphase.banded import solve as _solve
from multiphase.compiled import compiled
from plaque1d import laws as law

Array = Any

BORDER = 2
"""W and V."""
FLOOR = 1e-5
"""Floor of the fractions inside the slip equation; it changes w by a relative (FLOOR / fraction)^2."""

INTEGRALS = 3
"""Integrals over time of W times the mean uptake, of the influx of modLDL, and of V."""


class Data(NamedTuple):
    """What the kernels need of one scene: sizes, parameters, and Psi_l(t) = influx + influx_rate (t - t_0) between two breaks."""

    cells: int
    stride: int
    annulus: bool
    drag: bool
    inner_radius: float
    influx: float
    influx_rate: float
    t_0: float
    Psi_m: float
    k_l: float
    k_m: float
    b: float
    mu_n: float
    lambda_n: float
    mu_m: float
    lambda_m: float
    A: float
    B: float
    k: float
    p_out: float
    n_wall: float
    rtol: float
    l_reference: float
    floor: float


def upwinded(diffusive: Any, velocity: Any) -> Any:
    """Coefficient of the difference over a face that keeps a central flux from overshooting: at least half the velocity."""
    return np.maximum(diffusive, 0.5 * np.abs(velocity))


_upwinded = compiled(upwinded)


@njit(error_model="numpy")
def influx(d: Data, t: float) -> float:
    """Psi_l(t), linear between two breaks."""
    return d.influx + d.influx_rate * (t - d.t_0)


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


# Rows of the work space: values in cells (N) or on faces (N + 1).
_N, _L, _RADIUS, _STRESS, _SLOPE, _NF, _CF, _NC, _CC, _BACK, _HERE, _AHEAD, _NF_N, _CF_N, _FACE = range(15)
WORK_ROWS = 15


@njit(error_model="numpy")
def _prepare(d: Data, y: Array, work: Array) -> None:
    """Fractions, stress, slopes, radii and floored fractions of the state `y`; one loop each, as the compiler vectorises those."""
    N, m = d.cells, d.stride
    W = y[m * N]
    n, l, face = work[_N], work[_L], work[_FACE]
    inverse = 1.0 / W
    for i in range(N):
        n[i], l[i] = inverse * y[m * i], inverse * y[m * i + 1]
    for i in range(N):
        work[_STRESS, i] = law.extra_stress(l[i], d.A, d.B, d.k)
    for i in range(N):
        work[_NC, i], work[_CC, i] = law.floored(n[i], d.floor), law.floored(1.0 - n[i], d.floor)
    work[_SLOPE, 0] = _inner_slope(d, n[0], n[1])[0]
    for i in range(1, N - 1):
        work[_SLOPE, i] = transport.slope(n[i] - n[i - 1], n[i + 1] - n[i], n[i], 1.0 / N)[0]
    work[_SLOPE, N - 1] = transport.open_slope(n[N - 1], n[N - 2])[0]
    face[0], face[N] = n[0] if np.isnan(d.n_wall) else d.n_wall, n[N - 1]
    for f in range(1, N):
        face[f] = 0.5 * (n[f - 1] + n[f])
    for f in range(N + 1):
        work[_NF, f], work[_CF, f] = law.floored(face[f], d.floor), law.floored(1.0 - face[f], d.floor)
    for f in range(N + 1):
        work[_RADIUS, f] = np.sqrt(d.inner_radius * d.inner_radius + 2.0 * W * f / N) if d.annulus else 1.0


@njit(error_model="numpy")
def _strains(d: Data, W: float, inner: float, outer: float) -> tuple[float, float, float]:
    """Of a cell between two radii: mean radius, a and s of the strains ``a (v_+ - v_-)`` and ``s (v_+ + v_-)``."""
    if not d.annulus:
        return 1.0, d.cells / W, 0.0
    mean = 0.5 * (inner + outer)
    return mean, mean * d.cells / W, 0.5 / mean


@njit(error_model="numpy")
def _stiffness(d: Data, W: float, a: float, s: float, mu: float, lambda_: float) -> tuple[float, float, float]:
    """Second derivatives ++, --, +- of ``h W (nu (e_r^2 + e_theta^2)/2 + lambda e_r e_theta)`` with respect to the face velocities."""
    nu, area = law.viscosity(mu, lambda_), W / d.cells
    direct, cross = nu * (a * a + s * s), 2.0 * lambda_ * a * s
    return area * (direct + cross), area * (direct - cross), area * nu * (s * s - a * a)


@njit(error_model="numpy")
def _slip_at(d: Data, y: Array, work: Array, f: int) -> float:
    """w on face f, walls included."""
    if f == 0:
        return y[d.stride * d.cells + 1] / (d.inner_radius * work[_CF, 0])
    return y[d.stride * (f - 1) + 2] if f < d.cells else 0.0


@njit(error_model="numpy")
def _n_flux(d: Data, y: Array, work: Array, f: int) -> tuple[float, float]:
    """Flux F of n through face f, and its velocity v."""
    n, V = work[_N], y[d.stride * d.cells + 1]
    n_f, slip = 0.5 * (n[f - 1] + n[f]), work[_RADIUS, f] * y[d.stride * (f - 1) + 2]
    left, right = n[f - 1] + 0.5 * work[_SLOPE, f - 1], n[f] - 0.5 * work[_SLOPE, f]
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
        out[2, f], out[3, f] = _l_transport(d, y[m * N], y[m * N + 1], work[_RADIUS, f], f / N)


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
    n, l, radius = work[_N], work[_L], work[_RADIUS]
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
        _drag_rows(d, y, out, work)
    else:
        _interfacial_rows(d, y, out, work)
    out[m * (N - 1) + 2] = y[m * (N - 1) + 2]
    l_wall = law.wall_concentration(l[0], 0.5 * h * W / d.inner_radius, Psi_l, d.Psi_m)
    out[m * N] = V
    out[m * N + 1] = V - d.inner_radius * law.growth_rate(l_wall, d.Psi_m)
    out[m * N + 2], out[m * N + 3], out[m * N + 4] = h * W * total, d.inner_radius * Psi_l, V


@njit(error_model="numpy")
def _interfacial_rows(d: Data, y: Array, out: Array, work: Array) -> None:
    """Residuals of the slip equation with the interfacial force."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    n, radius, n_f, c_f = work[_N], work[_RADIUS], work[_NF], work[_CF]
    for f in range(1, N):
        row, r = m * (f - 1) + 2, radius[f]
        step = (1.0 - n[f]) * work[_STRESS, f] - (1.0 - n[f - 1]) * work[_STRESS, f - 1]
        out[row] = h * W * d.b * n_f[f] * c_f[f] * y[row] + r * n_f[f] * step
        if d.annulus:
            out[row] -= 2.0 * law.mean_viscosity(0.5 * (n[f - 1] + n[f]), d.mu_n, d.mu_m) * (V / r) * (n[f] - n[f - 1])
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        _, a, s = _strains(d, W, radius[i], radius[i + 1])
        for phase in range(2):
            fraction = work[_CC, i] if phase == 0 else work[_NC, i]
            face = n_f if phase == 0 else c_f
            mu, lambda_ = (d.mu_m, d.lambda_m) if phase == 0 else (d.mu_n, d.lambda_n)
            pp, mm, pm = _stiffness(d, W, a, s, mu, lambda_)
            v_m, v_p = face[i] * inner, face[i + 1] * outer
            if i > 0:
                out[m * (i - 1) + 2] += face[i] * fraction * (mm * v_m + pm * v_p)
            if i < N - 1:
                out[m * i + 2] += face[i + 1] * fraction * (pp * v_p + pm * v_m)
        inner = outer


@njit(error_model="numpy")
def _drag_cell(d: Data, work: Array, i: int, a: float, s: float) -> tuple[float, float, float, float]:
    """Coefficients of a cell in the drag form: ``n c T = p[0] w_+ + p[1] w_-`` and ``n c X = p[2] w_+ + p[3] w_-``."""
    product = work[_NC, i] * work[_CC, i]
    n_m, n_p, c_m, c_p = work[_NF, i], work[_NF, i + 1], work[_CF, i], work[_CF, i + 1]
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    z_p, z_m = nu_m * n_p + nu_n * c_p, nu_m * n_m + nu_n * c_m
    y_p, y_m = d.lambda_m * n_p + d.lambda_n * c_p, d.lambda_m * n_m + d.lambda_n * c_m
    m_p, m_m = d.mu_m * n_p + d.mu_n * c_p, d.mu_m * n_m + d.mu_n * c_m
    return (
        product * (a * z_p + s * y_p),
        product * (-a * z_m + s * y_m),
        2.0 * product * (a - s) * m_p,
        -2.0 * product * (a + s) * m_m,
    )


@njit(error_model="numpy")
def _outer_stress(d: Data, y: Array, f: int) -> float:
    """S on face f: an unknown in the annulus, the outer traction in the slab."""
    return y[d.stride * (f - 1) + 3] if d.annulus else d.p_out


@njit(error_model="numpy")
def _stress_row(d: Data, V: float, work: Array, i: int, inner: float, outer: float, W: float) -> float:
    """``S_+ - S_-`` over cell i."""
    mean, a, s = _strains(d, W, work[_RADIUS, i], work[_RADIUS, i + 1])
    n, n_m, n_p, c_m, c_p = work[_N, i], work[_NF, i], work[_NF, i + 1], work[_CF, i], work[_CF, i + 1]
    g = a * (n_p * outer - n_m * inner) - s * (n_p * outer + n_m * inner)
    k = a * (c_p * outer - c_m * inner) - s * (c_p * outer + c_m * inner)
    Y = d.mu_m * (1.0 - n) * g - d.mu_n * n * k
    shear = d.mu_n * n + d.mu_m * (1.0 - n)
    return W / (d.cells * mean) * (-4.0 * shear * V / mean**3 + 2.0 / mean * Y)


@njit(error_model="numpy")
def _drag_rows(d: Data, y: Array, out: Array, work: Array) -> None:
    """Residuals of the slip equation with drag only, and of S in the annulus."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    n, radius, stress = work[_N], work[_RADIUS], work[_STRESS]
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        _, a, s = _strains(d, W, radius[i], radius[i + 1])
        t_p, t_m, x_p, x_m = _drag_cell(d, work, i, a, s)
        force, hoop = t_p * outer + t_m * inner, x_p * outer + x_m * inner
        for f in (i, i + 1):
            if 0 < f < N:
                row, r = m * (f - 1) + 2, radius[f]
                mixed = n[i] * (1.0 - n[i])
                load = S_f = 0.0
                S_f = _outer_stress(d, y, f)
                load = -r * force - S_f * r * n[i] + r * mixed * stress[i]
                if d.annulus:
                    load += 2.0 * (d.mu_m - d.mu_n) * (V / r) * mixed
                value = load if f == i else -load
                if d.annulus:
                    value -= 0.5 * (h * W / r) * hoop
                if f == i + 1:
                    out[row] = h * W * d.b * work[_NF, f] * work[_CF, f] * outer
                out[row] += value
        if d.annulus and i > 0:
            out[m * (i - 1) + 3] = _outer_stress(d, y, i + 1) - _outer_stress(d, y, i) - _stress_row(d, V, work, i, inner, outer, W)
        inner = outer
    if d.annulus:
        out[m * (N - 1) + 3] = _outer_stress(d, y, N) - d.p_out


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
    n, l = work[_N], work[_L]
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
        work[_NF_N, f], work[_CF_N, f] = slope * law.floored_slope(fraction, d.floor), -slope * law.floored_slope(1.0 - fraction, d.floor)
    if d.drag:
        _drag_tangent(d, y, jac, work)
    else:
        _interfacial_tangent(d, y, jac, work)
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
    n, radius = work[_N], work[_RADIUS]
    for i in range(N):
        if i == 0:
            _, here, ahead = _inner_slope(d, n[0], n[1])
            work[_BACK, 0], work[_HERE, 0], work[_AHEAD, 0] = 0.0, here, ahead
        elif i == N - 1:
            _, here, back = transport.open_slope(n[i], n[i - 1])
            work[_BACK, i], work[_HERE, i], work[_AHEAD, i] = back, here, 0.0
        else:
            _, back, here, ahead = transport.slope(n[i] - n[i - 1], n[i + 1] - n[i], n[i], h)
            work[_BACK, i], work[_HERE, i], work[_AHEAD, i] = back, here, ahead
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    for f in range(1, N):
        xi, r, i, j = f * h, radius[f], f - 1, f
        n_f, slip = 0.5 * (n[i] + n[j]), r * y[m * i + 2]
        left, right = n[i] + 0.5 * work[_SLOPE, i], n[j] - 0.5 * work[_SLOPE, j]
        v = law.relative_velocity(law.necrotic_velocity(V, n_f, slip), xi, V)
        s, s_n, s_w, _ = _damping(d, v, n_f, slip, nu_n, nu_m)
        mean, jump = 0.5 * (left + right), right - left
        from_left, from_right = 0.5 * (v + s), 0.5 * (v - s)
        through = 0.5 * (mean * slip - 0.5 * jump * s_n)
        weights = (
            from_left * 0.5 * work[_BACK, i],
            from_left * (1.0 + 0.5 * work[_HERE, i]) - from_right * 0.5 * work[_BACK, j] + through,
            from_left * 0.5 * work[_AHEAD, i] + from_right * (1.0 - 0.5 * work[_HERE, j]) + through,
            -from_right * 0.5 * work[_AHEAD, j],
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
def _add_fraction(d: Data, jac: Array, row: int, f: int, value: float) -> None:
    """Add a derivative with respect to the mean fraction on face f, ``(n_{f-1} + n_f)/2`` (n_0 at the endothelium); it is
    given per unit of W n."""
    m, half = d.stride, 2 * d.stride
    for cell in (max(f - 1, 0), f):
        jac[row, m * cell - row + half] += 0.5 * value


@njit(error_model="numpy")
def _interfacial_tangent(d: Data, y: Array, jac: Array, work: Array) -> None:
    """Derivatives of `_interfacial_rows`."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    half = 2 * m
    n, l, radius, n_f, c_f = work[_N], work[_L], work[_RADIUS], work[_NF], work[_CF]
    for f in range(1, N):
        row, r, w = m * (f - 1) + 2, radius[f], y[m * (f - 1) + 2]
        slope_n, slope_c = work[_NF_N, f], work[_CF_N, f]
        step = (1.0 - n[f]) * work[_STRESS, f] - (1.0 - n[f - 1]) * work[_STRESS, f - 1]
        jac[row, half] += h * W * d.b * n_f[f] * c_f[f]
        fraction = h * W * d.b * (slope_n * c_f[f] + n_f[f] * slope_c) * w + r * slope_n * step
        curved = 0.0
        if d.annulus:
            curved = -2.0 * law.mean_viscosity(0.5 * (n[f - 1] + n[f]), d.mu_n, d.mu_m) * V / r
            fraction -= 2.0 * (d.mu_m - d.mu_n) * V / r * (n[f] - n[f - 1])
        _add_fraction(d, jac, row, f, fraction / W)
        for cell, sign in ((f - 1, -1.0), (f, 1.0)):
            jac[row, m * cell - row + half] += sign * (curved - r * n_f[f] * work[_STRESS, cell]) / W
            slope = law.extra_stress_slope(l[cell], d.A, d.B, d.k)
            jac[row, m * cell + 1 - row + half] += sign * r * n_f[f] * (1.0 - n[cell]) * slope / W
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        _, a, s = _strains(d, W, radius[i], radius[i + 1])
        for phase in range(2):
            fraction = work[_CC, i] if phase == 0 else work[_NC, i]
            fraction_n = -law.floored_slope(1.0 - n[i], d.floor) if phase == 0 else law.floored_slope(n[i], d.floor)
            face, face_n = (n_f, work[_NF_N]) if phase == 0 else (c_f, work[_CF_N])
            mu, lambda_ = (d.mu_m, d.lambda_m) if phase == 0 else (d.mu_n, d.lambda_n)
            pp, mm, pm = _stiffness(d, W, a, s, mu, lambda_)
            v_m, v_p = face[i] * inner, face[i + 1] * outer
            # v_- and v_+ change with the face fraction; at the endothelium w_0 = V/(R_1 c(0)) does, too
            v_m_n = face_n[i] * inner
            if i == 0:
                v_m_n -= v_m / c_f[0] * work[_CF_N, 0]
            v_p_n = face_n[i + 1] * outer if i < N - 1 else 0.0
            for f in (i, i + 1):
                if not 0 < f < N:
                    continue
                row = m * (f - 1) + 2
                own, other = (mm, pm) if f == i else (pm, pp)  # coefficients of v_- and v_+
                force = own * v_m + other * v_p
                _add_fraction(d, jac, row, f, face_n[f] * fraction * force / W)
                _add_fraction(d, jac, row, i, face[f] * fraction * own * v_m_n / W)
                if i < N - 1:
                    _add_fraction(d, jac, row, i + 1, face[f] * fraction * other * v_p_n / W)
                    jac[row, m * i + 2 - row + half] += face[f] * fraction * other * face[i + 1]
                if i > 0:
                    jac[row, m * (i - 1) + 2 - row + half] += face[f] * fraction * own * face[i]
                jac[row, m * i - row + half] += face[f] * fraction_n * force / W
        inner = outer


@njit(error_model="numpy")
def _drag_tangent(d: Data, y: Array, jac: Array, work: Array) -> None:
    """Derivatives of `_drag_rows`."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    half = 2 * m
    n, l, radius, stress = work[_N], work[_L], work[_RADIUS], work[_STRESS]
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        mean, a, s = _strains(d, W, radius[i], radius[i + 1])
        t_p, t_m, x_p, x_m = _drag_cell(d, work, i, a, s)
        force, hoop = t_p * outer + t_m * inner, x_p * outer + x_m * inner
        product = work[_NC, i] * work[_CC, i]
        product_n = law.floored_slope(n[i], d.floor) * work[_CC, i] - work[_NC, i] * law.floored_slope(1.0 - n[i], d.floor)
        # derivatives of the coefficients, times w, with respect to the fraction of either face
        n_m, c_m = work[_NF_N, i], work[_CF_N, i]
        n_p, c_p = (work[_NF_N, i + 1], work[_CF_N, i + 1]) if i < N - 1 else (0.0, 0.0)
        t_p_n = product * (a * (nu_m * n_p + nu_n * c_p) + s * (d.lambda_m * n_p + d.lambda_n * c_p)) * outer
        t_m_n = product * (-a * (nu_m * n_m + nu_n * c_m) + s * (d.lambda_m * n_m + d.lambda_n * c_m)) * inner
        x_p_n = 2.0 * product * (a - s) * (d.mu_m * n_p + d.mu_n * c_p) * outer
        x_m_n = -2.0 * product * (a + s) * (d.mu_m * n_m + d.mu_n * c_m) * inner
        inner_n = 0.0
        if i == 0:
            inner_n = -inner / work[_CF, 0] * work[_CF_N, 0]
            t_m_n += t_m * inner_n
            x_m_n += x_m * inner_n
        for f in (i, i + 1):
            if not 0 < f < N:
                continue
            row, r = m * (f - 1) + 2, radius[f]
            sign = 1.0 if f == i else -1.0
            hoop_weight = -0.5 * h * W / r if d.annulus else 0.0
            S_f = _outer_stress(d, y, f)
            mixed, mixed_n = n[i] * (1.0 - n[i]), 1.0 - 2.0 * n[i]
            by_n = -r * S_f + r * mixed_n * stress[i] - r * force * product_n / product
            if d.annulus:
                by_n += 2.0 * (d.mu_m - d.mu_n) * V / r * mixed_n
                jac[row, 1 + half] -= sign * r * n[i]
            by_n = sign * by_n + hoop_weight * hoop * product_n / product
            jac[row, m * i - row + half] += by_n / W
            jac[row, m * i + 1 - row + half] += sign * r * mixed * law.extra_stress_slope(l[i], d.A, d.B, d.k) / W
            _add_fraction(d, jac, row, i, (-sign * r * t_m_n + hoop_weight * x_m_n) / W)
            if i > 0:
                jac[row, m * (i - 1) + 2 - row + half] += -sign * r * t_m + hoop_weight * x_m
            if i < N - 1:
                _add_fraction(d, jac, row, i + 1, (-sign * r * t_p_n + hoop_weight * x_p_n) / W)
                jac[row, m * i + 2 - row + half] += -sign * r * t_p + hoop_weight * x_p
            if f == i + 1:
                jac[row, half] += h * W * d.b * work[_NF, f] * work[_CF, f]
                zeta_n = work[_NF_N, f] * work[_CF, f] + work[_NF, f] * work[_CF_N, f]
                _add_fraction(d, jac, row, f, h * W * d.b * zeta_n * outer / W)
        if d.annulus and i > 0:
            row, scale = m * (i - 1) + 3, W / (N * mean)
            jac[row, half] -= 1.0
            jac[row, half + m] += 1.0
            fn_m, fn_p, fc_m, fc_p = work[_NF, i], work[_NF, i + 1], work[_CF, i], work[_CF, i + 1]
            g = a * (fn_p * outer - fn_m * inner) - s * (fn_p * outer + fn_m * inner)
            k = a * (fc_p * outer - fc_m * inner) - s * (fc_p * outer + fc_m * inner)
            weight, mu_c, mu_n = 2.0 * scale / mean, d.mu_m * (1.0 - n[i]), d.mu_n * n[i]
            shear_n = d.mu_n - d.mu_m
            jac[row, m * i - row + half] -= (-4.0 * scale * shear_n * V / mean**3 - weight * (d.mu_m * g + d.mu_n * k)) / W
            _add_fraction(d, jac, row, i, weight * (a + s) * (mu_c * n_m - mu_n * c_m) * inner / W)
            jac[row, m * (i - 1) + 2 - row + half] += weight * (a + s) * (mu_c * fn_m - mu_n * fc_m)
            if i < N - 1:
                _add_fraction(d, jac, row, i + 1, -weight * (a - s) * (mu_c * n_p - mu_n * c_p) * outer / W)
                jac[row, m * i + 2 - row + half] -= weight * (a - s) * (mu_c * fn_p - mu_n * fc_p)
        inner = outer
    if d.annulus:
        jac[m * (N - 1) + 3, half] += 1.0


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
