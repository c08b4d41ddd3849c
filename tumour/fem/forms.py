r"""The weak form of the elastic tumour in two dimensions, as it is written down: one implicit step on MINI elements, in scikit-fem.

The Lagrangian model (2.22) on the body at rest, with the displacement d, the cell fraction alpha, the fluid pressure p and the oxygen C.
With ``F = I + grad d`` and ``J = det F``, test functions v and phi, and tau the step of backward Euler that a BDF step amounts to,

    momentum   int P : grad v - int t . v,      P = mu (F - F^-T) + lambda J (J-1) F^-T - (p + alpha Sigma) J F^-T  (2.22a)
    cells      int alpha J phi - tau int J q(alpha, C) phi                                                        (2.22b)
    fluid      int J phi + tau int M(alpha) J F^-1 F^-T grad p . grad phi                                         (2.22c)
    oxygen     int J F^-1 F^-T grad C . grad phi + int J U(alpha, C) phi - int j phi,    U the cells' uptake       (2.22d)

equal the moments of the past: int (alpha J)_past phi in the rows of the cells, int J_past phi in those of the fluid, none in the others.
alpha, p and C are linear on each triangle, d is linear plus a bubble ``psi = 27 l_1 l_2 l_3`` (l_i the barycentric coordinates), and so
are their test functions. Tissue that is not the same everywhere and in all directions has a factor on mu and lambda, fibres along a_0,
which add ``(2 k_f (|F a_0|^2 - 1) - (rho - 1) alpha Sigma J/|F a_0|^2) F a_0 (x) a_0`` to P, tensors turned with it, ``F^-1 R K R^T F^-T``
with F = R U in place of ``F^-1 F^-T``, and a factor on U. The traction t and the influx j of oxygen act on edges of the surface.
All integrals are by the rule of six points that is exact for polynomials of degree 4. With kappa = 0 the fluid
flows freely, M is left out and the rows of the fluid only measure volume.

This is the specification of the compiled scheme, for reading and for testing; `tumour.fem.readable` runs it, far slower.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTriMini, ElementTriP1, ElementVector, FacetBasis, LinearForm, MeshTri
from skfem.helpers import ddot, det, dot, grad, identity, inv, mul, transpose

from tumour import equations as eq
from tumour.fem.arrays import (
    COEFFICIENTS,
    CONSUMPTION,
    DIFFUSIVITY,
    FIBRE,
    PERMEABILITY,
    PUSH,
    REINFORCEMENT,
    STIFFNESS,
    Data,
    Edges,
)  # fmt: skip
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
_FACET = np.array([[-1, 0, 2], [0, -1, 1], [2, 1, -1]])
"""Number of the edge between two corners of a triangle."""


def first_piola(F: Array, load: Array, parameters: TumourParameters, stiffness: Array | float = 1.0) -> Array:
    """Stress of the mixture per area at rest, ``m mu (F - F^-T) + m lambda J (J-1) F^-T - load J F^-T`` with ``load = p + alpha Sigma``."""
    mu, lam = parameters.moduli
    J, F_inv_T = det(F), transpose(inv(F))
    stress: Array = stiffness * (mu * (F - F_inv_T) + lam * J * (J - 1.0) * F_inv_T) - load * J * F_inv_T
    return stress


def fibre_stress(F: Array, contact: Array, direction: Array, push: Array, stiffness: Array) -> Array:
    """Stress that fibres along a_0 = `direction` add, ``(2 k_f (|F a_0|^2 - 1) - (rho - 1) alpha Sigma J/|F a_0|^2) F a_0 (x) a_0``."""
    now = mul(F, direction)
    square = dot(now, now)
    size = 2.0 * stiffness * (square - 1.0) - push * contact * det(F) / square
    stress: Array = size * now[:, None] * direction[None, :]
    return stress


def pulled_back(F: Array, tensor: Array, gradient: Array) -> Array:
    """Flux per area at rest of what flows down a gradient: ``J F^-1 R K R^T F^-T gradient``, K = `tensor` and R the rotation in F."""
    F_inv = inv(F)
    turn = F + det(F) * transpose(F_inv)  # F + cof F = R (U + cof U), and U + cof U = (tr U) I in two dimensions
    R = turn / np.sqrt(det(turn))
    down = mul(R, mul(tensor, mul(transpose(R), mul(transpose(F_inv), gradient))))
    flux: Array = det(F) * mul(F_inv, down)
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


def traction(v: Any, w: Any) -> Any:
    """Rows of d on an edge, ``-t . v`` with ``t = dead - k d - k_n (d . N) N - load J F^-T N``."""
    F = grad(w.d) + identity(grad(w.d))
    normal_now = det(F) * mul(transpose(inv(F)), w.n)
    return dot(w.spring * w.d + w.spring_normal * dot(w.d, w.n) * w.n + w.load * normal_now - w.dead, v)


def influx(phi: Any, w: Any) -> Any:
    """Rows of C on an edge, ``-j phi`` with ``j = |J F^-T N| (influx + h (C_beyond - C))``."""
    F = grad(w.d) + identity(grad(w.d))
    normal_now = det(F) * mul(transpose(inv(F)), w.n)
    return -np.sqrt(dot(normal_now, normal_now)) * (w.influx + w.membrane * (w.beyond - w.C)) * phi


def moment(phi: Any, w: Any) -> Any:
    """Integrals of a density with the hats."""
    return w.density * phi


def _tested(form: Callable[[Any, Any], Any], basis: Basis, **at_points: Any) -> Array:
    """Integrals (ne, functions) of a form, with each function of the basis on each triangle."""
    integrals: Array = LinearForm(form).elemental(basis, **at_points).tolocal()
    return integrals


class _Tissue:
    """The rows of tissue at the points of the rule, by name, shaped to go with fields (ne, 6)."""

    def __init__(self, constants: Data | None, elements: int) -> None:
        plain = np.array([[1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]])
        rows = plain if constants is None else constants.tissue
        at = np.moveaxis(rows.reshape(-1, len(rows) // elements, COEFFICIENTS) if len(rows) > 1 else rows[None], 2, 0)
        self.stiffness, self.consumption, self.push, self.reinforcement = at[[STIFFNESS, CONSUMPTION, PUSH, REINFORCEMENT]]
        self.direction = at[FIBRE : FIBRE + 2]
        self.permeability, self.diffusivity = (at[[[k, k + 2], [k + 2, k + 1]]] for k in (PERMEABILITY, DIFFUSIVITY))


class Forms:
    """Element residuals of one implicit step.

    Parameters
    ----------
    mesh : skfem.MeshTri
        Triangles of the body at rest. ``MeshTri(points, triangles)`` sorts the vertices of each triangle, ``sort_t=False`` leaves them:
        local unknowns and rows come in the order of ``mesh.t``. Triangles may run either way round.
    parameters : TumourParameters
    constants : Data, optional
        Its rows of tissue are used; plain tissue without it.
    edges : Edges, optional
        Where something acts on the surface.

    Attributes
    ----------
    numbers : (ne, 17) array of int
        Global numbers of the local unknowns: five for each vertex, then two for each bubble.

    Notes
    -----
    A state is an array `nodal` (N, 5) with the columns d_x, d_y, alpha, p, C and an array `bubbles` (ne, 2), the coefficients of psi in
    d. The triangles are torn apart to be worked on: each then has vertices of its own, and so unknowns that no other one shares.
    """

    def __init__(self, mesh: MeshTri, parameters: TumourParameters, constants: Data | None = None, edges: Edges | None = None) -> None:
        self.mesh, self.parameters = mesh, parameters
        elements = mesh.nelements
        apart = MeshTri(mesh.p[:, mesh.t.T.ravel()], np.arange(3 * elements).reshape(elements, 3).T, sort_t=False)
        self._vectors = Basis(apart, ElementVector(ElementTriMini()), intorder=DEGREE)
        self._scalars = self._vectors.with_element(ElementTriP1())
        of_vertices = (FIELDS * mesh.t.T[:, :, None] + np.arange(FIELDS)).reshape(elements, 3 * FIELDS)
        self._tissue = _Tissue(constants, elements)
        self._edges = edges if edges is not None and len(edges.lengths) else None
        if self._edges is not None:
            self._on_edges = self._edge_bases(apart, self._edges)
        self.numbers = np.hstack([of_vertices, FIELDS * mesh.nvertices + np.arange(2 * elements).reshape(elements, 2)])

    def element_residuals(
        self, nodal: Array, bubbles: Array, tau: float, old: tuple[Array, Array] | None = None, actions: Array | None = None
    ) -> Array:
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
        actions : (edges, ACTIONS) array, or None
            What acts on the edges; without it they are left out.

        Returns
        -------
        (ne, 17) array
            For each triangle, the rows of its vertices, one vertex after the other, and those of its bubble.
        """
        return self._residuals(self._local(nodal, bubbles), tau, None if old is None else self._local(*old), actions)

    def element_tangents(
        self, nodal: Array, bubbles: Array, tau: float, old: tuple[Array, Array] | None = None, actions: Array | None = None, *,
        change: float = 1e-6,
    ) -> Array:  # fmt: skip
        """Derivatives (ne, 17, 17) of `element_residuals`, ``[e, i, j]`` that of row i by unknown j: central differences over `change`."""
        local = self._local(nodal, bubbles)
        last = None if old is None else self._local(*old)
        tangents = np.empty((len(local), LOCAL, LOCAL))
        for j, step in enumerate(change * np.eye(LOCAL)):
            tangents[:, :, j] = (self._residuals(local + step, tau, last, actions) - self._residuals(local - step, tau, last, actions)) / (
                2.0 * change
            )
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

    def stress(self, F: Array, alpha: Array, p: Array) -> Array:
        """P (2, 2, ne, 6) at the points of the rule."""
        of, tissue = self.parameters, self._tissue
        contact = eq.contact_pressure(alpha, *of.contact)
        P = first_piola(F, p + contact, of, tissue.stiffness)
        return P + fibre_stress(F, contact, tissue.direction, tissue.push, tissue.reinforcement)

    def _residuals(self, local: Array, tau: float, old: Array | None, actions: Array | None) -> Array:
        """Residuals of the local unknowns (ne, 17)."""
        of, tissue = self.parameters, self._tissue
        F, alpha, p, C = self._fields(local)
        J = det(F)

        P = self.stress(F, alpha, p)
        amount = alpha * J if old is None else self._change_as_printed(alpha, J, old)
        growth = J * eq.net_growth(alpha, C, *of.kinetics)
        flow = pulled_back(F, tissue.permeability, grad(p)) * (eq.mobility(alpha, *of.flow) if of.kappa > 0.0 else 0.0)
        diffusion = pulled_back(F, tissue.diffusivity, grad(C))
        uptake = J * tissue.consumption * eq.oxygen_uptake(alpha, C, *of.uptake)

        rows = np.empty_like(local)
        rows[:, D] = _tested(momentum, self._vectors, P=P)
        rows[:, ALPHA] = _tested(cells, self._scalars, amount=amount, growth=growth, tau=tau)
        rows[:, PRESSURE] = _tested(fluid, self._scalars, J=J, flow=flow, tau=tau)
        rows[:, OXYGEN] = _tested(oxygen, self._scalars, diffusion=diffusion, uptake=uptake)
        if actions is not None and self._edges is not None:
            self._add_edges(local, actions, rows)
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

    def _edge_bases(self, apart: MeshTri, edges: Edges) -> tuple[FacetBasis, FacetBasis, Any]:
        """Vectors and scalars on the edges, and where the edge of each facet of these bases stands among `edges`."""
        facets = apart.t2f[_FACET[edges.first, edges.second], edges.triangles]
        vectors = FacetBasis(apart, ElementVector(ElementTriMini()), facets=facets, intorder=DEGREE)
        order = np.argsort(facets)
        return vectors, vectors.with_element(ElementTriP1()), order[np.searchsorted(facets[order], vectors.find)]

    def _add_edges(self, local: Array, actions: Array, rows: Array) -> None:
        """Add the terms of the edges to the rows of their triangles."""
        vectors, scalars, which = self._on_edges
        edges = self._edges
        assert edges is not None
        at = {name: column[which][:, None] for name, column in zip(("load", "influx", "beyond"), actions.T[2:], strict=True)}
        springs = {name: column[which][:, None] for name, column in zip(("spring", "spring_normal"), edges.springs.T, strict=True)}
        dead = np.broadcast_to(actions.T[:2, which, None], (2, *vectors.dx.shape))
        d = self._interpolated(self._vectors, local[:, D], vectors)
        C = self._interpolated(self._scalars, local[:, OXYGEN], scalars)
        triangles = edges.triangles[which]
        np.add.at(rows, (triangles[:, None], D), _tested(traction, vectors, d=d, dead=dead, load=at["load"], **springs))
        membrane = edges.membranes[which][:, None]
        into = _tested(influx, scalars, d=d, C=C, influx=at["influx"], beyond=at["beyond"], membrane=membrane)
        np.add.at(rows, (triangles[:, None], OXYGEN), into)

    @staticmethod
    def _interpolated(basis: Basis, local: Array, on: FacetBasis | None = None) -> Any:
        """The field with the local unknowns (ne, functions), in the triangles or on edges."""
        vector = np.empty(basis.N)
        vector[basis.element_dofs] = local.T
        return (basis if on is None else on).interpolate(vector)

    def _local(self, nodal: Array, bubbles: Array) -> Array:
        """The unknowns (ne, 17) of each triangle."""
        state: Array = np.concatenate([np.ravel(nodal), np.ravel(bubbles)])[self.numbers]
        return state
