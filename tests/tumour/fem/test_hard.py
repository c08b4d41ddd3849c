"""Hard cases on meshes that are no scenes of `tests/hard`: first steps, uneven cells, and meshes and outlines that are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from multiphase.errors import ParameterError
from tumour import TumourParameters, meshes, simulate


def test_the_error_control_tames_a_huge_first_step(make_mini: Any) -> None:
    """The loop begins with a hundredth of the way to the first stop: here 100, and 1e4."""
    from dataclasses import replace

    from multiphase.stepping import Control, integrate, start

    radii = []
    for dt in (0.01, 5.0, 100.0):
        scheme = make_mini(lambda_alpha=0.3)
        state = integrate(scheme, replace(start(scheme, 0.0, 20.0, Control()), dt=dt), [20.0], Control())
        radii.append(scheme.observe(20.0, state.u[0]).scalars["radius"])
    np.testing.assert_allclose(radii, radii[0], rtol=1e-3)  # ten tolerances


@pytest.mark.parametrize("shape", ["disk", "glioma"])
def test_a_body_whose_cells_are_not_spread_evenly(make_mini: Any, run_elastic: Any, shape: str) -> None:
    """An initial fraction by a formula in x, y and theta: no symmetry is left."""
    body = meshes.disk(1.0, 5) if shape == "disk" else meshes.glioma(1.0, 0.35)
    scheme = make_mini(body, alpha="0.8 + 0.05*x - 0.04*y*x + 0.03*sin(3*theta)*xi**3", lambda_alpha=0.3)
    x, y = body.mesh.p
    r, theta = np.hypot(x, y), np.arctan2(y, x)
    expected = 0.8 + 0.05 * x - 0.04 * y * x + 0.03 * np.sin(3.0 * theta) * r**3
    from tumour.fem.bodies import fraction

    np.testing.assert_allclose(fraction(scheme.initial_values, body), expected, rtol=1e-13)
    if shape == "disk":
        _, stored = run_elastic(scheme, [0.0, 2.0])
        assert min(snapshot.scalars["asymmetry"] for snapshot in stored) > 1e-3
        mirrored = np.argmin(np.abs(x[:, None] - x) + np.abs(y[:, None] + y), axis=1)
        assert np.abs(stored[1].fields["displacement"][mirrored, 0] - stored[1].fields["displacement"][:, 0]).max() > 1e-3


# -- Meshes that cannot be used -----------------------------------------------------------------------------------------


def gmsh_file(path: Path, points: np.ndarray, triangles: np.ndarray) -> Path:
    """A file of format 2.2 with triangles alone."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    lines += [f"{i + 1} {float(x)!r} {float(y)!r} 0" for i, (x, y) in enumerate(points)]
    lines += ["$EndNodes", "$Elements", str(len(triangles))]
    lines += [f"{i + 1} 2 2 1 1 {' '.join(str(k + 1) for k in t)}" for i, t in enumerate(triangles)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path


def bad_mesh(case: str) -> tuple[np.ndarray, np.ndarray]:
    body = meshes.disk(1.0, 3)
    points, triangles = body.mesh.p.T.copy(), body.mesh.t.T.copy()
    match case:
        case "sliver":
            a, b = points[triangles[0, 1]], points[triangles[0, 2]]
            points[0] = 0.5 * (a + b) - 1e-3 * (0.5 * (a + b))
        case "inverted":
            points[0] = [0.45, 0.1]
        case "disconnected":
            points, triangles = np.vstack([points, points + np.array([3.0, 0.0])]), np.vstack([triangles, triangles + len(points)])
        case "touching":
            points, triangles = np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]], dtype=float), np.array([[0, 1, 2], [0, 3, 4]])
    return points, triangles


@pytest.mark.parametrize(
    ("case", "words"), [("sliver", "angle"), ("inverted", "overlap"), ("disconnected", "not connected"), ("touching", "touch")]
)
def test_bad_meshes_are_refused_before_any_work(tmp_path: Path, case: str, words: str) -> None:
    pytest.importorskip("meshio")
    file = gmsh_file(tmp_path / "body.msh", *bad_mesh(case))
    with pytest.raises(ParameterError, match=r"geometry.file") as caught:
        simulate(t_end=1.0, geometry={"kind": "mesh", "file": str(file)}, file=tmp_path / "run.h5")
    assert words in str(caught.value)
    assert not (tmp_path / "run.h5").exists()


def test_a_good_mesh_from_a_file_is_a_body(tmp_path: Path) -> None:
    """The same as the disk that the program meshes itself, but for its exact area, which no file has."""
    pytest.importorskip("meshio")
    body = meshes.disk(1.0, 4)
    file = gmsh_file(tmp_path / "body.msh", body.mesh.p.T, body.mesh.t.T)
    settings: dict[str, Any] = {"t_end": 3.0, "save_at": [1.0], "dt": 0.5, "newton_tol": 1e-10, "linear": "superlu"}
    read = simulate(TumourParameters(), geometry={"kind": "mesh", "file": str(file)}, **settings)
    own = simulate(TumourParameters(), geometry={"kind": "disk", "dimension": "2d"}, cells=4, **settings)
    np.testing.assert_allclose(read["alpha"], own["alpha"], atol=1e-8)
    np.testing.assert_allclose(read["area"] / read["area"][0], own["area"] / own["area"][0], rtol=1e-8)


def test_outlines_that_cross_themselves_are_refused(tmp_path: Path) -> None:
    eight = tmp_path / "eight.csv"
    t = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    np.savetxt(eight, np.column_stack([np.sin(t), np.sin(2.0 * t + 0.1)]), delimiter=",", header="x,y", comments="")
    with pytest.raises(ParameterError, match="crosses") as caught:
        simulate(t_end=1.0, geometry={"kind": "outline", "file": str(eight)}, file=tmp_path / "run.h5")
    assert "geometry" in str(caught.value)
    assert not (tmp_path / "run.h5").exists()


def test_an_outline_from_a_table_grows(tmp_path: Path) -> None:
    bean = tmp_path / "bean.csv"
    t = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    radius = 1.0 + 0.25 * np.cos(2.0 * t) + 0.1 * np.sin(3.0 * t)
    np.savetxt(bean, np.column_stack([radius * np.cos(t), radius * np.sin(t)]), delimiter=",", header="x,y", comments="")
    result = simulate(
        TumourParameters(lambda_alpha=0.3), t_end=10.0, save_every=5.0, cells=4, geometry={"kind": "outline", "file": str(bean)}
    )
    assert result.status == "completed"
    assert result["area"][-1] > 1.2 * result["area"][0]
    assert max(np.abs(result["defect_cells"]).max(), np.abs(result["defect_volume"]).max()) < 1e-5
