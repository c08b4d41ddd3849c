"""The compiled element of the tumour on triangles: its tangent against differences, its residual against the weak form as written down,
condensed bubbles against the full system, and its sums."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import polar
from skfem import MeshTri

from tumour import equations as eq
from tumour import meshes
from tumour.fem import forms, kernel, layout, tissue
from tumour.fem.arrays import ACTIONS, FIELDS, KEPT, LOCAL, OUTER, ROWS
from tumour.fem.kernel import KERNEL
from tumour.parameters import TumourParameters

OPTIONS: dict[str, dict[str, Any]] = {
    "paper": {"mobility": "printed"},
    "floor": {"mobility": "printed", "mobility_floor": 0.3},
    "darcy": {"mobility": "darcy", "kappa": 2.0},
    "constant": {"mobility": "constant", "kappa": 3.0},
    "free fluid": {"kappa": 0.0},
    "lambda": {"lambda_alpha": 0.7, "mu_alpha": 1.3, "kappa": 3.0},
    "smooth switch": {"alpha_min": 0.75, "sigma_width": 0.2},
    "cells attract": {"alpha_min": 0.6, "alpha_star": 0.8, "lambda_alpha": 0.4},
    "contact from a higher fraction": {"alpha_min": 0.85, "alpha_star": 0.7, "sigma_width": 0.1},
    "uptake saturates": {"Q1_hat": 5.0, "Q": 2.0},
    "weak contact": {"gamma": 0.3, "s1": 4.0, "s2": 0.2, "s3": 0.9, "s4": 3.0},
    "uneven": {"stiffness": "1 + 0.4*x", "permeability": "1.5 + y", "diffusivity": "exp(x*y)", "consumption": "1 + sin(3*x)"},
    "fibres": {"fibre_angle": 0.4, "fibre_ratio": 2.5, "fibre_stiffness": 0.7, "lambda_alpha": 0.5, "alpha_min": 0.5, "sigma_width": 0.1},
    "tensors": {"permeability": {"xx": 2.0, "yy": 0.4, "xy": 0.3}, "diffusivity": {"along": 0.5, "across": 2.0}, "fibre_angle": -0.7},
    "all of it": {
        "stiffness": "1 + 0.4*x",
        "permeability": {"xx": "1.5 + x*y", "yy": "0.8 + 0.2*x", "xy": "0.3*sin(y)"},
        "consumption": "1 + y/2",
        "diffusivity": {"along": "1.2 - 0.3*x", "across": "0.6 + 0.2*y"},
        "fibre_angle": "2*theta",
        "fibre_ratio": "0.3 + 0.2*r",
        "fibre_stiffness": "0.5 + 0.3*x",
        "lambda_alpha": 0.3,
        "mobility": "darcy",
        "kappa": 2.0,
    },
}
ALL = pytest.mark.parametrize("option", OPTIONS)
STEPS = pytest.mark.parametrize("printed", [False, True], ids=["conservative", "as printed"])
TAU = 0.3
NOTHING = layout.no_edges(), np.zeros((0, ACTIONS))
"""A surface on which nothing acts."""


def data_of(option: str, mesh: MeshTri, printed: bool = False) -> kernel.Data:
    return tissue.data_of(TumourParameters(**OPTIONS[option]), layout.elements_of(mesh), mesh.p.T, 1.3, printed=printed)


def irregular(rings: int = 3, seed: int = 5) -> MeshTri:
    """A disk whose inner points are moved at random, and whose triangles begin with any of their corners."""
    body, rng = meshes.disk(1.3, rings), np.random.default_rng(seed)
    points = body.mesh.p.copy()
    inner = np.setdiff1d(np.arange(points.shape[1]), body.surface)
    points[:, inner] += 0.2 / rings * rng.uniform(-1.0, 1.0, (2, len(inner)))
    triangles = np.array([np.roll(corners, k) for corners, k in zip(body.mesh.t.T, rng.integers(0, 3, body.mesh.nelements), strict=True)])
    return MeshTri(points, triangles.T, sort_t=False)


def state(mesh: MeshTri, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An admissible state at random, rough from point to point."""
    rng = np.random.default_rng(seed)
    nodal = np.empty((mesh.nvertices, FIELDS))
    nodal[:, :2] = mesh.p.T @ rng.uniform(-0.35, 0.35, (2, 2)).T + 0.02 * rng.uniform(-1.0, 1.0, (mesh.nvertices, 2))
    nodal[:, 2], nodal[:, 3] = rng.uniform(0.45, 0.93, mesh.nvertices), rng.normal(size=mesh.nvertices)
    nodal[:, 4] = rng.uniform(0.02, 1.2, mesh.nvertices)
    return nodal, 0.01 * rng.uniform(-1.0, 1.0, (mesh.nelements, 2))


def alpha_at_points(el: kernel.Elements, nodal: np.ndarray) -> np.ndarray:
    return nodal[el.triangles, 2] @ el.points.T


def element(c: kernel.Data, el: kernel.Elements, n: int, x: np.ndarray, past: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual and tangent of a triangle with its bubble."""
    e, s, r, K = np.empty(LOCAL), np.empty(ROWS), np.empty(LOCAL), np.empty((LOCAL, LOCAL))
    assert KERNEL["element_tangent"](c, el, TAU, n, x, past, e, s, np.zeros((ROWS, ROWS)), np.zeros((ROWS, LOCAL)), r, K)
    return r, K


def unknowns(el: kernel.Elements, nodal: np.ndarray, bubbles: np.ndarray, n: int) -> np.ndarray:
    return np.concatenate([nodal[el.triangles[n]].ravel(), bubbles[n]])


def past_at(el: kernel.Elements, old: tuple[np.ndarray, np.ndarray], n: int) -> np.ndarray:
    past = np.empty((6, 2))
    KERNEL["past_of"](el, *old, n, np.empty(LOCAL), np.empty(ROWS), past)
    return past


# -- The tangent --------------------------------------------------------------------------------------------------------


@STEPS
@ALL
def test_the_element_tangent_is_the_derivative_of_its_residual(option: str, printed: bool) -> None:
    """Central differences with the step 1e-5: rounding, 1e-16/1e-5 of terms up to 1e3 (1/(1-alpha)^3), and 1e-10 times third
    derivatives, up to 1e3 and more for the same reason, relative to the largest entry of the row's kind: 1e-7."""
    mesh = irregular()
    c = data_of(option, mesh, printed)
    el = layout.elements_of(mesh)
    assert el.triangles.tolist() == mesh.t.T.tolist()
    bends = (c.alpha_min - 0.5 * c.sigma_width, c.alpha_min, c.alpha_min + 0.5 * c.sigma_width)
    worst, below, above = 0.0, 0, 0
    for seed in (1, 2):
        (nodal, bubbles), old = state(mesh, seed), state(mesh, seed + 10)
        fractions = alpha_at_points(el, nodal)
        off = np.min([np.abs(fractions - bend).min(axis=1) for bend in bends], axis=0) > 1e-4  # ten steps from where Sigma bends
        assert np.count_nonzero(off) > 45  # of 54
        below, above = below + np.sum(fractions[off] < c.alpha_min), above + np.sum(fractions[off] > c.alpha_min)
        for n in np.flatnonzero(off):
            x, past = unknowns(el, nodal, bubbles, n), past_at(el, old, n)
            _, K = element(c, el, n, x, past)
            numeric = np.empty_like(K)
            for j in range(LOCAL):
                up, down = x.copy(), x.copy()
                up[j] += 1e-5
                down[j] -= 1e-5
                numeric[:, j] = (element(c, el, n, up, past)[0] - element(c, el, n, down, past)[0]) / (up[j] - down[j])
            scale = np.abs(K).max(axis=1)
            worst = max(worst, float(np.max(np.abs(K - numeric) / scale[:, None])))
    assert below > 20
    assert above > 20
    assert worst < 1e-7


@STEPS
@ALL
def test_two_statements_of_the_element_residual(option: str, printed: bool) -> None:
    """The compiled one and the weak form in scikit-fem, to the rounding of sums of 6 terms that cancel: 1e-12 of the largest row."""
    mesh = irregular()
    c = data_of(option, mesh, printed)
    el = layout.elements_of(mesh)
    written = forms.Forms(mesh, TumourParameters(**OPTIONS[option]), c)
    for seed in (1, 2, 3):
        (nodal, bubbles), old = state(mesh, seed), state(mesh, seed + 10)
        nodal[::5, 4] *= -0.1  # below 0, where an iteration may pass
        expected = written.element_residuals(nodal, bubbles, TAU, old if printed else None)
        found = np.array([element(c, el, n, unknowns(el, nodal, bubbles, n), past_at(el, old, n))[0] for n in range(mesh.nelements)])
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
        for rows in (forms.D, forms.ALPHA, forms.PRESSURE, forms.OXYGEN):
            assert np.abs(found[:, rows] - expected[:, rows]).max() < 1e-12 * np.abs(expected[:, rows]).max()


# -- Assembly and condensation ------------------------------------------------------------------------------------------


def assembled(option: str, printed: bool) -> tuple[Any, ...]:
    """What `tangent` makes of a state at random with loads at random, and the full tangent and residual, element by element."""
    mesh = irregular(2)
    c = data_of(option, mesh, printed)
    el, rng = layout.elements_of(mesh), np.random.default_rng(4)
    held = rng.uniform(size=(mesh.nvertices, FIELDS)) < 0.3
    rows = layout.rows_of(el, held)
    (nodal, bubbles), old = state(mesh, 1), state(mesh, 2)
    loads, bubble_loads = rng.normal(size=nodal.shape), rng.normal(size=bubbles.shape)
    values, kept = np.full(len(rows.indices), np.nan), np.full((mesh.nelements, KEPT), np.nan)
    R, r_bubbles = np.full_like(nodal, np.nan), np.full_like(bubbles, np.nan)
    assert (
        KERNEL["tangent"](c, el, TAU, nodal, bubbles, *old, loads, bubble_loads, *NOTHING, rows.pattern, values, kept, R, r_bubbles) == -1
    )
    size = nodal.size + bubbles.size
    full, right = np.zeros((size, size)), -np.concatenate([loads.ravel(), bubble_loads.ravel()])
    for n in range(mesh.nelements):
        r, K = element(c, el, n, unknowns(el, nodal, bubbles, n), past_at(el, old, n))
        at = np.concatenate([(FIELDS * el.triangles[n][:, None] + np.arange(FIELDS)).ravel(), nodal.size + 2 * n + np.arange(2)])
        full[np.ix_(at, at)] += K
        right[at] += r
    return c, el, rows, held, (nodal, bubbles, old, loads, bubble_loads), values, kept, R, r_bubbles, full, right


def dense(rows: layout.Rows, values: np.ndarray) -> np.ndarray:
    size = len(rows.indptr) - 1
    matrix = np.zeros((size, size))
    for i in range(size):
        at = slice(rows.indptr[i], rows.indptr[i + 1])
        matrix[i, rows.indices[at]] = values[at]
    return matrix


@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("option", ["darcy", "lambda", "smooth switch", "free fluid"])
def test_the_condensed_system_is_the_full_one(option: str, printed: bool) -> None:
    """The change by the condensed system and `bubble_changes`, against that of the full dense system: 1e-10, the rounding of two ways to
    eliminate, times a condition of 1e4 to 1e5."""
    c, el, rows, held, at, values, kept, R, r_bubbles, full, right = assembled(option, printed)
    nodal = at[0]
    if option == "free fluid":  # no row has p in it but those of the momentum: hold it everywhere, as the scheme does
        held[:, 3] = True
        rows = layout.rows_of(el, held)
        values = np.empty(len(rows.indices))
        KERNEL["tangent"](c, el, TAU, nodal, at[1], *at[2], at[3], at[4], *NOTHING, rows.pattern, values, kept, R, r_bubbles)
    free = np.concatenate([rows.free, nodal.size + np.arange(at[1].size)])
    whole = np.zeros(len(right))
    whole[free] = np.linalg.solve(full[np.ix_(free, free)], -right[free])
    change = np.zeros(nodal.size)
    change[rows.free] = np.linalg.solve(dense(rows, values), -R.ravel()[rows.free])
    out = np.empty_like(r_bubbles)
    KERNEL["bubble_changes"](el, kept, r_bubbles, change.reshape(nodal.shape), out)
    found = np.concatenate([change, out.ravel()])
    assert np.abs(whole).max() > 1e-2
    assert np.abs(found - whole).max() < 1e-10 * np.abs(whole).max()
    np.testing.assert_allclose(r_bubbles.ravel(), right[nodal.size :], rtol=1e-13, atol=1e-14)  # rounding


def test_a_residual_with_an_old_tangent_condenses_by_that() -> None:
    """At another state with the blocks kept: R_X - K_Xb K_bb^-1 R_b with K of the old state, so that old matrix and new residual give
    the change of the full system with the old tangent."""
    c, el, rows, _, (nodal, bubbles, old, loads, bubble_loads), values, kept, _, _, full, _ = assembled("lambda", False)
    nodal, bubbles = nodal + 1e-2 * np.random.default_rng(8).normal(size=nodal.shape), 0.5 * bubbles
    R, r_bubbles = np.empty_like(nodal), np.empty_like(bubbles)
    assert KERNEL["residual"](c, el, TAU, nodal, bubbles, *old, loads, bubble_loads, *NOTHING, kept, R, r_bubbles) == -1
    right = -np.concatenate([loads.ravel(), bubble_loads.ravel()])
    for n in range(len(el.areas)):
        r, _ = element(c, el, n, unknowns(el, nodal, bubbles, n), np.ones((6, 2)))
        at = np.concatenate([(FIELDS * el.triangles[n][:, None] + np.arange(FIELDS)).ravel(), nodal.size + 2 * n + np.arange(2)])
        right[at] += r
    free = np.concatenate([rows.free, nodal.size + np.arange(bubbles.size)])
    whole = np.zeros(len(right))
    whole[free] = np.linalg.solve(full[np.ix_(free, free)], -right[free])
    change, out = np.zeros(nodal.size), np.empty_like(bubbles)
    change[rows.free] = np.linalg.solve(dense(rows, values), -R.ravel()[rows.free])
    KERNEL["bubble_changes"](el, kept, r_bubbles, change.reshape(nodal.shape), out)
    np.testing.assert_allclose(np.concatenate([change, out.ravel()]), whole, atol=1e-10 * np.abs(whole).max())  # as above


@pytest.mark.parametrize("printed", [False, True])
def test_residual_and_tangent_give_the_same_residual(printed: bool) -> None:
    c, el, _, _, (nodal, bubbles, old, loads, bubble_loads), _, kept, R, r_bubbles, _, _ = assembled("darcy", printed)
    other, other_bubbles = np.empty_like(R), np.empty_like(r_bubbles)
    KERNEL["residual"](c, el, TAU, nodal, bubbles, *old, loads, bubble_loads, *NOTHING, kept, other, other_bubbles)
    np.testing.assert_allclose(other, R, rtol=1e-12, atol=1e-12)  # rounding, in another order of compiled sums at the most
    np.testing.assert_allclose(other_bubbles, r_bubbles, rtol=1e-12, atol=1e-12)


def test_triangles_that_are_turned_over_are_named() -> None:
    """By all three that look, at any point of the rule, be it only through a bubble."""
    mesh = irregular(2)
    c = data_of("paper", mesh)
    el = layout.elements_of(mesh)
    rows = layout.rows_of(el, np.zeros((mesh.nvertices, FIELDS), dtype=bool))
    nothing = np.zeros((mesh.nvertices, FIELDS)), np.zeros((mesh.nelements, 2))
    kept = np.zeros((mesh.nelements, KEPT))

    def codes(nodal: np.ndarray, bubbles: np.ndarray) -> list[int]:
        R, r = np.empty_like(nodal), np.empty_like(bubbles)
        args = (c, el, TAU, nodal, bubbles, *nothing, *nothing, *NOTHING)
        return [
            KERNEL["turned_over"](el, nodal, bubbles), KERNEL["residual"](*args, kept, R, r),
            KERNEL["tangent"](*args, rows.pattern, np.empty(len(rows.indices)), kept.copy(), R, r),
        ]  # fmt: skip

    nodal, bubbles = state(mesh, 1)
    assert codes(nodal, bubbles) == [-1, -1, -1]
    bulging = bubbles.copy()
    bulging[7] = [0.5, 0.5]
    assert codes(nodal, bulging) == [7, 7, 7]
    nodal[:, 0] = -2.0 * mesh.p[0]
    assert codes(nodal, bubbles) == [0, 0, 0]
    nodal[3, 0] = np.nan  # not greater than 0 either
    assert min(codes(nodal, bubbles)) >= 0


# -- What is observed ---------------------------------------------------------------------------------------------------


def test_the_rule_of_quadrature_and_the_bubble() -> None:
    """Monomials of the barycentric coordinates up to degree 4: 2 a! b! c!/(a + b + c + 2)! of the area. The bubble's gradient adds up
    to 0, and is that of 27 l0 l1 l2."""
    from math import factorial

    el = layout.elements_of(irregular(2))
    assert el.weights.sum() == pytest.approx(1.0, abs=1e-15)
    for a in range(5):
        for b in range(5 - a):
            for c in range(5 - a - b):
                exact = 2.0 * factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 2)
                found = el.weights @ np.prod(el.points ** np.array([a, b, c]), axis=1)
                assert found == pytest.approx(exact, abs=2e-15)  # the table's digits
    corners = el.gradients[3]
    slopes = np.array([KERNEL["bubble_gradient"](corners, *point) for point in el.points])
    assert np.abs(el.weights @ slopes).max() < 1e-14
    l = np.array([0.2, 0.5, 0.3])
    step = 1e-6 * np.array([1.0, -0.4])
    up, down = (27.0 * np.prod(l + sign * corners @ step) for sign in (1.0, -1.0))
    assert np.dot(KERNEL["bubble_gradient"](corners, *l), 2.0 * step) == pytest.approx(up - down, rel=1e-8)  # rounding: 1e-16/1e-6


def tissue_at(c: kernel.Data, el: kernel.Elements) -> tuple[Any, ...]:
    """Stiffness (n, q), permeability (n, q, 2, 2), and direction, push and stiffness of fibres at the quadrature points."""
    rows = np.broadcast_to(c.tissue if c.stride else c.tissue[0], (6 * len(el.areas), 12)).reshape(-1, 6, 12)
    return rows[..., 0], rows[..., [1, 3, 3, 2]].reshape(-1, 6, 2, 2), (rows[..., 8:10], rows[..., 10], rows[..., 11])


@ALL
def test_moments_and_what_is_observed_are_plain_sums(option: str) -> None:
    """Against NumPy on all quadrature points at once; rounding."""
    mesh = irregular()
    c = data_of(option, mesh)
    el, (nodal, bubbles) = layout.elements_of(mesh), state(mesh, 6)
    p = TumourParameters(**OPTIONS[option])
    slopes = np.stack([np.prod(np.delete(el.points, k, axis=1), axis=1) for k in range(3)], axis=1)  # of l0 l1 l2 by each
    psi = 27.0 * np.einsum("qa,nai->nqi", slopes, el.gradients)
    local = nodal[el.triangles]
    F = np.eye(2) + np.einsum("nai,naj->nij", local[:, :, :2], el.gradients)[:, None] + np.einsum("ni,nqj->nqij", bubbles, psi)
    J, inverse = np.linalg.det(F), np.linalg.inv(F)
    alpha, pressure, C = (np.einsum("na,qa->nq", local[:, :, k], el.points) for k in (2, 3, 4))
    weights = el.areas[:, None] * el.weights

    def sums(density: np.ndarray) -> np.ndarray:
        at = np.einsum("nq,qa->na", weights * density, el.points)
        return np.bincount(el.triangles.ravel(), at.ravel(), minlength=mesh.nvertices)

    out = np.empty((4, mesh.nvertices))
    KERNEL["moments"](c, el, nodal, bubbles, out)
    for row, density in enumerate((alpha * J, J, J * eq.net_growth(alpha, C, *p.kinetics))):
        np.testing.assert_allclose(out[row], sums(density), rtol=1e-12, atol=1e-14)
    slope = np.einsum("na,nai->ni", local[:, :, 3], el.gradients)
    M = eq.mobility(alpha, *p.flow) if p.kappa > 0.0 else 0.0 * alpha
    m, K, (a, push, stiff) = tissue_at(c, el)
    R = np.array([[polar(at)[0] for at in row] for row in F])
    flow = (M * J)[..., None] * np.einsum("nqij,nqjk,nqkl,nqml,nqom,no->nqi", inverse, R, K, R, inverse, slope)
    at = np.einsum("nq,nqi,nai->na", weights, flow, el.gradients)
    np.testing.assert_allclose(out[3], np.bincount(el.triangles.ravel(), at.ravel()), rtol=1e-12, atol=1e-12)

    levels, seen, shares = np.array([0.3, np.nan, 0.7]), np.empty((3, mesh.nvertices)), np.empty(3)
    KERNEL["observe"](c, el, nodal, bubbles, levels, seen, shares)
    contact = eq.contact_pressure(alpha, *p.contact)
    load = m * p.lambda_alpha * (J - 1.0) - pressure - contact
    P = m[..., None, None] * p.mu_alpha * F + (load * J - m * p.mu_alpha)[..., None, None] * inverse.swapaxes(2, 3)
    fibres = np.einsum("nqij,nqj->nqi", F, a)
    square = np.sum(fibres**2, axis=2)
    size = 2.0 * stiff * (square - 1.0) - push * contact * J / square
    P += size[..., None, None] * fibres[..., :, None] * a[..., None, :]
    for row, density in enumerate((J, np.sqrt(np.sum(P**2, axis=(2, 3))), alpha * J)):
        np.testing.assert_allclose(seen[row], sums(density), rtol=1e-12)
    below = [[KERNEL["share_below"](level, *corners) for corners in local[:, :, 4]] for level in levels]
    np.testing.assert_allclose(shares, np.array(below) @ np.sum(weights * J, axis=1), rtol=1e-13)


def test_the_share_of_a_triangle_below_a_level() -> None:
    """Known cases, values in any order, and points at random: 200,000 of them are good to 4 standard deviations, 4.5e-3."""
    below = KERNEL["share_below"]
    assert below(0.5, 0.0, 0.0, 1.0) == pytest.approx(0.75)  # all but the half-size triangle at the high corner
    assert below(0.5, 0.0, 1.0, 1.0) == pytest.approx(0.25)
    assert below(1.0, 0.0, 1.0, 2.0) == pytest.approx(0.5)
    assert (below(0.0, 0.0, 0.0, 1.0), below(1.0, 0.0, 1.0, 1.0)) == (0.0, 1.0)
    assert (below(-1.0, 0.0, 0.5, 1.0), below(2.0, 0.0, 0.5, 1.0)) == (0.0, 1.0)
    assert (below(0.4, 0.5, 0.5, 0.5), below(0.5, 0.5, 0.5, 0.5), below(0.6, 0.5, 0.5, 0.5)) == (0.0, 0.0, 1.0)
    assert np.isnan(below(np.nan, 0.0, 0.5, 1.0))
    rng = np.random.default_rng(3)
    bary = rng.dirichlet([1.0, 1.0, 1.0], 200_000)  # uniform on the triangle
    for _ in range(20):
        corners, level = rng.uniform(size=3), rng.uniform()
        share = below(level, *corners)
        assert all(below(level, *corners[list(order)]) == share for order in ((0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)))
        assert share == pytest.approx(np.mean(bary @ corners < level), abs=4.5e-3)
        assert below(-level, *-corners) == pytest.approx(1.0 - share, abs=1e-13)
    assert OUTER + 2 == LOCAL
