"""The plan of a scene: what is solved for, what is eliminated, and what a user of its values should know."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from multiphase.parameters import specifications
from multiphase.plan import Plan, Reduction, fewer
from tumour.geometry import RADIAL_KINDS, TumourGeometry
from tumour.parameters import TumourParameters
from tumour.plan_equations import plane_equations, radial_equations
from tumour.presets import find_preset
from tumour.reductions import UNIFORM, reductions, unknowns
from tumour.solver import ONE_CELL

if TYPE_CHECKING:
    from multiphase.scene import Scene
    from tumour.fem.mirror import Mirror
    from tumour.fem.surface import Surface
    from tumour.meshes import Body

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

BUCKLING = {2: (60.0, 0.3, "from t = 61 to 64 on", "a disk"), 3: (68.0, 0.04, "from t = 69 to 72 on", "a ball")}
"""Of disks and balls with values like the paper's: until when none has buckled, the lambda_alpha from which they keep their shape, and when
they buckle with none (`tumour.stability`, docs/symmetry.md)."""


def plan_of(scene: Scene) -> Plan:
    """What is solved for, what is eliminated, and what a user of these values should know."""
    return _plane_plan(scene) if scene.geometry.plane else _radial_plan(scene)


def _plane_plan(scene: Scene) -> Plan:
    """The plan of a body in two dimensions."""
    from tumour.fem.bodies import body_of
    from tumour.fem.mirror import mirror_of_scene
    from tumour.fem.surface import Surface

    p: TumourParameters = scene.parameters
    geometry, solver = scene.geometry, scene.solver
    body = body_of(geometry, solver.cells)
    surface = Surface(body, scene.boundary, p)
    quality = body.quality
    solved = _plane_unknowns(body, surface)
    mirror = mirror_of_scene(scene)
    found: tuple[Reduction, ...] = ()
    if mirror is not None:
        left = _plane_unknowns(mirror.body, Surface(mirror.body, mirror.boundary, p))
        found = (_mirrored(mirror, solved, left),)
        solved = left
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
        equations=plane_equations(p, has_oxygen=not surface.has_uniform_oxygen),
        unknowns=solved,
        reductions=found,
        dropped=tuple(dropped),
        reasons=(
            f"two dimensions: {_why_plane(scene)}",
            *((f"outline {body.origin}",) if body.origin else ()),
            *_tissue(p),
            f"mobility {_mobility(p)}",
            "method mini: displacement with cubic bubbles, the rest linear; Newton's method with exact tangents, "
            f"{_TIME[solver.resolved[1]]}",
        ),
        warnings=_warnings(scene),
        open_balances=("defect_cells",) if printed else (),
        balance_limit=10.0 * solver.newton_tolerance * max(1.0, _easiest_flow(p, body)),
        boundary=surface.describe(),
    )


def _easiest_flow(p: TumourParameters, body: Body) -> float:
    """What the flow multiplies an error of the pressure by: the largest permeability over kappa."""
    from tumour.fem.arrays import PERMEABILITY
    from tumour.fem.tissue import coefficients

    if p.kappa == 0.0:
        return 1.0
    x, y = body.mesh.p
    xx, yy, xy = coefficients(p, x, y, body.radius)[:, PERMEABILITY : PERMEABILITY + 3].T
    return float(np.max(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy))) / p.kappa


def _why_plane(scene: Scene) -> str:
    """Why a body is solved in two dimensions."""
    if scene.geometry.kind not in RADIAL_KINDS:
        return "the body is not round"
    causes = list(scene.parameters.varying)
    causes += ["initial.alpha"] if scene.initial.alpha.names & {"x", "y", "theta"} else []
    causes += ["boundary"] if not scene.boundary.is_plain else []
    return f"{', '.join(causes)} may differ by direction" if causes else "asked for"


def _plane_unknowns(body: Body, surface: Surface) -> int:
    return 5 * body.quality.nodes + 2 * body.quality.triangles - int(np.sum(surface.prescribed))


def _mirrored(mirror: Mirror, full: int, reduced: int) -> Reduction:
    """What is made use of where the body is its own mirror image."""
    lines = " and ".join(f"{axis} -> -{axis}" for axis in mirror.axes)
    part = {2: "half", 4: "a quarter"}[mirror.copies]
    return Reduction(
        "mirror symmetry",
        f"{lines} leaves mesh, initial state, tissue and surface as they are, and so the solution as long as it keeps its shape",
        f"all but {part} of the body: {fewer(full, reduced)}",
    )


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
    found = reductions(scene)
    is_uniform = any(reduction.name == UNIFORM for reduction in found)
    kept = ("oxygen: Q = 0 makes it C_out everywhere; its equation is solved all the same",) if p.Q == 0.0 and not is_uniform else ()
    reasons = (
        f"radial (dimension {geometry.m}): the body and all that acts on it are the same in every direction, and the equations keep that",
        f"mobility {_mobility(p)}",
        f"method {method}: {how}, {_TIME[time_scheme]}",
        *kept,
    )
    return Plan(
        solver=method,
        geometry=f"{_SHAPES[geometry.kind]}, 0 <= r <= R(t), {cells} cells {rest}",
        equations=radial_equations(p, geometry, is_uniform=is_uniform),
        unknowns=unknowns(scene, ONE_CELL if is_uniform else cells),
        dropped=_dropped(p, geometry),
        reasons=reasons,
        warnings=_warnings(scene),
        open_balances=("defect_cells",) if printed else (),
        reductions=found,
    )


def _mobility(p: TumourParameters) -> str:
    if p.kappa == 0.0:
        return "infinite, as kappa = 0"
    law = _MOBILITIES[p.mobility]
    return law.replace("1/(kappa", f"1/({p.mobility_floor:g} + kappa") if p.mobility_floor > 0.0 else law


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
            else "this run holds it round, and says when."
        )
        _, steady, when, body = BUCKLING[scene.geometry.m]
        warnings.append(
            f"{body} of elastic cells with values like the paper's may buckle in this time (with lambda_alpha = 0 {when}, not with "
            f"{steady:g} or more): {then}"
        )
    return tuple(warnings)


def _may_buckle(scene: Scene) -> bool:
    """Whether a run goes on to where the paper's disk buckles, with values near the paper's."""
    p, geometry = scene.parameters, scene.geometry
    if geometry.eulerian or geometry.kind not in ("disk", "quarter_disk", "sphere") or not scene.boundary.is_plain:
        return False
    until, steady, *_ = BUCKLING[geometry.m]
    if not p.lambda_alpha < steady or not scene.time.end > until:
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
