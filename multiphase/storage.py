"""Results in HDF5 files that are whole at every moment.

A file is never changed in place. The whole image is built in memory, written to a temporary file beside the target, brought to the disk,
and renamed onto the target. Whatever interrupts this (kill -9, a full disk, a power cut) leaves the old file or the new one.

Layout: text and clock-dependent values are attributes of the root; ``/t`` (nt,), ``/grid/x`` (nt, cells), ``/scalars/NAME`` (nt,),
``/fields/NAME`` (nt, cells), ``/checkpoint/NAME``; every dataset has the attributes ``unit`` and ``description``. In two dimensions
``/mesh/points`` (points, 2) and ``/mesh/triangles`` (triangles, 3) stand in the place of ``/grid/x``, and fields have a value for each
point. Values alone decide the datasets, so two equal runs give equal datasets.
"""

from __future__ import annotations

import errno
import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.result import PathName, Result

FORMAT_VERSION = 2
"""Version of the layout with a mesh; results without one are written as version 1. :func:`read` reads this and every earlier one."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_TEXTS = ("model", "scene", "scene_source", "plan", "status", "message", "created", "platform")
_DESCRIPTIONS = {
    "t": "time",
    "x": "positions of the cell centres",
    "points": "positions of the nodes at rest",
    "triangles": "nodes of each triangle, counterclockwise, numbered from 0",
}
_CHECKPOINT = "part of the complete last state, from which a run is continued"


def write(result: Result, path: PathName) -> None:
    """Store `result` in the HDF5 file `path`, replacing what is there as one indivisible act.

    Raises
    ------
    OSError
        As the operating system gave it (no space, no such folder, ...); the old file is then untouched.
    """
    replace_file(Path(path), _image(result))


def read(path: PathName) -> Result:
    """The result stored in `path`. The file is closed and unlocked on return, also when a run goes on writing to it.

    Raises
    ------
    ParameterError
        One sentence: the file is missing, is no HDF5 file, holds no result, is damaged, or needs a newer version.
    """
    path = Path(path)
    _check_signature(path)
    try:
        with h5py.File(path, "r", locking=False) as file:
            _check_format(file, path)
            return _result(file)
    except ParameterError as error:
        if error.path:  # shapes that do not fit each other
            raise _damaged(path, str(error)) from error
        raise
    except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise _damaged(path, str(error)) from error


def check_target(path: Path, name: str = "output.file") -> None:
    """Refuse, before any work, a file that cannot be written; raises ParameterError."""
    why = ""
    if path.is_dir():
        why = "it is a folder"
    elif path.exists() and not path.is_file():
        why = "it is not an ordinary file"
    elif path.is_symlink() and not path.exists():
        why = "it is a link to nothing"
    elif not path.parent.is_dir():
        why = "its folder does not exist"
    else:
        probe = path.with_name(f".{path.name}.{os.getpid()}.probe")
        try:
            probe.touch()
            probe.unlink()
        except OSError as error:
            why = f"nothing can be written to its folder ({error.strerror})"
    if why:
        raise ParameterError(name, f"{path} cannot be written: {why}.")


@contextmanager
def claimed(path: Path | None) -> Iterator[None]:
    """Hold `path` for one run at a time; raises ParameterError while another process does. A dead process holds nothing.

    Where the system has no file locks (Windows), nothing is held.
    """
    try:
        import fcntl
    except ImportError:
        path = None
    if path is None:
        yield
        return
    lock = path.with_name(f".{path.name}.lock")
    with open(lock, "w", encoding="utf-8") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ParameterError("output.file", f"another run is writing {path}; wait for its end, or take -o for another name.") from None
        except OSError:  # a file system without locks
            pass
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


@contextmanager
def file_in_memory() -> Iterator[tuple[h5py.File, io.BytesIO]]:
    """An empty HDF5 file to fill, and where its bytes are once the context has ended."""
    buffer = io.BytesIO()  # h5py's own file in memory would have to be copied to give its bytes
    with h5py.File(buffer, "w") as file:
        yield file, buffer


def replace_file(path: Path, content: bytes | memoryview) -> None:
    """Write `content` to `path` so that, whatever happens, `path` is the whole old file or the whole new one.

    Raises
    ------
    OSError
        The old file is then untouched, and the temporary file beside it is gone.
    """
    target = Path(os.path.realpath(path))  # through a symbolic link, so that the link stays
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "Not a regular file, so it cannot be replaced", str(path))
    _remove_leftovers(target)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, target)
    except BaseException:  # also Ctrl-C
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
    _sync_folder(target.parent)


def _remove_leftovers(target: Path) -> None:
    """Remove temporary files of runs that were killed while they wrote `target`."""
    prefix, suffix = f".{target.name}.", ".part"
    for other in target.parent.iterdir():
        number = other.name.removeprefix(prefix).removesuffix(suffix)
        if other.name == f"{prefix}{number}{suffix}" and number.isdecimal() and not _alive(int(number)):
            with suppress(OSError):
                other.unlink()


def _alive(pid: int) -> bool:
    """Whether a process runs; on Windows always False, as there an open file cannot be removed anyway."""
    if os.name == "nt":  # where os.kill(pid, 0) would end the process
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _sync_folder(folder: Path) -> None:
    """Bring a rename in `folder` to the disk, where the system can."""
    if os.name == "nt":
        return
    with suppress(OSError):  # the new file is in place and whole; some network file systems refuse this
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _image(result: Result) -> memoryview:
    """The HDF5 file of `result`, as bytes."""
    with file_in_memory() as (file, buffer):
        file.attrs["format_version"] = FORMAT_VERSION if result.mesh is not None else 1
        for key in _TEXTS:
            file.attrs[key] = _text(getattr(result, key))
        file.attrs["versions"] = _json(result.versions)
        file.attrs["stats"] = _json(result.stats)
        file.attrs["threads"] = result.threads
        file.attrs["seed"] = "none" if result.seed is None else result.seed

        def store(group: h5py.Group, key: str, values: Any, description: str) -> None:
            dataset = group.create_dataset(key, data=values)
            dataset.attrs["unit"] = _text(result.unit(key))
            dataset.attrs["description"] = _text(description)

        def describe(key: str) -> str:
            return result.descriptions.get(key, _DESCRIPTIONS.get(key, ""))

        store(file, "t", result.t, describe("t"))
        if result.mesh is not None:
            place, where = "mesh", {"points": result.mesh.points, "triangles": result.mesh.triangles}
        else:
            place, where = "grid", {} if result.x is None else {"x": result.x}
        for group_name, data in ((place, where), ("scalars", result.scalars), ("fields", result.fields)):
            group = file.create_group(group_name, track_order=True)  # names keep their order
            for key, values in data.items():
                store(group, key, values, describe(key))
        checkpoint = file.create_group("checkpoint", track_order=True)
        for key, values in result.checkpoint.items():
            dataset = checkpoint.create_dataset(key, data=values)
            dataset.attrs["unit"] = "-"
            dataset.attrs["description"] = _CHECKPOINT
    return buffer.getbuffer()


def _text(text: str) -> str:
    """`text` as HDF5 can hold it: no NUL, no lone surrogates (from file names that are not UTF-8)."""
    return text.replace("\0", "\ufffd").encode("utf-8", "replace").decode("utf-8")


def _json(data: Any) -> str:
    def plain(value: Any) -> Any:
        return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)

    return _text(json.dumps(data, default=plain, ensure_ascii=False))


def _result(file: h5py.File) -> Result:
    attributes = file.attrs
    texts = {key: _read_text(attributes[key]) for key in _TEXTS}
    seed = attributes["seed"]
    units: dict[str, str] = {}
    descriptions: dict[str, str] = {}

    def values(dataset: h5py.Dataset, key: str) -> Any:
        units[key] = _read_text(dataset.attrs["unit"])
        descriptions[key] = _read_text(dataset.attrs["description"])
        return np.asarray(dataset[()])

    mesh = Mesh(**{key: values(file["mesh"][key], key) for key in ("points", "triangles")}) if "mesh" in file else None
    return Result(
        **texts,  # type: ignore[arg-type]
        t=values(file["t"], "t"),
        x=values(file["grid/x"], "x") if mesh is None and "x" in file["grid"] else None,
        mesh=mesh,
        scalars={key: values(dataset, key) for key, dataset in file["scalars"].items()},
        fields={key: values(dataset, key) for key, dataset in file["fields"].items()},
        versions=json.loads(_read_text(attributes["versions"])),
        stats=json.loads(_read_text(attributes["stats"])),
        threads=int(attributes["threads"]),
        seed=None if isinstance(seed, str | bytes) else int(seed),
        checkpoint={key: np.asarray(dataset[()]) for key, dataset in file["checkpoint"].items()},
        units=units,
        descriptions=descriptions,
    )


def _read_text(value: Any) -> str:
    return value.decode("utf-8") if isinstance(value, bytes) else str(value)


def _check_signature(path: Path) -> None:
    try:
        with open(path, "rb") as stream:
            start = stream.read(len(_SIGNATURE))
    except FileNotFoundError:
        raise ParameterError("", f"there is no file '{path}'. Check the name, or run the scene first.") from None
    except OSError as error:
        raise ParameterError("", f"'{path}' cannot be read ({error.strerror}). Give the name of a result file.") from error
    if start != _SIGNATURE:
        what = "is empty" if not start else "is not an HDF5 file"
        raise ParameterError("", f"'{path}' {what}, so it holds no result. Give a file that `multiphase run` wrote.")


def _check_format(file: h5py.File, path: Path) -> None:
    version = file.attrs.get("format_version")
    if not isinstance(version, int | np.integer):
        raise ParameterError(
            "", f"'{path}' is an HDF5 file without `format_version`, so it is not a result. Give a file that `multiphase run` wrote."
        )
    if version > FORMAT_VERSION:
        writers = json.loads(_read_text(file.attrs.get("versions", "{}")))
        writer = next(
            (f"multiphase-tissue {writers[key]}" for key in ("multiphase-tissue", "multiphase") if key in writers), "a newer version"
        )
        raise ParameterError(
            "",
            f"'{path}' has format version {version}, but this installation reads versions up to {FORMAT_VERSION}. "
            f"The file was written by {writer}, which reads it: pip install --upgrade multiphase-tissue.",
        )


def _damaged(path: Path, reason: str) -> ParameterError:
    return ParameterError("", f"'{path}' is damaged or cut off ({reason}). Run the scene again, or take a copy of the file that is whole.")
