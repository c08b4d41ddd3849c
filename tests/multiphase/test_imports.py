"""Importing the packages is cheap: what only some runs need is imported where it is used."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("fipy", "matplotlib", "scipy", "numba", "h5py", "tqdm", "skfem", "xarray")


@pytest.mark.parametrize("package", ["multiphase", "plaque1d", "tumour", "multiphase.cli"])
def test_import_brings_in_no_optional_part(package: str) -> None:
    code = f"import sys, {package}; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
    assert found.stderr == ""


def test_the_documented_names_are_there() -> None:
    import multiphase
    import plaque1d
    import tumour

    assert {"ParameterError", "Result", "SolverError", "load"} <= set(multiphase.__all__)
    assert {"PlaqueInitial", "PlaqueParameters", "simulate"} <= set(plaque1d.__all__)
    assert {"TumourInitial", "TumourParameters", "simulate"} <= set(tumour.__all__)
    for package in (multiphase, plaque1d, tumour):
        assert all(hasattr(package, name) for name in package.__all__)
