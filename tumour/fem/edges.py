"""What acts on the edges of the surface, compiled: dead traction, follower pressure, springs, membranes and influx.

Per length at rest, with the outward unit normal N,

    P N = t - k d - k_n (d . N) N - load J F^-T N,      A^T k A grad C . N / J = l (influx + h (C_beyond - C)),      l = |J F^-T N|

On an edge the bubbles vanish and the rest is linear, so that ``J F^-T N`` times its length is the edge as it is, turned by -90 degrees, and
all integrals are exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from tumour.fem.arrays import FIELDS, Edges, Elements, Pattern
from tumour.fem.assembly import add_to_rows


@njit(error_model="numpy")
def edge_now(el: Elements, edges: Edges, i: int, nodal: Any) -> tuple[int, int, float, float]:
    """The ends of an edge, and the vector from one to the other in the body as it is."""
    corners = el.triangles[edges.triangles[i]]
    a, b = corners[edges.first[i]], corners[edges.second[i]]
    length = edges.lengths[i]
    x = nodal[b, 0] - nodal[a, 0] - length * edges.normals[i, 1]
    y = nodal[b, 1] - nodal[a, 1] + length * edges.normals[i, 0]
    return a, b, x, y


@njit(error_model="numpy")
def add_edges(el: Elements, edges: Edges, actions: Any, nodal: Any, R: Any) -> None:
    """Add what acts on the edges of the surface to the residual: less the traction, and less the influx of oxygen."""
    for i in range(len(edges.triangles)):
        a, b, x, y = edge_now(el, edges, i, nodal)
        length, k, k_n = edges.lengths[i], edges.springs[i, 0], edges.springs[i, 1]
        nx, ny = edges.normals[i, 0], edges.normals[i, 1]
        push = 0.5 * actions[i, 2]
        fx, fy = push * y - 0.5 * length * actions[i, 0], -push * x - 0.5 * length * actions[i, 1]
        now = np.sqrt(x * x + y * y)
        for own, other in ((a, b), (b, a)):
            ux = (2.0 * nodal[own, 0] + nodal[other, 0]) * length / 6.0
            uy = (2.0 * nodal[own, 1] + nodal[other, 1]) * length / 6.0
            out = k_n * (ux * nx + uy * ny)
            C = (2.0 * nodal[own, 4] + nodal[other, 4]) / 6.0
            R[own, 0] += fx + k * ux + out * nx
            R[own, 1] += fy + k * uy + out * ny
            R[own, 4] -= now * (0.5 * actions[i, 3] + edges.membranes[i] * (0.5 * actions[i, 4] - C))


@njit(error_model="numpy")
def add_edge_slopes(el: Elements, edges: Edges, actions: Any, nodal: Any, pattern: Pattern, K: Any, values: Any) -> None:
    """Add the derivatives of what `add_edges` adds to the values of the matrix; K is room for those of a triangle, (15, 15) and more."""
    for i in range(len(edges.triangles)):
        a, b, x, y = edge_now(el, edges, i, nodal)
        n, k, k_n = edges.triangles[i], edges.springs[i, 0], edges.springs[i, 1]
        normal, push = edges.normals[i], 0.5 * actions[i, 2]
        now = np.sqrt(x * x + y * y)
        K[:, :] = 0.0
        for own, other in ((0, 1), (1, 0)):
            at = FIELDS * (edges.first[i] if own == 0 else edges.second[i])
            C = (2.0 * nodal[a if own == 0 else b, 4] + nodal[a if other == 0 else b, 4]) / 6.0
            into = 0.5 * actions[i, 3] + edges.membranes[i] * (0.5 * actions[i, 4] - C)
            for end in range(2):
                to = FIELDS * (edges.first[i] if end == 0 else edges.second[i])
                share = edges.lengths[i] / (3.0 if end == own else 6.0)
                away = -1.0 if end == 0 else 1.0  # d(x, y) by the displacement of this end
                K[at, to + 1] += push * away
                K[at + 1, to] -= push * away
                for j in range(2):
                    K[at + j, to + j] += k * share
                    for l in range(2):
                        K[at + j, to + l] += k_n * share * normal[j] * normal[l]
                K[at + 4, to] -= into * away * x / now
                K[at + 4, to + 1] -= into * away * y / now
                K[at + 4, to + 4] += now * edges.membranes[i] / (3.0 if end == own else 6.0)
        add_to_rows(el.triangles[n], pattern.pairs[n], pattern, K, values)
