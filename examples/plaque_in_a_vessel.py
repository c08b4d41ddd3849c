"""The same plaque in a flat wall and in vessels of lumen radius 20, 5 and 1.

What comes in through the endothelium spreads over more and more area outwards, so a plaque in a narrow vessel grows more slowly. The lumen
keeps its radius; the outer wall moves.
"""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multiphase import Result
from multiphase.plotting import Ring, radius_axis, view_of
from plaque1d import PlaqueGeometry, simulate

RADII = (None, 20.0, 5.0, 1.0)  # None: the slab


def main(cells: int = 200, t_end: float = 40.0) -> dict[float | None, Result]:
    """Results by radius of the lumen."""
    results = {}
    for radius in RADII:
        geometry = PlaqueGeometry() if radius is None else PlaqueGeometry(kind="annulus", lumen_radius=radius)
        results[radius] = result = simulate(geometry=geometry, t_end=t_end, cells=cells, title=f"lumen radius {radius}", progress=True)
        width, necrotic, living = (float(result[name][-1]) for name in ("L", "n_total", "c_total"))
        ends = "slab                       " if radius is None else f"lumen {radius:4g}, outer wall {radius + width:6.3f}"
        print(f"{ends}  L = {width:.3f}, {necrotic / (necrotic + living):.1%} necrotic")
    draw(results, "plaque_in_a_vessel.png")
    return results


def draw(results: dict[float | None, Result], path: str) -> None:
    """Cross-sections at the end, each on a scale of its own, and the widths by time."""
    picture = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(picture)
    axes = picture.subplot_mosaic([["20", "5", "1"], ["width"] * 3])
    for (radius, result), style in zip(results.items(), ("-", "--", "-.", ":"), strict=True):
        axes["width"].plot(result.t, result["L"], style, color="black", label="slab" if radius is None else f"lumen radius {radius:g}")
        if radius is None:
            continue
        view, place = view_of(result), axes[f"{radius:g}"]
        assert view.edges is not None
        ring = Ring(view, "n", place)
        ring.show(view.edges[-1], view.values["n"][-1])
        ring.image.set_clim(0.4, 1.0)
        radius_axis(view, place)
        place.set(title=f"lumen radius {radius:g}", ylabel=view.radius_label() if radius == RADII[1] else "")
    picture.colorbar(ring.image, ax=place, label="necrotic fraction n", shrink=0.8)
    axes["width"].set(xlabel="time t", ylabel="width of the intima L")
    axes["width"].legend(frameon=False)
    picture.savefig(path, dpi=200)
    print(f"{path} written")


if __name__ == "__main__":
    main()
