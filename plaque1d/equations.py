r"""The laws of the two-phase plaque model, each once, with its derivatives.

Zanca, Ahmed, Won, Browning, Flegg & Ruiz-Baier, "Multiphase models for moving boundary problems in
biology", section 3; numbers in brackets are that paper's. Everything is plain arithmetic, for floats and
arrays alike. ``n`` is the necrotic fraction, ``c = 1 - n`` the macrophage fraction, ``l`` the
concentration of modified LDL (modLDL); all quantities are dimensionless.

Adding the mass balances (3.8a,b) with the boundary conditions (3.8g,h), (3.9) gives a mixture velocity that
is uniform in space, ``c u_m + n u_n = V = L' = Psi_m l(0, t)``. With the slip velocity ``w = u_m - u_n``,

    u_n = V - c w,      u_m = V + n w.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)


def extra_stress(l: Array, A: float, B: float, k: float) -> Array:
    """Contact stress of macrophages, Sigma = A / (1 + B l^k), (3.6); it falls as modLDL attracts them."""
    positive = np.maximum(l, 0.0)
    return A / (1.0 + B * (positive if k == 1.0 else positive**k))


def extra_stress_slope(l: Array, A: float, B: float, k: float) -> Array:
    """dSigma/dl; infinite at l = 0 for k < 1, which the parameter checks refuse. Zero for l < 0."""
    positive = np.maximum(l, 0.0)
    power = 1.0 if k == 1.0 else positive ** (k - 1.0)
    return (l >= 0.0) * (-A * B * k * power / (1.0 + B * power * positive) ** 2)


def uptake(l: Number, n: Number) -> Number:
    """Encounter rate of modLDL and macrophages, l c. Macrophages die at k_m l c (3.3, 3.10a), modLDL is
    consumed at k_l l c (3.10b)."""
    return l * (1.0 - n)


def uptake_slopes(l: Number, n: Number) -> tuple[Number, Number]:
    """Derivatives of `uptake` with respect to l and n."""
    return 1.0 - n, -l


def viscosity(mu: float, lambda_: float) -> float:
    """One-dimensional viscosity nu = 2 mu + lambda of a phase, from (3.5)."""
    return 2.0 * mu + lambda_


def mean_viscosity(n: Number, nu_n: float, nu_m: float) -> Number:
    """nu_m n + nu_n c, which multiplies the slip in the pressure gradient."""
    return nu_n + (nu_m - nu_n) * n


def wall_concentration(inner: float, distance: float, Psi_l: float, Psi_m: float) -> float:
    """modLDL at the endothelium, from its influx (3.8h): ``Psi_l = V l_w - (l_0 - l_w)/d``, ``V = Psi_m l_w``.

    Parameters
    ----------
    inner : float
        Concentration l_0 at distance d from the wall.
    distance : float
        d, half a cell in x.

    Returns
    -------
    float
        The positive root l_w of ``Psi_m d l_w^2 + l_w = l_0 + d Psi_l``, in the form that does not cancel.
    """
    load = inner + distance * Psi_l
    return 2.0 * load / (1.0 + float(np.sqrt(1.0 + 4.0 * Psi_m * distance * load)))


def wall_concentration_slopes(inner: float, distance: float, Psi_l: float, Psi_m: float) -> tuple[float, float]:
    """Derivatives of `wall_concentration` with respect to l_0 and d, by the implicit function theorem."""
    l_wall = wall_concentration(inner, distance, Psi_l, Psi_m)
    denominator = 2.0 * Psi_m * distance * l_wall + 1.0
    return 1.0 / denominator, (Psi_l - Psi_m * l_wall * l_wall) / denominator


def growth_rate(l_wall: Number, Psi_m: float) -> Number:
    """L' = V = Psi_m l(0, t), (3.9): macrophages enter in proportion to modLDL at the endothelium."""
    return Psi_m * l_wall


def necrotic_velocity(V: float | Array, n: Array, w: Array) -> Array:
    """u_n = V - c w."""
    return V - (1.0 - n) * w


def macrophage_velocity(V: float | Array, n: Array, w: Array) -> Array:
    """u_m = V + n w."""
    return V + n * w


def short_wave_velocity(u_n: Array, n: Array, w: Array, nu_n: float, nu_m: float) -> Array:
    """Speed of short waves of n, ``u_n + n w nu_m / (nu_m n + nu_n c)``.

    Viscosity keeps ``z = (nu_m n + nu_n c) w`` smooth across a short wave, so the flux of n at constant z has
    this slope. Without any viscosity the limit of equal viscosities is taken.
    """
    if nu_n == 0.0 and nu_m == 0.0:
        return u_n + n * w
    return u_n + n * w * nu_m / mean_viscosity(n, nu_n, nu_m)


def short_wave_excess_slopes(n: Array, w: Array, nu_n: float, nu_m: float) -> tuple[Array, Array]:
    """Derivatives of ``short_wave_velocity - u_n`` with respect to n and w."""
    if nu_n == 0.0 and nu_m == 0.0:
        return w, n
    mean = mean_viscosity(n, nu_n, nu_m)
    return w * nu_m * nu_n / mean**2, n * nu_m / mean


def pressure(p_out: float | Array, n: Array, stress: Array, strain_n: Array, strain_m: Array, nu_n: float, nu_m: float) -> Array:
    """Pressure of the necrotic phase, the sum of (3.8d) and (3.8e) integrated from the outer wall:
    ``p_n = p_out - c Sigma + n nu_n u_n,x + c nu_m u_m,x``."""
    return p_out - (1.0 - n) * stress + n * nu_n * strain_n + (1.0 - n) * nu_m * strain_m


def drag_diffusivity(n: Array, stress: Array, p_out: float) -> Array:
    """b times the inviscid diffusivity of n in the form that is printed: ``p_out - (1 - 2n) Sigma``; where it is
    negative the drag form is ill-posed without viscosity."""
    return p_out - (1.0 - 2.0 * n) * stress


def interfacial_diffusivity(n: Array, stress: Array) -> Array:
    """b times the inviscid diffusivity of n with the interfacial force: ``n Sigma``, never negative."""
    return n * stress


def dispersion_matrix(
    q: float,
    n: float,
    l: float,
    k_l: float,
    k_m: float,
    b: float,
    nu_n: float,
    nu_m: float,
    A: float,
    B: float,
    k: float,
    p_out: float,
    momentum: str,
) -> Array:
    """Growth matrix of a perturbation ``exp(iqx + st)`` of (n, l) about a uniform state, frozen in time.

    With ``G = q^2 / (b + nu q^2)``, ``nu = nu_m n + nu_n c`` and D1 the diffusivity above,

        s = eig [ -G D1 - k_m l ,  G n c Sigma' + k_m c ;  k_l l ,  -q^2 - k_l c ].
    """
    c, at, fraction = 1.0 - n, np.array([l]), np.array([n])
    stress = extra_stress(at, A, B, k)
    slope = float(extra_stress_slope(at, A, B, k)[0])
    G = q * q / (b + mean_viscosity(n, nu_n, nu_m) * q * q)
    diffusivity = interfacial_diffusivity(fraction, stress) if momentum == "interfacial" else drag_diffusivity(fraction, stress, p_out)
    D1 = float(diffusivity[0])
    return np.array([[-G * D1 - k_m * l, G * n * c * slope + k_m * c], [k_l * l, -q * q - k_l * c]])
