"""Speed against error: one scene solved by every method at several resolutions and tolerances.

:func:`study` times the runs, measures their errors against a finer run (of another method where there is one) and gives a `Study`:
a table, a CSV file and a picture. It knows no model; it changes the keys ``method``, ``cells`` and ``rtol`` of the scene's [solver].

From the outside inwards: `measure` (the study), `report` and `picture` (what is shown), `bench` (the runs and the references),
`options` (what varies), `accuracy` (errors, Pareto front, observed orders).
"""

from __future__ import annotations

from multiphase.precision.accuracy import Measurement, Order
from multiphase.precision.bench import Reference
from multiphase.precision.measure import study
from multiphase.precision.options import Choices, choices, parse_list
from multiphase.precision.report import Study, check_folder

__all__ = ["Choices", "Measurement", "Order", "Reference", "Study", "check_folder", "choices", "parse_list", "study"]
