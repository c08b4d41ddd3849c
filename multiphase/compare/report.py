"""A comparison as numbers, as a text, as JSON and as a figure."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Self

from multiphase.compare.differences import Difference

_NOT_FINITE = "not finite in one"
WIDTH = 120
"""Characters of a line of notes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What :func:`multiphase.compare.compare` found.

    Attributes
    ----------
    differences : tuple of Difference
        One for each quantity that is compared.
    times : tuple of float
        The common times.
    cells : int or None
        Number of positions at which fields were compared: cells, rings, or nodes of a mesh.
    only_a, only_b : tuple of str
        Quantities that only one of the results has.
    identical : bool
        Every stored dataset, the checkpoint included, is the same bit for bit.
    costs : (str, str)
        What each result cost, in words; empty where it does not say.
    notes : tuple of str
        How the results were brought together, what was not compared, and why.
    place : str
        What the positions 0 to 1 of fields are.
    scatter : tuple of Difference
        How far fields of a result on a mesh depart from their means round rings, where fields are compared by rings.
    refusals : tuple of str
        Why no agreement is claimed, however small the differences are.
    """

    differences: tuple[Difference, ...]
    times: tuple[float, ...]
    cells: int | None
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    identical: bool
    costs: tuple[str, str] = ("", "")
    notes: tuple[str, ...] = ()
    place: str = "x/width"
    scatter: tuple[Difference, ...] = ()
    refusals: tuple[str, ...] = ()

    @property
    def largest(self) -> Difference:
        """The quantity that differs most, or scatters most, relative to its scale, of those that count."""
        return max((entry for entry in (*self.differences, *self.scatter) if entry.physical), key=lambda entry: entry.relative_to_scale)

    @property
    def worst(self) -> float:
        """Largest difference or scatter of all quantities that count, relative to their scales: not balance defects, nor what a model
        measures of its own errors."""
        return self.largest.relative_to_scale

    def exceeds(self, tol: float) -> bool:
        """Whether any quantity that counts differs or scatters by more than `tol`, relative to its scale, or no agreement is claimed."""
        return bool(self.refusals) or not self.worst <= tol

    # -- Text ------------------------------------------------------------------------------------------------------------

    def table(self) -> str:
        """The comparison as a user reads it."""
        at = "" if self.cells is None else f" and {self.cells} positions"
        lines = [f"compared at {len(self.times)} common times, {self.times[0]:g} to {self.times[-1]:g}{at}"]
        if self.identical:
            lines.append("identical bit for bit")
        lines += [f"only in {side}: {', '.join(names)}" for side, names in (("A", self.only_a), ("B", self.only_b)) if names]
        lines += [f"{side}: {cost}" for side, cost in zip("AB", self.costs, strict=True) if cost]
        lines += [*self.notes, "", *self._rows()]
        if self.scatter:
            lines += ["", *self._scatter_rows()]
        size = f"{self.worst:.3e} of its scale" if math.isfinite(self.worst) else _NOT_FINITE
        lines += ["", f"worst: {self.largest.label}, {size} ({self._left_out()} not counted)"]
        lines += [f"no agreement is claimed: {why}" for why in self.refusals]
        return "\n".join(lines)

    def _left_out(self) -> str:
        *names, last = ["balance defects", *(entry.name for entry in self.differences if not entry.counts)]
        return f"{', '.join(names)} and {last}" if names else last

    def _rows(self) -> list[str]:
        width = max(10, *(len(entry.name) for entry in self.differences))
        on_nodes = any(entry.position for entry in self.differences)
        last, place = (24, "at rest (x, y)") if on_nodes else (max(12, len(self.place) + 4), f"at {self.place}")
        if all(entry.position is None and entry.xi is None for entry in self.differences):
            last, place = 0, ""
        titles = ("max |A-B|", "of scale", "max rel.", "L1", "at t")
        lines = [(f"{'quantity':<{width}}" + "".join(f"{title:>12}" for title in titles) + f"{place:>{last}}").rstrip()]
        for entry in self.differences:
            values = (entry.max_abs, entry.relative_to_scale, entry.max_relative, entry.l1)
            columns = "".join(f"{'' if value is None else f'{value:.3e}':>12}" for value in values)
            if not math.isfinite(entry.max_abs):
                columns = f"{_NOT_FINITE:>48}"
            where = "" if entry.xi is None else f"{entry.xi:.4f}"
            if entry.position:
                where = "({:.4g}, {:.4g})".format(*entry.position)
            lines.append((f"{entry.name:<{width}}" + columns + f"{entry.time:>12.6g}{where:>{last}}").rstrip())
        return lines

    def _scatter_rows(self) -> list[str]:
        width, last = max(10, *(len(entry.name) for entry in self.scatter)), max(12, len(self.place) + 4)
        titles = "".join(f"{title:>12}" for title in ("rms", "of scale", "largest", "at t"))
        lines = ["scatter round the rings, from the mean round each:", f"{'field':<{width}}{'of':>4}{titles}{f'at {self.place}':>{last}}"]
        for entry in self.scatter:
            values = "".join(f"{value:>12.3e}" for value in (entry.rms, entry.relative_to_scale, entry.max_abs))
            lines.append(f"{entry.name:<{width}}{entry.side:>4}{values}{entry.time:>12.6g}{entry.xi:>{last}.4f}")
        return lines

    # -- JSON ------------------------------------------------------------------------------------------------------------

    def to_json(self) -> str:
        """The comparison as JSON; an infinite difference is the text "inf"."""

        def plain(value: Any) -> Any:
            if isinstance(value, tuple | list):
                return [plain(entry) for entry in value]
            return str(value) if isinstance(value, float) and not math.isfinite(value) else value

        def rows(entries: tuple[Difference, ...]) -> list[dict[str, Any]]:
            return [{key: plain(value) for key, value in asdict(entry).items()} for entry in entries]

        data = {
            "identical": self.identical,
            "worst": plain(self.worst),
            "worst_quantity": self.largest.label,
            "refusals": list(self.refusals),
            "times": list(self.times),
            "cells": self.cells,
            "only_a": list(self.only_a),
            "only_b": list(self.only_b),
            "costs": list(self.costs),
            "notes": list(self.notes),
            "place": self.place,
            "differences": rows(self.differences),
            "scatter": rows(self.scatter),
        }
        return json.dumps(data, indent=1, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The comparison that `to_json` wrote."""
        data: dict[str, Any] = json.loads(text)
        for name in ("worst", "worst_quantity"):
            del data[name]
        for name in ("differences", "scatter"):
            data[name] = [Difference.from_plain(entry) for entry in data[name]]
        rows: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in data.items()}
        return cls(**rows)

    # -- Figure ----------------------------------------------------------------------------------------------------------

    def figure(self) -> Any:
        """A Matplotlib figure of the differences against time, and against position where they were compared at positions 0 to 1."""
        from multiphase.compare.picture import draw

        return draw(self.differences, self.scatter, self.times, self.place, (*self.notes, *self.refusals))

    def save_figure(self, path: str | PathLike[str]) -> None:
        """Write the figure to `path` (.png, .pdf or .svg)."""
        from multiphase.plotting.files import checked_path, write_picture

        target: Path = checked_path(path, (".png", ".pdf", ".svg"), "a figure")
        write_picture(self.figure(), target)
