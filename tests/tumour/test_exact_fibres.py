"""The exact solutions with fibres and with parts of the surface, against the equations they solve and against each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from multiphase.errors import ParameterError
from tumour import equations as eq
from tumour import exact, exact_fibres, exact_parts, exact_tissue
from tumour.parameters import TumourParameters

SLOW = {"s1": 0.0, "s2": 0.0, "s3": 0.0, "Q": 0.0, "C_out": 1e-3}
G = 20.0
"""gamma alpha_star/(1 - alpha_star)^2 of the default values."""
S = 1e-3 * 0.8 * 0.2
"""The source of `SLOW`."""


def slow(**changes: Any) -> TumourParameters:
    return TumourParameters(**{**SLOW, **changes})


# -- slow growth ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rho", [0.0, 0.4, 1.0, 3.0])
def test_strains_where_fluid_flows_freely(rho: float) -> None:
    """The closed forms, at a place along the fibres and one across them."""
    growth = exact_fibres.FibreGrowth(slow(kappa=0.0, mu_alpha=1.3, lambda_alpha=0.7, fibre_ratio=rho, fibre_angle=0.4))
    a = np.array([np.cos(0.4), np.sin(0.4)])
    b, t = np.array([-a[1], a[0]]), 5.0
    along, across = a @ growth.displacement(*a, t), b @ growth.displacement(*b, t)
    gain = growth.fraction_change(0.3, 0.2, t)
    assert gain == pytest.approx(S * t - 0.8 * (along + across), rel=1e-13)
    assert along + across == pytest.approx((1.0 + rho) * G * gain / (2.0 * (1.3 + 0.7)), rel=1e-13)
    assert along - across == pytest.approx((rho - 1.0) * G * gain / (2.0 * 1.3), rel=1e-13, abs=1e-18)
    assert b @ growth.displacement(*a, t) == pytest.approx(0.0, abs=1e-18)
    assert np.all(growth.pressure(0.3, 0.2, t) == 0.0)


def test_strains_with_stiff_fibres_and_stiff_tissue() -> None:
    of = {"fibre_ratio": 2.0, "fibre_stiffness": 0.9, "stiffness": 1.5, "lambda_alpha": 0.5}
    growth = exact_fibres.FibreGrowth(slow(kappa=0.0, **of))
    (along, _), (_, across) = growth.displacement(1.0, 0.0, 1.0), growth.displacement(0.0, 1.0, 1.0)
    gain = growth.fraction_change(0.0, 0.0, 1.0)
    assert (2.0 * 1.5 + 4.0 * 0.9) * along + 0.75 * (along + across) == pytest.approx(2.0 * G * gain, rel=1e-13)
    assert 2.0 * 1.5 * across + 0.75 * (along + across) == pytest.approx(G * gain, rel=1e-13)


TISSUES: dict[str, dict[str, Any]] = {
    "push along": {"fibre_ratio": 3.0},
    "push across, turned": {"fibre_ratio": 0.2, "fibre_angle": 0.7},
    "stiff fibres": {"fibre_ratio": 1.8, "fibre_stiffness": 0.6, "fibre_angle": -0.3, "stiffness": 1.4},
    "tensor": {"fibre_ratio": 2.0, "fibre_angle": 0.5, "permeability": {"xx": 2.0, "yy": 0.7, "xy": 0.4}},
}
TURNED = pytest.mark.parametrize("tissue", TISSUES)


def slope(f: Any, x: np.ndarray, h: float = 0.1) -> np.ndarray:
    """[..., i]: derivatives of f at points (2, ...) along x_i, exact for polynomials of degree four."""
    steps = [np.eye(2)[i].reshape(2, *np.ones(np.ndim(x) - 1, dtype=int)) * h for i in range(2)]
    return np.stack([(8.0 * (f(x + s) - f(x - s)) - (f(x + 2 * s) - f(x - 2 * s))) / (12.0 * h) for s in steps], axis=-1)


@TURNED
def test_late_growth_solves_the_equations(tissue: str) -> None:
    """Equilibrium in the body and on the circle, and the flow of fluid; all of it polynomials, so to rounding of numbers up to 1e-2."""
    p, R, t = slow(mu_alpha=1.2, lambda_alpha=0.5, kappa=1.7, **TISSUES[tissue]), 1.3, 0.8
    growth, of = exact_fibres.FibreGrowth(p, R), exact_tissue.UniformTissue(p)
    a, push = np.outer(of.direction, of.direction), (of.rho - 1.0) * G
    rng = np.random.default_rng(1)
    r, angle = R * np.sqrt(rng.uniform(size=40)), rng.uniform(0.0, 2.0 * np.pi, 40)
    inside, circle = r * np.array([np.cos(angle), np.sin(angle)]), R * np.array([np.cos(angle), np.sin(angle)])

    def sigma(x: np.ndarray) -> np.ndarray:
        gradient = np.moveaxis(slope(lambda at: growth.displacement(*at, t), x), -1, 1)  # d_i,j
        strain = 0.5 * (gradient + np.swapaxes(gradient, 0, 1))
        e, gain = strain[0, 0] + strain[1, 1], S * t - 0.8 * (strain[0, 0] + strain[1, 1])
        np.testing.assert_allclose(growth.dilation(*x, t), e, atol=1e-15)
        np.testing.assert_allclose(growth.fraction_change(*x, t), gain, atol=1e-15)
        own = 4.0 * of.k_f * np.einsum("ij,ij...->...", a, strain) - push * gain
        return (
            2.0 * of.mu * strain
            + np.eye(2)[:, :, None] * (of.lam * e - growth.pressure(*x, t) - G * gain)
            + a[:, :, None] * own
        )  # fmt: skip

    size = np.abs(sigma(inside)).max()
    assert size > 1e-5
    force = np.einsum("ij...j->i...", slope(sigma, inside))
    np.testing.assert_allclose(force, 0.0, atol=1e-10 * size)
    np.testing.assert_allclose(np.einsum("ij...,j...->i...", sigma(circle), circle), 0.0, atol=1e-10 * size)
    np.testing.assert_allclose(growth.pressure(*circle, t), 0.0, atol=1e-18)
    flow = slope(lambda at: np.einsum("ij,...j->i...", of.permeability, slope(lambda x: growth.pressure(*x, t), at)), inside)
    M = float(eq.mobility(0.8, *p.flow))
    rate = (growth.dilation(*inside, t + 1.0) - growth.dilation(*inside, t)) / 1.0
    np.testing.assert_allclose(M * np.einsum("i...i->...", flow), rate, rtol=1e-9)


def test_late_growth_without_fibres_is_late_swelling() -> None:
    p = slow(kappa=2.0, mu_alpha=1.3, lambda_alpha=0.4)
    growth, swelling = exact_fibres.FibreGrowth(p, 1.5), exact.LinearSwelling(p, 2, 1.5)
    x, y, t = np.array([0.3, -0.8, 1.2]), np.array([0.1, 0.9, -0.9]), 5.0  # exp(-c k^2 t), c of 5 and more
    r = np.hypot(x, y)
    np.testing.assert_allclose(growth.displacement(x, y, t), np.array([x, y]) / r * swelling.displacement(r, t), rtol=1e-10)
    np.testing.assert_allclose(growth.pressure(x, y, t), swelling.pressure(r, t), rtol=1e-9, atol=1e-16)


def test_growth_turns_with_the_fibres() -> None:
    """And does not see their sense."""
    plain, turned, back = (
        exact_fibres.FibreGrowth(slow(fibre_ratio=2.5, fibre_stiffness=0.3, fibre_angle=angle)) for angle in (0.0, 0.6, 0.6 + np.pi)
    )
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    x = np.random.default_rng(2).uniform(-0.7, 0.7, (2, 9))
    np.testing.assert_allclose(turned.displacement(*(turn @ x), 0.3), turn @ plain.displacement(*x, 0.3), rtol=1e-12)
    np.testing.assert_allclose(back.displacement(*x, 0.3), turned.displacement(*x, 0.3), rtol=1e-12)


# -- uniform growth ------------------------------------------------------------------------------------------------------


def stress(F: np.ndarray, contact: float, of: Any) -> np.ndarray:
    """The first Piola-Kirchhoff stress, from the Cauchy stress and the fibres' energy."""
    J, F_inv_T, b = np.linalg.det(F), np.linalg.inv(F).T, F @ of.direction
    a = b / np.linalg.norm(b)
    active = -contact * (np.eye(2) + (of.rho - 1.0) * np.outer(a, a))
    reinforcing = 2.0 * of.k_f * (b @ b - 1.0) * np.outer(b, of.direction)
    return of.mu * (F - F_inv_T) + of.lam * J * (J - 1.0) * F_inv_T + J * active @ F_inv_T + reinforcing


FREE = {"kappa": 0.0, "Q": 0.0}


@pytest.mark.parametrize(
    "tissue",
    [{"fibre_ratio": 2.0}, {"fibre_ratio": 0.3, "lambda_alpha": 0.6}, {"fibre_ratio": 3.0, "fibre_stiffness": 0.4, "stiffness": 1.6}],
)
def test_uniform_growth_is_in_equilibrium_and_keeps_its_cells(tissue: dict[str, Any]) -> None:
    p = TumourParameters(**FREE, fibre_angle=0.8, **tissue)
    of = exact_tissue.UniformTissue(p)
    t = np.array([0.0, 1.0, 4.0])
    along, across, alpha = exact_fibres.uniform_fibre_growth(t, p)
    axes = np.column_stack([of.direction, [-of.direction[1], of.direction[0]]])
    for l, k, fraction in zip(along, across, alpha, strict=True):
        contact = float(eq.contact_pressure(fraction, *p.contact))
        assert np.abs(stress(axes @ np.diag([l, k]) @ axes.T, contact, of)).max() < 1e-12
    assert (along[-1] > across[-1]) == (of.rho > 1.0)
    assert max(along[-1], across[-1]) > 1.2

    def growth(at: float) -> float:
        l, k, fraction = exact_fibres.uniform_fibre_growth(at, p)
        return float(l * k * eq.net_growth(float(fraction), 1.0, *p.kinetics))

    gained = quad(growth, 0.0, 1.0, epsabs=1e-10, epsrel=1e-10)[0]
    assert alpha[1] * along[1] * across[1] == pytest.approx(0.8 + gained, rel=1e-9)


def test_uniform_growth_without_fibres_is_that_of_a_disk() -> None:
    """Also where cells are packed at first, and with a stiffness that is one of the moduli."""
    t = [10.0, 0.0, 3.0]
    for alpha_0 in (0.8, 0.9):
        plain = TumourParameters(**FREE, mu_alpha=1.5, lambda_alpha=0.6)
        J, fraction = exact.uniform_growth(t, plain, 2, alpha_0)
        for p in (plain, TumourParameters(**FREE, mu_alpha=3.0, lambda_alpha=1.2, stiffness=0.5)):
            along, across, alpha = exact_fibres.uniform_fibre_growth(t, p, alpha_0)
            np.testing.assert_allclose(along * across, J, rtol=1e-9)
            np.testing.assert_allclose(along, across, rtol=1e-12)
            np.testing.assert_allclose(alpha, fraction, rtol=1e-9)


def test_slow_uniform_growth_is_the_linear_one() -> None:
    """To the second order in eps t, here 1e-6 of it."""
    of = {"fibre_ratio": 2.2, "fibre_stiffness": 0.5, "lambda_alpha": 0.3, "kappa": 0.0}
    p = TumourParameters(**{**SLOW, "C_out": 1e-7}, **of)
    along, across, alpha = exact_fibres.uniform_fibre_growth(1.0, p)
    growth = exact_fibres.FibreGrowth(p)
    assert along - 1.0 == pytest.approx(growth.displacement(1.0, 0.0, 1.0)[0], rel=1e-5)
    assert across - 1.0 == pytest.approx(growth.displacement(0.0, 1.0, 1.0)[1], rel=1e-5)
    assert alpha - 0.8 == pytest.approx(growth.fraction_change(0.0, 0.0, 1.0), rel=1e-5)


def test_the_stiffness_against_sliding_is_that_of_the_stress() -> None:
    """By a difference of step 1e-6, its square; a body that grows freely keeps m mu l_2^2/l_1^2 of it, a confined one loses it."""
    p = TumourParameters(**FREE, fibre_ratio=2.5, fibre_stiffness=0.6, stiffness=1.4, lambda_alpha=0.5)
    of, h = exact_tissue.UniformTissue(p), 1e-6
    for along, across, contact in ((1.3, 1.1, 0.4), (0.8, 1.2, 0.9)):
        F = np.diag([along, across])
        step = h * np.array([[0.0, 0.0], [1.0, 0.0]])  # across the fibres, from layer to layer along them
        slope = (stress(F + step, contact, of) - stress(F - step, contact, of))[1, 0] / (2.0 * h)
        assert exact_tissue.shear_stiffness(of, along, across, contact) == pytest.approx(slope, abs=1e-8)
    l, k, alpha = (float(value) for value in exact_fibres.uniform_fibre_growth(5.0, p))
    contact = float(eq.contact_pressure(alpha, *p.contact))
    assert exact_tissue.shear_stiffness(of, l, k, contact) == pytest.approx(1.4 * k**2 / l**2, rel=1e-9)
    assert exact_tissue.shear_stiffness(of, 1.0, 1.0, 1.0) < 0.0


# -- strips and pressure -------------------------------------------------------------------------------------------------


def test_oxygen_in_a_strip_solves_its_equation() -> None:
    """In the strip as it is, stretched to l = 1.3."""
    p = TumourParameters(Q=2.0, C_out=0.9, consumption=1.5, diffusivity={"xx": 0.6, "yy": 3.0})
    L, l, alpha, h = 2.0, 1.3, 0.7, 1e-3
    x = np.linspace(0.1, 1.9, 7)
    cases: list[dict[str, Any]] = [{}, {"membrane": 0.8}, {"influx": 0.3}]
    for case in cases:

        def C(at: Any, case: dict[str, Any] = case) -> Any:
            return exact_parts.strip_oxygen(at, L, alpha, p, stretch=l, **case)

        curvature = (C(x + h) - 2.0 * C(x) + C(x - h)) / (l * h) ** 2
        np.testing.assert_allclose(0.6 * curvature, 1.5 * eq.oxygen_uptake(alpha, C(x), *p.uptake), rtol=1e-5)  # h^2 k^2/12
        flux = 0.6 * (C(L + h) - C(L - h)) / (2.0 * l * h)
        assert C(h) == pytest.approx(C(-h), rel=1e-13)
        if not case:
            assert C(L) == pytest.approx(0.9, rel=1e-14)
        else:
            assert flux == pytest.approx(case.get("influx", 0.8 * (0.9 - C(L))), rel=1e-5)


def test_a_pressed_strip_and_a_pressed_body_are_in_equilibrium() -> None:
    of = {"kappa": 0.0, "lambda_alpha": 0.5, "stiffness": 1.3}
    for angle in (0.0, 0.5 * np.pi):
        p = TumourParameters(**of, fibre_ratio=2.0, fibre_stiffness=0.4, fibre_angle=angle)
        l, alpha = exact_parts.pressed_strip(p, 0.78, traction=-0.3, load=0.4, spring=0.6, length=2.0)
        P = stress(np.diag([l, 1.0]), float(eq.contact_pressure(alpha, *p.contact)), exact_tissue.UniformTissue(p))
        assert l < 0.97
        assert alpha * l == pytest.approx(0.78, rel=1e-14)
        assert P[0, 0] == pytest.approx(-0.7 - 0.6 * (l - 1.0) * 2.0, rel=1e-12)
        np.testing.assert_allclose([P[0, 1], P[1, 0]], 0.0, atol=1e-15)
    p = TumourParameters(**of)
    l, alpha = exact_parts.pressed_body(p, 0.78, 0.9)
    P = stress(l * np.eye(2), float(eq.contact_pressure(alpha, *p.contact)), exact_tissue.UniformTissue(p))
    np.testing.assert_allclose(P, -0.9 * l * np.eye(2), atol=1e-13)
    assert alpha * l**2 == pytest.approx(0.78, rel=1e-14)


def test_what_is_no_exact_solution_is_refused() -> None:
    varying = slow(fibre_ratio="1 + x**2")
    for make in (exact_fibres.FibreGrowth, lambda p: exact_fibres.FibreGrowth(slow(permeability={"xx": "1 + x**2", "yy": 1.0}))):
        with pytest.raises(ParameterError, match="varies in space"):
            make(varying)
    with pytest.raises(ParameterError, match="must be 0 here"):
        exact_fibres.FibreGrowth(slow(p_out=0.1))
    with pytest.raises(ParameterError, match="at least alpha_star"):
        exact_fibres.uniform_fibre_growth(1.0, TumourParameters(**FREE), alpha_0=0.5)
    with pytest.raises(ParameterError, match="along x or y"):
        exact_parts.pressed_strip(TumourParameters(kappa=0.0, fibre_ratio=2.0, fibre_angle=0.3), 0.8)
    with pytest.raises(ParameterError, match="without fibres"):
        exact_parts.pressed_body(TumourParameters(kappa=0.0, fibre_ratio=2.0), 0.8, 1.0)
    with pytest.raises(ParameterError, match="kappa"):
        exact_parts.pressed_body(TumourParameters(), 0.8, 1.0)
    with pytest.raises(ParameterError, match="diffusivity"):
        exact_parts.strip_oxygen(0.0, 1.0, 0.8, TumourParameters(diffusivity={"xx": 1.0, "yy": 1.0, "xy": 0.2}))
