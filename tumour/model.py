"""The radial tumour as a model of `multiphase`: its outputs, its plan, its checks, and `simulate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multiphase.errors import ParameterError
from multiphase.model import Model, Panel, Quantity
from multiphase.parameters import from_table
from multiphase.plan import Plan
from multiphase.stepping import Tracker
from tumour.boundary import BoundaryPart, TumourBoundary
from tumour.checks import check, check_boundary
from tumour.geometry import FILE_KINDS, TumourGeometry
from tumour.marks import marks_of
from tumour.parameters import ELASTIC_FIELDS, VISCOUS_FIELDS, TumourInitial, TumourParameters
from tumour.plan import plan_of
from tumour.presets import PRESETS
from tumour.profiles import profiles_of
from tumour.reductions import has_radial_data, is_radial, uniform_because
from tumour.solver import TumourSolver

if TYPE_CHECKING:
    from multiphase.result import Result
    from multiphase.scene import Scene

VELOCITY = {"length": 1, "time": -1}
LENGTH = {"length": 1}

_OF_MESH = "it measures the error of the mesh first of all"
_UNBOUNDED = "it has no bound where growth ends; growth rate and size have one"

_QUANTITIES = (
    Quantity("alpha", r"\alpha", "cell fraction"),
    Quantity("C", "C", "oxygen", {"concentration": 1}),
    Quantity("p", "p", "fluid pressure", {"pressure": 1}),
    Quantity("displacement", "d", "displacement of the cells; radial: r - R", LENGTH),
    Quantity("u", "u", "velocity of the cells", VELOCITY),
    Quantity("J", "J", "volume over that at rest"),
    Quantity("stress_magnitude", "S", "size of the stress, P (elastic) or sigma (viscous)", {"pressure": 1}),
    Quantity("radius", "R", "radius of the surface (half the thickness of a slab)", LENGTH, kind="scalar"),
    Quantity("thickness", "2R", "thickness of the slab, twice its radius", LENGTH, kind="scalar"),
    Quantity("area", r"|\Omega|", "area of the body", {"length": 2}, kind="scalar"),
    Quantity("volume", r"|\Omega|", "volume of the body", {"length": 3}, kind="scalar"),
    Quantity("cell_mass", r"\int \alpha", "cell fraction, integrated over the dimensionless body", kind="scalar"),
    Quantity("growth_rate", "R'", "growth rate of the radius", VELOCITY, kind="scalar"),
    Quantity("doubling_time", "T_2", "doubling time of the size", {"time": 1}, kind="scalar", no_say=_UNBOUNDED),
    Quantity("C_min", r"C_\mathrm{min}", "least oxygen", {"concentration": 1}, kind="scalar"),
    Quantity("necrotic_fraction", r"\phi_\mathrm{nec}", "share of the body with C below C_necrotic", kind="scalar"),
    Quantity("hypoxic_fraction", r"\phi_\mathrm{hyp}", "share of the body with C below C_hypoxic", kind="scalar"),
    Quantity("asymmetry", r"a", "largest over least distance of the surface from the middle, less 1", kind="scalar", no_say=_OF_MESH),
    Quantity("necrotic_radius", r"R_\mathrm{nec}", "radius within which C is below C_necrotic", LENGTH, kind="scalar"),
    Quantity("hypoxic_radius", r"R_\mathrm{hyp}", "radius within which C is below C_hypoxic", LENGTH, kind="scalar"),
    Quantity("rim_width", r"R - R_\mathrm{nec}", "width of the rim around the necrotic core", LENGTH, kind="scalar"),
    Quantity("defect_cells", r"\delta_\alpha", "relative defect of the balance of cells", kind="scalar"),
    Quantity("defect_volume", r"\delta_V", "relative defect of the balance of volume", kind="scalar"),
)

_PANELS = (
    Panel(
        "scalar",
        ("radius", "hypoxic_radius", "necrotic_radius", "rim_width"),
        "Radius: surface, hypoxia, necrosis; living rim",
        grid="line",
    ),
    Panel("scalar", ("radius", "area"), "Size of the body", grid="triangles"),
    Panel("scalar", ("growth_rate", "doubling_time"), "Growth rate and doubling time"),
    Panel("scalar", ("hypoxic_fraction", "necrotic_fraction"), "Hypoxic and necrotic share", grid="triangles"),
    Panel("scalar", ("asymmetry",), "Departure from symmetry", grid="triangles"),
    Panel("rest", (), "Tissue at rest"),
    Panel("maps", ("alpha",), "Cell fraction on the growing body"),
    Panel("map", ("displacement",), "Displacement"),
    Panel("map", ("alpha",), "Cell fraction"),
    Panel("map", ("p",), "Fluid pressure"),
    Panel("map", ("C",), "Oxygen"),
    Panel("map", ("stress_magnitude",), "Size of the stress", log=True),
    Panel("map", ("J",), "Volume over that at rest"),
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


def _ring(geometry: Mapping[str, Any]) -> float | None:
    """Round bodies have no hole; a slab is flat."""
    return None if geometry.get("kind") == "slab" else 0.0


def _complete(scene: Scene) -> dict[str, Any]:
    """The dimension that "auto" stands for where the body is round but not solved along its radius, and the solver with what its defaults
    stand for on this body."""
    geometry = scene.geometry
    if geometry.dimension == "auto" and geometry.kind in ("disk", "quarter_disk") and not geometry.eulerian and not is_radial(scene):
        geometry = replace(geometry, dimension="2d")
    return {"geometry": geometry, "solver": scene.solver.within(geometry)}


def _check(scene: Scene) -> None:
    geometry = scene.geometry
    if scene.output.vtk and not geometry.plane:
        raise ParameterError("output.vtk", "a copy for ParaView is for bodies in two dimensions; export this one as .csv instead.")
    solver, end = scene.solver, scene.time.end
    check(scene.parameters, scene.initial, scene.geometry, solver)
    check_boundary(scene.boundary, geometry)
    produced = VISCOUS_FIELDS if geometry.eulerian else ELASTIC_FIELDS
    for name in scene.output.fields or ():
        if name not in produced:
            raise ParameterError("output.fields", f'this scene has no field "{name}"; it has {", ".join(produced)}.')
    if geometry.plane:
        from tumour.fem.bodies import body_of, check_fraction, check_tissue

        if not scene.parameters.is_plain:
            check_tissue(scene.parameters, body_of(geometry, solver.cells))
        if geometry.kind in FILE_KINDS or scene.initial.alpha.constant is None:
            check_fraction(scene.initial, body_of(geometry, solver.cells))
        if not scene.boundary.is_plain:
            from tumour.fem.surface import Surface

            Surface(body_of(geometry, solver.cells), scene.boundary, scene.parameters)  # refuses what cannot be
    if solver.dt is not None and end / solver.dt > solver.max_steps:
        raise ParameterError(
            "solver.dt", f"{solver.dt:g} needs {end / solver.dt:.3g} steps to the end, more than max_steps = {solver.max_steps}."
        )


def _trackers(scene: Scene) -> tuple[Tracker, ...]:
    """A watch on the shape of a body in two dimensions, and on the stiffness that keeps a radial disk or ball round."""
    if not scene.geometry.plane:
        if scene.geometry.m == 1 or scene.geometry.eulerian:
            return ()
        from tumour.stability.watch import trackers

        return trackers(scene)
    from tumour.fem.bodies import body_of
    from tumour.fem.watch import Shape

    uniform = has_radial_data(scene)
    return (Shape(body_of(scene.geometry, scene.solver.cells), is_uniform=uniform),)


def _scheme(scene: Scene, plan: Plan) -> Any:
    solver, geometry = scene.solver, scene.geometry
    method, time_scheme = solver.resolved
    if method == "mini":
        from tumour.fem.bodies import body_of
        from tumour.fem.mirror import mirror_of_scene
        from tumour.fem.scheme import MiniScheme

        body = body_of(geometry, solver.cells)
        return MiniScheme(scene.parameters, scene.initial, body, solver, scene.boundary, mirror_of_scene(scene))
    if method == "fipy":
        from tumour.fipy_scheme import FipyScheme

        return FipyScheme(scene.parameters, scene.initial, geometry, solver)
    from tumour import schemes

    name = ("Viscous" if geometry.eulerian else "Elastic") + ("Radau" if time_scheme == "radau" else "Lines")
    kind = getattr(schemes, f"Uniform{name}" if uniform_because(scene) else name)
    return kind(scene.parameters, scene.initial, geometry, solver)


def _summary(result: Result) -> list[tuple[str, str]]:
    """Size, growth, hypoxia, necrosis and balance defects at the last stored time, in the units of the scene."""
    shown = result.in_units()
    if shown.t.size == 0:
        return [("stored", "nothing yet")]

    def value(name: str, digits: int = 4, row: int = -1) -> str:
        unit = shown.unit(name)
        return f"{shown[name][row]:.{digits}g}" + (f" {unit}" if unit != "-" else "")

    doubling = float(shown["doubling_time"][-1])
    size = next(name for name in ("thickness", "area", "volume") if name in shown)
    doubles = f"the {size} doubles in {value('doubling_time')}" if np.isfinite(doubling) else "it does not grow"
    cells = "alpha not stored"
    if "alpha" in result.fields:
        alpha = result["alpha"][-1]
        cells = f"{alpha.min():.4f} to {alpha.max():.4f}"
    oxygen = f"{value('C_min')} at the least"
    if "C" in result.fields and result.mesh is None:
        oxygen = f"{shown['C'][-1, 0]:.4g} at the centre, {oxygen}"
    lines = [("time", value("t", 5))]
    if "radius" in shown:
        lines += [("radius", f"{value('radius', 5)}  (from {value('radius', 4, 0)}), {size} {value(size, 5)}")]
        lines += [("growth rate", f"{value('growth_rate')}; {doubles}")]
    else:
        lines += [(size, f"{value(size, 5)}  (from {value(size, 4, 0)}); {doubles}")]
    lines += [("cell fraction", cells), ("oxygen", oxygen), *_cores(result, value)]
    if "asymmetry" in shown:
        lines += [("asymmetry", f"{value('asymmetry', 2)}  (largest over least distance of the surface from the middle, less 1)")]
    if "stress_magnitude" in result.fields and result.mesh is not None:
        lines += [("stress |P|", _largest(shown, "stress_magnitude"))]
    defects = ", ".join(f"{name[7:]} {np.max(np.abs(result[name])):.0e}" for name in ("defect_cells", "defect_volume"))
    return [*lines, ("balance defects", f"{defects}  (relative, largest over the run)")]


def _cores(result: Result, value: Callable[..., str]) -> list[tuple[str, str]]:
    """Hypoxia and necrosis, by radius or by share of the body."""
    if "necrotic_radius" not in result:
        shares = [100.0 * result[name][-1] for name in ("hypoxic_fraction", "necrotic_fraction")]
        texts = [f"{share:.3g} % of the body" if share > 0.0 else "none" for share in shares]
        return [("hypoxic part", texts[0]), ("necrotic part", texts[1])]
    core = f"none, rim {value('rim_width')}"
    if result["necrotic_radius"][-1] > 0.0:
        share = 100.0 * result["necrotic_fraction"][-1]
        core = f"radius {value('necrotic_radius')}, {share:.3g} % of the body, rim {value('rim_width')}"
    hypoxic = f"radius {value('hypoxic_radius')}" if result["hypoxic_radius"][-1] > 0.0 else "none"
    return [("hypoxic part", hypoxic), ("necrotic core", core)]


def _largest(shown: Result, name: str) -> str:
    """The largest value of a field on a mesh, and where it is at rest."""
    assert shown.mesh is not None
    values = shown[name][-1]
    at = int(np.argmax(values))
    x, y = shown.mesh.points[at]
    unit = shown.unit(name)
    return f"{values[at]:.4g}{'' if unit == '-' else ' ' + unit} at the most, at ({x:.3g}, {y:.3g}) of the body at rest"


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
    complete=_complete,
    check=_check,
    plan=plan_of,
    scheme=_scheme,
    trackers=_trackers,
    summary=_summary,
    ends=("centre", "surface"),
    ring=_ring,
    position="distance from the middle r",
    fronts=("hypoxic_radius", "necrotic_radius"),
    boundary=TumourBoundary,
    marks=marks_of,
    profiles=profiles_of,
)


def simulate(
    parameters: TumourParameters | None = None,
    *,
    initial: TumourInitial | Mapping[str, Any] | None = None,
    t_end: float,
    geometry: str | Mapping[str, Any] | TumourGeometry = "disk",
    boundary: Mapping[str, BoundaryPart | Mapping[str, Any]] | TumourBoundary | None = None,
    solver: str = "auto",
    cells: int | None = None,
    rtol: float = 1e-4,
    time_scheme: str = "auto",
    dt: float | None = None,
    alpha_step: str = "conservative",
    max_steps: int = 100_000,
    newton_tol: float | None = None,
    linear: str = "auto",
    assembly: str = "compiled",
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
    reduce: bool = True,
) -> Result:
    """Grow a tumour.

    Parameters
    ----------
    parameters : TumourParameters, optional
        The paper's values, with the mobility that follows from its equations, by default.
    initial : TumourInitial or mapping, optional
        The tumour at t = 0; a cell fraction of 0.8 by default.
    t_end : float
        End of the run (dimensionless, as everything here).
    geometry : {"disk", "quarter_disk", "sphere", "slab", "glioma"}, mapping or TumourGeometry
        ``TumourGeometry(kind="sphere", radius=2.0, formulation="eulerian")`` for viscous cells in a larger ball; a mapping holds the
        same keys: ``{"kind": "quarter_disk", "dimension": "2d"}``.
    boundary : mapping of str to BoundaryPart or mapping, or TumourBoundary, optional
        Two dimensions: named parts of the free surface and what acts on them,
        ``{"bone": {"where": "y < -0.5", "displacement_x": 0, "displacement_y": 0, "p": "closed", "C": "closed"}}``. What no part claims
        is free of traction, at p_out and C_out. Of what two parts prescribe at a point that they share, that of the first one holds.
    solver : {"auto", "lines", "fipy", "mini"}
        Of radial bodies the compiled method of lines ("auto"), or FiPy, which solves the Eulerian formulation only; in two dimensions
        MINI finite elements.
    cells : int, optional
        Cells, or triangles, from the centre to the surface: 200 in radial bodies, 40 in disks in two dimensions, 20 in other shapes
        unless given. Errors fall as 1/cells^2.
    rtol : float
        Accuracy in time: local errors of the cell fraction and relative errors of the radius.
    time_scheme : {"auto", "radau", "bdf2", "backward-euler"}
    dt : float, optional
        A fixed step; the error is then not controlled.
    alpha_step : {"conservative", "as-printed"}
        How a step changes the cell fraction. "as-printed" is the step of the authors' code, of backward Euler, which does not keep the
        mass of cells.
    newton_tol : float, optional
        Two dimensions: error that Newton's method may leave in a step; a hundredth of rtol unless given.
    linear : {"auto", "pardiso", "superlu"}
        Two dimensions: the solver of linear systems.
    assembly : {"compiled", "forms"}
        Two dimensions: the compiled element kernel, or the readable forms that specify it.
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
    reduce : bool
        Solve the smallest system that gives the answer (the default), or the full one.

    Returns
    -------
    multiphase.Result
        Fields alpha, C, p, stress_magnitude, and displacement and J (Lagrangian) or u (Eulerian), (nt, cells), at x, the distances from
        the centre, (nt, cells); scalars radius, thickness, area or volume, cell_mass, growth_rate, doubling_time, C_min,
        necrotic_fraction, necrotic_radius, hypoxic_radius, rim_width, defect_cells, defect_volume, (nt,). In two dimensions the fields
        are at the points of `mesh`, (nt, points), the displacement (nt, points, 2); scalars are area, cell_mass, doubling_time, C_min,
        necrotic_fraction, hypoxic_fraction, defect_cells, defect_volume, and of disks radius, growth_rate and asymmetry.

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
    if isinstance(initial, Mapping):
        initial = from_table(TumourInitial, initial, "initial")
    if isinstance(initial, TumourInitial) and isinstance(geometry, TumourGeometry):
        initial = initial.within(geometry.radius)
    if isinstance(parameters, TumourParameters) and isinstance(geometry, TumourGeometry):
        parameters = parameters.within(geometry.radius)
    settings = {
        "method": solver, "cells": cells, "rtol": rtol, "time_scheme": time_scheme, "dt": dt, "alpha_step": alpha_step,
        "max_steps": max_steps, "newton_tol": newton_tol, "linear": linear, "assembly": assembly,
    }  # fmt: skip
    scene = make_scene(
        MODEL,
        parameters,
        initial=initial,
        geometry=geometry,
        boundary=boundary,
        t_end=t_end,
        save_at=save_at,
        save_every=save_every,
        title=title,
        scales=scales,
        solver=settings,
        reduce=reduce,
    )
    return run(
        scene,
        file=file,
        existing="resume" if resume else "replace" if overwrite else "refuse",
        progress=progress,
        trackers=trackers,
        raise_on_failure=raise_on_failure,
    )
