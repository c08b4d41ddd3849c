"""Pictures and films of a synthetic plaque: what is drawn where, in which units, and what is refused."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from PIL import Image

from multiphase import film as film_module
from multiphase.errors import ParameterError
from multiphase.film import Film, animate, frame_times
from multiphase.model import Panel, find_model
from multiphase.plotting import Ring, View, figure, save_figure, standard, view_of
from multiphase.plotting.view import at_times, limits, time_texts
from multiphase.result import Result

TITLE = "A synthetic plaque"
PLAIN = f'[scene]\nmodel = "plaque"\ntitle = "{TITLE}"\n'
SCALES = """
[scales]
length = { value = 100.0, unit = "µm" }
time = { value = 2.0, unit = "week" }
concentration = { value = 3.0, unit = "plasma LDL" }
pressure = { value = 50.0, unit = "kPa" }
"""
N_PANEL = "Necrotic fraction"
RING_PANEL = "Cross-section of the vessel"
MAP_PANEL = "Necrotic fraction on the growing intima"
L_PANEL = "Width of the intima and its growth rate"


def sample(times: Any = None, cells: int = 12, **changes: Any) -> Result:
    """L grows from 1 to 5 over the stored times; the fields differ in space and time."""
    t = np.linspace(0.0, 8.0, 41) if times is None else np.asarray(times, dtype=float)
    span = t[-1] - t[0] if len(t) > 1 else 1.0
    s = (t - t[0]) / span
    width = 1.0 + 4.0 * s
    xi = (np.arange(cells) + 0.5) / cells
    n = 0.2 + 0.6 * xi * s[:, None]
    scalars = dict.fromkeys(("l_wall", "n_wall", "n_total", "c_total", "l_total"), 0.1 * s)
    scalars |= {f"defect_{name}": 1e-9 * s for name in "Lncl"}
    data: dict[str, Any] = {
        "model": "plaque",
        "t": t,
        "x": xi * width[:, None],
        "scalars": {"L": width, "L_rate": 0.5 + 0.1 * s, **scalars},
        "fields": {
            "n": n,
            "c": 1.0 - n,
            "l": np.exp(-xi * width[:, None]),
            "u_n": -0.1 * xi * (1.0 + s[:, None]),
            "u_m": 0.2 * xi * (1.0 + s[:, None]),
            "p_n": 0.3 - 0.1 * xi * s[:, None],
        },
        "scene": PLAIN,
    }
    return Result(**(data | changes))


def without(result: Result, *names: str) -> Result:
    return replace(result, fields={name: values for name, values in result.fields.items() if name not in names})


def with_fields(result: Result, change: Callable[[np.ndarray], np.ndarray]) -> Result:
    return replace(result, fields={name: change(values.copy()) for name, values in result.fields.items()})


def panel(picture: Figure, title: str) -> Axes:
    (found,) = [axes for axes in picture.get_axes() if axes.get_title(loc="left") == title]
    return found


def titles(picture: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in picture.get_axes() if axes.get_title(loc="left")]


def labels(picture: Figure) -> set[str]:
    return {" ".join(axes.get_ylabel().split()) for axes in picture.get_axes()} - {""}


def legend(picture: Figure) -> Any:
    (found,) = picture.subfigs[0].legends
    return found


def legend_texts(picture: Figure) -> list[str]:
    return [text.get_text() for text in legend(picture).get_texts()]


def footer(picture: Figure) -> str:
    return picture.get_supxlabel()


def render(picture: Figure) -> np.ndarray:
    """Pixels of the picture; also shows that everything in it can be drawn."""
    buffer = io.BytesIO()
    picture.savefig(buffer, format="png", dpi=50)
    buffer.seek(0)
    return np.asarray(Image.open(buffer).convert("RGB"))


def film_of(result: Result) -> Film:
    view = view_of(result)
    return Film(view, frame_times(view.t))


@pytest.fixture(scope="module")
def plain() -> Figure:
    return figure(sample())


@pytest.fixture(scope="module")
def scaled() -> Figure:
    return figure(sample(scene=PLAIN + SCALES))


# The standard figure


def test_labels_without_units(plain: Figure) -> None:
    assert labels(plain) == {
        "$L$ width of the intima",
        "$L'$ growth rate of the width",
        "position x",
        "$n$ necrotic fraction",
        "$l$ modified LDL",
        "$u_n$, $u_m$",
        "$p_n$ pressure of the necrotic phase",
    }
    assert panel(plain, L_PANEL).get_xlabel() == "time t (dimensionless)"
    assert panel(plain, N_PANEL).get_xlabel() == "position x"
    assert legend(plain).get_title().get_text() == "profiles at time t (dimensionless)"


def test_labels_with_units(scaled: Figure) -> None:
    assert labels(scaled) == {
        "$L$ width of the intima [µm]",
        "$L'$ growth rate of the width [µm/week]",
        "position x [µm]",
        "$n$ necrotic fraction",
        "$l$ modified LDL [plasma LDL]",
        "$u_n$, $u_m$ [µm/week]",
        "$p_n$ pressure of the necrotic phase [kPa]",
    }
    assert panel(scaled, L_PANEL).get_xlabel() == "time t [week]"
    assert panel(scaled, N_PANEL).get_xlabel() == "position x [µm]"
    assert legend(scaled).get_title().get_text() == "profiles at time t [week]"


def test_panels_and_titles(plain: Figure) -> None:
    assert titles(plain) == [item.title for item in find_model("plaque").panels if item.kind != "ring"]
    assert plain.get_suptitle() == TITLE
    assert figure(sample(scene="")).get_suptitle() == "Early atherosclerotic plaque"
    assert plain.get_figwidth() == 7.0


def test_profiles_show_six_stored_times(plain: Figure) -> None:
    result = sample()
    lines = panel(plain, N_PANEL).get_lines()
    rows = [0, 8, 16, 24, 32, 40]  # 0, 1.6, ..., 8
    assert len(lines) == 6
    for line, row in zip(lines, rows, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), result["x"][row])
        np.testing.assert_array_equal(line.get_ydata(), result["n"][row])
    assert legend_texts(plain) == ["0.0", "1.6", "3.2", "4.8", "6.4", "8.0"]
    assert [line.get_color() for line in legend(plain).get_lines()] == [line.get_color() for line in lines]
    assert len({to_rgba(line.get_color()) for line in lines}) == 6


def test_profiles_in_units(scaled: Figure) -> None:
    result = sample()
    last = panel(scaled, "Modified LDL").get_lines()[-1]
    np.testing.assert_allclose(last.get_xdata(), 100.0 * result["x"][-1])
    np.testing.assert_allclose(last.get_ydata(), 3.0 * result["l"][-1])
    assert legend_texts(scaled) == ["0.0", "3.2", "6.4", "9.6", "12.8", "16.0"]
    assert panel(scaled, N_PANEL).get_xlim() == pytest.approx((0.0, 525.0))


def test_two_names_share_a_profile_panel(plain: Figure) -> None:
    axes = panel(plain, "Velocities of the phases")
    lines = axes.get_lines()
    assert len(lines) == 12
    assert [line.get_linestyle() for line in lines] == ["-"] * 6 + ["--"] * 6
    np.testing.assert_array_equal(lines[-1].get_ydata(), sample()["u_m"][-1])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["$u_n$", "$u_m$"]
    assert axes.get_ylim() == pytest.approx((-0.2 * 11.5 / 12 - 0.05 * 0.6 * 11.5 / 12, 0.4 * 11.5 / 12 + 0.05 * 0.6 * 11.5 / 12), rel=0.02)


def test_scalars_of_two_units_have_two_axes(plain: Figure) -> None:
    result = sample()
    left = panel(plain, L_PANEL)
    (right,) = [axes for axes in plain.get_axes() if axes is not left and axes.get_ylabel().startswith("$L'$")]
    assert right.get_position().bounds == left.get_position().bounds
    for axes, name in ((left, "L"), (right, "L_rate")):
        (line,) = axes.get_lines()
        np.testing.assert_array_equal(line.get_xdata(), result.t)
        np.testing.assert_array_equal(line.get_ydata(), result[name])
    assert left.get_xlim() == (0.0, 8.0)
    assert left.get_ylim() == pytest.approx((0.8, 5.2))


@pytest.mark.parametrize(("scene", "length", "time"), [(PLAIN, 1.0, 1.0), (PLAIN + SCALES, 100.0, 2.0)])
def test_spacetime(scene: str, length: float, time: float, plain: Figure, scaled: Figure) -> None:
    result = sample()
    picture = plain if scene == PLAIN else scaled
    axes = panel(picture, MAP_PANEL)
    assert axes.get_xlim() == (0.0, 8.0 * time)
    assert axes.get_ylim() == pytest.approx((0.0, 1.05 * 5.0 * length))
    (wall,) = axes.get_lines()
    np.testing.assert_allclose(wall.get_xdata(), result.t * time, rtol=1e-15)
    np.testing.assert_allclose(wall.get_ydata(), result["L"] * length, rtol=1e-15)
    (mesh,) = axes.collections
    corners = mesh.get_coordinates()  # (times, edges, 2)
    assert corners.shape[1] == 13
    np.testing.assert_array_equal(corners[:, 0, 1], 0.0)
    np.testing.assert_allclose(corners[:, -1, 1], length * (1.0 + 0.5 * corners[:, -1, 0] / time))
    # Equal cells: n at a corner time and cell is 0.2 + 0.6 xi t / 8, here between two corner times.
    middle = 0.5 * (corners[1:, 0, 0] + corners[:-1, 0, 0]) / time
    xi = (np.arange(12) + 0.5) / 12
    np.testing.assert_allclose(mesh.get_array(), 0.2 + 0.6 * xi * middle[:, None] / 8.0)
    assert (mesh.norm.vmin, mesh.norm.vmax) == pytest.approx((0.2, 0.2 + 0.6 * 11.5 / 12))


def test_footer() -> None:
    assert footer(figure(sample())) == "completed at t = 8"
    assert footer(figure(sample(scene=PLAIN + SCALES))) == "completed at t = 16 week"
    assert footer(figure(sample(status="running"))) == "not finished, stored up to t = 8"
    text = footer(figure(sample(status="failed", message="The step became too small.")))
    assert text == "failed at t = 8. The step became too small."
    long = footer(figure(sample(status="stopped", message="word " * 200)))
    assert long.startswith("stopped at t = 8. word word")
    assert long.endswith("...")
    assert max(map(len, long.splitlines())) <= 110
    assert len(long) <= 221


def test_dollars_and_underscores_in_texts() -> None:
    picture = figure(sample(scene='[scene]\ntitle = "$1 and _{$"\n', status="failed", message=r"bad \frac $x_$ value"))
    render(picture)
    assert picture.get_suptitle() == "$1 and _{$"
    render(film_of(sample(scene='[scene]\ntitle = "$1 and _{$"\n')).figure)
    assert r"bad \frac $x_$ value" in footer(picture)


def test_long_title_is_wrapped_into_the_picture() -> None:
    result = sample(scene=f'[scene]\ntitle = "{"necrotic macrophages " * 8}"\n')
    film = film_of(result)
    for picture in (figure(result), film.figure):
        render(picture)
        (title,) = [text for text in picture.texts if text.get_text().startswith("necrotic")]
        assert "\n" in title.get_text()
        box = title.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= picture.bbox.x1
        assert box.y1 <= picture.bbox.y1


# Cross-sections of a round body

VESSEL = PLAIN + '[geometry]\nkind = "annulus"\nlumen_radius = 3.0\n'


def rings(picture: Figure) -> list[Axes]:
    """The cross-sections: they alone have an equal aspect and an image."""
    return [axes for axes in picture.get_axes() if axes.get_aspect() == 1.0 and axes.images]


def radii(outline: Any) -> list[float]:
    """Radii of the circles in the outline of a ring, largest first."""
    ends = [part.get_extents() for part in outline.get_path()._iter_connected_components()]
    assert all(end.x0 == pytest.approx(-end.x1) and end.y0 == pytest.approx(-end.y1) and end.x1 == pytest.approx(end.y1) for end in ends)
    return [float(end.x1) for end in ends]


def along_a_radius(image: Any) -> tuple[np.ndarray, np.ma.MaskedArray]:
    """Distances from the centre and values of the pixels to the right of it."""
    values = image.get_array()
    side, reach = values.shape[0], image.get_extent()[1]
    return (np.arange(side // 2) + 0.5) / side * 2.0 * reach, values[side // 2, side // 2 :]


def disk(**changes: Any) -> View:
    """A view of a round body without a hollow, of a model that is not installed."""
    view = view_of(sample(**changes))
    return replace(view, inner=0.0)


@pytest.mark.parametrize(("scales", "length", "times"), [("", 1.0, "{}"), (SCALES, 100.0, "{} week")])
def test_rings_have_the_radii_of_the_vessel(scales: str, length: float, times: str) -> None:
    result = sample(scene=VESSEL + scales)
    picture = figure(result)
    found = rings(picture)
    rows = [0, 13, 27, 40]  # stored times next to 0, 8/3, 16/3 and 8
    assert len(found) == 4
    bounds = {(axes.get_position().width.round(6), axes.get_xlim(), axes.get_ylim()) for axes in found}
    assert len(bounds) == 1  # one scale
    assert found[0].get_xlim() == pytest.approx((-1.05 * 8.0 * length, 1.05 * 8.0 * length))
    assert found[0].get_ylim() == found[0].get_xlim()
    factor = 2.0 if scales else 1.0
    for axes, row in zip(found, rows, strict=True):
        (outline,) = axes.patches
        assert radii(outline) == pytest.approx([(3.0 + result["L"][row]) * length, 3.0 * length], rel=1e-4)  # circles of Bezier curves
        assert axes.get_xlabel() == "t = " + times.format(f"{result.t[row] * factor:.1f}")


def test_rings_are_coloured_by_the_distance_from_the_endothelium() -> None:
    result = sample(scene=VESSEL)
    last = rings(figure(result))[-1]
    (image,) = last.images
    r, values = along_a_radius(image)
    wall = (r > 3.0) & (r < 8.0)
    cell = np.floor((r[wall] - 3.0) / 5.0 * 12)
    inside = np.abs((r[wall] - 3.0) / 5.0 * 12 - np.rint((r[wall] - 3.0) / 5.0 * 12)) > 0.05  # not next to a face
    np.testing.assert_allclose(values[wall][inside], result["n"][-1][cell.astype(int)][inside])
    assert image.get_clim() == pytest.approx((0.2, 0.2 + 0.6 * 11.5 / 12))  # of all stored times, as in the map
    np.testing.assert_allclose(values, image.get_array()[300:, 300])  # the same all round


def test_a_ring_is_cut_to_its_outline() -> None:
    """Pixels within the lumen and beyond the outer wall stay white; the wall is coloured."""
    picture = Figure(figsize=(4.0, 4.0), dpi=100)
    axes = picture.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    view = view_of(sample(scene=VESSEL))
    ring = Ring(view, "n", axes)
    ring.show(view.edges[20], view.values["n"][20])  # from 3 to 6 of 8.4
    buffer = io.BytesIO()
    picture.savefig(buffer, format="png", dpi=100)
    row = np.asarray(Image.open(buffer).convert("RGB"))[200].astype(int)
    r = np.abs((np.arange(400) + 0.5) / 200.0 - 1.0) * 8.4
    coloured = np.ptp(row, axis=1) > 40
    assert coloured[(r > 3.1) & (r < 5.9)].all()
    assert (row[(r < 2.9) | (r > 6.1)] == 255).all()


def test_rings_are_labelled() -> None:
    picture = figure(sample(scene=VESSEL + SCALES))
    assert RING_PANEL in titles(picture)
    first, *others = rings(picture)
    assert first.get_title(loc="left") == RING_PANEL
    assert first.get_ylabel() == "distance from\nthe centre [µm]"
    assert rings(figure(sample(scene=VESSEL)))[0].get_ylabel() == "distance from\nthe centre"
    assert [text.get_text() for text in first.texts] == ["lumen"]
    assert first.texts[0].get_position() == (0.0, 0.0)
    picture.draw_without_rendering()
    ticks = [text.get_text() for text in first.get_yticklabels()]
    assert "0" in ticks
    assert not any("-" in text or "\u2212" in text for text in ticks)
    assert all(not axes.get_ylabel() and not axes.texts for axes in others)
    assert [axes.get_ylabel() for axes in picture.get_axes()].count("$n$ necrotic fraction") == 3  # map, rings, profile


def test_name_of_a_narrow_lumen_stands_beside_it() -> None:
    first = rings(figure(sample(scene=VESSEL.replace("3.0", "0.5"))))[0]
    (text,) = first.texts
    assert text.get_text() == "lumen"
    assert text.get_position() == (0.04, 1.0)
    assert text.xy == (0.0, 0.0)


def test_no_rings_in_a_slab_or_without_the_field(plain: Figure) -> None:
    assert rings(plain) == []
    assert RING_PANEL not in titles(plain)
    assert plain.get_figheight() == pytest.approx(0.9 + 3 * 2.35)
    assert rings(figure(without(sample(scene=VESSEL), "n"))) == []
    assert rings(figure(sample(scene=PLAIN + '[geometry]\nkind = "slab"\n'))) == []


def test_rings_of_one_and_two_times() -> None:
    for times, texts in (([3.0], ["t = 3"]), ([0.0, 8.0], ["t = 0", "t = 8"])):
        picture = figure(sample(times, scene=VESSEL))
        assert [axes.get_xlabel() for axes in rings(picture)] == texts
        render(picture)
        lefts = [axes.get_position().x0 for axes in rings(picture)]
        assert lefts[0] < 0.15  # from the left, as large as four would be
        assert rings(picture)[0].get_position().width < 0.25


def test_rings_show_what_is_not_a_number_in_grey() -> None:
    result = sample(scene=VESSEL)
    result.fields["n"][40, 6:] = np.nan
    (image,) = rings(figure(result))[-1].images
    r, values = along_a_radius(image)
    np.testing.assert_array_equal(np.ma.getmaskarray(values)[np.abs(r - 5.5) > 0.05], (r > 5.5)[np.abs(r - 5.5) > 0.05])


def test_a_disk_has_one_outline_and_no_hollow() -> None:
    view = disk()
    axes = Figure().add_subplot()
    ring = Ring(view, "n", axes)
    ring.show(view.edges[-1], view.values["n"][-1])
    ring.name_hollow("lumen", 10.0)
    assert radii(ring.outline) == pytest.approx([5.0], rel=1e-4)
    assert axes.get_xlim() == pytest.approx((-5.25, 5.25))
    assert len(axes.texts) == 0


def test_rows_of_the_figure() -> None:
    a, b, c = (Panel("profile", ("n",), title) for title in "ABC")
    ring = Panel("ring", ("n",), "R")
    assert standard._layout([a, ring, b, c]) == [[a, b], [ring], [c]]
    assert standard._layout([a, b, ring, c]) == [[a, b], [ring], [c]]
    assert standard._layout([ring]) == [[ring]]


@pytest.mark.parametrize(("scales", "length"), [("", 1.0), (SCALES, 100.0)])
def test_film_of_a_vessel(scales: str, length: float) -> None:
    result = sample(scene=VESSEL + scales)
    film = film_of(result)
    assert film.ring is not None
    axes = film.ring.image.axes
    for frame in (40, 20, 0):
        film.show(frame)
        assert radii(film.ring.outline) == pytest.approx([(3.0 + result["L"][frame]) * length, 3.0 * length], rel=1e-4)
        r, values = along_a_radius(film.ring.image)
        middle = (3.0 + result["x"][frame]) * length
        np.testing.assert_allclose(values[np.searchsorted(r, middle)], result["n"][frame])
        assert axes.get_xlim() == axes.get_ylim() == pytest.approx((-8.4 * length, 8.4 * length))
    assert film.ring.image.get_clim() == film.band.get_clim()
    assert axes.get_ylabel() == "distance from\nthe centre" + (" [µm]" if scales else "")
    assert [text.get_text() for text in axes.texts] == ["lumen"]
    assert axes.get_position().x1 < film.band_axes.get_position().x0


def test_film_of_a_slab_has_no_ring() -> None:
    film = film_of(sample())
    assert film.ring is None
    assert rings(film.figure) == []
    assert film.figure.get_figwidth() == 7.0


def test_gif_of_a_vessel_grows(tmp_path: Path) -> None:
    result = sample(scene=VESSEL)
    animate(result, tmp_path / "a.gif")
    film = film_of(result)
    assert film.ring is not None
    box = film.ring.image.axes.get_position()
    shares = []
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 41
        for frame in (0, 40):
            image.seek(frame)
            pixels = np.asarray(image.convert("RGB")).astype(int)
            height, width = pixels.shape[:2]
            part = pixels[round((1 - box.y1) * height) : round((1 - box.y0) * height), round(box.x0 * width) : round(box.x1 * width)]
            shares.append(np.mean(np.ptp(part, axis=2) > 40))
    areas = [np.pi * ((3.0 + L) ** 2 - 9.0) / 16.8**2 for L in (1.0, 5.0)]
    assert shares == pytest.approx(areas, rel=0.12)  # less the outlines


# Panels that cannot be drawn


def test_panel_without_its_field_is_left_out() -> None:
    everything = [item.title for item in find_model("plaque").panels if item.kind != "ring"]
    assert titles(figure(without(sample(), "l"))) == [title for title in everything if title != "Modified LDL"]
    assert "Velocities of the phases" not in titles(figure(without(sample(), "u_m")))
    only_scalars = figure(sample(fields={}))
    assert titles(only_scalars) == [L_PANEL]
    assert only_scalars.subfigs[0].legends == []


def test_nothing_left_to_draw() -> None:
    with pytest.raises(
        ParameterError, match=r"output\.fields: .*nothing that its panels show \(L, L_rate, n, l, u_n, u_m, p_n\)"
    ) as caught:
        figure(sample(fields={}, scalars={}))
    assert caught.value.path == "output.fields"


def test_given_panels() -> None:
    picture = figure(sample(), panels=[Panel("spacetime", ("n", "c"), "Maps"), Panel("scalar", ("n_total",), "Total")])
    assert titles(picture) == ["Maps", "Maps", "Total"]
    assert {"$n$ necrotic fraction", "$c$ macrophage fraction"} <= labels(picture)
    (line,) = panel(picture, "Total").get_lines()
    np.testing.assert_array_equal(line.get_ydata(), sample()["n_total"])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (Panel("profile", ("u_x",), "A"), r"panels: the result holds no 'u_x'.*It holds "),
        (Panel("profiles", ("n",), "A"), r"panels: there is no panel kind 'profiles'.*Kinds: scalar, profile, spacetime, ring"),
        (Panel("ring", ("n",), "A"), r"panels: the domain of this result is flat, so it has no rings"),
        (Panel("scalar", ("n",), "A"), r"nothing that its panels show \(n\)"),
        (Panel("profile", ("n", "l", "p_n"), "A"), r"one panel can show two units, but n, l, p_n have 3"),
    ],
)
def test_bad_panels(given: Panel, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        figure(sample(), panels=[given])


def test_no_time_with_finite_positions() -> None:
    with pytest.raises(ParameterError, match="no time with finite positions"):
        figure(sample(x=np.full((41, 12), np.nan)))
    with pytest.raises(ParameterError, match="no time with finite positions"):
        figure(Result(model="plaque", t=[], scalars={"L": []}, x=np.zeros((0, 12))))


# Edge cases


def test_one_stored_time() -> None:
    picture = figure(sample([3.0]))
    assert [text.get_text() for text in panel(picture, MAP_PANEL).texts] == ["needs two stored times"]
    assert len(panel(picture, N_PANEL).get_lines()) == 1
    assert legend_texts(picture) == ["3"]
    assert panel(picture, L_PANEL).get_lines()[0].get_marker() == "o"
    low, high = panel(picture, L_PANEL).get_xlim()
    assert low < 3.0 < high
    render(picture)


def test_one_stored_time_at_zero() -> None:
    picture = figure(sample([0.0]))
    assert legend_texts(picture) == ["0"]
    assert footer(picture) == "completed at t = 0"
    render(picture)


def test_two_stored_times() -> None:
    picture = figure(sample([0.0, 8.0]))
    assert len(panel(picture, N_PANEL).get_lines()) == 2
    assert legend_texts(picture) == ["0", "8"]
    np.testing.assert_array_equal(panel(picture, MAP_PANEL).get_lines()[0].get_ydata(), [1.0, 5.0])


@pytest.mark.parametrize("end", [1e9, 1e-7])
def test_huge_and_tiny_times(end: float) -> None:
    picture = figure(sample(np.linspace(0.0, end, 41)))
    texts = legend_texts(picture)
    assert len(set(texts)) == 6
    np.testing.assert_allclose([float(text) for text in texts], np.linspace(0.0, end, 6), rtol=1e-2)
    assert max(map(len, texts)) <= 8
    assert panel(picture, MAP_PANEL).get_xlim() == (0.0, end)
    render(picture)


def test_row_that_is_not_a_number() -> None:
    def spoil(values: np.ndarray) -> np.ndarray:
        values[16] = np.nan
        return values

    picture = figure(with_fields(sample(), spoil))
    lines = panel(picture, N_PANEL).get_lines()
    assert len(lines) == 6
    assert np.isnan(lines[2].get_ydata()).all()
    (mesh,) = panel(picture, MAP_PANEL).collections
    bad = np.ma.getmaskarray(mesh.get_array())
    times = mesh.get_coordinates()[:, 0, 0]
    middle = 0.5 * (times[1:] + times[:-1])
    np.testing.assert_array_equal(bad.all(axis=1), (middle > 3.0) & (middle < 3.4))
    assert np.isfinite(panel(picture, N_PANEL).get_ylim()).all()
    assert np.isfinite([mesh.norm.vmin, mesh.norm.vmax]).all()
    render(picture)


def test_fields_without_any_number() -> None:
    picture = figure(with_fields(sample(), lambda values: np.full_like(values, np.nan)))
    assert panel(picture, N_PANEL).get_ylim() == (0.0, 1.0)
    render(picture)


def test_times_without_positions_are_dropped() -> None:
    result = sample(status="failed", message="not a number")
    result.x[39:] = np.nan
    result.scalars["L"][38] = np.inf
    picture = figure(result)
    (wall,) = panel(picture, MAP_PANEL).get_lines()
    np.testing.assert_array_equal(wall.get_ydata(), sample()["L"][:38])
    assert panel(picture, L_PANEL).get_lines()[0].get_xdata()[-1] == sample().t[37]
    assert footer(picture) == "failed at t = 7.4. not a number"


@pytest.mark.parametrize("value", [0.0, 2.0, -3e-12])
def test_constant_fields(value: float) -> None:
    picture = figure(with_fields(sample(), lambda values: np.full_like(values, value)))
    low, high = panel(picture, N_PANEL).get_ylim()
    assert low < value < high
    (mesh,) = panel(picture, MAP_PANEL).collections
    assert mesh.norm.vmin < value < mesh.norm.vmax


def test_two_cells() -> None:
    picture = figure(sample(cells=2))
    assert [len(line.get_xdata()) for line in panel(picture, N_PANEL).get_lines()] == [2] * 6
    (mesh,) = panel(picture, MAP_PANEL).collections
    np.testing.assert_allclose(mesh.get_coordinates()[-1, :, 1], [0.0, 2.5, 5.0])


def test_result_without_a_grid() -> None:
    picture = figure(sample(x=None, fields={}))
    assert titles(picture) == [L_PANEL]
    assert panel(picture, L_PANEL).get_lines()[0].get_ydata()[-1] == 5.0


# Helpers


@pytest.mark.parametrize(
    ("times", "texts"),
    [
        ([0.0, 1.0, 2.0], ["0", "1", "2"]),
        ([0.0, 0.25, 0.5], ["0.00", "0.25", "0.50"]),
        ([99.999, 100.0], ["99.999", "100.000"]),
        ([0.0, 2e-5], ["0", "2e-05"]),
        ([7.4], ["7.4"]),
        ([0.0], ["0"]),
        ([1e6, 1e6 + 1], ["1000000", "1000001"]),
    ],
)
def test_time_texts(times: list[float], texts: list[str]) -> None:
    assert time_texts(np.array(times)) == texts


def test_limits() -> None:
    assert limits(np.array([0.0, 10.0])) == (-0.5, 10.5)
    assert limits(np.array([0.0, np.nan, 10.0, np.inf]), margin=0.0) == (0.0, 10.0)
    assert limits(np.array([2.0, 2.0 + 1e-12])) == pytest.approx((1.8, 2.2))
    assert limits(np.zeros(3)) == (-1.0, 1.0)
    assert limits(np.array([np.nan])) == (0.0, 1.0)


def test_at_times_keeps_stored_rows() -> None:
    t = np.array([0.0, 1.0, 3.0])
    values = np.array([[0.0, 1.0], [2.0, np.nan], [4.0, 5.0]])
    got = at_times(t, values, np.array([0.0, 0.5, 2.0, 3.0]))
    np.testing.assert_array_equal(got, [[0.0, 1.0], [1.0, np.nan], [3.0, np.nan], [4.0, 5.0]])
    np.testing.assert_array_equal(at_times(t[:1], values[:1], np.array([0.0, 9.0])), values[[0, 0]])


# Files


@pytest.mark.parametrize(("name", "start"), [("a.png", b"\x89PNG"), ("a.PDF", b"%PDF"), ("a.svg", b"<?xml")])
def test_save_figure(tmp_path: Path, name: str, start: bytes) -> None:
    path = tmp_path / name
    path.write_text("old")
    save_figure(without(sample(), "u_n", "p_n", "l"), path)
    assert path.read_bytes().startswith(start)
    assert [item.name for item in tmp_path.iterdir()] == [name]
    if name.endswith(".png"):
        assert Image.open(path).size[0] == 1400  # 7 inches at 200 dpi


def test_save_figure_that_fails_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def savefig(self: Figure, path: Path, **options: Any) -> None:
        Path(path).write_text("half")
        raise OSError("disk full")

    path = tmp_path / "a.png"
    path.write_text("old")
    monkeypatch.setattr(Figure, "savefig", savefig)
    with pytest.raises(OSError, match="disk full"):
        save_figure(sample([0.0, 1.0]), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.gif", "no/a.png"])
def test_save_figure_refuses_before_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(standard, "figure", lambda *_: pytest.fail("was drawn"))
    words = "there is no folder .*no'; create it first" if "/" in name else r"must end in \.png, \.pdf or \.svg"
    with pytest.raises(ParameterError, match=words):
        save_figure(sample(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.avi", "a", "a.png", "no/a.gif"])
def test_animate_refuses_before_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(film_module, "Film", lambda *_: pytest.fail("was drawn"))
    words = "there is no folder .*no'; create it first" if "/" in name else r"must end in \.gif or \.mp4"
    with pytest.raises(ParameterError, match=words):
        animate(sample(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_mp4_without_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film_module, "Film", lambda *_: pytest.fail("was drawn"))
    monkeypatch.setattr(film_module.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ParameterError, match=r"a\.mp4': ffmpeg was not found; write a \.gif instead, or install ffmpeg"):
        animate(sample(), tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fps", [0, 61, -1])
def test_bad_fps(tmp_path: Path, fps: int) -> None:
    with pytest.raises(ParameterError, match=f"fps: {fps} frames a second"):
        animate(sample([0.0]), tmp_path / "a.gif", fps=fps)


# Films


def band_share(frame: np.ndarray, film: Film) -> float:
    """The coloured part of the film's band in a frame of a gif, as a share of its axes."""
    box = film.band_axes.get_position()
    height, width = frame.shape[:2]
    row = frame[int((1.0 - 0.5 * (box.y0 + box.y1)) * height), round(box.x0 * width) : round(box.x1 * width)].astype(int)
    return float(np.mean(np.ptp(row, axis=1) > 40))  # neither white, black nor grey


def test_gif(tmp_path: Path) -> None:
    result, calls, path = sample(), [], tmp_path / "a.gif"
    animate(result, path, fps=20, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(i, 41) for i in range(1, 42)]
    assert list(tmp_path.iterdir()) == [path]
    film = film_of(result)
    with Image.open(path) as image:
        assert image.n_frames == 41
        assert image.info["duration"] == 50
        first = np.asarray(image.convert("RGB"))
        image.seek(40)
        last = np.asarray(image.convert("RGB"))
    assert band_share(first, film) == pytest.approx(1.0 / 5.25, abs=0.01)
    assert band_share(last, film) == pytest.approx(5.0 / 5.25, abs=0.01)


def test_film_that_fails_keeps_the_old_file(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "a.gif"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        animate(sample(), path, progress=stop)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_gif_of_one_time(tmp_path: Path) -> None:
    animate(sample([3.0]), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as image:
        assert getattr(image, "n_frames", 1) == 1


@pytest.mark.parametrize(("scene", "length", "end"), [(PLAIN, 1.0, "8.0"), (PLAIN + SCALES, 100.0, "16.0 week")])
def test_film_follows_the_wall(scene: str, length: float, end: str) -> None:
    result = sample(scene=scene)
    film = film_of(result)
    for frame in (0, 40):
        film.show(frame)
        wall = result["L"][frame] * length
        assert film.band.get_extent() == pytest.approx([0.0, wall, 0.0, 1.0])
        assert film.wall_line.get_xdata() == pytest.approx([wall, wall])
        assert film.outer_text.get_position()[0] == pytest.approx(wall)
        pixels = film.band.get_array()[0]
        np.testing.assert_allclose(pixels.reshape(12, 50), np.repeat(result["n"][frame][:, None], 50, axis=1))
        n_line, l_line = (line for line, _ in film.profiles)
        np.testing.assert_allclose(n_line.get_xdata(), result["x"][frame] * length)
        np.testing.assert_allclose(n_line.get_ydata(), result["n"][frame])
        assert len(l_line.get_ydata()) == 12
    assert film.title.get_text() == f"{TITLE}, t = {end}"
    assert film.band_axes.get_xlim() == pytest.approx((0.0, 5.25 * length))


def test_film_labels() -> None:
    film = film_of(sample(scene=PLAIN + SCALES))
    assert film.band_axes.get_ylabel() == "lumen |\nendothelium"
    assert film.outer_text.get_text() == "media"
    assert labels(film.figure) == {"lumen | endothelium", "$n$ necrotic fraction", "$l$ modified LDL [plasma LDL]"}
    assert [axes.get_xlabel() for axes in film.figure.axes if axes.get_xlabel()] == ["position x [µm]"]


def test_film_of_two_units_in_one_panel_names_its_position_axis() -> None:
    view = view_of(sample())
    view = replace(view, model=replace(view.model, panels=(Panel("profile", ("n", "l"), "Both"),)))
    film = Film(view, frame_times(view.t))
    (named,) = [axes for axes in film.figure.axes if axes.get_xlabel()]
    assert named.xaxis.get_visible()  # not that of the twin
    assert named.get_ylabel() == "$n$ necrotic fraction"
    assert len(film.profiles) == 2


def test_film_frames_are_even_in_time() -> None:
    assert len(frame_times(np.linspace(0.0, 8.0, 41))) == 41
    assert len(frame_times(np.linspace(0.0, 8.0, 1000))) == 150
    few = frame_times(np.array([0.0, 0.1, 8.0]))
    np.testing.assert_allclose(few, np.linspace(0.0, 8.0, 100))
    np.testing.assert_array_equal(frame_times(np.array([3.0])), [3.0])


def test_film_of_two_times_grows_evenly() -> None:
    film = film_of(sample([0.0, 8.0]))
    np.testing.assert_allclose(film.wall, np.linspace(1.0, 5.0, 100))
    film.show(0)
    assert film.band.get_extent()[1] == 1.0
    film.show(99)
    assert film.band.get_extent()[1] == 5.0


def test_film_shows_what_is_not_a_number_in_grey() -> None:
    result = sample()
    result.fields["n"][40, 6:] = np.nan
    film = film_of(result)
    film.show(40)
    np.testing.assert_array_equal(np.ma.getmaskarray(film.band.get_array())[0], np.arange(600) >= 300)
    frame = render(film.figure)
    assert np.mean((frame == 204).all(axis=2)) > 0.03  # grey 0.8, about half of the band
    film.show(0)
    assert not np.ma.getmaskarray(film.band.get_array()).any()


def test_film_with_fewer_fields() -> None:
    film = film_of(without(sample(), "l", "u_n", "p_n"))
    assert len(film.profiles) == 1
    with pytest.raises(ParameterError, match=r"output\.fields: the film colours 'n', which this result does not hold"):
        film_of(without(sample(), "n"))
    with pytest.raises(ParameterError, match="needs fields on a one-dimensional grid"):
        film_of(sample(x=None, fields={}))


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_film_of_two_constant_cells(value: float) -> None:
    film = film_of(with_fields(sample(cells=2), lambda values: np.full_like(values, value)))
    assert film.band.norm.vmin < value < film.band.norm.vmax
    np.testing.assert_array_equal(film.band.get_array(), np.full((1, 600), value))


def test_pyplot_is_never_imported(tmp_path: Path) -> None:
    code = (
        "import importlib.util, sys\n"
        f"spec = importlib.util.spec_from_file_location('sample_of', {__file__!r})\n"
        "module = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(module)\n"
        "result = module.sample([0.0])\n"
        f"module.save_figure(result, {str(tmp_path / 'a.png')!r})\n"
        f"module.animate(result, {str(tmp_path / 'a.gif')!r})\n"
        "assert 'matplotlib.figure' in sys.modules\n"
        "print('matplotlib.pyplot' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "False", done.stderr
    assert len(list(tmp_path.iterdir())) == 2
