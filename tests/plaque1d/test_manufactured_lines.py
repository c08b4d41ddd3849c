"""Manufactured solutions of the compiled discretisation, slab and annulus, both momentum forms: orders in space and time.

W(t), n(eta, t) and w(eta, t) are chosen, eta the share of the size W (of the area in the annulus); l(0, t) = V/(R_1 Psi_m) and the slope of
l at the wall follow from the boundary conditions, so that only volume sources are added. They come from the balances as they stand in the
paper's variables (u_n, u_m, p_n), not from the discretised forms. In the annulus with drag only, the radial traction S is chosen too.
"""

from __future__ import annotations

from types import FunctionType

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from multiphase import radau
from multiphase.stepping import Control, Solved, integrate, start
from plaque1d import PlaqueInitial, PlaqueParameters, layout
from plaque1d.lines_scheme import LinesScheme, RadauLines
from plaque1d.parameters import PlaqueGeometry
from plaque1d.semidiscrete import KERNEL

VALUES = {
    "Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 1.5, "b": 5.0, "A": 0.8, "B": 1.5, "k": 2.0,
    "mu_n": 0.3, "lambda_n": 0.1, "mu_m": 0.6, "lambda_m": -0.2,
}  # fmt: skip
FORMS = {"interfacial": {"momentum": "interfacial"}, "drag": {"momentum": "drag", "p_out": 1.6}}
RADII = {"slab": None, "annulus": 0.8}
T_END = 0.4
FIELDS = ("n", "l", "u_n", "u_m", "p_n")
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)


class Solution:
    """Exact fields and sources as functions of (eta, t), and W(t)."""

    def __init__(self, form, shape):
        settings = {"p_out": 0.0, **FORMS[form]}
        self.form, self.R_1 = form, RADII[shape]
        eta, t = sp.symbols("eta t")
        v = {name: sp.Rational(str(value)) for name, value in {**VALUES, "p_out": settings["p_out"]}.items()}
        R_1 = sp.Rational(str(self.R_1 or 1.0))
        W = 1 + sp.Rational(3, 10) * t + sp.sin(4 * t) / 20
        V = sp.diff(W, t)
        r = sp.sqrt(R_1**2 + 2 * W * eta) if self.R_1 else sp.Integer(1)
        n = sp.Rational(1, 2) + (1 + sp.sin(4 * t) / 3) * sp.cos(sp.pi * eta) / 6 - eta**2 / 10  # monotone: no kink of the limiter is met
        c = 1 - n
        wall = V / (R_1 * v["Psi_m"])
        l = wall + W / R_1**2 * (V * wall - R_1 * v["Psi_l"]) * eta * (1 - eta / 2) + (1 + sp.sin(4 * t)) * eta**2 * (1 - eta) ** 2
        w = V / (R_1 * c.subs(eta, 0)) * (1 - eta) * (1 + eta * sp.cos(4 * t) / 2)

        def dr(f):
            return r / W * sp.diff(f, eta)

        def dt(f):  # at fixed r
            return sp.diff(f, t) - eta * V / W * sp.diff(f, eta)

        def divergence(f):
            return dr(r * f) / r

        over_r = 1 / r if self.R_1 else sp.Integer(0)  # no hoop strain in the slab
        u_n, u_m = V / r - c * w, V / r + n * w
        stress = v["A"] / (1 + v["B"] * l ** v["k"])
        phases = ((n, u_n, v["mu_n"], v["lambda_n"]), (c, u_m, v["mu_m"], v["lambda_m"]))
        pulls = [phi * ((2 * mu + lam) * dr(u) + lam * u * over_r) for phi, u, mu, lam in phases]
        hoops = [2 * mu * phi * (dr(u) - u * over_r) * over_r for phi, u, mu, lam in phases]
        F_n, F_m = (dr(pull) + hoop for pull, hoop in zip(pulls, hoops, strict=True))
        friction = v["b"] * n * c * (u_m - u_n)
        if form == "interfacial":  # the pressure gradient from the balance of both phases
            push = n * (-dr(c * stress) + F_n + F_m)
            both = S = sp.Integer(0)
        else:
            S = v["p_out"] + ((1 - eta) * sp.cos(t + eta) / 3 if self.R_1 else 0)
            p = S - c * stress + sum(pulls)
            push = dr(n * p)
            both = -dr(p) - dr(c * stress) + F_n + F_m
        sources = {
            "n": dt(n) + divergence(n * u_n) - v["k_m"] * l * c,
            "l": dt(l) + divergence(l * V / r - dr(l)) + v["k_l"] * l * c,
            "w": -push + F_n + friction - n * both,  # the slip equation is the necrotic balance less n times that of both phases
            "S": -both,
        }
        self.W, self.p_out = sp.lambdify(t, W), float(v["p_out"])
        self.fields, self.sources = {}, {}
        fields = {"n": n, "l": l, "w": w, "u_n": u_n, "u_m": u_m, "S": S, "local": -c * stress + sum(pulls), "hoop": sum(hoops), "r": r}
        for table, group in ((self.fields, fields), (self.sources, sources)):
            for name, expression in group.items():
                table[name] = self._function(sp.lambdify((eta, t), expression, "numpy", cse=True))

    @staticmethod
    def _function(function):
        return lambda eta, t: np.broadcast_to(np.asarray(function(eta, t), dtype=float), np.shape(eta))

    def average(self, function, cells, t):
        """Cell averages by Gauss's rule of five points."""
        eta = (np.arange(cells)[:, None] + 0.5 + 0.5 * POINTS) / cells
        return function(eta, t) @ (0.5 * WEIGHTS)

    def pressure(self, eta, t):
        """p_n of the exact velocities: the hoop stresses integrated from the outer wall, and what is local."""
        points, weights = np.polynomial.legendre.leggauss(20)
        to = eta[..., None] + 0.5 * (1.0 - eta[..., None]) * (1.0 + points)
        step = self.fields["hoop"](to, t) / self.fields["r"](to, t)
        return self.p_out - 0.5 * (1.0 - eta) * self.W(t) * (step @ weights) + self.fields["local"](eta, t)


class Forced:
    """A scheme with the sources of a manufactured solution in its rates."""

    def __init__(self, solution, cells, rtol):
        self.solution = solution
        geometry = PlaqueGeometry(kind="annulus" if solution.R_1 else "slab", lumen_radius=solution.R_1)
        initial = PlaqueInitial(n=0.5, l=1.0, L=float(geometry.width(solution.W(0.0))))
        super().__init__(PlaqueParameters(**VALUES, **FORMS[solution.form]), initial, geometry, cells, rtol)

    def initial(self):
        y, N, W = super().initial(), self.grid.cells, self.solution.W(0.0)
        for part, name in ((self.n, "n"), (self.l, "l")):
            y[part] = W * self.solution.average(self.solution.fields[name], N, 0.0)
        y[self.w] = self.solution.fields["w"](self.grid.faces[1:-1], 0.0)
        return y

    def forcing(self, t):
        """What is added to the rates: rows of n and l hold averages over a cell, times W; that of the slip, area times force."""
        solution, N, m = self.solution, self.grid.cells, self.stride
        out, W = np.zeros(self.size + layout.BORDER + layout.INTEGRALS), solution.W(t)
        for part, name in ((self.n, "n"), (self.l, "l")):
            out[part] = W * solution.average(solution.sources[name], N, t)
        out[self.w] = -W / N * solution.sources["w"](self.grid.faces[1:-1], t)
        if m == 4:  # difference of S over the cells but the first
            centres = self.grid.centres[1:]
            out[3 : self.size - m : m] = -W / N * solution.sources["S"](centres, t) / solution.fields["r"](centres, t)
        return out

    def rates(self, data, t, y, out, work):
        KERNEL["rates"](data, t, y, out, work)
        out += self.forcing(t)

    def tangent(self, data, t, y, f_0, *rest):
        KERNEL["tangent"](data, t, y, f_0 - self.forcing(t), *rest)


class ForcedLines(Forced, LinesScheme):
    """For the common time loop, with Newton's method in Python."""

    def solve(self, t, alpha, past, guess):
        w, size, data, y = self.work, self.size, self.data(t), guess.copy()
        rest, half = len(self.mass), 2 * self.stride
        row = np.repeat(np.arange(size), 2 * half + 1)
        column = row + np.tile(np.arange(-half, half + 1), size)
        kept = (column >= 0) & (column < size)
        f = np.empty_like(y)
        for iteration in range(1, 20):
            self.rates(data, t, y, f, w.model)
            self.tangent(data, t, y, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
            matrix = coo_matrix((-w.jac.ravel()[kept], (row[kept], column[kept])), shape=(rest, rest)).tolil()
            matrix[:size, size:], matrix[size:, :size], matrix[size:, size:] = -w.columns.T, -w.rows, -w.corner
            matrix.setdiag(matrix.diagonal() + alpha * self.mass)
            change = spsolve(matrix.tocsc(), f[:rest] - alpha * self.mass * (y[:rest] - past[:rest]))
            y[:rest] += change
            if np.max(np.abs(change)) < 1e-11:  # above rounding, below all that is measured
                return Solved(y, iteration)
        raise AssertionError("Newton's method does not converge")


class ForcedRadau(Forced, RadauLines):
    """With the compiled integrator's own text, interpreted, so that it takes rates in Python."""


@pytest.fixture
def interpreted(monkeypatch):
    """Lets a scheme run `multiphase.radau` uncompiled, with its own rates."""

    def plain(function, *, keep="", **names):
        return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__)

    def use(scheme):
        with monkeypatch.context() as patch:
            patch.setattr(radau, "compiled", plain)
            own = {"rates": scheme.rates, "tangent": scheme.tangent}
            advance = radau.build(own | {name: KERNEL[name] for name in ("size_of", "admit", "project", "reach")}, "")
        monkeypatch.setitem(KERNEL.entries, "advance", advance)
        return scheme

    return use


@pytest.fixture(scope="module", params=[(form, shape) for form in FORMS for shape in RADII], ids="-".join)
def solution(request):
    return Solution(*request.param)


def _run(scheme, dt=None):
    control = Control(dt=dt)
    state = integrate(scheme, start(scheme, 0.0, T_END, control), [0.0, T_END], control)
    return state.u[0]


def test_second_order_in_space(interpreted, solution):
    errors = []
    for cells in (16, 32, 64):
        scheme = interpreted(ForcedRadau(solution, cells, 1e-6))
        u = _run(scheme)
        stored, faces = scheme.observe(T_END, u), scheme.grid.faces[1:-1]
        exact = {**solution.fields, "p_n": solution.pressure}
        found = [np.mean(np.abs(stored.fields[name] - solution.average(exact[name], cells, T_END))) for name in FIELDS]
        found += [np.mean(np.abs(u[scheme.w] - exact["w"](faces, T_END))), abs(u[scheme.size] - solution.W(T_END))]
        if scheme.stride == 4:
            found.append(np.mean(np.abs(u[3 : scheme.size - 4 : 4] - exact["S"](faces, T_END))))
        errors.append(found)
    errors = np.array(errors)
    assert np.all(np.log2(errors[1] / errors[2]) >= 1.9)
    assert np.all(errors[2] < 2.5e-4)  # h^2 = 2.4e-4 times numbers below one; errors in time are 1e-6


def _orders(scheme, runs):
    """Orders of n, l, w and W from two step sizes, one half of the other, against the last run."""
    parts = {"n": scheme.n, "l": scheme.l, "w": scheme.w, "W": scheme.size}
    coarse, fine, exact = runs
    return {name: np.log2(np.mean(np.abs((coarse - exact)[part])) / np.mean(np.abs((fine - exact)[part]))) for name, part in parts.items()}


def test_second_order_in_time_by_the_common_loop(solution):
    """BDF2 with fixed steps on one grid against a far smaller step on it."""
    scheme = ForcedLines(solution, 12, 1e-6)
    orders = _orders(scheme, [_run(scheme, T_END / steps) for steps in (8, 16, 128)])
    assert min(orders.values()) >= 1.9


def test_high_order_in_time_by_radau(interpreted, solution):
    """Five in n and W. Forcing in stiff rows costs l, and w with it, up to half of the order, as for every Runge-Kutta method."""
    scheme = interpreted(ForcedRadau(solution, 12, 1e-9))  # Newton's method to 3e-12; the errors are 2e-10 and more
    orders = _orders(scheme, [_run(scheme, T_END / steps) for steps in (6, 12, 96)])
    assert min(orders["n"], orders["W"]) > 4.5
    assert min(orders["l"], orders["w"]) > 2.5
