"""Formulas: what may be written, what it gives, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from multiphase.errors import ParameterError
from multiphase.formulas import Expression

XI = np.linspace(0.0, 1.0, 11)
X = 2.0 * XI


def evaluate(text: str) -> np.ndarray:
    return np.broadcast_to(Expression(text, ("x", "xi"), "initial.n")({"x": X, "xi": XI}), X.shape)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.3", np.full(11, 0.3)),
        ("x", X),
        ("2*x - 3*xi + 1", X / 2 + 1),
        ("-x**2", -(X**2)),
        ("2**-1 + 0*x", np.full(11, 0.5)),
        ("1 - x/4/2", 1 - X / 8),
        ("0.1 + 0.05*cos(pi*xi)**2", 0.1 + 0.05 * np.cos(np.pi * XI) ** 2),
        ("exp(-x) + log(e) + sqrt(abs(-4))", np.exp(-X) + 3),
        ("min(x, 1) + max(xi, 0.5)", np.minimum(X, 1) + np.maximum(XI, 0.5)),
        ("where(x < 1, 0.9, 0.1)", np.where(X < 1, 0.9, 0.1)),
        ("-(x <= 1) + (xi > 0.5) + (xi >= 0.5)", -1.0 * (X <= 1) + (XI > 0.5) + (XI >= 0.5)),
        ("where(x > 0, log(x + (x <= 0)), 0)", np.where(X > 0, np.log(np.where(X > 0, X, 1.0)), 0.0)),
        ("tanh(x) + atan2(x, 1) + sign(x)", np.tanh(X) + np.arctan(X) + np.sign(X)),
    ],
)
def test_formulas(text: str, expected: np.ndarray) -> None:
    # one rounding per operation may differ from the way NumPy writes it
    np.testing.assert_allclose(evaluate(text), expected, rtol=4e-16, atol=4e-16)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "x.real", "x[0]", "[x]", "(x, 1)", "lambda: 1", "x if x else 1", "'a'", "True", "1j", "x := 2",
        "f'{x}'", "sin", "sin(x=1)", "sin(*x)", "sin(x, 1)", "where(x)", "x and 1", "not x", "~x", "x % 2", "x // 2", "x @ x", "0 < x < 1",
        "x == 1", "y", "X", "sinus(x)", "x^2", "2x", "sin(x", "", "   ", "x; x", "x = 1", "import os", "x\0", "1e999", "9" * 400,
        "x" + "+x" * 600, "(" * 300 + "x" + ")" * 300, "-" * 500 + "x", "().__class__", "exec('1')", "open('f')", "print(x)",
    ],
)  # fmt: skip
def test_formulas_refused(text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        evaluate(text)
    assert caught.value.path == "initial.n"
    assert len(str(caught.value)) > 30


def test_formula_messages_help() -> None:
    for text, words in [
        ("sinn(x)", 'did you mean "sin"?'),
        ("xii", 'did you mean "xi"?'),
        ("x^2", "write x**2"),
        ("sin(x, 1)", "gives sin 2 arguments where it takes 1"),
    ]:
        with pytest.raises(ParameterError) as caught:
            evaluate(text)
        assert words in str(caught.value)


def test_huge_powers_end_at_once() -> None:
    assert np.all(np.isinf(evaluate("9**9**9**9")))


def test_names_are_the_variables_in_use() -> None:
    assert Expression("2*x + pi", ("x", "xi")).names == {"x"}
    assert Expression("where(x < xi, e, 1)", ("x", "xi")).names == {"x", "xi"}
