"""How stiff a radial disk is against changes of shape cos(k theta), or a ball against spherical harmonics, and when it no longer is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf

from multiphase.errors import ParameterError
from multiphase.parameters import float_or_refuse
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.stability.linear import Moduli, moduli
from tumour.stability.operators import Grid, Matrix, Pattern, grid
from tumour.stability.state import RadialState, between, contact_slope, given, radial_states, round_body

Array = NDArray[np.float64]

SEALED = 1e6
"""Bulk modulus, in units of mu, that stands for a volume that cannot change; it leaves 1e-6 of the stiffness."""
ACCURACY = 1e-7
"""Absolute accuracy to which stiffness is found."""
SPACING = 0.25
"""Time between the radial states among which the first zero is looked for, and interpolated."""


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Stiffness by time and wave number, in units of mu.

    Attributes
    ----------
    t : (nt,) array
    wave_numbers : (nk,) int array
        Degrees, for a ball.
    drained, undrained : (nt, nk) array
        The least of the second variation over the integral of the square of H, among changes of shape cos(k theta), or Y_l: when fluid has
        time to flow and cells have none to grow, and when neither has.
    m : int
        2 for a disk, 3 for a ball.
    """

    t: Array
    wave_numbers: NDArray[np.int64]
    drained: Array
    undrained: Array
    m: int = 2


@dataclass(frozen=True, slots=True)
class CriticalTime:
    """When the stiffness against each change of shape is first 0; NaN where it is not, up to the end.

    Attributes
    ----------
    wave_numbers : (nk,) int array
        Degrees, for a ball.
    drained, undrained : (nk,) array
    t_end : float
    m : int
        2 for a disk, 3 for a ball.
    """

    wave_numbers: NDArray[np.int64]
    drained: Array
    undrained: Array
    t_end: float
    m: int = 2

    @property
    def first(self) -> tuple[float, int]:
        """The first drained zero, and its wave number or degree; NaN and 0 where there is none."""
        if np.all(np.isnan(self.drained)):
            return np.nan, 0
        at = int(np.nanargmin(self.drained))
        return float(self.drained[at]), int(self.wave_numbers[at])


class Shape:
    """The second variation of a disk's energy against cos(k theta), or of a ball's against Y_k, drained or not, for any of its states.

    Parameters
    ----------
    parameters : TumourParameters
    radius : float
        At rest.
    cells, k : int
        The wave number k (of a ball: the degree) is 1 or more; for 1 the centre is held, which takes out shifts of the whole body.
    drained : bool
    m : int
        2 for a disk, 3 for a ball.
    """

    def __init__(self, parameters: TumourParameters, radius: float, cells: int, k: int, *, drained: bool = True, m: int = 2) -> None:
        self.parameters, self.drained = parameters, drained
        self._pattern, self._weights = _pattern(radius, cells, k, m)
        one, zero = np.ones(cells), np.zeros(cells)
        self._unit = self._pattern.band(self._weighted(Moduli(one, zero, (m - 1) * one, one, zero, one)), held=0.0)

    def _weighted(self, at: Moduli) -> dict[str, Array]:
        """The moduli, normal ones in cells and shear ones on faces, times the areas around those."""
        cells, faces = self._weights
        return {name: (faces if name in ("shear", "turn") else cells) * values for name, values in at._asdict().items()}

    def _bands(self, state: RadialState) -> tuple[Array, float]:
        """The matrix, and a lower bound of its eigenvalues: the least that its moduli have anywhere."""
        p = self.parameters
        mu, lam = p.moduli
        bulk: float | Array = 0.0
        if self.drained:
            bulk = lam + state.alpha / state.J * contact_slope(p, state)
        at, ways = grid_moduli(state, mu, bulk), state.m - 1
        normal = 0.5 * (at.rr + at.tt / ways) - np.hypot(0.5 * (at.rr - at.tt / ways), at.rt / np.sqrt(ways))
        least = min(float(np.min(normal)), float(np.min(mu - np.abs(at.turn))))
        if state.m == 3:
            least = min(least, float(np.min(at.side)))
        if not self.drained:
            at = grid_moduli(state, mu, SEALED * mu)
        return self._pattern.band(self._weighted(at)), least

    def _exceeds(self, band: Array, level: float) -> bool:
        _, info = dpbtrf((band - level * self._unit)[self._pattern.upper :], lower=1, overwrite_ab=1)
        return bool(info == 0)

    def exceeds(self, state: RadialState, level: float) -> bool:
        """Whether the stiffness is above `level` (in units of mu): one factorisation, far cheaper than its value."""
        return self._exceeds(self._bands(state)[0], level * self.parameters.mu_alpha)

    def value(self, state: RadialState) -> float:
        """The stiffness in units of mu, by bisection with the sign of the least eigenvalue of ``A - s B``."""
        band, low = self._bands(state)
        mu = self.parameters.mu_alpha
        low, high = min(low, 0.0) - mu * ACCURACY, 2.0 * mu
        while self._exceeds(band, high):
            low, high = high, 2.0 * high
        while high - low > mu * ACCURACY:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._exceeds(band, middle) else (low, middle)
        return 0.5 * (low + high) / mu


def grid_moduli(state: RadialState, mu: float, bulk: float | Array) -> Moduli:
    """The second variation per volume at rest, ``rr H_rr^2 + 2 rt H_rr H_tt + tt H_tt^2 + side H_s^2`` in cells and
    ``shear (H_rt^2 + H_tr^2) + 2 turn H_rt H_tr`` on faces, with H as `operators.Grid` has it.

    In a ball rr, rt and tt are those of `tumour.radial`, whose l_t in a cell is no linear function of the radii of its faces (see
    `RadialState.hoop`): they differ by terms of order h^2 from what `moduli` gives.
    """
    m, l_r, l_t = state.m, state.l_r, state.l_t
    at = moduli(l_r, l_t, state.g, mu, bulk, m)._replace(turn=face_turn(state, mu))
    if m == 2:
        return at
    mean, slope = state.hoop
    R, r, h = 0.5 * (state.R[1:] + state.R[:-1]), state.rho, state.R[1]
    # P_t times the second change of l_t, which is bent (h r H_rr - h l_r R H_tt)^2
    bent = 0.75 / (l_t**3 * (3.0 * R**2 + 0.25 * h**2) ** 2) * (m - 1) * (mu * (l_t - 1.0 / l_t) + state.g * l_r * l_t)
    along, across = h * r, -h * l_r * R
    return at._replace(
        rr=at.rr + (m - 1) * slope * (2.0 * at.rt + slope * at.tt) + bent * along**2,
        rt=(m - 1) * mean * (at.rt + slope * at.tt) + bent * along * across,
        tt=(m - 1) * mean**2 * at.tt + bent * across**2,
    )


def face_turn(state: RadialState, mu: float) -> Array:
    """`Moduli.turn` on the faces 1 to N; on the surface ``mu l_r/l_t``, since P_rr is 0 there."""
    l_r, l_t = state.face_stretches
    turn: Array = mu / (l_r * l_t) - 0.5 * (state.g + np.append(state.g[1:], state.g[-1])) * l_t ** (state.m - 2)
    turn[-1] = mu * l_r[-1] / l_t[-1]
    return turn


def elastic_terms(on: Grid) -> list[tuple[str, Matrix, Matrix]]:
    """The pairs of changes of shape that each of `Moduli` weighs."""
    rr, tt, rt, tr = on.H_rr, on.H_tt, on.H_rt, on.H_tr
    normal = [("rr", rr, rr), ("rt", rr, tt), ("rt", tt, rr), ("tt", tt, tt)]
    shear = [("shear", rt, rt), ("shear", tr, tr), ("turn", rt, tr), ("turn", tr, rt)]
    return [*normal, *shear] if on.m == 2 else [*normal, *shear, ("side", on.H_s, on.H_s)]


@lru_cache(maxsize=32)
def _pattern(radius: float, cells: int, k: int, m: int) -> tuple[Pattern, tuple[Array, Array]]:
    """The banded pattern for unknowns U_0, V_0, U_1, V_1, ..., U_N, V_surface, and the areas of cells and faces."""
    on = grid(radius, cells, k, m)
    order = np.concatenate([2 * np.arange(cells + 1), 2 * np.arange(cells + 1) + 1])
    return Pattern(elastic_terms(on), order, held=[0], symmetric=True), (on.cells, on.faces)


def stiffness(
    parameters: TumourParameters | None = None,
    *,
    initial: TumourInitial | None = None,
    geometry: str | Mapping[str, Any] | TumourGeometry = "disk",
    wave_numbers: Sequence[int] | None = None,
    times: Sequence[float],
    cells: int = 100,
) -> Stiffness:
    """Stiffness of a growing disk against changes of shape cos(k theta), or of a growing ball against Y_l, at some times.

    Parameters
    ----------
    parameters : TumourParameters, optional
        The paper's by default.
    initial : TumourInitial, optional
    geometry : str, mapping or TumourGeometry
        "disk", "quarter_disk", which admits even wave numbers only, or "sphere".
    wave_numbers : sequence of int, optional
        k, or the degrees l of a sphere: 1 or more; 2 to 8 by default.
    times : sequence of float
        Increasing, 0 or more.
    cells : int
        Of the radial grid; errors fall as 1/cells^2.
    """
    geometry, chosen = round_body(geometry, wave_numbers, 1, cells)
    p, initial = given(parameters, initial)
    try:
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
    except (TypeError, ValueError):
        wanted = np.zeros(0)
    if not (wanted.size and wanted[0] >= 0.0 and np.all(np.diff(wanted) > 0.0) and np.isfinite(wanted[-1])):
        raise ParameterError("times", "must be one time or more, 0 or later and increasing.")
    from_rest = [0.0, *wanted[wanted > 0.0].tolist()]
    states = radial_states(p, initial, geometry, from_rest, cells)
    return of_states(p, states if wanted[0] == 0.0 else states[1:], chosen)


def of_states(parameters: TumourParameters, states: Sequence[RadialState], wave_numbers: Sequence[int]) -> Stiffness:
    """Stiffness of radial states against some changes of shape."""
    radius, cells, m = float(states[0].R[-1]), len(states[0].J), states[0].m
    drained, undrained = (
        np.array([[Shape(parameters, radius, cells, k, drained=drained, m=m).value(state) for k in wave_numbers] for state in states])
        for drained in (True, False)
    )
    return Stiffness(np.array([state.t for state in states]), np.array(wave_numbers), drained, undrained, m)


def critical_time(
    parameters: TumourParameters | None = None,
    *,
    initial: TumourInitial | None = None,
    geometry: str | Mapping[str, Any] | TumourGeometry = "disk",
    wave_numbers: Sequence[int] | None = None,
    t_end: float,
    cells: int = 100,
) -> CriticalTime:
    """When a growing disk is first no longer stiff against changes of shape cos(k theta), or a growing ball against Y_l; parameters as
    those of `stiffness`."""
    geometry, chosen = round_body(geometry, wave_numbers, 1, cells)
    p, initial = given(parameters, initial)
    if not 0.0 < float_or_refuse(t_end, "t_end") < np.inf:
        raise ParameterError("t_end", "must be greater than 0.")
    times = np.linspace(0.0, t_end, max(2, int(np.ceil(t_end / SPACING)) + 1))
    states = radial_states(p, initial, geometry, times.tolist(), cells)
    shapes = [[Shape(p, geometry.radius, cells, k, drained=drained, m=geometry.m) for k in chosen] for drained in (True, False)]
    drained, undrained = (np.array([first_zero(shape, states) for shape in row]) for row in shapes)
    return CriticalTime(np.array(chosen), drained, undrained, t_end, geometry.m)


def first_zero(shape: Shape, states: Sequence[RadialState]) -> float:
    """The time of the first zero of the stiffness among states that follow one another, NaN if there is none."""
    last = None
    for state in states:
        if not shape.exceeds(state, 0.0):
            return state.t if last is None else _zero(shape, last, state)
        last = state
    return np.nan


def _zero(shape: Shape, first: RadialState, second: RadialState) -> float:
    """The time between two states at which the stiffness is 0, by bisection among the states between them."""
    low, high = 0.0, 1.0
    while (high - low) * (second.t - first.t) > 1e-6 * second.t:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shape.exceeds(between(shape.parameters, first, second, middle), 0.0) else (low, middle)
    return first.t + 0.5 * (low + high) * (second.t - first.t)
