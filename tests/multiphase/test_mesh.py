"""Triangles: what is refused, which way round they go, and their areas."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.mesh import Mesh

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 1.0], [1.0, 0.0]])


@pytest.mark.parametrize(
    ("points", "triangles", "said"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]], "mesh.points: must have two columns"),
        (SQUARE, [[0, 1]], "mesh.triangles: must have three columns"),
        (SQUARE, [[0, 1, 5]], "must number the 5 points from 0"),
        (SQUARE, [[0, 1, -1]], "must number the 5 points from 0"),
    ],
)
def test_what_is_no_mesh(points: object, triangles: object, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        Mesh(points, triangles)  # type: ignore[arg-type]


def test_clockwise_triangles_are_turned_around() -> None:
    given = np.array([[0, 1, 2], [1, 2, 3]])
    mesh = Mesh(SQUARE, given)
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.areas().tolist() == [1.0, 1.0]
    assert given.tolist() == [[0, 1, 2], [1, 2, 3]], "what was given is as it was"
    assert Mesh(mesh.points, mesh.triangles).triangles is mesh.triangles


def test_areas_of_points_add_up() -> None:
    mesh = Mesh(SQUARE, np.array([[0, 1, 2], [1, 3, 2]]))
    assert mesh.point_areas() == pytest.approx([1 / 3, 2 / 3, 2 / 3, 1 / 3, 0], rel=1e-15)  # thirds of 1, one point in no triangle
    assert mesh.size() == 2.0
