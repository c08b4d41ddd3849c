"""What every table says about where it was measured."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from pathlib import Path


def processor() -> str:
    """Model name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def heading(threads: int = 1) -> str:
    """Machine, versions and threads as a Markdown paragraph."""
    names = ("multiphase-tissue", "numpy", "scipy", "numba", "fipy", "h5py")
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
    return (
        f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}; Python {platform.python_version()}, {versions}; "
        f"{threads} thread."
    )
