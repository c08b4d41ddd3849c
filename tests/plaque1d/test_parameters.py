"""The plaque's parameters: presets, allowed ranges, checks across tables, shipped scenes."""

from __future__ import annotations

import tomllib
from fractions import Fraction
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.parameters import replace, specifications, to_table
from multiphase.scales import Scales
from plaque1d import simulate
from plaque1d.parameters import (
    PRESETS,
    PlaqueGeometry,
    PlaqueInitial,
    PlaqueParameters,
    PlaqueSolver,
    check,
    find_preset,
)


def test_contract_names() -> None:
    assert list(specifications(PlaqueParameters)) == (
        ["Psi_l", "Psi_m", "k_l", "k_m", "b", "mu_n", "lambda_n", "mu_m", "lambda_m", "A", "B", "k", "p_out", "momentum", "inner_wall"]
    )
    assert list(specifications(PlaqueInitial)) == ["n", "l", "L"]


def test_defaults_are_the_demo() -> None:
    assert PlaqueParameters() == PlaqueParameters.preset("demo")
    assert PlaqueInitial() == PlaqueInitial.preset("demo")
    assert to_table(PlaqueParameters()) == {
        "Psi_l": 1.0, "Psi_m": 0.2, "k_l": 10.0, "k_m": 1.0, "b": 1.0, "mu_n": 0.005, "lambda_n": 0.0, "mu_m": 0.005, "lambda_m": 0.0,
        "A": 0.1, "B": 1.0, "k": 1.0, "p_out": 0.0, "momentum": "interfacial", "inner_wall": "no_gradient",
    }  # fmt: skip
    assert to_table(PlaqueInitial()) == {"n": 0.9, "l": 0.0, "L": 1.0}


@pytest.mark.parametrize(("name", "rates", "group"), [("mouse", (2e-3, 0.13, 4.0, 0.35), 0.55), ("human", (2e-3, 5e-3, 4.0, 0.0136), 0.54)])
def test_presets(name: str, rates: tuple[float, ...], group: float) -> None:
    p = PlaqueParameters.preset(name)
    assert (p.Psi_l, p.Psi_m, p.k_l, p.k_m) == rates
    assert (p.A, p.B, p.k, p.b, p.p_out, p.nu_n, p.nu_m) == (3e-3, 500.0, 1.0, 1.0, 0.0, 0.01, 0.01)
    assert p.k_l * p.Psi_m**2 / p.k_m**2 == pytest.approx(group, abs=5e-3)  # the group is quoted to two digits
    assert to_table(PlaqueInitial.preset(name)) == {"n": 0.95, "l": 0.0, "L": 1.0}
    check(p, PlaqueInitial.preset(name))
    assert "doi" in PRESETS[name].source
    assert "assumed" in PRESETS[name].source


def test_preset_scales_are_those_of_the_diffusion_time() -> None:
    seconds = {"mouse": 7 * 86400.0, "human": 365.25 * 86400.0}
    assert PRESETS["demo"].scales is None
    for name, unit in (("mouse", "week"), ("human", "year")):
        table = PRESETS[name].scales
        assert table is not None
        scales = Scales.from_table(table)
        factor, label = scales.factor({"time": 1})
        assert factor * seconds[name] == pytest.approx((100e-6) ** 2 / 5.4e-12, rel=1e-14)  # a few roundings
        assert label == unit
        assert scales.factor({"length": 1, "time": -1}) == (pytest.approx(100.0 / factor, rel=1e-15), f"µm/{unit}")
        a = PlaqueParameters.preset(name).A
        assert scales.factor({"pressure": 1})[0] * a == pytest.approx(0.3, rel=1e-15)  # 300 Pa in kPa, as the preset's source says
        assert scales.factor({"concentration": 1}) == (1.0, "plasma LDL")


def test_unknown_preset() -> None:
    for call in (PlaqueParameters.preset, PlaqueInitial.preset, find_preset):
        with pytest.raises(ParameterError, match=r'parameters\.preset: .*"mose"; did you mean "mouse"\?'):
            call("mose")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Psi_l", -1), ("Psi_m", -1), ("k_l", -1), ("k_m", -1), ("b", 0), ("b", -1), ("mu_n", -1), ("mu_m", -1), ("A", -1), ("B", -1),
        ("k", 0), ("momentum", "darcy"), ("inner_wall", 1), ("inner_wall", 0), ("inner_wall", -0.1), ("inner_wall", "free"),
        ("k_m", float("nan")),
        ("lambda_n", -0.0101), ("lambda_m", -0.0101), ("p_out", float("inf")),
    ],
)  # fmt: skip
def test_parameters_refused(name: str, value: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        PlaqueParameters(**{name: value})
    assert caught.value.path == f"parameters.{name}"


def test_parameters_allowed_at_their_bounds() -> None:
    zeros = dict.fromkeys(("Psi_l", "Psi_m", "k_l", "k_m", "mu_n", "mu_m", "A", "B"), 0.0)
    inviscid = PlaqueParameters(**zeros, p_out=-1.0)
    assert inviscid.nu == (inviscid.nu_n, inviscid.nu_m) == (0.0, 0.0)
    assert PlaqueParameters(mu_n=1.0, lambda_n=-2.0).nu_n == 0.0
    assert PlaqueParameters(mu_m=1.0, lambda_m=0.5).nu_m == 2.5


def test_influx_may_depend_on_time() -> None:
    p = PlaqueParameters(Psi_l={"times": [0, 10, 10], "values": [1, 1, 0]})
    assert (p.Psi_l(10.0, side=-1), p.Psi_l(10.0), p.Psi_l.jumps) == (1.0, 0.0, (10.0,))
    assert replace(p, k_m=2.0).Psi_l == p.Psi_l


@pytest.mark.parametrize(
    ("values", "path"),
    [
        ({"n": 1.5}, "initial.n"),
        ({"n": -0.1}, "initial.n"),
        ({"l": -0.1}, "initial.l"),
        ({"L": 0.0}, "initial.L"),
        ({"L": -1.0}, "initial.L"),
        ({"n": "0.5 + x"}, "initial.n"),
        ({"n": "0.5 - x"}, "initial.n"),
        ({"l": "0.25 - x*(1-x)*1.001"}, "initial.l"),
        ({"l": "log(x)"}, "initial.l"),
        ({"n": lambda x: 2 * x}, "initial.n"),
        ({"n": {"at": [0, 1], "values": [0, 1.1]}}, "initial.n"),
    ],
)
def test_initial_states_refused(values: dict[str, Any], path: str) -> None:
    with pytest.raises(ParameterError) as caught:
        check(PlaqueParameters(), PlaqueInitial(**values))
    assert caught.value.path == path


def test_message_gives_the_worst_position() -> None:
    with pytest.raises(ParameterError, match=r"initial\.n: n is 1\.5 at x = 2 \(xi = 1\); it must stay from 0 to 1 everywhere"):
        check(PlaqueParameters(), PlaqueInitial(n="0.5 + xi", L=2.0))


def test_callable_follows_a_changed_width() -> None:
    initial = PlaqueInitial(n=lambda xi: xi, L=2.0)
    assert initial.n(x=np.array([1.0]), xi=np.array([0.5]))[0] == 0.5
    assert replace(initial, L=4.0).n(x=np.array([1.0]), xi=np.array([0.25]))[0] == 0.25
    assert PlaqueInitial(**to_table(initial)) == initial


def test_exponent_below_one_needs_modldl_everywhere() -> None:
    low = PlaqueParameters(k=0.5)
    check(low, PlaqueInitial(l=0.1))
    check(PlaqueParameters(k=1.0), PlaqueInitial(l=0.0))
    with pytest.raises(ParameterError, match=r"parameters\.k: 0\.5 cannot be used because l = 0 at x = 1 "):
        check(low, PlaqueInitial(l="1 - x"))


def test_drag_with_negative_diffusivity() -> None:
    inviscid = {"momentum": "drag", "mu_n": 0.0, "mu_m": 0.0}
    sick = PlaqueInitial(n="0.9 - 0.6*xi", l=1.0)
    with pytest.raises(ParameterError) as caught:
        check(PlaqueParameters(**inviscid), sick)
    assert caught.value.path == "parameters.momentum"
    # Sigma = 0.1/(1 + 1) and 1 - 2n = 0.4 at x = 1
    for words in ("it is -0.02 at x = 1 ", "n = 0.3", "mu_n or mu_m above 0", "p_out to A = 0.1", "interfacial"):
        assert words in str(caught.value)
    check(PlaqueParameters(**inviscid, p_out=0.1), sick)
    check(PlaqueParameters(**inviscid | {"mu_m": 1e-9}), sick)
    check(PlaqueParameters(**inviscid | {"momentum": "interfacial"}), sick)
    check(PlaqueParameters(**inviscid), PlaqueInitial(n=0.5))
    check(PlaqueParameters(**inviscid, A=0.0), sick)


def test_geometry() -> None:
    assert PlaqueGeometry().kind == "slab"
    assert not PlaqueGeometry().annulus
    assert PlaqueGeometry(kind="annulus", lumen_radius=3.0).annulus
    for values, path, words in (
        ({"kind": "anulus"}, "kind", "annulus"),
        ({"kind": 3}, "kind", "3"),
        ({"kind": "annulus"}, "lumen_radius", "needs the radius of its lumen"),
        ({"kind": "annulus", "lumen_radius": 0.0}, "lumen_radius", "greater than 0"),
        ({"lumen_radius": 2.0}, "lumen_radius", "no meaning in a slab"),
    ):
        with pytest.raises(ParameterError, match=words) as caught:
            PlaqueGeometry(**values)
        assert caught.value.path == f"geometry.{path}"


def test_the_size_of_an_annulus_and_its_width_are_inverse() -> None:
    for R_1 in (0.5, 1e4, 1e9):
        geometry = PlaqueGeometry(kind="annulus", lumen_radius=R_1)
        for L in (1e-3, 1.0, 7.0):
            exact = ((Fraction(R_1) + Fraction(L)) ** 2 - Fraction(R_1) ** 2) / 2  # in floats the difference of squares cancels
            assert geometry.size(L) == pytest.approx(float(exact), rel=4e-16)
            assert geometry.width(geometry.size(L)) == pytest.approx(L, rel=4e-16)
            assert geometry.position(1.0, geometry.size(L)) == pytest.approx(L, rel=4e-16)


def test_fipy_refuses_what_it_does_not_have() -> None:
    round_wall = PlaqueGeometry(kind="annulus", lumen_radius=3.0)
    drag = PlaqueParameters(momentum="drag", p_out=1.0)
    with pytest.raises(ParameterError, match="no drag form in the annulus"):
        simulate(drag, t_end=1.0, geometry=round_wall, solver="fipy")
    with pytest.raises(ParameterError, match="are for the slab"):
        simulate(t_end=1.0, geometry=round_wall, extra_terms=lambda plaque: {})
    with pytest.raises(ParameterError, match="takes no extra_terms"):
        simulate(t_end=1.0, solver="lines", extra_terms=lambda plaque: {})
    with pytest.raises(ParameterError, match="lines"):
        simulate(t_end=1.0, solver="fipy", time_scheme="radau")


def test_solver() -> None:
    assert to_table(PlaqueSolver()) == {"method": "auto", "cells": 100, "rtol": 1e-4, "time_scheme": "auto", "max_steps": 100_000}
    PlaqueSolver(cells=4, rtol=0.1, dt=1e-9, max_steps=1, method="fipy", time_scheme="backward-euler")
    for name, value in [
        ("cells", 3), ("cells", 4.5), ("rtol", 0.0), ("rtol", 0.11), ("dt", 0.0), ("max_steps", 0), ("method", "line"),
        ("time_scheme", "bdf3"),
    ]:  # fmt: skip
        with pytest.raises(ParameterError) as caught:
            PlaqueSolver(**{name: value})
        assert caught.value.path == f"solver.{name}"


@pytest.mark.parametrize(
    ("name", "preset", "end"),
    [
        ("plaque", "demo", 40.0),
        ("plaque-mouse", "mouse", 1.7e4),
        ("plaque-human", "human", 3.4e5),
        ("plaque-drag", "demo", 40.0),
        ("plaque-annulus", "demo", 40.0),
    ],
)
def test_shipped_scene_files(name: str, preset: str, end: float) -> None:
    tables = tomllib.loads((files("plaque1d.scenes") / f"{name}.toml").read_text(encoding="utf-8"))
    assert tables["scene"]["model"] == "plaque"
    assert len(tables["scene"]["title"]) > 10
    given = dict(tables["parameters"])
    assert given.pop("preset") == preset
    assert tables["time"]["end"] == end
    parameters = PlaqueParameters(**{**PRESETS[preset].parameters, **given})
    check(parameters, PlaqueInitial(**{**PRESETS[preset].initial, **tables.get("initial", {})}))
    assert (parameters.momentum == "drag") == (name == "plaque-drag")
    assert parameters.p_out == (2 * parameters.A if name == "plaque-drag" else 0.0)
    geometry = PlaqueGeometry(**tables.get("geometry", {}))
    assert geometry == (PlaqueGeometry(kind="annulus", lumen_radius=5.0) if name == "plaque-annulus" else PlaqueGeometry())


def test_commented_values_of_the_demo_scene_are_the_presets() -> None:
    """What the file says in its comments must stay true."""
    text = (files("plaque1d.scenes") / "plaque.toml").read_text(encoding="utf-8")
    section = text[text.index("[parameters]") : text.index("[initial]")]
    lines = [line[2:].split(" #")[0] for line in section.splitlines() if line.startswith("# ")]
    said = tomllib.loads("\n".join(lines))
    assert said == to_table(PlaqueParameters())
