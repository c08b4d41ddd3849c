"""Parameter fields: checking, conversion to and from tables, physical scales."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.parameters import from_table, nearest, parameter, replace, specifications, to_table, validate
from multiphase.scales import Scale, Scales
from multiphase.series import TimeSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class Tissue:
    drag: float = parameter(1.0, symbol="b", low=0.0, low_open=True, doc="the drag")
    fraction: float = parameter(0.5, symbol="n", low=0.0, high=1.0, high_open=True)
    cells: int = parameter(100, symbol="N", low=4)
    form: str = parameter("one", symbol="-", choices=("one", "two"))
    wall: Any = parameter("free", symbol="w", kind="number", choices=("free",), high=2.0)  # noqa: RUF009
    step: float | None = parameter(None, symbol="dt", kind="number", low=0.0, low_open=True)
    reduce: bool = parameter(True, symbol="-")
    names: tuple[str, ...] | None = parameter(None, symbol="-", kind="words")
    shape: Any = parameter(0.2, symbol="s", kind="function", low=0.0)  # noqa: RUF009
    inflow: Any = parameter(1.0, symbol="q", kind="series", low=0.0)  # noqa: RUF009

    table: ClassVar[str] = "tissue"

    def __post_init__(self) -> None:
        validate(self, self.table)


def test_defaults_are_stored_in_their_own_types() -> None:
    tissue = Tissue()
    assert isinstance(tissue.shape, PositionFunction)
    assert isinstance(tissue.inflow, TimeSeries)
    assert Tissue(drag=2) == Tissue(drag=2.0)
    assert type(Tissue(drag=2).drag) is float
    assert type(Tissue(drag=np.float32(2)).drag) is float
    assert type(Tissue(drag=Fraction(1, 2)).drag) is float
    assert type(Tissue(cells=1e2).cells) is int  # as 1e2 is natural to write in a scene


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("drag", 0.0, ["0 is not allowed", "the drag must be a number greater than 0"]),
        ("drag", -1, ["-1 is not allowed"]),
        ("drag", math.nan, ["greater than 0", "nan", "finite"]),
        ("drag", math.inf, ["inf", "finite"]),
        ("drag", 10**400, ["more than 18 digits"]),
        ("drag", True, ["must be a number", "got true"]),
        ("drag", np.True_, ["must be a number"]),
        ("drag", "abc", ['got the text "abc"']),
        ("drag", None, ["got nothing"]),
        ("drag", [1.0], ["got a list of 1"]),
        ("drag", {"value": 1.0}, ["got a table with the keys value"]),
        ("drag", np.ones(3), ["got an array"]),
        ("drag", datetime.date(2020, 1, 2), ["got 2020-01-02 (date)"]),
        ("fraction", 1.0, ["a number of 0 or more and below 1"]),
        ("cells", 3, ["3 is not allowed", "a whole number of 4 or more"]),
        ("cells", 10.5, ["a whole number of 4 or more", "10.5"]),
        ("cells", False, ["got false"]),
        ("form", "onee", ['"one" or "two"', 'did you mean "one"?']),
        ("form", 1, ['"one" or "two"', "got 1"]),
        ("wall", 3.0, ['"free" or a number at most 2']),
        ("wall", "fre", ['did you mean "free"?']),
        ("step", 0.0, ["greater than 0"]),
        ("reduce", 1, ["must be true or false"]),
        ("names", "n", ["a list of names"]),
        ("names", ["n", 1], ["a list of names"]),
        ("shape", -0.1, ["-0.1 is not allowed", "a number of 0 or more"]),
        ("shape", {"at": [0.0, 1.0], "values": [1.0, -1.0]}, ["-1 is not allowed"]),
        ("shape", True, ["expected a number, a formula"]),
        ("inflow", {"times": [0.0, 1.0], "values": [1.0, -1.0]}, ["-1 is not allowed"]),
        ("inflow", True, ["got true"]),
    ],
)
def test_bad_values_are_refused_with_path_value_and_range(name: str, value: object, words: list[str]) -> None:
    with pytest.raises(ParameterError) as caught:
        Tissue(**{name: value})
    assert caught.value.path == f"tissue.{name}"
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        {"fraction": 0.0},
        {"fraction": math.nextafter(1.0, 0.0)},
        {"drag": 5e-324},
        {"wall": 2.0},
        {"wall": -7.0},
        {"cells": 4},
        {"shape": 0},
    ],
)
def test_bounds_themselves(values: dict[str, Any]) -> None:
    Tissue(**values)


def test_table_round_trip() -> None:
    tissue = Tissue(drag=0.1 + 0.2, shape="0.5*xi", inflow={"times": [0, 1], "values": [1, 2]}, names=("a", "b"), step=1e-3)
    assert from_table(Tissue, to_table(tissue), "tissue") == tissue
    assert to_table(Tissue())["cells"] == 100  # defaults are written out
    assert "step" not in to_table(Tissue())  # what is not set is left out, as TOML has no null


def test_unknown_keys_name_the_nearest_or_the_right_table() -> None:
    with pytest.raises(ParameterError, match=r'tissue\.darg: there is no key "darg" in \[tissue\]; did you mean "drag"\?'):
        from_table(Tissue, {"darg": 1.0}, "tissue")
    with pytest.raises(ParameterError, match=r"end does not belong in \[tissue\]; move it to \[time\]"):
        from_table(Tissue, {"end": 1.0}, "tissue", elsewhere={"end": "time"})
    with pytest.raises(ParameterError, match="expected a table"):
        from_table(Tissue, 3, "tissue")  # type: ignore[arg-type]


def test_replace() -> None:
    assert replace(Tissue(), drag=3).drag == 3.0
    with pytest.raises(ParameterError, match=r'tissue\.drga: there is no parameter "drga"; did you mean "drag"\?'):
        replace(Tissue(), drga=3)
    with pytest.raises(ParameterError, match=r"tissue\.drag: -3 is not allowed"):
        replace(Tissue(), drag=-3)


def test_specifications_keep_symbol_and_bounds() -> None:
    drag = specifications(Tissue)["drag"]
    assert (drag.symbol, drag.unit, drag.low, drag.low_open, drag.kind) == ("b", "-", 0.0, True, "number")
    with pytest.raises(TypeError, match="kind must be one of"):
        parameter(None, symbol="x")


def test_nearest() -> None:
    assert nearest("kq", ["k_m", "b"]) == "."
    assert nearest("psi_L", ["Psi_l", "Psi_m"]) == '; did you mean "Psi_l"?'
    assert nearest("anything", []) == "."


SCALES = Scales(length=Scale(100.0, "µm"), time=Scale(0.5, "week"), concentration=Scale(2.0, "mM"))


@pytest.mark.parametrize(
    ("dimension", "factor", "unit"),
    [
        ({}, 1.0, "-"),
        ({"length": 0}, 1.0, "-"),
        ({"length": 1}, 100.0, "µm"),
        ({"length": 2}, 1e4, "µm²"),
        ({"length": 1, "time": -1}, 200.0, "µm/week"),
        ({"time": -1}, 2.0, "1/week"),
        ({"length": 1, "concentration": 1}, 200.0, "µm·mM"),
        ({"concentration": 1, "length": -3, "time": -1}, 4e-6, "mM/(µm³·week)"),
        ({"pressure": 1}, 1.0, "-"),
        ({"length": 1, "pressure": 1}, 1.0, "-"),
    ],
)
def test_scale_factors(dimension: dict[str, int], factor: float, unit: str) -> None:
    found, label = SCALES.factor(dimension)
    assert found == pytest.approx(factor, rel=1e-15)  # one rounding for each factor
    assert label == unit


def test_scales_round_trip_and_refusals() -> None:
    assert Scales.from_table(SCALES.to_table()) == SCALES
    for table, path in [
        ({"lenght": {"value": 1.0, "unit": "m"}}, "scales.lenght"),
        ({"length": 1.0}, "scales.length"),
        ({"length": {"value": 1.0}}, "scales.length"),
        ({"length": {"value": 1.0, "units": "m"}}, "scales.length.units"),
        ({"length": {"value": 0, "unit": "m"}}, "scales.length.value"),
        ({"length": {"value": math.nan, "unit": "m"}}, "scales.length.value"),
        ({"length": {"value": 1.0, "unit": ""}}, "scales.length.unit"),
        ({"length": {"value": 1.0, "unit": 1}}, "scales.length.unit"),
    ]:
        with pytest.raises(ParameterError) as caught:
            Scales.from_table(table)
        assert caught.value.path == path
    with pytest.raises(ParameterError, match="greater than 0"):
        Scales(length=Scale(-1.0, "m"))
