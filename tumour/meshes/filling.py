"""Fills a closed polygon, with holes or without, with triangles of about one size.

Bars between neighbours that push until they are in equilibrium, and Delaunay's triangulation of their ends: Persson & Strang, "A simple
mesh generator in MATLAB", SIAM Review 46 (2004) 329-345. Here the nodes on the boundary stay where they are, and so do those far from
it, which begin and remain in the hexagonal lattice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from tumour.meshes.body import angles, boundary_edges, doubled_areas, sides
from tumour.meshes.polygons import Numbers, Points, closed_edges, inside

PRESSURE = 1.2
"""Length of a bar at rest over the mean length."""

STEP, LONGEST_STEP, STILL = 0.2, 0.15, 2e-3
"""Share of the force that a node moves by in one step; the longest such step, and that of a node at rest, over the size of an element."""

STEPS, MOVED = 150, 0.1
"""Steps at most, and how far nodes may move, over the size, before they are triangulated anew."""

DEPTH, SUPPORT = 8.0, 3.0
"""Sizes from the boundary beyond which nodes do not move, and how many of them beyond that hold the others."""

GOOD, ROUNDS = 31.0, 12
"""Least angle, in degrees, with which a mesh is left alone, and attempts to reach it."""


def fill(loops: Sequence[Points], size: float) -> tuple[Points, Numbers]:
    """Nodes and triangles within polygons, whose points come first and whose sides are sides of triangles.

    Parameters
    ----------
    loops : sequence of (n, 2) array
        Simple polygons with sides of about `size`: the outer one, counterclockwise, and its holes, clockwise.
    size : float
        Length of a side of a triangle.

    Returns
    -------
    The best mesh found. In narrow parts it may lack sides of the polygons, and have triangles with all corners on it.
    """
    boundary, after = np.concatenate(loops), closed_edges(*map(len, loops))[:, 1]
    best = boundary, np.empty((0, 3), dtype=np.int64)
    score = -np.inf
    inner = _lattice(boundary, after, size)
    for attempt in range(ROUNDS):
        inner = _relaxed(boundary, after, inner, size)
        points = np.vstack((boundary, inner))
        triangles = _unpinned(points, _triangulated(points, after), after)
        least = _score(points, triangles, after)
        if least > score:
            score, best = least, (points, triangles)
        if score >= GOOD:
            break
        inner = _mended(points, triangles, after, size, attempt)
    return best


def _score(points: Points, triangles: Numbers, after: Numbers) -> float:
    """Least angle in degrees; less the more triangles are pinned to the boundary, and negative if they do not fill it."""
    missing = len(missing_sides(triangles, after)) + len(points) - len(np.unique(triangles))
    if missing or len(boundary_edges(triangles)) != len(after):
        return -1.0 - missing
    pinned = int((triangles < len(after)).all(axis=1).sum())
    return float(angles(points, triangles).min()) if not pinned else 1.0 / (1.0 + pinned)


def missing_sides(triangles: Numbers, after: Numbers) -> Numbers:
    """Numbers of the sides of the polygons, node k to node after[k], that are on no triangle's boundary."""
    edges = boundary_edges(triangles)
    present = edges[_follows(edges[:, 0], edges[:, 1], after), 0]
    return np.asarray(np.setdiff1d(np.arange(len(after)), present))


def _follows(first: Numbers, second: Numbers, after: Numbers) -> NDArray[np.bool_]:
    """Where from the first node to the second there is a side of the polygons."""
    return np.asarray((first < len(after)) & (after[np.minimum(first, len(after) - 1)] == second))


def _lattice(boundary: Points, after: Numbers, size: float) -> Points:
    """Points of a hexagonal lattice within the boundary, and not too near to it."""
    low, high = boundary.min(axis=0), boundary.max(axis=0)
    height = np.sqrt(0.75) * size
    rows = np.arange(low[1] + 0.5 * height, high[1], height)
    a, b = boundary, boundary[after]
    found = []
    for k, y in enumerate(rows):
        spans = (a[:, 1] > y) != (b[:, 1] > y)
        p, q = a[spans], b[spans]
        crossings = np.sort(p[:, 0] + (y - p[:, 1]) * (q[:, 0] - p[:, 0]) / (q[:, 1] - p[:, 1]))
        first = low[0] + (0.5 * size if k % 2 else 0.0)
        for start, stop in zip(crossings[::2], crossings[1::2], strict=False):
            x = first + size * np.arange(np.ceil((start - first) / size), np.floor((stop - first) / size) + 1)
            found.append(np.column_stack((x, np.full(len(x), y))))
    points = np.concatenate(found) if found else np.empty((0, 2))
    return points[_Wall(boundary, after).distance(points) > 0.5 * size]


class _Wall:
    """The boundary as points close together, to measure distances from it."""

    def __init__(self, boundary: Points, after: Numbers) -> None:
        a, b = boundary, boundary[after]
        self.tree = cKDTree((a[:, None] + np.linspace(0.0, 1.0, 6)[:-1, None] * (b - a)[:, None]).reshape(-1, 2))
        self.middles, self.reach = cKDTree((a + b) / 2.0), np.hypot(*(b - a).T) / 2.0

    def distance(self, points: Points) -> Points:
        return np.asarray(self.tree.query(points)[0]) if len(points) else np.empty(0)

    def is_clear(self, points: Points, size: float) -> NDArray[np.bool_]:
        """Which points lie in no circle over a side, as then the side is one of Delaunay's triangles, and at no node."""
        gap, which = self.middles.query(points)
        near = self.distance(points) <= 0.25 * np.minimum(size, 2.0 * self.reach[which])
        return np.asarray((gap > 1.02 * self.reach[which]) & ~near)


def _triangulated(points: Points, after: Numbers) -> Numbers:
    """Delaunay's triangles within the boundary, the first of the points, counterclockwise."""
    count = len(after)
    triangles = Delaunay(points).simplices.astype(np.int64)
    doubled = doubled_areas(points, triangles)
    triangles = np.where((doubled < 0.0)[:, None], triangles[:, [0, 2, 1]], triangles)
    spanning = np.flatnonzero((triangles < count).all(axis=1))
    keep = np.ones(len(triangles), dtype=bool)
    keep[spanning] = inside(points[triangles[spanning]].mean(axis=1), np.stack((points[:count], points[after]), axis=1))
    return np.asarray(triangles[keep])


def _relaxed(boundary: Points, after: Numbers, inner: Points, size: float) -> Points:
    """The inner points in equilibrium, those that came too near to the boundary left out."""
    if not len(inner):
        return inner
    wall = _Wall(boundary, after)
    inner = inner[wall.is_clear(inner, size)]
    depth = wall.distance(inner) / size
    deep = inner[depth > DEPTH + SUPPORT]
    held = inner[(depth > DEPTH) & (depth <= DEPTH + SUPPORT)]
    free = inner[depth <= DEPTH]
    count = len(boundary)
    since = np.inf
    bars = np.empty((0, 2), dtype=np.int64)
    for _ in range(STEPS):
        points = np.vstack((boundary, free, held))
        if since > MOVED:
            bars = _bars(points, len(free), after)
            since = 0.0
        if not len(free):
            break
        step = STEP * _forces(points, bars)[count : count + len(free)]
        length = np.hypot(*step.T) / size
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300))[:, None]
        moved = free + step
        clear = wall.is_clear(moved, size)
        if not clear.all():
            free, since = moved[clear], np.inf
            continue
        free = moved
        furthest = float(length.max())
        since += furthest
        if furthest < STILL:
            break
    return np.vstack((free, held, deep))


def _bars(points: Points, free: int, after: Numbers) -> Numbers:
    """Edges of the triangulation with an end that is free to move; such nodes come after those of the boundary."""
    count = len(after)
    edges = np.unique(np.sort(sides(_triangulated(points, after)), axis=1), axis=0)
    is_free = (edges >= count) & (edges < count + free)
    return np.asarray(edges[is_free.any(axis=1)])


def _forces(points: Points, bars: Numbers) -> Points:
    """Sum of the forces with which bars shorter than at rest push on their ends."""
    along = points[bars[:, 0]] - points[bars[:, 1]]
    length = np.maximum(np.hypot(*along.T), 1e-300)
    push = np.maximum(PRESSURE * np.sqrt(np.mean(length**2)) - length, 0.0)
    force = along * (push / length)[:, None]
    return np.column_stack(
        [
            np.bincount(bars[:, 0], force[:, k], minlength=len(points)) - np.bincount(bars[:, 1], force[:, k], minlength=len(points))
            for k in range(2)
        ]
    )


def _unpinned(points: Points, triangles: Numbers, after: Numbers) -> Numbers:
    """Triangles with two sides on the boundary flipped with their neighbour, so that an edge leads inwards from the corner between."""
    triangles, count = triangles.copy(), len(after)
    for t in np.flatnonzero((triangles < count).all(axis=1)):
        for k in range(3):
            a, b, c = np.roll(triangles[t], -k)
            if a < count and b < count and after[a] == b and after[b] == c:
                other = np.flatnonzero((triangles == a).any(axis=1) & (triangles == c).any(axis=1))
                other = other[other != t]
                d = triangles[other].sum() - a - c if len(other) == 1 else -1
                flipped = np.array([(a, b, d), (b, c, d)])
                if d >= count and (doubled_areas(points, flipped) > 0.0).all():
                    triangles[[t, other[0]]] = flipped
                break
    return triangles


def _mended(points: Points, triangles: Numbers, after: Numbers, size: float, attempt: int) -> Points:
    """Inner points with one more where triangles are too wide or pinned to the boundary, and one less where they are too narrow."""
    count, drop = len(after), np.zeros(len(points), dtype=bool)
    added = np.empty((0, 2))
    pinned = np.flatnonzero((triangles < count).all(axis=1))
    for t in np.union1d(pinned, np.flatnonzero(angles(points, triangles).min(axis=1) < GOOD)):
        starts, stops = triangles[t], np.roll(triangles[t], -1)
        lengths = np.hypot(*(points[stops] - points[starts]).T)
        shortest = int(np.argmin(lengths))
        ends = np.array([node for node in (starts[shortest], stops[shortest]) if node >= count])
        is_narrow = lengths[shortest] < 0.75 * size and (attempt % 2 == 0 or lengths.max() < 1.2 * size)
        if len(ends) and is_narrow:
            drop[ends[attempt // 2 % len(ends)]] = True
            continue
        within = np.where(_follows(starts, stops, after), 0.0, lengths) if t in pinned else lengths
        k = int(np.argmax(within))
        middle = (points[starts[k]] + points[stops[k]]) / 2.0
        if not len(added) or np.hypot(*(added - middle).T).min() > 0.5 * size:
            added = np.vstack((added, middle))
    return np.vstack((points[count:][~drop[count:]], added))
