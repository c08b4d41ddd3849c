"""What of a result of a tumour can be compared with one of another dimension, shape or material."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import from_table
from multiphase.profiles import Profiles, RingFields
from tumour.boundary import TumourBoundary
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourInitial, TumourParameters
from tumour.rings import Rings, RoundMesh, ring_averages

if TYPE_CHECKING:
    from multiphase.result import Result

Array = NDArray[np.float64]

LEAST_ASYMMETRY = 0.02
"""Asymmetry that errors of a mesh do not explain: the watch on a run's shape has the same limit. See `tests/tumour/test_crosscheck.py`
for what coarse meshes give."""

_BODIES = {
    "slab": "a slab", "disk": "a disk", "quarter_disk": "a disk", "sphere": "a ball", "glioma": "a body with lobes",
    "outline": "a body within an outline", "mesh": "a body of its own mesh",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RadialScene:
    """What a result's scene says of the body and of what is in it and acts on it."""

    geometry: TumourGeometry
    parameters: TumourParameters
    initial: TumourInitial
    boundary: TumourBoundary

    @classmethod
    def of(cls, result: Result) -> RadialScene | None:
        """None where there is no scene, or one that cannot be read any more."""
        tables = tomllib.loads(result.scene) if result.scene else {}
        if not tables:
            return None
        try:
            return cls(
                from_table(TumourGeometry, tables.get("geometry", {}), "geometry"),
                from_table(TumourParameters, tables.get("parameters", {}), "parameters"),
                from_table(TumourInitial, tables.get("initial", {}), "initial"),
                TumourBoundary.from_table(tables.get("boundary", {})),
            )
        except ParameterError:
            return None

    def why_not_radial(self) -> tuple[str, ...]:
        """What in the scene makes its solution depend on more than the distance from the middle, or is not in the radial equations."""
        why = []
        names = sorted(self.initial.alpha.names & {"x", "y", "theta"})
        if names:
            why.append(f"its initial alpha depends on {', '.join(names)}, so that it is not radial")
        if not self.parameters.is_plain:
            why.append(f"it has tissue that the radial equations have not: {', '.join(self.parameters.varying)}")
        if not self.boundary.is_plain:
            why.append(f"parts of its surface differ from the rest: {', '.join(self.boundary.names)}")
        return tuple(why)


def profiles_of(result: Result) -> Profiles | None:
    """What of a result can be compared with one of another dimension, shape or material; None where its scene does not say."""
    scene = RadialScene.of(result)
    if scene is None:
        return None
    geometry = scene.geometry
    elastic, on_disk = not geometry.eulerian, geometry.kind in ("disk", "quarter_disk")
    positions = None
    if elastic and result.x is not None:
        positions = (np.arange(result.x.shape[1]) + 0.5) / result.x.shape[1]
    rings = None
    if elastic and on_disk:
        rings = partial(_on_mesh, result, scene) if result.mesh is not None else partial(_on_cells, result)
    return Profiles(
        material="viscous cells" if geometry.eulerian else "elastic cells",
        body=_BODIES[geometry.kind],
        share=geometry.share,
        shared=("area", "cell_mass"),
        sizes=("thickness", "area", "volume"),
        positions=positions,
        place="R/R_0" if elastic else "x/width",
        rings=rings,
    )


def _on_mesh(result: Result, scene: RadialScene, edges: Array, rows: Array) -> RingFields:
    """Averages and scatter of a disk in two dimensions."""
    assert result.mesh is not None
    rings = Rings.of(RoundMesh(result.mesh, scene.geometry.share < 1.0), edges)
    means, rms, largest = {}, {}, {}
    for name, values in result.fields.items():
        there = values[rows]
        means[name] = rings.means(there) if there.ndim == 2 else rings.outward_means(there)
        rms[name], largest[name] = rings.scatter(there)
    why = [*scene.why_not_radial()]
    later = rows[result.t[rows] > 0.0]  # at t = 0 fluid that enters the outermost triangles at once may leave them as uneven as they are
    asymmetry = float(np.max(result.scalars["asymmetry"][later], initial=0.0)) if "asymmetry" in result.scalars else 0.0
    if asymmetry > LEAST_ASYMMETRY:
        why.append(f"its asymmetry is {asymmetry:.2g}, which no error of a mesh explains: the disk has lost its round shape")
    return RingFields(means=means, rms=rms, largest=largest, why_not=tuple(why))


def _on_cells(result: Result, edges: Array, rows: Array) -> RingFields:
    """Averages of a radial disk."""
    fields = {name: values[rows] for name, values in result.fields.items()}
    return RingFields(means={name: ring_averages(values, edges, weighted=name == "displacement") for name, values in fields.items()})
