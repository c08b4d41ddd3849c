"""What a model says of a result so that it can be compared with one of another dimension, shape or material."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFields:
    """Fields of a round body at some times, averaged over rings of the body at rest.

    Attributes
    ----------
    means : mapping of str to (times, rings) array
        Averages by name, of vectors of their radial part.
    rms, largest : mapping of str to (times, rings) array
        Scatter round each ring: root mean square of the deviation from the mean round it, and the largest deviation. Empty for a
        result that depends on the distance from the middle alone.
    why_not : tuple of str
        Why the averages do not stand for the result: clauses such as "its initial alpha depends on theta".
    """

    means: Mapping[str, Array]
    rms: Mapping[str, Array] = field(default_factory=dict)
    largest: Mapping[str, Array] = field(default_factory=dict)
    why_not: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profiles:
    """What of a result can be compared with another one of the model.

    Attributes
    ----------
    material : str
        Words for the material, such as "elastic cells". Fields of two materials are not compared.
    body : str
        Words for the shape of the body, such as "a quarter disk".
    share : float
        The share of the whole body that is computed.
    shared : tuple of str
        Scalars that are proportional to it.
    sizes : tuple of str
        Scalars that measure the size of the body, each in bodies of its own dimension.
    positions : (cells,) array or None
        Relative positions of the cells of a one-dimensional body at rest, 0 to 1, where cells are followed as they move.
    place : str
        What these positions are called in a table.
    rings : callable(edges, rows) -> RingFields, or None
        Averages over the rings between relative `edges` at the stored times `rows`; None for a body that is not round.
    """

    material: str = ""
    body: str = ""
    share: float = 1.0
    shared: tuple[str, ...] = ()
    sizes: tuple[str, ...] = ()
    positions: Array | None = None
    place: str = "x/width"
    rings: Callable[[Array, Array], RingFields] | None = None
