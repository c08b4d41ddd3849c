"""What a small change of shape does to stress and flux at a point of a radial disk; see `tumour.stability` for the symbols."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Moduli(NamedTuple):
    """How the change of P depends on that of F and on T_1, the change of p + alpha Sigma:

    ``p_rr = rr H_rr + rt H_tt - l_t T_1``, ``p_tt = rt H_rr + tt H_tt - l_r T_1``, ``p_rt = shear H_rt + turn H_tr``,
    ``p_tr = shear H_tr + turn H_rt``.
    """

    rr: Array
    rt: Array
    tt: Array
    shear: Array
    turn: Array


def moduli(l_r: Array, l_t: Array, g: Array, mu: float, bulk: float | Array) -> Moduli:
    """The moduli at stretches l_r and l_t, where ``g = lambda (J - 1) - p - alpha Sigma``.

    `bulk` is what the pressure-like part of the stress, ``lambda (J - 1) - T``, gains per change of J: lambda where T_1 is written by
    itself, more where T_1 follows from the change of J.
    """
    rr = mu * (1.0 + 1.0 / l_r**2) + bulk * l_t**2
    tt = mu * (1.0 + 1.0 / l_t**2) + bulk * l_r**2
    return Moduli(rr, g + bulk * l_r * l_t, tt, mu + 0.0 * l_r, mu / (l_r * l_t) - g)


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


def flux(l_r: Array, l_t: Array) -> Flux:
    """The coefficients at stretches l_r and l_t, per unit of mobility."""
    return Flux(l_t / l_r, l_r / l_t, -l_t / l_r**2, 1.0 / l_r, -1.0 / l_t, -1.0 / l_r)
