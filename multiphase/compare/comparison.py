"""What of two results is compared with what."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphase.compare.differences import Difference, on_mesh, profile, scalar, scatter
from multiphase.compare.places import OnOneMesh, Positions, common_times
from multiphase.compare.report import Comparison
from multiphase.errors import ParameterError
from multiphase.model import find_model, model_names
from multiphase.profiles import Profiles, RingFields
from multiphase.result import Array, Result

RINGS = 10
"""Rings over which fields of round bodies are averaged. They do not follow the mesh: the one layer of triangles at the surface, where a
cell fraction may be of order one, is then an ever smaller part of the last ring."""

SCENE_TABLES = ("geometry", "parameters", "initial", "boundary")
LONGEST = 40
"""Characters of a value in a note."""


def compare(a: Result, b: Result) -> Comparison:
    """Differences of `b` from `a` at common times, and at common positions.

    Positions are those that the cells have in the body at rest where both results follow them, else relative to the current width,
    ``x / width``; where the cells differ, the finer is interpolated linearly to the cell centres of the coarser. Fields on a mesh are
    compared node by node, where the nodes are at rest; those of `b` on another mesh of the same body are interpolated linearly to the
    nodes of `a`. A round body on a mesh and another round one, on cells or on a mesh of another part of it, are compared by averages over
    rings of the body at rest, and the scatter round the rings is given as well. Everything else, and results of two materials, are
    compared by scalars alone. `notes` say so.

    Raises
    ------
    ParameterError
        When the results are of different models or in different units, or have no common time beyond the start,
        or no common quantity.
    """
    _check_comparable(a, b)
    identical = _identical(a, b)
    rows_a, rows_b = common_times(a.t, b.t)
    if not len(rows_a) or not (identical or np.any(a.t[rows_a] > 0)):
        raise ParameterError(
            "",
            f"the results have no common time beyond the start: {_span(a)} against {_span(b)}. "
            "Run both with the same time.save_at, or with the same time.end.",
        )
    pair = _Pair(a, b, rows_a, rows_b)
    scalars, fields = pair.scalars(), pair.fields()
    if not any(entry.physical for entry in (*scalars, *fields.differences)):
        raise ParameterError("", f"the results have no quantity in common: {_names(a)} against {_names(b)}.")
    return Comparison(
        differences=(*scalars, *fields.differences),
        times=tuple(float(time) for time in pair.times),
        cells=fields.count,
        only_a=_missing(a, b),
        only_b=_missing(b, a),
        identical=identical,
        costs=(cost_of(a), cost_of(b)),
        notes=(*pair.notes(), *fields.notes),
        place=fields.place,
        scatter=fields.scatter,
        refusals=fields.refusals,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fields:
    """Fields, compared in one way or not at all."""

    differences: tuple[Difference, ...] = ()
    count: int | None = None
    notes: tuple[str, ...] = ()
    place: str = "x/width"
    scatter: tuple[Difference, ...] = ()
    refusals: tuple[str, ...] = ()


class _Pair:
    """Two results at their common times, and what their model says of them."""

    def __init__(self, a: Result, b: Result, rows_a: Array, rows_b: Array) -> None:
        self.a, self.b, self.rows_a, self.rows_b = a, b, rows_a, rows_b
        self.times = a.t[rows_a]
        model = find_model(a.model) if a.model in model_names() else None
        known = (None, None) if model is None else (model.profiles(a), model.profiles(b))
        self.of_a, self.of_b = (Profiles() if found is None else found for found in known)
        quantities = {} if model is None else model.quantities
        self.no_say = {name: quantities[name].no_say for name in a.scalars if name in b.scalars and name in quantities}

    def scalars(self) -> list[Difference]:
        """Those that both have; of a part of a body and the whole, for the whole body."""
        found = []
        for name in self.a.scalars:
            if name not in self.b.scalars:
                continue
            first, second = self.a.scalars[name][self.rows_a], self.b.scalars[name][self.rows_b]
            if name in self._by_share():
                first, second = first / self.of_a.share, second / self.of_b.share
            found.append(replace(scalar(name, self.times, first, second), counts=not self.no_say.get(name)))
        return found

    def _by_share(self) -> tuple[str, ...]:
        """Scalars that must be brought to the whole body."""
        if self.of_a.share == self.of_b.share:
            return ()
        return tuple(name for name in self.of_a.shared if name in self.a.scalars and name in self.b.scalars)

    # -- Fields ----------------------------------------------------------------------------------------------------------

    def fields(self) -> _Fields:
        """The fields that both have, compared as well as the results allow."""
        if self.of_a.material != self.of_b.material:
            note = f"fields are not compared: A is of {self.of_a.material}, B of {self.of_b.material}, which are two materials"
            return _Fields(notes=(f"{note}; their scalars may well differ",))
        if self.a.mesh is None and self.b.mesh is None:
            return self._on_cells()
        meshes = OnOneMesh(self.a, self.b)
        if meshes.nodes is not None:
            return self._on_nodes(meshes)
        if self.of_a.rings is not None and self.of_b.rings is not None:
            return self._on_rings()
        bodies = f" (A: {self.of_a.body}; B: {self.of_b.body})" if self.of_a.body and self.of_b.body else ""
        return _Fields(notes=(meshes.note + bodies,))

    def _common(self) -> Iterator[tuple[str, Array, Array]]:
        for name in self.a.fields:
            if name in self.b.fields:
                yield name, self.a.fields[name][self.rows_a], self.b.fields[name][self.rows_b]

    def _on_cells(self) -> _Fields:
        at_rest = (self.of_a.positions, self.of_b.positions)
        follows = at_rest[0] is not None and at_rest[1] is not None
        positions = Positions(self.a, self.b, self.rows_a, self.rows_b, at_rest if follows else (None, None))
        place = self.of_a.place if follows else "x/width"
        differences = []
        for name, first, second in self._common():
            first, second = positions.bring_together(name, first, second)
            differences.append(profile(name, self.times, positions.xi, first, second))
        notes: tuple[str, ...] = ()
        if _body(self.of_a, self.a) != _body(self.of_b, self.b):
            notes = (f"different bodies: fields are compared at equal {place}, and integrals are over bodies of different shape",)
        count = None if positions.xi is None else positions.xi.shape[1]
        return _Fields(differences=tuple(differences), count=count, notes=notes, place=place)

    def _on_nodes(self, meshes: OnOneMesh) -> _Fields:
        assert meshes.nodes is not None
        differences = []
        for name, first, second in self._common():
            if first.shape[2:] != second.shape[2:]:
                raise ParameterError("", f"the field {name!r} is of vectors in one result and not in the other: compare equal fields.")
            differences.append(on_mesh(name, self.times, meshes.nodes, first, meshes.to_a(second)))
        notes = (meshes.note,) if meshes.note else ()
        return _Fields(differences=tuple(differences), count=len(meshes.nodes.points), notes=notes)

    def _on_rings(self) -> _Fields:
        assert self.of_a.rings is not None
        assert self.of_b.rings is not None
        edges = np.linspace(0.0, 1.0, RINGS + 1)
        first, second = self.of_a.rings(edges, self.rows_a), self.of_b.rings(edges, self.rows_b)
        xi = np.broadcast_to(0.5 * (edges[1:] + edges[:-1]), (len(self.times), RINGS))
        names = [name for name in first.means if name in second.means]
        differences = [profile(name, self.times, xi, first.means[name], second.means[name]) for name in names]
        found = [self._scatter(name, side, xi, rings, entry.scale) for name, entry in zip(names, differences, strict=True)
                 for side, rings in (("A", first), ("B", second)) if name in rings.rms]  # fmt: skip
        note = f"fields are compared by averages over {RINGS} rings of the body at rest; of displacements the radial part"
        refusals = tuple(f"{side}: {why}" for side, rings in (("A", first), ("B", second)) for why in rings.why_not)
        place = self.of_a.place if self.of_a.positions is not None or self.of_b.positions is None else self.of_b.place
        return _Fields(
            differences=tuple(differences), count=RINGS, notes=(note,), place=place, scatter=tuple(found), refusals=refusals
        )  # fmt: skip

    def _scatter(self, name: str, side: str, xi: Array, rings: RingFields, scale: float) -> Difference:
        return scatter(name, side, self.times, xi, rings.rms[name], rings.largest[name], scale)

    # -- Words -----------------------------------------------------------------------------------------------------------

    def notes(self) -> tuple[str, ...]:
        """How the scenes differ, and scalars that differ in meaning."""
        notes = [f"scenes differ: {entry}" for entry in _changed(self.a, self.b)]
        sizes = [[name for name in known.sizes if name in result.scalars] for known, result in ((self.of_a, self.a), (self.of_b, self.b))]
        if sizes[0] != sizes[1] and all(sizes):
            also = [name for name in self.of_a.shared if name in self.a.scalars and name in self.b.scalars and name not in sizes[0]]
            what = f"; {', '.join(also)} is an integral over it" if also else ""
            notes.append(f"bodies of different dimension: {sizes[0][0]} in A, {sizes[1][0]} in B{what}")
        elif names := self._by_share():
            notes.append(f"{', '.join(names)}: of the whole body ({self.of_a.share:g} of it is computed in A, {self.of_b.share:g} in B)")
        notes += [f"{name} has no say, as {why}" for name, why in self.no_say.items() if why]
        return tuple(notes)


def _body(known: Profiles, result: Result) -> str:
    """Words for the shape of a body, or what its scene calls it."""
    return known.body or str(tomllib.loads(result.scene).get("geometry", {}).get("kind", ""))


def _changed(a: Result, b: Result) -> list[str]:
    """Where the scenes of two results differ in what is solved, and by which method."""
    one, other = ({} if not result.scene else tomllib.loads(result.scene) for result in (a, b))
    if not one or not other:
        return []
    found = []
    for table in SCENE_TABLES:
        first, second = _flat(one.get(table, {}), f"{table}."), _flat(other.get(table, {}), f"{table}.")
        for path in dict.fromkeys((*first, *second)):
            if first.get(path) != second.get(path):
                shown = [_shown(values.get(path)) for values in (first, second)]
                found.append(f"{path} is {shown[0]} in A, {shown[1]} in B" if shown[0] != shown[1] else f"{path} has other numbers in B")
    return found


def _flat(table: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in table.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return flat


def _shown(value: Any) -> str:
    text = "not given" if value is None else f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def cost_of(result: Result) -> str:
    """Cost of a run in one line; empty where the result does not say."""
    s = result.stats
    if "wall_s" not in s:
        return ""
    rejected = s.get("rejected_error", 0) + s.get("rejected_solver", 0)
    seconds = s["wall_s"]
    return (
        f"{s.get('steps', 0)} steps ({rejected} rejected), {s.get('iterations', 0)} iterations, "
        f"{seconds:.{1 if seconds >= 1.0 else 3}f} s with {s.get('solver', '?')} "
        f"on {result.threads} thread{'s' if result.threads != 1 else ''}"
    )


def _check_comparable(a: Result, b: Result) -> None:
    if a.model != b.model:
        raise ParameterError("", f"the results are of different models, {a.model!r} and {b.model!r}. Compare two runs of one model.")
    for name in ("t", "x", *a.scalars, *a.fields):
        if name in a and name in b and a.unit(name) != b.unit(name):
            raise ParameterError(
                "", f"{name!r} is in {a.unit(name)!r} in one result and in {b.unit(name)!r} in the other. Compare them in the same units."
            )
    if a.mesh is not None and b.mesh is not None and a.unit("points") != b.unit("points"):
        raise ParameterError("", "the meshes of the results are in different units. Compare them in the same units.")


def _missing(a: Result, b: Result) -> tuple[str, ...]:
    """Names of scalars that `a` has and `b` has not, then of fields."""
    return (*(name for name in a.scalars if name not in b.scalars), *(name for name in a.fields if name not in b.fields))


def _names(result: Result) -> str:
    return ", ".join((*result.scalars, *result.fields)) or "nothing"


def _span(result: Result) -> str:
    return f"{len(result.t)} times in [{result.t[0]:g}, {result.t[-1]:g}]" if len(result.t) else "no times"


def _identical(a: Result, b: Result) -> bool:
    def datasets(result: Result) -> dict[str, Array]:
        grid = {} if result.x is None else {"grid/x": result.x}
        if result.mesh is not None:
            grid = {"mesh/points": result.mesh.points, "mesh/triangles": result.mesh.triangles}
        groups = {"scalars": result.scalars, "fields": result.fields, "checkpoint": result.checkpoint}
        return {"t": result.t, **grid, **{f"{group}/{name}": values for group, data in groups.items() for name, values in data.items()}}

    def same(first: Array, second: Array) -> bool:
        first, second = np.asarray(first), np.asarray(second)
        return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()

    of_a, of_b = datasets(a), datasets(b)
    return of_a.keys() == of_b.keys() and all(same(of_a[name], of_b[name]) for name in of_a)
