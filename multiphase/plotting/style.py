"""How all pictures look."""

from __future__ import annotations

from typing import Any

import matplotlib
from matplotlib.colors import Colormap

LINE_STYLES: tuple[Any, ...] = ("-", "--", ":", "-.")
TITLE_WIDTH = 75  # characters; Matplotlib's own wrapping takes two $ for mathematics, and fails
STYLE: Any = {
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.title_fontsize": 8,
    "figure.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.3,
    "text.usetex": False,
}


def colour_map() -> Colormap:
    """Even in lightness (also in grey and to colour-blind eyes); what is not a number is grey."""
    return matplotlib.colormaps["viridis"].with_extremes(bad="0.8")
