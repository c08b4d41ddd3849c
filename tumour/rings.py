r"""Integrals over rings of a round body of fields that are linear in its triangles, and values on circles.

The part of a triangle within a circle around the origin is bounded by straight pieces and arcs. Its area and its moments of order one
and two are sums over the directed edges a -> b of those of the part of the triangle (0, a, b) within the circle: at most one triangle
between two sectors. A ring is the difference of two circles, so integrals over rings of linear fields, and of those times x or y, are exact
to rounding. An edge of the surface stands for the arc between its ends; the field is continued linearly to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from multiphase.compare.places import locate
from multiphase.mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

ON_SURFACE = 1e-9
"""Relative distance within which a point lies on the surface of the disk: far above rounding, far below any triangle."""

SAMPLES = 4
"""Places on a circle for each edge of the surface: four see all of a field that is linear in each triangle but its kinks."""


@dataclass(frozen=True, slots=True, eq=False)
class RoundMesh:
    """Triangles of a disk, or of a quarter of it, around the origin.

    Attributes
    ----------
    mesh : Mesh
    quarter : bool
        Whether it is the part x, y >= 0.
    """

    mesh: Mesh
    quarter: bool = False

    @property
    def radius(self) -> float:
        """Radius of the disk."""
        return float(np.max(np.hypot(*self.mesh.points.T)))

    def on_arc(self) -> NDArray[np.bool_]:
        """Which edges of the triangles, (triangles, 3), have both ends on the circle around the disk."""
        outside = np.hypot(*self.mesh.points.T) > (1.0 - ON_SURFACE) * self.radius
        ends = outside[self.mesh.triangles]
        return np.asarray(ends & np.roll(ends, -1, axis=1))

    def moments(self, radius: float) -> Array:
        """Integrals of 1, x, y, x^2, xy, y^2 over the part of each triangle within `radius` of the origin, (6, triangles)."""
        corners = self.mesh.points[self.mesh.triangles]
        a, b = corners.reshape(-1, 2), np.roll(corners, -1, axis=1).reshape(-1, 2)
        arc = self.on_arc().ravel()
        found = _within(a, b, radius)
        found[:, arc] = _sector(a[arc], b[arc], min(radius, self.radius))
        return np.asarray(found.reshape(6, -1, 3).sum(axis=2))

    def weights(self, edges: Array) -> tuple[csr_array, csr_array, csr_array]:
        """Integrals over the rings between `edges` of the shape functions, and of those times x and times y, (rings, points)."""
        from scipy.sparse import csr_array

        triangles, points = self.mesh.triangles, self.mesh.points
        shape = (len(edges) - 1, len(points))
        # shape function = constant + slope . X
        second, third = np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)
        across = points[third] - points[second]
        slope = np.stack([-across[..., 1], across[..., 0]], axis=-1) / (2.0 * self.mesh.areas())[:, None, None]
        constant = 1.0 - np.sum(slope * points[triangles], axis=-1)
        inner, parts = self.moments(edges[0]), []
        for outer_edge in edges[1:]:
            outer = self.moments(outer_edge)
            one, x, y, xx, xy, yy = ((outer - inner)[:, :, None]).reshape(6, -1, 1)
            inner = outer
            parts.append([constant * q + slope[..., 0] * qx + slope[..., 1] * qy for q, qx, qy in ((one, x, y), (x, xx, xy), (y, xy, yy))])
        rows = np.repeat(np.arange(len(parts)), triangles.size)
        columns = np.tile(triangles.ravel(), len(parts))
        one_, x_, y_ = (csr_array((np.concatenate([part[k].ravel() for part in parts]), (rows, columns)), shape=shape) for k in range(3))
        return one_, x_, y_


@dataclass(frozen=True, slots=True, eq=False)
class Rings:
    """Rings of a round body at rest.

    Attributes
    ----------
    edges : (rings + 1,) array
        Radii over that of the body, from 0 to 1.
    round_mesh : RoundMesh
    """

    round_mesh: RoundMesh
    edges: Array
    _weights: tuple[csr_array, csr_array, csr_array]
    _corners: NDArray[np.int64]
    _shares: Array
    _outwards: Array

    @classmethod
    def of(cls, round_mesh: RoundMesh, edges: Array) -> Rings:
        """The rings between `edges`, and a circle in the middle of each."""
        radius = round_mesh.radius
        count = SAMPLES * int(round_mesh.on_arc().sum())
        angles = (np.arange(count) + 0.5) / count * (0.5 if round_mesh.quarter else 2.0) * np.pi
        outwards = np.column_stack([np.cos(angles), np.sin(angles)])
        middles = 0.5 * radius * (edges[1:] + edges[:-1])
        corners, shares, _ = locate(round_mesh.mesh, (middles[:, None, None] * outwards).reshape(-1, 2))
        return cls(round_mesh, edges, round_mesh.weights(radius * edges), corners, shares, outwards)

    def means(self, values: Array) -> Array:
        """Averages (times, rings) of a field (times, points), exact for one that is linear in each triangle."""
        one = self._weights[0]
        return np.asarray((one @ values.T).T / one.sum(axis=1))

    def outward_means(self, values: Array) -> Array:
        """Averages (times, rings) of the radial part of a field of vectors (times, points, 2), weighted by the distance from the middle:
        the integral of v . X over that of |X|, exact for fields that are linear in each triangle."""
        _, x, y = self._weights
        radius, angle = self.round_mesh.radius, (0.5 if self.round_mesh.quarter else 2.0) * np.pi
        distance = angle / 3.0 * np.diff((radius * self.edges) ** 3)
        return np.asarray(((x @ values[..., 0].T) + (y @ values[..., 1].T)).T / distance)

    def scatter(self, values: Array) -> tuple[Array, Array]:
        """Root mean square and largest deviation (times, rings) from the mean round the circle in the middle of each ring, of a field
        (times, points), or of vectors (times, points, 2) from their mean radial part."""
        rms, largest = [], []
        for row in values:
            here = row[self._corners]
            on_circles = np.einsum("pc,pc...->p...", self._shares, here).reshape(-1, len(self._outwards), *row.shape[1:])
            if row.ndim == 1:
                off = np.abs(on_circles - on_circles.mean(axis=1, keepdims=True))
            else:
                outward = np.sum(on_circles * self._outwards, axis=2)
                off = np.hypot(*np.moveaxis(on_circles - outward.mean(axis=1)[:, None, None] * self._outwards, 2, 0))
            rms.append(np.sqrt(np.mean(off**2, axis=1)))
            largest.append(off.max(axis=1))
        return np.array(rms), np.array(largest)


def ring_averages(values: Array, edges: Array, *, weighted: bool = False) -> Array:
    """Averages over rings of a disk of values of the radial solver, (times, cells) to (times, rings).

    Values of a cell are those of its balances, which are both its averages and, to the order 1/cells^2 of the solver, the values in its
    middle. They are taken as the latter and as linear in between, and continued linearly to the centre and to the surface.

    Parameters
    ----------
    values : (times, cells) array
    edges : (rings + 1,) array
        Radii at rest over that of the body.
    weighted : bool
        Weighted by the distance from the middle, as the displacement in two dimensions.
    """
    cells = values.shape[1]
    at = np.concatenate([[0.0], (np.arange(cells) + 0.5) / cells, [1.0]])
    ends = 1.5 * values[:, [0, -1]] - 0.5 * values[:, [1, -2]]
    known = np.concatenate([ends[:, :1], values, ends[:, 1:]], axis=1)
    breaks = np.union1d(at, edges)
    nodes, weights = np.polynomial.legendre.leggauss(2)  # exact: the integrands are of degree two and three
    R = 0.5 * (breaks[1:] + breaks[:-1])[:, None] + 0.5 * np.diff(breaks)[:, None] * nodes
    size = 0.5 * np.diff(breaks)[:, None] * weights * R ** (2 if weighted else 1)
    ring = np.searchsorted(edges, R[:, 0]) - 1
    count = len(edges) - 1
    whole = np.bincount(ring, size.sum(axis=1), count)
    return np.array([np.bincount(ring, (size * np.interp(R, at, row)).sum(axis=1), count) / whole for row in known])


def _within(a: Array, b: Array, radius: float) -> Array:
    """The moments (6, edges) of the part of the triangles (0, a, b) within a circle."""
    along = b - a
    squared = np.maximum(np.sum(along**2, axis=1), 1e-300)
    nearest = -np.sum(a * along, axis=1) / squared
    half = np.sqrt(np.maximum(nearest**2 - (np.sum(a**2, axis=1) - radius**2) / squared, 0.0))
    enter, leave = np.clip(nearest - half, 0.0, 1.0), np.clip(nearest + half, 0.0, 1.0)
    p, q = a + enter[:, None] * along, a + leave[:, None] * along
    return _sector(a, p, radius) + _triangle(p, q) + _sector(q, b, radius)


def _triangle(p: Array, q: Array) -> Array:
    """The moments of the triangles (0, p, q)."""
    (px, py), (qx, qy) = p.T, q.T
    area = 0.5 * (px * qy - py * qx)
    return np.stack([
        area, area * (px + qx) / 3.0, area * (py + qy) / 3.0, area * (px**2 + px * qx + qx**2) / 6.0,
        area * (2.0 * px * py + 2.0 * qx * qy + px * qy + qx * py) / 12.0, area * (py**2 + py * qy + qy**2) / 6.0,
    ])  # fmt: skip


def _sector(p: Array, q: Array, radius: float) -> Array:
    """The moments of the sectors of a circle from the direction of p to that of q; 0 from or to the origin, which has none."""
    lengths = np.hypot(*p.T), np.hypot(*q.T)
    some = (lengths[0] > 0.0) & (lengths[1] > 0.0)
    found = np.zeros((6, len(p)))
    (c, s), (C, S) = ((ends[some] / length[some, None]).T for ends, length in zip((p, q), lengths, strict=True))
    angle = np.arctan2(c * S - s * C, c * C + s * S)
    two = 0.5 * (S * C - s * c)
    r2, r3, r4 = radius**2 / 2.0, radius**3 / 3.0, radius**4 / 4.0
    found[:, some] = [
        r2 * angle, r3 * (S - s), r3 * (c - C), r4 * (0.5 * angle + two), r4 * 0.5 * (S**2 - s**2), r4 * (0.5 * angle - two),
    ]  # fmt: skip
    return found
