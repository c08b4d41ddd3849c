"""A tumour's body at rest, meshed, and the checks that every mesh must pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTri

from multiphase.errors import ParameterError
from tumour.meshes.polygons import Numbers, Points, cross, first_crossing

LEAST_ANGLE = 1.0
"""Least angle of a triangle, in degrees, below which a mesh is refused."""


@dataclass(frozen=True, slots=True)
class Quality:
    """How well shaped the triangles of a mesh are.

    Attributes
    ----------
    least_angle : float
        Smallest angle of all triangles, in degrees.
    least_angle_at : (float, float)
        The corner that has it.
    largest_ratio : float
        Largest ratio of longest side to least height; 1.15 for an equilateral triangle.
    nodes, triangles : int
        Their numbers.
    h_min, h_max : float
        Shortest and longest side.
    pinned : int
        Triangles with all three corners on the free surface: what is prescribed there is constant on them.
    """

    least_angle: float
    least_angle_at: tuple[float, float]
    largest_ratio: float
    nodes: int
    triangles: int
    h_min: float
    h_max: float
    pinned: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A two-dimensional body at rest, meshed.

    Attributes
    ----------
    mesh : skfem.MeshTri
        Counterclockwise triangles; every node belongs to one.
    surface : array of int
        Nodes of the free surface, where oxygen and pressure are prescribed.
    edges : (n, 2) array of int
        Edges of the free surface, with the body on their left.
    sides : mapping of str to array of int
        Named parts of the free surface: numbers among its edges. They need not cover it and may share edges.
    slide_x, slide_y : array of int
        Nodes that may not move in x (of a straight side x = const on which the body slides), and in y. The ends of such a side may be
        on the surface as well.
    radius : float
        Characteristic length: the radius of a disk; of other bodies the largest distance from the free surface, which is the radius of
        the largest inscribed circle (of the body continued by reflection where it slides).
    area : float
        Exact area of the disk that the mesh approximates; of other bodies the mesh's own.
    is_round : bool
        Whether it is a disk or a quarter of one.
    quality : Quality
    origin : str
        How an image became this body, in words; empty for other bodies.
    """

    mesh: MeshTri
    surface: Numbers
    edges: Numbers
    sides: Mapping[str, Numbers]
    slide_x: Numbers
    slide_y: Numbers
    radius: float
    area: float
    is_round: bool
    quality: Quality
    origin: str = ""


def make_body(
    points: Points,
    triangles: Numbers,
    *,
    surface: ArrayLike,
    slide_x: ArrayLike = (),
    slide_y: ArrayLike = (),
    radius: float,
    area: float | None = None,
    is_round: bool = False,
    sides: Mapping[str, Numbers] | None = None,
    path: str,
) -> Body:
    """Check a mesh and make a body of it; without an `area`, of the mesh's own.

    `sides` gives edges, (n, 2), by name; those that are not of the free surface are left out. Without it all of the surface is "surface".
    """
    on_surface, in_x, in_y = (np.unique(np.asarray(nodes, dtype=np.int64)) for nodes in (surface, slide_x, slide_y))
    quality = check(points, triangles, path, surface=on_surface)
    mesh = MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T), sort_t=False, validate=False)
    own = float(doubled_areas(points, triangles).sum()) / 2.0
    edges = boundary_edges(triangles)
    edges = edges[~(np.isin(edges, in_x).all(axis=1) | np.isin(edges, in_y).all(axis=1))]
    named = {"surface": edges} if sides is None else sides
    numbered = {name: numbers for name, of in named.items() if len(numbers := _numbers(of, edges, len(points)))}
    return Body(
        mesh, on_surface, edges, numbered, in_x, in_y, float(radius), own if area is None else float(area), is_round, quality
    )  # fmt: skip


def _numbers(of: Numbers, edges: Numbers, count: int) -> Numbers:
    """Which of the `edges` are among those of a side, in either direction."""
    keys = np.array([count, 1])
    return np.flatnonzero(np.isin(np.sort(edges, axis=1) @ keys, np.sort(np.reshape(of, (-1, 2)), axis=1) @ keys))


def doubled_areas(points: Points, triangles: Numbers) -> Points:
    """Twice the area of each triangle, positive if counterclockwise."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return cross(b - a, c - a)


def angles(points: Points, triangles: Numbers) -> Points:
    """The angles of each triangle at its three corners, in degrees."""
    corner = points[triangles]
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    return np.asarray(np.degrees(np.arctan2(np.abs(cross(ahead, back)), np.einsum("tki,tki->tk", ahead, back))))


def sides(triangles: Numbers) -> Numbers:
    """The directed sides of triangles, first those from corner 0 to 1, then from 1 to 2, then from 2 to 0."""
    return np.concatenate((triangles[:, :2], triangles[:, 1:], triangles[:, [2, 0]]))


def boundary_edges(triangles: Numbers) -> Numbers:
    """Sides that belong to one triangle, with the body on their left."""
    directed = sides(triangles)
    _, first, counts = np.unique(np.sort(directed, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(directed[np.sort(first[counts == 1])])


def place(point: Points) -> str:
    """A point in a sentence."""
    return f"({point[0]:.6g}, {point[1]:.6g})"


def check(points: Points, triangles: Numbers, path: str, *, surface: ArrayLike = ()) -> Quality:
    """Refuse a mesh on which the fields cannot be solved.

    Parameters
    ----------
    points : (nodes, 2) array
    triangles : (triangles, 3) array of int
        Corners, counterclockwise.
    path : str
        Where the mesh comes from, for the error: ``geometry.file``, for instance.
    surface : sequence of int
        Nodes of the free surface.

    Raises
    ------
    ParameterError
        For coordinates that are not finite, nodes without a triangle, triangles of no or negative area or with an angle below
        `LEAST_ANGLE`, triangles that overlap, an edge of three triangles, a body in several parts or one that touches itself.
    """
    if not len(triangles):
        raise ParameterError(path, "has no triangles.")
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise ParameterError(path, f"node {bad + 1} has a coordinate that is no finite number.")
    unused = np.setdiff1d(np.arange(len(points)), triangles)
    if len(unused):
        raise ParameterError(path, f"node {unused[0] + 1} at {place(points[unused[0]])} belongs to no triangle.")
    quality = _check_shapes(points, triangles, path, np.asarray(surface, dtype=np.int64))
    _check_edges(points, triangles, path)
    _check_parts(points, triangles, path)
    _check_boundary(points, triangles, path)
    return quality


def _corners(points: Points, triangle: Numbers) -> str:
    return ", ".join(place(points[k]) for k in triangle)


def _check_shapes(points: Points, triangles: Numbers, path: str, surface: Numbers) -> Quality:
    """Refuse triangles that are turned over, flat or badly shaped."""
    doubled = doubled_areas(points, triangles)
    corner = points[triangles]
    lengths = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
    longest = lengths.max(axis=1)
    for is_bad, what in ((np.abs(doubled) <= 1e-14 * longest**2, "has no area"), (doubled < 0.0, "is clockwise")):
        if is_bad.any():
            t = int(np.argmax(is_bad))
            raise ParameterError(path, f"triangle {t + 1} with the corners {_corners(points, triangles[t])} {what}.")
    every = angles(points, triangles)
    t, k = divmod(int(np.argmin(every)), 3)
    if every[t, k] < LEAST_ANGLE:
        raise ParameterError(
            path,
            f"triangle {t + 1} with the corners {_corners(points, triangles[t])} is badly shaped: its least angle is "
            f"{every[t, k]:.3g} degrees, and {LEAST_ANGLE:g} is the least allowed.",
        )
    at = points[triangles[t, k]]
    return Quality(
        least_angle=float(every[t, k]), least_angle_at=(float(at[0]), float(at[1])), largest_ratio=float((longest**2 / doubled).max()),
        nodes=len(points), triangles=len(triangles), h_min=float(lengths.min()), h_max=float(longest.max()),
        pinned=int(np.isin(triangles, surface).all(axis=1).sum()),
    )  # fmt: skip


def _check_edges(points: Points, triangles: Numbers, path: str) -> None:
    """Refuse edges of three triangles, and triangles that lie on each other."""
    directed = sides(triangles)
    edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    if (counts > 2).any():
        e = int(np.argmax(counts))
        a, b = points[edges[e]]
        raise ParameterError(path, f"the edge from {place(a)} to {place(b)} belongs to {counts[e]} triangles; two at most can meet there.")
    ways, first, repeats = np.unique(directed, axis=0, return_index=True, return_counts=True)
    if (repeats > 1).any():
        e = int(np.argmax(repeats))
        a, b = points[ways[e]]
        raise ParameterError(
            path, f"two triangles overlap: both lie on the same side of their edge from {place(a)} to {place(b)} "
            f"(one is triangle {first[e] % len(triangles) + 1})."
        )  # fmt: skip
    sums = np.bincount(triangles.ravel(), weights=angles(points, triangles).ravel(), minlength=len(points))
    if (sums > 361.0).any():
        bad = int(np.argmax(sums))
        raise ParameterError(
            path, f"triangles overlap: the angles around node {bad + 1} at {place(points[bad])} sum up to {sums[bad]:.4g} degrees."
        )


def _check_parts(points: Points, triangles: Numbers, path: str) -> None:
    """Refuse a body in several parts, or parts that hang together at a node only."""
    boundary = boundary_edges(triangles)
    count = np.bincount(boundary.ravel(), minlength=len(points))
    if (count > 2).any():
        node = int(np.argmax(count > 2))
        raise ParameterError(path, f"two parts of the body touch at a single node, {node + 1} at {place(points[node])}; join or part them.")
    i = triangles[:, [0, 1, 2]].ravel()
    j = triangles[:, [1, 2, 0]].ravel()
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(len(points), len(points)))
    parts, label = connected_components(graph, directed=False)
    if parts > 1:
        area = np.bincount(label[triangles[:, 0]], weights=doubled_areas(points, triangles), minlength=parts)
        shares = ", ".join(f"{100.0 * share:.3g} %" for share in np.sort(area / area.sum())[::-1][:6])
        more = ", ..." if parts > 6 else ""
        raise ParameterError(
            path, f"the body is in {parts} parts that are not connected, with {shares}{more} of its area; give one part only."
        )


def _check_boundary(points: Points, triangles: Numbers, path: str) -> None:
    """Refuse a boundary that crosses or touches itself."""
    boundary = boundary_edges(triangles)
    found = first_crossing(points, boundary)
    if found is not None:
        middle = points[boundary[list(found)]].mean(axis=(0, 1))
        raise ParameterError(
            path,
            f"the boundary crosses or touches itself near {place(middle)}, so it is not closed as it should be; nodes that lie on the same "
            "place must be one, and a node on a triangle's side a corner of that triangle.",
        )


def finite_positive(value: float, path: str) -> float:
    """A length that was given, or the refusal of one that cannot be."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ParameterError(path, f"{value!r} is not a number; it must be a finite number greater than 0.") from None
    if not 0.0 < number < np.inf:
        raise ParameterError(path, f"{number:g} must be a finite number greater than 0.")
    return number
