"""Differences between two results, quantity by quantity, at their common times and positions."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

import numpy as np

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import Array, Result

SAME_TIME = 1e-12
"""Stored times are exact, so common ones differ by rounding of the user's own arithmetic (0.1 * 3) only; relative."""

SAME_POSITION = 1e-9
"""Cells of two runs count as equal in relative position within this: far above rounding (1e-16), far below any cell."""

SAME_NODE = 1e-12
"""Nodes of two meshes count as equal within this, relative to the size of the body: generators of meshes round in their own ways."""

OUTSIDE = 0.5
"""How far outside of a mesh nodes of another mesh of the same body may be, in its longest edges: an edge cuts off less of a curved
boundary, about an eighth of its own length times its length over the radius."""

SMALLEST_SCALE = 1e-10
"""A quantity smaller than this throughout is zero but for rounding (about 1e-16), so its differences are not divided by its own size."""

_NOT_FINITE = "not finite in one"


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How far one quantity differs.

    Attributes
    ----------
    name : str
    kind : {"scalar", "field"}
    max_abs : float
        Largest absolute difference, of vectors the largest length of it; infinite where a value is not finite and the other result
        has not the same.
    scale : float
        Largest absolute value (length) of the quantity in both results at the common times.
    relative_to_scale : float
        `max_abs` over `scale` (or over `SMALLEST_SCALE`, whichever is larger).
    time : float
        Where in time `max_abs` occurs.
    max_relative : float or None
        Scalars: largest difference relative to the value at that time.
    l1 : float or None
        Fields: mean absolute difference over the cells, or over the area of a mesh at rest, the largest over the times.
    xi : float or None
        Fields: where `max_abs` occurs, relative to the current width (0 to 1).
    position : (float, float) or None
        Fields on a mesh: the node at which `max_abs` occurs, at rest.
    """

    name: str
    kind: str
    max_abs: float
    scale: float
    relative_to_scale: float
    time: float
    max_relative: float | None = None
    l1: float | None = None
    xi: float | None = None
    position: tuple[float, float] | None = None

    @property
    def physical(self) -> bool:
        """False for balance defects (``defect_*``), which are rounding by nature."""
        return not self.name.startswith("defect_")


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What :func:`compare` found.

    Attributes
    ----------
    differences : tuple of Difference
        One for each quantity that both results have.
    times : tuple of float
        The common times.
    cells : int or None
        Number of positions at which fields were compared: cells, or nodes of a mesh.
    only_a, only_b : tuple of str
        Quantities that only one of the results has.
    identical : bool
        Every stored dataset, the checkpoint included, is the same bit for bit.
    costs : (str, str)
        What each result cost, in words; empty where it does not say.
    notes : tuple of str
        How fields on meshes were compared where that is not node by node, or why they were not.
    """

    differences: tuple[Difference, ...]
    times: tuple[float, ...]
    cells: int | None
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    identical: bool
    costs: tuple[str, str] = ("", "")
    notes: tuple[str, ...] = ()

    @property
    def largest(self) -> Difference:
        """The physical quantity that differs most, relative to its scale."""
        return max((entry for entry in self.differences if entry.physical), key=lambda entry: entry.relative_to_scale)

    @property
    def worst(self) -> float:
        """Largest difference of all physical quantities (balance defects left out), relative to their scales."""
        return self.largest.relative_to_scale

    def exceeds(self, tol: float) -> bool:
        """Whether any physical quantity differs by more than `tol`, relative to its scale."""
        return not self.worst <= tol

    def table(self) -> str:
        """The comparison as a user reads it."""
        at = "" if self.cells is None else f" and {self.cells} positions"
        lines = [f"compared at {len(self.times)} common times, {self.times[0]:g} to {self.times[-1]:g}{at}"]
        if self.identical:
            lines.append("identical bit for bit")
        lines += [f"only in {side}: {', '.join(names)}" for side, names in (("A", self.only_a), ("B", self.only_b)) if names]
        lines += [f"{side}: {cost}" for side, cost in zip("AB", self.costs, strict=True) if cost]
        lines += self.notes
        width = max(10, *(len(entry.name) for entry in self.differences))
        on_mesh = any(entry.position for entry in self.differences)
        last = 24 if on_mesh else 12
        lines.append("")
        titles = ("max |A-B|", "of scale", "max rel.", "L1", "at t")
        place = "at rest (x, y)" if on_mesh else "at x/width"
        lines.append(f"{'quantity':<{width}}" + "".join(f"{title:>12}" for title in titles) + f"{place:>{last}}")
        for entry in self.differences:
            values = (entry.max_abs, entry.relative_to_scale, entry.max_relative, entry.l1)
            columns = "".join(f"{'' if value is None else f'{value:.3e}':>12}" for value in values)
            if not math.isfinite(entry.max_abs):
                columns = f"{_NOT_FINITE:>48}"
            place = "" if entry.xi is None else f"{entry.xi:.4f}"
            if entry.position:
                place = "({:.4g}, {:.4g})".format(*entry.position)
            lines.append((f"{entry.name:<{width}}" + columns + f"{entry.time:>12.6g}{place:>{last}}").rstrip())
        size = f"{self.worst:.3e} of its scale" if math.isfinite(self.worst) else _NOT_FINITE
        lines += ["", f"worst: {self.largest.name}, {size} (balance defects not counted)"]
        return "\n".join(lines)

    def to_json(self) -> str:
        """The comparison as JSON; an infinite difference is the text "inf"."""

        def plain(value: object) -> object:
            return str(value) if isinstance(value, float) and not math.isfinite(value) else value

        data = {
            "identical": self.identical,
            "worst": plain(self.worst),
            "worst_quantity": self.largest.name,
            "times": list(self.times),
            "cells": self.cells,
            "only_a": list(self.only_a),
            "only_b": list(self.only_b),
            "costs": list(self.costs),
            "notes": list(self.notes),
            "differences": [{key: plain(value) for key, value in asdict(entry).items()} for entry in self.differences],
        }
        return json.dumps(data, indent=1, ensure_ascii=False)


def compare(a: Result, b: Result) -> Comparison:
    """Differences of `b` from `a` at common times, and at common relative positions ``x / width``.

    Where the results have different cells, the finer is interpolated linearly to the cell centres of the coarser. Fields on a mesh
    are compared node by node, where the nodes are at rest; those of `b` on another mesh of the same body are interpolated linearly to the
    nodes of `a`. Where one result is on a mesh and the other is not, or the bodies differ, scalars alone are compared; `notes` say so.

    Raises
    ------
    ParameterError
        When the results are of different models or in different units, or have no common time beyond the start,
        or no common quantity.
    """
    _check_comparable(a, b)
    identical = _identical(a, b)
    rows_a, rows_b = _common_times(a.t, b.t)
    if not len(rows_a) or not (identical or np.any(a.t[rows_a] > 0)):
        raise ParameterError(
            "",
            f"the results have no common time beyond the start: {_span(a)} against {_span(b)}. "
            "Run both with the same time.save_at, or with the same time.end.",
        )
    times = a.t[rows_a]
    differences = [_scalar(name, times, a.scalars[name][rows_a], b.scalars[name][rows_b]) for name in a.scalars if name in b.scalars]
    meshes = OnOneMesh(a, b) if a.mesh is not None or b.mesh is not None else None
    positions = _Positions(a, b, rows_a, rows_b)
    for name in a.fields:
        if name not in b.fields:
            continue
        first, second = a.fields[name][rows_a], b.fields[name][rows_b]
        if meshes is None:
            first, second = positions.bring_together(name, first, second)
            differences.append(_field(name, times, positions.xi, first, second))
        elif meshes.nodes is not None and first.shape[2:] != second.shape[2:]:
            raise ParameterError("", f"the field {name!r} is of vectors in one result and not in the other: compare equal fields.")
        elif meshes.nodes is not None:
            differences.append(_field_on_mesh(name, times, meshes.nodes, first, meshes.to_a(second)))
    if not any(entry.physical for entry in differences):
        raise ParameterError("", f"the results have no quantity in common: {_names(a)} against {_names(b)}.")
    return Comparison(
        differences=tuple(differences),
        times=tuple(float(time) for time in times),
        cells=_compared_at(meshes, positions),
        only_a=_missing(a, b),
        only_b=_missing(b, a),
        identical=identical,
        costs=(cost_of(a), cost_of(b)),
        notes=() if meshes is None or not meshes.note else (meshes.note,),
    )


def _compared_at(meshes: OnOneMesh | None, positions: _Positions) -> int | None:
    if meshes is not None:
        return None if meshes.nodes is None else len(meshes.nodes.points)
    return None if positions.xi is None else positions.xi.shape[1]


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
        if name in b and a.unit(name) != b.unit(name):
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


def _common_times(a: Array, b: Array) -> tuple[Array, Array]:
    """Indices of the times that `a` and `b` (both ascending) have in common."""
    if not len(a) or not len(b):
        none = np.zeros(0, dtype=int)
        return none, none
    right = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(b[left] - a) < np.abs(b[right] - a), left, right)
    common = np.abs(b[nearest] - a) <= SAME_TIME * np.maximum(np.abs(a), np.abs(b[nearest]))
    return np.flatnonzero(common), nearest[common]


class _Positions:
    """Brings fields of two results to the relative positions `xi` (times, cells) of the coarser one."""

    def __init__(self, a: Result, b: Result, rows_a: Array, rows_b: Array) -> None:
        xi_a, xi_b = _relative(a, rows_a), _relative(b, rows_b)
        self.xi: Array | None = None
        self.from_a: Array | None = None  # where a's values stand, when they are to be interpolated
        self.from_b: Array | None = None
        if xi_a is None or xi_b is None:
            return
        if xi_a.shape == xi_b.shape and np.allclose(xi_a, xi_b, rtol=0, atol=SAME_POSITION, equal_nan=True):
            self.xi = xi_a
        elif xi_a.shape[1] > xi_b.shape[1]:
            self.xi, self.from_a = xi_b, xi_a
        else:
            self.xi, self.from_b = xi_a, xi_b

    def bring_together(self, name: str, a: Array, b: Array) -> tuple[Array, Array]:
        if self.xi is not None:
            a = a if self.from_a is None else _interpolate(self.xi, self.from_a, a)
            b = b if self.from_b is None else _interpolate(self.xi, self.from_b, b)
        if a.shape != b.shape:
            raise ParameterError(
                "", f"the field {name!r} stands on different meshes, {a.shape[1:]} and {b.shape[1:]}: compare equal meshes."
            )
        return a, b


class OnOneMesh:
    """Brings fields of `b` to the nodes of `a`; without `nodes` they cannot be compared, and `note` says why."""

    def __init__(self, a: Result, b: Result) -> None:
        self.nodes: Mesh | None = None
        self.note = ""
        self._weights: tuple[Array, Array] | None = None
        if a.mesh is None or b.mesh is None:
            side, other = ("A", "B") if b.mesh is None else ("B", "A")
            self.note = f"fields are not compared: {side} is on a mesh, {other} is not"
            return
        limit = SAME_NODE * max(a.mesh.size(), b.mesh.size())
        if np.array_equal(a.mesh.triangles, b.mesh.triangles) and np.allclose(a.mesh.points, b.mesh.points, rtol=0.0, atol=limit):
            self.nodes = a.mesh
            return
        corners, weights, off = _locate(b.mesh, a.mesh.points)
        if max(off / _longest_edge(b.mesh), _locate(a.mesh, b.mesh.points)[2] / _longest_edge(a.mesh)) > OUTSIDE:
            self.note = "fields are not compared: the meshes are of different bodies"
            return
        self.nodes, self._weights = a.mesh, (corners, weights)
        self.note = f"different meshes: fields of B ({b.size()}) are interpolated linearly to the nodes of A ({a.size()})"

    def to_a(self, values: Array) -> Array:
        if self._weights is None:
            return values
        corners, weights = self._weights
        shape = (1, -1, *[1] * (values.ndim - 2))
        return np.asarray(sum(weights[:, k].reshape(shape) * values[:, corners[:, k]] for k in range(3)))


def _locate(mesh: Mesh, points: Array) -> tuple[Array, Array, float]:
    """Corners (points, 3) of the triangle that each point is in or nearest to, their weights (points, 3), and the largest distance."""
    from matplotlib.tri import Triangulation

    triangulation = Triangulation(mesh.points[:, 0], mesh.points[:, 1], mesh.triangles)
    found = np.array(triangulation.get_trifinder()(*points.T))
    outside = np.flatnonzero(found < 0)
    largest = 0.0
    if len(outside):
        owner, corner = np.nonzero(triangulation.neighbors < 0)
        start, end = mesh.points[mesh.triangles[owner, corner]], mesh.points[mesh.triangles[owner, (corner + 1) % 3]]
        along = end - start
        for point in outside:
            share = np.clip(np.sum((points[point] - start) * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
            distance = np.hypot(*(points[point] - start - share[:, None] * along).T)
            nearest = int(np.argmin(distance))
            found[point], largest = owner[nearest], max(largest, float(distance[nearest]))
    corners = mesh.triangles[found]
    first, second, third = (mesh.points[corners[:, k]] for k in range(3))
    one, other, offset = second - first, third - first, points - first
    twice_area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    of_second = (offset[:, 0] * other[:, 1] - offset[:, 1] * other[:, 0]) / twice_area
    of_third = (one[:, 0] * offset[:, 1] - one[:, 1] * offset[:, 0]) / twice_area
    return corners, np.stack([1.0 - of_second - of_third, of_second, of_third], axis=1), largest


def _longest_edge(mesh: Mesh) -> float:
    corners = mesh.points[mesh.triangles]
    return float(np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


def _relative(result: Result, rows: Array) -> Array | None:
    width = result.width()
    if result.x is None or width is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):  # a failed run may hold a width of 0 or NaN
        return np.asarray(result.x[rows] / width[rows, None])


def _interpolate(xi: Array, known: Array, values: Array) -> Array:
    return np.array([np.interp(*row) for row in zip(xi, known, values, strict=True)])


def _distance(a: Array, b: Array) -> Array:
    """|a - b|; 0 where both are the same (also both NaN or both infinite), infinite where only one is a number."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):  # inf - inf, which `same` covers
        distance = np.where(same, 0.0, np.abs(a - b))
    return np.where(np.isnan(distance), np.inf, distance)


def _lengths(values: Array) -> Array:
    """Euclidean norms of a field of vectors (times, nodes, components), absolute values of any other."""
    if values.ndim < 3:
        return np.abs(values)
    return np.asarray(np.sqrt(np.sum(values**2, axis=2)))


def _scale(a: Array, b: Array) -> float:
    values = np.abs(np.concatenate([np.ravel(a), np.ravel(b)]))
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def _scalar(name: str, times: Array, a: Array, b: Array) -> Difference:
    distance, scale = _distance(a, b), _scale(a, b)
    row = int(np.argmax(distance))
    size = np.fmax(np.abs(a), np.abs(b))
    relative = np.zeros_like(distance)
    np.divide(distance, size, out=relative, where=(distance > 0) & np.isfinite(size))
    relative[np.isinf(distance)] = np.inf
    return Difference(
        name=name,
        kind="scalar",
        max_abs=float(distance[row]),
        scale=scale,
        relative_to_scale=float(distance[row]) / max(scale, SMALLEST_SCALE),
        time=float(times[row]),
        max_relative=float(np.max(relative)),
    )


def _field(name: str, times: Array, xi: Array | None, a: Array, b: Array) -> Difference:
    distance, scale = _distance(a, b), _scale(a, b)
    largest = float(np.max(distance))
    row, cell = np.unravel_index(int(np.argmax(distance)), distance.shape)[:2]
    return Difference(
        name=name,
        kind="field",
        max_abs=largest,
        scale=scale,
        relative_to_scale=largest / max(scale, SMALLEST_SCALE),
        time=float(times[row]),
        l1=float(np.max(np.mean(distance, axis=tuple(range(1, distance.ndim))))),
        xi=None if xi is None else float(xi[row, cell]),
    )


def _field_on_mesh(name: str, times: Array, mesh: Mesh, a: Array, b: Array) -> Difference:
    distance, scale = _lengths(_distance(a, b)), _scale(_lengths(a), _lengths(b))
    row, node = np.unravel_index(int(np.argmax(distance)), distance.shape)
    areas = mesh.point_areas()
    return Difference(
        name=name,
        kind="field",
        max_abs=float(distance[row, node]),
        scale=scale,
        relative_to_scale=float(distance[row, node]) / max(scale, SMALLEST_SCALE),
        time=float(times[row]),
        l1=float(np.max(np.sum(distance * areas, axis=1) / np.sum(areas))),
        position=(float(mesh.points[node, 0]), float(mesh.points[node, 1])),
    )
