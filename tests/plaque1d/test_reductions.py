"""What the plan of a plaque leaves out: when, and that modLDL alone has the exact answers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase.run import make_scene, run
from multiphase.scene import Scene
from plaque1d.lines_scheme import FixedFractionsRadau
from plaque1d.model import MODEL
from plaque1d.parameters import PlaqueGeometry, PlaqueParameters
from plaque1d.reductions import fixed_fractions_because


def scene_of(*, reduce: bool = True, annulus: bool = False, n: Any = 0.0, l: Any = 0.5, **values: Any) -> Scene:
    """A short scene; names of parameters, and end and entries of [solver]."""
    end = values.pop("end", 1.0)
    solver = {name: values.pop(name) for name in ("cells", "rtol", "method", "time_scheme", "dt") if name in values}
    geometry = PlaqueGeometry(kind="annulus", lumen_radius=3.0) if annulus else PlaqueGeometry()
    parameters = PlaqueParameters(**{"k_m": 0.0, **values})
    settings = {"cells": 16} | solver
    return make_scene(MODEL, parameters, initial={"n": n, "l": l}, geometry=geometry, t_end=end, solver=settings, reduce=reduce)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"annulus": True, "momentum": "drag", "p_out": 1.0},
        {"inner_wall": 0.4},
        {"n": 1.0, "Psi_m": 0.0, "k_m": 2.0},
        {"n": 1.0, "Psi_m": 0.0, "inner_wall": 0.4},
        {"n": "0.3 + 0.2*xi", "Psi_m": 0.0, "A": 0.0, "inner_wall": 0.4},
        {"n": "0.3 + 0.2*xi", "Psi_m": 0.0, "A": 0.0, "momentum": "drag"},
        {"n": 0.3, "Psi_m": 0.0, "A": 0.0, "momentum": "drag", "p_out": 1.0},
        {"n": 0.3, "Psi_m": 0.0, "B": 0.0},
    ],
    ids=str,
)
def test_fractions_that_stay(changes: dict[str, Any]) -> None:
    scene = scene_of(**changes)
    assert fixed_fractions_because(scene)
    assert MODEL.plan(scene).unknowns == 17
    assert fixed_fractions_because(scene_of(reduce=False, **changes)) == ""
    full = run(scene_of(reduce=False, **changes))
    assert np.max(np.abs(full["n"] - full["n"][0])) < 1e-13  # what is made use of holds in the whole system


@pytest.mark.parametrize(
    "changes",
    [
        {"k_m": 0.1},
        {"n": 1e-3},
        {"n": 1.0},
        {"n": "0.3 + 0.2*xi", "Psi_m": 0.0, "B": 0.0},
        {"n": 0.3, "Psi_m": 0.0},
        {"n": 0.3, "Psi_m": 0.0, "A": 0.0, "k_m": 0.1},
        {"n": "0.3 + 0.2*xi", "Psi_m": 0.0, "A": 0.0, "momentum": "drag", "p_out": 1.0},
        {"momentum": "drag", "mu_n": 0.0, "mu_m": 0.0, "p_out": 1.0},
        {"method": "fipy"},
    ],
    ids=str,
)
def test_fractions_that_may_not(changes: dict[str, Any]) -> None:
    scene = scene_of(**changes)
    assert fixed_fractions_because(scene) == ""
    assert MODEL.plan(scene).reductions == ()


@pytest.mark.parametrize("annulus", [False, True])
@pytest.mark.parametrize("time_scheme", ["radau", "bdf2", "backward-euler"])
def test_a_run_takes_the_steps_of_the_whole_system(annulus: bool, time_scheme: str) -> None:
    """Norms of errors are the same, n being without any; velocities between the steps of Radau IIA are interpolated in both."""
    settings: dict[str, Any] = {
        "annulus": annulus,
        "time_scheme": time_scheme,
        "Psi_l": {"times": [0.3, 0.5, 0.5], "values": [1.0, 2.0, 0.5]},
    }
    if time_scheme == "backward-euler":
        settings["dt"] = 0.05
    small, whole = (run(scene_of(reduce=reduce, **settings)) for reduce in (True, False))
    assert small.stats["steps"] == whole.stats["steps"]
    for name in (*whole.fields, *whole.scalars):
        assert small[name] == pytest.approx(whole[name], abs=1e-5 if name.startswith("u_") else 1e-10)


@pytest.mark.parametrize("annulus", [False, True])
def test_the_steady_profile_grows_as_it_must(annulus: bool) -> None:
    """k_l = 0 and l = sqrt(Psi_l/Psi_m) everywhere: what comes in fills the width that it makes, so l stays, and in the slab the width
    grows at the rate Psi_m l. To what Newton's method leaves."""
    result = run(scene_of(annulus=annulus, l=2.0, Psi_l=0.8, Psi_m=0.2, k_l=0.0, end=3.0))
    assert result["l"] == pytest.approx(2.0, rel=1e-7)
    if not annulus:
        assert result["L"] == pytest.approx(result["L"][0] + 0.4 * result.t, rel=1e-7)
    assert np.max(np.abs(result["defect_L"])) < 1e-13


def test_modldl_decays_as_it_must() -> None:
    """Uniform, with nothing coming in and macrophages everywhere: l' = -k_l l."""
    result = run(scene_of(Psi_l=0.0, Psi_m=0.0, k_l=2.0, l=0.7, rtol=1e-8))
    assert result["l"] == pytest.approx(np.repeat(0.7 * np.exp(-2.0 * result.t)[:, None], 16, axis=1), rel=1e-6)


@pytest.mark.parametrize("annulus", [False, True])
def test_the_tangent_is_the_derivative(annulus: bool) -> None:
    """Against central differences, whose error is 1e-9 or so of the largest entry."""
    scene = scene_of(annulus=annulus, l="0.5 + 0.3*cos(2*xi)")
    scheme = FixedFractionsRadau(scene.parameters, scene.initial, scene.geometry, 6, 1e-4)
    y, w, d = scheme.initial(), scheme.work, scheme.data(0.0)
    rates, total = scheme.kernel["rates"], scheme.initial().size
    rates(d, 0.0, y, w.f_0, w.model)
    scheme.kernel["tangent"](d, 0.0, y, w.f_0, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
    made = np.zeros((total, 8))
    for i in range(6):
        for k in range(max(i - 1, 0), min(i + 1, 5) + 1):
            made[i, k] = w.jac[i, k - i + 1]
    made[:6, 6:], made[6:8, :6], made[6:8, 6:], made[8:, :6], made[8:, 6:] = w.columns.T, w.rows, w.corner, w.q_rows, w.q_corner
    out = np.zeros((2, total))
    for j in range(8):
        step = 1e-6 * max(abs(y[j]), 1.0)
        for sign, row in ((1.0, 0), (-1.0, 1)):
            moved = y.copy()
            moved[j] += sign * step
            rates(d, 0.0, moved, out[row], w.model)
        assert made[:, j] == pytest.approx((out[0] - out[1]) / (2.0 * step), abs=1e-5 * np.max(np.abs(made)))


def test_a_bound_is_refused_as_by_the_whole_system() -> None:
    scene = scene_of()
    scheme = FixedFractionsRadau(scene.parameters, scene.initial, scene.geometry, 6, 1e-4)
    y = scheme.initial()
    assert scheme.kernel["admit"](scheme.data(0.0), y, scheme.work.model) == 0
    y[2] = -1e-3
    assert "l falls below 0" in scheme.out_of_bounds(scheme.kernel["admit"](scheme.data(0.0), y, scheme.work.model))
    y[6] = 0.0
    assert scheme.kernel["admit"](scheme.data(0.0), y, scheme.work.model) == 3
