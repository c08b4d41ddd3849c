"""What schemes share that FiPy assembles: FiPy itself, Newton's method on its residual, the compiled tangent as that residual's, and sums
free of rounding.

A scheme states its equations as FiPy terms and gives the residual that FiPy makes of them; `Assembled` solves it by Newton's method with
the exact tangent of the compiled discretisation, which must be of the same equations. Integrals of the sources advance with the
linearised step that the unknowns took, so balances close to rounding whatever the tolerance of the iteration.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from multiphase import lines, newton
from multiphase.stepping import Solved, StepFailure

Array = NDArray[np.float64]
Places = NDArray[np.int64]


def import_fipy() -> Any:
    """FiPy with its SciPy solvers; it reads the command line and the environment as it is imported."""
    if "fipy" not in sys.modules:
        arguments, sys.argv = sys.argv, sys.argv[:1]
        os.environ.setdefault("FIPY_SOLVERS", "scipy")
        try:
            import fipy
        finally:
            sys.argv = arguments
    import fipy

    return fipy


class Assembled(lines.SemiDiscrete):
    """One implicit step for the common time loop, on a residual that FiPy assembles; see `multiphase.stepping.Scheme`.

    The loop's vector begins with that of `multiphase.lines.SemiDiscrete`, of length `base`. A scheme defines `residual`, `tangent`,
    `linearised` and, where Newton's unknowns are not those of the loop's vector, `fractions`.
    """

    @property
    def base(self) -> int:
        """Length of what the vector shares with the other schemes of the model."""
        return len(self.mass) + len(self.work.q_rows)

    @property
    def integrals(self) -> Places:
        """Where the integrals over time stand in the loop's vector."""
        return np.arange(len(self.mass), self.base)

    def fractions(self, u: Array) -> Array:
        """Newton's unknowns of the loop's vector: the fractions in place of their products with the size, where a scheme has them."""
        return u[: len(self.mass)].copy()

    def residual(self, t: float, alpha: float, past: Array, x: Array) -> Array:
        """Residual of the implicit step to `t` at Newton's unknowns `x`, from FiPy's terms; `past` is the weighted past of the loop."""
        raise NotImplementedError

    def tangent(self, t: float, alpha: float, past: Array, x: Array, *, fresh: bool = True) -> csc_matrix:
        """Tangent of `residual` where that was last called; parts that are costly may be those of an earlier call unless `fresh`."""
        raise NotImplementedError

    def linearised(self, t: float, x: Array, change: Array) -> tuple[Array, Array]:
        """Change of the loop's vector without its integrals, and their integrands after the change; both as linear as the step is."""
        raise NotImplementedError

    def prepare(self) -> None:
        """Import, compile or load what a run needs: one residual and its tangent."""
        super().prepare()
        u = self.initial()
        self.residual(0.0, 1.0, u, self.fractions(u))
        self.error_norm(u, u)
        self._reach(0.0, u, np.zeros_like(u))
        self._admit(0.0, u.copy())

    def solve(self, t: float, alpha: float, past: Array, guess: Array) -> Solved:
        """Newton's method from the predicted vector; see `multiphase.stepping.Scheme`. It ends and gives up as the compiled one does."""
        u, still = guess.copy(), np.zeros_like(guess)
        if self._reach(t, u, still) == 0.0:
            u[:] = past  # prediction has left where the equations are defined
            if self._reach(t, u, still) == 0.0:
                raise StepFailure(self.reason(newton.OUT_OF_BOUNDS, self._admit(t, u)))
        last = moved = 0.0
        for iteration in range(1, lines.NEWTON_ITERATIONS + 1):
            x = self.fractions(u)
            right = -self.residual(t, alpha, past, x)
            matrix = self.tangent(t, alpha, past, x, fresh=iteration == 1)
            try:
                change = splu(matrix).solve(right)
            except RuntimeError as error:
                raise StepFailure(self.reason(newton.SINGULAR, moved)) from error
            step, integrands = self.linearised(t, x, change)
            moved = self.error_norm(step, u)
            if not np.isfinite(moved):
                raise StepFailure(self.reason(newton.DIVERGED, moved))
            share = self._reach(t, u, step)
            u += (share if share > 0.0 else 1.0) * step
            if share == 0.0:
                raise StepFailure(self.reason(newton.OUT_OF_BOUNDS, self._admit(t, u)))
            rate = moved / last if last > 0.0 else 1.0
            if moved * min(1.0, rate) <= lines.NEWTON_TOLERANCE and share == 1.0:
                u[self.integrals] = past[self.integrals] + integrands / alpha
                broken = self._admit(t, u)
                if broken:
                    raise StepFailure(self.reason(newton.OUT_OF_BOUNDS, broken))
                return Solved(u, iteration)
            if iteration > 2 and rate > 2.0 and share == 1.0:
                break
            last = moved
        raise StepFailure(self.reason(newton.DIVERGED, moved))

    def _reach(self, t: float, u: Array, step: Array) -> float:
        """Share of `step` that keeps `u` where the equations are defined; 0 if none does."""
        return float(self.kernel["reach"](self.data_until(t), u[: self.base], step[: self.base]))

    def _admit(self, t: float, u: Array) -> int:
        """The bound that `u` breaks by more than the tolerance, or 0; `u` is then brought within its bounds."""
        return int(self.kernel["admit"](self.data_until(t), u[: self.base], self.work.model))


class Scatter:
    """Turns the compiled tangent of a model, a band and a border, into that of FiPy's residual in the order of Newton's unknowns.

    Parameters
    ----------
    place : (size,) array of int
        Where each unknown of the band stands in Newton's vector, or -1 if it is none; together they fill its beginning, and the border
        follows them.
    half : int
        Half-width of the band.
    border : int
        Unknowns of the border, of which the first is the size W of the body.
    products : slice
        Where Newton's vector has fractions x of which the band has the products W x.
    """

    def __init__(self, place: Places, half: int, border: int, products: slice = slice(0)) -> None:
        size, width = len(place), 2 * half + 1
        row = np.repeat(np.arange(size), width)
        column = row + np.tile(np.arange(width) - half, size)
        inside = (column >= 0) & (column < size)
        inside[inside] = (place[column[inside]] >= 0) & (place[row[inside]] >= 0)
        self._inside, self._known, self._products = np.flatnonzero(inside), np.flatnonzero(place >= 0), products
        self._place = known = place[self._known]
        self.unknowns = len(known) + border
        self._border = edge = np.arange(len(known), self.unknowns)
        self._row, self._column = place[row[inside]], place[column[inside]]
        every = np.arange(self.unknowns)
        fractions = every[products]
        rows = [self._row, np.tile(known, border), np.repeat(edge, len(known)), np.repeat(edge, border), every, fractions]
        columns = [
            self._column, np.repeat(edge, len(known)), np.tile(known, border), np.tile(edge, border), every,
            np.full(len(fractions), len(known)),
        ]  # fmt: skip
        places, self._slot = np.unique(np.concatenate(columns) * self.unknowns + np.concatenate(rows), return_inverse=True)
        self._indices = places % self.unknowns
        self._starts = np.searchsorted(places, np.arange(self.unknowns + 1) * self.unknowns)

    def matrix(self, work: Any, balance: Array, scale: Array, x: Array) -> csc_matrix:
        """Derivative of ``balance y + scale rates(y)`` with respect to Newton's unknowns, where y has the products for the fractions.

        Parameters
        ----------
        work : multiphase.newton.Work
            Holds the tangent of the rates.
        balance, scale : (unknowns,) array
        x : array
            Newton's unknowns, and perhaps more.
        """
        edge, place, products = self._border, self._place, self._products
        inner, unit = np.zeros(self.unknowns), np.ones(self.unknowns)  # dy/dW, and dy/dx
        inner[products], unit[products] = x[products], x[edge[0]]
        band = scale[self._row] * work.jac.ravel()[self._inside]
        rows, columns, corner = work.rows[:, self._known], scale[place] * work.columns[:, self._known], work.corner.copy()
        corner[:, 0] += rows @ inner[place]
        columns[0] += np.bincount(self._row, weights=band * inner[self._column], minlength=self.unknowns)[place]
        border = scale[edge, None]
        values = np.concatenate([
            band * unit[self._column], columns.ravel(), (border * rows * unit[place]).ravel(), (border * corner).ravel(), balance * unit,
            (balance * inner)[products],
        ])  # fmt: skip
        data = np.bincount(self._slot, weights=values)
        return csc_matrix((data, self._indices, self._starts), shape=(self.unknowns, self.unknowns))


def without_rounding(residual: Array, total: float, size: float, shares: Array | None = None) -> Array:
    """`residual` shifted so that it adds up to `total`, as its fluxes do in exact arithmetic: evenly, or by `shares`, which add up to 1.

    FiPy's rows are differences of terms of order `size`, so the fluxes of thin cells leave rounding that would add up over a run. More
    than rounding is not touched.
    """
    defect = total - float(np.sum(residual))
    if abs(defect) > 1e3 * np.finfo(float).eps * len(residual) * size:
        return residual
    return residual + defect * (1.0 / len(residual) if shares is None else shares)
