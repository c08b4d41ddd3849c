"""Values on a regular grid of square pixels, given outright or read from an image."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import check_keys, describe, float_or_refuse, numbers
from multiphase.pictures import brightness

Array = NDArray[np.float64]

MOST_PIXELS = 1_000_000
"""A larger grid would make the text of its scene, which every result holds, too long."""


class Grid:
    """A function of x and y by its values at the centres of square pixels, the middle of the grid at the origin.

    Parameters
    ----------
    pixel : float
        Side of a pixel.
    values : ndarray, (rows, columns)
        Rows from top to bottom, as in an image; y points upwards.

    Notes
    -----
    Bilinear between the centres of the pixels, and constant across the outer half pixel.
    """

    __slots__ = ("pixel", "values")

    def __init__(self, pixel: float, values: Array) -> None:
        self.pixel = pixel
        self.values = values

    @property
    def half(self) -> tuple[float, float]:
        """The largest x and y of the grid."""
        rows, columns = self.values.shape
        return 0.5 * self.pixel * columns, 0.5 * self.pixel * rows

    def __call__(self, x: Array, y: Array, path: str) -> Array:
        """Values at x and y, arrays of one shape; raises ParameterError for a place beyond the grid."""
        right, top = self.half
        margin = 1e-9 * max(right, top)  # a body as large as the grid may stick out by the rounding of its points
        inside = (np.abs(x) <= right + margin) & (np.abs(y) <= top + margin)
        if not np.all(inside):
            i = int(np.argmin(inside))
            raise ParameterError(
                path,
                f"its grid goes from ({-right:g}, {-top:g}) to ({right:g}, {top:g}), but its value is needed at ({x.flat[i]:.6g}, "
                f"{y.flat[i]:.6g}); give a larger grid, or larger pixels.",
            )
        rows, columns = self.values.shape
        column, across = _cell((x + right) / self.pixel - 0.5, columns)
        row, down = _cell((top - y) / self.pixel - 0.5, rows)
        flat, next_row = self.values.ravel(), columns if rows > 1 else 0
        first = row * columns + column
        second = first + (1 if columns > 1 else 0)
        upper = (1.0 - across) * flat[first] + across * flat[second]
        lower = (1.0 - across) * flat[first + next_row] + across * flat[second + next_row]
        return np.asarray((1.0 - down) * upper + down * lower, dtype=float)

    def to_table(self) -> dict[str, Any]:
        """The grid as it stands in a scene file."""
        return {"pixel": self.pixel, "values": self.values.tolist()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and self.pixel == other.pixel and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash((self.pixel, self.values.shape, (self.values + 0.0).tobytes()))  # -0.0 equals 0.0, so both must hash alike

    def __repr__(self) -> str:
        rows, columns = self.values.shape
        return f"<grid of {rows} x {columns} values, pixels of {self.pixel:g}>"


def _cell(position: Array, count: int) -> tuple[NDArray[np.intp], Array]:
    """The point of a row of `count` at or before each position, and how far on towards the next, from 0 to 1."""
    position = np.clip(position, 0.0, count - 1.0)
    first = np.minimum(position.astype(np.intp), max(count - 2, 0))
    return first, position - first


def grid_from_table(table: Mapping[str, Any], path: str) -> Grid:
    """The grid of ``{pixel, values}``, checked."""
    check_keys(table, ("pixel", "values"), path)
    values, where = table["values"], f"{path}.values"
    if isinstance(values, np.ndarray):
        if values.ndim != 2 or values.dtype.kind not in "iuf":
            raise ParameterError(where, f"expected an array of numbers in rows and columns, but got {describe(values)} of {values.dtype}.")
    elif not isinstance(values, list | tuple) or not all(isinstance(row, list | tuple | np.ndarray) for row in values):
        raise ParameterError(where, f"expected rows of numbers, [[...], [...]], but got {describe(values)}.")
    rows = len(values)
    columns = len(values[0]) if rows else 0
    if columns == 0:
        raise ParameterError(where, "there are no values; at least one row with one value is needed.")
    if rows * columns > MOST_PIXELS:
        raise ParameterError(
            where,
            f"{rows} x {columns} are {rows * columns} pixels, and at most {MOST_PIXELS} are read; scale it down, and take pixels that are "
            "larger by as much.",
        )
    for i, row in enumerate(values):
        if len(row) != columns:
            raise ParameterError(
                f"{where}[{i}]", f"this row has {len(row)} values and the first has {columns}; all rows must be equally long."
            )
    return Grid(_pixel(table, path), _finite(values, where))


def _finite(values: Any, path: str) -> Array:
    """Rows as a fresh array of finite numbers. Number by number only where something is wrong with them, to find the first."""
    plain = isinstance(values, np.ndarray) or all(isinstance(row, list | tuple) and set(map(type, row)) <= {float, int} for row in values)
    if plain:
        try:
            array = np.array(values, dtype=float)
        except OverflowError:  # of a very long whole number
            array = np.array(np.nan)
        if np.all(np.isfinite(array)):
            return array
    return np.array([numbers(row, f"{path}[{i}]") for i, row in enumerate(values)])


def _pixel(table: Mapping[str, Any], path: str) -> float:
    pixel = float_or_refuse(table["pixel"], f"{path}.pixel")
    if pixel <= 0.0:
        raise ParameterError(f"{path}.pixel", f"{pixel:.15g} is not allowed; the side of a pixel must be greater than 0.")
    return pixel


def grid_from_image(table: Mapping[str, Any], path: str, folder: Path | None) -> Grid:
    """The grid of ``{image, pixel, low, high}``: black is low, white is high."""
    check_keys(table, ("image", "pixel", "low", "high"), path)
    pixel = _pixel(table, path)
    low, high = (float_or_refuse(table[key], f"{path}.{key}") for key in ("low", "high"))
    name, where = table["image"], f"{path}.image"
    if not isinstance(name, str):
        raise ParameterError(where, f"expected the name of an image file in quotes, but got {describe(name)}.")
    grey = brightness((folder or Path()) / name, where, most=MOST_PIXELS)
    return Grid(pixel, _short(low + (high - low) * grey))


def _short(values: Array) -> Array:
    """Values with six significant digits, so that their text stays short."""
    distinct, where = np.unique(values, return_inverse=True)
    return np.array([float(f"{value:.6g}") for value in distinct])[where].reshape(values.shape)
