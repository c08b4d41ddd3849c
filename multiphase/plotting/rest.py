"""What is given all over a body at rest: a row of small maps of the properties that differ from place to place."""

from __future__ import annotations

from math import ceil

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from multiphase.marks import Property
from multiphase.model import Panel
from multiphase.plotting.maps import EDGE, map_height
from multiphase.plotting.marks import Bars, Sides
from multiphase.plotting.style import colour_map
from multiphase.plotting.view import View, limits

ACROSS = 4  # maps to a row
WIDTH, MARGIN = 1.35, 0.95  # inches: of a map, and what its colour bar takes below it
BARS = 40  # about as many on a map of a tensor
LINE = 1.6  # width of the parts of the surface


def rest_height(view: View) -> float:
    """Inches of the rows of maps that there are."""
    return ceil(len(view.marks.properties) / ACROSS) * (MARGIN + map_height(view, [], WIDTH))


def draw_rest(view: View, panel: Panel, body: SubFigure, place: SubplotSpec) -> None:
    """Maps of the properties on the body at rest, each on a scale of its own."""
    found = list(view.marks.properties.values())
    grid = place.subgridspec(ceil(len(found) / ACROSS), ACROSS)
    for index, shown in enumerate(found):
        axes = body.add_subplot(grid[divmod(index, ACROSS)])
        _draw_property(view, shown, axes)
        if index == 0:
            axes.set_title(panel.title, loc="left", parse_math=False)


def _draw_property(view: View, shown: Property, axes: Axes) -> None:
    """A property in colour, with bars along the larger principal value of a tensor and a colour bar below."""
    assert view.body is not None
    rest = view.body.rest
    low, high = limits(shown.values, margin=0.0)
    triangles = Triangulation(rest[:, 0], rest[:, 1], view.body.triangles)
    colours = axes.tripcolor(triangles, shown.values, shading="gouraud", vmin=low, vmax=high, cmap=colour_map(), rasterized=True)
    axes.add_collection(LineCollection(list(rest[view.body.outline]), capstyle="round", **EDGE), autolim=False)
    if shown.directions is not None:
        Bars(axes, view.body, shown.directions, BARS).show(rest)
    Sides(axes, view.marks, LINE).show(rest)
    x, y = view.body.window([])
    axes.set(aspect="equal", xlim=x, ylim=y, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    bar = axes.figure.colorbar(colours, cax=axes.inset_axes((0.08, -0.1, 0.84, 0.06)), orientation="horizontal")
    bar.ax.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    bar.set_label(shown.label)
