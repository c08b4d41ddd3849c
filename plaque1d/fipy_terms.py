"""Pieces of the FiPy scheme that stand on their own: its order of the unknowns, and transport on the moving grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.fipy_newton import Scatter

Array = NDArray[np.float64]


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


def scatter(cells: int) -> Scatter:
    """What turns the tangent of `plaque1d.discretisation`, three unknowns a cell, into that of FiPy's residual in the order of `Layout`."""
    layout, unknown = Layout(cells), np.arange(3 * cells)
    place = np.array([layout.n.start, layout.l.start, layout.w.start])[unknown % 3] + unknown // 3
    place[-1] = -1  # the slip at the outer wall is no unknown
    return Scatter(place, half=6, border=2, products=slice(layout.w.start))


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
