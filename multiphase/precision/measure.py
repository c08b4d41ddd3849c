"""From a scene to a `Study`."""

from __future__ import annotations

import importlib.metadata
import logging
import os
import platform
import statistics
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from multiphase.errors import ParameterError
from multiphase.parameters import float_or_refuse
from multiphase.precision.accuracy import Measurement, errors_between, orders_of, pareto
from multiphase.precision.bench import THREADS, Bench, Finer, Row
from multiphase.precision.options import check_reference, choices
from multiphase.precision.report import Study
from multiphase.run import PACKAGES
from multiphase.scene import Scene

BUDGET = 120.0
INDEPENDENT = 5.0
"""A row is measured against the other method's reference where its error is this many times the difference of the two references."""


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
        `options.CELLS` and `options.RTOLS` by default; every combination is run.
    repeats : int
        Runs of each combination; a run of more than `bench.SLOW` seconds is repeated once only.
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
    check_reference(scene, chosen, reference)
    prepared, notes = _prepared(scene)
    bench = Bench(prepared, budget, progress or (lambda line: None))
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
        machine=f"{platform.platform()}, {platform.machine()}, {_processor()}",
        versions={"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in PACKAGES},
        threads=THREADS,
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


def _compared(scene: Scene) -> tuple[str, ...]:
    """The main field, and the scalars of the first scalar panel that is for this scene."""
    other = "line" if getattr(scene.geometry, "plane", False) else "triangles"
    scalars = next((panel.names for panel in scene.model.panels if panel.kind == "scalar" and panel.grid != other), ())
    return scene.model.film, *scalars


def _measured(row: Row, main: Finer | None, second: Finer | None, difference: float | None, names: Sequence[str]) -> Measurement:
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


def _processor() -> str:
    """The processor and how many the system has."""
    name = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), name)
    except OSError:
        pass
    return f"{name or 'processor unknown'}, {os.cpu_count() or '?'} processors"
