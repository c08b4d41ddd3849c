"""Tissue with directions and parts of the surface: what must not matter does not, and what is known exactly comes out."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.boundary import TumourBoundary
from tumour.fem import layout
from tumour.fem.arrays import ACTIONS, FIELDS, KEPT
from tumour.fem.kernel import KERNEL
from tumour.fem.scheme import MiniScheme
from tumour.meshes import Body
from tumour.meshes.body import make_body

SETTINGS = {"newton_tol": 1e-12, "lambda_alpha": 0.3, "alpha_min": 0.6}
"""Without a kink where the cells are: iterations through it are sensitive to rounding."""
Table = dict[str, Any]


def make(make_mini: Any, body: Body | None = None, boundary: Table | None = None, **changes: Any) -> MiniScheme:
    """A scheme with named parts of the surface."""
    return make_mini(body, kind=partial(MiniScheme, boundary=TumourBoundary.from_table(boundary or {})), **changes)


def assert_same(one: Any, other: Any, tolerance: float, turn: np.ndarray | None = None) -> None:
    """That the stored fields are the same, those of the other ones turned."""
    for a, b in zip(one, other, strict=True):
        for name, field in a.fields.items():
            expected = field if turn is None or name != "displacement" else field @ turn.T
            np.testing.assert_allclose(b.fields[name], expected, atol=tolerance * (1.0 + np.abs(field).max()), rtol=0.0, err_msg=name)


# -- What makes no difference --------------------------------------------------------------------------------------------

SAME: dict[str, tuple[Table, Table]] = {
    "stiffness": ({"stiffness": "1 + 0*x"}, {}),
    "permeability": ({"permeability": {"xx": "1 + 0*x", "yy": "1", "xy": "0*y"}}, {}),
    "diffusivity": ({"diffusivity": {"along": "1 + 0*x", "across": "1"}, "fibre_angle": "x - y"}, {}),
    "consumption": ({"consumption": "1 + 0*x"}, {}),
    "fibres": ({"fibre_ratio": "1 + 0*x", "fibre_angle": "0.3 + x", "fibre_stiffness": "0*y"}, {}),
    "all": ({"stiffness": "1 + 0*y", "permeability": {"xx": 1, "yy": "1+0*x"}, "diffusivity": "1", "fibre_angle": "theta"}, {}),
    "surface": ({}, {"all": {"side": "surface", "p": 0.0, "C": 1.0, "load": 0.0, "spring": 0.0}}),
    "terms of size 0": ({}, {"all": {"side": "surface", "traction_x": {"times": [0, 1], "values": [1e-300, 0]}}}),
}


@pytest.mark.parametrize("case", SAME)
def test_tissue_and_surface_that_are_plain_after_all(make_mini: Any, run_elastic: Any, case: str) -> None:
    """Through the general path; after 8 steps of Newton's method to 1e-12."""
    changes, boundary = SAME[case]
    plain = run_elastic(make(make_mini, alpha="0.82 - 0.03*x*y", **SETTINGS), [1.0, 4.0], dt=0.5)[1]
    general = make(make_mini, alpha="0.82 - 0.03*x*y", boundary=boundary, **SETTINGS, **changes)
    assert general.constants.stride == 1 or boundary
    assert_same(plain, run_elastic(general, [1.0, 4.0], dt=0.5)[1], 1e-10)


FIBRES = {"fibre_ratio": "1.5 + 0.5*x", "fibre_stiffness": 0.2, "permeability": {"along": 2.0, "across": 0.5}, "stiffness": "1 + 0.3*y"}


def test_the_sense_of_the_fibres_does_not_matter(make_mini: Any, run_elastic: Any) -> None:
    one, other = (
        run_elastic(make(make_mini, meshes.disk(1.0, 4), fibre_angle=angle, **FIBRES, **SETTINGS), [2.0], dt=0.5)[1]
        for angle in ("0.4 + y", "0.4 + y + pi")
    )
    assert np.ptp(one[0].fields["J"]) > 0.02
    assert_same(one, other, 1e-12)


def with_map(Q: np.ndarray, table: Any) -> Any:
    """Formulas of {x} and {y} for a body mapped by the orthogonal Q, as functions of the places there."""
    x, y = (f"({a!r}*x + {b!r}*y)" for a, b in Q.T.tolist())  # the place before
    if isinstance(table, dict):
        return {key: with_map(Q, value) for key, value in table.items()}
    return table.format(x=x, y=y) if isinstance(table, str) else table


def mapped_tissue(Q: np.ndarray) -> Table:
    """Tissue that varies, on a body mapped by Q."""
    K = np.array([["1.2 + 0.3*{x}", "0.3*{y}"], ["0.3*{y}", "0.7 + 0.2*{x}*{y}"]])
    turned = [
        [" + ".join(f"({float(Q[i, k] * Q[j, l])!r})*({K[k, l]})" for k in range(2) for l in range(2)) for j in range(2)] for i in range(2)
    ]
    sign, start = np.linalg.det(Q), float(np.arctan2(Q[1, 0], Q[0, 0]))
    return with_map(Q, {
        "permeability": {"xx": turned[0][0], "yy": turned[1][1], "xy": turned[0][1]},
        "diffusivity": {"along": "0.6 + 0.1*{x}", "across": "1.8"}, "stiffness": "1 + 0.3*{x} - 0.2*{y}", "consumption": "1 + 0.5*{y}",
        "fibre_angle": f"{start!r} + ({float(np.sign(sign))!r})*(0.4 + 0.8*{{y}})", "fibre_ratio": "1.5 + 0.6*{x}", "fibre_stiffness": 0.2,
    })  # fmt: skip


def mapped_surface(Q: np.ndarray) -> Table:
    """Parts of the surface with all that acts, on a body mapped by Q."""
    force = (Q @ [-0.02, 0.03]).tolist()
    return with_map(Q, {
        "bed": {"where": "{x} > 0.3", "spring": 0.3, "spring_normal": 0.5, "p": "closed", "C": "closed", "influx": 0.1},
        "skin": {
            "where": "{y} > {x} + 0.6", "load": {"times": [0.0, 2.0], "values": [0.02, 0.1]}, "traction_x": force[0],
            "traction_y": force[1], "membrane": 1.5, "C": 0.8, "p": 0.05,
        },
    })  # fmt: skip


def mapped_disk(Q: np.ndarray) -> Body:
    body = meshes.disk(1.0, 5)
    triangles = body.mesh.t.T if np.linalg.det(Q) > 0.0 else body.mesh.t.T[:, ::-1]
    return make_body(body.mesh.p.T @ Q.T, triangles, surface=body.surface, radius=1.0, area=body.area, path="geometry")


@pytest.mark.parametrize("held", [False, True], ids=["free", "with parts"])
@pytest.mark.parametrize("mirrored", [False, True], ids=["turned", "mirrored"])
def test_results_turn_with_body_tissue_and_surface(make_mini: Any, run_elastic: Any, mirrored: bool, held: bool) -> None:
    """Tensors, fibres and tractions turned by hand; or seen in a mirror as well."""
    c, s = np.cos(0.7), np.sin(0.7)
    Q, plain = np.array([[c, -s], [s, c]]), np.eye(2)
    if mirrored:
        Q = np.diag([-1.0, 1.0]) @ Q
    one, other = (
        run_elastic(
            make(make_mini, mapped_disk(by), mapped_surface(by) if held else None, **mapped_tissue(by), **SETTINGS), [1.0, 3.0], dt=0.5
        )[1]
        for by in (plain, Q)
    )
    assert np.abs(one[-1].fields["displacement"]).max() > 0.05
    assert np.ptp(one[-1].fields["alpha"]) > 3e-3
    assert_same(one, other, 1e-9, Q)


def test_a_rotation_of_the_deformed_body_turns_the_forces_alone(make_mini: Any) -> None:
    """With tensors and fibres at rest as they were, and what acts by length now: fibres and tensors turn with the tissue. To rounding."""
    skin = {"where": "y > x", "load": 0.6, "membrane": 1.5, "C": 0.8}
    parts = {"skin": skin, "bed": {"where": "y < x - 0.5", "spring": 1e-9, "C": "closed", "influx": 0.3}}
    scheme = make(make_mini, mapped_disk(np.eye(2)), parts, **mapped_tissue(np.eye(2)), **SETTINGS)
    rng, points, count = np.random.default_rng(5), scheme.mesh.points, scheme.count
    nodal = np.column_stack([points @ [[0.2, -0.1], [0.3, 0.1]], rng.uniform(0.7, 0.9, count), rng.normal(size=(count, 2))])
    nodal[:, :2] += 0.02 * rng.uniform(-1.0, 1.0, (count, 2))
    bubbles = 0.01 * rng.uniform(-1.0, 1.0, (scheme.triangles, 2))
    turn, turned = np.array([[np.cos(2.1), -np.sin(2.1)], [np.sin(2.1), np.cos(2.1)]]), nodal.copy()
    turned[:, :2] = (points + nodal[:, :2]) @ turn.T - points

    def rows(nodal: np.ndarray, bubbles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, r, zero = np.empty_like(nodal), np.empty_like(bubbles), (np.zeros_like(nodal), np.zeros_like(bubbles))
        on = scheme.surface.edges, scheme.surface.actions(0.0), np.zeros((scheme.triangles, KEPT))
        assert KERNEL["residual"](scheme.constants, scheme.elements, 0.3, nodal, bubbles, *zero, *zero, *on, R, r) == -1
        return R, r

    (R, r), (S, s) = rows(nodal, bubbles), rows(turned, bubbles @ turn.T)
    np.testing.assert_allclose(S[:, :2], R[:, :2] @ turn.T, atol=1e-8)  # the springs, 1e-9, are there to hold the body
    np.testing.assert_allclose(s, r @ turn.T, atol=1e-12)
    np.testing.assert_allclose(S[:, 2:], R[:, 2:], atol=1e-12)


GAUGE = {**FIBRES, "fibre_angle": "0.4 + y"}


@pytest.mark.parametrize("shape", ["disk", "ring", "quarter disk"])
def test_a_pressure_all_round_is_a_gauge(make_mini: Any, run_elastic: Any, shape: str) -> None:
    """Load and fluid pressure c on all of the surface, the walls of a hole included: p shifts by c, and nothing else happens. It holds
    of the discrete equations too: the integral of A : grad v is the derivative of the deformed mesh's area, bubbles do not change that,
    the rule of degree four integrates it exactly, and the load is its derivative along the surface."""
    c = 0.37
    bodies = {"disk": lambda: meshes.disk(1.0, 4), "ring": ring, "quarter disk": lambda: meshes.quarter_disk(1.0, 4)}
    pressed: Table = {"all": {"side": "surface", "load": c, "p": c}}
    runs = [
        run_elastic(make(make_mini, bodies[shape](), boundary, alpha="0.82 + 0.02*x", **GAUGE, **SETTINGS), [1.0, 3.0], dt=0.5)[1]
        for boundary in ({}, pressed)
    ]
    for free, under in zip(*runs, strict=True):
        assert np.abs(free.fields["displacement"]).max() > 0.02
        np.testing.assert_allclose(under.fields["p"], free.fields["p"] + c, atol=1e-9)
        for name in ("displacement", "alpha", "C", "J"):
            np.testing.assert_allclose(under.fields[name], free.fields[name], atol=1e-9, err_msg=name)


def ring() -> Body:
    """A disk without its middle."""
    disk = meshes.disk(1.0, 5)
    points, triangles = disk.mesh.p.T, disk.mesh.t.T
    triangles = triangles[np.hypot(*points[triangles].mean(axis=1).T) > 0.35]
    used = np.unique(triangles)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    count = np.bincount(number[triangles].ravel())
    body = make_body(points[used], number[triangles], surface=np.flatnonzero(count < 0), radius=1.0, path="geometry")
    surface = np.unique(body.edges)
    return make_body(points[used], number[triangles], surface=surface, radius=1.0, path="geometry")


# -- Limits of what acts -------------------------------------------------------------------------------------------------

STIFF: dict[str, tuple[Any, Any]] = {
    "spring": (lambda k: {"where": "x < -0.3", "spring": k}, {"where": "x < -0.3", "displacement_x": 0.0, "displacement_y": 0.0}),
    "membrane": (lambda k: {"side": "surface", "membrane": k, "C": 0.7}, {"side": "surface", "C": 0.7}),
}


@pytest.mark.parametrize("case", STIFF)
def test_stiff_springs_clamp_and_wide_open_membranes_are_none(make_mini: Any, run_elastic: Any, case: str) -> None:
    """The difference falls with 1/k."""
    of, limit = STIFF[case]

    def run(part: Table) -> np.ndarray:
        scheme = make(make_mini, meshes.disk(1.0, 4), {"part": part}, newton_tol=1e-12, lambda_alpha=0.3)
        fields = run_elastic(scheme, [2.0], dt=0.5)[1][0].fields
        return np.column_stack([fields[name] for name in ("displacement", "alpha", "C")])

    wanted = run(limit)
    off = [np.abs(run(of(k)) - wanted).max() for k in (1e3, 1e4)]
    assert off[0] < 1e-2
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)


# -- Tangents of the edges ------------------------------------------------------------------------------------------------

PARTS: dict[str, Table] = {
    "springs": {"spring": 0.7, "spring_normal": 1.2}, "load": {"load": 0.8}, "membrane": {"membrane": 1.4, "C": 0.6},
    "influx": {"C": "closed", "influx": -0.5}, "traction": {"traction_x": 0.4, "traction_y": -0.2},
    "all": {"spring": 0.7, "spring_normal": 1.2, "load": 0.8, "traction_x": 0.3, "membrane": 1.4, "C": 0.6},
}  # fmt: skip


@pytest.mark.parametrize("case", PARTS)
def test_the_tangent_of_the_edges_is_the_derivative_of_their_residual(make_mini: Any, case: str) -> None:
    """Central differences with the step 1e-5 of what the edges add to the residual: quadratic but for the length of an edge now, whose
    third derivatives over it are 1e2 and more: 1e-8, and rounding 1e-16/1e-5."""
    scheme = make(make_mini, meshes.disk(1.0, 2), {"a": {"where": "x > y", **PARTS[case]}, "b": {"where": "x < -0.5", "spring": 1.0}})
    el, edges, acting = scheme.elements, scheme.surface.edges, scheme.surface.actions(0.0)
    rng, count = np.random.default_rng(3), scheme.count
    nodal = np.column_stack(
        [0.2 * rng.uniform(-1.0, 1.0, (count, 2)), np.full(count, 0.7), rng.normal(size=count), rng.uniform(size=count)]
    )
    bubbles, zero = np.zeros((scheme.triangles, 2)), (np.zeros((count, FIELDS)), np.zeros((scheme.triangles, 2)))
    rows = layout.rows_of(el, np.zeros((count, FIELDS), dtype=bool))
    none = layout.no_edges(), np.zeros((0, ACTIONS))

    def evaluate(nodal: np.ndarray, surface: Any) -> tuple[np.ndarray, np.ndarray]:
        values, kept, R = np.empty(len(rows.indices)), np.empty((scheme.triangles, KEPT)), np.empty((count, FIELDS))
        args = (nodal, bubbles, *zero, *zero, *surface, rows.pattern, values, kept, R, np.empty_like(bubbles))
        assert KERNEL["tangent"](scheme.constants, el, 0.3, *args) == -1
        return values, R.ravel()

    values = evaluate(nodal, (edges, acting))[0] - evaluate(nodal, none)[0]
    found = np.zeros((FIELDS * count, FIELDS * count))
    found[np.repeat(np.arange(FIELDS * count), np.diff(rows.indptr)), rows.indices] = values
    numeric = np.empty_like(found)
    for j in range(FIELDS * count):
        ends = []
        for sign in (1.0, -1.0):
            moved = nodal.copy()
            moved.ravel()[j] += sign * 1e-5
            ends.append(evaluate(moved, (edges, acting))[1] - evaluate(moved, none)[1])
        numeric[:, j] = (ends[0] - ends[1]) / 2e-5
    assert np.abs(found - numeric).max() < 1e-7 * max(1.0, np.abs(found).max())
    assert np.abs(found).max() > 0.1
