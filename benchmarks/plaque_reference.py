"""The plaque's reference problem, its solution by this package's schemes, and its converged answer.

Psi_l = 1, Psi_m = 0.5, k_l = k_m = 2, b = 20, nu_n = nu_m = 1, A = 0.5, B = 1, k = 1, n(x, 0) = 0.1 + 0.05 cos^2(pi xi), l(x, 0) = 0.2,
L(0) = 0.5, to T = 2; interfacial, or drag with p_out = 1. Errors are against 1600 cells at rtol 1e-8.
"""

from __future__ import annotations

import time
from functools import cache
from typing import Any

import numpy as np

from multiphase.stepping import Control, integrate, start
from plaque1d import PlaqueInitial, PlaqueParameters
from plaque1d.lines_scheme import RadauLines
from plaque1d.parameters import PlaqueGeometry

VALUES = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
INITIAL = PlaqueInitial(n="0.1 + 0.05*cos(pi*xi)**2", l=0.2, L=0.5)
FORMS: dict[str, dict[str, Any]] = {"interfacial": {}, "drag": {"momentum": "drag", "p_out": 1.0}}
END = 2.0
FINE = 1600


def problem(form: str) -> PlaqueParameters:
    return PlaqueParameters(**VALUES, **FORMS[form])


def solve(cells: int, rtol: float, form: str = "interfacial", kind: type = RadauLines) -> tuple[Any, Any, float]:
    """Scheme, last state, and wall time of the loop, set-up included."""
    started = time.perf_counter()
    scheme = kind(problem(form), INITIAL, PlaqueGeometry(), cells, rtol)
    control = Control()
    state = integrate(scheme, start(scheme, 0.0, 0.04, control), [END], control)
    return scheme, state, time.perf_counter() - started


@cache
def reference(form: str) -> tuple[Any, float]:
    """n and L of the converged solution."""
    scheme, state, _ = solve(FINE, 1e-8, form)
    return fraction(scheme, state), width(scheme, state)


def fraction(scheme: Any, state: Any) -> Any:
    """Cell averages of n."""
    return state.u[0][scheme.n] / state.u[0][scheme.size]


def width(scheme: Any, state: Any) -> float:
    return float(state.u[0][scheme.size])


def error(n: Any, form: str) -> float:
    """L1 difference of cell averages of n from the converged ones, which are added up to the faces first."""
    fine, _ = reference(form)
    total = np.concatenate([[0.0], np.cumsum(fine) / FINE])
    cells = len(n)
    at = np.interp(np.arange(cells + 1) / cells, np.arange(FINE + 1) / FINE, total)
    return float(np.mean(np.abs(n - cells * np.diff(at))))
