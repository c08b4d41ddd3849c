"""Grow a tumour, print what became of it, and draw it."""

from multiphase.plotting import save_figure
from tumour import TumourParameters, simulate


def main(cells: int = 200, t_end: float = 60.0) -> float:
    """Radius at the end."""
    parameters = TumourParameters(Q=0.5, lambda_alpha=0.0)  # what is not named is the paper's
    result = simulate(parameters, geometry="disk", t_end=t_end, cells=cells, progress=True)
    print(f"radius           {result['radius'][0]:.3f} -> {result['radius'][-1]:.3f}")
    print(f"oxygen           {result['C'][-1, 0]:.3f} at the centre")
    print(f"necrotic core    radius {result['necrotic_radius'][-1]:.3f}, {result['necrotic_fraction'][-1]:.1%} of the area")
    save_figure(result, "first_tumour.png")
    print("first_tumour.png written")
    return float(result["radius"][-1])


if __name__ == "__main__":
    main()
