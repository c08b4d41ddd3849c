"""The bodies that the tests of the elastic tumour share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from multiphase.stepping import Control, Snapshot, State, integrate, start
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.presets import find_preset
from tumour.schemes import ElasticLines, ElasticRadau
from tumour.solver import TumourSolver

KINDS = {1: "slab", 2: "disk", 3: "sphere"}
Maker = Callable[..., Any]


def make_body(
    m: int = 2, cells: int = 50, rtol: float = 1e-4, *, method: str = "radau", preset: str = "paper", alpha: Any = 0.8, radius: float = 1.0,
    alpha_step: str = "conservative", **changes: Any,
) -> Any:  # fmt: skip
    """A scheme for a preset's body, with changes by name of parameter; Radau IIA unless `method` is "lines"."""
    parameters = TumourParameters(**{**find_preset(preset).parameters, **changes})
    geometry = TumourGeometry(kind=KINDS[m], radius=radius)
    solver = TumourSolver(cells=cells, rtol=rtol, alpha_step=alpha_step)
    scheme = ElasticRadau if method == "radau" else ElasticLines
    return scheme(parameters, TumourInitial(alpha=alpha), geometry, solver)


def run_body(scheme: Any, save_at: Sequence[float], **control: Any) -> tuple[State, list[Snapshot]]:
    """The state at the last of `save_at`, and what is stored at each of them."""
    stored: list[Snapshot] = []

    class Keep:
        def on_start(self, state: State, t_end: float) -> None: ...
        def on_step(self, state: State) -> None: ...
        def on_save(self, state: State, snapshot: Snapshot) -> None:
            stored.append(snapshot)

    settings = Control(**control)
    state = integrate(scheme, start(scheme, 0.0, save_at[0] or save_at[-1], settings), list(save_at), settings, [Keep()])
    return state, stored


@pytest.fixture
def make_elastic() -> Maker:
    return make_body


@pytest.fixture
def run_elastic() -> Callable[..., tuple[State, list[Snapshot]]]:
    return run_body
