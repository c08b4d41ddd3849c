"""The triangles that the fields of a two-dimensional body live on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles of a body at rest; fields have one value for each of its points.

    Attributes
    ----------
    points : (points, 2) array of float
        Coordinates at rest.
    triangles : (triangles, 3) array of int
        Points of each triangle, counterclockwise.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", np.asarray(self.points, dtype=float))
        object.__setattr__(self, "triangles", np.asarray(self.triangles, dtype=np.int64))
        if self.points.ndim != 2 or self.points.shape[1] != 2:
            raise ParameterError("mesh.points", f"must have two columns, but their shape is {self.points.shape}.")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3:
            raise ParameterError("mesh.triangles", f"must have three columns, but their shape is {self.triangles.shape}.")
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(self.points):
            raise ParameterError("mesh.triangles", f"must number the {len(self.points)} points from 0.")
