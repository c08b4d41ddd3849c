"""Late growth of the viscous tumour: the speed of its surface, against that of a slab.

    python -m benchmarks.tumour_late_growth > benchmarks/tumour_late_growth.md

A slab ends up growing at one speed, whatever its size at first. A disk or sphere of radius R sees its rim as a slab up to curvature, so
its speed differs by a term that falls as 1/R.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.machine import heading
from tumour import TumourGeometry, TumourParameters, simulate

CELLS, RTOL = 1600, 1e-5
TIMES = (100.0, 200.0, 400.0, 600.0, 800.0, 1000.0)
KEY = f"""\
Default parameters, {CELLS} cells, rtol = {RTOL:g}, Radau IIA. `rim` is R less the necrotic radius, where C = 5/17; `dead` the cell fraction
at the centre; `ratio` is (speed - slab's speed) R, which tends to a constant; the slab's speed is that at the same time."""


def grow(kind: str, radius: float, times: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Radius, speed, rim width and the fraction at the centre at `times`."""
    geometry = TumourGeometry(kind=kind, radius=radius, formulation="eulerian")
    result = simulate(TumourParameters(), t_end=times[-1], geometry=geometry, cells=CELLS, rtol=RTOL, save_at=times)
    rows = np.searchsorted(result.t, times)
    names = {"R": "radius", "speed": "growth_rate", "rim": "rim_width"}
    return {short: result[name][rows] for short, name in names.items()} | {"dead": result["alpha"][rows, 0]}


def main() -> int:
    print(f"# Late growth of the viscous tumour\n\n{heading()}\n\n{KEY}\n")
    print("Slabs at t = 200:\n\n| R_0 | R | speed | rim |\n| --- | --- | --- | --- |")
    speeds = []
    for radius in (0.5, 1.0, 2.0):
        found = grow("slab", radius, (200.0,))
        speeds.append(found["speed"][0])
        print(f"| {radius:g} | {found['R'][0]:.4f} | {speeds[-1]:.7f} | {found['rim'][0]:.4f} |", flush=True)
    spread = (max(speeds) - min(speeds)) / min(speeds)
    print(f"\nThey differ by {spread:.1e}, relative.\n")
    print(f"| body | t | R | speed | rim | dead | 1/R | speed - slab's | ratio |\n|{' --- |' * 9}")
    slab = grow("slab", 1.0, TIMES)
    ratios = []
    for kind in ("slab", "disk", "sphere"):
        found = slab if kind == "slab" else grow(kind, 1.0, TIMES)
        for k, t in enumerate(TIMES):
            R, excess = found["R"][k], found["speed"][k] - slab["speed"][k]
            more = "| |" if kind == "slab" else f"{excess:+.2e} | {excess * R:+.4f} |"
            numbers = f"{R:.3f} | {found['speed'][k]:.6f} | {found['rim'][k]:.4f} | {found['dead'][k]:.0e} | {1.0 / R:.4f}"
            print(f"| {kind} | {t:g} | {numbers} | {more}", flush=True)
        if kind != "slab":
            last = (found["speed"][-3:] - slab["speed"][-3:]) * found["R"][-3:]
            ratios.append(float(np.ptp(last) / abs(last[-1])))
    print(f"\nOver the last three times the ratios change by {ratios[0]:.0%} (disk) and {ratios[1]:.0%} (sphere).")
    return 0 if spread < 1e-3 else 1


if __name__ == "__main__":
    sys.exit(main())
