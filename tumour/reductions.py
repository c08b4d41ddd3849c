"""What makes a scene's system smaller without a change of its answer: decided here, printed by the plan, taken by the schemes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multiphase.plan import Reduction, fewer
from tumour import equations as eq
from tumour.parameters import TumourParameters
from tumour.solver import DISK_CELLS, ONE_CELL

if TYPE_CHECKING:
    from multiphase.scene import Scene

UNIFORM, RADIAL = "uniform state", "radial symmetry"
"""Names of the reductions."""
CONTACT_MARGIN = 10.0
"""How far below contact a body must stay whose surface is never to move, in units of rtol: more than its errors."""


def reductions(scene: Scene) -> tuple[Reduction, ...]:
    """What is made use of in a scene of a radial body; empty with ``plan.reduce = false``."""
    found = []
    if is_radial(scene):
        found.append(_radial(scene))
    if reason := uniform_because(scene):
        full, reduced = (unknowns(scene, cells) for cells in (scene.solver.cells, ONE_CELL))
        found.append(
            Reduction(
                UNIFORM,
                f"{reason}; cells are uniform and C = C_out everywhere, at first and ever after",
                f"the equations of all cells but one: {fewer(full, reduced)}",
            )
        )
    return tuple(found)


def unknowns(scene: Scene, cells: int) -> int:
    """Unknowns of a step on so many cells."""
    return 3 * cells + (2 if scene.geometry.eulerian else 0)


def is_radial(scene: Scene) -> bool:
    """Whether a disk whose dimension is left open is solved along its radius: the initial state, the tissue and the surface must be such
    that the radial solver has all of it. Viscous bodies have no other solver and are nothing to decide upon."""
    geometry = scene.geometry
    is_open = geometry.dimension == "auto" and geometry.kind in ("disk", "quarter_disk") and not geometry.eulerian
    return is_open and scene.plan.reduce and has_radial_data(scene)


def has_radial_data(scene: Scene) -> bool:
    """Whether the initial state, the tissue and the surface are the same in every direction."""
    return scene.parameters.is_plain and scene.boundary.is_plain and not scene.initial.alpha.names & {"x", "y", "theta"}


def uniform_because(scene: Scene) -> str:
    """Why the state of a radial body is uniform at all times, or nothing where it is not known to be, or where nothing may be reduced.

    Cells are uniform at first, and oxygen at all times: without consumption, or where there is none outside. Then all cells grow alike,
    and stay alike if they swell alike: where fluid flows freely, so that all of the body is under the same stress; or where nothing drives
    a flow at all, without a pull from outside and with cells that never touch, for their fraction falls or rises towards the one at which
    births and deaths balance and never passes it. A uniform state in which cells attract each other is left to the full system, as
    tissue may part there by itself.
    """
    p: TumourParameters = scene.parameters
    alpha = scene.initial.alpha.constant
    if not scene.plan.reduce or scene.geometry.plane or scene.solver.resolved[0] != "lines":
        return ""
    if alpha is None or not (p.Q == 0.0 or p.C_out == 0.0):
        return ""
    oxygen = "Q = 0" if p.Q == 0.0 else "C_out = 0"
    if p.p_out == 0.0 and (p.gamma == 0.0 or _never_touch(p, float(alpha), scene.solver.rtol)):
        why = "gamma = 0" if p.gamma == 0.0 else "cells stay too few to touch"
        return f"{oxygen}, {why} and p_out = 0, so that nothing moves"
    if p.kappa > 0.0 or _attract(p):
        return ""
    return f"{oxygen} and kappa = 0"


def _never_touch(p: TumourParameters, alpha: float, rtol: float) -> bool:
    """Whether cells that begin at fraction alpha, in a body that does not move, stay below the fraction from which contact acts."""
    highest = alpha
    if p.C_out > 0.0:
        highest = max(alpha, float(eq.homeostatic_fraction(p.C_out, *p.kinetics)))
    return highest <= p.alpha_min - 0.5 * p.sigma_width - CONTACT_MARGIN * rtol


def _attract(p: TumourParameters) -> bool:
    """Whether cells attract each other at some fractions."""
    return p.gamma > 0.0 and p.alpha_min - 0.5 * p.sigma_width < p.alpha_star


def _radial(scene: Scene) -> Reduction:
    """What it saves to solve a disk along its radius: against its usual mesh, of `DISK_CELLS` triangles from the middle to the surface."""
    n, radial = DISK_CELLS, unknowns(scene, scene.solver.cells)
    if scene.geometry.kind == "disk":
        points, triangles, surface, sliding = 1 + 3 * n * (n + 1), 6 * n * n, 6 * n, 0
    else:
        points, triangles, surface, sliding = (n + 1) ** 2, 2 * n * n, 2 * n + 1, 2 * (n + 1)
    p: TumourParameters = scene.parameters
    known = sum(points if everywhere else surface for everywhere in (p.kappa == 0.0, p.Q == 0.0))  # of p and C
    full = 5 * points + 2 * triangles - known - sliding
    return Reduction(
        RADIAL,
        "the body and all that acts on it are the same in every direction, and so is the answer (the usual mesh in two dimensions has "
        f"{n} triangles from the middle to the surface)",
        f"the second dimension: {fewer(full, radial)}",
    )
