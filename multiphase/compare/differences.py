"""How far one quantity of two results differs: numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphase.mesh import Mesh
from multiphase.result import Array

SMALLEST_SCALE = 1e-10
"""A quantity smaller than this throughout is zero but for rounding (about 1e-16), so its differences are not divided by its own size."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How far one quantity differs.

    Attributes
    ----------
    name : str
    kind : {"scalar", "field", "scatter"}
        A scatter is how far a field of one result, `side`, departs from its means round rings.
    max_abs : float
        Largest absolute difference, of vectors the largest length of it; infinite where a value is not finite and the other result
        has not the same.
    scale : float
        Largest absolute value (length) of the quantity in both results at the common times.
    relative_to_scale : float
        `max_abs`, of a scatter `rms`, over `scale` (or over `SMALLEST_SCALE`, whichever is larger).
    time : float
        Where in time this occurs.
    max_relative : float or None
        Scalars: largest difference relative to the value at that time.
    l1 : float or None
        Fields: mean absolute difference over the cells or rings, or over the area of a mesh at rest, the largest over the times.
    rms : float or None
        Scatter: root mean square round a ring, the largest over rings and times; `max_abs` is the largest deviation of all.
    xi : float or None
        Fields: where this occurs in space, 0 to 1: relative to the current width, or at rest where cells are followed.
    position : (float, float) or None
        Fields on a mesh: the node at which `max_abs` occurs, at rest.
    side : {"", "A", "B"}
        Whose scatter it is.
    counts : bool
        Whether it has a say in whether two results agree; errors that a model measures of itself have none.
    course : tuple of float
        The largest difference, or root mean square of a scatter, at each common time, over the scale.
    along : tuple of (float, float)
        Of fields at positions 0 to 1: position and difference over the scale, at `time`.
    """

    name: str
    kind: str
    max_abs: float
    scale: float
    relative_to_scale: float
    time: float
    max_relative: float | None = None
    l1: float | None = None
    rms: float | None = None
    xi: float | None = None
    position: tuple[float, float] | None = None
    side: str = ""
    counts: bool = True
    course: tuple[float, ...] = ()
    along: tuple[tuple[float, float], ...] = ()

    @property
    def physical(self) -> bool:
        """False for balance defects (``defect_*``), which are rounding by nature, and for what has no say otherwise."""
        return self.counts and not self.name.startswith("defect_")

    @property
    def label(self) -> str:
        """The name, and whose scatter it is."""
        return f"scatter of {self.name} in {self.side}" if self.kind == "scatter" else self.name

    @classmethod
    def from_plain(cls, data: Mapping[str, Any]) -> Difference:
        """From what a JSON text holds: infinite numbers are texts, and rows are lists."""

        def number(value: Any) -> Any:
            return float(value) if value in ("inf", "nan") else value

        plain: dict[str, Any] = {key: number(value) for key, value in data.items() if not isinstance(value, list)}
        plain["course"] = tuple(number(value) for value in data["course"])
        plain["along"] = tuple((place, number(value)) for place, value in data["along"])
        plain["position"] = None if data["position"] is None else tuple(data["position"])
        return cls(**plain)


def scalar(name: str, times: Array, a: Array, b: Array) -> Difference:
    """The difference of a scalar, (times,)."""
    distance, scale = distance_of(a, b), scale_of(a, b)
    size = np.fmax(np.abs(a), np.abs(b))
    relative = np.zeros_like(distance)
    np.divide(distance, size, out=relative, where=(distance > 0) & np.isfinite(size))
    relative[np.isinf(distance)] = np.inf
    return replace(_largest(name, "scalar", times, distance[:, None], scale)[0], max_relative=float(np.max(relative)))


def profile(name: str, times: Array, xi: Array | None, a: Array, b: Array) -> Difference:
    """The difference of a field on cells or rings, (times, cells), at the positions `xi` (times, cells)."""
    distance, scale = distance_of(a, b), scale_of(a, b)
    found, row, cell = _largest(name, "field", times, distance.reshape(len(times), -1), scale)
    found = replace(found, l1=float(np.max(np.mean(distance, axis=tuple(range(1, distance.ndim))))))
    return found if xi is None else replace(found, xi=float(xi[row, cell]), along=_along(xi[row], distance[row], scale))


def on_mesh(name: str, times: Array, mesh: Mesh, a: Array, b: Array) -> Difference:
    """The difference of a field on the points of a mesh, (times, points) or (times, points, 2)."""
    distance, scale = _lengths(distance_of(a, b)), scale_of(_lengths(a), _lengths(b))
    areas = mesh.point_areas()
    found, _, node = _largest(name, "field", times, distance, scale)
    return replace(
        found,
        l1=float(np.max(np.sum(distance * areas, axis=1) / np.sum(areas))),
        position=(float(mesh.points[node, 0]), float(mesh.points[node, 1])),
    )


def scatter(name: str, side: str, times: Array, xi: Array, rms: Array, largest: Array, scale: float) -> Difference:
    """The scatter of a field round rings, (times, rings), at the positions `xi` (times, rings); its size is the root mean square."""
    found, row, ring = _largest(name, "scatter", times, rms, scale)
    return replace(
        found, side=side, rms=found.max_abs, max_abs=float(np.max(largest)), xi=float(xi[row, ring]), along=_along(xi[row], rms[row], scale)
    )


def _largest(name: str, kind: str, times: Array, distance: Array, scale: float) -> tuple[Difference, int, int]:
    """What all kinds have in common, and the row and column of the largest of `distance` (times, places)."""
    row, column = (int(index) for index in np.unravel_index(int(np.argmax(distance)), distance.shape))
    unit, largest = max(scale, SMALLEST_SCALE), float(distance[row, column])
    found = Difference(
        name=name,
        kind=kind,
        max_abs=largest,
        scale=scale,
        relative_to_scale=largest / unit,
        time=float(times[row]),
        course=tuple(float(value) for value in distance.max(axis=1) / unit),
    )
    return found, row, column


def _along(xi: Array, distance: Array, scale: float) -> tuple[tuple[float, float], ...]:
    if distance.ndim != 1:
        return ()
    return tuple((float(place), float(value)) for place, value in zip(xi, distance / max(scale, SMALLEST_SCALE), strict=True))


def distance_of(a: Array, b: Array) -> Array:
    """|a - b|; 0 where both are the same (also both NaN or both infinite), infinite where only one is a number."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):  # inf - inf, which `same` covers
        distance = np.where(same, 0.0, np.abs(a - b))
    return np.where(np.isnan(distance), np.inf, distance)


def scale_of(a: Array, b: Array) -> float:
    """The largest absolute value that is finite."""
    values = np.abs(np.concatenate([np.ravel(a), np.ravel(b)]))
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def _lengths(values: Array) -> Array:
    """Euclidean norms of a field of vectors (times, nodes, components), absolute values of any other."""
    if values.ndim < 3:
        return np.abs(values)
    return np.asarray(np.sqrt(np.sum(values**2, axis=2)))
