"""The radial tumour as a model of `multiphase`: its outputs, its plan, its checks, and `simulate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multiphase.errors import ParameterError
from multiphase.model import Model, Panel, Quantity
from multiphase.parameters import from_table
from multiphase.plan import Plan
from multiphase.stepping import Tracker
from tumour.parameters import PRESETS, TumourGeometry, TumourInitial, TumourParameters, TumourSolver, check, find_preset

if TYPE_CHECKING:
    from multiphase.result import Result
    from multiphase.scene import Scene

VELOCITY = {"length": 1, "time": -1}
LENGTH = {"length": 1}

_QUANTITIES = (
    Quantity("alpha", r"\alpha", "cell fraction"),
    Quantity("C", "C", "oxygen", {"concentration": 1}),
    Quantity("p", "p", "fluid pressure", {"pressure": 1}),
    Quantity("displacement", "r - R", "displacement of the cells", LENGTH),
    Quantity("u", "u", "velocity of the cells", VELOCITY),
    Quantity("J", "J", "volume over that at rest"),
    Quantity("stress_magnitude", "S", "size of the stress, P (elastic) or sigma (viscous)", {"pressure": 1}),
    Quantity("radius", "R", "radius of the surface (half the thickness of a slab)", LENGTH, kind="scalar"),
    Quantity("thickness", "2R", "thickness of the slab, twice its radius", LENGTH, kind="scalar"),
    Quantity("area", r"|\Omega|", "area of the body", {"length": 2}, kind="scalar"),
    Quantity("volume", r"|\Omega|", "volume of the body", {"length": 3}, kind="scalar"),
    Quantity("cell_mass", r"\int \alpha", "cell fraction, integrated over the dimensionless body", kind="scalar"),
    Quantity("growth_rate", "R'", "growth rate of the radius", VELOCITY, kind="scalar"),
    Quantity("doubling_time", "T_2", "doubling time of the size", {"time": 1}, kind="scalar"),
    Quantity("C_min", r"C_\mathrm{min}", "least oxygen", {"concentration": 1}, kind="scalar"),
    Quantity("necrotic_fraction", r"\phi_\mathrm{nec}", "share of the body with C below C_necrotic", kind="scalar"),
    Quantity("necrotic_radius", r"R_\mathrm{nec}", "radius within which C is below C_necrotic", LENGTH, kind="scalar"),
    Quantity("hypoxic_radius", r"R_\mathrm{hyp}", "radius within which C is below C_hypoxic", LENGTH, kind="scalar"),
    Quantity("rim_width", r"R - R_\mathrm{nec}", "width of the rim around the necrotic core", LENGTH, kind="scalar"),
    Quantity("defect_cells", r"\delta_\alpha", "relative defect of the balance of cells", kind="scalar"),
    Quantity("defect_volume", r"\delta_V", "relative defect of the balance of volume", kind="scalar"),
)

_PANELS = (
    Panel("scalar", ("radius", "hypoxic_radius", "necrotic_radius", "rim_width"), "Radius: surface, hypoxia, necrosis; living rim"),
    Panel("scalar", ("growth_rate", "doubling_time"), "Growth rate and doubling time"),
    Panel("spacetime", ("alpha",), "Cell fraction, lines as above"),
    Panel("spacetime", ("C",), "Oxygen, lines as above"),
    Panel("ring", ("alpha",), "Section through the centre"),
    Panel("profile", ("alpha",), "Cell fraction"),
    Panel("profile", ("C",), "Oxygen"),
    Panel("profile", ("p",), "Fluid pressure"),
    Panel("profile", ("stress_magnitude",), "Size of the stress", round_only=True),  # 0 in a slab
    Panel("profile", ("displacement",), "Displacement"),
    Panel("profile", ("u",), "Velocity of the cells"),
)

_SHAPES = {
    "slab": "slab, from its middle",
    "disk": "disk in plane strain",
    "quarter_disk": "quarter disk in plane strain",
    "sphere": "sphere",
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


def _ring(geometry: Mapping[str, Any]) -> float | None:
    """Round bodies have no hole; a slab is flat."""
    return None if geometry.get("kind") == "slab" else 0.0


def _check(scene: Scene) -> None:
    if scene.output.vtk:
        raise ParameterError("output.vtk", "a copy for ParaView is for models in two dimensions; export this one as .csv instead.")
    solver, end = scene.solver, scene.time.end
    check(scene.parameters, scene.initial, scene.geometry, solver)
    if solver.dt is not None and end / solver.dt > solver.max_steps:
        raise ParameterError(
            "solver.dt", f"{solver.dt:g} needs {end / solver.dt:.3g} steps to the end, more than max_steps = {solver.max_steps}."
        )


def _plan(scene: Scene) -> Plan:
    """What is solved for, what is eliminated, and what a user of these values should know."""
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
    if scene.solver.alpha_step == "as-printed":
        warnings.append('alpha_step = "as-printed" does not keep the mass of cells; defect_cells tells by how much. "conservative" does.')
    if _may_buckle(scene):
        warnings.append(
            "an elastic disk with values like the paper's is expected to buckle at about t = 61 to 64 with lambda_alpha = 0, and not with "
            f"{STEADY_LAMBDA:g} or more; this run has {p.lambda_alpha:g} and holds it round, so from t = {BUCKLING_TIME:g} on it may show "
            "a state that a disk free to lose its shape does not keep."
        )
    return tuple(warnings)


def _may_buckle(scene: Scene) -> bool:
    """Whether a run goes on to where the paper's disk buckles, with values near the paper's."""
    p, geometry = scene.parameters, scene.geometry
    if geometry.eulerian or geometry.m != 2 or not p.lambda_alpha < STEADY_LAMBDA or not scene.time.end > BUCKLING_TIME:
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


def _scheme(scene: Scene, plan: Plan) -> Any:
    solver, geometry = scene.solver, scene.geometry
    method, time_scheme = solver.resolved
    if method == "fipy":
        from tumour.fipy_scheme import FipyScheme

        return FipyScheme(scene.parameters, scene.initial, geometry, solver)
    if geometry.eulerian:
        from tumour.schemes import ViscousLines, ViscousRadau

        viscous = ViscousRadau if time_scheme == "radau" else ViscousLines
        return viscous(scene.parameters, scene.initial, geometry, solver)
    from tumour.schemes import ElasticLines, ElasticRadau

    elastic = ElasticRadau if time_scheme == "radau" else ElasticLines
    return elastic(scene.parameters, scene.initial, geometry, solver)


def _summary(result: Result) -> list[tuple[str, str]]:
    """Size, growth, hypoxia, necrosis and balance defects at the last stored time, in the units of the scene."""
    shown = result.in_units()
    if shown.t.size == 0:
        return [("stored", "nothing yet")]

    def value(name: str, digits: int = 4, row: int = -1) -> str:
        unit = shown.unit(name)
        return f"{shown[name][row]:.{digits}g}" + (f" {unit}" if unit != "-" else "")

    rate, doubling = float(shown["growth_rate"][-1]), float(shown["doubling_time"][-1])
    size = next(name for name in ("thickness", "area", "volume") if name in shown)
    cells = "alpha not stored"
    if "alpha" in result.fields:
        alpha = result["alpha"][-1]
        cells = f"{alpha.min():.4f} to {alpha.max():.4f}"
    oxygen = f"{value('C_min')} at the least"
    if "C" in result.fields:
        oxygen = f"{shown['C'][-1, 0]:.4g} at the centre, {oxygen}"
    doubles = f"; the {size} doubles in {value('doubling_time')}" if np.isfinite(doubling) else "; it does not grow" if rate <= 0.0 else ""
    core = f"none, rim {value('rim_width')}"
    if result["necrotic_radius"][-1] > 0.0:
        share = 100.0 * result["necrotic_fraction"][-1]
        core = f"radius {value('necrotic_radius')}, {share:.3g} % of the body, rim {value('rim_width')}"
    hypoxic = f"radius {value('hypoxic_radius')}" if result["hypoxic_radius"][-1] > 0.0 else "none"
    defects = ", ".join(f"{name[7:]} {np.max(np.abs(result[name])):.0e}" for name in ("defect_cells", "defect_volume"))
    return [
        ("time", value("t", 5)),
        ("radius", f"{value('radius', 5)}  (from {value('radius', 4, 0)}), {size} {value(size, 5)}"),
        ("growth rate", f"{value('growth_rate')}{doubles}"),
        ("cell fraction", cells),
        ("oxygen", oxygen),
        ("hypoxic part", hypoxic),
        ("necrotic core", core),
        ("balance defects", f"{defects}  (relative, largest over the run)"),
    ]


MODEL = Model(
    name="tumour",
    title="Avascular tumour",
    parameters=TumourParameters,
    initial=TumourInitial,
    geometry=TumourGeometry,
    solver=TumourSolver,
    presets=PRESETS,
    quantities={q.name: q for q in _QUANTITIES},
    panels=_PANELS,
    film="alpha",
    scenes="tumour.scenes",
    check=_check,
    plan=_plan,
    scheme=_scheme,
    summary=_summary,
    ends=("centre", "surface"),
    ring=_ring,
    position="distance from the middle r",
    fronts=("hypoxic_radius", "necrotic_radius"),
)


def simulate(
    parameters: TumourParameters | None = None,
    *,
    initial: TumourInitial | None = None,
    t_end: float,
    geometry: str | Mapping[str, Any] | TumourGeometry = "disk",
    solver: str = "auto",
    cells: int = 200,
    rtol: float = 1e-4,
    time_scheme: str = "auto",
    dt: float | None = None,
    alpha_step: str = "conservative",
    max_steps: int = 100_000,
    save_at: Sequence[float] | None = None,
    save_every: float | None = None,
    file: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool | Tracker = False,
    trackers: Sequence[Tracker] = (),
    raise_on_failure: bool = True,
    scales: Any = None,
    title: str = "",
) -> Result:
    """Grow a tumour.

    Parameters
    ----------
    parameters : TumourParameters, optional
        The paper's values, with the mobility that follows from its equations, by default.
    initial : TumourInitial, optional
        The tumour at t = 0; a cell fraction of 0.8 by default.
    t_end : float
        End of the run (dimensionless, as everything here).
    geometry : {"disk", "quarter_disk", "sphere", "slab"}, mapping or TumourGeometry
        ``TumourGeometry(kind="sphere", radius=2.0, formulation="eulerian")`` for viscous cells in a larger ball; a mapping holds the
        same keys.
    solver : {"auto", "lines", "fipy"}
        The compiled method of lines ("auto"), or FiPy, which solves the Eulerian formulation only.
    cells : int
        Cells from the centre to the surface. Errors fall as 1/cells^2.
    rtol : float
        Accuracy in time: local errors of the cell fraction and relative errors of the radius.
    time_scheme : {"auto", "radau", "bdf2", "backward-euler"}
    dt : float, optional
        A fixed step; the error is then not controlled.
    alpha_step : {"conservative", "as-printed"}
        How a step changes the cell fraction. "as-printed" is the step of the authors' code, of backward Euler, which does not keep the
        mass of cells.
    save_at : sequence of float, optional
        Times to store, besides 0 and `t_end`; or `save_every`. 51 times by default.
    file : path, optional
        HDF5 file that grows with the run; `resume` goes on with it, `overwrite` replaces it.
    progress : bool or Tracker
        Show progress on standard error.
    trackers : sequence of multiphase.stepping.Tracker
    raise_on_failure : bool
        Raise SolverError (the default) or return a result with status "failed".
    scales : mapping, optional
        Physical units for display, as the table [scales] of a scene.

    Returns
    -------
    multiphase.Result
        Fields alpha, C, p, stress_magnitude, and displacement and J (Lagrangian) or u (Eulerian), (nt, cells), at x, the distances from
        the centre, (nt, cells); scalars radius, thickness, area or volume, cell_mass, growth_rate, doubling_time, C_min,
        necrotic_fraction, necrotic_radius, hypoxic_radius, rim_width, defect_cells, defect_volume, (nt,).

    Raises
    ------
    ParameterError
        A value that cannot be used, by its dotted path, before any work starts.
    SolverError
        The run could not go on.
    """
    from multiphase.run import make_scene, run

    if isinstance(geometry, str):
        geometry = TumourGeometry(kind=geometry)
    elif isinstance(geometry, Mapping):
        geometry = from_table(TumourGeometry, geometry, "geometry")
    if isinstance(initial, TumourInitial) and isinstance(geometry, TumourGeometry):
        initial = initial.within(geometry.radius)
    settings = {
        "method": solver, "cells": cells, "rtol": rtol, "time_scheme": time_scheme, "dt": dt, "alpha_step": alpha_step,
        "max_steps": max_steps,
    }  # fmt: skip
    scene = make_scene(
        MODEL,
        parameters,
        initial=initial,
        geometry=geometry,
        t_end=t_end,
        save_at=save_at,
        save_every=save_every,
        title=title,
        scales=scales,
        solver=settings,
    )
    return run(
        scene,
        file=file,
        existing="resume" if resume else "replace" if overwrite else "refuse",
        progress=progress,
        trackers=trackers,
        raise_on_failure=raise_on_failure,
    )
