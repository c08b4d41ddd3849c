"""Hard cases: what each must do, and what it did."""

from __future__ import annotations

from dataclasses import asdict

from benchmarks.hard import outcomes
from benchmarks.report.tables import Row
from benchmarks.report.work import LOG


def measure() -> dict[str, list[Row]]:
    """File hard.csv."""
    for _ in outcomes():
        pass  # compiles
    rows = []
    for row in outcomes():
        rows.append(asdict(row))
        if not row.as_stated:
            LOG.warning("%s, %s: must %s; did: %s", row.model, row.case, row.must, row.did)
    return {"hard": rows}
