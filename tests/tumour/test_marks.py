"""What pictures are told of a tumour's tissue and surface: fibres, properties at rest, named parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from multiphase import Result, load
from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.plotting import figure, view_of
from multiphase.run import make_scene
from multiphase.scales import Scales
from tumour import TumourGeometry, TumourInitial, TumourParameters, simulate
from tumour.boundary import BoundaryPart, TumourBoundary
from tumour.fem.bodies import body_of
from tumour.fem.surface import Surface
from tumour.marks import marks_of, words_of
from tumour.meshes import Body, disk
from tumour.model import MODEL

SCALES = {"length": {"value": 0.5, "unit": "mm"}, "time": {"value": 2.0, "unit": "d"}, "pressure": {"value": 3.0, "unit": "kPa"}}
DISK = TumourGeometry(kind="disk", dimension="2d", radius=2.0)
CLAMP = {"displacement_x": 0.0, "displacement_y": 0.0}


def result_of(geometry: TumourGeometry = DISK, boundary: Any = None, alpha: Any = 0.8, scales: Any = None, **changes: Any) -> Result:
    """A scene's body at two times, at rest, without a run."""
    scene = make_scene(
        MODEL, TumourParameters(**changes), initial=TumourInitial(alpha=alpha), geometry=geometry, boundary=boundary, t_end=1.0, title="",
        scales=scales, solver={"cells": 6},
    )  # fmt: skip
    mesh = body_of(geometry, 6).mesh
    points = mesh.p.shape[1]
    fields = {"alpha": np.full((2, points), 0.8), "displacement": np.zeros((2, points, 2))}
    return Result(model="tumour", t=np.array([0.0, 1.0]), mesh=Mesh(mesh.p.T, mesh.t.T), fields=fields, scene=scene.to_toml())


def coordinates(result: Result) -> tuple[np.ndarray, np.ndarray]:
    assert result.mesh is not None
    x, y = result.mesh.points.T
    return x, y


def is_empty(result: Result) -> bool:
    marks = marks_of(result)
    return marks.directions is None and not marks.parts and not marks.properties


# -- nothing ----------------------------------------------------------------------------------------------------------


def test_plain_scenes_have_no_marks() -> None:
    assert is_empty(result_of())
    assert is_empty(result_of(fibre_angle=0.7, fibre_ratio="1 + 0*x"))  # fibres that do nothing
    assert is_empty(result_of(stiffness=2.0, consumption=0.5, permeability=3.0, alpha=0.7))  # the same everywhere
    assert is_empty(result_of(stiffness="2 + 0*x", permeability={"along": 3.0, "across": 3.0}, alpha="0.7 + 0*x"))
    assert is_empty(simulate(t_end=0.1, cells=5))
    panels = [axes.get_title(loc="left") for axes in figure(result_of()).get_axes()]
    assert panels[0] == "Cell fraction on the growing body"


def test_scenes_that_cannot_be_read_have_no_marks() -> None:
    result = result_of(stiffness="1 + x**2", boundary={"bone": {"where": "y < -1", **CLAMP}})
    assert not is_empty(result)
    for scene in ("", '[scene]\nmodel = "tumour"\n', result.scene.replace("stiffness", "softness"), result.scene.replace("disk", "torus")):
        result.scene = scene
        assert is_empty(result)


# -- tissue -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes", [{"fibre_ratio": 2.0}, {"fibre_stiffness": "0.1*(x > 0)"}, {"permeability": {"along": 2.0, "across": "1 + r"}}]
)
def test_directions_are_those_of_the_fibres(changes: dict[str, Any]) -> None:
    result = result_of(fibre_angle="theta/2 + 0.1*xi", **changes)
    x, y = coordinates(result)
    angle = np.arctan2(y, x) / 2.0 + 0.05 * np.hypot(x, y)
    found = marks_of(result).directions
    assert found is not None
    np.testing.assert_allclose(found, np.column_stack([np.cos(angle), np.sin(angle)]), atol=1e-14)


@pytest.mark.parametrize(
    ("name", "label"),
    [("stiffness", "$m$"), ("consumption", "$w$"), ("fibre_ratio", r"$\rho$"), ("fibre_stiffness", "$k_f$"), ("alpha", r"$\alpha$")],
)
def test_properties_that_vary(name: str, label: str) -> None:
    result = result_of(**{name: "0.5 + 0.1*x*y"})
    x, y = coordinates(result)
    ((key, shown),) = marks_of(result).properties.items()
    assert key == name
    assert shown.label.endswith(label)
    np.testing.assert_allclose(shown.values, 0.5 + 0.1 * x * y, rtol=1e-14)
    assert shown.directions is None
    titles = [axes.get_title(loc="left") for axes in figure(result).get_axes()]
    assert titles[0] == "Tissue at rest"


def test_tensors_are_shown_by_their_mean_and_larger_direction() -> None:
    result = result_of(
        permeability={"along": "3 + y", "across": 0.5}, diffusivity={"xx": 2.0, "yy": 1.0, "xy": 0.5}, fibre_angle="0.3*x"
    )  # fmt: skip
    x, y = coordinates(result)
    K, D = marks_of(result).properties.values()
    assert (K.label, D.label) == ("permeability $K$, mean", "diffusivity $D$, mean")
    np.testing.assert_allclose(K.values, 0.5 * (3.5 + y))
    assert K.directions is not None
    assert D.directions is not None
    np.testing.assert_allclose(np.abs(np.cos(0.3 * x) * K.directions[:, 0] + np.sin(0.3 * x) * K.directions[:, 1]), 1.0)
    np.testing.assert_allclose(D.values, 1.5)
    # of [[2, 1/2], [1/2, 1]] the larger principal value is 3/2 + 1/sqrt(2), along (1/2, 1/sqrt(2) - 1/2)
    wanted = np.array([0.5, np.sqrt(0.5) - 0.5]) / np.hypot(0.5, np.sqrt(0.5) - 0.5)
    np.testing.assert_allclose(np.abs(D.directions @ wanted), 1.0)


def test_tensors_without_a_direction() -> None:
    result = result_of(permeability="1 + r", diffusivity={"xx": "1 + (x > 0)", "yy": 1.0})
    x, y = coordinates(result)
    K, D = marks_of(result).properties.values()
    assert K.label == "permeability $K$"
    assert K.directions is None
    np.testing.assert_allclose(K.values, 1.0 + np.hypot(x, y))
    assert D.directions is not None
    np.testing.assert_array_equal(np.isnan(D.directions[:, 0]), x <= 0.0)
    np.testing.assert_allclose(np.abs(D.directions[x > 0.0, 0]), 1.0)


def test_a_property_that_ends_before_the_body_leaves_the_others() -> None:
    """The points of integration lie within a grid that the corners of triangles may be beyond."""
    result = result_of(stiffness="1 + 0.1*x", consumption="1 + y**2")
    grid = "stiffness = { pixel = 1.99, values = [[1.0, 2.0], [2.0, 1.0]] }"
    result.scene = result.scene.replace('stiffness = "1 + 0.1*x"', grid)
    assert grid in result.scene
    assert set(marks_of(result).properties) == {"consumption"}


# -- surface ----------------------------------------------------------------------------------------------------------


def circle(x: float, radius: float) -> list[list[float]]:
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return np.column_stack([x + radius * np.cos(angle), radius * np.sin(angle)]).tolist()


WITH_HOLES = TumourGeometry(
    kind="outline", points=[[-2, -1], [2, -1], [2, 1], [-2, 1]], holes=[circle(-1.0, 0.4), circle(1.0, 0.4), circle(0.0, 0.3)]
)
BODIES = {
    "disk": (DISK, {"low": {"where": "y < -0.5"}, "high": {"side": "surface", "where": "theta > 1"}}),
    "quarter disk": (
        TumourGeometry(kind="quarter_disk", dimension="2d", radius=0.7),
        {"all": {"side": "surface", "where": "x <= 0.4"}, "rest": {"where": "x > 0.4"}},
    ),
    "glioma": (TumourGeometry(kind="glioma", radius=0.39), {"far": {"where": "xi > 1.2"}, "near": {"where": "r <= 0.4"}}),
    "outline": (
        WITH_HOLES,
        {"outer": {"side": "outer"}, "a": {"side": "hole 1"}, "b": {"side": "hole 2", "where": "y < 0"}, "c": {"side": "hole 3"}},
    ),
}  # fmt: skip


def ends(edges: np.ndarray) -> set[tuple[int, int]]:
    return {(int(a), int(b)) for a, b in edges}


def wanted(body: Body, boundary: dict[str, Any]) -> dict[str, set[tuple[int, int]]]:
    """The edges of the parts as the scheme has them."""
    surface = Surface(body, TumourBoundary.from_table(boundary), TumourParameters())
    return {part.name: ends(body.edges[numbers]) for part, numbers in zip(surface.parts, surface.numbers, strict=True)}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("in_units", [False, True])
def test_parts_are_the_edges_that_the_scheme_has(name: str, in_units: bool) -> None:
    geometry, boundary = BODIES[name]
    boundary = {key: {**part, "spring": 1.0} for key, part in boundary.items()}
    result = result_of(geometry, boundary, scales=SCALES)
    parts = marks_of(result.in_units() if in_units else result).parts
    assert {key: ends(part.edges) for key, part in parts.items()} == wanted(body_of(geometry, 6), boundary)
    assert {part.words for part in parts.values()} == {"spring 6 kPa/mm"}


def test_xi_in_a_body_with_a_size_of_its_own() -> None:
    """Its radius is that of the largest circle within, which the mesh tells to 1 %."""
    result = result_of(WITH_HOLES, stiffness="1 + xi")
    x, y = coordinates(result)
    (shown,) = marks_of(result).properties.values()
    np.testing.assert_allclose(shown.values - 1.0, np.hypot(x, y) / body_of(WITH_HOLES, 6).radius, rtol=0.01)


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    """A disk of radius 1 whose upper half is called "top"."""
    meshio = pytest.importorskip("meshio")
    body = disk(1.0, 6)
    top = body.edges[body.mesh.p.T[body.edges].mean(axis=1)[:, 1] > 0.0]
    points = np.column_stack([body.mesh.p.T, np.zeros(body.mesh.p.shape[1])])
    tags = [np.ones(len(top), dtype=int), np.full(body.mesh.t.shape[1], 2)]
    mesh = meshio.Mesh(
        points, [("line", top), ("triangle", body.mesh.t.T)], cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"top": np.array([1, 1])},
    )  # fmt: skip
    meshio.write(tmp_path / "body.msh", mesh, file_format="gmsh22", binary=False)
    return tmp_path / "body.msh"


def test_physical_lines_while_the_file_is_there(mesh_file: Path) -> None:
    geometry = TumourGeometry(kind="mesh", file=str(mesh_file))
    boundary = {"lid": {"side": "top", "spring": 1.0}, "low": {"where": "y < -0.5", "p": "closed"}}
    result = result_of(geometry, boundary)
    there = {key: ends(part.edges) for key, part in marks_of(result).parts.items()}
    assert there == wanted(body_of(geometry, 6), boundary)
    mesh_file.rename(mesh_file.with_name("moved.msh"))
    assert {key: ends(part.edges) for key, part in marks_of(result).parts.items()} == {"low": there["low"]}
    mesh_file.write_text("another file\n", encoding="utf-8")
    assert list(marks_of(result).parts) == ["low"]
    figure(result)


def test_another_mesh_in_the_file_gives_no_parts(mesh_file: Path) -> None:
    result = result_of(TumourGeometry(kind="mesh", file=str(mesh_file)), {"lid": {"side": "top", "spring": 1.0}})
    assert result.mesh is not None
    result.mesh = Mesh(1.1 * result.mesh.points, result.mesh.triangles)
    assert not marks_of(result).parts


STEP = {"times": [0.0, 1.0], "values": [0.0, 2.0]}


@pytest.mark.parametrize(
    ("part", "words", "in_units"),
    [
        ({}, "", ""),
        (CLAMP, "clamped", "clamped"),
        ({"displacement_x": 0}, "held in x", "held in x"),
        ({"displacement_y": STEP, "displacement_x": 0}, "held in x, d_y = 0 to 2", "held in x, d_y = 0 to 1 mm"),
        ({"load": 0.5, "traction_y": -1}, "load 0.5, traction y -1", "load 1.5 kPa, traction y -3 kPa"),
        ({"spring": 2, "spring_normal": 1}, "spring 2, spring along the normal 1", "spring 12 kPa/mm, spring along the normal 6 kPa/mm"),
        ({"p": "closed", "C": "closed"}, "no flow, no oxygen", "no flow, no oxygen"),
        ({"p": 0.5, "C": 0.5}, "p = 0.5, C = 0.5", "p = 1.5 kPa, C = 0.5"),
        ({"C": "closed", "influx": 1.0}, "oxygen influx", "oxygen influx"),
        ({"membrane": 2.0, "C": STEP}, "membrane to C = 0 to 2", "membrane to C = 0 to 2"),
        ({"membrane": 2.0}, "membrane", "membrane"),
    ],
)
def test_words_of_a_part(part: dict[str, Any], words: str, in_units: str) -> None:
    given = BoundaryPart(name="bone", side="surface", **part)
    assert words_of(given) == words
    assert words_of(given, Scales.from_table(SCALES)) == in_units


# -- in a run and its pictures ----------------------------------------------------------------------------------------


def test_a_run_with_everything_is_drawn(tmp_path: Path) -> None:
    parameters = TumourParameters(lambda_alpha=1.0, stiffness="1 + 0.2*x", fibre_stiffness="0.1 + 0.05*y", fibre_ratio=1.5, fibre_angle=0.4)
    boundary = {"bone": {"where": "y < -0.5", **CLAMP, "p": "closed", "C": "closed"}}
    result = simulate(
        parameters, geometry={"kind": "disk", "dimension": "2d"}, boundary=boundary, cells=5, t_end=0.5, save_every=0.25, scales=SCALES
    )
    result.save(tmp_path / "a.h5")
    marks = view_of(load(tmp_path / "a.h5")).marks
    assert list(marks.properties) == ["stiffness", "fibre_stiffness"]
    k_f = marks.properties["fibre_stiffness"]
    assert k_f.label == "fibre stiffness $k_f$ [kPa]"
    np.testing.assert_allclose(k_f.values, 3.0 * (0.1 + 0.05 * coordinates(result)[1]))
    picture = figure(result.in_units())
    texts = [text.get_text() for text in picture.subfigs[0].legends[0].get_texts()]
    assert texts == ["outline at rest", "at t = 1 d", "fibres", "bone: clamped, no flow, no oxygen"]
    picture.draw_without_rendering()


def test_a_part_that_cannot_be_found_leaves_the_picture() -> None:
    """As of a result whose scene was changed by hand."""
    result = result_of(boundary={"bone": {"where": "y < -0.5", **CLAMP}})
    result.scene = result.scene.replace('"y < -0.5"', '"1/(y - y)"')
    assert is_empty(result)
    with pytest.raises(ParameterError):
        TumourBoundary.from_table({"bone": {"where": "1/(y - y)"}}).parts[0].formula(x=0.0, y=0.0, r=0.0, theta=0.0, xi=0.0)
