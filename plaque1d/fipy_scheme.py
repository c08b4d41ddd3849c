r"""The plaque in FiPy: meshes, variables and terms on the rescaled domain, solved by Newton's method.

FiPy holds the discrete equations. n and l live on a `Grid1D` of cells in xi = x/L, the slip w on a second one,
shifted by half a cell, whose cells are the interior faces of the first. With `TransientTerm(coeff=L)` and L
a variable with `hasOld`, the time derivative is ``(L n - L_old n_old)/dt``, conservative; a BDF step of order two is
such a step of size ``1/alpha`` from a weighted past. Convection is FiPy's upwind term plus the divergence of what
the limited second-order flux adds to it.

The equations are strongly coupled (n to w through the stress: G D1 / (b + nu q^2) times dt is often far above one, so
sweeping one equation after the other diverges), so the residual that FiPy assembles is solved by Newton's
method with the exact tangent of `plaque1d.tangent`, n, l, w, L and V at once. Terms that a user adds take part
through finite differences over three colours of cells.

The products L n and L l are updated as linear unknowns, and the integrals of the sources advance with the same
linearised step, so the balances of mass close to rounding whatever the tolerance of the iteration.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from multiphase.errors import ParameterError
from multiphase.fipy_newton import Assembled, Places, import_fipy, without_rounding
from multiphase.stepping import Snapshot
from multiphase.transport import floored
from plaque1d import equations as eq
from plaque1d.extensions import Extension, ExtraTerms
from plaque1d.fipy_terms import Layout, NecroticTransport, scatter
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters
from plaque1d.semidiscrete import SemiDiscrete

Array = NDArray[np.float64]


class FipyScheme(SemiDiscrete, Assembled):
    """One implicit step of the plaque, assembled by FiPy. See the module's description.

    Its vector is that of `SemiDiscrete`, then the products W s of the species, then the integrals over time of what is added to n
    and to l.

    Parameters
    ----------
    parameters, initial, geometry : PlaqueParameters, PlaqueInitial, PlaqueGeometry
        In the annulus with the interfacial form only.
    cells : int
        N, equal in xi.
    rtol : float
        The accuracy knob: local errors of n are kept below rtol, of l below rtol max(l), of L below rtol L.
    extra_terms : callable, optional
        Called once with an `Extension`; returns FiPy terms to add to the right-hand sides (see `plaque1d.extensions`).

    Raises
    ------
    ParameterError
        From `extra_terms` that name an unknown equation, or are given in the annulus.
    """

    def __init__(
        self,
        parameters: PlaqueParameters,
        initial: PlaqueInitial,
        geometry: PlaqueGeometry,
        cells: int,
        rtol: float,
        extra_terms: ExtraTerms | None = None,
    ) -> None:
        if geometry.annulus and extra_terms is not None:
            raise ParameterError("extra_terms", 'further terms and species are for the slab; leave them out, or write kind = "slab".')
        super().__init__(parameters, initial, geometry, cells, rtol)
        self._build(import_fipy(), extra_terms)
        self.layout = Layout(cells, len(self.extension.species))
        self._scatter = scatter(cells)
        self._species_scales = self.extension.scales(initial.L)
        self._faces = np.zeros((4, cells + 1))
        self._slip_row = np.ones(cells - 1)

    def initial(self) -> Array:
        """Initial vector, its algebraic part consistent."""
        return np.concatenate([super().initial(), self.extension.initial(self.initial_values.L), [0.0, 0.0]])

    # -- FiPy -------------------------------------------------------------------------------------------------------

    def _build(self, fipy: Any, extra_terms: ExtraTerms | None) -> None:
        """Meshes, variables and equations."""
        N, h = self.grid.cells, self.grid.spacing
        self._mesh = fipy.Grid1D(nx=N, dx=h)
        self._face_mesh = fipy.Grid1D(nx=N - 1, dx=h) + np.array([[0.5 * h]])
        self._n = fipy.CellVariable(mesh=self._mesh, name="n", hasOld=True)
        self._l = fipy.CellVariable(mesh=self._mesh, name="l", hasOld=True)
        self._W = fipy.CellVariable(mesh=self._mesh, name="W", hasOld=True, value=1.0)
        self._w = fipy.CellVariable(mesh=self._face_mesh, name="w")
        self._transport = NecroticTransport(fipy, self._mesh, self._n, self._W)
        self._uptake = fipy.CellVariable(mesh=self._mesh, value=0.0)  # k_m W l
        self._n_equation = self._transport.terms - self._uptake + fipy.ImplicitSourceTerm(coeff=self._uptake, var=self._n)
        self._ldl_velocity = fipy.FaceVariable(mesh=self._mesh, rank=1, value=0.0)
        self._ldl_conductance = fipy.FaceVariable(mesh=self._mesh, value=0.0)
        self._influx = fipy.CellVariable(mesh=self._mesh, value=0.0)
        self._consumption = fipy.CellVariable(mesh=self._mesh, value=0.0)  # k_l W c
        self._l_equation = (
            fipy.TransientTerm(coeff=self._W, var=self._l)
            + fipy.CentralDifferenceConvectionTerm(coeff=self._ldl_velocity, var=self._l)
            - fipy.DiffusionTerm(coeff=self._ldl_conductance, var=self._l)
            - self._influx
            + fipy.ImplicitSourceTerm(coeff=self._consumption, var=self._l)
        )
        self._slip_conductance = fipy.FaceVariable(mesh=self._face_mesh, value=0.0)
        self._slip_drag = fipy.CellVariable(mesh=self._face_mesh, value=0.0)
        self._slip_load = fipy.CellVariable(mesh=self._face_mesh, value=0.0)
        self._w_equation = (
            fipy.ImplicitSourceTerm(coeff=self._slip_drag, var=self._w)
            - fipy.DiffusionTerm(coeff=self._slip_conductance, var=self._w)
            - self._slip_load
        )
        self.extension = Extension(fipy, self._mesh, self._n, self._l, self._W, self.grid)
        self.extension.attach(extra_terms)

    def _load(self, t: float, past: Array, x: Array) -> None:
        """Put an iterate and its coefficients into the FiPy variables; its rates and their tangent are left in the work space."""
        p, lay, h, N = self.parameters, self.layout, self.grid.spacing, self.grid.cells
        y, work, data = self._vector(x), self.work, self.data_until(t)
        self.kernel["face_values"](data, y, self._faces, work.model)
        self.kernel["rates"](data, t, y, work.f_0, work.model)
        self.kernel["tangent"](data, t, y, work.f_0, work.jac, work.columns, work.rows, work.corner, work.q_rows, work.q_corner, work.model,
                   work.scratch)  # fmt: skip
        flux, velocity, ldl_velocity, conductance = self._faces
        self._load_fields(t, past, x)
        self._w.setValue(x[lay.w])
        self._transport.set_flux(velocity, flux)
        self._uptake.setValue(p.k_m * x[lay.W] * x[lay.l])
        self._consumption.setValue(p.k_l * x[lay.W] * (1.0 - x[lay.n]))
        self._ldl_velocity.setValue(ldl_velocity[None, :])
        self._ldl_conductance.setValue(conductance * h)
        inner = np.zeros(N)
        inner[0] = self.geometry.inner_radius * p.Psi_l(t, side=-1) / h
        self._influx.setValue(inner)
        self._set_slip(x[lay.n], x[lay.w])

    def _load_fields(self, t: float, past: Array, x: Array) -> None:
        """Put W, n, l and the species of an iterate, and their weighted past, into the FiPy variables."""
        lay, W, W_past = self.layout, float(x[self.layout.W]), float(past[self.size])
        for variable, value, old in (
            (self._W, W, W_past),
            (self._n, x[lay.n], past[self.n] / W_past),
            (self._l, x[lay.l], past[self.l] / W_past),
        ):
            variable.setValue(old)
            variable.updateOld()
            variable.setValue(value)
        self.extension.load(t, W, float(x[lay.V]), x, past[self._species] / W_past, lay)

    def _set_slip(self, n: Array, w: Array) -> None:
        """The slip rows, a tridiagonal system, as diffusion plus an implicit source; the walls are in the load.

        FiPy's diffusion is symmetric, so the rows of the drag form are multiplied by the mean viscosity, which makes them so.
        """
        p, jac, m, N, h = self.parameters, self.work.jac, self.stride, self.grid.cells, self.grid.spacing
        rows, half = slice(2, self.size - m, m), 2 * m
        lower, diagonal, upper = (jac[rows, half + shift].copy() for shift in (-m, 0, m))
        lower[0] = upper[-1] = 0.0
        if p.momentum == "drag" and (p.nu_n > 0.0 or p.nu_m > 0.0):
            fraction = 0.5 * (n[:-1] + n[1:])
            floored_n, floored_c = (floored(part, self._constants.floor) for part in (fraction, 1.0 - fraction))
            self._slip_row = p.nu_m * floored_n + p.nu_n * floored_c
        lower, diagonal, upper = lower * self._slip_row, diagonal * self._slip_row, upper * self._slip_row
        load = lower * np.append(0.0, w[:-1]) + diagonal * w + upper * np.append(w[1:], 0.0) - self._slip_row * self.work.f_0[rows]
        between = np.zeros(N)
        between[1:-1] = -h * upper[:-1]
        self._slip_conductance.setValue(between)
        self._slip_drag.setValue((lower + diagonal + upper) / h)
        self._slip_load.setValue(load / h)

    def residual(self, t: float, alpha: float, past: Array, x: Array) -> Array:
        """Residual of the implicit step at the iterate `x` (Newton layout: n, l, w, W, V, species), from FiPy's terms.

        `past` holds the weighted past in the loop's layout (products W n, W l).
        """
        lay, p, h, size = self.layout, self.parameters, self.grid.spacing, self.size
        self._load(t, past, x)
        out = np.empty(lay.unknowns)
        dt = 1.0 / alpha
        out[lay.n] = self._n_equation.justResidualVector(dt=dt)
        out[lay.l] = self._l_equation.justResidualVector(dt=dt)
        out[lay.w] = self._w_equation.justResidualVector(dt=dt) / self._slip_row
        W = float(x[lay.W])
        uptake = h * W * float(np.sum(eq.uptake(x[lay.l], x[lay.n])))
        entering = self.geometry.inner_radius * p.Psi_l(t, side=-1)
        largest = float(np.max(self._faces[3])) + alpha * W
        for part, old, gain in ((lay.n, past[self.n], p.k_m * uptake), (lay.l, past[self.l], entering - p.k_l * uptake)):
            total = h * alpha * float(np.sum(W * x[part] - old)) - gain
            out[part] = without_rounding(out[part], total, largest * float(np.max(np.abs(x[part]))))
        out[lay.W] = alpha * (W - past[size]) - self.work.f_0[size]
        out[lay.V] = self.work.f_0[size + 1]
        self.extension.add_residuals(out, dt, lay)
        return out

    # -- Newton -----------------------------------------------------------------------------------------------------

    def tangent(self, t: float, alpha: float, past: Array, x: Array, *, fresh: bool = True) -> csc_matrix:
        """Tangent of `residual` at the iterate it was last called with; that of added terms by finite differences, and from the last
        call unless `fresh`."""
        lay, h = self.layout, self.grid.spacing
        balance, scale = np.zeros(lay.base), np.ones(lay.base)
        balance[: lay.w.start], scale[: lay.w.start] = h * alpha, -h  # rows of the balances: h (alpha y - rates)
        balance[lay.W], scale[lay.W] = alpha, -1.0
        matrix = self._scatter.matrix(self.work, balance, scale, x)
        if fresh and self.extension.implicit:
            self.extension.differentiate(lambda y: self._load_fields(t, past, y), 1.0 / alpha, x, lay)
        if lay.species:
            matrix.resize((lay.unknowns, lay.unknowns))
        return matrix + self.extension.tangent if self.extension.implicit else matrix

    @property
    def integrals(self) -> Places:
        """Where the integrals over time stand, those of what is added to n and l at the end."""
        return np.append(super().integrals, [-2, -1])

    @property
    def _species(self) -> slice:
        """Where the products of the species stand."""
        return slice(self.base, self.base + self.grid.cells * self.layout.species)

    def fractions(self, u: Array) -> Array:
        """Newton vector of the loop's vector."""
        lay, W = self.layout, float(u[self.size])
        x = np.empty(lay.unknowns)
        x[lay.n], x[lay.l], x[lay.w] = u[self.n] / W, u[self.l] / W, u[self.w]
        x[lay.W], x[lay.V] = W, u[self.size + 1]
        x[lay.base :] = u[self._species] / W
        return x

    def _vector(self, x: Array) -> Array:
        """The part of the loop's vector that the discretisation knows, of a Newton vector."""
        lay = self.layout
        y = np.zeros(self.base)
        y[self.n], y[self.l], y[self.w] = x[lay.W] * x[lay.n], x[lay.W] * x[lay.l], x[lay.w]
        y[self.size], y[self.size + 1] = x[lay.W], x[lay.V]
        return y

    def linearised(self, t: float, x: Array, change: Array) -> tuple[Array, Array]:
        """Change of the loop's vector without its integrals, and their integrands: uptake, influx, V, and what is added to n and l."""
        lay, W, dW = self.layout, float(x[self.layout.W]), float(change[self.layout.W])
        step = np.zeros(self.base + self.grid.cells * lay.species + 2)
        step[self.n], step[self.l] = W * change[lay.n] + x[lay.n] * dW, W * change[lay.l] + x[lay.l] * dW
        step[self.w], step[self.size], step[self.size + 1] = change[lay.w], dW, change[lay.V]
        step[self._species] = W * change[lay.base :] + x[lay.base :] * dW
        return step, self._sources(t, x, change)

    def _sources(self, t: float, x: Array, change: Array) -> Array:
        """Integrands of this step, linearised as the step was: uptake, influx, V, and what is added to n and l."""
        p, h, lay = self.parameters, self.grid.spacing, self.layout
        n, l, W = x[lay.n], x[lay.l], float(x[lay.W])
        rate_l, rate_n = eq.uptake_slopes(l, n)
        rate = eq.uptake(l, n)
        uptake = h * float(np.sum((W + change[lay.W]) * rate + W * (rate_l * change[lay.l] + rate_n * change[lay.n])))
        influx = self.geometry.inner_radius * p.Psi_l(t, side=-1)
        return np.array([uptake, influx, x[lay.V] + change[lay.V], *self.extension.totals(change, lay)])

    # -- the loop's protocol ----------------------------------------------------------------------------------------

    def error_norm(self, error: Array, u: Array) -> float:
        """That of `SemiDiscrete`, and the root mean square error of each species over its scale."""
        sizes = [super().error_norm(error[: self.base], u[: self.base])]
        W, error_W = float(u[self.size]), float(error[self.size])
        for i, scale in enumerate(self._species_scales):
            part = slice(self.base + i * self.grid.cells, self.base + (i + 1) * self.grid.cells)
            value = u[part] / W
            change = (error[part] - value * error_W) / W
            scale = max(float(np.max(np.abs(value))), 1e-3 * float(scale))
            sizes.append(float(np.sqrt(np.mean(change**2))) / scale / self.rtol)
        return max(sizes)

    def consistent(self, t: float, u: Array) -> Array:
        """`u` with V from the wall balance and w from the slip equation just after time `t`."""
        return np.concatenate([super().consistent(t, u[: self.base]), u[self.base :]])

    def observe(self, t: float, u: Array) -> Snapshot:
        """Fields at cell centres, species among them, and scalars of the contract."""
        species = {name: u[self._species][i * self.grid.cells : (i + 1) * self.grid.cells] / u[self.size]
                   for i, name in enumerate(self.extension.species)}  # fmt: skip
        return self.snapshot(t, u[: self.base], species, (float(u[-2]), float(u[-1])))
