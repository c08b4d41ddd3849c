"""An early atherosclerotic plaque: macrophages, a necrotic phase and modified LDL on a domain that grows.

from plaque1d import PlaqueInitial, PlaqueParameters, simulate

result = simulate(PlaqueParameters.preset("mouse"), initial=PlaqueInitial.preset("mouse"), t_end=1.7e4)
print(result["L"][-1])
"""

from __future__ import annotations

from plaque1d.model import simulate
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters, PlaqueSolver

__all__ = ["PlaqueGeometry", "PlaqueInitial", "PlaqueParameters", "PlaqueSolver", "simulate"]
