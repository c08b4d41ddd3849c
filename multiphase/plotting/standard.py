"""The standard figure of a result."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure

from multiphase.errors import ParameterError
from multiphase.model import Panel
from multiphase.parameters import nearest
from multiphase.plotting.files import checked_path, write_picture
from multiphase.plotting.maps import MAPS, draw_map, draw_maps, map_height, map_legend
from multiphase.plotting.panels import DRAW, profile_legend
from multiphase.plotting.rest import draw_rest, rest_height
from multiphase.plotting.ring import draw_rings
from multiphase.plotting.style import STYLE, TITLE_WIDTH
from multiphase.plotting.view import ON_A_LINE, ON_TRIANGLES, View, spread_rows, view_of

if TYPE_CHECKING:
    from multiphase.result import Result

PICTURES = (".png", ".pdf", ".svg")
IN_AXES = DRAW | {"map": draw_map}
IN_ROWS = {"ring": draw_rings, "maps": draw_maps, "rest": draw_rest}
KINDS = (*DRAW, "ring", *ON_TRIANGLES, "rest")
ONE_NAME = ("spacetime", "ring", *ON_TRIANGLES)
ROW_HEIGHT, RING_HEIGHT = 2.35, 2.45  # inches
RING_GAP = 0.08  # inches around the rows of a figure with rings
MAP_WIDTH, MAP_MARGIN = 2.35, 0.85  # inches: of each of two maps in a row, and what its title and its axis take
MAPS_WIDTH, MAPS_MARGIN = 1.35, 0.7  # of each map of a row at several times


def _choose(view: View, panels: Sequence[Panel] | None) -> list[Panel]:
    """The panels that this result can show, one name to a panel of colours."""
    chosen = view.model.panels if panels is None else tuple(panels)
    for panel in chosen:
        if panel.kind not in KINDS:
            raise ParameterError("panels", f"there is no panel kind {panel.kind!r}{nearest(panel.kind, KINDS)} Kinds: {', '.join(KINDS)}.")
        missing = [] if panels is None else [name for name in panel.names if name not in view.values]
        if missing:
            raise ParameterError(
                "panels", f"the result holds no {missing[0]!r}{nearest(missing[0], view.values)} It holds {', '.join(view.values)}."
            )
        if panels is not None:
            _check_place(view, panel)
    split = [
        replace(panel, names=names)
        for panel in chosen
        for names in ([(name,) for name in panel.names] if panel.kind in ONE_NAME else [panel.names])
    ]
    drawable = [drawn for panel in split if (drawn := view.drawn(panel)) is not None]
    if not drawable:
        wanted = ", ".join(dict.fromkeys(name for panel in split for name in panel.names))
        raise ParameterError(
            "output.fields", f"the result holds nothing that its panels show ({wanted}); store at least one of these fields."
        )
    return drawable


def _check_place(view: View, panel: Panel) -> None:
    """Refuse a panel that was asked for and that this result has no place for."""
    if panel.kind == "ring" and view.edges is not None and view.inner is None:
        raise ParameterError("panels", 'the domain of this result is flat, so it has no rings to draw; use the kind "spacetime".')
    if panel.kind in ON_A_LINE and view.result.mesh is not None:
        raise ParameterError("panels", f'this result has two dimensions, so it has no {panel.kind} to draw; use the kind "map".')
    if panel.kind == "rest" and not view.marks.properties:
        raise ParameterError("panels", "the body of this result is the same everywhere at rest, so there is nothing to draw of it.")
    if panel.kind in ON_TRIANGLES and view.result.mesh is None:
        raise ParameterError("panels", f'this result has one dimension, so it has no {panel.kind} to draw; use the kind "profile".')
    if panel.kind in ON_TRIANGLES and view.body is None:
        raise ParameterError(
            "panels",
            "the result holds no 'displacement', without which the shape of the body is not known; add it to output.fields.",
        )


def _layout(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Panels by row: the body at rest, bodies by time, maps, then the others; two to a row, and bodies by time or at rest and rings in
    a row to themselves."""
    rows: list[list[Panel]] = []
    open_row: list[Panel] = []
    for panel in sorted(panels, key=lambda panel: {"rest": 0, "maps": 1, "map": 2}.get(panel.kind, 3)):
        if panel.kind in IN_ROWS:
            rows.append([panel])
        elif len(open_row) == 1 and (open_row[0].kind == "map") == (panel.kind == "map"):
            open_row.append(panel)
        else:
            open_row = [panel]
            rows.append(open_row)
    return rows


def _height(view: View, kind: str) -> float:
    """Inches of a row of panels."""
    if kind == "map":
        return MAP_MARGIN + map_height(view, [len(view.t) - 1], MAP_WIDTH)
    if kind == "maps":
        return MAPS_MARGIN + map_height(view, spread_rows(view.t, MAPS), MAPS_WIDTH)
    if kind == "rest":
        return rest_height(view)
    return RING_HEIGHT if kind == "ring" else ROW_HEIGHT


def figure(result: Result, *, panels: Sequence[Panel] | None = None) -> Figure:
    """Draw the standard figure of a result, in physical units where its scene has scales.

    Parameters
    ----------
    result : multiphase.Result
    panels : sequence of multiphase.model.Panel, optional
        What to draw; the model's own panels when not given, less those whose fields were not stored.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels to a row, 7 inches wide; the last of an odd number takes the whole row, and so do rings and maps at several times.
        Maps come first and are equally large, also the last of an odd number.

    Raises
    ------
    ParameterError
        When a given panel names what the result does not hold, or nothing is left to draw.
    """
    view = view_of(result)
    chosen = _choose(view, panels)
    with matplotlib.rc_context(STYLE):
        rows = _layout(chosen)
        heights = [_height(view, row[0].kind) for row in rows]
        picture = Figure(figsize=(7.0, 0.9 + sum(heights)), layout="constrained")
        FigureCanvasAgg(picture)
        if any(panel.kind in ("ring", "map") for panel in chosen):
            picture.get_layout_engine().set(h_pad=RING_GAP)  # type: ignore[union-attr,call-arg]
        body: SubFigure = picture.subfigures(1, 1, squeeze=True)  # type: ignore[assignment]
        grid = body.add_gridspec(len(rows), 2, height_ratios=heights)
        mapped = [index for index, row in enumerate(rows) if row[0].kind == "map"]
        # Maps have margins of their own.
        maps = grid[mapped[0] : mapped[-1] + 1, :].subgridspec(len(mapped), 2) if mapped else grid
        for index, row in enumerate(rows):
            for column, panel in enumerate(row):
                place = grid[index, column] if len(row) == 2 else grid[index, :]
                if panel.kind == "map":
                    place = maps[index - mapped[0], column]
                if panel.kind in IN_ROWS:
                    IN_ROWS[panel.kind](view, panel, body, place)
                    continue
                axes = body.add_subplot(place)
                axes.set_title(panel.title, loc="left", parse_math=False)
                IN_AXES[panel.kind](view, panel, axes)
        if any(panel.kind == "profile" for panel in chosen):
            profile_legend(view, body)
        map_legend(view, body, chosen)
        picture.suptitle(textwrap.fill(view.title, TITLE_WIDTH), parse_math=False)
        picture.supxlabel(view.footer(), parse_math=False, fontsize=8, color="0.3")
    return picture


def save_figure(result: Result, path: str | os.PathLike[str]) -> None:
    """Write the standard figure to a .png (200 dpi), .pdf or .svg file, replacing the file only once it is whole.

    Raises
    ------
    ParameterError
        For another suffix or a folder that does not exist, before anything is drawn.
    """
    target = checked_path(path, PICTURES, "a picture")
    write_picture(figure(result), target)
