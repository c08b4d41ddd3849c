"""Flip the sign of each term of each equation in turn, and name the tests that notice.

    python -m benchmarks.mutations [FIRST] > benchmarks/mutations.md

Each mutation is made in a copy of the source tree and the numerical tests run against it: first those of the tangent and of FiPy
against the compiled rates, then those of the mathematics (dispersion, annulus, manufactured solutions, the rest), each until its first
failure.
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
TERMS, SCHEME = "plaque1d/fipy_terms.py", "plaque1d/fipy_scheme.py"
FV, SLIP = "plaque1d/discretisation.py", "plaque1d/slip.py"
TUMOUR, ELASTIC, VISCOUS, TRBDF2 = "tumour/equations.py", "tumour/radial.py", "tumour/eulerian.py", "multiphase/trbdf2.py"
LAWS, GRID, OBSERVATION, RADAU = "plaque1d/equations.py", "multiphase/geometry.py", "plaque1d/observation.py", "multiphase/radau.py"

MUTATIONS: list[tuple[str, str, str, str, str]] = [
    ("n (3.10a)", "advection by V", LAWS, "return V - (1.0 - n) * w", "return -V - (1.0 - n) * w"),
    ("n (3.10a)", "advection by the slip", LAWS, "return V - (1.0 - n) * w", "return V + (1.0 - n) * w"),
    ("n (3.10a)", "motion of the grid", GRID, "return velocity - xi * wall_speed", "return velocity + xi * wall_speed"),
    ("n (3.10a)", "damping of short waves", FV, "- 0.5 * s * (right - left), v", "+ 0.5 * s * (right - left), v"),
    ("n (3.10a)", "death of macrophages, k_m", FV, "= d.k_m * W * rate, -d.k_l", "= -d.k_m * W * rate, -d.k_l"),
    ("n (3.10a)", "time derivative, FiPy", TERMS, "fipy.TransientTerm(coeff=width, var=n)", "-fipy.TransientTerm(coeff=width, var=n)"),
    ("n (3.10a)", "death of macrophages, FiPy", SCHEME, "self._uptake.setValue(p.k_m", "self._uptake.setValue(-p.k_m"),
    ("l (3.10b)", "advection and diffusion", FV, "flux = (0.5 * velocity * (l[f - 1]", "flux = (-0.5 * velocity * (l[f - 1]"),
    ("l (3.10b)", "diffusion", FV, "+ l[f]) - conductance * (l[f]", "+ l[f]) + conductance * (l[f]"),
    ("l (3.10b)", "influx Psi_l", FV, "out[1] += d.inner_radius * Psi_l", "out[1] -= d.inner_radius * Psi_l"),
    ("l (3.10b)", "uptake, k_l", FV, "* W * rate, -d.k_l * W * rate", "* W * rate, d.k_l * W * rate"),
    ("l (3.10b)", "diffusion, FiPy", SCHEME, "- fipy.DiffusionTerm(coeff=self._ldl", "+ fipy.DiffusionTerm(coeff=self._ldl"),
    ("l (3.10b)", "uptake, FiPy", SCHEME, "self._consumption.setValue(p.k_l", "self._consumption.setValue(-p.k_l"),
    ("slip (3.8d,e)", "drag b, interfacial", SLIP, "out[row] = h * W * d.b * n_f[f]", "out[row] = -h * W * d.b * n_f[f]"),
    ("slip (3.8d,e)", "stress (c Sigma)', interfacial", SLIP, "* y[row] + r * n_f[f] * step", "* y[row] - r * n_f[f] * step"),
    ("slip (3.8d,e)", "viscosity, interfacial", SLIP, "direct, cross = nu * (a * a", "direct, cross = -nu * (a * a"),
    ("slip (3.8d,e)", "coupling of the faces, interfacial", SLIP, "area * nu * (s * s - a * a)", "area * nu * (s * s + a * a)"),
    ("slip (3.8d,e)", "hoop strain, interfacial", SLIP, "2.0 * lambda_ * a * s", "-2.0 * lambda_ * a * s"),
    ("slip (3.8d,e)", "curvature of the mixture's flow", SLIP, "out[row] -= 2.0 * law.mean", "out[row] += 2.0 * law.mean"),
    ("slip (3.8d,e)", "drag b, drag form", SLIP, "out[row] = h * W * d.b * work[NF, f]", "out[row] = -h * W * d.b * work[NF, f]"),
    ("slip (3.8d,e)", "viscous stress T, drag form", SLIP, "load = -r * force", "load = r * force"),
    ("slip (3.8d,e)", "S n', drag form", SLIP, "force - S_f * r * n[i]", "force + S_f * r * n[i]"),
    ("slip (3.8d,e)", "n c Sigma, drag form", SLIP, "+ r * mixed * stress[i]", "- r * mixed * stress[i]"),
    ("slip (3.8d,e)", "hoop stress X, drag form", SLIP, "value -= 0.5 * (h * W / r) * hoop", "value += 0.5 * (h * W / r) * hoop"),
    ("slip (3.8d,e)", "curvature, drag form", SLIP, "load += 2.0 * (d.mu_m - d.mu_n)", "load -= 2.0 * (d.mu_m - d.mu_n)"),
    ("S'", "flow of the mixture", SLIP, "(-4.0 * shear * V / mean**3 +", "(4.0 * shear * V / mean**3 +"),
    ("S'", "slip", SLIP, "+ 2.0 / mean * Y)", "- 2.0 / mean * Y)"),
    ("slip (3.8d,e)", "w(0) = V / (R_1 c(0))", SLIP, "return y[d.stride * d.cells + 1] / (d", "return -y[d.stride * d.cells + 1] / (d"),
    ("W (3.9)", "W' = V", FV, "out[m * N] = V\n", "out[m * N] = -V\n"),
    ("W (3.9)", "V = Psi_m l(0)", LAWS, "return Psi_m * l_wall", "return -Psi_m * l_wall"),
    ("wall (3.8h)", "Psi_l", LAWS, "load = inner + distance * Psi_l", "load = inner - distance * Psi_l"),
    ("wall (3.8h)", "V l(0)", LAWS, "1.0 + 4.0 * Psi_m * distance * load", "1.0 - 4.0 * Psi_m * distance * load"),
    ("pressure", "p_out", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return -p_out - (1.0 - n) * stress + n * nu_n"),
    ("pressure", "c Sigma", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return p_out + (1.0 - n) * stress + n * nu_n"),
    ("pressure", "strain of n", LAWS, "+ n * nu_n * strain_n", "- n * nu_n * strain_n"),
    ("pressure", "strain of macrophages", LAWS, "+ (1.0 - n) * nu_m * strain_m", "- (1.0 - n) * nu_m * strain_m"),
    ("pressure", "hoop strain", OBSERVATION, "p_n + d.lambda_n * n[i] * hoop_n", "p_n - d.lambda_n * n[i] * hoop_n"),
    ("pressure", "hoop stress", OBSERVATION, "outer -= step", "outer += step"),
    ("velocities", "u_m = V + n w", LAWS, "return V + n * w", "return V - n * w"),
    ("Radau", "error weights", RADAU, "[-13.0 - 7.0 * _ROOT, -13.0", "[-13.0 + 7.0 * _ROOT, -13.0"),
    ("Radau", "nodes", RADAU, "(4.0 - _ROOT) / 10.0, (4.0", "(4.0 - 1.01 * _ROOT) / 10.0, (4.0"),
    ("q (2.6)", "deaths", TUMOUR, "return alpha * (birth * (1.0 - alpha) - death)", "return alpha * (birth * (1.0 - alpha) + death)"),
    ("Sigma (2.5)", "alpha*", TUMOUR, "sigma_width) * gamma * (alpha - alpha_star) / (free * free)\n\n\ndef contact_stress_slope",
     "sigma_width) * gamma * (alpha + alpha_star) / (free * free)\n\n\ndef contact_stress_slope"),
    ("P (2.22a)", "neo-Hookean", TUMOUR, "return mu * (l_r - 1.0 / l_r) + vol", "return mu * (l_r + 1.0 / l_r) + vol"),
    ("P (2.22a)", "lambda", TUMOUR, "volumetric = lam * J * (J - 1.0)", "volumetric = -lam * J * (J - 1.0)"),
    ("sigma (2.4)", "lambda", TUMOUR, "volumetric = lam * alpha * (e_r", "volumetric = -lam * alpha * (e_r"),
    ("M", "1 - alpha", TUMOUR, "return kappa * alpha / (1.0 - alpha)", "return kappa * alpha / (1.0 + alpha)"),
    ("elastic, momentum", "force on a face", ELASTIC, "return -force / work[_AREA, f]", "return force / work[_AREA, f]"),
    ("elastic, momentum", "hoop force", ELASTIC, "volume * (P_t * by_m - P_r / h)", "volume * (-P_t * by_m - P_r / h)"),
    ("elastic, flow", "contact", ELASTIC, "step = load_step(d, work, f) + work", "step = load_step(d, work, f) - work"),
    ("elastic, flow", "p_out", ELASTIC, "return step + d.p_out if f", "return step - d.p_out if f"),
    ("elastic, cells", "step as printed", ELASTIC, "source -= d.rate * (J", "source += d.rate * (J"),
    ("elastic, oxygen", "uptake", ELASTIC, "= outer - inner - taken", "= outer - inner + taken"),
    ("viscous, cells", "motion of the grid", VISCOUS, "- d.s[f] * V\n            leaving", "+ d.s[f] * V\n            leaving"),
    ("viscous, cells", "transport", VISCOUS, "= source - (leaving - through) / share", "= source + (leaving - through) / share"),
    ("viscous, momentum", "contact", VISCOUS, "+ work[_CONTACT, f] - work[_CONTACT, i]", "- work[_CONTACT, f] + work[_CONTACT, i]"),
    ("viscous, momentum", "p_out", VISCOUS, "y, work, f) - d.p_out - work", "y, work, f) + d.p_out - work"),
    ("viscous, oxygen", "uptake", VISCOUS, "outer - inner - W * share", "outer - inner + W * share"),
    ("viscous, surface", "V = a u", VISCOUS, "= V, V - work[_AREA, N]", "= V, V + work[_AREA, N]"),
    ("TR-BDF2", "past of the second stage", TRBDF2, "(1.0 - GAMMA) ** 2 * y[k]) / (G", "(1.0 + GAMMA) ** 2 * y[k]) / (G"),
]  # fmt: skip

PATIENCE = 240.0
TANGENT = ["tests/plaque1d/test_lines.py", "-k", "tangent or assembles"]
MATHEMATICS = [f"tests/plaque1d/test_{name}.py" for name in ("dispersion", "annulus", "manufactured_lines", "lines", "exact")]
TUMOUR_TANGENT = [f"tests/tumour/test_{name}.py" for name in ("elastic_tangent", "viscous_tangent", "fipy")]
TUMOUR_MATHEMATICS = [
    f"tests/tumour/test_{name}.py"
    for name in ("equations", "exact", "elastic_exact", "elastic_manufactured", "viscous_manufactured", "viscous", "elastic_runs")
]
INTEGRATION = ["tests/multiphase/test_trbdf2.py"]


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
    print("| equation | term | tangent, FiPy | mathematics |\n| --- | --- | --- | --- |")
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    for equation, term, file, old, new in MUTATIONS[first:]:
        with tempfile.TemporaryDirectory() as folder:
            tree = Path(folder)
            for name in ("multiphase", "plaque1d", "tumour", "tests"):
                shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            shutil.copy(ROOT / "pyproject.toml", tree)
            text = (tree / file).read_text(encoding="utf-8")
            if text.count(old) != 1:
                raise SystemExit(f"{file}: {old!r} stands there {text.count(old)} times")
            (tree / file).write_text(text.replace(old, new), encoding="utf-8")
            tangent, mathematics = (TUMOUR_TANGENT, TUMOUR_MATHEMATICS) if file.startswith("tumour/") else (TANGENT, MATHEMATICS)
            if file == TRBDF2:
                tangent = mathematics = INTEGRATION
            print(f"| {equation} | {term} | {first_failure(tree, tangent)} | {first_failure(tree, mathematics)} |", flush=True)


if __name__ == "__main__":
    main()
