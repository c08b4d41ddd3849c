"""A disk along its radius is the disk in two dimensions, to what the grids of both leave: random scenes, solved both ways.

And what should not pass does not: scenes that are not radial are left in two dimensions, and radial runs of other equations are found.
`benchmarks/plan_reductions.py` draws more scenes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import radial_scenes as scenes

from multiphase.errors import ParameterError
from multiphase.parameters import replace
from multiphase.result import Result
from multiphase.scene import Scene
from tumour import observation, schemes
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters

PLANNED = 200
"""Scenes whose plan is looked at; 40 of them are spoiled."""
FIRST, COUNT = 184, 6
"""The scenes that are solved in two dimensions: those that are radial, from this number on. Both kinds, all time schemes, all laws of the
mobility and all that a scene may have or not are among them, and no body stays at rest."""
WRONG = {"formula": 0, "tissue": 111, "fibres": 80, "part": 41}
"""Spoiled scenes that are solved in two dimensions as well: cos(2 theta), softer tissue, stiff fibres, less oxygen on one side."""
RADIAL = [number for number in range(FIRST, FIRST + 2 * COUNT) if not scenes.spoil_of(number)][:COUNT]


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    """Coarse meshes are out of round at t = 0, which a run says."""
    caplog.set_level(logging.ERROR)


def names(scene: Scene) -> list[str]:
    return [reduction.name for reduction in scene.model.plan(scene).reductions]


@cache
def drawn(number: int) -> Scene:
    scene: Scene = scenes.draw(number)[1]
    return scene


@cache
def plane(number: int) -> tuple[Result, ...]:
    """The runs in two dimensions, once for all tests."""
    runs: tuple[Result, ...] = scenes.with_errors(scenes.full(drawn(number)))
    return runs


def agreement(number: int) -> Any:
    """Of a scene as it is, or as a wrong reduction has it."""
    scene = drawn(number)
    return scenes.compared(scene, plane(number), scenes.with_errors(scene))


# -- What is radial, and what is not ----------------------------------------------------------------------------------------


def test_what_has_a_direction_stays_in_two_dimensions() -> None:
    """And all else is solved along its radius."""
    spoiled = dict.fromkeys(scenes.SPOILS, 0)
    wrong = []
    for number in range(PLANNED):
        scene, why = scenes.draw(number)[1], scenes.spoil_of(number)
        if why:
            spoiled[why] += 1
        if scene.geometry.plane != bool(why) or ("radial symmetry" in names(scene)) == bool(why):
            wrong.append((number, why or "radial"))
    assert wrong == [], f"by number and what spoils it: {wrong}"
    assert min(spoiled.values()) >= PLANNED // 5 // len(spoiled)


def test_the_scenes_that_are_solved_have_all_that_a_radial_one_may() -> None:
    found = [drawn(number) for number in RADIAL]
    tables = [scene.parameters for scene in found]
    for name in ("lambda_alpha", "kappa", "sigma_width", "Q", "Q1_hat", "p_out", "mobility_floor"):
        assert any(getattr(p, name) != 0.0 for p in tables), name
    assert {p.mobility for p in tables} == {"darcy", "printed", "constant"}
    assert any(p.kappa == 0.0 for p in tables)
    assert {scene.initial.alpha.constant is None for scene in found} == {True, False}
    assert {scene.geometry.kind for scene in found} == set(scenes.KINDS)
    assert {scene.solver.resolved[1] for scene in found} == {"radau", "bdf2", "backward-euler"}
    assert any(scene.solver.alpha_step == "as-printed" for scene in found)
    for number, scene in zip(RADIAL, found, strict=True):
        assert scene.time.end <= 10.0
        assert len(plane(number)[0].mesh.points) <= 300
        assert np.ptp(plane(number)[0]["radius"]) > 0.05


# -- The two agree ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", RADIAL)
def test_a_disk_along_its_radius_is_that_in_two_dimensions(number: int) -> None:
    """Within the sum of both errors: a third of it, as they are of order two, and half of it for the scatter of alpha, of order 3/2."""
    scene = drawn(number)
    assert "radial symmetry" in names(scene)
    assert names(scenes.full(scene)) == []
    found = agreement(number)
    print(number, {name: round(ratio, 2) for name, ratio in found.ratios.items()})
    assert found.worst <= 1.0, f"scene {number}, difference of allowed: {found}"


# -- What is wrong is found -------------------------------------------------------------------------------------------------

Data = tuple[TumourParameters, TumourInitial, TumourGeometry]


def _without(**values: Any) -> Callable[[TumourParameters, TumourInitial, TumourGeometry], Data]:
    return lambda p, initial, geometry: (replace(p, **values), initial, geometry)


def _other_law(p: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> Data:
    other = "constant" if p.mobility == "darcy" else "darcy"
    return replace(p, mobility=other, mobility_floor=0.0), initial, geometry


def _sharp(p: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> Data:
    return replace(p, sigma_width=0.0, alpha_min=p.alpha_star), initial, geometry


def _uniform(p: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> Data:
    return p, TumourInitial(alpha=0.7), geometry


def _unit(p: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> Data:
    return p, initial, replace(geometry, radius=1.0)


DROPPED = {
    "mobility": _other_law,
    "mobility_floor": _without(mobility_floor=0.0),
    "kappa": _without(kappa=1.0),
    "p_out": _without(p_out=0.0),
    "lambda_alpha": _without(lambda_alpha=0.0),
    "sigma_width": _sharp,
    "Q1_hat": _without(Q1_hat=0.0),
    "C_out": _without(C_out=1.0),
    "s4": _without(s4=10.0),
    "initial.alpha": _uniform,
    "radius": _unit,
}
"""What a wrong radial scheme does with its scene, by the entry that it does not read."""


@pytest.mark.parametrize("entry", DROPPED)
def test_a_radial_run_that_does_not_read_an_entry_is_found(entry: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In each scene in which the entry has a say."""
    for name in ("ElasticRadau", "ElasticLines"):
        monkeypatch.setattr(schemes, name, _changed(getattr(schemes, name), DROPPED[entry]))
    ratios = {number: agreement(number).worst for number in RADIAL if _has(drawn(number), entry)}
    print(entry, {number: round(ratio, 2) for number, ratio in ratios.items()})
    assert ratios
    for number, ratio in ratios.items():
        assert not ratio <= 1.0, f"scene {number} is solved without its {entry}, and nothing shows it: {ratio:.2g} of what is allowed"


def _changed(scheme: Any, change: Callable[..., Data]) -> Callable[..., Any]:
    return lambda p, initial, geometry, solver: scheme(*change(p, initial, geometry), solver)


def _has(scene: Scene, entry: str) -> bool:
    """Whether the scene is another without the entry."""
    p, data = scene.parameters, (scene.parameters, scene.initial, scene.geometry)
    idle = (p.kappa == 0.0 and entry.startswith("mobility")) or (p.Q == 0.0 and entry == "Q1_hat")
    return bool(not idle and DROPPED[entry](*data) != data)


@pytest.mark.parametrize("why", scenes.SPOILS)
def test_data_with_a_direction_are_refused_along_the_radius(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the plan is wrong, the checks of the scene are a second guard."""
    number = next(number for number in range(PLANNED) if scenes.spoil_of(number) == why)
    scenes.draw(number)
    monkeypatch.setattr("tumour.reductions.has_radial_data", lambda scene: True)
    with pytest.raises(ParameterError):
        scenes.draw(number)


@pytest.mark.parametrize("why", WRONG)
def test_data_with_a_direction_that_pass_for_radial_are_found(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the comparison, where neither the plan nor the checks find them."""
    number = WRONG[why]
    assert scenes.spoil_of(number) == why
    runs = plane(number)
    for guard in ("check", "check_boundary"):
        monkeypatch.setattr(f"tumour.model.{guard}", lambda *arguments: None)
    monkeypatch.setattr("tumour.reductions.has_radial_data", lambda scene: True)
    averages = observation.cell_averages
    monkeypatch.setattr(observation, "cell_averages", lambda alpha, R, m: averages(_along_the_diagonal(alpha), R, m))
    scene = scenes.draw(number)[1]
    assert "radial symmetry" in names(scene)
    found = scenes.compared(scene, runs, scenes.with_errors(scene))
    print(number, {name: round(ratio, 2) for name, ratio in found.ratios.items()})
    assert not found.worst <= 1.0


def _along_the_diagonal(alpha: Any) -> Callable[..., Any]:
    """A radial run reads a formula in x, y or theta there, where cos(2 theta) is what it is on average: nothing but the scatter tells."""
    half = np.sqrt(0.5)
    return lambda r, xi: alpha(r=r, xi=xi, x=half * r, y=half * r, theta=0.25 * np.pi + 0.0 * r)
