"""Small made-up models for the compiled integrators, which are run as the plain Python that they are written in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from multiphase import banded, compiled, lines, newton, radau, trbdf2

TINY = 1e-30


def plain(function: Any, *, keep: str = "", **names: Any) -> Any:
    """In the place of `multiphase.compiled.compiled`: the same copy, not compiled."""
    function = getattr(function, "py_func", function)
    return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__)


class Model:
    """``M y' = f(t, y)``; f takes complex y, too, whose imaginary part gives the tangent to rounding.

    Attributes
    ----------
    counted : sequence of float
        What changes are multiplied with in `size_of`, the largest of them in units of `tolerance`; without algebraic unknowns if not given.
    bound : callable
        ``bound(y)``, what `admit` returns.
    inside : callable
        ``inside(y)``, whether f is defined; `reach` takes the change, half of it, a quarter, ... , 1/1024 or none.
    """

    def __init__(
        self,
        f: Callable[[float, Any], Any],
        mass: Sequence[float],
        *,
        half: int = 1,
        border: int = 0,
        integrals: int = 0,
        tolerance: float = 1e-6,
        counted: Sequence[float] | None = None,
        bound: Callable[[Any], int] = lambda y: 0,
        inside: Callable[[Any], bool] = lambda y: True,
        slopes: Callable[[float, Any], Any] | None = None,
    ) -> None:
        self.f, self.mass, self.half, self.border, self.integrals = f, np.array(mass, dtype=float), half, border, integrals
        self.size = len(mass) - border
        self.total = len(mass) + integrals
        self.weights = np.append(self.mass, np.ones(integrals))
        self.counted = self.weights if counted is None else np.array(counted)
        self.tolerance, self.bound, self.inside, self.slopes = tolerance, bound, inside, slopes or self.by_complex_step
        self.work = newton.workspace(self.size, half, border, integrals, np.zeros(1))
        self.shares: list[float] = []
        self.sizes: list[float] = []

    def by_complex_step(self, t: float, y: Any) -> Any:
        moved = y + 1j * TINY * np.eye(len(y))
        return np.array([np.imag(self.f(t, row)) for row in moved]).T / TINY


def rates(d: Model, t: float, y: Any, out: Any, work: Any) -> None:
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        out[:] = d.f(t, y)


def tangent(d: Model, t: float, y: Any, f: Any, jac: Any, columns: Any, rows: Any, corner: Any, q_rows: Any, q_corner: Any, work: Any,
            scratch: Any) -> None:  # fmt: skip
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        full = d.slopes(t, y)
    n, m = d.size, len(d.mass)
    for i in range(n):
        for j in range(n):
            if abs(i - j) <= d.half:
                jac[i, j - i + d.half] = full[i, j]
            else:
                assert full[i, j] == 0.0
    columns[:], rows[:], corner[:] = full[:n, n:m].T, full[n:m, :n], full[n:m, n:m]
    q_rows[:], q_corner[:] = full[m:, :n], full[m:, n:m]
    scratch[:] = np.nan  # may be overwritten


def size_of(d: Model, y: Any, e: Any) -> float:
    d.sizes.append(float(np.max(d.counted * np.abs(e))) / d.tolerance)
    return d.sizes[-1]


def admit(d: Model, y: Any, work: Any) -> int:
    return d.bound(y)


def project(d: Model, y: Any, f: Any, jac: Any) -> bool:
    """By Newton's method with the tangent anew in every iteration."""
    algebraic = np.flatnonzero(d.weights == 0.0)
    moved = 0.0
    for _ in range(20 if len(algebraic) else 0):
        change = -np.linalg.solve(d.slopes(0.0, y)[np.ix_(algebraic, algebraic)], d.f(0.0, y)[algebraic])
        y[algebraic] += change
        moved = max(moved, float(np.abs(change).max()))
        if np.abs(change).max() < 1e-14:
            break
    f[algebraic] = 0.0
    return moved > 1e-3


def reach(d: Model, y: Any, change: Any) -> float:
    share = 1.0
    while share > 1e-3 and not d.inside(y + share * change):
        share *= 0.5
    d.shares.append(share if share > 1e-3 else 0.0)
    return d.shares[-1]


def record(d: Model, t: float, y: Any, slope: Any, start: Any, fields: Any, scalars: Any) -> None:
    fields[0] = y
    fields[1] = slope if len(slope) else np.nan


FUNCTIONS = {
    "rates": rates, "tangent": tangent, "size_of": size_of, "admit": admit, "project": project, "reach": reach, "record": record,
}  # fmt: skip


class Body(lines.Radau):
    """A model under the common loop; a snapshot's field "y" holds the vector, its positions the derivative."""

    fields = ("y",)
    scalars = ()
    bounds = {1: "beyond the first bound", 2: "beyond the second bound"}  # noqa: RUF012

    def __init__(self, kernel: Any, model: Model, initial: Any, kinks: tuple[float, ...] = ()) -> None:
        self.kernel, self.model, self.mass, self.work, self.kinks = kernel, model, model.mass, model.work, kinks
        self.cells, self.rtol, self.start = model.total, model.tolerance, np.zeros(0)
        self._initial = np.array(initial, dtype=float)

    def data(self, t: float) -> Any:
        return self.model


@pytest.fixture(scope="session")
def integrators() -> Any:
    """`newton_step`, `two_stages` and a kernel with `advance`, plain Python all of them; `Model` and `Body` to run."""
    flat: dict[str, Any] = {}
    for name in ("factor", "solve", "invert", "factor_bordered", "solve_bordered"):
        flat[name] = plain(getattr(banded, name), **flat)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(newton, "factor_bordered", flat["factor_bordered"])
        patch.setattr(newton, "solve_bordered", flat["solve_bordered"])
        for module in (compiled, newton, radau):
            patch.setattr(module, "compiled", plain)
        kernel: Any = lines.Kernel(**FUNCTIONS)
        step, stages = (
            kernel.newton_step,
            plain(trbdf2.two_stages, **FUNCTIONS, resolve=plain(newton.resolve), newton_step=kernel.newton_step),
        )
        _ = kernel.advance, kernel.record_all, [kernel[name] for name in FUNCTIONS]
    # The patch ends here: what other tests compile while the session goes on is compiled.
    return SimpleNamespace(
        newton_step=step, two_stages=stages, kernel=kernel, Model=Model, Body=partial(Body, kernel), plain=plain, functions=FUNCTIONS
    )
