"""Pictures of a result, and what films share with them.

What is drawn comes from the model's panels and quantities, so any model with fields on a moving
interval is drawn by the same code. Everything is shown in physical units where the scene has scales.
Only Matplotlib's object-oriented interface is used: no display is needed and no figure stays in memory.
"""

from __future__ import annotations

import os
import textwrap
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.model import Model, Panel, find_model
from multiphase.parameters import Scales, nearest

if TYPE_CHECKING:
    from multiphase.result import Result

Array = NDArray[np.float64]

PICTURES = (".png", ".pdf", ".svg")
KINDS = ("scalar", "profile", "spacetime", "ring")
LINE_STYLES: tuple[Any, ...] = ("-", "--", ":", "-.")
ROW_HEIGHT, RING_HEIGHT = 2.35, 2.45  # inches
RING_GAP = 0.08  # inches around the rows of a figure with rings
TITLE_WIDTH = 75  # characters; Matplotlib's own wrapping takes two $ for mathematics, and fails
PROFILES = 6  # times shown in a profile panel
COLUMNS = 300  # time columns of a space-time picture, about the pixels it is printed with
RINGS = 4  # times shown in a ring panel
RING_PIXELS = 600  # across a cross-section
NAME_INCHES = 0.4  # for the name of what a ring encloses
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


@dataclass(frozen=True, slots=True)
class View:
    """A result in the units it is drawn in, without the times whose positions are not finite.

    Attributes
    ----------
    values : dict of str to ndarray
        Scalars (nt,) and, on a 1D grid, fields (nt, cells).
    edges, wall : ndarray (nt, cells + 1), (nt,), or None without a 1D grid
        Cell edges, and the outer end of the domain.
    inner : float or None
        Where the domain is the radius of a round body, the radius at its inner end; positions are measured from there.
    """

    result: Result
    model: Model
    title: str
    values: dict[str, Array]
    edges: Array | None
    wall: Array | None
    inner: float | None = None

    @property
    def t(self) -> Array:
        return self.result.t

    @property
    def outer_reach(self) -> float:
        """Half the side of the square that holds the round body at every time, with a margin."""
        assert self.wall is not None
        assert self.inner is not None
        return 1.05 * (self.inner + float(self.wall.max()))

    def drawable(self, panel: Panel) -> bool:
        if panel.kind == "ring" and self.inner is None:
            return False
        wanted = 1 if panel.kind == "scalar" else 2
        return all(name in self.values and self.values[name].ndim == wanted for name in panel.names)

    def symbol(self, name: str) -> str:
        quantity = self.model.quantities.get(name)
        return f"${quantity.symbol}$" if quantity else name.replace("$", r"\$")

    def label(self, *names: str) -> str:
        """Axis label, "symbol description [unit]"; several names share a label of symbols."""
        if len(names) > 1:
            return ", ".join(self.symbol(name) for name in names) + self.bracket(names[0])
        quantity = self.model.quantities.get(names[0])
        description = quantity.description if quantity else self.result.descriptions.get(names[0], "")
        return f"{self.symbol(names[0])} {textwrap.fill(description + self.bracket(names[0]), 32)}".strip()

    def bracket(self, name: str) -> str:
        return "" if self.result.unit(name) == "-" else f" [{self.result.unit(name)}]"

    def radius_label(self) -> str:
        return f"distance from\nthe centre{self.bracket('x')}"

    def time_label(self) -> str:
        return f"time t{self.bracket('t') or ' (dimensionless)'}"

    def time_text(self, time: str) -> str:
        return f"t = {time}" if self.result.unit("t") == "-" else f"t = {time} {self.result.unit('t')}"

    def footer(self) -> str:
        """How the run ended, and its last stored time."""
        when = self.time_text(time_texts(self.t[-1:])[0])
        status, message = self.result.status, self.result.message
        if status == "completed":
            return f"completed at {when}"
        ended = f"not finished, stored up to {when}" if status == "running" else f"{status} at {when}"
        return textwrap.fill(textwrap.shorten(f"{ended}. {message}" if message else ended, 220, placeholder=" ..."), 110)


def view_of(result: Result) -> View:
    model = find_model(result.model)
    tables = tomllib.loads(result.scene)
    title = tables.get("scene", {}).get("title") or model.title
    result = result.in_units()
    x, wall = result.x, result.width()
    keep = np.isfinite(result.t)
    if x is not None and wall is not None:
        keep = keep & np.isfinite(x).all(axis=1) & np.isfinite(wall)
    if not keep.any():
        raise ParameterError(
            "", "this result holds no time with finite positions, so there is nothing to draw; its message says how it ended."
        )
    result = replace(
        result,
        t=result.t[keep],
        x=None if x is None else x[keep],
        scalars={name: values[keep] for name, values in result.scalars.items()},
        fields={name: values[keep] for name, values in result.fields.items()},
    )
    if x is None or wall is None:
        return View(result, model, str(title), dict(result.scalars), None, None)
    x, wall = x[keep], wall[keep]
    edges = np.column_stack([np.zeros(len(x)), 0.5 * (x[:, 1:] + x[:, :-1]), wall])
    values = result.scalars | {name: field for name, field in result.fields.items() if field.shape == x.shape}
    return View(result, model, str(title), values, edges, wall, _inner_radius(model, tables))


def _inner_radius(model: Model, tables: dict[str, Any]) -> float | None:
    """Radius at the inner end of a round body, in the unit of positions."""
    inner = model.ring(tables.get("geometry", {}))
    if inner is None:
        return None
    factor, _ = Scales.from_table(tables.get("scales", {})).factor({"length": 1})
    return factor * float(inner)


def time_texts(times: Array) -> list[str]:
    """Times as text, with as many decimals as tell neighbours apart, scientific when all are very small or one is very large."""
    top = float(np.max(np.abs(times)))
    spacing = float(np.min(np.diff(times))) if len(times) > 1 else 0.1 * top
    if top == 0.0 or spacing <= 0.0:
        return [f"{time:g}" for time in times]
    if not 1e-3 <= top < 1e6:
        digits = int(np.clip(np.ceil(np.log10(top / spacing)) + 1, 3, 12))
        return [f"{time:.{digits}g}" for time in times]
    most = int(np.clip(1 - np.floor(np.log10(spacing)), 0, 8))
    least = next(d for d in range(most + 1) if all(round(time, d) == round(time, most) for time in times.tolist()))
    return [f"{time:.{least}f}" for time in times]


def limits(values: Array, margin: float = 0.05) -> tuple[float, float]:
    """Axis limits around the finite `values`; a constant gets room to either side instead of a picture of its rounding."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    size = max(abs(low), abs(high))
    if high - low <= 1e-9 * size or size == 0.0:
        room = 0.1 * size or 1.0
        return low - room, high + room
    return low - margin * (high - low), high + margin * (high - low)


def at_times(t: Array, values: Array, times: Array) -> Array:
    """`values` (nt, ...) at `times`, linear in time at fixed cell index."""
    if len(t) == 1:
        return np.repeat(values[:1], len(times), axis=0)
    right = np.clip(np.searchsorted(t, times, side="right"), 1, len(t) - 1)
    left = right - 1
    weight = ((times - t[left]) / (t[right] - t[left])).reshape(-1, *[1] * (values.ndim - 1))
    mixed = (1.0 - weight) * values[left] + weight * values[right]
    # A stored time is shown as stored, even where its neighbour is not a number.
    return np.where(weight == 0.0, values[left], np.where(weight == 1.0, values[right], mixed))


def colour_map() -> Colormap:
    """Even in lightness (also in grey and to colour-blind eyes); what is not a number is grey."""
    return matplotlib.colormaps["viridis"].with_extremes(bad="0.8")


def _spread_rows(t: Array, count: int) -> list[int]:
    """Indices of at most `count` stored times, about evenly spread in time, first and last included."""
    wanted = np.linspace(t[0], t[-1], count)
    return sorted({int(np.argmin(np.abs(t - time))) for time in wanted})


def _profile_colours(count: int) -> list[Any]:
    return [colour_map()(value) for value in (np.linspace(0.0, 0.9, count) if count > 1 else [0.0])]


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
        if panels is not None and panel.kind == "ring" and view.inner is None:
            raise ParameterError("panels", 'the domain of this result is flat, so it has no rings to draw; use the kind "spacetime".')
    split = [
        replace(panel, names=names)
        for panel in chosen
        for names in ([(name,) for name in panel.names] if panel.kind in ("spacetime", "ring") else [panel.names])
    ]
    drawable = [panel for panel in split if view.drawable(panel)]
    if not drawable:
        wanted = ", ".join(dict.fromkeys(name for panel in split for name in panel.names))
        raise ParameterError(
            "output.fields", f"the result holds nothing that its panels show ({wanted}); store at least one of these fields."
        )
    return drawable


def draw_lines(view: View, panel: Panel, axes: Axes, draw: Callable[[Axes, str, str, bool], None], rows: Any = slice(None)) -> None:
    """Lay out a panel of lines: an axis for each of at most two units, and line styles with a legend for several names.

    The axes span the values at the times `rows`.
    """
    groups: dict[str, list[str]] = {}
    for name in panel.names:
        quantity = view.model.quantities.get(name)
        groups.setdefault(str(sorted(quantity.dimension.items())) if quantity else view.result.unit(name), []).append(name)
    if len(groups) > 2:
        raise ParameterError("panels", f"one panel can show two units, but {', '.join(panel.names)} have {len(groups)}; split the panel.")
    for position, group in enumerate(groups.values()):
        side = axes if position == 0 else axes.twinx()
        if position:
            side.spines["right"].set_visible(True)
        for name in group:
            draw(side, name, LINE_STYLES[panel.names.index(name) % len(LINE_STYLES)], bool(position))
        side.set_ylim(*limits(np.concatenate([view.values[name][rows].ravel() for name in group])))
        side.set_ylabel(view.label(*group))
    if len(panel.names) > 1:
        place: Any = "best" if len(groups) == 1 else "lower right"  # "best" does not see the lines of the other axis
        styles = [Line2D([], [], color="black", linestyle=LINE_STYLES[i % len(LINE_STYLES)]) for i in range(len(panel.names))]
        axes.legend(styles, [view.symbol(name) for name in panel.names], loc=place, handlelength=2.4, framealpha=0.8)


def _draw_scalar(view: View, panel: Panel, axes: Axes) -> None:
    def draw(side: Axes, name: str, style: str, second: bool) -> None:
        marker = "o" if len(view.t) == 1 else ""
        side.plot(view.t, view.values[name], style, marker=marker, markersize=4, color="#b35806" if second else "black", label=name)

    draw_lines(view, panel, axes, draw)
    axes.set_xlim(*_time_limits(view.t))
    axes.set_xlabel(view.time_label())


def _draw_profile(view: View, panel: Panel, axes: Axes) -> None:
    positions, wall = view.result.x, view.wall
    assert positions is not None
    assert wall is not None
    rows = _spread_rows(view.t, PROFILES)

    def draw(side: Axes, name: str, style: str, second: bool) -> None:
        for row, colour, text in zip(rows, _profile_colours(len(rows)), time_texts(view.t[rows]), strict=True):
            side.plot(positions[row], view.values[name][row], style, color=colour, label=f"{name}, {view.time_text(text)}")

    draw_lines(view, panel, axes, draw, rows)
    axes.set_xlim(0.0, 1.05 * float(wall.max()))
    axes.set_xlabel(f"position x{view.bracket('x')}")


def _time_limits(t: Array) -> tuple[float, float]:
    return (float(t[0]), float(t[-1])) if t[-1] > t[0] else limits(t)


def _draw_spacetime(view: View, panel: Panel, axes: Axes) -> None:
    """Colour over time and position, up to the wall; white beyond it."""
    assert view.edges is not None
    assert view.wall is not None
    name = panel.names[0]
    axes.set_xlabel(view.time_label())
    axes.set_ylabel(f"position x{view.bracket('x')}")
    axes.set_xlim(*_time_limits(view.t))
    axes.set_ylim(0.0, 1.05 * float(view.wall.max()))
    if len(view.t) == 1:
        axes.text(0.5, 0.5, "needs two stored times", transform=axes.transAxes, ha="center", va="center")
        return
    times = np.linspace(view.t[0], view.t[-1], COLUMNS)
    if len(view.t) <= COLUMNS:
        times = np.union1d(times, view.t)
    edges = at_times(view.t, view.edges, times)
    rows = at_times(view.t, view.values[name], 0.5 * (times[1:] + times[:-1]))
    low, high = limits(view.values[name], margin=0.0)
    mesh = axes.pcolormesh(
        np.broadcast_to(times[:, None], edges.shape),
        edges,
        np.ma.masked_invalid(rows),
        cmap=colour_map(),
        vmin=low,
        vmax=high,
        rasterized=True,  # a vector file would otherwise hold every cell at every time
    )
    axes.plot(view.t, view.wall, color="black", linewidth=1.4, label="wall")
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, fraction=0.08)
    bar.set_label(view.label(name))


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


def _draw_rings(view: View, panel: Panel, body: SubFigure, place: SubplotSpec) -> None:
    """A row of cross-sections at times evenly spread, on one scale of lengths and one of colours."""
    assert view.edges is not None
    name = panel.names[0]
    rows = _spread_rows(view.t, RINGS)
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
    rings[0].name_hollow(view.model.ends[0].split(" | ")[0], 1.3)
    first.set_title(panel.title, loc="left", parse_math=False)
    bar = body.colorbar(rings[0].image, ax=[ring.image.axes for ring in rings], pad=0.02, aspect=12, shrink=0.85, panchor=False)
    bar.set_label(view.label(name))


def _layout(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Panels by row: rings have a row to themselves, the others are two to a row."""
    rows: list[list[Panel]] = []
    open_row: list[Panel] = []
    for panel in panels:
        if panel.kind == "ring":
            rows.append([panel])
        elif len(open_row) == 1:
            open_row.append(panel)
        else:
            open_row = [panel]
            rows.append(open_row)
    return rows


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
        Two panels to a row, 7 inches wide; the last of an odd number takes the whole row, and so do rings.

    Raises
    ------
    ParameterError
        When a given panel names what the result does not hold, or nothing is left to draw.
    """
    view = view_of(result)
    chosen = _choose(view, panels)
    draw = {"scalar": _draw_scalar, "profile": _draw_profile, "spacetime": _draw_spacetime}
    with matplotlib.rc_context(STYLE):
        rows = _layout(chosen)
        heights = [RING_HEIGHT if row[0].kind == "ring" else ROW_HEIGHT for row in rows]
        picture = Figure(figsize=(7.0, 0.9 + sum(heights)), layout="constrained")
        FigureCanvasAgg(picture)
        if RING_HEIGHT in heights:
            picture.get_layout_engine().set(h_pad=RING_GAP)  # type: ignore[union-attr,call-arg]
        body: SubFigure = picture.subfigures(1, 1, squeeze=True)  # type: ignore[assignment]
        grid = body.add_gridspec(len(rows), 2, height_ratios=heights)
        for index, row in enumerate(rows):
            for column, panel in enumerate(row):
                place = grid[index, column] if len(row) == 2 else grid[index, :]
                if panel.kind == "ring":
                    _draw_rings(view, panel, body, place)
                    continue
                axes = body.add_subplot(place)
                axes.set_title(panel.title, loc="left", parse_math=False)
                draw[panel.kind](view, panel, axes)
        if any(panel.kind == "profile" for panel in chosen):
            rows_shown = _spread_rows(view.t, PROFILES)
            lines = [Line2D([], [], color=colour, linewidth=2) for colour in _profile_colours(len(rows_shown))]
            texts = time_texts(view.t[rows_shown])
            body.legend(lines, texts, title=f"profiles at {view.time_label()}", loc="outside lower center", ncols=PROFILES, frameon=False)
        picture.suptitle(textwrap.fill(view.title, TITLE_WIDTH), parse_math=False)
        picture.supxlabel(view.footer(), parse_math=False, fontsize=8, color="0.3")
    return picture


def checked_path(path: str | os.PathLike[str], allowed: tuple[str, ...], what: str) -> Path:
    target = Path(path)
    if target.suffix.lower() not in allowed:
        raise ParameterError(
            "", f"cannot write {what} to {str(target)!r}: its name must end in {', '.join(allowed[:-1])} or {allowed[-1]}."
        )
    if not target.parent.is_dir():
        raise ParameterError("", f"cannot write {what} to {str(target)!r}: there is no folder {str(target.parent)!r}; create it first.")
    return target


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A sibling to write to, which takes the place of `target` once it is whole."""
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix.lower()}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def save_figure(result: Result, path: str | os.PathLike[str]) -> None:
    """Write the standard figure to a .png (200 dpi), .pdf or .svg file, replacing the file only once it is whole.

    Raises
    ------
    ParameterError
        For another suffix or a folder that does not exist, before anything is drawn.
    """
    target = checked_path(path, PICTURES, "a picture")
    picture = figure(result)
    with replacing(target) as part, matplotlib.rc_context(STYLE):
        picture.savefig(part, format=target.suffix.lower()[1:], dpi=200)
