r"""The moving grid that every one-dimensional model on a growing domain shares.

A body ``0 <= x <= L(t)`` is mapped to ``xi = x / L(t)`` in [0, 1]. In conservative (arbitrary
Lagrangian-Eulerian) form a density ``f`` carried with velocity ``u`` obeys

    (L f)_t + ( f (u - xi V) )_xi = L s,      V = L'(t).

Cells are equal in xi. A uniform ``f`` stays uniform for ``u = 0`` if, and only if, the difference of the
face values of ``xi V`` over a cell equals the time difference of ``L`` over it: the geometric conservation
law, which holds here to rounding when V is the time formula's own derivative of L.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def relative_velocity(velocity: Array | float, xi: Array, wall_speed: float) -> Array:
    """Velocity ``u - xi V`` of the material through the moving faces at `xi`."""
    return velocity - xi * wall_speed


@dataclass(frozen=True)
class MovingGrid:
    """Equal cells in xi = x / L on [0, 1].

    Attributes
    ----------
    cells : int
    """

    cells: int

    @property
    def spacing(self) -> float:
        """Cell width in xi."""
        return 1.0 / self.cells

    @cached_property
    def faces(self) -> Array:
        """Faces in xi, (cells + 1,)."""
        return np.arange(self.cells + 1) / self.cells

    @cached_property
    def centres(self) -> Array:
        """Centres in xi, (cells,)."""
        return (np.arange(self.cells) + 0.5) / self.cells
