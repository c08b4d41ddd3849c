"""The plan of a scene: what is solved for, what is eliminated, and what a user of its values should know."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multiphase.plan import Plan
from plaque1d.parameters import PlaqueGeometry, PlaqueParameters
from plaque1d.reductions import reduced_unknowns, reductions, unknowns
from plaque1d.stability import drag_warning

if TYPE_CHECKING:
    from multiphase.scene import Scene

_TIME = {
    "radau": "Radau IIA of order five with error control and dense output",
    "bdf2": "error-controlled BDF of order two",
    "backward-euler": "backward Euler",
}


def plan_of(scene: Scene) -> Plan:
    """Which method, geometry and form; what is eliminated; a warning where the drag form grows short waves."""
    p: PlaqueParameters = scene.parameters
    geometry: PlaqueGeometry = scene.geometry
    cells, (method, time_scheme) = scene.solver.cells, scene.solver.resolved
    form = "with the interfacial force p_n grad n" if p.momentum == "interfacial" else "drag only, as printed"
    wall = "n_x(0, t) = 0" if p.inner_wall == "no_gradient" else f"n(0, t) = {p.inner_wall:g}"
    found = reductions(scene)
    how = "compiled finite volumes" if method == "lines" else "Newton's method on FiPy's finite volumes"
    return Plan(
        solver=method,
        geometry=_domain(geometry, cells),
        equations=_equations(geometry, form, fractions=not found),
        unknowns=reduced_unknowns(scene) if found else unknowns(scene),
        dropped=(
            "c = 1 - n: the fractions add to one",
            "p_n: the sum of the momentum balances, integrated from the outer wall, gives it afterwards",
            "the mixture velocity: it is V" + (" R_2 / r" if geometry.annulus else ", uniform"),
        ),
        reasons=(
            f"inner wall: {wall}, the condition that the printed equations leave open",
            f"method {method}: {how}, {_TIME[time_scheme]}",
        ),
        warnings=drag_warning(p, scene.initial, scene.time.end),
        reductions=found,
    )


def _domain(geometry: PlaqueGeometry, cells: int) -> str:
    if not geometry.annulus:
        return f"slab, 0 <= x <= L(t), {cells} equal cells in xi = x / L"
    return f"annulus, R_1 = {geometry.inner_radius:g} <= r <= R_1 + L(t), {cells} cells of equal area"


def _equations(geometry: PlaqueGeometry, form: str, *, fractions: bool) -> tuple[str, ...]:
    """One line for each equation that is solved; those of the fractions where these are not known."""
    slip = f"slip w = u_m - u_n  difference of the momentum balances, {form}  (3.8d,e)"
    if not geometry.annulus:
        necrotic = "necrotic phase      (L n)_t + (n (u_n - xi V))_xi = k_m L l c             (3.10a)"
        modldl = "modified LDL        (L l)_t + (l (V - xi V) - l_xi / L)_xi = -k_l L l c    (3.10b)"
        width = "width               L' = V = Psi_m l(0, t)                                (3.9)"
    else:
        eta = "W = (R_2^2 - R_1^2)/2, eta = (r^2 - R_1^2)/(2 W)"
        necrotic = f"necrotic phase      (W n)_t + (n (r u_n - eta W'))_eta = k_m W l c, {eta}  (3.3)"
        modldl = "modified LDL        (W l)_t + (l (1 - eta) W' - r^2 l_eta / W)_eta = -k_l W l c  (3.3)"
        width = "area                W' = R_1 Psi_m l(R_1, t)  (3.7)"
        if not fractions:
            modldl = modldl.replace("  (3.3)", f", {eta}  (3.3)")
    return (necrotic, modldl, slip, width) if fractions else (modldl, width)
