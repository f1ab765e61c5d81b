"""Converts bonds to the blocks of the fast kernel, some rows at a time.

Equal bonds of a lattice differ by round-off, as positions do. Components of reference vectors, and stiffnesses, that
differ by less than their round-off are merged here; limits are equal to the last bit.

A bond's number is that of its lane: 64 times its slot, plus the lane.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import lengths
from pdsolve.checkpoint_validation import expect_found
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.blocks import BOUND, LIMITS, PULL, Blocks
from pdsolve.lattice.bond import where_inverse
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import FAR, LANES, VECTOR, VECTOR_WIDTH
from pdsolve.laws.law import Law
from pdsolve.laws.pair import no_bonds
from pdsolve.numerics.memory import aligned

SAME_PLACE = 1e-11  # of the longest: components of reference vectors this close are one
SAME_STIFFNESS = 1e-13  # of the largest: stiffnesses this close are one
NOISE = 8.0  # times the round-off of a length, over it: that of its stiffness
MOST_COMPONENTS = 500  # different components of reference vectors; more is no lattice
SIDES = 1024  # room for them with both signs
# Bonds over lanes of slots, by dimension; less is no lattice either. Of bodies, where rows without bonds take no time,
# less takes more memory than a list
LEAST_FILLED = {2: 0.25, 3: 0.1}
LAST = -1  # the number of a lane without a bond: the last in the tables of stiffnesses and limits


class _Rows(NamedTuple):
    """Values of slots with one value in all lanes, and of slots with several."""

    first: NDArray[np.int32]  # (s,)
    mixed: NDArray[np.bool_]  # (s,)
    own: NDArray[np.int32]  # (., 64) of the mixed ones


class Slots(NamedTuple):
    """The s slots of a part."""

    counts: NDArray[np.int64]  # (blocks,) slots of a block
    vector: NDArray[np.int32]  # (s,)
    mask: NDArray[np.uint64]  # (s,)
    way: NDArray[np.int64]  # (s, 4) or FAR + row of `ids`
    ids: NDArray[np.int32]  # (., 16)
    pull: _Rows
    bound: _Rows
    bonds: int


class Tables:
    """Tables shared by the slots of all parts."""

    def __init__(self, dimension: int = 2) -> None:
        self.dimension = dimension
        self.components, self.pulls = Distinct(SAME_PLACE), Distinct(SAME_STIFFNESS)
        self.peaks, self.limits, self.bounds = Distinct(0.0), Distinct(0.0), Distinct(0.0)
        self.vectors = np.full(SIDES**2 if dimension == 2 else 0, -1, dtype=np.int32)  # number by components
        self.keys = np.zeros(0, dtype=np.int64)  # components by number

    def xi(self) -> NDArray[np.float64]:
        """The reference vectors (k, d)."""
        value = self.components.values
        signed = np.stack([value, -value], axis=1).ravel()
        digits = [self.keys // SIDES**axis % SIDES for axis in range(self.dimension)]
        return np.column_stack([signed[digit] for digit in digits[::-1]])


def blocks_of(
    law: Law, parts: Iterable[Any], shape: tuple[int, ...], kind: type[np.floating], threads: int
) -> Blocks | None:
    """The bonds of nodes under a pair law, in blocks of precision `kind`; None if they are on no lattice.

    `parts` (pdsolve.bonds.assembly.Part, exact) begin at multiples of 64; `shape` (n, d) is that of the positions.
    """
    nodes, dimension = shape
    tables, slots = Tables(dimension), []
    for part in parts:
        part_slots = slots_of(part.bonds, part.first, room_of(nodes), tables)
        if part_slots is None:
            return None
        slots.append(part_slots)
    if not fill_lanes(*bonds_and_lanes(slots), dimension):
        return None
    return join_parts(law, tables, slots, kind, threads)


def can_be_in_blocks(parts: Iterable[Any], shape: tuple[int, ...]) -> bool:
    """Whether the bonds of nodes whose positions have this `shape` (n, d) can be in blocks; all parts are asked for."""
    (nodes, dimension), bonds, lanes, placed = shape, 0, 0, True
    tables = Tables(dimension)
    for part in parts:
        positions = place_bonds(part.bonds, part.first, room_of(nodes), tables) if placed else None
        placed = positions is not None
        if positions is not None:
            bonds, lanes = bonds + len(part.bonds.neighbour), lanes + positions.lane.size
    return placed and fill_lanes(bonds, lanes, dimension)


def room_of(nodes: int) -> int:
    """Places of nodes in whole blocks."""
    return -(-nodes // LANES) * LANES


def fill_lanes(bonds: int, lanes: int, dimension: int) -> bool:
    """Whether so many lanes have bonds that the nodes are on a lattice."""
    return bonds > 0 and bonds >= LEAST_FILLED[dimension] * lanes


def bonds_and_lanes(slots: list[Slots]) -> tuple[int, int]:
    """Numbers of bonds, and of lanes of slots."""
    return sum(part.bonds for part in slots), sum(LANES * len(part.mask) for part in slots)


def join_parts(law: Law, tables: Tables, slots: list[Slots], kind: type[np.floating], threads: int) -> Blocks:
    """The blocks of all parts, from their slots and the tables that these share."""
    counts, vector, mask = (np.concatenate([part[field] for part in slots]) for field in range(3))
    way, scattered = [], 0
    for part in slots:
        way.append(np.where(part.way >= FAR, part.way + scattered, part.way))
        scattered += len(part.ids)
    pull, pulls = _shared([part.pull for part in slots])
    bound, bounds = _shared([part.bound for part in slots])
    number = tables.bounds.values.astype(np.int64)
    peak = np.append(tables.peaks.values[number // SIDES**2], np.inf)[bounds]
    limit = np.append(tables.limits.values[number % SIDES**2], np.inf)[bounds]
    assert law.pair is not None
    ways = np.concatenate(way)
    # The slots in which rows have bonds, those with consecutive neighbours first
    slot, row = np.nonzero(
        (mask if tables.dimension == 3 else np.zeros_like(mask)).view(np.uint16).reshape(-1, LANES // ROW)
    )
    row_number = np.repeat(np.arange(len(counts)), counts)[slot] * (LANES // ROW) + row
    order = np.argsort(2 * row_number + (ways[slot, row] >= FAR), kind="stable")
    ends = np.cumsum(np.bincount(row_number, minlength=len(counts) * (LANES // ROW)))
    start_of_rows, of_rows = np.concatenate([[0], ends]), slot[order].astype(np.int32)
    first = limit if law.pair.softening is None else peak
    edge = first * (first + 2)
    near = np.where(bounds == LAST, np.inf, np.minimum(edge, NARROW))
    return Blocks(
        law=no_bonds(law),
        axes=(0,) * tables.dimension,
        start=np.concatenate([[0], np.cumsum(counts)]),
        slots=np.column_stack([*ways.T, vector, pull, bound, bound]).astype(np.int32),
        start_of_rows=start_of_rows,
        of_rows=of_rows,
        ids=np.concatenate([part.ids for part in slots]),
        vectors=aligned(reference_table(tables).astype(kind)),
        stiffness=aligned(np.append(tables.pulls.values, 0.0)[pulls].astype(kind), len(mask)),
        near=aligned(near.astype(kind), len(mask)),
        edge=aligned(edge.astype(kind), len(mask)),
        peak=peak.astype(kind),
        limit=limit.astype(kind),
        whole=pull,
        mask=mask,
        softened=np.zeros(len(counts), dtype=np.bool_),
        scratch=aligned(np.zeros((threads, (tables.dimension + 1) * ROW), dtype=kind)),
    )


def reference_table(tables: Tables) -> NDArray[np.float64]:
    """Reference vectors in the kernel's format, (k, 8), in space (k, 9): see `Blocks` and `FamilySlots`."""
    xi = tables.xi()
    inverse = 1 / (xi**2).sum(axis=1)
    columns = np.column_stack([xi, 2 * xi * inverse[:, None], inverse, lengths(xi), np.sqrt(inverse)])
    return np.column_stack([columns, np.zeros((len(xi), VECTOR_WIDTH[tables.dimension] - columns.shape[1]))])


class Placed(NamedTuple):
    """Positions of a part's bonds in s slots."""

    counts: NDArray[np.int64]  # (blocks,) slots of a block
    vector: NDArray[np.int32]  # (s,)
    way: NDArray[np.int64]  # (s, 4) or FAR + row of `ids`
    ids: NDArray[np.int32]  # (., 16)
    lane: NDArray[np.int32]  # (s, 64) the bond in each lane, or -1


def slots_of(bonds: Any, first: int, room: int, tables: Tables) -> Slots | None:
    """Slots of the bonds of rows from `first` on, a multiple of 64; None if the nodes are on no lattice."""
    placed = place_bonds(bonds, first, room, tables)
    if placed is None:
        return None
    length, has_bond = lengths(tables.xi()), placed.lane >= 0
    vector = np.empty(len(bonds.xi), dtype=np.int32)
    vector[placed.lane[has_bond]] = np.repeat(placed.vector, has_bond.sum(axis=1))
    pulls = tables.pulls.numbers(bonds.stiffness / length[vector])
    bounds = np.float64(SIDES**2) * tables.peaks.numbers(bonds.peak) + tables.limits.numbers(bonds.limit)
    return Slots(
        counts=placed.counts,
        vector=placed.vector,
        mask=np.packbits(has_bond, axis=1, bitorder="little").view(np.uint64)[:, 0],
        way=placed.way,
        ids=placed.ids,
        pull=_rows(pulls, placed.lane, has_bond),
        bound=_rows(tables.bounds.numbers(bounds), placed.lane, has_bond),
        bonds=len(bonds.neighbour),
    )


def place_bonds(bonds: Any, first: int, room: int, tables: Tables) -> Placed | None:
    """Positions of the bonds of rows from `first` on, a multiple of 64; None if the nodes are on no lattice."""
    size = np.abs(bonds.xi).ravel()
    component = tables.components.numbers(size)
    if len(tables.components.values) > MOST_COMPONENTS:
        return None
    sides = 2 * component + (bonds.xi.ravel() < 0)
    off = float(np.abs(size - tables.components.values[component]).max(initial=0.0))
    shortest = float(lengths(bonds.xi).min(initial=np.inf))
    tables.pulls.loosen(NOISE * off / shortest)
    sides = sides.reshape(bonds.xi.shape).astype(np.int64)
    key = sides[:, 0]  # the numbers of reference vectors, from those of their signed components
    for side in sides.T[1:]:
        key = key * SIDES + side
    if tables.dimension == 3:
        vector = _look_up_keys(key, tables.keys)
        if (new := np.unique(key[vector < 0])).size:
            tables.keys = np.append(tables.keys, new)
            vector = _look_up_keys(key, tables.keys)
    else:
        new = np.unique(key[tables.vectors[key] < 0])
        tables.vectors[new] = np.arange(len(tables.keys), len(tables.keys) + len(new))
        tables.keys = np.append(tables.keys, new)
        vector = np.asarray(tables.vectors[key])
    count = len(bonds.start) - 1
    row = bonds.source
    blocks, vectors = -(-count // LANES), max(len(tables.keys), 1)
    keys = row // LANES * vectors + vector
    occurs = np.zeros(blocks * vectors, dtype=bool)
    occurs[keys] = True
    number = np.cumsum(occurs, dtype=np.int32) - np.int32(1)
    slot, keys = number[keys], np.flatnonzero(occurs)
    lane = np.full((len(keys), LANES), -1, dtype=np.int32)
    lane[slot, row % LANES] = np.arange(len(row), dtype=np.int32)
    nodes = first + keys // vectors * LANES
    way, _ = _ways(bonds.neighbour, lane, nodes, room)
    order = np.lexsort(((way >= FAR).any(axis=1), nodes))  # the quick loop then goes as far as it can
    keys, lane = keys[order], lane[order]
    way, ids = _ways(bonds.neighbour, lane, nodes, room)
    counts = np.bincount(keys // vectors, minlength=blocks)
    return Placed(counts, (keys % vectors).astype(np.int32), way, ids, lane)


def are_sparse(placed: Placed, bonds: int) -> bool:
    """Whether so few lanes have bonds that the nodes are on no lattice."""
    return not fill_lanes(bonds, placed.lane.size, 2)  # families look at rows without bonds in space too


def _look_up_keys(key: NDArray[np.int64], keys: NDArray[np.int64]) -> NDArray[np.int32]:
    """Where each key (b,) is among distinct `keys`, or -1."""
    order = np.argsort(keys)
    ordered, number = np.append(keys[order], -1), np.append(order, -1).astype(np.int32)
    at = np.searchsorted(ordered[:-1], key)
    return np.where(ordered[at] == key, number[at], np.int32(-1))


def _ways(
    neighbour: NDArray[np.int32], lane: NDArray[np.int32], first: NDArray[np.int64], room: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Offsets (s, 4) of rows with consecutive neighbours, and the 16 neighbours of other rows.

    `lane` (s, 64) are the bonds of slots, whose blocks begin with the nodes `first` (s,) of `room`.
    """
    to = neighbour[lane].astype(np.int64) if len(neighbour) else lane.astype(np.int64)
    to, has_bond = to.reshape(-1, ROW), (lane >= 0).reshape(-1, ROW)
    first_node = (first[:, None] + ROW * np.arange(LANES // ROW)).ravel()
    way = to - first_node[:, None] - np.arange(ROW)
    low = np.where(has_bond, way, np.iinfo(np.int64).max).min(axis=1, initial=np.iinfo(np.int64).max)
    high = np.where(has_bond, way, np.iinfo(np.int64).min).max(axis=1, initial=np.iinfo(np.int64).min)
    low[~has_bond.any(axis=1)] = high[~has_bond.any(axis=1)] = 0  # what such a row finds there does not matter
    scattered = (low != high) | (first_node + low < 0) | (first_node + low > room - ROW)
    low[scattered] = FAR + np.arange(np.count_nonzero(scattered))
    return low.reshape(-1, LANES // ROW), np.where(has_bond, to, 0)[scattered].astype(np.int32)


def _rows(numbers: NDArray[np.int32], lane: NDArray[np.int32], has_bond: NDArray[np.bool_]) -> _Rows:
    """Values of the bonds (b,), slot by slot; LAST in lanes without a bond."""
    if not len(numbers):
        return _Rows(np.zeros(0, np.int32), np.zeros(0, np.bool_), np.zeros((0, LANES), np.int32))
    number = np.where(has_bond, numbers[lane], np.int32(LAST))
    mixed = (number != number[:, :1]).any(axis=1)
    return _Rows(number[:, 0], mixed, number[mixed])


def _shared(rows: list[_Rows]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The row of each slot (s,), and the values of each row's lanes (., 64)."""
    first, mixed, mixed_values = (np.concatenate(column) for column in zip(*rows, strict=True))
    row, uniform = np.zeros(len(first), np.int32), np.unique(first[~mixed])
    row[~mixed] = np.searchsorted(uniform, first[~mixed])
    # The distinct rows in the order in which they occur, so that neighbours in memory are read together. They are told
    # apart by a sum with random weights, which is quick to sort, and compared.
    weights = np.random.default_rng(0).integers(np.iinfo(np.int64).max, size=LANES)
    _, first, which = np.unique(mixed_values @ weights, return_index=True, return_inverse=True)
    if (mixed_values[first][which] != mixed_values).any():
        _, first, which = np.unique(mixed_values, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    mixed_values, which = mixed_values[first[order]], number[which.ravel()]
    row[mixed] = len(uniform) + which
    return row, np.concatenate([np.repeat(uniform[:, None], LANES, axis=1), mixed_values])


def numbers_of_bits(mask: NDArray[np.uint64], first: int = 0) -> NDArray[np.int64]:
    """Numbers of the bonds in slots with these masks, the first of which is slot `first`."""
    used_slots = np.flatnonzero(mask)
    row, lane = np.divmod(np.flatnonzero(_bits(mask[used_slots])), LANES)
    return np.asarray(LANES * (first + used_slots[row]) + lane)


def ends_of_bonds(blocks: Blocks, numbers: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (k,) of both nodes of the bonds with these numbers (k,)."""
    slot, lane = np.divmod(numbers, LANES)
    source = (np.searchsorted(blocks.start, slot, side="right") - 1) * LANES + lane
    way = blocks.slots[slot, lane // ROW].astype(np.int64)
    target, listed = source + way, way >= FAR
    target[listed] = blocks.ids[way[listed] - FAR, lane[listed] % ROW]
    return source, target


def springs_of_bonds(
    blocks: Blocks, numbers: NDArray[np.int64], initial: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reference vectors (k, d), m, and force densities at unit stretch (k,), N/m^3, of bonds: what remains, or the
    `initial`."""
    slot, lane = np.divmod(numbers, LANES)
    table = blocks.vectors[blocks.slots[slot, VECTOR]].astype(np.float64)
    row = blocks.whole[slot] if initial else blocks.slots[slot, PULL]
    d = len(blocks.axes)
    return table[:, :d], blocks.stiffness[row, lane] / np.sqrt(table[:, where_inverse(d)])


def find_bonds(
    blocks: Blocks, masks: NDArray[np.uint64], source: NDArray[np.int64], target: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Numbers (k,) of the bonds from `source` (k,) to `target` (k,), among those in the masks `masks`.

    Arguments are rows of nodes. Raises CheckpointError for a missing bond.
    """
    room = LANES * (len(blocks.start) - 1)
    block = np.unique(source // LANES)
    slots = [np.arange(blocks.start[b], blocks.start[b + 1]) for b in block]
    slot = np.concatenate([np.zeros(0, dtype=np.int64), *slots])
    at = numbers_of_bits(masks[slot])
    numbers = slot[at // LANES] * LANES + at % LANES
    bond_source, bond_target = ends_of_bonds(blocks, numbers)
    key = bond_source * room + bond_target
    order = np.argsort(key)
    wanted = source * room + target
    position = np.searchsorted(key, wanted, sorter=order)
    expect_found(np.append(key[order], -1)[position] == wanted, source, target)
    return numbers[order[position]]


def restore_bonds(
    law: Law,
    blocks: Blocks,
    intact: NDArray[np.uint64],
    broken: NDArray[np.int32],
    worst: NDArray[np.floating],
    edge: NDArray[np.floating],
) -> None:
    """Set stiffnesses, edges and masks to a state (s, 64): `broken` bonds, their `worst` stretches, and their `edge`.

    `intact` (s,) were the masks of the unbroken plate.
    """
    has_bond = _bits(intact)
    is_broken = has_bond & (broken != 0)
    soft = np.broadcast_to(worst > 0, has_bond.shape) if len(worst) else np.zeros_like(has_bond)
    blocks.mask[:] = np.packbits(has_bond & ~is_broken, axis=1, bitorder="little").view(np.uint64)[:, 0]
    blocks.slots[:, PULL], blocks.slots[:, BOUND] = blocks.whole, blocks.slots[:, LIMITS]
    torn = np.flatnonzero((is_broken | soft).any(axis=1))
    pull, bound = (len(table) - len(intact) + torn for table in (blocks.stiffness, blocks.edge))
    row, is_broken, ever, soft = blocks.slots[torn, LIMITS], is_broken[torn], soft, soft[torn] & ~is_broken[torn]
    stiffness, near, edges = blocks.stiffness[blocks.whole[torn]], blocks.near[row], blocks.edge[row]
    assert law.pair is not None
    if len(worst):
        columns = worst[torn][soft], blocks.peak[row][soft], blocks.limit[row][soft]
        largest, peak, limit = (column.astype(np.float64) for column in columns)
        if law.pair.secant is not None and not law.pair.is_curved:
            stiffness[soft] = law.pair.secant(blocks.law, largest, largest, peak, limit) * stiffness[soft]
        edges[soft] = edge[torn][soft]
        near[soft] = np.minimum(edges[soft], NARROW)
    stiffness[is_broken], near[is_broken], edges[is_broken] = 0, np.inf, np.inf
    blocks.stiffness[pull], blocks.near[bound], blocks.edge[bound] = stiffness, near, edges
    blocks.slots[torn, PULL], blocks.slots[torn, BOUND] = pull, bound
    block = np.searchsorted(blocks.start, torn, side="right") - 1
    blocks.softened[:] = False
    blocks.softened[block[ever[torn].any(axis=1)]] = True


def _bits(mask: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """The bits (s, 64) of masks (s,)."""
    return np.unpackbits(mask[:, None].view(np.uint8), axis=1, bitorder="little").view(np.bool_)


class Distinct:
    """Distinct values, numbered in order of appearance; values within a share of the largest known one are equal."""

    def __init__(self, share: float) -> None:
        self._share, self._tolerance = share, 0.0
        self._order = np.zeros(0, dtype=np.int32)
        self.values = np.zeros(0)

    def numbers(self, values: NDArray[np.float64]) -> NDArray[np.int32]:
        """Numbers of `values`; new values are added."""
        if self._share > 0:
            self._tolerance = max(self._tolerance, self._share * float(np.abs(values).max(initial=0.0)))
        number, is_known = self._look_up(values)
        if not is_known.all():
            self._add(np.sort(values[~is_known]))
            number, is_known = self._look_up(values)
            assert is_known.all()
        return number

    def loosen(self, share: float) -> None:
        """Treat values within this share as equal from now on, if it is larger than before."""
        self._share = max(self._share, share)

    def _near(self, first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):  # infinite less infinite
            return np.asarray((first == second) | (np.abs(first - second) <= self._tolerance))

    def _look_up(self, values: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        if not len(self.values):
            return np.zeros(len(values), dtype=np.int32), np.zeros(len(values), dtype=bool)
        ordered = self.values[self._order]
        above = np.searchsorted(ordered, values).clip(max=len(ordered) - 1)
        below = np.maximum(above - 1, 0)
        at = np.where(self._near(values, ordered[below]), below, above)
        return self._order[at], self._near(values, ordered[at])

    def _add(self, ordered: NDArray[np.float64]) -> None:
        within = 0.99 * self._tolerance
        with np.errstate(invalid="ignore"):  # infinite less infinite
            first = np.flatnonzero(np.append(True, np.diff(ordered) > within))
            last = np.append(first[1:], len(ordered)) - 1
            new = [ordered[first]]
            for chain in np.flatnonzero(ordered[last] - ordered[first] > within):
                at, end = first[chain], last[chain] + 1
                while True:  # each is as near to the first of its group as the tolerance, not to the next one only
                    at += np.searchsorted(ordered[at:end], ordered[at] + within, side="right")
                    if at == end:
                        break
                    new.append(ordered[at : at + 1])
        self.values = np.concatenate([self.values, *new])
        self._order = np.argsort(self.values).astype(np.int32)
