"""What each choice of the tumour model does to the radius at the end.

The base case is the paper's disk: elastic cells with lambda_alpha = 0 and the printed mobility, solved to a tolerance. Each row changes one
thing: the law of the mobility, the second modulus lambda_alpha, the shape, the material (viscous instead of elastic, with the same two
numbers as viscosities), or the time step (backward Euler of 0.5, the paper's, and the authors' step of alpha, which does not keep the
mass of cells). The last column tells what a row cost, and beside the printed step how much of the cells it made or lost.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tumour import TumourGeometry, TumourParameters, simulate

BASE = "the paper's disk"


class Case(NamedTuple):
    """One row: what it changes of the base case."""

    group: str
    name: str
    parameters: Mapping[str, Any] = {}
    geometry: Mapping[str, Any] = {}
    solver: Mapping[str, Any] = {}


CASES = (
    Case("base", BASE),
    Case("mobility", "darcy, (1 - alpha)/(kappa alpha)", {"mobility": "darcy"}),
    Case("mobility", "constant, 1/kappa", {"mobility": "constant"}),
    Case("lambda_alpha", "0.3", {"lambda_alpha": 0.3}),
    Case("lambda_alpha", "1", {"lambda_alpha": 1.0}),
    Case("geometry", "slab", geometry={"kind": "slab"}),
    Case("geometry", "sphere", geometry={"kind": "sphere"}),
    Case("rheology", "viscous", geometry={"formulation": "eulerian"}),
    Case("time step", "backward Euler, 0.5", solver={"time_scheme": "backward-euler", "dt": 0.5}),
    Case("time step", "the same, alpha as printed", solver={"time_scheme": "backward-euler", "dt": 0.5, "alpha_step": "as-printed"}),
)


class Row(NamedTuple):
    """What a case gave."""

    case: Case
    radius: float
    change: float
    necrotic: float
    seconds: float
    defect: float


def run(case: Case, cells: int, t_end: float) -> tuple[float, float, float, float]:
    """Radius and necrotic radius at the end, seconds, and the largest relative defect of the balance of cells."""
    parameters = TumourParameters(**{"mobility": "printed", **case.parameters})
    geometry = TumourGeometry(**{"kind": "disk", **case.geometry})
    # stored at multiples of the fixed step, which would be cut short otherwise
    result = simulate(parameters, geometry=geometry, t_end=t_end, cells=cells, save_every=0.5, **case.solver)
    defect = float(np.abs(result["defect_cells"]).max())
    return float(result["radius"][-1]), float(result["necrotic_radius"][-1]), result.stats["wall_s"], defect


def main(cells: int = 200, t_end: float = 60.0) -> list[Row]:
    """Run all cases, print the table and write it to tumour_switches.csv."""
    rows: list[Row] = []
    print(f"{'':13} {'':34} {f'R({t_end:g})':>9} {'change':>8} {'necrotic':>9} {'seconds':>8}")
    for case in CASES:
        radius, necrotic, seconds, defect = run(case, cells, t_end)
        change = radius / rows[0].radius - 1.0 if rows else 0.0
        rows.append(Row(case, radius, change, necrotic, seconds, defect))
        made = f"   cells off by {defect:.1e}" if defect > 1e-9 else ""
        print(f"{case.group:13} {case.name:34} {radius:9.4f} {change:+8.1%} {necrotic:9.3f} {seconds:8.3f}{made}")
    with open("tumour_switches.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["group", "case", "radius", "change", "necrotic_radius", "defect_cells"])
        writer.writerows([row.case.group, row.case.name, row.radius, row.change, row.necrotic, row.defect] for row in rows)
    print("tumour_switches.csv written")
    return rows


if __name__ == "__main__":
    main()
