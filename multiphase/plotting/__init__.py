"""Pictures of a result, and what films share with them.

What is drawn comes from the model's panels and quantities, so any model with fields on a moving
interval or on triangles that move is drawn by the same code. Everything is shown in physical units where the scene has scales.
Only Matplotlib's object-oriented interface is used: no display is needed and no figure stays in memory.

From the outside inwards: `standard` (the standard figure), `panels`, `ring` and `maps` (what stands in it), `view` (the numbers and words
that are shown), `style` (how all pictures look) and `files` (how they are written).
"""

from __future__ import annotations

from multiphase.plotting.maps import Map
from multiphase.plotting.ring import Ring, radius_axis
from multiphase.plotting.standard import figure, save_figure
from multiphase.plotting.style import STYLE, colour_map
from multiphase.plotting.view import View, view_of

__all__ = ["STYLE", "Map", "Ring", "View", "colour_map", "figure", "radius_axis", "save_figure", "view_of"]
