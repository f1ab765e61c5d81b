"""The exchange of values with the owners of ghosts: nodes of other ranks that a rank's bonds reach."""

from __future__ import annotations

import time as clock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.lattice.layout import LANES
from pdsolve.numerics.team import NAP, SPIN, Team
from pdsolve.ranks.slabs import Slab

EXCHANGED = 7  # tag of messages
_Columns = tuple[int, NDArray[np.int64] | slice]  # of a rank


class GhostExchange:
    """The exchange of nodal values between this rank and its neighbours; rows are those of its window."""

    def __init__(self, team: Team, starts: NDArray[np.int64], slab: Slab, needed: NDArray[np.int64]) -> None:
        """`starts` (ranks + 1,) are the first rows of all ranks in the whole grid, `needed` (k,) sorted rows there.

        All ranks call this together.
        """
        self._comm, self.seconds = team.comm, 0.0  # s spent on exchanges
        offset = slab.begin
        self.own_block_range = ((slab.first - offset) // LANES, -(-(slab.last - offset) // LANES))  # of own nodes
        owner = np.searchsorted(starts, needed, side="right") - 1
        wanted = [needed[owner == rank] for rank in range(team.size)]
        requested_rows = team.comm.alltoall(wanted)
        self._requested = [rows - offset for rows in wanted], [rows - offset for rows in requested_rows]
        self._by_rows = self._by_places = self._columns(np.arange(slab.end - offset))

    def set_places(self, places: NDArray[np.int64]) -> None:
        """Say in which column each row of the window (n,) is in arrays by places."""
        self._by_places = self._columns(places)

    def _columns(self, places: NDArray[np.int64]) -> tuple[list[_Columns], list[_Columns]]:
        """Ranks that send and that receive anything, and the columns of each."""
        every = ([places[rows] for rows in row_lists] for row_lists in self._requested)
        incoming, outgoing = ([(r, _rows(at)) for r, at in enumerate(one) if len(at)] for one in every)
        return incoming, outgoing

    def receive_values(self, values: NDArray[Any], at_places: bool = False) -> None:
        """Set the ghosts' columns of `values` (w, m), which are by rows or by places, to those of their owners."""
        from mpi4py import MPI

        began = clock.perf_counter()
        comm, wide, (incoming, outgoing) = self._comm, len(values), self._by_places if at_places else self._by_rows
        room = [np.empty((wide, _length(rows)), values.dtype) for _, rows in incoming]
        waits = [comm.Irecv(into, rank, EXCHANGED) for into, (rank, _) in zip(room, incoming, strict=True)]
        sent = [np.ascontiguousarray(values[:, rows]) for _, rows in outgoing]
        waits += [comm.Isend(values, rank, EXCHANGED) for values, (rank, _) in zip(sent, outgoing, strict=True)]
        while not MPI.Request.Testall(waits):
            if clock.perf_counter() > began + SPIN:  # the processor is not taken from others for long
                clock.sleep(NAP)
        for into, (_, rows) in zip(room, incoming, strict=True):
            values[:, rows] = into
        self.seconds += clock.perf_counter() - began


def _rows(rows: NDArray[np.int64]) -> NDArray[np.int64] | slice:
    """Rows (k,) as a slice where they are consecutive."""
    return slice(int(rows[0]), int(rows[-1]) + 1) if (np.diff(rows) == 1).all() else rows


def _length(rows: NDArray[np.int64] | slice) -> int:
    return int(rows.stop - rows.start) if isinstance(rows, slice) else len(rows)
