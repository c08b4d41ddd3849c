"""How stiff a body on a mesh still is against a change of its shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from multiphase.stepping import StepFailure
from tumour.fem.arrays import FIELDS
from tumour.fem.newton import Step

if TYPE_CHECKING:
    from tumour.fem.scheme import MiniScheme

Array = NDArray[np.float64]

LOST = 0.02
"""Stiffness, over that at rest, below which a body that cannot go on is said to have lost its stability."""


def stiffness(scheme: MiniScheme, u: Array) -> tuple[float, int]:
    """The least stiffness of a state against a sudden change of shape, and the point of the mesh that this change moves most.

    Sudden: no fluid has time to flow and no cell to grow, so the volume of every part stays, and the pressure keeps it. The stiffness is
    the eigenvalue next to 0 of the linearised momentum balance, ``(dP, grad v) = s (d, v)``, with lumped masses; 0 is where
    the state buckles. The displacements that are held (`layout.RigidMotions`) are left out of the change, which makes the eigenvalues
    of free bodies slightly larger and leaves their signs.

    Raises
    ------
    StepFailure
        Where no eigenvalue is found.
    """
    newton, free = scheme.newton, scheme.newton.rows.free
    point = scheme.point(u)
    nothing = np.zeros_like(point.nodal), np.zeros_like(point.bubbles)
    memory = newton.memory
    try:
        newton.make(Step(0.0, *nothing, point), point)
        moves = free % FIELDS < 2
        root = np.sqrt(scheme.observation.weights)[free[moves] // FIELDS]

        def respond(v: Array) -> Array:
            forces = np.zeros(len(free))
            forces[moves] = root * v.ravel()
            response: Array = root * newton.linear.solve(forces)[moves]
            return response

        count = int(np.sum(moves))
        values, vectors = eigsh(LinearOperator((count, count), matvec=respond, dtype=float), k=1, which="LM", v0=np.ones(count), tol=1e-6)
    except ArpackError as error:
        raise StepFailure(f"no eigenvalue was found: {error}") from error
    finally:
        newton.recall(memory)
    mode = np.zeros(scheme.count * FIELDS)
    mode[free[moves]] = vectors[:, 0] / root
    sizes = np.hypot(*mode.reshape(-1, FIELDS)[:, :2].T)
    return 1.0 / float(values[0]), int(np.argmax(sizes))


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
        "at rest, so the equations have no solution near by from here on. A larger lambda_alpha keeps it stable."
    )
