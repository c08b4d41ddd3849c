r"""Modified LDL alone, where the fractions of the phases are known: what is left of `plaque1d.discretisation`, compiled.

Unknowns: ``W l_i``, cell by cell; then W and V, and the same three integrals. With c_i as it was at the start,

    d(W l_i)/dt = -(G_{i+1} - G_i)/h - k_l W l_i c_i,      dW/dt = V,      0 = V - R_1 Psi_m l_wall,

and G as there. The slip of the phases acts on nothing here; what is stored of it follows from the rest (`plaque1d.lines_scheme`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from plaque1d import discretisation as fv
from plaque1d import laws as law
from plaque1d import layout
from plaque1d.layout import BORDER, INTEGRALS

Array = Any

HALF = 1
"""Half-width of the band of the tangent."""
_L, _RADIUS = range(2)
WORK_ROWS = 2


class Data(NamedTuple):
    """What the kernels need of one scene: that of the whole system, and the macrophage fraction in the cells."""

    plaque: layout.Data
    c: Array


@njit(error_model="numpy")
def _prepare(d: Data, y: Array, work: Array) -> None:
    """Concentrations in the cells and radii of the faces."""
    p = d.plaque
    N = p.cells
    W = y[N]
    for i in range(N):
        work[_L, i] = y[i] / W
    for f in range(N + 1):
        work[_RADIUS, f] = np.sqrt(p.inner_radius * p.inner_radius + 2.0 * W * f / N) if p.annulus else 1.0


@njit(error_model="numpy")
def rates(d: Data, t: float, y: Array, out: Array, work: Array) -> None:
    """``M dy/dt``: rates of the balances, residual of the row of V.

    Parameters
    ----------
    d : Data
    t : float
    y, out : (cells + BORDER + INTEGRALS,) array
    work : (WORK_ROWS, cells + 1) array
    """
    p = d.plaque
    N = p.cells
    h, W, V = 1.0 / N, y[N], y[N + 1]
    _prepare(d, y, work)
    l = work[_L]
    Psi_l = layout.influx(p, t)
    total = 0.0
    for i in range(N):
        rate = l[i] * d.c[i]
        total += rate
        out[i] = -p.k_l * W * rate
    out[0] += p.inner_radius * Psi_l / h
    for f in range(1, N):
        velocity, conductance = fv._l_transport(p, W, V, work[_RADIUS, f], f * h)
        flux = (0.5 * velocity * (l[f - 1] + l[f]) - conductance * (l[f] - l[f - 1])) / h
        out[f - 1] -= flux
        out[f] += flux
    l_wall = law.wall_concentration(l[0], 0.5 * h * W / p.inner_radius, Psi_l, p.Psi_m)
    out[N], out[N + 1] = V, V - p.inner_radius * law.growth_rate(l_wall, p.Psi_m)
    out[N + 2], out[N + 3], out[N + 4] = h * W * total, p.inner_radius * Psi_l, V


@njit(error_model="numpy")
def tangent(
    d: Data, t: float, y: Array, f_0: Array, jac: Array, columns: Array, rows: Array, corner: Array, q_rows: Array, q_corner: Array,
    work: Array, scratch: Array,
) -> None:  # fmt: skip
    """Derivatives of `rates` at `y`, where it is `f_0`: the band exactly, the two columns of W and V by differences; see
    `plaque1d.discretisation.tangent`."""
    p = d.plaque
    N = p.cells
    h, W, V = 1.0 / N, y[N], y[N + 1]
    for index in range(BORDER):
        kept = y[N + index]
        step = 1e-7 * kept if index == 0 else 1e-4 * abs(kept) + 1e-8 * p.inner_radius * (p.Psi_m * p.l_reference + 1e-6)
        y[N + index] = kept + step
        step = y[N + index] - kept
        rates(d, t, y, scratch, work)
        y[N + index] = kept
        for i in range(N):
            columns[index, i] = (scratch[i] - f_0[i]) / step
        for i in range(BORDER):
            corner[i, index] = (scratch[N + i] - f_0[N + i]) / step
        for i in range(INTEGRALS):
            q_corner[i, index] = (scratch[N + BORDER + i] - f_0[N + BORDER + i]) / step
    _prepare(d, y, work)
    jac[:, :] = 0.0
    rows[:, :] = 0.0
    q_rows[:, :] = 0.0
    for i in range(N):
        jac[i, HALF] -= p.k_l * d.c[i]
        q_rows[0, i] = h * d.c[i]
    for f in range(1, N):
        velocity, conductance = fv._l_transport(p, W, V, work[_RADIUS, f], f * h)
        from_left, from_right = (0.5 * velocity + conductance) / (h * W), (0.5 * velocity - conductance) / (h * W)
        jac[f - 1, HALF] -= from_left
        jac[f - 1, HALF + 1] -= from_right
        jac[f, HALF - 1] += from_left
        jac[f, HALF] += from_right
    inner, _ = law.wall_concentration_slopes(work[_L, 0], 0.5 * h * W / p.inner_radius, layout.influx(p, t), p.Psi_m)
    rows[1, 0] = -p.inner_radius * law.growth_rate(inner, p.Psi_m) / W


@njit(error_model="numpy")
def size_of(d: Data, y: Array, e: Array) -> float:
    """The larger of the root mean square error of l over its scale and the relative error of W, in units of rtol."""
    N = d.plaque.cells
    W, e_W = y[N], e[N]
    square = largest = 0.0
    for i in range(N):
        l = y[i] / W
        change = (e[i] - l * e_W) / W
        square += change * change
        largest = max(largest, abs(l))
    return max(abs(e_W) / W, np.sqrt(square / N) / max(largest, 1e-3 * d.plaque.l_reference)) / d.plaque.rtol


@njit(error_model="numpy")
def admit(d: Data, y: Array, work: Array) -> int:
    """Refuses a step after which l (2) has left its range by more than rtol, or W is not positive (3); 0 otherwise."""
    N = d.plaque.cells
    W = y[N]
    if not W > 0.0:
        return 3
    largest = lowest = 0.0
    for i in range(N):
        l = y[i] / W
        largest, lowest = max(largest, abs(l)), min(lowest, l)
    return 2 if lowest < -d.plaque.rtol * max(largest, 1e-3 * d.plaque.l_reference) else 0


@njit(error_model="numpy")
def project(d: Data, y: Array, f: Array, jac: Array) -> bool:
    """Nothing in the band is algebraic."""
    return False


@njit(error_model="numpy")
def settle(d: Data, t: float, y: Array, w: Any) -> None:
    """Bring V onto its equation."""
    p = d.plaque
    N = p.cells
    l_wall = law.wall_concentration(y[0] / y[N], 0.5 * y[N] / (N * p.inner_radius), layout.influx(p, t), p.Psi_m)
    y[N + 1] = p.inner_radius * law.growth_rate(l_wall, p.Psi_m)


@njit(error_model="numpy")
def reach(d: Data, y: Array, change: Array) -> float:
    """Share of a Newton change that may be taken: all of it, or nothing where W would no longer be positive."""
    W = d.plaque.cells
    return 1.0 if y[W] + change[W] > 0.0 else 0.0
