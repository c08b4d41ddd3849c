"""The elastic tumour against exact solutions, and what is observed of it against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase.stepping import Control, State, integrate
from tumour import equations as eq
from tumour import exact, observation
from tumour.parameters import TumourParameters

DIMENSIONS = pytest.mark.parametrize("m", [1, 2, 3])
FREE = {"kappa": 0.0, "Q": 0.0}


@pytest.mark.parametrize("lam", [0.0, 1.0])
@DIMENSIONS
def test_uniform_growth(make_elastic: Any, run_elastic: Any, m: int, lam: float) -> None:
    """At every cell; the sphere with lambda = 0, too, beyond its fold at t = 17, where alpha has its maximum and J goes on to grow."""
    times = [1.0, 5.0, 10.0, 20.0]
    scheme = make_elastic(m, 8, 1e-8, lambda_alpha=lam, **FREE)
    J, alpha = exact.uniform_growth(times, scheme.parameters, m)
    _, stored = run_elastic(scheme, times)
    for snapshot, J_t, alpha_t in zip(stored, J, alpha, strict=True):
        np.testing.assert_allclose(snapshot.fields["J"], J_t, rtol=1e-6)  # 10 rtol, and the growth of errors
        np.testing.assert_allclose(snapshot.fields["alpha"], alpha_t, rtol=1e-6)
        assert snapshot.scalars["radius"] == pytest.approx(J_t ** (1.0 / m), rel=1e-6)
        # between steps kappa = 0 holds to rtol only, and the slope of alpha Sigma is 20 and more
        assert np.abs(snapshot.fields["p"]).max() < 1e-6


@pytest.mark.parametrize("stretch", [1.0, 1.6])
@DIMENSIONS
def test_oxygen_at_rest_and_in_a_uniform_stretch(make_elastic: Any, m: int, stretch: float) -> None:
    Q, alpha, largest = 3.0, 0.8, []
    for cells in (100, 200, 1600):
        scheme = make_elastic(m, cells, Q=Q, alpha=alpha)
        y = scheme.initial()
        y[2 : 3 * cells : 3] *= stretch**m
        y[0 : 3 * cells : 3] *= stretch**m
        seen = scheme.observe(0.0, scheme.consistent(0.0, y))
        np.testing.assert_allclose(seen.x, stretch * (np.arange(cells) + 0.5) / cells, rtol=1e-13)  # kappa > 0: consistent() moves C only
        largest.append(np.abs(seen.fields["C"] - exact.oxygen(seen.x, stretch, alpha, m, Q=Q)).max())
    assert np.log2(largest[0] / largest[1]) > 1.95
    assert largest[-1] < 1e-6  # h^2 = 4e-7 times less than 2.5


class Swelling:
    """Slow swelling with the oxygen eps, on `cells` cells: d on the cells' middles, p and a, each over eps."""

    times = (0.02, 0.1)

    def __init__(self, make: Any, run: Any, m: int, cells: int, eps: float) -> None:
        scheme = make(m, cells, max(1e-12, 1e-6 * eps), s1=0.0, s2=0.0, s3=0.0, Q=0.0, C_out=eps, mobility="darcy")
        _, stored = run(scheme, list(self.times))
        R = (np.arange(cells) + 0.5) / cells
        solution = exact.LinearSwelling(scheme.parameters, m)
        self.found = np.array([[s.fields["displacement"], s.fields["p"], s.fields["alpha"] - 0.8] for s in stored]) / eps
        self.exact = (
            np.array([[solution.displacement(R, t), solution.pressure(R, t), solution.fraction_change(R, t)] for t in self.times]) / eps
        )

    def error(self, other: np.ndarray) -> np.ndarray:
        """Largest differences to `other`, over the largest value, of d, p and a."""
        return np.abs(self.found - other).max(axis=(0, 2)) / np.abs(self.exact).max(axis=(0, 2))


@DIMENSIONS
def test_linear_swelling(make_elastic: Any, run_elastic: Any, m: int) -> None:
    """First order in the source: what differs from the series, less what the grid adds, falls with it. Second order in h."""
    coarse = [Swelling(make_elastic, run_elastic, m, 40, eps) for eps in (2e-3, 1e-3, 1e-6)]
    fine = Swelling(make_elastic, run_elastic, m, 80, 1e-6)
    nonlinear = [run.error(coarse[-1].found) for run in coarse[:2]]
    grid = [coarse[-1].error(coarse[-1].exact), fine.error(fine.exact)]
    assert np.all(np.abs(np.log2(nonlinear[0] / nonlinear[1]) - 1.0) < 0.05)
    assert np.all(nonlinear[1] < 5e-3)
    assert np.all(np.log2(grid[0] / grid[1]) > 1.85)  # 2 less what the 1e-6 of nonlinearity leaves: d of the slab is down to 5e-6
    assert np.all(grid[1] < 1e-3)


@pytest.mark.parametrize("level", [0.3, 0.55, 0.95])
@DIMENSIONS
def test_the_radius_below_a_level_is_exact_for_parabolas(m: int, level: float) -> None:
    """C = 0.2 + 0.2 r^2 out to R = 2, on points of a grid and on uneven ones; on the inside of the first point, too."""
    rng = np.random.default_rng(1)
    for rho in ((np.arange(20) + 0.5) / 10.0, np.sort(rng.uniform(0.9, 1.99, 7))):
        C = 0.2 + 0.2 * rho**2
        radius = observation.radius_below(level, 2.0, 1.0, rho, C)
        assert radius == pytest.approx(np.sqrt((level - 0.2) / 0.2), rel=1e-13)  # rounding


def test_the_radius_below_a_level_nowhere_or_everywhere() -> None:
    rho = (np.arange(10) + 0.5) / 5.0
    C = 0.2 + 0.2 * rho**2
    below = observation.radius_below
    assert below(0.2 - 1e-9, 2.0, 1.0, rho, C) == 0.0
    assert below(0.2 + 1e-9, 2.0, 1.0, rho, C) == pytest.approx(np.sqrt(5e-9), rel=1e-6)  # cancellation: 1e-16/1e-9
    assert below(1.1, 2.0, 1.0, rho, C) == 2.0
    assert below(1.0, 2.0, 1.0, rho, C) == pytest.approx(2.0, rel=1e-15)
    assert below(0.5, 2.0, 0.5, rho, np.full(10, 0.5)) == 0.0  # nothing is below the level where C is it everywhere
    assert below(0.6, 2.0, 0.5, rho, np.full(10, 0.5)) == 2.0
    assert np.isnan(below(np.nan, 2.0, 1.0, rho, C))  # kinetics without a level


@DIMENSIONS
def test_the_radius_below_a_level_is_of_second_order(m: int) -> None:
    errors = []
    for cells in (50, 100):
        rho = 3.0 * (np.arange(cells) + 0.5) / cells
        C = exact.oxygen(rho, 3.0, 0.8, m, Q=2.0)
        wanted = 1.234
        level = float(exact.oxygen(wanted, 3.0, 0.8, m, Q=2.0))
        errors.append(max(abs(observation.radius_below(level, 3.0, 1.0, rho, C) - wanted), 1e-15))
        assert errors[-1] < 0.5 * (3.0 / cells) ** 2
    middle = []
    for cells in (50, 100):  # with the level midway between two points, where the error of interpolation is largest
        rho = 3.0 * (np.arange(cells) + 0.5) / cells
        wanted = 3.0 * 20 / 50
        level = float(exact.oxygen(wanted, 3.0, 0.8, m, Q=2.0))
        middle.append(abs(observation.radius_below(level, 3.0, 1.0, rho, exact.oxygen(rho, 3.0, 0.8, m, Q=2.0)) - wanted))
    assert np.log2(middle[0] / middle[1]) > 1.9


@pytest.mark.parametrize("kappa", [0.0, 1.0])
@DIMENSIONS
def test_the_growth_rate_is_the_slope_of_the_radius(make_elastic: Any, m: int, kappa: float) -> None:
    """Against differences between points of the integrator's own steps; for kappa = 0 it is not among the rates."""
    scheme, control = make_elastic(m, 30, 1e-7, kappa=kappa, lambda_alpha=0.2), Control()
    state = integrate(scheme, State(times=np.zeros(1), u=scheme.initial()[None, :], dt=0.1), [20.0], control)
    step = 0.1 * (state.times[0] - state.times[-1])
    before, at, after = scheme.between([state.times[2] - step, state.times[2], state.times[2] + step], state)
    slope = (after.scalars["radius"] - before.scalars["radius"]) / (after.t - before.t)
    assert at.scalars["growth_rate"] == pytest.approx(slope, rel=2e-3)
    np.testing.assert_allclose(
        at.scalars["doubling_time"], np.log(2.0) * at.scalars["radius"] / (m * at.scalars["growth_rate"]), rtol=1e-14
    )


@pytest.mark.parametrize("lam", [0.0, 1.0])
@DIMENSIONS
def test_what_is_seen_of_a_uniform_body(make_elastic: Any, m: int, lam: float) -> None:
    """Growth rate, doubling time, sizes, p and the stress of a uniformly grown body, at the volume that `exact.uniform_growth` has."""
    scheme = make_elastic(m, 10, lambda_alpha=lam, **FREE)
    parameters: TumourParameters = scheme.parameters
    (J,), (alpha,) = exact.uniform_growth([5.0], parameters, m)
    y = scheme.initial()
    y[0:30:3], y[2:30:3] = alpha * J, J * scheme.data(0.0).V[1:]
    seen = scheme.observe(5.0, scheme.consistent(5.0, y))
    (J_2,), _ = exact.uniform_growth([5.0 + 1e-4], parameters, m)
    (J_1,), _ = exact.uniform_growth([5.0 - 1e-4], parameters, m)
    R, rate = J ** (1.0 / m), (J_2 ** (1.0 / m) - J_1 ** (1.0 / m)) / 2e-4
    s, unit = seen.scalars, {1: 2.0, 2: np.pi, 3: 4.0 * np.pi / 3.0}[m]
    assert s["radius"] == pytest.approx(R, rel=1e-9)  # as exact as the exact solution
    assert s[observation.SIZES[m]] == pytest.approx(unit * J, rel=1e-9)
    assert s["cell_mass"] == pytest.approx(unit * alpha * J, rel=1e-9)
    assert s["growth_rate"] == pytest.approx(rate, rel=1e-6)  # differences: 1e-10/1e-4
    assert s["doubling_time"] == pytest.approx(np.log(2.0) / ((J_2 - J_1) / 2e-4 / J), rel=1e-6)
    assert (s["C_min"], s["necrotic_radius"], s["necrotic_fraction"], s["hypoxic_radius"]) == (1.0, 0.0, 0.0, 0.0)
    assert s["rim_width"] == s["radius"]
    # Free of stress in all directions of growth; p = 0
    assert np.abs(seen.fields["p"]).max() < 1e-9
    assert seen.fields["stress_magnitude"].max() < 1e-8
    np.testing.assert_allclose(seen.fields["displacement"], (R - 1.0) * (np.arange(10) + 0.5) / 10, rtol=1e-9)


@DIMENSIONS
def test_pressure_and_stress_of_a_stretched_body(make_elastic: Any, m: int) -> None:
    """A uniform stretch held by the fluid alone: without traction p + alpha Sigma is the elastic Cauchy stress everywhere, whatever
    flows, and there is no stress left in the directions of the stretch."""
    scheme = make_elastic(m, 10, lambda_alpha=0.6, p_out=0.3, alpha=0.84)
    y, stretch = scheme.initial(), 1.25
    y[0:30:3], y[2:30:3] = y[0:30:3] * stretch**m, stretch**m * scheme.data(0.0).V[1:]
    seen = scheme.observe(0.0, scheme.consistent(0.0, y))
    P_r = eq.elastic_stress(stretch, stretch if m > 1 else 1.0, m, 1.0, 0.6)[0]
    contact = eq.contact_pressure(0.84, *scheme.parameters.contact)
    np.testing.assert_allclose(seen.fields["p"], P_r * stretch ** (1 - m) - contact, rtol=1e-11)
    assert seen.fields["stress_magnitude"].max() < 1e-11
    # and one that is not uniform, against the definition, at its middle
    d = scheme.data(0.0)
    r = d.R * (1.0 + 0.1 * d.R**2)
    y[2:30:3], y[0:30:3] = r[1:] ** m / m, 0.84 * np.diff(r**m / m) / np.diff(d.V)
    seen = scheme.observe(0.0, scheme.consistent(0.0, y))
    l_r = np.diff(r) / d.R[1]
    l_t = (seen.fields["J"] / l_r) ** (1.0 / (m - 1)) if m > 1 else np.ones(10)
    P = eq.elastic_stress(l_r, l_t, m, 1.0, 0.6)
    T = (seen.fields["p"] + contact) * seen.fields["J"]
    magnitude = np.sqrt((P[0] - T / l_r) ** 2 + (m - 1) * (P[1] - T / l_t) ** 2)
    np.testing.assert_allclose(seen.fields["stress_magnitude"], magnitude, rtol=1e-11, atol=1e-13)  # in the slab, 0
