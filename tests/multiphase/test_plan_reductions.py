"""What the plan leaves out changes nothing: random scenes with it and without it, and everything that goes with a run.

`benchmarks/plan_reductions.py` draws more scenes, and measures what is saved.
"""

from __future__ import annotations

import json
import logging
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import plan_scenes as scenes
import pytest

from multiphase.cli import main
from multiphase.errors import ParameterError
from multiphase.plan import Plan, Reduction
from multiphase.run import plan_of, run
from multiphase.scene import Scene, load_scene, parse_scene
from multiphase.stepping import Snapshot, State, StopRun, Tracker

SCENES = 280
"""Of each of the seven kinds 40, of which eight are spoiled."""

UNIFORM = """
[scene]
model = "tumour"
[geometry]
kind = "disk"
[parameters]
kappa = 0.0
Q = 0.0
[initial]
alpha = 0.75
[solver]
cells = 20
[time]
end = 4.0
"""
FIXED = """
[scene]
model = "plaque"
[parameters]
k_m = 0.0
[initial]
n = 0.0
[solver]
cells = 20
[time]
end = 2.0
"""


def names(scene: Scene) -> list[str]:
    return [reduction.name for reduction in scene.model.plan(scene).reductions]


def test_random_scenes_have_the_same_answer_with_less(caplog: pytest.LogCaptureFixture) -> None:
    """To ten times rtol, in all fields and scalars at all stored times. Most agree to rounding; viscous disks and balls, bodies at rest
    with Radau IIA, and velocities between steps, which are not exact in the full run either, to its tolerance."""
    caplog.set_level(logging.ERROR)
    found: Counter[str] = Counter()
    off = []
    for number in range(SCENES):
        kind, scene = scenes.draw(number)
        assert names(scenes.full(scene)) == []
        if not names(scene):
            found["none"] += 1
            continue
        found[kind] += 1
        if not scenes.difference(scene) <= 1.0:
            off.append((number, kind, scenes.difference(scene)))
    print(dict(found))
    assert off == []
    assert min(found[kind] for kind in scenes.KINDS) >= 15
    assert found["none"] >= 15


def test_the_plan_prints_stores_and_gives_its_reductions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(FIXED)
    assert main(["plan", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "reduced    fixed fractions: n = 0 everywhere at first and k_m = 0" in printed
    assert "61 unknowns a step down to 21" in printed
    assert "unknowns   21 a step" in printed
    assert "necrotic phase  " not in printed
    assert "slip w" not in printed
    assert main(["plan", str(path), "--set", "plan.reduce=false"]) == 0
    whole = capsys.readouterr().out
    assert "reduced" not in whole
    assert "unknowns   61 a step" in whole
    assert "necrotic phase  " in whole
    assert main(["plan", str(path), "--json"]) == 0
    given = json.loads(capsys.readouterr().out)["reductions"]
    assert [sorted(entry) for entry in given] == [["name", "reason", "saves"]]
    assert main(["run", str(path), "-o", str(tmp_path / "r.h5")]) == 0
    assert "reduced by fixed fractions: the necrotic phase and all momentum: 61 unknowns" in capsys.readouterr().out
    stored = run(parse_scene(FIXED, name="f"))
    assert plan_of(stored)["reductions"] == given
    assert stored.stats["unknowns"] == 21


def test_a_plan_without_reductions_says_nothing_of_them() -> None:
    plan = Plan(solver="lines", geometry="slab", equations=(), unknowns=3)
    assert plan.reductions == ()
    assert "reduced" not in plan.describe()
    assert str(Reduction("a", "b", "c")) == "a: b; saves c"


@pytest.mark.parametrize(("text", "name"), [(UNIFORM, "uniform state"), (FIXED, "fixed fractions")])
def test_a_resumed_run_equals_an_uninterrupted_one(tmp_path: Path, text: str, name: str) -> None:
    """Bit for bit, and not with another value of plan.reduce."""

    class Stop(Tracker):
        def on_save(self, state: State, snapshot: Snapshot) -> None:
            if snapshot.t > 1.0:
                raise StopRun("here")

    for sets in ([], ["solver.time_scheme=bdf2"]):
        scene = parse_scene(text, name="s", sets=sets)
        assert name in names(scene)
        file = tmp_path / f"{len(sets)}.h5"
        assert run(scene, file=file, trackers=[Stop()]).status == "stopped"
        with pytest.raises(ParameterError, match=r"plan\.reduce: True in the file, False in the scene"):
            run(scenes.full(scene), file=file, existing="resume")
        resumed, whole = run(scene, file=file, existing="resume"), run(scene)
        for entry in (*whole.fields, *whole.scalars):
            assert np.array_equal(resumed[entry], whole[entry], equal_nan=True)
        assert np.array_equal(resumed.x, whole.x)
        assert resumed.stats["steps"] == whole.stats["steps"]


def test_a_run_resumed_without_the_reduction_of_its_time_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of before this scene was made smaller."""
    scene = parse_scene(FIXED, name="s")
    monkeypatch.setattr("plaque1d.model.fixed_fractions_because", lambda scene: "")
    run(scene, file=tmp_path / "old.h5")
    monkeypatch.undo()
    with pytest.raises(ParameterError, match="change of what the plan leaves out"):
        run(scene.with_changes(time={"end": 3.0}), file=tmp_path / "old.h5", existing="resume")


@pytest.mark.parametrize("text", [UNIFORM, FIXED])
def test_what_comes_after_a_run_works(tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Comparison, figures, film and balances see the full grid."""
    path = tmp_path / "s.toml"
    path.write_text(text)
    shape = ["--set", "geometry.dimension=radial"] if text == UNIFORM else []
    for file, more in (("a.h5", []), ("b.h5", ["--set", "plan.reduce=false"])):
        assert main(["run", str(path), "-o", str(tmp_path / file), "--quiet", *shape, *more]) == 0
    assert main(["compare", str(tmp_path / "a.h5"), str(tmp_path / "b.h5"), "--tol", "1"]) == 0  # p and stress are 0 but for rounding
    assert main(["plot", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.png")]) == 0
    assert main(["animate", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.gif")]) == 0
    capsys.readouterr()
    result = run(load_scene(path))
    assert result.x.shape[1] == 20
    for name in result.scalars:
        if name.startswith("defect"):
            assert np.max(np.abs(result[name])) < 1e-12  # sums of 20 products of numbers of order 1


def test_simulate_takes_the_choice() -> None:
    from plaque1d import PlaqueParameters
    from plaque1d import simulate as grow_plaque
    from tumour import TumourParameters
    from tumour import simulate as grow_tumour

    settings: dict[str, Any] = {"t_end": 0.5, "cells": 8}
    for reduce, numbers in ((True, (9, 3)), (False, (25, 24))):
        plaque = grow_plaque(PlaqueParameters(k_m=0.0), initial={"n": 0.0}, reduce=reduce, **settings)
        tumour = grow_tumour(TumourParameters(kappa=0.0, Q=0.0), geometry="sphere", reduce=reduce, **settings)
        assert (plaque.stats["unknowns"], tumour.stats["unknowns"]) == numbers
