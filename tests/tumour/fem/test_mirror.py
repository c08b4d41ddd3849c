"""Bodies that are their own mirror image: which are found, and that the part that is solved gives what all of it does."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from tumour import TumourBoundary, TumourInitial, TumourParameters, meshes, simulate
from tumour.fem import mirror
from tumour.fem.bodies import body_of
from tumour.fem.mirror import mirror_of
from tumour.geometry import TumourGeometry

DISK = {"kind": "disk", "dimension": "2d"}
ENDS = {"where": "y > 0.8", "spring": 1.0, "traction_y": 0.1}, {"where": "y < -0.8", "spring": 1.0, "traction_y": -0.1}
APART = tuple(
    {"where": where, "displacement_y": {"times": [0, 1], "values": [0, by]}} for where, by in (("y > 0.8", 0.1), ("y < -0.8", -0.1))
)
GRIP = {"where": "x > 0.8", "displacement_x": {"times": [0, 1], "values": [0, 0.1]}, "displacement_y": 0.0}
SIDES = {"where": "abs(y) > 0.6", "load": {"times": [0, 1, 1], "values": [0, 0.2, 0.1]}, "p": "closed", "C": 0.8, "membrane": 2.0}
LEFT, RIGHT = {"where": "x < -0.5", "C": "closed", "influx": 0.3}, {"where": "x > 0.5", "C": "closed", "influx": 0.3}

CASES: dict[str, tuple[str, dict[str, Any], dict[str, Any], Any]] = {  # axes, tissue, parts, alpha
    "fibres along x": ("y", {"fibre_ratio": 1.4}, {}, 0.8),
    "fibres along y, stiff ones": ("y", {"fibre_stiffness": 0.3, "fibre_angle": np.pi / 2}, {}, 0.8),
    "fibres askew": ("", {"fibre_ratio": 1.4, "fibre_angle": 0.3}, {}, 0.8),
    "an angle that nothing uses": ("y", {"fibre_angle": 0.3, "stiffness": "1 + 0.2*x"}, {}, 0.8),
    "tensors": ("y", {"permeability": {"xx": 1.0, "yy": 0.5, "xy": "0.3*x*y"}, "diffusivity": {"xx": "1 + 0.1*x", "yy": 1.0}}, {}, 0.8),
    "a tensor askew": ("", {"permeability": {"xx": 1.0, "yy": 0.5, "xy": 0.2}}, {}, 0.8),
    "uneven to one side": ("", {"consumption": "1 + 0.2*y + 0.1*x"}, {}, 0.8),
    "cells": ("y", {}, {}, "0.8 + 0.02*x + 0.01*y*y"),
    "cells to one side": ("", {}, {}, "0.8 + 0.02*y + 0.01*x"),
    "pulled at both ends": ("y", {}, {"top": ENDS[0], "low": ENDS[1]}, 0.8),
    "pulled at one end": ("", {}, {"top": ENDS[0], "low": {**ENDS[1], "traction_y": 0.0, "traction_x": 0.1}}, 0.8),
    "moved apart": ("y", {}, {"top": APART[0], "low": APART[1]}, 0.8),
    "moved together": ("", {}, {"top": APART[0], "low": {**APART[0], "where": "y < -0.8"}}, "0.8 + 0.01*x"),
    "gripped, pressed, behind a membrane": ("y", {}, {"grip": GRIP, "sides": SIDES}, 0.8),
    "gripped off the line": ("", {}, {"grip": {**GRIP, "displacement_y": 0.05}, "sides": SIDES}, 0.8),
    "fed from two sides": ("y", {"stiffness": "1 + 0.1*x"}, {"left": LEFT, "right": RIGHT}, 0.8),
}


@pytest.mark.parametrize("case", CASES)
def test_which_symmetries_are_found(case: str) -> None:
    """A disk's six sectors have no triangle across y = 0, and two across x = 0, so that at most half of it can be left out."""
    axes, tissue, parts, alpha = CASES[case]
    found = mirror_of(meshes.disk(1.0, 5), TumourBoundary.from_table(parts), TumourParameters(**tissue), TumourInitial(alpha=alpha))
    assert (found.axes if found else "") == axes


def test_a_quarter_is_found_where_the_mesh_has_one() -> None:
    """A square ring of squares, cut along both diagonals of each."""
    size = 8
    i, j = np.meshgrid(*2 * [np.arange(size)])
    hollow = ((i < 2) | (i > 5) | (j < 2) | (j > 5)).ravel()
    corner = (i + (size + 1) * j).ravel()[hollow]
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, size + 1)]), axis=2).reshape(-1, 2)
    middles = grid[corner] + 1.0 / size
    points = np.vstack([grid, middles])
    ring = np.column_stack([corner, corner + 1, corner + size + 2, corner + size + 1])
    middle = len(grid) + np.arange(len(corner))
    triangles = np.concatenate([np.column_stack([ring[:, k], ring[:, (k + 1) % 4], middle]) for k in range(4)])
    used, numbers = np.unique(triangles, return_inverse=True)
    numbers = numbers.reshape(-1, 3)
    body = meshes.body.make_body(
        points[used], numbers, surface=meshes.body.boundary_edges(numbers).ravel(), radius=0.25, path="geometry",
    )  # fmt: skip
    found = mirror_of(body, TumourBoundary(), TumourParameters(), TumourInitial())
    assert found is not None
    assert (found.axes, found.copies) == ("xy", 4)
    assert 4 * found.body.mesh.nelements == body.mesh.nelements
    assert found.body.area == pytest.approx(body.area / 4, rel=1e-14)
    inner = found.body.mesh.p.T
    np.testing.assert_allclose(inner[found.nodes] * found.signs, body.mesh.p.T, atol=1e-14)  # a displacement goes as the position does
    values = np.arange(len(inner), dtype=float)
    assert found.spread({"p": values})["p"].tolist() == values[found.nodes].tolist()


def test_bodies_without_symmetry_are_solved_whole() -> None:
    for geometry in (TumourGeometry(kind="glioma"), TumourGeometry(kind="quarter_disk", dimension="2d")):
        assert mirror_of(body_of(geometry, 5), TumourBoundary(), TumourParameters(), TumourInitial()) is None


@pytest.mark.parametrize("case", [name for name, (axes, *_) in CASES.items() if axes])
def test_half_a_body_gives_what_the_whole_does(case: str) -> None:
    """Fields and scalars at all stored times, through a jump of the load at t = 1: the same steps, so what differs is what Newton's method
    leaves, 1e-8 here, in derivatives over the size of a triangle; ten times that (J, stress: a hundred)."""
    _, tissue, parts, alpha = CASES[case]
    half, whole = (
        simulate(
            TumourParameters(lambda_alpha=1.0, **tissue), initial={"alpha": alpha}, geometry=DISK, boundary=parts or None, cells=5,
            t_end=2.0, newton_tol=1e-9, linear="superlu", save_every=0.5, reduce=reduce,
        )
        for reduce in (True, False)
    )  # fmt: skip
    plans = [json.loads(result.plan) for result in (half, whole)]
    assert [len(plan["reductions"]) for plan in plans] == [1, 0]
    assert plans[0]["unknowns"] < 0.55 * plans[1]["unknowns"]
    assert half.mesh is not None
    assert whole.mesh is not None
    assert half.mesh.equals(whole.mesh)
    for name in whole.fields:
        scale, share = np.abs(whole[name]).max(), 1e-6 if name in ("J", "stress_magnitude") else 1e-7
        assert np.abs(half[name] - whole[name]).max() < share * scale, name
    for name in ("area", "cell_mass", "radius", "growth_rate", "C_min", "hypoxic_fraction"):
        np.testing.assert_allclose(half[name], whole[name], rtol=1e-7, atol=1e-12, err_msg=name)
    assert np.abs(half["defect_cells"]).max() < 1e-8
    assert np.abs(half["defect_volume"]).max() < 1e-8


def test_a_disk_that_may_lose_its_shape_is_solved_whole() -> None:
    """Radial data in two dimensions: the plan leaves nothing out, as the user asked for them."""
    result = simulate(geometry=DISK, cells=4, t_end=0.5)
    assert json.loads(result.plan)["reductions"] == []


def test_half_a_body_goes_on_from_its_file(tmp_path: Any) -> None:
    """Bit for bit as without a stop."""
    options = {"geometry": DISK, "cells": 4, "linear": "superlu", "save_every": 0.5}
    parameters = TumourParameters(fibre_ratio=1.3, lambda_alpha=1.0)
    through = simulate(parameters, t_end=2.0, **options)
    simulate(parameters, t_end=1.0, file=tmp_path / "a.h5", **options)
    resumed = simulate(parameters, t_end=2.0, file=tmp_path / "a.h5", resume=True, **options)
    for name in through.fields:
        np.testing.assert_array_equal(resumed[name], through[name])


def test_a_wrong_sign_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """With images that keep the sign of the displacement the two answers differ by far."""
    spread = mirror.Mirror.spread
    monkeypatch.setattr(
        mirror.Mirror, "spread", lambda self, fields: spread(self, fields) | {"displacement": fields["displacement"][self.nodes]}
    )
    half, whole = (
        simulate(TumourParameters(fibre_ratio=1.4), geometry=DISK, cells=4, t_end=1.0, reduce=reduce) for reduce in (True, False)
    )
    assert np.abs(half["displacement"] - whole["displacement"]).max() > 0.05 * np.abs(whole["displacement"]).max()
