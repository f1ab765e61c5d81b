"""The ledger: what the motion holds, what it has lost and what it was given; per unit thickness."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.kernels.bond_sums import Motion, energy_densities


class Ledger(NamedTuple):
    """The books of one step. Energies in J/m, momentum in N s/m."""

    step: int
    time: float  # s
    kinetic: float
    strain: float
    dissipated: float  # spent on softening and breaking bonds
    work: float  # done by loads and by holding components of the motion
    momentum_x: float
    momentum_y: float
    broken: int  # directed bonds broken so far

    def balance(self, initial: float) -> float:
        """Energy that has appeared from nowhere since a start with `initial` energy (J/m), over the larger of the
        work done and the energy at the start; 0 where energy is conserved."""
        missing = self.kinetic + self.strain + self.dissipated - self.work - initial
        scale = max(abs(self.work), initial)
        return missing / scale if scale else 0.0


def ledger(
    energies: tuple[NDArray[np.float64], NDArray[np.float64]],
    motion: Motion,
    area: NDArray[np.float64],
    rho: NDArray[np.float64],
    broken: int,
    step: int,
    time: float,
) -> Ledger:
    """Draw up the books, in double precision and in the nodes' order.

    `energies` are what the bonds hold and have spent on softening (n,), J/m^3; `area` (n,), m^2; `rho` (n,), kg/m^3;
    `broken` bonds so far.
    """
    strain, softened = energies
    velocity = motion.v.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        return Ledger(
            step,
            time,
            kinetic=float(np.sum(rho / 2 * area * (velocity**2).sum(axis=1))),
            strain=float(np.sum(area * strain)),
            dissipated=float(np.sum(area * (motion.dissipated + softened))),
            work=float(np.sum(area * motion.work)),
            momentum_x=float(np.sum(rho * area * velocity[:, 0])),
            momentum_y=float(np.sum(rho * area * velocity[:, 1])),
            broken=broken,
        )


def strain_energies(bonds: Bonds, motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Densities (n,), J/m^3, of the energy that the nodes' bonds hold, and have spent on softening so far."""
    strain, softened = np.empty(len(motion.u)), np.empty(len(motion.u))
    energy_densities(bonds, motion, strain, softened)
    return strain, softened
