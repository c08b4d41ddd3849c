"""What the plan leaves out: that it changes nothing, over many random scenes, and the time that it saves.

    python -m benchmarks.plan_reductions [--scenes 2000] [--radial 60] [--no-times] > benchmarks/plan_reductions.md

Scenes are those of `tests/multiphase/plan_scenes.py` and, for disks along their radius against two dimensions, of
`tests/multiphase/radial_scenes.py`, from a number on that the tests do not reach. Times are medians of five runs (three in two dimensions)
after one that is not counted, without a file.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections import Counter, defaultdict
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.cases import of_tests
from benchmarks.machine import heading
from multiphase.run import run
from multiphase.scene import Scene, parse_scene

FIRST = 1000
RUNS = 5
TUMOUR = '[scene]\nmodel = "tumour"\n[time]\nend = 40.0\n[parameters]\nQ = 0.0\n'
PLAQUE = '[scene]\nmodel = "plaque"\n[time]\nend = 40.0\n'
TIMED = {
    "radial symmetry: disk of the paper's values, to t = 5": ('[scene]\nmodel = "tumour"\n[time]\nend = 5.0\n', []),
    "uniform state: elastic ball": (TUMOUR + 'kappa = 0.0\n[geometry]\nkind = "sphere"\n', []),
    "uniform state: elastic disk, with the watch on its shape": (TUMOUR + 'kappa = 0.0\n[geometry]\ndimension = "radial"\n', []),
    "uniform state: viscous ball": (TUMOUR + 'kappa = 0.0\n[geometry]\nkind = "sphere"\nformulation = "eulerian"\n', []),
    "uniform state: elastic slab without contact": (TUMOUR + 'gamma = 0.0\n[geometry]\nkind = "slab"\n', []),
    "uniform state: elastic ball, 2000 cells, rtol = 1e-8": (
        TUMOUR + 'kappa = 0.0\n[geometry]\nkind = "sphere"\n[solver]\ncells = 2000\nrtol = 1e-8\n', []),
    "uniform state: elastic ball, BDF of order two": (
        TUMOUR + 'kappa = 0.0\n[geometry]\nkind = "sphere"\n[solver]\ntime_scheme = "bdf2"\n', []),
    "fixed fractions: no necrotic phase, slab": (PLAQUE + "[parameters]\nk_m = 0.0\n[initial]\nn = 0.0\n", []),
    "fixed fractions: no necrotic phase, annulus, drag": (
        PLAQUE + '[geometry]\nkind = "annulus"\nlumen_radius = 10.0\n'
        '[parameters]\nk_m = 0.0\nmomentum = "drag"\np_out = 1.0\n[initial]\nn = 0.0\n', []),
    "fixed fractions: no macrophages": (PLAQUE + "[parameters]\nPsi_m = 0.0\n[initial]\nn = 1.0\n", []),
    "fixed fractions: no necrotic phase, 2000 cells, rtol = 1e-6": (
        PLAQUE + "[parameters]\nk_m = 0.0\n[initial]\nn = 0.0\n[solver]\ncells = 2000\nrtol = 1e-6\n", []),
}  # fmt: skip


def seconds(scene: Scene, runs: int = RUNS) -> tuple[float, Any]:
    """Median of the seconds of a run, from the checked scene to the result, and the result."""
    result = run(scene)
    taken = []
    for _ in range(runs):
        started = time.perf_counter()
        result = run(scene)
        taken.append(time.perf_counter() - started)
    return float(np.median(taken)), result


def times() -> None:
    print(f"## Seconds of a run, full and reduced (median of {RUNS})\n")
    print("| scene | unknowns | | steps | | full | reduced | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (text, sets) in TIMED.items():
        whole = parse_scene(text, name="full", sets=[*sets, "plan.reduce=false"])
        small = parse_scene(text, name="reduced", sets=sets)
        (slow, a), (fast, b) = (seconds(scene, 3 if scene.solver.method == "mini" else RUNS) for scene in (whole, small))
        print(
            f"| {name} | {a.stats['unknowns']} | {b.stats['unknowns']} | {a.stats['steps']} | {b.stats['steps']} "
            f"| {slow:.4f} | {fast:.4f} | {slow / fast:.1f} |",
            flush=True,
        )


def agreement(number: int) -> None:
    scenes = of_tests("multiphase", "plan_scenes")
    drawn: Counter[str] = Counter()
    found: Counter[str] = Counter()
    largest: dict[str, float] = defaultdict(float)
    started = time.perf_counter()
    for seed in range(FIRST, FIRST + number):
        kind, scene = scenes.draw(seed)
        drawn[kind] += 1
        if any(reduction.name != "radial symmetry" for reduction in scene.model.plan(scene).reductions):
            found[kind] += 1
            largest[kind] = max(largest[kind], scenes.difference(scene))
    print(f"## {number} random scenes, each solved in full and reduced ({time.perf_counter() - started:.0f} s)\n")
    print(
        "Of each kind every fifth scene lacks one of its conditions. Largest difference of any field or scalar at any stored time, over its"
    )
    print("largest value and rtol; ten is what the tests allow.\n")
    print("| kind | scenes | reduced | largest difference/rtol |")
    print("|---|---|---|---|")
    for kind in scenes.KINDS:
        print(f"| {kind} | {drawn[kind]} | {found[kind]} | {10.0 * largest[kind]:.2g} |")
    print()


def agreement_in_two_dimensions(number: int) -> None:
    """Disks along their radius against two dimensions."""
    scenes = of_tests("multiphase", "radial_scenes")
    drawn: Counter[str] = Counter()
    largest: dict[str, dict[str, Any]] = defaultdict(lambda: defaultdict(float))
    taken: dict[str, list[tuple[float, float]]] = defaultdict(list)
    started = time.perf_counter()
    for seed in range(FIRST, FIRST + number):
        kind, scene = scenes.draw(seed)
        drawn[kind] += 1
        if all(reduction.name != "radial symmetry" for reduction in scene.model.plan(scene).reductions):
            continue
        before = time.perf_counter()
        planes = scenes.with_errors(scenes.full(scene))
        between = time.perf_counter()
        radials = scenes.with_errors(scene)
        taken[kind].append((between - before, time.perf_counter() - between))
        for name, ratio in scenes.compared(scene, planes, radials).ratios.items():
            column = "scatter" if name.startswith("scatter") else name
            largest[kind][column] = np.maximum(largest[kind][column], ratio)  # no number where one of them is none
    print(f"## {number} random disks, each solved in two dimensions and along its radius ({time.perf_counter() - started:.0f} s)\n")
    print(
        "Every fifth has something with a direction, or that the radial equations have not. Largest difference at any stored time, of the"
    )
    print(
        "radius, of averages over four rings, and in two dimensions the scatter round rings, over the sum of the errors of both: each has"
    )
    print(
        "two grids, in two dimensions of 217 and 61 points (quarter disks: 289 and 81), and two tolerances. One is what the tests allow, a"
    )
    print("third what errors of order two come to. Seconds are those of a scene with all of its runs, on average.\n")
    columns = ("radius", "alpha", "C", "p", "displacement", "scatter")
    print(f"| kind | scenes | reduced | {' | '.join(columns)} | seconds in two dimensions | along the radius |")
    print("|---|---|---|" + "---|" * (len(columns) + 2))
    for kind in scenes.KINDS:
        cells = [f"{largest[kind][name]:.2f}" for name in columns] + [f"{mean:.2g}" for mean in np.mean(taken[kind], axis=0)]
        print(f"| {kind.replace('_', ' ')} | {drawn[kind]} | {len(taken[kind])} | {' | '.join(cells)} |")
    print(flush=True)


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--scenes", type=int, default=2000)
    options.add_argument("--radial", type=int, default=60, help="how many of them are disks that are solved in two dimensions as well")
    options.add_argument("--no-times", action="store_true", help="the agreement alone")
    chosen = options.parse_args()
    logging.disable(logging.WARNING)
    with threadpool_limits(1):
        print(f"# What the plan leaves out\n\n{heading()}\n")
        agreement(chosen.scenes - chosen.radial)
        agreement_in_two_dimensions(chosen.radial)
        if not chosen.no_times:
            times()


if __name__ == "__main__":
    main()
