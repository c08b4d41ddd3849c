"""What a model tells the shared core about itself, and how it is found.

A model is a plug-in: a package declares an entry point in the group ``multiphase.models`` whose value
is a :class:`Model`. The core imports no model; it asks for one by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from multiphase.errors import ParameterError
from multiphase.marks import Marks

if TYPE_CHECKING:
    from multiphase.plan import Plan
    from multiphase.profiles import Profiles
    from multiphase.result import Result
    from multiphase.scene import Scene

GROUP = "multiphase.models"


@dataclass(frozen=True, slots=True)
class Quantity:
    """One named output: its symbol for plots, its meaning, and how its unit follows from the scales.

    `dimension` gives the exponents of the scene's scales, for instance ``{"length": 1, "time": -1}`` for
    a velocity; empty for a fraction. `kind` is "field" (on the cells) or "scalar". `no_say` is for what has no say in whether two
    results agree, such as an error that a solution measures of itself: why, as a clause after "as".
    """

    name: str
    symbol: str
    description: str
    dimension: Mapping[str, int] = field(default_factory=dict)
    kind: str = "field"
    no_say: str = ""


@dataclass(frozen=True, slots=True)
class Preset:
    """A named, sourced set of values for one model: tables as they would stand in a scene file.

    `solver` is for presets that reproduce a published computation, steps and all; most leave it empty.
    """

    title: str
    parameters: Mapping[str, Any]
    initial: Mapping[str, Any]
    scales: Mapping[str, Any] | None
    source: str
    solver: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel of the standard figure.

    Attributes
    ----------
    kind : str
        "scalar" (against time), on any grid. On a 1D grid "profile" (against position at several times), "spacetime" (colour over time
        and position) and "ring" (cross-sections of a round body at a few times; left out where the body is flat). On triangles "map"
        (colour on the body at the last time; of a vector its size, with arrows), "maps" (the same without arrows at a few times) and
        "rest" (the properties that `Model.marks` gives, on the body at rest; left out where there are none).
    names : tuple of str
        What it shows; of a scalar panel those that the result holds; nothing of a panel "rest".
    title : str
    round_only : bool
        Leaves another panel than a ring out where the body is flat as well.
    grid : str
        "line" or "triangles" leaves a panel out on the other grid; empty leaves that to the kind.
    log : bool
        Colours of a map by the logarithm of the value.
    """

    kind: str
    names: tuple[str, ...]
    title: str
    round_only: bool = False
    grid: str = ""
    log: bool = False


class NamedTables(Protocol):
    """A scene table whose entries are tables that the user names, such as ``[boundary.bone]``: frozen, and empty by default."""

    table: ClassVar[str]

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: str = ..., folder: Path | None = ...) -> Self:
        """Made and checked from what a scene file holds, or from Python values by name."""

    def to_table(self) -> dict[str, dict[str, Any]]:
        """As a scene file holds them, with every default written out."""

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A copy with some entries changed: a mapping changes the keys that it holds, None takes an entry away."""

    @property
    def is_plain(self) -> bool:
        """Whether there are no entries."""


@dataclass(frozen=True, slots=True)
class Model:
    """A mathematical model as the core sees it.

    Attributes
    ----------
    name, title : str
    parameters, initial, geometry, solver : type
        Frozen dataclasses made of `multiphase.parameters.parameter` fields: one scene table each.
    presets : mapping of str to Preset
    quantities : mapping of str to Quantity
        Every field and scalar the model can report.
    panels : tuple of Panel
        The standard figure.
    film : str
        The field the film colours.
    scenes : str
        Package that holds the shipped scene files (``*.toml``).
    complete : callable(scene) -> mapping
        Tables of the scene, by name, with defaults filled in that depend on other tables.
    check : callable(scene)
        Cross-field checks; raises ParameterError before any work starts.
    plan : callable(scene) -> Plan
    scheme : callable(scene, plan, **options) -> multiphase.stepping.Scheme
    summary : callable(result) -> list of (label, text)
        What a scientist wants to know at the end of a run.
    ends : (str, str)
        What lies at the inner and outer end of a 1D domain, for the film; empty to say nothing.
    trackers : callable(scene) -> tuple of multiphase.stepping.Tracker
        What every run of the scene has hung on its loop, for instance a watch on well-posedness.
    ring : callable(geometry) -> float or None
        Where a 1D domain is the radius of a round body: the radius at its inner end, dimensionless, from the scene's table
        [geometry]; 0 for a disk, None for a flat body.
    position : str
        What an axis of positions is called.
    fronts : tuple of str
        Scalars that are positions within a 1D domain, for instance the edge of a core: lines in its space-time pictures, in the
        styles that they have after the width in a scalar panel.
    boundary : type of NamedTables or None
        What the table [boundary] of a scene holds, where the model has parts of a boundary.
    marks : callable(result) -> Marks
        What the pictures of a result on triangles show besides its fields. The result may be in physical units or not.
    profiles : callable(result) -> Profiles or None
        What can be compared with results of another dimension, shape or material. The result may be in physical units or not.
    """

    name: str
    title: str
    parameters: type
    initial: type
    geometry: type
    solver: type
    presets: Mapping[str, Preset]
    quantities: Mapping[str, Quantity]
    panels: tuple[Panel, ...]
    film: str
    scenes: str
    check: Callable[[Scene], None]
    plan: Callable[[Scene], Plan]
    scheme: Callable[..., Any]
    summary: Callable[[Result], list[tuple[str, str]]]
    ends: tuple[str, str] = ("", "")
    trackers: Callable[[Scene], tuple[Any, ...]] = lambda scene: ()
    ring: Callable[[Mapping[str, Any]], float | None] = lambda geometry: None
    position: str = "position x"
    complete: Callable[[Scene], Mapping[str, Any]] = lambda scene: {}
    fronts: tuple[str, ...] = ()
    boundary: type[NamedTables] | None = None
    marks: Callable[[Result], Marks] = lambda result: Marks()
    profiles: Callable[[Result], Profiles | None] = lambda result: None


@cache
def model_names() -> tuple[str, ...]:
    """Names of the installed models, sorted."""
    return tuple(sorted({point.name for point in entry_points(group=GROUP)}))


@cache
def find_model(name: str) -> Model:
    """The installed model called `name`; raises ParameterError that names the nearest one."""
    for point in entry_points(group=GROUP):
        if point.name == name:
            loaded = point.load()
            assert isinstance(loaded, Model)
            return loaded
    from multiphase.parameters import nearest

    hint = nearest(name, model_names())
    raise ParameterError("scene.model", f'there is no model "{name}"{hint} Installed: {", ".join(model_names()) or "none"}.')
