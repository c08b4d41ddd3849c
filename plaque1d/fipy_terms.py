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


class Scatter:
    """Turns the tangent of `plaque1d.discretisation`, three unknowns a cell, into that of FiPy's residual in the order of `Layout`.

    Parameters
    ----------
    cells : int
    """

    def __init__(self, cells: int) -> None:
        self.layout = layout = Layout(cells)
        size, half = 3 * cells, 6
        width = 2 * half + 1
        place = np.array([layout.n.start, layout.l.start, layout.w.start])[np.arange(size) % 3] + np.arange(size) // 3
        column = np.repeat(np.arange(size), width) + np.tile(np.arange(width) - half, size)
        self._inside = np.flatnonzero((column >= 0) & (column < size - 1) & (np.repeat(np.arange(size), width) < size - 1))
        row = np.repeat(np.arange(size), width)[self._inside]
        self._place = place[:-1]  # the slip at the outer wall is no unknown
        self._row, self._column = place[row], place[column[self._inside]]
        every, scalars = np.arange(layout.base), np.array([layout.W, layout.V])
        rows = [self._row, self._place, self._place, np.full(size - 1, layout.W), np.full(size - 1, layout.V), np.repeat(scalars, 2)]
        columns = [self._column, np.full(size - 1, layout.W), np.full(size - 1, layout.V), self._place, self._place, np.tile(scalars, 2)]
        cells_n_l = every[: layout.w.start]
        entries = np.concatenate([*columns, every, np.full(len(cells_n_l), layout.W)]) * layout.base
        entries += np.concatenate([*rows, every, cells_n_l])
        places, self._slot = np.unique(entries, return_inverse=True)
        self._indices = places % layout.base
        self._starts = np.searchsorted(places, np.arange(layout.base + 1) * layout.base)

    def matrix(self, work: Any, balance: Array, scale: Array, x: Array) -> csc_matrix:
        """Derivative of ``balance y + scale rates(y)`` with respect to (n, l, w, W, V), where y = (W n, W l, w, W, V).

        Parameters
        ----------
        work : multiphase.radau.Work
            Holds the tangent of the rates.
        balance, scale : (3 N + 1,) array
        x : array
            The state, (n, l, w, W, V, ...).
        """
        layout = self.layout
        products = layout.w.start
        inner = np.zeros(layout.base)  # dy/dW through n and l
        inner[:products] = x[:products]
        unit = np.ones(layout.base)
        unit[:products] = x[layout.W]
        band = scale[self._row] * work.jac.ravel()[self._inside]
        through = np.bincount(self._row, weights=band * inner[self._column], minlength=layout.base)
        place = self._place
        rows = work.rows[:, :-1]
        corner = work.corner.copy()
        corner[:, 0] += rows @ inner[place]
        border = scale[[layout.W, layout.V]]
        values = np.concatenate([
            band * unit[self._column],
            scale[place] * work.columns[0, :-1] + through[place], scale[place] * work.columns[1, :-1],
            border[0] * rows[0] * unit[place], border[1] * rows[1] * unit[place], (border[:, None] * corner).ravel(),
            balance * unit, (balance * inner)[:products],
        ])  # fmt: skip
        data = np.bincount(self._slot, weights=values)
        return csc_matrix((data, self._indices, self._starts), shape=(layout.base, layout.base))


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
