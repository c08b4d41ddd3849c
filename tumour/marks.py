"""What the pictures of a tumour in two dimensions show of its tissue and of its surface: fibres, properties, named parts."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.marks import Marks, Part, Property
from multiphase.parameters import from_table
from multiphase.scales import Scales
from multiphase.series import TimeSeries
from tumour.boundary import CLOSED, OUTSIDE, BoundaryPart, TumourBoundary, acts
from tumour.geometry import FILE_KINDS, TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters

if TYPE_CHECKING:
    from multiphase.mesh import Mesh
    from multiphase.result import Result

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

SAME = 1e-9
"""Relative difference up to which values count as the same: they are computed to about 1e-15, and a picture shows 1e-2."""

SCALARS = {
    "stiffness": "stiffness $m$", "consumption": "consumption $w$", "fibre_ratio": r"fibre ratio $\rho$",
    "fibre_stiffness": "fibre stiffness $k_f$",
}  # fmt: skip
TENSORS = {"permeability": "permeability $K$", "diffusivity": "diffusivity $D$"}


def marks_of(result: Result) -> Marks:
    """The fibres, parts of the surface and properties that the scene of a result names; nothing for the paper's tissue, free all round,
    and where the scene cannot be read any more."""
    if result.mesh is None or not result.scene:
        return Marks()
    tables = tomllib.loads(result.scene)
    try:
        return _Scene(tables, result.mesh, result.unit("points") != "-").marks()
    except ParameterError:  # a picture of the fields is better than none
        return Marks()


class _Scene:
    """What a scene says of tissue and surface, on the mesh of its result.

    Parameters
    ----------
    tables : mapping
    mesh : Mesh
    in_units : bool
        Whether the mesh is in the unit of length of the scene's scales; what a scene says is dimensionless.
    """

    def __init__(self, tables: Mapping[str, Any], mesh: Mesh, in_units: bool) -> None:
        self.scales = Scales.from_table(tables.get("scales", {}))
        self.parameters = from_table(TumourParameters, tables.get("parameters", {}), "parameters")
        self.initial = from_table(TumourInitial, tables.get("initial", {}), "initial")
        self.geometry = from_table(TumourGeometry, tables.get("geometry", {}), "geometry")
        self.boundary = TumourBoundary.from_table(tables.get("boundary", {}))
        self.mesh, self.points = mesh, mesh.points / (self.scales.factor({"length": 1})[0] if in_units else 1.0)

    def marks(self) -> Marks:
        p = self.parameters
        if p.is_plain and self.boundary.is_plain and self.initial.alpha.constant is not None:
            return Marks()
        self.at = self._coordinates(self.points)
        return Marks(directions=self._directions(), parts=self._parts(), properties=self._properties())

    def _coordinates(self, points: Array) -> dict[str, Array]:
        """What functions of position and the formulas of parts may use."""
        x, y = points.T
        r = np.hypot(x, y)
        return {"x": x, "y": y, "r": r, "theta": np.arctan2(y, x), "xi": r / self._radius()}

    def _radius(self) -> float:
        """Of the body; of one from a file that of the largest circle within the mesh, or without its sides that slide nearly that."""
        if self.geometry.kind not in FILE_KINDS:
            return self.geometry.radius
        from tumour.meshes.body import boundary_edges
        from tumour.meshes.polygons import inscribed_radius

        names = {name for part in self.boundary for name in (part.formula.names if part.where is not None else ())}
        p = self.parameters
        for function in (self.initial.alpha, *(getattr(p, name) for name in (*SCALARS, *TENSORS, "fibre_angle"))):
            names |= function.names
        if "xi" not in names:
            return 1.0
        return inscribed_radius(self.points, self.points[boundary_edges(self.mesh.triangles)])

    # -- Tissue ----------------------------------------------------------------------------------------------------------

    def _directions(self) -> Array | None:
        """Directions of the fibres at rest, where there are any."""
        p = self.parameters
        matter = self._differs_from(p.fibre_ratio, 1.0) or self._differs_from(p.fibre_stiffness, 0.0)
        tensors = [self._tensor(tensor, "") for tensor in (p.permeability, p.diffusivity) if tensor.follows_fibres]
        if not matter and not any(shown is not None and shown.directions is not None for shown in tensors):
            return None
        angle = self._angle()
        return None if angle is None else np.column_stack([np.cos(angle), np.sin(angle)])

    def _differs_from(self, function: Any, value: float) -> bool:
        """Whether a function of position is not everywhere this value."""
        if function.constant is not None:
            return bool(function.constant != value)
        try:
            return bool(np.any(function(**self.at) != value))
        except ParameterError:
            return True

    def _angle(self) -> Array | None:
        try:
            return np.asarray(self.parameters.fibre_angle(**self.at))
        except ParameterError:  # a corner of the mesh beyond a grid, which its points of integration are within
            return None

    def _properties(self) -> dict[str, Property]:
        """What differs from place to place, and tensors that differ from direction to direction."""
        factor, unit = self.scales.factor({"pressure": 1})
        found: dict[str, Property | None] = {}
        for name, label in SCALARS.items():
            found[name] = self._scalar(getattr(self.parameters, name), label, *((factor, unit) if name == "fibre_stiffness" else ()))
        for name, label in TENSORS.items():
            found[name] = self._tensor(getattr(self.parameters, name), label)
        found["alpha"] = self._scalar(self.initial.alpha, r"initial $\alpha$")
        return {name: shown for name, shown in found.items() if shown is not None}

    def _scalar(self, function: Any, label: str, factor: float = 1.0, unit: str = "-") -> Property | None:
        if function.constant is not None:
            return None
        try:
            values = factor * np.asarray(function(**self.at))
        except ParameterError:
            return None
        return Property(label if unit == "-" else f"{label} [{unit}]", values) if _differ(values) else None

    def _tensor(self, function: Any, label: str) -> Property | None:
        angle = self._angle()
        if function.constant is not None or angle is None:
            return None
        try:
            xx, yy, xy = function(angle, **self.at).T
        except ParameterError:
            return None
        mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)  # the principal values are mean + half and mean - half
        larger = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        larger = np.where(half > SAME * mean, larger, np.nan)
        if np.isnan(larger).all():
            return Property(label, mean) if _differ(mean) else None
        return Property(f"{label}, mean", mean, np.column_stack([np.cos(larger), np.sin(larger)]))

    # -- Surface ---------------------------------------------------------------------------------------------------------

    def _parts(self) -> dict[str, Part]:
        """The edges of the named parts; without those that the mesh alone does not tell."""
        if self.boundary.is_plain:
            return {}
        sides = self._sides()
        parts = {}
        for part in self.boundary:
            edges = sides.get(part.side or "surface")
            if edges is None:
                continue
            if part.where is not None:
                middles = self.points[edges].mean(axis=1)
                edges = edges[part.formula(**self._coordinates(middles)) > 0.0]
            parts[part.name] = Part(edges, words_of(part, self.scales))
        return parts

    def _sides(self) -> Mapping[str, Numbers]:
        """Edges of the free surface by name of the side. The physical lines of a mesh are read from its file, if it is still there."""
        from tumour.meshes.body import boundary_edges

        kind = self.geometry.kind
        if kind == "mesh":
            return self._sides_of_file()
        edges = boundary_edges(self.mesh.triangles)
        if kind == "quarter_disk":
            on_arc = np.abs(np.hypot(*self.points.T) / self.geometry.radius - 1.0) < SAME
            edges = edges[on_arc[edges].all(axis=1)]
        if kind != "outline":
            return {"surface": edges}
        outer, *holes = _loops(edges)
        return {"surface": edges, "outer": outer, **{f"hole {k}": hole for k, hole in enumerate(holes, 1)}}

    def _sides_of_file(self) -> Mapping[str, Numbers]:
        from tumour.meshes.body import boundary_edges
        from tumour.meshes.gmsh import from_gmsh

        slides = self.geometry.slide_x or (), self.geometry.slide_y or ()
        try:
            body = from_gmsh(str(self.geometry.file), *slides)
        except ParameterError:  # moved or changed since
            return {} if any(slides) else {"surface": boundary_edges(self.mesh.triangles)}
        if not np.array_equal(body.mesh.t.T, self.mesh.triangles) or not np.allclose(body.mesh.p.T, self.points, atol=SAME * body.radius):
            return {}  # another mesh
        return {"surface": body.edges, **{name: body.edges[numbers] for name, numbers in body.sides.items()}}


def _loops(edges: Numbers) -> list[Numbers]:
    """The closed loops of directed edges, in the order of their first points: the mesh of an outline begins with the points of its outer
    loop, then come those of hole 1, hole 2, ..."""
    row = {int(start): k for k, start in enumerate(edges[:, 0])}
    loops = []
    while row:
        start = at = min(row)
        loop: list[int] = []
        while not loop or at != start:
            loop.append(row.pop(at))
            at = int(edges[loop[-1], 1])
        loops.append(edges[loop])
    return loops


def _differ(values: Array) -> bool:
    return bool(np.ptp(values) > SAME * np.max(np.abs(values)))


def words_of(part: BoundaryPart, scales: Scales | None = None) -> str:
    """What makes a part differ from the free surface, in a few words; in the units of the scales where there are any."""
    of = Scales() if scales is None else scales

    def shown(value: Any, **dimension: int) -> str:
        factor, unit = of.factor(dimension)
        values = [factor * number for number in (value.values if isinstance(value, TimeSeries) else [value])]
        low, high = min(values), max(values)
        text = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        return text if unit == "-" else f"{text} {unit}"

    words = _held(part, shown)
    forces = {"load": part.load, "traction x": part.traction_x, "traction y": part.traction_y}
    words += [f"{name} {shown(series, pressure=1)}" for name, series in forces.items() if acts(series)]
    springs = {"spring": part.spring, "spring along the normal": part.spring_normal}
    words += [f"{name} {shown(stiffness, pressure=1, length=-1)}" for name, stiffness in springs.items() if stiffness > 0.0]
    if part.p != OUTSIDE:
        words.append("no flow" if part.p == CLOSED else f"p = {shown(part.p, pressure=1)}")
    beyond = "" if part.C in (OUTSIDE, CLOSED) else f"C = {shown(part.C, concentration=1)}"
    if part.membrane is not None:
        words.append("membrane" + (f" to {beyond}" if beyond else ""))
    elif part.C == CLOSED:
        words.append("oxygen influx" if acts(part.influx) else "no oxygen")
    elif beyond:
        words.append(beyond)
    return ", ".join(words)


def _held(part: BoundaryPart, shown: Any) -> list[str]:
    """What is said of prescribed displacements."""
    held = {axis: getattr(part, f"displacement_{axis}") for axis in "xy"}
    given = {axis: series for axis, series in held.items() if series is not None}
    if len(given) == 2 and not any(acts(series) for series in given.values()):
        return ["clamped"]
    return [f"d_{axis} = {shown(series, length=1)}" if acts(series) else f"held in {axis}" for axis, series in given.items()]
