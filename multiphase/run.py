"""From a checked scene to a result: build, resume, integrate, record, and say how it ended."""

from __future__ import annotations

import errno
import importlib.metadata
import json
import logging
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from threadpoolctl import ThreadpoolController

from multiphase import storage, vtkhdf
from multiphase.errors import ParameterError, SolverError
from multiphase.model import Model
from multiphase.parameters import from_table
from multiphase.plan import Plan
from multiphase.result import Result
from multiphase.scales import Scales
from multiphase.scene import OutputTable, PlanTable, Scene, TimeTable, differences, parse_scene
from multiphase.stepping import Control, State, StopRun, Tracker, integrate, start
from multiphase.trackers import Balances, Interrupts, Progress, Recorder

logger = logging.getLogger("multiphase")

PACKAGES = ("multiphase-tissue", "numpy", "scipy", "numba", "fipy", "scikit-fem", "h5py")

Existing = Literal["refuse", "resume", "replace"]


class Terminated(BaseException):
    """Raised in the main thread on SIGTERM, so that a run ends as it does on Ctrl-C."""


def run(
    scene: Scene,
    *,
    file: str | Path | None = None,
    existing: Existing = "refuse",
    progress: bool | Tracker = False,
    trackers: Sequence[Tracker] = (),
    threads: int = 1,
    raise_on_failure: bool = True,
    options: Mapping[str, Any] | None = None,
) -> Result:
    """Run `scene` and return its result, written to `file` as it grows.

    Parameters
    ----------
    scene : Scene
    file : path, optional
        HDF5 file, whole at every moment. Without it the result is only returned.
    existing : {"refuse", "resume", "replace"}
        What to do when `file` exists. "resume" goes on from its last state if the scene is the same but for a later end.
    progress : bool or Tracker
    trackers : sequence of Tracker
        Further trackers, called in this order.
    threads : int
        Threads of the linear algebra; one is fastest for one-dimensional models.
    raise_on_failure : bool
        Raise SolverError when the run cannot go on (the default); otherwise return the result with status "failed".
    options : mapping, optional
        Passed to the model's scheme, for instance `extra_terms`.

    Returns
    -------
    Result
        With status "completed", "stopped" (by a tracker) or "failed".

    Raises
    ------
    ParameterError
        An existing file, or one that does not fit the scene.
    SolverError
        The run could not go on; everything up to the last good step is in the file and in the error's `result`.
    """
    path = Path(file) if file is not None else None
    for tracker in trackers:
        if not hasattr(tracker, "on_step"):
            raise ParameterError("trackers", f"{tracker!r} is not a tracker; see multiphase.trackers.")
    result = _prepare(scene, path, existing)
    if result.status == "completed" and result.t.size and result.t[-1] >= scene.time.end:
        _write_copy(result, scene, path, missing_only=True)
        return result
    scene = _with_spacing_of(scene, result)
    with storage.claimed(path), Interrupts() as interrupts:
        try:
            result = _execute(scene, path, result, progress, [*trackers, interrupts], threads, raise_on_failure, options or {})
        except SolverError as error:
            if isinstance(error.result, Result) and path is not None and path.exists():
                _write_copy(error.result, scene, path)
            raise
        _write_copy(result, scene, path)
        return result


def _execute(
    scene: Scene,
    path: Path | None,
    result: Result,
    progress: bool | Tracker,
    trackers: Sequence[Tracker],
    threads: int,
    raise_on_failure: bool,
    options: Mapping[str, Any],
) -> Result:
    """Go on from `result` to the end of the scene."""
    plan = scene.model.plan(scene)
    for warning in plan.warnings:
        logger.warning("%s", warning)
    before = float(result.stats.get("wall_s", 0.0))
    preparing = time.perf_counter()
    try:
        scheme = scene.model.scheme(scene, plan, **options)
        with _libraries(len(sys.modules)).limit(limits=threads):
            if hasattr(scheme, "prepare"):
                scheme.prepare()
            state, remaining = _starting_state(scene, scheme, result)
    except ArithmeticError as error:
        raise SolverError(
            f"the initial state cannot be evaluated ({error}); are its values, and the parameters, of the right size?"
        ) from error
    _describe(result, scene, plan, scheme, threads)
    recorder = Recorder(result, path, scene.output.fields)
    recorder.state = state
    started = time.perf_counter()  # imports and compilation, which only a first run pays, are not counted as its cost
    result.stats = result.stats | {"setup_s": started - preparing}
    hooks = [recorder, Balances(plan.balance_limit, plan.open_balances), *scene.model.trackers(scene), *trackers]
    if progress:
        hooks.append(progress if isinstance(progress, Tracker) else Progress())

    def finish(status: Literal["completed", "stopped", "failed"], message: str) -> Result:
        done = recorder.collect()
        done.status, done.message = status, message
        own = scheme.statistics() if hasattr(scheme, "statistics") else {}
        done.stats = done.stats | {"wall_s": before + time.perf_counter() - started} | own
        for hook in hooks:
            hook.on_end(recorder.state or state, status, message)
        recorder.write()
        return done

    def reached() -> float:
        return (recorder.state or state).t

    again = f"run it again with --resume and -o {path} (in Python: file and resume=True)" if path else "give the run a file to resume from"
    try:
        try:
            with _libraries(len(sys.modules)).limit(limits=threads):
                if remaining:  # nothing remains of a run that was stopped at its end
                    state = integrate(scheme, state, remaining, _control(scene), hooks)
            return finish("completed", f"reached the end, t = {state.t:.6g}")
        except StopRun as stop:
            return finish("stopped", f"stopped at t = {reached():.6g}: {stop}. To go on, {again}.")
        except SolverError as error:
            failed = finish("failed", f"{error} Everything up to t = {error.time:.6g} is kept.")
            if not raise_on_failure:
                return failed
            error.result = failed
            raise
        except (KeyboardInterrupt, Terminated):
            finish("stopped", f"interrupted at t = {reached():.6g}, after the last good step. To go on, {again}.")
            raise
    except OSError as error:
        for hook in hooks:
            hook.on_end(recorder.state or state, "failed", str(error))
        raise _disk_error(error, path, recorder) from error


def _write_copy(result: Result, scene: Scene, path: Path | None, *, missing_only: bool = False) -> None:
    """Write the copy for ParaView that a scene asks for; raises SolverError where that cannot be written."""
    if not scene.output.vtk or path is None or (missing_only and vtkhdf.copy_of(path).exists()):
        return
    try:
        vtkhdf.write_copy(result, path)
    except OSError as error:
        copy = vtkhdf.copy_of(path)
        raise SolverError(
            f"{copy} could not be written ({error.strerror or error}); {path} is whole. Free some space, then make the copy with "
            f"`multiphase export {path} -o {copy}`, or run it again with --resume.",
            time=float(result.t[-1]) if result.t.size else 0.0,
            result=result,
        ) from error


def _disk_error(error: OSError, path: Path | None, recorder: Recorder) -> SolverError:
    full = error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT) if hasattr(errno, "EDQUOT") else error.errno == errno.ENOSPC
    why = "the disk is full or the file may not grow" if full else str(error)
    kept = "nothing had been saved yet"
    if path is not None and path.exists():
        saved = storage.read(path)
        kept = f"what was saved up to t = {saved.t[-1]:.6g} is intact" if saved.t.size else "the file is intact"
    at = recorder.state.t if recorder.state else float("nan")
    return SolverError(
        f"{path} could not be written at t = {at:.6g} ({why}); {kept}. Free some space, then go on from there.",
        time=at,
        history=[str(error)],
        result=recorder.collect(),
    )


def _prepare(scene: Scene, path: Path | None, existing: Existing) -> Result:
    """An empty result, or the stored one that this run goes on with."""
    empty = Result(model=scene.model.name, t=np.empty(0))
    if path is None:
        if existing == "resume":
            raise ParameterError("file", "resume needs the file of the run to go on with.")
        return empty
    storage.check_target(path)
    if scene.output.vtk:
        storage.check_target(vtkhdf.copy_of(path), "output.vtk")
    if not path.exists() or existing == "replace":
        return empty
    if existing == "refuse":
        raise ParameterError(
            "output.file",
            f"{path} exists already. Take --resume to go on with it, --force to replace it, or -o for another name "
            "(in Python: resume=True, overwrite=True, file=...).",
        )
    stored = storage.read(path)
    old = parse_scene(stored.scene, name=scene.name)
    scene = _with_spacing_of(scene, stored)
    changes = [line for line in differences(old, scene) if not (line.startswith("time.end") and scene.time.end >= old.time.end)]
    if changes:
        raise ParameterError(
            "--resume",
            f"{path} was made by another scene: {'; '.join(changes)}. Run that scene, or take -o for another file, or --force to replace "
            "it (in Python: file=..., overwrite=True).",
        )
    return stored


def _with_spacing_of(scene: Scene, stored: Result) -> Scene:
    """A longer run that leaves the spacing of its output times to the default goes on with that of the stored one."""
    if not stored.scene or not scene.time.default_spacing:
        return scene
    old = parse_scene(stored.scene, name=scene.name).time
    if old.save_every is None:
        return scene
    return scene.with_changes(time={"end": scene.time.end, "save_every": old.save_every})


def _starting_state(scene: Scene, scheme: Any, result: Result) -> tuple[State, list[float]]:
    """Where to start from, and the output times still to come."""
    save_at = list(scene.time.save_at)
    if not result.checkpoint:
        return start(scheme, save_at[0], save_at[1], _control(scene)), save_at
    state = State.from_arrays(result.checkpoint)
    mesh = getattr(scheme, "mesh", None)
    if (mesh is None) != (result.mesh is None) or (mesh is not None and not mesh.equals(result.mesh)):
        raise ParameterError(
            "--resume",
            "the mesh of the body is another one than that of the file: was the file that it is read from changed? Run it anew, with "
            "--force or another -o (in Python: overwrite=True, file=...).",
        )
    size = scheme.initial().size
    if state.u.shape[1] != size:
        raise ParameterError(
            "--resume",
            f"the stored state has {state.u.shape[1]} values, this run {size}: was it made with other extra_terms, or before a "
            "change of what the plan leaves out? Run it anew, with --force or another -o (in Python: overwrite=True, file=...).",
        )
    last = float(result.t[-1]) if result.t.size else -1.0
    return state, [t for t in save_at if t > last and t >= state.times[-1]]


def _control(scene: Scene) -> Control:
    solver = scene.solver
    time_scheme = solver.resolved[1] if hasattr(solver, "resolved") else solver.time_scheme  # what "auto" stands for
    return Control(order=1 if time_scheme == "backward-euler" else 2, dt=solver.dt, max_steps=solver.max_steps)


def _describe(result: Result, scene: Scene, plan: Plan, scheme: Any, threads: int) -> None:
    """Fill in everything about the run but its values."""
    result.scene, result.scene_source, result.plan = scene.to_toml(), scene.source, plan.to_json()
    result.mesh = getattr(scheme, "mesh", None)
    result.status, result.message = "running", "the run had not ended when this was written; --resume goes on with it"
    result.platform, result.threads = f"{platform.platform()}, {platform.machine()}", threads
    result.created = result.created or datetime.now(UTC).isoformat(timespec="seconds")
    result.versions = dict(versions())
    result.stats = result.stats | {"solver": plan.solver, "threads": threads, "unknowns": plan.unknowns}
    result.descriptions = {q.name: q.description for q in scene.model.quantities.values()} | getattr(scheme, "descriptions", {})


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on."""
    return {"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in PACKAGES}


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The thread pools of this process, looked for anew when further modules have been imported."""
    return ThreadpoolController()


def make_scene(
    model: Model,
    parameters: Any,
    *,
    initial: Any = None,
    geometry: Any = None,
    boundary: Any = None,
    t_end: float,
    save_at: Sequence[float] | None = None,
    save_every: float | None = None,
    solver: Mapping[str, Any] | None = None,
    title: str = "",
    scales: Scales | Mapping[str, Any] | None = None,
    fields: Sequence[str] | None = None,
    reduce: bool = True,
) -> Scene:
    """A scene from Python values, checked as a scene file is."""
    if isinstance(geometry, str):
        geometry = model.geometry(kind=geometry)
    elif isinstance(geometry, Mapping):
        geometry = model.geometry(**geometry)
    if isinstance(initial, Mapping):
        initial = from_table(model.initial, initial, "initial")
    if isinstance(boundary, Mapping) and model.boundary is not None:
        boundary = model.boundary.from_table(boundary)
    return Scene(
        name=model.name,
        model=model,
        title=title or model.title,
        geometry=geometry if geometry is not None else model.geometry(),
        parameters=parameters if parameters is not None else model.parameters(),
        initial=initial if initial is not None else model.initial(),
        boundary=boundary,
        time=TimeTable.make(t_end, save_at=save_at, save_every=save_every),
        solver=replace(model.solver(), **(solver or {})),
        plan=PlanTable(reduce=reduce),
        output=OutputTable(fields=tuple(fields) if fields is not None else None),
        scales=Scales.from_table(scales) if isinstance(scales, Mapping) else scales,
    )


def plan_of(result: Result) -> dict[str, Any]:
    """The stored plan as a mapping."""
    loaded: dict[str, Any] = json.loads(result.plan) if result.plan else {}
    return loaded
