"""Growth rates of cosine modes about a uniform state: no influx, so cosines satisfy every condition exactly."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.stepping import Control, integrate, start
from plaque1d import equations as eq
from plaque1d.semidiscrete import KERNEL

N0, L0_LDL, WIDTH = 0.3, 0.6, 2.0
BASE = {"Psi_l": 0.0, "Psi_m": 0.0, "A": 1.0, "B": 0.8, "k": 2.0, "b": 4.0}
FORMS = {"interfacial": {"momentum": "interfacial"}, "drag": {"momentum": "drag", "p_out": 0.05}}
VISCOSITIES = {
    "equal": {"mu_n": 0.1, "mu_m": 0.1},
    "unequal": {"mu_n": 0.02, "mu_m": 0.3},
    "unequal, bulk": {"mu_n": 0.02, "lambda_n": 0.1, "mu_m": 0.3, "lambda_m": -0.2},
}


def _matrix(scheme, mode, cells):
    """Rates of change of the cosine amplitudes of (n, l) per amplitude, from the discrete right-hand side at t = 0."""
    amplitude = 1e-6
    cosine = np.cos(mode * np.pi * scheme.grid.centres)
    columns = []
    for part in (scheme.n, scheme.l):
        slopes = []
        for sign in (1.0, -1.0):
            u = scheme.initial()
            u[part] += sign * amplitude * WIDTH * cosine
            u = scheme.consistent(0.0, u)
            out = np.empty_like(u)
            KERNEL["rates"](scheme.data(0.0), 0.0, u, out, scheme.work.model)
            slopes.append(out / WIDTH)  # d/dt of the averages
        slope = (slopes[0] - slopes[1]) / (2.0 * amplitude)
        columns.append([2.0 * np.mean(slope[q] * cosine) for q in (scheme.n, scheme.l)])
    return np.array(columns).T


def _theory(parameters, mode):
    p = parameters
    q = mode * np.pi / WIDTH
    return eq.dispersion_matrix(q, N0, L0_LDL, p.k_l, p.k_m, p.b, p.nu_n, p.nu_m, p.A, p.B, p.k, p.p_out, p.momentum)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("viscosity", VISCOSITIES)
def test_matrix_of_growth_rates(make_lines, form, viscosity):
    """The third mode: 67 of 200 cells to half a wave, (q h)^2 = 2e-3 of which a twelfth is the usual error. In the second, transport
    and uptake happen to cancel in the drag form."""
    errors = []
    for cells in (50, 100, 200):
        scheme = make_lines(cells, n=N0, l=L0_LDL, L=WIDTH, k_l=1.5, k_m=0.7, **BASE, **FORMS[form], **VISCOSITIES[viscosity])
        exact = _theory(scheme.parameters, 3)
        errors.append(np.abs(_matrix(scheme, 3, cells) - exact) / np.abs(exact))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    transport = np.array([[True, True], [False, True]])  # k_l l c has no derivative, so no error falls there: it is rounding
    assert np.all(errors[-1] < 5e-4)  # what is asked: 0.05 per cent
    assert np.all(orders[:, transport] > 1.9)
    assert errors[-1][1, 0] < 1e-8  # rounding of a difference over 1e-6


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("viscosity", VISCOSITIES)
def test_a_long_run_of_a_mode_keeps_its_rate(make_lines, form, viscosity):
    """Radau up to t = 10, in which the second mode falls to 0.02 or grows to 70 times its size; without reactions its rate is constant."""
    t_end, amplitude, mode = 10.0, 1e-5, 2  # grown, 7e-4, it is still linear to its square
    n = f"{N0} + {amplitude}*cos({mode}*pi*xi)"
    errors = []
    for cells in (50, 100, 200):  # rtol is 1e-6 of the amplitude, and of the decayed one 5e-5, which divided by the exponent 4 is 1e-5
        scheme = make_lines(cells, 1e-11, n=n, l=L0_LDL, L=WIDTH, k_l=0.0, k_m=0.0, **BASE, **FORMS[form], **VISCOSITIES[viscosity])
        rate, control = _theory(scheme.parameters, mode)[0, 0], Control()
        state = integrate(scheme, start(scheme, 0.0, t_end, control), [0.0, t_end], control)
        cosine = np.cos(mode * np.pi * scheme.grid.centres)
        first, last = (2.0 * np.mean(u[scheme.n] / WIDTH * cosine) for u in (scheme.initial(), state.u[0]))
        errors.append(abs(np.log(last / first) / (rate * t_end) - 1.0))
    assert errors[-1] < 5e-4
    assert np.all(np.log2(np.array(errors[:-1]) / np.array(errors[1:])) > 1.9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("viscosity", ["equal", "unequal"])
def test_a_simulated_mode_grows_or_decays_as_it_should(make_scheme, form, viscosity):
    """FiPy with fixed steps. Without reactions a uniform state stands still, so the whole time course is known."""
    t_end, amplitude, mode = 2.0, 1e-4, 2
    n = f"{N0} + {amplitude}*cos({mode}*pi*xi)"
    errors = []
    for cells in (20, 40):
        scheme = make_scheme(cells, 1e-9, n=n, l=L0_LDL, L=WIDTH, k_l=0.0, k_m=0.0, **BASE, **FORMS[form], **VISCOSITIES[viscosity])
        rate = _theory(scheme.parameters, mode)[0, 0]
        assert abs(rate * t_end) > 0.05
        assert (rate > 0) == (form == "drag")  # the drag form with p_out below (1 - 2n) Sigma is unstable, the other never
        control = Control(dt=t_end / 40)
        state = integrate(scheme, start(scheme, 0.0, t_end, control), [0.0, t_end], control)
        cosine = np.cos(mode * np.pi * scheme.grid.centres)
        final = 2.0 * np.mean(state.u[0][scheme.n] / WIDTH * cosine)
        initial = 2.0 * np.mean(scheme.initial()[scheme.n] / WIDTH * cosine)
        errors.append(abs(np.log(final / initial) / (rate * t_end) - 1.0))
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] > 3.0  # h^2 gives 4; the time step leaves (rate dt)^2 / 3 < 1e-4


def test_a_lone_perturbation_of_n_leaves_the_width_alone(make_scheme):
    scheme = make_scheme(20, n=f"{N0} + 0.1*cos(pi*xi)", l=L0_LDL, L=WIDTH, k_l=0.0, k_m=0.0, **BASE)
    control = Control()
    state = integrate(scheme, start(scheme, 0.0, 0.5, control), [0.0, 0.5], control)
    assert state.u[0][scheme.size] == WIDTH
