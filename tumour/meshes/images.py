"""Outlines of a body in a segmented image: mask, contour, smoothed polygons."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from multiphase.errors import ParameterError
from multiphase.pictures import brightness
from tumour.meshes.body import finite_positive
from tumour.meshes.loops import area_of
from tumour.meshes.masks import LEVEL, Mask, body_in, measure, settled
from tumour.meshes.polygons import Points, signed_area

PATH = "geometry.file"

MOST_PIXELS = 100_000_000
"""Pixels beyond which an image is refused."""

MOST_SMOOTHING = 100.0
"""Largest standard deviation of the smoothing, in pixels."""

REACH = 4.0
"""Standard deviations at which the Gaussian is cut off."""

APART = 1e-3
"""Points of a contour nearer to each other than this, in pixels, are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """Outlines of a body in an image.

    Attributes
    ----------
    loops : tuple of (n, 2) array
        The outer outline, then holes, in units of length.
    origin : str
        From what and how they were made, in a sentence's part.
    """

    loops: tuple[Points, ...]
    origin: str


def outlines_of_image(
    file: str | Path, pixel: float, smoothing: float = 1.0, threshold: float = 0.5, smallest: float = 1e-3
) -> tuple[Points, ...]:
    """The outlines of the body in an image, first the outer one, then those of its holes.

    Parameters
    ----------
    file : str or pathlib.Path
        Any image that Pillow reads, or a NumPy array (.npy) of the shape (rows, columns) or (rows, columns, channels). Of colours the mean
        is taken and an alpha channel left out.
    pixel : float
        Side of a pixel in units of length. The middle of the image is the origin, x points to the right and y upwards.
    smoothing : float
        Standard deviation, in pixels, of the Gaussian with which the body is smoothed before its contour is taken.
    threshold : float
        Brightness, from 0 for black to 1 for white, above which a pixel is of the body.
    smallest : float
        Parts and holes with less than this share of the body's area are left out as specks.

    Raises
    ------
    ParameterError
        At ``geometry.file`` for an image that cannot be read, has no body, several, or one that touches the border, and for parts, holes
        and gaps that are too narrow for the smoothing.

    Notes
    -----
    The body hangs together by the sides of pixels, what is around it also by their corners. Smoothing by sigma moves a contour of
    curvature kappa inwards by about sigma^2 kappa/2: the radius of a disk of 40 pixels is 0.0125 pixels too small for sigma = 1.
    """
    return trace(file, pixel, smoothing, threshold, smallest).loops


def trace(file: str | Path, pixel: float, smoothing: float = 1.0, threshold: float = 0.5, smallest: float = 1e-3) -> Traced:
    """`outlines_of_image`, with a word on how they were made."""
    finite_positive(pixel, "geometry.pixel")
    for key, value, allowed, range_ in (
        ("threshold", threshold, 0.0 < threshold < 1.0, "greater than 0 and below 1"),
        ("smoothing", smoothing, 0.0 <= smoothing <= MOST_SMOOTHING, f"from 0 to {MOST_SMOOTHING:g}"),
        ("smallest", smallest, 0.0 <= smallest < 1.0, "of 0 or more and below 1"),
    ):
        if not allowed:
            raise ParameterError(f"geometry.{key}", f"{value:g} is not allowed; it must be {range_}.")
    name, grey = Path(file).name, brightness(Path(file), PATH, most=MOST_PIXELS)
    margin = 2 + int(np.ceil(REACH * smoothing))
    mask = body_in(grey, threshold, smallest, pixel, margin, name)
    smooth, specks = settled(mask, _smoothed(mask, smoothing), smoothing, smallest)
    loops = _contours(mask, smooth)
    area, pixels, specks = area_of(loops), float(mask.pixels.sum()) * pixel**2, specks + mask.specks
    rows, columns = grey.shape
    holes = f", {_counted(len(loops) - 1, 'hole')}" if len(loops) > 1 else ""
    left_out = f"; {_counted(specks, 'speck')} left out" if specks else ""
    smoothed = f"smoothed by {smoothing:g} pixel{'' if smoothing == 1.0 else 's'}" if smoothing else "not smoothed"
    origin = f"from {name}: {columns} x {rows} pixels of {pixel:g}, {smoothed}, area {area:.4g} (mask {pixels:.4g}){holes}{left_out}"
    return Traced(loops, origin)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _smoothed(mask: Mask, smoothing: float) -> NDArray[np.float64]:
    """The mask with values from 0 to 1 after a Gaussian."""
    flat = mask.pixels.astype(float)
    if not smoothing:
        return flat
    return np.asarray(gaussian_filter(flat, smoothing, mode="constant", truncate=REACH))


def _contours(mask: Mask, smooth: NDArray[np.float64]) -> tuple[Points, ...]:
    """Contours of the smoothed mask: the outer one counterclockwise, then the holes', clockwise, in order of decreasing area."""
    found = measure().find_contours(smooth, LEVEL, fully_connected="low")
    loops = sorted((_cleaned(mask, contour) for contour in found), key=lambda loop: -abs(signed_area(loop)))
    return tuple(loop if (signed_area(loop) > 0.0) == (k == 0) else loop[::-1].copy() for k, loop in enumerate(loops))


def _cleaned(mask: Mask, contour: Points) -> Points:
    """A closed contour in space, without points that lie on the one after them."""
    once = contour[np.hypot(*np.diff(contour, axis=0, append=contour[:1]).T) > APART]
    return mask.places(once)
