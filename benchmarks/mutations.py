"""Flip the sign of each term of each equation in turn, and name the tests that notice.

    python benchmarks/mutations.py [FIRST] > benchmarks/mutations.md

Each mutation is made in a copy of the source tree and the numerical tests run against it: first those of the tangent, then those of
the mathematics (transport, dispersion, manufactured solution, exact results), each until its first failure.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCHEME, TERMS, FV = "plaque1d/fipy_scheme.py", "plaque1d/fipy_terms.py", "plaque1d/discretisation.py"
LAWS, GRID = "plaque1d/equations.py", "multiphase/geometry.py"

MUTATIONS: list[tuple[str, str, str, str, str]] = [
    ("n (3.10a)", "time derivative", TERMS, "fipy.TransientTerm(coeff=width, var=n)", "-fipy.TransientTerm(coeff=width, var=n)"),
    ("n (3.10a)", "advection by V", LAWS, "return V - (1.0 - n) * w", "return -V - (1.0 - n) * w"),
    ("n (3.10a)", "advection by the slip", LAWS, "return V - (1.0 - n) * w", "return V + (1.0 - n) * w"),
    ("n (3.10a)", "motion of the grid", GRID, "return velocity - xi * wall_speed", "return velocity + xi * wall_speed"),
    ("n (3.10a)", "damping of short waves", FV, "value=v * n_bar - 0.5 * s * jump", "value=v * n_bar + 0.5 * s * jump"),
    ("n (3.10a)", "death of macrophages, k_m", SCHEME, "self._uptake.setValue(p.k_m", "self._uptake.setValue(-p.k_m"),
    ("l (3.10b)", "time derivative", SCHEME, "fipy.TransientTerm(coeff=self._L", "-fipy.TransientTerm(coeff=self._L"),
    ("l (3.10b)", "advection by V - xi V", FV, "velocity = relative_velocity(V, xi, V)", "velocity = -relative_velocity(V, xi, V)"),
    ("l (3.10b)", "diffusion", SCHEME, "- fipy.DiffusionTerm(coeff=self._ldl", "+ fipy.DiffusionTerm(coeff=self._ldl"),
    ("l (3.10b)", "influx Psi_l", SCHEME, "inner[0] = p.Psi_l", "inner[0] = -p.Psi_l"),
    ("l (3.10b)", "uptake, k_l", SCHEME, "self._consumption.setValue(p.k_l", "self._consumption.setValue(-p.k_l"),
    ("slip (3.8d,e)", "viscosity of macrophages", FV, "SlipTerm(nf, nf_n, p.nu_m * cc", "SlipTerm(nf, nf_n, -p.nu_m * cc"),
    ("slip (3.8d,e)", "viscosity of the necrotic phase", FV, "SlipTerm(cf, cf_n, p.nu_n * nc", "SlipTerm(cf, cf_n, -p.nu_n * nc"),
    ("slip (3.8d,e)", "drag b", FV, "zeta, zeta_n = p.b * nf * cf", "zeta, zeta_n = -p.b * nf * cf"),
    ("slip (3.8d,e)", "stress (c Sigma)', interfacial", FV, "row, row_n = -nf, -nf_n", "row, row_n = nf, nf_n"),
    ("slip (3.8d,e)", "viscosity, drag form", FV, "(SlipTerm(row, row_n, nc * cc", "(SlipTerm(row, row_n, -nc * cc"),
    ("slip (3.8d,e)", "p_out, drag form", FV, "n * (p.p_out - c * stress)", "n * (-p.p_out - c * stress)"),
    ("slip (3.8d,e)", "c Sigma, drag form", FV, "n * (p.p_out - c * stress)", "n * (p.p_out + c * stress)"),
    ("slip (3.8d,e)", "w(0) = V / c(0)", FV, "w_wall=V / float(cf[0])", "w_wall=-V / float(cf[0])"),
    ("L (3.9)", "L' = V", SCHEME, "alpha * (L - past[lay.L]) - V", "alpha * (L - past[lay.L]) + V"),
    ("L (3.9)", "V = Psi_m l(0)", LAWS, "return Psi_m * l_wall", "return -Psi_m * l_wall"),
    ("wall (3.8h)", "Psi_l", LAWS, "load = inner + distance * Psi_l", "load = inner - distance * Psi_l"),
    ("wall (3.8h)", "V l(0)", LAWS, "1.0 + 4.0 * Psi_m * distance * load", "1.0 - 4.0 * Psi_m * distance * load"),
    ("pressure", "p_out", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return -p_out - (1.0 - n) * stress + n * nu_n"),
    ("pressure", "c Sigma", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return p_out + (1.0 - n) * stress + n * nu_n"),
    ("pressure", "strain of n", LAWS, "+ n * nu_n * strain_n", "- n * nu_n * strain_n"),
    ("pressure", "strain of macrophages", LAWS, "+ (1.0 - n) * nu_m * strain_m", "- (1.0 - n) * nu_m * strain_m"),
    ("velocities", "u_m = V + n w", LAWS, "return V + n * w", "return V - n * w"),
]  # fmt: skip

PATIENCE = 150.0
TANGENT = ["tests/plaque1d/test_tangent.py"]
MATHEMATICS = [f"tests/plaque1d/test_{name}.py" for name in ("transport", "dispersion", "manufactured", "exact")]


def first_failure(tree: Path, tests: list[str]) -> str:
    """Name of the first failing test, or "none"; a test that takes longer than the whole file should has failed."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    command = [sys.executable, "-u", "-m", "pytest", "-x", "-v", "-p", "no:cacheprovider", *tests]
    try:
        output = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False).stdout
    except subprocess.TimeoutExpired as expired:
        output = (expired.stdout or b"").decode().rstrip() + " FAILED"
    found = re.findall(r"test_(\w+)\.py::(\S+(?: [^F\n]\S*)*) (?:FAILED|ERROR)", output)
    return "none" if not found else f"{found[0][0]}: {found[0][1]}"


def main() -> None:
    print("# Mutations\n\nThe sign of each term flipped in turn, and the first test of each kind that fails.\n")
    print("| equation | term | tangent test | mathematics |\n| --- | --- | --- | --- |")
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    for equation, term, file, old, new in MUTATIONS[first:]:
        with tempfile.TemporaryDirectory() as folder:
            tree = Path(folder)
            for name in ("multiphase", "plaque1d", "tests"):
                shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            shutil.copy(ROOT / "pyproject.toml", tree)
            text = (tree / file).read_text(encoding="utf-8")
            if text.count(old) != 1:
                raise SystemExit(f"{file}: {old!r} stands there {text.count(old)} times")
            (tree / file).write_text(text.replace(old, new), encoding="utf-8")
            print(f"| {equation} | {term} | {first_failure(tree, TANGENT)} | {first_failure(tree, MATHEMATICS)} |", flush=True)


if __name__ == "__main__":
    main()
