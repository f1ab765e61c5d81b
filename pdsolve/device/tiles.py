"""The bonds of lattices under a pair law on a device: operators whose history is there while steps are taken."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.vector_code import ROW
from pdsolve.device.nodes import NodesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.device.source import pair_functions, together
from pdsolve.errors import UnstableError
from pdsolve.lattice import block_bonds, tile_bonds
from pdsolve.lattice.blocks import BOUND, LIMITS, PULL
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import LANES
from pdsolve.lattice.operator import BlockLattice, TileLattice
from pdsolve.lattice.tiles import Breaks, recall
from pdsolve.laws.law import Law

WORD = 32  # bits
FEWEST, EACH = 1 << 24, 32  # bonds that may break between two looks, and for each node; in small bodies all
SOFTENED, CHANGED = 1, 2  # of a group's memory: a bond has softened; since the host looked


class BondsOnDevice(NodesOnDevice, ABC):
    """The bonds of n nodes whose steps a device takes; see `pdsolve.device.nodes`.

    What the processor knows of bonds is that of the last `fetch`. A group of nodes, one a lane, has slots in common.
    """

    _law: Law
    _remembers: bool  # whether bonds soften
    _first_place = 0  # of the first group
    _starts: NDArray[np.int64]  # (groups + 1,) first slot of each group, in histories (slots, lanes) of bonds
    _lanes: int

    def _upload_bonds(
        self, session: Session, tables: dict[str, NDArray[Any]], bonds: int, own_edge: NDArray[Any], **numbers: Any
    ) -> None:
        """Copy tables to the device, and make room for what so many bonds become; `own_edge` (0,) or (slots, lanes) is
        of the type of what they remember. Raises ModelError if the device has too little memory."""
        assert self._law.pair is not None
        groups, kind = len(self._starts) - 1, own_edge.dtype
        self._kind = kind
        self._words = -(-int(np.diff(self._starts).max(initial=1)) // WORD)
        self._most, self._known = min(max(FEWEST, EACH * groups * self._lanes), bonds), 0
        history = {
            "intact": np.zeros((self._words, self.room), dtype=np.uint32),
            "breaks": np.zeros((self._most, 4), dtype=np.int32),
            "used": np.zeros(1, dtype=np.int32),
            "stretches": np.zeros(self._most, dtype=kind),
            "first_break": np.zeros(self.room, dtype=np.int32),
            "dissipated": np.zeros(self.room),
            "memory": np.zeros(groups, dtype=np.int32),
            "worst": np.zeros((int(self._starts[-1]) if self._remembers else 0, self._lanes), dtype=kind),
            "own_edge": own_edge,
        }
        floor = "0.0" if self._law.pair.elastic_in_compression else "-INFINITY"
        self._numbers = {"ROOM": self._most, "FLOOR": floor, **numbers}
        self.upload(session, tables | history)

    def source(self) -> str:
        """What the bonds are in OpenCL C. Raises ModelError for a law that no device computes to the same bits."""
        return self.declarations + "\n" + pair_functions(self._law, self._remembers, **self._numbers)

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if not self.needs_upload:
            return
        masks = self._masks()
        intact, slots = np.zeros((self._words, self.room), dtype=np.uint32), np.diff(self._starts)
        places = slice(self._first_place, self._first_place + self._lanes * len(slots))
        for k in range(int(slots.max(initial=0))):
            group = np.flatnonzero(slots > k)
            bits = np.unpackbits(masks[self._starts[group] + k, None].view(np.uint8), axis=1, bitorder="little")
            intact[k // WORD, places].reshape(-1, self._lanes)[group] |= bits.astype(np.uint32) << np.uint32(k % WORD)
        self.write("intact", intact)
        if self._remembers:
            self._write_history()
        self._write_pending()
        self.needs_upload = False

    def _write_pending(self) -> None:
        """Put the bonds that broke in the last step before those that will break."""
        place, slot, step, stretch = self._pending_bonds()
        count, first_break = len(place), np.zeros(self.room, dtype=np.int32)
        order = np.argsort(place, kind="stable")  # those of a node one after the other
        breaks = np.column_stack([place, slot, step, np.zeros_like(place)])[order].astype(np.int32)
        breaks[:-1, 3] = np.where(breaks[1:, 0] == breaks[:-1, 0], np.arange(2, count + 1), 0)
        first_break[breaks[::-1, 0]] = np.arange(count, 0, -1)  # the first one
        self.write("breaks", breaks)
        self.write("stretches", stretch[order])
        self.write("first_break", first_break)
        self.write("used", np.array([count], dtype=np.int32))
        self._known = count  # of the device's broken bonds, those that the host has

    def fetch(self, step: int) -> None:
        """Bring the history of bonds up to the device's after a step. Raises UnstableError if more have broken than
        there is room for."""
        softened = False
        if self._remembers:
            memory = self.read("memory", np.zeros(len(self._starts) - 1, dtype=np.int32))
            changes = np.flatnonzero(np.diff(np.concatenate([[0], memory == CHANGED, [0]])))
            for first, last in changes.reshape(-1, 2).tolist():  # groups side by side are copied together
                self._enter_history(first, last)
            softened = len(changes) > 0
            if softened:
                self.write("memory", np.minimum(memory, SOFTENED))
        count = int(self.read("used", np.zeros(1, dtype=np.int32))[0])
        if count > self._most:
            raise UnstableError(
                f"{count} bonds broke since the last record, and a device takes at most {self._most}; use a smaller"
                " run.ledger, or --device cpu"
            )
        if not count and not softened:
            return
        breaks = self.read("breaks", np.zeros((count, 4), dtype=np.int32))
        stretch = self.read("stretches", np.zeros(count, dtype=self._kind))
        order = self._known + np.lexsort(breaks[self._known :].T[[1, 0, 2]])
        self._enter_breaks(breaks[order, :3].astype(np.int64), stretch[order], step)
        self._write_pending()

    def _read_groups(self, name: str, first: int, last: int) -> NDArray[Any]:
        """What the bonds of the groups `first` to `last` - 1 remember (slots, lanes)."""
        slots = self._starts[[first, last]]
        values = np.empty((slots[1] - slots[0], self._lanes), dtype=self._kind)
        return self.read(name, values, int(slots[0]) * self._lanes * values.itemsize)

    @abstractmethod
    def _masks(self) -> NDArray[Any]:
        """Bits (slots,) of lanes with an intact bond."""

    @abstractmethod
    def _write_history(self) -> None:
        """Give the device what bonds remember."""

    @abstractmethod
    def _enter_history(self, first: int, last: int) -> None:
        """Enter what the bonds of the groups `first` to `last` - 1 remember."""

    @abstractmethod
    def _pending_bonds(self) -> tuple[NDArray[Any], ...]:
        """Bonds that broke in the last step: place of the node, slot, step, and stretch one step before."""

    @abstractmethod
    def _enter_breaks(self, breaks: NDArray[np.int64], stretch: NDArray[Any], last: int) -> None:
        """Enter bonds that broke up to the step `last`: their places, slots and steps (k, 3), and their stretches."""


class TilesOnDevice(BondsOnDevice, TileLattice):
    """The bonds of n nodes on a cubic lattice, in tiles of sites."""

    def put_on(self, session: Session) -> None:
        """Put the bonds on a device, which takes the steps from here on. Raises ModelError if it has too little
        memory."""
        tiles, sites = self.tiles, self.sites
        self.dimension, self.room, self.place = 3, sites.size, sites.site
        self._remembers, count, groups = self._softens, len(tiles.offsets), len(tiles.kind)
        self._first_place, self._starts, self._lanes = tiles.margin, count * np.arange(groups + 1), ROW
        tables = {name: getattr(tiles, name) for name in ("offsets", "vectors", "c", "cells", "kind", "peak", "limit")}
        tables |= {"node": self.spread(np.arange(len(sites.site), dtype=np.int32), -1)}
        tables |= {name: self.spread(getattr(tiles, name).view(np.uint8)) for name in ("unbreakable", "material")}
        numbers = {"SITES": "", "MARGIN": tiles.margin, "COUNT": count, "PAIRS": len(tiles.peak)}
        numbers |= {"MATERIALS": round(len(tiles.peak) ** 0.5), "NEAR": float(tiles.near).hex()}
        bonds = int(tile_bonds.count_bonds(tiles.bits, sites).sum())
        self.scheme, self.together = ("FUSED", "DIVIDES"), together(session.about.kind, tiles.vectors.dtype)
        self._upload_bonds(session, tables, bonds, np.zeros(0), **numbers)

    def _masks(self) -> NDArray[np.uint16]:
        return self.tiles.bits.ravel()

    def _write_history(self) -> None:
        tiles = self.tiles
        self.session.clear(self.buffers["worst"])
        self.write("memory", (tiles.memory >= 0).astype(np.int32))
        for tile in np.flatnonzero(tiles.memory >= 0).tolist():
            worst = tiles.worst[tiles.memory[tile]]
            self.write("worst", worst, tile * worst.nbytes)

    def _pending_bonds(self) -> tuple[NDArray[Any], ...]:
        pending = self.pending
        site, slot = pending.places.T
        return self.tiles.margin + site, slot, pending.bonds[:, 0], pending.stretch_before

    def _enter_history(self, first: int, last: int) -> None:
        worst, tiles = self._read_groups("worst", first, last).reshape(last - first, -1, ROW), np.arange(first, last)
        with self.breaking:
            self.tiles = tile_bonds.with_memory(self.tiles, tiles[self.tiles.memory[tiles] < 0])
            which, slot, lane = np.nonzero(worst)
            recall(self.tiles, tiles[which], slot, lane, worst[which, slot, lane])

    def _enter_breaks(self, breaks: NDArray[np.int64], stretch: NDArray[Any], last: int) -> None:
        if len(breaks):
            place, slot, step = breaks.T
            site, tiles = place - self.tiles.margin, self.tiles
            source, target = (tiles.node[at].astype(np.int64) for at in (site, site + tiles.offsets[slot]))
            bonds, places = np.column_stack([step, source, target]), np.column_stack([site, slot])
            with self.breaking:
                np.bitwise_and.at(tiles.bits, (site // ROW, slot), ~(np.uint16(1) << (site % ROW).astype(np.uint16)))
                self.take_out(Breaks(np.array([len(bonds)]), bonds, places, stretch))
        self.drop_pending_before(last)


class BlocksOnDevice(BondsOnDevice, BlockLattice):
    """The bonds of n nodes on lattices, in blocks of 64 nodes."""

    def put_on(self, session: Session) -> None:
        """Put the bonds on a device, which takes the steps from here on. Raises ModelError if it has too little
        memory."""
        blocks = self.blocks
        self.dimension = len(blocks.axes)
        self.room = self.tracks.v.shape[1]
        self.place = slice(0, len(self._stiffness_bound))
        self._remembers, self._starts, self._lanes = bool(self.tracks.worst.size), blocks.start, LANES
        self._own_edge = np.zeros_like(self.tracks.worst)
        slots, shared = blocks.slots.copy(), -len(blocks.mask) or None  # rows before those of slots with broken bonds
        slots[:, PULL], slots[:, BOUND] = blocks.whole, blocks.slots[:, LIMITS]
        tables = {name: getattr(blocks, name) for name in ("of_rows", "ids", "vectors", "peak", "limit")}
        tables |= {"slots": slots, "stiffness": blocks.stiffness[:shared], "edge": blocks.edge[:shared]}
        tables |= {name: getattr(blocks, name).astype(np.int32) for name in ("start", "start_of_rows")}
        bonds = int(np.unpackbits(blocks.mask.view(np.uint8)).sum())
        self.scheme, self.together = ("FUSED",), together(session.about.kind, blocks.vectors.dtype)
        self._upload_bonds(session, tables, bonds, self._own_edge, NEAR=NARROW.hex())

    def _masks(self) -> NDArray[np.uint64]:
        return self.blocks.mask

    def _write_history(self) -> None:
        self._own_edge[:] = self.blocks.edge[self.blocks.slots[:, BOUND]]
        self.write("memory", self.blocks.softened.astype(np.int32))
        self.write("worst", self.tracks.worst)
        self.write("own_edge", self._own_edge)

    def _pending_bonds(self) -> tuple[NDArray[Any], ...]:
        pending = self._pending_pulls()
        slot, lane = np.divmod(block_bonds.find_bonds(self.blocks, self._whole, pending.source, pending.target), LANES)
        return pending.source, slot, self.tracks.broken[slot, lane], pending.stretch

    def _enter_history(self, first: int, last: int) -> None:
        slots = slice(*self._starts[[first, last]])
        self.tracks.worst[slots] = self._read_groups("worst", first, last)
        self._own_edge[slots] = self._read_groups("own_edge", first, last)

    def _enter_breaks(self, breaks: NDArray[np.int64], stretch: NDArray[Any], last: int) -> None:
        place, slot, step = breaks.T
        lane = place % LANES
        self.tracks.broken[slot, lane] = step
        block_bonds.restore_bonds(
            self._law, self.blocks, self._whole, self.tracks.broken, self.tracks.worst, self._own_edge
        )
        limit = self.blocks.limit[self.blocks.slots[slot, LIMITS], lane]
        pending = (step == last) & (stretch < limit) & self._law.matches_work
        self._set_pending(slot[pending], lane[pending], stretch[pending])
