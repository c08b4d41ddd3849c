"""Manufactured solutions of the elastic tumour in tissue that varies in space and has directions, on the unit square.

The fields are those of `manufactured.py`; the sources follow from the strong form with stiffness, permeability, diffusivity, consumption
and fibres that are functions of X and Y. On sides where something acts, the flows through the surface are wanted as well.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from skfem import MeshTri

from tumour.parameters import TumourParameters


def load(name: str) -> Any:
    """A module of this folder."""
    key = f"{name}_tumour"
    if key not in sys.modules:
        spec = importlib.util.spec_from_file_location(key, Path(__file__).with_name(f"{name}.py"))
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[key] = module
        spec.loader.exec_module(module)
    return sys.modules[key]


plain = load("manufactured")

TISSUE: dict[str, Any] = {
    "stiffness": "1.2 + 0.4*sin(2*x - y)",
    "permeability": {"xx": "1.3 + 0.4*cos(x + 2*y)", "yy": "0.8 + 0.2*sin(3*x)", "xy": "0.3*cos(2*x)*sin(y + 1)"},
    "diffusivity": {"xx": "0.9 + 0.3*sin(x - y)", "yy": "1.4 + 0.3*x*y", "xy": "0.35*sin(1 + x + y)"},
    "consumption": "1.1 + 0.6*cos(2*x + y)",
    "fibre_angle": "0.4 + 0.9*x - 0.5*sin(2*y)",
    "fibre_ratio": "1.6 + 0.8*cos(2*x)*sin(2*y)",
    "fibre_stiffness": "0.3 + 0.2*sin(3*y + x)",
}
"""Everything varies, all tensors are positive definite, and fibres push more here and less there."""

ALONG: dict[str, Any] = {
    **TISSUE,
    "permeability": {"along": "1.6 + 0.3*sin(x)", "across": "0.6 + 0.2*cos(3*y)"},
    "diffusivity": {"along": "0.7 + 0.2*cos(x + y)", "across": "1.5 - 0.3*x*y"},
}
"""The same with tensors along and across the fibres."""


def tissue_of(parameters: TumourParameters, x: sp.Symbol, y: sp.Symbol) -> list[sp.Expr]:
    """m, K_xx, K_yy, K_xy, D_xx, D_yy, D_xy, w, cos, sin, rho, k_f as expressions, from what the parameters were written as."""

    def read(function: Any) -> sp.Expr:
        return sp.nsimplify(sp.sympify(str(function.to_table()), locals={"x": x, "y": y}), rational=True)

    def tensor(table: Any) -> list[sp.Expr]:
        if not isinstance(table, dict):
            table = {"xx": table, "yy": table}
        parts = {key: sp.nsimplify(sp.sympify(str(value), locals={"x": x, "y": y}), rational=True) for key, value in table.items()}
        if "along" in parts:
            K = axes * sp.diag(parts["along"], parts["across"]) * axes.T
            return [K[0, 0], K[1, 1], K[0, 1]]
        return [parts["xx"], parts["yy"], parts.get("xy", sp.Integer(0))]

    p = parameters
    angle = read(p.fibre_angle)
    axes = sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
    K, D = tensor(p.permeability.to_table()), tensor(p.diffusivity.to_table())
    direction = [sp.cos(angle), sp.sin(angle)]
    return [read(p.stiffness), *K, *D, read(p.consumption), *direction, read(p.fibre_ratio), read(p.fibre_stiffness)]


class TissueSolution(plain.Solution):  # type: ignore[misc, name-defined]
    """Exact fields and their sources in tissue that varies, and the flows through the surface."""

    def __init__(self, parameters: TumourParameters) -> None:
        self.parameters = parameters
        X, Y, t = at = sp.symbols("X Y t", real=True)
        d, alpha, p, C = plain.chosen(X, Y, t)
        local = [*(sp.eye(2) + d.jacobian([X, Y])), alpha, p, C, *(sp.diff(f, x) for f in (p, C) for x in (X, Y))]
        local += tissue_of(parameters, X, Y)
        self._fields = plain.compiled(at, [*d, alpha, p, C])
        self._local = plain.compiled(at, local)
        self._slopes = plain.compiled(at, [sp.diff(f, x) for x in at for f in local])
        self._laws = TissueLaws(parameters)

    def through(self, x: np.ndarray, normal: np.ndarray, t: float) -> np.ndarray:
        """P N (two), flow and diffusion through a surface with the normal N, and how much longer it is than at rest, (5, ...)."""
        local = self._local(*x, t)
        columns = np.array([flux(*local) for flux in self._laws.fluxes])  # [axis, flux, ...]
        F = local[:4].reshape(2, 2, *local.shape[1:])
        stretch = np.hypot(F[1, 1] * normal[0] - F[1, 0] * normal[1], F[0, 0] * normal[1] - F[0, 1] * normal[0])
        return np.concatenate([np.tensordot(normal, columns, 1), stretch[None]])


class TissueLaws(plain.Laws):  # type: ignore[misc, name-defined]
    """The laws as functions of what they depend on at a point, the tissue included, and their derivatives."""

    def __init__(self, parameters: TumourParameters) -> None:
        g = {name: sp.Rational(str(value)) for name, value in plain.values(parameters).items()}
        names = "a b c d alpha p C p_X p_Y C_X C_Y m K_xx K_yy K_xy D_xx D_yy D_xy w a_x a_y rho k_f"
        self._at = a, b, c, d, alpha, p, C, *rest = sp.symbols(names, real=True)
        p_grad, C_grad = sp.Matrix(rest[:2]), sp.Matrix(rest[2:4])
        m, K_xx, K_yy, K_xy, D_xx, D_yy, D_xy, w, a_x, a_y, rho, k_f = rest[4:]
        F, J, fibre = sp.Matrix([[a, b], [c, d]]), a * d - b * c, sp.Matrix([a_x, a_y])
        F_inv = sp.Matrix([[d, -b], [-c, a]]) / J
        contact = alpha * g["gamma"] * (alpha - g["alpha_star"]) / (1 - alpha) ** 2
        now = F * fibre
        square = now.dot(now)
        active = -contact * (sp.eye(2) + (rho - 1) * now * now.T / square)  # Cauchy
        elastic = m * (g["mu"] * (F - F_inv.T) + g["lam"] * (J - 1) * J * F_inv.T)
        P = elastic + J * (active - p * sp.eye(2)) * F_inv.T + 2 * k_f * (square - 1) * now * fibre.T
        size = sp.sqrt((a + d) ** 2 + (c - b) ** 2)
        R = sp.Matrix([[a + d, b - c], [c - b, a + d]]) / size
        K, D = sp.Matrix([[K_xx, K_xy], [K_xy, K_yy]]), sp.Matrix([[D_xx, D_xy], [D_xy, D_yy]])
        flow, diffusion = (J * F_inv * R * tensor * R.T * F_inv.T * slope for tensor, slope in ((K, p_grad), (D, C_grad)))
        flow = plain.mobility(alpha, parameters, g) * flow
        birth, death = (1 + g["s1"]) * C / (1 + g["s1"] * C), (g["s2"] + g["s3"] * C) / (1 + g["s4"] * C)
        growth = J * (birth * alpha * (1 - alpha) - death * alpha)
        uptake = w * J * g["Q"] * alpha * C / (1 + g["Q1_hat"] * C)
        amounts = [alpha * J, J]
        self.amounts, self.amount_slopes = plain.compiled(self._at, amounts), self._slopes(amounts)
        self.reactions = plain.compiled(self._at, [growth, uptake])
        fluxes = [[P[0, i], P[1, i], flow[i], diffusion[i]] for i in range(2)]
        self.fluxes = [plain.compiled(self._at, flux) for flux in fluxes]
        self.flux_slopes = [self._slopes(flux) for flux in fluxes]


class OnSides:
    """What the conditions on some sides of the square leave of a solution's flows through them, as loads.

    Parameters
    ----------
    solution : TissueSolution
    mesh : skfem.MeshTri
    sides : mapping
        By name, "right" or "top": what acts on the side, as in a part of the boundary.
    """

    NORMALS = {"right": (1.0, 0.0), "top": (0.0, 1.0)}  # noqa: RUF012

    def __init__(self, solution: TissueSolution, mesh: MeshTri, sides: dict[str, dict[str, Any]]) -> None:
        self.solution, self.mesh, self.sides = solution, mesh, sides
        places, weights = np.polynomial.legendre.leggauss(5)
        self._hats = 0.5 * np.array([1.0 - places, 1.0 + places])  # (2, points)
        self._weights = 0.5 * weights
        self.edges = {name: self._edges_of(name) for name in sides}

    def _edges_of(self, name: str) -> np.ndarray:
        """The edges of a side, (2, n), in either direction."""
        ends = self.mesh.facets[:, self.mesh.boundary_facets()]
        axis = int(np.argmax(self.NORMALS[name]))
        return np.asarray(ends[:, np.all(self.mesh.p[axis, ends] == 1.0, axis=0)])

    def loads(self, t: float, tau: float) -> np.ndarray:
        """Integrals over the sides with the hats, (N, 5), on the right of a step of size tau."""
        nodal = np.zeros((self.mesh.nvertices, 5))
        for name, edges in self.edges.items():
            corners = self.mesh.p[:, edges]  # (2, ends, edges)
            x = np.einsum("iae,aq->ieq", corners, self._hats)
            lengths = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=0)
            rest = self._rest(name, x, t)
            rest[3] *= tau
            integrals = np.einsum("keq,aq,q,e->aek", rest, self._hats, self._weights, lengths)
            np.add.at(nodal, edges, integrals)
        return nodal

    def _rest(self, name: str, x: np.ndarray, t: float) -> np.ndarray:
        """What flows through the side, less what acts on it in the solution: force (two), nothing of cells, fluid, oxygen."""
        normal = np.array(self.NORMALS[name])
        force, (flow, diffusion, stretch) = np.split(self.solution.through(x, normal, t), [2])
        F = self.solution.local(x, t)[:4]
        cofactor = np.array([F[3] * normal[0] - F[2] * normal[1], F[0] * normal[1] - F[1] * normal[0]])  # J F^-T N
        d, C = self.solution.fields(x, t)[:2], self.solution.fields(x, t)[4]

        def of(key: str) -> float:
            """What acts, at this time."""
            value = self.sides[name].get(key, 0.0)
            return float(np.interp(t, value["times"], value["values"]) if isinstance(value, dict) else value)

        dead = np.array([of("traction_x"), of("traction_y")])[:, None, None]
        springs = of("spring") * d + of("spring_normal") * np.tensordot(normal, d, 1) * normal[:, None, None]
        into = stretch * (of("influx") + (of("membrane") * (of("C") - C) if "membrane" in self.sides[name] else 0.0))
        return np.stack([*(force - dead + springs + of("load") * cofactor), np.zeros_like(flow), flow, diffusion - into])
