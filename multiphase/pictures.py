"""Brightness of the pixels of an image file."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError

_PLAIN = ("1", "L", "LA", "RGB", "RGBA", "I", "F")
"""Modes of Pillow whose numbers are brightnesses, besides those of 16 bits; others are turned into colours."""

_SHORT_IN_LONG = ("PNG", "PPM")
"""Formats of which Pillow holds 16 bits in 32, and that have no more than 16."""

_WHITE = {1: 255.0, 2: 65535.0}
"""Value of white by the bytes of a whole number without a sign."""


def brightness(file: Path, path: str, *, most: int) -> NDArray[np.float64]:
    """Brightness of the pixels of an image, from 0 for black to 1 for white.

    Parameters
    ----------
    file : pathlib.Path
        Any image that Pillow reads, or a NumPy array (.npy) of the shape (rows, columns) or (rows, columns, channels).
    path : str
        Dotted path of the file's name, for messages.
    most : int
        Pixels allowed. A file with more is refused before they are read.

    Returns
    -------
    ndarray, (rows, columns)
        Rows from top to bottom, as the image is shown.

    Raises
    ------
    ParameterError
        For a file that cannot be read, is too large, has several pictures, no pixels or more than four channels, or with values of which
        white is not known.

    Notes
    -----
    Colours count by their mean, without an alpha channel. Where no value is below 0 or above 1, they are brightnesses already (a mask of
    0 and 1, for instance); otherwise whole numbers of 8 or 16 bits without a sign are shares of the largest that their type holds.
    """
    try:
        pixels = _from_array(file, path, most) if file.suffix.lower() == ".npy" else _from_picture(file, path, most)
    except (ParameterError, MemoryError):
        raise
    except FileNotFoundError:
        raise ParameterError(path, f"there is no file '{file}'; a relative name is looked for beside the scene file.") from None
    except Exception as error:  # decoders of damaged files raise whatever they stumble over
        reason = (error.strerror if isinstance(error, OSError) else None) or "it is of no known kind, or damaged"
        raise ParameterError(path, f"'{file}' cannot be read as an image: {reason}; give a .png, .tif or .npy file that opens.") from None
    return _shares(pixels, file.name, path)


def _check_size(rows: int, columns: int, name: str, path: str, most: int) -> None:
    if rows * columns == 0:
        raise ParameterError(path, f"{name} has no pixels; at least one row with one pixel is needed.")
    if rows * columns > most:
        raise _too_large(name, path, f"{rows} rows of {columns} pixels", most)


def _too_large(name: str, path: str, pixels: str, most: int) -> ParameterError:
    return ParameterError(path, f"{name} has {pixels}, and at most {most} are read; scale it down, and take pixels larger by as much.")


def _from_array(file: Path, path: str, most: int) -> NDArray[Any]:
    """The array of a NumPy file, grey or colour without alpha. Its numbers stay in the file until they are needed."""
    stored = np.lib.format.open_memmap(file, mode="r")
    if stored.dtype.kind not in "biuf" or stored.ndim not in (2, 3) or (stored.ndim == 3 and not 1 <= stored.shape[2] <= 4):
        raise ParameterError(
            path,
            f"{file.name} is an array of shape {stored.shape} and type {stored.dtype}; give numbers in rows and columns, and at most four "
            "channels if it is in colour.",
        )
    _check_size(stored.shape[0], stored.shape[1], file.name, path, most)
    return _without_alpha(stored)


def _from_picture(file: Path, path: str, most: int) -> NDArray[Any]:
    """Pixels of a picture as it is shown, grey or colour without alpha, as numbers of their own type."""
    from PIL import Image, ImageOps

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            opened = Image.open(file)
        except Image.DecompressionBombError:
            raise _too_large(file.name, path, "more pixels than Pillow opens", most) from None
    with opened:
        _check_size(opened.height, opened.width, file.name, path, most)
        if (frames := getattr(opened, "n_frames", 1)) > 1:
            raise ParameterError(path, f"{file.name} holds {frames} pictures, and must have one; save the one that is meant by itself.")
        image = ImageOps.exif_transpose(opened)  # as a camera was held
        if image.mode not in _PLAIN and not image.mode.startswith("I;16"):
            image = image.convert("RGBA" if image.mode in ("P", "PA") else "RGB")  # a palette may hold alpha
        pixels = np.asarray(image)
        is_short = image.mode == "I" and opened.format in _SHORT_IN_LONG
    return _without_alpha(pixels.astype(np.uint16) if is_short else pixels)


def _without_alpha(pixels: NDArray[Any]) -> NDArray[Any]:
    """Of two channels the second, and of four the last, is alpha."""
    return pixels if pixels.ndim == 2 else pixels[..., : 1 if pixels.shape[2] < 3 else 3]


def _shares(pixels: NDArray[Any], name: str, path: str) -> NDArray[np.float64]:
    """Pixels, grey or colour, as shares of white."""
    kind, size = pixels.dtype.kind, pixels.dtype.itemsize
    least, largest = float(pixels.min()), float(pixels.max())
    in_unit = least >= 0.0 and largest <= 1.0  # false for NaN
    if not in_unit and not (kind == "u" and size in _WHITE):
        raise ParameterError(
            path,
            f"{name} has values of the type {pixels.dtype} from {least:g} to {largest:g}, so that white is not known; give them from 0 to "
            "1, or as whole numbers of 8 or 16 bits without a sign.",
        )
    grey = pixels.mean(axis=2, dtype=float) if pixels.ndim == 3 else np.array(pixels, dtype=float)
    return np.asarray(grey if in_unit else grey / _WHITE[size])
