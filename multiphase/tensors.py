"""Symmetric tensors as functions of position in two dimensions: permeabilities, diffusivities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multiphase.errors import ParameterError
from multiphase.functions import PositionFunction, place
from multiphase.parameters import TENSOR_FORMS, check_keys, describe, is_number, position_forms

Array = NDArray[np.float64]

COMPONENTS = ("xx", "yy", "xy")
PRINCIPAL = ("along", "across")


class TensorFunction:
    """A symmetric positive definite 2 x 2 tensor as a function of position in the body at rest.

    Parameters
    ----------
    value : float, str, mapping, callable, PositionFunction or TensorFunction
        Anything that `PositionFunction` takes stands for that multiple of the identity. ``{"xx": f, "yy": f, "xy": f}`` gives the
        components in the plane's coordinates, where xy may be left out and is then 0. ``{"along": f, "across": f}`` gives the principal
        values along and across a direction that belongs to the body, that of its fibres. Each f is written as any function of position.
    variables : sequence of str, default ("r", "xi", "x", "y", "theta")
        Names that formulas may use, the coordinate of tables first.
    path : str
        Dotted path of the value, for messages.
    folder : Path, optional
        Where relative file names are looked for; the current folder if not given.
    length : float, optional
        Extent of the body along its coordinate, on which callables are sampled: see `PositionFunction`.

    Raises
    ------
    ParameterError
        Where it can be seen before any position is known: a value that cannot be read, and listed values and constants that leave the
        tensor not positive definite.

    Two tensors are equal when they are written the same way.
    """

    __slots__ = ("_parts", "path", "variables")

    def __init__(
        self,
        value: Any,
        *,
        variables: Sequence[str] = ("r", "xi", "x", "y", "theta"),
        path: str = "",
        folder: Path | None = None,
        length: float | None = None,
    ) -> None:
        self.variables = tuple(variables)
        self.path = path
        parts: Mapping[str, Any]
        if isinstance(value, TensorFunction):
            parts = value._parts
        elif isinstance(value, Mapping) and not set(value).isdisjoint((*COMPONENTS, *PRINCIPAL)):
            is_principal = not set(value).isdisjoint(PRINCIPAL)
            parts = {} if is_principal else {"xy": 0.0}
            parts = {**parts, **value}
            check_keys(parts, PRINCIPAL if is_principal else COMPONENTS, path)
        elif isinstance(value, str | Mapping | PositionFunction) or callable(value) or is_number(value):
            parts = {"": value}
        else:
            raise ParameterError(path, f"expected {position_forms(variables)}{TENSOR_FORMS}, but got {describe(value)}.")
        self._parts: dict[str, PositionFunction] = {
            name: PositionFunction(parts[name], variables=variables, path=f"{path}.{name}" if name else path, folder=folder, length=length)
            for name in ("", *COMPONENTS, *PRINCIPAL)
            if name in parts
        }
        self._check_listed()

    def __call__(self, angle: ArrayLike, **coordinates: ArrayLike) -> Array:
        """Components at `coordinates` (arrays named after `variables`, broadcast together).

        Parameters
        ----------
        angle : array_like
            Angle of the fibres from the x axis, in radians, at the same places. Only the form along and across uses it.
        **coordinates : array_like

        Returns
        -------
        components : ndarray, (..., 3)
            xx, yy and xy.

        Raises
        ------
        ParameterError
            Where the tensor is not positive definite, or a formula not finite.
        """
        values = {name: part(**coordinates) for name, part in self._parts.items()}
        if "" in values:
            xx = yy = values[""]
            xy = np.zeros_like(xx)
            is_positive = xx > 0.0
        elif "along" in values:
            along, across = values["along"], values["across"]
            c, s = np.cos(angle), np.sin(angle)
            xx, yy, xy = along * c * c + across * s * s, along * s * s + across * c * c, (along - across) * c * s
            is_positive = (along > 0.0) & (across > 0.0)  # and not by the determinant, which rounding may turn for a very thin tensor
        else:
            xx, yy, xy = (values[name] for name in COMPONENTS)
            with np.errstate(over="ignore", invalid="ignore"):
                is_positive = (xx > 0.0) & (yy > 0.0) & (xx * yy > xy * xy)
        if not np.all(is_positive):
            self._refuse(values, int(np.argmin(is_positive)), coordinates)
        return np.stack(np.broadcast_arrays(xx, yy, xy), axis=-1)

    def _refuse(self, values: Mapping[str, Array], i: int, coordinates: Mapping[str, ArrayLike]) -> None:
        given = ", ".join(f"{name} = {array.flat[i]:.6g}".removeprefix(" = ") for name, array in values.items())
        where = f" at {place(coordinates, i)}" if coordinates else ""
        raise ParameterError(self.path, f"{given}{where} is not positive definite; {_NEEDED['xx' if 'xx' in values else '']}.")

    def _check_listed(self) -> None:
        """Refuse what is not positive definite wherever it is used."""
        for name, part in self._parts.items():
            if name != "xy" and part.listed.size and part.listed.min() <= 0.0:
                raise ParameterError(
                    part.path, f"{part.listed.min():.15g} is not allowed; it must be greater than 0 for the tensor to be positive definite."
                )
        if all(part.constant is not None for part in self._parts.values()):
            values = {name: np.array(part.constant) for name, part in self._parts.items()}
            if "xx" in values and not values["xx"] * values["yy"] > values["xy"] ** 2:
                self._refuse(values, 0, {})

    @property
    def is_isotropic(self) -> bool:
        """Whether the tensor is given by one function, as a multiple of the identity."""
        return "" in self._parts

    @property
    def follows_fibres(self) -> bool:
        """Whether the tensor is given along and across the fibres."""
        return "along" in self._parts

    @property
    def constant(self) -> float | None:
        """The number, where the tensor is given as one; otherwise None."""
        return self._parts[""].constant if "" in self._parts else None

    @property
    def parts(self) -> tuple[PositionFunction, ...]:
        """The functions that the tensor is given by."""
        return tuple(self._parts.values())

    @property
    def names(self) -> set[str]:
        """The coordinates that formulas and grids use."""
        return set(chain.from_iterable(part.names for part in self.parts))

    @property
    def listed(self) -> Array:
        """Every value given outright that must be greater than 0, all but those of xy: see `PositionFunction.listed`."""
        return np.concatenate([part.listed for name, part in self._parts.items() if name != "xy"])

    @property
    def is_sampled(self) -> bool:
        """Whether a part of it was a Python function."""
        return any(part.is_sampled for part in self.parts)

    def with_length(self, length: float) -> TensorFunction:
        """The same tensor on a body of another extent: callables are sampled again, the rest is as it was."""
        return TensorFunction(self, variables=self.variables, path=self.path, length=length) if self.is_sampled else self

    def to_table(self) -> Any:
        """The tensor as it stands in a scene file."""
        if "" in self._parts:
            return self._parts[""].to_table()
        return {name: part.to_table() for name, part in self._parts.items()}

    def __eq__(self, other: object) -> bool:
        if isinstance(other, TensorFunction):
            return self._parts == other._parts
        return self.constant is not None and self.constant == other

    def __hash__(self) -> int:
        return hash(self.constant if self.constant is not None else tuple(self._parts.items()))

    def __repr__(self) -> str:
        if "" in self._parts:
            return repr(self._parts[""])
        return "{" + ", ".join(f"{name} = {part!r}" for name, part in self._parts.items()) + "}"

    def __reduce__(self) -> tuple[Callable[[Any, Any, str], TensorFunction], tuple[Any, Any, str]]:
        return _restore, (self.to_table(), self.variables, self.path)


_NEEDED = {
    "": "it must be greater than 0 everywhere",
    "xx": "xx, yy and xx yy - xy^2 must be greater than 0 everywhere",
}
"""What a tensor must be, by its form."""


def _restore(value: Any, variables: Sequence[str], path: str) -> TensorFunction:
    return TensorFunction(value, variables=variables, path=path)
