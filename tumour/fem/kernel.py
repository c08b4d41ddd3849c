r"""The elastic tumour on triangles: residual and tangent of every element, compiled.

Total Lagrangian, (2.22). On the triangles of the body at rest the displacement d is in the MINI element (linear, with a cubic bubble in
each triangle) and alpha, p, C are continuous and linear. With ``F = I + grad d``, ``J = det F``, ``A = J F^-T`` (the cofactor, linear in F)
and a step of size tau from a past whose moments are known, the discrete equations are, for all test functions v and phi,

    momentum   (P, grad v) = 0,      P = mu F + g A,     g = lambda (J - 1) - mu/J - p - alpha Sigma
    cells      (alpha J, phi) - tau (J q_alpha, phi) = past moment of alpha J
    fluid      (J, phi) + tau (M A^T A grad p / J, grad phi) = past moment of J
    oxygen     (A^T A grad C / J, grad phi) + (J U(alpha, C), phi) = 0

Everything is integrated by the rule of six points that is exact to degree four. `respond` gives, at one of them, the stresses that stand
next to v, grad v, phi and grad phi as functions of F, alpha, p, C and their gradients, with all derivatives; the rest is sums. The step
of the paper's program (`Data.printed`) has ``(J - J_old) alpha + (alpha - alpha_old) J`` in place of ``alpha J`` and no past moment.

Unknowns of a triangle: d_x, d_y, alpha, p, C of its first, second and third point, then the two of its bubble. The bubble is condensed:
with the element's tangent in blocks, ``K_XX - K_Xb K_bb^-1 K_bX`` goes to the matrix; ``K_bb^-1``, ``K_bb^-1 K_bX`` and ``K_Xb K_bb^-1``
are kept, and the bubble's change follows from that of the others. An iteration with an old tangent takes the old tangent's blocks.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numba import njit

from multiphase import transport
from multiphase.lines import Kernel
from tumour import equations, laws
from tumour import laws as law
from tumour.fem import arrays
from tumour.fem.arrays import FIELDS, LOCAL, OUTER, ROWS, Data, Elements, Pattern


@njit(error_model="numpy")
def bubble_gradient(corners: Any, l0: float, l1: float, l2: float) -> tuple[float, float]:
    """Gradient of 27 l0 l1 l2."""
    a, b, c = 27.0 * l1 * l2, 27.0 * l0 * l2, 27.0 * l0 * l1
    return a * corners[0, 0] + b * corners[1, 0] + c * corners[2, 0], a * corners[0, 1] + b * corners[1, 1] + c * corners[2, 1]


@njit(error_model="numpy")
def strain(x: Any, corners: Any, bx: float, by: float, l0: float, l1: float, l2: float, e: Any) -> None:
    """F (4), alpha, p, C, grad p (2), grad C (2) at a point of a triangle with the unknowns `x`."""
    lam = (l0, l1, l2)
    e[0], e[1], e[2], e[3] = 1.0 + x[15] * bx, x[15] * by, x[16] * bx, 1.0 + x[16] * by
    for i in range(4, 11):
        e[i] = 0.0
    for a in range(3):
        gx, gy = corners[a, 0], corners[a, 1]
        k = 5 * a
        e[0] += x[k] * gx
        e[1] += x[k] * gy
        e[2] += x[k + 1] * gx
        e[3] += x[k + 1] * gy
        e[4] += x[k + 2] * lam[a]
        e[5] += x[k + 3] * lam[a]
        e[6] += x[k + 4] * lam[a]
        e[7] += x[k + 3] * gx
        e[8] += x[k + 3] * gy
        e[9] += x[k + 4] * gx
        e[10] += x[k + 4] * gy


@njit(error_model="numpy")
def respond(c: Data, tau: float, e: Any, alpha_old: float, J_old: float, s: Any) -> None:
    """The response `s` of a point to the strain `e`: see ROWS."""
    F11, F12, F21, F22, alpha, p, C = e[0], e[1], e[2], e[3], e[4], e[5], e[6]
    J = F11 * F22 - F12 * F21
    g = c.lam * (J - 1.0) - c.mu / J - p - law.contact_pressure(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    s[0] = c.mu * F11 + g * F22
    s[1] = c.mu * F12 - g * F21
    s[2] = c.mu * F21 - g * F12
    s[3] = c.mu * F22 + g * F11
    q = law.net_growth(alpha, C, c.s1, c.s2, c.s3, c.s4)
    s[4] = J * (alpha - tau * q)
    if c.printed:
        s[4] += J * (alpha - alpha_old) - J_old * alpha
    s[5] = J
    flow = 0.0 if c.kappa == 0.0 else tau * law.mobility(alpha, c.kappa, c.law, c.floor)
    h1, h2 = F22 * e[7] - F21 * e[8], F11 * e[8] - F12 * e[7]
    s[6] = flow * (F22 * h1 - F12 * h2) / J
    s[7] = flow * (F11 * h2 - F21 * h1) / J
    s[8] = J * law.oxygen_uptake(alpha, C, c.Q, c.Q1_hat)
    k1, k2 = F22 * e[9] - F21 * e[10], F11 * e[10] - F12 * e[9]
    s[9] = (F22 * k1 - F12 * k2) / J
    s[10] = (F11 * k2 - F21 * k1) / J


@njit(error_model="numpy")
def conduct(M: float, J: float, F: Any, px: float, py: float, f: Any, D: Any, row: int) -> None:
    """Derivatives by F of the flow ``f = M A^T A grad p / J`` into two rows of D, from `row` on: with h = A grad p,
    ``df = M (dA^T h + A^T dA grad p)/J - f dJ/J``."""
    F11, F12, F21, F22 = F[0], F[1], F[2], F[3]
    h1, h2 = (F22 * px - F21 * py) / J * M, (F11 * py - F12 * px) / J * M
    a, b = M * px / J, M * py / J
    f1, f2 = f[row] / J, f[row + 1] / J
    # A = [[F22, -F21], [-F12, F11]]; A^T h = (F22 h1 - F12 h2, F11 h2 - F21 h1)
    D[row, 0] = -F12 * b - f1 * F22
    D[row + 1, 0] = h2 + F11 * b - f2 * F22
    D[row, 1] = -h2 + F12 * a + f1 * F21
    D[row + 1, 1] = -F11 * a + f2 * F21
    D[row, 2] = -F22 * b + f1 * F12
    D[row + 1, 2] = -h1 + F21 * b + f2 * F12
    D[row, 3] = h1 + F22 * a - f1 * F11
    D[row + 1, 3] = -F21 * a - f2 * F11


@njit(error_model="numpy")
def respond_slopes(c: Data, tau: float, e: Any, alpha_old: float, J_old: float, s: Any, D: Any) -> None:
    """Derivatives `D` of the response `s` by the strain `e`; entries that are always 0 are left alone."""
    F11, F12, F21, F22, alpha, p, C = e[0], e[1], e[2], e[3], e[4], e[5], e[6]
    J = F11 * F22 - F12 * F21
    g = c.lam * (J - 1.0) - c.mu / J - p - law.contact_pressure(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    A = (F22, -F21, -F12, F11)
    stiff = c.lam + c.mu / (J * J)
    swell = law.contact_pressure_slope(alpha, c.gamma, c.alpha_star, c.alpha_min, c.sigma_width)
    for i in range(4):
        for j in range(4):
            D[i, j] = stiff * A[i] * A[j]
        D[i, i] += c.mu
        D[i, 4] = -swell * A[i]
        D[i, 5] = -A[i]
    D[0, 3] += g
    D[3, 0] += g
    D[1, 2] -= g
    D[2, 1] -= g
    q = law.net_growth(alpha, C, c.s1, c.s2, c.s3, c.s4)
    q_alpha, q_C = law.net_growth_slopes(alpha, C, c.s1, c.s2, c.s3, c.s4)
    taken = law.oxygen_uptake(alpha, C, c.Q, c.Q1_hat)
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
    D[8, 4], D[8, 6] = J * taken_alpha, J * taken_C
    M, M_slope = 0.0, 0.0
    if c.kappa > 0.0:
        M = tau * law.mobility(alpha, c.kappa, c.law, c.floor)
        M_slope = tau * law.mobility_slope(alpha, c.kappa, c.law, c.floor)
    b11, b12, b22 = (F22 * F22 + F12 * F12) / J, -(F22 * F21 + F12 * F11) / J, (F21 * F21 + F11 * F11) / J
    D[6, 4], D[7, 4] = M_slope * (b11 * e[7] + b12 * e[8]), M_slope * (b12 * e[7] + b22 * e[8])
    D[6, 7], D[6, 8], D[7, 7], D[7, 8] = M * b11, M * b12, M * b12, M * b22
    D[9, 9], D[9, 10], D[10, 9], D[10, 10] = b11, b12, b12, b22
    conduct(M, J, e, e[7], e[8], s, D, 6)
    conduct(1.0, J, e, e[9], e[10], s, D, 9)


@njit(error_model="numpy")
def turned_over(el: Elements, nodal: Any, bubbles: Any) -> int:
    """-1, or the number of the first triangle where J is not positive at a quadrature point."""
    x, e = np.empty(LOCAL), np.empty(ROWS)
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        corners = el.gradients[n]
        for q in range(len(el.weights)):
            l0, l1, l2 = el.points[q, 0], el.points[q, 1], el.points[q, 2]
            bx, by = bubble_gradient(corners, l0, l1, l2)
            strain(x, corners, bx, by, l0, l1, l2, e)
            if not e[0] * e[3] - e[1] * e[2] > 0.0:
                return n
    return -1


@njit(error_model="numpy")
def gather(el: Elements, nodal: Any, bubbles: Any, n: int, x: Any) -> None:
    """The unknowns of the triangle n."""
    for a in range(3):
        for k in range(FIELDS):
            x[FIELDS * a + k] = nodal[el.triangles[n, a], k]
    x[15], x[16] = bubbles[n, 0], bubbles[n, 1]


@njit(error_model="numpy")
def past_of(el: Elements, old_nodal: Any, old_bubbles: Any, n: int, old: Any, e: Any, past: Any) -> None:
    """alpha and J of the last point at the quadrature points of the triangle n, for the step as printed."""
    gather(el, old_nodal, old_bubbles, n, old)
    corners = el.gradients[n]
    for q in range(len(el.weights)):
        l0, l1, l2 = el.points[q, 0], el.points[q, 1], el.points[q, 2]
        bx, by = bubble_gradient(corners, l0, l1, l2)
        strain(old, corners, bx, by, l0, l1, l2, e)
        past[q, 0], past[q, 1] = e[4], e[0] * e[3] - e[1] * e[2]


@njit(error_model="numpy")
def add_response(corners: Any, bx: float, by: float, lam: Any, s: Any, r: Any) -> None:
    """Add a point's response, weighted, to the element's residual."""
    for a in range(3):
        gx, gy, phi = corners[a, 0], corners[a, 1], lam[a]
        k = 5 * a
        r[k] += s[0] * gx + s[1] * gy
        r[k + 1] += s[2] * gx + s[3] * gy
        r[k + 2] += s[4] * phi
        r[k + 3] += s[5] * phi + s[6] * gx + s[7] * gy
        r[k + 4] += s[8] * phi + s[9] * gx + s[10] * gy
    r[15] += s[0] * bx + s[1] * by
    r[16] += s[2] * bx + s[3] * by


@njit(error_model="numpy")
def add_condensed(corners: Any, r: Any, bubble_load: Any, kept: Any, R: Any, r_bubble: Any) -> None:
    """Add the element's residual r, its bubble condensed with the blocks `kept`, to that of the points; keep the bubble's own."""
    b0, b1 = r[15] - bubble_load[0], r[16] - bubble_load[1]
    r_bubble[0], r_bubble[1] = b0, b1
    for a in range(3):
        for k in range(FIELDS):
            row = FIELDS * a + k
            R[corners[a], k] += r[row] - kept[34 + row] * b0 - kept[49 + row] * b1


@njit(error_model="numpy")
def residual(
    c: Data,
    el: Elements,
    tau: float,
    nodal: Any,
    bubbles: Any,
    old_nodal: Any,
    old_bubbles: Any,
    loads: Any,
    bubble_loads: Any,
    kept: Any,
    R: Any,
    r_bubbles: Any,
) -> int:
    """The condensed residual R (points, 5), less the loads, with the blocks of the last tangent, and that of the bubbles, (elements, 2).

    Returns -1, or the number of the first triangle where J is not positive.
    """
    x, e, s, r = np.empty(LOCAL), np.empty(ROWS), np.empty(ROWS), np.empty(LOCAL)
    old, past = np.empty(LOCAL), np.ones((len(el.weights), 2))
    R[:, :] = -loads
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        if c.printed:
            past_of(el, old_nodal, old_bubbles, n, old, e, past)
        corners = el.gradients[n]
        for i in range(LOCAL):
            r[i] = 0.0
        for q in range(len(el.weights)):
            lam = (el.points[q, 0], el.points[q, 1], el.points[q, 2])
            bx, by = bubble_gradient(corners, lam[0], lam[1], lam[2])
            strain(x, corners, bx, by, lam[0], lam[1], lam[2], e)
            if not e[0] * e[3] - e[1] * e[2] > 0.0:
                return n
            respond(c, tau, e, past[q, 0], past[q, 1], s)
            weight = el.weights[q] * el.areas[n]
            for i in range(ROWS):
                s[i] *= weight
            add_response(corners, bx, by, lam, s, r)
        add_condensed(el.triangles[n], r, bubble_loads[n], kept[n], R, r_bubbles[n])
    return -1


@njit(error_model="numpy")
def add_slopes(corners: Any, bx: float, by: float, lam: Any, weight: float, D: Any, B: Any, K: Any) -> None:
    """Add a point's derivatives to the element's tangent K; B is room for the response to each unknown, (ROWS, 17)."""
    for a in range(4):
        gx, gy = (bx, by) if a == 3 else (corners[a, 0], corners[a, 1])
        gx, gy = gx * weight, gy * weight
        k = 5 * a
        for i in range(ROWS):
            B[i, k] = D[i, 0] * gx + D[i, 1] * gy
            B[i, k + 1] = D[i, 2] * gx + D[i, 3] * gy
        if a < 3:
            phi = lam[a] * weight
            for i in range(ROWS):
                B[i, k + 2] = D[i, 4] * phi
                B[i, k + 3] = D[i, 5] * phi + D[i, 7] * gx + D[i, 8] * gy
                B[i, k + 4] = D[i, 6] * phi + D[i, 9] * gx + D[i, 10] * gy
    for a in range(3):
        gx, gy, phi = corners[a, 0], corners[a, 1], lam[a]
        k = 5 * a
        for j in range(LOCAL):
            K[k, j] += B[0, j] * gx + B[1, j] * gy
            K[k + 1, j] += B[2, j] * gx + B[3, j] * gy
            K[k + 2, j] += B[4, j] * phi
            K[k + 3, j] += B[5, j] * phi + B[6, j] * gx + B[7, j] * gy
            K[k + 4, j] += B[8, j] * phi + B[9, j] * gx + B[10, j] * gy
    for j in range(LOCAL):
        K[15, j] += B[0, j] * bx + B[1, j] * by
        K[16, j] += B[2, j] * bx + B[3, j] * by


@njit(error_model="numpy")
def condense(K: Any, kept: Any) -> None:
    """Eliminate the bubble from the element's tangent K and keep what its residual and change need."""
    a, b, c, d = K[15, 15], K[15, 16], K[16, 15], K[16, 16]
    over = 1.0 / (a * d - b * c)
    i00, i01, i10, i11 = d * over, -b * over, -c * over, a * over
    kept[0], kept[1], kept[2], kept[3] = i00, i01, i10, i11
    for j in range(OUTER):
        kept[4 + j] = i00 * K[15, j] + i01 * K[16, j]
        kept[19 + j] = i10 * K[15, j] + i11 * K[16, j]
        kept[34 + j] = K[j, 15] * i00 + K[j, 16] * i10
        kept[49 + j] = K[j, 15] * i01 + K[j, 16] * i11
    for i in range(OUTER):
        for j in range(OUTER):
            K[i, j] -= K[i, 15] * kept[4 + j] + K[i, 16] * kept[19 + j]


@njit(error_model="numpy")
def element_tangent(c: Data, el: Elements, tau: float, n: int, x: Any, past: Any, e: Any, s: Any, D: Any, B: Any, r: Any, K: Any) -> bool:
    """Residual r and tangent K of the triangle n, before its bubble is condensed; False where J is not positive."""
    corners = el.gradients[n]
    for i in range(LOCAL):
        r[i] = 0.0
        for j in range(LOCAL):
            K[i, j] = 0.0
    for q in range(len(el.weights)):
        lam = (el.points[q, 0], el.points[q, 1], el.points[q, 2])
        bx, by = bubble_gradient(corners, lam[0], lam[1], lam[2])
        strain(x, corners, bx, by, lam[0], lam[1], lam[2], e)
        if not e[0] * e[3] - e[1] * e[2] > 0.0:
            return False
        respond(c, tau, e, past[q, 0], past[q, 1], s)
        respond_slopes(c, tau, e, past[q, 0], past[q, 1], s, D)
        weight = el.weights[q] * el.areas[n]
        add_slopes(corners, bx, by, lam, weight, D, B, K)
        for i in range(ROWS):
            s[i] *= weight
        add_response(corners, bx, by, lam, s, r)
    return True


@njit(error_model="numpy")
def tangent(
    c: Data,
    el: Elements,
    tau: float,
    nodal: Any,
    bubbles: Any,
    old_nodal: Any,
    old_bubbles: Any,
    loads: Any,
    bubble_loads: Any,
    pattern: Pattern,
    values: Any,
    kept: Any,
    R: Any,
    r_bubbles: Any,
) -> int:
    """`residual` with a new tangent: its entries go to `values`, the blocks of its bubbles to `kept`."""
    x, e, s, r, K = np.empty(LOCAL), np.empty(ROWS), np.empty(ROWS), np.empty(LOCAL), np.empty((LOCAL, LOCAL))
    D, B = np.zeros((ROWS, ROWS)), np.zeros((ROWS, LOCAL))
    old, past = np.empty(LOCAL), np.ones((len(el.weights), 2))
    values[:] = 0.0
    R[:, :] = -loads
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        if c.printed:
            past_of(el, old_nodal, old_bubbles, n, old, e, past)
        if not element_tangent(c, el, tau, n, x, past, e, s, D, B, r, K):
            return n
        condense(K, kept[n])
        add_condensed(el.triangles[n], r, bubble_loads[n], kept[n], R, r_bubbles[n])
        add_to_rows(el.triangles[n], pattern.pairs[n], pattern, K, values)
    return -1


@njit(error_model="numpy")
def add_to_rows(corners: Any, pairs: Any, pattern: Pattern, K: Any, values: Any) -> None:
    """Add the condensed tangent of a triangle to the values of the matrix."""
    for a in range(3):
        for k in range(FIELDS):
            start = pattern.start[corners[a], k]
            if start < 0:
                continue
            for b in range(3):
                first = start + pairs[3 * a + b]
                for l in range(FIELDS):
                    rank = pattern.rank[corners[b], l]
                    if rank >= 0:
                        values[first + rank] += K[FIELDS * a + k, FIELDS * b + l]


@njit(error_model="numpy")
def bubble_changes(el: Elements, kept: Any, r_bubbles: Any, change: Any, out: Any) -> None:
    """The changes of the bubbles that go with those of the points, (points, 5)."""
    for n in range(len(el.areas)):
        b0, b1 = r_bubbles[n, 0], r_bubbles[n, 1]
        y0 = kept[n, 0] * b0 + kept[n, 1] * b1
        y1 = kept[n, 2] * b0 + kept[n, 3] * b1
        for a in range(3):
            i = el.triangles[n, a]
            for k in range(FIELDS):
                y0 += kept[n, 4 + FIELDS * a + k] * change[i, k]
                y1 += kept[n, 19 + FIELDS * a + k] * change[i, k]
        out[n, 0], out[n, 1] = -y0, -y1


@njit(error_model="numpy")
def moments(c: Data, el: Elements, nodal: Any, bubbles: Any, out: Any) -> None:
    """Moments with the shape functions of alpha J, J and J q_alpha, and with their gradients of the fluid's flow, (4, points)."""
    x, e, s = np.empty(LOCAL), np.empty(ROWS), np.empty(ROWS)
    out[:, :] = 0.0
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        corners = el.gradients[n]
        for q in range(len(el.weights)):
            lam = (el.points[q, 0], el.points[q, 1], el.points[q, 2])
            bx, by = bubble_gradient(corners, lam[0], lam[1], lam[2])
            strain(x, corners, bx, by, lam[0], lam[1], lam[2], e)
            respond(c, 1.0, e, 0.0, 0.0, s)
            weight = el.weights[q] * el.areas[n]
            J = s[5] * weight
            born = J * law.net_growth(e[4], e[6], c.s1, c.s2, c.s3, c.s4)
            for a in range(3):
                i = el.triangles[n, a]
                out[0, i] += e[4] * J * lam[a]
                out[1, i] += J * lam[a]
                out[2, i] += born * lam[a]
                out[3, i] += weight * (s[6] * corners[a, 0] + s[7] * corners[a, 1])


@njit(error_model="numpy")
def observe(c: Data, el: Elements, nodal: Any, bubbles: Any, levels: Any, out: Any, shares: Any) -> None:
    """Moments of J, of the size of P and of alpha J, (3, points), and the area below each level of oxygen.

    Oxygen is linear in a triangle; the part of it below a level is found exactly, and taken as a part of its area as it is now.
    """
    x, e, s = np.empty(LOCAL), np.empty(ROWS), np.empty(ROWS)
    out[:, :] = 0.0
    shares[:] = 0.0
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        corners = el.gradients[n]
        size = 0.0
        for q in range(len(el.weights)):
            lam = (el.points[q, 0], el.points[q, 1], el.points[q, 2])
            bx, by = bubble_gradient(corners, lam[0], lam[1], lam[2])
            strain(x, corners, bx, by, lam[0], lam[1], lam[2], e)
            respond(c, 0.0, e, 0.0, 0.0, s)
            weight = el.weights[q] * el.areas[n]
            J = e[0] * e[3] - e[1] * e[2]
            stress = np.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3])
            size += weight * J
            for a in range(3):
                i = el.triangles[n, a]
                out[0, i] += weight * J * lam[a]
                out[1, i] += weight * stress * lam[a]
                out[2, i] += weight * J * e[4] * lam[a]
        for level in range(len(levels)):
            shares[level] += size * share_below(levels[level], x[4], x[9], x[14])


@njit(error_model="numpy")
def share_below(level: float, a: float, b: float, c: float) -> float:
    """Share of a triangle in which a linear function with the corner values a, b, c is below a level; NaN where there is no level."""
    if np.isnan(level):
        return np.nan
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    if level <= a:
        return 0.0
    if level >= c:
        return 1.0
    if level <= b:
        return (level - a) * (level - a) / ((b - a) * (c - a))
    return 1.0 - (c - level) * (c - level) / ((c - b) * (c - a))


KERNEL = Kernel(sys.modules[__name__], parts=(arrays, laws, equations, transport))
"""The functions above, compiled and kept on disk."""
