"""Change the sign of each term of each equation in turn, and name the tests that notice.

    python -m benchmarks.mutations                  the table benchmarks/mutations.md; goes on where it was stopped
    python -m benchmarks.mutations --only PATTERN   of that, what has PATTERN (a regular expression) in "equation | term | file"
    python -m benchmarks.mutations --again ...      the same although it is in the table
    python -m benchmarks.mutations --check          whether the text of each term still stands where it should; runs nothing

Each mutation is made in a copy of the source tree and numerical tests run against it in two groups, each until its first failure: those
that see a term beside its tangent or beside a second statement of it, and those of the mathematics (known solutions, orders). Both groups
must pass without a mutation. Where the residual and its tangent have a term each, both change if the row says so, and Newton's method goes
on to converge, to something else.

Compiled code is kept between the mutations: it lies in folders named after the fingerprint of all the files that it is made of (see
`multiphase.compiled`, `multiphase.lines.Kernel`; `tests/test_mutations.py` looks whether none is missing), so that a changed file finds
nothing there and the others find theirs. The copy lies in one place throughout, with the times of its files, as Numba looks at both.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
TABLE = Path(__file__).with_suffix(".md")
FOLDERS = ("multiphase", "plaque1d", "tumour", "tests")
TERMS, SCHEME = "plaque1d/fipy_terms.py", "plaque1d/fipy_scheme.py"
FV, SLIP = "plaque1d/discretisation.py", "plaque1d/slip.py"
TUMOUR, ELASTIC, VISCOUS, TRBDF2 = "tumour/equations.py", "tumour/radial.py", "tumour/eulerian.py", "multiphase/trbdf2.py"
LAWS, GRID, OBSERVATION, RADAU = "plaque1d/equations.py", "multiphase/geometry.py", "plaque1d/observation.py", "multiphase/radau.py"
POINT, KERNEL, ASSEMBLY, EDGES = "tumour/fem/point.py", "tumour/fem/kernel.py", "tumour/fem/assembly.py", "tumour/fem/edges.py"
MINI, FORMS, MIRROR, SURFACE = "tumour/fem/scheme.py", "tumour/fem/forms.py", "tumour/fem/mirror.py", "tumour/fem/surface.py"
STEPPING, MODES, LINEAR = "multiphase/stepping.py", "tumour/stability/modes.py", "tumour/stability/linear.py"
OPERATORS, STIFFNESS = "tumour/stability/operators.py", "tumour/stability/stiffness.py"


class M(NamedTuple):
    """A mutation: `old` stands in the file as many `times` as said, and `new` takes its place; so do further pairs."""

    equation: str
    term: str
    file: str
    old: str
    new: str
    times: int = 1
    also: tuple[tuple[str, str], ...] = ()

    @property
    def row(self) -> str:
        return f"| {self.equation} | {self.term} |"

    def of(self, text: str) -> str:
        """The text of the file, mutated."""
        for old, new, times in ((self.old, self.new, self.times), *((old, new, 1) for old, new in self.also)):
            if text.count(old) != times:
                raise LookupError(f"{self.equation}, {self.term}: {old!r} stands {text.count(old)} times in {self.file}, not {times}")
            text = text.replace(old, new)
        return text


PLAQUE = [
    M("n (3.10a)", "advection by V", LAWS, "return V - (1.0 - n) * w", "return -V - (1.0 - n) * w"),
    M("n (3.10a)", "advection by the slip", LAWS, "return V - (1.0 - n) * w", "return V + (1.0 - n) * w"),
    M("n (3.10a)", "motion of the grid", GRID, "return velocity - xi * wall_speed", "return velocity + xi * wall_speed"),
    M("n (3.10a)", "damping of short waves", FV, "- 0.5 * s * (right - left), v", "+ 0.5 * s * (right - left), v"),
    M("n (3.10a)", "death of macrophages, k_m", FV, "= d.k_m * W * rate, -d.k_l", "= -d.k_m * W * rate, -d.k_l"),
    M("n (3.10a)", "time derivative, FiPy", TERMS, "fipy.TransientTerm(coeff=width, var=n)", "-fipy.TransientTerm(coeff=width, var=n)"),
    M("n (3.10a)", "death of macrophages, FiPy", SCHEME, "self._uptake.setValue(p.k_m", "self._uptake.setValue(-p.k_m"),
    M("l (3.10b)", "advection and diffusion", FV, "flux = (0.5 * velocity * (l[f - 1]", "flux = (-0.5 * velocity * (l[f - 1]"),
    M("l (3.10b)", "diffusion", FV, "+ l[f]) - conductance * (l[f]", "+ l[f]) + conductance * (l[f]"),
    M("l (3.10b)", "influx Psi_l", FV, "out[1] += d.inner_radius * Psi_l", "out[1] -= d.inner_radius * Psi_l"),
    M("l (3.10b)", "uptake, k_l", FV, "* W * rate, -d.k_l * W * rate", "* W * rate, d.k_l * W * rate"),
    M("l (3.10b)", "diffusion, FiPy", SCHEME, "- fipy.DiffusionTerm(coeff=self._ldl", "+ fipy.DiffusionTerm(coeff=self._ldl"),
    M("l (3.10b)", "uptake, FiPy", SCHEME, "self._consumption.setValue(p.k_l", "self._consumption.setValue(-p.k_l"),
    M("slip (3.8d,e)", "drag b, interfacial", SLIP, "out[row] = h * W * d.b * n_f[f]", "out[row] = -h * W * d.b * n_f[f]"),
    M("slip (3.8d,e)", "stress (c Sigma)', interfacial", SLIP, "* y[row] + r * n_f[f] * step", "* y[row] - r * n_f[f] * step"),
    M("slip (3.8d,e)", "viscosity, interfacial", SLIP, "direct, cross = nu * (a * a", "direct, cross = -nu * (a * a"),
    M("slip (3.8d,e)", "coupling of the faces, interfacial", SLIP, "area * nu * (s * s - a * a)", "area * nu * (s * s + a * a)"),
    M("slip (3.8d,e)", "hoop strain, interfacial", SLIP, "2.0 * lambda_ * a * s", "-2.0 * lambda_ * a * s"),
    M("slip (3.8d,e)", "curvature of the mixture's flow", SLIP, "out[row] -= 2.0 * law.mean", "out[row] += 2.0 * law.mean"),
    M("slip (3.8d,e)", "drag b, drag form", SLIP, "out[row] = h * W * d.b * work[NF, f]", "out[row] = -h * W * d.b * work[NF, f]"),
    M("slip (3.8d,e)", "viscous stress T, drag form", SLIP, "load = -r * force", "load = r * force"),
    M("slip (3.8d,e)", "S n', drag form", SLIP, "force - S_f * r * n[i]", "force + S_f * r * n[i]"),
    M("slip (3.8d,e)", "n c Sigma, drag form", SLIP, "+ r * mixed * stress[i]", "- r * mixed * stress[i]"),
    M("slip (3.8d,e)", "hoop stress X, drag form", SLIP, "value -= 0.5 * (h * W / r) * hoop", "value += 0.5 * (h * W / r) * hoop"),
    M("slip (3.8d,e)", "curvature, drag form", SLIP, "load += 2.0 * (d.mu_m - d.mu_n)", "load -= 2.0 * (d.mu_m - d.mu_n)"),
    M("S'", "flow of the mixture", SLIP, "(-4.0 * shear * V / mean**3 +", "(4.0 * shear * V / mean**3 +"),
    M("S'", "slip", SLIP, "+ 2.0 / mean * Y)", "- 2.0 / mean * Y)"),
    M("slip (3.8d,e)", "w(0) = V / (R_1 c(0))", SLIP, "return y[d.stride * d.cells + 1] / (d", "return -y[d.stride * d.cells + 1] / (d"),
    M("W (3.9)", "W' = V", FV, "out[m * N] = V\n", "out[m * N] = -V\n"),
    M("W (3.9)", "V = Psi_m l(0)", LAWS, "return Psi_m * l_wall", "return -Psi_m * l_wall"),
    M("wall (3.8h)", "Psi_l", LAWS, "load = inner + distance * Psi_l", "load = inner - distance * Psi_l"),
    M("wall (3.8h)", "V l(0)", LAWS, "1.0 + 4.0 * Psi_m * distance * load", "1.0 - 4.0 * Psi_m * distance * load"),
    M("pressure", "p_out", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return -p_out - (1.0 - n) * stress + n * nu_n"),
    M("pressure", "c Sigma", LAWS, "return p_out - (1.0 - n) * stress + n * nu_n", "return p_out + (1.0 - n) * stress + n * nu_n"),
    M("pressure", "strain of n", LAWS, "+ n * nu_n * strain_n", "- n * nu_n * strain_n"),
    M("pressure", "strain of macrophages", LAWS, "+ (1.0 - n) * nu_m * strain_m", "- (1.0 - n) * nu_m * strain_m"),
    M("pressure", "hoop strain", OBSERVATION, "p_n + d.lambda_n * n[i] * hoop_n", "p_n - d.lambda_n * n[i] * hoop_n"),
    M("pressure", "hoop stress", OBSERVATION, "outer -= step", "outer += step"),
    M("velocities", "u_m = V + n w", LAWS, "return V + n * w", "return V - n * w"),
    M("Radau", "error weights", RADAU, "[-13.0 - 7.0 * _ROOT, -13.0", "[-13.0 + 7.0 * _ROOT, -13.0"),
    M("Radau", "nodes", RADAU, "(4.0 - _ROOT) / 10.0, (4.0", "(4.0 - 1.01 * _ROOT) / 10.0, (4.0"),
]  # fmt: skip
RADIAL = [
    M("q (2.6)", "deaths", TUMOUR, "growth: Number = alpha * (birth * (1.0 - alpha) - death)",
      "growth: Number = alpha * (birth * (1.0 - alpha) + death)"),
    M("Sigma (2.5)", "alpha*", TUMOUR, "sigma_width) * gamma * (alpha - alpha_star) / (free * free)\n\n\ndef contact_stress_slope",
     "sigma_width) * gamma * (alpha + alpha_star) / (free * free)\n\n\ndef contact_stress_slope"),
    M("P (2.22a)", "neo-Hookean", TUMOUR, "return mu * (l_r - 1.0 / l_r) + vol", "return mu * (l_r + 1.0 / l_r) + vol"),
    M("P (2.22a)", "lambda", TUMOUR, "volumetric = lam * J * (J - 1.0)", "volumetric = -lam * J * (J - 1.0)"),
    M("sigma (2.4)", "lambda", TUMOUR, "volumetric = lam * alpha * (e_r", "volumetric = -lam * alpha * (e_r"),
    M("M", "1 - alpha", TUMOUR, "return kappa * alpha / (1.0 - alpha)", "return kappa * alpha / (1.0 + alpha)"),
    M("elastic, momentum", "force on a face", ELASTIC, "return -force / work[_AREA, f]", "return force / work[_AREA, f]"),
    M("elastic, momentum", "hoop force", ELASTIC, "volume * (P_t * by_m - P_r / h)", "volume * (-P_t * by_m - P_r / h)"),
    M("elastic, flow", "contact", ELASTIC, "step = load_step(d, work, f) + work", "step = load_step(d, work, f) - work"),
    M("elastic, flow", "p_out", ELASTIC, "return step + d.p_out if f", "return step - d.p_out if f"),
    M("elastic, cells", "step as printed", ELASTIC, "source -= d.rate * (J", "source += d.rate * (J"),
    M("elastic, oxygen", "uptake", ELASTIC, "= outer - inner - taken", "= outer - inner + taken"),
    M("viscous, cells", "motion of the grid", VISCOUS, "- d.s[f] * V\n            leaving", "+ d.s[f] * V\n            leaving"),
    M("viscous, cells", "transport", VISCOUS, "= source - (leaving - through) / share", "= source + (leaving - through) / share"),
    M("viscous, momentum", "contact", VISCOUS, "+ work[_CONTACT, f] - work[_CONTACT, i]", "- work[_CONTACT, f] + work[_CONTACT, i]"),
    M("viscous, momentum", "p_out", VISCOUS, "y, work, f) - d.p_out - work", "y, work, f) + d.p_out - work"),
    M("viscous, oxygen", "uptake", VISCOUS, "outer - inner - W * share", "outer - inner + W * share"),
    M("viscous, surface", "V = a u", VISCOUS, "= V, V - work[_AREA, N]", "= V, V + work[_AREA, N]"),
]  # fmt: skip
INTEGRATION = [
    M("TR-BDF2", "past of the second stage", TRBDF2, "(1.0 - GAMMA) ** 2 * y[k]) / (G", "(1.0 + GAMMA) ** 2 * y[k]) / (G"),
]  # fmt: skip
FINITE_ELEMENTS = [
    M("2D, momentum", "mu F, one entry", POINT, "s[1] = mu * F12 - g * F21", "s[1] = -mu * F12 - g * F21"),
    M("2D, momentum", "g A, one entry", POINT, "s[2] = mu * F21 - g * F12", "s[2] = mu * F21 + g * F12"),
    M("2D, momentum", "mu F, with its tangent", POINT, "s[0] = mu * F11 + g", "s[0] = -mu * F11 + g", also=(
        ("s[1] = mu * F12", "s[1] = -mu * F12"), ("s[2] = mu * F21", "s[2] = -mu * F21"), ("s[3] = mu * F22", "s[3] = -mu * F22"),
        ("D[i, i] += mu", "D[i, i] -= mu"))),
    M("2D, momentum", "mu/J, with its tangent", POINT, "- mu / J - p", "+ mu / J - p", 2, (("lam + mu / (J * J)", "lam - mu / (J * J)"),)),
    M("2D, momentum", "lambda, with its tangent", POINT, "g = lam *", "g = -lam *", 2, (("stiff = lam +", "stiff = -lam +"),)),
    M("2D, momentum", "lambda (J - 1) J", POINT, "g = lam * (J - 1.0)", "g = lam * (J + 1.0)", 2),
    M("2D, momentum", "p, with its tangent", POINT, "/ J - p - contact", "/ J + p - contact", 2, (("D[i, 5] = -A[i]", "D[i, 5] = A[i]"),)),
    M("2D, momentum", "contact, with its tangent", POINT, "- p - contact", "- p + contact", 2, (("= -swell * A[i]", "= swell * A[i]"),)),
    M("2D, momentum", "stiffness of the tissue on lambda", POINT, "c.lam * c.tissue[row, STIFFNESS]", "c.lam", 2),
    M("2D, fibres", "push, with its tangent", POINT, "- c.tissue[row, PUSH] * contact", "+ c.tissue[row, PUSH] * contact", also=(
        ("push, stiff = c.tissue[row, PUSH]", "push, stiff = -c.tissue[row, PUSH]"),)),
    M("2D, fibres", "push, over |F a|^2", POINT, "c.tissue[row, PUSH] * contact * J / square", "c.tissue[row, PUSH] * contact * J"),
    M("2D, fibres", "reinforcement, with its tangent", POINT, "h = 2.0 * c.tissue[", "h = -2.0 * c.tissue[", also=(
        ("PUSH], c.tissue[row, REINFORCEMENT]", "PUSH], -c.tissue[row, REINFORCEMENT]"),)),
    M("2D, fibres", "(x) a_0", POINT, "s[1] += h * b1 * a2", "s[1] -= h * b1 * a2"),
    M("2D, fibres", "tangent, push by alpha", POINT, "-push * contact_slope * J", "push * contact_slope * J"),
    M("2D, cells", "growth, with its tangent", POINT, "J * (alpha - tau * q)", "J * (alpha + tau * q)", also=(
        ("cells = alpha - tau * q", "cells = alpha + tau * q"), ("1.0 - tau * q_alpha", "1.0 + tau * q_alpha"),
        ("D[4, 6] = -tau", "D[4, 6] = tau"))),
    M("2D, cells", "J of the step as printed", POINT, "(alpha - alpha_old) - J_old", "(alpha - alpha_old) + J_old"),
    M("2D, cells", "past of the step as printed", KERNEL, "e[4], e[0] * e[3] - e[1] * e[2]", "e[4], e[0] * e[3] + e[1] * e[2]"),
    M("2D, fluid", "J, with its tangent", POINT, "s[5] = J", "s[5] = -J", also=(("D[5, j] = A[j]", "D[5, j] = -A[j]"),)),
    M("2D, fluid", "flow, with its tangent", POINT, "else tau * law.mob", "else -tau * law.mob", also=(
        ("PERMEABILITY, tau * M", "PERMEABILITY, -tau * M"),)),
    M("2D, fluid", "flow over J", POINT, "c.law, c.floor) / J\n", "c.law, c.floor)\n"),
    M("2D, fluid", "tangent, mobility by alpha", POINT, "= relative * s[6], rel", "= -relative * s[6], rel"),
    M("2D, both flows", "A g of A^T k A g", POINT, "h1, h2 = e[3] * e[first] - e[2]", "h1, h2 = e[3] * e[first] + e[2]"),
    M("2D, both flows", "A^T of A^T k A g", POINT, "return e[3] * z1 - e[1] * z2", "return e[3] * z1 + e[1] * z2"),
    M("2D, both flows", "k_xy", POINT, "factor * (a * h1 + off * h2)", "factor * (a * h1 - off * h2)"),
    M("2D, both flows", "turning of the tensors, its sense", POINT, "u, v = e[0] + e[3], e[2] - e[1]", "u, v = e[0] + e[3], e[1] - e[2]"),
    M("2D, both flows", "turning of the tensors, off the diagonal", POINT, "(a - b) + (cc - ss) * off", "(a - b) - (cc - ss) * off"),
    M("2D, both flows", "tangent of the turning", POINT, "D[at + i, 1] -= u * turn", "D[at + i, 1] += u * turn"),
    M("2D, oxygen", "diffusion, with its tangent", POINT, "DIFFUSIVITY, 1.0 / J", "DIFFUSIVITY, -1.0 / J", also=(
        ("DIFFUSIVITY, 1.0, J", "DIFFUSIVITY, -1.0, J"),)),
    M("2D, oxygen", "uptake, with its tangent", POINT, "s[8] = J *", "s[8] = -J *", also=(("use = c.tissue", "use = -c.tissue"),)),
    M("2D, oxygen", "J of the uptake, with its tangent", POINT, "s[8] = J *", "s[8] =", also=(
        ("D[8, j] = taken * A[j]", "D[8, j] = 0.0"), ("= J * use * taken_alpha, J * use * taken_C", "= use * taken_alpha, use * taken_C"))),
    M("2D, oxygen", "consumption of the tissue, with its tangent", POINT, "J * c.tissue[row, CONSUMPTION] *", "J *", also=(
        ("use = c.tissue[row, CONSUMPTION]", "use = 1.0"),)),
    M("2D, bubbles", "gradient", KERNEL, "a, b, c = 27.0 * l1 * l2", "a, b, c = -27.0 * l1 * l2"),
    M("2D, bubbles", "strain", KERNEL, "1.0 + x[16] * by", "1.0 - x[16] * by"),
    M("2D, bubbles", "residual", KERNEL, "r[15] += s[0] * bx", "r[15] -= s[0] * bx"),
    M("2D, bubbles", "residual in that of the points", ASSEMBLY, "r[row] - kept[34 + row]", "r[row] + kept[34 + row]"),
    M("2D, bubbles", "tangent in that of the points", ASSEMBLY, "K[i, j] -= K[i, 15]", "K[i, j] += K[i, 15]"),
    M("2D, bubbles", "K_bb^-1", ASSEMBLY, "d * over, -b * over, -c * over", "d * over, -b * over, c * over"),
    M("2D, bubbles", "change", ASSEMBLY, "out[n, 0], out[n, 1] = -y0, -y1", "out[n, 0], out[n, 1] = y0, -y1"),
    M("2D, bubbles", "load", ASSEMBLY, "r[15] - bubble_load[0]", "r[15] + bubble_load[0]"),
    M("2D, sums", "loads", KERNEL, "R[:, :] = -loads", "R[:, :] = loads", 2),
    M("2D, sums", "moments of alpha J", KERNEL, "out[0, i] += e[4] * J * lam[a]", "out[0, i] -= e[4] * J * lam[a]"),
    M("2D, sums", "moments of growth", KERNEL, "out[2, i] += born", "out[2, i] -= born"),
    M("2D, sums", "moments of the flow", KERNEL, "(fx * corners[a, 0] + fy", "(fx * corners[a, 0] - fy"),
    M("2D, edges", "spring, with its tangent", EDGES, "R[own, 0] += fx + k * ux", "R[own, 0] += fx - k * ux", also=(
        ("R[own, 1] += fy + k * uy", "R[own, 1] += fy - k * uy"), ("+= k * share", "-= k * share"))),
    M("2D, edges", "spring along the normal, with its tangent", EDGES, "out = k_n *", "out = -k_n *", also=(("+= k_n *", "-= k_n *"),)),
    M("2D, edges", "traction in x", EDGES, "- 0.5 * length * actions[i, 0]", "+ 0.5 * length * actions[i, 0]"),
    M("2D, edges", "traction in y", EDGES, "- 0.5 * length * actions[i, 1]", "+ 0.5 * length * actions[i, 1]"),
    M("2D, edges", "load, with its tangent", EDGES, "0.5 * actions[i, 2]", "-0.5 * actions[i, 2]", 2),
    M("2D, edges", "edge as it is", EDGES, "- length * edges.normals[i, 1]", "+ length * edges.normals[i, 1]"),
    M("2D, edges", "influx, with its tangent", EDGES, "0.5 * actions[i, 3]", "-0.5 * actions[i, 3]", 2),
    M("2D, edges", "membrane, with its tangent", EDGES, "edges.membranes[i]", "(-edges.membranes[i])", 3),
    M("2D, edges", "oxygen behind the membrane", EDGES, "(0.5 * actions[i, 4] - C)", "(0.5 * actions[i, 4] + C)", 2),
    M("2D, edges", "length now, with its tangent", EDGES, "now = np.sqrt(x * x + y * y)", "now = edges.lengths[i]", 2, (
        ("to] -= into * away * x / now", "to] -= 0.0"), ("to + 1] -= into * away * y / now", "to + 1] -= 0.0"))),
    M("2D, edges", "tangent, length now", EDGES, "K[at + 4, to] -= into", "K[at + 4, to] += into"),
]  # fmt: skip
SURFACES = [
    M("2D, surface", "outward normals", SURFACE, "(along[:, 1], -along[:, 0])", "(-along[:, 1], along[:, 0])"),
    M("2D, surface", "oxygen behind a membrane", SURFACE, "C_out if part.C == OUTSIDE", "C_out if part.C != OUTSIDE"),
    M("2D, surface", "order of the actions", SURFACE, "traction_y, part.load, part.influx)), b", "load, part.traction_y, part.influx)), b"),
]  # fmt: skip
STEPS = [
    M("2D, step", "past of alpha J", MINI, "loads[:, ALPHA] += moments[0]", "loads[:, ALPHA] -= moments[0]"),
    M("2D, step", "past of J", MINI, "loads[:, P] += moments[1]", "loads[:, P] -= moments[1]"),
    M("2D, step", "cells born, in the moments", MINI, "step.loads[:, ALPHA] + step.tau * born", "step.loads[:, ALPHA] - step.tau * born"),
    M("2D, step", "flow, in the moments", MINI, "volume, step.loads[:, P] - step.tau", "volume, step.loads[:, P] + step.tau"),
    M("2D, step", "volume gained through the surface", MINI, "loads[:, P] + step.tau * flow)[s", "loads[:, P] - step.tau * flow)[s"),
    M("2D, step", "cells born, in the balance", MINI, "np.array([step.tau * float", "np.array([-step.tau * float"),
    M("2D, step", "rate of the volume", MINI, "rate[:] = gained / step.tau", "rate[:] = -gained / step.tau"),
    M("2D, step", "rate of the volume at t = 0", MINI, "return float(np.sum(self._moments", "return -float(np.sum(self._moments"),
    M("2D, step", "shares of what acts at once", MINI, "actions = before + share *", "actions = before - share *"),
]  # fmt: skip
HISTORY = [
    M("BDF2", "past", STEPPING, "past: Array = u[0] + (w", "past: Array = u[0] - (w"),
    M("BDF2", "coefficient of the new value", STEPPING, "(1.0 + 2.0 * w) / ((1.0 + w) * h)", "(1.0 + w) / ((1.0 + w) * h)"),
]  # fmt: skip
MIRRORS = [
    M("2D, mirror", "sign of the images", MIRROR, "[:, None], 1.0, flip))", "[:, None], 1.0, -flip))"),
    M("2D, mirror", "signs of a quarter", MIRROR, "signs=found.signs * half.signs[found.nodes]", "signs=found.signs"),
    M("2D, mirror", "displacement of the images", MIRROR, "values[self.nodes] * (self", "values[self.nodes] * abs(self"),
    M("2D, mirror", "tensors", MIRROR, "((own, 1.0), (other, -1.0))", "((own, 1.0), (other, 1.0))"),
    M("2D, mirror", "tractions", MIRROR, "all(v == -w for v, w", "all(v == w for v, w"),
    M("2D, mirror", "what is prescribed", MIRROR, 'signs["xy".index(axis)] = -1.0', 'signs["xy".index(axis)] = 1.0'),
]  # fmt: skip
WEAK_FORM = [
    M("2D, weak form", "mu F^-T", FORMS, "(mu * (F - F_inv_T) +", "(mu * (F + F_inv_T) +"),
    M("2D, weak form", "lambda", FORMS, "+ lam * J * (J - 1.0) * F_inv_T", "- lam * J * (J - 1.0) * F_inv_T"),
    M("2D, weak form", "load J F^-T", FORMS, "* F_inv_T) - load * J", "* F_inv_T) + load * J"),
    M("2D, weak form", "push of the fibres", FORMS, "(square - 1.0) - push", "(square - 1.0) + push"),
    M("2D, weak form", "turning of the tensors", FORMS, "F + det(F) * transpose(F_inv)", "F - det(F) * transpose(F_inv)"),
    M("2D, weak form", "growth", FORMS, "w.amount - w.tau * w.growth", "w.amount + w.tau * w.growth"),
    M("2D, weak form", "flow", FORMS, "w.J * phi + w.tau * dot", "w.J * phi - w.tau * dot"),
    M("2D, weak form", "uptake", FORMS, "grad(phi)) + w.uptake * phi", "grad(phi)) - w.uptake * phi"),
    M("2D, weak form", "load on an edge", FORMS, "+ w.load * normal_now", "- w.load * normal_now"),
    M("2D, weak form", "membrane", FORMS, "(w.beyond - w.C)", "(w.beyond + w.C)"),
]  # fmt: skip
LINEARISED = [
    M("modes, point", "mu/l_r^2", LINEAR, "rr = mu * (1.0 + 1.0", "rr = mu * (1.0 - 1.0"),
    M("modes, point", "bulk of p_tt", LINEAR, "+ (m - 1) * bulk * across**2", "- (m - 1) * bulk * across**2"),
    M("modes, point", "g", LINEAR, "rt = g * l_t", "rt = -g * l_t"),
    M("modes, grid", "k V of H_tt", OPERATORS, "diags_array(k / (m - 1)", "diags_array(-k / (m - 1)"),
    M("modes, grid", "k U of H_rt", OPERATORS, "diags_array(-k / R[1:])", "diags_array(k / R[1:])"),
    M("modes, grid", "V of H_rt", OPERATORS, "diags_array(-1.0 / R[1:])", "diags_array(1.0 / R[1:])"),
    M("modes, grid", "gap", OPERATORS, "U_p[-1:]]) - U_m)", "U_p[-1:]]) + U_m)"),
    M("modes, U and V", "turning on faces", STIFFNESS, "l_t) - 0.5 * (state.g", "l_t) + 0.5 * (state.g"),
    M("modes, U and V", "turning on the surface", STIFFNESS, "= mu * l_r[-1] / l_t[-1]", "= -mu * l_r[-1] / l_t[-1]"),
    M("modes, U and V", "p_1", MODES, '"load_{end}": -on.cells', '"load_{end}": on.cells'),
    M("modes, U and V", "contact", MODES, '"contact_{end}": -on.cells', '"contact_{end}": on.cells'),
    M("modes, cells", "alpha j", MODES, "(a * alpha - born) * other", "(-a * alpha - born) * other"),
    M("modes, cells", "q j", MODES, "(a * alpha - born) * other", "(a * alpha + born) * other"),
    M("modes, cells", "q_alpha", MODES, "J * (a - born_a)", "J * (a + born_a)"),
    M("modes, cells", "q_C", MODES, '"cells_C": -J * born_C', '"cells_C": J * born_C'),
    M("modes, cells", "past", MODES, "right[self._alpha] = a * past[0]", "right[self._alpha] = -a * past[0]"),
    M("modes, cells", "kept, alpha j", MODES, "y[self._alpha] + state.alpha * j", "y[self._alpha] - state.alpha * j"),
    M("modes, fluid", "dj/dt", MODES, "a * on.cells * other * flows", "-a * on.cells * other * flows"),
    M("modes, fluid", "past", MODES, "= a * self.on.cells * past[1]", "= -a * self.on.cells * past[1]"),
    M("modes, fluid", "kept, l_r H_tt", MODES, "+ by_t * (self.on.H_tt", "- by_t * (self.on.H_tt"),
    M("modes, fluid", "zeta'", MODES, "push = -state.r[1:]", "push = state.r[1:]"),
    M("modes, both flows", "Delta p_1", MODES, '"leak": leak', '"leak": -leak'),
    M("modes, both flows", "w (U + k V)", MODES, '"carry": w,', '"carry": -w,', also=(("push = -state", "push = state"),)),
    M("modes, both flows", "k V that carries", MODES, "on.U) + k * self", "on.U) - k * self"),
    M("modes, both flows", "gap", MODES, '"gap": -r * w', '"gap": r * w'),
    M("modes, both flows", "(k/R) p_1", MODES, '"side": side', '"side": -side'),
    M("modes, both flows", "H_tr", MODES, '"swirl_tr": w,', '"swirl_tr": -w,'),
    M("modes, both flows", "H_rt", MODES, '"swirl_rt": w *', '"swirl_rt": -w *'),
    M("modes, oxygen", "u j", MODES, '"oxygen_{end}": on.cells', '"oxygen_{end}": -on.cells'),
    M("modes, oxygen", "u_alpha", MODES, "on.cells * J * taken_a", "-on.cells * J * taken_a"),
    M("modes, oxygen", "u_C", MODES, "on.cells * J * taken_C", "-on.cells * J * taken_C"),
    M("modes, seed", "averages", MODES, "m / (exponent + m) * np.diff", "m / (exponent + 1.0) * np.diff"),
    M("modes, stiffness", "cells when drained", STIFFNESS, "bulk = lam + state.alpha", "bulk = lam - state.alpha"),
    M("modes, stiffness", "level", STIFFNESS, "(band - level * self._unit)", "(band + level * self._unit)"),
]  # fmt: skip

PATIENCE = 240.0
"""Seconds after which a group has failed, where ten times what it takes without a mutation is not more."""
Tests = list[str]


def group(folder: str, *names: str, only: str = "") -> Tests:
    return [*(f"tests/{folder}/test_{name}.py" for name in names), *(["-k", only] if only else [])]


MATHEMATICS = group("plaque1d", "dispersion", "annulus", "manufactured_lines", "lines", "exact")
RADIAL_MATHEMATICS = group(
    "tumour", "equations", "exact", "elastic_exact", "elastic_manufactured", "viscous_manufactured", "viscous", "elastic_runs"
)
BODIES = group("tumour/fem", "tissue_exact", "limits", "tissue_limits")
QUIET = "not memory and not kill"
ORDERS = group("tumour/fem", "manufactured", "tissue_manufactured", only="order_in_time")
ONE_STEP = "coefficients or turning or shift or areas or grid_converges"
MODES_AT_WORK = group("tumour", "disk_stability", "disk_stability_runs", only="stiffness_of or modes_of or wave_number_0 or against_two")

GROUPS: list[tuple[list[M], Tests, Tests]] = [
    (PLAQUE, group("plaque1d", "lines", only="tangent or assembles"), MATHEMATICS),
    (RADIAL, group("tumour", "elastic_tangent", "viscous_tangent", "fipy"), RADIAL_MATHEMATICS),
    (INTEGRATION, *[group("multiphase", "trbdf2")] * 2),
    (FINITE_ELEMENTS, group("tumour/fem", "kernel", "edges"), BODIES),
    (SURFACES, group("tumour/fem", "surface", "edges"), BODIES),
    (STEPS, group("tumour/fem", "scheme", "at_once", only=QUIET), BODIES),
    (HISTORY, group("multiphase", "stepping"), ORDERS),
    (MIRRORS, group("tumour/fem", "mirror", only="not half"), group("tumour/fem", "mirror", only="half")),
    (WEAK_FORM, group("tumour/fem", "forms"), group("tumour/fem", "kernel", "edges", only="two_statements")),
    (LINEARISED, group("tumour", "disk_stability", only=ONE_STEP), MODES_AT_WORK),
]
"""Mutations, and the tests that run against them."""
MUTATIONS = [mutation for mutations, _, _ in GROUPS for mutation in mutations]


class Copy:
    """A copy of the source tree, with tests run against it."""

    def __init__(self, folder: Path) -> None:
        self.tree, self.cache = folder / "tree", folder / "cache"
        shutil.rmtree(self.tree, ignore_errors=True)
        for name in FOLDERS:
            shutil.copytree(ROOT / name, self.tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy2(ROOT / "pyproject.toml", self.tree)
        self.sources = {file: (self.tree / file).read_text(encoding="utf-8") for file in {mutation.file for mutation in MUTATIONS}}
        self._patience: dict[tuple[str, ...], float] = {}
        self._kept = self._compiled

    @property
    def _compiled(self) -> set[Path]:
        return set(self.cache.glob("*/*"))

    def first_failure(self, chosen: Tests, patience: float) -> str:
        """Name of the first failing test, or "none"; a test in which the patience ends has failed."""
        environment = os.environ | {"PYTHONPATH": str(self.tree), "NUMBA_CACHE_DIR": str(self.cache)}
        command = [sys.executable, "-u", "-m", "pytest", "-x", "-v", "-p", "no:cacheprovider", *chosen]
        with subprocess.Popen(
            command, cwd=self.tree, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        ) as process:
            try:
                output = process.communicate(timeout=patience)[0]
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                output = process.communicate()[0].rstrip() + " FAILED"
            except BaseException:  # Ctrl-C does not reach the tests by itself
                os.killpg(process.pid, signal.SIGKILL)
                raise
        if process.returncode == 0:
            return "none"
        found = re.findall(r"test_(\w+)\.py::(.+?) (?:FAILED|ERROR)", output)
        if not found and process.returncode != 1:
            raise SystemExit(f"{' '.join(command)}\n{output}")
        return f"{found[0][0]}: {found[0][1]}" if found else "all: they do not begin"

    def must_pass(self, chosen: Tests) -> None:
        """Run tests without a mutation, once, and take the time."""
        if tuple(chosen) in self._patience:
            return
        before = time.perf_counter()
        failure = self.first_failure(chosen, 3600.0)
        if failure != "none":
            raise SystemExit(f"without any mutation fails {failure}")
        self._patience[tuple(chosen)] = max(PATIENCE, 10.0 * (time.perf_counter() - before))
        self._kept |= self._compiled

    def run(self, number: int, mutation: M, groups: tuple[Tests, Tests]) -> list[str]:
        """The first failures of each group with a mutation."""
        for chosen in groups:
            self.must_pass(chosen)
        file = self.tree / mutation.file
        times = (file.stat().st_atime_ns, file.stat().st_mtime_ns)
        file.write_text(mutation.of(self.sources[mutation.file]), encoding="utf-8")
        os.utime(file, (1e9 + 10.0 * number,) * 2)  # no two mutations of a file are taken for each other
        try:
            return [self.first_failure(chosen, self._patience[tuple(chosen)]) for chosen in groups]
        finally:
            file.write_text(self.sources[mutation.file], encoding="utf-8")
            os.utime(file, ns=times)
            for folder in self._compiled - self._kept:
                shutil.rmtree(folder, ignore_errors=True)


def read_table(table: Path) -> dict[str, str]:
    """The rows of a table by their first two columns."""
    lines = table.read_text(encoding="utf-8").splitlines() if table.exists() else []
    return {mutation.row: line for line in lines for mutation in MUTATIONS if line.startswith(mutation.row)}


def write_table(table: Path, rows: dict[str, str]) -> None:
    from benchmarks.machine import heading

    lines = [rows[mutation.row] for mutation in MUTATIONS if mutation.row in rows]
    text = [
        "# Mutations",
        "",
        "Each term changed in sign or by a factor in turn, and the first test of each kind that fails: `python -m benchmarks.mutations`.",
        f"{len(lines)} of {len(MUTATIONS)} mutations have been run.",
        "",
        heading(),
        "",
        "| equation | term | beside its tangent, or a second statement | mathematics |",
        "| --- | --- | --- | --- |",
        *lines,
        "",
    ]
    part = table.with_suffix(".part")
    part.write_text("\n".join(text), encoding="utf-8")
    part.replace(table)


def check(chosen: Sequence[M] = MUTATIONS) -> list[str]:
    """What is wrong with some of the mutations."""
    wrong = []
    for mutation in chosen:
        try:
            mutation.of((ROOT / mutation.file).read_text(encoding="utf-8"))
        except LookupError as error:
            wrong.append(str(error))
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", action="store_true", help="only look whether each term stands where it should")
    parser.add_argument("--only", metavar="PATTERN", default="", help='run those with PATTERN in "equation | term | file"')
    parser.add_argument("--again", action="store_true", help="run also what is in the table")
    parser.add_argument("--work", type=Path, help="where the copy and what is compiled is kept for the next time; nowhere by default")
    parser.add_argument("--table", type=Path, default=TABLE)
    options = parser.parse_args()
    rows = read_table(options.table)
    pattern = re.compile(options.only)
    wanted = {
        one for one in MUTATIONS if pattern.search(f"{one.equation} | {one.term} | {one.file}") and (options.again or one.row not in rows)
    }
    if (wrong := check(MUTATIONS if options.check else tuple(wanted))) or options.check:
        raise SystemExit("\n".join(wrong) or None)
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(options.work or Path(folder))
        chosen = [(one, (first, second)) for some, first, second in GROUPS for one in some]
        for number, (mutation, groups) in enumerate(chosen):
            if mutation in wanted:
                rows[mutation.row] = f"{mutation.row} {' | '.join(copy.run(number, mutation, groups))} |"
                print(rows[mutation.row], flush=True)
                write_table(options.table, rows)


if __name__ == "__main__":
    main()
