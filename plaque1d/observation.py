"""What is stored of a state of the plaque: velocities, pressure, wall values and balances, in the slab and in the annulus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from multiphase.geometry import MovingGrid
from multiphase.stepping import Snapshot
from plaque1d import equations as eq
from plaque1d.parameters import PlaqueGeometry, PlaqueInitial, PlaqueParameters

Array = NDArray[np.float64]

SMALLEST_FRACTION = 1e-5
"""Macrophage fraction at the endothelium below which the slip velocity there, V/c, is no longer resolved."""


def cell_averages(function: Callable[..., Array], grid: MovingGrid, geometry: PlaqueGeometry, L: float) -> Array:
    """Averages over the cells of a function of x and xi = x/L, by Gauss's rule of three points."""
    points, weights = np.polynomial.legendre.leggauss(3)
    share = grid.centres[:, None] + 0.5 * grid.spacing * points
    x = geometry.position(share.ravel(), geometry.size(L))
    values = np.asarray(function(x=x, xi=x / L), dtype=float).reshape(share.shape)
    averages: Array = values @ (0.5 * weights)
    return averages


@dataclass(slots=True)
class Observer:
    """Turns states into snapshots.

    Attributes
    ----------
    parameters, geometry, grid
    totals : (4,) array
        Integrals of n, c and l, and W, at the start; the balances are drawn up against them.
    """

    parameters: PlaqueParameters
    geometry: PlaqueGeometry
    grid: MovingGrid
    totals: Array = field(default_factory=lambda: np.zeros(4))

    def wall(self, t: float, l_0: float, W: float, side: int = -1) -> float:
        """modLDL at the endothelium at time t, from its influx just before it (or after it, with ``side = 1``)."""
        p, R_1 = self.parameters, self.geometry.inner_radius
        side = side if t > 0.0 else 1
        return eq.wall_concentration(l_0, 0.5 * self.grid.spacing * W / R_1, p.Psi_l(t, side=side), p.Psi_m)

    def start(self, initial: PlaqueInitial) -> tuple[Array, Array, float]:
        """Initial averages of n and l over the cells, and the initial W, to which the balances refer from now on."""
        n, l = (cell_averages(f, self.grid, self.geometry, initial.L) for f in (initial.n, initial.l))
        W = self.geometry.size(initial.L)
        self.totals = self._totals(n, l, W)
        return n, l, W

    def _totals(self, n: Array, l: Array, W: float) -> Array:
        n_total, l_total = W * float(np.mean(n)), W * float(np.mean(l))
        return np.array([n_total, W - n_total, l_total, W])

    def snapshot(self, t: float, n: Array, l: Array, w: Array, W: float, gains: Array, extra: dict[str, Array]) -> Snapshot:
        """Fields at the cell centres and the scalars of the contract.

        Parameters
        ----------
        t : float
        n, l : (N,) array
        w : (N - 1,) array
            Slip on the interior faces.
        W : float
        gains : (4,) array
            Integrals over time of the sources: n's, l's losses, the influx of modLDL, and dW/dt.
        extra : dict of str to (N,) array
            Further fields.
        """
        p, geometry, grid = self.parameters, self.geometry, self.grid
        h, R_1 = grid.spacing, geometry.inner_radius
        l_wall = self.wall(t, float(l[0]), W)
        V = R_1 * eq.growth_rate(l_wall, p.Psi_m)
        n_inner = float(n[0] - (n[1] - n[0]) / 6.0) if isinstance(p.inner_wall, str) else float(p.inner_wall)
        face_n = np.empty(grid.cells + 1)
        face_n[0], face_n[1:-1], face_n[-1] = n_inner, 0.5 * (n[:-1] + n[1:]), n[-1] + 0.5 * (n[-1] - n[-2])
        radius = R_1 + geometry.position(grid.faces, W) if geometry.annulus else np.ones(grid.cells + 1)
        mixture = V / radius
        slip = np.empty(grid.cells + 1)
        slip[0], slip[1:-1], slip[-1] = mixture[0] / max(1.0 - n_inner, SMALLEST_FRACTION), w, 0.0
        u_n, u_m = eq.necrotic_velocity(mixture, face_n, slip), eq.macrophage_velocity(mixture, face_n, slip)
        u_n[0] = 0.0
        c = 1.0 - n
        fields = {"n": n, "c": c, "l": l, "u_n": grid.to_centres(u_n), "u_m": grid.to_centres(u_m)}
        fields["p_n"] = self._pressure(n, eq.extra_stress(l, p.A, p.B, p.k), u_n, u_m, radius, h * W)
        L = float(geometry.width(W))
        scalars = {"L": L, "L_rate": V / float(radius[-1]), "l_wall": l_wall, "n_wall": n_inner} | self._balances(n, l, W, gains)
        return Snapshot(t, scalars, fields | extra, np.asarray(geometry.position(grid.centres, W)))

    def _pressure(self, n: Array, stress: Array, u_n: Array, u_m: Array, radius: Array, area: float) -> Array:
        """p_n in the cells, from the sum of the momentum balances integrated from the outer wall."""
        p, c = self.parameters, 1.0 - n
        mean = 0.5 * (radius[:-1] + radius[1:])
        radial = mean / area
        e_n, e_m = radial * np.diff(u_n), radial * np.diff(u_m)
        if not self.geometry.annulus:
            return eq.pressure(p.p_out, n, stress, e_n, e_m, p.nu_n, p.nu_m)
        hoop_n, hoop_m = 0.5 * (u_n[:-1] + u_n[1:]) / mean, 0.5 * (u_m[:-1] + u_m[1:]) / mean
        step = 2.0 * (p.mu_n * n * (e_n - hoop_n) + p.mu_m * c * (e_m - hoop_m)) * area / mean**2
        outer = p.p_out - (np.cumsum(step[::-1])[::-1] - 0.5 * step)
        return eq.pressure(outer, n, stress, e_n, e_m, p.nu_n, p.nu_m) + p.lambda_n * n * hoop_n + p.lambda_m * c * hoop_m

    def _balances(self, n: Array, l: Array, W: float, gains: Array) -> dict[str, float]:
        """Amounts per unit length of endothelium, and defects relative to the larger of the amount and what came in."""
        totals = self._totals(n, l, W)
        n_gain, l_loss, influx, growth = (float(g) for g in gains)
        R_1 = self.geometry.inner_radius
        values = {name: float(total) / R_1 for name, total in zip(("n_total", "c_total", "l_total"), totals[:3], strict=True)}
        expected = (n_gain, growth - n_gain, influx - l_loss, growth)
        through = (abs(n_gain), abs(growth + n_gain), abs(influx + l_loss), abs(growth))
        for i, name in enumerate(("n", "c", "l", "L")):
            total = float(totals[i])
            scale = max(abs(total), through[i])
            values[f"defect_{name}"] = (total - float(self.totals[i]) - expected[i]) / scale if scale > 0.0 else 0.0
        return values
