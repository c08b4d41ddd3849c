r"""Radau IIA of order five for ``M y' = f(t, y)`` with banded, bordered tangents, compiled.

The collocation method with three stages c = (4 - sqrt 6)/10, (4 + sqrt 6)/10, 1 (Hairer & Wanner, Solving Ordinary Differential
Equations II, sections IV.5 and IV.8): L-stable, of order five in the differential and the algebraic unknowns of index one, with the
last stage as the new value, so that every step ends on the algebraic equations. M is a diagonal of ones and zeros. With
``Z_i = Y_i - y`` and ``W = T^-1 Z``, T the real form of the eigenvectors of the inverse of the coefficient matrix, simplified
Newton splits each iteration into one real and one complex system,

    (mu M/h - J) dW_1 = (T^-1 F)_1 - mu M W_1/h,      (lambda M/h - J) dW_23 = (T^-1 F)_23 - lambda M W_23/h

so any linear invariant of f holds after each iteration, whatever its error, as long as J has it too. The local error is the
difference to an embedded formula of order three, ``(mu M/h - J)^-1 (f(t, y) + M (e . Z)/h)``; between steps the
collocation polynomial through y and the three stages gives the solution, to the order of that estimate.

A model brings the compiled functions of `multiphase.newton`. Algebraic unknowns do not enter the norm, and small steps reveal nothing of
them, so every step begins by projecting them.

One tangent serves all iterations of a step. Where a law has a kink and the body is stiff on one side of it, that fails at any usable
step, and TR-BDF2 (`multiphase.trbdf2`), which takes the tangent anew in every iteration, takes the step instead, and the next few. Where
the error is not controlled the step is halved first.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from multiphase import newton, trbdf2
from multiphase.compiled import compiled
from multiphase.newton import DIVERGED, DONE, GOING_ON, INEXACT, MODEL, OUT_OF_BOUNDS, SINGULAR, Work, of_the_model
from multiphase.stepping import landing

Array = Any

_ROOT = np.sqrt(6.0)
NODES = np.array([(4.0 - _ROOT) / 10.0, (4.0 + _ROOT) / 10.0, 1.0])
ERROR_WEIGHTS = np.array([-13.0 - 7.0 * _ROOT, -13.0 + 7.0 * _ROOT, -1.0]) / 3.0


def _transformation() -> tuple[float, complex, Array, Array]:
    """Eigenvalues mu and lambda of the inverse coefficient matrix, T and its inverse."""
    powers = NODES[:, None] ** np.arange(3)
    inverse = np.linalg.inv((NODES[:, None] ** np.arange(1, 4) / np.arange(1, 4)) @ np.linalg.inv(powers))
    values, vectors = np.linalg.eig(inverse)
    real = int(np.argmin(np.abs(values.imag)))
    pair = int(np.argmax(values.imag))
    T = np.column_stack([vectors[:, real].real / vectors[2, real].real, vectors[:, pair].real, -vectors[:, pair].imag])
    return float(values[real].real), complex(values[pair]), T, np.linalg.inv(T)


MU, LAMBDA, T, T_INVERSE = _transformation()

MOST_ITERATIONS = 8
SAFETY = 0.9
RETRY = 4
"""After a step of TR-BDF2 Radau is tried again where the count of steps is a multiple of this."""
HALVINGS = 3
"""With a fixed step nothing controls the error of a lower order: it is halved this many times before TR-BDF2 takes its place."""

rates = tangent = size_of = admit = project = shifted = resolve = two_stages = of_the_model


def interpolate(times: Array, past: Array, t: float, out: Array) -> None:
    """Value at `t` of the polynomial through the points (times, past)."""
    out[:] = 0.0
    for i in range(len(times)):
        weight = 1.0
        for j in range(len(times)):
            if j != i:
                weight *= (t - times[j]) / (times[i] - times[j])
        for k in range(len(out)):
            out[k] += weight * past[i, k]


def differentiate(times: Array, past: Array, t: float, out: Array) -> None:
    """Derivative at `t` of the polynomial through the points (times, past)."""
    out[:] = 0.0
    for i in range(len(times)):
        weight = 0.0
        for k in range(len(times)):
            if k != i:
                part = 1.0 / (times[i] - times[k])
                for j in range(len(times)):
                    if j not in (i, k):
                        part *= (t - times[j]) / (times[i] - times[j])
                weight += part
        for k in range(len(out)):
            out[k] += weight * past[i, k]


def iterate(data: Any, mass: Array, t: float, y: Array, h: float, work: Work) -> None:
    """One simplified Newton iteration: `work.changes` of the stages `work.stages`, and their transforms."""
    total = len(y)
    rest = len(mass)
    real, vector, scratch = work.vector, work.complex_vector, work.scratch
    transformed, changes = work.transformed, work.changes
    for i in range(3):
        for k in range(total):
            scratch[k] = y[k] + work.stages[i, k]
        rates(data, t + NODES[i] * h, scratch, changes[i], work.model)
    for k in range(total):
        mass_k = mass[k] if k < rest else 1.0
        w_1, w_2, w_3 = transformed[0, k], transformed[1, k], transformed[2, k]
        f_1, f_2, f_3 = changes[0, k], changes[1, k], changes[2, k]
        real[k] = T_INVERSE[0, 0] * f_1 + T_INVERSE[0, 1] * f_2 + T_INVERSE[0, 2] * f_3 - mass_k * (MU / h) * w_1
        pair = complex(
            T_INVERSE[1, 0] * f_1 + T_INVERSE[1, 1] * f_2 + T_INVERSE[1, 2] * f_3,
            T_INVERSE[2, 0] * f_1 + T_INVERSE[2, 1] * f_2 + T_INVERSE[2, 2] * f_3,
        )
        vector[k] = pair - mass_k * (LAMBDA / h) * complex(w_2, w_3)
    resolve(MU / h, work.band, work.pivots, work.real_columns, work.real_rows, work.real_corner, work.q_rows, work.q_corner, real)
    resolve(LAMBDA / h, work.complex_band, work.complex_pivots, work.complex_columns, work.complex_rows, work.complex_corner, work.q_rows,
            work.q_corner, vector)  # fmt: skip
    for k in range(total):
        d_1, d_2, d_3 = real[k], vector[k].real, vector[k].imag
        transformed[0, k] += d_1
        transformed[1, k] += d_2
        transformed[2, k] += d_3
        for i in range(3):
            changes[i, k] = T[i, 0] * d_1 + T[i, 1] * d_2 + T[i, 2] * d_3
            work.stages[i, k] = T[i, 0] * transformed[0, k] + T[i, 1] * transformed[1, k] + T[i, 2] * transformed[2, k]


def solve_stages(
    data: Any, mass: Array, times: Array, past: Array, points: int, h: float, tolerance: float, work: Work
) -> tuple[int, int, float]:
    """Simplified Newton for the stages of a step of size `h`, begun from the extrapolated solution. Returns what happened, the
    iterations, and the last change in units of the tolerated error."""
    t, y = times[0], past[0]
    if not shifted(MU / h, mass, work.jac, work.columns, work.rows, work.corner, work.band, work.pivots, work.real_columns,
                   work.real_rows, work.real_corner):  # fmt: skip
        return SINGULAR, 0, 0.0
    if not shifted(LAMBDA / h, mass, work.jac, work.columns, work.rows, work.corner, work.complex_band, work.complex_pivots,
                   work.complex_columns, work.complex_rows, work.complex_corner):  # fmt: skip
        return SINGULAR, 0, 0.0
    total = len(y)
    if points == 1:
        work.stages[:, :] = 0.0
    else:
        for i in range(3):
            interpolate(times[:points], past[:points], t + NODES[i] * h, work.stages[i])
            for k in range(total):
                work.stages[i, k] -= y[k]
    for k in range(total):
        for i in range(3):
            work.transformed[i, k] = (
                T_INVERSE[i, 0] * work.stages[0, k] + T_INVERSE[i, 1] * work.stages[1, k] + T_INVERSE[i, 2] * work.stages[2, k]
            )
    last = change = 0.0
    for iteration in range(1, MOST_ITERATIONS + 1):
        iterate(data, mass, t, y, h, work)
        change = 0.0
        for i in range(3):
            change = max(change, size_of(data, y, work.changes[i]))
        if not np.isfinite(change):
            return DIVERGED, iteration, change
        if iteration == 1:
            if change <= 0.1 * tolerance:
                return DONE, iteration, change
        else:
            rate = change / last
            if rate >= 1.0 and change > tolerance:
                return DIVERGED, iteration, change
            left = rate / (1.0 - rate) * change if rate < 1.0 else change
            if left <= tolerance:
                return DONE, iteration, change
            if rate ** (MOST_ITERATIONS - iteration) * left > tolerance:
                return DIVERGED, iteration, change
        last = change
    return DIVERGED, MOST_ITERATIONS, change


def error_of(data: Any, mass: Array, t: float, y: Array, h: float, again: bool, work: Work) -> float:
    """Norm of the local error of the solved step; filtered a second time where the first estimate may be a transient's (`again`)."""
    total, rest = len(y), len(mass)
    estimate, scratch = work.vector, work.scratch
    for sweep in range(2):
        for k in range(total):
            mass_k = mass[k] if k < rest else 1.0
            slope = ERROR_WEIGHTS[0] * work.stages[0, k] + ERROR_WEIGHTS[1] * work.stages[1, k] + ERROR_WEIGHTS[2] * work.stages[2, k]
            estimate[k] = (work.f_0[k] if sweep == 0 else work.changes[0, k]) + mass_k * slope / h
        resolve(MU / h, work.band, work.pivots, work.real_columns, work.real_rows, work.real_corner, work.q_rows, work.q_corner, estimate)
        error = size_of(data, y, estimate)
        if sweep == 1 or not again or error <= 1.0 or not np.isfinite(error):
            break
        for k in range(total):
            scratch[k] = y[k] + estimate[k]
        rates(data, t, scratch, work.changes[0], work.model)
    return error


def advance(
    data: Any, mass: Array, times: Array, past: Array, points: int, dt: float, fixed: float, stop: float, wanted: float, most_steps: int,
    tolerance: float, smallest: float, attempts: int, counters: Array, report: Array, work: Work,
) -> tuple[int, int, float]:  # fmt: skip
    """Take steps until `wanted` is reached or passed, but none beyond `stop`, and at most `most_steps`.

    Parameters
    ----------
    data : NamedTuple
        What the model's functions need.
    mass : (size + border,) array
        The diagonal of M, 0 or 1.
    times, past : (4,), (4, total) array
        The last point and the stages before it, newest first, of which `points` (1, 3 after TR-BDF2, or 4) count. Overwritten.
    dt, fixed : float
        Step to try next; the step to keep to without error control, or 0.
    tolerance : float
        Change at which Newton's method ends, in units of the tolerated error.
    smallest, attempts : float, int
        When to give up, as in `multiphase.stepping.Control`.
    counters : (4,) int array
        Steps, steps rejected for their error, for other reasons, and iterations; added to.
    report : (2,) array
        Size of the last rejected step, and what was wrong with it.

    Returns
    -------
    code, points, dt : int, int, float
    """
    total = past.shape[1]
    candidate, middle = np.empty(total), np.empty(total)
    taken = 0
    while times[0] < stop:
        t = times[0]
        for _ in range(2):
            rates(data, t, past[0], work.f_0, work.model)
            ahead = (landing(t, dt, stop) - t) / (t - times[points - 1]) if points > 1 else 0.0
            for k in range(total):  # along a line: a polynomial of higher order wiggles where a law has a kink
                work.scratch[k] = past[0, k] + ahead * (past[0, k] - past[points - 1, k])
            tangent(data, t, past[0], work.f_0, work.jac, work.columns, work.rows, work.corner, work.q_rows, work.q_corner, work.model,
                    work.scratch)  # fmt: skip
            if not project(data, past[0], work.f_0, work.jac):
                break
        reason, accepted = INEXACT, False
        robust = points == 3 and fixed == 0.0 and counters[0] % RETRY > 0
        for trial in range(attempts):
            goal = landing(t, dt, stop)
            h = goal - t
            if h <= smallest * max(abs(t), abs(stop)):
                break
            if robust:
                code, iterations, change = two_stages(data, mass, t, past[0], h, middle, candidate, work)
                error = change
            else:
                # A bad guess may be what failed; and past a kink the last polynomial leads to its soft side, where changes by a stiff
                # tangent are small whatever the error.
                known = points if trial == 0 and points == 4 else 1
                code, iterations, change = solve_stages(data, mass, times, past, known, h, tolerance, work)
            counters[3] += iterations
            if code != DONE:
                counters[2] += 1
                reason, report[0], report[1] = code, h, change
                if not robust and (fixed == 0.0 or h <= 0.5**HALVINGS * fixed):
                    robust = True
                else:
                    dt = 0.5 * h
                continue
            if robust:
                factor = SAFETY * max(error, 1e-10) ** (-1.0 / 3.0)
            else:
                for k in range(total):
                    candidate[k] = past[0, k] + work.stages[2, k]
                error = error_of(data, mass, t, past[0], h, points == 1 or trial > 0, work)
                factor = SAFETY * (2.0 * MOST_ITERATIONS + 1.0) / (2.0 * MOST_ITERATIONS + iterations) * max(error, 1e-10) ** -0.25
            if fixed == 0.0 and not error <= 1.0:
                counters[1] += 1
                reason, report[0], report[1] = INEXACT, h, error
                dt = h * (max(0.2, min(0.9, factor)) if factor > 0.2 else 0.2)  # 0.2, too, for an error that is not a number
                continue
            broken = admit(data, candidate, work.model)
            if broken:
                counters[2] += 1
                reason, report[0], report[1] = OUT_OF_BOUNDS, h, float(broken)
                dt = 0.5 * h
                continue
            accepted = True
            break
        if not accepted:
            return reason, points, dt
        counters[0] += 1
        taken += 1
        for k in range(total):
            if robust:
                past[2, k], past[1, k] = past[0, k], middle[k]
            else:
                past[3, k], past[2, k], past[1, k] = past[0, k], past[0, k] + work.stages[0, k], past[0, k] + work.stages[1, k]
            past[0, k] = candidate[k]
        if robust:
            points, times[1], times[2] = 3, t + trbdf2.GAMMA * h, t
        else:
            points, times[1], times[2], times[3] = 4, t + NODES[1] * h, t + NODES[0] * h, t
        times[0] = goal
        if fixed > 0.0:
            dt = min(fixed, 2.0 * h)
        else:
            growth = min(factor, 2.0 if robust else 1.0 if trial else 2.0 if iterations > 2 else 8.0)
            dt = max(h * growth, min(dt, 8.0 * h)) if h < 0.999 * dt and growth >= 1.0 else h * max(growth, 0.2)
        if times[0] >= wanted or taken >= most_steps:
            return GOING_ON, points, dt
    return DONE, points, dt


def build(functions: Mapping[str, Any], keep: str) -> Any:
    """`advance` compiled for one model from its functions; `keep` is the fingerprint of the files they come from."""
    own = {name: functions[name] for name in MODEL}
    own["shifted"] = compiled(newton.shifted)
    own["resolve"] = compiled(newton.resolve)
    own["interpolate"] = compiled(interpolate)
    own["landing"] = compiled(landing)
    own["newton_step"] = compiled(newton.newton_step, **own)
    own["two_stages"] = compiled(trbdf2.two_stages, **own)
    for function in (iterate, solve_stages, error_of):
        own[function.__name__] = compiled(function, **own)
    return compiled(advance, keep=keep, **own)
