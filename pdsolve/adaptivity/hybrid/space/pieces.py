"""Forces and energies of clipped bonds, and of fine nodes on the border.

Pieces are springs between points, which are numbered as the pieces name them, so that what a piece reads was read
shortly before. A point is a node, or moves with up to four.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.arrangement import ENDS
from pdsolve.codegen.clipped_pieces import add_piece
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER


class PieceSprings(NamedTuple):
    """The p pieces between q points, which move with nodes."""

    number: NDArray[np.int64]  # (q,) nodes that move a point
    rows: NDArray[np.int32]  # (q, 4) these nodes
    w: NDArray[np.float64]  # (q, 4) their weights
    ends: NDArray[np.int32]  # (p, 2) points
    direction: NDArray[np.int32]  # (p,) row of xi
    xi: NDArray[np.float64]  # (g, 4) xi, m, 1 / |xi|^2
    k: NDArray[np.float64]  # (p,) stiffness, N/m
    breaks: NDArray[np.float64]  # (p,) least e at which bonds break over that of its own; 0 if it never breaks
    u: NDArray[np.float64]  # (q, 4) room for the displacements of points; the last column is 0
    force: NDArray[np.float64]  # (q, 4) room for their forces


@cached_njit(nogil=True, error_model="numpy")
def sum_pieces(value, pieces, force):  # type: ignore[no-untyped-def]
    """Add the forces of `pieces` on nodes, N, to `force` (n, 3), at displacements `value` (n, 3).

    Returns the largest e of those that could break.
    """
    _put_points(value, pieces)
    largest, (u, sums, xi) = 0.0, (pieces.u, pieces.force, pieces.xi)
    sums[:] = 0
    for n in range(len(pieces.k)):
        i, j, row = np.int64(pieces.ends[n, 0]), np.int64(pieces.ends[n, 1]), np.int64(pieces.direction[n])
        largest = max(largest, pieces.breaks[n] * add_piece(u, sums, xi, i, j, row, pieces.k[n]))
    for q in range(len(pieces.number)):
        for m in range(pieces.number[q]):
            row, share = pieces.rows[q, m], pieces.w[q, m]
            for axis in range(3):
                force[row, axis] += share * sums[q, axis]
    return largest


@njit(**INNER)
def _put_points(value, pieces):  # type: ignore[no-untyped-def]
    """Fill in the displacements of the points."""
    for q in range(len(pieces.number)):
        x = y = z = 0.0
        for m in range(pieces.number[q]):
            row, share = pieces.rows[q, m], pieces.w[q, m]
            x, y, z = x + share * value[row, 0], y + share * value[row, 1], z + share * value[row, 2]
        pieces.u[q, 0], pieces.u[q, 1], pieces.u[q, 2] = x, y, z


@cached_njit(nogil=True, error_model="numpy")
def hold_pieces(value, pieces, held):  # type: ignore[no-untyped-def]
    """Add the energies of pieces, J, to `held` (n,), half to each end."""
    _put_points(value, pieces)
    energy, u = pieces.force, pieces.u
    energy[:] = 0
    for n in range(len(pieces.k)):
        i, j, row, e = pieces.ends[n, 0], pieces.ends[n, 1], pieces.xi[pieces.direction[n]], 0.0
        for axis in range(3):
            eta = u[j, axis] - u[i, axis]
            e += row[3] * eta * (2 * row[axis] + eta)
        stretch = e / (np.sqrt(1 + e) + 1)
        found = pieces.k[n] / row[3] * stretch * stretch / 4
        energy[i, 0] += found
        energy[j, 0] += found
    for q in range(len(pieces.number)):
        for m in range(pieces.number[q]):
            held[pieces.rows[q, m]] += pieces.w[q, m] * energy[q, 0]


@cached_njit(nogil=True)
def place(rows, sites, value, u):  # type: ignore[no-untyped-def]
    """Displacements of the nodes `rows` (k,) to their sites (k,) of u (3, m)."""
    for n in range(len(rows)):
        for axis in range(3):
            u[axis, sites[n]] = value[rows[n], axis]


@cached_njit(nogil=True)
def follow(sites, rows, w, value, u):  # type: ignore[no-untyped-def]
    """Displacements of the nodes on the border (b,) to their sites of u (3, m), from those of nodes `rows` (b, 4)."""
    for n in range(len(sites)):
        for axis in range(3):
            found = 0.0
            for m in range(ENDS):
                found += w[n, m] * value[rows[n, m], axis]
            u[axis, sites[n]] = found


@cached_njit(nogil=True)
def pass_on(border, rows, w, volume, force):  # type: ignore[no-untyped-def]
    """Pass what is on the border (b, ...) per volume (b,), m^3, on to the nodes `rows` (b, 4) of `force`."""
    for n in range(len(rows)):
        for m in range(ENDS):
            share = w[n, m] * volume[n]
            if share != 0:
                for axis in range(force.shape[1]):
                    force[rows[n, m], axis] += share * border[n, axis]
