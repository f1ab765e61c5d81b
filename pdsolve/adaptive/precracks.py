"""What pre-cracks cut: fine bonds, coarse bonds, edges of cells; and what is lacking at surfaces and faces."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptive.lattice import cell_place, coarse_place, fine_place, inside, share
from pdsolve.operators.blocks.kernel import INNER

SLACK = 1e-6  # of a spacing: pre-cracks are that much longer at both ends, as in pdmesh.model.visibility


def lengthened(cracks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Segments (k, 4) in spacings, a little longer at both ends."""
    way = cracks[:, 2:] - cracks[:, :2]
    more = SLACK * way / np.maximum(np.hypot(*way.T), SLACK)[:, None]
    return np.ascontiguousarray(cracks + np.column_stack([-more, more]))


@njit(**INNER)
def turn(ax, ay, bx, by, cx, cy):  # type: ignore[no-untyped-def]
    """Twice the area of a triangle, with the sign of its sense."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@njit(**INNER)
def crosses(cracks, j, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Whether pre-crack j meets the segment from a to b, in fine spacings."""
    px, py, qx, qy = cracks[j, 0], cracks[j, 1], cracks[j, 2], cracks[j, 3]
    one, other = turn(px, py, qx, qy, ax, ay), turn(px, py, qx, qy, bx, by)
    if one * other > 0:
        return False
    return turn(ax, ay, bx, by, px, py) * turn(ax, ay, bx, by, qx, qy) <= 0


@njit(**INNER)
def seen(cracks, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Whether no pre-crack parts two places."""
    found = True
    for j in range(len(cracks)):
        found &= not crosses(cracks, j, ax, ay, bx, by)
    return found


@njit(cache=True, error_model="numpy")
def begin_bits(ground, bits):  # type: ignore[no-untyped-def]
    """Set the bits of all fine bonds inside the plate that no pre-crack cuts. Once."""
    _set_bits(ground, bits)
    half = len(ground.dx) // 2
    for j in range(len(ground.cracks)):
        x0, y0, x1, y1 = _box(ground, j, ground.reach, ground.at.nx, ground.at.ny)
        for iy in range(y0, y1 + 1):
            for ix in range(x0, x1 + 1):
                for k in range(half):
                    if crosses(ground.cracks, j, ix, iy, ix + ground.dx[k], iy + ground.dy[k]):
                        bits[fine_place(ground.at, ix, iy)] &= ~(np.uint64(1) << np.uint64(k))


@njit(**INNER)
def _set_bits(ground, bits):  # type: ignore[no-untyped-def]
    """Those of all bonds inside the plate."""
    at, half = ground.at, len(ground.dx) // 2
    every = np.uint64(0)
    for k in range(half):
        every |= np.uint64(1) << np.uint64(k)
    for iy in range(at.ny + 1):
        for ix in range(at.nx + 1):
            p = fine_place(at, ix, iy)
            if ground.reach <= ix <= at.nx - ground.reach and iy <= at.ny - ground.reach:
                bits[p] = every
                continue
            for k in range(half):
                if inside(at, ix + ground.dx[k], iy + ground.dy[k]):
                    bits[p] |= np.uint64(1) << np.uint64(k)


@njit(**INNER)
def _box(ground, j, margin, most_x, most_y):  # type: ignore[no-untyped-def]
    """Columns and rows around pre-crack j that are in a plate of so many."""
    px, py, qx, qy = ground.cracks[j, 0], ground.cracks[j, 1], ground.cracks[j, 2], ground.cracks[j, 3]
    x0, x1 = max(0, int(np.floor(min(px, qx))) - margin), min(most_x, int(np.ceil(max(px, qx))) + margin)
    y0, y1 = max(0, int(np.floor(min(py, qy))) - margin), min(most_y, int(np.ceil(max(py, qy))) + margin)
    return x0, y0, x1, y1


@njit(cache=True, error_model="numpy")
def begin_coarse(ground):  # type: ignore[no-untyped-def]
    """Note the coarse bonds and the edges of cells that pre-cracks cut, and the cells they cross."""
    at = ground.at
    for j in range(len(ground.cracks)):
        x0, y0, x1, y1 = _box(ground, j, 3, at.nx, at.ny)
        px, py, qx, qy = ground.cracks[j, 0], ground.cracks[j, 1], ground.cracks[j, 2], ground.cracks[j, 3]
        for y in range(y0 // 2, y1 // 2 + 1):
            for x in range(x0 // 2, x1 // 2 + 1):
                q, ax, ay = coarse_place(at, x, y), 2.0 * x, 2.0 * y
                for k in range(4):
                    bx, by = ax + 2 * ground.coarse_dx[k], ay + 2 * ground.coarse_dy[k]
                    if not crosses(ground.cracks, j, ax, ay, bx, by):
                        continue
                    ground.coarse_bits[q] |= np.uint8(1 << k)
                    if k in (0, 2):
                        one, other = turn(px, py, qx, qy, ax, ay), turn(px, py, qx, qy, bx, by)
                        ground.edge_cut[k // 2, q] = one / (one - other) if one != other else 0.5
                if x >= at.nx // 2 or y >= at.ny // 2:
                    continue
                diagonals = crosses(ground.cracks, j, ax, ay, ax + 2, ay + 2) or crosses(
                    ground.cracks, j, ax + 2, ay, ax, ay + 2
                )
                if (
                    diagonals
                    or (ax <= px <= ax + 2 and ay <= py <= ay + 2)
                    or (ax <= qx <= ax + 2 and ay <= qy <= ay + 2)
                ):
                    ground.cut_cells[cell_place(at, x, y)] = True


@njit(cache=True, error_model="numpy")
def begin_lack(ground, bits):  # type: ignore[no-untyped-def]
    """Note how much less than others the nodes at surfaces and faces hold, in stretching along x and along y."""
    at, reach = ground.at, ground.reach
    for iy in range(at.ny + 1):
        for ix in range(at.nx + 1):
            if reach < ix < at.nx - reach and reach < iy < at.ny - reach:
                continue
            _lack_of(ground, bits, ix, iy)
    for j in range(len(ground.cracks)):
        x0, y0, x1, y1 = _box(ground, j, reach, at.nx, at.ny)
        for iy in range(y0, y1 + 1):
            for ix in range(x0, x1 + 1):
                _lack_of(ground, bits, ix, iy)


@njit(**INNER)
def _lack_of(ground, bits, ix, iy):  # type: ignore[no-untyped-def]
    at, p = ground.at, fine_place(ground.at, ix, iy)
    held_x, held_y, half = 0.0, 0.0, len(ground.dx) // 2
    for k in range(2 * half):
        jx, jy = ix + ground.dx[k], iy + ground.dy[k]
        if inside(at, jx, jy) and has_bond(bits, ground.ways, half, p, k):
            x, y, inverse = ground.table[k, 0], ground.table[k, 1], ground.table[k, 4]
            energy = ground.table[k, 5] / inverse * share(at, jx, jy) / 2
            held_x += energy * (x * x * inverse) ** 2
            held_y += energy * (y * y * inverse) ** 2
    full = ground.c11 * ground.h**2
    for axis, held in enumerate((held_x, held_y)):
        lack = full / held - 1 if held > 0 else 0.0
        ground.lack[axis, p] = lack if abs(lack) > 1e-12 else 0.0


@njit(forceinline=True, **INNER)
def has_bond(bits, ways, half, p, k):  # type: ignore[no-untyped-def]
    """Whether bond k of fine node p is intact."""
    if k < half:
        return (bits[p] >> np.uint64(k)) & np.uint64(1) != 0
    return (bits[p + ways[k]] >> np.uint64(k - half)) & np.uint64(1) != 0


@njit(forceinline=True, **INNER)
def stiffness(ground, p, ix, iy, k):  # type: ignore[no-untyped-def]
    """That of a whole bond: shares of both cells and the correction of surfaces included."""
    at, other = ground.at, p + ground.ways[k]
    whole = ground.table[k, 5] * share(at, ix, iy) * share(at, ix + ground.dx[k], iy + ground.dy[k])
    lack_x, lack_y = ground.lack[0, p] + ground.lack[0, other], ground.lack[1, p] + ground.lack[1, other]
    if lack_x == 0 and lack_y == 0:
        return whole
    x, y, inverse = ground.table[k, 0], ground.table[k, 1], ground.table[k, 4]
    mean_x, mean_y = 1 + lack_x / 2, 1 + lack_y / 2
    return whole / np.sqrt(x * x * inverse / mean_x**2 + y * y * inverse / mean_y**2)


@njit(cache=True, error_model="numpy")
def stiffest(ground, bits):  # type: ignore[no-untyped-def]
    """The largest eigenvalue of sum k n n^T over the share of a node's cell, N/m^2."""
    at, half, most, seen_whole = ground.at, len(ground.dx) // 2, 0.0, False
    for iy in range(at.ny + 1):
        for ix in range(at.nx + 1):
            p = fine_place(at, ix, iy)
            if ground.lack[0, p] == 0 and ground.lack[1, p] == 0:
                if seen_whole:
                    continue
                seen_whole = True
            a, b, c = 0.0, 0.0, 0.0
            for k in range(2 * half):
                if inside(at, ix + ground.dx[k], iy + ground.dy[k]) and has_bond(bits, ground.ways, half, p, k):
                    x, y, inverse = ground.table[k, 0], ground.table[k, 1], ground.table[k, 4]
                    spring = stiffness(ground, p, ix, iy, k) * inverse / share(at, ix, iy)
                    a, b, c = a + spring * x * x, b + spring * y * y, c + spring * x * y
            most = max(most, (a + b) / 2 + np.hypot((a - b) / 2, c))
    return most
