"""What pictures show of a result: numbers in the units they are drawn in, and words."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.marks import Marks
from multiphase.model import Model, Panel, find_model
from multiphase.scales import Scales

if TYPE_CHECKING:
    from multiphase.result import Result

Array = NDArray[np.float64]

DISPLACEMENT = "displacement"  # the field that takes the points of a body from rest to where they are
ON_A_LINE = ("profile", "spacetime", "ring")
ON_TRIANGLES = ("map", "maps")


@dataclass(frozen=True, slots=True)
class Body:
    """A two-dimensional body in the unit it is drawn in.

    Attributes
    ----------
    rest : ndarray (points, 2)
        The points of its mesh at rest.
    displacement : ndarray (nt, points, 2)
    triangles, outline : ndarray of int (triangles, 3), (edges, 2)
        The points of its triangles, and of the edges that belong to one triangle only.
    """

    rest: Array
    displacement: Array
    triangles: NDArray[np.int64]
    outline: NDArray[np.int64]

    def positions(self, row: int) -> Array:
        """Where the points are at a stored time, (points, 2)."""
        return np.asarray(self.rest + self.displacement[row])

    def window(self, rows: Sequence[int]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of x and of y that hold the body at rest and at the stored times `rows`, with a margin; neither is much the shorter."""
        used = np.unique(self.triangles)
        shapes = [self.rest[used], *(self.positions(row)[used] for row in rows)]
        low, high = (end([end(shape, axis=0) for shape in shapes], axis=0) for end in (np.min, np.max))
        span = np.maximum(high - low, 0.2 * float(np.max(high - low)))
        middle, half = 0.5 * (low + high), 0.53 * span
        (left, bottom), (right, top) = (middle - half).tolist(), (middle + half).tolist()
        return (left, right), (bottom, top)


@dataclass(frozen=True, slots=True)
class View:
    """A result in the units it is drawn in, without the times whose positions are not finite.

    Attributes
    ----------
    values : dict of str to ndarray
        Scalars (nt,) and fields, (nt, cells) on a 1D grid and (nt, points) or (nt, points, 2) on triangles.
    edges, wall : ndarray (nt, cells + 1), (nt,), or None without a 1D grid
        Cell edges, and the outer end of the domain.
    inner : float or None
        Where the domain is the radius of a round body, the radius at its inner end; positions are measured from there.
    body : Body or None
        The deformed triangles of a result in two dimensions that holds its displacement.
    marks : Marks
        What its pictures show besides the fields.
    """

    result: Result
    model: Model
    title: str
    values: dict[str, Array]
    edges: Array | None
    wall: Array | None
    inner: float | None = None
    body: Body | None = None
    marks: Marks = field(default_factory=Marks)

    @property
    def t(self) -> Array:
        return self.result.t

    @property
    def reach(self) -> float:
        """What an axis of positions spans: the widest the domain gets, with a margin."""
        assert self.wall is not None
        return 1.05 * float(self.wall.max())

    @property
    def outer_reach(self) -> float:
        """Half the side of the square that holds the round body at every time, with a margin."""
        assert self.wall is not None
        assert self.inner is not None
        return 1.05 * (self.inner + float(self.wall.max()))

    @property
    def hollow(self) -> str:
        """What a round body encloses; empty to say nothing."""
        return self.model.ends[0].split(" | ")[0]

    def drawn(self, panel: Panel) -> Panel | None:
        """The panel as this result shows it, a scalar panel with the names that there are; None where there is nothing to show."""
        if (panel.kind == "ring" or panel.round_only) and self.inner is None:
            return None
        here = "line" if self.result.mesh is None else "triangles"
        if panel.grid not in ("", here):
            return None
        if panel.kind == "rest":
            return panel if self.body is not None and self.marks.properties else None
        if panel.kind == "scalar":
            names = tuple(name for name in panel.names if self._is_scalar(name))
            return replace(panel, names=names) if names else None
        if (self.edges if panel.kind in ON_A_LINE else self.body) is None:
            return None
        dimensions = (2,) if panel.kind in ON_A_LINE else (2, 3)
        return panel if all(name in self.values and self.values[name].ndim in dimensions for name in panel.names) else None

    def _is_scalar(self, name: str) -> bool:
        """Whether there is such a scalar; of a body of any shape, one that is a number at some time, as a radius need not be."""
        if name not in self.values or self.values[name].ndim != 1:
            return False
        return self.result.mesh is None or bool(np.isfinite(self.values[name]).any())

    def symbol(self, name: str) -> str:
        quantity = self.model.quantities.get(name)
        return f"${quantity.symbol}$" if quantity else name.replace("$", r"\$")

    def label(self, *names: str) -> str:
        """Axis label, "symbol description [unit]"; several names share a label of symbols."""
        if len(names) > 1:
            return ", ".join(self.symbol(name) for name in names) + self.bracket(names[0])
        quantity = self.model.quantities.get(names[0])
        description = quantity.description if quantity else self.result.descriptions.get(names[0], "")
        return f"{self.symbol(names[0])} {textwrap.fill(description + self.bracket(names[0]), 32)}".strip()

    def short_label(self, name: str) -> str:
        """Symbol and unit; of a vector those of its size."""
        symbol = self.symbol(name)
        return (f"|{symbol}|" if self.values[name].ndim == 3 else symbol) + self.bracket(name)

    def bracket(self, name: str) -> str:
        return "" if self.result.unit(name) == "-" else f" [{self.result.unit(name)}]"

    def position_label(self) -> str:
        return f"{self.model.position}{self.bracket('x')}"

    def radius_label(self) -> str:
        return f"distance from\nthe centre{self.bracket('x')}"

    def time_label(self) -> str:
        return f"time t{self.bracket('t') or ' (dimensionless)'}"

    def time_text(self, time: str) -> str:
        return f"t = {time}" if self.result.unit("t") == "-" else f"t = {time} {self.result.unit('t')}"

    def footer(self) -> str:
        """How the run ended, and its last stored time."""
        when = self.time_text(time_texts(self.t[-1:])[0])
        status, message = self.result.status, self.result.message
        if status == "completed":
            return f"completed at {when}"
        ended = f"not finished, stored up to {when}" if status == "running" else f"{status} at {when}"
        return textwrap.fill(textwrap.shorten(f"{ended}. {message}" if message else ended, 220, placeholder=" ..."), 110)


def view_of(result: Result) -> View:
    model = find_model(result.model)
    tables = tomllib.loads(result.scene)
    title = tables.get("scene", {}).get("title") or model.title
    given, result = result, result.in_units()
    x, wall = result.x, result.width()
    keep = np.isfinite(result.t)
    if result.mesh is not None and DISPLACEMENT in result.fields:
        keep = keep & np.isfinite(result.fields[DISPLACEMENT]).all(axis=(1, 2))
    if x is not None and wall is not None:
        keep = keep & np.isfinite(x).all(axis=1) & np.isfinite(wall)
    if not keep.any():
        raise ParameterError(
            "", "this result holds no time with finite positions, so there is nothing to draw; its message says how it ended."
        )
    result = replace(
        result,
        t=result.t[keep],
        x=None if x is None else x[keep],
        scalars={name: values[keep] for name, values in result.scalars.items()},
        fields={name: values[keep] for name, values in result.fields.items()},
    )
    if x is None or wall is None:
        fields, body = {} if result.mesh is None else result.fields, _body(result)
        marks = Marks() if body is None else model.marks(given)
        return View(result, model, str(title), result.scalars | fields, None, None, body=body, marks=marks)
    x, wall = x[keep], wall[keep]
    edges = np.column_stack([np.zeros(len(x)), 0.5 * (x[:, 1:] + x[:, :-1]), wall])
    values = result.scalars | {name: field for name, field in result.fields.items() if field.shape == x.shape}
    return View(result, model, str(title), values, edges, wall, _inner_radius(model, tables))


def _body(result: Result) -> Body | None:
    """The body of a result that has triangles and their displacement."""
    mesh = result.mesh
    if mesh is None or not mesh.triangles.size or DISPLACEMENT not in result.fields:
        return None
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return Body(mesh.points, result.fields[DISPLACEMENT], mesh.triangles, edges[count == 1])


def _inner_radius(model: Model, tables: dict[str, Any]) -> float | None:
    """Radius at the inner end of a round body, in the unit of positions."""
    inner = model.ring(tables.get("geometry", {}))
    if inner is None:
        return None
    factor, _ = Scales.from_table(tables.get("scales", {})).factor({"length": 1})
    return factor * float(inner)


def time_texts(times: Array) -> list[str]:
    """Times as text, with as many decimals as tell neighbours apart, scientific when all are very small or one is very large."""
    top = float(np.max(np.abs(times)))
    spacing = float(np.min(np.diff(times))) if len(times) > 1 else 0.1 * top
    if top == 0.0 or spacing <= 0.0:
        return [f"{time:g}" for time in times]
    if not 1e-3 <= top < 1e6:
        digits = int(np.clip(np.ceil(np.log10(top / spacing)) + 1, 3, 12))
        return [f"{time:.{digits}g}" for time in times]
    most = int(np.clip(1 - np.floor(np.log10(spacing)), 0, 8))
    least = next(d for d in range(most + 1) if all(round(time, d) == round(time, most) for time in times.tolist()))
    return [f"{time:.{least}f}" for time in times]


def limits(values: Array, margin: float = 0.05) -> tuple[float, float]:
    """Axis limits around the finite `values`; a constant gets room to either side instead of a picture of its rounding."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    size = max(abs(low), abs(high))
    if high - low <= 1e-9 * size or size == 0.0:
        room = 0.1 * size or 1.0
        return low - room, high + room
    return low - margin * (high - low), high + margin * (high - low)


def at_times(t: Array, values: Array, times: Array) -> Array:
    """`values` (nt, ...) at `times`, linear in time at fixed cell index."""
    if len(t) == 1:
        return np.repeat(values[:1], len(times), axis=0)
    right = np.clip(np.searchsorted(t, times, side="right"), 1, len(t) - 1)
    left = right - 1
    weight = ((times - t[left]) / (t[right] - t[left])).reshape(-1, *[1] * (values.ndim - 1))
    mixed = (1.0 - weight) * values[left] + weight * values[right]
    # A stored time is shown as stored, even where its neighbour is not a number.
    return np.where(weight == 0.0, values[left], np.where(weight == 1.0, values[right], mixed))


def spread_rows(t: Array, count: int) -> list[int]:
    """Indices of at most `count` stored times, about evenly spread in time, first and last included."""
    wanted = np.linspace(t[0], t[-1], count)
    return sorted({int(np.argmin(np.abs(t - time))) for time in wanted})
