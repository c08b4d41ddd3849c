"""The command line. Exit status: 0 done; 1 compare exceeded; 2 bad usage, scene or parameters; 3 the run could not go on;
130 Ctrl-C, 143 SIGTERM."""

from __future__ import annotations

import argparse
import json
import logging
import shlex
import signal
import sys
import textwrap
import tomllib
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from multiphase import __version__
from multiphase.errors import ParameterError, SolverError

DONE, EXCEEDED, BAD, FAILED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143


class _Parser(argparse.ArgumentParser):
    """Errors as one paragraph on standard error, exit 2."""

    def error(self, message: str) -> NoReturn:
        sys.stderr.write(f"multiphase: {message}. `{self.prog} --help` lists the options.\n")
        sys.exit(BAD)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    options = _parser().parse_args(arguments)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    log = logging.getLogger("multiphase")
    log.handlers = [handler]
    log.setLevel(logging.INFO if getattr(options, "verbose", False) else logging.WARNING)
    command: Callable[[argparse.Namespace], int] = options.command
    try:
        return command(options)
    except ParameterError as error:
        return _report(error, BAD, options)
    except SolverError as error:
        return _report(error, FAILED, options)
    except KeyboardInterrupt:
        return _report("interrupted.", INTERRUPTED, options)
    except BrokenPipeError:
        sys.stderr.close()
        return DONE
    except (OSError, MemoryError) as error:
        return _report(f"{type(error).__name__}: {error}", FAILED, options)


def _report(error: object, status: int, options: argparse.Namespace) -> int:
    """One paragraph on standard error."""
    if options.debug and isinstance(error, BaseException):
        traceback.print_exception(error)
    sys.stderr.write(f"multiphase: {error}\n")
    return status


# -- commands ---------------------------------------------------------------------------------------------------------


def _scenes(options: argparse.Namespace) -> int:
    from multiphase.scene import shipped_scenes

    shipped = shipped_scenes()
    if options.name is None:
        if options.copy:
            raise ParameterError("--copy", "name the scene to copy: multiphase scenes NAME --copy FILE.")
        width = max(len(name) for name in shipped)
        for name, scene in shipped.items():
            print(f"{name:<{width}}  {scene.title}")
        return DONE
    if options.name not in shipped:
        from multiphase.parameters import nearest

        raise ParameterError(options.name, f"no scene of this name ships{nearest(options.name, shipped)} They are {', '.join(shipped)}.")
    text = shipped[options.name].text
    if options.copy is None:
        print(text, end="")
        return DONE
    target = Path(options.copy)
    if target.exists():
        raise ParameterError("--copy", f"{target} exists already; take another name.")
    _check_output(target)
    target.write_text(text, encoding="utf-8")
    print(f"{target} written. Edit it, then: multiphase run {target}")
    return DONE


def _run(options: argparse.Namespace) -> int:
    from multiphase.compare import cost_of
    from multiphase.run import Existing, Terminated, run
    from multiphase.scene import load_scene
    from multiphase.stepping import State, Tracker
    from multiphase.trackers import Progress

    scene = load_scene(options.scene, options.set)
    logging.getLogger("multiphase.compile").setLevel(logging.WARNING if options.quiet else logging.INFO)
    if options.output == "":
        raise ParameterError("-o", "the name of the file is empty.")
    file = Path(options.output or scene.output.file or f"{scene.name}.h5")
    _check_output(file, (".h5", ".hdf5"))

    def terminate(*_: object) -> NoReturn:
        raise Terminated

    time_unit = scene.scales.factor({"time": 1}) if scene.scales else (1.0, "-")

    def words(t: float) -> str:
        return f"{t * time_unit[0]:.4g}" + (f" {time_unit[1]}" if time_unit[1] != "-" else "")

    class Header(Tracker):
        """Says what runs, once nothing is left that could be refused."""

        def on_start(self, state: State, t_end: float) -> None:
            plan = scene.model.plan(scene)
            reduced = "".join(f"\nreduced by {reduction.name}: {reduction.saves}" for reduction in plan.reductions)
            print(f"{scene.title}\n{plan.solver}, {plan.geometry}, to t = {words(scene.time.end)}{reduced}", flush=True)

    progress = False if options.quiet else Progress(describe=words)
    existing: Existing = "resume" if options.resume else "replace" if options.force else "refuse"
    sets = [part for item in options.set for part in ("--set", item)]
    again = shlex.join(["multiphase", "run", options.scene, *sets, "-o", str(file), "--resume"])
    untouched = file.stat().st_mtime_ns if file.exists() else None
    previous = signal.signal(signal.SIGTERM, terminate)
    try:
        headers = [] if options.quiet else [Header()]
        result = run(scene, file=file, existing=existing, progress=progress, trackers=headers, threads=options.threads)
    except (KeyboardInterrupt, Terminated) as stop:
        kept = f"everything up to the last good step is in {file}" if file.exists() else "nothing had been stored yet"
        sys.stderr.write(f"multiphase: interrupted; {kept}. To go on: {again}\n")
        return INTERRUPTED if isinstance(stop, KeyboardInterrupt) else TERMINATED
    except SolverError as error:
        if options.debug:
            traceback.print_exception(error)
        kept = (
            f"Everything up to the last good step is in {file}. --resume goes on with it, also with a larger time.end or solver.max_steps; "
            "any other change of the scene starts anew, with --force or another -o."
        )
        if not file.exists():
            kept = "Nothing was stored."
        advice = f"To go on: {again}" if isinstance(error.__cause__, OSError) else kept
        sys.stderr.write(f"multiphase: {error} {advice}\n")
        return FAILED
    finally:
        signal.signal(signal.SIGTERM, previous)
    if untouched is not None and file.stat().st_mtime_ns == untouched:
        if not options.quiet:
            print(f"{file} is complete already; nothing was changed.")
    elif not options.quiet:
        rows = [
            ("ended", f"{result.status}: {result.message}"),
            *scene.model.summary(result),
            *_checkpoint(result),
            ("cost", cost_of(result)),
        ]
        rows += [("file", str(file)), ("next", f"multiphase plot {file}      multiphase animate {file} -o {file.stem}.gif")]
        _print_rows(rows)
    return DONE


def _plan(options: argparse.Namespace) -> int:
    from multiphase.scene import load_scene

    scene = load_scene(options.scene, options.set)
    plan = scene.model.plan(scene)
    print(plan.to_json() if options.json else f"{scene.title}\n{plan.describe()}")
    return DONE


def _info(options: argparse.Namespace) -> int:
    from multiphase.compare import cost_of
    from multiphase.model import find_model
    from multiphase.result import load
    from multiphase.run import plan_of

    result = load(options.file)
    model = find_model(result.model)
    if options.json:
        last = {name: (float(values[-1]) if len(values) else None) for name, values in result.scalars.items()}
        data = {
            "model": result.model, "status": result.status, "message": result.message, "created": result.created, "times": len(result.t),
            "t": float(result.t[-1]) if len(result.t) else None, "fields": list(result.fields), "scalars": last, "stats": result.stats,
            "versions": result.versions, "platform": result.platform, "threads": result.threads, "plan": plan_of(result),
            "scales": tomllib.loads(result.scene).get("scales"),
            "nodes": len(result.mesh.points) if result.mesh else None, "triangles": len(result.mesh.triangles) if result.mesh else None,
        }  # fmt: skip
        print(json.dumps(data, indent=1, ensure_ascii=False))
        return DONE
    size = f", {result.size()}" if result.size() else ""
    rows = [("model", model.title), ("ended", f"{result.status}: {result.message}"), *model.summary(result), *_checkpoint(result)]
    rows += [
        ("stored", f"{len(result.t)} time{'s' if len(result.t) != 1 else ''}{size}; fields {', '.join(result.fields)}"),
        ("cost", cost_of(result)),
    ]
    rows += [("created", f"{result.created} on {result.platform}")]
    rows += [("versions", ", ".join(f"{name} {version}" for name, version in result.versions.items()))]
    _print_rows(rows)
    return DONE


def _plot(options: argparse.Namespace) -> int:
    from multiphase.plotting import save_figure
    from multiphase.result import load

    source = Path(options.file)
    target = Path(options.output) if options.output else source.with_suffix(".png")
    _check_output(target, (".png", ".pdf", ".svg"))
    save_figure(load(source), target)
    print(f"{target} written")
    return DONE


def _animate(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    from multiphase.film import animate
    from multiphase.result import load

    target = Path(options.output)
    _check_output(target, (".gif", ".mp4"))
    result = load(options.file)
    with tqdm(disable=None, leave=False, desc="drawing", unit=" frames") as bar:  # None: only where standard error is a terminal

        def drawn(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        animate(result, target, progress=drawn)
    print(f"{target} written")
    return DONE


def _compare(options: argparse.Namespace) -> int:
    from multiphase.compare import compare
    from multiphase.result import load

    if options.output is not None:
        _check_output(Path(options.output), (".png", ".pdf", ".svg"))
    for name in (options.a, options.b):
        if not Path(name).exists():
            raise ParameterError(
                "", f"there is no file '{name}'; looked for {Path(name).absolute()}. Check the name, or run the scene first."
            )
    comparison = compare(load(options.a), load(options.b))
    print(comparison.to_json() if options.json else comparison.table())
    if options.output is not None:
        comparison.save_figure(options.output)
        print(f"{options.output} written", file=sys.stderr if options.json else sys.stdout)
    exceeded = comparison.refusals or (options.tol is not None and comparison.exceeds(options.tol))
    return EXCEEDED if exceeded else DONE


def _precision(options: argparse.Namespace) -> int:
    from multiphase.precision import check_folder, choices, parse_list, study
    from multiphase.scene import load_scene

    scene = load_scene(options.scene, options.set)
    chosen = choices(
        scene,
        methods=None if options.methods is None else parse_list(options.methods, "--methods"),
        cells=None if options.cells is None else parse_list(options.cells, "--cells", int),
        rtols=None if options.rtols is None else parse_list(options.rtols, "--rtols", float),
    )
    if options.output == "":
        raise ParameterError("-o", "the name of the folder is empty.")
    folder = Path(options.output or f"{scene.name}-precision")
    check_folder(folder)
    found = study(
        scene,
        methods=chosen.methods,
        cells=chosen.cells,
        rtols=chosen.rtols,
        repeats=options.repeats,
        budget=options.budget,
        progress=lambda line: print(line, file=sys.stderr, flush=True),
    )
    print(found.table())
    for path in found.save(folder):
        print(f"{path} written")
    return DONE if any(row.status == "completed" for row in found.measurements) else FAILED


def _export(options: argparse.Namespace) -> int:
    from multiphase.export import export
    from multiphase.result import load

    _check_output(Path(options.output))
    for path in export(load(options.file), Path(options.output), units=not options.dimensionless):
        print(f"{path} written")
    return DONE


def _check_output(path: Path, allowed: Sequence[str] = ()) -> None:
    """Refuse, before any work, an output with the wrong ending or one that cannot be written."""
    from multiphase.storage import check_target

    if allowed and path.suffix.lower() not in allowed:
        raise ParameterError("-o", f"{path} should end in {' or '.join(allowed)}.")
    check_target(path, "-o")


def _checkpoint(result: Any) -> list[tuple[str, str]]:
    """Where a run that goes on with this result starts, when that is later than what is stored."""
    times = result.checkpoint.get("times")
    if times is None or len(times) == 0 or (len(result.t) and times[0] <= result.t[-1]):
        return []
    return [("last good step", f"t = {times[0]:.6g}, from where --resume goes on")]


def _print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """A table of two columns, wrapped to 110 characters."""
    width = max(len(label) for label, _ in rows)
    for label, text in rows:
        lines = textwrap.wrap(text, 108 - width, break_long_words=False, break_on_hyphens=False) or [""]
        print(f"{label:<{width}}  " + f"\n{'':<{width}}  ".join(lines))


# -- options ----------------------------------------------------------------------------------------------------------


def _positive_integer(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive whole number")
    return int(text)


def _tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a number of 0 or more")
    return value


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="multiphase", description="Multiphase models of tissue on moving domains.")
    parser.add_argument("--version", action="version", version=f"multiphase-tissue {__version__}")
    parser.set_defaults(debug=False)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=_Parser)

    def add(name: str, function: Callable[[argparse.Namespace], int], text: str, **arguments: dict[str, Any]) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        for argument, settings in arguments.items():
            command.add_argument(argument, **settings)
        command.add_argument("--debug", action="store_true", help="show the traceback of an error")
        command.set_defaults(command=function)
        return command

    def takes_scene(command: argparse.ArgumentParser) -> None:
        command.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
        command.add_argument(
            "--set", action="append", default=[], metavar="TABLE.KEY=VALUE", help="change one value of the scene (repeatable)"
        )

    json_flag: dict[str, Any] = {"action": "store_true", "help": "print JSON"}
    scenes = add("scenes", _scenes, "list the scenes that ship, show one, or copy one to edit")
    scenes.add_argument("name", metavar="NAME", nargs="?")
    scenes.add_argument("--copy", metavar="FILE")

    run = add("run", _run, "run a scene")
    takes_scene(run)
    run.add_argument("-o", "--output", metavar="FILE.h5", help="result file (SCENE.h5)")
    group = run.add_mutually_exclusive_group()
    group.add_argument("--resume", action="store_true", help="go on with an existing result file")
    group.add_argument("--force", action="store_true", help="replace an existing result file")
    run.add_argument("--quiet", action="store_true", help="print nothing but warnings and errors")
    run.add_argument("-v", "--verbose", action="store_true", help="log more")
    run.add_argument("--threads", type=_positive_integer, default=1, metavar="N", help="threads of the linear algebra (1)")

    plan = add("plan", _plan, "which equations, unknowns and solver a scene gets, and why")
    takes_scene(plan)
    plan.add_argument("--json", **json_flag)

    result: dict[str, Any] = {"metavar": "RESULT.h5"}
    info = add("info", _info, "what is in a result file, how it ended, what it cost", file=result)
    info.add_argument("--json", **json_flag)
    plot = add("plot", _plot, "draw the standard figure", file=result)
    plot.add_argument("-o", "--output", metavar="FIGURE", help=".png, .pdf or .svg (RESULT.png)")
    film = add("animate", _animate, "make a film", file=result)
    film.add_argument("-o", "--output", metavar="FILM", required=True, help=".gif or .mp4")
    compare = add("compare", _compare, "differences of two results on their common times and positions", a=result, b=result)
    compare.add_argument("--tol", type=_tolerance, metavar="X", help="exit 1 when a difference relative to its scale exceeds X")
    compare.add_argument("--json", **json_flag)
    compare.add_argument("-o", "--output", metavar="FIGURE", help="draw the differences: .png, .pdf or .svg")
    precision = add("precision", _precision, "speed against error of a scene: every method, several cells and tolerances")
    takes_scene(precision)
    precision.add_argument("-o", "--output", metavar="FOLDER", help="where the table, the CSV file and the picture go (SCENE-precision)")
    precision.add_argument("--repeats", type=_positive_integer, default=5, metavar="N", help="runs of each; slow ones get 2 (5)")
    precision.add_argument("--cells", metavar="N,N,...", help="numbers of cells (25,50,100,200)")
    precision.add_argument("--rtols", metavar="X,X,...", help="tolerances (1e-3,1e-4,1e-5)")
    precision.add_argument("--methods", metavar="NAME,...", help="methods (all)")
    precision.add_argument(
        "--budget", type=_tolerance, default=120.0, metavar="SECONDS", help="time for all runs; what exceeds it is left out"
    )
    export = add("export", _export, "write a result in another format", file=result)
    export.add_argument("-o", "--output", metavar="FILE", required=True, help=".csv, tables; .vtkhdf, for ParaView, in two dimensions")
    export.add_argument("--dimensionless", action="store_true", help="leave the scene's scales aside")
    return parser


if __name__ == "__main__":
    sys.exit(main())
