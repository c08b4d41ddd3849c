"""Grow a plaque, print what became of it, and draw it."""

from multiphase.plotting import save_figure
from plaque1d import PlaqueInitial, PlaqueParameters, simulate


def main(cells: int = 200, t_end: float = 20.0) -> float:
    """Width of the intima at the end."""
    parameters = PlaqueParameters(Psi_l=1.0, Psi_m=0.2, k_l=10.0, k_m=1.0)  # what is not named is the demo's
    initial = PlaqueInitial(n=0.9, l=0.0, L=1.0)
    result = simulate(parameters, initial=initial, t_end=t_end, cells=cells, progress=True)
    print(f"width L       {result['L'][0]:.3f} -> {result['L'][-1]:.3f}")
    print(f"growth rate   {result['L_rate'][-1]:.4f}")
    print(f"necrotic      {result['n_total'][-1] / result['L'][-1]:.1%} of the intima")
    save_figure(result, "first_plaque.png")
    print("first_plaque.png written")
    return float(result["L"][-1])


if __name__ == "__main__":
    main()
