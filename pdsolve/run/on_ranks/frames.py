"""Frames of all ranks: each records its rows and sends them in pieces, which rank 0 receives while it writes them.

Messages of one rank arrive in the order in which they are sent, and rank 0 writes column by column, so that nothing
says which piece a message is.
"""

from __future__ import annotations

import time as clock
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh import VERSION
from pdsolve.numerics.team import NAP, Team
from pdsolve.ranks import part as parts
from pdsolve.ranks.part import Part, broken
from pdsolve.results import Families, Nodes, Writer
from pdsolve.results.checksums import crc_joined
from pdsolve.results.removal import INDEX_OF
from pdsolve.results.schema import Births, Column
from pdsolve.run.measures import compute_output_fields
from pdsolve.run.on_ranks.mechanics_records import compute_energies_and_breaks_of_rank_once
from pdsolve.run.on_ranks.rank_file import RankDatabase
from pdsolve.run.on_ranks.start import RankSystem
from pdsolve.run.recorder import nodes_for_results as nodes_of

FRAME = 8  # tag of messages
PIECE = 1 << 20  # bytes of a message
HELD = "held_force"
Columns = list[NDArray[Any]]  # those of one name; several, each of some rows, where rows go by condition


class ArrayDescription(NamedTuple):
    """What a rank says of an array before it sends it."""

    dtype_name: str
    value_count: int
    crc: int


class FrameHeaderAndBreaks(NamedTuple):
    """What a rank says of the frame that it sends: the arrays of each column by name."""

    fields: dict[str, list[ArrayDescription]]
    checkpoint_arrays: dict[str, list[ArrayDescription]]
    new_breaks: NDArray[np.int64]  # (5, k) step, rows of both nodes in the whole grid, and their ids


class PendingMessages(NamedTuple):
    """Messages on their way, and what they hold."""

    mpi_requests: list[Any]
    sent_arrays: list[NDArray[Any]]


def send_frame_to_rank_0(
    team: Team, step: int, previous_frame_step: int, field_names: Sequence[str] | None, with_checkpoint: bool
) -> FrameHeaderAndBreaks:
    """Send the fields of these `field_names` after a step, `with_checkpoint` or not, and the breaks since
    `previous_frame_step`. Where this rank has a file of its own, that is where both go, but for what is of held
    components."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    local_fields: dict[str, NDArray[Any]] = {}
    if field_names is not None:
        subdomain_fields = compute_output_fields(
            subdomain.system,
            subdomain.state,
            field_names,
            compute_energies_and_breaks_of_rank_once(team, step) if subdomain.bond_state_step == step else None,
        )
        local_fields = {name: values[part.own].astype("<f4") for name, values in subdomain_fields.items()}
    local_arrays: dict[str, Columns] = {}
    if with_checkpoint:  # a copy of what a resumed run needs of own nodes; of held components by condition and axis
        operator_arrays = dict(parts.checkpoint_arrays(part))  # before the state, which it may bring up to date
        local_arrays = {name: [values[part.own].copy()] for name, values in subdomain.state._asdict().items()}
        held_force = subdomain.system.drive.held_force
        local_arrays[HELD] = [held_force[rows] for rows in prescribed_components_by_condition(subdomain)]
        local_arrays |= {name: [np.array(values)] for name, values in operator_arrays.items()}
    sent = {name: [values] for name, values in local_fields.items()}, local_arrays
    if subdomain.file is not None:
        checkpoint = {name: pieces[0] for name, pieces in sent[1].items() if name != HELD}
        subdomain.file.write_frame(
            step, step * subdomain.system.time_step, local_fields if field_names is not None else None, checkpoint
        )
        sent = {name: [] for name in local_fields}, {HELD: sent[1][HELD]} if with_checkpoint else {}
    _send_arrays_to_rank_0(team, [piece for columns in sent for pieces in columns.values() for piece in pieces])
    new, ids, begin = broken(part, previous_frame_step), part.model.grid.ids, part.slab.begin
    breaks = np.array([new.step, new.source + begin, new.target + begin, ids[new.source], ids[new.target]])
    field_descriptions, checkpoint_descriptions = (
        {
            name: [
                ArrayDescription(array.dtype.str, array.size, zlib.crc32(np.ascontiguousarray(array).data))
                for array in pieces
            ]
            for name, pieces in columns.items()
        }
        for columns in sent
    )
    return FrameHeaderAndBreaks(field_descriptions, checkpoint_descriptions, breaks)


def prescribed_components_by_condition(subdomain: RankSystem) -> list[NDArray[np.int64]]:
    """The held components of each condition and axis, which are in the order of their rows."""
    holds, d = subdomain.system.drive.holds, subdomain.system.model.grid.dimension
    of = holds.profile * d + holds.axis
    return [np.flatnonzero(of == number) for number in range(len(subdomain.force_conditions) * d)]


def _send_arrays_to_rank_0(team: Team, columns: Columns) -> None:
    """Send columns to rank 0, when those before have arrived; rank 0 keeps its own."""
    part: Part = team.part
    if team.rank == 0:
        part.sending = PendingMessages([], columns)
        return
    from mpi4py import MPI

    if part.sending is not None:
        MPI.Request.Waitall(part.sending.mpi_requests)
    flat = [np.ascontiguousarray(values).reshape(-1).view(np.uint8) for values in columns]
    requests = [
        team.comm.Isend(array[at : at + PIECE], 0, FRAME) for array in flat for at in range(0, len(array), PIECE)
    ]
    part.sending = PendingMessages(requests, flat)


def receive_columns_from_ranks(
    team: Team, local_arrays: Iterator[NDArray[Any]], descriptions: Sequence[Mapping[str, list[ArrayDescription]]]
) -> dict[str, Column]:
    """The columns that all ranks send, of which each says this; `local_arrays` are those of this rank."""
    columns = {}
    for name in descriptions[0]:
        runs = range(len(descriptions[0][name]))
        order = [(rank, *description[name][run]) for run in runs for rank, description in enumerate(descriptions)]
        kind = np.dtype(order[0][1] if order else "<f4")
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


def local_node_columns_and_bond_targets(team: Team, first_row: int, end_row: int) -> tuple[NDArray[Any], ...]:
    """Own nodes from `first_row` to `end_row` - 1, in the format of results, and the targets of their bonds."""
    part: Part = team.part
    slab = part.slab
    rows = slice(
        max(first_row, slab.first) - slab.begin, max(min(end_row, slab.last), max(first_row, slab.first)) - slab.begin
    )
    return *(column[rows] for column in nodes_of(part.now.system)), parts.bonds(team, first_row, end_row)


def gather_nodes_and_families(team: Team, first_row: int, end_row: int) -> tuple[Nodes, Families]:
    """The nodes of these rows and their families, from all ranks."""
    *columns, target = (
        np.concatenate(column)
        for column in zip(*team.everywhere(local_node_columns_and_bond_targets, first_row, end_row), strict=True)
    )
    new_nodes = Nodes(*columns)
    return new_nodes, Families(np.concatenate([[0], np.cumsum(new_nodes.family - new_nodes.cut)]), target)


def open_rank_database(team: Team, path: str) -> None:
    """Give this rank a file of its own, for what is written from now on."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    slab, grid = part.slab, part.model.grid

    def read_local_nodes(first_row: int, end_row: int) -> Nodes:
        *columns, _ = local_node_columns_and_bond_targets(team, slab.first + first_row, slab.first + end_row)
        return Nodes(*columns)

    def read_local_families(first_row: int, end_row: int) -> Families:
        rows = np.arange(first_row, end_row) + slab.first - slab.begin
        start = np.concatenate([[0], np.cumsum(part.counted.bonds[rows])])
        return Families(start, parts.bonds(team, slab.first + first_row, slab.first + end_row))

    bonds = int(part.counted.bonds[part.own].sum())
    births = Births(slab.last - slab.first, grid.dimension, bonds, read_local_nodes, read_local_families, slab.first)
    index = Path(path).name.rpartition(".")[0]
    meta = {"program": f"pdsolve {VERSION}", "dimension": grid.dimension, INDEX_OF: index}
    subdomain.file = RankDatabase(team, lambda: Writer.begin(Path(path), births, grid.cracks, meta), slab.first)


def close_rank_database(team: Team) -> None:
    """Close the file of this rank. Raises WriteError."""
    subdomain: RankSystem = team.part.now
    if subdomain.file is not None:
        subdomain.file.close()
