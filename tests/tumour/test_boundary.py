"""Named parts of the surface as a scene or a script writes them: checks, names, tables, changes, and words."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.model import find_model
from multiphase.scene import Scene, differences, parse_scene
from multiphase.series import TimeSeries
from tumour import BoundaryPart, TumourBoundary, TumourGeometry, simulate
from tumour.checks import check_boundary

RAMP = {"times": [0.0, 1.0, 1.0], "values": [0.0, 0.5, 0.25]}
BONE = {"where": "y < -0.5", "displacement_x": 0, "displacement_y": 0, "p": "closed", "C": "closed"}
SKIN = {"where": "y >= -0.5", "load": RAMP, "membrane": 2, "C": 0.5}
BASE = '[scene]\nmodel = "tumour"\n[geometry]\nkind = "disk"\ndimension = "2d"\n[solver]\ncells = 4\n[time]\nend = 1.0\n'


def parts(**tables: Any) -> TumourBoundary:
    return TumourBoundary.from_table(tables)


def parse(*sets: str, text: str = BASE) -> Scene:
    return parse_scene(text, name="my", sets=sets)


def test_stored_forms() -> None:
    part = BoundaryPart(side="outer", displacement_x=0, load=RAMP, spring=2, p=0.5)
    assert (part.side, part.where, part.displacement_y, part.C, part.membrane) == ("outer", None, None, "outside", None)
    assert part.displacement_x == TimeSeries(0.0)
    assert part.load == TimeSeries(RAMP)
    assert (type(part.spring), part.spring, part.p) == (float, 2.0, TimeSeries(0.5))
    assert set(part.series) == {TimeSeries(0.0), TimeSeries(RAMP), TimeSeries(0.5)}
    with pytest.raises(FrozenInstanceError):
        part.spring = 3.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("table", "key", "words"),
    [
        ({}, "", "does not say where it is"),
        ({"spring": 1}, "", "does not say where it is"),
        ({"side": 33}, "side", "text in quotes"),
        ({"where": "z > 0"}, "where", "uses z, which is not known here"),
        ({"where": "y <"}, "where", "cannot be read as a formula"),
        ({"where": 3}, "where", "text in quotes"),
        ({"sprng": 1}, "sprng", 'did you mean "spring"?'),
        ({"side": "a", "p": "closd"}, "p", 'did you mean "closed"?'),
        ({"side": "a", "C": "outsid"}, "C", 'did you mean "outside"?'),
        ({"side": "a", "p": True}, "p", "true"),
        ({"side": "a", "C": -0.1}, "C", "0 or more"),
        ({"side": "a", "spring": -1}, "spring", "0 or more"),
        ({"side": "a", "spring_normal": "stiff"}, "spring_normal", "number"),
        ({"side": "a", "membrane": 0}, "membrane", "greater than 0"),
        ({"side": "a", "load": float("nan")}, "load", "finite"),
        ({"side": "a", "load": {"times": [1, 0], "values": [0, 1]}}, "load.times", "must not decrease"),
        ({"side": "a", "membrane": 1, "C": "closed"}, "membrane", 'C is "closed"'),
        ({"side": "a", "influx": 1}, "influx", 'write C = "closed"'),
        ({"side": "a", "influx": {"times": [0, 1], "values": [0, 1]}, "C": 0.5}, "influx", 'write C = "closed"'),
        ({"side": "a", "displacement_x": 0, "traction_x": 1}, "traction_x", "displacement_x is given"),
        ({"side": "a", "displacement_y": RAMP, "traction_y": RAMP}, "traction_y", "displacement_y is given"),
        ({"side": "a", "displacement_x": 0, "displacement_y": 1, "traction_y": 1}, "traction_y", "both displacements are given"),
        ({"side": "a", "displacement_x": 0, "displacement_y": 0, "load": 1}, "load", "both displacements are given"),
        ({"side": "a", "displacement_x": 0, "displacement_y": 0, "spring": 1}, "spring", "both displacements are given"),
        ({"side": "a", "displacement_x": 0, "displacement_y": 0, "spring_normal": 1}, "spring_normal", "both displacements are given"),
    ],
)
def test_refusals(table: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        parts(bone=table)
    assert caught.value.path == ("boundary.bone." + key).rstrip(".")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "table",
    [
        {"side": "a"},
        {"where": "min(y < 0, x > 0)"},
        {"side": "a", "displacement_x": 0, "traction_y": 1, "load": 1, "spring": 1, "spring_normal": 1},
        {"side": "a", "displacement_x": 0, "displacement_y": 0, "traction_x": 0, "load": 0},
        {"side": "a", "C": "closed", "influx": -1},
        {"side": "a", "C": "outside", "membrane": 1, "p": -1},
    ],
)
def test_allowed(table: dict[str, Any]) -> None:
    assert parts(bone=table).names == ("bone",)


@pytest.mark.parametrize("name", ["", "a.b", "a b", "böne", "a/b", "a\n"])
def test_names_refused(name: str) -> None:
    with pytest.raises(ParameterError, match="cannot name a part"):
        parts(**{name: {"side": "a"}})
    with pytest.raises(ParameterError, match="cannot name a part"):
        TumourBoundary((BoundaryPart(name=name, side="a"),))


def test_values_in_the_place_of_parts() -> None:
    with pytest.raises(ParameterError, match="spring is a key of a part") as caught:
        parts(spring=3)
    assert caught.value.path == "boundary.spring"
    with pytest.raises(ParameterError, match=r"boundary.bone: expected a table"):
        parts(bone=3)
    with pytest.raises(ParameterError, match="boundary: expected parts by name"):
        TumourBoundary.from_table(3)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="two parts of this name"):
        TumourBoundary((BoundaryPart(name="a", side="x"), BoundaryPart(name="a", side="y")))


def test_the_collection() -> None:
    both = parts(bone=BONE, skin=SKIN)
    assert both.names == ("bone", "skin")
    assert len(both) == 2
    assert both["skin"].membrane == 2.0
    assert [part.name for part in both] == ["bone", "skin"]
    assert both == parts(bone=BoundaryPart(**BONE), skin=BoundaryPart(name="other", **SKIN))
    assert hash(both) == hash(parts(bone=BONE, skin=SKIN))
    assert both != parts(skin=SKIN, bone=BONE)  # at a shared point the first one holds
    assert not both.is_plain
    assert parts() == TumourBoundary()
    assert parts().is_plain
    with pytest.raises(KeyError):
        both["bne"]


def test_tables() -> None:
    both = parts(bone=BONE, skin=SKIN)
    table = both.to_table()
    assert TumourBoundary.from_table(table) == both
    assert table["skin"]["load"] == RAMP
    assert table["skin"]["spring_normal"] == 0.0
    assert "displacement_x" not in table["skin"]
    assert (table["bone"]["displacement_x"], table["bone"]["p"], table["skin"]["p"]) == (0.0, "closed", "outside")


def test_changes() -> None:
    both = parts(bone=BONE, skin=SKIN)
    changed = both.with_changes({"skin": {"load": 0.5, "membrane": None}, "new": {"where": "x > 2"}})
    assert changed.names == ("bone", "skin", "new")
    assert (changed["bone"], changed["skin"]) == (both["bone"], replace(both["skin"], load=0.5, membrane=None))
    assert both.with_changes({"bone": None}).names == ("skin",)
    assert both.with_changes({"bone": BoundaryPart(side="outer")})["bone"] == BoundaryPart(name="bone", side="outer")
    with pytest.raises(ParameterError, match=r"boundary.bone.traction_x: it has no effect"):
        both.with_changes({"bone": {"traction_x": 1}})


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (BONE, "clamped; no flow; oxygen closed"),
        (SKIN, "load 0 to 0.5 in time; p = p_out; membrane 2 to C = 0.5"),
        ({"side": "a"}, "free; p = p_out; C = C_out"),
        ({"side": "a", "displacement_y": 0, "spring": 3, "p": 0.25}, "d_y = 0, spring 3; p = 0.25; C = C_out"),
        ({"side": "a", "displacement_x": 0, "displacement_y": 0.1}, "d_x = 0, d_y = 0.1; p = p_out; C = C_out"),
        (
            {"side": "a", "traction_y": -1, "spring_normal": 2, "C": "closed", "influx": 0.5},
            "traction (0, -1), spring along the normal 2; p = p_out; oxygen influx 0.5",
        ),
        ({"side": "a", "membrane": 2}, "free; p = p_out; membrane 2 to C = C_out"),
    ],
)
def test_words(table: dict[str, Any], words: str) -> None:
    assert parts(a=table)["a"].describe() == words


# -- In a scene ---------------------------------------------------------------------------------------------------------


def test_a_scene_and_its_toml() -> None:
    scene = parse("boundary.bone.where=y < -0.5", "boundary.bone.spring=3", "boundary.bone.load={times=[0,1],values=[0,1]}")
    assert scene.boundary["bone"].load == TimeSeries({"times": [0, 1], "values": [0, 1]})
    again = parse_scene(scene.to_toml(), name="again")
    assert again == scene
    assert differences(scene, again) == []
    assert differences(scene, scene.with_changes(boundary={"bone": {"spring": 4}})) == [
        "boundary.bone.spring: 3.0 in the file, 4.0 in the scene"
    ]
    assert "boundary" not in parse().to_table()  # as before there were parts
    assert parse().boundary == TumourBoundary()


def test_order_is_a_difference() -> None:
    one = parse().with_changes(boundary={"left": {"where": "x < 0", "spring": 1}, "right": {"where": "x > 0", "C": 0.5}})
    other = replace(one, boundary=TumourBoundary(one.boundary.parts[::-1]))
    assert differences(one, other) == ["boundary: the parts come in the order left, right in the file, right, left in the scene"]
    assert parse_scene(other.to_toml(), name="again").boundary.names == ("right", "left")


def test_a_scene_finds_what_the_mesh_shows() -> None:
    """Before any work."""
    for sets, path in (
        (["boundary.a.side=outer"], "boundary.a.side"),
        (["boundary.a.where=x > 3"], "boundary.a.where"),
        (["boundary.a.where=x > 0", "boundary.a.traction_x=1"], "boundary.a.traction_x"),
    ):
        with pytest.raises(ParameterError) as caught:
            parse(*sets)
        assert caught.value.path == path
    with pytest.raises(ParameterError, match=r"boundary.a.where: it holds on no edge"):
        simulate(t_end=1.0, geometry={"kind": "disk", "dimension": "2d"}, cells=4, boundary={"a": BoundaryPart(where="x > 3")})


@pytest.mark.parametrize(("kind", "advice"), [("disk", 'write dimension = "2d"'), ("sphere", "take a body in two dimensions")])
def test_radial_bodies_have_no_parts(kind: str, advice: str) -> None:
    text = BASE.replace('kind = "disk"\ndimension = "2d"', f'kind = "{kind}"\ndimension = "radial"')
    assert parse(text=text).boundary.is_plain
    with pytest.raises(ParameterError, match=advice) as caught:
        parse("boundary.bone.side=surface", text=text)
    assert caught.value.path == "boundary.bone"


@pytest.mark.parametrize("kind", ["disk", "quarter_disk"])
def test_a_round_body_is_solved_in_two_dimensions_where_it_must_be(kind: str) -> None:
    """Where nothing is said of the dimension: parts, tissue that varies or has a direction, and an initial state that is not radial."""
    text = BASE.replace('kind = "disk"\ndimension = "2d"', f'kind = "{kind}"')
    assert parse(text=text).geometry.dimension == "auto"
    assert parse("initial.alpha=0.8 + 0.01*r", text=text).geometry.dimension == "auto"
    for change in ("boundary.bone.side=surface", "parameters.stiffness=1 + r", "parameters.fibre_ratio=2", "initial.alpha=0.8 + 0.01*x"):
        scene = parse(change, text=text)
        assert scene.geometry.dimension == "2d"
        assert scene.solver.method == "mini"


def test_sides_that_slide_and_units() -> None:
    mesh = TumourGeometry(kind="mesh", file="a.msh", slide_x=("left", "33"), slide_y=("low",))
    for side, key in (("33", "slide_x"), ("low", "slide_y")):
        with pytest.raises(ParameterError, match=f"by geometry.{key}") as caught:
            check_boundary(parts(bone={"side": side}), mesh)
        assert caught.value.path == "boundary.bone.side"
    check_boundary(parts(bone={"side": "right", "spring": 1e12}), mesh)
    for table in ({"spring": 2e12}, {"load": {"times": [0, 1], "values": [0, -2e12]}}, {"C": 2e12}):
        with pytest.raises(ParameterError, match=r"2e\+12 is beyond 1e\+12") as caught:
            check_boundary(parts(bone={"side": "right", **table}), mesh)
        assert caught.value.path == f"boundary.bone.{next(iter(table))}"


def test_the_plan_tells_what_acts_where() -> None:
    model = find_model("tumour")
    scene = parse().with_changes(boundary={"bone": BONE, "skin": SKIN})
    plan = model.plan(scene)
    assert plan.boundary[0].startswith("bone (8 edges, length 2.0")
    assert plan.boundary[0].endswith(": clamped; no flow; oxygen closed")
    assert [line for line in plan.describe().splitlines() if line.startswith("boundary   bone (8 edges")]
    assert '"boundary": [\n  "bone (8 edges' in plan.to_json()
    assert not any("rigid motions" in line for line in plan.dropped)
    free = model.plan(parse())
    assert free.boundary == ()
    assert any("rigid motions" in line for line in free.dropped)
    # 61 points; 9 are clamped, 7 of them closed to fluid and oxygen alike; behind the membrane oxygen is free all round
    assert free.unknowns - plan.unknowns == 2 * 9 - 7 - 24
    still = parse("parameters.Q=0", "boundary.a.where=y < 0", "boundary.a.C=0.5")
    assert [line.split()[0] for line in model.plan(still).equations] == ["momentum", "cells", "fluid", "oxygen"]
    assert [line.split()[0] for line in model.plan(parse("parameters.Q=0")).equations] == ["momentum", "cells", "fluid"]
    slides = model.plan(parse("boundary.bone.where=y < -0.5", "boundary.bone.displacement_y=0"))
    assert any("the shift along x" in line for line in slides.dropped)


def test_disks_with_parts_are_not_expected_to_stay_round() -> None:
    model = find_model("tumour")
    paper = BASE.replace("end = 1.0", 'end = 70.0\n[parameters]\npreset = "paper"')
    plain, held = parse(text=paper), parse("boundary.bone.where=y < -0.5", "boundary.bone.spring=3", text=paper)
    assert any("buckle" in warning for warning in model.plan(plain).warnings)
    assert not any("buckle" in warning for warning in model.plan(held).warnings)
    assert [model.trackers(scene)[0]._watches_symmetry for scene in (plain, held)] == [True, False]


def test_a_run_with_a_part() -> None:
    """What is held stays where it is to the last bit, and the rest grows."""
    result = simulate(t_end=0.5, save_every=0.5, geometry={"kind": "disk", "dimension": "2d"}, cells=4, boundary={"bone": BONE})
    assert result.mesh is not None
    held = result.mesh.points[:, 1] < -0.7  # the ends of the edges with their middles below -0.5, but two
    held &= np.hypot(*result.mesh.points.T) > 0.99
    moved = np.abs(result["displacement"][-1]).max(axis=1)
    assert np.sum(held) == 7
    assert np.all(moved[held] == 0.0)
    assert moved.max() > 1e-3
    assert 'where = "y < -0.5"' in result.scene


def test_a_part_that_was_renamed_is_one_difference() -> None:
    """Not one for each of its keys."""
    one = parse("boundary.bone.where=x > 0", "boundary.bone.spring=1")
    other = parse("boundary.bome.where=x > 0", "boundary.bome.spring=1")
    assert differences(one, other) == [
        'boundary.bone: the part "bone" is only in the file',
        'boundary.bome: the part "bome" is only in the scene',
    ]
