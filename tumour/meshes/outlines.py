"""Bodies from an outline: a glioma by a formula, and any closed polygon, with holes or without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay

from multiphase.errors import ParameterError
from tumour.meshes.body import Body, angles, finite_positive, make_body, place
from tumour.meshes.filling import fill, missing_sides
from tumour.meshes.loops import PATH, Loops, area_of, checked, edges_of, middle_of
from tumour.meshes.polygons import Numbers, Points, closed_edges, corners, cross, first_crossing, inscribed_radius, inside, resampled

WAVES = ((2, 0.20, 0.6), (3, 0.13, 4.0), (4, 0.12, 2.5), (5, 0.10, 1.3), (7, 0.05, 0.2))
"""Wave number, amplitude and phase of what the glioma's outline adds to a circle."""

FINE = 4096
"""Points of the polygon that stands for the glioma's outline; it departs from the curve by 1e-6 of the radius."""

SHARPEST = 20.0
"""Least angle, in degrees, that triangles within an outline must have."""

SHARP_CORNER = 50.0
"""Angle of a corner, in degrees, below which the corner and not the size is to blame."""

LEAST_SIDES = 6
"""Sides that a mesh must have on the outer surface, and on that of each hole."""

FEW = 100
"""Points of a grid of 121 by 121 within a body, below which it is too narrow to find its largest circle from these alone."""

MOST_TRIANGLES = 4_000_000
"""Triangles beyond which the size of an element is refused as too small."""

SIZE = "geometry.size"


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
    return _filled((glioma_outline(R, FINE),), h, R)


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
    return _inscribed((_unit_glioma(FINE),))


def _inscribed(loops: Loops) -> float:
    """Radius of the largest circle within a body."""
    low, high = loops[0].min(axis=0), loops[0].max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 121).T), axis=-1).reshape(-1, 2)
    ends = edges_of(loops)
    candidates = grid[inside(grid, ends)]
    if len(candidates) < FEW:
        points = np.concatenate(loops)
        middles = points[Delaunay(points).simplices].mean(axis=1)
        candidates = np.concatenate((candidates, middles[inside(middles, ends)]))
    return inscribed_radius(candidates, ends)


def inscribed(points: ArrayLike, holes: Sequence[ArrayLike] = ()) -> float:
    """Radius of the largest circle within an outline and outside its holes; refuses what `outline` does."""
    return _inscribed(checked(points, holes))


def outline(points: ArrayLike, size: float, holes: Sequence[ArrayLike] = ()) -> Body:
    """The body within a closed polygon and outside holes in it, free all round, meshed with sides of about `size`.

    The polygons are followed at equal steps of arc length and rounded off between them; their corners, where they turn by 40 degrees or
    more within an element, are kept. The sides of the body are "surface", which is all of it, "outer", and "hole 1", "hole 2", ... in
    order of decreasing area.

    Parameters
    ----------
    points : (n, 2) array
        Corners of the polygon in either order; the last may repeat the first.
    size : float
        Length of a triangle's side.
    holes : sequence of (n, 2) array
        Polygons without tissue, likewise. Which of all polygons is the outer one is seen from where they lie.

    Raises
    ------
    ParameterError
        For an outline that crosses itself, repeats a point or encloses nothing; holes that cross, touch or contain each other or do not
        lie within; and for a size that parts of the body are too narrow for, or holes too small.
    """
    loops = checked(points, holes)
    return _filled(loops, finite_positive(size, SIZE), None)


def _filled(loops: Loops, size: float, radius: float | None) -> Body:
    """The body within simple polygons, the outer one counterclockwise and holes clockwise; without a given radius, an `outline`."""
    count = area_of(loops) / (np.sqrt(0.1875) * size**2)
    if count > MOST_TRIANGLES:
        raise ParameterError(
            SIZE, f"{size:g} would make {count:.2g} triangles, and {MOST_TRIANGLES:.2g} are the most allowed; take a larger one."
        )
    rings = [resampled(loop, size) for loop in loops]
    _check_resampled(loops, rings, size)
    points, triangles = fill(rings, size)
    _check_filled(loops, size, points, triangles, closed_edges(*map(len, rings))[:, 1])
    count = sum(map(len, rings))
    inscribed = _inscribed(loops) if radius is None else radius
    sides = _sides(rings) if radius is None else None
    return make_body(points, triangles, surface=np.arange(count), radius=inscribed, sides=sides, path=PATH)


def _sides(rings: Sequence[Points]) -> Mapping[str, Numbers]:
    """The edges of the parts of the surface, by name."""
    edges = closed_edges(*map(len, rings))
    parts = np.split(edges, np.cumsum([len(ring) for ring in rings])[:-1])
    return {"surface": edges, "outer": parts[0], **{f"hole {k}": part for k, part in enumerate(parts[1:], 1)}}


def _check_filled(loops: Loops, size: float, points: Points, triangles: Numbers, after: Numbers) -> None:
    """Refuse triangles that leave a part of the body out, are pinned to its surface or too sharp."""
    missing = missing_sides(triangles, after)
    if len(missing):
        raise _refused(loops, size, points[missing[0]], "no triangles fill this part")
    pinned = (triangles < len(after)).all(axis=1)
    if pinned.any():
        at = points[triangles[np.argmax(pinned)]].mean(axis=0)
        raise _refused(loops, size, at, "there is no room for a node within, and what holds at the surface would hold all across")
    every = angles(points, triangles)
    t, k = divmod(int(np.argmin(every)), 3)
    if every[t, k] < SHARPEST:
        raise _refused(loops, size, points[triangles[t, k]], f"the best triangles found have an angle of {every[t, k]:.3g} degrees")


def _check_resampled(loops: Loops, rings: Sequence[Points], size: float) -> None:
    """Refuse a size at which too little is left of a polygon, or parts of them run into each other."""
    for k, (loop, ring) in enumerate(zip(loops, rings, strict=True)):
        if len(ring) < LEAST_SIDES and not k:
            raise _too_large(size, loop[0], f"it leaves fewer than {LEAST_SIDES} sides of the outline")
        if len(ring) < LEAST_SIDES:
            raise ParameterError(
                SIZE,
                f"{size:g} is too large for the hole around {middle_of(loop)}: it leaves fewer than {LEAST_SIDES} sides of it; "
                f"take a smaller one, such as {size / 2.0:g}, or leave the hole out.",
            )
    points, edges = np.concatenate(rings), closed_edges(*map(len, rings))
    found = first_crossing(points, edges)
    if found is not None:
        raise _too_large(size, points[edges[list(found)]].mean(axis=(0, 1)), "two sides of the outline come together")


def _refused(loops: Loops, size: float, at: Points, why: str) -> ParameterError:
    """What to say about a place that cannot be filled: there is a sharp corner, or it is narrow."""
    kept = [corners(loop, size) for loop in loops]
    before, point, after = (
        np.concatenate([loop[(k + step) % len(loop)] for loop, k in zip(loops, kept, strict=True)]) for step in (-1, 0, 1)
    )
    count = len(point)
    corner = angles(np.concatenate((before, point, after)), np.arange(3 * count).reshape(3, -1).T)[:, 1]
    is_convex = cross(point - before, after - point) > 0.0
    near = is_convex & (np.hypot(*(point - at).T) < (2.0 + 2.0 / np.radians(corner)) * size) & (corner < SHARP_CORNER)
    if near.any():
        i = np.flatnonzero(near)[np.argmin(corner[near])]
        return ParameterError(
            PATH, f"the corner at {place(point[i])} is too sharp, {corner[i]:.3g} degrees: near {place(at)} {why}; round it off."
        )
    return _too_large(size, at, why)


def _too_large(size: float, at: Points, why: str) -> ParameterError:
    return ParameterError(SIZE, f"{size:g} is too large near {place(at)}: {why}; take a smaller one, such as {size / 2.0:g}.")
