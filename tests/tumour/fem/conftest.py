"""What the tests of the elastic tumour in two dimensions share: schemes, and bodies that are moved or numbered anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.fem.scheme import MiniScheme
from tumour.meshes import Body
from tumour.meshes.body import make_body
from tumour.parameters import TumourInitial, TumourParameters
from tumour.presets import find_preset
from tumour.solver import TumourSolver


def make_scheme(
    body: Body | None = None, *, preset: str = "paper", alpha: Any = 0.8, rtol: float = 1e-4, newton_tol: float | None = None,
    linear: str = "superlu", alpha_step: str = "conservative", kind: type[MiniScheme] = MiniScheme, **changes: Any,
) -> MiniScheme:  # fmt: skip
    """A scheme for a preset's values on a body (a quarter disk of 4 rings), with changes by name of parameter."""
    parameters = TumourParameters(**{**find_preset(preset).parameters, **changes})
    solver = TumourSolver(rtol=rtol, newton_tol=newton_tol, linear=linear, alpha_step=alpha_step, method="mini")
    return kind(parameters, TumourInitial(alpha=alpha), meshes.quarter_disk(1.0, 4) if body is None else body, solver)


def changed_body(body: Body, points: np.ndarray, order: np.ndarray | None = None, triangles: np.ndarray | None = None) -> Body:
    """The body with other points; point i of `body` gets the number order[i], and its triangles come in the order `triangles`."""
    order = np.arange(len(points)) if order is None else order
    placed = np.empty_like(points)
    placed[order] = points
    elements = order[body.mesh.t.T]
    if triangles is not None:  # the corners of each begin with another one as well
        elements = np.array([np.roll(elements[n], n) for n in triangles])
    return make_body(
        placed, elements, surface=order[body.surface], slide_x=order[body.slide_x], slide_y=order[body.slide_y], radius=body.radius,
        area=body.area, is_round=body.is_round, path="geometry",
    )  # fmt: skip


@pytest.fixture
def make_mini() -> Callable[..., MiniScheme]:
    return make_scheme


@pytest.fixture
def change_body() -> Callable[..., Body]:
    return changed_body
