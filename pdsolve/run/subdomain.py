"""What a rank knows of a run: the system and the state of its nodes, and what was last asked of them.

One process is a team of one rank, whose subdomain has all nodes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.node_grid import Grid
from pdsolve.checkpoint_validation import entry, expect_broken, expect_found, like
from pdsolve.conditions import put_loads
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.ranks import part as parts
from pdsolve.ranks.part import Part
from pdsolve.ranks.part import broken as broken_of_part
from pdsolve.results import Breaks
from pdsolve.run.measures import ForceConditionWithNodes, NodeEnergiesAndBreaks, list_force_conditions_with_nodes
from pdsolve.run.motion_checks import InversionAndPrecisionChecks
from pdsolve.run.system import System
from pdsolve.state import Broken, State, zero_state

if TYPE_CHECKING:
    from pdsolve.run.recorder import RankDatabase

UNKNOWN = -1  # step of a state of which nothing has been asked


class Subdomain:
    """The nodes of one rank, with those around them that its bonds reach."""

    def __init__(self, system: System, state: State, part: Part | None = None) -> None:
        """`part` is what the rank has of many; None: all nodes are its own."""
        self.system, self.state, self.part = system, state, part
        self.initial_system: System | None = system  # until its nodes are written
        self.file: RankDatabase | None = None  # of this rank alone
        self.sending: Any = None  # what is on its way to rank 0
        self._warnings_given = False, False
        self._step = UNKNOWN  # of the energies
        self._energies_and_breaks: NodeEnergiesAndBreaks

    @property
    def own_rows(self) -> slice:
        """The rank's own nodes, among those of its system."""
        return slice(0, len(self.system.family_sizes)) if self.part is None else self.part.own_rows

    @property
    def begin(self) -> int:
        """The row of the system's first node among all nodes."""
        return 0 if self.part is None else self.part.slab.begin

    @property
    def node_count(self) -> int:
        """Number of the nodes of all ranks."""
        return len(self.system.family_sizes) if self.part is None else self.part.slab.nodes

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds of own nodes broken after a step, by rows of the system."""
        if self.part is None:
            return self.system.operator.broken(after_step)
        return broken_of_part(self.part, after_step)

    @cached_property
    def force_conditions(self) -> tuple[ForceConditionWithNodes, ...]:
        """Conditions with forces, and their own nodes."""
        return list_force_conditions_with_nodes(self.system, self.own_rows)

    @cached_property
    def motion_checks(self) -> InversionAndPrecisionChecks:
        """Checks of the motion of the nodes."""
        bonds = partial(self.system.operator.bonds, at_start=True)
        return InversionAndPrecisionChecks(self.system.model, bonds, self._warnings_given)

    def synchronize(self) -> None:
        """Bring the state up to the steps taken."""
        self.system.stepper.synchronize()
        if self.system.moving_zone_operator is not None and not len(self.state.value):
            self.state = self.system.moving_zone_operator.state()

    def drop_state(self) -> None:
        """Forget the state, where the operator has it, and energies of nodes."""
        if self.system.stepper.operator_has_state:
            self.state = zero_state(0, 2)
            if self._step != UNKNOWN:
                nothing: NDArray[np.float64] = self.state.work
                self._energies_and_breaks = NodeEnergiesAndBreaks(nothing, nothing, self._energies_and_breaks[2])

    def energies_and_breaks(self, step: int) -> NodeEnergiesAndBreaks:
        """What the operator says of the state after this step, asked once; with the broken bonds of own nodes."""
        self.synchronize()
        if step != self._step:
            energies = self.system.operator.energies(self.state)
            self._energies_and_breaks, self._step = NodeEnergiesAndBreaks(*energies, self.broken()), step
        return self._energies_and_breaks

    def known_energies_and_breaks(self, step: int) -> NodeEnergiesAndBreaks | None:
        """Energies and counts of broken bonds, if they have been computed after this step; else None."""
        return self._energies_and_breaks if step == self._step else None

    def follow(self, system: System, state: State) -> None:
        """Continue with other nodes."""
        if "motion_checks" in self.__dict__:  # which has the nodes before, which are many
            self._warnings_given = self.motion_checks.inversion_and_imprecision_warned
        for name in ("motion_checks", "force_conditions"):
            self.__dict__.pop(name, None)
        self.system, self.state = system, state


def team_of(system: System, state: State) -> Team:
    """The ranks of a run; usually one process, whose subdomain has all nodes."""
    if system.ranks is not None:
        return system.ranks.team
    team = Team()
    team.subdomain = Subdomain(system, state)
    return team


HELD_FORCE = "held_force"  # the one array that goes neither by nodes nor by bonds
Columns = list[NDArray[Any]]  # those of one name; several, each of some rows, where rows go by condition


def make_checkpoint(system: System, state: State) -> dict[str, NDArray[Any]]:
    """A copy of everything a resumed run needs to continue bit by bit, except the broken bonds."""
    of_bonds = dict(system.operator.checkpoint_arrays())  # before the state, which it may bring up to date
    arrays = {HELD_FORCE: system.drive.held_force}
    if system.moving_zone_operator is None:  # whose operator has the state
        arrays |= state._asdict()
    arrays |= system.stepper.checkpoint_arrays()
    copies = {  # zeros alone, which the system makes when they are read, take no memory
        name: values.copy() if values.any() else np.zeros_like(values) for name, values in arrays.items()
    }
    checkpoint_arrays = copies | of_bonds | dict(system.regridder.checkpoint_arrays())
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


def make_own_checkpoint(subdomain: Subdomain) -> dict[str, Columns]:
    """The checkpoint of the own nodes of a rank, whose bonds have the rows of all nodes."""
    arrays, part = make_checkpoint(subdomain.system, subdomain.state), subdomain.part
    if part is None:
        return {name: [values] for name, values in arrays.items()}
    held_force = arrays.pop(HELD_FORCE)
    own_arrays = parts.own_checkpoint_arrays(part, arrays)
    return {
        HELD_FORCE: [held_force[rows] for rows in _prescribed_components_by_condition(subdomain)],
        **{name: [np.array(values)] for name, values in own_arrays.items()},
    }


def _prescribed_components_by_condition(subdomain: Subdomain) -> list[NDArray[np.int64]]:
    """The held components of each condition and axis, which are in the order of their rows."""
    holds, d = subdomain.system.drive.holds, subdomain.system.model.grid.dimension
    of = holds.condition * d + holds.axis
    return [np.flatnonzero(of == number) for number in range(len(subdomain.force_conditions) * d)]


def restore_all_ranks(team: Team, system: System, step: int, checkpoint: CheckpointArrays, breaks: Breaks) -> None:
    """Restore the state of all ranks after `step` with the bonds `breaks` until then. Raises CheckpointError."""
    if system.ranks is None:
        subdomain: Subdomain = team.subdomain
        restore_state(system, subdomain.state, step, checkpoint, breaks)
        return
    nodes, slabs = len(system.model.grid), system.ranks.slabs
    past = _find_broken_bonds(system.model.grid, checkpoint, step, breaks)
    counts = np.array(team.everywhere(_count_prescribed_components)).T  # of each condition and axis, by rank
    held_force = entry(checkpoint, HELD_FORCE, (int(counts.sum()),), np.float64)
    ends = np.concatenate([[0], np.cumsum(counts.ravel())])
    held_runs = [held_force[first:last] for first, last in pairwise(ends)]
    of_bonds = {name: values for name, values in checkpoint.items() if parts.is_of_bonds(checkpoint, name)}
    of_nodes = {
        name: entry(checkpoint, name, (nodes, None), values.dtype)
        for name, values in checkpoint.items()
        if name not in of_bonds and name != HELD_FORCE
    }
    shares = [
        (held_runs[rank :: team.size], {name: values[slab.begin : slab.end] for name, values in of_nodes.items()})
        for rank, slab in enumerate(slabs)
    ]
    team.everywhere(_restore_rank, step, past, of_bonds, items=shares)


def _count_prescribed_components(team: Team) -> list[int]:
    """How many held components own nodes have, of each condition and axis."""
    return [len(rows) for rows in _prescribed_components_by_condition(team.subdomain)]


def _restore_rank(
    team: Team, step: int, past: Broken, of_bonds: CheckpointArrays, share: tuple[Columns, CheckpointArrays]
) -> None:
    """Restore the state of this rank, which has a `share` of the forces that hold nodes, and of arrays of nodes."""
    subdomain: Subdomain = team.subdomain
    held_runs, of_nodes = share
    held_force = np.zeros_like(subdomain.system.drive.held_force)
    for rows, values in zip(_prescribed_components_by_condition(subdomain), held_runs, strict=True):
        held_force[rows] = values
    window, broken = parts.of_window(team.part, {**of_bonds, **of_nodes}, past)
    _restore(subdomain.system, subdomain.state, step, {**window, HELD_FORCE: held_force}, broken)


def restore_state(
    system: System, state: State, step: int, checkpoint: Mapping[str, NDArray[Any]], breaks: Breaks
) -> None:
    """Restore the state after `step` with the bonds `breaks` until then, in one process. Raises CheckpointError."""
    _restore(system, state, step, checkpoint, _find_broken_bonds(system.model.grid, checkpoint, step, breaks))


def _find_broken_bonds(grid: Grid, checkpoint: CheckpointArrays, step: int, breaks: Breaks) -> Broken:
    """The bonds of a checkpoint that are broken, by the rows of a grid. Raises CheckpointError."""
    nodes = len(grid)
    if "ids" in checkpoint:
        (count,) = entry(checkpoint, "broken_step", (None,), np.int64).shape
        past = Broken(*(entry(checkpoint, f"broken_{name}", (count,), np.int64) for name in Broken._fields))
    else:
        ids, before = grid.ids, breaks.step <= step
        order = np.argsort(ids)
        ends = [column[before] for column in breaks[1:]]
        source, target = (order[np.searchsorted(ids, end, sorter=order).clip(max=nodes - 1)] for end in ends)
        expect_found((ids[source] == ends[0]) & (ids[target] == ends[1]), *ends)
        past = Broken(breaks.step[before], source, target)
    expect_broken(past, step, nodes)
    return past


def _restore(system: System, state: State, step: int, checkpoint: CheckpointArrays, past: Broken) -> None:
    """Restore the state after `step` from arrays of a system's nodes, with the broken bonds `past`."""
    if system.moving_zone_operator is None:  # which has gone back with its state, and before its nodes were known
        for name, values in state._asdict().items():
            values[:] = like(checkpoint, name, values)
    system.drive.held_force[:] = like(checkpoint, HELD_FORCE, system.drive.held_force)
    if system.moving_zone_operator is None:
        system.operator.restore(checkpoint, past)
    for prepared in system.coupled_runs:
        start = _checkpoint_name_of_coupled_array(prepared.system, "")
        coupled_checkpoint = {
            name.removeprefix(start): values for name, values in checkpoint.items() if name.startswith(start)
        }
        _restore(*prepared, step, coupled_checkpoint, Broken(*np.zeros((3, 0), dtype=np.int64)))
    system.stepper.restore(checkpoint, state, step, past)
    system.regridder.restore(checkpoint, past)
    put_loads(system.drive, system.profile_time_or_load_factor(step))
