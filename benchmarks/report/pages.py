"""The numbers on the pages: what stands between ``<!-- report: NAME -->`` and ``<!-- /report -->`` is written by the block NAME."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from benchmarks.report.blocks import BLOCKS
from benchmarks.report.words import Files
from multiphase.storage import replace_file

MARK = re.compile(r"(<!-- report: (\w+) -->)(.*?)(<!-- /report -->)", re.DOTALL)


def pages(root: Path) -> Iterator[Path]:
    """The Markdown files that may have blocks."""
    yield from (root / "README.md", root / "VERIFICATION.md", *sorted((root / "docs").glob("*.md")))


def filled(text: str, files: Files) -> tuple[str, list[str]]:
    """A page with its blocks as the files have them, and the names of those that were not; raises KeyError for a block of no such name."""
    changed: list[str] = []

    def fill(mark: re.Match[str]) -> str:
        start, name, old, end = mark.groups()
        new = BLOCKS[name](files)
        new = f"\n{new}\n" if "\n" in new else new
        if new != old:
            changed.append(name)
        return f"{start}{new}{end}"

    return MARK.sub(fill, text), changed


def write(root: Path, results: Path) -> list[Path]:
    """Fill all blocks; the pages that changed."""
    files, found = Files(results), []
    for page in pages(root):
        text, changed = filled(page.read_text(encoding="utf-8"), files)
        if changed:
            replace_file(page, text.encode("utf-8"))
            found.append(page)
    return found


def stale(root: Path, results: Path) -> list[tuple[str, str]]:
    """Page and block of what is not what the files say."""
    files = Files(results)
    return [(page.name, name) for page in pages(root) for name in filled(page.read_text(encoding="utf-8"), files)[1]]
