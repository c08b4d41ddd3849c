"""The report of speed against accuracy: what is measured, the CSV files, the pictures and the pages.

    python -m benchmarks.report

measures everything (`work`: what a measurement is; `plaque`, `radial`, `plane`, `size`, `hard`, `everyday`: the parts), writes
benchmarks/results/*.csv, then docs/figures/*.png (`pictures`) and the numbers in docs/speed-and-accuracy.md, README.md and
VERIFICATION.md (`pages`). `--pages` writes the pictures and pages again from the files that are there. Codes that are not installed (the
extra "benchmarks" brings them) are left out, and the page says so.
"""
