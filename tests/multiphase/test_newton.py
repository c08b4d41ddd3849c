"""Newton's method for one implicit step: how it converges, how far it goes, and what it reports."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase import newton


def coupled(t: float, y: Any) -> Any:
    """Two band unknowns (one algebraic), two border unknowns (one algebraic), an integral."""
    u, z, b, s = y[..., 0], y[..., 1], y[..., 2], y[..., 3]
    return np.stack([-3.0 * s**2 * z**2, z**3 - b, -u / b, s**2 - u * z, s * b], axis=-1)


MASS = [1.0, 0.0, 1.0, 0.0]
START = np.array([1.0, 1.0, 1.0, 1.0, 0.0])


def solve(own: Any, model: Any, alpha: float, past: Any, guess: Any, tolerance: float = 1e-9, most: int = 20) -> tuple[Any, Any]:
    y = np.array(guess, dtype=float)
    return own.newton_step(model, model.mass, 0.0, alpha, np.array(past, dtype=float), y, tolerance, most, model.work), y


def test_convergence_is_quadratic_in_all_unknowns(integrators: Any) -> None:
    """Errors against the converged vector, algebraic and border unknowns included: each is a constant times the last one's square."""
    model = integrators.Model(coupled, MASS, border=2, integrals=1, tolerance=1.0)
    (code, _, _), exact = solve(integrators, model, 5.0, START, START, 1e-12)
    assert code == newton.DONE
    residual = coupled(0.0, exact) - model.weights * 5.0 * (exact - START)
    assert np.abs(residual).max() < 1e-14  # terms of size one
    errors = []
    for most in (1, 2, 3, 4):
        (code, count, change), y = solve(integrators, model, 5.0, START, START, 0.0, most)
        assert (code, count) == (newton.DIVERGED, most)
        assert change == model.sizes[-1]
        errors.append(np.abs(y - exact).max())
    assert errors[0] > 1e-2
    assert errors[3] < 1e-7  # 0.02 squared three times is 1e-14, but for constants
    constants = np.array(errors[1:]) / np.array(errors[:-1]) ** 2
    assert np.all((constants < 10.0) | (np.array(errors[1:]) < 1e-14))  # second over first derivatives, 2 s z^2 and such


def test_a_change_ends_it_only_with_its_rate(integrators: Any) -> None:
    """The first change counts as it is; a later one times the rate, capped at one."""
    model = integrators.Model(coupled, MASS, border=2, integrals=1, tolerance=1.0)
    for tolerance in (1e-2, 1e-4, 1e-8):
        model.sizes.clear()
        (code, count, change), _ = solve(integrators, model, 5.0, START, START, tolerance)
        sizes = np.array(model.sizes)
        left = sizes * np.minimum(1.0, np.append(1.0, sizes[1:] / sizes[:-1]))
        assert (code, count, change) == (newton.DONE, len(sizes), sizes[-1])
        assert np.all(left[:-1] > tolerance)
        assert left[-1] <= tolerance


@pytest.mark.parametrize("most", [1, 2, 20])
def test_integrals_follow_from_the_same_formula(integrators: Any, most: int) -> None:
    """The sum of u and v less the integral of what enters holds after every iteration, to rounding of terms of size one."""

    def f(t: float, y: Any) -> Any:
        u, v, b = y[..., 0], y[..., 1], y[..., 2]
        passed, lost = u**3, v**2 * b
        return np.stack([1.0 - passed, passed - lost, u - b**2, 1.0 - lost], axis=-1)

    model = integrators.Model(f, [1.0, 1.0, 0.0], border=1, integrals=1)
    past = np.array([2.0, 1.0, 1.0, 0.3])
    (code, _, _), y = solve(integrators, model, 1.5, past, past, most=most)
    assert (code == newton.DONE) == (most == 20)
    assert abs((y - past) @ [1.0, 1.0, 0.0, -1.0]) < 1e-15 * 10
    assert np.abs(y - past).max() > 0.1


def root(t: float, y: Any) -> Any:
    return 1e-3 - y**0.5


def test_a_change_is_cut_short_and_no_cut_one_is_the_last(integrators: Any) -> None:
    """sqrt y = 1e-3 from y = 1, where the full change goes to -1: y at its last is positive, and right."""
    model = integrators.Model(root, [0.0], counted=[1.0], inside=lambda y: bool(np.real(y[0]) > 0.0))
    (code, count, _), y = solve(integrators, model, 1.0, [1.0], [1.0], 1e-3)
    assert code == newton.DONE
    assert len(model.shares) == count
    assert 0.0 < min(model.shares) < 1.0
    assert model.shares[-1] == 1.0
    assert y[0] == pytest.approx(1e-6, rel=1e-3)  # the error left is below 1e-9
    model.shares.clear()
    (code, count, _), y = solve(integrators, model, 1.0, [1.0], [1.0], 1e9)  # any change would do, but for its share
    assert code == newton.DONE
    assert model.shares[-1] == 1.0
    assert all(share < 1.0 for share in model.shares[:-1])
    assert count > 1


def test_cut_changes_count_as_iterations_and_are_no_divergence(integrators: Any) -> None:
    """Each change is three times the last and may be taken in part only: that ends for want of iterations; taken whole, as divergence."""

    def changes(cut: bool) -> Any:
        seen: list[float] = []

        def f(t: float, y: Any) -> Any:
            seen.append(float(y[0]))
            return np.array([3.0 ** len(seen)])

        def inside(y: Any) -> bool:
            return not cut or bool(y[0] < seen[-1] + 0.6)

        return integrators.Model(f, [0.0], counted=[1.0], inside=inside, slopes=lambda t, y: -np.ones((1, 1)))

    model = changes(cut=True)
    assert solve(integrators, model, 1.0, [0.0], [0.0], 1e-3, 5)[0][:2] == (newton.DIVERGED, 5)
    assert len(model.sizes) == 5
    assert all(0.0 < share < 1.0 for share in model.shares)
    assert solve(integrators, changes(cut=False), 1.0, [0.0], [0.0], 1e-3, 5)[0][:2] == (newton.DIVERGED, 3)


def test_no_share_at_all_is_out_of_bounds_with_the_number_of_the_bound(integrators: Any) -> None:
    for number in (1, 2):
        model = integrators.Model(
            lambda t, y: 1.0 + 0.0 * y, [1.0], bound=lambda y, n=number: n if y[0] > 1.0 else 0, inside=lambda y: False
        )
        (code, count, value), y = solve(integrators, model, 0.5, [0.0], [0.0])
        assert (code, count, value) == (newton.OUT_OF_BOUNDS, 1, number)
        assert y[0] == pytest.approx(2.0)  # the change is taken, so that admit can say what it breaks


def test_a_converged_vector_must_be_admitted(integrators: Any) -> None:
    model = integrators.Model(lambda t, y: 1.0 + 0.0 * y, [1.0], bound=lambda y: 2 if y[0] > 1.0 else 0)
    assert solve(integrators, model, 0.5, [0.0], [0.0])[0] == (newton.OUT_OF_BOUNDS, 2, 2.0)
    assert solve(integrators, model, 2.0, [0.0], [0.0])[0][0] == newton.DONE


def test_singular_diverging_and_undefined(integrators: Any) -> None:
    singular = integrators.Model(lambda t, y: 2.0 * y, [1.0])
    assert solve(integrators, singular, 2.0, [1.0], [1.0])[0][:2] == (newton.SINGULAR, 1)
    bordered = integrators.Model(lambda t, y: np.stack([y[..., 0] + y[..., 1], y[..., 0] + y[..., 1]], axis=-1), [0.0, 0.0], border=1)
    assert solve(integrators, bordered, 2.0, [1.0, 1.0], [1.0, 1.0])[0][:2] == (newton.SINGULAR, 1)
    undefined = integrators.Model(lambda t, y: np.nan * y, [1.0], slopes=lambda t, y: np.zeros((1, 1)))
    code, count, change = solve(integrators, undefined, 2.0, [1.0], [1.0])[0]
    assert (code, count) == (newton.DIVERGED, 1)
    assert np.isnan(change)
    away = integrators.Model(lambda t, y: np.arctan(y), [0.0], counted=[1.0])  # from y = 2 each change is twice the last, or more
    code, count, _ = solve(integrators, away, 1.0, [2.0], [2.0], 1e-9, 20)[0]
    assert (code, count) == (newton.DIVERGED, 3)  # by the growth of changes, not at the end of the iterations
