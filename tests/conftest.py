"""What every test needs before anything is imported: pictures without a display, FiPy with the SciPy solvers."""

import os

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("FIPY_SOLVERS", "scipy")
