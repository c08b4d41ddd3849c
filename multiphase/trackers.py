"""What hangs on the time loop: recording and storage, progress, balances, stopping rules."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

import numpy as np

from multiphase import storage
from multiphase.errors import ParameterError
from multiphase.result import Result
from multiphase.stepping import Snapshot, State, StopRun, Tracker

logger = logging.getLogger("multiphase")

WRITING_SHARE = 0.1
"""Largest share of the run's time that goes into writing the file before its end."""


class _Column:
    """Rows of equal shape, one more at a time; those before stay where they are, but for when the space doubles."""

    def __init__(self, rows: Any) -> None:
        self._space = rows

    def put(self, index: int, row: Any) -> None:
        """Write row number `index`, the first that is free."""
        if index >= len(self._space):
            space = np.empty((max(16, 2 * index), *self._space.shape[1:]), dtype=self._space.dtype)
            space[:index] = self._space[:index]
            self._space = space
        self._space[index] = row

    def rows(self, count: int) -> Any:
        """The first `count` rows; later ones do not touch them."""
        return self._space[:count]


class Recorder(Tracker):
    """Keeps what is stored, and the last good state; writes the result file if there is one.

    The whole file is replaced at each output time, unless the last writes took more than a tenth of the time since: a file
    on disk is at every moment a whole one.

    Parameters
    ----------
    result : Result
        The result that grows; on a resumed run it holds what was stored.
    file : Path or None
    fields : tuple of str or None
        Fields to keep; None keeps all.
    """

    def __init__(self, result: Result, file: Path | None, fields: Sequence[str] | None = None) -> None:
        self.result, self.file, self.state = result, file, None if not result.checkpoint else State.from_arrays(result.checkpoint)
        self._wanted = fields
        self._rows: list[Snapshot] = []
        self._count = len(result.t)
        self._columns: dict[tuple[str, str], _Column] = {}
        self._written, self._cost = time.monotonic(), 0.0

    def on_step(self, state: State) -> None:
        self.state = state

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.state = state
        self._rows.append(snapshot)
        self._move()
        if self.file is not None and (time.monotonic() - self._written) * WRITING_SHARE >= self._cost:
            self.write()

    def _move(self) -> None:
        """Move new rows to where they are kept. Ctrl-C may strike anywhere in here: what is left, or half done, is moved the next time."""
        while self._rows:
            snapshot = self._rows[0]
            if not self._count or snapshot.t > self._columns_for(snapshot)["", "t"].rows(self._count)[-1]:
                row = self._by_key(snapshot)
                for key, column in self._columns_for(snapshot).items():
                    column.put(self._count, row[key])
                self._count += 1
            del self._rows[0]

    def _by_key(self, snapshot: Snapshot) -> dict[tuple[str, str], Any]:
        """What is kept of a snapshot, by group and name."""
        row: dict[tuple[str, str], Any] = {("", "t"): snapshot.t} | ({} if snapshot.x is None else {("", "x"): snapshot.x})
        row |= {("scalars", name): value for name, value in snapshot.scalars.items()}
        return row | {("fields", name): value for name, value in snapshot.fields.items() if self._wanted is None or name in self._wanted}

    def _columns_for(self, snapshot: Snapshot) -> dict[tuple[str, str], _Column]:
        """Where rows are kept, made from the stored result and the first of them."""
        if not self._columns:
            result, count, row = self.result, self._count, self._by_key(snapshot)
            stored: dict[tuple[str, str], Any] = {("", "t"): result.t, ("", "x"): result.x}
            stored |= {("scalars", name): values for name, values in result.scalars.items()}
            stored |= {("fields", name): values for name, values in result.fields.items()}
            missing = [name for group, name in row if stored.get((group, name)) is None]
            if count and missing:
                raise ParameterError(missing[0], "is not in the stored result, so the run cannot go on with it.")
            self._columns = {key: _Column(stored[key] if count else np.array([value])[:0]) for key, value in row.items()}
        return self._columns

    def collect(self) -> Result:
        """The result with every row so far and the last good state as its checkpoint."""
        self._move()
        result = self.result
        if self._count > len(result.t):
            values = {key: column.rows(self._count) for key, column in self._columns.items()}
            scalars, fields = ({name: rows for (kind, name), rows in values.items() if kind == group} for group in ("scalars", "fields"))
            result = self.result = replace(result, t=values["", "t"], x=values.get(("", "x")), scalars=scalars, fields=fields)
        if self.state is not None:
            result.checkpoint = self.state.to_arrays()
            result.stats = result.stats | self.state.counters
        return result

    def write(self) -> None:
        """Replace the file by what there is now."""
        if self.file is None:
            return
        started = time.monotonic()
        storage.write(self.collect(), self.file)
        self._written = time.monotonic()
        self._cost = self._written - started


class Progress(Tracker):
    """A progress bar in a terminal; a line every tenth of the run elsewhere.

    Parameters
    ----------
    stream : text stream, optional
        Standard error by default.
    describe : callable(t) -> str, optional
        The time in words, for instance with its unit.
    """

    def __init__(self, stream: TextIO | None = None, describe: Callable[[float], str] = "{:.4g}".format) -> None:
        self._stream = stream if stream is not None else sys.stderr
        self._describe = describe
        self._bar: Any = None
        self._next = 0.1
        self._end = 1.0

    def on_start(self, state: State, t_end: float) -> None:
        self._end = t_end
        self._next = 0.1 * (1 + int(10.0 * state.t / t_end + 1e-9))
        if self._stream.isatty():
            from tqdm import tqdm

            form = "{desc} {percentage:3.0f} % |{bar:30}| {elapsed}, {remaining} to go{postfix}"
            self._bar = tqdm(total=t_end, initial=state.t, file=self._stream, bar_format=form, leave=False, desc="running")

    def on_step(self, state: State) -> None:
        if self._bar is not None:
            self._bar.set_postfix_str(f"t = {self._describe(state.t)}, step {state.counters['steps']}", refresh=False)
            self._bar.update(state.t - self._bar.n)
        elif state.t >= self._next * self._end and state.t < self._end:
            print(
                f"{100.0 * state.t / self._end:3.0f} %  t = {self._describe(state.t)}, {state.counters['steps']} steps", file=self._stream
            )
            self._next = 0.1 * (1 + int(10.0 * state.t / self._end + 1e-9))

    def on_end(self, state: State, status: str, message: str) -> None:
        if self._bar is not None:
            self._bar.close()


class Balances(Tracker):
    """Warns in the log when a balance defect (a scalar called defect_...) exceeds `limit`, once for each; not for those in `left_open`."""

    def __init__(self, limit: float = 1e-9, left_open: Sequence[str] = ()) -> None:
        self.limit, self.left_open = limit, left_open
        self._watched: list[str] | None = None

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        if self._watched is None:
            self._watched = [name for name in snapshot.scalars if name.startswith("defect_") and name not in self.left_open]
        for name in self._watched:
            value = snapshot.scalars[name]
            if not abs(value) <= self.limit:
                self._watched = [other for other in self._watched if other != name]
                logger.warning("%s = %.3g at t = %.6g: this balance should close to %.1g", name, value, snapshot.t, self.limit)


class Interrupts(Tracker):
    """Holds Ctrl-C and SIGTERM back until the step is done.

    The exception that a signal raises in the middle of a step can be lost: FiPy has bare ``except`` clauses (about one in thirty
    was). A second signal acts at once. Used as a context; does nothing outside of the main thread.
    """

    def __init__(self) -> None:
        self._old: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self._pending: int | None = None

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                old = signal.getsignal(number)
                if callable(old):
                    self._old[number] = old
                    signal.signal(number, self._note)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for number, old in self._old.items():
            signal.signal(number, old)
        if kind is None:
            self._act()

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._pending is not None:
            self._old[number](number, frame)
        self._pending = number

    def _act(self) -> None:
        if self._pending is not None:
            number, self._pending = self._pending, None
            self._old[number](number, None)

    def on_start(self, state: State, t_end: float) -> None:
        self._act()

    def on_step(self, state: State) -> None:
        self._act()

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self._act()


class WallTime(Tracker):
    """Stops the run in good order after `seconds` of wall time; it can be resumed."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._start = time.monotonic()

    def on_start(self, state: State, t_end: float) -> None:
        self._start = time.monotonic()

    def on_step(self, state: State) -> None:
        if time.monotonic() - self._start > self.seconds:
            raise StopRun(f"the wall-time limit of {self.seconds:g} s was reached")


class SteadyState(Tracker):
    """Stops the run when nothing changes any more.

    Every stored field and scalar, but the balance defects, must change by less than `tolerance` times its largest value of the run
    per unit of time, from one output time to the next; values below 1e-12 count as zero.
    """

    def __init__(self, tolerance: float = 1e-6) -> None:
        self.tolerance = tolerance
        self._last: Snapshot | None = None
        self._largest: dict[str, float] = {}

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        last, self._last = self._last, snapshot
        if last is None:
            return
        fastest = 0.0
        now: dict[str, Any] = {**snapshot.fields, **snapshot.scalars}
        then: dict[str, Any] = {**last.fields, **last.scalars}
        for name, value in now.items():
            if name.startswith("defect_"):
                continue
            before = then[name]
            scale = max(self._largest.get(name, 0.0), float(np.max(np.abs(value))), float(np.max(np.abs(before))))
            self._largest[name] = scale
            if scale > 1e-12:
                fastest = max(fastest, float(np.max(np.abs(value - before))) / scale / (snapshot.t - last.t))
        if fastest < self.tolerance:
            raise StopRun(f"a steady state was reached (largest relative rate {fastest:.2g} per unit of time)")
