"""Solvers of sparse linear systems with a fixed pattern."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import sparse as scipy_sparse

from multiphase import sparse
from multiphase.errors import ParameterError

NAMES = [
    "superlu",
    pytest.param("pardiso", marks=pytest.mark.skipif(sparse.load_mkl() is None, reason="the extra pardiso is not installed")),
]
SOLVERS = pytest.mark.parametrize("name", NAMES)


def pattern(size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A pattern at random, symmetric, with its diagonal: compressed rows, sorted."""
    rng = np.random.default_rng(seed)
    i, j = rng.integers(0, size, (2, 3 * size))
    diagonal = np.arange(size)
    rows, columns = np.concatenate([i, j, diagonal]), np.concatenate([j, i, diagonal])
    matrix = scipy_sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    matrix.sum_duplicates()
    matrix.sort_indices()
    return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)


def values_of(indptr: np.ndarray, indices: np.ndarray, seed: int) -> np.ndarray:
    """Values at random, not symmetric, of a well conditioned matrix: signs of the diagonal at random as well."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=len(indices))
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    on = rows == indices
    values[on] = (8.0 + rng.uniform(size=on.sum())) * rng.choice([-1.0, 1.0], on.sum())
    return values


def matrix_of(indptr: np.ndarray, indices: np.ndarray, values: np.ndarray) -> np.ndarray:
    size = len(indptr) - 1
    return scipy_sparse.csr_matrix((values, indices, indptr), shape=(size, size)).toarray()


@SOLVERS
def test_systems_of_one_pattern_are_solved(name: str) -> None:
    """Three sets of values and of right-hand sides, and the first again; the residual is rounding: conditions are below 100. What is
    given is left as it is."""
    indptr, indices = pattern(300)
    solver = sparse.open_solver(name, indptr, indices)
    assert solver.name == name
    for seed in (1, 2, 3, 1):
        values = values_of(indptr, indices, seed)
        given = values.copy()
        solver.factorise(values)
        for k in range(3):
            b = np.random.default_rng(10 * seed + k).normal(size=300)
            right = b.copy()
            x = solver.solve(b)
            assert np.abs(matrix_of(indptr, indices, given) @ x - right).max() < 1e-12
            np.testing.assert_array_equal(b, right)
        np.testing.assert_array_equal(values, given)
    assert solver.counts == {"factorise": 4, "solve": 12}
    assert set(solver.seconds) == {"analyse", "factorise", "solve"}
    assert solver.seconds["factorise"] > 0.0
    assert solver.seconds["solve"] > 0.0


@SOLVERS
def test_a_solution_is_not_overwritten_by_the_next(name: str) -> None:
    indptr, indices = pattern(50)
    solver = sparse.open_solver(name, indptr, indices)
    solver.factorise(values_of(indptr, indices, 1))
    x = solver.solve(np.ones(50))
    kept = x.copy()
    solver.solve(np.arange(50.0))
    np.testing.assert_array_equal(x, kept)


@SOLVERS
def test_a_right_hand_side_that_is_a_slice_of_another_array(name: str) -> None:
    indptr, indices = pattern(50)
    solver = sparse.open_solver(name, indptr, indices)
    solver.factorise(values_of(indptr, indices, 1))
    b = np.random.default_rng(2).normal(size=(50, 3))
    np.testing.assert_array_equal(solver.solve(b[:, 1]), solver.solve(b[:, 1].copy()))


@SOLVERS
def test_values_written_over_after_factorising_do_not_matter(name: str) -> None:
    """The caller takes its array of values for the next tangent while the old factors still serve."""
    indptr, indices = pattern(100)
    solver = sparse.open_solver(name, indptr, indices)
    values, b = values_of(indptr, indices, 1), np.random.default_rng(5).normal(size=100)
    solver.factorise(values)
    before = solver.solve(b)
    values[:] = values_of(indptr, indices, 2)
    np.testing.assert_array_equal(solver.solve(b), before)


@SOLVERS
def test_a_saddle_point_with_a_small_block_on_the_diagonal(name: str) -> None:
    """As of displacement and pressure where little fluid flows: [[A, -B], [B', eps]] with A of the size of 5 and eps down to 1e-4. Where a
    pivot eps is taken as it is, rounding grows by 1/eps: 1e-11. Newton's method makes that good."""
    indptr, indices = pattern(60)
    A = matrix_of(indptr, indices, values_of(indptr, indices, 3))
    A = 0.1 * (A + A.T) * (1.0 - np.eye(60)) + 5.0 * np.eye(60)
    B = scipy_sparse.random_array((60, 30), density=0.1, rng=np.random.default_rng(4)).toarray() + np.eye(60, 30)
    for eps in (1.0, 1e-2, 1e-4):
        dense = np.block([[A, -B], [B.T, eps * np.eye(30)]])
        both = scipy_sparse.csr_matrix(dense)
        both.sort_indices()
        solver = sparse.open_solver(name, both.indptr.astype(np.int32), both.indices.astype(np.int32))
        solver.factorise(both.data)
        b = np.random.default_rng(6).normal(size=90)
        assert np.abs(dense @ solver.solve(b) - b).max() < 1e-10


def test_superlu_takes_pivots_off_a_diagonal_that_is_small() -> None:
    """[[0, 5], [4, 0]] along the diagonal of a matrix that is otherwise sparse. PARDISO without matching does not promise this."""
    indptr, indices = pattern(60)
    values = values_of(indptr, indices, 3)
    A = matrix_of(indptr, indices, values)
    n = 60
    couple = scipy_sparse.kron(scipy_sparse.eye(n // 2), np.array([[1e-13, 5.0], [4.0, 1e-13]])).tocsr()
    total = scipy_sparse.csr_matrix(0.01 * A * (1.0 - np.eye(n))) + couple
    both = (abs(total) + abs(total.T)).tocsr()  # a symmetric pattern, zeros included
    both.sort_indices()
    dense = total.toarray()
    rows = np.repeat(np.arange(n), np.diff(both.indptr))
    solver = sparse.open_solver("superlu", both.indptr.astype(np.int32), both.indices.astype(np.int32))
    solver.factorise(dense[rows, both.indices])
    b = np.random.default_rng(6).normal(size=n)
    assert np.abs(dense @ solver.solve(b) - b).max() < 1e-9  # a pivot of 1e-13 taken for what it is would leave 1e-3


@SOLVERS
def test_equal_values_give_equal_bits_whatever_came_before(name: str) -> None:
    indptr, indices = pattern(400)
    wild = 10.0 ** np.random.default_rng(8).uniform(-8.0, 8.0, len(indices))
    values, b = values_of(indptr, indices, 1), np.random.default_rng(9).normal(size=400)

    def solution(*before: np.ndarray) -> np.ndarray:
        solver = sparse.open_solver(name, indptr, indices)
        for other in (*before, values):
            solver.factorise(other)
            x = solver.solve(b)
        return x

    first = solution()
    np.testing.assert_array_equal(solution(), first)
    np.testing.assert_array_equal(solution(values_of(indptr, indices, 2)), first)
    np.testing.assert_array_equal(solution(wild * values, values_of(indptr, indices, 3)), first)
    np.testing.assert_array_equal(solution(values, values), first)


@SOLVERS
@pytest.mark.parametrize("kind", ["a row of zeros", "not a number"])
def test_a_singular_matrix(name: str, kind: str) -> None:
    """SuperLU says so. PARDISO replaces pivots and may not: then what it gives is no finite solution, or one far too large. Either goes
    on with other values."""
    indptr, indices = pattern(80)
    values = values_of(indptr, indices, 1)
    values[indptr[7] : indptr[8]] = 0.0 if kind == "a row of zeros" else np.nan
    solver = sparse.open_solver(name, indptr, indices)
    try:
        solver.factorise(values)
        x = solver.solve(np.ones(80))
    except sparse.SingularMatrix:
        pass
    else:
        assert not np.abs(x).max() < 1e10
    solver.factorise(values_of(indptr, indices, 2))
    x = solver.solve(np.ones(80))
    assert np.abs(matrix_of(indptr, indices, values_of(indptr, indices, 2)) @ x - 1.0).max() < 1e-12  # rounding


def test_superlu_refuses_a_singular_matrix() -> None:
    indptr, indices = pattern(80)
    solver = sparse.open_solver("superlu", indptr, indices)
    with pytest.raises(sparse.SingularMatrix, match="singular"):
        solver.factorise(np.zeros(len(indices)))


def test_what_is_not_installed_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """And "auto" takes what there is."""
    indptr, indices = pattern(10)
    monkeypatch.setattr(sparse, "load_mkl", lambda: None)
    with pytest.raises(ParameterError, match=r"multiphase-tissue\[pardiso\]") as caught:
        sparse.open_solver("pardiso", indptr, indices)
    assert "solver.linear" in str(caught.value)
    assert "superlu" in str(caught.value)
    assert sparse.open_solver("auto", indptr, indices).name == "superlu"


@pytest.mark.parametrize("broken", ["no module", "no library", "another class"])
def test_a_pardiso_that_cannot_be_used_counts_as_none(broken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Module:
        def __getattr__(self, name: str) -> Any:
            if broken == "no library":
                raise OSError("libmkl_rt.so.2: cannot open shared object file")
            return lambda: object()

    monkeypatch.setitem(sys.modules, "pypardiso", None if broken == "no module" else Module())
    sparse.load_mkl.cache_clear()
    try:
        assert sparse.load_mkl() is None
    finally:
        sparse.load_mkl.cache_clear()


def resident() -> float:
    """Memory of this process in use, in megabytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="memory is read from /proc")
@SOLVERS
def test_memory_is_given_back(name: str) -> None:
    """Thirty solvers one after the other, of several megabytes each, and one that is factorised thirty times."""
    n = 70
    lattice = scipy_sparse.diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(n, n))
    grid = scipy_sparse.csr_matrix(scipy_sparse.kron(lattice, lattice))
    grid.sort_indices()
    indptr, indices = grid.indptr.astype(np.int32), grid.indices.astype(np.int32)
    values = values_of(indptr, indices, 1)

    def once() -> None:
        solver = sparse.open_solver(name, indptr, indices)
        solver.factorise(values)
        solver.solve(np.ones(n * n))

    def growth(use: Callable[[], None]) -> float:
        for _ in range(3):
            use()
        gc.collect()
        before = resident()
        for _ in range(30):
            use()
        gc.collect()
        return resident() - before

    solver = sparse.open_solver(name, indptr, indices)
    solver.factorise(values)
    assert growth(once) < 15.0  # the factors of one take 2 MB and more: thirty that are kept would be 60
    assert growth(lambda: solver.factorise(values)) < 15.0


THREADS = """
import sys
import numpy as np
from scipy import sparse as scipy_sparse
from threadpoolctl import threadpool_limits
from multiphase import sparse
n = 60
lattice = scipy_sparse.diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(n, n))
grid = scipy_sparse.csr_matrix(scipy_sparse.kron(lattice, lattice))
grid.sort_indices()
indptr, indices = grid.indptr.astype(np.int32), grid.indices.astype(np.int32)
values = np.where(np.repeat(np.arange(n * n), np.diff(indptr)) == indices, 12.0, -1.0)
solver = sparse.open_solver(sys.argv[1], indptr, indices)
for outer in (1, 2, 1, 4, None):
    for inner in (2, 1, 4):
        with threadpool_limits(outer):
            given = values.copy()
            solver.factorise(given)
            given[:] = 0.0  # the caller's own again
        with threadpool_limits(inner):
            x = solver.solve(np.ones(n * n))
        grid.data[:] = values
        assert np.abs(grid @ x - 1.0).max() < 1e-12
print("fine")
"""


@SOLVERS
def test_the_number_of_threads_may_change_between_phases(name: str) -> None:
    """In a process of its own: MKL ends one in which it does not bear this."""
    environment = {key: value for key, value in os.environ.items() if key not in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", THREADS, name], capture_output=True, text=True, timeout=120, env=environment)
    assert (done.returncode, done.stdout) == (0, "fine\n"), done.stderr[-2000:]
