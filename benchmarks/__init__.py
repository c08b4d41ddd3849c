"""What is measured: each module prints a table, which stands beside it as a Markdown file; `python -m benchmarks.report` measures what
docs/speed-and-accuracy.md tells.

Run from the root of the repository.
"""
