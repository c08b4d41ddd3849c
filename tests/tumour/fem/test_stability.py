"""The stiffness of a body on a mesh against a sudden change of its shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase.errors import SolverError
from multiphase.stepping import Control, integrate, start
from tumour import meshes
from tumour.boundary import TumourBoundary
from tumour.fem.kernel import KERNEL
from tumour.fem.newton import Step
from tumour.fem.scheme import MiniScheme
from tumour.fem.stability import explain, sliding, stiffness
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver


def grown(scheme: Any, end: float) -> np.ndarray:
    control = Control(order=2)
    u: np.ndarray = integrate(scheme, start(scheme, 0.0, 1.0, control), [end], control).u[0]
    return u


def eigenvalues(scheme: Any, u: np.ndarray) -> np.ndarray:
    """All stiffnesses of a small body that slides on its sides, from the dense inverse."""
    newton, point = scheme.newton, scheme.point(u)
    newton.make(Step(0.0, np.zeros_like(point.nodal), np.zeros_like(point.bubbles), point, scheme.acting), point)
    free = newton.rows.free
    moves = np.flatnonzero(free % 5 < 2)
    root = np.sqrt(scheme.observation.weights)[free[moves] // 5]
    inverse = np.empty((len(moves), len(moves)))
    for k, place in enumerate(moves):
        unit = np.zeros(len(free))
        unit[place] = root[k]
        inverse[:, k] = root * newton.linear.solve(unit)[moves]
    newton.forget()
    values: np.ndarray = 1.0 / np.linalg.eigvalsh(0.5 * (inverse + inverse.T))
    return values


def test_a_disk_is_as_stiff_as_its_quarter(make_mini: Any) -> None:
    """The softest change of a disk at rest is one that its quarter can make too; free bodies have no rigid motion in it. Meshes of 12
    rings, two kinds of sectors: errors of h^2, 1e-3."""
    disk, quarter = (make_mini(body) for body in (meshes.disk(1.0, 12), meshes.quarter_disk(1.0, 12)))
    whole, part = (stiffness(scheme, scheme.initial())[0] for scheme in (disk, quarter))
    assert whole == pytest.approx(part, rel=2e-3)
    coarse = make_mini(meshes.disk(1.0, 6))
    assert stiffness(coarse, coarse.initial())[0] == pytest.approx(whole, rel=1e-2)  # 4 times as much


def test_it_is_the_least_eigenvalue(make_mini: Any) -> None:
    """At rest, and where a disk has become softer but is stable; the operator is not quite symmetric: 1 %."""
    scheme = make_mini(meshes.quarter_disk(1.0, 6))
    for u in (scheme.initial(), grown(scheme, 40.0)):
        values = eigenvalues(scheme, u)
        assert values.min() > 0.0
        assert stiffness(scheme, u)[0] == pytest.approx(values.min(), rel=1e-2)


def test_a_buckled_disk_has_a_negative_one(make_mini: Any) -> None:
    """Though positive ones lie nearer to 0: the one next to 0 of the negative ones, and the words that go with it."""
    scheme = make_mini(meshes.quarter_disk(1.0, 10), mobility="darcy")
    u = grown(scheme, 75.0)
    values = eigenvalues(scheme, u)
    negative = values[values < 0.0]
    assert len(negative) >= 2
    assert stiffness(scheme, u)[0] == pytest.approx(negative.max(), rel=0.05)
    assert "is negative" in explain(scheme, u)
    assert explain(scheme, grown(scheme, 20.0)) == ""


def test_the_tangent_that_was_held_is_held_again(make_mini: Any) -> None:
    """A diagnosis leaves no trace in the run."""
    scheme = make_mini()
    u = grown(scheme, 3.0)
    memory = scheme.newton.memory
    stiffness(scheme, u)
    np.testing.assert_array_equal(scheme.newton.memory, memory)


def test_sliding_is_an_entry_of_the_acoustic_tensor(make_mini: Any) -> None:
    """b N : dP/dF : b N with N = a_0 and b across F a_0, from the kernel's derivatives at each point of a rough state; rounding."""
    tissue = {"fibre_angle": "2*theta", "fibre_ratio": "2 + x", "fibre_stiffness": "0.4 + 0.1*y", "stiffness": "1 + 0.2*x"}
    scheme = make_mini(meshes.disk(1.0, 3), lambda_alpha=0.4, **tissue)
    rng, u = np.random.default_rng(4), scheme.initial()
    point, el, c = scheme.point(u), scheme.elements, scheme.constants
    point.nodal[:, :2] = scheme.mesh.points @ rng.uniform(-0.4, 0.4, (2, 2)) + 0.02 * rng.normal(size=(scheme.count, 2))
    point.nodal[:, 2], point.bubbles[:] = rng.uniform(0.82, 0.9, scheme.count), 0.01 * rng.normal(size=point.bubbles.shape)
    x, e, s, D = np.empty(17), np.empty(11), np.empty(11), np.zeros((11, 11))
    least = np.inf
    for n in range(scheme.triangles):
        KERNEL["gather"](el, point.nodal, point.bubbles, n, x)
        for q, l in enumerate(el.points):
            KERNEL["strain"](x, el.gradients[n], *KERNEL["bubble_gradient"](el.gradients[n], *l), *l, e)
            KERNEL["respond"](c, 6 * n + q, 0.3, e, 0.0, 0.0, s)
            KERNEL["respond_slopes"](c, 6 * n + q, 0.3, e, 0.0, 0.0, s, D)
            a = c.tissue[6 * n + q, 8:10]
            along = e[:4].reshape(2, 2) @ a
            b = np.array([-along[1], along[0]]) / np.hypot(*along)
            least = min(least, np.outer(b, a).ravel() @ D[:4, :4] @ np.outer(b, a).ravel())
    assert sliding(scheme, u)[0] == pytest.approx(least, rel=1e-12)


def test_a_clamped_disk_whose_cells_push_along_fibres_is_told_of_sliding() -> None:
    """With three times the push along fibres mu - 2 alpha Sigma, the resistance at rest, is gone where alpha Sigma = 1/2; else never."""
    held = TumourBoundary.from_table({"all": {"side": "surface", "displacement_x": 0.0, "displacement_y": 0.0}})
    schemes = [
        MiniScheme(
            TumourParameters(fibre_ratio=rho, fibre_angle=0.3, lambda_alpha=0.3), TumourInitial(alpha="0.8 + 0.001*x"), meshes.disk(1.0, 6),
            TumourSolver(method="mini", linear="superlu"), held,
        )
        for rho in (1.0, 3.0)
    ]  # fmt: skip
    plain, pushed = schemes
    grown(plain, 4.0)
    with pytest.raises(SolverError, match=r"layers across the fibres can slide.*smaller fibre_ratio") as caught:
        grown(pushed, 4.0)
    assert caught.value.time is not None
    assert 0.3 < caught.value.time < 1.5
