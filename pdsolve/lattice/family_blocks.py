"""Families of state-based laws in blocks of 64 nodes: the layout of `pdsolve.lattice.family_operator`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.lattice import block_bonds
from pdsolve.lattice.block_bonds import SAME_STIFFNESS, Distinct, Placed
from pdsolve.lattice.families import KIND, FamilySlots
from pdsolve.lattice.layout import LANES
from pdsolve.laws.bond_arrays import Tabled
from pdsolve.laws.law import Law
from pdsolve.numerics.memory import aligned


def placed(law: Law, bonds: Bonds) -> tuple[Placed, block_bonds.Tables] | None:
    """Positions of bonds in blocks; None for a law without tuples, or nodes on no lattice."""
    if law.lanes is None or not len(bonds.neighbour) or (bonds.xi.shape[1] == 3 and not law.lanes.in_space):
        return None
    tables, nodes = block_bonds.Tables(bonds.xi.shape[1]), len(bonds.start) - 1
    positions = block_bonds.place_bonds(bonds, 0, -(-nodes // LANES) * LANES, tables)
    return None if positions is None or block_bonds.are_sparse(positions, len(bonds.neighbour)) else (positions, tables)


class FamiliesInBlocks:
    """Bonds of listed nodes in blocks; a node's place is its row."""

    def __init__(
        self, where: Placed, tables: block_bonds.Tables, nodes: int, tabled: Tabled, kind: np.dtype[Any]
    ) -> None:
        """`where` bonds lie in slots, with the tables they refer to, and their numbers."""
        lane = where.lane.ravel()
        bond_lanes = np.flatnonzero(lane >= 0)
        self.lane_of = np.empty(len(bond_lanes), dtype=np.int64)  # (b,) of each bond
        self.lane_of[lane[bond_lanes]] = bond_lanes
        # Numbers common to all lanes of a slot, numbers (., c, 64) of other slots, and the index of each slot's
        columns = [column.astype(float) for column in tabled.columns]
        distinct_values = [Distinct(SAME_STIFFNESS) for _ in columns]
        for alike, column in zip(tabled.alike, columns, strict=True):
            distinct_values[alike].numbers(column)
        number = np.zeros(len(columns[0]), dtype=np.int64)
        for at, column in enumerate(columns):  # one number for all that a bond has
            distinct = distinct_values[tabled.alike[at]]
            value_numbers = distinct.numbers(column).astype(np.int64)
            columns[at] = distinct.values[value_numbers]
            number = np.unique(number * len(distinct.values) + value_numbers, return_inverse=True)[1].ravel()
        last = int(number.max(initial=-1))
        values = np.zeros((last + 2, len(columns)))  # the last of them for lanes without a bond
        for c, column in enumerate(columns):
            values[number, c] = column
        lane_numbers = np.where(where.lane >= 0, number[where.lane], last + 1)
        mixed = (lane_numbers != lane_numbers[:, :1]).any(axis=1)
        distinct_rows, which = np.unique(lane_numbers[mixed], axis=0, return_inverse=True)
        rows = values[distinct_rows].transpose(0, 2, 1).copy()
        self._intact_kinds = lane_numbers[:, 0].astype(np.int32)
        self._intact_kinds[mixed] = -1 - which.ravel()
        self.nodes, self.tiles, self.room = nodes, len(where.counts), LANES * len(where.counts)
        self.shared_rows = len(rows)  # of `rows`; those of slots with broken bonds follow
        self.bonds = FamilySlots(
            start=np.concatenate([[0], np.cumsum(where.counts)]),
            slots=np.column_stack([where.way, where.vector, self._intact_kinds]).astype(np.int32),
            ids=where.ids,
            vectors=aligned(block_bonds.reference_table(tables).astype(kind)),
            kinds=values.astype(kind),
            rows=aligned(rows.astype(kind), len(self._intact_kinds)),
        )

    def places(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The places (k,) of these nodes."""
        return rows

    def place(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Enter nodal values (n, w) at their places in `out` (w, m)."""
        if values.ctypes.data != out.ctypes.data:  # else they are a view of it
            out[:, : self.nodes] = values.T

    def collect(self, values: NDArray[Any]) -> NDArray[Any]:
        """A view (n, w) of nodes among the values of all places (w, m)."""
        return values[:, : self.nodes].T

    def add(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Add the values of nodes among those of all places (w, m) to `out` (n, w)."""
        out += self.collect(values)

    def remove(self, bonds: NDArray[np.int64]) -> None:
        """Remove these bonds (b,) of the list."""
        slot, lane = np.divmod(self.lane_of[bonds], LANES)
        kind, table = self.bonds.slots[:, KIND], self.bonds.rows
        for torn in np.unique(slot).tolist():
            row_number = self.shared_rows + torn
            if kind[torn] != -1 - row_number:
                old = kind[torn]
                table[row_number] = self.bonds.kinds[old][:, None] if old >= 0 else table[-1 - old]
                kind[torn] = -1 - row_number
        table[self.shared_rows + slot, :, lane] = 0

    def restore(self) -> None:
        """Enter all bonds again."""
        self.bonds.slots[:, KIND] = self._intact_kinds

    def bytes(self) -> int:
        """Memory of all arrays, bytes, without the rows that slots get as their bonds break."""
        arrays = *self.bonds, self.lane_of, self._intact_kinds
        return sum(array.nbytes for array in arrays) - self.bonds.rows[self.shared_rows :].nbytes
