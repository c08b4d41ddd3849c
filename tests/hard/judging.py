"""What the hard cases of all models share: what is stated of a case beforehand, and the judge of what it did.

A model's cases are subclasses of `Stated`, which say what their scene is, what holds of every stored time, and what the error in time is.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from multiphase.errors import ParameterError, SolverError
from multiphase.result import Result
from multiphase.run import run
from multiphase.scene import Scene

SHARP = 1e-7
"""Tolerance of the runs that errors in time are measured against."""
ROUNDING = 1e-11
"""Of the balances of some 1000 steps."""

Check = Callable[[Result, Scene], str]
"""Says what is wrong, or nothing."""


@dataclass(frozen=True)
class Limit:
    """Something that is known of the answer: words for the table, and the check."""

    words: str
    check: Check


def number(words: str, name: str, expected: float, within: float, row: int = -1) -> Limit:
    """A scalar at a stored time, the last one by default, within an absolute error."""

    def check(result: Result, scene: Scene) -> str:
        value = float(result[name][row])
        return "" if abs(value - expected) <= within else f"{words}: {name} = {value:.8g}, not {expected:.8g} to {within:.1e}"

    return Limit(words, check)


def throughout(words: str, name: str, expected: float | None, within: float) -> Limit:
    """A scalar or a field that keeps its value, `expected` or that of the start, relative to it."""

    def check(result: Result, scene: Scene) -> str:
        values = result[name]
        kept = values[0] if expected is None else np.full_like(values[0], expected)
        worst = float(np.abs(values / kept - 1.0).max())
        return "" if worst <= within else f"{words}: {name} strays by {worst:.1e} of {kept.flat[0]:.6g}"

    return Limit(words, check)


def alike(words: str, other: Callable[[Scene], Scene], within: float, names: Sequence[str]) -> Limit:
    """Scalars equal at the end to those of the scene that `other` makes of this one, relative to them."""

    def check(result: Result, scene: Scene) -> str:
        reference = run(other(scene))
        worst = max((abs(float(result[name][-1] / reference[name][-1]) - 1.0), name) for name in names)
        return "" if worst[0] <= within else f"{words}: {worst[1]} differs by {worst[0]:.1e}, more than {within:.1e}"

    return Limit(words, check)


@dataclass(frozen=True, kw_only=True)
class Stated(ABC):
    """A scene and what it must do.

    Attributes
    ----------
    must : "finishes", "refuses", "fails" or "ends"
        "ends" may finish or fail.
    words : tuple of str
        What the refusal or the failure says.
    path : str
        Dotted path of the refusal.
    warns : tuple of str
        Words of the warnings that must come, each in one of them; and no others.
    may_warn : tuple of str
        Words of others that may come.
    limits : tuple of Limit
        Of a case that finishes.
    most : int
        Bound on steps and rejected steps together.
    accuracy : float
        The rtol that errors in time are judged by; 0 takes the scene's, infinity does not judge.
    sharp : float
        Tolerance of the run to compare with.
    reached, until : float
        Time that a failing case must have stored, and that it must not reach.
    """

    must: str = "finishes"
    words: tuple[str, ...] = ()
    path: str = ""
    warns: tuple[str, ...] = ()
    may_warn: tuple[str, ...] = ()
    limits: tuple[Limit, ...] = ()
    most: int = 600
    accuracy: float = 0.0
    sharp: float = SHARP
    reached: float = 0.0
    until: float = float("inf")

    defects: ClassVar[tuple[str, ...]]
    """Names of the balances."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the case is called; no other is called so."""

    @abstractmethod
    def load(self) -> Scene:
        """The scene; raises ParameterError where it is refused."""

    @abstractmethod
    def wrong_rows(self, result: Result, scene: Scene) -> list[str]:
        """Which of the model's invariants do not hold in what is stored."""

    @abstractmethod
    def time_error(self, result: Result, scene: Scene) -> float:
        """The largest error against the same grid at a far smaller tolerance, in units of what is allowed; NaN where it is not judged."""

    @property
    def statement(self) -> str:
        """What must happen, in words."""
        if self.must == "refuses":
            return f"refuses at {self.path}"
        ends = {"finishes": "finishes", "ends": "finishes or fails", "fails": "fails"}[self.must]
        if self.must == "fails" and np.isfinite(self.until):
            ends += f" before t = {self.until:g}" if self.until > 0.0 else " at t = 0"
        elif self.must == "fails":
            ends += f" after t = {self.reached:g}"
        said = [f'"{word}"' for word in self.words]
        return "; ".join([" with ".join([ends, *said]), *("warns" for _ in self.warns[:1]), *(limit.words for limit in self.limits)])


@dataclass
class Outcome:
    """What a case did, and what of that is wrong."""

    did: str = ""
    wrong: list[str] = field(default_factory=list)
    result: Result | None = None
    cost: tuple[int, int] = (0, 0)
    error: float = float("nan")
    """The largest error in time, in units of what is allowed."""
    defect: float = float("nan")
    """The largest of the balances, over all stored times."""
    seconds: float = 0.0


class _Listener(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def judge(case: Stated) -> Outcome:
    """Run a case and say what it did."""
    listener = _Listener()
    logger = logging.getLogger("multiphase")
    logger.addHandler(listener)
    try:
        return _judge(case, listener.said)
    finally:
        logger.removeHandler(listener)


def _judge(case: Stated, said: list[str]) -> Outcome:
    """The same; `said` fills with warnings, at last with those of the runs to compare with."""
    outcome = Outcome()
    started = time.perf_counter()
    try:
        scene = case.load()
        result = run(scene, raise_on_failure=False)
    except ParameterError as refusal:
        outcome.did = f"refused at {refusal.path}"
        if case.must != "refuses" or refusal.path != case.path or not all(word in str(refusal) for word in case.words):
            outcome.wrong.append(f"refused: {refusal}")
        return outcome
    except SolverError as failure:  # before there is anything to store
        outcome.did = f"failed at t = {failure.time:.3g}"
        outcome.wrong += _wrong_failure(case, str(failure), failure.time) + _wrong_warnings(case, said)
        return outcome
    finally:
        outcome.seconds = time.perf_counter() - started
    stats = result.stats
    outcome.result, outcome.cost = result, (stats["steps"], stats["rejected_error"] + stats["rejected_solver"])
    outcome.did = "finished" if result.status == "completed" else f"failed at t = {_time_of(result):.3g}"
    outcome.defect = max(float(np.abs(result[name]).max()) for name in case.defects)
    outcome.wrong += _wrong_end(case, result) + _wrong_warnings(case, said) + case.wrong_rows(result, scene)
    if sum(outcome.cost) > case.most:
        outcome.wrong.append(f"{outcome.cost[0]} steps and {outcome.cost[1]} rejected, more than {case.most} together")
    if result.status == "completed":
        try:
            outcome.wrong += [words for limit in case.limits if (words := limit.check(result, scene))]
            outcome.error = case.time_error(result, scene) if np.isfinite(case.accuracy) else float("nan")
        except SolverError as failure:
            outcome.wrong.append(f"a run to compare with failed: {failure}")
        if outcome.error > 1.0:
            outcome.wrong.append(f"the error in time is {outcome.error:.2g} times what is allowed")
    return outcome


def _time_of(result: Result) -> float:
    """The last state that is kept, stored or not."""
    return float(result.checkpoint["times"][0]) if result.checkpoint else -1.0


def _wrong_end(case: Stated, result: Result) -> list[str]:
    """Whether it ended as it must."""
    if result.status == "completed":
        return [] if case.must in ("finishes", "ends") else ["it finished"]
    if case.must not in ("fails", "ends"):
        return [f"it {result.status}: {result.message}"]
    reached = _time_of(result)
    wrong = _wrong_failure(case, result.message, reached)
    if not result.t[-1] >= case.reached:
        wrong.append(f"only t = {result.t[-1]:g} is kept")
    if f"Everything up to t = {reached:.6g} is kept" not in result.message:
        wrong.append(f"the state at t = {reached:.6g} is kept, but the message says otherwise: {result.message}")
    return wrong


def _wrong_failure(case: Stated, message: str, reached: float) -> list[str]:
    """Whether a failure was to come, says what it must and comes early enough."""
    if case.must not in ("fails", "ends"):
        return [f"it failed: {message}"]
    wrong = [f'the failure does not say "{word}": {message}' for word in case.words if word not in message]
    return wrong + ([] if reached <= case.until else [f"it went on to t = {reached:g}, beyond {case.until:g}"])


def _wrong_warnings(case: Stated, said: list[str]) -> list[str]:
    """Warnings that are missing or were not expected."""
    missing = [f'no warning says "{word}"' for word in case.warns if not any(word in line for line in said)]
    return missing + [f"it warns: {line}" for line in said if not any(word in line for word in (*case.warns, *case.may_warn))]


def not_finite(result: Result, *, but: Sequence[str] = ()) -> list[str]:
    """Which stored values are not finite."""
    stored = {**result.scalars, **result.fields}
    return [f"{name} is not finite" for name, values in stored.items() if name not in but and not np.isfinite(values).all()]


def open_balances(case: Stated, result: Result, most: float = ROUNDING) -> list[str]:
    """Which balance does not close."""
    defects = {name: float(np.abs(result[name]).max()) for name in case.defects}
    return [f"a defect of {value:.1e}: {name}" for name, value in defects.items() if not value <= most]
