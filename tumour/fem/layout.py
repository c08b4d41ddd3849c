"""Where things are in the vectors and the matrix of a mesh: shape functions, prescribed unknowns, the matrix's pattern, rigid motions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from skfem import MeshTri
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from tumour.fem.arrays import FIELDS, Edges, Elements, Pattern

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

DEGREE = 4
"""Degree of the polynomials that the quadrature integrates exactly."""


def elements_of(mesh: MeshTri) -> Elements:
    """Triangles, gradients of the linear shape functions, areas, and the rule of quadrature."""
    triangles = np.ascontiguousarray(mesh.t.T, dtype=np.int64)
    corners = mesh.p.T[triangles]
    edges = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # opposite to each corner
    twice = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    gradients = np.stack([-edges[:, :, 1], edges[:, :, 0]], axis=2) / twice[:, None, None]
    places, weights = get_quadrature(RefTri, DEGREE)
    points = np.column_stack([1.0 - places[0] - places[1], places[0], places[1]])
    return Elements(triangles, np.ascontiguousarray(gradients), 0.5 * twice, np.ascontiguousarray(points), weights / np.sum(weights))


def no_edges() -> Edges:
    """A surface on which nothing acts."""
    none, numbers = np.zeros(0), np.zeros(0, dtype=np.int64)
    return Edges(numbers, numbers, numbers, none, np.zeros((0, 2)), np.zeros((0, 2)), none)


def mass_matrix(elements: Elements, count: int) -> Any:
    """Integrals of products of the linear shape functions, in compressed rows."""
    local = (np.ones((3, 3)) + np.eye(3)) / 12.0
    values = elements.areas[:, None, None] * local
    rows, columns = np.repeat(elements.triangles, 3, axis=1), np.tile(elements.triangles, (1, 3))
    return sparse.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))


@dataclass(frozen=True, slots=True)
class Rows:
    """Compressed rows over the unknowns that are not prescribed, numbered point by point.

    Attributes
    ----------
    free : (unknowns,) array of int
        Their places among all 5 unknowns of each point.
    indptr, indices : arrays of int32
    pattern : Pattern
        The same for the kernel.
    """

    free: Integers
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    pattern: Pattern


def rows_of(elements: Elements, prescribed: NDArray[np.bool_]) -> Rows:
    """The matrix of a mesh without its prescribed unknowns, (points, 5).

    Raises
    ------
    MemoryError
        When the entries are too many for 32-bit indices.
    """
    count = len(prescribed)
    triangles = elements.triangles
    pairs_i, pairs_j = np.repeat(triangles, 3, axis=1), np.tile(triangles, (1, 3))
    graph = sparse.csr_matrix((np.ones(pairs_i.size, dtype=np.int8), (pairs_i.ravel(), pairs_j.ravel())), shape=(count, count))
    graph.sum_duplicates()
    graph.sort_indices()
    unknowns = np.sum(~prescribed, axis=1)  # of each point
    rank = np.where(prescribed, -1, np.cumsum(~prescribed, axis=1) - 1)
    first = np.concatenate([[0], np.cumsum(unknowns)])  # number of the first unknown of a point
    widths = unknowns[graph.indices]
    within = np.cumsum(widths) - widths
    within -= np.repeat(within[np.minimum(graph.indptr[:-1], len(within) - 1)], np.diff(graph.indptr))
    lengths = np.add.reduceat(widths, graph.indptr[:-1])
    row_lengths = np.repeat(lengths, unknowns)
    total = int(np.sum(row_lengths))
    if total > np.iinfo(np.int32).max:
        raise MemoryError(f"{total} entries of the matrix are too many")
    indptr = np.concatenate([[0], np.cumsum(row_lengths)])
    start = np.full(prescribed.shape, -1, dtype=np.int64)
    start[~prescribed] = indptr[:-1]
    # Where in the graph the pair (a, b) of each triangle is: the graph's rows are sorted, so keys are, too.
    keys = np.repeat(np.arange(count), np.diff(graph.indptr)) * np.int64(count) + graph.indices
    place = np.searchsorted(keys, pairs_i.astype(np.int64) * count + pairs_j)
    indices = np.empty(total, dtype=np.int32)
    for k in range(FIELDS):
        rows = ~prescribed[:, k]
        for l in range(FIELDS):
            entries = np.flatnonzero(np.repeat(rows, np.diff(graph.indptr)) & ~prescribed[graph.indices, l])
            row = np.repeat(np.arange(count), np.diff(graph.indptr))[entries]
            column = graph.indices[entries]
            indices[start[row, k] + within[entries] + rank[column, l]] = first[column] + rank[column, l]
    pattern = Pattern(start, within[place].astype(np.int32), rank.astype(np.int32))
    return Rows(np.flatnonzero(~prescribed.ravel()), indptr.astype(np.int32), indices, pattern)


class RigidMotions:
    """The rigid motions that a body is free to make, and their removal.

    The equations do not change when the deformed body is moved rigidly, so which of these positions it takes is free: that in which the
    displacement is orthogonal to all rigid motions of the body at rest, ``(d, 1) = 0`` and ``(d, X^perp) = 0``. The matrix has no row for
    this: a few unknowns are held while it is solved (`held`), which holds the body without any force, and every new displacement is then
    moved rigidly to its place (`align`).

    Parameters
    ----------
    elements : Elements
    points : (points, 2) array
    shifts : (2,) array of bool
        Whether the body is free to shift in x and in y.
    turns : bool
        Whether it is free to turn; then it is free to shift in both.
    """

    def __init__(self, elements: Elements, points: Array, shifts: NDArray[np.bool_], turns: bool) -> None:
        self.points, self.shifts, self.turns = points, shifts, turns
        self.held = np.zeros(points.shape, dtype=bool)
        mass = mass_matrix(elements, len(points))
        self._weights = np.asarray(mass.sum(axis=1)).ravel()
        self._area = float(np.sum(self._weights))
        self.middle = self._weights @ points / self._area
        self._bubbles = 9.0 / 20.0 * elements.areas  # integrals of 27 l0 l1 l2
        self._arms = points - self.middle
        self._weighted_arms = mass @ self._arms
        self._bubble_arms = self._bubbles[:, None] * (points[elements.triangles].mean(axis=1) - self.middle)
        if self.shifts.any():
            self._hold(points)

    def _hold(self, points: Array) -> None:
        """Hold the point next to the middle, and against turning the one farthest from it."""
        middle = int(np.argmin(np.sum(self._arms**2, axis=1)))
        self.held[middle] = self.shifts
        if self.turns:
            arms = points - points[middle]
            far = int(np.argmax(np.sum(arms**2, axis=1)))
            self.held[far, int(np.argmin(np.abs(arms[far])))] = True

    def align(self, displacement: Array, bubbles: Array) -> None:
        """Move the deformed body rigidly, in place, to where its displacement is orthogonal to the rigid motions."""
        if not self.shifts.any():
            return
        shift = (self._weights @ displacement + self._bubbles @ bubbles) / self._area
        displacement -= np.where(self.shifts, shift, 0.0)
        if not self.turns:
            return
        along = np.sum(self._weighted_arms * (self._arms + displacement)) + np.sum(self._bubble_arms * bubbles)
        across = self._cross(self._weighted_arms, self._arms + displacement) + self._cross(self._bubble_arms, bubbles)
        size = np.hypot(along, across)
        c, s = along / size, -across / size  # the rotation that undoes the mean one
        turn = np.array([[c, s], [-s, c]])  # rows of vectors are turned by its transpose
        displacement += (self._arms + displacement) @ (turn - np.eye(2))
        bubbles[:] = bubbles @ turn

    @staticmethod
    def _cross(a: Array, b: Array) -> float:
        return float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
