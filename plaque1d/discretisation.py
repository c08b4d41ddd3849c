r"""Finite volumes of second order for the plaque on the moving grid, with their derivatives.

Unknowns: n and l as averages over N equal cells in xi = x/L, the slip velocity w on the N - 1 interior faces,
L and V = L'. Face f lies between cells f - 1 and f. With h = 1/N the discrete equations are, for cell i and
interior face f (d/dt stands for the formula of the time loop),

    h d(L n_i)/dt + F_{i+1} - F_i = h k_m L l_i c_i,          F_0 = F_N = 0                       (3.10a)
    h d(L l_i)/dt + G_{i+1} - G_i = -h k_l L l_i c_i,         G_0 = Psi_l, G_N = 0                (3.10b)
    F = v n_bar - s (n_R - n_L) / 2,   n_bar = (n_L + n_R) / 2,   v = V - c_f w - xi V,   c_f = (c_{f-1} + c_f) / 2
    G = (1 - xi) V l_bar - max(1/(h L), (1 - xi) V / 2) (l_f - l_{f-1})

n_L, n_R from slopes limited by MC; the inner cell takes the slope of the parabola with n_xi = 0 (or n = g) at the
wall. The velocity takes c as the slip equation does: u_n is O(x) at the inner wall, so an O(h^2) mismatch there would be
an O(h) error of dn/dt. ``s = max(|v|, |v + n w nu_m/nu|)`` damps the short waves of n, which do not travel with v. The slip
equation is the sum of the two momentum balances (3.8d,e) with the pressure eliminated, as a sum of symmetric
operators with row factor and variable factor r on faces and weight kappa in cells:

    -sum r_f ( M_f - M_{f-1} ) + h L^2 zeta_f w_f = g_f,      M_i = kappa_i ( r_{i+1} w_{i+1} - r_i w_i ) / h
    interfacial:  (r, kappa) = (n, nu_m c) and (c, nu_n n),  zeta = b n c,      g = -L n_f ( (c Sigma)_f - (c Sigma)_{f-1} )
    drag:         (r, kappa) = (nu, n c), nu = nu_m n + nu_n c,  zeta = b n c nu,  g = L nu ( (n(p_out - c Sigma))_f - ( )_{f-1} )

with w_0 = V / c(0), w_N = 0; n and c in it are floored, which keeps it regular where a phase vanishes. (drag without
viscosity: nu = 1 and no operator.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multiphase.geometry import relative_velocity
from plaque1d import equations as eq
from plaque1d.parameters import PlaqueParameters

Array = NDArray[np.float64]

FLOOR = 1e-5
"""Floor of the fractions inside the slip equation; it changes w by a relative (FLOOR / fraction)^2."""


def wall_fraction(p: PlaqueParameters) -> float | None:
    """The given n(0, t), or None for n_xi = 0."""
    return None if isinstance(p.inner_wall, str) else float(p.inner_wall)


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """n on both sides of the interior faces, (N-1,), and its derivatives with respect to the cells f-2 .. f+1, (N-1, 4)."""

    left: Array
    right: Array
    d_left: Array
    d_right: Array


def limited_slopes(n: Array, n_wall: float | None) -> tuple[Array, Array]:
    """Slopes of n times the cell width, (N,), and their derivatives with respect to cells i-1, i, i+1, (N, 3).

    Inside: monotonised central differences. Inner cell: the parabola with n_xi = 0 at the wall, or through
    `n_wall`, limited. Outer cell: one-sided; no condition holds there.
    """
    step = np.diff(n)
    back, ahead = step[:-1], step[1:]
    central = 0.5 * (back + ahead)
    monotone = back * ahead > 0.0
    smallest = np.argmin(np.abs([central, 2.0 * back, 2.0 * ahead]), axis=0)
    weights = np.array([[-0.5, 0.0, 0.5], [-2.0, 2.0, 0.0], [0.0, -2.0, 2.0]])
    slopes = np.zeros_like(n)
    d_slopes = np.zeros((len(n), 3))
    d_slopes[1:-1] = np.where(monotone[:, None], weights[smallest], 0.0)
    slopes[1:-1] = np.where(monotone, np.choose(smallest, [central, 2.0 * back, 2.0 * ahead]), 0.0)
    if n_wall is None:
        slopes[0], d_slopes[0] = 0.5 * step[0], (0.0, -0.5, 0.5)
    else:
        inner = 2.0 * (n[0] - n_wall)
        candidates = np.array([1.25 * n[0] - 1.5 * n_wall + 0.25 * n[1], 2.0 * inner, 2.0 * step[0]])
        choice = int(np.argmin(np.abs(candidates)))
        if inner * step[0] > 0.0:
            slopes[0] = candidates[choice]
            d_slopes[0] = [(0.0, 1.25, 0.25), (0.0, 4.0, 0.0), (0.0, -2.0, 2.0)][choice]
    slopes[-1], d_slopes[-1] = step[-1], (-1.0, 1.0, 0.0)
    return slopes, d_slopes


def reconstruct(n: Array, n_wall: float | None) -> Reconstruction:
    """Limited linear reconstruction of n on the interior faces."""
    slopes, d = limited_slopes(n, n_wall)
    d_left = np.zeros((len(n) - 1, 4))
    d_right = np.zeros_like(d_left)
    d_left[:, :3] = 0.5 * d[:-1]
    d_left[:, 1] += 1.0
    d_right[:, 1:] = -0.5 * d[1:]
    d_right[:, 2] += 1.0
    return Reconstruction(n[:-1] + 0.5 * slopes[:-1], n[1:] - 0.5 * slopes[1:], d_left, d_right)


@dataclass(frozen=True, slots=True)
class NecroticFlux:
    """Flux F of n through the interior faces, (N-1,), its velocity v, and derivatives: `d_n` (N-1, 4) for the cells
    f-2 .. f+1, `d_w` and `d_V` (N-1,)."""

    value: Array
    velocity: Array
    d_n: Array
    d_w: Array
    d_V: Array


def necrotic_flux(n: Array, w: Array, V: float, xi: Array, n_wall: float | None, nu_n: float, nu_m: float) -> NecroticFlux:
    """The flux F of the module's formulas on the interior faces `xi`."""
    r = reconstruct(n, n_wall)
    n_bar, jump = 0.5 * (r.left + r.right), r.right - r.left
    n_f = 0.5 * (n[:-1] + n[1:])
    u_n = eq.necrotic_velocity(V, n_f, w)
    v = relative_velocity(u_n, xi, V)
    n_s = np.clip(n_f, FLOOR, 1.0 - FLOOR)  # keeps the mean viscosity above 0 where the only viscous phase is absent
    wave = relative_velocity(eq.short_wave_velocity(u_n, n_s, w, nu_n, nu_m), xi, V)
    excess_n, excess_w = eq.short_wave_excess_slopes(n_s, w, nu_n, nu_m)
    excess_n = np.where(n_s == n_f, excess_n, 0.0)
    fast = np.abs(wave) > np.abs(v)
    s = np.where(fast, np.abs(wave), np.abs(v))
    sign = np.where(fast, np.sign(wave), np.sign(v))
    s_n = sign * (w + np.where(fast, excess_n, 0.0))
    s_w = sign * (n_f - 1.0 + np.where(fast, excess_w, 0.0))
    s_V = sign * (1.0 - xi)
    d_n = v[:, None] * 0.5 * (r.d_left + r.d_right) - (0.5 * s)[:, None] * (r.d_right - r.d_left)
    d_n[:, 1:3] += (0.5 * (n_bar * w - 0.5 * jump * s_n))[:, None]
    return NecroticFlux(
        value=v * n_bar - 0.5 * s * jump,
        velocity=v,
        d_n=d_n,
        d_w=n_bar * (n_f - 1.0) - 0.5 * jump * s_w,
        d_V=(1.0 - xi) * n_bar - 0.5 * jump * s_V,
    )


def bounded(amounts: Array, L: float) -> Array:
    """`amounts` L n brought into [0, L] with their sum kept: what lies outside is taken from, or given to, all cells in proportion
    to what they have, or have room for.

    The semi-discrete flux keeps the bounds, a step of BDF2 only to its error. Left alone, n below 0 would grow as n does.
    """
    inside = np.clip(amounts, 0.0, L)
    excess = float(np.sum(amounts - inside))
    if excess == 0.0:
        return inside
    room = inside if excess < 0.0 else L - inside
    return inside + room * (excess / max(float(np.sum(room)), abs(excess)))


@dataclass(frozen=True, slots=True)
class LdlFlux:
    """Flux G of modLDL through the interior faces, (N-1,), its total diffusivity, and derivatives."""

    value: Array
    velocity: Array
    conductance: Array
    d_inner: Array
    d_outer: Array
    d_L: Array
    d_V: Array


def ldl_flux(l: Array, L: float, V: float, xi: Array, h: float, diffusivity: float = 1.0) -> LdlFlux:
    """The flux G of the module's formulas: central differences, upwind where a cell is longer than 2 D / velocity.

    `conductance` is the coefficient of the difference over a face.
    """
    velocity = relative_velocity(V, xi, V)
    diffusive = diffusivity / (h * L)
    upwind = 0.5 * np.abs(velocity) > diffusive
    conductance = np.where(upwind, 0.5 * np.abs(velocity), diffusive)
    mean, jump = 0.5 * (l[:-1] + l[1:]), np.diff(l)
    return LdlFlux(
        value=velocity * mean - conductance * jump,
        velocity=velocity,
        conductance=conductance,
        d_inner=0.5 * velocity + conductance,
        d_outer=0.5 * velocity - conductance,
        d_L=np.where(upwind, 0.0, diffusive / L) * jump,
        d_V=(1.0 - xi) * (mean - np.where(upwind, 0.5 * np.sign(V), 0.0) * jump),
    )


@dataclass(frozen=True, slots=True)
class SlipTerm:
    """One symmetric operator of the slip equation: r on faces 0 .. N-1, kappa in cells, and their derivatives with
    respect to the n beside them."""

    r: Array
    r_n: Array
    kappa: Array
    kappa_n: Array


@dataclass(frozen=True, slots=True)
class Slip:
    """Coefficients of the slip equation at one state, with derivatives.

    `zeta`, `load` and their derivatives belong to the interior faces; `load_inner`, `load_outer` are the derivatives
    of the load through the row factor excluded, with respect to the stress-like cell value `phi`.
    """

    terms: tuple[SlipTerm, ...]
    zeta: Array
    zeta_n: Array
    row: Array
    row_n: Array
    phi: Array
    phi_n: Array
    phi_l: Array
    w_wall: float
    w_wall_V: float
    w_wall_n: float


def slip(n: Array, l: Array, V: float, p: PlaqueParameters, floor: float = FLOOR) -> Slip:
    """Coefficients of the slip equation; ``load_f = L row_f (phi_f - phi_{f-1})``."""
    n_wall = wall_fraction(p)
    at_face = np.concatenate([[n[0] if n_wall is None else n_wall], 0.5 * (n[:-1] + n[1:])])
    nf, cf = eq.floored(at_face, floor), eq.floored(1.0 - at_face, floor)
    nf_n, cf_n = eq.floored_slope(at_face, floor), -eq.floored_slope(1.0 - at_face, floor)
    nc, cc = eq.floored(n, floor), eq.floored(1.0 - n, floor)
    nc_n, cc_n = eq.floored_slope(n, floor), -eq.floored_slope(1.0 - n, floor)
    stress, stress_l = eq.extra_stress(l, p.A, p.B, p.k), eq.extra_stress_slope(l, p.A, p.B, p.k)
    c = 1.0 - n
    terms: tuple[SlipTerm, ...]
    zeta, zeta_n = p.b * nf * cf, p.b * (nf_n * cf + nf * cf_n)
    if p.momentum == "interfacial":
        terms = (SlipTerm(nf, nf_n, p.nu_m * cc, p.nu_m * cc_n), SlipTerm(cf, cf_n, p.nu_n * nc, p.nu_n * nc_n))
        row, row_n = -nf, -nf_n
        phi, phi_n, phi_l = c * stress, -stress, c * stress_l
    else:
        viscous = p.nu_n > 0.0 or p.nu_m > 0.0
        row = p.nu_m * nf + p.nu_n * cf if viscous else np.ones_like(nf)
        row_n = p.nu_m * nf_n + p.nu_n * cf_n if viscous else np.zeros_like(nf)
        terms = (SlipTerm(row, row_n, nc * cc, nc_n * cc + nc * cc_n),) if viscous else ()
        zeta, zeta_n = zeta * row, zeta_n * row + zeta * row_n
        phi, phi_n, phi_l = n * (p.p_out - c * stress), p.p_out + (n - c) * stress, -n * c * stress_l
    return Slip(
        terms=terms,
        zeta=zeta[1:],
        zeta_n=zeta_n[1:],
        row=row[1:],
        row_n=row_n[1:],
        phi=phi,
        phi_n=phi_n,
        phi_l=phi_l,
        w_wall=V / float(cf[0]),
        w_wall_V=1.0 / float(cf[0]),
        w_wall_n=0.0 if n_wall is not None else -V / float(cf[0]) ** 2 * float(cf_n[0]),
    )


def slip_couplings(s: Slip, w: Array) -> list[tuple[SlipTerm, Array, Array]]:
    """For each operator: r w on all faces 0 .. N (zero at N), and the cell fluxes ``h M``, (N,)."""
    w_all = np.concatenate([[s.w_wall], w, [0.0]])
    couplings = []
    for term in s.terms:
        product = np.append(term.r, 0.0) * w_all
        couplings.append((term, product, term.kappa * np.diff(product)))
    return couplings
