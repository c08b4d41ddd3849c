"""Named parts of a body's free surface and what acts on them: clamps, tractions, loads, springs, flow, oxygen, membranes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.parameters import describe, nearest, parameter, specifications, to_table, validate
from multiphase.series import TimeSeries

TABLE = "boundary"
OUTSIDE, CLOSED = "outside", "closed"
COORDINATES = ("x", "y", "r", "theta", "xi")
"""What a formula that selects a part may use."""

_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")
_WORDS = (OUTSIDE, CLOSED)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryPart:
    """A part of the free surface, and what acts on it: a table ``[boundary.NAME]`` of a scene.

    With N the outward unit normal at rest, and everything dimensionless as in `TumourParameters`, the traction per length at rest is

        P N = traction - spring d - spring_normal (d.N) N - load J F^-T N

    in each direction in which the displacement d is not prescribed. A value in time is a number or
    ``{"times": [...], "values": [...]}``.

    Attributes
    ----------
    name : str
        For messages; a collection of parts gives each its own.
    side : str or None
        A named side of the free surface: "surface" is all of it; an outline has "outer", "hole 1", ..., a mesh its physical lines.
    where : str or None
        A formula in x, y, r, theta and xi = r/radius at the middles of the edges at rest: the part is where it is true, or greater than 0.
        With `side` as well, where both hold; one of them must be given.
    displacement_x, displacement_y : TimeSeries or None
        Prescribed displacement (a length), in time. Both 0 is a clamp; one 0 slides along the other axis; None is free.
    traction_x, traction_y : TimeSeries
        Dead traction: force per length at rest (a stress), in time; keeps its direction.
    load : TimeSeries
        Pressure on the surface as it is: force per length now (a stress), in time; it turns with the surface, and pushes where positive.
    spring, spring_normal : float
        Elastic foundation: force per length at rest and per displacement (a stress over a length), in all directions and along N alone.
    p : "outside", "closed" or TimeSeries
        Fluid pressure (a stress), in time; "outside" is p_out; "closed" lets no fluid through.
    C : "outside", "closed" or TimeSeries
        Oxygen, in time; "outside" is C_out; "closed" lets no oxygen through but the `influx`.
    membrane : float or None
        Permeability h of a membrane with the oxygen C beyond it: h (C - C at the surface) flows in per length now (a length over a time,
        over the diffusivity: one over a length).
    influx : TimeSeries
        Oxygen that flows in per length now (oxygen over a length), in time; negative flows out, and may take more than
        there is (the run warns where oxygen falls below 0).
    """

    name: str = ""
    side: str | None = parameter(None, symbol="-", kind="word", doc="the side")
    where: str | None = parameter(None, symbol="-", kind="word", doc="the formula that selects edges")
    displacement_x: Any = parameter(None, symbol="d_x", kind="series", doc="the prescribed displacement in x")  # noqa: RUF009
    displacement_y: Any = parameter(None, symbol="d_y", kind="series", doc="the prescribed displacement in y")  # noqa: RUF009
    traction_x: Any = parameter(0.0, symbol="t_x", kind="series", doc="the traction in x")  # noqa: RUF009
    traction_y: Any = parameter(0.0, symbol="t_y", kind="series", doc="the traction in y")  # noqa: RUF009
    load: Any = parameter(0.0, symbol="q", kind="series", doc="the pressure on the surface")  # noqa: RUF009
    spring: float = parameter(0.0, symbol="k_s", low=0.0, doc="the spring")
    spring_normal: float = parameter(0.0, symbol="k_n", low=0.0, doc="the spring along the normal")
    p: Any = parameter(OUTSIDE, symbol="p", kind="series", choices=_WORDS, doc="the fluid pressure p")  # noqa: RUF009
    C: Any = parameter(OUTSIDE, symbol="C", kind="series", choices=_WORDS, low=0.0, doc="the oxygen C")  # noqa: RUF009
    membrane: float | None = parameter(None, symbol="h", kind="number", low=0.0, low_open=True, doc="the membrane's permeability")
    influx: Any = parameter(0.0, symbol="j", kind="series", doc="the influx of oxygen")  # noqa: RUF009

    table: ClassVar[str] = TABLE

    def __post_init__(self) -> None:
        for key in ("p", "C"):
            _check_word(getattr(self, key), f"{self.path}.{key}")
        validate(self, self.path)
        if self.side is None and self.where is None:
            raise ParameterError(self.path, 'it does not say where it is; write side = "surface", for instance, or where = "y < 0".')
        if self.where is not None:
            self.formula  # noqa: B018 - a formula that cannot be read is refused here
        self._check_held()
        if self.membrane is not None and self.C == CLOSED:
            raise ParameterError(
                f"{self.path}.membrane", 'it lets oxygen through, but C is "closed"; give C beyond the membrane, or leave one of them out.'
            )
        if acts(self.influx) and self.C != CLOSED:
            raise ParameterError(
                f"{self.path}.influx", 'it has no effect where the oxygen is given; write C = "closed" as well, or leave the influx out.'
            )

    def _check_held(self) -> None:
        """Refuse forces in directions in which the part is held."""
        held = [axis for axis in "xy" if getattr(self, f"displacement_{axis}") is not None]
        idle = [f"traction_{axis}" for axis in held if acts(getattr(self, f"traction_{axis}"))]
        if len(held) == 2:
            idle += ["load"] if acts(self.load) else []
            idle += [key for key in ("spring", "spring_normal") if getattr(self, key) > 0.0]
        if idle:
            given = "both displacements are" if len(held) == 2 else f"displacement_{held[0]} is"
            raise ParameterError(f"{self.path}.{idle[0]}", f"it has no effect where {given} given; leave it out, or let the part move.")

    def acts_at(self, t: float, p_out: float) -> bool:
        """Whether the part moves, pulls or presses the body, or draws fluid, at time `t`."""
        forces = (self.displacement_x, self.displacement_y, self.traction_x, self.traction_y, self.load)
        drawn = isinstance(self.p, TimeSeries) and self.p(t) != p_out
        return drawn or any(series is not None and series(t) != 0.0 for series in forces)

    @property
    def path(self) -> str:
        """Where the part stands in a scene, for messages."""
        return f"{TABLE}.{self.name or 'NAME'}"

    @property
    def formula(self) -> PositionFunction:
        """The formula that selects edges."""
        return PositionFunction(self.where, variables=COORDINATES, path=f"{self.path}.where")

    def describe(self) -> str:
        """What acts on the part, in words."""
        return "; ".join((self._mechanics(), self._fluid(), self._oxygen()))

    def _mechanics(self) -> str:
        held = {axis: getattr(self, f"displacement_{axis}") for axis in "xy"}
        given = [axis for axis in "xy" if held[axis] is not None]
        words = [f"d_{axis} = {_shown(held[axis])}" for axis in given]
        if len(given) == 2 and not any(acts(series) for series in held.values()):
            words = ["clamped"]
        forces = (
            [f"traction ({_shown(self.traction_x)}, {_shown(self.traction_y)})"] if acts(self.traction_x) or acts(self.traction_y) else []
        )
        forces += [f"load {_shown(self.load)}"] if acts(self.load) else []
        forces += [f"spring {self.spring:g}"] if self.spring > 0.0 else []
        forces += [f"spring along the normal {self.spring_normal:g}"] if self.spring_normal > 0.0 else []
        return ", ".join(words + forces) or "free"

    def _fluid(self) -> str:
        return "no flow" if self.p == CLOSED else "p = p_out" if self.p == OUTSIDE else f"p = {_shown(self.p)}"

    def _oxygen(self) -> str:
        if self.C == CLOSED:
            return f"oxygen influx {_shown(self.influx)}" if acts(self.influx) else "oxygen closed"
        level = "C_out" if self.C == OUTSIDE else _shown(self.C)
        return f"C = {level}" if self.membrane is None else f"membrane {self.membrane:g} to C = {level}"

    @property
    def series(self) -> tuple[TimeSeries, ...]:
        """All that is given in time."""
        values = (getattr(self, key) for key in specifications(self))
        return tuple(value for value in values if isinstance(value, TimeSeries))


@dataclass(frozen=True, slots=True)
class TumourBoundary:
    """The named parts of a body's free surface, in the order in which they were named: the table ``[boundary]`` of a scene.

    What no part claims is free of traction, with p = p_out and C = C_out. At a point that two parts share, what is prescribed by the first
    one holds.

    Attributes
    ----------
    parts : tuple of BoundaryPart
    """

    parts: tuple[BoundaryPart, ...] = ()

    table: ClassVar[str] = TABLE

    def __post_init__(self) -> None:
        for part in self.parts:
            _check_name(part.name)
        names = self.names
        for name in names:
            if names.count(name) > 1:
                raise ParameterError(f"{TABLE}.{name}", "there are two parts of this name; give each its own.")

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: str = TABLE, folder: Path | None = None) -> TumourBoundary:
        """The parts of a scene's table, or of a mapping of names to tables or to `BoundaryPart`s.

        Parameters
        ----------
        table : mapping
        path : str
            Name of the table, for messages.
        folder : Path, optional
            Where files that the table names are looked for; it names none so far.
        """
        if not isinstance(table, Mapping):
            raise ParameterError(path, f"expected parts by name, such as [{path}.bone] with keys below, but got {describe(table)}.")
        return cls(tuple(_part(str(name), part, path) for name, part in table.items()))

    def to_table(self) -> dict[str, dict[str, Any]]:
        """The parts as they stand in a scene file, with every default written out."""
        return {part.name: to_table(part) for part in self.parts}

    def with_changes(self, changes: Mapping[str, Any]) -> TumourBoundary:
        """A copy with some parts changed.

        Parameters
        ----------
        changes : mapping
            By name of the part: a mapping changes the keys that it holds, of a part that is there or of a new one; a `BoundaryPart` takes
            the place of the whole part; None takes the part away.
        """
        table: dict[str, Any] = {part.name: part for part in self.parts}
        for name, change in changes.items():
            if change is None:
                table.pop(name, None)
            elif isinstance(change, Mapping) and name in table:
                table[name] = {**to_table(table[name]), **change}
            else:
                table[name] = change
        return self.from_table(table)

    @property
    def is_plain(self) -> bool:
        """Whether no part of the surface differs from the rest."""
        return not self.parts

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts, in order."""
        return tuple(part.name for part in self.parts)

    def __getitem__(self, name: str) -> BoundaryPart:
        for part in self.parts:
            if part.name == name:
                return part
        raise KeyError(name)

    def __iter__(self) -> Iterator[BoundaryPart]:
        return iter(self.parts)

    def __len__(self) -> int:
        return len(self.parts)


def acts(series: TimeSeries) -> bool:
    """Whether a series is anything but 0 at some time."""
    return any(value != 0.0 for value in series.values)


def _shown(series: TimeSeries) -> str:
    """A series in a line of words."""
    low, high = min(series.values), max(series.values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g} in time"


def _part(name: str, table: Any, path: str) -> BoundaryPart:
    """The part of this name."""
    if isinstance(table, BoundaryPart):
        return replace(table, name=name)
    known = specifications(BoundaryPart)
    if not isinstance(table, Mapping):
        named = (
            f"{name} is a key of a part, such as [{path}.bone]" if name in known else f"expected a table, [{path}.{name}] with keys below"
        )
        raise ParameterError(f"{path}.{name}", f"{named}, but got {describe(table)} in [{path}].")
    _check_name(name)
    for key in table:
        if key not in known:
            hint = nearest(str(key), known)
            raise ParameterError(f"{path}.{name}.{key}", f'there is no key "{key}" in a part{hint} Its keys are {", ".join(known)}.')
    return BoundaryPart(name=name, **table)


def _check_name(name: str) -> None:
    if not name or not _LETTERS.issuperset(name):
        raise ParameterError(TABLE, f'"{name}" cannot name a part; a name is made of letters, digits, _ and -, such as "bone".')


def _check_word(value: Any, path: str) -> None:
    """Refuse a word that is none of those allowed."""
    if isinstance(value, str) and value not in _WORDS:
        allowed = '"outside", "closed", a number or a table { times = [...], values = [...] }'
        raise ParameterError(path, f"must be {allowed}, but got {describe(value)}{nearest(value, _WORDS)}")
