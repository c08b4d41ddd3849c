"""Cross-sections of round bodies."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D

from multiphase.model import Panel
from multiphase.plotting.style import colour_map
from multiphase.plotting.view import Array, View, limits, spread_rows, time_texts

RINGS = 4  # times shown in a ring panel
RING_PIXELS = 600  # across a cross-section
NAME_INCHES = 0.4  # for the name of what a ring encloses


class Ring:
    """The cross-section of a round body on `axes`: a field in colour, between the outlines of its inner and outer end.

    An image looks up the value at the distance of each pixel from the centre and is cut to the outline, so it costs as much for a
    thousand cells as for ten, and its edges stay sharp.

    Parameters
    ----------
    view : View
        Of a round body; its `inner` is a number.
    name : str
        The field; the colours span its values at all stored times.
    axes : Axes
        Takes limits that hold the body at every time, equal in both directions.
    """

    def __init__(self, view: View, name: str, axes: Axes) -> None:
        assert view.inner is not None
        self.inner, reach = view.inner, view.outer_reach
        across = (np.arange(RING_PIXELS) + 0.5) / RING_PIXELS * 2.0 - 1.0
        self._steps = np.linspace(0.0, np.sqrt(2.0) * reach, 2 * RING_PIXELS)
        radii = reach * np.hypot(across[:, None], across[None, :])
        self._nearest = np.rint(radii / self._steps[1]).astype(np.intp)
        low, high = limits(view.values[name], margin=0.0)
        extent = (-reach, reach, -reach, reach)
        self.image = axes.imshow(np.zeros_like(radii), cmap=colour_map(), vmin=low, vmax=high, extent=extent, origin="lower")
        self.outline = PathPatch(_ring_outline(0.0, reach), fill=False, edgecolor="black", linewidth=0.8)
        axes.add_patch(self.outline)
        self.image.set_clip_path(self.outline)
        axes.set(aspect="equal", xlim=(-reach, reach), ylim=(-reach, reach))
        for side in axes.spines.values():
            side.set_visible(False)

    def show(self, edges: Array, values: Array) -> None:
        """Show `values` (cells,) between the `edges` (cells + 1,), distances from the inner end."""
        cells = np.searchsorted(edges[1:-1] + self.inner, self._steps)
        self.image.set_data(np.ma.masked_invalid(values[cells])[self._nearest])
        self.outline.set_path(_ring_outline(self.inner, self.inner + float(edges[-1])))

    def name_hollow(self, text: str, side: float) -> None:
        """Write what the ring encloses into it, or beside the ring with a line to the centre where there is no room.

        Parameters
        ----------
        text : str
        side : float
            About the side of the axes, in inches.
        """
        axes = self.image.axes
        if not text or self.inner == 0.0:
            return
        if self.inner * side >= NAME_INCHES * axes.get_xlim()[1]:
            axes.text(0.0, 0.0, text, ha="center", va="center", parse_math=False)
            return
        line = {"arrowstyle": "-", "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate(text, (0.0, 0.0), (0.04, 1.0), textcoords="axes fraction", va="top", arrowprops=line, parse_math=False)


def _ring_outline(inner: float, outer: float) -> Outline:
    """Circles about the origin, the inner one mirrored and so run the other way, which leaves it out of the fill."""
    circle = Outline.unit_circle()
    circles = [circle.transformed(Affine2D().scale(outer))]
    if inner > 0.0:
        circles.append(circle.transformed(Affine2D().scale(-inner, inner)))
    return Outline.make_compound_path(*circles)


def radius_axis(view: View, axes: Axes) -> None:
    """A vertical axis through the centre, with distances from it in both directions."""
    axes.set_xticks([])
    axes.spines["left"].set_visible(True)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], symmetric=True))
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    axes.set_ylabel(view.radius_label())


def draw_rings(view: View, panel: Panel, body: SubFigure, place: SubplotSpec) -> None:
    """A row of cross-sections at times evenly spread, on one scale of lengths and one of colours."""
    assert view.edges is not None
    name = panel.names[0]
    rows = spread_rows(view.t, RINGS)
    grid = place.subgridspec(1, RINGS)
    rings = []
    for column, (row, text) in enumerate(zip(rows, time_texts(view.t[rows]), strict=True)):
        axes = body.add_subplot(grid[column], anchor="W")
        ring = Ring(view, name, axes)
        ring.show(view.edges[row], view.values[name][row])
        rings.append(ring)
        axes.set(xticks=[], yticks=[], xlabel=view.time_text(text))
    first = rings[0].image.axes
    radius_axis(view, first)
    rings[0].name_hollow(view.hollow, 1.3)
    first.set_title(panel.title, loc="left", parse_math=False)
    bar = body.colorbar(rings[0].image, ax=[ring.image.axes for ring in rings], pad=0.02, aspect=12, shrink=0.85, panchor=False)
    bar.set_label(view.label(name))
