"""Hard cases of all models: what each must do, and what it does.

    python -m benchmarks.hard > benchmarks/hard.md

The cases and what is stated of them stand in `tests/hard`. Ends with status 1 if one does not do what it states.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.cases import of_tests
from benchmarks.machine import heading

KEY = """\
`defect` is the largest of the balances, over all stored times, `error` the largest error in time in units of what is allowed, against
the same grid at a far smaller rtol; above 1 fails. Empty where it is not judged. The first time of a section includes loading compiled
code; no time includes the runs to compare with."""

PLAQUE_KEY = "Allowed are rtol L for L, n_total and c_total; rtol of its maximum for l_total; 10 rtol for n (root mean square)."

TUMOUR_KEY = """\
Allowed are, with Radau IIA, 10 rtol for R, 10 rtol for alpha in the mean and 10 m rtol for size and cells, ten times that with BDF
(docs/tumour.md), and more in single cases: see `tests/hard/tumour_cases.py`, where everything is said that is checked of every case.
`size` is R, or the area of bodies that are not round."""


@dataclass(frozen=True)
class Row:
    """What a case must do, and what it did."""

    model: str
    case: str
    must: str
    did: str
    as_stated: bool
    steps: int | None
    rejected: int | None
    error: float | None
    defect: float | None
    seconds: float


@dataclass(frozen=True)
class Section:
    """The cases of a model, and what its table shows of a result."""

    model: str
    cases: tuple[Any, ...]
    key: str
    columns: tuple[str, ...]
    values: Callable[[Any], tuple[str, ...]]


def sections() -> list[Section]:
    """All cases."""
    tumour = of_tests("hard", "tumour_cases")
    kinds = {"tumour, elastic": tumour.ELASTIC, "tumour, viscous": tumour.VISCOUS, "tumour, two dimensions": tumour.PLANE}
    columns = ("size", "alpha from", "1 - alpha from", "C from")
    return [
        Section("plaque", of_tests("hard", "cases").CASES, PLAQUE_KEY, ("L", "n from", "1 - n from"), _of_plaque),
        *(
            Section(model, tuple(case for case in tumour.CASES if case.kind == kind), TUMOUR_KEY, columns, _of_tumour)
            for model, kind in kinds.items()
        ),
    ]


def _of_plaque(result: Any) -> tuple[str, ...]:
    n = result["n"]
    return f"{result['L'][-1]:.4f}", f"{n.min():.2e}", f"{1.0 - n.max():.2e}"


def _of_tumour(result: Any) -> tuple[str, ...]:
    alpha = result["alpha"]
    size = result["radius" if "radius" in result else "area"][-1]
    return f"{size:.5g}", f"{alpha.min():.2e}", f"{1.0 - alpha.max():.2e}", f"{result['C'].min():.2e}"


def judged(section: Section) -> Iterator[tuple[Row, Any]]:
    """What the cases of a section did, one by one, with the judge's notes."""
    judge = of_tests("hard", "judging").judge
    for case in section.cases:
        outcome = judge(case)
        has_run = outcome.result is not None
        yield (
            Row(
                model=section.model,
                case=case.name,
                must=case.statement,
                did=outcome.did,
                as_stated=not outcome.wrong,
                steps=outcome.cost[0] if has_run else None,
                rejected=outcome.cost[1] if has_run else None,
                error=_known(outcome.error),
                defect=_known(outcome.defect),
                seconds=outcome.seconds,
            ),
            outcome,
        )


def _known(value: float) -> float | None:
    return float(value) if value == value else None


def outcomes() -> Iterator[Row]:
    """What all cases did, one by one."""
    for section in sections():
        for row, _ in judged(section):
            yield row


def main() -> int:
    print(f"# Hard cases\n\n{heading()}\n\n{KEY}")
    wrong: list[str] = []
    count, total = 0, 0.0
    for section in sections():
        columns = ("case", "must", "did", *section.columns, "defect", "error", "steps", "rejected", "s")
        print(f"\n## {section.model[0].upper()}{section.model[1:]}\n\n{section.key}\n")
        print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")
        seconds = 0.0
        for row, outcome in judged(section):
            seconds += row.seconds
            wrong += [f"- {row.model}, {row.case}: {line}" for line in outcome.wrong]
            values = section.values(outcome.result) if outcome.result is not None else ("",) * len(section.columns)
            numbers = (
                "" if row.defect is None else f"{row.defect:.0e}",
                "" if row.error is None else f"{row.error:.2f}",
                *("" if cost is None else str(cost) for cost in (row.steps, row.rejected)),
                f"{row.seconds:.2f}",
            )
            did = row.did + ("" if row.as_stated else ", **not as stated**")
            print(f"| {' | '.join((row.case, row.must, did, *values, *numbers))} |", flush=True)
        print(f"\n{len(section.cases)} cases in {seconds:.1f} s.")
        count, total = count + len(section.cases), total + seconds
    print(f"\n{count} cases in {total:.0f} s. " + ("All do what is stated." if not wrong else "Not as stated:\n\n" + "\n".join(wrong)))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
