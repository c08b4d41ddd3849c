r"""The laws of the two-phase tumour model, each once, with its derivatives.

Zanca, Ahmed, Won, Browning, Flegg & Ruiz-Baier, "Multiphase models for moving boundary problems in
biology", section 2; numbers in brackets are that paper's. Everything is plain arithmetic, for floats and
arrays alike, and compiles for numbers (`tumour.laws`). ``alpha`` is the cell fraction, ``C`` the oxygen
concentration; all quantities are dimensionless.

Radial bodies have the dimension ``m``: 1 for a slab, 2 for a disk in plane strain, 3 for a sphere. A point at
R moves to r(R, t); its stretches are ``l_r = r'(R)`` along the radius and ``l_t = r/R`` along the m - 1
directions across it, and its volume changes by ``J = l_r l_t^(m-1)``. In a slab nothing moves across: l_t = 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)

DARCY, PRINTED, CONSTANT = 0, 1, 2
MOBILITIES: Mapping[str, int] = {"darcy": DARCY, "printed": PRINTED, "constant": CONSTANT}
"""The laws of the mobility by name: see `mobility`."""


def contact_switch(alpha: Number, alpha_min: float, sigma_width: float) -> Number:
    """Share of the contact stress that acts: 0 below alpha_min and 1 from it on (2.5); with a width, the cubic that rises from 0
    at ``alpha_min - sigma_width/2`` to 1 at ``alpha_min + sigma_width/2`` and is flat at both ends."""
    if sigma_width == 0.0:
        return 1.0 * (alpha >= alpha_min)  # type: ignore[return-value]  # mypy takes a truth value times 1.0 for any kind of float
    x = np.minimum(np.maximum((alpha - alpha_min) / sigma_width + 0.5, 0.0), 1.0)
    share: Number = x * x * (3.0 - 2.0 * x)
    return share


def contact_switch_slope(alpha: Number, alpha_min: float, sigma_width: float) -> Number:
    """Derivative of `contact_switch`; 0 for a sharp switch, whose jump no slope can tell."""
    if sigma_width == 0.0:
        return 0.0 * alpha
    x = np.minimum(np.maximum((alpha - alpha_min) / sigma_width + 0.5, 0.0), 1.0)
    slope: Number = 6.0 * x * (1.0 - x) / sigma_width
    return slope


def contact_stress(alpha: Number, gamma: float, alpha_star: float, alpha_min: float, sigma_width: float) -> Number:
    """Stress that cells in contact exert, ``Sigma = gamma (alpha - alpha_star)/(1 - alpha)^2`` from alpha_min on and 0 below it (2.5).

    Cells repel above alpha_star, their natural fraction, and attract between alpha_min and alpha_star, if there is anything between.
    Sigma jumps at alpha_min where it is not alpha_star, unless `sigma_width` spreads the jump: see `contact_switch`.
    """
    free = 1.0 - alpha
    return contact_switch(alpha, alpha_min, sigma_width) * gamma * (alpha - alpha_star) / (free * free)


def contact_stress_slope(alpha: Number, gamma: float, alpha_star: float, alpha_min: float, sigma_width: float) -> Number:
    """dSigma/dalpha; at a sharp switch the derivative to the right."""
    free = 1.0 - alpha
    on = contact_switch(alpha, alpha_min, sigma_width) * gamma * (1.0 + alpha - 2.0 * alpha_star) / (free * free * free)
    return on + contact_switch_slope(alpha, alpha_min, sigma_width) * gamma * (alpha - alpha_star) / (free * free)


def contact_pressure(alpha: Number, gamma: float, alpha_star: float, alpha_min: float, sigma_width: float) -> Number:
    """``alpha Sigma``, what contact adds to the fluid pressure in the stress of the mixture (2.4)."""
    return alpha * contact_stress(alpha, gamma, alpha_star, alpha_min, sigma_width)


def contact_pressure_slope(alpha: Number, gamma: float, alpha_star: float, alpha_min: float, sigma_width: float) -> Number:
    """d(alpha Sigma)/dalpha; at a sharp switch the derivative to the right."""
    slope = contact_stress_slope(alpha, gamma, alpha_star, alpha_min, sigma_width)
    return contact_stress(alpha, gamma, alpha_star, alpha_min, sigma_width) + alpha * slope


def net_growth(alpha: Number, C: Number, s1: float, s2: float, s3: float, s4: float) -> Number:
    """Cells born less cells dying, ``q = (1+s1) C/(1+s1 C) alpha (1-alpha) - (s2+s3 C)/(1+s4 C) alpha`` (2.6).

    The paper prints ``1 + s4`` in the last denominator; its sources have ``1 + s4 C``. For C < 0, where an iteration and a coarse mesh may
    pass, births and deaths go on along their tangents at 0: the laws' own branches have poles at C = -1/s1 and -1/s4.
    """
    has, lacks = np.maximum(C, 0.0), np.minimum(C, 0.0)
    birth = (1.0 + s1) * (has / (1.0 + s1 * has) + lacks)
    death = (s2 + s3 * has) / (1.0 + s4 * has) + (s3 - s2 * s4) * lacks
    growth: Number = alpha * (birth * (1.0 - alpha) - death)
    return growth


def net_growth_slopes(alpha: Number, C: Number, s1: float, s2: float, s3: float, s4: float) -> tuple[Number, Number]:
    """Derivatives of `net_growth` with respect to alpha and C."""
    has, lacks = np.maximum(C, 0.0), np.minimum(C, 0.0)
    below_birth, below_death = 1.0 + s1 * has, 1.0 + s4 * has
    birth = (1.0 + s1) * (has / below_birth + lacks)
    death = (s2 + s3 * has) / below_death + (s3 - s2 * s4) * lacks
    birth_slope = (1.0 + s1) / (below_birth * below_birth)
    death_slope = (s3 - s2 * s4) / (below_death * below_death)
    return birth * (1.0 - 2.0 * alpha) - death, alpha * (birth_slope * (1.0 - alpha) - death_slope)


def homeostatic_fraction(C: Number, s1: float, s2: float, s3: float, s4: float) -> Number:
    """Cell fraction at which births and deaths balance (2.6) at oxygen C > 0; 0 or less where cells die at every fraction."""
    return 1.0 - (s2 + s3 * C) * (1.0 + s1 * C) / ((1.0 + s4 * C) * (1.0 + s1) * C)


def critical_oxygen(alpha: float, s1: float, s2: float, s3: float, s4: float) -> float:
    """Oxygen C* from which cells at fraction alpha multiply; below it, they die out. For the paper's constants 5/17 at alpha = 0.8.

    Net growth (2.6) has the sign of ``a C^2 + b C - s2`` with ``B = (1+s1)(1-alpha)``, ``a = B s4 - s1 s3``, ``b = B - s3 - s1 s2``.
    C* is its lowest zero with growth above it: 0 where cells multiply at any trace of oxygen, NaN where they never do.
    (Where a < 0 they also die beyond a second, higher zero.)
    """
    B = (1.0 + s1) * (1.0 - alpha)
    a = B * s4 - s1 * s3
    b = B - s3 - s1 * s2
    square = b * b + 4.0 * a * s2
    if square < 0.0:
        return np.nan
    root = np.sqrt(square)
    if b > 0.0:  # the form of the root that does not cancel
        return float(2.0 * s2 / (b + root))
    return float((root - b) / (2.0 * a)) if a > 0.0 else np.nan


def oxygen_uptake(alpha: Number, C: Number, Q: float, Q1_hat: float) -> Number:
    """Oxygen that the cells take up, ``Q alpha C/(1 + Q1_hat C)``: the sink -q_C of section 2.1. Linear for C < 0, where an iteration may
    pass: the law's own branch beyond C = -1/Q1_hat would lead it to another, meaningless solution."""
    taken: Number = Q * alpha * C / (1.0 + Q1_hat * np.maximum(C, 0.0))
    return taken


def oxygen_uptake_slopes(alpha: Number, C: Number, Q: float, Q1_hat: float) -> tuple[Number, Number]:
    """Derivatives of `oxygen_uptake` with respect to alpha and C."""
    below = 1.0 + Q1_hat * np.maximum(C, 0.0)
    return Q * C / below, Q * alpha / (below * below)


def mobility(alpha: Number, kappa: float, law: int, floor: float) -> Number:
    """Volume of fluid that flows per pressure gradient, M.

    Parameters
    ----------
    alpha : float or array
    kappa : float
        Drag between cells and fluid, greater than 0.
    law : int
        DARCY, ``(1-alpha)/(kappa alpha)``, which follows from (2.13); PRINTED, ``1/(floor + kappa alpha)`` with floor 0 in (2.16), (2.17)
        and (2.22c); CONSTANT, ``1/kappa``.
    floor : float
        Keeps the printed law finite where there are no cells.
    """
    if law == DARCY:
        return (1.0 - alpha) / (kappa * alpha)
    if law == PRINTED:
        return 1.0 / (floor + kappa * alpha)
    return 1.0 / kappa + 0.0 * alpha


def mobility_slope(alpha: Number, kappa: float, law: int, floor: float) -> Number:
    """dM/dalpha."""
    if law == DARCY:
        return -1.0 / (kappa * alpha * alpha)
    if law == PRINTED:
        return -kappa / ((floor + kappa * alpha) * (floor + kappa * alpha))
    return 0.0 * alpha


def resistance(alpha: Number, kappa: float, law: int, floor: float) -> Number:
    """1/M, finite where kappa or alpha is 0. kappa = 0 stands for a fluid that flows freely: 1/M = 0 in every law, whatever the floor."""
    if kappa == 0.0:
        return 0.0 * alpha
    if law == DARCY:
        return kappa * alpha / (1.0 - alpha)
    if law == PRINTED:
        return floor + kappa * alpha
    return kappa + 0.0 * alpha


def resistance_slope(alpha: Number, kappa: float, law: int, floor: float) -> Number:
    """d(1/M)/dalpha."""
    if law == DARCY:
        return kappa / ((1.0 - alpha) * (1.0 - alpha))
    if law == PRINTED:
        return kappa + 0.0 * alpha
    return 0.0 * alpha


def volume_ratio(l_r: Number, l_t: Number, m: int) -> Number:
    """J = l_r l_t^(m-1), the volume of the body's element over that at rest."""
    if m == 1:
        return l_r
    if m == 2:
        return l_r * l_t
    return l_r * l_t * l_t


def elastic_energy(l_r: Number, l_t: Number, m: int, mu: float, lam: float) -> Number:
    """Energy per volume at rest of the neo-Hookean cells of section 2.2,
    ``W = mu/2 (l_r^2 + (m-1) l_t^2 - m - 2 ln J) + lam/2 (J-1)^2``."""
    J = volume_ratio(l_r, l_t, m)
    energy: Number = 0.5 * mu * (l_r * l_r + (m - 1) * l_t * l_t - m - 2.0 * np.log(J)) + 0.5 * lam * (J - 1.0) * (J - 1.0)
    return energy


def elastic_stress(l_r: Number, l_t: Number, m: int, mu: float, lam: float) -> tuple[Number, Number]:
    """Elastic first Piola-Kirchhoff stress along and across the radius, ``P_i = mu (l_i - 1/l_i) + lam J (J-1)/l_i`` (section 2.2).

    It is what the energy gives: ``P_r = dW/dl_r`` and ``(m-1) P_t = dW/dl_t``, all stretches across the radius moving together.
    """
    J = volume_ratio(l_r, l_t, m)
    volumetric = lam * J * (J - 1.0)
    return mu * (l_r - 1.0 / l_r) + volumetric / l_r, mu * (l_t - 1.0 / l_t) + volumetric / l_t


def elastic_stress_slopes(l_r: Number, l_t: Number, m: int, mu: float, lam: float) -> tuple[Number, Number, Number, Number]:
    """dP_r/dl_r, dP_r/dl_t, dP_t/dl_r and dP_t/dl_t, all stretches across the radius moving together."""
    J = volume_ratio(l_r, l_t, m)
    mixed = lam * (2.0 * J - 1.0) * J / (l_r * l_t)
    radial = mu + (mu + lam * J * J) / (l_r * l_r)
    hoop = mu + (mu + lam * J * ((m - 1) * (2.0 * J - 1.0) - (J - 1.0))) / (l_t * l_t)
    return radial, (m - 1) * mixed, mixed, hoop


def viscous_stress(alpha: Number, e_r: Number, e_t: Number, m: int, mu: float, lam: float) -> tuple[Number, Number]:
    """Viscous stress of the cells along and across the radius, ``2 mu alpha e_i + lam alpha tr e`` (2.4), ``tr e = e_r + (m-1) e_t``.

    e_r = u' and e_t = u/r are the rates of strain. The last summary of (2.4) prints ``lam (div u) I`` without its alpha.
    """
    volumetric = lam * alpha * (e_r + (m - 1) * e_t)
    return 2.0 * alpha * mu * e_r + volumetric, 2.0 * alpha * mu * e_t + volumetric


def viscous_stress_slopes(
    alpha: Number, e_r: Number, e_t: Number, m: int, mu: float, lam: float
) -> tuple[Number, Number, Number, Number, Number, Number]:
    """Derivatives of the stress along the radius with respect to alpha, e_r and e_t, then those of the stress across it."""
    volumetric = lam * (e_r + (m - 1) * e_t)
    own, other = alpha * (2.0 * mu + lam), alpha * lam
    return (
        2.0 * mu * e_r + volumetric, own, (m - 1) * other,
        2.0 * mu * e_t + volumetric, other, 2.0 * mu * alpha + (m - 1) * other,
    )  # fmt: skip


def free_expansion_rate(alpha: Number, stress: Number, p_out: float, m: int, mu: float, lam: float) -> Number:
    """Rate R'/R of a uniform viscous body with traction-free surface, from (2.4): ``alpha Sigma + p_out = alpha (2 mu + m lam) R'/R``."""
    return (stress + p_out / alpha) / (2.0 * mu + m * lam)
