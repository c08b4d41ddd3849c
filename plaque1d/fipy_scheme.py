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
from scipy.sparse.linalg import splu

from multiphase.geometry import MovingGrid
from multiphase.stepping import Snapshot, Solved, StepFailure
from plaque1d import discretisation as fv
from plaque1d import equations as eq
from plaque1d.extensions import Extension, ExtraTerms
from plaque1d.fipy_terms import NecroticTransport, cell_averages, closed, import_fipy, without_rounding
from plaque1d.parameters import PlaqueInitial, PlaqueParameters
from plaque1d.tangent import Layout, tangent

Array = NDArray[np.float64]

NEWTON_ITERATIONS = 12
NEWTON_TOLERANCE = 3e-3
"""Size of the error left by the iteration, as a fraction of the tolerated local error."""


class FipyScheme:
    """One implicit step of the plaque, assembled by FiPy. See the module's description.

    Parameters
    ----------
    parameters, initial : PlaqueParameters, PlaqueInitial
    cells : int
        N, equal in xi.
    rtol : float
        The accuracy knob: local errors of n are kept below rtol, of l below rtol max(l), of L below rtol L.
    extra_terms : callable, optional
        Called once with an `Extension`; returns FiPy terms to add to the right-hand sides (see `plaque1d.extensions`).

    Raises
    ------
    ParameterError
        From `extra_terms` that name an unknown equation.
    """

    def __init__(
        self, parameters: PlaqueParameters, initial: PlaqueInitial, cells: int, rtol: float, extra_terms: ExtraTerms | None = None
    ) -> None:
        self.parameters, self.initial_values, self.rtol = parameters, initial, rtol
        self.grid = MovingGrid(cells)
        self.breaks: tuple[float, ...] = parameters.Psi_l.jumps
        self.kinks: tuple[float, ...] = parameters.Psi_l.breaks
        self._build(import_fipy(), extra_terms)
        self.layout = Layout(cells, len(self.extension.species))
        self._species_scales = self.extension.scales(initial.L)
        u = self.initial()
        self._start = self._totals(u)

    # -- FiPy -------------------------------------------------------------------------------------------------------

    def _build(self, fipy: Any, extra_terms: ExtraTerms | None) -> None:
        """Meshes, variables and equations."""
        N, h = self.grid.cells, self.grid.spacing
        self._mesh = fipy.Grid1D(nx=N, dx=h)
        self._face_mesh = fipy.Grid1D(nx=N - 1, dx=h) + np.array([[0.5 * h]])
        self._n = fipy.CellVariable(mesh=self._mesh, name="n", hasOld=True)
        self._l = fipy.CellVariable(mesh=self._mesh, name="l", hasOld=True)
        self._L = fipy.CellVariable(mesh=self._mesh, name="L", hasOld=True, value=1.0)
        self._w = fipy.CellVariable(mesh=self._face_mesh, name="w")
        self._transport = NecroticTransport(fipy, self._mesh, self._n, self._L)
        self._uptake = fipy.CellVariable(mesh=self._mesh, value=0.0)  # k_m L l
        self._n_equation = self._transport.terms - self._uptake + fipy.ImplicitSourceTerm(coeff=self._uptake, var=self._n)
        self._ldl_velocity = fipy.FaceVariable(mesh=self._mesh, rank=1, value=0.0)
        self._ldl_conductance = fipy.FaceVariable(mesh=self._mesh, value=0.0)
        self._influx = fipy.CellVariable(mesh=self._mesh, value=0.0)
        self._consumption = fipy.CellVariable(mesh=self._mesh, value=0.0)  # k_l L c
        self._l_equation = (
            fipy.TransientTerm(coeff=self._L, var=self._l)
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
        self.extension = Extension(fipy, self._mesh, self._n, self._l, self._L, self.grid)
        self.extension.attach(extra_terms)

    def _load(self, t: float, alpha: float, past: Array, x: Array) -> tuple[fv.NecroticFlux, fv.LdlFlux, fv.Slip]:
        """Put an iterate and its coefficients into the FiPy variables."""
        p, lay, h = self.parameters, self.layout, self.grid.spacing
        n, l, w, L, V = x[lay.n], x[lay.l], x[lay.w], float(x[lay.L]), float(x[lay.V])
        xi = self.grid.faces[1:-1]
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            F = fv.necrotic_flux(n, w, V, xi, fv.wall_fraction(p), p.nu_n, p.nu_m)
            G = fv.ldl_flux(l, L, V, xi, h)
            s = fv.slip(n, l, V, p)
        self._load_fields(t, past, x)
        self._w.setValue(w)
        self._transport.set_flux(closed(F.velocity), closed(F.value))
        self._uptake.setValue(p.k_m * L * l)
        self._consumption.setValue(p.k_l * L * (1.0 - n))
        self._ldl_velocity.setValue(closed(G.velocity)[None, :])
        self._ldl_conductance.setValue(closed(G.conductance * h))
        inner = np.zeros(lay.cells)
        inner[0] = p.Psi_l(t, side=-1) / h
        self._influx.setValue(inner)
        self._set_slip(s, L)
        return F, G, s

    def _load_fields(self, t: float, past: Array, x: Array) -> None:
        """Put L, n, l and the species of an iterate, and their weighted past, into the FiPy variables."""
        lay, L, L_past = self.layout, float(x[self.layout.L]), float(past[self.layout.L])
        for variable, value, old in (
            (self._L, L, L_past),
            (self._n, x[lay.n], past[lay.n] / L_past),
            (self._l, x[lay.l], past[lay.l] / L_past),
        ):
            variable.setValue(old)
            variable.updateOld()
            variable.setValue(value)
        self.extension.load(t, L, float(x[lay.V]), x, past, lay)

    def _set_slip(self, s: fv.Slip, L: float) -> None:
        """The symmetric slip operator as diffusion plus an implicit source; both walls are a whole cell away, so their
        conductances are put in by hand."""
        N, h = self.grid.cells, self.grid.spacing
        between = np.zeros(N)
        drag = L * L * s.zeta
        load = L * s.row * np.diff(s.phi) / h
        for term in s.terms:
            r = np.append(term.r, 0.0)
            between[1:-1] += r[1 : N - 1] * r[2:N] * term.kappa[1:-1]
            inner = r[1:N]
            drag += inner * (term.kappa[1:] * inner + term.kappa[:-1] * inner) / h**2
            drag[:-1] -= inner[:-1] * term.kappa[1:-1] * r[2:N] / h**2
            drag[1:] -= inner[1:] * term.kappa[1:-1] * r[1 : N - 1] / h**2
            load[0] += inner[0] * term.kappa[0] * r[0] * s.w_wall / h**2
        self._slip_conductance.setValue(between)
        self._slip_drag.setValue(drag)
        self._slip_load.setValue(load)

    def residual(self, t: float, alpha: float, past: Array, x: Array) -> tuple[Array, tuple[Any, ...]]:
        """Residual of the implicit step at the iterate `x` (Newton layout: n, l, w, L, V, species), from FiPy's terms.

        `past` holds the weighted past in the loop's layout (products L n, L l). Returns the residual and the
        fluxes and slip coefficients, which the tangent needs.
        """
        lay, p = self.layout, self.parameters
        parts = self._load(t, alpha, past, x)
        out = np.empty(lay.unknowns)
        dt = 1.0 / alpha
        out[lay.n] = self._n_equation.justResidualVector(dt=dt)
        out[lay.l] = self._l_equation.justResidualVector(dt=dt)
        out[lay.w] = self._w_equation.justResidualVector(dt=dt)
        L, V = float(x[lay.L]), float(x[lay.V])
        h = self.grid.spacing
        uptake = h * L * float(np.sum(eq.uptake(x[lay.l], x[lay.n])))
        largest = float(np.max(parts[1].conductance)) + alpha * L
        for part, gain in ((lay.n, p.k_m * uptake), (lay.l, p.Psi_l(t, side=-1) - p.k_l * uptake)):
            total = h * alpha * float(np.sum(L * x[part] - past[part])) - gain
            out[part] = without_rounding(out[part], total, largest * float(np.max(np.abs(x[part]))))
        out[lay.L] = alpha * (L - past[lay.L]) - V
        l_wall = eq.wall_concentration(float(x[lay.l][0]), 0.5 * self.grid.spacing * L, p.Psi_l(t, side=-1), p.Psi_m)
        out[lay.V] = V - eq.growth_rate(l_wall, p.Psi_m)
        self.extension.add_residuals(out, dt, lay)
        return out, parts

    # -- Newton -----------------------------------------------------------------------------------------------------

    def tangent(self, t: float, alpha: float, past: Array, x: Array, parts: tuple[Any, ...], *, fresh: bool = True) -> csc_matrix:
        """Exact tangent of `residual`; added terms by finite differences, those of the last call unless `fresh`."""
        lay = self.layout
        F, G, s = parts
        entries = tangent(
            self.parameters, lay, alpha, self.parameters.Psi_l(t, side=-1),
            x[lay.n], x[lay.l], x[lay.w], float(x[lay.L]), float(x[lay.V]), F, G, s,
        )  # fmt: skip
        if fresh and self.extension.implicit:
            self.extension.differentiate(lambda y: self._load_fields(t, past, y), 1.0 / alpha, x, lay)
        return entries.matrix(lay.unknowns) + self.extension.tangent if self.extension.implicit else entries.matrix(lay.unknowns)

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Newton's method from the predicted vector; see `multiphase.stepping.Scheme`."""
        lay = self.layout
        x, products = self._iterate(guess)
        last = 0.0
        for iteration in range(1, NEWTON_ITERATIONS + 1):
            r, parts = self.residual(t, alpha, past, x)
            matrix = self.tangent(t, alpha, past, x, parts, fresh=iteration == 1)
            try:
                change = splu(matrix).solve(-r)
            except RuntimeError as error:
                raise StepFailure(f"the tangent of the step is singular ({error})") from error
            if not np.all(np.isfinite(change)):
                raise StepFailure("Newton's method gave values that are not finite")
            L = float(x[lay.L])
            sources = self._sources(t, x, change, lay)
            for part in (lay.n, lay.l, *(lay.extra(i) for i in range(lay.species))):
                products[part] += L * change[part] + x[part] * change[lay.L]
            products[lay.w] += change[lay.w]
            products[[lay.L, lay.V]] += change[[lay.L, lay.V]]
            if products[lay.L] <= 0.0:
                raise StepFailure(f"Newton's method gave a width L = {products[lay.L]:.3g}")
            size = self.error_norm(self._as_error(products, x), products)
            x = self._from_products(products)
            rate = size / last if last > 0.0 else 1.0
            if size * min(1.0, rate) <= NEWTON_TOLERANCE:
                products[lay.integrals] = past[lay.integrals] + sources / alpha
                self._bounds(x)
                products[lay.n] = fv.bounded(products[lay.n], float(products[lay.L]))
                return Solved(products, iteration)
            if iteration > 2 and rate > 2.0:
                raise StepFailure(f"Newton's method diverges: update {size:.3g} after {last:.3g} (in units of the tolerance)")
            last = size
        raise StepFailure(f"Newton's method did not converge in {NEWTON_ITERATIONS} iterations: last update {size:.3g} of the tolerance")

    def _iterate(self, u: Array) -> tuple[Array, Array]:
        """Newton vector (fractions) and a copy of the loop's vector (products)."""
        products = u.copy()
        if products[self.layout.L] <= 0.0:
            raise StepFailure(f"the predicted width is L = {products[self.layout.L]:.3g}")
        return self._from_products(products), products

    def _from_products(self, products: Array) -> Array:
        lay = self.layout
        x = products[: lay.unknowns].copy()
        for part in (lay.n, lay.l, *(lay.extra(i) for i in range(lay.species))):
            x[part] /= products[lay.L]
        return x

    def _as_error(self, products: Array, x: Array) -> Array:
        """Last update in the loop's layout."""
        lay = self.layout
        error = np.zeros_like(products)
        L = float(x[lay.L])
        error[: lay.unknowns] = products[: lay.unknowns] - x
        for part in (lay.n, lay.l, *(lay.extra(i) for i in range(lay.species))):
            error[part] = products[part] - L * x[part]
        return error

    def _sources(self, t: float, x: Array, change: Array, lay: Layout) -> Array:
        """Integrals over the body of this step's own sources, linearised as the step was: of n, of l (as loss), the
        influx of modLDL, and V."""
        p, h = self.parameters, self.grid.spacing
        n, l, L = x[lay.n], x[lay.l], float(x[lay.L])
        rate_l, rate_n = eq.uptake_slopes(l, n)
        rate = eq.uptake(l, n)
        total = h * float(np.sum((L + change[lay.L]) * rate + L * (rate_l * change[lay.l] + rate_n * change[lay.n])))
        extra_n, extra_l = self.extension.totals(change, lay)
        return np.array([p.k_m * total + extra_n, p.k_l * total - extra_l, p.Psi_l(t, side=-1), x[lay.V] + change[lay.V]])

    def _bounds(self, x: Array) -> None:
        """Refuse a step after which the inviscid drag form is ill-posed, fractions leave [0, 1] by more than rtol, or modLDL falls below
        zero likewise."""
        lay, p = self.layout, self.parameters
        n, l = x[lay.n], x[lay.l]
        cause = ""
        if p.momentum == "drag":
            lowest = float(np.min(eq.drag_diffusivity(n, eq.extra_stress(l, p.A, p.B, p.k), p.p_out)))
            if lowest < 0.0:
                cause = (
                    f"momentum = drag is ill-posed where p_out - (1 - 2n) Sigma is negative, and it is {lowest:.3g} here; "
                    f"raise p_out to A = {p.A:g}, or use momentum = interfacial"
                )
        if cause and p.nu_n == 0.0 and p.nu_m == 0.0:
            raise StepFailure(cause)
        for name, low, high in (("n", n.min(), n.max()), ("l", l.min() / self._ldl_scale(l), 0.0)):
            if low < -self.rtol or high > 1.0 + self.rtol:
                bad = low if low < -self.rtol else high
                raise StepFailure(
                    f"{name} = {bad:.6g} leaves its range by more than rtol = {self.rtol:g}" + (f" ({cause})" if cause else "")
                )

    # -- the loop's protocol ----------------------------------------------------------------------------------------

    def initial(self) -> Array:
        """Initial vector from the initial fractions, with a consistent slip and growth rate."""
        lay, start = self.layout, self.initial_values
        u = np.zeros(lay.size)
        n, l = (cell_averages(f, self.grid, start.L) for f in (start.n, start.l))
        u[lay.n], u[lay.l], u[lay.L] = start.L * n, start.L * l, start.L
        self.extension.initial(u, lay, start.L)
        return self.consistent(0.0, u)

    def consistent(self, t: float, u: Array) -> Array:
        """`u` with V from the wall balance and w from the slip equation just after time `t`."""
        lay, p, h = self.layout, self.parameters, self.grid.spacing
        u = u.copy()
        L = float(u[lay.L])
        l_wall = eq.wall_concentration(float(u[lay.l][0]) / L, 0.5 * h * L, p.Psi_l(t, side=1), p.Psi_m)
        u[lay.V] = eq.growth_rate(l_wall, p.Psi_m)
        u[lay.w] = 0.0
        x = self._from_products(u)
        r, parts = self.residual(t, 1.0, u, x)
        matrix = tangent(
            p, lay, 1.0, p.Psi_l(t, side=1), x[lay.n], x[lay.l], x[lay.w], L, float(x[lay.V]), *parts
        ).matrix(lay.unknowns)[lay.w, lay.w]  # fmt: skip
        u[lay.w] = splu(csc_matrix(matrix)).solve(-r[lay.w])
        return u

    def _ldl_scale(self, l: Array) -> float:
        """Size of l that its absolute tolerance is relative to: its maximum, or what one cell's influx can hold at first."""
        return max(float(np.max(np.abs(l))), 1e-3 * self._ldl_reference)

    @property
    def _ldl_reference(self) -> float:
        p = self.parameters
        strongest = max(p.Psi_l.values)
        return float(np.sqrt(strongest / p.Psi_m)) if p.Psi_m > 0.0 and strongest > 0.0 else 1.0

    def error_norm(self, error: Array, u: Array) -> float:
        """The largest of: root mean square error of n, of l over its scale, of each species over its scale, and the relative
        error of L; in units of rtol."""
        lay = self.layout
        L, error_L = float(u[lay.L]), float(error[lay.L])
        sizes = [abs(error_L) / L]
        for i, part in enumerate((lay.n, lay.l, *(lay.extra(j) for j in range(lay.species)))):
            value = u[part] / L
            change = (error[part] - value * error_L) / L
            if i == 0:
                scale = 1.0
            elif i == 1:
                scale = self._ldl_scale(value)
            else:
                scale = max(float(np.max(np.abs(value))), 1e-3 * float(self._species_scales[i - 2]))
            sizes.append(float(np.sqrt(np.mean(change**2))) / scale)
        return max(sizes) / self.rtol

    def _totals(self, u: Array) -> Array:
        """Integrals over the body of n, c, l, and the width."""
        lay, h = self.layout, self.grid.spacing
        n_total, l_total = h * float(np.sum(u[lay.n])), h * float(np.sum(u[lay.l]))
        return np.array([n_total, float(u[lay.L]) - n_total, l_total, float(u[lay.L])])

    def observe(self, t: float, u: Array) -> Snapshot:
        """Fields at cell centres and scalars of the contract; defects are relative to the larger of the total and what came in."""
        lay, p, grid = self.layout, self.parameters, self.grid
        x = self._from_products(u)
        n, l, w, L, V = x[lay.n], x[lay.l], x[lay.w], float(x[lay.L]), float(x[lay.V])
        h = grid.spacing
        given = fv.wall_fraction(p)
        n_inner = float(n[0] - (n[1] - n[0]) / 6.0) if given is None else given
        face_n = np.concatenate([[n_inner], 0.5 * (n[:-1] + n[1:]), [n[-1] + 0.5 * (n[-1] - n[-2])]])
        w_all = np.concatenate([[V / max(1.0 - n_inner, fv.FLOOR)], w, [0.0]])
        u_n, u_m = eq.necrotic_velocity(V, face_n, w_all), eq.macrophage_velocity(V, face_n, w_all)
        u_n[0] = 0.0
        stress = eq.extra_stress(l, p.A, p.B, p.k)
        p_n = eq.pressure(p.p_out, n, stress, np.diff(u_n) / (h * L), np.diff(u_m) / (h * L), p.nu_n, p.nu_m)
        fields = {"n": n, "c": 1.0 - n, "l": l, "u_n": grid.to_centres(u_n), "u_m": grid.to_centres(u_m), "p_n": p_n}
        fields |= {name: x[lay.extra(i)] for i, name in enumerate(self.extension.species)}
        scalars = {"L": L, "L_rate": V, "l_wall": self._wall_value(t, l, L), "n_wall": n_inner} | self._balances(u)
        return Snapshot(t, scalars, fields, grid.centres * L)

    def _wall_value(self, t: float, l: Array, L: float) -> float:
        p = self.parameters
        return eq.wall_concentration(float(l[0]), 0.5 * self.grid.spacing * L, p.Psi_l(t, side=-1 if t > 0.0 else 1), p.Psi_m)

    def _balances(self, u: Array) -> dict[str, float]:
        totals, gains = self._totals(u), u[self.layout.integrals]
        n_gain, l_loss, influx, growth = (float(g) for g in gains)
        change = totals - self._start
        defects = change - np.array([n_gain, growth - n_gain, influx - l_loss, growth])
        scales = np.maximum(np.abs(totals), np.abs([n_gain, growth + n_gain, influx + l_loss, growth]))
        relative = np.divide(defects, scales, out=np.zeros(4), where=scales > 0.0)
        values = {"n_total": totals[0], "c_total": totals[1], "l_total": totals[2]}
        values |= {f"defect_{name}": relative[i] for i, name in enumerate(("n", "c", "l", "L"))}
        return {name: float(value) for name, value in values.items()}
