"""What is stored of a state of the tumour on a mesh."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags_array
from scipy.sparse.linalg import cg

from multiphase.stepping import Snapshot
from tumour.fem import layout

if TYPE_CHECKING:
    from tumour.fem.scheme import MiniScheme

Array = NDArray[np.float64]

PROJECTION_TOLERANCE = 1e-12


class Observation:
    """Fields at the points of the mesh, and scalars.

    Areas and cells are those of the shape that the mesh approximates: those of the mesh times the ratio of both areas at rest, which is 1
    but for disks.

    Attributes
    ----------
    weights : (points,) array
        Integrals of the shape functions.
    """

    def __init__(self, scheme: MiniScheme) -> None:
        self._scheme = scheme
        self._mass = layout.mass_matrix(scheme.elements, scheme.count)
        self.weights = np.asarray(self._mass.sum(axis=1)).ravel()
        self._jacobi = diags_array(1.0 / self._mass.diagonal())
        self._share = scheme.body.area / float(np.sum(scheme.elements.areas))
        self._start = (1.0, 1.0)
        self.seconds = 0.0
        p = scheme.parameters
        self._levels = np.array([p.necrotic_level, p.C_hypoxic])

    def begin(self, u: Array) -> None:
        """Take `u` as what balances start from: cells and area."""
        moments = self._scheme.rest(u)[0]
        self._start = float(np.sum(moments[0])), float(np.sum(moments[1]))

    def project(self, moments: Array) -> Array:
        """The continuous linear function with these moments."""
        values, _ = cg(self._mass, moments, x0=moments / self.weights, rtol=PROJECTION_TOLERANCE, M=self._jacobi)
        projected: Array = values
        return projected

    def snapshot(self, t: float, u: Array) -> Snapshot:
        """What is stored of the vector `u`."""
        started = time.perf_counter()
        scheme = self._scheme
        point, (_, integrals, rate) = scheme.point(u), scheme.rest(u)
        sums, areas = np.zeros((3, scheme.count)), np.zeros(2)
        scheme.kernel["observe"](scheme.constants, scheme.elements, point.nodal, point.bubbles, self._levels, sums, areas)
        cells_0, area_0 = self._start
        cells, area = float(np.sum(sums[2])), float(np.sum(sums[0]))
        growth = float(rate[0])
        scalars = {
            "area": self._share * area,
            "cell_mass": self._share * cells,
            "doubling_time": np.log(2.0) * area / growth if growth > 1e-12 * area else np.nan,
            "C_min": float(point.nodal[:, 4].min()),
            "necrotic_fraction": float(areas[0]) / area,
            "hypoxic_fraction": float(areas[1]) / area,
            "defect_cells": (cells - cells_0 - float(integrals[0])) / max(cells, cells_0),
            "defect_volume": (area - area_0 - float(integrals[1])) / max(area, area_0),
        }
        if scheme.body.is_round:
            radius = float(scheme.body.radius * np.sqrt(area / area_0))
            round_only = {"growth_rate": 0.5 * growth / area * radius, "asymmetry": self._asymmetry(point.nodal)}
            scalars = {"radius": radius, **scalars, **round_only}
        fields = {
            "alpha": point.nodal[:, 2].copy(),
            "C": point.nodal[:, 4].copy(),
            "p": point.nodal[:, 3].copy(),
            "displacement": point.nodal[:, :2].copy(),
            "J": self.project(sums[0]),
            "stress_magnitude": np.maximum(self.project(sums[1]), 0.0),  # the projection of what falls steeply may undershoot
        }
        if scheme.mirror is not None:
            fields = scheme.mirror.spread(fields)
            scalars |= {name: scheme.mirror.copies * scalars[name] for name in ("area", "cell_mass")}
        self.seconds += time.perf_counter() - started
        return Snapshot(t, scalars, fields, None)

    def _asymmetry(self, nodal: Array) -> float:
        """Largest over least distance of the surface from the middle, less 1."""
        body = self._scheme.body
        distances = np.hypot(*(self._scheme.points[body.surface] + nodal[body.surface, :2]).T)
        return float(distances.max() / distances.min() - 1.0)
