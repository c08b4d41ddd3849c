"""The geometric conservation law of the transport operator, with velocities prescribed."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.fipy_newton import import_fipy
from multiphase.geometry import MovingGrid, relative_velocity
from multiphase.stepping import formula
from plaque1d.fipy_terms import NecroticTransport


def _transport(velocity, widths, times, let_through):
    """Carry a uniform fraction on a domain of the given widths with BDF2 steps; the fraction at the end.

    `velocity(V)` gives u_n on the faces; `let_through` opens the outer wall to the flux there.
    """
    fipy = import_fipy()
    grid = MovingGrid(16)
    mesh = fipy.Grid1D(nx=grid.cells, dx=grid.spacing)
    n = fipy.CellVariable(mesh=mesh, hasOld=True, value=0.37)
    width = fipy.CellVariable(mesh=mesh, hasOld=True, value=widths[0])
    transport = NecroticTransport(fipy, mesh, n, width)
    history_t, history_u = [times[0]], [np.append(widths[0] * n.value, widths[0])]
    for t, L in zip(times[1:], widths[1:], strict=True):
        alpha, past = formula(2, t, np.array(history_t), np.array(history_u))
        V = alpha * (L - past[-1])  # the time formula's own derivative of L
        for variable, old, new in ((n, past[:-1] / past[-1], history_u[0][:-1] / history_u[0][-1]), (width, past[-1], L)):
            variable.setValue(old)
            variable.updateOld()
            variable.setValue(new)
        relative = relative_velocity(velocity(grid.faces, V), grid.faces, V)
        for _ in range(60):  # the flux of a uniform n is linear in n; the explicit outer flux converges like a sweep
            value = n.value.copy()
            face = np.concatenate([value[:1], 0.5 * (value[:-1] + value[1:]), value[-1:]])
            flux = relative * face
            if not let_through:
                flux[-1] = 0.0
            transport.set_flux(relative, flux)
            transport.terms.solve(dt=1.0 / alpha)
            if np.max(np.abs(n.value - value)) < 1e-15:
                break
        history_t = [t, *history_t[:1]]
        history_u = [np.append(L * n.value, L), *history_u[:1]]
    return n.value.copy()


RNG = np.random.default_rng(3)
HISTORIES = {
    "steady growth, equal steps": (np.linspace(0.0, 1.0, 9), 0.5 + np.linspace(0.0, 1.0, 9)),
    "uneven steps, up and down": (np.cumsum(RNG.uniform(0.02, 0.04, 9)), RNG.uniform(0.6, 0.9, 9)),
}


@pytest.mark.parametrize("case", HISTORIES)
def test_uniform_stays_uniform_when_the_material_stands_still(case):
    times, widths = HISTORIES[case]
    n = _transport(lambda xi, V: 0.0 * xi, widths, times, let_through=True)
    # rounding of eight steps, each a difference of terms of order alpha L n = 100 over h = 1/16
    np.testing.assert_allclose(n, 0.37, rtol=1e-12)


@pytest.mark.parametrize("case", HISTORIES)
def test_uniform_dilutes_as_one_over_the_width_when_the_material_stretches(case):
    times, widths = HISTORIES[case]
    n = _transport(lambda xi, V: xi * V, widths, times, let_through=False)
    np.testing.assert_allclose(n, 0.37 * widths[0] / widths[-1], rtol=1e-12)


def test_a_wrong_wall_speed_is_seen():
    """With V from the wrong formula, the same check fails by far: the test above can fail."""
    times, widths = HISTORIES["steady growth, equal steps"]
    n = _transport(lambda xi, V: 0.1 * xi * V, widths, times, let_through=True)
    assert np.max(np.abs(n / 0.37 - 1.0)) > 0.01
