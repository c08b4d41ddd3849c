"""Marks on pictures of a synthetic body: bars along directions of its material, parts of its surface, properties at rest."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from multiphase.errors import ParameterError
from multiphase.film import BodyFilm, frame_times
from multiphase.marks import Marks, Part, Property
from multiphase.mesh import Mesh
from multiphase.model import Panel, find_model
from multiphase.plotting import figure, view_of
from multiphase.plotting import view as view_module
from multiphase.plotting.marks import PART_COLOURS, columns_of, pushed
from multiphase.plotting.spread import inside
from multiphase.result import Result

ALPHA = Panel("map", ("alpha",), "Cells")
OXYGEN = Panel("map", ("C",), "Oxygen")
GROWTH = Panel("maps", ("alpha",), "Growth")
REST = Panel("rest", (), "Tissue at rest")
AREA = Panel("scalar", ("area",), "Area")


def square(cells: int = 10) -> Mesh:
    """The unit square around the origin; the diagonals of its cells lean to either side in turn."""
    ticks = np.linspace(-0.5, 0.5, cells + 1)
    points = np.array([(x, y) for y in ticks for x in ticks])
    triangles = []
    for i in range(cells):
        for j in range(cells):
            a = i + j * (cells + 1)
            b, c, d = a + 1, a + cells + 1, a + cells + 2
            triangles += [(a, b, d), (a, d, c)] if (i + j) % 2 else [(a, b, c), (b, d, c)]
    return Mesh(points, np.array(triangles))


def sample(F: Any = ((1.0, 0.0), (0.0, 1.0)), **changes: Any) -> Result:
    """A body that is deformed evenly, up to F at the last of five times."""
    t, mesh = np.linspace(0.0, 8.0, 5), square()
    moved = t[:, None, None] / 8.0 * (mesh.points @ (np.array(F) - np.eye(2)).T)
    data: dict[str, Any] = {
        "model": "tumour",
        "t": t,
        "mesh": mesh,
        "scalars": {"area": 1.0 + t},
        "fields": {"alpha": 0.8 - 0.1 * mesh.points[:, 0] + 0.0 * t[:, None], "C": np.ones((5, len(mesh.points))), "displacement": moved},
        "scene": '[scene]\nmodel = "tumour"\ntitle = "A body"\n',
    }
    return Result(**(data | changes))


def along(angle: Any) -> np.ndarray:
    """Unit vectors at the points of the square."""
    angle = np.broadcast_to(angle, len(square().points))
    return np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.fixture
def marked(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Gives the installed models these marks, and the panels that are named."""

    def give(*panels: Panel, **marks: Any) -> None:
        def find(name: str) -> Any:
            model = find_model(name)
            return replace(model, marks=lambda result: Marks(**marks), panels=panels or model.panels)

        monkeypatch.setattr(view_module, "find_model", find)

    return give


def lines(picture: Figure, title: str = "", width: float = 0.8) -> np.ndarray:
    """The segments (n, 2, 2) of this width on the axes with a title, or on all."""
    chosen = [axes for axes in picture.get_axes() if not title or axes.get_title(loc="left") == title]
    found = [artist for axes in chosen for artist in axes.collections if isinstance(artist, LineCollection)]
    segments = [np.array(artist.get_segments()) for artist in found if np.allclose(artist.get_linewidth(), width)]
    return np.concatenate([s for s in segments if len(s)] or [np.empty((0, 2, 2))])


def angles(bars: np.ndarray) -> np.ndarray:
    """Of bars from the x axis, from 0 to pi."""
    return np.arctan2(*(bars[:, 1] - bars[:, 0]).T[::-1]) % np.pi


def legend(picture: Figure) -> list[str]:
    return [text.get_text() for found in picture.subfigs[0].legends for text in found.get_texts()]


def bytes_of(picture: Figure) -> bytes:
    buffer = io.BytesIO()
    picture.savefig(buffer, format="raw", dpi=50)
    return buffer.getvalue()


TURN = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])


@pytest.mark.parametrize("F", [np.eye(2), [[1.0, 0.8], [0.0, 1.0]], TURN, TURN @ [[3.0, 0.0], [0.0, 0.5]]])
@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_bars_lie_along_the_pushed_direction(marked: Callable[..., None], F: Any, angle: float) -> None:
    marked(directions=along(angle))
    a = np.array(F) @ [np.cos(angle), np.sin(angle)]
    bars = lines(figure(sample(F), panels=[ALPHA]), "Cells")
    np.testing.assert_allclose(angles(bars), np.arctan2(a[1], a[0]) % np.pi, atol=1e-9)
    length = np.hypot(*(bars[:, 1] - bars[:, 0]).T)
    step = np.sqrt(2.0 / np.sqrt(3.0) * np.linalg.det(F) / 130)
    np.testing.assert_allclose(length, 0.6 * step)
    # 130 evenly spread, less those that would reach beyond: some of the outermost of about 11 rows and columns
    assert 95 <= len(bars) <= 135
    at_rest = np.linalg.solve(np.array(F), bars.reshape(-1, 2).T)
    assert np.abs(at_rest).max() < 0.5


def test_bars_of_an_uneven_deformation_are_exact_to_first_order(marked: Callable[..., None]) -> None:
    """x -> (x + x y/2, y): F a_0 for a_0 = (0, 1) is (x/2, 1)."""
    marked(directions=along(np.pi / 2))
    result = sample()
    x, y = result.mesh.points.T
    result.fields["displacement"][-1] = np.column_stack([0.5 * x * y, 0.0 * y])
    bars = lines(figure(result, panels=[ALPHA]), "Cells")
    at = bars.mean(axis=1)
    rest = at[:, 0] / (1.0 + 0.5 * at[:, 1])
    # F of a triangle is that of its middle, up to 0.05 away, and so is that of the points on the sides of the square
    np.testing.assert_allclose(angles(bars), np.arctan2(1.0, 0.5 * rest), atol=0.03)
    found = pushed(view_of(result).body, result.positions(-1), along(np.pi / 2))
    inner = np.abs(result.mesh.points).max(axis=1) < 0.45
    exact = np.column_stack([0.5 * x, np.ones_like(x)])[inner]
    np.testing.assert_allclose(found[inner], exact / np.hypot(*exact.T)[:, None], atol=1e-3)  # h^2 = 0.01, times 0.1


def test_the_sense_of_a_direction_does_not_matter(marked: Callable[..., None]) -> None:
    marked(directions=along(0.4))
    wanted = lines(figure(sample(), panels=[ALPHA]))
    signs = np.where(np.arange(len(square().points)) % 2, 1.0, -1.0)
    marked(directions=signs[:, None] * along(0.4))
    np.testing.assert_allclose(lines(figure(sample(), panels=[ALPHA])), wanted, atol=1e-12)


def test_no_bars_where_there_is_no_direction(marked: Callable[..., None]) -> None:
    x, y = square().points.T
    marked(directions=along(np.where(x < -0.01, np.nan, np.arctan2(y, x) + np.pi / 2)))
    middles = lines(figure(sample(), panels=[ALPHA])).mean(axis=1)
    assert 40 <= len(middles) <= 65
    assert (middles[:, 0] > -0.01).all()
    assert np.hypot(*middles.T).min() > 0.03  # around the middle, directions cancel


def test_bars_are_on_the_field_of_films_alone(marked: Callable[..., None]) -> None:
    marked(directions=along(0.0), name="collagen")
    picture = figure(sample(), panels=[GROWTH, ALPHA, OXYGEN])
    assert not len(lines(picture, "Oxygen"))
    assert 25 <= len(lines(picture, "Growth")) <= 47  # the first of four small maps
    assert legend(picture) == ["outline at rest", "at t = 8", "collagen"]
    assert legend(figure(sample(), panels=[OXYGEN])) == ["outline at rest", "at t = 8"]
    assert legend(figure(sample(), panels=[GROWTH])) == ["collagen"]


def test_parts_are_on_all_maps_and_move_with_the_body(marked: Callable[..., None]) -> None:
    result = sample([[1.0, 0.5], [0.0, 2.0]])
    low = np.array([(i, i + 1) for i in range(10)])
    marked(parts={"bone": Part(low, "clamped"), "bed": Part(110 + low)})
    picture = figure(result, panels=[ALPHA, OXYGEN, AREA])
    for title in ("Cells", "Oxygen"):
        (axes,) = [axes for axes in picture.get_axes() if axes.get_title(loc="left") == title]
        found = {str(artist.get_label()): artist for artist in axes.collections if isinstance(artist, LineCollection)}
        for name, edges, colour in (("bone", low, "#d55e00"), ("bed", 110 + low, "#56b4e9")):
            np.testing.assert_allclose(np.array(found[name].get_segments()), result.positions(-1)[edges])
            assert same_color(found[name].get_color()[0], colour)
    assert legend(picture) == ["outline at rest", "at t = 8", "bone: clamped", "bed"]
    assert len(lines(figure(result, panels=[GROWTH]), width=0.7 * 2.4)) == 80  # two parts of ten edges, on four small maps


def test_many_parts_and_long_words(marked: Callable[..., None]) -> None:
    edges = np.array([(i, i + 1) for i in range(10)])
    marked(parts={f"part{i}": Part(edges[i : i + 1], "many words " * 12) for i in range(8)})
    picture = figure(sample(), panels=[ALPHA])
    texts = legend(picture)
    assert all(len(text) <= 64 and text.endswith(" ...") for text in texts[2:])
    picture.draw_without_rendering()
    (found,) = picture.subfigs[0].legends
    box = found.get_window_extent()
    assert (box.x0 > 0.0, box.x1 < picture.bbox.x1) == (True, True)
    assert len(set(PART_COLOURS)) == 6
    assert columns_of(["a" * 30] * 4) == 2
    assert columns_of([]) == 1


def test_the_tissue_at_rest(marked: Callable[..., None]) -> None:
    x, y = square().points.T
    properties = {
        "m": Property("stiffness $m$", 1.0 + x),
        "K": Property("permeability $K$, mean", 2.0 + y, along(np.where(y < 0.0, 0.3, np.nan))),
    }
    marked(properties=properties, parts={"bone": Part(np.array([[0, 1]]), "clamped")})
    result = sample([[2.0, 0.0], [0.0, 2.0]])
    picture = figure(result, panels=[GROWTH, REST])
    picture.draw_without_rendering()
    found = [(axes, artist) for axes in picture.get_axes() for artist in axes.collections if isinstance(artist, TriMesh)]
    assert [axes.get_title(loc="left") for axes, _ in found] == ["Tissue at rest", "", "Growth", "", "", ""]  # it comes first
    for (_, mesh), shown in zip(found[:2], properties.values(), strict=True):
        np.testing.assert_array_equal(mesh.get_array(), shown.values)
        np.testing.assert_allclose(np.column_stack([mesh._triangulation.x, mesh._triangulation.y]), square().points)
        assert mesh.colorbar.ax.get_xlabel() == shown.label
    first, second = (axes for axes, _ in found[:2])
    assert len([artist for artist in first.collections if isinstance(artist, LineCollection)]) == 2  # outline, part
    bars = next(np.array(a.get_segments()) for a in second.collections if isinstance(a, LineCollection) and a.get_linewidth()[0] == 0.8)
    bars = bars[np.isfinite(bars).all(axis=(1, 2))]
    np.testing.assert_allclose(angles(bars), 0.3)
    assert (bars.mean(axis=1)[:, 1] < 0.05).all()
    assert legend(picture) == ["bone: clamped"]


def test_properties_in_rows_of_four(marked: Callable[..., None]) -> None:
    values = square().points[:, 0]
    marked(properties={f"p{i}": Property(f"p{i}", values) for i in range(6)})
    picture = figure(sample(), panels=[REST])
    picture.draw_without_rendering()
    boxes = [axes.get_window_extent() for axes in picture.get_axes() if any(isinstance(artist, TriMesh) for artist in axes.collections)]
    assert len({round(box.y0) for box in boxes}) == 2
    assert sum(round(box.y0) == round(boxes[0].y0) for box in boxes) == 4
    assert [box.size for box in boxes] == [pytest.approx(boxes[0].size, rel=1e-6)] * 6


def test_the_panel_of_the_model_is_left_out_without_properties(marked: Callable[..., None]) -> None:
    marked(REST, ALPHA)
    assert figure(sample()).get_axes()[0].get_title(loc="left") == "Cells"
    with pytest.raises(ParameterError, match="the same everywhere at rest"):
        figure(sample(), panels=[REST])
    without = sample(fields={"alpha": np.ones((5, 121))})
    marked(REST, AREA, properties={"m": Property("m", square().points[:, 0])})
    assert [axes.get_title(loc="left") for axes in figure(without).get_axes()] == ["Area"]


def test_without_marks_pictures_are_as_they_were(marked: Callable[..., None]) -> None:
    marked(REST, GROWTH, ALPHA, OXYGEN, AREA)
    picture = figure(sample())
    assert legend(picture) == ["outline at rest", "at t = 8"]
    for axes in picture.get_axes():
        found = [artist for artist in axes.collections if isinstance(artist, LineCollection)]
        assert len(found) in (0, 2)  # the outlines at rest and now
    with_panel = bytes_of(picture)
    marked(GROWTH, ALPHA, OXYGEN, AREA)
    assert bytes_of(figure(sample())) == with_panel
    marked(GROWTH, ALPHA, OXYGEN, AREA, directions=along(0.0))
    assert bytes_of(figure(sample())) != with_panel


def film_of(result: Result) -> BodyFilm:
    view = view_of(result)
    return BodyFilm(view, frame_times(view.t))


def test_marks_in_a_film_move_with_the_material(marked: Callable[..., None]) -> None:
    marked(GROWTH, AREA, directions=along(0.5), parts={"bone": Part(np.array([[0, 1], [1, 2]]), "clamped")})
    F = np.array([[2.0, 0.6], [0.0, 1.5]])
    result = sample(F)
    film = film_of(result)
    assert [text.get_text() for text in film.figure.legends[0].get_texts()] == ["fibres", "bone: clamped"]
    before = [id(artist) for axes in film.figure.axes for artist in axes.get_children()]
    places = []
    for frame in (0, 50, 99):
        film.show(frame)
        now = np.eye(2) + frame / 99 * (F - np.eye(2))
        bars = np.array(film.map.bars.artist.get_segments())
        a = now @ [np.cos(0.5), np.sin(0.5)]
        np.testing.assert_allclose(angles(bars), np.arctan2(a[1], a[0]))
        length = 0.6 * np.sqrt(2.0 / np.sqrt(3.0) * np.linalg.det(now) / 130)
        np.testing.assert_allclose(np.hypot(*(bars[:, 1] - bars[:, 0]).T), length)  # as they grow with the body
        places.append(np.linalg.solve(now, bars.mean(axis=1).T))
        _, bone = film.map.sides.lines["bone"]
        np.testing.assert_allclose(np.array(bone.get_segments()), (square().points @ now.T)[[[0, 1], [1, 2]]])
    np.testing.assert_allclose(places[0], places[2], atol=1e-12)
    np.testing.assert_allclose(places[1], places[2], atol=1e-12)
    assert [id(artist) for axes in film.figure.axes for artist in axes.get_children()] == before


def test_a_film_without_marks_has_no_legend_and_the_size_it_had(marked: Callable[..., None]) -> None:
    marked(GROWTH, AREA)
    film = film_of(sample())
    assert film.figure.legends == []
    assert tuple(film.figure.get_size_inches()) == pytest.approx((4.0 + 1.4 + 3.4, 4.0 + 1.1))


def test_inside_and_bodies_without_area() -> None:
    outline = np.array([[(0.0, 0.0), (2.0, 0.0)], [(2.0, 0.0), (2.0, 1.0)], [(2.0, 1.0), (0.0, 1.0)], [(0.0, 1.0), (0.0, 0.0)]])
    points = np.array([(1.0, 0.5), (3.0, 0.5), (-1.0, 0.5), (1.0, 1.5), (1.9, 0.9), (np.nan, 0.0)])
    np.testing.assert_array_equal(inside(points, outline), [True, False, False, False, True, False])


def test_a_body_without_area_has_no_bars(marked: Callable[..., None]) -> None:
    marked(directions=along(0.0))
    result = sample()
    result.fields["displacement"][-1] = -square().points
    picture = figure(result, panels=[ALPHA])
    assert not len(lines(picture, "Cells"))
    picture.draw_without_rendering()
