"""Scene files: a TOML text becomes a checked `Scene`, and a scene becomes a TOML text with nothing left unsaid."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar

import tomli_w

from multiphase.errors import ParameterError
from multiphase.model import Model, find_model, model_names
from multiphase.parameters import (
    describe,
    float_or_refuse,
    from_table,
    nearest,
    numbers,
    parameter,
    replace,
    specifications,
    to_table,
    validate,
)
from multiphase.scales import Scales

TABLES = ("scene", "geometry", "parameters", "initial", "boundary", "time", "solver", "plan", "output", "scales")
_SCENE_KEYS = ("model", "title", "based_on")
_TIME_KEYS = ("end", "save_every", "save_at")
INTERVALS = 50
"""Stored intervals where a scene says nothing about saving."""
MOST_TIMES = 100_000
_ROW = re.compile(r"\[\n(?: {8,}[-+.0-9e]+,\n)+ {4,}\]")
"""A row of numbers in a list of rows, as the TOML writer puts it: a number a line. Texts hold no line breaks there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeTable:
    """When a run ends and which times are stored: see `TimeTable.make`.

    Attributes
    ----------
    end : float
    save_at : tuple of float
        The stored times, exact and increasing, from 0 to `end`.
    save_every : float or None
        The interval they come from; None where they were listed.
    """

    end: float
    save_at: tuple[float, ...]
    save_every: float | None = None

    @classmethod
    def make(cls, end: Any, *, save_every: Any = None, save_at: Any = None, drop_beyond_end: bool = False) -> TimeTable:
        """Check and complete the times of a run.

        Parameters
        ----------
        end : float
            Greater than 0, finite.
        save_every : float, optional
            Store every so often; end/50 if neither this nor `save_at` is given.
        save_at : sequence of float, optional
            Store at these times, in any order. t = 0 and `end` are always stored.
        drop_beyond_end : bool, default False
            Leave out times of `save_at` after `end` instead of refusing them.
        """
        end = _positive(end, "time.end", "the end of the run")
        if save_every is not None and save_at is not None:
            raise ParameterError("time.save_at", "save_at and save_every are both given; keep one of them.")
        if save_at is None:
            every = end / INTERVALS if save_every is None else _positive(save_every, "time.save_every", "the saving interval")
            if end / every > MOST_TIMES:
                raise ParameterError(
                    "time.save_every",
                    f"{every:g} would store {end / every:.3g} times until the end at {end:g}; at most {MOST_TIMES} are allowed, "
                    f"so take {end / MOST_TIMES:g} or more.",
                )
            count = math.ceil(end / every * (1.0 - 1e-9))  # the last interval is not cut into a sliver by rounding
            return cls(end=end, save_at=(*(i * every for i in range(count)), end), save_every=every)
        times = set(numbers(save_at, "time.save_at"))
        for time in sorted(times):
            if time < 0.0:
                raise ParameterError("time.save_at", f"{time:.15g} is not allowed; stored times must lie from 0 to the end, {end:.15g}.")
            if time > end and not drop_beyond_end:
                raise ParameterError(
                    "time.save_at", f"{time:.15g} lies beyond the end of the run, {end:.15g}; leave it out, or raise time.end."
                )
        return cls(end=end, save_at=tuple(sorted({time for time in times if time < end} | {0.0, end})))

    @property
    def default_spacing(self) -> bool:
        """Whether the stored times are spaced as they are where a scene says nothing."""
        return self.save_every == self.end / INTERVALS

    def to_table(self) -> dict[str, Any]:
        """The times as they stand in a scene file."""
        if self.save_every is not None:
            return {"end": self.end, "save_every": self.save_every}
        return {"end": self.end, "save_at": list(self.save_at)}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanTable:
    """Whether the equations may be reduced to the smallest set that gives the scene's answer."""

    reduce: bool = parameter(True, symbol="-", doc="the choice to reduce the equations")

    table: ClassVar[str] = "plan"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputTable:
    """Where results go, whether a VTKHDF copy is written, and which fields are stored (None: all)."""

    file: str | None = parameter(None, symbol="-", kind="word", doc="the output file")
    vtk: bool = parameter(False, symbol="-", doc="the choice to write a copy for ParaView")
    fields: tuple[str, ...] | None = parameter(None, symbol="-", kind="words", doc="the list of fields to store")

    table: ClassVar[str] = "output"

    def __post_init__(self) -> None:
        validate(self, self.table)
        if self.vtk and self.fields is not None and "displacement" not in self.fields:
            raise ParameterError("output.fields", 'the copy for ParaView (output.vtk) needs "displacement"; add it, or leave the copy out.')


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything that determines a run. An object that exists has been checked, by its model too.

    Attributes
    ----------
    name : str
        Name of the scene, which names the default output.
    model : Model
    title : str
    geometry, parameters, initial, solver : dataclass
        Of the types that the model declares.
    boundary : multiphase.model.NamedTables or None
        Of the type that the model declares, without entries unless given; None for a model without such a table.
    time : TimeTable
    plan : PlanTable
    output : OutputTable
    scales : Scales or None
        Physical units for display; results stay dimensionless.
    preset : str or None
        The preset that the parameters started from, for the record.
    source : str
        The user's own text; empty for a scene made in Python.

    `name`, `preset` and `source` say where a scene comes from and do not count when two are compared.
    """

    name: str = field(compare=False)
    model: Model
    title: str = ""
    geometry: Any
    parameters: Any
    initial: Any
    boundary: Any = None
    time: TimeTable
    solver: Any
    plan: PlanTable = field(default_factory=PlanTable)
    output: OutputTable = field(default_factory=OutputTable)
    scales: Scales | None = None
    preset: str | None = field(default=None, compare=False)
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.model.boundary is not None and self.boundary is None:
            object.__setattr__(self, "boundary", self.model.boundary())
        for name in ("geometry", "parameters", "initial", "boundary", "solver"):
            value, wanted = getattr(self, name), getattr(self.model, name)
            if not isinstance(value, wanted or type(None)):
                expected = wanted.__name__ if wanted else "nothing"
                raise ParameterError(name, f"expected {expected} for the model {self.model.name}, but got {describe(value)}.")
        known = [quantity.name for quantity in self.model.quantities.values() if quantity.kind == "field"]
        for name in self.output.fields or ():
            if name not in known:
                text = f'the model {self.model.name} has no field "{name}"{nearest(name, known)} It has {", ".join(known)}.'
                raise ParameterError("output.fields", text)
        for name, table in self.model.complete(self).items():
            object.__setattr__(self, name, table)
        self.model.check(self)

    def to_table(self) -> dict[str, Any]:
        """The resolved scene as nested tables: every default, preset value and change written out, data of files included."""
        head = {"model": self.model.name, "title": self.title} | ({"based_on": self.preset} if self.preset else {})
        tables = {"scene": head, "geometry": to_table(self.geometry), "parameters": to_table(self.parameters)}
        tables |= {"initial": to_table(self.initial)} | ({"boundary": self.boundary.to_table()} if self._has_parts else {})
        tables |= {"time": self.time.to_table(), "solver": to_table(self.solver)}
        tables |= {"plan": to_table(self.plan), "output": to_table(self.output)}
        return tables | ({"scales": self.scales.to_table()} if self.scales else {})

    @property
    def _has_parts(self) -> bool:
        return self.boundary is not None and not self.boundary.is_plain

    def to_toml(self) -> str:
        """The resolved scene as TOML; `parse_scene` of this text gives an equal scene."""
        return _ROW.sub(_on_one_line, tomli_w.dumps(self.to_table()))

    def with_changes(self, **changes: Any) -> Scene:
        """A checked copy with some entries changed.

        Parameters
        ----------
        **changes
            Named after the attributes. A mapping changes only the keys it holds: ``with_changes(solver={"cells": 200})``,
            ``with_changes(time={"end": 2.0})``, ``with_changes(boundary={"bone": {"spring": 2.0}, "skin": None})``, where None takes an
            entry away; anything else takes the place of the whole entry.
        """
        names = [item.name for item in dataclasses.fields(self)]
        for name, value in changes.items():
            if name not in names:
                raise ParameterError(name, f'a scene has no entry "{name}"{nearest(name, names)} It has {", ".join(names)}.')
            if not isinstance(value, Mapping):
                continue
            if name == "time":
                changes[name] = self._changed_times(value)
            elif name == "scales":
                changes[name] = Scales.from_table((self.scales.to_table() if self.scales else {}) | dict(value))
            elif name == "boundary":
                if self.boundary is None:
                    raise ParameterError(name, f"the model {self.model.name} has no parts of a boundary; leave it out.")
                changes[name] = self.boundary.with_changes(value)
            else:
                changes[name] = replace(getattr(self, name), **value)
        return dataclasses.replace(self, **changes)

    def _changed_times(self, changes: Mapping[str, Any]) -> TimeTable:
        """save_at replaces save_every and the reverse; a default spacing stays the default."""
        _check_keys("time", changes, _TIME_KEYS, {})
        spaced = {} if self.time.default_spacing or len(set(changes) - {"end"}) else self.time.to_table()
        return _time_table({"end": self.time.end} | spaced | dict(changes), changes)


@dataclass(frozen=True, slots=True)
class ShippedScene:
    """A scene file that comes with an installed model."""

    name: str
    model: str
    title: str
    text: str


def shipped_scenes() -> dict[str, ShippedScene]:
    """The scenes of all installed models, by name, in alphabetical order."""
    found = {}
    for model_name in model_names():
        for item in files(find_model(model_name).scenes).iterdir():
            if item.name.endswith(".toml"):
                name, text = item.name.removesuffix(".toml"), item.read_text(encoding="utf-8")
                title = str(tomllib.loads(text).get("scene", {}).get("title", ""))
                found[name] = ShippedScene(name, model_name, title, text)
    return dict(sorted(found.items()))


def load_scene(name_or_path: str | Path, sets: Sequence[str] = ()) -> Scene:
    """A scene from the name of a shipped one or from a file, with ``--set`` changes.

    Raises
    ------
    ParameterError
        For a missing or unreadable file, a text that is not TOML, and everything that `parse_scene` refuses.
    """
    given, path = str(name_or_path), Path(name_or_path)
    shipped = shipped_scenes() if path.name == given and not given.endswith(".toml") else {}
    if given in shipped:
        return parse_scene(shipped[given].text, name=given, sets=sets)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        known = shipped or shipped_scenes()
        hint = nearest(path.stem, known)
        raise ParameterError(
            given, f"there is no such file, and no scene of this name ships{hint} The shipped scenes are {', '.join(known)}."
        ) from None
    except OSError as error:
        raise ParameterError(given, f"the file cannot be read: {error.strerror or error}.") from None
    except ValueError:
        hint = " It looks like a result; `multiphase info` reads those." if path.suffix == ".h5" else ""
        raise ParameterError(given, f"this file is not a scene: a scene is a text file in TOML.{hint}") from None
    return parse_scene(text, name=path.stem, sets=sets, file=path)


def parse_scene(text: str, *, name: str, sets: Sequence[str] = (), file: Path | None = None) -> Scene:
    """A scene from TOML text.

    Parameters
    ----------
    text : str
    name : str
        Name of the scene.
    sets : sequence of str
        Changes ``table.key=VALUE``, applied in order before presets and defaults fill in the rest. VALUE is read as TOML, and
        as a plain text where that fails.
    file : Path, optional
        Where the text comes from: relative ``{file = "x.csv"}`` names are looked for in its folder, or else in the current one.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ParameterError(str(file or name), f"the scene is not valid TOML: {error}.") from None
    changed: dict[str, Any] = {}
    for item in sets:
        _apply_set(tables, changed, item)
    _check_tables(tables)
    head = tables.get("scene", {})
    if "model" not in head:
        raise ParameterError("scene.model", f'the model is missing; write model = "..." below [scene], one of {", ".join(model_names())}.')
    for key in _SCENE_KEYS:
        if key in head and not isinstance(head[key], str):
            raise ParameterError(f"scene.{key}", f"expected a text in quotes, but got {describe(head[key])}.")
    model = find_model(head["model"])
    elsewhere = _owners(model)
    _check_keys("scene", head, _SCENE_KEYS, elsewhere)
    preset = _fill_from_preset(tables, model)
    folder = file.parent if file else Path()
    parts: dict[str, Any] = {
        key: from_table(kind, tables.get(key, {}), key, folder=folder, elsewhere=elsewhere) for key, kind in _parts(model).items()
    }
    if model.boundary is not None:
        parts["boundary"] = model.boundary.from_table(tables.get("boundary", {}), "boundary", folder)
    _check_keys("time", tables.get("time", {}), _TIME_KEYS, elsewhere)
    parts["time"] = _time_table(tables.get("time", {}), changed.get("time", {}))
    parts["scales"] = Scales.from_table(tables["scales"]) if tables.get("scales") else None
    return Scene(name=name, model=model, title=head.get("title", name), preset=preset or head.get("based_on"), source=text, **parts)


def differences(a: Scene, b: Scene) -> list[str]:
    """What a resumed run would find changed: dotted paths with both values, `a` being the file and `b` the scene.

    Titles, the name of the output file and the limit of steps do not count. A changed end is listed as ``time.end: ...``; the
    stored times are compared up to the earlier end, and not at all where both scenes leave their spacing to the default.
    """
    one, other = _flat(a.to_table()), _flat(b.to_table())
    ignored = ("scene.title", "scene.based_on", "output.file", "time.save_at", "time.save_every", "solver.max_steps")
    names = [list(table.get("boundary", {})) for table in (a.to_table(), b.to_table())]
    found, alone = [], tuple(f"boundary.{name}." for name in set(names[0]) ^ set(names[1]))
    for path in dict.fromkeys((*one, *other)):
        if path not in ignored and not path.startswith(alone or ("\n",)) and one.get(path) != other.get(path):
            shown, given = _shown(one.get(path)), _shown(other.get(path))
            values = f"{shown} in the file, {given} in the scene" if shown != given else "other numbers in the file than in the scene"
            found.append(f"{path}: {values}")
    for where, own, others in (("file", *names), ("scene", *reversed(names))):
        found += [f'boundary.{name}: the part "{name}" is only in the {where}' for name in own if name not in others]
    if names[0] != names[1] and set(names[0]) == set(names[1]):
        found.append(f"boundary: the parts come in the order {', '.join(names[0])} in the file, {', '.join(names[1])} in the scene")
    common = min(a.time.end, b.time.end)
    by_default = a.time.default_spacing and b.time.default_spacing
    before = [[time for time in scene.time.save_at if time < common] for scene in (a, b)]
    if not by_default and before[0] != before[1]:
        key = "save_at" if b.time.save_every is None else "save_every"
        found.append(f"time.{key}: the times stored until t = {common:g} are others in the file than in the scene")
    return found


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted paths and their values."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return flat


def _on_one_line(row: re.Match[str]) -> str:
    return " ".join(row[0].split()).replace("[ ", "[").replace(", ]", "]")


def _shown(value: Any) -> str:
    if value is None:
        return "not set"
    is_long = isinstance(value, list) and (len(value) > 6 or any(isinstance(item, list) for item in value))
    return describe(value) if is_long else f"{value!r}".replace("'", '"')


def _positive(value: Any, path: str, meaning: str) -> float:
    number = float_or_refuse(value, path)
    if number < 1e-300:
        raise ParameterError(path, f"{number:.15g} is not allowed; {meaning} must be greater than 0.")
    return number


def _apply_set(tables: dict[str, Any], changed: dict[str, Any], item: str) -> None:
    """Enter one ``table.key=VALUE`` into `tables`, and into `changed`, which holds the changes alone."""
    key, equals, text = item.partition("=")
    path = [part.strip() for part in key.split(".")]
    if not equals or not all(path) or len(path) == 1:
        raise ParameterError("--set", f'"{item}" is not of the form table.key=VALUE; an example is --set time.end=10.')
    try:
        read = tomllib.loads(f"value = {text}")
        value = read["value"] if len(read) == 1 else text
    except (ValueError, RecursionError):
        value = text.strip()
    if path[0] == "time":
        rival = {"save_at": "save_every", "save_every": "save_at"}.get(path[1])
        if rival in changed.get("time", {}):
            raise ParameterError("--set", "time.save_at and time.save_every are both set; set one of them.")
        if isinstance(tables.get("time"), dict):
            tables["time"].pop(rival, None)
    for target in (tables, changed):
        for i, part in enumerate(path[:-1], start=1):
            target = target.setdefault(part, {})
            if not isinstance(target, dict):
                raise ParameterError("--set", f'"{item}" cannot be applied: {".".join(path[:i])} is {describe(target)}, not a table.')
        target[path[-1]] = value


def _check_tables(tables: Mapping[str, Any]) -> None:
    """Refuse unknown tables, and values outside any table."""
    known = [name for name in TABLES if name != "boundary" or _has_boundary(tables)]
    for name, value in tables.items():
        if name not in known:
            hint = nearest(name, known)
            what = "there is no such table" if isinstance(value, dict) else "this key stands outside the tables of the scene"
            raise ParameterError(name, f"{what}{hint} The tables are {', '.join(known)}.")
        if not isinstance(value, dict):
            raise ParameterError(name, f"expected a table, [{name}] on a line of its own with its keys below, but got {describe(value)}.")


def _has_boundary(tables: Mapping[str, Any]) -> bool:
    """Whether the model of a scene that is yet to be checked has a table [boundary]."""
    head = tables.get("scene")
    name = head.get("model") if isinstance(head, dict) else None
    return isinstance(name, str) and name in model_names() and find_model(name).boundary is not None


def _parts(model: Model) -> dict[str, type]:
    """The tables that are parameter dataclasses, and their types."""
    own = {key: getattr(model, key) for key in ("geometry", "parameters", "initial", "solver")}
    return own | {"plan": PlanTable, "output": OutputTable}


def _owners(model: Model) -> dict[str, str]:
    """Which table each key belongs to, for keys that only one table has."""
    tables: dict[str, Sequence[str]] = {"scene": _SCENE_KEYS, "time": _TIME_KEYS}
    tables |= {table: list(specifications(kind)) for table, kind in _parts(model).items()}
    keys = [key for known in tables.values() for key in known]
    return {key: table for table, known in tables.items() for key in known if keys.count(key) == 1} | {"preset": "parameters"}


def _check_keys(table: str, values: Mapping[str, Any], known: Sequence[str], elsewhere: Mapping[str, str]) -> None:
    for key in values:
        if key in known:
            continue
        if key in elsewhere:
            raise ParameterError(f"{table}.{key}", f"{key} does not belong in [{table}]; move it to [{elsewhere[key]}].")
        hint = nearest(key, known)
        raise ParameterError(f"{table}.{key}", f'there is no key "{key}" in [{table}]{hint} Its keys are {", ".join(known)}.')


def _fill_from_preset(tables: dict[str, Any], model: Model) -> str | None:
    """Put the values of ``[parameters] preset`` under those that the scene gives itself; return the preset's name."""
    given = dict(tables.get("parameters", {}))
    name = given.pop("preset", None)
    if name is None:
        return None
    if not isinstance(name, str) or name not in model.presets:
        hint = nearest(name, model.presets) if isinstance(name, str) else "."
        raise ParameterError(
            "parameters.preset",
            f"{describe(name)} is not a preset of the model {model.name}{hint} The presets are {', '.join(model.presets)}.",
        )
    preset = model.presets[name]
    tables["parameters"] = {**preset.parameters, **given}
    tables["initial"] = {**preset.initial, **tables.get("initial", {})}
    tables["solver"] = {**preset.solver, **tables.get("solver", {})}
    if preset.scales:
        scales: dict[str, Any] = {key: dict(value) for key, value in preset.scales.items()}
        for key, value in tables.get("scales", {}).items():
            scales[key] = {**scales.get(key, {}), **value} if isinstance(value, dict) else value
        tables["scales"] = scales
    return name


def _time_table(table: Mapping[str, Any], changed: Mapping[str, Any]) -> TimeTable:
    """The times of a scene; those of a file are dropped beyond an end that was changed, those that were set are not."""
    if "end" not in table:
        raise ParameterError("time.end", "the end of the run is missing; write end = 40.0, for instance, below [time].")
    drop = "end" in changed and "save_at" not in changed
    return TimeTable.make(table["end"], save_every=table.get("save_every"), save_at=table.get("save_at"), drop_beyond_end=drop)
