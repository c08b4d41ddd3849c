"""Growing disks: the modes against pairs of radial runs and of runs in two dimensions, when disks buckle, and what a run says of it."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from multiphase.stepping import State, Tracker
from tumour import TumourGeometry, TumourInitial, TumourParameters, simulate
from tumour.stability import CriticalTime, critical_time, figure, modes, state, stiffness
from tumour.stability.modes import ladder
from tumour.stability.state import radial_states

PRINTED = TumourParameters.preset("paper")
DARCY = replace(PRINTED, mobility="darcy")


def test_a_change_of_the_radial_state_is_the_mode_of_wave_number_0(monkeypatch: pytest.MonkeyPatch) -> None:
    """The difference of two radial runs on the same cells, over the difference of their seeds, to six digits: 1e-10 in each run and 1e-8 of
    third derivatives allow more, the steps of the mode (1e-2, extrapolated) are what is left."""
    values = {
        "mu_alpha": 1.3, "lambda_alpha": 0.4, "kappa": 0.7, "gamma": 0.8, "alpha_star": 0.75, "alpha_min": 0.75, "s1": 8.0, "s2": 0.4,
        "s3": 0.6, "s4": 9.0, "Q": 2.5, "Q1_hat": 0.5, "C_out": 1.1, "p_out": -0.3,
    }  # fmt: skip
    p = TumourParameters(**values, mobility="printed", mobility_floor=0.1)
    geometry, eps = TumourGeometry(kind="disk", radius=1.5), 1e-4
    monkeypatch.setattr(state, "RTOL", 1e-10)
    runs = [radial_states(p, TumourInitial(alpha=f"0.85 + {sign * eps}*xi**2"), geometry, [0.0, 5.0], 40) for sign in (1, -1)]
    expected = (runs[0][-1].r[-1] - runs[1][-1].r[-1]) / (2.0 * eps)
    found = [
        modes(p, initial=TumourInitial(alpha=0.85), geometry=geometry, wave_numbers=[0], t_end=5.0, seed=2, cells=40, dt=dt, rows=1)
        for dt in (0.1, 0.05, 0.025)
    ]
    errors = [run.amplitude[-1, 0] / expected - 1.0 for run in found]
    assert abs(errors[1] + (errors[1] - errors[0]) / 3.0) < 1e-6
    assert 3.5 < (errors[1] - errors[0]) / (errors[2] - errors[1]) < 5.5  # order two in time
    assert np.all(found[0].tangential == 0.0)


def test_ladder() -> None:
    times = ladder(60.0, 0.2)
    steps = np.diff(times)
    assert times[0] == 0.0
    assert times[-1] == 60.0
    assert steps[0] < 1e-4
    assert np.max(steps) <= 0.2
    assert np.max(steps[1:] / steps[:-1]) < 2.0  # BDF of order two is stable up to 2.4


def test_modes_against_two_dimensions() -> None:
    """U per seed of runs of the quarter disk on 80 rings with dt = 0.25 (benchmarks/tumour_modes.md), whose own errors there are a third
    of the changes from 40 to 80 rings: 1e-3 of 1.546 and 3e-3 of 3.651 for k = 2, 5e-3 and 0.2 for k = 4."""
    found = modes(PRINTED, initial=TumourInitial(alpha=0.82), wave_numbers=[2, 4], t_end=60.0, cells=100, dt=0.2, rows=1)
    assert found.at(50.0)[0] == pytest.approx(1.5459, rel=1e-3)
    assert found.at(60.0)[0] == pytest.approx(3.6509, rel=1e-3)
    np.testing.assert_allclose(found.at(50.0), [1.5459, 1.3452], rtol=7e-3)
    np.testing.assert_allclose(found.at(60.0), [3.6509, 9.3848], rtol=4e-2)


def test_modes_converge() -> None:
    """Order two or nearly: cells lose their contact one by one."""
    values = [
        modes(PRINTED, initial=TumourInitial(alpha=0.82), wave_numbers=[2, 5], t_end=50.0, cells=N, dt=dt, rows=1).amplitude[-1]
        for N, dt in ((40, 0.4), (80, 0.2), (160, 0.1))
    ]
    first, second = np.abs(values[1] - values[0]), np.abs(values[2] - values[1])
    assert np.all(second < 0.4 * first)
    assert np.all(second < 5e-3 * np.abs(values[2]))


@pytest.fixture(scope="module")
def printed() -> CriticalTime:
    return critical_time(PRINTED, wave_numbers=[2, 3, 4, 5, 6, 8], t_end=70.0, cells=100)


def test_when_the_papers_disk_buckles(printed: CriticalTime) -> None:
    """100 cells against 200: 0.05 for k <= 5, 0.17 for k = 8, whose mode is narrow."""
    np.testing.assert_allclose(printed.drained[1:5], [66.79, 64.07, 63.60, 63.71], atol=0.1)
    np.testing.assert_allclose(printed.undrained[1:5], [67.55, 64.52, 64.03, 64.16], atol=0.1)
    assert np.isnan(printed.drained[0])
    assert printed.first == (pytest.approx(63.6, abs=0.1), 5)
    darcy = critical_time(DARCY, wave_numbers=[2, 4, 6], t_end=68.0, cells=100)
    assert darcy.first == (pytest.approx(61.1, abs=0.1), 4)
    assert np.all(darcy.undrained > darcy.drained)


def test_critical_time_is_a_zero_of_the_stiffness(printed: CriticalTime) -> None:
    found = stiffness(PRINTED, wave_numbers=[5], times=[printed.drained[3]], cells=100)
    assert abs(found.drained[0, 0]) < 2e-5  # 1e-3 of time, from the states between those 0.25 apart, times its slope of 0.02


@pytest.mark.parametrize(("lam", "times"), [(0.01, (65.6, 63.5)), (0.05, (73.7, 73.4)), (0.1, (86.6, 87.7)), (0.3, (np.nan, np.nan))])
def test_lambda_puts_buckling_off(lam: float, times: tuple[float, float]) -> None:
    """Printed and derived mobility; 100 cells leave 0.1."""
    for p, expected in zip((PRINTED, DARCY), times, strict=True):
        found, _ = critical_time(replace(p, lambda_alpha=lam), wave_numbers=[3, 4, 5, 6], t_end=100.0, cells=100).first
        np.testing.assert_allclose(found, expected, atol=0.15)


def test_growth_before_the_disk_buckles(printed: CriticalTime) -> None:
    """No rate is large while the stiffness is; the response grows without a bound towards its zero."""
    found = modes(PRINTED, wave_numbers=[2, 5], t_end=63.0, cells=80, dt=0.2, rows=8)
    rate = [np.interp(t, found.t, found.rate[:, 1]) for t in (44.0, 50.0, 56.0, 60.0)]
    np.testing.assert_allclose(rate, [0.0643, 0.0999, 0.1863, 0.3996], rtol=0.04)  # 400 cells
    np.testing.assert_allclose(np.array(rate[2:]) * (printed.first[0] - np.array([56.0, 60.0])), 1.45, atol=0.1)  # (t* - t)^-1.4
    assert np.interp(60.0, found.t, found.rate[:, 0]) < 0.1
    np.testing.assert_allclose(found.stiffness.t, np.linspace(0.0, 63.0, 8), atol=0.2)
    assert np.all(found.stiffness.undrained > found.stiffness.drained)
    assert np.all(np.diff(found.stiffness.drained[1:, 1]) < 0.0)
    stable = modes(replace(PRINTED, lambda_alpha=1.0), wave_numbers=[2, 4], t_end=60.0, cells=60, dt=0.4, rows=2)
    assert np.all(stable.rate[-1] < 0.0)
    assert np.all(stable.stiffness.drained > 0.4)


def test_values_end_where_rates_have_no_bound(printed: CriticalTime) -> None:
    """And they are large there: from the drained zero on growth is far faster than before."""
    found = modes(PRINTED, wave_numbers=[2, 5], t_end=65.0, cells=100, dt=0.1, rows=1)
    last = found.t[np.flatnonzero(np.isfinite(found.amplitude[:, 1]))[-1]]
    assert printed.undrained[3] - 0.1 < last < printed.undrained[3]
    assert np.nanmax(np.abs(found.shape[:, 1])) > 100.0 * np.interp(60.0, found.t, found.shape[:, 1])
    assert np.all(np.isfinite(found.amplitude[:, 0]))


def test_quarter_disks_have_even_modes() -> None:
    found = modes(geometry="quarter_disk", t_end=1.0, cells=20, rows=1)
    assert found.wave_numbers.tolist() == [2, 4, 6, 8]
    whole = modes(wave_numbers=[4], t_end=1.0, cells=20, rows=1)
    assert whole.amplitude[-1, 0] == found.amplitude[-1, 1]


def warnings_of(caplog: pytest.LogCaptureFixture, **settings: Any) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        simulate(**{"parameters": PRINTED, "cells": 60, **settings})
    return [record.getMessage() for record in caplog.records]


def test_a_radial_run_warns_of_it(caplog: pytest.LogCaptureFixture) -> None:
    """Once when the disk is soft and once when its stiffness is gone, at the time that `critical_time` finds for 60 cells, 63.44."""
    assert warnings_of(caplog, t_end=55.0) == []
    plan, first = warnings_of(caplog, t_end=62.0)  # the plan's own, from its end
    assert "says when" in plan
    assert "at t = 59.52 the stiffness of the disk against changes of shape cos(5 theta) is down to 0.081 mu_alpha" in first
    for settings in ({}, {"time_scheme": "bdf2", "rtol": 1e-5}, {"save_every": 3.0}):
        _, first, second = warnings_of(caplog, t_end=72.0, **settings)
        assert "is down to 0.0" in first
        assert "at about t = 63.4: its stiffness against changes of shape cos(5 theta)" in second
    assert (
        "at about t = 63.5: its stiffness against changes of shape cos(6 theta)"
        in warnings_of(caplog, t_end=72.0, geometry="quarter_disk")[-1]
    )
    _, only = warnings_of(caplog, t_end=72.0, save_at=[50.0, 72.0])
    assert "has lost its stability between t = 50 and 72" in only


@pytest.mark.parametrize(
    "settings",
    [
        {"geometry": {"kind": "disk", "formulation": "eulerian"}}, {"geometry": "slab"},
        {"parameters": replace(PRINTED, lambda_alpha=1.0)},
        {"parameters": replace(PRINTED, sigma_width=0.05), "initial": TumourInitial(alpha=0.79), "t_end": 5.0},
    ],
)  # fmt: skip
def test_others_are_not_warned_of(settings: dict[str, Any], caplog: pytest.LogCaptureFixture) -> None:
    found = warnings_of(caplog, **{"t_end": 70.0, **settings})
    assert not any("stiffness" in warning for warning in found)


def test_a_run_that_ends_between_rows_is_looked_at_where_it_ends(caplog: pytest.LogCaptureFixture) -> None:
    from multiphase.stepping import StopRun

    class Stop(Tracker):
        def on_step(self, state: State) -> None:
            if state.t > 65.0:
                raise StopRun("far enough")

    found = warnings_of(caplog, t_end=80.0, save_at=[40.0, 80.0], time_scheme="bdf2", trackers=[Stop()])
    assert "has lost its stability between t = 40 and 6" in found[-1]


def test_the_figure() -> None:
    growth = modes(wave_numbers=[2, 5], t_end=62.0, cells=40, dt=0.4, rows=20)
    critical = {lam: critical_time(replace(DARCY, lambda_alpha=lam), wave_numbers=[4], t_end=70.0, cells=40) for lam in (0.0, 0.01, 0.3)}
    axes = figure(growth, critical).axes
    assert len(axes) == 4
    assert len(axes[0].lines) == 2
    points = [line for line in axes[3].lines if line.get_marker() == "o"]
    assert sorted(float(line.get_xdata()[0]) for line in points) == pytest.approx([critical[0.0].first[0], critical[0.01].first[0]])
    assert "none" in [text.get_text() for text in axes[3].texts]
    alone = figure(growth).axes[3]
    np.testing.assert_array_equal(alone.lines[0].get_ydata(), growth.stiffness.drained[-1])
