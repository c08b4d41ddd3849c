"""Functions of position, as a scene file or a script may write them.

A function of position is a number, ``{at = [...], values = [...]}``, ``{file = "x.csv"}``, an expression such as
``"0.9 - 0.1*exp(-10*xi)"``, or (in Python) a callable; in two dimensions also a grid of values, ``{pixel = 0.02, values = [[...], ...]}``,
or an image, ``{image = "x.png", pixel = 0.02, low = 0.2, high = 1.5}``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multiphase.columns import columns_from_table
from multiphase.errors import ParameterError
from multiphase.formulas import Expression
from multiphase.grids import Grid, grid_from_image, grid_from_table
from multiphase.parameters import describe, float_or_refuse, is_number, position_forms

Array = NDArray[np.float64]

SAMPLES = 2001
"""Points at which a Python callable is sampled over the body."""


class PositionFunction:
    """A function of position inside the body at t = 0.

    Parameters
    ----------
    value : float, str, mapping, callable or PositionFunction
        A number; an expression in `variables`; ``{"at": [...], "values": [...]}``, piecewise linear with positions measured in
        the first of `variables` and constant beyond its ends; ``{"file": "x.csv"}`` with two such columns; or a Python callable
        whose arguments are named after `variables` (any other single argument receives the first variable). A callable is
        sampled at 2001 equally spaced points of ``0 <= x <= length``, xi = x/length, and is from then on the piecewise linear
        function through these points: what runs is what is stored in the result.

        Where `variables` hold the plane's coordinates x and y, also a grid, ``{"pixel": 0.02, "values": [[...], ...]}``: rows of values
        from top to bottom, as in an image, at the centres of square pixels of that side, with the middle of the grid at the origin;
        bilinear between the centres and constant across the outer half pixel. Or ``{"image": "x.png", "pixel": 0.02, "low": 0.2,
        "high": 1.5}``: such a grid from the grey of an image file, or of a NumPy array in a file .npy, black as low and white as high,
        with six digits; it is from then on that grid, and stored as one.
    variables : sequence of str, default ("x", "xi")
        Names of the coordinate, first, and of others that a formula may use. A callable needs one coordinate, x or another, and xi.
    path : str
        Dotted path of the value, for messages.
    folder : Path, optional
        Where a relative ``file`` or ``image`` is looked for; the current folder if not given.
    length : float, optional
        Extent of the body along its coordinate, used to sample a callable. If not given, 1, and a function that was sampled before
        stays as it was.

    Two functions are equal when they are written the same way: equal numbers, equal text, or equal tables.
    """

    __slots__ = ("_at", "_callable", "_expression", "_grid", "_number", "_values", "path", "variables")

    def __init__(
        self,
        value: Any,
        *,
        variables: Sequence[str] = ("x", "xi"),
        path: str = "",
        folder: Path | None = None,
        length: float | None = None,
    ) -> None:
        self.variables = tuple(variables)
        self.path = path
        self._number: float | None = None
        self._expression: Expression | None = None
        self._callable: Callable[..., Any] | None = None
        self._grid: Grid | None = None
        self._at: Array = np.empty(0)
        self._values: Array = np.empty(0)
        if isinstance(value, PositionFunction):
            if value.variables == self.variables and (length is None or value._callable is None):
                self._take(value)
                return
            value = value._callable or value.to_table()
        if isinstance(value, str):
            self._expression = Expression(value, self.variables, path)
        elif isinstance(value, Mapping):
            self._read(value, folder)
        elif callable(value):
            self._callable = value
            self._at, self._values = _sample(value, self.variables, path, 1.0 if length is None else length)
        elif is_number(value):
            self._number = float_or_refuse(value, path)
        else:
            raise ParameterError(path, f"expected {position_forms(self.variables)}, but got {describe(value)}.")

    def _take(self, other: PositionFunction) -> None:
        """Become the same function as one that is made, without a look at its values."""
        self._number, self._callable, self._grid = other._number, other._callable, other._grid
        self._at, self._values = other._at, other._values
        self._expression = other._expression and Expression(other._expression.text, self.variables, self.path)

    def _read(self, table: Mapping[str, Any], folder: Path | None) -> None:
        """Read one of the forms that are tables."""
        match _form(table, self.variables):
            case "image":
                self._grid = grid_from_image(table, self.path, folder)
            case "grid":
                self._grid = grid_from_table(table, self.path)
            case _:
                self._at, self._values = columns_from_table(table, self.path, folder)

    def __call__(self, **coordinates: ArrayLike) -> Array:
        """Values at `coordinates` (arrays named after `variables`, broadcast together).

        Raises
        ------
        ParameterError
            Where an expression is not finite, and beyond a grid.
        """
        arrays = np.broadcast_arrays(*(np.asarray(array, dtype=float) for array in coordinates.values()))
        named = dict(zip(coordinates, arrays, strict=True))
        shape = arrays[0].shape
        if self._number is not None:
            return np.full(shape, self._number)
        if self._grid is not None:
            return self._grid(named["x"], named["y"], self.path)
        if self._expression is None:
            return np.asarray(np.interp(named[self.variables[0]], self._at, self._values), dtype=float)
        values = np.array(np.broadcast_to(self._expression(named), shape))
        if not np.all(np.isfinite(values)):
            first = int(np.argmin(np.isfinite(values)))
            text = self._expression.text
            raise ParameterError(
                self.path, f'"{text}" gives {values.flat[first]} at {place(coordinates, first)}; it must be finite everywhere.'
            )
        return values

    @property
    def constant(self) -> float | None:
        """The number, where the function is given as one; otherwise None."""
        return self._number

    @property
    def listed(self) -> Array:
        """Every value that is given outright: the number, or the values of a table or grid; empty for an expression."""
        if self._grid is not None:
            return self._grid.values.ravel()
        return self._values if self._number is None else np.array([self._number])

    @property
    def is_sampled(self) -> bool:
        """Whether the function was a Python function."""
        return self._callable is not None

    @property
    def is_grid(self) -> bool:
        """Whether the function is given on a grid of pixels."""
        return self._grid is not None

    @property
    def extent(self) -> tuple[float, float] | None:
        """First and last position of a table or file; None for every other form."""
        if not self._at.size or self._callable is not None:
            return None
        return float(self._at[0]), float(self._at[-1])

    @property
    def names(self) -> set[str]:
        """The coordinates that an expression uses; x and y for a grid; empty for other forms."""
        if self._grid is not None:
            return {"x", "y"}
        return set() if self._expression is None else self._expression.names

    def with_length(self, length: float) -> PositionFunction:
        """The same function on a body of another extent: a callable is sampled again, the rest is as it was."""
        return self if self._callable is None else PositionFunction(self, variables=self.variables, path=self.path, length=length)

    def to_table(self) -> float | str | dict[str, Any]:
        """The function as it stands in a scene file; data of files, and the samples of a callable, written out."""
        if self._number is not None:
            return self._number
        if self._expression is not None:
            return self._expression.text
        if self._grid is not None:
            return self._grid.to_table()
        return {"at": self._at.tolist(), "values": self._values.tolist()}

    @property
    def _text(self) -> str | None:
        return None if self._expression is None else self._expression.text

    def __eq__(self, other: object) -> bool:
        if isinstance(other, PositionFunction):
            return (
                (self._number, self._text, self._grid) == (other._number, other._text, other._grid)
                and np.array_equal(self._at, other._at)
                and np.array_equal(self._values, other._values)
            )
        return self._number is not None and self._number == other

    def __hash__(self) -> int:
        return hash(self._number if self._number is not None else (self._text, self._grid, *_bytes(self._at, self._values)))

    def __float__(self) -> float:
        if self._number is None:
            raise TypeError(f"{self!r} varies in space and has no single value")
        return self._number

    def __repr__(self) -> str:
        if self._grid is not None:
            return repr(self._grid)
        if self._number is None and self._expression is None:
            return f"<{len(self._at)} values at {self.variables[0]} = {self._at[0]:g} to {self._at[-1]:g}>"
        return repr(self.to_table())

    def __reduce__(self) -> tuple[Callable[[Any, Any, str], PositionFunction], tuple[Any, Any, str]]:
        return _restore, (self.to_table(), self.variables, self.path)


def _bytes(*arrays: Array) -> tuple[bytes, ...]:
    return tuple((array + 0.0).tobytes() for array in arrays)  # + 0.0, as -0.0 equals 0.0 and must hash alike


def place(coordinates: Mapping[str, ArrayLike], index: int) -> str:
    """A place for messages, ``x = 0.5, y = 0``: of `coordinates` broadcast together, the one of this flat index."""
    arrays = np.broadcast_arrays(*(np.asarray(array, dtype=float) for array in coordinates.values()))
    return ", ".join(f"{name} = {array.flat[index]:.6g}" for name, array in zip(coordinates, arrays, strict=True))


def _form(table: Mapping[str, Any], variables: Sequence[str]) -> str:
    """Which form a table has or, where its keys are wrong, comes nearest to."""
    if "file" in table or not {"x", "y"} <= set(variables):
        return "at"
    if "image" in table:
        return "image"
    values = table.get("values")
    in_rows = isinstance(values, list | tuple | np.ndarray) and len(values) > 0 and isinstance(values[0], list | tuple | np.ndarray)
    if "at" not in table and ("pixel" in table or in_rows):
        return "image" if {"low", "high"} & set(table) else "grid"
    return "at"


def _restore(value: Any, variables: Sequence[str], path: str) -> PositionFunction:
    return PositionFunction(value, variables=variables, path=path)


def _sample(function: Callable[..., Any], variables: Sequence[str], path: str, length: float) -> tuple[Array, Array]:
    """Positions (SAMPLES,) over the body, and the callable's values there."""
    coordinate = variables[0]
    at = np.linspace(0.0, length, SAMPLES)
    coordinates = {coordinate: at, "xi": np.linspace(0.0, 1.0, SAMPLES)}
    try:
        wanted = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    except (TypeError, ValueError):
        wanted = []
    others = {p.name for p in wanted} & (set(variables) - {coordinate, "xi"})
    if others:
        raise ParameterError(
            path,
            f"a Python function of {', '.join(sorted(others))} cannot be used here, as it is sampled along {coordinate}; give a formula.",
        )
    if wanted and {p.name for p in wanted} <= set(variables):
        by_name = {p.name: coordinates[p.name] for p in wanted if p.kind is p.KEYWORD_ONLY}
        result = function(*(coordinates[p.name] for p in wanted if p.kind is not p.KEYWORD_ONLY), **by_name)
    else:
        result = function(coordinates[coordinate])
    values = np.asarray(result, dtype=float)
    if values.ndim and values.shape != at.shape:
        raise ParameterError(
            path, f"the function gives an array of shape {values.shape} for {SAMPLES} positions; one value each is expected."
        )
    values = np.array(np.broadcast_to(values, at.shape))
    if not np.all(np.isfinite(values)):
        first = int(np.argmin(np.isfinite(values)))
        raise ParameterError(path, f"the function gives {values[first]} at {coordinate} = {at[first]:.6g}; it must be finite everywhere.")
    return at, values
