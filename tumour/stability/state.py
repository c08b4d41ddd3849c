"""Radial states of an elastic disk or ball, as the modes see them."""

from __future__ import annotations

import logging
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import from_table
from multiphase.stepping import Control, Snapshot, State, Tracker, integrate, start
from tumour import equations as eq
from tumour.checks import check
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.schemes import ElasticRadau
from tumour.solver import TumourSolver

Array = NDArray[np.float64]

RTOL = 1e-7
"""Accuracy in time of the radial states; it costs little against the modes."""

logger = logging.getLogger("multiphase")

ROUNDING = 1e-12

CELLS_A_WAVE = 10
"""Cells of the radius that a wave number takes, at least: a wave of number k is confined to a kth of the radius at the surface."""
KINDS = ("disk", "quarter_disk", "sphere")
"""Kinds of bodies that are looked at."""


@dataclass(frozen=True, slots=True)
class RadialState:
    """A radial state of a disk or ball on N cells that are equal at rest.

    Attributes
    ----------
    m : int
        2 for a disk, 3 for a ball.
    t : float
    R, r : (N + 1,) array
        Faces at rest, and where they are.
    J, alpha, C, p : (N,) array
        Volume ratio, cell fraction, oxygen, fluid pressure. The stiffness needs neither C nor p.
    l_r, l_t : (N,) array
        Stretches along and across the radius.
    g : (N,) array
        ``lambda (J - 1) - T``, where T = p + alpha Sigma is taken from the balance of the forces on the faces (see `tumour.radial`).
    """

    m: int
    t: float
    R: Array
    r: Array
    J: Array
    alpha: Array
    C: Array
    p: Array
    l_r: Array
    l_t: Array
    g: Array

    @property
    def rho(self) -> Array:
        """Middles of the cells as they are."""
        return 0.5 * (self.r[1:] + self.r[:-1])

    @property
    def gaps(self) -> Array:
        """Distances over the faces 1 to N from middle to middle; over the last, from the middle of the last cell to the surface."""
        return np.append(np.diff(self.rho), self.r[-1] - self.rho[-1])

    @property
    def hoop(self) -> tuple[Array, Array]:
        """What changes of the faces' radii make of l_t in cells: the first times their mean over that of R, and the second times their
        difference over h. In a disk 1 and 0; in a ball, ``l_t^2 = (r_+^2 + r_+ r_- + r_-^2)/(R_+^2 + R_+ R_- + R_-^2)``, nearly so."""
        return _hoop(self.R, self.r, self.l_t, self.m)

    @property
    def swelling(self) -> tuple[Array, Array]:
        """What multiplies H_rr and H_tt of `operators.Grid` in j, the change of J."""
        mean, slope = self.hoop
        across = (self.m - 1) * self.J / self.l_t
        return self.J / self.l_r + across * slope, across * mean

    @property
    def face_stretches(self) -> tuple[Array, Array]:
        """l_r and l_t on the faces 1 to N."""
        at_rest = np.append(np.diff(self.R)[1:], 0.5 * (self.R[-1] - self.R[-2]))
        return self.gaps / at_rest, self.r[1:] / self.R[1:]


def radial_state(
    parameters: TumourParameters, radius: float, t: float, J: Array, alpha: Array, C: Array | None = None, p: Array | None = None,
    *, m: int = 2,
) -> RadialState:  # fmt: skip
    """The state of a disk, or a ball, of `radius` at rest whose cells, equal at rest, have these values."""
    N, mu, lam = len(J), *parameters.moduli
    R = np.linspace(0.0, radius, N + 1)
    V = np.diff(R**m / m)
    v = m * np.append(0.0, np.cumsum(J * V))
    r = np.sqrt(v) if m == 2 else np.cbrt(v)
    h = R[1]
    l_r = np.diff(r) / h
    l_t = (r[1:] + r[:-1]) / (R[1:] + R[:-1]) if m == 2 else np.sqrt(_squares(r) / _squares(R))
    P_r, P_t = eq.elastic_stress(l_r, l_t, m, mu, lam)
    mean, slope = _hoop(R, r, l_t, m)
    both, turned = (m - 1) * P_t * mean / (R[1:] + R[:-1]), (P_r + (m - 1) * P_t * slope) / h
    outer, inner = V * (both + turned), V * (both - turned)
    steps = (outer + np.append(inner[1:], 0.0)) / r[1:] ** (m - 1)  # T_{f-1} - T_f; T is 0 beyond the surface
    T = np.cumsum(steps[::-1])[::-1]
    none = np.zeros(N)
    return RadialState(
        m, t, R, r, J, alpha, none if C is None else C, none if p is None else p, l_r, l_t, lam * (J - 1.0) - T
    )  # fmt: skip


def _squares(x: Array) -> Array:
    """``x_+^2 + x_+ x_- + x_-^2`` of the faces of each cell."""
    squares: Array = x[1:] ** 2 + x[1:] * x[:-1] + x[:-1] ** 2
    return squares


def _hoop(R: Array, r: Array, l_t: Array, m: int) -> tuple[Array, Array]:
    """See `RadialState.hoop`."""
    if m == 2:
        return np.ones_like(l_t), np.zeros_like(l_t)
    below = l_t * _squares(R)
    return 0.75 * (r[1:] + r[:-1]) * (R[1:] + R[:-1]) / below, 0.25 * np.diff(r) * np.diff(R) / below


def between(parameters: TumourParameters, first: RadialState, second: RadialState, share: float) -> RadialState:
    """The state at a share of the way from one state to the next, for those that are close."""
    J, alpha, C, p = ((1.0 - share) * getattr(first, name) + share * getattr(second, name) for name in ("J", "alpha", "C", "p"))
    return radial_state(parameters, float(first.R[-1]), (1.0 - share) * first.t + share * second.t, J, alpha, C, p, m=first.m)


def round_body(
    geometry: str | Mapping[str, Any] | TumourGeometry, wave_numbers: Sequence[int] | None, least: int, cells: int
) -> tuple[TumourGeometry, list[int]]:
    """The geometry, and the wave numbers (of a ball: degrees) that are asked for, from `least` on; by default those from 2 to 8 it admits.
    Warns of those that are too narrow for so many cells.

    Raises
    ------
    ParameterError
        For what is no elastic disk or ball, and for wave numbers that it does not have.
    """
    if isinstance(geometry, str):
        geometry = TumourGeometry(kind=geometry)
    elif isinstance(geometry, Mapping):
        geometry = from_table(TumourGeometry, geometry, "geometry")
    if not isinstance(geometry, TumourGeometry) or geometry.eulerian or geometry.kind not in KINDS:
        raise ParameterError("geometry", 'modes are those of a round elastic body; take kind = "disk", "quarter_disk" or "sphere".')
    step = 2 if geometry.kind == "quarter_disk" else 1
    try:
        chosen = list(range(2, 9, step)) if wave_numbers is None else [operator.index(k) for k in wave_numbers]
    except TypeError:
        chosen = []
    if not chosen or any(k < least or k % step for k in chosen):
        which = "even numbers, as it slides on both straight sides," if step == 2 else "whole numbers"
        raise ParameterError(
            "wave_numbers", f"{wave_numbers!r} cannot be used: give one or more; here a {geometry.kind} has {which} from {least * step} on."
        )
    if max(chosen) * CELLS_A_WAVE > cells:
        logger.warning(
            "wave number %d needs %d cells or more: with %d its stiffness is that of the grid, and far too small.",
            max(chosen), CELLS_A_WAVE * max(chosen), cells,
        )  # fmt: skip
    return geometry, chosen


def given(parameters: Any, initial: Any) -> tuple[TumourParameters, TumourInitial | None]:
    """Parameters and initial state as `simulate` takes them: tables are read, and without parameters they are the paper's."""
    if isinstance(parameters, Mapping):
        parameters = from_table(TumourParameters, parameters, "parameters")
    if isinstance(initial, Mapping):
        initial = from_table(TumourInitial, initial, "initial")
    return TumourParameters() if parameters is None else parameters, initial


def check_contact(parameters: TumourParameters) -> None:
    """Refuse a contact stress that jumps: its change where it jumps is no small one."""
    if jumps(parameters):
        raise ParameterError(
            "parameters.sigma_width",
            f"0 makes the contact stress jump at alpha_min = {parameters.alpha_min:g}, below alpha_star, where no small change of alpha "
            "makes a small one of the stress; spread the jump with sigma_width = 0.02, for instance.",
        )


def contact_slope(parameters: TumourParameters, state: RadialState) -> Array:
    """d(alpha Sigma)/dalpha; cells at alpha_min, to rounding, count as in contact."""
    slope: Array = eq.contact_pressure_slope(state.alpha * (1.0 + ROUNDING), *parameters.contact)
    return slope


def jumps(parameters: TumourParameters) -> bool:
    """Whether the contact stress jumps at alpha_min."""
    p = parameters
    return p.gamma > 0.0 and p.alpha_min != p.alpha_star and p.sigma_width == 0.0


def attract(parameters: TumourParameters) -> bool:
    """Whether cells attract each other at some fractions."""
    p = parameters
    return p.gamma > 0.0 and p.alpha_min - 0.5 * p.sigma_width < p.alpha_star


class _Keep(Tracker):
    """Keeps the radial states at the stored times."""

    def __init__(self, parameters: TumourParameters, radius: float, m: int) -> None:
        self._parameters, self._radius, self._m = parameters, radius, m
        self.states: list[RadialState] = []

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        self.states.append(state_of(self._parameters, self._radius, snapshot, self._m))


def state_of(parameters: TumourParameters, radius: float, snapshot: Snapshot, m: int) -> RadialState:
    """The radial state that a radial run stores."""
    J, alpha, C, p = (snapshot.fields[name] for name in ("J", "alpha", "C", "p"))
    return radial_state(parameters, radius, snapshot.t, J, alpha, C, p, m=m)


def radial_states(
    parameters: TumourParameters, initial: TumourInitial | None, geometry: TumourGeometry, times: Sequence[float], cells: int
) -> list[RadialState]:
    """The states of the disk or ball at increasing times from 0 on, by the radial solver.

    Raises
    ------
    ParameterError
        For values that cannot be used.
    SolverError
        Where the radial run cannot go on.
    """
    check_contact(parameters)
    geometry = TumourGeometry(kind="disk" if geometry.m == 2 else "sphere", radius=geometry.radius)
    initial = (TumourInitial() if initial is None else initial).within(geometry.radius)
    solver = TumourSolver(cells=cells, rtol=RTOL)
    check(parameters, initial, geometry, solver)
    scheme = ElasticRadau(parameters, initial, geometry, solver)
    keep = _Keep(parameters, geometry.radius, geometry.m)
    integrate(scheme, start(scheme, 0.0, times[1] if len(times) > 1 else 1.0, Control()), list(times), Control(), [keep])
    return keep.states
