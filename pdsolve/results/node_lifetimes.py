"""Lifetimes of nodes: every node that ever lived is a row with a birth and perhaps a death."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdsolve.results.schema import Breaks, Nodes

NEVER = np.iinfo(np.int64).max


class _Sorted(NamedTuple):
    """The r rows sorted by id, then by birth."""

    row: NDArray[np.int64]  # (r,)
    birth: NDArray[np.int64]  # (r,)
    ids: NDArray[np.int64]  # (k,) all there are, rising
    first: NDArray[np.int64]  # (k,) where those of each id begin


class Lives:
    """All r nodes that ever lived, in the order of birth."""

    def __init__(self, nodes: Nodes, birth: NDArray[np.int64], death: NDArray[np.int64]) -> None:
        """`birth` (r,) is the first step of a node, `death` (r,) the first step without it, NEVER if it lives."""
        self.nodes, self.birth, self.death = nodes, birth, death

    def rows(self, step: int) -> NDArray[np.int64]:
        """Rows (n,) of the nodes that live at a step."""
        return np.flatnonzero((self.birth <= step) & (step < self.death))

    def at(self, ids: NDArray[np.int64], step: ArrayLike) -> NDArray[np.int64]:
        """Rows (k,) of the nodes with these ids (k,) at a step, or at steps (k,); -1 if none had the id then."""
        table, steps = self._sorted, np.broadcast_to(step, np.shape(ids))
        if not len(table.ids) or not len(ids):
            return np.full(len(ids), -1)
        number = np.searchsorted(table.ids, ids).clip(max=len(table.ids) - 1)
        turn = int(max(self.birth.max(), steps.max())) + 1  # more than any step
        numbers = np.repeat(np.arange(len(table.ids)), np.diff(np.append(table.first, len(table.row))))
        at = np.searchsorted(numbers * turn + table.birth, number * turn + steps, side="right") - 1
        row = table.row[at]
        alive = (self.nodes.ids[row] == ids) & (self.birth[row] <= steps) & (steps < self.death[row])
        return np.where(alive, row, -1)

    def now(self, step: int) -> NDArray[np.int64]:
        """For each row (r,), the index in `rows(step)` of the node with its id at that step; -1 without one."""
        rows = self.rows(step)
        place = np.full(len(self.birth), -1)
        place[rows] = np.arange(len(rows))
        same = self.at(self.nodes.ids, step)
        return np.where(same < 0, -1, place[same])

    def broke(self, breaks: Breaks, rows: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether the bonds (k,) from nodes `rows` (k,) to nodes `ids` (k,) broke during their lives."""
        number = np.unique(np.concatenate([ids, breaks.neighbour]), return_inverse=True)[1]
        node_rows = np.concatenate([rows, self.at(breaks.node, breaks.step)])
        bonds = node_rows * (number.max(initial=0) + 1) + number
        return np.isin(bonds[: len(ids)], bonds[len(ids) :])

    @cached_property
    def _sorted(self) -> _Sorted:
        row = np.lexsort((self.birth, self.nodes.ids))
        ids, first = np.unique(self.nodes.ids[row], return_index=True)
        return _Sorted(row, self.birth[row], ids, first)
