"""Properties of the tissue at the quadrature points of a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from tumour.equations import MOBILITIES
from tumour.fem.arrays import (
    COEFFICIENTS,
    CONSUMPTION,
    DIFFUSIVITY,
    FIBRE,
    PERMEABILITY,
    PUSH,
    REINFORCEMENT,
    STIFFNESS,
    Data,
    Elements,
)
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]


def data_of(parameters: TumourParameters, elements: Elements, points: Array, radius: float, *, printed: bool = False) -> Data:
    """What the kernel needs of a scene on a mesh.

    Parameters
    ----------
    parameters : TumourParameters
    elements : Elements
    points : (points, 2) array
    radius : float
        Of the body, which xi is measured by.
    printed : bool
        The step of the paper's program.

    Raises
    ------
    ParameterError
        Naming a property that is out of its range somewhere in the body, and where.
    """
    p = parameters
    x, y = np.moveaxis(np.einsum("qa,eai->eqi", elements.points, points[elements.triangles]).reshape(-1, 2), 1, 0)
    uniform = is_uniform(p)
    tissue = coefficients(p, x[:1], y[:1], radius) if uniform else coefficients(p, x, y, radius)
    return Data(
        *p.moduli, *p.contact, *p.kinetics, *p.uptake, p.kappa, MOBILITIES[p.mobility], p.mobility_floor, printed,
        tissue, 0 if uniform else 1, not (p.permeability.is_isotropic and p.diffusivity.is_isotropic),
        bool(np.any(tissue[:, [PUSH, REINFORCEMENT]])),
    )  # fmt: skip


def is_uniform(parameters: TumourParameters) -> bool:
    """Whether the tissue is the same everywhere, as far as can be seen from how it is given."""
    p = parameters
    scalars = (p.stiffness, p.consumption, p.fibre_angle, p.fibre_ratio, p.fibre_stiffness)
    return all(function.constant is not None for function in (*scalars, *p.permeability.parts, *p.diffusivity.parts))


def coordinates(x: Array, y: Array, radius: float) -> dict[str, Array]:
    """What a function of position may use at the points (x, y) of the body at rest."""
    r = np.hypot(x, y)
    return {"r": r, "xi": r / radius, "x": x, "y": y, "theta": np.arctan2(y, x)}


def coefficients(parameters: TumourParameters, x: Array, y: Array, radius: float) -> Array:
    """The rows of tissue, (n, COEFFICIENTS), at the points (x, y), (n,), of the body at rest."""
    p = parameters
    at = coordinates(x, y, radius)
    rows = np.empty((len(x), COEFFICIENTS))
    angle = p.fibre_angle(**at)
    rows[:, FIBRE], rows[:, FIBRE + 1] = np.cos(angle), np.sin(angle)
    rows[:, STIFFNESS] = _at_least(p, "stiffness", at, open_below=True)
    rows[:, PERMEABILITY : PERMEABILITY + 3] = p.permeability(angle, **at)
    rows[:, DIFFUSIVITY : DIFFUSIVITY + 3] = p.diffusivity(angle, **at)
    rows[:, CONSUMPTION] = _at_least(p, "consumption", at)
    rows[:, PUSH] = _at_least(p, "fibre_ratio", at) - 1.0
    rows[:, REINFORCEMENT] = _at_least(p, "fibre_stiffness", at)
    return rows


def _at_least(parameters: TumourParameters, name: str, at: dict[str, Array], *, open_below: bool = False) -> Array:
    """A property that must not be negative (or 0) anywhere."""
    function: Any = getattr(parameters, name)
    values: Array = function(**at)
    bad = values <= 0.0 if open_below else values < 0.0
    if bad.any():
        i = int(np.argmin(values))
        bound = "greater than 0" if open_below else "0 or more"
        raise ParameterError(
            f"parameters.{name}", f"it is {values[i]:.6g} at ({at['x'][i]:.6g}, {at['y'][i]:.6g}); it must be {bound} all over the body."
        )
    return values
