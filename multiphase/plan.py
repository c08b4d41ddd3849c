"""The smallest set of equations that gives a scene's answer, and why."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True)
class Reduction:
    """A smaller system than the scene's full one, with the same answer; ``plan.reduce = false`` in a scene keeps the full one.

    Attributes
    ----------
    name : str
        What is made use of, for instance "uniform state".
    reason : str
        Why the answer is the same.
    saves : str
        What is not solved for then, and the unknowns of a step without and with it.
    """

    name: str
    reason: str
    saves: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}; saves {self.saves}"


def fewer(full: int, reduced: int) -> str:
    """Unknowns of a step without and with a reduction, in words."""
    return f"{full} unknowns a step down to {reduced}"


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
    reductions : tuple of Reduction
        Which properties of the scene make the system smaller, and what that saves.
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
    reductions: tuple[Reduction, ...] = ()

    def to_json(self) -> str:
        return json.dumps(asdict(self), indent=1, ensure_ascii=False)

    def describe(self) -> str:
        """The plan as a user reads it."""
        lines = [f"solver     {self.solver}", f"geometry   {self.geometry}", f"unknowns   {self.unknowns} a step"]
        for title, rows in (
            ("equations", self.equations),
            ("boundary", self.boundary),
            ("reduced", tuple(str(reduction) for reduction in self.reductions)),
            ("left out", self.dropped),
            ("because", self.reasons),
            ("warning", self.warnings),
        ):
            lines += [f"{title if i == 0 else '':<10} {row}" for i, row in enumerate(rows)]
        return "\n".join(lines)
