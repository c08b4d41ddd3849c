"""Transport on the moving grid: slopes and floors one by one, and the geometric conservation law in both models' compiled rates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from multiphase import transport
from multiphase.stepping import formula
from plaque1d import PlaqueInitial, PlaqueParameters
from plaque1d.lines_scheme import LinesScheme
from plaque1d.parameters import PlaqueGeometry
from plaque1d.semidiscrete import KERNEL
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import VISCOUS, ViscousLines
from tumour.solver import TumourSolver

CELLS = 12
KINDS = {1: "slab", 2: "disk", 3: "sphere"}


def differences(function: Callable[..., tuple[float, ...]], *at: float, step: float = 1e-6) -> np.ndarray:
    """Central differences of the first value with respect to each argument."""
    found = []
    for k in range(len(at)):
        up, down = list(at), list(at)
        up[k] += step
        down[k] -= step
        found.append((function(*up)[0] - function(*down)[0]) / (up[k] - down[k]))
    return np.array(found)


@pytest.mark.parametrize(
    ("back", "ahead", "value"),
    [
        (0.2, 0.4, 0.3),  # the mean, which neither difference bounds
        (-0.2, -0.4, -0.3),
        (0.1, 0.9, 0.2),  # twice the smaller one
        (0.9, 0.1, 0.2),
        (-0.9, -0.1, -0.2),
        (0.3, -0.1, 0.0),  # an extremum
        (0.0, 0.5, 0.0),
        (0.0, 0.0, 0.0),
    ],
)
def test_limited_values(back: float, ahead: float, value: float) -> None:
    assert transport.limited(back, ahead)[0] == pytest.approx(value, rel=1e-15)
    assert transport.limited(ahead, back)[0] == transport.limited(back, ahead)[0]
    assert transport.limited(-back, -ahead)[0] == -transport.limited(back, ahead)[0]


def test_derivatives_of_limited() -> None:
    """Piecewise linear, so differences are exact but for rounding, 1e-16/1e-6."""
    for back, ahead in np.random.default_rng(1).uniform(-1.0, 1.0, (200, 2)):
        np.testing.assert_allclose(transport.limited(back, ahead)[1:], differences(transport.limited, back, ahead), atol=1e-9)


H = 1.0 / 40.0
SCALE = transport.SMOOTH * H * H  # 0.0125: below it nothing is limited, above its double all is


def of_three(before: float, n: float, after: float) -> tuple[float, float, float, float]:
    return transport.slope(n - before, after - n, n, H)


def test_smooth_extrema_keep_their_central_slope() -> None:
    """Differences of a parabola with a curvature of 2 SMOOTH are at most SMOOTH h^2 about its top, wherever that lies in the cell."""
    for shift in (-0.49, -0.2, 0.0, 0.3):
        x = H * (np.arange(3) - 1.0 + shift)
        before, n, after = 0.6 - 0.49 * transport.SMOOTH * x**2
        assert max(abs(n - before), abs(after - n)) < SCALE
        assert of_three(before, n, after)[0] == pytest.approx(0.5 * (after - before), abs=1e-16)
    # the same shape, but four times as high, is limited to nothing
    assert of_three(0.6 - 4 * SCALE, 0.6, 0.6 - 2.5 * SCALE)[0] == 0.0


def test_where_a_phase_is_nearly_absent_everything_is_limited() -> None:
    for n in (1.5 * SCALE, 1.0 - 1.5 * SCALE):
        assert of_three(n - 0.5 * SCALE, n, n - 0.2 * SCALE)[0] == 0.0
    assert of_three(0.5 - 0.5 * SCALE, 0.5, 0.5 - 0.2 * SCALE)[0] == pytest.approx(0.15 * SCALE, rel=1e-12)


def test_derivatives_of_slope_in_every_regime() -> None:
    """Central, limited, and in between, where the passage is a cubic of the larger difference over SCALE: 1e-12 times third derivatives
    of 12/SCALE^2, and 1e-16/1e-6 of rounding."""
    rng, between = np.random.default_rng(2), 0
    for _ in range(400):
        n = rng.uniform(0.1, 0.9)
        before, after = n + rng.uniform(-3.0, 3.0, 2) * SCALE
        found = of_three(before, n, after)
        np.testing.assert_allclose(found[1:], differences(of_three, before, n, after), atol=1e-6)
        assert sum(found[1:]) == pytest.approx(0.0, abs=1e-12)  # a constant has no slope
        between += found[0] not in (transport.limited(n - before, after - n)[0], 0.5 * (after - before))
    assert between > 50  # a quarter of the square of differences


def test_slopes_of_linear_data_are_exact() -> None:
    for rise in (1e-3, 0.02, -0.05):
        assert of_three(0.5 - rise, 0.5, 0.5 + rise)[0] == pytest.approx(rise, rel=1e-13)
        assert transport.open_slope(0.5 + rise, 0.5)[0] == pytest.approx(rise, rel=1e-13)


def test_the_slope_at_a_centre_is_that_of_an_even_parabola() -> None:
    """n = a + b x^2 has cell averages a + b h^2/3 and a + 7 b h^2/3; the slope puts its value a + b h^2 half way between, as its mean
    does to second order, and an even function of r has the same values on a face from both sides to that order."""
    for b in (-3.0, 2.0):
        averages = [0.5 + b * H * H * k for k in (1.0 / 3.0, 7.0 / 3.0)]
        slope = transport.symmetric_slope(*averages)[0]
        assert slope == pytest.approx(b * H * H, rel=1e-12)  # the derivative 2 b x at the middle of the cell, times h
        assert abs(averages[0] + 0.5 * slope - (0.5 + b * H * H)) < abs(b) * H * H


@pytest.mark.parametrize("function", [transport.symmetric_slope, transport.open_slope])
def test_end_cells_send_out_no_more_than_they_have(function: Any) -> None:
    rng, bounded = np.random.default_rng(3), 0
    for n, other in rng.uniform(0.0, 1.0, (400, 2)):
        value, own, beside = function(n, other)
        face = n + 0.5 * value if function is transport.symmetric_slope else n - 0.5 * value
        assert -1e-15 <= face <= min(1.0, 2.0 * n) + 1e-15  # rounding
        assert 1.0 - face <= 2.0 * (1.0 - n) + 1e-15
        np.testing.assert_allclose((own, beside), differences(function, n, other), atol=1e-9)  # piecewise linear
        plain = 0.5 * (other - n) if function is transport.symmetric_slope else n - other
        bounded += value != plain
    assert bounded > 20


def test_face_values_stay_within_zero_and_one() -> None:
    rng = np.random.default_rng(4)
    for before, n, after in rng.uniform(0.0, 1.0, (2000, 3)):
        for h in (0.25, 0.05, 0.005):
            value = transport.slope(n - before, after - n, n, h)[0]
            assert min(n - 0.5 * value, n + 0.5 * value) >= -1e-15  # rounding
            assert max(n - 0.5 * value, n + 0.5 * value) <= 1.0 + 1e-15


@pytest.mark.parametrize("gain", [0.0, 0.3, -0.7])
def test_end_slope_values(gain: float) -> None:
    most = 2.0 * abs(gain)
    for sign in (1.0, -1.0):
        assert transport.end_slope(sign * (0.99 * most), 1.0, -1.0, gain) == (sign * (0.99 * most), 1.0, -1.0)
        value, own, beside = transport.end_slope(sign * (1.01 * most + 1e-3), 1.0, -1.0, gain)
        assert (value, beside) == (sign * most, 0.0)
        assert own == sign * (2.0 if gain >= 0.0 else -2.0)  # gain is n, or n - 1


def test_the_floor() -> None:
    delta = 1e-3
    assert transport.floored(0.0, delta) == delta
    assert transport.floored(-10.0, delta) == pytest.approx(1e-7, rel=1e-6)  # delta^2/|x|
    assert transport.floored(0.5, delta) - 0.5 == pytest.approx(delta**2 / 0.5, rel=1e-5)
    x = np.linspace(-0.01, 0.01, 101)
    assert np.all(transport.floored(x, delta) > 0.0)
    numeric = (transport.floored(x + 1e-6, delta) - transport.floored(x - 1e-6, delta)) / 2e-6
    np.testing.assert_allclose(transport.floored_slope(x, delta), numeric, atol=1e-6)  # 1e-12 times a third derivative of 1/delta^2


RNG = np.random.default_rng(3)
HISTORIES = {
    "steady growth, equal steps": (np.linspace(0.0, 1.0, 9), 0.5 + np.linspace(0.0, 1.0, 9)),
    "uneven steps, up and down": (np.cumsum(RNG.uniform(0.02, 0.04, 9)), RNG.uniform(0.6, 0.9, 9)),
}


class Plaque:
    """Transport of n in the slab, by the rates of the method of lines without reactions."""

    def __init__(self) -> None:
        values = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 0.0, "k_m": 0.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
        self.scheme = LinesScheme(PlaqueParameters(**values), PlaqueInitial(n=0.37, l=0.2, L=0.5), PlaqueGeometry(kind="slab"), CELLS, 1e-4)
        self.shares = np.full(CELLS, 1.0 / CELLS)

    def size(self, length: float) -> float:
        return length

    def rates(self, amounts: np.ndarray, W: float, V: float, stretch: float) -> np.ndarray:
        """With u_n = stretch xi V, by the slip that gives it: u_n = V - c w."""
        s = self.scheme
        y, out = s.initial(), np.empty_like(s.initial())
        y[s.n], y[s.size], y[s.size + 1] = amounts, W, V
        c = 1.0 - amounts / W
        y[s.w] = (V - stretch * s.grid.faces[1:-1] * V) / (0.5 * (c[1:] + c[:-1]))
        KERNEL["rates"](s.data(0.0), 0.0, y, out, s.work.model)
        return out[s.n]


class Tumour:
    """Transport of alpha in the viscous body, by its rates without births and deaths."""

    def __init__(self, m: int) -> None:
        parameters = TumourParameters(s2=0.0, s3=0.0, C_out=0.0)
        geometry, solver = TumourGeometry(kind=KINDS[m], formulation="eulerian"), TumourSolver(cells=CELLS)
        self.m, self.scheme = m, ViscousLines(parameters, TumourInitial(alpha=0.37), geometry, solver)
        self.shares = np.diff(self.scheme.grid.faces**m)

    def size(self, length: float) -> float:
        return length**self.m / self.m

    def rates(self, amounts: np.ndarray, W: float, V: float, stretch: float) -> np.ndarray:
        """With u = stretch xi R', R' = V/R^(m-1)."""
        s, N, R = self.scheme, CELLS, (self.m * W) ** (1.0 / self.m)
        y, out = s.initial(), np.empty_like(s.initial())
        y[0 : 3 * N : 3], y[1 : 3 * N : 3] = amounts, 0.0
        y[2 : 3 * N : 3], y[3 * N], y[3 * N + 1] = stretch * s.grid.faces[1:] * V / R ** (self.m - 1), W, V
        VISCOUS["rates"](s.data(0.0), 0.0, y, out, s.work.model)
        return out[0 : 3 * N : 3]


MODELS: dict[str, Callable[[], Any]] = {
    "plaque": Plaque, "tumour, slab": lambda: Tumour(1), "tumour, disk": lambda: Tumour(2), "tumour, sphere": lambda: Tumour(3),
}  # fmt: skip


def carry(model: Any, times: np.ndarray, lengths: np.ndarray, stretch: float, error: float = 0.0) -> np.ndarray:
    """Carry a uniform fraction with BDF2 steps on a body of the given lengths; the fraction at the end. Where the material does not move
    with the outer face, the flux through that is let in. `error` is that of the speed V relative to the time formula's."""
    W = model.size(lengths[0])
    history_t, history_u = [times[0]], [np.append(np.full(CELLS, 0.37 * W), W)]
    for t, length in zip(times[1:], lengths[1:], strict=True):
        rate, past = formula(2, t, np.array(history_t), np.array(history_u))
        W = model.size(length)
        V = (1.0 + error) * rate * (W - past[-1])  # the time formula's own derivative of W

        def residual(amounts: np.ndarray, W: float = W, V: float = V, rate: float = rate, past: np.ndarray = past) -> np.ndarray:
            f = model.rates(amounts, W, V, stretch)
            f[-1] += (1.0 - stretch) * V * 0.37 / model.shares[-1]
            return rate * (amounts - past[:-1]) - f

        amounts = history_u[0][:-1].copy()
        for _ in range(4):  # the rates are linear but for the limiter, which the uniform has no use for
            f = residual(amounts)
            matrix = np.array([residual(amounts + 1e-6 * row) - f for row in np.eye(CELLS)]).T / 1e-6
            amounts = amounts - np.linalg.solve(matrix, f)
        history_t, history_u = [t, *history_t[:1]], [np.append(amounts, W), *history_u[:1]]
    return history_u[0][:-1] / history_u[0][-1]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("case", HISTORIES)
def test_uniform_stays_uniform_when_the_material_stands_still(name: str, case: str) -> None:
    times, lengths = HISTORIES[case]
    n = carry(MODELS[name](), times, lengths, stretch=0.0)
    # rounding of eight steps, each a difference of terms of order V n over a share of 1/12 (1/12^3 at the centre of the sphere)
    np.testing.assert_allclose(n, 0.37, rtol=1e-12)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("case", HISTORIES)
def test_uniform_dilutes_as_one_over_the_size_when_the_material_stretches(name: str, case: str) -> None:
    """As 1/L in the plaque, as 1/R^m in the tumour."""
    times, lengths = HISTORIES[case]
    model = MODELS[name]()
    n = carry(model, times, lengths, stretch=1.0)
    np.testing.assert_allclose(n, 0.37 * model.size(lengths[0]) / model.size(lengths[-1]), rtol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_a_wrong_wall_speed_is_seen(name: str) -> None:
    times, lengths = HISTORIES["steady growth, equal steps"]
    n = carry(MODELS[name](), times, lengths, stretch=0.0, error=0.01)
    assert np.max(np.abs(n / 0.37 - 1.0)) > 1e-3
