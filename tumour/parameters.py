"""Parameters of the tumour model, in the paper's symbols spelt out, and its state at t = 0.

All values are dimensionless: lengths in units of the tumour's radius at rest, times in units of one over the rate of cell birth in
plenty of oxygen, oxygen in units of that outside, stresses in units of the cells' shear modulus or viscosity over that time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from multiphase.errors import ParameterError
from multiphase.parameters import parameter, replace, validate
from tumour.equations import MOBILITIES, critical_oxygen
from tumour.presets import find_preset

ELASTIC_FIELDS = ("alpha", "C", "p", "displacement", "J", "stress_magnitude")

VISCOUS_FIELDS = ("alpha", "C", "p", "u", "stress_magnitude")
"""What is stored in each formulation."""

_PAPER = "paper, quarter disk"

_PLANE = ("r", "xi", "x", "y", "theta")
"""The names that functions of position may use: distance from the middle, over the radius; in two dimensions also plane coordinates."""

TISSUE = ("stiffness", "permeability", "diffusivity", "consumption", "fibre_angle", "fibre_ratio", "fibre_stiffness")
"""The parameters that may differ from place to place and, with fibres, from direction to direction, in two dimensions."""


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
    stiffness : PositionFunction
        A factor m > 0 on mu_alpha and lambda_alpha.
    permeability, diffusivity : TensorFunction
        Symmetric positive definite tensors K, a factor on the fluid's mobility M(alpha), and D, the diffusivity of oxygen.
    consumption : PositionFunction
        A factor w >= 0 on the uptake of oxygen.
    fibre_angle : PositionFunction
        Angle of the fibres from the x axis in the body at rest, in radians: their direction is a_0 = (cos, sin).
    fibre_ratio : PositionFunction
        The cells' push along the fibres over that across, rho >= 0.
    fibre_stiffness : PositionFunction
        Stiffness k_f >= 0 of the fibres themselves.

    Notes
    -----
    The last seven are functions of position in the body at rest and belong to the elastic model in two dimensions (see `check`). Each
    is a number, a formula in x, y, r, theta and xi, a table over r, a grid of pixels or an image: see `PositionFunction`, and
    `TensorFunction` for K and D. With F the deformation gradient, J = det F, |F a_0| the fibres' stretch, Sigma the contact stress and
    the balances of cells and volume as in the paper, the stress per length at rest is

        P = m (mu_alpha (F - F^-T) + lambda_alpha J (J - 1) F^-T) - (p + alpha Sigma) J F^-T
            - (rho - 1) alpha Sigma J (F a_0) (x) a_0/|F a_0|^2 + 2 k_f (|F a_0|^2 - 1) (F a_0) (x) a_0,

    where (x) is the dyadic product, and the flows per length at rest are

        M(alpha) J U^-1 K U^-1 grad p   of the fluid,
        J U^-1 D U^-1 grad C            of oxygen, whose uptake is w J Q alpha C/(1 + Q1_hat C).

    *Fibres* are lines of the material: a_0 at rest becomes a = F a_0/|F a_0|. Which of its two senses an angle gives does not matter, as
    a_0 enters as a_0 (x) a_0 alone. A grid of angles is interpolated as numbers, so let them run on from pixel to pixel rather than jump
    by pi.

    *The cells' push* is the Cauchy stress -alpha Sigma (I + (rho - 1) a (x) a): across the fibres it is the paper's alpha Sigma, along
    them rho times that. The mechanics of active tissue knows two conventions for a stress along fibres. One takes the second Piola
    stress T_a a_0 (x) a_0, which follows from the energy T_a (|F a_0|^2 - 1)/2; it is usual for heart muscle, since with an energy the
    tangent is symmetric, and its force per area as it is depends on the deformation: T_a |F a_0|^2/J. The other takes the Cauchy
    stress T a (x) a along the fibres as they are, with T that force per area itself. The second is used here, since the push of
    cells, like the fluid's pressure, is a force per area as it is, and so that rho = 1 is the paper's push, the same in all directions, at
    every deformation. The stress turns with the body (F -> Q F gives P -> Q P). It follows from no energy, unless rho = 1: alpha Sigma J
    changes with the area while the stress along the fibres works on their stretch, so that the work around a closed path of
    deformations is not 0. That is no fault: the cells spend energy of their own.

    *K and D* turn with the tissue and keep their principal values. In the body as it is they are R K R^T and R D R^T, with the rotation
    R of the polar decomposition F = R U; on the body at rest that gives J F^-1 (R K R^T) F^-T = J U^-1 K U^-1. K = I gives the
    J F^-1 F^-T of the paper. K multiplies M(alpha), so the fluid still meets the more drag the more cells there are.

    *Stiff fibres* follow the standard reinforcing model, with the energy k_f (|F a_0|^2 - 1)^2/2 per area at rest. Shortened fibres
    buckle: against layers across them sliding over each other they resist as 2 k_f (|F a_0|^2 - 1), less than nothing as soon as |F a_0| <
    1, and only the cells hold, while 2 k_f (1 - |F a_0|^2) < m mu_alpha. Below |F a_0| = 1/sqrt(3) they get weaker along themselves too.

    *Where the push is too much.* Layers across the fibres hold against sliding while m mu_alpha + 2 k_f (|F a_0|^2 - 1) > (rho - 1)
    alpha Sigma J/|F a_0|^2, whatever lambda_alpha (that is where fibres lie along a principal stretch; else there is something more
    on the left). A body that grows freely and evenly keeps to that; one that is clamped or confined may not, and its run then ends.
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

    stiffness: Any = parameter(  # noqa: RUF009
        1.0, symbol="m", kind="function", variables=_PLANE, low=0.0, low_open=True, source="1 in the paper",
        doc="the stiffness, a factor on mu_alpha and lambda_alpha,",
    )  # fmt: skip
    permeability: Any = parameter(  # noqa: RUF009
        1.0, symbol="K", kind="tensor", variables=_PLANE, low=0.0, low_open=True, source="1 in the paper",
        doc="the permeability, a factor on the mobility,",
    )  # fmt: skip
    diffusivity: Any = parameter(  # noqa: RUF009
        1.0, symbol="D", kind="tensor", variables=_PLANE, low=0.0, low_open=True, source="1 in the paper, by choice of units",
        doc="the diffusivity of oxygen",
    )  # fmt: skip
    consumption: Any = parameter(  # noqa: RUF009
        1.0, symbol="w", kind="function", variables=_PLANE, low=0.0, source="1 in the paper",
        doc="the consumption, a factor on the uptake of oxygen,",
    )  # fmt: skip
    fibre_angle: Any = parameter(  # noqa: RUF009
        0.0, symbol="θ_f", unit="rad", kind="function", variables=_PLANE, source="no fibres in the paper",
        doc="the angle of the fibres from the x axis",
    )  # fmt: skip
    fibre_ratio: Any = parameter(  # noqa: RUF009
        1.0, symbol="ρ", kind="function", variables=_PLANE, low=0.0, source="1 in the paper, the same push in all directions",
        doc="the fibre ratio, the cells' push along the fibres over that across,",
    )  # fmt: skip
    fibre_stiffness: Any = parameter(  # noqa: RUF009
        0.0, symbol="k_f", kind="function", variables=_PLANE, low=0.0, source="0 in the paper", doc="the stiffness of the fibres"
    )

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
    def varying(self) -> tuple[str, ...]:
        """Names of those of the seven parameters of the tissue that are not at their defaults."""
        defaults = {item.name: item.default for item in fields(self)}
        return tuple(name for name in TISSUE if getattr(self, name) != defaults[name])

    @property
    def is_plain(self) -> bool:
        """Whether the tissue is the paper's: the same everywhere and in all directions, without fibres."""
        return not self.varying

    def within(self, radius: float) -> TumourParameters:
        """The same parameters on a body of another radius: Python functions are sampled again, the rest is as it was."""
        sampled = {name: getattr(self, name) for name in TISSUE if getattr(self, name).is_sampled}
        return replace(self, **{name: function.with_length(radius) for name, function in sampled.items()}) if sampled else self

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
    points of a body of radius 1; `within` samples it on another. In two dimensions a formula may also use x, y and the angle theta, and
    alpha be a grid of pixels or an image.
    """

    alpha: Any = parameter(  # noqa: RUF009
        0.8, symbol="α", kind="function", variables=_PLANE, low=0.0, low_open=True, high=1.0, high_open=True,
        source=_PAPER, doc="the initial cell fraction alpha",
    )  # fmt: skip

    table: ClassVar[str] = "initial"

    def __post_init__(self) -> None:
        validate(self, self.table)

    def within(self, radius: float) -> TumourInitial:
        """The same functions on a body of another radius: a Python function is sampled again, the rest is as it was."""
        return TumourInitial(alpha=self.alpha.with_length(radius))

    @classmethod
    def preset(cls, name: str) -> TumourInitial:
        """The initial state of a preset: "paper", "authors-disk", "authors-glioma" or "ward-king"."""
        return cls(**find_preset(name).initial)
