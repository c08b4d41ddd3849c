"""The semi-discrete plaque as an object: one scene's constants, its vector of unknowns, and what is read off it.

Every scheme of the plaque builds on it: the method of lines and FiPy solve the same discrete equations, those of
`plaque1d.discretisation`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multiphase import geometry, lines, newton, transport
from multiphase.geometry import MovingGrid
from multiphase.lines import Kernel
from multiphase.stepping import Snapshot
from plaque1d import discretisation as fv
from plaque1d import equations as eq
from plaque1d import laws, layout, observation, slip
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters

Array = NDArray[np.float64]

KERNEL = Kernel(fv, observation, parts=(layout, slip, laws, eq, geometry, transport))
"""The compiled discretisation, which the schemes of the plaque share."""

BOUNDS = {
    1: "n leaves [0, 1] by more than rtol",
    2: "l falls below 0 by more than rtol",
    3: "the size of the wall is no longer positive",
    4: "momentum = drag is ill-posed where p_out - (1 - 2n) Sigma is negative, as it has become",
}


class SemiDiscrete(lines.SemiDiscrete):
    """The plaque on equal cells: what its schemes share.

    Their vectors begin with ``[cell unknowns, W, V, integrals]``, in the order of `plaque1d.discretisation`.

    Parameters
    ----------
    parameters, initial, geometry : PlaqueParameters, PlaqueInitial, PlaqueGeometry
    cells : int
        N, equal in length (slab) or area (annulus).
    rtol : float
        The accuracy knob: local errors of n are kept below rtol, of l below rtol max(l), of W below rtol W.
    """

    kernel = KERNEL
    fields, scalars = observation.FIELDS, observation.SCALARS
    bounds = BOUNDS

    def __init__(
        self,
        parameters: PlaqueParameters,
        initial: PlaqueInitial,
        geometry: PlaqueGeometry,
        cells: int,
        rtol: float,
        floor: float = layout.FLOOR,
    ) -> None:
        KERNEL.announce()
        self.parameters, self.initial_values, self.geometry, self.rtol = parameters, initial, geometry, rtol
        self.cells, self.grid = cells, MovingGrid(cells)
        self.breaks, self.kinks = parameters.Psi_l.jumps, parameters.Psi_l.breaks
        drag = parameters.momentum == "drag"
        self.stride = 4 if geometry.annulus and drag else 3
        """Unknowns of a cell."""
        self.size = self.stride * cells
        """Unknowns of all cells, which the border (W, V) and the integrals follow."""
        strongest = max(parameters.Psi_l.values)
        wall = parameters.inner_wall
        self._constants = layout.Data(
            cells=cells, stride=self.stride, annulus=geometry.annulus, drag=drag, inner_radius=geometry.inner_radius,
            influx=0.0, influx_rate=0.0, t_0=0.0,
            n_wall=np.nan if isinstance(wall, str) else float(wall), rtol=rtol, floor=floor,
            l_reference=float(np.sqrt(strongest / parameters.Psi_m)) if parameters.Psi_m > 0.0 and strongest > 0.0 else 1.0,
            **{name: float(getattr(parameters, name)) for name in (
                "Psi_m", "k_l", "k_m", "b", "mu_n", "lambda_n", "mu_m", "lambda_m", "A", "B", "k", "p_out")},
        )  # fmt: skip
        self._segments: dict[float, layout.Data] = {}
        self.mass = np.ones(self.size + layout.BORDER)
        for kind in range(2, self.stride):
            self.mass[kind : self.size : self.stride] = 0.0
        self.mass[self.size + 1] = 0.0
        model = np.zeros((layout.WORK_ROWS, cells + 1))
        self.work = newton.workspace(self.size, 2 * self.stride, layout.BORDER, layout.INTEGRALS, model)
        self.start = np.zeros(4)
        self._initial = self._initial_vector()

    @property
    def n(self) -> slice:
        """Where the products W n stand."""
        return slice(0, self.size, self.stride)

    @property
    def l(self) -> slice:  # noqa: E743 - the paper's symbol
        """Where the products W l stand."""
        return slice(1, self.size, self.stride)

    @property
    def w(self) -> slice:
        """Where the slip on the interior faces stands."""
        return slice(2, self.size - self.stride, self.stride)

    def data(self, t: float) -> layout.Data:
        """Constants of the stretch between two breaks of Psi_l(t) that begins at or contains `t`."""
        series = self.parameters.Psi_l
        if not series.breaks and self._segments:
            return self._segments[-np.inf]
        first = max((b for b in series.breaks if b <= t), default=-np.inf)
        if first not in self._segments:
            last = min((b for b in series.breaks if b > t), default=np.inf)
            value, rate, origin = series(t), 0.0, t
            if np.isfinite(first) and np.isfinite(last):
                value, origin = series(first), first
                rate = (series(last, side=-1) - value) / (last - first)
            self._segments[first] = self._constants._replace(influx=float(value), influx_rate=float(rate), t_0=float(origin))
        return self._segments[first]

    def _initial_vector(self) -> Array:
        start, W = self.initial_values, self.geometry.size(self.initial_values.L)
        n, l = (observation.cell_averages(f, self.grid, self.geometry, start.L) for f in (start.n, start.l))
        n, l = np.clip(n, 0.0, 1.0), np.maximum(l, 0.0)  # the quadrature leaves rounding
        n_total = W * float(np.mean(n))
        self.start = np.array([n_total, W - n_total, W * float(np.mean(l)), W])
        y = np.zeros(self.size + layout.BORDER + layout.INTEGRALS)
        y[self.n], y[self.l], y[self.size] = W * n, W * l, W
        return self.consistent(0.0, y)

    def out_of_bounds(self, number: int) -> str:
        """The bound that a step broke, in words."""
        cure = f"; raise p_out to A = {self.parameters.A:g}, or use momentum = interfacial"
        return BOUNDS[number] + (cure if number == 4 else "")

    def snapshot(self, t: float, u: Array, extra: dict[str, Array], added: tuple[float, float]) -> Snapshot:
        """What is stored, with further fields, and integrals of further sources of n and l."""
        gains = observation.gains(self._constants, u) + np.array([added[0], -added[1], 0.0, 0.0])
        fields, scalars = np.empty((len(self.fields) + 1, self.cells)), np.empty(len(self.scalars))
        KERNEL["observe"](self.data_until(t), t, u, self.start, gains, fields, scalars)
        stored = self.named(t, fields, scalars)
        return Snapshot(t, stored.scalars, dict(stored.fields) | extra, stored.x)
