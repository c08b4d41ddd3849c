"""TR-BDF2 on small problems with closed solutions: order, estimate, damping, balances, and what it reports."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase import newton, trbdf2
from multiphase.trbdf2 import CAUTION, ERROR_WEIGHTS, GAMMA, HALF_GAMMA

EXACT = -np.array([3.0, 1.0 / 3.0, 1.0, 5.0 / 3.0])


def coupled(t: float, y: Any) -> Any:
    """y, z algebraic, border b and s algebraic, q: powers of 1 + t, their exponents in EXACT, and their integral."""
    u, z, b, s = y[..., 0], y[..., 1], y[..., 2], y[..., 3]
    return np.stack([-3.0 * s**2 * z**2, z**3 - b, -u / b, s**2 - u * z, s * b], axis=-1)


def exact(t: float) -> Any:
    return np.append((1.0 + t) ** EXACT, 0.6 * (1.0 - (1.0 + t) ** (-5.0 / 3.0)))


def of_powers(own: Any, tolerance: float = 1e-9) -> Any:
    return own.Model(coupled, [1.0, 0.0, 1.0, 0.0], border=2, integrals=1, tolerance=tolerance)


def step(own: Any, model: Any, t: float, y: Any, h: float) -> tuple[Any, Any, Any]:
    """What `two_stages` returns, the middle and the end."""
    middle, end = np.empty(model.total), np.empty(model.total)
    return own.two_stages(model, model.mass, t, np.array(y, dtype=float), h, middle, end, model.work), middle, end


def test_the_coefficients_are_those_of_the_papers() -> None:
    """Bank et al. 1985: TR to gamma h, BDF2 on unequal steps. Hosea & Shampine 1996: weights of order three and of order two."""
    d, w = HALF_GAMMA, np.sqrt(2.0) / 4.0
    c = np.array([0.0, GAMMA, 1.0])
    a = np.array([[0.0, 0.0, 0.0], [d, d, 0.0], [w, w, d]])
    b, b_3 = a[2], a[2] + ERROR_WEIGHTS
    rounding = 1e-15
    np.testing.assert_allclose(b_3, [(1.0 - w) / 3.0, (3.0 * w + 1.0) / 3.0, d / 3.0], atol=rounding)
    for weights, order in ((b, 2), (b_3, 3)):
        np.testing.assert_allclose([weights.sum(), weights @ c], [1.0, 0.5], atol=rounding)
        assert (abs(weights @ c**2 - 1.0 / 3.0) < rounding) == (abs(weights @ a @ c - 1.0 / 6.0) < rounding) == (order == 3)
    np.testing.assert_allclose(a @ c, c**2 / 2.0, atol=rounding)  # each stage of order two
    np.testing.assert_allclose((1.0 - GAMMA) / (2.0 - GAMMA), HALF_GAMMA, rtol=1e-15)  # BDF2's matrix is that of the trapezoidal rule


def test_second_order_in_differential_algebraic_and_border_unknowns(integrators: Any) -> None:
    """To t = 1 in fixed steps; Newton's method to 3e-12, errors 1e-4."""
    model, errors = of_powers(integrators), []
    for count in (20, 40, 80):
        y, h = exact(0.0), 1.0 / count
        for k in range(count):
            (code, _, _), _, y = step(integrators, model, k * h, y, h)
            assert code == newton.DONE
        errors.append(np.abs(y - exact(1.0)))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.abs(orders[0] - 2.0).max() < 0.15  # the next term is of order h = 1/20 relative, times a few
    assert np.abs(orders[1] - 2.0).max() < 0.08


def test_the_middle_is_of_order_two_too(integrators: Any) -> None:
    """One step from the exact solution: local errors of both stages fall with h^3, the algebraic ones included."""
    model, errors = of_powers(integrators, 1e-11), []
    for h in (0.04, 0.02, 0.01):
        _, middle, end = step(integrators, model, 0.0, exact(0.0), h)
        errors.append(np.concatenate([np.abs(middle - exact(GAMMA * h)), np.abs(end - exact(h))]))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.abs(orders[1] - 3.0).max() < 0.1  # next term h = 0.02 relative, times a few
    assert np.all(np.abs(orders[1] - 3.0) < np.abs(orders[0] - 3.0))


def test_algebraic_rows_hold_at_both_stages(integrators: Any) -> None:
    model = of_powers(integrators)
    _, middle, end = step(integrators, model, 0.0, exact(0.0), 0.3)
    for y in (middle, end):
        assert np.abs(coupled(0.0, y)[[1, 3]]).max() < 1e-11  # Newton's method to 3e-12, and squared


def test_what_is_algebraic_at_the_start_does_not_matter(integrators: Any) -> None:
    """Nothing but the rates of the others may see it: here none does."""

    def f(t: float, y: Any) -> Any:
        return np.stack([-y[..., 0], y[..., 1] - y[..., 0] ** 2], axis=-1)

    model = integrators.Model(f, [1.0, 0.0])
    right, wrong = (step(integrators, model, 0.0, [1.0, z], 0.3) for z in (1.0, 7.0))
    assert wrong[0][0] == newton.DONE
    for one, other in ((right[0][2], wrong[0][2]), *zip(right[1:], wrong[1:], strict=True)):
        np.testing.assert_allclose(one, other, rtol=1e-14)


def test_the_estimate_is_the_local_error_of_a_smooth_solution(integrators: Any) -> None:
    """Up to CAUTION, with h^3; what differs is the filter and the next order, h each."""
    model, estimates, ratios = of_powers(integrators, 1.0), [], []
    model.tolerance = 1e-11
    for h in (0.08, 0.04, 0.02):
        (code, _, error), _, end = step(integrators, model, 0.0, exact(0.0), h)
        assert code == newton.DONE
        true = np.max(model.weights * np.abs(end - exact(h)))
        estimates.append(error)
        ratios.append(error * model.tolerance / (CAUTION * true))
    # at 1e-11 the error is above 1 and the second filter is applied, too: it takes 2 d h |J| more
    assert np.all((np.array(ratios) > 1.0 / 3.0) & (np.array(ratios) < 3.0))
    assert abs(ratios[2] - 1.0) < abs(ratios[0] - 1.0)
    assert abs(ratios[2] - 1.0) < 0.2
    orders = np.log2(np.array(estimates[:-1]) / np.array(estimates[1:]))
    assert np.abs(orders - 3.0).max() < 0.5  # filters, 1/(1 + 2 d h |J|), |J| about 10
    assert abs(orders[1] - 3.0) < abs(orders[0] - 3.0)


@pytest.mark.parametrize("stiffness", [0.0, 1.0, 1e6])
def test_polynomials_of_degree_two_are_met_exactly(integrators: Any, stiffness: float) -> None:
    """Nonlinear in the algebraic unknown, and the estimate is nothing."""

    def path(t: float) -> tuple[float, float]:
        return 1.0 + 2.0 * t - 3.0 * t * t, 2.0 - 6.0 * t

    def f(t: float, y: Any) -> Any:
        p, slope = path(t)
        return np.stack([slope - stiffness * (y[..., 0] - p), y[..., 1] ** 3 - y[..., 0], y[..., 2] * 0.0 + slope], axis=-1)

    model = integrators.Model(f, [1.0, 0.0], integrals=1, tolerance=1e-9, counted=[1.0, 1.0, 1.0])
    h, t = 0.17, 0.1
    start = path(t)[0]
    (code, _, error), middle, end = step(integrators, model, t, [start, start ** (1.0 / 3.0), 0.0], h)
    assert code == newton.DONE
    for y, at in ((middle, t + GAMMA * h), (end, t + h)):
        p = path(at)[0]
        np.testing.assert_allclose(y, [p, p ** (1.0 / 3.0), p - start], atol=1e-14, rtol=1e-11)  # of z, what Newton's method leaves
        assert abs(y[0] - p) < 1e-14  # rounding, of which a stiff rate makes nothing: f is divided by alpha + stiffness
    assert error * model.tolerance < 1e-14


def stability(z: float) -> tuple[float, float]:
    """Middle and end of ``y' = z y`` over a step of one, from one."""
    d = HALF_GAMMA
    middle = (1.0 + d * z) / (1.0 - d * z)
    return middle, (middle - (1.0 - GAMMA) ** 2) / (GAMMA * (2.0 - GAMMA) * (1.0 - d * z))


@pytest.mark.parametrize("z", [-1e-3, -1.0, -30.0, -1e8, -1e14])
def test_the_stability_function_and_its_limit(integrators: Any, z: float) -> None:
    """From off the slow solution y = cos t, on which it lands when stiff."""
    fast = integrators.Model(lambda t, y: z * (y - 5.0) + 0.0 * y, [1.0])
    _, middle, end = step(integrators, fast, 0.0, [6.0], 1.0)
    np.testing.assert_allclose([middle[0] - 5.0, end[0] - 5.0], stability(z), atol=2e-14)  # rounding of 6 times a few
    if z <= -1e8:
        assert abs(end[0] - 5.0) < 5.0 / abs(z) + 2e-14  # (2 + (1-gamma)^2 - 1)/(gamma (2-gamma) d) = 4.83 over |z|


@pytest.mark.parametrize("tolerance", [1e3, 1e-6])
def test_linear_invariants_hold_whatever_newton_leaves(integrators: Any, tolerance: float) -> None:
    """States of band and border against the integral of what enters, with one iteration a stage or many."""

    def f(t: float, y: Any) -> Any:
        u, v, b = y[..., 0], y[..., 1], y[..., 2]
        first, second, lost = 50.0 * u**3, v * b, b**2
        return np.stack([1.0 + t - first, first - second, second - lost, 1.0 + t - lost], axis=-1)

    model = integrators.Model(f, [1.0, 1.0, 1.0], border=1, integrals=1, tolerance=tolerance)
    y = np.array([1.0, 0.5, 0.2, 0.0])
    total = y @ [1.0, 1.0, 1.0, -1.0]
    for k in range(5):
        (code, count, _), middle, end = step(integrators, model, 0.2 * k, y, 0.2)
        assert code == newton.DONE
        assert (count == 2) == (tolerance > 1.0)
        for at in (middle, end):
            assert abs(at @ [1.0, 1.0, 1.0, -1.0] - total) < 1e-13  # rounding of rates, 50 times h, in each of five steps
        y = end


def test_a_stiff_imbalance_at_the_start_is_forgiven_and_an_unresolved_one_is_not(integrators: Any) -> None:
    """Ten tolerances off a solution of stiffness k. One filter leaves 1.6 times that for any k h >> 1, and no step but 1/k would do."""
    k, tolerance = 1e6, 1e-6
    model = integrators.Model(lambda t, y: -k * y, [1.0], tolerance=tolerance)
    for h in (1.0, 1e-1, 1e-2, 1e-3):
        model.sizes.clear()
        (code, _, error), _, _ = step(integrators, model, 0.0, [10.0 * tolerance], h)
        assert code == newton.DONE
        assert error == CAUTION * model.sizes[-1]
        assert error < 1.0
        once = abs(ERROR_WEIGHTS[0] - ERROR_WEIGHTS[1]) / HALF_GAMMA * 10.0  # of z -> infinity: the middle is at -y
        assert model.sizes[-2] == pytest.approx(once, rel=20.0 / (k * h))  # next term in 1/(d k h)
    assert step(integrators, model, 0.0, [10.0 * tolerance], 3.0 / k)[0][2] > 1.0  # the transient itself, not resolved
    assert step(integrators, model, 0.0, [10.0 * tolerance], 0.1 / k)[0][2] < 1.0


def test_one_filter_is_enough_where_it_passes(integrators: Any) -> None:
    model = of_powers(integrators, 1e-2)
    (_, count, error), _, _ = step(integrators, model, 0.0, exact(0.0), 0.1)
    assert error <= 1.0
    assert len(model.sizes) == count + 1


class Stop:
    """A failure at times after `t`."""

    def __init__(self, own: Any, kind: int, t: float) -> None:
        def f(now: float, y: Any) -> Any:
            return np.nan * y if kind == newton.DIVERGED and now > t else 1.0 + 0.0 * y

        def slopes(now: float, y: Any) -> Any:
            return np.array([[1.0 / HALF_GAMMA if kind == newton.SINGULAR and now > t else 0.0]])

        self.model = own.Model(f, [1.0], slopes=slopes, bound=lambda y: 2 if kind == newton.OUT_OF_BOUNDS and y[0] > t else 0)


@pytest.mark.parametrize("kind", [newton.DIVERGED, newton.SINGULAR, newton.OUT_OF_BOUNDS])
def test_a_failure_in_either_stage_has_its_code(integrators: Any, kind: int) -> None:
    """y = t; the middle is at 0.586."""
    counts = []
    for t in (0.3, 0.8, 1.2):
        (code, count, value), _, _ = step(integrators, Stop(integrators, kind, t).model, 0.0, [0.0], 1.0)
        assert code == (newton.DONE if t > 1.0 else kind)
        if code == newton.OUT_OF_BOUNDS:
            assert value == 2.0
        counts.append(count)
    assert counts[0] < counts[1] <= counts[2]


def test_a_guess_where_nothing_is_defined_is_replaced_by_the_middle(integrators: Any) -> None:
    """y' = -k sqrt y falls by so much in the first stage that a line from there would end below zero."""
    f_of = 1.2

    def f(t: float, y: Any) -> Any:
        return -f_of * y**0.5

    model = integrators.Model(f, [1.0], inside=lambda y: bool(np.real(y[0]) > 0.0))
    (code, _, _), middle, end = step(integrators, model, 0.0, [1.0], 1.6)
    assert 1.0 + (middle[0] - 1.0) / GAMMA < 0.0
    assert code == newton.DONE
    assert 0.0 < end[0] < middle[0]
    past = (middle[0] - (1.0 - GAMMA) ** 2) / (GAMMA * (2.0 - GAMMA))
    assert end[0] - past == pytest.approx(-HALF_GAMMA * 1.6 * f_of * np.sqrt(end[0]), abs=1e-8)


def test_an_error_that_is_no_number_is_a_failure(integrators: Any) -> None:
    """The rates at the start come in: with none there is no first stage."""
    model = integrators.Model(lambda t, y: (np.inf if t == 0.0 else 1.0) + 0.0 * y, [1.0])
    assert step(integrators, model, 0.0, [0.0], 1.0)[0][0] == newton.DIVERGED
    assert trbdf2.MOST_ITERATIONS >= 6  # one for each branch of a kink that a handful of unknowns cross
