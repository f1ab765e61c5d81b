"""The ledger: what the motion holds, what it has lost and what it was given; per unit thickness."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.kernels.bond_sums import Motion, strain_energy_density


class Ledger(NamedTuple):
    """The books of one step. Energies in J/m, momentum in N s/m."""

    step: int
    time: float  # s
    kinetic: float
    strain: float
    dissipated: float  # spent on breaking bonds
    work: float  # done by the body forces
    momentum_x: float
    momentum_y: float
    broken: int  # directed bonds broken so far

    @property
    def balance(self) -> float:
        """(kinetic + strain + dissipated - work) / work: 0 where energy is conserved."""
        missing = self.kinetic + self.strain + self.dissipated - self.work
        return missing / abs(self.work) if self.work else 0.0


def ledger(bonds: Bonds, motion: Motion, area: NDArray[np.float64], rho: float, step: int, time: float) -> Ledger:
    """Draw up the books; `area` (n,), m^2, and `rho`, kg/m^3. Sums run in double precision in the nodes' order."""
    density = np.empty(len(area))
    strain_energy_density(bonds, motion, density)
    velocity = motion.v.astype(np.float64)
    return Ledger(
        step,
        time,
        kinetic=float(np.sum(rho / 2 * area * (velocity**2).sum(axis=1))),
        strain=float(np.sum(area * density)),
        dissipated=float(np.sum(area * motion.dissipated)),
        work=float(np.sum(area * motion.work)),
        momentum_x=float(np.sum(rho * area * velocity[:, 0])),
        momentum_y=float(np.sum(rho * area * velocity[:, 1])),
        broken=int(np.count_nonzero(motion.broken)),
    )
