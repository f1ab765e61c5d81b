"""Quantities derived from a system and its state at any step."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.graphs import connected
from pdmesh.model.output_fields import CRACKED, USUAL, usual
from pdsolve.run.system import System
from pdsolve.state import Broken, State

PIECE = 0.02  # of all nodes: smaller parts of a plate do not count as pieces


class NodeEnergiesAndBreaks(NamedTuple):
    """Energies and fields of an operator at one state, computed once for all users."""

    strain_energy_density: NDArray[np.float64]  # (n,) energy in intact bonds, J/m^3
    softening_energy_density: NDArray[np.float64]  # (n,) on softening so far, J/m^3
    broken_bonds: Broken  # all so far


def compute_node_energies_and_breaks(system: System, state: State) -> NodeEnergiesAndBreaks:
    """Energies and fields of the operator at this state."""
    return NodeEnergiesAndBreaks(*system.operator.energies(state), system.operator.broken())


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

    def balance_error(self, initial_energy: float, largest_work: float = 0.0) -> float:
        """Energy created since a start with `initial_energy` (J/m), over the energy supplied; 0 if energy is conserved.

        The energy supplied is the largest of the work done, its maximum `largest_work` so far, and the initial energy.
        """
        total_energy = self.kinetic + self.strain + self.dissipated + self.damped + self.friction
        missing = total_energy - self.work - self.refinement - initial_energy
        scale = self.energy_scale(initial_energy, largest_work)
        return missing / scale if scale else 0.0

    def energy_scale(self, initial_energy: float, largest_work: float = 0.0) -> float:
        """The reference for relative energies, J/m: the largest of work done, `largest_work` and `initial_energy`."""
        return max(abs(self.work), largest_work, initial_energy)


def compute_energy_balance_row(
    system: System, state: State, step: int, energies_and_breaks: NodeEnergiesAndBreaks | None = None
) -> EnergyBalanceRow:
    """The ledger entry after `step`, in double precision and the nodes' order.

    `energies_and_breaks` is that of this state, if known.
    """
    strain, softened, broken = energies_and_breaks or compute_node_energies_and_breaks(system, state)
    if system.moving_zone_operator is not None:
        sums = system.moving_zone_operator.energy_balance_totals()._asdict()
        zone = system.moving_zone_operator.zone_summary()._asdict()
        return EnergyBalanceRow(step, step * system.time_step, **sums, **zone)
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        return EnergyBalanceRow(
            step,
            step * system.time_step,
            broken=system.broken_bonds_of_removed_nodes + len(broken.step),
            friction=compute_friction_heat(system, state),
            **{
                name: float(np.sum(values()))
                for name, values in node_energy_functions(system, state, strain, softened).items()
            },
            **({} if system.zone_summary is None else system.zone_summary._asdict()),
        )


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


def compute_friction_heat(system: System, state: State) -> float:
    """Energy that friction has turned into heat so far, J/m, of a body J."""
    return 0.0 if system.contact is None else system.contact.friction(state)


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


def count_initially_separate_bodies(system: System) -> int:
    """Number of bodies, which no bond joins from the start."""
    named = system.model.grid.bodies
    return 1 if named is None else len(named.names)


def count_fragments(system: System) -> int:
    """Number of pieces of the plate: connected components of intact bonds without cracked nodes."""
    sound = compute_node_damage(system) <= CRACKED
    source, target = system.operator.bonds()
    sound_bonds = sound[source] & sound[target]
    part = connected(len(sound), source[sound_bonds], target[sound_bonds])
    return int((np.bincount(part) > PIECE * len(sound)).sum())
