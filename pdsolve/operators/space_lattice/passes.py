"""Two passes over families in tiles, for laws whose passes are tuples: nodal sums, then bond forces.

Tiles, slots, lanes and bits are those of `kernel`, but a tile lies in one row of the lattice. What a bond has besides
its reference vector is stored for rows of sites, which share it where they are alike; that of the bond the other way
is its neighbour's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same, where_above, which_above
from pdsolve.codegen.pull import NARROW
from pdsolve.codegen.tile_lanes import bonded, fused, magnitude, stretched
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.bond_arrays import Bond
from pdsolve.laws.calls import accumulate, bond_force, finish_sums, initial_sums, margin
from pdsolve.laws.small_tensors import blank, summed
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.operators.simd_lattice.passes import COLUMNS, NODAL, OWN, SAFE, VECTORS

LENGTH, SHORT = 6, 7  # of a vector: where |xi| and 1 / |xi| are


class FamilyTiles(NamedTuple):
    """Bonds in t tiles with k offsets, m sites; l lines of w places, q numbers a bond."""

    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    rows: NDArray[np.int32]  # (k,) and from a row to that of its neighbour
    ahead: NDArray[np.int32]  # (k,) and along the row
    vectors: NDArray[np.floating]  # (k, 8) xi, 2 xi / |xi|^2, |xi|, 1 / |xi|
    inverse: NDArray[np.floating]  # (k,) 1 / |xi|^2
    bits: NDArray[np.uint16]  # (t, k) lanes with an intact bond
    filled: NDArray[np.bool_]  # (t,) whether there is a node
    lines: NDArray[np.int32]  # (.,) of each row, those of the margins included
    numbers: NDArray[np.floating]  # (q, l k w) of bonds over the neighbour's volume, 0 without a bond
    volume: NDArray[np.floating]  # (1, m) over h^3
    wide: int  # w
    pad: int  # places of a line before its first site
    across: int  # tiles in a row
    margin: int  # sites before the first
    beyond: int  # rows before the first


@njit(forceinline=True, **INNER)
def _place(tiles, t, slot, lane):  # type: ignore[no-untyped-def]
    """Where the numbers of a tile's bonds are, and those of the bonds the other way."""
    row, x = tiles.beyond + t // tiles.across, tiles.pad + t % tiles.across * ROW + lane
    count = len(tiles.offsets)
    place = (np.int64(tiles.lines[row]) * count + slot) * tiles.wide + x
    neighbour_line = np.int64(tiles.lines[row + tiles.rows[slot]])
    return place, (neighbour_line * count + count - 1 - slot) * tiles.wide + x + tiles.ahead[slot]


def _numbers(tiles: Any, t: Any, slot: Any, lane: Any, u: Any, like: Any) -> Any:
    """Numbers of the bonds of some lanes: each of this way, then of the other."""


@overload(_numbers, jit_options=INNER | {"forceinline": True})
def _numbers_of(tiles, t, slot, lane, u, like):  # type: ignore[no-untyped-def]
    return _two if len(like) == 2 else _three


def _two(tiles, t, slot, lane, u, like):  # type: ignore[no-untyped-def]
    place, reverse_place = _place(tiles, t, slot, lane)
    (size,) = beside(tiles.volume, (0,), tiles.margin + t * ROW + lane + tiles.offsets[slot])
    a, b = beside(tiles.numbers, (0, 0), place), beside(tiles.numbers, (0, 0), reverse_place)
    return bonded((a[0] * size, b[0] * size, a[1] * size, b[1] * size), tiles.bits, t, slot, lane)


def _three(tiles, t, slot, lane, u, like):  # type: ignore[no-untyped-def]
    place, reverse_place = _place(tiles, t, slot, lane)
    (size,) = beside(tiles.volume, (0,), tiles.margin + t * ROW + lane + tiles.offsets[slot])
    a, b = beside(tiles.numbers, (0, 0, 0), place), beside(tiles.numbers, (0, 0), reverse_place)
    return bonded((a[0] * size, b[0] * size, a[1] * size, b[1] * size, a[2] * size), tiles.bits, t, slot, lane)


@njit(forceinline=True, **INNER)
def _bond(tiles, t, slot, lane, u, displacement):  # type: ignore[no-untyped-def]
    """Deformed bonds of some lanes; lanes without a bond are undeformed."""
    v, at = tiles.vectors[slot], tiles.margin + t * ROW + lane + tiles.offsets[slot]
    neighbour_displacement = beside(u, (0, 0, 0), at)
    away = bonded(
        (
            neighbour_displacement[0] - displacement[0],
            neighbour_displacement[1] - displacement[1],
            neighbour_displacement[2] - displacement[2],
        ),
        tiles.bits,
        t,
        slot,
        lane,
    )
    less = same(u, tiles.inverse[slot])
    e = fused(less, away[0], same(u, v[3])) * away[0]
    e = fused(fused(less, away[1], same(u, v[4])), away[1], e)
    e = fused(fused(less, away[2], same(u, v[5])), away[2], e)
    stretch, inverse = stretched(e)
    long, near = magnitude(e), same(u, NARROW)
    if which_above(long, near) != 0:  # lane by lane, so that a sum does not depend on the lanes beside it
        q = np.sqrt(1.0 + e)
        stretch, inverse = where_above(long, near, e / (q + 1.0), stretch), where_above(long, near, 1.0 / q, inverse)
    return Bond((v[0], v[1], v[2]), away, v[LENGTH], stretch, stretch, v[LENGTH] * stretch, v[SHORT] * inverse)


@cached_njit(nogil=True, error_model="numpy")
def first_pass_tiles(tiles, law, u, constants, m, likes, first, last):  # type: ignore[no-untyped-def]
    """Fill m (w, m) in some tiles with nodal numbers between the passes."""
    none = same(u, 0.0)
    for t in range(first, last):
        if not tiles.filled[t]:
            continue
        for lane in range(0, ROW, across(u)):
            at = tiles.margin + t * ROW + lane
            displacement, sums = beside(u, likes[VECTORS], at), initial_sums(law, likes[VECTORS], none)
            for slot in range(len(tiles.offsets)):
                if tiles.bits[t, slot] != 0:
                    c = _numbers(tiles, t, slot, lane, u, likes[COLUMNS])
                    sums = accumulate(law, _bond(tiles, t, slot, lane, u, displacement), c, sums)
            keep(finish_sums(law, sums, beside(constants, likes[OWN], at)), m, at)


@cached_njit(nogil=True, error_model="numpy")
def exchange_tiles(tiles, law, u, m, f, near, likes, first, last):  # type: ignore[no-untyped-def]
    """Fill f (3, m) in some tiles with force densities, N/m^3, and mark in `near` (m,) the lanes with a bond over its
    limit, or nearly; None: bonds have no limit that is looked at."""
    none = same(u, 0.0)
    for t in range(first, last):
        if not tiles.filled[t]:
            continue
        for lane in range(0, ROW, across(u)):
            at, over = tiles.margin + t * ROW + lane, 0
            displacement, nodal = beside(u, likes[VECTORS], at), beside(m, likes[NODAL], at)
            pull = blank(likes[VECTORS], none)
            for slot in range(len(tiles.offsets)):
                if tiles.bits[t, slot] != 0:
                    c = _numbers(tiles, t, slot, lane, u, likes[COLUMNS])
                    neighbour_nodal = beside(m, likes[NODAL], at + tiles.offsets[slot])
                    bond = _bond(tiles, t, slot, lane, u, displacement)
                    pull = summed(pull, bond_force(law, bond, c, nodal, neighbour_nodal))
                    if near is not None:
                        value, limit = margin(law, bond, c, nodal, neighbour_nodal)
                        over |= which_above(value, limit * (1.0 - SAFE))
            keep(pull, f, at)
            if near is not None:
                for k in range(across(u)):
                    near[at + k] = (over >> k) & 1 != 0


@cached_njit(nogil=True)
def add_rows(site, f, out, first, last):  # type: ignore[no-untyped-def]
    """Add f (w, m) at the sites of the rows `first` to `last` - 1 to out (n, w)."""
    for i in range(first, last):
        for axis in range(len(f)):
            out[i, axis] += f[axis, site[i]]
