"""What hangs on the time loop: recording, progress, balances, stopping rules, on a toy scheme."""

from __future__ import annotations

import io
import logging
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import multiphase
from multiphase import storage
from multiphase.errors import ParameterError
from multiphase.result import Result
from multiphase.stepping import Control, Snapshot, Solved, State, StopRun, Tracker, integrate, start
from multiphase.trackers import Balances, Progress, Recorder, SteadyState, WallTime, _Column

SAVE_AT = (0.0, 0.25, 0.5, 1.0)


class Decay:
    """y' = -y from 1 in two cells, and a scalar; the same Protocol as the models' schemes."""

    breaks: tuple[float, ...] = ()
    kinks: tuple[float, ...] = ()

    def initial(self) -> Any:
        return np.array([1.0, 2.0])

    def consistent(self, t: float, u: Any) -> Any:
        return u.copy()

    def solve(self, t: float, alpha: float, past: Any, guess: Any) -> Solved:
        return Solved(alpha * past / (alpha + 1.0), 1)

    def error_norm(self, error: Any, u: Any) -> float:
        return float(np.max(np.abs(error))) / 1e-3

    def observe(self, t: float, u: Any) -> Snapshot:
        return Snapshot(t, {"L": 1.0 + t}, {"n": u, "l": 2.0 * u}, np.array([0.25, 0.75]) * (1.0 + t))


def run(*trackers: Tracker, save_at: tuple[float, ...] = SAVE_AT, dt: float | None = None) -> State:
    control = Control(dt=dt)
    return integrate(Decay(), start(Decay(), save_at[0], save_at[1], control), save_at, control, trackers)


def empty() -> Result:
    return Result(model="plaque", t=np.empty(0))


def state_at(t: float, steps: int = 0) -> State:
    return State(np.array([t]), np.zeros((1, 2)), 0.1, {"steps": steps, "rejected_error": 0, "rejected_solver": 0, "iterations": 0})


def snapshot(t: float, y: float = 1.0, **scalars: float) -> Snapshot:
    return Snapshot(t, scalars, {"n": np.full(2, y)}, np.zeros(2))


# -- Recorder ---------------------------------------------------------------------------------------------------------


def test_recorder_keeps_every_output_time_and_the_last_state() -> None:
    recorder = Recorder(empty(), None)
    state = run(recorder)
    result = recorder.collect()
    assert result.t.tolist() == list(SAVE_AT)
    assert result["L"].tolist() == [1.0 + t for t in SAVE_AT]
    assert list(result.fields) == ["n", "l"]
    assert result["n"].shape == (4, 2)
    assert result["n"][-1].tolist() == state.u[0].tolist()
    assert result["x"][2].tolist() == [0.375, 1.125]
    assert result.checkpoint["u"].tobytes() == state.u.tobytes()
    assert result.stats["steps"] == state.counters["steps"] > 3


def test_recorder_keeps_the_fields_asked_for_and_all_scalars() -> None:
    recorder = Recorder(empty(), None, ("l",))
    run(recorder)
    assert list(recorder.collect().fields) == ["l"]
    assert list(recorder.collect().scalars) == ["L"]


def test_collecting_twice_adds_nothing() -> None:
    recorder = Recorder(empty(), None)
    run(recorder)
    first = recorder.collect()
    again = recorder.collect()
    assert again.t.tolist() == first.t.tolist() == list(SAVE_AT)


def test_recorder_goes_on_from_a_stored_result(tmp_path: Path) -> None:
    whole = Recorder(empty(), None)
    run(whole)
    half = Recorder(empty(), tmp_path / "half.h5")
    run(half, save_at=(0.0, 0.25))
    half.write()
    stored = storage.read(tmp_path / "half.h5")
    rest = Recorder(stored, None)
    assert rest.state is not None
    integrate(Decay(), rest.state, (0.5, 1.0), Control(), [rest])
    joined, expected = rest.collect(), whole.collect()
    for name in ("t", "x", "L", "n", "l"):
        assert joined[name].tobytes() == expected[name].tobytes()


def test_the_file_is_whole_after_every_output_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multiphase.trackers.WRITING_SHARE", math.inf)  # write at every output time, however slow the disk
    file = tmp_path / "run.h5"
    recorder = Recorder(empty(), file)
    seen = []

    class Look(Tracker):
        def on_save(self, state: State, snapshot: Snapshot) -> None:
            loaded = multiphase.load(file)
            assert State.from_arrays(loaded.checkpoint).t == snapshot.t
            seen.append(len(loaded.t))

    run(recorder, Look())
    assert seen == [1, 2, 3, 4]


def test_writes_that_take_long_are_made_more_seldom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"now": 0.0}
    monkeypatch.setattr("multiphase.trackers.time.monotonic", lambda: clock["now"])
    writes = []

    def slow(result: Result, path: Path) -> None:
        clock["now"] += 1.0
        writes.append(len(result.t))

    monkeypatch.setattr("multiphase.trackers.storage.write", slow)
    recorder = Recorder(empty(), tmp_path / "run.h5")
    for i in range(41):
        recorder.on_save(state_at(float(i)), snapshot(float(i)))
        clock["now"] += 1.0
    # A write of 1 s, then none for 10 s: the first row, then every tenth.
    assert writes == [1, 11, 21, 31, 41]


def test_an_interrupt_while_a_row_is_kept_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C may strike while a row is copied; the collection made after it has them all, and its arrays fit each other."""
    recorder, number = Recorder(empty(), None), [0]
    real = _Column.put

    class Interrupted(Tracker):
        """In the place of the recorder: strikes at each of the copies of a row in turn, and lets the next attempt pass."""

        def on_save(self, state: State, snapshot: Snapshot) -> None:
            left = [number[0] % 5 + 1]  # t; x; L; n, l
            number[0] += 1

            def put(column: _Column, index: int, row: Any) -> None:
                left[0] -= 1
                if left[0] == 0:
                    raise KeyboardInterrupt
                real(column, index, row)

            with monkeypatch.context() as patch:
                patch.setattr(_Column, "put", put)
                with pytest.raises(KeyboardInterrupt):
                    recorder.on_save(state, snapshot)
            if number[0] % 2:  # two rows may wait
                assert recorder.collect().t.tolist() == list(SAVE_AT[: number[0]])

    run(Interrupted())
    result, whole = recorder.collect(), Recorder(empty(), None)
    run(whole)
    expected = whole.collect()
    for name in ("t", "x", "L", "n", "l"):
        assert result[name].tobytes() == expected[name].tobytes()


def test_what_was_collected_stays_as_it_is() -> None:
    recorder = Recorder(empty(), None)
    collected = []
    for i in range(40):  # the space doubles at 16 and 32 rows
        recorder.on_save(state_at(float(i)), snapshot(float(i), y=float(i), L=2.0 * i))
        collected.append(recorder.collect())
    for count, result in enumerate(collected, start=1):
        assert result.t.tolist() == [float(i) for i in range(count)]
        assert result["n"].tolist() == [[float(i)] * 2 for i in range(count)]
        assert result["L"].tolist() == [2.0 * i for i in range(count)]


def test_a_quantity_that_a_stored_result_lacks_is_named() -> None:
    stored = Result(model="plaque", t=np.zeros(1), x=np.zeros((1, 2)), fields={"n": np.zeros((1, 2))})
    with pytest.raises(ParameterError, match="L: is not in the stored result"):
        Recorder(stored, None).on_save(state_at(1.0), snapshot(1.0, L=1.0))


# -- Progress ---------------------------------------------------------------------------------------------------------


def test_progress_prints_a_line_every_tenth_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    run(Progress(stream), dt=0.01)
    lines = stream.getvalue().splitlines()
    percent = np.array([int(line.split()[0]) for line in lines])
    assert np.all(percent // 10 == np.arange(1, 10))
    assert np.all(percent % 10 <= 1)  # steps of one percent, up to rounding
    assert re.fullmatch(r" 50 %  t = 0\.5, \d+ steps", lines[4])


def test_progress_lines_use_the_words_for_times() -> None:
    stream = io.StringIO()
    run(Progress(stream, describe=lambda t: f"{10.0 * t:.3g} weeks"), dt=0.01)
    assert "t = 5 weeks" in stream.getvalue()


def test_progress_of_a_resumed_run_starts_where_that_run_starts() -> None:
    stream = io.StringIO()
    tracker = Progress(stream)
    tracker.on_start(state_at(0.55), 1.0)
    for t in (0.58, 0.61, 0.65, 0.72):
        tracker.on_step(state_at(t, 7))
    assert [line.split()[0] for line in stream.getvalue().splitlines()] == ["61", "72"]


def test_progress_in_a_terminal_is_a_bar_that_goes_away() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    tracker = Progress(stream)
    state = run(tracker, dt=0.01)
    tracker.on_end(state, "completed", "")
    text = stream.getvalue()
    assert "running" in text
    assert "%" in text
    assert "\n" not in text.rstrip("\n")
    assert text.rstrip(" \r\n").split("\r")[-1].strip() == "" or text.endswith("\r")


# -- Balances ---------------------------------------------------------------------------------------------------------


def test_balances_warn_once_for_each_defect(caplog: pytest.LogCaptureFixture) -> None:
    tracker = Balances(1e-9)
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        tracker.on_save(state_at(0.0), snapshot(0.0, defect_L=1e-10, defect_n=-1e-10, L=5.0))
        assert not caplog.records
        tracker.on_save(state_at(1.0), snapshot(1.0, defect_L=2e-9, defect_n=0.0, L=5.0))
        tracker.on_save(state_at(2.0), snapshot(2.0, defect_L=3e-9, defect_n=math.nan, L=5.0))
    assert [record.name for record in caplog.records] == ["multiphase", "multiphase"]
    assert "defect_L = 2e-09 at t = 1" in caplog.messages[0]
    assert "defect_n = nan at t = 2" in caplog.messages[1]


def test_a_negative_defect_counts_too(caplog: pytest.LogCaptureFixture) -> None:
    Balances(1e-9).on_save(state_at(0.0), snapshot(0.0, defect_c=-1e-3))
    assert "defect_c = -0.001" in caplog.text


def test_balances_left_open_by_choice_are_not_watched(caplog: pytest.LogCaptureFixture) -> None:
    Balances(1e-9, left_open=("defect_n",)).on_save(state_at(0.0), snapshot(0.0, defect_n=1e-3, defect_c=1e-3))
    assert len(caplog.records) == 1
    assert "defect_c = 0.001" in caplog.text


# -- stopping rules ---------------------------------------------------------------------------------------------------


def test_wall_time_stops_after_the_limit_and_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"now": 100.0}
    monkeypatch.setattr("multiphase.trackers.time.monotonic", lambda: clock["now"])
    tracker = WallTime(5.0)
    clock["now"] = 1000.0  # time between making the tracker and starting the run does not count
    tracker.on_start(state_at(0.0), 1.0)
    clock["now"] = 1004.9
    tracker.on_step(state_at(0.1))
    clock["now"] = 1005.1
    with pytest.raises(StopRun, match="5 s"):
        tracker.on_step(state_at(0.2))


def test_a_run_stopped_by_wall_time_goes_on_bit_for_bit() -> None:
    whole = Recorder(empty(), None)
    run(whole)
    part = Recorder(empty(), None)
    with pytest.raises(StopRun):
        run(part, WallTime(-1.0))
    stopped = part.collect()
    assert stopped.t.tolist() == [0.0]
    state = State.from_arrays(stopped.checkpoint)
    assert 0.0 < state.t < 0.25
    integrate(Decay(), state, SAVE_AT[1:], Control(), [part])
    assert part.collect()["n"].tobytes() == whole.collect()["n"].tobytes()


def test_steady_state_stops_when_nothing_changes() -> None:
    recorder, save_at = Recorder(empty(), None), tuple(float(t) for t in range(41))
    tracker = SteadyState(1e-3)

    class Constant(Decay):
        """y' = 1 - y: steady at 1. The tolerance on the rate is reached at e^-t = 1e-3 or so, t = 7 to 8."""

        def solve(self, t: float, alpha: float, past: Any, guess: Any) -> Solved:
            return Solved((alpha * past + 1.0) / (alpha + 1.0), 1)

        def observe(self, t: float, u: Any) -> Snapshot:
            return Snapshot(t, {"L": 3.0, "defect_L": t}, {"n": u, "zero": 0.0 * u}, np.zeros(2))

    control = Control(dt=0.1)
    with pytest.raises(StopRun, match="steady state"):
        integrate(Constant(), start(Constant(), 0.0, 1.0, control), save_at, control, [recorder, tracker])
    # The change of the second cell, which starts at 2, from t to t + 1 is (e - 1) e^-(t+1), below 2e-3 first from 6 to 7.
    assert recorder.collect().t[-1] == 7.0


def test_steady_state_counts_rates_per_unit_of_time() -> None:
    """The same small change is a large rate when the output times are close."""
    tracker = SteadyState(1e-3)
    tracker.on_save(state_at(0.0), snapshot(0.0, 1.0))
    tracker.on_save(state_at(1e-3), snapshot(1e-3, 1.0 + 1e-5))
    with pytest.raises(StopRun):
        tracker.on_save(state_at(1.0), snapshot(1.0, 1.0 + 2e-5))


def test_steady_state_looks_at_scalars_too() -> None:
    tracker = SteadyState(1e-3)
    for t in (0.0, 1.0, 2.0):
        tracker.on_save(state_at(t), snapshot(t, 1.0, L=1.0 + t))


def test_steady_state_measures_against_the_run_and_not_against_noise() -> None:
    tracker = SteadyState(1e-3)
    state = State(times=np.array([0.0]), u=np.zeros((1, 1)), dt=1.0)

    def snapshot(t: float, y: float, noise: float) -> Snapshot:
        return Snapshot(t, {"y": y, "noise": noise}, {}, np.zeros(1))

    tracker.on_save(state, snapshot(0.0, 1.0, 1e-28))
    tracker.on_save(state, snapshot(1.0, 1e-2, 5e-28))
    with pytest.raises(StopRun, match="steady state"):
        tracker.on_save(state, snapshot(2.0, 1e-3 + 1e-2 - 1e-3 - 5e-4, 1e-27))  # 5e-4 of the largest, 1; noise does not count
