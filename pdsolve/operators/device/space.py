"""The bonds of a cubic lattice on a device: an operator whose history is there while steps are taken."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.vector_code import ROW
from pdsolve.errors import UnstableError
from pdsolve.lattice.sums import Breaks, Tiles, recall
from pdsolve.laws.calls import functions_of
from pdsolve.laws.law import Law
from pdsolve.operators.device.runtime import Session
from pdsolve.operators.device.source import body_functions, together
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.space_lattice import families, layout
from pdsolve.operators.space_lattice.operator import SpaceLattice
from pdsolve.operators.space_lattice.sites import Sites
from pdsolve.state import Broken

WORD, GROUP = 32, 64  # bits; work items
FEWEST, EACH = 1 << 24, 32  # bonds that may break between two looks, and for each node; in small bodies all


class SpaceOnDevice(SpaceLattice):
    """The bonds of n nodes on a cubic lattice whose steps a device takes; see `pdsolve.steppers.verlet_on_device`.

    The bits of tiles are those of the last `fetch`.
    """

    def __init__(
        self, law: Law, tiles: Tiles, sites: Sites, bound: NDArray[np.float64], symmetric: bool, session: Session
    ) -> None:
        """Arguments are those of `SpaceLattice`. Raises ModelError if the device has too little memory."""
        super().__init__(law, tiles, sites, bound, symmetric, 1)
        self.session, self.dimension, self.needs_upload = session, 3, True
        self.scheme = ("FUSED", "DIVIDES")  # of steps, see verlet.cl
        self.room = -(-sites.size // GROUP) * GROUP
        self.together = together(session.about.kind, tiles.table.dtype)
        self._words, self._most = -(-len(tiles.offsets) // WORD), max(FEWEST, EACH * len(bound))
        self._most = min(self._most, int(families.counts(tiles.bits, sites).sum()))
        tables = (tiles.offsets, tiles.table, tiles.c, tiles.cells, tiles.kind, tiles.peak, tiles.limit)
        buffer_sizes = [self.room * size for size in (4 * self._words, 4, 1, 1, 8)]
        buffer_sizes += [4 * len(tiles.kind)] * 2
        buffer_sizes += [16 * self._most, 8 * self._most, 4 * self.room, self._history_bytes() * len(tiles.kind)]
        session.room_for(*(table.nbytes for table in tables), *buffer_sizes)
        self._make()

    def _make(self) -> None:
        """Copy the tables to the device, and make room for what changes."""
        tiles, upload, site = self.tiles, self.session.put, self.sites.site
        node = np.full(self.room, -1, dtype=np.int32)
        node[site] = np.arange(len(site))
        wide = [np.pad(array, ((0, 0), (0, self.room - array.shape[1]))) for array in (tiles.c, tiles.cells)]
        of_nodes = [self.spread(values.astype(np.uint8)) for values in (tiles.unbreakable, tiles.material)]
        tables = tiles.offsets, tiles.table, *wide, tiles.kind, node, *of_nodes, tiles.peak, tiles.limit
        self._tables = [upload(table) for table in tables]
        self._intact = upload(np.zeros((self._words, self.room), dtype=np.uint32))
        self._breaks, self._used = self.session.zeros(16 * self._most), upload(np.zeros(2, dtype=np.int32))
        self._stretches, self._first_break = self.session.zeros(8 * self._most), self.session.zeros(4 * self.room)
        self._known = 0  # of the device's broken bonds, those that the host has
        self.dissipated = upload(np.zeros(self.room))
        self._memory, self._torn = (upload(np.zeros(len(tiles.kind), dtype=np.int32)) for _ in range(2))
        self._worst = self.session.zeros(self._history_bytes() * len(tiles.kind))

    def _history_bytes(self) -> int:
        """Memory of what the bonds of a tile remember, bytes."""
        return 8 * ROW * len(self.tiles.offsets) if self._softens else 0

    @property
    def arguments(self) -> list[Any]:
        """The buffers of `FORCE_PARAMETERS`, in order."""
        history = self._intact, self._breaks, self._used, self.dissipated, self._memory, self._torn, self._worst
        return [*self._tables, *history, self._stretches, self._first_break]

    def source(self) -> str:
        """What the bonds are in OpenCL C."""
        tiles = self.tiles
        numbers = {
            "MARGIN": tiles.margin,
            "COUNT": len(tiles.offsets),
            "PAIRS": len(tiles.peak),
            "MATERIALS": round(len(tiles.peak) ** 0.5),
            "ROOM": self._most,
            "NEAR": float(tiles.near).hex(),
            "FLOOR": "-INFINITY" if np.isinf(tiles.floor) else float(tiles.floor).hex(),
        }
        return body_functions(functions_of(self._law), numbers, self._softens)

    def spread(self, values: NDArray[Any], idle: float = 0.0) -> NDArray[Any]:
        """Nodal values (n, ...) at their sites (..., m)."""
        wide = np.full((*values.shape[1:], self.room), idle, dtype=values.dtype)
        wide[..., self.sites.site] = values.T
        return wide

    def rows(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where the device has these nodes (k,)."""
        return self.sites.site[nodes].astype(np.int64)

    def collected(self, values: NDArray[Any], state: NDArray[Any]) -> None:
        """Enter values (..., m) of the device in an array (n, ...) of the state."""
        state[:] = values[..., self.sites.site].T

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        super().restore(checkpoint, broken)
        self.needs_upload = True

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if not self.needs_upload:
            return
        intact_bits = np.zeros((self._words, self.room), dtype=np.uint32)
        of_tiles = slice(self.tiles.margin, self.tiles.margin + ROW * len(self.tiles.bits))
        lanes = np.arange(ROW, dtype=np.uint16)
        for slot, bits in enumerate(self.tiles.bits.T):
            slot_bits = (bits[:, None] >> lanes & np.uint16(1)).astype(np.uint32).ravel()
            intact_bits[slot // WORD, of_tiles] |= slot_bits << np.uint32(slot % WORD)
        self.session.write(self._intact, intact_bits)
        if self._softens:  # what softened bonds remember
            tiles = self.tiles
            self.session.clear(self._worst)
            self.session.write(self._memory, (tiles.memory >= 0).astype(np.int32))
            self.session.write(self._torn, np.zeros(len(tiles.kind), dtype=np.int32))
            for tile in np.flatnonzero(tiles.memory >= 0).tolist():
                self.session.write(self._worst, tiles.worst[tiles.memory[tile]], tile * self._history_bytes())
        self._hand_over_pending()
        self.needs_upload = False

    def _hand_over_pending(self) -> None:
        """Put the bonds that broke in the last step before those that will break."""
        count, first_break = len(self.pending.bonds), np.zeros(self.room, dtype=np.int32)
        site, slot = self.pending.places.T
        breaks = np.zeros((count, 4), dtype=np.int32)
        breaks[:, :3] = np.column_stack([self.tiles.margin + site, slot, self.pending.bonds[:, 0]])
        order = np.argsort(site, kind="stable")  # those of a site one after the other
        breaks, stretch = breaks[order], self.pending.stretch_before[order]
        breaks[:-1, 3] = np.where(breaks[1:, 0] == breaks[:-1, 0], np.arange(2, count + 1), 0)
        first_break[breaks[::-1, 0]] = np.arange(count, 0, -1)  # the first one
        if count:
            self.session.write(self._breaks, breaks)
            self.session.write(self._stretches, stretch)
        self.session.write(self._first_break, first_break)
        self.session.write(self._used, np.array([count, 0], dtype=np.int32))
        self._known = count

    def _fetch_memory(self) -> None:
        """Bring what bonds remember up to the device's, in tiles of which one has softened."""
        torn = np.zeros(len(self.tiles.kind), dtype=np.int32)
        self.session.read(self._torn, torn)
        torn_tiles = np.flatnonzero(torn)
        if not len(torn_tiles):
            return
        worst = np.empty((len(torn_tiles), len(self.tiles.offsets), ROW))
        for number, tile in enumerate(torn_tiles.tolist()):
            self.session.read(self._worst, worst[number], tile * self._history_bytes())
        with self.breaking:
            self.tiles = layout.extended(self.tiles, torn_tiles[self.tiles.memory[torn_tiles] < 0])
            which, slot, lane = np.nonzero(worst)
            recall(self.tiles, torn_tiles[which], slot, lane, worst[which, slot, lane])
        self.session.write(self._torn, np.zeros_like(torn))

    def fetch(self, step: int) -> None:
        """Bring the history of bonds up to the device's after a step. Raises UnstableError if more have broken than
        there is room for."""
        if self._softens:
            self._fetch_memory()
        used = np.zeros(2, dtype=np.int32)
        self.session.read(self._used, used)
        count = int(used[0])
        if count > self._most:
            raise UnstableError(
                f"{count} bonds broke since the last record, and a device takes at most {self._most}; use a smaller"
                " run.ledger, or --device cpu"
            )
        self.drop_pending_before(step)
        if count == self._known:
            return
        breaks, stretch = np.zeros((count, 4), dtype=np.int32), np.zeros(count)
        self.session.read(self._breaks, breaks)
        self.session.read(self._stretches, stretch)
        order = self._known + np.lexsort(breaks[self._known :].T[[1, 0, 2]])
        breaks, stretch = breaks[order], stretch[order]
        source, slot = breaks[:, 0] - self.tiles.margin, breaks[:, 1]
        bit = np.uint16(1) << (source % ROW).astype(np.uint16)
        target = self.tiles.node[source + self.tiles.offsets[slot]]
        with self.breaking:
            np.bitwise_and.at(self.tiles.bits, (source // ROW, slot), ~bit)
            bonds = np.column_stack([breaks[:, 2], self.tiles.node[source], target]).astype(np.int64)
            places = np.column_stack([source, slot]).astype(np.int64)
            self.take_out(Breaks(np.array([len(bonds)]), bonds, places, stretch))
        self.drop_pending_before(step)
        self._hand_over_pending()
