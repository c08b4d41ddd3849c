"""Error against wall time of bodies in two dimensions: `multiphase precision` on a mesh."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.precision import study
from multiphase.scene import load_scene


def test_a_study_of_a_glioma() -> None:
    """Only the method that has such bodies; errors against a finer mesh, interpolated to it, fall with the triangles' size."""
    scene = load_scene("tumour-glioma-stiff", ["time.end=4.0"])
    found = study(scene, cells=(4, 8), rtols=(1e-4,), repeats=1, reference=(16, 1e-5), budget=60.0)
    coarse, fine = found.measurements
    assert (coarse.method, fine.method) == ("mini", "mini")
    assert (coarse.status, fine.status) == ("completed", "completed")
    assert set(coarse.errors) == {"alpha", "area"}  # of the scalars radius and area a glioma has one
    for name in ("alpha", "area"):  # order 1 or more, over one doubling: half; rtol adds less than 1e-4
        assert fine.errors[name] < 0.5 * coarse.errors[name] + 1e-4
    assert found.orders[0].value == pytest.approx(np.log2(coarse.error / fine.error), rel=1e-6)


def test_which_methods_a_study_takes() -> None:
    assert {
        row.method for row in study(load_scene("tumour-sphere", ["time.end=1.0"]), cells=(8,), rtols=(1e-3,), repeats=1).measurements
    } == {"lines"}
