"""A mouse over one year against a human over twenty, in micrometres.

Both presets have the same geometry and influx of modLDL; they differ in how much necrotic material a macrophage leaves per unit of modLDL
that it takes up (k_m / k_l), chosen from rates of growth, and in how many macrophages modLDL recruits. The human rate is measured (carotid
intima-media thickness, 11.8 µm a year), that of the mouse, 6 µm a week, is assumed; both plaques here grow somewhat faster than that.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multiphase import Result
from multiphase.run import run
from multiphase.scene import load_scene

SPANS = {"mouse": "week", "human": "year"}


def main(cells: int = 200, fraction: float = 1.0) -> Mapping[str, Result]:
    """Results in physical units by name; `fraction` of the scenes' time is run."""
    results = {}
    for name, unit in SPANS.items():
        scene = load_scene(f"plaque-{name}")
        scene = scene.with_changes(
            solver={"cells": cells}, time={"end": fraction * scene.time.end, "save_every": fraction * scene.time.end / 50}
        )
        print(f"{scene.title}:", file=sys.stderr)
        results[name] = result = run(scene, progress=True).in_units()
        grown = result["L"][-1] - result["L"][0]
        print(
            f"{name}: {result['L'][0]:.0f} -> {result['L'][-1]:.0f} {result.unit('L')} in {result.t[-1]:.3g} {unit}s, "
            f"{grown / result.t[-1]:.2f} µm/{unit} on average, {result['L_rate'][-1]:.2f} µm/{unit} at the end"
        )
    draw(results, "mouse_and_human.png")
    return results


def draw(results: Mapping[str, Result], path: str) -> None:
    """Width by time and the necrotic fraction at the end, a row for each."""
    picture = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(picture)
    for (name, result), row in zip(results.items(), picture.subplots(2, 2), strict=True):
        assert result.x is not None
        row[0].plot(result.t, result["L"], color="black")
        row[0].set(xlabel=f"time [{result.unit('t')}]", ylabel=f"width of the intima [{result.unit('L')}]", title=name)
        row[1].plot(result.x[-1], result["n"][-1], color="black")
        row[1].set(xlabel=f"depth [{result.unit('x')}]", ylabel="necrotic fraction", ylim=(0.0, 1.0))
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
