"""Hard cases of the plaque with the FiPy scheme, 50 cells, rtol 1e-4, to T = 2.

    python benchmarks/plaque_hard.py > benchmarks/plaque_hard.md

Each case must reach the end with fractions in [0, 1] and balances closed to 1e-11.
"""

from __future__ import annotations

import time

import numpy as np
from machine import heading

from plaque1d import PlaqueInitial, PlaqueParameters, simulate

PARAMETERS = {"Psi_l": 1.0, "Psi_m": 0.5, "k_l": 2.0, "k_m": 2.0, "b": 20.0, "mu_n": 0.5, "mu_m": 0.5, "A": 0.5, "B": 1.0, "k": 1.0}
INITIAL = {"n": "0.1 + 0.05*cos(pi*xi)**2", "l": 0.2, "L": 0.5}
CASES = {
    "reference": {},
    "k_m = 20 (macrophages vanish)": {"k_m": 20.0},
    "k_m = 100": {"k_m": 100.0},
    "n0 = 0": {"n": 0.0},
    "k_m = 1e-5, n0 = 0.3, to T = 20 (n vanishes)": {"k_m": 1e-5, "n": 0.3},
    "n0 = 0.99": {"n": 0.99},
    "L0 = 0.01": {"L": 0.01},
    "Psi_m = 50": {"Psi_m": 50.0},
    "k = 8": {"k": 8.0},
    "A = 10": {"A": 10.0},
    "no viscosity": {"mu_n": 0.0, "mu_m": 0.0},
    "only macrophages viscous": {"mu_n": 0.0},
    "drag, p_out = 1": {"momentum": "drag", "p_out": 1.0},
    "influx stops and comes back": {"Psi_l": {"times": [0.5, 0.5, 1.0, 1.0], "values": [1.0, 0.0, 0.0, 1.0]}},
}


def main() -> None:
    print(f"# Hard cases, FiPy scheme, 50 cells, rtol 1e-4, to T = 2\n\n{heading()}\n")
    print("| case | ended | L | n from | n to | largest defect | steps | rejected | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    total = 0.0
    for name, changes in CASES.items():
        initial, values = dict(INITIAL), dict(PARAMETERS)
        for key, value in changes.items():
            (initial if key in initial else values)[key] = value
        started = time.perf_counter()
        t_end = 20.0 if "T = 20" in name else 2.0
        result = simulate(PlaqueParameters(**values), initial=PlaqueInitial(**initial), t_end=t_end, cells=50, raise_on_failure=False)
        seconds = time.perf_counter() - started
        total += seconds
        defect = max(np.abs(result[f"defect_{which}"]).max() for which in "Lncl")
        s, n = result.stats, result["n"]
        rejected = s["rejected_error"] + s["rejected_solver"]
        size = f"{result['L'][-1]:.4f} | {n.min():.2e} | {n.max():.9f}"
        print(f"| {name} | {result.status} | {size} | {defect:.0e} | {s['steps']} | {rejected} | {seconds:.1f} |", flush=True)
    print(f"\nTogether {total:.0f} s.")


if __name__ == "__main__":
    main()
