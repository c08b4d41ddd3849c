"""The shipped gliomas on coarse meshes: what the comments of their scenes say, and the loss of stability without lambda_alpha."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from multiphase import Result, SolverError, load
from multiphase.run import run
from multiphase.scene import load_scene
from tumour.meshes import glioma_outline


@cache
def stiff(cells: int) -> Result:
    return run(load_scene("tumour-glioma-stiff", [f"solver.cells={cells}", "time.save_every=10.0"]))


def reentrant(radius: float) -> np.ndarray:
    """Points of the outline where it is concave, with the strongest curvature of each stretch in them."""
    points = glioma_outline(radius, 2000)
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    a, b = points - before, after - points
    return points[a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0]


def test_the_stiff_glioma_is_as_the_paper_reports() -> None:
    result = stiff(8)
    assert result.status == "completed"
    assert result.t[-1] == 100.0
    assert np.all(np.abs(result["alpha"][-1] - 0.9) < 0.01)  # "near 0.9"
    assert result["C_min"].min() > 0.8
    assert result["necrotic_fraction"].max() == 0.0


def test_its_stress_is_highest_at_the_reentrant_parts() -> None:
    result = stiff(8)
    assert result.mesh is not None
    stress = result["stress_magnitude"][-1]
    at = result.mesh.points[int(np.argmax(stress))]
    h = 0.39 / 8.0
    assert np.min(np.hypot(*(reentrant(0.39) - at).T)) < 0.25 * h  # on a concave stretch, not only near one
    assert stress.max() > 5.0 * np.median(stress)


def test_its_numbers_converge() -> None:
    """Area and cells on 4, 8 and 16 triangles to the inscribed radius: differences fall at least threefold (order 1.6; 4 is
    order 2, and meshes of one outline are not refinements of each other)."""
    for name in ("area", "cell_mass"):
        a, b, c = (float(stiff(cells)[name][-1]) for cells in (4, 8, 16))
        assert abs(c - b) < abs(b - a) / 3.0, name
    least = [float(stiff(cells)["C_min"][-1]) for cells in (4, 8, 16)]
    assert max(least) - min(least) < 5e-4  # of the points of each mesh, which miss the place of the least oxygen by up to half a side


def test_without_lambda_it_ends_where_it_loses_its_stability(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    with pytest.raises(SolverError, match="has lost its stability") as caught:
        run(load_scene("tumour-glioma", ["solver.cells=6"]), file=file)
    stored = load(file)
    assert stored.status == "failed"
    assert "lost its stability" in stored.message
    assert 40.0 < caught.value.time < 80.0
    assert caught.value.time - 2.0 <= stored.t[-1] <= caught.value.time  # every row up to there, two apart
