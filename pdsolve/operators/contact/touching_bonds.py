"""Softening bonds at rest of bodies that touch: their forces and tangent with those of contact.

Contact has constant normals and weights here, as in `pdsolve.operators.contact.at_rest`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Assembly
from pdsolve.laws.law import Law
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.softening_bonds import Response, SofteningBonds

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]


class TouchingBonds(SofteningBonds):
    """The bonds of n nodes, and the pairs of them that touch; see `SofteningBonds`."""

    def __init__(self, law: Law, assembly: Assembly, contact: RestingContact) -> None:
        """Bonds of a pair law that conserve momentum."""
        super().__init__(law, assembly)
        self._contact, self.symmetric = contact, contact.symmetric

    def forces(self, response: Response) -> Array:
        """Forces (n, d) of bonds, of supports and of contact on nodes, N/m."""
        return super().forces(response) + self._contact.forces(response.value)

    def tangent(self, response: Response, secant: bool = False) -> csr_array:
        """Minus the derivative (n d, n d) of the forces by the displacements, N/m^2."""
        both: csr_array = (super().tangent(response, secant) + self._contact.stiffness_matrix(response.value)).tocsr()
        return both
