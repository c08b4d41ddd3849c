"""Random scenes that the plan makes smaller, and the comparison of the smaller with the full run.

`test_plan_reductions.py` draws a few, `benchmarks/plan_reductions.py` many.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from multiphase.errors import SolverError
from multiphase.result import Result
from multiphase.run import make_scene, run
from multiphase.scene import Scene
from plaque1d.model import MODEL as PLAQUE
from plaque1d.parameters import PlaqueGeometry, PlaqueParameters
from tumour.model import MODEL as TUMOUR
from tumour.parameters import TumourParameters

KINDS = (
    "elastic, free flow",
    "viscous, free flow",
    "elastic, at rest",
    "viscous, at rest",
    "no necrotic phase",
    "no macrophages",
    "phases at rest",
)
SPOILED = 5
"""Every fifth scene has one of the conditions of its kind taken away."""
FOLLOWS = ("doubling_time",)
"""Not compared: the growth rate and the radius are, from which it follows, and without growth it is without a bound."""
LEAST = 1e-3
"""Smallest scale of a quantity: what is smaller than this all through a run is compared absolutely. Values are of order 0.1 to 10."""
MOTION = dict.fromkeys(("displacement", "u", "growth_rate", "p", "stress_magnitude"), 1.0)
"""The same for what is 0 in a body at rest but for the errors of a full run, which its tolerance measures by the size of the body and the
fraction of its cells: an error of rtol in J is one of 2 mu + lambda times that in the stress. Sizes, stiffness and rates are of order 1."""


def draw(number: int) -> tuple[str, Scene]:
    """The scene of a number: of each kind in turn, the rest at random."""
    rng = np.random.default_rng(number)
    kind = KINDS[number % len(KINDS)]
    spoiled = number // len(KINDS) % SPOILED == 0
    make = _tumour if number % len(KINDS) < 4 else _plaque
    return kind, make(rng, kind, spoiled)


def _solver(rng: np.random.Generator, end: float) -> dict[str, Any]:
    scheme = str(rng.choice(["radau", "radau", "bdf2", "backward-euler"]))
    settings = {"cells": int(rng.integers(4, 25)), "rtol": float(10.0 ** rng.uniform(-6.0, -3.0)), "time_scheme": scheme}
    if scheme == "backward-euler":  # with a tolerance it takes very many steps
        settings["dt"] = end / float(rng.integers(10, 40))
    return settings


def _tumour(rng: np.random.Generator, kind: str, spoiled: bool) -> Scene:
    rest = kind.endswith("rest")
    star = float(rng.uniform(0.6, 0.85))
    values: dict[str, Any] = {
        "mu_alpha": float(rng.uniform(0.1, 1.0)), "lambda_alpha": float(rng.choice([0.0, rng.uniform(0.1, 2.0)])),
        "gamma": float(rng.uniform(0.02, 1.0)), "alpha_star": star, "alpha_min": star,
        "s2": float(rng.uniform(0.1, 0.6)), "Q": 0.0, "kappa": 0.0, "p_out": float(rng.choice([0.0, rng.uniform(-0.02, 0.02)])),
        "C_out": float(rng.uniform(0.5, 1.0)),
    }  # fmt: skip
    alpha: Any = float(rng.uniform(0.4, 0.92))
    if rng.random() < 0.2:
        values |= {"Q": 3.0, "C_out": 0.0}
    if rest:
        values |= {"kappa": float(rng.uniform(0.1, 2.0)), "p_out": 0.0}
        if rng.random() < 0.5:
            values["gamma"] = 0.0
        else:  # cells that die out, or grow to a fraction below contact
            values |= {"alpha_star": 0.93, "alpha_min": 0.9, "s2": 0.8}
            alpha = min(alpha, 0.85)
    if spoiled:
        how = rng.integers(4)
        if how == 0:  # a flow of the fluid
            values |= {"kappa": 0.5, "p_out": 0.02}
        elif how == 1:
            values |= {"Q": 2.0, "C_out": 0.8}
        elif how == 2:
            alpha = f"{0.9 * alpha:.3f} + {0.05 * alpha:.3f}*xi"
        else:  # contact that comes
            values |= {"kappa": 0.5, "gamma": 0.5, "alpha_star": 0.6, "alpha_min": 0.6, "s2": 0.1, "Q": 0.0, "C_out": 1.0}
            alpha = 0.55
    formulation = "eulerian" if kind.startswith("viscous") else "lagrangian"
    shape = str(rng.choice(["slab", "disk", "quarter_disk", "sphere"]))
    end = float(rng.uniform(0.5, 8.0))
    solver = _solver(rng, end)
    if solver["time_scheme"] == "backward-euler" and formulation == "lagrangian":
        solver["alpha_step"] = str(rng.choice(["conservative", "as-printed"]))
    geometry = {"kind": shape, "dimension": "radial", "formulation": formulation, "radius": float(rng.uniform(0.5, 2.0))}
    times = sorted(rng.uniform(0.0, end, 4))
    return make_scene(
        TUMOUR, TumourParameters(**values), initial={"alpha": alpha}, geometry=geometry, t_end=end, save_at=times, solver=solver
    )


def _plaque(rng: np.random.Generator, kind: str, spoiled: bool) -> Scene:
    end = float(rng.uniform(0.5, 4.0))
    values: dict[str, Any] = {
        "Psi_l": float(rng.uniform(0.0, 2.0)), "Psi_m": float(rng.choice([0.0, rng.uniform(0.05, 1.0)])),
        "k_l": float(rng.choice([0.0, rng.uniform(0.1, 20.0)])), "k_m": 0.0, "A": float(rng.uniform(0.0, 0.5)),
        "B": float(rng.uniform(0.0, 2.0)), "mu_n": float(rng.uniform(0.001, 0.05)), "mu_m": float(rng.uniform(0.001, 0.05)),
        "momentum": str(rng.choice(["interfacial", "drag"])),
    }  # fmt: skip
    if rng.random() < 0.3:
        values["Psi_l"] = {"times": [0.2 * end, 0.4 * end, 0.4 * end, 0.8 * end], "values": [1.0, 0.5, 2.0, 0.0]}
    if values["momentum"] == "drag":
        values["p_out"] = 1.0  # well-posed
    values["inner_wall"] = [0.4, "no_gradient"][rng.integers(2)]
    n: Any = 0.0
    if kind == "no macrophages":
        n = 1.0
        values |= {"Psi_m": 0.0, "k_m": float(rng.uniform(0.0, 2.0))}
    if kind == "phases at rest":
        n = float(rng.uniform(0.1, 0.9))
        values |= {"Psi_m": 0.0, str(rng.choice(["A", "B"])): 0.0}
        if values["A"] == 0.0 and values["momentum"] == "interfacial":
            n = f"{n:.3f} + 0.08*sin(3*xi)"
    if spoiled:
        how = rng.integers(4)
        if how == 0:
            values |= {"k_m": 0.5}
        elif how == 1:
            values |= {"Psi_m": 0.3}
        elif how == 2:
            n = "0.5 + 0.1*xi"
        else:
            values |= {"A": 0.3, "B": 1.0, "k_m": 0.2}
    shape = PlaqueGeometry() if rng.random() < 0.5 else PlaqueGeometry(kind="annulus", lumen_radius=float(rng.uniform(1.0, 10.0)))
    start = {"n": n, "l": float(rng.choice([0.0, rng.uniform(0.1, 2.0)])), "L": float(rng.uniform(0.5, 2.0))}
    times = sorted(rng.uniform(0.0, end, 4))
    return make_scene(PLAQUE, PlaqueParameters(**values), initial=start, geometry=shape, t_end=end, save_at=times, solver=_solver(rng, end))


def full(scene: Scene) -> Scene:
    """The scene with nothing left out."""
    return scene.with_changes(plan={"reduce": False})


def difference(scene: Scene) -> float:
    """Largest difference between the smaller and the full run, over the largest value of each quantity and ten times rtol: 1 or less
    where they agree. Where neither has an end, 0 if they fail alike."""
    ends: list[Result | str] = []
    for each in (scene, full(scene)):
        try:
            ends.append(run(each))
        except SolverError as error:
            ends.append(str(error).split("(")[0][:40])
    small, whole = ends
    if isinstance(small, str) or isinstance(whole, str):
        return 0.0 if small == whole else np.inf
    return of_results(small, whole, 10.0 * scene.solver.rtol)


def of_results(small: Result, whole: Result, tolerance: float) -> float:
    """`difference` of two results."""
    assert small.t.tolist() == whole.t.tolist()
    assert [*small.fields, *small.scalars] == [*whole.fields, *whole.scalars]
    largest = 0.0
    for name in ("x", *whole.fields, *whole.scalars):
        if name in FOLLOWS:
            continue
        a, b = (result.x if name == "x" else result[name] for result in (small, whole))
        assert a.shape == b.shape
        if not np.array_equal(np.isnan(a), np.isnan(b)):
            return np.inf
        scale = max(float(np.max(np.abs(b), initial=0.0, where=~np.isnan(b))), MOTION.get(name, LEAST))
        largest = max(largest, float(np.max(np.abs(a - b), initial=0.0, where=~np.isnan(b))) / scale)
    return largest / tolerance
