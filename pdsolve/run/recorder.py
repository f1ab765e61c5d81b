"""Records of a run in the format of its results."""

from __future__ import annotations

import dataclasses
import time as clock
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.checkpoint_validation import entry, expect_broken, expect_found, like
from pdsolve.codegen.compile_time import running_time
from pdsolve.conditions import put_loads
from pdsolve.diffusion.masses import MassAccounts
from pdsolve.results import Breaks, Epoch, Families, FrameRecord, Nodes, Results, Writer
from pdsolve.results.schema import taken
from pdsolve.run.measures import (
    NodeEnergiesAndBreaks,
    compute_node_energies_and_breaks,
    compute_output_fields,
    count_fragments,
    count_initially_separate_bodies,
)
from pdsolve.run.mechanics_records import MechanicsRecords
from pdsolve.run.node_changes import SystemAfterNodeChange
from pdsolve.run.physics_records import CoupledRecords, PhysicsRecords
from pdsolve.run.system import System
from pdsolve.state import Broken, State, zero_state

GAP = 64  # rows between born nodes whose bonds are asked for together
KEPT = 1.0  # s between checkpoints in full precision, with frames
OLD = 10.0  # s, with entries of the ledger


def nodes_for_results(system: System) -> Nodes:
    """The nodes in the format of results."""
    grid, cut = system.model.grid, system.family_sizes - system.initial_bond_counts
    return Nodes(grid.ids, grid.position, grid.delta, system.area, system.family_sizes, cut)


def initial_families_for_results(system: System, first_row: int, end_row: int) -> Families:
    """Initial families of the rows `first_row` to `end_row` - 1; available during a run too."""
    if system.transport is not None:  # whose links do not break: nobody asks for them
        return Families(np.zeros(end_row - first_row + 1, dtype=np.int64), np.zeros(0, dtype=np.int64))
    _, target = system.operator.bonds(first_row, end_row, at_start=True)
    return Families(np.concatenate([[0], np.cumsum(system.initial_bond_counts[first_row:end_row])]), target)


def collect_born_nodes_and_families(
    system: System, born_rows: NDArray[np.int64], rows_in_results: NDArray[np.int64], step: int
) -> tuple[Nodes, Families]:
    """Nodes born after `step`, `born_rows` (b,) of a set of nodes, and their remaining bonds; `rows_in_results` (n,) as
    in `FrameRecord`."""
    if isinstance(system.operator, HybridOperator):
        ends = [system.operator.bonds_of(born_rows)]
    else:
        runs = np.split(born_rows, np.flatnonzero(np.diff(born_rows) > GAP) + 1) if len(born_rows) else []
        ends = [system.operator.bonds(int(run[0]), int(run[-1]) + 1) for run in runs]
    since, is_born = system.operator.broken(step), np.zeros(len(system.family_sizes), dtype=np.bool_)
    is_born[born_rows] = True
    ends.append((since.source, since.target))
    source, target = (np.concatenate(column) for column in zip(*ends, strict=True))
    source, target = source[is_born[source]], target[is_born[source]]
    order = np.lexsort((target, source))
    source, target = source[order], target[order]
    count = np.bincount(source, minlength=len(system.family_sizes))[born_rows]
    born_nodes = taken(nodes_for_results(system), born_rows)._replace(cut=system.family_sizes[born_rows] - count)
    return born_nodes, Families(np.concatenate([[0], np.cumsum(count)]), rows_in_results[target])


def list_breaks_since(system: System, after_step: int, broken: Broken | None = None) -> Breaks:
    """Bonds broken after a step, in order; from all `broken` ones, if known."""
    ids, all_broken = system.model.grid.ids, system.operator.broken(after_step) if broken is None else broken
    step, source, target = all_broken.after(after_step)
    order = np.lexsort((target, source, step))
    return Breaks(step[order], ids[source[order]], ids[target[order]])


def make_checkpoint(system: System, state: State) -> dict[str, NDArray[Any]]:
    """A copy of everything a resumed run needs to continue bit by bit, except the broken bonds."""
    of_bonds = dict(system.operator.checkpoint_arrays())  # before the state, which it may bring up to date
    arrays = {"held_force": system.drive.held_force}
    if system.moving_zone_operator is None:  # whose operator has the state
        arrays |= state._asdict()
    arrays |= system.stepper.checkpoint_arrays()
    crack_arrays = {} if system.crack_growth is None else system.crack_growth.checkpoint_arrays()
    copies = {  # zeros alone, which the system makes when they are read, take no memory
        name: values.copy() if values.any() else np.zeros_like(values) for name, values in arrays.items()
    }
    checkpoint_arrays = copies | of_bonds | crack_arrays
    for prepared in system.coupled_runs:
        checkpoint_arrays |= {
            _checkpoint_name_of_coupled_array(prepared.system, name): values
            for name, values in make_checkpoint(*prepared).items()
        }
    return checkpoint_arrays


def _checkpoint_name_of_coupled_array(system: System, name: str) -> str:
    """The name in a checkpoint of an array of an unknown beside the motion."""
    return f"{system.operator.unknowns[0].name}_{name}"


def checkpoint_node_ids_and_broken_bonds(system: System) -> dict[str, NDArray[Any]]:
    """Additional checkpoint data if nodes change: their ids, and which of their bonds are broken."""
    broken = system.operator.broken()
    order = np.lexsort((broken.target, broken.source, broken.step))
    return {"ids": system.model.grid.ids} | {f"broken_{name}": side[order] for name, side in broken._asdict().items()}


def restore_state(
    system: System, state: State, step: int, checkpoint: Mapping[str, NDArray[Any]], breaks: Breaks
) -> None:
    """Restore the state after `step` with the bonds `breaks` until then. Raises CheckpointError."""
    # The operator of a moving zone has gone back with its state
    for name, values in state._asdict().items() if system.moving_zone_operator is None else ():
        values[:] = like(checkpoint, name, values)
    system.drive.held_force[:] = like(checkpoint, "held_force", system.drive.held_force)
    nodes = len(system.family_sizes)
    if "ids" in checkpoint:
        (count,) = entry(checkpoint, "broken_step", (None,), np.int64).shape
        past = Broken(*(entry(checkpoint, f"broken_{name}", (count,), np.int64) for name in Broken._fields))
    else:
        ids, before = system.model.grid.ids, breaks.step <= step
        order = np.argsort(ids)
        ends = [column[before] for column in breaks[1:]]
        source, target = (order[np.searchsorted(ids, end, sorter=order).clip(max=nodes - 1)] for end in ends)
        expect_found((ids[source] == ends[0]) & (ids[target] == ends[1]), *ends)
        past = Broken(breaks.step[before], source, target)
    expect_broken(past, step, nodes)
    if system.moving_zone_operator is None:  # whose nodes are not known before it has gone back
        system.operator.restore(checkpoint, past)
    for prepared in system.coupled_runs:
        start = _checkpoint_name_of_coupled_array(prepared.system, "")
        coupled_checkpoint = {
            name.removeprefix(start): values for name, values in checkpoint.items() if name.startswith(start)
        }
        restore_state(*prepared, step, coupled_checkpoint, Breaks(*np.zeros((3, 0), dtype=np.int64)))
    system.stepper.restore(checkpoint, state, step, past)
    if system.crack_growth is not None:
        system.crack_growth.restore(checkpoint, past)
    put_loads(system.drive, system.profile_time_or_load_factor(step))


class HistoryUntilCheckpoint(NamedTuple):
    """History of a resumed run until its checkpoint."""

    checkpoint_step: int
    wall_time: float  # s spent
    directed_bond_updates: int  # directed bonds times steps
    last_break_step: int  # step in which a bond broke last; 0: none has
    rows_in_results: NDArray[np.int64] | None  # (n,) as in `FrameRecord`
    node_count_ever: int  # nodes that ever were
    past_results: Results | None = None  # so far; None: it begins


def _make_physics_records(
    system: System, state: State, history: HistoryUntilCheckpoint, energies_and_breaks: NodeEnergiesAndBreaks
) -> PhysicsRecords:
    """The records of a system from a step on."""
    if system.transport is not None:
        return MassAccounts(system.transport, state, history.checkpoint_step, history.past_results)
    motion = MechanicsRecords(system, state, history.checkpoint_step, energies_and_breaks, history.past_results)
    if not system.coupled_runs:
        return motion
    return CoupledRecords(
        motion,
        tuple(
            (_make_physics_records(*prepared, history, energies_and_breaks), prepared)
            for prepared in system.coupled_runs
        ),
    )


class Recorder:
    """Records of a run since it last wrote: ledger, broken bonds, births and deaths."""

    def __init__(
        self, system: System, state: State, history: HistoryUntilCheckpoint | None, nodes_may_change: bool
    ) -> None:
        """`history` is None for a new run, and without results of one that begins after a step, with what broke before.

        `nodes_may_change`: whether nodes may be born and die.
        """
        self.system, self.state, self.is_new = system, state, history is None or history.past_results is None
        history = history or HistoryUntilCheckpoint(0, 0.0, 0, 0, None, len(system.model.grid))
        self._past, self._began = history._replace(past_results=None), running_time()
        self._changes, self._rows, self._count = nodes_may_change, history.rows_in_results, history.node_count_ever
        # Until the last change of nodes, or where a run goes on
        self._updates, self._since = history.directed_bond_updates, history.checkpoint_step
        self._latest = history.last_break_step  # likewise
        # Of clouds that are no more, or of before the run began
        self._breaks: list[Breaks] = [list_breaks_since(system, 0)] if self.is_new else []
        self._epochs: list[Epoch] = []
        self.frame_step = self.step = history.checkpoint_step  # of the last frame; of the last entry
        self._kept = clock.perf_counter()
        self._create_physics_records(history)

    def _create_physics_records(self, history: HistoryUntilCheckpoint) -> None:
        """Open the records of the state that the run begins with."""
        self.energies_and_breaks = compute_node_energies_and_breaks(self.system, self.state)
        self.physics_records = _make_physics_records(self.system, self.state, history, self.energies_and_breaks)

    def make_database_writer(self, initial_system: System, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database, of a run that begins with this system."""
        return Writer.create(
            output,
            nodes_for_results(initial_system),
            partial(initial_families_for_results, initial_system),
            initial_system.model.grid.cracks,
            meta,
        )

    def open_rank_databases(self, output: Path | None) -> None:
        """Begin other databases beside `output`, where one is not enough."""

    def close_rank_databases(self) -> None:
        """End the records."""

    def has_more_fragments_than_bodies(self) -> bool:
        """Whether there are more pieces than bodies."""
        return count_fragments(self.system) > count_initially_separate_bodies(self.system)

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
        return int(self.energies_and_breaks.broken_bonds.step.max(initial=self._latest))

    def advance(self, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1; with a moving fine zone there is no state until asked for.

        Returns the last step that is there: the one before, where a path ended as a step was taken back.
        """
        if self.system.stepper.operator_has_state:
            self.drop_state()
        return self.system.stepper.advance(self.state, first_step, end_step)

    def drop_state(self) -> None:
        """Forget the state, which the operator of a moving fine zone has, and energies of nodes."""
        self.state = zero_state(0, 2)
        self.energies_and_breaks = self.energies_and_breaks._replace(
            strain_energy_density=self.state.work, softening_energy_density=self.state.work
        )

    def _fetch_state(self) -> None:
        """Bring the state up to the steps taken."""
        self.system.stepper.synchronize()
        if self.system.moving_zone_operator is not None and not len(self.state.value):
            self.state = self.system.moving_zone_operator.state()

    def record_node_change(self, step: int, change: SystemAfterNodeChange) -> None:
        """Continue with the nodes changed after `step`, and record births and deaths."""
        before, (system, self.state, origin) = self.system, change
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
            initial_energy=before.initial_energy,
            broken_bonds_of_removed_nodes=before.broken_bonds_of_removed_nodes
            + len(broken.step)
            - len(broken_after.step),
        )
        del before  # which nothing holds any more: a large one is not to stand beside the new one for long
        self.physics_records.switch_system(self.system)
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
            energies_and_breaks = self._update_energies_and_breaks(step)
            self.physics_records.evaluate_balance(self.state, step, energies_and_breaks)

    def record_step(self, step: int) -> None:
        """Record this step. Raises UnstableError."""
        energies_and_breaks = self._update_energies_and_breaks(step)
        self.physics_records.record_step(self.state, step, energies_and_breaks)

    def _update_energies_and_breaks(self, step: int) -> NodeEnergiesAndBreaks:
        """What the operator says of the state after this step, asked once."""
        self._fetch_state()
        if step != self.step:
            self.energies_and_breaks, self.step = compute_node_energies_and_breaks(self.system, self.state), step
        return self.energies_and_breaks

    def make_frame(self, step: int, with_fields: bool, with_checkpoint: bool) -> FrameRecord:
        """All records since the last frame, for writing.

        `with_fields` adds the fields, after a recorded step; `with_checkpoint` adds a checkpoint now, otherwise only
        when it is due.
        """
        system = self.system
        self._fetch_state()
        with_checkpoint |= clock.perf_counter() - self._kept > KEPT
        if with_checkpoint:
            self._kept = clock.perf_counter()
        energies_and_breaks = self.energies_and_breaks if self.step == step else None
        field_values = {}
        if with_fields:
            names = system.requested_model.settings.run.fields
            field_values = {
                name: of.astype("<f4")
                for name, of in compute_output_fields(system, self.state, names, energies_and_breaks).items()
            }
        if system.stepper.operator_has_state:
            self.drop_state()
        checkpoint_arrays = make_checkpoint(system, self.state) if with_checkpoint else None
        if checkpoint_arrays is not None and self._changes:
            checkpoint_arrays |= checkpoint_node_ids_and_broken_bonds(system)
        broken = [
            *self._breaks,
            list_breaks_since(
                system, max(self.frame_step, self._since), energies_and_breaks and energies_and_breaks.broken_bonds
            ),
        ]
        frame = FrameRecord(
            step=step,
            time=step * system.time_step,
            fields=field_values if with_fields else None,
            breaks=Breaks(*map(np.concatenate, zip(*broken, strict=True))),
            ledger=(),
            probes=(),
            checkpoint=checkpoint_arrays,
            wall_time=self.wall_time(),
            epochs=self._epochs,
            rows=self._rows,
            particles=()
            if system.crack_growth is None
            else system.crack_growth.rows(-1 if self.is_new and step == 0 else self.frame_step),
        )
        self.frame_step, self._breaks, self._epochs = step, [], []
        return self.physics_records.move_records_into(frame)
