"""Pieces of the FiPy scheme that stand on their own: FiPy itself, transport on the moving grid, and sums free of rounding."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.geometry import MovingGrid

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


def cell_averages(function: Callable[..., Array], grid: MovingGrid, L: float) -> Array:
    """Averages over the cells of a function of x and xi, by Gauss's rule of three points."""
    points, weights = np.polynomial.legendre.leggauss(3)
    xi = grid.centres[:, None] + 0.5 * grid.spacing * points
    values = np.asarray(function(x=L * xi.ravel(), xi=xi.ravel()), dtype=float).reshape(xi.shape)
    return values @ (0.5 * weights)


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


def closed(inner: Array) -> Array:
    """Interior face values with zero at both ends."""
    return np.concatenate([[0.0], inner, [0.0]])
