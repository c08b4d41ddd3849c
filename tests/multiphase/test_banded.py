"""Banded, bordered systems against dense ones."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase import banded


def _system(kind, size, half, border, seed):
    """A random bordered system: its parts in the storage of the solver, and the dense matrix."""
    rng = np.random.default_rng(seed)

    def random(*shape):
        return (rng.normal(size=shape) + (1j * rng.normal(size=shape) if kind is complex else 0.0)).astype(kind)

    dense = random(size + border, size + border)
    band = np.zeros((size, 3 * half + 1), dtype=kind)
    for i in range(size):
        for j in range(size):
            if abs(i - j) > half:
                dense[i, j] = 0.0
            else:
                band[i, j - i + half] = dense[i, j]
    columns, rows = dense[:size, size:].T.copy(), dense[size:, :size].copy()
    return dense, band, columns, rows, dense[size:, size:].copy(), random(size + border)


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize(("size", "half", "border"), [(1, 1, 1), (7, 3, 2), (60, 6, 2), (40, 8, 3), (5, 8, 2)])
def test_bordered_systems_are_solved(kind, size, half, border):
    """Without diagonal dominance, so that rows are exchanged."""
    for seed in range(5):
        dense, band, columns, rows, corner, b = _system(kind, size, half, border, seed)
        pivots = np.zeros((2, size), dtype=np.int64)
        assert banded.factor_bordered(band, half, pivots, columns, rows, corner)
        x = b.copy()
        banded.solve_bordered(band, half, pivots, columns, rows, corner, x)
        size_of_error = np.linalg.cond(dense) * np.abs(x).max() * np.finfo(float).eps
        np.testing.assert_allclose(x, np.linalg.solve(dense, b), atol=1e3 * size_of_error)  # the border squares a bad band's condition
    assert size < 20 or np.any(pivots[0] != np.arange(size))


def test_a_singular_matrix_is_told():
    _, band, columns, rows, corner, _ = _system(float, 6, 2, 2, 0)
    pivots = np.zeros((2, 6), dtype=np.int64)
    singular = band.copy()
    singular[2] = 0.0
    for row, offset in ((0, 4), (1, 3), (3, 1), (4, 0)):
        singular[row, offset] = 0.0
    assert not banded.factor_bordered(singular, 2, pivots, columns.copy(), rows, corner.copy())
    rows[:], corner[:] = 0.0, 0.0
    assert not banded.factor_bordered(band, 2, pivots, columns, rows, corner)


def test_a_row_with_nan_is_not_taken_for_regular():
    _, band, columns, rows, corner, _ = _system(float, 6, 2, 2, 0)
    band[:, :] = np.nan
    assert not banded.factor_bordered(band, 2, np.zeros((2, 6), dtype=np.int64), columns, rows, corner)
