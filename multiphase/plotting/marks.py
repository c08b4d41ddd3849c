"""Marks on the maps of a body: bars along directions of its material, and parts of its surface in colour."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke

from multiphase.marks import Marks
from multiphase.plotting.spread import Places, cross, inside, places_over
from multiphase.plotting.view import Array, Body

BARS = 130  # about as many on a map
BAR_LENGTH = 0.6  # in distances between neighbours
UNITY = 0.5  # of the directions around a place, from 1 where they agree to 0 where they cancel: below it there is none to show
BAR: Any = {"color": "black", "linewidth": 0.8, "path_effects": [Stroke(linewidth=1.9, foreground="white"), Normal()]}
PART_COLOURS = ("#d55e00", "#56b4e9", "#cc79a7", "#e69f00", "#000000", "#999999")  # told apart by colour-blind eyes, none in the map
PART_WIDTH = 2.4
WORDS, LEGEND = 64, 104  # characters: of what a legend says of a part, and of all its columns beside each other
GAP = 7  # characters that a column of a legend takes besides its text


class Bars:
    """Short bars along directions of the material, on a body that moves.

    They are evenly spread over the body as it is shown first, less those that would reach beyond it, and then stay with the material.

    Parameters
    ----------
    axes : Axes
    body : Body
    directions : (points, 2) array
        Unit vectors in the body at rest; what is not a number is not shown.
    count : int
        About as many bars.
    """

    def __init__(self, axes: Axes, body: Body, directions: Array, count: int = BARS) -> None:
        self.body, self.directions, self.count = body, directions, count
        self.places: Places | None = None
        self.area = 0.0
        self.artist = LineCollection([], capstyle="butt", zorder=2.5, **BAR)
        axes.add_collection(self.artist, autolim=False)

    def show(self, positions: Array) -> None:
        """Move the bars with the points of the body to `positions` (points, 2)."""
        area = _area(self.body, positions)
        if self.places is None:
            self.places, self.area = places_over(self.body, positions, self.count), area
            if self.places is None:
                return
            ends = self._bars(positions, 1.0)
            within = np.asarray(inside(ends.reshape(-1, 2), positions[self.body.outline]).reshape(-1, 2).all(axis=1))
            self.places = self.places.some(within)
        self.artist.set_segments(list(self._bars(positions, float(np.sqrt(area / self.area)))))

    def _bars(self, positions: Array, scale: float) -> Array:
        """Both ends of the bar at each place, (places, 2, 2); not numbers where no direction is shown."""
        assert self.places is not None
        a = pushed(self.body, positions, self.directions)
        doubled = self.places.of(np.column_stack([a[:, 0] ** 2 - a[:, 1] ** 2, 2.0 * a[:, 0] * a[:, 1]]))  # the same for a and -a
        angle = 0.5 * np.arctan2(doubled[:, 1], doubled[:, 0])
        with np.errstate(invalid="ignore"):
            angle[~(np.hypot(*doubled.T) >= UNITY)] = np.nan
        half = 0.5 * scale * BAR_LENGTH * self.places.step * np.column_stack([np.cos(angle), np.sin(angle)])
        middles = self.places.of(positions)
        return np.stack([middles - half, middles + half], axis=1)


def pushed(body: Body, positions: Array, directions: Array) -> Array:
    """Directions (points, 2) in the body at rest as they are with its points at `positions`: unit vectors along F a_0.

    F, one to a triangle, is averaged over the triangles around a point, by their areas at rest.
    """
    corners, moved = body.rest[body.triangles], positions[body.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    along, beside = moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0]
    # F = [along, beside] [first, second]^-1, times twice the area
    columns = [along * second[:, 1:] - beside * first[:, 1:], beside * first[:, :1] - along * second[:, :1]]
    weighted = np.repeat(np.stack(columns, axis=-1).reshape(-1, 4) * np.sign(cross(first, second))[:, None], 3, axis=0)
    count, corner = len(body.rest), body.triangles.ravel()
    F = np.column_stack([np.bincount(corner, weights=part, minlength=count) for part in weighted.T]).reshape(-1, 2, 2)
    a = np.einsum("pij,pj->pi", F, directions)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(a / np.hypot(*a.T)[:, None])


def _area(body: Body, positions: Array) -> float:
    corners = positions[body.triangles]
    return 0.5 * float(np.abs(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum())


class Sides:
    """The parts of the surface as thick coloured lines, on a body that moves."""

    def __init__(self, axes: Axes, marks: Marks, width: float = PART_WIDTH) -> None:
        self.lines: dict[str, tuple[Any, LineCollection]] = {}
        for (name, part), style in zip(marks.parts.items(), _styles(marks, width), strict=True):
            artist = LineCollection([], capstyle="round", zorder=2.8, label=name, **style)
            axes.add_collection(artist, autolim=False)
            self.lines[name] = part.edges, artist

    def show(self, positions: Array) -> None:
        """Move the lines with the points of the body to `positions` (points, 2)."""
        for edges, artist in self.lines.values():
            artist.set_segments(list(positions[edges]))


def _styles(marks: Marks, width: float) -> list[dict[str, Any]]:
    """How the lines of the parts look: colours that come round again after six."""
    edge = [Stroke(linewidth=width + 0.9, foreground="black"), Normal()]
    colours = (PART_COLOURS[i % len(PART_COLOURS)] for i in range(len(marks.parts)))
    return [{"color": colour, "linewidth": width, "path_effects": edge} for colour in colours]


def legend_of(marks: Marks, *, bars: bool) -> tuple[list[Line2D], list[str]]:
    """Lines and texts that say what the marks are; `bars`, whether directions are among them."""
    lines, texts = [], []
    if bars and marks.directions is not None:
        lines, texts = [Line2D([], [], **BAR)], [marks.name]
    for (name, part), style in zip(marks.parts.items(), _styles(marks, PART_WIDTH), strict=True):
        lines.append(Line2D([], [], **style))
        texts.append(textwrap.shorten(f"{name}: {part.words}" if part.words else name, WORDS, placeholder=" ..."))
    return lines, texts


def columns_of(texts: list[str], room: int = LEGEND) -> int:
    """Columns that a legend of these texts has room for, all as wide as the longest."""
    return max(1, min(len(texts), room // (max(map(len, texts), default=0) + GAP)))
