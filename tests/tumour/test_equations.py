"""The tumour's laws: every derivative by complex steps, the compiled copies, and what the laws must satisfy."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tumour import equations as eq
from tumour import laws

PAPER = (10.0, 0.5, 0.5, 10.0)
KINETICS = [PAPER, (10.0, 1.1, 2.2, 20.0), (0.0, 0.0, 0.0, 3.0), (2.0, 0.0, 0.7, 0.0)]
CONTACT = [(1.0, 0.8, 0.8, 0.0), (2.5, 0.6, 0.3, 0.0), (1.3, 0.5, 0.7, 0.3), (0.7, 0.8, 0.8, 0.9)]
MODULI = [(1.0, 0.0), (1.0, 1.0), (0.3, 2.0), (2.0, -0.4)]


def slope_of(function: Callable[[Any], Any], x: np.ndarray) -> np.ndarray:
    """Derivative by a complex step, which cancels nothing: exact to rounding."""
    return np.asarray(function(x + 1e-30j)).imag / 1e-30


def close(slope: Any, function: Callable[[Any], Any], x: np.ndarray) -> None:
    # a few roundings of terms of size up to 100 that may cancel, and up to 1e5, 0.02 away from a pole, where they do not
    np.testing.assert_allclose(slope, slope_of(function, x), rtol=2e-14, atol=1e-13)


@pytest.fixture
def points() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {"alpha": rng.uniform(0.02, 0.98, 60), "C": rng.uniform(0.0, 1.5, 60), "l_r": rng.uniform(0.3, 4.0, 60),
            "l_t": rng.uniform(0.3, 4.0, 60), "e_r": rng.normal(size=60), "e_t": rng.normal(size=60)}  # fmt: skip


@pytest.mark.parametrize("contact", CONTACT)
def test_slopes_of_contact(points: dict[str, np.ndarray], contact: tuple[float, ...]) -> None:
    alpha = points["alpha"]
    close(eq.contact_stress_slope(alpha, *contact), lambda a: eq.contact_stress(a, *contact), alpha)
    close(eq.contact_pressure_slope(alpha, *contact), lambda a: eq.contact_pressure(a, *contact), alpha)
    close(eq.contact_switch_slope(alpha, *contact[2:]), lambda a: eq.contact_switch(a, *contact[2:]), alpha)


@pytest.mark.parametrize("kinetics", KINETICS)
def test_slopes_of_kinetics(points: dict[str, np.ndarray], kinetics: tuple[float, ...]) -> None:
    alpha, C = points["alpha"], points["C"]
    slopes = eq.net_growth_slopes(alpha, C, *kinetics)
    close(slopes[0], lambda a: eq.net_growth(a, C, *kinetics), alpha)
    close(slopes[1], lambda c: eq.net_growth(alpha, c, *kinetics), C)
    for uptake in ((0.5, 0.0), (0.05, 10.0)):
        slopes = eq.oxygen_uptake_slopes(alpha, C, *uptake)
        close(slopes[0], lambda a, uptake=uptake: eq.oxygen_uptake(a, C, *uptake), alpha)
        close(slopes[1], lambda c, uptake=uptake: eq.oxygen_uptake(alpha, c, *uptake), C)


@pytest.mark.parametrize("law", eq.MOBILITIES.values(), ids=eq.MOBILITIES)
def test_mobility_and_resistance(points: dict[str, np.ndarray], law: int) -> None:
    alpha = points["alpha"]
    for kappa, floor in ((1.0, 0.0), (3.0, 0.01)):
        close(eq.mobility_slope(alpha, kappa, law, floor), lambda a, v=(kappa, law, floor): eq.mobility(a, *v), alpha)
        close(eq.resistance_slope(alpha, kappa, law, floor), lambda a, v=(kappa, law, floor): eq.resistance(a, *v), alpha)
        product = eq.mobility(alpha, kappa, law, floor) * eq.resistance(alpha, kappa, law, floor)
        np.testing.assert_allclose(product, 1.0, rtol=1e-15)
    for value in (eq.resistance(alpha, 0.0, law, 1e-4), eq.resistance_slope(alpha, 0.0, law, 1e-4)):
        assert np.array_equal(value, np.zeros_like(alpha))
    assert np.isfinite(eq.resistance(0.0, 1.0, law, 0.0))


def test_mobility_laws_by_hand() -> None:
    assert [eq.mobility(0.8, 2.0, law, 0.4) for law in (eq.DARCY, eq.PRINTED, eq.CONSTANT)] == pytest.approx([0.125, 0.5, 0.5], rel=1e-15)
    assert eq.mobility(0.8, 2.0, eq.PRINTED, 0.0) == pytest.approx(0.625, rel=1e-15)


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("moduli", MODULI)
def test_elastic_stress_is_the_slope_of_the_energy_and_has_these_slopes(
    points: dict[str, np.ndarray], m: int, moduli: tuple[float, float]
) -> None:
    l_r, l_t = points["l_r"], points["l_t"] if m > 1 else np.ones(60)
    radial, hoop = eq.elastic_stress(l_r, l_t, m, *moduli)
    close(radial, lambda l: eq.elastic_energy(l, l_t, m, *moduli), l_r)
    slopes = eq.elastic_stress_slopes(l_r, l_t, m, *moduli)
    for part in (0, 1):
        close(slopes[2 * part], lambda l, part=part: eq.elastic_stress(l, l_t, m, *moduli)[part], l_r)
        close(slopes[2 * part + 1], lambda l, part=part: eq.elastic_stress(l_r, l, m, *moduli)[part], l_t)
    if m > 1:
        close((m - 1) * hoop, lambda l: eq.elastic_energy(l_r, l, m, *moduli), l_t)
        # the moduli at rest: 2 mu + lambda along one direction, lambda across
        at_rest = eq.elastic_stress_slopes(1.0, 1.0, m, *moduli)
        assert at_rest[:2] == pytest.approx((2.0 * moduli[0] + moduli[1], (m - 1) * moduli[1]), rel=1e-15)
    # the tensor of the paper, mu (F - F^-T) + lambda J (J - 1) F^-T
    mu, lam = moduli
    F = np.diag([l_r[0], *[l_t[0]] * (m - 1)])
    J = np.linalg.det(F)
    P = mu * (F - np.linalg.inv(F).T) + lam * J * (J - 1.0) * np.linalg.inv(F).T
    np.testing.assert_allclose([radial[0], *[hoop[0]] * (m - 1)], np.diag(P), rtol=1e-13, atol=1e-14)
    assert eq.volume_ratio(l_r[0], l_t[0], m) == pytest.approx(J, rel=1e-14)
    assert eq.elastic_energy(1.0, 1.0, m, *moduli) == 0.0


@pytest.mark.parametrize("m", [1, 2, 3])
def test_viscous_stress(points: dict[str, np.ndarray], m: int) -> None:
    alpha, e_r, e_t = (points[name] for name in ("alpha", "e_r", "e_t"))
    slopes = eq.viscous_stress_slopes(alpha, e_r, e_t, m, 1.3, 0.4)
    for part in (0, 1):

        def stress(a: Any, r: Any, t: Any, part: int = part) -> Any:
            return eq.viscous_stress(a, r, t, m, 1.3, 0.4)[part]

        close(slopes[3 * part], lambda a, f=stress: f(a, e_r, e_t), alpha)
        close(slopes[3 * part + 1], lambda e, f=stress: f(alpha, e, e_t), e_r)
        close(slopes[3 * part + 2], lambda e, f=stress: f(alpha, e_r, e), e_t)
    e = np.diag([0.3, *[-0.7] * (m - 1)])
    tensor = 2.0 * 0.6 * 1.3 * e + 0.4 * 0.6 * np.trace(e) * np.eye(m)
    radial, hoop = eq.viscous_stress(0.6, 0.3, -0.7, m, 1.3, 0.4)
    np.testing.assert_allclose([radial, *[hoop] * (m - 1)], np.diag(tensor), rtol=1e-14)
    # uniform growth at this rate leaves no traction: contact and fluid pressure are carried by viscosity
    rate = eq.free_expansion_rate(0.9, 4.0, 0.3, m, 1.3, 0.4)
    assert eq.viscous_stress(0.9, rate, rate, m, 1.3, 0.4)[0] == pytest.approx(0.9 * 4.0 + 0.3, rel=1e-14)


def test_contact_begins_at_alpha_min() -> None:
    sharp = (2.0, 0.5, 0.6, 0.0)
    np.testing.assert_array_equal(eq.contact_stress(np.array([0.1, 0.55, np.nextafter(0.6, 0.0)]), *sharp), 0.0)
    assert eq.contact_stress(0.6, *sharp) == pytest.approx(2.0 * 0.1 / 0.16, rel=1e-14)
    assert eq.contact_stress(0.6, 2.0, 0.7, 0.6, 0.0) < 0.0  # between alpha_min and alpha_star cells attract
    right = (eq.contact_stress(0.6 + 1e-7, *sharp) - eq.contact_stress(0.6, *sharp)) / 1e-7
    assert eq.contact_stress_slope(0.6, *sharp) == pytest.approx(right, rel=1e-5)  # one-sided: 1e-7 times a second derivative
    wide = (2.0, 0.5, 0.6, 0.2)
    for alpha, share in ((0.5, 0.0), (0.55, 0.15625), (0.6, 0.5), (0.7, 1.0), (0.9, 1.0)):
        assert eq.contact_switch(alpha, *wide[2:]) == pytest.approx(share, abs=1e-14)
        assert eq.contact_stress(alpha, *wide) == pytest.approx(share * eq.contact_stress(alpha, 2.0, 0.5, 0.0, 0.0), abs=1e-13)
    for end in (0.5, 0.7):  # C^1: flat at both ends, where rounding moves alpha by 1e-16 of a slope that changes by 6/width^2
        assert eq.contact_switch_slope(end, *wide[2:]) == pytest.approx(0.0, abs=1e-12)


def test_homeostatic_values_of_the_paper() -> None:
    C = np.linspace(0.06, 2.0, 9)
    np.testing.assert_allclose(eq.homeostatic_fraction(C, *PAPER), 1.0 - (1.0 + 1.0 / C) / 22.0, rtol=1e-13)
    assert eq.net_growth(0.8, 1.0, *PAPER) == pytest.approx(0.8 * 6.0 / 55.0, rel=1e-14)
    assert eq.critical_oxygen(0.8, *PAPER) == pytest.approx(5.0 / 17.0, rel=1e-14)
    assert eq.critical_oxygen(0.0, *PAPER) == pytest.approx(1.0 / 21.0, rel=1e-14)
    assert eq.net_growth(0.7, 0.0, *PAPER) == pytest.approx(-0.5 * 0.7, rel=1e-15)


@pytest.mark.parametrize("kinetics", [*KINETICS[:2], (1.0, 0.2, 0.1, 0.0), (0.0, 0.1, 3.0, 100.0), (5.0, 0.0, 2.0, 9.0)])
def test_births_and_deaths_balance(kinetics: tuple[float, ...]) -> None:
    for alpha in (0.05, 0.3, 0.5, 0.7):
        C = eq.critical_oxygen(alpha, *kinetics)
        assert abs(eq.net_growth(alpha, C, *kinetics)) < 1e-15 * alpha * 10.0  # ten roundings of rates of order 1
        if C > 0.0:
            assert eq.homeostatic_fraction(C, *kinetics) == pytest.approx(alpha, rel=1e-12)
            assert eq.net_growth(alpha, 0.99 * C, *kinetics) < 0.0 < eq.net_growth(alpha, 1.01 * C, *kinetics)
            traces = np.linspace(0.0, 0.99 * C, 50)
            assert np.all(eq.net_growth(alpha, traces, *kinetics) <= 0.0)  # no lower zero


def test_critical_oxygen_where_growth_never_ends_or_never_begins() -> None:
    assert eq.critical_oxygen(0.5, 0.0, 0.0, 0.0, 0.0) == 0.0  # nothing dies
    assert eq.critical_oxygen(0.5, 1.0, 0.0, 0.5, 1.0) == 0.0
    for kinetics in ((1.0, 2.0, 0.0, 0.0), (10.0, 0.5, 5.0, 0.0), (2.0, 0.0, 5.0, 0.0)):
        assert np.isnan(eq.critical_oxygen(0.9, *kinetics))
        assert np.all(eq.net_growth(0.9, np.geomspace(1e-6, 1e6, 400), *kinetics) < 0.0)


def test_compiled_laws_are_all_there_and_agree(points: dict[str, np.ndarray]) -> None:
    values = {name: float(some[0]) for name, some in points.items()} | {
        "gamma": 1.3, "alpha_star": 0.5, "alpha_min": 0.1, "sigma_width": 0.2, "s1": 10.0, "s2": 1.1, "s3": 2.2, "s4": 20.0, "Q": 0.3,
        "Q1_hat": 2.0, "kappa": 1.7, "floor": 0.01, "mu": 1.1, "lam": 0.6, "stress": 2.0, "p_out": 0.1,
    }  # fmt: skip
    for name, plain in inspect.getmembers(eq, inspect.isfunction):
        if plain.__module__ != eq.__name__:
            continue
        wanted = list(inspect.signature(plain).parameters)
        for m, law in ((1, eq.DARCY), (2, eq.PRINTED), (3, eq.CONSTANT)) if {"m", "law"} & set(wanted) else ((1, eq.DARCY),):
            arguments = [(values | {"m": m, "law": law})[argument] for argument in wanted]
            # the compiler may fuse or reorder a few operations
            np.testing.assert_allclose(getattr(laws, name)(*arguments), plain(*arguments), rtol=1e-14, atol=1e-15)
            assert len(getattr(laws, name).signatures) == 1


def test_kinetics_below_0_go_on_along_their_tangents() -> None:
    """Value and slopes are continuous at C = 0, and there is no pole at C = -1/s1 or -1/s4."""
    alpha = np.array([0.3, 0.8])
    up, down = (np.array(eq.net_growth_slopes(alpha, C, *PAPER)) for C in (1e-12, -1e-12))
    np.testing.assert_allclose(up, down, atol=1e-9)  # second derivatives of some hundreds times 2e-12
    for C in (-0.05, -0.1, -0.7):
        linear = eq.net_growth(alpha, 0.0, *PAPER) + C * eq.net_growth_slopes(alpha, 0.0, *PAPER)[1]
        np.testing.assert_allclose(eq.net_growth(alpha, C, *PAPER), linear, rtol=1e-14)
        h = 1e-6
        by_C = (eq.net_growth(alpha, C + h, *PAPER) - eq.net_growth(alpha, C - h, *PAPER)) / (2.0 * h)
        np.testing.assert_allclose(eq.net_growth_slopes(alpha, C, *PAPER)[1], by_C, rtol=1e-8)  # rounding over h
