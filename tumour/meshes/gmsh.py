"""Bodies from Gmsh files (formats 2.2 and 4.1), read by meshio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multiphase.errors import ParameterError
from multiphase.parameters import nearest
from tumour.meshes.body import Body, boundary_edges, check, doubled_areas, make_body
from tumour.meshes.polygons import Numbers, Points, inscribed_radius

PATH = "geometry.file"

STRAIGHT = 1e-6
"""How far the nodes of a sliding side may lie off their line, over the size of the body."""

_FLAT = ("vertex", "line", "triangle")


def from_gmsh(path: str | Path, slide_x: Sequence[str] = (), slide_y: Sequence[str] = ()) -> Body:
    """The body that the triangles of a Gmsh file make up.

    Parameters
    ----------
    path : str or pathlib.Path
        A file in format 2.2 or 4.1, text or binary, with triangles of three nodes in the plane z = 0.
    slide_x, slide_y : sequence of str
        Physical groups of lines on which the body slides: those that may not move in x, on lines x = const, and in y. They are named as in
        the file, or by their number ("31"). All other boundary edges are free surface.

    Raises
    ------
    ParameterError
        At ``geometry.file`` for a file that cannot be read or used, at ``geometry.slide_x`` or ``geometry.slide_y`` for a side that does
        not exist or is not straight.
    """
    mesh = _read(Path(path))
    points, triangles, number = _plane(mesh)
    groups = _groups(mesh, number)
    boundary = boundary_edges(triangles)
    slides = {"x": np.empty((0, 2), dtype=np.int64), "y": np.empty((0, 2), dtype=np.int64)}
    for axis, names in (("x", slide_x), ("y", slide_y)):
        if isinstance(names, str):
            names = (names,)
        found = [_side(str(name), groups, boundary, points, axis) for name in names]
        slides[axis] = np.concatenate((slides[axis], *found))
    keys = np.sort(boundary, axis=1) @ np.array([len(points), 1])
    sliding = np.sort(np.concatenate((slides["x"], slides["y"])), axis=1) @ np.array([len(points), 1])
    free = boundary[~np.isin(keys, sliding)]
    if not len(free):
        raise ParameterError(PATH, "all sides slide, and no free surface is left; oxygen enters through a free surface.")
    check(points, triangles, PATH)
    radius = inscribed_radius(points, points[free], points[boundary])
    return make_body(
        points,
        triangles,
        surface=free,
        slide_x=slides["x"],
        slide_y=slides["y"],
        radius=radius,
        sides={"surface": free, **groups},
        path=PATH,
    )


def _read(path: Path) -> Any:
    """The file as meshio gives it."""
    try:
        import meshio
    except ImportError:
        raise ParameterError(PATH, 'reading a Gmsh file needs meshio; install it with: pip install "multiphase-tissue[mesh]"') from None
    if not path.is_file():
        raise ParameterError(PATH, f"there is no file {path}.")
    try:
        return meshio.read(path, file_format="gmsh")
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ParameterError(PATH, f"{path} cannot be read as a Gmsh file of format 2.2 or 4.1: {reason}") from None


def _plane(mesh: Any) -> tuple[Points, Numbers, Numbers]:
    """Nodes in use, triangles turned counterclockwise, and the new number of each node of the file (-1 where it has none)."""
    kinds = {block.type for block in mesh.cells}
    quadratic = sorted(kind for kind in kinds if kind not in _FLAT and kind.startswith(("triangle", "line")))
    if quadratic:
        raise ParameterError(PATH, f'it has elements of higher order ("{quadratic[0]}"); write it with Mesh.ElementOrder = 1.')
    other = sorted(kinds.difference(_FLAT))
    if other:
        raise ParameterError(PATH, f'it has elements of type "{other[0]}"; the body must be made of triangles alone.')
    blocks = [block.data for block in mesh.cells if block.type == "triangle"]
    if not blocks:
        raise ParameterError(PATH, "it has no triangles; save the surface too (in Gmsh, give it a physical group or Mesh.SaveAll = 1).")
    triangles = np.concatenate(blocks).astype(np.int64)
    used = np.unique(triangles)
    points = np.asarray(mesh.points, dtype=float)[used]
    if not np.isfinite(points).all():
        bad = used[np.argmin(np.isfinite(points).all(axis=1))]
        raise ParameterError(PATH, f"node {bad + 1} has a coordinate that is no finite number.")
    if points.shape[1] == 3:
        flat = np.abs(points[:, 2]) <= 1e-12 * np.ptp(points, axis=0).max()
        if not flat.all():
            k = int(np.argmin(flat))
            raise ParameterError(PATH, f"node {used[k] + 1} has z = {points[k, 2]:g}; the body must lie in the plane z = 0.")
    points = np.ascontiguousarray(points[:, :2])
    number = np.full(len(mesh.points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    triangles = number[triangles]
    clockwise = doubled_areas(points, triangles) < 0.0
    triangles[clockwise] = triangles[clockwise][:, [0, 2, 1]]
    return points, triangles, number


def _groups(mesh: Any, number: Numbers) -> Mapping[str, Numbers]:
    """Edges of the physical groups of lines, by name and by number."""
    names = {int(tag): name for name, (tag, dimension) in mesh.field_data.items() if int(dimension) == 1}
    tags = mesh.cell_data.get("gmsh:physical", [np.zeros(len(block.data), dtype=np.int64) for block in mesh.cells])
    edges: dict[int, list[Numbers]] = {}
    for block, block_tags in zip(mesh.cells, tags, strict=True):
        if block.type == "line":
            for tag in np.unique(block_tags):
                if tag != 0:
                    edges.setdefault(int(tag), []).append(number[block.data[block_tags == tag]])
    found = {names[tag]: np.concatenate(parts) for tag, parts in edges.items() if tag in names}
    for tag, parts in edges.items():
        found.setdefault(str(tag), np.concatenate(parts))
    return found


def _side(name: str, groups: Mapping[str, Numbers], boundary: Numbers, points: Points, axis: str) -> Numbers:
    """The edges of a side on which the body slides, which must be straight and on the boundary."""
    where = f"geometry.slide_{axis}"
    if name not in groups:
        named = ", ".join(f'"{known}"' for known in groups)
        listed = f" The file's groups of lines are {named}." if named else " The file has no physical groups of lines."
        raise ParameterError(where, f'the file has no group of lines "{name}"{nearest(name, groups)}{listed}')
    edges = groups[name]
    keys = np.array([len(points), 1])
    outside = (edges < 0).any(axis=1) | ~np.isin(np.sort(edges, axis=1) @ keys, np.sort(boundary, axis=1) @ keys)
    if outside.any():
        raise ParameterError(where, f'{int(outside.sum())} of the {len(edges)} lines of "{name}" are no side of the body\'s boundary.')
    along = points[edges.ravel(), "xy".index(axis)]
    low, high = along.min(), along.max()
    if high - low > STRAIGHT * np.ptp(points, axis=0).max():
        raise ParameterError(
            where, f'"{name}" must lie on a straight line {axis} = const, but its nodes have {axis} from {low:.6g} to {high:.6g}.'
        )
    return edges
