"""What a run survives: kill -9, Ctrl-C, SIGTERM, a full disk. The real command in a process of its own."""

from __future__ import annotations

import contextlib
import os
import random
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import multiphase

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and RLIMIT_FSIZE are POSIX")

END = 0.2
SETTINGS = ["solver.method=fipy", "solver.cells=8", "solver.rtol=1e-3", "time.save_every=0.01"]
LINES = ["solver.method=lines", "solver.cells=3000", "solver.rtol=1e-8", "time.save_every=0.002"]
ANNULUS = [*LINES, "geometry.kind=annulus", "geometry.lumen_radius=5.0"]
COMPILED = {"slab": LINES, "annulus": ANNULUS, "annulus, drag": [*ANNULUS, "parameters.momentum=drag", "parameters.p_out=0.2"]}
PATIENCE = 120.0
"""Seconds after which a child is given up; no test measures time."""


def command(file: Path, *options: str, end: float = END, settings: Sequence[str] = SETTINGS) -> list[str]:
    sets = [part for setting in (*settings, f"time.end={end}") for part in ("--set", setting)]
    return [sys.executable, "-m", "multiphase.cli", "run", "plaque", *sets, "-o", str(file), "--quiet", *options]


def finish(arguments: list[str], **settings: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(arguments, capture_output=True, text=True, timeout=PATIENCE, **settings)


@contextlib.contextmanager
def child(arguments: list[str]) -> Any:
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for_writes(process: subprocess.Popen[str], file: Path, number: int) -> None:
    """Return once the file has been replaced `number` times (its inode changes), or the process has ended."""

    def version() -> tuple[int, int] | None:
        try:
            status = file.stat()
        except FileNotFoundError:
            return None
        return status.st_ino, status.st_mtime_ns

    limit, seen = time.monotonic() + PATIENCE, version()
    while number > 0 and process.poll() is None:
        assert time.monotonic() < limit, "the child wrote nothing"
        now = version()
        if now != seen:
            number, seen = number - 1, now
        time.sleep(1e-3)


def datasets(path: Path) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    """Type, shape and bytes of every dataset, the checkpoint's too."""
    found: dict[str, tuple[str, tuple[int, ...], bytes]] = {}
    with h5py.File(path) as file:

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = (str(item.dtype), item.shape, np.asarray(item[()]).tobytes())

        file.visititems(visit)
    return found


def assert_one_paragraph(text: str) -> None:
    assert text.startswith("multiphase: ")
    assert text.endswith("\n")
    assert text.count("\n") == 1
    assert "Traceback" not in text


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Every dataset of an uninterrupted run."""
    file = tmp_path_factory.mktemp("reference") / "run.h5"
    ended = finish(command(file))
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    found = datasets(file)
    assert {"t", "grid/x", "scalars/L", "fields/n", "checkpoint/u", "checkpoint/times", "checkpoint/dt", "checkpoint/counters"} <= set(
        found
    )
    return found


@pytest.mark.parametrize("seed", range(2))
def test_kill_at_random_moments_then_resume_is_bit_identical(seed: int, reference: dict[str, Any], tmp_path: Path) -> None:
    """Three kills in one run, each a random while after a random number of writes: while stepping, saving or waiting."""
    rng, file = random.Random(seed), tmp_path / "run.h5"
    landed = 0
    for _ in range(3):
        with child(command(file, "--resume")) as process:
            wait_for_writes(process, file, rng.randint(1, 3))
            time.sleep(rng.uniform(0.0, 0.08))
            process.send_signal(signal.SIGKILL)
            process.wait()
        landed += process.returncode == -signal.SIGKILL
        result = multiphase.load(file)  # opens, and its arrays fit each other
        assert len(result.t) >= 1
        assert result.checkpoint["times"][0] == result.t[-1]
        assert result.status == ("running" if process.returncode else "completed")
    assert landed >= 1
    ended = finish(command(file, "--resume"))
    assert (ended.returncode, ended.stderr) == (0, "")
    assert datasets(file) == reference
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]  # leftovers of the killed writes are gone


@pytest.mark.parametrize("case", COMPILED)
def test_lines_killed_and_resumed_equal_an_uninterrupted_run(case: str, tmp_path: Path) -> None:
    """Stored times lie between steps here, and the integrator goes on from the points of its last step."""
    settings, rng = COMPILED[case], random.Random(case)
    whole, file = tmp_path / "whole.h5", tmp_path / "run.h5"
    assert finish(command(whole, settings=settings)).returncode == 0
    landed = 0
    for _ in range(3):
        with child(command(file, "--resume", settings=settings)) as process:
            wait_for_writes(process, file, rng.randint(1, 4))
            process.send_signal(signal.SIGKILL)
            process.wait()
        landed += process.returncode == -signal.SIGKILL
    assert landed >= 1
    ended = finish(command(file, "--resume", settings=settings))
    assert (ended.returncode, ended.stderr) == (0, "")
    assert multiphase.load(file).checkpoint["times"].shape == (4,)
    assert datasets(file) == datasets(whole)


def test_kill_before_the_first_save_leaves_nothing_and_resume_starts_afresh(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    with child(command(file)) as process:
        process.send_signal(signal.SIGKILL)
    assert not file.exists()
    ended = finish(command(file, "--resume", end=0.01))
    assert ended.returncode == 0
    assert multiphase.load(file).t.tolist() == [0.0, 0.01]


@pytest.mark.parametrize(
    ("number", "status", "writes"), [(signal.SIGINT, 130, 1), (signal.SIGINT, 130, 4), (signal.SIGTERM, 143, 2)], ids=str
)
def test_ctrl_c_and_sigterm_say_one_sentence_and_resume(
    number: signal.Signals, status: int, writes: int, reference: dict[str, Any], tmp_path: Path
) -> None:
    file = tmp_path / "run.h5"
    with child(command(file)) as process:
        wait_for_writes(process, file, writes)
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == status
    assert out == ""
    assert_one_paragraph(err)
    assert "interrupted" in err
    stopped = multiphase.load(file)
    assert stopped.status == "stopped"
    assert "interrupted at t = " in stopped.message
    assert stopped.checkpoint["times"][0] < END

    # What it says to type is what goes on.
    words = shlex.split(err.split("To go on: ")[1])
    assert words[:2] == ["multiphase", "run"]
    ended = finish([sys.executable, "-m", "multiphase.cli", *words[1:], "--quiet"])
    assert (ended.returncode, ended.stderr) == (0, "")
    assert datasets(file) == reference


def test_ctrl_c_while_starting_says_one_sentence_and_resumes(reference: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    with child([argument for argument in command(file) if argument != "--quiet"]) as process:
        assert process.stdout.readline() == "Growing plaque, demonstration values\n"
        assert process.stdout.readline().startswith("fipy, slab")
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert_one_paragraph(err)
    assert multiphase.load(file).status == "stopped"
    assert finish(command(file, "--resume")).returncode == 0
    assert datasets(file) == reference


def limited(size: int) -> Callable[[], None]:
    """For a child: no file may grow beyond `size` bytes."""

    def limit() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


def test_a_disk_that_fills_keeps_what_was_saved(reference: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    assert finish(command(file, end=0.05)).returncode == 0
    before, size = datasets(file), file.stat().st_size
    content = file.read_bytes()

    ended = finish(command(file, "--resume"), preexec_fn=limited(size * 3 // 4))  # not even what is there would fit again
    assert ended.returncode == 3
    assert ended.stdout == ""
    assert_one_paragraph(ended.stderr)
    assert "the disk is full or the file may not grow" in ended.stderr
    assert "up to t = 0.05 is intact" in ended.stderr
    assert file.read_bytes() == content
    assert datasets(file) == before
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]

    assert finish(command(file, "--resume")).returncode == 0  # space again
    assert datasets(file) == reference


def test_a_disk_that_fills_on_the_way_keeps_the_last_whole_file(reference: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    assert finish(command(file, end=0.05)).returncode == 0
    size = file.stat().st_size
    ended = finish(command(file, "--resume"), preexec_fn=limited(size + 1024))  # room for two or three more times
    assert ended.returncode == 3
    assert_one_paragraph(ended.stderr)
    saved = multiphase.load(file)
    assert 0.05 <= saved.t[-1] < END
    assert f"up to t = {saved.t[-1]:.6g} is intact" in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]
    assert finish(command(file, "--resume")).returncode == 0
    assert datasets(file) == reference


def test_a_disk_that_is_full_from_the_start_leaves_no_file(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    ended = finish(command(file), preexec_fn=limited(1000))
    assert ended.returncode == 3
    assert_one_paragraph(ended.stderr)
    assert "nothing had been saved yet" in ended.stderr
    assert list(tmp_path.iterdir()) == []
