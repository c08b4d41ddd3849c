"""Comparing results: common times, common positions, what counts and what does not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skfem import MeshTri

from multiphase.cli import main
from multiphase.compare import Comparison, Difference, compare
from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import Result


def sample(cells: int = 8, times: Any = (0.0, 0.5, 1.0), power: int = 1) -> Result:
    t = np.asarray(times, dtype=float)
    xi = (np.arange(cells) + 0.5) / cells
    width = 1 + t
    return Result(
        model="plaque",
        t=t,
        x=xi * width[:, None],
        scalars={"L": width, "defect_n": np.full(len(t), 1e-16)},
        fields={"n": xi**power * width[:, None], "l": np.ones((len(t), cells))},
        checkpoint={"state": np.arange(3.0)},
    )


def change(result: Result, name: str, index: Any, by: float) -> Result:
    group = "scalars" if name in result.scalars else "fields"
    values = result[name].copy()
    values[index] += by
    return replace(result, **{group: getattr(result, group) | {name: values}})


def of(comparison: Comparison, name: str) -> Difference:
    return next(entry for entry in comparison.differences if entry.name == name)


def test_identical() -> None:
    found = compare(sample(), sample())
    assert found.identical
    assert found.worst == 0
    assert "identical bit for bit" in found.table()
    assert not found.exceeds(0)


@pytest.mark.parametrize(
    "other",
    [
        replace(sample(), checkpoint={"state": np.arange(3.0) + 1}),
        replace(sample(), checkpoint={}),
        change(sample(), "defect_n", 1, 1e-18),
        replace(sample(), checkpoint={"state": np.arange(3.0).view(np.int64)}),
        replace(sample(), x=None),
        sample(times=(0, 0.5, 1, 1.5)),
    ],
    ids=["checkpoint", "no checkpoint", "one bit", "type", "no positions", "more times"],
)
def test_not_identical(other: Result) -> None:
    found = compare(sample(), other)
    assert not found.identical
    assert "identical bit for bit" not in found.table()


def test_a_minus_zero_is_not_the_same_bits() -> None:
    zero = replace(sample(), scalars={"k": np.zeros(3)})
    found = compare(zero, replace(zero, scalars={"k": -np.zeros(3)}))
    assert not found.identical
    assert found.worst == 0


def test_a_field_difference_is_found_where_it_is() -> None:
    entry = of(compare(sample(), change(sample(), "n", (1, 2), 0.25)), "n")
    assert entry.kind == "field"
    assert entry.max_abs == 0.25  # the values are sums of few powers of two, so nothing is rounded
    assert entry.l1 == 0.25 / 8
    assert entry.time == 0.5
    assert entry.xi == 2.5 / 8
    assert entry.scale == 1.875
    assert entry.relative_to_scale == 0.25 / 1.875


def test_a_scalar_difference_is_found_where_it_is() -> None:
    entry = of(compare(sample(), change(sample(), "L", 0, -0.25)), "L")
    assert (entry.kind, entry.max_abs, entry.time, entry.scale) == ("scalar", 0.25, 0.0, 2.0)
    assert entry.max_relative == 0.25
    assert entry.relative_to_scale == 0.125
    assert entry.xi is None


def test_l1_is_the_mean_over_cells_at_the_worst_time() -> None:
    b = change(change(sample(), "l", 1, 0.5), "l", (2, 0), 1.0)
    entry = of(compare(sample(), b), "l")
    assert entry.max_abs == 1.0
    assert entry.time == 1.0
    assert entry.l1 == 0.5


def test_only_common_times_count() -> None:
    a, b = sample(times=(0, 0.3, 0.5, 1)), sample(times=(0, 0.5, 0.7, 1, 2))
    found = compare(a, change(b, "L", (2,), 5.0))
    assert found.times == (0, 0.5, 1)
    assert found.worst == 0


def test_times_that_differ_by_rounding_are_common() -> None:
    a, b = sample(times=(0, 0.1 * 3)), sample(times=(0, 0.3))
    assert a.t[1] != b.t[1]
    assert len(compare(a, b).times) == len(compare(b, a).times) == 2
    later = sample(times=(0, 0.3, 1))
    assert len(compare(a, later).times) == len(compare(later, a).times) == 2
    with pytest.raises(ParameterError, match="no common time"):
        compare(a, sample(times=(0, 0.3 * (1 + 1e-11))))


def test_the_finer_grid_goes_to_the_coarser() -> None:
    for a, b in ((sample(8), sample(32)), (sample(32), sample(8))):
        found = compare(a, b)
        assert found.cells == 8
        # n is linear in x, which linear interpolation gives up to rounding of values of size 2.
        assert of(found, "n").max_abs < 1e-14


def test_interpolation_is_of_second_order() -> None:
    errors = [of(compare(sample(8, power=2), sample(cells, power=2)), "n").max_abs for cells in (24, 72)]
    # xi², width 2: the chord is at most h²/8 · 2 · 2 off. A cell number three times as large keeps the points, so the error falls as h².
    assert errors[0] <= 2 * 2 / (8 * 24**2) + 1e-14
    odd = [of(compare(sample(8, power=2), sample(cells, power=2)), "n").max_abs for cells in (16, 32)]
    assert odd[0] / odd[1] == pytest.approx(4, rel=1e-10)


def test_positions_are_relative_to_the_width() -> None:
    a = sample()
    b = replace(a, x=2 * np.asarray(a.x), scalars=a.scalars | {"L": 2 * a["L"]})
    found = compare(a, b)
    assert of(found, "n").max_abs == 0
    assert of(found, "L").relative_to_scale == 0.5


def test_unequal_cells_of_the_same_number_are_interpolated() -> None:
    a = sample()
    xi = ((np.arange(8) + 0.5) / 8) ** 0.9
    b = replace(a, x=xi * a["L"][:, None], fields={"n": xi * a["L"][:, None]})
    # n = x in both: interior cells agree to rounding; np.interp holds the end values constant beyond the outermost centres.
    found = of(compare(a, b), "n")
    assert found.max_abs == pytest.approx(2 * (xi[0] - 0.5 / 8), rel=1e-12)
    assert found.xi == 0.5 / 8


def test_defects_do_not_count() -> None:
    found = compare(sample(), change(sample(), "defect_n", 1, 1.0))
    assert of(found, "defect_n").max_abs == pytest.approx(1.0, rel=1e-15)  # less the 1e-16 that was there
    assert found.worst == 0
    assert "defect_n" in found.table()


def test_worst_and_tolerance() -> None:
    b = change(change(sample(), "n", (2, 7), 0.1875), "L", 1, 0.05)
    found = compare(sample(), b)
    assert found.largest.name == "n"
    # scale: the changed value itself, 1.875 + 0.1875
    assert found.worst == 0.1875 / 2.0625
    assert found.exceeds(0.09)
    assert not found.exceeds(found.worst)


def test_noise_about_zero_does_not_count_as_a_difference() -> None:
    a = replace(sample(), scalars={"k": np.full(3, 1e-17)})
    b = replace(sample(), scalars={"k": np.full(3, -1e-17)})
    # 2e-17 over the smallest scale 1e-10
    assert compare(a, b).worst < 1e-6


def test_nan_on_one_side_exceeds_every_tolerance() -> None:
    found = compare(sample(), change(sample(), "n", (1, 1), np.nan))
    assert found.worst == np.inf
    assert found.exceeds(1e300)
    assert of(found, "n").scale == 1.875
    loaded = json.loads(found.to_json())
    assert loaded["worst"] == "inf"


def test_nan_or_infinity_on_both_sides_is_no_difference() -> None:
    for value in (np.nan, np.inf):
        a = change(change(sample(), "n", (1, 1), value), "L", 0, value)
        assert compare(a, replace(a, checkpoint={})).worst == 0


def test_quantities_of_one_side_are_listed() -> None:
    a, b = sample(), sample()
    del a.fields["l"]
    b.scalars["extra"] = np.ones(3)
    found = compare(a, b)
    assert found.only_a == ()
    assert found.only_b == ("extra", "l")
    assert "only in B: extra, l" in found.table()


def test_results_without_positions() -> None:
    a, b = replace(sample(), x=None), replace(change(sample(), "n", (0, 0), 1.0), x=None)
    entry = of(compare(a, b), "n")
    assert (entry.max_abs, entry.xi) == (1.0, None)
    with pytest.raises(ParameterError, match="different meshes"):
        compare(a, replace(sample(16), x=None))


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (replace(sample(), model="tumour"), "different models, 'plaque' and 'tumour'"),
        (sample(times=(0, 0.25)), "no common time beyond the start"),
        (replace(sample(), units={"L": "µm"}), "'L' is in '-' in one result and in 'µm'"),
        (replace(sample(), scalars={"k": np.ones(3)}, fields={}), "no quantity in common"),
        (Result(model="plaque", t=np.zeros(0)), "no common time"),
    ],
)
def test_what_cannot_be_compared(other: Result, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        compare(sample(), other)


def test_json() -> None:
    found = compare(sample(), change(sample(), "n", (1, 2), 0.25))
    data = json.loads(found.to_json())
    assert data["worst"] == found.worst
    assert data["worst_quantity"] == "n"
    assert data["identical"] is False
    assert [entry["name"] for entry in data["differences"]] == ["L", "defect_n", "n", "l"]
    assert data["differences"][2]["xi"] == 2.5 / 8


def test_table() -> None:
    lines = compare(sample(), change(sample(), "n", (1, 2), 0.25)).table().splitlines()
    assert lines[0] == "compared at 3 common times, 0 to 1 and 8 positions"
    row = next(line for line in lines if line.startswith("n "))
    assert row.split() == ["n", "2.500e-01", "1.333e-01", "3.125e-02", "0.5", "0.3125"]
    assert lines[-1].startswith("worst: n, 1.333e-01")
    assert max(map(len, lines)) <= 90


def test_the_cost_of_both_is_told_where_it_is_known() -> None:
    stats = {"steps": 7, "rejected_error": 1, "rejected_solver": 2, "iterations": 20, "wall_s": 0.0123, "solver": "lines"}
    found = compare(replace(sample(), stats=stats), replace(sample(), stats={}))
    assert "A: 7 steps (3 rejected), 20 iterations, 0.012 s with lines on 1 thread" in found.table()
    assert "B:" not in found.table()
    assert "7 steps" in found.to_json()


# -- on meshes --------------------------------------------------------------------------------------------------------


def square(refinements: int = 3, side: float = 1.0) -> Mesh:
    mesh = MeshTri().refined(refinements)
    return Mesh(side * mesh.p.T, mesh.t.T)


def disk(edges: int) -> Mesh:
    """A polygon in the unit circle and its centre: its boundary lies within the circle, more so with fewer edges."""
    angles = 2 * np.pi * np.arange(edges) / edges
    points = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angles), np.sin(angles)], axis=-1)])
    around = np.arange(edges)
    return Mesh(points, np.stack([np.zeros(edges, dtype=int), 1 + around, 1 + (around + 1) % edges], axis=-1))


def on_mesh(mesh: Mesh | None = None, bend: float = 0.0) -> Result:
    """Fields that are linear in space, but for `bend`."""
    mesh = mesh or square()
    t = np.array([0.0, 0.5, 1.0])
    x, y = mesh.points.T
    moved = t[:, None, None] * np.stack([3.0 * x, 4.0 * y + bend * x**2], axis=-1)
    return Result(
        model="tumour",
        t=t,
        mesh=mesh,
        scalars={"area": 1 + t},
        fields={"alpha": (1 + 2 * x - y) * (1 + t[:, None]) + bend * x**2, "displacement": moved},
    )


def test_one_mesh_is_compared_node_by_node() -> None:
    a = on_mesh()
    assert a.mesh is not None
    found = compare(a, change(change(a, "alpha", (1, 7), 0.25), "displacement", (2, 9), np.array([0.3, -0.4])))
    entry = of(found, "alpha")
    assert entry.max_abs == pytest.approx(0.25, rel=1e-14)
    assert (entry.time, entry.xi, entry.position) == (0.5, None, tuple(a.mesh.points[7]))
    assert entry.scale == 6.0
    assert entry.l1 == pytest.approx(0.25 * a.mesh.point_areas()[7], rel=1e-13)  # of a body of area 1
    entry = of(found, "displacement")
    assert entry.max_abs == pytest.approx(0.5, rel=1e-14)  # the length of (0.3, -0.4)
    assert entry.position == tuple(a.mesh.points[9])
    assert entry.scale == 5.0  # of (3, 4)
    assert found.cells == 81
    assert found.notes == ()
    assert not found.identical


def test_meshes_that_differ_by_rounding_are_one() -> None:
    a = on_mesh()
    assert a.mesh is not None
    found = compare(a, replace(a, mesh=Mesh(a.mesh.points + 1e-13, a.mesh.triangles)))
    assert found.notes == ()
    assert found.worst == 0.0
    assert not found.identical
    assert compare(a, on_mesh()).identical
    moved = compare(a, replace(a, mesh=Mesh(a.mesh.points + 1e-9, a.mesh.triangles)))
    assert moved.notes


def test_another_mesh_of_the_body_is_interpolated() -> None:
    for b, size in ((square(4), "289 nodes, 512 triangles"), (square(1), "9 nodes, 8 triangles")):
        found = compare(on_mesh(), on_mesh(b))
        # Linear interpolation of linear fields: rounding of values of size 6 remains.
        assert found.worst < 1e-15
        assert found.cells == 81
        assert found.notes == (
            f"different meshes: fields of B ({size}) are interpolated linearly to the nodes of A (81 nodes, 128 triangles)",
        )
        assert found.notes[0] in found.table()
        assert json.loads(found.to_json())["notes"] == list(found.notes)


def test_interpolation_on_meshes_is_of_second_order() -> None:
    fine = on_mesh(square(5), bend=1.0)
    errors = [of(compare(fine, on_mesh(square(level), bend=1.0)), "alpha").max_abs for level in (2, 3)]
    # x² between its values at a distance of h: h²/4 off in the middle, where the finer mesh has nodes.
    assert errors == pytest.approx([1 / 64, 1 / 256], rel=1e-12)


def test_nodes_outside_of_a_coarser_boundary_take_the_nearest_triangle() -> None:
    a, b = on_mesh(disk(64)), on_mesh(disk(12))
    for found in (compare(a, b), compare(b, a)):
        assert found.notes[0].startswith("different meshes")
        assert found.worst < 1e-15  # continued linearly, so linear fields stay exact


@pytest.mark.parametrize("other", [square(side=2.0), square(side=0.5), disk(40)])
def test_fields_on_different_bodies_are_not_compared(other: Mesh) -> None:
    found = compare(on_mesh(), on_mesh(other))
    assert [entry.name for entry in found.differences] == ["area"]
    assert found.notes == ("fields are not compared: the meshes are of different bodies",)
    assert found.cells is None


def test_a_mesh_and_cells_compare_by_their_scalars() -> None:
    a = on_mesh()
    b = replace(a, mesh=None, x=np.ones((3, 5)), scalars={"area": 1.5 * a["area"]}, fields={"alpha": np.ones((3, 5))})
    for found, note in ((compare(a, b), "A is on a mesh, B is not"), (compare(b, a), "B is on a mesh, A is not")):
        assert [entry.name for entry in found.differences] == ["area"]
        assert found.notes == (f"fields are not compared: {note}",)
        assert found.worst == pytest.approx(1 / 3, rel=1e-14)
        assert found.notes[0] in found.table()


def test_table_of_results_on_a_mesh() -> None:
    a = on_mesh()
    table = compare(a, change(a, "alpha", (1, 3), 0.25)).table().splitlines()
    assert table[0] == "compared at 3 common times, 0 to 1 and 81 positions"
    assert a.mesh is not None
    x, y = a.mesh.points[3]
    row = next(line for line in table if line.startswith("alpha "))
    assert row.split() == ["alpha", "2.500e-01", "4.167e-02", f"{0.25 * a.mesh.point_areas()[3]:.3e}", "0.5", f"({x:.4g},", f"{y:.4g})"]
    assert max(map(len, table)) <= 100


def test_meshes_in_different_units() -> None:
    with pytest.raises(ParameterError, match=r"meshes.*different units"):
        compare(on_mesh(), replace(on_mesh(), units={"points": "µm"}))


def test_what_is_not_finite_is_said_in_words() -> None:
    a = replace(sample(), scalars={"doubling_time": np.array([np.nan, np.inf, 2.0])})
    assert compare(a, replace(a, checkpoint={})).worst == 0
    table = compare(a, change(a, "doubling_time", 0, 0.0)).table()
    assert "not finite" not in table
    b = replace(a, scalars={"doubling_time": np.array([np.nan, 5.0, 2.0])})
    table = compare(a, b).table()
    assert table.splitlines()[-1] == "worst: doubling_time, not finite in one (balance defects not counted)"
    row = next(line for line in table.splitlines() if line.startswith("doubling_time "))
    assert row.split() == ["doubling_time", "not", "finite", "in", "one", "0.5"]
    assert "inf" not in table.replace("finite", "")


# -- What counts, and what the scenes say -----------------------------------------------------------------------------


def test_what_has_no_say_is_shown_and_does_not_count() -> None:
    """The asymmetry of a disk on a mesh: an error of the mesh first of all."""
    a = replace(on_mesh(), scalars={"area": 1 + on_mesh().t, "asymmetry": np.array([0.0, 1e-3, 2e-3])})
    b = change(a, "asymmetry", 2, 1e-3)
    found = compare(a, b)
    assert of(found, "asymmetry").relative_to_scale == pytest.approx(1 / 3)
    assert found.worst == 0.0
    assert not found.exceeds(0.0)
    assert "asymmetry has no say, as it measures the error of the mesh first of all" in found.notes
    assert found.table().splitlines()[-1] == "worst: area, 0.000e+00 of its scale (balance defects and asymmetry not counted)"
    assert compare(a, change(b, "area", 1, 0.3)).exceeds(0.09)


def test_tolerance_and_refusals() -> None:
    """Equal to the tolerance is within it; where no agreement is claimed, no tolerance is large enough."""
    found = compare(sample(), change(sample(), "L", 1, 0.05))
    assert [found.exceeds(tol) for tol in (0.0, 0.99 * found.worst, found.worst, 1.0)] == [True, True, False, False]
    refused = replace(found, refusals=("A: it is not round",))
    assert refused.exceeds(1e300)
    assert refused.table().splitlines()[-1] == "no agreement is claimed: A: it is not round"


def test_the_scenes_say_what_differs() -> None:
    text = '[geometry]\nkind = "{}"\n[parameters]\nb = {}\nPsi_l = {{ times = [{}], values = [1, 2] }}\n[solver]\ncells = {}\n'
    long = ", ".join(map(str, range(40)))
    a, b = (
        replace(sample(), scene=text.format("slab", 1.0, long, 8)),
        replace(sample(), scene=text.format("annulus", 2.0, f"{long}, 99", 9)),
    )
    assert compare(a, b).notes == (
        'scenes differ: geometry.kind is "slab" in A, "annulus" in B',
        "scenes differ: parameters.b is 1.0 in A, 2.0 in B",
        "scenes differ: parameters.Psi_l.times has other numbers in B",
        "different bodies: fields are compared at equal x/width, and integrals are over bodies of different shape",
    )
    assert compare(a, a).notes == ()
    assert not any("scenes differ" in note for note in compare(a, replace(b, scene="")).notes)


def test_courses_and_profiles() -> None:
    """The largest difference at each common time, and over the body when it is largest, over the scale."""
    found = compare(sample(), change(change(sample(), "n", (1, 2), 0.25), "n", (2, 5), -0.0625))
    entry = of(found, "n")
    assert entry.course == (0.0, 0.25 / 1.875, 0.0625 / 1.875)
    assert entry.along == tuple(((i + 0.5) / 8, 0.25 / 1.875 if i == 2 else 0.0) for i in range(8))
    assert of(found, "L").course == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("mesh", [False, True])
def test_json_gives_the_comparison_back(mesh: bool) -> None:
    a = on_mesh() if mesh else sample()
    b = change(change(a, "alpha" if mesh else "n", (1, 2), np.nan), "area" if mesh else "L", 1, 0.1)
    found = replace(compare(a, b), refusals=("A: why",), notes=("one", "two"), costs=("cheap", ""))
    assert found.worst == np.inf
    assert Comparison.from_json(found.to_json()) == found
    assert "Infinity" not in found.to_json()
    assert "NaN" not in found.to_json()
    scattered = replace(found, scatter=(replace(found.differences[-1], kind="scatter", side="B", rms=0.1),))
    assert Comparison.from_json(scattered.to_json()) == scattered


def test_scatter_counts() -> None:
    entry = Difference(name="n", kind="scatter", side="B", max_abs=0.4, rms=0.2, scale=2.0, relative_to_scale=0.1, time=1.0, xi=0.5)
    found = replace(compare(sample(), sample()), scatter=(entry,))
    assert found.worst == 0.1
    table = found.table().splitlines()
    assert table[-1] == "worst: scatter of n in B, 1.000e-01 of its scale (balance defects not counted)"
    assert table[-3].split() == ["n", "B", "2.000e-01", "1.000e-01", "4.000e-01", "1", "0.5000"]


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_the_figure_of_differences(tmp_path: Path, suffix: str) -> None:
    found = compare(sample(), change(sample(), "n", (1, 2), 0.25))
    found.save_figure(tmp_path / f"a.{suffix}")
    assert (tmp_path / f"a.{suffix}").stat().st_size > 1000
    fields, along, scalars = found.figure().axes
    np.testing.assert_allclose(fields.lines[0].get_ydata(), [np.nan, 0.25 / 1.875, np.nan])  # nothing to see is a gap
    assert np.nanmax(along.lines[0].get_ydata()) == 0.25 / 1.875
    assert along.get_xlabel() == "x/width"
    assert len(scalars.lines) == 1  # not the defect
    assert fields.get_yscale() == "log"


def test_the_figure_of_no_difference_and_of_meshes() -> None:
    same = compare(sample(), sample()).figure()
    assert ["no difference" in [text.get_text() for text in axes.texts] for axes in same.axes] == [True, True, True]
    a = on_mesh()
    assert len(compare(a, change(a, "alpha", (1, 7), 0.25)).figure().axes) == 2  # no positions 0 to 1
    with pytest.raises(ParameterError, match="must end in"):
        compare(a, a).save_figure("a.gif")


def test_columns_of_places_where_there_are_some() -> None:
    a = on_mesh()
    heading = next(line for line in compare(a, a).table().splitlines() if line.startswith("quantity"))
    assert heading.endswith("at rest (x, y)")
    scalars = compare(a, replace(a, mesh=None, x=np.ones((3, 5)), fields={"alpha": np.ones((3, 5))})).table()
    assert "x/width" not in scalars
    assert "at rest" not in scalars


def test_a_mesh_and_cells_in_the_same_units() -> None:
    """A result on a mesh has no x, and so no unit of it."""
    a = replace(on_mesh(), units={"area": "mm²", "points": "mm"})
    b = replace(a, mesh=None, x=np.ones((3, 5)), fields={}, units={"area": "mm²", "x": "mm"})
    assert compare(a, b).worst == 0.0
    assert compare(b, a).worst == 0.0


# -- The command ------------------------------------------------------------------------------------------------------


def test_the_command_says_where_it_looked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    sample().save("a.h5")
    for files in (("a.h5", "runs/b.h5"), ("runs/b.h5", "a.h5")):
        assert main(["compare", *files]) == 2
        assert f"there is no file 'runs/b.h5'; looked for {tmp_path / 'runs' / 'b.h5'}" in capsys.readouterr().err


def test_the_command_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    sample().save("a.h5")
    change(sample(), "n", (1, 2), 0.25).save("b.h5")
    assert main(["compare", "a.h5", "b.h5", "-o", "d.png", "--tol", "0.2"]) == 0
    assert Path("d.png").read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.endswith("d.png written\n")
    assert main(["compare", "a.h5", "b.h5", "-o", "d.svg", "--tol", "0.1", "--json"]) == 1
    output = capsys.readouterr()
    assert Comparison.from_json(output.out).worst == 0.25 / 1.875
    assert output.err == "d.svg written\n"
    assert main(["compare", "a.h5", "b.h5", "-o", "d.gif"]) == 2
    assert not Path("d.gif").exists()
