"""The equations of the tumour in words: what a plan prints of them."""

from __future__ import annotations

from multiphase.tensors import TensorFunction
from tumour.geometry import TumourGeometry
from tumour.parameters import TumourParameters


def plane_equations(p: TumourParameters, *, has_oxygen: bool) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body at rest."""
    m = "" if p.stiffness == 1.0 else "m "
    rows = [
        ("momentum", f"Div P = 0, P = {m}mu (F - F^-T) + ({m}lambda (J - 1) - p - alpha Sigma) J F^-T", "(2.22a)"),
        *_fibre_rows(p),
        ("cells", "(alpha J)_t = J q_alpha(alpha, C)", "(2.22b)"),
    ]
    if p.kappa > 0.0:
        rows.append(("fluid", f"J_t = Div(M(alpha) J {_pull_back(p.permeability, 'K')} grad p)", "(2.22c)"))
    if has_oxygen:
        w = "" if p.consumption == 1.0 else "w "
        rows.append(("oxygen", f"Div(J {_pull_back(p.diffusivity, 'D')} grad C) = J {w}{_uptake(p)}", "(2.22d)"))
    return tuple(f"{name:<10}{equation:<74}  {number}".rstrip() for name, equation, number in rows)


def _fibre_rows(p: TumourParameters) -> list[tuple[str, str, str]]:
    """What fibres add to the stress."""
    rows = []
    if p.fibre_ratio != 1.0:
        rows.append(("", "    - (rho - 1) alpha Sigma J (F a_0) (x) a_0/|F a_0|^2, rho = fibre_ratio", ""))
    if p.fibre_stiffness != 0.0:
        rows.append(("", "    + 2 k_f (|F a_0|^2 - 1) (F a_0) (x) a_0, k_f = fibre_stiffness", ""))
    return rows


def _pull_back(tensor: TensorFunction, symbol: str) -> str:
    """What stands between J and a gradient."""
    if tensor == 1.0:
        return "F^-1 F^-T"
    return f"{symbol} F^-1 F^-T" if tensor.is_isotropic else f"U^-1 {symbol} U^-1"


def _powers(m: int) -> tuple[str, str]:
    """What stands before and within a divergence, per symbol of the radius: r^(1-m) and r^(m-1)."""
    return {1: ("", ""), 2: ("X^-1 ", "X "), 3: ("X^-2 ", "X^2 ")}[m]


def radial_equations(p: TumourParameters, geometry: TumourGeometry, *, is_uniform: bool) -> tuple[str, ...]:
    """One line for each equation that is solved."""
    if not is_uniform:
        return _viscous_equations(p, geometry) if geometry.eulerian else _elastic_equations(p, geometry.m)
    if geometry.eulerian:
        m = {1: "", 2: "2 ", 3: "3 "}[geometry.m]
        return _rows(
            ("cells", f"alpha' = q_alpha(alpha, C_out) - {m}alpha R'/R", "(2.1), (2.6)"),
            ("surface", f"R'/R = (Sigma + p_out/alpha)/(2 mu + {m}lambda)", "(2.4)"),
        )
    return _rows(
        ("cells", "(alpha J)' = J q_alpha(alpha, C_out)", "(2.22b)"),
        ("force", "P_r(l) l/J = alpha Sigma + p_out, J = l" + {1: "", 2: "^2", 3: "^3"}[geometry.m], "(2.22a)"),
    )


def _elastic_equations(p: TumourParameters, m: int) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body at rest: the point at R is at r(R, t)."""
    flow = "p = p_out, with p from the momentum balance" if p.kappa == 0.0 else "r_t = (M(alpha)/l_r) p_R, l_r = r_R"
    before, within = (text.replace("X", "R") for text in _powers(m))
    return _rows(
        ("cells", "(alpha J)_t = J q_alpha(alpha, C)", "(2.22b)"),
        ("fluid", flow, "(2.22c)"),
        ("oxygen", f"{before}({within}(J/l_r^2) C_R)_R = J {_uptake(p)}", "(2.22d)"),
    )


def _viscous_equations(p: TumourParameters, geometry: TumourGeometry) -> tuple[str, ...]:
    """One line for each equation that is solved, on the body as it is: r = xi R(t)."""
    flow = "p = p_out, with p from the momentum balance" if p.kappa == 0.0 else "u = M(alpha) p_r, with p from the momentum balance"
    before, within = (text.replace("X", "r") for text in _powers(geometry.m))
    return _rows(
        ("cells", f"alpha_t + {before}({within}alpha u)_r = q_alpha(alpha, C)", "(2.1), (2.6)"),
        ("fluid", flow, "(2.4), (2.13)"),
        ("oxygen", f"{before}({within}C_r)_r = {_uptake(p)}", ""),
        ("surface", "R' = u(R)", ""),
    )


def _uptake(p: TumourParameters) -> str:
    return "Q alpha C" if p.Q1_hat == 0.0 else "Q alpha C/(1 + Q1_hat C)"


def _rows(*rows: tuple[str, str, str]) -> tuple[str, ...]:
    """Name, equation and number in columns."""
    return tuple(f"{name:<10}{equation:<48}  {number}".rstrip() for name, equation, number in rows)
