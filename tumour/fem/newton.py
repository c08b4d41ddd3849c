"""Newton's method for one implicit step on a mesh, with a tangent that is kept as long as it serves.

A tangent costs ten times what an iteration with an old one does, so it is kept, from step to step, while the changes fall by `SLOW` or
faster with each iteration and the step is about what it was; where they do not, as where the front at which cells lose contact passes
through elements, it is made anew as often as that pays. A change that would turn an element inside out or take a cell fraction out
of (0, 1) is shortened, and so is one after which the next, with the same tangent, would not be smaller.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.sparse import SingularMatrix, SparseSolver
from multiphase.stepping import StepFailure
from tumour.fem.arrays import ACTIONS, FIELDS, KEPT, Data, Edges, Elements
from tumour.fem.layout import RigidMotions, Rows

Array = NDArray[np.float64]

ITERATIONS = 40
"""Residuals after which a step is given up."""
SLOW = 0.3
"""Contraction above which the tangent is made anew, unless the iteration ends soon all the same."""
WORTH = 8
"""Iterations that a new tangent costs."""
DIVERGED = 0.9
"""Contraction above which a change is not taken as it is."""
TANGENTS = 8
"""Tangents after which an iteration whose changes are not shortened is given up."""
STEP_CHANGE = 0.3
"""Relative change of the implicit step above which the tangent is made anew."""
LEAST_SHARE = 1.0 / 1024.0
"""Least share of a change that is taken; below it the step is given up."""
LEAST_CONTRACTION = 0.05
"""Contraction that the first change of a step is taken to have at best."""
LAST = 10.0
"""Size of the last change, in tolerances, above which an iteration goes on however fast it seems to converge: what is slow shows late."""
ROUNDING = 1e-10
"""Size of changes that rounding may leave in stiff bodies."""
AGEING = 4.0
"""Factor by which the contraction is taken to have grown after a step that did not show it."""
KEPT_DISTANCE = 0.1
"""Share of its distance from 0 and 1 that a cell fraction keeps in one change."""

NAMES = ("the displacement", "the displacement", "alpha", "p", "C")


@dataclass(slots=True)
class Point:
    """The unknowns of a mesh: those of its points, (points, 5), and of its bubbles, (elements, 2)."""

    nodal: Array
    bubbles: Array

    def moved(self, change: Point, share: float) -> Point:
        return Point(self.nodal + share * change.nodal, self.bubbles + share * change.bubbles)


@dataclass(frozen=True, slots=True)
class Step:
    """One implicit step: its size tau, the right-hand side, the last point for the step as printed, and what acts on the edges."""

    tau: float
    loads: Array
    bubble_loads: Array
    old: Point
    actions: Array


class Newton:
    """The solver of implicit steps on one mesh.

    Parameters
    ----------
    kernel : mapping of str to function
        `tumour.fem.kernel.KERNEL`, or `tumour.fem.readable.Readable`.
    constants, elements, edges, points, rows, rigid
        What is solved.
    linear : SparseSolver
        For the pattern of `rows`.
    tolerance : float
        Of the error left: displacements over `length`, fractions, pressures over the shear modulus or the largest of them, oxygen over
        `oxygen`.
    """

    def __init__(
        self, kernel: Any, constants: Data, elements: Elements, edges: Edges, points: Array, rows: Rows, rigid: RigidMotions,
        linear: SparseSolver, *, tolerance: float, length: float, oxygen: float,
    ) -> None:  # fmt: skip
        self.kernel, self.constants, self.elements, self.edges, self.points = kernel, constants, elements, edges, points
        self.rows, self.rigid, self.linear = rows, rigid, linear
        self._timeless = constants._replace(printed=False)
        self.tolerance, self.length, self.oxygen = tolerance, length, oxygen
        self._residual, self._bubbles = np.zeros((len(points), FIELDS)), np.zeros((len(elements.areas), 2))
        self._values, self._kept = np.zeros(len(rows.indices)), np.zeros((len(elements.areas), KEPT))
        self.forget()
        self.seconds = {"residual": 0.0, "tangent": 0.0, "moments": 0.0}
        self.counts = {"residual": 0, "tangent": 0}

    # -- The tangent that is held ---------------------------------------------------------------------------------------

    @property
    def memory(self) -> Array:
        """What the tangent that is held was made of; empty without one."""
        kept = [self._contraction, self._excess, self._usual]
        return np.concatenate([kept, self._made_at]) if self._made_at.size else np.zeros(0)

    def recall(self, memory: Array) -> None:
        """Hold the tangent again that was made of `memory`."""
        self.forget()
        if not memory.size:
            return
        count, triangles, edges = self._residual.size, self._bubbles.size, ACTIONS * len(self.edges.lengths)
        tau, actions, nodal, bubbles, old, old_bubbles = np.split(memory[3:], np.cumsum([1, edges, count, triangles, count]))
        if not old.size:
            old, old_bubbles = nodal, bubbles
        nothing = np.zeros_like(self._residual), np.zeros_like(self._bubbles)
        point, last = (Point(a.reshape(-1, FIELDS), b.reshape(-1, 2)) for a, b in ((nodal, bubbles), (old, old_bubbles)))
        self.make(Step(float(tau[0]), *nothing, last, actions.reshape(-1, ACTIONS)), point)
        self._contraction, self._excess, self._usual = memory[:3].tolist()

    def forget(self) -> None:
        """Hold no tangent."""
        self._made_at = np.zeros(0)
        self._contraction, self._excess, self._usual = 1.0, 0.0, 0.0

    def over_elements(self, name: str, *arguments: Any, account: str = "residual") -> Any:
        """What a function of the kernel gives for the elements; its time goes to an account."""
        started = time.perf_counter()
        found = self.kernel[name](*arguments)
        self.seconds[account] += time.perf_counter() - started
        return found

    def turned_over(self, at: Point) -> int:
        """-1, or the first element that is turned inside out."""
        return int(self.over_elements("turned_over", self.elements, at.nodal, at.bubbles))

    def _law(self, step: Step) -> Data:
        """The constants of a step; in no time nothing is made, so that the step as printed keeps cells there, too."""
        return self.constants if step.tau > 0.0 else self._timeless

    def _evaluate(self, step: Step, at: Point) -> int:
        """The residual with the tangent that is held; -1, or the first element that is turned inside out."""
        self.counts["residual"] += 1
        return int(self.over_elements(
            "residual", self._law(step), self.elements, step.tau, at.nodal, at.bubbles, step.old.nodal, step.old.bubbles, step.loads,
            step.bubble_loads, self.edges, step.actions, self._kept, self._residual, self._bubbles,
        ))  # fmt: skip

    def make(self, step: Step, at: Point) -> int:
        """The residual, with a new tangent, factorised; -1, or the first element that is turned inside out."""
        self.forget()
        self.counts["tangent"] += 1
        code = self.over_elements(
            "tangent", self._law(step), self.elements, step.tau, at.nodal, at.bubbles, step.old.nodal, step.old.bubbles, step.loads,
            step.bubble_loads, self.edges, step.actions, self.rows.pattern, self._values, self._kept, self._residual, self._bubbles,
            account="tangent",
        )  # fmt: skip
        if code < 0:
            try:
                self.linear.factorise(self._values)
            except SingularMatrix as error:
                raise StepFailure("the tangent of the step is singular: the body has no definite equilibrium") from error
            old = [step.old.nodal.ravel(), step.old.bubbles.ravel()] if self._law(step).printed else []
            self._made_at = np.concatenate([[step.tau], step.actions.ravel(), at.nodal.ravel(), at.bubbles.ravel(), *old])
        return int(code)

    def _change(self) -> Point:
        """The change that the tangent gives for the residual last evaluated."""
        nodal = np.zeros_like(self._residual)
        nodal.ravel()[self.rows.free] = self.linear.solve(self._residual.ravel()[self.rows.free])
        np.negative(nodal, out=nodal)
        bubbles = np.empty_like(self._bubbles)
        self.over_elements("bubble_changes", self.elements, self._kept, self._bubbles, nodal, bubbles)
        return Point(nodal, bubbles)

    # -- The iteration --------------------------------------------------------------------------------------------------

    def solve(self, step: Step, point: Point, otherwise: Callable[[], Point]) -> tuple[Point, int]:
        """Iterate from `point`, at least once; the solution and the number of changes made.

        First with changes as they come, and where that fails from the point that `otherwise` gives, with changes that are shortened until
        the next one, with the same tangent, is smaller.

        Raises
        ------
        StepFailure
            With the reason, and where in the body.
        """
        if self._excess >= WORTH:
            self.forget()
        tangents = self.counts["tangent"]
        try:
            point, iterations = self._iterate(step, point, damped=False)
        except StepFailure:
            self.forget()
            point, iterations = self._iterate(step, otherwise(), damped=True)
        if self.counts["tangent"] > tangents or not self._usual:
            self._usual = float(iterations)
        self._excess += max(0.0, iterations - self._usual)
        return point, iterations

    def _iterate(self, step: Step, point: Point, *, damped: bool) -> tuple[Point, int]:
        """Newton's method from `point`; see `solve`."""
        other = abs(step.tau / self._made_at[0] - 1.0) if self._made_at.size and self._made_at[0] > 0.0 else np.inf
        stale = other > STEP_CHANGE
        previous, change, last, share = point, None, 0.0, 1.0
        own, iterations, made = False, 0, 0
        for _ in range(ITERATIONS):
            turned = self.make(step, point) if stale else self._evaluate(step, point)
            if turned >= 0:
                share *= 0.5
                if change is None or share < LEAST_SHARE:
                    raise StepFailure(f"an element is turned inside out (J <= 0) {self._where(turned, point)}")
                point = self._moved(previous, change, share)
                continue
            made += stale
            new = self._change()
            size = self._size(new, point)
            if not np.isfinite(size):
                raise StepFailure("the linear system of the step has no finite solution: the body has no definite equilibrium")
            theta = np.nan
            if change is not None and not stale:
                theta = size / last if last > 0.0 else 0.0
                if theta > DIVERGED and size > self.tolerance:
                    if not own:  # a tangent of an earlier step leads astray: back, and make a new one
                        point, change, share, stale = previous, None, 1.0, True
                    elif not damped:
                        stale = True
                        if made >= TANGENTS:
                            raise StepFailure(f"Newton's method does not converge: {self._worst(new, point)}")
                    else:
                        share *= 0.5
                        if share < LEAST_SHARE:
                            raise StepFailure(f"Newton's method does not converge: {self._worst(new, point)}")
                        point = self._moved(previous, change, share)
                    continue
                if share == 1.0:
                    self._contraction = theta
            own = own or stale
            previous, change, last = point, new, size
            share = self._reach(previous, change)
            point = self._moved(previous, change, share)
            iterations += 1
            left = self._left(theta, size, 0.5 if stale else max(self._contraction, other))
            if share == 1.0 and left <= self.tolerance and size <= max(LAST * self.tolerance, ROUNDING) and self.turned_over(point) < 0:
                if np.isnan(theta):
                    self._contraction = min(1.0, AGEING * max(self._contraction, LEAST_CONTRACTION))
                return point, iterations
            stale = self._too_slow(theta, size)
        raise StepFailure(f"Newton's method does not converge in {ITERATIONS} iterations: {self._worst(change, point)}")

    def _left(self, theta: float, size: float, expected: float) -> float:
        """The error left after a change of a size, with the contraction seen, or else with that expected."""
        if np.isnan(theta):
            theta = max(expected, LEAST_CONTRACTION)
        return size * theta / (1.0 - theta) if theta < 1.0 else np.inf

    def _too_slow(self, theta: float, size: float) -> bool:
        """Whether a new tangent is cheaper than going on with a contraction."""
        if not theta > SLOW:  # also where it is not known
            return False
        return self._left(theta, size * theta**WORTH, theta) > self.tolerance

    def _moved(self, point: Point, change: Point, share: float) -> Point:
        """The point after a share of a change, with its rigid motion removed."""
        moved = point.moved(change, share)
        self.rigid.align(moved.nodal[:, :2], moved.bubbles)
        return moved

    def _reach(self, point: Point, change: Point) -> float:
        """The share of a change that leaves every cell fraction a part of its distance from 0 and 1."""
        alpha, step = point.nodal[:, 2], change.nodal[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0.0, 1.0 - alpha, alpha) / np.abs(step)
        return min(1.0, (1.0 - KEPT_DISTANCE) * float(np.nanmin(room)))

    def _scales(self, point: Point) -> Array:
        pressure = self.constants.mu + float(np.max(np.abs(point.nodal[:, 3])))
        return np.array([self.length, self.length, 1.0, pressure, self.oxygen])

    def _size(self, change: Point, point: Point) -> float:
        return float(np.max(np.max(np.abs(change.nodal), axis=0) / self._scales(point)))

    # -- Words ----------------------------------------------------------------------------------------------------------

    def _worst(self, change: Point | None, point: Point) -> str:
        """The largest change, and where."""
        if change is None:
            return "every change leads astray"
        sizes = np.abs(change.nodal) / self._scales(point)
        at, field = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
        x, y = self.points[at]
        return f"{NAMES[field]} still changes by {change.nodal[at, field]:.2g} at the point ({x:.4g}, {y:.4g}) of the body at rest"

    def _where(self, element: int, point: Point) -> str:
        """The place of an element, at rest and now."""
        corners = self.elements.triangles[element]
        (x, y), (u, v) = self.points[corners].mean(axis=0), point.nodal[corners, :2].mean(axis=0)
        return f"in triangle {element}, at ({x:.4g}, {y:.4g}) of the body at rest, now at about ({x + u:.4g}, {y + v:.4g})"
