"""What a study found, as a table, a CSV file and a picture."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from multiphase.errors import ParameterError
from multiphase.precision.accuracy import Measurement, Order
from multiphase.precision.bench import Reference
from multiphase.result import PathName
from multiphase.scene import Scene
from multiphase.storage import check_target, replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = ("precision.txt", "precision.csv", "precision.png")
WIDTH = 118  # characters of the prose around a table


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

    @property
    def title(self) -> str:
        return f"{self.scene.title or self.scene.name}: speed against error"

    def table(self) -> str:
        """The study as aligned text."""
        head = [self.title, *self.about()]
        rows = [_headings(self.measurements), *(_cells_of(row, _names(self.measurements)) for row in self.measurements)]
        floored = "" if self.difference is None else " (errors below the difference of the references count as equal)"
        body = [*_aligned(rows), f"* no other row is both as fast and as accurate{floored}"]
        tail = [*_order_lines(self.orders), *self.notes, *self.setting()]
        return "\n\n".join("\n".join(_wrapped(part) if part is not body else part) for part in (head, body, tail)) + "\n"

    def about(self) -> list[str]:
        """What the errors are, and what they are measured against."""
        name = self.scene.model.film
        lines = [
            f"error of {name}: mean over the body of the difference (of cell averages, or on the finer mesh), the largest over the stored "
            f"times, over the largest |{name}|; of a scalar: the largest over the times, over its largest value; seconds: wall time of one "
            "run, median of the runs"
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
        from multiphase.precision.picture import draw

        return draw(self)

    def save(self, directory: PathName) -> tuple[Path, ...]:
        """Write the table, the CSV file and the picture into `directory`, which is made if need be, and return their paths."""
        from multiphase.plotting.files import write_picture

        folder = Path(directory)
        folder.mkdir(exist_ok=True)
        table, rows, picture = (folder / name for name in FILES)
        replace_file(table, self.table().encode("utf-8"))
        self.to_csv(rows)
        write_picture(self.figure(), picture)
        return table, rows, picture


def check_folder(folder: Path) -> None:
    """Refuse, before any work, a folder that the files of a study cannot be written to; nothing is made."""
    if folder.is_dir():
        for name in FILES:
            check_target(folder / name, "-o")
    elif folder.exists():
        raise ParameterError("-o", f"{folder} is a file; the results of a study need a folder.")
    else:
        check_target(folder, "-o")


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
