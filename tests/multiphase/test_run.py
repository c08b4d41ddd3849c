"""From a scene to a result: names, stored times, resuming, failing, output options; on the plaque with few cells."""

from __future__ import annotations

import itertools
import logging
import os
import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

import multiphase
from multiphase.errors import ParameterError, SolverError
from multiphase.run import Terminated, plan_of, run
from multiphase.scene import Scene, parse_scene
from multiphase.stepping import Snapshot, State, StopRun, Tracker
from plaque1d import PlaqueInitial, PlaqueParameters, simulate

FIELDS = ["n", "c", "l", "u_n", "u_m", "p_n"]
SCALARS = ["L", "L_rate", "l_wall", "n_wall", "n_total", "c_total", "l_total", "defect_L", "defect_n", "defect_c", "defect_l"]
END = 0.05

TEXT = """
[scene]
model = "plaque"
[parameters]
preset = "demo"
[time]
end = 0.05
save_at = [0.01, 0.03]
[solver]
cells = 8
rtol = 1e-2
time_scheme = "bdf2"  # the common loop, which meets every stored time with a step
"""


def scene(*sets: str) -> Scene:
    return parse_scene(TEXT, name="small", sets=sets)


def datasets(path: Path) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    """Type, shape and bytes of every dataset of an HDF5 file."""
    found: dict[str, tuple[str, tuple[int, ...], bytes]] = {}
    with h5py.File(path) as file:

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = (str(item.dtype), item.shape, np.asarray(item[()]).tobytes())

        file.visititems(visit)
    return found


class At(Tracker):
    """Does something at one step."""

    def __init__(self, step: int, act: Callable[[], object]) -> None:
        self.step, self.act = step, act

    def on_step(self, state: State) -> None:
        if state.counters["steps"] == self.step:
            self.act()


def stop() -> None:
    raise StopRun("enough seen")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of an uninterrupted run."""
    file = tmp_path_factory.mktemp("reference") / "run.h5"
    run(scene(), file=file)
    return file


# -- what a run gives -------------------------------------------------------------------------------------------------


def test_result_has_the_names_of_the_contract(reference: Path) -> None:
    result = multiphase.load(reference)
    assert sorted(result.fields) == sorted(FIELDS)
    assert sorted(result.scalars) == sorted(SCALARS)
    assert all(result[name].shape == (4, 8) for name in FIELDS)
    assert all(result[name].shape == (4,) for name in SCALARS)
    assert result.x.shape == (4, 8)
    assert result.status == "completed"
    assert result.model == "plaque"
    assert all(np.all(np.isfinite(result[name])) for name in (*FIELDS, *SCALARS))


def test_positions_are_cell_centres_of_the_growing_domain(reference: Path) -> None:
    result = multiphase.load(reference)
    assert np.allclose(result.x / result["L"][:, None], (np.arange(8) + 0.5) / 8, rtol=1e-14)
    assert result["L"][-1] > result["L"][0] == 1.0


def test_stored_times_are_exact_with_start_and_end(reference: Path) -> None:
    assert multiphase.load(reference).t.tolist() == [0.0, 0.01, 0.03, END]


def test_stats_say_what_the_run_cost(reference: Path) -> None:
    result = multiphase.load(reference)
    assert {"steps", "rejected_error", "rejected_solver", "iterations", "wall_s", "solver", "threads", "unknowns"} <= set(result.stats)
    assert result.stats["steps"] > 3
    assert result.stats["iterations"] >= result.stats["steps"]
    assert result.stats["solver"] == "lines"
    assert {"python", "multiphase-tissue", "numpy", "scipy", "fipy", "h5py"} <= set(result.versions)
    assert result.platform
    assert result.created


def test_the_file_keeps_the_scene_and_the_plan(reference: Path) -> None:
    result = multiphase.load(reference)
    assert result.scene_source == TEXT
    assert parse_scene(result.scene, name="small") == scene()
    assert plan_of(result)["solver"] == "lines"
    assert "k_l" in result.scene


def test_a_run_without_a_file_gives_the_same_values(reference: Path) -> None:
    result, stored = run(scene()), multiphase.load(reference)
    for name in ("t", "x", *FIELDS, *SCALARS):
        assert result[name].tobytes() == stored[name].tobytes()
    assert result.checkpoint["u"].tobytes() == stored.checkpoint["u"].tobytes()


def test_only_the_fields_asked_for_are_stored(tmp_path: Path) -> None:
    file = tmp_path / "n.h5"
    run(scene('output.fields=["n", "u_m"]'), file=file)
    result = multiphase.load(file)
    assert sorted(result.fields) == ["n", "u_m"]
    assert sorted(result.scalars) == sorted(SCALARS)


# -- existing files ---------------------------------------------------------------------------------------------------


def test_an_existing_file_is_refused(reference: Path) -> None:
    before = reference.read_bytes()
    with pytest.raises(ParameterError, match="exists already") as caught:
        run(scene(), file=reference)
    assert caught.value.path == "output.file"
    assert reference.read_bytes() == before


def test_resuming_a_completed_run_changes_nothing(reference: Path) -> None:
    before, modified = reference.read_bytes(), reference.stat().st_mtime_ns
    result = run(scene(), file=reference, existing="resume")
    assert result.status == "completed"
    assert reference.read_bytes() == before
    assert reference.stat().st_mtime_ns == modified


def test_resuming_without_a_file_yet_starts_afresh(reference: Path, tmp_path: Path) -> None:
    file = tmp_path / "new.h5"
    run(scene(), file=file, existing="resume")
    assert datasets(file) == datasets(reference)


def test_replacing_starts_afresh(reference: Path, tmp_path: Path) -> None:
    file = tmp_path / "old.h5"
    run(scene("parameters.k_m=0.5", "time.end=0.01"), file=file)
    run(scene(), file=file, existing="replace")
    assert datasets(file) == datasets(reference)


def test_resuming_with_a_later_end_goes_on(reference: Path, tmp_path: Path) -> None:
    """The first end is one of the later run's stored times, so both land there and every value is the same."""
    file = tmp_path / "run.h5"
    run(scene("time.end=0.03"), file=file)
    assert multiphase.load(file).t.tolist() == [0.0, 0.01, 0.03]
    result = run(scene(), file=file, existing="resume")
    assert result.status == "completed"
    assert datasets(file) == datasets(reference)
    assert parse_scene(multiphase.load(file).scene, name="small").time.end == END


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("parameters.k_m=0.5", "parameters.k_m: 1.0 in the file, 0.5 in the scene"),
        ("solver.cells=9", "solver.cells"),
        ("initial.n=0.8", "initial.n"),
        ("time.save_at=[0.02]", "time.save_at"),
        ("time.end=0.04", "time.end"),
        ('output.fields=["n"]', "output.fields"),
    ],
)
def test_resuming_another_scene_is_refused_by_name(reference: Path, change: str, named: str) -> None:
    before = reference.read_bytes()
    with pytest.raises(ParameterError) as caught:
        run(scene(change), file=reference, existing="resume")
    assert named in str(caught.value)
    assert reference.read_bytes() == before


def test_resuming_needs_a_file() -> None:
    with pytest.raises(ParameterError, match="resume needs the file"):
        run(scene(), existing="resume")


def test_a_folder_that_is_not_there_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="folder does not exist"):
        run(scene(), file=tmp_path / "no" / "run.h5")
    with pytest.raises(ParameterError, match="it is a folder"):
        run(scene(), file=tmp_path)


# -- stopping and failing ---------------------------------------------------------------------------------------------


def test_a_tracker_stops_the_run_and_it_goes_on_bit_for_bit(reference: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    steps = int(multiphase.load(reference).stats["steps"])
    for step in (1, steps // 2, steps - 1):
        result = run(scene(), file=file, existing="resume", trackers=[At(step, stop)])
        assert result.status == "stopped"
        assert "enough seen" in result.message
        stored = multiphase.load(file)
        assert stored.status == "stopped"
        assert stored.message == result.message
        assert stored.checkpoint["counters"][0] == step
    run(scene(), file=file, existing="resume")
    assert datasets(file) == datasets(reference)


def test_the_cost_of_a_resumed_run_includes_what_went_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = itertools.count()
    monkeypatch.setattr("multiphase.run.time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))
    file = tmp_path / "run.h5"
    first = run(scene(), file=file, trackers=[At(2, stop)])
    second = run(scene(), file=file, existing="resume", trackers=[At(3, stop)])
    assert (first.stats["wall_s"], second.stats["wall_s"]) == (1.0, 2.0)
    assert (first.stats["steps"], second.stats["steps"]) == (2, 3)


def test_a_run_stopped_at_its_very_end_can_be_resumed(reference: Path, tmp_path: Path) -> None:
    class Late(Tracker):
        def on_save(self, state: State, snapshot: Snapshot) -> None:
            if snapshot.t == END:
                raise StopRun("steady")

    file = tmp_path / "run.h5"
    assert run(scene(), file=file, trackers=[Late()]).status == "stopped"
    assert run(scene(), file=file, existing="resume").status == "completed"
    assert multiphase.load(file).status == "completed"
    assert datasets(file) == datasets(reference)


@pytest.mark.parametrize(("number", "error"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_signal_ends_the_run_after_the_step(reference: Path, tmp_path: Path, number: signal.Signals, error: type[BaseException]) -> None:
    """Also one that strikes where the exception would be swallowed, as FiPy does."""

    def handler(*_: object) -> None:
        raise error

    def strike() -> None:
        try:
            signal.raise_signal(number)
        except BaseException:
            return

    old = signal.signal(number, handler)
    file = tmp_path / "run.h5"
    try:
        with pytest.raises(error):
            run(scene(), file=file, trackers=[At(5, strike)])
        assert signal.getsignal(number) is handler
    finally:
        signal.signal(number, old)
    stored = multiphase.load(file)
    assert stored.status == "stopped"
    assert "interrupted at t =" in stored.message
    assert stored.checkpoint["counters"][0] == 5
    run(scene(), file=file, existing="resume")
    assert datasets(file) == datasets(reference)


def test_a_signal_before_the_first_step_leaves_a_file_to_resume(reference: Path, tmp_path: Path) -> None:
    class Early(Tracker):
        def on_start(self, state: State, t_end: float) -> None:
            signal.raise_signal(signal.SIGINT)

    file = tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        run(scene(), file=file, trackers=[Early()])
    assert multiphase.load(file).t.size == 0
    run(scene(), file=file, existing="resume")
    assert datasets(file) == datasets(reference)


def test_a_second_signal_acts_at_once() -> None:
    calls = []

    def twice() -> None:
        for _ in range(2):
            calls.append(len(calls))
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run(scene(), trackers=[At(2, twice), At(2, lambda: calls.append("went on"))])
    assert calls == [0, 1]


def test_a_failure_keeps_everything_up_to_the_last_good_step(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    with pytest.raises(SolverError, match="max_steps = 3") as caught:
        run(scene("solver.max_steps=3"), file=file)
    result = caught.value.result
    assert result.status == "failed"
    assert result.checkpoint["counters"][0] == 3
    assert result.t.tolist() == [0.0]
    stored = multiphase.load(file)
    assert stored.status == "failed"
    assert stored.message == result.message
    assert "max_steps = 3" in stored.message
    assert stored.checkpoint["times"][0] == caught.value.time > 0.0


def test_a_failure_can_be_returned() -> None:
    result = run(scene("solver.max_steps=3"), raise_on_failure=False)
    assert result.status == "failed"
    assert "max_steps = 3" in result.message


def test_a_step_that_cannot_be_solved_fails_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multiphase.lines.NEWTON_ITERATIONS", 1)
    monkeypatch.setattr("multiphase.lines.NEWTON_TOLERANCE", -1.0)
    with pytest.raises(SolverError, match="does not converge") as caught:
        run(scene())
    assert caught.value.time == 0.0
    assert len(caught.value.history) == 12


def test_trackers_hear_of_the_end() -> None:
    heard = []

    class Ear(Tracker):
        def on_end(self, state: State, status: str, message: str) -> None:
            heard.append((state.t, status))

    run(scene("time.end=0.01"), trackers=[Ear()])
    run(scene("time.end=0.01", "solver.max_steps=1"), trackers=[Ear()], raise_on_failure=False)
    assert [status for _, status in heard] == ["completed", "failed"]
    assert heard[0][0] == 0.01


def test_the_plans_warnings_go_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        run(scene("parameters.momentum=drag", "initial.n=0.3", "time.end=1e9", "solver.max_steps=1"), raise_on_failure=False)
    assert "momentum = drag" in caplog.text
    assert "e-foldings" in caplog.text


# -- from Python ------------------------------------------------------------------------------------------------------


def small(**arguments: Any) -> Any:
    return simulate(**{"t_end": END, "save_at": [0.01, 0.03], "cells": 8, "rtol": 1e-2, "time_scheme": "bdf2"} | arguments)


def test_simulate_gives_what_the_scene_gives(reference: Path) -> None:
    result, stored = small(), multiphase.load(reference)
    for name in ("t", "x", *FIELDS, *SCALARS):
        assert result[name].tobytes() == stored[name].tobytes()


def test_simulate_with_a_file(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    first = small(file=file, t_end=0.03, save_at=[0.01])
    assert multiphase.load(file)["n"].tobytes() == first["n"].tobytes()
    with pytest.raises(ParameterError, match="exists already"):
        small(file=str(file))
    longer = small(file=file, resume=True)
    assert longer.t.tolist() == [0.0, 0.01, 0.03, END]
    with pytest.raises(ParameterError, match=r"parameters\.k_m"):
        small(file=file, resume=True, parameters=PlaqueParameters(k_m=0.5))
    changed = small(file=file, overwrite=True, parameters=PlaqueParameters(k_m=0.5), initial=PlaqueInitial(n=0.8), t_end=0.01, save_at=[])
    assert multiphase.load(file).t.tolist() == [0.0, 0.01]
    assert changed["n"][0] == pytest.approx(np.full(8, 0.8), rel=1e-14)


def test_simulate_stores_51_times_by_default() -> None:
    result = simulate(t_end=1e-6, cells=4, rtol=1e-1)
    assert len(result.t) == 51
    assert result.t[-1] == 1e-6


def test_simulate_refuses_by_dotted_path() -> None:
    for arguments, path in (
        ({"t_end": -1.0}, "time.end"),
        ({"cells": 2}, "solver.cells"),
        ({"rtol": 0.0}, "solver.rtol"),
        ({"solver": "spectral"}, "solver.method"),
        ({"geometry": "cube"}, "geometry.kind"),
        ({"save_at": [99.0]}, "time.save_at"),
    ):
        with pytest.raises(ParameterError) as caught:
            small(**arguments)
        assert caught.value.path == path


def test_simulate_uses_the_fixed_step_and_scheme() -> None:
    result = small(dt=0.005, time_scheme="backward-euler")
    assert result.stats["steps"] == 10
    assert result.stats["rejected_error"] == 0


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="counts threads on Linux only")
def test_threads_are_those_asked_for() -> None:
    from threadpoolctl import threadpool_info

    seen = []

    class Look(Tracker):
        def on_step(self, state: State) -> None:
            seen.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

    run(scene("time.end=0.01"), trackers=[Look()], threads=1)
    assert set(seen) == {1}


def test_a_longer_run_keeps_the_default_spacing_of_its_times(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    settings = {"cells": 8, "rtol": 1e-2, "file": file}
    simulate(t_end=0.1, **settings)
    longer = simulate(t_end=0.12, resume=True, **settings)
    np.testing.assert_allclose(np.diff(longer.t), 0.002, rtol=1e-9)  # rounding of the times
    again = simulate(t_end=0.12, resume=True, **settings)
    assert len(again.t) == len(longer.t)
