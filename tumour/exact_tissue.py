"""Tissue that is the same everywhere in the plane: its numbers, and its stress where it is stretched along and across its fibres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]


class UniformTissue:
    """The numbers of a tissue that is the same everywhere.

    Parameters
    ----------
    parameters : TumourParameters
        With every function of position a number; tensors may be of any form that is made of numbers.

    Attributes
    ----------
    mu, lam : float
        Moduli, times the stiffness.
    rho, k_f : float
        Push of the cells along the fibres over that across; stiffness of the fibres.
    direction : ndarray (2,)
        Of the fibres.
    permeability, diffusivity : ndarray (2, 2)
        In the plane's coordinates.
    consumption : float

    Raises
    ------
    ParameterError
        Where a parameter varies in space.
    """

    def __init__(self, parameters: TumourParameters) -> None:
        stiffness = _number(parameters, "stiffness")
        self.mu, self.lam = (stiffness * modulus for modulus in parameters.moduli)
        self.rho, self.k_f = _number(parameters, "fibre_ratio"), _number(parameters, "fibre_stiffness")
        self.consumption = _number(parameters, "consumption")
        angle = _number(parameters, "fibre_angle")
        self.direction = np.array([np.cos(angle), np.sin(angle)])
        self.permeability, self.diffusivity = (_tensor(parameters, name, angle) for name in ("permeability", "diffusivity"))


def _number(parameters: TumourParameters, name: str) -> float:
    value = getattr(parameters, name).constant
    if value is None:
        raise ParameterError(f"parameters.{name}", "varies in space; this exact solution needs one number for all of the body.")
    return float(value)


def _tensor(parameters: TumourParameters, name: str, angle: float) -> Array:
    function = getattr(parameters, name)
    if any(part.constant is None for part in function.parts):
        raise ParameterError(f"parameters.{name}", "varies in space; this exact solution needs the same numbers in all of the body.")
    xx, yy, xy = function(angle, **dict.fromkeys(("r", "xi", "x", "y", "theta"), 0.0))
    return np.array([[xx, xy], [xy, yy]])


def uniform_stress(tissue: UniformTissue, along: float, across: float, contact: float) -> tuple[float, float]:
    """First Piola-Kirchhoff stress along and across the fibres of a body stretched along and across them, without fluid pressure.

    ``P_along = mu (l_1 - 1/l_1) + lambda (J-1) l_2 - rho alpha Sigma l_2 + 2 k_f (l_1^2 - 1) l_1`` and ``P_across = mu (l_2 - 1/l_2) +
    lambda (J-1) l_1 - alpha Sigma l_1``.

    Parameters
    ----------
    tissue : UniformTissue
    along, across : float
        Stretches l_1 and l_2.
    contact : float
        alpha Sigma.
    """
    volumetric = tissue.lam * (along * across - 1.0)
    P_along = tissue.mu * (along - 1.0 / along) + (volumetric - tissue.rho * contact) * across
    P_across = tissue.mu * (across - 1.0 / across) + (volumetric - contact) * along
    return P_along + 2.0 * tissue.k_f * (along * along - 1.0) * along, P_across


def shear_stiffness(tissue: UniformTissue, along: float, across: float, contact: float) -> float:
    r"""Stiffness against layers across the fibres sliding over each other, along their faces, of a body stretched along and across them:

        m mu + 2 k_f (l_1^2 - 1) - (rho-1) alpha Sigma l_2/l_1.

    Where it is 0 or less the equations of the stresses are no longer elliptic: fibres that are pushed along, or shortened, buckle into
    bands as narrow as the mesh allows, whatever lambda is. A body that grows freely, with both of `uniform_stress` 0, keeps ``m mu
    l_2^2/l_1^2``; one that is confined loses it where ``(rho-1) alpha Sigma`` comes to exceed m mu.

    Parameters
    ----------
    tissue : UniformTissue
    along, across, contact : float
        As in `uniform_stress`.
    """
    return tissue.mu + 2.0 * tissue.k_f * (along * along - 1.0) - (tissue.rho - 1.0) * contact * across / along
