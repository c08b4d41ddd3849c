"""The plaque as a model of `multiphase`: its outputs, its plan, its checks, and `simulate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from multiphase.errors import ParameterError
from multiphase.model import Model, Panel, Quantity
from multiphase.plan import Plan
from multiphase.stepping import Tracker
from plaque1d.parameters import PRESETS, PlaqueGeometry, PlaqueInitial, PlaqueParameters, PlaqueSolver, check
from plaque1d.plan import plan_of
from plaque1d.reductions import fixed_fractions_because
from plaque1d.stability import ShortWaves

if TYPE_CHECKING:
    from multiphase.result import Result
    from multiphase.scene import Scene
    from plaque1d.extensions import ExtraTerms

VELOCITY = {"length": 1, "time": -1}

_QUANTITIES = (
    Quantity("n", "n", "necrotic fraction"),
    Quantity("c", "c", "macrophage fraction"),
    Quantity("l", "l", "modified LDL", {"concentration": 1}),
    Quantity("u_n", "u_n", "velocity of the necrotic phase", VELOCITY),
    Quantity("u_m", "u_m", "velocity of the macrophages", VELOCITY),
    Quantity("p_n", "p_n", "pressure of the necrotic phase", {"pressure": 1}),
    Quantity("L", "L", "width of the intima", {"length": 1}, kind="scalar"),
    Quantity("L_rate", "L'", "growth rate of the width", VELOCITY, kind="scalar"),
    Quantity("l_wall", "l(0)", "modified LDL at the endothelium", {"concentration": 1}, kind="scalar"),
    Quantity("n_wall", "n(0)", "necrotic fraction at the endothelium", kind="scalar"),
    Quantity("n_total", r"\int n\,dx", "amount of the necrotic phase", {"length": 1}, kind="scalar"),
    Quantity("c_total", r"\int c\,dx", "amount of macrophages", {"length": 1}, kind="scalar"),
    Quantity("l_total", r"\int l\,dx", "amount of modified LDL", {"concentration": 1, "length": 1}, kind="scalar"),
    Quantity("defect_L", r"\delta_L", "relative defect of the balance of the width", kind="scalar"),
    Quantity("defect_n", r"\delta_n", "relative defect of the balance of the necrotic phase", kind="scalar"),
    Quantity("defect_c", r"\delta_c", "relative defect of the balance of macrophages", kind="scalar"),
    Quantity("defect_l", r"\delta_l", "relative defect of the balance of modified LDL", kind="scalar"),
)

_PANELS = (
    Panel("scalar", ("L", "L_rate"), "Width of the intima and its growth rate"),
    Panel("spacetime", ("n",), "Necrotic fraction on the growing intima"),
    Panel("ring", ("n",), "Cross-section of the vessel"),
    Panel("profile", ("n",), "Necrotic fraction"),
    Panel("profile", ("l",), "Modified LDL"),
    Panel("profile", ("u_n", "u_m"), "Velocities of the phases"),
    Panel("profile", ("p_n",), "Pressure"),
)


def _ring(geometry: Mapping[str, Any]) -> float | None:
    """R_1 of the annulus."""
    return geometry["lumen_radius"] if geometry.get("kind") == "annulus" else None


def _check(scene: Scene) -> None:
    if scene.output.vtk:
        raise ParameterError("output.vtk", "a copy for ParaView is for models in two dimensions; export the plaque as .csv instead.")
    check(scene.parameters, scene.initial)
    if scene.geometry.annulus and scene.solver.method == "fipy" and scene.parameters.momentum == "drag":
        raise ParameterError("solver.method", '"fipy" has no drag form in the annulus; write method = "lines", or change the form.')
    if scene.geometry.annulus:
        _check_hoop(scene.parameters)
    solver, end = scene.solver, scene.time.end
    if solver.dt is not None and end / solver.dt > solver.max_steps:
        raise ParameterError(
            "solver.dt", f"{solver.dt:g} needs {end / solver.dt:.3g} steps to the end, more than max_steps = {solver.max_steps}."
        )


def _check_hoop(p: PlaqueParameters) -> None:
    """In the annulus strain dissipates, nu (e_r^2 + e_theta^2)/2 + lambda e_r e_theta >= 0, only for lambda >= -mu."""
    for phase, mu, lambda_ in (("n", p.mu_n, p.lambda_n), ("m", p.mu_m, p.lambda_m)):
        if lambda_ < -mu:
            raise ParameterError(
                f"parameters.lambda_{phase}",
                f"{lambda_:g} is below -mu_{phase} = {-mu:g}: in the annulus a strain would then gain energy. Take {-mu:g} or more.",
            )


def _trackers(scene: Scene) -> tuple[Tracker, ...]:
    return (ShortWaves(scene.parameters),) if scene.parameters.momentum == "drag" else ()


def _scheme(scene: Scene, plan: Plan, *, extra_terms: ExtraTerms | None = None) -> Any:
    solver, geometry = scene.solver, scene.geometry
    method, time_scheme = solver.resolved
    if method == "fipy":
        from plaque1d.fipy_scheme import FipyScheme

        return FipyScheme(scene.parameters, scene.initial, geometry, solver.cells, solver.rtol, extra_terms)
    if extra_terms is not None:
        raise ParameterError("solver.method", f'"{solver.method}" takes no extra_terms; they are FiPy terms, so write method = "fipy".')
    from plaque1d import lines_scheme

    is_fixed, own = bool(fixed_fractions_because(scene)), time_scheme == "radau"
    whole = lines_scheme.RadauLines if own else lines_scheme.LinesScheme
    fixed = lines_scheme.FixedFractionsRadau if own else lines_scheme.FixedFractionsLines
    return (fixed if is_fixed else whole)(scene.parameters, scene.initial, geometry, solver.cells, solver.rtol)


def _summary(result: Result) -> list[tuple[str, str]]:
    """Width, growth, necrosis and balance defects at the last stored time, in the units of the scene."""
    shown = result.in_units()
    if shown.t.size == 0:
        return [("stored", "nothing yet")]

    def value(name: str, digits: int = 5) -> str:
        unit = shown.unit(name)
        return f"{shown[name][-1]:.{digits}g}" + (f" {unit}" if unit != "-" else "")

    first = f"{shown['L'][0]:.4g}" + (f" {shown.unit('L')}" if shown.unit("L") != "-" else "")
    n_share = float(result["n_total"][-1] / (result["n_total"][-1] + result["c_total"][-1]))
    core = "n not stored"
    if "n" in result.fields:
        fraction = float(np.mean(result["n"][-1] > 0.9 + 1e-9))
        core = f"n > 0.9 in {100.0 * fraction:.0f} % of the wall, n from {result['n'][-1].min():.3f} to {result['n'][-1].max():.3f}"
    defects = ", ".join(f"{name[7:]} {np.max(np.abs(result[name])):.0e}" for name in ("defect_L", "defect_n", "defect_c", "defect_l"))
    return [
        ("time", f"{shown.t[-1]:.5g}" + (f" {shown.unit('t')}" if shown.unit("t") != "-" else "")),
        ("width L", f"{value('L')}  (from {first})"),
        ("growth rate L'", value("L_rate", 4)),
        ("necrotic fraction", f"{n_share:.4f} on average, {result['n_wall'][-1]:.4f} at the endothelium"),
        ("necrotic core", core),
        ("balance defects", f"{defects}  (relative, largest over the run)"),
    ]


MODEL = Model(
    name="plaque",
    title="Early atherosclerotic plaque",
    parameters=PlaqueParameters,
    initial=PlaqueInitial,
    geometry=PlaqueGeometry,
    solver=PlaqueSolver,
    presets=PRESETS,
    quantities={q.name: q for q in _QUANTITIES},
    panels=_PANELS,
    film="n",
    scenes="plaque1d.scenes",
    check=_check,
    plan=plan_of,
    scheme=_scheme,
    summary=_summary,
    ends=("lumen | endothelium", "media"),
    trackers=_trackers,
    ring=_ring,
)


def simulate(
    parameters: PlaqueParameters | None = None,
    *,
    initial: PlaqueInitial | Mapping[str, Any] | None = None,
    t_end: float,
    geometry: str | PlaqueGeometry = "slab",
    solver: str = "auto",
    cells: int = 100,
    rtol: float = 1e-4,
    time_scheme: str = "auto",
    dt: float | None = None,
    max_steps: int = 100_000,
    save_at: Sequence[float] | None = None,
    save_every: float | None = None,
    file: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool | Tracker = False,
    trackers: Sequence[Tracker] = (),
    raise_on_failure: bool = True,
    extra_terms: Callable[..., Any] | None = None,
    scales: Any = None,
    title: str = "",
    reduce: bool = True,
) -> Result:
    """Grow a plaque.

    Parameters
    ----------
    parameters : PlaqueParameters, optional
        The preset `demo` by default.
    initial : PlaqueInitial or mapping, optional
        The intima at t = 0; that of the preset `demo` by default.
    t_end : float
        End of the run (dimensionless, as everything here).
    geometry : "slab" or PlaqueGeometry
        ``PlaqueGeometry(kind="annulus", lumen_radius=10.0)`` for the wall of a round vessel.
    solver : {"auto", "lines", "fipy"}
        The compiled method of lines ("auto" without `extra_terms`), or FiPy.
    cells : int
        Equal cells in xi = x / L. The error of n falls as 1/cells^2.
    rtol : float
        Accuracy in time: local errors of the fractions and relative errors of l and L.
    time_scheme : {"auto", "radau", "bdf2", "backward-euler"}
    dt : float, optional
        A fixed step; the error is then not controlled.
    save_at : sequence of float, optional
        Times to store, besides 0 and `t_end`; or `save_every`. 51 times by default.
    file : path, optional
        HDF5 file that grows with the run; `resume` goes on with it, `overwrite` replaces it.
    progress : bool or Tracker
        Show progress on standard error.
    trackers : sequence of multiphase.stepping.Tracker
    raise_on_failure : bool
        Raise SolverError (the default) or return a result with status "failed".
    extra_terms : callable, optional
        Further FiPy terms and species; see `plaque1d.extensions`.
    scales : mapping, optional
        Physical units for display, as the table [scales] of a scene.
    reduce : bool
        Solve the smallest system that gives the answer (the default), or the full one.

    Returns
    -------
    multiphase.Result
        Fields n, c, l, u_n, u_m, p_n, (nt, cells), at x, (nt, cells); scalars L, L_rate, l_wall, n_wall, n_total, c_total, l_total,
        defect_L, defect_n, defect_c, defect_l, (nt,).

    Raises
    ------
    ParameterError
        A value that cannot be used, by its dotted path, before any work starts.
    SolverError
        The run could not go on.
    """
    from multiphase.run import make_scene, run

    if extra_terms is not None and solver == "auto":
        solver = "fipy"
    settings = {"method": solver, "cells": cells, "rtol": rtol, "time_scheme": time_scheme, "dt": dt, "max_steps": max_steps}
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
        reduce=reduce,
    )
    return run(
        scene,
        file=file,
        existing="resume" if resume else "replace" if overwrite else "refuse",
        progress=progress,
        trackers=trackers,
        raise_on_failure=raise_on_failure,
        options={"extra_terms": extra_terms},
    )
