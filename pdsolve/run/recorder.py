"""Records of a run on all ranks, in the format of its results; usually of one process, a team of one rank."""

from __future__ import annotations

import dataclasses
import json
import os
import time as clock
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from pdmesh import VERSION
from pdmesh.model.amounts import pair_count
from pdmesh.model.node_grid import Grid
from pdsolve.codegen.compile_time import processor_kind, running_time
from pdsolve.diffusion.masses import MassAccounts
from pdsolve.numerics.team import Team
from pdsolve.results import Breaks, Epoch, Families, FrameRecord, Nodes, Results, Writer, pieces, remove
from pdsolve.results.recovery import expect_piece
from pdsolve.results.schema import CHUNK, Births, select_nodes
from pdsolve.run import frames
from pdsolve.run.accounts import Accounts, CoupledAccounts
from pdsolve.run.energy_accounts import EnergyAccounts
from pdsolve.run.fragments import count_fragments
from pdsolve.run.frames import nodes_for_results, wait_until_all_ranks_wrote_frame
from pdsolve.run.measures import count_initially_separate_bodies
from pdsolve.run.subdomain import Subdomain, team_of
from pdsolve.run.system import System, SystemAfterNodeChange
from pdsolve.state import Broken, State

BATCH = 64 * CHUNK  # nodes that many ranks are asked for together
KEPT = 1.0  # s between checkpoints in full precision, with frames
OLD = 10.0  # s, with entries of the ledger


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
        self._kept = clock.perf_counter()
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
            return frames.gather_nodes_and_families(team, number * batch, min((number + 1) * batch, len(grid)))

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
        self.team.everywhere(frames.open_rank_database, items=[str(real.parent / name) for name in self._files])

    def close_rank_databases(self) -> None:
        """Close the files of all ranks. Raises WriteError."""
        if self._files:
            self.team.everywhere(frames.close_rank_database)

    def has_more_fragments_than_bodies(self) -> bool:
        """Whether there are more pieces than bodies."""
        return count_fragments(self.team) > count_initially_separate_bodies(self.system)

    def wall_time(self) -> float:
        """Seconds spent on the run, including those before an interruption, without those of compiling kernels."""
        return self._past.wall_time + running_time() - self._began

    @property
    def checkpoint_is_old(self) -> bool:
        """Whether the last checkpoint is old enough to justify another one, also between frames."""
        return clock.perf_counter() - self._kept > OLD

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
        with_checkpoint |= clock.perf_counter() - self._kept > KEPT
        if with_checkpoint:
            self._kept = clock.perf_counter()
        names = system.requested_model.settings.run.fields if with_fields else None
        request = frames.FrameRequest(step, max(self.frame_step, self._since), names, with_checkpoint)
        gathered = frames.gather_frame(self.team, request)
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
