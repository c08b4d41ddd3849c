"""Bodies that are their own mirror image, with all that is in them and acts on them: half or a quarter of them is solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from multiphase.parameters import specifications
from multiphase.series import TimeSeries
from tumour.boundary import BoundaryPart, TumourBoundary
from tumour.fem.arrays import DIFFUSIVITY, FIBRE, PERMEABILITY, PUSH, REINFORCEMENT
from tumour.fem.bodies import body_of, fraction
from tumour.fem.layout import elements_of
from tumour.fem.surface import Surface
from tumour.fem.tissue import coefficients
from tumour.geometry import RADIAL_KINDS
from tumour.meshes import Body
from tumour.meshes.body import make_body
from tumour.parameters import TumourInitial, TumourParameters
from tumour.reductions import has_radial_data

if TYPE_CHECKING:
    from multiphase.scene import Scene

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

CLOSE = 1e-9
"""How far a point may be from the image of another, over the size of the body."""
SAME = 1e-12
"""Relative difference of data, up to which they are rounding."""
_ALONG = ({"x": "displacement_x", "y": "displacement_y"}, {"x": "traction_x", "y": "traction_y"})


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """A part of a body of which the rest is images.

    Attributes
    ----------
    axes : str
        The coordinates that change their sign: "x", "y" or "xy".
    body : Body
        The part that is solved; it slides on the lines of symmetry.
    boundary : TumourBoundary
        The named parts of its surface.
    nodes : (points,) array of int
        Of which of its points each point of the whole body is the image.
    signs : (points, 2) array
        Of the displacement of that image.
    """

    axes: str
    body: Body
    boundary: TumourBoundary
    nodes: Numbers
    signs: Array

    @property
    def copies(self) -> int:
        """How many such parts make up the body."""
        return len(self.axes) * 2

    def spread(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """Fields on the points of the whole body."""
        return {name: values[self.nodes] * (self.signs if values.ndim == 2 else 1.0) for name, values in fields.items()}


def mirror_of_scene(scene: Scene) -> Mirror | None:
    """The part of a scene's body that is solved; None for all of it.

    With ``plan.reduce = false`` it is all of it, and for a disk whose data are the same in every direction: two dimensions are then wanted
    to see it lose its shape, which need not be done in pairs of images.
    """
    geometry = scene.geometry
    if not scene.plan.reduce or (geometry.kind in RADIAL_KINDS and has_radial_data(scene)):
        return None
    return mirror_of(body_of(geometry, scene.solver.cells), scene.boundary, scene.parameters, scene.initial)


def mirror_of(body: Body, boundary: TumourBoundary, parameters: TumourParameters, initial: TumourInitial) -> Mirror | None:
    """The smallest part of a body that stands for all of it, or None where no axis is one of symmetry.

    The mesh must be its own image in the x or the y axis, with no triangle across it, and so must the initial cell fraction, the tissue at
    the points of quadrature, and what the parts of the surface do.
    """
    found: Mirror | None = None
    for axis in "yx":
        at = body if found is None else found.body
        parts = boundary if found is None else found.boundary
        half = _half(at, parts, parameters, initial, axis)
        if half is not None and found is not None:
            half = replace(
                half, axes="xy", nodes=half.nodes[found.nodes], signs=found.signs * half.signs[found.nodes]
            )  # fmt: skip
        found = half or found
    return found


def _half(body: Body, boundary: TumourBoundary, parameters: TumourParameters, initial: TumourInitial, axis: str) -> Mirror | None:
    """The half of a body with a positive coordinate."""
    k = "xy".index(axis)
    flip = np.array([-1.0, 1.0]) if axis == "x" else np.array([1.0, -1.0])
    points, triangles = body.mesh.p.T, body.mesh.t.T.astype(np.int64)
    image = _image(body, points, triangles, flip)
    if image is None:
        return None
    near = CLOSE * np.ptp(points)
    kept = np.flatnonzero((points[triangles, k] >= -near).all(axis=1))
    if 2 * len(kept) != len(triangles):
        return None  # triangles lie across the line
    if not (_same_fraction(initial, body, image) and _same_tissue(parameters, body, kept, flip, axis)):
        return None
    surface = Surface(body, boundary, parameters)
    if not _same_surface(surface, image, axis):
        return None
    used = np.unique(triangles[kept])
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    on_line = used[np.abs(points[used, k]) <= near]
    slides = {"x": body.slide_x, "y": body.slide_y}
    slides[axis] = np.union1d(slides[axis], on_line)
    inside: dict[str, Numbers] = {name: number[np.intersect1d(nodes, used)] for name, nodes in slides.items()}
    placed = points[used].copy()
    placed[number[on_line], k] = 0.0
    half = make_body(
        placed, number[triangles[kept]], surface=number[np.intersect1d(body.surface, used)], slide_x=inside["x"], slide_y=inside["y"],
        radius=body.radius, area=0.5 * body.area, is_round=body.is_round, path="geometry",
        sides={name: number[edges[np.isin(edges, used).all(axis=1)]] for name, of in body.sides.items() if len(edges := body.edges[of])},
    )  # fmt: skip
    own = np.where(number >= 0, number, number[image])
    left = np.unique(surface.owner[np.isin(body.edges, used).all(axis=1)])
    parts = TumourBoundary(tuple(part for i, part in enumerate(surface.parts) if i in left))
    return Mirror(axis, half, parts, own, np.where((number >= 0)[:, None], 1.0, flip))


def _image(body: Body, points: Array, triangles: Numbers, flip: Array) -> Numbers | None:
    """The number of the image of each point, where the mesh, its surface and its sliding sides are their own images."""
    distance, image = cKDTree(points).query(points * flip)
    if distance.max() > CLOSE * np.ptp(points):
        return None
    count = np.array([len(points) ** 2, len(points), 1], dtype=np.int64)
    own, images = (np.sort(np.sort(corners, axis=1) @ count) for corners in (triangles, image[triangles]))
    sets = all(np.array_equal(np.sort(image[nodes]), np.sort(nodes)) for nodes in (body.surface, body.slide_x, body.slide_y))
    return image if sets and np.array_equal(own, images) else None


def _same_fraction(initial: TumourInitial, body: Body, image: Numbers) -> bool:
    alpha = fraction(initial, body)
    return bool(np.abs(alpha - alpha[image]).max() <= SAME)


def _same_tissue(parameters: TumourParameters, body: Body, kept: Numbers, flip: Array, axis: str) -> bool:
    """Whether the tissue is its own image: tensors with their product of axes turned round, and fibres."""
    el, points = elements_of(body.mesh), body.mesh.p.T
    at = np.einsum("qa,eai->eqi", el.points, points[el.triangles[kept]]).reshape(-1, 2)
    own, other = (coefficients(parameters, x, y, body.radius) for x, y in (at.T, (at * flip).T))
    fibres = np.any(own[:, [PUSH, REINFORCEMENT]]) or np.any(other[:, [PUSH, REINFORCEMENT]])
    for rows, sign in ((own, 1.0), (other, -1.0)):
        rows[:, [PERMEABILITY + 2, DIFFUSIVITY + 2]] *= sign
        a, b = rows[:, FIBRE].copy(), rows[:, FIBRE + 1].copy()
        rows[:, FIBRE], rows[:, FIBRE + 1] = (a * a, sign * a * b) if fibres else (0.0, 0.0)
    return bool(np.all(np.abs(own - other) <= SAME * np.maximum(1.0, np.abs(own))))


def _same_surface(surface: Surface, image: Numbers, axis: str) -> bool:
    """Whether each edge does what its image does, and each point has prescribed what its image has."""
    edges = surface.body.edges
    count = np.array([len(image), 1])
    keys, images = np.sort(edges, axis=1) @ count, np.sort(image[edges], axis=1) @ count
    order = np.argsort(keys)
    other = surface.owner[order[np.searchsorted(keys[order], images)]]
    for a, b in np.unique(np.column_stack([surface.owner, other]), axis=0):
        if (a < 0) != (b < 0) or (a >= 0 and not _mirrored(surface.parts[a], surface.parts[b], axis)):
            return False
    signs = np.ones(5)
    signs["xy".index(axis)] = -1.0
    if not np.array_equal(surface.prescribed, surface.prescribed[image]):
        return False
    times = (0.0, *surface.breaks)
    return all(np.array_equal(values, values[image] * signs) for values in (surface.values(t) for t in times))


def _mirrored(part: BoundaryPart, other: BoundaryPart, axis: str) -> bool:
    """Whether the image of what one part does is what the other does."""
    turned = {names[axis] for names in _ALONG}
    for name in specifications(part):
        if name in ("side", "where"):
            continue
        a, b = getattr(part, name), getattr(other, name)
        if name in turned and isinstance(a, TimeSeries) and isinstance(b, TimeSeries):
            same = a.times == b.times and all(v == -w for v, w in zip(a.values, b.values, strict=True))
        else:
            same = bool(a == b)
        if not same:
            return False
    return True
