"""The plaque by the method of lines: the compiled finite volumes of `plaque1d.discretisation` with the schemes of `multiphase.lines`."""

from __future__ import annotations

from multiphase import lines
from plaque1d.semidiscrete import SemiDiscrete


class LinesScheme(SemiDiscrete, lines.Implicit):
    """One implicit step for the common time loop."""


class RadauLines(SemiDiscrete, lines.Radau):
    """With an integrator of its own."""
