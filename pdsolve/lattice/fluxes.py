"""The sum of fluxes over a node's bonds, fast: tiles of 16 sites of a lattice, as in `pdsolve.lattice.sums`.

Rows of sites are so far apart that a bond beyond the end of one is to a site without a node. Such sites hold nothing,
so that bits are looked at in few tiles alone: those with a bond that is blocked, or between two media. A bond between
two media conducts with the harmonic mean of both diffusivities, D.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from pdsolve.codegen.fused import fused
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same
from pdsolve.codegen.tile_lanes import bonded, magnitude
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import IN_PLACE
from pdsolve.lattice.sums import ALIKE, EMPTY, GENERAL


class FluxTiles(NamedTuple):
    """Bonds of n nodes in t tiles with k offsets, an even number; m sites, of which the first and last `margin` have no
    node."""

    offsets: NDArray[np.int64]  # (k,) from a site to that of its neighbour
    g: NDArray[np.float64]  # (k,) conductance 1/(s m^d) where D is 1
    bits: NDArray[np.uint16]  # (t, k) lanes with a bond
    kind: NDArray[np.uint8]  # (t,) EMPTY, ALIKE or GENERAL
    node: NDArray[np.int32]  # (16 t,) row of a site's node whose sum is asked for, or -1
    D: NDArray[np.float64]  # (1, m) over that of the first node; 0 without a node
    outflow: NDArray[np.float64]  # (n,) 1/s, all that leaves a node for each unit of its potential
    margin: int


@register_jitable(**IN_PLACE)
def share_of(D, neighbour_D):  # type: ignore[no-untyped-def]
    """Harmonic mean of two diffusivities over the first."""
    return 2.0 * neighbour_D / (D + neighbour_D)


@cached_njit(error_model="numpy")
def sort_tiles(tiles):  # type: ignore[no-untyped-def]
    """Fill the kinds of tiles: GENERAL with a bond between two media, or without one between two nodes."""
    for t in range(len(tiles.kind)):
        tiles.kind[t] = EMPTY
        for lane in range(ROW):
            own = tiles.margin + t * ROW + lane
            if tiles.node[t * ROW + lane] < 0:
                continue
            tiles.kind[t] = max(tiles.kind[t], ALIKE)
            for k in range(len(tiles.offsets)):
                alike = tiles.D[0, own] if (tiles.bits[t, k] >> np.uint16(lane)) & np.uint16(1) else 0.0
                if tiles.D[0, own + tiles.offsets[k]] != alike:
                    tiles.kind[t] = GENERAL


@cached_njit()
def place_amounts(site, potential, volume, amount):  # type: ignore[no-untyped-def]
    """Enter amounts, `potential` times `volume` (n,), at the sites of nodes in `amount` (1, m)."""
    for i in range(len(site)):
        amount[0, site[i]] = potential[i] * volume[i]


@cached_njit(error_model="numpy")
def sum_fluxes(tiles, of, like, potential, out, first, last):  # type: ignore[no-untyped-def]
    """Add the rates of nodes in the tiles `first` to `last` - 1 at a `potential` (n,) to `out` (n,).

    `of` (w, m) is what sites hold, and `like` a tuple of w entries: their amount, or their volume and a share.
    """
    s = np.empty((1, ROW))
    for t in range(first, last):
        if tiles.kind[t] == EMPTY:
            continue
        for lane in range(0, ROW, across(of)):
            if tiles.kind[t] == GENERAL:
                keep(_sum(tiles, tiles.bits, of, like, t, lane), s, lane)
            else:
                keep(_sum(tiles, None, of, like, t, lane), s, lane)
        for lane in range(ROW):
            i = tiles.node[t * ROW + lane]
            if i >= 0:
                out[i] += s[0, lane] - tiles.outflow[i] * potential[i]


@njit(**IN_PLACE)
def _sum(tiles, bits, of, like, t, lane):  # type: ignore[no-untyped-def]
    """What bonds bring to some lanes of a tile, from `lane` on; without `bits`, None, all are there and of one medium.

    In two sums, as adding to one has to wait for the last.
    """
    own, even, odd = tiles.margin + t * ROW + lane, same(of, 0.0), same(of, 0.0)
    here, (D,) = beside(of, like, own), beside(tiles.D, (0,), own)
    for slot in range(0, len(tiles.offsets), 2):
        even = _add(tiles, bits, of, here, t, lane, slot, even)
        odd = _add(tiles, bits, of, here, t, lane, slot + 1, odd)
    return (D * (even + odd),)


@njit(**IN_PLACE)
def _add(tiles, bits, of, here, t, lane, slot, s):  # type: ignore[no-untyped-def]
    """s and what the bonds of a slot bring."""
    own, number = tiles.margin + t * ROW + lane, np.uint64(slot)  # saves a look whether it counts from the end
    at, w = own + tiles.offsets[number], same(of, tiles.g[number])
    if bits is not None:
        (D,), (neighbour_D,) = beside(tiles.D, (0,), own), beside(tiles.D, (0,), at)
        (w,) = bonded((w * share_of(D, neighbour_D),), bits, t, slot, lane)
    return fused(w, brought(beside(of, here, at), here), s)


def brought(there: Any, here: Any) -> Any:
    """What a bond of conductance 1 brings: the amount at its end, or the difference of shares times its volume."""
    raise NotImplementedError("compiled for each of them")


@overload(brought, jit_options=IN_PLACE)
def _brought(there, here):  # type: ignore[no-untyped-def]
    if len(there) == 1:
        return lambda there, here: there[0]
    return lambda there, here: there[0] * magnitude(there[1] - here[1])
