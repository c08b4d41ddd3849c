"""What a run on a mesh is watched for: that the body stays one that the model is about."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from multiphase.stepping import Snapshot, State, Tracker
from tumour.meshes import Body
from tumour.meshes.body import boundary_edges
from tumour.meshes.polygons import first_crossing

logger = logging.getLogger("multiphase")

LEAST_ASYMMETRY = 0.02
"""Asymmetry of a disk that cannot be an error of its mesh, after t = 0: there the fluid that enters the outermost triangles at once, where
cells press from the first, may leave them as uneven as they are."""
LEAST_SHORTAGE = 1e-3
"""Oxygen below 0, over the largest, that is warned about."""


class Shape(Tracker):
    """Warns, once for each, when a disk is no longer round, when the surface of a body crosses itself, and when oxygen falls below 0.

    Parameters
    ----------
    body : Body
    is_uniform : bool
        Whether the body starts the same in all directions.
    """

    def __init__(self, body: Body, *, is_uniform: bool) -> None:
        self._points: NDArray[np.float64] = body.mesh.p.T
        self._edges = boundary_edges(body.mesh.t.T)
        self._watches_symmetry, self._watches_surface, self._watches_oxygen = body.is_round and is_uniform, True, True

    def on_save(self, state: State, snapshot: Snapshot) -> None:
        if self._watches_symmetry and snapshot.t > 0.0 and snapshot.scalars["asymmetry"] > LEAST_ASYMMETRY:
            self._watches_symmetry = False
            logger.warning(
                "asymmetry = %.2g at t = %.6g: the disk has lost its round shape. An elastic disk buckles where nothing but its shear "
                "modulus resists growth, and errors of the mesh say into which form; a larger lambda_alpha keeps it round.",
                snapshot.scalars["asymmetry"],
                snapshot.t,
            )
        oxygen = snapshot.fields["C"]
        if self._watches_oxygen and oxygen.min() < -LEAST_SHORTAGE * np.abs(oxygen).max():
            self._watches_oxygen = False
            x, y = self._points[int(np.argmin(oxygen))]
            logger.warning(
                "oxygen is %.2g, below 0, near (%.3g, %.3g) of the body at rest at t = %.6g: more is drawn out than there is, or the "
                "triangles are too wide for the layer in which it is taken up; more cells make them smaller.",
                oxygen.min(),
                x,
                y,
                snapshot.t,
            )
        if self._watches_surface:
            points = self._points + snapshot.fields["displacement"]
            crossing = first_crossing(points, self._edges)
            if crossing is not None:
                self._watches_surface = False
                x, y = points[self._edges[crossing[0]]].mean(axis=0)
                logger.warning(
                    "the surface crosses itself near (%.3g, %.3g) at t = %.6g: parts of the body overlap from here on, as the model knows "
                    "no contact between them.",
                    x,
                    y,
                    snapshot.t,
                )
