"""What a point of the elastic tumour answers to its strain: stresses, amounts, flows, with all derivatives, compiled.

Next to grad v, phi of the cells, phi and grad phi of the fluid, phi and grad phi of the oxygen stand (see ROWS in `tumour.fem.arrays`)

    P,      alpha J - tau J q_alpha,      J,   tau M A^T k A grad p / J,      w J U(alpha, C),   A^T k A grad C / J

with ``A = J F^-T`` (the cofactor, linear in F) and the row of tissue that belongs to the point: the factor m on both moduli, the tensors K
of permeability and diffusivity, turned with the tissue, ``k = R K R^T`` with F = R U, the factor w on the uptake, and fibres along a_0:

    P = m mu F + g A + h (F a_0) (x) a_0,      g = m lambda (J - 1) - m mu/J - p - alpha Sigma,
    h = 2 k_f (|F a_0|^2 - 1) - (rho - 1) alpha Sigma J/|F a_0|^2

The step of the paper's program (`Data.printed`) has ``(J - J_old) alpha + (alpha - alpha_old) J`` in place of ``alpha J``.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from tumour import laws as law
from tumour.fem.arrays import CONSUMPTION, DIFFUSIVITY, FIBRE, PERMEABILITY, PUSH, REINFORCEMENT, STIFFNESS, Data


@njit(error_model="numpy")
def turned(c: Data, row: int, first: int, e: Any) -> tuple[float, float, float]:
    """The tensor that begins at `first` in a row of tissue, turned with the tissue: k = R K R^T, as k_xx, k_yy, k_xy."""
    a, b, off = c.tissue[row, first], c.tissue[row, first + 1], c.tissue[row, first + 2]
    if not c.tensors:
        return a, b, off
    u, v = e[0] + e[3], e[2] - e[1]
    over = 1.0 / (u * u + v * v)
    cc, ss, cs = u * u * over, v * v * over, u * v * over  # of the angle by which R turns
    return cc * a + ss * b - 2.0 * cs * off, ss * a + cc * b + 2.0 * cs * off, cs * (a - b) + (cc - ss) * off


@njit(error_model="numpy")
def conducted(c: Data, row: int, tensor: int, factor: float, e: Any, first: int) -> tuple[float, float]:
    """The flow ``factor A^T k A g`` down the gradient g, which is e[first:first+2]."""
    h1, h2 = e[3] * e[first] - e[2] * e[first + 1], e[0] * e[first + 1] - e[1] * e[first]
    a, b, off = turned(c, row, tensor, e)
    z1, z2 = factor * (a * h1 + off * h2), factor * (off * h1 + b * h2)
    return e[3] * z1 - e[1] * z2, e[0] * z2 - e[2] * z1


@njit(error_model="numpy")
def add_fibres(c: Data, row: int, e: Any, J: float, contact: float, s: Any) -> None:
    """Add to the stress what fibres push more than the rest, and what they resist, ``h (F a_0) (x) a_0``."""
    a1, a2 = c.tissue[row, FIBRE], c.tissue[row, FIBRE + 1]
    b1, b2 = e[0] * a1 + e[1] * a2, e[2] * a1 + e[3] * a2
    square = b1 * b1 + b2 * b2
    h = 2.0 * c.tissue[row, REINFORCEMENT] * (square - 1.0) - c.tissue[row, PUSH] * contact * J / square
    s[0] += h * b1 * a1
    s[1] += h * b1 * a2
    s[2] += h * b2 * a1
    s[3] += h * b2 * a2


@njit(error_model="numpy")
def respond(c: Data, row: int, tau: float, e: Any, alpha_old: float, J_old: float, s: Any) -> None:
    """The response `s` of a point, with its row of tissue, to the strain `e`: see ROWS."""
    F11, F12, F21, F22, alpha, p, C = e[0], e[1], e[2], e[3], e[4], e[5], e[6]
    J = F11 * F22 - F12 * F21
    mu, lam = c.mu * c.tissue[row, STIFFNESS], c.lam * c.tissue[row, STIFFNESS]
    contact = law.contact_pressure(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    g = lam * (J - 1.0) - mu / J - p - contact
    s[0] = mu * F11 + g * F22
    s[1] = mu * F12 - g * F21
    s[2] = mu * F21 - g * F12
    s[3] = mu * F22 + g * F11
    if c.fibres:
        add_fibres(c, row, e, J, contact, s)
    q = law.net_growth(alpha, C, c.s1, c.s2, c.s3, c.s4)
    s[4] = J * (alpha - tau * q)
    if c.printed:
        s[4] += J * (alpha - alpha_old) - J_old * alpha
    s[5] = J
    flow = 0.0 if c.kappa == 0.0 else tau * law.mobility(alpha, c.kappa, c.law, c.floor) / J
    s[6], s[7] = conducted(c, row, PERMEABILITY, flow, e, 7)
    s[8] = J * c.tissue[row, CONSUMPTION] * law.oxygen_uptake(alpha, C, c.Q, c.Q1_hat)
    s[9], s[10] = conducted(c, row, DIFFUSIVITY, 1.0 / J, e, 9)


@njit(error_model="numpy")
def conduct(c: Data, row: int, tensor: int, M: float, J: float, e: Any, first: int, f: Any, D: Any, at: int) -> None:
    """Derivatives of the flow ``f = A^T k h, h = A g`` with ``k = M R K R^T/J``, by F and by the gradient g, which is e[first:first+2],
    into the rows `at` and `at` + 1 of D: ``df = dA^T (k h) + A^T k dA g + A^T dk h - f dJ/J``."""
    F11, F12, F21, F22 = e[0], e[1], e[2], e[3]
    px, py = e[first], e[first + 1]
    a, b, off = turned(c, row, tensor, e)
    a, b, off = M * a / J, M * b / J, M * off / J
    # A = [[F22, -F21], [-F12, F11]]
    h1, h2 = F22 * px - F21 * py, F11 * py - F12 * px
    z1, z2 = a * h1 + off * h2, off * h1 + b * h2
    w11, w12 = F22 * a - F12 * off, F22 * off - F12 * b  # A^T k
    w21, w22 = F11 * off - F21 * a, F11 * b - F21 * off
    f1, f2 = f[at] / J, f[at + 1] / J
    D[at, 0] = w12 * py - f1 * F22
    D[at + 1, 0] = z2 + w22 * py - f2 * F22
    D[at, 1] = -z2 - w12 * px + f1 * F21
    D[at + 1, 1] = -w22 * px + f2 * F21
    D[at, 2] = -w11 * py + f1 * F12
    D[at + 1, 2] = -z1 - w21 * py + f2 * F12
    D[at, 3] = z1 + w11 * px - f1 * F11
    D[at + 1, 3] = w21 * px - f2 * F11
    D[at, first], D[at, first + 1] = w11 * F22 - w12 * F12, w12 * F11 - w11 * F21
    D[at + 1, first], D[at + 1, first + 1] = D[at, first + 1], w22 * F11 - w21 * F21
    if c.tensors:  # R turns with F by the angle of (F11 + F22, F21 - F12)
        u, v = F11 + F22, F21 - F12
        over = 1.0 / (u * u + v * v)
        y1, y2 = (a - b) * h2 - 2.0 * off * h1, (a - b) * h1 + 2.0 * off * h2
        x1, x2 = (F22 * y1 - F12 * y2) * over, (F11 * y2 - F21 * y1) * over
        for i in range(2):
            turn = x1 if i == 0 else x2
            D[at + i, 0] -= v * turn
            D[at + i, 1] -= u * turn
            D[at + i, 2] += u * turn
            D[at + i, 3] -= v * turn


@njit(error_model="numpy")
def add_fibre_slopes(c: Data, row: int, e: Any, J: float, contact: float, contact_slope: float, D: Any) -> None:
    """Add the derivatives of what `add_fibres` adds."""
    F11, F12, F21, F22 = e[0], e[1], e[2], e[3]
    a = (c.tissue[row, FIBRE], c.tissue[row, FIBRE + 1])
    b = (F11 * a[0] + F12 * a[1], F21 * a[0] + F22 * a[1])
    A = (F22, -F21, -F12, F11)
    square = b[0] * b[0] + b[1] * b[1]
    push, stiff = c.tissue[row, PUSH], c.tissue[row, REINFORCEMENT]
    h = 2.0 * stiff * (square - 1.0) - push * contact * J / square
    along = 4.0 * stiff + 2.0 * push * contact * J / (square * square)  # dh = along b.(dF a_0) - push contact dJ/|F a_0|^2
    by_J, by_alpha = -push * contact / square, -push * contact_slope * J / square
    for i in range(2):
        for j in range(2):
            at = 2 * i + j
            D[at, 4] += by_alpha * b[i] * a[j]
            for k in range(2):
                for l in range(2):
                    slope = (along * b[k] * a[l] + by_J * A[2 * k + l]) * b[i] * a[j]
                    D[at, 2 * k + l] += slope + (h * a[l] * a[j] if i == k else 0.0)


@njit(error_model="numpy")
def respond_slopes(c: Data, row: int, tau: float, e: Any, alpha_old: float, J_old: float, s: Any, D: Any) -> None:
    """Derivatives `D` of the response `s` by the strain `e`; entries that are always 0 are left alone."""
    F11, F12, F21, F22, alpha, p, C = e[0], e[1], e[2], e[3], e[4], e[5], e[6]
    J = F11 * F22 - F12 * F21
    mu, lam = c.mu * c.tissue[row, STIFFNESS], c.lam * c.tissue[row, STIFFNESS]
    contact = law.contact_pressure(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    g = lam * (J - 1.0) - mu / J - p - contact
    A = (F22, -F21, -F12, F11)
    stiff = lam + mu / (J * J)
    swell = law.contact_pressure_slope(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    for i in range(4):
        for j in range(4):
            D[i, j] = stiff * A[i] * A[j]
        D[i, i] += mu
        D[i, 4] = -swell * A[i]
        D[i, 5] = -A[i]
    D[0, 3] += g
    D[3, 0] += g
    D[1, 2] -= g
    D[2, 1] -= g
    if c.fibres:
        add_fibre_slopes(c, row, e, J, contact, swell, D)
    q = law.net_growth(alpha, C, c.s1, c.s2, c.s3, c.s4)
    q_alpha, q_C = law.net_growth_slopes(alpha, C, c.s1, c.s2, c.s3, c.s4)
    use = c.tissue[row, CONSUMPTION]
    taken = use * law.oxygen_uptake(alpha, C, c.Q, c.Q1_hat)
    taken_alpha, taken_C = law.oxygen_uptake_slopes(alpha, C, c.Q, c.Q1_hat)
    cells = alpha - tau * q
    D[4, 4] = J * (1.0 - tau * q_alpha)
    if c.printed:
        cells += alpha - alpha_old
        D[4, 4] += J - J_old
    D[4, 6] = -tau * J * q_C
    for j in range(4):
        D[4, j] = cells * A[j]
        D[5, j] = A[j]
        D[8, j] = taken * A[j]
    D[8, 4], D[8, 6] = J * use * taken_alpha, J * use * taken_C
    M = 0.0
    if c.kappa > 0.0:
        M = law.mobility(alpha, c.kappa, c.law, c.floor)
        relative = law.mobility_slope(alpha, c.kappa, c.law, c.floor) / M
        D[6, 4], D[7, 4] = relative * s[6], relative * s[7]
    conduct(c, row, PERMEABILITY, tau * M, J, e, 7, s, D, 6)
    conduct(c, row, DIFFUSIVITY, 1.0, J, e, 9, s, D, 9)
