"""Results in HDF5 files: the layout, and what survives being killed, a full disk and damage."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from multiphase import storage
from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import Result

posix = pytest.mark.skipif(os.name == "nt", reason="kill -9 and RLIMIT_FSIZE are POSIX")

# A child process writes results whose every value is the number of the write, so a mixture of two writes shows.
CHILD = """
import sys, itertools, pathlib
import numpy as np
from multiphase import storage
from multiphase.result import Result

def numbered(number, nt=400, cells=500):
    full = lambda *shape: np.full(shape, float(number))
    return Result(model="plaque", t=full(nt), x=full(nt, cells), scalars={"L": full(nt)}, fields={"n": full(nt, cells)},
                  message=str(number), checkpoint={"state": full(cells)})
"""


def sample(nt: int = 4, cells: int = 5) -> Result:
    t = np.linspace(0, 2, nt) / 3
    x = np.linspace(0.1, 0.9, cells) * (1 + t[:, None])
    n = np.sin(x)
    n[-1, 0], n[-1, 1] = np.nan, -0.0  # bit for bit means these too
    return Result(
        model="plaque",
        t=t,
        x=x,
        scalars={"L": 1 + t, "L_rate": np.ones(nt), "a_later_name": t**2},
        fields={"n": n, "c": 1 - n},
        scene='[scene]\nmodel = "plaque"\ntitle = "größer"\n',
        scene_source="# µm\n",
        plan='{"solver": "fipy"}',
        status="stopped",
        message="Stopped by Ctrl-C at t = 0.667.",
        stats={"steps": 12, "wall_s": 1.5, "rejected": np.int64(2), "history": ["x"]},
        versions={"multiphase-tissue": "0.1.0", "numpy": "2.4"},
        platform="Linux",
        threads=2,
        seed=7,
        created="2024-01-01T00:00:00",
        checkpoint={"state": np.arange(7.0) / 3, "order": np.array(2), "flags": np.array([True, False]), "empty": np.zeros((0, 3))},
        units={"t": "-", "x": "-", "L": "-", "L_rate": "-", "a_later_name": "-", "n": "-", "c": "-"},
        descriptions={
            "t": "time",
            "x": "positions",
            "L": "width",
            "L_rate": "growth rate",
            "a_later_name": "",
            "n": "necrotic",
            "c": "cells",
        },
    )


def assert_same_bits(a: Any, b: Any) -> None:
    assert a.dtype == b.dtype
    assert a.shape == b.shape
    assert a.tobytes() == b.tobytes()


def datasets(path: Path) -> dict[str, tuple[Any, dict[str, Any]]]:
    found: dict[str, tuple[Any, dict[str, Any]]] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = (item[()], dict(item.attrs))

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def leftovers(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".part"))


def run_child(code: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", CHILD + code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_round_trip_bit_for_bit(tmp_path: Path) -> None:
    written = sample()
    storage.write(written, tmp_path / "run.h5")
    back = storage.read(tmp_path / "run.h5")
    for entry in fields(Result):
        before, after = getattr(written, entry.name), getattr(back, entry.name)
        if entry.name in ("scalars", "fields", "checkpoint"):
            assert list(before) == list(after), "names keep their order"
            for name in before:
                assert_same_bits(before[name], after[name])
        elif isinstance(before, np.ndarray):
            assert_same_bits(before, after)
        else:
            assert before == after, entry.name


@pytest.mark.parametrize("seed", [None, 0, 12345])
def test_seed_and_missing_positions_come_back(tmp_path: Path, seed: int | None) -> None:
    storage.write(replace(sample(), seed=seed, x=None, fields={}), tmp_path / "run.h5")
    back = storage.read(tmp_path / "run.h5")
    assert back.seed == seed
    assert back.x is None
    assert back.fields == {}


def test_layout_is_the_published_one(tmp_path: Path) -> None:
    storage.write(sample(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert set(file.attrs) == {
            *("format_version", "model", "scene", "scene_source", "plan", "status", "message"),
            *("created", "versions", "platform", "threads", "seed", "stats"),
        }
        assert file.attrs["format_version"] == 1, "readers of version 1 read it"
    found = datasets(tmp_path / "run.h5")
    assert {"t", "grid/x", "scalars/L", "fields/n", "checkpoint/state"} <= set(found)
    assert all(attributes.keys() == {"unit", "description"} for _, attributes in found.values())
    assert found["fields/n"][1] == {"unit": "-", "description": "necrotic"}


def on_mesh() -> Result:
    points = np.array([[0.0, 0.0], [1 / 3, 0.0], [0.0, 0.7], [1.0, 1.0]])
    fields = {"alpha": np.linspace(0, 1, 16).reshape(4, 4) / 3, "displacement": np.linspace(-1, 1, 32).reshape(4, 4, 2) / 7}
    names = {"points": "where", "triangles": "which", "alpha": "cells", "displacement": "moved"}
    units = {"points": "µm", "triangles": "-", "alpha": "-", "displacement": "µm"}
    whole = sample()
    return replace(
        whole,
        x=None,
        mesh=Mesh(points, np.array([[0, 1, 2], [1, 3, 2]])),
        fields=fields,
        units={name: unit for name, unit in whole.units.items() if name not in ("x", "n", "c")} | units,
        descriptions={name: text for name, text in whole.descriptions.items() if name not in ("x", "n", "c")} | names,
    )


def test_a_mesh_comes_back_bit_for_bit(tmp_path: Path) -> None:
    written = on_mesh()
    storage.write(written, tmp_path / "run.h5")
    back = storage.read(tmp_path / "run.h5")
    assert written.mesh is not None
    assert back.mesh is not None
    assert_same_bits(back.mesh.points, written.mesh.points)
    assert_same_bits(back.mesh.triangles, written.mesh.triangles)
    assert list(back.fields) == ["alpha", "displacement"]
    for name in back.fields:
        assert_same_bits(back[name], written[name])
    assert back.x is None
    assert back.units == written.units
    assert back.descriptions == written.descriptions


def test_layout_with_a_mesh(tmp_path: Path) -> None:
    storage.write(on_mesh(), tmp_path / "run.h5")
    found = datasets(tmp_path / "run.h5")
    assert found["mesh/points"][0].shape == (4, 2)
    assert found["mesh/points"][1] == {"unit": "µm", "description": "where"}
    assert found["mesh/triangles"][0].tolist() == [[0, 1, 2], [1, 3, 2]]
    assert found["mesh/triangles"][1] == {"unit": "-", "description": "which"}
    assert all(attributes.keys() == {"unit", "description"} for _, attributes in found.values())
    with h5py.File(tmp_path / "run.h5") as file:
        assert "grid" not in file
        assert file.attrs["format_version"] == 2, "readers of version 1 ask for a newer installation"


def test_descriptions_of_the_mesh_where_the_scheme_gives_none(tmp_path: Path) -> None:
    storage.write(replace(on_mesh(), descriptions={}), tmp_path / "run.h5")
    assert "nodes" in storage.read(tmp_path / "run.h5").descriptions["triangles"]


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="where Linux tells the largest memory of a process")
def test_the_file_is_in_memory_once(tmp_path: Path) -> None:
    """What is written takes the room of the file, not twice that: results on meshes are large."""
    code = """
status = pathlib.Path("/proc/self/status")
peak = lambda: 1024 * int(status.read_text().split("VmHWM:")[1].split()[0])
storage.write(numbered(1, nt=3), sys.argv[1])
large = numbered(2, nt=100, cells=50_000)
before = peak()
storage.write(large, sys.argv[1])
print((peak() - before) / pathlib.Path(sys.argv[1]).stat().st_size)
"""
    child = run_child(code, str(tmp_path / "run.h5"))
    output, errors = child.communicate(timeout=60)
    assert 0.5 < float(output) < 1.5, errors  # of the 80 MB, 1.0 are needed


def test_same_values_give_the_same_datasets_whatever_the_clock(tmp_path: Path) -> None:
    storage.write(sample(), tmp_path / "a.h5")
    storage.write(replace(sample(), created="2031-12-31T00:00:00", stats={"wall_s": 99.0}), tmp_path / "b.h5")
    a, b = datasets(tmp_path / "a.h5"), datasets(tmp_path / "b.h5")
    assert a.keys() == b.keys()
    for name in a:
        assert_same_bits(a[name][0], b[name][0])
        assert a[name][1] == b[name][1]


def test_text_far_above_64_kib(tmp_path: Path) -> None:
    long = "# µ\n" * 500_000
    storage.write(replace(sample(), scene=long, scene_source=long, stats={"history": ["x" * 100_000]}), tmp_path / "run.h5")
    back = storage.read(tmp_path / "run.h5")
    assert back.scene == long
    assert back.scene_source == long
    assert back.stats["history"] == ["x" * 100_000]
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["scene"] == long, "an attribute, as for short scenes"


def test_text_that_hdf5_cannot_hold(tmp_path: Path) -> None:
    storage.write(replace(sample(), message="a\0b \udcff"), tmp_path / "run.h5")
    assert storage.read(tmp_path / "run.h5").message == "a\ufffdb ?"


def test_values_that_json_does_not_know(tmp_path: Path) -> None:
    storage.write(replace(sample(), stats={"a": np.float64(0.1), "b": np.arange(2), "c": Path("x")}), tmp_path / "run.h5")
    assert storage.read(tmp_path / "run.h5").stats == {"a": 0.1, "b": [0, 1], "c": "x"}


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "no file"), (b"", "is empty"), (b"t,L\n0,1\n" * 100, "not an HDF5 file"), (b"\x89HDF\r\n\x1a\n", "damaged")],
)
def test_files_that_are_not_hdf5(tmp_path: Path, content: bytes | None, said: str) -> None:
    path = tmp_path / "run.h5"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ParameterError, match=said) as caught:
        storage.read(path)
    assert "run.h5" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_is_not_a_result(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot be read"):
        storage.read(tmp_path)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.95, 0.999])
def test_truncated_file(tmp_path: Path, share: float) -> None:
    path = tmp_path / "run.h5"
    storage.write(sample(50, 100), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ParameterError, match="damaged"):
        storage.read(path)


def test_file_of_another_program(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["data"] = np.arange(3)
    with pytest.raises(ParameterError, match="without `format_version`"):
        storage.read(tmp_path / "other.h5")


def test_missing_or_misshapen_datasets(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    storage.write(sample(), path)
    with h5py.File(path, "r+") as file:
        del file["scalars/L"]
        file["scalars/L"] = np.arange(2.0)
        file["scalars/L"].attrs.update({"unit": "-", "description": ""})
    with pytest.raises(ParameterError, match=r"damaged.*L: has shape \(2,\)"):
        storage.read(path)
    with h5py.File(path, "r+") as file:
        del file["t"]
    with pytest.raises(ParameterError, match="damaged"):
        storage.read(path)


def test_newer_format_says_which_version_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    storage.write(replace(sample(), versions={"multiphase-tissue": "9.1"}), path)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = storage.FORMAT_VERSION + 1
        del file["t"]  # a newer layout need not have what this one has
    with pytest.raises(ParameterError, match=r"format version 3.*multiphase-tissue 9\.1, which reads it"):
        storage.read(path)


def test_reading_leaves_no_lock(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    storage.write(sample(), path)
    result = storage.read(path)
    with h5py.File(path, "r+", locking=True) as file:  # fails while anyone holds a lock
        file.attrs["message"] = "changed"
    assert result["L"][0] == 1
    with h5py.File(path, "r+", locking=True):  # and a lock that someone holds does not stop a reader
        child = run_child("storage.read(sys.argv[1])", str(path))
        _, errors = child.communicate(timeout=60)
        assert child.returncode == 0, errors


def test_writing_follows_a_symbolic_link(tmp_path: Path) -> None:
    (tmp_path / "scratch").mkdir()
    link = tmp_path / "run.h5"
    try:
        link.symlink_to(tmp_path / "scratch" / "real.h5")
    except OSError:
        pytest.skip("no symbolic links here")
    storage.write(sample(), link)
    assert link.is_symlink()
    assert storage.read(tmp_path / "scratch" / "real.h5").model == "plaque"


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        storage.write(sample(), tmp_path / "nowhere" / "run.h5")
    with pytest.raises(OSError, match="Not a regular file"):
        storage.write(sample(), tmp_path)
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError])
def test_an_interrupted_write_leaves_the_old_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interruption: type[BaseException]
) -> None:
    path = tmp_path / "run.h5"
    storage.write(sample(), path)
    old = path.read_bytes()

    def interrupted(descriptor: int) -> None:
        raise interruption

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(interruption):
        storage.write(replace(sample(), message="new"), path)
    assert path.read_bytes() == old
    assert leftovers(tmp_path) == []


def test_file_is_on_the_disk_before_it_is_renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    fsync, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda descriptor: (order.append("fsync"), fsync(descriptor))[1])
    monkeypatch.setattr(os, "replace", lambda *names: (order.append("rename"), rename(*names))[1])
    storage.write(sample(), tmp_path / "run.h5")
    assert order == (["fsync", "rename"] if os.name == "nt" else ["fsync", "rename", "fsync"])


@posix
def test_leftovers_of_dead_runs_are_removed(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, living = tmp_path / f".run.h5.{ended.pid}.part", tmp_path / f".run.h5.{os.getppid()}.part"
    other, unlike = tmp_path / f".other.h5.{ended.pid}.part", tmp_path / ".run.h5.old.part"
    number = tmp_path / str(ended.pid)
    for path in (dead, living, other, unlike, number):
        path.write_bytes(b"half")
    storage.write(sample(), tmp_path / "run.h5")
    assert leftovers(tmp_path) == sorted([living.name, other.name, unlike.name])
    assert number.exists()


@posix
def test_kill_9_while_writing(tmp_path: Path) -> None:
    """The file opens and is whole at every moment: while it is written, and after kill -9 at arbitrary moments."""
    path = tmp_path / "run.h5"
    code = "for number in itertools.count(): storage.write(numbered(number), sys.argv[1])"
    random = np.random.default_rng(1)
    reads, last = 0, 0.0

    def check() -> float:
        result = storage.read(path)
        number = float(result.message)
        for values in (result.t, result["x"], result["L"], result["n"], result.checkpoint["state"]):
            assert np.all(values == number)
        return number

    for _ in range(4):
        child = run_child(code, str(path))
        try:
            path.unlink(missing_ok=True)
            start = time.monotonic()
            while not path.exists():
                assert child.poll() is None, child.communicate()[1]
                assert time.monotonic() - start < 60
                time.sleep(0.005)
            until = time.monotonic() + random.uniform(0.05, 0.3)
            while time.monotonic() < until:
                last = check()
                reads += 1
        finally:
            child.send_signal(signal.SIGKILL)
            child.communicate()
        last = max(last, check())
    assert reads > 3
    assert last > 0, "the child wrote more than once"
    storage.write(sample(), path)
    assert leftovers(tmp_path) == []


@posix
def test_full_disk(tmp_path: Path) -> None:
    """A file limit stands for a full disk: an OSError, the old file whole, nothing left behind, a clean exit."""
    path = tmp_path / "run.h5"
    code = """
import resource
storage.write(numbered(1, nt=3), sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    storage.write(numbered(2), sys.argv[1])
except OSError as error:
    import errno
    print(errno.errorcode[error.errno])
storage.write(numbered(3, nt=3), sys.argv[1])  # what fits is still written
print("end")
"""
    child = run_child(code, str(path))
    output, errors = child.communicate(timeout=60)
    assert output.split() == ["EFBIG", "end"], errors
    assert errors == ""
    assert child.returncode == 0
    assert storage.read(path).message == "3"
    assert leftovers(tmp_path) == []


@posix
def test_full_disk_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    storage.write(sample(), path)
    old = path.read_bytes()
    code = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
storage.write(numbered(2), sys.argv[1])
"""
    child = run_child(code, str(path))
    _, errors = child.communicate(timeout=60)
    assert child.returncode == 1, "the OSError reaches the caller, no crash at exit"
    assert "OSError" in errors
    assert "File too large" in errors
    assert path.read_bytes() == old
    assert leftovers(tmp_path) == []
