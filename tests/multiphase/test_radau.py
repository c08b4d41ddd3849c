"""Radau IIA where one tangent fails, and TR-BDF2 takes the step: cost, error, values in between, resuming."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from multiphase import lines, newton, radau
from multiphase.errors import SolverError
from multiphase.stepping import Control, State, Tracker, integrate, start

STOPS = np.array([0.3, 0.45, 0.5, 0.62, 0.8])
STIFF = 1e6
T_END = 1.5


def pressed(t: float, y: Any) -> Any:
    """Driven, and held by walls of stiffness STIFF, which one unknown after another meets."""
    return 1.0 + 0.5 * np.cos(3.0 * t) - STIFF * np.where(np.real(y) > STOPS, y - STOPS, 0.0)


def held(t: float) -> Any:
    """The solution, to 2/STIFF: the wall gives by that."""
    return np.minimum(t + np.sin(3.0 * t) / 6.0, STOPS)


class Log(Tracker):
    def __init__(self) -> None:
        self.states: list[State] = []

    def on_step(self, state: State) -> None:
        self.states.append(state)


def run(own: Any, f: Any, initial: Any, rtol: float, t_end: float = T_END, state: State | None = None, **control: Any) -> list[State]:
    """The states after each step, from the start or a given one."""
    model = own.Model(f, np.ones(len(initial)), tolerance=rtol)
    body, settings, log = own.Body(model, initial), Control(**control), Log()
    begin = state or start(body, 0.0, t_end, settings)
    integrate(body, begin, [t_end], settings, [log])
    return [begin, *log.states]


@pytest.fixture(autouse=True)
def _every_step_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "VALUES_PER_CALL", 1)


def failing(*arguments: Any) -> tuple[int, int, float]:
    return newton.DIVERGED, 1, 1.0


@pytest.fixture
def only(integrators: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Lets one of the two methods fail wherever it is tried."""

    def without(name: str) -> None:
        monkeypatch.setitem(integrators.kernel.entries, "advance", integrators.plain(integrators.kernel.advance, **{name: failing}))

    return without


@pytest.mark.parametrize("points", [1, 3, 4])
def test_the_polynomial_through_the_points_and_its_derivative(points: int) -> None:
    rng = np.random.default_rng(points)
    times = np.array([1.0, 0.6449489742783178, 0.15505102572168223, 0.0])[:points]
    coefficients = rng.normal(size=(points, 3))  # lowest first
    past, out = np.polynomial.polynomial.polyval(times, coefficients).T, np.empty(3)
    for t in (0.0, 0.3, 0.7, 1.0, 1.4):
        radau.interpolate(times, past, t, out)
        np.testing.assert_allclose(out, np.polynomial.polynomial.polyval(t, coefficients), atol=1e-13)  # rounding: weights to 20
        radau.differentiate(times, past, t, out)
        np.testing.assert_allclose(out, np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(coefficients)), atol=1e-12)


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5, 1e-6])
def test_kinks_are_crossed_in_a_few_steps_within_the_tolerance(integrators: Any, rtol: float) -> None:
    states = run(integrators, pressed, np.zeros(5), rtol)
    counters = states[-1].counters
    assert counters["steps"] <= 40  # a few for each of five kinks, and order two in between with 1e-6
    assert counters["iterations"] <= 300
    assert counters["rejected_solver"] + counters["rejected_error"] <= 50
    assert any(len(state.times) == 3 for state in states)
    for state in states[1:]:
        assert np.abs(state.u[0] - held(state.t)).max() < 10.0 * rtol + 2.0 / STIFF


def test_without_the_other_method_no_step_succeeds(integrators: Any, only: Any) -> None:
    only("two_stages")
    with pytest.raises(SolverError, match=r"does not converge"):
        run(integrators, pressed, np.zeros(5), 1e-4)


def test_radau_comes_back_after_the_last_kink(integrators: Any) -> None:
    """All five are held from t = 0.72 on: t + sin(3 t)/6 = 0.8 there. Radau is tried again at every `radau.RETRY`th step."""
    states = run(integrators, pressed, np.zeros(5), 1e-4, 3.0)
    crossing = [state.t for state in states if len(state.times) == 3]
    after = [len(state.times) for state in states if state.times[-1] > 0.75]
    assert crossing
    assert after.count(3) < 2 * radau.RETRY
    assert 4 in after


def smooth(t: float, y: Any) -> Any:
    """A turn by one radian a unit of time."""
    return np.stack([-y[..., 1], y[..., 0]], axis=-1)


@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_trbdf2_alone_keeps_to_the_tolerance_and_so_do_values_in_between(integrators: Any, only: Any, rtol: float) -> None:
    """Each step adds at most a third of a tolerance (CAUTION) in either unknown, which a turn keeps; the quadratic in between less."""
    only("solve_stages")
    states = run(integrators, smooth, [1.0, 0.0], rtol, 2.0)
    assert all(len(state.times) == 3 for state in states[1:])
    assert len(states) < 3.0 * rtol ** (-1.0 / 3.0)
    body = integrators.Body(integrators.Model(smooth, np.ones(2), tolerance=rtol), [1.0, 0.0])
    allowed = (1.0 + 0.71 * len(states)) * rtol
    for before, state in itertools.pairwise(states):
        assert np.array_equal(state.times[2:], before.times[:1])
        assert np.array_equal(state.u[2], before.u[0])
        h = state.t - before.t
        assert state.times[1] == pytest.approx(before.t + (2.0 - np.sqrt(2.0)) * h, rel=1e-14)
        wanted = [before.t, *(before.t + share * h for share in (0.1, 0.5, 0.8)), state.t]
        shots = body.between(wanted, state)
        np.testing.assert_allclose(shots[0].fields["y"], before.u[0], atol=1e-15)
        np.testing.assert_array_equal(shots[-1].fields["y"], state.u[0])
        for t, shot in zip(wanted, shots, strict=True):
            exact = np.array([np.cos(t), np.sin(t)])
            assert np.abs(shot.fields["y"] - exact).max() < allowed
            assert np.abs(shot.x - [-exact[1], exact[0]]).max() < 0.5 * h**2 + 10.0 * rtol  # of a quadratic: h^2/3 at its ends


@pytest.mark.parametrize("fails", [1, 4, 10**6])
def test_a_fixed_step_is_halved_before_the_other_method_takes_it(integrators: Any, monkeypatch: pytest.MonkeyPatch, fails: int) -> None:
    """HALVINGS times, if Radau fails that often; where it never succeeds the steps are small, but no smaller from step to step."""
    tried: list[float] = []
    radau_stages = integrators.kernel.advance.__globals__["solve_stages"]

    def stages(data: Any, mass: Any, times: Any, past: Any, points: int, h: float, *rest: Any) -> Any:
        tried.append(h)
        return failing() if len(tried) <= fails else radau_stages(data, mass, times, past, points, h, *rest)

    monkeypatch.setitem(integrators.kernel.entries, "advance", integrators.plain(integrators.kernel.advance, solve_stages=stages))
    states = run(integrators, smooth, [1.0, 0.0], 1e-3, 1.0, dt=0.25)
    halved = min(fails, radau.HALVINGS)
    np.testing.assert_allclose(tried[: halved + 1], 0.25 * 0.5 ** np.arange(halved + 1))
    assert len(states[1].times) == (4 if fails <= radau.HALVINGS else 3)
    assert 0.5 * tried[halved] <= states[1].t <= tried[halved]
    assert states[-1].counters["steps"] <= 2 * 2 ** (radau.HALVINGS + 1) / 0.25
    assert np.abs(states[-1].u[0] - [np.cos(1.0), np.sin(1.0)]).max() < 1e-3  # of order two, h^2/10 in steps below 1/16 or so


def test_a_step_without_error_control_lands_and_grows_back(integrators: Any) -> None:
    states = run(integrators, pressed, np.zeros(5), 1e-5, dt=0.02)
    assert {len(state.times) for state in states[1:]} == {3, 4}
    assert max(np.diff([state.t for state in states])) <= 0.02 * (1.0 + 1e-12)
    assert states[-1].counters["steps"] < 4 * T_END / 0.02
    assert states[-1].t == T_END
    assert np.abs(states[-1].u[0] - held(T_END)).max() < 1e-4 + 2.0 / STIFF


def test_what_goes_on_from_any_step_ends_the_same_bit_for_bit(integrators: Any) -> None:
    states = run(integrators, pressed, np.zeros(5), 1e-4)
    kinds = set()
    for state in states[1:-1]:
        arrays = {name: array.copy() for name, array in state.to_arrays().items()}
        again = run(integrators, pressed, np.zeros(5), 1e-4, state=State.from_arrays(arrays))[-1]
        kinds.add(len(state.times))
        for name, array in states[-1].to_arrays().items():
            np.testing.assert_array_equal(array, again.to_arrays()[name])
    assert kinds == {3, 4}
