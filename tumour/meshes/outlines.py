"""Bodies from an outline: a glioma by a formula, and any closed polygon."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from multiphase.errors import ParameterError
from tumour.meshes.body import Body, angles, finite_positive, make_body, place
from tumour.meshes.filling import fill, missing_sides
from tumour.meshes.polygons import (
    Points,
    closed_edges,
    corners,
    cross,
    first_crossing,
    inscribed_radius,
    inside,
    resampled,
    signed_area,
)

WAVES = ((2, 0.20, 0.6), (3, 0.13, 4.0), (4, 0.12, 2.5), (5, 0.10, 1.3), (7, 0.05, 0.2))
"""Wave number, amplitude and phase of what the glioma's outline adds to a circle."""

FINE = 4096
"""Points of the polygon that stands for the glioma's outline; it departs from the curve by 1e-6 of the radius."""

SHARPEST = 20.0
"""Least angle, in degrees, that triangles within an outline must have."""

SHARP_CORNER = 50.0
"""Angle of a corner, in degrees, below which the corner and not the size is to blame."""

LEAST_SIDES = 6
"""Sides of the surface that a mesh must have."""

MOST_TRIANGLES = 4_000_000
"""Triangles beyond which the size of an element is refused as too small."""

PATH, SIZE = "geometry.points", "geometry.size"


def glioma(radius: float = 0.4, size: float | None = None) -> Body:
    """A body with the outline of `glioma_outline`, meshed with sides of about `size`.

    Parameters
    ----------
    radius : float
        Of the largest circle within.
    size : float, optional
        Length of a triangle's side; a sixteenth of the radius unless given.
    """
    R = finite_positive(radius, "geometry.radius")
    h = R / 16.0 if size is None else finite_positive(size, SIZE)
    return _filled(glioma_outline(R, FINE), h, R)


def glioma_outline(radius: float, count: int) -> Points:
    """`count` points on a closed smooth curve with five unequal lobes, counterclockwise, at equal steps of the angle theta.

    The curve is that of r(theta) = a (1 + 0.20 cos(2 theta - 0.6) + 0.13 cos(3 theta - 4) + 0.12 cos(4 theta - 2.5) +
    0.10 cos(5 theta - 1.3) + 0.05 cos(7 theta - 0.2)), with a such that the largest circle within has the given radius. It is nobody's
    tumour: it has what the outlines of segmented gliomas have, lobes of different sizes and re-entrant parts between them.
    """
    R = finite_positive(radius, "geometry.radius")
    return np.asarray(R / _unit_inscribed() * _unit_glioma(count))


def _unit_glioma(count: int) -> Points:
    """The glioma's outline with a = 1."""
    theta = 2.0 * np.pi * np.arange(count) / count
    r = 1.0 + sum(height * np.cos(wave * theta - phase) for wave, height, phase in WAVES)
    return np.column_stack((r * np.cos(theta), r * np.sin(theta)))


@lru_cache(maxsize=1)
def _unit_inscribed() -> float:
    """Radius of the largest circle within the outline with a = 1."""
    return _inscribed(_unit_glioma(FINE))


def _inscribed(polygon: Points) -> float:
    """Radius of the largest circle within a polygon."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 121).T), axis=-1).reshape(-1, 2)
    ends = polygon[closed_edges(len(polygon))]
    return inscribed_radius(grid[inside(grid, ends)], ends)


def inscribed(points: ArrayLike) -> float:
    """Radius of the largest circle within an outline; refuses what `outline` does."""
    return _inscribed(_checked(points))


def outline(points: ArrayLike, size: float) -> Body:
    """The body within a closed polygon, free all round, meshed with sides of about `size`.

    The polygon is followed at equal steps of arc length and rounded off between them; its corners, where it turns by 40 degrees or
    more within an element, are kept.

    Parameters
    ----------
    points : (n, 2) array
        Corners of the polygon in either order; the last may repeat the first.
    size : float
        Length of a triangle's side.

    Raises
    ------
    ParameterError
        For an outline that crosses itself, repeats a point or encloses nothing, and for a size that its parts are too narrow for.
    """
    polygon = _checked(points)
    return _filled(polygon, finite_positive(size, SIZE), None)


def _checked(points: ArrayLike) -> Points:
    """The polygon, counterclockwise, without a last point that repeats the first."""
    try:
        polygon = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError(PATH, "must be numbers in two columns, x and y.") from None
    if polygon.ndim != 2 or polygon.shape[1] != 2:
        raise ParameterError(PATH, f"must have two columns, x and y, but their shape is {polygon.shape}.")
    if not np.isfinite(polygon).all():
        bad = int(np.argmin(np.isfinite(polygon).all(axis=1)))
        raise ParameterError(PATH, f"point {bad + 1}, ({polygon[bad, 0]:g}, {polygon[bad, 1]:g}), is no pair of finite numbers.")
    if len(polygon) > 1 and (polygon[0] == polygon[-1]).all():
        polygon = polygon[:-1]
    if len(polygon) < 3:
        raise ParameterError(PATH, f"an outline needs three points or more, not {len(polygon)}.")
    _, first, counts = np.unique(polygon, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        k = int(first[counts > 1].min())
        raise ParameterError(PATH, f"the point {place(polygon[k])} appears {counts[first == k][0]} times; give each point once.")
    area, extent = signed_area(polygon), np.ptp(polygon, axis=0).max()
    flat = polygon - polygon.mean(axis=0)
    if np.linalg.svd(flat, compute_uv=False)[-1] <= 1e-12 * extent:
        raise ParameterError(
            PATH, f"all points lie on a line through {place(polygon[0])} and {place(polygon[-1])}; the outline has no area."
        )
    edges = closed_edges(len(polygon))
    found = first_crossing(polygon, edges)
    if found is not None:
        i, j = sorted(found)
        raise ParameterError(
            PATH,
            f"the outline crosses or touches itself near {place(_meeting(polygon[edges[i]], polygon[edges[j]]))}, where its "
            f"side from point {i + 1} meets that from point {j + 1}.",
        )
    if abs(area) <= 1e-12 * extent**2:
        raise ParameterError(PATH, f"the outline around {place(polygon.mean(axis=0))} has no area.")
    return polygon if area > 0.0 else polygon[::-1].copy()


def _meeting(first: Points, second: Points) -> Points:
    """Where two segments cross, or the middle of what lies between them where they are parallel."""
    along, other = first[1] - first[0], second[1] - second[0]
    determinant = float(along[0] * other[1] - along[1] * other[0])
    if abs(determinant) < 1e-12 * np.hypot(*along) * np.hypot(*other):
        return np.asarray((first.mean(axis=0) + second.mean(axis=0)) / 2.0)
    apart = second[0] - first[0]
    return np.asarray(first[0] + (apart[0] * other[1] - apart[1] * other[0]) / determinant * along)


def _filled(polygon: Points, size: float, radius: float | None) -> Body:
    """The body within a simple polygon, counterclockwise."""
    count = signed_area(polygon) / (np.sqrt(0.1875) * size**2)
    if count > MOST_TRIANGLES:
        raise ParameterError(
            SIZE, f"{size:g} would make {count:.2g} triangles, and {MOST_TRIANGLES:.2g} are the most allowed; take a larger one."
        )
    boundary = resampled(polygon, size)
    _check_resampled(polygon, boundary, size)
    points, triangles = fill(boundary, size)
    count = len(boundary)
    missing = missing_sides(triangles, count)
    if len(missing):
        raise _refused(polygon, size, boundary[missing[0]], "no triangles fill this part")
    pinned = (triangles < count).all(axis=1)
    if pinned.any():
        at = points[triangles[np.argmax(pinned)]].mean(axis=0)
        raise _refused(polygon, size, at, "there is no room for a node within, and what holds at the surface would hold all across")
    every = angles(points, triangles)
    t, k = divmod(int(np.argmin(every)), 3)
    if every[t, k] < SHARPEST:
        raise _refused(polygon, size, points[triangles[t, k]], f"the best triangles found have an angle of {every[t, k]:.3g} degrees")
    inscribed = _inscribed(polygon) if radius is None else radius
    return make_body(points, triangles, surface=np.arange(count), radius=inscribed, path=PATH)


def _check_resampled(polygon: Points, boundary: Points, size: float) -> None:
    """Refuse a size at which too little is left of the outline, or its parts run into each other."""
    if len(boundary) < LEAST_SIDES:
        raise _too_large(size, polygon[0], f"it leaves fewer than {LEAST_SIDES} sides of the outline")
    edges = closed_edges(len(boundary))
    found = first_crossing(boundary, edges)
    if found is not None:
        raise _too_large(size, boundary[edges[list(found)]].mean(axis=(0, 1)), "two sides of the outline come together")


def _refused(polygon: Points, size: float, at: Points, why: str) -> ParameterError:
    """What to say about a place that cannot be filled: there is a sharp corner, or it is narrow."""
    k = corners(polygon, size)
    before, after = polygon[k - 1], polygon[(k + 1) % len(polygon)]
    corner = angles(np.concatenate((before, polygon[k], after)), np.arange(3 * len(k)).reshape(3, -1).T)[:, 1]
    is_convex = cross(polygon[k] - before, after - polygon[k]) > 0.0
    near = is_convex & (np.hypot(*(polygon[k] - at).T) < (2.0 + 2.0 / np.radians(corner)) * size) & (corner < SHARP_CORNER)
    if near.any():
        i = np.flatnonzero(near)[np.argmin(corner[near])]
        return ParameterError(
            PATH, f"the corner at {place(polygon[k[i]])} is too sharp, {corner[i]:.3g} degrees: near {place(at)} {why}; round it off."
        )
    return _too_large(size, at, why)


def _too_large(size: float, at: Points, why: str) -> ParameterError:
    return ParameterError(SIZE, f"{size:g} is too large near {place(at)}: {why}; take a smaller one, such as {size / 2.0:g}.")
