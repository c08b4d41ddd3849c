"""The hard cases of the tumour: what each must do, stated beforehand.

`test_tumour_hard.py` checks them, `benchmarks/hard.py` prints them. Radial cases run as slab, disk and sphere, each with Radau IIA and with
BDF of order two, but where said; elastic cells have the values of the preset "paper", viscous ones the defaults. Bodies in two dimensions
have the former.

Of a case that finishes, these hold at every stored time:

    fractions   0 < alpha < 1; viscous cells may die out: 0 <= alpha < 1
    volume      elastic: J > 0
    oxygen      C <= C_out and, radial, C >= 0 and C >= C_out (1 - Q R^2/(2 m)), which is what there would be if all of the body were cells
                that take up Q C_out; to 1e-2 rtol. In two dimensions C >= -1e-3 (elements of degree one know no such bound)
    sums        radial: the size of the body is that of its radius, the cells the sum of alpha over the grid, both to 1e-12
    balances    radial: cells and volume to 1e-11, rounding of some 1000 steps. Two dimensions: to ten of Newton's tolerances, 0.1 rtol,
                as the moments that are balanced are known to that
    growth      where it is said that R rises: it does not fall by more than ten rtol; the elastic slab's, which comes to rest, overshoots,
                and falls back by a twentieth at most
    time error  against the same grid and a far smaller rtol: within ten rtol with Radau, a hundred with BDF, whose errors a growing body
                keeps, so that rtol is to be a thirtieth of what is wanted (docs/tumour.md). It is that of R, of cells and size, m times
                as much, each relative to its largest value, and of alpha, its mean over the cells or points
    finite      every stored value, but the doubling time of what does not grow
    silence     no warning, other than one that is expected
    cost        steps and rejected steps together within a bound
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from typing import Any, ClassVar

import numpy as np
from judging import Limit, Stated, alike, not_finite, number, open_balances, throughout
from scipy.optimize import brentq

from multiphase.result import Result
from multiphase.run import make_scene, run
from multiphase.scene import Scene, parse_scene
from tumour import TumourGeometry, TumourInitial, TumourParameters
from tumour.model import MODEL
from tumour.presets import find_preset

ELASTIC, VISCOUS, PLANE = "elastic radial", "viscous radial", "two dimensions"
SHAPES = {"slab": 1, "disk": 2, "sphere": 3}
SCHEMES = {"radau": 1.0, "bdf2": 10.0}
"""And by how much the latter is allowed more."""
PAPER = dict(find_preset("paper").parameters)
SHARP = 1e-6

# -- What is known of an answer -------------------------------------------------------------------------------------------


def _limit(words: str, is_so: Any) -> Limit:
    """What must be true of a result and its scene; `is_so` may give the number in question with it."""

    def check(result: Result, scene: Scene) -> str:
        found = is_so(result, scene)
        good, value = found if isinstance(found, tuple) else (found, "")
        return "" if good else f"not so: {words}" + (f" ({value:.6g})" if value != "" else "")

    return Limit(words, check)


def _size(result: Result) -> Any:
    return result["radius"] if "radius" in result else result["area"]


def _rises(result: Result, scene: Scene) -> bool:
    size = _size(result)
    is_elastic_slab = scene.geometry.m == 1 and not scene.geometry.eulerian
    fall = 0.05 if is_elastic_slab else 10.0 * scene.solver.rtol
    return bool(np.all(np.maximum.accumulate(size) - size <= fall * size) and size[-1] > size[0] * (1.0 + 1e-4))


GROWS = _limit("R rises", _rises)
GOES_ON = _limit("grows to the end", lambda result, _: (result["growth_rate"][-1] > 0.0, result["growth_rate"][-1]))
COMES_TO_REST = _limit(
    "comes to rest: R' below 1e-5 R",
    lambda result, _: (abs(result["growth_rate"][-1]) < 1e-5 * result["radius"][-1], result["growth_rate"][-1]),
)
STAYS = _limit("R stays: no cells push", lambda result, _: bool(np.abs(result["radius"] - result["radius"][0]).max() < 1e-6))
RESTS = _limit(
    "R returns to 1, to ten rtol", lambda result, _: (abs(result["radius"][-1] - 1.0) < 1e-3, result["radius"][-1])
)  # cells that lose contact exert no force
FALLS_BACK = _limit(
    "swollen at first, falls back",
    lambda result, _: bool(result["radius"][1] > result["radius"][2] > 1.0 > 1e3 * result["growth_rate"][-1]),
)
DIES = _limit("2 % of the cells are left", lambda result, _: bool(result["cell_mass"][-1] < 0.02 * result["cell_mass"][0]))
NONE_LEFT = _limit("fewer than 1e-6 of the cells are left", lambda result, _: bool(result["cell_mass"][-1] < 1e-6 * result["cell_mass"][0]))
STARVES = _limit("a tenth of the cells dies", lambda result, _: bool(result["cell_mass"][-1] < 0.9 * result["cell_mass"][0]))
VANISHES = _limit(
    "shrinks to nothing, packed",  # attraction holds their fraction where births and deaths have it
    lambda result, _: bool(result["cell_mass"][-1] < 1e-6 * result["cell_mass"][0] and result["alpha"][-1].min() > 0.7),
)
FULL_OXYGEN = throughout("C = C_out", "C", 1.0, 1e-12)
ROUND = _limit("stays round: asymmetry below 0.02", lambda result, _: (result["asymmetry"].max() < 0.02, result["asymmetry"].max()))
UNEVEN = _limit("is not round: asymmetry above 0.001", lambda result, _: bool(result["asymmetry"].min() > 1e-3))
BUCKLES = _limit("buckles: asymmetry above 0.05", lambda result, _: (result["asymmetry"][-1] > 0.05, result["asymmetry"][-1]))
NECROTIC = _limit("a twentieth is necrotic", lambda result, _: bool(result["necrotic_fraction"][-1] > 0.05))
JUMPED = _limit("cells pass the jump", lambda result, scene: bool(result["alpha"][-1].min() < scene.parameters.alpha_min - 0.02))
THINNER = _limit("alpha falls below 0.76", lambda result, _: (result["alpha"].min() < 0.76, result["alpha"].min()))
HOLLOW = _limit(
    "alpha below 0.08 at the centre, rim below 15",
    lambda result, _: bool(result["alpha"][-1, 0] < 0.08 and result["rim_width"][-1] < 15.0),
)
DEAD_CORE = _limit(
    "no cells inside, nothing fast there, no pressure that the rim does not have",
    lambda result, _: bool(
        result["alpha"][-1, 0] < 1e-12
        and np.abs(result["u"][-1]).max() < 0.2
        and np.abs(result["p"][-1]).max() < 0.3
        and result["rim_width"][-1] < 15.0
    ),
)
FULL = _limit(
    "alpha is that of births and deaths, 10/11, to 2e-3", lambda result, _: bool(abs(result["alpha"][-1].max() - 10.0 / 11.0) < 2e-3)
)
PUSHES_LATE = _limit("the rim is where contact begins", lambda result, _: bool(0.89 < result["alpha"][-1, -1] < 0.91))


def _follows_contact(result: Result, scene: Scene) -> tuple[bool, float]:
    p, alpha, J = scene.parameters, result["alpha"][-1, -1], result["J"][-1, -1]
    push = alpha * p.gamma * (alpha - p.alpha_star) / (1.0 - alpha) ** 2
    off = p.lambda_alpha * J * (J - 1.0) / push - 1.0
    return abs(off) < 0.05, off


INCOMPRESSIBLE = _limit("lambda J (J - 1) = alpha Sigma at the surface, to 5 %", _follows_contact)


def as_changed(words: str, within: float, **changes: Any) -> Limit:
    """As the same scene with other parameters."""
    return alike(words, lambda scene: scene.with_changes(parameters=changes), within, ("radius", "cell_mass"))


def as_radial(within: float) -> Limit:
    """As the same body solved along its radius, which keeps it round."""
    return alike("as radial", _along_the_radius, within, ("area", "cell_mass"))


def _along_the_radius(scene: Scene) -> Scene:
    return scene.with_changes(
        geometry={"dimension": "radial"},
        solver={"method": "auto", "cells": 200, "time_scheme": "auto", "dt": None, "rtol": 1e-5, "max_steps": 100_000},
    )


def slower(words: str, **changes: Any) -> Limit:
    """Smaller at the end than the same scene with other parameters."""

    def is_so(result: Result, scene: Scene) -> bool:
        other = run(scene.with_changes(parameters=changes))
        return bool(result["radius"][-1] < other["radius"][-1])

    return _limit(words, is_so)


def free_swelling(m: int, p: float) -> float:
    """Radius of a body of lambda = 0, mu = 1 and radius 1 without contact, that p_out inflates: l - 1/l = p l^(m-1)."""
    return float(brentq(lambda l: p * l**m - l**2 + 1.0, 1.0, 2.0))


# -- Cases ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case(Stated):
    """A scene and what it must do.

    Attributes
    ----------
    title : str
    kind : str
        `ELASTIC`, `VISCOUS` or `PLANE`.
    geometry, parameters, initial, solver : mapping
        As of the scene; `parameters` come on top of those of the preset "paper", but for viscous cells.
    end : float
    save_at : tuple of float
        Eleven times unless given.
    shortage : float
        In two dimensions, how far C may fall below 0.
    """

    title: str
    kind: str
    geometry: Mapping[str, Any]
    parameters: Mapping[str, Any]
    end: float
    initial: Mapping[str, Any] = field(default_factory=dict)
    solver: Mapping[str, Any] = field(default_factory=dict)
    save_at: tuple[float, ...] = ()
    shortage: float = 1e-3

    defects: ClassVar[tuple[str, ...]] = ("defect_cells", "defect_volume")

    @property
    def shape(self) -> str:
        return str(self.geometry.get("kind", "disk"))

    @property
    def scheme(self) -> str:
        return str(self.solver.get("time_scheme", ""))

    @property
    def name(self) -> str:
        return ", ".join(word for word in (self.title, self.shape.replace("_", " "), self.scheme) if word)

    def load(self) -> Scene:
        preset = {} if self.kind == VISCOUS else PAPER
        return make_scene(
            MODEL,
            TumourParameters(**{**preset, **self.parameters}),
            initial=TumourInitial(**self.initial),
            geometry=TumourGeometry(**self.geometry),
            t_end=self.end,
            save_at=self.save_at or None,
            save_every=None if self.save_at else self.end / 10.0,
            solver={"max_steps": self.most, **self.solver},
        )

    def wrong_rows(self, result: Result, scene: Scene) -> list[str]:
        """Which of the invariants do not hold in what is stored."""
        wrong = not_finite(result, but=("doubling_time",))
        alpha, C, rtol = result["alpha"], result["C"], scene.solver.rtol
        has_least = alpha.min() >= 0.0 if self.kind == VISCOUS else alpha.min() > 0.0
        if not (has_least and alpha.max() < 1.0):
            wrong.append(f"alpha from {alpha.min():.3g} to 1 + {alpha.max() - 1.0:.3g}")
        if "J" in result and not result["J"].min() > 0.0:
            wrong.append(f"J falls to {result['J'].min():.3g}")
        C_out = scene.parameters.C_out
        least = -self.shortage if self.kind == PLANE else _least_oxygen(result, scene) - 1e-2 * rtol
        if not np.all(result["C_min"] >= least) or not C.min() >= np.min(least):
            wrong.append(f"C falls to {C.min():.3g}")
        if not C.max() <= C_out + 1e-2 * rtol:
            wrong.append(f"C rises to {C.max():.6g}")
        if self.kind == PLANE:
            return wrong + open_balances(self, result, 0.1 * rtol)
        return wrong + open_balances(self, result) + _wrong_sums(result, scene)

    def time_error(self, result: Result, scene: Scene) -> float:
        """The largest error in time, in units of what is allowed."""
        plane = self.kind == PLANE
        changes = {"rtol": SHARP, "max_steps": 100_000} | ({} if plane else {"time_scheme": "radau"})
        exact = _sharp(scene.with_changes(solver=changes).to_toml())
        m, allowed = scene.geometry.m, 10.0 * (self.accuracy or scene.solver.rtol)
        size = {1: "thickness", 2: "area", 3: "volume"}[m]
        powers = {"radius": 1, size: m, "cell_mass": m}
        errors = [
            float(np.abs(result[name] - exact[name]).max()) / (power * np.abs(exact[name]).max())
            for name, power in powers.items()
            if name in result
        ]
        errors.append(float(np.mean(np.abs(result["alpha"] - exact["alpha"]), axis=1).max()))
        return max(errors) / allowed


@lru_cache(maxsize=4)
def _sharp(scene: str) -> Result:
    return run(parse_scene(scene, name="tumour"))


def _least_oxygen(result: Result, scene: Scene) -> Any:
    """C_out (1 - Q R^2/(2 m)), or 0."""
    p = scene.parameters
    return p.C_out * np.maximum(0.0, 1.0 - p.Q * result["radius"] ** 2 / (2.0 * scene.geometry.m))


def _wrong_sums(result: Result, scene: Scene) -> list[str]:
    """The size of the body from its radius, and cells from alpha on the scene's grid."""
    geometry, cells = scene.geometry, result["alpha"].shape[1]
    m, shares = geometry.m, np.diff(np.linspace(0.0, 1.0, cells + 1) ** geometry.m)
    size = result[{1: "thickness", 2: "area", 3: "volume"}[m]]
    volumes = geometry.size(geometry.radius) * result["J"] if "J" in result else size[:, None]
    sums = {
        "size": (geometry.size(result["radius"]), size),
        "cells": (np.sum(result["alpha"] * volumes * shares, axis=1), result["cell_mass"]),
    }
    if "J" in result:
        sums["volume"] = (np.sum(volumes * shares, axis=1), size)
    off = {name: float(np.abs(one - other).max() / np.abs(other).max()) for name, (one, other) in sums.items()}
    return [f"the sum of {name} is off by {worst:.1e}" for name, worst in off.items() if not worst <= 1e-12]


def radial(
    kind: str, title: str, parameters: Mapping[str, Any], *limits: Limit, end: float = 60.0, cells: int = 0, alpha: Any = 0.8,
    radius: float = 1.0, shapes: Sequence[str] = tuple(SHAPES), only: Mapping[str, Sequence[Limit]] | None = None,
    disk_warns: tuple[str, ...] = (), ball_warns: tuple[str, ...] = (), loose: Mapping[tuple[str, str], float] | None = None, **stated: Any,
) -> Iterator[Case]:  # fmt: skip
    """A body in several shapes and with both schemes.

    Parameters
    ----------
    only : mapping
        Further limits by shape.
    disk_warns, ball_warns : tuple of str
        Further warnings of elastic disks and balls, whose stability is watched.
    loose : mapping of (shape, scheme) to float
        Where the error in time may be so many times that of others.
    """
    formulation = "eulerian" if kind == VISCOUS else "lagrangian"
    warns, accuracy = stated.pop("warns", ()), stated.pop("accuracy", 1e-4)
    for shape, scheme in product(shapes, SCHEMES):
        yield Case(
            title,
            kind,
            {"kind": shape, "radius": radius, "formulation": formulation},
            parameters,
            end,
            initial={"alpha": alpha},
            solver={"time_scheme": scheme, "cells": cells or (50 if kind == VISCOUS else 100)},
            limits=(*limits, *(only or {}).get(shape, ())),
            warns=(*warns, *{"disk": disk_warns, "sphere": ball_warns}.get(shape, ())),
            accuracy=accuracy * SCHEMES[scheme] * (loose or {}).get((shape, scheme), 1.0),
            **{"most": 500 if kind == VISCOUS else 400} | stated,
        )


JUMPS, PART = ("the contact stress jumps by",), ("cells attract between alpha =",)
SOFT, UNSTABLE = ("the stiffness of the disk against changes of shape",), ("the disk has lost its stability",)
SOFT_BALL, UNSTABLE_BALL = ("the stiffness of the ball against spherical harmonics",), ("the ball has lost its stability",)
FREE_FLUID = as_changed("as kappa = 0, to 2e-3", 2e-3, kappa=0.0)


def elastic(title: str, parameters: Mapping[str, Any], *limits: Limit, **stated: Any) -> Iterator[Case]:
    return radial(ELASTIC, title, parameters, *limits, **stated)


def viscous(title: str, parameters: Mapping[str, Any], *limits: Limit, **stated: Any) -> Iterator[Case]:
    return radial(VISCOUS, title, parameters, *limits, **stated)


def plane(
    title: str, parameters: Mapping[str, Any], end: float, *limits: Limit, shape: str = "quarter_disk", cells: int = 6, alpha: Any = 0.8,
    dt: float | None = None, is_round: bool = True, radial: float = 0.02, **stated: Any,
) -> Case:  # fmt: skip
    """A body on triangles, a quarter disk of six rings unless said otherwise; one that `is_round` stays so, and is as the radial one but
    for the share `radial`, the error of some six rings."""
    geometry = {"kind": shape} | ({"dimension": "2d"} if shape in ("disk", "quarter_disk") else {})
    known: tuple[Limit, ...] = ()
    if is_round and stated.get("must", "finishes") == "finishes":
        known = (ROUND, as_radial(radial)) if np.isfinite(radial) else (ROUND,)
    solver = {"cells": cells} | ({"dt": dt} if dt else {})
    stated = {"accuracy": np.inf if dt else 1e-3, "most": 400} | stated
    return Case(title, PLANE, geometry, parameters, end, initial={"alpha": alpha}, solver=solver, limits=(*limits, *known), **stated)


def refused(title: str, kind: str, shape: str, path: str, *words: str, alpha: Any = 0.8, **parameters: Any) -> Case:
    """What is refused before any work starts."""
    geometry = {"kind": shape} | ({"formulation": "eulerian"} if kind == VISCOUS else {"dimension": "2d"} if kind == PLANE else {})
    return Case(title, kind, geometry, parameters, 10.0, initial={"alpha": alpha}, must="refuses", path=path, words=words)


UNEVEN_CELLS = "0.8 + 0.05*x - 0.04*y*x + 0.03*sin(3*theta)*xi**3"

CASES = (
    # -- elastic, radial
    *elastic("paper", {}, GROWS, only={"disk": [number("R = 5.0635 on fine grids", "radius", 5.063531, 1e-2)]}, disk_warns=SOFT),
    # kappa = 0 makes the positions algebraic; what projecting them removed once stayed in the error and stopped the integrator
    *elastic("free fluid", {"kappa": 0.0}, GROWS, disk_warns=SOFT),
    *elastic("weak drag", {"kappa": 1e-4}, GROWS, FREE_FLUID, disk_warns=SOFT),
    *elastic(
        "strong drag",
        {"kappa": 1e4},
        GROWS,
        slower("slower than with kappa = 1", kappa=1.0),
        disk_warns=SOFT + UNSTABLE,
        ball_warns=SOFT_BALL + UNSTABLE_BALL,
    ),
    *elastic("weak drag, darcy", {"kappa": 1e-4, "mobility": "darcy"}, GROWS, FREE_FLUID, disk_warns=SOFT),
    *elastic(
        "strong drag, darcy",
        {"kappa": 1e4, "mobility": "darcy"},
        GROWS,
        slower("slower than as printed", mobility="printed"),
        disk_warns=SOFT + UNSTABLE,
        ball_warns=SOFT_BALL + UNSTABLE_BALL,
    ),
    *elastic("nearly incompressible", {"lambda_alpha": 1e4}, GROWS, FULL, INCOMPRESSIBLE),
    *elastic("soft", {"mu_alpha": 1e-3, "lambda_alpha": 1.0}, GROWS),
    *elastic(
        "soft, and no second modulus",
        {"mu_alpha": 1e-3},
        GROWS,
        disk_warns=UNSTABLE,
        ball_warns=UNSTABLE_BALL,
        loose={("slab", "radau"): 2.0, ("disk", "radau"): 2.0},
    ),
    *elastic("no uptake", {"Q": 0.0}, GROWS, FULL_OXYGEN),
    *elastic("uptake saturates", {"Q1_hat": 5.0}, GROWS),
    *elastic("hungry", {"Q": 10.0}, GROWS, NECROTIC, disk_warns=UNSTABLE, ball_warns=SOFT_BALL + UNSTABLE_BALL),
    *elastic("dense at first", {}, GROWS, alpha=0.95, disk_warns=SOFT),
    *elastic("tiny", {}, GROWS, radius=0.01),
    *elastic("huge", {}, GROWS, NECROTIC, HOLLOW, radius=50.0),
    *elastic("contact from below", {"alpha_min": 0.5}, GROWS, warns=JUMPS),
    *elastic("contact from below, smooth", {"alpha_min": 0.5, "sigma_width": 0.02}, GROWS, warns=JUMPS),
    *elastic("contact late, smooth", {"alpha_min": 0.9, "sigma_width": 0.02}, GROWS, PUSHES_LATE),
    *elastic("a thousand", {"lambda_alpha": 1.0}, GROWS, COMES_TO_REST, end=1000.0),
    *elastic("loose at first", {}, GROWS, alpha=0.3),
    *elastic("contact from the rim inwards", {}, GROWS, alpha="0.5 + 0.4*xi**2", disk_warns=SOFT),
    *elastic("loose, weak drag", {"kappa": 1e-4}, GROWS, FREE_FLUID, alpha=0.3),
    *elastic("inflated", {"p_out": 1.0, "lambda_alpha": 1.0}, GROWS),
    *(
        case
        for shape, m in SHAPES.items()
        for case in elastic(
            "inflated at once",
            {"p_out": 0.2, "kappa": 0.0, "Q": 0.0},
            number("l - 1/l = p_out l^(m-1) at t = 0", "radius", free_swelling(m, 0.2), 1e-9, row=0),
            GROWS,
            shapes=(shape,),
            end=20.0,
        )
    ),
    *elastic("starved", {"C_out": 0.04}, FALLS_BACK, RESTS, DIES, alpha=0.95, cells=60, save_at=(0.0, 0.1, 0.5, 1.0, 60.0)),
    *elastic(
        "attraction lost to hunger",
        {"alpha_min": 0.75, "Q": 3.0},
        GROWS,
        JUMPED,
        warns=JUMPS,
        cells=50,
        most=3000,
        loose={("slab", "radau"): 3.0},  # which cell snaps next is for errors to say
    ),
    *elastic("attraction lost to death", {"alpha_min": 0.5, "C_out": 0.04}, RESTS, JUMPED, warns=JUMPS, cells=50, most=3000),
    *elastic(
        "attraction lost to death, smooth",
        {"alpha_min": 0.6, "C_out": 0.04, "sigma_width": 0.02},
        RESTS,
        JUMPED,
        warns=JUMPS,
        cells=50,
        most=4000,
    ),
    *elastic("no ceiling", {"p_out": 1.0}, GROWS, shapes=("slab",), cells=20),
    *elastic("no ceiling", {"p_out": 1.0}, GROWS, shapes=("disk",), cells=20, disk_warns=SOFT),
    *elastic(
        "no ceiling",
        {"p_out": 1.0},
        shapes=("sphere",),
        cells=20,
        must="fails",
        until=0.2,
        words=("no step from t =", "cells are swollen more than 1e9-fold", "raise lambda_alpha, or lower p_out"),
        ball_warns=UNSTABLE_BALL,
    ),
    *elastic(
        "no equilibrium at once",
        {"p_out": 1.5, "kappa": 0.0},
        shapes=("disk", "sphere"),
        must="fails",
        until=0.0,
        words=("no equilibrium was found at t = 0", "Take a small kappa"),
    ),
    refused("lambda below 0", ELASTIC, "disk", "parameters.lambda_alpha", "swell without end", lambda_alpha=-0.1),
    refused("lambda below 0", ELASTIC, "sphere", "parameters.lambda_alpha", "swell without end", lambda_alpha=-0.1),
    refused("lambda = -mu", ELASTIC, "slab", "parameters.lambda_alpha", "convexity", lambda_alpha=-1.0),
    refused("contact late", ELASTIC, "disk", "parameters.alpha_min", "no solution passes", "sigma_width = 0.02", alpha_min=0.9),
    # -- viscous, radial
    *viscous("cells attract, sharp", {"alpha_min": 0.5}, GROWS, GOES_ON, warns=JUMPS, loose={("slab", "bdf2"): 2.0}),
    *viscous("cells attract, sharp, from 0.6", {"alpha_min": 0.6}, GROWS, GOES_ON, warns=JUMPS),
    *viscous("cells attract, smooth", {"alpha_min": 0.5, "sigma_width": 0.02}, GROWS, GOES_ON, warns=JUMPS, loose={("slab", "bdf2"): 2.0}),
    *viscous("cells attract, smooth, from 0.6", {"alpha_min": 0.6, "sigma_width": 0.02}, GROWS, GOES_ON, warns=JUMPS),
    *viscous("kappa 1e-4", {"kappa": 1e-4}, GROWS, GOES_ON, FREE_FLUID),
    *viscous("kappa 1e4", {"kappa": 1e4}, GROWS, GOES_ON, slower("slower than with kappa = 1", kappa=1.0)),
    *viscous("lambda below 0", {"lambda_alpha": -0.6}, GROWS, GOES_ON),
    *viscous("lambda 1e4", {"lambda_alpha": 1e4}, GROWS, GOES_ON, FULL),
    *viscous("mu 1e-3", {"mu_alpha": 1e-3}, GROWS, GOES_ON),
    *viscous("no uptake", {"Q": 0.0}, GROWS, GOES_ON, FULL_OXYGEN),
    *viscous("uptake saturates", {"Q1_hat": 5.0}, GROWS, GOES_ON),
    *viscous("all die", {"C_out": 0.04}, DIES, RESTS),
    *viscous("all die, attracting", {"C_out": 0.04, "alpha_min": 0.5}, VANISHES, warns=JUMPS),
    # BDF overshoots when it takes large steps over cells that die away: the deaths beyond the last cell are undone
    *viscous("the last cell dies", {"C_out": 0.0}, NONE_LEFT, RESTS, end=1000.0, cells=20),
    *viscous("crowded", {}, GROWS, GOES_ON, alpha=0.95),
    *viscous("tiny", {}, GROWS, GOES_ON, radius=0.01),
    *viscous("large", {}, GROWS, GOES_ON, radius=50.0),
    *viscous("long", {}, GROWS, GOES_ON, DEAD_CORE, end=1000.0),
    *viscous("long, constant mobility", {"mobility": "constant"}, GROWS, GOES_ON, DEAD_CORE, end=1000.0),
    *viscous("pressure outside", {"p_out": 0.1}, GROWS, GOES_ON),
    *viscous("suction outside", {"p_out": -1.0}, GROWS, GOES_ON, slower("slower than with p_out = 0", p_out=0.0)),
    *viscous("stiff contact", {"gamma": 100.0}, GROWS, GOES_ON),
    *viscous(
        "torn at the surface",
        {"p_out": 1.0},
        must="fails",
        until=5.0,
        words=("no step from t =", "no cells are left at the surface to bear p_out", "raise mu_alpha"),
    ),
    *(
        refused("lambda = -2 mu/m", VISCOUS, shape, "parameters.lambda_alpha", "the viscosity of uniform growth", lambda_alpha=-2.0 / m)
        for shape, m in SHAPES.items()
    ),
    # -- two dimensions
    plane("no uptake", {"Q": 0.0, "lambda_alpha": 1.0}, 20.0, GROWS, FULL_OXYGEN),
    plane("free fluid", {"kappa": 0.0}, 40.0, GROWS),
    plane("free fluid, no uptake", {"kappa": 0.0, "Q": 0.0, "lambda_alpha": 0.3}, 20.0, GROWS, FULL_OXYGEN),
    plane(
        "necrosis, cells attract",
        {"alpha_min": 0.6, "Q": 2.0, "lambda_alpha": 0.3},
        50.0,
        GROWS,
        NECROTIC,
        THINNER,
        radial=0.04,
        warns=JUMPS + PART,
    ),
    plane(
        "necrosis, smooth switch",
        {"alpha_min": 0.75, "sigma_width": 0.1, "Q": 2.0, "lambda_alpha": 0.3},
        50.0,
        GROWS,
        NECROTIC,
        THINNER,
        radial=np.inf,  # tissue parts into dense and empty places, which along a radius it cannot
        warns=JUMPS + PART,
    ),
    plane("contact from a higher fraction", {"alpha_min": 0.82, "sigma_width": 0.05, "lambda_alpha": 0.3}, 40.0, GROWS, warns=PART),
    plane("uptake saturates", {"Q1_hat": 5.0, "Q": 2.0, "lambda_alpha": 0.3}, 40.0, GROWS),
    plane("pressure outside", {"p_out": 0.2, "lambda_alpha": 1.0}, 20.0, GROWS),
    plane("suction outside", {"p_out": -0.2, "lambda_alpha": 1.0}, 20.0, GROWS),
    plane("no contact stress", {"gamma": 0.0, "lambda_alpha": 0.3}, 10.0, STAYS),
    plane("starving", {"C_out": 0.2}, 20.0, STAYS, STARVES),
    plane("no oxygen", {"C_out": 0.0}, 5.0, STAYS, STARVES),
    plane("all die", {"C_out": 0.04}, 60.0, STAYS, DIES, radial=np.inf),
    plane("drag", {"kappa": 1e3, "mobility": "darcy"}, 20.0, GROWS, is_round=False),  # its stiff rim wrinkles soon after t = 30
    plane("drag, and a second modulus", {"kappa": 1e3, "mobility": "darcy", "lambda_alpha": 1.0}, 60.0, GROWS, cells=10, radial=0.08),
    plane("weak drag", {"kappa": 1e-4}, 40.0, GROWS),
    plane("stiff", {"lambda_alpha": 1e3}, 40.0, GROWS, FULL),
    plane("nearly incompressible", {"lambda_alpha": 1e4}, 40.0, GROWS, FULL),
    plane("stiff contact", {"gamma": 100.0}, 40.0, GROWS, radial=0.06),
    plane("loose at first", {}, 40.0, GROWS, alpha=0.3),
    plane("lambda 0.3", {"lambda_alpha": 0.3}, 100.0, GROWS, radial=0.04),
    plane("lambda 1", {"lambda_alpha": 1.0}, 100.0, GROWS),
    plane("steps of 4", {"lambda_alpha": 0.3}, 48.0, GROWS, cells=4, dt=4.0, radial=0.1),
    plane("steps of 16", {"lambda_alpha": 0.3}, 48.0, GROWS, cells=4, dt=16.0, radial=0.1),
    plane("uneven cells", {"lambda_alpha": 0.3}, 20.0, GROWS, UNEVEN, shape="disk", cells=5, alpha=UNEVEN_CELLS, is_round=False),
    plane("uneven cells", {"lambda_alpha": 0.3}, 20.0, GROWS, shape="glioma", cells=4, alpha=UNEVEN_CELLS, is_round=False, accuracy=np.inf),
    plane(
        "beyond the buckling",
        {"mobility": "darcy"},
        80.0,
        BUCKLES,
        shape="disk",
        cells=5,
        is_round=False,
        accuracy=np.inf,
        must="ends",
        reached=48.0,
        words=("no step from t =",),
        warns=("may buckle in this time",),
        may_warn=("the disk has lost its round shape",),
    ),
    plane("torn apart", {"p_out": 50.0, "kappa": 0.0}, 5.0, must="fails", until=0.0, words=("no equilibrium was found at t = 0",)),
    plane("too dense at first", {}, 5.0, alpha=0.95, must="fails", until=0.0, words=("no equilibrium was found", "nearer to alpha_star")),
    plane("no ceiling", {"p_out": 1.5}, 20.0, cells=4, must="fails", until=10.0, words=("no step from t =",)),
    plane(
        "oxygen in a thin layer",
        {"Q": 300.0},
        5.0,
        must="ends",
        accuracy=np.inf,
        shortage=1.0,
        words=("more cells make them smaller",),
        warns=("the triangles are too wide for the layer",),
    ),
    refused("cells beyond 1", PLANE, "disk", "initial.alpha", "at (", alpha="0.8 + 0.3*x"),
    refused("lambda below 0", PLANE, "disk", "parameters.lambda_alpha", "swell without end", lambda_alpha=-0.1),
)
