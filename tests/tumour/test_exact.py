"""The exact solutions against the equations they solve, against each other, and against values computed elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from multiphase.errors import ParameterError, SolverError
from tumour import equations as eq
from tumour import exact
from tumour.parameters import TumourParameters

DIMENSIONS = pytest.mark.parametrize("m", [1, 2, 3])


@DIMENSIONS
def test_oxygen_solves_its_equation(m: int) -> None:
    R, alpha, Q, h = 3.0, 0.7, 1.3, 1e-2
    r = np.linspace(0.1, 2.9, 29)

    def C(at: Any) -> np.ndarray:
        return exact.oxygen(at, R, alpha, m, Q=Q, C_out=2.0)

    near = {k: C(r + k * h) for k in (-2, -1, 0, 1, 2)}
    slope = (near[-2] - 8 * near[-1] + 8 * near[1] - near[2]) / (12 * h)
    curvature = (-near[-2] + 16 * near[-1] - 30 * near[0] + 16 * near[1] - near[2]) / (12 * h**2)
    # h^4/90 times a sixth derivative of order 1, and rounding 1e-16/h^2
    np.testing.assert_allclose(curvature + (m - 1) / r * slope, eq.oxygen_uptake(alpha, near[0], Q, 0.0), atol=1e-9)
    assert C(R) == pytest.approx(2.0, rel=1e-15)
    assert C(1e-4) - C(0.0) < 1e-7  # no slope at the centre: (1e-4)^2 times half the curvature


@pytest.mark.parametrize(("m", "centre", "size"), [(1, 0.8287, 2.996), (2, 0.9070, 4.021), (3, 0.9363, 4.786)])
def test_oxygen_at_the_centre(m: int, centre: float, size: float) -> None:
    C_star = eq.critical_oxygen(0.8, 10.0, 0.5, 0.5, 10.0)
    assert exact.oxygen(0.0, 1.0, 0.8, m, Q=0.5) == pytest.approx(centre, abs=5e-5)
    assert exact.oxygen(0.0, 1.0, 0.8, m, Q=0.5) == pytest.approx([1 / np.cosh(z), 1 / np.i0(z), z / np.sinh(z)][m - 1], rel=1e-14)
    assert brentq(lambda R: exact.oxygen(0.0, R, 0.8, m, Q=0.5) - C_star, 0.1, 9.0) == pytest.approx(size, abs=5e-4)


z = np.sqrt(0.4)


@DIMENSIONS
def test_oxygen_in_huge_and_hungry_bodies(m: int) -> None:
    r = np.array([0.0, 0.5e6, 1e6 - 1.0, 1e6])
    with np.errstate(all="raise", under="ignore"):
        C = exact.oxygen(r, 1e6, 0.8, m, Q=0.5)
    np.testing.assert_allclose(C, [0.0, 0.0, np.exp(-z), 1.0], rtol=1e-5)  # flat, to the curvature 1e-6
    assert np.array_equal(exact.oxygen(r, 1e6, 0.8, m, Q=0.0), np.ones(4))


TABLE = """
1 1 1.0923430 0.8117529 1.4679690 0.8388461 1.9444887 0.8568188 2.8733076 0.8765177
2 1 1.0985898 0.8085386 1.5249949 0.8301917 2.1261264 0.8462516 3.4931082 0.8662378
3 1 1.1008306 0.8073934 1.5445091 0.8274310 2.1840981 0.8434796 3.6654035 0.8645434
1 0 1.0985898 0.8085386 1.5249949 0.8301917 2.1261264 0.8462516 3.4931082 0.8662378
2 0 1.1063141 0.8045622 1.6159765 0.8158449 2.5042379 0.8228957 5.6777539 0.8290438
3 0 1.1091490 0.8031117 1.6506122 0.8106313 2.6567389 0.8145863 6.7525022 0.8158378
"""
ROWS = [[float(number) for number in line.split()] for line in TABLE.split("\n") if line]


def free(**changes: Any) -> TumourParameters:
    """The paper's values without drag and uptake."""
    return TumourParameters(**{"kappa": 0.0, "Q": 0.0, **changes})


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"m={row[0]:g}, lambda={row[1]:g}")
def test_uniform_growth_at_the_values_computed_elsewhere(row: list[float]) -> None:
    J, alpha = exact.uniform_growth([1.0, 5.0, 10.0, 20.0], free(lambda_alpha=row[1]), int(row[0]))
    np.testing.assert_allclose(J, row[2::2], atol=5.1e-8)
    np.testing.assert_allclose(alpha, row[3::2], atol=5.1e-8)


def other_way(times: np.ndarray, p: TumourParameters, m: int, alpha_0: float) -> tuple[np.ndarray, np.ndarray]:
    """The same growth with the mass of cells N = alpha J for an unknown, and J for each N from a search; there is no fold in N."""
    mu, lam = p.moduli

    def volume(N: float) -> float:
        def force(J: float) -> float:
            return mu * (J ** (2.0 / m) - 1.0) + lam * J * (J - 1.0) - eq.contact_pressure(N / J, *p.contact) * J

        if p.alpha_star >= N:
            return 1.0
        high = (1.0 + 1e-9) * N / max(p.alpha_star, 1e-3)  # where cells no longer touch, or hardly
        return float(brentq(force, max(1.0, N * (1.0 + 1e-9)), high, xtol=1e-15, rtol=1e-14))

    def rate(_: float, N: np.ndarray) -> list[float]:
        J = volume(N[0])
        return [J * eq.net_growth(N[0] / J, p.C_out, *p.kinetics)]

    solution = solve_ivp(rate, (0.0, times[-1]), [alpha_0], t_eval=times, rtol=1e-12, atol=1e-13, method="DOP853")
    J = np.array([volume(N) for N in solution.y[0]])
    return J, solution.y[0] / J


@pytest.mark.parametrize(
    ("m", "alpha_0", "changes"),
    [
        (3, 0.8, {}),
        (2, 0.7, {}),  # rests until the cells touch
        (3, 0.9, {"lambda_alpha": 0.5}),  # swells at once
        (1, 0.9, {"C_out": 0.05}),  # swells at once, shrinks back and thins out at rest
        (2, 0.8, {"C_out": 0.1}),  # thins out at rest
        (2, 0.3, {"gamma": 5.0, "alpha_star": 0.1, "alpha_min": 0.1, "mu_alpha": 0.7}),
        (1, 0.6, {"lambda_alpha": -0.6}),
        (2, 0.5, {"alpha_star": 0.0, "alpha_min": 0.0}),
    ],
)
def test_uniform_growth_in_every_regime(m: int, alpha_0: float, changes: dict[str, float]) -> None:
    p, times = free(**changes), np.linspace(0.0, 12.0, 13)
    J, alpha = exact.uniform_growth(times, p, m, alpha_0)
    expected = other_way(times, p, m, alpha_0)
    # the other way loses some digits at its kink, N = alpha_star, and in its search
    np.testing.assert_allclose(J, expected[0], rtol=1e-9)
    np.testing.assert_allclose(alpha, expected[1], rtol=1e-9)
    assert J[0] * alpha[0] == pytest.approx(alpha_0, rel=1e-14)  # at once, but with the cells there are
    pressed = J > 1.0
    force = p.mu_alpha * (J ** (2 / m) - 1.0) + p.lambda_alpha * J * (J - 1.0) - eq.contact_pressure(alpha, *p.contact) * J
    assert np.max(np.abs(force[pressed]), initial=0.0) < 1e-12


def test_uniform_growth_where_nothing_happens_and_where_cells_do_not_push() -> None:
    fraction = eq.homeostatic_fraction(1.0, 10.0, 0.5, 0.5, 10.0)
    for alpha_0, changes in ((0.8, {"C_out": 0.0, "s2": 0.0}), (fraction, {"alpha_star": fraction, "alpha_min": fraction})):
        J, alpha = exact.uniform_growth([0.0, 30.0], free(**changes), 2, alpha_0)
        np.testing.assert_allclose(J, 1.0, rtol=1e-12)
        np.testing.assert_allclose(alpha, alpha_0, rtol=1e-12)
    J, alpha = exact.uniform_growth([0.0, 300.0], free(gamma=0.0), 2)
    np.testing.assert_allclose(J, 1.0)
    np.testing.assert_allclose(alpha, [0.8, fraction], rtol=1e-9)  # of itself alpha tends to where births and deaths balance


def test_uniform_growth_far_on() -> None:
    """lambda = 0: alpha has no ceiling but that of growth in a slab, tends to 5/6 in a disk, and has a maximum in a sphere."""
    times = np.linspace(0.0, 40.0, 801)
    disk = exact.uniform_growth(200.0, free(), 2)
    ceiling = brentq(lambda a: eq.contact_pressure(a, 1.0, 0.8, 0.8, 0.0) - 1.0, 0.8, 0.99)
    assert ceiling == pytest.approx(5 / 6, rel=1e-12)
    assert disk[0] > 1e6
    assert disk[1] == pytest.approx(5 / 6, rel=1e-6)
    J, alpha = exact.uniform_growth(times, free(), 3)
    top = int(np.argmax(alpha))
    assert alpha[top] == pytest.approx(0.81597, abs=5e-6)
    assert J[top] == pytest.approx(3 * np.sqrt(3), rel=0.01)  # flat there, and a step of 0.05 in time
    assert alpha[-1] < alpha[top] - 1e-3
    assert exact.uniform_growth(200.0, free(), 1)[1] > 0.9


def test_times_in_any_order_and_shape() -> None:
    p = free(C_out=0.05)
    J, alpha = exact.uniform_growth(np.array([[3.0, 0.5], [0.5, 60.0]]), p, 1, 0.9)
    assert J.shape == alpha.shape == (2, 2)
    assert J[0, 1] == J[1, 0]
    for at, expected in ((3.0, J[0, 0]), (60.0, J[1, 1])):
        assert exact.uniform_growth(at, p, 1, 0.9)[0] == pytest.approx(expected, rel=1e-11)
    assert exact.uniform_growth_eulerian(2.0, free(), 2)[0].shape == ()
    for t in (-1.0, np.nan, [0.0, np.inf]):
        with pytest.raises(ParameterError, match="t: times must be finite"):
            exact.uniform_growth(t, free(), 2)


EULERIAN = {
    (1, 0): (0.8075253, (1.097272, 1.647220, 2.737150, 7.557749)),
    (2, 1): (0.8075253, (1.047507, 1.283441, 1.654433, 2.749136)),
    (3, 0): (0.8027579, (1.034922, 1.192561, 1.423794, 2.029457)),
}


@pytest.mark.parametrize(("m", "lam"), EULERIAN)
def test_uniform_growth_of_a_viscous_body(m: int, lam: float) -> None:
    fraction, radii = EULERIAN[m, lam]
    alpha, R = exact.uniform_growth_eulerian([1.0, 5.0, 10.0, 20.0], free(lambda_alpha=lam), m)
    np.testing.assert_allclose(alpha[2:], fraction, atol=5.1e-8)
    np.testing.assert_allclose(R, radii, atol=5.1e-7)
    # cells are conserved but for births and deaths: ln(alpha R^m) has the rate q/alpha
    times = np.linspace(0.0, 4.0, 2001)
    p = free(lambda_alpha=lam, p_out=0.02, sigma_width=0.3, alpha_min=0.6)
    alpha, R = exact.uniform_growth_eulerian(times, p, m, 0.5, radius=2.0)
    gain = eq.net_growth(alpha, 1.0, *p.kinetics) / alpha
    total = np.sum(gain[:-2:2] + 4 * gain[1::2] + gain[2::2]) * (times[1] / 3)  # Simpson's rule, error h^4
    assert np.log(alpha[-1] * R[-1] ** m / (0.5 * 2.0**m)) == pytest.approx(total, abs=1e-10)
    assert R[0] == pytest.approx(2.0, rel=1e-15)
    with pytest.raises(SolverError, match=r"ends at t = 0\.[0-9]+"):  # fluid pressure dilutes the cells, to nothing in a finite time
        exact.uniform_growth_eulerian(50.0, free(lambda_alpha=lam, p_out=5.0), m)


WATER: dict[str, float] = {"s1": 0.0, "s2": 0.0, "s3": 0.0, "Q": 0.0}
SWELLING = {
    1: (0.01786717, 0.05552962, -1.46665135, 0.07629562),
    2: (0.01590396, 0.04288621, -1.06982165, 0.05484663),
    3: (0.01357073, 0.03368648, -0.78600502, 0.04005596),
}
GENERAL = {"mu_alpha": 0.7, "lambda_alpha": 1.9, "gamma": 0.4, "alpha_star": 0.6, "alpha_min": 0.6, "kappa": 2.3}


@DIMENSIONS
def test_linear_swelling_at_the_values_computed_elsewhere(m: int) -> None:
    body = exact.LinearSwelling(TumourParameters(**WATER, C_out=1e-3), m, terms=60)
    assert body.source == pytest.approx(1e-3 * 0.16, rel=1e-14)
    found = [*body.displacement([0.5, 1.0], 0.1), body.pressure(0.0, 0.1), body.fraction_change(0.0, 0.1)]
    np.testing.assert_allclose(np.array(found) / body.source, SWELLING[m], atol=5.1e-9)
    roots = {1: (np.pi / 2, 1.5 * np.pi), 2: (2.35725118, 5.49984112), 3: (3.06753283, 6.24742667)}[m]
    np.testing.assert_allclose(body.roots[:2], roots, atol=5.1e-9)


@DIMENSIONS
@pytest.mark.parametrize("changes", [{}, GENERAL], ids=["paper", "general"])
def test_linear_swelling_solves_its_equations(m: int, changes: dict[str, float]) -> None:
    """Equations, boundary and initial conditions as the linearised model states them: s = eps alpha*(1 - alpha*), the stress
    ``2 mu eps(d) + lambda e I - (p + G a) I`` in balance, ``a = s t - alpha* e`` and ``e_t = M Lap p``."""
    p = TumourParameters(**{**WATER, "C_out": 1.0, **changes})
    R_0 = 1.7
    body = exact.LinearSwelling(p, m, R_0, terms=150)
    mu, lam = p.moduli
    G, M = p.gamma * p.alpha_star / (1.0 - p.alpha_star) ** 2, eq.mobility(p.alpha_star, *p.flow)
    R = np.linspace(0.1, R_0, 9)
    for scaled in (0.02, 0.3):
        t, h = scaled * R_0**2 / body.diffusivity, 2e-3

        def along(function: Callable[..., np.ndarray], at: Any, t: float = t, h: float = h) -> np.ndarray:
            # fourth order; the series may be evaluated beyond R_0
            return (function(at - 2 * h, t) - 8 * function(at - h, t) + 8 * function(at + h, t) - function(at + 2 * h, t)) / (12 * h)

        tau = 1e-4 * t
        speed = (body.displacement(R, t + tau) - body.displacement(R, t - tau)) / (2 * tau)
        d, e, a = body.displacement(R, t), body.dilation(R, t), body.fraction_change(R, t)
        size = body.source * t
        np.testing.assert_allclose(e, along(body.displacement, R) + (m - 1) * d / R, atol=1e-7 * size)
        np.testing.assert_allclose(a, body.source * t - p.alpha_star * e, atol=1e-13 * size)
        # the fluid moves as the cells leave room: e_t = M Lap p, integrated once from the centre
        np.testing.assert_allclose(speed, M * along(body.pressure, R), rtol=2e-6, atol=1e-7 * np.abs(speed).max())

        def radial_stress(at: Any, t: float) -> np.ndarray:
            pore = body.pressure(at, t) + G * body.fraction_change(at, t)
            return 2 * mu * along(body.displacement, at, t) + lam * body.dilation(at, t) - pore

        difference = 2 * mu * (along(body.displacement, R) - d / R)
        balance = along(radial_stress, R) + (m - 1) * difference / R
        # two differences in a row: rounding 1e-16/h^2 of terms of order G s t, and h^4 times a sixth derivative
        np.testing.assert_allclose(balance, 0.0, atol=3e-6 * G * size)
        assert abs(radial_stress(R_0, t)) < 1e-8 * G * size
        assert abs(body.pressure(R_0, t)) < 1e-12 * G * size
        assert body.displacement(0.0, t) == 0.0
        assert np.all(body.pressure(R[:-1], t) < 0.0)  # suction
    long = exact.LinearSwelling(p, m, R_0, terms=2000)
    assert np.abs(long.displacement(R, 0.0)).max() < 1e-9 * G * body.source / (body.diffusivity * long._H)  # terms fall as 1/n^4
    late = 40.0 * R_0**2 / body.diffusivity
    K = lam + G * p.alpha_star + 2 * mu / m
    np.testing.assert_allclose(body.pressure(R, late), body.source * G / K * (R**2 - R_0**2) / (2 * m * M), rtol=1e-9, atol=1e-10 * G)


@DIMENSIONS
def test_linear_swelling_is_the_limit_of_uniform_growth(m: int) -> None:
    """With ever less drag the body grows uniformly, J - 1 = A s t, and the nonlinear solution departs from it as eps^2."""
    changes = {**WATER, "mu_alpha": 0.7, "lambda_alpha": 0.3}
    departures = []
    for eps in (1e-3, 5e-4):
        swelling = exact.LinearSwelling(TumourParameters(**changes, kappa=1e-9, C_out=eps), m)
        J, alpha = exact.uniform_growth(1.0, free(**changes, C_out=eps), m)
        departures.append([J - 1.0 - swelling.dilation(0.3, 1.0), alpha - 0.8 - swelling.fraction_change(0.3, 1.0)])
        assert np.all(np.abs(departures[-1]) < 5.0 * eps**2)
    np.testing.assert_allclose(np.array(departures[0]) / departures[1], 4.0, rtol=0.02)  # the next order is smaller by eps


@DIMENSIONS
@pytest.mark.parametrize("share", [0.0, 1e-6, 0.3, 0.999999])
def test_no_root_is_missed(m: int, share: float) -> None:
    eta = share * m
    roots = exact._roots(m, eta, 40)
    fine = np.linspace(1e-3, roots[-1] + 0.01, 200_001)
    signs = np.sign(fine * exact._psi(m, fine) + eta * exact._psi_slope(m, fine))
    assert np.count_nonzero(signs[1:] * signs[:-1] < 0) == (40 if roots[0] > 1e-2 else 39 + (roots[0] > 1e-3))
    assert np.all(np.diff(roots) > 1.0)
    residual = roots * exact._psi(m, roots) + eta * exact._psi_slope(m, roots)
    assert np.all(np.abs(residual) < 2e-14 * (1.0 + roots**2))  # roots to a relative 1e-14, times a slope of order x


def test_the_slope_of_the_profile_of_the_sphere_near_the_centre() -> None:
    x = np.array([0.0999, 0.1001])  # the series and the closed form, either side of where they meet
    np.testing.assert_allclose(exact._psi_slope(3, x), (x * np.cos(x) - np.sin(x)) / x**2, rtol=1e-13)
    assert exact._psi_slope(3, np.array(0.0)) == 0.0


@pytest.mark.parametrize(
    ("call", "path"),
    [
        (lambda: exact.uniform_growth(1.0, TumourParameters(Q=0.0), 2), "parameters.kappa"),
        (lambda: exact.uniform_growth(1.0, TumourParameters(kappa=0.0), 2), "parameters.Q"),
        (lambda: exact.uniform_growth(1.0, free(p_out=0.1), 2), "parameters.p_out"),
        (lambda: exact.uniform_growth(1.0, free(alpha_min=0.7), 2), "parameters.alpha_min"),
        (lambda: exact.uniform_growth(1.0, free(sigma_width=0.1), 2), "parameters.sigma_width"),
        (lambda: exact.uniform_growth(1.0, free(lambda_alpha=-0.1), 2), "parameters.lambda_alpha"),
        (lambda: exact.uniform_growth(1.0, free(), 4), "m"),
        (lambda: exact.uniform_growth(1.0, free(), 2, 1.0), "initial.alpha"),
        (lambda: exact.uniform_growth_eulerian(1.0, free(lambda_alpha=-1.0), 2), "parameters.lambda_alpha"),
        (lambda: exact.uniform_growth_eulerian(1.0, free(alpha_min=0.7), 2), "parameters.alpha_min"),
        (lambda: exact.LinearSwelling(TumourParameters(), 2), "parameters.s1"),
        (lambda: exact.LinearSwelling(TumourParameters(**WATER, kappa=0.0), 2), "parameters.kappa"),
        (lambda: exact.LinearSwelling(TumourParameters(**WATER), 2, radius=0.0), "geometry.radius"),
    ],
)
def test_parameters_without_this_solution_are_refused(call: Callable[[], Any], path: str) -> None:
    with pytest.raises(ParameterError) as caught:
        call()
    assert caught.value.path == path
