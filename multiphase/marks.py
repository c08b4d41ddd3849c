"""What the pictures of a body show besides its fields: directions of its material, parts of its surface, properties at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of the surface.

    Attributes
    ----------
    edges : (n, 2) array of int
        Its edges, as points of the mesh.
    words : str
        What acts on it, in a few words; empty to say nothing.
    """

    edges: Numbers
    words: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Property:
    """Something that is given all over the body at rest.

    Attributes
    ----------
    label : str
        Words, symbol (between $) and unit.
    values : (points,) array
        Of a tensor the mean of its principal values.
    directions : (points, 2) array or None
        Of a tensor, unit vectors along the larger principal value, not a number where both are equal; None where they are everywhere.
    """

    label: str
    values: Array
    directions: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """What pictures show of a result in two dimensions besides its fields.

    Attributes
    ----------
    directions : (points, 2) array or None
        Directions of the material in the body at rest at the points of the mesh, such as fibres: unit vectors, whose sense does not
        matter; they move with the body.
    name : str
        What the directions are, for the legend.
    parts : mapping of str to Part
        By name; later ones lie above.
    properties : mapping of str to Property
    """

    directions: Array | None = None
    name: str = "fibres"
    parts: Mapping[str, Part] = field(default_factory=dict)
    properties: Mapping[str, Property] = field(default_factory=dict)
