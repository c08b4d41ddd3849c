"""Positions and values in two columns, given outright or read from a file."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import check_keys, describe, numbers
from multiphase.series import check_lengths

Array = NDArray[np.float64]


def columns_from_table(table: Mapping[str, Any], path: str, folder: Path | None) -> tuple[Array, Array]:
    """Positions and values of ``{at, values}`` or ``{file}``, checked."""
    if "file" in table:
        check_keys(table, ("file",), path)
        at, values = _read_csv(table["file"], f"{path}.file", folder)
        where = f"{path}.file"
    else:
        check_keys(table, ("at", "values"), path)
        at, values = numbers(table["at"], f"{path}.at"), numbers(table["values"], f"{path}.values")
        where = f"{path}.at"
    check_lengths(at, values, "positions", path)
    for previous, position in pairwise(at):
        if position <= previous:
            raise ParameterError(where, f"{position} comes after {previous}; positions must increase.")
    return np.array(at), np.array(values)


def _read_csv(name: Any, path: str, folder: Path | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two columns, position and value, separated by commas, semicolons or blanks; one heading line and # comments are allowed."""
    if not isinstance(name, str):
        raise ParameterError(path, f"expected the name of a CSV file in quotes, but got {describe(name)}.")
    file = (folder or Path()) / name
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or "it is not a text file in UTF-8"
        raise ParameterError(
            path, f"the file {file} cannot be read: {reason}. A relative name is looked for beside the scene file."
        ) from None
    rows: list[tuple[float, float]] = []
    heading_allowed = True
    for number, line in enumerate(lines, start=1):
        cells = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        if heading_allowed and cells and not any(_is_number(cell) for cell in cells):
            heading_allowed = False
        elif cells:
            heading_allowed = False
            if len(cells) != 2 or not all(_is_number(cell) and np.isfinite(float(cell)) for cell in cells):
                raise ParameterError(
                    path, f'line {number} of {file} is "{line.strip()}"; two finite numbers are expected, a position and a value.'
                )
            rows.append((float(cells[0]), float(cells[1])))
    return tuple(row[0] for row in rows), tuple(row[1] for row in rows)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
