"""Functions of position: numbers, tables, files, formulas, callables."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.functions import SAMPLES, PositionFunction

XI = np.linspace(0.0, 1.0, 11)
X = 2.0 * XI


def evaluate(value: Any, **options: Any) -> np.ndarray:
    return PositionFunction(value, path="initial.n", **options)(x=X, xi=XI)


@pytest.mark.parametrize("text", ["1/x", "log(x)", "x/x", "sqrt(0 - xi - 1)", "(0-1)**0.5"])
def test_formulas_that_are_not_finite_say_where(text: str) -> None:
    with pytest.raises(ParameterError, match=r"at x = 0, xi = 0; it must be finite everywhere"):
        evaluate(text)


def test_formulas_that_overflow_say_where() -> None:
    with pytest.raises(ParameterError, match=r"gives inf at x = 0, xi = 0; it must be finite"):
        evaluate("9**9**9**9")


def test_other_variables() -> None:
    function = PositionFunction("r*cos(theta)", variables=("r", "theta"))
    assert function(r=np.array([2.0]), theta=np.array([0.0]))[0] == 2.0
    with pytest.raises(ParameterError, match=r"may use x, xi, pi, e"):
        evaluate("r")


def test_numbers_and_shapes() -> None:
    assert np.array_equal(evaluate(1), np.ones(11))
    assert PositionFunction(0.5)(x=X.reshape(1, 11), xi=XI.reshape(1, 11)).shape == (1, 11)
    assert PositionFunction("1")(x=X, xi=XI).shape == (11,)
    evaluate("1")[0] = 2.0  # a fresh, writable array
    for bad in (True, None, np.nan, np.inf, [1.0], 1j, b"x"):
        with pytest.raises(ParameterError):
            evaluate(bad)


def test_tables_are_linear_between_and_constant_beyond() -> None:
    values = evaluate({"at": [0.5, 1.5], "values": [1, 3]})
    np.testing.assert_allclose(values, np.clip(2 * X, 1, 3), rtol=4e-16)  # one rounding per operation
    assert np.array_equal(evaluate({"at": np.array([0.0]), "values": (4.0,)}), np.full(11, 4.0))


@pytest.mark.parametrize(
    ("table", "path"),
    [
        ({"at": [0, 1], "values": [1]}, "initial.n"),
        ({"at": [], "values": []}, "initial.n"),
        ({"at": [0, 0], "values": [1, 2]}, "initial.n.at"),
        ({"at": [1, 0], "values": [1, 2]}, "initial.n.at"),
        ({"at": [0, np.nan], "values": [1, 2]}, "initial.n.at[1]"),
        ({"at": [0, 1], "values": [1, True]}, "initial.n.values[1]"),
        ({"at": [0, 1], "values": "12"}, "initial.n.values"),
        ({"at": [0, 1]}, "initial.n"),
        ({"at": [0], "value": [1]}, "initial.n.value"),
        ({}, "initial.n"),
        ({"file": 3}, "initial.n.file"),
        ({"file": "x.csv", "at": [0]}, "initial.n.at"),
    ],
)
def test_tables_refused(table: dict[str, Any], path: str) -> None:
    with pytest.raises(ParameterError) as caught:
        evaluate(table)
    assert caught.value.path == path


@pytest.mark.parametrize(
    "text", ["0,1\n2,3\n", "\ufeffx,n\n0,1\n2,3", "# note\nposition;value\n0;1\n\n2;3 # end\n", "0 1\n2\t3", "x, n\r\n0.0, 1\r\n2e0, 3\r\n"]
)
def test_files(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    function = PositionFunction({"file": "x.csv"}, folder=tmp_path)
    assert function.to_table() == {"at": [0.0, 2.0], "values": [1.0, 3.0]}  # self-contained: the data, not the name


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "0 positions"),
        (b"0,1,2\n", "line 1"),
        (b"x,n\n0,1\na,b\n", "line 3"),
        (b"0,1\nx,n\n", "line 2"),
        (b"nan,1\n", "line 1"),
        (b"0,inf\n", "line 1"),
        (b"0\n", "line 1"),
        (b"0,1\n0,2\n", "must increase"),
        (b"\xff\xfe\x00", "UTF-8"),
    ],
)
def test_files_refused(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "x.csv").write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        evaluate({"file": str(tmp_path / "x.csv")})
    assert words in str(caught.value)
    with pytest.raises(ParameterError, match=r"none\.csv cannot be read: No such file"):
        evaluate({"file": "none.csv"}, folder=tmp_path)


def test_callables_become_samples() -> None:
    for function in (lambda x: x**2, lambda s: s**2, np.square, lambda x, p=2: x**p, lambda *, x, xi: x * (x + 0 * xi)):
        sampled = PositionFunction(function, length=2.0)
        # linear interpolation on h = 2/2000 errs by at most h²/8 times the second derivative, 2
        np.testing.assert_allclose(sampled(x=X, xi=XI), X**2, atol=2 * (2 / (SAMPLES - 1)) ** 2 / 8 + 1e-15)
        assert sampled == PositionFunction(sampled.to_table())
        assert np.array_equal(PositionFunction(sampled.to_table())(x=X, xi=XI), sampled(x=X, xi=XI))
        assert sampled.with_length(4.0)(x=np.array([4.0]), xi=np.array([1.0]))[0] == 16.0
        assert pickle.loads(pickle.dumps(sampled)) == sampled
    relative = PositionFunction(lambda xi: xi, length=2.0)
    assert [f(x=np.array([2.0]), xi=np.array([1.0]))[0] for f in (relative, relative.with_length(4.0))] == [1.0, 0.5]


def test_callables_refused() -> None:
    with pytest.raises(ParameterError, match="array of shape"):
        PositionFunction(lambda x: x[:3])
    with pytest.raises(ParameterError, match=r"gives inf at x = 0"), np.errstate(divide="ignore"):
        PositionFunction(lambda x: 1 / x)
    with pytest.raises(ParameterError, match=r"as it is sampled along .; give a formula"):
        PositionFunction(lambda x, y: x, variables=("x", "y"))
    assert PositionFunction(lambda x: 1.0)(x=X, xi=XI).shape == (11,)


def test_a_model_may_name_its_coordinate() -> None:
    for value in ("r**2", lambda r: r**2, lambda s: s**2, lambda xi: 4 * xi**2, lambda r, xi: 2 * r * xi, lambda *, r: r**2):
        function = PositionFunction(value, variables=("r", "xi"), length=2.0)
        # linear interpolation on h = 2/2000 errs by at most h²/8 times the second derivative, 2
        np.testing.assert_allclose(function(r=X, xi=XI), X**2, atol=2 * (2 / (SAMPLES - 1)) ** 2 / 8 + 1e-15)
        assert function.with_length(2.0) == function
    with pytest.raises(ParameterError, match=r"gives inf at r = 0"), np.errstate(divide="ignore"):
        PositionFunction(lambda r: 1 / r, variables=("r", "xi"))
    with pytest.raises(ParameterError, match=r"write r\*\*2\. A formula may use r, xi, pi"):
        PositionFunction("r^2", variables=("r", "xi"))
    with pytest.raises(ParameterError, match=r"as it is sampled along .; give a formula"):
        PositionFunction(lambda r, theta: r, variables=("r", "theta"))


def test_equality_hash_and_number() -> None:
    assert PositionFunction(1) == PositionFunction(1.0) == 1.0
    assert PositionFunction("x") == PositionFunction("x") != PositionFunction("xi")
    assert PositionFunction("x") != "x"
    assert hash(PositionFunction(1)) == hash(1.0)
    assert {PositionFunction("x")} == {PositionFunction("x")}
    assert float(PositionFunction(2)) == PositionFunction(2).constant == 2.0
    with pytest.raises(TypeError, match="varies in space"):
        float(PositionFunction("x"))
    assert "xi" in repr(PositionFunction("xi"))


def test_a_copy_keeps_its_samples_unless_another_length_is_given() -> None:
    sampled = PositionFunction(lambda x: x**2, length=2.0)
    for copy in (PositionFunction(sampled), PositionFunction(sampled, path="initial.n")):
        assert copy == sampled
        assert copy.is_sampled
        assert copy(x=np.array([2.0]), xi=np.array([1.0]))[0] == 4.0
    assert PositionFunction(sampled, length=1.0)(x=np.array([1.0]), xi=np.array([1.0]))[0] == 1.0
    assert PositionFunction(sampled, length=1.0) != sampled
    for value in (0.5, "x", {"at": [0.0, 1.0], "values": [1.0, 2.0]}):
        function = PositionFunction(value, path="a")
        assert PositionFunction(function, path="b") == function
        assert PositionFunction(function, path="b").path == "b"
    with pytest.raises(ParameterError, match="uses x, which is not known"):
        PositionFunction(PositionFunction("x"), variables=("r", "xi"))


def test_signs_of_zero_are_equal_and_hash_alike() -> None:
    one, other = (PositionFunction({"at": [0.0], "values": [zero]}) for zero in (0.0, -0.0))
    assert one == other
    assert hash(one) == hash(other)
