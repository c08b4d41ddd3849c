"""The reference plaque as a FiPy script: segregated sweeps and fixed time steps.

n and l live on a Grid1D over xi = x/L, the slip velocity w on a second one whose cell centres are the faces of the first. FiPy's
VanLeerConvectionTerm is explicit: the fluxes of n are those of the last time step, which limits the step to about a cell's passage,
and with FiPy's backward Euler the whole is of first order in time. It knows the mesh but not L, so its correction for the time step
sees v dt / h in place of v dt / (h L); that is an error of first order too. One sweep a step with twice the steps takes as long as
two sweeps, and leaves n about as accurate and L less so.
"""

from __future__ import annotations

import os
import time

os.environ.setdefault("FIPY_SOLVERS", "scipy")

import numpy as np
from fipy import (
    CellVariable,
    CentralDifferenceConvectionTerm,
    DiffusionTerm,
    FaceVariable,
    Grid1D,
    ImplicitSourceTerm,
    LinearLUSolver,
    TransientTerm,
    VanLeerConvectionTerm,
)

PSI_L, PSI_M = 1.0, 0.5
K_L, K_M = 2.0, 2.0
DRAG = 20.0
NU_N, NU_M = 1.0, 1.0
A, B, POWER = 0.5, 1.0, 1.0
FLOOR = 1e-5
T_END = 2.0
FIXED = 1e10  # FiPy's way to hold the value of a cell


def wall_speed(l_first: float, half_cell: float) -> float:
    """V = Psi_m l_w, where l_w is the positive root of Psi_l = Psi_m l_w^2 - (l_0 - l_w) / half_cell."""
    load = l_first + half_cell * PSI_L
    return PSI_M * 2.0 * load / (1.0 + np.sqrt(1.0 + 4.0 * PSI_M * half_cell * load))


def solve(cells: int, steps: int, sweeps: int = 2) -> dict[str, object]:
    """Cell values of n and l, and L, at T = 2."""
    h, dt = 1.0 / cells, T_END / steps
    mesh = Grid1D(nx=cells, dx=h)
    xi, xi_face = mesh.cellCenters.value[0], mesh.faceCenters.value[0]
    n = CellVariable(mesh=mesh, value=0.1 + 0.05 * np.cos(np.pi * xi) ** 2, hasOld=True)
    l = CellVariable(mesh=mesh, value=0.2, hasOld=True)
    L = CellVariable(mesh=mesh, value=0.5, hasOld=True)
    v_n = FaceVariable(mesh=mesh, rank=1, value=0.0)
    v_l = FaceVariable(mesh=mesh, rank=1, value=0.0)
    influx = FaceVariable(mesh=mesh, rank=1, value=0.0)
    influx.setValue(PSI_L, where=mesh.facesLeft)
    died, eaten = K_M * L * l, K_L * L * (1.0 - n)
    n_equation = TransientTerm(coeff=L, var=n) + VanLeerConvectionTerm(coeff=v_n, var=n) + ImplicitSourceTerm(coeff=died, var=n) == died
    l_carried = CentralDifferenceConvectionTerm(coeff=v_l, var=l) - DiffusionTerm(coeff=1.0 / L.faceValue, var=l)
    l_equation = TransientTerm(coeff=L, var=l) + l_carried + ImplicitSourceTerm(coeff=eaten, var=l) == -influx.divergence

    # w: cells - 1 interior faces and the two walls, whose values are held. n (c (n w)_x)_x = (n^2 c w_x)_x + n (c n_x)_x w.
    slip_mesh = Grid1D(nx=cells + 1, dx=h) + np.array([[-0.5 * h]])
    w = CellVariable(mesh=slip_mesh, value=0.0)
    viscous = FaceVariable(mesh=slip_mesh, value=0.0)
    drag = CellVariable(mesh=slip_mesh, value=0.0)
    pull = CellVariable(mesh=slip_mesh, value=0.0)
    w_equation = DiffusionTerm(coeff=viscous, var=w) - ImplicitSourceTerm(coeff=drag, var=w) == pull
    solver = LinearLUSolver(criterion="initial", tolerance=1e-10)  # the default compares with FIXED

    def load_slip(V: float, width: float) -> None:
        """Coefficients of the slip equation, times L^2."""
        n_cell, c_cell = np.maximum(n.value, FLOOR), np.maximum(1.0 - n.value, FLOOR)
        n_mean = n.arithmeticFaceValue.value  # at the walls that of the cell beside it, as n_x = 0
        n_face, c_face = np.maximum(n_mean, FLOOR), np.maximum(1.0 - n_mean, FLOOR)
        stress = (1.0 - n.value) * A / (1.0 + B * np.maximum(l.value, 0.0) ** POWER)
        in_cells = NU_M * c_cell * n_face[:-1] * n_face[1:] + NU_N * n_cell * c_face[:-1] * c_face[1:]
        bend = n_face[1:-1] * np.diff(NU_M * c_cell * np.diff(n_face)) + c_face[1:-1] * np.diff(NU_N * n_cell * np.diff(c_face))
        viscous.setValue(np.concatenate([[0.0], in_cells, [0.0]]))
        drag.setValue(np.concatenate([[FIXED], width**2 * DRAG * n_face[1:-1] * c_face[1:-1] - bend / h**2, [FIXED]]))
        pull.setValue(np.concatenate([[-FIXED * V / c_face[0]], width * n_face[1:-1] * np.diff(stress) / h, [0.0]]))

    started = time.perf_counter()
    for _ in range(steps):
        for variable in (n, l, L):
            variable.updateOld()
        for _ in range(sweeps):
            width = float(L.value[0])
            V = wall_speed(float(l.value[0]), 0.5 * h * width)
            L.setValue(L.old.value + dt * V)
            width = float(L.value[0])
            load_slip(V, width)
            w_equation.solve(var=w, solver=solver)
            velocity = (1.0 - xi_face) * V - (1.0 - n.arithmeticFaceValue.value) * w.value
            velocity[[0, -1]] = 0.0
            carried = (1.0 - xi_face) * V
            carried[0] = 0.0
            v_n.setValue(velocity[None, :])
            v_l.setValue(carried[None, :])
            n_equation.sweep(var=n, dt=dt, solver=solver)
            l_equation.sweep(var=l, dt=dt, solver=solver)
    seconds = time.perf_counter() - started
    return {"n": n.value.copy(), "l": l.value.copy(), "L": float(L.value[0]), "seconds": seconds, "note": f"{sweeps} sweeps a step"}
