"""What brings two results to common times and places: equal times, relative positions of cells, the nodes of one mesh."""

from __future__ import annotations

import numpy as np

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import Array, Result

SAME_TIME = 1e-12
"""Stored times are exact, so common ones differ by rounding of the user's own arithmetic (0.1 * 3) only; relative."""

SAME_POSITION = 1e-9
"""Cells of two runs count as equal in relative position within this: far above rounding (1e-16), far below any cell."""

SAME_NODE = 1e-12
"""Nodes of two meshes count as equal within this, relative to the size of the body: generators of meshes round in their own ways."""

OUTSIDE = 0.5
"""How far outside of a mesh nodes of another mesh of the same body may be, in its longest edges: an edge cuts off less of a curved
boundary, about an eighth of its own length times its length over the radius."""


def common_times(a: Array, b: Array) -> tuple[Array, Array]:
    """Indices of the times that `a` and `b` (both ascending) have in common."""
    if not len(a) or not len(b):
        none = np.zeros(0, dtype=int)
        return none, none
    right = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(b[left] - a) < np.abs(b[right] - a), left, right)
    common = np.abs(b[nearest] - a) <= SAME_TIME * np.maximum(np.abs(a), np.abs(b[nearest]))
    return np.flatnonzero(common), nearest[common]


class Positions:
    """Brings fields of two results to the relative positions `xi` (times, cells) of the coarser one.

    Parameters
    ----------
    a, b : Result
    rows_a, rows_b : ndarray
        The common times.
    at_rest : (ndarray or None, ndarray or None)
        Relative positions of the cells at rest, which are used instead of those at each time.
    """

    def __init__(
        self, a: Result, b: Result, rows_a: Array, rows_b: Array, at_rest: tuple[Array | None, Array | None] = (None, None)
    ) -> None:
        xi_a, xi_b = _relative(a, rows_a, at_rest[0]), _relative(b, rows_b, at_rest[1])
        self.xi: Array | None = None
        self.from_a: Array | None = None  # where a's values stand, when they are to be interpolated
        self.from_b: Array | None = None
        if xi_a is None or xi_b is None:
            return
        if xi_a.shape == xi_b.shape and np.allclose(xi_a, xi_b, rtol=0, atol=SAME_POSITION, equal_nan=True):
            self.xi = xi_a
        elif xi_a.shape[1] > xi_b.shape[1]:
            self.xi, self.from_a = xi_b, xi_a
        else:
            self.xi, self.from_b = xi_a, xi_b

    def bring_together(self, name: str, a: Array, b: Array) -> tuple[Array, Array]:
        if self.xi is not None:
            a = a if self.from_a is None else _interpolate(self.xi, self.from_a, a)
            b = b if self.from_b is None else _interpolate(self.xi, self.from_b, b)
        if a.shape != b.shape:
            raise ParameterError(
                "", f"the field {name!r} stands on different meshes, {a.shape[1:]} and {b.shape[1:]}: compare equal meshes."
            )
        return a, b


class OnOneMesh:
    """Brings fields of `b` to the nodes of `a`; without `nodes` they cannot be compared, and `note` says why."""

    def __init__(self, a: Result, b: Result) -> None:
        self.nodes: Mesh | None = None
        self.note = ""
        self._weights: tuple[Array, Array] | None = None
        if a.mesh is None or b.mesh is None:
            side, other = ("A", "B") if b.mesh is None else ("B", "A")
            self.note = f"fields are not compared: {side} is on a mesh, {other} is not"
            return
        limit = SAME_NODE * max(a.mesh.size(), b.mesh.size())
        if np.array_equal(a.mesh.triangles, b.mesh.triangles) and np.allclose(a.mesh.points, b.mesh.points, rtol=0.0, atol=limit):
            self.nodes = a.mesh
            return
        corners, weights, off = locate(b.mesh, a.mesh.points)
        if max(off / _longest_edge(b.mesh), locate(a.mesh, b.mesh.points)[2] / _longest_edge(a.mesh)) > OUTSIDE:
            self.note = "fields are not compared: the meshes are of different bodies"
            return
        self.nodes, self._weights = a.mesh, (corners, weights)
        self.note = f"different meshes: fields of B ({b.size()}) are interpolated linearly to the nodes of A ({a.size()})"

    def to_a(self, values: Array) -> Array:
        if self._weights is None:
            return values
        corners, weights = self._weights
        shape = (1, -1, *[1] * (values.ndim - 2))
        return np.asarray(sum(weights[:, k].reshape(shape) * values[:, corners[:, k]] for k in range(3)))


def locate(mesh: Mesh, points: Array) -> tuple[Array, Array, float]:
    """Corners (points, 3) of the triangle that each point is in or nearest to, their weights (points, 3), and the largest distance."""
    from matplotlib.tri import Triangulation

    triangulation = Triangulation(mesh.points[:, 0], mesh.points[:, 1], mesh.triangles)
    found = np.array(triangulation.get_trifinder()(*points.T))
    outside = np.flatnonzero(found < 0)
    largest = 0.0
    if len(outside):
        owner, corner = np.nonzero(triangulation.neighbors < 0)
        start, end = mesh.points[mesh.triangles[owner, corner]], mesh.points[mesh.triangles[owner, (corner + 1) % 3]]
        along = end - start
        for point in outside:
            share = np.clip(np.sum((points[point] - start) * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
            distance = np.hypot(*(points[point] - start - share[:, None] * along).T)
            nearest = int(np.argmin(distance))
            found[point], largest = owner[nearest], max(largest, float(distance[nearest]))
    corners = mesh.triangles[found]
    first, second, third = (mesh.points[corners[:, k]] for k in range(3))
    one, other, offset = second - first, third - first, points - first
    twice_area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    of_second = (offset[:, 0] * other[:, 1] - offset[:, 1] * other[:, 0]) / twice_area
    of_third = (one[:, 0] * offset[:, 1] - one[:, 1] * offset[:, 0]) / twice_area
    return corners, np.stack([1.0 - of_second - of_third, of_second, of_third], axis=1), largest


def _longest_edge(mesh: Mesh) -> float:
    corners = mesh.points[mesh.triangles]
    return float(np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


def _relative(result: Result, rows: Array, at_rest: Array | None) -> Array | None:
    if at_rest is not None:
        return np.broadcast_to(at_rest, (len(rows), len(at_rest)))
    width = result.width()
    if result.x is None or width is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):  # a failed run may hold a width of 0 or NaN
        return np.asarray(result.x[rows] / width[rows, None])


def _interpolate(xi: Array, known: Array, values: Array) -> Array:
    return np.array([np.interp(*row) for row in zip(xi, known, values, strict=True)])
