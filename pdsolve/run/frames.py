"""Frames of all ranks: each records its nodes and sends them in pieces, which rank 0 receives while it writes them.

Messages of one rank arrive in the order in which they are sent, and rank 0 writes column by column, so that nothing
says which piece a message is. In one process nothing is sent, and the writer gets the arrays themselves.
"""

from __future__ import annotations

import time as clock
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh import VERSION
from pdmesh.background_thread import BackgroundThread
from pdsolve.numerics.team import NAP, Team
from pdsolve.results import Breaks, Families, FrameRecord, Nodes, ResultsError, Writer
from pdsolve.results.checksums import crc_joined
from pdsolve.results.recovery import INDEX_OF
from pdsolve.results.schema import Births, Column
from pdsolve.run.measures import compute_output_fields
from pdsolve.run.subdomain import HELD, Columns, Subdomain, checkpoint_node_ids_and_broken_bonds, make_own_checkpoint
from pdsolve.run.system import System

WRITTEN = 9  # tag of messages: that a frame is in the files of all ranks
NOTHING = Breaks(*np.zeros((3, 0), dtype=np.int64))


class RankDatabase:
    """Writes what goes by own nodes; rank 0 is told of each frame that is written, or why it could not be.

    A checkpoint stays until the one after the next is there, as the index may still have to learn of that.
    """

    def __init__(self, team: Team, make_writer: Callable[[], Writer], first_row: int) -> None:
        """`make_writer` begins the database, on a thread of its own; `first_row` is the first own row."""
        self._team, self._make, self._first = team, make_writer, first_row
        self._thread = BackgroundThread("results")
        self._writer: Writer | None = None
        self._kept = 0  # step of the last checkpoint

    def write_frame(
        self, step: int, time: float, fields: Mapping[str, NDArray[Any]] | None, checkpoint: Mapping[str, NDArray[Any]]
    ) -> None:
        """Write a frame when the last one is written. Raises WriteError if that failed."""
        self._thread.wait()
        step_arrays = {f"{name}@{step}": values for name, values in checkpoint.items()} or None
        frame = FrameRecord(step, time, fields, NOTHING, (), (), step_arrays, first=self._first, keeps=self._kept)
        self._kept = step if step_arrays else self._kept
        self._thread.begin(partial(self._write_frame_and_notify_rank_0, frame))

    def close(self) -> None:
        """Close the database after everything is written. Raises WriteError."""
        self._thread.wait()
        self._thread.end()
        if self._writer is not None:
            self._writer.close("finished")

    def _write_frame_and_notify_rank_0(self, frame: FrameRecord) -> None:
        error: ResultsError | None = None
        try:
            if self._writer is None:
                self._writer = self._make()
            self._writer.write(frame)
        except ResultsError as found:
            error = found
            raise
        finally:
            self._team.comm.send(error, 0, WRITTEN)


def wait_until_all_ranks_wrote_frame(team: Team) -> None:
    """Wait until all ranks have written a frame. Raises WriteError if one could not."""
    errors = [team.received(rank, WRITTEN) for rank in range(team.size)]
    for error in errors:
        if error is not None:
            raise error


FRAME = 8  # tag of messages
PIECE = 1 << 20  # bytes of a message


class FrameRequest(NamedTuple):
    """What is asked of all ranks for a frame."""

    step: int
    after_step: int  # breaks since then
    field_names: Sequence[str] | None  # None: no fields
    with_checkpoint: bool


class ArrayDescription(NamedTuple):
    """What a rank says of an array before it sends it."""

    dtype_name: str
    value_count: int
    crc: int


class RankFrame(NamedTuple):
    """What a rank says of the frame that it sends: the arrays of each column by name."""

    fields: dict[str, list[ArrayDescription]]
    checkpoint: dict[str, list[ArrayDescription]]
    new_breaks: NDArray[np.int64]  # (5, k) step, rows of both nodes among all, and their ids


class GatheredFrame(NamedTuple):
    """What all ranks have for a frame."""

    fields: Mapping[str, NDArray[Any] | Column]
    checkpoint: Mapping[str, NDArray[Any] | Column]
    breaks: Breaks


class PendingMessages(NamedTuple):
    """Messages on their way, and what they hold."""

    mpi_requests: list[Any]
    sent_arrays: list[NDArray[Any]]


def gather_frame(team: Team, request: FrameRequest) -> GatheredFrame:
    """A frame of all ranks, some of whose columns arrive as they are written."""
    frames: list[RankFrame] = team.everywhere(send_frame_to_rank_0, request)
    new = np.concatenate([frame.new_breaks for frame in frames], axis=1)
    breaks = Breaks(*new[[0, 3, 4]][:, np.lexsort((new[2], new[1], new[0]))])
    local_arrays = iter(team.subdomain.sending.sent_arrays)
    if team.subdomain.part is None:
        arrays, of_checkpoint = ({name: next(local_arrays) for name in names} for names in frames[0][:2])
        return GatheredFrame(arrays, of_checkpoint, breaks)
    fields = _receive_columns(team, local_arrays, [frame.fields for frame in frames])
    return GatheredFrame(fields, _receive_columns(team, local_arrays, [frame.checkpoint for frame in frames]), breaks)


def send_frame_to_rank_0(team: Team, request: FrameRequest) -> RankFrame:
    """Send the fields and the checkpoint of own nodes to rank 0, and say what breaks there are.

    Where this rank has a file of its own, that is where both go, but for what is of held components.
    """
    subdomain: Subdomain = team.subdomain
    subdomain.synchronize()
    system, own, known = subdomain.system, subdomain.own, subdomain.known_energies_and_breaks(request.step)
    fields: dict[str, Columns] = {}
    if request.field_names is not None:
        values_by_name = compute_output_fields(system, subdomain.state, request.field_names, known)
        fields = {name: [values[own].astype("<f4")] for name, values in values_by_name.items()}
    subdomain.drop_state()
    checkpoint: dict[str, Columns] = {}
    if request.with_checkpoint:
        checkpoint = make_own_checkpoint(subdomain)
        if system.regridder.nodes_may_change:
            of_nodes = checkpoint_node_ids_and_broken_bonds(system)
            checkpoint |= {name: [values] for name, values in of_nodes.items()}
    if subdomain.file is not None:
        mine = {name: pieces[0] for name, pieces in checkpoint.items() if name != HELD}
        local_fields = None if request.field_names is None else {name: values for name, (values,) in fields.items()}
        subdomain.file.write_frame(request.step, request.step * system.time_step, local_fields, mine)
        fields = {name: [] for name in fields}
        checkpoint = {HELD: checkpoint[HELD]} if checkpoint else {}
    _send_arrays_to_rank_0(team, [piece for pieces in (*fields.values(), *checkpoint.values()) for piece in pieces])
    new = known.broken_bonds.after(request.after_step) if known is not None else subdomain.broken(request.after_step)
    ids, begin = system.model.grid.ids, subdomain.begin
    breaks = np.array([new.step, new.source + begin, new.target + begin, ids[new.source], ids[new.target]])
    return RankFrame(_describe(team, fields), _describe(team, checkpoint), breaks)


def _describe(team: Team, columns: Mapping[str, Columns]) -> dict[str, list[ArrayDescription]]:
    """What is said of columns that are sent; nothing but their names where none is."""
    if team.subdomain.part is None:
        return {name: [] for name in columns}
    return {name: [_describe_array(piece) for piece in pieces] for name, pieces in columns.items()}


def _describe_array(array: NDArray[Any]) -> ArrayDescription:
    return ArrayDescription(array.dtype.str, array.size, zlib.crc32(np.ascontiguousarray(array).data))


def _send_arrays_to_rank_0(team: Team, columns: Columns) -> None:
    """Send columns to rank 0, when those before have arrived; rank 0 keeps its own."""
    subdomain: Subdomain = team.subdomain
    if team.rank == 0:
        subdomain.sending = PendingMessages([], columns)
        return
    from mpi4py import MPI

    if subdomain.sending is not None:
        MPI.Request.Waitall(subdomain.sending.mpi_requests)
    flat = [np.ascontiguousarray(values).reshape(-1).view(np.uint8) for values in columns]
    requests = [
        team.comm.Isend(array[at : at + PIECE], 0, FRAME) for array in flat for at in range(0, len(array), PIECE)
    ]
    subdomain.sending = PendingMessages(requests, flat)


def _receive_columns(
    team: Team, local_arrays: Iterator[NDArray[Any]], descriptions: Sequence[Mapping[str, list[ArrayDescription]]]
) -> dict[str, Column]:
    """The columns that all ranks send, of which each says this; `local_arrays` are those of this rank."""
    columns = {}
    for name in descriptions[0]:
        runs = range(len(descriptions[0][name]))
        order = [(rank, *description[name][run]) for run in runs for rank, description in enumerate(descriptions)]
        kind = np.dtype(order[0][1] if order else "<f8")
        crc = 0
        for _, _, length, after in order:
            crc = crc_joined(crc, after, length * kind.itemsize)
        columns[name] = Column(
            kind,
            sum(length for *_, length, _ in order),
            crc,
            _iterate_column_chunks_of_ranks(team, local_arrays, order, kind),
        )
    return columns


def _iterate_column_chunks_of_ranks(
    team: Team,
    local_arrays: Iterator[NDArray[Any]],
    array_descriptions: list[tuple[int, str, int, int]],
    dtype: np.dtype[Any],
) -> Iterator[NDArray[Any]]:
    """The values of a column as they arrive."""
    for rank, _, length, _ in array_descriptions:
        if rank == 0:
            yield next(local_arrays).reshape(-1)
            continue
        bytes_left = length * dtype.itemsize
        while bytes_left:
            into = np.empty(min(bytes_left, PIECE), dtype=np.uint8)
            request = team.comm.Irecv(into, rank, FRAME)
            while not request.Test():
                clock.sleep(NAP)
            bytes_left -= len(into)
            yield into.view(dtype)


def nodes_for_results(system: System, rows: slice | NDArray[np.int64]) -> Nodes:
    """The nodes of some rows in the format of results."""
    grid, family = system.model.grid, system.family_sizes[rows]
    cut = family - system.initial_bond_counts[rows]
    return Nodes(grid.ids[rows], grid.position[rows], grid.delta[rows], system.area[rows], family, cut)


def local_nodes_and_families(team: Team, first_row: int, end_row: int) -> tuple[Nodes, Families]:
    """Own nodes among the rows `first_row` to `end_row` - 1 of all at the start, and their families by rows of all."""
    subdomain: Subdomain = team.subdomain
    system, own, begin = subdomain.initial_system or subdomain.system, subdomain.own, subdomain.begin
    first = min(max(first_row - begin, own.start), own.stop)
    end = min(max(end_row - begin, first), own.stop)
    if subdomain.part is None:
        first, end = first_row, end_row
    counts, target = system.initial_bond_counts[first:end], np.zeros(0, dtype=np.int64)
    if system.transport is not None:  # whose links do not break: nobody asks for them
        counts = np.zeros_like(counts)
    elif first < end:
        target = system.operator.bonds(first, end, at_start=True)[1] + begin
    families = Families(np.concatenate([[0], np.cumsum(counts)]), target)
    return nodes_for_results(system, slice(first, end)), families


def gather_nodes_and_families(team: Team, first_row: int, end_row: int) -> tuple[Nodes, Families]:
    """The nodes of these rows at the start and their families, from all ranks."""
    node_parts, family_parts = zip(*team.everywhere(local_nodes_and_families, first_row, end_row), strict=True)
    counts = np.concatenate([np.diff(families.start) for families in family_parts])
    target = np.concatenate([families.neighbour for families in family_parts])
    nodes = Nodes(*(np.concatenate(column) for column in zip(*node_parts, strict=True)))
    return nodes, Families(np.concatenate([[0], np.cumsum(counts)]), target)


def open_rank_database(team: Team, path: str) -> None:
    """Give this rank a file of its own, for what is written from now on."""
    subdomain: Subdomain = team.subdomain
    own, first, system = subdomain.own, subdomain.begin + subdomain.own.start, subdomain.system
    grid = system.model.grid

    def read_nodes(first_row: int, end_row: int) -> Nodes:
        return local_nodes_and_families(team, first + first_row, first + end_row)[0]

    def read_families(first_row: int, end_row: int) -> Families:
        return local_nodes_and_families(team, first + first_row, first + end_row)[1]

    bonds = int(system.initial_bond_counts[own].sum())
    births = Births(own.stop - own.start, grid.dimension, bonds, read_nodes, read_families, first)
    meta = {"program": f"pdsolve {VERSION}", "dimension": grid.dimension, INDEX_OF: Path(path).name.rpartition(".")[0]}
    subdomain.file = RankDatabase(team, lambda: Writer.begin(Path(path), births, grid.cracks, meta), first)


def close_rank_database(team: Team) -> None:
    """Close the file of this rank. Raises WriteError."""
    subdomain: Subdomain = team.subdomain
    if subdomain.file is not None:
        subdomain.file.close()
