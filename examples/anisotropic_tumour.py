"""Disks whose cells push twice as much along fibres as across them: fibres of one direction, and fibres around the middle.

Fibres of one direction make the disk longer along them, at first as the theory of small growth says (dotted; it leaves out how the fluid
starts to flow, up to t = 0.2). Those around the middle keep it round, but press its surface together, which wrinkles after t = 7.
"""

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from multiphase import Result
from multiphase.plotting import Map, view_of
from tumour import TumourParameters, simulate
from tumour.equations import net_growth
from tumour.exact_fibres import FibreGrowth

CASES = {"no fibres": (0.0, 1.0), "fibres one way": (0.5, 2.0), "fibres around": ("theta + pi/2", 2.0)}  # their angle, and fibre_ratio
LINES = (("black", "-"), ("#d55e00", "-"), ("#0072b2", "--"))


def elongation(result: Result) -> np.ndarray:
    """Length of the body along fibres of one direction over that across, by time."""
    c, s = np.cos(0.5), np.sin(0.5)
    return np.divide(*np.ptp([result.positions(row) @ [[c, -s], [s, c]] for row in range(len(result.t))], axis=1).T)


def small_growth(t: np.ndarray) -> np.ndarray:
    """The elongation by time in theory, which knows no kinetics but the rate at which cells are gained at first."""
    p = TumourParameters(lambda_alpha=1.0, fibre_ratio=2.0)
    gain = float(net_growth(p.alpha_star, p.C_out, *p.kinetics)) / (p.alpha_star * (1.0 - p.alpha_star))
    theory = FibreGrowth(replace(p, s1=0.0, s2=0.0, s3=0.0, Q=0.0, C_out=gain))
    return 1.0 + theory.displacement(1.0, 0.0, t)[0] - theory.displacement(0.0, 1.0, t)[1]


def main(cells: int = 20, t_end: float = 6.0) -> dict[str, Result]:
    """Results by case."""
    results, picture = {}, Figure(figsize=(8.0, 4.8), layout="constrained")
    *maps, outlines, by_time = picture.subplot_mosaic([["a", "b", "outlines"], 3 * ["time"]]).values()
    for (name, (angle, ratio)), (colour, line) in zip(CASES.items(), LINES, strict=True):
        parameters = TumourParameters(lambda_alpha=1.0, fibre_angle=angle, fibre_ratio=ratio)
        result = results[name] = simulate(parameters, geometry={"kind": "disk", "dimension": "2d"}, cells=cells, t_end=t_end)
        print(f"{name:15s} area {result['area'][-1]:.3f}, {elongation(result)[-1]:.3f} times as long as wide")
        outlines.plot(*result.positions(-1)[view_of(result).body.outline].T, line, color=colour)
        by_time.plot(result.t, elongation(result), line, color=colour, label=name)
    for name, axes in zip(list(CASES)[1:], maps, strict=True):
        shown = Map(view_of(results[name]), "alpha", axes, [-1])
        shown.show(results[name].positions(-1), results[name]["alpha"][-1])
        shown.add_bar()
        axes.set_title(name)
    by_time.plot([0.0, t_end], small_growth(np.array([0.0, t_end])), ":", color="#d55e00", label="fibres one way, theory of small growth")
    by_time.set(xlabel="time t", ylabel="length along over across")
    by_time.legend(frameon=False)
    outlines.set(aspect="equal", xlabel="x", title=f"outlines at t = {t_end:g}")
    picture.savefig("anisotropic_tumour.png", dpi=200)
    return results


if __name__ == "__main__":
    main()
