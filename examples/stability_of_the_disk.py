"""When does a growing disk lose its round shape, and what keeps it?

Growth in the rim and death in the core compress the edge of the disk, until nothing holds it round: at t = 64 with the paper's values. The
second modulus lambda_alpha puts that off, or keeps the disk round for good.
"""

from __future__ import annotations

from dataclasses import replace

from tumour import TumourParameters
from tumour.stability import CriticalTime, critical_time, figure, modes

LAMBDAS = (0.0, 0.02, 0.05, 0.1, 0.2)


def main(cells: int = 100, dt: float = 0.1, lambdas: tuple[float, ...] = LAMBDAS) -> dict[float, CriticalTime]:
    """Critical times by lambda_alpha."""
    paper = TumourParameters.preset("paper")
    growth = modes(paper, wave_numbers=[2, 3, 4, 5, 6, 8, 12], t_end=62.0, cells=cells, dt=dt)
    print("From t = 44 to 60 a departure from the round shape, U/r, grows")
    early, late = (abs(growth.at(t)) / growth.radius[growth.t.searchsorted(t)] for t in (44.0, 60.0))
    for k, gain in zip(growth.wave_numbers, late / early, strict=True):
        print(f"    {gain:5.1f}-fold as cos({k} theta)")
    critical = {}
    for value in lambdas:
        found = critical_time(replace(paper, lambda_alpha=value), wave_numbers=range(2, 9), t_end=100.0, cells=cells)
        t, k = found.first
        print(f"lambda_alpha = {value:4}: " + (f"unstable from t = {t:.1f} on, first as cos({k} theta)" if k else "stable to t = 100"))
        critical[value] = found
    figure(growth, critical).savefig("stability_of_the_disk.png", dpi=200)
    print("stability_of_the_disk.png written")
    return critical


if __name__ == "__main__":
    main()
