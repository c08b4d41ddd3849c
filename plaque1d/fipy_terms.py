"""Pieces of the FiPy scheme that stand on their own: FiPy itself, its order of the unknowns, transport on the moving grid, and sums free
of rounding."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

Array = NDArray[np.float64]


def import_fipy() -> Any:
    """FiPy with its SciPy solvers; it reads the command line and the environment as it is imported."""
    if "fipy" not in sys.modules:
        arguments, sys.argv = sys.argv, sys.argv[:1]
        os.environ.setdefault("FIPY_SOLVERS", "scipy")
        try:
            import fipy
        finally:
            sys.argv = arguments
    import fipy

    return fipy


@dataclass(frozen=True)
class Layout:
    """Where each unknown stands in the Newton vector of the FiPy scheme: n, l (cells), w (interior faces), W, V, species."""

    cells: int
    species: int = 0

    @property
    def n(self) -> slice:
        return slice(0, self.cells)

    @property
    def l(self) -> slice:  # noqa: E743 - the paper's symbol
        return slice(self.cells, 2 * self.cells)

    @property
    def w(self) -> slice:
        return slice(2 * self.cells, 3 * self.cells - 1)

    @property
    def W(self) -> int:
        return 3 * self.cells - 1

    @property
    def V(self) -> int:
        return 3 * self.cells

    @property
    def base(self) -> int:
        """Unknowns without species."""
        return 3 * self.cells + 1

    def extra(self, index: int) -> slice:
        """Species number `index`."""
        first = self.base + index * self.cells
        return slice(first, first + self.cells)

    @property
    def unknowns(self) -> int:
        return self.base + self.species * self.cells


def scattered(jac: Array, columns: Array, rows: Array, corner: Array, stride: int) -> csc_matrix:
    """The tangent of `plaque1d.discretisation`, three unknowns a cell, in the order of `Layout`."""
    size, width = jac.shape
    half, cells = (width - 1) // 2, size // stride
    layout = Layout(cells)
    kind = np.arange(size) % stride
    place = np.choose(kind, [layout.n.start, layout.l.start, layout.w.start]) + np.arange(size) // stride
    place[-1] = -1  # the slip at the outer wall is no unknown
    row = np.repeat(np.arange(size), width)
    column = row + np.tile(np.arange(width) - half, size)
    value = jac.ravel()
    keep = (column >= 0) & (column < size)
    parts = [(place[row[keep]], place[column[keep]], value[keep])]
    for index, border in enumerate((layout.W, layout.V)):
        parts.append((place, np.full(size, border), columns[index]))
        parts.append((np.full(size, border), place, rows[index]))
        parts.append((np.full(2, border), np.array([layout.W, layout.V]), corner[index]))
    r, c, v = (np.concatenate(part) for part in zip(*parts, strict=True))
    inside = (r >= 0) & (c >= 0)
    return csc_matrix((v[inside], (r[inside], c[inside])), shape=(layout.base, layout.base))


class NecroticTransport:
    """The FiPy equation ``(L n)_t + (n (u - xi V))_xi = ...`` with velocities given on the faces.

    Parameters
    ----------
    fipy : module
    mesh : fipy Grid1D over xi in [0, 1]
    n, width : fipy.CellVariable with hasOld
        The fraction and L (uniform).
    """

    def __init__(self, fipy: Any, mesh: Any, n: Any, width: Any) -> None:
        self._n = n
        self._velocity = fipy.FaceVariable(mesh=mesh, rank=1, value=0.0)
        self._correction = fipy.FaceVariable(mesh=mesh, rank=1, value=0.0)
        self.terms = (
            fipy.TransientTerm(coeff=width, var=n) + fipy.UpwindConvectionTerm(coeff=self._velocity, var=n) + self._correction.divergence
        )

    def set_flux(self, velocity: Array, flux: Array) -> None:
        """Velocity relative to the moving faces, and the total flux of n, both (N+1,). The implicit upwind term takes the
        part that the interior velocity carries; the rest of the flux, and all of it at both ends, is explicit."""
        inner = velocity.copy()
        inner[[0, -1]] = 0.0
        n = self._n.value
        upwind = np.zeros_like(flux)
        upwind[1:-1] = np.maximum(inner[1:-1], 0.0) * n[:-1] + np.minimum(inner[1:-1], 0.0) * n[1:]
        self._velocity.setValue(inner[None, :])
        self._correction.setValue((flux - upwind)[None, :])


def without_rounding(residual: Array, total: float, size: float) -> Array:
    """`residual` shifted evenly so that it adds up to `total`, as its fluxes do in exact arithmetic.

    FiPy's rows are differences of terms of order `size`, so the fluxes of thin cells leave rounding that would add up over a run. More
    than rounding is not touched.
    """
    defect = total - float(np.sum(residual))
    if abs(defect) > 1e3 * np.finfo(float).eps * len(residual) * size:
        return residual
    return residual + defect / len(residual)
