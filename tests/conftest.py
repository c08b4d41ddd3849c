"""What every test needs before anything is imported: pictures without a display, FiPy with the SciPy solvers; and Ctrl-C."""

import os
import signal
from collections.abc import Iterator

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("FIPY_SOLVERS", "scipy")


@pytest.fixture(autouse=True)
def _ctrl_c_works() -> Iterator[None]:
    """A shell that runs the tests in the background makes them ignore Ctrl-C, and what they start as well; here it must work."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)
