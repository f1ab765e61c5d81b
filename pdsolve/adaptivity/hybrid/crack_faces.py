"""Cracks through coarse cells that were fine: all of it follows from the bits of fine bonds that have broken.

A coarse spring is cut where the fine bond between the same two nodes has broken. The nine fine nodes of a cell are
joined by intact bonds to their next ones; what a node has belongs to the corners that it is joined to.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.lattice import coarse_column, coarse_row, fine_place
from pdsolve.adaptivity.hybrid.precracks import has_bond
from pdsolve.operators.simd_lattice.kernel import INNER

EAST, NORTHEAST, NORTH, NORTHWEST = range(4)  # of the first four springs of a coarse node
HALF, WHOLE = 0, 1  # rows of `LatticeConstants.alike`
ALL = 511  # of nine nodes
CORNERS = 1 << 0 | 1 << 2 | 1 << 6 | 1 << 8
NEAR, FAR = 0.75, 0.25  # share of an edge at which a crack beyond its middle cuts it, and one before


@njit(forceinline=True, **INNER)
def has_broken(ground, lost, p, which):  # type: ignore[no-untyped-def]
    """Whether the fine bond like coarse spring `which` of the coarse node on fine place p has broken."""
    return (lost[p] >> np.uint64(ground.alike[WHOLE, which])) & np.uint64(1) != 0


@njit(**INNER)
def is_cut(ground, lost, x, y):  # type: ignore[no-untyped-def]
    """Whether a fine bond like a spring of cell x, y has broken."""
    at = ground.at
    p = fine_place(at, 2 * x, 2 * y)
    up, right = p + 2 * at.stride, p + 2
    if lost[p] == 0 and lost[up] == 0 and lost[right] == 0:
        return False
    found = has_broken(ground, lost, p, EAST) or has_broken(ground, lost, up, EAST)
    found = found or has_broken(ground, lost, p, NORTH) or has_broken(ground, lost, right, NORTH)
    return found or has_broken(ground, lost, p, NORTHEAST) or has_broken(ground, lost, right, NORTHWEST)


@njit(**INNER)
def cut_at(ground, lost, direction, q):  # type: ignore[no-untyped-def]
    """Where the coarse edge from q to the east (0) or north (1) is cut, as a share of it; 0: nowhere.

    A crack cuts it on that side of its middle node on which this has fewer intact bonds.
    """
    cut, at = ground.edge_cut[direction, q], ground.at
    if cut > 0:
        return cut
    p = fine_place(at, 2 * coarse_column(at, q), 2 * coarse_row(at, q))
    if not has_broken(ground, lost, p, NORTH if direction else EAST):
        return 0.0
    middle, before, after = p + (at.stride if direction else 1), 0, 0
    for k in range(len(ground.ways)):
        along = ground.dy[k] if direction else ground.dx[k]
        if along != 0 and has_bond(ground, lost, middle, k):
            before += along < 0
            after += along > 0
    return NEAR if before >= after else FAR


@njit(**INNER)
def joined_to(ground, lost, x, y, n):  # type: ignore[no-untyped-def]
    """A bit for each of the nine nodes (3 y + x) of a cell that node n is joined to; all, if no crack cuts the cell."""
    at, found, before = ground.at, 1 << n, 0
    if not is_cut(ground, lost, x, y):
        return ALL
    while found != before:
        before = found
        for m in range(9):
            i, j = m % 3, m // 3
            p = fine_place(at, 2 * x + i, 2 * y + j)
            for which in range(4):
                dx, dy = ground.coarse_dx[which], ground.coarse_dy[which]
                both = 1 << m | 1 << (m + 3 * dy + dx)
                inside = 0 <= i + dx <= 2 and j + dy <= 2
                if inside and found & both and has_bond(ground, lost, p, ground.alike[HALF, which]):
                    found |= both
    return found


@njit(**INNER)
def any_near(ground, lost, p, reach):  # type: ignore[no-untyped-def]
    """Whether a bond has broken whose owner is within `reach` of a fine node along both axes."""
    for row in range(p - reach * ground.at.stride, p + reach * ground.at.stride + 1, ground.at.stride):
        for j in range(row - reach, row + reach + 1):
            if lost[j] != 0:
                return True
    return False


@njit(**INNER)
def bridges(ground, lost, p, k):  # type: ignore[no-untyped-def]
    """Whether bond k of fine node p joins two faces of a crack: none of short bonds joins its ends around it."""
    dx, dy = ground.dx[k], ground.dy[k]
    margin = 2 if (abs(dx) + 5) * (abs(dy) + 5) <= 64 else 1
    wide, high = abs(dx) + 1 + 2 * margin, abs(dy) + 1 + 2 * margin
    i0, j0 = margin - min(dx, 0), margin - min(dy, 0)  # of p
    corner = p - j0 * ground.at.stride - i0
    found, before = np.uint64(1) << np.uint64(j0 * wide + i0), np.uint64(0)
    end = np.uint64(1) << np.uint64((j0 + dy) * wide + i0 + dx)
    while found != before and found & end == 0:
        before = found
        for n in range(wide * high):
            i, j = n % wide, n // wide
            for which in range(4):
                to_i, to_j = i + ground.coarse_dx[which], j + ground.coarse_dy[which]
                if not (0 <= to_i < wide and to_j < high):
                    continue
                both = np.uint64(1) << np.uint64(n) | np.uint64(1) << np.uint64(to_j * wide + to_i)
                one_of = found & both
                if one_of == 0 or one_of == both:
                    continue
                if has_bond(ground, lost, corner + j * ground.at.stride + i, ground.alike[HALF, which]):
                    found |= both
    return found & end == 0


@njit(**INNER)
def share(joined, n, corner):  # type: ignore[no-untyped-def]
    """Share of node n (3 y + x) of a cell in what a corner (2 y + x) has, where n is `joined` to these nodes.

    Shares are those of bilinear interpolation, of the corners that n is joined to; of all, if it is joined to none.
    """
    if joined & CORNERS == 0:
        joined = ALL
    if (joined >> _node_at(corner)) & 1 == 0:
        return 0.0
    total, count = 0.0, 0
    for other in range(4):
        if (joined >> _node_at(other)) & 1:
            total += _weight(n, other)
            count += 1
    return _weight(n, corner) / total if total > 0 else 1 / count  # joined to corners beyond the next ones alone


@njit(forceinline=True, **INNER)
def _weight(n, corner):  # type: ignore[no-untyped-def]
    """Bilinear weight of a corner of a cell at node n."""
    wx, wy = n % 3 / 2, n // 3 / 2
    return (wx if corner % 2 else 1 - wx) * (wy if corner // 2 else 1 - wy)


@njit(forceinline=True, **INNER)
def _node_at(corner):  # type: ignore[no-untyped-def]
    """Which of the nine nodes of a cell a corner is."""
    return 6 * (corner // 2) + 2 * (corner % 2)
