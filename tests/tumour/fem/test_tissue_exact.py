"""Tissue with directions and parts of the surface against exact solutions: slow and large growth with fibres, strips, pressure."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.boundary import TumourBoundary
from tumour.exact_fibres import FibreGrowth, uniform_fibre_growth
from tumour.exact_parts import pressed_body, pressed_strip, strip_oxygen
from tumour.exact_tissue import UniformTissue
from tumour.fem.scheme import MiniScheme
from tumour.meshes import Body
from tumour.meshes.body import boundary_edges, make_body

Table = dict[str, Any]
SLOW = {"s1": 0.0, "s2": 0.0, "s3": 0.0, "Q": 0.0, "C_out": 1e-6, "mobility": "darcy", "newton_tol": 1e-12}
"""Growth of 1e-6 in the unit of time: what is linear and what is not differ by as much."""


def make(make_mini: Any, body: Body, boundary: Table | None = None, **changes: Any) -> MiniScheme:
    return make_mini(body, kind=partial(MiniScheme, boundary=TumourBoundary.from_table(boundary or {})), **changes)


# -- Growth with fibres --------------------------------------------------------------------------------------------------

TISSUES: dict[str, Table] = {
    "push along": {"fibre_ratio": 3.0, "fibre_angle": 0.5},
    "push across": {"fibre_ratio": 0.2, "fibre_angle": 0.5},
    "stiff": {"fibre_ratio": 2.0, "fibre_angle": -0.8, "fibre_stiffness": 0.5, "stiffness": 1.5, "lambda_alpha": 0.4},
    "tensor": {"fibre_ratio": 2.0, "fibre_angle": 1.1, "permeability": {"xx": 2.0, "yy": 0.6, "xy": 0.5}},
}


def slopes_of(points: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The gradient of the linear displacement that is nearest to one at points."""
    return np.linalg.lstsq(points - points[0], d - d[0], rcond=None)[0].T


def elongation(tissue: UniformTissue, points: np.ndarray, d: np.ndarray) -> float:
    """Mean strain along the fibres less that across them, of a displacement at points."""
    along, across = tissue.direction, np.array([-tissue.direction[1], tissue.direction[0]])
    slopes = slopes_of(points, d)
    return float(along @ slopes @ along - across @ slopes @ across)


@pytest.mark.parametrize("tissue", TISSUES)
def test_slow_growth_where_fluid_flows_freely(make_mini: Any, run_elastic: Any, tissue: str) -> None:
    """Uniform strains, which any mesh has exactly: to what is not linear, 1e-5 of it with G alpha_star = 16."""
    scheme = make(make_mini, meshes.disk(1.0, 3), kappa=0.0, **SLOW, **TISSUES[tissue])
    (stored,) = run_elastic(scheme, [1.0], dt=0.25)[1]
    growth, points = FibreGrowth(scheme.parameters), scheme.mesh.points
    d = growth.displacement(*points.T, 1.0).T
    np.testing.assert_allclose(stored.fields["displacement"], d, atol=1e-4 * np.abs(d).max())
    assert elongation(growth.tissue, points, stored.fields["displacement"]) * (growth.tissue.rho - 1.0) > 0.0


@pytest.mark.parametrize("tissue", TISSUES)
def test_slow_growth_with_its_fluid(make_mini: Any, run_elastic: Any, tissue: str) -> None:
    """At late times: p, and d over what the fluid makes of it, of second order, and the elongation to 1 %. The disk's mesh is a polygon,
    whose area is 1.2 % less with 6 rings and 0.3 % with 12."""
    errors = []
    for rings in (6, 12):
        scheme = make(make_mini, meshes.disk(1.0, rings), **SLOW, **TISSUES[tissue])
        (stored,) = run_elastic(scheme, [2.0], dt=0.1)[1]
        growth, points, weights = FibreGrowth(scheme.parameters), scheme.mesh.points, scheme.observation.weights
        d, p = growth.displacement(*points.T, 2.0).T, growth.pressure(*points.T, 2.0)
        late = growth.displacement(*points.T, 0.0).T  # what the fluid makes of it, and a uniform strain that it slows
        gap = np.sum((stored.fields["displacement"] - d) ** 2, axis=1)
        a, change = stored.fields["alpha"] - 0.8, growth.fraction_change(*points.T, 2.0)
        sizes = np.sum(late**2, axis=1), p**2, (change - weights @ change / np.sum(weights)) ** 2
        gaps = gap, (stored.fields["p"] - p) ** 2, (a - change) ** 2
        errors.append([np.sqrt(weights @ one / (weights @ size)) for one, size in zip(gaps, sizes, strict=True)])
        wanted = elongation(growth.tissue, points, d)
        assert elongation(growth.tissue, points, stored.fields["displacement"]) == pytest.approx(wanted, rel=0.01)
    orders = np.log2(np.divide(*errors))
    assert np.all(orders > [1.9, 1.9, 0.9])  # alpha follows from J, a derivative of d
    assert np.all(np.array(errors[1]) < [6e-3, 1e-3, 6e-2])


@pytest.mark.parametrize("tissue", ["push along", "push across", "stiff"])
def test_uniform_growth_with_fibres(make_mini: Any, run_elastic: Any, tissue: str) -> None:
    """In a body of any shape: uniform to rounding, and the exact solution to the error in time, of second order in dt."""
    times, errors = [1.0, 4.0], []
    for dt in (0.1, 0.05):
        scheme = make(make_mini, meshes.glioma(0.4, 0.15), kappa=0.0, Q=0.0, newton_tol=1e-12, **TISSUES[tissue])
        stored = run_elastic(scheme, times, dt=dt)[1]
        along, across, alpha = uniform_fibre_growth(times, scheme.parameters)
        a = UniformTissue(scheme.parameters).direction
        for n, s in enumerate(stored):
            F = np.eye(2) + slopes_of(scheme.mesh.points, s.fields["displacement"])
            along_now, across_now = F @ a, F @ [-a[1], a[0]]  # the body may have turned
            assert np.ptp(s.fields["J"]) < 1e-10
            assert abs(along_now @ across_now) < 1e-10
            found = [np.linalg.norm(along_now), np.linalg.norm(across_now), s.fields["alpha"].mean()]
            errors.append(np.array(found) - [along[n], across[n], alpha[n]])
    errors = np.abs(errors).reshape(2, 2, 3)
    assert np.all(errors[1] < 2e-3)
    assert np.all(np.log2(errors[0] / errors[1])[errors[1] > 1e-6] > 1.7)


# -- Strips and pressure -------------------------------------------------------------------------------------------------

L = 1.5


def strip(n: int) -> Body:
    """A rectangle of the length L and the width 0.5, held in x on the left, sliding along its long sides, with "right" as its surface;
    its triangles are not regular."""
    x, y = np.meshgrid(np.linspace(0.0, L, 3 * n + 1), np.linspace(0.0, 0.5, n + 1), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    inside = (x > 0.0) & (x < L) & (y > 0.0) & (y < 0.5)
    shift = 0.2 * 0.5 / n * np.random.default_rng(1).uniform(-1.0, 1.0, (2, *x.shape)) * inside
    points = np.column_stack([(x + shift[0]).ravel(), (y + shift[1]).ravel()])
    edges, x = boundary_edges(triangles), points[:, 0]
    return make_body(
        points, triangles, surface=np.flatnonzero(x == L), slide_x=np.flatnonzero(x == 0.0), radius=0.5, path="geometry",
        slide_y=np.flatnonzero((points[:, 1] == 0.0) | (points[:, 1] == 0.5)), sides={"right": edges[(x[edges] == L).all(axis=1)]},
    )  # fmt: skip


STILL = {"kappa": 0.0, "lambda_alpha": 0.5, "alpha": 0.78, "alpha_min": 0.7, "newton_tol": 1e-12, "Q1_hat": 0.0}
OXYGEN: dict[str, tuple[Table, Table]] = {
    "open": ({}, {}),
    "membrane": ({"membrane": 0.8}, {"membrane": 0.8}),
    "influx": ({"C": "closed", "influx": 0.3}, {"influx": 0.3}),
}


@pytest.mark.parametrize("case", OXYGEN)
@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi])
def test_a_pressed_strip_and_its_oxygen(make_mini: Any, angle: float, case: str) -> None:
    """At t = 0: uniform and exact to what Newton's method leaves, whatever presses; oxygen to the second order."""
    part, of = OXYGEN[case]
    tissue = {"fibre_ratio": 2.0, "fibre_stiffness": 0.4, "fibre_angle": angle, "stiffness": 1.3, "Q": 2.0, "consumption": 1.4}
    acting = {"traction_x": -0.3, "load": 0.4, "spring": 0.6, "spring_normal": 0.5}
    errors = []
    for n in (3, 6, 12):
        scheme = make(
            make_mini, strip(n), {"end": {"side": "right", **acting, **part}}, diffusivity={"along": 0.6, "across": 2.5}, **STILL, **tissue
        )
        nodal = scheme.point(scheme.initial()).nodal
        l, alpha = pressed_strip(scheme.parameters, 0.78, traction=-0.3, load=0.4, spring=1.1, length=L)
        x = scheme.mesh.points[:, 0]
        np.testing.assert_allclose(nodal[:, :3], np.column_stack([(l - 1.0) * x, 0.0 * x, 0.0 * x + alpha]), atol=1e-10)
        C = strip_oxygen(x, L, alpha, scheme.parameters, stretch=l, **of)
        weights = scheme.observation.weights
        errors.append(np.sqrt(weights @ (nodal[:, 4] - C) ** 2 / (weights @ C**2)))
    assert abs(l - 1.0) > 0.02
    assert np.ptp(C) > 0.5 * C.max()
    assert errors[2] < 2e-3
    assert 0.5 * np.log2(errors[0] / errors[2]) > 1.85


def test_a_body_under_pressure(make_mini: Any) -> None:
    """Of any shape: uniform to what Newton's method leaves."""
    scheme = make(make_mini, meshes.glioma(1.0, 0.3), {"all": {"side": "surface", "load": 0.9}}, stiffness=1.3, **STILL)
    nodal = scheme.point(scheme.initial()).nodal
    l, alpha = pressed_body(scheme.parameters, 0.78, 0.9)
    middle = scheme.observation.weights @ scheme.mesh.points / np.sum(scheme.observation.weights)
    assert l < 0.98
    np.testing.assert_allclose(nodal[:, :2], (l - 1.0) * (scheme.mesh.points - middle), atol=1e-10)
    np.testing.assert_allclose(nodal[:, 2], alpha, atol=1e-10)


def test_oxygen_that_nobody_takes_up_crosses_the_body_obliquely(make_mini: Any) -> None:
    """With a full tensor D and C growing along x alone, oxygen flows in and out of all sides: linear elements have that exactly, also in a
    body that a load has shrunk to l, where a gradient at rest makes the flow D grad C/l per length now."""
    n, D, slope = 4, np.array([[1.4, 0.5], [0.5, 0.8]]), 0.6
    mesh = strip(n).mesh
    points, edges = mesh.p.T, boundary_edges(mesh.t.T)
    middles = points[edges].mean(axis=1)
    sides = {"right": middles[:, 0] == L, "left": middles[:, 0] == 0.0, "low": middles[:, 1] == 0.0, "high": middles[:, 1] == 0.5}
    body = make_body(
        points, mesh.t.T, surface=np.unique(edges), radius=0.5, sides={k: edges[at] for k, at in sides.items()}, path="geometry"
    )
    tissue: Table = {"diffusivity": {"xx": D[0, 0], "yy": D[1, 1], "xy": D[0, 1]}, "Q": 0.0, "stiffness": 1.0}
    for load in (0.0, 0.9):
        l = pressed_body(make(make_mini, strip(1), **STILL, **tissue).parameters, 0.78, load)[0]
        normals = {"left": (-1.0, 0.0), "low": (0.0, -1.0), "high": (0.0, 1.0)}
        parts: Table = {k: {"side": k, "C": "closed", "influx": float(D[0] @ N) * slope / l, "load": load} for k, N in normals.items()}
        parts = {"right": {"side": "right", "C": 1.3, "load": load}, **parts}
        scheme = make(make_mini, body, parts, **STILL, **tissue)
        C = scheme.point(scheme.initial()).nodal[:, 4]
        np.testing.assert_allclose(C, 1.3 + slope * (points[:, 0] - L), atol=1e-10)
