"""The kernel in space as an operator: pair laws on a cubic lattice."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.sums import sum_tiles
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
    sum_energies_of_tiles,
)
from pdsolve.laws.calls import bind
from pdsolve.laws.law import Law
from pdsolve.numerics.thread_team import share
from pdsolve.operators.pending_pulls import PendingPulls, pending_to_arrays, read_pending_pulls
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.space_lattice import layout
from pdsolve.operators.space_lattice.sites import Sites
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROWS = 65536  # whose bonds are listed together
ROOM = 16  # tiles all of whose bonds may break before the kernel asks for more room


class SpaceLattice:
    """The bonds of n nodes on a cubic lattice under a pair law; see `Operator`."""

    name = "blocks"
    unknowns: tuple[Unknown, ...] = (Unknown("u", 3, 2),)

    def __init__(
        self, law: Law, tiles: Tiles, sites: Sites, bound: NDArray[np.float64], symmetric: bool, threads: int
    ) -> None:
        """`bound` (n,), N/m^4, of the stiffness of nodes."""
        bind(law)
        self._law, self.tiles, self.symmetric = law, tiles, symmetric
        self._softens = law.pair is not None and law.pair.softening is not None
        self.sites, self._stiffness_bound, self.threads = sites, bound, threads
        self.summed_tiles = 0, len(tiles.kind)  # tiles
        self.u = aligned(np.zeros((3, tiles.cells.shape[1]), dtype=tiles.cells.dtype))
        self._broken = Broken(*(np.zeros(0, dtype=np.int64) for _ in Broken._fields))
        self._new: list[Broken] = []
        self.pending = room_for(0)  # bonds that broke in the last step in which any did
        self.breaking = RLock()  # held while bits and broken bonds disagree: results ask for both during a march

    def to_own_layout(self, state: State) -> State:
        """The state itself: its arrays are those of all nodes."""
        return state

    def only(self, first: int, last: int) -> None:
        """Sum and break the bonds of the nodes `first` to `last` - 1 alone, and of those in their tiles."""
        in_range = (self.tiles.node >= first) & (self.tiles.node < last)
        tiles = np.flatnonzero(in_range.reshape(-1, ROW).any(axis=1))
        self.summed_tiles = int(tiles[0]), int(tiles[-1]) + 1

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long."""
        with self.breaking:
            self._add(state, out, step, dt)

    def _add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        self._place(state.value)
        broken_by_tile: list[tuple[int, Breaks]] = []  # first tile of a sum, and the bonds that broke in it
        waiting: list[int] = []  # tiles whose bonds soften for the first time
        room = ROOM * ROW * len(self.tiles.offsets)

        def work(first: int, last: int) -> None:
            breaks = room_for(room)
            of_state = state.rate, dt, step, out, state.dissipated
            while first < last:
                begin, breaks.used[0] = first, 0
                first = sum_tiles(self.tiles, self.u, *of_state, breaks, first, last)
                if breaks.used[0]:
                    broken_by_tile.append((begin, copy_breaks(breaks)))
                elif first == begin:
                    waiting.append(first)
                    first += 1

        pull_all_again(self.tiles, self.u, state.rate, dt, step, self.pending, out)
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
        self.tiles = layout.extended(self.tiles, tile_numbers)

    def take_out(self, breaks: Breaks) -> None:
        """Note bonds that are broken now, in the order of steps."""
        self._new.append(Broken(*breaks.bonds.T))
        self.pending = select_breaks(breaks, breaks.bonds[:, 0] == breaks.bonds[-1, 0])

    def drop_pending_before(self, step: int) -> None:
        """Forget the bonds that broke before a step: they have pulled for a second time."""
        self.pending = select_breaks(self.pending, self.pending.bonds[:, 0] >= step)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The energy densities (n,), J/m^3, that nodes hold, and that softening has spent so far."""
        self._place(state.value)
        strain_energy, spent = np.zeros((2, len(self._stiffness_bound)))
        tiles, u = self.tiles, self.u
        self._share(lambda first, last: sum_energies_of_tiles(tiles, u, strain_energy, spent, first, last))
        return strain_energy, spent

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """No fields: a pair law stores none beside the displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness that resists each node's motion, N/m^4; see `Operator`."""
        return self._stiffness_bound

    def tangent(self, state: State) -> csr_array:
        """The tangent (n w, n w), N/m^4: minus the derivative of the force densities by the values."""
        from pdsolve.operators.tangent import of_curves, of_springs  # SciPy takes long to import, and few runs ask

        source, target, slot = layout.intact(self.sites, self.tiles.bits, np.arange(len(self._stiffness_bound)))
        xi, pull = layout.springs(self.tiles, self.sites, source, target, slot)
        if self._law.pair is not None and self._law.pair.is_curved:
            unbreakable = self.tiles.unbreakable[source] | self.tiles.unbreakable[target]
            peak, limit = (np.where(unbreakable, np.inf, row[0, slot]) for row in (self.tiles.peak, self.tiles.limit))
            worst = layout.largest_stretches(self.tiles, self.sites, source, slot)
            return of_curves(self._law, source, target, xi, (pull, peak, limit, worst), state.value)
        eta = state.value[target].astype(np.float64) - state.value[source]
        e = ((2 * xi + eta) * eta).sum(axis=1) / (xi**2).sum(axis=1)
        pull *= layout.shares(self.tiles, self.sites, source, slot, e)
        return of_springs(source, target, xi, pull, state.value)

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of source and target of the intact bonds of the nodes `first` to `last` - 1, or of those at the
        `start`."""
        last = len(self._stiffness_bound) if last is None else last
        bits, tile = self._whole(first, last) if start else (self.tiles.bits, 0)
        bond_lists = [
            layout.intact(self.sites, bits, np.arange(begin, min(begin + ROWS, last)), tile)
            for begin in range(first, max(last, first + 1), ROWS)
        ]
        source, target, _ = (np.concatenate(column) for column in zip(*bond_lists, strict=True))
        return source, target

    def broken(self, after: int = 0) -> Broken:
        """The bonds broken after a step: step, source and target row of each."""
        with self.breaking:
            if self._new:
                every = zip(self._broken, *self._new, strict=True)
                self._broken, self._new = Broken(*(np.concatenate(columns) for columns in every)), []
        if after == 0:
            return self._broken
        later = self._broken.step > after
        return Broken(*(column[later] for column in self._broken))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes: nothing of bonds that do not soften."""
        tiles, (_, bonds, _, stretch) = self.tiles, self.pending
        pending = pending_to_arrays(PendingPulls(bonds[:, 1], bonds[:, 2], stretch))
        if not self._softens:
            return pending
        tile = np.flatnonzero(tiles.memory >= 0)
        remembering = layout.with_pending(tiles.bits, self.pending)[tile]
        worst = tiles.worst[tiles.memory[tile]]
        worst = worst * ((remembering[..., None] >> np.arange(ROW, dtype=np.uint16)) & np.uint16(1))
        which, slot, lane = np.nonzero(worst)
        site = tile[which] * ROW + lane
        source, target = (tiles.node[at].astype(np.int64) for at in (site, site + tiles.offsets[slot]))
        return pending | {"worst": worst[which, slot, lane], "worst_source": source, "worst_target": target}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        bits, _ = self._whole(0, len(self._stiffness_bound))
        layout.cleared(self.sites, broken.source, broken.target, bits)
        pending = read_pending_pulls(checkpoint, len(self._stiffness_bound), np.float64)
        self.pending = layout.place_pending(self.sites, pending, broken)
        if self._softens:
            self._recall(checkpoint, layout.with_pending(bits, self.pending))
        self.tiles.bits[:] = bits
        self._broken, self._new = Broken(*(column.astype(np.int64) for column in broken)), []

    def _recall(self, checkpoint: CheckpointArrays, bits: NDArray[np.uint16]) -> None:
        """Restore what the bonds in the bits (t, k) remember."""
        worst = entry(checkpoint, "worst", (None,), np.float64)
        nodes = len(self._stiffness_bound) - 1
        source, target = (
            entry(checkpoint, f"worst_{end}", worst.shape, np.int64, 0, nodes) for end in ("source", "target")
        )
        layout.cleared(self.sites, source, target, bits.copy())  # raises for what is no bond
        tile, slot, bit = layout.placed(self.sites, source, target)
        self.tiles = layout.extended(layout.forgetful(self.tiles), np.unique(tile))
        recall(self.tiles, tile, slot, np.log2(bit).astype(np.int64), worst)

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        arrays = (*self.tiles, self.sites.site, self.sites.ways, self.u, self._stiffness_bound, *self.broken())
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
        tile, slot, bit = layout.placed(self.sites, source[of_these], target[of_these])
        np.bitwise_or.at(bits, (tile - low, slot), bit)
        return bits, low

    def _place(self, value: NDArray[Any]) -> None:
        nodes = len(self._stiffness_bound)
        share(lambda first, last: place_rows(self.sites.site, value, self.u, first, last), nodes, self.threads)

    def _share(self, work: Callable[[int, int], None]) -> None:
        begin, end = self.summed_tiles
        share(lambda first, last: work(begin + first, begin + last), end - begin, self.threads)
