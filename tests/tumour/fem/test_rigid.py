"""Bodies in free suspension: nothing depends on where they are, how they are turned, how their mesh is numbered, and what is held."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tumour import meshes
from tumour.fem import layout
from tumour.fem.arrays import KEPT
from tumour.fem.kernel import KERNEL
from tumour.meshes import Body
from tumour.meshes.body import make_body

TIMES = [2.0, 6.0]
SETTINGS = {"newton_tol": 1e-12, "lambda_alpha": 0.3, "alpha_min": 0.6}
"""Without a kink where the cells are: iterations through it are sensitive to rounding, and so may be whether a step is halved."""
SAME = 1e-9
"""What Newton's method leaves, 1e-12 per step, and what a few steps of growth and the sums of moments make of it."""


@cache
def body_of(shape: str) -> Body:
    return meshes.disk(1.0, 4) if shape == "disk" else meshes.glioma(1.0, 0.4)


def uneven(body: Body) -> np.ndarray:
    """A fraction that is not the same everywhere, so that disks are not round either."""
    x, y = body.mesh.p
    return np.asarray(0.81 + 0.03 * np.sin(2.0 * x + y) - 0.02 * x * y)


def grow(make: Any, run: Any, body: Body, alpha: np.ndarray) -> tuple[Any, Any]:
    """A run with steps of 0.5 from a given fraction at the points."""
    scheme = make(body, kind=with_fraction(alpha), **SETTINGS)
    return scheme, run(scheme, TIMES, dt=0.5)


def with_fraction(alpha: np.ndarray) -> Any:
    """MiniScheme that starts from a fraction given at the points."""
    from tumour.fem import scheme as module

    class Given(module.MiniScheme):
        def _start(self) -> np.ndarray:
            original = module.fraction
            module.fraction = lambda initial, body: alpha
            try:
                return super()._start()
            finally:
                module.fraction = original

    return Given


def assert_same(scheme: Any, one: Any, other: Any, turn: np.ndarray, order: np.ndarray) -> None:
    for a, b in zip(one, other, strict=True):
        for name, value in a.scalars.items():
            if not name.startswith("defect"):
                assert b.scalars[name] == pytest.approx(value, rel=SAME), name
            assert abs(b.scalars["defect_cells"]) < 1e-10
            assert abs(b.scalars["defect_volume"]) < 1e-10
        for name, field in a.fields.items():
            expected = field @ turn.T if name == "displacement" else field
            np.testing.assert_allclose(b.fields[name][order], expected, atol=SAME * (1.0 + np.abs(field).max()), err_msg=name)


@pytest.mark.parametrize("shape", ["disk", "glioma"])
def test_results_turn_and_move_with_the_body_and_do_not_see_its_numbers(
    make_mini: Any, run_elastic: Any, change_body: Any, shape: str
) -> None:
    body = body_of(shape)
    alpha, points = uneven(body), body.mesh.p.T
    scheme, (_, plain) = grow(make_mini, run_elastic, body, alpha)
    assert np.ptp(plain[-1].fields["alpha"]) > 2e-3
    eye, same, rng = np.eye(2), np.arange(len(points)), np.random.default_rng(1)
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    order, triangles = rng.permutation(len(points)), rng.permutation(body.mesh.nelements)
    shift = np.zeros(2) if shape == "disk" else np.array([5.0, -3.0])  # disks are about the origin
    changes = {
        "turned": (change_body(body, points @ turn.T), alpha, turn, same),
        "moved": (change_body(body, points + shift), alpha, eye, same),
        "numbered anew": (change_body(body, points, order, triangles), alpha[np.argsort(order)], eye, order),
        "all": (change_body(body, points @ turn.T + shift, order, triangles), alpha[np.argsort(order)], turn, order),
    }
    for other, fraction, by, numbers in changes.values():
        _, (_, found) = grow(make_mini, run_elastic, other, fraction)
        assert_same(scheme, plain, found, by, numbers)


@pytest.mark.parametrize("shape", ["disk", "glioma"])
def test_no_rigid_motion_and_no_force_at_any_step(make_mini: Any, run_elastic: Any, shape: str) -> None:
    """(d, 1) = 0 and (d, X^perp) = 0 to rounding; the residual of every row of the momentum, those of what is held included, to what
    Newton's method leaves, 1e-12 times stiffnesses of up to 100."""
    body = body_of(shape)
    scheme = make_mini(body, kind=with_fraction(uneven(body)), **SETTINGS)
    el, points, solve, seen = scheme.elements, scheme.mesh.points, scheme.solve, []
    psi, X = 27.0 * np.prod(el.points, axis=1), np.einsum("nai,qa->nqi", points[el.triangles], el.points)
    weights = el.areas[:, None] * el.weights

    def watched(t: float, alpha: float, past: np.ndarray, guess: np.ndarray) -> Any:
        solved = solve(t, alpha, past, guess)
        point = scheme.point(solved.u)
        d = np.einsum("nai,qa->nqi", point.nodal[el.triangles, :2], el.points) + point.bubbles[:, None] * psi[:, None]
        mean = np.einsum("nq,nqi->i", weights, d)
        turn = np.sum(weights * (X[..., 0] * d[..., 1] - X[..., 1] * d[..., 0]))
        R, r = np.empty_like(point.nodal), np.empty_like(point.bubbles)
        zero, kept = (np.zeros_like(point.nodal), np.zeros_like(point.bubbles)), np.zeros((len(el.areas), KEPT))
        KERNEL["residual"](
            scheme.constants, el, 1.0, point.nodal, point.bubbles, *zero, *zero, scheme.surface.edges, scheme.acting, kept, R, r
        )
        seen.append([np.abs(mean).max(), abs(turn), np.abs(R[:, :2]).max(), np.abs(r).max(), np.abs(point.nodal[:, :2]).max()])
        return solved

    scheme.solve = watched
    run_elastic(scheme, TIMES, dt=0.5)
    worst = np.max(seen, axis=0)
    assert len(seen) == 13
    assert worst[4] > 0.2  # the body has grown
    assert worst[0] < 1e-14
    assert worst[1] < 1e-14
    assert worst[2] < 1e-10
    assert worst[3] < 1e-10


@pytest.mark.parametrize("shape", ["disk", "glioma"])
def test_it_does_not_matter_what_is_held(make_mini: Any, run_elastic: Any, monkeypatch: pytest.MonkeyPatch, shape: str) -> None:
    body = body_of(shape)
    alpha = uneven(body)
    scheme, (_, plain) = grow(make_mini, run_elastic, body, alpha)
    first = scheme.newton.rigid.held

    def hold_others(self: layout.RigidMotions, points: np.ndarray) -> None:
        """A point of the boundary, and one far from it."""
        a = body.surface[5]
        arm = points - points[a]
        b = int(np.argmax(np.sum(arm**2, axis=1)))
        self.held[a] = True
        self.held[b, int(np.argmin(np.abs(arm[b])))] = True

    monkeypatch.setattr(layout.RigidMotions, "_hold", hold_others)
    other, (_, found) = grow(make_mini, run_elastic, body, alpha)
    assert not np.any(other.newton.rigid.held & first)
    assert_same(scheme, plain, found, np.eye(2), np.arange(scheme.count))


def half_of(body: Body) -> tuple[Body, np.ndarray]:
    """The half of a disk with y >= 0, sliding on y = 0, and the numbers of its points in the disk."""
    points, triangles = body.mesh.p.T, body.mesh.t.T
    mine = triangles[points[triangles, 1].mean(axis=1) > 0.0]
    used = np.unique(mine)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    surface = number[np.intersect1d(body.surface, used)]
    half = make_body(
        points[used], number[mine], surface=surface, slide_y=np.flatnonzero(np.abs(points[used, 1]) < 1e-12), radius=body.radius,
        area=0.5 * body.area, is_round=True, path="geometry",
    )  # fmt: skip
    return half, used


def test_a_half_disk_is_half_of_a_disk(make_mini: Any, run_elastic: Any) -> None:
    """Free to shift along its side; with cells that are more on the right, so that their middle moves there. The disk's mesh is its own
    mirror image."""
    body = body_of("disk")
    half, used = half_of(body)
    alpha = 0.81 + 0.04 * np.tanh(2.0 * body.mesh.p[0])
    whole, (_, plain) = grow(make_mini, run_elastic, body, alpha)
    part, (_, found) = grow(make_mini, run_elastic, half, alpha[used])
    assert part.newton.rigid.held.sum() == 1
    assert not part.newton.rigid.held[:, 1].any()
    for a, b in zip(plain, found, strict=True):
        assert b.scalars["area"] == pytest.approx(0.5 * a.scalars["area"], rel=SAME)
        for name in ("alpha", "C", "p", "displacement"):
            np.testing.assert_allclose(b.fields[name], a.fields[name][used], atol=SAME, err_msg=name)
    assert np.all(found[-1].fields["displacement"][half.slide_y, 1] == 0.0)
    np.testing.assert_allclose(whole.observation.weights @ plain[-1].fields["displacement"], 0.0, atol=1e-2)
    assert np.abs(found[-1].fields["displacement"][np.argmin(np.hypot(*half.mesh.p)), 0]) > 5e-4  # the middle moves
