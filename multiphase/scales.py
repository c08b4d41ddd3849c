"""Physical scales: what one dimensionless unit of length, time, concentration and pressure is."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from multiphase.errors import ParameterError
from multiphase.parameters import check_keys, describe, float_or_refuse, nearest


@dataclass(frozen=True, slots=True)
class Scale:
    """One dimensionless unit of a quantity in physical units: ``Scale(100.0, "µm")``."""

    value: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """What one dimensionless unit of length, time, concentration and pressure is in physical units.

    Results stay dimensionless; plots, summaries and `Result.in_units` multiply by these.
    """

    length: Scale | None = None
    time: Scale | None = None
    concentration: Scale | None = None
    pressure: Scale | None = None

    table: ClassVar[str] = "scales"

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            scale = getattr(self, item.name)
            if scale is not None:
                object.__setattr__(self, item.name, _scale(scale, f"{self.table}.{item.name}"))

    def factor(self, dimension: Mapping[str, int]) -> tuple[float, str]:
        """By what to multiply a dimensionless value, and the unit it then has.

        Parameters
        ----------
        dimension : mapping of str to int
            Exponents of the scales, for instance ``{"length": 1, "time": -1}`` for a velocity.

        Returns
        -------
        factor : float
        unit : str
            Such as "µm/week". ``(1.0, "-")`` for a pure number, and where a scale that is needed is missing.
        """
        factor = 1.0
        above: list[str] = []
        below: list[str] = []
        for name, exponent in dimension.items():
            scale: Scale | None = getattr(self, name)
            if exponent == 0:
                continue
            if scale is None:
                return 1.0, "-"
            factor *= scale.value**exponent
            (above if exponent > 0 else below).append(scale.unit + _power(abs(exponent)))
        if not below:
            return factor, "·".join(above) or "-"
        denominator = "·".join(below) if len(below) == 1 else f"({'·'.join(below)})"
        return factor, f"{'·'.join(above) or '1'}/{denominator}"

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: str = "scales") -> Scales:
        """Scales from a table such as ``{"length": {"value": 100.0, "unit": "µm"}}``."""
        if not isinstance(table, Mapping):
            raise ParameterError(path, f'expected a table such as length = {{ value = 100.0, unit = "µm" }}, but got {describe(table)}.')
        names = [item.name for item in dataclasses.fields(cls)]
        for key in table:
            if key not in names:
                hint = nearest(key, names)
                raise ParameterError(f"{path}.{key}", f'there is no scale "{key}"{hint} The scales are {", ".join(names)}.')
        return cls(**{key: _scale(value, f"{path}.{key}") for key, value in table.items()})

    def to_table(self) -> dict[str, dict[str, Any]]:
        """The scales as they stand in a scene file; those that are not set are left out."""
        pairs = ((item.name, getattr(self, item.name)) for item in dataclasses.fields(self))
        return {name: {"value": scale.value, "unit": scale.unit} for name, scale in pairs if scale is not None}


def _scale(value: Any, path: str) -> Scale:
    if isinstance(value, Scale):
        value = {"value": value.value, "unit": value.unit}
    if not isinstance(value, Mapping):
        raise ParameterError(path, f'expected a value with its unit, such as {{ value = 100.0, unit = "µm" }}, but got {describe(value)}.')
    check_keys(value, ("value", "unit"), path)
    number = float_or_refuse(value["value"], f"{path}.value")
    if number <= 0.0:
        raise ParameterError(f"{path}.value", f"{number:.15g} is not allowed; a scale must be greater than 0.")
    unit = value["unit"]
    if not isinstance(unit, str) or not unit.strip():
        raise ParameterError(f"{path}.unit", f'expected the name of a unit in quotes, such as "µm", but got {describe(unit)}.')
    return Scale(number, unit)


def _power(exponent: int) -> str:
    return "" if exponent == 1 else str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
