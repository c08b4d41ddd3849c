"""The wall of a round vessel: its limit of a large radius, its balances and exact solutions, and its slip and pressure against
Chebyshev collocation of the momentum balances as they stand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from multiphase.stepping import Control, integrate, start
from plaque1d import equations as eq
from plaque1d.semidiscrete import KERNEL

FORMS = {"interfacial": {}, "drag": {"momentum": "drag", "p_out": 1.0}}
UNEQUAL = {"mu_n": 0.2, "lambda_n": 0.3, "mu_m": 0.6, "lambda_m": -0.25}
FIELDS = ("n", "l", "u_n", "u_m", "p_n")


def _end(scheme, t_end=1.0):
    control = Control()
    state = integrate(scheme, start(scheme, 0.0, t_end, control), [0.0, t_end], control)
    return scheme.observe(t_end, state.u[0]), state


def _rates(scheme, y):
    out = np.empty_like(y)
    KERNEL["rates"](scheme.data(0.0), 0.0, y, out, scheme.work.model)
    return out


def _radii(scheme, W, share):
    return np.sqrt(scheme.geometry.inner_radius**2 + 2.0 * W * share)


def _floorless(scheme):
    """The same scheme without the floor of the fractions, which changes w by some 1e-9."""
    return type(scheme)(scheme.parameters, scheme.initial_values, scheme.geometry, scheme.grid.cells, scheme.rtol, floor=0.0)


# -- the limit of a large radius ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_the_difference_from_the_slab_falls_with_the_curvature(make_lines, form):
    slab, _ = _end(make_lines(24, 1e-8, **UNEQUAL, **FORMS[form]))
    found = []
    for R_1 in (10.0, 1e2, 1e3, 1e4):
        s, _ = _end(make_lines(24, 1e-8, lumen_radius=R_1, **UNEQUAL, **FORMS[form]))
        fields = [np.max(np.abs(s.fields[name] - slab.fields[name])) for name in FIELDS]
        found.append(fields + [abs(s.scalars[name] - slab.scalars[name]) for name in ("L", "n_total", "c_total")])
    ratios = np.array(found[:-1]) / np.array(found[1:])
    # The next order is L/R_1 = 0.1 of the first at R_1 = 10, times a number of order one; at 1e4 errors of the steps are 1e-3 of the rest.
    np.testing.assert_allclose(ratios[0], 10.0, rtol=0.2)
    np.testing.assert_allclose(ratios[1:], 10.0, rtol=0.02)


@pytest.mark.parametrize("form", FORMS)
def test_a_vessel_of_infinite_radius_is_a_slab(make_lines, form):
    slab, _ = _end(make_lines(24, 1e-6, **UNEQUAL, **FORMS[form]))
    wide, _ = _end(make_lines(24, 1e-6, lumen_radius=1e9, **UNEQUAL, **FORMS[form]))
    for name in FIELDS:
        # 1/R_1 = 1e-9 times a number of order one; both take the same steps
        np.testing.assert_allclose(wide.fields[name], slab.fields[name], atol=1e-8)
    for name in ("L", "L_rate", "n_total", "c_total", "l_total"):
        assert wide.scalars[name] == pytest.approx(slab.scalars[name], abs=1e-8)


# -- balances and geometry ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["lines", "radau"])
@pytest.mark.parametrize("R_1", [0.5, 5.0])
def test_amounts_balance_over_the_area(make_lines, form, kind, R_1):
    scheme = make_lines(30, 1e-4, kind=kind, lumen_radius=R_1, **UNEQUAL, **FORMS[form])
    s, state = _end(scheme)
    assert state.counters["steps"] > 8
    assert all(abs(s.scalars[f"defect_{name}"]) < 1e-11 for name in "nclL")  # rounding of a few hundred additions
    # The same amounts from what is stored: cells between two circles, whose areas follow from the stored width.
    R_2 = R_1 + s.scalars["L"]
    rings = np.sqrt(np.linspace(R_1**2, R_2**2, 31))
    areas = 0.5 * np.diff(rings**2)
    for name in "ncl":
        assert np.sum(areas * s.fields[name]) / R_1 == pytest.approx(s.scalars[f"{name}_total"], rel=1e-12)
    np.testing.assert_allclose((R_1 + s.x) ** 2, 0.5 * (rings[:-1] ** 2 + rings[1:] ** 2), rtol=1e-12)
    assert s.scalars["L_rate"] == pytest.approx(R_1 * scheme.parameters.Psi_m * s.scalars["l_wall"] / R_2, rel=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_a_source_flow_keeps_a_uniform_fraction_uniform(make_lines, form):
    """u_n = (V - k)/r has no divergence, whatever the grid does: W n grows as W in every cell but the first, into which n does not flow."""
    n, k, W, V = 0.3, 0.21, 2.0, 0.7
    scheme = make_lines(40, lumen_radius=0.5, n=n, k_m=0.0, **FORMS[form])
    y = scheme.initial()
    radii = _radii(scheme, W, scheme.grid.faces[1:-1])
    y[scheme.n], y[scheme.size], y[scheme.size + 1] = W * n, W, V
    y[scheme.w] = k / (radii * (1.0 - n))
    rates = _rates(scheme, y)[scheme.n]
    expected = np.full(40, n * V)
    expected[0] = -((1.0 - 1.0 / 40) * V - k) * n * 40
    expected[-1] = n * V - n * k * 40  # nor does it leave the last
    np.testing.assert_allclose(rates, expected, rtol=1e-12)  # rounding of fluxes over h


@pytest.mark.parametrize("form", FORMS)
def test_a_uniform_wall_without_influx_stays_as_it_is(make_lines, form):
    quiet = {"n": 0.3, "l": 0.4, "Psi_l": 0.0, "Psi_m": 0.0, "k_l": 0.0, "k_m": 0.0}
    scheme = make_lines(40, lumen_radius=0.5, **quiet, **UNEQUAL, **FORMS[form])
    s, _ = _end(scheme, 1000.0)
    assert s.scalars["L"] == pytest.approx(0.5, rel=1e-15)
    # rounding of products, divided by W
    np.testing.assert_allclose(s.fields["n"], 0.3, rtol=1e-13)
    np.testing.assert_allclose(s.fields["l"], 0.4, rtol=1e-13)
    assert np.max(np.abs(s.fields["u_n"])) < 1e-13


# -- exact solutions ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("R_1", [0.5, 5.0])
def test_without_uptake_the_area_grows_steadily(make_lines, form, R_1):
    """k_l = 0: a uniform l = sqrt(Psi_l/Psi_m) is carried by u = Q/r, which has no divergence, and the area grows by Q = R_1 sqrt(Psi_l
    Psi_m) per radian, whatever n does."""
    Psi_l, Psi_m, t_end = 1.3, 0.7, 1.5
    level, Q = np.sqrt(Psi_l / Psi_m), R_1 * np.sqrt(Psi_l * Psi_m)
    scheme = make_lines(20, 1e-6, lumen_radius=R_1, Psi_l=Psi_l, Psi_m=Psi_m, k_l=0.0, l=float(level), **UNEQUAL, **FORMS[form])
    s, _ = _end(scheme, t_end)
    R_2 = np.sqrt((R_1 + 0.5) ** 2 + 2.0 * Q * t_end)
    # what Newton's method leaves, far below rtol as the solution is linear in time
    np.testing.assert_allclose(s.fields["l"], level, rtol=1e-9)
    assert s.scalars["L"] == pytest.approx(R_2 - R_1, rel=1e-9)
    assert s.scalars["L_rate"] == pytest.approx(Q / R_2, rel=1e-9)
    assert np.ptp(s.fields["n"]) > 0.05  # n is far from uniform


def _bessel(R_1, R_2, number):
    """Wave number k, and the mode J_0(kr) Y_1(kR_1) - Y_0(kr) J_1(kR_1), which has no slope at R_1 and R_2."""

    def slope(k):
        return j1(k * R_2) * y1(k * R_1) - y1(k * R_2) * j1(k * R_1)

    guess = number * np.pi / (R_2 - R_1)
    k = brentq(slope, guess, 1.3 * guess, xtol=1e-14)
    return k, lambda r: j0(k * r) * y1(k * R_1) - y0(k * r) * j1(k * R_1)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("viscosity", [{"mu_n": 0.1, "mu_m": 0.1}, {"mu_n": 0.02, "lambda_n": 0.1, "mu_m": 0.3, "lambda_m": -0.1}])
def test_bessel_modes_grow_at_the_rates_of_the_dispersion_relation(make_lines, form, viscosity):
    """About a uniform state without influx, n and l follow J_0 and w follows J_1; both Laplacians give -k^2, so k stands for the wave
    number, and only nu counts of the viscosities."""
    n, l, L, R_1 = 0.3, 0.6, 2.0, 0.7
    values = {"Psi_l": 0.0, "Psi_m": 0.0, "A": 1.0, "B": 0.8, "k": 2.0, "b": 4.0, "k_l": 1.5, "k_m": 0.7, **viscosity, **FORMS[form]}
    number, mode = _bessel(R_1, R_1 + L, 2)
    points, weights = np.polynomial.legendre.leggauss(5)
    errors = []
    for cells in (50, 100, 200):
        scheme = make_lines(cells, lumen_radius=R_1, n=n, l=l, L=L, **values)
        p, W = scheme.parameters, scheme.geometry.size(L)
        shape = mode(_radii(scheme, W, scheme.grid.centres[:, None] + 0.5 * scheme.grid.spacing * points)) @ (0.5 * weights)
        matrix = np.empty((2, 2))
        for column, part in enumerate((scheme.n, scheme.l)):
            slopes = []
            for sign in (1e-6, -1e-6):
                y = scheme.initial()
                y[part] += sign * W * shape
                slopes.append(_rates(scheme, scheme.consistent(0.0, y)))
            slope = (slopes[0] - slopes[1]) / (2e-6 * W)
            matrix[:, column] = [slope[row] @ shape / (shape @ shape) for row in (scheme.n, scheme.l)]
        exact = eq.dispersion_matrix(number, n, l, p.k_l, p.k_m, p.b, p.nu_n, p.nu_m, p.A, p.B, p.k, p.p_out, p.momentum)
        errors.append(np.abs(matrix / exact - 1.0))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    transport = np.array([[True, True], [False, True]])  # k_l l c has no derivative: nothing but rounding
    assert errors[-1].max() < 5e-4
    assert np.all(orders[:, transport] > 1.9)
    assert errors[-1][1, 0] < 1e-8  # rounding 1e-16 over 1e-6, and its sum


# -- the same steps in FiPy ---------------------------------------------------------------------------------------------------


def test_fipy_takes_the_same_steps_in_the_annulus(make_scheme, make_lines):
    control, ends = Control(), []
    for scheme in (make_scheme(12, 1e-3, lumen_radius=0.8, **UNEQUAL), make_lines(12, 1e-3, kind="lines", lumen_radius=0.8, **UNEQUAL)):
        state = integrate(scheme, start(scheme, 0.0, 0.1, control), [0.0, 0.5], control)
        ends.append((state.u[0][: scheme.size + 4], state.counters))
    assert ends[0][1] == ends[1][1]
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1e-9)  # what Newton's method leaves, squared at each of its iterations


# -- slip and pressure against collocation of the momentum balances -----------------------------------------------------------

DEGREE = 40


class _Collocation:
    """u_n, u_m (degree K) and p_n (degree K - 1) of given n(r), l(r) and Q, in Chebyshev polynomials.

    Continuity n u_n + c u_m = Q/r at K + 1 points; the balance of the necrotic phase and that of both phases at K - 1 inner points each;
    u_n(R_1) = 0, u_n(R_2) = Q/R_2, total radial traction -p_out at R_2. That is 3K + 2 equations for 3K + 2 coefficients.
    """

    def __init__(self, parameters, radii, Q, n, l, degree=DEGREE):
        self.p, self.K = parameters, degree
        self.middle, self.half = 0.5 * (radii[0] + radii[1]), 0.5 * (radii[1] - radii[0])
        K, p = degree, parameters
        self.sizes = (K + 1, K + 1, K)
        everywhere = self.middle - self.half * np.cos(np.pi * np.arange(K + 1) / K)
        inside = self.middle - self.half * np.cos(np.pi * (np.arange(K - 1) + 0.5) / (K - 1))
        inner, outer = np.array([radii[0]]), np.array([radii[1]])
        (f, slope), (at_l, l_slope) = n(inside), l(inside)
        stress, stress_l = eq.extra_stress(at_l, p.A, p.B, p.k), eq.extra_stress_slope(at_l, p.A, p.B, p.k)
        load = -slope * stress + (1.0 - f) * stress_l * l_slope  # (c Sigma)'
        force_n = self._force(inside, f, slope, p.mu_n, p.lambda_n)
        force_m = self._force(inside, 1.0 - f, -slope, p.mu_m, p.lambda_m)
        friction = (p.b * f * (1.0 - f))[:, None] * self._basis(inside, K)
        push = f[:, None] * self._basis(inside, K - 1, 1)
        if p.momentum == "drag":
            push = push + slope[:, None] * self._basis(inside, K - 1)
        share = n(everywhere)[0][:, None]
        end = n(outer)[0]
        rows = [
            self._rows(share * self._basis(everywhere, K), (1.0 - share) * self._basis(everywhere, K), None),
            self._rows(force_n - friction, friction, -push),
            self._rows(force_n, force_m, -self._basis(inside, K - 1, 1)),
            self._rows(self._basis(inner, K), None, None),
            self._rows(self._basis(outer, K), None, None),
            self._rows(
                -end * self._traction(outer, p.mu_n, p.lambda_n),
                -(1.0 - end) * self._traction(outer, p.mu_m, p.lambda_m),
                self._basis(outer, K - 1),
            ),
        ]
        contact = (1.0 - end) * eq.extra_stress(l(outer)[0], p.A, p.B, p.k)
        right = np.concatenate([Q / everywhere, np.zeros(K - 1), load, [0.0], Q / outer, p.p_out - contact])
        matrix = np.vstack(rows)
        assert matrix.shape == (3 * K + 2, 3 * K + 2)
        self.parts = np.split(np.linalg.solve(matrix, right), np.cumsum(self.sizes)[:2])

    def _basis(self, r, degree, order=0):
        coefficients = np.eye(degree + 1)
        if order:
            coefficients = chebyshev.chebder(coefficients, order)
        return chebyshev.chebval((r - self.middle) / self.half, coefficients).T / self.half**order

    def _rows(self, *blocks):
        height = max(len(block) for block in blocks if block is not None)
        return np.hstack([np.zeros((height, size)) if block is None else block for block, size in zip(blocks, self.sizes, strict=True)])

    def _force(self, r, phi, slope, mu, lambda_):
        """(phi (nu v' + lambda v/r))' + 2 mu phi (v' - v/r)/r."""
        v, v_r, v_rr = (self._basis(r, self.K, order) for order in range(3))
        nu, r, phi, slope = 2.0 * mu + lambda_, r[:, None], phi[:, None], slope[:, None]
        whole = slope * (nu * v_r + lambda_ * v / r) + phi * (nu * v_rr + lambda_ * (v_r / r - v / r**2))
        return whole + 2.0 * mu * phi * (v_r - v / r) / r

    def _traction(self, r, mu, lambda_):
        return (2.0 * mu + lambda_) * self._basis(r, self.K, 1) + lambda_ * self._basis(r, self.K) / r[:, None]

    def __call__(self, r):
        """Slip and pressure."""
        u_n, u_m, p_n = (self._basis(r, size - 1) @ part for size, part in zip(self.sizes, self.parts, strict=True))
        return u_m - u_n, p_n


def _profiles(R_1, L):
    """n(r) without slope at the endothelium, and l(r), each with its derivative."""

    def fraction(r):
        xi = (r - R_1) / L
        return 0.45 + 0.2 * np.cos(np.pi * xi), -0.2 * np.pi / L * np.sin(np.pi * xi)

    def concentration(r):
        xi = (r - R_1) / L
        return 1.0 - 0.6 * xi**2, -1.2 * xi / L

    return fraction, concentration


def _against_collocation(make_lines, form, R_1, cells):
    """Errors of w on the faces and of p_n in the cells."""
    settings = {"n": "0.45 + 0.2*cos(pi*xi)", "l": "1 - 0.6*xi**2", "L": 1.2, "b": 5.0, "A": 0.8, "B": 1.5, "k": 2.0}
    scheme = _floorless(make_lines(cells, kind="lines", lumen_radius=R_1, **settings, **UNEQUAL, **FORMS[form]))
    y = scheme.initial()
    W, Q = y[scheme.size], y[scheme.size + 1]  # Q differs from that of another grid by O(h): each is given its own
    # The slip and S come from the tangent; the rates must agree. Their terms are of order N W; rounding leaves up to 3e-13 of it.
    assert np.max(np.abs(_rates(scheme, y)[: len(scheme.mass)][scheme.mass == 0.0])) < 1e-11 * cells * W
    exact = _Collocation(scheme.parameters, (R_1, R_1 + 1.2), Q, *_profiles(R_1, 1.2))
    slip, _ = exact(_radii(scheme, W, scheme.grid.faces[1:-1]))
    _, pressure = exact(_radii(scheme, W, scheme.grid.centres))
    return y[scheme.w] - slip, scheme.observe(0.0, y).fields["p_n"] - pressure


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("R_1", [0.5, 3.0, 50.0])
def test_slip_and_pressure_solve_the_momentum_balances(make_lines, form, R_1):
    """Errors on 400, 800 and 1600 cells, extrapolated over h^2, then over h^3, at the faces and centres of the coarsest."""
    slips, pressures = [], []
    for times in (1, 2, 4):
        w, p = _against_collocation(make_lines, form, R_1, 400 * times)
        slips.append(w[times - 1 :: times])
        pressures.append(p if times == 1 else 0.5 * (p[times // 2 - 1 :: times] + p[times // 2 :: times]))
    for coarse, middle, fine in (slips, [p[1:] for p in pressures]):  # the first cell has its own test
        assert np.log2(np.max(np.abs(middle)) / np.max(np.abs(fine))) > 1.9
        assert np.max(np.abs(fine)) < 5e-5  # h^2 = 4e-7 times fourth derivatives, which 1/R_1 = 2 raises to 1e2
        second = (4.0 * middle - coarse) / 3.0, (4.0 * fine - middle) / 3.0
        assert np.max(np.abs((8.0 * second[1] - second[0]) / 7.0)) < 1e-8  # the same of h^4, and rounding of 1e-11


@pytest.mark.parametrize("form", FORMS)
def test_the_pressure_is_of_second_order_up_to_the_endothelium(make_lines, form):
    errors = [abs(_against_collocation(make_lines, form, 3.0, cells)[1][0]) for cells in (200, 400, 800)]
    assert np.all(np.log2(np.array(errors[:-1]) / np.array(errors[1:])) > 1.9)


@pytest.mark.parametrize("form", FORMS)
def test_collocation_is_resolved(make_lines, form):
    """Three quarters of the polynomials give the same slip and pressure: nothing of the comparison above is the collocation's own error."""
    parameters = make_lines(10, kind="lines", lumen_radius=0.5, **UNEQUAL, **FORMS[form]).parameters
    r = np.linspace(0.5, 1.7, 40)
    coarse, fine = (_Collocation(parameters, (0.5, 1.7), 0.4, *_profiles(0.5, 1.2), k)(r) for k in (3 * DEGREE // 4, DEGREE))
    np.testing.assert_allclose(coarse, fine, atol=1e-10)  # a hundredth of what is asked there
