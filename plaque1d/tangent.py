r"""The exact tangent of the discrete plaque, as one sparse matrix.

Rows and columns in the order of `Layout`: n, l (cells), w (interior faces), L, V. The rows are those of
`plaque1d.discretisation`, followed by ``alpha (L - L_past) - V = 0`` and ``V - Psi_m l_wall(l_0, L) = 0``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from plaque1d import equations as eq
from plaque1d.discretisation import LdlFlux, NecroticFlux, Slip, slip_couplings, wall_fraction
from plaque1d.parameters import PlaqueParameters

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Layout:
    """Where each unknown stands in the Newton vector and each state in the time loop's vector.

    The loop's vector is ``[L n, L l, w, L, V, (species), source integrals]``; the integrals are those of n's source, l's
    sink, the modLDL influx and V.
    """

    cells: int
    species: int = 0

    @property
    def n(self) -> slice:
        return slice(0, self.cells)

    @property
    def l(self) -> slice:  # noqa: E743 - the paper's symbol
        return slice(self.cells, 2 * self.cells)

    @property
    def w(self) -> slice:
        return slice(2 * self.cells, 3 * self.cells - 1)

    @property
    def L(self) -> int:
        return 3 * self.cells - 1

    @property
    def V(self) -> int:
        return 3 * self.cells

    def extra(self, index: int) -> slice:
        """Species number `index`."""
        first = 3 * self.cells + 1 + index * self.cells
        return slice(first, first + self.cells)

    @property
    def unknowns(self) -> int:
        """Size of the Newton system."""
        return 3 * self.cells + 1 + self.species * self.cells

    @property
    def integrals(self) -> slice:
        return slice(self.unknowns, self.unknowns + 4)

    @property
    def size(self) -> int:
        """Size of the loop's vector."""
        return self.unknowns + 4


class Triplets:
    """Entries of a sparse matrix, gathered block by block; entries off the matrix (column < 0 in a block) are the
    caller's to avoid."""

    def __init__(self) -> None:
        self._rows: list[Index] = []
        self._columns: list[Index] = []
        self._values: list[Array] = []

    def add(self, rows: Index | int, columns: Index | int, values: Array | float) -> None:
        row, column, value = np.broadcast_arrays(rows, columns, np.asarray(values, dtype=float))
        self._rows.append(row.ravel())
        self._columns.append(column.ravel())
        self._values.append(value.ravel())

    def matrix(self, size: int) -> csc_matrix:
        data = (np.concatenate(self._values), (np.concatenate(self._rows), np.concatenate(self._columns)))
        return csc_matrix(data, shape=(size, size))


def tangent(
    p: PlaqueParameters,
    layout: Layout,
    alpha: float,
    Psi_l: float,
    n: Array,
    l: Array,
    w: Array,
    L: float,
    V: float,
    F: NecroticFlux,
    G: LdlFlux,
    s: Slip,
) -> Triplets:
    """Entries of the tangent at (n, l, w, L, V); the fluxes and slip coefficients are those of the same state."""
    N, h = layout.cells, 1.0 / layout.cells
    out = Triplets()
    cell = np.arange(N)
    _reactions(out, p, layout, alpha, n, l, L, h, cell)
    inner, outer = cell[:-1], cell[1:]  # cells on both sides of the interior faces
    for side, sign in ((inner, 1.0), (outer, -1.0)):
        columns = np.clip(inner[:, None] + np.arange(-1, 3), 0, N - 1)
        out.add(side[:, None], columns, sign * F.d_n)
        out.add(side, layout.w.start + inner, sign * F.d_w)
        out.add(side, layout.V, sign * F.d_V)
        out.add(N + side, N + inner, sign * G.d_inner)
        out.add(N + side, N + outer, sign * G.d_outer)
        out.add(N + side, layout.L, sign * G.d_L)
        out.add(N + side, layout.V, sign * G.d_V)
    _slip(out, p, layout, w, L, s)
    out.add(layout.L, layout.L, alpha)
    out.add(layout.L, layout.V, -1.0)
    d_inner, d_distance = eq.wall_concentration_slopes(float(l[0]), 0.5 * h * L, Psi_l, p.Psi_m)
    out.add(layout.V, layout.V, 1.0)
    out.add(layout.V, N, -p.Psi_m * d_inner)
    out.add(layout.V, layout.L, -p.Psi_m * d_distance * 0.5 * h)
    return out


def _reactions(
    out: Triplets, p: PlaqueParameters, layout: Layout, alpha: float, n: Array, l: Array, L: float, h: float, cell: Index
) -> None:
    """Time derivative and reactions of n and l."""
    N = layout.cells
    rate_l, rate_n = eq.uptake_slopes(l, n)
    rate = eq.uptake(l, n)
    out.add(cell, cell, h * L * (alpha - p.k_m * rate_n))
    out.add(cell, N + cell, -h * L * p.k_m * rate_l)
    out.add(cell, layout.L, h * (alpha * n - p.k_m * rate))
    out.add(N + cell, N + cell, h * L * (alpha + p.k_l * rate_l))
    out.add(N + cell, cell, h * L * p.k_l * rate_n)
    out.add(N + cell, layout.L, h * (alpha * l + p.k_l * rate))


def _slip(out: Triplets, p: PlaqueParameters, layout: Layout, w: Array, L: float, s: Slip) -> None:
    """Rows of the slip equation."""
    N, h = layout.cells, 1.0 / layout.cells
    face = np.arange(1, N)  # interior faces; row number = first + face - 1
    rows = layout.w.start + face - 1
    for term, product, flux in slip_couplings(s, w):
        step = np.diff(product)
        # dR = (M_{f-1} - M_f) dr_f + r_f (dM_{f-1} - dM_f),   M = flux / h
        _face_fraction(out, rows, face, (flux[face - 1] - flux[face]) / h * term.r_n[face])
        out.add(rows, face - 1, term.r[face] * step[face - 1] * term.kappa_n[face - 1] / h)
        out.add(rows, face, -term.r[face] * step[face] * term.kappa_n[face] / h)
        for shift, weight in ((-1, -term.kappa[face - 1]), (0, term.kappa[face - 1] + term.kappa[face]), (1, -term.kappa[face])):
            other = face + shift
            inside = (other >= 1) & (other <= N - 1)
            scale = term.r[face] * weight / h
            r, g = scale[inside], other[inside]
            out.add(rows[inside], layout.w.start + g - 1, r * term.r[g])
            _face_fraction(out, rows[inside], g, r * w[g - 1] * term.r_n[g])
            if shift == -1:  # face 0, the inner wall
                wall_n = term.r_n[0] * s.w_wall * (0.0 if wall_fraction(p) is not None else 1.0) + term.r[0] * s.w_wall_n
                out.add(int(rows[0]), 0, scale[0] * wall_n)
                out.add(int(rows[0]), layout.V, scale[0] * term.r[0] * s.w_wall_V)
    out.add(rows, layout.w.start + face - 1, h * L * L * s.zeta)
    _face_fraction(out, rows, face, h * L * L * w * s.zeta_n)
    jump = np.diff(s.phi)
    out.add(rows, layout.L, 2.0 * h * L * s.zeta * w - s.row * jump)
    _face_fraction(out, rows, face, -L * jump * s.row_n)
    for columns, phi_sign in ((face, -1.0), (face - 1, 1.0)):
        out.add(rows, columns, phi_sign * L * s.row * s.phi_n[columns])
        out.add(rows, N + columns, phi_sign * L * s.row * s.phi_l[columns])


def _face_fraction(out: Triplets, rows: Index, face: Index, values: Array) -> None:
    """Entries for a dependence on the mean fraction of a face, ``(n_{f-1} + n_f) / 2``."""
    out.add(rows, face - 1, 0.5 * values)
    out.add(rows, face, 0.5 * values)
