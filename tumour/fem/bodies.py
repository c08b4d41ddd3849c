"""The body of a scene in two dimensions."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from multiphase.errors import ParameterError
from tumour import meshes
from tumour.geometry import TumourGeometry
from tumour.meshes import Body
from tumour.parameters import TumourInitial


def body_of(geometry: TumourGeometry, cells: int) -> Body:
    """The meshed body of a scene.

    Raises
    ------
    ParameterError
        For a file that cannot be read, or a mesh that cannot be used.
    """
    changed = 0.0
    if geometry.file is not None:
        path = Path(geometry.file)
        if not path.is_file():
            raise ParameterError("geometry.file", f"there is no file '{path}'.")
        changed = path.stat().st_mtime
    try:
        return _body(geometry, cells, changed)
    except ParameterError as error:
        reason = str(error).removeprefix(f"{error.path}: ")
        if error.path == "geometry.size":
            raise ParameterError(
                "solver.cells", f"with {cells} cells the size of the triangles, {reason} More cells make them smaller."
            ) from None
        if error.path == "geometry.points":
            raise ParameterError("geometry.file", reason) from None
        raise


@lru_cache(maxsize=4)
def _body(geometry: TumourGeometry, cells: int, changed: float) -> Body:
    match geometry.kind:
        case "quarter_disk":
            return meshes.quarter_disk(geometry.radius, cells)
        case "disk":
            return meshes.disk(geometry.radius, cells)
        case "glioma":
            return meshes.glioma(geometry.radius, geometry.radius / cells)
        case "outline":
            points = _points(str(geometry.file))
            return meshes.outline(points, meshes.inscribed(points) / cells)
    return meshes.from_gmsh(str(geometry.file), geometry.slide_x or (), geometry.slide_y or ())


def _points(file: str) -> np.ndarray:
    """Points of an outline from a table of two columns, with or without a line of names."""
    try:
        with open(file, encoding="utf-8-sig") as stream:
            lines = [line for line in stream if line.strip() and not line.lstrip().startswith("#")]
        if lines and any(character.isalpha() for character in lines[0].replace("e", "").replace("nan", "")):
            del lines[0]
        return np.array([[float(cell) for cell in line.split(",")] for line in lines])
    except (ValueError, OSError) as error:
        raise ParameterError("geometry.file", f"'{file}' is not a table of points, x and y in two columns with a comma: {error}.") from None


def check_fraction(initial: TumourInitial, body: Body) -> None:
    """Refuse a cell fraction that is not between 0 and 1 somewhere in the body, or not given everywhere in it."""
    reach = float(np.max(np.hypot(*body.mesh.p)))
    extent = initial.alpha.extent
    if initial.alpha.is_sampled and not body.is_round:
        raise ParameterError(
            "initial.alpha", "a Python function is sampled along the radius of a disk, and this body is none; give a formula in x, y or r."
        )
    if extent is not None and (extent[0] > 0.0 or extent[1] < reach * (1.0 - 1e-9)):
        raise ParameterError(
            "initial.alpha",
            f"its positions r go from {extent[0]:g} to {extent[1]:g}, but the body's from 0 to {reach:.6g}; give it for all of them.",
        )
    alpha = fraction(initial, body)
    if np.any((alpha <= 0.0) | (alpha >= 1.0)):
        i = int(np.argmax(np.abs(alpha - 0.5)))
        x, y = body.mesh.p[:, i]
        raise ParameterError(
            "initial.alpha", f"alpha is {alpha[i]:.15g} at ({x:.6g}, {y:.6g}); it must be greater than 0 and below 1 everywhere."
        )


def fraction(initial: TumourInitial, body: Body) -> np.ndarray:
    """The initial cell fraction at the points of the mesh."""
    x, y = body.mesh.p
    r = np.hypot(x, y)
    return np.asarray(initial.alpha(r=r, xi=r / body.radius, x=x, y=y, theta=np.arctan2(y, x)), dtype=float)
