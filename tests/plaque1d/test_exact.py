"""Balances to rounding, closed forms, symmetries, bounds."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.stepping import Control, integrate, start
from plaque1d import PlaqueInitial, PlaqueParameters, layout, simulate
from plaque1d.semidiscrete import KERNEL

DEFECTS = ("defect_L", "defect_n", "defect_c", "defect_l")


def _run(scheme, t_end, stops=4, **control):
    """All snapshots of a run, and the last state."""
    kept = []

    class Keep:
        def on_start(self, state, t_end): ...
        def on_step(self, state): ...
        def on_save(self, state, snapshot):
            kept.append(snapshot)

    c = Control(**control)
    save_at = list(np.linspace(0.0, t_end, stops + 1))
    state = integrate(scheme, start(scheme, 0.0, save_at[1], c), save_at, c, [Keep()])
    return kept, state


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"momentum": "drag", "p_out": 1.0},
        {"mu_n": 0.01, "mu_m": 1.0},
        {"Psi_l": {"times": [0.0, 0.2, 0.2, 0.6], "values": [1.0, 1.0, 0.1, 2.0]}},
    ],
    ids=["interfacial", "drag", "unequal", "pulsed influx"],
)
def test_balances_close_to_rounding_and_the_combined_identity_holds(make_scheme, changes):
    rtol = 1e-3
    scheme = make_scheme(24, rtol, **changes)
    snapshots, state = _run(scheme, 1.0)
    assert state.counters["rejected_error"] > 0  # the error control was at work
    for snapshot in snapshots:
        for name in DEFECTS:
            assert abs(snapshot.scalars[name]) < 1e-11  # rounding of some 100 steps
    p = scheme.parameters

    def combined(s, u):
        influx = u[scheme.size + layout.BORDER + 1]
        return s.scalars["l_total"] + p.k_l / p.k_m * s.scalars["n_total"] - influx

    # l + (k_l/k_m) n - influx is constant: the two sources are one product in every step, so to rounding as well, far below ten times
    # the iteration's tolerance 3e-3 rtol
    drift = combined(snapshots[-1], state.u[0]) - combined(snapshots[0], scheme.initial())
    assert abs(drift) < 1e-11
    influx = state.u[0][scheme.size + layout.BORDER + 1]
    if "Psi_l" in changes:  # 0.2 at 1, a ramp from 0.1 to 2 over 0.4, 0.4 at 2: BDF2 integrates the ramp to its error
        assert influx == pytest.approx(0.2 + 0.42 + 0.8, rel=1e-2)
    else:
        assert influx == pytest.approx(1.0, rel=1e-13)  # Psi_l t


def test_balances_count_added_terms(make_scheme):
    def extra(plaque):
        s = plaque.add_species("s", initial=lambda x: 0.1 + x, influx=0.3)
        gain = 0.5 * plaque.L * plaque.n * s
        return {"n": gain, "l": -plaque.fipy.ImplicitSourceTerm(coeff=2.0 * plaque.L * s, var=plaque.l)}

    snapshots, _ = _run(make_scheme(10, 1e-3, extra), 0.1, stops=2)
    for name in DEFECTS:
        assert abs(snapshots[-1].scalars[name]) < 1e-11
    assert "s" in snapshots[-1].fields


def test_without_uptake_the_width_grows_at_the_geometric_mean(make_scheme):
    """k_l = 0: l = sqrt(Psi_l/Psi_m) is a steady state and L' = sqrt(Psi_l Psi_m) whatever n does."""
    Psi_l, Psi_m = 1.3, 0.7
    scheme = make_scheme(16, 1e-3, Psi_l=Psi_l, Psi_m=Psi_m, k_l=0.0, l=float(np.sqrt(Psi_l / Psi_m)))
    snapshots, _ = _run(scheme, 1.0)
    for s in snapshots:
        assert s.scalars["L_rate"] == pytest.approx(np.sqrt(Psi_l * Psi_m), rel=1e-8)
        assert s.scalars["L"] == pytest.approx(0.5 + s.t * np.sqrt(Psi_l * Psi_m), rel=1e-8)
        np.testing.assert_allclose(s.fields["l"], np.sqrt(Psi_l / Psi_m), rtol=1e-8)
    assert np.ptp(snapshots[-1].fields["n"]) > 0.1  # n is far from uniform


def test_a_long_intima_tends_to_the_deep_fraction(make_scheme):
    """Balance over all of a long intima: n = k_m Psi_l / (k_l V) deep inside, to the share that is still in transit."""
    scheme = make_scheme(60, 1e-3, Psi_m=5.0, n=0.3, L=0.5)
    snapshots, _ = _run(scheme, 6.0)
    s = snapshots[-1]
    p = scheme.parameters
    deep = p.k_m * 1.0 / (p.k_l * s.scalars["L_rate"])
    x, n = s.x, s.fields["n"]
    middle = n[(x > 0.5 * x[-1]) & (x < 0.75 * x[-1])]
    # consumption is complete to exp(-x sqrt(k_l c)); the growth rate still drifts by some per cent
    np.testing.assert_allclose(middle, deep, rtol=0.05)


@pytest.mark.parametrize("momentum", ["interfacial", "drag"])
def test_symmetries(make_scheme, momentum):
    """Units of concentration and of pressure do not matter."""
    eta, s, k = 3.0, 7.0, 2.0
    common = {"momentum": momentum, "k": k}
    plain = {"Psi_l": 1.0, "k_m": 2.0, "Psi_m": 0.5, "B": 1.0, "A": 0.5, "b": 20.0, "mu_n": 0.5, "mu_m": 0.2, "p_out": 0.6, "l": 0.2}
    concentrations = plain | {"l": 0.2 * eta, "Psi_l": eta, "k_m": 2.0 / eta, "Psi_m": 0.5 / eta, "B": 1.0 / eta**k}
    pressures = plain | {name: s * plain[name] for name in ("A", "b", "mu_n", "mu_m", "p_out")}
    runs = [_run(make_scheme(16, 1e-4, **common, **values), 0.5)[0][-1] for values in (plain, concentrations, pressures)]
    for other, factor in ((runs[1], eta), (runs[2], 1.0)):
        # the same steps are taken and the same equations solved; what differs is rounding in the Newton iteration
        for name in ("n", "u_n", "u_m"):
            np.testing.assert_allclose(other.fields[name], runs[0].fields[name], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(other.fields["l"], factor * runs[0].fields["l"], rtol=1e-7)
        assert other.scalars["L"] == pytest.approx(runs[0].scalars["L"], rel=1e-9)
    np.testing.assert_allclose(runs[2].fields["p_n"], s * runs[0].fields["p_n"], rtol=1e-6, atol=1e-8)


HARD = {
    "macrophages vanish": {"k_m": 20.0},
    "no necrotic phase at first": {"n": 0.0},
    "thin intima": {"L": 0.01},
    "fast recruitment": {"Psi_m": 50.0},
    "nearly no viscosity": {"mu_n": 1e-5, "mu_m": 1e-5},
    "no viscosity": {"mu_n": 0.0, "mu_m": 0.0},
    "no modLDL at first": {"l": 0.0},
}


@pytest.mark.parametrize("case", HARD)
def test_hard_cases_keep_the_fractions_in_range(make_scheme, case):
    rtol = 1e-3
    scheme = make_scheme(16, rtol, **HARD[case])
    snapshots, state = _run(scheme, 0.6)
    for s in snapshots:
        n = s.fields["n"]
        # a step whose fractions leave [0, 1] by more than rtol is refused
        assert n.min() >= -rtol
        assert n.max() <= 1.0 + rtol
        assert s.fields["l"].min() >= -rtol * s.fields["l"].max()
        assert max(abs(s.scalars[name]) for name in DEFECTS) < 1e-11
    assert state.counters["steps"] < 150


def test_time_error_follows_rtol(make_scheme):
    """Against the same mesh at a far smaller tolerance. A step's error is kept below rtol, so that of the run falls as rtol^(2/3)."""
    exact = _run(make_scheme(8, 1e-7), 0.3)[0][-1]
    errors = []
    for rtol in (1e-3, 1e-4, 1e-5):
        s = _run(make_scheme(8, rtol), 0.3)[0][-1]
        errors.append(
            [
                np.mean(np.abs(s.fields["n"] - exact.fields["n"])),
                np.mean(np.abs(s.fields["l"] - exact.fields["l"])) / exact.fields["l"].max(),
                abs(s.scalars["L"] / exact.scalars["L"] - 1.0),
            ]
        )
        assert max(errors[-1]) < 10 * rtol
    fall = (np.array(errors[0]) / np.array(errors[2])) ** 0.5  # per tenth of rtol; 10^(2/3) = 4.6
    assert np.all(fall > 2.5)


def test_both_inner_wall_conditions(make_scheme):
    snapshots, _ = _run(make_scheme(24, 1e-3), 0.5)
    n, s = snapshots[-1].fields["n"], snapshots[-1]
    assert s.scalars["n_wall"] == pytest.approx(n[0] - (n[1] - n[0]) / 6.0, rel=1e-12)  # the parabola with n_x = 0, by definition
    given, _ = _run(make_scheme(24, 1e-3, inner_wall=0.4), 0.5)
    g = given[-1]
    assert g.scalars["n_wall"] == 0.4
    assert g.fields["n"][0] == pytest.approx(0.4, abs=0.05)  # within a cell's change of the wall value
    assert abs(g.fields["n"][0] - n[0]) > 0.02  # and the condition matters


@pytest.mark.parametrize(
    ("added", "words"),
    [
        (lambda p: None, "must return a mapping"),
        (lambda p: {"n": 1.0}, "must be a FiPy term or variable"),
        (lambda p: {"w": p.n}, "has shape"),
        (lambda p: {"l": p.fipy.ImplicitSourceTerm(coeff=1.0)}, "is var= given"),
        (lambda p: {"ll": p.n}, 'did you mean "l"'),
        (lambda p: p.add_species("n"), "cannot be called"),
    ],
)
def test_added_terms_that_cannot_be_used_are_refused(make_scheme, added, words):
    with pytest.raises(ParameterError, match=words):
        make_scheme(8, 1e-3, added)


@pytest.mark.parametrize("k_m", [0.0, 1e-5])
def test_a_vanishing_necrotic_phase_does_not_stop_the_run(make_scheme, k_m):
    """Behind the wall n falls exponentially to nothing; left to itself, an undershoot would grow there as n does."""
    scheme = make_scheme(30, 1e-3, k_m=k_m, n=0.3)
    snapshots, _ = _run(scheme, 15.0, stops=2)
    assert snapshots[-1].t == 15.0
    for s in snapshots:
        assert s.fields["n"].min() >= 0.0
        assert max(abs(s.scalars[name]) for name in DEFECTS) < 1e-11
    if k_m == 0.0:
        assert snapshots[-1].scalars["n_total"] == pytest.approx(snapshots[0].scalars["n_total"], rel=1e-12)


def test_what_is_out_of_bounds_is_given_back_without_loss(make_lines):
    scheme = make_lines(5, 1e-3)
    for amounts in ([-1e-4, 0.2, 0.5, 2.0003, 1.0], [-1e-4, 0.2, 0.5, 1.9, 1.0], [0.2, 0.5, 2.0003, 1.0, 0.0]):
        y = scheme.initial()
        y[scheme.size], y[scheme.l], y[scheme.n] = 2.0, 0.2, amounts
        assert KERNEL["admit"](scheme.data(0.0), y, scheme.work.model) == 0
        inside = y[scheme.n]
        assert inside.min() >= 0.0
        assert inside.max() <= 2.0
        assert inside.sum() == pytest.approx(sum(amounts), rel=1e-15)
        assert np.max(np.abs(inside - amounts)) < 4e-4
    untouched = y.copy()
    assert KERNEL["admit"](scheme.data(0.0), y, scheme.work.model) == 0
    np.testing.assert_array_equal(y, untouched)
    for number, place, value in ((1, 0, -0.01), (1, 3, 2.01), (2, 1, -0.01), (3, scheme.size, 0.0)):
        y = untouched.copy()
        y[place] = value
        assert KERNEL["admit"](scheme.data(0.0), y, scheme.work.model) == number


def test_the_last_macrophage_dies_within_the_balances():
    """Where all macrophages die at once Newton's method leaves n above 1 by its tolerance: the uptake beyond the last of them is undone."""
    parameters = PlaqueParameters(Psi_l=0.5, Psi_m=0.0, k_l=2.0, k_m=50.0)
    result = simulate(parameters, initial=PlaqueInitial(n="0.3 + 0.2*xi", l=3.0, L=0.01), t_end=10.0, cells=10, rtol=1e-5)
    assert result["n"][-1].min() > 1.0 - 1e-12  # 1 but for rounding
    assert result["n"].max() <= 1.0
    for name in DEFECTS:
        assert np.abs(result[name]).max() < 1e-13  # a hundred roundings; 1e-9 when what is beyond 1 is cut off


@pytest.mark.parametrize("stops", [4, 5])
def test_stored_rows_at_a_jump_are_consistent(make_scheme, stops):
    """At a jump of the influx, an output time or the end, the row is the limit from before: L' = Psi_m l(0) in all of it."""
    scheme = make_scheme(12, 1e-3, Psi_l={"times": [0.0, 0.2, 0.2], "values": [1.0, 1.0, 0.1]})
    for t_end in (0.4, 0.2):
        snapshots, state = _run(scheme, t_end, stops=stops)
        for s in snapshots:
            assert s.scalars["L_rate"] == scheme.parameters.Psi_m * s.scalars["l_wall"]
        # what is stored is read off the wall balance; the state's own V obeys it to the iteration's tolerance
        assert snapshots[-1].scalars["L_rate"] == pytest.approx(state.u[0][scheme.size + 1], rel=1e-5)


def test_one_inviscid_phase_may_be_absent(make_scheme):
    for changes in ({"mu_n": 0.0, "n": 0.0}, {"mu_n": 0.0, "n": 0.0, "momentum": "drag", "p_out": 1.0}, {"mu_m": 0.0, "n": 1.0}):
        snapshots, _ = _run(make_scheme(10, 1e-2, **changes), 0.05, stops=1)
        assert np.isfinite(snapshots[-1].fields["u_n"]).all()
