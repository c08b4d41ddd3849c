"""Orders in space and time in tissue that varies and has directions, and with springs, loads, membranes on parts of the surface, by
manufactured solutions. What the orders are, and why, stands in `test_manufactured.py`."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skfem import MeshTri

from tumour import equations as eq
from tumour.boundary import TumourBoundary
from tumour.fem.scheme import MiniScheme
from tumour.meshes.body import make_body
from tumour.parameters import TumourInitial, TumourParameters
from tumour.solver import TumourSolver


def _load() -> Any:
    spec = importlib.util.spec_from_file_location("manufactured_tissue_tumour", Path(__file__).with_name("manufactured_tissue.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


manufactured = _load()
base = manufactured.load("test_manufactured")

TISSUES = {"components": manufactured.TISSUE, "along fibres": manufactured.ALONG}
SIDES: dict[str, dict[str, Any]] = {
    "right": {
        "traction_x": -0.2, "traction_y": 0.15, "load": {"times": [0.0, 1.0], "values": [0.3, 0.7]}, "spring": 0.8, "spring_normal": 1.1,
        "p": "closed", "C": "closed", "influx": {"times": [0.0, 1.0], "values": [0.4, 0.1]},
    },
    "top": {"membrane": 1.7, "C": 0.6},
}  # fmt: skip
"""On the right side of the square nothing is prescribed, on the top d and p are."""


@cache
def solution(tissue: str = "components") -> Any:
    return manufactured.TissueSolution(TumourParameters(**{**manufactured.plain.VALUES, **TISSUES[tissue]}))


# -- the solution --------------------------------------------------------------------------------------------------------


def polar(F: np.ndarray) -> np.ndarray:
    """U of F = R U, from the eigenvectors of F^T F."""
    squares, axes = np.linalg.eigh(F.T @ F)
    return axes @ np.diag(np.sqrt(squares)) @ axes.T


def coefficients(of: TumourParameters, x: np.ndarray) -> tuple[Any, ...]:
    """m, K, D, w, a_0, rho, k_f at a point, as the parameters give them."""
    at = {"x": x[0], "y": x[1], "r": np.hypot(*x), "xi": np.hypot(*x), "theta": np.arctan2(x[1], x[0])}
    angle = float(of.fibre_angle(**at))
    K, D = (np.array([[xx, xy], [xy, yy]]) for xx, yy, xy in (of.permeability(angle, **at), of.diffusivity(angle, **at)))
    m, w, rho, k_f = (float(f(**at)) for f in (of.stiffness, of.consumption, of.fibre_ratio, of.fibre_stiffness))
    return m, K, D, w, np.array([np.cos(angle), np.sin(angle)]), rho, k_f


def flows(exact: Any, x: np.ndarray, t: float) -> tuple[np.ndarray, float]:
    """Columns of P, flow and diffusion, [flux, axis], and the uptake, by the model's laws at a point."""
    of, local = exact.parameters, exact.local(x, t)
    m, K, D, w, a_0, rho, k_f = coefficients(of, x)
    F, alpha, p, C = local[:4].reshape(2, 2), *local[4:7]
    J, F_inv_T, (mu, lam) = np.linalg.det(F), np.linalg.inv(F).T, of.moduli
    contact, b = float(eq.contact_pressure(alpha, *of.contact)), F @ a_0
    P = m * (mu * (F - F_inv_T) + lam * J * (J - 1.0) * F_inv_T) - (p + contact) * J * F_inv_T
    P += (2.0 * k_f * (b @ b - 1.0) - (rho - 1.0) * contact * J / (b @ b)) * np.outer(b, a_0)
    U_inv = np.linalg.inv(polar(F))
    flow = float(eq.mobility(alpha, *of.flow)) * J * U_inv @ K @ U_inv @ local[7:9]
    return np.array([*P, flow, J * U_inv @ D @ U_inv @ local[9:11]]), float(w * J * eq.oxygen_uptake(alpha, C, *of.uptake))


@pytest.mark.parametrize("tissue", TISSUES)
def test_sources_against_differences(tissue: str) -> None:
    """Of the fluxes of an independent statement of the equations; what flows through sides is that as well."""
    exact, rng = solution(tissue), np.random.default_rng(1)
    for x, t in zip(rng.uniform(0.05, 0.95, (10, 2)), rng.uniform(0.05, 0.95, 10), strict=True):

        def flux(i: int, s: float, x: np.ndarray = x, t: float = t) -> np.ndarray:
            return flows(exact, x + s * np.eye(2)[i], t)[0][:, i]

        found, div = exact.sources(x, t), sum(base.slope(partial(flux, i)) for i in range(2))
        J_t = base.slope(lambda s, x=x, t=t: np.linalg.det(exact.local(x, t + s)[:4].reshape(2, 2)))
        wanted = [-div[0], -div[1], J_t - div[2], flows(exact, x, t)[1] - div[3]]
        np.testing.assert_allclose(found[[0, 1, 3, 4]], wanted, atol=3e-7)  # h^4/30 times fifth derivatives, and rounding
        normal = np.array([0.6, 0.8])
        *through, stretch = exact.through(x, normal, t)
        np.testing.assert_allclose(through, flows(exact, x, t)[0] @ normal, atol=1e-13)
        F = exact.local(x, t)[:4].reshape(2, 2)
        assert stretch == pytest.approx(np.linalg.norm(np.linalg.det(F) * np.linalg.inv(F).T @ normal), rel=1e-13)


def test_the_tissue_has_directions_and_varies() -> None:
    """Far from what is plain, and admissible all over the square."""
    x = np.array(np.meshgrid(*2 * [np.linspace(0.0, 1.0, 21)])).reshape(2, -1).T
    for tissue in TISSUES:
        m, K, D, w, a_0, rho, k_f = (
            np.array(values) for values in zip(*(coefficients(solution(tissue).parameters, at) for at in x), strict=True)
        )
        for tensor in (K, D):
            principal = np.linalg.eigvalsh(tensor)
            assert principal.min() > 0.3
            assert (principal[:, 1] / principal[:, 0]).max() > 1.9
        assert all(np.ptp(values) > 0.25 for values in (m, w, rho, k_f, a_0[:, 0]))
        assert min(m.min(), w.min(), k_f.min()) > 0.05
        assert rho.min() < 1.45 < 1.6 < rho.max()


# -- the scheme ----------------------------------------------------------------------------------------------------------


class Forced(base.Forced):  # type: ignore[misc, name-defined]
    """The scheme with the sources of a solution; where nothing acts, d, p and C are prescribed on the boundary."""

    def __init__(self, exact: Any, mesh: MeshTri, sides: dict[str, dict[str, Any]] | None = None) -> None:
        self.sides = sides or {}
        ends = mesh.boundary_nodes()
        edges = {name: mesh.facets[:, mesh.boundary_facets()].T for name in ("right", "top")}
        edges = {name: pairs[(mesh.p[k, pairs] == 1.0).all(axis=1)] for k, (name, pairs) in enumerate(edges.items())}
        body = make_body(mesh.p.T, mesh.t.T, surface=ends, radius=1.0, sides=edges, path="geometry")
        self.on = manufactured.plain.OnMesh(exact, body.mesh)
        self.on_sides = manufactured.OnSides(exact, body.mesh, self.sides)
        boundary = TumourBoundary.from_table({name: {"side": name, **of} for name, of in self.sides.items()})
        solver = TumourSolver(newton_tol=1e-11, method="mini")
        MiniScheme.__init__(self, exact.parameters, TumourInitial(alpha=0.8), body, solver, boundary)

    def _prescribed(self) -> np.ndarray:
        x, y = self.body.mesh.p
        elsewhere = np.isin(np.arange(self.count), self.on.boundary) & ((x == 0.0) | (y == 0.0))
        right, top = (x == 1.0) & ("right" not in self.sides), y == 1.0
        held = np.zeros((self.count, 5), dtype=bool)
        held[:, [0, 1, 3]] = (elsewhere | right | top)[:, None]
        held[:, 4] = elsewhere | right | (top & ("top" not in self.sides))
        return held

    def loads(self, t: float, tau: float) -> tuple[np.ndarray, np.ndarray]:
        nodal, bubbles = self.on.loads(t, tau)
        return nodal + self.on_sides.loads(t, tau), bubbles


@pytest.mark.parametrize("jiggle", [0.0, 0.2], ids=["regular", "irregular"])
@pytest.mark.parametrize(
    ("tissue", "sides"), [("components", {}), ("along fibres", {}), ("components", SIDES)], ids=["xx", "along", "sides"]
)
def test_order_in_space(tissue: str, sides: dict[str, Any], jiggle: float) -> None:
    """With steps of BDF2 whose errors are far smaller."""
    errors = []
    for n in (6, 12, 24):
        scheme = Forced(solution(tissue), base.square(n, jiggle), sides)
        errors.append(scheme.errors(base.at_end(scheme, 40)))
    base.check_orders(errors, jiggle)
    assert np.all(errors[2] < [2e-4, 1e-3, 3e-4, 2.5e-4, 5e-5])  # h^2 = 1.7e-3, times 0.1 and 0.2; alpha h^1.5


def test_order_in_time() -> None:
    """On one mesh, against far smaller steps on it, with loads that change in time."""
    scheme = Forced(solution(), base.square(6, 0.2), SIDES)
    reference, first = base.at_end(scheme, 640), scheme.initial()
    assert base.orders_in_time(scheme, (20, 40), reference, 2, first).min() >= 1.9
    assert np.abs(base.orders_in_time(scheme, (40, 80), reference, 1, first) - 1.0).max() <= 0.1
