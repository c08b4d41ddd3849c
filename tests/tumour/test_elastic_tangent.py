"""The elastic tumour's tangent against central differences over all options, and its forces against the energy they come from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumour import equations as eq
from tumour import radial
from tumour.schemes import ELASTIC

N = 9
OPTIONS: dict[str, dict[str, Any]] = {
    "paper": {},
    "darcy": {"mobility": "darcy"},
    "constant": {"mobility": "constant"},
    "floor": {"mobility_floor": 0.3},
    "free fluid": {"kappa": 0.0},
    "free fluid, lambda": {"kappa": 0.0, "lambda_alpha": 0.7},
    "lambda": {"lambda_alpha": 0.7, "kappa": 3.0},
    "smooth switch": {"sigma_width": 0.2},
    "cells attract": {"alpha_min": 0.6, "alpha_star": 0.8},
    "cells attract, smooth switch": {"alpha_min": 0.6, "alpha_star": 0.8, "sigma_width": 0.1, "mobility": "darcy"},
    "contact from a higher fraction": {"alpha_min": 0.85, "alpha_star": 0.7, "sigma_width": 0.1},
    "uptake saturates": {"Q1_hat": 5.0, "Q": 2.0},
    "pressure outside": {"p_out": 0.4, "C_out": 0.6, "mu_alpha": 0.3, "gamma": 2.0},
}


def rough(scheme: Any, seed: int) -> np.ndarray:
    """A state with alpha, J and C at random, alpha away from the ends of the switch by far more than a difference step."""
    rng, d = np.random.default_rng(seed), scheme.data(0.0)
    J, alpha = rng.uniform(0.5, 2.0, N), rng.uniform(0.4, 0.93, N)
    for bend in (d.alpha_min - 0.5 * d.sigma_width, d.alpha_min, d.alpha_min + 0.5 * d.sigma_width):
        near = np.abs(alpha - bend) < 5e-3
        alpha[near] = bend + 1e-2
    y = scheme.initial()
    y[0 : 3 * N : 3], y[1 : 3 * N : 3], y[2 : 3 * N : 3] = alpha * J, rng.uniform(0.05, 1.2, N), np.cumsum(J * np.diff(d.V))
    y[3 * N :] = rng.normal(size=radial.INTEGRALS)
    return y


def rates(scheme: Any, data: Any, y: np.ndarray) -> np.ndarray:
    out = np.empty_like(y)
    ELASTIC["rates"](data, 0.0, y, out, scheme.work.model)
    return out


def full_tangent(scheme: Any, data: Any, y: np.ndarray) -> np.ndarray:
    """The compiled tangent as a full matrix."""
    w, half = scheme.work, radial.HALF
    w.jac[:], w.q_rows[:] = np.nan, np.nan  # whatever is not written
    ELASTIC["tangent"](data, 0.0, y, rates(scheme, data, y), w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, y)
    full = np.zeros((len(y), len(y)))
    for i in range(3 * N):
        for j in range(max(0, i - half), min(3 * N, i + half + 1)):
            full[i, j] = w.jac[i, j - i + half]
    full[3 * N :, : 3 * N] = w.q_rows
    return full


def differences(function: Callable[[np.ndarray], np.ndarray], y: np.ndarray, steps: np.ndarray) -> np.ndarray:
    columns = []
    for j, step in enumerate(steps):
        up, down = y.copy(), y.copy()
        up[j] += step
        down[j] -= step
        columns.append((function(up) - function(down)) / (up[j] - down[j]))
    return np.array(columns).T


def assert_tangent(scheme: Any, data: Any, y: np.ndarray) -> None:
    sizes = np.ones_like(y)
    sizes[2 : 3 * N : 3] = np.diff(data.V)  # v changes by J times these
    exact, numeric = (
        matrix * sizes for matrix in (full_tangent(scheme, data, y), differences(lambda u: rates(scheme, data, u), y, 1e-5 * sizes))
    )
    scale = np.maximum(np.abs(exact).max(axis=1, keepdims=True), 1e-3)  # the second integral's row is 0 for kappa = 0
    # Relative to the row: rounding 1e-16/1e-5 times terms that cancel, and 1e-10 times third derivatives, 1/(1-alpha)^2 at the most.
    assert np.max(np.abs(exact - numeric) / scale) < 1e-7


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("option", OPTIONS)
def test_the_tangent_is_the_derivative_of_the_rates(make_elastic: Any, m: int, option: str) -> None:
    scheme = make_elastic(m, N, method="lines", radius=1.7, **OPTIONS[option])
    for seed in (1, 2):
        assert_tangent(scheme, scheme.data(0.0), rough(scheme, seed))


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_tangent_of_the_step_as_printed(make_elastic: Any, m: int) -> None:
    scheme = make_elastic(m, N, method="lines", alpha_step="as-printed")
    before = rough(scheme, 3)
    data = scheme.step_data(0.5, 4.0, before)
    assert data.as_printed
    assert data.rate == 4.0
    y = rough(scheme, 1)
    assert_tangent(scheme, data, y)
    # and the step: alpha J - (alpha J)_old less (J - J_old)(alpha - alpha_old), over dt
    J, J_old = (np.diff(u[2 : 3 * N : 3], prepend=0.0) / np.diff(data.V) for u in (y, before))
    a, a_old = y[0 : 3 * N : 3] / J, before[0 : 3 * N : 3] / J_old
    missing = rates(scheme, scheme.data(0.0)._replace(as_printed=False), y) - rates(scheme, data, y)
    np.testing.assert_allclose(missing[0 : 3 * N : 3], 4.0 * (J - J_old) * (a - a_old), atol=1e-13)  # rounding
    assert np.all(np.delete(missing, np.arange(0, 3 * N, 3)) == 0.0)


def test_the_tangent_at_the_kink_is_that_of_contact(make_elastic: Any) -> None:
    """To the right at alpha_min; the scheme with Radau IIA takes cells a little below it as in contact, too."""
    for method, below in (("lines", 0.0), ("radau", 0.2e-4)):
        scheme = make_elastic(2, N, method=method, rtol=1e-4)
        d, y = scheme.data(0.0), rough(scheme, 1)
        J = np.diff(y[2 : 3 * N : 3], prepend=0.0) / np.diff(d.V)
        y[12] = J[4] * (d.alpha_min - below)
        y[12] = np.nextafter(y[12], 2.0) if below == 0.0 else y[12]
        up = y.copy()
        up[12] = J[4] * (d.alpha_min + 1e-9)
        np.testing.assert_allclose(full_tangent(scheme, d, y), full_tangent(scheme, d, up), rtol=1e-3)  # 2e-5 times second derivatives
        y[12] = J[4] * (d.alpha_min - 1e-3)
        assert np.abs(full_tangent(scheme, d, y)[:, 12] - full_tangent(scheme, d, up)[:, 12]).max() > 1.0


@pytest.mark.parametrize("kappa", [0.0, 1.0])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_tangent_conserves_what_the_rates_conserve(make_elastic: Any, m: int, kappa: float) -> None:
    """Columns of the sum of all rates of alpha J against those of their integral: hence exact balances after any Newton iteration."""
    scheme = make_elastic(m, N, kappa=kappa)
    y = rough(scheme, 1)
    full, f = full_tangent(scheme, scheme.data(0.0), y), rates(scheme, scheme.data(0.0), y)
    volumes = np.diff(scheme.data(0.0).V)
    assert np.abs(volumes @ full[0 : 3 * N : 3] - full[3 * N]).max() < 1e-14  # rounding of sums of numbers up to 1
    assert volumes @ f[0 : 3 * N : 3] == pytest.approx(f[3 * N], abs=1e-15)


def energy(r: np.ndarray, d: Any) -> Any:
    """Sum of Delta V W, its stretches from the radii as the module's docstring has them."""
    l_r = np.diff(r) / d.R[1]
    J = np.diff(r**d.m) / np.diff(d.R**d.m)
    l_t = (J / l_r) ** (1.0 / (d.m - 1)) if d.m > 1 else np.ones_like(J)
    return np.sum(np.diff(d.V) * eq.elastic_energy(l_r, l_t, d.m, d.mu, d.lam))


@pytest.mark.parametrize("m", [1, 2, 3])
def test_forces_are_the_derivatives_of_the_energy(make_elastic: Any, m: int) -> None:
    scheme = make_elastic(m, N, lambda_alpha=0.7, mu_alpha=1.3, radius=1.7)
    d, y = scheme.data(0.0), rough(scheme, 4)
    rates(scheme, d, y)
    work = scheme.work.model
    r = np.append(0.0, (m * y[2 : 3 * N : 3]) ** (1.0 / m))
    np.testing.assert_allclose(work[radial._RADIUS], r, rtol=1e-15)  # rounding
    for f in range(1, N + 1):
        moved = r.astype(complex)
        moved[f] += 1e-30j
        force = work[radial._FORCE_P, f - 1] + (work[radial._FORCE_M, f] if f < N else 0.0)
        assert force == pytest.approx(energy(moved, d).imag / 1e-30, rel=1e-12, abs=1e-13)  # rounding


@pytest.mark.parametrize("m", [1, 2, 3])
def test_a_uniform_stretch_is_one_to_rounding(make_elastic: Any, m: int) -> None:
    """Also that nothing is singular in the first cell, whose inner face is the centre."""
    scheme = make_elastic(m, N, lambda_alpha=0.7, radius=1.7, kappa=0.0)
    d, y, stretch = scheme.data(0.0), scheme.initial(), 1.3
    y[2 : 3 * N : 3], y[0 : 3 * N : 3] = stretch**m * d.V[1:], 0.85 * stretch**m
    f = rates(scheme, d, y)
    np.testing.assert_allclose(scheme.work.model[radial._J, :N], stretch**m, rtol=1e-14)
    # inside, no pressure differs; at the surface, Delta p is p_out - p with (p + alpha Sigma) J/l_r = P_r
    P_r = eq.elastic_stress(stretch, stretch if m > 1 else 1.0, m, d.mu, d.lam)[0]
    contact = eq.contact_pressure(0.85, d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)
    area = (stretch * 1.7) ** (m - 1)
    assert np.abs(f[2 : 3 * (N - 1) : 3]).max() < 1e-12  # rounding
    assert f[3 * N - 1] / area == pytest.approx(contact - P_r * stretch ** (1 - m), rel=1e-12)
