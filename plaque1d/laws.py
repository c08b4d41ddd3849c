"""The laws of `plaque1d.equations`, compiled, for use in compiled loops over cells and faces."""

from __future__ import annotations

from multiphase.compiled import compiled
from multiphase.geometry import relative_velocity as _relative_velocity
from multiphase.transport import floored as _floored
from multiphase.transport import floored_slope as _floored_slope
from plaque1d import equations as eq

extra_stress = compiled(eq.extra_stress)
extra_stress_slope = compiled(eq.extra_stress_slope)
uptake = compiled(eq.uptake)
floored = compiled(_floored)
floored_slope = compiled(_floored_slope)
viscosity = compiled(eq.viscosity)
mean_viscosity = compiled(eq.mean_viscosity)
wall_concentration = compiled(eq.wall_concentration)
wall_concentration_slopes = compiled(eq.wall_concentration_slopes, wall_concentration=wall_concentration)
growth_rate = compiled(eq.growth_rate)
necrotic_velocity = compiled(eq.necrotic_velocity)
macrophage_velocity = compiled(eq.macrophage_velocity)
short_wave_velocity = compiled(eq.short_wave_velocity, mean_viscosity=mean_viscosity)
short_wave_excess_slopes = compiled(eq.short_wave_excess_slopes, mean_viscosity=mean_viscosity)
pressure = compiled(eq.pressure)
drag_diffusivity = compiled(eq.drag_diffusivity)
relative_velocity = compiled(_relative_velocity)
