"""Whether what is said of a body's surface leaves one solution: its rigid motions, the loads on what nothing holds, and the levels of
pressure and oxygen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from tumour.boundary import CLOSED, OUTSIDE, TABLE, BoundaryPart, acts
from tumour.fem.arrays import FIELDS
from tumour.meshes.body import place

if TYPE_CHECKING:
    from tumour.fem.surface import Surface

Array = NDArray[np.float64]

X, Y, ALPHA, P, OXYGEN = range(FIELDS)

ROUNDING = 1e-9
"""Of the size of a body, or of all forces on it: differences that rounding and files with ten digits explain."""

FREE = 1e-12
"""Square of how firmly a motion is held, over that of the others, below which it is free: two points a millionth of the body apart hold it
from turning more firmly than that, and the coordinates of a file in ten digits less."""

_HOLD = "hold a part of the surface, or give one a spring"


def check(surface: Surface) -> None:
    """Refuse a surface that does not determine the solution.

    Raises
    ------
    ParameterError
        Where forces act on a body that nothing holds against them, and where nothing sets the level of the pressure or of the oxygen.
    """
    _check_tractions(surface)
    _check_follower_loads(surface)
    _check_level_of_pressure(surface)
    _check_oxygen(surface)


# -- Rigid motions ------------------------------------------------------------------------------------------------------


def free_motions(surface: Surface) -> tuple[NDArray[np.bool_], bool]:
    """Whether the body is free to shift in x and in y, and to turn.

    An infinitesimal rigid motion is held where a displacement that it changes is prescribed, or where it moves an edge against a spring. A
    spring along the normal is looked at in the middles of its edges: so the chords of a circle do not hold it from turning about its
    centre, as the circle itself does not.

    Raises
    ------
    ParameterError
        Where the body is free to move in another way than along x, along y, or in all ways.
    """
    middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
    size = float(np.max(np.ptp(surface.points, axis=0)))
    gram = np.zeros((3, 3))
    for normals, places in _holds(surface):
        arms = (places - middle) / size
        rows = np.column_stack((normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]))
        gram += rows.T @ rows / max(len(rows), 1)
    strengths, motions = np.linalg.eigh(gram)
    free = strengths <= FREE
    shifts = np.diag(gram)[:2] <= FREE
    if (int(np.sum(free)), int(np.sum(shifts))) not in ((0, 0), (1, 1), (3, 2)):
        raise ParameterError(TABLE, _still(motions[:, free], middle, size))
    return shifts, bool(free.all())


def _holds(surface: Surface) -> Iterator[tuple[Array, Array]]:
    """Directions in which points are held, and those points."""
    edges, points = surface.body.edges, surface.points
    for axis in (X, Y):
        held = points[surface.prescribed[:, axis]]
        yield np.broadcast_to(np.eye(2)[axis], held.shape), held
    for part, numbers in zip(surface.parts, surface.numbers, strict=True):
        if part.spring > 0.0:
            ends = points[np.unique(edges[numbers])]
            for direction in np.eye(2):
                yield np.broadcast_to(direction, ends.shape), ends
        if part.spring_normal > 0.0:
            yield surface.normals[numbers], surface.middles[numbers]


def _still(motions: Array, middle: Array, size: float) -> str:
    """What to say of a body that may move as the columns of `motions` do."""
    advice = "hold it on a whole side, at more than one point, or give a part a spring."
    if motions.shape[1] > 1:
        return f"the body is held so that it may still both move and turn; {advice}"
    a, b, turn = motions[:, 0]
    if abs(turn) <= ROUNDING:
        return f"the body is held so that it may still move along ({a:.3g}, {b:.3g}), which is no axis; {advice}"
    centre = np.round((middle + size * np.array([-b, a]) / turn) / size, 9) * size + 0.0  # without -0
    return f"the body is held so that it may still turn about {place(centre)}; {advice}"


# -- Forces that nothing holds ------------------------------------------------------------------------------------------


def _moments(surface: Surface) -> list[tuple[float, int]]:
    """Times, and the sides from which to look at them, between which everything given in time is linear."""
    return [(0.0, 1), *((t, side) for t in surface.breaks for side in (-1, 1))]


def _check_tractions(surface: Surface) -> None:
    """Refuse dead tractions on a body that is free to turn, and such that do not balance along an axis on which it is free to shift."""
    shifts, turns = surface.free_motions
    lengths = surface.edges.lengths
    for axis in np.flatnonzero(shifts):
        key = f"traction_{'xy'[axis]}"
        first = next((part for part in surface.parts if acts(getattr(part, key))), None)
        if first is None:
            continue
        if turns:
            raise ParameterError(f"{first.path}.{key}", f"nothing holds the body, so that a traction would move or turn it away; {_HOLD}.")
        for t, side in _moments(surface):
            forces = lengths * surface.actions(t, side)[:, axis]
            if abs(np.sum(forces)) > ROUNDING * np.sum(np.abs(forces)):
                raise ParameterError(
                    f"{first.path}.{key}",
                    f"the tractions along {'xy'[axis]} add up to {np.sum(forces):.4g} at t = {t:g}, and nothing holds the body in this "
                    f"direction; let them balance, {_HOLD}.",
                )


def _check_follower_loads(surface: Surface) -> None:
    """Refuse pressures that would push a body away that is free to move: those that act neither on whole closed lines nor on lines between
    two points that stay at the same height."""
    shifts, _ = surface.free_motions
    for load in dict.fromkeys(part.load for part in surface.parts if acts(part.load)):
        of = [i for i, part in enumerate(surface.parts) if part.load == load]
        starts, ends = surface.body.edges[np.isin(surface.owner, of)].T
        count = len(surface.points)
        passing = np.bincount(ends, minlength=count) - np.bincount(starts, minlength=count)
        tips = np.flatnonzero(passing)
        for axis in np.flatnonzero(shifts):
            if not _keeps_height(surface, tips, passing[tips], 1 - int(axis)):
                raise ParameterError(
                    f"{surface.parts[of[0]].path}.load",
                    "nothing holds the body against this pressure, which does not act on the whole of a closed line and would push the "
                    f"body away; let it act on all of the line, {_HOLD}.",
                )


def _keeps_height(surface: Surface, tips: NDArray[np.int64], signs: NDArray[np.int64], other: int) -> bool:
    """Whether the sum of the tips' other coordinates, which is the force, is 0 at all times."""
    if not surface.prescribed[tips, other].all():
        return False
    size = float(np.max(np.ptp(surface.points, axis=0)))
    sums = [signs @ (surface.points[tips, other] + surface.values(t, side)[tips, other]) for t, side in _moments(surface)]
    return bool(np.max(np.abs(sums)) <= ROUNDING * size)


# -- Levels of pressure and oxygen --------------------------------------------------------------------------------------


def check_pressure(surface: Surface) -> None:
    """Refuse pressures that mean nothing where the fluid flows freely, and a surface that lets none of it through then."""
    if surface.parameters.kappa != 0.0:
        return
    for part in surface.parts:
        if part.p not in (OUTSIDE, CLOSED):
            raise ParameterError(f"{part.path}.p", "it has no effect with kappa = 0, where the fluid is at p_out everywhere; leave it out.")
    if _is_all(surface, lambda part: part.p == CLOSED):
        raise ParameterError(
            f"{surface.parts[0].path}.p",
            'with kappa = 0 the fluid flows freely at p_out, but all of the surface is "closed"; take kappa > 0, or open a part.',
        )


def _is_all(surface: Surface, holds: Callable[[BoundaryPart], bool]) -> bool:
    """Whether something holds for all of the surface."""
    return bool(surface.parts) and bool((surface.owner >= 0).all()) and all(holds(part) for part in surface.parts)


def _check_level_of_pressure(surface: Surface) -> None:
    """Refuse a body that is held all round and lets no fluid through: a constant may be added to its pressure."""
    if surface.prescribed[:, P].any():
        return
    a, b = surface.body.edges.T
    both = surface.prescribed[a, :2] & surface.prescribed[b, :2]
    upright = np.abs(surface.normals) >= 1.0 - ROUNDING  # edges along the other axis: a pressure pushes them along this one alone
    if np.all(both.all(axis=1) | (both & upright).any(axis=1)):  # the straight sides on which a body slides are like that, too
        raise ParameterError(
            f"{surface.parts[0].path}.p",
            'nothing sets the level of the pressure: all of the surface is held and "closed" to the fluid; give p on a part, or free one.',
        )


def _check_oxygen(surface: Surface) -> None:
    """Refuse a body whose oxygen nothing sets."""
    if surface.prescribed[:, OXYGEN].any() or any(part.membrane for part in surface.parts):
        return
    path = f"{surface.parts[0].path}.C"
    if not _takes_up(surface):
        raise ParameterError(
            path, 'the oxygen has no level: all of the surface is "closed" to it, and nobody takes it up; give C on a part.'
        )
    if not any(value > 0.0 for part in surface.parts for value in part.influx.values):
        raise ParameterError(path, 'nothing brings oxygen in: all of the surface is "closed" to it; give C or an influx on a part.')


def _takes_up(surface: Surface) -> bool:
    """Whether oxygen is taken up somewhere, by the values at the points of the mesh and in the middles of its triangles."""
    consumption = surface.parameters.consumption
    if surface.parameters.Q == 0.0 or consumption.constant is not None:
        return bool(surface.parameters.Q > 0.0 and consumption.constant > 0.0)
    body = surface.body
    x, y = np.concatenate((surface.points, surface.points[body.mesh.t.T].mean(axis=1))).T
    r = np.hypot(x, y)
    return bool(np.any(consumption(x=x, y=y, r=r, theta=np.arctan2(y, x), xi=r / body.radius) > 0.0))
