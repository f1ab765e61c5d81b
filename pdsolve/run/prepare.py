"""A model made ready for its steps, whatever its physics and adaptivity."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from pdsolve.adaptivity.factory import create_zone_operator_and_stable_step
from pdsolve.adaptivity.hybrid.adaptivity_choice import choose_adaptivity
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.quadtree.incremental_bonds import create_leaf_bonds
from pdsolve.adaptivity.quadtree.operator import SURE, QuadtreeOperator, create_quadtree
from pdsolve.adaptivity.two_lattice_operator import TwoLatticeStepper
from pdsolve.bonds.assembly import Scheme
from pdsolve.checks import refuse_combinations, refuse_numbers
from pdsolve.conditions import constrained_components, damping, initial_velocity, refuse_layers
from pdsolve.diffusion import system as diffusion
from pdsolve.diffusion.swelling import BrokenBonds, Swelling, Swollen, steps_per_content_step
from pdsolve.model import Model, ModelError, counted
from pdsolve.numerics.thread_team import cores, useful_threads
from pdsolve.operators.together import unwrap_bond_operator
from pdsolve.options import Options, threads_of
from pdsolve.rest.equilibrium import force_densities
from pdsolve.rest.static_loads import model_with_load_steps, quasi_static_swelling_model
from pdsolve.run.assembly import (
    assemble_system,
    choose_time_step,
    make_diffusion_stepper,
    options_with_kernel_for_swelling,
    prepare_explicit_motion,
    prepare_quasi_static_run,
    set_initial_velocity_and_acceleration,
    stable_time_step_from_stiffness_bound,
)
from pdsolve.run.cell_splitting import CellSplitting
from pdsolve.run.ranks_start import prepare_run_on_ranks
from pdsolve.run.swelling_with_fine_zone import SwellingStepperWithFineZone
from pdsolve.run.system import MovingZone, PreparedRun, System
from pdsolve.schemes import SCHEMES
from pdsolve.steppers.euler import ForwardEuler

WORTH_HYBRID = 25_000  # nodes of a plate with a fine zone that moves, were they all there


def prepare(model: Model, options: Options) -> PreparedRun:
    """A model's bonds and conditions, and its state at time 0. Raises ModelError for an unsupported model."""
    prepared = _prepare_by_physics_and_adaptivity(with_chosen_adaptivity(model, options), options)
    system = prepared.system
    full_model = None if system.full_model is None else counted(system.full_model, system.time_step)
    return prepared._replace(
        system=replace(system, model=counted(system.model, system.time_step), full_model=full_model)
    )


def with_chosen_adaptivity(model: Model, options: Options) -> Model:
    """The model with run.adapt hybrid or none in place of auto."""
    return choose_adaptivity(model, options) if model.settings.run.adapt == "auto" else model


def _prepare_by_physics_and_adaptivity(model: Model, options: Options) -> PreparedRun:
    if model.has_diffusion_only:
        return _prepare_diffusion(model, options)
    scheme = select_scheme(model, options)
    if options.team is not None:
        return prepare_run_on_ranks(model, options, options.team)
    if model.swells:
        return _prepare_swelling_motion(model, options, scheme)
    if model.settings.run.cracks == "particles" and model.materials[0].detour is not None:
        options = options._replace(kernel="listed")  # blocks keep the weights that their bonds began with
    if model.settings.run.adapt == "split":
        return _prepare_cell_splitting(model, options, scheme)
    if model.settings.run.adapt != "none":
        return _prepare_moving_zone(model, options, scheme)
    if model.settings.run.solver == "static":
        return prepare_quasi_static_run(model_with_load_steps(model), options, scheme)
    return prepare_explicit_motion(model, options, scheme)


def select_scheme(model: Model, options: Options) -> Scheme:
    """The scheme that options name. Raises ModelError for an unsupported model or option."""
    if options.mode not in SCHEMES:
        raise ModelError(f"mode is '{options.mode}'; use one of {', '.join(SCHEMES)}")
    if options.precision not in ("float64", "float32"):
        raise ModelError(f"precision is '{options.precision}'; use float64 or float32")
    if options.kernel not in (None, "blocks", "listed", "hybrid", "collocation"):
        raise ModelError(f"kernel is '{options.kernel}'; use blocks or listed")
    if options.threads is not None and not 1 <= options.threads <= cores():
        raise ModelError(f"threads is {options.threads}; use 1 to {cores()}")
    scheme = SCHEMES[options.mode]
    refuse_combinations(model, options)
    refuse_numbers(model, scheme.partial_cells)
    refuse_layers(model)
    return scheme


def _prepare_diffusion(model: Model, options: Options) -> PreparedRun:
    """A prepared model of diffusion. Raises ModelError for an unsupported one."""
    refuse_combinations(model, options)
    transport, state = diffusion.prepare(model, options.threads, options.kernel == "listed")
    operator, volume = transport.operator, transport.operator.volume
    system = System(
        model=transport.model,
        options=options._replace(threads=transport.threads),
        scheme=SCHEMES["conservative"],
        operator=operator,
        stepper=make_diffusion_stepper(model, transport, state, options.team),
        drive=transport.drive,
        area=volume,
        family_sizes=operator.count + transport.blocked,
        initial_bond_counts=operator.count,
        time_step=transport.time_step,
        stable_time_step=transport.bound,
        initial_energy=0.0,
        transport=transport,
    )
    return PreparedRun(system, state)


def _prepare_swelling_motion(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """A model of a motion that a content swells. Raises ModelError for what cannot be solved so."""
    if model.settings.run.adapt == "hybrid":
        return _prepare_swelling_plate_with_zone(model, options, scheme)
    options, rests = options_with_kernel_for_swelling(model, options), model.settings.run.solver == "static"
    if rests:
        model = quasi_static_swelling_model(model)
        system, state = prepare_quasi_static_run(model.moving_part(), options, scheme)
    else:
        system, state = prepare_explicit_motion(model.moving_part(), options, scheme, bonds_swell=True)
    content = _prepare_diffusion(model.diffusing_part(system.time_step), Options(threads=options.threads))
    transport, marches, cycle = content.system.transport, content.system.stepper, 1
    bonds = cast("Swollen", unwrap_bond_operator(system.operator))
    assert transport is not None
    if not rests:
        cycle = steps_per_content_step(system.time_step, transport.bound)
        marches = ForwardEuler(transport.operator, transport.drive, cycle * system.time_step)
    assert model.settings.medium is not None
    share = model.settings.medium.broken
    broken = None if share == 1 else BrokenBonds(transport, bonds.broken, share)
    if model.settings.medium.deformation:
        content = content._replace(state=content.state._replace(second=np.zeros((len(model.grid), 1))))
    stepper = Swelling(marches, content.state, system.stepper, bonds, model, cycle, broken, transport.free)
    if not rests:  # the first half step goes with what the strains of time 0 pull
        pull = force_densities(system.operator, state) / system.model.rho[:, None]
        state.second[:] += np.where(constrained_components(system.drive), 0.0, pull)
        stepper.begin(state)
    energy = system.initial_energy + float(np.sum(system.area * system.operator.energies(state)[0]))
    return PreparedRun(
        replace(system, stepper=stepper, full_model=model, coupled_runs=(content,), initial_energy=energy), state
    )


def _prepare_swelling_plate_with_zone(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """A plate or body with a moving fine zone that a content swells. Raises ModelError for what cannot be solved so."""
    system, _ = _prepare_moving_zone(model, options, scheme)
    operator, medium = cast("HybridOperator | HybridBodyOperator", system.operator), model.settings.medium
    assert medium is not None
    content = _prepare_diffusion(model.diffusing_part(system.time_step), Options(threads=system.options.threads))
    transport = content.system.transport
    assert transport is not None
    cycle = steps_per_content_step(system.time_step, transport.bound)
    marches = ForwardEuler(transport.operator, transport.drive, cycle * system.time_step)
    broken_now = operator.engine.broken_by_grid_rows
    broken = None if medium.broken == 1 else BrokenBonds(transport, broken_now, medium.broken)
    stepper = SwellingStepperWithFineZone(marches, content.state, operator, model, cycle, broken)
    energy = system.initial_energy + operator.engine.strain_energy()
    return PreparedRun(
        replace(system, stepper=stepper, coupled_runs=(content,), initial_energy=energy), operator.state()
    )


def _prepare_moving_zone(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """A prepared model with a moving fine zone. Raises ModelError for an unsupported one."""
    threads = options.threads or useful_threads(len(model.grid), WORTH_HYBRID)
    if model.grid.dimension == 3:
        threads = threads_of(options, len(model.grid), True)
    shown, bound = create_zone_operator_and_stable_step(model, options.precision, choose_time_step, threads)
    state = shown.state()
    system = System(
        model=shown.current_nodes_model,
        options=options._replace(threads=threads),
        scheme=scheme,
        operator=shown,
        moving_zone_operator=shown,
        regridder=MovingZone(),
        stepper=TwoLatticeStepper(shown),
        drive=shown.engine.drive,
        area=shown.area,
        family_sizes=shown.initial_bond_counts_and_family_sizes[1],
        initial_bond_counts=shown.initial_bond_counts_and_family_sizes[0],
        time_step=shown.engine.time_step,
        stable_time_step=bound,
        initial_energy=shown.energy_balance_totals().kinetic,
        full_model=model,
    )
    return PreparedRun(system, state)


def _prepare_cell_splitting(model: Model, options: Options, scheme: Scheme) -> PreparedRun:
    """A prepared model whose cells can split; none has yet. Raises ModelError for an unsupported one."""
    tree = create_quadtree(model)
    cells = tree.roots()
    now = tree.model_of_leaves(cells)
    bonds, threads = create_leaf_bonds(scheme.by_pairs(now)), threads_of(options, len(model.grid), False)
    operator = QuadtreeOperator(tree, cells, now, bonds, scheme, threads)
    bound = (
        SURE[scheme.name] * stable_time_step_from_stiffness_bound(operator.stiffness_bound(), now.rho) / 2**tree.levels
    )
    step = choose_time_step(model, bound)
    system, state = assemble_system(now, options, scheme, operator, bonds.assembly.counted, step, bound)
    velocity = initial_velocity(model)  # `now` knows none
    set_initial_velocity_and_acceleration(state, velocity, damping(now), system.drive)
    energy = float(np.sum(system.model.rho / 2 * system.area * (velocity**2).sum(axis=1)))
    splitting = replace(system, full_model=tree.model, initial_energy=energy, regridder=CellSplitting(tree))
    return PreparedRun(splitting, state)
