"""Bonds along which a scalar flows in tiles of 16 sites of a lattice.

Rows of sites are so far apart that a bond beyond the end of one is to a site without a node. Such sites hold nothing,
so that bits are looked at in few tiles alone: those with a bond that is blocked, or between two media. A bond between
two media conducts with the harmonic mean of both diffusivities, D.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import beside, bonded, same
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import IN_PLACE


class FluxTiles(NamedTuple):
    """Bonds of nodes in t tiles with k offsets; m sites, of which the first and last `margin` have no node."""

    offsets: NDArray[np.int64]  # (k,) from a site to that of its neighbour
    g: NDArray[np.float64]  # (k,) conductance 1/(s m^d) where D is 1
    bits: NDArray[np.uint16]  # (t, k) lanes with a bond
    filled: NDArray[np.bool_]  # (t,) whether there is a node whose sum is asked for
    general: NDArray[np.bool_]  # (t,) whether one has a bond between two media, or none to a node at an offset
    D: NDArray[np.float64]  # (1, m) over that of the first node; 0 without a node
    margin: int


@register_jitable(**IN_PLACE)
def share_of(D, neighbour_D):  # type: ignore[no-untyped-def]
    """Harmonic mean of two diffusivities over the first."""
    return 2.0 * neighbour_D / (D + neighbour_D)


@njit(**IN_PLACE)
def conductances(tiles, tile, slot, lane, at):  # type: ignore[no-untyped-def]
    """Conductances of the bonds of some lanes, whose first node is `at`, over D of their nodes."""
    number = np.uint64(slot)  # saves a look whether it counts from the end
    w = same(tiles.D, tiles.g[number])
    if tiles.general[tile]:
        (D,), (neighbour_D,) = beside(tiles.D, (0,), at), beside(tiles.D, (0,), at + tiles.offsets[number])
        return bonded((w * share_of(D, neighbour_D),), tiles.bits, tile, slot, lane)
    return (w,)


@cached_njit(error_model="numpy")
def sort_tiles(tiles, node):  # type: ignore[no-untyped-def]
    """Fill `filled` and `general` of tiles; `node` (16 t,) is the row of a site's node to be summed, or -1."""
    for site in range(len(node)):
        if node[site] < 0:
            continue
        own, t, lane = tiles.margin + site, site // ROW, np.uint16(site % ROW)
        tiles.filled[t] = True
        for k in range(len(tiles.offsets)):
            alike = tiles.D[0, own] if (tiles.bits[t, k] >> lane) & np.uint16(1) else 0.0
            tiles.general[t] |= tiles.D[0, own + tiles.offsets[k]] != alike


@cached_njit(nogil=True)
def place_amounts(site, potential, volume, amount, first, last):  # type: ignore[no-untyped-def]
    """Enter amounts, `potential` times `volume` (n,), of the rows `first` to `last` - 1 at their sites in `amount`
    (1, m)."""
    for i in range(first, last):
        amount[0, site[i]] = potential[i] * volume[i]


@cached_njit(nogil=True)
def collect_rates(site, brought, total, potential, out, first, last):  # type: ignore[no-untyped-def]
    """Add what is `brought` (1, m) to sites less what leaves nodes, `total` times `potential` (n,), to the rows
    `first` to `last` - 1 of `out` (n,)."""
    for i in range(first, last):
        out[i] += brought[0, site[i]] - total[i] * potential[i]
