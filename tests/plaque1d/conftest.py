"""The problem that the numerical tests share."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from plaque1d.fipy_scheme import FipyScheme
from plaque1d.parameters import PlaqueInitial, PlaqueParameters

Maker = Callable[..., FipyScheme]


@pytest.fixture
def make_scheme() -> Maker:
    """Make the scheme of the reference problem, with changes by name of parameter or initial value."""

    def make(cells: int = 20, rtol: float = 1e-4, extra_terms: object = None, **changes: object) -> FipyScheme:
        initial = {"n": "0.1 + 0.05*cos(pi*xi)**2", "l": 0.2, "L": 0.5}
        values = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
        for name, value in changes.items():
            (initial if name in initial else values)[name] = value
        return FipyScheme(PlaqueParameters(**values), PlaqueInitial(**initial), cells, rtol, extra_terms)  # type: ignore[arg-type]

    return make
