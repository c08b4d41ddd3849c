"""A result as files for other programs."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from multiphase.errors import ParameterError
from multiphase.result import Array, PathName, Result
from multiphase.storage import replace_file


def export(result: Result, path: PathName, *, units: bool = True) -> tuple[Path, ...]:
    """Write `result` for other programs; the ending of `path` says how.

    ``NAME.csv`` holds the scalars, one row for each stored time (columns t, L, ...). The fields go to
    ``NAME-fields.csv`` beside it, one row for each time and cell (columns t, cell, x, n, ...; cell 0 is innermost).
    Lines that start with ``#`` say what each column is and its unit: ``pandas.read_csv(path, comment="#")`` skips
    them. Numbers are written in full, so reading them gives the same ones.

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
        When the ending is not one that can be written.
    OSError
        When a file cannot be written; an older one is then untouched.
    """
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise ParameterError(
            "",
            f"'{path}' cannot be written: the ending must be .csv (scalars by time, and the fields in a second file); "
            ".vtkhdf comes with the two-dimensional models. Choose a name that ends in .csv.",
        )
    shown = result.in_units() if units else result
    replace_file(path, _table(shown, {"t": shown.t, **shown.scalars}))
    if not shown.fields:
        return (path,)
    beside = path.with_name(f"{path.stem}-fields{path.suffix}")
    replace_file(beside, _table(shown, _field_columns(shown)))
    return path, beside


def _field_columns(result: Result) -> dict[str, Array]:
    """Columns of one row for each time and cell; a field of vectors gives one column for each component."""
    first = next(iter(result.fields.values()))
    times, cells = first.shape[:2]
    columns = {"t": np.repeat(result.t, cells), "cell": np.tile(np.arange(cells), times)}
    if result.x is not None:
        columns["x"] = result.x.ravel()
    for name, values in result.fields.items():
        if values.ndim == 2:
            columns[name] = values.ravel()
        else:
            parts = values.reshape(times * cells, -1)
            columns |= {f"{name}_{part}": parts[:, part] for part in range(parts.shape[1])}
    return columns


def _table(result: Result, columns: Mapping[str, Array]) -> bytes:
    """CSV text: comment lines with descriptions and units, the names, the numbers."""
    text = io.StringIO()
    for line in _comments(result, columns):
        text.write(f"# {' '.join(line.split())}\n")
    text.write(",".join(columns) + "\n")
    for row in zip(*(values.tolist() for values in columns.values()), strict=True):
        text.write(",".join(map(repr, row)) + "\n")
    return text.getvalue().encode()


def _comments(result: Result, columns: Iterable[str]) -> Iterable[str]:
    yield f"model: {result.model}; status: {result.status}; {result.message}"
    for name in columns:
        description = "index of the cell, 0 innermost" if name == "cell" else result.descriptions.get(name, "")
        yield f"unit {name}: {result.unit(name)}" + (f" ({description})" if description else "")
