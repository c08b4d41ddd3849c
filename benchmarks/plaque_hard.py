"""Hard cases of the plaque: what each must do, and what it does.

    python -m benchmarks.plaque_hard > benchmarks/plaque_hard.md

The cases stand in `tests/hard`, their expectations in `tests/hard/cases.py`. Ends with status 1 if one does not do what it states.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

from benchmarks.machine import heading

CASES = Path(__file__).resolve().parent.parent / "tests" / "hard" / "cases.py"

KEY = """\
`error` is the largest error in time, in units of what is allowed: rtol L for L, n_total and c_total; rtol of its maximum for l_total;
10 rtol for n. Above 1 fails. `defect` is the largest of the four balances. The first time includes loading compiled code."""


def load() -> Any:
    """The module of the cases."""
    spec = importlib.util.spec_from_file_location("hard_cases", CASES)
    if spec is None or spec.loader is None:
        raise ImportError(CASES)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def main() -> int:
    hard = load()
    print(f"# Hard cases of the plaque, method of lines\n\n{heading()}\n\n{KEY}\n")
    print("| case | must | did | L | n from | 1 - n from | defect | error | steps | rejected | s |")
    print(f"|{' --- |' * 11}")
    wrong: list[str] = []
    total = 0.0
    for case in hard.CASES:
        outcome = hard.judge(case)
        total += outcome.seconds
        wrong += [f"- {case.name}: {line}" for line in outcome.wrong]
        numbers = " | | | |"
        if (result := outcome.result) is not None:
            n = result["n"]
            numbers = f"{result['L'][-1]:.4f} | {n.min():.2e} | {1.0 - n.max():.2e} | {hard.largest_defect(result):.0e} |"
        error = f"{outcome.error:.2f}" if outcome.error == outcome.error else ""
        did = outcome.did + (", **not as stated**" if outcome.wrong else "")
        cost = f"{outcome.cost[0]} | {outcome.cost[1]}" if outcome.result is not None else " |"
        print(f"| {case.name} | {case.statement} | {did} | {numbers} {error} | {cost} | {outcome.seconds:.2f} |", flush=True)
    done = f"{len(hard.CASES)} cases in {total:.0f} s."
    print(f"\n{done} " + ("All do what is stated." if not wrong else "Not as stated:\n\n" + "\n".join(wrong)))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
