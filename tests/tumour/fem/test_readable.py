"""The forms in the place of the compiled kernel: whole runs agree, and need no Numba."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from tumour import TumourParameters, simulate

WITHOUT_NUMBA = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "numba":
            raise ImportError("there is no Numba here")

sys.meta_path.insert(0, Blocked())
from tumour import simulate
result = simulate(t_end=1.0, geometry={"kind": "disk", "dimension": "2d"}, cells=4, assembly="forms")
print(f"{result['radius'][-1]:.10f}", "numba" in sys.modules)
"""


@pytest.mark.parametrize("options", [{}, {"alpha_step": "as-printed", "time_scheme": "backward-euler"}], ids=["conservative", "printed"])
@pytest.mark.parametrize("kind", ["quarter_disk", "glioma"])
def test_runs_agree(kind: str, options: dict[str, Any]) -> None:
    """Both find the same solution, to what the Newton tolerance of 1e-11 and the sums over 8 steps leave: 1e-9."""
    parameters = TumourParameters(mobility="printed", Q=2.0, C_hypoxic=0.7)
    given: dict[str, Any] = {
        "t_end": 4.0, "cells": 5, "geometry": {"kind": kind, "dimension": "2d"}, "dt": 0.5, "save_every": 2.0, "newton_tol": 1e-11,
        "linear": "superlu", "time_scheme": "bdf2", **options,
    }  # fmt: skip
    compiled, forms = (simulate(parameters, assembly=assembly, **given) for assembly in ("compiled", "forms"))
    for name in (*compiled.fields, *compiled.scalars):
        if name not in ("growth_rate", "doubling_time"):  # rates at t = 0 are over a step of 1e-6
            np.testing.assert_allclose(forms[name], compiled[name], atol=1e-9, rtol=1e-9, err_msg=name)
        else:
            np.testing.assert_allclose(forms[name][1:], compiled[name][1:], rtol=1e-8, err_msg=name)
    assert compiled["hypoxic_fraction"].max() > 0.0  # so that the share below a level is compared


def test_they_need_no_numba() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_NUMBA], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    radius, loaded = done.stdout.split()
    assert loaded == "False"
    expected = simulate(t_end=1.0, geometry={"kind": "disk", "dimension": "2d"}, cells=4)["radius"][-1]
    assert float(radius) == pytest.approx(expected, rel=1e-6)  # of the order of the Newton tolerance
