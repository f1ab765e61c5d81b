"""The brittle bonds of a cubic lattice on a device: an operator whose history is there while steps are taken."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.errors import UnstableError
from pdsolve.laws.calls import functions_of
from pdsolve.laws.law import Law
from pdsolve.operators.device.runtime import Session
from pdsolve.operators.device.source import body_functions
from pdsolve.operators.protocol import Kept
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.space_lattice.kernel import Tiles
from pdsolve.operators.space_lattice.operator import SpaceLattice
from pdsolve.operators.space_lattice.sites import Sites
from pdsolve.state import Broken

WORD, GROUP = 32, 64  # bits; work items
FEWEST, EACH = 1 << 16, 16  # bonds that may break between two looks, and for each node


class SpaceOnDevice(SpaceLattice):
    """The bonds of n nodes on a cubic lattice whose steps a device takes; see `pdsolve.steppers.verlet_on_device`.

    The bits of tiles are those of the last `fetch`.
    """

    def __init__(
        self, law: Law, tiles: Tiles, sites: Sites, stiffest: NDArray[np.float64], symmetric: bool, session: Session
    ) -> None:
        """Arguments are those of `SpaceLattice`. Raises ModelError if the device has too little memory."""
        super().__init__(law, tiles, sites, stiffest, symmetric, 1)
        self.session, self.dimension, self.fused, self.stale = session, 3, False, True
        self.room = -(-sites.size // GROUP) * GROUP
        self._words, self._most = -(-len(tiles.offsets) // WORD), max(FEWEST, EACH * len(stiffest))
        tables = (tiles.offsets, tiles.table, tiles.c, tiles.cells, tiles.kind, tiles.peak, tiles.limit)
        own = self.room * (4 * self._words + 4 + 2 + 8) + 12 * self._most
        session.room_for(int(sum(table.nbytes for table in tables) + own))
        self._make()

    def _make(self) -> None:
        """Copy the tables to the device, and make room for what changes."""
        tiles, put, site = self.tiles, self.session.put, self._sites.site
        node = np.full(self.room, -1, dtype=np.int32)
        node[site] = np.arange(len(site))
        wide = [np.pad(each, ((0, 0), (0, self.room - each.shape[1]))) for each in (tiles.c, tiles.cells)]
        of_nodes = [self.spread(values.astype(np.uint8)) for values in (tiles.held, tiles.material)]
        tables = tiles.offsets, tiles.table, *wide, tiles.kind, node, *of_nodes, tiles.peak, tiles.limit
        self._tables = [put(table) for table in tables]
        self._intact = put(np.zeros((self._words, self.room), dtype=np.uint32))
        self._breaks, self._used = put(np.zeros((self._most, 3), dtype=np.int32)), put(np.zeros(2, dtype=np.int32))
        self.dissipated = put(np.zeros(self.room))

    @property
    def arguments(self) -> list[Any]:
        """The buffers of `FORCE_PARAMETERS`, in order."""
        return [*self._tables, self._intact, self._breaks, self._used, self.dissipated]

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
        }
        return body_functions(functions_of(self._law), numbers, "space.cl")

    def spread(self, values: NDArray[Any], idle: float = 0.0) -> NDArray[Any]:
        """Nodal values (n, ...) at their sites (..., m)."""
        wide = np.full((*values.shape[1:], self.room), idle, dtype=values.dtype)
        wide[..., self._sites.site] = values.T
        return wide

    def rows(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where the device has these nodes (k,)."""
        return self._sites.site[nodes].astype(np.int64)

    def collected(self, values: NDArray[Any], state: NDArray[Any]) -> None:
        """Enter values (..., m) of the device in an array (n, ...) of the state."""
        state[:] = values[..., self._sites.site].T

    def back(self, kept: Kept, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        super().back(kept, broken)
        self.stale = True

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if not self.stale:
            return
        found = np.zeros((self._words, self.room), dtype=np.uint32)
        of_tiles = slice(self.tiles.margin, self.tiles.margin + ROW * len(self.tiles.bits))
        lanes = np.arange(ROW, dtype=np.uint16)
        for slot, bits in enumerate(self.tiles.bits.T):
            there = (bits[:, None] >> lanes & np.uint16(1)).astype(np.uint32).ravel()
            found[slot // WORD, of_tiles] |= there << np.uint32(slot % WORD)
        self.session.write(self._intact, found)
        self.stale = False

    def fetch(self) -> None:
        """Bring the history of bonds up to the device's. Raises UnstableError if more have broken than there is room
        for."""
        used = np.zeros(2, dtype=np.int32)
        self.session.read(self._used, used)
        count = int(used[0])
        if count > self._most:
            raise UnstableError(
                f"found {count} bonds broken since the last look, expected at most {self._most} on a device:"
                " smaller run.ledger, or --device cpu"
            )
        if not count:
            return
        breaks = np.zeros((count, 3), dtype=np.int32)
        self.session.read(self._breaks, breaks)
        self.session.write(self._used, np.zeros(2, dtype=np.int32))
        own, slot = breaks[:, 0] - self.tiles.margin, breaks[:, 1]
        bit = np.uint16(1) << (own % ROW).astype(np.uint16)
        target = self.tiles.node[own + self.tiles.offsets[slot]]
        with self._breaking:
            np.bitwise_and.at(self.tiles.bits, (own // ROW, slot), ~bit)
            ends = (breaks[:, 2], self.tiles.node[own], target)
            self._new.append(Broken(*(column.astype(np.int64) for column in ends)))
