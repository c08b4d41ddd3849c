"""Results in memory: names, interpolation in time, units, xarray."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from multiphase import result as result_module
from multiphase.cli import main
from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.model import Quantity
from multiphase.result import Result, load

SCALES = """
[scene]
model = "synthetic"
[scales]
length = { value = 100.0, unit = "µm" }
time = { value = 2.0, unit = "week" }
"""


def sample(**changes: object) -> Result:
    t = np.array([0.0, 0.5, 2.0])
    width = 1 + t
    xi = (np.arange(4) + 0.5) / 4
    data: dict[str, object] = {
        "model": "synthetic",
        "t": t,
        "x": xi * width[:, None],
        "scalars": {"L": width, "L_rate": np.ones(3)},
        "fields": {"n": xi * t[:, None], "l": np.full((3, 4), 3.0)},
        "checkpoint": {"state": np.arange(3.0)},
        "descriptions": {"n": "necrotic fraction"},
    }
    return Result(**(data | changes))  # type: ignore[arg-type]


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> None:
    quantities = {
        "L": Quantity("L", "L", "width", {"length": 1}),
        "L_rate": Quantity("L_rate", "L'", "growth rate", {"length": 1, "time": -1}),
        "n": Quantity("n", "n", "necrotic fraction"),
        "displacement": Quantity("displacement", "x - X", "displacement", {"length": 1}),
        "l": Quantity("l", "l", "modLDL", {"concentration": 1}),
    }
    monkeypatch.setattr(result_module, "find_model", lambda name: SimpleNamespace(quantities=quantities))


def on_mesh(**changes: object) -> Result:
    """The unit square in two triangles, stretched along y."""
    t = np.array([0.0, 0.5, 2.0])
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), np.array([[0, 1, 2], [1, 3, 2]]))
    moved = np.zeros((3, 4, 2))
    moved[:, 2:, 1] = t[:, None]
    fields = {"n": np.arange(4) * t[:, None], "displacement": moved}
    data: dict[str, object] = {"model": "synthetic", "t": t, "mesh": mesh, "scalars": {"L": 1 + t}, "fields": fields}
    return Result(**(data | changes))  # type: ignore[arg-type]


def test_on_a_mesh() -> None:
    result = on_mesh()
    assert repr(result) == ("<Result of synthetic, completed: 3 times in [0, 2], 4 nodes, 2 triangles; scalars L; fields n, displacement>")
    assert result.positions(2).tolist() == [[0, 0], [1, 0], [0, 3], [1, 3]]
    assert result.positions(0).tolist() == on_mesh().mesh.points.tolist()  # type: ignore[union-attr]
    row = result.at(1.25)
    assert row["displacement"][:, 1] == pytest.approx([0, 0, 1.25, 1.25], rel=1e-15)  # linear in t
    assert row["n"] == pytest.approx(np.arange(4) * 1.25, rel=1e-15)
    assert result.width() is None


def test_info_tells_nodes_and_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("multiphase.model.find_model", lambda name: SimpleNamespace(title="Synthetic", summary=lambda result: []))
    on_mesh().save(tmp_path / "mesh.h5")
    sample().save(tmp_path / "cells.h5")
    assert main(["info", str(tmp_path / "mesh.h5")]) == 0
    assert "3 times, 4 nodes, 2 triangles; fields n, displacement" in capsys.readouterr().out
    assert main(["info", str(tmp_path / "cells.h5")]) == 0
    assert "3 times, 4 cells; fields n, l" in capsys.readouterr().out
    told = []
    for name in ("mesh", "cells"):
        assert main(["info", "--json", str(tmp_path / f"{name}.h5")]) == 0
        data = json.loads(capsys.readouterr().out)
        told.append((data["nodes"], data["triangles"]))
    assert told == [(4, 2), (None, None)]


def test_positions_without_a_mesh_or_a_displacement() -> None:
    result = sample()
    assert np.array_equal(result.positions(1), result["x"][1])
    with pytest.raises(ParameterError, match="no positions"):
        sample(x=None).positions(0)
    with pytest.raises(ParameterError, match="displacement"):
        on_mesh(fields={}).positions(0)


def test_fields_must_fit_the_mesh() -> None:
    with pytest.raises(ParameterError, match=r"n: has shape \(3, 5\), but the mesh has 4 nodes"):
        on_mesh(fields={"n": np.zeros((3, 5))})
    with pytest.raises(ParameterError, match="n: has shape"):
        on_mesh(fields={"n": np.zeros(3)})
    with pytest.raises(ParameterError, match="both"):
        on_mesh(x=np.zeros((3, 4)))


@pytest.mark.usefixtures("model")
def test_a_mesh_in_units() -> None:
    result = on_mesh(scene=SCALES)
    shown = result.in_units()
    assert shown.mesh is not None
    assert shown.mesh.points.tolist() == [[0, 0], [100, 0], [0, 100], [100, 100]]
    assert shown.unit("points") == "µm"
    assert shown.positions(2).tolist() == [[0, 0], [100, 0], [0, 300], [100, 300]]
    assert result.mesh is not None
    assert result.mesh.points.max() == 1, "the result itself is as it was"


def test_a_mesh_in_xarray() -> None:
    pytest.importorskip("xarray")
    data = on_mesh().to_xarray()
    assert dict(data.sizes) == {"time": 3, "point": 4, "component": 2, "triangle": 2, "corner": 3}
    assert data["displacement"].dims == ("time", "point", "component")
    assert data["n"].dims == ("time", "point")
    assert set(data.coords) == {"t", "x_rest", "y_rest"}
    assert data["y_rest"].values.tolist() == [0, 0, 1, 1]
    assert data["triangles"].values.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_names() -> None:
    result = sample()
    assert result["t"] is result.t
    assert result["x"] is result.x
    assert result["L"] is result.scalars["L"]
    assert result["n"] is result.fields["n"]
    assert "n" in result
    assert "m" not in result


def test_a_wrong_name_gets_the_nearest() -> None:
    with pytest.raises(KeyError, match=r'L_rat.*did you mean "L_rate"'):
        sample()["L_rat"]
    with pytest.raises(KeyError, match="'x'"):
        sample(x=None)["x"]


def test_short_representation() -> None:
    assert repr(sample()) == "<Result of synthetic, completed: 3 times in [0, 2], 4 cells; scalars L, L_rate; fields n, l>"


def test_lists_become_arrays_and_wrong_lengths_are_named() -> None:
    assert Result(model="m", t=[0, 1], scalars={"L": [1, 2]})["L"].shape == (2,)  # type: ignore[arg-type, dict-item]
    with pytest.raises(ParameterError, match=r"L: has shape \(2,\), but there are 3 stored times"):
        sample(scalars={"L": np.ones(2)})
    with pytest.raises(ParameterError, match="t: "):
        sample(t=np.zeros((3, 1)))


def test_at_a_stored_time_gives_the_stored_values() -> None:
    row = sample().at(0.5)
    assert row["L"] == 1.5
    assert isinstance(row["L"], float)
    assert np.array_equal(row["n"], sample()["n"][1])
    gap = sample(scalars={"L": np.array([np.nan, 1.5, np.inf])})
    assert gap.at(0.5)["L"] == 1.5, "neighbours have no say"


def test_at_between_stored_times_is_linear() -> None:
    row = sample().at(1.25)
    # All sample values are linear in t, so only rounding (a few 1e-16) remains.
    assert row["L"] == pytest.approx(2.25, rel=1e-15)
    assert row["n"] == pytest.approx((np.arange(4) + 0.5) / 4 * 1.25, rel=1e-15)
    assert row["x"] == pytest.approx((np.arange(4) + 0.5) / 4 * 2.25, rel=1e-15)
    assert row["l"] == pytest.approx(np.full(4, 3.0), rel=1e-15)


def test_at_gives_a_copy() -> None:
    result = sample()
    result.at(0.5)["n"][:] = 99
    assert result["n"].max() < 99


@pytest.mark.parametrize("time", [-0.1, 2.1, float("nan")])
def test_at_outside_the_stored_times(time: float) -> None:
    with pytest.raises(ParameterError, match="outside the stored times from 0 to 2"):
        sample().at(time)


@pytest.mark.usefixtures("model")
def test_in_units() -> None:
    result = sample(scene=SCALES)
    shown = result.in_units()
    assert np.array_equal(shown.t, result.t * 2)
    assert shown.x == pytest.approx(np.asarray(result.x) * 100, rel=1e-15)  # one product: rounding
    assert shown["L"] == pytest.approx(result["L"] * 100, rel=1e-15)
    assert shown["L_rate"] == pytest.approx(np.full(3, 50.0), rel=1e-15)
    assert np.array_equal(shown["n"], result["n"])
    assert np.array_equal(shown["l"], result["l"]), "no concentration scale, so it stays dimensionless"
    assert shown.units == {"t": "week", "x": "µm", "L": "µm", "L_rate": "µm/week", "n": "-", "l": "-"}
    assert shown.checkpoint == {}
    assert result.units == {}, "the result itself is as it was"
    assert result["L"][0] == 1


@pytest.mark.usefixtures("model")
def test_in_units_twice_scales_once(tmp_path: Path) -> None:
    shown = sample(scene=SCALES).in_units()
    assert shown.in_units() is shown
    shown.save(tmp_path / "run.h5")
    assert np.array_equal(load(tmp_path / "run.h5").in_units()["L"], shown["L"])


def test_in_units_without_scales() -> None:
    for scene in ("", '[scene]\nmodel = "synthetic"\n'):
        result = sample(scene=scene)
        assert result.in_units() is result


@pytest.mark.usefixtures("model")
def test_a_quantity_the_model_does_not_know_stays_dimensionless() -> None:
    shown = sample(scene=SCALES, fields={"hdl": np.ones((3, 4))}).in_units()
    assert shown.unit("hdl") == "-"
    assert np.all(shown["hdl"] == 1)


def test_width() -> None:
    result = sample()
    assert result.width() is result["L"]
    # Cells of equal size: the width follows from their centres up to rounding.
    assert sample(scalars={}).width() == pytest.approx(result["L"], rel=1e-14)
    assert sample(x=None).width() is None
    one = sample(scalars={}, x=np.full((3, 1), 0.5), fields={})
    assert one.width() == pytest.approx(np.ones(3), rel=1e-15)


def test_save_refuses_an_existing_file(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    sample().save(path)
    with pytest.raises(ParameterError, match="exists already"):
        sample(message="second").save(path)
    assert load(path).message == ""
    sample(message="second").save(path, overwrite=True)
    assert load(str(path)).message == "second"


@pytest.mark.usefixtures("model")
def test_to_xarray() -> None:
    pytest.importorskip("xarray")
    shown = sample(scene=SCALES).in_units()
    data = shown.to_xarray()
    assert dict(data.sizes) == {"time": 3, "cell": 4}
    assert data["n"].dims == ("time", "cell")
    assert data["L"].dims == ("time",)
    assert set(data.coords) == {"t", "x"}
    assert data["x"].dims == ("time", "cell")
    assert data["x"].attrs["unit"] == "µm"
    assert data["n"].attrs == {"unit": "-", "long_name": "necrotic fraction"}
    assert data.attrs["model"] == "synthetic"
    assert np.array_equal(data["n"].values, shown["n"])


def test_to_xarray_without_xarray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"pip install multiphase-tissue\[xarray\]"):
        sample().to_xarray()


def test_pictures_are_left_to_plotting(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []
    plotting = SimpleNamespace(figure=lambda result, **options: calls.append(("figure", result, options)) or "a figure")
    film = SimpleNamespace(animate=lambda result, path, **options: calls.append(("animate", result, path, options)))
    for name, module in (("plotting", plotting), ("film", film)):
        monkeypatch.setitem(sys.modules, f"multiphase.{name}", module)
        monkeypatch.setattr(f"multiphase.{name}", module, raising=False)
    result = sample()
    assert result.plot(panels=None) == "a figure"
    result.animate("run.gif", fps=3)
    assert calls == [("figure", result, {"panels": None}), ("animate", result, "run.gif", {"fps": 3})]


def test_importing_results_stays_light() -> None:
    code = "import sys, multiphase.result; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"matplotlib", "scipy", "numba", "fipy", "xarray", "h5py"} & set(loaded)
