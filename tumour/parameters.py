"""Parameters of the tumour model, in the paper's symbols spelt out; presets with their sources; checks across tables.

All values are dimensionless: lengths in units of the tumour's radius at rest, times in units of one over the rate of cell birth in
plenty of oxygen, oxygen in units of that outside, stresses in units of the cells' shear modulus or viscosity over that time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.model import Preset
from multiphase.parameters import nearest, parameter, validate
from tumour.equations import MOBILITIES, Number, critical_oxygen

POSITIONS = 2001
"""Points of the initial state at which `check` looks."""

LARGEST = 1e12
"""Largest size of a value, and one over the smallest of one that must not be 0; beyond it, the unit is wrong and squares overflow."""

_DIMENSIONS: Mapping[str, int] = {"slab": 1, "disk": 2, "quarter_disk": 2, "sphere": 3, "glioma": 2, "outline": 2, "mesh": 2}
RADIAL_KINDS = ("slab", "disk", "quarter_disk", "sphere")
"""Shapes whose fields may depend on the distance from the middle alone."""
FILE_KINDS = ("outline", "mesh")
"""Shapes that are read from a file."""
ELASTIC_FIELDS = ("alpha", "C", "p", "displacement", "J", "stress_magnitude")
VISCOUS_FIELDS = ("alpha", "C", "p", "u", "stress_magnitude")
"""What is stored in each formulation."""
RADIAL_CELLS, DISK_CELLS, OTHER_CELLS = 200, 40, 20
"""Cells from the middle to the surface where a scene does not say: of radial bodies, of disks in two dimensions, of other shapes."""
NEWTON_SHARE = 1e-2
"""Newton tolerance over rtol in two dimensions, unless a scene gives it."""

_BALLS: Mapping[int, float] = {1: 2.0, 2: np.pi, 3: 4.0 * np.pi / 3.0}

_PAPER = "paper, quarter disk"


@dataclass(frozen=True, slots=True, kw_only=True)
class TumourParameters:
    """Kinetics, mechanics and boundary values of the tumour model. The defaults are the paper's for the quarter disk, with the mobility
    that follows from its equations.

    Attributes
    ----------
    mu_alpha, lambda_alpha : float
        Lagrangian formulation: the moduli of the cells' neo-Hookean elasticity. Eulerian: their viscosities. Which values are
        allowed depends on the formulation and the shape: see `check`.
    kappa : float
        Drag between cells and fluid; 0 lets the fluid flow freely, at the pressure p_out.
    mobility : "darcy", "printed" or "constant"
        How the fluid's mobility M depends on the cell fraction: (1 - alpha)/(kappa alpha), as follows from the mixture's momentum;
        1/(mobility_floor + kappa alpha), as printed in the paper; 1/kappa.
    mobility_floor : float
        Keeps the printed mobility finite where there are no cells.
    gamma, alpha_star, alpha_min, sigma_width : float
        Contact stress Sigma = gamma (alpha - alpha_star)/(1 - alpha)^2 from alpha_min on and 0 below; sigma_width spreads the switch over
        alpha_min - sigma_width/2 to alpha_min + sigma_width/2.
    s1, s2, s3, s4 : float
        Kinetics of the cells, (1+s1) C/(1+s1 C) alpha (1-alpha) - (s2+s3 C)/(1+s4 C) alpha.
    Q, Q1_hat : float
        Uptake of oxygen, Q alpha C/(1 + Q1_hat C).
    C_out : float
        Oxygen at the surface.
    p_out : float
        Fluid pressure at the surface in excess of the load on it. The traction there is 0, so p_out is no gauge: it swells the body.
    C_hypoxic, C_necrotic : float
        Oxygen below which tissue counts as hypoxic, and as necrotic; "kinetic" is the oxygen C* at which cells at their natural fraction
        no longer multiply. They are what is measured by, and change nothing in the solution.
    """

    mu_alpha: float = parameter(1.0, symbol="μ_α", low=0.0, low_open=True, source=_PAPER, doc="the shear modulus or viscosity mu_alpha")
    lambda_alpha: float = parameter(0.0, symbol="λ_α", source=_PAPER, doc="the second modulus or viscosity lambda_alpha")
    kappa: float = parameter(1.0, symbol="κ", low=0.0, source="paper, printed as k", doc="the drag kappa")
    mobility: str = parameter("darcy", symbol="M", choices=tuple(MOBILITIES), source="derived from (2.13)", doc="the law of the mobility")
    mobility_floor: float = parameter(0.0, symbol="ε", low=0.0, source=_PAPER, doc="the floor of the printed mobility")
    gamma: float = parameter(
        1.0, symbol="γ", low=0.0, source="assumed; (2.5) uses it, without a value", doc="the strength gamma of the contact stress"
    )
    alpha_star: float = parameter(
        0.8, symbol="α*", low=0.0, high=1.0, high_open=True, source=_PAPER, doc="the cells' natural fraction alpha_star"
    )
    alpha_min: float = parameter(
        0.8, symbol="α_min", low=0.0, high=1.0, source=_PAPER, doc="the fraction alpha_min at which contact begins"
    )
    sigma_width: float = parameter(
        0.0, symbol="w_Σ", low=0.0, high=1.0, source="0 is the sharp switch of (2.5)", doc="the width of the contact stress's switch"
    )
    s1: float = parameter(10.0, symbol="s_1", low=0.0, source=_PAPER, doc="the kinetic constant s1")
    s2: float = parameter(0.5, symbol="s_2", low=0.0, source=_PAPER, doc="the kinetic constant s2")
    s3: float = parameter(0.5, symbol="s_3", low=0.0, source=_PAPER, doc="the kinetic constant s3")
    s4: float = parameter(10.0, symbol="s_4", low=0.0, source=_PAPER, doc="the kinetic constant s4")
    Q: float = parameter(0.5, symbol="Q", low=0.0, source=_PAPER, doc="the uptake rate Q of oxygen")
    Q1_hat: float = parameter(0.0, symbol="Q̂_1", low=0.0, source=_PAPER, doc="the saturation constant Q1_hat of the uptake")
    C_out: float = parameter(1.0, symbol="C_out", low=0.0, source=_PAPER, doc="the oxygen C_out at the surface")
    p_out: float = parameter(0.0, symbol="p_out", source=_PAPER, doc="the fluid pressure p_out at the surface")
    C_hypoxic: float = parameter(
        0.5, symbol="C_h", low=0.0, source="assumed", doc="the oxygen C_hypoxic below which tissue counts as hypoxic"
    )
    C_necrotic: Any = parameter(  # noqa: RUF009
        "kinetic", symbol="C_n", kind="number", choices=("kinetic",), low=0.0, source="C* of the kinetics: 5/17 for the paper's",
        doc="the oxygen C_necrotic below which tissue counts as necrotic",
    )  # fmt: skip

    table: ClassVar[str] = "parameters"

    def __post_init__(self) -> None:
        validate(self, self.table)
        if self.gamma > 0.0 and self.alpha_min > self.alpha_star and self.sigma_width == 0.0:
            raise ParameterError(
                f"{self.table}.alpha_min",
                f"{self.alpha_min:g} is above alpha_star = {self.alpha_star:g}: the contact stress would jump up from 0 there and push "
                "cells straight back below alpha_min, so that no solution passes. Take alpha_min up to alpha_star, or spread the jump "
                "with sigma_width = 0.02, for instance.",
            )
        if self.mobility_floor > 0.0 and self.mobility != "printed":
            raise ParameterError(
                f"{self.table}.mobility_floor",
                f'{self.mobility_floor:g} has no meaning with mobility = "{self.mobility}"; set it to 0, or write mobility = "printed".',
            )

    @property
    def contact(self) -> tuple[float, float, float, float]:
        """What the contact stress needs after alpha: gamma, alpha_star, alpha_min, sigma_width."""
        return self.gamma, self.alpha_star, self.alpha_min, self.sigma_width

    @property
    def kinetics(self) -> tuple[float, float, float, float]:
        """What net growth needs after alpha and C: s1, s2, s3, s4."""
        return self.s1, self.s2, self.s3, self.s4

    @property
    def uptake(self) -> tuple[float, float]:
        """What the uptake of oxygen needs after alpha and C: Q, Q1_hat."""
        return self.Q, self.Q1_hat

    @property
    def flow(self) -> tuple[float, int, float]:
        """What mobility and resistance need after alpha: kappa, the code of the law, the floor."""
        return self.kappa, MOBILITIES[self.mobility], self.mobility_floor

    @property
    def necrotic_level(self) -> float:
        """Oxygen below which tissue counts as necrotic; NaN where the kinetics have none."""
        return critical_oxygen(self.alpha_star, *self.kinetics) if isinstance(self.C_necrotic, str) else float(self.C_necrotic)

    @property
    def moduli(self) -> tuple[float, float]:
        """What elastic and viscous stresses need last: mu_alpha, lambda_alpha."""
        return self.mu_alpha, self.lambda_alpha

    @classmethod
    def preset(cls, name: str) -> TumourParameters:
        """The parameters of a preset: "paper", "authors-disk", "authors-glioma" or "ward-king"."""
        return cls(**find_preset(name).parameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class TumourInitial:
    """The tumour at t = 0, at rest and without strain.

    Attributes
    ----------
    alpha : PositionFunction
        Cell fraction, greater than 0 and below 1.

    Notes
    -----
    alpha may be a number, ``{"at": [...], "values": [...]}`` with positions from 0 (the centre) to the radius, a formula in r, the
    distance from the centre, and xi = r/radius, or a Python function of r or xi. A Python function is sampled at 2001 equally spaced
    points of a body of radius 1; `within` samples it on another. In two dimensions a formula may also use x, y and the angle theta.
    """

    alpha: Any = parameter(  # noqa: RUF009
        0.8, symbol="α", kind="function", variables=("r", "xi", "x", "y", "theta"), low=0.0, low_open=True, high=1.0, high_open=True,
        source=_PAPER, doc="the initial cell fraction alpha",
    )  # fmt: skip

    table: ClassVar[str] = "initial"

    def __post_init__(self) -> None:
        validate(self, self.table)

    def within(self, radius: float) -> TumourInitial:
        """The same functions on a body of another radius: a Python function is sampled again, the rest is as it was."""
        made = TumourInitial(alpha=self.alpha)
        object.__setattr__(made, "alpha", self.alpha.with_length(radius))
        return made

    @classmethod
    def preset(cls, name: str) -> TumourInitial:
        """The initial state of a preset: "paper", "authors-disk", "authors-glioma" or "ward-king"."""
        return cls(**find_preset(name).initial)


@dataclass(frozen=True, slots=True, kw_only=True)
class TumourGeometry:
    """The shape of the body at rest, and how its deformation is described.

    Attributes
    ----------
    kind : "disk", "quarter_disk", "sphere", "slab", "glioma", "outline" or "mesh"
        A disk in plane strain, whole or the quarter of it that slides on its straight sides; a ball; a layer that is as thick as two
        radii and the same to both sides of its middle, kept from moving sideways; a body with lobes, as a glioma has; the body within
        an outline, or that of a Gmsh mesh, both from `file`.
    radius : float
        Radius at rest; half the thickness of a slab; of a glioma, the radius of the largest circle within it. An outline and a mesh
        have their own size.
    dimension : "auto", "radial" or "2d"
        Whether fields depend on the distance from the centre alone; "auto" where they can.
    formulation : "lagrangian" or "eulerian"
        Cells as an elastic solid, on the body at rest, or as a viscous fluid, on the body as it is: two different materials.
    file : str
        For an outline, a table of its points (.csv, columns x and y); for a mesh, a Gmsh file.
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
    slide_x: tuple[str, ...] | None = parameter(None, symbol="-", kind="words", doc="the sides that may not move in x")
    slide_y: tuple[str, ...] | None = parameter(None, symbol="-", kind="words", doc="the sides that may not move in y")

    table: ClassVar[str] = "geometry"

    def __post_init__(self) -> None:
        validate(self, self.table)
        self._check_dimension()
        if (self.kind in FILE_KINDS) != (self.file is not None):
            raise ParameterError(
                f"{self.table}.file",
                f'is missing: kind = "{self.kind}" is read from a file.' if self.file is None else f"has no meaning for a {self.kind}.",
            )
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


def find_preset(name: str) -> Preset:
    """The preset called `name`; raises ParameterError that names the nearest one."""
    if name not in PRESETS:
        hint = nearest(name, PRESETS)
        raise ParameterError("parameters.preset", f'there is no preset "{name}"{hint} The presets are {", ".join(PRESETS)}.')
    return PRESETS[name]


def check(parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry, solver: TumourSolver) -> None:
    """Refuse what only several tables together show, before any work starts.

    Raises
    ------
    ParameterError
        At ``parameters.lambda_alpha`` where the material is unstable; at ``initial.alpha`` where the initial state leaves its range or
        the body; at ``solver.method`` or ``solver.alpha_step`` where the formulation does not have them.

    Notes
    -----
    Viscous cells need ``mu > 0`` and ``2 mu + m lambda > 0``: the dissipation ``2 mu |e|^2 + lambda (tr e)^2`` is then positive for
    every rate of strain. Elastic cells need an energy W that grows with the stretch along the radius ever faster, at every deformation:

        d2W/dl_r2 = mu (1 + 1/l_r^2) + lambda (J/l_r)^2 > 0.

    In a slab J/l_r = 1, and the least value, for l_r -> infinity, is ``mu + lambda``. In a disk or sphere J/l_r, the change of area
    across the radius, is as large as one likes, so no negative lambda will do. It need not help that 2 mu + m lambda > 0, which is
    stability at rest: for lambda < 0 the energy of uniform swelling, ``m mu/2 J^(2/m) + lambda/2 J^2`` for large J, has no lower bound
    in a disk or sphere.
    """
    _check_sizes(parameters, initial, geometry)
    _check_moduli(parameters, geometry)
    if not geometry.plane:
        _check_fraction(initial, geometry.radius)
    if geometry.plane and solver.method != "mini":
        raise ParameterError("solver.method", f'"{solver.method}" solves radial bodies only; take method = "mini", or leave it out.')
    if solver.method == "mini" and not geometry.plane:
        raise ParameterError(
            "solver.method",
            '"mini" solves bodies in two dimensions; take method = "lines"'
            + (', or write dimension = "2d" in [geometry].' if geometry.kind in ("disk", "quarter_disk") else "."),
        )
    if not geometry.plane:
        for name, usual in (("newton_tol", None), ("linear", "auto"), ("assembly", "compiled")):
            if getattr(solver, name) != usual:
                raise ParameterError(f"solver.{name}", "has a meaning in two dimensions only; leave it out for a radial body.")
    if solver.method == "fipy" and not geometry.eulerian:
        raise ParameterError(
            "solver.method",
            '"fipy" solves the Eulerian formulation only; take method = "lines", or formulation = "eulerian" in [geometry].',
        )
    if solver.alpha_step == "as-printed" and geometry.eulerian:
        raise ParameterError(
            "solver.alpha_step",
            '"as-printed" is a step of the Lagrangian formulation; take alpha_step = "conservative", or formulation = "lagrangian" in '
            "[geometry].",
        )


def _check_moduli(parameters: TumourParameters, geometry: TumourGeometry) -> None:
    """Refuse a material that is unstable: see `check`."""
    mu, lam = parameters.moduli
    m = geometry.m
    if geometry.eulerian:
        least, is_allowed = -2.0 * mu / m, 2.0 * mu + m * lam > 0.0
        why = f"makes the viscosity of uniform growth, 2 mu_alpha + {m} lambda_alpha = {2.0 * mu + m * lam:g}, 0 or less"
    elif m == 1:
        least, is_allowed = -mu, lam > -mu
        why = "makes a slab's elastic energy lose its convexity as the slab thickens"
    else:
        least, is_allowed = 0.0, lam >= 0.0
        why = f"leaves the elastic energy of a {geometry.kind.replace('_', ' ')} without a lower bound, so that it would swell without end"
    if not is_allowed:
        bound = f"{least:g} or more" if least == 0.0 else f"greater than {least:g}"
        raise ParameterError("parameters.lambda_alpha", f"{lam:g} with mu_alpha = {mu:g} {why}; lambda_alpha must be {bound} here.")


def _check_sizes(parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> None:
    """Refuse sizes that only a wrong unit explains, and positions outside of the body."""
    for item in fields(parameters):
        value = getattr(parameters, item.name)
        if isinstance(value, float) and abs(value) > LARGEST:
            raise ParameterError(
                f"parameters.{item.name}", f"{value:g} is beyond {LARGEST:g}; everything here is dimensionless, so choose other units."
            )
    for name in ("mu_alpha", "kappa"):
        value = getattr(parameters, name)
        if 0.0 < value < 1.0 / LARGEST:
            raise ParameterError(
                f"parameters.{name}",
                f"{value:g} is smaller than {1.0 / LARGEST:g}; everything here is dimensionless, so choose other units"
                + ("; 0 lets the fluid flow freely." if name == "kappa" else "."),
            )
    extent = initial.alpha.extent
    if not geometry.plane and extent is not None and (extent[0] < 0.0 or extent[1] > geometry.radius * (1.0 + 1e-9)):
        raise ParameterError(
            "initial.alpha",
            f"its positions go from {extent[0]:g} to {extent[1]:g}, but the body from 0 to its radius {geometry.radius:g}; positions are "
            "dimensionless, like the radius.",
        )


def _check_fraction(initial: TumourInitial, radius: float) -> None:
    """Refuse a cell fraction that is not between 0 and 1, depends on more than the radius, or was sampled on another body."""
    function: PositionFunction = initial.alpha
    others = sorted(function.names - {"r", "xi"})
    if others:
        raise ParameterError(
            "initial.alpha",
            f"the formula uses {', '.join(others)}, but fields of this body depend on the distance from its middle alone; use r and xi, or "
            'write dimension = "2d" in [geometry] for a disk or quarter disk.',
        )
    if function.with_length(radius) != function:
        raise ParameterError(
            "initial.alpha",
            f"the Python function was sampled on a body of another radius than {radius:g}; give initial.within({radius:g}) instead.",
        )
    xi = np.linspace(0.0, 1.0, POSITIONS)
    r = radius * xi
    alpha = function(r=r, xi=xi)
    if np.any((alpha <= 0.0) | (alpha >= 1.0)):
        i = int(np.argmax(np.abs(alpha - 0.5)))
        raise ParameterError(
            "initial.alpha",
            f"alpha is {alpha[i]:.15g} at r = {r[i]:.6g} (xi = {xi[i]:.6g}); it must be greater than 0 and below 1 everywhere.",
        )


_QUARTER_DISK = {
    "mu_alpha": 1.0, "lambda_alpha": 0.0, "kappa": 1.0, "mobility": "printed", "mobility_floor": 0.0, "gamma": 1.0, "alpha_star": 0.8,
    "alpha_min": 0.8, "sigma_width": 0.0, "s1": 10.0, "s2": 0.5, "s3": 0.5, "s4": 10.0, "Q": 0.5, "Q1_hat": 0.0, "C_out": 1.0, "p_out": 0.0,
}  # fmt: skip

_PAPER_SOURCE = """\
All values are the paper's for its quarter disk, with the mobility 1/(kappa alpha) as (2.16), (2.17) and (2.22c) print it. The drag is
kappa = 1, which its list of parameters calls k. gamma = 1: assumed, as in the authors' code; (2.5) uses it and no value is given."""

_DISK_SOURCE = """\
The values of the preset paper, with what the authors' code for the disk does beside them: the mobility 1/(1e-4 + kappa alpha), backward
Euler with a step of 0.5, and alpha advanced by (J - J_old) alpha + (alpha - alpha_old) J, which does not keep the mass of cells. (That
code calls the state after its first step t = 0; here t counts the steps taken.)"""

_GLIOMA_SOURCE = """\
The values of the preset paper, with the two that the authors' code for the glioma has instead: a mobility of 1/kappa, and lambda_alpha =
1. The paper says that the glioma has the disk's parameters, lambda_alpha = 0; its figure shows alpha near 0.9, which needs 1."""

_WARD_KING_SOURCE = """\
Kinetics of Ward & King, IMA J. Math. Appl. Med. Biol. 14 (1997) 39-69, figures 1 to 4, with the values as the public code
wang-jin-mathbio/Jin2021 has them (not checked in the article): cells are born at the rate k_m = c/(c + 0.1) and die at k_d = 1 - 0.9
c/(c + 0.05), per cell and in units of the largest rate of birth; oxygen is quasi-steady, and cells take up 0.005 n k_m.
s1 = 10: k_m = 10 c/(1 + 10 c) = (10/11) (1+s1) c/(1+s1 c). The unit of time in which the birth term is (1+s1) C/(1+s1 C) is 1.1 of theirs
(t = t'/1.1), so the rate of death is to be multiplied by 1.1.
s2 = 1.1, s3 = 2.2, s4 = 20: 1.1 k_d = 1.1 (0.05 + 0.1 c)/(0.05 + c) = (1.1 + 2.2 c)/(1 + 20 c).
Q = 0.05, Q1_hat = 10: 0.005 c/(c + 0.1) = 0.05 c/(1 + 10 c); oxygen has no rate of its own, so the unit of time does not enter.
Not theirs: the factor 1 - alpha of births, and all of the mechanics, which are this model's with the defaults (their cells grow without
any resistance). alpha = 0.8 at first: as in the paper, where theirs fill the tumour."""

PRESETS: Mapping[str, Preset] = {
    "paper": Preset(
        title="the paper's quarter disk, mobility as printed",
        parameters=_QUARTER_DISK,
        initial={"alpha": 0.8},
        scales=None,
        source=_PAPER_SOURCE,
    ),
    "authors-disk": Preset(
        title="the authors' code for the disk, step by step",
        parameters={**_QUARTER_DISK, "mobility_floor": 1e-4},
        initial={"alpha": 0.8},
        scales=None,
        source=_DISK_SOURCE,
        solver={"alpha_step": "as-printed", "time_scheme": "backward-euler", "dt": 0.5},
    ),
    "authors-glioma": Preset(
        title="the authors' code for the glioma",
        parameters={**_QUARTER_DISK, "mobility": "constant", "lambda_alpha": 1.0},
        initial={"alpha": 0.8},
        scales=None,
        source=_GLIOMA_SOURCE,
    ),
    "ward-king": Preset(
        title="kinetics of Ward & King (1997)",
        parameters={
            **_QUARTER_DISK, "mobility": "darcy", "s1": 10.0, "s2": 1.1, "s3": 2.2, "s4": 20.0, "Q": 0.05, "Q1_hat": 10.0,
        },
        initial={"alpha": 0.8},
        scales=None,
        source=_WARD_KING_SOURCE,
    ),
}  # fmt: skip
