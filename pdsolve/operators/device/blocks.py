"""The bonds of lattices in blocks on a device: an operator whose history is there while steps are taken."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.block_slots import BOUND, PULL
from pdsolve.laws.calls import functions_of
from pdsolve.laws.law import Law
from pdsolve.operators.device.padded import Padded
from pdsolve.operators.device.runtime import Session
from pdsolve.operators.device.source import pair_functions, together
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.simd_lattice import layout
from pdsolve.operators.simd_lattice.kernel import LANES, LIMITS, Blocks
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.state import Broken

WORD = 32  # bits


class BlocksOnDevice(Padded, SimdLattice):
    """The bonds of n nodes in blocks whose steps a device takes; see `pdsolve.steppers.verlet_on_device`.

    The arrays of the processor's blocks hold the history of bonds as of the last `fetch`.
    """

    def __init__(
        self,
        law: Law,
        blocks: Blocks,
        bound: NDArray[np.float64],
        symmetric: bool,
        softens: bool,
        session: Session,
    ) -> None:
        """Arguments are those of `SimdLattice`. Raises ModelError if the device has too little memory."""
        super().__init__(law, blocks, bound, symmetric, softens)
        self.session, self.dimension, self.needs_upload = session, len(blocks.axes), True
        self.scheme = ("FUSED",)  # of steps, see verlet.cl
        self.together = together(session.about.kind, blocks.vectors.dtype)
        self.room = self.tracks.v.shape[1]
        self._remembers = bool(self.tracks.worst.size)
        words = -(-int(np.diff(blocks.start).max(initial=1)) // WORD)
        self._bits = np.zeros((words, self.room), dtype=np.uint32)
        lists = blocks.start, blocks.slots, blocks.start_of_rows, blocks.of_rows, blocks.ids
        arrays: list[NDArray[Any]] = [*lists, blocks.vectors, blocks.peak, blocks.limit]
        self._own_edge = np.zeros(self.tracks.broken.shape, dtype=blocks.vectors.dtype)
        arrays += [*self._shared(), self.tracks.broken, *[self.tracks.worst] * 2, self._own_edge, *[self._bits] * 2]
        session.room_for(*(array.nbytes for array in [*arrays, self.tracks.dissipated]), 4 * self.room)
        self._make()

    def _shared(self) -> list[NDArray[Any]]:
        """Stiffness and edge of bonds before any broke."""
        blocks = self.blocks
        return [table[: len(table) - len(blocks.mask)] for table in (blocks.stiffness, blocks.edge)]

    def _make(self) -> None:
        """Copy the tables to the device, and make room for what changes."""
        blocks, slots, upload = self.blocks, self.blocks.slots.copy(), self.session.put
        slots[:, PULL], slots[:, BOUND] = blocks.whole, slots[:, LIMITS]
        peak, most = blocks.peak, blocks.limit
        start, start_of_rows = (starts.astype(np.int32) for starts in (blocks.start, blocks.start_of_rows))
        lists = start, slots, start_of_rows, blocks.of_rows, blocks.ids
        first = *lists, blocks.vectors, *self._shared(), peak, most
        self._tables = [upload(table) for table in first]
        self._gone, self._soft = upload(self._bits), upload(self._bits)
        self._broken_in, self._torn = (
            upload(self.tracks.broken),
            upload(np.zeros(len(blocks.start) - 1, dtype=np.int32)),
        )
        self.dissipated = upload(self.tracks.dissipated)
        self._pull, self._worst = (upload(self.tracks.worst) for _ in range(2))
        self._edge, self._last_break = upload(self._own_edge), upload(np.full(self.room, -1, dtype=np.int32))

    @property
    def arguments(self) -> list[Any]:
        """The buffers of `FORCE_PARAMETERS`, in order."""
        history = self._gone, self._broken_in, self._torn, self.dissipated, self._soft
        return [*self._tables, *history, self._pull, self._edge, self._worst, self._last_break]

    def source(self) -> str:
        """What the bonds are in OpenCL C."""
        of = self._remembers, self._pair.elastic_in_compression, self._law.matches_work
        return pair_functions(functions_of(self._law), *of, "blocks.cl")

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        super().restore(checkpoint, broken)
        self.needs_upload = True

    def hand_over(self) -> None:
        """Give the history of bonds to the device, if it is another than the device's."""
        if not self.needs_upload:
            return
        write, worst = self.session.write, self.tracks.worst
        write(self._gone, self._bits_of(self.tracks.broken != 0))
        write(self._broken_in, self.tracks.broken)
        write(self._torn, np.zeros(len(self.blocks.start) - 1, dtype=np.int32))
        rows = self.blocks.slots
        if self._remembers:
            write(self._soft, self._bits_of(worst > 0))
            write(self._worst, worst)
            self._own_edge[:] = self.blocks.edge[rows[:, BOUND]]
            write(self._pull, self.blocks.stiffness[rows[:, PULL]])
        pending, last_break = self._pending_pulls(), np.full(self.room, -1, dtype=np.int32)
        slot, lane = np.divmod(layout.find(self.blocks, self._whole, pending.source, pending.target), LANES)
        self._own_edge[slot, lane], last_break[pending.source] = pending.stretch, self.tracks.broken[slot, lane]
        write(self._edge, self._own_edge)
        write(self._last_break, last_break)
        self.needs_upload = False

    def fetch(self, step: int) -> None:
        """Bring the history of bonds up to the device's, where bonds have broken or softened."""
        torn = np.zeros(len(self.blocks.start) - 1, dtype=np.int32)
        self.session.read(self._torn, torn)
        if not torn.any():
            return
        changes = np.flatnonzero(np.diff(np.concatenate([[0], torn, [0]])))
        for first, last in changes.reshape(-1, 2):  # blocks side by side are copied together
            of = slice(*self.blocks.start[[first, last]])
            self._read(self._broken_in, self.tracks.broken, of)
            self._read(self._edge, self._own_edge, of)
            if self._remembers:
                self._read(self._worst, self.tracks.worst, of)
        edge = self._own_edge if self._remembers else self.tracks.worst
        layout.revive(self._law, self.blocks, self._whole, self.tracks.broken, self.tracks.worst, edge)
        self.session.write(self._torn, np.zeros_like(torn))
        if not self._law.matches_work:
            return
        last = self.broken(step - 1)
        slot, lane = np.divmod(layout.find(self.blocks, self._whole, last.source, last.target), LANES)
        stretch, limit = self._own_edge[slot, lane], self.blocks.limit[self.blocks.slots[slot, LIMITS], lane]
        self._set_pending(slot[stretch < limit], lane[stretch < limit], stretch[stretch < limit])

    def _read(self, buffer: Any, values: NDArray[Any], of: slice) -> None:
        """Read some slots (., 64) of the device's into those of the host."""
        fresh = np.empty_like(values[of])
        self.session.read(buffer, fresh, int(of.start) * LANES * values.itemsize)
        values[of] = fresh

    def _bits_of(self, which: NDArray[np.bool_]) -> NDArray[np.uint32]:
        """Bits (w, m) of nodes, of bonds (slots, 64)."""
        bits, start = np.zeros_like(self._bits), self.blocks.start
        for k in range(int(np.diff(start).max(initial=0))):
            block = np.flatnonzero(np.diff(start) > k)
            lanes = bits[k // WORD].reshape(-1, LANES)
            lanes[block] |= which[start[block] + k].astype(np.uint32) << np.uint32(k % WORD)
        return bits
