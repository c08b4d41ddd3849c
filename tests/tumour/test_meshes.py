"""Meshes of two-dimensional bodies: shapes and numbers known in advance, and every refusal."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.path import Path as Curve
from scipy.spatial import Delaunay

from multiphase.errors import ParameterError
from tumour.meshes import Body, check, disk, from_gmsh, glioma, glioma_outline, outline, quarter_disk
from tumour.meshes.body import boundary_edges, doubled_areas

AUTHORS = Path(__file__).parents[3] / "shared" / "reference" / "quarter_disk_authors.msh"

NEEDS_MESHIO = pytest.mark.skipif(importlib.util.find_spec("meshio") is None, reason="meshio is not installed")

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
FAN = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])
SQUARE_NODES = np.vstack((SQUARE, [(0.5, 0.5)]))


def points_of(body: Body) -> np.ndarray:
    return np.asarray(body.mesh.p.T)


def triangles_of(body: Body) -> np.ndarray:
    return np.asarray(body.mesh.t.T)


def mesh_area(body: Body) -> float:
    return float(doubled_areas(points_of(body), triangles_of(body)).sum() / 2.0)


def assert_sound(body: Body) -> None:
    """What holds for every body: counterclockwise, whole, its surface on the boundary, its quality as measured."""
    points, triangles = points_of(body), triangles_of(body)
    corner = points[triangles]
    assert (doubled_areas(points, triangles) > 0.0).all()
    assert len(np.unique(triangles)) == len(points) == body.quality.nodes
    assert len(triangles) == body.quality.triangles
    edges = boundary_edges(triangles)
    outer = np.unique(edges)
    assert np.isin(body.surface, outer).all()
    assert np.array_equal(np.unique(np.concatenate((body.surface, body.slide_x, body.slide_y))), outer)
    # Euler: a body without holes has nodes - edges + triangles = 1
    assert len(points) - (3 * len(triangles) + len(edges)) / 2 + len(triangles) == 1
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    a, b, c = np.sort(sides, axis=1).T
    least = np.degrees(np.arccos((b**2 + c**2 - a**2) / (2.0 * b * c))).min()
    assert body.quality.least_angle == pytest.approx(least, abs=1e-5)
    assert body.quality.largest_ratio == pytest.approx((c**2 / doubled_areas(points, triangles)).max())
    assert (body.quality.h_min, body.quality.h_max) == (pytest.approx(sides.min()), pytest.approx(sides.max()))
    assert np.hypot(*(points - body.quality.least_angle_at).T).min() == 0.0


# disks


@pytest.mark.parametrize("rings", [1, 2, 7])
def test_numbers_of_disks(rings: int) -> None:
    quarter, whole = quarter_disk(2.0, rings), disk(2.0, rings)
    assert_sound(quarter)
    assert_sound(whole)
    assert quarter.quality.nodes == (rings + 1) ** 2
    assert quarter.quality.triangles == 2 * rings**2
    assert len(quarter.surface) == 2 * rings + 1
    assert len(quarter.slide_x) == len(quarter.slide_y) == rings + 1
    assert whole.quality.nodes == 1 + 3 * rings * (rings + 1)
    assert whole.quality.triangles == 6 * rings**2
    assert len(whole.surface) == 6 * rings
    assert len(whole.slide_x) == len(whole.slide_y) == 0
    assert (quarter.radius, whole.radius, quarter.is_round, whole.is_round) == (2.0, 2.0, True, True)
    assert (quarter.area, whole.area) == (pytest.approx(np.pi), pytest.approx(4.0 * np.pi))
    for body in (quarter, whole):
        r = np.hypot(*points_of(body).T)
        np.testing.assert_allclose(r[body.surface], 2.0, rtol=1e-14)
        np.testing.assert_allclose(np.unique(np.round(r, 10)), np.round(2.0 * np.arange(rings + 1) / rings, 10))


@pytest.mark.parametrize("make", [disk, quarter_disk])
def test_area_of_disks_converges_at_second_order(make) -> None:
    errors = [1.0 - mesh_area(body) / body.area for body in (make(3.0, n) for n in (10, 20, 40))]
    assert errors[0] > 0.0
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.02)
    assert make(3.0, 40).quality.least_angle > 38.0


def test_quarter_disk_slides_on_its_straight_sides() -> None:
    body = quarter_disk(1.5, 6)
    x, y = points_of(body).T
    assert np.array_equal(body.slide_x, np.flatnonzero(x == 0.0))
    assert np.array_equal(body.slide_y, np.flatnonzero(y == 0.0))
    assert len(np.intersect1d(body.surface, body.slide_x)) == len(np.intersect1d(body.surface, body.slide_y)) == 1
    assert len(np.intersect1d(body.slide_x, body.slide_y)) == 1


def test_quarter_disk_is_its_own_mirror_image() -> None:
    body = quarter_disk(1.0, 9)
    points, triangles = points_of(body), triangles_of(body)
    numbers = {tuple(point): k for k, point in enumerate(points)}
    mirror = np.array([numbers[y, x] for x, y in points])  # to the last bit
    assert {frozenset(t) for t in mirror[triangles]} == {frozenset(t) for t in triangles}


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf, "wide"])
def test_disks_refuse_a_radius(radius) -> None:
    for make in (disk, quarter_disk):
        with pytest.raises(ParameterError, match=r"geometry\.radius: .* must be a finite number"):
            make(radius, 4)


@pytest.mark.parametrize("rings", [0, -3, 2.5, True, 10**7])
def test_disks_refuse_a_number_of_rings(rings) -> None:
    for make in (disk, quarter_disk):
        with pytest.raises(ParameterError, match=r"geometry\.rings: .* must be a whole number from 1"):
            make(1.0, rings)


# the glioma


def largest_circle(polygon: np.ndarray) -> float:
    """Radius of the largest circle within: it touches the outline at three points, so it is one around a triangle of Delaunay's."""
    a, b, c = np.swapaxes(polygon[Delaunay(polygon).simplices], 0, 1)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    centre = np.column_stack((cy * (bx**2 + by**2) - by * (cx**2 + cy**2), bx * (cx**2 + cy**2) - cx * (bx**2 + by**2)))
    centre /= 2.0 * doubled[:, None]
    return float(np.hypot(*centre[Curve(polygon).contains_points(a + centre)].T).max())


@pytest.mark.parametrize("radius", [0.4, 3.0])
def test_glioma_has_the_inscribed_radius_asked_for(radius: float) -> None:
    assert largest_circle(glioma_outline(radius, 4000)) == pytest.approx(radius, rel=1e-4)
    assert outline(glioma_outline(radius, 3000), radius / 5.0).radius == pytest.approx(radius, rel=1e-5)
    assert glioma(radius, radius / 5.0).radius == radius


def test_glioma_is_on_its_formula_at_any_resolution() -> None:
    coarse, fine = glioma_outline(0.4, 50), glioma_outline(0.4, 5000)
    np.testing.assert_allclose(coarse, fine[::100], rtol=1e-12)
    for size in (0.06, 0.02):
        body = glioma(0.4, size)
        x, y = points_of(body)[body.surface].T
        theta = np.arctan2(y, x)
        waves = ((2, 0.20, 0.6), (3, 0.13, 4.0), (4, 0.12, 2.5), (5, 0.10, 1.3), (7, 0.05, 0.2))
        shape = 1.0 + sum(a * np.cos(k * theta - phase) for k, a, phase in waves)
        factor = np.hypot(x, y) / shape
        np.testing.assert_allclose(factor, fine[0, 0] / (1.0 + sum(a * np.cos(phase) for _, a, phase in waves)), rtol=1e-5)


def test_glioma_has_re_entrant_parts_and_no_symmetry() -> None:
    points = glioma_outline(1.0, 2000)
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    changes = np.count_nonzero(np.diff(np.sign(turn)))
    assert changes >= 8  # four re-entrant parts or more
    r = np.sort(np.hypot(*points.T))
    assert r[-1] > 1.8 * r[0]


def test_area_of_the_glioma_converges_at_second_order() -> None:
    x, y = glioma_outline(0.4, 200_000).T
    exact = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    errors = np.array([abs(glioma(0.4, size).area / exact - 1.0) for size in (0.06, 0.03, 0.015)])
    assert errors[0] < 0.004
    assert (np.log2(errors[:-1] / errors[1:]) > 1.7).all()


@pytest.mark.parametrize("share", [0.2, 0.1, 0.05, 0.03, 0.02])
def test_quality_of_the_glioma(share: float) -> None:
    body = glioma(0.4, 0.4 * share)
    assert_sound(body)
    assert body.quality.least_angle > 30.0
    assert body.quality.pinned == 0
    assert 0.6 < body.quality.h_min / (0.4 * share) < body.quality.h_max / (0.4 * share) < 1.6
    assert body.quality.nodes == pytest.approx(body.area / (np.sqrt(0.75) * (0.4 * share) ** 2), rel=0.12)
    assert not body.is_round


def test_the_same_glioma_twice() -> None:
    one, two = glioma(), glioma()
    assert np.array_equal(one.mesh.p, two.mesh.p)
    assert np.array_equal(one.mesh.t, two.mesh.t)
    assert one.radius == 0.4


# outlines


def test_square_keeps_its_corners() -> None:
    for points in (SQUARE, SQUARE[::-1], np.vstack((SQUARE, SQUARE[:1])), np.roll(SQUARE, 1, axis=0)):
        body = outline(points, 0.11)
        assert_sound(body)
        assert body.area == pytest.approx(1.0, rel=1e-13)
        assert body.radius == pytest.approx(0.5, rel=1e-6)
        assert {(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)} <= {tuple(p) for p in points_of(body)}
        assert body.quality.pinned == 0
        assert body.quality.least_angle > 25.0


def test_radius_of_an_l() -> None:
    body = outline([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 0.13)
    assert body.area == pytest.approx(3.0, rel=1e-13)
    assert body.radius == pytest.approx(2.0 - np.sqrt(2.0), rel=1e-6)  # touches two sides and the re-entrant corner


def test_steps_of_a_segmented_picture_are_smoothed() -> None:
    """A circle in pixels, sampled coarser than they are: no corner of a pixel is kept."""
    n = 20
    x = np.repeat(np.arange(-n, n + 1), 2)[1:-1]
    middle = (np.arange(-n, n) + 0.5).repeat(2)
    top = np.rint(np.sqrt((n + 0.5) ** 2 - middle**2))
    steps = np.vstack((np.column_stack((x, top)), np.column_stack((x, -top))[::-1]))
    steps = steps[(steps != np.roll(steps, 1, axis=0)).any(axis=1)]
    body = outline(steps, 4.0)
    assert_sound(body)
    assert body.area == pytest.approx(np.pi * (n + 0.5) ** 2, rel=0.05)
    assert len(body.surface) == 40  # 160 sides of pixels


def star(seed: int) -> np.ndarray:
    """A smooth star-shaped outline, with narrow parts in some."""
    rng = np.random.default_rng(seed)
    theta = np.linspace(0.0, 2.0 * np.pi, rng.integers(100, 600), endpoint=False)
    r = 1.0 + sum(rng.uniform(0.0, 0.5) / k**0.8 * np.cos(k * theta - rng.uniform(0.0, 7.0)) for k in range(1, rng.integers(3, 9)))
    r += max(0.0, 0.1 - r.min())
    return np.column_stack((r * np.cos(theta), r * np.sin(theta)))


def test_random_outlines_are_filled_well_or_refused() -> None:
    filled = 0
    for seed in range(20):
        try:
            body = outline(star(seed), 0.1)
        except ParameterError as error:
            assert error.path in ("geometry.size", "geometry.points")  # noqa: PT017
            continue
        assert_sound(body)
        assert body.quality.least_angle >= 20.0
        assert body.quality.pinned == 0
        filled += 1
    assert filled >= 15


SLIT_X = np.linspace(0.3, 2.0, 300)
SLIT_Y = 0.5 + 0.1 * np.sin(25.0 * SLIT_X)
SLIT = np.vstack(
    ([(0, 0), (2, 0)], np.column_stack((SLIT_X, SLIT_Y - 0.01))[::-1], np.column_stack((SLIT_X, SLIT_Y + 0.01)), [(2, 1), (0, 1)])
)
DUMBBELL = [(0, 0), (1, 0), (1, 0.47), (1.5, 0.47), (1.5, 0), (2.5, 0), (2.5, 1), (1.5, 1), (1.5, 0.53), (1, 0.53), (1, 1), (0, 1)]


@pytest.mark.parametrize(
    ("points", "size", "message"),
    [
        ([(0, 0), (1, 1), (1, 0), (0, 1)], 0.1, r"geometry\.points: .*crosses .*near \(0\.5, 0\.5\)"),
        ([(0, 0), (2, 0), (2, 1), (1, 0), (0, 1)], 0.1, r"geometry\.points: .*touches itself near"),
        ([(0, 0), (1, 0), (2, 0), (1.5, 0), (1, 1)], 0.1, r"geometry\.points: .*touches itself near"),
        ([(0, 0), (1, 0), (1, 1), (1, 0), (0, 1)], 0.1, r"geometry\.points: the point \(1, 0\) appears 2 times"),
        ([(0, 0), (1, 0)], 0.1, r"geometry\.points: .*three points or more, not 2"),
        ([(0, 0), (1, 0), (0, 0)], 0.1, r"geometry\.points: .*three points or more, not 2"),
        ([(0, 0), (1, 1), (2, 2)], 0.1, r"geometry\.points: all points lie on a line through \(0, 0\)"),
        ([(0, 0), (1, 0), (np.nan, 1)], 0.1, r"geometry\.points: point 3, \(nan, 1\)"),
        ([(0, 0), (1, 0), (1, np.inf)], 0.1, r"geometry\.points: point 3"),
        ([0, 1, 2], 0.1, r"geometry\.points: must have two columns"),
        ([("a", "b")], 0.1, r"geometry\.points: must be numbers"),
        (DUMBBELL, 0.1, r"geometry\.size: 0\.1 is too large near \(1\.\d+, 0\.[45]\d*\)"),
        (SLIT, 0.2, r"geometry\.size: 0\.2 is too large near \(\d\.\d+, 0\.[45]\d+\): two sides of the outline come together"),
        (SQUARE, 2.0, r"geometry\.size: 2 is too large near .*: it leaves fewer than 6 sides"),
        (SQUARE, 1e-5, r"geometry\.size: 1e-05 would make"),
        (SQUARE, 0.0, r"geometry\.size: 0 must be a finite number"),
        ([(0, 0), (1, 0), (1, 0.2)], 0.05, r"geometry\.points: the corner at \(0, 0\) is too sharp, 11\.3 degrees"),
    ],
)
def test_outlines_that_are_refused(points, size: float, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        outline(points, size)


def test_narrow_part_is_filled_with_a_smaller_size() -> None:
    body = outline(DUMBBELL, 0.03)
    assert_sound(body)
    assert body.area == pytest.approx(2.03, rel=1e-12)


# the checks


@pytest.mark.parametrize(
    ("points", "triangles", "message"),
    [
        (SQUARE_NODES, np.empty((0, 3), dtype=int), "has no triangles"),
        (np.vstack((SQUARE, [(0.5, np.nan)])), FAN, "node 5 has a coordinate"),
        (np.vstack((SQUARE_NODES, [(2.0, 2.0)])), FAN, r"node 6 at \(2, 2\) belongs to no triangle"),
        (SQUARE_NODES, FAN[:, ::-1], "triangle 1 with the corners .* is clockwise"),
        (np.vstack((SQUARE, [(0.5, 0.0)])), FAN, r"triangle 1 with the corners \(0, 0\), \(1, 0\), \(0.5, 0\) has no area"),
        (np.vstack((SQUARE, [(0.5, 0.005)])), FAN, r"triangle 1 .*\(0\.5, 0\.005\) is badly shaped: its least angle is 0\.573 degrees"),
        (np.vstack((SQUARE_NODES, [(0.5, -1.0), (0.6, -2.0)])), np.vstack((FAN, [(1, 0, 5), (1, 0, 6)])), "belongs to 3 triangles"),
        (np.vstack((SQUARE, [(0.2, 0.5)])), np.array([(0, 1, 2), (0, 2, 3), (0, 1, 4)]), "two triangles overlap"),
        (np.vstack((SQUARE_NODES, SQUARE_NODES + 3.0)), np.vstack((FAN, FAN[:3] + 5)), r"2 parts .* 57\.1 %, 42\.9 %"),
        (
            np.vstack((SQUARE_NODES, SQUARE_NODES[1:] + 1.0)),
            np.vstack((FAN, [(2, 5, 8), (5, 6, 8), (6, 7, 8), (7, 2, 8)])),
            "single node, 3 at",
        ),
        (np.vstack((SQUARE_NODES, SQUARE_NODES + 0.4)), np.vstack((FAN, FAN + 5)), "2 parts"),
    ],
)
def test_meshes_that_are_refused(points, triangles, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        check(points, triangles, "geometry.file")
    assert caught.value.path == "geometry.file"


def test_a_crack_and_a_node_amid_a_side_are_refused() -> None:
    doubled = np.vstack((SQUARE_NODES, SQUARE_NODES[[1]]))  # corner 1 twice: the sides from it to the middle lie on each other
    with pytest.raises(ParameterError, match="crosses or touches itself near"):
        check(doubled, np.array([(0, 1, 4), (5, 2, 4), (2, 3, 4), (3, 0, 4)]), "geometry.file")
    # node 2 is amid the side 0-1 of the triangle above, up to rounding; then above, below, left and right of that side
    hanging = np.array([(0.0, 0.0), (1.8, 0.6), (0.9, np.nextafter(0.3, 1.0)), (0.6, 1.2), (1.2, -0.6), (-1.0, 0.0), (3.0, 0.5)])
    triangles = np.array([(0, 1, 3), (0, 4, 2), (2, 4, 1), (5, 0, 3), (5, 4, 0), (6, 3, 1), (6, 1, 4)])
    with pytest.raises(ParameterError, match="crosses or touches itself near"):
        check(hanging, triangles, "geometry.file")


def test_triangles_twice_round_a_node_are_refused() -> None:
    angle = 4.0 * np.pi * np.arange(10) / 10
    around = np.column_stack((np.cos(angle), np.sin(angle))) * np.linspace(1.0, 1.1, 10)[:, None]
    k = np.arange(10)
    fan = np.column_stack((np.full(10, 10), k, (k + 1) % 10))
    with pytest.raises(ParameterError, match=r"the angles around node 11 at .* sum up to 720 degrees"):
        check(np.vstack((around, [(0.0, 0.0)])), fan, "geometry.file")


# Gmsh files


def write_gmsh(
    path: Path, points: np.ndarray, triangles: np.ndarray, lines: Sequence[tuple[int, int, int]] = (), names: dict[int, str] | None = None
) -> Path:
    """A file in format 2.2: lines are (physical group, node, node), nodes numbered from 0."""
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        text += ["$PhysicalNames", str(len(names)), *(f'1 {tag} "{name}"' for tag, name in names.items()), "$EndPhysicalNames"]
    full = np.column_stack((points, np.zeros(len(points)))) if points.shape[1] == 2 else points
    text += ["$Nodes", str(len(full)), *(f"{k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(full.tolist(), 1)), "$EndNodes"]
    elements = [f"1 2 {tag} {tag} {a + 1} {b + 1}" for tag, a, b in lines]
    elements += [f"2 2 50 50 {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    text += ["$Elements", str(len(elements)), *(f"{k} {line}" for k, line in enumerate(elements, 1)), "$EndElements"]
    path.write_text("\n".join(text) + "\n")
    return path


SQUARE_LINES = [(31, 0, 1), (32, 1, 2), (32, 2, 3), (33, 3, 0)]
SQUARE_NAMES = {31: "bottom", 32: "free", 33: "left"}


@NEEDS_MESHIO
@pytest.mark.parametrize("named", [False, True])
def test_gmsh_sides_by_name_and_by_number(tmp_path: Path, named: bool) -> None:
    file = write_gmsh(tmp_path / "square.msh", SQUARE_NODES, FAN, SQUARE_LINES, SQUARE_NAMES if named else None)
    body = from_gmsh(file, slide_x=["left" if named else "33"], slide_y=["bottom" if named else "31"])
    assert_sound(body)
    assert body.slide_x.tolist() == [0, 3]
    assert body.slide_y.tolist() == [0, 1]
    assert body.surface.tolist() == [1, 2, 3]
    assert body.radius == pytest.approx(1.0, rel=1e-6)  # from the corner where the sliding sides meet
    assert (body.area, body.is_round) == (1.0, False)
    free = from_gmsh(str(file))
    assert free.surface.tolist() == [0, 1, 2, 3]
    assert free.radius == pytest.approx(0.5, rel=1e-6)


@NEEDS_MESHIO
def test_gmsh_format_4_1(tmp_path: Path) -> None:
    (tmp_path / "square.msh").write_text("""$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
1 7 "left"
2 9 "body"
$EndPhysicalNames
$Entities
0 2 1 0
1 0 0 0 0 1 0 1 7 0
2 0 0 0 1 1 0 0 0
1 0 0 0 1 1 0 1 9 0
$EndEntities
$Nodes
1 5 1 5
2 1 0 5
1
2
3
4
5
0 0 0
1 0 0
1 1 0
0 1 0
0.5 0.5 0
$EndNodes
$Elements
2 5 1 5
1 1 1 1
1 4 1
2 1 2 4
2 1 2 5
3 2 3 5
4 3 4 5
5 4 1 5
$EndElements
""")
    body = from_gmsh(tmp_path / "square.msh", slide_x=["left"])
    assert_sound(body)
    assert body.slide_x.tolist() == [0, 3]
    assert body.area == 1.0


@NEEDS_MESHIO
@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("form", ["gmsh22", "gmsh"])
def test_gmsh_files_in_every_format(tmp_path: Path, form: str, binary: bool) -> None:
    import meshio

    body = quarter_disk(1.0, 5)
    points = np.column_stack((points_of(body), np.zeros(36)))
    meshio.write(tmp_path / "a.msh", meshio.Mesh(points, [("triangle", triangles_of(body))]), file_format=form, binary=binary)
    read = from_gmsh(tmp_path / "a.msh")
    np.testing.assert_allclose(read.mesh.p, body.mesh.p, atol=1e-15)
    assert np.array_equal(read.mesh.t, body.mesh.t)


@NEEDS_MESHIO
def test_clockwise_and_mixed_triangles_are_turned(tmp_path: Path) -> None:
    straight = from_gmsh(write_gmsh(tmp_path / "a.msh", SQUARE_NODES, FAN))
    for number, flipped in enumerate((FAN[:, ::-1], np.vstack((FAN[:2], FAN[2:, ::-1])))):
        body = from_gmsh(write_gmsh(tmp_path / f"{number}.msh", SQUARE_NODES, flipped))
        assert_sound(body)
        assert body.area == straight.area
        assert {frozenset(t) for t in triangles_of(body)} == {frozenset(t) for t in FAN}
    inverted = np.vstack((SQUARE, [(0.5, -0.5)]))  # the node within lies outside: the triangle turned over covers others
    with pytest.raises(ParameterError, match="overlap"):
        from_gmsh(write_gmsh(tmp_path / "inverted.msh", inverted, FAN))


@NEEDS_MESHIO
def test_unused_nodes_are_dropped_and_z_must_be_0(tmp_path: Path) -> None:
    points = np.vstack(([(9.0, 9.0)], SQUARE_NODES[:2], [(7.0, 7.0)], SQUARE_NODES[2:]))
    number = np.array([1, 2, 4, 5, 6])
    lines = [(33, 5, 1)]
    body = from_gmsh(write_gmsh(tmp_path / "a.msh", points, number[FAN], lines), slide_x=["33"])
    assert_sound(body)
    np.testing.assert_array_equal(points_of(body), SQUARE_NODES)
    assert body.slide_x.tolist() == [0, 3]
    lifted = np.column_stack((SQUARE_NODES, [0.0, 0.0, 0.1, 0.0, 0.0]))
    with pytest.raises(ParameterError, match=r"geometry\.file: node 3 has z = 0\.1"):
        from_gmsh(write_gmsh(tmp_path / "b.msh", lifted, FAN))


@NEEDS_MESHIO
def test_numbering_of_nodes_and_triangles_does_not_matter(tmp_path: Path) -> None:
    body = quarter_disk(1.0, 6)
    points, triangles = points_of(body), triangles_of(body)
    along = [(1, a, b) for a, b in boundary_edges(triangles) if points[a, 0] == points[b, 0] == 0.0]
    rng = np.random.default_rng(1)
    new = rng.permutation(len(points))
    shuffled = np.empty_like(points)
    shuffled[new] = points
    one = from_gmsh(write_gmsh(tmp_path / "a.msh", points, triangles, along), slide_x=["1"])
    two = from_gmsh(
        write_gmsh(tmp_path / "b.msh", shuffled, rng.permutation(new[triangles]), [(1, new[a], new[b]) for _, a, b in along]), slide_x=["1"]
    )
    assert_sound(two)
    for name in ("surface", "slide_x", "slide_y"):
        assert np.array_equal(np.sort(new[getattr(one, name)]), getattr(two, name)), name
    assert (two.area, two.radius) == (pytest.approx(one.area, rel=1e-14), pytest.approx(one.radius, rel=1e-6))
    assert two.quality.least_angle == pytest.approx(one.quality.least_angle, rel=1e-12)


@NEEDS_MESHIO
@pytest.mark.parametrize(
    ("slides", "path", "message"),
    [
        ({"slide_x": ["lefd"]}, "geometry.slide_x", r'no group of lines "lefd"; did you mean "left"\? .*"bottom", "free", "left"'),
        ({"slide_x": ["bottom"]}, "geometry.slide_x", '"bottom" must lie on a straight line x = const, but its nodes have x from 0 to 1'),
        ({"slide_y": ["free"]}, "geometry.slide_y", '"free" must lie on a straight line y = const'),
        ({"slide_y": ["within"]}, "geometry.slide_y", '1 of the 1 lines of "within" are no side'),
    ],
)
def test_sides_that_cannot_slide(tmp_path: Path, slides: dict[str, list[str]], path: str, message: str) -> None:
    points = np.vstack((SQUARE, [(0.5, 0.5), (0.6, 0.5)]))
    triangles = np.array([(0, 1, 4), (1, 5, 4), (1, 2, 5), (2, 3, 5), (3, 4, 5), (3, 0, 4)])
    file = write_gmsh(tmp_path / "a.msh", points, triangles, [*SQUARE_LINES, (34, 4, 5)], {**SQUARE_NAMES, 34: "within"})
    with pytest.raises(ParameterError, match=message) as caught:
        from_gmsh(file, **slides)
    assert caught.value.path == path


@NEEDS_MESHIO
def test_files_without_a_free_surface_or_without_groups(tmp_path: Path) -> None:
    lines = [(1, 0, 1), (2, 1, 2), (1, 2, 3), (2, 3, 0)]
    file = write_gmsh(tmp_path / "a.msh", SQUARE_NODES, FAN, [(k + 10 * a, a, b) for k, a, b in lines])
    with pytest.raises(ParameterError, match="no free surface is left"):
        from_gmsh(file, slide_x=["12", "32"], slide_y=["1", "21"])
    with pytest.raises(ParameterError, match="has no physical groups of lines"):
        from_gmsh(write_gmsh(tmp_path / "b.msh", SQUARE_NODES, FAN), slide_x=["left"])


@NEEDS_MESHIO
@pytest.mark.parametrize(
    ("element", "message"),
    [
        ("9 2 1 1 1 2 3 4 5 1", "higher order .*triangle6.*ElementOrder = 1"),
        ("3 2 1 1 1 2 3 4", 'type "quad"; the body must be made of triangles alone'),
        ("1 2 1 1 1 2", "has no triangles"),
    ],
)
def test_elements_that_are_refused(tmp_path: Path, element: str, message: str) -> None:
    file = write_gmsh(tmp_path / "a.msh", SQUARE_NODES, FAN[:0])
    file.write_text(file.read_text().replace("$Elements\n0\n", f"$Elements\n1\n1 {element}\n"))
    with pytest.raises(ParameterError, match=f"geometry.file: .*{message}"):
        from_gmsh(file)


@NEEDS_MESHIO
def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"geometry\.file: there is no file"):
        from_gmsh(tmp_path / "missing.msh")
    (tmp_path / "a.msh").write_text("not a mesh\n")
    with pytest.raises(ParameterError, match=r"geometry\.file: .*cannot be read as a Gmsh file"):
        from_gmsh(tmp_path / "a.msh")
    bad = write_gmsh(tmp_path / "b.msh", np.vstack((SQUARE, [(0.5, 0.001)])), FAN)
    with pytest.raises(ParameterError, match=r"geometry\.file: triangle 1 .*badly shaped"):
        from_gmsh(bad)


def test_without_meshio_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(ParameterError, match=r'pip install "multiphase-tissue\[mesh\]"'):
        from_gmsh(write_gmsh(tmp_path / "a.msh", SQUARE_NODES, FAN))


@NEEDS_MESHIO
@pytest.mark.skipif(not AUTHORS.exists(), reason="the authors' mesh is not here")
def test_the_authors_quarter_disk() -> None:
    body = from_gmsh(AUTHORS, slide_x=["33"], slide_y=["31"])
    assert_sound(body)
    assert (body.quality.nodes, body.quality.triangles) == (10605, 20850)
    assert (len(body.surface), len(body.slide_x), len(body.slide_y)) == (159, 101, 101)
    assert body.area == pytest.approx(np.pi / 4.0, rel=2e-5)
    assert body.radius == pytest.approx(1.0, rel=2e-5)
    assert body.quality.least_angle == pytest.approx(33.02, abs=0.01)


def test_neither_numba_nor_meshio_is_imported() -> None:
    code = "import sys, tumour.meshes; sys.exit('numba' in sys.modules or 'meshio' in sys.modules and 2)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
