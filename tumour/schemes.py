"""The radial tumour as schemes for the time loop: an elastic body, or a viscous one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase import lines, radau
from multiphase.lines import Kernel
from tumour import equations as eq
from tumour import laws, observation, radial
from tumour.parameters import TumourGeometry, TumourInitial, TumourParameters, TumourSolver

Array = NDArray[np.float64]

ELASTIC = Kernel(radial, observation, parts=(laws, eq))
"""The compiled elastic discretisation."""

_ELASTIC_BOUNDS = {
    1: "a cell is turned inside out (J <= 0)",
    2: "the cell fraction alpha leaves (0, 1)",
    3: "oxygen falls below 0 by more than rtol",
}


class Elastic(lines.SemiDiscrete):
    """The elastic tumour on cells that are equal in R: what its schemes share.

    Their vectors are ``[alpha J, C, r^m/m on the outer face; cell by cell | integrals]``; see `tumour.radial`.

    Parameters
    ----------
    parameters, initial, geometry, solver : TumourParameters, TumourInitial, TumourGeometry, TumourSolver
    """

    kernel = ELASTIC
    fields = observation.ELASTIC_FIELDS
    bounds = _ELASTIC_BOUNDS

    def __init__(self, parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry, solver: TumourSolver) -> None:
        self.kernel.announce()
        self.parameters, self.geometry, self.cells, self.rtol = parameters, geometry, solver.cells, solver.rtol
        self.m, N = geometry.m, solver.cells
        self.scalars = observation.scalar_names(self.m)
        self.as_printed = solver.alpha_step == "as-printed"
        R = geometry.radius * np.arange(N + 1) / N
        V = R**self.m / self.m
        p = parameters
        self._data = radial.Data(
            cells=N, m=self.m, R=R, V=V, mu=p.mu_alpha, lam=p.lambda_alpha, kappa=p.kappa, law=p.flow[1], floor=p.mobility_floor,
            Q=p.Q, Q1_hat=p.Q1_hat, C_out=p.C_out, p_out=p.p_out, rtol=solver.rtol, necrotic=0.294, hypoxic=0.5,
            as_printed=self.as_printed, rate=0.0, old=np.ones((2, N)),
            **{name: float(getattr(p, name)) for name in ("gamma", "alpha_star", "alpha_min", "sigma_width", "s1", "s2", "s3", "s4")},
        )  # fmt: skip
        self.mass = np.tile([1.0, 0.0, 1.0 if p.kappa > 0.0 else 0.0], N)
        model = np.zeros((radial.WORK_ROWS, N + 1))
        self.work = radau.workspace(radial.STRIDE * N, radial.HALF, radial.BORDER, radial.INTEGRALS, model)
        self._initial = self._initial_vector(initial)

    def _initial_vector(self, initial: TumourInitial) -> Array:
        d, N = self._data, self.cells
        alpha = observation.cell_averages(initial.alpha, d.R, self.m)
        y = np.zeros(radial.STRIDE * N + radial.INTEGRALS)
        y[0 : 3 * N : 3], y[1 : 3 * N : 3], y[2 : 3 * N : 3] = alpha, d.C_out, d.V[1:]
        y = self.consistent(0.0, y)
        self.start = np.array([float(np.sum(alpha * np.diff(d.V))), y[3 * N - 1], self.geometry.unit_size])
        return y

    def data(self, t: float) -> radial.Data:
        """Constants of the scene."""
        return self._data

    def data_until(self, t: float) -> radial.Data:
        """Constants of the scene."""
        return self._data


class ElasticLines(Elastic, lines.Implicit):
    """The elastic tumour, one implicit step for the common time loop."""

    def step_data(self, t: float, alpha: float, past: Array) -> Any:
        """Constants of one step; for the step as printed with the last point, which backward Euler starts from."""
        if not self.as_printed:
            return self._data
        J = np.diff(past[2 : 3 * self.cells : 3], prepend=0.0) / np.diff(self._data.V)
        return self._data._replace(rate=alpha, old=np.array([past[0 : 3 * self.cells : 3] / J, J]))


class ElasticRadau(Elastic, lines.Radau):
    """The elastic tumour with an integrator of its own."""
