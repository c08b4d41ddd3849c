"""The tangent against central differences of FiPy's residual, in every regime of the flux and both momentum forms."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase import transport
from plaque1d import equations as eq
from plaque1d import layout
from plaque1d.semidiscrete import KERNEL

CASES = {
    "interfacial": {},
    "interfacial, unequal viscosities": {"mu_n": 0.05, "mu_m": 0.8, "k": 2.0},
    "interfacial, inviscid": {"mu_n": 0.0, "mu_m": 0.0},
    "interfacial, only macrophages viscous": {"mu_n": 0.0},
    "drag": {"momentum": "drag", "p_out": 0.3},
    "drag, unequal viscosities": {"momentum": "drag", "p_out": 0.3, "mu_n": 0.05},
    "drag, inviscid": {"momentum": "drag", "p_out": 1.0, "mu_n": 0.0, "mu_m": 0.0},
    "given n at the wall": {"inner_wall": 0.3},
    "modLDL upwinded": {"L": 60.0},
}


@pytest.mark.parametrize("case", CASES)
def test_the_tangent_is_the_derivative_of_the_residual(make_scheme, case):
    cells, step = 11, 1e-6
    scheme = make_scheme(cells, **CASES[case])
    lay = scheme.layout
    rng = np.random.default_rng(4)
    past = scheme.initial()
    x = scheme.fractions(past)
    x[lay.n] = 0.1 + 0.8 * rng.random(cells)  # rough, so that every branch of the limiter is taken
    x[lay.l] = 0.1 + rng.random(cells)
    x[lay.w] = rng.standard_normal(cells - 1)
    x[lay.V] = 0.7
    scheme.residual(0.1, 30.0, past, x)
    exact = scheme.tangent(0.1, 30.0, past, x).toarray()
    numeric = np.empty_like(exact)
    for j in range(lay.unknowns):
        side = []
        for sign in (1.0, -1.0):
            y = x.copy()
            y[j] += sign * step
            side.append(scheme.residual(0.1, 30.0, past, y))
        numeric[:, j] = (side[0] - side[1]) / (2.0 * step)
    # Differences of a residual of size S carry rounding of about 1e-16 S / step, and a truncation of step^2.
    scale = max(1.0, np.abs(exact).max())
    border = [lay.W, lay.V]  # one-sided differences in the code as well: a step of 1e-7 times a second derivative
    assert np.max(np.abs(np.delete(exact - numeric, border, axis=1))) < 1e-8 * scale
    assert np.max(np.abs((exact - numeric)[:, border])) < 1e-6 * scale
    assert np.count_nonzero(numeric[lay.w, lay.n]) >= 2 * (cells - 1)  # the coupling that segregated sweeps leave out


def test_added_terms_enter_the_tangent(make_scheme):
    """A nonlinear coupling n-l-species with neighbours, by differences in three colours; 7 cells, not a multiple of 3."""

    def extra(plaque):
        fp = plaque.fipy
        s = plaque.add_species("s", initial=0.3, diffusivity=0.5, influx=0.2)
        loss = 3.0 * plaque.L * plaque.l * s
        return {"l": -fp.ImplicitSourceTerm(coeff=3.0 * plaque.L * s, var=plaque.l), "s": -loss + fp.DiffusionTerm(coeff=plaque.V, var=s)}

    cells, step = 7, 1e-6
    scheme = make_scheme(cells, extra_terms=extra)
    lay = scheme.layout
    past = scheme.initial()
    rng = np.random.default_rng(5)
    x = scheme.fractions(past)
    x[: 3 * cells - 1] += 0.1 * rng.random(3 * cells - 1)
    x[lay.extra(0)] = rng.random(cells)
    scheme.residual(0.1, 30.0, past, x)
    exact = scheme.tangent(0.1, 30.0, past, x).toarray()
    numeric = np.empty_like(exact)
    for j in range(lay.unknowns):
        up, down = x.copy(), x.copy()
        up[j] += step
        down[j] -= step
        numeric[:, j] = (scheme.residual(0.1, 30.0, past, up) - scheme.residual(0.1, 30.0, past, down)) / (2.0 * step)
    # One-sided differences of step 1e-7 in the added terms: error 1e-7 times their second derivative, of order 10 here.
    assert np.max(np.abs(exact - numeric)) < 1e-5 * np.abs(exact).max()
    assert np.abs(numeric[lay.l, lay.extra(0)]).max() > 0.01
    assert np.abs(numeric[lay.extra(0), lay.l]).max() > 0.01


@pytest.mark.parametrize("k", [1.0, 2.0, 3.5])
def test_derivatives_of_the_laws(k):
    l, n, w = np.linspace(0.05, 3.0, 7), np.linspace(0.02, 0.98, 7), np.linspace(-1.0, 2.0, 7)
    h = 1e-6

    def close(slope, function, at):
        # central differences: h^2 times a third derivative of order ten
        np.testing.assert_allclose(slope, (function(at + h) - function(at - h)) / (2 * h), rtol=1e-7, atol=1e-8)

    close(eq.extra_stress_slope(l, 0.7, 2.0, k), lambda x: eq.extra_stress(x, 0.7, 2.0, k), l)
    close(eq.uptake_slopes(l, n)[0], lambda x: eq.uptake(x, n), l)
    close(eq.uptake_slopes(l, n)[1], lambda x: eq.uptake(l, x), n)
    close(transport.floored_slope(n, 0.01), lambda x: transport.floored(x, 0.01), n)
    for nu_n, nu_m in ((0.3, 1.2), (0.0, 1.0), (0.0, 0.0)):

        def excess(x, y, nu_n=nu_n, nu_m=nu_m):
            return eq.short_wave_velocity(np.zeros_like(x), x, y, nu_n, nu_m)

        slopes = eq.short_wave_excess_slopes(n, w, nu_n, nu_m)
        close(slopes[0], lambda x, f=excess: f(x, w), n)
        close(slopes[1], lambda y, f=excess: f(n, y), w)


def test_wall_concentration_solves_the_influx_balance():
    for inner, distance, influx, recruitment in (
        (0.2, 0.01, 1.0, 0.5),
        (0.0, 1e-3, 2e-3, 0.13),
        (3.0, 0.3, 1.0, 50.0),
        (1.0, 0.1, 0.5, 0.0),
    ):
        wall = eq.wall_concentration(inner, distance, influx, recruitment)
        # rounding of terms of order wall / distance
        assert abs(recruitment * wall**2 - (inner - wall) / distance - influx) < 1e-14 * max(1.0, wall / distance)
        h = 1e-7
        slopes = eq.wall_concentration_slopes(inner, distance, influx, recruitment)
        up = eq.wall_concentration(inner + h, distance, influx, recruitment)
        assert slopes[0] == pytest.approx((up - wall) / h, rel=1e-6)  # one-sided: h times a second derivative
        wider = eq.wall_concentration(inner, distance * (1 + h), influx, recruitment)
        assert slopes[1] == pytest.approx((wider - wall) / (h * distance), rel=1e-5, abs=1e-7)


def test_slopes_are_exact_for_straight_profiles_and_never_overshoot(make_lines):
    slopes = _slopes(make_lines, 0.2 + 0.5 * (np.arange(9) + 0.5) / 9)
    np.testing.assert_allclose(slopes[1:], 0.5 / 9, atol=1e-15)  # rounding; the inner cell assumes n_xi = 0
    assert slopes[0] == pytest.approx(0.25 / 9)
    rough = np.random.default_rng(1).random(200)
    for wall in ("no_gradient", 0.5):
        slopes = _slopes(make_lines, rough, inner_wall=wall)
        low, high = np.minimum(rough[:-1], rough[1:]), np.maximum(rough[:-1], rough[1:])
        for side in ((rough + 0.5 * slopes)[:-1], (rough - 0.5 * slopes)[1:]):
            assert np.all(side >= low - 1e-15)
            assert np.all(side <= high + 1e-15)


def _slopes(make_lines, n, **changes):
    """Limited slopes of n, times the width of a cell."""
    scheme = make_lines(len(n), **changes)
    y = scheme.initial()
    y[scheme.n] = y[scheme.size] * n
    KERNEL["rates"](scheme.data(0.0), 0.0, y, np.empty_like(y), scheme.work.model)
    return scheme.work.model[layout.SLOPE, : len(n)].copy()
