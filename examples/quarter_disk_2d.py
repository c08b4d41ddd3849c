"""The paper's quarter disk in two dimensions, and how far its radius is from that of the radial solver.

It slides on its two straight sides, as in the paper. It stays round, so that the radial solver, which is exact to 1e-4 here, tells how
large the errors of the triangles are. The picture shows the body as it is at several times.
"""

from multiphase.plotting import save_figure
from tumour import TumourParameters, simulate


def main(cells: int = 20, t_end: float = 60.0) -> tuple[float, float]:
    """Radius at the end in two dimensions, and the radial one."""
    paper = TumourParameters.preset("paper")
    plane = simulate(paper, geometry={"kind": "quarter_disk", "dimension": "2d"}, cells=cells, t_end=t_end, progress=True)
    radial = simulate(paper, geometry="quarter_disk", t_end=t_end)
    print("   t   radius in 2D   radial   difference   asymmetry")
    for row in range(0, len(plane.t), 10):
        found, wanted = float(plane["radius"][row]), float(radial["radius"][row])
        print(f"{plane.t[row]:4.0f} {found:14.4f} {wanted:8.4f} {found / wanted - 1.0:12.1e} {plane['asymmetry'][row]:11.1e}")
    assert plane.mesh is not None
    print(f"{len(plane.mesh.triangles)} triangles, {plane.stats['steps']} steps, {plane.stats['wall_s']:.1f} s")
    save_figure(plane, "quarter_disk_2d.png")
    print("quarter_disk_2d.png written")
    return float(plane["radius"][-1]), float(radial["radius"][-1])


if __name__ == "__main__":
    main()
