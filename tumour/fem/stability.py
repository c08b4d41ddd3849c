"""How stiff a body on a mesh still is against a change of its shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, eigs, eigsh

from multiphase.stepping import StepFailure
from tumour import equations as eq
from tumour.fem.arrays import COEFFICIENTS, FIBRE, PUSH, REINFORCEMENT, STIFFNESS
from tumour.fem.newton import Step

if TYPE_CHECKING:
    from tumour.fem.scheme import MiniScheme

Array = NDArray[np.float64]

ROUNDING = 1e-4
"""Share of the largest eigenvalue of the inverse below which one of the other sign does not count."""
RESTARTS = 50
"""Restarts of the iteration for an eigenvalue after which it is given up: some seconds on ten thousand triangles."""
SHORTAGE = 0.01
"""Oxygen below 0, over the largest, that is said to be why a run cannot go on."""
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
        newton.make(Step(0.0, *nothing, point, scheme.acting), point)
        inverse = LinearOperator((count, count), matvec=respond, dtype=float)
        values, vectors = _both_ends(inverse, start - rigid @ (rigid.T @ start), symmetric=_is_symmetric(scheme))
    except ArpackError as error:
        raise StepFailure(f"no eigenvalue was found: {error}") from error
    finally:
        newton.recall(memory)
    which = 0 if values[0] < -ROUNDING * values[1] else 1
    if values[which] == 0.0:
        raise StepFailure("no eigenvalue was found at the end of the spectrum that counts")
    mode = np.zeros_like(root)
    mode[moves] = vectors[:, which] / root[moves]
    return 1.0 / float(values[which]), int(np.argmax(np.hypot(*mode.T)))


def _is_symmetric(scheme: MiniScheme) -> bool:
    """Whether the stresses and what acts on the surface have an energy: the push of fibres has none, nor has a load on a part of the
    surface whose ends move."""
    return not (np.any(scheme.constants.tissue[:, PUSH]) or np.any(scheme.acting[:, 2]))


def _both_ends(inverse: LinearOperator, start: Array, *, symmetric: bool) -> tuple[Array, Array]:
    """The eigenvalues of the inverse with the least and the largest real part, and their vectors: a state buckles where one passes 0.

    Those of stiff changes of shape crowd at 0, where the iteration does not get on: an end that it does not reach is there.
    """
    solver, ends = (eigsh, ("SA", "LA")) if symmetric else (eigs, ("SR", "LR"))
    values, vectors = np.zeros(2), np.zeros((len(start), 2))
    for i, end in enumerate(ends):
        try:
            value, vector = solver(inverse, k=1, which=end, v0=start, tol=1e-6, maxiter=RESTARTS)
        except ArpackNoConvergence:
            continue
        values[i], vectors[:, i] = value[0].real, vector[:, 0].real
    if not values.any():
        raise StepFailure(f"no eigenvalue was found in {RESTARTS} restarts")
    return values, vectors


def sliding(scheme: MiniScheme, u: Array) -> tuple[float, Array]:
    """The least stiffness, over all quadrature points, of layers across the fibres against sliding over each other, and where at rest.

    Layers with the normal a_0 at rest that are moved along b, perpendicular to F a_0: the stress along b changes with their slope by

        m mu + 2 k_f (|F a_0|^2 - 1) - (rho - 1) alpha Sigma J/|F a_0|^2 + (m lambda + m mu/J^2) (J F^-T a_0 . b)^2,

    an entry of the acoustic tensor. At 0 or less the equations of the stresses are not elliptic, and layers as thin as the mesh allows
    slide. Without fibres it is at least m mu.
    """
    c, el, point = scheme.constants, scheme.elements, scheme.point(u)
    l = el.points
    psi = 27.0 * np.einsum("qa,nai->nqi", np.stack([l[:, 1] * l[:, 2], l[:, 0] * l[:, 2], l[:, 0] * l[:, 1]], axis=1), el.gradients)
    local = point.nodal[el.triangles]
    F = np.eye(2) + np.einsum("nai,naj->nij", local[..., :2], el.gradients)[:, None] + np.einsum("ni,nqj->nqij", point.bubbles, psi)
    J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    tissue = np.broadcast_to(c.tissue, (J.size, COEFFICIENTS)).reshape(*J.shape, COEFFICIENTS)
    direction, m = tissue[..., FIBRE : FIBRE + 2], tissue[..., STIFFNESS]
    along = np.einsum("nqij,nqj->nqi", F, direction)
    square = np.sum(along**2, axis=2)
    b = np.stack([-along[..., 1], along[..., 0]], axis=2) / np.sqrt(square)[..., None]
    across = (F[..., 1, 1] * direction[..., 0] - F[..., 1, 0] * direction[..., 1]) * b[..., 0]
    across += (F[..., 0, 0] * direction[..., 1] - F[..., 0, 1] * direction[..., 0]) * b[..., 1]
    contact = eq.contact_pressure(local[..., 2] @ l.T, *scheme.parameters.contact)
    holds = m * c.mu + 2.0 * tissue[..., REINFORCEMENT] * (square - 1.0) - tissue[..., PUSH] * contact * J / square
    holds += m * (c.lam + c.mu / J**2) * across**2
    n, q = np.unravel_index(int(np.argmin(holds)), holds.shape)
    return float(holds[n, q]), l[q] @ scheme.points[el.triangles[n]]


def _rigid_motions(scheme: MiniScheme, displacement: Array, root: Array) -> Array:
    """The rigid motions that the body as it is can make, weighted and orthonormal: (points, 2, motions)."""
    rigid = scheme.newton.rigid
    x = scheme.points + displacement
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
    oxygen = scheme.point(u).nodal[:, 4]
    if oxygen.min() < -SHORTAGE * np.abs(oxygen).max():
        x, y = scheme.points[int(np.argmin(oxygen))]
        return (
            f"Oxygen has fallen to {oxygen.min():.2g}, below 0, near ({x:.3g}, {y:.3g}) of the body at rest: more is drawn out than there "
            "is, or the triangles are too wide for the layer in which it is taken up; more cells make them smaller."
        )
    holds, (x, y) = sliding(scheme, u)
    if not holds > 0.0:
        return (
            f"Near ({x:.3g}, {y:.3g}) of the body at rest layers across the fibres can slide over each other without resistance: the push "
            "along the fibres is more than the tissue bears, as in a body that is confined, and no mesh resolves what follows. A smaller "
            "fibre_ratio or a larger stiffness keeps it from that; a larger lambda_alpha does not."
        )
    try:
        now, at = stiffness(scheme, u)
        rest, _ = stiffness(scheme, scheme.initial())
    except StepFailure:
        return ""
    if now > LOST * rest:
        return ""
    x, y = scheme.points[at]
    state = f"has fallen to {100.0 * now / rest:.2g} % of that at rest" if now > 0.0 else "is negative"
    return (
        f"The body has lost its stability: its stiffness against a change of shape {state}, most of it near ({x:.3g}, {y:.3g}) of the body "
        "at rest, so the equations have no solution near by from here on. A larger lambda_alpha keeps it stable, or less attraction "
        "between cells (alpha_min at alpha_star, sigma_width = 0), where there is any."
    )
