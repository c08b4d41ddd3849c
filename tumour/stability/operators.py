r"""Changes of shape on the faces and cells of a radial grid, and banded matrices made of them.

Unknowns: U on the faces 0 to N, V at the middles of the cells and on the surface. The normal parts of H live in the cells, where r(R) has
its stretches, the shear parts on the faces 1 to N, from whose middles they take what lies around (`Grid.cells`, `Grid.faces`: the areas per
radian of both, which add up to R_0^2/2 each; in a ball volumes per steradian, R_0^3/3):

    H_rr = Delta U/h,   H_tt = (k V/(m-1) + U)/R  in cells;      H_tr = Delta V/h,   H_rt = -(k U + V)/R  on faces,

and in cells of a ball ``H_s = sqrt((l-1)(l+2)/2) V/R``.

Sums of ``a^T diag(c) b`` over pairs of such operators are what all matrices consist of. The operators stay, c changes with the state, so
the entries are one sparse matrix times all c (`Pattern`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Matrix = Any


@dataclass(frozen=True, slots=True)
class Grid:
    """Operators on the unknowns (U_0 ... U_N, V_0 ... V_{N-1}, V_surface) for one wave number of a disk, or one degree of a ball.

    Attributes
    ----------
    m : int
        2 for a disk, 3 for a ball.
    k : float
        The wave number; in a ball that of a degree, sqrt(l (l + 1)).
    R, middles : (N + 1,), (N,) array
        Faces, and middles of the cells, at rest.
    cells, faces : (N,) array
        Areas at rest per radian (volumes per steradian) around the middles of the cells, and around the faces 1 to N.
    H_rr, H_tt, H_s : (N, 2 N + 2) matrix
    H_tr, H_rt : (N, 2 N + 2) matrix
    U, V : (N, 2 N + 2) matrix
        Both on the faces 1 to N.
    gap : (N, 2 N + 2) matrix
        What U makes of the distances over the faces 1 to N from middle to middle, and from the last one to the surface.
    """

    m: int
    k: float
    R: Array
    middles: Array
    cells: Array
    faces: Array
    H_rr: Matrix
    H_tt: Matrix
    H_s: Matrix
    H_tr: Matrix
    H_rt: Matrix
    U: Matrix
    V: Matrix
    gap: Matrix


def grid(radius: float, N: int, number: int, m: int = 2) -> Grid:
    """The operators of a wave number, or in a ball of a degree, on N cells that are equal at rest."""
    k = float(number) if m == 2 else float(np.sqrt(number * (number + 1)))
    side = 0.0 if m == 2 else float(np.sqrt(max((number - 1) * (number + 2), 0) / 2))
    R = np.linspace(0.0, radius, N + 1)
    h, middles = R[1], 0.5 * (R[1:] + R[:-1])
    U_m, U_p = unit(N, N + 1), unit(N, N + 1, 1)
    V_m, V_p = unit(N, N + 1), unit(N, N + 1, 1)  # of the faces 1 to N: below, and above or on the surface
    around = sparse.diags_array(np.append(np.full(N - 1, 0.5), 0.0)) @ V_m + sparse.diags_array(np.append(np.full(N - 1, 0.5), 1.0)) @ V_p
    none = sparse.csr_array((N, N + 1))
    edges = np.concatenate([[0.0], middles[1:], [radius]])  # between the faces; the first has all around the centre
    return Grid(
        m=m,
        k=k,
        R=R,
        middles=middles,
        cells=np.diff(R**m) / m,
        faces=np.diff(edges**m) / m,
        H_rr=_both((U_p - U_m) / h, none),
        H_tt=_both(sparse.diags_array(0.5 / middles) @ (U_p + U_m), sparse.diags_array(k / (m - 1) / middles) @ V_m),
        H_s=_both(none, sparse.diags_array(side / middles) @ V_m),
        H_tr=_both(none, sparse.diags_array(np.append(np.full(N - 1, 1.0 / h), 2.0 / h)) @ (V_p - V_m)),
        H_rt=_both(sparse.diags_array(-k / R[1:]) @ U_p, sparse.diags_array(-1.0 / R[1:]) @ around),
        U=_both(U_p, none),
        V=_both(none, around),
        gap=_both(0.5 * (sparse.vstack([U_p[1:], U_p[-1:]]) - U_m), none),
    )


def unit(rows: int, columns: int, offset: int = 0) -> Matrix:
    """Ones on one diagonal."""
    return sparse.diags_array([1.0], offsets=[offset], shape=(rows, columns)).tocsr()


def _both(of_U: Matrix, of_V: Matrix) -> Matrix:
    return sparse.hstack([of_U, of_V]).tocsr()


class Pattern:
    """A banded matrix ``sum a^T diag(c) b`` whose operators stay and whose coefficients change.

    Parameters
    ----------
    terms : sequence of (name, a, b)
        Matrices with as many rows as the coefficients called `name` have entries; several terms may share a name.
    order : (size,) int array
        The place of each unknown in the banded matrix.
    held : sequence of int
        Unknowns, in the order of the operators' columns, whose rows hold the diagonal alone: they are 0.
    symmetric : bool
        Whether what the held unknowns do to others is left out as well.

    Attributes
    ----------
    lower, upper : int
        Numbers of diagonals below and above the main one.
    """

    def __init__(
        self, terms: Sequence[tuple[str, Matrix, Matrix]], order: NDArray[np.int64], held: Sequence[int] = (), *, symmetric: bool = False
    ) -> None:
        self.size, self.names = len(order), list(dict.fromkeys(name for name, _, _ in terms))
        sizes = {name: a.shape[0] for name, a, _ in terms}
        starts = dict(zip(self.names, np.cumsum([0, *(sizes[name] for name in self.names)])[:-1].tolist(), strict=True))
        found = [np.concatenate(part) for part in zip(*(_entries(a, b, starts[name]) for name, a, b in terms), strict=True)]
        kept = ~np.isin(found[0], held) & ~(symmetric & np.isin(found[1], held))
        rows, columns = order[found[0][kept].astype(int)], order[found[1][kept].astype(int)]
        self.lower, self.upper = int(np.max(rows - columns)), int(np.max(columns - rows))
        places = (self.upper + rows - columns) * self.size + columns
        shape = ((self.lower + self.upper + 1) * self.size, sum(sizes.values()))
        self._map = sparse.csr_array((found[3][kept], (places, found[2][kept].astype(int))), shape=shape)
        self._held = order[np.array(held, dtype=int)]

    def band(self, coefficients: Mapping[str, Array], held: float = 1.0) -> Array:
        """The matrix in the banded form of `scipy.linalg.solve_banded`, (lower + upper + 1, size), with `held` in the rows of those."""
        band: Array = (self._map @ np.concatenate([coefficients[name] for name in self.names])).reshape(-1, self.size)
        band[self.upper, self._held] = held
        return band


def _entries(a: Matrix, b: Matrix, start: int) -> tuple[Array, Array, Array, Array]:
    """Row, column, number of the coefficient, and weight of all that ``a^T diag(c) b`` consists of."""
    a, b = sparse.coo_array(a), sparse.csr_array(b)
    counts = np.diff(b.indptr)[a.row]
    at = np.repeat(b.indptr[a.row] - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    of = np.repeat(a.row, counts)
    return np.repeat(a.col, counts), b.indices[at], start + of, np.repeat(a.data, counts) * b.data[at]
