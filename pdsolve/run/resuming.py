"""A run that goes on from its database, on any number of ranks."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh import stopping
from pdsolve.codegen.compile_time import processor_kind
from pdsolve.errors import CheckpointError
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.results import Results, ResultsError, ResultsWarning, gone_back
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import BATCH, HistoryUntilCheckpoint, Recorder
from pdsolve.run.subdomain import Subdomain, restore_all_ranks, team_of
from pdsolve.run.system import Regridder, System
from pdsolve.state import State


def make_resumed_recorder(results: Results, model: Model, options: Options, adaptation: Regridder | None) -> Recorder:
    """The records of a run that goes on; `adaptation` changes its nodes, if not what its model asks for.

    Raises ResultsError for results of another version, or of a run with another adaptation, and ModelError.
    """
    output, meta, (step, checkpoint) = Path(results.name), results.meta(), results.checkpoint()
    with stopping.patience(stopping.AT_ONCE):
        one_file = 0 if results.pieces else len(model.grid)
        system, state = prepare(model, options._replace(one_file=one_file) if options.team else options)
    if system.moving_zone_operator is None and not checkpoint.keys() >= set(State._fields):
        raise ResultsError(f"{output} has a checkpoint that only {meta['program']} reads; solve it anew")
    if float(meta["time_step"]) != system.time_step or not has_same_bonds(system, state, results):
        raise ResultsError(
            f"{output} is of a run by {meta['program']} with a step of {meta['time_step']:.6g} s, and this version has"
            f" other bonds or a step of {system.time_step:.6g} s; solve it anew"
        )
    system = dataclasses.replace(system, regridder=adaptation or system.regridder)
    changes = system.regridder.nodes_may_change
    if changes != ("ids" in checkpoint):
        words = ("stay", "may change") if changes else ("may change", "stay")
        raise ResultsError(f"{output}: its nodes {words[0]}, and here they {words[1]}; resume it as it began")
    breaks, node_count, rows = results.breaks(), len(system.model.grid), None
    if changes:
        with gone_back(output):
            regridder = system.regridder
            system, state = regridder.create_system_with_checkpoint_nodes(system, checkpoint)
            system = dataclasses.replace(system, regridder=regridder)
        lives = results.lives()
        rows, node_count = lives.at(system.model.grid.ids, step), int((lives.birth <= step).sum())
        if not np.array_equal(lives.nodes.family[rows], system.family_sizes) or (rows < 0).any():
            raise ResultsError(f"{output} has other nodes than this version's at step {step}; solve it anew")
    with gone_back(output):
        if step > model.settings.run.steps:
            raise CheckpointError(f"step is {step}; the run has {model.settings.run.steps}")
        restore_all_ranks(team_of(system, state), system, step, checkpoint, breaks)
        until = breaks.step[breaks.step <= step]
        removed = len(until) - len(system.operator.broken().step) if changes else 0
        energy = float(meta.get("initial_energy", 0.0))  # results of diffusion have none
        system = dataclasses.replace(system, broken_bonds_of_removed_nodes=removed, initial_energy=energy)
        wall, updates = float(meta.get("wall_time", 0.0)), results.bond_updates(step)
        past = HistoryUntilCheckpoint(step, wall, updates, int(until.max(initial=0)), rows, node_count, results)
        return Recorder(system, state, past)


def warn_of_other_processor(output: Path, meta: Mapping[str, Any]) -> None:
    """Warn if a run goes on on another kind of processor, where sums round otherwise."""
    before, processor = meta.get("processor"), processor_kind()
    if before is not None and before != processor:
        words = (
            f"{output}: begun on a processor of kind {before}, goes on on {processor}: not bit-identical, sums round"
            " anew"
        )
        warnings.warn(words, ResultsWarning, stacklevel=2)


def has_same_bonds(system: System, state: State, results: Results) -> bool:
    """Whether the nodes of a database have the families of this system at its start."""
    team, nodes = team_of(system, state), len(system.model.grid)
    for first, family_sizes, cut_bond_counts in _initial_families(system, results):
        if first + len(family_sizes) > nodes:
            return False
        nodes_left = nodes - first - len(family_sizes)
        if not all(team.everywhere(_rank_has_same_bonds, first, family_sizes, cut_bond_counts)):
            return False
    return nodes_left == 0


def _initial_families(system: System, results: Results) -> Iterator[tuple[int, NDArray[np.int64], NDArray[np.int64]]]:
    """Row by row what a database says of nodes at the start: a first row, bonds that count, and those cut; of many
    ranks some at a time."""
    if system.ranks is None:
        initial = results.nodes(0)
        yield 0, initial.family, initial.cut
        return
    for first in range(0, max(results.count("node") or 0, 1), BATCH):
        yield first, *results.bonded(first, first + BATCH)


def _rank_has_same_bonds(
    team: Team, first_row: int, family_sizes: NDArray[np.int64], cut_bond_counts: NDArray[np.int64]
) -> bool:
    """Whether own nodes among the rows from the first on have these families."""
    subdomain: Subdomain = team.subdomain
    system, own, offset = subdomain.system, subdomain.own, first_row - subdomain.begin
    rows = slice(max(own.start, offset), min(own.stop, offset + len(family_sizes)))
    if rows.start >= rows.stop:
        return True
    entries = slice(rows.start - offset, rows.stop - offset)
    cut = system.family_sizes[rows] - system.initial_bond_counts[rows]
    return np.array_equal(system.family_sizes[rows], family_sizes[entries]) and np.array_equal(
        cut, cut_bond_counts[entries]
    )
