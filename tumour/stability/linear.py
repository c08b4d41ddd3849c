"""What a small change of shape does to stress and flux at a point of a radial disk or ball; see `tumour.stability` for the symbols."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Moduli(NamedTuple):
    """How the change of P depends on that of F and on T_1, the change of p + alpha Sigma:

    ``p_rr = rr H_rr + (m-1) rt H_tt - (J/l_r) T_1``, ``p_tt = rt H_rr + tt H_tt - (J/l_t) T_1``, ``p_rt = shear H_rt + turn H_tr``,
    ``p_tr = shear H_tr + turn H_rt``, and in a ball ``p_s = side H_s``.
    """

    rr: Array
    rt: Array
    tt: Array
    shear: Array
    turn: Array
    side: Array


def moduli(l_r: Array, l_t: Array, g: Array, mu: float, bulk: float | Array, m: int = 2) -> Moduli:
    """The moduli at stretches l_r and l_t, where ``g = lambda (J - 1) - p - alpha Sigma``.

    `bulk` is what the pressure-like part of the stress, ``lambda (J - 1) - T``, gains per change of J: lambda where T_1 is written by
    itself, more where T_1 follows from the change of J.
    """
    along, across = l_t ** (m - 1), l_r * l_t ** (m - 2)  # J/l_r and J/l_t
    rr = mu * (1.0 + 1.0 / l_r**2) + bulk * along**2
    rt = g * l_t ** (m - 2) + bulk * along * across
    tt = mu * (1.0 + 1.0 / l_t**2) + (m - 2) * g * l_r + (m - 1) * bulk * across**2
    return Moduli(rr, rt, tt, mu + 0.0 * l_r, mu / (l_r * l_t) - g * l_t ** (m - 2), mu * (1.0 + 1.0 / l_t**2) - g * l_r)


class Flux(NamedTuple):
    """How the change of the flux ``J F^-1 F^-T grad p`` depends on those of F and p, p' being dp/dR of the radial state:

    ``f_r = along p_1' + p' (by_tt H_tt + by_rr H_rr)``, ``f_t = across (-(k/R) p_1) + p' (by_tr H_tr + by_rt H_rt)``.
    """

    along: Array
    across: Array
    by_rr: Array
    by_tt: Array
    by_rt: Array
    by_tr: Array


def flux(l_r: Array, l_t: Array, m: int = 2) -> Flux:
    """The coefficients at stretches l_r and l_t, per unit of mobility."""
    shear = l_t ** (m - 2)
    along, across = l_t ** (m - 1) / l_r, l_r * l_t ** (m - 3)
    return Flux(along, across, -along / l_r, (m - 1) * shear / l_r, -shear / l_t, -shear / l_r)
