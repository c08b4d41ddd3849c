"""Parameter dataclasses: fields with symbol, unit, bounds and source; checking; dict <-> dataclass; physical scales.

A parameter dataclass is frozen, slotted and keyword-only, names its scene table in the class variable ``table`` and calls
`validate` when it is made, so an object that exists is valid:

>>> @dataclass(frozen=True, slots=True, kw_only=True)
... class Tissue:
...     table: ClassVar[str] = "parameters"
...     b: float = parameter(1.0, symbol="b", low=0.0, low_open=True, doc="drag")
...
...     def __post_init__(self) -> None:
...         validate(self, self.table)
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

import numpy as np

from multiphase.errors import ParameterError

T = TypeVar("T")

POSITION_FORMS = 'a number, a formula such as "0.9 - 0.1*xi", a table { at = [...], values = [...] } or { file = "x.csv" }'
"""How a function of position may be written."""

PLANE_FORMS = ', or a grid { pixel = 0.02, values = [[...], ...] } or { image = "x.png", pixel = 0.02, low = 0.2, high = 1.5 }'
"""And how else in two dimensions."""

TENSOR_FORMS = "; a tensor also as { along = ..., across = ... } or { xx = ..., yy = ..., xy = ... } of these"
"""And how else a tensor."""

_KINDS = ("number", "integer", "flag", "word", "words", "file", "function", "tensor", "series", "points", "loops")
_KIND_OF_DEFAULT = {bool: "flag", int: "integer", float: "number", str: "word", tuple: "words"}


@dataclass(frozen=True, slots=True)
class Parameter:
    """What is known about one field: see `parameter`."""

    symbol: str
    kind: str
    unit: str
    low: float | None
    high: float | None
    low_open: bool
    high_open: bool
    choices: tuple[str, ...]
    variables: tuple[str, ...]
    optional: bool
    source: str
    doc: str

    @property
    def expected(self) -> str:
        """What a value must be, in words: ``a number from 0 to 1``."""
        words = " or ".join(f'"{choice}"' for choice in self.choices)
        match self.kind:
            case "number" | "integer":
                number = f"{'a whole number' if self.kind == 'integer' else 'a number'}{self.bounds}"
                return f"{words} or {number}" if words else number
            case "flag":
                return "true or false"
            case "word":
                return words or "a text in quotes"
            case "words":
                return 'a list of names in quotes, such as ["n"]'
            case "file":
                return "the name of a file in quotes"
            case "points":
                return "a list of points [x, y], such as [[0, 0], [1, 0], [0, 1]]"
            case "loops":
                return "a list of lists of points [x, y], such as [[[0, 0], [1, 0], [0, 1]]]"
            case "function":
                return position_forms(self.variables)
            case "tensor":
                return position_forms(self.variables) + TENSOR_FORMS
        return f"a number{self.bounds} or a table {{ times = [...], values = [...] }}"

    @property
    def bounds(self) -> str:
        """The allowed range, to follow the word number: `` from 0 to 1``; empty without bounds."""
        if self.low is None and self.high is None:
            return ""
        if self.low is not None and self.high is not None and not self.low_open and not self.high_open:
            return f" from {self.low:g} to {self.high:g}"
        parts = []
        if self.low is not None:
            parts.append(f"greater than {self.low:g}" if self.low_open else f"of {self.low:g} or more")
        if self.high is not None:
            parts.append(f"below {self.high:g}" if self.high_open else f"at most {self.high:g}")
        return " " + " and ".join(parts)

    def allows(self, value: float) -> bool:
        """Whether a number lies within the bounds."""
        above = self.low is None or value > self.low or (value == self.low and not self.low_open)
        below = self.high is None or value < self.high or (value == self.high and not self.high_open)
        return above and below


def parameter(
    default: Any,
    *,
    symbol: str,
    unit: str = "-",
    low: float | None = None,
    high: float | None = None,
    low_open: bool = False,
    high_open: bool = False,
    choices: Iterable[str] = (),
    source: str = "",
    doc: str = "",
    kind: str | None = None,
    variables: Iterable[str] = ("x", "xi"),
) -> Any:
    """A dataclass field that knows its symbol, unit, allowed range and source.

    Parameters
    ----------
    default : float, int, bool, str, tuple or None
        None makes the value optional: it is left out of scene files.
    symbol, unit : str
        As in the paper; "-" for a dimensionless value.
    low, high : float, optional
        Bounds, allowed themselves unless `low_open` or `high_open`. For functions they hold for every listed value.
    choices : iterable of str
        The only words allowed; with ``kind="number"``, words allowed beside numbers.
    source, doc : str
        Where the default comes from; what the parameter is, in a few words (used in messages).
    kind : "number", "integer", "flag", "word", "words", "function" (of position), "tensor" (the same), "series" (in time),
        "points" (a list of pairs of numbers) or "loops" (a list of such lists)
        Follows from the type of `default` if not given.
    variables : iterable of str
        For a function of position or a tensor: the names it may use, the coordinate of its tables first.
    """
    chosen = kind or _KIND_OF_DEFAULT.get(type(default), "")
    if chosen not in _KINDS:
        raise TypeError(f"kind must be one of {', '.join(_KINDS)}, and be given where the default is {default!r}")
    specification = Parameter(
        symbol, chosen, unit, low, high, low_open, high_open, tuple(choices), tuple(variables), default is None, source, doc
    )
    return dataclasses.field(default=default, metadata={"parameter": specification})


def position_forms(variables: Iterable[str]) -> str:
    """How a function of position in these variables may be written."""
    return POSITION_FORMS + (PLANE_FORMS if {"x", "y"} <= set(variables) else "")


def specifications(cls: Any) -> dict[str, Parameter]:
    """The `Parameter` of every field of a parameter dataclass, in order."""
    return {item.name: item.metadata["parameter"] for item in dataclasses.fields(cls) if "parameter" in item.metadata}


def nearest(name: str, names: Iterable[str]) -> str:
    """The end of a sentence: ``; did you mean "k_m"?`` for the nearest of `names`, or a full stop where none is near."""
    folded = {candidate.casefold(): candidate for candidate in names}
    match = difflib.get_close_matches(name.casefold(), folded, n=1)
    return f'; did you mean "{folded[match[0]]}"?' if match else "."


def validate(obj: Any, path: str) -> None:
    """Check every field of a parameter dataclass, and put each value into its stored form.

    Stored are floats, integers, truth values, words, `PositionFunction`, `TensorFunction` and `TimeSeries`; so an integer given for
    a float becomes a float, and a number given for a function becomes a constant function.

    Raises
    ------
    ParameterError
        Naming the field, ``path.field``, for a wrong type, a value that is not finite, out of bounds or not a choice.
    """
    for name, specification in specifications(obj).items():
        object.__setattr__(obj, name, _checked(getattr(obj, name), specification, f"{path}.{name}"))


def from_table(
    cls: type[T], table: Mapping[str, Any], path: str, *, folder: Path | None = None, elsewhere: Mapping[str, str] | None = None
) -> T:
    """Make a parameter dataclass from a table of a scene file.

    Parameters
    ----------
    cls : type
    table : mapping
        As TOML gives it. Missing keys take their defaults.
    path : str
        Name of the table, for messages.
    folder : Path, optional
        Where relative ``{file = "x.csv"}`` names are looked for.
    elsewhere : mapping of str to str, optional
        Keys of other tables and where each belongs, for the message about an unknown key.
    """
    if not isinstance(table, Mapping):
        raise ParameterError(path, f"expected a table, [{path}] on a line of its own with its keys below, but got {describe(table)}.")
    known = specifications(cls)
    values = {key: table[key] for key in known if key in table}
    for key, value in values.items():
        if known[key].kind in ("function", "tensor") and folder is not None:
            values[key] = _function(value, known[key], f"{path}.{key}", folder)
        if known[key].kind == "file" and folder is not None and isinstance(value, str) and (folder / value).exists():
            values[key] = str(folder / value)
    made = cls(**values)
    for key in table:
        if key not in known:
            if elsewhere and key in elsewhere:
                raise ParameterError(f"{path}.{key}", f"{key} does not belong in [{path}]; move it to [{elsewhere[key]}].")
            hint = nearest(key, known)
            raise ParameterError(f"{path}.{key}", f'there is no key "{key}" in [{path}]{hint} Its keys are {", ".join(known)}.')
    return made


def to_table(obj: Any) -> dict[str, Any]:
    """The dataclass as a TOML-ready table with every default written out; optional values that are not set are left out."""
    table = {}
    for name in specifications(obj):
        value = getattr(obj, name)
        if hasattr(value, "to_table"):
            table[name] = value.to_table()
        elif value is not None:
            table[name] = _lists(value)
    return table


def _lists(value: Any) -> Any:
    """Tuples, also within tuples, as lists."""
    return [_lists(item) for item in value] if isinstance(value, tuple) else value


def replace(obj: T, **changes: Any) -> T:
    """A copy with some fields changed, checked like a new one; an unknown name raises ParameterError with the nearest."""
    names = specifications(obj)
    for name in changes:
        if name not in names:
            path = getattr(obj, "table", type(obj).__name__)
            hint = nearest(name, names)
            raise ParameterError(f"{path}.{name}", f'there is no parameter "{name}"{hint} The parameters are {", ".join(names)}.')
    return dataclasses.replace(obj, **changes)  # type: ignore[type-var]


def describe(value: object) -> str:
    """A value as a message names it: ``the text "abc"``, ``true``, ``a list``."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return f'the text "{value}"'
        case Mapping():
            return f"a table with the keys {', '.join(map(str, value))}" if value else "an empty table"
        case list() | tuple():
            return f"a list of {len(value)}"
        case np.ndarray():
            return f"an array of shape {value.shape}"
        case int():
            return str(value) if abs(value) < 10**18 else "a whole number of more than 18 digits"
        case Real():
            return repr(float(value))
        case None:
            return "nothing (None)"
    return f"{value} ({type(value).__name__})"


def is_number(value: Any) -> TypeGuard[float]:
    """Whether `value` is a real number; true and false are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def float_or_refuse(value: Any, path: str) -> float:
    """`value` as a finite float. Anything but a number (true and false are none), NaN and infinity are refused."""
    if not is_number(value):
        raise ParameterError(path, f"expected a number, but got {describe(value)}.")
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if not np.isfinite(number):
        raise ParameterError(path, f"{number} is not allowed; it must be a finite number.")
    return number


def numbers(values: Any, path: str) -> tuple[float, ...]:
    """`values` as finite floats; a list or a one-dimensional array of numbers is expected."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, list | tuple):
        raise ParameterError(path, f"expected a list of numbers, but got {describe(values)}.")
    return tuple(float_or_refuse(value, f"{path}[{i}]") for i, value in enumerate(values))


def check_keys(table: Mapping[str, Any], wanted: Sequence[str], path: str) -> None:
    """Refuse a small table that has other keys than `wanted`."""
    form = f"{{ {', '.join(f'{key} = ...' for key in wanted)} }}"
    for key in table:
        if key not in wanted:
            raise ParameterError(f"{path}.{key}", f'there is no key "{key}" here{nearest(key, wanted)} The form is {form}.')
    for key in wanted:
        if key not in table:
            raise ParameterError(path, f'the key "{key}" is missing; the form is {form}.')


def _checked(value: Any, specification: Parameter, path: str) -> Any:
    """`value` in its stored form."""
    from multiphase.series import TimeSeries

    if value is None and specification.optional:
        return None
    if isinstance(value, str) and value in specification.choices:
        return value
    match specification.kind:
        case "number" | "integer":
            return _number(value, specification, path)
        case "function" | "tensor":
            function = _function(value, specification, path)
            _check_listed(function.listed, specification, path)
            return function
        case "series":
            series = TimeSeries(value, path=path)
            for number in series.values:
                _check_bounds(number, specification, path)
            return series
        case "flag" if isinstance(value, bool):
            return value
        case "words" if isinstance(value, list | tuple) and all(isinstance(word, str) for word in value):
            return tuple(value)
        case "word" | "file" if isinstance(value, str) and not specification.choices:
            return value
        case "points" if isinstance(_plain(value), list | tuple):
            return _points(value, path)
        case "loops" if isinstance(loops := _plain(value), list | tuple):
            return tuple(_points(loop, f"{path}[{i}]") for i, loop in enumerate(loops))
    raise _wrong(value, specification, path)


def _function(value: Any, specification: Parameter, path: str, folder: Path | None = None) -> Any:
    """A function of position or a tensor."""
    from multiphase.functions import PositionFunction
    from multiphase.tensors import TensorFunction

    made = PositionFunction if specification.kind == "function" else TensorFunction
    return made(value, variables=specification.variables, path=path, folder=folder)


def _check_listed(values: Any, specification: Parameter, path: str) -> None:
    """Check the bounds of many values; each by itself only where one is out of bounds, to name the first."""
    if len(values) and not (specification.allows(values.min()) and specification.allows(values.max())):
        for number in values:
            _check_bounds(float(number), specification, path)


def _points(values: Any, path: str) -> tuple[tuple[float, float], ...]:
    """Points in the plane, in tuples."""
    points = _plain(values)
    if not isinstance(points, list | tuple):
        raise ParameterError(path, f"expected a list of points [x, y], but got {describe(values)}.")
    found = []
    for i, point in enumerate(map(_plain, points)):
        if not isinstance(point, list | tuple) or len(point) != 2:
            raise ParameterError(f"{path}[{i}]", f"expected a point [x, y], two numbers, but got {describe(point)}.")
        x, y = numbers(point, f"{path}[{i}]")
        found.append((x, y))
    return tuple(found)


def _plain(values: Any) -> Any:
    """An array as lists; anything else as it is."""
    return values.tolist() if isinstance(values, np.ndarray) else values


def _number(value: Any, specification: Parameter, path: str) -> float | int:
    try:
        number = float_or_refuse(value, path)
    except ParameterError:
        raise _wrong(value, specification, path) from None
    _check_bounds(number, specification, path)
    if specification.kind == "number":
        return number
    if number != int(number):
        raise _wrong(value, specification, path)
    return int(value)


def _check_bounds(number: float, specification: Parameter, path: str) -> None:
    if not specification.allows(number):
        expected = specification.expected if specification.kind in ("number", "integer") else f"a number{specification.bounds}"
        raise ParameterError(path, f"{number:.15g} is not allowed; {_meaning(specification)}must be {expected}.")


def _wrong(value: Any, specification: Parameter, path: str) -> ParameterError:
    hint = nearest(value, specification.choices) if isinstance(value, str) else "."
    finite = " It must be finite." if isinstance(value, float) and value - value != 0.0 else ""
    return ParameterError(path, f"{_meaning(specification)}must be {specification.expected}, but got {describe(value)}{hint}{finite}")


def _meaning(specification: Parameter) -> str:
    return f"{specification.doc} " if specification.doc else "it "
