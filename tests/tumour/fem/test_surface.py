"""Named parts on a mesh: which edges they are, what is prescribed and what acts there, and what would leave no or many solutions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skfem import MeshTri

from multiphase.errors import ParameterError
from multiphase.series import TimeSeries
from tumour import TumourBoundary, TumourParameters, meshes
from tumour.fem.surface import Surface
from tumour.meshes import Body
from tumour.meshes.body import boundary_edges, make_body

X, Y, ALPHA, P, OXYGEN = range(5)
PAPER = TumourParameters(p_out=0.25, C_out=0.75)
CLAMP = {"displacement_x": 0, "displacement_y": 0}
STEP = {"times": [1.0, 1.0], "values": [0.5, 2.0]}
RAMP = {"times": [0.0, 2.0], "values": [0.0, 1.0]}


def surface(body: Body, parameters: TumourParameters = PAPER, **parts: Any) -> Surface:
    return Surface(body, TumourBoundary.from_table(parts), parameters)


def refusal(body: Body, parameters: TumourParameters = PAPER, **parts: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        surface(body, parameters, **parts)
    assert "\n" not in str(caught.value)
    return caught.value


def square(count: int = 4, **slides: str) -> Body:
    """The square from -1 to 1 with four named sides, of which some may slide: ``slide_y="bottom"``."""
    mesh = MeshTri.init_tensor(*[np.linspace(-1.0, 1.0, count + 1)] * 2)
    points, triangles = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    turned = np.linalg.det(np.stack((b - a, c - a), axis=1)) < 0.0
    triangles[turned] = triangles[turned][:, [0, 2, 1]]
    edges = boundary_edges(triangles)
    middles = points[edges].mean(axis=1)
    sides = {
        "left": edges[middles[:, 0] == -1.0], "right": edges[middles[:, 0] == 1.0], "bottom": edges[middles[:, 1] == -1.0],
        "top": edges[middles[:, 1] == 1.0],
    }  # fmt: skip
    free = np.concatenate([side for name, side in sides.items() if name not in slides.values()])
    where = {key: np.unique(sides[name]) for key, name in slides.items()}
    return make_body(points, triangles, surface=free, radius=1.0, sides={"surface": edges, **sides}, path="geometry", **where)


def half_disk() -> Body:
    """The half of a disk with y >= 0, sliding on y = 0."""
    body = meshes.disk(1.0, 8)
    points, triangles = body.mesh.p.T, body.mesh.t.T
    mine = triangles[points[triangles, 1].mean(axis=1) > 0.0]
    used = np.unique(mine)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    return make_body(
        points[used], number[mine], surface=number[np.intersect1d(body.surface, used)],
        slide_y=np.flatnonzero(np.abs(points[used, 1]) < 1e-12), radius=1.0, is_round=True, path="geometry",
    )  # fmt: skip


# -- Which edges --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [lambda: meshes.disk(1.0, 5), lambda: meshes.glioma(1.0, 0.3), square])
def test_edges_lie_on_their_triangles_and_point_outwards(make: Any) -> None:
    body = make()
    found = surface(body, all={"side": "surface", "spring": 2.0, "spring_normal": 3.0})
    points, triangles, edges = body.mesh.p.T, body.mesh.t.T, found.edges
    rows = np.arange(len(body.edges))
    corners = triangles[edges.triangles]
    np.testing.assert_array_equal(np.column_stack((corners[rows, edges.first], corners[rows, edges.second])), body.edges)
    along = points[body.edges[:, 1]] - points[body.edges[:, 0]]
    third = points[corners.sum(axis=1) - body.edges.sum(axis=1)]
    np.testing.assert_allclose(edges.lengths, np.linalg.norm(along, axis=1), rtol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(edges.normals, axis=1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(np.sum(edges.normals * along, axis=1), 0.0, atol=1e-15)
    assert np.all(np.sum(edges.normals * (third - points[body.edges[:, 0]]), axis=1) < 0.0)  # the body is on the other side
    assert np.all(edges.springs == [2.0, 3.0])
    assert np.all(edges.membranes == 0.0)


def test_sides_and_formulas() -> None:
    body = square()
    found = surface(body, a={"side": "right", "where": "y > 0"}, b={"side": "top"}, c={"where": "min(x < -0.99, y < 0)", "spring": 1})
    middles = found.middles
    for numbers, where in zip(
        found.numbers, [(middles[:, 0] == 1) & (middles[:, 1] > 0), middles[:, 1] == 1, (middles[:, 0] == -1) & (middles[:, 1] < 0)],
        strict=True,
    ):  # fmt: skip
        np.testing.assert_array_equal(numbers, np.flatnonzero(where))
    assert [len(numbers) for numbers in found.numbers] == [2, 4, 2]
    assert found.describe()[1] == "b (4 edges, length 2): free; p = p_out; C = C_out"


def test_formulas_use_polar_coordinates_and_the_radius() -> None:
    disk = meshes.disk(2.0, 6)
    found = surface(
        disk, a={"where": "theta > pi/2"}, b={"where": "min(theta < 0, r > 1.9)"}, c={"where": "(theta > 0)*(theta < 1)*(xi < 1)"}
    )
    assert [len(numbers) for numbers in found.numbers] == [9, 18, 6]
    assert refusal(disk, a={"where": "xi > 1"}).path == "boundary.a.where"
    assert "gives inf at x = " in str(refusal(disk, a={"where": "1/(x - x)"}))


def test_parts_that_are_nowhere() -> None:
    body = square(slide_x="left")
    error = refusal(body, a={"side": "tpo"})
    assert error.path == "boundary.a.side"
    assert 'did you mean "top"?' in str(error)
    assert '"right", "bottom", "top"; lines on which the body slides are none of them' in str(error)
    assert 'no side "left"' in str(refusal(body, a={"side": "left"}))
    error = refusal(body, a={"side": "top", "where": "y < 0"})
    assert error.path == "boundary.a.where"
    assert "x from -0.75 to 1 and y from -1 to 1" in str(error)


def test_parts_that_overlap() -> None:
    error = refusal(square(), first={"side": "top", "where": "x > 0.5"}, second={"where": "y > 0.9"})
    assert error.path == "boundary.second"
    assert '"second" and "first" both claim an edge, one of them at (0.75, 1)' in str(error)


# -- What is prescribed -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [{}, {"kappa": 0.0}, {"Q": 0.0}, {"consumption": 0.0}])
@pytest.mark.parametrize("boundary", [None, TumourBoundary()])
def test_without_parts(changes: dict[str, float], boundary: TumourBoundary | None) -> None:
    """Sliding sides are held, and the surface is at p_out and C_out; so is all of the body where the fluid flows freely, or nobody takes up
    oxygen."""
    body = meshes.quarter_disk(1.0, 4)
    found = Surface(body, boundary, TumourParameters(p_out=0.25, C_out=0.75, **changes))
    expected = np.zeros((body.mesh.nvertices, 5), dtype=bool)
    expected[body.slide_x, X] = expected[body.slide_y, Y] = True
    expected[body.surface, P] = expected[body.surface, OXYGEN] = True
    expected[:, P] |= "kappa" in changes
    expected[:, OXYGEN] |= "Q" in changes or "consumption" in changes
    np.testing.assert_array_equal(found.prescribed, expected)
    np.testing.assert_array_equal(found.values(3.0), np.tile([0.0, 0.0, 0.0, 0.25, 0.75], (len(expected), 1)))
    assert found.actions(0.0).shape == (0, 5)
    assert (len(found.edges.triangles), found.edges.springs.shape, found.edges.normals.shape) == (0, (0, 2), (0, 2))
    assert (found.breaks, found.jumps, found.describe()) == ((), (), ())
    assert not found.has_own_oxygen
    assert not found.has_own_pressure
    assert not found.free_motions[0].any()
    assert not found.free_motions[1]


def test_what_parts_prescribe() -> None:
    body = square()
    found = surface(
        body,
        low={"side": "bottom", "displacement_x": RAMP, "displacement_y": 0, "p": "closed", "C": STEP},
        high={"side": "top", "p": 3.0, "C": "closed"},
    )
    x, y = body.mesh.p
    low, high, rest = y == -1.0, y == 1.0, (np.abs(x) == 1.0)
    np.testing.assert_array_equal(found.prescribed[:, X], low)
    np.testing.assert_array_equal(found.prescribed[:, Y], low)
    assert not found.prescribed[:, ALPHA].any()
    np.testing.assert_array_equal(found.prescribed[:, P], high | rest)  # closed points at the ends of open sides are prescribed
    np.testing.assert_array_equal(found.prescribed[:, OXYGEN], low | rest)
    before, after, late = found.values(1.0, -1), found.values(1.0), found.values(5.0)
    assert np.all(before[low, X] == 0.5)
    assert np.all(late[low, X] == 1.0)
    assert np.all(before[low, OXYGEN] == 0.5)
    assert np.all(after[low, OXYGEN] == 2.0)
    assert np.all(after[high, P] == 3.0)
    assert np.all(after[~high, P] == 0.25)
    assert np.all(after[~low, OXYGEN] == 0.75)
    assert np.all(after[:, Y] == 0.0)
    assert found.has_own_oxygen
    assert found.has_own_pressure


def test_the_first_part_named_wins_where_two_meet() -> None:
    body = square()
    one, two = {"side": "bottom", "p": 1.0, "C": "outside", **CLAMP}, {"side": "left", "p": "outside", "C": 0.1, "displacement_x": 0.5}
    corner = np.flatnonzero((body.mesh.p == -1.0).all(axis=0))[0]
    first, second = surface(body, one=one, two=two).values(0.0)[corner], surface(body, two=two, one=one).values(0.0)[corner]
    np.testing.assert_array_equal(first, [0.0, 0.0, 0.0, 1.0, 0.75])
    np.testing.assert_array_equal(second, [0.5, 0.0, 0.0, 0.25, 0.1])


def test_a_straight_side_is_not_left() -> None:
    """What a part says of the point at which it meets a sliding side does not hold along the side's normal."""
    body = square(slide_y="bottom")
    found = surface(body, a={"side": "left", "displacement_x": 0.25, "displacement_y": 0.5})
    corner = np.flatnonzero((body.mesh.p == -1.0).all(axis=0))[0]
    np.testing.assert_array_equal(found.values(0.0)[corner, :2], [0.25, 0.0])
    assert found.prescribed[corner, :2].all()


def test_oxygen_is_uniform_unless_a_part_changes_it() -> None:
    body, still = square(), TumourParameters(Q=0.0, C_out=0.75)
    for changes, is_own in (
        ({"C": 0.75}, False),
        ({"C": {"times": [0.0, 1.0], "values": [0.75, 0.75]}}, False),
        ({"C": "closed"}, False),
        ({"membrane": 2.0}, False),
        ({"membrane": 2.0, "C": 0.75}, False),
        ({"C": 0.5}, True),
        ({"C": {"times": [0.0, 1.0], "values": [0.75, 0.5]}}, True),
        ({"membrane": 2.0, "C": 0.5}, True),
        ({"C": "closed", "influx": 0.1}, True),
        ({"C": "closed", "influx": RAMP}, True),
    ):
        found = surface(body, still, a={"side": "top", **changes})
        assert found.has_own_oxygen is is_own, changes
        assert found.has_uniform_oxygen is not is_own
        assert found.prescribed[:, OXYGEN].all() == (not is_own)
        assert not surface(body, a={"side": "top", **changes}).has_uniform_oxygen
    for p, is_own in ((0.25, False), ("closed", False), ("outside", False), (0.5, True), (RAMP, True)):
        assert surface(body, a={"side": "top", "p": p}).has_own_pressure is is_own


# -- What acts ----------------------------------------------------------------------------------------------------------


def test_actions() -> None:
    body = square()
    found = surface(
        body,
        top={"side": "top", "traction_x": STEP, "traction_y": -1.0, "load": 0.5},
        hold={"side": "bottom", **CLAMP},
        left={"side": "left", "membrane": 3.0},
        right={"side": "right", "membrane": 4.0, "C": RAMP, "where": "y > 0"},
        rest={"side": "right", "C": "closed", "influx": RAMP, "where": "y < 0"},
    )
    middles = 0.5 * (body.mesh.p.T[body.edges[:, 0]] + body.mesh.p.T[body.edges[:, 1]])[found._acting]
    top, left, right, rest = (
        middles[:, 1] == 1.0, middles[:, 0] == -1.0, (middles[:, 0] == 1.0) & (middles[:, 1] > 0.0),
        (middles[:, 0] == 1.0) & (middles[:, 1] < 0.0),
    )  # fmt: skip
    assert len(middles) == 12  # all but the clamped ones
    for side, pull in ((-1, 0.5), (1, 2.0)):
        actions = found.actions(1.0, side)
        np.testing.assert_array_equal(actions[top], np.tile([pull, -1.0, 0.5, 0.0, 0.0], (4, 1)))
        np.testing.assert_array_equal(actions[left], np.tile([0.0, 0.0, 0.0, 0.0, 0.75], (4, 1)))
        np.testing.assert_array_equal(actions[right], np.tile([0.0, 0.0, 0.0, 0.0, 0.5], (2, 1)))
        np.testing.assert_array_equal(actions[rest], np.tile([0.0, 0.0, 0.0, 0.5, 0.0], (2, 1)))
    np.testing.assert_array_equal(found.edges.membranes, 3.0 * left + 4.0 * right)
    assert np.all(found.edges.normals[top] == [0.0, 1.0])
    assert (found.jumps, found.breaks) == ((1.0,), (0.0, 1.0, 2.0))


def test_parts_on_which_nothing_acts_have_no_edges() -> None:
    found = surface(
        square(), a={"side": "top", "p": 1.0, "C": 0.5}, b={"side": "bottom", "load": {"times": [0, 1], "values": [0, 0]}, **CLAMP}
    )
    assert len(found.edges.triangles) == 0
    assert found.actions(0.0).shape == (0, 5)


@pytest.mark.parametrize("key", ["traction_x", "traction_y", "load", "spring", "spring_normal", "membrane"])
def test_each_alone_needs_its_edges(key: str) -> None:
    found = surface(square(), hold={"side": "bottom", **CLAMP}, a={"side": "top", key: 2.0})
    np.testing.assert_array_equal(found.edges.normals, np.tile([0.0, 1.0], (4, 1)))


# -- Rigid motions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parts", "shifts", "turns"),
    [
        ({}, "xy", True),
        ({"a": {"side": "top", "spring": 1e-9}}, "", False),
        ({"a": {"side": "top", "where": "x > 0.5", "spring": 1.0}}, "", False),  # a single edge
        ({"a": {"side": "top", **CLAMP}}, "", False),
        ({"a": {"side": "top", "where": "x > 0.5", **CLAMP}}, "", False),
        ({"a": {"side": "top", "displacement_y": 0}}, "x", False),
        ({"a": {"side": "left", "displacement_x": 0}}, "y", False),
        ({"a": {"side": "top", "spring_normal": 1.0}}, "x", False),
        ({"a": {"side": "left", "spring_normal": 1.0}, "b": {"side": "right", "displacement_x": RAMP}}, "y", False),
        ({"a": {"side": "left", "spring_normal": 1.0}, "b": {"side": "top", "spring_normal": 1.0}}, "", False),
        ({"a": {"side": "surface", "spring_normal": 1.0}}, "", False),
    ],
)
def test_rigid_motions(parts: dict[str, Any], shifts: str, turns: bool) -> None:
    free = surface(square(), **parts).free_motions
    assert free[0].tolist() == ["x" in shifts, "y" in shifts]
    assert free[0].dtype == bool
    assert free[1] is turns


def test_sliding_sides_hold() -> None:
    assert surface(square(slide_y="bottom")).free_motions[0].tolist() == [True, False]
    assert surface(square(slide_y="bottom")).free_motions[1] is False
    assert surface(square(slide_y="bottom"), a={"side": "top", "spring": 1.0}).free_motions[0].tolist() == [False, False]


@pytest.mark.parametrize("rings", [3, 8, 40])
def test_a_disk_held_along_its_normals_may_turn(rings: int) -> None:
    """On any mesh, though the chords' ends move along their normals when a polygon turns; a body that is not round may not."""
    disk = meshes.disk(2.0, rings)
    for where in ("1", "y < -1.3"):
        error = refusal(disk, a={"where": where, "spring_normal": 1.0})
        assert error.path == "boundary"
        assert "turn about (0, 0)" in str(error)
    glioma = meshes.glioma(1.0, 0.3)
    assert not surface(glioma, a={"side": "surface", "spring_normal": 1.0}).free_motions[0].any()


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"a": {"side": "left", "displacement_y": 0}}, "both move and turn"),
        ({"a": {"side": "left", "where": "y > 0.5", "spring_normal": 1.0}}, "both move and turn"),
        (
            {
                "a": {"side": "left", "where": "y < 0", "displacement_y": 0},
                "b": {"side": "left", "where": "y > 0.5", "spring_normal": 1.0},
            },
            "turn about (-1, 0.75)",
        ),
        (
            {
                "a": {"side": "left", "where": "y > 0.5", "spring_normal": 1.0},
                "b": {"side": "top", "where": "x > 0.5", "spring_normal": 1.0},
            },
            "turn about (0.75, 0.75)",
        ),
    ],
)
def test_bodies_that_may_still_turn(parts: dict[str, Any], words: str) -> None:
    error = refusal(square(), **parts)
    assert words in str(error)
    assert "hold it on a whole side" in str(error)


def test_an_oblique_line_is_no_axis() -> None:
    """A square that stands on its corner, held along the normal of one side."""
    body = square()
    turn = np.sqrt(0.5) * np.array([[1.0, -1.0], [1.0, 1.0]])
    points = body.mesh.p.T @ turn.T
    turned = make_body(points, body.mesh.t.T.astype(np.int64), surface=body.surface, radius=1.0, path="geometry")
    error = refusal(turned, a={"where": "x + y > 1.41", "spring_normal": 1.0})
    assert "which is no axis" in str(error)


# -- Forces that nothing holds ------------------------------------------------------------------------------------------


def test_tractions_on_a_free_body() -> None:
    body = square()
    pull = {"right": {"side": "right", "traction_x": 1.0}, "left": {"side": "left", "traction_x": -1.0}}
    error = refusal(body, **pull)  # they balance, but not where the body has turned
    assert error.path == "boundary.right.traction_x"
    assert "nothing holds the body" in str(error)
    assert surface(body, **pull, hold={"side": "bottom", **CLAMP}).free_motions[1] is False
    assert surface(body, **pull, hold={"side": "bottom", "spring": 1.0}).free_motions[1] is False


def test_tractions_along_a_free_axis_balance() -> None:
    body = square(slide_y="bottom")
    right, later = {"side": "right", "traction_x": 1.0}, {"times": [0.0, 2.0, 3.0], "values": [-1.0, -1.0, -1.5]}
    surface(body, right=right, left={"side": "left", "traction_x": -1.0}, top={"side": "top", "traction_y": 1.0})
    surface(body, right={"side": "right", "traction_x": RAMP}, left={"side": "left", "traction_x": {"times": [0, 2], "values": [0, -1]}})
    surface(body, right={**right, "where": "y > 0"}, left={"side": "left", "traction_x": -0.5})  # half as strong on twice the length
    for left in (
        {"traction_x": -0.9},
        {"traction_x": later},
        {"traction_x": {"times": [0.0, 0.5, 1.0], "values": [-1.0, -0.9, -1.0]}},
        {"traction_x": {"times": [0.0, 1.0, 1.0], "values": [-1.0, -2.0, -1.0]}},  # just before the jump alone
    ):
        error = refusal(body, right=right, left={"side": "left", **left})
        assert error.path == "boundary.right.traction_x"
    assert "add up to -1 at t = 3, " in str(refusal(body, right=right, left={"side": "left", "traction_x": later}))
    assert "add up to -2 at t = 1, " in str(
        refusal(body, right=right, left={"side": "left", "traction_x": {"times": [1.0, 1.0], "values": [-1.0, -2.0]}})
    )


def test_pressure_all_round_a_free_body() -> None:
    disk = meshes.disk(1.0, 8)
    surface(disk, a={"side": "surface", "load": 1.0})
    surface(disk, a={"where": "x > 0.3", "load": RAMP}, b={"where": "x <= 0.3", "load": RAMP})
    for parts in (
        {"a": {"where": "x > 0.3", "load": 1.0}},
        {"a": {"where": "x > 0.3", "load": 1.0}, "b": {"where": "x <= 0.3", "load": 2.0}},
    ):
        error = refusal(disk, **parts)
        assert error.path == "boundary.a.load"
        assert "whole of a closed line" in str(error)
    surface(disk, a={"where": "x > 0.3", "load": 1.0}, b={"where": "x <= 0.3", "spring": 1.0})


def test_pressure_between_two_points_of_one_height() -> None:
    half = half_disk()
    surface(half, a={"side": "surface", "load": 1.0})
    assert "whole of a closed line" in str(refusal(half, a={"where": "x > 0", "load": 1.0}))
    disk = meshes.disk(1.0, 8)
    left, right, top = ({"where": where} for where in ("x < -0.8", "x > 0.8", "min(y > 0, min(x <= 0.8, x >= -0.8))"))
    load, hold = {**top, "load": RAMP}, {"displacement_y": 0}
    assert surface(disk, left={**left, **hold}, right={**right, **hold}, top=load).free_motions[0].tolist() == [True, False]
    surface(disk, left={**left, "displacement_y": RAMP}, right={**right, "displacement_y": RAMP}, top=load)
    for other in ({"where": "x > 0.9", **hold}, {**right, "displacement_y": RAMP}, {**right, "displacement_y": 0.1}):
        assert refusal(disk, left={**left, **hold}, right=other, top=load).path == "boundary.top.load"


# -- Levels of pressure and oxygen --------------------------------------------------------------------------------------


def test_the_level_of_the_pressure() -> None:
    held = {"side": "surface", **CLAMP}
    for body in (square(), meshes.quarter_disk(1.0, 4), square(slide_y="bottom")):
        assert "level of the pressure" in str(refusal(body, a={**held, "p": "closed"}))
        surface(body, a=held)
        surface(body, a={"side": "surface", "spring": 1.0, "p": "closed"})
    box = {
        f"{axis}{side}": {"side": side, f"displacement_{axis}": 0, "p": "closed"}
        for axis, side in (("x", "left"), ("x", "right"), ("y", "top"))
    }
    surface(square(), **box, under={"side": "bottom", "displacement_x": 0, "p": "closed"})  # may move up and down
    assert "level of the pressure" in str(refusal(square(), **box, under={"side": "bottom", "displacement_y": 0, "p": "closed"}))
    surface(square(), **box, under={"side": "bottom", "displacement_y": 0, "p": 0.1})


def test_fluid_that_flows_freely() -> None:
    free = TumourParameters(kappa=0.0)
    assert refusal(square(), free, a={"side": "top", "p": 0.0}).path == "boundary.a.p"
    assert 'all of the surface is "closed"' in str(refusal(square(), free, a={"side": "surface", "p": "closed"}))
    assert surface(square(), free, a={"side": "top", "p": "closed"}).prescribed[:, P].all()


def test_oxygen_that_nothing_sets() -> None:
    closed: dict[str, Any] = {"side": "surface", "C": "closed"}
    still, quiet = TumourParameters(Q=0.0), TumourParameters(consumption="0*x")
    assert "nothing brings oxygen in" in str(refusal(square(), a=closed))
    assert "nothing brings oxygen in" in str(refusal(square(), a={**closed, "influx": {"times": [0, 1], "values": [0, -1]}}))
    for parameters in (still, quiet, TumourParameters(consumption=0.0)):
        assert "has no level" in str(refusal(square(), parameters, a={**closed, "influx": 1.0}))
    for parameters in (PAPER, TumourParameters(consumption="x > 0.9")):
        assert not surface(square(), parameters, a={**closed, "influx": RAMP}).prescribed[:, OXYGEN].any()
    surface(square(), still, a={"side": "surface", "membrane": 0.1, "C": 0.5})
    surface(square(), still, a={**closed, "where": "y < 0.9", "influx": 1.0})


def test_breaks_of_all_series_once() -> None:
    found = surface(
        square(), a={"side": "top", "p": STEP, "C": RAMP, **CLAMP}, b={"side": "left", "load": {"times": [2, 3, 3], "values": [0, 1, 2]}}
    )
    assert (found.breaks, found.jumps) == ((0.0, 1.0, 2.0, 3.0), (1.0, 3.0))
    assert TimeSeries(STEP)(1.0, -1) == 0.5
