"""Records of a run in the format of its results."""

from __future__ import annotations

import dataclasses
import time as clock
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.two_lattice_operator import FusedMarch
from pdsolve.checkpoint_validation import entry, expect_broken, expect_found, like
from pdsolve.codegen.compile_time import running_time
from pdsolve.conditions import put_loads
from pdsolve.diffusion.mass_accounts import MassAccounts
from pdsolve.diffusion.swelling import Swelling
from pdsolve.errors import CheckpointError
from pdsolve.results import Breaks, Epoch, Families, Frame, Nodes, Results, Writer
from pdsolve.results.schema import taken
from pdsolve.run.accounts import CoupledRecords, PhysicsRecords
from pdsolve.run.measures import BondState, count_bodies, count_pieces, evaluate_bonds, fields
from pdsolve.run.motion_accounts import MechanicsRecords
from pdsolve.run.node_changes import Change
from pdsolve.run.system import System
from pdsolve.state import Broken, State, zero_state
from pdsolve.steppers.load_steps import Rested
from pdsolve.steppers.path_records import PathRecords
from pdsolve.steppers.stepped_rest import SteppedRest

GAP = 64  # rows between born nodes whose bonds are asked for together
KEPT = 1.0  # s between checkpoints in full precision, with frames
OLD = 10.0  # s, with entries of the ledger


def nodes(system: System) -> Nodes:
    """The nodes in the format of results."""
    grid, cut = system.model.grid, system.family - system.count
    return Nodes(grid.ids, grid.position, grid.delta, system.area, system.family, cut)


def families(system: System, first: int, last: int) -> Families:
    """Initial families of the rows `first` to `last` - 1; available during a run too."""
    if system.transport is not None:  # whose links do not break: nobody asks for them
        return Families(np.zeros(last - first + 1, dtype=np.int64), np.zeros(0, dtype=np.int64))
    _, target = system.operator.bonds(first, last, start=True)
    return Families(np.concatenate([[0], np.cumsum(system.count[first:last])]), target)


def born(system: System, which: NDArray[np.int64], rows: NDArray[np.int64], step: int) -> tuple[Nodes, Families]:
    """Nodes born after `step`, `which` (b,) of a set of nodes, and their remaining bonds; `rows` (n,) as in `Frame`."""
    ends = [*_bonds_of(system, which)]
    since, is_born = system.operator.broken(step), np.zeros(len(system.family), dtype=np.bool_)
    is_born[which] = True
    ends.append((since.source, since.target))
    source, target = (np.concatenate(column) for column in zip(*ends, strict=True))
    source, target = source[is_born[source]], target[is_born[source]]
    order = np.lexsort((target, source))
    source, target = source[order], target[order]
    count = np.bincount(source, minlength=len(system.family))[which]
    born_nodes = taken(nodes(system), which)._replace(cut=system.family[which] - count)
    return born_nodes, Families(np.concatenate([[0], np.cumsum(count)]), rows[target])


def _bonds_of(system: System, which: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Source and target rows (k,) of the bonds of at least these nodes."""
    if isinstance(system.operator, HybridOperator):
        yield system.operator.bonds_of(which)
        return
    for run in np.split(which, np.flatnonzero(np.diff(which) > GAP) + 1) if len(which) else ():
        yield system.operator.bonds(int(run[0]), int(run[-1]) + 1)


def breaks(system: System, after: int, broken: Broken | None = None) -> Breaks:
    """Bonds broken after a step, in order; from all `broken` ones, if known."""
    ids, all_broken = system.model.grid.ids, system.operator.broken(after) if broken is None else broken
    new = np.flatnonzero(all_broken.step > after)
    step, source, target = (column[new] for column in all_broken)
    order = np.lexsort((target, source, step))
    return Breaks(step[order], ids[source[order]], ids[target[order]])


def _until(step: int, broken: Broken) -> Broken:
    """The bonds broken up to a step."""
    before = broken.step <= step
    return Broken(*(column[before] for column in broken))


def checkpoint(system: System, state: State) -> dict[str, NDArray[Any]]:
    """A copy of everything a resumed run needs to continue bit by bit, except the broken bonds."""
    of_bonds = dict(system.operator.keep())  # before the state, which it may bring up to date
    arrays = {"held_force": system.drive.held_force}
    if system.hybrid is None:  # whose operator has the state
        arrays |= state._asdict()
    if system.load_steps is not None:
        arrays["rested"] = system.load_steps.keep()
    if isinstance(system.stepper, SteppedRest):
        arrays |= system.stepper.keep()
    crack_arrays = {} if system.growth is None else system.growth.keep()
    copies = {  # zeros alone, which the system makes when they are read, take no memory
        name: values.copy() if values.any() else np.zeros_like(values) for name, values in arrays.items()
    }
    checkpoint_arrays = copies | of_bonds | crack_arrays
    for prepared in system.beside:
        checkpoint_arrays |= {_of(prepared.system, name): values for name, values in checkpoint(*prepared).items()}
    return checkpoint_arrays


def _of(system: System, name: str) -> str:
    """The name in a checkpoint of an array of an unknown beside the motion."""
    return f"{system.operator.unknowns[0].name}_{name}"


def cloud(system: System) -> dict[str, NDArray[Any]]:
    """Additional checkpoint data if nodes change: their ids, and which of their bonds are broken."""
    broken = system.operator.broken()
    order = np.lexsort((broken.target, broken.source, broken.step))
    return {"ids": system.model.grid.ids} | {f"broken_{name}": side[order] for name, side in broken._asdict().items()}


def restore(system: System, state: State, step: int, checkpoint: Mapping[str, NDArray[Any]], broken: Breaks) -> None:
    """Restore the state after `step` with the bonds `broken` until then. Raises CheckpointError."""
    for name, values in state._asdict().items() if system.hybrid is None else ():  # which has gone back with it
        values[:] = like(checkpoint, name, values)
    system.drive.held_force[:] = like(checkpoint, "held_force", system.drive.held_force)
    nodes = len(system.family)
    if "ids" in checkpoint:
        (count,) = entry(checkpoint, "broken_step", (None,), np.int64).shape
        past = Broken(*(entry(checkpoint, f"broken_{name}", (count,), np.int64) for name in Broken._fields))
    else:
        ids, before = system.model.grid.ids, broken.step <= step
        order = np.argsort(ids)
        ends = [column[before] for column in broken[1:]]
        source, target = (order[np.searchsorted(ids, end, sorter=order).clip(max=nodes - 1)] for end in ends)
        expect_found((ids[source] == ends[0]) & (ids[target] == ends[1]), *ends)
        past = Broken(broken.step[before], source, target)
    expect_broken(past, step, nodes)
    if system.hybrid is None:  # whose nodes are not known before it has gone back
        system.operator.back(checkpoint, past)
    if system.load_steps is not None:
        load_step_rows = entry(checkpoint, "rested", (step, len(Rested._fields)), float)
        if not np.array_equal(load_step_rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"load steps are not 1 to {step}, those until the checkpoint")
        system.load_steps.back(load_step_rows, past)
    if isinstance(system.stepper, SteppedRest):
        system.stepper.back(checkpoint, step)
    if system.growth is not None:
        system.growth.back(checkpoint, past)
    put_loads(system.drive, system.load_time(step))
    for prepared in system.beside:
        start = _of(prepared.system, "")
        coupled_checkpoint = {
            name.removeprefix(start): values for name, values in checkpoint.items() if name.startswith(start)
        }
        restore(*prepared, step, coupled_checkpoint, Breaks(*np.zeros((3, 0), dtype=np.int64)))
    if isinstance(system.stepper, Swelling):
        _swell(system, system.stepper, state)


def _swell(system: System, stepper: Swelling, state: State) -> None:
    """Swell the bonds of a restored system; nodes at the border of a fine zone move with that."""
    stepper.swell()
    if system.hybrid is not None:
        system.hybrid.sync(state)


class Past(NamedTuple):
    """History of a resumed run until its checkpoint."""

    step: int
    wall: float  # s spent
    updates: int  # directed bonds times steps
    latest: int  # step in which a bond broke last; 0: none has
    rows: NDArray[np.int64] | None  # (n,) as in `Frame`
    ever: int  # nodes that ever were
    results: Results | None = None  # so far; None: it begins


def _accounts(system: System, state: State, past: Past, bond_state: BondState) -> PhysicsRecords:
    """The books of a system as they stand after a step."""
    if system.transport is not None:
        return MassAccounts(system.transport, state, past.step, past.results)
    motion = MechanicsRecords(system, state, past.step, bond_state, past.results)
    if not system.beside:
        return motion
    return CoupledRecords(
        motion, tuple((_accounts(*prepared, past, bond_state), prepared) for prepared in system.beside)
    )


class Recorder:
    """Records of a run since it last wrote: accounts, broken bonds, births and deaths."""

    def __init__(self, system: System, state: State, past: Past | None, changes: bool) -> None:
        """`past` is None for a new run, and without results of one that begins after a step, with what broke before.

        `changes`: whether nodes may be born and die.
        """
        self.system, self.state, self.new = system, state, past is None or past.results is None
        past = past or Past(0, 0.0, 0, 0, None, len(system.model.grid))
        self._past, self._began = past._replace(results=None), running_time()
        self._changes, self._rows, self._count = changes, past.rows, past.ever
        self._updates, self._since = past.updates, past.step  # until the last change, or where a run goes on
        self._latest = past.latest  # likewise
        # Of clouds that are no more, or of before the run began
        self._breaks: list[Breaks] = [breaks(system, 0)] if self.new else []
        self._epochs: list[Epoch] = []
        self.written = self.step = past.step  # of the last frame; of the last entry
        self._kept = clock.perf_counter()
        self._begin(past)

    def _begin(self, past: Past) -> None:
        """Open the accounts of the state that the run begins with."""
        self.now = evaluate_bonds(self.system, self.state)
        self.accounts = _accounts(self.system, self.state, past, self.now)

    def writer(self, system: System, output: Path | None, meta: Mapping[str, Any]) -> Writer:
        """The writer of a new database, of a run that begins with this system."""
        return Writer.create(output, nodes(system), partial(families, system), system.model.grid.cracks, meta)

    def divide(self, output: Path | None) -> None:
        """Begin other databases beside `output`, where one is not enough."""

    def close(self) -> None:
        """End the records."""

    def is_split(self) -> bool:
        """Whether there are more pieces than bodies."""
        return count_pieces(self.system) > count_bodies(self.system)

    def wall(self) -> float:
        """Seconds spent on the run, including those before an interruption, without those of compiling kernels."""
        return self._past.wall + running_time() - self._began

    @property
    def is_old(self) -> bool:
        """Whether the last checkpoint is old enough to justify another one, also between frames."""
        return clock.perf_counter() - self._kept > OLD

    def updates(self, step: int) -> int:
        """Number of directed bonds times steps until this step."""
        return self._updates + self.system.bonds * (step - self._since)

    @property
    def latest(self) -> int:
        """Step of the last broken bond known at the last record; 0 without any."""
        return int(self.now.broken.step.max(initial=self._latest))

    def march(self, first: int, last: int) -> int:
        """Take the steps `first` to `last` - 1; with a moving fine zone there is no state before it is asked for.

        Returns the last step that is there: the one before, where a path ended as a step was taken back.
        """
        stepper = self.system.stepper
        if isinstance(stepper, FusedMarch):
            self.let_go()
            stepper.go_on(first, last)
        else:
            stepper.march(self.state, first, last)
        return stepper.rested[-1].step if isinstance(stepper, PathRecords) else last - 1

    def let_go(self) -> None:
        """Forget the state, which the operator of a moving fine zone has, and energies of nodes."""
        self.state = zero_state(0, 2)
        self.now = self.now._replace(strain_energy=self.state.work, softening_energy=self.state.work)

    def _fetch(self) -> None:
        """Bring the state up to the steps taken."""
        self.system.fetch()
        if self.system.hybrid is not None and not len(self.state.value):
            self.state = self.system.hybrid.state()

    def follow(self, step: int, change: Change) -> None:
        """Continue with the nodes changed after `step`, and record births and deaths."""
        before, (system, self.state, origin) = self.system, change
        stay, ids = np.flatnonzero(origin >= 0), system.model.grid.ids
        if system.time_step != before.time_step or (ids[stay] != before.model.grid.ids[origin[stay]]).any():
            raise ValueError(f"step {step}: the time step or the ids of nodes that stay have changed; keep them")
        broken, broken_after = (_until(step, run_system.operator.broken()) for run_system in (before, system))
        self._breaks.append(breaks(before, max(self.written, self._since), broken))
        self._updates, self._since = self.updates(step), step
        self._latest = int(broken.step.max(initial=self._latest))
        self.system = dataclasses.replace(
            system,
            initial_energy=before.initial_energy,
            broken_before=before.broken_before + len(broken.step) - len(broken_after.step),
        )
        del before  # which nothing holds any more: a large one is not to stand beside the new one for long
        self.accounts.switch_system(self.system)
        previous_rows = np.arange(self._count) if self._rows is None else self._rows
        new, rows = np.flatnonzero(origin < 0), np.zeros(len(origin), dtype=np.int64)
        rows[stay], rows[new] = previous_rows[origin[stay]], self._count + np.arange(len(new))
        died = np.delete(previous_rows, origin[stay])
        self._epochs.append(
            Epoch(step + 1, self._count, *born(self.system, new, rows, step), died, len(rows), self.system.bonds)
        )
        self._rows, self._count = rows, self._count + len(new)

    def settle(self, step: int) -> None:
        """Bring the accounts to this step, if they are not there yet."""
        if step != self.step:
            bond_state = self._asked(step)
            self.accounts.update_last_row(self.state, step, bond_state)

    def take(self, step: int) -> None:
        """Record this step in the accounts. Raises UnstableError."""
        bond_state = self._asked(step)
        self.accounts.record_step(self.state, step, bond_state)

    def _asked(self, step: int) -> BondState:
        """What the operator says of the state after this step, asked once."""
        self._fetch()
        if step != self.step:
            self.now, self.step = evaluate_bonds(self.system, self.state), step
        return self.now

    def frame(self, step: int, whole: bool, state: bool) -> Frame:
        """All records since the last frame, for writing.

        `whole` adds the fields, after a recorded step; `state` adds a checkpoint now, otherwise only when it is due.
        """
        system = self.system
        self._fetch()
        state |= clock.perf_counter() - self._kept > KEPT
        if state:
            self._kept = clock.perf_counter()
        bond_state = self.now if self.step == step else None
        field_values = {}
        if whole:
            names = system.asked.settings.run.fields
            field_values = {
                name: of.astype("<f4") for name, of in fields(system, self.state, names, bond_state).items()
            }
        if isinstance(system.stepper, FusedMarch):
            self.let_go()
        checkpoint_arrays = checkpoint(system, self.state) if state else None
        if checkpoint_arrays is not None and self._changes:
            checkpoint_arrays |= cloud(system)
        broken = [*self._breaks, breaks(system, max(self.written, self._since), bond_state and bond_state.broken)]
        frame = Frame(
            step=step,
            time=step * system.time_step,
            fields=field_values if whole else None,
            breaks=Breaks(*map(np.concatenate, zip(*broken, strict=True))),
            ledger=(),
            probes=(),
            checkpoint=checkpoint_arrays,
            wall_time=self.wall(),
            epochs=self._epochs,
            rows=self._rows,
            particles=()
            if system.growth is None
            else system.growth.rows(-1 if self.new and step == 0 else self.written),
        )
        self.written, self._breaks, self._epochs = step, [], []
        return self.accounts.move_records_into(frame)
