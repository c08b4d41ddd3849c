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
        Points of each triangle, counterclockwise; those that are given clockwise are turned around.
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
        clockwise = self.areas() < 0.0
        if np.any(clockwise):
            object.__setattr__(self, "triangles", np.where(clockwise[:, None], self.triangles[:, [0, 2, 1]], self.triangles))

    def areas(self) -> NDArray[np.float64]:
        """Area of each triangle at rest."""
        a, b, c = (self.points[self.triangles[:, corner]] for corner in range(3))
        one, other = b - a, c - a
        return np.asarray(0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))

    def point_areas(self) -> NDArray[np.float64]:
        """Area that belongs to each point at rest, a third of each of its triangles; they add up to the area of the body."""
        thirds = np.repeat(self.areas() / 3.0, 3)
        return np.asarray(np.bincount(self.triangles.ravel(), weights=thirds, minlength=len(self.points)), dtype=float)

    def size(self) -> float:
        """Larger side of the box around the points at rest."""
        return float(np.max(np.ptp(self.points, axis=0), initial=0.0)) if len(self.points) else 0.0

    def equals(self, other: Mesh | None) -> bool:
        """Whether another mesh has the same points and triangles, bit for bit."""
        return other is not None and np.array_equal(self.points, other.points) and np.array_equal(self.triangles, other.triangles)
