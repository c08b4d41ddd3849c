"""Formulas in named variables, parsed into a tree of allowed parts and evaluated from it; they are never run as Python code."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multiphase.errors import ParameterError
from multiphase.parameters import float_or_refuse, nearest

Array = NDArray[np.float64]

LONGEST_EXPRESSION = 1000
DEEPEST_NESTING = 100
CONSTANTS: Mapping[str, float] = {"pi": float(np.pi), "e": float(np.e)}
FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int]] = {  # name: (function, number of arguments)
    "sin": (np.sin, 1), "cos": (np.cos, 1), "tan": (np.tan, 1), "asin": (np.arcsin, 1), "acos": (np.arccos, 1), "atan": (np.arctan, 1),
    "atan2": (np.arctan2, 2), "sinh": (np.sinh, 1), "cosh": (np.cosh, 1), "tanh": (np.tanh, 1), "exp": (np.exp, 1), "log": (np.log, 1),
    "log10": (np.log10, 1), "sqrt": (np.sqrt, 1), "abs": (np.abs, 1), "sign": (np.sign, 1), "min": (np.minimum, 2), "max": (np.maximum, 2),
    "where": (np.where, 3),
}  # fmt: skip
_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.UAdd: np.positive, ast.USub: np.negative,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip


class Expression:
    """A formula in named variables, checked when it is made and evaluated without running any code of the user's.

    Parameters
    ----------
    text : str
        For instance ``"0.1 + 0.05*cos(pi*xi)**2"``. Allowed: numbers, the variables, ``pi``, ``e``, ``+ - * / **``, brackets,
        the functions in `FUNCTIONS`, and comparisons with ``<``, ``<=``, ``>``, ``>=`` inside ``where(condition, a, b)``.
    variables : sequence of str
    path : str
        Dotted path of the value, for messages.
    """

    def __init__(self, text: str, variables: Sequence[str], path: str = "") -> None:
        self.text = text
        self.variables = tuple(variables)
        self.path = path
        if len(text) > LONGEST_EXPRESSION:
            raise ParameterError(
                path,
                f"the expression is {len(text)} characters long and at most {LONGEST_EXPRESSION} are read; "
                "give the values as { at = [...], values = [...] } instead.",
            )
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
            self._check(self._tree)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, ParameterError):
                raise
            raise self._refusal("cannot be read as a formula") from None

    def __call__(self, coordinates: Mapping[str, ArrayLike]) -> Array:
        with np.errstate(all="ignore"):  # a division by zero is reported by the caller with its position, as a value that is not finite
            return np.asarray(self._evaluate(self._tree, coordinates), dtype=float)

    @property
    def names(self) -> set[str]:
        """The variables that the formula uses."""
        return {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name) and node.id in self.variables}

    def _refusal(self, why: str) -> ParameterError:
        stop = "" if why.endswith(("?", ".")) else "."
        allowed = f"{', '.join((*self.variables, *CONSTANTS))}, numbers, + - * / ** < <= > >=, brackets and {', '.join(FUNCTIONS)}"
        example = f'"0.9 - 0.1*exp(-5*{self.variables[-1]})"'
        return ParameterError(self.path, f'"{self.text}" {why}{stop} A formula may use {allowed}; for instance {example}.')

    def _check(self, node: ast.AST, depth: int = 0) -> None:
        """Refuse every part of the formula that is not on the lists above."""
        if depth > DEEPEST_NESTING:
            raise self._refusal(f"is nested more than {DEEPEST_NESTING} deep")
        children: list[ast.AST] = []
        match node:
            case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
                float_or_refuse(value, self.path)
            case ast.Name(id=name):
                self._check_name(name)
            case ast.BinOp(op=ast.BitXor()):
                raise self._refusal(f"uses ^, which is not a power here; write {self.variables[0]}**2")
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                children = [left, right]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                children = [operand]
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
                children = [left, right]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(name, len(arguments))
                children = list(arguments)
            case _:
                raise self._refusal("contains a part that is not allowed in a formula")
        for child in children:
            self._check(child, depth + 1)

    def _check_name(self, name: str) -> None:
        if name not in self.variables and name not in CONSTANTS:
            raise self._refusal(f"uses {name}, which is not known here{nearest(name, (*self.variables, *CONSTANTS))}")

    def _check_call(self, name: str, count: int) -> None:
        if name not in FUNCTIONS:
            raise self._refusal(f"uses a function {name}, which is not known here{nearest(name, FUNCTIONS)}")
        wanted = FUNCTIONS[name][1]
        if count != wanted:
            raise self._refusal(f"gives {name} {count} argument{'s' * (count != 1)} where it takes {wanted}")

    def _evaluate(self, node: ast.AST, coordinates: Mapping[str, ArrayLike]) -> Any:
        match node:
            case ast.Constant(value=int() | float() as value):
                return np.float64(value)  # never a Python integer: 9**9**9 must overflow at once, not compute for hours
            case ast.Name(id=name):
                return np.asarray(coordinates[name], dtype=float) if name in self.variables else np.float64(CONSTANTS[name])
            case ast.BinOp(left=left, op=op, right=right):
                return _OPERATORS[type(op)](self._evaluate(left, coordinates), self._evaluate(right, coordinates))
            case ast.UnaryOp(op=op, operand=operand):
                return _OPERATORS[type(op)](self._evaluate(operand, coordinates))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                truth = _OPERATORS[type(op)](self._evaluate(left, coordinates), self._evaluate(right, coordinates))
                return np.asarray(truth, dtype=float)  # 1 or 0, so that arithmetic goes on with numbers
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return FUNCTIONS[name][0](*(self._evaluate(argument, coordinates) for argument in arguments))
        raise AssertionError("a part of the formula was not checked")
