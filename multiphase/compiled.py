"""Plain Python functions compiled with Numba: laws that are stated once, and kernels made for one model from a template.

Compiled code is kept on disk between processes. Numba throws it away when the file of the compiled function changes, but not when a
function that it calls does, in another file; so it is kept in a folder named after the fingerprint of all the files it is made of.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from types import FunctionType
from typing import Any

import numba
from numba import njit

_LOCK = Lock()


def compiled(function: Callable[..., Any], *, keep: str = "", **names: Any) -> Any:
    """`function` compiled, with the global names it uses replaced by `names`.

    Parameters
    ----------
    function : callable
        A plain function, or a compiled one, of which a copy is made.
    keep : str
        Fingerprint under which the compiled code is kept on disk; empty to keep it in memory only.
    names
        What stands for a global name, for instance the compiled version of a plain function that `function` calls.
    """
    plain = getattr(function, "py_func", function)
    assert isinstance(plain, FunctionType)
    clone = FunctionType(plain.__code__, {**plain.__globals__, **names}, plain.__name__, plain.__defaults__, plain.__closure__)
    clone.__qualname__, clone.__module__ = plain.__qualname__, plain.__module__
    if not keep:
        return njit(error_model="numpy")(clone)
    with _LOCK:
        settings: Any = numba.config
        before = settings.CACHE_DIR
        folder = cache_folder(before)
        if not (folder / keep).exists():
            prune(folder)
        settings.CACHE_DIR = str(folder / keep)
        try:
            return njit(error_model="numpy", cache=True)(clone)
        finally:
            settings.CACHE_DIR = before


def cache_folder(chosen: str = "") -> Path:
    """Where compiled code is kept: under Numba's own setting NUMBA_CACHE_DIR if there is one, else where the system keeps caches."""
    if chosen:
        base = Path(chosen)
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", str(Path.home())))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    folder = base / "multiphase-tissue"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:  # a home that cannot be written
        other = Path(tempfile.gettempdir()) / f"multiphase-tissue-{os.getuid() if hasattr(os, 'getuid') else 0}"
        other.mkdir(exist_ok=True)
        return other


def prune(folder: Path, kept: int = 8) -> None:
    """Remove all but the newest versions of compiled code."""
    versions = sorted((path for path in folder.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime, reverse=True)
    for old in versions[kept:]:
        shutil.rmtree(old, ignore_errors=True)


def fingerprint(*files: str | None) -> str:
    """A word that changes when the text of one of the `files` does."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(Path(file or "").read_bytes())
    return digest.hexdigest()[:16]
