r"""TR-BDF2 for ``M y' = f(t, y)``: a step of order two with full Newton iterations, compiled.

The trapezoidal rule to ``t + gamma h``, then BDF2 through both points to ``t + h`` (Bank et al., IEEE Trans. Comput.-Aided Des. 4, 1985);
with ``gamma = 2 - sqrt 2`` both stages have the matrix ``alpha M - J``, ``alpha = 2/(gamma h)``, and the step is L-stable:

    alpha M (y_1 - y - f(y)/alpha) = f(y_1),        alpha M (y_2 - (y_1 - (1-gamma)^2 y)/(gamma (2-gamma))) = f(y_2)

Algebraic rows hold at the end of both stages. The local error is that of Hosea & Shampine (Appl. Numer. Math. 20, 1996), the difference
to a formula of order three in ``f(y), f(y_1), f(y_2)``, filtered by the matrix. Linear invariants of f hold after each iteration.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from multiphase.newton import DIVERGED, DONE, of_the_model

Array = Any

GAMMA = 2.0 - np.sqrt(2.0)
HALF_GAMMA = 0.5 * GAMMA
_W = 0.25 * np.sqrt(2.0)
ERROR_WEIGHTS = np.array([(1.0 - 4.0 * _W) / 3.0, 1.0 / 3.0, -2.0 * HALF_GAMMA / 3.0])
TOLERANCE = 3e-3
"""Change at which Newton's method ends, in units of the tolerated error."""
MOST_ITERATIONS = 12
CAUTION = 3.0
"""What the local error is multiplied with: a method of low order leaves more of it in the end than its neighbour of order five."""

rates = size_of = reach = resolve = newton_step = of_the_model


def two_stages(data: Any, mass: Array, t: float, y: Array, h: float, middle: Array, end: Array, work: Any) -> tuple[int, int, float]:
    """One step of size `h` from `y` at `t`; `middle` and `end` receive the values at ``t + gamma h`` and ``t + h``.

    Returns the code of `multiphase.newton`, the iterations, and the local error in units of the tolerance, or what Newton's method left.
    """
    total, rest = len(y), len(mass)
    alpha = 1.0 / (HALF_GAMMA * h)
    f, past, estimate = work.changes[0], work.changes[1], work.changes[2]
    rates(data, t, y, f, work.model)
    for k in range(total):
        past[k] = y[k] + (f[k] / alpha if k >= rest or mass[k] > 0.0 else 0.0)
        middle[k] = y[k]
    code, first, change = newton_step(data, mass, t + GAMMA * h, alpha, past, middle, TOLERANCE, MOST_ITERATIONS, work)
    if code != DONE:
        return code, first, change
    for k in range(total):
        estimate[k] = ERROR_WEIGHTS[0] * f[k] + ERROR_WEIGHTS[1] * alpha * (middle[k] - past[k])
        past[k] = (middle[k] - (1.0 - GAMMA) ** 2 * y[k]) / (GAMMA * (2.0 - GAMMA))
        end[k] = y[k] + (middle[k] - y[k]) / GAMMA
    estimate_of_end = work.scratch
    estimate_of_end[:] = 0.0
    if reach(data, end, estimate_of_end) < 1.0:
        end[:] = middle
    code, second, change = newton_step(data, mass, t + h, alpha, past, end, TOLERANCE, MOST_ITERATIONS, work)
    if code != DONE:
        return code, first + second, change
    for k in range(total):
        estimate[k] = h * (estimate[k] + ERROR_WEIGHTS[2] * alpha * (end[k] - past[k]))
    error = 0.0
    for _ in range(2):  # what is stiff at the start, and off the solution, is not seen after a second filter
        for k in range(total):
            estimate[k] *= alpha if k >= rest or mass[k] > 0.0 else 0.0
        resolve(alpha, work.band, work.pivots, work.real_columns, work.real_rows, work.real_corner, work.q_rows, work.q_corner, estimate)
        error = CAUTION * size_of(data, end, estimate)
        if error <= 1.0:
            break
    return (DONE if np.isfinite(error) else DIVERGED), first + second, error
