"""The problem that the numerical tests share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from plaque1d.fipy_scheme import FipyScheme
from plaque1d.lines_scheme import LinesScheme, RadauLines
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters

SCHEMES = {"fipy": FipyScheme, "lines": LinesScheme, "radau": RadauLines}
Maker = Callable[..., Any]


def make(
    kind: str, cells: int = 20, rtol: float = 1e-4, extra_terms: object = None, lumen_radius: float | None = None, **changes: object
) -> Any:
    """Make a scheme of the reference problem, with changes by name of parameter or initial value; in an annulus if it has a radius."""
    initial = {"n": "0.1 + 0.05*cos(pi*xi)**2", "l": 0.2, "L": 0.5}
    values = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
    for name, value in changes.items():
        (initial if name in initial else values)[name] = value
    geometry = PlaqueGeometry(kind="annulus" if lumen_radius else "slab", lumen_radius=lumen_radius)
    more = {"extra_terms": extra_terms} if kind == "fipy" else {}
    return SCHEMES[kind](PlaqueParameters(**values), PlaqueInitial(**initial), geometry, cells, rtol, **more)  # type: ignore[arg-type]


@pytest.fixture
def make_scheme() -> Maker:
    """The scheme assembled by FiPy."""
    return lambda *arguments, **changes: make("fipy", *arguments, **changes)


@pytest.fixture
def make_lines() -> Maker:
    """The compiled method of lines, with Radau IIA unless `kind` says "lines"."""
    return lambda *arguments, kind="radau", **changes: make(kind, *arguments, **changes)
