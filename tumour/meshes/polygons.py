"""Closed polygons: area, crossings, points inside, resampling at equal arc length, the largest inscribed circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Points = NDArray[np.float64]
Numbers = NDArray[np.int64]

CORNER = np.radians(40.0)
"""Turn of an outline, over the length of an element, from which it is a corner that a mesh must keep."""

TOUCH = 1e-10
"""How near a point must be to a segment to lie on it, over the segment's length."""

PAIRS = 2_000_000
"""Pairs of segments that are looked at together."""

MOST_CENTRES = 12
"""Places from which the centre of the largest inscribed circle is searched for."""


def signed_area(points: Points) -> float:
    """Area enclosed by a polygon, positive if it runs counterclockwise."""
    x, y = (points - points[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def cross(a: Points, b: Points) -> Points:
    """The component across the plane of the product of vectors."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def closed_edges(*counts: int) -> Numbers:
    """The sides of closed polygons of so many points, one after the other, as pairs of points."""
    first = np.arange(sum(counts))
    after = first + 1
    stops = np.cumsum(counts)
    after[stops - 1] = stops - np.array(counts)
    return np.column_stack((first, after))


def first_crossing(points: Points, edges: Numbers) -> tuple[int, int] | None:
    """Two edges that cross or touch without a common point, or that have one and fold back on each other; None where there are none."""
    slack = TOUCH * np.hypot(*(points[edges[:, 1]] - points[edges[:, 0]]).T)[:, None]
    low = np.minimum(points[edges[:, 0]], points[edges[:, 1]]) - slack
    high = np.maximum(points[edges[:, 0]], points[edges[:, 1]]) + slack
    order = np.argsort(low[:, 0], kind="stable")
    edges, low, high = edges[order], low[order], high[order]
    after = np.searchsorted(low[:, 0], high[:, 0], side="right")
    counts = after - np.arange(len(edges)) - 1
    ends = np.cumsum(counts)
    start = 0
    while start < len(edges):
        stop = max(start + 1, int(np.searchsorted(ends, (ends[start - 1] if start else 0) + PAIRS, side="right")))
        some = counts[start:stop]
        i = np.repeat(np.arange(start, stop), some)
        j = i + 1 + np.arange(len(i)) - np.repeat(np.cumsum(some) - some, some)
        near = (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
        bad = _meet(points, edges, i[near], j[near])
        if bad is not None:
            return int(order[bad[0]]), int(order[bad[1]])
        start = stop
    return None


def _meet(points: Points, edges: Numbers, i: Numbers, j: Numbers) -> tuple[int, int] | None:
    """The first of the pairs (i, j) of edges that meet where they must not; their bounding boxes overlap."""
    a, b, c, d = points[edges[i, 0]], points[edges[i, 1]], points[edges[j, 0]], points[edges[j, 1]]
    of_c, of_d = _side(a, b, c), _side(a, b, d)
    of_a, of_b = _side(c, d, a), _side(c, d, b)
    meets = (of_c * of_d <= 0) & (of_a * of_b <= 0)
    shared = (edges[i][:, :, None] == edges[j][:, None, :]).any(axis=(1, 2))
    same = shared & (edges[i, 0] == edges[j, 1]) | shared & (edges[i, 1] == edges[j, 0])
    folds = same & (of_c == 0) & (of_d == 0) & (np.einsum("ij,ij->i", b - a, d - c) < 0.0)
    found = np.flatnonzero(meets & ~shared | folds)
    return (int(i[found[0]]), int(j[found[0]])) if len(found) else None


def _side(a: Points, b: Points, c: Points) -> Points:
    """1 where c lies to the left of the line from a to b, -1 to the right, and 0 on it."""
    along = b - a
    doubled = cross(along, c - a)
    return np.where(np.abs(doubled) <= TOUCH * np.einsum("ij,ij->i", along, along), 0.0, np.sign(doubled))


def inside(points: Points, ends: Points) -> NDArray[np.bool_]:
    """Which points lie within closed polygons, given as segments, (segments, 2, 2) (even-odd rule)."""
    a, b = ends[:, 0], ends[:, 1]
    slope = (b[:, 0] - a[:, 0]) / np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    found = np.empty(len(points), dtype=bool)
    block = max(1, PAIRS // len(ends))
    for start in range(0, len(points), block):
        x, y = points[start : start + block, 0, None], points[start : start + block, 1, None]
        spans = (a[:, 1] > y) != (b[:, 1] > y)
        found[start : start + block] = (spans & (x < a[:, 0] + (y - a[:, 1]) * slope)).sum(axis=1) % 2 == 1
    return found


def corners(points: Points, size: float) -> Numbers:
    """Points at which a polygon turns by `CORNER` or more within an element to either side; of two within half of one, the sharper."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*(np.roll(points, -1, axis=0) - points).T))))
    reach = min(size, along[-1] / 6.0)
    before, after = at_length(points, along[:-1] - reach), at_length(points, along[:-1] + reach)
    turn = np.abs(_turn(points - before, after - points))
    own = np.abs(_turn(points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points))
    chosen: list[int] = []
    for i in np.argsort(-turn, kind="stable"):
        if turn[i] < CORNER:
            break
        gaps = [min(abs(along[i] - along[k]), along[-1] - abs(along[i] - along[k])) for k in chosen]
        if own[i] > 0.5 * turn[i] and all(gap > 0.5 * size for gap in gaps):
            chosen.append(int(i))
    return np.array(sorted(chosen), dtype=np.int64)


def _turn(a: Points, b: Points) -> Points:
    """Angle from vector a to vector b."""
    return np.asarray(np.arctan2(cross(a, b), np.einsum("ij,ij->i", a, b)))


def at_length(points: Points, length: Points) -> Points:
    """Points of a closed polygon at given arc lengths from its first point."""
    closed = np.vstack((points, points[:1]))
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))))
    s = np.mod(length, along[-1])
    return np.column_stack((np.interp(s, along, closed[:, 0]), np.interp(s, along, closed[:, 1])))


def resampled(points: Points, size: float) -> Points:
    """Points on a polygon at about equal arc length `size`, with its corners among them."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*(np.roll(points, -1, axis=0) - points).T))))
    kept = corners(points, size)
    starts = along[kept] if len(kept) else np.zeros(1)
    stops = np.append(starts[1:], starts[0] + along[-1])
    counts = np.maximum(np.rint((stops - starts) / size).astype(int), 3 if len(starts) == 1 else 1)
    new = np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in zip(starts, stops, counts, strict=True)])
    found = at_length(points, new)
    if len(kept):
        found[np.cumsum(counts) - counts] = points[kept]
    return found


def distance(points: Points, ends: Points) -> Points:
    """Distance of points from the nearest of segments, (segments, 2, 2)."""
    nearest = np.empty(len(points))
    block = max(1, PAIRS // len(ends))
    for start in range(0, len(points), block):
        nearest[start : start + block] = _distances(points[start : start + block], ends).min(axis=1)
    return nearest


def _distances(points: Points, ends: Points) -> Points:
    """Distance of each point from each segment."""
    a, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    squares = np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)
    apart = points[:, None] - a
    at = np.clip(np.einsum("pij,ij->pi", apart, along) / squares, 0.0, 1.0)
    gap = apart - at[..., None] * along
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]))


def inscribed_radius(candidates: Points, ends: Points, boundary: Points | None = None) -> float:
    """Largest distance that a point of a body has from some segments of its boundary, (segments, 2, 2).

    It is searched for from the best candidates on, which are points of the body, by grids that shrink.

    Parameters
    ----------
    candidates : (n, 2) array
        Points all over the body.
    ends : (segments, 2, 2) array
        From what the distance is measured.
    boundary : (segments, 2, 2) array, optional
        All of the boundary, which the search does not cross; `ends` unless given.
    """
    wall = ends if boundary is None else boundary
    samples = (ends[:, 0, None] + np.linspace(0.0, 1.0, 5)[:, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 2)
    rough = cKDTree(samples).query(candidates)[0]
    span = np.ptp(candidates, axis=0)
    step = float(np.sqrt(np.prod(span) / len(candidates)))
    best, chosen = 0.0, np.empty((0, 2))
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 7)]), axis=-1).reshape(-1, 2)
    for k in np.argsort(-rough, kind="stable"):
        if rough[k] < rough.max() - 3.0 * step or len(chosen) == MOST_CENTRES:
            break
        if len(chosen) and np.hypot(*(chosen - candidates[k]).T).min() < 4.0 * step:
            continue
        chosen = np.vstack((chosen, candidates[k]))
        centre, width = candidates[k], 2.0 * step
        value = float(distance(centre[None], ends)[0])
        while width > 1e-9 * span.max():
            near = centre + width * grid
            if boundary is not None or 1.5 * width > value:
                near = near[inside(near, wall)]
            reached = ends[_distances(centre[None], ends)[0] <= value + 3.0 * width]
            values = distance(near, reached)
            if len(values) and values.max() > value * (1.0 + 1e-12):
                centre, value = near[np.argmax(values)], float(values.max())
            else:
                width *= 0.4
        best = max(best, value)
    return best
