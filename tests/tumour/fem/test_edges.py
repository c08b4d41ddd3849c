"""What acts on the edges of the surface, compiled: against the weak form as written down, its tangent against differences, and forces that
are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.boundary import TumourBoundary
from tumour.fem import layout
from tumour.fem.arrays import ACTIONS, FIELDS, KEPT
from tumour.fem.forms import Forms
from tumour.fem.kernel import KERNEL
from tumour.fem.surface import Surface
from tumour.parameters import TumourParameters

PARTS: dict[str, dict[str, Any]] = {
    "bone": {"where": "x > 0.3", "spring": 1.7, "spring_normal": 0.6, "traction_x": 0.4, "traction_y": -0.9},
    "wall": {"where": "x < -0.4", "load": 0.8, "C": "closed", "influx": 0.5, "spring": 0.1},
    "skin": {"where": "(x > -0.35)*(x < 0.25)", "C": 0.7, "membrane": 2.5},
}
"""Every action that there is."""


def surface() -> tuple[Any, Surface]:
    body = meshes.glioma(0.8, 0.2)
    return body, Surface(body, TumourBoundary.from_table(PARTS), TumourParameters())


def state(body: Any, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A rough state at random that turns over no triangle."""
    rng = np.random.default_rng(seed)
    nodal = rng.uniform(0.2, 0.9, (body.mesh.nvertices, FIELDS))
    nodal[:, :2] = body.mesh.p.T @ rng.uniform(-0.3, 0.4, (2, 2)) + 0.01 * rng.normal(size=(body.mesh.nvertices, 2))
    return nodal, 0.01 * rng.uniform(-1.0, 1.0, (body.mesh.nelements, 2))


def of_edges(body: Any, on: Surface, nodal: np.ndarray) -> np.ndarray:
    R = np.zeros_like(nodal)
    KERNEL["add_edges"](layout.elements_of(body.mesh), on.edges, on.actions(0.0), nodal, R)
    return R


def test_two_statements_of_the_edges() -> None:
    """The compiled sums and scikit-fem's on facets, of a rough state with bubbles: rounding of some ten terms of size 1, but for the
    membrane, where the length of an edge now is a square root: 1e-13 all the same."""
    body, on = surface()
    written = Forms(body.mesh, TumourParameters(), None, on.edges)
    for seed in (1, 2):
        nodal, bubbles = state(body, seed)
        with_edges, without = (written.element_residuals(nodal, bubbles, 0.3, None, acting) for acting in (on.actions(0.0), None))
        expected, inner = written.assemble(with_edges - without)
        found = of_edges(body, on, nodal)
        assert np.abs(inner).max() < 1e-12  # nothing acts on a bubble
        for column in (0, 1, 4):
            assert np.abs(found[:, column]).max() > 0.05
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_tangent_of_the_edges_is_the_derivative_of_their_residual() -> None:
    """Central differences with the step 1e-6 of terms that are smooth and of size 1: 1e-12 from the third derivative (the length of an edge
    of 0.2: 1/0.2^2), 1e-10 from rounding; 1e-7 is asked for."""
    body, on = surface()
    el = layout.elements_of(body.mesh)
    nodal, _ = state(body, 3)
    rows = layout.rows_of(el, np.zeros(nodal.shape, dtype=bool))
    values = np.zeros(len(rows.indices))
    KERNEL["add_edge_slopes"](el, on.edges, on.actions(0.0), nodal, rows.pattern, np.empty((17, 17)), values)
    size = nodal.size
    K = np.zeros((size, size))
    for i in range(size):
        at = slice(rows.indptr[i], rows.indptr[i + 1])
        K[i, rows.indices[at]] = values[at]
    for j in np.flatnonzero(np.abs(K).max(axis=0)):
        step = np.zeros(size)
        step[j] = 1e-6
        up, down = (of_edges(body, on, nodal + sign * step.reshape(nodal.shape)).ravel() for sign in (1.0, -1.0))
        assert np.abs((up - down) / 2e-6 - K[:, j]).max() < 1e-7 * np.abs(K).max()
    numeric = of_edges(body, on, nodal + 1e-3) - of_edges(body, on, nodal)  # no column is missed: all unknowns at once, to second order
    assert np.abs(numeric.ravel() - K @ np.full(size, 1e-3)).max() < 1e-5


def test_forces_that_are_known() -> None:
    """A load all round adds up to no force and no moment about the body as it is; on a uniformly stretched body it is load times length
    times normal; a dead traction adds up to traction times length at rest."""
    body = meshes.disk(1.0, 8)
    x = body.mesh.p.T
    el, nodal = layout.elements_of(body.mesh), np.zeros((len(x), FIELDS))
    nodal[:, :2] = x @ np.array([[0.6, 0.1], [-0.2, 0.3]]) + 0.02 * np.random.default_rng(1).normal(size=x.shape)

    def force(**part: Any) -> np.ndarray:
        on = Surface(body, TumourBoundary.from_table({"all": {"side": "surface", **part}}), TumourParameters())
        R = np.zeros_like(nodal)
        KERNEL["add_edges"](el, on.edges, on.actions(0.0), nodal, R)
        return -R[:, :2]

    f, now = force(load=0.7), x + nodal[:, :2]
    assert np.abs(f.sum(axis=0)).max() < 1e-14
    assert abs(np.sum(now[:, 0] * f[:, 1] - now[:, 1] * f[:, 0])) < 1e-14
    ends = now[body.edges]
    area = 0.5 * np.sum(ends[:, 0, 0] * ends[:, 1, 1] - ends[:, 0, 1] * ends[:, 1, 0])
    assert np.sum(f * now) == pytest.approx(-0.7 * 2.0 * area, rel=1e-13)  # the load's power against uniform growth is -load d(area)
    length = np.sum(np.hypot(*(x[body.edges[:, 1]] - x[body.edges[:, 0]]).T))
    dead = force(traction_x=0.4, traction_y=-0.1, spring=1e-300)
    np.testing.assert_allclose(dead.sum(axis=0), [0.4 * length, -0.1 * length], rtol=1e-13)


def test_residual_and_tangent_add_the_same_edges() -> None:
    body, on = surface()
    el, (nodal, bubbles) = layout.elements_of(body.mesh), state(body, 4)
    from tumour.fem.tissue import data_of

    c = data_of(TumourParameters(), el, body.mesh.p.T, body.radius)
    rows = layout.rows_of(el, np.zeros(nodal.shape, dtype=bool))
    zero = np.zeros_like(nodal), np.zeros_like(bubbles)
    found = []
    for edges, actions in ((on.edges, on.actions(0.0)), (layout.no_edges(), np.zeros((0, ACTIONS)))):
        kept, R, r, other = np.zeros((len(bubbles), KEPT)), np.empty_like(nodal), np.empty_like(bubbles), np.empty_like(nodal)
        step = c, el, 0.3, nodal, bubbles, *zero, *zero, edges, actions
        assert KERNEL["tangent"](*step, rows.pattern, np.empty(len(rows.indices)), kept, R, r) == -1
        assert KERNEL["residual"](*step, kept, other, r) == -1
        np.testing.assert_allclose(R, other, atol=1e-13)  # rounding
        found.append(R)
    np.testing.assert_allclose(found[0] - found[1], of_edges(body, on, nodal), atol=1e-12)  # what is added is that
