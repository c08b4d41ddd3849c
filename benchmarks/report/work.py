"""One measurement of error and time, and what follows from many: equal error, observed orders, the Pareto front."""

from __future__ import annotations

import logging
import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeVar

from benchmarks.report.tables import Row
from multiphase.precision.accuracy import pareto

T = TypeVar("T")
LOG = logging.getLogger(__name__)
REPEATS = ((0.1, 9), (1.0, 5), (8.0, 3), (math.inf, 1))
"""How often a run is repeated, by the seconds that it takes at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """A run: its problem, the code, its size (cells or rings) and setting, its error (the largest of the named ones), and its cost."""

    problem: str
    code: str
    size: int
    setting: str
    seconds: float
    runs: int
    errors: Mapping[str, float]
    steps: int | None = None
    iterations: int | None = None
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def error(self) -> float:
        return max(self.errors.values())

    def row(self) -> Row:
        names = ("problem", "code", "size", "setting", "seconds", "runs", "steps", "iterations", "error")
        plain = {name: getattr(self, name) for name in names}
        return plain | {f"error_{name}": value for name, value in self.errors.items()} | dict(self.more)


def repeated(run: Callable[[], tuple[T, float]]) -> tuple[T, float, int]:
    """The first answer of a run that returns its seconds, their median, and the number of runs."""
    answer, first = run()
    times = next(count for limit, count in REPEATS if first <= limit)
    taken = [first, *(run()[1] for _ in range(times - 1))]
    return answer, statistics.median(taken), times


def kept(rows: list[Work], work: Work) -> None:
    """Keep a measurement, and say it."""
    rows.append(work)
    LOG.info("%s; %s, %d, %s: error %.1e in %.4g s", work.problem, work.code, work.size, work.setting, work.error, work.seconds)


def cheapest(rows: Iterable[Row], problem: str, target: float, key: str = "error") -> list[Row]:
    """Of each code the fastest run of a problem with an error of at most `target`, the fastest code first. A run counts only if no run of
    the code with as many cells or more and as fine a setting or finer has a larger error: others are luck."""
    mine = [row for row in rows if row["problem"] == problem and row[key] is not None]
    found: dict[str, Row] = {}
    for row in mine:
        best = found.get(row["code"])
        if (best is None or row["seconds"] < best["seconds"]) and all(other[key] <= target for other in mine if _refines(other, row)):
            found[row["code"]] = row
    return sorted(found.values(), key=lambda row: float(row["seconds"]))


def _refines(other: Row, row: Row) -> bool:
    """Whether a run is the other one, or one of the same code that is at least as fine in space and in time."""
    return other["code"] == row["code"] and other["size"] >= row["size"] and fineness(other["setting"]) >= fineness(row["setting"])


def fineness(setting: str) -> float:
    """A number that grows as a setting gets finer: of "rtol 1e-03", "dt 0.5" or "260 steps"."""
    first, second = setting.split()
    return float(first) if second == "steps" else -float(second)


def front(rows: Sequence[Row], key: str = "error") -> list[bool]:
    """Which rows no other one beats in both seconds and error."""
    return pareto([float(row["seconds"]) for row in rows], [float(row[key]) for row in rows])


def order(errors: Sequence[float], sizes: Sequence[float]) -> list[float]:
    """Observed orders between neighbours: error ~ size^-order."""
    both = list(zip(errors, sizes, strict=True))
    return [math.log(a / b) / math.log(n / m) for (a, m), (b, n) in pairwise(both)]
