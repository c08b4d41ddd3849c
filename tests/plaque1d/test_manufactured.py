"""A manufactured solution on a moving domain, every term of every equation at work: orders in space and time.

L(t), n(xi, t) and w(xi, t) are chosen; l(0, t) = L'/Psi_m and the slope of l at the wall follow from the boundary conditions, so that
only volume sources are added. The sources come from the equations as they stand in the paper's variables (u_n, u_m, p_n), not from
the discretised forms.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from multiphase.stepping import Control, integrate, start

VALUES = {
    "Psi_l": 1.0,
    "Psi_m": 0.5,
    "k_l": 2.0,
    "k_m": 1.5,
    "b": 5.0,
    "mu_n": 0.3,
    "lambda_n": 0.1,
    "mu_m": 0.6,
    "A": 0.8,
    "B": 1.5,
    "k": 2.0,
}
T_END = 0.4


def _solution(momentum, p_out):
    """Exact fields and sources as functions of (xi, t), and L(t)."""
    xi, t = sp.symbols("xi t")
    v = {name: sp.Rational(str(value)) for name, value in VALUES.items()}
    L = 1 + sp.Rational(3, 10) * t + sp.sin(t) / 10
    V = sp.diff(L, t)
    x = xi * L
    n = sp.Rational(2, 5) + (1 + sp.sin(t) / 3) * sp.cos(sp.pi * xi) / 6 + xi**2 / 10
    c = 1 - n
    slope = V * V / v["Psi_m"] - v["Psi_l"]
    l = V / v["Psi_m"] + slope * x * (1 - xi / 2) + (1 + t) * xi**2 * (1 - xi) ** 2
    w = V / c.subs(xi, 0) * (1 - xi) * (1 + xi * sp.cos(t) / 2)

    def dx(f):
        return sp.diff(f, xi) / L

    def dt(f):  # at fixed x
        return sp.diff(f, t) - xi * V * dx(f)

    u_n, u_m = V - c * w, V + n * w
    nu_n, nu_m = 2 * v["mu_n"] + v["lambda_n"], 2 * v["mu_m"]
    stress = v["A"] / (1 + v["B"] * l ** v["k"])
    source_n = dt(n) + dx(n * u_n) - v["k_m"] * l * c
    source_l = dt(l) + dx(l * V) - dx(dx(l)) + v["k_l"] * l * c
    p = p_out - c * stress + n * nu_n * dx(u_n) + c * nu_m * dx(u_m)
    if momentum == "interfacial":  # n-momentum: -n p_x + (nu_n n u_n,x)_x + b n c w = 0
        defect = -n * dx(p) + dx(nu_n * n * dx(u_n)) + v["b"] * n * c * w
    else:  # -(n p)_x + (nu_n n u_n,x)_x + b n c w = 0
        defect = -dx(n * p) + dx(nu_n * n * dx(u_n)) + v["b"] * n * c * w

    def function(expression):
        return sp.lambdify((xi, t), expression, "numpy")

    fields = {"n": function(n), "l": function(l), "w": function(w), "u_n": function(u_n), "u_m": function(u_m), "p_n": function(p)}
    return fields, {"n": function(L * source_n), "l": function(L * source_l), "w": function(L * defect)}, sp.lambdify(t, L)


def _averages(function, cells, t):
    """Cell averages by Gauss's rule of five points."""
    points, weights = np.polynomial.legendre.leggauss(5)
    xi = (np.arange(cells)[:, None] + 0.5 + 0.5 * points) / cells
    return np.broadcast_to(function(xi, t), xi.shape) @ (0.5 * weights)


@pytest.fixture(scope="module", params=[("interfacial", 0.0), ("drag", 1.6)], ids=["interfacial", "drag"])
def problem(request):
    return *_solution(*request.param), {"momentum": request.param[0], "p_out": request.param[1]}


def _run(make_scheme, problem, cells, rtol, dt=None, order=2):
    fields, sources, width, form = problem

    def extra(plaque):
        return {name: plaque.source(lambda xi, t, L, f=f: f(xi, t), on_faces=name == "w") for name, f in sources.items()}

    table = [{"at": np.linspace(0.0, float(width(0.0)), 4001).tolist(), "values": 0} for _ in range(2)]
    xi = np.linspace(0.0, 1.0, 4001)
    for entry, name in zip(table, "nl", strict=True):
        entry["values"] = np.broadcast_to(fields[name](xi, 0.0), xi.shape).tolist()
    scheme = make_scheme(cells, rtol, extra, n=table[0], l=table[1], L=float(width(0.0)), **VALUES, **form)
    control = Control(order=order, dt=dt)
    state = integrate(scheme, start(scheme, 0.0, T_END, control), [0.0, T_END], control)
    return scheme, state


def test_second_order_in_space(make_scheme, problem):
    fields, _, width, _ = problem
    errors = []
    for cells in (16, 32, 64):
        scheme, state = _run(make_scheme, problem, cells, rtol=3e-7)
        u = state.u[0]
        exact_w = fields["w"](np.arange(1, cells) / cells, T_END)
        stored = scheme.observe(state.t, state.u[0])
        found = [np.mean(np.abs(stored.fields[name] - _averages(fields[name], cells, T_END))) for name in ("n", "l", "u_n", "u_m", "p_n")]
        errors.append([*found, np.mean(np.abs(u[scheme.w] - exact_w)), abs(u[scheme.size] - width(T_END))])
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders[-1] >= 1.9)
    assert errors[-1][0] < 1e-4


def test_second_order_in_time(make_scheme, problem):
    """Fixed steps on one mesh against a far smaller step on it."""
    results = {dt: _run(make_scheme, problem, 12, 1e-10, dt)[1].u[0] for dt in (T_END / 8, T_END / 16, T_END / 128)}
    reference = results.pop(T_END / 128)
    scheme = make_scheme(12)
    for part in (scheme.n, scheme.l, slice(scheme.size, scheme.size + 1)):
        coarse, fine = (np.mean(np.abs(u[part] - reference[part])) for u in results.values())
        assert np.log2(coarse / fine) >= 1.8


def test_backward_euler_is_of_first_order(make_scheme, problem):
    results = {dt: _run(make_scheme, problem, 12, 1e-10, dt, order=1)[1].u[0] for dt in (T_END / 8, T_END / 16, T_END / 128)}
    reference = results.pop(T_END / 128)
    coarse, fine = (np.mean(np.abs(u - reference)) for u in results.values())
    # first order: (1 - 1/16) / (1/2 - 1/16) = 2.14 with this reference, so 1.1 when the error is dt alone
    assert 0.9 <= np.log2(coarse / fine) <= 1.3
