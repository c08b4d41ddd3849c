"""Compiled copies of plain functions, and where their machine code is kept."""

from __future__ import annotations

from pathlib import Path

import numba
import pytest

from multiphase.compiled import cache_folder, compiled, fingerprint, prune


def inner(x: float) -> float:
    return x + 1.0


def outer(x: float) -> float:
    return 2.0 * inner(x)


def test_a_copy_calls_what_it_is_given() -> None:
    twice = compiled(outer, inner=compiled(inner))
    other = compiled(outer, inner=compiled(lambda x: x - 1.0))
    assert (twice(3.0), other(3.0), outer(3.0)) == (8.0, 4.0, 8.0)
    assert compiled(twice, inner=compiled(lambda x: 0.0 * x))(3.0) == 0.0  # a copy of a compiled function


def test_the_fingerprint_follows_the_text_of_any_file(tmp_path: Path) -> None:
    a, b = tmp_path / "a.py", tmp_path / "b.py"
    a.write_text("x = 1")
    b.write_text("y = 1")
    first = fingerprint(str(a), str(b))
    assert first == fingerprint(str(a), str(b))
    b.write_text("y = 2")
    assert first != fingerprint(str(a), str(b))


def test_machine_code_is_kept_under_the_fingerprint_and_the_setting_is_restored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert compiled(inner, keep="first")(1.0) == 2.0
    assert compiled(inner, keep="second")(1.0) == 2.0
    kept = {path.parent.parent.name for path in (tmp_path / "multiphase-tissue").rglob("*.nbc")}
    assert kept == {"first", "second"}
    assert str(tmp_path) == numba.config.CACHE_DIR


def test_only_the_newest_versions_stay(tmp_path: Path) -> None:
    import os

    for age in range(5):
        (tmp_path / f"v{age}").mkdir()
        os.utime(tmp_path / f"v{age}", (1e9 - age, 1e9 - age))
    prune(tmp_path, kept=2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["v0", "v1"]


def test_a_home_that_cannot_be_written_falls_back(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    folder = cache_folder(str(blocked))
    assert folder != blocked / "multiphase-tissue"
    assert folder.name.startswith("multiphase-tissue")
