"""A crack in an infinite plate under uniform load: the classical solution."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.fracture.domain_integrals import FractureParameters
from pdsolve.fracture.fields import Elastic


class Griffith(NamedTuple):
    """A crack from -1 to 1 (m), turned by `angle` (degrees), under stresses sxx, syy far away, Pa."""

    plate: Elastic
    angle: float
    sxx: float = 0.0
    syy: float = 1.0

    @property
    def way(self) -> NDArray[np.float64]:
        """The unit vector (2,) along the crack."""
        return np.array([np.cos(np.radians(self.angle)), np.sin(np.radians(self.angle))])

    @property
    def far(self) -> NDArray[np.float64]:
        """Stress (2, 2) far away, along and across the crack, Pa."""
        turn = self.turn
        return np.asarray(turn @ np.diag([self.sxx, self.syy]) @ turn.T)

    @property
    def turn(self) -> NDArray[np.float64]:
        x, y = self.way
        return np.array([[x, y], [-y, x]])

    @property
    def tip(self) -> FractureParameters:
        """What its tip feels."""
        K2, K1 = (np.sqrt(np.pi) * self.far[1]).tolist()
        return FractureParameters(
            (K1**2 + K2**2) / self.plate.effective_modulus, K1, K2, float(self.far[0, 0] - self.far[1, 1])
        )

    def displacement(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements (n, 2) at places (n, 2): 2 G (u + i v) = kappa phi - conj(omega) - (z - conj(z)) conj(phi')
        with phi, omega = (syy - i sxy) sqrt(z^2 - 1) / 2 +- (sxx - syy) z / 4 (Muskhelishvili, 1953, section 120)."""
        x, y = self.turn @ position.T
        z = x + 1j * y
        root = np.sqrt(z - 1) * np.sqrt(z + 1)
        push, along = (self.far[1, 1] - 1j * self.far[0, 1]) / 2, (self.far[0, 0] - self.far[1, 1]) / 4
        phi, slope = push * root + along * z, push * z / root + along
        omega = push * root.conj() - along * z.conj()
        w = (self.plate.kappa * phi - omega - (z - z.conj()) * slope.conj()) / (2 * self.plate.shear)
        return np.asarray(np.column_stack([w.real, w.imag]) @ self.turn)
