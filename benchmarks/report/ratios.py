"""Equal error: the fastest setting of each code, and the ratios of their times, also against those of the report before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from benchmarks.report.tables import Row
from benchmarks.report.work import cheapest


@dataclass(frozen=True, slots=True)
class Target:
    """An error that counts as enough: file, problem, bound, and the column that it bounds."""

    file: str
    problem: str
    bound: float
    key: str = "error"

    @property
    def name(self) -> str:
        at = "" if self.key == "error" else f" at t = {self.key.removeprefix('error_')}"
        return f"{self.problem}{at}: {self.bound:g}"


TARGETS = (
    Target("plaque", "interfacial", 5e-4),
    Target("plaque", "interfacial", 3e-5),
    Target("plaque", "drag", 5e-4),
    Target("plaque", "drag", 3e-5),
    Target("radial", "elastic disk", 2e-3),
    Target("radial", "elastic disk", 2e-4),
    Target("radial", "elastic sphere", 2e-3),
    Target("radial", "elastic sphere", 2e-4),
    Target("radial", "viscous disk", 2e-3),
    Target("radial", "viscous disk", 2e-4),
    Target("radial", "viscous sphere", 2e-3),
    Target("radial", "viscous sphere", 2e-4),
    Target("plane", "paper's disk", 5e-3, "error_40"),
    Target("plane", "paper's disk", 1e-3, "error_40"),
    Target("plane", "paper's disk", 2e-2, "error_60"),
)


def equal(files: Mapping[str, Sequence[Row]], before: Sequence[Row] = (), column: str = "ratio") -> list[Row]:
    """Rows of equal.csv; the ratio is the time over that of the fastest code. It is compared with a column of the rows before,
    where the same setting was the fastest."""
    earlier = {_key(row): row[column] for row in before}
    rows: list[Row] = []
    for target in TARGETS:
        found = cheapest(files.get(target.file, ()), target.problem, target.bound, target.key)
        for row in found:
            ratio = row["seconds"] / found[0]["seconds"]
            new = {"target": target.name, "code": row["code"], "size": row["size"], "setting": row["setting"], "error": row[target.key]}
            old = earlier.get(_key(new))
            change = None if old is None else ratio / old - 1.0
            rows.append(new | {"seconds": row["seconds"], "ratio": ratio, "ratio_before": old, "change": change})
    return rows


def _key(row: Row) -> tuple[object, ...]:
    return row["target"], row["code"], row["size"], row["setting"]
