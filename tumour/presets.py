"""Named, sourced values of the tumour model."""

from __future__ import annotations

from collections.abc import Mapping

from multiphase.errors import ParameterError
from multiphase.model import Preset
from multiphase.parameters import nearest

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


def find_preset(name: str) -> Preset:
    """The preset called `name`; raises ParameterError that names the nearest one."""
    if name not in PRESETS:
        hint = nearest(name, PRESETS)
        raise ParameterError("parameters.preset", f'there is no preset "{name}"{hint} The presets are {", ".join(PRESETS)}.')
    return PRESETS[name]
