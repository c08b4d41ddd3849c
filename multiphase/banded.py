r"""Compiled direct solution of banded systems with a narrow border, real or complex.

A one-dimensional model couples neighbouring cells (a band) and all cells with a few numbers such as the width of the
domain (a border of dense columns and rows),

    [ A  B ] [x]   [r]
    [ C  D ] [y] = [s],      A (size, size) of half-bandwidth `half`, B (size, k), C (k, size), D (k, k).

A is stored by rows, ``band[i, j - i + half] = A[i, j]``, in rows of length ``3 half + 1`` of which the last third receives what
row exchanges fill in.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

Array = Any


@njit(error_model="numpy")
def factor(band: Array, half: int, pivots: Array) -> bool:
    """LU factors of a banded matrix in its own storage, rows exchanged by the largest pivot; False if it is singular.

    `pivots` (2, size) receives the row exchanged with each, and how far to the right of its diagonal each row reaches.
    """
    size = band.shape[0]
    reach = 0  # last column that rows handled so far have brought in
    for k in range(size):
        last = min(k + half, size - 1)
        best, row = abs(band[k, half]), k
        for i in range(k + 1, last + 1):
            value = abs(band[i, k - i + half])
            if value > best:
                best, row = value, i
        if not best > 0.0:
            return False
        reach = max(reach, min(row + half, size - 1))
        width = reach - k
        pivots[0, k], pivots[1, k] = row, width
        if row != k:
            shift = k - row
            for j in range(half, half + width + 1):
                upper = band[k, j]
                band[k, j] = band[row, j + shift]
                band[row, j + shift] = upper
        inverse = 1.0 / band[k, half]
        for i in range(k + 1, last + 1):
            first = half + k - i
            multiplier = band[i, first]
            if multiplier != 0.0:
                multiplier *= inverse
                band[i, first] = multiplier
                for j in range(1, width + 1):
                    band[i, first + j] -= multiplier * band[k, half + j]
    return True


@njit(error_model="numpy")
def solve(band: Array, half: int, pivots: Array, x: Array) -> None:
    """Replace the right-hand side `x` (size,) by the solution, with the factors of `factor`."""
    size = band.shape[0]
    for k in range(size):
        row = pivots[0, k]
        value = x[row]
        if row != k:
            x[row] = x[k]
            x[k] = value
        for i in range(k + 1, min(k + half, size - 1) + 1):
            x[i] -= band[i, k - i + half] * value
    for k in range(size - 1, -1, -1):
        value = x[k]
        for j in range(1, pivots[1, k] + 1):
            value -= band[k, half + j] * x[k + j]
        x[k] = value / band[k, half]


@njit(error_model="numpy")
def factor_bordered(band: Array, half: int, pivots: Array, columns: Array, rows: Array, corner: Array) -> bool:
    """Factors of the bordered matrix: A as in `factor`, `columns` (k, size) become A⁻¹B, `corner` becomes (D - C A⁻¹ B)⁻¹."""
    if not factor(band, half, pivots):
        return False
    k, size = columns.shape
    for a in range(k):
        solve(band, half, pivots, columns[a])
    for a in range(k):
        for b in range(k):
            for i in range(size):
                corner[a, b] -= rows[a, i] * columns[b, i]
    return invert(corner)


@njit(error_model="numpy")
def invert(a: Array) -> bool:
    """Replace a small matrix by its inverse (Gauss-Jordan, largest pivot of each column); False if it is singular."""
    n = a.shape[0]
    exchanged = np.empty(n, dtype=np.int64)
    for k in range(n):
        row = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[row, k]):
                row = i
        if not abs(a[row, k]) > 0.0:
            return False
        exchanged[k] = row
        for j in range(n):
            kept = a[k, j]
            a[k, j] = a[row, j]
            a[row, j] = kept
        pivot = a[k, k]
        a[k, k] = 1.0
        for j in range(n):
            a[k, j] /= pivot
        for i in range(n):
            if i != k:
                multiplier = a[i, k]
                a[i, k] = 0.0
                for j in range(n):
                    a[i, j] -= multiplier * a[k, j]
    for k in range(n - 1, -1, -1):
        row = exchanged[k]
        for i in range(n):
            kept = a[i, k]
            a[i, k] = a[i, row]
            a[i, row] = kept
    return True


@njit(error_model="numpy")
def solve_bordered(band: Array, half: int, pivots: Array, columns: Array, rows: Array, corner: Array, x: Array) -> None:
    """Replace the right-hand side `x` (size + k,) by the solution, with the factors of `factor_bordered`."""
    k, size = columns.shape
    solve(band, half, pivots, x[:size])
    rest = x[size : size + k].copy()
    for a in range(k):
        for i in range(size):
            rest[a] -= rows[a, i] * x[i]
    for a in range(k):
        value = corner[a, 0] * rest[0]
        for b in range(1, k):
            value += corner[a, b] * rest[b]
        x[size + a] = value
        for i in range(size):
            x[i] -= columns[a, i] * value
