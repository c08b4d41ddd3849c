"""The cases that benchmarks share with the tests."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parent.parent / "tests"


def of_tests(folder: str, name: str) -> Any:
    """A module of a folder of the tests, which are no packages."""
    path = str(TESTS / folder)
    if path not in sys.path:
        sys.path.append(path)
    return importlib.import_module(name)
