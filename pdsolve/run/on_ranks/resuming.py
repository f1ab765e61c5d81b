"""A run that goes on, from a database, on any number of ranks."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry, expect_broken, expect_found
from pdsolve.codegen.compile_time import processor_kind
from pdsolve.conditions import put_loads
from pdsolve.errors import CheckpointError
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.options import Options
from pdsolve.ranks import part as parts
from pdsolve.ranks.part import Part
from pdsolve.results import Results, ResultsError, ResultsWarning, gone_back
from pdsolve.run.on_ranks.frames import HELD, prescribed_components_by_condition
from pdsolve.run.on_ranks.recorder import BATCH, RecorderOnRanks
from pdsolve.run.on_ranks.start import RankSystem, SystemOnRanks, prepare_run_on_ranks
from pdsolve.run.recorder import HistoryUntilCheckpoint
from pdsolve.run.system import System
from pdsolve.state import Broken, State


def make_resumed_recorder(results: Results, model: Model, options: Options, meta: Mapping[str, Any]) -> RecorderOnRanks:
    """The records of a run that goes on on many ranks."""
    options = options._replace(one_file=0 if results.pieces else len(model.grid))
    assert options.team is not None
    system, state = prepare_run_on_ranks(model, options, options.team)
    step, output = results.checkpoint_step(), Path(results.name)
    assert isinstance(system, SystemOnRanks)
    if float(meta["time_step"]) != system.time_step or not has_same_family_sizes(system, results):
        raise make_changed_bonds_or_time_step_error(output, meta, system)
    before = results.breaks().step
    latest = int(before[before <= step].max(initial=0))
    wall, nodes = float(meta.get("wall_time", 0.0)), len(system.model.grid)
    past = HistoryUntilCheckpoint(step, wall, results.bond_updates(step), latest, None, nodes, results)
    with gone_back(output):
        expect_step_within_run(step, system.model)
        restore_all_ranks(system, state, step, results)
        system = dataclasses.replace(system, initial_energy=float(meta.get("initial_energy", 0.0)))
        return RecorderOnRanks(system, state, past)


def warn_of_other_processor(output: Path, meta: Mapping[str, Any]) -> None:
    """Warn if a run goes on on another kind of processor, where sums round otherwise."""
    before, processor = meta.get("processor"), processor_kind()
    if before is not None and before != processor:
        words = (
            f"{output}: begun on a processor of kind {before}, goes on on {processor}: not bit-identical, sums round"
            " anew"
        )
        warnings.warn(words, ResultsWarning, stacklevel=2)


def make_changed_bonds_or_time_step_error(output: Path, meta: Mapping[str, Any], system: System) -> ResultsError:
    """The error of a run whose bonds or step are not those of this version."""
    return ResultsError(
        f"{output} is of a run by {meta['program']} with a step of {meta['time_step']:.6g} s, and this version has"
        f" other bonds or a step of {system.time_step:.6g} s; solve it anew"
    )


def expect_step_within_run(step: int, model: Model) -> None:
    """Raise CheckpointError for a step after the last one."""
    if step > model.settings.run.steps:
        raise CheckpointError(f"step is {step}; the run has {model.settings.run.steps}")


def has_same_family_sizes(system: SystemOnRanks, results: Results) -> bool:
    """Whether the nodes of a database have the families of this system."""
    assert system.team is not None
    nodes = len(system.model.grid)
    if results.count("node") != nodes:
        return False
    for first in range(0, nodes, BATCH):
        last = min(first + BATCH, nodes)
        if not all(system.team.everywhere(_rank_has_same_family_sizes, first, last, *results.bonded(first, last))):
            return False
    return True


def _rank_has_same_family_sizes(
    team: Team, first_row: int, end_row: int, family_sizes: NDArray[np.int64], cut_bond_counts: NDArray[np.int64]
) -> bool:
    """Whether own nodes among these rows have these families."""
    part: Part = team.part
    begin, end = max(first_row, part.slab.first), min(end_row, part.slab.last)
    if begin >= end:
        return True
    rows, entries = slice(begin - part.slab.begin, end - part.slab.begin), slice(begin - first_row, end - first_row)
    count = part.counted.family[rows] - part.counted.bonds[rows]
    return bool(
        (part.counted.family[rows] == family_sizes[entries]).all() and (count == cut_bond_counts[entries]).all()
    )


def restore_all_ranks(system: SystemOnRanks, state: State, step: int, results: Results) -> None:
    """Restore the state of all ranks after `step`. Raises CheckpointError."""
    team, nodes = system.team, len(system.model.grid)
    assert team is not None
    for name, values in state._asdict().items():
        _scatter_state_array_to_ranks(system, name, results.entries(name), values[:1])
    counts = np.array(team.everywhere(_count_prescribed_components)).T  # of each condition and axis, by rank
    held_force = entry(_read_checkpoint_arrays(results, [HELD]), HELD, (int(counts.sum()),), np.float64)
    ends = np.concatenate([[0], np.cumsum(counts.ravel())])
    runs = [held_force[first:last] for first, last in pairwise(ends)]
    team.everywhere(_set_prescribed_component_forces, items=[runs[rank :: team.size] for rank in range(team.size)])
    breaks, grid = results.breaks(), system.model.grid
    before = breaks.step <= step
    ids = [column[before] for column in breaks[1:]]
    if grid.lattice is not None:
        source, target = (end - 1 for end in ids)
        expect_found(np.all([(end >= 1) & (end <= nodes) for end in ids], axis=0), *ids)
    else:
        order = np.argsort(grid.ids)
        source, target = (order[np.searchsorted(grid.ids, end, sorter=order).clip(max=nodes - 1)] for end in ids)
        expect_found((grid.ids[source] == ids[0]) & (grid.ids[target] == ids[1]), *ids)
    broken = Broken(breaks.step[before], source, target)
    expect_broken(broken, step, nodes)
    of_bonds, of_nodes = (set().union(*names) for names in zip(*team.everywhere(_checkpoint_array_names), strict=True))
    node_arrays = _read_checkpoint_arrays(results, of_nodes)
    shared = [
        {name: values.reshape(nodes, -1)[slab.begin : slab.end] for name, values in node_arrays.items()}
        for slab in system.slabs
    ]
    team.everywhere(_restore_rank, _read_checkpoint_arrays(results, of_bonds), broken, step, items=shared)


def _read_checkpoint_arrays(results: Results, names: Iterable[str]) -> CheckpointArrays:
    """Arrays of the last checkpoint, as far as they are there."""
    pieces_by_name = {name: list(results.entries(name)) for name in sorted(names)}
    return {name: np.concatenate(parts) for name, parts in pieces_by_name.items() if parts}


def _scatter_state_array_to_ranks(
    system: SystemOnRanks, array_name: str, array_pieces: Iterator[NDArray[Any]], sample_row: NDArray[Any]
) -> None:
    """Give all ranks their rows of an array of the state, whose `sample_row` (1, ...) is as long as one. Raises
    CheckpointError."""
    first, nodes, team = 0, len(system.model.grid), system.team
    assert team is not None
    for values in array_pieces:
        piece = entry(
            {array_name: values},
            array_name,
            (None, *sample_row.shape[1:]) if sample_row.ndim > 1 else (None, 1),
            sample_row.dtype,
        )
        last = first + len(piece)
        shares = [
            (max(slab.begin, first), piece[max(slab.begin - first, 0) : max(slab.end - first, 0)])
            for slab in system.slabs
        ]
        team.everywhere(_set_local_state_rows, array_name, items=shares)
        first = last
    if first != nodes:
        raise CheckpointError(f"'{array_name}' has {first} nodes; it must have {nodes}")


def _set_local_state_rows(team: Team, array_name: str, first_row_and_values: tuple[int, NDArray[Any]]) -> None:
    """Take over some rows, from the first on, of an array of the state of a window."""
    part: Part = team.part
    first, values = first_row_and_values
    array = getattr(part.now.state, array_name)
    at = first - part.slab.begin
    if len(values):
        array[at : at + len(values)] = values.reshape(-1, *array.shape[1:])


def _count_prescribed_components(team: Team) -> list[int]:
    """How many held components own nodes have, of each condition and axis."""
    return [len(rows) for rows in prescribed_components_by_condition(team.part.now)]


def _set_prescribed_component_forces(team: Team, forces_by_condition_and_axis: list[NDArray[np.float64]]) -> None:
    """Take over the forces that hold own nodes, of each condition and axis."""
    subdomain: RankSystem = team.part.now
    for rows, values in zip(prescribed_components_by_condition(subdomain), forces_by_condition_and_axis, strict=True):
        subdomain.system.drive.held_force[rows] = values


def _checkpoint_array_names(team: Team) -> tuple[list[str], list[str]]:
    """The names of what this rank's operator keeps of bonds, and of nodes."""
    operator_arrays = parts.checkpoint_arrays(team.part)
    of_bonds = [name for name in operator_arrays if parts.is_of_bonds(operator_arrays, name)]
    return of_bonds, [name for name in operator_arrays if name not in of_bonds]


def _restore_rank(
    team: Team, bond_arrays: CheckpointArrays, broken: Broken, step: int, node_arrays: CheckpointArrays
) -> None:
    """Take over the history of bonds, and broken ones; then all is as after the step."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    parts.restore(part, {**bond_arrays, **node_arrays}, broken)
    put_loads(subdomain.system.drive, subdomain.system.profile_time_or_load_factor(step))
    subdomain.bond_state_step = -1  # nothing has been asked of this state
