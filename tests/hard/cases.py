"""The hard cases of the plaque: what each must do, stated beforehand.

Every case is a scene file in this folder, or a shipped scene. `test_plaque_hard.py` checks them, `benchmarks/hard.py` prints them.

Of a case that finishes, these hold at every stored time:

    fractions   0 <= n <= 1, c = 1 - n
    modLDL      l >= 0
    growth      L never falls (L' = Psi_m l(0) >= 0)
    balances    the four defects are below 1e-11: rounding of some 1000 steps
    identity    k_m (l_total - l_total(0) - integral of Psi_l) + k_l (n_total - n_total(0)) = 0 to 1e-10 of its largest term,
                with the integral taken from the scene and not from the run
    time error  against the same cells at a far smaller rtol: L, n_total and c_total within rtol L, l_total within rtol of its
                largest value, n (root mean square) within 10 rtol. rtol bounds the error of one step in these norms; the next
                steps damp it in the totals, and not where a front of n passes
    finite      every stored value
    silence     no warning, other than one that is expected
    cost        steps and rejected steps together within a bound
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
from judging import Limit, Stated, alike, not_finite, number, open_balances, throughout

from multiphase.result import Result
from multiphase.run import run
from multiphase.scene import Scene, load_scene

HERE = Path(__file__).resolve().parent
TOTALS = ("L", "n_total", "c_total", "l_total")
LOUD = ("ill-posed for short waves here", "has become ill-posed for short waves")


def near(words: str, scene: str, within: float, names: Sequence[str] = ("L", "n_total"), sets: Sequence[str] = ()) -> Limit:
    """Scalars equal to those of another scene at the end, relative to them."""
    return alike(words, lambda _: _scene(scene, tuple(sets)), within, names)


def confined_growth(k_m: float, within: float) -> Limit:
    """Macrophages live at the endothelium only, where V = k_m (uptake): then l is level, l_total = l(0) L, and the balance of modLDL,
    d(l(0) L)/dt = Psi_l - (k_l/k_m) V with l(0) = V/Psi_m, is V^2/Psi_m + (k_l/k_m) V = Psi_l."""
    q, Psi_m = 2.0 / k_m, 0.5
    V = 0.5 * Psi_m * (np.sqrt(q * q + 4.0 / Psi_m) - q)
    return number("V^2/Psi_m + (k_l/k_m) V = Psi_l", "L_rate", float(V), within * V)


def deep_fraction(within: float) -> Limit:
    """All modLDL is consumed within the intima, so far from both ends n = k_m Psi_l / (k_l V), up to the drift of V."""

    def check(result: Result, scene: Scene) -> str:
        p = scene.parameters
        deep = p.k_m / (p.k_l * float(result["L_rate"][-1]))
        x, n = result.x[-1], result["n"][-1]
        middle = n[(x > 0.5 * x[-1]) & (x < 0.75 * x[-1])]
        worst = float(np.abs(middle / deep - 1.0).max())
        return "" if worst <= within else f"n deep inside is off k_m Psi_l/(k_l V) = {deep:.4g} by {worst:.1e}"

    return Limit("n deep inside is k_m Psi_l/(k_l V)", check)


@dataclass(frozen=True)
class Case(Stated):
    """A scene and what it must do.

    Attributes
    ----------
    scene : str
        A file of this folder without its suffix, or the name of a shipped scene.
    sets : tuple of str
        Changes of the scene, as of ``--set``.
    """

    scene: str
    sets: tuple[str, ...] = ()

    defects: ClassVar[tuple[str, ...]] = ("defect_L", "defect_n", "defect_c", "defect_l")

    @property
    def name(self) -> str:
        return " ".join((self.scene, *self.sets))

    def load(self) -> Scene:
        return _scene(self.scene, self.sets)

    def wrong_rows(self, result: Result, scene: Scene) -> list[str]:
        """Which of the invariants do not hold in what is stored."""
        p, wrong = scene.parameters, not_finite(result)
        n, l, L = result["n"], result["l"], result["L"]
        if n.min() < 0.0 or n.max() > 1.0 or np.abs(result["c"] - (1.0 - n)).max() > 1e-15:
            wrong.append(f"n from {n.min():.3g} to 1 + {n.max() - 1.0:.3g}")
        if l.min() < 0.0:
            wrong.append(f"l falls to {l.min():.3g}")
        fall = float(-np.diff(L).min(initial=0.0))
        if fall > 1e-14 * L.max():  # rounding
            wrong.append(f"L falls by {fall:.3g}")
        wrong += open_balances(self, result)
        influx = np.array([_integral(p.Psi_l, t) for t in result.t])
        terms = (p.k_m * result["l_total"], p.k_m * influx, p.k_l * result["n_total"])
        combined = terms[0] - terms[1] + terms[2]
        drift = float(np.abs(combined - combined[0]).max())
        if drift > 1e-10 * max(float(np.abs(term).max()) for term in terms):
            wrong.append(f"the identity of modLDL and the necrotic phase drifts by {drift:.1e}")
        return wrong

    def time_error(self, result: Result, scene: Scene) -> float:
        """The largest error against the same cells at a far smaller tolerance, in units of what is allowed."""
        exact = run(scene.with_changes(solver={"rtol": self.sharp, "dt": None}))
        rtol = self.accuracy or scene.solver.rtol
        scales = {name: float(np.abs(exact["l_total" if name == "l_total" else "L"]).max()) for name in TOTALS}
        errors = [float(np.abs(result[name] - exact[name]).max()) / (rtol * scales[name]) for name in TOTALS]
        shape = float(np.sqrt(np.mean((result["n"] - exact["n"]) ** 2, axis=1)).max())
        return max(*errors, shape / (10.0 * rtol))


LAYER = "viscosity moves things by the width of its layer, sqrt(nu/b)"

CASES = (
    Case("reference"),
    Case("k_m-5"),
    Case("k_m-20"),
    Case("k_m-100"),
    Case("k_m-5-long", limits=(confined_growth(5.0, 0.05),)),
    Case("k_m-20-long", limits=(confined_growth(20.0, 0.05),)),
    Case("k_m-100-long", limits=(confined_growth(100.0, 0.05),)),
    Case("n-0", limits=(near("as n = 1e-6 at first", "n-1e-6", 1e-5),)),
    Case("n-1e-6"),
    Case("n-1e-6-stays", limits=(throughout("n_total stays", "n_total", None, 1e-11),)),
    Case("n-vanishes"),
    Case(
        "no-reactions",
        limits=(
            throughout("n_total stays", "n_total", None, 1e-11),
            number("L' = sqrt(Psi_l Psi_m)", "L_rate", float(np.sqrt(0.5)), 0.01 * float(np.sqrt(0.5))),
        ),
    ),
    Case("n-0.99"),
    Case("n-1"),
    Case("L-0.01", limits=(near("as 800 cells", "L-0.01-fine", 1e-3),)),
    Case("L-0.01-fine"),
    Case("k-8"),
    Case("A-10"),
    Case("A-10-k-8"),
    Case("Psi_m-50"),
    Case("Psi_m-50-long", limits=(deep_fraction(0.01),)),
    Case("Psi_m-0", limits=(throughout("L stays", "L", 0.5, 1e-12),)),
    Case("Psi_l-0"),
    Case("mu-0.005", limits=(near(LAYER, "mu-0", 2.2e-2),)),
    Case("mu-5e-05", limits=(near(LAYER, "mu-0", 2.2e-3),)),
    Case("mu-5e-07", limits=(near(LAYER, "mu-0", 2.2e-4),)),
    Case("mu-0"),
    Case("mu_n-0"),
    Case("mu_m-0"),
    Case("mu_n-5e-4", limits=(near("as nu_n = 0, to nu_n/nu_m", "mu_n-0", 1e-3),)),
    Case("mu_m-5e-4", limits=(near("as nu_m = 0, to nu_m/nu_n", "mu_m-0", 1e-3),)),
    Case(
        "lambda-negative",
        limits=(
            near(
                "only nu = 2 mu + lambda counts",
                "reference",
                1e-8,
                sets=("parameters.mu_n=0.05", "parameters.mu_m=0.005"),
            ),
        ),
    ),
    Case("influx-jumps"),
    Case("influx-pulses", most=1500),
    Case("influx-ramp"),
    Case("influx-off-on"),
    Case("plaque-human", limits=(number("n_total grows by k_m Psi_l t/k_l", "n_total", 0.95 + 2.312, 0.02),), most=1000, sharp=1e-6),
    Case("plaque-human", sets=("solver.cells=200",), limits=(near("as 800 cells", "plaque-human", 2e-3),)),
    Case("plaque-mouse", limits=(number("n_total grows by k_m Psi_l t/k_l", "n_total", 0.95 + 2.975, 0.02),), most=1000, sharp=1e-6),
    Case("drag"),
    Case("drag-ill-posed", must="ends", words=("Newton's method",), warns=LOUD, most=4000, accuracy=np.inf),
    Case(
        "drag-inviscid-refused",
        must="refuses",
        path="parameters.momentum",
        words=("-0.333333", "p_out to A = 0.5", 'momentum = "interfacial"'),
    ),
    Case(
        "drag-inviscid-fails",
        must="fails",
        words=("p_out - (1 - 2n) Sigma is negative", "raise p_out to A = 0.5"),
        reached=0.04,
    ),
    Case("drag-inviscid"),
    Case("wall-0.4", limits=(throughout("n(0, t) is given", "n_wall", 0.4, 0.0),)),
    Case("wall-0.99", limits=(throughout("n(0, t) is given", "n_wall", 0.99, 0.0),)),
    Case("wall-0.001", limits=(throughout("n(0, t) is given", "n_wall", 0.001, 0.0),)),
    Case("noise"),
    Case("step"),
    Case("step-down"),
    Case("l-0-k-0.5", must="refuses", path="parameters.k", words=("l = 0 at x = 0", "k of 1 or more")),
    Case("k-0.5"),
    Case("b-1e-6"),
    Case("b-1e6"),
    Case("cells-3200", limits=(near("as 100 cells", "reference", 1e-3),), most=2000, sharp=1e-6),
    Case("cells-4"),
    Case("rtol-0.1", accuracy=1e-2),
    Case("rtol-1e-10", accuracy=1e-7, most=4000),
    Case("annulus-0.05"),
    Case("annulus-0.05-drag"),
    Case("annulus-1e+06", limits=(near("as the slab", "reference", 1e-5),)),
    Case("annulus-1e+06-drag", limits=(near("as the slab", "drag", 1e-5),)),
    Case("annulus-k_m-20"),
    Case("n-1-rtol-0.1"),
    Case("n-1-Psi_m-0"),
    Case("last-cell-empties"),
    Case("fixed-steps", must="ends", words=("Newton's method",), accuracy=1e-2),
)


@cache
def _scene(name: str, sets: tuple[str, ...] = ()) -> Scene:
    own = HERE / f"{name}.toml"
    return load_scene(own if own.exists() else name, sets)


def _integral(series: Callable[..., float], t: float) -> float:
    """Integral from 0 to t of a piecewise linear series, by the trapezoidal rule between its breaks: exact."""
    points = [0.0, *(b for b in series.breaks if 0.0 < b < t), t]
    return sum(0.5 * (b - a) * (float(series(a)) + float(series(b, side=-1))) for a, b in pairwise(points))
