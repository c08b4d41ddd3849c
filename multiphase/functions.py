"""Functions of position and of time, as a scene file or a script may write them.

A function of position is a number, ``{at = [...], values = [...]}``, ``{file = "x.csv"}``, an expression such as
``"0.9 - 0.1*exp(-10*xi)"``, or (in Python) a callable. A function of time is a number or ``{times = [...], values = [...]}``.
Expressions are parsed into a tree of allowed parts and evaluated from it; they are never run as Python code.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import POSITION_FORMS, check_keys, describe, float_or_refuse, is_number, nearest, numbers

Array = NDArray[np.float64]

SAMPLES = 2001
"""Points at which a Python callable is sampled over the body."""

LONGEST_EXPRESSION = 1000
DEEPEST_NESTING = 100
CONSTANTS: Mapping[str, float] = {"pi": float(np.pi), "e": float(np.e)}
FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int]] = {  # name: (function, number of arguments)
    "sin": (np.sin, 1), "cos": (np.cos, 1), "tan": (np.tan, 1), "asin": (np.arcsin, 1), "acos": (np.arccos, 1), "atan": (np.arctan, 1),
    "atan2": (np.arctan2, 2), "sinh": (np.sinh, 1), "cosh": (np.cosh, 1), "tanh": (np.tanh, 1), "exp": (np.exp, 1), "log": (np.log, 1),
    "log10": (np.log10, 1), "sqrt": (np.sqrt, 1), "abs": (np.abs, 1), "sign": (np.sign, 1), "min": (np.minimum, 2), "max": (np.maximum, 2),
    "where": (np.where, 3),
}  # fmt: skip
_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.UAdd: np.positive, ast.USub: np.negative,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip


class Expression:
    """A formula in named variables, checked when it is made and evaluated without running any code of the user's.

    Parameters
    ----------
    text : str
        For instance ``"0.1 + 0.05*cos(pi*xi)**2"``. Allowed: numbers, the variables, ``pi``, ``e``, ``+ - * / **``, brackets,
        the functions in `FUNCTIONS`, and comparisons with ``<``, ``<=``, ``>``, ``>=`` inside ``where(condition, a, b)``.
    variables : sequence of str
    path : str
        Dotted path of the value, for messages.
    """

    def __init__(self, text: str, variables: Sequence[str], path: str = "") -> None:
        self.text = text
        self.variables = tuple(variables)
        self.path = path
        if len(text) > LONGEST_EXPRESSION:
            raise ParameterError(
                path,
                f"the expression is {len(text)} characters long and at most {LONGEST_EXPRESSION} are read; "
                "give the values as { at = [...], values = [...] } instead.",
            )
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
            self._check(self._tree)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, ParameterError):
                raise
            raise self._refusal("cannot be read as a formula") from None

    def __call__(self, coordinates: Mapping[str, ArrayLike]) -> Array:
        with np.errstate(all="ignore"):  # a division by zero is reported by the caller with its position, as a value that is not finite
            return np.asarray(self._evaluate(self._tree, coordinates), dtype=float)

    @property
    def names(self) -> set[str]:
        """The variables that the formula uses."""
        return {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name) and node.id in self.variables}

    def _refusal(self, why: str) -> ParameterError:
        stop = "" if why.endswith(("?", ".")) else "."
        allowed = f"{', '.join((*self.variables, *CONSTANTS))}, numbers, + - * / **, brackets and {', '.join(FUNCTIONS)}"
        example = f'"0.9 - 0.1*exp(-5*{self.variables[-1]})"'
        return ParameterError(self.path, f'"{self.text}" {why}{stop} A formula may use {allowed}; for instance {example}.')

    def _check(self, node: ast.AST, depth: int = 0) -> None:
        """Refuse every part of the formula that is not on the lists above."""
        if depth > DEEPEST_NESTING:
            raise self._refusal(f"is nested more than {DEEPEST_NESTING} deep")
        children: list[ast.AST] = []
        match node:
            case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
                float_or_refuse(value, self.path)
            case ast.Name(id=name):
                self._check_name(name)
            case ast.BinOp(op=ast.BitXor()):
                raise self._refusal(f"uses ^, which is not a power here; write {self.variables[0]}**2")
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                children = [left, right]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                children = [operand]
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
                children = [left, right]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(name, len(arguments))
                children = list(arguments)
            case _:
                raise self._refusal("contains a part that is not allowed in a formula")
        for child in children:
            self._check(child, depth + 1)

    def _check_name(self, name: str) -> None:
        if name not in self.variables and name not in CONSTANTS:
            raise self._refusal(f"uses {name}, which is not known here{nearest(name, (*self.variables, *CONSTANTS))}")

    def _check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            raise self._refusal(f"uses a function {name}, which is not known here{nearest(name, FUNCTIONS)}")
        wanted = FUNCTIONS[name][1]
        if count != wanted:
            raise self._refusal(f"gives {name} {count} argument{'s' * (count != 1)} where it takes {wanted}")

    def _evaluate(self, node: ast.AST, coordinates: Mapping[str, ArrayLike]) -> Any:
        match node:
            case ast.Constant(value=int() | float() as value):
                return np.float64(value)  # never a Python integer: 9**9**9 must overflow at once, not compute for hours
            case ast.Name(id=name):
                return np.asarray(coordinates[name], dtype=float) if name in self.variables else np.float64(CONSTANTS[name])
            case ast.BinOp(left=left, op=op, right=right):
                return _OPERATORS[type(op)](self._evaluate(left, coordinates), self._evaluate(right, coordinates))
            case ast.UnaryOp(op=op, operand=operand):
                return _OPERATORS[type(op)](self._evaluate(operand, coordinates))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                truth = _OPERATORS[type(op)](self._evaluate(left, coordinates), self._evaluate(right, coordinates))
                return np.asarray(truth, dtype=float)  # 1 or 0, so that arithmetic goes on with numbers
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return FUNCTIONS[name][0](*(self._evaluate(argument, coordinates) for argument in arguments))
        raise AssertionError("a part of the formula was not checked")


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
    variables : sequence of str, default ("x", "xi")
        Names of the coordinate, first, and of others that a formula may use. A callable needs one coordinate, x or another, and xi.
    path : str
        Dotted path of the value, for messages.
    folder : Path, optional
        Where a relative ``file`` is looked for; the current folder if not given.
    length : float, default 1
        Extent of the body along its coordinate, used to sample a callable.

    Two functions are equal when they are written the same way: equal numbers, equal text, or equal tables.
    """

    __slots__ = ("_at", "_callable", "_expression", "_number", "_values", "path", "variables")

    def __init__(
        self, value: Any, *, variables: Sequence[str] = ("x", "xi"), path: str = "", folder: Path | None = None, length: float = 1.0
    ) -> None:
        self.variables = tuple(variables)
        self.path = path
        self._number: float | None = None
        self._expression: Expression | None = None
        self._callable: Callable[..., Any] | None = None
        self._at: Array = np.empty(0)
        self._values: Array = np.empty(0)
        if isinstance(value, PositionFunction):
            value = value._callable or value.to_table()
        if isinstance(value, str):
            self._expression = Expression(value, self.variables, path)
        elif isinstance(value, Mapping):
            self._at, self._values = _table(value, path, folder)
        elif callable(value):
            self._callable = value
            self._at, self._values = _sample(value, self.variables, path, length)
        elif is_number(value):
            self._number = float_or_refuse(value, path)
        else:
            raise ParameterError(path, f"expected {POSITION_FORMS}, but got {describe(value)}.")

    def __call__(self, **coordinates: ArrayLike) -> Array:
        """Values at `coordinates` (arrays named after `variables`, broadcast together).

        Raises
        ------
        ParameterError
            Where an expression is not finite.
        """
        arrays = np.broadcast_arrays(*(np.asarray(array, dtype=float) for array in coordinates.values()))
        named = dict(zip(coordinates, arrays, strict=True))
        shape = arrays[0].shape
        if self._number is not None:
            return np.full(shape, self._number)
        if self._expression is None:
            return np.asarray(np.interp(named[self.variables[0]], self._at, self._values), dtype=float)
        values = np.array(np.broadcast_to(self._expression(named), shape))
        if not np.all(np.isfinite(values)):
            first = int(np.argmin(np.isfinite(values)))
            where = ", ".join(f"{name} = {array.flat[first]:.6g}" for name, array in named.items())
            text = self._expression.text
            raise ParameterError(self.path, f'"{text}" gives {values.flat[first]} at {where}; it must be finite everywhere.')
        return values

    @property
    def constant(self) -> float | None:
        """The number, where the function is given as one; otherwise None."""
        return self._number

    @property
    def listed(self) -> Array:
        """Every value that is given outright: the number, or the values of a table; empty for an expression."""
        return self._values if self._number is None else np.array([self._number])

    @property
    def is_sampled(self) -> bool:
        """Whether the function was a Python function."""
        return self._callable is not None

    @property
    def extent(self) -> tuple[float, float] | None:
        """First and last position of a table or file; None for a number, an expression or a callable."""
        if self._number is not None or self._expression is not None or self._callable is not None:
            return None
        return float(self._at[0]), float(self._at[-1])

    @property
    def names(self) -> set[str]:
        """The coordinates that an expression uses; empty for other forms."""
        return set() if self._expression is None else self._expression.names

    def with_length(self, length: float) -> PositionFunction:
        """The same function on a body of another extent: a callable is sampled again, the rest is as it was."""
        return self if self._callable is None else PositionFunction(self, variables=self.variables, path=self.path, length=length)

    def to_table(self) -> float | str | dict[str, list[float]]:
        """The function as it stands in a scene file; the content of a file, and the samples of a callable, as ``{at, values}``."""
        if self._number is not None:
            return self._number
        if self._expression is not None:
            return self._expression.text
        return {"at": self._at.tolist(), "values": self._values.tolist()}

    def __eq__(self, other: object) -> bool:
        if isinstance(other, PositionFunction):
            return self.to_table() == other.to_table()
        return self._number is not None and self._number == other

    def __hash__(self) -> int:
        return hash(self._number if self._number is not None else str(self.to_table()))

    def __float__(self) -> float:
        if self._number is None:
            raise TypeError(f"{self!r} varies in space and has no single value")
        return self._number

    def __repr__(self) -> str:
        if self._number is None and self._expression is None:
            return f"<{len(self._at)} values at {self.variables[0]} = {self._at[0]:g} to {self._at[-1]:g}>"
        return repr(self.to_table())

    def __reduce__(self) -> tuple[Callable[[Any, Any, str], PositionFunction], tuple[Any, Any, str]]:
        return _restore, (self.to_table(), self.variables, self.path)


class TimeSeries:
    """A number that may depend on time: constant, or piecewise linear through given points.

    Parameters
    ----------
    value : float, mapping or TimeSeries
        A number, or ``{"times": [...], "values": [...]}``. Times do not decrease; a time that stands twice is a jump. Before
        the first and after the last time the value is constant.
    path : str
        Dotted path of the value, for messages.

    Attributes
    ----------
    times, values : tuple of float
        The points; empty times and one value for a constant.
    breaks : tuple of float
        Times at which there is a kink or a jump.
    jumps : tuple of float
        Times at which the value jumps.
    """

    __slots__ = ("_t", "_v", "breaks", "jumps", "times", "values")

    def __init__(self, value: Any, *, path: str = "") -> None:
        if isinstance(value, TimeSeries):
            value = value.to_table()
        self.times: tuple[float, ...] = ()
        if isinstance(value, Mapping):
            check_keys(value, ("times", "values"), path)
            self.times = numbers(value["times"], f"{path}.times")
            self.values: tuple[float, ...] = numbers(value["values"], f"{path}.values")
            _check_lengths(self.times, self.values, "times", path)
            for i in range(1, len(self.times)):
                if self.times[i] < self.times[i - 1]:
                    raise ParameterError(f"{path}.times", f"{self.times[i]} comes after {self.times[i - 1]}; times must not decrease.")
                if i > 1 and self.times[i] == self.times[i - 2]:
                    raise ParameterError(f"{path}.times", f"{self.times[i]} stands three times; a jump is a time that stands twice.")
        elif is_number(value):
            self.values = (float_or_refuse(value, path),)
        else:
            raise ParameterError(path, f"expected a number or a table {{ times = [...], values = [...] }}, but got {describe(value)}.")
        self._t, self._v = np.array(self.times), np.array(self.values)
        self.jumps: tuple[float, ...] = tuple(t for t in dict.fromkeys(self.times) if self(t, side=-1) != self(t))
        kinks = {t for t in self.times if self._slope(t, -1) != self._slope(t, 1)}
        self.breaks: tuple[float, ...] = tuple(sorted(kinks.union(self.jumps)))

    @overload
    def __call__(self, t: float, side: int = 1) -> float: ...
    @overload
    def __call__(self, t: Array, side: int = 1) -> Array: ...
    def __call__(self, t: float | Array, side: int = 1) -> float | Array:
        """Value at time `t`; at a jump the value after it, or with ``side=-1`` the value just before it."""
        at = np.asarray(t, dtype=float)
        if not self.times:
            value = np.full(at.shape, self._v[0])
        else:
            first, second = self._segment(at, side)
            width = self._t[second] - self._t[first]
            weight = np.where(width > 0.0, (at - self._t[first]) / np.where(width > 0.0, width, 1.0), 0.0)
            value = (1.0 - weight) * self._v[first] + weight * self._v[second]
        return value if np.ndim(t) else float(value)

    def _segment(self, at: Array, side: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the points before and after `at`; the same index twice outside the points."""
        after = np.searchsorted(self._t, at, side="right" if side >= 0 else "left")
        last = len(self._t) - 1
        return np.clip(after - 1, 0, last), np.clip(after, 0, last)

    def _slope(self, t: float, side: int) -> float:
        first, second = self._segment(np.asarray(t), side)
        width = float(self._t[second] - self._t[first])
        return float(self._v[second] - self._v[first]) / width if width > 0.0 else 0.0

    @property
    def constant(self) -> float | None:
        """The number, where the series is given as one; otherwise None."""
        return None if self.times else self.values[0]

    def to_table(self) -> float | dict[str, list[float]]:
        """The series as it stands in a scene file."""
        return {"times": list(self.times), "values": list(self.values)} if self.times else self.values[0]

    def __eq__(self, other: object) -> bool:
        if isinstance(other, TimeSeries):
            return (self.times, self.values) == (other.times, other.values)
        return not self.times and self.values[0] == other

    def __hash__(self) -> int:
        return hash((self.times, self.values)) if self.times else hash(self.values[0])

    def __float__(self) -> float:
        if self.times:
            raise TypeError(f"{self!r} varies in time and has no single value")
        return self.values[0]

    def __repr__(self) -> str:
        return repr(self.to_table())


def _restore(value: Any, variables: Sequence[str], path: str) -> PositionFunction:
    return PositionFunction(value, variables=variables, path=path)


def _check_lengths(positions: Sequence[float], values: Sequence[float], name: str, path: str) -> None:
    if len(positions) != len(values) or not positions:
        raise ParameterError(
            path, f"there are {len(positions)} {name} and {len(values)} values; there must be equally many, and at least one of each."
        )


def _table(table: Mapping[str, Any], path: str, folder: Path | None) -> tuple[Array, Array]:
    """Positions and values of ``{at, values}`` or ``{file}``, checked."""
    if "file" in table:
        check_keys(table, ("file",), path)
        at, values = _read_csv(table["file"], f"{path}.file", folder)
        where = f"{path}.file"
    else:
        check_keys(table, ("at", "values"), path)
        at, values = numbers(table["at"], f"{path}.at"), numbers(table["values"], f"{path}.values")
        where = f"{path}.at"
    _check_lengths(at, values, "positions", path)
    for previous, position in pairwise(at):
        if position <= previous:
            raise ParameterError(where, f"{position} comes after {previous}; positions must increase.")
    return np.array(at), np.array(values)


def _read_csv(name: Any, path: str, folder: Path | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two columns, position and value, separated by commas, semicolons or blanks; one heading line and # comments are allowed."""
    if not isinstance(name, str):
        raise ParameterError(path, f"expected the name of a CSV file in quotes, but got {describe(name)}.")
    file = (folder or Path()) / name
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or "it is not a text file in UTF-8"
        raise ParameterError(
            path, f"the file {file} cannot be read: {reason}. A relative name is looked for beside the scene file."
        ) from None
    rows: list[tuple[float, float]] = []
    heading_allowed = True
    for number, line in enumerate(lines, start=1):
        cells = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        if heading_allowed and cells and not any(_is_number(cell) for cell in cells):
            heading_allowed = False
        elif cells:
            heading_allowed = False
            if len(cells) != 2 or not all(_is_number(cell) and np.isfinite(float(cell)) for cell in cells):
                raise ParameterError(
                    path, f'line {number} of {file} is "{line.strip()}"; two finite numbers are expected, a position and a value.'
                )
            rows.append((float(cells[0]), float(cells[1])))
    return tuple(row[0] for row in rows), tuple(row[1] for row in rows)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


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
