"""A further species: HDL enters through the endothelium, diffuses, and removes modified LDL.

Both are consumed at the rate k l h, so with HDL there is less modLDL to recruit macrophages and the plaque grows more slowly. The
extension is the function `hdl`: it adds one species and one FiPy term to each of two equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multiphase import Result
from plaque1d import PlaqueInitial, PlaqueParameters, simulate
from plaque1d.extensions import Extension

REMOVAL = 20.0
"""Rate constant of the removal, in the units of k_l."""


def hdl(plaque: Extension) -> Mapping[str, Any]:
    """What is added to the right-hand sides, per unit of xi (hence the factor L)."""
    fipy, l, L = plaque.fipy, plaque.l, plaque.L
    h = plaque.add_species("hdl", initial=0.0, diffusivity=2.0, influx=0.5)
    return {
        "l": -fipy.ImplicitSourceTerm(coeff=REMOVAL * L * h, var=l),
        "hdl": -fipy.ImplicitSourceTerm(coeff=REMOVAL * L * l, var=h),
    }


def main(cells: int = 50, t_end: float = 5.0) -> tuple[Result, Result]:
    """Results without and with HDL."""
    parameters, initial = PlaqueParameters(), PlaqueInitial()
    plain = simulate(parameters, initial=initial, t_end=t_end, cells=cells, progress=True)
    treated = simulate(parameters, initial=initial, t_end=t_end, cells=cells, solver="fipy", extra_terms=hdl, progress=True)
    growth = [result["L"][-1] - result["L"][0] for result in (plain, treated)]
    print(f"growth to t = {t_end:g}: {growth[0]:.3f} without HDL, {growth[1]:.3f} with it ({1 - growth[1] / growth[0]:.0%} less)")
    draw(plain, treated, "hdl_removes_modldl.png")
    return plain, treated


def draw(plain: Result, treated: Result, path: str) -> None:
    """Width by time, and the two lipoproteins at the end."""
    picture = Figure(figsize=(7.0, 3.0), layout="constrained")
    FigureCanvasAgg(picture)
    left, right = picture.subplots(1, 2)
    left.plot(plain.t, plain["L"], "-", color="black", label="without HDL")
    left.plot(treated.t, treated["L"], "--", color="black", label="with HDL")
    left.set(xlabel="time t", ylabel="width of the intima L")
    left.legend(frameon=False)
    assert plain.x is not None
    assert treated.x is not None
    right.plot(plain.x[-1], plain["l"][-1], "-", color="black", label="modLDL without HDL")
    right.plot(treated.x[-1], treated["l"][-1], "--", color="black", label="modLDL with HDL")
    right.plot(treated.x[-1], treated["hdl"][-1], "--", color="#b35806", label="HDL")
    right.set(xlabel="position x", ylabel="concentration", title=f"at t = {plain.t[-1]:g}")
    right.legend(frameon=False)
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
