"""The reference plaque with py-pde: a custom PDE for the fields n, l and L on a grid over xi = x/L.

What py-pde cannot express naturally:

- A scalar unknown. L is a third field that stays uniform, and fills a third of the state.
- The slip equation. There is no implicit solve with variable coefficients inside a rate (`solve_poisson_equation` has constant
  ones), so Thomas' algorithm is written by hand. All fields live at cell centres, hence w does too.
- Limited upwind fluxes. The derivatives are central, forward or backward; n is carried by ``d_dx``, central, without a limiter. It is
  exact to second order and conservative, and enough while n is smooth as it is here; nothing damps what is not.
- The influx. A boundary condition sees its own field and t, neither L nor V. So the convective fluxes get the value 0 and diffusion
  the derivative 0 at both walls, and the influx is a source in the first cell.

py-pde's solvers are explicit, or implicit by fixed-point iteration, which diffusion limits to the same steps; ``solver="explicit"``
is its adaptive Runge-Kutta. Its door to scipy works best, and LSODA is the default: a dense difference Jacobian, which the compiled rate
makes cheap. BDF is as fast and, as nothing damps n, less accurate for its tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numba as nb
import numpy as np
from pde import CartesianGrid, FieldCollection, PDEBase, ScalarField
from pde.solvers import RungeKuttaSolver, ScipySolver

PSI_L, PSI_M = 1.0, 0.5
K_L, K_M = 2.0, 2.0
DRAG = 20.0
NU_N, NU_M = 1.0, 1.0
A, B, POWER = 0.5, 1.0, 1.0
FLOOR = 1e-5
T_END = 2.0
FIRST_STEP = 1e-6


@nb.njit
def wall_speed(l_first: float, half_cell: float) -> float:
    """V = Psi_m l_w, where l_w is the positive root of Psi_l = Psi_m l_w^2 - (l_0 - l_w) / half_cell."""
    load = l_first + half_cell * PSI_L
    return PSI_M * 2.0 * load / (1.0 + np.sqrt(1.0 + 4.0 * PSI_M * half_cell * load))


@nb.njit
def slip(n: np.ndarray, l: np.ndarray, L: float, V: float) -> np.ndarray:
    """Slip velocity at the cell centres, by Thomas' algorithm; the wall values sit half a cell outside."""
    cells = len(n)
    dx = L / cells
    n_safe, c_safe = np.maximum(n, FLOOR), np.maximum(1.0 - n, FLOOR)
    stress = A / (1.0 + B * np.maximum(l, 0.0) ** POWER)
    w_wall = V / c_safe[0]
    below, diagonal, above, load = np.zeros(cells), np.zeros(cells), np.zeros(cells), np.zeros(cells)
    for i in range(cells):
        lo, hi = max(i - 1, 0), min(i + 1, cells - 1)
        n_lo, n_hi = 0.5 * (n_safe[i] + n_safe[lo]), 0.5 * (n_safe[i] + n_safe[hi])
        c_lo, c_hi = 0.5 * (c_safe[i] + c_safe[lo]), 0.5 * (c_safe[i] + c_safe[hi])
        gather_lo = (NU_M * c_lo * n_safe[i] * n_safe[lo] + NU_N * n_lo * c_safe[i] * c_safe[lo]) / dx**2
        gather_hi = (NU_M * c_hi * n_safe[i] * n_safe[hi] + NU_N * n_hi * c_safe[i] * c_safe[hi]) / dx**2
        own_lo = (NU_M * c_lo * n_safe[i] ** 2 + NU_N * n_lo * c_safe[i] ** 2) / dx**2
        own_hi = (NU_M * c_hi * n_safe[i] ** 2 + NU_N * n_hi * c_safe[i] ** 2) / dx**2
        diagonal[i] = DRAG * n_safe[i] * c_safe[i] + own_lo + own_hi
        if i == 0:  # the value outside is 2 w_wall - w
            diagonal[i] += gather_lo
            load[i] += 2.0 * gather_lo * w_wall
        else:
            below[i] = -gather_lo
        if i == cells - 1:
            diagonal[i] += gather_hi
        else:
            above[i] = -gather_hi
        pull = (1.0 - n[hi]) * stress[hi] - (1.0 - n[lo]) * stress[lo]
        load[i] -= n_safe[i] * pull / ((hi - lo) * dx)
    for i in range(1, cells):
        factor = below[i] / diagonal[i - 1]
        diagonal[i] -= factor * above[i - 1]
        load[i] -= factor * load[i - 1]
    load[-1] /= diagonal[-1]
    for i in range(cells - 2, -1, -1):
        load[i] = (load[i] - above[i] * load[i + 1]) / diagonal[i]
    return load


class PlaquePDE(PDEBase):
    """Evolution of n, l and L in time at fixed xi."""

    explicit_time_dependence = False

    def evolution_rate(self, state: FieldCollection, t: float = 0.0) -> FieldCollection:
        """The rates as fields. The solvers take the compiled function below."""
        rates = state.copy()
        rates.data = self.make_evolution_rate(state, backend="numba")(state.data, t)
        return rates

    def make_evolution_rate(self, state: FieldCollection, backend: Any) -> Callable[[np.ndarray, float], np.ndarray]:
        """Function that a backend can compile."""
        grid = state.grid
        h = grid.discretization[0]
        xi = grid.axes_coords[0]
        slope = grid.make_operator("d_dx", bc={"value": 0.0}, backend=backend)
        laplace = grid.make_operator("laplace", bc={"derivative": 0.0}, backend=backend)

        def rate(fields: np.ndarray, t: float = 0.0) -> np.ndarray:
            n, l, L = fields[0], fields[1], fields[2, 0]
            c = 1.0 - n
            V = wall_speed(l[0], 0.5 * h * L)
            w = slip(n, l, L, V)
            carried = (1.0 - xi) * V
            met = L * l * c
            out = np.empty_like(fields)
            out[0] = (K_M * met - slope(n * (carried - c * w)) - n * V) / L
            l_gain = laplace(l) / L - slope(l * carried) - K_L * met
            l_gain[0] += PSI_L / h
            out[1] = (l_gain - l * V) / L
            out[2] = V
            return out

        return rate


def solve(cells: int, tolerance: float, solver: str = "LSODA") -> dict[str, object]:
    """Cell values of n and l, and L, at T = 2; `solver` is "explicit" for py-pde's own Runge-Kutta, or a method of scipy's."""
    grid = CartesianGrid([[0.0, 1.0]], cells)
    fields = [ScalarField.from_expression(grid, text) for text in ("0.1 + 0.05 * cos(pi * x)**2", "0.2", "0.5")]
    state = FieldCollection(fields)
    pde = PlaquePDE()

    compiling = time.perf_counter()
    if solver == "explicit":
        method = RungeKuttaSolver(pde, backend="numba", adaptive=True, tolerance=tolerance)
    else:
        method = ScipySolver(pde, backend="numba", method=solver, rtol=tolerance, atol=tolerance)
    advance = method.make_stepper(state, dt=FIRST_STEP)
    advance(state.copy(), 0.0, FIRST_STEP)
    started = time.perf_counter()
    advance(state, 0.0, T_END)
    seconds = time.perf_counter() - started
    n, l, L = state.data
    note = f"{solver}, compiled in {started - compiling:.1f} s before"
    return {"n": n.copy(), "l": l.copy(), "L": float(L[0]), "seconds": seconds, "note": note}
