"""The runs of a study: every row and the references, timed, within a budget of seconds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from multiphase.errors import ParameterError, SolverError
from multiphase.parameters import specifications
from multiphase.precision.accuracy import check_field
from multiphase.precision.options import Choices
from multiphase.result import Result
from multiphase.run import run
from multiphase.scene import Scene
from multiphase.stepping import State, StopRun, Tracker

SLOW = 2.0
"""Seconds of one run above which it is repeated once only."""
THREADS = 1
LADDER = ((4, 1e-2), (2, 1e-2), (2, 1e-1))
"""Cells and rtol of a reference, as factors of the finest row's; the first that the budget allows is taken."""


class _Limit(Tracker):
    """Stops a run so many seconds after its first step; what is compiled before that does not count."""

    def __init__(self, seconds: float) -> None:
        self.seconds, self.started = seconds, math.inf

    def on_step(self, state: State) -> None:
        self.started = min(self.started, time.perf_counter())
        if time.perf_counter() - self.started > self.seconds:
            raise StopRun(f"more than {self.seconds:.3g} s")


class Cost:
    """Seconds of one method against cells and rtol: a power law near the usual powers, corrected by what was measured.

    Beyond the measured tolerances the power of rtol is at least the usual one: a few measured ones, where the first steps hardly
    count, promise too much.
    """

    USUAL = (1.0, 0.5)
    WEIGHT = 0.3

    def __init__(self) -> None:
        self.points: list[tuple[float, float, float]] = []
        self.hopeless = False

    def add(self, cells: int, rtol: float, seconds: float) -> None:
        self.points.append((math.log(cells), -math.log(rtol), math.log(max(seconds, 1e-9))))

    def predict(self, cells: int, rtol: float) -> float:
        """Seconds of a run; 0 where nothing was measured, infinite for a method that did not get through its first run."""
        if self.hopeless:
            return math.inf
        if not self.points:
            return 0.0
        x, y = math.log(cells), -math.log(rtol)
        known = np.array(self.points)
        here = known[:, :2] - (x, y)  # the constant of the fit is then the answer
        prior = self.WEIGHT * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        matrix = np.vstack([np.column_stack([np.ones(len(known)), here]), prior])
        values = np.concatenate([known[:, 2], self.WEIGHT * np.array(self.USUAL)])
        fitted = float(np.linalg.lstsq(matrix, values, rcond=None)[0][0])
        lighter = known[(known[:, 0] <= x) & (known[:, 1] <= y)]
        beyond = self.USUAL[1] * (y - np.max(known[:, 1]))
        least = lighter[:, 2] + np.maximum(0.0, beyond) * (lighter[:, 1] == np.max(known[:, 1]))
        return math.exp(max([fitted, *least.tolist()]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The run that errors are measured against."""

    method: str
    cells: int
    rtol: float
    seconds: float

    def __str__(self) -> str:
        return f"{self.method}, {self.cells} cells, rtol = {self.rtol:g} ({self.seconds:.3g} s)"


@dataclass(frozen=True, slots=True)
class _Run:
    """How one run ended; `result` only where it completed."""

    status: str
    message: str
    seconds: float
    result: Result | None


@dataclass(frozen=True, slots=True)
class Row:
    method: str
    cells: int
    rtol: float
    status: str
    message: str = ""
    seconds: tuple[float, ...] = ()
    result: Result | None = None


@dataclass(frozen=True, slots=True)
class Finer:
    about: Reference
    result: Result


class Bench:
    """Runs one scene again and again, and keeps count of the seconds."""

    def __init__(self, scene: Scene, budget: float, progress: Callable[[str], None]) -> None:
        self.scene, self.budget, self.progress = scene, budget, progress
        self.spent = 0.0
        self.costs: dict[str, Cost] = {}
        self.notes: list[str] = []

    def attempt(self, method: str, cells: int, rtol: float, limit: float | None = None) -> _Run:
        """One run; a refusal and a failure are answers."""
        trackers = () if limit is None else (_Limit(limit),)
        try:
            changed = self.scene.with_changes(solver={"method": method, "cells": cells, "rtol": rtol})
            result = run(changed, trackers=trackers, threads=THREADS, raise_on_failure=False)
        except ParameterError as error:
            return _Run("refused", str(error), 0.0, None)
        except SolverError as error:
            return _Run("failed", str(error), 0.0, None)
        seconds = float(result.stats["wall_s"])
        if result.status == "completed":
            return _Run("completed", "", seconds, result)
        message = f"after {seconds:.3g} s, more than the budget left for it" if result.status == "stopped" else result.message
        return _Run(result.status, message, seconds, None)

    def rows(self, chosen: Choices, repeats: int) -> list[Row]:
        """Every combination, the fastest method first and from light to heavy; returned in the order of `chosen`."""
        share = 0.5 * self.budget
        first = chosen.cells[0], chosen.rtols[0]
        for method in chosen.methods:
            self.costs[method] = Cost()
            self._warm_up(method, *first, share / len(chosen.methods))
        found = {(method, *first): self.row(method, *first, repeats, share) for method in chosen.methods}
        pairs = [(cells, rtol) for cells in chosen.cells for rtol in chosen.rtols if (cells, rtol) != first]
        for method in sorted(chosen.methods, key=lambda method: self.costs[method].predict(*first)):
            for cells, rtol in sorted(pairs, key=lambda pair: pair[0] * pair[1] ** -0.5):
                found[method, cells, rtol] = self.row(method, cells, rtol, repeats, share)
        return [found[method, cells, rtol] for method in chosen.methods for cells in chosen.cells for rtol in chosen.rtols]

    def _warm_up(self, method: str, cells: int, rtol: float, limit: float) -> None:
        """A run that does not count: it imports and compiles."""
        self.progress(f"{method}: warm-up")
        found = self.attempt(method, cells, rtol, limit)
        if found.result is not None:
            check_field(self.scene.model.film, found.result)
        if found.status == "stopped":
            self.costs[method].hopeless = True
            self.notes.append(f"{method}: the first run had not ended after {limit:.3g} s, so this method was left out")

    def row(self, method: str, cells: int, rtol: float, repeats: int, share: float) -> Row:
        """Time one combination, unless that would take more than what is left of `share`."""
        cost = self.costs[method]
        predicted, left = cost.predict(cells, rtol), share - self.spent
        if predicted > left:
            why = f"would take about {predicted:.2g} s, {max(left, 0.0):.2g} s left of the {share:.3g} s for rows"
            return Row(method, cells, rtol, "not run", "the first run had not ended in time" if cost.hopeless else why)
        self.progress(f"{method}: {cells} cells, rtol = {rtol:g}")
        watched = not cost.points or predicted > SLOW
        first = self.attempt(method, cells, rtol, max(left, SLOW) if watched else None)
        self.spent += first.seconds
        if first.status == "stopped":
            cost.add(cells, rtol, first.seconds)
        if first.result is None:
            return Row(method, cells, rtol, first.status, first.message)
        cost.add(cells, rtol, first.seconds)
        seconds = [first.seconds]
        wanted = repeats if first.seconds <= SLOW else min(repeats, 2)
        while len(seconds) < wanted and self.spent + seconds[-1] <= share:
            again = self.attempt(method, cells, rtol)
            seconds.append(again.seconds)
            self.spent += again.seconds
        message = f"slow: {len(seconds)} of {repeats} runs" if len(seconds) < repeats else ""
        return Row(method, cells, rtol, "completed", message, tuple(seconds), first.result)

    def references(
        self, methods: Sequence[str], rows: Sequence[Row], wanted: tuple[int, float] | None
    ) -> tuple[Finer | None, Finer | None]:
        """The reference of the fastest method, and one of another."""
        done = [row for row in rows if row.result is not None]
        if not done:
            return None, None
        settings = self._settings(max(row.cells for row in done), min(row.rtol for row in done)) if wanted is None else [wanted]
        able = [method for method in methods if any(row.method == method for row in done)]
        able.sort(key=lambda method: self.costs[method].predict(*settings[0]))
        main = next((found for method in able if (found := self._reference(method, settings, needed=True))), None)
        if main is None:
            return None, None
        others = [method for method in able if method != main.about.method]
        second = next((found for method in others if (found := self._reference(method, settings, needed=False))), None)
        return main, second

    def _settings(self, cells: int, rtol: float) -> list[tuple[int, float]]:
        """Cells and rtol of a reference, the finest first, within what the solver allows."""
        known = specifications(self.scene.model.solver)
        most, least = known["cells"].high, known["rtol"].low
        pairs = [(factor * cells, part * rtol) for factor, part in LADDER]
        return [(count if most is None else min(count, int(most)), tol if least is None else max(tol, least)) for count, tol in pairs]

    def _reference(self, method: str, settings: Sequence[tuple[int, float]], *, needed: bool) -> Finer | None:
        """The finest reference of `method` that the rest of the budget allows; one that is `needed` is run all the same."""
        for cells, rtol in settings:
            predicted, left = self.costs[method].predict(cells, rtol), self.budget - self.spent
            last = (cells, rtol) == settings[-1]
            what = f"{method}, {cells} cells, rtol = {rtol:g}"
            if predicted > left:
                if not last:
                    continue
                if not needed:
                    self.notes.append(
                        f"no reference of {method}: {what} would take about {predicted:.2g} s, {max(left, 0.0):.2g} s are left"
                    )
                    continue
                self.notes.append(f"the reference needed more than the budget: about {predicted:.2g} s, {max(left, 0.0):.2g} s were left")
            self.progress(f"reference: {what}, about {predicted:.2g} s")
            found = self.attempt(method, cells, rtol, None if needed and last else max(left, SLOW))
            self.spent += found.seconds
            if found.result is not None:
                return Finer(Reference(method=method, cells=cells, rtol=rtol, seconds=found.seconds), found.result)
            if found.status == "stopped":
                self.costs[method].add(cells, rtol, found.seconds)
            self.notes.append(f"no reference {what}: {found.status} {found.message}")
        return None
