"""A body that is no longer what the model is about: a warning, once."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from multiphase.stepping import Snapshot, State
from tumour import TumourParameters, meshes, simulate
from tumour.fem.watch import Shape


def shown(body: Any, displacement: np.ndarray, t: float, asymmetry: float = 0.0) -> Snapshot:
    return Snapshot(t, {"asymmetry": asymmetry}, {"displacement": displacement, "C": np.ones(len(displacement))}, None)


STATE = State(times=np.zeros(1), u=np.zeros((1, 1)), dt=1.0)


def test_a_surface_that_crosses_itself(caplog: pytest.LogCaptureFixture) -> None:
    """Two lobes of a glioma are pushed into each other: the point, the time, and only one warning."""
    body = meshes.glioma(0.4, 0.1)
    points = body.mesh.p.T
    watch = Shape(body, is_uniform=True)
    bent = np.column_stack([-1.6 * np.sign(points[:, 0]) * np.maximum(-points[:, 1], 0.0), np.zeros(len(points))])
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        watch.on_save(STATE, shown(body, 3.0 * points, 1.0, asymmetry=0.5))  # larger, but the same shape; and a glioma is not round
        assert caplog.messages == []
        watch.on_save(STATE, shown(body, bent, 2.0))
        watch.on_save(STATE, shown(body, bent, 3.0))
    assert len(caplog.messages) == 1
    assert "crosses itself near" in caplog.messages[0]
    assert "t = 2:" in caplog.messages[0]


def test_a_disk_that_is_no_longer_round(caplog: pytest.LogCaptureFixture) -> None:
    body = meshes.disk(1.0, 4)
    still = np.zeros((body.quality.nodes, 2))
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        uneven, watch = Shape(body, is_uniform=False), Shape(body, is_uniform=True)
        uneven.on_save(STATE, shown(body, still, 1.0, asymmetry=0.1))  # it never was the same in all directions
        watch.on_save(STATE, shown(body, still, 1.0, asymmetry=0.01))
        watch.on_save(STATE, shown(body, still, 0.0, asymmetry=0.1))  # of the outermost triangles, which take up fluid at once
        assert caplog.messages == []
        for t in (2.0, 3.0):
            watch.on_save(STATE, shown(body, still, t, asymmetry=0.03))
    assert len(caplog.messages) == 1
    assert "asymmetry = 0.03 at t = 2" in caplog.messages[0]


def test_a_run_is_watched(caplog: pytest.LogCaptureFixture) -> None:
    """The paper's disk beyond its buckling."""
    with caplog.at_level(logging.WARNING, logger="multiphase"):
        quarter = {"kind": "quarter_disk", "dimension": "2d"}
        simulate(TumourParameters.preset("paper"), t_end=80.0, geometry=quarter, cells=10, save_every=2.0, raise_on_failure=False)
    assert any("lost its round shape" in message for message in caplog.messages)
