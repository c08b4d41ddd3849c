"""The laws of `tumour.equations`, compiled, for use in compiled loops over cells and faces."""

from __future__ import annotations

from multiphase.compiled import compiled
from multiphase.transport import floored as _floored
from multiphase.transport import floored_slope as _floored_slope
from tumour import equations as eq

contact_switch = compiled(eq.contact_switch)
contact_switch_slope = compiled(eq.contact_switch_slope)
contact_stress = compiled(eq.contact_stress, contact_switch=contact_switch)
contact_stress_slope = compiled(eq.contact_stress_slope, contact_switch=contact_switch, contact_switch_slope=contact_switch_slope)
contact_pressure = compiled(eq.contact_pressure, contact_stress=contact_stress)
contact_pressure_slope = compiled(eq.contact_pressure_slope, contact_stress=contact_stress, contact_stress_slope=contact_stress_slope)
net_growth = compiled(eq.net_growth)
net_growth_slopes = compiled(eq.net_growth_slopes)
homeostatic_fraction = compiled(eq.homeostatic_fraction)
critical_oxygen = compiled(eq.critical_oxygen)
oxygen_uptake = compiled(eq.oxygen_uptake)
oxygen_uptake_slopes = compiled(eq.oxygen_uptake_slopes)
mobility = compiled(eq.mobility)
mobility_slope = compiled(eq.mobility_slope)
resistance = compiled(eq.resistance)
resistance_slope = compiled(eq.resistance_slope)
volume_ratio = compiled(eq.volume_ratio)
elastic_energy = compiled(eq.elastic_energy, volume_ratio=volume_ratio)
elastic_stress = compiled(eq.elastic_stress, volume_ratio=volume_ratio)
elastic_stress_slopes = compiled(eq.elastic_stress_slopes, volume_ratio=volume_ratio)
viscous_stress = compiled(eq.viscous_stress)
viscous_stress_slopes = compiled(eq.viscous_stress_slopes)
free_expansion_rate = compiled(eq.free_expansion_rate)
floored = compiled(_floored)
floored_slope = compiled(_floored_slope)
