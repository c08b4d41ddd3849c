"""What the element kernels work on: numbers of unknowns, constants of a scene, triangles, and the pattern of the matrix."""

from __future__ import annotations

from typing import Any, NamedTuple

Array = Any

FIELDS = 5
"""Unknowns of a point: d_x, d_y, alpha, p, C."""
OUTER, LOCAL = 15, 17
"""Unknowns of a triangle without and with its bubble."""
KEPT = 4 + 2 * OUTER + 2 * OUTER
"""Numbers kept of each bubble: K_bb^-1, K_bb^-1 K_bX, K_Xb K_bb^-1."""
ROWS = 11
"""Rows of a point's response: what stands next to v_x,X  v_x,Y  v_y,X  v_y,Y (4), phi of the cells, phi and grad phi of the fluid, phi
and grad phi of the oxygen."""


STIFFNESS, PERMEABILITY, DIFFUSIVITY, CONSUMPTION, FIBRE, PUSH, REINFORCEMENT = 0, 1, 4, 7, 8, 10, 11
"""Where a row of tissue has the factor on both moduli; permeability and diffusivity (xx, yy, xy each); the factor on the uptake; the
direction of the fibres (two); the push along them over that across, less 1; their stiffness."""
COEFFICIENTS = 12
"""Numbers in a row of tissue."""


class Data(NamedTuple):
    """What the kernel needs of one scene: constants, and what varies with the place.

    Attributes
    ----------
    tissue : (rows, COEFFICIENTS) array
        One row for all of the body, or one for each quadrature point of each triangle.
    stride : int
        0 with one row, else 1.
    tensors, fibres : bool
        Whether any permeability or diffusivity has a direction; whether there are fibres that push or resist.
    """

    mu: float
    lam: float
    gamma: float
    alpha_star: float
    alpha_min: float
    sigma_width: float
    s1: float
    s2: float
    s3: float
    s4: float
    Q: float
    Q1_hat: float
    kappa: float
    law: int
    floor: float
    printed: bool
    tissue: Array
    stride: int
    tensors: bool
    fibres: bool


class Pattern(NamedTuple):
    """Where the entries of the matrix are: compressed rows over the unknowns that are not prescribed.

    Attributes
    ----------
    start : (points, 5) array of int
        Where the row of an unknown begins among the values; -1 for a prescribed one.
    pairs : (elements, 9) array of int
        Where in the rows of its point a the columns of the point b begin, at 3 a + b.
    rank : (points, 5) array of int
        Place of an unknown among those of its point that are not prescribed; -1 for a prescribed one.
    """

    start: Array
    pairs: Array
    rank: Array


class Elements(NamedTuple):
    """The triangles and the quadrature rule.

    Attributes
    ----------
    triangles : (elements, 3) array of int
    gradients : (elements, 3, 2) array
        Gradients of the linear shape functions.
    areas : (elements,) array
    points, weights : (6, 3), (6,) arrays
        Barycentric coordinates, and weights that add up to one.
    """

    triangles: Array
    gradients: Array
    areas: Array
    points: Array
    weights: Array


class Edges(NamedTuple):
    """The edges of the surface on which something acts that needs an integral.

    Attributes
    ----------
    triangles, first, second : (edges,) arrays of int
        The triangle of an edge, and which of its corners are its ends, with the body on the left on the way from the first to the second.
    lengths : (edges,) array
        At rest.
    normals : (edges, 2) array
        Outward unit normals at rest.
    springs : (edges, 2) array
        Spring per length at rest, in all directions and along the normal alone.
    membranes : (edges,) array
        Permeability to oxygen of a membrane, per length now; 0 without one.
    """

    triangles: Array
    first: Array
    second: Array
    lengths: Array
    normals: Array
    springs: Array
    membranes: Array


ACTIONS = 5
"""What acts on an edge at a time: dead traction in x and y, follower pressure, influx of oxygen, oxygen beyond the membrane."""
