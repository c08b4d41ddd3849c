"""Speed against error: one scene solved by every method at several resolutions and tolerances.

:func:`study` times the runs, measures their errors against a finer run (of another method where there is one) and gives a `Study`:
a table, a CSV file and a picture. It knows no model; it changes the keys ``method``, ``cells`` and ``rtol`` of the scene's [solver].
"""

from __future__ import annotations

import csv
import importlib.metadata
import io
import logging
import math
import os
import platform
import statistics
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multiphase.errors import ParameterError, SolverError
from multiphase.parameters import float_or_refuse, nearest, specifications
from multiphase.result import Array, PathName, Result
from multiphase.run import PACKAGES, run
from multiphase.scene import Scene
from multiphase.stepping import State, StopRun, Tracker

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

CELLS = (25, 50, 100, 200)
RTOLS = (1e-3, 1e-4, 1e-5)
BUDGET = 120.0
SLOW = 2.0
"""Seconds of one run above which it is repeated once only."""
THREADS = 1
INDEPENDENT = 5.0
"""A row is measured against the other method's reference where its error is this many times the difference of the two references."""
LADDER = ((4, 1e-2), (2, 1e-2), (2, 1e-1))
"""Cells and rtol of a reference, as factors of the finest row's; the first that the budget allows is taken."""
FILES = ("precision.txt", "precision.csv", "precision.png")
WIDTH = 118  # characters of the prose around a table
SAME_POSITION = 1e-6  # in relative position: far above rounding, far below a cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One combination of method, cells and rtol.

    Attributes
    ----------
    method : str
    cells : int
    rtol : float
    status : {"completed", "refused", "failed", "stopped", "not run"}
    message : str
        Why there is no error, or fewer repeats than were asked for; empty otherwise.
    seconds : float
        Wall time of one run, the median of `runs`; NaN where none completed.
    runs : int
    error : float
        Of the model's main field, relative; NaN where there is none.
    errors : mapping of str to float
        Relative errors by name: the main field, and the scalars of the model's first scalar panel.
    against : str
        The method of the reference it was measured against.
    steps, iterations : int
    pareto : bool
        No other combination is both as fast and as accurate.
    """

    method: str
    cells: int
    rtol: float
    status: str
    message: str = ""
    seconds: float = math.nan
    runs: int = 0
    error: float = math.nan
    errors: Mapping[str, float] = field(default_factory=dict)
    against: str = ""
    steps: int = 0
    iterations: int = 0
    pareto: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The run that errors are measured against."""

    method: str
    cells: int
    rtol: float
    seconds: float

    def __str__(self) -> str:
        return f"{self.method}, {self.cells} cells, rtol = {self.rtol:g} ({self.seconds:.3g} s)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """How fast the error of one method falls between two neighbouring rows.

    Attributes
    ----------
    method : str
    kind : {"cells", "rtol"}
        What changes, from `coarse` to `fine`.
    fixed : float
        The rtol, or the cells, at which it changes.
    coarse, fine : float
    value : float or None
        The exponent; None where the error is not the one of what changes, or is not above that of the reference.
    """

    method: str
    kind: str
    fixed: float
    coarse: float
    fine: float
    value: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What a study varies, checked: methods, cells (ascending) and tolerances (descending)."""

    methods: tuple[str, ...]
    cells: tuple[int, ...]
    rtols: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What :func:`study` found.

    Attributes
    ----------
    scene : Scene
        As it was given.
    measurements : tuple of Measurement
    reference, second : Reference or None
        The main reference; and one of another method, None where there is none.
    difference : float or None
        By how much the two references differ in the main field: errors below it mean nothing.
    orders : tuple of Order
    notes : tuple of str
        What was left out or changed, in sentences.
    machine : str
        Computer and processor.
    versions : mapping of str to str
    threads : int
    """

    scene: Scene
    measurements: tuple[Measurement, ...]
    reference: Reference | None
    second: Reference | None
    difference: float | None
    orders: tuple[Order, ...]
    notes: tuple[str, ...]
    machine: str
    versions: Mapping[str, str]
    threads: int

    def table(self) -> str:
        """The study as aligned text."""
        head = [f"{self.scene.title or self.scene.name}: speed against error", *self.about()]
        rows = [_headings(self.measurements), *(_cells_of(row, _names(self.measurements)) for row in self.measurements)]
        floored = "" if self.difference is None else " (errors below the difference of the references count as equal)"
        body = [*_aligned(rows), f"* no other row is both as fast and as accurate{floored}"]
        tail = [*_order_lines(self.orders), *self.notes, *self.setting()]
        return "\n\n".join("\n".join(_wrapped(part) if part is not body else part) for part in (head, body, tail)) + "\n"

    def about(self) -> list[str]:
        """What the errors are, and what they are measured against."""
        name = self.scene.model.film
        lines = [
            f"error of {name}: mean over the cells of the difference of cell averages, the largest over the stored times, over the largest "
            f"|{name}|; of a scalar: the largest over the times, over its largest value; seconds: wall time of one run, median of the runs"
        ]
        if self.reference is None:
            return [*lines, "no reference: there are no errors"]
        if self.second is None:
            return [*lines, f"reference: {self.reference}, alone, so that its own error is not seen"]
        floor = f"the two differ by {self.difference:.2g} in {name}, and errors below that mean nothing"
        return [*lines, f"references: {self.reference}; second: {self.second}; {floor}"]

    def setting(self) -> list[str]:
        """Machine, versions and threads, in two lines."""
        versions = ", ".join(f"{name} {version}" for name, version in self.versions.items())
        return [f"machine: {self.machine}", f"versions: {versions}; {self.threads} thread{'s' if self.threads != 1 else ''}"]

    def to_csv(self, path: PathName) -> None:
        """Write one row for each measurement, numbers in full; lines that start with ``#`` say how they were made."""
        from multiphase.storage import replace_file

        names = _names(self.measurements)
        text = io.StringIO()
        for line in (self.scene.title or self.scene.name, *self.about(), *self.notes, *self.setting()):
            text.write(f"# {line}\n")
        writer = csv.writer(text, lineterminator="\n")
        plain = ("method", "cells", "rtol", "status", "seconds", "runs", "against", "steps", "iterations")
        writer.writerow([*plain, *(f"error_{name}" for name in names), "pareto", "message"])
        for row in self.measurements:
            errors = [repr(row.errors[name]) if name in row.errors else "" for name in names]
            values = ["" if value != value else value for value in (getattr(row, name) for name in plain)]
            writer.writerow([*values, *errors, int(row.pareto), row.message])
        replace_file(Path(path), text.getvalue().encode("utf-8"))

    def figure(self) -> Figure:
        """Error against wall time on logarithmic axes, as a `matplotlib.figure.Figure`."""
        return _draw(self)

    def save(self, directory: PathName) -> tuple[Path, ...]:
        """Write the table, the CSV file and the picture into `directory`, which is made if need be, and return their paths."""
        import matplotlib

        from multiphase.plotting import STYLE, replacing
        from multiphase.storage import replace_file

        folder = Path(directory)
        folder.mkdir(exist_ok=True)
        table, rows, picture = (folder / name for name in FILES)
        replace_file(table, self.table().encode("utf-8"))
        self.to_csv(rows)
        with replacing(picture) as part, matplotlib.rc_context(STYLE):
            self.figure().savefig(part, format="png", dpi=200)
        return table, rows, picture


# -- what to run ------------------------------------------------------------------------------------------------------


def choices(
    scene: Scene, *, methods: Sequence[str] | None = None, cells: Sequence[int] | None = None, rtols: Sequence[float] | None = None
) -> Choices:
    """Check what a study of `scene` is to vary, and fill in the defaults; nothing is run.

    Raises
    ------
    ParameterError
        For an unknown method (naming the nearest), for cells or an rtol that no run can have, and for a model without these keys.
    """
    known = specifications(scene.model.solver)
    for key in ("method", "cells", "rtol"):
        if key not in known:
            raise ParameterError(f"solver.{key}", f"the model {scene.model.name} has no such key, so a study cannot vary it.")
    every = tuple(choice for choice in known["method"].choices if choice != "auto")
    chosen = every if methods is None else tuple(dict.fromkeys(methods))
    for name in chosen:
        if name not in every:
            text = f'the model {scene.model.name} has no method "{name}"{nearest(str(name), every)} It has {", ".join(every)}.'
            raise ParameterError("methods", text)
    counts = sorted({int(value) for value in _allowed(scene, "cells", CELLS if cells is None else cells, "cells")})
    tolerances = sorted(set(_allowed(scene, "rtol", RTOLS if rtols is None else rtols, "rtols")), reverse=True)
    if not chosen or not counts or not tolerances:
        raise ParameterError("", "there is nothing to run: give at least one method, one number of cells and one rtol.")
    return Choices(methods=chosen, cells=tuple(counts), rtols=tuple(tolerances))


def _allowed(scene: Scene, key: str, values: Sequence[float], path: str) -> list[float]:
    """`values` as the solver allows them for its `key`."""
    known = specifications(scene.model.solver)[key]
    found = []
    for value in values:
        number = float_or_refuse(value, path)
        if not known.allows(number) or (known.kind == "integer" and number != int(number)):
            raise ParameterError(path, f"{value:.15g} is not allowed; {known.doc} must be {known.expected}.")
        found.append(number)
    return found


def parse_list(text: str, name: str, kind: type[int] | type[float] | type[str] = str) -> list[Any]:
    """The values of a text such as ``25,50,100``; raises ParameterError at `name`."""
    found = []
    for part in (part.strip() for part in text.split(",")):
        try:
            if not part:
                raise ValueError
            found.append(kind(part))
        except ValueError:
            what = {int: "a whole number", float: "a number", str: "a name"}[kind]
            example = {int: "25,50,100", float: "1e-3,1e-4", str: "fipy,lines"}[kind]
            raise ParameterError(name, f'"{part}" is not {what}; the form is {name} {example}, for instance.') from None
    return found


def check_folder(folder: Path) -> None:
    """Refuse, before any work, a folder that the files of a study cannot be written to; nothing is made."""
    from multiphase.storage import check_target

    if folder.is_dir():
        for name in FILES:
            check_target(folder / name, "-o")
    elif folder.exists():
        raise ParameterError("-o", f"{folder} is a file; the results of a study need a folder.")
    else:
        check_target(folder, "-o")


# -- the study --------------------------------------------------------------------------------------------------------


def study(
    scene: Scene,
    *,
    methods: Sequence[str] | None = None,
    cells: Sequence[int] | None = None,
    rtols: Sequence[float] | None = None,
    repeats: int = 5,
    reference: tuple[int, float] | None = None,
    budget: float = BUDGET,
    progress: Callable[[str], None] | None = None,
) -> Study:
    """Measure speed and error of every method on `scene`.

    Parameters
    ----------
    scene : Scene
        Its method, cells, rtol and stored times do not matter; a fixed step ``dt`` is set aside.
    methods : sequence of str, optional
        Choices of ``solver.method``; all but "auto" by default.
    cells, rtols : sequence of number, optional
        `CELLS` and `RTOLS` by default; every combination is run.
    repeats : int
        Runs of each combination; a run of more than `SLOW` seconds is repeated once only.
    reference : (int, float), optional
        Cells and rtol of the references. By default 4 times (2 times where that is too slow) the largest cells, and a hundredth of
        the smallest rtol.
    budget : float
        Seconds for all runs after the warm-up. Half is for the rows: a combination that would take more than what is left is not run.
        The main reference is needed, whatever it takes.
    progress : callable(str), optional
        Called with a line before each run.

    Returns
    -------
    Study

    Raises
    ------
    ParameterError
        A value that cannot be used, before any work starts; a main field that does not stand on equal cells of an interval.
        A combination that the model refuses is a row of the study.
    """
    chosen = choices(scene, methods=methods, cells=cells, rtols=rtols)
    if repeats < 1:
        raise ParameterError("repeats", f"{repeats} is not allowed; it must be 1 or more.")
    if float_or_refuse(budget, "budget") <= 0.0:
        raise ParameterError("budget", f"{budget:g} s is not allowed; it must be greater than 0.")
    _check_reference(scene, chosen, reference)
    prepared, notes = _prepared(scene)
    bench = _Bench(prepared, budget, progress or (lambda line: None))
    with _warnings_once():
        rows = bench.rows(chosen, repeats)
        main, second = bench.references(chosen.methods, rows, reference)
    notes += bench.notes
    difference = (
        None if main is None or second is None else errors_between(main.result, second.result, (scene.model.film,))[scene.model.film]
    )
    measured = [_measured(row, main, second, difference, _compared(scene)) for row in rows]
    best = pareto([row.seconds for row in measured], [row.error for row in measured], difference or 0.0)
    measured = [replace(row, pareto=flag) for row, flag in zip(measured, best, strict=True)]
    return Study(
        scene=scene,
        measurements=tuple(measured),
        reference=None if main is None else main.about,
        second=None if second is None else second.about,
        difference=difference,
        orders=orders_of(measured, difference or 0.0),
        notes=tuple(notes),
        machine=f"{platform.platform()}, {platform.machine()}, {processor()}",
        versions={"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in PACKAGES},
        threads=THREADS,
    )


def _check_reference(scene: Scene, chosen: Choices, reference: tuple[int, float] | None) -> None:
    """Refuse a reference that is not finer than every row."""
    if reference is None:
        return
    _allowed(scene, "cells", reference[:1], "reference")
    _allowed(scene, "rtol", reference[1:], "reference")
    if reference[0] < 2 * chosen.cells[-1] or reference[1] >= chosen.rtols[-1]:
        raise ParameterError(
            "reference",
            f"{reference[0]} cells and rtol = {reference[1]:g} are not fine enough; take at least {2 * chosen.cells[-1]} cells and an rtol "
            f"below {chosen.rtols[-1]:g}.",
        )


def _prepared(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with few stored times, no file and steps that follow rtol; and what has to be said about that."""
    end, notes = scene.time.end, []
    changes: dict[str, Any] = {
        "time": {"save_at": [0.0, 0.25 * end, 0.5 * end, 0.75 * end, end]},
        "output": {"file": None, "vtk": False, "fields": (scene.model.film,)},
    }
    fixed = getattr(scene.solver, "dt", None)
    if fixed is not None:
        changes["solver"] = {"dt": None}
        notes.append(f"the fixed step of the scene, dt = {fixed:g}, is set aside: the steps follow rtol")
    return scene.with_changes(**changes), notes


class _Once(logging.Filter):
    """Lets every message through once."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        text = record.getMessage()
        new = text not in self.seen
        self.seen.add(text)
        return new


@contextmanager
def _warnings_once() -> Iterator[None]:
    """A scene that is run many times warns once."""
    log, once = logging.getLogger("multiphase"), _Once()
    log.addFilter(once)
    try:
        yield
    finally:
        log.removeFilter(once)


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


@dataclass(frozen=True, slots=True)
class _Run:
    """How one run ended; `result` only where it completed."""

    status: str
    message: str
    seconds: float
    result: Result | None


@dataclass(frozen=True, slots=True)
class _Row:
    method: str
    cells: int
    rtol: float
    status: str
    message: str = ""
    seconds: tuple[float, ...] = ()
    result: Result | None = None


@dataclass(frozen=True, slots=True)
class _Finer:
    about: Reference
    result: Result


class _Bench:
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

    def rows(self, chosen: Choices, repeats: int) -> list[_Row]:
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
            _equal_cells(self.scene.model.film, found.result)
        if found.status == "stopped":
            self.costs[method].hopeless = True
            self.notes.append(f"{method}: the first run had not ended after {limit:.3g} s, so this method was left out")

    def row(self, method: str, cells: int, rtol: float, repeats: int, share: float) -> _Row:
        """Time one combination, unless that would take more than what is left of `share`."""
        cost = self.costs[method]
        predicted, left = cost.predict(cells, rtol), share - self.spent
        if predicted > left:
            why = f"would take about {predicted:.2g} s, {max(left, 0.0):.2g} s left of the {share:.3g} s for rows"
            return _Row(method, cells, rtol, "not run", "the first run had not ended in time" if cost.hopeless else why)
        self.progress(f"{method}: {cells} cells, rtol = {rtol:g}")
        watched = not cost.points or predicted > SLOW
        first = self.attempt(method, cells, rtol, max(left, SLOW) if watched else None)
        self.spent += first.seconds
        if first.status == "stopped":
            cost.add(cells, rtol, first.seconds)
        if first.result is None:
            return _Row(method, cells, rtol, first.status, first.message)
        cost.add(cells, rtol, first.seconds)
        seconds = [first.seconds]
        wanted = repeats if first.seconds <= SLOW else min(repeats, 2)
        while len(seconds) < wanted and self.spent + seconds[-1] <= share:
            again = self.attempt(method, cells, rtol)
            seconds.append(again.seconds)
            self.spent += again.seconds
        message = f"slow: {len(seconds)} of {repeats} runs" if len(seconds) < repeats else ""
        return _Row(method, cells, rtol, "completed", message, tuple(seconds), first.result)

    def references(
        self, methods: Sequence[str], rows: Sequence[_Row], wanted: tuple[int, float] | None
    ) -> tuple[_Finer | None, _Finer | None]:
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

    def _reference(self, method: str, settings: Sequence[tuple[int, float]], *, needed: bool) -> _Finer | None:
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
                return _Finer(Reference(method=method, cells=cells, rtol=rtol, seconds=found.seconds), found.result)
            if found.status == "stopped":
                self.costs[method].add(cells, rtol, found.seconds)
            self.notes.append(f"no reference {what}: {found.status} {found.message}")
        return None


# -- errors -----------------------------------------------------------------------------------------------------------


def cell_averages(values: Array, cells: int) -> Array:
    """Averages over `cells` equal cells of values that are averages over equal cells of the same interval, along the last axis.

    Exact for what is constant on each cell, so that the total is kept, also where one number of cells is no multiple of the other.
    """
    fine = values.shape[-1]
    if fine % cells == 0:
        return np.asarray(values.reshape(*values.shape[:-1], cells, fine // cells).mean(axis=-1))
    edges = np.arange(cells + 1) * (fine / cells)
    below = np.minimum(edges.astype(int), fine - 1)
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
    at_edges = total[..., below] + (edges - below) * values[..., below]
    return np.asarray(np.diff(at_edges, axis=-1) * (cells / fine))


def errors_between(a: Result, b: Result, names: Sequence[str]) -> dict[str, float]:
    """Relative differences of `a` from `b`, by name: fields after t = 0 in the mean over cells, scalars, each at the worst time."""
    found = {}
    for name in names:
        mine, other = np.asarray(a[name], dtype=float), np.asarray(b[name], dtype=float)
        distance = np.abs(mine - other) if mine.ndim == 1 else _field_distance(name, a, b)
        largest = float(np.max(np.abs(other)))
        found[name] = float(np.max(distance[a.t > 0])) / (largest or 1.0)
    return found


def _field_distance(name: str, a: Result, b: Result) -> Array:
    """Mean over the coarser cells of the difference of cell averages, at each time."""
    first, second = _equal_cells(name, a), _equal_cells(name, b)
    cells = min(first.shape[1], second.shape[1])
    return np.asarray(np.mean(np.abs(cell_averages(first, cells) - cell_averages(second, cells)), axis=1))


def _equal_cells(name: str, result: Result) -> Array:
    """Values of a field on equal cells of an interval; raises ParameterError for another mesh."""
    values = np.asarray(result[name], dtype=float)
    width = result.width() if values.ndim == 2 and result.x is not None else None
    if values.ndim == 2 and result.x is not None and width is not None:
        middle = (np.arange(values.shape[1]) + 0.5) / values.shape[1]
        if result.x.shape == values.shape and np.allclose(result.x / width[:, None], middle, rtol=0.0, atol=SAME_POSITION):
            return values
    raise ParameterError(name, "this field does not stand on equal cells of an interval, and a study measures errors on those only.")


def _compared(scene: Scene) -> tuple[str, ...]:
    """The main field, and the scalars of the first scalar panel."""
    scalars = next((panel.names for panel in scene.model.panels if panel.kind == "scalar"), ())
    return scene.model.film, *scalars


def _measured(row: _Row, main: _Finer | None, second: _Finer | None, difference: float | None, names: Sequence[str]) -> Measurement:
    """A row with its errors, against the other method's reference where that one is good enough."""
    plain = Measurement(method=row.method, cells=row.cells, rtol=row.rtol, status=row.status, message=row.message)
    if row.result is None:
        return plain
    stats = row.result.stats
    plain = replace(
        plain,
        seconds=statistics.median(row.seconds),
        runs=len(row.seconds),
        steps=int(stats.get("steps", 0)),
        iterations=int(stats.get("iterations", 0)),
    )
    if main is None:
        return plain
    names = [name for name in names if name in row.result and name in main.result]
    errors, against = errors_between(row.result, main.result, names), main.about.method
    same = row.method == main.about.method
    if second is not None and difference is not None and same and errors[names[0]] >= INDEPENDENT * difference:
        errors, against = errors_between(row.result, second.result, names), second.about.method
    return replace(plain, error=errors[names[0]], errors=errors, against=against)


def pareto(seconds: Sequence[float], errors: Sequence[float], floor: float = 0.0) -> list[bool]:
    """Which entries no other one beats: none is as fast and as accurate, and better in one of the two.

    Errors below `floor` count as equal; entries that are not numbers are never among them.
    """
    points = [(second, max(error, floor)) if math.isfinite(second + error) else None for second, error in zip(seconds, errors, strict=True)]

    def beats(other: tuple[float, float] | None, point: tuple[float, float]) -> bool:
        return other is not None and other != point and other[0] <= point[0] and other[1] <= point[1]

    return [point is not None and not any(beats(other, point) for other in points) for point in points]


def orders_of(rows: Sequence[Measurement], floor: float = 0.0) -> tuple[Order, ...]:
    """Observed orders between neighbouring rows: in the cells at the smallest rtol, and in rtol at the largest cells.

    Where the heavier rows are missing: at the smallest rtol, and the largest cells, that two rows have.
    """
    found: list[Order] = []
    for method in dict.fromkeys(row.method for row in rows):
        errors = {(row.cells, row.rtol): row.error for row in rows if row.method == method and math.isfinite(row.error)}
        by_rtol = ((rtol, sorted(count for count, other in errors if other == rtol)) for rtol in sorted({rtol for _, rtol in errors}))
        rtol, cells = next(((rtol, cells) for rtol, cells in by_rtol if len(cells) > 1), (math.nan, []))
        for coarse, fine in pairwise(cells):
            order = _order_in_cells(errors, coarse, fine, rtol, floor)
            found.append(Order(method=method, kind="cells", fixed=rtol, coarse=coarse, fine=fine, value=order))
        counts = sorted({count for count, _ in errors}, reverse=True)
        by_count = ((count, sorted((rtol for other, rtol in errors if other == count), reverse=True)) for count in counts)
        most, rtols = next(((count, rtols) for count, rtols in by_count if len(rtols) > 1), (0, []))
        for loose, tight in pairwise(rtols):
            order = _order_in_rtol(errors, most, loose, tight, floor)
            found.append(Order(method=method, kind="rtol", fixed=most, coarse=loose, fine=tight, value=order))
    return tuple(found)


def _order_in_cells(errors: Mapping[tuple[int, float], float], coarse: int, fine: int, rtol: float, floor: float) -> float | None:
    before, after = errors[coarse, rtol], errors[fine, rtol]
    return math.log(before / after) / math.log(fine / coarse) if before > 0.0 and after > floor else None


def _order_in_rtol(errors: Mapping[tuple[int, float], float], cells: int, coarse: float, fine: float, floor: float) -> float | None:
    """The order in rtol, if fewer cells hardly change the error: by less than half an order, so that the error is one of the steps."""
    before, after = errors[cells, coarse], errors[cells, fine]
    fewer = max((count for count, rtol in errors if rtol == fine and count < cells), default=None)
    if fewer is None or before <= 0.0 or after <= floor or errors[fewer, fine] > after * math.sqrt(cells / fewer):
        return None
    return math.log(before / after) / math.log(coarse / fine)


def processor() -> str:
    """The processor and how many the system has."""
    name = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), name)
    except OSError:
        pass
    return f"{name or 'processor unknown'}, {os.cpu_count() or '?'} processors"


# -- the table --------------------------------------------------------------------------------------------------------


def _names(rows: Sequence[Measurement]) -> list[str]:
    """Names of all errors, in order."""
    return list(dict.fromkeys(name for row in rows for name in row.errors))


def _headings(rows: Sequence[Measurement]) -> list[str]:
    errors = [f"error {name}" for name in _names(rows)]
    return ["", "method", "cells", "rtol", "seconds", "runs", *errors, "against", "steps", "iterations", "remark"]


def _cells_of(row: Measurement, names: Sequence[str]) -> list[str]:
    """One row of the table as texts."""
    errors = [f"{row.errors[name]:.2e}" if name in row.errors else "-" for name in names]
    done = row.status == "completed"
    remark = row.message if done else textwrap.shorten(f"{row.status}: {row.message}", 160, placeholder=" ...")
    counts = [str(row.steps), str(row.iterations)] if done else ["-", "-"]
    seconds = f"{row.seconds:.3g}" if done else "-"
    runs = str(row.runs) if done else "-"
    return [
        "*" if row.pareto else "",
        row.method,
        str(row.cells),
        f"{row.rtol:g}",
        seconds,
        runs,
        *errors,
        row.against or "-",
        *counts,
        remark,
    ]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns of equal width, numbers to the right; the remark is not padded."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = {0, 1, rows[0].index("against"), len(widths) - 1}
    lines = []
    for row in rows:
        texts = [f"{text:<{width}}" if i in left else f"{text:>{width}}" for i, (text, width) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(texts).rstrip())
    return lines


def _order_lines(orders: Sequence[Order]) -> list[str]:
    """Observed orders, one line for each method and kind."""
    lines: dict[tuple[str, str], str] = {}
    for order in orders:
        at = f"in the cells, at rtol = {order.fixed:g}:" if order.kind == "cells" else f"in rtol, at {order.fixed:g} cells:"
        line = lines.setdefault((order.method, order.kind), f"{order.method}, observed order {at}")
        value = "-" if order.value is None else f"{order.value:.2f}"
        comma = "" if line.endswith(":") else ","
        lines[order.method, order.kind] = f"{line}{comma} {value} ({order.coarse:g} to {order.fine:g})"
    return list(lines.values())


def _wrapped(lines: Sequence[str]) -> list[str]:
    return [part for line in lines for part in textwrap.wrap(line, WIDTH, subsequent_indent="  ", break_on_hyphens=False)]


# -- the picture ------------------------------------------------------------------------------------------------------

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # told apart by colour-blind eyes
MARKERS = ("o", "s", "^", "D", "v", "P")


def _draw(study: Study) -> Figure:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure, SubFigure

    from multiphase.plotting import STYLE, TITLE_WIDTH

    with matplotlib.rc_context(STYLE):
        picture = Figure(figsize=(7.0, 5.2), layout="constrained")
        FigureCanvasAgg(picture)
        body: SubFigure = picture.subfigures(1, 1, squeeze=True)  # type: ignore[assignment]
        axes = body.add_subplot()
        rows = [row for row in study.measurements if row.seconds > 0.0 and row.error > 0.0]
        if rows:
            handles = _draw_rows(axes, rows, study.difference)
            body.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, title="numbers beside the points: cells")
        else:
            axes.text(0.5, 0.5, "no run has an error to show", transform=axes.transAxes, ha="center", va="center")
        name = study.scene.model.film
        quantity = study.scene.model.quantities.get(name)
        axes.set_xlabel("wall time of one run [s]")
        axes.set_ylabel(f"error of {f'${quantity.symbol}$' if quantity else name}, relative (mean over cells, largest over times)")
        title = f"{study.scene.title or study.scene.name}: speed against error"
        picture.suptitle(textwrap.fill(title, TITLE_WIDTH), parse_math=False)
        footer = [textwrap.fill(line, 120) for line in (*study.about()[1:], *study.setting())]
        picture.supxlabel("\n".join(footer), parse_math=False, fontsize=6.5, color="0.3")
    return picture


def _draw_rows(axes: Axes, rows: Sequence[Measurement], difference: float | None) -> list[Line2D]:
    """Lines of equal rtol in the colour of their method, the Pareto front beneath them, and the floor; returns the legend's lines."""
    from matplotlib.lines import Line2D

    from multiphase.plotting import LINE_STYLES

    axes.set_xscale("log")
    axes.set_yscale("log")
    methods, rtols = list(dict.fromkeys(row.method for row in rows)), sorted({row.rtol for row in rows}, reverse=True)
    front = sorted((row for row in rows if row.pareto), key=lambda row: row.seconds)
    axes.step([row.seconds for row in front], [row.error for row in front], where="post", color="0.8", linewidth=5, zorder=1, label="front")
    handles = []
    for i, method in enumerate(methods):
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "marker": MARKERS[i % len(MARKERS)], "markersize": 5}
        handles.append(Line2D([], [], linestyle="", label=method, **style))
        for j, rtol in enumerate(rtols):
            line = [row for row in rows if row.method == method and row.rtol == rtol]
            style["linestyle"] = LINE_STYLES[j % len(LINE_STYLES)]
            axes.plot([row.seconds for row in line], [row.error for row in line], label=f"{method}, rtol = {rtol:g}", **style)
            if j == 0:
                _name_cells(axes, line)
    handles += [
        Line2D([], [], color="black", linestyle=LINE_STYLES[j % len(LINE_STYLES)], label=f"rtol = {rtol:g}") for j, rtol in enumerate(rtols)
    ]
    handles.append(Line2D([], [], color="0.8", linewidth=5, label="Pareto front"))
    if difference:
        axes.axhline(difference, color="black", linewidth=0.8, linestyle=(0, (1, 3)))
        handles.append(Line2D([], [], color="black", linewidth=0.8, linestyle=(0, (1, 3)), label="difference of the references"))
    axes.set_axisbelow(True)
    axes.grid(which="major", color="0.92", linewidth=0.6)
    return handles


def _name_cells(axes: Axes, line: Sequence[Measurement]) -> None:
    """Write the number of cells beside the points of one line."""
    for row in line:
        axes.annotate(str(row.cells), (row.seconds, row.error), xytext=(4, 4), textcoords="offset points", fontsize=7, color="0.3")
