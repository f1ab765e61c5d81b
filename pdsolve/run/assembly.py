"""Operator, time step and stepper of a model, put together into its system: in motion, at rest, or along a path."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numba
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Load
from pdmesh.model.materials.solids import SOLIDS
from pdsolve.bonds.assembly import Bonds, BondSource, BondStatistics, FamilyCounts, Scheme, listed
from pdsolve.bonds.static_breakage import FamilyBonds, StaticBreakage
from pdsolve.checks import refuse_fields
from pdsolve.conditions import Drive, conditions_of, damping, drive, initial_acceleration, initial_velocity, widened
from pdsolve.device.families import FamiliesOnDevice, FluxesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.device.tiles import BlocksOnDevice, TilesOnDevice
from pdsolve.diffusion.system import Transport
from pdsolve.lattice import family_blocks, family_tiles
from pdsolve.lattice.block_bonds import blocks_of, can_be_in_blocks
from pdsolve.lattice.family_blocks import FamiliesInBlocks
from pdsolve.lattice.family_operator import FamilyLattice
from pdsolve.lattice.family_tiles import FamiliesInTiles
from pdsolve.lattice.flux_operator import FluxesInTiles
from pdsolve.lattice.operator import BlockLattice, TileLattice
from pdsolve.laws import law_of
from pdsolve.laws.bond_arrays import Tabled
from pdsolve.laws.law import Law
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.numerics.team import Team
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.contact.operator import BondsInContact, PenaltyContact, touch_bound
from pdsolve.operators.following_pressure import FollowingPressure
from pdsolve.operators.ghosts import Ghosts
from pdsolve.operators.ground_supports import GroundSupports, supported, supports_of
from pdsolve.operators.protocol import BondLayout, Motion, Operator
from pdsolve.operators.softening_shear import softening_of
from pdsolve.operators.stiffness_damping import add_stiffness_damping, damped_stable_time_step
from pdsolve.operators.together import Together, unwrap_bond_operator
from pdsolve.options import Options, threads_of
from pdsolve.ranks.diffusing import EulerOnRanks
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
from pdsolve.run.system import GrowingCracks, PreparedRun, System
from pdsolve.schemes.cubic_lattice_bonds import Tiled, tiled
from pdsolve.state import State, Unknown, zero_state
from pdsolve.stepper import Stepper
from pdsolve.steppers.verlet import Verlet

if TYPE_CHECKING:
    from pdsolve.crack_growth.growth import Growth


def make_operator(
    model: Model,
    options: Options,
    scheme: Scheme,
    bond_source: BondSource,
    bonds_are_unbreakable: bool = False,
    bonds_swell: bool = False,
) -> tuple[Operator, FamilyCounts]:
    """The operator of the bonds: in blocks if possible and not excluded by options; and what is counted of the bonds.

    `bonds_are_unbreakable`: no bond breaks, as `bond_source` has it; `bonds_swell`: they stretch from what a content
    makes them long, which tiles have in zones alone.
    """
    tiled_operator = None if bonds_swell else make_tiled_operator(model, options, scheme, bonds_are_unbreakable)
    if tiled_operator is not None:
        return tiled_operator
    law, kind, nodes = law_of(model, scheme.matches_work), np.dtype(options.precision).type, len(model.grid)
    blocked = _allows_compiled_layouts(options)
    statistics = BondStatistics(bond_source, scheme.symmetric)
    if model.settings.run.device != "cpu":
        return _make_device_operator(model, options, scheme, bond_source, law, statistics)
    if law.pair is not None and blocked:
        shape = model.grid.position.shape
        blocks = blocks_of(law, statistics.parts(), shape, kind, threads_of(options, nodes, True))
        if blocks is not None:
            operator = BlockLattice(law, blocks, statistics.stiffness_bound, scheme.symmetric, statistics.softens)
            return operator, statistics.counted(bond_source.area)
        statistics = BondStatistics(bond_source, scheme.symmetric)
    threads = threads_of(options, nodes, False)
    bonds = listed(statistics.parts(), bond_source.area).bonds
    counted = statistics.counted(bond_source.area)
    of = law, model, bonds, scheme.symmetric, options.precision, threads
    layout = _choose_family_layout_function(law, model, bonds, bond_source.area, threads) if blocked else None
    if layout is not None:
        return FamilyLattice(*of, layout), counted
    if options.kernel == "blocks":
        raise ModelError(
            "kernel is blocks; use listed: blocks need nodes on a lattice, a law that is written for them, and"
            " compiled code"
        )
    return BondList(*of), counted


def _choose_family_layout_function(
    law: Law, model: Model, bonds: Bonds, volume: NDArray[np.float64], threads: int
) -> Callable[[Tabled, np.dtype[Any]], FamiliesInBlocks | FamiliesInTiles] | None:
    """What lays out families in tiles, else in blocks; None for a law without tuples, or nodes on no lattice."""
    in_space = family_tiles.placed(law, model, bonds, volume)
    if in_space is not None:
        return partial(FamiliesInTiles, in_space, bonds, threads)
    where = family_blocks.placed(law, bonds)
    return None if where is None else partial(FamiliesInBlocks, *where, len(model.grid))


def make_tiled_operator(
    model: Model, options: Options, scheme: Scheme, bonds_are_unbreakable: bool = False
) -> tuple[Operator, FamilyCounts] | None:
    """The operator of a body's bonds in tiles, and what is counted of the bonds; None where tiles cannot be or are
    excluded by options.

    `bonds_are_unbreakable`: no bond breaks.
    """
    tiles = _make_bond_tiles_if_possible(model, options, scheme, bonds_are_unbreakable)
    if tiles is None:
        return None
    parts = law_of(model, scheme.matches_work), tiles.tiles, tiles.sites, tiles.stiffness_bound, scheme.symmetric
    if model.settings.run.device != "cpu":
        on_device = TilesOnDevice(*parts, 1)
        on_device.put_on(Session(model.settings.run.device))
        return on_device, tiles.counted
    return TileLattice(*parts, threads_of(options, len(model.grid), True)), tiles.counted


def _make_device_operator(
    model: Model, options: Options, scheme: Scheme, bond_source: BondSource, law: Law, statistics: BondStatistics
) -> tuple[Operator, FamilyCounts]:
    """The operator of bonds that are in no tiles on a device. Raises ModelError."""
    if law.lanes is not None:  # a law of families
        bonds = listed(statistics.parts(), bond_source.area).bonds
        layout = _choose_family_layout_function(law, model, bonds, bond_source.area, 1)
        if layout is None:
            raise ModelError(f"{model.name}: $.run.device: nodes are on no lattice; use cpu, or nodes on one")
        families = FamiliesOnDevice(law, model, bonds, scheme.symmetric, options.precision, 1, layout)
        families.put_on(Session(model.settings.run.device))
        return families, statistics.counted(bond_source.area)
    session, kind = Session(model.settings.run.device), np.dtype(options.precision).type
    blocks = blocks_of(law, statistics.parts(), model.grid.position.shape, kind, 1)
    if blocks is None:
        raise ModelError(f"{model.name}: $.run.device: nodes are on no lattice; use cpu, or nodes on one")
    operator = BlocksOnDevice(law, blocks, statistics.stiffness_bound, scheme.symmetric, statistics.softens)
    operator.put_on(session)
    return operator, statistics.counted(bond_source.area)


def _add_ground_supports(model: Model, volume: NDArray[np.float64], bonds: Operator) -> Operator:
    """The operator of a model's bonds with its spring supports and pins, if it has any. `volume` (n,), m^d."""
    return supported(model, volume, bonds) if model.has_supports else bonds


def add_penalty_contact(
    model: Model, volume: NDArray[np.float64], bond_operator: Operator
) -> tuple[Operator, PenaltyContact | None]:
    """The operator of a model's bonds and of what touches; and the latter. `volume` (n,), m^d. Raises ModelError."""
    if model.settings.contact is None:
        return bond_operator, None
    longest = stable_time_step_from_stiffness_bound(touch_bound(model, volume), model.rho)
    step = model.settings.run.time_step
    if step is not None and step > longest:
        raise ModelError(
            f"{model.name}: $.contact.stiffness is {model.settings.contact.stiffness:g} with steps of {step:.3g} s;"
            f" use steps up to {longest:.3g} s, or less"
        )
    contact = PenaltyContact(model, volume, bond_operator)
    return BondsInContact(contact, bond_operator), contact


def add_quasi_static_contact(
    model: Model, volume: NDArray[np.float64], bond_operator: Operator
) -> tuple[Operator, RestingContact | None]:
    """The operator of the bonds of a model at rest and of what touches; and the latter. `volume` (n,), m^d."""
    if model.settings.contact is None:
        return bond_operator, None
    contact = RestingContact(model, volume, bond_operator)
    return BondsInContact(contact, bond_operator), contact


def options_with_kernel_for_swelling(model: Model, options: Options) -> Options:
    """The options of a kernel that knows what swells: blocks in motion, of laws that they can sum so; else the list.

    Raises ModelError where the options exclude it.
    """
    pair, run = law_of(model).pair, model.settings.run
    swells_in_blocks = pair is not None and not (pair.is_curved and pair.softening is not None)
    fast = swells_in_blocks and run.solver == "explicit"
    expected = (None, "listed", "blocks") if fast else (None, "listed")
    if options.kernel not in expected:
        raise ModelError(f"{model.name}: kernel is {options.kernel}; use listed for bonds that swell")
    return options if fast else options._replace(kernel="listed")


def count_bonds_and_compute_stiffness_bound(
    model: Model, options: Options, scheme: Scheme
) -> tuple[FamilyCounts, NDArray[np.float64], BondLayout]:
    """Numbers (n,) of the bonds of a pair law, the bound (n,) of their stiffness, N/m^4, and where they will be."""
    tiles = _make_bond_tiles_if_possible(model, options, scheme, False)
    if tiles is not None:
        area = tiles.counted.area
        return tiles.counted, tiles.stiffness_bound + _contact_and_support_stiffness_bound(model, area), "tiles"
    filling = scheme.fill(model)
    statistics = BondStatistics(filling, scheme.symmetric)
    in_blocks = can_be_in_blocks(statistics.parts(), model.grid.position.shape) and _allows_compiled_layouts(options)
    bound = statistics.stiffness_bound + _contact_and_support_stiffness_bound(model, filling.area)
    return statistics.counted(filling.area), bound, "blocks" if in_blocks else "listed"


def _contact_and_support_stiffness_bound(model: Model, volume: NDArray[np.float64]) -> NDArray[np.float64]:
    """What contact and supports add to the bound (n,) of each node's stiffness, N/m^4."""
    supports = GroundSupports(model, volume, (Unknown("u", model.grid.dimension, 2),))
    return touch_bound(model, volume) + supports.stiffness_bound()


def _make_bond_tiles_if_possible(
    model: Model, options: Options, scheme: Scheme, bonds_are_unbreakable: bool
) -> Tiled | None:
    """The bonds of a body in tiles, where they can be and options do not exclude it."""
    if model.grid.dimension == 2 or not _allows_compiled_layouts(options) or not scheme.symmetric:
        return None
    return tiled(model, np.dtype(options.precision).type, bonds_are_unbreakable)


def _allows_compiled_layouts(options: Options) -> bool:
    """Whether bonds may be in tiles or blocks, which are for compiled code."""
    return options.kernel != "listed" and not numba.config.DISABLE_JIT


def compute_stable_time_step(model: Model, operator: Operator) -> float:
    """The longest surely stable step of a motion, s, in which families may lose bonds; infinite without bonds."""
    start, torn_stiffness = operator.stiffness_bound(), law_of(model).torn_stiffness
    breaks = model.settings.run.cracks == "bonds" and any(material.failure != "none" for material in model.materials)
    if breaks and torn_stiffness is not None:  # of laws of families alone, whose bonds are listed
        start = np.maximum(start, torn_stiffness(cast("BondList", unwrap_bond_operator(operator)).columns, start))
    step, damping_time = stable_time_step_from_stiffness_bound(start, model.rho), model.settings.run.damping_time
    return damped_stable_time_step(step, damping_time) if damping_time else step


def compute_stable_time_step_of_intact_bonds(model: Model, operator: Operator) -> float:
    """The longest surely stable step, s, with the bonds that are left; infinite where it is none the shorter."""
    bound = operator.intact_stiffness_bound()
    return np.inf if bound is None else stable_time_step_from_stiffness_bound(bound, model.rho)


def stable_time_step_from_stiffness_bound(stiffness_bound: NDArray[np.float64], rho: NDArray[np.float64]) -> float:
    """The longest surely stable step, s, for an operator's `stiffness_bound` (n,); infinite without bonds."""
    largest = float((stiffness_bound / rho).max(initial=0.0))
    return float(np.sqrt(2 / largest)) if largest > 0 else float("inf")


STILL = 2.0  # damping times a step: more would turn velocities round within it


def prepare_explicit_motion(model: Model, options: Options, scheme: Scheme, bonds_swell: bool = False) -> PreparedRun:
    """A model's system and its state at time 0, with the bonds of this scheme; `bonds_swell` as in `make_operator`.
    Raises ModelError."""
    filling, particles = scheme.fill(model), model.settings.run.cracks == "particles"
    filling = StaticBreakage(filling).filling() if particles else filling  # of which none breaks by itself
    bonds, filled = make_operator(model, options, scheme, filling, particles, bonds_swell)
    operator = _add_ground_supports(model, filled.area, bonds)
    loads = [load for _, load in conditions_of(model.settings, Load) if load.following]
    standing = (
        Together(FollowingPressure(model, loads, filled.area, operator.unknowns), operator) if loads else operator
    )
    operator, touching = add_penalty_contact(model, filled.area, standing)
    bound = compute_stable_time_step(model, operator)
    prepared = assemble_system(model, options, scheme, operator, filled, choose_time_step(model, bound), bound)
    if touching is not None:
        touching.rigid.start(prepared.state, prepared.system.drive, prepared.system.time_step)
    growth = make_crack_particle_growth(model, bonds, filling, prepared.system.drive, prepared.system.time_step)
    system = replace(prepared.system, contact=touching)
    return prepared._replace(system=system if growth is None else replace(system, regridder=GrowingCracks(growth)))


def assemble_system(
    model: Model,
    options: Options,
    scheme: Scheme,
    operator: Operator,
    bond_counts: FamilyCounts,
    time_step: float,
    stable_time_step: float,
    *,
    conditions: Drive | None = None,
    damping_rates: NDArray[np.float64] | None = None,
    ghosts: Ghosts | None = None,
) -> PreparedRun:
    """The system of a model with this operator, and its state.

    `time_step`, s, is the run's; `stable_time_step` is surely stable; `conditions`, and `damping_rates` (n,), 1/s, are
    given if not those of the model; `ghosts` are a window's nodes of other ranks.
    """
    kind = np.dtype(options.precision).type
    rho = model.rho.astype(kind)
    width = sum(unknown.width for unknown in operator.unknowns)
    conditions = widened(conditions or drive(model, bond_counts.area, scheme.exact_load, kind), width)
    if not conditions.varies:
        conditions = conditions._replace(before=conditions.force)
    velocity, nodes = initial_velocity(model, width), len(model.grid)
    u, v = np.zeros((2, nodes, width), dtype=kind)
    state = State(u, v, initial_acceleration(conditions, rho), *np.zeros((3, nodes)))
    state = operator.to_own_layout(state)
    if model.settings.run.damping_time:
        operator = add_stiffness_damping(model, operator, state)
    damped = damping(model) if damping_rates is None else damping_rates
    set_initial_velocity_and_acceleration(state, velocity, damped, conditions)
    stepper = operator.march(Motion(state, conditions, rho, time_step, damped, ghosts))
    stepper = stepper or Verlet(operator, conditions, rho, time_step, damped, ghosts)
    energy = float(np.sum(model.rho / 2 * bond_counts.area * (velocity**2).sum(axis=1))) if velocity.any() else 0.0
    refuse_fields(model, operator, state)
    system = System(
        model, options, scheme, operator, stepper, conditions, *bond_counts, time_step, stable_time_step, energy
    )
    stepper.advance(state, 1, 1)  # no step: compiles before the clock runs
    return PreparedRun(system, state)


def choose_time_step(model: Model, stable_time_step: float) -> float:
    """The time step of a run, s; warns of one above the `stable_time_step`. Raises ModelError."""
    step, damped = float(model.settings.run.time_step or stable_time_step), model.settings.run.damping
    if not np.isfinite(step):
        raise ModelError(f"{model.name}: $.run.time_step is missing, which a model without bonds needs; give one")
    if damped * step > STILL:
        raise ModelError(
            f"{model.name}: $.run.damping is {damped:g} 1/s, which stops all motion within a step of {step:.3g} s;"
            f" use at most {STILL / step:.3g}"
        )
    if step > stable_time_step:
        warnings.warn(
            f"{model.name}: the time step {step:.4g} s is above the stable time step, {stable_time_step:.4g} s;"
            " use a smaller run.time_step",
            ModelWarning,
            stacklevel=3,
        )
    return step


def make_diffusion_stepper(model: Model, transport: Transport, state: State, team: Team | None) -> Stepper:
    """What takes the steps of a transport through a model, on the ranks of a team if there is one."""
    device = model.settings.run.device
    if device != "cpu":
        operator, volume = transport.operator, transport.operator.volume
        if operator.exchange.name != FluxesInTiles.name:
            raise ModelError(f"{model.name}: $.run.device: nodes are on no lattice; use cpu, or nodes on one")
        tiles = cast("FluxesInTiles", operator.exchange)
        bonds = FluxesOnDevice(tiles, operator.change, operator.outside, operator.medium.C_sat, Session(device))
        return bonds.march(Motion(state, transport.drive, volume, transport.time_step, np.zeros(len(volume))))
    if team is None:
        return transport.stepper
    return EulerOnRanks(model, team, transport.operator, transport.drive, transport.time_step)


def set_initial_velocity_and_acceleration(
    state: State, velocity: NDArray[np.float64], damping_rate: NDArray[np.float64], conditions: Drive
) -> None:
    """Set velocities (n, w), m/s, and the accelerations from damping (n,), 1/s, except of prescribed components."""
    if velocity.any():
        state.rate[:] = velocity
    if damping_rate.any():
        slowed = damping_rate[:, None] * velocity
        slowed[conditions.holds.node, conditions.holds.axis] = 0.0
        state.second[:] -= slowed


def make_crack_particle_growth(
    model: Model, operator: Operator, bond_source: BondSource, conditions: Drive, time_step: float | None
) -> Growth | None:
    """The growth of cracks of particles, if there are any, in steps of `time_step` s; None: at rest. Raises
    ModelError."""
    if model.settings.run.cracks == "bonds":
        return None
    from pdsolve.crack_growth.growth import Growth, every_of  # shapely takes long to import, and few runs need it

    return Growth(model, operator, bond_source, conditions, None if time_step is None else every_of(model, time_step))


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
    operator, contact = add_quasi_static_contact(model, area, _add_ground_supports(model, area, bonds))
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
    pair = law_of(model).pair
    if pair is not None and pair.is_curved:
        raise ModelError(
            f"{model.name}: $.material.law is '{model.materials[0].law}', whose force is curved below its peak and then"
            " softens; use a straight line up to the peak in load steps"
        )
    filling = scheme.fill(model)
    bonded, filled = make_operator(model, options._replace(kernel="listed"), scheme, filling)
    area = filling.area
    operator, contact = add_quasi_static_contact(model, area, _add_ground_supports(model, area, bonded))
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
