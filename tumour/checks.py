"""What only several tables of a tumour's scene together show to be wrong, found before any work starts."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.series import TimeSeries
from multiphase.tensors import TensorFunction
from tumour.boundary import TumourBoundary
from tumour.geometry import LARGEST, TumourGeometry
from tumour.parameters import TISSUE, TumourInitial, TumourParameters
from tumour.solver import TumourSolver

POSITIONS = 2001
"""Points of the initial state at which `check` looks."""


def check(parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry, solver: TumourSolver) -> None:
    """Refuse what only several tables together show, before any work starts.

    Raises
    ------
    ParameterError
        At ``parameters.lambda_alpha`` where the material is unstable; at ``initial.alpha`` where the initial state leaves its range or
        the body; at ``solver.method`` or ``solver.alpha_step`` where the formulation does not have them; at the parameters of a tissue that
        differs from place to place or has fibres, ``parameters.stiffness`` and so on, in a radial body.

    Notes
    -----
    Viscous cells need ``mu > 0`` and ``2 mu + m lambda > 0``: the dissipation ``2 mu |e|^2 + lambda (tr e)^2`` is then positive for
    every rate of strain. Elastic cells need an energy W that grows with the stretch along the radius ever faster, at every deformation:

        d2W/dl_r2 = mu (1 + 1/l_r^2) + lambda (J/l_r)^2 > 0.

    In a slab J/l_r = 1, and the least value, for l_r -> infinity, is ``mu + lambda``. In a disk or sphere J/l_r, the change of area
    across the radius, is as large as one likes, so no negative lambda will do. It need not help that 2 mu + m lambda > 0, which is
    stability at rest: for lambda < 0 the energy of uniform swelling, ``m mu/2 J^(2/m) + lambda/2 J^2`` for large J, has no lower bound
    in a disk or sphere.
    """
    _check_sizes(parameters, initial, geometry)
    _check_moduli(parameters, geometry)
    _check_tissue(parameters, geometry)
    if not geometry.plane:
        _check_fraction(initial, geometry.radius)
    if geometry.plane and solver.method != "mini":
        raise ParameterError("solver.method", f'"{solver.method}" solves radial bodies only; take method = "mini", or leave it out.')
    if solver.method == "mini" and not geometry.plane:
        raise ParameterError(
            "solver.method",
            '"mini" solves bodies in two dimensions; take method = "lines"'
            + (', or write dimension = "2d" in [geometry].' if geometry.kind in ("disk", "quarter_disk") else "."),
        )
    if not geometry.plane:
        for name, usual in (("newton_tol", None), ("linear", "auto"), ("assembly", "compiled")):
            if getattr(solver, name) != usual:
                raise ParameterError(f"solver.{name}", "has a meaning in two dimensions only; leave it out for a radial body.")
    if solver.method == "fipy" and not geometry.eulerian:
        raise ParameterError(
            "solver.method",
            '"fipy" solves the Eulerian formulation only; take method = "lines", or formulation = "eulerian" in [geometry].',
        )
    if solver.alpha_step == "as-printed" and geometry.eulerian:
        raise ParameterError(
            "solver.alpha_step",
            '"as-printed" is a step of the Lagrangian formulation; take alpha_step = "conservative", or formulation = "lagrangian" in '
            "[geometry].",
        )


def check_boundary(boundary: TumourBoundary, geometry: TumourGeometry) -> None:
    """Refuse named parts of the boundary of a radial body, on sides that slide, and with values that only a wrong unit explains."""
    for part in boundary:
        if not geometry.plane:
            how = 'write dimension = "2d" in [geometry]' if geometry.kind in ("disk", "quarter_disk") else "take a body in two dimensions"
            raise ParameterError(
                part.path, f"the surface of a radial body is the same all round and has no parts; {how}, or leave them out."
            )
        for axis in "xy":
            if part.side in (getattr(geometry, f"slide_{axis}") or ()):
                raise ParameterError(
                    f"{part.path}.side",
                    f'the body slides on "{part.side}", by geometry.slide_{axis}, so it is no part of the free surface.',
                )
        for item in fields(part):
            value = getattr(part, item.name)
            listed = value.values if isinstance(value, TimeSeries) else (value,) if isinstance(value, float) else ()
            largest = max(map(abs, listed), default=0.0)
            if largest > LARGEST:
                raise ParameterError(
                    f"{part.path}.{item.name}",
                    f"{largest:g} is beyond {LARGEST:g}; everything here is dimensionless, so choose other units.",
                )


def _check_moduli(parameters: TumourParameters, geometry: TumourGeometry) -> None:
    """Refuse a material that is unstable: see `check`."""
    mu, lam = parameters.moduli
    m = geometry.m
    if geometry.eulerian:
        least, is_allowed = -2.0 * mu / m, 2.0 * mu + m * lam > 0.0
        why = f"makes the viscosity of uniform growth, 2 mu_alpha + {m} lambda_alpha = {2.0 * mu + m * lam:g}, 0 or less"
    elif m == 1:
        least, is_allowed = -mu, lam > -mu
        why = "makes a slab's elastic energy lose its convexity as the slab thickens"
    else:
        least, is_allowed = 0.0, lam >= 0.0
        why = f"leaves the elastic energy of a {geometry.kind.replace('_', ' ')} without a lower bound, so that it would swell without end"
    if not is_allowed:
        bound = f"{least:g} or more" if least == 0.0 else f"greater than {least:g}"
        raise ParameterError("parameters.lambda_alpha", f"{lam:g} with mu_alpha = {mu:g} {why}; lambda_alpha must be {bound} here.")


def _check_tissue(parameters: TumourParameters, geometry: TumourGeometry) -> None:
    """Refuse a tissue that is not the same everywhere where the model has none, and Python functions that were sampled on another body."""
    is_disk = geometry.kind in ("disk", "quarter_disk")
    for name in parameters.varying:
        function: PositionFunction | TensorFunction = getattr(parameters, name)
        path = f"parameters.{name}"
        if not geometry.plane and is_disk and not geometry.eulerian:
            raise ParameterError(path, 'has a meaning in two dimensions only; write dimension = "2d" in [geometry], or leave it out.')
        if not geometry.plane:
            raise ParameterError(
                path,
                "only the elastic (Lagrangian) model in two dimensions has it; leave it out, or take a body of that model, such as "
                'kind = "disk" with dimension = "2d" in [geometry].',
            )
        if function.is_sampled and not is_disk:
            raise ParameterError(
                path, "a Python function is sampled along the radius of a disk, and this body is none; give a formula in x, y or r."
            )
        if function.with_length(geometry.radius) != function:
            raise ParameterError(
                path,
                f"the Python function was sampled on a body of another radius than {geometry.radius:g}; give "
                f"parameters.within({geometry.radius:g}) instead.",
            )


def _check_sizes(parameters: TumourParameters, initial: TumourInitial, geometry: TumourGeometry) -> None:
    """Refuse sizes that only a wrong unit explains, and positions outside of the body."""
    for item in fields(parameters):
        value = getattr(parameters, item.name)
        if isinstance(value, float) and abs(value) > LARGEST:
            raise ParameterError(
                f"parameters.{item.name}", f"{value:g} is beyond {LARGEST:g}; everything here is dimensionless, so choose other units."
            )
    for name in TISSUE:
        largest = np.max(np.abs(getattr(parameters, name).listed), initial=0.0)
        if largest > LARGEST:
            raise ParameterError(f"parameters.{name}", f"{largest:g} is beyond {LARGEST:g}; it is a dimensionless factor or angle.")
    for name in ("mu_alpha", "kappa", "stiffness", "permeability", "diffusivity"):
        listed = getattr(parameters, name)
        value = listed if isinstance(listed, float) else float(np.min(listed.listed, initial=1.0))
        if 0.0 < value < 1.0 / LARGEST:
            raise ParameterError(
                f"parameters.{name}",
                f"{value:g} is smaller than {1.0 / LARGEST:g}; everything here is dimensionless, so choose other units"
                + ("; 0 lets the fluid flow freely." if name == "kappa" else "."),
            )
    extent = initial.alpha.extent
    if not geometry.plane and extent is not None and (extent[0] < 0.0 or extent[1] > geometry.radius * (1.0 + 1e-9)):
        raise ParameterError(
            "initial.alpha",
            f"its positions go from {extent[0]:g} to {extent[1]:g}, but the body from 0 to its radius {geometry.radius:g}; positions are "
            "dimensionless, like the radius.",
        )


def _check_fraction(initial: TumourInitial, radius: float) -> None:
    """Refuse a cell fraction that is not between 0 and 1, depends on more than the radius, or was sampled on another body."""
    function: PositionFunction = initial.alpha
    others = sorted(function.names - {"r", "xi"})
    if others:
        raise ParameterError(
            "initial.alpha",
            f"{'a grid' if function.is_grid else 'the formula'} uses {', '.join(others)}, but fields of this body depend on the distance "
            'from its middle alone; use r and xi, or write dimension = "2d" in [geometry] for a disk or quarter disk.',
        )
    if function.with_length(radius) != function:
        raise ParameterError(
            "initial.alpha",
            f"the Python function was sampled on a body of another radius than {radius:g}; give initial.within({radius:g}) instead.",
        )
    xi = np.linspace(0.0, 1.0, POSITIONS)
    r = radius * xi
    alpha = function(r=r, xi=xi)
    if np.any((alpha <= 0.0) | (alpha >= 1.0)):
        i = int(np.argmax(np.abs(alpha - 0.5)))
        raise ParameterError(
            "initial.alpha",
            f"alpha is {alpha[i]:.15g} at r = {r[i]:.6g} (xi = {xi[i]:.6g}); it must be greater than 0 and below 1 everywhere.",
        )
