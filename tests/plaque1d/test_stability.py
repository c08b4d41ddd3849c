"""Growth rates against their closed forms, the search for the worst wave against brute force, and what the run is warned about."""

from __future__ import annotations

import logging
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from multiphase.errors import ParameterError
from plaque1d import PlaqueInitial, PlaqueParameters, stability
from plaque1d import equations as eq

DEMO = PlaqueParameters(momentum="drag")
Q = np.logspace(-3, 4, 57)


def _sizes(low, high, zero=True):
    """Numbers over many orders of magnitude, and zero."""
    positive = some.floats(np.log10(low), np.log10(high)).map(lambda exponent: 10.0**exponent)
    return some.one_of(some.just(0.0), positive) if zero else positive


@some.composite
def _states(draw, momentum, viscous=False):
    """Admissible parameters with a uniform state."""
    mu = _sizes(1e-4, 1e2, zero=not viscous)
    p = PlaqueParameters(
        k_l=draw(_sizes(1e-3, 1e3)), k_m=draw(_sizes(1e-3, 1e3)), b=draw(_sizes(1e-2, 1e2, zero=False)), mu_n=draw(mu), mu_m=draw(mu),
        A=draw(_sizes(1e-4, 1e2)), B=draw(_sizes(1e-2, 1e3)), k=draw(some.floats(1.0, 8.0)), p_out=draw(some.floats(-1.0, 1.0)),
        momentum=momentum,
    )  # fmt: skip
    return p, draw(some.floats(0.0, 1.0)), draw(_sizes(1e-4, 1e2))


def _parts(p, n, l, q):
    """G, D1, c, Sigma and its slope, written out by hand."""
    c, power = 1.0 - n, l**p.k
    sigma = p.A / (1.0 + p.B * power)
    slope = -p.A * p.B * p.k * l ** (p.k - 1.0) / (1.0 + p.B * power) ** 2
    D1 = n * sigma if p.momentum == "interfacial" else p.p_out - (1.0 - 2.0 * n) * sigma
    return q**2 / (p.b + (p.nu_m * n + p.nu_n * c) * q**2), D1, c, sigma, slope


@pytest.mark.parametrize("momentum", ["drag", "interfacial"])
def test_without_reactions_the_two_waves_part(momentum):
    p = replace(DEMO, momentum=momentum, k_l=0.0, k_m=0.0, mu_m=0.3, p_out=0.02)
    G, D1, *_ = _parts(p, 0.3, 0.6, Q)
    rates = stability.growth_rates(p, 0.3, 0.6, Q)
    assert rates.shape == (len(Q), 2)
    assert np.all(rates.imag == 0.0)
    assert np.all(rates.real[:, 0] >= rates.real[:, 1])
    # modLDL does not feel n, so the eigenvalues are the diagonal: to rounding even where q^2 is 1e8 times the other
    np.testing.assert_allclose(rates.real, -np.sort(np.column_stack([G * D1, Q**2])), rtol=1e-14)


def test_growth_rates_are_the_eigenvalues():
    p = replace(DEMO, A=80.0, B=20.0, k=6.5, k_l=10.0, k_m=1e-3, b=0.5, mu_n=0.1, mu_m=0.2)  # waves of this state swing as they grow
    state = 0.28, 0.75
    swings = 0
    for q in np.logspace(-1, 2, 40):
        mine = stability.growth_rates(p, *state, q)[0]
        M = eq.dispersion_matrix(q, *state, p.k_l, p.k_m, p.b, p.nu_n, p.nu_m, p.A, p.B, p.k, p.p_out, p.momentum)
        numpys = np.linalg.eigvals(M)
        for part in (np.real, np.imag):
            assert np.abs(np.sort(part(mine)) - np.sort(part(numpys))).max() < 1e-12 * np.abs(M).max()
        swings += abs(mine[0].imag) > 0.0 and mine[0].real > 0.0
    assert swings > 0


def test_digits_survive_where_one_rate_dwarfs_the_other():
    """The eigenvalues' product is the determinant, in which nothing cancels here."""
    p, n, l = replace(DEMO, p_out=1e6), 0.3, 0.1
    q = np.logspace(-1, 2, 13)
    G, D1, c, _, slope = _parts(p, n, l, q)
    determinant = G * D1 * (q**2 + p.k_l * c) + p.k_m * l * q**2 + p.k_l * l * G * n * c * abs(slope)
    rates = stability.growth_rates(p, n, l, q)
    np.testing.assert_allclose(rates.prod(axis=1).real, determinant, rtol=1e-13)


@settings(max_examples=150, deadline=None)
@given(_states("interfacial"))
def test_the_interfacial_form_is_stable(case):
    p, n, l = case
    rates = stability.growth_rates(p, n, l, Q)
    # zero is the rate of q = 0; the rounding is that of k_l l k_m c, which cancels in the determinant
    assert rates.real.max() <= 1e-12 * (p.k_l + p.k_m * l)
    assert stability.most_dangerous(p, n, l) == stability.Mode(0.0, 0.0)
    assert stability.short_wave_rate(p, n, l) == 0.0
    assert not stability.ill_posed(p, n, l)


@settings(max_examples=150, deadline=None)
@given(_states("drag"))
def test_the_drag_form_is_unstable_exactly_where_determinant_or_trace_say_so(case):
    p, n, l = case
    G, D1, c, sigma, slope = _parts(p, n, l, Q)
    determinant = G * D1 * (Q**2 + p.k_l * c) + p.k_m * l * Q**2 + p.k_l * l * G * n * c * abs(slope)
    trace = -G * D1 - p.k_m * l - Q**2 - p.k_l * c
    largest = stability.growth_rates(p, n, l, Q)[:, 0].real
    size = G * (abs(p.p_out) + sigma) * (Q**2 + p.k_l * c) + p.k_m * l * (Q**2 + p.k_l * c) + p.k_l * l * G * n * c * abs(slope)
    clear = (np.abs(determinant) > 1e-9 * size) & (np.abs(trace) > 1e-9 * (Q**2 + size / Q**2))
    assert np.array_equal((largest > 0.0)[clear], ((determinant < 0.0) | (trace > 0.0))[clear])


@settings(max_examples=80, deadline=None)
@given(_states("drag", viscous=True))
def test_short_waves_reach_their_limit(case):
    p, n, l = case
    limit = -_parts(p, n, l, 1.0)[1] / (p.nu_m * n + p.nu_n * (1.0 - n)) - p.k_m * l
    assert stability.short_wave_rate(p, n, l) == pytest.approx(max(limit, 0.0), rel=1e-12, abs=1e-14)
    far = stability.growth_rates(p, n, l, 1e12)[0, 0].real  # corrections fall as 1/q^2; those of the parameters here are below 1e19
    assert far == pytest.approx(limit, rel=1e-4, abs=1e-4)


def test_the_largest_short_wave_rate_among_states():
    n, l = np.array([0.3, 0.1, 0.9]), np.array([0.0, 1.0, 0.0])
    # by hand: (1 - 0.6) 0.1 / 0.01 = 4; (1 - 0.2) 0.05 / 0.01 - 1 = 3; at n = 0.9 none grow
    assert [stability.short_wave_rate(DEMO, *state) for state in zip(n, l, strict=True)] == pytest.approx([4.0, 3.0, 0.0], rel=1e-13)
    assert stability.short_wave_rate(DEMO, n, l) == pytest.approx(4.0, rel=1e-13)


@settings(max_examples=80, deadline=None)
@given(_states("drag", viscous=True))
def test_no_wave_grows_faster_than_the_most_dangerous(case):
    p, n, l = case
    mode = stability.most_dangerous(p, n, l)
    q = np.logspace(-8, 9, 2000)
    rates = stability.growth_rates(p, n, l, q)[:, 0].real
    noise = 1e-11 * (p.k_m * l + p.k_l + 1.0)
    assert mode.rate >= rates.max() * (1.0 - 1e-8) - noise
    assert mode.rate <= rates.max() * (1.0 + 1e-3) + noise  # q on this grid is at most 1 % off, and the rate is flat at its maximum
    if 0.0 < mode.q < np.inf:
        assert stability.growth_rates(p, n, l, mode.q)[0, 0].real == pytest.approx(mode.rate, rel=1e-12)


def test_a_finite_wavelength():
    """Strong viscosity keeps short waves slow, uptake of modLDL makes long ones slow: in between lies a maximum."""
    p = replace(DEMO, mu_n=0.5, mu_m=0.5)
    mode = stability.most_dangerous(p, 0.3, 0.02)
    q = np.linspace(2.0, 3.0, 100_001)
    rates = stability.growth_rates(p, 0.3, 0.02, q)[:, 0].real
    assert mode.q == pytest.approx(q[np.argmax(rates)], abs=2e-5)
    assert mode.wavelength == pytest.approx(2.0 * np.pi / mode.q, rel=1e-15)
    assert mode.rate == pytest.approx(rates.max(), rel=1e-12)
    assert mode.rate > 1.2 * stability.short_wave_rate(p, 0.3, 0.02) > 0.0


def test_a_most_dangerous_wave_longer_than_every_scale_of_the_matrix():
    p = replace(DEMO, k_l=0.544, k_m=74.4, b=0.0863, mu_n=1.63, mu_m=2.5e-4, A=0.188, B=0.208, k=2.65)
    state = 0.029, 0.0064
    mode = stability.most_dangerous(p, *state)
    q = np.linspace(0.1, 0.17, 20_001)
    rates = stability.growth_rates(p, *state, q)[:, 0].real
    assert mode.q == pytest.approx(q[np.argmax(rates)], abs=1e-5)
    assert mode.rate == pytest.approx(rates.max(), rel=1e-9)
    assert mode.rate > 1e-3


def test_the_fastest_is_the_shortest_or_none():
    shortest = stability.most_dangerous(DEMO, 0.3, 0.0)
    assert (shortest.q, shortest.wavelength, shortest.grows) == (np.inf, 0.0, True)
    assert shortest.rate == pytest.approx(4.0, rel=1e-13)
    none = stability.most_dangerous(replace(DEMO, p_out=0.1), 0.3, 0.02)
    assert (none.q, none.wavelength, none.rate, none.grows) == (0.0, np.inf, 0.0, False)


def test_without_viscosity_there_is_no_bound():
    p = replace(DEMO, mu_n=0.0, mu_m=0.0)
    assert stability.short_wave_rate(p, 0.3, 0.02) == np.inf
    assert stability.short_wave_rate(p, 0.7, 0.02) == 0.0
    assert stability.most_dangerous(p, 0.3, 0.02) == stability.Mode(np.inf, np.inf)
    assert stability.most_dangerous(p, 0.7, 0.02) == stability.Mode(0.0, 0.0)
    assert stability.growth_rates(p, 0.3, 0.02, 1e6)[0, 0].real > 1e9
    one = replace(DEMO, mu_n=0.0)  # viscosity nu_m n: none where n = 0
    assert stability.short_wave_rate(one, [0.0, 0.3], 0.0) == np.inf
    assert stability.short_wave_rate(one, 0.3, 0.0) == pytest.approx(0.04 / 0.003, rel=1e-13)


def test_least_p_out_is_where_the_diffusivity_vanishes():
    n, l = np.meshgrid(np.linspace(0.0, 1.0, 7), np.linspace(0.0, 2.0, 5))
    least = stability.least_p_out(DEMO, n, l)
    assert least[0, 0] == DEMO.A
    assert least.max() == DEMO.A
    for state in zip(n.flat, l.flat, least.flat, strict=True):
        at = replace(DEMO, p_out=state[2])
        below = replace(DEMO, p_out=float(state[2]) - 1e-9)
        assert stability._diffusivity(at, *map(np.asarray, state[:2])) == 0.0
        assert not stability.ill_posed(at, *state[:2])
        assert stability.ill_posed(below, *state[:2])
        assert not stability.ill_posed(replace(below, momentum="interfacial"), *state[:2])


def test_region():
    interfacial = replace(DEMO, momentum="interfacial")  # the region is the drag form's in either case
    states = stability.region(interfacial, 11, 5, 2.0)
    assert states.n.tolist() == pytest.approx(np.linspace(0.0, 1.0, 11).tolist())
    assert states.l.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert states.D1.shape == states.rate.shape == states.ill_posed.shape == (5, 11)
    assert states.D1[2, 1] == pytest.approx(-0.8 * 0.05, rel=1e-13)  # n = 0.1, l = 1
    assert states.rate[2, 1] == pytest.approx(3.0, rel=1e-12)
    assert states.rate[4, 4] == 0.0  # n = 0.4, l = 2: short waves would grow at 2/3, but macrophages die at 2
    assert np.array_equal(states.ill_posed, np.broadcast_to(states.n < 0.5 - 1e-12, (5, 11)))
    assert not stability.region(replace(DEMO, p_out=DEMO.A), 11, 5, 2.0).ill_posed.any()
    inviscid = stability.region(replace(DEMO, mu_n=0.0, mu_m=0.0), 11, 5, 2.0)
    assert np.array_equal(inviscid.rate == np.inf, inviscid.ill_posed)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: stability.growth_rates(DEMO, -0.1, 0.0, 1.0), "n"),
        (lambda: stability.growth_rates(DEMO, float("nan"), 0.0, 1.0), "n"),
        (lambda: stability.most_dangerous(DEMO, 0.3, -1.0), "l"),
        (lambda: stability.most_dangerous(replace(DEMO, k=0.5), 0.3, 0.0), "parameters.k"),
        (lambda: stability.figure(DEMO, 1.5, 0.0), "n"),
        (lambda: stability.growth_rates(DEMO, 0.3, 0.0, [1.0, -1.0]), "q"),
        (lambda: stability.growth_rates(DEMO, 0.3, 0.0, np.inf), "q"),
        (lambda: stability.region(DEMO, 1, 5, 1.0), ""),
        (lambda: stability.region(DEMO, 5, 5, 0.0), ""),
    ],
)
def test_what_is_refused(call, named):
    with pytest.raises(ParameterError) as caught:
        call()
    assert caught.value.path == named


def test_a_run_is_warned_from_its_initial_state():
    initial = PlaqueInitial(n="0.9 - 0.6*xi", l=0.0)  # 0.3 at the outer wall: short waves grow at rate 4 there
    assert stability.drag_warning(DEMO, initial, 1.25) == ()
    (said,) = stability.drag_warning(DEMO, initial, 1.3)
    assert "exp(4 t), 5.2 e-foldings" in said
    assert "p_out of 0.1" in said
    assert stability.drag_warning(replace(DEMO, momentum="interfacial"), initial, 100.0) == ()
    (said,) = stability.drag_warning(replace(DEMO, mu_n=0.0), PlaqueInitial(n="0.5*xi", l=0.0), 1e-6)
    assert "without a bound" in said
    assert "inf" not in said.replace("interfacial", "")


def _watch(parameters, saved, caplog):
    tracker = stability.ShortWaves(parameters)
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        for t, n in saved:
            tracker.on_save(None, SimpleNamespace(t=t, fields={"n": np.array([0.9, n]), "l": np.zeros(2)}))
    return [record.getMessage() for record in caplog.records]


def test_a_run_is_warned_once_on_its_way(caplog):
    saved = [(0.0, 0.9), (1.0, 0.3), (1.2, 0.3), (1.3, 0.3), (9.0, 0.3)]
    (said,) = _watch(DEMO, saved[2:], caplog)  # 4 (1.3 - 0) = 5.2 is the first above 5
    assert "by t = 1.3:" in said
    assert "5 e-foldings" in said
    caplog.clear()
    assert _watch(DEMO, [*saved[:2], (1.1, 0.6)], caplog) == []  # 4 e-foldings


def test_a_run_is_warned_at_its_first_moment_without_a_bound(caplog):
    (said,) = _watch(replace(DEMO, mu_n=0.0), [(0.0, 0.0), (1.0, 0.0)], caplog)
    assert "by t = 0:" in said
    assert "without a bound" in said


STATES = {
    "shortest": (DEMO, 0.3, 0.1),
    "finite": (replace(DEMO, mu_n=0.5, mu_m=0.5), 0.3, 0.02),
    "inviscid": (replace(DEMO, mu_n=0.0, mu_m=0.0), 0.3, 0.02),
    "one inviscid": (replace(DEMO, mu_n=0.0), 0.2, 0.1),
    "cured": (replace(DEMO, p_out=0.1), 0.3, 0.02),
    "bare": (replace(DEMO, A=0.0, B=0.0, k_l=0.0, k_m=0.0), 0.0, 0.0),
}
SAID = {"shortest": "s → 3.54", "finite": "wavelength 2.59", "inviscid": "s → ∞", "one inviscid": "s → 27.2"}


@pytest.mark.parametrize("name", STATES)
def test_figure(name, tmp_path):
    parameters, n, l = STATES[name]
    picture = stability.figure(parameters, n, l)
    rates, states = picture.axes[:2]
    lines = {line.get_label().split(":")[0]: line for line in rates.lines if not line.get_label().startswith("_")}
    for form in ("drag", "interfacial"):
        q, drawn = lines[form].get_data()
        exact = stability.growth_rates(replace(parameters, momentum=form), n, l, q)[:, 0].real
        np.testing.assert_array_equal(drawn, exact)
    assert SAID.get(name, "nothing grows") in lines["drag"].get_label()
    assert "nothing grows" in lines["interfacial"].get_label()
    mode = stability.most_dangerous(parameters, n, l)
    assert not np.isfinite(mode.rate) or rates.get_ylim()[0] < mode.rate < rates.get_ylim()[1]
    assert rates.get_xscale() == "log"
    assert (rates.get_xlabel(), states.get_xlabel()) == ("wave number q", "necrotic fraction n")
    assert states.lines[-1].get_xydata().tolist() == [[n, l]]
    assert len(picture.axes) == (2 if name in ("cured", "bare") else 3)  # the third is the bar of colours
    picture.savefig(tmp_path / "stability.png")
    assert (tmp_path / "stability.png").stat().st_size > 10_000
