"""The viscous tumour: exact solutions, balances, late growth, Newton's method, errors in time, resuming. Hard cases stand in
`tests/hard`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from multiphase import newton
from multiphase.stepping import Control, Snapshot, State, StepFailure, integrate, start
from tumour import exact
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import VISCOUS, ViscousLines, ViscousRadau
from tumour.solver import TumourSolver

KINDS = {1: "slab", 2: "disk", 3: "sphere"}
SCHEMES = {"lines": ViscousLines, "radau": ViscousRadau}
DIMENSIONS = pytest.mark.parametrize("m", [1, 2, 3])
METHODS = pytest.mark.parametrize("method", SCHEMES)


def make(
    m: int = 2, cells: int = 50, rtol: float = 1e-4, *, method: str = "radau", alpha: Any = 0.8, radius: float = 1.0, **changes: Any
) -> Any:
    geometry = TumourGeometry(kind=KINDS[m], radius=radius, formulation="eulerian")
    return SCHEMES[method](TumourParameters(**changes), TumourInitial(alpha=alpha), geometry, TumourSolver(cells=cells, rtol=rtol))


class Keep:
    """What is stored, and the state after each return of the integrator."""

    def __init__(self) -> None:
        self.stored: list[Snapshot] = []
        self.states: list[State] = []

    def on_start(self, state: State, t_end: float) -> None: ...

    def on_step(self, state: State) -> None:
        self.states.append(state)

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.stored.append(snapshot)


def run(scheme: Any, save_at: Sequence[float], **control: Any) -> tuple[State, Keep]:
    keep, settings = Keep(), Control(**control)
    state = integrate(scheme, start(scheme, 0.0, save_at[0] or save_at[-1], settings), list(save_at), settings, [keep])
    return state, keep


def rates(scheme: Any, y: np.ndarray) -> np.ndarray:
    out = np.empty_like(y)
    VISCOUS["rates"](scheme.data(0.0), 0.0, y, out, scheme.work.model)
    return out


TABLE = {
    (1, 0.0): (0.8075253, (1.097272, 1.647220, 2.737150, 7.557749)),
    (2, 1.0): (0.8075253, (1.047507, 1.283441, 1.654433, 2.749136)),
    (3, 0.0): (0.8027579, (1.034922, 1.192561, 1.423794, 2.029457)),
}
FREE = {"kappa": 0.0, "Q": 0.0}
TIMES = [1.0, 5.0, 10.0, 20.0]


@pytest.mark.parametrize("cells", [4, 40])
@pytest.mark.parametrize(("m", "lam"), TABLE)
def test_uniform_growth_at_the_values_computed_elsewhere(m: int, lam: float, cells: int) -> None:
    """alpha at its steady value after t = 10, R at all times; no error of the grid, so any number of cells does."""
    _, keep = run(make(m, cells, 1e-9, lambda_alpha=lam, **FREE), TIMES)
    fraction, radii = TABLE[m, lam]
    np.testing.assert_allclose([s.scalars["radius"] for s in keep.stored], radii, atol=1e-6)  # half a unit of the last digit, and as much
    for snapshot in keep.stored[2:]:
        np.testing.assert_allclose(snapshot.fields["alpha"], fraction, atol=1e-6)


@METHODS
@DIMENSIONS
@pytest.mark.parametrize("changes", [{"alpha": 0.9}, {"alpha": 0.5, "lambda_alpha": -0.4}, {"alpha": 0.85, "p_out": 0.05}], ids=str)
def test_uniform_growth_from_other_fractions(m: int, changes: dict[str, float], method: str) -> None:
    """Cells too many, too few at first to touch, and pushed apart by the fluid; BDF2 at its tightest usable tolerance."""
    rtol, allowed = (1e-9, 2e-7) if method == "radau" else (1e-7, 2e-5)  # errors of a step, times a few hundred of them
    _, keep = run(make(m, 7, rtol, method=method, radius=1.3, **FREE, **changes), TIMES[:3])
    material = {name: value for name, value in changes.items() if name != "alpha"}
    alpha, R = exact.uniform_growth_eulerian(TIMES[:3], TumourParameters(**FREE, **material), m, changes["alpha"], 1.3)
    np.testing.assert_allclose([s.scalars["radius"] for s in keep.stored], R, rtol=allowed)
    for snapshot, fraction in zip(keep.stored, alpha, strict=True):
        np.testing.assert_allclose(snapshot.fields["alpha"], fraction, atol=allowed)
        strain = snapshot.scalars["growth_rate"] / snapshot.scalars["radius"]
        np.testing.assert_allclose(snapshot.fields["u"], strain * snapshot.x, rtol=1e-9, atol=1e-12)  # u ~ r, if cells touch at all
        np.testing.assert_allclose(snapshot.fields["p"], material.get("p_out", 0.0), atol=1e-12)
        np.testing.assert_allclose(snapshot.fields["C"], 1.0, rtol=1e-12)


@DIMENSIONS
def test_oxygen_at_rest(m: int) -> None:
    """cosh, I_0 and sinh(x)/x: second order in the largest error, 1e-6 on 800 cells."""
    errors = []
    for cells in (50, 100, 800):
        stored = make(m, cells, radius=2.0, Q=1.5, C_out=0.7).observe(0.0, make(m, cells, radius=2.0, Q=1.5, C_out=0.7).initial())
        errors.append(np.abs(stored.fields["C"] - exact.oxygen(stored.x, 2.0, 0.8, m, Q=1.5, C_out=0.7)).max())
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert errors[2] < 1e-6


@METHODS
@DIMENSIONS
def test_balances_close_to_rounding(m: int, method: str) -> None:
    """Over t = 60 at default tolerances; alpha stays in [0, 1), and steps are few."""
    state, keep = run(make(m, 100, method=method), [0.0, 20.0, 40.0, 60.0])
    for snapshot in keep.stored:
        assert abs(snapshot.scalars["defect_cells"]) < 1e-11
        assert abs(snapshot.scalars["defect_volume"]) < 1e-11
        assert snapshot.fields["alpha"].min() >= 0.0
        assert snapshot.fields["alpha"].max() < 1.0
    assert state.counters["iterations"] > 2 * state.counters["steps"]
    assert state.counters["steps"] < 150  # 18 to 72 are taken


def test_late_growth_of_a_slab() -> None:
    """Forgets where it came from: the same speed at t = 200 for three sizes at t = 0, to 0.1 %. On 200 cells they differ by 1e-4;
    on 1600, with rtol = 1e-5, they are 0.079094 all three."""
    speeds = [run(make(1, 200, 1e-4, radius=radius), [200.0])[1].stored[0].scalars["growth_rate"] for radius in (0.5, 1.0, 2.0)]
    assert max(speeds) - min(speeds) < 1e-3 * min(speeds)
    np.testing.assert_allclose(speeds, 0.079094, rtol=1e-3)


@DIMENSIONS
def test_newtons_method_converges_quadratically(m: int) -> None:
    """Away from the kink of contact (alpha well above alpha_min) and where no slope is limited (a smooth profile)."""
    scheme = make(m, 40, 1e-6, method="lines", alpha="0.7 + 0.1*cos(pi*xi**2)", alpha_star=0.2, alpha_min=0.2, radius=3.0, Q1_hat=2.0)
    past = scheme.initial()
    changes = []
    for most in range(1, 8):
        y = past.copy()
        changes.append(scheme.kernel.newton_step(scheme.data(0.0), scheme.mass, 0.5, 5.0, past, y, 0.0, most, scheme.work)[2])
    near = [change for change in changes if 1e-12 * changes[0] < change < 0.1 * changes[0]]  # after the first ones, and before rounding
    falls = [later / earlier**2 for earlier, later in itertools.pairwise(near)]
    assert len(falls) >= 2
    assert max(falls) < 5.0 * min(falls)  # one constant of convergence, not a rate
    assert min(changes) < 1e-9 * changes[0]


@DIMENSIONS
def test_settle_and_project_reach_the_equations_to_rounding(m: int) -> None:
    scheme = make(m, 30, radius=2.0, Q1_hat=2.0, alpha="0.7 + 0.2*cos(5*xi**2)", alpha_star=0.6, alpha_min=0.6)
    exact_y = scheme.initial()
    size = 90
    algebraic = np.append(np.flatnonzero(scheme.mass[:size] == 0.0), size + 1)
    assert np.abs(rates(scheme, exact_y)[algebraic]).max() < 1e-12  # rounding of sums of order one
    y = exact_y.copy()
    y[algebraic] += 0.3 * np.random.default_rng(1).normal(size=len(algebraic))
    assert np.abs(scheme.consistent(0.0, y) - exact_y).max() < 1e-12
    w, far = scheme.work, [True]
    for _ in range(4):  # quadratic in C, linear in u
        f = rates(scheme, y)
        VISCOUS["tangent"](scheme.data(0.0), 0.0, y, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, w.scratch)
        far.append(VISCOUS["project"](scheme.data(0.0), y, f, w.jac))
    assert far[1]
    assert not far[-1]
    assert np.abs(y - exact_y).max() < 1e-12
    assert np.array_equal(y[0:size:3], exact_y[0:size:3])


def test_steps_that_fail_say_why() -> None:
    scheme = make(2, 8, method="lines")
    y = scheme.initial()
    with pytest.raises(StepFailure, match="the tangent of the step is singular"):
        scheme.solve(0.1, 10.0, -y, -y)  # a body inside out
    crowded = y.copy()
    crowded[0:24:3] *= 1.5
    with pytest.raises(StepFailure, match="alpha leaves"):
        scheme.solve(0.1, 10.0, crowded, crowded)
    for code, words in ((newton.DIVERGED, "does not converge: last change 3"), (newton.INEXACT, "local error 3 times the tolerance")):
        assert words in scheme.reason(code, 3.0)
    assert scheme.reason(newton.OUT_OF_BOUNDS, 3.0) == "oxygen falls below 0 by more than rtol"


@DIMENSIONS
def test_the_time_error_stays_within_ten_tolerances(m: int) -> None:
    """At t = 40, on one grid, against rtol 1e-9 there: alpha in the mean, R relative to itself."""
    exact_y = run(make(m, 50, 1e-9), [40.0])[0].u[0]
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6):
        y = run(make(m, 50, rtol), [40.0])[0].u[0]
        alpha, wanted = (v[0:150:3] / v[150] for v in (y, exact_y))
        assert np.mean(np.abs(alpha - wanted)) < 10.0 * rtol
        assert abs((y[150] / exact_y[150]) ** (1.0 / m) - 1.0) < 10.0 * rtol


def test_stored_velocities_and_pressures_are_those_of_the_stored_fractions() -> None:
    """Also between two steps and in a dead core, where nothing measures u: it is solved for once more."""
    times = list(np.linspace(2.0, 60.0, 30))
    found, wanted = (run(make(3, 200, rtol, radius=50.0), times)[1].stored for rtol in (1e-4, 1e-8))
    for snapshot, reference in zip(found, wanted, strict=True):
        for name in ("u", "p"):
            error = np.abs(snapshot.fields[name] - reference.fields[name]).max()
            assert error < 2e-3 * np.abs(reference.fields[name]).max()  # 4e-4 from alpha; stale values are off by 5 times themselves


@METHODS
@DIMENSIONS
def test_a_resumed_run_is_the_same_bit_for_bit(m: int, method: str) -> None:
    times = [0.0, 10.0, 25.0, 40.0]
    state, keep = run(make(m, 30, method=method), times)
    middle = keep.states[len(keep.states) // 2]
    left = [t for t in times if t > middle.t]
    assert 0 < len(left) < len(times)
    again, control = Keep(), Control()
    resumed = integrate(make(m, 30, method=method), State.from_arrays(middle.to_arrays()), left, control, [again])
    for name, array in state.to_arrays().items():
        assert np.array_equal(array, resumed.to_arrays()[name]), name
    for one, other in zip(keep.stored[-len(left) :], again.stored, strict=True):
        assert one.scalars == other.scalars or np.isnan(one.scalars["doubling_time"])
        assert all(np.array_equal(one.fields[name], other.fields[name]) for name in one.fields)
