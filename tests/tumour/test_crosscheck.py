"""Disks in two dimensions against the radial solver: averages over rings, scatter round them, orders, and what is no check."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from multiphase.cli import main
from multiphase.compare import Comparison, compare
from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import Result
from tumour import TumourParameters, meshes, simulate
from tumour.crosscheck import CrossCheck, crosscheck
from tumour.fem import watch
from tumour.profiles import LEAST_ASYMMETRY, profiles_of
from tumour.rings import Rings, RoundMesh, ring_averages

PAPER = TumourParameters.preset("paper")
EDGES = np.array([0.0, 0.08, 0.31, 0.5, 0.93, 1.0])
KINDS = ("quarter_disk", "disk")


def round_mesh(kind: str, rings: int, radius: float = 1.0) -> RoundMesh:
    body = getattr(meshes, kind)(radius, rings)
    return RoundMesh(Mesh(body.mesh.p.T, body.mesh.t.T), kind == "quarter_disk")


# -- Averages over rings ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_averages_of_linear_fields_are_exact(kind: str) -> None:
    """Over rings that follow no line of the mesh, the outermost, of which triangles hold less than the disk does, among them."""
    mesh = round_mesh(kind, 7, 2.0)
    rings = Rings.of(mesh, EDGES)
    x, y = mesh.mesh.points.T
    a, b = 2.0 * EDGES[:-1], 2.0 * EDGES[1:]
    share = 0.25 if mesh.quarter else 1.0
    areas = rings._weights[0].sum(axis=1)
    np.testing.assert_allclose(areas, share * np.pi * (b**2 - a**2), rtol=1e-12)
    mean_x = (2.0 / 3.0) * (b**3 - a**3) / (b**2 - a**2) * (2.0 / np.pi) if mesh.quarter else 0.0 * a
    found = rings.means(np.stack([1.0 + 0.0 * x, x, y, 3.0 - 2.0 * x + 0.5 * y]))
    np.testing.assert_allclose(found, [1.0 + 0.0 * a, mean_x, mean_x, 3.0 - 1.5 * mean_x], atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_the_radial_part_of_a_uniform_stretch_is_exact(kind: str) -> None:
    """d = c X, and what turns a whole disk adds nothing; weighted by the distance, the mean of c |X| is c int R^3 over int R^2."""
    mesh = round_mesh(kind, 6)
    points = mesh.mesh.points
    turned = 0.3 * np.column_stack([-points[:, 1], points[:, 0]]) * (not mesh.quarter)
    found = Rings.of(mesh, EDGES).outward_means((1.7 * points + turned)[None])
    a, b = EDGES[:-1], EDGES[1:]
    np.testing.assert_allclose(found[0], 1.7 * 0.75 * (b**4 - a**4) / (b**3 - a**3), rtol=1e-12)


def test_parts_of_triangles_within_circles() -> None:
    """Against the sum over half a million small squares: triangles that hold the middle, touch the circle, lie within it or outside."""
    points = np.array([[-0.4, -0.3], [1.2, -0.2], [0.1, 0.9], [2.0, 2.0], [0.2, -0.9]])
    mesh = Mesh(points, np.array([[0, 1, 2], [1, 3, 2], [0, 4, 1]]))
    step = 0.003
    X, Y = np.meshgrid(np.arange(-0.5, 2.1, step), np.arange(-1.0, 2.1, step))
    for radius in (0.2, 0.55, 0.8, 1.0):
        found = RoundMesh(mesh).moments(radius)
        for triangle, moments in zip(mesh.triangles, found.T, strict=True):
            corners = points[triangle]
            inside = np.hypot(X, Y) < radius
            for k in range(3):
                (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 3]
                inside &= (bx - ax) * (Y - ay) - (by - ay) * (X - ax) > 0.0
            x, y = X[inside], Y[inside]
            counted = step**2 * np.array([x.size, x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum()])
            np.testing.assert_allclose(moments, counted, atol=1e-3)  # perimeter times a third of a square's side, of random sign


def test_averages_of_other_fields_are_of_second_order() -> None:
    """The linear interpolant of R^2 is above it by a twelfth of the squared sides of the triangle, on average over it."""
    errors = []
    for rings in (12, 24):
        mesh = round_mesh("disk", rings)
        R = np.hypot(*mesh.mesh.points.T)
        errors.append(Rings.of(mesh, EDGES).means((R**2)[None])[0] - 0.5 * (EDGES[1:] ** 2 + EDGES[:-1] ** 2))
        corners = mesh.mesh.points[mesh.mesh.triangles]
        sides = np.sum((corners - np.roll(corners, 1, axis=1)) ** 2, axis=(1, 2)) / 12.0
        whole = Rings.of(mesh, np.array([0.0, 1.0])).means((R**2)[None])[0, 0] - 0.5
        # The segments beyond the edges of the surface add to the next order: theta^2/6 of the area, theta = pi/(6 rings).
        assert whole == pytest.approx(sides @ mesh.mesh.areas() / np.pi, rel=0.3 / rings)
    np.testing.assert_allclose(errors[0][1:-1] / errors[1][1:-1], 4.0, rtol=0.15)  # rings cut triangles in other ways
    assert np.all(np.abs(errors[0]) < 0.35 / 12**2)  # three sides of h to 1.15 h


def test_averages_of_the_radial_solver() -> None:
    """Cells that end within rings; linear fields exactly, R^2 (in the middle of each cell) to second order."""
    a, b = EDGES[:-1], EDGES[1:]
    errors = []
    for cells in (23, 46):
        R = (np.arange(cells) + 0.5) / cells
        values = np.stack([np.ones(cells), 2.0 - R, R**2])
        found = ring_averages(values, EDGES)
        mean = (2.0 / 3.0) * (b**3 - a**3) / (b**2 - a**2)
        np.testing.assert_allclose(found[:2], [1.0 + 0.0 * a, 2.0 - mean], rtol=1e-13)
        np.testing.assert_allclose(
            ring_averages(values, EDGES, weighted=True)[1], 2.0 - 0.75 * (b**4 - a**4) / (b**3 - a**3), rtol=1e-13
        )  # fmt: skip
        errors.append(np.max(np.abs(found[2] - 0.5 * (b**2 + a**2))))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] < 0.25 / 46**2


# -- Scatter ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_scatter_of_radial_fields_is_an_error_of_second_order(kind: str) -> None:
    edges = np.linspace(0.0, 1.0, 8)
    errors = []
    for rings in (12, 24, 48):
        mesh = round_mesh(kind, rings)
        rms, largest = Rings.of(mesh, edges).scatter(np.cos(2.0 * np.hypot(*mesh.mesh.points.T))[None])
        errors.append(largest[0])
        assert np.all(rms <= largest)
        assert np.max(largest) < 4.0 / 8.0 / rings**2 * 1.5  # |f''| h^2/8, with sides of up to 1.05 h and two directions
    # Circles lie in other places of triangles of other meshes: over two halvings.
    assert np.max(errors[0]) / np.max(errors[2]) > 10.0


@pytest.mark.parametrize("kind", KINDS)
def test_scatter_is_that_of_a_wave(kind: str) -> None:
    """0.1 R^2 cos(2 theta): 0.1 R^2 at the most, over the root of two on average."""
    edges = np.linspace(0.0, 1.0, 6)
    middles = 0.5 * (edges[1:] + edges[:-1])
    errors = []
    for rings in (12, 48):
        mesh = round_mesh(kind, rings)
        x, y = mesh.mesh.points.T
        rms, largest = Rings.of(mesh, edges).scatter((1.0 - x**2 - y**2 + 0.1 * (x**2 - y**2))[None])
        errors.append(np.max(np.abs(rms[0] - 0.1 * middles**2 / np.sqrt(2.0))))
        assert np.max(np.abs(largest[0] - 0.1 * middles**2)) < 0.5 / rings**2  # two sides squared over four
    assert errors[0] / errors[1] > 10.0
    assert errors[1] < 1e-4


def test_scatter_of_displacements_has_their_tangential_part() -> None:
    """d = 1.5 X + 0.2 (-Y, X) is linear: the first part is none, the second 0.2 R everywhere."""
    mesh = round_mesh("disk", 9)
    points = mesh.mesh.points
    moved = 1.5 * points + 0.2 * np.column_stack([-points[:, 1], points[:, 0]])
    rms, largest = Rings.of(mesh, np.linspace(0.0, 1.0, 6)).scatter(moved[None])
    np.testing.assert_allclose(rms[0], 0.2 * np.arange(0.1, 1.0, 0.2), rtol=1e-12)
    np.testing.assert_allclose(largest, rms, rtol=1e-11)


# -- Both solvers -----------------------------------------------------------------------------------------------------------


@cache
def radial() -> Result:
    return simulate(PAPER, t_end=50.0, geometry="quarter_disk", cells=400, rtol=1e-7, save_at=[20.0, 40.0, 50.0])


@cache
def plane(kind: str, rings: int) -> Result:
    geometry = {"kind": kind, "dimension": "2d"}
    return simulate(PAPER, t_end=50.0, geometry=geometry, cells=rings, dt=0.1, newton_tol=1e-8, save_at=[20.0, 40.0, 50.0])


@cache
def checks(kind: str) -> list[CrossCheck]:
    return [crosscheck(plane(kind, rings), radial()) for rings in (6, 12, 24)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("row", "least"), [(1, 1.5), (2, 1.9)])
def test_the_radial_solver_to_second_order(kind: str, row: int, least: float) -> None:
    """Up to t = 40, before cells lose contact. The step adds 1.6e-5 of the radius at t = 20, where 24 rings are off by 4e-5, and 1e-5 of
    1.5e-4 at t = 40. On ten to eighty rings: benchmarks/crosscheck.md."""
    for name, finest in (("radius", 3e-4), ("alpha", 1e-4), ("C", 2e-3), ("p", 4e-3), ("displacement", 1e-3)):
        errors = np.array([check.difference(name)[row] for check in checks(kind)])
        orders = np.log2(errors[:-1] / errors[1:])
        assert np.all(orders > least), name
        assert errors[-1] < finest, name


@pytest.mark.parametrize("kind", KINDS)
def test_scatter_falls_with_the_mesh(kind: str) -> None:
    """As h^2 in oxygen, pressure and displacement; as h^1.5 in alpha, which is of that order on regular meshes."""
    for name, least in (("alpha", 1.3), ("C", 1.7), ("p", 1.7), ("displacement", 1.6)):
        for row in (1, 2):
            errors = np.array([check.scatter(name)[row] for check in checks(kind)])
            assert np.all(np.log2(errors[:-1] / errors[1:]) > least), name
            assert np.all(errors <= [check.scatter(name, largest=True)[row] for check in checks(kind)])
        assert errors[-1] < 5e-4


@pytest.mark.parametrize("kind", KINDS)
def test_past_the_kink_differences_fall_with_every_mesh(kind: str) -> None:
    """t = 50: cells at the centre have lost contact."""
    assert radial()["alpha"][-1].min() < 0.8
    for name, finest in (("radius", 5e-4), ("alpha", 1e-3), ("C", 4e-3), ("p", 5e-3)):
        errors = np.array([check.difference(name)[3] for check in checks(kind)])
        assert np.all(np.diff(errors) < 0.0), name
        assert errors[-1] < finest, name
        if name != "radius":
            scattered = np.array([check.scatter(name)[3] for check in checks(kind)])
            assert np.all(np.diff(scattered) < 0.0), name


def test_coarse_meshes_do_not_explain_the_limit_of_asymmetry() -> None:
    """It leaves four times what six rings make."""
    assert LEAST_ASYMMETRY == watch.LEAST_ASYMMETRY
    assert 4e-3 < max(float(plane(kind, 6)["asymmetry"].max()) for kind in KINDS) < LEAST_ASYMMETRY / 3.0


def test_a_cross_check_as_text_and_picture(tmp_path: Path) -> None:
    check = checks("disk")[1]
    assert check.names[:4] == ("alpha", "C", "p", "displacement")
    for what, largest in ((check.rms, False), (check.largest, True)):
        np.testing.assert_array_equal(check.scatter("C", largest=largest), what["C"].max(axis=1) / check.radial["C"].max(axis=1))
    assert check.agrees(2e-2)
    assert not check.agrees(1e-2)  # p at t = 40
    table = check.table().splitlines()
    assert table[0] == "A, 469 nodes, 864 triangles, against the radial solver, 400 cells: 10 rings of the body at rest, over"
    row = next(line for line in table if line.split()[:2] == ["40", "difference"])
    assert row.split()[2:5] == [f"{check.difference(name)[2]:.2e}" for name in ("radius", "alpha", "C")]
    assert max(map(len, table)) <= 120
    picture = check.figure()
    picture.savefig(tmp_path / "a.png")
    assert [axes.get_title() for axes in picture.axes][:3] == [r"$\alpha$", "$C$", "$p$"]


def test_the_radial_solution_is_found_where_none_is_given() -> None:
    found = crosscheck(small("disk"))
    assert found.sizes[1] == "400 cells"
    assert found.agrees(0.05)
    with pytest.raises(ParameterError, match="has no radial solution: its initial alpha depends on theta"):
        crosscheck(small("disk", initial="0.8 + 0.01*cos(theta)"))


# -- Any two results --------------------------------------------------------------------------------------------------------


@cache
def small(kind: str, formulation: str = "lagrangian", dimension: str = "2d", cells: int = 8, initial: Any = 0.8, **tissue: Any) -> Result:
    from tumour.parameters import TumourInitial

    geometry = {"kind": kind, "formulation": formulation, "dimension": dimension}
    parameters = replace(PAPER, **tissue)
    return simulate(parameters, initial=TumourInitial(alpha=initial), t_end=6.0, geometry=geometry, cells=cells, save_at=[3.0], rtol=1e-4)


def names(found: Comparison, kind: str = "field") -> list[str]:
    return [entry.name for entry in found.differences if entry.kind == kind]


def test_a_disk_against_the_radial_solution() -> None:
    """Through the command's own function: the same numbers as the cross-check, over the largest value of all times."""
    a, b = plane("quarter_disk", 12), radial()
    found, check = compare(a, b), checks("quarter_disk")[1]
    assert names(found) == list(a.fields)
    assert not found.refusals
    for name in ("alpha", "C", "p", "displacement"):
        entry = next(entry for entry in found.differences if entry.name == name)
        assert entry.max_abs == pytest.approx(np.max(np.abs(check.plane[name] - check.radial[name])), rel=1e-12)
        scattered = next(entry for entry in found.scatter if entry.name == name)
        assert scattered.rms == pytest.approx(check.rms[name].max(), rel=1e-12)
        assert scattered.max_abs == pytest.approx(check.largest[name].max(), rel=1e-12)
        assert scattered.side == "A"
    assert (found.cells, found.place) == (10, "R/R_0")
    assert {entry.side for entry in compare(b, a).scatter} == {"B"}
    assert compare(b, a).worst == pytest.approx(found.worst, rel=1e-12)
    # doubling_time is nan in one at t = 0, where nothing grows: it has no say.
    assert found.worst < 0.1
    assert "doubling_time has no say" in found.table()


def test_only_common_times_are_compared() -> None:
    """One result has stored more: the same rows of both."""
    rows = [0, 2, 3]

    def some(result: Result) -> Result:
        data = {kind: {name: values[rows] for name, values in getattr(result, kind).items()} for kind in ("scalars", "fields")}
        return replace(result, t=result.t[rows], x=None if result.x is None else result.x[rows], **data)

    a, b = plane("disk", 12), radial()
    whole = compare(a, b)
    for found in (compare(some(a), b), compare(a, some(b))):
        assert found.times == (0.0, 40.0, 50.0)
        for one, other in zip((*found.differences, *found.scatter), (*whole.differences, *whole.scatter), strict=True):
            if one.physical:
                courses = np.array(one.course) * one.scale, np.array(other.course)[rows] * other.scale
                np.testing.assert_allclose(*courses, rtol=1e-9, atol=1e-12)


def test_a_part_of_a_disk_is_compared_by_its_share() -> None:
    quarter, whole = small("quarter_disk", dimension="radial"), small("disk", dimension="radial")
    found = compare(quarter, whole)
    assert found.worst < 1e-12  # the same equations, and areas that are divided by another power of two
    assert any(note.startswith("area, cell_mass: of the whole body (0.25 of it is computed in A, 1 in B)") for note in found.notes)
    found = compare(small("quarter_disk"), small("disk"))
    assert names(found) == ["alpha", "C", "p", "displacement", "J", "stress_magnitude"]
    assert {entry.side for entry in found.scatter} == {"A", "B"}
    area = next(entry for entry in found.differences if entry.name == "area")
    assert area.relative_to_scale < 1e-2


def test_elastic_cells_are_followed() -> None:
    """Cells of two numbers: where they were at rest, whatever they have grown to since."""
    a, b = small("sphere", dimension="auto", cells=40), small("sphere", dimension="auto", cells=120)
    found = compare(a, b)
    assert (found.cells, found.place) == (40, "R/R_0")
    J = next(entry for entry in found.differences if entry.name == "J")
    assert [place for place, _ in J.along] == pytest.approx((np.arange(40) + 0.5) / 40)
    at = (np.arange(120) + 0.5) / 120
    expected = np.abs(a["J"] - np.array([np.interp((np.arange(40) + 0.5) / 40, at, row) for row in b["J"]])).max()
    assert J.max_abs == pytest.approx(expected, rel=1e-12)
    assert "at R/R_0" in found.table()
    viscous = [small("disk", "eulerian", "auto", cells) for cells in (40, 120)]
    assert compare(*viscous).place == "x/width"
    assert "at x/width" in compare(*viscous).table()


def test_bodies_of_different_dimension() -> None:
    found = compare(small("disk", dimension="radial"), small("sphere", dimension="auto"))
    assert "bodies of different dimension: area in A, volume in B; cell_mass is an integral over it" in found.notes
    assert any(note.startswith("different bodies: fields are compared at equal R/R_0") for note in found.notes)
    assert "area" in found.only_a
    assert "volume" in found.only_b


def test_two_materials_are_compared_by_scalars_alone() -> None:
    for a, b in (("disk", "disk"), ("quarter_disk", "disk")):
        found = compare(small(a), small(b, "eulerian", "auto"))
        assert names(found) == []
        assert "radius" in names(found, "scalar")
        assert any("A is of elastic cells, B of viscous cells, which are two materials" in note for note in found.notes)
    assert names(compare(small("disk", dimension="radial"), small("disk", "eulerian", "auto"))) == []


def test_a_body_that_is_not_round_has_no_rings() -> None:
    found = compare(small("glioma", dimension="auto", cells=4), small("disk", dimension="radial"))
    assert names(found) == []
    assert "fields are not compared: A is on a mesh, B is not (A: a body with lobes; B: a disk)" in found.notes


@pytest.mark.parametrize(
    ("data", "why"),
    [
        ({"initial": "0.8 + 0.01*cos(2*theta)"}, "A: its initial alpha depends on theta, so that it is not radial"),
        ({"stiffness": "1 + 0.2*x"}, "A: it has tissue that the radial equations have not: stiffness"),
        ({"fibre_ratio": 1.5}, "A: it has tissue that the radial equations have not: fibre_ratio"),
    ],
)
def test_data_that_are_not_radial_are_no_agreement(data: dict[str, Any], why: str) -> None:
    """Whatever the tolerance."""
    found = compare(small("disk", **data), small("disk", dimension="radial"))
    assert found.refusals[0] == why  # with fibres, the disk has lost its shape besides
    assert found.exceeds(1e9)
    assert f"no agreement is claimed: {why}" in found.table()
    check = crosscheck(small("disk", **data), small("disk", dimension="radial"))
    assert not check.agrees(1e9)
    assert why.removeprefix("A: ") in check.table()


def test_parts_of_the_surface_are_no_agreement() -> None:
    part = {"left": {"where": "x < -0.5", "C": 0.95}}
    a = simulate(PAPER, boundary=part, t_end=3.0, geometry={"kind": "disk", "dimension": "2d"}, cells=6, save_at=[3.0])
    assert compare(small("disk", dimension="radial"), a).refusals[:1] == ("B: parts of its surface differ from the rest: left",)
    assert compare(a, replace(a, checkpoint={})).refusals == ()  # on one mesh nothing is averaged


def test_a_disk_that_has_lost_its_shape_is_no_agreement() -> None:
    """Only where it has within the times that are compared."""
    a, b = small("disk"), small("disk", dimension="radial")
    buckled = replace(a, scalars=a.scalars | {"asymmetry": np.array([0.0, 1e-3, 0.03])})
    assert compare(buckled, b).refusals == (
        "A: its asymmetry is 0.03, which no error of a mesh explains: the disk has lost its round shape",
    )
    uneven = replace(a, scalars=a.scalars | {"asymmetry": np.array([0.03, 1e-3, 0.0])})
    assert compare(uneven, b).refusals == ()  # at t = 0 it is one of the mesh
    earlier = {kind: {name: values[:2] for name, values in getattr(b, kind).items()} for kind in ("scalars", "fields")}
    assert compare(buckled, replace(b, t=b.t[:2], x=b.x[:2], **earlier)).refusals == ()


def test_results_in_units_and_without_a_scene() -> None:
    """Relative numbers do not change with the units; what no scene says of itself is compared by its scalars."""
    scales = {"length": {"value": 100.0, "unit": "µm"}, "time": {"value": 2.0, "unit": "d"}}
    options: dict[str, Any] = {"t_end": 3.0, "save_at": [3.0], "scales": scales}
    a = simulate(PAPER, geometry={"kind": "disk", "dimension": "2d"}, cells=6, **options)
    b = simulate(PAPER, geometry="disk", **options)
    plain, scaled = compare(a, b), compare(a.in_units(), b.in_units())
    for one, other in zip((*plain.differences, *plain.scatter), (*scaled.differences, *scaled.scatter), strict=True):
        if one.physical:
            assert other.relative_to_scale == pytest.approx(one.relative_to_scale, rel=1e-6, abs=1e-12)
    assert profiles_of(replace(a, scene="")) is None
    assert names(compare(replace(a, scene=""), b)) == []


@pytest.mark.parametrize("wrong", ["not round", "viscous", "swapped", "times"])
def test_what_cannot_be_checked(wrong: str) -> None:
    a, b = small("disk"), small("disk", dimension="radial")
    if wrong == "not round":
        a = small("glioma", dimension="auto", cells=4)
    if wrong == "viscous":
        b = small("disk", "eulerian", "auto")
    if wrong == "swapped":
        a, b = b, a
    if wrong == "times":
        b = replace(b, t=b.t * 1.5)
    with pytest.raises(ParameterError, match=r"no result of|no common time"):
        crosscheck(a, b)


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    small("disk").save("a.h5")
    small("disk", dimension="radial").save("b.h5")
    small("disk", initial="0.8 + 0.01*cos(2*theta)").save("c.h5")
    assert main(["compare", "a.h5", "b.h5", "--tol", "0.1", "-o", "a.png"]) == 0
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")
    assert "scatter round the rings" in capsys.readouterr().out
    assert main(["compare", "a.h5", "b.h5", "--tol", "1e-6"]) == 1
    assert main(["compare", "c.h5", "b.h5"]) == 1
    assert "no agreement is claimed: A: its initial alpha depends on theta" in capsys.readouterr().out
    assert main(["compare", "c.h5", "b.h5", "--json", "-o", "c.png"]) == 1
    text = capsys.readouterr().out
    assert json.loads(text)["refusals"]
    assert Comparison.from_json(text) == compare(small("disk", initial="0.8 + 0.01*cos(2*theta)"), small("disk", dimension="radial"))
