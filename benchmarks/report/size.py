"""Cost and memory against size."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from benchmarks.plaque_reference import solve as solve_plaque
from benchmarks.report.plane import solvers
from benchmarks.report.radial import solve as solve_radial
from benchmarks.report.tables import Row
from benchmarks.report.work import LOG, repeated
from tumour.schemes import ElasticRadau, ViscousRadau

CELLS = (100, 200, 400, 800, 1600, 3200)
STEPS = 8
RINGS = {"pardiso": (31, 70, 141, 223, 315, 446), "superlu": (31, 70, 141, 223, 315)}
CHILD = """
import json, resource, sys
from pathlib import Path
from tumour import TumourParameters, simulate
rings, linear, steps = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
quick = dict(geometry={"kind": "quarter_disk", "dimension": "2d"}, time_scheme="bdf2", dt=0.5)
simulate(TumourParameters.preset("paper"), t_end=1.0, cells=4, **quick)
r = simulate(TumourParameters.preset("paper"), t_end=0.5 * steps, cells=rings, linear=linear, save_at=[0.0], **quick)
status = Path("/proc/self/status")  # ru_maxrss may be that of the process before exec
peak = [line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM")] if status.exists() else []
peak = int(peak[0]) if peak else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
print(json.dumps({"stats": r.stats, "nodes": len(r.mesh.points), "peak": peak}))
"""


def measure() -> dict[str, list[Row]]:
    """File size.csv: the radial and plaque methods by cells (whole runs, rtol 1e-4), two dimensions by points (one step of 0.5)."""
    return {"size": [*one_dimension(), *two_dimensions()]}


def one_dimension() -> list[Row]:
    rows: list[Row] = []
    for name, kind in (("elastic disk", ElasticRadau), ("viscous disk", ViscousRadau)):
        for n in CELLS:
            (_, c), seconds, _ = repeated(lambda k=kind, n=n: solve_radial(k, "disk", n, 1e-4))
            rows.append({"code": name, "size": n, "seconds": seconds, "steps": c["steps"], "iterations": c["iterations"]})
            LOG.info("%s, %d cells: %.4g s", name, n, seconds)
    for n in CELLS:

        def run(n: int = n) -> tuple[tuple[Any, Any], float]:
            scheme, state, seconds = solve_plaque(n, 1e-4)
            return (scheme, state), seconds

        (scheme, state), seconds, _ = repeated(run)
        c = state.counters
        rows.append({
            "code": "plaque", "size": n, "seconds": seconds, "steps": c["steps"], "iterations": c["iterations"],
            "bytes_a_cell": round(scheme.workspace_bytes / n),
        })  # fmt: skip
        LOG.info("plaque, %d cells: %.4g s", n, seconds)
    return rows


def two_dimensions() -> list[Row]:
    """Each size in a process of its own, whose largest memory is the row's; its heading is that of the table."""
    rows: list[Row] = []
    for linear in solvers():
        for rings in RINGS[linear]:
            done = subprocess.run([sys.executable, "-c", CHILD, str(rings), linear, str(STEPS)], capture_output=True, text=True, check=True)
            found = json.loads(done.stdout)
            stats = found["stats"]
            seconds = stats["seconds"]
            rows.append({
                "code": f"two dimensions, {linear}", "size": found["nodes"], "seconds": stats["wall_s"] / STEPS, "steps": STEPS,
                "iterations": stats["iterations"], "tangent": seconds["tangent"] / stats["assemblies"],
                "factorisation": seconds["factorise"] / stats["factorisations"], "solve": seconds["solve"] / stats["linear_solves"],
                "residual": seconds["residual"] / max(1, stats["residuals"]), "tangents": stats["assemblies"], "setup": stats["setup_s"],
                "GiB": found["peak"] / 2**20,
            })  # fmt: skip
            LOG.info("two dimensions, %s, %d points: %.4g s a step", linear, found["nodes"], rows[-1]["seconds"])
    return rows
