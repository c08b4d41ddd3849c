"""Transport of a volume fraction on the moving grid: slopes of second order that keep it within [0, 1], compiled, with their derivatives.

Slopes are differences per cell: a cell has the value n - slope/2 at its inner face, n + slope/2 at its outer one.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

Number = TypeVar("Number", float, NDArray[np.float64])

SMOOTH = 20.0
"""Differences between neighbours below SMOOTH h^2 are not limited: curvature up to some 40 in xi at an extremum is resolved."""


@njit(error_model="numpy")
def limited(back: float, ahead: float) -> tuple[float, float, float]:
    """Monotonised central difference, and its derivatives with respect to both differences."""
    if back * ahead <= 0.0:
        return 0.0, 0.0, 0.0
    central = 0.5 * (back + ahead)
    if abs(central) <= 2.0 * abs(back) and abs(central) <= 2.0 * abs(ahead):
        return central, 0.5, 0.5
    return (2.0 * back, 2.0, 0.0) if abs(back) <= abs(ahead) else (2.0 * ahead, 0.0, 2.0)


@njit(error_model="numpy")
def slope(back: float, ahead: float, n: float, h: float) -> tuple[float, float, float, float]:
    """Slope in a cell, and its derivatives with respect to n of the cell before, of the cell, and of the next.

    Limited where the differences are large, or either phase is nearly absent; central where both differences are those of a smooth,
    resolved profile, below SMOOTH h^2, so that an extremum which travels through the cells switches nothing; a smooth passage in
    between. After Shu's modified limiters (Math. Comp. 49, 1987).
    """
    value, d_back, d_ahead = limited(back, ahead)
    central, scale = 0.5 * (back + ahead), SMOOTH * h * h
    largest = max(abs(back), abs(ahead))
    if value != central and largest < 2.0 * scale < min(n, 1.0 - n):
        t = max(largest / scale - 1.0, 0.0)
        weight, slant = 1.0 - t * t * (3.0 - 2.0 * t), -6.0 * t * (1.0 - t) * (central - value) / scale
        value = weight * central + (1.0 - weight) * value
        d_back, d_ahead = weight * 0.5 + (1.0 - weight) * d_back, weight * 0.5 + (1.0 - weight) * d_ahead
        if abs(back) >= abs(ahead):
            d_back += slant if back >= 0.0 else -slant
        else:
            d_ahead += slant if ahead >= 0.0 else -slant
    return value, -d_back, d_back - d_ahead, d_ahead


@njit(error_model="numpy")
def end_slope(value: float, d_own: float, d_next: float, gain: float) -> tuple[float, float, float]:
    """A slope of an end cell, and its derivatives with respect to that cell and the next, bounded so that an empty cell sends nothing
    out: by 2n where the face takes more n than the cell has, by 2(1 - n) where it takes more c. `gain` is the n of the cell where the
    face takes more n, or minus its c where it takes less."""
    if abs(value) <= 2.0 * abs(gain):
        return value, d_own, d_next
    sign = 1.0 if value > 0.0 else -1.0
    return sign * 2.0 * abs(gain), sign * 2.0 * (1.0 if gain >= 0.0 else -1.0), 0.0


@njit(error_model="numpy")
def open_slope(n_last: float, n_before: float) -> tuple[float, float, float]:
    """Slope in the last cell, where no condition holds, and its derivatives with respect to that cell and the one before."""
    value = n_last - n_before
    return end_slope(value, 1.0, -1.0, n_last if value < 0.0 else n_last - 1.0)


@njit(error_model="numpy")
def symmetric_slope(n_0: float, n_1: float) -> tuple[float, float, float]:
    """Slope in the first cell, at whose outer end n is even (a centre, or a wall with n_x = 0), from the parabola through both values;
    and its derivatives with respect to them."""
    value = 0.5 * (n_1 - n_0)
    return end_slope(value, -0.5, 0.5, n_0 if value > 0.0 else n_0 - 1.0)


def floored(x: Number, delta: float) -> Number:
    """``(x + sqrt(x^2 + 4 delta^2)) / 2``: a smooth, positive stand-in for x that differs from it by delta^2/x. Plain arithmetic."""
    value: Number = 0.5 * (x + np.sqrt(x * x + 4.0 * delta * delta))
    return value


def floored_slope(x: Number, delta: float) -> Number:
    """Derivative of `floored`."""
    value: Number = 0.5 * (1.0 + x / np.sqrt(x * x + 4.0 * delta * delta))
    return value
