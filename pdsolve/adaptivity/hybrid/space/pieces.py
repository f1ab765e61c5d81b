"""Forces and energies of clipped bonds, and of fine nodes on the border."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.space.arrangement import ENDS
from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER


@njit(forceinline=True, **INNER)
def _eta(value, rows, n, w, ends):  # type: ignore[no-untyped-def]
    """The displacement of a piece's second end less that of its first, m; `ends` nodes move them by weights w (8,)."""
    x = y = z = 0.0
    for m in range(ENDS, ENDS + ends[1]):
        row, share = rows[n, m], w[m]
        x, y, z = x + share * value[row, 0], y + share * value[row, 1], z + share * value[row, 2]
    for m in range(ends[0]):
        row, share = rows[n, m], w[m]
        x, y, z = x - share * value[row, 0], y - share * value[row, 1], z - share * value[row, 2]
    return x, y, z


@cached_njit(nogil=True, error_model="numpy")
def sum_pieces(value, rows, k, breaks, groups, force):  # type: ignore[no-untyped-def]
    """Add the forces of pieces (p,) on nodes, N, to `force` (n, 3), at displacements `value` (n, 3).

    `rows` (p, 8) are the nodes that move their ends. Returns the largest e of those that could break.
    """
    largest = 0.0
    for g in range(len(groups.ends)):
        x, y, z, inverse = groups.xi[g]
        w, ends = groups.w[g], (groups.ends[g, 0], groups.ends[g, 1])
        for n in range(groups.start[g], groups.start[g + 1]):
            ex, ey, ez = _eta(value, rows, n, w, ends)
            e = inverse * (2 * (x * ex + y * ey + z * ez) + (ex * ex + ey * ey + ez * ez))
            largest = max(largest, e * breaks[n])
            pull = k[n] * e / (1 + e + np.sqrt(1 + e))
            fx, fy, fz = pull * (x + ex), pull * (y + ey), pull * (z + ez)
            for m in range(ends[0]):
                _push(force, rows[n, m], w[m], fx, fy, fz)
            for m in range(ENDS, ENDS + ends[1]):
                _push(force, rows[n, m], -w[m], fx, fy, fz)
    return largest


@njit(forceinline=True, **INNER)
def _push(force, row, share, fx, fy, fz):  # type: ignore[no-untyped-def]
    force[row, 0] += share * fx
    force[row, 1] += share * fy
    force[row, 2] += share * fz


@cached_njit(nogil=True, error_model="numpy")
def hold_pieces(value, rows, k, groups, held):  # type: ignore[no-untyped-def]
    """Add the energies of pieces, J, to `held` (n,), half to each end."""
    for g in range(len(groups.ends)):
        for n in range(groups.start[g], groups.start[g + 1]):
            eta, e = _eta(value, rows, n, groups.w[g], (groups.ends[g, 0], groups.ends[g, 1])), 0.0
            for axis in range(3):
                e += groups.xi[g, 3] * eta[axis] * (2 * groups.xi[g, axis] + eta[axis])
            stretch = e / (np.sqrt(1 + e) + 1)
            energy = k[n] / groups.xi[g, 3] * stretch * stretch / 4
            for end in range(2):
                for m in range(ENDS * end, ENDS * end + groups.ends[g, end]):
                    held[rows[n, m]] += groups.w[g, m] * energy


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
