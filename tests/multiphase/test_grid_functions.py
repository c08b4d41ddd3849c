"""Functions of x and y on a grid of pixels: given outright, from images, stored and read back."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from multiphase import grids, storage
from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction
from multiphase.result import Result

VARIABLES = ("r", "xi", "x", "y", "theta")
ROUNDING = 1e-14
"""Some ten roundings of numbers of about 1 in a bilinear value, and the position in pixels: of less than 10."""


def grid(value: Any, **options: Any) -> PositionFunction:
    return PositionFunction(value, variables=VARIABLES, path="parameters.stiffness", **options)


def at(function: PositionFunction, x: Any, y: Any) -> np.ndarray:
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    return function(r=np.hypot(x, y), xi=np.hypot(x, y), x=x, y=y, theta=np.arctan2(y, x))


def refusal(value: Any, **options: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        grid(value, **options)
    return caught.value


def centres(pixel: float, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    x = pixel * (np.arange(columns) - (columns - 1) / 2)
    y = pixel * ((rows - 1) / 2 - np.arange(rows))
    return x[None, :], y[:, None]


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (3, 5), (8, 4), (1, 6), (5, 1)])
def test_bilinear_functions_are_exact_between_the_outer_centres(rows: int, columns: int) -> None:
    def exact(x: Any, y: Any) -> Any:
        return 1.0 + (2.0 * x if columns > 1 else 0.0) - (3.0 * y if rows > 1 else 0.0) + (0.7 * x * y if min(rows, columns) > 1 else 0.0)

    pixel = 0.3
    x, y = centres(pixel, rows, columns)
    values = np.broadcast_to(exact(x, y), (rows, columns))
    function = grid({"pixel": pixel, "values": values})
    rng = np.random.default_rng(1)
    u = rng.uniform(-0.5, 0.5, (2, 200)) * np.array([[pixel * (columns - 1)], [pixel * (rows - 1)]])
    np.testing.assert_allclose(at(function, *u), exact(*u), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(at(function, x, y), values, rtol=0, atol=ROUNDING)


def test_rows_go_down_and_the_middle_is_the_origin() -> None:
    function = grid({"pixel": 1.0, "values": [[1, 2, 3], [4, 5, 6]]})
    assert at(function, [-1.0, 0.0, 1.0, -1.0, 0.0, 1.0], [0.5, 0.5, 0.5, -0.5, -0.5, -0.5]).tolist() == [1, 2, 3, 4, 5, 6]
    assert at(function, 0.0, 0.0) == 3.5


def test_constant_in_the_outer_half_pixel_and_refused_beyond() -> None:
    function = grid({"pixel": 1.0, "values": [[1, 2], [3, 4]]})
    assert at(function, [-1.0, 1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0]).tolist() == [1, 2, 4, 3]
    assert at(function, 0.7, 0.0) == at(function, 0.5, 0.0) == 3.0
    assert at(function, 1.0 + 1e-12, 0.0) == 3.0  # a point of a body as large as the grid, rounded
    for x, y in ((1.01, 0.0), (-1.01, 0.0), (0.0, 1.01), (0.3, -2.0)):
        with pytest.raises(ParameterError) as caught:
            at(function, [0.0, x], [0.0, y])
        assert caught.value.path == "parameters.stiffness"
        assert f"needed at ({x:g}, {y:g})" in str(caught.value)
        assert "from (-1, -1) to (1, 1)" in str(caught.value)


def test_what_it_says_of_itself() -> None:
    values = [[1.0, 2.0, 0.5]]
    function = grid({"pixel": 0.5, "values": values})
    assert function.is_grid
    assert function.names == {"x", "y"}
    assert function.extent is function.constant is None
    assert sorted(function.listed) == [0.5, 1.0, 2.0]
    assert function.with_length(3.0) is function
    assert function.to_table() == {"pixel": 0.5, "values": values}
    assert repr(function) == "<grid of 1 x 3 values, pixels of 0.5>"
    assert not grid("x").is_grid
    assert not function.is_sampled


def test_equality_copies_and_pickling() -> None:
    table = {"pixel": 0.5, "values": [[1.0, 0.0], [2.0, 3.0]]}
    function = grid(table)
    for same in (
        grid(table),
        grid(function),
        grid(function.to_table()),
        pickle.loads(pickle.dumps(function)),
        grid(table | {"pixel": 0.5}),
    ):
        assert same == function
        assert hash(same) == hash(function)
        assert at(same, 0.1, 0.2) == at(function, 0.1, 0.2)
    assert hash(grid(table | {"values": [[1.0, -0.0], [2.0, 3.0]]})) == hash(function)
    for other in (
        table | {"pixel": 0.4},
        table | {"values": [[1.0, 0.0], [2.0, 3.1]]},
        table | {"values": [[1.0, 0.0, 2.0, 3.0]]},
        1.0,
        "x",
    ):
        assert grid(other) != function
    values = np.ones((2, 2))
    kept = grid({"pixel": 1.0, "values": values})
    values[:] = 5.0
    assert at(kept, 0.0, 0.0) == 1.0  # a copy, not the caller's array


@pytest.mark.parametrize(
    ("table", "path", "words"),
    [
        ({"pixel": 1, "values": [[1, 2], [3]]}, ".values[1]", "1 values and the first has 2"),
        ({"pixel": 1, "values": []}, ".values", "at least one row"),
        ({"pixel": 1, "values": [[]]}, ".values", "at least one row"),
        ({"pixel": 1, "values": np.ones((0, 3))}, ".values", "at least one row"),
        ({"pixel": 1, "values": [1, 2]}, ".values", "expected rows of numbers"),
        ({"pixel": 1, "values": "12"}, ".values", "expected rows of numbers"),
        ({"pixel": 1, "values": np.ones(3)}, ".values", "rows and columns"),
        ({"pixel": 1, "values": np.ones((2, 2), dtype=bool)}, ".values", "of bool"),
        ({"pixel": 1, "values": [[1, np.nan]]}, ".values[0][1]", "finite"),
        ({"pixel": 1, "values": np.array([[1, 2], [np.inf, 1]])}, ".values[1][0]", "finite"),
        ({"pixel": 1, "values": [[1, True]]}, ".values[0][1]", "got true"),
        ({"pixel": 1, "values": [[1, 10**400]]}, ".values[0][1]", "finite"),
        ({"pixel": 1, "values": [[1, [2]]]}, ".values[0][1]", "got a list"),
        ({"pixel": 0, "values": [[1]]}, ".pixel", "greater than 0"),
        ({"pixel": -1, "values": [[1]]}, ".pixel", "greater than 0"),
        ({"pixel": "1", "values": [[1]]}, ".pixel", "expected a number"),
        ({"pixel": 1}, "", 'the key "values" is missing'),
        ({"values": [[1]]}, "", 'the key "pixel" is missing'),
        ({"pixle": 1, "values": [[1]]}, ".pixle", 'did you mean "pixel"'),
        ({"pixel": 1, "values": [[1]], "at": [0]}, ".pixel", "no key"),
        ({"pixel": 1, "imag": "x.png", "low": 0, "high": 1}, ".imag", 'did you mean "image"'),
        ({"image": "x.png", "pixel": 1, "low": 0}, "", 'the key "high" is missing'),
        ({"image": "x.png", "pixel": 0, "low": 0, "high": 1}, ".pixel", "greater than 0"),
        ({"image": "x.png", "pixel": 1, "low": "0", "high": 1}, ".low", "expected a number"),
        ({"image": "x.png", "pixel": 1, "low": 0, "high": None}, ".high", "expected a number"),
        ({"image": 3, "pixel": 1, "low": 0, "high": 1}, ".image", "in quotes"),
    ],
)
def test_grids_refused(table: dict[str, Any], path: str, words: str) -> None:
    error = refusal(table)
    assert error.path == f"parameters.stiffness{path}"
    assert words in str(error)


def test_grids_are_for_the_plane() -> None:
    for variables in (("x", "xi"), ("r", "xi"), ("y", "xi")):
        with pytest.raises(ParameterError, match="The form is"):
            PositionFunction({"pixel": 1.0, "values": [[1.0]]}, variables=variables)
        with pytest.raises(ParameterError, match="The form is"):
            PositionFunction(grid({"pixel": 1.0, "values": [[1.0]]}), variables=variables)
        with pytest.raises(ParameterError) as caught:
            PositionFunction(None, variables=variables)
        assert "pixel" not in str(caught.value)
    assert "{ pixel = 0.02, values = [[...], ...] }" in str(refusal(None))


def test_size_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grids, "MOST_PIXELS", 12)
    grid({"pixel": 1, "values": np.ones((3, 4))})
    assert "at most 12 are read; scale it down" in str(refusal({"pixel": 1, "values": np.ones((13, 1))}))
    Image.fromarray(np.zeros((4, 4), dtype=np.uint8)).save(tmp_path / "k.png")
    error = refusal({"image": "k.png", "pixel": 1, "low": 0, "high": 1}, folder=tmp_path)
    assert error.path == "parameters.stiffness.image"
    assert "k.png has 4 rows of 4 pixels, and at most 12 are read; scale it down" in str(error)


def test_black_is_low_and_white_is_high(tmp_path: Path) -> None:
    pixels = np.array([[0, 255, 51], [102, 153, 85]], dtype=np.uint8)  # 0, 1, 0.2 and 0.4, 0.6, 1/3 of white
    shown = [[1.0, 3.0, 1.4], [1.8, 2.2, 1.66667]]  # six digits
    Image.fromarray(pixels).save(tmp_path / "k.png")
    np.save(tmp_path / "k.npy", pixels)
    for name in ("k.png", "k.npy"):
        function = grid({"image": name, "pixel": 0.5, "low": 1.0, "high": 3.0}, folder=tmp_path)
        assert function.to_table() == {"pixel": 0.5, "values": shown}
        assert function == grid({"pixel": 0.5, "values": shown})
        assert at(function, -0.5, 0.25) == 1.0  # the first row is the upper one
    assert grid({"image": str(tmp_path / "k.png"), "pixel": 0.5, "low": 1.0, "high": 3.0}) == function


def test_image_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no image", encoding="utf-8")
    for name, words in (("none.png", "beside the scene file"), ("text.png", "cannot be read as an image")):
        error = refusal({"image": name, "pixel": 1, "low": 0, "high": 1}, folder=tmp_path)
        assert error.path == "parameters.stiffness.image"
        assert words in str(error)


def test_a_large_grid_goes_through_a_result_file(tmp_path: Path) -> None:
    """A text of more than 64 kB, the most that an HDF5 attribute itself can hold, and of more than 1 MB."""
    text = "x" * 60_000 + "é" + "1.25, " * 250_000
    storage.write(Result(model="tumour", t=np.zeros(1), scene=text, scene_source=text), tmp_path / "r.h5")
    stored = storage.read(tmp_path / "r.h5")
    assert stored.scene == stored.scene_source == text
