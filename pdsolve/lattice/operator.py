"""Pair laws on lattices as operators: of bonds in blocks, and of bonds in tiles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import PendingPulls, entry, last_breaks, pending_to_arrays, read_pending_pulls
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice import block_bonds, tile_bonds
from pdsolve.lattice.blocks import BOUND, LIMITS, PENDING, PENDING_SHORT, Blocks, Tracks
from pdsolve.lattice.energies import sum_energies
from pdsolve.lattice.layout import LANES
from pdsolve.lattice.march import LatticeMarch
from pdsolve.lattice.marched_bonds import MarchedBlocks, MarchedBonds, MarchedTiles, copy_state, rows_in
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.sums import sum_blocks, sum_tiles
from pdsolve.lattice.tiles import (
    Breaks,
    Tiles,
    copy_breaks,
    join_breaks,
    place_rows,
    pull_all_again,
    recall,
    room_for,
    select_breaks,
)
from pdsolve.laws.calls import bind
from pdsolve.laws.law import Law
from pdsolve.numerics.memory import aligned_zeros
from pdsolve.numerics.thread_team import share, side_by_side
from pdsolve.operators.protocol import BondLayout, CheckpointArrays, Motion
from pdsolve.state import Broken, State, Unknown
from pdsolve.stepper import Stepper

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROWS = 65536  # whose bonds are listed together
ROOM = 16  # tiles all of whose bonds may break before the kernel asks for more room


class IntactBonds(NamedTuple):
    """Bonds (b,) that are not broken."""

    source: NDArray[np.int64]  # row of a node
    target: NDArray[np.int64]
    number: NDArray[np.int64]  # of the bond in blocks, of its slot in tiles


class LatticeOperator(ABC):
    """The bonds of n nodes on lattices under a pair law, whatever their layout; see `Operator`."""

    name = "blocks"
    bond_layout: BondLayout

    def __init__(self, law: Law, dimension: int, stiffness_bound: NDArray[np.float64], symmetric: bool) -> None:
        """`stiffness_bound` (n,), N/m^4, of nodes."""
        bind(law)
        assert law.pair is not None
        self._law, self._pair, self.symmetric = law, law.pair, symmetric
        self.unknowns: tuple[Unknown, ...] = (Unknown("u", dimension, 2),)
        self._stiffness_bound = stiffness_bound

    @abstractmethod
    def _intact_bonds(self) -> IntactBonds:
        """All bonds that are not broken."""

    @abstractmethod
    def _springs(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Reference vectors (b, d), m, and force densities for a unit stretch (b,), N/m^3, before bonds soften."""

    @abstractmethod
    def _softened_stiffness(self, bonds: IntactBonds, stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        """What softening has left (b,) of the stiffness (b,) of bonds, N/m^3."""

    @abstractmethod
    def _history(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Peaks and limits (b,) of the stretch, and the largest stretches (b,) above the peak, 0 if never there."""

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: a pair law stores no fields besides displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4; see `Operator`."""
        return self._stiffness_bound

    def intact_stiffness_bound(self) -> NDArray[np.float64] | None:
        """None: pairs that are left are no stiffer as others break."""
        return None

    @abstractmethod
    def marched(self) -> MarchedBonds:
        """The bonds as a march sweeps over them."""

    def march(self, motion: Motion) -> Stepper | None:
        """A march that sums forces and moves nodes in one sweep a step."""
        _, drive, rho, time_step, damping_rates, ghosts, contact = motion
        return LatticeMarch(self.marched(), drive, rho, time_step, damping_rates, contact, ghosts)

    def update_history(self, state: State) -> None:  # noqa: B027 - pairs have a history of bonds alone
        """Nothing: no node remembers strain."""

    def tangent(self, state: State) -> csr_array:
        """The tangent (n w, n w), N/m^4: minus the derivative of the force densities by the values."""
        from pdsolve.operators.tangent import of_curves, of_springs  # SciPy takes long to import, and few runs ask

        bonds = self._intact_bonds()
        xi, stiffness = self._springs(bonds)
        if self._pair.is_curved:
            return of_curves(self._law, bonds.source, bonds.target, xi, (stiffness, *self._history(bonds)), state.value)
        softened_stiffness = self._softened_stiffness(bonds, stiffness)
        if self._pair.elastic_in_compression:
            eta = state.value[bonds.target].astype(np.float64) - state.value[bonds.source]
            is_longer = ((2 * xi + eta) * eta).sum(axis=1) > 0
            softened_stiffness = np.where(is_longer, softened_stiffness, stiffness)
        return of_springs(bonds.source, bonds.target, xi, softened_stiffness, state.value)


class BlockLattice(LatticeOperator):
    """The bonds of n nodes on lattices in blocks; see `Operator`."""

    bond_layout: BondLayout = "blocks"

    def __init__(self, law: Law, blocks: Blocks, bound: NDArray[np.float64], symmetric: bool, softens: bool) -> None:
        """`bound` (n,), N/m^4, of the stiffness of nodes; `softens`: whether any bond has its peak below its limit."""
        super().__init__(law, len(blocks.axes), bound, symmetric)
        remembers = self._pair.softening is not None and (softens or self._pair.is_curved)
        d = len(blocks.axes)
        self.blocks, self._whole = blocks, blocks.mask.copy()
        none = np.zeros(0, dtype=np.int64)
        self._looked_at, self._broken = self._whole, Broken(none, none, none)  # what is known to be broken
        room, lanes = LANES * (len(blocks.start) - 1), (len(blocks.mask), LANES)
        kind = blocks.scratch.dtype
        self.tracks = Tracks(
            u=aligned_zeros((3, d, room), kind),
            v=aligned_zeros((d, room), kind),
            a=aligned_zeros((d, room), kind),
            dissipated=aligned_zeros((room,), np.float64),
            work=aligned_zeros((room,), np.float64),
            broken=np.zeros(lanes, dtype=np.int32),
            worst=np.zeros(lanes if remembers else (0, LANES), dtype=kind),
        )

    def marched(self) -> MarchedBonds:
        """The bonds as a march sweeps over them."""
        return MarchedBlocks(self)

    def to_own_layout(self, state: State) -> State:
        """The state in this operator's own array layout."""
        nodes, tracks = len(self._stiffness_bound), self.tracks
        u, v, a = (array[:, :nodes].T for array in (tracks.u[0], tracks.v, tracks.a))
        local_state = State(u, v, a, tracks.dissipated[:nodes], tracks.work[:nodes], state.damped)
        return copy_state(state, local_state)

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long."""
        local_state = self.to_own_layout(state)
        before = self.tracks.u[0] - self.tracks.v.dtype.type(dt) * self.tracks.v
        blocks = self.blocks
        if step == 0 and self.tracks.shrink is not None:  # of what is strained from the start none breaks yet
            blocks = blocks._replace(edge=np.full_like(blocks.edge, np.inf))
        threads = len(blocks.scratch)
        cuts = np.searchsorted(blocks.start, blocks.start[-1] * np.arange(threads) // threads)  # of as many slots each
        ends = [*cuts.tolist(), len(blocks.softened)]
        side_by_side(
            lambda thread: sum_blocks(blocks, self.tracks, before, out, step, *ends[thread : thread + 2], thread),
            threads,
        )
        state.dissipated[:] = local_state.dissipated

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let bonds stretch from what they are long at these strains (n,) of free nodes."""
        shrink = (
            aligned_zeros(self.tracks.v[0].shape, self.tracks.v.dtype)
            if self.tracks.shrink is None
            else self.tracks.shrink
        )
        shrink[: len(strain)] = -strain / 2
        self.tracks = self.tracks._replace(shrink=shrink)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        self.to_own_layout(state)
        strain_energy, spent = np.zeros_like(self.tracks.work), np.zeros_like(self.tracks.work)
        arrays = self.blocks, self.tracks, self.tracks.u[0], strain_energy, spent
        rows, threads = LANES * len(self.blocks.softened), len(self.blocks.scratch)
        share(lambda first, last: sum_energies(*arrays, first // LANES, last // LANES, None), rows, threads)
        return strain_energy[: len(self._stiffness_bound)], spent[: len(self._stiffness_bound)]

    def _intact_bonds(self) -> IntactBonds:
        numbers = block_bonds.numbers_of_bits(self.blocks.mask)
        return IntactBonds(*block_bonds.ends_of_bonds(self.blocks, numbers), numbers)

    def _springs(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return block_bonds.springs_of_bonds(self.blocks, bonds.number, initial=True)

    def _softened_stiffness(self, bonds: IntactBonds, stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._pair.softening is None:
            return stiffness
        return block_bonds.springs_of_bonds(self.blocks, bonds.number)[1]

    def _history(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        slot, lane = np.divmod(bonds.number, LANES)
        row = self.blocks.slots[slot, LIMITS]
        peak, limit = (table[row, lane].astype(np.float64) for table in (self.blocks.peak, self.blocks.limit))
        has_softened = self.tracks.worst.size > 0
        worst = self.tracks.worst.ravel()[bonds.number].astype(np.float64) if has_softened else np.zeros(len(slot))
        return peak, limit, worst

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        end_row = len(self._stiffness_bound) if end_row is None else end_row
        slots = self.blocks.start[[first_row // LANES, -(-end_row // LANES)]]
        mask = self._whole if at_start else self.blocks.mask
        source, target = block_bonds.ends_of_bonds(
            self.blocks, block_bonds.numbers_of_bits(mask[slots[0] : slots[1]], int(slots[0]))
        )
        in_range = np.flatnonzero((source >= first_row) & (source < end_row))
        in_range = in_range[np.lexsort((target[in_range], source[in_range]))]
        return source[in_range], target[in_range]

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        new = block_bonds.numbers_of_bits(self._looked_at & ~self.blocks.mask)
        if len(new):
            new_columns = self.tracks.broken.ravel()[new].astype(np.int64), *block_bonds.ends_of_bonds(self.blocks, new)
            self._broken = Broken(*(np.concatenate(columns) for columns in zip(self._broken, new_columns, strict=True)))
            self._looked_at = self.blocks.mask.copy()
        return self._broken if after_step == 0 else self._broken.after(after_step)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes."""
        worst, rows = self.tracks.worst.ravel(), self.blocks.slots[:, BOUND]
        softened = np.flatnonzero(worst)
        slot, lane = np.divmod(softened, LANES)
        source, target = block_bonds.ends_of_bonds(self.blocks, softened)
        edge = self.blocks.edge[rows[slot], lane]
        edge[edge <= PENDING_SHORT] = np.inf
        arrays = {"worst": worst[softened], "worst_edge": edge, "worst_source": source, "worst_target": target}
        return arrays | pending_to_arrays(self._pending_pulls())

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        steps, worst, edge = self.tracks.broken.ravel(), self.tracks.worst.ravel(), np.zeros_like(self.tracks.worst)
        torn = block_bonds.find_bonds(self.blocks, self._whole, broken.source, broken.target)
        nodes, rows = len(self._stiffness_bound) - 1, (None,) if self.tracks.worst.size else (0,)
        values = entry(checkpoint, "worst", rows, self.tracks.worst.dtype)
        edges = entry(checkpoint, "worst_edge", values.shape, self.blocks.edge.dtype, high=np.inf)
        ends = (entry(checkpoint, f"worst_{end}", values.shape, np.int64, 0, nodes) for end in ("source", "target"))
        softened = block_bonds.find_bonds(self.blocks, self._whole, *ends)
        pending = read_pending_pulls(checkpoint, nodes + 1, self.blocks.near.dtype)
        steps[:] = worst[:] = 0
        steps[torn] = broken.step
        worst[softened], edge.ravel()[softened] = values, edges
        self._looked_at, self._broken = self._whole, Broken(*(column[:0] for column in self._broken))
        block_bonds.restore_bonds(self._law, self.blocks, self._whole, self.tracks.broken, self.tracks.worst, edge)
        self._set_pending(
            *np.divmod(block_bonds.find_bonds(self.blocks, self._whole, pending.source, pending.target), LANES),
            pending.stretch,
        )

    def _pending_pulls(self) -> PendingPulls:
        """Bonds that broke in the last step and pull once more."""
        last, (near, edge) = last_breaks(self.broken()), (self.blocks.near, self.blocks.edge)
        slot, lane = np.divmod(block_bonds.find_bonds(self.blocks, self._whole, last.source, last.target), LANES)
        row = self.blocks.slots[slot, BOUND]
        is_pending = edge[row, lane] <= PENDING_SHORT
        stretch = np.where(edge[row, lane] == PENDING, -1, 1) * near[row, lane]
        return PendingPulls(last.source[is_pending], last.target[is_pending], stretch[is_pending].astype(near.dtype))

    def _set_pending(self, slot: NDArray[np.int64], lane: NDArray[np.int64], stretch: NDArray[Any]) -> None:
        """Let broken bonds (k,) pull once more, whose `stretch` was this one step before they broke."""
        row = self.blocks.slots[slot, BOUND]
        self.blocks.near[row, lane] = -np.abs(stretch)
        self.blocks.edge[row, lane] = np.where(stretch >= 0, PENDING, PENDING_SHORT)

    def bytes(self) -> int:
        """Memory of all arrays, bytes, without the rows that slots get as their bonds break."""
        blocks = self.blocks
        later = sum(table[-len(blocks.mask) :].nbytes for table in (blocks.stiffness, blocks.near, blocks.edge))
        return sum(array.nbytes for array in (*blocks[2:], *self.tracks) if array is not None) - later


class TileLattice(LatticeOperator):
    """The bonds of n nodes on a cubic lattice in tiles; see `Operator`."""

    bond_layout: BondLayout = "tiles"

    def __init__(
        self, law: Law, tiles: Tiles, sites: Sites, bound: NDArray[np.float64], symmetric: bool, threads: int
    ) -> None:
        """`bound` (n,), N/m^4, of the stiffness of nodes."""
        super().__init__(law, len(tiles.axes), bound, symmetric)
        self._softens = self._pair.softening is not None
        self.tiles, self.sites, self.threads = tiles, sites, threads
        self.summed_tiles = 0, len(tiles.kind)  # tiles
        shape = (2, len(tiles.axes), tiles.cells.shape[1])
        self.u = aligned_zeros(shape, tiles.cells.dtype)  # (2, d, m) displacements at sites of two steps in turn, m
        self.v = aligned_zeros(shape, tiles.cells.dtype)  # velocities likewise, m/s
        self._broken = Broken(*(np.zeros(0, dtype=np.int64) for _ in Broken._fields))
        self._new: list[Broken] = []
        self.pending = room_for(0)  # bonds that broke in the last step in which any did
        self.breaking = RLock()  # held while bits and broken bonds disagree: results ask for both during a march

    def marched(self) -> MarchedBonds:
        """The bonds as a march sweeps over them."""
        return MarchedTiles(self)

    def to_own_layout(self, state: State) -> State:
        """The state, whose displacements and velocities are in memory that is free between steps; see `rows_in`."""
        nodes = len(self._stiffness_bound)
        return copy_state(state, state._replace(value=rows_in(self.u[1], nodes), rate=rows_in(self.v[1], nodes)))

    def only(self, first: int, last: int) -> None:
        """Sum and break the bonds of the nodes `first` to `last` - 1 alone, and of those in their tiles."""
        in_range = (self.tiles.node >= first) & (self.tiles.node < last)
        tiles = np.flatnonzero(in_range.reshape(-1, ROW).any(axis=1))
        self.summed_tiles = int(tiles[0]), int(tiles[-1]) + 1

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long."""
        with self.breaking:
            self.place_displacements(state.value)
            broken_by_tile: list[tuple[int, Breaks]] = []  # first tile of a sum, and the bonds that broke in it
            waiting: list[int] = []  # tiles whose bonds soften for the first time
            room = ROOM * ROW * len(self.tiles.offsets)

            def work(first: int, last: int) -> None:
                breaks = room_for(room)
                of_state = state.rate, dt, step, out, state.dissipated
                while first < last:
                    begin, breaks.used[0] = first, 0
                    first = sum_tiles(self.tiles, self.u[0], *of_state, breaks, first, last)
                    if breaks.used[0]:
                        broken_by_tile.append((begin, copy_breaks(breaks)))
                    elif first == begin:
                        waiting.append(first)
                        first += 1

            pull_all_again(self.tiles, self.u[0], state.rate, dt, step, self.pending, out)
            self._share(work)
            if waiting:
                self.extend(np.array(sorted(waiting)))
                for tile in sorted(waiting):
                    work(tile, tile + 1)
            self.drop_pending_before(step)
            if broken_by_tile:
                self.take_out(join_breaks([breaks for _, breaks in sorted(broken_by_tile, key=lambda one: one[0])]))

    def extend(self, tile_numbers: NDArray[np.int64]) -> None:
        """Give tiles (s,) whose bonds soften a memory."""
        self.tiles = tile_bonds.with_memory(self.tiles, tile_numbers)

    def take_out(self, breaks: Breaks) -> None:
        """Note bonds that are broken now, in the order of steps."""
        self._new.append(Broken(*breaks.bonds.T))
        self.pending = select_breaks(breaks, breaks.bonds[:, 0] == breaks.bonds[-1, 0])

    def drop_pending_before(self, step: int) -> None:
        """Forget the bonds that broke before a step: they have pulled for a second time."""
        self.pending = select_breaks(self.pending, self.pending.bonds[:, 0] >= step)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The energy densities (n,), J/m^3, that nodes hold, and that softening has spent so far."""
        self.place_displacements(state.value)
        strain_energy, spent = np.zeros((2, len(self._stiffness_bound)))
        tiles, u = self.tiles, self.u[0]
        self._share(lambda first, last: sum_energies(tiles, tiles, u, strain_energy, spent, first, last, None))
        return strain_energy, spent

    def _intact_bonds(self) -> IntactBonds:
        rows = np.arange(len(self._stiffness_bound))
        return IntactBonds(*tile_bonds.list_bonds(self.sites, self.tiles.bits, rows))

    def _springs(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return tile_bonds.springs_of_bonds(self.tiles, self.sites, *bonds)

    def _softened_stiffness(self, bonds: IntactBonds, stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
        return stiffness * tile_bonds.remaining_shares(self.tiles, self.sites, bonds.source, bonds.number)

    def _history(self, bonds: IntactBonds) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        unbreakable = self.tiles.unbreakable[bonds.source] | self.tiles.unbreakable[bonds.target]
        peak, limit = (
            np.where(unbreakable, np.inf, row[0, bonds.number]) for row in (self.tiles.peak, self.tiles.limit)
        )
        return peak, limit, tile_bonds.largest_stretches(self.tiles, self.sites, bonds.source, bonds.number)

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of source and target of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        end_row = len(self._stiffness_bound) if end_row is None else end_row
        bits, tile = self._whole(first_row, end_row) if at_start else (self.tiles.bits, 0)
        bond_lists = [
            tile_bonds.list_bonds(self.sites, bits, np.arange(begin, min(begin + ROWS, end_row)), tile)
            for begin in range(first_row, max(end_row, first_row + 1), ROWS)
        ]
        source, target, _ = (np.concatenate(column) for column in zip(*bond_lists, strict=True))
        return source, target

    def broken(self, after_step: int = 0) -> Broken:
        """The bonds broken after a step: step, source and target row of each."""
        with self.breaking:
            if self._new:
                every = zip(self._broken, *self._new, strict=True)
                self._broken, self._new = Broken(*(np.concatenate(columns) for columns in every)), []
        return self._broken if after_step == 0 else self._broken.after(after_step)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes: nothing of bonds that do not soften."""
        tiles, (_, bonds, _, stretch) = self.tiles, self.pending
        pending = pending_to_arrays(PendingPulls(bonds[:, 1], bonds[:, 2], stretch))
        if not self._softens:
            return pending
        tile = np.flatnonzero(tiles.memory >= 0)
        remembering = tile_bonds.with_pending(tiles.bits, self.pending)[tile]
        worst = tiles.worst[tiles.memory[tile]]
        worst = worst * ((remembering[..., None] >> np.arange(ROW, dtype=np.uint16)) & np.uint16(1))
        which, slot, lane = np.nonzero(worst)
        site = tile[which] * ROW + lane
        source, target = (tiles.node[at].astype(np.int64) for at in (site, site + tiles.offsets[slot]))
        return pending | {"worst": worst[which, slot, lane], "worst_source": source, "worst_target": target}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        bits, _ = self._whole(0, len(self._stiffness_bound))
        tile_bonds.remove_bonds(self.sites, broken.source, broken.target, bits)
        pending = read_pending_pulls(checkpoint, len(self._stiffness_bound), np.float64)
        self.pending = tile_bonds.place_pending(self.sites, pending, broken)
        if self._softens:
            worst = entry(checkpoint, "worst", (None,), np.float64)
            nodes = len(self._stiffness_bound) - 1
            source, target = (
                entry(checkpoint, f"worst_{end}", worst.shape, np.int64, 0, nodes) for end in ("source", "target")
            )
            remembering = tile_bonds.with_pending(bits, self.pending).copy()
            tile_bonds.remove_bonds(self.sites, source, target, remembering)  # raises for what is no bond
            tile, slot, bit = tile_bonds.find_slots(self.sites, source, target)
            self.tiles = tile_bonds.with_memory(tile_bonds.without_memory(self.tiles), np.unique(tile))
            recall(self.tiles, tile, slot, np.log2(bit).astype(np.int64), worst)
        self.tiles.bits[:] = bits
        self.take_over(Broken(*(column.astype(np.int64) for column in broken)), self.pending)

    def take_over(self, broken: Broken, pending: Breaks) -> None:
        """Take over the bonds that are broken so far, and of these those that pull once more."""
        self._broken, self._new, self.pending = broken, [], pending

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        arrays = (*self.tiles, self.sites.site, self.sites.ways, self.u, self.v, self._stiffness_bound, *self.broken())
        return sum(getattr(array, "nbytes", 0) for array in arrays)

    def _whole(self, first: int, last: int) -> tuple[NDArray[np.uint16], int]:
        """The bits (s, k) at the start of s tiles, which have the rows `first` to `last` - 1, and the first tile."""
        low, high = 0, len(self.tiles.bits)
        if 0 < last - first < len(self._stiffness_bound):
            row_tiles = (self.sites.site[first:last] - self.sites.margin) // ROW
            low, high = int(row_tiles.min()), int(row_tiles.max()) + 1
        with self.breaking:
            bits, (_, source, target) = self.tiles.bits[low:high].copy(), self.broken()
        of_these = (source >= first) & (source < last)
        tile, slot, bit = tile_bonds.find_slots(self.sites, source[of_these], target[of_these])
        np.bitwise_or.at(bits, (tile - low, slot), bit)
        return bits, low

    def place_displacements(self, value: NDArray[Any]) -> None:
        """Place the displacements (n, d), m, of nodes at their sites, `u[0]`."""
        nodes = len(self._stiffness_bound)
        share(lambda first, last: place_rows(self.sites.site, value, self.u[0], first, last), nodes, self.threads)

    def _share(self, work: Callable[[int, int], None]) -> None:
        begin, end = self.summed_tiles
        rows = ROW * (end - begin)
        share(lambda first, last: work(begin + first // ROW, begin + last // ROW), rows, self.threads)
