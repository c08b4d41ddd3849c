"""Places evenly spread over a body, and what fields on its triangles are there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multiphase.plotting.view import Array, Body


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Places within triangles of a body, which they move with.

    Attributes
    ----------
    corners : (places, 3) array of int
        Points of the triangle of each place.
    shares : (places, 3) array
        Weights of these points.
    step : float
        How far neighbours were apart when the places were chosen.
    """

    corners: NDArray[np.int64]
    shares: Array
    step: float

    def of(self, values: Array) -> Array:
        """Values (points, ...) at the places, linear within the triangles."""
        there = values[self.corners]
        return np.asarray((self.shares.reshape(*there.shape[:2], *[1] * (there.ndim - 2)) * there).sum(axis=1))

    def some(self, chosen: NDArray[np.bool_]) -> Places:
        """Those of the places that are chosen."""
        return replace(self, corners=self.corners[chosen], shares=self.shares[chosen])


def places_over(body: Body, positions: Array, count: int) -> Places | None:
    """About `count` places evenly spread over the body with its points at `positions`: those of a lattice of equal triangles within it.

    None for a body that holds no such place: without area, or all length.
    """
    corners = positions[body.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = cross(first, second)
    area = 0.5 * float(np.sum(np.abs(twice)))
    if not area > 0.0:
        return None
    step = float(np.sqrt(2.0 / np.sqrt(3.0) * area / count))
    height = 0.5 * np.sqrt(3.0) * step
    low, high = corners.min(axis=1), corners.max(axis=1)
    (left, bottom), (right, top) = low.min(axis=0), high.max(axis=0)
    weights, triangles = [], []
    for line, y in enumerate(np.arange(bottom + 0.5 * height, top, height)):
        x = np.arange(left + (0.25 + 0.5 * (line % 2)) * step, right, step)
        crossed = np.flatnonzero((low[:, 1] <= y) & (y <= high[:, 1]) & (twice != 0.0))
        offset = np.column_stack([x, np.full_like(x, y)])[:, None, :] - corners[crossed, 0]
        b, c = cross(offset, second[crossed]) / twice[crossed], cross(first[crossed], offset) / twice[crossed]
        shares = np.stack([1.0 - b - c, b, c], axis=-1)
        within = np.asarray(np.all(shares >= -1e-9, axis=-1))
        hit = np.flatnonzero(within.any(axis=1))
        which = within[hit].argmax(axis=1)
        weights.append(shares[hit, which])
        triangles.append(crossed[which])
    if not sum(map(len, triangles)):
        return None
    return Places(body.triangles[np.concatenate(triangles)], np.concatenate(weights), step)


def spread_over(body: Body, positions: Array, values: Array, count: int) -> tuple[Array, Array, float] | None:
    """About `count` places evenly spread over the body, the values there, and how far neighbours are apart.

    Returns
    -------
    places, values : ndarray (places, 2), (places, ...)
    step : float
        None instead of the three for a body that holds no such place: see `places_over`.
    """
    found = places_over(body, positions, count)
    return None if found is None else (found.of(positions), found.of(values), found.step)


def cross(a: Array, b: Array) -> Array:
    """The component across the plane of the product of vectors."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def inside(points: Array, outline: Array) -> NDArray[np.bool_]:
    """Which points lie within closed lines, given as segments (edges, 2, 2): those from which a ray crosses them an odd number of times."""
    (x, y), (a, b) = points.T[:, :, None], outline.transpose(1, 2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = ((a[1] > y) != (b[1] > y)) & (x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
    return np.asarray(crossed.sum(axis=1) % 2 == 1)
