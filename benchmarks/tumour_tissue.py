"""What tissue that is not plain costs in two dimensions, and whether plain tissue pays for it.

    python -m benchmarks.tumour_tissue [--repeats 5] [--against DIR] > benchmarks/tumour_tissue.md

CPU seconds of one thread (PARDISO where it is installed), medians; runs of the variants take turns. DIR is a working tree of an earlier
version, such as the last one before tissue could be anything but plain: `git worktree add DIR c43aca4`.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import heading

VARIANTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "one factor, the same everywhere": {"stiffness": 1.3},
    "stiffness varies": {"stiffness": "1 + 0.2*x"},
    "permeability a tensor": {"permeability": {"xx": 1.0, "yy": 0.5, "xy": "0.1*x"}},
    "fibres": {"fibre_ratio": 1.2, "fibre_angle": "0.3*x"},
    "everything": {
        "stiffness": "1 + 0.2*x", "permeability": {"xx": 1.0, "yy": 0.5, "xy": "0.1*x"}, "diffusivity": {"along": 1.2, "across": 0.8},
        "consumption": "1 + 0.1*y", "fibre_ratio": 1.2, "fibre_angle": "0.3*x", "fibre_stiffness": 0.1,
    },
}  # fmt: skip
PARTS = {"bed": {"where": "y > x", "spring": 0.3, "load": 0.1}, "skin": {"where": "y <= x", "membrane": 3.0}}

RUNS = """
import sys, time
sys.path.insert(0, sys.argv[1])
from threadpoolctl import threadpool_limits
from multiphase.stepping import Control, integrate, start
from tumour import meshes
from tumour.fem.scheme import MiniScheme
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver
import tumour
assert tumour.__file__.startswith(sys.argv[1])
paper, settings = {"mobility": "printed"}, {"method": "mini"}
scenes = [
    (meshes.quarter_disk(1.0, 40), paper, settings, Control(), 60.0),
    (
        meshes.quarter_disk(1.0, 40), {**paper, "mobility_floor": 1e-4}, {**settings, "alpha_step": "as-printed"},
        Control(order=1, dt=0.5), 60.0,
    ),
    (meshes.glioma(0.39, 0.39 / 20), {**paper, "lambda_alpha": 1.0}, settings, Control(), 100.0),
]
with threadpool_limits(1):
    for body, values, solver, control, end in scenes:
        scheme = MiniScheme(TumourParameters(**values), TumourInitial(), body, TumourSolver(**solver))
        scheme.prepare()
        began = time.process_time()
        integrate(scheme, start(scheme, 0.0, 1.0, control), [end], control)
        print(time.process_time() - began, scheme.newton.counts["tangent"], scheme.newton.counts["residual"])
"""
NAMES = ("quarter disk, 40 rings, t = 60", "the same, the paper's program's step", "glioma, 20 triangles to the radius, t = 100")


def against(folder: Path, repeats: int) -> None:
    """Plain runs of an earlier version and of this one in turn."""
    roots = [str(folder.resolve()), str(Path(__file__).resolve().parent.parent)]
    found: dict[str, list[list[list[float]]]] = {root: [] for root in roots}
    for _ in range(repeats):
        for root in roots:
            out = subprocess.run([sys.executable, "-c", RUNS, root], capture_output=True, text=True, check=True).stdout
            found[root].append([[float(word) for word in line.split()] for line in out.splitlines()])
    print("## Plain tissue, before there was any other and now\n\n| run | before | now | ratio | tangents, residuals |")
    print("| --- | --- | --- | --- | --- |")
    for i, name in enumerate(NAMES):
        old, new = (statistics.median(rows[i][0] for rows in found[root]) for root in roots)
        counts = [tuple(found[root][0][i][1:]) for root in roots]
        same = "the same" if counts[0] == counts[1] else "not the same"
        print(f"| {name} | {old:.2f} | {new:.2f} | {new / old:.3f} | {counts[1][0]:.0f}, {counts[1][1]:.0f}, {same} |")
    print()


def kernels(repeats: int) -> None:
    """Sums over 20,000 triangles."""
    from tumour import meshes
    from tumour.boundary import TumourBoundary
    from tumour.fem.newton import Step
    from tumour.fem.scheme import MiniScheme
    from tumour.parameters import TumourInitial, TumourParameters
    from tumour.solver import TumourSolver

    body, seconds = meshes.quarter_disk(1.0, 100), {}
    schemes = {}
    for name, tissue in (*VARIANTS.items(), ("plain, parts of the surface", {})):
        parts = TumourBoundary.from_table(PARTS) if "parts" in name else None
        scheme = MiniScheme(TumourParameters(**tissue), TumourInitial(), body, TumourSolver(method="mini"), parts)
        scheme.newton.linear.factorise = lambda values: None  # its time is another question
        schemes[name] = scheme
        seconds[name] = [[], [], []]
    for turn in range(repeats + 1):
        for name, scheme in schemes.items():
            u = np.zeros(scheme._parts[-1])
            point = scheme.point(u)
            point.nodal[:] = scheme.boundary(0.0)
            point.nodal[:, 2] = 0.8
            nothing = np.zeros_like(point.nodal), np.zeros_like(point.bubbles)
            step = Step(0.5, *nothing, point, scheme.acting)
            for account, work in zip(
                seconds[name],
                (lambda s=scheme, a=step, b=point: s.newton.make(a, b), lambda s=scheme, a=step, b=point: s.newton._evaluate(a, b),
                 lambda s=scheme, b=point: s._moments(b)), strict=True,
            ):  # fmt: skip
                began = time.process_time()
                work()
                if turn:
                    account.append(time.process_time() - began)
    print("## Sums over 20,000 triangles, milliseconds\n\n| tissue | tangent | residual | moments |\n| --- | --- | --- | --- |")
    for name, accounts in seconds.items():
        print(f"| {name} | " + " | ".join(f"{1e3 * statistics.median(account):.1f}" for account in accounts) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--against", type=Path)
    options = parser.parse_args()
    print(f"# What tissue costs in two dimensions\n\n{heading()}\n\nCPU seconds, medians of {options.repeats}.\n")
    if options.against:
        against(options.against, options.repeats)
    kernels(2 * options.repeats)


if __name__ == "__main__":
    main()
