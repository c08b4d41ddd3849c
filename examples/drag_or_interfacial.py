"""The two forms of the momentum balance, side by side.

In the printed form the phases feel each other through drag only; a pressure acts on each phase inside the divergence, so the level
p_out at the outer wall matters. In the interfacial form the pressure acts between the phases as well, and the level drops out. Inviscid,
the necrotic fraction diffuses with n Sigma / b (interfacial) or (p_out - (1 - 2n) Sigma) / b (drag), which is negative for n < 1/2 and
p_out = 0: there short waves grow, limited by viscosity only.
"""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multiphase import Result
from plaque1d import PlaqueInitial, PlaqueParameters, simulate


def main(cells: int = 200, t_end: float = 20.0) -> dict[str, Result]:
    """Results by name of the form."""
    forms = {
        "interfacial": PlaqueParameters(momentum="interfacial"),
        "drag, p_out = 2A": PlaqueParameters(momentum="drag", p_out=0.2),
        "drag, p_out = A": PlaqueParameters(momentum="drag", p_out=0.1),
    }
    initial = PlaqueInitial(n=0.9, l=0.0, L=1.0)
    results = {name: simulate(p, initial=initial, t_end=t_end, cells=cells, progress=True) for name, p in forms.items()}
    for name, result in results.items():
        print(f"{name:18} L = {result['L'][-1]:.3f}, n from {result['n'][-1].min():.3f} to {result['n'][-1].max():.3f}")
    draw(results, "drag_or_interfacial.png")
    return results


def draw(results: dict[str, Result], path: str) -> None:
    """Profiles of the necrotic fraction at the end, and the widths by time."""
    picture = Figure(figsize=(7.0, 3.0), layout="constrained")
    FigureCanvasAgg(picture)
    left, right = picture.subplots(1, 2)
    for (name, result), style in zip(results.items(), ("-", "--", ":"), strict=True):
        assert result.x is not None
        left.plot(result.x[-1], result["n"][-1], style, color="black", label=name)
        right.plot(result.t, result["L"], style, color="black")
    left.set(xlabel="position x", ylabel="necrotic fraction n", title=f"at t = {next(iter(results.values())).t[-1]:g}")
    left.legend(frameon=False)
    right.set(xlabel="time t", ylabel="width of the intima L")
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
