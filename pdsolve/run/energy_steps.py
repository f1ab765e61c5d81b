"""Energy that a change of nodes makes: what Verlet conserves, before and after it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.run.system import System
from pdsolve.state import State


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
