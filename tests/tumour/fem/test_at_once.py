"""What acts or is prescribed at once, at t = 0 and at jumps: the equilibrium is found, in shares where need be; and oxygen below 0."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from multiphase.errors import SolverError
from multiphase.stepping import StepFailure
from tumour import TumourParameters, simulate
from tumour.fem.scheme import MiniScheme

DISK = {"kind": "disk", "dimension": "2d"}
HELD = {"where": "x < -0.7", "displacement_x": 0.0, "displacement_y": 0.0}
ACTING: dict[str, dict[str, Any]] = {
    "pulled": {"where": "x > 0.5", "traction_y": 2.0},
    "moved": {"where": "x > 0.5", "displacement_x": 0.8, "displacement_y": 0.8},
}


def grown(part: dict[str, Any], end: float, **options: Any) -> Any:
    parameters = TumourParameters(lambda_alpha=1.0)
    return simulate(parameters, geometry=DISK, boundary={"held": HELD, "part": part}, cells=6, t_end=end, linear="superlu", **options)


@pytest.mark.parametrize("case", ACTING)
def test_what_acts_from_the_start_acts_like_a_short_ramp(case: str) -> None:
    """The ramp ends at 1e-6: what flows and grows in that time is 1e-6 of what there is, and ten times that is allowed. At rest no cell and
    no volume is anywhere else."""
    part = ACTING[case]
    ramp = {"times": [0.0, 1e-6], "values": [0.0, 1.0]}
    slow = {key: {**ramp, "values": [0.0, value]} if key.startswith(("traction", "displacement")) else value for key, value in part.items()}
    at_once, in_time = (grown(one, 0.01, rtol=1e-5) for one in (part, slow))
    assert np.abs(at_once["displacement"][0]).max() > 0.3
    scale = np.abs(at_once["displacement"][-1]).max()
    assert np.abs(at_once["displacement"][-1] - in_time["displacement"][-1]).max() < 1e-4 * scale  # ten tolerances in time
    for result in (at_once, in_time):
        assert np.abs(result["defect_cells"]).max() < 1e-6
        assert np.abs(result["defect_volume"]).max() < 1e-6
        assert result["cell_mass"][0] == pytest.approx(0.8 * np.pi, rel=1e-6)  # whatever is moved, no cell is born by that


def test_the_shares_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """In one go Newton's method does not find a body that is bent so far; the sentence names the part and a ramp."""

    def give_up(self: MiniScheme, t: float, u: np.ndarray, before: Any, failure: StepFailure) -> None:
        raise failure

    monkeypatch.setattr(MiniScheme, "_ramp", give_up)
    with pytest.raises(SolverError, match=r'What acts on "part" at once should rise from 0'):
        grown(ACTING["moved"], 0.01)


def test_a_jump_on_the_way() -> None:
    """From t = 0.5 on as if the traction had risen within 1e-6; the row at the jump holds the state before it."""
    sudden = {"where": "x > 0.5", "traction_y": {"times": [0, 0.5, 0.5], "values": [0, 0, 0.4]}}
    short = {"where": "x > 0.5", "traction_y": {"times": [0, 0.5, 0.500001], "values": [0, 0, 0.4]}}
    one, other = (grown(part, 0.6, save_at=[0.5, 0.6], rtol=1e-5) for part in (sudden, short))
    assert np.abs(one["displacement"][1]).max() < 0.1
    assert np.abs(one["displacement"][2]).max() > 0.5
    for row in (1, 2):
        off = np.abs(one["displacement"][row] - other["displacement"][row]).max()
        assert off < 1e-4 * np.abs(one["displacement"][row]).max()


def test_oxygen_below_0_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """Layers thinner than a triangle: C undershoots; with finer triangles it does not."""
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        for cells in (4, 32):
            caplog.clear()
            thirsty = TumourParameters(lambda_alpha=1.0, consumption=300.0)
            result = simulate(thirsty, geometry={**DISK, "radius": 2.0}, cells=cells, t_end=0.01, save_every=0.01)
            told = [record.getMessage() for record in caplog.records if "below 0" in record.getMessage()]
            assert len(told) == (cells == 4)
            assert (result["C_min"][0] < -0.01) == (cells == 4)
