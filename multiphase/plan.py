"""The smallest set of equations that gives a scene's answer, and why."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True)
class Plan:
    """What will be solved for a scene.

    Attributes
    ----------
    solver : str
        Scheme that runs, for instance "fipy".
    geometry : str
        Geometry and dimension in words.
    equations : tuple of str
        One line each: what is solved, with its equation number.
    dropped : tuple of str
        What is left out or eliminated, each with its reason.
    unknowns : int
        Number of scalar unknowns of one implicit step.
    reasons : tuple of str
        Why this solver and this form.
    warnings : tuple of str
        What a user should know before trusting the result.
    open_balances : tuple of str
        Scalars ``defect_...`` of balances that this form does not close, by the user's choice; large ones are no fault of the run.
    balance_limit : float
        Up to where the other defects are no fault of the run, either.
    boundary : tuple of str
        What acts on each named part of the boundary.
    """

    solver: str
    geometry: str
    equations: tuple[str, ...]
    unknowns: int
    dropped: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    open_balances: tuple[str, ...] = ()
    balance_limit: float = 1e-9
    boundary: tuple[str, ...] = ()

    def to_json(self) -> str:
        return json.dumps(asdict(self), indent=1, ensure_ascii=False)

    def describe(self) -> str:
        """The plan as a user reads it."""
        lines = [f"solver     {self.solver}", f"geometry   {self.geometry}", f"unknowns   {self.unknowns} a step"]
        for title, rows in (
            ("equations", self.equations),
            ("boundary", self.boundary),
            ("left out", self.dropped),
            ("because", self.reasons),
            ("warning", self.warnings),
        ):
            lines += [f"{title if i == 0 else '':<10} {row}" for i, row in enumerate(rows)]
        return "\n".join(lines)
