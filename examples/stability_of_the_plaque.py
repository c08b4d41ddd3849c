"""Which waves grow in an intima of macrophages, and how to stop them.

With drag only, as printed, short waves grow where n is below 1/2 and the pressure p_out at the outer wall is small: at the viscosity of
the preset the shorter the faster, so no mesh is fine enough. Strong viscosity leaves a most dangerous wavelength; a p_out of A, or the
interfacial force, leaves none.
"""

from __future__ import annotations

from dataclasses import replace

from plaque1d import PlaqueParameters
from plaque1d.stability import Mode, figure, least_p_out, most_dangerous

N, LDL = 0.3, 0.02
"""The uniform state that is disturbed."""


def main() -> dict[str, Mode]:
    """The most dangerous waves by name of the case."""
    drag = PlaqueParameters(momentum="drag")
    viscous = replace(drag, mu_n=0.5, mu_m=0.5)
    cases = {
        "drag": drag,
        "drag, viscosity x 100": viscous,
        "drag, p_out = A": replace(drag, p_out=drag.A),
        "interfacial": replace(drag, momentum="interfacial"),
    }
    modes = {name: most_dangerous(parameters, N, LDL) for name, parameters in cases.items()}
    for name, mode in modes.items():
        said = f"most dangerous wavelength {mode.wavelength:.4g}, growth rate {mode.rate:.4g}" if mode.grows else "nothing grows"
        print(f"{name:22} {said}")
    print(f"least p_out            {float(least_p_out(drag, N, LDL)):.4g}")
    figure(viscous, N, LDL).savefig("stability_of_the_plaque.png", dpi=200)
    print("stability_of_the_plaque.png written")
    return modes


if __name__ == "__main__":
    main()
