"""What `import plaque1d` costs beyond `import numpy`.

python -m benchmarks.start
"""

from __future__ import annotations

import statistics
import subprocess
import sys

from benchmarks.machine import heading

CODE = "import time, numpy; t = time.perf_counter(); import plaque1d; print(time.perf_counter() - t)"


def main() -> None:
    times = [float(subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True).stdout) for _ in range(5)]
    print(f"# Start\n\n{heading()}\n\n| what | s |\n| --- | --- |")
    print(f"| import plaque1d after import numpy, median of 5 | {statistics.median(times):.3f} |")


if __name__ == "__main__":
    main()
