"""A tumour with lobes, without and with a resistance of its cells to a change of volume.

With lambda_alpha = 0 the body swells until it loses its stability: the run ends there and keeps all rows up to it. (Shortly before, two of
its lobes grow into each other: the model has no contact between parts of the surface.) With lambda_alpha = 1 it comes nearly to rest.
Stress is highest between the lobes in both.
"""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multiphase import Result
from multiphase.plotting import Map, view_of
from tumour import TumourGeometry, TumourParameters, simulate


def main(cells: int = 10, t_end: float = 100.0) -> dict[float, Result]:
    """Results by lambda_alpha."""
    body = TumourGeometry(kind="glioma", radius=0.39)
    results = {}
    for lam in (0.0, 1.0):
        parameters = TumourParameters(mobility="printed", lambda_alpha=lam)
        result = simulate(parameters, geometry=body, cells=cells, t_end=t_end, save_every=1.0, progress=True, raise_on_failure=False)
        print(f"\nlambda_alpha = {lam:g}: {result.status}, {result.message}")
        print(f"  {len(result.t)} rows are stored, to t = {result.t[-1]:g}; area {result['area'][0]:.3f} -> {result['area'][-1]:.3f}")
        print(f"  cell fraction {result['alpha'][-1].min():.3f} to {result['alpha'][-1].max():.3f}, oxygen above {result['C_min'][-1]:.3f}")
        assert result.mesh is not None
        stress = result["stress_magnitude"][-1]
        at = int(np.argmax(stress))
        (x, y), (u, v) = result.mesh.points[at], result.positions(-1)[at]
        print(f"  stress {stress[at]:.3g} at the most, {stress[at] / np.median(stress):.1f} times the median,")
        print(f"  at ({u:.2f}, {v:.2f}), which is ({x:.3f}, {y:.3f}) of the body at rest")
        results[lam] = result
    draw(results, "glioma.png")
    return results


def draw(results: dict[float, Result], path: str) -> None:
    """The stress on both bodies at their last rows, each on scales of its own, and the areas by time."""
    picture = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(picture)
    axes = picture.subplot_mosaic([[0.0, 1.0], ["area", "area"]], height_ratios=[3.0, 2.0])
    for (lam, result), style in zip(results.items(), ("-", "--"), strict=True):
        shown = Map(view_of(result), "stress_magnitude", axes[lam], [-1], log=True)
        shown.show(result.positions(-1), result["stress_magnitude"][-1])
        shown.add_bar()
        axes[lam].set_title(f"stress, $\\lambda_\\alpha$ = {lam:g}, t = {result.t[-1]:g}")
        axes["area"].semilogy(result.t, result["area"], style, color="black", label=f"$\\lambda_\\alpha$ = {lam:g}")
    axes["area"].set(xlabel="time t", ylabel="area of the body")
    axes["area"].legend(frameon=False)
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
