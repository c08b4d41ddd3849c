"""The weak form of the elastic tumour in two dimensions: against a plain calculation on one triangle, and what must hold of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skfem import MeshTri

from tumour.fem.forms import ALPHA, LOCAL, OXYGEN, PRESSURE, D, Forms
from tumour.parameters import TumourParameters

OPTIONS: dict[str, dict[str, Any]] = {
    "paper": {"mobility": "printed"},
    "floor": {"mobility": "printed", "mobility_floor": 0.3},
    "darcy": {"mobility": "darcy", "kappa": 2.0},
    "constant": {"mobility": "constant", "kappa": 3.0},
    "free fluid": {"kappa": 0.0},
    "stiff, uptake saturates": {"mu_alpha": 2.5, "lambda_alpha": 0.7, "gamma": 1.8, "Q1_hat": 5.0, "Q": 2.0},
    "cells attract": {"alpha_min": 0.6, "alpha_star": 0.8, "lambda_alpha": 0.4},
    "smooth switch": {"alpha_min": 0.7, "sigma_width": 0.2},
}
ALL = pytest.mark.parametrize("options", OPTIONS.values(), ids=list(OPTIONS))
STEPS = pytest.mark.parametrize("printed", [False, True], ids=["conservative", "as printed"])
TAU = 0.3


def states(mesh: MeshTri, seed: int, alpha: tuple[float, float] = (0.5, 0.93)) -> tuple[np.ndarray, np.ndarray]:
    """A state at random: J > 0, alpha on both sides of where contact begins, all fields from vertex to vertex as they like."""
    rng = np.random.default_rng(seed)
    size = np.sqrt(np.abs(np.linalg.det((mesh.p[:, mesh.t[1:]] - mesh.p[:, mesh.t[:1]]).transpose(2, 0, 1))).min())
    nodal = np.empty((mesh.nvertices, 5))
    stretch = np.eye(2) * 0.3 + 0.3 * rng.uniform(-1.0, 1.0, (2, 2))
    nodal[:, :2] = mesh.p.T @ stretch.T + 0.06 * size * rng.uniform(-1.0, 1.0, (mesh.nvertices, 2))
    nodal[:, 2], nodal[:, 4] = rng.uniform(*alpha, mesh.nvertices), rng.uniform(0.05, 1.2, mesh.nvertices)
    nodal[:, 3] = rng.normal(size=mesh.nvertices)
    return nodal, 0.02 * size * rng.uniform(-1.0, 1.0, (mesh.nelements, 2))


def disk(shift: int = 0) -> MeshTri:
    """A small mesh without symmetry, whose triangles begin with any of their vertices and run either way round."""
    mesh = MeshTri.init_circle(1).translated((0.3, -0.2))
    rng = np.random.default_rng(5 + shift)
    p = mesh.p + 0.05 * rng.uniform(-1.0, 1.0, mesh.p.shape)
    return MeshTri(p, rng.permuted(mesh.t, axis=0), sort_t=False)


# -- a plain calculation -------------------------------------------------------------------------------------------------


def rule() -> tuple[np.ndarray, np.ndarray]:
    """The six points that are exact for polynomials of degree 4 (Dunavant 1985), in closed form: barycentric coordinates, weights."""
    a = (8.0 - np.sqrt(10.0) + np.array([1.0, -1.0]) * np.sqrt(38.0 - 44.0 * np.sqrt(0.4))) / 18.0
    w = (620.0 + np.array([1.0, -1.0]) * np.sqrt(213125.0 - 53320.0 * np.sqrt(10.0))) / 3720.0
    points = [np.roll([1.0 - 2.0 * a_k, a_k, a_k], i) for a_k in a for i in range(3)]
    return np.array(points), np.repeat(w, 3)


def sigma(alpha: float, of: TumourParameters) -> float:
    """The contact stress."""
    share = 1.0 if alpha >= of.alpha_min else 0.0
    if of.sigma_width > 0.0:
        x = min(max((alpha - of.alpha_min) / of.sigma_width + 0.5, 0.0), 1.0)
        share = 3.0 * x**2 - 2.0 * x**3
    return share * of.gamma * (alpha - of.alpha_star) / (1.0 - alpha) ** 2


class Point:
    """Fields and shape functions at one point l of a triangle with the vertices x and the 17 unknowns u."""

    def __init__(self, x: np.ndarray, u: np.ndarray, l: np.ndarray) -> None:
        hats = np.linalg.inv(np.column_stack([np.ones(3), x]))[1:].T  # row i: gradient of l_i, which is 1 at x_i and 0 at the others
        self.phi, self.phi_grad = l, hats
        psi_grad = 27.0 * (l[1] * l[2] * hats[0] + l[0] * l[2] * hats[1] + l[0] * l[1] * hats[2])
        self.v_grad = [*hats, psi_grad]
        u_d = np.vstack([u[:15].reshape(3, 5)[:, :2], u[15:]])
        self.F = np.eye(2) + sum(np.outer(u_d[i], self.v_grad[i]) for i in range(4))
        self.J = self.F[0, 0] * self.F[1, 1] - self.F[0, 1] * self.F[1, 0]
        self.alpha, self.p, self.C = l @ u[:15].reshape(3, 5)[:, 2:]
        self.p_grad, self.C_grad = hats.T @ u[3:15:5], hats.T @ u[4:15:5]


def plain(x: np.ndarray, u: np.ndarray, tau: float, of: TumourParameters, old: np.ndarray | None) -> np.ndarray:
    """Residual of one triangle, point by point and function by function."""
    rows = np.zeros(LOCAL)
    area = 0.5 * abs(np.linalg.det(x[1:] - x[0]))
    for l, weight in zip(*rule(), strict=True):
        at = Point(x, u, l)
        F, J, alpha, C, dx = at.F, at.J, at.alpha, at.C, weight * area
        amount = alpha * J
        if old is not None:
            before = Point(x, old, l)
            amount = (J - before.J) * alpha + (alpha - before.alpha) * J
        birth, death = (1.0 + of.s1) * C / (1.0 + of.s1 * C), (of.s2 + of.s3 * C) / (1.0 + of.s4 * C)
        q = birth * alpha * (1.0 - alpha) - death * alpha
        M = 0.0
        if of.kappa > 0.0:
            laws = {
                "darcy": (1.0 - alpha) / (of.kappa * alpha),
                "printed": 1.0 / (of.mobility_floor + of.kappa * alpha),
                "constant": 1.0 / of.kappa,
            }
            M = laws[of.mobility]
        F_inv_T = np.linalg.inv(F).T
        pull = J * np.linalg.inv(F.T @ F)
        P = of.mu_alpha * (F - F_inv_T) + of.lambda_alpha * J * (J - 1.0) * F_inv_T - (at.p + alpha * sigma(alpha, of)) * J * F_inv_T
        for i in range(3):
            rows[5 * i : 5 * i + 2] += P @ at.v_grad[i] * dx
            rows[5 * i + 2] += (amount - tau * J * q) * at.phi[i] * dx
            rows[5 * i + 3] += (J * at.phi[i] + tau * M * at.p_grad @ pull @ at.phi_grad[i]) * dx
            rows[5 * i + 4] += (at.C_grad @ pull @ at.phi_grad[i] + J * of.Q * alpha * C / (1.0 + of.Q1_hat * C) * at.phi[i]) * dx
        rows[15:] += P @ at.v_grad[3] * dx
    return rows


def unknowns(mesh: MeshTri, state: tuple[np.ndarray, np.ndarray], e: int) -> np.ndarray:
    """The 17 unknowns of triangle e."""
    return np.concatenate([state[0][mesh.t[:, e]].ravel(), state[1][e]])


@STEPS
@ALL
def test_a_plain_calculation(options: dict[str, Any], printed: bool) -> None:
    mesh, of = disk(), TumourParameters(**options)
    state, old = states(mesh, 1), states(mesh, 2) if printed else None
    found = Forms(mesh, of).element_residuals(*state, TAU, old)
    for e in range(mesh.nelements):
        last = unknowns(mesh, old, e) if old else None
        wanted = plain(mesh.p[:, mesh.t[:, e]].T, unknowns(mesh, state, e), TAU, of, last)
        np.testing.assert_allclose(found[e], wanted, rtol=1e-11, atol=1e-12 * np.abs(wanted).max())


def test_the_states_are_admissible_and_their_triangles_run_both_ways() -> None:
    mesh = disk()
    x = mesh.p[:, mesh.t]
    turn = np.sign(np.linalg.det((x[:, 1:] - x[:, :1]).transpose(2, 0, 1)))
    assert set(turn) == {-1.0, 1.0}
    for seed in (1, 2, 3):
        state = states(mesh, seed)
        J = [Point(x[:, :, e].T, unknowns(mesh, state, e), l).J for e in range(mesh.nelements) for l in rule()[0]]
        assert 0.1 < min(J) < 0.9 * max(J)
        assert state[0][:, 2].min() < 0.7 < 0.85 < state[0][:, 2].max()


# -- what must hold ------------------------------------------------------------------------------------------------------


@ALL
def test_what_a_step_takes_from_its_past(options: dict[str, Any]) -> None:
    """With tau = 0 the rows of cells and fluid are the moments; the step as printed differs by (J - J_old)(alpha - alpha_old)."""
    mesh = disk()
    forms, state, old = Forms(mesh, TumourParameters(**options)), states(mesh, 1), states(mesh, 2)
    moments, before = forms.moments(*state), forms.moments(*old)
    rows, as_printed = forms.element_residuals(*state, 0.0), forms.element_residuals(*state, 0.0, old)
    np.testing.assert_allclose(rows[:, ALPHA + PRESSURE], moments[:, ALPHA + PRESSURE], rtol=1e-14)
    assert not moments[:, D + OXYGEN].any()
    others = [k for k in range(LOCAL) if k not in ALPHA]
    np.testing.assert_array_equal(as_printed[:, others], rows[:, others])
    frozen = old[0].copy(), old[1]
    frozen[0][:, 2] = state[0][:, 2]  # alpha as it is, J as it was: nothing of the difference is left
    np.testing.assert_allclose(
        forms.element_residuals(*state, 0.0, frozen)[:, ALPHA], (moments - forms.moments(*frozen))[:, ALPHA], atol=1e-15
    )
    assert np.abs(as_printed - (moments - before))[:, ALPHA].max() > 1e-4


def test_uniform_fields_are_in_equilibrium() -> None:
    """Patch test: no force on vertices inside and on bubbles for uniform F, alpha and p; what is left on the surface is P N."""
    mesh = disk()
    F = np.array([[1.3, 0.4], [-0.2, 0.9]])
    nodal = np.column_stack([mesh.p.T @ (F - np.eye(2)).T, np.full((mesh.nvertices, 3), [0.87, 0.6, 0.4])])
    forms = Forms(mesh, TumourParameters(lambda_alpha=0.6))
    at_vertices, at_bubbles = forms.assemble(forms.element_residuals(nodal, np.zeros((mesh.nelements, 2)), TAU))
    inside = np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())
    assert len(inside) > 0
    assert np.abs(at_vertices[inside, :2]).max() < 1e-14
    assert np.abs(at_bubbles).max() < 1e-14
    J, F_inv_T = np.linalg.det(F), np.linalg.inv(F).T
    P = F - F_inv_T + 0.6 * J * (J - 1.0) * F_inv_T - (0.6 + 0.87 * 0.07 / 0.13**2) * J * F_inv_T
    corners = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]  # (2, ends, facets)
    middle = mesh.p[:, mesh.t[:, mesh.f2t[0, mesh.boundary_facets()]]].mean(axis=1)
    along = corners[:, 1] - corners[:, 0]
    normal = np.array([along[1], -along[0]])  # as long as the edge
    normal *= np.sign(np.sum(normal * (corners[:, 0] - middle), axis=0))
    tractions = np.zeros((mesh.nvertices, 2))
    for end in range(2):
        np.add.at(tractions, mesh.facets[end, mesh.boundary_facets()], 0.5 * (P @ normal).T)
    np.testing.assert_allclose(at_vertices[:, :2], tractions, atol=1e-13)


@ALL
def test_a_rotation_of_the_deformed_body_turns_the_forces_with_it(options: dict[str, Any]) -> None:
    mesh = disk()
    forms, (nodal, bubbles) = Forms(mesh, TumourParameters(**options)), states(mesh, 3)
    turn = np.array([[np.cos(0.8), -np.sin(0.8)], [np.sin(0.8), np.cos(0.8)]])
    turned = nodal.copy()
    turned[:, :2] = (mesh.p.T + nodal[:, :2]) @ turn.T - mesh.p.T + [0.3, -0.7]
    rows, rows_turned = forms.element_residuals(nodal, bubbles, TAU), forms.element_residuals(turned, bubbles @ turn.T, TAU)
    forces = rows[:, D].reshape(-1, 4, 2) @ turn.T
    np.testing.assert_allclose(rows_turned[:, D].reshape(-1, 4, 2), forces, atol=1e-12 * np.abs(forces).max())
    rest = ALPHA + PRESSURE + OXYGEN
    np.testing.assert_allclose(rows_turned[:, rest], rows[:, rest], atol=1e-13 * np.abs(rows[:, rest]).max())


@STEPS
def test_neither_the_order_of_the_vertices_nor_that_of_the_triangles_matters(printed: bool) -> None:
    mesh, other = disk(), disk()
    rng = np.random.default_rng(0)
    order = rng.permutation(mesh.nelements)
    other = MeshTri(mesh.p, rng.permuted(mesh.t, axis=0)[:, order], sort_t=False)
    state, old, of = states(mesh, 1), states(mesh, 2), TumourParameters()
    residuals = []
    for body, triangles in ((mesh, slice(None)), (other, order)):
        forms = Forms(body, of)
        past = (old[0], old[1][triangles]) if printed else None
        rows = forms.element_residuals(state[0], state[1][triangles], TAU, past)
        residuals.append(forms.assemble(rows))
    np.testing.assert_allclose(residuals[1][0], residuals[0][0], atol=1e-13)
    np.testing.assert_allclose(residuals[1][1], residuals[0][1][order], atol=1e-13)


@STEPS
@ALL
def test_tangents(options: dict[str, Any], printed: bool) -> None:
    """Against differences of the assembled residual in a few directions, at alpha well off the contact stress's switch."""
    mesh, rng = disk(), np.random.default_rng(4)
    forms = Forms(mesh, TumourParameters(**options))
    state, old = states(mesh, 1, (0.82, 0.93)), states(mesh, 2) if printed else None
    tangents = forms.element_tangents(*state, TAU, old)
    for _ in range(3):
        direction = rng.normal(size=state[0].shape), rng.normal(size=state[1].shape)
        local = np.concatenate([direction[0].ravel(), direction[1].ravel()])[forms.numbers]
        found = forms.assemble(np.einsum("eij,ej->ei", tangents, local))
        ends = [
            forms.assemble(forms.element_residuals(*(u + s * du for u, du in zip(state, direction, strict=True)), TAU, old))
            for s in (1e-5, -1e-5)
        ]
        for rows, up, down in zip(found, *ends, strict=True):
            np.testing.assert_allclose(rows, (up - down) / 2e-5, atol=2e-5 * np.abs(rows).max())


def test_forces_of_the_displacement_come_from_an_energy() -> None:
    """At fixed alpha and p their tangent is symmetric; and neither they nor the flow know what they should not."""
    mesh = disk()
    forms = Forms(mesh, TumourParameters(lambda_alpha=0.4))
    K = forms.element_tangents(*states(mesh, 1), TAU)
    forces = K[:, D][:, :, D]
    np.testing.assert_allclose(forces, forces.transpose(0, 2, 1), atol=1e-7 * np.abs(forces).max())
    assert not K[:, D][:, :, OXYGEN].any()
    assert not K[:, ALPHA][:, :, PRESSURE].any()
    assert not K[:, PRESSURE][:, :, OXYGEN].any()
    assert not K[:, OXYGEN][:, :, PRESSURE].any()
