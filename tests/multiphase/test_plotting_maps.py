"""Pictures of a synthetic body of triangles: what its maps show, where they stand, and what is refused."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.model import Panel, find_model
from multiphase.plotting import colour_map, figure, view_of
from multiphase.plotting import view as view_module
from multiphase.plotting.maps import spread_over
from multiphase.result import Result

SCALES = """
[scales]
length = { value = 0.5, unit = "mm" }
time = { value = 2.0, unit = "d" }
pressure = { value = 50.0, unit = "kPa" }
"""
ALPHA = Panel("map", ("alpha",), "Cells")
MOVED = Panel("map", ("displacement",), "Displacement")
STRESS = Panel("map", ("stress_magnitude",), "Stress", log=True)
GROWTH = Panel("maps", ("alpha",), "Growth")
AREA = Panel("scalar", ("area",), "Area")


def corner(cells: int = 8) -> Mesh:
    """The unit square less its upper right quarter."""
    ticks = np.linspace(0.0, 1.0, cells + 1)
    points = np.array([(x, y) for y in ticks for x in ticks])
    lower = np.array([i + j * (cells + 1) for j in range(cells) for i in range(cells) if i < cells // 2 or j < cells // 2])
    upper = lower + cells + 1
    triangles = np.vstack([np.column_stack([lower, lower + 1, upper + 1]), np.column_stack([lower, upper + 1, upper])])
    used = np.unique(triangles)
    return Mesh(points[used], np.searchsorted(used, triangles))


def sample(times: Any = None, mesh: Mesh | None = None, scene: str = "", **changes: Any) -> Result:
    """A body that grows evenly to four times its size; alpha falls with x, p with y, and the stress by nine decades with x."""
    t = np.linspace(0.0, 8.0, 41) if times is None else np.asarray(times, dtype=float)
    s = (t - t[0])[:, None] / (t[-1] - t[0] if len(t) > 1 else 1.0)
    mesh = corner() if mesh is None else mesh
    x, y = mesh.points.T
    data: dict[str, Any] = {
        "model": "tumour",
        "t": t,
        "mesh": mesh,
        "scalars": {
            "area": 0.75 * (1.0 + 3.0 * s[:, 0]) ** 2,
            "radius": 1.0 + 3.0 * s[:, 0],
            "doubling_time": 2.0 + s[:, 0],
            "necrotic_fraction": 0.5 * s[:, 0],
        },
        "fields": {
            "alpha": 0.8 - 0.6 * s * x,
            "C": np.ones((len(t), len(x))),
            "p": -0.2 * s * y,
            "J": (1.0 + 3.0 * s) ** 2 + 0.0 * x,
            "stress_magnitude": 0.5 * s * 10.0 ** (-9.0 * x),
            "displacement": 3.0 * s[:, :, None] * mesh.points,
        },
        "scene": '[scene]\nmodel = "tumour"\ntitle = "A body"\n' + scene,
    }
    return Result(**(data | changes))


def with_field(result: Result, name: str, values: Any) -> Result:
    return replace(result, fields=result.fields | {name: np.broadcast_to(values, result.fields[name].shape).astype(float)})


def maps(picture: Figure) -> list[TriMesh]:
    """The bodies in the picture, as they stand in it."""
    return [artist for axes in picture.get_axes() for artist in axes.collections if isinstance(artist, TriMesh)]


def only(picture: Figure) -> TriMesh:
    (found,) = maps(picture)
    return found


def corners(mesh: TriMesh) -> np.ndarray:
    return np.column_stack([mesh._triangulation.x, mesh._triangulation.y])


def bar(mesh: TriMesh) -> Any:
    """The colour bar of a map."""
    return mesh.colorbar


def outlines(axes: Axes) -> list[np.ndarray]:
    """The edges of the outlines on a map, (edges, 2, 2): that at rest and that of the body as it is."""
    return [np.array(artist.get_segments()) for artist in axes.collections if isinstance(artist, LineCollection)]


def titled(picture: Figure) -> dict[str, Axes]:
    return {axes.get_title(loc="left"): axes for axes in picture.get_axes() if axes.get_title(loc="left")}


def render(picture: Figure, dpi: int = 50) -> np.ndarray:
    buffer = io.BytesIO()
    picture.savefig(buffer, format="png", dpi=dpi)
    buffer.seek(0)
    return np.asarray(Image.open(buffer).convert("RGB"))


@pytest.fixture
def of_model(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Gives the installed models other panels."""

    def give(*panels: Panel) -> None:
        monkeypatch.setattr(view_module, "find_model", lambda name: replace(find_model(name), panels=panels))

    return give


# A map


def test_a_map_shows_the_last_time_on_the_body_as_it_is() -> None:
    result = sample()
    mesh = only(figure(result, panels=[ALPHA]))
    np.testing.assert_allclose(corners(mesh), 4.0 * result.mesh.points)
    np.testing.assert_array_equal(mesh._triangulation.triangles, result.mesh.triangles)
    np.testing.assert_array_equal(mesh.get_array(), result["alpha"][-1])
    assert mesh.get_clim() == pytest.approx((0.2, 0.8))
    assert mesh.get_rasterized()
    axes = mesh.axes
    assert axes.get_aspect() == 1.0
    assert axes.get_xlim() == pytest.approx((-0.12, 4.12))
    assert axes.get_ylim() == pytest.approx((-0.12, 4.12))
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title(loc="left")) == ("x", "y", "Cells")
    assert bar(mesh).ax.get_ylabel() == r"$\alpha$"
    assert bar(mesh).extend == "neither"


def test_colours_are_those_of_the_times_that_are_shown() -> None:
    result = sample()
    result.fields["alpha"][20] = 5.0
    result.fields["alpha"][0] = 0.9
    *growth, last = maps(figure(result, panels=[GROWTH, ALPHA]))
    assert [mesh.get_clim() for mesh in growth] == [pytest.approx((0.2, 0.9))] * 4
    assert last.get_clim() == pytest.approx((0.2, 0.8))


def test_outlines_at_rest_and_now() -> None:
    result = sample()
    rest, now = outlines(only(figure(result, panels=[ALPHA])).axes)
    length = np.hypot(*(rest[:, 1] - rest[:, 0]).T)
    assert len(rest) == 32  # eighths of a border of length 4
    np.testing.assert_allclose(length, 0.125)
    x, y = rest.mean(axis=1).T
    on_notch = ((x == 0.5) & (y > 0.5)) | ((y == 0.5) & (x > 0.5))
    assert ((x == 0.0) | (y == 0.0) | ((x == 1.0) & (y < 0.5)) | ((y == 1.0) & (x < 0.5)) | on_notch).all()
    np.testing.assert_allclose(now, 4.0 * rest)


def test_pixels_of_a_map() -> None:
    picture = figure(sample(), panels=[ALPHA])
    pixels = render(picture, 200)
    axes = only(picture).axes

    def at(x: float, y: float) -> np.ndarray:
        column, row = axes.transData.transform((x, y)) * 200 / picture.dpi
        return pixels[len(pixels) - 1 - int(row), int(column)] / 255

    for x, y in ((0.3, 2.2), (1.7, 1.7), (3.7, 0.7)):
        np.testing.assert_allclose(at(x, y), colour_map()((0.6 - 0.6 * x / 4.0) / 0.6)[:3], atol=0.07)
    np.testing.assert_array_equal(at(3.0, 3.0), 1.0)  # the notch is white


def test_units_of_positions_and_values() -> None:
    result = sample(scene=SCALES)
    for given in (result, result.in_units()):
        picture = figure(given, panels=[replace(ALPHA, names=("p", "displacement"))])
        pressure, moved = maps(picture)
        np.testing.assert_allclose(corners(pressure), 2.0 * result.mesh.points)
        np.testing.assert_allclose(pressure.get_array(), 50.0 * result["p"][-1])
        np.testing.assert_allclose(moved.get_array(), 1.5 * np.hypot(*result.mesh.points.T))
        assert (pressure.axes.get_xlabel(), pressure.axes.get_ylabel()) == ("x [mm]", "y [mm]")
        assert bar(pressure).ax.get_ylabel() == "$p$ [kPa]"
        assert bar(moved).ax.get_ylabel() == f"|{view_of(result).symbol('displacement')}| [mm]"
        rest, now = outlines(pressure.axes)
        assert (rest.max(), now.max()) == pytest.approx((0.5, 2.0))
        assert legend_texts(picture) == ["outline at rest", "at t = 16 d"]


def legend_texts(picture: Figure) -> list[str]:
    (found,) = picture.subfigs[0].legends
    return [text.get_text() for text in found.get_texts()]


@pytest.mark.parametrize("value", [0.0, 1.0, -3e-12])
@pytest.mark.parametrize("log", [False, True])
def test_constant_fields(value: float, log: bool) -> None:
    mesh = only(figure(with_field(sample(), "C", value), panels=[Panel("map", ("C",), "Oxygen", log=log)]))
    assert mesh.norm.vmin < value < mesh.norm.vmax
    np.testing.assert_array_equal(mesh.get_array(), value)
    assert bar(mesh).extend == "neither"
    assert isinstance(mesh.norm, LogNorm) == (log and value > 0.0)


def test_a_value_that_is_not_a_number_is_grey() -> None:
    result = sample()
    values = result["alpha"].copy()
    values[-1, :9] = np.nan  # along the lower side
    picture = figure(with_field(result, "alpha", values), panels=[ALPHA])
    mesh = only(picture)
    np.testing.assert_array_equal(np.ma.getmaskarray(mesh.get_array()), np.arange(len(values[-1])) < 9)
    assert mesh.get_clim() == pytest.approx((0.2, 0.8))
    render(picture)
    np.testing.assert_allclose(mesh._facecolors[:9, :3], 0.8)


def test_flat_bodies_keep_some_height() -> None:
    flat = Mesh(corner().points * [1.0, 0.01], corner().triangles)
    axes = only(figure(sample(mesh=flat), panels=[ALPHA])).axes
    assert np.ptp(axes.get_ylim()) == pytest.approx(0.2 * np.ptp(axes.get_xlim()))
    assert np.mean(axes.get_ylim()) == pytest.approx(0.02)


def test_a_body_that_shrinks_fits_with_its_outline_at_rest() -> None:
    result = with_field(sample(), "displacement", -0.5 * corner().points)
    axes = only(figure(result, panels=[ALPHA])).axes
    assert axes.get_xlim() == pytest.approx((-0.03, 1.03))


# Logarithmic colours


def test_logarithmic_colours_end_four_decades_below_the_largest() -> None:
    result = sample()
    mesh = only(figure(result, panels=[STRESS]))
    assert isinstance(mesh.norm, LogNorm)
    least = 0.5 * 10.0**-3.375  # at x = 3/8, the last of the points within four decades
    assert mesh.get_clim() == pytest.approx((least, 0.5))
    np.testing.assert_allclose(mesh.get_array(), np.maximum(result["stress_magnitude"][-1], least), rtol=1e-12)
    assert bar(mesh).extend == "min"


def test_logarithmic_colours_of_few_decades() -> None:
    values = 10.0 ** -corner().points[:, 0]
    mesh = only(figure(with_field(sample(), "stress_magnitude", values), panels=[STRESS]))
    assert mesh.get_clim() == pytest.approx((0.1, 1.0))
    assert bar(mesh).extend == "neither"


def test_logarithmic_colours_do_not_show_rounding() -> None:
    values = 2.0 + 1e-12 * corner().points[:, 0]
    mesh = only(figure(with_field(sample(), "stress_magnitude", values), panels=[STRESS]))
    assert mesh.get_clim() == pytest.approx((2.0 / np.sqrt(10.0), 2.0 * np.sqrt(10.0)))


@pytest.mark.parametrize("low", [0.0, -1.0])
def test_what_has_no_logarithm_has_the_lowest_colour(low: float) -> None:
    x = corner().points[:, 0]
    picture = figure(with_field(sample(), "stress_magnitude", np.where(x < 0.5, low, 1.0 + x)), panels=[STRESS])
    mesh = only(picture)
    assert mesh.get_clim() == pytest.approx((1.5, 2.0))
    assert bar(mesh).extend == "min"
    render(picture)
    np.testing.assert_allclose(mesh._facecolors[x < 0.5], np.broadcast_to(colour_map()(0.0), (np.sum(x < 0.5), 4)))


# Vectors


def arrows(picture: Figure) -> Quiver:
    (found,) = [artist for artist in only(picture).axes.collections if isinstance(artist, Quiver)]
    return found


def graded() -> Mesh:
    """The same body, most of its points close to the left side."""
    mesh = corner(20)
    x, y = mesh.points.T
    return Mesh(np.column_stack([np.where(x <= 0.5, 4.0 * x**3, x), y]), mesh.triangles)


@pytest.mark.parametrize("mesh", [corner(), graded()])
def test_arrows_are_spread_evenly_over_the_deformed_body(mesh: Mesh) -> None:
    quiver = arrows(figure(sample(mesh=mesh), panels=[MOVED]))
    places = quiver.XY
    assert 185 <= len(places) <= 215
    x, y = places.T
    assert (places > 0.0).all()
    assert (places < 4.0).all()
    assert not ((x > 2.0) & (y > 2.0)).any()
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 10.0 * np.eye(len(places))
    np.testing.assert_allclose(apart.min(axis=1), np.sqrt(2.0 / np.sqrt(3.0) * 12.0 / 200), rtol=1e-6)
    for quarter in ((x < 2.0) & (y < 2.0), (x > 2.0), (y > 2.0)):
        assert np.mean(quarter) == pytest.approx(1.0 / 3.0, abs=0.04)


def test_arrows_are_those_of_the_field_there() -> None:
    quiver = arrows(figure(sample(), panels=[MOVED]))
    np.testing.assert_allclose(np.column_stack([quiver.U, quiver.V]), 0.75 * quiver.XY, rtol=1e-9)
    longest = np.max(np.hypot(quiver.U, quiver.V))
    step = np.sqrt(2.0 / np.sqrt(3.0) * 12.0 / 200)
    assert longest / quiver.scale == pytest.approx(1.5 * step)
    assert (quiver.angles, quiver.scale_units, quiver.pivot) == ("xy", "xy", "middle")


def test_colours_of_a_vector_are_its_size() -> None:
    result = sample()
    mesh = only(figure(result, panels=[MOVED]))
    np.testing.assert_allclose(mesh.get_array(), 3.0 * np.hypot(*result.mesh.points.T))
    assert mesh.get_clim() == pytest.approx((0.0, 3.0 * np.hypot(1.0, 0.5)))


def test_no_arrows_on_a_body_at_rest() -> None:
    picture = figure(sample([3.0]), panels=[MOVED])
    assert not [artist for artist in only(picture).axes.collections if isinstance(artist, Quiver)]
    render(picture)


def test_an_arrow_that_is_not_a_number_leaves_the_others() -> None:
    result = sample()
    result.fields["velocity"] = result["displacement"].copy()
    result.fields["velocity"][-1, 0] = np.nan
    quiver = arrows(figure(result, panels=[Panel("map", ("velocity",), "Velocity")]))
    assert 0 < np.sum(quiver.Umask) < 10
    assert quiver.scale == pytest.approx(arrows(figure(sample(), panels=[MOVED])).scale)


def test_spread_over_bodies_that_fold_or_have_no_area() -> None:
    body = view_of(sample()).body
    assert body is not None
    assert spread_over(body, 0.0 * body.rest, body.rest, 200) is None
    assert spread_over(body, body.rest * [1.0, 1e-5], body.rest, 200) is None  # all length
    folded = body.rest.copy()
    folded[:, 0] = np.abs(folded[:, 0] - 0.5)  # the two halves cover each other
    found = spread_over(body, folded, body.rest, 200)
    assert found is not None
    places, values, _ = found
    np.testing.assert_allclose(np.abs(values[:, 0] - 0.5), places[:, 0], atol=1e-8)
    np.testing.assert_allclose(values[:, 1], places[:, 1], atol=1e-8)


# Bodies at several times


def test_growth_is_shown_at_four_times_on_common_scales() -> None:
    result = sample()
    picture = figure(result, panels=[GROWTH])
    render(picture)
    found = maps(picture)
    assert [mesh.axes.get_xlabel() for mesh in found] == ["t = 0.0", "t = 2.6", "t = 5.4", "t = 8.0"]
    for mesh, row in zip(found, (0, 13, 27, 40), strict=True):
        np.testing.assert_allclose(corners(mesh), result.mesh.points * (1.0 + 0.375 * result.t[row]))
        np.testing.assert_array_equal(mesh.get_array(), result["alpha"][row])
        assert mesh.get_clim() == pytest.approx((0.2, 0.8))
        assert mesh.axes.get_xlim() == pytest.approx((-0.12, 4.12))
    sizes = np.array([mesh.axes.get_window_extent().size for mesh in found])
    np.testing.assert_allclose(sizes, sizes[:1].repeat(4, axis=0), rtol=1e-6)
    assert [mesh.axes.get_ylabel() for mesh in found] == ["y", "", "", ""]
    assert [bar(mesh) is not None for mesh in found] == [False, False, False, True]
    assert not picture.subfigs[0].legends  # each time stands below its map


def test_growth_of_few_times() -> None:
    assert len(maps(figure(sample([0.0, 1.0]), panels=[GROWTH]))) == 2
    assert len(maps(figure(sample([3.0]), panels=[GROWTH]))) == 1


# The figure


@pytest.mark.parametrize("count", [4, 5])
def test_maps_are_equally_large_two_to_a_row_above_the_scalars(count: int) -> None:
    names = ("alpha", "p", "C", "J", "stress_magnitude")[:count]
    picture = figure(sample(), panels=[AREA, GROWTH, *(Panel("map", (name,), name) for name in names)])
    render(picture)
    drawn = titled(picture)
    assert list(drawn) == ["Growth", *names, "Area"]
    boxes = [drawn[name].get_window_extent() for name in names]
    for box in boxes:
        assert box.size == pytest.approx(boxes[0].size, rel=1e-6)
        assert box.width > 0.27 * picture.bbox.width
    for index, box in enumerate(boxes):
        assert box.x0 == pytest.approx(boxes[index % 2].x0, abs=1.0)
        assert box.y0 == pytest.approx(boxes[index - index % 2].y0, abs=1.0)
    assert drawn["Area"].get_window_extent().y1 < min(box.y0 for box in boxes)
    assert drawn["Growth"].get_window_extent().y0 > max(box.y1 for box in boxes)
    assert picture.get_figwidth() == 7.0
    for mesh in maps(picture)[4:]:
        inner = bar(mesh).ax.get_window_extent()
        assert inner.height == pytest.approx(mesh.axes.get_window_extent().height, rel=1e-6)
        assert inner.x1 < picture.bbox.x1


def test_several_names_are_several_maps() -> None:
    assert [bar(mesh).ax.get_ylabel() for mesh in maps(figure(sample(), panels=[Panel("map", ("alpha", "C"), "Both")]))] == [
        r"$\alpha$",
        "$C$",
    ]


EVERY = (
    Panel("scalar", ("radius", "hypoxic_radius", "area"), "Radius"),
    Panel("scalar", ("area",), "Of a line", grid="line"),
    Panel("scalar", ("area",), "Of a body", grid="triangles"),
    Panel("scalar", ("rim_width",), "Rim"),
    Panel("profile", ("alpha",), "Profile"),
    Panel("spacetime", ("alpha",), "Time and place"),
    Panel("ring", ("alpha",), "Section"),
    Panel("profile", ("p",), "Profile of a round body", round_only=True),
    ALPHA,
    GROWTH,
    Panel("map", ("u",), "Velocity"),
)


def on_a_line() -> Result:
    t, xi = np.linspace(0.0, 1.0, 5), np.linspace(0.1, 0.9, 5)
    fields = {"alpha": np.ones((5, 5)) * xi, "p": np.ones((5, 5)), "displacement": np.zeros((5, 5))}
    scene = '[scene]\nmodel = "tumour"\n[geometry]\nkind = "disk"\n'
    return Result(model="tumour", t=t, x=np.ones((5, 5)) * xi, scalars={"radius": 1.0 + t, "area": 1.0 + t}, fields=fields, scene=scene)


def test_panels_of_a_model_by_grid(of_model: Any) -> None:
    of_model(*EVERY)
    assert set(titled(figure(sample()))) == {"Radius", "Of a body", "Cells", "Growth"}
    line = titled(figure(on_a_line()))
    assert set(line) == {"Radius", "Of a line", "Profile", "Time and place", "Section", "Profile of a round body"}


def test_scalars_that_there_are(of_model: Any) -> None:
    of_model(Panel("scalar", ("radius", "hypoxic_radius", "doubling_time", "necrotic_radius"), "Several"))
    axes = titled(figure(sample()))["Several"]
    assert [line.get_label() for line in axes.get_lines()] == ["radius"]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["$R$", "$T_2$"]
    nowhere = sample()
    nowhere.scalars["radius"] = np.full(41, np.nan)  # of a body that is not round
    axes = titled(figure(nowhere))["Several"]
    assert [line.get_label() for line in axes.get_lines()] == ["doubling_time"]
    assert axes.get_legend() is None


@pytest.mark.parametrize(
    ("result", "panel", "message"),
    [
        (sample(), Panel("profile", ("alpha",), ""), 'two dimensions, so it has no profile to draw; use the kind "map"'),
        (sample(), Panel("ring", ("alpha",), ""), 'two dimensions, so it has no ring to draw; use the kind "map"'),
        (on_a_line(), ALPHA, 'one dimension, so it has no map to draw; use the kind "profile"'),
        (on_a_line(), GROWTH, 'one dimension, so it has no maps to draw; use the kind "profile"'),
        (sample(fields={"alpha": np.ones((41, 65))}), ALPHA, "holds no 'displacement', without which the shape"),
        (sample(), Panel("map", ("u",), ""), "the result holds no 'u'.*It holds area, "),
        (sample(), Panel("mpa", ("alpha",), ""), "no panel kind 'mpa'.*map"),
        (sample(), Panel("map", ("area",), ""), "holds nothing that its panels show"),
    ],
)
def test_panels_that_cannot_be_drawn(result: Result, panel: Panel, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        figure(result, panels=[panel])


def test_without_displacement_scalars_are_drawn(of_model: Any) -> None:
    of_model(*EVERY)
    assert set(titled(figure(sample(fields={"alpha": np.ones((41, 65))})))) == {"Radius", "Of a body"}


def test_times_without_positions_are_dropped() -> None:
    result = sample(status="failed", message="not a number")
    result.fields["displacement"][39:, 3, 1] = np.nan
    result.t[38] = np.inf
    picture = figure(result, panels=[ALPHA, AREA])
    np.testing.assert_allclose(corners(only(picture)), (1.0 + 0.375 * 7.4) * result.mesh.points)
    assert picture.get_supxlabel() == "failed at t = 7.4. not a number"
    assert legend_texts(picture) == ["outline at rest", "at t = 7.4"]


@pytest.mark.parametrize("suffix", ["pdf", "svg"])
def test_vector_files_stay_small(suffix: str) -> None:
    """Their size must not grow with the number of triangles."""

    def size(panels: Sequence[Panel], cells: int) -> int:
        buffer = io.BytesIO()
        figure(sample([0.0, 1.0], mesh=corner(cells)), panels=panels).savefig(buffer, format=suffix)
        return buffer.tell()

    assert size([ALPHA], 60) < size([ALPHA], 6) + 150_000
