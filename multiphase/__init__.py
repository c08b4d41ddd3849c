"""Multiphase models of growing tissue: what the plaque and the tumour share.

Models live in packages of their own (`plaque1d`, `tumour`) and are found as plug-ins. Here are scenes, the time loop, results
and their storage, pictures, and the command line.
"""

from __future__ import annotations

import logging

from multiphase.errors import ParameterError, SolverError
from multiphase.result import Result, load

__version__ = "0.1.0"
__all__ = ["ParameterError", "Result", "SolverError", "__version__", "load"]

logging.getLogger("multiphase").addHandler(logging.NullHandler())
