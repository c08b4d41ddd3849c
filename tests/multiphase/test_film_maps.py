"""Films of a synthetic body of triangles: what moves, what stays, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.film import BodyFilm, animate, frame_times
from multiphase.mesh import Mesh
from multiphase.model import Panel, find_model
from multiphase.plotting import view as view_module
from multiphase.plotting import view_of
from multiphase.result import Result

SCALES = """
[scales]
length = { value = 0.5, unit = "mm" }
time = { value = 2.0, unit = "d" }
"""
PANELS = (
    Panel("scalar", ("radius", "rim_width"), "Of a line", grid="line"),
    Panel("scalar", ("radius", "area"), "Size"),
    Panel("scalar", ("doubling_time",), "Doubling"),
    Panel("scalar", ("cell_mass",), "Cells"),
    Panel("map", ("alpha",), "Cell fraction"),
)


def sample(times: Any = None, scene: str = "", **changes: Any) -> Result:
    """The unit square grows to 5 by 3, twice as fast at first; alpha falls from 0.8 to 0.2 at its right."""
    t = np.linspace(0.0, 8.0, 41) if times is None else np.asarray(times, dtype=float)
    s = np.sqrt((t - t[0]) / (t[-1] - t[0])) if len(t) > 1 else np.zeros(1)
    points = np.array([(x, y) for y in np.linspace(0.0, 1.0, 9) for x in np.linspace(0.0, 1.0, 9)])
    lower = np.array([x + 9 * y for y in range(8) for x in range(8)])
    mesh = Mesh(points, np.vstack([lower[:, None] + [0, 1, 10], lower[:, None] + [0, 10, 9]]))
    data: dict[str, Any] = {
        "model": "tumour",
        "t": t,
        "mesh": mesh,
        "scalars": {"area": (1.0 + 4.0 * s) * (1.0 + 2.0 * s), "radius": 1.0 + s, "cell_mass": s, "doubling_time": 1.0 + s},
        "fields": {
            "alpha": 0.8 - 0.6 * s[:, None] * points[:, 0],
            "displacement": s[:, None, None] * points * [4.0, 2.0],
        },
        "scene": '[scene]\nmodel = "tumour"\ntitle = "A body"\n' + scene,
    }
    return Result(**(data | changes))


@pytest.fixture(autouse=True)
def _panels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view_module, "find_model", lambda name: replace(find_model(name), panels=PANELS))


def film_of(result: Result) -> BodyFilm:
    view = view_of(result)
    return BodyFilm(view, frame_times(view.t))


def positions(film: BodyFilm) -> np.ndarray:
    """Where the coloured triangles have their corners."""
    return np.column_stack([film.map.mesh._triangulation.x, film.map.mesh._triangulation.y])


def dots(film: BodyFilm) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for dot, _ in film.dots for x, y in [np.ravel(dot.get_data())]]


@pytest.mark.parametrize(("scene", "length", "time", "end"), [("", 1.0, 1.0, "8.0"), (SCALES, 0.5, 2.0, "16.0 d")])
def test_film_follows_the_body(scene: str, length: float, time: float, end: str) -> None:
    result = sample(scene=scene)
    film = film_of(result)
    for frame in (0, 17, 40):
        film.show(frame)
        now = length * (result.mesh.points + result["displacement"][frame])
        np.testing.assert_allclose(positions(film), now)
        np.testing.assert_allclose(film.map.mesh.get_array(), result["alpha"][frame])
        edges = np.array(film.map.outline.get_segments())
        assert edges.shape == (32, 2, 2)
        np.testing.assert_allclose(edges.max(axis=(0, 1)), now.max(axis=0))
        there = time * result.t[frame]
        radius, area, doubling = dots(film)
        assert radius == pytest.approx((there, length * result["radius"][frame]))
        assert area == pytest.approx((there, length**2 * result["area"][frame]))
        assert doubling == pytest.approx((there, time * result["doubling_time"][frame]))
    assert film.title.get_text() == f"A body, t = {end}"


def test_axes_and_colours_hold_every_frame() -> None:
    film = film_of(sample())
    axes = film.map.axes
    for frame in (0, 40):
        film.show(frame)
        assert axes.get_xlim() == pytest.approx((-0.15, 5.15))
        assert axes.get_ylim() == pytest.approx((-0.09, 3.09))
        assert film.map.mesh.get_clim() == pytest.approx((0.2, 0.8))
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x", "y")
    assert film.map.mesh.colorbar.ax.get_ylabel() == r"$\alpha$"


def test_frames_between_stored_times_are_between_stored_bodies() -> None:
    result = sample([0.0, 8.0])
    film = film_of(result)
    assert len(film.times) == 100
    film.show(33)  # a third of the way, which the stored times see as linear
    np.testing.assert_allclose(positions(film), result.mesh.points * [1.0 + 4.0 / 3.0, 1.0 + 2.0 / 3.0])
    np.testing.assert_allclose(film.map.mesh.get_array(), 0.8 - 0.2 * result.mesh.points[:, 0])
    assert dots(film)[0] == pytest.approx((8.0 / 3.0, 4.0 / 3.0))


def test_scalars_beside_the_body() -> None:
    result = sample()
    film = film_of(result)
    lines = [line for axes in film.figure.axes for line in axes.get_lines() if len(line.get_xdata()) == 41]
    for line in lines:
        np.testing.assert_array_equal(line.get_ydata(), result[str(line.get_label())])
    shown = {str(line.get_label()) for line in lines}
    assert shown == {"radius", "area", "doubling_time"}  # two panels, less the one that is for lines
    named = [axes for axes in film.figure.axes if axes.get_xlabel().startswith("time t")]
    assert len(named) == 1
    right = film.map.mesh.colorbar.ax.get_window_extent().x1
    assert all(line.axes is not None and line.axes.get_window_extent().x0 > right for line in lines)
    assert all(isinstance(dot, Line2D) and dot.get_marker() == "o" for dot, _ in film.dots)


def test_artists_are_moved_and_not_made_anew() -> None:
    film = film_of(sample())
    before = [id(artist) for axes in film.figure.axes for artist in axes.get_children()]
    for frame in range(5):
        film.show(frame)
    assert [id(artist) for axes in film.figure.axes for artist in axes.get_children()] == before


def coloured(frame: np.ndarray, film: BodyFilm) -> float:
    """Share of the map's axes that is neither white, black nor grey."""
    box = film.map.axes.get_position()
    height, width = frame.shape[:2]
    inside = frame[round((1.0 - box.y1) * height) : round((1.0 - box.y0) * height), round(box.x0 * width) : round(box.x1 * width)]
    return float(np.mean(np.ptp(inside.astype(int), axis=2) > 40))


def test_gif(tmp_path: Path) -> None:
    result, calls, path = sample(), [], tmp_path / "a.gif"
    animate(result, path, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(i, 41) for i in range(1, 42)]
    film = film_of(result)
    with Image.open(path) as image:
        assert image.n_frames == 41
        for frame in (0, 20, 40):
            image.seek(frame)
            share = coloured(np.asarray(image.convert("RGB")), film)
            assert share == pytest.approx(result["area"][frame] / (5.3 * 3.18), abs=0.03)


def test_one_time_and_no_scalars(tmp_path: Path) -> None:
    animate(sample([3.0], scalars={}), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as image:
        assert getattr(image, "n_frames", 1) == 1
    film = film_of(sample(scalars={}))
    assert film.dots == []
    assert film.map.axes.get_window_extent().width > 0.6 * film.figure.bbox.width


def test_what_a_film_needs(tmp_path: Path) -> None:
    result = sample()
    moved, alpha = result.fields["displacement"], result.fields["alpha"]
    with pytest.raises(ParameterError, match=r"output\.fields: a film needs the displacement, which this result does not hold"):
        animate(replace(result, fields={"alpha": alpha}), tmp_path / "a.gif")
    with pytest.raises(ParameterError, match=r"output\.fields: the film colours 'alpha', which this result does not hold"):
        animate(replace(result, fields={"displacement": moved}), tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []
