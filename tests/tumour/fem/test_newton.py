"""Newton's method on meshes: how it converges, what is kept from step to step, how far it may go, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase.stepping import StepFailure
from tumour import meshes
from tumour.fem.newton import Point, Step


def grown(make: Any, run: Any, t: float, rings: int = 6, **changes: Any) -> tuple[Any, np.ndarray]:
    """A scheme, and its vector at `t`."""
    scheme = make(meshes.quarter_disk(1.0, rings), **{"newton_tol": 1e-10, **changes})
    return scheme, run(scheme, [t])[0].u[0]


def step_from(scheme: Any, u: np.ndarray, tau: float) -> Step:
    """Backward Euler from the vector `u`."""
    loads, bubble_loads = (array.copy() for array in scheme.loads(0.0, tau))
    moments = scheme.rest(u)[0]
    loads[:, 3] += moments[1]
    if not scheme.printed:
        loads[:, 2] += moments[0]
    return Step(tau, loads, bubble_loads, scheme.point(u), scheme.acting)


@pytest.mark.parametrize(
    "changes", [{}, {"kappa": 0.0}, {"lambda_alpha": 1.0, "mobility": "darcy", "Q1_hat": 2.0}, {"alpha_step": "as-printed"}], ids=str
)
def test_newton_converges_quadratically_away_from_the_kink(make_mini: Any, run_elastic: Any, changes: dict[str, Any]) -> None:
    """At t = 10 every cell is in contact. With a new tangent each time, each change is the square of the last but for a constant, until
    rounding."""
    control = {"order": 1, "dt": 1.0} if "alpha_step" in changes else {}
    scheme = make_mini(meshes.quarter_disk(1.0, 6), newton_tol=1e-10, **changes)
    u = run_elastic(scheme, [10.0], **control)[0].u[0]
    newton, step, point, sizes = scheme.newton, step_from(scheme, u, 1.0), scheme.point(u.copy()), []
    for _ in range(6):
        assert newton.make(step, point) < 0
        change = newton._change()
        sizes.append(newton._size(change, point))
        point = point.moved(change, 1.0)
    sizes = np.array(sizes)
    assert sizes[0] > 1e-2
    assert np.all((sizes[1:] / sizes[:-1] ** 2 < 20.0) | (sizes[1:] < 1e-12))
    assert np.count_nonzero(sizes > 1e-12) <= 5
    assert sizes[-1] < 1e-13


def test_newton_crosses_the_kink(make_mini: Any, run_elastic: Any) -> None:
    """A step of backward Euler in which the fraction falls below alpha_min at many points."""
    scheme, u = grown(make_mini, run_elastic, 10.0, Q=3.0, newton_tol=1e-6)
    solved = scheme.solve(0.0, 1.0 / 8.0, u, u)
    before, after = scheme.point(u).nodal[:, 2], scheme.point(solved.u).nodal[:, 2]
    assert np.count_nonzero((after < 0.8) & (before > 0.8)) >= 5
    assert solved.iterations <= 20
    again = scheme.solve(0.0, 1.0 / 8.0, u, solved.u)
    assert scheme.newton._size(Point(scheme.point(again.u - solved.u).nodal, np.zeros(0)), scheme.point(solved.u)) < 2e-6


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_the_error_left_is_within_the_tolerance(make_mini: Any, run_elastic: Any, tolerance: float) -> None:
    """In every step of a run with a tangent that grows old, against the same step solved to 1e-12; ten times the tolerance where the
    contraction is misjudged."""
    scheme, exact = make_mini(newton_tol=tolerance), make_mini(newton_tol=1e-12)
    solve, errors = scheme.solve, []

    def watched(t: float, alpha: float, past: np.ndarray, guess: np.ndarray) -> Any:
        solved = solve(t, alpha, past, guess)
        other = exact.solve(t, alpha, past, guess)
        off = Point(exact.point(solved.u - other.u).nodal, np.zeros(0))
        errors.append(exact.newton._size(off, exact.point(other.u)))
        return solved

    scheme.solve = watched
    run_elastic(scheme, [50.0], dt=0.5)
    assert len(errors) == 101  # 100, and the one that begins the run
    assert max(errors) < 10.0 * tolerance
    assert np.median(errors) < tolerance
    assert np.median(errors) > 1e-6 * tolerance  # no more is done than is asked


def test_a_tangent_is_kept_from_step_to_step(make_mini: Any, run_elastic: Any) -> None:
    """While the body grows smoothly a tangent lasts for ten steps and more, through steps that change slowly; and what comes out is what
    comes out with a tangent of every step's own."""
    scheme = make_mini(meshes.quarter_disk(1.0, 6))
    state, stored = run_elastic(scheme, [40.0], dt=0.25)
    counts = scheme.statistics()
    assert state.counters["steps"] == 160
    assert counts["factorisations"] == counts["assemblies"] < 16
    assert counts["linear_solves"] >= state.counters["iterations"] >= 160
    fresh = make_mini(meshes.quarter_disk(1.0, 6))
    solve = fresh.solve

    def forgetful(*arguments: Any) -> Any:
        fresh.newton.forget()
        return solve(*arguments)

    fresh.solve = forgetful
    _, other = run_elastic(fresh, [40.0], dt=0.25)
    assert fresh.statistics()["factorisations"] >= 160
    assert stored[-1].scalars["radius"] == pytest.approx(other[-1].scalars["radius"], rel=1e-5)  # ten tolerances
    assert np.abs(stored[-1].fields["alpha"] - other[-1].fields["alpha"]).max() < 1e-5


def test_every_step_makes_an_iteration(make_mini: Any, run_elastic: Any) -> None:
    """Also from a guess that is the solution, and with a tolerance that any guess meets: the equations are never left unseen."""
    for tolerance in (1e-10, 1e-2):
        scheme = make_mini(newton_tol=tolerance, rtol=max(tolerance, 1e-4))
        u = run_elastic(scheme, [5.0], dt=0.5)[0].u[0]
        first = scheme.solve(6.0, 1.0, u, u)
        again = scheme.solve(6.0, 1.0, u, first.u)
        assert first.iterations >= 1
        assert again.iterations >= 1
        assert np.abs(again.u - first.u).max() < 10.0 * tolerance
    residuals = scheme.statistics()["residuals"]
    scheme.solve(6.0, 1.0, u, again.u)
    assert scheme.statistics()["residuals"] > residuals


def test_a_guess_out_of_bounds_is_replaced(make_mini: Any, run_elastic: Any) -> None:
    """By the past, whether a triangle is turned over in it or a fraction is out of (0, 1)."""
    scheme, u = grown(make_mini, run_elastic, 5.0, 4)
    scheme.newton.forget()
    plain = scheme.solve(5.5, 2.0, u, u)
    for field, value in ((0, -5.0), (2, 1.2), (2, -0.1), (1, np.nan), (2, np.nan)):
        wild = u.copy()
        scheme.point(wild).nodal[3, field] = value
        scheme.newton.forget()
        solved = scheme.solve(5.5, 2.0, u, wild)
        np.testing.assert_array_equal(solved.u, plain.u)
        assert solved.iterations == plain.iterations


def test_failures_name_the_place(make_mini: Any, run_elastic: Any) -> None:
    scheme, u = grown(make_mini, run_elastic, 5.0, 4, lambda_alpha=1e3)
    over = u.copy()
    nodal = scheme.point(over).nodal
    nodal[:, 0] = -3.0 * scheme.mesh.points[:, 0]
    with pytest.raises(StepFailure, match=r"inside out \(J <= 0\).* in triangle 0, at \(.*\) of the body at rest, now at about"):
        scheme.solve(5.5, 2.0, over, over)
    lost = u.copy()
    scheme.rest(lost)[0][0] *= 40.0  # more cells than a body as stiff as this one has room for
    with pytest.raises(StepFailure, match=r"alpha still changes by .* at the point \(.*\) of the body at rest"):
        scheme.solve(5.5, 2.0, lost, u)
    after = scheme.solve(5.5, 2.0, u, u)  # and it goes on
    scheme.newton.forget()
    assert np.abs(scheme.solve(5.5, 2.0, u, u).u - after.u).max() < 1e-8  # a hundred tolerances: moments are sums of 10 points' unknowns


@pytest.mark.parametrize("dt", [4.0, 16.0, 64.0])
def test_huge_steps_are_solved_or_refused_in_words(make_mini: Any, dt: float) -> None:
    """From rest. What is solved is a solution: to the tolerance, from any tangent."""
    scheme = make_mini(newton_tol=1e-9)
    u = scheme.initial()
    try:
        solved = scheme.solve(dt, 1.0 / dt, u, u)
    except StepFailure as failure:
        words = str(failure)
    else:
        words = ""
    if words:
        assert dt > 4.0
        assert "of the body at rest" in words
        return
    alpha = scheme.point(solved.u).nodal[:, 2]
    assert 0.0 < alpha.min() < alpha.max() < 1.0
    scheme.newton.forget()
    again = scheme.solve(dt, 1.0 / dt, u, solved.u)
    assert again.iterations <= 3
    np.testing.assert_allclose(again.u, solved.u, atol=1e-7)


def test_a_tangent_is_made_again_bit_for_bit(make_mini: Any, run_elastic: Any) -> None:
    """From what `memory` holds, in another scheme, many steps after it was made; without it the next step differs in rounding."""
    for step, control, rate in (("conservative", {"dt": 0.25}, 6.0), ("as-printed", {"dt": 0.25, "order": 1}, 4.0)):
        scheme = make_mini(alpha_step=step)
        state, _ = run_elastic(scheme, [12.0], **control)
        memory = scheme.newton.memory
        np.testing.assert_array_equal(memory, state.memory)
        made_at = scheme.newton._made_at[1 : 1 + 5 * scheme.count].reshape(-1, 5)
        assert np.abs(made_at - scheme.point(state.u[0]).nodal).max() > 0.05  # an old one
        first = scheme.solve(12.25, rate, state.u[0], state.u[0])
        other = make_mini(alpha_step=step)
        other.recall(state.memory)
        again = other.solve(12.25, rate, state.u[0], state.u[0])
        np.testing.assert_array_equal(again.u, first.u)
        np.testing.assert_array_equal(again.memory, first.memory)
        assert again.iterations == first.iterations
        other.newton.forget()
        assert not np.array_equal(other.solve(12.25, rate, state.u[0], state.u[0]).u, first.u)
        assert other.newton.memory.size > 0
        other.recall(np.zeros(0))
        assert other.newton.memory.size == 0
