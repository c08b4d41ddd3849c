"""The two-dimensional solver against the radial one: averages over rings of the body at rest, and the scatter round them, time by time.

Any two results are compared by `multiphase.compare` (``multiphase compare A.h5 B.h5``), which does the same with disks in less detail.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from multiphase.compare import RINGS
from multiphase.compare.places import common_times
from multiphase.errors import ParameterError
from tumour.model import simulate
from tumour.profiles import RadialScene, profiles_of

if TYPE_CHECKING:
    from multiphase.result import Result

Array = NDArray[np.float64]

FIELDS = ("alpha", "C", "p", "displacement")
"""The fields that are solved for; the others follow from them."""

LEAST_SCALE = 1e-10
"""A field that is smaller throughout is zero but for rounding and what Newton's method leaves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CrossCheck:
    """A disk in two dimensions and the radial solution of the same scene.

    Attributes
    ----------
    times : (times,) array
        The common times.
    edges : (rings + 1,) array
        Radii of the rings at rest, over that of the body.
    radius : (2, times) array
        Radius of the surface: in two dimensions, radial.
    plane, radial : mapping of str to (times, rings) array
        Averages over the rings; of the displacement its radial part, weighted by the distance from the middle.
    rms, largest : mapping of str to (times, rings) array
        Scatter round the rings in two dimensions: root mean square and largest deviation from the mean round the middle of each ring. That
        of the displacement has its tangential part.
    refusals : tuple of str
        Why the two are no check of each other; empty where they are.
    sizes : (str, str)
        How fine both are.
    """

    times: Array
    edges: Array
    radius: Array
    plane: Mapping[str, Array]
    radial: Mapping[str, Array]
    rms: Mapping[str, Array]
    largest: Mapping[str, Array]
    refusals: tuple[str, ...] = ()
    sizes: tuple[str, str] = ("", "")

    @property
    def names(self) -> tuple[str, ...]:
        """The fields, those that are solved for first."""
        return (*(name for name in FIELDS if name in self.plane), *(name for name in self.plane if name not in FIELDS))

    def scale(self, name: str) -> Array:
        """Largest absolute value of the radial field at each time, (times,), and no less than `LEAST_SCALE`."""
        return np.asarray(np.maximum(np.abs(self.radial[name]).max(axis=1), LEAST_SCALE))

    def difference(self, name: str) -> Array:
        """Largest difference over the rings at each time, (times,), over `scale`; of "radius" the relative difference."""
        if name == "radius":
            return np.asarray(np.abs(self.radius[0] / self.radius[1] - 1.0))
        return np.asarray(np.abs(self.plane[name] - self.radial[name]).max(axis=1) / self.scale(name))

    def scatter(self, name: str, *, largest: bool = False) -> Array:
        """Root mean square deviation round a ring, or the largest, at each time, (times,), over `scale`: that of the worst ring."""
        return np.asarray((self.largest if largest else self.rms)[name].max(axis=1) / self.scale(name))

    def agrees(self, tol: float) -> bool:
        """Whether radius and fields that are solved for differ and scatter (root mean square) by no more than `tol` after t = 0, and
        nothing speaks against the comparison."""
        later = self.times > 0.0
        worst = [self.difference("radius")]
        worst += [part(name) for name in self.names if name in FIELDS for part in (self.difference, self.scatter)]
        return not self.refusals and all(bool(np.all(values[later] <= tol)) for values in worst)

    def table(self) -> str:
        """Differences by field and time, and the scatter under them, as a user reads them."""
        names = self.names
        head = f"{'t':>10}{'':<12}{'radius':>12}" + "".join(f"{name:>{max(12, len(name) + 2)}}" for name in names)
        lines = [f"A, {self.sizes[0]}, against the radial solver, {self.sizes[1]}: {len(self.edges) - 1} rings of the body at rest, over"]
        lines += ["the largest value of the radial field at each time", "", head]
        for row, time in enumerate(self.times):
            lines.append(f"{time:>10.6g}{'  difference':<12}{self.difference('radius')[row]:>12.2e}{self._cells(self.difference, row)}")
            lines.append(f"{'':>10}{'  scatter':<12}{'':>12}{self._cells(self.scatter, row)}")
        lines += ["", "scatter: root mean square from the mean round a ring"]
        lines += [f"no agreement is claimed: {why}" for why in self.refusals]
        return "\n".join(lines)

    def _cells(self, values: Any, row: int) -> str:
        return "".join(f"{values(name)[row]:>{max(12, len(name) + 2)}.2e}" for name in self.names)

    def figure(self) -> Any:
        """A Matplotlib figure: profiles at three times, and differences and scatter against time."""
        from tumour.crosscheck_picture import draw

        return draw(self)


def crosscheck(plane: Result, radial: Result | None = None, *, rings: int = RINGS) -> CrossCheck:
    """Compare an elastic disk or quarter disk in two dimensions with the radial solution of the same scene.

    Parameters
    ----------
    plane : Result
        In two dimensions.
    radial : Result, optional
        Of the radial solver; without it, the scene of `plane` is solved anew with 400 cells at rtol = 1e-7.
    rings : int
        Number of rings, equal in width at rest. Keep it as the mesh is refined: averages over rings that do not follow the mesh are of
        second order also where a field is not.

    Returns
    -------
    CrossCheck
        With `refusals` where the scene is not radial or the disk has lost its round shape.

    Raises
    ------
    ParameterError
        When the results are not of elastic disks, one in two dimensions and one radial, or have no common time beyond the start.
    """
    scene, known = RadialScene.of(plane), profiles_of(plane)
    if scene is None or known is None or plane.mesh is None or known.rings is None:
        raise ParameterError("plane", "this is no result of an elastic disk or quarter disk in two dimensions with its scene.")
    if radial is None:
        radial = _solve(scene, plane)
    other = profiles_of(radial)
    if other is None or radial.mesh is not None or other.rings is None:
        raise ParameterError("radial", "this is no result of the radial solver for an elastic disk or quarter disk.")
    rows = common_times(plane.t, radial.t)
    if not np.any(plane.t[rows[0]] > 0.0):
        raise ParameterError("radial", "the results have no common time beyond the start; store both at the same times.")
    edges = np.linspace(0.0, 1.0, rings + 1)
    here, there = known.rings(edges, rows[0]), other.rings(edges, rows[1])
    both = [name for name in here.means if name in there.means]
    return CrossCheck(
        times=plane.t[rows[0]],
        edges=edges,
        radius=np.stack([plane["radius"][rows[0]], radial["radius"][rows[1]]]),
        plane={name: here.means[name] for name in both},
        radial={name: there.means[name] for name in both},
        rms={name: here.rms[name] for name in both},
        largest={name: here.largest[name] for name in both},
        refusals=here.why_not,
        sizes=(plane.size(), radial.size()),
    )


def _solve(scene: RadialScene, plane: Result) -> Result:
    """The radial solution at the stored times of `plane`."""
    if scene.why_not_radial():
        raise ParameterError("plane", f"has no radial solution: {'; '.join(scene.why_not_radial())}.")
    geometry = {"kind": scene.geometry.kind, "radius": scene.geometry.radius, "dimension": "radial"}
    return simulate(
        scene.parameters, initial=scene.initial, geometry=geometry, t_end=float(plane.t[-1]), save_at=[float(t) for t in plane.t],
        cells=400, rtol=1e-7,
    )  # fmt: skip
