"""The elastic tumour in two dimensions as a scheme for the time loop: one implicit step with MINI elements.

The vector of a state is

    [ d_x, d_y, alpha, p, C of each point | bubbles | moments of alpha J | moments of J | cells born, volume gained | rate of the volume ]

The moments ``m_i = (alpha J, phi_i)`` and ``j_i = (J, phi_i)`` advance by the loop's formula and what the equations say, so no cell and
no volume is lost whatever the step and its formula. Those of the stored fields differ from them by what Newton's method leaves, which
does not add up from step to step, as the next one starts from the moments. The integrals of the sources advance likewise and close
the balances. See `tumour.fem.kernel` for the equations.

Newton's method keeps its tangent from step to step. The tangent is a function of the point and the step it was made at, which
therefore belong to the state (`multiphase.stepping.State.memory`): a run that goes on from a stored state makes the same tangent again,
and so the same iterations, bit for bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import SolverError
from multiphase.mesh import Mesh
from multiphase.sparse import open_solver
from multiphase.stepping import Snapshot, Solved, StepFailure
from tumour import equations as eq
from tumour.boundary import TumourBoundary
from tumour.fem import layout
from tumour.fem.arrays import FIELDS
from tumour.fem.bodies import fraction
from tumour.fem.mirror import Mirror
from tumour.fem.newton import Newton, Point, Step
from tumour.fem.observation import Observation
from tumour.fem.surface import Surface
from tumour.fem.tissue import data_of
from tumour.meshes import Body
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver

Array = NDArray[np.float64]

X, Y, ALPHA, P, OXYGEN = range(FIELDS)


RATE_STEP = 10.0
"""Step over which the rate of the volume at t = 0 is taken where the fluid flows freely, in roots of Newton's tolerance: what the iteration
leaves, over the step, and the change of the rate within it are then alike."""


LEAST_RAMP = 1.0 / 64.0
"""Least share of what acts on a surface at once that is added where no equilibrium is found with all of it."""


class MiniScheme:
    """One implicit step of the tumour on a mesh; see `multiphase.stepping.Scheme`.

    Parameters
    ----------
    parameters, initial, solver : TumourParameters, TumourInitial, TumourSolver
    body : tumour.meshes.Body
    boundary : TumourBoundary, optional
        What acts on named parts of the surface; all of it is free without.
    mirror : Mirror, optional
        The part of the body that is solved, of which the rest is images; all of the body without.

    Attributes
    ----------
    side : int
        Which data hold at a time at which they jump: those before (-1) or after it (1).
    points : (points, 2) array
        Of the part of the body that is solved; `mesh` is all of it.
    acting : (edges, ACTIONS) array
        What acted on the edges of the surface in the last step.
    """

    guess_points = 4
    """Points that the first guess of a step is extrapolated from."""

    def __init__(
        self, parameters: TumourParameters, initial: TumourInitial, body: Body, solver: TumourSolver,
        boundary: TumourBoundary | None = None, mirror: Mirror | None = None,
    ) -> None:  # fmt: skip
        p = parameters
        whole, self.mirror = body, mirror
        if mirror is not None:
            body, boundary = mirror.body, mirror.boundary
        self.parameters, self.initial_values, self.body, self.solver, self.rtol = p, initial, body, solver, solver.rtol
        self.printed = solver.alpha_step == "as-printed"
        self.points = points = np.ascontiguousarray(body.mesh.p.T)
        self.elements = layout.elements_of(body.mesh)
        self.mesh = Mesh(np.ascontiguousarray(whole.mesh.p.T), np.ascontiguousarray(whole.mesh.t.T, dtype=np.int64))
        self.count, self.triangles = len(points), len(self.elements.areas)
        self.constants = data_of(p, self.elements, points, body.radius, printed=self.printed)
        self.surface = Surface(body, boundary or TumourBoundary(), p)
        self.breaks, self.kinks, self.side = self.surface.jumps, self.surface.breaks, -1
        self._from: tuple[tuple[Array, Array], float] | None = None
        self.acting = self.surface.actions(0.0, 1)
        self.kernel = self._kernel()
        self.prescribed = self._prescribed()
        rigid = layout.RigidMotions(self.elements, points, *self._free_motions())
        held = self.prescribed.copy()
        held[:, :2] |= rigid.held
        rows = layout.rows_of(self.elements, held)
        self.newton = Newton(
            self.kernel, self.constants, self.elements, self.surface.edges, points, rows, rigid,
            open_solver(solver.linear, rows.indptr, rows.indices),
            tolerance=solver.newton_tolerance, length=body.radius, oxygen=p.C_out or 1.0,
        )  # fmt: skip
        self._parts = np.cumsum([FIELDS * self.count, 2 * self.triangles, 2 * self.count, 2, 1])
        self.observation = Observation(self)
        self._initial: Array | None = None

    def _kernel(self) -> Any:
        """The functions that sum over the elements: compiled, or those of the specification."""
        if self.solver.assembly == "forms":
            from tumour.fem.readable import Readable

            return Readable(self.body.mesh, self.parameters, self.constants, self.surface.edges)
        from tumour.fem.kernel import KERNEL

        KERNEL.announce()
        return KERNEL

    # -- Data that a study may replace ----------------------------------------------------------------------------------

    def _prescribed(self) -> NDArray[np.bool_]:
        """The prescribed unknowns of each point."""
        return self.surface.prescribed

    def _free_motions(self) -> tuple[NDArray[np.bool_], bool]:
        """Whether the body is free to shift in x and y, and to turn."""
        shifts, turns = self.surface.free_motions
        shifts = shifts & ~self.prescribed[:, :2].any(axis=0)
        return shifts, bool(turns and shifts.all())

    def boundary(self, t: float) -> Array:
        """Values of the prescribed unknowns at `t`, (points, 5)."""
        values = self.surface.values(t, self.side)
        if self._from is not None:
            (before, _), share = self._from
            values = before + share * (values - before)
        return values

    def _acting(self, t: float) -> Array:
        """What acts on the edges of the surface at `t`."""
        actions = self.surface.actions(t, self.side)
        if self._from is not None:
            (_, before), share = self._from
            actions = before + share * (actions - before)
        return actions

    def loads(self, t: float, tau: float) -> tuple[Array, Array]:
        """What a study adds to the right-hand sides, (points, 5) and (elements, 2); nothing here."""
        return np.zeros((self.count, FIELDS)), np.zeros((self.triangles, 2))

    # -- The vector -----------------------------------------------------------------------------------------------------

    def point(self, u: Array) -> Point:
        """The unknowns of the vector `u`, not copied."""
        a, b = self._parts[:2]
        return Point(u[:a].reshape(self.count, FIELDS), u[a:b].reshape(self.triangles, 2))

    def rest(self, u: Array) -> tuple[Array, Array, Array]:
        """Moments (2, points), integrals (2,) and the rate of the volume (1,) of the vector `u`, not copied."""
        b, c, d, e = self._parts[1:]
        return u[b:c].reshape(2, self.count), u[c:d], u[d:e]

    def prepare(self) -> None:
        """Compile, or load, what a run needs; what this costs is not counted."""
        self.observe(0.0, self.initial())
        for account in (self.newton, self.newton.linear):
            account.seconds.update(dict.fromkeys(account.seconds, 0.0))
            account.counts.update(dict.fromkeys(account.counts, 0))

    def initial(self) -> Array:
        """The body at rest, let go: equilibrium of the stresses before any fluid has moved, and the oxygen that goes with it."""
        if self._initial is None:
            self._initial = self._start()
        return self._initial.copy()

    def _start(self) -> Array:
        p = self.parameters
        u = np.zeros(self._parts[-1])
        point = self.point(u)
        self.side = 1
        point.nodal[:, P:] = self.boundary(0.0)[:, P:]  # the body is at rest, wherever parts of its surface are about to be moved to
        point.nodal[:, ALPHA] = fraction(self.initial_values, self.body)
        self.rest(u)[0][:] = self._moments(point)[:2]
        self.observation.begin(u)
        point.nodal[:, P] = np.where(self.prescribed[:, P], point.nodal[:, P], -eq.contact_pressure(point.nodal[:, ALPHA], *p.contact))
        try:
            u = self._let_go(0.0, u).u
        except StepFailure as failure:
            raise SolverError(
                f"no equilibrium was found at t = 0 ({failure}). {self._advice()}Take an initial alpha nearer to alpha_star, a smaller "
                "p_out, or a larger lambda_alpha; with kappa = 0 the body takes its equilibrium at once, and a small kappa lets it go "
                "there in time.",
                time=0.0,
            ) from failure
        self.rest(u)[2][:] = self._first_rate(u)
        self.newton.forget()
        return u

    def _advice(self) -> str:
        """What to do about parts that act at t = 0."""
        acting = [part.name for part in self.surface.parts if part.acts_at(0.0, self.parameters.p_out)]
        if not acting:
            return ""
        names = ", ".join(f'"{name}"' for name in acting)
        return f"What acts on {names} at once should rise from 0 over a short time, as {{ times = [0, 0.1], values = [0, ...] }} does. "

    def _first_rate(self, u: Array) -> float:
        """Rate of the volume at t = 0: what flows in from the surface, whose own points, moving with it, are left out; with a fluid that
        flows freely, that over a small step."""
        if self.parameters.kappa > 0.0:
            return float(np.sum(self._moments(self.point(u))[3][self.prescribed[:, P]]))
        try:
            step = RATE_STEP * float(np.sqrt(self.newton.tolerance))
            return float(self.rest(self.solve(step, 1.0 / step, u, u).u)[2][0])
        except StepFailure:
            return np.nan

    def consistent(self, t: float, u: Array) -> Array:
        """`u` in equilibrium with the data just after a jump at `t`, before any fluid has moved.

        Raises
        ------
        SolverError
            Where there is no such equilibrium.
        """
        try:
            return self._let_go(t, u).u
        except StepFailure as failure:
            raise SolverError(
                f"no equilibrium was found after the jump at t = {t:.6g} ({failure}). Let the load rise over a short time instead.", time=t
            ) from failure

    def _let_go(self, t: float, u: Array) -> Solved:
        """The equilibrium of the stresses and the oxygen that goes with it, with the data after `t`, in no time."""
        before = (self.surface.values(t, -1), self.surface.actions(t, -1)) if t > 0.0 else self._at_rest(u)
        self.side = 1
        try:
            return self.solve(t, np.inf, u, u)
        except StepFailure as failure:
            return self._ramp(t, u, before, failure)
        finally:
            self.side, self._from = -1, None

    def _at_rest(self, u: Array) -> tuple[Array, Array]:
        """What is prescribed and acts before the body is let go: nothing moves, pulls or presses it."""
        values, actions = self.surface.values(0.0, 1), self.surface.actions(0.0, 1)
        values[:, :2] = 0.0
        actions[:, :3] = 0.0
        return values, actions

    def _ramp(self, t: float, u: Array, before: tuple[Array, Array], failure: StepFailure) -> Solved:
        """The same in shares of what is prescribed and acts, from what did before."""
        if not self.surface.parts:
            raise failure
        share, step, guess, iterations = 0.0, 0.5, u, 0
        while True:
            self._from = before, min(1.0, share + step)
            try:
                found = self.solve(t, np.inf, u, guess)
            except StepFailure:
                step *= 0.5
                if step < LEAST_RAMP:
                    raise failure from None
                continue
            share, guess, iterations = self._from[1], found.u, iterations + found.iterations
            if share == 1.0:
                return Solved(found.u, iterations, found.memory)

    def recall(self, memory: Array) -> None:
        """Hold the tangent again that `memory` tells of."""
        self.newton.recall(memory)

    # -- One step -------------------------------------------------------------------------------------------------------

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Newton's method from the predicted vector; see `multiphase.stepping.Scheme`."""
        tau = 1.0 / alpha
        moments = self.rest(past)[0]
        loads, bubble_loads = (array.copy() for array in self.loads(t, tau))
        loads[:, P] += moments[1]
        if not self.printed or tau == 0.0:
            loads[:, ALPHA] += moments[0]
        self.acting = self._acting(t)
        step = Step(tau, loads, bubble_loads, self.point(past), self.acting)
        point, iterations = self.newton.solve(step, self._admissible(t, guess, past), lambda: self._admissible(t, past, past))
        return Solved(self._vector(step, past, point), iterations, self.newton.memory)

    def _admissible(self, t: float, guess: Array, past: Array) -> Point:
        """The predicted point, or the past where that has left where the equations are defined."""
        values = self.boundary(t)
        for vector in (guess, past):
            nodal, bubbles = self.point(vector).nodal.copy(), self.point(vector).bubbles.copy()
            np.copyto(nodal, values, where=self.prescribed)
            self.newton.rigid.align(nodal[:, :2], bubbles)
            alpha, point = nodal[:, ALPHA], Point(nodal, bubbles)
            if alpha.min() > 0.0 and alpha.max() < 1.0 and self.newton.turned_over(point) < 0:
                break
        return point

    def _vector(self, step: Step, past: Array, point: Point) -> Array:
        """The whole vector after a step: its moments are those that the equations give, so that what the iteration leaves of its error does
        not add up from step to step."""
        u = np.zeros(self._parts[-1])
        new = self.point(u)
        new.nodal[:], new.bubbles[:] = point.nodal, point.bubbles
        (moments, integrals, rate), (_, integrals_past, rate_past) = self.rest(u), self.rest(past)
        cells, volume, born, flow = self._moments(point)
        surface = self.prescribed[:, P]
        moments[0] = cells if self.printed and step.tau > 0.0 else step.loads[:, ALPHA] + step.tau * born
        moments[1] = np.where(surface, volume, step.loads[:, P] - step.tau * flow)
        gained = float(np.sum((volume - step.loads[:, P] + step.tau * flow)[surface]))
        integrals[:] = integrals_past + np.array([step.tau * float(np.sum(born)), gained])
        rate[:] = gained / step.tau if step.tau > 0.0 else rate_past
        return u

    def _moments(self, point: Point) -> Array:
        """Moments of alpha J, J, J q_alpha and of the flow, (4, points)."""
        sums = np.zeros((4, self.count))
        self.newton.over_elements("moments", self.constants, self.elements, point.nodal, point.bubbles, sums, account="moments")
        return sums

    def error_norm(self, error: Array, u: Array) -> float:
        """Root mean squares over the body of the local errors of the displacement, over the body's length now, and of the cell fraction;
        the larger one, over rtol."""
        weights = self.observation.weights
        nodal = self.point(error).nodal
        length = self.body.radius * np.sqrt(np.sum(self.rest(u)[0][1]) / np.sum(weights))
        mean = np.sqrt(weights @ (nodal**2) / np.sum(weights))
        return float(max(np.hypot(mean[X], mean[Y]) / length, mean[ALPHA])) / self.rtol

    def explain(self, u: Array) -> str:
        """What there is to say of a state that no step leads on from."""
        from tumour.fem.stability import explain

        return explain(self, u)

    # -- Output ---------------------------------------------------------------------------------------------------------

    def observe(self, t: float, u: Array) -> Snapshot:
        """What is stored of the vector `u`."""
        return self.observation.snapshot(t, u)

    def statistics(self) -> dict[str, Any]:
        """What a run cost: counts, and seconds by what they were spent on."""
        newton, linear = self.newton, self.newton.linear
        return {
            "linear_solver": linear.name, "assemblies": newton.counts["tangent"], "residuals": newton.counts["residual"],
            "factorisations": linear.counts["factorise"], "linear_solves": linear.counts["solve"],
            "seconds": {**newton.seconds, **linear.seconds, "observation": self.observation.seconds},
        }  # fmt: skip
