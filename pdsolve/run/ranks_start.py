"""A motion made ready on all ranks."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Absorb
from pdsolve.conditions import damping, drive, has_conditions, initial_velocity
from pdsolve.model import Model
from pdsolve.numerics.ordered_sums import Branches, branches, total
from pdsolve.numerics.team import Team
from pdsolve.operators.stiffness_damping import damped_stable_time_step
from pdsolve.options import Options
from pdsolve.ranks.part import Part, added_up, built
from pdsolve.run.assembly import (
    assemble_system,
    choose_time_step,
    make_operator,
    make_tiled_operator,
    stable_time_step_from_stiffness_bound,
)
from pdsolve.run.subdomain import Subdomain
from pdsolve.run.system import PreparedRun, Ranks
from pdsolve.schemes import SCHEMES
from pdsolve.state import State
from pdsolve.stepper import Stepper


class StepperOnRanks(Stepper):
    """The stepper of all ranks together."""

    def __init__(self, team: Team, integrator: str) -> None:
        """`integrator` is that of each rank."""
        self._team, self.integrator = team, integrator

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1 on all ranks; `state` is that of this rank."""
        self._team.everywhere(advance_this_rank, first_step, end_step)
        return end_step - 1


class RankInitialMotion(NamedTuple):
    """What a rank says of its start."""

    kinetic_energy: Branches  # energy, J/m
    is_at_rest: bool  # whether no own node moves


def prepare_run_on_ranks(model: Model, options: Options, team: Team) -> PreparedRun:
    """A motion on all ranks of a team, and the state of rank 0's window. Raises ModelError."""
    slabs, parts = built(model, options, team, make_operator, make_tiled_operator)
    largest = np.array([max(report.resistance for report in parts)])
    undamped = stable_time_step_from_stiffness_bound(largest, np.ones(1))
    bound = damped_stable_time_step(undamped, model.settings.run.damping_time)
    step = choose_time_step(model, bound)
    listed = has_conditions(model.settings, Absorb) and model.grid.lattice is None
    damped = [damping(model, slab.begin, slab.end) if listed else None for slab in slabs]
    plain, full_model = options._replace(team=None), None if model.grid.lattice is None else model
    begun = team.everywhere(prepare_rank_system, plain, step, bound, full_model, items=damped)
    rests = all(report.is_at_rest for report in begun)
    energy = 0.0 if rests else total([report.kinetic_energy for report in begun], len(model.grid))
    lonely, bonds = np.concatenate([report.lonely for report in parts]), sum(report.bonds for report in parts)
    subdomain: Subdomain = team.subdomain
    system = replace(
        subdomain.system,
        model=model,
        options=options,
        stepper=StepperOnRanks(team, subdomain.system.stepper.integrator),
        initial_energy=energy,
        ranks=Ranks(team, tuple(slabs), bonds, lonely),
    )
    return PreparedRun(system, subdomain.state)


def prepare_rank_system(
    team: Team,
    options: Options,
    time_step: float,
    stable_time_step: float,
    full_model: Model | None,
    layer_damping_rates: NDArray[np.float64] | None,
) -> RankInitialMotion:
    """Make the system of this rank's window; `layer_damping_rates` (m,), 1/s, is known of listed nodes with layers that
    absorb."""
    part: Part = team.part
    model, slab, counted = part.model, part.slab, part.counted
    scheme, kind = SCHEMES[options.mode], np.dtype(options.precision).type
    driven = drive(model, counted.area, scheme.exact_load, kind, part.own_rows, partial(added_up, team))
    if layer_damping_rates is None:
        layer_damping_rates = damping(model) if full_model is None else damping(full_model, slab.begin, slab.end)
    prepared = assemble_system(
        model,
        options,
        scheme,
        part.operator,
        counted,
        time_step,
        stable_time_step,
        conditions=driven,
        damping_rates=layer_damping_rates,
        ghosts=part.ghosts,
    )
    team.subdomain = Subdomain(*prepared, part)
    velocity = initial_velocity(model, prepared.state.value.shape[1])
    kinetic = (model.rho / 2 * counted.area * (velocity**2).sum(axis=1))[part.own_rows]
    return RankInitialMotion(branches(kinetic, slab.first, slab.nodes), not velocity[part.own_rows].any())


def advance_this_rank(team: Team, first_step: int, end_step: int) -> None:
    """Take the steps `first_step` to `end_step` - 1."""
    subdomain: Subdomain = team.subdomain
    subdomain.system.stepper.advance(subdomain.state, first_step, end_step)
