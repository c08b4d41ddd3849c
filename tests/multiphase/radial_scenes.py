"""Random disks that the plan solves along their radius, and the comparison of that with two dimensions.

`test_radial_reduction.py` draws a few, `benchmarks/plan_reductions.py` many. The two dimensions share no grid, so they can agree only to
what their grids leave: each is solved on a grid and on one half as fine, and the difference of the two is taken for its error.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multiphase.result import Result
from multiphase.run import make_scene, run
from multiphase.scene import Scene
from tumour.crosscheck import FIELDS, crosscheck
from tumour.model import MODEL
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]

KINDS = ("disk", "quarter_disk")
SPOILED = 5
"""Every fifth scene of a kind has something that is not the same in every direction, or that the radial equations have not."""
SPOILS = ("formula", "tissue", "tensor", "fibres", "part")
"""What that is, in turn: a formula in x, y or theta, a factor of the tissue, a tensor, fibres, a part of the surface."""
MESH = {"disk": 8, "quarter_disk": 16}
"""Rings of triangles of the finer mesh: 217 and 289 points."""
RINGS = 4
"""Rings over which fields are averaged: those of the coarser mesh of a disk."""
CIRCLES = 16
"""Circles on which the scatter is measured: many, as they lie in other places of the triangles of other meshes."""
LOOSER = 27.0
"""rtol of the run that tells the error of time is larger by this, so that steps of a scheme of order two are three times as long."""


def spoil_of(number: int) -> str:
    """What keeps the scene of a number from being radial; empty where nothing does."""
    turn = number // len(KINDS)
    return "" if turn % SPOILED else SPOILS[turn // SPOILED % len(SPOILS)]


def draw(number: int) -> tuple[str, Scene]:
    """The scene of a number: disks and quarter disks in turn, the rest at random."""
    rng = np.random.default_rng([20, number])
    kind = KINDS[number % len(KINDS)]
    end = float(rng.uniform(2.0, 10.0))
    values, solver = _values(rng), _solver(rng, end)
    alpha: Any = values["alpha_min"] + float(rng.uniform(-0.15, 0.05))
    if solver.get("alpha_step") == "as-printed":
        # The cells that this step makes or loses at the surface, where fluid enters at once, are of order one in the width of a triangle:
        # only from rest, without that.
        values["p_out"] = 0.0
        alpha = values["alpha_min"] - 0.5 * values["sigma_width"] - float(rng.uniform(0.08, 0.2))
    if rng.random() < 0.5:
        alpha = f"{alpha:.3f} + {rng.uniform(-0.05, 0.05):.3f}*{rng.choice(['xi', 'xi**2', 'cos(3*xi)', 'r/(1 + r)'])}"
    boundary = {}
    if spoil_of(number):
        alpha, boundary = _spoil(rng, spoil_of(number), values, alpha)
    return kind, make_scene(
        MODEL,
        TumourParameters(**values),
        initial={"alpha": alpha},
        geometry={"kind": kind, "radius": float(rng.uniform(0.5, 1.5))},
        boundary=boundary,
        t_end=end,
        save_at=[*sorted(rng.uniform(0.2 * end, 0.9 * end, 3)), end],
        solver=solver,
    )


def _values(rng: np.random.Generator) -> dict[str, Any]:
    """Parameters of the size of the paper's. Contact never attracts: tissue whose cells attract each other may part in two dimensions, and
    a radial run cannot. Nor is it so strong that no balance of stresses is found on a mesh at t = 0 (docs/tumour.md, "Hard cases")."""
    star, mu = float(rng.uniform(0.62, 0.78)), float(rng.uniform(0.3, 2.0))
    least, width = star, 0.0
    if rng.random() < 0.4:  # a spread switch, above alpha_star as a whole
        width = float(rng.uniform(0.03, 0.08))
        least, star = star, star - float(rng.uniform(0.5, 0.7)) * width
    values: dict[str, Any] = {
        "mu_alpha": mu, "lambda_alpha": float(rng.choice([0.0, rng.uniform(0.1, 2.0)])),
        "kappa": float(rng.choice([0.0, *rng.uniform(0.2, 3.0, 3)])), "mobility": str(rng.choice(["darcy", "printed", "constant"])),
        "gamma": mu * float(rng.uniform(0.2, 1.2)), "alpha_star": star, "alpha_min": least, "sigma_width": width,
        "s1": float(rng.uniform(2.0, 15.0)), "s2": float(rng.uniform(0.2, 0.8)), "s3": float(rng.uniform(0.0, 1.0)),
        "s4": float(rng.uniform(2.0, 15.0)), "Q": float(rng.choice([0.0, *rng.uniform(0.1, 2.0, 4)])),
        "Q1_hat": float(rng.choice([0.0, rng.uniform(0.1, 5.0)])), "C_out": float(rng.uniform(0.5, 1.5)),
        "p_out": float(rng.choice([0.0, rng.uniform(-0.05, 0.1)])),
    }  # fmt: skip
    if values["mobility"] == "printed" and rng.random() < 0.5:
        values["mobility_floor"] = float(rng.uniform(0.1, 0.5))
    return values


def _solver(rng: np.random.Generator, end: float) -> dict[str, Any]:
    """Of the radial run; `full` gives the mesh its rings. rtol is small: the error of BDF steps falls regularly only there (in one scene
    the radius at the end was off by the same 7e-5 from rtol = 1e-4 to 6e-6, and from there on by 0.25 rtol^(2/3))."""
    settings: dict[str, Any] = {"cells": 2 * int(rng.integers(8, 33)), "rtol": float(10.0 ** rng.uniform(-7.0, -6.3))}
    how = rng.integers(5)
    if how == 0:
        settings["time_scheme"] = "bdf2"
    if how == 1:
        settings |= {"time_scheme": "bdf2", "dt": end / 60.0}
    if how == 2:
        settings |= {"time_scheme": "backward-euler", "dt": end / 40.0, "alpha_step": str(rng.choice(["conservative", "as-printed"]))}
    return settings


def _spoil(rng: np.random.Generator, how: str, values: dict[str, Any], alpha: Any) -> tuple[Any, dict[str, Any]]:
    """The initial fraction and the parts of the surface with something in them, or in the values, that has a direction or that the radial
    equations have not."""
    if how == "formula":
        return f"{alpha} + {rng.uniform(0.02, 0.06):.3f}*{rng.choice(['x', 'x*y', 'y**2', 'xi*cos(2*theta)'])}", {}
    if how == "tissue":
        name = str(rng.choice(["stiffness", "permeability", "consumption", "diffusivity"]))
        values[name] = (1.5, 0.5, "1 + 0.5*xi", "1 + 0.3*x")[rng.integers(4)]
    if how == "tensor":
        values[str(rng.choice(["permeability", "diffusivity"]))] = {"xx": 1.5, "yy": 0.7, "xy": 0.0}
    if how == "fibres":
        values[str(rng.choice(["fibre_ratio", "fibre_stiffness"]))] = float(rng.uniform(1.2, 2.0))
    part: dict[str, Any] = {}
    if how == "part":
        acting = ({"C": 0.5}, {"p": "closed"}, {"spring": 1.0}, {"membrane": 1.0}, {"displacement_x": 0.0, "displacement_y": 0.0})
        part = {"part": {"where": str(rng.choice(["x > 0.3", "theta < 0.6", "y > x"])), **acting[int(rng.integers(len(acting)))]}}
    return alpha, part


def full(scene: Scene) -> Scene:
    """The scene in two dimensions."""
    return scene.with_changes(plan={"reduce": False}, solver={"cells": MESH[scene.geometry.kind]})


def with_errors(scene: Scene) -> tuple[Result, ...]:
    """The run of a scene, and those that tell its errors: on half the cells, and with a larger rtol.

    Fixed steps need no third run: both dimensions take the same ones by the same formula, so they solve the same problems in space, and how
    far those are from the problem in time has no part in their difference.
    """
    solver = scene.solver
    others = [scene.with_changes(solver={"cells": solver.cells // 2})]
    if solver.dt is None:
        others.append(scene.with_changes(solver={"rtol": LOOSER * solver.rtol}))
    return tuple(run(each) for each in (scene, *others))


def agreement(scene: Scene) -> Agreement:
    """A scene along its radius and in two dimensions."""
    return compared(scene, with_errors(full(scene)), with_errors(scene))


class Agreement(NamedTuple):
    """How far a disk along its radius is from the same in two dimensions.

    Attributes
    ----------
    differences, allowed : dict of str to float
        By quantity: the difference, and the sum of the error estimates.
    """

    differences: dict[str, float]
    allowed: dict[str, float]

    @property
    def ratios(self) -> dict[str, float]:
        """Differences over what is allowed."""
        return {name: self.differences[name] / self.allowed[name] for name in self.differences}

    @property
    def worst(self) -> float:
        """The largest ratio: 1 or less where the two agree."""
        return float(np.max(list(self.ratios.values())))  # no number where one of them is none

    def __str__(self) -> str:
        return ", ".join(
            f"{name} {self.differences[name]:.2g} of {self.allowed[name]:.2g}" for name, ratio in self.ratios.items() if not ratio <= 1.0
        )


def compared(scene: Scene, planes: tuple[Result, ...], radials: tuple[Result, ...]) -> Agreement:
    """The first of the runs of a scene in two dimensions and of those along the radius, with errors from the others: see `with_errors`.

    Compared are the radius and the averages over rings of the fields that are solved for, after t = 0 (there p jumps to its value at the
    surface, where the outermost triangles take in some fluid at once). All are of order two in space, averages of alpha as well, so the
    error of a grid is a third of its difference to one half as fine, and less than that difference for any order above one. No use is made
    of the third, as four and eight rings are few. Errors of the steps are told by a run of their own: if one run had both changed, they
    could cancel those of space. With rtol they shrink less regularly than 27^(2/3) = 9 says, but by more than two. Norms are maxima
    over rings and stored times: at one place or time two grids may agree by chance, where their difference changes its sign.

    Radial fields do not scatter round a ring, so the scatter in two dimensions is a difference, too. Averages alone would not see
    cos(2 theta). Its norm is the root mean square over the disk, in which alpha is of order 3/2.

    What Newton's method leaves is allowed besides, as much as balances may miss by it (`balance_limit`): relative to the size of a
    quantity, or to 1 where that is smaller, since p and the displacement may be 0. What is known, such as p = p_out, has no other errors.
    """
    whole = full(scene)
    assert scene.solver.dt is None or planes[0].stats["steps"] == radials[0].stats["steps"]
    plane, radial, scatter = zip(*map(_measured, planes, radials), strict=True)
    left = whole.model.plan(whole).balance_limit
    differences, allowed = {}, {}
    for name in plane[0]:
        size = max(1.0, float(np.max(np.abs(radial[0][name]))))
        differences[name] = _distance(plane[0][name], radial[0][name])
        allowed[name] = left * size + sum(_distance(found[0][name], other[name]) for found in (plane, radial) for other in found[1:])
        if name in FIELDS:
            most = [float(np.max(found[name])) for found in scatter]
            differences[f"scatter of {name}"] = most[0]
            allowed[f"scatter of {name}"] = left * size + sum(abs(most[0] - other) for other in most[1:])
    return Agreement(differences, allowed)


def _measured(plane: Result, radial: Result) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Radius and averages in two dimensions, the same along the radius, and the scatter at each time."""
    means, fine = crosscheck(plane, radial, rings=RINGS), crosscheck(plane, radial, rings=CIRCLES)
    areas = np.diff(fine.edges**2)
    scatter = {name: np.sqrt(fine.rms[name][1:] ** 2 @ areas) for name in FIELDS}
    both = [{name: of[name][1:] for name in FIELDS} for of in (means.plane, means.radial)]
    for row, found in enumerate(both):
        found["radius"] = means.radius[row, 1:]
    return both[0], both[1], scatter


def _distance(a: Array, b: Array) -> float:
    return float(np.max(np.abs(a - b)))
