r"""The viscous tumour in FiPy: radial meshes, variables and terms in xi = r/R(t), solved by Newton's method.

FiPy holds the discrete equations of `tumour.eulerian`. alpha and C live on its `Grid1D`, `CylindricalGrid1D` or `SphericalGrid1D` of
cells in xi, the velocity u on a second one, shifted by half a cell, whose cells are the faces of the first, the surface among them.
With D = R^m = m W and the time step of the common loop (a step of size ``1/alpha_k`` from a weighted past), the terms are

    alpha:  TransientTerm(D) + UpwindConvectionTerm(c/a) + (what the limited second-order flux adds)_xi - D q(alpha, C)
    C:      -DiffusionTerm(R^(m-2)) + ImplicitSourceTerm(D Q alpha/(1 + Q1_hat C)),                          C = C_out at the surface
    u:      ImplicitSourceTerm(hoop stress and drag) - DiffusionTerm(viscosity) - (contact and load)_xi

with ``c = (R xi)^(m-1) u - xi^m V``, V = dW/dt, and ``a = xi^(m-1)``, FiPy's area of a face.

FiPy takes the middle of a spherical cell for its mean: its volumes ``xi_c^2 h`` fall short of the exact ``xi_c^2 h + h^3/12`` by 1/4 at
the centre (those of `CylindricalGrid1D` are exact, per radian, and so are all areas of faces). Coefficients of transient and source
terms are multiplied by the ratio of the volumes, so nothing of this remains in the equations. `SphericalGrid1D` with a list of widths
would have volumes 3/2 times too large.

The equations are strongly coupled, so what FiPy assembles is solved by Newton's method with the exact tangent of `tumour.eulerian`, all
unknowns at once. They are those of the other viscous schemes, the products W alpha among them, so cells and volume balance to rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from multiphase.fipy_newton import Assembled, Scatter, import_fipy, without_rounding
from tumour import equations as eq
from tumour import eulerian
from tumour.eulerian import BORDER, HALF, STRIDE
from tumour.schemes import Viscous

Array = NDArray[np.float64]


class FipyScheme(Viscous, Assembled):
    """One implicit step of the viscous tumour, assembled by FiPy. See the module's description.

    Parameters
    ----------
    parameters, initial, geometry, solver : TumourParameters, TumourInitial, TumourGeometry, TumourSolver
        In the Eulerian formulation.
    """

    def _build(self, initial: Any) -> None:
        super()._build(initial)
        N = self.cells
        self._unknowns = slice(STRIDE * N + BORDER)
        self._shares = np.diff(self.constants.s)
        self._faces = np.zeros((2, N + 1))
        self._scatter = Scatter(np.arange(STRIDE * N), HALF, BORDER)
        self._state(import_fipy())

    # -- FiPy -------------------------------------------------------------------------------------------------------

    def _state(self, fipy: Any) -> None:
        """Meshes, variables and equations."""
        N, h = self.cells, self.grid.spacing
        grid = {1: fipy.Grid1D, 2: fipy.CylindricalGrid1D, 3: fipy.SphericalGrid1D}[self.m]
        self._mesh = mesh = grid(nx=N, dx=h)
        self._face_mesh = face_mesh = grid(nx=N, dx=h) + np.array([[0.5 * h]])
        self._areas = np.asarray(mesh._faceAreas, dtype=float)[1:-1]  # the centre's is 0, and nothing is carried through the surface
        self._middle_areas = np.asarray(face_mesh._faceAreas, dtype=float)[1:-1]
        self._exact = self._shares / np.asarray(
            mesh.cellVolumes, dtype=float
        )  # m times the exact volume over FiPy's: D of a cell is W times it
        self._alpha = fipy.CellVariable(mesh=mesh, name="alpha", hasOld=True)
        self._size = fipy.CellVariable(mesh=mesh, name="R^m", hasOld=True, value=1.0)
        self._velocity = fipy.FaceVariable(mesh=mesh, rank=1, value=0.0)
        self._correction = fipy.FaceVariable(mesh=mesh, rank=1, value=0.0)
        self._growth = fipy.CellVariable(mesh=mesh, value=0.0)
        self._alpha_equation = (
            fipy.TransientTerm(coeff=self._size, var=self._alpha)
            + fipy.UpwindConvectionTerm(coeff=self._velocity, var=self._alpha)
            + self._correction.divergence
            - self._growth
        )
        self._C = fipy.CellVariable(mesh=mesh, name="C")
        self._C.constrain(self.constants.C_out, mesh.facesRight)
        self._conductance = fipy.FaceVariable(mesh=mesh, value=1.0)
        self._uptake = fipy.CellVariable(mesh=mesh, value=0.0)
        self._C_equation = fipy.ImplicitSourceTerm(coeff=self._uptake, var=self._C) - fipy.DiffusionTerm(
            coeff=self._conductance, var=self._C
        )
        self._u = fipy.CellVariable(mesh=face_mesh, name="u")
        self._viscosity = fipy.FaceVariable(mesh=face_mesh, value=0.0)
        self._drag = fipy.CellVariable(mesh=face_mesh, value=0.0)
        self._load = fipy.CellVariable(mesh=face_mesh, value=0.0)
        self._u_equation = (
            fipy.ImplicitSourceTerm(coeff=self._drag, var=self._u) - fipy.DiffusionTerm(coeff=self._viscosity, var=self._u) - self._load
        )

    def _set(self, t: float, past: Array, y: Array) -> None:
        """Put an iterate and its coefficients into the FiPy variables; its rates and their tangent are left in the work space."""
        p, work, data, size = self.parameters, self.work, self.data_until(t), STRIDE * self.cells
        self.kernel["face_values"](data, y, self._faces, work.model)
        self.kernel["rates"](data, t, y, work.f_0, work.model)
        self.kernel["tangent"](data, t, y, work.f_0, work.jac, work.columns, work.rows, work.corner, work.q_rows, work.q_corner, work.model,
                   work.scratch)  # fmt: skip
        W, W_past = float(y[size]), float(past[size])
        alpha, C = y[0:size:STRIDE] / W, y[1:size:STRIDE]
        for variable, value, old in (
            (self._size, W * self._exact, W_past * self._exact),
            (self._alpha, alpha, past[0:size:STRIDE] / W_past),
        ):
            variable.setValue(old)
            variable.updateOld()
            variable.setValue(value)
        self._set_flux(alpha)
        self._growth.setValue(W * self._exact * eq.net_growth(alpha, C, *p.kinetics))
        self._C.setValue(C)
        self._conductance.setValue((self.m * W) ** ((self.m - 2.0) / self.m))
        self._uptake.setValue(W * self._exact * p.Q * alpha / (1.0 + p.Q1_hat * C))
        self._u.setValue(y[2:size:STRIDE])
        self._set_momentum(alpha, W)

    def _set_flux(self, alpha: Array) -> None:
        """The implicit upwind term takes what the flux of volume carries of the cells' means; the rest of the flux is explicit."""
        flux, c = self._faces[:, 1:-1]
        upwind = np.maximum(c, 0.0) * alpha[:-1] + np.minimum(c, 0.0) * alpha[1:]
        for variable, values in ((self._velocity, c), (self._correction, flux - upwind)):
            inner = np.zeros((1, self.cells + 1))
            inner[0, 1:-1] = values / self._areas
            variable.setValue(inner)

    def _set_momentum(self, alpha: Array, W: float) -> None:
        """The momentum rows, linear in u, symmetric and tridiagonal, as diffusion plus an implicit source; contact and the fluid's
        pressure outside are the load."""
        p, jac, N, h, m = self.parameters, self.work.jac, self.cells, self.grid.spacing, self.m
        rows = slice(2, STRIDE * N, STRIDE)
        lower, diagonal, upper = (jac[rows, HALF + shift].copy() for shift in (-STRIDE, 0, STRIDE))
        lower[0] = upper[-1] = 0.0
        volumes = np.asarray(self._face_mesh.cellVolumes, dtype=float)
        between = np.zeros(N + 1)
        between[1:-1] = -h * upper[:-1] / self._middle_areas
        self._viscosity.setValue(between)
        self._drag.setValue((lower + diagonal + upper) / volumes)
        contact = eq.contact_pressure(alpha, *p.contact)
        areas = ((m * W) ** (1.0 / m) * self.grid.faces[1:]) ** (m - 1)
        self._load.setValue(-areas * np.diff(contact, append=-p.p_out) / volumes)

    def residual(self, t: float, alpha: float, past: Array, x: Array) -> Array:
        """Residual of the implicit step at the iterate `x` (the loop's vector without integrals), from FiPy's terms; the rows of alpha are
        integrals over the cells, those of C and u have the sign of a sink."""
        size, dt = STRIDE * self.cells, 1.0 / alpha
        self._set(t, past, np.concatenate([x, np.zeros(eulerian.INTEGRALS)]))
        out = np.empty(size + BORDER)
        products, rates = slice(0, size, STRIDE), self.work.f_0
        cells = self._alpha_equation.justResidualVector(dt=dt)
        gained = alpha * self._shares * (x[products] - past[products])
        born = float(rates[size + BORDER])
        largest = float(np.max(np.abs(self._faces[0]))) + alpha * float(np.max(np.abs(x[products]))) + abs(born)
        out[products] = without_rounding(cells, float(np.sum(gained)) - born, largest, self._shares)
        out[1:size:STRIDE] = self._C_equation.justResidualVector()
        out[2:size:STRIDE] = self._u_equation.justResidualVector()
        out[size] = alpha * (x[size] - past[size]) - rates[size]
        out[size + 1] = rates[size + 1]
        return out

    # -- Newton -----------------------------------------------------------------------------------------------------

    def tangent(self, t: float, alpha: float, past: Array, x: Array, *, fresh: bool = True) -> csc_matrix:
        """Tangent of `residual` at the iterate it was last called with."""
        size = STRIDE * self.cells
        balance, scale = np.zeros(size + BORDER), np.ones(size + BORDER)
        balance[0:size:STRIDE], scale[0:size:STRIDE] = alpha * self._shares, -self._shares
        scale[1:size:STRIDE] = -1.0
        balance[size], scale[size] = alpha, -1.0
        return self._scatter.matrix(self.work, balance, scale, x)

    def linearised(self, t: float, x: Array, change: Array) -> tuple[Array, Array]:
        """Change of the loop's vector without its integrals, and their integrands: the cells born less those that died, and V."""
        work, size = self.work, STRIDE * self.cells
        step = np.append(change, np.zeros(eulerian.INTEGRALS))
        integrands = work.f_0[size + BORDER :] + work.q_rows @ change[:size] + work.q_corner @ change[size:]
        return step, integrands
