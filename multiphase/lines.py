r"""Method of lines: a model's compiled rates and tangent as a scheme for the common time loop, or with an integrator of its own.

A model writes its discrete equations ``M y' = f(t, y)`` as compiled functions over one vector, ``[band unknowns, border, integrals]``:
those of `multiphase.newton`, and

    settle(data, t, y, work)                           brings the algebraic part of y onto its equations, from nothing
    record(data, t, y, slope, start, fields, scalars)  what is stored of y: rows of fields, the positions last, and scalars; slope is
                                                       dy/dt along the step, or empty where y is a single point

`Kernel` holds them, compiled; `SemiDiscrete` is one scene's constants and vector; `Implicit` solves one implicit step for the common
loop (BDF of order two, backward Euler); `Radau` brings its own integrator, Radau IIA of order five, which takes far fewer steps where
the solution is smooth, and gives it between them.

Integrals of the sources are unknowns that advance by the same formulas, so balances hold to rounding whatever the tolerances. A state
of `Radau` holds the last point and the stages before it: all that the next step and the values in between depend on, so a run that
goes on from a stored state equals an uninterrupted one bit for bit.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from multiphase import banded, compiled, newton, radau, stepping, trbdf2
from multiphase.newton import MODEL, of_the_model
from multiphase.stepping import Control, Snapshot, Solved, State, StepFailure, failed_step, steps_left

Array = NDArray[np.float64]

logger = logging.getLogger("multiphase.compile")

NEWTON_TOLERANCE = 3e-3
"""Size of the error left by the iteration, as a fraction of the tolerated local error."""
NEWTON_ITERATIONS = 12
VALUES_PER_CALL = 200_000
"""Unknowns times steps between two returns of the compiled integrator: what Ctrl-C waits for, a tenth of a second or so."""

record = interpolate = differentiate = of_the_model


def record_all(d: Any, wanted: Any, times: Any, past: Any, start: Any, fields: Any, scalars: Any) -> None:
    """`record` at the times `wanted`, on the polynomial through the points (times, past)."""
    y, slope = np.empty(past.shape[1]), np.empty(past.shape[1] if len(times) > 1 else 0)
    for i in range(len(wanted)):
        if wanted[i] == times[0]:
            y[:] = past[0]
        else:
            interpolate(times, past, wanted[i], y)
        if len(times) > 1:
            differentiate(times, past, wanted[i], slope)
        record(d, wanted[i], y, slope, start, fields[i], scalars[i])


class Kernel:
    """The compiled functions of one discretisation, kept on disk under the fingerprint of all the files they are made of.

    Parameters
    ----------
    modules : modules
        Where the functions are looked up, in this order.
    parts : modules
        Further modules whose functions are compiled into them.
    **named : functions
        Functions that go by another name there, and come first.

    Attributes
    ----------
    entries : dict
        What has been compiled, or loaded, so far.
    """

    def __init__(self, *modules: ModuleType, parts: Sequence[ModuleType] = (), **named: Callable[..., Any]) -> None:
        self._modules, self._parts, self._named = modules, parts, named
        self.entries: dict[str, Any] = {}

    @cached_property
    def mark(self) -> str:
        """Fingerprint of all that is compiled."""
        files = (module.__file__ for module in (newton, radau, trbdf2, banded, stepping, *self._modules, *self._parts))
        return compiled.fingerprint(__file__, *files)

    def __getitem__(self, name: str) -> Any:
        """A function of the modules, compiled to be called from Python; compiling it takes a while when it is not on disk."""
        return self._once(name, lambda: compiled.compiled(self._plain(name), keep=self.mark))

    @property
    def newton_step(self) -> Any:
        """`multiphase.newton.newton_step` for these functions."""
        return self._once("newton_step", lambda: newton.build(self._functions, self.mark))

    @property
    def record_all(self) -> Any:
        own = {"interpolate": radau.interpolate, "differentiate": radau.differentiate}

        def make() -> Any:
            parts = {name: compiled.compiled(function) for name, function in own.items()}
            return compiled.compiled(record_all, keep=self.mark, record=self._plain("record"), **parts)

        return self._once("record_all", make)

    @property
    def _functions(self) -> dict[str, Any]:
        """What the model brings to Newton's method and the integrator."""
        return {name: self._plain(name) for name in MODEL}

    @property
    def advance(self) -> Any:
        """`multiphase.radau.advance` for these functions."""
        return self._once("advance", lambda: radau.build(self._functions, self.mark))

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self.entries:
            self.entries[name] = make()
        return self.entries[name]

    def _plain(self, name: str) -> Callable[..., Any]:
        if name in self._named:
            return self._named[name]
        for module in self._modules:
            if hasattr(module, name):
                found: Callable[..., Any] = getattr(module, name)
                return found
        raise AttributeError(f"{name} is in none of {', '.join(module.__name__ for module in self._modules)}")

    def announce(self) -> None:
        """Say once that code is being compiled, if it is not on disk."""
        if not self.entries and not (compiled.cache_folder(numba.config.CACHE_DIR) / self.mark).exists():  # type: ignore[attr-defined]
            logger.info("compiling the solver for this machine; it takes half a minute, once")


class SemiDiscrete:
    """One scene's semi-discrete system: what its schemes share of `multiphase.stepping.Scheme`.

    A model sets the attributes and defines `data`, `data_until` and `bounds`.

    Attributes
    ----------
    kernel : Kernel
    mass : (band + border,) array
        The diagonal of M, 0 or 1.
    work : multiphase.newton.Work
    start : array
        What `record` needs of the initial state.
    fields, scalars : tuple of str
        Names of the rows that `record` fills, without the positions.
    rtol : float
    breaks, kinks : tuple of float
        Times at which the data jump, or change their slope.
    """

    kernel: Kernel
    mass: Array
    work: newton.Work
    start: Array
    fields: tuple[str, ...]
    scalars: tuple[str, ...]
    rtol: float
    breaks: tuple[float, ...] = ()
    kinks: tuple[float, ...] = ()
    cells: int
    bounds: ClassVar[Mapping[int, str]]
    """What a step broke that `admit` refuses, in words, by its number."""

    _initial: Array

    def data(self, t: float) -> Any:
        """Constants of the stretch between two breaks that begins at or contains `t`."""
        raise NotImplementedError

    def data_until(self, t: float) -> Any:
        """`data` of the stretch that ends at `t`, or contains it."""
        return self.data(float(np.nextafter(t, 0.0)))

    @property
    def workspace_bytes(self) -> int:
        """Memory of the work space."""
        return sum(array.nbytes for array in self.work)

    def prepare(self) -> None:
        """Compile, or load, what a run needs."""
        self.observe(0.0, self.initial())

    def initial(self) -> Array:
        """Initial vector, its algebraic part consistent."""
        return self._initial.copy()

    def consistent(self, t: float, u: Array) -> Array:
        """`u` with its algebraic part on its equations just after time `t`."""
        y = u.copy()
        self.kernel["settle"](self.data(t), t, y, self.work)
        return y

    def error_norm(self, error: Array, u: Array) -> float:
        """Norm of a local error in units of the tolerance."""
        return float(self.kernel["size_of"](self.data(0.0), u, error))

    def reason(self, code: int, value: float) -> str:
        """Why a step failed, in words."""
        if code == newton.OUT_OF_BOUNDS:
            return self.out_of_bounds(int(value))
        return {
            newton.DIVERGED: f"Newton's method does not converge: last change {value:.3g} of the tolerated error",
            newton.SINGULAR: "the tangent of the step is singular",
            newton.INEXACT: f"local error {value:.3g} times the tolerance",
        }[code]

    def out_of_bounds(self, number: int) -> str:
        """The bound that a step broke, in words."""
        return self.bounds[number]

    def observe(self, t: float, u: Array) -> Snapshot:
        """What is stored of the vector `u` at time `t`."""
        return self.snapshots([t], np.array([t]), u[None, :])[0]

    def snapshots(self, wanted: Sequence[float], times: Array, past: Array) -> list[Snapshot]:
        """What is stored at the times `wanted`, on the polynomial through the points (times, past)."""
        fields = np.empty((len(wanted), len(self.fields) + 1, self.cells))
        scalars = np.empty((len(wanted), len(self.scalars)))
        self.kernel.record_all(self.data_until(wanted[-1]), np.array(wanted), times, past, self.start, fields, scalars)
        return [self.named(t, fields[i], scalars[i]) for i, t in enumerate(wanted)]

    def named(self, t: float, fields: Array, scalars: Array) -> Snapshot:
        """A snapshot of the rows that `record` fills."""
        return Snapshot(t, dict(zip(self.scalars, scalars.tolist(), strict=True)), dict(zip(self.fields, fields, strict=False)), fields[-1])


class Implicit(SemiDiscrete):
    """One implicit step for the common time loop; see `multiphase.stepping.Scheme`."""

    def prepare(self) -> None:
        """Compile, or load, what a run needs: an iteration that is not made."""
        super().prepare()
        y = self.initial()
        self.kernel.newton_step(self.data(0.0), self.mass, 0.0, 1.0, y, y, 1.0, 0, self.work)
        self.error_norm(y, y)

    def step_data(self, t: float, alpha: float, past: Array) -> Any:
        """Constants of one implicit step to `t`."""
        return self.data_until(t)

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Newton's method from the predicted vector; see `multiphase.stepping.Scheme`."""
        y = guess.copy()
        data = self.step_data(t, alpha, past)
        if self.kernel["reach"](data, y, np.zeros_like(y)) == 0.0:
            y[:] = past  # prediction has left where the equations are defined
        code, iterations, change = self.kernel.newton_step(
            data, self.mass, t, alpha, past, y, NEWTON_TOLERANCE, NEWTON_ITERATIONS, self.work
        )
        if code != newton.DONE:
            raise StepFailure(self.reason(code, change))
        return Solved(y, iterations)


class Radau(SemiDiscrete):
    """The same discretisation with its own integrator, Radau IIA; see `multiphase.stepping.Integrator`."""

    def prepare(self) -> None:
        """Compile, or load, what a run needs: steps to where it begins."""
        y = self.initial()
        state = State(times=np.zeros(1), u=y[None, :], dt=1.0)
        self.between([0.0], self.advance(state, 0.0, 0.0, Control()))

    def advance(self, state: State, stop: float, wanted: float, control: Control) -> State:
        """Take steps until `wanted` is reached or passed, but none beyond `stop`; it may return before."""
        left = steps_left(state, control)
        points = len(state.times)
        times, past = np.zeros(4), np.zeros((4, state.u.shape[1]))
        times[:points], past[:points] = state.times, state.u
        counters = np.array(list(state.counters.values()), dtype=np.int64)
        report = np.zeros(2)
        code, points, dt = self.kernel.advance(
            self.data(state.t), self.mass, times, past, points, state.dt, control.dt or 0.0, stop, wanted,
            min(left, max(1, VALUES_PER_CALL // len(self.mass))), self.newton_tolerance, control.smallest, control.attempts, counters,
            report, self.work,
        )  # fmt: skip
        counts = dict(zip(state.counters, counters.tolist(), strict=True))
        reached = State(times=times[:points].copy(), u=past[:points].copy(), dt=dt, counters=counts)
        if code in (newton.DONE, newton.GOING_ON):
            return reached
        if reached.t > state.t:  # what was reached goes to the loop first; from there the failure comes again
            return replace(reached, dt=float(times[0] - times[-1]))
        raise failed_step(replace(reached, dt=dt), [f"dt = {report[0]:.3g}: {self.reason(code, float(report[1]))}"])

    def between(self, wanted: Sequence[float], state: State) -> list[Snapshot]:
        """What is stored at the times `wanted`, within the last step of `state` or at its end."""
        return self.snapshots(wanted, state.times, state.u)

    @property
    def newton_tolerance(self) -> float:
        """Change at which the iteration ends, in units of the tolerated error; at small rtol above rounding."""
        return max(NEWTON_TOLERANCE, min(0.03, float(np.sqrt(self.rtol))))
