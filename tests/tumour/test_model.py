"""The tumour as a model of the core: its scenes, plan, summary, pictures, errors and commands."""

from __future__ import annotations

import csv
import logging
import re
import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

import multiphase
from multiphase import ParameterError, Result
from multiphase.cli import main
from multiphase.parameters import to_table
from multiphase.plotting import figure
from multiphase.run import plan_of, run
from multiphase.scene import load_scene, shipped_scenes
from multiphase.stepping import StopRun, Tracker
from tumour import TumourGeometry, TumourInitial, TumourParameters, TumourSolver, simulate
from tumour.model import MODEL
from tumour.observation import scalar_names

SCENES = ("tumour-disk", "tumour-eulerian", "tumour-fibres", "tumour-glioma", "tumour-glioma-stiff", "tumour-slab", "tumour-sphere")
RADIAL = tuple(name for name in SCENES if "glioma" not in name and "fibres" not in name)
ELASTIC = {"alpha", "C", "p", "displacement", "J", "stress_magnitude"}
VISCOUS = {"alpha", "C", "p", "u", "stress_magnitude"}
SMALL = ["--set", "solver.cells=20", "--set", "time.end=6", "--set", "time.save_every=2"]


def plan(name: str = "tumour-disk", *sets: str) -> Any:
    scene = load_scene(name, sets)
    return MODEL.plan(scene)


def grown(**changes: Any) -> Result:
    return simulate(**{"t_end": 4.0, "cells": 20, "save_every": 1.0, **changes})


# -- scenes -----------------------------------------------------------------------------------------------------------


def test_the_scenes_that_ship() -> None:
    assert tuple(name for name, scene in shipped_scenes().items() if scene.model == "tumour") == SCENES
    disk, eulerian, fibres, glioma, stiff, slab, sphere = (load_scene(name) for name in SCENES)
    assert [scene.geometry.kind for scene in (disk, eulerian, slab, sphere)] == ["quarter_disk", "sphere", "slab", "sphere"]
    assert disk.parameters == TumourParameters.preset("paper")
    assert disk.parameters.mobility == "printed"
    for scene in (eulerian, slab, sphere):
        assert scene.parameters == TumourParameters()
        assert scene.geometry.eulerian == (scene is eulerian)
    for scene in (disk, eulerian, slab, sphere):
        assert scene.solver == TumourSolver(cells=200)
        assert MODEL.plan(scene).warnings == ()
    for scene, lambda_alpha in ((glioma, 0.0), (stiff, 1.0)):
        assert scene.parameters == replace(TumourParameters.preset("paper"), lambda_alpha=lambda_alpha)
        assert (scene.geometry.kind, scene.geometry.radius, scene.time.end) == ("glioma", 0.39, 100.0)
        assert scene.solver == TumourSolver(method="mini", cells=20)
        assert MODEL.plan(scene).warnings == ()
    assert fibres.parameters == TumourParameters(lambda_alpha=1.0, fibre_angle=0.5, fibre_ratio=2.0)
    assert (fibres.geometry.kind, fibres.geometry.plane, fibres.time.end) == ("disk", True, 20.0)
    assert fibres.solver == TumourSolver(method="mini", cells=20)
    assert MODEL.plan(fibres).warnings == ()


def test_commented_values_of_the_disk_scene_are_the_presets() -> None:
    """What the file says in its comments must stay true."""
    text = (files("tumour.scenes") / "tumour-disk.toml").read_text(encoding="utf-8")
    section = text[text.index("[parameters]") : text.index("[initial]")]
    said = tomllib.loads("\n".join(line[2:].split(" #")[0] for line in section.splitlines() if line.startswith("# ")))
    assert said == to_table(TumourParameters.preset("paper"))


@pytest.mark.parametrize("name", RADIAL)
def test_a_scene_runs(name: str) -> None:
    scene = load_scene(name, ["time.end=12", "solver.cells=40"])
    result = run(scene)
    assert result.status == "completed"
    assert set(result.fields) == (VISCOUS if scene.geometry.eulerian else ELASTIC)
    assert tuple(result.scalars) == scalar_names(scene.geometry.m)
    assert set(MODEL.quantities) >= set(result.fields) | set(result.scalars)
    assert result["radius"][-1] > 1.1 * result["radius"][0]
    assert result.x is not None
    assert np.all(np.diff(result.x[-1]) > 0.0)
    assert 0.0 < result.x[-1, 0] < result.x[-1, -1] < result["radius"][-1]
    size = scene.geometry.size(result["radius"])
    np.testing.assert_allclose(result[scalar_names(scene.geometry.m)[1]], size, rtol=1e-12)
    for name in ("defect_cells", "defect_volume"):
        assert np.abs(result[name]).max() < 1e-11


@pytest.mark.parametrize("name", RADIAL)
def test_the_comments_of_the_scenes_hold(name: str) -> None:
    """When hypoxia and necrosis come, and where growth ends."""
    result = run(load_scene(name))

    def first(quantity: str) -> float:
        return float(result.t[np.argmax(result[quantity] > 0.0)])

    hypoxic, necrotic = first("hypoxic_radius"), first("necrotic_radius")
    if name == "tumour-disk":
        assert (hypoxic, necrotic) == (28.0, 43.0)
    elif name == "tumour-sphere":
        assert (hypoxic, necrotic) == (44.0, 60.0)
    elif name == "tumour-slab":
        assert (hypoxic, necrotic) == (1.0, 11.0)
        assert result["radius"].argmax() in (45, 46, 47)
    else:
        assert (hypoxic, necrotic) == (40.0, 54.0)
    assert result["necrotic_fraction"][-1] > (0.06 if name == "tumour-sphere" else 0.15)  # the ball ends before it may buckle


def test_the_comments_of_the_scene_with_fibres_hold() -> None:
    """How much longer than wide the body gets, and how much larger than without fibres."""
    result, plain = (run(load_scene("tumour-fibres", ["solver.cells=10", *sets])) for sets in ([], ["parameters.fibre_ratio=1"]))
    c, s = np.cos(0.5), np.sin(0.5)
    along, across = np.ptp(result.positions(-1) @ [[c, -s], [s, c]], axis=0)
    assert along / across == pytest.approx(3.0, abs=0.01)
    assert result["area"][-1] / plain["area"][-1] == pytest.approx(1.12, abs=0.005)


# -- the plan ---------------------------------------------------------------------------------------------------------


def test_the_plan_says_what_is_solved() -> None:
    disk = plan()
    said = disk.describe()
    for word in (
        "(2.22b)",
        "(2.22c)",
        "(2.22d)",
        "R^-1 (R (J/l_r^2) C_R)_R = J Q alpha C",
        "(2.22a)",
        "radial",
        "Radau",
        "1/(kappa alpha)",
    ):
        assert word in said
    assert disk.unknowns == 600
    assert (disk.solver, disk.open_balances) == ("lines", ())
    eulerian = plan("tumour-eulerian", "parameters.Q1_hat=2.0").describe()
    for word in ("(2.6)", "(2.13)", "r^-2 (r^2 alpha u)_r", "R' = u(R)", "Q alpha C/(1 + Q1_hat C)", "602 a step", "eulerian"):
        assert word in eulerian
    slab = plan("tumour-slab", "parameters.Q=0", "parameters.kappa=0", "solver.time_scheme=bdf2", "plan.reduce=false").describe()
    for word in ("p = p_out", "((J/l_r^2) C_R)_R", "solved all the same", "BDF", "sideways"):
        assert word in slab
    floor = plan("tumour-disk", "parameters.mobility_floor=1e-4").describe()
    assert "1/(0.0001 + kappa alpha)" in floor


def test_warnings_of_the_plan() -> None:
    assert plan("tumour-slab", "time.end=200").warnings == ()
    (jump,) = plan("tumour-disk", "parameters.alpha_min=0.7").warnings
    assert "jumps by 1.11 there" in jump  # gamma (0.8 - 0.7)/(1 - 0.7)^2
    assert "sigma_width" in jump
    assert "sigma_width = 0.05" in plan("tumour-disk", "parameters.alpha_min=0.7", "parameters.sigma_width=0.05").warnings[0]
    assert plan("tumour-disk", "parameters.alpha_min=0.7", "parameters.gamma=0").warnings == ()
    printed = plan("tumour-disk", "solver.alpha_step=as-printed", "solver.dt=0.5")
    assert "does not keep the mass of cells" in printed.warnings[0]
    assert printed.open_balances == ("defect_cells",)


@pytest.mark.parametrize(
    ("sets", "warned"),
    [
        (["time.end=70"], True),
        (["time.end=60"], False),
        (["time.end=70", "parameters.lambda_alpha=0.3"], False),
        (["time.end=70", "parameters.lambda_alpha=0.1"], True),
        (["time.end=70", "geometry.kind=sphere"], True),
        (["time.end=68", "geometry.kind=sphere"], False),
        (["time.end=70", "geometry.kind=sphere", "parameters.lambda_alpha=0.05"], False),
        (["time.end=70", "geometry.kind=slab"], False),
        (["time.end=70", "geometry.formulation=eulerian"], False),
        (["time.end=70", "parameters.Q=5.0"], False),  # nobody has looked
    ],
)
def test_a_disk_or_a_ball_that_may_buckle(sets: list[str], warned: bool) -> None:
    warnings = plan("tumour-disk", *sets).warnings
    assert any("buckle" in warning for warning in warnings) == warned


def test_the_printed_step_is_not_taken_for_a_fault(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        result = grown(t_end=20.0, alpha_step="as-printed", dt=0.5)
    assert "should close" not in caplog.text
    assert "does not keep the mass of cells" in caplog.text
    assert np.abs(result["defect_cells"]).max() > 1e-5
    assert np.abs(result["defect_volume"]).max() < 1e-11
    assert plan_of(result)["open_balances"] == ["defect_cells"]
    assert result.stats["steps"] == 40


def test_the_preset_of_the_authors_brings_its_solver() -> None:
    scene = load_scene("tumour-disk", ["parameters.preset=authors-disk"])
    assert scene.solver.resolved == ("lines", "backward-euler")
    assert (scene.solver.dt, scene.solver.alpha_step) == (0.5, "as-printed")
    assert scene.parameters.mobility_floor == 1e-4


# -- simulate ---------------------------------------------------------------------------------------------------------


def test_simulate_takes_geometries_of_every_kind() -> None:
    by_name = grown(geometry="sphere")
    for geometry in ({"kind": "sphere"}, TumourGeometry(kind="sphere")):
        assert np.array_equal(grown(geometry=geometry)["radius"], by_name["radius"])
    default = grown()
    assert tomllib.loads(default.scene)["geometry"]["kind"] == "disk"
    assert np.array_equal(grown(geometry="quarter_disk")["radius"], default["radius"])
    np.testing.assert_allclose(default["area"], np.pi * default["radius"] ** 2, rtol=1e-12)
    assert np.array_equal(grown(parameters=TumourParameters(), initial=TumourInitial())["alpha"], default["alpha"])


def test_a_python_function_is_sampled_on_the_body_of_the_run() -> None:
    initial = TumourInitial(alpha=lambda r: 0.7 + 0.02 * r)
    result = grown(initial=initial, geometry={"kind": "slab", "radius": 3.0}, cells=30)
    assert result.x is not None
    np.testing.assert_allclose(result["alpha"][0], 0.7 + 0.02 * result.x[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("changes", "path", "words"),
    [
        ({"geometry": "spere"}, "geometry.kind", '"sphere"'),
        ({"geometry": {"knid": "sphere"}}, "geometry.knid", '"kind"'),
        ({"geometry": 3}, "geometry", "TumourGeometry"),
        ({"parameters": {"Q": 1.0}}, "parameters", "TumourParameters"),
        ({"solver": "line"}, "solver.method", '"lines"'),
        ({"solver": "fipy"}, "solver.method", "Eulerian"),
        ({"cells": 1}, "solver.cells", "4"),
        ({"rtol": 2.0}, "solver.rtol", "0.1"),
        ({"dt": 1e-6}, "solver.dt", "max_steps"),
        ({"alpha_step": "as_printed"}, "solver.alpha_step", '"as-printed"'),
        ({"parameters": TumourParameters(lambda_alpha=-0.5)}, "parameters.lambda_alpha", "0"),
        ({"initial": TumourInitial(alpha="1.2 - r")}, "initial.alpha", "below 1"),
        ({"t_end": -1.0}, "time.end", "greater than 0"),
        ({"save_at": [9.0], "save_every": None}, "time.save_at", "beyond the end"),
    ],
)
def test_what_simulate_refuses(changes: dict[str, Any], path: str, words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        grown(**changes)
    assert caught.value.path == path
    assert words in str(caught.value)


class StopAfter(Tracker):
    """Stops after so many stored times."""

    def __init__(self, times: int) -> None:
        self.left = times

    def on_save(self, state: Any, snapshot: Any) -> None:
        self.left -= 1
        if self.left == 0:
            raise StopRun("enough")


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"time_scheme": "bdf2"},
        {"alpha_step": "as-printed", "dt": 0.5},
        {"geometry": {"formulation": "eulerian"}},
        {"geometry": {"formulation": "eulerian"}, "time_scheme": "bdf2"},
    ],
)
def test_resume_is_bit_for_bit(settings: dict[str, Any], tmp_path: Path) -> None:
    whole = grown(t_end=30.0, **settings)
    file = tmp_path / "stopped.h5"
    assert grown(t_end=30.0, file=file, trackers=[StopAfter(9)], **settings).status == "stopped"
    same_numbers(grown(t_end=30.0, file=file, resume=True, **settings), whole)
    if settings.get("time_scheme") != "bdf2" and "dt" not in settings:
        return
    file = tmp_path / "shorter.h5"  # the loop's steps end on stored times; Radau's do on the end alone, and so are others after it
    grown(t_end=12.0, file=file, **settings)
    same_numbers(grown(t_end=30.0, file=file, resume=True, **settings), whole)


def test_a_longer_run_goes_on_from_a_shorter_one(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    grown(t_end=12.0, file=file)
    longer, whole = grown(t_end=30.0, file=file, resume=True), grown(t_end=30.0)
    assert np.array_equal(longer.t, whole.t)
    np.testing.assert_allclose(longer["radius"], whole["radius"], rtol=1e-4)


def same_numbers(one: Result, other: Result) -> None:
    assert np.array_equal(one.t, other.t)
    for name in (*other.scalars, *other.fields):
        assert np.array_equal(one[name], other[name], equal_nan=True), name


# -- what is said and drawn -------------------------------------------------------------------------------------------


def test_the_summary() -> None:
    rows = dict(MODEL.summary(run(load_scene("tumour-disk"))))
    assert list(rows) == [
        "time", "radius", "growth rate", "cell fraction", "oxygen", "hypoxic part", "necrotic core", "balance defects",
    ]  # fmt: skip
    assert re.fullmatch(r"5\.06\d+  \(from 1\), area 20\.1\d+", rows["radius"])
    assert "the area doubles in " in rows["growth rate"]
    assert re.fullmatch(r"radius 2\.47\d*, 23\.8 % of the body, rim 2\.59\d*", rows["necrotic core"])
    early = dict(MODEL.summary(grown()))
    assert early["necrotic core"].startswith("none, rim 1.")
    assert early["hypoxic part"] == "none"
    shrinking = dict(MODEL.summary(grown(parameters=TumourParameters(C_out=0.1, alpha_min=0.0), t_end=2.0)))
    assert "it does not grow" in shrinking["growth rate"]
    empty = Result(model="tumour", t=np.empty(0))
    assert MODEL.summary(empty) == [("stored", "nothing yet")]


def test_units() -> None:
    scales = {"length": {"value": 100.0, "unit": "µm"}, "time": {"value": 0.5, "unit": "d"}}
    result = grown(geometry="slab", scales=scales)
    shown = result.in_units()
    assert [shown.unit(name) for name in ("radius", "thickness", "growth_rate", "doubling_time", "x")] == ["µm", "µm", "µm/d", "d", "µm"]
    np.testing.assert_allclose(shown["growth_rate"], 200.0 * result["growth_rate"], rtol=1e-14)
    np.testing.assert_allclose(result["thickness"], 2.0 * result["radius"], rtol=1e-14)
    rows = dict(MODEL.summary(result))
    assert "µm  (from 100 µm), thickness" in rows["radius"]
    assert grown(scales=scales).in_units().unit("area") == "µm²"
    assert grown(geometry="sphere", scales=scales).in_units().unit("volume") == "µm³"


def panels(result: Result) -> dict[str, Axes]:
    """The panels of the standard figure by title."""
    found = figure(result).findobj(lambda artist: isinstance(artist, Axes) and bool(artist.get_title(loc="left")))
    return {axes.get_title(loc="left"): axes for axes in found}


@pytest.mark.parametrize("geometry", ["disk", "slab", "viscous"])
def test_the_standard_figure(geometry: str) -> None:
    viscous = TumourGeometry(kind="sphere", formulation="eulerian")
    drawn = panels(grown(geometry=viscous if geometry == "viscous" else geometry))
    assert ("Section through the centre" in drawn) == (geometry != "slab")
    assert ("Displacement" in drawn) == (geometry != "viscous")
    assert ("Velocity of the cells" in drawn) == (geometry == "viscous")
    assert ("Size of the stress" in drawn) == (geometry != "slab")  # across which it is 0: nothing acts on its faces
    for title in ("Cell fraction", "Oxygen", "Fluid pressure", "Growth rate and doubling time"):
        assert title in drawn
    assert drawn["Oxygen"].get_xlabel() == "distance from the middle r"


def test_fronts_are_drawn_from_when_they_come_up() -> None:
    result = simulate(geometry={"kind": "slab", "radius": 2.0}, t_end=20.0, cells=50, save_every=1.0)
    drawn = panels(result).values()
    fronts = [line for axes in drawn for line in axes.get_lines() if (line.get_label(), line.get_color()) == ("necrotic_radius", "white")]
    assert len(fronts) == 2  # on the pictures of alpha and of C
    position = np.asarray(fronts[0].get_ydata())
    came = int(np.argmax(result["necrotic_radius"] > 0.0))
    assert np.isnan(position[: came - 1]).all()
    assert position[came - 1] == 0.0
    np.testing.assert_array_equal(position[came:], result["necrotic_radius"][came:])


# -- commands ---------------------------------------------------------------------------------------------------------


def test_every_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "tumour-disk"]) == 0
    assert "elastic quarter disk" in capsys.readouterr().out
    assert main(["run", "tumour-disk", *SMALL, "-o", "disk.h5"]) == 0
    said = capsys.readouterr().out
    assert "necrotic core" in said
    assert max(map(len, said.splitlines())) <= 120
    assert main(["info", "disk.h5"]) == 0
    assert "Avascular tumour" in capsys.readouterr().out
    assert main(["plot", "disk.h5"]) == 0
    assert Path("disk.png").stat().st_size > 50_000
    assert main(["animate", "disk.h5", "-o", "disk.gif"]) == 0
    assert Path("disk.gif").stat().st_size > 50_000
    assert main(["export", "disk.h5", "-o", "disk.csv"]) == 0
    with Path("disk.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert [float(row["radius"]) for row in rows] == multiphase.load("disk.h5")["radius"].tolist()
    assert main(["run", "tumour-disk", *SMALL, "--set", "geometry.kind=sphere", "-o", "ball.h5", "--quiet"]) == 0
    assert "volume" in multiphase.load("ball.h5")
    assert main(["compare", "disk.h5", "ball.h5"]) == 0
    assert main(["run", "tumour-disk", *SMALL, "-o", "disk.h5", "--resume", "--quiet"]) == 0


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (["solver.method=fipy"], ("solver.method", "Eulerian")),
        (["geometry.dimension=2d", "solver.method=lines"], ("solver.method", "mini")),
        (["solver.method=mini"], ("solver.method", 'dimension = "2d"')),
        (["initial.alpha=0.8 + 0.01*x", "geometry.dimension=radial"], ("initial.alpha", "uses x")),
        (["output.vtk=true"], ("output.vtk", ".csv")),
        (["parameters.lamda_alpha=1"], ("parameters.lamda_alpha", "lambda_alpha")),
        (["geometry.kind=annulus"], ("geometry.kind", '"sphere"')),
        (["parameters.preset=papre"], ("parameters.preset", '"paper"')),
        (['output.fields=["L"]'], ("output.fields", "alpha")),
    ],
)
def test_what_a_scene_cannot_have(
    sets: list[str], words: tuple[str, ...], capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "tumour-disk", *(part for item in sets for part in ("--set", item))]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert all(word in err for word in words)
    assert not list(tmp_path.iterdir())
