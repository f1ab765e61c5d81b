"""State-based laws on lattices, fast: passes over families in blocks; everything rarely needed is done by the list."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_arrays import Now, Tabled
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.numerics.thread_team import share
from pdsolve.operators import bond_list_loops as loops
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.simd_lattice import layout
from pdsolve.operators.simd_lattice.kernel import LANES
from pdsolve.operators.simd_lattice.layout import SAME_STIFFNESS, Distinct, Placed, aligned
from pdsolve.operators.simd_lattice.passes import KIND, Slots, exchange_blocks, first_pass_blocks, watch_blocks
from pdsolve.state import Broken, State


def placed(law: Law, bonds: Bonds) -> tuple[Placed, layout.Tables] | None:
    """Positions of bonds in blocks; None for a law without tuples, or nodes on no lattice."""
    if law.lanes is None or not len(bonds.neighbour) or (bonds.xi.shape[1] == 3 and not law.lanes.in_space):
        return None
    tables, nodes = layout.Tables(bonds.xi.shape[1]), len(bonds.start) - 1
    positions = layout.place(bonds, 0, -(-nodes // LANES) * LANES, tables)
    return None if positions is None or layout.sparse(positions, len(bonds.neighbour)) else (positions, tables)


class Families(BondList):
    """The bonds of n nodes on lattices under a law whose passes are tuples; see `Operator`."""

    name = "blocks"

    def __init__(
        self,
        law: Law,
        model: Model,
        exact: Bonds,
        symmetric: bool,
        precision: str,
        threads: int,
        where: Placed,
        tables: layout.Tables,
    ) -> None:
        """Arguments are those of `BondList`, and `where` bonds lie in slots, with the tables they refer to."""
        self._ready = False
        super().__init__(law, model, exact, symmetric, precision, threads)
        kind = np.dtype(precision).type
        count = len(where.counts)
        room = LANES * count
        assert law.lanes is not None
        assert law.width is not None
        self._lanes = law.lanes
        self._tabled = law.lanes.tabled(self.columns, self._bonds)
        self._lane_of = np.empty(len(exact.neighbour), dtype=np.int64)
        bond_lanes = np.flatnonzero(where.lane.ravel() >= 0)
        self._lane_of[where.lane.ravel()[bond_lanes]] = bond_lanes
        kinds, rows, of_slot = _shared(where.lane, self._tabled)
        self._whole, self._used = of_slot, len(rows)
        self.slots = Slots(
            start=np.concatenate([[0], np.cumsum(where.counts)]),
            slots=np.column_stack([where.way, where.vector, of_slot]).astype(np.int32),
            ids=where.ids,
            vectors=aligned(layout.reference_table(tables).astype(kind)),
            kinds=kinds.astype(kind),
            rows=aligned(rows.astype(kind), len(of_slot)),
        )
        d = exact.xi.shape[1]
        self._u, self._v, self._a = aligned(np.zeros((3 * d, room), dtype=kind)).reshape(3, d, room)
        self._dissipated, self._work = np.zeros((2, self._nodes))
        wide = law.width(self.columns, d)
        self._m, self._f = aligned(np.zeros((wide, room), dtype=kind)), aligned(np.zeros((d, room), dtype=kind))
        constants = law.lanes.standing(self.columns, self._every)
        idle = np.repeat(constants[:, :1], room - self._nodes, axis=1)  # as good as any, and no 0 over 0
        self._own = aligned(np.hstack([constants, idle]).astype(kind))
        self._likes = (0,) * len(self._tabled.columns), (0,) * self._tabled.nodal_count, (0,) * len(constants), (0,) * d
        self._by_lanes = law.lanes.by_lanes(self.columns)
        self._ready = True

    def to_own_layout(self, state: State) -> State:
        """The state in this operator's own array layout."""
        u, v, a = (array[:, : self._nodes].T for array in (self._u, self._v, self._a))
        local_state = State(u, v, a, self._dissipated, self._work, state.damped)
        for values, local_values in zip(state, local_state, strict=True):
            if values.ctypes.data != local_values.ctypes.data:
                local_values[:] = values
        return local_state

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        self.slots.slots[:, KIND] = self._whole
        super().restore(checkpoint, broken)

    def bytes(self) -> int:
        """Memory of all arrays, bytes, without the rows that slots get as their bonds break."""
        arrays = *self.slots, self._u, self._v, self._a, self._m, self._f, self._own, self._lane_of, self._whole
        later = self.slots.rows[self._used :].nbytes
        return super().bytes() + sum(array.nbytes for array in arrays) - later

    def _between(self, now: Now) -> NDArray[Any]:
        if not self._takes(now):
            return super()._between(now)
        u = self._displacements(now)
        self._share_blocks(first_pass_blocks, u, self._own, self._m, self._likes, self._by_lanes)
        between = self._m[:, : self._nodes].T
        if not self._by_lanes:
            self._share(loops.finish_pass_rows, between)
        return between

    def _accumulate_bond_forces(self, now: Now, between: NDArray[Any], out: NDArray[Any]) -> None:
        if not self._takes(now):
            return super()._accumulate_bond_forces(now, between, out)
        self._share_blocks(exchange_blocks, self._displacements(now), self._m, self._f, self._likes)
        out += self._f[:, : self._nodes].T
        return None

    def _near(self, now: Now, between: NDArray[Any]) -> NDArray[np.bool_]:
        if not self._tabled.watched:
            return super()._near(now, between)
        near = np.zeros(self._m.shape[1], dtype=np.bool_)
        self._share_blocks(watch_blocks, self._displacements(now), self._m, near, self._likes)
        return near[: self._nodes]

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        super()._lose(bonds, rows)
        slot, lane = np.divmod(self._lane_of[bonds], LANES)
        kind, table = self.slots.slots[:, KIND], self.slots.rows
        for torn in np.unique(slot).tolist():
            row_number = self._used + torn
            if kind[torn] != -1 - row_number:
                old = kind[torn]
                table[row_number] = self.slots.kinds[old][:, None] if old >= 0 else table[-1 - old]
                kind[torn] = -1 - row_number
        table[self._used + slot, :, lane] = 0
        self._own[:, rows] = self._lanes.standing(self.columns, rows)

    def _takes(self, now: Now) -> bool:
        """Whether a state can be summed in blocks."""
        return self._ready and now.value.dtype == self._u.dtype

    def _displacements(self, now: Now) -> NDArray[np.floating]:
        """Displacements (d, m) of a state, also of one in another layout."""
        if now.value.ctypes.data == self._u.ctypes.data:
            return self._u
        u = np.zeros_like(self._u)
        u[:, : self._nodes] = now.value.T
        return u

    def _share_blocks(self, loop: Callable[..., None], *arrays: Any) -> None:
        count = len(self.slots.start) - 1
        share(lambda first, last: loop(self.slots, self.columns, *arrays, first, last), count, self._threads)


def _shared(
    lane: NDArray[np.int32], tabled: Tabled
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]:
    """Numbers (., c) common to all lanes of a slot, numbers (., c, 64) of other slots, and the index of each slot's.

    Slots are (s, 64), as in `Slots`.
    """
    columns = [column.astype(float) for column in tabled.columns]
    kinds = [Distinct(SAME_STIFFNESS) for _ in columns]
    for kind, column in zip(tabled.alike, columns, strict=True):
        kinds[kind].numbers(column)
    number = np.zeros(len(columns[0]), dtype=np.int64)
    for at, column in enumerate(columns):  # one number for all that a bond has
        distinct = kinds[tabled.alike[at]]
        value_numbers = distinct.numbers(column).astype(np.int64)
        columns[at] = distinct.values[value_numbers]
        number = np.unique(number * len(distinct.values) + value_numbers, return_inverse=True)[1].ravel()
    last = int(number.max(initial=-1))
    values = np.zeros((last + 2, len(columns)))  # the last of them for lanes without a bond
    for c, column in enumerate(columns):
        values[number, c] = column
    lane_numbers = np.where(lane >= 0, number[lane], last + 1)
    mixed = (lane_numbers != lane_numbers[:, :1]).any(axis=1)
    distinct_rows, which = np.unique(lane_numbers[mixed], axis=0, return_inverse=True)
    of_slot = lane_numbers[:, 0].astype(np.int32)
    of_slot[mixed] = -1 - which.ravel()
    return values, values[distinct_rows].transpose(0, 2, 1).copy(), of_slot
