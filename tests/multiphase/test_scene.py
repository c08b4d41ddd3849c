"""Scene files: parsing, --set, presets, times, round trip, differences, messages. The model is a stand-in made here."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from multiphase import scene as scene_module
from multiphase.errors import ParameterError
from multiphase.model import Model, Preset, Quantity
from multiphase.parameters import from_table, parameter, to_table, validate
from multiphase.run import make_scene
from multiphase.scales import Scale, Scales
from multiphase.scene import OutputTable, PlanTable, Scene, TimeTable, differences, load_scene, parse_scene, shipped_scenes


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    rate: float = parameter(1.0, symbol="k", low=0.0)
    inflow: Any = parameter(1.0, symbol="q", kind="series")  # noqa: RUF009
    form: str = parameter("plain", symbol="-", choices=("plain", "fancy"))
    table: ClassVar[str] = "parameters"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    n: Any = parameter(0.5, symbol="n", kind="function")  # noqa: RUF009
    width: float = parameter(1.0, symbol="L", low=0.0, low_open=True)
    table: ClassVar[str] = "initial"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    kind: str = parameter("slab", symbol="-", choices=("slab", "disk"))
    dimension: str = parameter("auto", symbol="-")
    table: ClassVar[str] = "geometry"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True, slots=True, kw_only=True)
class Solver:
    cells: int = parameter(100, symbol="N", low=4)
    dt: float | None = parameter(None, symbol="dt", kind="number", low=0.0, low_open=True)
    table: ClassVar[str] = "solver"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    stiffness: float = parameter(0.0, symbol="k", low=0.0)
    pull: Any = parameter(0.0, symbol="t", kind="series")  # noqa: RUF009
    side: str | None = parameter(None, symbol="-", kind="word")
    table: ClassVar[str] = "boundary"

    def __post_init__(self) -> None:
        validate(self, self.table)


@dataclass(frozen=True)
class Walls:
    """A table of named tables, in order."""

    walls: tuple[tuple[str, Wall], ...] = ()
    table: ClassVar[str] = "boundary"

    @classmethod
    def from_table(cls, table: Any, path: str = "boundary", folder: Path | None = None) -> Walls:
        made = {name: wall if isinstance(wall, Wall) else from_table(Wall, wall, f"{path}.{name}") for name, wall in table.items()}
        return cls(tuple(made.items()))

    def to_table(self) -> dict[str, dict[str, Any]]:
        return {name: to_table(wall) for name, wall in self.walls}

    def with_changes(self, changes: Any) -> Walls:
        table: dict[str, Any] = self.to_table()
        for name, change in changes.items():
            table[name] = {**table.get(name, {}), **change} if change is not None else None
        return self.from_table({name: wall for name, wall in table.items() if wall is not None})

    @property
    def is_plain(self) -> bool:
        return not self.walls


def check(scene: Scene) -> None:
    if scene.parameters.rate == 13.0:
        raise ParameterError("parameters.rate", "13 is unlucky.")


def unused(*args: Any, **options: Any) -> Any:
    raise AssertionError("a scene must not start any work")


MODEL = Model(
    name="toy", title="Toy", parameters=Growth, initial=Start, geometry=Shape, solver=Solver,
    presets={
        "slow": Preset("slow", {}, {}, None, "assumed"),
        "mouse": Preset(
            "mouse", {"rate": 5.0, "form": "fancy"}, {"n": 0.25, "width": 3.0},
            {"length": {"value": 100.0, "unit": "µm"}, "time": {"value": 0.1, "unit": "week"}}, "assumed",
        ),
    },
    quantities={"n": Quantity("n", "n", "fraction"), "L": Quantity("L", "L", "width", {"length": 1})},
    panels=(), film="n", scenes="toy_scenes", check=check, plan=unused, scheme=unused, summary=unused,
)  # fmt: skip

BASE = '[scene]\nmodel = "toy"\n[time]\nend = 40.0\n'


def find_toy(name: str) -> Model:
    if name != "toy":
        raise ParameterError("scene.model", f"there is no model {name!r}.")
    return MODEL


@pytest.fixture(autouse=True)
def toy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The toy model is installed, with two shipped scenes; the current folder is empty."""
    package = tmp_path / "toy_scenes"
    package.mkdir()
    (package / "toy.toml").write_text(BASE.replace('"toy"', '"toy"\ntitle = "A toy"'), encoding="utf-8")
    (package / "toy-mouse.toml").write_text(BASE + '[parameters]\npreset = "mouse"\n', encoding="utf-8")
    (package / "notes.txt").write_text("not a scene", encoding="utf-8")
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.setattr(scene_module, "find_model", find_toy)
    monkeypatch.setattr(scene_module, "model_names", lambda: ("toy",))
    monkeypatch.setattr(scene_module, "files", lambda name: tmp_path / name)
    monkeypatch.chdir(folder)
    return folder


def parse(extra: str = "", *sets: str, base: str = BASE) -> Scene:
    return parse_scene(base + extra, name="my", sets=sets)


def refusal(extra: str = "", *sets: str, base: str = BASE) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        parse(extra, *sets, base=base)
    assert "\n" not in str(caught.value)
    return caught.value


def test_defaults() -> None:
    scene = parse()
    assert (scene.name, scene.title, scene.model.name, scene.preset, scene.scales) == ("my", "my", "toy", None, None)
    assert (scene.parameters, scene.initial, scene.geometry, scene.solver) == (Growth(), Start(), Shape(), Solver())
    assert (scene.plan, scene.output) == (PlanTable(reduce=True), OutputTable(file=None, vtk=False, fields=None))
    assert scene.source == BASE
    assert len(scene.time.save_at) == 51
    assert (scene.time.save_at[0], scene.time.save_at[-1]) == (0.0, 40.0)


def test_preset_supplies_parameters_initial_and_scales() -> None:
    scene = parse('[parameters]\npreset = "mouse"\nrate = 6\n[initial]\nwidth = 4\n[scales]\ntime = { value = 1.0, unit = "day" }\n')
    assert scene.preset == "mouse"
    assert (scene.parameters.rate, scene.parameters.form) == (6.0, "fancy")
    assert (scene.initial.n, scene.initial.width) == (0.25, 4.0)
    assert scene.scales == Scales(length=Scale(100.0, "µm"), time=Scale(1.0, "day"))
    assert parse("", "parameters.preset=mouse", "scales.length.value=50").scales == Scales(
        length=Scale(50.0, "µm"), time=Scale(0.1, "week")
    )
    assert parse('[parameters]\npreset = "slow"').scales is None
    assert MODEL.presets["mouse"].scales == {"length": {"value": 100.0, "unit": "µm"}, "time": {"value": 0.1, "unit": "week"}}


def test_preset_may_supply_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    published = Preset("published", {"rate": 2.0}, {}, None, "assumed", solver={"cells": 40, "dt": 0.5})
    monkeypatch.setattr(scene_module, "find_model", lambda name: replace(MODEL, presets={"published": published}))
    scene = parse('[parameters]\npreset = "published"\n')
    assert (scene.solver, scene.parameters.rate) == (Solver(cells=40, dt=0.5), 2.0)
    assert parse('[solver]\ncells = 80\n[parameters]\npreset = "published"\n', "solver.dt=0.25").solver == Solver(cells=80, dt=0.25)
    assert parse().solver == Solver()
    assert parse_scene(scene.to_toml(), name="again").solver == scene.solver
    assert published.solver == {"cells": 40, "dt": 0.5}


def test_resolved_toml_round_trip(toy: Path) -> None:
    (toy / "n.csv").write_text("x,n\n0,0.1\n1,0.3\n", encoding="utf-8")
    text = (
        BASE + 'save_at = [0.1, 0.30000000000000004]\n[parameters]\npreset = "mouse"\n'
        "inflow = { times = [0.0, 1.0, 1.0], values = [1.0, 1.0, 0.1] }\n"
        '[initial]\nn = { file = "n.csv" }\n[solver]\ndt = 1e-17\n[output]\nfields = ["n"]\nfile = "a b.h5"\n[plan]\nreduce = false\n'
    )
    scene = parse_scene(text, name="one", file=toy / "one.toml")
    (toy / "n.csv").unlink()
    again = parse_scene(scene.to_toml(), name="two")
    assert again == scene
    assert again.preset == "mouse"
    assert again.to_toml() == scene.to_toml()
    assert differences(scene, again) == []
    assert again.initial.n.to_table() == {"at": [0.0, 1.0], "values": [0.1, 0.3]}


def test_every_default_is_written_out() -> None:
    text = parse().to_toml()
    for line in (
        'model = "toy"',
        'title = "my"',
        "rate = 1.0",
        "n = 0.5",
        "cells = 100",
        "reduce = true",
        "vtk = false",
        "save_every = 0.8",
    ):
        assert line in text.splitlines()


def test_unequal_scenes_are_unequal() -> None:
    for change in (
        "parameters.rate=2",
        "initial.n=0.4",
        "time.end=41",
        "solver.cells=50",
        "plan.reduce=false",
        "output.file=x",
        "geometry.kind=disk",
    ):
        assert parse("", change) != parse()


@pytest.mark.parametrize(
    ("item", "read"),
    [
        ("parameters.rate=2", lambda s: s.parameters.rate == 2.0),
        ("parameters.rate = 2e-3", lambda s: s.parameters.rate == 2e-3),
        ("parameters.form=fancy", lambda s: s.parameters.form == "fancy"),
        ('parameters.form="fancy"', lambda s: s.parameters.form == "fancy"),
        ("geometry.dimension=2d", lambda s: s.geometry.dimension == "2d"),
        ("initial.n=0.9 - 0.1*xi", lambda s: s.initial.n.to_table() == "0.9 - 0.1*xi"),
        ("initial.n={at=[0,1],values=[0,1]}", lambda s: s.initial.n.to_table()["values"] == [0.0, 1.0]),
        ("output.file=run=1.h5", lambda s: s.output.file == "run=1.h5"),
        ('output.fields=["n"]', lambda s: s.output.fields == ("n",)),
        ("plan.reduce=false", lambda s: s.plan.reduce is False),
        ("time.save_at=[1, 2]", lambda s: s.time.save_at == (0.0, 1.0, 2.0, 40.0)),
        ("scene.title=1\nx = 2", lambda s: s.title == "1\nx = 2"),  # one value, never a second key
    ],
)
def test_set(item: str, read: Any) -> None:
    assert read(parse("", item))


def test_set_goes_on_from_the_last() -> None:
    assert parse("", "parameters.rate=2", "parameters.rate=3").parameters.rate == 3.0


@pytest.mark.parametrize("item", ["rate=2", "parameters.rate", "=2", ".rate=2", "parameters.=2", ""])
def test_set_form(item: str) -> None:
    assert "table.key=VALUE" in str(refusal("", item))


def test_set_below_a_value() -> None:
    assert "parameters.rate is 1, not a table" in str(refusal("[parameters]\nrate = 1", "parameters.rate.x=1"))


@pytest.mark.parametrize(
    ("end", "every", "times"),
    [
        (1.0, 0.25, (0.0, 0.25, 0.5, 0.75, 1.0)),
        (1.0, 0.4, (0.0, 0.4, 0.8, 1.0)),
        (0.3, 0.1, (0.0, 0.1, 0.2, 0.3)),  # 3 * 0.1 > 0.3: the end is exact
        (0.1 + 0.2, 0.1, (0.0, 0.1, 0.2, 0.1 + 0.2)),  # (0.1 + 0.2) / 0.1 > 3: no sliver, and no time twice
        (1.0, 5.0, (0.0, 1.0)),
        (1, 1, (0.0, 1.0)),
    ],
)
def test_save_every(end: float, every: float, times: tuple[float, ...]) -> None:
    assert TimeTable.make(end, save_every=every).save_at == times


def test_save_at() -> None:
    assert TimeTable.make(4, save_at=[3, 1, 1, 0]).save_at == (0.0, 1.0, 3.0, 4.0)
    assert TimeTable.make(4, save_at=np.array([2.0])).save_at == (0.0, 2.0, 4.0)
    assert TimeTable.make(4, save_at=[]).save_at == (0.0, 4.0)
    table = TimeTable.make(0.7)
    assert TimeTable.make(**table.to_table()) == table


def test_set_replaces_the_other_way_of_saving() -> None:
    assert parse("save_every = 10", "time.save_at=[5]").time.save_at == (0.0, 5.0, 40.0)
    assert parse("save_at = [5]", "time.save_every=20").time.save_at == (0.0, 20.0, 40.0)
    assert "both set" in str(refusal("", "time.save_every=20", "time.save_at=[5]"))
    assert "both given" in str(refusal("save_every = 10\nsave_at = [5]"))


def test_times_beyond_a_shortened_end() -> None:
    assert parse("save_at = [5, 30]", "time.end=10").time.save_at == (0.0, 5.0, 10.0)
    assert refusal("save_at = [5, 50]").path == "time.save_at"
    assert "30 lies beyond the end of the run, 10" in str(refusal("save_at = [5, 30]", "time.end=10", "time.save_at=[30]"))


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "0", "-1", "true", '"40"', "2020-01-01", "[1]", "1e-320"])
def test_end_refused(value: str) -> None:
    assert refusal(base=f'[scene]\nmodel = "toy"\n[time]\nend = {value}\n').path == "time.end"


@pytest.mark.parametrize(
    ("line", "path"),
    [
        ("save_every = nan", "time.save_every"),
        ("save_every = 0", "time.save_every"),
        ("save_every = 1e-9", "time.save_every"),
        ("save_every = true", "time.save_every"),
        ("save_at = 3", "time.save_at"),
        ("save_at = [-1]", "time.save_at"),
        ("save_at = [nan]", "time.save_at[0]"),
        ("save_at = [1, true]", "time.save_at[1]"),
        ("save_evry = 1", "time.save_evry"),
    ],
)
def test_saving_refused(line: str, path: str) -> None:
    assert refusal(line).path == path


@pytest.mark.parametrize(
    ("extra", "path", "words"),
    [
        ("[parametrs]\nrate = 1", "parametrs", 'did you mean "parameters"?'),
        ("[parameters]\nrat = 1", "parameters.rat", 'did you mean "rate"?'),
        ("[parameters]\nwidth = 1", "parameters.width", "move it to [initial]"),
        ("cells = 50", "time.cells", "move it to [solver]"),
        ("[parameters]\nrate = true", "parameters.rate", "got true"),
        ("[parameters]\nrate = 2020-01-01", "parameters.rate", "date"),
        ("[parameters]\nrate = 2020-01-01T00:00:00", "parameters.rate", "datetime"),
        ("[parameters]\nrate = nan", "parameters.rate", "finite"),
        ("[parameters]\nrate = 13", "parameters.rate", "unlucky"),  # the model's own check
        ('[parameters]\npreset = "mous"', "parameters.preset", 'did you mean "mouse"?'),
        ("[parameters]\npreset = 1", "parameters.preset", "slow, mouse"),
        ('[output]\nfields = ["N"]', "output.fields", 'did you mean "n"?'),
        ('[output]\nformat = "h5"', "output.format", "file, vtk, fields"),
        ("[plan]\nreduce = 1", "plan.reduce", "true or false"),
        ("[scales]\nlength = 1", "scales.length", "µm"),
        ('[initial]\nn = { file = "gone.csv" }', "initial.n.file", "gone.csv cannot be read"),
    ],
)
def test_refusals(extra: str, path: str, words: str) -> None:
    error = refusal(extra)
    assert error.path == path
    assert words in str(error)


def test_refusals_of_the_whole() -> None:
    assert "model is missing" in str(refusal(base=""))
    assert "there is no model" in str(refusal(base='[scene]\nmodel = "tumor"'))
    assert "time.end" in str(refusal(base='[scene]\nmodel = "toy"'))
    assert "not valid TOML" in str(refusal(base="a = = 1"))
    assert "not valid TOML" in str(refusal(base="a = " + "9" * 5000))
    assert "outside the tables" in str(refusal(base="rate = 1"))
    assert "expected a table" in str(refusal(base="parameters = 1"))
    assert "move it to [parameters]" in str(refusal(base='[scene]\nmodel = "toy"\npreset = "mouse"'))
    assert "scene.title" in str(refusal(base='[scene]\nmodel = "toy"\ntitle = 3'))


def test_shipped_and_files(toy: Path) -> None:
    shipped = shipped_scenes()
    assert list(shipped) == ["toy", "toy-mouse"]
    assert (shipped["toy"].title, shipped["toy"].model) == ("A toy", "toy")
    assert load_scene("toy", ["parameters.rate=3"]).parameters.rate == 3.0
    (toy / "sub").mkdir()
    (toy / "sub" / "own.toml").write_text("\ufeff" + BASE + '[initial]\nn = { file = "n.csv" }', encoding="utf-8")
    (toy / "sub" / "n.csv").write_text("0 0.1\n1 0.2", encoding="utf-8")
    scene = load_scene(Path("sub/own.toml"))
    assert scene.name == "own"
    assert scene.initial.n.to_table() == {"at": [0.0, 1.0], "values": [0.1, 0.2]}  # beside the scene file, not in the current folder
    (toy / "toy.toml").write_text(BASE.replace("40", "7"), encoding="utf-8")
    assert load_scene("toy.toml").time.end == 7.0
    assert load_scene("toy").time.end == 40.0


def test_files_that_cannot_be_used(toy: Path) -> None:
    (toy / "run.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    (toy / "text.toml").write_text("what is this", encoding="utf-8")
    for name, words in [
        ("toy-mose", 'did you mean "toy-mouse"? The shipped scenes are toy, toy-mouse.'),
        ("gone.toml", "there is no such file"),
        (".", "cannot be read"),
        ("run.h5", "multiphase info"),
        ("text.toml", "text.toml: the scene is not valid TOML"),
        ("x" * 400, "cannot be read"),
        ("x\0y", "not a scene"),
    ]:
        with pytest.raises(ParameterError) as caught:
            load_scene(name)
        assert words in str(caught.value)


def test_with_changes() -> None:
    scene = parse("save_at = [5, 30]")
    changed = scene.with_changes(solver={"cells": 50}, time={"end": 10.0}, title="new", scales={"length": {"value": 1.0, "unit": "m"}})
    assert (changed.solver.cells, changed.time.save_at, changed.title) == (50, (0.0, 5.0, 10.0), "new")
    assert changed.scales == Scales(length=Scale(1.0, "m"))
    assert scene.solver.cells == 100
    assert scene.with_changes(time={"save_every": 20.0}).time.save_at == (0.0, 20.0, 40.0)
    assert scene.with_changes(time={"save_every": 20.0}).with_changes(time={"end": 60.0}).time.save_at == (0.0, 20.0, 40.0, 60.0)
    assert len(parse().with_changes(time={"end": 10.0}).time.save_at) == 51
    assert scene.with_changes(initial=Start(width=2.0)).initial.width == 2.0
    for changes in ({"solvr": {}}, {"solver": {"cels": 1}}, {"parameters": {"rate": 13.0}}, {"time": {"ends": 1}}, {"initial": Growth()}):
        with pytest.raises(ParameterError):
            scene.with_changes(**changes)


def test_scene_made_in_python() -> None:
    scene = Scene(
        name="toy", model=MODEL, geometry=Shape(), parameters=Growth(), initial=Start(n=lambda x: x / 2), solver=Solver(),
        time=TimeTable.make(2.0, save_at=[math.pi / 2]),
    )  # fmt: skip
    again = parse_scene(scene.to_toml(), name="again")
    assert again == scene
    assert differences(scene, again) == []
    assert again.time.save_at == (0.0, math.pi / 2, 2.0)
    with pytest.raises(ParameterError, match="expected Growth for the model toy"):
        scene.with_changes(parameters=Solver())


def test_differences() -> None:
    assert differences(parse(), parse("", "parameters.rate=2")) == ["parameters.rate: 1.0 in the file, 2.0 in the scene"]
    assert differences(parse(), parse("", "solver.dt=0.5")) == ["solver.dt: not set in the file, 0.5 in the scene"]
    assert differences(parse(), parse("", "scene.title=x", "output.file=x")) == []
    assert differences(parse(), parse("", "time.end=80")) == ["time.end: 40.0 in the file, 80.0 in the scene"]
    assert [d.split(":")[0] for d in differences(parse("save_every = 2"), parse("save_every = 2", "time.end=80"))] == ["time.end"]
    assert [d.split(":")[0] for d in differences(parse("save_at = [3]"), parse("", "time.end=80", "time.save_at=[3, 60]"))] == ["time.end"]
    assert [d.split(":")[0] for d in differences(parse("save_every = 2"), parse("save_every = 4"))] == ["time.save_every"]
    assert [d.split(":")[0] for d in differences(parse(), parse("", "time.save_at=[3]"))] == ["time.save_at"]
    long = parse("", f"initial.n={{at={list(range(9))},values={[0] * 9}}}")
    assert differences(parse(), long) == [
        "initial.n: 0.5 in the file, not set in the scene",
        "initial.n.at: not set in the file, a list of 9 in the scene",
        "initial.n.values: not set in the file, a list of 9 in the scene",
    ]
    other = long.with_changes(initial={"n": {"at": list(range(9)), "values": [1] * 9}})
    assert differences(long, other) == ["initial.n.values: other numbers in the file than in the scene"]


# -- Tables of named tables ---------------------------------------------------------------------------------------------


@pytest.fixture
def walled(monkeypatch: pytest.MonkeyPatch) -> Model:
    """The toy model with a table [boundary]."""
    model = replace(MODEL, boundary=Walls)
    monkeypatch.setattr(scene_module, "find_model", lambda name: model)
    return model


def test_without_named_tables() -> None:
    """A model that declares none refuses the table, as any unknown one."""
    error = refusal("[boundary.left]\nstiffness = 1")
    assert error.path == "boundary"
    assert "there is no such table. The tables are scene, geometry, parameters, initial, time, solver" in str(error)
    assert parse().boundary is None
    assert "boundary" not in parse().to_table()
    with pytest.raises(ParameterError, match="has no parts of a boundary"):
        parse().with_changes(boundary={"left": {"stiffness": 1.0}})
    with pytest.raises(ParameterError, match="boundary: expected nothing for the model toy"):
        parse().with_changes(boundary=Walls())


@pytest.mark.usefixtures("walled")
def test_named_tables() -> None:
    assert parse().boundary == Walls()
    assert "boundary" not in parse().to_table()  # a file without it is as it was
    scene = parse("[boundary.left]\nstiffness = 2\n[boundary.right]\npull = { times = [0, 1], values = [0, 3] }\n")
    assert scene.boundary == Walls((("left", Wall(stiffness=2.0)), ("right", Wall(pull={"times": [0, 1], "values": [0, 3]}))))
    assert scene != parse()
    again = parse_scene(scene.to_toml(), name="again")
    assert again == scene
    assert differences(scene, again) == []
    assert refusal("[boundary.left]\nstifness = 1").path == "boundary.left.stifness"
    assert 'did you mean "boundary"?' in str(refusal("[boundry.left]\nstiffness = 1"))


@pytest.mark.usefixtures("walled")
def test_set_in_named_tables() -> None:
    text = '[boundary.left]\nstiffness = 2\nside = "a"\n'
    scene = parse(text, "boundary.left.stiffness=3", "boundary.new-1.pull={times=[0,1],values=[0,3]}", "boundary.new-1.side=b b")
    assert scene.boundary == Walls(
        (("left", Wall(stiffness=3.0, side="a")), ("new-1", Wall(pull={"times": [0, 1], "values": [0, 3]}, side="b b")))
    )
    assert parse("", "boundary.left.stiffness=3").boundary.walls[0][1].stiffness == 3.0
    assert "expected a table, [boundary.left]" in str(refusal("", "boundary.left=3"))
    assert "boundary.left.stiffness is 2, not a table" in str(refusal(text, "boundary.left.stiffness.x=3"))
    assert differences(parse(text), parse(text, "boundary.left.stiffness=3")) == [
        "boundary.left.stiffness: 2.0 in the file, 3.0 in the scene"
    ]


@pytest.mark.usefixtures("walled")
def test_changes_of_named_tables() -> None:
    scene = parse('[boundary.left]\nstiffness = 2\nside = "a"\n')
    changed = scene.with_changes(boundary={"left": {"stiffness": 3.0}, "right": {"side": "b"}})
    assert changed.boundary == Walls((("left", Wall(stiffness=3.0, side="a")), ("right", Wall(side="b"))))
    assert changed.with_changes(boundary={"left": None}).boundary == Walls((("right", Wall(side="b")),))
    assert scene.with_changes(boundary=Walls()).boundary == Walls()
    assert scene.with_changes(boundary=None).boundary == Walls()
    with pytest.raises(ParameterError, match="expected Walls for the model toy"):
        scene.with_changes(boundary=Wall())


@pytest.mark.usefixtures("walled")
def test_the_order_of_named_tables_counts() -> None:
    texts = ["[boundary.left]\nstiffness = 2\n", "[boundary.right]\nstiffness = 2\n"]
    one, other = parse("".join(texts)), parse("".join(texts[::-1]))
    assert differences(one, other) == ["boundary: the parts come in the order left, right in the file, right, left in the scene"]
    assert parse_scene(other.to_toml(), name="again").boundary == other.boundary


def test_named_tables_made_in_python(walled: Model) -> None:
    made = make_scene(walled, None, t_end=2.0, boundary={"left": {"stiffness": 2.0}, "right": Wall(side="b")})
    assert made.boundary == Walls((("left", Wall(stiffness=2.0)), ("right", Wall(side="b"))))
    assert make_scene(walled, None, t_end=2.0, boundary=made.boundary).boundary == made.boundary
    assert make_scene(walled, None, t_end=2.0).boundary == Walls()
    with pytest.raises(ParameterError, match="boundary: expected nothing for the model toy"):
        make_scene(MODEL, None, t_end=2.0, boundary={"left": {"stiffness": 2.0}})
