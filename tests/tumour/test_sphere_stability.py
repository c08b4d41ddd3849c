"""The linearisation about radial balls: at a point, on the grid, against closed forms and pairs of runs; and when balls buckle."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Legendre, Polynomial
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import spherical_jn

from multiphase.errors import ParameterError
from multiphase.stepping import State, StopRun, Tracker
from tumour import TumourGeometry, TumourInitial, TumourParameters, exact, simulate
from tumour import equations as eq
from tumour.stability import critical_time, figure, modes, state, stiffness
from tumour.stability.linear import flux, moduli
from tumour.stability.modes import Mode
from tumour.stability.operators import grid
from tumour.stability.state import RadialState, radial_state, radial_states
from tumour.stability.stiffness import SEALED, Shape, grid_moduli

PRINTED = TumourParameters.preset("paper")
DARCY = replace(PRINTED, mobility="darcy")
VALUES: dict[str, Any] = {
    "mu_alpha": 1.3, "lambda_alpha": 0.4, "kappa": 0.7, "gamma": 0.8, "alpha_star": 0.75, "alpha_min": 0.75, "s1": 8.0, "s2": 0.4,
    "s3": 0.6, "s4": 9.0, "Q": 2.5, "Q1_hat": 0.5, "C_out": 1.1, "p_out": -0.3,
}  # fmt: skip
"""No two terms weigh the same and none is 0."""


def wave(l: int) -> float:
    return float(np.sqrt(l * (l + 1)))


@pytest.mark.parametrize("seed", range(4))
def test_coefficients_at_a_point(seed: int) -> None:
    """Central differences of the full tensors of a deformed body in Cartesian coordinates, whose F is exact (a complex step); 1e-7 is their
    rounding and third derivatives, ten times over. The toroidal part is there too: it has p_ar of its own, and adds to nothing else."""
    rng = np.random.default_rng(seed)
    l, R, theta, phi = int(rng.integers(1, 7)), rng.uniform(0.5, 1.0), rng.uniform(0.4, 2.5), rng.uniform(0.0, 6.0)
    mu, lam = rng.uniform(0.2, 2.0, 2)
    r, U, V, Z, p, p_1, T_1 = (Polynomial(rng.uniform(-1.0, 1.0, 4)) for _ in range(7))
    r = Polynomial([0.0, rng.uniform(1.2, 2.0), 0.0, 0.4])
    T, M, M_1, alpha_1 = rng.uniform(-1.0, 1.0, 4)
    Y, k = Legendre.basis(l).convert(kind=Polynomial), wave(l)
    e_z = np.array([0.0, 0.0, 1.0])

    def fields(X: np.ndarray, eps: float) -> tuple[np.ndarray, Any]:
        """Where X goes, and the pressure there."""
        length = np.sqrt(X @ X)
        e, u = X / length, X[2] / length
        surface_gradient = Y.deriv()(u) * (e_z - u * e)
        moved = U(length) * Y(u) * e - V(length) / k * surface_gradient - Z(length) / k * np.cross(e, surface_gradient)
        return r(length) * e + eps * moved, p(length) + eps * p_1(length) * Y(u)

    e_r = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    e_t = np.array([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)])
    frame, u = np.array([e_r, e_t, np.cross(e_r, e_t)]), np.cos(theta)

    def tensors(eps: float) -> tuple[np.ndarray, np.ndarray]:
        steps = [fields(R * e_r + 1e-30j * axis, eps) for axis in np.eye(3)]
        F = frame @ np.array([x.imag / 1e-30 for x, _ in steps]).T @ frame.T
        gradient = frame @ np.array([value.imag / 1e-30 for _, value in steps])
        J, inverse = np.linalg.det(F), np.linalg.inv(F)
        load = T + eps * T_1(R) * Y(u)
        P = mu * (F - inverse.T) + (lam * (J - 1.0) - load) * J * inverse.T
        return P, (M + eps * M_1 * alpha_1 * Y(u)) * J * inverse @ inverse.T @ gradient

    (P_up, f_up), (P_down, f_down) = tensors(1e-5), tensors(-1e-5)
    expected, flow = (P_up - P_down) / 2e-5, (f_up - f_down) / 2e-5
    l_r, l_t = r.deriv()(R), r(R) / R
    H_rr, H_tt = U.deriv()(R), (k * V(R) / 2.0 + U(R)) / R
    H_tr, H_rt = V.deriv()(R), -(k * U(R) + V(R)) / R
    a = moduli(np.array(l_r), np.array(l_t), np.array(lam * (l_r * l_t**2 - 1.0) - T), mu, lam, 3)
    p_rr = a.rr * H_rr + 2.0 * a.rt * H_tt - l_t**2 * T_1(R)
    p_tt = a.rt * H_rr + a.tt * H_tt - l_r * l_t * T_1(R)
    p_rt, p_tr = a.shear * H_rt + a.turn * H_tr, a.shear * H_tr + a.turn * H_rt
    by_theta = -np.sin(theta) * Y.deriv()(u)
    bend = by_theta / np.tan(theta) + k**2 * Y(u) / 2.0  # of the Hessian less half its trace: phi phi, and theta theta with the other sign
    p_s = a.side * V(R) / (k * R) * bend
    s = -by_theta / k  # the place of sin k theta
    assert expected[0, 0] == pytest.approx(p_rr * Y(u), abs=1e-7)
    assert expected[1, 1] == pytest.approx(p_tt * Y(u) + p_s, abs=1e-7)
    assert expected[2, 2] == pytest.approx(p_tt * Y(u) - p_s, abs=1e-7)
    assert expected[0, 1] == pytest.approx(p_rt * s, abs=1e-7)
    assert expected[1, 0] == pytest.approx(p_tr * s, abs=1e-7)
    assert expected[0, 2] == pytest.approx((a.shear * -Z(R) / R + a.turn * Z.deriv()(R)) * s, abs=1e-7)
    assert expected[2, 0] == pytest.approx((a.shear * Z.deriv()(R) + a.turn * -Z(R) / R) * s, abs=1e-7)
    b, slope = flux(np.array(l_r), np.array(l_t), 3), p.deriv()(R)
    along = M * (b.along * p_1.deriv()(R) + slope * (b.by_tt * H_tt + b.by_rr * H_rr)) + M_1 * alpha_1 * b.along * slope
    across = M * (-b.across * k / R * p_1(R) + slope * (b.by_tr * H_tr + b.by_rt * H_rt))
    assert flow[0] == pytest.approx(along * Y(u), abs=1e-7)
    assert flow[1] == pytest.approx(across * s, abs=1e-7)


def test_the_norm_of_the_traceless_part() -> None:
    """The integral of the square of the traceless Hessian of Y_l/sqrt(l (l + 1)) is (l-1)(l+2)/2 of that of Y_l^2."""
    u, weight = np.polynomial.legendre.leggauss(20)
    for l in range(1, 8):
        Y = Legendre.basis(l).convert(kind=Polynomial)
        bend = -u * Y.deriv()(u) + l * (l + 1) * Y(u) / 2.0  # cot theta d/d theta is -cos theta d/d cos theta
        assert 2.0 * weight @ bend**2 / (l * (l + 1)) == pytest.approx((l - 1) * (l + 2) / 2.0 * (weight @ Y(u) ** 2), abs=1e-12)
        assert grid(1.5, 8, l, 3).H_s.toarray().max() == pytest.approx(np.sqrt((l - 1) * (l + 2) / 2.0) / (1.5 / 16.0), abs=1e-12)


def test_a_shift_of_the_body_changes_nothing() -> None:
    """U = 1, V = -sqrt(2) at l = 1, on the grid: to the last bits of 1/h."""
    on = grid(1.5, 40, 1, 3)
    shift = np.concatenate([np.ones(41), np.full(41, -np.sqrt(2.0))])
    for name in ("H_rr", "H_tt", "H_s", "H_tr", "H_rt", "gap"):
        assert np.max(np.abs(getattr(on, name) @ shift)) < 1e-13, name
    assert np.max(np.abs(2.0 * on.U @ shift + on.k * on.V @ shift)) < 1e-14  # and the flux is carried nowhere


def test_volumes_around_cells_and_faces_cover_the_ball() -> None:
    on = grid(1.5, 40, 3, 3)
    assert on.cells.sum() == pytest.approx(1.5**3 / 3.0, rel=1e-14)
    assert on.faces.sum() == pytest.approx(1.5**3 / 3.0, rel=1e-14)


def swollen(N: int, p: TumourParameters) -> RadialState:
    """A ball that has swollen unevenly."""
    return radial_state(p, 1.0, 0.0, 1.5 + 2.0 * ((np.arange(N) + 0.5) / N) ** 2, np.full(N, 0.8), m=3)


def test_a_radial_change_of_the_grid_has_the_energy_of_radial_runs() -> None:
    """The change of the forces on the faces, by differences of the discrete energy of `tumour.radial`, with T kept: to 1e-8."""
    p, N, eps = TumourParameters(**VALUES), 12, 1e-5
    now, on, rng = swollen(N, p), grid(1.0, N, 0, 3), np.random.default_rng(1)
    mu, lam = p.moduli
    T = lam * (now.J - 1.0) - now.g
    U = np.append(0.0, rng.uniform(-1.0, 1.0, N))

    def work(r: np.ndarray) -> float:
        """The energy, and the work of T."""
        J = np.diff(r**3) / np.diff(on.R**3)
        l_r = np.diff(r) / on.R[1]
        return float(np.sum(on.cells * (eq.elastic_energy(l_r, np.sqrt(J / l_r), 3, mu, lam) - T * J)))

    slopes = [(work(now.r + eps * U) - 2.0 * work(now.r) + work(now.r - eps * U)) / eps**2]
    at, y = grid_moduli(now, mu, lam), np.append(U, np.zeros(N + 1))
    rr, tt = on.H_rr @ y, on.H_tt @ y
    assert np.sum(on.cells * (at.rr * rr**2 + 2.0 * at.rt * rr * tt + at.tt * tt**2)) == pytest.approx(slopes[0], rel=1e-5)
    assert abs(work(now.r + eps * U) - work(now.r - eps * U)) < 1e-9  # in equilibrium
    by_r, by_t = now.swelling
    J = [np.diff((now.r + sign * eps * U) ** 3) / np.diff(on.R**3) for sign in (1.0, -1.0)]
    np.testing.assert_allclose(by_r * rr + by_t * tt, (J[0] - J[1]) / (2.0 * eps), rtol=1e-7, atol=1e-7)


def dense(shape: Shape, now: RadialState) -> list[np.ndarray]:
    """Both matrices of the eigenproblem, without U at the centre."""
    full = []
    for band in (shape._bands(now)[0], shape._unit):
        u, size = shape._pattern.upper, band.shape[1]
        full.append(np.array([[band[u + i - j, j] if abs(i - j) <= u else 0.0 for j in range(size)] for i in range(size)]))
    return [matrix[1:, 1:] for matrix in full]


def test_stiffness_is_the_least_eigenvalue() -> None:
    """Of symmetric matrices; against a dense eigenproblem, and `exceeds` on both sides of it."""
    p = TumourParameters(**VALUES)
    now, shape = swollen(30, p), Shape(p, 1.0, 30, 4, m=3)
    full = dense(shape, now)
    for matrix in full:
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * np.abs(matrix).max())
    least = float(eigh(*full, eigvals_only=True)[0]) / p.mu_alpha
    assert shape.value(now) == pytest.approx(least, abs=1e-6)
    assert shape.exceeds(now, least - 1e-5)
    assert not shape.exceeds(now, least + 1e-5)


def test_turning_rings_against_each_other_takes_work() -> None:
    """Toroidal changes Z(R) e_r x grad Y_l/sqrt(l (l + 1)): with Z = r z, twice their energy is ``mu (R^2 z'^2 + (l-1)(l+2) z^2) r^2`` dR,
    whatever the state. Here the density from the moduli against that, where it is integrated by parts: to second order."""
    p, l = TumourParameters(**VALUES), 5
    mu, errors = p.mu_alpha, []
    for N in (200, 400):
        now = swollen(N, p)
        R, h = 0.5 * (now.R[1:] + now.R[:-1]), now.R[1]
        a = moduli(now.l_r, now.l_t, now.g, mu, 0.0, 3)
        z = [1.0 + 0.5 * now.R**2, 1.0 + 0.5 * R**2]
        Z, Z_R = now.rho * z[1], np.diff(now.r * z[0]) / h
        twist = 2.0 * mu - a.side  # against turning in the plane, P_t/l_t
        density = a.shear * (Z_R**2 + (Z / R) ** 2) - 2.0 * a.turn * Z_R * Z / R
        density += (a.side * (l - 1) * (l + 2) + twist * l * (l + 1)) / 2.0 * (Z / R) ** 2
        closed = mu * now.rho**2 * (R**2 * (np.diff(z[0]) / h) ** 2 + (l - 1) * (l + 2) * z[1] ** 2)
        errors.append(np.sum(density * R**2) / np.sum(closed) - 1.0)
    assert abs(errors[1]) < 1e-4
    assert abs(errors[1]) < 0.3 * abs(errors[0])


class Smooth:
    """A radial state and a mode with polynomial profiles, and the strong form of the equations on them."""

    R_0, l, a = 1.0, 3, 2.7

    def __init__(self) -> None:
        self.p, self.k = TumourParameters(**VALUES, mobility="darcy"), wave(self.l)
        R = Polynomial([0.0, 1.0])
        self.r = R * (1.0 + 0.3 * R**2)
        self.alpha, self.C, self.pressure = 0.85 - 0.03 * R**2, 0.7 + 0.4 * R**2, -0.3 + 0.9 * (1.0 - R**2)
        self.U, self.V = R**2 * (0.5 + 0.4 * R**2), R**2 * (-0.5 + 0.9 * R**2)
        self.alpha_1, self.C_1, self.p_1 = R**3 * (0.3 - 0.8 * R**2), R**3 * (1.0 - R**2), R**3 * (0.6 - 0.6 * R**2)
        at_surface = self._elastic(1.0)[0] / 1.3**2  # P_r = l_t^2 T
        solved = solve_ivp(self._load, (1.0, 0.05), [at_surface], rtol=1e-11, atol=1e-12, dense_output=True)
        self.T = lambda at: solved.sol(at)[0]

    def _elastic(self, R: Any) -> tuple[Any, Any]:
        return eq.elastic_stress(self.r.deriv()(R), self.r(R) / R, 3, *self.p.moduli)

    def _load(self, R: float, T: np.ndarray) -> list[float]:
        (P_r, P_t), h = self._elastic(R), 1e-5
        slope = (self._elastic(R + h)[0] - self._elastic(R - h)[0]) / (2.0 * h)
        return [(slope + 2.0 * (P_r - P_t) / R) * R**2 / self.r(R) ** 2]

    def parts(self, R: Any) -> dict[str, Any]:
        """Stresses, fluxes and j of the mode at R."""
        p, k = self.p, self.k
        l_r, l_t = self.r.deriv()(R), self.r(R) / R
        a = moduli(l_r, l_t, p.lambda_alpha * (l_r * l_t**2 - 1.0) - self.T(R), *p.moduli, 3)
        H_rr, H_tt = self.U.deriv()(R), (k * self.V(R) / 2.0 + self.U(R)) / R
        H_tr, H_rt = self.V.deriv()(R), -(k * self.U(R) + self.V(R)) / R
        alpha, alpha_1 = self.alpha(R), self.alpha_1(R)
        T_1 = self.p_1(R) + eq.contact_pressure_slope(alpha, *p.contact) * alpha_1
        found = {
            "rr": a.rr * H_rr + 2.0 * a.rt * H_tt - l_t**2 * T_1, "tt": a.rt * H_rr + a.tt * H_tt - l_r * l_t * T_1,
            "rt": a.shear * H_rt + a.turn * H_tr, "tr": a.shear * H_tr + a.turn * H_rt,
            "side": a.side * (self.l - 1) * (self.l + 2) / 2.0 * self.V(R) / R,
            "j": l_t**2 * H_rr + 2.0 * l_r * l_t * H_tt, "J": l_r * l_t**2,
        }  # fmt: skip
        b, zeta = flux(l_r, l_t, 3), eq.resistance(alpha, *p.flow)
        for name, c, c_1, M, M_1 in (
            ("f", self.pressure, self.p_1, 1.0 / zeta, -eq.resistance_slope(alpha, *p.flow) / zeta**2),
            ("g", self.C, self.C_1, 1.0, 0.0),
        ):
            slope = c.deriv()(R)
            found[f"{name}_r"] = (
                M * (b.along * c_1.deriv()(R) + slope * (b.by_tt * H_tt + b.by_rr * H_rr)) + M_1 * alpha_1 * b.along * slope
            )
            found[f"{name}_t"] = M * (-b.across * k / R * c_1(R) + slope * (b.by_tr * H_tr + b.by_rt * H_rt))
        return found

    def strong(self, R: np.ndarray) -> dict[str, np.ndarray]:
        """Each equation's terms at R, by the unknown whose row it is."""
        p, k, h = self.p, self.k, 1e-5
        at, up, down = self.parts(R), self.parts(R + h), self.parts(R - h)
        by_R = {name: (up[name] - down[name]) / (2.0 * h) for name in at}
        alpha, C = self.alpha(R), self.C(R)
        q, (q_a, q_C) = eq.net_growth(alpha, C, *p.kinetics), eq.net_growth_slopes(alpha, C, *p.kinetics)
        u, (u_a, u_C) = eq.oxygen_uptake(alpha, C, *p.uptake), eq.oxygen_uptake_slopes(alpha, C, *p.uptake)
        a_1, C_1, J, j = self.alpha_1(R), self.C_1(R), at["J"], at["j"]
        out = {name: by_R[f"{name}_r"] + 2.0 * at[f"{name}_r"] / R + k / R * at[f"{name}_t"] for name in ("f", "g")}
        return {
            "U": -(by_R["rr"] + k / R * at["rt"] + 2.0 * (at["rr"] - at["tt"]) / R),
            "V": -(by_R["tr"] - k / R * at["tt"] - at["side"] / R + (at["rt"] + 2.0 * at["tr"]) / R),
            "alpha": self.a * (J * a_1 + alpha * j) - q * j - J * (q_a * a_1 + q_C * C_1),
            "p": self.a * j - out["f"],
            "C": -out["g"] + u * j + J * (u_a * a_1 + u_C * C_1),
        }

    def rows(self, N: int) -> tuple[dict[str, np.ndarray], Mode]:
        """The rows of the step's matrix, applied to the mode, per volume of their cell or face."""
        mode = Mode(self.p, self.R_0, N, self.l, 3)
        R, mid, cells = mode.on.R, mode.on.middles, mode.on.cells
        J = np.diff(self.r(R) ** 3) / np.diff(R**3)
        now = radial_state(self.p, self.R_0, 0.0, J, self.alpha(mid), self.C(mid), self.pressure(mid), m=3)
        y = np.concatenate([self.U(R), self.V(mid), [self.V(1.0)], self.alpha_1(mid), self.C_1(mid), self.p_1(mid)])
        pattern, order = mode._pattern, mode._order
        band, ordered, out = pattern.band(mode.coefficients(now, self.a)), np.empty_like(y), np.zeros_like(y)
        ordered[order] = y
        for d in range(-pattern.lower, pattern.upper + 1):
            i = np.arange(max(0, -d), min(len(y), len(y) - d))
            out[i] += band[pattern.upper - d, i + d] * ordered[i + d]
        parts = np.split(out[order], [N + 1, 2 * N + 1, 2 * N + 2, 3 * N + 2, 4 * N + 2])
        inner = {"U": parts[0][1:-1] / (R[1:-1] ** 2 * R[1]), "V": parts[1] / cells, "alpha": parts[3], "C": parts[4] / cells}
        return inner | {"p": parts[5] / cells, "surface": np.array([parts[0][-1], parts[2][0]])}, mode


def test_the_grid_converges_to_the_equations() -> None:
    """Order two inside, for a state and a mode in which no term vanishes; at the surface the tractions, to order one."""
    smooth = Smooth()
    errors, at_surface = [], []
    for N in (50, 100, 200):
        rows, mode = smooth.rows(N)
        error = {}
        for name in ("U", "V", "alpha", "C", "p"):
            at = mode.on.R[1:-1] if name == "U" else mode.on.middles
            inside = (at > 0.2) & (at < 0.9)
            error[name] = float(np.mean(np.abs(rows[name][inside] - smooth.strong(at[inside])[name])))
        errors.append(error)
        parts = smooth.parts(1.0)
        at_surface.append(np.abs(rows["surface"] - [parts["rr"], parts["tr"]]))
    assert min(abs(parts[name]) for name in ("rr", "tr")) > 0.1
    for name in errors[0]:
        assert errors[2][name] < 2e-3, name  # of terms of order 1 to 10
        assert 1.9 < np.log2(errors[1][name] / errors[2][name]) < 2.1, name
    assert np.all(at_surface[2] < 0.6 * at_surface[1])


def radial_pair(l: int, of_u: tuple[float, float], of_x: tuple[float, float], mu: float, lame: float, s: float = 0.0) -> np.ndarray:
    """Div, and both tractions at R = 1, of ``beta R^2 grad h + gamma x h`` and of ``a grad h``, h = R^l Y_l, with the stress
    ``2 mu e + lame div I - s grad u``; `of_u` is (beta, gamma), `of_x` is (a, 0)."""
    (beta, gamma), (a, _) = of_u, of_x
    div = 2.0 * l * beta + (l + 3) * gamma
    U, W = beta * l + gamma, beta  # times R^(l+1); of the second part a l and a, times R^(l-1)
    normal = (2.0 * mu - s) * ((l + 1) * U + (l - 1) * l * a) + lame * div
    shear = mu * ((l + 1) * W + U - W + 2.0 * (l - 1) * a) - s * ((l + 1) * W + (l - 1) * a)
    return np.array([div, normal, shear])


def closed_stiffness(l: int, mu: float, lame: float) -> float:
    """The least s with ``Div(2 mu e + lame tr e I - s H) = 0`` and no traction, in units of mu: s = 2 mu, or where the second part's
    tractions are those of a gradient, normal = l shear."""

    def both(s: float) -> float:
        A, B = mu - s, mu + lame
        beta, gamma = 2.0 * A + (l + 3) * B, -(A * (4 * l + 2) + 2 * l * B)
        _, normal, shear = radial_pair(l, (beta, gamma), (0.0, 0.0), mu, lame, s)
        return float(normal - l * shear)

    s = np.linspace(1e-9, 2.0 * mu, 4001)
    signs = np.sign([both(value) for value in s])
    first = int(np.flatnonzero(np.diff(signs))[0])
    return brentq(both, s[first], s[first + 1]) / mu


@pytest.mark.parametrize("l", [2, 3, 7])
@pytest.mark.parametrize("J", [1.0, 4.0])
def test_stiffness_of_a_uniform_ball(l: int, J: float) -> None:
    """A ball that has swollen uniformly by c^3 is as one at rest with the moduli mu and lame = bulk c^4 - mu (1 - 1/c^2)."""
    p, c = TumourParameters(**VALUES), np.cbrt(J)
    bulk = p.lambda_alpha + 0.8 / J * eq.contact_pressure_slope(0.8, *p.contact)
    for drained, modulus in ((True, bulk), (False, SEALED * p.mu_alpha)):
        expected = closed_stiffness(l, p.mu_alpha, modulus * c**4 - p.mu_alpha * (1.0 - 1.0 / c**2))
        errors = [
            Shape(p, 1.0, N, l, drained=drained, m=3).value(radial_state(p, 1.0, 0.0, np.full(N, J), np.full(N, 0.8), m=3)) - expected
            for N in (50, 100)
        ]
        assert abs(errors[1]) < 2e-3 * l
        assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


def swelling(l: int, mu: float, lame: float) -> tuple[float, float, float]:
    """j, U and W at R = 1 of a ball without traction in which ``2 mu e + lame tr e I - h I`` is in equilibrium, h = R^l Y_l."""
    columns = [
        [*radial_pair(l, u, x, mu, lame), mu * (u[0] * (4 * l + 2) + 2.0 * u[1]) + (mu + lame) * (2.0 * l * u[0] + (l + 3) * u[1])]
        for u, x in (((1.0, 0.0), (0.0, 0.0)), ((0.0, 1.0), (0.0, 0.0)), ((0.0, 0.0), (1.0, 0.0)))
    ]
    matrix = np.array(columns).T
    beta, gamma, a = np.linalg.solve(matrix[1:], [1.0, 0.0, 1.0])
    return 2.0 * l * beta + (l + 3) * gamma, l * beta + gamma + l * a, beta + a


@pytest.mark.parametrize("l", [2, 5])
def test_modes_of_a_ball_that_grows_uniformly(l: int) -> None:
    """With kappa = 0 and Q = 0 each point grows by itself, and a seed R^l Y_l keeps its form: y = J alpha_1 + alpha j swells the ball as
    its contact stress (alpha Sigma)' y/J asks for, and so makes y grow in turn, an equation for one number."""
    p = TumourParameters(mu_alpha=1.3, lambda_alpha=0.4, kappa=0.0, gamma=0.8, Q=0.0, C_out=1.1)
    t, alpha_0, (mu, lam) = 6.0, 0.83, p.moduli

    def at(time: float) -> tuple[float, float, float]:
        """alpha, and j and U per y, in the body at rest."""
        (J,), (alpha,) = exact.uniform_growth([time], p, 3, alpha_0)
        c, slope = np.cbrt(J), float(eq.contact_pressure_slope(alpha, *p.contact))
        tr, U, _ = swelling(l, mu, lam * c**4 - mu * (1.0 - 1.0 / c**2) + alpha / J * slope * c**4)
        load = c**2 * slope / J
        return float(alpha), float(c**2 * tr * load), float(U * load)

    def rate(time: float, y: np.ndarray) -> np.ndarray:
        alpha, j, _ = at(time)
        q, (q_a, _) = eq.net_growth(alpha, p.C_out, *p.kinetics), eq.net_growth_slopes(alpha, p.C_out, *p.kinetics)
        return (q * j + q_a * (1.0 - alpha * j)) * y

    expected = solve_ivp(rate, (0.0, t), [1.0], rtol=1e-9, atol=1e-12).y[0, -1] * at(t)[2]
    errors = []
    for N, dt in ((40, 0.1), (80, 0.05)):
        found = modes(p, initial=TumourInitial(alpha=alpha_0), geometry="sphere", wave_numbers=[l], t_end=t, cells=N, dt=dt, rows=1)
        errors.append(found.amplitude[-1, 0] / expected - 1.0)
    assert abs(errors[1]) < 1e-3
    assert abs(errors[1]) < 0.27 * abs(errors[0]) + 1e-6  # a quarter


@pytest.mark.parametrize("l", [2, 3])
def test_modes_of_a_ball_that_drains(l: int) -> None:
    """A ball at rest without growth: a seed R^l Y_l swells as fluid comes in, at last by the eigenstrain of its contact stress, which it
    nears like exp(-c x^2 t), with c = M H, H = 2 mu + lambda + G alpha and x the first at which ``j = j_l(x R)``, the spherical Bessel
    function, lets both tractions and p_1 = H (j - j_l(x) R^l) be 0 (Biot's theory)."""
    still = {"s1": 0.0, "s2": 0.0, "s3": 0.0, "Q": 0.0, "C_out": 0.0, "alpha_min": 0.4, "sigma_width": 0.1}  # contact on both sides of 0.8
    p = TumourParameters(mu_alpha=1.3, lambda_alpha=0.4, kappa=100.0, gamma=0.8, **still)
    alpha, (mu, lam) = 0.8, p.moduli
    G = float(eq.contact_pressure_slope(alpha, *p.contact))
    lame = lam + G * alpha
    H, M = 2.0 * mu + lame, float(eq.mobility(alpha, *p.flow))

    def traction(x: float) -> float:
        """p_rr at the surface of the mode whose p_1 and p_tr are 0 there: of -grad(j_l)/x^2, and of what is left of grad p_1."""
        f, slope = spherical_jn(l, x), spherical_jn(l, x, derivative=True)
        bend = -2.0 / x * slope - (1.0 - l * (l + 1) / x**2) * f  # j_l''
        normal, shear = lame * f - 2.0 * mu * bend, 2.0 * mu * (f / x**2 - slope / x)
        gamma = -2.0 * l / (l + 3)
        beta = -H * f / (mu * (4 * l + 2 + 2.0 * gamma))
        _, more, turned = radial_pair(l, (beta, beta * gamma), (0.0, 0.0), mu, lame)
        a = -(shear + turned) / (2.0 * mu * (l - 1))
        return float(normal + more + 2.0 * mu * l * (l - 1) * a)

    x = np.linspace(0.3, 12.0, 2000)
    first = int(np.flatnonzero(np.diff(np.sign([traction(at) for at in x])))[0])
    rate = M * H * brentq(traction, x[first], x[first + 1]) ** 2
    steady = G * swelling(l, mu, lame)[1]
    errors = []
    for N, dt in ((30, 0.04 / rate), (60, 0.02 / rate)):
        found = modes(
            p, initial=TumourInitial(alpha=alpha), geometry="sphere", wave_numbers=[l], t_end=25.0 / rate, cells=N, dt=dt, rows=1
        )  # fmt: skip
        left = found.amplitude[-1, 0] - np.interp([4.0 / rate, 7.0 / rate], found.t, found.amplitude[:, 0])  # later modes are gone
        errors.append([found.amplitude[-1, 0] / steady - 1.0, np.log(left[0] / left[1]) / 3.0 - 1.0])
    assert np.all(np.abs(errors[1]) < 1e-3)
    assert abs(errors[1][0]) < 0.27 * abs(errors[0][0])  # a quarter; those of the rate have both signs


def test_a_change_of_the_radial_state_is_the_mode_of_degree_0(monkeypatch: pytest.MonkeyPatch) -> None:
    """The difference of two radial runs on the same cells, over the difference of their seeds, to six digits."""
    p = TumourParameters(**VALUES, mobility="printed", mobility_floor=0.1)
    geometry, eps = TumourGeometry(kind="sphere", radius=1.5), 1e-4
    monkeypatch.setattr(state, "RTOL", 1e-10)
    runs = [radial_states(p, TumourInitial(alpha=f"0.85 + {sign * eps}*xi**2"), geometry, [0.0, 5.0], 20) for sign in (1, -1)]
    expected = (runs[0][-1].r[-1] - runs[1][-1].r[-1]) / (2.0 * eps)
    found = [
        modes(p, initial=TumourInitial(alpha=0.85), geometry=geometry, wave_numbers=[0], t_end=5.0, seed=2, cells=20, dt=dt, rows=1)
        for dt in (0.2, 0.1, 0.05)
    ]
    errors = [run.amplitude[-1, 0] / expected - 1.0 for run in found]
    assert abs(errors[2]) < 1e-6
    assert abs(errors[2]) < 0.3 * abs(errors[1]) < 0.1 * abs(errors[0])
    assert np.all(found[0].tangential == 0.0)


def test_modes_converge() -> None:
    """Order two in h and dt together, or nearly: cells lose their contact one by one."""
    values = [
        modes(DARCY, geometry="sphere", wave_numbers=[2, 5], t_end=50.0, cells=N, dt=dt, rows=1).amplitude[-1]
        for N, dt in ((25, 0.8), (50, 0.4), (100, 0.2))
    ]
    first, second = np.abs(values[1] - values[0]), np.abs(values[2] - values[1])
    assert np.all(second < 0.4 * first)
    assert np.all(second < 1e-2 * np.abs(values[2]))


def test_when_the_papers_ball_buckles() -> None:
    """100 cells against 400: see the tolerances."""
    printed = critical_time(PRINTED, geometry="sphere", wave_numbers=[4, 5, 6, 8], t_end=74.0, cells=100)
    darcy = critical_time(DARCY, geometry="sphere", wave_numbers=[2, 4, 6], t_end=74.0, cells=100)
    np.testing.assert_allclose(printed.drained, [72.41, 72.01, 71.99, 72.27], atol=0.1)
    np.testing.assert_allclose(darcy.drained, [70.61, 68.99, 69.08], atol=0.1)
    assert darcy.first == (pytest.approx(69.0, abs=0.1), 4)
    for found in (printed, darcy):
        assert np.all(found.undrained > found.drained)
    at = stiffness(DARCY, geometry="sphere", wave_numbers=[4], times=[darcy.drained[1]], cells=100)
    assert abs(at.drained[0, 0]) < 1e-4


def test_lambda_keeps_the_ball_round() -> None:
    later = critical_time(replace(DARCY, lambda_alpha=0.01), geometry="sphere", wave_numbers=[4], t_end=95.0, cells=60)
    assert later.drained[0] == pytest.approx(90.5, abs=0.3)
    kept = stiffness(replace(DARCY, lambda_alpha=0.3), geometry="sphere", wave_numbers=[2, 4, 8], times=[60.0, 100.0], cells=60)
    assert np.all(kept.drained > 0.3)


def test_growth_of_a_ball_before_it_buckles() -> None:
    found = modes(DARCY, geometry="sphere", wave_numbers=[4], t_end=70.0, cells=60, dt=0.2, rows=3)
    rate = [np.interp(t, found.t, found.rate[:, 0]) for t in (50.0, 60.0, 66.0)]
    assert 0.0 < rate[0] < rate[1] < rate[2]
    assert np.isnan(found.amplitude[-1, 0])  # where rates have no bound
    assert found.m == found.stiffness.m == 3
    names = [text.get_text() for text in figure(found).legends[0].get_texts()]
    assert names == ["l = 4"]


def warnings_of(caplog: pytest.LogCaptureFixture, **settings: Any) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        simulate(**{"parameters": DARCY, "geometry": "sphere", "cells": 60, **settings})
    return [record.getMessage() for record in caplog.records]


def test_a_radial_run_warns_of_it(caplog: pytest.LogCaptureFixture) -> None:
    """Once when the ball is soft and once when its stiffness is gone, by interpolation between rows 0.7 apart: 68.9 by `critical_time`."""
    for settings in ({}, {"time_scheme": "bdf2", "rtol": 1e-5}):
        plan, first, second = warnings_of(caplog, t_end=72.0, **settings)
        assert "a ball of elastic cells with values like the paper's may buckle in this time" in plan
        assert "the stiffness of the ball against spherical harmonics of degree" in first
        assert "the ball has lost its stability at about t = 68." in second
        assert "its stiffness against spherical harmonics of degree" in second
    assert warnings_of(caplog, t_end=72.0, parameters=replace(DARCY, lambda_alpha=0.3)) == []
    assert warnings_of(caplog, t_end=20.0, geometry={"kind": "sphere", "formulation": "eulerian"}) == []


def test_a_run_that_ends_between_rows_is_looked_at_where_it_ends(caplog: pytest.LogCaptureFixture) -> None:
    """The stiffness that it warns of is that of the state at the end, not of the row at t = 40."""

    class Stop(Tracker):
        def on_step(self, state: State) -> None:
            if state.t > 67.0:
                raise StopRun("far enough")

    _, found = warnings_of(caplog, t_end=80.0, save_at=[40.0, 80.0], time_scheme="bdf2", dt=0.5, trackers=[Stop()])
    t, value = (float(found.split(key)[1].split()[0]) for key in ("at t = ", "is down to "))
    expected = stiffness(DARCY, geometry="sphere", wave_numbers=[4, 5, 6], times=[t], cells=60).drained.min()
    assert value == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    ("call", "path"),
    [
        (lambda: modes(geometry="slab", t_end=1.0), "geometry"),
        (lambda: modes(geometry=TumourGeometry(kind="sphere", formulation="eulerian"), t_end=1.0), "geometry"),
        (lambda: stiffness(geometry="sphere", wave_numbers=[0], times=[0.0]), "wave_numbers"),
        (lambda: critical_time(TumourParameters(alpha_min=0.7), geometry="sphere", t_end=1.0), "parameters.sigma_width"),
    ],
)
def test_refusals(call: Any, path: str) -> None:
    with pytest.raises(ParameterError) as caught:
        call()
    assert caught.value.path == path
