"""A result as files for other programs."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from multiphase import vtkhdf
from multiphase.errors import ParameterError
from multiphase.result import Array, PathName, Result
from multiphase.storage import replace_file

_ROWS = 10_000
"""Rows of a table that are turned into text at a time, as text in memory is large."""


def export(result: Result, path: PathName, *, units: bool = True) -> tuple[Path, ...]:
    """Write `result` for other programs; the ending of `path` says how.

    ``NAME.csv`` holds the scalars, one row for each stored time (columns t, L, ...). The fields go to
    ``NAME-fields.csv`` beside it, one row for each time and cell (columns t, cell, x, n, ...; cell 0 is innermost), or in two
    dimensions for each time and node (columns t, point, x, y, alpha, ..., displacement_x, displacement_y; x and y are where
    the node is at that time, and left out where the displacement is not stored).
    Lines that start with ``#`` say what each column is and its unit: ``pandas.read_csv(path, comment="#")`` skips
    them. Numbers are written in full, so reading them gives the same ones.

    ``NAME.vtkhdf`` is for ParaView and VTK, and for results in two dimensions alone: every stored time, see `multiphase.vtkhdf`.

    Parameters
    ----------
    result : Result
    path : path of the file, replaced if it exists
    units : bool
        In the units of the scene's ``[scales]``, where it has them; otherwise dimensionless.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    ParameterError
        When the ending is not one that can be written, or not for this result.
    OSError
        When a file cannot be written; an older one is then untouched.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".csv", vtkhdf.ENDING):
        raise ParameterError(
            "",
            f"'{path}' cannot be written: the ending must be .csv (scalars by time, and the fields in a second file) or "
            f"{vtkhdf.ENDING} (for ParaView, in two dimensions). Choose a name that ends so.",
        )
    shown = result.in_units() if units else result
    if ending == vtkhdf.ENDING:
        vtkhdf.write(shown, path)
        return (path,)
    replace_file(path, _table(shown, {"t": shown.t, **shown.scalars}))
    if not shown.fields:
        return (path,)
    beside = path.with_name(f"{path.stem}-fields{path.suffix}")
    replace_file(beside, _table(shown, _field_columns(shown)))
    return path, beside


def _field_columns(result: Result) -> dict[str, Array]:
    """Columns of one row for each time and cell or node; a field of vectors gives one column for each component."""
    first = next(iter(result.fields.values()))
    times, cells = first.shape[:2]
    columns = {"t": np.repeat(result.t, cells), _index(result): np.tile(np.arange(cells), times)}
    if result.x is not None:
        columns["x"] = result.x.ravel()
    elif result.mesh is not None and "displacement" in result.fields:
        where = np.concatenate([result.positions(index) for index in range(times)]) if times else np.empty((0, 2))
        columns |= {"x": where[:, 0], "y": where[:, 1]}
    for name, values in result.fields.items():
        if values.ndim == 2:
            columns[name] = values.ravel()
        else:
            parts = values.reshape(times * cells, -1)
            columns |= {column: parts[:, part] for part, column in enumerate(_components(name, values))}
    return columns


def _index(result: Result) -> str:
    return "cell" if result.mesh is None else "point"


def _components(name: str, values: Array) -> list[str]:
    """Columns of a field of vectors: NAME_x and NAME_y in the plane, otherwise NAME_0, NAME_1, ..."""
    parts = values.shape[2]
    return [f"{name}_{part}" for part in ("xy" if parts == 2 else range(parts))]


def _table(result: Result, columns: Mapping[str, Array]) -> bytes:
    """CSV text: comment lines with descriptions and units, the names, the numbers."""
    text = io.BytesIO()
    for line in _comments(result, columns):
        text.write(f"# {' '.join(line.split())}\n".encode())
    text.write((",".join(columns) + "\n").encode())
    length = min(len(values) for values in columns.values())
    for start in range(0, length, _ROWS):
        part = [values[start : start + _ROWS].tolist() for values in columns.values()]
        text.write("".join(",".join(map(repr, row)) + "\n" for row in zip(*part, strict=True)).encode())
    return text.getvalue()


def _comments(result: Result, columns: Iterable[str]) -> Iterable[str]:
    yield f"model: {result.model}; status: {result.status}; {result.message}"
    vectors = {column: name for name, values in result.fields.items() if values.ndim == 3 for column in _components(name, values)}
    known = {"cell": ("-", "index of the cell, 0 innermost"), "point": ("-", "number of the node")}
    if result.mesh is not None:
        known |= {name: (result.unit("points"), f"{name} of the node at this time") for name in "xy"}
    for name in columns:
        quantity = vectors.get(name, name)
        unit, description = known.get(name, (result.unit(quantity), result.descriptions.get(quantity, "")))
        yield f"unit {name}: {unit}" + (f" ({description})" if description else "")
