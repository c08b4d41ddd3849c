"""The plaque by the method of lines: the compiled finite volumes of `plaque1d.discretisation` with the schemes of `multiphase.lines`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from multiphase import geometry as grids
from multiphase import lines, newton, transport
from multiphase.lines import Kernel
from multiphase.stepping import Snapshot
from plaque1d import discretisation as fv
from plaque1d import equations as eq
from plaque1d import laws, layout, ldl, observation
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters
from plaque1d.semidiscrete import BOUNDS, SemiDiscrete

Array = NDArray[np.float64]

LDL = Kernel(ldl, parts=(fv, layout, laws, eq, grids, transport))
"""The compiled discretisation of modLDL alone."""


class LinesScheme(SemiDiscrete, lines.Implicit):
    """One implicit step for the common time loop."""


class RadauLines(SemiDiscrete, lines.Radau):
    """With an integrator of its own."""


class FixedFractions(lines.SemiDiscrete):
    """The plaque where the fractions of the phases stay what they are at first: modLDL and the width alone.

    Its vectors are ``[W l, cell by cell | W, V | integrals]``; see `plaque1d.ldl`. What is stored is that of the whole system's vector,
    whose fractions are known and whose slip follows from its own equations, which are linear in it, at each point of a step.

    Parameters
    ----------
    parameters, initial, geometry, cells, rtol
        As of `plaque1d.semidiscrete.SemiDiscrete`.
    """

    kernel = LDL
    fields, scalars = observation.FIELDS, observation.SCALARS
    bounds = BOUNDS

    def __init__(self, parameters: PlaqueParameters, initial: PlaqueInitial, geometry: PlaqueGeometry, cells: int, rtol: float) -> None:
        self._whole = whole = SemiDiscrete(parameters, initial, geometry, cells, rtol)
        self.kernel.announce()
        self.cells, self.rtol, self.start = cells, rtol, whole.start
        self.breaks, self.kinks = whole.breaks, whole.kinks
        self.mass = np.ones(cells + layout.BORDER)
        self.mass[-1] = 0.0
        self.work = newton.workspace(cells, ldl.HALF, layout.BORDER, layout.INTEGRALS, np.zeros((ldl.WORK_ROWS, cells + 1)))
        y = whole.initial()
        self._n = y[whole.n] / y[whole.size]
        self._initial = np.concatenate([y[whole.l], y[whole.size :]])

    def data(self, t: float) -> ldl.Data:
        """Constants of the stretch between two breaks of Psi_l(t) that begins at or contains `t`."""
        return ldl.Data(self._whole.data(t), 1.0 - self._n)

    def snapshots(self, wanted: Sequence[float], times: Array, past: Array) -> list[Snapshot]:
        """What is stored at the times `wanted`, on the polynomial through the points (times, past)."""
        whole = self._whole
        data = whole.data_until(float(times[0]))
        vectors = np.zeros((len(past), len(whole.initial())))
        vectors[:, whole.n], vectors[:, whole.l] = past[:, self.cells, None] * self._n, past[:, : self.cells]
        vectors[:, whole.size :] = past[:, self.cells :]
        for t, y in zip(times, vectors, strict=True):
            whole.kernel["settle"](data, float(t), y, whole.work)
        return whole.snapshots(wanted, times, vectors)


class FixedFractionsLines(FixedFractions, lines.Implicit):
    """One implicit step of modLDL alone."""


class FixedFractionsRadau(FixedFractions, lines.Radau):
    """ModLDL alone with an integrator of its own."""
