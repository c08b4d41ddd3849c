"""How accurate runs are: errors of one against another, the Pareto front, and observed orders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from multiphase.compare.places import OnOneMesh
from multiphase.errors import ParameterError
from multiphase.result import Array, Result

SAME_SHARE = 0.25
"""Part of a cell by which the same share of a body may lie elsewhere in two runs: their error, not another way to divide it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One combination of method, cells and rtol.

    Attributes
    ----------
    method : str
    cells : int
    rtol : float
    status : {"completed", "refused", "failed", "stopped", "not run"}
    message : str
        Why there is no error, or fewer repeats than were asked for; empty otherwise.
    seconds : float
        Wall time of one run, the median of `runs`; NaN where none completed.
    runs : int
    error : float
        Of the model's main field, relative; NaN where there is none.
    errors : mapping of str to float
        Relative errors by name: the main field, and the scalars of the model's first scalar panel.
    against : str
        The method of the reference it was measured against.
    steps, iterations : int
    pareto : bool
        No other combination is both as fast and as accurate.
    """

    method: str
    cells: int
    rtol: float
    status: str
    message: str = ""
    seconds: float = math.nan
    runs: int = 0
    error: float = math.nan
    errors: Mapping[str, float] = field(default_factory=dict)
    against: str = ""
    steps: int = 0
    iterations: int = 0
    pareto: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """How fast the error of one method falls between two neighbouring rows.

    Attributes
    ----------
    method : str
    kind : {"cells", "rtol"}
        What changes, from `coarse` to `fine`.
    fixed : float
        The rtol, or the cells, at which it changes.
    coarse, fine : float
    value : float or None
        The exponent; None where the error is not the one of what changes, or is not above that of the reference.
    """

    method: str
    kind: str
    fixed: float
    coarse: float
    fine: float
    value: float | None


def cell_averages(values: Array, cells: int) -> Array:
    """Averages over `cells` equal cells of values that are averages over equal cells of the same interval, along the last axis.

    Exact for what is constant on each cell, so that the total is kept, also where one number of cells is no multiple of the other.
    """
    fine = values.shape[-1]
    if fine % cells == 0:
        return np.asarray(values.reshape(*values.shape[:-1], cells, fine // cells).mean(axis=-1))
    edges = np.arange(cells + 1) * (fine / cells)
    below = np.minimum(edges.astype(int), fine - 1)
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
    at_edges = total[..., below] + (edges - below) * values[..., below]
    return np.asarray(np.diff(at_edges, axis=-1) * (cells / fine))


def errors_between(a: Result, b: Result, names: Sequence[str]) -> dict[str, float]:
    """Relative differences of `a` from `b`, by name: fields after t = 0 in the mean over the body, scalars, each at the worst time."""
    found = {}
    for name in names:
        mine, other = np.asarray(a[name], dtype=float), np.asarray(b[name], dtype=float)
        distance = np.abs(mine - other) if mine.ndim == 1 else _field_distance(name, a, b)
        largest = float(np.max(np.abs(other)))
        found[name] = float(np.max(distance[a.t > 0])) / (largest or 1.0)
    return found


def _field_distance(name: str, a: Result, b: Result) -> Array:
    """At each time the mean over the coarser cells of the difference of cell averages; on meshes over the body at rest."""
    if a.mesh is not None and b.mesh is not None:
        return _distance_on_meshes(name, *sorted((a, b), key=lambda result: -len(result.mesh.points)))  # type: ignore[union-attr]
    first, second = equal_cells(name, a), equal_cells(name, b)
    cells = min(first.shape[1], second.shape[1])
    places = [cell_averages(r.x / width[:, None], cells) for r in (a, b) if r.x is not None and (width := r.width()) is not None]
    if np.max(np.abs(places[0] - places[1])) > SAME_SHARE / cells:
        raise ParameterError(name, "the cells of these runs divide the body in different ways, so that their values cannot be compared.")
    return np.asarray(np.mean(np.abs(cell_averages(first, cells) - cell_averages(second, cells)), axis=1))


def _distance_on_meshes(name: str, fine: Result, coarse: Result) -> Array:
    """Mean over the body at rest of the difference, the coarser field being interpolated linearly to the finer mesh."""
    both = OnOneMesh(fine, coarse)
    if both.nodes is None:
        raise ParameterError(name, both.note)
    weights = both.nodes.point_areas()
    return np.asarray(np.abs(fine[name] - both.to_a(coarse[name])) @ (weights / weights.sum()))


def check_field(name: str, result: Result) -> None:
    """Refuse a field whose error a study cannot measure."""
    if result.mesh is None:
        equal_cells(name, result)
    elif result[name].ndim != 2:
        raise ParameterError(name, "this field is one of vectors, and a study measures errors of numbers only.")


def equal_cells(name: str, result: Result) -> Array:
    """Values of a field on cells that are equal shares of a one-dimensional body, of its length, of its area, or as it was at rest;
    raises ParameterError for another mesh."""
    values = np.asarray(result[name], dtype=float)
    if values.ndim == 2 and result.x is not None and result.x.shape == values.shape and np.all(np.diff(result.x, axis=1) > 0.0):
        return values
    raise ParameterError(
        name, "this field stands neither on the cells of a one-dimensional body nor on a mesh, and a study measures errors on those only."
    )


def pareto(seconds: Sequence[float], errors: Sequence[float], floor: float = 0.0) -> list[bool]:
    """Which entries no other one beats: none is as fast and as accurate, and better in one of the two.

    Errors below `floor` count as equal; entries that are not numbers are never among them.
    """
    points = [(second, max(error, floor)) if math.isfinite(second + error) else None for second, error in zip(seconds, errors, strict=True)]

    def beats(other: tuple[float, float] | None, point: tuple[float, float]) -> bool:
        return other is not None and other != point and other[0] <= point[0] and other[1] <= point[1]

    return [point is not None and not any(beats(other, point) for other in points) for point in points]


def orders_of(rows: Sequence[Measurement], floor: float = 0.0) -> tuple[Order, ...]:
    """Observed orders between neighbouring rows: in the cells at the smallest rtol, and in rtol at the largest cells.

    Where the heavier rows are missing: at the smallest rtol, and the largest cells, that two rows have.
    """
    found: list[Order] = []
    for method in dict.fromkeys(row.method for row in rows):
        errors = {(row.cells, row.rtol): row.error for row in rows if row.method == method and math.isfinite(row.error)}
        by_rtol = ((rtol, sorted(count for count, other in errors if other == rtol)) for rtol in sorted({rtol for _, rtol in errors}))
        rtol, cells = next(((rtol, cells) for rtol, cells in by_rtol if len(cells) > 1), (math.nan, []))
        for coarse, fine in pairwise(cells):
            order = _order_in_cells(errors, coarse, fine, rtol, floor)
            found.append(Order(method=method, kind="cells", fixed=rtol, coarse=coarse, fine=fine, value=order))
        counts = sorted({count for count, _ in errors}, reverse=True)
        by_count = ((count, sorted((rtol for other, rtol in errors if other == count), reverse=True)) for count in counts)
        most, rtols = next(((count, rtols) for count, rtols in by_count if len(rtols) > 1), (0, []))
        for loose, tight in pairwise(rtols):
            order = _order_in_rtol(errors, most, loose, tight, floor)
            found.append(Order(method=method, kind="rtol", fixed=most, coarse=loose, fine=tight, value=order))
    return tuple(found)


def _order_in_cells(errors: Mapping[tuple[int, float], float], coarse: int, fine: int, rtol: float, floor: float) -> float | None:
    before, after = errors[coarse, rtol], errors[fine, rtol]
    return math.log(before / after) / math.log(fine / coarse) if before > 0.0 and after > floor else None


def _order_in_rtol(errors: Mapping[tuple[int, float], float], cells: int, coarse: float, fine: float, floor: float) -> float | None:
    """The order in rtol, if fewer cells hardly change the error: by less than half an order, so that the error is one of the steps."""
    before, after = errors[cells, coarse], errors[cells, fine]
    fewer = max((count for count, rtol in errors if rtol == fine and count < cells), default=None)
    if fewer is None or before <= 0.0 or after <= floor or errors[fewer, fine] > after * math.sqrt(cells / fewer):
        return None
    return math.log(before / after) / math.log(coarse / fine)
