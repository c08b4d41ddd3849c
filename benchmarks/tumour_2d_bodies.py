"""The tumour in two dimensions: lost symmetry of the disk, and gliomas on finer and finer meshes.

    python -m benchmarks.tumour_2d_bodies > benchmarks/tumour_2d_bodies.md

One thread.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.machine import heading
from tumour import TumourParameters, simulate


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
    print("# The tumour in two dimensions: symmetry, gliomas\n")
    print(heading())
    symmetry()
    gliomas()


if __name__ == "__main__":
    main()
