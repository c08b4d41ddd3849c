r"""The elastic tumour on triangles: residual and tangent of all elements, compiled.

Total Lagrangian, (2.22). On the triangles of the body at rest the displacement d is in the MINI element (linear, with a cubic bubble in
each triangle) and alpha, p, C are continuous and linear. With ``F = I + grad d``, ``J = det F`` and a step of size tau from a past whose
moments are known, the discrete equations are, for all test functions v and phi,

    momentum   (P, grad v) = <traction, v>
    cells      (alpha J, phi) - tau (J q_alpha, phi) = past moment of alpha J
    fluid      (J, phi) + tau (M J F^-1 k F^-T grad p, grad phi) = past moment of J
    oxygen     (J F^-1 k F^-T grad C, grad phi) + (J w U(alpha, C), phi) = <influx, phi>

Everything is integrated by the rule of six points that is exact to degree four. `tumour.fem.point` gives, at one of them, what stands next
to the test functions and their gradients, with all derivatives; the rest is sums. `tumour.fem.edges` adds the right-hand sides.
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
from tumour.fem import arrays, assembly, point
from tumour.fem import edges as edge_sums
from tumour.fem.arrays import LOCAL, PERMEABILITY, ROWS, Data, Edges, Elements, Pattern
from tumour.fem.assembly import add_condensed, add_to_rows, condense, gather
from tumour.fem.edges import add_edge_slopes, add_edges
from tumour.fem.point import conducted, respond, respond_slopes


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
    edges: Edges,
    actions: Any,
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
            respond(c, c.stride * (n * len(el.weights) + q), tau, e, past[q, 0], past[q, 1], s)
            weight = el.weights[q] * el.areas[n]
            for i in range(ROWS):
                s[i] *= weight
            add_response(corners, bx, by, lam, s, r)
        add_condensed(el.triangles[n], r, bubble_loads[n], kept[n], R, r_bubbles[n])
    add_edges(el, edges, actions, nodal, R)
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
        respond(c, c.stride * (n * len(el.weights) + q), tau, e, past[q, 0], past[q, 1], s)
        respond_slopes(c, c.stride * (n * len(el.weights) + q), tau, e, past[q, 0], past[q, 1], s, D)
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
    edges: Edges,
    actions: Any,
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
    add_edges(el, edges, actions, nodal, R)
    add_edge_slopes(el, edges, actions, nodal, pattern, K, values)
    return -1


@njit(error_model="numpy")
def moments(c: Data, el: Elements, nodal: Any, bubbles: Any, out: Any) -> None:
    """Moments with the shape functions of alpha J, J and J q_alpha, and with their gradients of the fluid's flow, (4, points)."""
    x, e = np.empty(LOCAL), np.empty(ROWS)
    out[:, :] = 0.0
    for n in range(len(el.areas)):
        gather(el, nodal, bubbles, n, x)
        corners = el.gradients[n]
        for q in range(len(el.weights)):
            lam = (el.points[q, 0], el.points[q, 1], el.points[q, 2])
            bx, by = bubble_gradient(corners, lam[0], lam[1], lam[2])
            strain(x, corners, bx, by, lam[0], lam[1], lam[2], e)
            weight = el.weights[q] * el.areas[n]
            ratio = e[0] * e[3] - e[1] * e[2]
            flow = 0.0 if c.kappa == 0.0 else law.mobility(e[4], c.kappa, c.law, c.floor) / ratio
            fx, fy = conducted(c, c.stride * (n * len(el.weights) + q), PERMEABILITY, flow, e, 7)
            J = ratio * weight
            born = J * law.net_growth(e[4], e[6], c.s1, c.s2, c.s3, c.s4)
            for a in range(3):
                i = el.triangles[n, a]
                out[0, i] += e[4] * J * lam[a]
                out[1, i] += J * lam[a]
                out[2, i] += born * lam[a]
                out[3, i] += weight * (fx * corners[a, 0] + fy * corners[a, 1])


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
            respond(c, c.stride * (n * len(el.weights) + q), 0.0, e, 0.0, 0.0, s)
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


KERNEL = Kernel(sys.modules[__name__], assembly, point, edge_sums, parts=(arrays, laws, equations, transport))
"""The functions above, compiled and kept on disk."""
