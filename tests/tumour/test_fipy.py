"""The viscous tumour in FiPy: the same equations as the compiled ones, their tangent, steps, balances, convergence and failures."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from multiphase import lines
from multiphase.fipy_newton import import_fipy
from multiphase.stepping import Control, StepFailure, integrate, start
from tumour import simulate
from tumour.fipy_scheme import FipyScheme
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import ViscousLines, ViscousRadau
from tumour.solver import TumourSolver

KINDS = {1: "slab", 2: "disk", 3: "sphere"}
SMOOTH: dict[str, Any] = {"alpha": 0.85, "radius": 4.0, "Q": 1.0, "alpha_min": 0.0}
"""A body with a hungry centre; cells are in contact at any fraction, so that no kink of the contact stress spoils an order."""


def _make(scheme: Any, m: int, cells: int, rtol: float = 1e-4, *, alpha: Any = 0.8, radius: float = 1.0, **changes: Any) -> Any:
    geometry = TumourGeometry(kind=KINDS[m], radius=radius, formulation="eulerian")
    initial = TumourInitial(alpha=alpha).within(radius)
    return scheme(TumourParameters(**changes), initial, geometry, TumourSolver(cells=cells, rtol=rtol))


def _rough(scheme: Any, seed: int) -> Any:
    """An admissible state that takes every branch of the limiter, from nearly no cells to nearly no fluid, and flows both ways."""
    rng = np.random.default_rng(seed)
    y, N = scheme.initial(), scheme.cells
    size = 3 * N
    y[size] *= rng.uniform(0.5, 2.0)
    y[0:size:3] = y[size] * rng.uniform(0.0, 0.97, N)
    y[1:size:3], y[2:size:3], y[size + 1] = rng.uniform(0.0, 1.0, N), rng.normal(size=N), rng.normal()
    return y


def _rates(scheme: Any, y: Any) -> Any:
    out = np.empty_like(y)
    scheme.kernel["rates"](scheme.constants, 0.0, y, out, scheme.work.model)
    return out


OPTIONS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "free fluid, swollen": {"kappa": 0.0, "p_out": 0.7, "lambda_alpha": -0.4},
    "printed mobility, saturated uptake": {"mobility": "printed", "mobility_floor": 0.3, "Q": 3.0, "Q1_hat": 4.0, "C_out": 0.9},
    "constant mobility, attraction, smooth switch": {"mobility": "constant", "alpha_min": 0.5, "sigma_width": 0.2, "lambda_alpha": 1.5},
    "hard cells in thick fluid": {"gamma": 50.0, "kappa": 20.0, "mu_alpha": 3.0, "p_out": -0.5},
}


@pytest.mark.parametrize("m", KINDS)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_fipy_assembles_the_same_equations(m: int, options: dict[str, Any]) -> None:
    """FiPy's own terms against the compiled rates, at rough states and a step from another one."""
    scheme, alpha = _make(FipyScheme, m, 13, radius=1.7, **options), 7.0
    size, balances = 39, slice(0, 39, 3)
    shares = np.diff(scheme.constants.s)
    for seed in (1, 2, 3):
        y, past = _rough(scheme, seed), _rough(scheme, 100 + seed)
        x = y[: size + 2]
        residual = scheme.residual(0.1, alpha, past, x)
        matrix, rates = abs(scheme.tangent(0.1, alpha, past, x)), _rates(scheme, y)
        expected = rates[: size + 2].copy()
        expected[balances] = shares * (alpha * (y[balances] - past[balances]) - rates[balances])
        expected[1:size:3] *= -1.0
        expected[size] = alpha * (y[size] - past[size]) - rates[size]
        terms = matrix @ np.abs(x) + np.abs(expected)
        terms[balances] += shares * alpha * np.abs(past[balances])
        # Some ten roundings of each row's own terms, 1e-15; the rest is for cells near alpha = 1, where 1 - alpha magnifies them.
        assert (np.abs(residual - expected) / terms).max() < 1e-13


@pytest.mark.parametrize("m", KINDS)
def test_the_tangent_is_the_derivative_of_fipys_residual(m: int) -> None:
    scheme, alpha = _make(FipyScheme, m, 6, p_out=0.3, Q1_hat=0.5), 3.0
    y, past = _rough(scheme, 5), _rough(scheme, 6)
    x = y[:20]
    scheme.residual(0.0, alpha, past, x)
    exact = scheme.tangent(0.0, alpha, past, x).toarray()
    numeric = np.empty_like(exact)
    for k in range(len(x)):
        step = np.zeros_like(x)
        step[k] = 1e-6
        numeric[:, k] = (scheme.residual(0.0, alpha, past, x + step) - scheme.residual(0.0, alpha, past, x - step)) / 2e-6
    # Row by row: rounding, 1e-15/1e-6 of the row's own terms, and third derivatives, up to (1 - alpha)^-5, times 1e-12.
    assert (np.abs(exact - numeric) / np.abs(exact).max(axis=1)[:, None]).max() < 1e-7


@pytest.mark.parametrize("m", KINDS)
def test_fipys_volumes_are_corrected(m: int) -> None:
    """FiPy's spherical cells are h^3/12 too small, a quarter of the first one; areas are exact, and so is what the scheme makes of both."""
    scheme = _make(FipyScheme, m, 8)
    fipy, mesh = import_fipy(), scheme._mesh
    made = {1: fipy.Grid1D, 2: fipy.CylindricalGrid1D, 3: fipy.SphericalGrid1D}[m](nx=8, dx=0.125)
    assert type(mesh) is type(made)
    volumes, exact = np.asarray(mesh.cellVolumes), np.diff((np.arange(9) / 8) ** m) / m
    missing = 0.125**3 / 12.0 if m == 3 else 0.0
    np.testing.assert_allclose(exact - volumes, missing, atol=1e-16)  # rounding of sizes below 1
    np.testing.assert_allclose(m * exact, scheme._exact * volumes, rtol=1e-14)
    np.testing.assert_allclose(np.asarray(mesh._faceAreas), (np.arange(9) / 8) ** (m - 1), rtol=1e-15)


@pytest.mark.parametrize("m", KINDS)
def test_fipy_and_lines_take_the_same_steps(m: int) -> None:
    """Newton's method meets the same iterates, so one step agrees beyond its own tolerance, and so does what follows."""
    control, ends = Control(), []
    for kind in (FipyScheme, ViscousLines):
        scheme = _make(kind, m, 16, 1e-3, p_out=0.2)
        one = integrate(scheme, start(scheme, 0.0, 0.1, control), [0.0, 1e-3], control)
        state = integrate(scheme, one, [1e-3, 1.0], control)
        ends.append((one, state))
    for fipy, compiled in zip(*ends, strict=True):
        assert fipy.counters == compiled.counters
        # Rounding 1e-16 times the condition of a step, 1e4 or so; Newton's own tolerance is 3e-6.
        np.testing.assert_allclose(fipy.u[0], compiled.u[0], rtol=1e-11, atol=1e-11)
    assert ends[0][0].counters["steps"] < 3


@pytest.mark.parametrize("m", KINDS)
@pytest.mark.parametrize("rtol", [1e-2, 1e-4])
def test_balances_close_to_rounding_whatever_the_tolerance(m: int, rtol: float) -> None:
    """A large body in which cells die at the centre, from a rough beginning."""
    scheme = _make(FipyScheme, m, 24, rtol, alpha="0.8 + 0.1*exp(-20*(xi - 0.5)**2)", radius=4.0, Q=5.0)
    control = Control()
    state = integrate(scheme, start(scheme, 0.0, 0.1, control), [0.0, 3.0], control)
    assert state.counters["iterations"] > 2 * state.counters["steps"]
    before, after = scheme.initial(), state.u[0]
    assert after[0] / after[72] < 0.5 * before[0] / before[72]  # hungry cells die
    scalars = scheme.observe(3.0, state.u[0]).scalars
    # Rounding of every iteration, 1e-16 each, a hundred of them; Newton's method leaves 3e-3 rtol.
    assert abs(scalars["defect_cells"]) < 1e-13
    assert abs(scalars["defect_volume"]) < 1e-13


def _difference(m: int, cells: int) -> tuple[float, float]:
    """Of R and of alpha (mean) at t = 1: FiPy with steps in proportion to the cells against lines on four times the cells."""
    fipy, fine = _make(FipyScheme, m, cells, 1e-6, **SMOOTH), _make(ViscousRadau, m, 4 * cells, 1e-8, **SMOOTH)
    control, free = Control(dt=0.1 * 25 / cells), Control()
    u = integrate(fipy, start(fipy, 0.0, 1.0, control), [0.0, 1.0], control).u[0]
    v = integrate(fine, start(fine, 0.0, 1.0, free), [0.0, 1.0], free).u[0]
    n, W, V = 3 * cells, u[3 * cells], v[12 * cells]
    merged = (v[0 : 4 * n : 3] * np.diff(fine.constants.s)).reshape(cells, 4).sum(axis=1) / np.diff(fipy.constants.s)
    return abs((m * W) ** (1.0 / m) - (m * V) ** (1.0 / m)), float(np.mean(np.abs(u[0:n:3] / W - merged / V)))


@pytest.mark.parametrize("m", KINDS)
def test_fipy_converges_to_the_solution_of_the_lines(m: int) -> None:
    errors = np.array([_difference(m, cells) for cells in (25, 50, 100)])
    assert errors[-1].max() < 2e-4
    # Order 2 in cells and steps, which R, after a first step of order 1, nears from below: 1.7 to 1.9 here, 1.9 to 2 at 400 cells.
    assert np.log2(errors[0] / errors[1]).min() > 1.6
    assert np.log2(errors[1] / errors[2]).min() > 1.7


@pytest.mark.parametrize("m", KINDS)
def test_newtons_method_converges_quadratically(m: int) -> None:
    scheme = _make(FipyScheme, m, 16, 1e-4, **SMOOTH)
    u, alpha = scheme.initial(), 5.0
    x, sizes = scheme.fractions(u), []
    for _ in range(8):
        residual = scheme.residual(0.2, alpha, u, x)
        change = np.linalg.solve(scheme.tangent(0.2, alpha, u, x).toarray(), -residual)
        step, _ = scheme.linearised(0.2, x, change)
        sizes.append(scheme.error_norm(step, u) * scheme.rtol)  # of alpha and relative of R
        x = x + change
    square = [(before, after) for before, after in pairwise(sizes) if 1e-7 < before < 1e-2]
    assert len(square) >= 2  # beyond, the limiter switches; below, the square is rounding
    # The constant of the square is that of the contact stress, about 1/(1 - alpha)^2.
    assert all(after < 100.0 * before**2 for before, after in square)
    assert sizes[-1] < 1e-13  # rounding


def test_a_step_that_fails_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    scheme = _make(FipyScheme, 2, 8, alpha=0.79)  # not at alpha_min, where contact sets in
    u = scheme.initial()
    vanished = u.copy()
    vanished[24] = -1.0
    with pytest.raises(StepFailure, match="no size left"):
        scheme.solve(0.1, 10.0, vanished, vanished)
    for share in (-0.2, 1.2):  # an answer out of bounds; a point that is so from the beginning
        wrong = u.copy()
        wrong[0:24:3] = share * wrong[24]
        with pytest.raises(StepFailure, match="alpha leaves"):
            scheme.solve(0.1, 1000.0, wrong, u if share < 0.0 else wrong)
    monkeypatch.setattr("multiphase.fipy_newton.splu", lambda matrix: _raise(RuntimeError("Factor is exactly singular")))
    with pytest.raises(StepFailure, match="singular"):
        scheme.solve(0.1, 10.0, u, u)
    monkeypatch.undo()
    monkeypatch.setattr(lines, "NEWTON_ITERATIONS", 1)
    monkeypatch.setattr(lines, "NEWTON_TOLERANCE", -1.0)
    with pytest.raises(StepFailure, match="does not converge: last change"):
        scheme.solve(0.1, 10.0, u, u)


def _raise(error: Exception) -> None:
    raise error


def test_a_prediction_out_of_bounds_is_left_for_the_last_point() -> None:
    """As the compiled step does: the same solution, from the past."""
    schemes = [_make(kind, 2, 8) for kind in (FipyScheme, ViscousLines)]
    u = schemes[0].initial()
    far = u.copy()
    far[24] = -1.0
    fipy, compiled = (scheme.solve(0.1, 10.0, u, far) for scheme in schemes)
    assert fipy.iterations == compiled.iterations
    np.testing.assert_allclose(fipy.u, compiled.u, rtol=1e-11, atol=1e-12)  # rounding of one step


def test_a_run_takes_fipy_and_bdf2() -> None:
    assert TumourSolver(method="fipy").resolved == ("fipy", "bdf2")
    geometry = {"kind": "sphere", "formulation": "eulerian"}
    results = [simulate(geometry=geometry, solver=solver, time_scheme="bdf2", cells=10, t_end=0.2) for solver in ("fipy", "lines")]
    assert all(result.status == "completed" for result in results)
    np.testing.assert_allclose(results[0]["radius"], results[1]["radius"], rtol=1e-12)  # rounding
