"""How the numbers of the report are read and written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.report.tables import Row, read
from benchmarks.report.work import order


class Files:
    """The results, each file read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._read: dict[str, tuple[list[str], list[Row]]] = {}

    def rows(self, name: str) -> list[Row]:
        if name not in self._read:
            self._read[name] = read(self.folder / f"{name}.csv")
        return self._read[name][1]

    def about(self, name: str) -> list[str]:
        self.rows(name)
        return self._read[name][0]

    def names(self) -> list[str]:
        """The measured files."""
        return sorted(path.stem for path in self.folder.glob("*.csv") if path.stem != "paper")

    def text(self, name: str) -> str:
        return (self.folder / f"{name}.txt").read_text(encoding="utf-8").rstrip()

    @cached_property
    def paper(self) -> dict[str, Any]:
        """Facts about the program of the paper."""
        return {row["what"]: row["value"] for row in self.rows("paper")}

    def everyday(self, start: str) -> float:
        return float(next(row["value"] for row in self.rows("everyday") if row["what"].startswith(start)))

    def equal(self, target: str, code: str) -> Row:
        return next(row for row in self.rows("equal") if row["target"] == target and row["code"].startswith(code))


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def seconds(value: float) -> str:
    """Three digits, in ms or s."""
    return f"{digits(1e3 * value)} ms" if value < 0.0995 else f"{digits(value)} s"


def digits(value: float, count: int = 3) -> str:
    """So many significant digits, never in powers of ten."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    value = float(f"{value:.{count - 1}e}")
    places = count - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):.{max(0, places)}f}"


def short(value: float) -> str:
    """An error or a tolerance: 4.4e-4."""
    number, _, power = f"{value:.1e}".partition("e")
    return f"{number.removesuffix('.0')}e{int(power)}"


def times(value: float) -> str:
    """A ratio: two digits above 10, "1.0" to "9.9" below."""
    return f"{value:.1f}" if value < 9.95 else digits(value, 2)


def orders(rows: Sequence[Row], key: str) -> str:
    """Observed orders between neighbouring sizes."""
    rows = sorted(rows, key=lambda row: row["size"])
    found = order([row[key] for row in rows], [row["size"] for row in rows])
    return ", ".join(f"{value:.2f}" for value in found)


def equal_rows(files: Files, file: str, problem: str) -> str:
    """The fastest setting of each code with an error below each target of a problem; and, below, the codes that do not get there."""
    lines, missing = [], []
    rows = [row for row in files.rows(file) if row["problem"] == problem]
    for name in dict.fromkeys(row["target"] for row in files.rows("equal") if row["target"].startswith(problem)):
        target, at = name.rpartition(": ")[2], name.removeprefix(problem).rpartition(": ")[0]
        key = f"error_{at.rpartition(' ')[2]}" if at else "error"
        there = [row for row in files.rows("equal") if row["target"] == name]
        for row in there:
            lines.append([
                f"{short(float(target))}{at}", row["code"], str(row["size"]), row["setting"], short(row["error"]), seconds(row["seconds"]),
                times(row["ratio"]),
            ])  # fmt: skip
        absent = []
        for code in dict.fromkeys(row["code"] for row in rows):
            if code not in {row["code"] for row in there}:
                best = min((row for row in rows if row["code"] == code), key=lambda row: float(row[key]))
                absent.append(f"{code} ({short(best[key])} at best, in {seconds(best['seconds'])})")
        if absent:
            missing.append(f"Not below {short(float(target))}{at} with the settings tried, or by luck alone: {'; '.join(absent)}.")
    listed = table(["error below", "code", "cells or rings", "setting", "its error", "time", "times the fastest"], lines)
    return "\n\n".join([listed, *missing])
