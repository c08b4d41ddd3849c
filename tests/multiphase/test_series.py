"""Functions of time: values, sides of jumps, kinks."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.series import TimeSeries

JUMP = TimeSeries({"times": [0.0, 10.0, 10.0, 20.0, 30.0], "values": [1.0, 1.0, 0.5, 0.1, 0.1]})


def test_series_values_and_sides() -> None:
    assert JUMP(10.0) == 0.5
    assert JUMP(10.0, side=-1) == 1.0
    assert [JUMP(t) for t in (-5.0, 0.0, 9.999, 20.0, 99.0)] == [1.0, 1.0, 1.0, 0.1, 0.1]
    assert JUMP(15.0) == JUMP(15.0, side=-1) == pytest.approx(0.3, rel=1e-15)  # one rounding
    assert np.array_equal(JUMP(np.array([5.0, 10.0, 40.0]), side=-1), [1.0, 1.0, 0.1])
    assert isinstance(JUMP(3.0), float)


def test_series_breaks() -> None:
    assert JUMP.jumps == (10.0,)
    assert JUMP.breaks == (10.0, 20.0)  # no kink at 0 and 30: the slope is 0 on both sides
    ramp = TimeSeries({"times": [1.0, 2.0, 3.0], "values": [1.0, 2.0, 3.0]})
    assert ramp.breaks == (1.0, 3.0)
    assert ramp.jumps == ()
    start = TimeSeries({"times": [0.0, 0.0], "values": [1.0, 2.0]})
    assert (start.jumps, start(-1.0), start(0.0, side=-1), start(0.0)) == ((0.0,), 1.0, 1.0, 2.0)
    assert TimeSeries(3).breaks == TimeSeries(3).jumps == ()


def test_series_constant() -> None:
    assert TimeSeries(2)(1e9) == 2.0 == TimeSeries(2)
    assert np.array_equal(TimeSeries(2)(np.zeros(3)), np.full(3, 2.0))
    assert TimeSeries(2).constant == 2.0
    assert JUMP.constant is None
    assert float(TimeSeries(2)) == 2.0
    with pytest.raises(TypeError, match="varies in time"):
        float(JUMP)


def test_series_round_trip() -> None:
    for series in (JUMP, TimeSeries(0.1)):
        assert TimeSeries(series.to_table()) == series == TimeSeries(series)
        assert hash(TimeSeries(series)) == hash(series)
        assert pickle.loads(pickle.dumps(series)) == series


@pytest.mark.parametrize(
    "value",
    [
        True, None, "1", np.nan, [1.0], {}, {"times": [0.0]}, {"times": [], "values": []}, {"times": [0, 1], "values": [1]},
        {"times": [1, 0], "values": [1, 1]}, {"times": [1, 1, 1], "values": [1, 2, 3]}, {"times": [0, np.inf], "values": [1, 1]},
        {"times": [0, 1], "values": [1, "2"]}, {"time": [0, 1], "values": [1, 2]},
    ],
)  # fmt: skip
def test_series_refused(value: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        TimeSeries(value, path="parameters.Psi_l")
    assert caught.value.path.startswith("parameters.Psi_l")
