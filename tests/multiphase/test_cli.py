"""The command line: every command on one small result, and one clear sentence for everything that cannot be."""

from __future__ import annotations

import csv
import json
import logging
import os
import shlex
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

import multiphase
from multiphase.cli import main
from multiphase.run import Terminated
from multiphase.scene import load_scene

SMALL = ["--set", "solver.cells=8", "--set", "solver.rtol=1e-2", "--set", "time.end=0.03", "--set", "time.save_at=[0.01]"]


@pytest.fixture(autouse=True)
def _clean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An empty working folder, and the log as it was."""
    monkeypatch.chdir(tmp_path)
    log = logging.getLogger("multiphase")
    handlers, level = log.handlers, log.level
    yield
    log.handlers = handlers
    log.setLevel(level)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("cli") / "small.h5"
    assert main(["run", "plaque", *SMALL, "-o", str(file), "--quiet"]) == 0
    return file


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same but for the death rate."""
    file = tmp_path_factory.mktemp("cli") / "other.h5"
    assert main(["run", "plaque", *SMALL, "--set", "parameters.k_m=0.5", "-o", str(file), "--quiet"]) == 0
    return file


def refused(capsys: pytest.CaptureFixture[str], arguments: Sequence[str], *words: str, status: int = 2) -> str:
    """The one paragraph on standard error with which `arguments` are refused; no file appears."""
    before = sorted(Path().iterdir())
    found: object
    try:
        found = main(arguments)
    except SystemExit as error:  # from argparse
        found = error.code
    out, err = capsys.readouterr()
    assert found == status
    assert out == ""
    assert err.startswith("multiphase: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    assert "Traceback" not in err
    for word in words:
        assert word in err
    assert sorted(Path().iterdir()) == before
    return err


# -- scenes -----------------------------------------------------------------------------------------------------------


def test_scenes_lists_what_ships_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(line.split()[0] for line in lines)
    assert {"plaque", "plaque-mouse", "plaque-human", "plaque-drag"} <= {line.split()[0] for line in lines}
    assert all(len(line.split(maxsplit=1)) == 2 for line in lines)


def test_scenes_shows_and_copies_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "plaque"]) == 0
    shown = capsys.readouterr().out
    assert main(["scenes", "plaque", "--copy", "mine.toml"]) == 0
    assert "multiphase run mine.toml" in capsys.readouterr().out
    assert Path("mine.toml").read_text(encoding="utf-8") == shown
    assert load_scene("mine.toml") == load_scene("plaque")
    refused(capsys, ["scenes", "plaque", "--copy", "mine.toml"], "--copy", "exists already")
    assert Path("mine.toml").read_text(encoding="utf-8") == shown


def test_scenes_refuses_an_unknown_name(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["scenes", "plague"], "plague", '"plaque"')
    refused(capsys, ["scenes", "--copy", "x.toml"], "name the scene")


# -- run --------------------------------------------------------------------------------------------------------------


def test_run_says_how_it_ended_and_what_to_type_next(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", *SMALL]) == 0
    out, err = capsys.readouterr()
    assert Path("plaque.h5").exists()
    labels = ("ended", "width L", "growth rate", "necrotic fraction", "balance defects", "cost", "file", "next")
    assert all(any(line.startswith(label) for line in out.splitlines()) for label in labels)
    assert "completed: reached the end, t = 0.03" in out
    assert "multiphase plot plaque.h5" in out
    assert " %  t = " in err  # progress
    assert max(map(len, out.splitlines())) <= 120


def test_quiet_run_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", *SMALL, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_progress_is_in_the_units_of_the_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(
            [
                "run",
                "plaque-mouse",
                "--set",
                "solver.cells=6",
                "--set",
                "solver.rtol=0.1",
                "--set",
                "time.end=327",
                "--set",
                "solver.time_scheme=bdf2",
            ]
        )
        == 0
    )
    out, err = capsys.readouterr()
    assert "to t = 1.001 week" in out
    assert "week" in err
    assert "µm" in out


def test_existing_output_needs_resume_or_force(capsys: pytest.CaptureFixture[str], result: Path) -> None:
    before = result.read_bytes()
    refused(capsys, ["run", "plaque", *SMALL, "-o", str(result)], "exists already", "--resume", "--force")
    assert main(["run", "plaque", *SMALL, "-o", str(result), "--resume"]) == 0
    assert "complete already; nothing was changed" in capsys.readouterr().out
    assert result.read_bytes() == before
    refused(capsys, ["run", "plaque", *SMALL, "--set", "parameters.A=0.2", "-o", str(result), "--resume"], "--resume", "parameters.A")
    assert result.read_bytes() == before


def test_force_replaces(capsys: pytest.CaptureFixture[str]) -> None:
    Path("old.h5").write_text("not a result")
    refused(capsys, ["run", "plaque", *SMALL, "-o", "old.h5", "--resume"], "not an HDF5 file")
    assert main(["run", "plaque", *SMALL, "-o", "old.h5", "--force", "--quiet"]) == 0
    assert multiphase.load("old.h5").status == "completed"


def test_resume_with_a_later_end(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["run", "plaque", *SMALL, "-o", "run.h5", "--quiet"]
    assert main([*arguments, "--resume"]) == 0  # a fresh start
    assert main([*arguments, "--resume", "--set", "time.end=0.04"]) == 0
    assert multiphase.load("run.h5").t.tolist() == [0.0, 0.01, 0.03, 0.04]


def test_the_scene_names_its_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", *SMALL, "--quiet", "--set", "output.file=named.h5"]) == 0
    assert Path("named.h5").exists()


def test_a_run_that_cannot_go_on_exits_3_and_keeps_its_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", *SMALL, "--set", "solver.max_steps=3", "--quiet", "-o", "run.h5"]) == 3
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "max_steps = 3" in err
    assert "is in run.h5" in err
    assert "larger time.end or solver.max_steps" in err  # the only changes with which --resume goes on
    assert multiphase.load("run.h5").status == "failed"
    assert main(["run", "plaque", *SMALL, "--set", "solver.max_steps=3000", "--quiet", "-o", "run.h5", "--resume"]) == 0
    assert multiphase.load("run.h5").status == "completed"


def test_drag_warns_when_short_waves_grow(capsys: pytest.CaptureFixture[str]) -> None:
    drag = ["--set", "parameters.momentum=drag", "--set", "initial.n=0.3"]
    assert main(["run", "plaque", *SMALL, *drag, "--set", "time.end=1e3", "--set", "solver.max_steps=1", "--quiet"]) == 3
    err = capsys.readouterr().err
    assert err.startswith("WARNING: momentum = drag")
    assert "parameters.p_out of 0.1 (A) or more" in err
    assert main(["run", "plaque", *SMALL, *drag, "--quiet", "-o", "short.h5"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("error", "status"), [(KeyboardInterrupt, 130), (Terminated, 143)])
def test_an_interrupt_before_anything_is_stored_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, error: type[BaseException], status: int
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("multiphase.run.run", interrupted)
    old = signal.getsignal(signal.SIGTERM)
    arguments = ["run", "plaque", "--set", 'output.fields=["n"]', "-o", "my run.h5"]
    message = refused(capsys, arguments, "nothing had been stored yet", status=status)
    assert shlex.split(message.split("To go on: ")[1]) == ["multiphase", *arguments, "--resume"]
    assert signal.getsignal(signal.SIGTERM) is old


def test_running_out_of_memory_is_one_sentence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("multiphase.run.run", exhausted)
    refused(capsys, ["run", "plaque"], "MemoryError", status=3)


# -- plan, info, plot, animate, compare, export -----------------------------------------------------------------------


def test_plan_in_words_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "plaque", "--set", "solver.cells=33"]) == 0
    assert "33 equal cells" in capsys.readouterr().out
    assert main(["plan", "plaque", "--set", "solver.cells=33", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["solver"] == "lines"
    assert plan["unknowns"] == 100  # n, l and w in each cell, and L
    assert plan["equations"]
    assert plan["reasons"]
    assert list(Path().iterdir()) == []


PLANE = ["tumour-disk", "--set", "geometry.kind=disk", "--set", "geometry.dimension=2d", "--set", "solver.cells=4", "--set", "time.end=0.5"]
BONE = ["--set", "boundary.bone.where=y < -0.5", "--set", "boundary.bone.spring=3"]


def test_parts_of_a_boundary_by_set(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", *PLANE, *BONE]) == 0
    assert "\nboundary   bone (8 edges, length 2.0" in capsys.readouterr().out
    assert main(["plan", *PLANE, *BONE, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["boundary"]) == 1
    assert main(["run", *PLANE, *BONE, "--quiet", "-o", "bone.h5"]) == 0
    scene = tomllib.loads(multiphase.load("bone.h5").scene)
    assert (scene["boundary"]["bone"]["where"], scene["boundary"]["bone"]["spring"]) == ("y < -0.5", 3.0)
    assert main(["run", *PLANE, *BONE, "--quiet", "-o", "bone.h5", "--resume"]) == 0
    change = ["--set", "boundary.bone.spring=4"]
    refused(capsys, ["run", *PLANE, *BONE, *change, "-o", "bone.h5", "--resume"], "boundary.bone.spring: 3.0 in the file, 4.0 in the scene")
    refused(capsys, ["run", *PLANE, "--set", "boundary.bone.side=outer"], "boundary.bone.side", "Its sides are")
    refused(capsys, ["run", "plaque", *BONE], "boundary: there is no such table")


def test_info_in_words_and_json(capsys: pytest.CaptureFixture[str], result: Path) -> None:
    assert main(["info", str(result)]) == 0
    out = capsys.readouterr().out
    for text in ("completed: reached the end", "3 times, 8 cells", "steps", "lines", "balance defects", "numpy"):
        assert text in out
    assert main(["info", str(result), "--json"]) == 0
    data, stored = json.loads(capsys.readouterr().out), multiphase.load(result)
    assert data["status"] == "completed"
    assert data["t"] == 0.03
    assert data["scalars"]["L"] == stored["L"][-1]
    assert data["stats"]["steps"] == stored.stats["steps"]
    assert data["plan"]["solver"] == "lines"


def test_info_of_a_run_without_n(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", *SMALL, "--set", 'output.fields=["l"]', "-o", "l.h5"]) == 0
    assert main(["info", "l.h5"]) == 0
    assert "n not stored" in capsys.readouterr().out


@pytest.mark.parametrize(("suffix", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_plot_writes_a_figure(capsys: pytest.CaptureFixture[str], result: Path, suffix: str, start: bytes) -> None:
    assert main(["plot", str(result), "-o", f"figure.{suffix}"]) == 0
    assert Path(f"figure.{suffix}").read_bytes().startswith(start)
    assert f"figure.{suffix} written" in capsys.readouterr().out


def test_animate_writes_a_film(capsys: pytest.CaptureFixture[str], result: Path) -> None:
    assert main(["animate", str(result), "-o", "film.gif"]) == 0
    assert Path("film.gif").read_bytes().startswith(b"GIF8")


def test_compare_exits_1_beyond_its_tolerance(capsys: pytest.CaptureFixture[str], result: Path, other: Path) -> None:
    same, changed = [str(result), str(result)], [str(result), str(other)]
    assert main(["compare", *same, "--tol", "0"]) == 0
    assert main(["compare", *changed]) == 0
    assert main(["compare", *changed, "--tol", "1e-9"]) == 1
    assert main(["compare", *changed, "--tol", "1e9"]) == 0
    assert "n" in capsys.readouterr().out
    assert main(["compare", *same, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical"] is True


def test_export_writes_tables(capsys: pytest.CaptureFixture[str], result: Path) -> None:
    assert main(["export", str(result), "-o", "run.csv"]) == 0
    assert capsys.readouterr().out == "run.csv written\nrun-fields.csv written\n"
    with open("run.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    assert np.array_equal([float(row["L"]) for row in rows], multiphase.load(result)["L"])


@pytest.mark.parametrize(
    "arguments",
    [["plot", "-o", "a.xyz"], ["animate", "-o", "a.png"], ["export", "-o", "a.xls"]],
    ids=lambda arguments: arguments[0],
)
def test_unknown_endings_are_refused(capsys: pytest.CaptureFixture[str], result: Path, arguments: list[str]) -> None:
    refused(capsys, [arguments[0], str(result), *arguments[1:]], arguments[2])


@pytest.mark.parametrize("command", ["info", "plot", "animate", "compare", "export"])
def test_a_missing_result_is_refused(capsys: pytest.CaptureFixture[str], command: str) -> None:
    more = {"animate": ["-o", "a.gif"], "compare": ["none.h5"], "export": ["-o", "a.csv"]}.get(command, [])
    refused(capsys, [command, "none.h5", *more], "none.h5", "no file")


def test_a_scene_is_no_result_and_a_result_no_scene(capsys: pytest.CaptureFixture[str], result: Path) -> None:
    main(["scenes", "plaque", "--copy", "mine.toml"])
    capsys.readouterr()
    refused(capsys, ["info", "mine.toml"], "mine.toml", "not an HDF5 file")
    refused(capsys, ["run", str(result)], "not a scene")


# -- refusals ---------------------------------------------------------------------------------------------------------

BAD = {
    "unknown key": (["parameters.k_n=1"], "parameters.k_n", '"k_'),
    "misspelt key": (["solver.cels=10"], "solver.cels", '"cells"'),
    "unknown table": (["sover.cells=10"], "sover", '"solver"'),
    "wrong type": (['parameters.k_m="fast"'], "parameters.k_m", "fast"),
    "no whole number": (["solver.cells=10.5"], "solver.cells", "10.5"),
    "true is no number": (["parameters.k_m=true"], "parameters.k_m", "true"),
    "b = 0": (["parameters.b=0"], "parameters.b", "greater than 0"),
    "b < 0": (["parameters.b=-1.0"], "parameters.b", "-1"),
    "n0 > 1": (["initial.n=1.5"], "initial.n", "1.5"),
    "n0 < 0": (["initial.n=-0.1"], "initial.n", "-0.1"),
    "n0 > 1 somewhere": (["initial.n=0.5 + xi"], "initial.n", "xi = 1"),
    "L0 = 0": (["initial.L=0"], "initial.L", "greater than 0"),
    "L0 < 0": (["initial.L=-2"], "initial.L", "-2"),
    "k < 1 with l0 = 0": (["parameters.k=0.5"], "parameters.k", "l = 0"),
    "NaN": (["parameters.A=nan"], "parameters.A", "nan"),
    "infinite end": (["time.end=inf"], "time.end", "inf"),
    "end = 0": (["time.end=0"], "time.end", "greater than 0"),
    "drag, inviscid": (
        ["parameters.momentum=drag", "parameters.mu_n=0", "parameters.mu_m=0", "initial.n=0.3"],
        "parameters.momentum", "p_out - (1 - 2n) Sigma(l)",
    ),
    "unknown preset": (["parameters.preset=mouze"], "parameters.preset", '"mouse"'),
    "unknown model": (["scene.model=plague"], "scene.model", "plaque"),
    "set without value": (["solver.cells"], "--set", "table.key=VALUE"),
    "set without table": (["cells=10"], "--set", "table.key=VALUE"),
    "both ways to save": (["time.save_every=1", "time.save_at=[1.0]"], "--set", "save_every"),
    "saved beyond the end": (["time.save_at=[99.0]"], "time.save_at", "99"),
    "unknown field": (['output.fields=["N"]'], "output.fields", '"N"'),
    "output is not .h5": (["output.file=run.txt"], "-o", "run.txt"),
    "unknown choice": (["parameters.momentum=friction"], "parameters.momentum", '"drag"'),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_values_are_refused_by_dotted_path(capsys: pytest.CaptureFixture[str], case: str) -> None:
    sets, path, word = BAD[case]
    message = refused(capsys, ["run", "plaque", *(part for item in sets for part in ("--set", item))], word)
    assert message.startswith(f"multiphase: {path}: ")


def test_bad_scene_files_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["run", "none.toml"], "none.toml", "no such file")
    refused(capsys, ["run", "plague"], "plague", '"plaque"')
    Path("broken.toml").write_text("[scene\nmodel = plaque", encoding="utf-8")
    refused(capsys, ["run", "broken.toml"], "broken.toml", "not valid TOML", "line 1")
    Path("bytes.toml").write_bytes(b"\xff\xfe\x00")
    refused(capsys, ["run", "bytes.toml"], "bytes.toml")
    Path("folder.toml").mkdir()
    refused(capsys, ["run", "folder.toml"], "folder.toml")
    Path("empty.toml").write_text("", encoding="utf-8")
    refused(capsys, ["run", "empty.toml"], "scene.model")


def test_plan_refuses_as_run_does(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["plan", "plaque", "--set", "parameters.b=0"], "parameters.b")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["rum"],
        ["run"],
        ["run", "plaque", "--colour"],
        ["run", "plaque", "--resume", "--force"],
        ["run", "plaque", "--threads", "0"],
        ["compare", "a.h5"],
        ["animate", "a.h5"],
        ["run", "plaque", "-o", "no/such/folder/run.h5"],
        ["run", "plaque", "-o", "run.txt"],
    ],
    ids=" ".join,
)
def test_bad_usage_is_refused(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    refused(capsys, arguments)


@pytest.mark.parametrize("value", ["0", "-1", "two", "1.5"])
def test_threads_must_be_a_positive_whole_number(capsys: pytest.CaptureFixture[str], value: str) -> None:
    refused(capsys, ["run", "plaque", f"--threads={value}"], f"--threads: {value} is not a positive whole number")


@pytest.mark.parametrize("value", ["-1", "nan", "inf", "small"])
def test_tolerance_must_be_a_number(capsys: pytest.CaptureFixture[str], value: str) -> None:
    refused(capsys, ["compare", "a.h5", "b.h5", f"--tol={value}"], f"--tol: {value} is not a number of 0 or more")


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", "--set", "parameters.b=0", "--debug"]) == 2
    err = capsys.readouterr().err
    assert "Traceback (most recent call last)" in err
    assert err.splitlines()[-1].startswith("multiphase: parameters.b: ")
    assert main(["run", "plaque", *SMALL, "--set", "solver.max_steps=3", "--quiet", "--debug"]) == 3
    assert "Traceback (most recent call last)" in capsys.readouterr().err


# -- as a program -----------------------------------------------------------------------------------------------------


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    for option, word in (("--version", multiphase.__version__), ("--help", "compare")):
        with pytest.raises(SystemExit) as caught:
            main([option])
        assert caught.value.code == 0
        assert word in capsys.readouterr().out


def test_the_installed_program_runs_and_exits_2() -> None:
    program = Path(sys.executable).with_name("multiphase")
    found = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert found.stdout == f"multiphase-tissue {multiphase.__version__}\n"
    found = subprocess.run([program, "run", "plaque", "--set", "parameters.b=0"], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr.startswith("multiphase: parameters.b: ")


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
def test_a_reader_that_goes_away_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as closed:
        found = subprocess.run(
            [sys.executable, "-u", "-m", "multiphase.cli", "scenes"], stdout=closed, stderr=subprocess.PIPE, text=True, check=False
        )
    assert found.returncode == 0
    assert found.stderr == ""


def test_outputs_that_cannot_be_written_are_refused_before_any_work(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    main(["run", "plaque", *SMALL, "--quiet", "-o", "run.h5"])
    Path("to-nothing.h5").symlink_to(tmp_path / "nothing" / "x.h5")
    commands = [
        ["run", "plaque", "-o", "nowhere/x.h5"],
        ["run", "plaque", "-o", "/proc/x.h5"],
        ["run", "plaque", "-o", "to-nothing.h5"],
        ["plot", "run.h5", "-o", "/proc/a.png"],
        ["animate", "run.h5", "-o", "nowhere/a.gif"],
        ["export", "run.h5", "-o", "nowhere/a.csv"],
        ["scenes", "plaque", "--copy", "/proc/a.toml"],
    ]
    capsys.readouterr()
    for command in commands:
        assert main(command) == 2
        err = capsys.readouterr().err
        assert "cannot be written" in err
        assert err.count("\n") == 1


def test_two_runs_do_not_share_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    from multiphase.storage import claimed

    with claimed(Path("run.h5")):
        assert main(["run", "plaque", *SMALL, "--quiet", "-o", "run.h5"]) == 2
        assert "another run is writing run.h5" in capsys.readouterr().err
    assert main(["run", "plaque", *SMALL, "--quiet", "-o", "run.h5"]) == 0
    assert not list(Path().glob(".*.lock"))


def test_the_drag_form_is_watched_during_the_run(caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]) -> None:
    """n = 0.55 everywhere is well-posed at first; macrophages that enter bring n below 1/2 at the endothelium."""
    drag = ["--set", "parameters.momentum=drag", "--set", "initial.n=0.55", "--set", "parameters.k_m=0", "--set", "initial.l=0.5"]
    settings = ["--set", "solver.cells=10", "--set", "solver.rtol=1e-2", "--quiet"]
    slow = ["--set", "parameters.mu_n=1e-3", "--set", "parameters.mu_m=1e-3", "--set", "time.end=0.9", "--set", "time.save_every=0.1"]
    main(["run", "plaque", *settings, *drag, *slow, "-o", "viscous.h5"])
    assert "has become ill-posed for short waves" in capsys.readouterr().err
    inviscid = ["--set", "parameters.mu_n=0", "--set", "parameters.mu_m=0", "--set", "time.end=5"]
    assert main(["run", "plaque", *settings, *drag, *inviscid, "-o", "inviscid.h5"]) == 3
    assert "momentum = drag is ill-posed where" in capsys.readouterr().err


def test_info_tells_where_an_interrupted_run_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "plaque", *SMALL, "--set", "solver.max_steps=3", "--quiet", "-o", "run.h5"])
    capsys.readouterr()
    main(["info", "run.h5"])
    out = capsys.readouterr().out
    assert "from where --resume goes on" in out
    assert "1 time," in out


@pytest.mark.parametrize(
    ("change", "path"),
    [
        ("initial.l=1e200", "initial.l"),
        ("parameters.Psi_l=1e300", "parameters.Psi_l"),
        ("initial.L=1e-30", "initial.L"),
        ("initial.n={at=[0.0, 100.0], values=[0.5, 0.9]}", "initial.n"),
        ("solver.cells=100000000000", "solver.cells"),
        ("solver.rtol=1e-20", "solver.rtol"),
        ("solver.dt=1e-12", "solver.dt"),
        ('output.fields=["L"]', "output.fields"),
    ],
)
def test_sizes_that_cannot_be_meant_are_refused(change: str, path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "plaque", "--set", change, "-o", "run.h5"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"multiphase: {path}")
    assert err.count("\n") == 1
    assert not Path("run.h5").exists()
