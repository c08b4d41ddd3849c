"""The plaque's vector of unknowns, its constants, and the rows of its work space: what all parts of the discretisation share."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit

Array = Any

BORDER = 2
"""W and V."""
FLOOR = 1e-5
"""Floor of the fractions inside the slip equation; it changes w by a relative (FLOOR / fraction)^2."""

INTEGRALS = 3
"""Integrals over time of W times the mean uptake, of the influx of modLDL, and of V."""


class Data(NamedTuple):
    """What the kernels need of one scene: sizes, parameters, and Psi_l(t) = influx + influx_rate (t - t_0) between two breaks."""

    cells: int
    stride: int
    annulus: bool
    drag: bool
    inner_radius: float
    influx: float
    influx_rate: float
    t_0: float
    Psi_m: float
    k_l: float
    k_m: float
    b: float
    mu_n: float
    lambda_n: float
    mu_m: float
    lambda_m: float
    A: float
    B: float
    k: float
    p_out: float
    n_wall: float
    rtol: float
    l_reference: float
    floor: float


@njit(error_model="numpy")
def influx(d: Data, t: float) -> float:
    """Psi_l(t), linear between two breaks."""
    return d.influx + d.influx_rate * (t - d.t_0)


# Rows of the work space: values in cells (N) or on faces (N + 1).
N_ROW, L_ROW, RADIUS, STRESS, SLOPE, NF, CF, NC, CC, BACK, HERE, AHEAD, NF_N, CF_N, FACE = range(15)
WORK_ROWS = 15
