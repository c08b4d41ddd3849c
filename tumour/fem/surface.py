"""The named parts of a body's surface on its mesh: which edges they are, what is prescribed at their points, what acts on their edges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import nearest
from multiphase.series import TimeSeries
from tumour.boundary import CLOSED, OUTSIDE, BoundaryPart, TumourBoundary, acts
from tumour.fem.arrays import ACTIONS, FIELDS, Edges
from tumour.fem.wellposed import check, check_pressure, free_motions
from tumour.meshes import Body
from tumour.meshes.body import place
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Truth = NDArray[np.bool_]

X, Y, ALPHA, P, OXYGEN = range(FIELDS)
FREE = -1
"""Source of an unknown that is not prescribed."""


class Surface:
    """What a scene says of the surface of its body, on the mesh of the body.

    Parameters
    ----------
    body : tumour.meshes.Body
    boundary : TumourBoundary or None
        The named parts; without any, all of the surface is free, at p_out and C_out.
    parameters : TumourParameters

    Attributes
    ----------
    parts : tuple of BoundaryPart
    numbers : tuple of array of int
        The edges of each part, as numbers among ``body.edges``.
    lengths, normals : (edges of the body,), (edges of the body, 2) arrays
        At rest, of all edges of the free surface; outward unit normals.
    edges : Edges
        Those on which something acts that needs an integral.
    prescribed : (points, 5) array of bool
        Which of d_x, d_y, alpha, p, C are prescribed.
    jumps, breaks : tuple of float
        When something jumps, and when something has a jump or a kink.
    has_own_oxygen, has_own_pressure : bool
        Whether some part brings in, or is at, another oxygen than C_out, and whether one is at another pressure than p_out.
    has_uniform_oxygen : bool
        Whether oxygen is C_out everywhere, as nobody takes it up and no part changes it.

    Raises
    ------
    ParameterError
        For a part that is nowhere or overlaps another one, and where the problem would not be well posed: see `tumour.fem.wellposed`.
    """

    def __init__(self, body: Body, boundary: TumourBoundary | None, parameters: TumourParameters) -> None:
        self.body, self.parameters = body, parameters
        self.parts: tuple[BoundaryPart, ...] = () if boundary is None else boundary.parts
        self.points = body.mesh.p.T
        along = self.points[body.edges[:, 1]] - self.points[body.edges[:, 0]]
        self.lengths: Array = np.hypot(*along.T)
        self.normals: Array = np.column_stack((along[:, 1], -along[:, 0])) / self.lengths[:, None]
        self.numbers: tuple[Numbers, ...] = tuple(self._select(part) for part in self.parts)
        self.owner = self._owners()
        self.has_own_oxygen = any(_changes_oxygen(part, parameters.C_out) for part in self.parts)
        self.has_own_pressure = any(_differs(part.p, parameters.p_out) for part in self.parts)
        idle = parameters.Q == 0.0 or parameters.consumption == 0.0
        self.has_uniform_oxygen = idle and not self.has_own_oxygen
        series = [one for part in self.parts for one in part.series]
        self.jumps: tuple[float, ...] = tuple(sorted({t for one in series for t in one.jumps}))
        self.breaks: tuple[float, ...] = tuple(sorted({t for one in series for t in one.breaks}))
        check_pressure(self)
        source = self._sources()
        self.prescribed: Truth = source != FREE
        self._given = self._series_of(source)
        self._acting = np.flatnonzero(np.isin(self.owner, [i for i, part in enumerate(self.parts) if _acts(part)]))
        self.edges = self._edges()
        self.free_motions: tuple[Truth, bool] = free_motions(self)
        """Whether the body is free to shift, (2,), and to turn."""
        check(self)

    # -- Which edges -----------------------------------------------------------------------------------------------------

    def _select(self, part: BoundaryPart) -> Numbers:
        """The edges of a part."""
        body = self.body
        chosen = np.ones(len(body.edges), dtype=bool)
        if part.side is not None:
            if part.side not in body.sides:
                slides = "; lines on which the body slides are none of them" if body.slide_x.size or body.slide_y.size else ""
                known = ", ".join(f'"{name}"' for name in body.sides)
                raise ParameterError(
                    f"{part.path}.side",
                    f'the free surface has no side "{part.side}"{nearest(part.side, body.sides)} Its sides are {known}{slides}.',
                )
            chosen[:] = False
            chosen[body.sides[part.side]] = True
        if part.where is not None:
            x, y = self.middles.T
            r = np.hypot(x, y)
            chosen &= part.formula(x=x, y=y, r=r, theta=np.arctan2(y, x), xi=r / body.radius) > 0.0
        if not chosen.any():
            (left, low), (right, high) = self.middles.min(axis=0), self.middles.max(axis=0)
            key = "side" if part.where is None else "where"
            reach = f"its edges have their middles at x from {left:.6g} to {right:.6g} and y from {low:.6g} to {high:.6g}"
            raise ParameterError(f"{part.path}.{key}", f"it holds on no edge of the free surface; {reach}.")
        return np.flatnonzero(chosen)

    @property
    def middles(self) -> Array:
        """Middles of the edges of the free surface at rest."""
        return np.asarray(self.points[self.body.edges].mean(axis=1))

    def _owners(self) -> Numbers:
        """The number of the part of each edge; -1 where no part claims it."""
        owner = np.full(len(self.body.edges), -1)
        for i, (part, numbers) in enumerate(zip(self.parts, self.numbers, strict=True)):
            taken = numbers[owner[numbers] >= 0]
            if len(taken):
                other, at = self.parts[owner[taken[0]]], place(self.middles[taken[0]])
                edges = "an edge" if len(taken) == 1 else f"{len(taken)} edges"
                raise ParameterError(
                    part.path, f'"{part.name}" and "{other.name}" both claim {edges}, one of them at {at}; parts may not overlap.'
                )
            owner[numbers] = i
        return owner

    def nodes(self, i: int) -> Numbers:
        """The points of a part."""
        return np.unique(self.body.edges[self.numbers[i]])

    # -- What is prescribed ----------------------------------------------------------------------------------------------

    def _sources(self) -> Numbers:
        """Where the value of each unknown comes from, (points, 5): the number of a part, that of parts for what holds without any (0, p_out
        and C_out), or `FREE`. A body does not leave its straight sides whatever a part says that ends there."""
        body, default = self.body, len(self.parts)
        source = np.full((len(self.points), FIELDS), FREE)
        unclaimed = self.owner < 0
        lone = np.setdiff1d(body.surface, body.edges[~unclaimed])  # of no part
        source[lone, P] = source[lone, OXYGEN] = default
        source[body.edges[unclaimed], P] = source[body.edges[unclaimed], OXYGEN] = default
        for i in reversed(range(len(self.parts))):  # the first one named is the last to be written
            part, nodes = self.parts[i], self.nodes(i)
            for column, _ in self._prescribes(part):
                source[nodes, column] = i
        source[body.slide_x, X] = source[body.slide_y, Y] = default
        if self.parameters.kappa == 0.0:
            source[:, P] = default  # fluid that flows freely is at p_out everywhere
        if self.has_uniform_oxygen:
            source[:, OXYGEN] = default  # oxygen that nobody takes up is C_out everywhere
        return source

    @staticmethod
    def _prescribes(part: BoundaryPart) -> list[tuple[int, Any]]:
        """Columns that a part prescribes, and what."""
        pairs = [(X, part.displacement_x), (Y, part.displacement_y), (P, part.p), (OXYGEN, CLOSED if part.membrane else part.C)]
        return [(column, value) for column, value in pairs if value is not None and value != CLOSED]

    def _series_of(self, source: Numbers) -> list[tuple[Numbers, int, TimeSeries]]:
        """Points, column and values in time of what parts prescribe."""
        return [
            (np.flatnonzero(source[:, column] == i), column, value)
            for i, part in enumerate(self.parts)
            for column, value in self._prescribes(part)
            if isinstance(value, TimeSeries)
        ]

    def values(self, t: float, side: int = 1) -> Array:
        """What is prescribed at `t`, (points, 5), elsewhere 0, p_out and C_out; with ``side=-1`` just before a jump."""
        values = np.zeros((len(self.points), FIELDS))
        values[:, P], values[:, OXYGEN] = self.parameters.p_out, self.parameters.C_out
        for nodes, column, series in self._given:
            values[nodes, column] = series(t, side)
        return values

    # -- What acts -------------------------------------------------------------------------------------------------------

    def _edges(self) -> Edges:
        """The edges on which something acts, with the triangles that they are sides of."""
        which, own = self._acting, self.owner[self._acting]
        springs = np.array([(part.spring, part.spring_normal) for part in self.parts]).reshape(-1, 2)
        membranes = np.array([part.membrane or 0.0 for part in self.parts])
        triangles, corners = self._sides(self.body.edges[which])
        return Edges(
            triangles, corners, (corners + 1) % 3, self.lengths[which], self.normals[which], springs[own], membranes[own]
        )  # fmt: skip

    def _sides(self, edges: Numbers) -> tuple[Numbers, Numbers]:
        """The triangle of each edge, and its corner where the edge begins."""
        triangles, count = self.body.mesh.t.T.astype(np.int64), len(self.points)
        on_edge = np.zeros(count, dtype=bool)
        on_edge[edges] = True
        near = np.flatnonzero(np.sum(on_edge[triangles], axis=1) >= 2)
        keys = triangles[near] * count + np.roll(triangles[near], -1, axis=1)
        order = np.argsort(keys, axis=None)
        found = order[np.searchsorted(keys.ravel()[order], edges[:, 0] * count + edges[:, 1])]
        return near[found // 3], found % 3

    def actions(self, t: float, side: int = 1) -> Array:
        """What acts on each of `edges` at `t`, (edges, ACTIONS); with ``side=-1`` just before a jump."""
        rows = [self._action(part, t, side) for part in self.parts]
        return np.asarray(np.array(rows).reshape(-1, ACTIONS)[self.owner[self._acting]])

    def _action(self, part: BoundaryPart, t: float, side: int) -> list[float]:
        """Traction in x and y, load, influx, and the oxygen beyond a membrane."""
        beyond = 0.0
        if part.membrane:
            beyond = self.parameters.C_out if part.C == OUTSIDE else part.C(t, side)
        return [*(series(t, side) for series in (part.traction_x, part.traction_y, part.load, part.influx)), beyond]

    def describe(self) -> tuple[str, ...]:
        """A line for each part: what it is, and what acts on it."""
        lines = []
        for part, numbers in zip(self.parts, self.numbers, strict=True):
            edges = f"{len(numbers)} edge{'s' * (len(numbers) > 1)}, length {np.sum(self.lengths[numbers]):.4g}"
            lines.append(f"{part.name} ({edges}): {part.describe()}")
        return tuple(lines)


def _acts(part: BoundaryPart) -> bool:
    """Whether something acts on a part that needs an integral."""
    forces = any(acts(series) for series in (part.traction_x, part.traction_y, part.load, part.influx))
    return forces or part.spring > 0.0 or part.spring_normal > 0.0 or part.membrane is not None


def _changes_oxygen(part: BoundaryPart, outside: float) -> bool:
    return _differs(part.C, outside) or acts(part.influx)


def _differs(value: Any, outside: float) -> bool:
    """Whether what is given of oxygen or pressure is at some time another value than that outside."""
    return isinstance(value, TimeSeries) and any(number != outside for number in value.values)
