"""Disks and quarter disks in rings of triangles."""

from __future__ import annotations

import operator

import numpy as np

from multiphase.errors import ParameterError
from tumour.meshes.body import Body, finite_positive, make_body
from tumour.meshes.polygons import Numbers

MOST_RINGS = 2000
"""Rings of a disk; more would be some twelve million nodes."""


def quarter_disk(radius: float, rings: int) -> Body:
    """The part of a disk around the origin with x, y >= 0; it slides on its two straight sides.

    Two sectors of 45 degrees, each a triangular grid bent to the arc: ring k has 2k segments. The mesh has (rings + 1)^2 nodes and is
    its own mirror image in the diagonal.
    """
    R, n = finite_positive(radius, "geometry.radius"), _rings(rings)
    points = np.zeros(((n + 1) ** 2, 2))
    for k in range(1, n + 1):
        angle = 0.25 * np.pi * np.arange(k + 1) / k
        lower = R * k / n * np.column_stack((np.cos(angle), np.sin(angle)))
        lower[-1] = R * k / n * np.sqrt(0.5)
        points[k * k : (k + 1) ** 2] = np.vstack((lower, lower[-2::-1, ::-1]))
    starts = np.arange(n + 1) ** 2
    arc = starts[n] + np.arange(2 * n + 1)
    return make_body(
        points,
        _sectors(n, 2, starts),
        surface=arc,
        slide_x=(np.arange(n + 1) + 1) ** 2 - 1,
        slide_y=starts,
        radius=R,
        area=0.25 * np.pi * R**2,
        is_round=True,
        path="geometry",
    )


def disk(radius: float, rings: int) -> Body:
    """A disk around the origin, free all round: six sectors of 60 degrees; ring k has 6k nodes."""
    R, n = finite_positive(radius, "geometry.radius"), _rings(rings)
    ring = np.repeat(np.arange(1, n + 1), 6 * np.arange(1, n + 1))
    starts = np.concatenate(([0], 1 + 3 * np.arange(n) * (np.arange(n) + 1)))
    angle = np.pi / 3.0 * (np.arange(1, len(ring) + 1) - starts[ring]) / ring
    around = R / n * ring[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
    points = np.vstack((np.zeros((1, 2)), around))
    surface = np.arange(starts[n], len(points))
    return make_body(
        points, _sectors(n, 6, starts, is_closed=True), surface=surface, radius=R, area=np.pi * R**2, is_round=True, path="geometry"
    )


def _sectors(rings: int, sectors: int, starts: Numbers, *, is_closed: bool = False) -> Numbers:
    """Triangles of sectors side by side, ring by ring; `starts` are the first nodes of the rings, ring k has `sectors` k segments."""
    triangles = []
    for k in range(1, rings + 1):
        j, sector = (grid.ravel() for grid in np.meshgrid(np.arange(k), np.arange(sectors), indexing="ij"))
        outer, inner = sector * k + j, sector * (k - 1) + j

        def node(ring: int, at: Numbers) -> Numbers:
            return np.asarray(starts[ring] + (at % max(sectors * ring, 1) if is_closed else at))

        triangles.append(np.column_stack((node(k - 1, inner), node(k, outer), node(k, outer + 1))))
        some = j < k - 1
        o, i = outer[some], inner[some]
        triangles.append(np.column_stack((node(k - 1, i), node(k, o + 1), node(k - 1, i + 1))))
    return np.concatenate(triangles)


def _rings(rings: int) -> int:
    """The number of rings, or the refusal of one that cannot be."""
    try:
        number = 0 if isinstance(rings, bool) else operator.index(rings)
    except TypeError:
        number = 0
    if not 1 <= number <= MOST_RINGS:
        raise ParameterError("geometry.rings", f"{rings!r} must be a whole number from 1 to {MOST_RINGS}.")
    return number
