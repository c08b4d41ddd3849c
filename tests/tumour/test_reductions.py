"""What the plan of a radial tumour leaves out: when, and that a uniform state on one cell is that on all."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from multiphase.run import make_scene, run
from multiphase.scene import Scene
from multiphase.stepping import Snapshot, State, StopRun, Tracker
from tumour.exact import uniform_growth, uniform_growth_eulerian
from tumour.model import MODEL
from tumour.parameters import TumourInitial, TumourParameters
from tumour.presets import find_preset
from tumour.reductions import uniform_because
from tumour.schemes import ElasticRadau, UniformElasticRadau, ViscousRadau

SHAPES = {1: "slab", 2: "disk", 3: "sphere"}


def scene_of(m: int = 3, *, reduce: bool = True, dimension: str = "radial", form: str = "lagrangian", **values: Any) -> Scene:
    """A short radial scene; names of parameters, and alpha, end, cells and other entries of [solver]."""
    alpha, end = values.pop("alpha", 0.75), values.pop("end", 3.0)
    solver = {name: values.pop(name) for name in ("cells", "rtol", "method", "time_scheme") if name in values}
    kind = values.pop("kind", SHAPES[m])
    geometry = {"kind": kind, "formulation": form, "dimension": dimension}
    parameters = TumourParameters(**{"kappa": 0.0, "Q": 0.0, **values})
    settings = {"cells": 12} | solver
    return make_scene(MODEL, parameters, initial={"alpha": alpha}, geometry=geometry, t_end=end, solver=settings, reduce=reduce)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"form": "eulerian"},
        {"Q": 5.0, "C_out": 0.0},
        {"p_out": 0.02, "lambda_alpha": 1.0},
        {"kappa": 1.0, "gamma": 0.0},
        {"kappa": 1.0, "gamma": 0.0, "form": "eulerian"},
        {"kappa": 1.0, "alpha": 0.5, "s2": 3.0},
        {"kappa": 1.0, "alpha": 0.5, "alpha_star": 0.95, "alpha_min": 0.94},
    ],
    ids=str,
)
def test_states_that_stay_uniform(changes: dict[str, Any]) -> None:
    assert uniform_because(scene_of(**changes))
    assert MODEL.plan(scene_of(**changes)).unknowns == (5 if changes.get("form") else 3)
    assert uniform_because(scene_of(reduce=False, **changes)) == ""


@pytest.mark.parametrize(
    "changes",
    [
        {"Q": 0.1},
        {"kappa": 0.1},
        {"alpha": "0.75 + 0*xi"},
        {"alpha_min": 0.7, "alpha_star": 0.8},
        {"kappa": 1.0, "gamma": 0.0, "p_out": 0.01},
        {"kappa": 1.0, "alpha": 0.85},
        {"kappa": 1.0, "alpha": 0.5},
        {"kappa": 1.0, "alpha": 0.5, "s2": 3.0, "p_out": -0.01},
        {"form": "eulerian", "method": "fipy"},
    ],
    ids=str,
)
def test_states_that_may_not(changes: dict[str, Any]) -> None:
    """Oxygen or fluid that flows, cells that are not uniform or attract each other, a pull, or contact that comes; and FiPy, which is taken
    for its terms."""
    assert uniform_because(scene_of(**changes)) == ""
    assert MODEL.plan(scene_of(**changes)).reductions == ()


def test_cells_that_would_touch_within_the_errors_are_left_alone() -> None:
    """Cells grow to the fraction at which births and deaths balance, which lies next to alpha_min; ten rtol are left between."""
    from tumour import equations as eq

    p = TumourParameters()
    balance = eq.homeostatic_fraction(p.C_out, *p.kinetics)
    for room, rest in ((2e-3, True), (0.5e-3, False), (-1e-3, False)):
        near = {"kappa": 1.0, "alpha": 0.5, "alpha_star": 0.99, "alpha_min": balance + room}
        assert bool(uniform_because(scene_of(rtol=1e-4, **near))) is rest


@pytest.mark.parametrize("kind", ["disk", "quarter_disk"])
@pytest.mark.parametrize("changes", [{"Q": 10.0, "kappa": 1.0}, {"kappa": 1.0}, {}, {"Q": 10.0}], ids=str)
def test_a_round_body_is_solved_along_its_radius(kind: str, changes: dict[str, Any]) -> None:
    """And what that saves is what the plan of the usual mesh says."""
    scene = scene_of(kind=kind, dimension="auto", cells=None, **changes)
    assert not scene.geometry.plane
    radial = MODEL.plan(scene).reductions[0]
    whole = scene_of(kind=kind, dimension="auto", cells=None, reduce=False, **changes)
    assert whole.geometry.plane
    assert radial.name == "radial symmetry"
    assert f"{MODEL.plan(whole).unknowns} unknowns a step down to 600" in radial.saves


def test_what_is_radial_by_choice_or_by_kind_is_nothing_to_reduce() -> None:
    for chosen in (
        scene_of(2, kappa=1.0),
        scene_of(3, dimension="auto", kappa=1.0),
        scene_of(2, dimension="auto", form="eulerian", kappa=1.0),
    ):
        assert MODEL.plan(chosen).reductions == ()


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("time_scheme", ["radau", "bdf2"])
def test_an_elastic_run_equals_that_on_all_cells(m: int, time_scheme: str) -> None:
    """To rounding and step for step, through contact at alpha_min and, in a ball with lambda_alpha = 0, past the largest cell fraction at
    J = 3 sqrt(3). Rounding is magnified by the swelling, a thousandfold in volume."""
    settings = {"end": 45.0, "cells": 20, "time_scheme": time_scheme}
    small, whole = (run(scene_of(m, reduce=reduce, **settings)) for reduce in (True, False))
    assert small.stats["steps"] == whole.stats["steps"]
    assert np.max(small["J"]) > (5.2 if m == 3 else 3.0)
    for name in ("alpha", "C", "J", "displacement", "radius", "growth_rate", "cell_mass"):
        assert small[name] == pytest.approx(whole[name], rel=1e-9, abs=1e-10)
    assert np.max(np.abs(small.x - whole.x)) < 1e-9


@pytest.mark.parametrize("m", [1, 2, 3])
def test_one_cell_has_the_exact_growth(m: int) -> None:
    p = TumourParameters(kappa=0.0, Q=0.0)
    elastic = run(scene_of(m, end=40.0, rtol=1e-8))
    J, alpha = uniform_growth(elastic.t, p, m, 0.75)
    assert elastic["J"] == pytest.approx(np.repeat(J[:, None], 12, axis=1), rel=1e-6)  # a hundred local errors
    assert elastic["alpha"] == pytest.approx(np.repeat(alpha[:, None], 12, axis=1), rel=1e-6)
    viscous = run(scene_of(m, end=10.0, rtol=1e-8, form="eulerian"))
    fraction, R = uniform_growth_eulerian(viscous.t, p, m, alpha_0=0.75)
    assert viscous["radius"] == pytest.approx(R, rel=1e-6)
    assert viscous["alpha"][:, 3] == pytest.approx(fraction, rel=1e-6)


def test_vectors_are_spread_as_the_full_scheme_begins() -> None:
    """With a pull from outside, which the body follows at t = 0."""
    scene = scene_of(3, p_out=0.05, lambda_alpha=1.0)
    arguments = (scene.parameters, scene.initial, scene.geometry, scene.solver)
    one = UniformElasticRadau(*arguments)
    assert one.spread(one.initial()) == pytest.approx(ElasticRadau(*arguments).initial(), rel=1e-13)
    assert one.initial().size == 4
    assert one.spread(np.stack([one.initial()] * 3)).shape == (3, 37)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_a_uniform_state_is_the_same_on_any_number_of_cells(m: int) -> None:
    """Rates of a uniform viscous body, on one cell and on seven: those of cells and surface, and no force inside."""
    scene = scene_of(m, p_out=0.03, form="eulerian", alpha=0.86)
    arguments = (scene.parameters, TumourInitial(alpha=0.86), scene.geometry, scene.solver)
    rates = []
    for cells in (1, 7):
        scheme = ViscousRadau(*arguments, cells=cells)
        y, out = scheme.initial(), np.zeros(3 * cells + 4)
        scheme.kernel["rates"](scheme.constants, 0.0, y, out, scheme.work.model)
        assert np.max(np.abs(out[2 : 3 * cells : 3])) < 1e-14
        assert np.ptp(out[0 : 3 * cells : 3]) < 1e-14
        rates.append([out[0], *out[3 * cells :]])
    assert rates[0] == pytest.approx(rates[1], rel=1e-13, abs=1e-16)


def test_the_watch_on_a_disk_sees_a_uniform_run_that_ends_between_stored_times(caplog: pytest.LogCaptureFixture) -> None:
    class Stop(Tracker):
        def on_step(self, state: State) -> None:
            if state.t > 80.0:
                raise StopRun("enough")

        def on_save(self, state: State, snapshot: Snapshot) -> None: ...

    caplog.set_level(logging.WARNING)
    values = dict(find_preset("paper").parameters) | {"kappa": 0.0, "Q": 0.0}
    said = []
    for reduce in (True, False):
        caplog.clear()
        assert run(scene_of(2, reduce=reduce, end=100.0, **values), trackers=[Stop()]).status == "stopped"
        said.append([record.getMessage() for record in caplog.records])
    assert said[0] == said[1]
