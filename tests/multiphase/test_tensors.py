"""Symmetric tensors as functions of position: forms, values, what is not positive definite, stored forms."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from PIL import Image

from multiphase.errors import ParameterError
from multiphase.parameters import from_table, parameter, replace, to_table, validate
from multiphase.tensors import TensorFunction

PATH = "parameters.permeability"
X = np.array([-0.5, 0.0, 0.25, 1.0])
Y = np.array([0.5, 0.25, -1.0, 0.0])
ANGLE = np.array([0.3, -1.2, 2.5, 7.0])


def tensor(value: Any, **options: Any) -> TensorFunction:
    return TensorFunction(value, path=PATH, **options)


def at(function: TensorFunction, angle: Any = 0.0, x: Any = X, y: Any = Y) -> np.ndarray:
    x, y = np.asarray(x), np.asarray(y)
    r = np.hypot(x, y)
    return function(angle, r=r, xi=r / 2.0, x=x, y=y, theta=np.arctan2(y, x))


def refusal(value: Any, **options: Any) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        tensor(value, **options)
    return caught.value


def refused_at(value: Any, angle: Any = 0.0, **places: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        at(tensor(value), angle, **places)
    assert caught.value.path == PATH
    return str(caught.value)


@pytest.mark.parametrize("value", [2.0, "2 + x", {"at": [0, 1], "values": [1, 3]}, {"pixel": 1.0, "values": [[1, 2], [3, 4]]}])
def test_isotropic_forms_are_multiples_of_the_identity(value: Any) -> None:
    function = tensor(value)
    found = at(function, ANGLE)
    (part,) = function.parts
    assert found.shape == (4, 3)
    assert np.array_equal(found[:, 0], part(r=np.hypot(X, Y), xi=X, x=X, y=Y, theta=X))
    assert np.array_equal(found[:, 0], found[:, 1])
    assert not found[:, 2].any()
    assert function.is_isotropic
    assert not function.follows_fibres
    assert function.constant == (2.0 if value == 2.0 else None)
    assert function.to_table() == value


def test_components() -> None:
    found = at(tensor({"xx": "2 + x", "yy": 3, "xy": "y"}), ANGLE)
    assert np.array_equal(found, np.stack([2 + X, np.full(4, 3.0), Y], axis=-1))
    assert np.array_equal(at(tensor({"yy": 3, "xx": 2})), np.tile([2.0, 3.0, 0.0], (4, 1)))


def test_principal_values_along_and_across_the_fibres() -> None:
    function = tensor({"across": "1 + y**2", "along": 4})
    assert function.follows_fibres
    assert not function.is_isotropic
    for i, (xx, yy, xy) in enumerate(at(function, ANGLE)):
        full = np.array([[xx, xy], [xy, yy]])
        a = np.array([np.cos(ANGLE[i]), np.sin(ANGLE[i])])
        b = np.array([-a[1], a[0]])
        # each a few roundings of numbers up to 4
        np.testing.assert_allclose(full @ a, 4.0 * a, rtol=0, atol=4e-15)
        np.testing.assert_allclose(full @ b, (1 + Y[i] ** 2) * b, rtol=0, atol=4e-15)
    np.testing.assert_allclose(at(function, ANGLE), at(function, ANGLE + np.pi), rtol=0, atol=1e-14)  # the sense does not matter
    assert np.array_equal(at(function, 0.0)[0], [4.0, 1.25, 0.0])  # exact along the axis
    assert function(ANGLE.reshape(2, 2), x=0.0, y=1.0).shape == (2, 2, 3)


def test_a_very_thin_tensor_is_not_refused_for_rounding() -> None:
    found = at(tensor({"along": 1.0, "across": 1e-20}), ANGLE)
    assert np.all(np.isfinite(found))


def test_not_positive_definite_somewhere() -> None:
    text = refused_at("x + 0.5", x=[1.0, -0.75], y=[0.0, 0.25])
    assert "-0.25 at r = 0.790569, xi = 0.395285, x = -0.75, y = 0.25, theta" in text
    assert "greater than 0 everywhere" in text
    text = refused_at({"xx": 1, "yy": "x", "xy": 0.5}, x=[1.0, 0.2], y=[0.0, 0.0])
    assert "xx = 1, yy = 0.2, xy = 0.5 at r = 0.2" in text
    assert "xx yy - xy^2 must be greater than 0" in text
    assert "xx = -1, yy = -4" in refused_at({"xx": "x", "yy": "4*x"}, x=[-1.0], y=[0.0])  # a positive determinant alone will not do
    assert "xy = 1 " in refused_at({"xx": 1, "yy": 1, "xy": "y"}, x=[0.0], y=[1.0])  # singular
    assert "along = 1, across = 0 at" in refused_at({"along": 1, "across": "x"}, [0.7], x=[0.0], y=[0.0])
    assert refused_at("1e200*x", x=[-1.0], y=[0.0])
    assert refused_at({"xx": "1e200*x", "yy": "1e200*x", "xy": "1e200*x"}, x=[1.0], y=[0.0])  # squares overflow
    with pytest.raises(ParameterError, match=r"gives inf at .*it must be finite") as caught:
        at(tensor({"along": 1, "across": "1/x"}), x=[0.0], y=[0.0])
    assert caught.value.path == f"{PATH}.across"


@pytest.mark.parametrize(
    ("value", "path", "words"),
    [
        (0, "", "0 is not allowed; it must be greater than 0"),
        (-1, "", "greater than 0"),
        ({"along": 1, "across": 0}, ".across", "greater than 0"),
        ({"along": {"at": [0, 1], "values": [1, -2]}, "across": 1}, ".along", "-2 is not allowed"),
        ({"pixel": 1, "values": [[1, 0]]}, "", "0 is not allowed"),
        ({"xx": 1, "yy": -1}, ".yy", "greater than 0"),
        ({"xx": 1, "yy": 1, "xy": 1}, "", "xx = 1, yy = 1, xy = 1 is not positive definite"),
        ({"xx": 1, "yy": 1, "xy": -2}, "", "not positive definite"),
        ({"xx": 1}, "", 'the key "yy" is missing'),
        ({"along": 1}, "", 'the key "across" is missing'),
        ({"along": 1, "acros": 1}, ".acros", 'did you mean "across"'),
        ({"along": 1, "across": 1, "xx": 1}, ".xx", 'no key "xx"'),
        ({"xx": 1, "yy": 1, "yx": 0}, ".yx", 'no key "yx"'),
        ({"xx": "a", "yy": 1}, ".xx", "uses a, which is not known"),
        ({"xx": [1], "yy": 1}, ".xx", "expected a number"),
        ([[1, 0], [0, 1]], "", "along = ..., across"),
        (None, "", "along = ..., across"),
        (True, "", "got true"),
        (np.eye(2), "", "array of shape"),
        (np.inf, "", "finite"),
        ({}, "", "missing"),
    ],
)
def test_refused_at_once(value: Any, path: str, words: str) -> None:
    error = refusal(value)
    assert error.path == PATH + path
    assert words in str(error)


FORMS = [
    1.0, "1 + x**2", {"at": [0.0, 1.0], "values": [1.0, 2.0]}, {"pixel": 1.0, "values": [[1.0, 2.0]]},
    {"xx": 1.0, "yy": "2 + x", "xy": 0.0}, {"along": {"pixel": 1.0, "values": [[1.0, 2.0]]}, "across": "1 + r"},
]  # fmt: skip


def test_equality_hash_copies_and_pickling() -> None:
    for i, value in enumerate(FORMS):
        function = tensor(value)
        for same in (tensor(value), tensor(function), tensor(function.to_table()), pickle.loads(pickle.dumps(function))):
            assert same == function
            assert hash(same) == hash(function)
            assert same.to_table() == value
            assert same.path == PATH
        assert [j for j, other in enumerate(FORMS) if tensor(other) == function] == [i]
        assert repr(function)
    assert tensor(1) == 1.0 == tensor(1.0)
    assert hash(tensor(1)) == hash(1.0)
    assert tensor({"along": 1, "across": 1}) != 1.0
    assert tensor({"xx": 1, "yy": 2}) == tensor({"yy": 2, "xx": 1, "xy": 0})
    assert repr(tensor({"along": 2, "across": "x"})) == "{along = 2.0, across = 'x'}"


def test_names_and_listed_values() -> None:
    assert tensor({"along": "1 + r", "across": "exp(x)"}).names == {"r", "x"}
    assert tensor({"pixel": 1.0, "values": [[1.0]]}).names == {"x", "y"}
    assert tensor(2.0).names == set()
    assert tensor({"along": 1, "across": {"at": [0, 1], "values": [2, 3]}}).listed.tolist() == [1.0, 2.0, 3.0]
    assert tensor({"xx": 1, "yy": 2, "xy": -0.5}).listed.tolist() == [1.0, 2.0]  # xy may be negative
    assert tensor("x").listed.size == 0


def test_python_functions_are_sampled_along_the_radius() -> None:
    function = tensor({"along": lambda r: 1.0 + r, "across": lambda xi: 2.0 - xi}, length=2.0)
    assert function.is_sampled
    assert at(function, 0.0, x=[2.0], y=[0.0]).tolist() == [[3.0, 1.0, 0.0]]
    assert tensor(function) == function  # a copy keeps its samples
    assert at(function.with_length(1.0), 0.0, x=[1.0], y=[0.0]).tolist() == [[2.0, 1.0, 0.0]]
    assert not tensor(1.0).is_sampled
    assert tensor(1.0).with_length(3.0) == 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Tissue:
    K: Any = parameter(  # noqa: RUF009
        1.0, symbol="K", kind="tensor", variables=("r", "xi", "x", "y", "theta"), low=0.1, high=5.0, doc="the permeability"
    )

    table: ClassVar[str] = "tissue"

    def __post_init__(self) -> None:
        validate(self, self.table)


def test_a_parameter_of_kind_tensor(tmp_path: Path) -> None:
    assert isinstance(Tissue().K, TensorFunction)
    assert Tissue(K=1).K == 1.0
    assert to_table(Tissue()) == {"K": 1.0}
    for value in FORMS:
        tissue = Tissue(K=value)
        assert to_table(tissue) == {"K": value}
        assert from_table(Tissue, to_table(tissue), "tissue") == tissue == replace(tissue, K=tissue.K)
    for value in (0.05, 6.0, {"at": [0, 1], "values": [1, 6]}, {"along": 1, "across": 0.01}, {"xx": 6, "yy": 1}):
        with pytest.raises(ParameterError, match=r"is not allowed; the permeability must be a number from 0\.1 to 5") as caught:
            Tissue(K=value)
        assert caught.value.path == "tissue.K"
    with pytest.raises(ParameterError, match="along"):
        Tissue(K=None)
    Image.fromarray(np.array([[0, 255]], dtype=np.uint8)).save(tmp_path / "k.png")
    table = {"K": {"along": {"image": "k.png", "pixel": 1.0, "low": 1, "high": 2}, "across": 1}}
    expected = {"K": {"along": {"pixel": 1.0, "values": [[1.0, 2.0]]}, "across": 1.0}}
    assert to_table(from_table(Tissue, table, "tissue", folder=tmp_path)) == expected
    with pytest.raises(ParameterError, match="there is no file") as caught:
        from_table(Tissue, table, "tissue", folder=tmp_path / "elsewhere")
    assert caught.value.path == "tissue.K.along.image"
