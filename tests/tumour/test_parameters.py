"""The tumour's parameters: presets, allowed ranges, checks across tables."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.parameters import from_table, replace, specifications, to_table
from multiphase.scene import differences, parse_scene
from tumour import equations as eq
from tumour.checks import check
from tumour.geometry import TumourGeometry
from tumour.parameters import TISSUE, TumourInitial, TumourParameters
from tumour.presets import PRESETS, find_preset
from tumour.solver import TumourSolver

DEFAULTS = {
    "mu_alpha": 1.0, "lambda_alpha": 0.0, "kappa": 1.0, "mobility": "darcy", "mobility_floor": 0.0, "gamma": 1.0, "alpha_star": 0.8,
    "alpha_min": 0.8, "sigma_width": 0.0, "s1": 10.0, "s2": 0.5, "s3": 0.5, "s4": 10.0, "Q": 0.5, "Q1_hat": 0.0, "C_out": 1.0, "p_out": 0.0,
    "C_hypoxic": 0.5, "C_necrotic": "kinetic", "stiffness": 1.0, "permeability": 1.0, "diffusivity": 1.0, "consumption": 1.0,
    "fibre_angle": 0.0, "fibre_ratio": 1.0, "fibre_stiffness": 0.0,
}  # fmt: skip

OTHERS: dict[str, Any] = {
    "stiffness": "1 + x**2", "permeability": {"along": 2.0, "across": "1 + r"}, "diffusivity": {"xx": 1.0, "yy": 2.0, "xy": 0.5},
    "consumption": {"at": [0.0, 1.0], "values": [1.0, 0.0]}, "fibre_angle": "theta + pi/2", "fibre_ratio": 0.0,
    "fibre_stiffness": {"pixel": 1.0, "values": [[0.0, 1.0], [2.0, 3.0]]},
}  # fmt: skip
"""A tissue that differs from the paper's in each of the seven."""

DISK = {"kind": "disk", "dimension": "2d"}


def check_all(
    parameters: TumourParameters | None = None, initial: TumourInitial | None = None, solver: TumourSolver | None = None, **geometry: Any
) -> None:
    check(parameters or TumourParameters(), initial or TumourInitial(), TumourGeometry(**geometry), solver or TumourSolver())


def refusal(*parts: Any, **geometry: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        check_all(*parts, **geometry)
    return caught.value


def test_contract_names_and_defaults() -> None:
    assert list(specifications(TumourParameters)) == list(DEFAULTS)
    assert to_table(TumourParameters()) == DEFAULTS
    assert to_table(TumourInitial()) == {"alpha": 0.8}
    assert to_table(TumourGeometry()) == {"kind": "disk", "radius": 1.0, "dimension": "auto", "formulation": "lagrangian"}
    assert to_table(TumourSolver()) == {
        "method": "auto", "rtol": 1e-4, "time_scheme": "auto", "max_steps": 100_000, "alpha_step": "conservative", "linear": "auto",
        "assembly": "compiled",
    }  # fmt: skip
    assert all(specification.source for specification in specifications(TumourParameters).values())


def test_presets() -> None:
    changes: dict[str, dict[str, Any]] = {
        "paper": {"mobility": "printed"},
        "authors-disk": {"mobility": "printed", "mobility_floor": 1e-4},
        "authors-glioma": {"mobility": "constant", "lambda_alpha": 1.0},
        "ward-king": {"s2": 1.1, "s3": 2.2, "s4": 20.0, "Q": 0.05, "Q1_hat": 10.0},
    }
    assert list(PRESETS) == list(changes)
    for name, change in changes.items():
        assert to_table(TumourParameters.preset(name)) == DEFAULTS | change
        assert TumourInitial.preset(name) == TumourInitial(alpha=0.8)
        for kind in ("slab", "disk", "quarter_disk", "sphere"):
            check_all(TumourParameters.preset(name), TumourInitial.preset(name), TumourSolver.preset(name), kind=kind)
        as_printed = TumourSolver(alpha_step="as-printed", time_scheme="backward-euler", dt=0.5)
        assert TumourSolver.preset(name) == (as_printed if name == "authors-disk" else TumourSolver())
        assert len(PRESETS[name].source) > 100
    for call in (TumourParameters.preset, TumourInitial.preset, TumourSolver.preset, find_preset):
        with pytest.raises(ParameterError, match=r'parameters\.preset: .*"wardking"; did you mean "ward-king"\?'):
            call("wardking")


def test_the_level_of_necrosis() -> None:
    assert TumourParameters().necrotic_level == pytest.approx(5.0 / 17.0, rel=1e-14)
    assert TumourParameters(C_necrotic=0.1).necrotic_level == 0.1
    assert np.isnan(TumourParameters(s2=10.0, s3=10.0, s4=0.0).necrotic_level)  # cells that never multiply
    for value in (-0.1, "kinetics"):
        with pytest.raises(ParameterError, match=r"parameters\.C_necrotic"):
            TumourParameters(C_necrotic=value)


def test_the_kinetics_of_ward_and_king() -> None:
    """Their rates per cell in units of their time, against this model's over 1.1 of them; births without the factor 1 - alpha."""
    p = TumourParameters.preset("ward-king")
    c, n = np.linspace(1e-3, 2.0, 50), 0.37
    k_m, k_d = c / (c + 0.1), 1.0 - 0.9 * c / (c + 0.05)
    per_cell = eq.net_growth(n, c, *p.kinetics) / n / 1.1
    np.testing.assert_allclose(per_cell, k_m * (1.0 - n) - k_d, rtol=1e-13, atol=1e-15)  # some ten roundings
    np.testing.assert_allclose(eq.oxygen_uptake(n, c, *p.uptake), 0.005 * n * k_m, rtol=1e-14)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("mu_alpha", 0, "greater than 0"), ("kappa", -1, "of 0 or more"), ("mobility", "darci", 'did you mean "darcy"'),
        ("mobility_floor", -1, "of 0 or more"), ("mobility_floor", 1e-4, 'mobility = "printed"'), ("gamma", -1, "of 0 or more"),
        ("alpha_star", -0.1, "of 0 or more"), ("alpha_star", 1, "below 1"), ("alpha_min", -0.1, "from 0 to 1"),
        ("alpha_min", 1.1, "from 0 to 1"), ("sigma_width", -0.1, "from 0 to 1"), ("s1", -1, "of 0 or more"), ("s2", -1, "of 0 or more"),
        ("s3", -1, "of 0 or more"), ("s4", -1, "of 0 or more"), ("Q", -1, "of 0 or more"), ("Q1_hat", -1, "of 0 or more"),
        ("C_out", -1, "of 0 or more"), ("p_out", float("inf"), "finite"), ("lambda_alpha", "soft", "soft"), ("s2", None, "nothing"),
        ("stiffness", 0, "greater than 0"), ("stiffness", {"at": [0, 1], "values": [1, 0]}, "greater than 0"), ("stiffness", "z", "uses z"),
        ("stiffness", {"pixel": 1, "values": [[1, -1]]}, "-1 is not allowed; the stiffness"), ("consumption", -1, "of 0 or more"),
        ("fibre_angle", float("nan"), "finite"), ("fibre_ratio", -0.1, "of 0 or more"), ("fibre_stiffness", -1, "of 0 or more"),
        ("permeability", 0, "greater than 0"), ("diffusivity", {"xx": 1, "yy": 1, "xy": 2}, "not positive definite"),
        ("permeability", [[1, 0], [0, 1]], "along = "), ("fibre_ratio", None, "nothing"),
    ],
)  # fmt: skip
def test_parameters_refused(name: str, value: Any, words: str) -> None:
    with pytest.raises(ParameterError, match=words) as caught:
        TumourParameters(**{name: value})
    assert caught.value.path == f"parameters.{name}"


def test_parameters_allowed_at_their_bounds() -> None:
    zeros = dict.fromkeys(("kappa", "gamma", "alpha_star", "alpha_min", "s1", "s2", "s3", "s4", "Q", "Q1_hat", "C_out"), 0.0)
    check_all(TumourParameters(**zeros, p_out=-1.0, mobility="printed", mobility_floor=1e-4))
    TumourParameters(alpha_min=1.0, sigma_width=1.0)
    TumourParameters(alpha_min=0.3, alpha_star=0.5)  # cells that attract


def test_groups_go_to_the_laws_in_their_order() -> None:
    p = TumourParameters(
        gamma=1.0, alpha_star=0.2, alpha_min=0.3, sigma_width=0.4, s1=5.0, s2=6.0, s3=7.0, s4=8.0, Q=9.0, Q1_hat=10.0, kappa=11.0,
        mobility="printed", mobility_floor=12.0, mu_alpha=13.0, lambda_alpha=14.0,
    )  # fmt: skip
    assert (p.contact, p.kinetics, p.uptake) == ((1.0, 0.2, 0.3, 0.4), (5.0, 6.0, 7.0, 8.0), (9.0, 10.0))
    assert (p.flow, p.moduli) == ((11.0, eq.PRINTED, 12.0), (13.0, 14.0))


@pytest.mark.parametrize(
    ("kind", "formulation", "bound", "at_bound"),
    [
        ("slab", "lagrangian", -2.0, False), ("disk", "lagrangian", 0.0, True), ("quarter_disk", "lagrangian", 0.0, True),
        ("sphere", "lagrangian", 0.0, True), ("slab", "eulerian", -4.0, False), ("disk", "eulerian", -2.0, False),
        ("quarter_disk", "eulerian", -2.0, False), ("sphere", "eulerian", -4.0 / 3.0, False),
    ],
)  # fmt: skip
def test_unstable_materials_are_refused(kind: str, formulation: str, bound: float, at_bound: bool) -> None:
    def material(lam: float) -> TumourParameters:
        return TumourParameters(mu_alpha=2.0, lambda_alpha=lam)

    shape = {"kind": kind, "formulation": formulation}
    check_all(material(bound + 1e-9), **shape)
    if at_bound:
        check_all(material(bound), **shape)
    error = refusal(material(bound - 1e-9 if at_bound else bound * (1 + 1e-15)), **shape)
    assert error.path == "parameters.lambda_alpha"
    assert f"{bound:g}" in str(error)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_bounds_of_the_elastic_moduli_are_where_convexity_ends(m: int) -> None:
    """d2W/dl_r2 over all stretches up to 1e3: positive from the bound on, negative somewhere below it."""
    l_r, l_t = np.meshgrid(np.geomspace(1e-3, 1e3, 61), np.geomspace(1e-3, 1e3, 61) if m > 1 else [1.0])
    bound = -1.0 if m == 1 else 0.0
    assert np.all(eq.elastic_stress_slopes(l_r, l_t, m, 1.0, bound)[0] > 0.0)
    assert np.any(eq.elastic_stress_slopes(l_r, l_t, m, 1.0, bound - 1e-4)[0] < 0.0)


@pytest.mark.parametrize(
    "alpha",
    [0.0, 1.0, -0.1, 1.5, "0.5 + r", "xi", "1 - xi", "x", "log(r)", {"at": [0, 1], "values": [0.5, 1.0]}, lambda r: 1.0 - r,
     {"at": [0, 1.5], "values": [0.5, 0.6]}, {"at": [-0.1, 1], "values": [0.5, 0.6]}],
)  # fmt: skip
def test_initial_states_refused(alpha: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        check_all(initial=TumourInitial(alpha=alpha))
    assert caught.value.path == "initial.alpha"


def test_message_gives_the_worst_position() -> None:
    error = refusal(None, TumourInitial(alpha="0.5 + xi"), radius=2.0)
    assert "alpha is 1.5 at r = 2 (xi = 1); it must be greater than 0 and below 1 everywhere" in str(error)
    with pytest.raises(ParameterError, match=r"may use r, xi, x, y, theta, pi"):
        TumourInitial(alpha="0.8 - 0.1*z")
    assert "the formula uses theta, x, but fields of this body" in str(refusal(None, TumourInitial(alpha="0.8 - 0.1*x*cos(theta)")))


def test_positions_are_called_r() -> None:
    r = np.array([0.0, 1.0, 2.0])
    for alpha in ("0.8 - 0.1*r", "0.8 - 0.2*xi", {"at": [0, 2], "values": [0.8, 0.6]}, lambda r: 0.8 - 0.1 * r, lambda xi: 0.8 - 0.2 * xi):
        initial = TumourInitial(alpha=alpha).within(2.0)
        np.testing.assert_allclose(initial.alpha(r=r, xi=r / 2.0), [0.8, 0.7, 0.6], rtol=1e-15)
        check_all(initial=initial, radius=2.0)
        assert pickle.loads(pickle.dumps(initial)) == initial
        assert from_table(TumourInitial, to_table(initial), "initial") == initial


def test_a_callable_belongs_to_the_body_it_was_sampled_on() -> None:
    initial = TumourInitial(alpha=lambda r: 0.5 + 0.1 * r)
    check_all(initial=initial)
    error = refusal(None, initial, radius=3.0)
    assert error.path == "initial.alpha"
    assert "initial.within(3)" in str(error)
    assert initial.within(3.0).alpha(r=np.array([3.0]), xi=np.array([1.0])) == pytest.approx(0.8, rel=1e-15)


def test_geometry() -> None:
    shapes = {"slab": (1, 1.0, 2.0), "disk": (2, 1.0, np.pi), "quarter_disk": (2, 0.25, np.pi / 4), "sphere": (3, 1.0, 4 * np.pi / 3)}
    for kind, (m, share, size) in shapes.items():
        geometry = TumourGeometry(kind=kind, dimension="radial", radius=1e-12)
        assert (geometry.m, geometry.share) == (m, share)
        assert geometry.size(1.0) == pytest.approx(size, rel=1e-15)
        assert geometry.size(2.0) == pytest.approx(2**m * size, rel=1e-15)
    assert TumourGeometry(formulation="eulerian").eulerian
    assert not TumourGeometry().eulerian
    for values, name, words in (
        ({"kind": "spheer"}, "kind", 'did you mean "sphere"'),
        ({"radius": 0.0}, "radius", "from 1e-12"),
        ({"radius": 1e13}, "radius", "to 1e\\+12"),
        ({"formulation": "euler"}, "formulation", 'did you mean "eulerian"'),
        ({"dimension": "3d"}, "dimension", '"2d"'),
        ({"dimension": "2d", "kind": "sphere"}, "dimension", "no meaning for a sphere"),
        ({"dimension": "2d", "formulation": "eulerian"}, "dimension", "the Eulerian formulation is for radial bodies alone"),
        ({"kind": "glioma", "formulation": "eulerian"}, "formulation", 'take formulation = "lagrangian"'),
        ({"kind": "glioma", "dimension": "radial"}, "dimension", "which is not round"),
        ({"kind": "mesh"}, "file", "is missing"),
        ({"kind": "disk", "file": "x.msh"}, "file", "no meaning for a disk"),
        ({"kind": "mesh", "file": "x.msh", "radius": 2.0}, "radius", "has its own size"),
        ({"kind": "glioma", "slide_x": ["left"]}, "slide_x", "only a mesh has named sides"),
    ):
        with pytest.raises(ParameterError, match=words) as caught:
            TumourGeometry(**values)
        assert caught.value.path == f"geometry.{name}"


def test_solver() -> None:
    TumourSolver(cells=4, rtol=0.1, dt=1e-9, max_steps=1, method="fipy", time_scheme="backward-euler")
    for values, resolved in (
        ({}, ("lines", "radau")),
        ({"method": "fipy"}, ("fipy", "bdf2")),
        ({"time_scheme": "bdf2"}, ("lines", "bdf2")),
        ({"alpha_step": "as-printed"}, ("lines", "backward-euler")),
        ({"alpha_step": "as-printed", "time_scheme": "backward-euler"}, ("lines", "backward-euler")),
    ):
        assert TumourSolver(**values).resolved == resolved
    for values, name in (
        ({"cells": 3}, "cells"), ({"cells": 4.5}, "cells"), ({"rtol": 0.0}, "rtol"), ({"rtol": 0.11}, "rtol"), ({"dt": 0.0}, "dt"),
        ({"max_steps": 0}, "max_steps"), ({"method": "line"}, "method"), ({"time_scheme": "bdf3"}, "time_scheme"),
        ({"alpha_step": "printed"}, "alpha_step"), ({"alpha_step": "as-printed", "time_scheme": "bdf2"}, "alpha_step"),
        ({"method": "fipy", "time_scheme": "radau"}, "time_scheme"),
    ):  # fmt: skip
        with pytest.raises(ParameterError) as caught:
            TumourSolver(**values)
        assert caught.value.path == f"solver.{name}"


def test_what_a_formulation_does_not_have() -> None:
    fipy, printed = TumourSolver(method="fipy"), TumourSolver(alpha_step="as-printed")
    check_all(None, None, fipy, formulation="eulerian")
    check_all(None, None, printed)
    assert refusal(None, None, fipy).path == "solver.method"
    assert refusal(None, None, printed, formulation="eulerian").path == "solver.alpha_step"


def test_sizes_that_only_a_wrong_unit_explains() -> None:
    for name, value in (("p_out", -2e12), ("gamma", 1e13), ("kappa", 1e-13), ("mu_alpha", 1e-13)):
        assert refusal(replace(TumourParameters(), **{name: value})).path == f"parameters.{name}"


def test_a_contact_stress_that_jumps_up_is_refused():
    """Contact would push cells back below alpha_min as soon as they reach it."""
    with pytest.raises(ParameterError, match="sigma_width") as caught:
        TumourParameters(alpha_min=0.9)
    assert caught.value.path == "parameters.alpha_min"
    TumourParameters(alpha_min=0.9, sigma_width=0.02)
    TumourParameters(alpha_min=0.9, gamma=0.0)


def test_a_tissue_that_differs_from_the_papers() -> None:
    plain = TumourParameters()
    assert plain.is_plain
    assert plain.varying == ()
    assert TumourParameters(stiffness=1, fibre_angle=0).is_plain
    assert tuple(OTHERS) == TISSUE
    for name, value in OTHERS.items():
        changed = replace(plain, **{name: value})
        assert not changed.is_plain
        assert changed.varying == (name,)
        assert to_table(changed) == DEFAULTS | {name: value}
        assert replace(changed, **{name: DEFAULTS[name]}) == plain
    every = TumourParameters(**OTHERS)
    assert every.varying == TISSUE
    assert to_table(every) == DEFAULTS | OTHERS
    assert from_table(TumourParameters, to_table(every), "parameters") == every == pickle.loads(pickle.dumps(every))
    assert hash(every) == hash(TumourParameters(**OTHERS))


def test_a_tissue_belongs_to_the_elastic_model_in_two_dimensions() -> None:
    for name, value in OTHERS.items():
        tissue = TumourParameters(**{name: value})
        for shape in (DISK, {"kind": "quarter_disk", "dimension": "2d"}, {"kind": "glioma"}):
            check_all(tissue, None, TumourSolver(method="mini"), **shape)
        for shape, words in (
            ({"kind": "disk"}, 'write dimension = "2d" in [geometry]'),
            ({"kind": "quarter_disk", "dimension": "radial"}, 'write dimension = "2d" in [geometry]'),
            ({"kind": "sphere"}, "only the elastic (Lagrangian) model in two dimensions"),
            ({"kind": "slab"}, "only the elastic (Lagrangian) model in two dimensions"),
            ({"kind": "disk", "formulation": "eulerian"}, "only the elastic (Lagrangian) model in two dimensions"),
        ):
            error = refusal(tissue, **shape)
            assert error.path == f"parameters.{name}"
            assert words in str(error)
    for kind in ("slab", "disk", "sphere"):
        check_all(TumourParameters(stiffness=1.0, permeability=1), kind=kind)


def test_python_functions_of_the_tissue_belong_to_the_body_they_were_sampled_on() -> None:
    mini = TumourSolver(method="mini")
    tissue = TumourParameters(stiffness=lambda r: 1.0 + r, permeability={"along": lambda xi: 1.0 + xi, "across": 1.0}, Q=2.0)
    check_all(tissue, None, mini, **DISK)
    error = refusal(tissue, None, mini, radius=3.0, **DISK)
    assert (error.path, "parameters.within(3)" in str(error)) == ("parameters.stiffness", True)
    larger = tissue.within(3.0)
    check_all(larger, None, mini, radius=3.0, **DISK)
    place = {"r": np.array([3.0]), "xi": np.array([1.0])}
    assert larger.stiffness(**place) == pytest.approx(4.0, rel=1e-15)
    assert larger.permeability(0.0, **place)[0].tolist() == [2.0, 1.0, 0.0]
    assert larger.Q == 2.0
    changed = replace(larger, Q=1.0)  # keeps the samples
    assert changed.stiffness == larger.stiffness != tissue.stiffness
    check_all(changed, None, mini, radius=3.0, **DISK)
    error = refusal(tissue, None, mini, kind="glioma")
    assert (error.path, "this body is none" in str(error)) == ("parameters.stiffness", True)
    plain = TumourParameters(stiffness="1 + r")
    assert plain.within(2.0) is plain


def test_sizes_of_a_tissue_that_only_a_mistake_explains() -> None:
    mini = TumourSolver(method="mini")
    for name, value in (
        ("stiffness", 1e13), ("stiffness", 1e-13), ("fibre_angle", -1e13), ("fibre_stiffness", {"pixel": 1.0, "values": [[1.0, 1e13]]}),
        ("permeability", 1e13), ("permeability", {"along": 1.0, "across": 1e13}), ("diffusivity", 1e-13), ("permeability", 1e-13),
    ):  # fmt: skip
        error = refusal(TumourParameters(**{name: value}), None, mini, **DISK)
        assert error.path == f"parameters.{name}"
        assert "1e" in str(error)
    check_all(TumourParameters(consumption=0.0, fibre_ratio=0.0, stiffness="1 + x"), None, mini, **DISK)


SCENE = """
[scene]
model = "tumour"
[geometry]
dimension = "2d"
[time]
end = 1.0
[parameters]
stiffness = { image = "k.png", pixel = 0.25, low = 0.2, high = 1.5 }
permeability = { along = 2, across = { image = "k.png", pixel = 0.25, low = 1, high = 2 } }
"""


def test_a_scene_with_images_is_stored_with_their_values(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    Image.fromarray(rng.integers(0, 256, (10, 12), dtype=np.uint8)).save(tmp_path / "k.png")
    scene = parse_scene(SCENE, name="x", file=tmp_path / "x.toml")
    assert scene.parameters.stiffness.is_grid
    text = scene.to_toml()
    assert "k.png" not in text
    assert max(map(len, text.splitlines())) < 150
    rows = [line for line in text.splitlines() if line.startswith("    [") and line.endswith("],")]
    assert len(rows) == 2 * 10  # a line for each row of pixels
    assert [float(value) for value in rows[0].strip(" [],").split(", ")] == scene.parameters.stiffness.to_table()["values"][0]
    again = parse_scene(text, name="x", file=tmp_path / "elsewhere" / "x.toml")
    assert again == scene
    assert differences(again, scene) == []
    other = again.with_changes(parameters={"stiffness": {"pixel": 0.3, "values": scene.parameters.stiffness.to_table()["values"]}})
    assert differences(again, other) == ["parameters.stiffness.pixel: 0.25 in the file, 0.3 in the scene"]
    one = again.parameters.stiffness.to_table()
    one["values"][3][4] += 0.1
    (line,) = differences(again, again.with_changes(parameters={"stiffness": one}))
    assert line == "parameters.stiffness.values: other numbers in the file than in the scene"
    few, others = ({"pixel": 1.0, "values": [[value] * 40] * 4} for value in (1.0, 2.0))
    (line,) = differences(again.with_changes(parameters={"stiffness": few}), again.with_changes(parameters={"stiffness": others}))
    assert line == "parameters.stiffness.values: other numbers in the file than in the scene"


def test_scenes_stored_before_there_were_tissues_are_the_same_scenes() -> None:
    scene = parse_scene('scene.model = "tumour"\ntime.end = 1.0', name="x")
    lines = scene.to_toml().splitlines()
    old = [line for line in lines if line.split(" = ")[0] not in TISSUE]
    assert len(lines) - len(old) == len(TISSUE)
    stored = parse_scene("\n".join(old), name="x")
    assert stored == scene
    assert differences(stored, scene) == []
