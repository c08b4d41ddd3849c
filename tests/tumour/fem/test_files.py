"""Result files of bodies in two dimensions: a mesh that has changed, and the copy for ParaView."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import multiphase
from multiphase import vtkhdf
from multiphase.cli import main

SCENE = """
[scene]
model = "tumour"
[geometry]
kind = "outline"
file = "outline.csv"
[time]
end = 1.0
save_every = 0.5
[solver]
cells = 4
"""


def write_outline(folder: Path, turned: float = 0.0) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    points = (1.0 + 0.1 * np.cos(3.0 * angles)) * np.exp(1j * (angles + turned))
    (folder / "outline.csv").write_text("x,y\n" + "\n".join(f"{z.real!r},{z.imag!r}" for z in points.tolist()))


def test_a_changed_outline_is_not_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same number of points, in other places: what was stored stays as it is."""
    (tmp_path / "scene.toml").write_text(SCENE)
    write_outline(tmp_path)
    arguments = ["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "run.h5"), "--quiet"]
    assert main(arguments) == 0
    before = (tmp_path / "run.h5").read_bytes()
    write_outline(tmp_path, turned=0.4)
    assert main([*arguments, "--resume", "--set", "time.end=2.0"]) == 2
    assert "the mesh of the body is another one" in capsys.readouterr().err
    assert (tmp_path / "run.h5").read_bytes() == before
    write_outline(tmp_path)
    assert main([*arguments, "--resume", "--set", "time.end=2.0"]) == 0


def test_the_copy_for_paraview(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A copy that cannot be written is named, the result stays complete, and a later --resume makes it."""
    file, copy = tmp_path / "run.h5", tmp_path / "run.vtkhdf"
    sets = ["geometry.dimension=2d", "solver.cells=4", "time.end=1.0", "output.vtk=true"]
    arguments = ["run", "tumour-disk", *(part for item in sets for part in ("--set", item)), "-o", str(file), "--quiet"]

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(vtkhdf, "write_copy", full)
        assert main(arguments) == 3
    assert f"{copy} could not be written" in capsys.readouterr().err
    assert multiphase.load(file).status == "completed"
    assert not copy.exists()
    assert main([*arguments, "--resume"]) == 0
    assert copy.exists()
