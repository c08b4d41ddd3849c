"""What makes a scene's system smaller without a change of its answer: decided here, printed by the plan, taken by the schemes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multiphase.plan import Reduction, fewer
from plaque1d.parameters import PlaqueInitial, PlaqueParameters

if TYPE_CHECKING:
    from multiphase.scene import Scene

FIXED_FRACTIONS = "fixed fractions"
"""Name of the reduction to modLDL and the width."""


def reductions(scene: Scene) -> tuple[Reduction, ...]:
    """What is made use of in a scene; empty with ``plan.reduce = false``."""
    reason = fixed_fractions_because(scene)
    if not reason:
        return ()
    saves = f"the necrotic phase and all momentum: {fewer(unknowns(scene), reduced_unknowns(scene))}"
    return (Reduction(FIXED_FRACTIONS, reason, saves),)


def unknowns(scene: Scene) -> int:
    """Unknowns of a step of the whole system: n, l and w in each cell, in the annulus with drag S as well, and W."""
    return (4 if scene.geometry.annulus and scene.parameters.momentum == "drag" else 3) * int(scene.solver.cells) + 1


def reduced_unknowns(scene: Scene) -> int:
    """Unknowns of a step of modLDL and the width."""
    return int(scene.solver.cells) + 1


def fixed_fractions_because(scene: Scene) -> str:
    """Why n stays what it is at first, in every cell, or nothing where it is not known to, or where nothing may be reduced.

    The flux of n is ``n (u_n - xi V) = n (V - c w - xi V)``, its source ``k_m l c``. Without necrotic phase there is neither flux nor, with
    k_m = 0, source. Where no macrophages come in, V = 0, and none are there, c = 0, there is neither. Where none come in and none die,
    there is no source, and no flux if nothing drives the slip: w solves a linear system with ``Delta(c Sigma)`` and, in the drag form,
    ``S Delta n`` on its right.
    """
    p: PlaqueParameters = scene.parameters
    if not scene.plan.reduce or scene.solver.resolved[0] != "lines" or (p.momentum == "drag" and p.nu == (0.0, 0.0)):
        return ""  # inviscid drag may be ill-posed, which only the whole system says
    n = scene.initial.n.constant
    if n == 0.0 and p.k_m == 0.0:
        return "n = 0 everywhere at first and k_m = 0, so that no necrotic phase ever forms"
    if p.Psi_m > 0.0:
        return ""
    if n == 1.0:
        return "c = 0 everywhere at first and Psi_m = 0, so that there never are any macrophages"
    if p.k_m == 0.0 and (driven_by := _no_force(p, scene.initial)):
        return f"Psi_m = k_m = 0 and {driven_by}, so that the phases neither move nor change"
    return ""


def _no_force(p: PlaqueParameters, initial: PlaqueInitial) -> str:
    """Why nothing drives the phases past each other, with V = 0 and k_m = 0; nothing where something may."""
    is_uniform = initial.n.constant is not None
    if p.A == 0.0 and (p.momentum == "interfacial" or is_uniform or p.p_out == 0.0):
        return "A = 0" + ("" if p.momentum == "interfacial" else ", n is uniform" if is_uniform else ", p_out = 0")
    return "B = 0, n is uniform" if p.B == 0.0 and is_uniform else ""
