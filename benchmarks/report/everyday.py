"""What a user waits for: presets, the price of a call, imports, memory; and what the first commands of the README print."""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.plaque_reference import END, INITIAL, problem
from benchmarks.report.tables import Row
from benchmarks.report.work import LOG, repeated
from plaque1d import PlaqueInitial, PlaqueParameters
from plaque1d import simulate as simulate_plaque
from plaque1d.semidiscrete import KERNEL
from tumour import TumourParameters
from tumour import simulate as simulate_tumour

PRESETS = (("mouse", 17039.0, "the mouse's plaque, one year"), ("human", 340788.0, "the human's plaque, twenty years"))
IMPORT = "import time, numpy; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
CALLS = ((50, 1e-3), (100, 1e-4), (200, 1e-4), (200, 1e-5), (800, 1e-4))
RUNS = 1000
COMMANDS = {
    "first_run": "run plaque --force",
    "": "run plaque --set solver.method=fipy --set solver.cells=200 -o plaque-fipy.h5 --force",
    "first_compare": "compare plaque.h5 plaque-fipy.h5",
}
"""The first commands of the README, by what the pages show of them."""


def measure() -> dict[str, list[Row]]:
    """Files everyday.csv and calls.csv; the memory of many runs is the growth of this process's peak."""
    rows: list[Row] = []

    def keep(what: str, value: float, unit: str) -> None:
        rows.append({"what": what, "value": value, "unit": unit})
        LOG.info("%s: %.4g %s", what, value, unit)

    for name, end, what in PRESETS:
        parameters, initial = PlaqueParameters.preset(name), PlaqueInitial.preset(name)
        keep(what, timed(lambda p=parameters, i=initial, e=end: simulate_plaque(p, initial=i, t_end=e, cells=200)), "s")
    keep("the paper's disk, radial, to t = 60", timed(lambda: simulate_tumour(TumourParameters.preset("paper"), t_end=60.0)), "s")
    for package in ("plaque1d", "tumour"):
        code = [sys.executable, "-c", IMPORT.format(package)]
        seconds = median(float(subprocess.run(code, capture_output=True, text=True, check=True).stdout) for _ in range(5))
        keep(f"import {package} after import numpy", seconds, "s")
    before = peak(20)
    keep(f"growth of memory by {RUNS} runs in one process", peak(RUNS) - before, "MB")
    return {"everyday": rows, "calls": calls()}


def timed(run: Any) -> float:
    def once() -> tuple[Any, float]:
        started = time.perf_counter()
        return run(), time.perf_counter() - started

    once()
    return repeated(once)[1]


def peak(runs: int) -> float:
    """Peak of this process's memory after so many runs, MB."""
    for _ in range(runs):
        simulate_plaque(problem("interfacial"), initial=INITIAL, t_end=END, cells=50, rtol=1e-3)
    gc.collect()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def calls() -> list[Row]:
    """`simulate`, with its 51 stored times, against the compiled integrator inside it, in milliseconds."""
    rows: list[Row] = []
    compiled, spent = KERNEL.advance, 0.0

    def watched(*arguments: Any) -> Any:
        nonlocal spent
        started = time.perf_counter()
        try:
            return compiled(*arguments)
        finally:
            spent += time.perf_counter() - started

    KERNEL.entries["advance"] = watched
    try:
        for count, rtol in CALLS:
            whole, inside = [], []
            for _ in range(25):
                spent, started = 0.0, time.perf_counter()
                simulate_plaque(problem("interfacial"), initial=INITIAL, t_end=END, cells=count, rtol=rtol)
                whole.append(time.perf_counter() - started)
                inside.append(spent)
            rows.append({"cells": count, "rtol": rtol, "simulate_ms": 1e3 * median(whole), "integrator_ms": 1e3 * median(inside)})
            LOG.info("a call, %d cells, rtol %.0e: %.3g ms", count, rtol, rows[-1]["simulate_ms"])
    finally:
        KERNEL.entries["advance"] = compiled
    return rows


def first_commands() -> dict[str, str]:
    """What the first commands of the README print, by name, in an empty folder, without their progress."""
    program = Path(sys.executable).with_name("multiphase")
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, command in COMMANDS.items():
            done = subprocess.run([program, *command.split()], cwd=folder, capture_output=True, text=True, check=False)
            if name:
                found[name] = done.stdout
    return found
