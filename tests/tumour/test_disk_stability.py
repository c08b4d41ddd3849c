"""The linearisation about radial disks, piece by piece: at a point, on the grid, and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jv, jvp

from multiphase.errors import ParameterError
from tumour import TumourGeometry, TumourInitial, TumourParameters, exact
from tumour import equations as eq
from tumour.stability import critical_time, modes, stiffness
from tumour.stability.linear import flux, moduli
from tumour.stability.modes import Mode
from tumour.stability.operators import grid
from tumour.stability.state import radial_state
from tumour.stability.stiffness import SEALED, Shape

VALUES = {
    "mu_alpha": 1.3, "lambda_alpha": 0.4, "kappa": 0.7, "gamma": 0.8, "alpha_star": 0.75, "alpha_min": 0.75, "s1": 8.0, "s2": 0.4,
    "s3": 0.6, "s4": 9.0, "Q": 2.5, "Q1_hat": 0.5, "C_out": 1.1, "p_out": -0.3,
}  # fmt: skip
"""No two terms weigh the same and none is 0."""


def cofactors(F: np.ndarray) -> np.ndarray:
    return np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])


@pytest.mark.parametrize("seed", range(5))
def test_coefficients_at_a_point(seed: int) -> None:
    """Central differences of the full tensors of a deformed body; 1e-7 is their rounding and third derivatives, ten times over."""
    rng = np.random.default_rng(seed)
    k, R, theta, mu, lam = int(rng.integers(1, 7)), rng.uniform(0.3, 1.0), rng.uniform(0.0, 1.0), *rng.uniform(0.2, 2.0, 2)
    r, U, V, p, p_1, T_1 = (Polynomial(rng.uniform(-1.0, 1.0, 4)) for _ in range(6))
    r = Polynomial([0.0, rng.uniform(1.2, 3.0), 0.0, 0.4])
    T, M, M_1, alpha_1 = rng.uniform(-1.0, 1.0, 4)

    def tensors(eps: float) -> tuple[np.ndarray, np.ndarray]:
        def position(R: complex, theta: complex) -> np.ndarray:  # components along the frame at theta, which turns
            return np.array([r(R) + eps * U(R) * np.cos(k * theta), eps * V(R) * np.sin(k * theta)])

        x, step = position(R, theta), 1e-30j
        by_R = position(R + step, theta).imag / 1e-30
        by_theta = position(R, theta + step).imag / 1e-30
        F = np.array([[by_R[0], (by_theta[0] - x[1]) / R], [by_R[1], (by_theta[1] + x[0]) / R]]).real
        J = np.linalg.det(F)
        load = T + eps * T_1(R) * np.cos(k * theta)
        P = mu * (F - np.linalg.inv(F).T) + (lam * (J - 1.0) - load) * cofactors(F)
        gradient = np.array([p.deriv()(R) + eps * p_1.deriv()(R) * np.cos(k * theta), -eps * k / R * p_1(R) * np.sin(k * theta)])
        mobility = M + eps * M_1 * alpha_1 * np.cos(k * theta)
        return P, mobility * J * np.linalg.inv(F) @ np.linalg.inv(F).T @ gradient

    (P_up, f_up), (P_down, f_down) = tensors(1e-5), tensors(-1e-5)
    expected, flow = (P_up - P_down) / 2e-5, (f_up - f_down) / 2e-5
    c, s = np.cos(k * theta), np.sin(k * theta)
    l_r, l_t = r.deriv()(R), r(R) / R
    H_rr, H_tt = U.deriv()(R), (k * V(R) + U(R)) / R
    H_tr, H_rt = V.deriv()(R), -(k * U(R) + V(R)) / R
    a = moduli(np.array(l_r), np.array(l_t), np.array(lam * (l_r * l_t - 1.0) - T), mu, lam)
    found = np.array([
        [(a.rr * H_rr + a.rt * H_tt - l_t * T_1(R)) * c, (a.shear * H_rt + a.turn * H_tr) * s],
        [(a.shear * H_tr + a.turn * H_rt) * s, (a.rt * H_rr + a.tt * H_tt - l_r * T_1(R)) * c],
    ])  # fmt: skip
    np.testing.assert_allclose(found, expected, atol=1e-7)
    b, slope = flux(np.array(l_r), np.array(l_t)), p.deriv()(R)
    along = M * (b.along * p_1.deriv()(R) + slope * (b.by_tt * H_tt + b.by_rr * H_rr)) + M_1 * alpha_1 * b.along * slope
    across = M * (-b.across * k / R * p_1(R) + slope * (b.by_tr * H_tr + b.by_rt * H_rt))
    np.testing.assert_allclose([along * c, across * s], flow, atol=1e-7)


def test_turning_the_body_turns_its_stress() -> None:
    """H of a rotation, times the stretches, changes P by the rotation of P."""
    l_r, l_t, g, mu = np.array(1.7), np.array(2.3), np.array(-0.4), 1.3
    a = moduli(l_r, l_t, g, mu, 0.6)
    P_r, P_t = mu * l_r + (g - mu / (l_r * l_t)) * l_t, mu * l_t + (g - mu / (l_r * l_t)) * l_r
    assert a.shear * -l_t + a.turn * l_r == pytest.approx(-P_t, rel=1e-14)
    assert a.shear * l_r + a.turn * -l_t == pytest.approx(P_r, rel=1e-14)


def test_a_shift_of_the_body_changes_nothing() -> None:
    """U = -V = 1 at k = 1, on the grid: to the last bits of 1/h."""
    on = grid(1.5, 40, 1)
    shift = np.concatenate([np.ones(41), -np.ones(41)])
    for name in ("H_rr", "H_tt", "H_tr", "H_rt", "gap"):
        assert np.max(np.abs(getattr(on, name) @ shift)) < 1e-13, name
    assert np.max(np.abs(on.U @ shift + on.V @ shift)) == 0.0  # and the flux is carried nowhere


def test_areas_around_cells_and_faces_cover_the_disk() -> None:
    on = grid(1.5, 40, 3)
    assert on.cells.sum() == pytest.approx(1.5**2 / 2.0, rel=1e-14)
    assert on.faces.sum() == pytest.approx(1.5**2 / 2.0, rel=1e-14)


class Smooth:
    """A radial state and a mode with polynomial profiles, and the strong form of the equations on them."""

    R_0, k, a = 1.0, 3, 2.7

    def __init__(self) -> None:
        self.p = TumourParameters(**VALUES, mobility="darcy")
        R = Polynomial([0.0, 1.0])
        self.r = R * (1.0 + 0.3 * R**2)
        self.alpha, self.C, self.pressure = 0.85 - 0.03 * R**2, 0.7 + 0.4 * R**2, -0.3 + 0.9 * (1.0 - R**2)
        self.U, self.V = R**2 * (0.5 + 0.4 * R**2), R**2 * (-0.5 + 0.9 * R**2)
        self.alpha_1, self.C_1, self.p_1 = R**3 * (0.3 - 0.8 * R**2), R**3 * (1.0 - R**2), R**3 * (0.6 - 0.6 * R**2)
        solved = solve_ivp(self._load, (1.0, 0.05), [self._elastic(1.0)[0] * 1.9 / (1.9 * 1.3)], rtol=1e-11, atol=1e-12, dense_output=True)
        self.T = lambda at: solved.sol(at)[0]

    def _elastic(self, R: Any) -> tuple[Any, Any]:
        return eq.elastic_stress(self.r.deriv()(R), self.r(R) / R, 2, *self.p.moduli)

    def _load(self, R: float, T: np.ndarray) -> list[float]:
        (P_r, P_t), h = self._elastic(R), 1e-5
        slope = (self._elastic(R + h)[0] - self._elastic(R - h)[0]) / (2.0 * h)
        return [(slope + (P_r - P_t) / R) * R / self.r(R)]

    def parts(self, R: Any) -> dict[str, Any]:
        """Stresses, fluxes and j of the mode at R."""
        p, k = self.p, self.k
        l_r, l_t = self.r.deriv()(R), self.r(R) / R
        a = moduli(l_r, l_t, p.lambda_alpha * (l_r * l_t - 1.0) - self.T(R), *p.moduli)
        H_rr, H_tt = self.U.deriv()(R), (k * self.V(R) + self.U(R)) / R
        H_tr, H_rt = self.V.deriv()(R), -(k * self.U(R) + self.V(R)) / R
        alpha, alpha_1 = self.alpha(R), self.alpha_1(R)
        T_1 = self.p_1(R) + eq.contact_pressure_slope(alpha, *p.contact) * alpha_1
        found = {
            "rr": a.rr * H_rr + a.rt * H_tt - l_t * T_1, "tt": a.rt * H_rr + a.tt * H_tt - l_r * T_1,
            "rt": a.shear * H_rt + a.turn * H_tr, "tr": a.shear * H_tr + a.turn * H_rt, "j": l_t * H_rr + l_r * H_tt, "J": l_r * l_t,
        }  # fmt: skip
        b = flux(l_r, l_t)
        zeta = eq.resistance(alpha, *p.flow)
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
        out = {name: by_R[f"{name}_r"] + at[f"{name}_r"] / R + k / R * at[f"{name}_t"] for name in ("f", "g")}
        return {
            "U": -(by_R["rr"] + k / R * at["rt"] + (at["rr"] - at["tt"]) / R),
            "V": -(by_R["tr"] - k / R * at["tt"] + (at["rt"] + at["tr"]) / R),
            "alpha": self.a * (J * a_1 + alpha * j) - q * j - J * (q_a * a_1 + q_C * C_1),
            "p": self.a * j - out["f"],
            "C": -out["g"] + u * j + J * (u_a * a_1 + u_C * C_1),
        }

    def rows(self, N: int) -> tuple[dict[str, np.ndarray], Mode]:
        """The rows of the step's matrix, applied to the mode, per area of their cell or face."""
        mode = Mode(self.p, self.R_0, N, self.k)
        R, mid = mode.on.R, mode.on.middles
        J = np.diff(self.r(R) ** 2) / np.diff(R**2)
        state = radial_state(self.p, self.R_0, 0.0, J, self.alpha(mid), self.C(mid), self.pressure(mid))
        y = np.concatenate([self.U(R), self.V(mid), [self.V(1.0)], self.alpha_1(mid), self.C_1(mid), self.p_1(mid)])
        pattern, order = mode._pattern, mode._order
        band, ordered, out = pattern.band(mode.coefficients(state, self.a)), np.empty_like(y), np.zeros_like(y)
        ordered[order] = y
        for d in range(-pattern.lower, pattern.upper + 1):
            i = np.arange(max(0, -d), min(len(y), len(y) - d))
            out[i] += band[pattern.upper - d, i + d] * ordered[i + d]
        row, h = out[order], R[1]
        parts = np.split(row, [N + 1, 2 * N + 1, 2 * N + 2, 3 * N + 2, 4 * N + 2])
        inner = {"U": parts[0][1:-1] / (R[1:-1] * h), "V": parts[1] / (mid * h), "alpha": parts[3], "C": parts[4] / (mid * h)}
        return inner | {"p": parts[5] / (mid * h), "surface": np.array([parts[0][-1], parts[2][0]])}, mode


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
        assert 1.9 < np.log2(errors[1][name] / errors[2][name]) < 2.1 or errors[2][name] < 1e-12, name  # cells: exact at the middles
    assert np.all(at_surface[2] < 0.6 * at_surface[1])


def uniform(J: float, alpha: float, p: TumourParameters, N: int = 100) -> Any:
    return radial_state(p, 1.0, 0.0, np.full(N, J), np.full(N, alpha))


def closed_stiffness(k: int, mu: float, lame: float) -> float:
    """The least s with ``Div(2 mu e + lame tr e I - s H) = 0`` and no traction, in units of mu.

    Solutions are (U, V) = a (1, -1) R^(k-1) + (b, c) R^(k+1), with b = 2A - B k, c = 2A + B (k+2), A = mu - s, B = mu + lame. Both
    tractions are 0 where s = 2 mu, or where the second part's add up to 0.
    """

    def both(s: float) -> float:
        A, B = mu - s, mu + lame
        b, c = 2.0 * A - B * k, 2.0 * A + B * (k + 2)
        along = (2.0 * mu - s) * (k + 1) * b + lame * ((k + 2) * b + k * c)
        return along + mu * k * (c - b) - s * (k + 1) * c

    s = np.linspace(1e-9, 2.0 * mu, 4001)
    signs = np.sign([both(value) for value in s])
    first = int(np.flatnonzero(np.diff(signs))[0])
    return brentq(both, s[first], s[first + 1]) / mu


@pytest.mark.parametrize("k", [2, 3, 7])
@pytest.mark.parametrize("J", [1.0, 4.0])
def test_stiffness_of_a_uniform_disk(k: int, J: float) -> None:
    """A disk that has swollen uniformly is as one at rest with the moduli mu and lame = bulk J - mu (1 - 1/J). The error falls as 1/N^2."""
    p = TumourParameters(**VALUES)
    bulk = p.lambda_alpha + 0.8 / J * eq.contact_pressure_slope(0.8, *p.contact)
    for drained, modulus in ((True, bulk), (False, SEALED * p.mu_alpha)):
        expected = closed_stiffness(k, p.mu_alpha, modulus * J - p.mu_alpha * (1.0 - 1.0 / J))
        errors = [
            Shape(p, 1.0, N, k, drained=drained).value(uniform(J, 0.8, p, N)) - expected for N in (50, 100)
        ]  # fmt: skip
        assert abs(errors[1]) < 2e-3 * k
        assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


def test_stiffness_is_the_least_eigenvalue() -> None:
    """Against a dense eigenproblem, and `exceeds` on both sides of it."""
    p = TumourParameters(**VALUES)
    N, k = 30, 4
    J = 1.5 + 2.0 * (np.arange(N) / N) ** 2
    state = radial_state(p, 1.0, 0.0, J, np.full(N, 0.8))
    shape = Shape(p, 1.0, N, k)
    full = []
    for band in (shape._bands(state)[0], shape._unit):
        u, size = shape._pattern.upper, band.shape[1]
        full.append(np.array([[band[u + i - j, j] if abs(i - j) <= u else 0.0 for j in range(size)] for i in range(size)]))
        np.testing.assert_allclose(full[-1], full[-1].T, atol=1e-12 * np.abs(full[-1]).max())
    least = float(eigh(full[0][1:, 1:], full[1][1:, 1:], eigvals_only=True)[0]) / p.mu_alpha  # without U at the centre
    assert shape.value(state) == pytest.approx(least, abs=1e-6)
    assert shape.exceeds(state, least - 1e-5)
    assert not shape.exceeds(state, least + 1e-5)


def test_modes_of_a_disk_that_grows_uniformly() -> None:
    """With kappa = 0 and Q = 0 each point grows by itself. A seed R^k cos(k theta) is harmonic, so that the swelling that it asks for fits
    together without any stress: U = V = B R^(k+1), and the change of J is that of uniform growth with another alpha_0."""
    p = TumourParameters(mu_alpha=1.3, lambda_alpha=0.4, kappa=0.0, gamma=0.8, Q=0.0, C_out=1.1)
    t, alpha_0, eps = 6.0, 0.83, 1e-5
    J = [float(exact.uniform_growth([t], p, 2, alpha_0 + change)[0][0]) for change in (-eps, 0.0, eps)]
    j = (J[2] - J[0]) / (2.0 * eps)
    for k in (2, 5):
        errors = []
        for N, dt in ((40, 0.1), (80, 0.05)):
            found = modes(p, initial=TumourInitial(alpha=alpha_0), wave_numbers=[k], t_end=t, cells=N, dt=dt, rows=1)
            errors.append(np.array([found.amplitude[-1, 0], found.tangential[-1, 0]]) / (j / (2.0 * np.sqrt(J[1]) * (k + 1))) - 1.0)
        assert np.all(np.abs(errors[1]) < 1e-3)
        assert np.all(np.abs(errors[1]) < 0.27 * np.abs(errors[0]) + 1e-6)  # a quarter


@pytest.mark.parametrize("k", [2, 3])
def test_modes_of_a_disk_that_drains(k: int) -> None:
    """A disk at rest without growth: a seed R^k cos(k theta) swells as fluid comes in, at last to U = R^(k+1) e/(2 (k+1)) with
    ``(lambda + mu) e = G (1 - alpha e)``, which it nears like exp(-c x^2 t), with c = M H, H = 2 mu + lambda + G alpha and x the first at
    which ``j = J_k(x R)`` lets both tractions and p_1 be 0 (Biot's theory)."""
    still = {"s1": 0.0, "s2": 0.0, "s3": 0.0, "Q": 0.0, "C_out": 0.0, "alpha_min": 0.4, "sigma_width": 0.1}  # contact on both sides of 0.8
    p = TumourParameters(mu_alpha=1.3, lambda_alpha=0.4, kappa=100.0, gamma=0.8, **still)
    alpha, (mu, lam) = 0.8, p.moduli
    G = eq.contact_pressure_slope(alpha, *p.contact)
    H, M = 2.0 * mu + lam + G * alpha, eq.mobility(alpha, *p.flow)

    def traction(x: float) -> float:
        """p_rr of the mode whose p_1 and p_tr are 0 at the surface."""
        beta = -H * jv(k, x)
        b, c = beta * k / (4.0 * mu * (k + 1)), -beta * (k + 2) / (4.0 * mu * (k + 1))
        a = (2.0 * k * (jvp(k, x) / x - jv(k, x) / x**2) + k * (c - b)) / (2.0 * (k - 1))
        return 2.0 * mu * (-jvp(k, x, 2) + (k + 1) * b + (k - 1) * a) + (lam + G * alpha) * jv(k, x)

    x = np.linspace(0.3, 12.0, 2000)
    first = int(np.flatnonzero(np.diff(np.sign([traction(at) for at in x])))[0])
    rate = M * H * brentq(traction, x[first], x[first + 1]) ** 2
    steady = G / (lam + mu + G * alpha) / (2.0 * (k + 1))
    errors = []
    for N, dt in ((30, 0.04 / rate), (60, 0.02 / rate)):
        found = modes(p, initial=TumourInitial(alpha=alpha), wave_numbers=[k], t_end=25.0 / rate, cells=N, dt=dt, rows=1)
        left = found.amplitude[-1, 0] - np.interp([4.0 / rate, 7.0 / rate], found.t, found.amplitude[:, 0])  # later modes are gone
        errors.append([found.amplitude[-1, 0] / steady - 1.0, np.log(left[0] / left[1]) / 3.0 - 1.0])
    assert np.all(np.abs(errors[1]) < 1e-3)
    assert abs(errors[1][0]) < 0.27 * abs(errors[0][0])  # a quarter; those of the rate have both signs


@pytest.mark.parametrize(
    ("call", "path"),
    [
        (lambda: modes(geometry="slab", t_end=1.0), "geometry"),
        (lambda: modes(geometry=TumourGeometry(kind="disk", formulation="eulerian"), t_end=1.0), "geometry"),
        (lambda: modes(geometry="quarter_disk", wave_numbers=[2, 3], t_end=1.0), "wave_numbers"),
        (lambda: stiffness(wave_numbers=[0], times=[0.0]), "wave_numbers"),
        (lambda: critical_time(TumourParameters(alpha_min=0.7), t_end=1.0), "parameters.sigma_width"),
        (lambda: modes(t_end=1.0, dt=0.0), "dt"),
        (lambda: modes(t_end=1.0, seed=-1.0), "seed"),
        (lambda: modes(t_end=-1.0), "t_end"),
        (lambda: critical_time(t_end=0.0), "t_end"),
        (lambda: stiffness(times=[]), "times"),
        (lambda: stiffness(times=[3.0, 1.0]), "times"),
        (lambda: modes(geometry={"kind": "glioma"}, t_end=1.0), "geometry"),
        (lambda: stiffness(TumourParameters(stiffness="1 + r"), times=[1.0]), "parameters.stiffness"),
    ],
)  # fmt: skip
def test_refusals(call: Any, path: str) -> None:
    with pytest.raises(ParameterError) as caught:
        call()
    assert caught.value.path == path
