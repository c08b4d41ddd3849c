"""A tumour from a segmented image, in tissue whose permeability is another image, free and against an elastic bed on one side.

tumour_mask.png is white where the tumour is. tumour_permeability.png shows the same frame: black lets 1/10 of the fluid through that
white does. Springs on the right side of the outer surface hold the tumour back there; it grows to the other side.
"""

from pathlib import Path

from matplotlib.figure import Figure

from multiphase import Result
from multiphase.plotting import Map, save_figure, view_of
from tumour import TumourGeometry, TumourParameters, simulate

FOLDER = Path(__file__).resolve().parent
PIXEL = 0.02  # side of a pixel, in units of length: the tumour is about 1 from its middle to its surface
BED = {"bed": {"side": "outer", "where": "x > 0.4", "spring": 5.0}}


def main(cells: int = 10, t_end: float = 20.0) -> dict[str, Result]:
    """Results by what is around the tumour."""
    body = TumourGeometry(kind="outline", file=str(FOLDER / "tumour_mask.png"), pixel=PIXEL)
    image = {"image": str(FOLDER / "tumour_permeability.png"), "pixel": PIXEL, "low": 0.1, "high": 1.0}
    results = {}
    for name, boundary in (("free", {}), ("against a bed", BED)):
        parameters = TumourParameters(lambda_alpha=1.0, permeability=image)
        results[name] = simulate(parameters, geometry=body, boundary=boundary, cells=cells, t_end=t_end, title=f"Tumour, {name}")
        result = results[name]
        print(f"{name}: {result.size()}, area {result['area'][0]:.3f} -> {result['area'][-1]:.3f}, oxygen {result['C_min'][-1]:.2f}")
    draw(results, "tumour_from_image.png")
    save_figure(results["against a bed"], "tumour_against_a_bed.png")
    return results


def draw(results: dict[str, Result], path: str) -> None:
    """The fluid's pressure on both tumours at the end, and their areas by time."""
    picture = Figure(figsize=(7.0, 5.2), layout="constrained")
    *maps, by_time = picture.subplot_mosaic([["free", "bed"], 2 * ["time"]], height_ratios=[3.0, 2.0]).values()
    for (name, result), axes, style in zip(results.items(), maps, ("-", "--"), strict=True):
        shown = Map(view_of(result), "p", axes, [-1])
        shown.show(result.positions(-1), result["p"][-1])
        shown.add_bar()
        axes.set_title(f"{name}, t = {result.t[-1]:g}")
        by_time.plot(result.t, result["area"], style, color="black", label=name)
    by_time.set(xlabel="time t", ylabel="area of the body")
    by_time.legend(frameon=False)
    picture.suptitle("Fluid pressure p, with the outlines at rest (grey) and at the end (black), and the springs (orange)", fontsize=9)
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
