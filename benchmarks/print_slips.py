r"""What each slip of the paper's print changes in the answer.

    python -m benchmarks.print_slips > benchmarks/print_slips.md        # and benchmarks/print_slips.csv

The slips are the rows of the two tables "Where the print is corrected", in docs/model.md and docs/tumour.md, in their order. Each is solved
as printed and as corrected, all else as it is solved, on one scene:

- disk: the paper's elastic disk with mobility "darcy", to t = 60, 400 cells; viscous: the same with viscous cells and lambda_alpha = 1;
  the authors' code: the preset authors-disk;
- glioma: `tumour-glioma` (the paper's values) and `tumour-glioma-stiff` (lambda_alpha = 1), in two dimensions, 10 triangles to the radius;
- demo, mouse: the plaque's presets, to t = 40 and 17,000, 800 cells.

Where a parameter or an option switches the slip, it is used. The others are made in a copy of the source tree, by the exact replacements of
`EDITS`; each old text must stand in its file once. Tangents are edited as far as it takes for Newton's method to converge; the answer does
not depend on them. How the printed forms enter the discrete equations:

**(2.4), no alpha at lambda.** sigma_i = 2 alpha mu e_i + lambda tr e: lambda acts with its full weight where no cells are left.

**(2.6), deaths.** (s2 + s3 C)/(1 + s4) alpha. Both forms agree at C = 1, and as printed deaths without oxygen are s2/(1 + s4), not s2.

**Pressure term without F^-1 F^-T.** J_t = Div(M J grad p). Radially F^-1 F^-T is 1/l_r^2 along the radius. Integrated once, with
J R^(m-1) dR = r^(m-1) dr, it is r^(m-1) r_t = R^(m-1) M J p_R, hence r_t = M l_r p_R instead of (M/l_r) p_R: the mobility of a face is
multiplied by l_r^2, l_r the width between the middles of its cells over that at rest.

**Traction J F^-T t_0.** Radially F^-T multiplies t_0 by 1/l_r, so P_r = t_0 l_t^(m-1): force per area as it is, and p_out raised by t_0
does just that (and shifts p). P N_0 = t_0, force per area at rest, is that with t_0 (R_0/r)^(m-1) for p_out in the last row of the
momentum. The paper's scenes have t_0 = 0; here it is -0.2, which presses.

**Lambda as the bulk viscosity K.** Then lambda = K - 2 mu/m; in a disk m = 2.

**(3.1b), dn/dt twice.** n_t + (n u_n)' = S and n_t + (c u_m)' = -S with n + c = 1, S = k_m l c. Their difference, integrated from the
endothelium (u_n = 0, c u_m = V = Psi_m l(0)) to the media (u_n = u_m = L'), is L' = (V - 2 int S dx)/(1 - 2 n(L)), in place of L' = V.

**(3.7a-c), outward normal.** Both influxes change sign, Psi_l and Psi_m.

**(3.8a), k_n.** With k_n other than k_m the sum of both balances is (c u_m + n u_n)' = (k_n - k_m) l c: volume is made. So the velocity of
the mixture varies, û(x) = V + (k_n - k_m) int_0^x l c, L' = û(L), u_n = û - c w, u_m = û + n w, and nu û' n' joins the slip equation (equal
viscosities nu).

**(3.8c), + k_l l m.** The sign of the uptake.

**(3.8d,e), b_n.** With b_n in the balance of n and b in that of macrophages, drag no longer cancels in their sum. With p_n eliminated as
before, the interfacial form has b n + b_n c in place of b.

**(3.9), third.** With u_l the velocity of the mixture, L' = V makes l (u_l - L') = 0 an identity, and diffusion lacks a condition; l = 0 is
the other way to satisfy it. Then the last cell loses 2 l/(h W) through the media.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
TABLE = Path(__file__).with_suffix(".csv")
COLUMNS = ("model", "where", "printed", "solved", "quantity", "solved_value", "printed_value", "change")
LAWS, ELASTIC = "tumour/equations.py", "tumour/radial.py"
FV, SLIP, LAYOUT, SEMI = "plaque1d/discretisation.py", "plaque1d/slip.py", "plaque1d/layout.py", "plaque1d/semidiscrete.py"

EDITS: Mapping[str, tuple[tuple[str, str, str], ...]] = {
    "lambda without alpha": (
        (LAWS, "volumetric = lam * alpha * (e_r", "volumetric = lam * (e_r"),
        (LAWS, "volumetric = lam * (e_r + (m - 1) * e_t)\n    own, other = alpha * (2.0 * mu + lam), alpha * lam",
         "volumetric = 0.0 * lam * e_r\n    own, other = 2.0 * mu * alpha + lam, lam"),
    ),
    "deaths as printed": (
        (LAWS, "death = (s2 + s3 * has) / (1.0 + s4 * has) + (s3 - s2 * s4) * lacks", "death = (s2 + s3 * C) / (1.0 + s4)"),
        (LAWS, "death = (s2 + s3 * has) / below_death + (s3 - s2 * s4) * lacks", "death = (s2 + s3 * C) / (1.0 + s4)"),
        (LAWS, "death_slope = (s3 - s2 * s4) / (below_death * below_death)", "death_slope = s3 / (1.0 + s4) + 0.0 * below_death"),
    ),
    "no pull-back of the flow": (
        (ELASTIC, "return work[_ZETA, f - 1] if f == d.cells else 0.5 * (work[_ZETA, f - 1] + work[_ZETA, f])",
         "at_rest = d.R[1] if f < d.cells else 0.5 * d.R[1]\n"
         "    zeta = work[_ZETA, f - 1] if f == d.cells else 0.5 * (work[_ZETA, f - 1] + work[_ZETA, f])\n"
         "    return zeta * (at_rest / work[_GAP, f]) ** 2"),
        (ELASTIC, "row_r -= weight * difference * gap_r / gap", "row_r += weight * difference * gap_r / gap"),
        (ELASTIC, "by_alpha -= weight * difference / zeta * share * work[_ZETA_A, i]",
         "by_alpha -= weight * difference / zeta * share * work[_ZETA_A, i] * ((d.R[1] if f < N else 0.5 * d.R[1]) / gap) ** 2"),
    ),
    "traction per area at rest": (
        (ELASTIC, "return step + d.p_out if f == d.cells",
         "return step + d.p_out * (d.R[f] / work[_RADIUS, f]) ** (d.m - 1) if f == d.cells"),
    ),
    "outward influxes": (
        (LAYOUT, "return d.influx + d.influx_rate * (t - d.t_0)", "return -(d.influx + d.influx_rate * (t - d.t_0))"),
        (SEMI, '"A", "B", "k", "p_out")},\n        )', '"A", "B", "k", "p_out")},\n        )._replace(Psi_m=-parameters.Psi_m)'),
    ),
    "k_n = 1.1 k_m": (
        (LAYOUT, "WORK_ROWS = 15", "WORK_ROWS = 16"),
        (FV, "if d.annulus else 1.0\n\n\n@njit",
         "if d.annulus else 1.0\n    work[15, 0] = 0.0\n    for i in range(N):\n"
         "        work[15, i + 1] = work[15, i] + 0.1 * d.k_m * W / N * l[i] * (1.0 - n[i])\n\n\n@njit"),
        (FV, "law.necrotic_velocity(V, n_f, slip), f / d.cells, V)",
         "law.necrotic_velocity(V + work[15, f], n_f, slip), f / d.cells, V + work[15, d.cells])"),
        (FV, "law.necrotic_velocity(V, n_f, slip), xi, V)", "law.necrotic_velocity(V + work[15, f], n_f, slip), xi, V + work[15, N])"),
        (FV, "_l_transport(d, W, V, radius[f], f * h)",
         "_l_transport(d, W, V, radius[f], f * h)\n        velocity += work[15, f] - f * h * work[15, N]"),
        (FV, "out[m * N] = V\n", "out[m * N] = V + work[15, N]\n"),
        (FV, "= d.k_m * W * rate, -d.k_l", "= 1.1 * d.k_m * W * rate, -d.k_l"),
        (SLIP, "* y[row] + r * n_f[f] * step\n",
         "* y[row] + r * n_f[f] * step\n        spread = 0.5 * (work[15, f + 1] - work[15, f - 1]) / (h * W)\n"
         "        out[row] += law.viscosity(d.mu_n, d.lambda_n) * spread * (n[f] - n[f - 1])\n"),
    ),
    "modLDL is produced": (
        (FV, "* W * rate, -d.k_l * W * rate", "* W * rate, d.k_l * W * rate"),
        (FV, "jac[m * i + 1, half - 1] += d.k_l * l[i]", "jac[m * i + 1, half - 1] -= d.k_l * l[i]"),
        (FV, "jac[m * i + 1, half] -= d.k_l * (1.0 - n[i])", "jac[m * i + 1, half] += d.k_l * (1.0 - n[i])"),
    ),
    "b_n = 2 b": (
        (SLIP, "out[row] = h * W * d.b * n_f[f]", "out[row] = h * W * d.b * (1.0 + c_f[f]) * n_f[f]"),
        (SLIP, "jac[row, half] += h * W * d.b * n_f[f]", "jac[row, half] += h * W * d.b * (1.0 + c_f[f]) * n_f[f]"),
        (SLIP, "fraction = h * W * d.b * (slope_n * c_f[f] + n_f[f] * slope_c) * w",
         "fraction = h * W * d.b * ((1.0 + c_f[f]) * (slope_n * c_f[f] + n_f[f] * slope_c) + n_f[f] * c_f[f] * slope_c) * w"),
    ),
    "l = 0 at the media": (
        (FV, "out[1] += d.inner_radius * Psi_l / h",
         "out[1] += d.inner_radius * Psi_l / h\n    out[m * (N - 1) + 1] -= 2.0 * l[N - 1] / (h * h * W)"),
        (FV, "jac[m * i + 1, half] -= d.k_l * (1.0 - n[i])",
         "jac[m * i + 1, half] -= d.k_l * (1.0 - n[i]) + (2.0 / (h * h * W * W) if i == N - 1 else 0.0)"),
    ),
}  # fmt: skip
"""Slips without a switch: (file, text, replacement), by name."""


class Form(NamedTuple):
    """One way to write the equations: changes of the scene's settings, by table, and the name of the edits, if any."""

    settings: Mapping[str, Mapping[str, Any]] = {}
    edits: str = ""


SOLVED = Form()


class Pair(NamedTuple):
    """Printed against solved on one scene, and what is read off."""

    scene: str
    printed: Form
    quantities: Sequence[str]
    label: str = ""
    solved: Form = SOLVED


class Slip(NamedTuple):
    """A row of a table of the docs, by its first column, and what it changes."""

    where: str
    pairs: Sequence[Pair] = ()
    remark: str = ""


def parameters(**values: Any) -> Form:
    """The scene with other parameters."""
    return Form({"parameters": values})


FLOOR = {"mobility": "printed", "mobility_floor": 1e-4}
DISK = ("R(60)", "α(0)", "C(0)")
DEMO = ("L(40)", "∫n", "n(0)")
MOUSE = ("L(17000)",)
AUTHORS = {"time_scheme": "backward-euler", "dt": 0.5}
AS_PRINTED = {**AUTHORS, "alpha_step": "as-printed"}
OPEN = "not defined"
SAME = 2e-4
"""Changes below this are called none."""
LEFT_OUT = ("∫n", "C(0)")
"""Quantities that only the CSV file has."""
PRESSED = {"p_out": -0.2}


def plaque(printed: Form, label: str = "", solved: Form = SOLVED) -> tuple[Pair, Pair]:
    """A slip of the plaque on both presets."""
    return Pair("demo", printed, DEMO, label, solved), Pair("mouse", printed, MOUSE, label, solved)


PLAQUE: tuple[Slip, ...] = (
    Slip("(3.1b)", (Pair("start", Form({"equations": {"(3.1b)": "as printed"}}), ("initial L'/(Ψ_m l(0))",)),),
         "no growth rate at all where n = 1/2 at the media"),
    Slip("(3.6)", (), "nothing: wording"),
    Slip("(3.7a–c)", (Pair("demo", Form(edits="outward influxes"), ("L(40)",)),),
         "modLDL would leave a wall that holds none"),
    Slip("(3.8a)", plaque(Form(edits="k_n = 1.1 k_m"), "k_n = 1.1 k_m"),
         f"{OPEN} as printed: k_n has no value; another than k_m makes volume"),
    Slip("(3.8c)", plaque(Form(edits="modLDL is produced")), "no D_l: nothing, scaling"),
    Slip("(3.8d,e)", (*plaque(parameters(mu_n=0.0025, mu_m=0.0025), "μ + λ"), *plaque(Form(edits="b_n = 2 b"), "b_n = 2 b")),
         f"{OPEN} as printed: b_n has no value"),
    Slip("(3.8d,e)", (Pair("demo", parameters(momentum="drag"), DEMO),),
         "ill-posed where n < 1/2 and p_out is small; n(0) converges to first order only"),
    Slip("(3.8h)", (*plaque(parameters(inner_wall=0.9), "n(0) = 0.9"), *plaque(parameters(inner_wall=0.5), "n(0) = 0.5")),
         f"{OPEN} as printed: one condition is missing"),
    Slip("(3.9)", (Pair("demo", parameters(momentum="drag", p_out=0.1), DEMO, "drag form, p_out = 0.1", parameters(momentum="drag")),
                   Pair("demo", parameters(p_out=0.1), ("L(40)",), "interfacial form, p_out = 0.1")),
         f"{OPEN} as printed; the interfacial form feels it in p_n alone"),
    Slip("(3.9), third", plaque(Form(edits="l = 0 at the media"), "l(L) = 0"),
         f"{OPEN} as printed: u_l is undefined, and with the mixture's the condition holds of itself"),
)  # fmt: skip

TUMOUR: tuple[Slip, ...] = (
    Slip("(2.4), last summary", (Pair("viscous", Form(edits="lambda without alpha"), DISK, "viscous, λ = 1"),), "nothing where λ = 0"),
    Slip("(2.4)", (Pair("viscous", parameters(lambda_alpha=0.0), DISK, "viscous, 1 taken for the bulk viscosity"),),
         "else nothing: wording; 0 taken for it would leave expansion without resistance (refused)"),
    Slip("(2.5)", (Pair("disk", parameters(gamma=0.5), DISK, "γ = 0.5"), Pair("disk", parameters(gamma=2.0), DISK, "γ = 2")),
         f"{OPEN} as printed: γ has no value; Σ at α_min: nothing where α_min = α*, as Σ = 0 there"),
    Slip("(2.6), deaths", (Pair("disk", Form(edits="deaths as printed"), (*DISK, "C*")),), "the core does not die"),
    Slip("(2.9)", (), "nothing: wording"),
    Slip("(2.16), (2.17), (2.22c)", (Pair("disk", parameters(mobility="printed"), DISK),)),
    Slip("strong form, summary", (Pair("disk", Form(edits="no pull-back of the flow"), DISK),)),
    Slip("(2.22a), traction",
         (Pair("disk", parameters(**PRESSED), DISK, "t̂_0 = −0.2", Form({"parameters": PRESSED}, "traction per area at rest")),),
         "nothing in the paper's scenes, where t̂_0 = 0"),
    Slip("n = F⁻ᵀ N_0", (), "nothing: wording"),
    Slip("after (2.23)", (), "nothing: wording; α and p are in the same space, P1"),
    Slip("list of parameters", (Pair("disk", parameters(kappa=0.5), DISK, "κ = 0.5"), Pair("disk", parameters(kappa=2.0), DISK, "κ = 2")),
         f"{OPEN} as printed: κ has no value"),
    Slip("glioma", (Pair("glioma", Form(), ("area at t = 40", "mean α", "C_min", "end"), "λ_α = 1 → 0", parameters(lambda_alpha=1.0)),)),
    Slip("authors' code, step of α",
         (Pair("disk", Form({"parameters": FLOOR, "solver": AS_PRINTED}), (*DISK, "defect of cells"),
               "backward Euler, 0.5", Form({"parameters": FLOOR, "solver": AUTHORS})),)),
    Slip("authors' code, time",
         (Pair("disk", Form({"parameters": FLOOR, "solver": AS_PRINTED, "time": {"end": 60.5}}), DISK, "the authors' preset",
               Form({"parameters": FLOOR, "solver": AS_PRINTED})),),
         "the curves are shifted by a step of 0.5"),
)  # fmt: skip


def documented(model: str) -> list[tuple[str, str, str]]:
    """Where, printed, solved of each row of the table of a model's slips in the docs."""
    text = (ROOT / "docs" / f"{'model' if model == 'plaque' else model}.md").read_text(encoding="utf-8")
    section = text.split("## Where the print is corrected\n")[1].split("| where |")[1].split("\n\n")[0]
    cells = [[cell.strip() for cell in line.strip("| ").split("|")] for line in section.splitlines()[2:]]
    return [(row[0], row[1], row[2]) for row in cells]


def slips() -> Iterator[tuple[str, tuple[str, str, str], Slip]]:
    """Model, the row of the docs, and what is measured of it; stops where they do not belong together."""
    for model, listed in (("plaque", PLAQUE), ("tumour", TUMOUR)):
        rows = documented(model)
        if [row[0] for row in rows] != [slip.where for slip in listed]:
            raise SystemExit(f"the slips of the {model} are not those of its table in docs/")
        for row, slip in zip(rows, listed, strict=True):
            yield model, row, slip


def edited_tree(tree: Path, edits: str) -> None:
    """Write the packages with `edits` made into `tree`."""
    for name in ("multiphase", "plaque1d", "tumour"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file, old, new in EDITS[edits]:
        text = (tree / file).read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise SystemExit(f"{file}: {old!r} stands there {text.count(old)} times")
        (tree / file).write_text(text.replace(old, new), encoding="utf-8")


def run_disk(scene: str, settings: Mapping[str, Any], cells: int = 400, rtol: float = 1e-5) -> dict[str, float]:
    """The paper's disk."""
    from tumour import TumourGeometry, TumourParameters, equations, simulate

    viscous = scene == "viscous"
    p = TumourParameters(**({"lambda_alpha": 1.0} if viscous else {}) | settings.get("parameters", {}))
    geometry = TumourGeometry(kind="disk", formulation="eulerian" if viscous else "lagrangian")
    end, solver = settings.get("time", {}).get("end", 60.0), settings.get("solver", {})
    result = simulate(p, geometry=geometry, t_end=end, cells=cells, rtol=rtol, save_every=0.5, **solver)
    C = np.linspace(1e-4, 1.0, 200_001)
    grows = equations.net_growth(np.full(C.shape, p.alpha_star), C, *p.kinetics) > 0.0
    return {
        "R(60)": float(result["radius"][-1]),
        "α(0)": float(result["alpha"][-1, 0]),
        "C(0)": float(result["C"][-1, 0]),
        "defect of cells": float(np.abs(result["defect_cells"]).max()),
        "C*": float(C[np.argmax(grows)]),
    }


def run_glioma(settings: Mapping[str, Any], cells: int = 10) -> dict[str, float]:
    """The glioma, in two dimensions."""
    from tumour import TumourGeometry, TumourParameters, simulate

    p = TumourParameters(**{"mobility": "printed"} | settings.get("parameters", {}))
    geometry = TumourGeometry(kind="glioma", radius=0.39)
    result = simulate(p, geometry=geometry, t_end=100.0, cells=cells, save_every=1.0, raise_on_failure=False)
    k = int(np.searchsorted(result.t, 40.0))
    return {
        "area at t = 40": float(result["area"][k]),
        "mean α": float(result["cell_mass"][k] / result["area"][k]),
        "C_min": float(result["C_min"][k]),
        "end": float(result.t[-1]),
    }


def run_plaque(scene: str, settings: Mapping[str, Any], cells: int = 800, rtol: float = 1e-5) -> dict[str, float]:
    """A preset of the plaque."""
    from plaque1d import PlaqueInitial, PlaqueParameters, simulate
    from plaque1d.parameters import find_preset

    p = PlaqueParameters(**{**find_preset(scene).parameters, **settings.get("parameters", {})})
    end = 40.0 if scene == "demo" else 17_000.0
    result = simulate(p, initial=PlaqueInitial.preset(scene), t_end=end, cells=cells, rtol=rtol, raise_on_failure=False)
    if result.status != "completed":
        return {"ended": float(result.t[-1])}
    return {f"L({end:g})": float(result["L"][-1]), "∫n": float(result["n_total"][-1]), "n(0)": float(result["n_wall"][-1])}


def start_of_demo(settings: Mapping[str, Any]) -> dict[str, float]:
    """The growth rate of the preset demo over its influx before any uptake, which is closed in both forms of (3.1b)."""
    from plaque1d.parameters import find_preset

    n = find_preset("demo").initial["n"]
    return {"initial L'/(Ψ_m l(0))": 1.0 / (1.0 - 2.0 * n) if settings.get("equations") else 1.0}


def measure(scene: str, settings: Mapping[str, Any]) -> dict[str, float]:
    """What is read off a scene, with the packages that are imported."""
    if scene == "start":
        return start_of_demo(settings)
    if scene == "glioma":
        return run_glioma(settings)
    return run_plaque(scene, settings) if scene in ("demo", "mouse") else run_disk(scene, settings)


@cache
def edited(edits: str) -> tempfile.TemporaryDirectory[str]:
    """A copy of the packages with `edits` made, which lives as long as this process."""
    folder = tempfile.TemporaryDirectory()
    edited_tree(Path(folder.name), edits)
    return folder


@cache
def _measured(scene: str, settings: str, edits: str) -> dict[str, float]:
    if not edits:
        return measure(scene, json.loads(settings))
    tree = Path(edited(edits).name)
    # compiled code is kept in the copy, not beside that of the packages as they are
    environment = os.environ | {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(tree / "compiled")}
    command = [sys.executable, "-P", str(Path(__file__).resolve()), scene, settings]
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{edits}, {scene}: {done.stderr[-2000:]}")
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    if not answer.pop("tree").startswith(str(tree)):
        raise SystemExit("the packages of the copy were not those that ran")
    return answer


def measured(scene: str, form: Form) -> dict[str, float]:
    """What is read off a scene in one form of the equations."""
    return _measured(scene, json.dumps(form.settings, sort_keys=True), form.edits)


def shown(value: float) -> str:
    """A number with four digits."""
    return f"{value:.1e}" if 0.0 < abs(value) < 1e-3 else f"{value:#.4g}".rstrip(".")


def change_of(quantity: str, solved: float, printed: float) -> str:
    """The change in words: relative, but absolute where it is that of a fraction or of C, and a factor where it is large."""
    if quantity == "defect of cells":
        return "no balance"
    if quantity in ("n(0)", "α(0)", "C(0)", "C*", "mean α", "C_min"):
        return f"{printed - solved:+.2g}".replace("-", "−") if abs(printed - solved) >= SAME else "the same"
    share = printed / solved - 1.0
    if abs(share) < SAME:
        return "the same"
    if printed * solved < 0.0:
        return "the other sign"
    if share > 3.0:
        return f"× {printed / solved:.3g}"
    return (f"{100.0 * share:+.2g} %" if abs(share) < 0.1 else f"{100.0 * share:+.0f} %").replace("-", "−")


def rows() -> Iterator[tuple[str, ...]]:
    """The rows of the table, in the order of COLUMNS."""
    for model, (where, printed, solved), slip in slips():
        first = (model, where, printed, solved)
        for pair in slip.pairs:
            right, wrong = measured(pair.scene, pair.solved), measured(pair.scene, pair.printed)
            label = ", ".join(filter(None, ("mouse" if pair.scene == "mouse" else "", pair.label)))
            for quantity in pair.quantities:
                name = f"{label}: {quantity}" if label else quantity
                if quantity not in wrong:
                    yield *first, name, shown(right[quantity]), "", f"no solution: ends at t = {wrong['ended']:.3g}"
                    continue
                values = right[quantity], wrong[quantity]
                yield *first, name, shown(values[0]), shown(values[1]), change_of(quantity, *values)
        if slip.remark:
            yield *first, "", "", "", slip.remark


def stored() -> list[dict[str, str]]:
    """The rows of the CSV file."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def summary(table: Sequence[Mapping[str, str]]) -> list[str]:
    """The lines of the section of VERIFICATION.md, one a slip, from the rows of the CSV file."""
    lines: dict[tuple[str, str, str, str], list[str]] = {}
    for row in table:
        cells = lines.setdefault((row["model"], row["where"], row["printed"], row["solved"]), [])
        if not row["quantity"]:
            cells.append(row["change"])
            continue
        label, _, quantity = row["quantity"].rpartition(": ")
        if quantity in LEFT_OUT:
            continue
        said = any(cell.startswith(f"{label}: ") for cell in cells)
        then = f" → {row['printed_value']} ({row['change']})" if row["printed_value"] else f", {row['change']}"
        cells.append((f"{label}: " if label and not said else "") + f"{quantity} {row['solved_value']}{then}".replace("-", "−"))
    return [
        f"| {where} | {printed} | {solved.replace(' above', '')} | {'; '.join(cells)} |"  # what is above in the docs is not so there
        for (_, where, printed, solved), cells in lines.items()
    ]


def main() -> None:
    from benchmarks.machine import heading

    text = (__doc__ or "").split("\n\n", 1)[1].split("The slips are", 1)[1]
    print(f"# What each slip of the print changes\n\n{heading()}\n\nThe slips are{text}")
    print(f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}")
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows():
            writer.writerow(row)
            print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        import multiphase

        answer = measure(sys.argv[1], json.loads(sys.argv[2]))
        print(json.dumps({**answer, "tree": str(Path(multiphase.__file__))}))
    else:
        main()
