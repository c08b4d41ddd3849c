"""What a radial run of an elastic disk or ball is watched for: that a body that is free to lose its round shape would keep it."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from multiphase.stepping import Snapshot, State, Tracker
from tumour.parameters import TumourParameters
from tumour.stability.state import RadialState, attract, radial_state, state_of
from tumour.stability.stiffness import Shape, first_zero

if TYPE_CHECKING:
    from multiphase.scene import Scene

logger = logging.getLogger("multiphase")

WATCHED = (4, 5, 6)
"""Wave numbers of a disk, or degrees of a ball, that are watched: the first to lose their stiffness with values near the paper's."""
SOFT = 0.1
"""Stiffness over mu from which on a run is warned about: small departures then grow more than tenfold."""
NEAR = 0.05
"""Share of the time within which two states are close enough to interpolate between them."""


class Roundness(Tracker):
    """Warns, once for each, when the drained stiffness of a radial disk or ball falls below `SOFT`, and when it has passed 0.

    Parameters
    ----------
    parameters : TumourParameters
    radius : float
        At rest.
    cells : int
    even : bool
        Whether the disk has even wave numbers only, as a quarter has.
    reads_states : bool
        Whether the vector of a state is that of `tumour.radial`, so that a run that ends between stored times is looked at there too.
    m : int
        2 for a disk, 3 for a ball.
    """

    def __init__(self, parameters: TumourParameters, radius: float, cells: int, *, even: bool, reads_states: bool, m: int) -> None:
        self._parameters, self._radius, self._cells, self._reads_states, self._m = parameters, radius, cells, reads_states, m
        self._shapes = {k: Shape(parameters, radius, cells, k, m=m) for k in WATCHED if k % 2 == 0 or not even}
        self._body, self._of = ("disk", "changes of shape cos(%d theta)") if m == 2 else ("ball", "spherical harmonics of degree %d")
        self._last: RadialState | None = None
        self._is_soft = self._is_unstable = False

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        if not self._is_unstable:
            self._look(state_of(self._parameters, self._radius, snapshot, self._m))

    def on_end(self, state: State, status: str, message: str) -> None:
        if self._is_unstable or not self._reads_states or (self._last is not None and not state.t > self._last.t):
            return
        y = state.u[0]
        N = (len(y) - 1) // 3
        V = np.linspace(0.0, self._radius, N + 1) ** self._m / self._m
        J = np.diff(y[2 : 3 * N : 3], prepend=0.0) / np.diff(V)
        alpha = y[0 : 3 * N : 3] / J
        if self._cells != N:  # a uniform state, solved on one cell
            J, alpha = np.full(self._cells, J[0]), np.full(self._cells, alpha[0])
        self._look(radial_state(self._parameters, self._radius, state.t, J, alpha, m=self._m))

    def _look(self, now: RadialState) -> None:
        """Look at a state, and say what is new."""
        if not self._is_soft:
            soft = [k for k, shape in self._shapes.items() if not shape.exceeds(now, SOFT)]
            if soft:
                self._is_soft = True
                self._warn_soft(now, soft)
        if self._is_soft:
            lost = {k: first_zero(shape, [now] if self._last is None else [self._last, now]) for k, shape in self._shapes.items()}
            if not np.all(np.isnan(list(lost.values()))):
                self._is_unstable = True
                self._warn_unstable(lost, now)
        self._last = now

    def _warn_soft(self, now: RadialState, soft: list[int]) -> None:
        values = {k: self._shapes[k].value(now) for k in soft}
        least = min(values, key=lambda k: values[k])
        if values[least] <= 0.0:  # said in its own words
            return
        logger.warning(
            "at t = %.6g the stiffness of the %s against %s is down to %.2g mu_alpha: this run holds it "
            "round, but a %s that is free to lose its shape magnifies small departures from it more and more. A larger lambda_alpha "
            "keeps it stiff; `tumour.stability` tells more.",
            now.t,
            self._body,
            self._of % least,
            values[least],
            self._body,
        )

    def _warn_unstable(self, lost: dict[int, float], now: RadialState) -> None:
        k = min((k for k in lost if not np.isnan(lost[k])), key=lambda k: lost[k])
        when = f"by t = {now.t:.4g}"
        if self._last is not None:
            near = now.t - self._last.t <= NEAR * now.t
            when = f"at about t = {lost[k]:.1f}" if near else f"between t = {self._last.t:.4g} and {now.t:.4g}"
        logger.warning(
            "the %s has lost its stability %s: its stiffness against %s is 0 there. This run holds it round; from then on it shows a state "
            "that a %s free to lose its shape does not keep.",
            self._body,
            when,
            self._of % k,
            self._body,
        )


def trackers(scene: Scene) -> tuple[Tracker, ...]:
    """The watch on a radial scene. None on bodies that are no elastic disk or ball; nor where cells attract each other at some fractions,
    as tissue may then part by itself, whatever the shape of its body."""
    geometry, p = scene.geometry, scene.parameters
    if geometry.plane or geometry.eulerian or geometry.m == 1 or attract(p):
        return ()
    cells, (method, _) = scene.solver.within(geometry).cells, scene.solver.resolved
    even = geometry.kind == "quarter_disk"
    return (Roundness(p, geometry.radius, cells, even=even, reads_states=method == "lines", m=geometry.m),)
