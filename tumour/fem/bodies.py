"""The body of a scene in two dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.tensors import TensorFunction
from tumour import meshes
from tumour.fem.layout import elements_of
from tumour.fem.tissue import coordinates, data_of
from tumour.geometry import OF_AN_IMAGE, TumourGeometry
from tumour.meshes import Body
from tumour.meshes.polygons import Points
from tumour.parameters import TISSUE, TumourInitial, TumourParameters


def body_of(geometry: TumourGeometry, cells: int) -> Body:
    """The meshed body of a scene.

    Raises
    ------
    ParameterError
        For a file that cannot be read, or a mesh that cannot be used.
    """
    changed = 0
    if geometry.file is not None:
        path = Path(geometry.file)
        if not path.is_file():
            raise ParameterError("geometry.file", f"there is no file '{path}'.")
        changed = path.stat().st_mtime_ns
    try:
        return _body(geometry, cells, changed)
    except ParameterError as error:
        reason = str(error).removeprefix(f"{error.path}: ")
        if error.path == "geometry.size":
            raise ParameterError(
                "solver.cells", f"with {cells} cells the size of the triangles, {reason} More cells make them smaller."
            ) from None
        if error.path == "geometry.points" and geometry.file is not None:
            raise ParameterError("geometry.file", reason) from None
        raise


@lru_cache(maxsize=4)
def _body(geometry: TumourGeometry, cells: int, changed: int) -> Body:
    match geometry.kind:
        case "quarter_disk":
            return meshes.quarter_disk(geometry.radius, cells)
        case "disk":
            return meshes.disk(geometry.radius, cells)
        case "glioma":
            return meshes.glioma(geometry.radius, geometry.radius / cells)
        case "outline":
            loops, origin = _loops(geometry)
            size = meshes.inscribed(loops[0], loops[1:]) / cells
            return replace(meshes.outline(loops[0], size, loops[1:]), origin=origin)
    return meshes.from_gmsh(str(geometry.file), geometry.slide_x or (), geometry.slide_y or ())


def _loops(geometry: TumourGeometry) -> tuple[Sequence[Points], str]:
    """The closed polygons of an outline, and how they were made if they are those of an image."""
    if geometry.points is not None:
        return [np.array(loop) for loop in (geometry.points, *(geometry.holes or ()))], ""
    if not geometry.is_image:
        return _points(str(geometry.file)), ""
    from tumour.meshes.images import trace

    traced = trace(str(geometry.file), *(getattr(geometry, name) for name in OF_AN_IMAGE))
    return traced.loops, traced.origin


def _points(file: str) -> list[Points]:
    """Points of closed polygons from a table of two columns, with or without a line of names; empty lines part the polygons."""
    try:
        with open(file, encoding="utf-8-sig") as stream:
            lines = [line.strip() for line in stream if not line.lstrip().startswith("#")]
        first = next((k for k, line in enumerate(lines) if line), 0)
        if lines and any(character.isalpha() for character in lines[first].replace("e", "").replace("nan", "")):
            del lines[first]
        loops: list[list[list[float]]] = [[]]
        for line in lines:
            if line.strip(", \t"):
                loops[-1].append([float(cell) for cell in line.split(",")])
            elif loops[-1]:
                loops.append([])
        loops = [loop for loop in loops if loop or loop is loops[0]]
        points = [np.array(loop) for loop in loops]
    except (ValueError, OSError) as error:
        raise ParameterError("geometry.file", f"'{file}' is not a table of points, x and y in two columns with a comma: {error}.") from None
    for k, loop in enumerate(loops, 1):
        if len(loop) < 3 and len(loops) > 1:
            raise ParameterError(
                "geometry.file", f"in '{file}' loop {k} has {len(loop)} points; an empty line begins a new loop, which needs three or more."
            )
    return points


def check_fraction(initial: TumourInitial, body: Body) -> None:
    """Refuse a cell fraction that is not between 0 and 1 somewhere in the body, or not given everywhere in it."""
    _check_given(initial.alpha, "initial.alpha", body)
    alpha = fraction(initial, body)
    if np.any((alpha <= 0.0) | (alpha >= 1.0)):
        i = int(np.argmax(np.abs(alpha - 0.5)))
        x, y = body.mesh.p[:, i]
        raise ParameterError(
            "initial.alpha", f"alpha is {alpha[i]:.15g} at ({x:.6g}, {y:.6g}); it must be greater than 0 and below 1 everywhere."
        )


def check_tissue(parameters: TumourParameters, body: Body) -> None:
    """Refuse properties of the tissue that are out of their range somewhere in the body, or not given everywhere in it."""
    for name in TISSUE:
        value = getattr(parameters, name)
        for part in value.parts if isinstance(value, TensorFunction) else (value,):
            _check_given(part, part.path or f"parameters.{name}", body)
    data_of(parameters, elements_of(body.mesh), body.mesh.p.T, body.radius)


def _check_given(function: PositionFunction, path: str, body: Body) -> None:
    """Refuse a function that is not given in all of the body."""
    extent, reach = function.extent, float(np.max(np.hypot(*body.mesh.p)))
    if function.is_sampled and not body.is_round:
        raise ParameterError(
            path, "a Python function is sampled along the radius of a disk, and this body is none; give a formula in x, y or r."
        )
    if extent is not None and (extent[0] > 0.0 or extent[1] < reach * (1.0 - 1e-9)):
        raise ParameterError(
            path, f"its positions r go from {extent[0]:g} to {extent[1]:g}, but the body's from 0 to {reach:.6g}; give it for all of them."
        )


def fraction(initial: TumourInitial, body: Body) -> np.ndarray:
    """The initial cell fraction at the points of the mesh."""
    x, y = body.mesh.p
    return np.asarray(initial.alpha(**coordinates(x, y, body.radius)), dtype=float)
