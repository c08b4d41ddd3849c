r"""Momentum of the plaque's two phases on the faces: the rows of the slip w, both forms, slab and annulus, and their tangents, compiled.

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

from typing import Any

from numba import njit

from plaque1d import laws as law
from plaque1d.layout import CC, CF, CF_N, L_ROW, N_ROW, NC, NF, NF_N, RADIUS, STRESS, Data

Array = Any


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
        return y[d.stride * d.cells + 1] / (d.inner_radius * work[CF, 0])
    return y[d.stride * (f - 1) + 2] if f < d.cells else 0.0


@njit(error_model="numpy")
def interfacial_rows(d: Data, y: Array, out: Array, work: Array) -> None:
    """Residuals of the slip equation with the interfacial force."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    n, radius, n_f, c_f = work[N_ROW], work[RADIUS], work[NF], work[CF]
    for f in range(1, N):
        row, r = m * (f - 1) + 2, radius[f]
        step = (1.0 - n[f]) * work[STRESS, f] - (1.0 - n[f - 1]) * work[STRESS, f - 1]
        out[row] = h * W * d.b * n_f[f] * c_f[f] * y[row] + r * n_f[f] * step
        if d.annulus:
            out[row] -= 2.0 * law.mean_viscosity(0.5 * (n[f - 1] + n[f]), d.mu_n, d.mu_m) * (V / r) * (n[f] - n[f - 1])
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        _, a, s = _strains(d, W, radius[i], radius[i + 1])
        for phase in range(2):
            fraction = work[CC, i] if phase == 0 else work[NC, i]
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
    product = work[NC, i] * work[CC, i]
    n_m, n_p, c_m, c_p = work[NF, i], work[NF, i + 1], work[CF, i], work[CF, i + 1]
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
    mean, a, s = _strains(d, W, work[RADIUS, i], work[RADIUS, i + 1])
    n, n_m, n_p, c_m, c_p = work[N_ROW, i], work[NF, i], work[NF, i + 1], work[CF, i], work[CF, i + 1]
    g = a * (n_p * outer - n_m * inner) - s * (n_p * outer + n_m * inner)
    k = a * (c_p * outer - c_m * inner) - s * (c_p * outer + c_m * inner)
    Y = d.mu_m * (1.0 - n) * g - d.mu_n * n * k
    shear = d.mu_n * n + d.mu_m * (1.0 - n)
    return W / (d.cells * mean) * (-4.0 * shear * V / mean**3 + 2.0 / mean * Y)


@njit(error_model="numpy")
def drag_rows(d: Data, y: Array, out: Array, work: Array) -> None:
    """Residuals of the slip equation with drag only, and of S in the annulus."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    n, radius, stress = work[N_ROW], work[RADIUS], work[STRESS]
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
                    out[row] = h * W * d.b * work[NF, f] * work[CF, f] * outer
                out[row] += value
        if d.annulus and i > 0:
            out[m * (i - 1) + 3] = _outer_stress(d, y, i + 1) - _outer_stress(d, y, i) - _stress_row(d, V, work, i, inner, outer, W)
        inner = outer
    if d.annulus:
        out[m * (N - 1) + 3] = _outer_stress(d, y, N) - d.p_out


@njit(error_model="numpy")
def _add_fraction(d: Data, jac: Array, row: int, f: int, value: float) -> None:
    """Add a derivative with respect to the mean fraction on face f, ``(n_{f-1} + n_f)/2`` (n_0 at the endothelium); it is
    given per unit of W n."""
    m, half = d.stride, 2 * d.stride
    for cell in (max(f - 1, 0), f):
        jac[row, m * cell - row + half] += 0.5 * value


@njit(error_model="numpy")
def interfacial_tangent(d: Data, y: Array, jac: Array, work: Array) -> None:
    """Derivatives of `interfacial_rows`."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    half = 2 * m
    n, l, radius, n_f, c_f = work[N_ROW], work[L_ROW], work[RADIUS], work[NF], work[CF]
    for f in range(1, N):
        row, r, w = m * (f - 1) + 2, radius[f], y[m * (f - 1) + 2]
        slope_n, slope_c = work[NF_N, f], work[CF_N, f]
        step = (1.0 - n[f]) * work[STRESS, f] - (1.0 - n[f - 1]) * work[STRESS, f - 1]
        jac[row, half] += h * W * d.b * n_f[f] * c_f[f]
        fraction = h * W * d.b * (slope_n * c_f[f] + n_f[f] * slope_c) * w + r * slope_n * step
        curved = 0.0
        if d.annulus:
            curved = -2.0 * law.mean_viscosity(0.5 * (n[f - 1] + n[f]), d.mu_n, d.mu_m) * V / r
            fraction -= 2.0 * (d.mu_m - d.mu_n) * V / r * (n[f] - n[f - 1])
        _add_fraction(d, jac, row, f, fraction / W)
        for cell, sign in ((f - 1, -1.0), (f, 1.0)):
            jac[row, m * cell - row + half] += sign * (curved - r * n_f[f] * work[STRESS, cell]) / W
            slope = law.extra_stress_slope(l[cell], d.A, d.B, d.k)
            jac[row, m * cell + 1 - row + half] += sign * r * n_f[f] * (1.0 - n[cell]) * slope / W
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        _, a, s = _strains(d, W, radius[i], radius[i + 1])
        for phase in range(2):
            fraction = work[CC, i] if phase == 0 else work[NC, i]
            fraction_n = -law.floored_slope(1.0 - n[i], d.floor) if phase == 0 else law.floored_slope(n[i], d.floor)
            face, face_n = (n_f, work[NF_N]) if phase == 0 else (c_f, work[CF_N])
            mu, lambda_ = (d.mu_m, d.lambda_m) if phase == 0 else (d.mu_n, d.lambda_n)
            pp, mm, pm = _stiffness(d, W, a, s, mu, lambda_)
            v_m, v_p = face[i] * inner, face[i + 1] * outer
            # v_- and v_+ change with the face fraction; at the endothelium w_0 = V/(R_1 c(0)) does, too
            v_m_n = face_n[i] * inner
            if i == 0:
                v_m_n -= v_m / c_f[0] * work[CF_N, 0]
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
def drag_tangent(d: Data, y: Array, jac: Array, work: Array) -> None:
    """Derivatives of `drag_rows`."""
    N, m = d.cells, d.stride
    h, W, V = 1.0 / N, y[m * N], y[m * N + 1]
    half = 2 * m
    n, l, radius, stress = work[N_ROW], work[L_ROW], work[RADIUS], work[STRESS]
    nu_n, nu_m = law.viscosity(d.mu_n, d.lambda_n), law.viscosity(d.mu_m, d.lambda_m)
    inner = _slip_at(d, y, work, 0)
    for i in range(N):
        outer = _slip_at(d, y, work, i + 1)
        mean, a, s = _strains(d, W, radius[i], radius[i + 1])
        t_p, t_m, x_p, x_m = _drag_cell(d, work, i, a, s)
        force, hoop = t_p * outer + t_m * inner, x_p * outer + x_m * inner
        product = work[NC, i] * work[CC, i]
        product_n = law.floored_slope(n[i], d.floor) * work[CC, i] - work[NC, i] * law.floored_slope(1.0 - n[i], d.floor)
        # derivatives of the coefficients, times w, with respect to the fraction of either face
        n_m, c_m = work[NF_N, i], work[CF_N, i]
        n_p, c_p = (work[NF_N, i + 1], work[CF_N, i + 1]) if i < N - 1 else (0.0, 0.0)
        t_p_n = product * (a * (nu_m * n_p + nu_n * c_p) + s * (d.lambda_m * n_p + d.lambda_n * c_p)) * outer
        t_m_n = product * (-a * (nu_m * n_m + nu_n * c_m) + s * (d.lambda_m * n_m + d.lambda_n * c_m)) * inner
        x_p_n = 2.0 * product * (a - s) * (d.mu_m * n_p + d.mu_n * c_p) * outer
        x_m_n = -2.0 * product * (a + s) * (d.mu_m * n_m + d.mu_n * c_m) * inner
        inner_n = 0.0
        if i == 0:
            inner_n = -inner / work[CF, 0] * work[CF_N, 0]
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
                jac[row, half] += h * W * d.b * work[NF, f] * work[CF, f]
                zeta_n = work[NF_N, f] * work[CF, f] + work[NF, f] * work[CF_N, f]
                _add_fraction(d, jac, row, f, h * W * d.b * zeta_n * outer / W)
        if d.annulus and i > 0:
            row, scale = m * (i - 1) + 3, W / (N * mean)
            jac[row, half] -= 1.0
            jac[row, half + m] += 1.0
            fn_m, fn_p, fc_m, fc_p = work[NF, i], work[NF, i + 1], work[CF, i], work[CF, i + 1]
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
