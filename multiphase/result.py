"""What a run gives back: named scalars and fields by time, and how the run went."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh
from multiphase.model import find_model

Array = npt.NDArray[Any]
Status = Literal["running", "completed", "stopped", "failed"]
PathName = str | PathLike[str]


@dataclass(kw_only=True, eq=False, repr=False)
class Result:
    """Scalars and fields of one run at its stored times.

    Values are dimensionless; :meth:`in_units` gives them in the units of the scene's ``[scales]``.

    Attributes
    ----------
    model : str
        Name of the model, for instance "plaque".
    t : ndarray, shape (nt,)
        Stored times.
    x : ndarray, shape (nt, cells), or None
        Positions of the cell centres at each time; None in two dimensions.
    mesh : Mesh or None
        The triangles of a two-dimensional body at rest; None in one dimension.
    scalars : dict of str to ndarray, shape (nt,)
    fields : dict of str to ndarray, shape (nt, cells), or (nt, points) or (nt, points, 2) in two dimensions
        Values at the cell centres, index 0 innermost; in two dimensions at the points of the mesh.
    scene, scene_source : str
        The resolved scene (TOML, every value written out), and the text the user gave.
    plan : str
        Which equations were solved, and why (JSON).
    status : {"running", "completed", "stopped", "failed"}
    message : str
        How the run ended, in a sentence a user can act on.
    stats, versions : dict
        Cost of the run, and versions of the software; both JSON-able.
    platform, created : str
    threads : int
    seed : int or None
    checkpoint : dict of str to ndarray
        The complete last state; only the scheme that wrote it knows its meaning.
    units, descriptions : dict of str to str
        By name of the quantity, "points" for the points of the mesh; a missing unit means "-" (dimensionless).
    """

    model: str
    t: Array
    x: Array | None = None
    mesh: Mesh | None = None
    scalars: dict[str, Array] = field(default_factory=dict)
    fields: dict[str, Array] = field(default_factory=dict)
    scene: str = ""
    scene_source: str = ""
    plan: str = ""
    status: Status = "completed"
    message: str = ""
    stats: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    platform: str = ""
    threads: int = 1
    seed: int | None = None
    created: str = ""
    checkpoint: dict[str, Array] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    descriptions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.t = np.asarray(self.t)
        self.x = None if self.x is None else np.asarray(self.x)
        self.scalars = {name: np.asarray(values) for name, values in self.scalars.items()}
        self.fields = {name: np.asarray(values) for name, values in self.fields.items()}
        if self.t.ndim != 1:
            raise ParameterError("t", f"stored times must be one row of numbers, but their shape is {self.t.shape}.")
        for name, values in self._data().items():
            if values.ndim == 0 or len(values) != len(self.t):
                raise ParameterError(name, f"has shape {values.shape}, but there are {len(self.t)} stored times.")
        if self.mesh is None:
            return
        if self.x is not None:
            raise ParameterError("x", "a result has either positions of cells or a mesh, but this one has both.")
        for name, values in self.fields.items():
            if values.shape[1:2] != (len(self.mesh.points),):
                raise ParameterError(name, f"has shape {values.shape}, but the mesh has {len(self.mesh.points)} nodes.")

    def _data(self) -> dict[str, Array]:
        """Everything that depends on time, by name: t, x, scalars, fields."""
        positions = {} if self.x is None else {"x": self.x}
        return {"t": self.t, **positions, **self.scalars, **self.fields}

    def __getitem__(self, name: str) -> Array:
        """A scalar (nt,), a field (nt, cells), "t" or "x"; KeyError names the nearest name."""
        data = self._data()
        if name not in data:
            from multiphase.parameters import nearest

            raise KeyError(f"this result has no quantity {name!r}{nearest(name, data)} It has {', '.join(data)}.")
        return data[name]

    def __contains__(self, name: object) -> bool:
        return name in self._data()

    def __repr__(self) -> str:
        times = f"{len(self.t)} times in [{self.t[0]:g}, {self.t[-1]:g}]" if len(self.t) else "no times"
        size = self.size()
        names = "; ".join(f"{kind} {', '.join(values)}" for kind, values in (("scalars", self.scalars), ("fields", self.fields)) if values)
        return f"<Result of {self.model}, {self.status}: {times}{', ' if size else ''}{size}; {names}>"

    def size(self) -> str:
        """How fine the result is in space, in words: "200 cells", or "81 nodes, 128 triangles"; empty without positions."""
        if self.mesh is not None:
            return f"{len(self.mesh.points)} nodes, {len(self.mesh.triangles)} triangles"
        return "" if self.x is None else f"{self.x.shape[1]} cells"

    def unit(self, name: str) -> str:
        """Unit of the quantity `name`; "-" when it is dimensionless."""
        return self.units.get(name, "-")

    def width(self) -> Array | None:
        """Current width (or radius) of the domain, (nt,), in the unit of `x`; None without positions.

        The scalar "L" or "radius" where the model reports one, otherwise from cells of equal size.
        """
        if self.x is None:
            return None
        for name in ("L", "radius"):
            if name in self.scalars:
                return self.scalars[name]
        last = self.x[:, -1]
        before = self.x[:, -2] if self.x.shape[1] > 1 else -last
        return np.asarray(last + (last - before) / 2)

    def positions(self, index: int) -> Array:
        """Where the points are at the stored time ``t[index]``.

        Returns
        -------
        ndarray, shape (points, 2) or (cells,)
            The nodes of the mesh, displaced; in one dimension ``x[index]``.

        Raises
        ------
        ParameterError
            When the result has no positions, or has a mesh but not the field "displacement".
        """
        if self.mesh is None:
            if self.x is None:
                raise ParameterError("", "this result has no positions.")
            return np.array(self.x[index])
        if "displacement" not in self.fields:
            raise ParameterError("", 'this result has no "displacement", so its positions are not known. Store that field (output.fields).')
        return np.asarray(self.mesh.points + self.fields["displacement"][index])

    def save(self, path: PathName, *, overwrite: bool = False) -> None:
        """Write the result to the HDF5 file `path`.

        Raises
        ------
        ParameterError
            When `path` exists and `overwrite` is False.
        OSError
            When the file cannot be written; a file that was there before is then still whole.
        """
        from multiphase import storage

        if not overwrite and Path(path).exists():
            raise ParameterError("", f"'{path}' exists already. Choose another name, or pass overwrite=True to replace it.")
        storage.write(self, Path(path))

    def at(self, time: float) -> dict[str, Any]:
        """Scalars, fields and positions at `time`, linear in time between the stored times.

        A stored time gives exactly the stored values. Cells are followed: cell 5 is interpolated between
        where it was before and after.

        Returns
        -------
        dict of str to float or ndarray, shape (cells,), or (points,) or (points, 2) in two dimensions
            Every scalar, every field, and "x" in one dimension; in two, ``mesh.points + at(time)["displacement"]`` are the positions.

        Raises
        ------
        ParameterError
            When `time` is outside the stored times.
        """
        if not len(self.t) or not self.t[0] <= time <= self.t[-1]:
            span = f"from {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else "(none)"
            raise ParameterError("time", f"{time!r} is outside the stored times {span}. Ask for a time within them.")
        after = int(np.searchsorted(self.t, time))
        data = {name: values for name, values in self._data().items() if name != "t"}
        if self.t[after] == time:
            rows = {name: values[after] for name, values in data.items()}
        else:
            weight = (time - self.t[after - 1]) / (self.t[after] - self.t[after - 1])
            rows = {name: (1 - weight) * values[after - 1] + weight * values[after] for name, values in data.items()}
        return {name: float(row) if np.ndim(row) == 0 else np.array(row) for name, row in rows.items()}

    def in_units(self) -> Result:
        """The same result in the physical units of the scene's ``[scales]``.

        Without scales, or when the values have units already, this is the result itself. The checkpoint is left out,
        as a run restarts from dimensionless values.
        """
        table = tomllib.loads(self.scene).get("scales") if self.scene else None
        if not table or any(unit != "-" for unit in self.units.values()):
            return self
        from multiphase.scales import Scales

        scales = Scales.from_table(table)
        quantities = find_model(self.model).quantities
        factors: dict[str, float] = {}
        units: dict[str, str] = {}
        for name in self._data():
            known = {"t": {"time": 1}, "x": {"length": 1}}.get(name)
            dimension = known or (quantities[name].dimension if name in quantities else {})
            factors[name], units[name] = scales.factor(dimension)
        mesh = self.mesh
        if mesh is not None:
            factor, units["points"] = scales.factor({"length": 1})
            mesh = replace(mesh, points=mesh.points * factor)
        return replace(
            self,
            t=self.t * factors["t"],
            x=None if self.x is None else self.x * factors["x"],
            mesh=mesh,
            scalars={name: values * factors[name] for name, values in self.scalars.items()},
            fields={name: values * factors[name] for name, values in self.fields.items()},
            units=units,
            checkpoint={},
        )

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with dimensions time and cell, and coordinates t (time) and x (time, cell).

        In two dimensions the dimensions are time, point and, for vectors, component; the coordinates t (time), and x_rest and y_rest
        (point), the nodes at rest; the triangles are a variable (triangle, corner).
        """
        try:
            import xarray
        except ImportError as error:
            raise ImportError("to_xarray needs the package xarray: pip install multiphase-tissue[xarray]") from error

        def variable(name: str, values: Array) -> Any:
            attributes = {"unit": self.unit(name), "long_name": self.descriptions.get(name, name)}
            space = ("cell",) if self.mesh is None else ("point", "component")
            return xarray.Variable(("time", *space)[: values.ndim], values, attributes)

        variables = {name: variable(name, values) for name, values in self._data().items()}
        coordinates: dict[str, Any] = {name: variables.pop(name) for name in ("t", "x") if name in variables}
        if self.mesh is not None:
            about_points = {"unit": self.unit("points"), "long_name": "position at rest"}
            for part, name in enumerate(("x_rest", "y_rest")):
                coordinates[name] = xarray.Variable(("point",), self.mesh.points[:, part], about_points)
            about_triangles = {"unit": "-", "long_name": "points of each triangle"}
            variables["triangles"] = xarray.Variable(("triangle", "corner"), self.mesh.triangles, about_triangles)
        about = {"model": self.model, "status": self.status, "message": self.message, "scene": self.scene}
        return xarray.Dataset(variables, coords=coordinates, attrs=about)

    def plot(self, **options: Any) -> Any:
        """The model's standard figure: `multiphase.plotting.figure` with its options."""
        from multiphase import plotting

        return plotting.figure(self, **options)

    def animate(self, path: PathName, **options: Any) -> None:
        """A film of the run in `path` (.gif or .mp4): `multiphase.film.animate` with its options."""
        from multiphase import film

        film.animate(self, path, **options)


def load(path: PathName) -> Result:
    """The result stored in the HDF5 file `path`.

    Raises
    ------
    ParameterError
        When there is no such file, or it is not a result that this version can read.
    """
    from multiphase import storage

    return storage.read(path)
