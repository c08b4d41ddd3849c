r"""The linear evolution of modes cos(k theta) on a growing radial disk, and of modes Y_l on a ball, discrete.

Unknowns of a cell: alpha_1, C_1 and p_1 at its middle, V at its middle, U on its outer face; besides U at the centre, which is held (for
k = 1 that takes out shifts of the whole body), and V on the surface. With the symbols of `tumour.stability` and `tumour.radial`, w the
velocity of the faces of the radial state, ``zeta = 1/M`` and its slope zeta' in alpha, and Delta over a cell of volume dV, R h per radian
in a disk (m = 2) and R^2 h + h^3/12 per steradian in a ball (m = 3, ``k = sqrt(l (l + 1))``),

    d(J alpha_1 + alpha j)/dt = q j + J (q_a alpha_1 + q_C C_1)
    dV dj/dt = Delta Phi + k h R^(m-2) f_t                                       or p_1 = 0 where kappa = 0
    0 = Delta Phi^C + k h R^(m-2) f_t^C - dV ( u j + J (u_a alpha_1 + u_C C_1) ) u the uptake
    0 = d/d(U, V) [ sum of H p(H)/2 - T_1 j over cells and faces ]               U and V in equilibrium, the surface without traction

    Phi = (a/(zeta Delta rho)) Delta p_1 + w r^(m-2) ((m-1) U + k V) - (a w/Delta rho) Delta U_rho - (a w/zeta) zeta' alpha_1
    f_t = -(k/R) l_r l_t^(m-3) p_1/zeta - (r/R)^(m-2) w (H_tr + (l_r/l_t) H_rt),       the second part the mean of the cell's faces
    w   = Delta p/(zeta Delta rho),       a = r^(m-1),       Phi is R^(m-1) f_r on faces

and Phi^C, f_t^C are the same with zeta = 1, C for p. For k = 0 these are the derivatives of the equations of `tumour.radial`, term by term.
In time: BDF of order two with steps that grow to dt (`ladder`); it is J alpha_1 + alpha j and j that are differentiated, with the
radial state taken at the new time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_banded

from multiphase.errors import ParameterError
from multiphase.parameters import float_or_refuse
from multiphase.stepping import formula
from tumour import equations as eq
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.stability.operators import Matrix, Pattern, grid, unit
from tumour.stability.state import RadialState, contact_slope, given, radial_states, round_body
from tumour.stability.stiffness import Shape, Stiffness, elastic_terms, grid_moduli, of_states

Array = NDArray[np.float64]

FIRST, LAYER = 1e-4, 1.0
"""Steps are as many per unit of ln t between these two times as they are per unit of t later on."""


@dataclass(frozen=True, slots=True)
class ModeGrowth:
    """How small departures from the round shape grow.

    The disk begins with the cell fraction ``alpha_0 + eps (R/R_0)^n cos(k theta)``, and its surface is then at ``r + eps U cos(k theta)``,
    up to terms of order eps^2. For a ball read Y_l, a spherical harmonic of degree l and any order, for cos(k theta); it moves by
    ``-eps V grad Y_l/sqrt(l (l + 1))`` across the radius.

    Where the drained stiffness against a mode passes 0 its growth gets faster than most steps, and values depend on them from there on;
    from the zero of the undrained stiffness on rates have no bound and values are NaN.

    Attributes
    ----------
    t : (nt,) array
        Times of the steps.
    radius : (nt,) array
        Radius r of the surface.
    wave_numbers : (nk,) int array
        Degrees, for a ball.
    exponents : (nk,) array
        n of each seed.
    amplitude, tangential : (nt, nk) array
        U and V at the surface: the displacements along and across the radius, per eps.
    stiffness : Stiffness
        At some of the times.
    m : int
        2 for a disk, 3 for a ball.
    """

    t: Array
    radius: Array
    wave_numbers: NDArray[np.int64]
    exponents: Array
    amplitude: Array
    tangential: Array
    stiffness: Stiffness
    m: int = 2

    @property
    def shape(self) -> Array:
        """U/r, the departure from the round shape per eps."""
        return self.amplitude / self.radius[:, None]

    @property
    def rate(self) -> Array:
        """Growth rate of U/r, from differences between the steps; NaN where U is 0, and where it changes its sign from one step to the
        next, as it may where it grows faster than the steps."""
        shape = self.shape
        turns = np.zeros(shape.shape, dtype=bool)
        with np.errstate(invalid="ignore"):
            across = shape[1:] * shape[:-1] < 0.0
        turns[1:] |= across
        turns[:-1] |= across
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(turns | (shape == 0.0), np.nan, np.gradient(shape, self.t, axis=0, edge_order=2) / shape)

    def at(self, t: float) -> Array:
        """U at the surface at a time, interpolated linearly between the steps: one for each wave number."""
        return np.array([np.interp(t, self.t, column) for column in self.amplitude.T])


def modes(
    parameters: TumourParameters | None = None,
    *,
    initial: TumourInitial | None = None,
    geometry: str | Mapping[str, Any] | TumourGeometry = "disk",
    wave_numbers: Sequence[int] | None = None,
    t_end: float,
    seed: float | None = None,
    cells: int = 100,
    dt: float = 0.2,
    rows: int = 61,
) -> ModeGrowth:
    """The linear evolution of departures cos(k theta) from the round shape of a growing disk, or Y_l of a ball, from a seed in the cell
    fraction.

    Parameters
    ----------
    parameters : TumourParameters, optional
        The paper's by default.
    initial : TumourInitial, optional
        The radial state at t = 0.
    geometry : str, mapping or TumourGeometry
        "disk", "quarter_disk", which admits even wave numbers only, or "sphere".
    wave_numbers : sequence of int, optional
        k, or the degrees l of a sphere: 0 or more; 2 to 8 by default. 0 is a change of the radial state itself.
    t_end : float
    seed : float, optional
        n of the seed (R/R_0)^n cos(k theta), or Y_l; k or l by default.
    cells, dt : int, float
        Cells of the radial grid, and largest step. Errors fall as their squares.
    rows : int
        Times at which stiffness is found, evenly spread; with 1, at the end alone.

    Returns
    -------
    ModeGrowth

    Raises
    ------
    ParameterError
        For values that cannot be used, by name.
    SolverError
        Where the radial run cannot go on.
    """
    geometry, chosen = round_body(geometry, wave_numbers, 0, cells)
    p, initial = given(parameters, initial)
    for name, value in (("t_end", t_end), ("dt", dt)):
        if not 0.0 < float_or_refuse(value, name) < np.inf:
            raise ParameterError(name, f"{value:g} must be greater than 0.")
    if seed is not None and not 0.0 <= seed < np.inf:
        raise ParameterError("seed", f"{seed:g} must be 0 or more, the power of R that the seed is.")
    times = ladder(t_end, dt)
    states = radial_states(p, initial, geometry, times.tolist(), cells)
    exponents = np.array([float(k if seed is None else seed) for k in chosen])
    edges = np.array([evolve(p, states, k, n) for k, n in zip(chosen, exponents, strict=True)])
    wanted = np.unique(np.searchsorted(times, np.linspace(0.0, t_end, max(rows, 1)) if rows > 1 else [t_end]))
    shown = of_states(p, [states[i] for i in wanted], [k for k in chosen if k > 0])
    radius = np.array([state.r[-1] for state in states])
    return ModeGrowth(times, radius, np.array(chosen), exponents, edges[:, :, 0].T, edges[:, :, 1].T, shown, geometry.m)


def ladder(t_end: float, dt: float) -> Array:
    """Times of the steps: about ``dt (t + FIRST)/(t + LAYER)`` each, so that they resolve at all its sizes the layer that the pressure of
    the fluid has at the surface at first, grow to dt, and all halve with dt."""
    t = np.concatenate([[0.0], np.geomspace(1e-2 * FIRST, t_end, 20_000)])
    s = t + (LAYER - FIRST) * np.log1p(t / FIRST)
    times: Array = np.interp(np.linspace(0.0, s[-1], int(np.ceil(s[-1] / dt)) + 1), s, t)
    return times


def evolve(parameters: TumourParameters, states: Sequence[RadialState], k: int, exponent: float) -> Array:
    """U and V at the surface, (nt, 2), for the seed (R/R_0)^exponent cos(k theta), or Y_k; the states are those at the steps' times."""
    radius, cells, m = float(states[0].R[-1]), len(states[0].J), states[0].m
    mode = Mode(parameters, radius, cells, k, m)
    sealed = Shape(parameters, radius, cells, k, drained=False, m=m) if k > 0 else None
    past = [np.stack([seed_of(states[0].R, exponent, m), np.zeros(mode.N)])]  # J alpha_1 + alpha j, and j, newest first
    times, edges = [0.0], np.full((len(states), 2), np.nan)
    edges[0] = 0.0
    for n, state in enumerate(states[1:], 1):
        if sealed is not None and not sealed.exceeds(state, 0.0):
            break
        a, mean = formula(2, state.t, np.array(times), np.array(past))
        y = mode.solve(state, a, mean)
        past, times = [mode.kept(state, y), *past[:1]], [state.t, *times[:1]]
        edges[n] = y[mode.edge]
    return edges


def seed_of(R: Array, exponent: float, m: int = 2) -> Array:
    """The averages of (R/R_0)^exponent over the cells between the faces R."""
    x = R / R[-1]
    averages: Array = m / (exponent + m) * np.diff(x ** (exponent + m)) / np.diff(x**m)
    return averages


class Mode:
    """One implicit step of one mode: the equations above, on N cells of a disk with some radius at rest, for a wave number (of a ball: a
    degree)."""

    def __init__(self, parameters: TumourParameters, radius: float, N: int, number: int, m: int = 2) -> None:
        self.parameters, self.N, self.on = parameters, N, grid(radius, N, number, m)
        self.edge = np.array([N, 2 * N + 1])
        self._shape = slice(0, 2 * N + 2)
        self._alpha, self._C, self._p = (slice(start, start + N) for start in self._starts)
        cell = 5 * np.arange(N)
        self._order = np.concatenate([[0], cell + 5, cell + 4, [5 * N + 1], cell + 1, cell + 2, cell + 3])  # of U, V, alpha_1, C_1, p_1
        self._pattern = Pattern(self._terms(), self._order, held=[0] if number > 0 else [0, *range(N + 1, 2 * N + 2)])

    @property
    def _starts(self) -> tuple[int, int, int]:
        """Where alpha_1, C_1 and p_1 begin among the unknowns."""
        return 2 * self.N + 2, 3 * self.N + 2, 4 * self.N + 2

    def _on_all(self, operator: Matrix, start: int = 0) -> Matrix:
        """An operator on some of the unknowns as one on all of them."""
        entries = sparse.coo_array(operator)
        shape = (entries.shape[0], 5 * self.N + 2)
        return sparse.csr_array((entries.data, (entries.row, entries.col + start)), shape=shape)

    def _terms(self) -> list[tuple[str, Matrix, Matrix]]:
        on, eye = self.on, unit(self.N, self.N)
        alpha, C, p = (self._on_all(eye, start) for start in self._starts)
        terms = [(name, self._on_all(a), self._on_all(b)) for name, a, b in elastic_terms(on)]
        rr, tt = self._on_all(on.H_rr), self._on_all(on.H_tt)
        terms += [("load_r", rr, p), ("load_t", tt, p), ("contact_r", rr, alpha), ("contact_t", tt, alpha)]
        for row, name in ((alpha, "cells"), (C, "oxygen"), (p, "fluid")):
            terms += [(f"{name}_r", row, rr), (f"{name}_t", row, tt)]
        terms += [("cells_a", alpha, alpha), ("cells_C", alpha, C), ("oxygen_a", C, alpha), ("oxygen_C", C, C), ("no_flow", p, p)]
        terms += self._transport("fluid", self._starts[2]) + self._transport("oxygen", self._starts[1])
        over, above = self._on_all(_over_faces(self.N), self._starts[2]), unit(self.N, self.N, 1)
        return [*terms, ("drag_below", over, alpha), ("drag_above", over, self._on_all(above, self._starts[0]))]

    def _transport(self, name: str, start: int) -> list[tuple[str, Matrix, Matrix]]:
        """What leaves the cells: ``-Delta Phi - k h R^(m-2) f_t`` but for the part of the resistance; Delta over a cell is minus the
        transpose of that over a face."""
        N, k, h, on = self.N, self.on.k, float(self.on.R[1]), self.on
        over, cells = self._on_all(_over_faces(N), start), self._on_all(unit(N, N), start)
        moved = (on.m - 1) * self._on_all(on.U) + k * self._on_all(on.V)
        means = self._on_all(0.5 * k * h * (unit(N, N) + unit(N, N, 1)), start)  # face f counts in cells f - 1 and f
        return [
            (f"{name}_leak", over, over), (f"{name}_carry", over, moved), (f"{name}_gap", over, self._on_all(on.gap)),
            (f"{name}_side", cells, cells), (f"{name}_swirl_tr", means, self._on_all(on.H_tr)),
            (f"{name}_swirl_rt", means, self._on_all(on.H_rt)),
        ]  # fmt: skip

    def coefficients(self, state: RadialState, a: float) -> dict[str, Array]:
        """What the operators are weighed with, for the step of the BDF formula with coefficient a."""
        p, on = self.parameters, self.on
        mu, lam = p.moduli
        J, alpha = state.J, state.alpha
        elastic = grid_moduli(state, mu, lam)._asdict()
        found = {name: (on.faces if name in ("shear", "turn") else on.cells) * values for name, values in elastic.items()}
        slope = contact_slope(p, state)
        born, (born_a, born_C) = eq.net_growth(alpha, state.C, *p.kinetics), eq.net_growth_slopes(alpha, state.C, *p.kinetics)
        taken, (taken_a, taken_C) = eq.oxygen_uptake(alpha, state.C, *p.uptake), eq.oxygen_uptake_slopes(alpha, state.C, *p.uptake)
        flows = p.kappa > 0.0
        for end, other in zip(("r", "t"), state.swelling, strict=True):
            found |= {f"load_{end}": -on.cells * other, f"contact_{end}": -on.cells * other * slope}
            found |= {f"cells_{end}": (a * alpha - born) * other, f"oxygen_{end}": on.cells * taken * other}
            found |= {f"fluid_{end}": a * on.cells * other * flows}
        found |= {"cells_a": J * (a - born_a), "cells_C": -J * born_C, "no_flow": np.full(self.N, 0.0 if flows else 1.0)}
        found |= {"oxygen_a": on.cells * J * taken_a, "oxygen_C": on.cells * J * taken_C}
        found |= self._fluxes("oxygen", state, state.C, p.C_out, np.ones(self.N), 1.0)
        return found | self._flow(state, flows)

    def _flow(self, state: RadialState, flows: bool) -> dict[str, Array]:
        """The coefficients of the flow of the fluid; zeros where it flows freely."""
        p, none = self.parameters, np.zeros(self.N)
        if not flows:
            names = [f"fluid_{end}" for end in ("leak", "carry", "gap", "side", "swirl_tr", "swirl_rt")]
            return dict.fromkeys([*names, "drag_below", "drag_above"], none)
        zeta = np.asarray(eq.resistance(state.alpha, *p.flow))
        zeta_a = np.asarray(eq.resistance_slope(state.alpha, *p.flow))
        face = np.append(0.5 * (zeta[1:] + zeta[:-1]), zeta[-1])
        found = self._fluxes("fluid", state, state.p, p.p_out, zeta, face)
        push = -state.r[1:] * found["fluid_carry"] / face
        below, above = np.append(np.full(self.N - 1, 0.5), 1.0), np.append(np.full(self.N - 1, 0.5), 0.0)
        return found | {"drag_below": push * below * zeta_a, "drag_above": push * above * np.append(zeta_a[1:], 0.0)}

    def _fluxes(self, name: str, state: RadialState, c: Array, outside: float, zeta: Array, face: Array | float) -> dict[str, Array]:
        """The coefficients of a flux that is driven by differences of c, with the resistance zeta in the cells and `face` on the faces."""
        on, m = self.on, state.m
        l_r, l_t = state.face_stretches
        r, gaps = state.r[1:], state.gaps
        w = np.diff(c, append=outside) / (face * gaps) * r ** (m - 2)
        leak = r ** (m - 1) / (face * gaps)
        side = on.k**2 * on.R[1] / on.middles * state.l_r / state.l_t / zeta * (on.middles * state.l_t) ** (m - 2)
        values = {"leak": leak, "carry": w, "gap": -r * w / gaps, "side": side, "swirl_tr": w, "swirl_rt": w * l_r / l_t}
        return {f"{name}_{end}": value for end, value in values.items()}

    def solve(self, state: RadialState, a: float, past: Array) -> Array:
        """U, V, alpha_1, C_1 and p_1 of the step ``a (kept - past) = ...`` to `state`."""
        right = np.zeros(5 * self.N + 2)
        right[self._alpha] = a * past[0]
        right[self._p] = a * self.on.cells * past[1] if self.parameters.kappa > 0.0 else 0.0
        ordered, pattern = np.empty(right.size), self._pattern
        ordered[self._order] = right
        band = pattern.band(self.coefficients(state, a))
        found: Array = solve_banded((pattern.lower, pattern.upper), band, ordered, overwrite_ab=True, overwrite_b=True, check_finite=False)
        unordered: Array = found[self._order]
        return unordered

    def kept(self, state: RadialState, y: Array) -> Array:
        """``J alpha_1 + alpha j`` and j, (2, N)."""
        shape = y[self._shape]
        by_r, by_t = state.swelling
        j = by_r * (self.on.H_rr @ shape) + by_t * (self.on.H_tt @ shape)
        return np.stack([state.J * y[self._alpha] + state.alpha * j, j])


def _over_faces(N: int) -> Matrix:
    """The difference over the faces 1 to N of what is in cells, and 0 beyond the surface."""
    return unit(N, N, 1) - unit(N, N)
