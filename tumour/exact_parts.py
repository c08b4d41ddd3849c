r"""Exact solutions of the tumour in two dimensions with conditions on parts of its surface: strips, and a body under pressure.

A strip is a rectangle of length L along x whose left end is held in x and whose two long sides slide, ``d_y = 0``; everything happens at
its right end, and depends on x alone. Tissue is the same everywhere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from multiphase.errors import ParameterError
from tumour import equations as eq
from tumour.exact_tissue import UniformTissue, uniform_stress
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]


def strip_oxygen(
    x: ArrayLike, length: float, alpha: float, parameters: TumourParameters, *, stretch: float = 1.0, membrane: float = np.inf,
    influx: float | None = None,
) -> Array:  # fmt: skip
    r"""Oxygen in a strip of uniform cell fraction that is closed but for its right end, with an uptake that does not saturate.

    In the strip as it is, ``D C'' = k^2 D C`` with D the diffusivity along x and ``k^2 = w Q alpha/D``. C' = 0 at the left end makes it
    ``B cosh(k x)``; at the right end C is C_out, or ``D C' = h (C_out - C)`` behind a membrane, or ``D C'`` is a given influx.

    Parameters
    ----------
    x : array_like
        Distance from the left end at rest, 0 to `length`.
    length : float
        Of the strip at rest.
    alpha : float
        Cell fraction.
    parameters : TumourParameters
        Uniform in space, with Q > 0, Q1_hat = 0 and a diffusivity whose axes are x and y.
    stretch : float
        Length now over that at rest.
    membrane : float
        Permeability h of the membrane; without one, infinite.
    influx : float, optional
        Oxygen that enters the right end, in place of all else.

    Returns
    -------
    ndarray
        C, in the shape of x.
    """
    tissue = UniformTissue(parameters)
    D = float(tissue.diffusivity[0, 0])
    if abs(tissue.diffusivity[0, 1]) > 1e-12 * D or parameters.Q1_hat != 0.0 or parameters.Q * tissue.consumption == 0.0:
        raise ParameterError("parameters.diffusivity", "this exact solution needs xy = 0, Q1_hat = 0 and an uptake above 0.")
    k = np.sqrt(tissue.consumption * parameters.Q * alpha / D)
    end = k * stretch * length
    flux = D * k * np.tanh(end)  # D C' at the right end where C is 1 there
    behind = parameters.C_out / (1.0 + flux / membrane)
    at_end = behind if influx is None else influx / flux
    return np.asarray(at_end * np.cosh(k * stretch * np.asarray(x, dtype=float)) / np.cosh(end))


def pressed_strip(
    parameters: TumourParameters, alpha_0: float, *, traction: float = 0.0, load: float = 0.0, spring: float = 0.0, length: float = 1.0,
) -> tuple[float, float]:  # fmt: skip
    r"""Stretch and cell fraction of a strip with what acts at its right end, where the fluid leaves freely and no cells are born.

    The strip is stretched by l along x, and its width held. With alpha = alpha_0/l the stress along x is that of
    `tumour.exact_tissue.uniform_stress`, the fibres being along x or along y, and at the right end

        P_xx(l) = traction - load - spring (l - 1) L.

    A load is per length of the surface now, but the width does not change; of springs, both kinds add up here.

    Parameters
    ----------
    parameters : TumourParameters
        Uniform in space; kappa and p_out 0. Fibres, if any push or resist, along x or y.
    alpha_0 : float
        Cell fraction at rest.
    traction, load, spring : float
        At the right end: per length at rest, per length now, per length at rest and displacement.
    length : float
        L.

    Returns
    -------
    stretch, alpha : float
    """
    tissue = _drained(parameters)

    def excess(l: float) -> float:
        contact = float(eq.contact_pressure(alpha_0 / l, *parameters.contact))
        P = uniform_stress(tissue, l, 1.0, contact)[0] if _along_x(tissue) else uniform_stress(tissue, 1.0, l, contact)[1]
        return P - traction + load + spring * (l - 1.0) * length

    l = _increasing_root(excess, alpha_0 * (1.0 + 1e-9))
    return l, alpha_0 / l


def pressed_body(parameters: TumourParameters, alpha_0: float, load: float) -> tuple[float, float]:
    r"""Stretch and cell fraction of a free body of any shape under the same pressure all round; the fluid leaves freely, no cells are born.

    Without fibres the body keeps its shape: F = l I, and ``P(l) = -load l``, where l is the length of the surface over that at rest.

    Parameters
    ----------
    parameters : TumourParameters
        Uniform in space; kappa and p_out 0, fibre_ratio 1, fibre_stiffness 0.
    alpha_0 : float
        Cell fraction at rest.
    load : float
        Pressure on the surface, per length now.

    Returns
    -------
    stretch, alpha : float
    """
    tissue = _drained(parameters)
    if tissue.rho != 1.0 or tissue.k_f != 0.0:
        raise ParameterError("parameters.fibre_ratio", "this exact solution is for a body without fibres.")

    def excess(l: float) -> float:
        contact = float(eq.contact_pressure(alpha_0 / l**2, *parameters.contact))
        return uniform_stress(tissue, l, l, contact)[0] / l + load

    l = _increasing_root(excess, float(np.sqrt(alpha_0)) * (1.0 + 1e-9))
    return l, alpha_0 / l**2


def _drained(parameters: TumourParameters) -> UniformTissue:
    for name in ("kappa", "p_out"):
        value = getattr(parameters, name)
        if value != 0.0:
            raise ParameterError(f"parameters.{name}", f"{value:g} is not allowed in this exact solution; it must be 0.")
    return UniformTissue(parameters)


def _along_x(tissue: UniformTissue) -> bool:
    """Whether fibres are along x, rather than along y."""
    x, y = np.abs(tissue.direction)
    if min(x, y) > 1e-12 and (tissue.rho != 1.0 or tissue.k_f != 0.0):
        raise ParameterError("parameters.fibre_angle", "the fibres of a strip must be along x or y in this exact solution.")
    return bool(x > y)


def _increasing_root(function: Callable[[float], float], low: float) -> float:
    """The zero of a function that goes from -infinity at `low` to infinity."""
    high = 2.0 * max(low, 1.0)
    while function(high) < 0.0:
        high *= 2.0
    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-15))
