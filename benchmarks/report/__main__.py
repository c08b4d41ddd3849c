"""Measure, and write the files, the pictures and the pages."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from pathlib import Path
from types import ModuleType

from threadpoolctl import threadpool_limits

from benchmarks.machine import heading
from benchmarks.report import everyday, hard, pages, pictures, plane, plaque, radial, size
from benchmarks.report.ratios import equal
from benchmarks.report.tables import read, write
from benchmarks.report.work import LOG
from multiphase.storage import replace_file

PARTS: dict[str, ModuleType] = {"plaque": plaque, "radial": radial, "plane": plane, "hard": hard, "everyday": everyday, "size": size}
ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.report", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="PART", help=f"measure these parts only: {', '.join(PARTS)}")
    parser.add_argument("--pages", action="store_true", help="measure nothing: write the pictures and pages from the files that are there")
    parser.add_argument(
        "--mesh", type=Path, help="mesh of the paper's program (quarter_disk_authors.msh of its repository), to run it there too"
    )
    parser.add_argument(
        "--check", action="store_true", help="measure and write nothing: exit with 1 if a page does not say what the files say"
    )
    options = parser.parse_args(arguments)
    shown = logging.StreamHandler(sys.stderr)
    shown.addFilter(logging.Filter("benchmarks"))  # runs warn of what is hard in them, and the judge of hard cases listens
    logging.basicConfig(level=logging.INFO, format="%(asctime)s  %(message)s", datefmt="%H:%M:%S", handlers=[shown])
    if options.mesh is not None and not options.mesh.is_file():
        parser.error(f"--mesh: there is no file {options.mesh}")
    if not (options.pages or options.check):
        measure(options.only or list(PARTS), options.mesh)
    try:
        if options.check:
            stale = pages.stale(ROOT, RESULTS)
            told = [f"{page}: {name} is not what the files say; python -m benchmarks.report --pages writes it" for page, name in stale]
            print("\n".join(told or ["All pages say what the files say."]))
            return 1 if stale else 0
        pictures.write(RESULTS, ROOT / "docs" / "figures")
        for page in pages.write(ROOT, RESULTS):
            LOG.info("written: %s", page)
    except FileNotFoundError as missing:
        print(f"{missing.filename} is not there: the pages need all parts; python -m benchmarks.report measures them.", file=sys.stderr)
        return 1
    return 0


def measure(parts: list[str], mesh: Path | None) -> None:
    """Each part's files as soon as they are measured, and equal.csv at the end."""
    RESULTS.mkdir(exist_ok=True)
    about, began = [heading()], time.perf_counter()
    with threadpool_limits(1):
        for name in parts:
            LOG.info("== %s", name)
            started = time.perf_counter()
            for file, rows in (plane.measure(mesh=mesh) if name == "plane" else PARTS[name].measure()).items():
                write(RESULTS / f"{file}.csv", [*about, f"{time.strftime('%Y-%m-%d')}, {time.perf_counter() - started:.0f} s"], rows)
    if "everyday" in parts:
        for name, text in everyday.first_commands().items():
            replace_file(RESULTS / f"{name}.txt", text.encode("utf-8"))
    write_ratios(about, time.perf_counter() - began if len(parts) == len(PARTS) else None)


def write_ratios(about: list[str], seconds: float | None) -> None:
    """equal.csv, with the ratios of the whole report before; `seconds` are those of this one, and where a part alone is measured its date
    and what it is compared with stay."""
    target = RESULTS / "equal.csv"
    said, before = read(target) if target.exists() else ([], [])
    whole = (said or about) if seconds is None else [*about, f"{time.strftime('%Y-%m-%d')}, the whole report in {seconds:.0f} s"]
    files = {name: read(path)[1] for name in ("plaque", "radial", "plane") if (path := RESULTS / f"{name}.csv").exists()}
    rows = equal(files, before, "ratio_before" if seconds is None else "ratio")
    write(target, whole, rows)
    changes = [abs(row["change"]) for row in rows if row["change"] is not None]
    if changes:
        LOG.info("ratios at equal error change by %.0f %% at most against the report before", 100.0 * max(changes))


if __name__ == "__main__":
    sys.exit(main())
