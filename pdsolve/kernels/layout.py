"""From a list of bonds to the blocks of the fast kernel.

Bonds of a lattice that should be equal differ by round-off, as positions do. Here components of reference vectors,
and stiffnesses, that differ by less than computing them does are made one; limits are equal to the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.kernels.blocks import END, LANES, Blocks, Tracks, energy_densities

SAME_PLACE = 1e-11  # of the longest bond: components of reference vectors this close are one
SAME_STIFFNESS = 1e-13  # of the largest: sorted stiffnesses with smaller steps between them are one
MOST_COMPONENTS = 500  # different components of reference vectors; more is no lattice
LEAST_FILLED = 0.25  # bonds over lanes of slots; less is no lattice either
MARGIN = 1e-5  # of e: room for round-off below a peak


def blocks_of(bonds: Any, kind: type[np.floating], threads: int) -> Blocks | None:
    """The bonds (pdsolve.bonds.Bonds, exact) in blocks of precision `kind`; None if the nodes are no lattice."""
    if not len(bonds.neighbour):
        return None
    count = -(-(len(bonds.start) - 1) // LANES)
    components, place = _alike(np.abs(bonds.xi).ravel(), SAME_PLACE * float(np.abs(bonds.xi).max()))
    if len(components) > MOST_COMPONENTS:
        return None
    signed = np.stack([components, -components], axis=1).ravel()
    sides = (2 * place + (bonds.xi.ravel() < 0)).reshape(-1, 2)
    vector, keys = _numbered(sides[:, 0] * len(signed) + sides[:, 1], len(signed) ** 2)
    start = np.concatenate([[0], np.cumsum(_slots_per_block(bonds.start, vector, len(keys), count))])
    slots = int(start[-1])
    if len(bonds.neighbour) < LEAST_FILLED * LANES * slots:
        return None
    x, y = signed[keys // len(signed)], signed[keys % len(signed)]
    squared = x * x + y * y
    length = np.sqrt(squared)

    bond, mask, of_slot = np.zeros((slots, LANES), np.int32), np.zeros(slots, np.uint64), np.zeros(slots, np.int32)
    _fill_slots(bonds.start, vector, start, len(keys), bond, mask, of_slot)
    base, ids = _neighbours(bonds.neighbour, bond, mask, count * LANES)
    per_length = bonds.stiffness / length[vector]
    pulls, number = _alike(per_length, SAME_STIFFNESS * float(per_length.max()))
    pull, rows = _shared_rows(number, bond, mask)
    peaks, peak_number = _alike(bonds.peak, 0.0)
    limits, limit_number = _alike(bonds.limit, 0.0)
    pair, pairs = _numbered(peak_number.astype(np.int64) * len(limits) + limit_number, len(peaks) * len(limits))
    bound, bound_rows = _shared_rows(pair, bond, mask)
    peak, limit = peaks[pairs // len(limits)], limits[pairs % len(limits)]
    lowest = peak[bound_rows].min(axis=1)[bound]
    block_peak = np.minimum.reduceat(np.append(lowest, np.inf), start[:-1])
    block_peak[start[1:] == start[:-1]] = np.inf
    return Blocks(
        start=start,
        vector=of_slot,
        base=base,
        pull=pull,
        bound=bound,
        mask=mask,
        bond=bond,
        ids=ids,
        vectors=np.column_stack([x, y, 1 / squared]).astype(kind),
        stiffness=aligned(pulls[rows].astype(kind)),
        peak=peak[bound_rows].astype(kind),
        limit=limit[bound_rows].astype(kind),
        threshold=((1 - MARGIN) * block_peak * (block_peak + 2)).astype(kind),
        softened=np.zeros(count, dtype=np.bool_),
        scratch=aligned(np.zeros((threads, int(END)), dtype=kind)),
    )


def revive(blocks: Blocks, broken: NDArray[np.int32], worst: NDArray[np.floating], intact: NDArray[np.uint64]) -> None:
    """Make masks and marks those of the state: `intact` (s,) were the masks of the whole plate."""
    there = _bits(intact)
    alive = there & (broken[blocks.bond] == 0)
    blocks.mask[:] = np.packbits(alive, axis=1, bitorder="little").view(np.uint64)[:, 0]
    blocks.softened[:] = False
    if len(worst):
        slot_soft = (there & (worst[blocks.bond] > 0)).any(axis=1)
        block = np.repeat(np.arange(len(blocks.softened)), np.diff(blocks.start))
        blocks.softened[block[slot_soft]] = True


def energies(blocks: Blocks, tracks: Tracks, nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Densities (n,), J/m^3, of the energy that the bonds hold, and have spent on softening so far."""
    strain, softened = np.zeros_like(tracks.work), np.zeros_like(tracks.work)
    energy_densities(blocks, tracks.worst, tracks.u[0], strain, softened)
    return strain[:nodes], softened[:nodes]


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins at a multiple of 64 bytes: vectors that cross a cache line cost twice."""
    room = np.empty(values.nbytes + 64, dtype=np.uint8)
    at = -room.ctypes.data % 64
    copy = room[at : at + values.nbytes].view(values.dtype).reshape(values.shape)
    copy[...] = values
    return copy


def _bits(mask: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """The bits (s, 64) of masks (s,)."""
    return np.unpackbits(mask[:, None].view(np.uint8), axis=1, bitorder="little").view(np.bool_)


def _alike(values: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Different values, and the number of each of `values` among them; steps up to `tolerance` make no difference."""
    ordered = np.sort(values)
    with np.errstate(invalid="ignore"):  # infinite less infinite
        ends = np.append(np.flatnonzero(np.diff(ordered) > tolerance), len(ordered) - 1)
    starts = np.concatenate([[0], ends[:-1] + 1])
    return ordered[(starts + ends) // 2], np.searchsorted(ordered[ends], values).astype(np.int32)


def _numbered(keys: NDArray[np.int64], most: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Numbers of the keys, all below `most`, and the keys they stand for."""
    seen = np.zeros(most, dtype=bool)
    seen[keys] = True
    number = np.cumsum(seen, dtype=np.int32) - np.int32(1)
    return number[keys], np.flatnonzero(seen)


@njit(cache=True)
def _slots_per_block(first, vector, vectors, count):  # type: ignore[no-untyped-def]
    slots, seen = np.zeros(count, np.int64), np.full(vectors, -1, np.int64)
    for i in range(len(first) - 1):
        for k in range(first[i], first[i + 1]):
            if seen[vector[k]] != i // LANES:
                seen[vector[k]] = i // LANES
                slots[i // LANES] += 1
    return slots


@njit(cache=True)
def _fill_slots(first, vector, start, vectors, bond, mask, of_slot):  # type: ignore[no-untyped-def]
    """Which bond is in which lane of which slot: the slots of a block in the order their vectors turn up."""
    seen, slot_of, used = np.full(vectors, -1, np.int64), np.zeros(vectors, np.int64), np.zeros(len(start), np.int64)
    for i in range(len(first) - 1):
        b = i // LANES
        for k in range(first[i], first[i + 1]):
            if seen[vector[k]] != b:
                seen[vector[k]] = b
                slot_of[vector[k]] = start[b] + used[b]
                used[b] += 1
            slot = slot_of[vector[k]]
            bond[slot, i % LANES] = k
            mask[slot] |= np.uint64(1) << np.uint64(i % LANES)
            of_slot[slot] = vector[k]


@njit(cache=True)
def _neighbours(neighbour, bond, mask, room):  # type: ignore[no-untyped-def]
    """The base of slots whose neighbours are consecutive, rows of 64 neighbours of those that are not."""
    base = np.zeros(len(mask), np.int64)
    scattered = 0
    for slot in range(len(mask)):
        found, one = np.int64(-1), True
        for lane in range(LANES):
            if mask[slot] >> np.uint64(lane) & np.uint64(1):
                here = neighbour[bond[slot, lane]] - lane
                one = one and (found in (-1, here)) and 0 <= here <= room - LANES
                found = here
        base[slot] = found
        if not one:
            scattered += 1
            base[slot] = -scattered
    ids = np.zeros((scattered, LANES), np.uint32)
    for slot in range(len(mask)):
        if base[slot] < 0:
            for lane in range(LANES):
                if mask[slot] >> np.uint64(lane) & np.uint64(1):
                    ids[-1 - base[slot], lane] = neighbour[bond[slot, lane]]
    return base, ids


def _shared_rows(
    number: NDArray[np.integer], bond: NDArray[np.int32], mask: NDArray[np.uint64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The row of each slot (s,), and for each row which of the numbered values its lanes have (., 64)."""
    least, mixed = _least(number, bond, mask)
    row, uniform = np.zeros(len(mask), np.int32), np.unique(least[~mixed])
    row[~mixed] = np.searchsorted(uniform, least[~mixed])
    row[mixed] = len(uniform) + np.arange(np.count_nonzero(mixed))
    own = np.where(_bits(mask[mixed]), number[bond[mixed]], least[mixed][:, None])
    return row, np.concatenate([np.repeat(uniform[:, None], LANES, axis=1), own]).astype(np.int32)


@njit(cache=True)
def _least(number, bond, mask):  # type: ignore[no-untyped-def]
    """The least number in each slot (s,), and whether there are others."""
    least, mixed = np.zeros(len(mask), np.int64), np.zeros(len(mask), np.bool_)
    for slot in range(len(mask)):
        low, high = np.int64(-1), np.int64(-1)
        for lane in range(LANES):
            if mask[slot] >> np.uint64(lane) & np.uint64(1):
                here = np.int64(number[bond[slot, lane]])
                low = here if low < 0 or here < low else low
                high = here if here > high else high
        least[slot], mixed[slot] = low, low < high
    return least, mixed
