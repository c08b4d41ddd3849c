"""SUNDIALS' IDA on the compiled rates and tangent of the plaque, for comparison with the integrator that ships."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from sksundae.ida import IDA

from plaque1d import layout
from plaque1d.semidiscrete import KERNEL, SemiDiscrete


def solve_with_ida(scheme: SemiDiscrete, end: float, rtol: float) -> tuple[Any, float, float]:
    """n and L at the end, and the wall time."""
    rates, tangent = KERNEL["rates"], KERNEL["tangent"]
    w, d, size = scheme.work, scheme.data(0.0), scheme.size
    start = scheme.initial()
    total = size + layout.BORDER
    full = np.zeros(len(start))
    out, f = np.zeros(len(start)), np.zeros(len(start))
    width = w.jac.shape[1]
    row = np.repeat(np.arange(size), width)
    column = row + np.tile(np.arange(width) - (width - 1) // 2, size)
    inside = (column >= 0) & (column < size)

    def residual(t: float, y: Any, yp: Any, result: Any) -> None:
        full[:total] = y
        rates(d, t, full, out, w.model)
        result[:] = scheme.mass * yp - out[:total]

    def matrix(cj: float) -> csc_matrix:
        entries = [(row[inside], column[inside], -w.jac.ravel()[inside])]
        for k in range(layout.BORDER):
            entries.append((np.arange(size), np.full(size, size + k), -w.columns[k]))
            entries.append((np.full(size, size + k), np.arange(size), -w.rows[k]))
            entries.append((np.full(layout.BORDER, size + k), size + np.arange(layout.BORDER), -w.corner[k]))
        entries.append((np.arange(total), np.arange(total), cj * scheme.mass))
        r, c, v = (np.concatenate(part) for part in zip(*entries, strict=True))
        return csc_matrix((v, (r, c)), shape=(total, total))

    def jacobian(t: float, y: Any, yp: Any, res: Any, cj: float, JJ: Any) -> None:
        full[:total] = y
        rates(d, t, full, f, w.model)
        tangent(d, t, full, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
        JJ[:] = matrix(cj)[places]

    rates(d, 0.0, start, out, w.model)
    rough = start.copy()
    rough[:size] = rough[:size] * (1.0 + 0.1 * np.sin(np.arange(size))) + 1e-3
    rates(d, 0.0, rough, f, w.model)
    tangent(d, 0.0, rough, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
    w.jac[:, :] = 1.0
    w.columns[:, :] = 1.0
    pattern = matrix(1.0)
    pattern.data[:] = 1.0
    pattern.eliminate_zeros()
    pattern.sort_indices()
    coo = pattern.tocoo()
    places = (coo.row, coo.col)
    slopes = scheme.mass * out[:total]
    algebraic = [int(i) for i in np.flatnonzero(scheme.mass == 0.0)]
    scale = np.full(total, rtol)
    scale[2 : size : scheme.stride] = 1e3
    started = time.perf_counter()
    solver = IDA(
        residual, rtol=rtol, atol=scale, algebraic_idx=algebraic, linsolver="sparse", sparsity=pattern, jacfn=jacobian,
        max_num_steps=100_000,
    )  # fmt: skip
    answer = solver.solve(np.array([0.0, end]), start[:total], slopes)
    seconds = time.perf_counter() - started
    if not answer.success:
        raise RuntimeError(answer.message)
    L = float(answer.y[-1][size])
    return answer.y[-1][scheme.n] / L, L, seconds
