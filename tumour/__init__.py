"""An avascular tumour: cells, fluid and oxygen in a body that grows, as a slab, a disk or a sphere.

from tumour import TumourParameters, simulate

result = simulate(TumourParameters(lambda_alpha=1.0), geometry="sphere", t_end=60.0)
print(result["radius"][-1], result["necrotic_radius"][-1])

Exact solutions are in `tumour.exact`.
"""

from __future__ import annotations

from tumour.boundary import BoundaryPart, TumourBoundary
from tumour.geometry import TumourGeometry
from tumour.model import simulate
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver

__all__ = ["BoundaryPart", "TumourBoundary", "TumourGeometry", "TumourInitial", "TumourParameters", "TumourSolver", "simulate"]
