"""The CSV files of the report: lines that start with ``#`` say how they were made, then names, then rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from multiphase.storage import replace_file

Row = dict[str, Any]


def write(path: Path, about: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Numbers in full; what a row lacks is empty."""
    text = io.StringIO()
    for line in about:
        text.write(f"# {line}\n")
    writer = csv.DictWriter(text, list(dict.fromkeys(name for row in rows for name in row)), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: repr(float(value)) if isinstance(value, float) else value for name, value in row.items()} for row in rows)
    replace_file(path, text.getvalue().encode("utf-8"))


def read(path: Path) -> tuple[list[str], list[Row]]:
    """The lines about it, and the rows: numbers where they are numbers, None where they are empty."""
    lines = path.read_text(encoding="utf-8").splitlines()
    about = [line[2:] for line in lines if line.startswith("# ")]
    return about, [{k: _value(v) for k, v in row.items()} for row in csv.DictReader(line for line in lines if not line.startswith("# "))]


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text or None
