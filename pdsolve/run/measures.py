"""Quantities derived from a system and its state at any step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Pin, RigidBody, Selection, Spring
from pdmesh.model.neighbours import lengths
from pdmesh.model.output_fields import USUAL, usual
from pdsolve.conditions import driving_conditions, factor_now, parts_of_loads
from pdsolve.measures.balance import relative_balance_error
from pdsolve.numerics.ordered_sums import Branches, branches, total
from pdsolve.operators.ground_supports import supports_of
from pdsolve.run.system import System
from pdsolve.state import Broken, State


class NodeEnergiesAndBreaks(NamedTuple):
    """Energies and fields of an operator at one state, computed once for all users."""

    strain_energy_density: NDArray[np.float64]  # (n,) energy in intact bonds, J/m^3
    softening_energy_density: NDArray[np.float64]  # (n,) on softening so far, J/m^3
    broken_bonds: Broken  # all so far


class EnergyBalanceRow(NamedTuple):
    """Energy balance of one step: energy present, dissipated and supplied. Energies in J/m, momentum in N s/m."""

    step: int
    time: float  # s
    kinetic: float
    strain: float
    dissipated: float  # spent on softening and breaking bonds
    work: float  # done by loads and by holding components of the motion
    momentum_x: float
    momentum_y: float
    broken: int  # directed bonds broken so far
    refinement: float = 0.0  # energy that making cells fine has made so far
    fine_share: float = 1.0  # of the plate
    clipped_stretch: float = 0.0  # the largest of clipped bonds so far, over that which softens or breaks one
    momentum_z: float = 0.0
    damped: float = 0.0  # taken by damping, by layers that absorb and by numerical ones
    friction: float = 0.0  # turned into heat where bodies and crack faces rub

    def balance_error(self, initial_energy: float, supplied: float = 0.0) -> float:
        """Energy created since a start with `initial_energy` (J/m), over the energy supplied; 0 if energy is conserved.

        The energy supplied is the largest of the work done, `supplied` so far, and the initial energy.
        """
        total_energy = self.kinetic + self.strain + self.dissipated + self.damped + self.friction
        scale = self.energy_scale(initial_energy, supplied)
        return relative_balance_error(total_energy, self.work, self.refinement, initial_energy, scale)

    def energy_scale(self, initial_energy: float, supplied: float = 0.0) -> float:
        """The reference for relative energies, J/m: the largest of work done, `supplied` and `initial_energy`."""
        return max(abs(self.work), supplied, initial_energy)


class BalancePart(NamedTuple):
    """What the nodes of one rank have in the energy balance."""

    row: EnergyBalanceRow  # without what is summed over nodes
    sums: dict[str, Branches]  # over own nodes, by the name of the entry


def compute_balance_part(
    system: System,
    state: State,
    step: int,
    energies_and_breaks: NodeEnergiesAndBreaks,
    own_rows: slice,
    first: int,
    node_count: int,
) -> BalancePart:
    """The part of the nodes `own_rows` of a system, the first of which is the row `first` of all `node_count`.

    The broken bonds of `energies_and_breaks` are those of own nodes.
    """
    strain, softened, broken = energies_and_breaks
    summary = system.regridder.zone_summary(system)
    zone = {} if summary is None else summary._asdict()
    if system.moving_zone_operator is not None:
        totals = system.moving_zone_operator.energy_balance_totals()._asdict()
        return BalancePart(EnergyBalanceRow(step, step * system.time_step, **totals, **zone), {})
    summed = dict.fromkeys(("kinetic", "strain", "dissipated", "work", "momentum_x", "momentum_y"), 0.0)
    count = system.broken_bonds_of_removed_nodes + len(broken.step)
    heat = 0.0 if system.contact is None else system.contact.friction(state)
    row = EnergyBalanceRow(step, step * system.time_step, broken=count, friction=heat, **summed, **zone)
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        values = node_energy_functions(system, state, strain, softened)
        return BalancePart(row, {name: branches(of()[own_rows], first, node_count) for name, of in values.items()})


def join_balance(parts: Sequence[BalancePart], node_count: int) -> EnergyBalanceRow:
    """The ledger entry of the parts of all ranks, which have so many nodes, to the bits of one process."""
    with np.errstate(over="ignore", invalid="ignore"):
        sums = {name: total([part.sums[name] for part in parts], node_count) for name in parts[0].sums}
    row = parts[0].row._replace(broken=sum(part.row.broken for part in parts))
    return EnergyBalanceRow(**{**row._asdict(), **sums})


def node_energy_functions(
    system: System,
    state: State,
    strain_energy_density: NDArray[np.float64],
    softening_energy_density: NDArray[np.float64],
) -> dict[str, Callable[[], NDArray[np.float64]]]:
    """What makes the values (n,) of nodes that add up to an entry of the ledger, by its name; densities are J/m^3."""
    area, rho, velocity = system.area, system.model.rho, state.rate.astype(np.float64, copy=False)

    def compute_node_momentum(axis: int) -> NDArray[np.float64]:
        return np.asarray(rho * area * velocity[:, axis])

    axes = range(system.model.grid.dimension)
    return {
        "kinetic": lambda: rho / 2 * area * (velocity**2).sum(axis=1),
        "strain": lambda: area * strain_energy_density,
        "dissipated": lambda: area * (state.dissipated + softening_energy_density),
        "work": lambda: area * state.work,
        "damped": lambda: area * state.damped,
        **{f"momentum_{'xyz'[axis]}": partial(compute_node_momentum, axis) for axis in axes},
    }


def compute_node_damage(system: System, broken: Broken | None = None) -> NDArray[np.float64]:
    """Damage (n,): 1 - intact / initial bonds, with bonds cut by a pre-crack counted as broken; 0 without bonds.

    `broken` are all broken bonds, if known.
    """
    family = system.family_sizes
    broken = system.operator.broken() if broken is None else broken
    intact = system.initial_bond_counts - np.bincount(broken.source, minlength=len(family))
    return np.where(family > 0, 1 - intact / np.maximum(family, 1), 0.0)


def compute_output_fields(
    system: System, state: State, field_names: Iterable[str], energies_and_breaks: NodeEnergiesAndBreaks | None = None
) -> dict[str, NDArray[np.floating]]:
    """Fields (n,) of these names at a state; `energies_and_breaks` is that of this state, if known."""
    columns: dict[str, NDArray[np.floating]] = {}
    chosen, usual_ones = tuple(field_names), () if system.transport else usual(system.model.grid.dimension)
    operator_fields: dict[str, NDArray[np.float64]] = {}
    if chosen == USUAL or not set(chosen) <= set(usual_ones):
        operator_fields |= system.operator.fields(state)
        rows = system.stepper.content_rows
        for prepared in system.coupled_runs:
            operator_fields |= {
                name: values[rows] for name, values in prepared.system.operator.fields(prepared.state).items()
            }
    if chosen == USUAL:
        chosen = (*usual_ones, *operator_fields)
    for name in chosen:
        if name == "damage":
            columns[name] = compute_node_damage(system, energies_and_breaks and energies_and_breaks.broken_bonds)
        elif name == "energy":
            columns[name] = (
                energies_and_breaks.strain_energy_density if energies_and_breaks else system.operator.energies(state)[0]
            )
        elif name in operator_fields:
            columns[name] = operator_fields[name]
        else:
            values = {"u": state.value, "v": state.rate, "a": state.second}[name[0]]
            columns[name] = values[:, "xyz".index(name[1])]
    return columns


RIGID = str(RigidBody.__struct_config__.tag)
GROUND = tuple(str(kind.__struct_config__.tag) for kind in (Spring, Pin))


class ForceConditionWithNodes(NamedTuple):
    """A condition that acts throughout a run, and its nodes."""

    condition_number: int  # in the model's list of conditions
    condition_kind: str
    node_rows: NDArray[np.int64]  # of the grid


class ConditionForceRow(NamedTuple):
    """Force and displacement of a condition at a step, per unit thickness."""

    step: int
    time: float  # s
    condition: int  # in the model's list of conditions
    kind: str
    force_x: float  # N/m, on the plate
    force_y: float
    displacement_x: float  # m, mean of its nodes
    displacement_y: float
    force_z: float = 0.0  # N, of a body, of which those along x and y are in N too
    displacement_z: float = 0.0


class ConditionForceSums(NamedTuple):
    """Sums over the nodes of each of c conditions, those of one rank after those of the ranks before it."""

    holding_force: NDArray[np.float64]  # (c, d) of what holds components, N/m, in space N
    load_force: NDArray[np.float64]  # (c, d) of loads at factor 1, N/m, in space N
    displacement: NDArray[np.float64]  # (c, d) m
    node_count: NDArray[np.int64]  # (c,)


def list_force_conditions_with_nodes(
    system: System, local_rows: slice = slice(None)
) -> tuple[ForceConditionWithNodes, ...]:
    """All conditions with forces, in the model's order, which is that of the profiles of `Drive`; of many ranks, with
    their nodes among `local_rows`."""
    first, end, _ = local_rows.indices(len(system.model.grid))
    return tuple(
        ForceConditionWithNodes(number, str(condition.__struct_config__.tag), rows[(rows >= first) & (rows < end)])
        for number, condition in driving_conditions(system.requested_model)
        for rows in (_find_nodes_of_condition(system, condition),)
    )


def _find_nodes_of_condition(system: System, condition: Selection) -> NDArray[np.int64]:
    """Current nodes of a condition; where nodes come and go, the nearest one if it acts between nodes."""
    rows, full_model = system.model.selected(condition), system.full_model
    if len(rows) or full_model is None:
        return rows
    place = full_model.grid.part(full_model.selected(condition)).position.mean(axis=0)
    return np.array([lengths(system.model.grid.position - place).argmin()])


def add_condition_forces(
    conditions: tuple[ForceConditionWithNodes, ...],
    system: System,
    state: State,
    step: int,
    before: ConditionForceSums | None,
) -> ConditionForceSums:
    """The sums over the nodes of conditions after `step`, added node by node to those of the ranks `before`, None for
    the first."""
    count, d = len(conditions), system.model.grid.dimension
    holding, loading = (np.zeros((count, d)), np.zeros((count, d))) if before is None else before[:2]
    if system.moving_zone_operator is not None:
        holding += system.moving_zone_operator.constraint_force_by_profile(count)
        loading += system.moving_zone_operator.load_force_by_profile(count)
    else:
        drive, area, rho = system.drive, system.area, system.model.rho
        holds, loads = drive.holds, drive.loads
        acceleration = state.second[holds.node, holds.axis].astype(float)
        pull = area[holds.node] * (rho[holds.node] * acceleration - drive.held_force)
        load_parts = parts_of_loads(drive, system.profile_time_or_load_factor(step))
        np.add.at(holding, (holds.condition, holds.axis), pull)
        np.add.at(loading, (loads.condition, loads.axis), area[loads.node] * load_parts)
    displacement, nodes = np.zeros((count, d)), np.zeros(count, dtype=np.int64)
    for number, grip in enumerate(conditions):
        moved = state.value[grip.node_rows, :d].astype(float)
        if before is not None:
            moved = np.concatenate([before.displacement[number : number + 1], moved])
            nodes[number] = before.node_count[number]
        displacement[number] = np.add.reduce(moved, axis=0)
        nodes[number] += len(grip.node_rows)
    return ConditionForceSums(holding, loading, displacement, nodes)


def list_condition_force_rows(
    conditions: tuple[ForceConditionWithNodes, ...],
    system: System,
    state: State,
    sums: ConditionForceSums,
    step: int,
    time: float,
) -> list[ConditionForceRow]:
    """External forces of conditions after `step` from the sums over all their nodes.

    A hold balances bonds and loads on its components and provides their acceleration. The acceleration of a prescribed
    displacement or velocity is taken as 0: only the inertia of the held nodes is neglected while their speed changes.
    The force of a rigid body is that on what it touches.
    """
    reaction_rows, at = [], system.profile_time_or_load_factor(step)
    supports = supports_of(system.operator) if any(grip.condition_kind in GROUND for grip in conditions) else None
    for profile, grip in enumerate(conditions):
        factor = float(factor_now(system.drive.profiles, profile, at))
        force = (sums.holding_force[profile] + factor * sums.load_force[profile]).tolist()
        if grip.condition_kind == RIGID and system.contact is not None:
            force = (-system.contact.rigid.force_of(grip.node_rows, len(force))).tolist()
        if grip.condition_kind in GROUND and supports is not None:
            force = supports.forces_of(grip.node_rows, system.area, state).tolist()
        mean = (sums.displacement[profile] / sums.node_count[profile]).tolist()
        plane = *force[:2], *mean[:2]
        reaction_rows.append(
            ConditionForceRow(step, time, grip.condition_number, grip.condition_kind, *plane, *force[2:], *mean[2:])
        )
    return reaction_rows


def verlet_conserved_energy(system: System, state: State, strain_energy_density: NDArray[np.float64]) -> float:
    """Energy, J/m, of nodes with energy densities `strain_energy_density` (n,), J/m^3: the sum that Verlet conserves.

    It is m (dt a)^2 / 8 below that of whole steps, which the ledger uses.
    """
    mass = system.model.rho * system.area
    swing = (system.time_step / 2) ** 2 * kinetic_energy(mass, state.second)
    return kinetic_energy(mass, state.rate) - swing + float(np.sum(system.area * strain_energy_density))


def half_kick_work_of_acceleration_error(
    system: System,
    state: State,
    force_density: NDArray[np.float64],
    damping_rates: NDArray[np.float64],
) -> float:
    """Work, J/m, in the next half kick of interpolated accelerations that differ from those of the forces.

    Verlet follows them for half of a kick. `force_density` (n, w), N/m^3, are the force densities of neighbours, and
    `damping_rates` (n,), 1/s, those of nodes.
    """
    rho, drive, dt = system.model.rho[:, None], system.drive, system.time_step
    excess = rho * (state.second + damping_rates[:, None] * state.rate) - force_density - drive.force
    excess[drive.holds.node, drive.holds.axis] = 0.0
    way = dt * (state.rate + dt / 2 * state.second)
    return float(np.sum(system.area[:, None] * excess / 2 * way))


def kinetic_energy(mass: NDArray[np.float64], rate: NDArray[np.float64]) -> float:
    """Kinetic energy, J/m, of nodes with masses (n,), kg/m, and velocities (n, 2)."""
    return float((mass / 2 * (rate**2).sum(axis=1)).sum())
