"""The tumour in two dimensions: cost against size, lost symmetry of the disk, and gliomas on finer and finer meshes.

    python -m benchmarks.tumour_2d_bodies [--largest 200000] > benchmarks/tumour_2d_bodies.md

Each size runs in a process of its own, whose largest memory is the table's. One thread.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from typing import Any

import numpy as np

from benchmarks.machine import heading
from multiphase.sparse import load_mkl
from tumour import TumourParameters, simulate

STEPS = 8

CHILD = """
import json, resource, sys
from tumour import TumourParameters, simulate
rings, linear = int(sys.argv[1]), sys.argv[2]
quick = dict(geometry={"kind": "quarter_disk", "dimension": "2d"}, time_scheme="bdf2", dt=0.5)
simulate(TumourParameters.preset("paper"), t_end=1.0, cells=4, **quick)
r = simulate(TumourParameters.preset("paper"), t_end=0.5 * STEPS, cells=rings, linear=linear, save_at=[0.0], **quick)
print(json.dumps({"stats": r.stats, "nodes": len(r.mesh.points), "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}))
"""


def sizes(largest: int) -> None:
    print(f"\n## Cost against size: the paper's quarter disk, BDF2, {STEPS} steps of 0.5\n")
    print("| linear solver | points | s a step | tangent | factorisation | solve | residual | iterations | tangents | set-up s | GiB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for linear in ["pardiso", "superlu"] if load_mkl() is not None else ["superlu"]:
        rows = []
        for rings in (31, 70, 141, 223, 315, 446):
            if (rings + 1) ** 2 > largest:
                break
            text = CHILD.replace("STEPS", str(STEPS))
            done = subprocess.run([sys.executable, "-c", text, str(rings), linear], capture_output=True, text=True, check=True)
            found: dict[str, Any] = json.loads(done.stdout)
            stats = found["stats"]
            seconds, step = stats["seconds"], stats["wall_s"] / STEPS
            each = [
                seconds["tangent"] / stats["assemblies"], seconds["factorise"] / stats["factorisations"],
                seconds["solve"] / stats["linear_solves"], seconds["residual"] / max(1, stats["residuals"]),
            ]  # fmt: skip
            rows.append((found["nodes"], step, found["peak"] / 2**20, each[1]))
            print(
                f"| {linear} | {found['nodes']} | {step:.3g} | {' | '.join(f'{value:.3g}' for value in each)} | {stats['iterations']} | "
                f"{stats['assemblies']} | {stats['setup_s']:.3g} | {rows[-1][2]:.2f} |",
                flush=True,
            )
        exponents = [math.log(rows[-1][k] / rows[1][k]) / math.log(rows[-1][0] / rows[1][0]) for k in (1, 2, 3)]
        print(
            f"\nFrom {rows[1][0]} to {rows[-1][0]} points: time a step grows like the power {exponents[0]:.2f} of their number, "
            f"that of one factorisation {exponents[2]:.2f}, memory {exponents[1]:.2f}.\n"
        )


def scatter(result: Any, rings: int) -> float:
    """Largest spread of alpha over the points of one ring, at the last time."""
    ring = np.rint(np.hypot(*result.mesh.points.T) * rings).astype(int)
    alpha = result["alpha"][-1]
    return max(float(np.ptp(alpha[ring == k])) for k in range(1, rings + 1))


def symmetry() -> None:
    print("\n## Symmetry of the paper's disk: three meshes, BDF2 with rtol 1e-4\n")
    print(
        "Asymmetry is the largest over the least distance of the surface from the middle, less 1; spread is that of alpha over the points"
    )
    print("of one ring of the mesh, at the most.\n")
    print("| lambda_alpha | t | rings | asymmetry | spread of alpha | R |")
    print("| --- | --- | --- | --- | --- | --- |")
    quarter = {"kind": "quarter_disk", "dimension": "2d"}
    for lam, ends in ((0.0, (44.0, 60.0)), (0.3, (60.0, 100.0))):
        parameters = TumourParameters(mobility="printed", lambda_alpha=lam)
        for end in ends:
            for rings in (20, 40, 80):
                result = simulate(parameters, t_end=end, geometry=quarter, cells=rings, save_at=[0.0, end])
                row = f"{result['asymmetry'][-1]:.2e} | {scatter(result, rings):.2e} | {result['radius'][-1]:.4f}"
                print(f"| {lam:g} | {end:g} | {rings} | {row} |", flush=True)


def gliomas() -> None:
    print("\n## Gliomas, radius of the largest circle within 0.39, rtol 1e-4\n")
    print("| lambda_alpha | radius | cells | points | ends at t | area | alpha | least C | largest stress, at rest at | wall s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    cases = [(1.0, 0.39, cells) for cells in (8, 16, 24, 32)] + [(1.0, radius, 16) for radius in (0.3, 0.5)]
    cases += [(0.0, 0.39, cells) for cells in (8, 16, 24)]
    for lam, radius, cells in cases:
        result = simulate(
            TumourParameters(mobility="printed", lambda_alpha=lam), t_end=100.0, geometry={"kind": "glioma", "radius": radius}, cells=cells,
            save_every=0.5, raise_on_failure=False,
        )  # fmt: skip
        alpha, stress = result["alpha"][-1], result["stress_magnitude"][-1]
        x, y = result.mesh.points[int(np.argmax(stress))]
        ended = f"{result.t[-1]:g}{'' if result.status == 'completed' else ' (lost stability)'}"
        place = f"{stress.max():.3f}, ({x:.3f}, {y:.3f})"
        print(
            f"| {lam:g} | {radius:g} | {cells} | {len(alpha)} | {ended} | {result['area'][-1]:.4f} | "
            f"{alpha.min():.4f} to {alpha.max():.4f} | {result['C_min'][-1]:.4f} | {place} | {result.stats['wall_s']:.3g} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=200_000)
    arguments = parser.parse_args()
    print("# The tumour in two dimensions: size, symmetry, gliomas\n")
    print(heading())
    sizes(arguments.largest)
    symmetry()
    gliomas()


if __name__ == "__main__":
    main()
