"""The plan of a scene: what is solved for, what is eliminated, and what a user of its values should know."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from multiphase.parameters import specifications
from multiphase.plan import Plan
from multiphase.tensors import TensorFunction
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourParameters
from tumour.presets import find_preset

if TYPE_CHECKING:
    from multiphase.scene import Scene

_SHAPES = {
    "slab": "slab, from its middle",
    "disk": "disk in plane strain",
    "quarter_disk": "quarter disk in plane strain",
    "sphere": "sphere",
    "glioma": "body with lobes, as a glioma has, in plane strain",
    "outline": "body within an outline, in plane strain",
    "mesh": "body of a mesh, in plane strain",
}

_TIME = {
    "radau": "Radau IIA of order five with error control and dense output",
    "bdf2": "error-controlled BDF of order two",
    "backward-euler": "backward Euler",
}

_MOBILITIES = {
    "darcy": "(1 - alpha)/(kappa alpha), as follows from (2.13); no detail: the fluid flows several times more easily as printed",
    "printed": "1/(kappa alpha), as (2.16), (2.17), (2.22c) print it; no detail: the factor 1 - alpha of (2.13) would slow growth",
    "constant": "1/kappa, at any cell fraction; no detail: the (1 - alpha)/(kappa alpha) of (2.13) would slow growth",
}

BUCKLING_TIME = 60.0
"""About when the paper's disk, with lambda_alpha = 0, begins to lose its round shape."""
STEADY_LAMBDA = 0.3
"""lambda_alpha from which it keeps its shape."""


def plan_of(scene: Scene) -> Plan:
    """What is solved for, what is eliminated, and what a user of these values should know."""
    return _plane_plan(scene) if scene.geometry.plane else _radial_plan(scene)


def _plane_plan(scene: Scene) -> Plan:
    """The plan of a body in two dimensions."""
    from tumour.fem.bodies import body_of
    from tumour.fem.surface import Surface

    p: TumourParameters = scene.parameters
    geometry, solver = scene.geometry, scene.solver
    body = body_of(geometry, solver.cells)
    surface = Surface(body, scene.boundary, p)
    quality = body.quality
    free = 5 * quality.nodes + 2 * quality.triangles
    sliding = len({*body.slide_x, *body.slide_y})
    slides = f", slides on {sliding} points of its straight sides" if sliding else ""
    mesh = (
        f"{quality.nodes} points, {quality.triangles} triangles with sides from {quality.h_min:.3g} to {quality.h_max:.3g}, "
        f"least angle {quality.least_angle:.3g} degrees"
    )
    dropped = ["the bubbles of the displacement: condensed in each triangle"]
    shifts, turns = surface.free_motions
    if shifts.any():
        motions = "rigid motions" if turns else f"the shift along {'xy'[int(np.argmax(shifts))]}"
        dropped.append(f"{motions}: the displacement is kept orthogonal to {'them' if turns else 'it'}; no force holds the body")
    if p.kappa == 0.0:
        dropped.append("the flow of the fluid: kappa = 0 lets it flow freely at p = p_out, so that stresses balance at each moment")
    if surface.has_uniform_oxygen:
        dropped.append(f"the oxygen: {'Q' if p.Q == 0.0 else 'consumption'} = 0 makes it C_out everywhere")
    printed = solver.alpha_step == "as-printed"
    return Plan(
        solver="mini",
        geometry=f"{_SHAPES[geometry.kind]}, {mesh}{slides}",
        equations=_plane_equations(p, has_oxygen=not surface.has_uniform_oxygen),
        unknowns=free - int(np.sum(surface.prescribed)),
        dropped=tuple(dropped),
        reasons=(
            "two dimensions: asked for" if geometry.dimension == "2d" else "two dimensions: the body is not round",
            *((f"outline {body.origin}",) if body.origin else ()),
            *_tissue(p),
            f"mobility {_mobility(p)}",
            "method mini: displacement with cubic bubbles, the rest linear; Newton's method with exact tangents, "
            f"{_TIME[solver.resolved[1]]}",
        ),
        warnings=_warnings(scene),
        open_balances=("defect_cells",) if printed else (),
        balance_limit=10.0 * solver.newton_tolerance * max(1.0, 1.0 / p.kappa if p.kappa > 0.0 else 1.0),
        boundary=surface.describe(),
    )


def _plane_equations(p: TumourParameters, *, has_oxygen: bool) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body at rest."""
    m = "" if p.stiffness == 1.0 else "m "
    rows = [
        ("momentum", f"Div P = 0, P = {m}mu (F - F^-T) + ({m}lambda (J - 1) - p - alpha Sigma) J F^-T", "(2.22a)"),
        *_fibre_rows(p),
        ("cells", "(alpha J)_t = J q_alpha(alpha, C)", "(2.22b)"),
    ]
    if p.kappa > 0.0:
        rows.append(("fluid", f"J_t = Div(M(alpha) J {_pull_back(p.permeability, 'K')} grad p)", "(2.22c)"))
    if has_oxygen:
        w = "" if p.consumption == 1.0 else "w "
        rows.append(("oxygen", f"Div(J {_pull_back(p.diffusivity, 'D')} grad C) = J {w}{_uptake(p)}", "(2.22d)"))
    return tuple(f"{name:<10}{equation:<74}  {number}".rstrip() for name, equation, number in rows)


def _fibre_rows(p: TumourParameters) -> list[tuple[str, str, str]]:
    """What fibres add to the stress."""
    rows = []
    if p.fibre_ratio != 1.0:
        rows.append(("", "    - (rho - 1) alpha Sigma J (F a_0) (x) a_0/|F a_0|^2, rho = fibre_ratio", ""))
    if p.fibre_stiffness != 0.0:
        rows.append(("", "    + 2 k_f (|F a_0|^2 - 1) (F a_0) (x) a_0, k_f = fibre_stiffness", ""))
    return rows


def _pull_back(tensor: TensorFunction, symbol: str) -> str:
    """What stands between J and a gradient."""
    if tensor == 1.0:
        return "F^-1 F^-T"
    return f"{symbol} F^-1 F^-T" if tensor.is_isotropic else f"U^-1 {symbol} U^-1"


def _tissue(p: TumourParameters) -> tuple[str, ...]:
    """What is not the same everywhere and in all directions."""
    if p.is_plain:
        return ()
    symbols = specifications(p)
    given = ", ".join(f"{name} {symbols[name].symbol} = {getattr(p, name)!r}" for name in p.varying)
    return (f"tissue: {given}",)


def _radial_plan(scene: Scene) -> Plan:
    """The plan of a radial body."""
    p: TumourParameters = scene.parameters
    geometry: TumourGeometry = scene.geometry
    cells, (method, time_scheme) = scene.solver.cells, scene.solver.resolved
    how = "compiled finite volumes" if method == "lines" else "Newton's method on FiPy's finite volumes"
    printed = scene.solver.alpha_step == "as-printed"
    rest = "equal in xi = r/R; eulerian" if geometry.eulerian else "equal at rest; lagrangian"
    oxygen = ("oxygen: Q = 0 makes it C_out everywhere; its equation is solved all the same",) if p.Q == 0.0 else ()
    reasons = (
        f"radial (dimension {geometry.m}): the body and all that acts on it are the same in every direction, and the equations keep that",
        f"mobility {_mobility(p)}",
        f"method {method}: {how}, {_TIME[time_scheme]}",
        *oxygen,
    )
    return Plan(
        solver=method,
        geometry=f"{_SHAPES[geometry.kind]}, 0 <= r <= R(t), {cells} cells {rest}",
        equations=_viscous_equations(p, geometry) if geometry.eulerian else _elastic_equations(p, geometry.m),
        unknowns=3 * cells + (2 if geometry.eulerian else 0),
        dropped=_dropped(p, geometry),
        reasons=reasons,
        warnings=_warnings(scene),
        open_balances=("defect_cells",) if printed else (),
    )


def _mobility(p: TumourParameters) -> str:
    if p.kappa == 0.0:
        return "infinite, as kappa = 0"
    law = _MOBILITIES[p.mobility]
    return law.replace("1/(kappa", f"1/({p.mobility_floor:g} + kappa") if p.mobility_floor > 0.0 else law


def _powers(m: int) -> tuple[str, str]:
    """What stands before and within a divergence, per symbol of the radius: r^(1-m) and r^(m-1)."""
    return {1: ("", ""), 2: ("X^-1 ", "X "), 3: ("X^-2 ", "X^2 ")}[m]


def _elastic_equations(p: TumourParameters, m: int) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body at rest: the point at R is at r(R, t)."""
    flow = "p = p_out, with p from the momentum balance" if p.kappa == 0.0 else "r_t = (M(alpha)/l_r) p_R, l_r = r_R"
    before, within = (text.replace("X", "R") for text in _powers(m))
    return _rows(
        ("cells", "(alpha J)_t = J q_alpha(alpha, C)", "(2.22b)"),
        ("fluid", flow, "(2.22c)"),
        ("oxygen", f"{before}({within}(J/l_r^2) C_R)_R = J {_uptake(p)}", "(2.22d)"),
    )


def _viscous_equations(p: TumourParameters, geometry: TumourGeometry) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body as it is: r = xi R(t)."""
    flow = "p = p_out, with p from the momentum balance" if p.kappa == 0.0 else "u = M(alpha) p_r, with p from the momentum balance"
    before, within = (text.replace("X", "r") for text in _powers(geometry.m))
    return _rows(
        ("cells", f"alpha_t + {before}({within}alpha u)_r = q_alpha(alpha, C)", "(2.1), (2.6)"),
        ("fluid", flow, "(2.4), (2.13)"),
        ("oxygen", f"{before}({within}C_r)_r = {_uptake(p)}", ""),
        ("surface", "R' = u(R)", ""),
    )


def _uptake(p: TumourParameters) -> str:
    return "Q alpha C" if p.Q1_hat == 0.0 else "Q alpha C/(1 + Q1_hat C)"


def _rows(*rows: tuple[str, str, str]) -> tuple[str, ...]:
    """Name, equation and number in columns."""
    return tuple(f"{name:<10}{equation:<48}  {number}".rstrip() for name, equation, number in rows)


def _dropped(p: TumourParameters, geometry: TumourGeometry) -> tuple[str, ...]:
    momentum = "(2.4)" if geometry.eulerian else "(2.22a)"
    dropped = [
        f"p: the momentum balance {momentum}, integrated from the surface, gives it from the other unknowns, exactly",
        "the fluid's fraction and velocity: 1 - alpha, and what makes the mixture's flux zero",
    ]
    if p.kappa == 0.0:
        dropped.append("the flow of the fluid: kappa = 0 lets it flow freely at p = p_out, so that stresses balance at each moment")
    if geometry.m == 1:
        dropped.append("what happens along the slab: it is kept from moving sideways")
    return tuple(dropped)


def _warnings(scene: Scene) -> tuple[str, ...]:
    p: TumourParameters = scene.parameters
    warnings = []
    if p.gamma > 0.0 and p.alpha_min < p.alpha_star:
        jump = p.gamma * (p.alpha_star - p.alpha_min) / (1.0 - p.alpha_min) ** 2
        told = (
            "so sharply that cells may hang at the jump and steps get small; sigma_width spreads it"
            if p.sigma_width == 0.0
            else f"spread over sigma_width = {p.sigma_width:g} here, on which the solution then depends"
        )
        warnings.append(
            f"alpha_min = {p.alpha_min:g} is below alpha_star = {p.alpha_star:g}: the contact stress jumps by {jump:.3g} there, {told}."
        )
    if scene.geometry.plane and p.gamma > 0.0 and p.alpha_min - 0.5 * p.sigma_width < p.alpha_star:
        warnings.append(
            f"cells attract between alpha = {max(0.0, p.alpha_min - 0.5 * p.sigma_width):g} and alpha_star = {p.alpha_star:g}: loose "
            "tissue may part there into dense and empty places, and a run in two dimensions may end; with alpha_min = alpha_star and "
            "sigma_width = 0 nothing attracts."
        )
    if scene.solver.alpha_step == "as-printed":
        warnings.append('alpha_step = "as-printed" does not keep the mass of cells; defect_cells tells by how much. "conservative" does.')
    if _may_buckle(scene):
        then = (
            "errors of the mesh grow many times before, from about t = 44 on, and the run may end there."
            if scene.geometry.plane
            else f"this run holds it round, so from t = {BUCKLING_TIME:g} on it may show a state that a disk free to lose its shape does "
            "not keep."
        )
        warnings.append(
            "an elastic disk with values like the paper's is expected to buckle at about t = 61 to 64 with lambda_alpha = 0, and not with "
            f"{STEADY_LAMBDA:g} or more; with {p.lambda_alpha:g} {then}"
        )
    return tuple(warnings)


def _may_buckle(scene: Scene) -> bool:
    """Whether a run goes on to where the paper's disk buckles, with values near the paper's."""
    p, geometry = scene.parameters, scene.geometry
    if geometry.eulerian or geometry.kind not in ("disk", "quarter_disk") or not scene.boundary.is_plain:
        return False
    if not p.lambda_alpha < STEADY_LAMBDA or not scene.time.end > BUCKLING_TIME:
        return False
    paper = TumourParameters(**find_preset("paper").parameters)
    names = (
        "mu_alpha",
        "kappa",
        "gamma",
        "alpha_star",
        "alpha_min",
        "s1",
        "s2",
        "s3",
        "s4",
        "Q",
        "C_out",
        "p_out",
        "Q1_hat",
        "sigma_width",
    )
    near = all(abs(getattr(p, name) - getattr(paper, name)) <= 0.2 * abs(getattr(paper, name)) for name in names)
    return near and 0.8 <= geometry.radius <= 1.25
