"""The shipped scenes at their own settings, against twice the cells and a tenth of the tolerance.

    python -m benchmarks.plaque_scenes > benchmarks/plaque_scenes.md

The error of a scalar is the largest over the stored times, relative to its largest value.
"""

from __future__ import annotations

import numpy as np

from benchmarks.machine import heading
from multiphase.run import run
from multiphase.scene import load_scene

SCENES = ("plaque", "plaque-mouse", "plaque-human", "plaque-drag", "plaque-annulus")
SCALARS = ("L", "L_rate", "l_wall", "n_wall", "n_total", "c_total", "l_total")


def main() -> None:
    print(f"# Shipped scenes of the plaque at their defaults\n\n{heading()}\n")
    print(f"| scene | {' | '.join(SCALARS)} | steps | s |\n| --- |{' --- |' * (len(SCALARS) + 2)}")
    for name in SCENES:
        scene = load_scene(name)
        result = run(scene)
        fine = run(scene.with_changes(solver={"cells": 2 * scene.solver.cells, "rtol": 0.1 * scene.solver.rtol}))
        errors = [float(np.abs(result[key] - fine[key]).max() / np.abs(fine[key]).max()) for key in SCALARS]
        cells = " | ".join(f"{error:.1e}" for error in errors)
        print(f"| {name} | {cells} | {result.stats['steps']} | {result.stats['wall_s']:.1f} |", flush=True)


if __name__ == "__main__":
    main()
