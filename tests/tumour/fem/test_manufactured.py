"""Orders in space and time of the elastic tumour in two dimensions by a manufactured solution, of the weak form and of the compiled scheme.

d, p and C are of second order in L2. alpha follows from the moments of alpha J and from J, which is a derivative of d: point by point it is
of first order, and where the triangles around a vertex lie symmetrically, of second. So its L2 error falls with h^1.5 on regular meshes
(first order in the layer at the surface), with h on irregular ones, and its weighted means fall with h^2 on all.
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from skfem import MeshTri

from multiphase.stepping import Control, integrate, start
from tumour import equations as eq
from tumour.fem.forms import LOCAL, Forms
from tumour.fem.scheme import MiniScheme
from tumour.meshes import Body
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver


def _load() -> Any:
    spec = importlib.util.spec_from_file_location("manufactured_tumour", Path(__file__).with_name("manufactured.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


manufactured = _load()

OPTIONS: dict[str, dict[str, Any]] = {
    "darcy": {},
    "printed": {"mobility": "printed", "mobility_floor": 0.2},
    "constant": {"mobility": "constant", "kappa": 2.0, "alpha_star": 0.6},
}
ALL = pytest.mark.parametrize("case", OPTIONS)
MESHES = pytest.mark.parametrize("jiggle", [0.0, 0.2], ids=["regular", "irregular"])
T, TAU = 0.4, 0.1
T_END = 0.2


@cache
def solution(case: str = "darcy") -> Any:
    return manufactured.Solution(TumourParameters(**{**manufactured.VALUES, **OPTIONS[case]}))


def square(n: int, jiggle: float) -> MeshTri:
    """2 n^2 triangles, whose inner vertices are off a grid by a random share of its width."""
    mesh = MeshTri.init_tensor(*2 * [np.linspace(0.0, 1.0, n + 1)])
    points, inside = mesh.p.copy(), mesh.interior_nodes()
    points[:, inside] += jiggle / n * np.random.default_rng(n).uniform(-1.0, 1.0, (2, len(inside)))
    return MeshTri(np.ascontiguousarray(points), mesh.t).oriented()


def orders(coarse: np.ndarray, fine: np.ndarray) -> np.ndarray:
    return np.log2(coarse / fine)


# -- the solution --------------------------------------------------------------------------------------------------------


@ALL
def test_the_solution_is_admissible_and_large(case: str) -> None:
    x = np.array(np.meshgrid(*2 * [np.linspace(0.0, 1.0, 41)]))
    for t in np.linspace(0.0, T, 9):
        a, b, c, d, alpha, p, C, *_ = solution(case).local(x, t)
        strain = np.sqrt((a - 1.0) ** 2 + b**2 + c**2 + (d - 1.0) ** 2)
        J = a * d - b * c
        assert 0.4 < strain.max() < 0.5
        assert 0.7 < J.min() < 0.8 < 1.5 < J.max() < 1.7
        assert 0.6 < alpha.min() < 0.65 < 0.8 < alpha.max() < 0.85
        assert 0.4 < C.min() < 0.7 < 0.9 < C.max() < 1.0
        assert np.ptp(p[0]) > 0.1  # along an edge
        assert np.ptp(p) > 0.5


def fluxes(of: TumourParameters, local: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float]:
    """P, flow and diffusion, alpha J and J, by the model's own laws."""
    F, (alpha, p) = local[:4].reshape(2, 2), local[4:6]
    J, F_inv = np.linalg.det(F), np.linalg.inv(F)
    mu, lam = of.moduli
    P = mu * (F - F_inv.T) + (lam * (J - 1.0) - p - eq.contact_pressure(alpha, *of.contact)) * J * F_inv.T
    pull = J * F_inv @ F_inv.T
    return P, eq.mobility(alpha, *of.flow) * pull @ local[7:9], pull @ local[9:], alpha * J, J


def slope(f: Any, h: float = 2e-3) -> Any:
    """f'(0), to the fourth order in h."""
    return (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)


@ALL
def test_sources_against_differences(case: str) -> None:
    exact, rng = solution(case), np.random.default_rng(1)
    for x, t in zip(rng.uniform(0.05, 0.95, (20, 2)), rng.uniform(0.05, 0.95, 20), strict=True):
        found = exact.sources(x, t), exact.step_sources(x, t, TAU)
        for sources, wanted in zip(found, by_differences(exact, x, t), strict=True):
            np.testing.assert_allclose(sources, wanted, atol=1e-7)


def by_differences(exact: Any, x: np.ndarray, t: float) -> tuple[list[float], list[float]]:
    """The sources at a point, and those of a step, by differences of the fluxes and amounts."""
    of, local = exact.parameters, exact.local(x, t)
    alpha, C = local[4], local[6]

    def flux(i: int, s: float) -> np.ndarray:
        """Column i of P, and component i of flow and diffusion, at s along axis i."""
        P, flow, diffusion, _, _ = fluxes(of, exact.local(x + s * np.eye(2)[i], t))
        return np.array([*P[:, i], flow[i], diffusion[i]])

    div = sum(slope(partial(flux, i)) for i in range(2))
    rate = slope(lambda s: np.array(fluxes(of, exact.local(x, t + s))[3:]))
    amount, J = fluxes(of, local)[3:]
    growth, uptake = J * eq.net_growth(alpha, C, *of.kinetics), J * eq.oxygen_uptake(alpha, C, *of.uptake)
    forces, oxygen = [-div[0], -div[1]], uptake - div[3]
    return [*forces, rate[0] - growth, rate[1] - div[2], oxygen], [*forces, amount - TAU * growth, J - TAU * div[2], oxygen]


def test_gradients_against_differences() -> None:
    exact, (x, t) = solution(), (np.random.default_rng(2).uniform(size=(2, 20)), 0.3)
    by_axis = [slope(lambda s, axis=axis: exact.fields(x + s * axis[:, None], t)) for axis in np.eye(2)]
    gradients = np.stack(by_axis, axis=1)[[0, 1, 3, 4]]  # [field, axis, point]
    gradients[[0, 1], [0, 1]] += 1.0
    found = exact.local(x, t)
    np.testing.assert_allclose(found[[0, 1, 2, 3, 7, 8, 9, 10]], gradients.reshape(8, -1), atol=1e-9)
    np.testing.assert_array_equal(found[4:7], exact.fields(x, t)[2:])


def test_errors_and_loads_against_gauss() -> None:
    """Errors of a body at rest are the norms of the fields; loads add up to the integrals of the sources."""
    exact, mesh = solution(), square(8, 0.2)
    on, nothing = manufactured.OnMesh(exact, mesh), (np.zeros((mesh.nvertices, 5)), np.zeros((mesh.nelements, 2)))
    places, weights = np.polynomial.legendre.leggauss(20)
    x, dx = np.array(np.meshgrid(0.5 + 0.5 * places, 0.5 + 0.5 * places)), 0.25 * np.outer(weights, weights)
    d_x, d_y, *others = np.sum(exact.fields(x, T) ** 2 * dx, axis=(1, 2))
    np.testing.assert_allclose(on.errors(*nothing, T) ** 2, [d_x + d_y, *others], rtol=1e-7)
    b_x, b_y, s_alpha, s_p, s_C = np.sum(exact.sources(x, T) * dx, axis=(1, 2))
    np.testing.assert_allclose(on.loads(T, TAU)[0].sum(axis=0), [b_x, b_y, TAU * s_alpha, TAU * s_p, s_C], rtol=1e-6)
    of_step = np.sum(exact.step_sources(x, T, TAU) * dx, axis=(1, 2))
    np.testing.assert_allclose(on.loads_of_step(T, TAU)[0].sum(axis=0), of_step, rtol=1e-6)
    u, v = 0.5 + 0.5 * places, (0.5 + 0.5 * places)[:, None]
    l = np.array(np.broadcast_arrays(1.0 - u, u * (1.0 - v), u * v))  # the square, drawn together to a triangle
    corners = mesh.p[:, mesh.t[:, 7]]
    area = 0.5 * np.linalg.det(corners[:, 1:] - corners[:, :1])
    forces = exact.sources(np.tensordot(corners, l, 1), T)[:2] * 27.0 * l[0] * l[1] * l[2] * 2.0 * area * u * dx
    np.testing.assert_allclose(on.loads(T, TAU)[1][7], forces.sum(axis=(1, 2)), rtol=1e-5)


# -- the weak form -------------------------------------------------------------------------------------------------------


def solve_step(forms: Forms, on: Any, t: float, tau: float) -> tuple[np.ndarray, np.ndarray]:
    """One implicit step to the solution's fields at t, by Newton's method from these."""
    nodal, bubbles = on.interpolated(t)
    held = np.zeros(nodal.shape, dtype=bool)
    held[np.ix_(on.boundary, [0, 1, 3, 4])] = True
    free = np.flatnonzero(~np.append(held.ravel(), np.zeros(bubbles.size, dtype=bool)))
    loads = joined(on.loads_of_step(t, tau))
    rows, columns = np.repeat(forms.numbers, LOCAL, axis=1), np.tile(forms.numbers, LOCAL)
    for _ in range(8):
        residual = joined(forms.assemble(forms.element_residuals(nodal, bubbles, tau))) - loads
        tangent = coo_matrix((forms.element_tangents(nodal, bubbles, tau).ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        change = np.zeros_like(residual)
        change[free] = spsolve(tangent[free][:, free].tocsc(), -residual[free])
        nodal = nodal + change[: nodal.size].reshape(nodal.shape)
        bubbles = bubbles + change[nodal.size :].reshape(bubbles.shape)
        if np.abs(change).max() < 1e-9:
            return nodal, bubbles
    raise AssertionError("Newton's method does not converge")


def joined(state: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return np.concatenate([state[0].ravel(), state[1].ravel()])


def test_the_residual_of_the_solution_falls_with_the_mesh() -> None:
    """At the vertices inside a regular mesh and over h^2, the size of a row: all equations are consistent to second order there."""
    found = []
    for n in (8, 16, 32):
        mesh = square(n, 0.0)
        on, forms = manufactured.OnMesh(solution(), mesh), Forms(mesh, solution().parameters)
        nodal, _ = forms.assemble(forms.element_residuals(*on.interpolated(T), TAU))
        found.append(np.abs(nodal - on.loads_of_step(T, TAU)[0])[mesh.interior_nodes()].max(axis=0) * n**2)
    assert orders(found[0], found[1]).min() > 1.5
    assert orders(found[1], found[2]).min() > 1.85


@MESHES
@ALL
def test_order_of_the_weak_form(case: str, jiggle: float) -> None:
    errors = []
    for n in (8, 16, 32):
        on = manufactured.OnMesh(solution(case), square(n, jiggle))
        nodal, bubbles = solve_step(Forms(on.mesh, solution(case).parameters), on, T, TAU)
        errors.append(np.append(on.errors(nodal, bubbles, T), on.mean_error_of_alpha(nodal, T)))
    check_orders(errors, jiggle)
    assert np.all(errors[2] < [8e-5, 1e-3, 3e-4, 1.5e-4, 1e-4])  # h^2 = 1e-3, times less than 0.3; alpha h


def check_orders(errors: list[np.ndarray], jiggle: float) -> None:
    """Of d, alpha, p, C and of a weighted mean of alpha, over two halvings of h."""
    d, alpha, p, C, mean = 0.5 * orders(errors[0], errors[2])
    assert min(d, p, C, mean) >= 1.9
    assert alpha >= (1.45 if jiggle == 0.0 else 0.9)


# -- the compiled scheme -------------------------------------------------------------------------------------------------


class Forced(MiniScheme):
    """The scheme with the sources and the boundary values of a manufactured solution; d, p and C are prescribed on all of the boundary."""

    def __init__(self, exact: Any, mesh: MeshTri, alpha_step: str = "conservative") -> None:
        self.on = manufactured.OnMesh(exact, mesh)
        ends = self.on.boundary
        nothing = np.empty((0, 2), dtype=np.int64)
        body = Body(
            mesh=mesh, surface=ends, edges=nothing, sides={}, slide_x=ends, slide_y=ends, radius=1.0, area=1.0, is_round=False, quality=None
        )  # fmt: skip
        super().__init__(exact.parameters, TumourInitial(alpha=0.8), body, TumourSolver(newton_tol=1e-11, alpha_step=alpha_step))

    def boundary(self, t: float) -> np.ndarray:
        return self.on.nodal(t)

    def loads(self, t: float, tau: float) -> tuple[np.ndarray, np.ndarray]:
        return self.on.loads(t, tau)

    def initial(self) -> np.ndarray:
        """Equilibrium at the moments that the exact fields at the vertices and at the triangles' middles have."""
        u = np.zeros(self._parts[-1])
        point = self.point(u)
        point.nodal[:], point.bubbles[:] = self.on.interpolated(0.0)
        self.rest(u)[0][:] = self._moments(point)[:2]
        self.observation.begin(u)
        u = self.solve(0.0, np.inf, u, u).u
        self.newton.forget()
        return u

    def errors(self, u: np.ndarray, t: float = T_END) -> np.ndarray:
        """L2 errors of d, alpha, p, C, and that of a weighted mean of alpha."""
        point = self.point(u)
        return np.append(self.on.errors(point.nodal, point.bubbles, t), self.on.mean_error_of_alpha(point.nodal, t))


def at_end(scheme: Forced, steps: int, order: int = 2, first: np.ndarray | None = None) -> np.ndarray:
    """The vector at T_END after some steps, from `first` or the scheme's own initial one."""
    control = Control(order=order, dt=T_END / steps)
    state = start(scheme, 0.0, T_END, control)
    if first is not None:
        state = replace(state, u=first[None, :].copy())
    return integrate(scheme, state, [T_END], control).u[0]


@MESHES
def test_order_in_space(jiggle: float) -> None:
    """With steps of BDF2 whose errors are far smaller."""
    errors = []
    for n in (6, 12, 24):
        scheme = Forced(solution(), square(n, jiggle))
        errors.append(scheme.errors(at_end(scheme, 40)))
    check_orders(errors, jiggle)
    assert np.all(errors[2] < [1.5e-4, 1e-3, 3e-4, 2.5e-4, 5e-5])


def orders_in_time(scheme: Forced, steps: tuple[int, int], reference: np.ndarray, order: int, first: np.ndarray) -> np.ndarray:
    """Orders of d, alpha, p, C and of the bubbles from two step sizes, one half of the other, in the largest difference to a reference."""
    gaps, wanted = [], scheme.point(reference)
    for count in steps:
        found = scheme.point(at_end(scheme, count, order, first))
        nodal, bubbles = np.abs(found.nodal - wanted.nodal).max(axis=0), np.abs(found.bubbles - wanted.bubbles).max()
        gaps.append([nodal[:2].max(), *nodal[2:], bubbles])
    return orders(*np.array(gaps))


def test_order_in_time() -> None:
    """On one mesh, against far smaller steps on it; backward Euler also with the step of alpha as printed, which has the same limit."""
    mesh = square(6, 0.2)
    scheme, printed = Forced(solution(), mesh), Forced(solution(), mesh, "as-printed")
    reference, first = at_end(scheme, 640), scheme.initial()
    assert orders_in_time(scheme, (20, 40), reference, 2, first).min() >= 1.9
    for each in (scheme, printed):
        assert np.abs(orders_in_time(each, (40, 80), reference, 1, first) - 1.0).max() <= 0.1
