"""Functions of time, as a scene file or a script may write them: a number, or ``{times = [...], values = [...]}``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import check_keys, describe, float_or_refuse, is_number, numbers

Array = NDArray[np.float64]


class TimeSeries:
    """A number that may depend on time: constant, or piecewise linear through given points.

    Parameters
    ----------
    value : float, mapping or TimeSeries
        A number, or ``{"times": [...], "values": [...]}``. Times do not decrease; a time that stands twice is a jump. Before
        the first and after the last time the value is constant.
    path : str
        Dotted path of the value, for messages.

    Attributes
    ----------
    times, values : tuple of float
        The points; empty times and one value for a constant.
    breaks : tuple of float
        Times at which there is a kink or a jump.
    jumps : tuple of float
        Times at which the value jumps.
    """

    __slots__ = ("_t", "_v", "breaks", "jumps", "times", "values")

    def __init__(self, value: Any, *, path: str = "") -> None:
        if isinstance(value, TimeSeries):
            value = value.to_table()
        self.times: tuple[float, ...] = ()
        if isinstance(value, Mapping):
            check_keys(value, ("times", "values"), path)
            self.times = numbers(value["times"], f"{path}.times")
            self.values: tuple[float, ...] = numbers(value["values"], f"{path}.values")
            check_lengths(self.times, self.values, "times", path)
            for i in range(1, len(self.times)):
                if self.times[i] < self.times[i - 1]:
                    raise ParameterError(f"{path}.times", f"{self.times[i]} comes after {self.times[i - 1]}; times must not decrease.")
                if i > 1 and self.times[i] == self.times[i - 2]:
                    raise ParameterError(f"{path}.times", f"{self.times[i]} stands three times; a jump is a time that stands twice.")
        elif is_number(value):
            self.values = (float_or_refuse(value, path),)
        else:
            raise ParameterError(path, f"expected a number or a table {{ times = [...], values = [...] }}, but got {describe(value)}.")
        self._t, self._v = np.array(self.times), np.array(self.values)
        self.jumps: tuple[float, ...] = tuple(t for t in dict.fromkeys(self.times) if self(t, side=-1) != self(t))
        kinks = {t for t in self.times if self._slope(t, -1) != self._slope(t, 1)}
        self.breaks: tuple[float, ...] = tuple(sorted(kinks.union(self.jumps)))

    @overload
    def __call__(self, t: float, side: int = 1) -> float: ...
    @overload
    def __call__(self, t: Array, side: int = 1) -> Array: ...
    def __call__(self, t: float | Array, side: int = 1) -> float | Array:
        """Value at time `t`; at a jump the value after it, or with ``side=-1`` the value just before it."""
        at = np.asarray(t, dtype=float)
        if not self.times:
            value = np.full(at.shape, self._v[0])
        else:
            first, second = self._segment(at, side)
            width = self._t[second] - self._t[first]
            weight = np.where(width > 0.0, (at - self._t[first]) / np.where(width > 0.0, width, 1.0), 0.0)
            value = (1.0 - weight) * self._v[first] + weight * self._v[second]
        return value if np.ndim(t) else float(value)

    def _segment(self, at: Array, side: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the points before and after `at`; the same index twice outside the points."""
        after = np.searchsorted(self._t, at, side="right" if side >= 0 else "left")
        last = len(self._t) - 1
        return np.clip(after - 1, 0, last), np.clip(after, 0, last)

    def _slope(self, t: float, side: int) -> float:
        first, second = self._segment(np.asarray(t), side)
        width = float(self._t[second] - self._t[first])
        return float(self._v[second] - self._v[first]) / width if width > 0.0 else 0.0

    @property
    def constant(self) -> float | None:
        """The number, where the series is given as one; otherwise None."""
        return None if self.times else self.values[0]

    def to_table(self) -> float | dict[str, list[float]]:
        """The series as it stands in a scene file."""
        return {"times": list(self.times), "values": list(self.values)} if self.times else self.values[0]

    def __eq__(self, other: object) -> bool:
        if isinstance(other, TimeSeries):
            return (self.times, self.values) == (other.times, other.values)
        return not self.times and self.values[0] == other

    def __hash__(self) -> int:
        return hash((self.times, self.values)) if self.times else hash(self.values[0])

    def __float__(self) -> float:
        if self.times:
            raise TypeError(f"{self!r} varies in time and has no single value")
        return self.values[0]

    def __repr__(self) -> str:
        return repr(self.to_table())


def check_lengths(positions: Sequence[float], values: Sequence[float], name: str, path: str) -> None:
    """Refuse positions or times, called `name`, that are not as many as their values."""
    if len(positions) != len(values) or not positions:
        raise ParameterError(
            path, f"there are {len(positions)} {name} and {len(values)} values; there must be equally many, and at least one of each."
        )
