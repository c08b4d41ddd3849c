"""The time loop on small problems with closed solutions: formulas, orders, error control, stops, breaks, failures, restart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from multiphase.errors import SolverError
from multiphase.stepping import (
    Control,
    Snapshot,
    Solved,
    State,
    StepFailure,
    StopRun,
    Tracker,
    advance,
    error_factor,
    formula,
    integrate,
    landing,
    predict,
    start,
)

TIMES = (0.0, 0.1, 0.2, 0.30000000000000004, 1.0 / 3.0, 0.7, 1.0)


class Toy:
    """``y' = f(t, y)`` with the implicit step solved in closed form by `step(t, alpha, past)`."""

    breaks: tuple[float, ...] = ()
    kinks: tuple[float, ...] = ()

    def __init__(self, y0: float, step: Callable[[float, float, Any], Any], rtol: float = 1e-5) -> None:
        self.y0, self.step, self.rtol = y0, step, rtol
        self.solved: list[float] = []
        self.made_consistent: list[float] = []

    def initial(self) -> Any:
        return np.array([self.y0])

    def consistent(self, t: float, u: Any) -> Any:
        self.made_consistent.append(t)
        return u.copy()

    def solve(self, t: float, alpha: float, past: Any, guess: Any) -> Solved:
        self.solved.append(t)
        return Solved(np.asarray(self.step(t, alpha, past), dtype=float), 1)

    def error_norm(self, error: Any, u: Any) -> float:
        return float(np.max(np.abs(error))) / self.rtol

    def observe(self, t: float, u: Any) -> Snapshot:
        return Snapshot(t, {"y": float(u[0])}, {}, np.zeros(1))


class Log(Tracker):
    """Keeps every state and every snapshot."""

    def __init__(self) -> None:
        self.states: list[State] = []
        self.saved: list[Snapshot] = []
        self.ends: list[float] = []

    def on_start(self, state: State, t_end: float) -> None:
        self.states.append(state)
        self.ends.append(t_end)

    def on_step(self, state: State) -> None:
        self.states.append(state)

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.saved.append(snapshot)

    @property
    def steps(self) -> Any:
        return np.diff([state.t for state in self.states])


def riccati(rtol: float = 1e-5) -> Toy:
    """y' = -y^2, y(0) = 1, so y = 1/(1 + t)."""
    return Toy(1.0, lambda t, alpha, past: (-alpha + np.sqrt(alpha**2 + 4.0 * alpha * past)) / 2.0, rtol)


def forced(rtol: float = 1e-5, rate: float = 1.0) -> Toy:
    """y' = -rate (y - cos t) - sin t, y(0) = 1, so y = cos t."""
    return Toy(1.0, lambda t, alpha, past: (alpha * past + rate * math.cos(t) - math.sin(t)) / (alpha + rate), rtol)


def line() -> Toy:
    """y' = 1: every formula is exact on it, so only the loop's choices show."""
    return Toy(0.0, lambda t, alpha, past: past + 1.0 / alpha)


def solve(scheme: Any, save_at: Any = (0.0, 1.0), control: Control | None = None, *trackers: Tracker) -> tuple[State, Log]:
    control = control or Control()
    log = Log()
    return integrate(scheme, start(scheme, save_at[0], save_at[1], control), save_at, control, [log, *trackers]), log


# -- formulas ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_second_order_formula_is_exact_for_quadratics_at_random_steps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=3)

    def y(t: Any) -> Any:
        return a + b * t + c * t * t

    for _ in range(20):
        times = np.cumsum(rng.uniform(0.05, 1.0, size=2))[::-1]
        t = times[0] + rng.uniform(0.02, 2.4) * (times[0] - times[1])
        alpha, past = formula(2, t, times, y(times)[:, None])
        # Rounding: values of order 10, alpha up to 1e3.
        assert alpha * (y(t) - past[0]) == pytest.approx(b + 2.0 * c * t, abs=1e-11)


def test_first_order_formula_and_short_history_are_backward_euler() -> None:
    times, u = np.array([1.0, 0.5]), np.array([[3.0], [7.0]])
    for order, points in ((1, 2), (2, 1)):
        alpha, past = formula(order, 1.25, times[:points], u[:points])
        assert alpha == 4.0
        assert past == 3.0


def test_second_order_formula_at_constant_steps_has_the_textbook_coefficients() -> None:
    alpha, past = formula(2, 2.0, np.array([1.0, 0.0]), np.array([[3.0], [6.0]]))
    assert alpha == pytest.approx(1.5, rel=1e-15)
    assert past[0] == pytest.approx((4.0 * 3.0 - 6.0) / 3.0, rel=1e-15)


@pytest.mark.parametrize("points", [1, 2, 3])
def test_predictor_is_exact_for_polynomials_through_its_points(points: int) -> None:
    rng = np.random.default_rng(points)
    for _ in range(20):
        times = np.cumsum(rng.uniform(0.1, 1.0, size=points))[::-1]
        polynomial = np.polynomial.Polynomial(rng.normal(size=points))
        t = times[0] + rng.uniform(0.1, 1.0)
        # Rounding: Lagrange weights up to 1e3 at these spacings.
        assert predict(t, times, polynomial(times)[:, None])[0] == pytest.approx(polynomial(t), abs=1e-11)


def test_error_factor_at_constant_steps() -> None:
    assert error_factor(2, 3.0, np.array([2.0, 1.0, 0.0])) == (pytest.approx(2.0 / 11.0, rel=1e-15), 3)
    assert error_factor(1, 2.0, np.array([1.0, 0.0])) == (pytest.approx(1.0 / 3.0, rel=1e-15), 2)


def test_error_factor_of_a_short_history_is_the_predictors_own_error() -> None:
    assert error_factor(2, 1.0, np.array([0.5, 0.0])) == (1.0, 2)
    assert error_factor(2, 1.0, np.array([0.5])) == (1.0, 1)
    assert error_factor(1, 1.0, np.array([0.5])) == (1.0, 1)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_error_estimate_is_the_local_error_at_random_steps(order: int, seed: int) -> None:
    """On t^(order+1) the estimate is exact: the formula and the predictor each err by one multiple of that derivative."""
    rng = np.random.default_rng(seed)
    power = order + 1
    times = np.cumsum(rng.uniform(0.2, 1.0, size=order + 1))[::-1]
    t = times[0] + rng.uniform(0.2, 1.0)
    u = (times**power)[:, None]
    alpha, past = formula(order, t, times, u)
    solved = past[0] + power * t ** (power - 1) / alpha
    factor, _ = error_factor(order, t, times)
    predicted = predict(t, times, u)[0]
    # One tenth of a thousandth: rounding alone, errors being of order 0.1. The sign is the convention (new - true).
    assert factor * (solved - predicted) == pytest.approx(solved - t**power, rel=1e-4, abs=1e-12)


# -- orders -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("order", "low", "high"), [(1, 0.95, 1.1), (2, 1.93, 2.1)])
@pytest.mark.parametrize("problem", [riccati, forced])
def test_observed_order_at_fixed_steps(problem: Callable[[], Toy], order: int, low: float, high: float) -> None:
    exact = {riccati: 0.5, forced: math.cos(1.0)}[problem]
    errors = []
    for steps in (40, 80, 160, 320):
        state, log = solve(problem(), (0.0, 1.0), Control(order=order, dt=1.0 / steps))
        assert len(log.steps) == pytest.approx(steps, abs=1)  # the sum of 1/steps may round past the end
        errors.append(abs(float(state.u[0, 0]) - exact))
    observed = np.log2(np.divide(errors[:-1], errors[1:]))
    assert low < observed[-1] < high


def test_fixed_steps_stay_second_order_when_output_times_shorten_them() -> None:
    errors = []
    for steps in (40, 80, 160):
        state, _ = solve(forced(), (0.0, 0.123, 1.0 / 3.0, 0.777, 1.0), Control(dt=1.0 / steps))
        errors.append(abs(float(state.u[0, 0]) - math.cos(1.0)))
    # Where the output times fall within a step differs between the runs, so single ratios scatter; over both it is 2 +- 0.2.
    assert math.log2(errors[0] / errors[2]) / 2.0 > 1.8


# -- error control ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2])
def test_global_error_follows_the_tolerance(order: int) -> None:
    errors, counts = [], []
    tolerances = (1e-3, 1e-5, 1e-7) if order == 2 else (1e-3, 1e-4, 1e-5)
    for rtol in tolerances:
        state, _ = solve(riccati(rtol), (0.0, 2.0), Control(order=order))
        errors.append(abs(float(state.u[0, 0]) - 1.0 / 3.0))
        counts.append(state.counters["steps"])
    # Controlled local errors of h^(p+1) give global errors of rtol^(p/(p+1)): factors 21 (order 2) and 3.2 (order 1) a stage.
    least = 10.0 if order == 2 else 2.2
    assert errors[0] > least * errors[1] > least**2 * errors[2]
    assert counts[0] < counts[1] < counts[2]
    # Each step errs by the tolerance at most, and the problem damps what went before.
    assert all(error < count * rtol for error, count, rtol in zip(errors, counts, tolerances, strict=True))


def test_steps_grow_where_the_solution_is_smooth_and_shrink_at_a_front() -> None:
    """A ramp of width 0.01 at t = 0.5: the steps there are far below those before."""
    scheme = Toy(0.0, lambda t, alpha, past: past + 1.0 / (alpha * (1.0 + ((t - 0.5) / 0.01) ** 2)), 1e-5)
    state, log = solve(scheme, (0.0, 1.0))
    middles = np.array([s.t for s in log.states])[1:] - 0.5 * log.steps
    inside, before = log.steps[abs(middles - 0.5) < 0.01], log.steps[(middles > 0.2) & (middles < 0.4)]
    assert inside.max() < 0.3 * before.max()
    assert state.counters["rejected_error"] > 0
    # The errors of the steps add up, each at most the tolerance.
    assert float(state.u[0, 0]) == pytest.approx(0.02 * math.atan(50.0), abs=1e-5 * state.counters["steps"])


def test_rejected_steps_are_counted_and_not_stored() -> None:
    scheme = riccati(1e-6)
    state, log = solve(scheme, (0.0, 1.0))
    assert state.counters["rejected_error"] > 0
    assert len(scheme.solved) == state.counters["steps"] + state.counters["rejected_error"]
    assert state.counters["steps"] == len(log.steps)
    assert state.counters["iterations"] == len(scheme.solved)


def test_step_ratio_never_exceeds_two() -> None:
    crowded = (0.0, 1e-4, 0.5, 0.501, 3.0)
    for save_at, control in (((0.0, 3.0), Control()), (crowded, Control()), (crowded, Control(dt=0.05))):
        _, log = solve(line(), save_at, control)  # no error at all, so steps grow as fast as allowed
        ratios = log.steps[1:] / log.steps[:-1]
        assert ratios.max() <= 2.0 * (1.0 + 1e-8)  # landing may stretch a step by 1e-9
        assert ratios.max() > 1.9


def test_fixed_step_is_used_as_given_and_never_rejected_for_its_error() -> None:
    state, log = solve(riccati(1e-14), (0.0, 1.0), Control(dt=0.125))
    assert np.all(log.steps == 0.125)
    assert state.counters["rejected_error"] == 0


def test_an_error_that_is_not_a_number_rejects_the_step() -> None:
    class Lost(Toy):
        def error_norm(self, error: Any, u: Any) -> float:
            return math.nan

    with pytest.raises(SolverError) as caught:
        solve(Lost(1.0, lambda t, alpha, past: past))
    assert caught.value.time == 0.0
    assert "local error nan" in str(caught.value)


# -- stops ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("control", [Control(), Control(dt=0.07), Control(order=1)])
def test_output_times_are_met_bit_for_bit(control: Control) -> None:
    _, log = solve(riccati(1e-4), TIMES, control)
    assert [snapshot.t for snapshot in log.saved] == list(TIMES)
    assert set(TIMES) <= {state.t for state in log.states}
    assert log.ends == [1.0]


def test_dense_output_times_do_not_cost_accuracy() -> None:
    save_at = tuple(np.linspace(0.0, 2.0, 101))
    state, log = solve(riccati(1e-6), save_at)
    values = np.array([snapshot.scalars["y"] for snapshot in log.saved])
    assert np.max(np.abs(values - 1.0 / (1.0 + np.array(save_at)))) < 1e-6 * state.counters["steps"]
    assert state.counters["steps"] < 250  # 100 output times, and about 130 steps without them


def test_landing_leaves_no_sliver() -> None:
    for dt in np.linspace(0.05, 2.0, 400):
        t, steps = 0.0, []
        while t < 1.0:
            new = landing(t, float(dt), 1.0)
            steps.append(new - t)
            t = new
        assert t == 1.0
        # The last steps are halves of what remains, which is more than one step.
        assert min(steps) > 0.499 * min(dt, 1.0)
        assert max(steps) <= dt * (1.0 + 1e-8)


def test_a_step_that_would_just_miss_a_stop_is_stretched_onto_it() -> None:
    assert landing(0.0, 1.0 - 1e-12, 1.0) == 1.0
    assert landing(0.9, 0.1, 1.0) == 1.0


def test_a_shortened_step_does_not_make_the_next_one_short() -> None:
    """After landing, the step returns at once to what the error allowed (within the ratio of two)."""
    _, log = solve(line(), (0.0, 1.0, 1.0 + 1e-3, 10.0))
    after = [h for state, h in zip(log.states[1:], log.steps, strict=True) if state.t > 1.0]
    # 1e-3 doubles each time: 12 doublings reach 4, and a few more steps the end.
    assert len(after) < 18


def test_a_step_shortened_to_land_keeps_the_size_that_the_error_allows() -> None:
    class Steady(Toy):
        """Every step is about as large as it may be: the growth factor is 0.85 / 0.6^(1/3) = 1.008."""

        def error_norm(self, error: Any, u: Any) -> float:
            return 0.6

    state = State(np.array([0.9, 0.5, 0.1]), np.zeros((3, 1)), 0.4)
    scheme = Steady(0.0, lambda t, alpha, past: past)
    assert advance(scheme, state, 1.2, Control()).dt == 0.4
    assert advance(scheme, state, 1.0, Control()).dt == pytest.approx(0.2, rel=1e-12)  # but twice the step at most
    assert advance(scheme, state, 9.0, Control()).dt == pytest.approx(0.4 * 0.85 / 0.6 ** (1.0 / 3.0), rel=1e-12)


def test_an_output_time_at_the_start_is_stored_without_a_step() -> None:
    scheme = riccati()
    state, log = solve(scheme, (0.0, 0.5))
    again = Log()
    integrate(scheme, state, (0.5,), Control(), [again])
    assert [s.t for s in again.saved] == [0.5]
    assert len(again.steps) == 0
    assert log.saved[0].t == 0.0


# -- breaks -----------------------------------------------------------------------------------------------------------

JUMP = 1.0 / 3.0


def jumping(breaks: bool, rtol: float = 1e-6) -> Toy:
    """y' = -y + (0 up to JUMP, 10 after), y(0) = 1; the value at the jump is that of the left."""
    scheme = Toy(1.0, lambda t, alpha, past: (alpha * past + (10.0 if t > JUMP else 0.0)) / (alpha + 1.0), rtol)
    if breaks:
        scheme.breaks = (JUMP,)
    return scheme


JUMP_EXACT = (math.exp(-JUMP) - 10.0) * math.exp(JUMP - 1.0) + 10.0


def test_history_starts_anew_at_a_break() -> None:
    scheme = jumping(True)
    _, log = solve(scheme, (0.0, 1.0))
    assert sum(state.t == JUMP for state in log.states) == 1
    assert scheme.made_consistent == [JUMP]
    after = next(state for state in log.states if state.t > JUMP)
    assert after.times[1:].tolist() == [JUMP]  # nothing of before
    before = [state for state in log.states if state.t < JUMP][-1]
    assert after.t - JUMP < 0.1 * before.dt


def test_a_row_stored_at_a_break_is_from_before_it() -> None:
    scheme = jumping(True)
    _, log = solve(scheme, (0.0, JUMP, 1.0))
    stored = next(snapshot for snapshot in log.saved if snapshot.t == JUMP)
    reached = next(state for state in log.states if state.t == JUMP)
    assert stored.scalars["y"] == reached.u[0, 0]
    assert len(reached.times) == 3  # the history is forgotten when the run goes on


def test_a_run_that_is_resumed_at_a_break_goes_on_as_if_it_had_not_stopped() -> None:
    whole, _ = solve(jumping(True), (0.0, JUMP, 1.0))
    control = Control()
    scheme = jumping(True)
    part = integrate(scheme, start(scheme, 0.0, JUMP, control), [0.0, JUMP], control)
    part = integrate(jumping(True), State.from_arrays(part.to_arrays()), [1.0], control)
    assert part.u.tobytes() == whole.u.tobytes()


def test_fixed_steps_stay_second_order_across_a_break() -> None:
    errors: dict[bool, list[float]] = {}
    for breaks, steps in itertools.product((True, False), (60, 120)):
        state, _ = solve(jumping(breaks), (0.0, 1.0), Control(dt=1.0 / steps))
        errors.setdefault(breaks, []).append(abs(float(state.u[0, 0]) - JUMP_EXACT))
    assert math.log2(errors[True][0] / errors[True][1]) > 1.8
    assert errors[True][1] < 0.1 * errors[False][1]


def test_error_control_keeps_its_accuracy_across_a_break() -> None:
    state, _ = solve(jumping(True), (0.0, 1.0))
    assert abs(float(state.u[0, 0]) - JUMP_EXACT) < 2e-4  # rtol 1e-6: (1e-6)^(2/3) = 1e-4 for a solution of size 10


def test_a_break_at_an_output_time_is_met_once() -> None:
    scheme = jumping(True)
    _, log = solve(scheme, (0.0, JUMP, 1.0))
    assert [s.t for s in log.saved] == [0.0, JUMP, 1.0]
    assert scheme.made_consistent == [JUMP]


def test_a_step_ends_at_a_kink_and_the_history_goes_on() -> None:
    scheme = jumping(False)
    scheme.kinks = (0.1234,)
    seen: list[State] = []

    class Watch(Tracker):
        def on_step(self, state: State) -> None:
            seen.append(state)

    control = Control(dt=0.05)
    integrate(scheme, start(scheme, 0.0, 0.4, control), [0.0, 0.4], control, [Watch()])
    at = [state for state in seen if state.t == 0.1234]
    assert len(at) == 1
    assert len(at[0].times) == 3


def test_breaks_outside_the_run_do_nothing() -> None:
    plain, _ = solve(riccati(), (0.0, 1.0))
    scheme = riccati()
    scheme.breaks = (-1.0, 0.0, 2.0)
    state, _ = solve(scheme, (0.0, 1.0))
    assert state.u[0, 0] == plain.u[0, 0]
    assert scheme.made_consistent == []


# -- failures ---------------------------------------------------------------------------------------------------------


class Failing(Toy):
    """y' = 1 whose step fails where `bad(t, 1/alpha)` says so."""

    def __init__(self, bad: Callable[[float, float], bool], how: Callable[[], Any] | None = None) -> None:
        super().__init__(0.0, lambda t, alpha, past: past + 1.0 / alpha)
        self.bad, self.how = bad, how

    def solve(self, t: float, alpha: float, past: Any, guess: Any) -> Solved:
        solved = super().solve(t, alpha, past, guess)
        if self.bad(t, 1.0 / alpha):
            if self.how is None:
                raise StepFailure("the iteration went astray")
            return Solved(np.full(1, self.how()), 1)
        return solved


def test_a_failed_step_is_halved_and_counted() -> None:
    scheme = Failing(lambda t, h: h > 0.3)
    state, log = solve(scheme, (0.0, 1.0), Control(order=1, dt=1.0))
    assert scheme.solved[:3] == [1.0, 0.5, 0.25]
    assert log.states[1].t == 0.25
    assert state.counters["rejected_solver"] == len(scheme.solved) - state.counters["steps"] > 0
    assert state.t == 1.0


def test_repeated_failure_says_when_how_small_and_why() -> None:
    scheme = Failing(lambda t, h: t > 0.5)
    with pytest.raises(SolverError) as caught:
        solve(scheme, (0.0, 0.5, 1.0), Control(dt=0.125, attempts=5))
    error = caught.value
    assert error.time == 0.5
    assert f"t = {error.time:.6g}" in str(error)
    assert f"dt = {error.dt:.3g}" in str(error)
    assert "the iteration went astray" in str(error)
    assert len(error.history) == 5
    sizes = [float(reason.split()[2].rstrip(":")) for reason in error.history]
    assert all(b == pytest.approx(a / 2.0, rel=5e-3) for a, b in itertools.pairwise(sizes))  # printed with three digits


def test_steps_below_rounding_are_not_tried() -> None:
    scheme = Failing(lambda t, h: t > 0.5)
    with pytest.raises(SolverError) as caught:
        solve(scheme, (0.0, 0.5, 1.0), Control(dt=0.125, attempts=1000))
    assert len(scheme.solved) < 50  # 4 steps, and 1e-13 is 43 halvings
    assert len(caught.value.history) == 12  # the last dozen
    assert caught.value.dt < 1e-12


def test_history_keeps_rejections_by_the_error_too() -> None:
    class Rough(Toy):
        def error_norm(self, error: Any, u: Any) -> float:
            return 7.5

    with pytest.raises(SolverError) as caught:
        solve(Rough(1.0, lambda t, alpha, past: past), (0.0, 1.0), Control(attempts=4))
    assert all("local error 7.5 times the tolerance" in reason for reason in caught.value.history)
    assert len(caught.value.history) == 4


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite_fail_the_step(value: float) -> None:
    with pytest.raises(SolverError, match="not finite"):
        solve(Failing(lambda t, h: t > 0.5, lambda: value), (0.0, 1.0))


def test_floating_point_errors_fail_the_step() -> None:
    def divide() -> Any:
        with np.errstate(all="raise"):
            return np.float64(1.0) / np.float64(0.0)

    with pytest.raises(SolverError, match="floating-point error"):
        solve(Failing(lambda t, h: t > 0.5, divide), (0.0, 1.0))


def test_the_number_of_steps_is_limited() -> None:
    scheme = riccati()
    log = Log()
    control = Control(dt=0.1, max_steps=4)
    with pytest.raises(SolverError, match="max_steps = 4") as caught:
        integrate(scheme, start(scheme, 0.0, 1.0, control), (0.0, 1.0), control, [log])
    assert len(log.steps) == 4
    assert caught.value.time == log.states[-1].t


def test_a_tracker_may_stop_the_run() -> None:
    class Stop(Tracker):
        def on_step(self, state: State) -> None:
            if state.counters["steps"] == 3:
                raise StopRun("three are enough")

    with pytest.raises(StopRun, match="three are enough"):
        solve(riccati(), (0.0, 1.0), None, Stop())


# -- restart ----------------------------------------------------------------------------------------------------------


def test_state_survives_its_arrays() -> None:
    state, _ = solve(forced(), (0.0, 1.0))
    arrays = state.to_arrays()
    again = State.from_arrays({name: np.array(values) for name, values in arrays.items()})
    assert again.times.tobytes() == state.times.tobytes()
    assert again.u.tobytes() == state.u.tobytes()
    assert again.dt == state.dt
    assert again.counters == state.counters
    assert len(state.times) == 3


@pytest.mark.parametrize("control", [Control(), Control(order=1), Control(dt=0.013)])
@pytest.mark.parametrize("problem", [forced, lambda: jumping(True, 1e-4)])
def test_a_run_split_at_any_state_continues_bit_for_bit(problem: Callable[[], Toy], control: Control) -> None:
    whole, log = solve(problem(), TIMES, control)
    for state in log.states[:: max(1, len(log.states) // 25)]:
        arrays = {name: np.array(values) for name, values in state.to_arrays().items()}
        rest, later = Log(), [t for t in TIMES if t >= state.t]
        end = integrate(problem(), State.from_arrays(arrays), later, control, [rest])
        assert end.u.tobytes() == whole.u.tobytes()
        assert end.times.tobytes() == whole.times.tobytes()
        assert (end.dt, end.counters) == (whole.dt, whole.counters)
        assert [s.scalars["y"] for s in rest.saved] == [s.scalars["y"] for s in log.saved if s.t >= state.t]


def test_a_step_leaves_the_state_it_started_from_alone() -> None:
    _, log = solve(riccati(), (0.0, 1.0))
    copies = [replace(state, times=state.times.copy(), u=state.u.copy()) for state in log.states]
    integrate(riccati(), log.states[5], (1.0,), Control())
    for state, copy in zip(log.states, copies, strict=True):
        assert np.array_equal(state.u, copy.u)
        assert np.array_equal(state.times, copy.times)
        assert state.counters == copy.counters
