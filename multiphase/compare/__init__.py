"""Differences between two results of a model, quantity by quantity, at their common times and positions.

From the outside inwards: `comparison` (what is compared with what), `report` (text, JSON) and `picture`, `differences` (numbers), `places`
(common times, cells, meshes). What a model says of its results is `multiphase.profiles`.
"""

from __future__ import annotations

from multiphase.compare.comparison import RINGS, compare, cost_of
from multiphase.compare.differences import Difference
from multiphase.compare.report import Comparison

__all__ = ["RINGS", "Comparison", "Difference", "compare", "cost_of"]
