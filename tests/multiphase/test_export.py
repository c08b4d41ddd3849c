"""Results as CSV files."""

from __future__ import annotations

import csv
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from multiphase import result as result_module
from multiphase.errors import ParameterError
from multiphase.export import export
from multiphase.mesh import Mesh
from multiphase.model import Quantity
from multiphase.result import Result

SCALES = '[scales]\nlength = { value = 100.0, unit = "µm" }\n'


def sample() -> Result:
    t = np.array([0.0, 0.1, 1 / 3])
    xi = (np.arange(4) + 0.5) / 4
    return Result(
        model="synthetic",
        t=t,
        x=xi * (1 + t[:, None]),
        scalars={"L": 1 + t, "rate": np.array([np.nan, 1e-300, 1.0])},
        fields={"n": np.sin(xi * t[:, None]), "c": np.cos(xi + t[:, None])},
        message="Two\nlines, with a comma.",
        descriptions={"L": "width"},
    )


def read(path: Path) -> tuple[list[str], dict[str, np.ndarray]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    names, *rows = csv.reader(lines[len(comments) :])
    return comments, dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def test_numbers_come_back_exactly(tmp_path: Path) -> None:
    result = sample()
    written = export(result, tmp_path / "run.csv")
    assert written == (tmp_path / "run.csv", tmp_path / "run-fields.csv")
    _, scalars = read(written[0])
    assert list(scalars) == ["t", "L", "rate"]
    for name, values in scalars.items():
        assert np.array_equal(values, result[name], equal_nan=True)
    _, table = read(written[1])
    assert list(table) == ["t", "cell", "x", "n", "c"]
    for name in ("x", "n", "c"):
        assert np.array_equal(table[name].reshape(3, 4), result[name])
    assert np.array_equal(table["t"].reshape(3, 4), np.tile(result.t[:, None], 4))
    assert np.array_equal(table["cell"], [0, 1, 2, 3] * 3)


def test_pandas_skips_the_comments(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    export(sample(), tmp_path / "run.csv")
    frame = pandas.read_csv(tmp_path / "run.csv", comment="#")
    assert list(frame.columns) == ["t", "L", "rate"]
    # pandas' own parser may be off in the last digit, 2e-16
    assert frame["L"].to_numpy() == pytest.approx(sample()["L"], rel=1e-15)


def test_comments_give_units(tmp_path: Path) -> None:
    export(sample(), tmp_path / "run.csv")
    comments, _ = read(tmp_path / "run.csv")
    assert comments[0] == "# model: synthetic; status: completed; Two lines, with a comma."
    assert "# unit L: - (width)" in comments


def test_units_where_the_scene_has_scales(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quantities = {"L": Quantity("L", "L", "width", {"length": 1})}
    monkeypatch.setattr(result_module, "find_model", lambda name: SimpleNamespace(quantities=quantities))
    result = replace(sample(), scene=SCALES)
    export(result, tmp_path / "a.csv")
    comments, table = read(tmp_path / "a.csv")
    assert "# unit L: µm (width)" in comments
    assert np.array_equal(table["L"], result["L"] * 100)
    export(result, tmp_path / "b.csv", units=False)
    comments, table = read(tmp_path / "b.csv")
    assert "# unit L: - (width)" in comments
    assert np.array_equal(table["L"], result["L"])


def test_scalars_only(tmp_path: Path) -> None:
    assert export(replace(sample(), fields={}), tmp_path / "run.CSV") == (tmp_path / "run.CSV",)
    assert [path.name for path in tmp_path.iterdir()] == ["run.CSV"]


def test_a_field_of_vectors_gives_a_column_for_each_component(tmp_path: Path) -> None:
    vectors = np.arange(24.0).reshape(3, 4, 2)
    _, beside = export(replace(sample(), x=None, fields={"v": vectors}), tmp_path / "run.csv")
    _, table = read(beside)
    assert list(table) == ["t", "cell", "v_x", "v_y"]
    assert np.array_equal(np.stack([table["v_x"], table["v_y"]], axis=-1).reshape(3, 4, 2), vectors)


def test_a_result_on_a_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multiphase.export._ROWS", 5)  # fewer than the table has, and no divisor of them
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) / 3, np.array([[0, 1, 2], [1, 3, 2]]))
    moved = np.arange(24.0).reshape(3, 4, 2) / 7
    fields = {"alpha": sample()["n"], "displacement": moved}
    units = {"points": "µm", "displacement": "µm", "alpha": "-", "t": "day", "L": "µm"}
    result = replace(sample(), x=None, mesh=mesh, fields=fields, units=units, descriptions={"displacement": "of the cells"})
    _, beside = export(result, tmp_path / "run.csv")
    comments, table = read(beside)
    assert list(table) == ["t", "point", "x", "y", "alpha", "displacement_x", "displacement_y"]
    assert np.array_equal(table["point"], [0, 1, 2, 3] * 3)
    where = np.stack([table["x"], table["y"]], axis=-1).reshape(3, 4, 2)
    assert np.array_equal(where, [result.positions(index) for index in range(3)])
    assert np.array_equal(np.stack([table["displacement_x"], table["displacement_y"]], axis=-1).reshape(3, 4, 2), moved)
    assert np.array_equal(table["alpha"].reshape(3, 4), result["alpha"])
    assert "# unit displacement_y: µm (of the cells)" in comments
    assert "# unit y: µm (y of the node at this time)" in comments
    del fields["displacement"]
    _, beside = export(replace(result, fields=fields), tmp_path / "run.csv")
    assert list(read(beside)[1]) == ["t", "point", "alpha"]


def test_vtkhdf_is_for_results_on_a_mesh(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"run\.vtkhdf.*is for results in two dimensions.*Take \.csv"):
        export(sample(), tmp_path / "run.vtkhdf")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["run.xlsx", "run"])
def test_unknown_ending(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterError, match=r"must be \.csv") as caught:
        export(sample(), tmp_path / name)
    assert name in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_older_export_survives_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export(sample(), tmp_path / "run.csv")
    old = (tmp_path / "run.csv").read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        export(replace(sample(), message="new"), tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_bytes() == old
    assert len(list(tmp_path.iterdir())) == 2
