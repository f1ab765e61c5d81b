"""The kernel in space as an operator: brittle bonds on a cubic lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.numerics.thread_team import share
from pdsolve.operators.protocol import Kept
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.space_lattice import layout
from pdsolve.operators.space_lattice.kernel import Breaks, Tiles, hold_tiles, place_rows, sum_tiles
from pdsolve.operators.space_lattice.sites import Sites
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROWS = 65536  # whose bonds are listed together
ROOM = 16  # tiles all of whose bonds may break before the kernel asks for more room


class SpaceLattice:
    """The bonds of n nodes on a cubic lattice under the brittle law; see `Operator`."""

    name = "blocks"
    unknowns: tuple[Unknown, ...] = (Unknown("u", 3, 2),)

    def __init__(
        self, tiles: Tiles, sites: Sites, stiffest: NDArray[np.float64], symmetric: bool, threads: int
    ) -> None:
        """`stiffest` (n,), N/m^4, bounds the stiffness of nodes."""
        self.tiles, self.symmetric = tiles, symmetric
        self._sites, self._stiffest, self._threads = sites, stiffest, threads
        self._u = aligned(np.zeros((3, tiles.cells.shape[1]), dtype=tiles.cells.dtype))
        self._broken = Broken(*(np.zeros(0, dtype=np.int64) for _ in Broken._fields))
        self._new: list[Broken] = []

    def place(self, state: State) -> State:
        """The state itself: its arrays are those of all nodes."""
        return state

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long."""
        self._place(state.value)
        tiles = self.tiles if step > 0 else self.tiles._replace(limit=np.inf)
        found: dict[int, NDArray[np.int64]] = {}
        room = ROOM * ROW * len(tiles.offsets)

        def work(first: int, last: int) -> None:
            breaks = Breaks(np.zeros(1, dtype=np.int64), np.empty((room, 2), dtype=np.int32))
            while first < last:
                begin, breaks.used[0] = first, 0
                first = sum_tiles(tiles, self._u, state.rate, dt, out, state.dissipated, breaks, first, last)
                if breaks.used[0]:
                    found[begin] = breaks.ends[: breaks.used[0]].astype(np.int64)

        share(work, len(tiles.kind), self._threads)
        for begin in sorted(found):
            source, target = found[begin].T
            self._new.append(Broken(np.full(len(source), step, dtype=np.int64), source, target))

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The energy densities (n,), J/m^3, that nodes hold, and that softening has spent so far."""
        self._place(state.value)
        held, spent = np.zeros((2, len(self._stiffest)))
        share(
            lambda first, last: hold_tiles(self.tiles, self._u, held, first, last), len(self.tiles.kind), self._threads
        )
        return held, spent

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """No fields: a pair law stores none beside the displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the stiffness that resists each node's motion, N/m^4; see `Operator`."""
        return self._stiffest

    def tangent(self, state: State) -> csr_array:
        """The tangent (n w, n w), N/m^4: minus the derivative of the force densities by the values."""
        from pdsolve.operators.tangent import of_springs  # SciPy takes as long to import as numba, and few runs ask

        source, target, slot = layout.intact(self._sites, self.tiles.bits, np.arange(len(self._stiffest)))
        xi, pull = layout.springs(self.tiles, self._sites, source, target, slot)
        return of_springs(source, target, xi, pull, state.value)

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of source and target of the intact bonds of the nodes `first` to `last` - 1, or of those at the
        `start`."""
        last = len(self._stiffest) if last is None else last
        bits = self._whole() if start else self.tiles.bits
        found = [
            layout.intact(self._sites, bits, np.arange(begin, min(begin + ROWS, last)))
            for begin in range(first, max(last, first + 1), ROWS)
        ]
        source, target, _ = (np.concatenate(column) for column in zip(*found, strict=True))
        return source, target

    def broken(self, after: int = 0) -> Broken:
        """The bonds broken after a step: step, source and target row of each."""
        if self._new:
            every = zip(self._broken, *self._new, strict=True)
            self._broken, self._new = Broken(*(np.concatenate(columns) for columns in every)), []
        if after == 0:
            return self._broken
        later = self._broken.step > after
        return Broken(*(column[later] for column in self._broken))

    def keep(self) -> Kept:
        """Nothing: brittle bonds remember only whether they have broken."""
        return {}

    def back(self, kept: Kept, broken: Broken) -> None:
        """Restore the broken bonds of a checkpoint."""
        bits = self._whole()
        layout.cleared(self._sites, broken.source, broken.target, bits)
        self.tiles.bits[:] = bits
        self._broken, self._new = Broken(*(column.astype(np.int64) for column in broken)), []

    def bytes(self) -> int:
        """The memory of all arrays, bytes."""
        arrays = (*self.tiles, self._sites.site, self._sites.ways, self._u, self._stiffest, *self.broken())
        return sum(getattr(array, "nbytes", 0) for array in arrays)

    def _whole(self) -> NDArray[np.uint16]:
        """The bits (t, k) at the start."""
        bits, (_, source, target) = self.tiles.bits.copy(), self.broken()
        tile, slot, bit = layout.placed(self._sites, source, target)
        np.bitwise_or.at(bits, (tile, slot), bit)
        return bits

    def _place(self, value: NDArray[Any]) -> None:
        nodes = len(self._stiffest)
        share(lambda first, last: place_rows(self._sites.site, value, self._u, first, last), nodes, self._threads)
