"""Newton's method of the elastic tumour: how it converges, how far it may go, what is refused, and the algebraic unknowns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from multiphase import newton
from multiphase.stepping import Control, StepFailure, integrate, start
from tumour import radial
from tumour.schemes import ELASTIC

DIMENSIONS = pytest.mark.parametrize("m", [1, 2, 3])


def grown(make: Any, t: float, m: int = 2, cells: int = 30, **changes: Any) -> tuple[Any, np.ndarray]:
    """A scheme for the common loop, and its vector at `t`."""
    scheme = make(m, cells, 1e-6, method="lines", **changes)
    control = Control()
    return scheme, integrate(scheme, start(scheme, 0.0, t, control), [t], control).u[0]


def changes_of(scheme: Any, y: np.ndarray, dt: float, most: int) -> list[float]:
    """Last change after 1, 2, ... iterations of a step of backward Euler from `y`, in units of the tolerated error."""
    found = []
    for count in range(1, most + 1):
        u = y.copy()
        found.append(ELASTIC.newton_step(scheme.data(0.0), scheme.mass, dt, 1.0 / dt, y, u, 0.0, count, scheme.work)[2])
    return found


@pytest.mark.parametrize("kappa", [0.0, 1.0])
@DIMENSIONS
def test_newton_converges_quadratically_away_from_the_kink(make_elastic: Any, m: int, kappa: float) -> None:
    """At t = 10 every cell is in contact. Each change is the square of the last but for a constant, until rounding (1e-16/rtol)."""
    scheme, y = grown(make_elastic, 10.0, m, kappa=kappa)
    sizes = 1e-6 * np.array(changes_of(scheme, y, 1.0, 5))
    assert sizes[0] > 1e-3
    assert sizes[3] < 1e-7
    constants = sizes[1:4] / sizes[:3] ** 2
    assert np.all((constants < 20.0) | (sizes[1:4] < 1e-11))
    assert sizes[4] < 1e-10


@DIMENSIONS
def test_newton_crosses_the_kink(make_elastic: Any, m: int) -> None:
    """A step of backward Euler in which the fraction falls below alpha_min in many cells."""
    scheme, y = grown(make_elastic, 10.0, m, Q=3.0)
    solved = scheme.solve(0.0, 1.0 / 8.0, y, y)
    out = scheme.observe(0.0, solved.u).fields["alpha"]
    before = scheme.observe(0.0, y).fields["alpha"]
    assert np.any((out < 0.8) & (before > 0.8))
    assert solved.iterations <= 10
    residual = np.empty_like(y)
    ELASTIC["rates"](scheme.data(0.0), 0.0, solved.u, residual, scheme.work.model)
    left = residual[:-1] - scheme.mass * (solved.u - y)[:-1] / 8.0
    assert np.abs(left).max() < 1e-6  # 3e-3 rtol, times the stiffest row, about 100


def box(scheme: Any, J: float, alpha: float) -> np.ndarray:
    """A uniform state."""
    y = scheme.initial()
    y[0:-1:3], y[2:-1:3] = alpha * J, J * scheme.data(0.0).V[1:]
    return y


def test_a_change_is_cut_short_of_the_bounds(make_elastic: Any) -> None:
    """At a tenth of the distance to J = 0, alpha = 0 or alpha = 1, whichever comes first; in any cell."""
    scheme = make_elastic(2, 6, method="lines")
    d, reach = scheme.data(0.0), ELASTIC["reach"]
    y, V = box(scheme, 1.5, 0.8), np.diff(d.V)
    none = np.zeros_like(y)
    assert reach(d, y, none) == 1.0
    for cell in (0, 3, 5):
        for by_phi, by_J, share in (
            (-1.2, 0.0, 0.9),  # to alpha = 0
            (-12.0, 0.0, 0.09),
            (0.3, 0.0, 0.9),  # to alpha = 1: J - phi = 0.3
            (3.0, 0.0, 0.09),
            (-1.08, 0.0, 1.0),  # nine tenths of the way
            (0.0, -3.0, 0.09),  # J falls, and J - phi = 0.3 with it
            (-0.8, -1.0, 1.0),  # J and phi both, in proportion
            (-16.0, -20.0, 0.0675),  # to J = 0
            (5.0, 6.25, 1.0),  # any growth
        ):
            change = none.copy()
            change[3 * cell] = by_phi
            change[2 + 3 * cell : -1 : 3] = by_J * V[cell]
            assert reach(d, y, change) == pytest.approx(share, rel=1e-12), (cell, by_phi, by_J)
            moved = y + reach(d, y, change) * change
            assert ELASTIC["admit"](d, moved, scheme.work.model) == 0
    both = none.copy()
    both[0], both[3] = -12.0, 3.0
    assert reach(d, y, both) == pytest.approx(0.09, rel=1e-12)
    for J, alpha in ((-1.0, 0.8), (1.5, 0.0), (1.5, -0.1), (1.5, 1.0), (1.5, 1.2), (np.nan, 0.8), (1.5, np.nan)):
        assert reach(d, box(scheme, J, alpha), none) == 0.0


def test_what_a_step_is_refused_for(make_elastic: Any) -> None:
    scheme = make_elastic(3, 6, rtol=1e-3)
    d = scheme.data(0.0)

    def code(y: np.ndarray) -> int:
        return int(ELASTIC["admit"](d, y, scheme.work.model))

    y = box(scheme, 1.5, 0.8)
    assert code(y) == 0
    inverted = y.copy()
    inverted[5] = inverted[2]  # no volume between two faces
    assert code(inverted) == 1
    for alpha in (0.0, 1.0):
        assert code(box(scheme, 1.5, alpha)) == 2
    hungry = y.copy()
    hungry[4] = -0.9e-3
    assert code(hungry) == 0
    hungry[4] = -1.1e-3
    assert code(hungry) == 3
    for broken in (0, 1, 2):
        y_nan = y.copy()
        y_nan[broken] = np.nan
        assert code(y_nan) > 0
    assert "inside out" in scheme.reason(newton.OUT_OF_BOUNDS, 1.0)
    assert "alpha" in scheme.reason(newton.OUT_OF_BOUNDS, 2.0)
    assert "oxygen" in scheme.reason(newton.OUT_OF_BOUNDS, 3.0)


def test_a_guess_out_of_bounds_is_replaced(make_elastic: Any) -> None:
    """By the past; where that is out of bounds, too, the step is refused in words."""
    scheme, y = grown(make_elastic, 5.0)
    wild = y.copy()
    wild[0] = 2.0  # more cells than there is room for
    replaced, plain = scheme.solve(0.0, 10.0, y, wild), scheme.solve(0.0, 10.0, y, y)
    assert np.array_equal(replaced.u, plain.u)
    assert replaced.iterations == plain.iterations
    with pytest.raises(StepFailure, match="alpha"):
        scheme.solve(0.0, 10.0, wild, wild)
    upside_down = y.copy()
    upside_down[2] = -1.0
    with pytest.raises(StepFailure, match=r"inside out|singular"):
        scheme.solve(0.0, 10.0, upside_down, upside_down)


def residual(scheme: Any, y: np.ndarray) -> np.ndarray:
    """Of the algebraic rows, over the size of their terms."""
    out = np.empty_like(y)
    ELASTIC["rates"](scheme.data(0.0), 0.0, y, out, scheme.work.model)
    return out[:-1][scheme.mass == 0.0]


@pytest.mark.parametrize("settings", [{}, {"Q1_hat": 5.0}, {"kappa": 0.0}, {"kappa": 0.0, "lambda_alpha": 1.0}], ids=str)
@DIMENSIONS
def test_settle_and_project_solve_the_algebraic_equations(make_elastic: Any, m: int, settings: dict[str, float]) -> None:
    """settle from nothing, project from nearby, both to rounding; what is not algebraic stays as it is, bit for bit."""
    scheme, y = grown(make_elastic, 20.0, m, **settings)
    moving = np.append(scheme.mass == 1.0, [True])
    off = y.copy()
    off[1:-1:3] = 1.0
    if "kappa" in settings:
        off[2:-1:3] *= 1.02
    settled = scheme.consistent(0.0, off)
    assert np.abs(residual(scheme, settled)).max() < 1e-12  # rounding: terms are areas times N, up to 1e3
    assert np.array_equal(settled[moving], off[moving])
    np.testing.assert_allclose(settled, y, rtol=1e-5)  # y is so to the tolerance of Newton's method

    def project(u: np.ndarray) -> bool:
        w, f = scheme.work, np.empty_like(u)
        ELASTIC["rates"](scheme.data(0.0), 0.0, u, f, w.model)
        ELASTIC["tangent"](scheme.data(0.0), 0.0, u, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, u)
        far = bool(ELASTIC["project"](scheme.data(0.0), u, f, w.jac))
        assert np.all(f[:-1][scheme.mass == 0.0] == 0.0)  # nothing is left for the estimate of the error to see
        return far

    near = settled.copy()
    near[~moving] *= 1.0 + 1e-7
    assert not project(near) or "kappa" in settings
    assert np.abs(residual(scheme, near)).max() < 1e-9  # the square of what it was off
    assert np.array_equal(near[moving], settled[moving])
    far = settled.copy()
    far[1:-1:3] *= 1.1
    assert project(far)
    assert not project(far)
    assert np.abs(residual(scheme, far)).max() < 1e-5


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize(("m", "t"), [(2, 43.8), (3, 49.9)])
def test_project_crosses_the_kink_where_positions_are_algebraic(make_elastic: Any, m: int, t: float, rtol: float) -> None:
    """kappa = 0, shortly before cells lose contact, and a fiftieth taken from ten of them: one iteration leaves 1e-3 or more."""
    _, y = grown(make_elastic, t, m, kappa=0.0)
    scheme = make_elastic(m, 30, rtol, kappa=0.0)
    y[0:30:3] *= 0.98
    w, f, d = scheme.work, np.empty_like(y), scheme.data(0.0)
    for _ in range(2):
        ELASTIC["rates"](d, 0.0, y, f, w.model)
        ELASTIC["tangent"](d, 0.0, y, f, w.jac, w.columns, w.rows, w.corner, w.q_rows, w.q_corner, w.model, y)
        if not ELASTIC["project"](d, y, f, w.jac):
            break
    alpha = scheme.observe(0.0, y).fields["alpha"]
    assert alpha.min() < 0.8 < alpha.max()
    assert np.abs(residual(scheme, y)).max() < rtol  # its own 1e-2 rtol, times the stiffest row, about 100


def test_nothing_is_made_of_a_singular_tangent(make_elastic: Any) -> None:
    scheme = make_elastic(2, 6)
    y = scheme.initial()
    zero = np.zeros((18, 2 * radial.HALF + 1))
    before = y.copy()
    assert not ELASTIC["project"](scheme.data(0.0), y, np.ones_like(y), zero)
    assert np.array_equal(y, before)
