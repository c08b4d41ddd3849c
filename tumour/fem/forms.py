r"""The weak form of the elastic tumour in two dimensions, as it is written down: one implicit step on MINI elements, in scikit-fem.

The Lagrangian model (2.22) on the body at rest, with the displacement d, the cell fraction alpha, the fluid pressure p and the oxygen C.
With ``F = I + grad d`` and ``J = det F``, test functions v and phi, and tau the step of backward Euler that a BDF step amounts to,

    momentum   int P : grad v,      P = mu (F - F^-T) + lambda J (J-1) F^-T - (p + alpha Sigma) J F^-T              (2.22a)
    cells      int alpha J phi - tau int J q(alpha, C) phi                                                        (2.22b)
    fluid      int J phi + tau int M(alpha) J F^-1 F^-T grad p . grad phi                                         (2.22c)
    oxygen     int J F^-1 F^-T grad C . grad phi + int J U(alpha, C) phi,      U the cells' uptake                  (2.22d)

equal the moments of the past: int (alpha J)_past phi in the rows of the cells, int J_past phi in those of the fluid, none in the others.
alpha, p and C are linear on each triangle, d is linear plus a bubble ``psi = 27 l_1 l_2 l_3`` (l_i the barycentric coordinates), and so
are their test functions. All integrals are by the rule of six points that is exact for polynomials of degree 4. With kappa = 0 the fluid
flows freely, M is left out and the rows of the fluid only measure volume.

This is the specification of the compiled scheme, for reading and for testing; `tumour.fem.readable` runs it, far slower.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTriMini, ElementTriP1, ElementVector, LinearForm, MeshTri
from skfem.helpers import ddot, det, dot, grad, identity, inv, mul, transpose

from tumour import equations as eq
from tumour.parameters import TumourParameters

Array = NDArray[np.float64]

FIELDS = 5
"""Unknowns of a vertex: the displacement's two components, alpha, p, C."""
LOCAL = 17
"""Unknowns of a triangle: those of its three vertices, one vertex after the other, and the two of its bubble."""
DEGREE = 4
"""Polynomials up to this degree are integrated exactly."""

D = [0, 1, 5, 6, 10, 11, 15, 16]
ALPHA, PRESSURE, OXYGEN = ([2 + k, 7 + k, 12 + k] for k in range(3))
"""Where a triangle's unknowns of each field stand among the 17, and the rows tested with its functions: `D` for d and momentum, `ALPHA`
for alpha and cells, `PRESSURE` for p and fluid, `OXYGEN` for C and oxygen."""


def first_piola(F: Array, load: Array, parameters: TumourParameters) -> Array:
    """Stress of the mixture per area at rest, ``mu (F - F^-T) + lambda J (J-1) F^-T - load J F^-T`` with ``load = p + alpha Sigma``."""
    mu, lam = parameters.moduli
    J, F_inv_T = det(F), transpose(inv(F))
    stress: Array = mu * (F - F_inv_T) + lam * J * (J - 1.0) * F_inv_T - load * J * F_inv_T
    return stress


def pulled_back(F: Array, gradient: Array) -> Array:
    """Flux per area at rest of what flows down a gradient: ``J F^-1 F^-T gradient``."""
    F_inv = inv(F)
    flux: Array = det(F) * mul(F_inv, mul(transpose(F_inv), gradient))
    return flux


def momentum(v: Any, w: Any) -> Any:
    """Rows of d, with the first Piola-Kirchhoff stress P."""
    return ddot(w.P, grad(v))


def cells(phi: Any, w: Any) -> Any:
    """Rows of alpha, with the amount ``alpha J`` of cells per volume at rest (or its change, as printed) and their growth ``J q``."""
    return (w.amount - w.tau * w.growth) * phi


def fluid(phi: Any, w: Any) -> Any:
    """Rows of p, with the volume ratio J and the flow ``M J F^-1 F^-T grad p``."""
    return w.J * phi + w.tau * dot(w.flow, grad(phi))


def oxygen(phi: Any, w: Any) -> Any:
    """Rows of C, with the diffusion ``J F^-1 F^-T grad C`` and the uptake ``J U``."""
    return dot(w.diffusion, grad(phi)) + w.uptake * phi


def moment(phi: Any, w: Any) -> Any:
    """Integrals of a density with the hats."""
    return w.density * phi


def _tested(form: Callable[[Any, Any], Any], basis: Basis, **at_points: Any) -> Array:
    """Integrals (ne, functions) of a form, with each function of the basis on each triangle."""
    integrals: Array = LinearForm(form).elemental(basis, **at_points).tolocal()
    return integrals


class Forms:
    """Element residuals of one implicit step.

    Parameters
    ----------
    mesh : skfem.MeshTri
        Triangles of the body at rest. ``MeshTri(points, triangles)`` sorts the vertices of each triangle, ``sort_t=False`` leaves them:
        local unknowns and rows come in the order of ``mesh.t``. Triangles may run either way round.
    parameters : TumourParameters

    Attributes
    ----------
    numbers : (ne, 17) array of int
        Global numbers of the local unknowns: five for each vertex, then two for each bubble.

    Notes
    -----
    A state is an array `nodal` (N, 5) with the columns d_x, d_y, alpha, p, C and an array `bubbles` (ne, 2), the coefficients of psi in
    d. The triangles are torn apart to be worked on: each then has vertices of its own, and so unknowns that no other one shares.
    """

    def __init__(self, mesh: MeshTri, parameters: TumourParameters) -> None:
        self.mesh, self.parameters = mesh, parameters
        elements = mesh.nelements
        apart = MeshTri(mesh.p[:, mesh.t.T.ravel()], np.arange(3 * elements).reshape(elements, 3).T, sort_t=False)
        self._vectors = Basis(apart, ElementVector(ElementTriMini()), intorder=DEGREE)
        self._scalars = self._vectors.with_element(ElementTriP1())
        of_vertices = (FIELDS * mesh.t.T[:, :, None] + np.arange(FIELDS)).reshape(elements, 3 * FIELDS)
        self.numbers = np.hstack([of_vertices, FIELDS * mesh.nvertices + np.arange(2 * elements).reshape(elements, 2)])

    def element_residuals(self, nodal: Array, bubbles: Array, tau: float, old: tuple[Array, Array] | None = None) -> Array:
        """Residuals of all triangles, without the moments of the past.

        Parameters
        ----------
        nodal, bubbles : (N, 5) and (ne, 2) arrays
            The state.
        tau : float
            Step of backward Euler.
        old : pair of arrays, or None
            The last state; then the change of alpha J is that of the step as printed, ``(J - J_old) alpha + (alpha - alpha_old) J``, and
            the past has no moments in the rows of the cells.

        Returns
        -------
        (ne, 17) array
            For each triangle, the rows of its vertices, one vertex after the other, and those of its bubble.
        """
        return self._residuals(self._local(nodal, bubbles), tau, None if old is None else self._local(*old))

    def element_tangents(
        self, nodal: Array, bubbles: Array, tau: float, old: tuple[Array, Array] | None = None, *, change: float = 1e-6
    ) -> Array:
        """Derivatives (ne, 17, 17) of `element_residuals`, ``[e, i, j]`` that of row i by unknown j: central differences over `change`."""
        local = self._local(nodal, bubbles)
        last = None if old is None else self._local(*old)
        tangents = np.empty((len(local), LOCAL, LOCAL))
        for j, step in enumerate(change * np.eye(LOCAL)):
            tangents[:, :, j] = (self._residuals(local + step, tau, last) - self._residuals(local - step, tau, last)) / (2.0 * change)
        return tangents

    def moments(self, nodal: Array, bubbles: Array) -> Array:
        """Integrals of alpha J and of J with the hats, in the rows (ne, 17) of cells and fluid: what a step takes from its past."""
        F, alpha, _, _ = self.fields(nodal, bubbles)
        J = det(F)
        rows = np.zeros((self.mesh.nelements, LOCAL))
        rows[:, ALPHA] = _tested(moment, self._scalars, density=alpha * J)
        rows[:, PRESSURE] = _tested(moment, self._scalars, density=J)
        return rows

    def fields(self, nodal: Array, bubbles: Array) -> tuple[Array, Any, Any, Any]:
        """F (2, 2, ne, 6), and alpha, p, C with their gradients, at the points of the rule."""
        return self._fields(self._local(nodal, bubbles))

    def assemble(self, rows: Array) -> tuple[Array, Array]:
        """The rows (ne, 17) of all triangles, added up: those of the vertices (N, 5) and those of the bubbles (ne, 2)."""
        total: Array = np.bincount(self.numbers.ravel(), rows.ravel()).astype(float)
        at_vertices = FIELDS * self.mesh.nvertices
        return total[:at_vertices].reshape(-1, FIELDS), total[at_vertices:].reshape(-1, 2)

    def _residuals(self, local: Array, tau: float, old: Array | None) -> Array:
        """Residuals of the local unknowns (ne, 17)."""
        of = self.parameters
        F, alpha, p, C = self._fields(local)
        J = det(F)

        P = first_piola(F, p + eq.contact_pressure(alpha, *of.contact), of)
        amount = alpha * J if old is None else self._change_as_printed(alpha, J, old)
        growth = J * eq.net_growth(alpha, C, *of.kinetics)
        flow = pulled_back(F, grad(p)) * (eq.mobility(alpha, *of.flow) if of.kappa > 0.0 else 0.0)
        uptake = J * eq.oxygen_uptake(alpha, C, *of.uptake)

        rows = np.empty_like(local)
        rows[:, D] = _tested(momentum, self._vectors, P=P)
        rows[:, ALPHA] = _tested(cells, self._scalars, amount=amount, growth=growth, tau=tau)
        rows[:, PRESSURE] = _tested(fluid, self._scalars, J=J, flow=flow, tau=tau)
        rows[:, OXYGEN] = _tested(oxygen, self._scalars, diffusion=pulled_back(F, grad(C)), uptake=uptake)
        return rows

    def _change_as_printed(self, alpha: Any, J: Array, old: Array) -> Array:
        """The change of alpha J in the program of the paper."""
        F_old, alpha_old, _, _ = self._fields(old)
        change: Array = (J - det(F_old)) * alpha + (alpha - alpha_old) * J
        return change

    def _fields(self, local: Array) -> tuple[Array, Any, Any, Any]:
        """F (2, 2, ne, 6), and alpha, p, C with their gradients, at the points of the rule."""
        d = self._interpolated(self._vectors, local[:, D])
        alpha, p, C = (self._interpolated(self._scalars, local[:, own]) for own in (ALPHA, PRESSURE, OXYGEN))
        return identity(grad(d)) + grad(d), alpha, p, C

    @staticmethod
    def _interpolated(basis: Basis, local: Array) -> Any:
        """The field with the local unknowns (ne, functions)."""
        vector = np.empty(basis.N)
        vector[basis.element_dofs] = local.T
        return basis.interpolate(vector)

    def _local(self, nodal: Array, bubbles: Array) -> Array:
        """The unknowns (ne, 17) of each triangle."""
        state: Array = np.concatenate([np.ravel(nodal), np.ravel(bubbles)])[self.numbers]
        return state
