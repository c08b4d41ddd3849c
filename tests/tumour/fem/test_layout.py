"""Shape functions, the matrix's pattern, and rigid motions of meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.fem import layout
from tumour.fem.arrays import FIELDS, OUTER
from tumour.fem.kernel import KERNEL

CASES = ("none", "some", "most", "whole points", "a field", "one unknown left", "of one triangle")


def prescribed(case: str, count: int, triangle: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(7)
    held = np.zeros((count, FIELDS), dtype=bool)
    match case:
        case "some":
            held = rng.uniform(size=held.shape) < 0.3
        case "most":
            held = rng.uniform(size=held.shape) < 0.9
        case "whole points":
            held[::3] = True
        case "a field":
            held[:, 3] = True
        case "one unknown left":
            held[:] = True
            held[count // 2, 2] = False
        case "of one triangle":
            held[triangle] = True
            held[0] = True  # and the first of all points: its row of the graph holds nothing
            held[-1] = True
    return held


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("shape", ["disk", "quarter disk", "glioma"])
def test_the_pattern_takes_element_matrices_to_where_they_belong(shape: str, case: str) -> None:
    """Element matrices at random through the kernel, against a dense matrix without its prescribed rows and columns; sums to rounding."""
    body = {
        "disk": lambda: meshes.disk(1.0, 3),
        "quarter disk": lambda: meshes.quarter_disk(1.0, 3),
        "glioma": lambda: meshes.glioma(0.4, 0.2),
    }
    el = layout.elements_of(body[shape]().mesh)
    count, rng = int(el.triangles.max()) + 1, np.random.default_rng(1)
    held = prescribed(case, count, el.triangles[5])
    rows = layout.rows_of(el, held)
    size = int(np.sum(~held))
    assert rows.indptr.dtype == rows.indices.dtype == np.int32
    assert (len(rows.indptr), rows.indptr[0], rows.indptr[-1]) == (size + 1, 0, len(rows.indices))
    np.testing.assert_array_equal(rows.free, np.flatnonzero(~held.ravel()))
    expected, there = np.zeros((FIELDS * count, FIELDS * count)), np.zeros((FIELDS * count, FIELDS * count), dtype=bool)
    values = np.zeros(len(rows.indices))
    for n, corners in enumerate(el.triangles):
        K = rng.normal(size=(OUTER + 2, OUTER + 2))
        KERNEL["add_to_rows"](corners, rows.pattern.pairs[n], rows.pattern, K, values)
        at = (FIELDS * corners[:, None] + np.arange(FIELDS)).ravel()
        expected[np.ix_(at, at)] += K[:OUTER, :OUTER]
        there[np.ix_(at, at)] = True
    found, entries = np.zeros((size, size)), np.zeros((size, size), dtype=bool)
    for i in range(size):
        columns = rows.indices[rows.indptr[i] : rows.indptr[i + 1]]
        assert np.all(np.diff(columns) > 0)  # sorted, none twice
        assert np.all((columns >= 0) & (columns < size))
        found[i, columns], entries[i, columns] = values[rows.indptr[i] : rows.indptr[i + 1]], True
    np.testing.assert_allclose(found, expected[np.ix_(rows.free, rows.free)], atol=1e-13)
    np.testing.assert_array_equal(entries, there[np.ix_(rows.free, rows.free)])
    np.testing.assert_array_equal(entries, entries.T)  # symmetric in structure, as the solvers of linear systems take it


def test_a_matrix_too_large_for_its_indices_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    el = layout.elements_of(meshes.disk(1.0, 3).mesh)

    class Few:
        def __getattr__(self, name: str) -> Any:
            return getattr(np, name)

        @staticmethod
        def iinfo(kind: Any) -> Any:
            return type("Limits", (), {"max": 1000})

    monkeypatch.setattr(layout, "np", Few())
    with pytest.raises(MemoryError, match="entries of the matrix"):
        layout.rows_of(el, np.zeros((37, FIELDS), dtype=bool))


def test_shape_functions_and_the_mass_matrix() -> None:
    """Linear functions have their slopes; products of two have their integrals, by the rule of quadrature; rounding."""
    body = meshes.glioma(0.4, 0.1)
    el, points = layout.elements_of(body.mesh), body.mesh.p.T
    f = points @ [0.7, -1.3] + 0.4
    np.testing.assert_allclose(np.einsum("nai,na->ni", el.gradients, f[el.triangles]), np.tile([0.7, -1.3], (len(el.areas), 1)), rtol=1e-11)
    np.testing.assert_allclose(el.gradients.sum(axis=1), 0.0, atol=1e-12)
    assert el.areas.sum() == pytest.approx(body.area, rel=1e-13)
    mass = layout.mass_matrix(el, len(points))
    g = points @ [0.2, 0.9] - 1.0
    exact = np.einsum("n,q,nq,nq->", el.areas, el.weights, f[el.triangles] @ el.points.T, g[el.triangles] @ el.points.T)
    assert f @ mass @ g == pytest.approx(exact, rel=1e-13)


def rigid_of(body: Any) -> layout.RigidMotions:
    points = np.ascontiguousarray(body.mesh.p.T)
    shifts = np.array([not len(body.slide_x), not len(body.slide_y)])
    return layout.RigidMotions(layout.elements_of(body.mesh), points, shifts, bool(shifts.all()))


def means(body: Any, d: np.ndarray, bubbles: np.ndarray) -> tuple[np.ndarray, float]:
    """(d, 1) and (d, X^perp) with the rule of quadrature, which is exact for linear times cubic."""
    el, points = layout.elements_of(body.mesh), body.mesh.p.T
    psi = 27.0 * np.prod(el.points, axis=1)
    at = np.einsum("nai,qa->nqi", d[el.triangles], el.points) + bubbles[:, None] * psi[:, None]
    X = np.einsum("nai,qa->nqi", points[el.triangles], el.points)
    weights = el.areas[:, None] * el.weights
    return np.einsum("nq,nqi->i", weights, at), float(np.sum(weights * (X[..., 0] * at[..., 1] - X[..., 1] * at[..., 0])))


def test_alignment_takes_out_rigid_motions_and_nothing_else() -> None:
    """A large displacement at random, moved and turned: orthogonal to all rigid motions to rounding, the same whatever the motion, its
    distances kept; what is aligned stays."""
    body, rng = meshes.glioma(0.4, 0.1), np.random.default_rng(2)
    rigid, points = rigid_of(body), body.mesh.p.T
    d = points @ rng.uniform(-0.4, 0.8, (2, 2)) + 0.02 * rng.normal(size=points.shape)
    bubbles = 0.02 * rng.normal(size=(body.mesh.nelements, 2))
    first, first_bubbles = d.copy(), bubbles.copy()
    rigid.align(first, first_bubbles)
    shift, turn = means(body, first, first_bubbles)
    assert np.abs(shift).max() < 1e-15
    assert abs(turn) < 1e-15
    for angle in (0.3, 2.5, -1.7, np.pi):
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        other = (points + d) @ R.T + [3.0, -1.0] - points
        other_bubbles = bubbles @ R.T
        rigid.align(other, other_bubbles)
        np.testing.assert_allclose(other, first, atol=1e-13)  # rounding of numbers up to 4, over the body's 0.4
        np.testing.assert_allclose(other_bubbles, first_bubbles, atol=1e-14)
    again, again_bubbles = first.copy(), first_bubbles.copy()
    rigid.align(again, again_bubbles)
    np.testing.assert_allclose(again, first, atol=1e-15)
    np.testing.assert_allclose(again_bubbles, first_bubbles, atol=1e-15)


def test_what_is_held_and_aligned_of_bodies_that_slide() -> None:
    """Nothing of a quarter disk; the shift along the side of a body with one such side; two shifts and a turn of a free one."""
    rng = np.random.default_rng(3)
    quarter = rigid_of(meshes.quarter_disk(1.0, 3))
    assert (quarter.shifts.tolist(), quarter.turns, quarter.held.sum()) == ([False, False], False, 0)
    d, bubbles = rng.normal(size=(16, 2))[:10], rng.normal(size=(9, 2))
    before = d.copy()
    quarter.align(d, bubbles)
    np.testing.assert_array_equal(d, before)

    body = meshes.disk(1.0, 3)
    free = rigid_of(body)
    assert (free.shifts.tolist(), free.turns, free.held.sum()) == ([True, True], True, 3)
    points = body.mesh.p.T
    (x, y) = np.flatnonzero(free.held[:, 0]), np.flatnonzero(free.held[:, 1])
    twice, once = (x, y) if len(x) == 2 else (y, x)
    assert once[0] in twice  # one point is held in both directions
    arm = points[np.setdiff1d(twice, once)[0]] - points[once[0]]
    held = 0 if len(x) == 2 else 1
    assert abs(arm[1 - held]) > 0.6  # the other across its arm, of which much is left: it cannot turn

    half = layout.RigidMotions(layout.elements_of(body.mesh), points, np.array([True, False]), False)
    assert (half.shifts.tolist(), half.turns, half.held.sum()) == ([True, False], False, 1)
    assert half.held[:, 0].sum() == 1
    d, bubbles = rng.normal(size=points.shape), rng.normal(size=(54, 2))
    before = d.copy()
    half.align(d, bubbles)
    assert abs(means(body, d, bubbles)[0][0]) < 1e-14
    np.testing.assert_array_equal(d[:, 1], before[:, 1])
    np.testing.assert_allclose(d[:, 0] - before[:, 0], (d - before)[0, 0], atol=1e-15)
