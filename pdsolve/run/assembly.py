"""Operator, time step and stepper of a model, put together into its system."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondSource, Counted
from pdsolve.bonds.static_breakage import StaticBreakage
from pdsolve.checks import refuse_fields
from pdsolve.conditions import Drive, damping, drive, initial_acceleration, initial_velocity, widened
from pdsolve.device.families import FluxesOnDevice
from pdsolve.device.nodes import NodesOnDevice
from pdsolve.device.runtime import Session
from pdsolve.diffusion.system import Transport
from pdsolve.lattice.flux_operator import FluxesInTiles
from pdsolve.lattice.march import LatticeMarch
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.numerics.team import Team
from pdsolve.operators.ghosts import Ghosts
from pdsolve.operators.protocol import Operator
from pdsolve.options import Options
from pdsolve.ranks.diffusing import EulerOnRanks
from pdsolve.run.operator_factory import (
    add_ground_supports,
    add_penalty_contact,
    compute_stable_time_step,
    make_operator,
    split_into_lattice_bonds_and_contact,
)
from pdsolve.run.system import PreparedRun, System
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import State
from pdsolve.stepper import Stepper
from pdsolve.steppers.steps_on_device import StepsOnDevice
from pdsolve.steppers.verlet import Verlet

if TYPE_CHECKING:
    from pdsolve.crack_growth.growth import Growth


STILL = 2.0  # damping times a step: more would turn velocities round within it


def prepare_explicit_motion(model: Model, options: Options, scheme: Scheme, bonds_swell: bool = False) -> PreparedRun:
    """A model's system and its state at time 0, with the bonds of this scheme; `bonds_swell` as in `make_operator`.
    Raises ModelError."""
    filling = make_bond_source(model, scheme)
    bonds, filled = make_operator(
        model, options, scheme, filling, model.settings.run.cracks == "particles", bonds_swell
    )
    operator, touching = add_penalty_contact(model, filled.area, add_ground_supports(model, filled.area, bonds))
    bound = compute_stable_time_step(model, operator)
    prepared = assemble_system(model, options, scheme, operator, filled, choose_time_step(model, bound), bound)
    if touching is not None:
        touching.rigid.start(prepared.state, prepared.system.drive, prepared.system.time_step)
    growth = make_crack_particle_growth(model, bonds, filling, prepared.system.drive, prepared.system.time_step)
    return prepared._replace(system=replace(prepared.system, crack_growth=growth, contact=touching))


def assemble_system(
    model: Model,
    options: Options,
    scheme: Scheme,
    operator: Operator,
    bond_counts: Counted,
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
    damped = damping(model) if damping_rates is None else damping_rates
    set_initial_velocity_and_acceleration(state, velocity, damped, conditions)
    stepper = make_stepper(operator, state, conditions, rho, time_step, damped, ghosts)
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


def make_stepper(
    operator: Operator,
    state: State,
    drive: Drive,
    rho: NDArray[np.floating],
    time_step: float,
    damping_rates: NDArray[np.float64],
    ghosts: Ghosts | None = None,
) -> Stepper:
    """What takes steps of `time_step`, s, of a placed state; `rho` (n,) are kg/m^3, `damping_rates` (n,) 1/s.

    `ghosts` are a window's nodes of other ranks.
    """
    if isinstance(operator, NodesOnDevice):
        return StepsOnDevice((operator, state, drive), rho, time_step, damping_rates)
    bonds, contact = split_into_lattice_bonds_and_contact(operator)
    if bonds is not None:
        return LatticeMarch(bonds, drive, rho, time_step, damping_rates, contact, ghosts)
    return Verlet(operator, drive, rho, time_step, damping_rates, ghosts)


def make_diffusion_stepper(model: Model, transport: Transport, state: State, team: Team | None) -> Stepper:
    """What takes the steps of a transport through a model, on the ranks of a team if there is one."""
    device = model.settings.run.device
    if device != "cpu":
        operator, volume = transport.operator, transport.operator.volume
        if not isinstance(operator.exchange, FluxesInTiles):
            raise ModelError(f"{model.name}: $.run.device: nodes are on no lattice; use cpu, or nodes on one")
        of = operator.exchange, operator.change, operator.outside, operator.medium.C_sat
        bonds = FluxesOnDevice(*of, Session(device))
        return StepsOnDevice((bonds, state, transport.drive), volume, transport.time_step, np.zeros(len(volume)))
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


def make_bond_source(model: Model, scheme: Scheme) -> BondSource:
    """The bonds of a model; with cracks of particles, none breaks by itself."""
    filling = scheme.fill(model)
    return StaticBreakage(filling).filling() if model.settings.run.cracks == "particles" else filling


def make_crack_particle_growth(
    model: Model, operator: Operator, bond_source: BondSource, conditions: Drive, time_step: float | None
) -> Growth | None:
    """The growth of cracks of particles, if there are any, in steps of `time_step` s; None: at rest. Raises
    ModelError."""
    if model.settings.run.cracks == "bonds":
        return None
    from pdsolve.crack_growth.growth import Growth, every_of  # shapely takes long to import, and few runs need it

    return Growth(model, operator, bond_source, conditions, None if time_step is None else every_of(model, time_step))
