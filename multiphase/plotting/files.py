"""Pictures and films as files, replaced only once they are whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from multiphase.errors import ParameterError
from multiphase.plotting.style import STYLE


def checked_path(path: str | os.PathLike[str], allowed: tuple[str, ...], what: str) -> Path:
    target = Path(path)
    if target.suffix.lower() not in allowed:
        raise ParameterError(
            "", f"cannot write {what} to {str(target)!r}: its name must end in {', '.join(allowed[:-1])} or {allowed[-1]}."
        )
    if not target.parent.is_dir():
        raise ParameterError("", f"cannot write {what} to {str(target)!r}: there is no folder {str(target.parent)!r}; create it first.")
    return target


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A sibling to write to, which takes the place of `target` once it is whole."""
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix.lower()}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def write_picture(picture: Figure, target: Path) -> None:
    """Write `picture` in the format that the ending of `target` says, with 200 dpi where it has pixels."""
    with replacing(target) as part, matplotlib.rc_context(STYLE):
        picture.savefig(part, format=target.suffix.lower()[1:], dpi=200)
