"""Parameters of the tumour model, in the paper's symbols spelt out, and its state at t = 0.

All values are dimensionless: lengths in units of the tumour's radius at rest, times in units of one over the rate of cell birth in
plenty of oxygen, oxygen in units of that outside, stresses in units of the cells' shear modulus or viscosity over that time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from multiphase.errors import ParameterError
from multiphase.parameters import parameter, validate
from tumour.equations import MOBILITIES, critical_oxygen
from tumour.presets import find_preset

ELASTIC_FIELDS = ("alpha", "C", "p", "displacement", "J", "stress_magnitude")

VISCOUS_FIELDS = ("alpha", "C", "p", "u", "stress_magnitude")
"""What is stored in each formulation."""

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
