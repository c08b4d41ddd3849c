"""The two exceptions a user meets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class ParameterError(ValueError):
    """A value in a scene or a call that cannot be used.

    The message is one paragraph: the dotted path (`parameters.k_m`), the value, the allowed range
    or the nearest valid name, and what to do. `path` holds the dotted path.
    """

    def __init__(self, path: str, message: str) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.path = path


class SolverError(RuntimeError):
    """A run that could not go on.

    Attributes
    ----------
    time, dt : float
        Time of the last good step and the step that was tried from there (dimensionless).
    history : list of str
        Why each of the last attempts was rejected, oldest first.
    result : multiphase.Result or None
        Everything up to the last good step.
    """

    def __init__(
        self,
        message: str,
        *,
        time: float = float("nan"),
        dt: float = float("nan"),
        history: Sequence[str] = (),
        result: Any = None,
    ) -> None:
        super().__init__(message)
        self.time = time
        self.dt = dt
        self.history = list(history)
        self.result = result
