"""Results on a mesh as VTKHDF files, which ParaView and VTK open as they are, with all their times.

One group, ``VTKHDF``, of type UnstructuredGrid, as the format's specification lays it out: the triangles stand there once, and every
step points to them; points, which move, and values are written step after step, and ``Steps`` says where each step begins. Scalars are
field data with one value for each step. Every array of values has the attributes ``unit`` and ``description``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from multiphase.errors import ParameterError
from multiphase.result import PathName, Result
from multiphase.storage import file_in_memory, replace_file

ENDING = ".vtkhdf"
VERSION = (2, 0)
"""Version of the format, the first that has steps."""

_TRIANGLE = 5
"""VTK's number for a triangle."""


def write(result: Result, path: PathName) -> None:
    """Write `result` to the VTKHDF file `path`, whole or not at all; nodes are where they are at each stored time.

    Raises
    ------
    ParameterError
        When the result has no mesh, no times, or not the field "displacement".
    OSError
        When the file cannot be written; an older one is then untouched.
    """
    if result.mesh is None:
        raise ParameterError(
            "", f"'{path}' cannot be written: {ENDING} is for results in two dimensions, and this one has no mesh. Take .csv."
        )
    if not len(result.t):
        raise ParameterError("", f"'{path}' cannot be written: the result has no stored times yet.")
    steps, points, triangles = len(result.t), len(result.mesh.points), result.mesh.triangles
    result.positions(0)  # refused here, before any work, where they are not known
    with file_in_memory() as (file, buffer):
        group = file.create_group("VTKHDF", track_order=True)
        group.attrs["Version"] = np.array(VERSION, dtype=np.int64)
        group.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", len("UnstructuredGrid")))
        for name, count in (("Points", points), ("Cells", len(triangles)), ("ConnectivityIds", triangles.size)):
            group[f"NumberOf{name}"] = np.array([count], dtype=np.int64)
        group["Connectivity"] = triangles.ravel()
        group["Offsets"] = np.arange(0, triangles.size + 1, 3, dtype=np.int64)
        group["Types"] = np.full(len(triangles), _TRIANGLE, dtype=np.uint8)

        where = _dataset(group, "Points", (steps * points, 3), result.unit("points"), "positions of the nodes")
        for step in range(steps):
            where[step * points : (step + 1) * points] = _in_space(result.positions(step))
        data = group.create_group("PointData", track_order=True)
        for name, values in result.fields.items():
            shape = (steps * points, *((3,) if values.ndim == 3 else ()))
            target = _dataset(data, name, shape, result.unit(name), result.descriptions.get(name, ""))
            for step in range(steps):
                target[step * points : (step + 1) * points] = values[step] if values.ndim == 2 else _in_space(values[step])
        data = group.create_group("FieldData", track_order=True)
        for name, values in result.scalars.items():
            _dataset(data, name, (steps,), result.unit(name), result.descriptions.get(name, ""))[...] = values

        times = group.create_group("Steps")
        times.attrs["NSteps"] = steps
        _dataset(times, "Values", (steps,), result.unit("t"), "time")[...] = result.t
        each, never = np.arange(steps, dtype=np.int64), np.zeros(steps, dtype=np.int64)
        times["PartOffsets"], times["NumberOfParts"] = never, never + 1  # all have the one part, which the triangles are of
        times["PointOffsets"], times["CellOffsets"], times["ConnectivityIdOffsets"] = points * each, never[:, None], never[:, None]
        for name in result.fields:
            times[f"PointDataOffsets/{name}"] = points * each
        for name in result.scalars:
            times[f"FieldDataOffsets/{name}"] = each
    replace_file(Path(path), buffer.getbuffer())


def copy_of(file: PathName) -> Path:
    """Where the copy of the result file `file` stands: NAME.vtkhdf beside it."""
    return Path(file).with_suffix(ENDING)


def write_copy(result: Result, file: PathName) -> Path | None:
    """Write what ``output.vtk = true`` asks for, the copy of a result for ParaView beside its `file`, in the units of its scene.

    Returns
    -------
    Path or None
        The copy; None where nothing has been stored that could be written.

    Raises
    ------
    OSError
        When the copy cannot be written; an older one is then untouched.
    """
    if not len(result.t):
        return None
    write(result.in_units(), copy_of(file))
    return copy_of(file)


def _dataset(group: h5py.Group, name: str, shape: tuple[int, ...], unit: str, description: str) -> h5py.Dataset:
    dataset = group.create_dataset(name, shape, dtype=np.float64)
    dataset.attrs["unit"], dataset.attrs["description"] = unit, description
    return dataset


def _in_space(vectors: Any) -> Any:
    """Vectors in the plane with a third component, 0."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
