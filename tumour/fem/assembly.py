"""From the unknowns of a mesh to those of a triangle and back into vectors and the matrix, compiled; and the bubbles between.

Unknowns of a triangle: d_x, d_y, alpha, p, C of its first, second and third point, then the two of its bubble. The bubble is condensed:
with the element's tangent in blocks, ``K_XX - K_Xb K_bb^-1 K_bX`` goes to the matrix; ``K_bb^-1``, ``K_bb^-1 K_bX`` and ``K_Xb K_bb^-1``
are kept, and the bubble's change follows from that of the others. An iteration with an old tangent takes the old tangent's blocks.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from tumour.fem.arrays import FIELDS, OUTER, Elements, Pattern


@njit(error_model="numpy")
def gather(el: Elements, nodal: Any, bubbles: Any, n: int, x: Any) -> None:
    """The unknowns of the triangle n."""
    for a in range(3):
        for k in range(FIELDS):
            x[FIELDS * a + k] = nodal[el.triangles[n, a], k]
    x[15], x[16] = bubbles[n, 0], bubbles[n, 1]


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
def add_condensed(corners: Any, r: Any, bubble_load: Any, kept: Any, R: Any, r_bubble: Any) -> None:
    """Add the element's residual r, its bubble condensed with the blocks `kept`, to that of the points; keep the bubble's own."""
    b0, b1 = r[15] - bubble_load[0], r[16] - bubble_load[1]
    r_bubble[0], r_bubble[1] = b0, b1
    for a in range(3):
        for k in range(FIELDS):
            row = FIELDS * a + k
            R[corners[a], k] += r[row] - kept[34 + row] * b0 - kept[49 + row] * b1


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
