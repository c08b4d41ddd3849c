"""The body among the pixels of an image, and what smoothing may not do to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from multiphase.errors import ParameterError
from tumour.meshes.body import place
from tumour.meshes.polygons import Numbers, Points

PATH = "geometry.file"

LEVEL = 0.5
"""Value of the smoothed mask on the contour: a straight side stays where it is."""

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """The pixels of a body, with a margin around them.

    Attributes
    ----------
    pixels : (rows, columns) array of bool
    margin : int
        Rows and columns added at each side of the image.
    pixel : float
        Side of a pixel.
    name : str
        Of the image.
    specks : int
        Parts and holes that were left out.
    """

    pixels: Flags
    margin: int
    pixel: float
    name: str
    specks: int

    def places(self, cells: Points) -> Points:
        """Where rows and columns of the array, (n, 2), are: the middle of the image is the origin, and y points upwards."""
        rows, columns = self.pixels.shape
        row, column = cells.T
        return np.column_stack(((column + 0.5 - columns / 2.0) * self.pixel, (rows / 2.0 - row - 0.5) * self.pixel))

    def at(self, weight: NDArray[np.float64]) -> str:
        """The pixel with the largest weight, in a sentence."""
        cell = np.array(np.unravel_index(np.argmax(weight), weight.shape))
        row, column = cell - self.margin + 1
        return f"{place(self.places(cell[None].astype(float))[0])} (row {row}, column {column})"


def measure() -> Any:
    """The module of scikit-image that labels parts and finds contours."""
    try:
        import skimage.measure
    except ImportError:
        raise ParameterError(
            PATH, 'reading a body from an image needs scikit-image; install it with: pip install "multiphase-tissue[image]"'
        ) from None
    return skimage.measure


def body_in(grey: NDArray[np.float64], threshold: float, smallest: float, pixel: float, margin: int, name: str) -> Mask:
    """The one body that is brighter than the threshold, without specks; refused where there is none, or not one, or it is cut off."""
    foreground = grey > threshold
    if not foreground.any():
        raise ParameterError(
            PATH,
            f"no pixel of {name} is brighter than {threshold:g}, and the brightest has {grey.max():.3g} of white (transparency does not "
            "count); draw the body in white on black, or lower geometry.threshold."
        )  # fmt: skip
    parts, areas = labelled(foreground, corners=False)
    largest = int(np.argmax(areas))
    bodies = areas >= smallest * areas[largest]
    if bodies.sum() > 1:
        shares = np.sort(areas[bodies] / areas.sum())[::-1]
        listed = ", ".join(f"{100.0 * share:.3g} %" for share in shares[:6]) + (", ..." if len(shares) > 6 else "")
        raise ParameterError(
            PATH, f"{name} shows {len(shares)} separate bodies, with {listed} of the area; leave one, or raise geometry.smallest, the "
            "share below which a part is a speck."
        )  # fmt: skip
    body = parts == largest + 1
    _check_border(body, name)
    around, sizes = labelled(~body, corners=True)
    small = np.flatnonzero(sizes < smallest * areas[largest]) + 1
    small = small[small != around[0, 0]]
    body |= np.isin(around, small)
    return Mask(np.pad(body, margin), margin, pixel, name, len(areas) - 1 + len(small))


def labelled(flags: Flags, *, corners: bool) -> tuple[Numbers, Numbers]:
    """Numbers from 1 of the parts that hang together, by sides or by corners too, 0 elsewhere; and how many pixels each has."""
    parts = np.asarray(measure().label(flags, connectivity=2 if corners else 1), dtype=np.int64)
    return parts, np.bincount(parts.ravel())[1:]


def _check_border(body: Flags, name: str) -> None:
    """Refuse a body that the image cuts off."""
    touched = {"upper": body[0], "lower": body[-1], "left": body[:, 0], "right": body[:, -1]}
    sides = [side for side, pixels in touched.items() if pixels.any()]
    if sides:
        hint = "; add an empty margin of a pixel to take the cut for its surface"
        hint += ", or invert the image if its body is dark" if len(sides) == 4 else ""
        named = " and ".join((", ".join(sides[:-1]), sides[-1])) if len(sides) > 1 else sides[0]
        raise ParameterError(PATH, f"the body touches the {named} side{'s' if len(sides) > 1 else ''} of {name}{hint}.")


def settled(mask: Mask, smooth: NDArray[np.float64], smoothing: float, smallest: float) -> tuple[NDArray[np.float64], int]:
    """The smoothed mask without the specks that smoothing made, and their number; refused where it did more than round things off."""
    smooth = smooth.copy()
    by = f"smoothing by {smoothing:g} pixel{'' if smoothing == 1.0 else 's'}"
    parts, areas = labelled(smooth > LEVEL, corners=False)
    if not len(areas):
        raise ParameterError(PATH, f"the body of {mask.name} is too narrow for {by} and would vanish; {_advice(smoothing)}.")
    least, main = smallest * areas.max(), int(np.argmax(areas)) + 1
    if (areas >= least).sum() > 1:
        second = int(np.argsort(areas)[-2]) + 1
        where = _between(mask, parts == main, parts == second, mask.pixels & (parts == 0))
        raise ParameterError(
            PATH, f"{by} would part the body of {mask.name} in two near {where}, where it is narrow; {_advice(smoothing)}."
        )
    smooth[(parts > 0) & (parts != main)] = 0.0
    filled = _check_gaps(mask, parts == main, least, by, smoothing)
    smooth[filled > 0] = 1.0
    _check_lost(mask, smooth > LEVEL, by, smoothing)
    return smooth, len(areas) - 1 + len(np.unique(filled[filled > 0]))


def _check_gaps(mask: Mask, body: Flags, least: float, by: str, smoothing: float) -> Numbers:
    """Refuse holes that vanish, join or part; small ones that smoothing made have numbers in what is returned."""
    before, old = labelled(~mask.pixels, corners=True)
    after, areas = labelled(~body, corners=True)
    filled = np.zeros_like(after)
    claimed: dict[int, int] = {}
    for hole in range(1, len(old) + 1):
        within, counts = np.unique(after[(before == hole) & (after > 0)], return_counts=True)
        if not len(within):
            raise ParameterError(
                PATH, f"the hole of {mask.name} at {mask.at((before == hole) * 1.0)} is too narrow for {by} and would vanish; fill it, or "
                "take a smaller geometry.smoothing."
            )  # fmt: skip
        kept = int(after[0, 0]) if hole == before[0, 0] else int(within[np.argmax(counts)])
        others = within[(within != kept) & (areas[within - 1] >= least)]
        joined = claimed.get(kept)
        if joined is not None:
            where = _between(mask, before == hole, before == joined, mask.pixels & ~body)
            raise ParameterError(
                PATH, f"the wall of {mask.name} near {where} is too thin for {by}, and the gaps on its two sides would join; "
                f"{_advice(smoothing)}."
            )  # fmt: skip
        claimed[kept] = hole
        if len(others):
            where = _between(mask, after == kept, after == others[0], ~mask.pixels & body)
            raise ParameterError(
                PATH, f"the gap of {mask.name} near {where} is too narrow for {by} and would close; {_advice(smoothing)}."
            )  # fmt: skip
    made = np.setdiff1d(np.arange(1, len(areas) + 1), list(claimed))
    filled[np.isin(after, made)] = after[np.isin(after, made)]
    return filled


def _check_lost(mask: Mask, body: Flags, by: str, smoothing: float) -> None:
    """Refuse the loss of a thin part that reaches far from what is left, and of such a gap."""
    reach = 2.0 + 4.0 * smoothing  # a corner of 20 degrees loses four standard deviations, and the steps of pixels a pixel or two
    for what, lost, left in (("part", mask.pixels & ~body, body), ("gap", ~mask.pixels & body, ~body)):
        depth = np.where(lost, distance_transform_edt(~left), 0.0)
        if depth.max() > reach:
            verb = "vanish" if what == "part" else "close"
            raise ParameterError(
                PATH, f"the {what} of {mask.name} near {mask.at(depth)} is too narrow for {by} and would {verb}; {_advice(smoothing)}."
            )  # fmt: skip


def _between(mask: Mask, first: Flags, second: Flags, among: Flags) -> str:
    """The place among some pixels that is nearest to two parts."""
    apart = distance_transform_edt(~first) + distance_transform_edt(~second)
    return mask.at(np.where(among, -apart, -np.inf))


def _advice(smoothing: float) -> str:
    """What to do about a narrow place: a strip of w pixels outlasts smoothing by sigma for w > 1.35 sigma."""
    return f"make it {max(2, int(np.ceil(1.35 * smoothing)))} pixels wide or more, or take a smaller geometry.smoothing"
