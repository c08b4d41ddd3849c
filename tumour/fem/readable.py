"""The sums over the elements by the readable forms of `tumour.fem.forms`, in the place of the compiled ones: for checks, and where nothing
can be compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from tumour import equations as eq
from tumour.fem.arrays import OUTER, Data, Edges, Elements, Pattern
from tumour.fem.forms import Forms
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]


class Readable:
    """Functions of the names and arguments of those of `tumour.fem.kernel`.

    Parameters
    ----------
    mesh : skfem.MeshTri
    parameters : TumourParameters
    constants : Data
    edges : Edges
    """

    def __init__(self, mesh: MeshTri, parameters: TumourParameters, constants: Data, edges: Edges) -> None:
        self.forms, self.parameters = Forms(mesh, parameters, constants, edges), parameters

    def __getitem__(self, name: str) -> Callable[..., Any]:
        found: Callable[..., Any] = getattr(self, name)
        return found

    def residual(
        self, c: Data, el: Elements, tau: float, nodal: Array, bubbles: Array, old_nodal: Array, old_bubbles: Array, loads: Array,
        bubble_loads: Array, edges: Edges, actions: Array, kept: Array, R: Array, r_bubbles: Array,
    ) -> int:  # fmt: skip
        turned = self.turned_over(el, nodal, bubbles)
        if turned < 0:
            old = (old_nodal, old_bubbles) if c.printed else None
            self._reduce(self.forms.element_residuals(nodal, bubbles, tau, old, actions), loads, bubble_loads, kept, R, r_bubbles)
        return turned

    def tangent(
        self, c: Data, el: Elements, tau: float, nodal: Array, bubbles: Array, old_nodal: Array, old_bubbles: Array, loads: Array,
        bubble_loads: Array, edges: Edges, actions: Array, pattern: Pattern, values: Array, kept: Array, R: Array, r_bubbles: Array,
    ) -> int:  # fmt: skip
        turned = self.turned_over(el, nodal, bubbles)
        if turned >= 0:
            return turned
        old = (old_nodal, old_bubbles) if c.printed else None
        K = self.forms.element_tangents(nodal, bubbles, tau, old, actions)
        outer, inner = slice(OUTER), slice(OUTER, None)
        inverse = np.linalg.inv(K[:, inner, inner])
        right, left = inverse @ K[:, inner, outer], K[:, outer, inner] @ inverse
        kept[:] = np.concatenate([part.reshape(len(K), -1) for part in (inverse, right, left.transpose(0, 2, 1))], axis=1)
        condensed = K[:, outer, outer] - K[:, outer, inner] @ right
        slots, used = self._places(el, pattern)
        values[:] = np.bincount(slots, condensed.reshape(len(K), -1)[used], minlength=len(values))
        self._reduce(self.forms.element_residuals(nodal, bubbles, tau, old, actions), loads, bubble_loads, kept, R, r_bubbles)
        return -1

    def _reduce(self, rows: Array, loads: Array, bubble_loads: Array, kept: Array, R: Array, r_bubbles: Array) -> None:
        """The residual without that of the bubbles, and that of the bubbles."""
        r_bubbles[:] = rows[:, OUTER:] - bubble_loads
        reduced = rows.copy()
        reduced[:, :OUTER] -= np.einsum("eki,ek->ei", kept[:, 4 + 2 * OUTER :].reshape(-1, 2, OUTER), r_bubbles)
        R[:] = self.forms.assemble(reduced)[0] - loads

    def _places(self, el: Elements, pattern: Pattern) -> tuple[Any, Any]:
        """Where the entries of the condensed tangents go, and which of them go anywhere."""
        corners = el.triangles
        start, rank = pattern.start[corners], pattern.rank[corners]  # (elements, 3, 5)
        pairs = pattern.pairs.reshape(-1, 3, 3)
        slots = start[:, :, :, None, None] + pairs[:, :, None, :, None] + rank[:, None, None, :, :]
        used = (start[:, :, :, None, None] >= 0) & (rank[:, None, None, :, :] >= 0)
        return slots[used], used.reshape(len(corners), OUTER, OUTER).reshape(len(corners), -1)

    def bubble_changes(self, el: Elements, kept: Array, r_bubbles: Array, change: Array, out: Array) -> None:
        local = change[el.triangles].reshape(-1, OUTER)
        out[:] = -np.einsum("eij,ej->ei", kept[:, :4].reshape(-1, 2, 2), r_bubbles)
        out[:] -= np.einsum("eij,ej->ei", kept[:, 4 : 4 + 2 * OUTER].reshape(-1, 2, OUTER), local)

    def turned_over(self, el: Elements, nodal: Array, bubbles: Array) -> int:
        bad = np.flatnonzero(~np.all(self._state(nodal, bubbles)[0] > 0.0, axis=1))
        return int(bad[0]) if bad.size else -1

    def _state(self, nodal: Array, bubbles: Array) -> tuple[Array, Array, Any, Any, Any]:
        """J (elements, points), F, alpha, p and C at the points of the rule."""
        F, alpha, p, C = self.forms.fields(nodal, bubbles)
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0], F, alpha, p, C

    def moments(self, c: Data, el: Elements, nodal: Array, bubbles: Array, out: Array) -> None:
        J, _, alpha, _, C = self._state(nodal, bubbles)
        growth = J * eq.net_growth(np.asarray(alpha), np.asarray(C), *self.parameters.kinetics)
        for row, density in enumerate((np.asarray(alpha) * J, J, growth)):
            out[row] = self._moment(el, density)
        still, flowing = (self.forms.element_residuals(nodal, bubbles, tau) for tau in (0.0, 1.0))
        out[3] = self.forms.assemble(flowing - still)[0][:, 3]

    def observe(self, c: Data, el: Elements, nodal: Array, bubbles: Array, levels: Array, out: Array, shares: Array) -> None:
        J, F, alpha, p, _ = self._state(nodal, bubbles)
        stress = np.sqrt(np.sum(self.forms.stress(F, np.asarray(alpha), np.asarray(p)) ** 2, axis=(0, 1)))
        for row, density in enumerate((J, stress, J * np.asarray(alpha))):
            out[row] = self._moment(el, density)
        areas = el.areas * (J @ el.weights)
        corners = np.sort(nodal[:, 4][el.triangles], axis=1)
        for i, level in enumerate(levels):
            shares[i] = np.sum(areas * _share_below(level, corners))

    def _moment(self, el: Elements, density: Array) -> Array:
        """Integrals of a density with the hats, (points,)."""
        rows = np.einsum("eq,q,qa,e->ea", density, el.weights, el.points, el.areas)
        return np.asarray(np.bincount(el.triangles.ravel(), rows.ravel(), minlength=self.forms.mesh.nvertices), dtype=float)


def _share_below(level: float, corners: Array) -> Array:
    """Shares of triangles in which a linear function with sorted corner values (elements, 3) is below a level."""
    a, b, c = corners.T
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (level - a) ** 2 / ((b - a) * (c - a))
        high = 1.0 - (c - level) ** 2 / ((c - b) * (c - a))
    share = np.select([level <= a, level >= c, level <= b], [0.0 * a, 0.0 * a + 1.0, low], high)
    return np.full_like(a, np.nan) if np.isnan(level) else share
