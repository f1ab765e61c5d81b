"""Records and frames of a run on all ranks, in the format of its results; usually of one process, a team of one rank.

Each rank records its nodes and sends them in pieces, which rank 0 receives while it writes them. Messages of one rank
arrive in the order in which they are sent, and rank 0 writes column by column, so that nothing says which piece a
message is. In one process nothing is sent, and the writer gets the arrays themselves.
"""

from __future__ import annotations

import dataclasses
import json
import os
import time as clock
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from pdmesh import VERSION
from pdmesh.background_thread import BackgroundThread
from pdmesh.model.amounts import pair_count
from pdmesh.model.cracked_damage import cracked_damage
from pdmesh.model.neighbours import connected
from pdmesh.model.node_grid import Grid
from pdmesh.model.zone_strengths import coarse_nodes, of_body, weakest_zones
from pdsolve.checks import named, warn
from pdsolve.codegen.compile_time import processor_kind, running_time
from pdsolve.diffusion.masses import MassAccounts
from pdsolve.model import Model
from pdsolve.numerics.team import NAP, Team
from pdsolve.results import Breaks, Epoch, Families, FrameRecord, Nodes, Results, ResultsError, Writer, pieces, remove
from pdsolve.results.checksums import crc_joined
from pdsolve.results.recovery import INDEX_OF, expect_piece
from pdsolve.results.schema import CHUNK, Births, Column, select_nodes
from pdsolve.run.accounts import Accounts, CoupledAccounts, EnergyAccounts
from pdsolve.run.measures import compute_node_damage, compute_output_fields
from pdsolve.run.subdomain import (
    HELD_FORCE,
    Columns,
    Subdomain,
    checkpoint_node_ids_and_broken_bonds,
    make_own_checkpoint,
    team_of,
)
from pdsolve.run.system import System, SystemAfterNodeChange
from pdsolve.state import Broken, State

BATCH = 64 * CHUNK  # nodes that many ranks are asked for together
CHECKPOINT_WITH_FRAME = 1.0  # s since the last checkpoint in full precision, after which a frame has one
CHECKPOINT_WITH_ROW = 10.0  # s after which a row of the ledger is written with one


def collect_born_nodes_and_families(
    system: System, born_rows: NDArray[np.int64], rows_in_results: NDArray[np.int64], step: int
) -> tuple[Nodes, Families]:
    """Nodes born after `step`, `born_rows` (b,) of a set of nodes, and their remaining bonds; `rows_in_results` (n,) as
    in `FrameRecord`."""
    ends = system.regridder.bonds_of_rows(system, born_rows)
    since, is_born = system.operator.broken(step), np.zeros(len(system.family_sizes), dtype=np.bool_)
    is_born[born_rows] = True
    ends.append((since.source, since.target))
    source, target = (np.concatenate(column) for column in zip(*ends, strict=True))
    source, target = source[is_born[source]], target[is_born[source]]
    order = np.lexsort((target, source))
    source, target = source[order], target[order]
    count = np.bincount(source, minlength=len(system.family_sizes))[born_rows]
    born_nodes = nodes_for_results(system, born_rows)._replace(cut=system.family_sizes[born_rows] - count)
    return born_nodes, Families(np.concatenate([[0], np.cumsum(count)]), rows_in_results[target])


def list_breaks_since(system: System, after_step: int, broken: Broken | None = None) -> Breaks:
    """Bonds broken after a step, in order; from all `broken` ones, if known."""
    ids, all_broken = system.model.grid.ids, system.operator.broken(after_step) if broken is None else broken
    step, source, target = all_broken.after(after_step)
    order = np.lexsort((target, source, step))
    return Breaks(step[order], ids[source[order]], ids[target[order]])


class HistoryUntilCheckpoint(NamedTuple):
    """History of a resumed run until its checkpoint."""

    checkpoint_step: int
    wall_time: float  # s spent
    directed_bond_updates: int  # directed bonds times steps
    last_break_step: int  # step in which a bond broke last; 0: none has
    rows_in_results: NDArray[np.int64] | None  # (n,) as in `FrameRecord`
    node_count_ever: int  # nodes that ever were
    past_results: Results | None = None  # so far; None: it begins


def open_accounts(system: System, state: State, team: Team, history: HistoryUntilCheckpoint) -> Accounts:
    """The accounts of a system from a step on."""
    if system.transport is not None:
        return MassAccounts(system.transport, state, history.checkpoint_step, history.past_results)
    motion = EnergyAccounts(system, team, history.checkpoint_step, history.past_results)
    if not system.coupled_runs:
        return motion
    return CoupledAccounts(motion, tuple(open_accounts(*run, team, history) for run in system.coupled_runs))


class Recorder:
    """Records of a run since it last wrote: ledger, broken bonds, births and deaths."""

    def __init__(self, system: System, state: State, history: HistoryUntilCheckpoint | None) -> None:
        """`history` is None for a new run, and without results of one that begins after a step, with what broke
        before."""
        self.system, self.is_new = system, history is None or history.past_results is None
        history = history or HistoryUntilCheckpoint(0, 0.0, 0, 0, None, len(system.model.grid))
        self._past, self._began = history._replace(past_results=None), running_time()
        self._rows, self._count = history.rows_in_results, history.node_count_ever
        # Until the last change of nodes, or where a run goes on
        self._updates, self._since = history.directed_bond_updates, history.checkpoint_step
        self._latest = history.last_break_step  # likewise
        self._files: tuple[str, ...] = ()  # of all ranks, if each has one
        # Of clouds that are no more, or of before the run began
        self._breaks: list[Breaks] = []
        self._epochs: list[Epoch] = []
        self.frame_step = self.step = history.checkpoint_step  # of the last frame; of the last entry
        self._last_checkpoint = clock.perf_counter()
        self.team = team_of(system, state)
        if self.is_new and system.ranks is None:
            self._breaks.append(list_breaks_since(system, 0))
        self._beginning: tuple[Grid, int] | None = None  # the nodes and the bonds that are to be written
        if self.is_new:
            self._beginning = system.model.grid, system.directed_bond_count
        else:
            self.team.subdomain.initial_system = None
        self.accounts = open_accounts(system, state, self.team, history)

    @property
    def state(self) -> State:
        """The state of this rank's nodes; of none where the operator has it."""
        subdomain: Subdomain = self.team.subdomain
        return subdomain.state

    def make_database_writer(self, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database of the nodes that the run began with."""
        assert self._beginning is not None
        team, (grid, bonds), batch = self.team, self._beginning, CHUNK if self.team.size == 1 else BATCH

        @lru_cache(1)
        def gather_batch(number: int) -> tuple[Nodes, Families]:
            return gather_nodes_and_families(team, number * batch, min((number + 1) * batch, len(grid)))

        def read_nodes(first_row: int, end_row: int) -> Nodes:
            begin = first_row // batch * batch
            return select_nodes(gather_batch(first_row // batch)[0], np.arange(first_row - begin, end_row - begin))

        def read_families(first_row: int, end_row: int) -> Families:
            begin, (start, target) = first_row // batch * batch, gather_batch(first_row // batch)[1]
            start = start[first_row - begin : end_row - begin + 1]
            return Families(start - start[0], target[start[0] : start[-1]])

        births = Births(len(grid), grid.dimension, bonds, read_nodes, read_families)
        if self._files:
            meta = {**meta, pieces.KEY: json.dumps([pieces.Pieces(0, self._files)])}
        writer = Writer.begin(output, births, grid.cracks, meta)
        self._beginning = team.subdomain.initial_system = None  # which may be large, and of nodes that are no more
        return writer

    def open_rank_databases(self, output: Path | None) -> None:
        """Let each rank write a file of its own beside the index `output`, if there are so many nodes.

        Databases of an earlier run are removed after all names are checked. Raises WriteError.
        """
        if self.system.writes_rank_databases and output is not None:
            self._open_rank_database_set(output, 0)

    def open_further_rank_databases(
        self, output: Path, earlier_rank_databases: tuple[pieces.Pieces, ...]
    ) -> tuple[str, ...]:
        """Let each rank write another file beside the index `output` if it has earlier ones; returns their names."""
        if earlier_rank_databases and self.system.ranks is not None:
            self._open_rank_database_set(output, len(earlier_rank_databases))
        return self._files

    def _open_rank_database_set(self, output: Path, set_number: int) -> None:
        real = Path(os.path.realpath(output))
        self._files = pieces.files_of(real, set_number, self.team.size)
        for name in self._files:
            expect_piece(real.parent / name, real.name)
        if set_number == 0:
            remove(output)
        self.team.everywhere(open_rank_database, items=[str(real.parent / name) for name in self._files])

    def close_rank_databases(self) -> None:
        """Close the files of all ranks. Raises WriteError."""
        if self._files:
            self.team.everywhere(close_rank_database)

    def has_more_fragments_than_bodies(self) -> bool:
        """Whether there are more pieces than bodies, which no bond joins from the start."""
        bodies = self.system.model.grid.bodies
        return count_fragments(self.team) > (1 if bodies is None else len(bodies.names))

    def wall_time(self) -> float:
        """Seconds spent on the run, including those before an interruption, without those of compiling kernels."""
        return self._past.wall_time + running_time() - self._began

    @property
    def checkpoint_is_old(self) -> bool:
        """Whether the last checkpoint is old enough to justify another one, also between frames."""
        return clock.perf_counter() - self._last_checkpoint > CHECKPOINT_WITH_ROW

    def count_bond_updates(self, step: int) -> int:
        """Number of directed bonds times steps until this step."""
        return self._updates + self.system.directed_bond_count * (step - self._since)

    @property
    def last_break_step(self) -> int:
        """Step of the last broken bond known at the last record; 0 without any."""
        return max(self._latest, self.accounts.last_break_step)

    def advance(self, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1; with a moving fine zone there is no state until asked for.

        Returns the last step that is there: the one before, where a path ended as a step was taken back.
        """
        self.team.subdomain.drop_state()
        return self.system.stepper.advance(self.state, first_step, end_step)

    def change_nodes_if_due(self, step: int) -> int:
        """Let nodes change that are due after `step`; returns the step of the next check."""
        regridder = self.system.regridder
        change = regridder.change_nodes(self.system, self.state, step) if regridder.is_due(step) else None
        if change is not None:
            self.record_node_change(step, change)
        return regridder.next_check(step, self.system.model.settings.run.steps)

    def collect_node_changes(self, since_step: int) -> None:
        """Record the changes that the stepper itself has made since the step `since_step`."""
        change = self.system.regridder.collect_change(self.system)
        if change is not None:
            self.record_node_change(since_step, change)

    def record_node_change(self, step: int, change: SystemAfterNodeChange) -> None:
        """Continue with the nodes changed after `step`, and record births and deaths."""
        before, (system, state, origin) = self.system, change
        stay, ids = np.flatnonzero(origin >= 0), system.model.grid.ids
        if system.time_step != before.time_step or (ids[stay] != before.model.grid.ids[origin[stay]]).any():
            raise ValueError(f"step {step}: the time step or the ids of nodes that stay have changed; keep them")
        broken, broken_after = (
            Broken(*(column[all_broken.step <= step] for column in all_broken))
            for all_broken in (before.operator.broken(), system.operator.broken())
        )
        self._breaks.append(list_breaks_since(before, max(self.frame_step, self._since), broken))
        self._updates, self._since = self.count_bond_updates(step), step
        self._latest = int(broken.step.max(initial=self._latest))
        self.system = dataclasses.replace(
            system,
            regridder=before.regridder,
            initial_energy=before.initial_energy,
            broken_bonds_of_removed_nodes=before.broken_bonds_of_removed_nodes
            + len(broken.step)
            - len(broken_after.step),
        )
        self.team.subdomain.follow(self.system, state)
        del before  # which nothing holds any more: a large one is not to stand beside the new one for long
        self.accounts.follow(self.system)
        previous_rows = np.arange(self._count) if self._rows is None else self._rows
        new, rows = np.flatnonzero(origin < 0), np.zeros(len(origin), dtype=np.int64)
        rows[stay], rows[new] = previous_rows[origin[stay]], self._count + np.arange(len(new))
        died = np.delete(previous_rows, origin[stay])
        self._epochs.append(
            Epoch(
                step + 1,
                self._count,
                *collect_born_nodes_and_families(self.system, new, rows, step),
                died,
                len(rows),
                self.system.directed_bond_count,
            )
        )
        self._rows, self._count = rows, self._count + len(new)

    def evaluate_balance(self, step: int) -> None:
        """Bring the last ledger row to this step, if they are not there yet."""
        if step != self.step:
            self.accounts.evaluate(step)
            self.step = step

    def record_step(self, step: int) -> None:
        """Record this step. Raises UnstableError."""
        self.team.subdomain.synchronize()
        self.accounts.record(step)
        self.step = step

    def make_frame(self, step: int, with_fields: bool, with_checkpoint: bool) -> FrameRecord:
        """All records since the last frame, for writing.

        `with_fields` adds the fields, after a recorded step; `with_checkpoint` adds a checkpoint now, otherwise only
        when it is due.
        """
        system = self.system
        with_checkpoint |= clock.perf_counter() - self._last_checkpoint > CHECKPOINT_WITH_FRAME
        if with_checkpoint:
            self._last_checkpoint = clock.perf_counter()
        names = system.requested_model.settings.run.fields if with_fields else None
        request = FrameRequest(step, max(self.frame_step, self._since), names, with_checkpoint)
        gathered = gather_frame(self.team, request)
        frame = FrameRecord(
            step=step,
            time=step * system.time_step,
            fields=gathered.fields if with_fields else None,  # none of them where each rank has a file
            breaks=Breaks(*map(np.concatenate, zip(*self._breaks, gathered.breaks, strict=True))),
            ledger=(),
            probes=(),
            checkpoint=gathered.checkpoint if with_checkpoint else None,
            wall_time=self.wall_time(),
            epochs=self._epochs,
            rows=self._rows,
            particles=system.regridder.particle_rows(-1 if self.is_new and step == 0 else self.frame_step),
            ready=partial(wait_until_all_ranks_wrote_frame, self.team) if self._files else None,
        )
        self.frame_step, self._breaks, self._epochs = step, [], []
        return self.accounts.move_rows_into(frame)

    def metadata(self, provenance: str) -> dict[str, Any]:
        """Metadata of a run, known from its start."""
        system = self.system
        return {
            "program": f"pdsolve {VERSION}",
            "provenance": provenance,
            "units": "SI, per unit thickness" if system.model.grid.dimension == 2 else "SI",
            "dimension": system.model.grid.dimension,
            "numpy": np.__version__,
            "numba": numba.__version__,
            "processor": processor_kind(),
            "mode": system.options.mode,
            "precision": system.options.precision,
            "threads": system.thread_count,
            "kernel": system.operator.name,
            "device": system.stepper.device_name,
            "time_step": system.time_step,
            "stable_time_step": system.stable_time_step,
            "model": system.requested_model.to_json(),
            **self.accounts.metadata(),
        }

    def summary(self, step: int, stopped_early: bool) -> dict[str, Any]:
        """Results of a run for its summary."""
        system, wall = self.system, self.wall_time()
        results: dict[str, Any] = {
            "nodes": len(system.model.grid),
            "bonds": pair_count(system.directed_bond_count),
            "steps": step,
            "time": step * system.time_step,
            "time_step": system.time_step,
            "stable_time_step": system.stable_time_step if np.isfinite(system.stable_time_step) else None,
            "mode": system.options.mode,
            "precision": system.options.precision,
            "threads": system.thread_count,
            "kernel": system.operator.name,
            "layout": system.operator.bond_layout
            if system.operator.name in ("blocks", "listed")
            else system.operator.name,
            "integrator": system.stepper.integrator,
            "device": system.stepper.device_name,
            "wall_time": wall,
            "bond_updates_per_second": self.count_bond_updates(step) / wall if wall > 0 else 0.0,
            "stopped": system.model.settings.run.until if stopped_early else None,
            **self.accounts.summary(),
        }
        if system.contact is not None:  # N/m^5, in space N/m^7; heat, J/m, of a body J
            contact = system.contact
            results["contact"] = {"stiffness": contact.stiffness, "friction": contact.friction(self.state)}
        return results | system.regridder.summary(system) | system.stepper.summary()


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
        self._checkpoint_step = 0

    def write_frame(
        self, step: int, time: float, fields: Mapping[str, NDArray[Any]] | None, checkpoint: Mapping[str, NDArray[Any]]
    ) -> None:
        """Write a frame when the last one is written. Raises WriteError if that failed."""
        self._thread.wait()
        step_arrays = {f"{name}@{step}": values for name, values in checkpoint.items()} or None
        frame = FrameRecord(
            step, time, fields, NOTHING, (), (), step_arrays, first=self._first, keeps=self._checkpoint_step
        )
        self._checkpoint_step = step if step_arrays else self._checkpoint_step
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
        except ResultsError as write_error:
            error = write_error
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
MESSAGE_BYTES = 1 << 20


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
    system, own_rows, known = subdomain.system, subdomain.own_rows, subdomain.known_energies_and_breaks(request.step)
    fields: dict[str, Columns] = {}
    if request.field_names is not None:
        values_by_name = compute_output_fields(system, subdomain.state, request.field_names, known)
        fields = {name: [values[own_rows].astype("<f4")] for name, values in values_by_name.items()}
    subdomain.drop_state()
    checkpoint: dict[str, Columns] = {}
    if request.with_checkpoint:
        checkpoint = make_own_checkpoint(subdomain)
        if system.regridder.nodes_may_change:
            of_nodes = checkpoint_node_ids_and_broken_bonds(system)
            checkpoint |= {name: [values] for name, values in of_nodes.items()}
    if subdomain.file is not None:
        local_arrays = {name: pieces[0] for name, pieces in checkpoint.items() if name != HELD_FORCE}
        local_fields = None if request.field_names is None else {name: values for name, (values,) in fields.items()}
        subdomain.file.write_frame(request.step, request.step * system.time_step, local_fields, local_arrays)
        fields = {name: [] for name in fields}
        checkpoint = {HELD_FORCE: checkpoint[HELD_FORCE]} if checkpoint else {}
    _send_arrays_to_rank_0(team, [piece for pieces in (*fields.values(), *checkpoint.values()) for piece in pieces])
    new = known.broken_bonds.after(request.after_step) if known is not None else subdomain.broken(request.after_step)
    ids, begin = system.model.grid.ids, subdomain.begin
    breaks = np.array([new.step, new.source + begin, new.target + begin, ids[new.source], ids[new.target]])
    return RankFrame(_describe(team, fields), _describe(team, checkpoint), breaks)


def _describe(team: Team, columns: Mapping[str, Columns]) -> dict[str, list[ArrayDescription]]:
    """What is said of columns that are sent; nothing but their names where none is."""
    if team.subdomain.part is None:
        return {name: [] for name in columns}
    return {
        name: [
            ArrayDescription(piece.dtype.str, piece.size, zlib.crc32(np.ascontiguousarray(piece).data))
            for piece in pieces
        ]
        for name, pieces in columns.items()
    }


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
        team.comm.Isend(array[at : at + MESSAGE_BYTES], 0, FRAME)
        for array in flat
        for at in range(0, len(array), MESSAGE_BYTES)
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
            into = np.empty(min(bytes_left, MESSAGE_BYTES), dtype=np.uint8)
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
    system, own_rows, begin = subdomain.initial_system or subdomain.system, subdomain.own_rows, subdomain.begin
    first = min(max(first_row - begin, own_rows.start), own_rows.stop)
    end = min(max(end_row - begin, first), own_rows.stop)
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
    own_rows, first, system = subdomain.own_rows, subdomain.begin + subdomain.own_rows.start, subdomain.system
    grid = system.model.grid

    def read_nodes(first_row: int, end_row: int) -> Nodes:
        return local_nodes_and_families(team, first + first_row, first + end_row)[0]

    def read_families(first_row: int, end_row: int) -> Families:
        return local_nodes_and_families(team, first + first_row, first + end_row)[1]

    bonds = int(system.initial_bond_counts[own_rows].sum())
    births = Births(own_rows.stop - own_rows.start, grid.dimension, bonds, read_nodes, read_families, first)
    meta = {"program": f"pdsolve {VERSION}", "dimension": grid.dimension, INDEX_OF: Path(path).name.rpartition(".")[0]}
    subdomain.file = RankDatabase(team, lambda: Writer.begin(Path(path), births, grid.cracks, meta), first)


def close_rank_database(team: Team) -> None:
    """Close the file of this rank. Raises WriteError."""
    subdomain: Subdomain = team.subdomain
    if subdomain.file is not None:
        subdomain.file.close()


FRAGMENT_SHARE = 0.02  # of all nodes: smaller parts of a plate do not count as pieces


class LocalPieces(NamedTuple):
    """Pieces of a rank's own nodes, each by the row, among all nodes, of one of its nodes."""

    names: NDArray[np.int64]  # (p,)
    node_counts: NDArray[np.int64]  # (p,)
    joined: NDArray[np.int64]  # (2, k) pairs of pieces that a bond joins, the other one of another rank


def count_fragments(team: Team) -> int:
    """Number of pieces: connected components of intact bonds without cracked nodes, of at least a share of nodes."""
    local: list[LocalPieces] = team.everywhere(find_local_pieces)
    names = np.concatenate([pieces.names for pieces in local])
    joined, order = np.concatenate([pieces.joined for pieces in local], axis=1), np.argsort(names)
    component = connected(len(names), *order[np.searchsorted(names, joined, sorter=order)])
    nodes = np.bincount(component, weights=np.concatenate([pieces.node_counts for pieces in local]))
    return int((nodes > FRAGMENT_SHARE * team.subdomain.node_count).sum())


def find_local_pieces(team: Team) -> LocalPieces:
    """The pieces of own nodes."""
    subdomain: Subdomain = team.subdomain
    own_rows, system, begin = subdomain.own_rows, subdomain.system, subdomain.begin
    settings, dimension = system.model.settings, system.model.grid.dimension
    threshold = cracked_damage(settings.horizon.ratio, settings.material, dimension)
    sound = compute_node_damage(system, subdomain.broken()) <= threshold
    source, target = system.operator.bonds(own_rows.start, own_rows.stop)
    inside = (target >= own_rows.start) & (target < own_rows.stop)
    sound_bonds = inside & sound[source] & sound[target]
    number = connected(
        own_rows.stop - own_rows.start, source[sound_bonds] - own_rows.start, target[sound_bonds] - own_rows.start
    )
    _, first, inverse, counts = np.unique(number, return_index=True, return_inverse=True, return_counts=True)
    names = first + begin + own_rows.start
    if subdomain.part is None:
        return LocalPieces(names, counts, np.zeros((2, 0), dtype=np.int64))
    shared = np.zeros((2, len(sound)))  # of ghosts too: the pieces that nodes are of, and whether they count
    shared[:, own_rows] = names[inverse], sound[own_rows]
    subdomain.part.ghosts.receive_values(shared)
    across = ~inside & sound[source] & (shared[1, target] > 0)
    joined = np.unique(shared[0, np.array([source, target])[:, across]].astype(np.int64), axis=1)
    return LocalPieces(names, counts, joined)


def warn_of_broken_bonds_outside_finest_zone(model: Model, results: Results) -> None:
    """Warn for each body of broken bonds of nodes coarser than its finest, which had less strength."""
    grid, weakest_zone_of_each = model.grid, weakest_zones(model.grid, model.settings)
    if not weakest_zone_of_each:
        return
    breaks, order = results.breaks(), np.argsort(grid.ids)
    rows, other_rows = (order[np.searchsorted(grid.ids, ids, sorter=order)] for ids in (breaks.node, breaks.neighbour))
    for weakest in weakest_zone_of_each:
        coarse = coarse_nodes(grid, weakest)
        outside = np.flatnonzero(coarse[rows] | coarse[other_rows])
        if len(outside):
            first = outside[0]
            warn(
                model,
                f"{len(outside) / len(breaks.step):.0%} of the broken bonds are outside the finest zone"
                f"{of_body(weakest.body)}, where strength is down to {weakest.share:.2g} of that within; the first"
                f" broke at step {breaks.step[first]}, {named(model, int(rows[first]))}; widen the fine zone, or set"
                ' material.coarse to "matched" or "unbreakable"',
            )
