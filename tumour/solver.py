"""How a tumour's equations are solved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from multiphase.errors import ParameterError
from multiphase.parameters import parameter, validate
from tumour.geometry import RADIAL_KINDS, TumourGeometry
from tumour.presets import find_preset

RADIAL_CELLS, DISK_CELLS, OTHER_CELLS = 200, 40, 20
"""Cells from the middle to the surface where a scene does not say: of radial bodies, of disks in two dimensions, of other shapes."""

ONE_CELL = 1
"""Cells on which a state that is uniform in space is solved: see `tumour.reductions`."""

NEWTON_SHARE = 1e-2
"""Newton tolerance over rtol in two dimensions, unless a scene gives it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TumourSolver:
    """How the equations are solved.

    Attributes
    ----------
    method : "auto", "lines", "fipy" or "mini"
        Of radial bodies: the compiled method of lines, or FiPy, for the Eulerian formulation only. In two dimensions: MINI finite
        elements. "auto" takes lines or mini.
    cells : int or None
        Cells, or triangles, from the centre to the surface, 4 or more: triangles are radius/cells wide, with the radius of the largest
        circle within bodies that are not round. None stands for 200 in radial bodies, 40 in disks in two dimensions and 20 in other
        shapes. A mesh from a file has its own.
    rtol : float
        Accuracy asked of each time step, greater than 0 and at most 0.1.
    time_scheme : "auto", "radau", "bdf2" or "backward-euler"
        "auto" is Radau IIA of order five for lines, BDF of order two for fipy and mini, and backward Euler for the printed step of alpha.
    dt : float or None
        A fixed time step; None lets the error control choose.
    max_steps : int
        Steps after which the run gives up.
    alpha_step : "conservative" or "as-printed"
        How a step changes alpha: by the difference of alpha J, which keeps the mass of cells, or by ``(J - J_old) alpha + (alpha -
        alpha_old) J``, as the authors' code does, with backward Euler and in the Lagrangian formulation only.
    newton_tol : float or None
        mini: error that Newton's method may leave in a step, relative to the size of the body, of alpha, p and C; None stands for a
        hundredth of rtol.
    linear : "auto", "pardiso" or "superlu"
        mini: the solver of linear systems. "auto" takes PARDISO where it is installed (extra `pardiso`), which is faster.
    assembly : "compiled" or "forms"
        mini: the compiled element kernel, or the readable scikit-fem forms that specify it, with a tangent by differences: some hundred
        times slower, for checks and where nothing can be compiled.
    """

    method: str = parameter("auto", symbol="-", choices=("auto", "lines", "fipy", "mini"), doc="the method")
    cells: int | None = parameter(None, symbol="N", kind="integer", low=4, high=1_000_000, doc="the number of cells")
    rtol: float = parameter(1e-4, symbol="rtol", low=1e-12, high=0.1, doc="the accuracy rtol")
    time_scheme: str = parameter("auto", symbol="-", choices=("auto", "radau", "bdf2", "backward-euler"), doc="the time scheme")
    dt: float | None = parameter(None, symbol="Δt", kind="number", low=0.0, low_open=True, doc="the fixed time step dt")
    max_steps: int = parameter(100_000, symbol="-", low=1, doc="the largest number of steps")
    alpha_step: str = parameter("conservative", symbol="-", choices=("conservative", "as-printed"), doc="the step of alpha")
    newton_tol: float | None = parameter(
        None, symbol="-", kind="number", low=1e-12, high=1e-2, doc="the tolerance newton_tol of Newton's method"
    )
    linear: str = parameter("auto", symbol="-", choices=("auto", "pardiso", "superlu"), doc="the solver of linear systems")
    assembly: str = parameter("compiled", symbol="-", choices=("compiled", "forms"), doc="the way elements are assembled")

    table: ClassVar[str] = "solver"

    def __post_init__(self) -> None:
        validate(self, self.table)
        if self.method in ("fipy", "mini") and self.time_scheme == "radau":
            raise ParameterError(
                f"{self.table}.time_scheme", '"radau" comes with the method "lines" only; take method = "lines", or time_scheme = "bdf2".'
            )
        if self.newton_tol is not None and self.dt is None and self.newton_tol > self.rtol:
            raise ParameterError(
                f"{self.table}.newton_tol",
                f"{self.newton_tol:g} is above rtol = {self.rtol:g}, so that what Newton's method leaves would be taken for the error of "
                f"the time step; take {0.1 * self.rtol:g} or less.",
            )
        if self.alpha_step == "as-printed" and self.time_scheme not in ("auto", "backward-euler"):
            raise ParameterError(
                f"{self.table}.alpha_step",
                f'"as-printed" is a step of backward Euler and does not go with time_scheme = "{self.time_scheme}"; take time_scheme = '
                '"backward-euler", or alpha_step = "conservative".',
            )

    @property
    def resolved(self) -> tuple[str, str]:
        """Method and time scheme that "auto" stands for."""
        method = "lines" if self.method == "auto" else self.method
        if self.time_scheme != "auto":
            return method, self.time_scheme
        if self.alpha_step == "as-printed":
            return method, "backward-euler"
        return method, "radau" if method == "lines" else "bdf2"

    @property
    def newton_tolerance(self) -> float:
        """The tolerance of Newton's method that is used in two dimensions."""
        return NEWTON_SHARE * self.rtol if self.newton_tol is None else self.newton_tol

    def within(self, geometry: TumourGeometry) -> TumourSolver:
        """The solver with the method and the cells that "auto" and None stand for in two dimensions, and the cells elsewhere."""
        method = "mini" if geometry.plane and self.method == "auto" else self.method
        usual = RADIAL_CELLS if not geometry.plane else DISK_CELLS if geometry.kind in RADIAL_KINDS else OTHER_CELLS
        return replace(self, method=method, cells=usual if self.cells is None else self.cells)

    @classmethod
    def preset(cls, name: str) -> TumourSolver:
        """The solver of a preset: the defaults, unless the preset reproduces a published computation."""
        return cls(**find_preset(name).solver)
