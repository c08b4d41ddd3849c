"""Sparse linear systems whose pattern is fixed: analysed once, factorised when the values change, solved often.

`open_solver` gives PARDISO where the extra ``pardiso`` is installed, else SciPy's SuperLU with a symmetric ordering (minimum degree on
A + A^T): its default, a column ordering, is several times slower for finite elements and fills the memory.
"""

from __future__ import annotations

import ctypes
import time
import weakref
from collections.abc import Callable
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from multiphase.errors import ParameterError

Array = NDArray[np.float64]

REAL_UNSYMMETRIC = 11
ANALYSE, FACTORISE, SOLVE, RELEASE = 11, 22, 33, -1
LEAST_PIVOT = 1e-6
"""Share of the largest entry of its column that a diagonal pivot of SuperLU has at least; with more, the matrices of steps that are short,
whose pressures have small diagonals, fill up with pivots from elsewhere."""
PERTURBATION = 13
"""Pivots below 1e-13 of the matrix are replaced by that, which refinement makes good."""


class SingularMatrix(ArithmeticError):
    """The matrix could not be factorised."""


class SparseSolver(Protocol):
    """A matrix in compressed rows with a fixed pattern, symmetric in structure.

    Attributes
    ----------
    name : str
    seconds : dict of str to float
        Time spent on "analyse", "factorise" and "solve".
    counts : dict of str to int
        Calls of "factorise" and "solve".
    """

    name: str
    seconds: dict[str, float]
    counts: dict[str, int]

    def factorise(self, values: Array) -> None:
        """Take the values of the entries, in the order of the pattern; raises SingularMatrix."""

    def solve(self, b: Array) -> Array:
        """The solution for the values last factorised."""


def open_solver(name: str, indptr: NDArray[np.int32], indices: NDArray[np.int32]) -> SparseSolver:
    """A solver for the pattern `indptr`, `indices` (compressed rows, sorted).

    Parameters
    ----------
    name : {"auto", "pardiso", "superlu"}

    Raises
    ------
    ParameterError
        For "pardiso" where it is not installed.
    """
    library = None if name == "superlu" else load_mkl()
    if name != "pardiso" and library is None:
        return SuperLU(indptr, indices)
    if library is None:
        raise ParameterError(
            "solver.linear",
            '"pardiso" is not installed: pip install "multiphase-tissue[pardiso]" (Linux and Windows on Intel and AMD processors), or take '
            'linear = "superlu".',
        )
    return Pardiso(indptr, indices, library)


@cache
def load_mkl() -> Any:
    """Intel's MKL, or None where the extra is not installed."""
    try:
        from pypardiso import PyPardisoSolver

        return PyPardisoSolver().libmkl
    except (ImportError, OSError, AttributeError):
        return None


class _Timed:
    """Counts and times of the phases."""

    name = ""

    def __init__(self) -> None:
        self.seconds = {"analyse": 0.0, "factorise": 0.0, "solve": 0.0}
        self.counts = {"factorise": 0, "solve": 0}

    def _done(self, phase: str, started: float) -> None:
        self.seconds[phase] += time.perf_counter() - started
        if phase in self.counts:
            self.counts[phase] += 1


class SuperLU(_Timed):
    """SciPy's SuperLU with a symmetric ordering and pivots from the diagonal where they are large enough."""

    name = "superlu"

    def __init__(self, indptr: NDArray[np.int32], indices: NDArray[np.int32]) -> None:
        super().__init__()
        size = len(indptr) - 1
        self._transposed = sparse.csc_matrix((np.zeros(len(indices)), indices, indptr), shape=(size, size))
        self._factor: Any = None

    def factorise(self, values: Array) -> None:
        started = time.perf_counter()
        self._factor = None  # its memory first
        self._transposed.data[:] = values
        try:
            self._factor = splu(
                self._transposed, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=LEAST_PIVOT, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise SingularMatrix(str(error)) from error
        self._done("factorise", started)

    def solve(self, b: Array) -> Array:
        started = time.perf_counter()
        x: Array = self._factor.solve(b, "T")
        self._done("solve", started)
        return x


class Pardiso(_Timed):
    """PARDISO of Intel's MKL: the ordering is found once for the pattern.

    Without weighted matching and scaling, which would make the ordering depend on the values: equal values give equal factors, bit for
    bit, whatever came before. PARDISO crashes when the number of threads changes between its phases, so everything is done again then.
    """

    name = "pardiso"

    def __init__(self, indptr: NDArray[np.int32], indices: NDArray[np.int32], library: Any) -> None:
        super().__init__()
        self._call, self._count_threads, self._size = library.pardiso, library.mkl_get_max_threads, len(indptr) - 1
        self._indptr, self._indices = np.ascontiguousarray(indptr, dtype=np.int32), np.ascontiguousarray(indices, dtype=np.int32)
        self._handle = np.zeros(64, dtype=np.int64)
        self._settings = np.zeros(64, dtype=np.int32)
        for place, value in ((0, 1), (1, 2), (9, PERTURBATION), (34, 1)):  # own settings, METIS, pivots, indices from 0
            self._settings[place] = value
        self._values = np.zeros(len(indices))
        self._x = np.zeros(self._size)
        self._threads = 0
        self._release = weakref.finalize(self, _release, self._call, self._handle, self._settings, self._size)

    def factorise(self, values: Array) -> None:
        started = time.perf_counter()
        if self._threads != self._count_threads():
            if self._threads:
                _release(self._call, self._handle, self._settings, self._size)
                self._handle[:] = 0
            self._threads = self._count_threads()
            self._run(ANALYSE, values, self._x)
            self._done("analyse", started)
            started = time.perf_counter()
        self._run(FACTORISE, values, self._x)
        self._values = values.copy()
        self._done("factorise", started)

    def solve(self, b: Array) -> Array:
        if self._threads != self._count_threads():
            self.factorise(self._values)
        started = time.perf_counter()
        self._run(SOLVE, self._values, np.ascontiguousarray(b))
        self._done("solve", started)
        return self._x.copy()

    def _run(self, phase: int, values: Array, b: Array) -> None:
        error = _pardiso(self._call, self._handle, self._settings, phase, self._size, values, self._indptr, self._indices, b, self._x)
        if error == -2:
            raise MemoryError(f"the factors of {self._size} unknowns do not fit into the memory")
        if error != 0:
            raise SingularMatrix(f"PARDISO stopped with error {error} in phase {phase}")


def _pardiso(
    call: Callable[..., Any], handle: NDArray[np.int64], settings: NDArray[np.int32], phase: int, size: int, values: Array,
    indptr: NDArray[np.int32], indices: NDArray[np.int32], b: Array, x: Array,
) -> int:  # fmt: skip
    """One call of PARDISO; its error code."""
    integer, whole = ctypes.POINTER(ctypes.c_int32), ctypes.c_int32
    error = whole(0)
    nothing = np.zeros(1, dtype=np.int32)

    def number(value: int) -> Any:
        return ctypes.byref(whole(value))

    call(
        handle.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), number(1), number(1), number(REAL_UNSYMMETRIC), number(phase), number(size),
        values.ctypes.data_as(ctypes.c_void_p), indptr.ctypes.data_as(integer), indices.ctypes.data_as(integer),
        nothing.ctypes.data_as(integer), number(1), settings.ctypes.data_as(integer), number(0), b.ctypes.data_as(ctypes.c_void_p),
        x.ctypes.data_as(ctypes.c_void_p), ctypes.byref(error),
    )  # fmt: skip
    return int(error.value)


def _release(call: Callable[..., Any], handle: NDArray[np.int64], settings: NDArray[np.int32], size: int) -> None:
    """Give MKL's memory back."""
    indptr, zeros = np.zeros(2, dtype=np.int32), np.zeros(1)
    _pardiso(call, handle, settings, RELEASE, size, zeros, indptr, np.zeros(1, dtype=np.int32), zeros, zeros)
