r"""The plaque by the method of lines: compiled finite volumes, integrated as one banded differential-algebraic system.

The discrete equations are those of `plaque1d.discretisation`. `LinesScheme` solves one implicit step for the common time loop (BDF of
order two, backward Euler); `RadauLines` brings its own integrator, Radau IIA of order five (`multiphase.radau`), which takes far
fewer steps and gives the solution between them.

Products W n and W l are the unknowns and the integrals of the sources advance by the same formulas, so balances of mass hold to
rounding whatever the tolerances. A state of `RadauLines` holds the last point and the stages before it: all that the next step and
the values in between depend on, so a run that goes on from a stored state equals an uninterrupted one bit for bit.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase import radau
from multiphase.stepping import Control, Snapshot, Solved, State, StepFailure, failed_step, steps_left
from plaque1d import discretisation as fv
from plaque1d.observation import FIELDS, SCALARS
from plaque1d.semidiscrete import SemiDiscrete, entry, mark

Array = NDArray[np.float64]

NEWTON_TOLERANCE = 3e-3
NEWTON_ITERATIONS = 12
VALUES_PER_CALL = 200_000
"""Unknowns times steps between two returns of the compiled integrator: what Ctrl-C waits for, a tenth of a second or so."""


@cache
def _advance() -> Any:
    return radau.build(fv.rates, fv.tangent, fv.size_of, fv.admit, fv.project, mark())


class LinesScheme(SemiDiscrete):
    """One implicit step for the common time loop; see `multiphase.stepping.Scheme`."""

    def prepare(self) -> None:
        """Compile, or load, what a run needs: an iteration that is not made."""
        super().prepare()
        y = self.initial()
        entry("newton_step")(self.data(0.0), self.mass, 0.0, 1.0, y, y, 1.0, 0, self.work)
        self.error_norm(y, y)

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Newton's method from the predicted vector; see `multiphase.stepping.Scheme`."""
        y = guess.copy()
        if not y[self.size] > 0.0:
            raise StepFailure(f"the predicted size of the wall is {y[self.size]:.3g}")
        code, iterations, change = entry("newton_step")(
            self.data_until(t), self.mass, t, alpha, past, y, NEWTON_TOLERANCE, NEWTON_ITERATIONS, self.work
        )
        if code != radau.DONE:
            raise StepFailure(self.reason(code, change))
        return Solved(y, iterations)


class RadauLines(LinesScheme):
    """The same discretisation with its own integrator, Radau IIA; see `multiphase.stepping.Integrator`."""

    def prepare(self) -> None:
        """Compile, or load, what a run needs: steps to where it begins."""
        y = self.initial()
        state = State(times=np.zeros(1), u=y[None, :], dt=1.0)
        self.between(0.0, self.advance(state, 0.0, 0.0, Control()))

    def advance(self, state: State, stop: float, wanted: float, control: Control) -> State:
        """Take steps until `wanted` is reached or passed, but none beyond `stop`; it may return before."""
        left = steps_left(state, control)
        points = len(state.times)
        times, past = np.zeros(4), np.zeros((4, state.u.shape[1]))
        times[:points], past[:points] = state.times, state.u
        counters = np.array(list(state.counters.values()), dtype=np.int64)
        report = np.zeros(2)
        code, points, dt = _advance()(
            self.data(state.t), self.mass, times, past, points, state.dt, control.dt or 0.0, stop, wanted,
            min(left, max(1, VALUES_PER_CALL // self.size)), self.newton_tolerance, control.smallest, control.attempts, counters, report,
            self.work,
        )  # fmt: skip
        counts = dict(zip(state.counters, counters.tolist(), strict=True))
        reached = State(times=times[:points].copy(), u=past[:points].copy(), dt=dt, counters=counts)
        if code in (radau.DONE, radau.GOING_ON):
            return reached
        if reached.t > state.t:  # what was reached goes to the loop first; from there the failure comes again
            return replace(reached, dt=float(times[0] - times[-1]))
        raise failed_step(replace(reached, dt=dt), [f"dt = {report[0]:.3g}: {self.reason(code, float(report[1]))}"])

    def between(self, t: float, state: State) -> Snapshot:
        """What is stored at `t`, within the last step of `state` or at its end."""
        fields, scalars = np.empty((len(FIELDS) + 1, self.grid.cells)), np.empty(len(SCALARS))
        entry("between")(self.data_until(t), t, state.times, state.u, self._totals, fields, scalars)
        return self.named(t, fields, scalars, {})

    @property
    def newton_tolerance(self) -> float:
        """Change at which the iteration ends, in units of the tolerated error; at small rtol above rounding."""
        return max(3e-3, min(0.03, float(np.sqrt(self.rtol))))
