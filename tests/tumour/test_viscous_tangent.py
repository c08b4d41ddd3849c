"""The viscous tumour's tangent against central differences over all options, and its forces against the dissipation they come from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumour import equations as eq
from tumour import eulerian, radial
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import VISCOUS, ViscousLines
from tumour.solver import TumourSolver

N = 9
KINDS = {1: "slab", 2: "disk", 3: "sphere"}
DIMENSIONS = pytest.mark.parametrize("m", [1, 2, 3])
OPTIONS: dict[str, dict[str, Any]] = {
    "darcy": {},
    "printed": {"mobility": "printed"},
    "printed, floor": {"mobility": "printed", "mobility_floor": 0.3},
    "constant": {"mobility": "constant"},
    "free fluid": {"kappa": 0.0},
    "free fluid, lambda": {"kappa": 0.0, "lambda_alpha": 0.7},
    "lambda": {"lambda_alpha": 0.7, "kappa": 3.0},
    "lambda below 0": {"lambda_alpha": -0.6},
    "smooth switch": {"sigma_width": 0.2},
    "cells attract": {"alpha_min": 0.6, "alpha_star": 0.8},
    "cells attract, smooth switch": {"alpha_min": 0.6, "alpha_star": 0.8, "sigma_width": 0.1, "mobility": "printed"},
    "uptake saturates": {"Q1_hat": 5.0, "Q": 2.0},
    "pressure outside": {"p_out": 0.4, "C_out": 0.6, "mu_alpha": 0.3, "gamma": 2.0},
}


class Plain(ViscousLines):
    limiter = False


def make(m: int, cells: int = N, limiter: bool = True, **changes: Any) -> Any:
    geometry, solver = TumourGeometry(kind=KINDS[m], radius=1.7, formulation="eulerian"), TumourSolver(cells=cells)
    return (ViscousLines if limiter else Plain)(TumourParameters(**changes), TumourInitial(alpha=0.8), geometry, solver)


def rough(scheme: Any, seed: int, low: float = 0.4, high: float = 0.93) -> np.ndarray:
    """A state with everything at random, alpha away from the ends of the switch of contact by far more than a difference step."""
    rng, d, cells = np.random.default_rng(seed), scheme.data(0.0), scheme.cells
    alpha = rng.uniform(low, high, cells)
    for bend in (d.alpha_min - 0.5 * d.sigma_width, d.alpha_min, d.alpha_min + 0.5 * d.sigma_width):
        alpha[np.abs(alpha - bend) < 5e-3] = bend + 1e-2
    y, W = scheme.initial(), 1.3 * 1.7**d.m / d.m
    y[0 : 3 * cells : 3], y[1 : 3 * cells : 3], y[2 : 3 * cells : 3] = W * alpha, rng.uniform(0.05, 1.2, cells), rng.normal(size=cells)
    y[3 * cells :] = W, rng.normal(), rng.normal(), rng.normal()
    return y


def rates(scheme: Any, y: np.ndarray) -> np.ndarray:
    out = np.empty_like(y)
    VISCOUS["rates"](scheme.data(0.0), 0.0, y, out, scheme.work.model)
    return out


def full_tangent(scheme: Any, y: np.ndarray) -> np.ndarray:
    """The compiled tangent as a full matrix: band, border columns and rows, corner, integrals."""
    w, half, size = scheme.work, eulerian.HALF, 3 * scheme.cells
    for array in (w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner):
        array[:] = np.nan  # whatever is not written
    VISCOUS["tangent"](
        scheme.data(0.0), 0.0, y, rates(scheme, y), w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch
    )
    full = np.zeros((len(y), len(y)))
    for i in range(size):
        for j in range(max(0, i - half), min(size, i + half + 1)):
            full[i, j] = w.jac[i, j - i + half]
    border, integrals = slice(size, size + 2), slice(size + 2, size + 4)
    full[:size, border], full[border, :size], full[border, border] = w.columns.T, w.rows, w.corner
    full[integrals, :size], full[integrals, border] = w.q_rows, w.q_corner
    return full


def assert_tangent(scheme: Any, y: np.ndarray) -> None:
    size = 3 * scheme.cells
    sizes = np.ones_like(y)
    sizes[0:size:3], sizes[size] = y[size], y[size]  # alpha and R change by 1 and by themselves
    numeric = []
    for j, step in enumerate(1e-5 * sizes):
        up, down = y.copy(), y.copy()
        up[j] += step
        down[j] -= step
        numeric.append((rates(scheme, up) - rates(scheme, down)) / (up[j] - down[j]))
    exact = full_tangent(scheme, y) * sizes
    assert np.all(np.isfinite(exact))
    scale = np.abs(exact).max(axis=1, keepdims=True)
    # Relative to the row: rounding 1e-16/1e-5 times terms that cancel, and 1e-10 times third derivatives, 1/(1-alpha)^2 at the most.
    assert np.max(np.abs(exact - np.array(numeric).T * sizes) / scale) < 1e-7


@DIMENSIONS
@pytest.mark.parametrize("limiter", [True, False], ids=["limited", "plain"])
@pytest.mark.parametrize("option", OPTIONS)
def test_the_tangent_is_the_derivative_of_the_rates(m: int, limiter: bool, option: str) -> None:
    """With a limiter, rough states take its bounded branches; none is within a step of where it switches."""
    scheme = make(m, limiter=limiter, **OPTIONS[option])
    for seed in (1, 2):
        assert_tangent(scheme, rough(scheme, seed))


@DIMENSIONS
def test_the_tangent_where_slopes_are_partly_limited(m: int) -> None:
    """Enough cells, and differences between SMOOTH h^2 = 0.078 and twice that, for the passage between central and limited slopes."""
    scheme = make(m, 16)
    y = rough(scheme, 5, 0.62, 0.78)
    rates(scheme, y)
    alpha, slope = y[0:48:3] / y[48], scheme.work.model[eulerian._SLOPE, :16]
    inner = range(1, 15)
    limited = np.array([eulerian.transport.limited(alpha[i] - alpha[i - 1], alpha[i + 1] - alpha[i])[0] for i in inner])
    assert np.count_nonzero((slope[1:15] != limited) & (slope[1:15] != 0.5 * (alpha[2:] - alpha[:-2]))) >= 2
    assert_tangent(scheme, y)


@DIMENSIONS
def test_the_tangent_conserves_what_the_rates_conserve(m: int) -> None:
    """Columns of the sum of all rates of W alpha against those of their integral: hence exact balances after any Newton iteration."""
    scheme = make(m, p_out=0.3, lambda_alpha=0.4)
    y = rough(scheme, 1)
    full, f, shares = full_tangent(scheme, y), rates(scheme, y), scheme.grid.faces[1:] ** m - scheme.grid.faces[:-1] ** m
    lost = shares @ full[0 : 3 * N : 3] - full[3 * N + 2]
    assert np.abs(np.delete(lost, 3 * N)).max() < 1e-14  # rounding of sums of numbers up to 3
    assert abs(lost[3 * N]) < 1e-10  # a column of differences, whose rounding is 1e-16/1e-5
    assert shares @ f[0 : 3 * N : 3] == pytest.approx(f[3 * N + 2], abs=1e-14)
    assert np.array_equal(full[3 * N], full[3 * N + 3])
    assert f[3 * N] == f[3 * N + 3] == y[3 * N + 1]


def velocities(y: np.ndarray) -> np.ndarray:
    """u on all faces."""
    return np.append(0.0, y[2 : 3 * N : 3])


def dissipation(u: np.ndarray, scheme: Any, y: np.ndarray) -> Any:
    """Sum of W Delta s (sigma_r e_r + (m-1) sigma_t e_t)/2, its strain rates from differences of u and of the flux of volume."""
    d, W = scheme.data(0.0), y[3 * N]
    m, R = d.m, (d.m * W) ** (1.0 / d.m)
    r, volumes = R * scheme.grid.faces, W * np.diff(scheme.grid.faces**m)
    e_r = np.diff(u) / np.diff(r)
    e_t = (np.diff(r ** (m - 1) * u) / volumes - e_r) / (m - 1) if m > 1 else 0.0 * e_r
    s_r, s_t = eq.viscous_stress(y[0 : 3 * N : 3] / W, e_r, e_t, m, d.mu, d.lam)
    return 0.5 * np.sum(volumes * (s_r * e_r + (m - 1) * s_t * e_t))


@DIMENSIONS
@pytest.mark.parametrize("lam", [0.7, -0.6])
def test_viscous_forces_are_the_derivatives_of_the_dissipation(m: int, lam: float) -> None:
    scheme = make(m, lambda_alpha=lam, mu_alpha=1.3)
    y = rough(scheme, 4)
    rates(scheme, y)
    work, u = scheme.work.model, velocities(y)
    for f in range(1, N + 1):
        side = [dissipation(u + sign * np.eye(N + 1)[f], scheme, y) for sign in (1.0, -1.0)]  # exact for a quadratic, whatever the step
        force = work[eulerian._FORCE_P, f - 1] + (work[eulerian._FORCE_M, f] if f < N else 0.0)
        assert force == pytest.approx(0.5 * (side[0] - side[1]), rel=1e-11, abs=1e-11)  # rounding of sums of order 1e3


@DIMENSIONS
@pytest.mark.parametrize("changes", [{}, {"kappa": 0.0}, {"lambda_alpha": 50.0}, {"lambda_alpha": -0.66, "mu_alpha": 1.0}], ids=str)
def test_momentum_rows_are_symmetric_and_positive_definite_in_u(m: int, changes: dict[str, float]) -> None:
    """And linear; also with cells that have died, alpha at 0, 1e-20 and a little below 0."""
    scheme = make(m, **changes)
    y = rough(scheme, 6)
    # Of the matrix with ones on its diagonal: 1/N^2 by its second differences, and a few percent of it near the bound lambda = -2 mu/3;
    # with a floored core between the living cells and the centre, FLOOR of that.
    for least in (1e-5, 1e-13):
        matrix = full_tangent(scheme, y)[2 : 3 * N : 3, 2 : 3 * N : 3]
        other = y.copy()
        other[2 : 3 * N : 3] *= -3.0
        scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        assert np.all(np.diag(matrix) > 0.0)
        assert np.array_equal(full_tangent(scheme, other)[2 : 3 * N : 3, 2 : 3 * N : 3], matrix)
        assert np.abs((matrix - matrix.T) / scale).max() < 1e-14  # rounding
        assert np.linalg.eigvalsh(matrix / scale).min() > least
        y[0:12:3] = y[3 * N] * np.array([0.0, 1e-20, 1e-9, -1e-6])


@DIMENSIONS
def test_uniform_growth_has_no_shear(m: int) -> None:
    """u ~ r: e_t = e_r to rounding in each cell, the first included, so forces cancel inside and act on the surface alone."""
    scheme = make(m, lambda_alpha=0.7, kappa=0.0, p_out=0.3)
    d, y, growth = scheme.data(0.0), scheme.initial(), 0.31
    R = (m * y[3 * N]) ** (1.0 / m)
    r = R * scheme.grid.faces
    y[0 : 3 * N : 3], y[2 : 3 * N : 3] = 0.85 * y[3 * N], growth * r[1:]
    f = rates(scheme, y)
    if m > 1:
        for i in range(N):
            _, by_m, by_p, _, _, _ = radial.hoop_stretch(r[i], r[i + 1], r[i], r[i + 1], m)
            e_r = growth * (r[i + 1] - r[i]) / (r[i + 1] - r[i])
            assert by_m * growth * r[i] + by_p * growth * r[i + 1] == pytest.approx(e_r, rel=1e-14)
    assert np.abs(f[2 : 3 * (N - 1) : 3]).max() < 1e-12
    contact = eq.contact_pressure(0.85, d.gamma, d.alpha_star, d.alpha_min, d.sigma_width)
    assert f[3 * N - 1] / R ** (m - 1) == pytest.approx(0.85 * (2.0 * d.mu + m * d.lam) * growth - contact - 0.3, rel=1e-12)


@DIMENSIONS
def test_face_values_are_the_fluxes_of_the_rates(m: int) -> None:
    scheme = make(m)
    y = rough(scheme, 7)
    out, d = np.empty((2, N + 1)), scheme.data(0.0)
    VISCOUS["face_values"](d, y, out, scheme.work.model)
    W, shares = y[3 * N], np.diff(scheme.grid.faces**m)
    alpha, C = y[0 : 3 * N : 3] / W, y[1 : 3 * N : 3]
    grown = W * eq.net_growth(alpha, C, d.s1, d.s2, d.s3, d.s4)
    np.testing.assert_allclose(rates(scheme, y)[0 : 3 * N : 3], grown - np.diff(out[0]) / shares, rtol=1e-12, atol=1e-12)
    r = (m * W) ** (1.0 / m) * scheme.grid.faces
    c = r ** (m - 1) * velocities(y) - scheme.grid.faces**m * y[3 * N + 1]
    np.testing.assert_allclose(out[1, 1:-1], c[1:-1], rtol=1e-12)
    assert np.all(out[:, [0, -1]] == 0.0)


def perturbed(scheme: Any, change: Callable[[np.ndarray], None]) -> np.ndarray:
    y = scheme.initial()
    change(y)
    return y


@DIMENSIONS
def test_reach_keeps_the_body_and_its_fluid(m: int) -> None:
    """A tenth of W and of 1 - alpha stays; 0 where they are gone already."""
    scheme = make(m)
    d, y = scheme.data(0.0), scheme.initial()
    reach, W = VISCOUS["reach"], scheme.initial()[3 * N]
    assert reach(d, y, np.zeros_like(y)) == 1.0
    change = np.zeros_like(y)
    change[3 * N] = -1.8 * W  # and all cells' alpha with it
    change[0 : 3 * N : 3] = -1.8 * y[0 : 3 * N : 3]
    assert reach(d, y, change) == pytest.approx(0.5, rel=1e-15)
    change = np.zeros_like(y)
    change[3] = 0.36 * W  # alpha from 0.8 to 1.16
    assert reach(d, y, change) == pytest.approx(0.5, rel=1e-12)
    change[3] = -5.0 * W  # alpha below 0 is left to `admit`
    assert reach(d, y, change) == 1.0

    def no_size(y: np.ndarray) -> None:
        y[3 * N] = 0.0

    def no_fluid(y: np.ndarray) -> None:
        y[3] = y[3 * N]

    for broken in (no_size, no_fluid):
        assert reach(d, perturbed(scheme, broken), np.zeros_like(y)) == 0.0


@DIMENSIONS
def test_admit_says_what_is_broken_and_bounds_the_rest(m: int) -> None:
    scheme = make(m)
    d, W = scheme.data(0.0), scheme.initial()[3 * N]
    admit, work = VISCOUS["admit"], scheme.work.model

    def case(number: int, place: int, value: float) -> None:
        y = scheme.initial()
        y[place] = value
        assert admit(d, y, work) == number

    case(0, 0, 0.5 * W)
    case(1, 3 * N, 0.0)
    case(1, 3 * N, np.nan)
    case(2, 6, W)
    case(2, 6, -1.01 * d.rtol * W)
    case(2, 6, np.nan)
    case(3, 1, -1.01 * d.rtol)
    case(3, 1, np.nan)
    case(0, 1, -0.9 * d.rtol)
    assert all(number in scheme.bounds for number in (1, 2, 3))
    # alpha a little below 0 is brought back, and the sum of cells kept
    y, shares = scheme.initial(), np.diff(scheme.grid.faces**m)
    y[6], y[12] = -0.9 * d.rtol * W, -0.3 * d.rtol * W
    before = shares @ y[0 : 3 * N : 3]
    assert admit(d, y, work) == 0
    assert y[0 : 3 * N : 3].min() == 0.0
    assert shares @ y[0 : 3 * N : 3] == pytest.approx(before, rel=1e-15)
