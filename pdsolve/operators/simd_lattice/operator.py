"""The fast kernel as an operator: pair laws on lattices, with its own bond numbers and arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry
from pdsolve.lattice.blocks import BOUND, LIMITS, PENDING, PENDING_SHORT, Blocks, Tracks, energy_densities
from pdsolve.lattice.layout import LANES
from pdsolve.lattice.sums import sum_blocks
from pdsolve.laws.calls import bind
from pdsolve.laws.law import Law
from pdsolve.numerics.thread_team import side_by_side
from pdsolve.operators.pending_pulls import PendingPulls, last_breaks, pending_to_arrays, read_pending_pulls
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.simd_lattice import layout
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class SimdLattice:
    """The bonds of n nodes on lattices under a pair law; see `Operator`."""

    name = "blocks"

    def __init__(self, law: Law, blocks: Blocks, bound: NDArray[np.float64], symmetric: bool, softens: bool) -> None:
        """`bound` (n,), N/m^4, of the stiffness of nodes; `softens`: whether any bond has its peak below its limit."""
        bind(law)
        assert law.pair is not None
        self._law, self._pair = law, law.pair
        remembers = law.pair.softening is not None and (softens or law.pair.is_curved)
        d = len(blocks.axes)
        self.unknowns: tuple[Unknown, ...] = (Unknown("u", d, 2),)
        self.blocks, self.symmetric = blocks, symmetric
        self._stiffness_bound, self._whole = bound, blocks.mask.copy()
        none = np.zeros(0, dtype=np.int64)
        self._looked_at, self._broken = self._whole, Broken(none, none, none)  # what is known to be broken
        room, lanes = LANES * (len(blocks.start) - 1), (len(blocks.mask), LANES)
        kind = blocks.scratch.dtype
        self.tracks = Tracks(
            u=aligned(np.zeros((3, d, room), dtype=kind)),
            v=aligned(np.zeros((d, room), dtype=kind)),
            a=aligned(np.zeros((d, room), dtype=kind)),
            dissipated=aligned(np.zeros(room)),
            work=aligned(np.zeros(room)),
            broken=np.zeros(lanes, dtype=np.int32),
            worst=np.zeros(lanes if remembers else (0, LANES), dtype=kind),
        )

    def to_own_layout(self, state: State) -> State:
        """The state in this operator's own array layout."""
        nodes, tracks = len(self._stiffness_bound), self.tracks
        u, v, a = (array[:, :nodes].T for array in (tracks.u[0], tracks.v, tracks.a))
        local_state = State(u, v, a, tracks.dissipated[:nodes], tracks.work[:nodes], state.damped)
        for values, local_values in zip(state, local_state, strict=True):
            if values.ctypes.data != local_values.ctypes.data:
                local_values[:] = values
        return local_state

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
        """Let bonds stretch from what they are long at these strains (n,) of free nodes; of straight lines."""
        shrink = aligned(np.zeros_like(self.tracks.v[0])) if self.tracks.shrink is None else self.tracks.shrink
        shrink[: len(strain)] = -strain / 2
        self.tracks = self.tracks._replace(shrink=shrink)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        self.to_own_layout(state)
        strain_energy, spent = np.zeros_like(self.tracks.work), np.zeros_like(self.tracks.work)
        energy_densities(self.blocks, self.tracks.worst, self.tracks.u[0], self.tracks.shrink, strain_energy, spent)
        return strain_energy[: len(self._stiffness_bound)], spent[: len(self._stiffness_bound)]

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: a pair law stores no fields besides displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4; see `Operator`."""
        return self._stiffness_bound

    def tangent(self, state: State) -> csr_array:
        """The tangent (n w, n w), N/m^4: minus the derivative of the force densities by the values."""
        from pdsolve.operators.tangent import of_springs  # SciPy takes as long to import as numba, and few runs ask

        numbers = layout.there(self.blocks.mask)
        if self._pair.is_curved:
            return self._curved_tangent(numbers, state)
        (source, target), (xi, pull) = layout.ends(self.blocks, numbers), layout.springs(self.blocks, numbers)
        if self._pair.elastic_in_compression:
            eta = state.value[target].astype(np.float64) - state.value[source]
            shorter = ((2 * xi + eta) * eta).sum(axis=1) < 0
            pull = np.where(shorter, layout.springs(self.blocks, numbers, initial=True)[1], pull)
        return of_springs(source, target, xi, pull, state.value)

    def _curved_tangent(self, numbers: NDArray[np.int64], state: State) -> csr_array:
        """The tangent of intact bonds (k,) whose law is not linear, bond by bond."""
        from pdsolve.operators.tangent import of_curves

        (source, target), (xi, stiffness) = layout.ends(self.blocks, numbers), layout.springs(self.blocks, numbers)
        slot, lane = np.divmod(numbers, LANES)
        row = self.blocks.slots[slot, LIMITS]
        peak, limit = (table[row, lane].astype(np.float64) for table in (self.blocks.peak, self.blocks.limit))
        worst = self.tracks.worst.ravel()[numbers].astype(np.float64) if self.tracks.worst.size else np.zeros(len(slot))
        return of_curves(self._law, source, target, xi, (stiffness, peak, limit, worst), state.value)

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first` to `last` - 1, or of those at the
        `start`."""
        last = len(self._stiffness_bound) if last is None else last
        slots = self.blocks.start[[first // LANES, -(-last // LANES)]]
        mask = self._whole if start else self.blocks.mask
        source, target = layout.ends(self.blocks, layout.there(mask[slots[0] : slots[1]], int(slots[0])))
        in_range = np.flatnonzero((source >= first) & (source < last))
        in_range = in_range[np.lexsort((target[in_range], source[in_range]))]
        return source[in_range], target[in_range]

    def broken(self, after: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        new = layout.there(self._looked_at & ~self.blocks.mask)
        if len(new):
            new_columns = self.tracks.broken.ravel()[new].astype(np.int64), *layout.ends(self.blocks, new)
            self._broken = Broken(*(np.concatenate(columns) for columns in zip(self._broken, new_columns, strict=True)))
            self._looked_at = self.blocks.mask.copy()
        if after == 0:
            return self._broken
        later = self._broken.step > after
        return Broken(*(column[later] for column in self._broken))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes."""
        worst, rows = self.tracks.worst.ravel(), self.blocks.slots[:, BOUND]
        softened = np.flatnonzero(worst)
        slot, lane = np.divmod(softened, LANES)
        source, target = layout.ends(self.blocks, softened)
        edge = self.blocks.edge[rows[slot], lane]
        edge[edge <= PENDING_SHORT] = np.inf
        arrays = {"worst": worst[softened], "worst_edge": edge, "worst_source": source, "worst_target": target}
        return arrays | pending_to_arrays(self._pending_pulls())

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        steps, worst, edge = self.tracks.broken.ravel(), self.tracks.worst.ravel(), np.zeros_like(self.tracks.worst)
        torn = layout.find(self.blocks, self._whole, broken.source, broken.target)
        nodes, rows = len(self._stiffness_bound) - 1, (None,) if self.tracks.worst.size else (0,)
        values = entry(checkpoint, "worst", rows, self.tracks.worst.dtype)
        edges = entry(checkpoint, "worst_edge", values.shape, self.blocks.edge.dtype, high=np.inf)
        ends = (entry(checkpoint, f"worst_{end}", values.shape, np.int64, 0, nodes) for end in ("source", "target"))
        softened, pending = (
            layout.find(self.blocks, self._whole, *ends),
            read_pending_pulls(checkpoint, nodes + 1, self.blocks.near.dtype),
        )
        steps[:] = worst[:] = 0
        steps[torn] = broken.step
        worst[softened], edge.ravel()[softened] = values, edges
        self._looked_at, self._broken = self._whole, Broken(*(column[:0] for column in self._broken))
        layout.revive(self._law, self.blocks, self._whole, self.tracks.broken, self.tracks.worst, edge)
        self._set_pending(
            *np.divmod(layout.find(self.blocks, self._whole, pending.source, pending.target), LANES), pending.stretch
        )

    def _pending_pulls(self) -> PendingPulls:
        """Bonds that broke in the last step and pull once more."""
        last, (near, edge) = last_breaks(self.broken()), (self.blocks.near, self.blocks.edge)
        slot, lane = np.divmod(layout.find(self.blocks, self._whole, last.source, last.target), LANES)
        row = self.blocks.slots[slot, BOUND]
        is_pending, stretch = (
            edge[row, lane] <= PENDING_SHORT,
            np.where(edge[row, lane] == PENDING, -1, 1) * near[row, lane],
        )
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
