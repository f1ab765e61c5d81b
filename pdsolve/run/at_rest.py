"""Models solved at rest: in load steps, or along their equilibrium path."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from pdmesh.model.materials.solids import SOLIDS
from pdsolve.bonds.assembly import Scheme
from pdsolve.bonds.static_breakage import FamilyBonds, StaticBreakage
from pdsolve.conditions import Drive, drive, widened
from pdsolve.laws import law_of
from pdsolve.model import Model, ModelError
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.ground_supports import supports_of
from pdsolve.operators.softening_shear import softening_of
from pdsolve.options import Options
from pdsolve.rest.arc_length import ArcLengthSteps
from pdsolve.rest.contact_method import EquilibriumMethodWithContact
from pdsolve.rest.continuation import SofteningPathSteps
from pdsolve.rest.crack_length import CrackLengthSteps
from pdsolve.rest.equilibrium import EquilibriumMethod
from pdsolve.rest.fatigue import BondFatigueSteps
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.rest.newton import FACTORED, FACTORED_IN, Newton
from pdsolve.rest.paris import ParisSteps
from pdsolve.rest.relaxation import DynamicRelaxation
from pdsolve.rest.static_loads import (
    uses_arc_length_control,
    uses_crack_length_control,
    uses_softening_path_control,
)
from pdsolve.run.assembly import (
    add_ground_supports,
    add_quasi_static_contact,
    make_crack_particle_growth,
    make_operator,
    stable_time_step_from_stiffness_bound,
)
from pdsolve.run.node_changes import GrowingCracks
from pdsolve.run.system import PreparedRun, System
from pdsolve.state import zero_state

MOST_ALONG_PATH = {2: FACTORED, 3: 10_000}  # free components by dimension: factors of 5800 in space take 0.5 GB


def prepare_quasi_static_run(
    model: Model, options: Options, scheme: Scheme, bonds_may_break: bool = True
) -> PreparedRun:
    """A model in load steps, to be solved at rest; `bonds_may_break`: whether its bonds break. Raises ModelError."""
    grows = bonds_may_break and model.settings.run.cracks == "particles"
    bonds_may_break = bonds_may_break and not grows
    if bonds_may_break and uses_softening_path_control(model):
        return _prepare_softening_equilibrium_path(model, options, scheme)
    law, all_bonds, static = law_of(model), scheme.fill(model), model.settings.run.static
    of_families = (
        bonds_may_break and law.pair is None and any(material.failure != "none" for material in model.materials)
    )
    no_fail = StaticBreakage(all_bonds, law.pair)
    filling = all_bonds if of_families else no_fail.filling()
    options = options._replace(kernel="listed") if of_families else options
    bonds, filled = make_operator(model, options, scheme, filling, bonds_are_unbreakable=not of_families)
    area = filling.area
    operator, contact = add_quasi_static_contact(model, area, add_ground_supports(model, area, bonds))
    driven = drive(model, area, scheme.exact_load, np.float64)
    driven.force[:] = driven.before[:] = driven.held_force[:] = 0  # nothing acts before the first load step
    state = operator.to_own_layout(zero_state(*driven.force.shape))
    flows = any(SOLIDS[material.solid].flows for material in model.materials)
    method: EquilibriumMethod
    if static.method == "relaxation":
        method = DynamicRelaxation(operator, static.tolerance, static.iterations)
    else:
        free, most = driven.force.size - len(driven.holds.node), FACTORED_IN[model.grid.dimension]
        pairs = law.pair is not None and contact is None
        method = Newton(operator, area, static.tolerance, static.iterations, free, most, pairs, flows)
    if contact is not None:
        method = EquilibriumMethodWithContact(method, operator, contact)
    breakable = no_fail.breakable() if bonds_may_break and law.pair is not None else None
    breaking = FamilyBonds(cast("BondList", bonds)) if of_families else breakable  # which are listed
    growth = make_crack_particle_growth(model, bonds, filling, driven, None) if grows else None
    fatigue, look = model.settings.run.fatigue, growth.look if growth and not uses_crack_length_control(model) else None
    of = model, operator, driven, area
    stepper = LoadSteps(*of, method, breaking, None if fatigue else look, bonds.update_history, contact)
    step = float(model.settings.run.time_step or 0.0)
    bound = stable_time_step_from_stiffness_bound(operator.stiffness_bound(), model.rho)
    system = System(model, options, scheme, operator, stepper, driven, *filled, step, bound, 0.0)
    system = replace(system, contact=contact)
    if growth is not None:
        system = replace(system, regridder=GrowingCracks(growth))
    if fatigue is not None and growth is not None:
        system = replace(system, stepper=ParisSteps(fatigue, operator, stepper, growth))
    elif fatigue is not None and bonds_may_break:
        if breakable is None:
            raise ModelError(f"{model.name}: $.run.fatigue: no bond may break; let some tire")
        fatigue_steps = BondFatigueSteps(fatigue, operator, stepper, breakable, *filled[1:])
        system = replace(system, stepper=fatigue_steps)
    if bonds_may_break and uses_arc_length_control(model):
        _refuse_body_too_large_for_path(model, driven)
        arc = ArcLengthSteps(*of, breaking, bonds.update_history, has_plastic_flow=flows)
        system = replace(system, stepper=arc)
    if growth is not None and uses_crack_length_control(model):
        system = replace(system, stepper=CrackLengthSteps(*of, stepper, growth))
    return PreparedRun(system, state)


def _prepare_softening_equilibrium_path(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """A model whose bonds soften, to be followed along its equilibrium path. Raises ModelError."""
    filling = scheme.fill(model)
    bonded, filled = make_operator(model, options._replace(kernel="listed"), scheme, filling)
    area = filling.area
    operator, contact = add_quasi_static_contact(model, area, add_ground_supports(model, area, bonded))
    width = sum(unknown.width for unknown in operator.unknowns)
    driven = widened(drive(model, area, scheme.exact_load, np.float64), width)
    _refuse_body_too_large_for_path(model, driven)
    driven.force[:] = driven.before[:] = driven.held_force[:] = 0
    state = operator.to_own_layout(zero_state(*driven.force.shape))
    bonds, ground = softening_of(model, filling.whole(), contact), supports_of(operator)
    if ground is not None:
        bonds.stand_on(np.repeat(area, width)[:, None] * ground.tangent(state))
    stepper = SofteningPathSteps(model, bonded, driven, area, bonds, contact)
    step = model.settings.run.time_step or 1.0
    bound = stable_time_step_from_stiffness_bound(operator.stiffness_bound(), model.rho)
    system = System(model, options, scheme, operator, stepper, driven, *filled, step, bound, 0.0, contact=contact)
    return PreparedRun(system, state)


def _refuse_body_too_large_for_path(model: Model, conditions: Drive) -> None:
    """Raise ModelError for a body that is too large to be followed along its path."""
    most, (nodes, width) = MOST_ALONG_PATH[model.grid.dimension], conditions.force.shape
    if conditions.force.size - len(conditions.holds.node) > most:
        why = "as the tangent is factored along a path"
        raise ModelError(f"{model.name}: $.nodes has {nodes} nodes; use at most {most // width}, {why}")
