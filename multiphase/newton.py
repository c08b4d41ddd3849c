r"""Newton's method for one implicit step of ``M y' = f(t, y)`` with banded, bordered tangents, compiled; and what it works with.

A model brings six compiled functions:

    rates(data, t, y, out, work)                           f; y is [band unknowns, border unknowns, integrals]
    tangent(data, t, y, f, jac, columns, rows, corner, q_rows, q_corner, work, scratch)
                                                           scratch is like y; it holds where the step is expected to end, for laws with a
                                                           kink, and may be overwritten
    size_of(data, y, e)                                    norm of a change e of y in units of the tolerance
    admit(data, y, work)                                   brings y into its bounds; 0, or the number of the bound it breaks
    project(data, y, f, jac)                               brings the algebraic part of y onto its equations; whether it was far off
    reach(data, y, change)                                 share of a Newton change that keeps y where f is defined; 0 if none does

M is a diagonal of ones and zeros, and y is [band unknowns, border unknowns, integrals]. Integrals are unknowns on which nothing depends:
they cost one product each.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from multiphase.banded import factor_bordered, solve_bordered
from multiphase.compiled import compiled

Array = Any

MODEL = ("rates", "tangent", "size_of", "admit", "project", "reach")
"""What a model brings."""
DONE, GOING_ON, DIVERGED, SINGULAR, INEXACT, OUT_OF_BOUNDS = range(6)
"""What became of a step, or a stretch of steps: its end, an interim return, or the reason of the last rejection."""


class Work(NamedTuple):
    """Work space of one run, allocated once; sizes in unknowns."""

    model: Array
    f_0: Array
    jac: Array
    columns: Array
    rows: Array
    corner: Array
    q_rows: Array
    q_corner: Array
    band: Array
    pivots: Array
    real_columns: Array
    real_rows: Array
    real_corner: Array
    complex_band: Array
    complex_pivots: Array
    complex_columns: Array
    complex_rows: Array
    complex_corner: Array
    complex_vector: Array
    stages: Array
    transformed: Array
    changes: Array
    vector: Array
    scratch: Array


def workspace(size: int, half: int, border: int, integrals: int, model: Array) -> Work:
    """Arrays for `size` unknowns in a band of half-width `half`."""
    total = size + border + integrals

    def zeros(*shape: int, kind: type = float) -> Array:
        return np.zeros(shape, dtype=kind)

    return Work(
        model=model,
        f_0=zeros(total),
        jac=zeros(size, 2 * half + 1),
        columns=zeros(border, size),
        rows=zeros(border, size),
        corner=zeros(border, border),
        q_rows=zeros(integrals, size),
        q_corner=zeros(integrals, border),
        band=zeros(size, 3 * half + 1),
        pivots=zeros(2, size, kind=np.int64),
        real_columns=zeros(border, size),
        real_rows=zeros(border, size),
        real_corner=zeros(border, border),
        complex_band=zeros(size, 3 * half + 1, kind=complex),
        complex_pivots=zeros(2, size, kind=np.int64),
        complex_columns=zeros(border, size, kind=complex),
        complex_rows=zeros(border, size, kind=complex),
        complex_corner=zeros(border, border, kind=complex),
        complex_vector=zeros(total, kind=complex),
        stages=zeros(3, total),
        transformed=zeros(3, total),
        changes=zeros(3, total),
        vector=zeros(total),
        scratch=zeros(total),
    )


def of_the_model(*arguments: Any) -> Any:
    """In the place of a model's function, until `build` puts that there."""
    raise TypeError("this works for a model only: take what build() returns")


rates = tangent = size_of = admit = reach = of_the_model


def shifted(factor: Any, mass: Array, jac: Array, columns: Array, rows: Array, corner: Array, band: Array, pivots: Array,
            out_columns: Array, out_rows: Array, out_corner: Array) -> bool:  # fmt: skip
    """Factors of ``factor M - J``."""
    size, width = jac.shape
    half = (width - 1) // 2
    border = columns.shape[0]
    for i in range(size):
        for j in range(width):
            band[i, j] = -jac[i, j]
        for j in range(width, 3 * half + 1):
            band[i, j] = 0.0
        band[i, half] += factor * mass[i]
    for a in range(border):
        for i in range(size):
            out_columns[a, i] = -columns[a, i]
            out_rows[a, i] = -rows[a, i]
        for b in range(border):
            out_corner[a, b] = -corner[a, b]
        out_corner[a, a] += factor * mass[size + a]
    ok: bool = factor_bordered(band, half, pivots, out_columns, out_rows, out_corner)
    return ok


def resolve(factor: Any, band: Array, pivots: Array, columns: Array, rows: Array, corner: Array, q_rows: Array, q_corner: Array,
            x: Array) -> None:  # fmt: skip
    """Solve with the factors of `shifted`; the integrals follow from the rest."""
    border, size = columns.shape
    half = (band.shape[1] - 1) // 3
    solve_bordered(band, half, pivots, columns, rows, corner, x)
    for a in range(q_rows.shape[0]):
        value = x[size + border + a]
        for i in range(size):
            value += q_rows[a, i] * x[i]
        for b in range(border):
            value += q_corner[a, b] * x[size + b]
        x[size + border + a] = value / factor


def newton_step(
    d: Any, mass: Any, t: float, alpha: float, past: Any, y: Any, tolerance: float, most: int, w: Any
) -> tuple[int, int, float]:
    """Solve ``M (alpha (y - past)) = f(t, y)`` by Newton's method from `y`, which is overwritten; the integrals advance by the same
    formula, so balances hold after each iteration.

    Returns the code, the iterations, and the last change in units of the tolerated error.
    """
    total, rest = y.size, mass.size
    change, last = 0.0, 0.0
    for iteration in range(1, most + 1):
        rates(d, t, y, w.f_0, w.model)
        w.scratch[:] = y
        tangent(d, t, y, w.f_0, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
        if not shifted(alpha, mass, w.jac, w.columns, w.rows, w.corner, w.band, w.pivots, w.real_columns, w.real_rows, w.real_corner):
            return SINGULAR, iteration, change
        for k in range(total):
            mass_k = mass[k] if k < rest else 1.0
            w.vector[k] = w.f_0[k] - mass_k * alpha * (y[k] - past[k])
        resolve(alpha, w.band, w.pivots, w.real_columns, w.real_rows, w.real_corner, w.q_rows, w.q_corner, w.vector)
        change = size_of(d, y, w.vector)
        if not np.isfinite(change):
            return DIVERGED, iteration, change
        share = reach(d, y, w.vector)
        for k in range(total):
            y[k] += (share if share > 0.0 else 1.0) * w.vector[k]
        if share == 0.0:
            broken = admit(d, y, w.model)
            return (OUT_OF_BOUNDS, iteration, float(broken)) if broken else (DIVERGED, iteration, change)
        rate = change / last if last > 0.0 else 1.0
        if change * min(1.0, rate) <= tolerance and share == 1.0:
            broken = admit(d, y, w.model)
            return (OUT_OF_BOUNDS, iteration, float(broken)) if broken else (DONE, iteration, change)
        if iteration > 2 and rate > 2.0 and share == 1.0:
            return DIVERGED, iteration, change
        last = change
    return DIVERGED, most, change


def build(functions: Mapping[str, Any], keep: str) -> Any:
    """`newton_step` compiled for one model from its functions; `keep` is the fingerprint of the files they come from."""
    own = {name: functions[name] for name in MODEL}
    own["shifted"] = compiled(shifted)
    own["resolve"] = compiled(resolve)
    return compiled(newton_step, keep=keep, **own)
