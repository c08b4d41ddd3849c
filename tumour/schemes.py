"""The radial tumour as schemes for the time loop: an elastic body, or a viscous one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from multiphase import lines, newton, transport
from multiphase.errors import SolverError
from multiphase.geometry import MovingGrid
from multiphase.lines import Kernel
from multiphase.stepping import Snapshot
from tumour import equations as eq
from tumour import eulerian, laws, observation, radial
from tumour.geometry import TumourGeometry
from tumour.parameters import ELASTIC_FIELDS, VISCOUS_FIELDS, TumourInitial, TumourParameters
from tumour.solver import ONE_CELL, TumourSolver

Array = NDArray[np.float64]

ELASTIC = Kernel(radial, parts=(observation, eulerian, laws, eq, transport), record=observation.record_elastic)
"""The compiled elastic discretisation."""
VISCOUS = Kernel(eulerian, parts=(observation, radial, laws, eq, transport), record=observation.record_viscous)
"""The compiled viscous discretisation."""
STRIDE = radial.STRIDE
"""Unknowns of a cell, in both."""


class Radial(lines.SemiDiscrete):
    """What the schemes of both rheologies share.

    Parameters
    ----------
    parameters, initial, geometry, solver : TumourParameters, TumourInitial, TumourGeometry, TumourSolver
    cells : int, optional
        Others than the solver's.
    """

    constants: Any

    def __init__(
        self,
        parameters: TumourParameters,
        initial: TumourInitial,
        geometry: TumourGeometry,
        solver: TumourSolver,
        cells: int | None = None,
    ) -> None:
        self.kernel.announce()
        self.parameters, self.geometry, self.solver = parameters, geometry, solver
        cells = solver.within(geometry).cells if cells is None else cells
        assert cells is not None
        self.cells, self.m, self.rtol = cells, geometry.m, solver.rtol
        self.grid = MovingGrid(cells)
        self.scalars = observation.scalar_names(self.m)
        self._build(initial)

    def _build(self, initial: TumourInitial) -> None:
        """Constants, work space and the initial vector."""
        raise NotImplementedError

    def _common(self) -> dict[str, Any]:
        """Constants that both rheologies need."""
        p = self.parameters
        names = ("kappa", "gamma", "alpha_star", "alpha_min", "sigma_width", "s1", "s2", "s3", "s4", "Q", "Q1_hat", "C_out", "p_out")
        return {name: float(getattr(p, name)) for name in names} | {
            "cells": self.cells, "m": self.m, "mu": float(p.mu_alpha), "lam": float(p.lambda_alpha), "law": p.flow[1],
            "floor": float(p.mobility_floor), "rtol": self.rtol, "necrotic": p.necrotic_level, "hypoxic": float(p.C_hypoxic),
        }  # fmt: skip

    def data(self, t: float) -> Any:
        """Constants of the scene; nothing in them depends on time."""
        return self.constants

    def data_until(self, t: float) -> Any:
        """Constants of the scene."""
        return self.constants


class Elastic(Radial):
    """The elastic tumour on cells that are equal in R: what its schemes share.

    Their vectors are ``[alpha J, C, r^m/m on the outer face; cell by cell | integrals]``; see `tumour.radial`.
    """

    kernel = ELASTIC
    fields = ELASTIC_FIELDS
    bounds: ClassVar[Mapping[int, str]] = {
        1: "a cell is turned inside out (J <= 0)",
        2: "the cell fraction alpha leaves (0, 1)",
        3: "oxygen falls below 0 by more than rtol",
        4: "cells are swollen more than 1e9-fold: nothing bounds the body; raise lambda_alpha, or lower p_out",
    }
    kink_band = 0.0
    """How far below alpha_min the tangent takes cells as in contact, in units of rtol."""

    def _build(self, initial: TumourInitial) -> None:
        N, m = self.cells, self.m
        self.as_printed = self.solver.alpha_step == "as-printed"
        R = self.geometry.radius * self.grid.faces
        V = R**m / m
        self.constants = radial.Data(
            R=R, V=V, kink_band=self.kink_band * self.rtol, as_printed=self.as_printed, rate=0.0, old=np.ones((2, N)), **self._common()
        )
        self.mass = np.tile([1.0, 0.0, 1.0 if self.parameters.kappa > 0.0 else 0.0], N)
        model = np.zeros((radial.WORK_ROWS, N + 1))
        self.work = newton.workspace(radial.STRIDE * N, radial.HALF, radial.BORDER, radial.INTEGRALS, model)
        alpha = observation.cell_averages(initial.alpha, R, m)
        y = np.zeros(radial.STRIDE * N + radial.INTEGRALS)
        y[0 : 3 * N : 3], y[1 : 3 * N : 3], y[2 : 3 * N : 3] = alpha, self.constants.C_out, V[1:]
        y = self.consistent(0.0, y)
        if not self._at_rest(y) or self.kernel["admit"](self.constants, y.copy(), self.work.model):
            raise SolverError(
                "no equilibrium was found at t = 0: with kappa = 0 the body takes one at once, and here there is none, or none near the "
                "body at rest. Take a small kappa, 1e-3 for instance, which lets it go there in time; or lower p_out, or raise "
                "lambda_alpha.",
                time=0.0,
            )
        self.start = np.array([float(np.sum(alpha * np.diff(V))), y[3 * N - 1], self.geometry.unit_size])
        self._initial = y

    def _at_rest(self, y: Array) -> bool:
        """Whether the algebraic rows hold, to a millionth of what their terms change by with the unknowns."""
        w, free = self.work, self.mass == 0.0
        self.kernel["rates"](self.constants, 0.0, y, w.f_0, w.model)
        terms = np.max(np.abs(w.jac), axis=1)[free] * np.maximum(np.abs(y[: len(free)]), 1e-3)[free]
        with np.errstate(invalid="ignore"):
            return bool(np.all(np.abs(w.f_0[: len(free)][free]) <= 1e-6 * terms))


class ElasticLines(Elastic, lines.Implicit):
    """The elastic tumour, one implicit step for the common time loop."""

    def step_data(self, t: float, alpha: float, past: Array) -> Any:
        """Constants of one step; for the step as printed with the last point, which backward Euler starts from."""
        if not self.as_printed:
            return self.constants
        J = np.diff(past[2 : 3 * self.cells : 3], prepend=0.0) / np.diff(self.constants.V)
        return self.constants._replace(rate=alpha, old=np.array([past[0 : 3 * self.cells : 3] / J, J]))


class ElasticRadau(Elastic, lines.Radau):
    """The elastic tumour with an integrator of its own."""

    kink_band = 0.3


class Viscous(Radial):
    """The viscous tumour on cells that are equal in xi = r/R(t): what its schemes share.

    Their vectors are ``[W alpha, C, u on the outer face; cell by cell | W = R^m/m, V = dW/dt | integrals]``; see `tumour.eulerian`.
    """

    kernel = VISCOUS
    fields = VISCOUS_FIELDS
    bounds: ClassVar[Mapping[int, str]] = {
        1: "the body has no size left (its radius is below 1e-12 of that at t = 0)",
        2: "the cell fraction alpha leaves [0, 1)",
        3: "oxygen falls below 0 by more than rtol",
        4: "no cells are left at the surface to bear p_out, which then tears the body apart; lower p_out, or raise mu_alpha",
    }
    limiter = True

    def _build(self, initial: TumourInitial) -> None:
        N, m = self.cells, self.m
        s = self.grid.faces**m
        W = self.geometry.radius**m / m
        self.constants = eulerian.Data(s=s, limiter=self.limiter, least=1e-12**m * W, **self._common())
        self.mass = np.concatenate([np.tile([1.0, 0.0, 0.0], N), [1.0, 0.0]])
        model = np.zeros((eulerian.WORK_ROWS, N + 1))
        self.work = newton.workspace(eulerian.STRIDE * N, eulerian.HALF, eulerian.BORDER, eulerian.INTEGRALS, model)
        alpha = observation.cell_averages(initial.alpha, self.geometry.radius * self.grid.faces, m)
        y = np.zeros(eulerian.STRIDE * N + eulerian.BORDER + eulerian.INTEGRALS)
        y[0 : 3 * N : 3], y[1 : 3 * N : 3], y[3 * N] = W * alpha, self.constants.C_out, W
        y = self.consistent(0.0, y)
        self.start = np.array([W * float(np.sum(alpha * np.diff(s))), W, self.geometry.unit_size])
        self._initial = y


class ViscousLines(Viscous, lines.Implicit):
    """The viscous tumour, one implicit step for the common time loop."""


class ViscousRadau(Viscous, lines.Radau):
    """The viscous tumour with an integrator of its own."""


class Uniform(Radial):
    """A body whose state is uniform, solved on one cell: what its schemes share.

    A uniform state satisfies the discrete equations of any number of cells to rounding, with the same numbers, and the norms of errors are
    the same as well; so the steps, too, are those on all cells. What is stored is that of the vector spread over the scene's cells, which
    is linear in it and so goes with the polynomial of a step.
    """

    whole: ClassVar[type[Radial]]

    def __init__(self, parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry, solver: TumourSolver) -> None:
        self._whole = self.whole(parameters, initial, geometry, solver)
        super().__init__(parameters, initial, geometry, solver, cells=ONE_CELL)

    def spread(self, vectors: Array) -> Array:
        """Vectors of the scene's cells, (..., size), of vectors of one cell."""
        N = self._whole.cells
        cells = np.repeat(vectors[..., None, :STRIDE], N, axis=-2)
        cells[..., 2] = self._outwards(vectors[..., 2:STRIDE])
        return np.concatenate([cells.reshape(*vectors.shape[:-1], STRIDE * N), vectors[..., STRIDE:]], axis=-1)

    def _outwards(self, surface: Array) -> Array:
        """The third unknown of a cell on all outer faces, (..., cells), of that at the surface, (..., 1)."""
        raise NotImplementedError

    def snapshots(self, wanted: Sequence[float], times: Array, past: Array) -> list[Snapshot]:
        """What is stored at the times `wanted`, on the scene's cells."""
        return self._whole.snapshots(wanted, times, self.spread(past))


class UniformElastic(Uniform):
    """r^m/m grows as the volume does; a body at rest stays so to the last bit."""

    def _outwards(self, surface: Array) -> Array:
        V = self._whole.constants.V
        return np.asarray(V[1:] * (surface / V[-1]))


class UniformViscous(Uniform):
    """The velocity grows as the radius does."""

    def _outwards(self, surface: Array) -> Array:
        return np.asarray(self._whole.grid.faces[1:] * surface)


class UniformElasticLines(UniformElastic, ElasticLines):
    whole = ElasticLines


class UniformElasticRadau(UniformElastic, ElasticRadau):
    whole = ElasticRadau


class UniformViscousLines(UniformViscous, ViscousLines):
    whole = ViscousLines


class UniformViscousRadau(UniformViscous, ViscousRadau):
    whole = ViscousRadau
