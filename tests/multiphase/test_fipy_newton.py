"""What schemes share that FiPy assembles: the compiled tangent in the order of Newton's unknowns, and sums free of rounding."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase import newton
from multiphase.fipy_newton import Scatter, import_fipy, without_rounding

SIZE, HALF, BORDER = 9, 3, 2


def _filled() -> tuple[newton.Work, np.ndarray]:
    """A work space with a random tangent, and that as a full matrix."""
    rng = np.random.default_rng(4)
    work = newton.workspace(SIZE, HALF, BORDER, 1, np.zeros((1, 1)))
    for array in (work.jac, work.columns, work.rows, work.corner):
        array[:] = rng.normal(size=array.shape)
    full = np.zeros((SIZE + BORDER, SIZE + BORDER))
    for i in range(SIZE):
        for j in range(max(0, i - HALF), min(SIZE, i + HALF + 1)):
            full[i, j] = work.jac[i, j - i + HALF]
    full[:SIZE, SIZE:], full[SIZE:, :SIZE], full[SIZE:, SIZE:] = work.columns.T, work.rows, work.corner
    return work, full


@pytest.mark.parametrize("order", ["as in the band", "by kind, one left out"])
def test_the_band_and_its_border_become_one_matrix(order: str) -> None:
    """Against ``d/dx (balance y(x) + scale rates(y(x)))`` written with full matrices; y is W x in the products."""
    work, full = _filled()
    place = np.arange(SIZE) if order == "as in the band" else np.array([0, 3, 6, 1, 4, 7, 2, 5, -1])
    products = slice(0) if order == "as in the band" else slice(0, 6)
    scatter = Scatter(place, HALF, BORDER, products)
    known = np.flatnonzero(place >= 0)
    n = len(known) + BORDER
    assert scatter.unknowns == n
    rng = np.random.default_rng(5)
    x, balance, scale = rng.uniform(0.5, 2.0, n), rng.normal(size=n), rng.normal(size=n)
    back = np.concatenate([known[np.argsort(place[known])], SIZE + np.arange(BORDER)])
    inner = np.eye(n)  # dy/dx
    W = len(known)
    for k in range(*products.indices(n)):
        inner[k, k], inner[k, W] = x[W], x[k]
    expected = (np.diag(balance) + scale[:, None] * full[np.ix_(back, back)]) @ inner
    matrix = scatter.matrix(work, balance, scale, x)
    np.testing.assert_allclose(matrix.toarray(), expected, atol=1e-14)  # rounding of sums of ten numbers of order 1
    assert matrix.has_sorted_indices


def test_sums_are_freed_of_rounding_and_of_nothing_else() -> None:
    residual = np.array([0.3, -0.1, 0.4])
    shifted = without_rounding(residual, 0.6 + 3e-14, 1.0)
    np.testing.assert_allclose(shifted - residual, 1e-14, atol=2e-16)
    shares = np.array([0.0, 0.25, 0.75])
    shifted = without_rounding(residual, 0.6 + 3e-14, 1.0, shares)
    np.testing.assert_allclose(shifted - residual, 3e-14 * shares, atol=2e-16)
    assert without_rounding(residual, 0.6 + 1e-11, 1.0) is residual
    assert without_rounding(residual, 0.6 + 3e-14, 1e-3) is residual


def test_fipy_is_imported_with_scipys_solvers() -> None:
    """What FiPy falls back on without FIPY_SOLVERS depends on the machine."""
    import_fipy()
    from fipy.solvers import solver_suite

    assert solver_suite == "scipy"
