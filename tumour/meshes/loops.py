"""The closed polygons that bound a body: an outer one and the holes in it, checked, turned and put in order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from multiphase.errors import ParameterError
from tumour.meshes.body import place
from tumour.meshes.polygons import Points, closed_edges, first_crossing, inside, signed_area

PATH = "geometry.points"

Loops = tuple[Points, ...]
"""The outer polygon, counterclockwise, then the holes, clockwise, in order of decreasing area."""


def checked(points: ArrayLike, holes: Sequence[ArrayLike] = ()) -> Loops:
    """The polygons of a body, whichever of them is the outer one and however they run.

    Raises
    ------
    ParameterError
        For a polygon that crosses itself, repeats a point or encloses nothing; polygons that touch or cross each other; several that lie
        in no other, which bound separate bodies; and a polygon within a hole.
    """
    given = (points, *holes)
    loops = [_polygon(one, f"loop {k}: " if len(given) > 1 else "") for k, one in enumerate(given, 1)]
    if len(loops) == 1:
        return (loops[0],)
    _check_apart(loops)
    outer = _outer(loops)
    within = [loop[::-1].copy() for k, loop in enumerate(loops) if k != outer]
    return loops[outer], *sorted(within, key=lambda loop: (signed_area(loop), *loop.min(axis=0)))


def edges_of(loops: Sequence[Points]) -> Points:
    """The sides of polygons as segments, (segments, 2, 2)."""
    return np.asarray(np.concatenate(loops)[closed_edges(*map(len, loops))])


def area_of(loops: Sequence[Points]) -> float:
    """The area that an outer polygon and its holes enclose."""
    return sum(signed_area(loop) for loop in loops)


def middle_of(loop: Points) -> str:
    """The middle of a polygon, in a sentence."""
    return place((loop.min(axis=0) + loop.max(axis=0)) / 2.0)


def _polygon(points: ArrayLike, name: str) -> Points:
    """A polygon, counterclockwise, without a last point that repeats the first."""
    try:
        polygon = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError(PATH, f"{name}must be numbers in two columns, x and y.") from None
    if polygon.ndim != 2 or polygon.shape[1] != 2:
        raise ParameterError(PATH, f"{name}must have two columns, x and y, but their shape is {polygon.shape}.")
    if not np.isfinite(polygon).all():
        bad = int(np.argmin(np.isfinite(polygon).all(axis=1)))
        raise ParameterError(PATH, f"{name}point {bad + 1}, ({polygon[bad, 0]:g}, {polygon[bad, 1]:g}), is no pair of finite numbers.")
    if len(polygon) > 1 and (polygon[0] == polygon[-1]).all():
        polygon = polygon[:-1]
    if len(polygon) < 3:
        raise ParameterError(PATH, f"{name}an outline needs three points or more, not {len(polygon)}.")
    _, first, counts = np.unique(polygon, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        k = int(first[counts > 1].min())
        raise ParameterError(PATH, f"{name}the point {place(polygon[k])} appears {counts[first == k][0]} times; give each point once.")
    _check_simple(polygon, name)
    return polygon if signed_area(polygon) > 0.0 else polygon[::-1].copy()


def _check_simple(polygon: Points, name: str) -> None:
    """Refuse a polygon that crosses itself or encloses nothing."""
    area, extent = signed_area(polygon), np.ptp(polygon, axis=0).max()
    flat = polygon - polygon.mean(axis=0)
    if np.linalg.svd(flat, compute_uv=False)[-1] <= 1e-12 * extent:
        raise ParameterError(
            PATH, f"{name}all points lie on a line through {place(polygon[0])} and {place(polygon[-1])}; the outline has no area."
        )
    edges = closed_edges(len(polygon))
    found = first_crossing(polygon, edges)
    if found is not None:
        i, j = sorted(found)
        raise ParameterError(
            PATH,
            f"{name}the outline crosses or touches itself near {place(_meeting(polygon[edges[i]], polygon[edges[j]]))}, where its "
            f"side from point {i + 1} meets that from point {j + 1}.",
        )
    if abs(area) <= 1e-12 * extent**2:
        raise ParameterError(PATH, f"{name}the outline around {place(polygon.mean(axis=0))} has no area.")


def _check_apart(loops: Sequence[Points]) -> None:
    """Refuse polygons that cross or touch each other."""
    counts = [len(loop) for loop in loops]
    points, edges = np.concatenate(loops), closed_edges(*counts)
    found = first_crossing(points, edges)
    if found is not None:
        i, j = sorted(found)
        first, second = np.searchsorted(np.cumsum(counts), [i, j], side="right") + 1
        raise ParameterError(
            PATH,
            f"loops {first} and {second} cross or touch near {place(_meeting(points[edges[i]], points[edges[j]]))}; "
            "draw them apart, or join them to one.",
        )


def _outer(loops: Sequence[Points]) -> int:
    """The number of the polygon that contains all others, which must not contain each other."""
    around = np.array([[k != i and bool(inside(loop[:1], edges_of([other]))[0]) for k, other in enumerate(loops)]
                       for i, loop in enumerate(loops)])  # fmt: skip
    depth = around.sum(axis=1)
    free = np.flatnonzero(depth == 0)
    if len(free) > 1:
        where = ", ".join(middle_of(loops[k]) for k in free[:6])
        more = ", ..." if len(free) > 6 else ""
        raise ParameterError(PATH, f"the outlines enclose {len(free)} separate bodies, around {where}{more}; give one.")
    if depth.max() > 1:
        i = int(np.argmax(depth > 1))
        hole = int(np.flatnonzero(around[i] & (depth == 1))[0])
        raise ParameterError(
            PATH,
            f"loop {i + 1} around {middle_of(loops[i])} lies within the hole that loop {hole + 1} around {middle_of(loops[hole])} is, and "
            "what it encloses would be a separate body; leave one of them out.",
        )
    return int(free[0])


def _meeting(first: Points, second: Points) -> Points:
    """Where two segments cross, or the middle of what lies between them where they are parallel."""
    along, other = first[1] - first[0], second[1] - second[0]
    determinant = float(along[0] * other[1] - along[1] * other[0])
    if abs(determinant) < 1e-12 * np.hypot(*along) * np.hypot(*other):
        return np.asarray((first.mean(axis=0) + second.mean(axis=0)) / 2.0)
    apart = second[0] - first[0]
    return np.asarray(first[0] + (apart[0] * other[1] - apart[1] * other[0]) / determinant * along)
