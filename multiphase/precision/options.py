"""What a study varies: methods, cells and tolerances, checked before anything is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from multiphase.errors import ParameterError
from multiphase.parameters import float_or_refuse, nearest, specifications
from multiphase.scene import Scene

CELLS = (25, 50, 100, 200)
PLANE_CELLS = (5, 10, 20, 40)
"""The same for bodies in two dimensions."""
RTOLS = (1e-3, 1e-4, 1e-5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What a study varies, checked: methods, cells (ascending) and tolerances (descending)."""

    methods: tuple[str, ...]
    cells: tuple[int, ...]
    rtols: tuple[float, ...]


def choices(
    scene: Scene, *, methods: Sequence[str] | None = None, cells: Sequence[int] | None = None, rtols: Sequence[float] | None = None
) -> Choices:
    """Check what a study of `scene` is to vary, and fill in the defaults; nothing is run.

    Raises
    ------
    ParameterError
        For an unknown method (naming the nearest), for cells or an rtol that no run can have, and for a model without these keys.
    """
    known = specifications(scene.model.solver)
    for key in ("method", "cells", "rtol"):
        if key not in known:
            raise ParameterError(f"solver.{key}", f"the model {scene.model.name} has no such key, so a study cannot vary it.")
    every = tuple(choice for choice in known["method"].choices if choice != "auto")
    chosen = _usable(scene, every) if methods is None else tuple(dict.fromkeys(methods))
    for name in chosen:
        if name not in every:
            text = f'the model {scene.model.name} has no method "{name}"{nearest(str(name), every)} It has {", ".join(every)}.'
            raise ParameterError("methods", text)
    usual = PLANE_CELLS if getattr(scene.geometry, "plane", False) else CELLS
    counts = sorted({int(value) for value in _allowed(scene, "cells", usual if cells is None else cells, "cells")})
    tolerances = sorted(set(_allowed(scene, "rtol", RTOLS if rtols is None else rtols, "rtols")), reverse=True)
    if not chosen or not counts or not tolerances:
        raise ParameterError("", "there is nothing to run: give at least one method, one number of cells and one rtol.")
    return Choices(methods=chosen, cells=tuple(counts), rtols=tuple(tolerances))


def _usable(scene: Scene, methods: Sequence[str]) -> tuple[str, ...]:
    """The methods that the model has for this scene; all where it has none of them."""

    def is_usable(method: str) -> bool:
        try:
            scene.with_changes(solver={"method": method})
        except ParameterError as error:
            return error.path != "solver.method"
        return True

    return tuple(filter(is_usable, methods)) or tuple(methods)


def _allowed(scene: Scene, key: str, values: Sequence[float], path: str) -> list[float]:
    """`values` as the solver allows them for its `key`."""
    known = specifications(scene.model.solver)[key]
    found = []
    for value in values:
        number = float_or_refuse(value, path)
        if not known.allows(number) or (known.kind == "integer" and number != int(number)):
            raise ParameterError(path, f"{value:.15g} is not allowed; {known.doc} must be {known.expected}.")
        found.append(number)
    return found


def check_reference(scene: Scene, chosen: Choices, reference: tuple[int, float] | None) -> None:
    """Refuse a reference that is not finer than every row."""
    if reference is None:
        return
    _allowed(scene, "cells", reference[:1], "reference")
    _allowed(scene, "rtol", reference[1:], "reference")
    if reference[0] < 2 * chosen.cells[-1] or reference[1] >= chosen.rtols[-1]:
        raise ParameterError(
            "reference",
            f"{reference[0]} cells and rtol = {reference[1]:g} are not fine enough; take at least {2 * chosen.cells[-1]} cells and an rtol "
            f"below {chosen.rtols[-1]:g}.",
        )


def parse_list(text: str, name: str, kind: type[int] | type[float] | type[str] = str) -> list[Any]:
    """The values of a text such as ``25,50,100``; raises ParameterError at `name`."""
    found = []
    for part in (part.strip() for part in text.split(",")):
        try:
            if not part:
                raise ValueError
            found.append(kind(part))
        except ValueError:
            what = {int: "a whole number", float: "a number", str: "a name"}[kind]
            example = {int: "25,50,100", float: "1e-3,1e-4", str: "fipy,lines"}[kind]
            raise ParameterError(name, f'"{part}" is not {what}; the form is {name} {example}, for instance.') from None
    return found
