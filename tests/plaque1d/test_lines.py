"""The compiled method of lines: its tangent, its agreement with FiPy, Radau IIA's order and error, dense output, memory."""

from __future__ import annotations

import itertools
import resource
import sys

import numpy as np
import pytest

from multiphase.stepping import Control, StepFailure, integrate, predict, start
from plaque1d import PlaqueInitial, PlaqueParameters, layout, simulate
from plaque1d.semidiscrete import KERNEL

DRAG = {"momentum": "drag", "p_out": 1.0}
FORMS = {"interfacial": {}, "drag": DRAG}
SHAPES = {"slab": {}, "annulus": {"lumen_radius": 1.3}}


def _rates(scheme, y, t=0.0):
    out = np.empty_like(y)
    KERNEL["rates"](scheme.data(t), t, y, out, scheme.work.model)
    return out


def _dense(scheme, y):
    """The compiled tangent as a full matrix."""
    work, size, m = scheme.work, scheme.size, scheme.stride
    KERNEL["tangent"](
        scheme.data(0.0), 0.0, y, _rates(scheme, y), work.jac, work.columns, work.rows, work.corner, work.q_rows, work.q_corner, work.model,
        work.scratch,
    )  # fmt: skip
    full = np.zeros((len(y), len(y)))
    for i in range(size):
        for j in range(max(0, i - 2 * m), min(size, i + 2 * m + 1)):
            full[i, j] = work.jac[i, j - i + 2 * m]
    border, integrals = slice(size, size + layout.BORDER), slice(size + layout.BORDER, len(y))
    full[:size, border], full[border, :size], full[border, border] = work.columns.T, work.rows, work.corner
    full[integrals, :size], full[integrals, border] = work.q_rows, work.q_corner
    return full


def _rough(scheme, seed=1):
    """A state that takes every branch of the limiter and of the damping."""
    rng = np.random.default_rng(seed)
    y, N = scheme.initial(), scheme.grid.cells
    W = y[scheme.size]
    y[scheme.n], y[scheme.l] = W * rng.uniform(0.05, 0.95, N), W * rng.uniform(0.1, 1.0, N)
    y[2 : scheme.size : scheme.stride] = rng.normal(size=N)
    if scheme.stride == 4:
        y[3 : scheme.size : 4] = rng.normal(size=N)
    y[scheme.size + 1] = 0.7
    return y


MATERIALS = {
    "equal viscosities": {},
    "unequal viscosities": {"mu_n": 0.05, "lambda_n": 0.3, "mu_m": 0.8, "lambda_m": -0.2, "k": 2.0},
    "inviscid": {"mu_n": 0.0, "mu_m": 0.0},
    "only macrophages viscous": {"mu_n": 0.0},
    "given n at the wall": {"inner_wall": 0.3},
    "modLDL upwinded": {"L": 60.0},
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("material", MATERIALS)
def test_the_tangent_is_the_derivative_of_the_rates(make_lines, shape, form, material):
    scheme = make_lines(11, **SHAPES[shape], **FORMS[form], **MATERIALS[material])
    y = _rough(scheme)
    exact = _dense(scheme, y)
    numeric = np.empty_like(exact)
    for j in range(len(y)):
        step = 1e-6 * max(1.0, abs(y[j]))
        up, down = y.copy(), y.copy()
        up[j] += step
        down[j] -= step
        numeric[:, j] = (_rates(scheme, up) - _rates(scheme, down)) / (2.0 * step)
    # Row by row: rounding 1e-16/1e-6 of the row's own terms, and third derivatives times 1e-12.
    scale = np.maximum(np.abs(exact).max(axis=1), 1.0)[:, None]
    error = np.abs(exact - numeric) / scale
    border = [scheme.size, scheme.size + 1]
    assert np.delete(error, border, axis=1).max() < 1e-8
    assert error[:, border].max() < 2e-5  # one-sided differences, steps 1e-7 W and 1e-4 V, across kinks of the damping


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("form", FORMS)
def test_the_tangent_conserves_what_the_rates_conserve(make_lines, shape, form):
    """Totals of n and l against the integral of the uptake, column by column: hence exact balances after any Newton iteration."""
    scheme = make_lines(11, **SHAPES[shape], **FORMS[form])
    full, p = _dense(scheme, _rough(scheme)), scheme.parameters
    for part, gain in ((scheme.n, p.k_m), (scheme.l, -p.k_l)):
        column = full[part].sum(axis=0) / 11 - gain * full[scheme.size + layout.BORDER]
        cells = np.abs(column[: scheme.size]) / np.abs(full[part]).max()
        assert cells.max() < 1e-15
        assert np.abs(column[scheme.size :]).max() < 1e-6  # rounding of the differences, which the last, tiny update multiplies


@pytest.mark.parametrize(
    ("form", "shape"), [("interfacial", "slab"), ("drag", "slab"), ("interfacial", "annulus")], ids=lambda value: str(value)
)
def test_fipy_assembles_the_same_equations(make_scheme, make_lines, form, shape):
    """FiPy's own terms against the compiled rates, at a rough state and a step from another one."""
    settings = {**FORMS[form], **SHAPES[shape], "mu_n": 0.2, "lambda_n": 0.1}
    assembled, compiled = make_scheme(12, **settings), make_lines(12, **settings)
    y, past, alpha = _rough(compiled), _rough(compiled, seed=2), 7.0
    y[compiled.size - 1] = 0.0  # the slip at the outer wall
    past[compiled.size] = 0.9 * y[compiled.size]
    vector, before = (np.concatenate([v, [0.0, 0.0]]) for v in (y, past))
    residual = assembled.residual(0.1, alpha, before, assembled.fractions(vector))
    rates, lay, h = _rates(compiled, y), assembled.layout, compiled.grid.spacing
    expected = np.empty_like(residual)
    for part, place in ((lay.n, compiled.n), (lay.l, compiled.l)):
        expected[part] = h * (alpha * (y[place] - past[place]) - rates[place])
    expected[lay.w] = rates[compiled.w]
    expected[lay.W], expected[lay.V] = alpha * (y[-5] - past[-5]) - rates[-5], rates[-4]
    np.testing.assert_allclose(residual, expected, atol=1e-12 * np.abs(expected).max())  # rounding of FiPy's matrix rows


@pytest.mark.parametrize("form", FORMS)
def test_fipy_and_lines_take_the_same_steps_with_the_same_formula(make_scheme, make_lines, form):
    control, ends = Control(), []
    for scheme in (make_scheme(12, 1e-3, **FORMS[form]), make_lines(12, 1e-3, kind="lines", **FORMS[form])):
        state = integrate(scheme, start(scheme, 0.0, 0.1, control), [0.0, 0.5], control)
        ends.append((state.u[0][: scheme.size + 4], state.counters))
    assert ends[0][1] == ends[1][1]
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1e-9)  # what Newton's method leaves, squared at each of its iterations


def _final(scheme, t_end=2.0, dt=None):
    control = Control(dt=dt)
    state = integrate(scheme, start(scheme, 0.0, t_end, control), [0.0, t_end], control)
    return state.u[0], state


@pytest.mark.parametrize("form", FORMS)
def test_both_methods_converge_to_the_same_solution(make_scheme, make_lines, form):
    """FiPy with BDF2 on N cells against lines on the same cells and on four times as many."""
    differences = []
    for cells, rtol in ((12, 1e-3), (24, 1e-4), (48, 1e-5)):
        u, _ = _final(make_scheme(cells, rtol, **FORMS[form]), 1.0)
        fine, _ = _final(make_lines(4 * cells, 1e-7, **FORMS[form]), 1.0)
        coarse = fine[: 12 * cells : 3].reshape(cells, 4).mean(axis=1) / fine[12 * cells]
        differences.append(np.mean(np.abs(u[: 3 * cells : 3] / u[3 * cells] - coarse)))
    assert differences[-1] < 1e-3
    assert np.log2(differences[0] / differences[1]) > 1.5
    assert np.log2(differences[1] / differences[2]) > 1.7  # order 2, beginning at 12 cells


def test_radau_is_of_order_five_and_its_dense_output_of_order_four(make_lines):
    """Smooth data (monotone n, an influx that fits the initial modLDL), fixed steps, against far smaller steps."""
    settings = {"n": "0.2 + 0.3*xi**2*(3 - 2*xi)", "l": 1.0, "L": 1.0, "Psi_l": 0.5, "k_l": 0.3, "k_m": 0.4}

    def values(t_end, dt):
        u, state = _final(make_lines(10, 1e-9, **settings), t_end, dt)  # Newton's method to 3e-12
        between = state.times[-1] + 0.45 * (state.times[0] - state.times[-1])
        return u, between, predict(between, state.times, state.u)

    reference, _, _ = values(2.0, 2.0 / 256)
    ends, slips, middles = [], [], []
    for steps in (16, 32):
        u, between, inside = values(2.0, 2.0 / steps)
        exact, _, _ = values(between, 2.0 / 256)
        ends.append(np.abs(u - reference)[:30:3].max())
        slips.append(np.abs(u - reference)[2:30:3].max())
        middles.append(np.abs(inside - exact)[:30].max())
    assert np.log2(ends[0] / ends[1]) > 4.5
    assert np.log2(slips[0] / slips[1]) > 4.5
    assert np.log2(middles[0] / middles[1]) > 3.6


@pytest.mark.parametrize("form", FORMS)
def test_the_time_error_stays_within_ten_tolerances(make_lines, form):
    """The reference problem on one grid, against rtol 1e-11 there."""
    exact, _ = _final(make_lines(50, 1e-11, **FORMS[form]))
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        u, _ = _final(make_lines(50, rtol, **FORMS[form]))
        for part in (slice(0, 150, 3), slice(1, 150, 3), slice(150, 151)):
            assert np.mean(np.abs(u[part] - exact[part])) < 10.0 * rtol


def test_values_between_steps_are_within_the_tolerance_too(make_lines):
    times = list(np.linspace(0.0, 2.0, 41))

    def stored(rtol):
        rows = []

        class Keep:
            def on_start(self, state, t_end): ...
            def on_step(self, state): ...
            def on_save(self, state, snapshot):
                rows.append(snapshot)

        scheme, control = make_lines(30, rtol), Control()
        state = integrate(scheme, start(scheme, 0.0, times[1], control), times, control, [Keep()])
        return rows, state

    exact, _ = stored(1e-10)
    rows, state = stored(1e-4)
    assert state.counters["steps"] < 40  # most rows lie between two steps
    for row, reference in zip(rows, exact, strict=True):
        for name in ("n", "l"):
            assert np.mean(np.abs(row.fields[name] - reference.fields[name])) < 10.0 * 1e-4
        assert row.scalars["L_rate"] == pytest.approx(reference.scalars["L_rate"], rel=5e-3)  # follows l in the first cell, 10 rtol over l
        assert all(abs(row.scalars[f"defect_{which}"]) < 1e-11 for which in "nclL")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("rtol", [1e-2, 1e-5])
def test_balances_close_to_rounding_whatever_the_tolerance(make_lines, shape, form, rtol):
    scheme = make_lines(24, rtol, **SHAPES[shape], **FORMS[form], Psi_l={"times": [0.0, 0.2, 0.2, 0.6], "values": [1.0, 1.0, 0.1, 2.0]})
    u, state = _final(scheme, 1.0)
    assert state.counters["iterations"] > 2 * state.counters["steps"]
    snapshot = scheme.observe(1.0, u)
    assert all(abs(snapshot.scalars[f"defect_{which}"]) < 1e-11 for which in "nclL")
    # Radau's quadrature is exact for the pieces of Psi_l(t): 0.2, a ramp from 0.1 to 2 over 0.4, 0.4 at 2
    assert u[scheme.size + layout.BORDER + 1] / scheme.geometry.inner_radius == pytest.approx(
        0.2 + 0.5 * (0.1 + 2.0) * 0.4 + 0.8, rel=1e-12
    )


def test_a_sharp_influx_is_met_at_its_jumps(make_lines):
    """Steps end at kinks and jumps: the same run in three pieces ends on the same values."""
    pulse = {"times": [0.3, 0.3, 0.5, 0.5], "values": [1.0, 4.0, 4.0, 0.2]}
    u, _ = _final(make_lines(20, 1e-6, Psi_l=pulse), 0.8)
    finer, _ = _final(make_lines(20, 1e-9, Psi_l=pulse), 0.8)
    assert np.abs(u - finer)[:60:3].max() < 1e-5


def test_singular_and_diverging_steps_are_told_apart(make_lines):
    scheme = make_lines(8)
    assert "diverge" in scheme.reason(2, 3.0) or "converge" in scheme.reason(2, 3.0)
    with pytest.raises(StepFailure, match="no longer positive"):
        make_lines(8, kind="lines").solve(0.1, 10.0, -scheme.initial(), -scheme.initial())


def test_a_thousand_runs_do_not_grow_the_process():
    parameters, initial = PlaqueParameters(), PlaqueInitial()

    def some(count):
        for _ in range(count):
            simulate(parameters, initial=initial, t_end=0.01, cells=20, rtol=1e-2, save_at=[0.01])
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024.0 if sys.platform == "linux" else 1024.0**2)

    before = some(50)
    assert some(1000) - before < 20.0  # MB


def test_work_grows_with_the_cells_and_no_faster(make_lines):
    sizes = [make_lines(cells).workspace_bytes for cells in (100, 200, 400)]
    assert sizes[2] - sizes[1] == pytest.approx(2 * (sizes[1] - sizes[0]), rel=1e-6)
    assert (sizes[1] - sizes[0]) / 100 < 5000  # bytes per cell
    steps = [_final(make_lines(cells, 1e-4), 1.0)[1].counters["iterations"] for cells in (100, 400)]
    assert steps[1] < 3 * steps[0]


def test_every_combination_of_form_and_shape_runs(make_lines):
    for form, shape, kind in itertools.product(FORMS, SHAPES, ("lines", "radau")):
        scheme = make_lines(10, 1e-2, kind=kind, **FORMS[form], **SHAPES[shape])
        u, _ = _final(scheme, 0.3)
        assert 0.0 < scheme.observe(0.3, u).scalars["L"] - 0.5 < 0.5
