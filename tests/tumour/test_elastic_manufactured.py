"""Manufactured solutions of the elastic tumour in all three geometries, centre included: orders in space and time.

r(R, t), alpha and C are chosen, with contact everywhere. The fluid pressure follows from the momentum balance, up to its value on the
surface, which follows from the traction there being 0; so p_out and C_out are what the solution has at R = 1, and the rows of v (2.22c),
alpha J (2.22b) and C (2.22d) get sources. All are worked out from the equations at a point, in R, not from the discrete ones.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import solve_banded

from multiphase import radau
from multiphase.stepping import Control, Solved, integrate, start
from tumour import radial
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import ELASTIC, ElasticLines, ElasticRadau
from tumour.solver import TumourSolver

VALUES = {
    "mu_alpha": 1.2, "lambda_alpha": 0.4, "gamma": 0.9, "alpha_star": 0.75, "alpha_min": 0.75, "Q": 1.5, "Q1_hat": 0.7, "mobility": "darcy",
}  # fmt: skip
CASES = {"slab": (1, 1.3), "disk": (2, 1.3), "sphere": (3, 1.3), "disk, free fluid": (2, 0.0)}
KINDS = {1: "slab", 2: "disk", 3: "sphere"}
T_END = 0.4
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)


class Solution:
    """Exact fields, the pressure's slope, and sources, as functions of (R, t)."""

    def __init__(self, m: int, kappa: float) -> None:
        self.m, self.kappa = m, kappa
        R, t = sp.symbols("R t", positive=True)
        given = TumourParameters(**VALUES, kappa=kappa)
        v = {
            name: sp.Rational(str(getattr(given, name)))
            for name in ("mu_alpha", "lambda_alpha", "gamma", "alpha_star", "Q", "Q1_hat", "kappa")
        }
        s = {name: sp.Rational(str(getattr(given, name))) for name in ("s1", "s2", "s3", "s4")}
        r = R * (1 + sp.sin(3 * t) / 5 + (t - sp.cos(5 * t) / 8) * R**2 / 4 + t * R**4 / 9)
        alpha = sp.Rational(83, 100) + (1 + sp.sin(4 * t) / 3) * sp.cos(sp.pi * R**2) / 40
        C = sp.Rational(1, 2) + (1 + sp.sin(6 * t) / 4) * R**2 / 3 + sp.cos(3 * t) * R**4 / 9
        l_r, l_t = sp.diff(r, R), r / R if m > 1 else sp.Integer(1)
        J = l_r * l_t ** (m - 1)
        P_r, P_t = (v["mu_alpha"] * (l - 1 / l) + v["lambda_alpha"] * J * (J - 1) / l for l in (l_r, l_t))
        contact = alpha * v["gamma"] * (alpha - v["alpha_star"]) / (1 - alpha) ** 2
        p_slope = l_r / J * (sp.diff(P_r, R) + (m - 1) * (P_r - P_t) / R) - sp.diff(contact, R)
        p_surface = (P_r * l_r / J - contact).subs(R, 1)
        growth = (1 + s["s1"]) * C / (1 + s["s1"] * C) * alpha * (1 - alpha) - (s["s2"] + s["s3"] * C) / (1 + s["s4"] * C) * alpha
        uptake = v["Q"] * alpha * C / (1 + v["Q1_hat"] * C)
        mobility = (1 - alpha) / (v["kappa"] * alpha) if kappa else sp.Integer(0)
        expressions = {
            "r": r, "alpha": alpha, "C": C, "J": J, "p_slope": p_slope,
            "sources of v": r ** (m - 1) * (sp.diff(r, t) - mobility / l_r * p_slope),
            "sources of phi": sp.diff(alpha * J, t) - J * growth,
            "sources of C": J * uptake - sp.diff(R ** (m - 1) * J / l_r**2 * sp.diff(C, R), R) / R ** (m - 1),
        }  # fmt: skip
        self.of = {name: self._function(sp.lambdify((R, t), f, "numpy", cse=True)) for name, f in expressions.items()}
        self.p_out, self.C_out = sp.lambdify(t, p_surface), sp.lambdify(t, C.subs(R, 1))

    @staticmethod
    def _function(function: Any) -> Any:
        return lambda R, t: np.broadcast_to(np.asarray(function(R, t), dtype=float), np.shape(R))

    def average(self, name: str, cells: int, t: float) -> np.ndarray:
        """Averages over the cells of the body at rest, by Gauss's rule."""
        R = (np.arange(cells)[:, None] + 0.5 + 0.5 * POINTS) / cells
        weights = WEIGHTS * R ** (self.m - 1)
        return np.sum(weights * self.of[name](R, t), axis=1) / np.sum(weights, axis=1)

    def vector(self, cells: int, t: float) -> np.ndarray:
        """Unknowns of the exact solution."""
        middle, faces = (np.arange(cells) + 0.5) / cells, np.arange(1, cells + 1) / cells
        y = np.zeros(3 * cells + radial.INTEGRALS)
        y[2 : 3 * cells : 3] = self.of["r"](faces, t) ** self.m / self.m
        J = np.diff(y[2 : 3 * cells : 3], prepend=0.0) / np.diff(np.append(0.0, faces) ** self.m / self.m)
        y[0 : 3 * cells : 3], y[1 : 3 * cells : 3] = self.of["alpha"](middle, t) * J, self.of["C"](middle, t)
        return y


class Forced:
    """A scheme with the sources and the boundary values of a manufactured solution."""

    def __init__(self, solution: Solution, cells: int, rtol: float) -> None:
        self.solution = solution
        parameters = TumourParameters(**VALUES, kappa=solution.kappa)
        geometry, solver = TumourGeometry(kind=KINDS[solution.m]), TumourSolver(cells=cells, rtol=rtol)
        super().__init__(parameters, TumourInitial(alpha=0.8), geometry, solver)  # type: ignore[call-arg]

    def initial(self) -> np.ndarray:
        return self.solution.vector(self.cells, 0.0)  # type: ignore[attr-defined]

    def at(self, t: float) -> Any:
        """Constants, with what the surface has at `t`."""
        return self.data(t)._replace(p_out=self.solution.p_out(t), C_out=self.solution.C_out(t))  # type: ignore[attr-defined]

    def forcing(self, t: float) -> np.ndarray:
        """What is added to the rates: averages over a cell for alpha J, integrals for C, values on the faces for v."""
        solution, N = self.solution, self.cells  # type: ignore[attr-defined]
        faces, out = np.arange(1, N + 1) / N, np.zeros(3 * N + radial.INTEGRALS)
        out[0 : 3 * N : 3] = solution.average("sources of phi", N, t)
        out[1 : 3 * N : 3] = solution.average("sources of C", N, t) * np.diff(self.data(t).V)  # type: ignore[attr-defined]
        if solution.kappa > 0.0:
            out[2 : 3 * N : 3] = solution.of["sources of v"](faces, t)
        else:  # the row is area times a difference of p, over a cell or the last half cell
            middle = np.append(faces[:-1], 1.0 - 0.25 / N)
            steps = np.append(np.full(N - 1, 1.0 / N), 0.5 / N)
            out[2 : 3 * N : 3] = -(solution.of["r"](faces, t) ** (solution.m - 1)) * steps * solution.of["p_slope"](middle, t)
        return out

    def rates(self, data: Any, t: float, y: np.ndarray, out: np.ndarray, work: np.ndarray) -> None:
        ELASTIC["rates"](self.at(t), t, y, out, work)
        out += self.forcing(t)

    def tangent(self, data: Any, t: float, y: np.ndarray, f_0: np.ndarray, *rest: Any) -> None:
        ELASTIC["tangent"](self.at(t), t, y, f_0, *rest)


class ForcedLines(Forced, ElasticLines):
    """For the common time loop, with Newton's method in Python."""

    def solve(self, t: float, alpha: float, past: np.ndarray, guess: np.ndarray) -> Solved:
        w, size, y, half = self.work, 3 * self.cells, guess.copy(), radial.HALF
        f = np.empty_like(y)
        for iteration in range(1, 20):
            self.rates(None, t, y, f, w.model)
            self.tangent(None, t, y, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, y)
            band = np.zeros((2 * half + 1, size))
            for k in range(-half, half + 1):  # jac[i, k + half] stands in column i + k
                rows = np.arange(max(0, -k), min(size, size - k))
                band[half - k, rows + k] = -w.jac[rows, k + half]
            band[half] += alpha * self.mass
            change = solve_banded((half, half), band, f[:size] - alpha * self.mass * (y[:size] - past[:size]))
            y[:size] += change
            if np.max(np.abs(change)) < 1e-11:  # above rounding, below all that is measured
                return Solved(y, iteration)
        raise AssertionError("Newton's method does not converge")


class ForcedRadau(Forced, ElasticRadau):
    """With the compiled integrator's own text, interpreted, so that it takes rates in Python."""


def project_once(data: Any, y: np.ndarray, f: np.ndarray, jac: np.ndarray) -> bool:
    """One iteration; the compiled one goes on with rates that know no sources."""
    change = np.empty_like(y)
    assert radial._algebraic_change.py_func(data, f, jac, change)
    y += change
    return False


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Lets a scheme run `multiphase.radau` uncompiled, with its own rates."""

    def plain(function: Any, *, keep: str = "", **names: Any) -> Any:
        return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__)

    def use(scheme: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(radau, "compiled", plain)
            own = {"rates": scheme.rates, "tangent": scheme.tangent, "project": project_once}
            advance = radau.build(own | {name: ELASTIC[name] for name in ("size_of", "admit", "reach")}, "")
        monkeypatch.setitem(ELASTIC.entries, "advance", advance)
        return scheme

    return use


@pytest.fixture(scope="module", params=CASES)
def solution(request: pytest.FixtureRequest) -> Solution:
    return Solution(*CASES[request.param])


def fields(y: np.ndarray, m: int) -> dict[str, np.ndarray]:
    """r on the faces, alpha and C in the cells."""
    N = (len(y) - radial.INTEGRALS) // 3
    faces = np.arange(N + 1) / N
    J = np.diff(y[2 : 3 * N : 3], prepend=0.0) / np.diff(faces**m / m)
    return {"r": (m * y[2 : 3 * N : 3]) ** (1.0 / m), "alpha": y[0 : 3 * N : 3] / J, "C": y[1 : 3 * N : 3].copy()}


def errors(y: np.ndarray, exact: np.ndarray, m: int) -> np.ndarray:
    """Largest errors of r, alpha, C."""
    found, wanted = fields(y, m), fields(exact, m)
    return np.array([np.abs(found[name] - wanted[name]).max() for name in found])


def at_end(scheme: Any, dt: float, order: int = 2) -> np.ndarray:
    control = Control(order=order, dt=dt)
    return integrate(scheme, start(scheme, 0.0, T_END, control), [T_END], control).u[0]


def test_second_order_in_space(solution: Solution) -> None:
    """In the largest error over all cells, those at the centre and the surface included; BDF2 with steps whose errors are 1e-7 or so."""
    coarse, fine = (
        errors(at_end(ForcedLines(solution, cells, 1e-6), T_END / 800), solution.vector(cells, T_END), solution.m) for cells in (32, 64)
    )
    assert np.all(np.log2(coarse / fine) >= 1.9)
    assert np.all(fine < 2.5e-4)  # h^2 = 2.4e-4 times numbers below one


def orders_in_time(runs: list[np.ndarray], m: int) -> np.ndarray:
    """Orders of r, alpha, C from two step sizes, one half of the other, against the last run."""
    coarse, fine, exact = runs
    return np.log2(errors(coarse, exact, m) / errors(fine, exact, m))


def test_second_order_in_time_by_the_common_loop(solution: Solution) -> None:
    """BDF2 with fixed steps on one grid against far smaller steps on it."""
    scheme = ForcedLines(solution, 12, 1e-6)
    assert orders_in_time([at_end(scheme, T_END / steps) for steps in (20, 40, 640)], solution.m).min() >= 1.9


def test_first_order_in_time_by_backward_euler(solution: Solution) -> None:
    scheme = ForcedLines(solution, 12, 1e-6)
    runs = [*(at_end(scheme, T_END / steps, 1) for steps in (40, 80)), at_end(scheme, T_END / 640)]
    assert np.abs(orders_in_time(runs, solution.m) - 1.0).max() <= 0.1


def test_high_order_in_time_by_radau(interpreted: Any, solution: Solution) -> None:
    """Forcing in stiff rows costs up to half of the order, as for every Runge-Kutta method; so does a surface whose p and C depend on
    time. The equations as they are give five: `test_elastic_runs`."""
    scheme = interpreted(ForcedRadau(solution, 8, 1e-9))  # Newton's method to 3e-12
    runs = [at_end(scheme, T_END / steps) for steps in (8, 16, 64)]
    assert orders_in_time(runs, solution.m)[:2].min() > 3.0
    assert errors(runs[1], runs[2], solution.m).max() < 2e-9  # C, too; in the slab 1e-9 is the least it comes to
