r"""The one time loop: variable-step BDF of order one and two, with error control.

A scheme solves one implicit step of ``y' = f(t, y, z), 0 = g(t, y, z)`` for ``u = (y, z)``; the loop owns the
step size, rejection, the exact output times, the breaks of the data and the history. With ``h`` the new
step, ``h_1`` the last one and ``w = h / h_1``, the formulas are

    order 1:  alpha (u - u_k) = f,                          alpha = 1 / h
    order 2:  alpha (u - [(1+w)^2 u_k - w^2 u_{k-1}] / (1+2w)) = f,   alpha = (1+2w) / ((1+w) h)

so a step is a backward Euler step of size ``1/alpha`` from a weighted past. The predictor extrapolates the
last three points; with ``y_p`` its value, the local error of the formula of order p is ``r/(1+r) (y - y_p)``,

    order 1 (two points):   r = h / (h + h_1)
    order 2 (three points): r = h (h+h_1) / ((2h+h_1) (h+h_1+h_2)),     2/11 at constant steps

(Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, section III.5). Step ratios stay at or
below 2, inside the bound 1 + sqrt(2) for stability of the second-order formula (ibid.).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import prod
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import SolverError

Array = NDArray[np.float64]

LARGEST_GROWTH = 2.0
SMALLEST_SHRINK = 0.2
SAFETY = 0.85
ASKED, SHORT = 12, 1e-6
"""Attempts at one step, and the share of the time reached that it is shorter than, at which a scheme that cannot solve it is asked for
what is wrong; if it knows, the run ends."""
COUNTERS = ("steps", "rejected_error", "rejected_solver", "iterations")


class StepFailure(Exception):
    """A step that a scheme could not solve; the message says why. The loop tries again with half of it."""


class StopRun(Exception):
    """Raised by a tracker to end a run early and in good order; the message says why."""


@dataclass(frozen=True, slots=True)
class Solved:
    """One solved implicit step: the new vector, the iterations it took, and what the scheme wants to remember (see `State.memory`)."""

    u: Array
    iterations: int
    memory: Array | None = None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What is stored at one time: scalars, fields on the cells or at the points of a mesh, positions of the cells (None on a mesh)."""

    t: float
    scalars: Mapping[str, float]
    fields: Mapping[str, Array]
    x: Array | None


class Scheme(Protocol):
    """A discretisation of one model; it knows neither time loop nor output.

    Attributes
    ----------
    breaks : tuple of float
        Times at which the data jump: a step ends there and the history starts anew.
    kinks : tuple of float
        Times at which the data change their slope: a step ends there.
    """

    breaks: tuple[float, ...]
    kinks: tuple[float, ...]

    def initial(self) -> Array:
        """The initial vector, algebraic part included."""

    def consistent(self, t: float, u: Array) -> Array:
        """`u` with its algebraic part made consistent with the data just after time `t`."""

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Solve ``alpha (y - past) = f(t, y, z), 0 = g(t, y, z)`` from `guess`; raises StepFailure."""

    def error_norm(self, error: Array, u: Array) -> float:
        """Weighted norm of a local error; 1 is the tolerance."""

    def observe(self, t: float, u: Array) -> Snapshot:
        """What is stored of the vector `u`."""


@runtime_checkable
class Integrator(Protocol):
    """A discretisation with a time integrator of its own, which advances between the loop's stops.

    `breaks`, `kinks`, `initial` and `consistent` are those of `Scheme`. Its state holds points of the last step,
    newest first, whose polynomial is the solution in between.
    """

    breaks: tuple[float, ...]
    kinks: tuple[float, ...]

    def initial(self) -> Array:
        """The initial vector, algebraic part included."""

    def consistent(self, t: float, u: Array) -> Array:
        """`u` with its algebraic part made consistent with the data just after time `t`."""

    def advance(self, state: State, stop: float, wanted: float, control: Control) -> State:
        """Take steps, none beyond `stop`, and return after the first that reaches or passes `wanted`, or before; raises SolverError."""

    def between(self, wanted: Sequence[float], state: State) -> list[Snapshot]:
        """What is stored at the times `wanted`, within the last step of `state` or at its end."""


class Tracker:
    """What hangs on the loop. Every hook may raise StopRun."""

    def on_start(self, state: State, t_end: float) -> None: ...

    def on_step(self, state: State) -> None: ...

    def on_save(self, state: State, snapshot: Snapshot) -> None: ...

    def on_end(self, state: State, status: str, message: str) -> None: ...


@dataclass(frozen=True, slots=True)
class State:
    """Everything that a restart needs, so that a resumed run equals an uninterrupted one bit for bit.

    Attributes
    ----------
    times : (m,) array
        The last m <= 4 times, newest first.
    u : (m, size) array
        The vectors at these times.
    dt : float
        Step to try next.
    counters : dict of str to int
        Steps, rejections, iterations so far.
    memory : array
        What a scheme that keeps something from step to step, such as a tangent, makes it of again; empty for others.
    """

    times: Array
    u: Array
    dt: float
    counters: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTERS, 0))
    memory: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def t(self) -> float:
        return float(self.times[0])

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Flat arrays for a checkpoint."""
        counts = np.array([self.counters[name] for name in COUNTERS], dtype=np.int64)
        arrays = {"times": self.times, "u": self.u, "dt": np.array(self.dt), "counters": counts}
        return arrays | {"memory": self.memory} if self.memory.size else arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> State:
        counters = {name: int(count) for name, count in zip(COUNTERS, arrays["counters"], strict=True)}
        return cls(
            times=np.array(arrays["times"], dtype=float),
            u=np.array(arrays["u"], dtype=float),
            dt=float(arrays["dt"]),
            counters=counters,
            memory=np.array(arrays.get("memory", ()), dtype=float),
        )


@dataclass(frozen=True, slots=True)
class Control:
    """How the loop chooses steps.

    Attributes
    ----------
    order : int
        2 for BDF2, 1 for backward Euler.
    dt : float or None
        Fixed step (shortened to land on output times); None controls the error.
    max_steps : int
        The run fails beyond this many steps.
    smallest : float
        The run fails when a step would be smaller than this fraction of the time reached and to go.
    attempts : int
        The run fails after this many rejections of one step.
    """

    order: int = 2
    dt: float | None = None
    max_steps: int = 1_000_000
    smallest: float = 1e-13
    attempts: int = 60


def formula(order: int, t: float, times: Array, u: Array) -> tuple[float, Array]:
    """Coefficient `alpha` and weighted past of the BDF formula of `order` for a step to `t`."""
    h = t - times[0]
    if order == 1 or len(times) == 1:
        return 1.0 / h, u[0]
    w = h / (times[0] - times[1])
    alpha = (1.0 + 2.0 * w) / ((1.0 + w) * h)
    past: Array = u[0] + (w * w / (1.0 + 2.0 * w)) * (u[0] - u[1])
    return alpha, past


def predict(t: float, times: Array, u: Array) -> Array:
    """Value at `t` of the polynomial through the points (times, u)."""
    at = times.tolist()
    value: Array = np.zeros_like(u[0])
    for i, t_i in enumerate(at):
        value += prod((t - t_j) / (t_i - t_j) for j, t_j in enumerate(at) if j != i) * u[i]
    return value


def error_factor(order: int, t: float, times: Array) -> tuple[float, int]:
    """Factor that turns (new - predicted) into the local error, and the power of h it falls with.

    Until the history is long enough the predictor's own, larger error stands in for it.
    """
    h = t - times[0]
    points = min(len(times), order + 1)
    if points <= order:
        return 1.0, points
    span = t - times[1]
    ratio = h / span if order == 1 else h * span / ((h + span) * (t - times[2]))
    return ratio / (1.0 + ratio), order + 1


def start(scheme: Scheme | Integrator, t: float, first_stop: float, control: Control) -> State:
    """The state at the initial time."""
    u = scheme.initial()
    dt = control.dt if control.dt is not None else 1e-2 * (first_stop - t)
    return State(times=np.array([t]), u=u[None, :].copy(), dt=dt)


def integrate(
    scheme: Scheme | Integrator, state: State, save_at: Sequence[float], control: Control, trackers: Sequence[Tracker] = ()
) -> State:
    """Advance `state` through the output times `save_at`, which are met exactly.

    Parameters
    ----------
    scheme : Scheme or Integrator
    state : State
        From `start`, or from a checkpoint; not after the first of `save_at`, unless its points reach back to that.
    save_at : sequence of float
        Output times that are still to come, in order; the last one is the end. One that equals the state's time is stored
        without a step.
    control : Control
    trackers : sequence of Tracker
        Called in order after every step (every few steps of an `Integrator`) and at every output time.

    Returns
    -------
    State
        At the last output time.

    Raises
    ------
    SolverError
        No step of usable size succeeds; `history` holds the reasons.
    StopRun
        From a tracker.
    """
    t_end = save_at[-1]
    own = isinstance(scheme, Integrator)
    if hasattr(scheme, "recall"):
        scheme.recall(state.memory)
    step, observe = _steps(scheme, control)
    for tracker in trackers:
        tracker.on_start(state, t_end)
    waiting = deque(save_at)
    while waiting:
        while state.t < waiting[0]:
            if state.t in scheme.breaks and len(state.times) > 1:
                state = restart(scheme, state, control)
            stop = min([t_end if own else waiting[0], *(b for b in (*scheme.breaks, *scheme.kinks) if b > state.t)])
            state = step(state, stop, waiting[0])
            for tracker in trackers:
                tracker.on_step(state)
        reached = [waiting.popleft()]
        while waiting and waiting[0] <= state.t:
            reached.append(waiting.popleft())
        for snapshot in observe(reached, state):
            for tracker in trackers:
                tracker.on_save(state, snapshot)
    return state


def _steps(
    scheme: Scheme | Integrator, control: Control
) -> tuple[Callable[[State, float, float], State], Callable[[Sequence[float], State], list[Snapshot]]]:
    """What takes steps towards a stop and a wanted time, and what reads a state at some times: the integrator itself, or the loop's
    own."""
    if isinstance(scheme, Integrator):
        return partial(scheme.advance, control=control), scheme.between
    return (
        lambda state, stop, wanted: advance(scheme, state, min(stop, wanted), control),
        lambda reached, state: [scheme.observe(t, state.u[0]) for t in reached],
    )


def restart(scheme: Scheme | Integrator, state: State, control: Control) -> State:
    """Forget the history at a jump of the data and begin again with a small step."""
    u = scheme.consistent(state.t, state.u[0])
    dt = control.dt if control.dt is not None else 1e-2 * state.dt
    return replace(state, times=state.times[:1].copy(), u=u[None, :].copy(), dt=dt)


def landing(t: float, dt: float, stop: float) -> float:
    """The time of the next step: `stop` itself when it is near, so that no sliver of a step is left."""
    remaining = stop - t
    if dt >= remaining * (1.0 - 1e-9):
        return stop
    return t + 0.5 * remaining if 2.0 * dt > remaining else t + dt


def advance(scheme: Scheme, state: State, stop: float, control: Control) -> State:
    """One accepted step towards `stop`, tried again with a smaller size until it succeeds."""
    reasons: deque[str] = deque(maxlen=12)
    counters = dict(state.counters)
    dt, why = state.dt, ""
    steps_left(state, control)
    for attempt in range(control.attempts):
        t = landing(state.t, dt, stop)
        h = t - state.t
        if h <= control.smallest * max(abs(state.t), abs(stop)):
            break
        try:
            solved = try_step(scheme, state, t, control)
        except StepFailure as failure:
            counters["rejected_solver"] += 1
            reasons.append(f"dt = {h:.3g}: {failure}")
            dt = 0.5 * h
            is_short = h < SHORT * max(abs(state.t), abs(stop))
            if (is_short or attempt == ASKED) and (why := _explanation(scheme, state)):
                break
            continue
        counters["iterations"] += solved.iterations
        factor, error = _next_factor(scheme, state, t, solved, control)
        if not error <= 1.0 and control.dt is None:  # an error that is not a number, too
            counters["rejected_error"] += 1
            reasons.append(f"dt = {h:.3g}: local error {error:.3g} times the tolerance")
            dt = h * max(SMALLEST_SHRINK, min(0.9, factor))
            continue
        counters["steps"] += 1
        if control.dt is not None:
            dt_next = min(control.dt, LARGEST_GROWTH * h)
        else:
            growth = min(factor, 1.0 if attempt else LARGEST_GROWTH)
            # A step shortened to land on a stop says little about the size that the error allows.
            dt_next = max(h * growth, min(dt, LARGEST_GROWTH * h)) if h < 0.999 * dt and growth >= 1.0 else h * growth
        keep = min(len(state.times), max(control.order, _guess_points(scheme, control) - 1))
        return State(
            times=np.concatenate([[t], state.times[:keep]]),
            u=np.concatenate([solved.u[None, :], state.u[:keep]]),
            dt=dt_next,
            counters=counters,
            memory=state.memory if solved.memory is None else solved.memory,
        )
    raise failed_step(replace(state, dt=dt), reasons, why or _explanation(scheme, state))


def _explanation(scheme: Scheme, state: State) -> str:
    """What the scheme has to say of a state that no step leads on from; empty if nothing."""
    return str(scheme.explain(state.u[0])) if hasattr(scheme, "explain") else ""


def steps_left(state: State, control: Control) -> int:
    """Steps that `control` still allows; raises SolverError when there are none."""
    left = control.max_steps - state.counters["steps"]
    if left <= 0:
        raise SolverError(
            f"the run needs more than max_steps = {control.max_steps} steps; it reached t = {state.t:.6g} with dt = {state.dt:.3g}. "
            "Raise solver.max_steps and resume, or start anew with a larger solver.rtol.",
            time=state.t,
            dt=state.dt,
        )
    return left


def failed_step(state: State, reasons: Sequence[str] | deque[str], why: str = "") -> SolverError:
    """What to raise when no step from `state` succeeds; `why` is what the scheme has to say of that state."""
    return SolverError(
        f"no step from t = {state.t:.6g} succeeded, down to dt = {state.dt:.3g}. {why + ' ' if why else ''}"
        f"Last reason: {reasons[-1] if reasons else 'none'}.",
        time=state.t,
        dt=state.dt,
        history=reasons,
    )


def _guess_points(scheme: Scheme, control: Control) -> int:
    """Points that the first guess of a step is extrapolated from: what the scheme says, else those of the error estimate."""
    return int(getattr(scheme, "guess_points", control.order + 1))


def try_step(scheme: Scheme, state: State, t: float, control: Control) -> Solved:
    """Solve the implicit step to `t`; a floating-point error in it is a StepFailure with its own words."""
    alpha, past = formula(control.order, t, state.times, state.u)
    points = _guess_points(scheme, control)
    guess = predict(t, state.times[:points], state.u[:points])
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is not finite is refused below
            solved = scheme.solve(t, alpha, past, guess)
    except FloatingPointError as error:
        raise StepFailure(f"floating-point error in the step: {error}") from error
    if not np.all(np.isfinite(solved.u)):
        raise StepFailure("the step gave a value that is not finite")
    return solved


def _next_factor(scheme: Scheme, state: State, t: float, solved: Solved, control: Control) -> tuple[float, float]:
    """Growth factor that the error of a solved step allows, and the error."""
    points = control.order + 1
    predicted = predict(t, state.times[:points], state.u[:points])
    scale, power = error_factor(control.order, t, state.times)
    error = scheme.error_norm(scale * (solved.u - predicted), solved.u)
    factor = SAFETY * max(error, 1e-12) ** (-1.0 / power)
    return factor, error
