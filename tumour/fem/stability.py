"""How stiff a body on a mesh still is against a change of its shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from multiphase.stepping import StepFailure
from tumour.fem.newton import Step

if TYPE_CHECKING:
    from tumour.fem.scheme import MiniScheme

Array = NDArray[np.float64]

ROUNDING = 1e-4
"""Share of the largest eigenvalue of the inverse below which one of the other sign does not count."""
LOST = 0.02
"""Stiffness, over that at rest, below which a body that cannot go on is said to have lost its stability."""


def stiffness(scheme: MiniScheme, u: Array) -> tuple[float, int]:
    """The least stiffness of a state against a sudden change of shape, and the point of the mesh that this change moves most.

    Sudden: no fluid has time to flow and no cell to grow, so the volume around each point but those of the surface stays, and the
    pressure keeps it; with kappa = 0 fluid flows at once and the pressure is that outside. The stiffness is an eigenvalue of the
    linearised momentum balance, ``(dP, grad v) = s (d, v)`` with lumped masses, among the changes that are no rigid motion of the body
    as it is: the negative one next to 0, if there is any, and else the least. At 0 the state buckles. (The operator is symmetric but
    for the averages of alpha over triangles, some per cent of it.)

    Raises
    ------
    StepFailure
        Where no eigenvalue is found.
    """
    newton, free = scheme.newton, scheme.newton.rows.free
    point = scheme.point(u)
    nothing = np.zeros_like(point.nodal), np.zeros_like(point.bubbles)
    memory = newton.memory
    moves: NDArray[np.bool_] = np.logical_not(scheme.prescribed[:, :2])
    root = np.sqrt(scheme.observation.weights)[:, None] * moves
    rigid = _rigid_motions(scheme, point.nodal[:, :2], root)[moves]

    def respond(v: Array) -> Array:
        v = v.ravel() - rigid @ (rigid.T @ v.ravel())
        forces, response = np.zeros((2, *point.nodal.shape))
        forces[:, :2][moves] = root[moves] * v
        response.ravel()[free] = newton.linear.solve(forces.ravel()[free])
        moved: Array = root[moves] * response[:, :2][moves]
        return moved - rigid @ (rigid.T @ moved)

    count = int(np.sum(moves))
    start = np.random.default_rng(0).standard_normal(count)  # in no direction of symmetry
    try:
        newton.make(Step(0.0, *nothing, point), point)
        inverse = LinearOperator((count, count), matvec=respond, dtype=float)
        values, vectors = eigsh(inverse, k=2, which="BE", v0=start - rigid @ (rigid.T @ start), tol=1e-6)
    except ArpackError as error:
        raise StepFailure(f"no eigenvalue was found: {error}") from error
    finally:
        newton.recall(memory)
    which = 0 if values[0] < -ROUNDING * values[1] else 1
    mode = np.zeros_like(root)
    mode[moves] = vectors[:, which] / root[moves]
    return 1.0 / float(values[which]), int(np.argmax(np.hypot(*mode.T)))


def _rigid_motions(scheme: MiniScheme, displacement: Array, root: Array) -> Array:
    """The rigid motions that the body as it is can make, weighted and orthonormal: (points, 2, motions)."""
    rigid = scheme.newton.rigid
    x = scheme.mesh.points + displacement
    motions = [np.eye(2)[k] + 0.0 * x for k in range(2) if rigid.shifts[k]]
    if rigid.turns:
        motions.append(np.column_stack([-x[:, 1], x[:, 0]]))
    if not motions:
        return np.zeros((*x.shape, 0))
    basis, _ = np.linalg.qr(np.stack([(root * motion).ravel() for motion in motions], axis=1))
    orthonormal: Array = basis.reshape(*x.shape, -1)
    return orthonormal


def explain(scheme: MiniScheme, u: Array) -> str:
    """A sentence on the stability of a state that no step leads on from; empty if it is stable."""
    try:
        now, at = stiffness(scheme, u)
        rest, _ = stiffness(scheme, scheme.initial())
    except StepFailure:
        return ""
    if now > LOST * rest:
        return ""
    x, y = scheme.mesh.points[at]
    state = f"has fallen to {100.0 * now / rest:.2g} % of that at rest" if now > 0.0 else "is negative"
    return (
        f"The body has lost its stability: its stiffness against a change of shape {state}, most of it near ({x:.3g}, {y:.3g}) of the body "
        "at rest, so the equations have no solution near by from here on. A larger lambda_alpha keeps it stable, or less attraction "
        "between cells (alpha_min at alpha_star, sigma_width = 0), where there is any."
    )
