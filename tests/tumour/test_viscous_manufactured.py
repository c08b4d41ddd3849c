"""Manufactured solutions of the viscous tumour in all three geometries, centre included: orders in space and time.

R(t), alpha(xi, t) and u(xi, t) with u(1, t) = R', and C(xi, t) are chosen, xi = r/R(t), with contact everywhere. p_out and C_out are what
the solution has at the surface, p_out from the traction there being 0; the rows of alpha (2.1), C and u (2.4) get sources, worked out from
the equations at a point, in r and t, not from the discrete ones.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

import numpy as np
import pytest
import sympy as sp

from multiphase import radau
from multiphase.stepping import Control, Solved, integrate, start
from tumour import eulerian
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import VISCOUS, ViscousLines, ViscousRadau
from tumour.solver import TumourSolver

VALUES = {
    "mu_alpha": 0.7, "lambda_alpha": 0.4, "gamma": 0.9, "alpha_star": 0.55, "alpha_min": 0.55, "Q": 1.5, "Q1_hat": 0.7,
}  # fmt: skip
CASES = {"slab": (1, 1.3), "disk": (2, 1.3), "sphere": (3, 1.3), "sphere, free fluid": (3, 0.0)}
KINDS = {1: "slab", 2: "disk", 3: "sphere"}
T_END = 0.4
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)


class Solution:
    """Exact fields and sources as functions of (xi, t), and R(t)."""

    def __init__(self, m: int, kappa: float, waves: Any = sp.pi) -> None:
        self.m, self.kappa = m, kappa
        xi, t = sp.symbols("xi t", positive=True)
        given = TumourParameters(**VALUES, kappa=kappa)
        names = ("mu_alpha", "lambda_alpha", "gamma", "alpha_star", "Q", "Q1_hat", "kappa", "s1", "s2", "s3", "s4")
        v = {name: sp.Rational(str(getattr(given, name))) for name in names}
        R = 1 + sp.Rational(3, 10) * t + sp.sin(4 * t) / 20
        V = sp.diff(R, t)
        alpha = sp.Rational(7, 10) + (1 + sp.sin(4 * t) / 3) * sp.cos(waves * xi**2) / 12
        u = xi * (V + (1 - xi**2) * (sp.cos(3 * t) / 2 + t * xi**2))
        C = sp.Rational(1, 2) + (1 + sp.sin(6 * t) / 4) * xi**2 / 3 + sp.cos(3 * t) * xi**4 / 9
        r = xi * R

        def dr(f: Any) -> Any:
            return sp.diff(f, xi) / R

        def dt(f: Any) -> Any:  # at fixed r
            return sp.diff(f, t) - xi * V / R * sp.diff(f, xi)

        e_r, e_t = dr(u), sp.simplify(u / r)
        trace = e_r + (m - 1) * e_t
        s_r, s_t = (2 * v["mu_alpha"] * alpha * e + v["lambda_alpha"] * alpha * trace for e in (e_r, e_t))
        contact = alpha * v["gamma"] * (alpha - v["alpha_star"]) / (1 - alpha) ** 2
        growth = (1 + v["s1"]) * C / (1 + v["s1"] * C) * alpha * (1 - alpha) - (v["s2"] + v["s3"] * C) / (1 + v["s4"] * C) * alpha
        uptake = v["Q"] * alpha * C / (1 + v["Q1_hat"] * C)
        drag = v["kappa"] * alpha / (1 - alpha) * u
        expressions = {
            "alpha": alpha, "u": u, "C": C,
            "sources of alpha": dt(alpha) + dr(alpha * u) + (m - 1) * alpha * e_t - growth,
            "sources of C": uptake - dr(r ** (m - 1) * dr(C)) / r ** (m - 1),
            "force": drag + dr(contact) - dr(s_r) - (m - 1) * (s_r - s_t) / r,
        }  # fmt: skip
        self.of = {name: self._function(sp.lambdify((xi, t), f, "numpy", cse=True)) for name, f in expressions.items()}
        self.R, self.C_out, self.p_out = (sp.lambdify(t, f) for f in (R, C.subs(xi, 1), (s_r - contact).subs(xi, 1)))

    @staticmethod
    def _function(function: Any) -> Any:
        return lambda xi, t: np.broadcast_to(np.asarray(function(xi, t), dtype=float), np.shape(xi))

    def average(self, name: str, cells: int, t: float) -> np.ndarray:
        """Averages over the cells by Gauss's rule."""
        xi = (np.arange(cells)[:, None] + 0.5 + 0.5 * POINTS) / cells
        weights = WEIGHTS * xi ** (self.m - 1)
        return np.sum(weights * self.of[name](xi, t), axis=1) / np.sum(weights, axis=1)

    def vector(self, cells: int, t: float) -> np.ndarray:
        """Unknowns of the exact solution; V = R^(m-1) R'."""
        N, faces = cells, np.arange(1, cells + 1) / cells
        y, R = np.zeros(3 * N + 4), self.R(t)
        y[0 : 3 * N : 3] = R**self.m / self.m * self.average("alpha", N, t)
        y[1 : 3 * N : 3], y[2 : 3 * N : 3] = self.of["C"](faces - 0.5 / N, t), self.of["u"](faces, t)
        y[3 * N], y[3 * N + 1] = R**self.m / self.m, R ** (self.m - 1) * y[3 * N - 1]
        return y


class Forced:
    """A scheme with the sources and the boundary values of a manufactured solution."""

    def __init__(self, solution: Solution, cells: int, rtol: float = 1e-6, limiter: bool = False) -> None:
        self.solution, self.limiter = solution, limiter
        parameters = TumourParameters(**VALUES, kappa=solution.kappa)
        geometry = TumourGeometry(kind=KINDS[solution.m], formulation="eulerian")
        super().__init__(parameters, TumourInitial(alpha=0.7), geometry, TumourSolver(cells=cells, rtol=rtol))  # type: ignore[call-arg]

    def initial(self) -> np.ndarray:
        return self.solution.vector(self.cells, 0.0)  # type: ignore[attr-defined]

    def at(self, t: float) -> Any:
        """Constants, with what the surface has at `t`."""
        return self.data(t)._replace(p_out=self.solution.p_out(t), C_out=self.solution.C_out(t))  # type: ignore[attr-defined]

    def forcing(self, t: float) -> np.ndarray:
        """What is added to the rates: averages times W for alpha, integrals for C, area times force over the gap of a face for u."""
        solution, N, m = self.solution, self.cells, self.solution.m  # type: ignore[attr-defined]
        R, faces, out = solution.R(t), np.arange(1, N + 1) / N, np.zeros(3 * N + 4)
        W = R**m / m
        out[0 : 3 * N : 3] = W * solution.average("sources of alpha", N, t)
        out[1 : 3 * N : 3] = W * np.diff(np.append(0.0, faces) ** m) * solution.average("sources of C", N, t)
        middle, gaps = np.append(faces[:-1], 1.0 - 0.25 / N), R * np.append(np.full(N - 1, 1.0 / N), 0.5 / N)
        out[2 : 3 * N : 3] = -((R * faces) ** (m - 1)) * gaps * solution.of["force"](middle, t)
        return out

    def rates(self, data: Any, t: float, y: np.ndarray, out: np.ndarray, work: np.ndarray) -> None:
        VISCOUS["rates"](self.at(t), t, y, out, work)
        out += self.forcing(t)

    def tangent(self, data: Any, t: float, y: np.ndarray, f_0: np.ndarray, *rest: Any) -> None:
        VISCOUS["tangent"](self.at(t), t, y, f_0, *rest)


class ForcedLines(Forced, ViscousLines):
    """For the common time loop, with Newton's method in Python."""

    def solve(self, t: float, alpha: float, past: np.ndarray, guess: np.ndarray) -> Solved:
        w, size, y, half = self.work, 3 * self.cells, guess.copy(), eulerian.HALF
        row = np.repeat(np.arange(size), 2 * half + 1)
        column = row + np.tile(np.arange(-half, half + 1), size)
        kept = (column >= 0) & (column < size)
        f, matrix = np.empty_like(y), np.zeros((size + 2, size + 2))
        for iteration in range(1, 20):
            self.rates(None, t, y, f, w.model)
            self.tangent(None, t, y, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
            matrix[row[kept], column[kept]] = -w.jac.ravel()[kept]
            matrix[:size, size:], matrix[size:, :size], matrix[size:, size:] = -w.columns.T, -w.rows, -w.corner
            matrix[np.arange(size + 2), np.arange(size + 2)] += alpha * self.mass
            change = np.linalg.solve(matrix, f[: size + 2] - alpha * self.mass * (y[: size + 2] - past[: size + 2]))
            y[: size + 2] += change
            if np.max(np.abs(change)) < 1e-11:  # above rounding, below all that is measured
                return Solved(y, iteration)
        raise AssertionError("Newton's method does not converge")


class ForcedRadau(Forced, ViscousRadau):
    """With the compiled integrator's own text, interpreted, so that it takes rates in Python."""


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Lets a scheme run `multiphase.radau` uncompiled, with its own rates."""

    def plain(function: Any, *, keep: str = "", **names: Any) -> Any:
        return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__)

    def use(scheme: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(radau, "compiled", plain)
            own = {"rates": scheme.rates, "tangent": scheme.tangent}
            advance = radau.build(own | {name: VISCOUS[name] for name in ("size_of", "admit", "project", "reach")}, "")
        monkeypatch.setitem(VISCOUS.entries, "advance", advance)
        return scheme

    return use


@pytest.fixture(scope="module", params=CASES)
def solution(request: pytest.FixtureRequest) -> Solution:
    return Solution(*CASES[request.param])


NAMES = ("alpha", "u", "R", "C")


def errors(y: np.ndarray, exact: np.ndarray, m: int) -> np.ndarray:
    """Largest errors of alpha, u, R, C."""
    N = (len(y) - 4) // 3
    alpha = np.abs(y[0 : 3 * N : 3] / y[3 * N] - exact[0 : 3 * N : 3] / exact[3 * N]).max()
    R, R_exact = ((m * v[3 * N]) ** (1.0 / m) for v in (y, exact))
    return np.array([alpha, np.abs(y - exact)[2 : 3 * N : 3].max(), abs(R - R_exact), np.abs(y - exact)[1 : 3 * N : 3].max()])


def at_end(scheme: Any, steps: int, order: int = 2) -> np.ndarray:
    control = Control(order=order, dt=T_END / steps)
    return integrate(scheme, start(scheme, 0.0, T_END, control), [T_END], control).u[0]


def in_space(interpreted: Any, solution: Solution, limiter: bool) -> np.ndarray:
    """Errors on 32, 64 and 128 cells; six steps of Radau IIA add 1e-7 or so."""
    found = []
    for cells in (32, 64, 128):
        y = at_end(interpreted(ForcedRadau(solution, cells, 1e-6, limiter)), 6)
        found.append(errors(y, solution.vector(cells, T_END), solution.m))
    return np.array(found)


def test_second_order_in_space(interpreted: Any, solution: Solution) -> None:
    """In the largest error over all cells, those at the centre and the surface included."""
    found = in_space(interpreted, solution, False)
    orders = np.log2(found[1] / found[2])
    assert np.all(orders >= 1.9)
    assert np.all(found[2] < 6e-5)  # h^2 = 6.1e-5 times numbers below one


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_limiter_costs_no_order_at_a_smooth_extremum(interpreted: Any, m: int) -> None:
    """alpha with a minimum at xi = 0.89, which moves through the cells: no slope is limited. R's errors of both signs cancel for m = 3."""
    solution = Solution(m, 1.3, 4)
    found = in_space(interpreted, solution, True)
    orders = np.log2(found[1] / found[2])
    assert np.all(orders[[0, 1, 3]] >= 1.9)
    assert np.all(found[2] < 6e-5)
    plain = at_end(interpreted(ForcedRadau(solution, 32, 1e-6, False)), 6)
    assert np.abs(errors(plain, solution.vector(32, T_END), m) - found[0]).max() < 1e-12


def orders_in_time(m: int, coarse: np.ndarray, fine: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Orders of alpha, u, R, C from two step sizes, one half of the other, against the last run."""
    return np.log2(errors(coarse, exact, m) / errors(fine, exact, m))


def test_second_order_in_time_by_the_common_loop(solution: Solution) -> None:
    """BDF2 with fixed steps on one grid against far smaller steps on it."""
    scheme = ForcedLines(solution, 12)
    orders = orders_in_time(solution.m, *(at_end(scheme, steps) for steps in (20, 40, 400)))
    assert orders.min() >= 1.9


def test_first_order_in_time_by_backward_euler(solution: Solution) -> None:
    scheme = ForcedLines(solution, 12)
    orders = orders_in_time(solution.m, at_end(scheme, 40, 1), at_end(scheme, 80, 1), at_end(scheme, 400))
    assert orders.min() >= 0.9
    assert orders.max() <= 1.1


def test_high_order_in_time_by_radau(interpreted: Any, solution: Solution) -> None:
    """C is neither measured by Newton's method nor does anything of it accumulate: it ends as exact as the last iteration leaves it."""
    scheme = interpreted(ForcedRadau(solution, 8, 1e-9))  # Newton's method to 3e-12 in alpha and R
    runs = [at_end(scheme, steps) for steps in (8, 16, 64)]
    orders = orders_in_time(solution.m, *runs)
    assert orders[:3].min() > 4.5
    assert errors(runs[1], runs[2], solution.m)[3] < 1e-9
