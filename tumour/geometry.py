"""The shape of a tumour's body at rest, and how its deformation is described."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from multiphase.errors import ParameterError
from multiphase.parameters import parameter, validate
from tumour.equations import Number

LARGEST = 1e12
"""Largest size of a value, and one over the smallest of one that must not be 0; beyond it, the unit is wrong and squares overflow."""

_DIMENSIONS: Mapping[str, int] = {"slab": 1, "disk": 2, "quarter_disk": 2, "sphere": 3, "glioma": 2, "outline": 2, "mesh": 2}

RADIAL_KINDS = ("slab", "disk", "quarter_disk", "sphere")
"""Shapes whose fields may depend on the distance from the middle alone."""

FILE_KINDS = ("outline", "mesh")
"""Shapes that are read from a file; an outline may be given by points as well."""

IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".gif", ".jpg", ".jpeg", ".pbm", ".pgm", ".ppm", ".npy")
"""Endings of the names of files that are images; an outline in any other file is a table of points."""

OF_AN_IMAGE: Mapping[str, float | None] = {"pixel": None, "smoothing": 1.0, "threshold": 0.5, "smallest": 1e-3}
"""What goes with an image alone, and its default."""

_BALLS: Mapping[int, float] = {1: 2.0, 2: np.pi, 3: 4.0 * np.pi / 3.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class TumourGeometry:
    """The shape of the body at rest, and how its deformation is described.

    Attributes
    ----------
    kind : "disk", "quarter_disk", "sphere", "slab", "glioma", "outline" or "mesh"
        A disk in plane strain, whole or the quarter of it that slides on its straight sides; a ball; a layer that is as thick as two
        radii and the same to both sides of its middle, kept from moving sideways; a body with lobes, as a glioma has; the body within
        an outline, from `points`, a table or a segmented image; or that of a Gmsh mesh.
    radius : float
        Radius at rest; half the thickness of a slab; of a glioma, the radius of the largest circle within it. An outline and a mesh
        have their own size.
    dimension : "auto", "radial" or "2d"
        Whether fields depend on the distance from the centre alone; "auto" where they can.
    formulation : "lagrangian" or "eulerian"
        Cells as an elastic solid, on the body at rest, or as a viscous fluid, on the body as it is: two different materials.
    file : str
        For an outline, a table of its points (.csv, columns x and y; an empty line between the outline and each hole) or an image of the
        body (.png, .tif, ..., .npy), white on black; for a mesh, a Gmsh file.
    points : sequence of (float, float), or an array (n, 2), or None
        For an outline instead of a file.
    holes : sequence of sequences of (float, float), or None
        With `points`: outlines of the holes.
    pixel : float or None
        With an image: side of a pixel. The middle of the image is the origin, and y points upwards.
    smoothing : float or None
        With an image: standard deviation, in pixels, of the Gaussian with which the body is smoothed before its contour is taken, 1
        unless given. It moves a contour of curvature kappa inwards by about half its square times kappa.
    threshold : float or None
        With an image: brightness, from 0 for black to 1 for white, above which a pixel is of the body, 1/2 unless given.
    smallest : float or None
        With an image: parts and holes with less than this share of the body's area are specks and left out, 0.001 unless given.
    slide_x, slide_y : tuple of str or None
        Names (or numbers) of the physical lines of a mesh on which the body slides: straight sides that may not move in x, and in y.
    """

    kind: str = parameter("disk", symbol="-", choices=tuple(_DIMENSIONS), doc="the kind of geometry")
    radius: float = parameter(
        1.0, symbol="R_0", low=1.0 / LARGEST, high=LARGEST, source="1 by choice of the unit of length", doc="the radius at rest"
    )
    dimension: str = parameter("auto", symbol="-", choices=("auto", "radial", "2d"), doc="the dimension in which fields vary")
    formulation: str = parameter("lagrangian", symbol="-", choices=("lagrangian", "eulerian"), doc="the formulation")
    file: str | None = parameter(None, symbol="-", kind="file", doc="the file of the outline or mesh")
    points: tuple[tuple[float, float], ...] | None = parameter(None, symbol="-", kind="points", doc="the outline")
    holes: tuple[tuple[tuple[float, float], ...], ...] | None = parameter(None, symbol="-", kind="loops", doc="the holes")
    pixel: float | None = parameter(
        None, symbol="-", kind="number", low=1.0 / LARGEST, high=LARGEST, doc="the side of a pixel of the image"
    )  # fmt: skip
    smoothing: float | None = parameter(
        None, symbol="-", unit="pixels", kind="number", low=0.0, high=100.0, doc="the standard deviation of the smoothing"
    )
    threshold: float | None = parameter(
        None, symbol="-", kind="number", low=0.0, high=1.0, low_open=True, high_open=True, doc="the brightness above which a pixel is body"
    )
    smallest: float | None = parameter(
        None, symbol="-", kind="number", low=0.0, high=1.0, high_open=True, doc="the share of the body's area below which a part is a speck"
    )
    slide_x: tuple[str, ...] | None = parameter(None, symbol="-", kind="words", doc="the sides that may not move in x")
    slide_y: tuple[str, ...] | None = parameter(None, symbol="-", kind="words", doc="the sides that may not move in y")

    table: ClassVar[str] = "geometry"

    def __post_init__(self) -> None:
        validate(self, self.table)
        self._check_dimension()
        self._check_source()
        self._check_image()
        for name in ("slide_x", "slide_y"):
            if getattr(self, name) and self.kind != "mesh":
                raise ParameterError(f"{self.table}.{name}", f'has no meaning for kind = "{self.kind}": only a mesh has named sides.')
        if self.kind in FILE_KINDS and self.radius != 1.0:
            raise ParameterError(f"{self.table}.radius", f'has no meaning for kind = "{self.kind}", which has its own size; leave it out.')

    def _check_dimension(self) -> None:
        """Refuse a dimension that the shape or the formulation does not have."""
        if self.dimension == "radial" and self.kind not in RADIAL_KINDS:
            raise ParameterError(
                f"{self.table}.dimension", f'"radial" has no meaning for kind = "{self.kind}", which is not round; leave it out.'
            )
        if not self.plane:
            return
        if self.eulerian:
            name = "dimension" if self.dimension == "2d" else "formulation"
            why = 'the Eulerian formulation is for radial bodies alone; take formulation = "lagrangian".'
        elif self.m != 2:
            name = "dimension"
            why = f'"2d" has no meaning for a {self.kind}, which varies with the distance from its middle alone; leave it out.'
        else:
            return
        raise ParameterError(f"{self.table}.{name}", why)

    def _check_source(self) -> None:
        """Refuse a file or points that the shape has no use for, and the lack of both."""
        if self.kind in FILE_KINDS and self.file is None and self.points is None:
            also = ", or is given by points = [[x, y], ...]; name the file or give the points" if self.kind == "outline" else ""
            raise ParameterError(f"{self.table}.file", f'is missing: kind = "{self.kind}" is read from a file{also}.')
        if self.kind not in FILE_KINDS and self.file is not None:
            raise ParameterError(f"{self.table}.file", f"has no meaning for a {self.kind}.")
        for name in ("points", "holes"):
            if getattr(self, name) is None:
                continue
            if self.kind != "outline":
                raise ParameterError(f"{self.table}.{name}", f'has no meaning for kind = "{self.kind}": only an outline has points.')
            if self.file is not None:
                raise ParameterError(
                    f"{self.table}.{name}", "the outline is read from a file, and cannot be given here too; leave one out."
                )

    def _check_image(self) -> None:
        """Set what was not given of what goes with an image; refuse it where there is none."""
        suffix = Path(self.file).suffix if self.file is not None else ""
        is_image = self.kind == "outline" and suffix.lower() in IMAGE_SUFFIXES
        for name, default in OF_AN_IMAGE.items():
            value, path = getattr(self, name), f"{self.table}.{name}"
            if not is_image and value is not None:
                given = f" from a {suffix} file" if suffix else ""
                raise ParameterError(path, f'has no meaning for kind = "{self.kind}"{given}: only an outline from an image has pixels.')
            if is_image and value is None:
                if default is None:
                    raise ParameterError(path, "is missing: give the side of a pixel of the image in units of length.")
                object.__setattr__(self, name, default)

    @property
    def is_image(self) -> bool:
        """Whether the body is that of an image."""
        return self.pixel is not None

    @property
    def plane(self) -> bool:
        """Whether fields vary in two dimensions."""
        return self.dimension == "2d" or self.kind not in RADIAL_KINDS

    @property
    def m(self) -> int:
        """Dimension of the body: 1 for a slab, 3 for a sphere, else 2."""
        return _DIMENSIONS[self.kind]

    @property
    def eulerian(self) -> bool:
        """Whether the cells are a viscous fluid."""
        return self.formulation == "eulerian"

    @property
    def share(self) -> float:
        """The share of the full body that the scene's body is: 1/4 for a quarter disk, else 1."""
        return 0.25 if self.kind == "quarter_disk" else 1.0

    @property
    def unit_size(self) -> float:
        """Size of the scene's body of radius 1: 2 for a slab (a thickness), pi, pi/4, 4 pi/3."""
        return self.share * _BALLS[self.m]

    def size(self, radius: Number) -> Number:
        """Thickness, area or volume of the scene's body when its surface is at `radius`."""
        return self.unit_size * radius**self.m
