"""The stiffness of a body on a mesh against a sudden change of its shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase.stepping import Control, integrate, start
from tumour import meshes
from tumour.fem.newton import Step
from tumour.fem.stability import explain, stiffness


def grown(scheme: Any, end: float) -> np.ndarray:
    control = Control(order=2)
    u: np.ndarray = integrate(scheme, start(scheme, 0.0, 1.0, control), [end], control).u[0]
    return u


def eigenvalues(scheme: Any, u: np.ndarray) -> np.ndarray:
    """All stiffnesses of a small body that slides on its sides, from the dense inverse."""
    newton, point = scheme.newton, scheme.point(u)
    newton.make(Step(0.0, np.zeros_like(point.nodal), np.zeros_like(point.bubbles), point), point)
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
