"""VTKHDF files, as VTK's own reader sees them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from skfem import MeshTri

from multiphase import result as result_module
from multiphase import vtkhdf
from multiphase.cli import main
from multiphase.errors import ParameterError
from multiphase.export import export
from multiphase.mesh import Mesh
from multiphase.model import Quantity
from multiphase.result import Result
from multiphase.scene import OutputTable

SCALES = '[scales]\nlength = { value = 100.0, unit = "µm" }\ntime = { value = 2.0, unit = "day" }\n'


def sample() -> Result:
    """A square that is stretched and bent."""
    square = MeshTri().refined(3)
    mesh = Mesh(square.p.T, square.t.T)
    t = np.array([0.0, 0.1, 1 / 3, 2.0])
    x, y = mesh.points.T
    moved = t[:, None, None] * np.stack([0.3 * x, 0.1 * y**2 + 0.05 * x], axis=-1)
    return Result(
        model="synthetic",
        t=t,
        mesh=mesh,
        scalars={"area": 1 + t, "doubling_time": np.array([np.nan, np.inf, 1.0, 2.0])},
        fields={"alpha": np.sin(x + t[:, None]), "displacement": moved, "C": np.cos(y * t[:, None])},
        descriptions={"alpha": "cell fraction"},
    )


def steps(path: Path) -> tuple[tuple[float, ...], list[Any]]:
    """Times, and at each of them the grid that VTK reads."""
    reading = pytest.importorskip("vtkmodules.vtkIOHDF")
    pipeline = pytest.importorskip("vtkmodules.vtkCommonExecutionModel").vtkStreamingDemandDrivenPipeline
    kind = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkUnstructuredGrid
    reader = reading.vtkHDFReader()
    reader.SetFileName(str(path))
    assert reader.CanReadFile(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS())
    grids = []
    for time in times:
        reader.UpdateTimeStep(time)
        grids.append(kind())
        grids[-1].DeepCopy(reader.GetOutputDataObject(0))
    return times, grids


def array(data: Any) -> Any:
    return pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy(data)


def test_vtk_reads_every_step_exactly(tmp_path: Path) -> None:
    result = sample()
    assert export(result, tmp_path / "run.vtkhdf") == (tmp_path / "run.vtkhdf",)
    times, grids = steps(tmp_path / "run.vtkhdf")
    assert times == tuple(result.t)
    for index, grid in enumerate(grids):
        points = array(grid.GetPoints().GetData())
        assert points.dtype == np.float64
        assert np.array_equal(points, np.pad(result.positions(index), ((0, 0), (0, 1))))
        assert grid.GetNumberOfCells() == 128
        values = grid.GetPointData()
        assert {values.GetArrayName(i) for i in range(values.GetNumberOfArrays())} == {"alpha", "displacement", "C"}
        for name in ("alpha", "C"):
            assert np.array_equal(array(values.GetArray(name)), result[name][index])
        assert np.array_equal(array(values.GetArray("displacement")), np.pad(result["displacement"][index], ((0, 0), (0, 1))))
        for name in ("area", "doubling_time"):
            assert np.array_equal(array(grid.GetFieldData().GetArray(name)), result[name][[index]], equal_nan=True)


def test_vtk_sees_triangles_of_positive_area(tmp_path: Path) -> None:
    result = sample()
    vtkhdf.write(result, tmp_path / "run.vtkhdf")
    _, grids = steps(tmp_path / "run.vtkhdf")
    for index, grid in enumerate(grids):
        assert {grid.GetCellType(i) for i in range(grid.GetNumberOfCells())} == {5}
        corners = array(grid.GetCells().GetConnectivityArray()).reshape(-1, 3)
        assert result.mesh is not None
        assert np.array_equal(corners, result.mesh.triangles)
        a, b, c = (array(grid.GetPoints().GetData())[corners[:, k]] for k in range(3))
        areas = 0.5 * np.cross(b - a, c - a)[:, 2]
        assert areas.min() > 0
        # x -> (1 + 0.3 t) x; the top, y = 1, rises by 0.1 t, and 0.05 x t shears, which keeps areas.
        assert areas.sum() == pytest.approx((1 + 0.3 * result.t[index]) * (1 + 0.1 * result.t[index]), rel=1e-13)


def test_pyvista_reads_it(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    result = sample()
    vtkhdf.write(result, tmp_path / "run.vtkhdf")
    first = pyvista.read(tmp_path / "run.vtkhdf")
    assert (first.n_points, first.n_cells) == (81, 128)
    assert np.array_equal(first["alpha"], result["alpha"][0])
    reader = pyvista.get_reader(tmp_path / "run.vtkhdf")
    reader.reader.SetStep(3)
    assert np.array_equal(reader.read()["alpha"], result["alpha"][3])


def test_the_triangles_are_stored_once(tmp_path: Path) -> None:
    vtkhdf.write(sample(), tmp_path / "run.vtkhdf")
    with h5py.File(tmp_path / "run.vtkhdf") as file:
        group = file["VTKHDF"]
        assert group["Connectivity"].shape == (3 * 128,)
        assert group["Points"].shape == (4 * 81, 3)
        assert group["Steps"].attrs["NSteps"] == 4
        assert group.attrs["Version"].tolist() == [2, 0]
        assert dict(group["PointData/alpha"].attrs) == {"unit": "-", "description": "cell fraction"}


def test_units_where_the_scene_has_scales(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quantities = {"displacement": Quantity("displacement", "u", "displacement", {"length": 1})}
    monkeypatch.setattr(result_module, "find_model", lambda name: SimpleNamespace(quantities=quantities))
    result = replace(sample(), scene=SCALES)
    export(result, tmp_path / "a.vtkhdf")
    export(result, tmp_path / "b.vtkhdf", units=False)
    assert vtkhdf.write_copy(result, tmp_path / "c.h5") == tmp_path / "c.vtkhdf"
    for name, length, time, unit in (("a", 100, 2, "µm"), ("b", 1, 1, "-"), ("c", 100, 2, "µm")):
        with h5py.File(tmp_path / f"{name}.vtkhdf") as file:
            points = file["VTKHDF/Points"]
            assert points[-81:, :2] == pytest.approx(length * result.positions(3), rel=1e-15)
            assert points.attrs["unit"] == file["VTKHDF/PointData/displacement"].attrs["unit"] == unit
            assert np.array_equal(file["VTKHDF/Steps/Values"], time * result.t)


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    sample().save("run.h5")
    assert main(["export", "run.h5", "-o", "run.vtkhdf"]) == 0
    assert capsys.readouterr().out == "run.vtkhdf written\n"
    export(sample(), "again.vtkhdf")
    assert Path("run.vtkhdf").read_bytes() == Path("again.vtkhdf").read_bytes()


def test_what_cannot_be_written(tmp_path: Path) -> None:
    path, result = tmp_path / "run.vtkhdf", sample()
    for other, said in (
        (replace(result, mesh=None, fields={}), "no mesh"),
        (replace(result, fields={"alpha": result["alpha"]}), "displacement"),
        (Result(model="synthetic", t=np.zeros(0), mesh=result.mesh), "no stored times"),
    ):
        with pytest.raises(ParameterError, match=said):
            vtkhdf.write(other, path)
    assert vtkhdf.write_copy(Result(model="synthetic", t=np.zeros(0), mesh=result.mesh), path) is None
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ParameterError, match=r"output\.fields.*displacement"):
        OutputTable(vtk=True, fields=("alpha",))


def test_an_older_file_survives_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vtkhdf.write(sample(), tmp_path / "run.vtkhdf")
    old = (tmp_path / "run.vtkhdf").read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        vtkhdf.write(replace(sample(), t=sample().t + 1), tmp_path / "run.vtkhdf")
    assert (tmp_path / "run.vtkhdf").read_bytes() == old
    assert [path.name for path in tmp_path.iterdir()] == ["run.vtkhdf"]
