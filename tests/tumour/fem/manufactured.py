"""A manufactured solution of the elastic tumour in two dimensions, on the unit square: fields, sources, load vectors, errors.

d, alpha, p and C are chosen, finite strains and contact everywhere; body force and the sources of cells, fluid and oxygen follow from the
equations (2.22) at a point. All are per volume at rest. The pressure has a gradient on the boundary, where d, p and C are prescribed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from skfem import Basis, ElementTriMini, MeshTri

from tumour.parameters import TumourParameters

VALUES: dict[str, Any] = {
    "mu_alpha": 1.2, "lambda_alpha": 0.4, "gamma": 0.9, "alpha_star": 0.8, "alpha_min": 0.3, "kappa": 1.3, "Q": 1.5, "Q1_hat": 0.7,
}  # fmt: skip
"""Parameters with which all terms count and alpha crosses no kink."""

NAMES = ("d_x", "d_y", "alpha", "p", "C")


class Solution:
    """Exact fields and their sources, as functions of X, Y and t.

    Parameters
    ----------
    parameters : TumourParameters
        With alpha_min at most 0.5 and sigma_width = 0, so that contact acts everywhere.

    Notes
    -----
    The laws are differentiated with respect to F, alpha, p, C and their gradients, these with respect to X, Y and t; NumPy puts the two
    together. Expressions stay short that way.
    """

    def __init__(self, parameters: TumourParameters) -> None:
        assert parameters.alpha_min <= 0.5
        assert parameters.sigma_width == 0.0
        self.parameters = parameters
        X, Y, t = at = sp.symbols("X Y t", real=True)
        d, alpha, p, C = chosen(X, Y, t)
        fields = [*d, alpha, p, C]
        local = [*(sp.eye(2) + d.jacobian([X, Y])), alpha, p, C, *(sp.diff(f, x) for f in (p, C) for x in (X, Y))]  # as in `Laws`
        self._fields = compiled(at, fields)
        self._local = compiled(at, local)
        self._slopes = compiled(at, [sp.diff(f, x) for x in at for f in local])
        self._laws = Laws(parameters)

    def fields(self, x: np.ndarray, t: float) -> np.ndarray:
        """d_x, d_y, alpha, p, C (5, ...) at the points x (2, ...)."""
        return self._fields(*x, t)

    def local(self, x: np.ndarray, t: float) -> np.ndarray:
        """F_xX, F_xY, F_yX, F_yY, alpha, p, C, and the gradients of p and C."""
        return self._local(*x, t)

    def sources(self, x: np.ndarray, t: float) -> np.ndarray:
        """Body force -Div P (two), and D(alpha J)/Dt - J q, DJ/Dt - Div(M J F^-1 F^-T grad p), J U - Div(J F^-1 F^-T grad C)."""
        minus_div, rates, _, reactions = self._terms(x, t)
        return np.stack([*minus_div[:2], rates[0] - reactions[0], rates[1] + minus_div[2], reactions[1] + minus_div[3]])

    def step_sources(self, x: np.ndarray, t: float, tau: float) -> np.ndarray:
        """What the rows of one step of size tau have on their right for the fields at t, with no past: body force, ``alpha J - tau J q``,
        ``J - tau Div(M J F^-1 F^-T grad p)``, and the source of oxygen."""
        minus_div, _, amounts, reactions = self._terms(x, t)
        step = amounts[0] - tau * reactions[0], amounts[1] + tau * minus_div[2]
        return np.stack([*minus_div[:2], *step, reactions[1] + minus_div[3]])

    def _terms(self, x: np.ndarray, t: float) -> tuple[np.ndarray, ...]:
        """Minus the divergences of P_x, P_y, flow and diffusion; rates of alpha J and J; alpha J and J; J q and J U."""
        local, slopes = self._local(*x, t), self._slopes(*x, t)
        by_X, by_Y, by_t = slopes.reshape(3, len(local), *local.shape[1:])
        laws = self._laws
        along = [np.einsum("fs...,s...->f...", laws.flux_slopes[i](*local), by) for i, by in enumerate((by_X, by_Y))]
        rates = np.einsum("fs...,s...->f...", laws.amount_slopes(*local), by_t)
        return -along[0] - along[1], rates, laws.amounts(*local), laws.reactions(*local)


class Laws:
    """The laws as functions of what they depend on at a point, and their derivatives with respect to all of that, by SymPy."""

    def __init__(self, parameters: TumourParameters) -> None:
        g = {name: sp.Rational(str(value)) for name, value in values(parameters).items()}
        self._at = a, b, c, d, alpha, p, C, *_ = sp.symbols("a b c d alpha p C p_X p_Y C_X C_Y", real=True)
        p_grad, C_grad = sp.Matrix(self._at[7:9]), sp.Matrix(self._at[9:11])
        F, J = sp.Matrix([[a, b], [c, d]]), a * d - b * c
        F_inv = sp.Matrix([[d, -b], [-c, a]]) / J
        contact = alpha * g["gamma"] * (alpha - g["alpha_star"]) / (1 - alpha) ** 2
        P = g["mu"] * (F - F_inv.T) + (g["lam"] * (J - 1) - p - contact) * J * F_inv.T
        flow, diffusion = mobility(alpha, parameters, g) * J * F_inv * F_inv.T * p_grad, J * F_inv * F_inv.T * C_grad
        birth, death = (1 + g["s1"]) * C / (1 + g["s1"] * C), (g["s2"] + g["s3"] * C) / (1 + g["s4"] * C)
        growth = J * (birth * alpha * (1 - alpha) - death * alpha)
        uptake = J * g["Q"] * alpha * C / (1 + g["Q1_hat"] * C)
        amounts = [alpha * J, J]
        self.amounts, self.amount_slopes = compiled(self._at, amounts), self._slopes(amounts)
        self.reactions = compiled(self._at, [growth, uptake])
        self.flux_slopes = [self._slopes([P[0, i], P[1, i], flow[i], diffusion[i]]) for i in range(2)]

    def _slopes(self, expressions: list[sp.Expr]) -> Any:
        """The function that gives the derivatives (expressions, 11, ...)."""
        slopes = compiled(self._at, [sp.diff(f, s) for f in expressions for s in self._at])

        def shaped(*at: np.ndarray) -> np.ndarray:
            return slopes(*at).reshape(len(expressions), len(self._at), *np.shape(at[0]))

        return shaped


def chosen(X: sp.Symbol, Y: sp.Symbol, t: sp.Symbol) -> tuple[sp.Matrix, sp.Expr, sp.Expr, sp.Expr]:
    """d, alpha, p and C: smooth, no polynomials in t."""
    d = sp.Matrix(
        [
            (sp.Rational(16, 100) + sp.sin(3 * t) / 20) * sp.sin(2 * X + Y / 2) * sp.cos(Y) + X * (Y * sp.exp(-t) - 1) / 9,
            (sp.Rational(12, 100) + sp.cos(4 * t) / 25) * (sp.cos(sp.pi * X / 2) * sp.sin(2 * Y) - X**2 / 2) + Y * sp.sin(2 * t) / 12,
        ]
    )
    alpha = sp.Rational(72, 100) + (1 + sp.sin(4 * t) / 4) * sp.cos(2 * X - Y) * sp.cos(2 * Y + X) / 10
    p = sp.Rational(3, 10) * sp.sin(2 * X - sp.cos(2 * t)) + (1 + sp.sin(5 * t) / 3) * sp.cos(X + 2 * Y) / 4
    C = sp.Rational(7, 10) + (1 + sp.cos(3 * t) / 5) * (sp.sin(2 * X) * sp.cos(2 * Y) + X * Y / 4) / 5
    return d, alpha, p, C


def values(parameters: TumourParameters) -> dict[str, float]:
    """The parameters that enter, by the names used above."""
    names = ("gamma", "alpha_star", "s1", "s2", "s3", "s4", "Q", "Q1_hat", "kappa", "mobility_floor")
    mu, lam = parameters.moduli
    return {"mu": mu, "lam": lam, **{name: getattr(parameters, name) for name in names}}


def mobility(alpha: sp.Expr, parameters: TumourParameters, g: dict[str, sp.Rational]) -> sp.Expr:
    if parameters.kappa == 0.0:
        return sp.Integer(0)
    laws = {
        "darcy": (1 - alpha) / (g["kappa"] * alpha),
        "printed": 1 / (g["mobility_floor"] + g["kappa"] * alpha),
        "constant": 1 / g["kappa"],
    }
    return laws[parameters.mobility]


def compiled(arguments: tuple[sp.Symbol, ...], expressions: list[sp.Expr]) -> Any:
    """A NumPy function of arrays that gives all expressions, stacked."""
    plain = sp.lambdify(arguments, expressions, "numpy", cse=True)

    def stacked(*at: Any) -> np.ndarray:
        return np.stack([np.broadcast_to(value, np.shape(at[0])) for value in plain(*at)]).astype(float)

    return stacked


class OnMesh:
    """A solution on a mesh of the unit square: what to load a scheme with, and how far off it is.

    Parameters
    ----------
    solution : Solution
    mesh : skfem.MeshTri
        Triangles and bubbles are counted, and vertices ordered, as in ``mesh.t``.
    degree : int
        Of the polynomials that loads and errors are integrated exactly for.
    """

    def __init__(self, solution: Solution, mesh: MeshTri, degree: int = 6) -> None:
        self.solution, self.mesh = solution, mesh
        basis = Basis(mesh, ElementTriMini(), intorder=degree)
        self._x, self._dx = np.asarray(basis.global_coordinates()), basis.dx  # (2, ne, points), (ne, points)
        self._shapes = np.array([np.broadcast_to(f[0], self._dx.shape)[0] for f in basis.basis])  # three hats and psi, (4, points)
        self.boundary = mesh.boundary_nodes()

    def nodal(self, t: float) -> np.ndarray:
        """Values (N, 5) of d_x, d_y, alpha, p, C at the vertices."""
        return self.solution.fields(self.mesh.p, t).T

    def interpolated(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """The fields at the vertices, and bubbles that make d exact at the triangles' middles."""
        nodal, middle = self.nodal(t), self.mesh.p[:, self.mesh.t].mean(axis=1)
        return nodal, (self.solution.fields(middle, t)[:2] - nodal[self.mesh.t, :2].mean(axis=0).T).T

    def loads(self, t: float, tau: float) -> tuple[np.ndarray, np.ndarray]:
        """Integrals of the sources with the shape functions, on the right of a step of size tau: int b . v, tau int s_alpha phi, tau int
        s_p phi, int s_C phi at the vertices (N, 5), and int b psi (ne, 2)."""
        f = self.solution.sources(self._x, t)
        f[2:4] *= tau
        return self._tested(f)

    def loads_of_step(self, t: float, tau: float) -> tuple[np.ndarray, np.ndarray]:
        """The same for a step that comes from no past and leads to the fields at t: all rows, without their moments of the past."""
        return self._tested(self.solution.step_sources(self._x, t, tau))

    def errors(self, nodal: np.ndarray, bubbles: np.ndarray, t: float) -> np.ndarray:
        """L2 norms of the errors of d (bubbles included), alpha, p and C over the body at rest."""
        found = np.einsum("iek,iq->keq", nodal[self.mesh.t], self._shapes[:3])
        found[:2] += np.einsum("ek,q->keq", bubbles, self._shapes[3])
        squares = np.sum((found - self.solution.fields(self._x, t)) ** 2 * self._dx, axis=(1, 2))
        return np.sqrt([squares[0] + squares[1], *squares[2:]])

    def mean_error_of_alpha(self, nodal: np.ndarray, t: float) -> float:
        """The error of a mean of alpha with a smooth weight."""
        found = np.einsum("ie,iq->eq", nodal[self.mesh.t, 2], self._shapes[:3])
        weight = np.sin(3.0 * self._x[0]) * np.cos(2.0 * self._x[1])
        return float(abs(np.sum(weight * (found - self.solution.fields(self._x, t)[2]) * self._dx)))

    def _tested(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrals of five densities with the hats, and of the first two with the bubbles."""
        integrals = np.einsum("keq,iq,eq->iek", f, self._shapes, self._dx)
        nodal = np.zeros((self.mesh.nvertices, 5))
        np.add.at(nodal, self.mesh.t, integrals[:3])
        return nodal, integrals[3, :, :2]
