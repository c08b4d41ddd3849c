"""Parameters of the plaque model, in the paper's symbols spelt out; presets with their sources; checks across tables.

All values are dimensionless: lengths in units of X, times in X²/D_l (so the modLDL diffusivity D_l is 1), concentrations in units
of plasma LDL, pressures in b D_l with b the drag between the phases.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.model import Preset
from multiphase.parameters import nearest, parameter, validate
from multiphase.series import TimeSeries
from plaque1d.equations import Number, drag_diffusivity, extra_stress, viscosity

POSITIONS = 2001
"""Points of the initial state at which `check` looks."""

LARGEST = 1e12
"""Largest size of a value; more is a matter of wrong units, and squares of it soon overflow."""

_ASSUMED = "assumed"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaqueParameters:
    """Rates, mechanics and boundary values of the plaque model. The defaults are the preset `demo`.

    Attributes
    ----------
    Psi_l : TimeSeries
        Influx of modLDL through the endothelium, 0 or more; a number, or ``{"times": [...], "values": [...]}``. `Psi_l(t)` is its value.
    Psi_m : float
        Influx of macrophages per unit of modLDL at the endothelium: L'(t) = Psi_m l(0, t).
    k_l : float
        Rate at which macrophages take up modLDL.
    k_m : float
        Rate at which macrophages that take up modLDL die.
    b : float
        Drag between the phases.
    mu_n, lambda_n, mu_m, lambda_m : float
        Viscosities of the necrotic phase and the macrophages. In one dimension only nu = 2 mu + lambda enters; lambda may be
        negative as long as nu is not. Both nu 0 is the inviscid model.
    A, B, k : float
        Pressure difference of the macrophages, Sigma(l) = A / (1 + B l^k).
    p_out : float
        Traction at the outer wall, which sets the level of the pressure.
    momentum : "interfacial" or "drag"
        With the force p_n grad n between the phases, or with drag only, as printed in the paper.
    inner_wall : "no_gradient" or float
        Condition on n at the endothelium: n_x = 0, or the given n.
    """

    Psi_l: Any = parameter(1.0, symbol="Ψ_l", kind="series", low=0.0, source=_ASSUMED, doc="the influx of modLDL, Psi_l,")  # noqa: RUF009
    Psi_m: float = parameter(0.2, symbol="Ψ_m", low=0.0, source=_ASSUMED, doc="the influx of macrophages per modLDL, Psi_m,")
    k_l: float = parameter(10.0, symbol="k_l", low=0.0, source=_ASSUMED, doc="the uptake rate of modLDL, k_l,")
    k_m: float = parameter(1.0, symbol="k_m", low=0.0, source=_ASSUMED, doc="the death rate of macrophages, k_m,")
    b: float = parameter(1.0, symbol="b", low=0.0, low_open=True, source="1 by choice of the pressure unit", doc="the drag b")
    mu_n: float = parameter(0.005, symbol="μ_n", low=0.0, source=_ASSUMED, doc="the shear viscosity mu_n of the necrotic phase")
    lambda_n: float = parameter(0.0, symbol="λ_n", source=_ASSUMED, doc="the viscosity lambda_n of the necrotic phase")
    mu_m: float = parameter(0.005, symbol="μ_m", low=0.0, source=_ASSUMED, doc="the shear viscosity mu_m of the macrophages")
    lambda_m: float = parameter(0.0, symbol="λ_m", source=_ASSUMED, doc="the viscosity lambda_m of the macrophages")
    A: float = parameter(0.1, symbol="A", low=0.0, source=_ASSUMED, doc="the motility pressure A")
    B: float = parameter(1.0, symbol="B", low=0.0, source=_ASSUMED, doc="the chemotactic constant B")
    k: float = parameter(1.0, symbol="k", low=0.0, low_open=True, source=_ASSUMED, doc="the chemotactic exponent k")
    p_out: float = parameter(0.0, symbol="p_out", source=_ASSUMED, doc="the outer traction p_out")
    momentum: str = parameter("interfacial", symbol="-", choices=("interfacial", "drag"), doc="the form of the momentum equations")
    inner_wall: Any = parameter(  # noqa: RUF009
        "no_gradient", symbol="n(0,t)", kind="number", choices=("no_gradient",), low=0.0, low_open=True, high=1.0, high_open=True,
        doc="the condition on n at the endothelium",
    )  # fmt: skip

    table: ClassVar[str] = "parameters"

    def __post_init__(self) -> None:
        validate(self, self.table)
        for phase, mu, lam in (("n", self.mu_n, self.lambda_n), ("m", self.mu_m, self.lambda_m)):
            if 2.0 * mu + lam < 0.0:
                raise ParameterError(
                    f"{self.table}.lambda_{phase}",
                    f"{lam:g} with mu_{phase} = {mu:g} makes the viscosity nu_{phase} = 2 mu_{phase} + lambda_{phase} = {2.0 * mu + lam:g} "
                    f"negative; lambda_{phase} must be {-2.0 * mu:g} or more.",
                )

        if not isinstance(self.inner_wall, str) and self.nu_m == 0.0:
            raise ParameterError(
                f"{self.table}.inner_wall",
                f"{self.inner_wall:g} cannot be imposed on macrophages without viscosity (mu_m and lambda_m 0): nothing of n enters at the "
                'endothelium then. Write inner_wall = "no_gradient", or give the macrophages a viscosity.',
            )

    @property
    def nu_n(self) -> float:
        """Viscosity of the necrotic phase in one dimension, 2 mu_n + lambda_n."""
        return viscosity(self.mu_n, self.lambda_n)

    @property
    def nu_m(self) -> float:
        """Viscosity of the macrophages in one dimension, 2 mu_m + lambda_m."""
        return viscosity(self.mu_m, self.lambda_m)

    @property
    def nu(self) -> tuple[float, float]:
        """Both viscosities, (nu_n, nu_m)."""
        return self.nu_n, self.nu_m

    @classmethod
    def preset(cls, name: str) -> PlaqueParameters:
        """The parameters of a preset: "demo", "mouse" or "human"."""
        return cls(**find_preset(name).parameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaqueInitial:
    """The intima at t = 0. The defaults are the preset `demo`.

    Attributes
    ----------
    n : PositionFunction
        Fraction of the necrotic phase (and matrix), from 0 to 1.
    l : PositionFunction
        Concentration of modLDL, 0 or more.
    L : float
        Width of the intima.

    Notes
    -----
    n and l may each be a number, ``{"at": [...], "values": [...]}`` with positions from 0 to L, a formula in x (0 at the
    endothelium) and xi = x/L, or a Python function of x or xi. A Python function is sampled at 2001 equally spaced points and
    from then on is the piecewise linear function through them, so that the stored scene says exactly what was run.
    """

    n: Any = parameter(0.9, symbol="n", kind="function", low=0.0, high=1.0, source=_ASSUMED, doc="the initial necrotic fraction n")  # noqa: RUF009
    l: Any = parameter(0.0, symbol="l", kind="function", low=0.0, source=_ASSUMED, doc="the initial concentration l of modLDL")  # noqa: RUF009
    L: float = parameter(1.0, symbol="L", low=0.0, low_open=True, source=_ASSUMED, doc="the initial width L")

    table: ClassVar[str] = "initial"

    def __post_init__(self) -> None:
        validate(self, self.table)
        for name in ("n", "l"):
            object.__setattr__(self, name, getattr(self, name).with_length(self.L))

    @classmethod
    def preset(cls, name: str) -> PlaqueInitial:
        """The initial state of a preset: "demo", "mouse" or "human"."""
        return cls(**find_preset(name).initial)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaqueGeometry:
    """The shape of the wall.

    Attributes
    ----------
    kind : "slab" or "annulus"
        A flat intima, 0 <= x <= L(t), or the wall of a round vessel, R_1 <= r <= R_1 + L(t), that is the same all round.
    lumen_radius : float or None
        R_1, which stays as it is: the wall grows outwards. Needed in the annulus, meaningless in the slab.
    """

    kind: str = parameter("slab", symbol="-", choices=("slab", "annulus"), doc="the kind of geometry")
    lumen_radius: float | None = parameter(
        None, symbol="R_1", kind="number", low=0.0, low_open=True, high=LARGEST, doc="the radius of the lumen, R_1,"
    )

    table: ClassVar[str] = "geometry"

    def __post_init__(self) -> None:
        validate(self, self.table)
        if self.kind == "annulus" and self.lumen_radius is None:
            raise ParameterError(
                f"{self.table}.lumen_radius", "an annulus needs the radius of its lumen, in the unit of L: lumen_radius = 10, for instance."
            )
        if self.kind == "slab" and self.lumen_radius is not None:
            raise ParameterError(
                f"{self.table}.lumen_radius",
                f'{self.lumen_radius:g} has no meaning in a slab; leave it out, or write kind = "annulus".',
            )

    @property
    def annulus(self) -> bool:
        """Whether the wall is curved."""
        return self.kind == "annulus"

    @property
    def inner_radius(self) -> float:
        """R_1; 1 in the slab, whose size per radian of a circle of radius 1 is its width."""
        return self.lumen_radius if self.lumen_radius is not None else 1.0

    def size(self, L: float) -> float:
        """Size W of a wall of width L: L itself, or the area per radian ``((R_1 + L)^2 - R_1^2)/2``."""
        return L * (self.inner_radius + 0.5 * L) if self.annulus else L

    def width(self, W: Number) -> Number:
        """Width L of a wall of size W; the inverse of `size`, without cancellation."""
        if not self.annulus:
            return W
        R_1 = self.inner_radius
        width: Number = 2.0 * W / (R_1 + np.sqrt(R_1 * R_1 + 2.0 * W))
        return width

    def position(self, share: Number, W: float) -> Number:
        """Distance x from the endothelium within which a share of the wall lies, from 0 to 1."""
        return self.width(share * W)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaqueSolver:
    """How the equations are solved.

    Attributes
    ----------
    method : "auto", "lines" or "fipy"
        The compiled method of lines, which "auto" stands for, or FiPy, which takes further terms and species.
    cells : int
        Number of cells across the intima, 4 or more.
    rtol : float
        Accuracy asked of each time step, greater than 0 and at most 0.1.
    time_scheme : "auto", "radau", "bdf2" or "backward-euler"
        "auto" is Radau IIA of order five for lines, and BDF of order two for fipy, which has no other of high order.
    dt : float or None
        A fixed time step; None lets the error control choose.
    max_steps : int
        Steps after which the run gives up.
    """

    method: str = parameter("auto", symbol="-", choices=("auto", "lines", "fipy"), doc="the method")
    cells: int = parameter(100, symbol="N", low=4, high=1_000_000, doc="the number of cells")
    rtol: float = parameter(1e-4, symbol="rtol", low=1e-12, high=0.1, doc="the accuracy rtol")
    time_scheme: str = parameter("auto", symbol="-", choices=("auto", "radau", "bdf2", "backward-euler"), doc="the time scheme")
    dt: float | None = parameter(None, symbol="Δt", kind="number", low=0.0, low_open=True, doc="the fixed time step dt")
    max_steps: int = parameter(100_000, symbol="-", low=1, doc="the largest number of steps")

    table: ClassVar[str] = "solver"

    def __post_init__(self) -> None:
        validate(self, self.table)
        if self.method == "fipy" and self.time_scheme == "radau":
            raise ParameterError(
                f"{self.table}.time_scheme", '"radau" comes with the method "lines" only; take method = "lines", or time_scheme = "bdf2".'
            )

    @property
    def resolved(self) -> tuple[str, str]:
        """Method and time scheme that "auto" stands for."""
        method = "lines" if self.method == "auto" else self.method
        scheme = self.time_scheme if self.time_scheme != "auto" else "radau" if method == "lines" else "bdf2"
        return method, scheme


def find_preset(name: str) -> Preset:
    """The preset called `name`; raises ParameterError that names the nearest one."""
    if name not in PRESETS:
        hint = nearest(name, PRESETS)
        raise ParameterError("parameters.preset", f'there is no preset "{name}"{hint} The presets are {", ".join(PRESETS)}.')
    return PRESETS[name]


def check(parameters: PlaqueParameters, initial: PlaqueInitial) -> None:
    """Refuse what only the parameters and the initial state together show, before any work starts.

    Raises
    ------
    ParameterError
        At ``initial.n`` or ``initial.l`` where the initial state leaves its range; at ``parameters.k`` where k < 1 meets l = 0; at
        ``parameters.momentum`` where the drag-only form without viscosity has a negative diffusivity.
    """
    _check_sizes(parameters, initial)
    xi = np.linspace(0.0, 1.0, POSITIONS)
    x = initial.L * xi
    n, l = _within(initial.n, x, xi, "n", 1.0), _within(initial.l, x, xi, "l", LARGEST)
    if parameters.B > 0.0 and np.max(l) > 1.0 and np.log10(parameters.B) + parameters.k * np.log10(np.max(l)) > 100.0:
        raise ParameterError(
            "parameters.k", f"{parameters.k:g} with B = {parameters.B:g} and l = {np.max(l):g} makes B l^k overflow; lower k or l."
        )
    if parameters.k < 1.0 and np.any(l == 0.0):
        raise ParameterError(
            "parameters.k",
            f"{parameters.k:g} cannot be used because l = 0 at x = {x[np.argmax(l == 0.0)]:.6g} initially: for k < 1 the slope of "
            "Sigma = A/(1 + B l^k) is infinite at l = 0. Take k of 1 or more, or an initial l above 0 everywhere.",
        )
    if parameters.momentum == "drag" and parameters.nu_n == 0.0 and parameters.nu_m == 0.0:
        stress = extra_stress(l, parameters.A, parameters.B, parameters.k)
        diffusivity = drag_diffusivity(n, stress, parameters.p_out)
        i = int(np.argmin(diffusivity))
        if diffusivity[i] < 0.0:
            raise ParameterError(
                "parameters.momentum",
                f'"drag" without viscosity needs a diffusivity p_out - (1 - 2n) Sigma(l) of 0 or more, but it is {diffusivity[i]:.6g} at '
                f"x = {x[i]:.6g} initially (n = {n[i]:.6g}, l = {l[i]:.6g}), so the equations have no solution that depends continuously "
                f"on the data. Give a phase viscosity (mu_n or mu_m above 0), or raise p_out to A = {parameters.A:g} or more, or use "
                'momentum = "interfacial".',
            )


def _check_sizes(parameters: PlaqueParameters, initial: PlaqueInitial) -> None:
    """Refuse sizes that only a wrong unit explains, and positions outside of the intima."""
    for table, part in (("parameters", parameters), ("initial", initial)):
        for item in fields(part):
            value = getattr(part, item.name)
            listed = value.values if isinstance(value, TimeSeries) else value.listed if isinstance(value, PositionFunction) else (value,)
            for number in listed:
                if isinstance(number, float) and abs(number) > LARGEST:
                    raise ParameterError(
                        f"{table}.{item.name}",
                        f"{number:g} is beyond {LARGEST:g}; everything here is dimensionless, so choose other units.",
                    )
    if not 1.0 / LARGEST <= initial.L <= LARGEST:
        raise ParameterError("initial.L", f"{initial.L:g} must lie from {1.0 / LARGEST:g} to {LARGEST:g}; it is dimensionless.")
    for name in ("n", "l"):
        extent = getattr(initial, name).extent
        if extent is not None and (extent[0] < 0.0 or extent[1] > initial.L * (1.0 + 1e-9)):
            raise ParameterError(
                f"initial.{name}",
                f"its positions go from {extent[0]:g} to {extent[1]:g}, but the intima from 0 to L = {initial.L:g}; positions are "
                "dimensionless, like L.",
            )


def _within(function: PositionFunction, x: Any, xi: Any, name: str, high: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values of an initial function, which must lie from 0 to `high`."""
    values = function(x=x, xi=xi)
    outside = (values < 0.0) | (values > high)
    if np.any(outside):
        i = int(np.argmax(np.maximum(-values, values - high)))
        allowed = "stay from 0 to 1" if high == 1.0 else "be 0 or more"
        raise ParameterError(
            f"initial.{name}", f"{name} is {values[i]:.15g} at x = {x[i]:.6g} (xi = {xi[i]:.6g}); it must {allowed} everywhere."
        )
    return values


_LENGTH_UM = 100.0
_TIME_S = (_LENGTH_UM * 1e-6) ** 2 / 5.4e-12  # X²/D_l = 1852 s
_WEEK_S = 7 * 86400.0
_YEAR_S = 365.25 * 86400.0


def _scales(seconds: float, unit: str) -> dict[str, Any]:
    return {
        "length": {"value": _LENGTH_UM, "unit": "µm"},
        "time": {"value": _TIME_S / seconds, "unit": unit},
        "concentration": {"value": 1.0, "unit": "plasma LDL"},
        "pressure": {"value": 100.0, "unit": "kPa"},
    }


_DEMO_SOURCE = """\
All values are assumed: they put Gamma = k_l Psi_m^2/k_m^2 at 0.4, where macrophage influx and loss balance, and make growth fast enough
to watch. b = 1 is the choice of the pressure unit."""

_SHARED_SOURCE = """\
Psi_l = P X/D_l = 2e-3 with X = 100 µm, D_l = 5.4e-12 m²/s (as quoted from Yang & Vafai 2006, not checked there) and the LDL
permeability P = 1.1e-10 m/s of the normal rabbit aortic arch (Nielsen et al., Arterioscler. Thromb.); an upper value, the clearance
of human carotid atheroma, is 2.5e-9 m/s (Shaikh et al. 1991, doi 10.1161/01.atv.11.3.569).
k_l = 4: assumed, an uptake of modified LDL of about 8 per hour and unit macrophage fraction (after Brown & Goldstein 1983, not
checked there).
A = 3e-3: assumed, between two published motilities of macrophages in units of D_l, 1e-4 (J. Houle's published plaque code) and
0.11 (from the cell speeds of Farrell 1990).
B = 500, k = 1, viscosities nu = 0.01 (mu = nu/2, lambda = 0), n = 0.95, l = 0, p_out = 0: assumed. b = 1 is the choice of the
pressure unit.
L = 1, 100 µm: assumed, within the 10 to 200 µm of mouse and human intimas.
Scales: X = 100 µm; X²/D_l = 1852 s; plasma LDL; pressure unit 100 kPa, assumed so that A is 300 Pa."""

_MOUSE_SOURCE = f"""\
k_m = 0.35: derived from k_m/k_l = 0.09, the ratio that gives a growth of about 6 µm a week, an assumed rate for mice on an
atherogenic diet.
Psi_m = 0.13: assumed, from Gamma = k_l Psi_m^2/k_m^2 = 0.55. Check: a macrophage then lives 36 days; measured, about 4 weeks
(Robbins et al. 2013, doi 10.1038/nm.3258).
{_SHARED_SOURCE}"""

_HUMAN_SOURCE = f"""\
k_m = 0.0136: derived from k_m/k_l = 3.4e-3, the ratio that gives the measured progression of the common carotid intima-media thickness,
11.8 µm a year (MESA, doi 10.1161/STROKEAHA.114.005669).
Psi_m = 5e-3: assumed, from Gamma = k_l Psi_m^2/k_m^2 = 0.54.
{_SHARED_SOURCE}"""

PRESETS: Mapping[str, Preset] = {
    "demo": Preset(
        title="demonstration, growth accelerated",
        parameters={
            "Psi_l": 1.0, "Psi_m": 0.2, "k_l": 10.0, "k_m": 1.0, "b": 1.0, "mu_n": 0.005, "lambda_n": 0.0, "mu_m": 0.005, "lambda_m": 0.0,
            "A": 0.1, "B": 1.0, "k": 1.0, "p_out": 0.0,
        },
        initial={"n": 0.9, "l": 0.0, "L": 1.0},
        scales=None,
        source=_DEMO_SOURCE,
    ),
    "mouse": Preset(
        title="mouse-like, on an atherogenic diet",
        parameters={
            "Psi_l": 2e-3, "Psi_m": 0.13, "k_l": 4.0, "k_m": 0.35, "b": 1.0, "mu_n": 0.005, "lambda_n": 0.0, "mu_m": 0.005,
            "lambda_m": 0.0, "A": 3e-3, "B": 500.0, "k": 1.0, "p_out": 0.0,
        },
        initial={"n": 0.95, "l": 0.0, "L": 1.0},
        scales=_scales(_WEEK_S, "week"),
        source=_MOUSE_SOURCE,
    ),
    "human": Preset(
        title="human-like, over decades",
        parameters={
            "Psi_l": 2e-3, "Psi_m": 5e-3, "k_l": 4.0, "k_m": 0.0136, "b": 1.0, "mu_n": 0.005, "lambda_n": 0.0, "mu_m": 0.005,
            "lambda_m": 0.0, "A": 3e-3, "B": 500.0, "k": 1.0, "p_out": 0.0,
        },
        initial={"n": 0.95, "l": 0.0, "L": 1.0},
        scales=_scales(_YEAR_S, "year"),
        source=_HUMAN_SOURCE,
    ),
}  # fmt: skip
