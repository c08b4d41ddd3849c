"""Against a solver that shares nothing with ours: Chebyshev collocation in the paper's own unknowns, SciPy's BDF in time.

The slip comes from the necrotic momentum balance with the pressure of the mixture put in, not from the reduced slip equation, and all
boundary conditions are collocated.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BarycentricInterpolator

from plaque1d import PlaqueInitial, PlaqueParameters, simulate

VALUES = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "A": 0.5, "B": 1.0, "k": 1.0}
WIDTH, T_END = 0.5, 0.5


def _differentiation(N):
    """Chebyshev points on [0, 1], increasing, and their differentiation matrix."""
    x = np.cos(np.pi * np.arange(N + 1) / N)
    c = np.ones(N + 1)
    c[[0, -1]] = 2.0
    c *= (-1.0) ** np.arange(N + 1)
    D = np.outer(c, 1.0 / c) / (x[:, None] - x[None, :] + np.eye(N + 1))
    D -= np.diag(D.sum(axis=1))
    return (1.0 - x) / 2.0, -2.0 * D


def _reference(momentum, nu_n, nu_m, p_out, N):
    """Fields at T_END on the Chebyshev points."""
    v = VALUES
    xi, D = _differentiation(N)
    order = np.arange(N + 1)
    modes = np.cos(np.outer(np.pi * order / N, order))
    damping = modes @ np.diag(N * N * (order / N) ** 12.0) @ np.linalg.inv(modes)  # of the shortest waves of n, which alias

    def fields(y):
        """L, n with n_xi(0) = 0, l with its two wall conditions, from the unknowns."""
        L, n, l = y[-1], np.empty(N + 1), np.empty(N + 1)
        n[1:] = y[:N]
        n[0] = -(D[0, 1:] @ n[1:]) / D[0, 0]
        l[1:N] = y[N : 2 * N - 1]
        fixed, per_wall = -(D[N, 1:N] @ l[1:N]) / D[N, N], -D[N, 0] / D[N, N]  # l_xi(1) = 0: l_N = fixed + per_wall l_0
        rest = D[0, 1:N] @ l[1:N] + D[0, N] * fixed
        own = D[0, 0] + D[0, N] * per_wall
        b, c = -own / L, -rest / L - v["Psi_l"]  # Psi_m l_0^2 - l_x(0) = Psi_l
        l[0] = -2.0 * c / (b + np.sqrt(b * b - 4.0 * v["Psi_m"] * c))
        l[N] = fixed + per_wall * l[0]
        return L, n, l

    def mechanics(L, n, l):
        """V, w and p_n."""
        c, V, d = 1.0 - n, v["Psi_m"] * l[0], D / L
        strain_n, strain_m = -(d * c), d * n  # of u_n = V - c w and u_m = V + n w, as matrices on w
        per_w = (n * nu_n)[:, None] * strain_n + (c * nu_m)[:, None] * strain_m
        rest = p_out - c * v["A"] / (1.0 + v["B"] * l ** v["k"])
        friction = d @ ((n * nu_n)[:, None] * strain_n) + np.diag(v["b"] * n * c)
        if momentum == "interfacial":
            matrix, load = friction - n[:, None] * (d @ per_w), n * (d @ rest)
        else:
            matrix, load = friction - d @ (n[:, None] * per_w), d @ (n * rest)
        matrix[[0, N]] = 0.0
        matrix[0, 0], load[0] = c[0], V
        matrix[N, N], load[N] = 1.0, 0.0
        w = np.linalg.solve(matrix, load)
        return V, w, rest + per_w @ w

    def rates(t, y):
        L, n, l = fields(y)
        V, w, _ = mechanics(L, n, l)
        c = 1.0 - n
        n_t = (xi * V * (D @ n) - D @ (n * (V - c * w))) / L + v["k_m"] * l * c - damping @ n
        l_t = (xi - 1.0) * V * (D @ l) / L + D @ (D @ l) / L**2 - v["k_l"] * l * c
        return np.concatenate([n_t[1:], l_t[1:N], [V]])

    start = np.concatenate([0.1 + 0.05 * np.cos(np.pi * xi[1:]) ** 2, np.full(N - 1, 0.2), [WIDTH]])
    y = solve_ivp(rates, (0.0, T_END), start, method="BDF", rtol=1e-8, atol=1e-10).y[:, -1]
    L, n, l = fields(y)
    V, w, p = mechanics(L, n, l)
    return xi, L, {"n": n, "l": l, "u_n": V - (1.0 - n) * w, "u_m": V + n * w, "p_n": p}


def _averages(xi, values, cells):
    points, weights = np.polynomial.legendre.leggauss(4)
    at = (np.arange(cells)[:, None] + 0.5 + 0.5 * points) / cells
    return BarycentricInterpolator(xi, values)(at.ravel()).reshape(at.shape) @ (0.5 * weights)


@pytest.mark.parametrize(
    ("momentum", "nu_n", "nu_m", "p_out"),
    [("interfacial", 0.1, 1.0, 0.0), ("drag", 0.1, 1.0, 0.6)],
)
def test_both_forms_agree_with_an_independent_solver(momentum, nu_n, nu_m, p_out):
    xi, L, exact = _reference(momentum, nu_n, nu_m, p_out, 48)
    # The collocation itself: 48 against 32 points.
    _, L_coarse, coarse = _reference(momentum, nu_n, nu_m, p_out, 32)
    parameters = PlaqueParameters(**VALUES, mu_n=nu_n / 2, mu_m=nu_m / 2, momentum=momentum, p_out=p_out)
    initial = PlaqueInitial(n="0.1 + 0.05*cos(pi*xi)**2", l=0.2, L=WIDTH)
    errors = []
    for cells in (20, 40):
        result = simulate(parameters, initial=initial, t_end=T_END, cells=cells, rtol=2e-6, save_at=[T_END])
        found = [np.mean(np.abs(result[name][-1] - _averages(xi, exact[name], cells))) for name in exact]
        errors.append([*found, abs(result["n_wall"][-1] - exact["n"][0])])
        assert result["L"][-1] == pytest.approx(L, abs=1e-4)
    resolved = np.abs(_averages(xi, exact["n"], 40) - _averages(np.asarray(_differentiation(32)[0]), coarse["n"], 40)).mean()
    assert resolved < 3e-5  # the reference is good to a tenth of what is compared
    assert abs(L - L_coarse) < 1e-7
    orders = np.log2(np.array(errors[0]) / np.array(errors[1]))
    n, l, u_n, u_m, p_n, n_wall = errors[1]
    assert n < 4e-4
    assert l < 5e-5  # the error in time, some ten times rtol; the mesh's is below it
    assert max(u_n, u_m) < 6e-4
    assert p_n < 2e-3
    assert n_wall < 1.5e-3
    assert np.all(orders[[0, 2, 3, 5]] > 1.8)
    assert orders[4] > 1.6  # the pressure is a derivative and settles later
