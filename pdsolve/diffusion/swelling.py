"""Bodies that heat, or a solvent, swells: a content and a motion of the same nodes, one step of each after the other.

The content h diffuses by itself (Fick's law: T with the thermal diffusivity, K). A free node is strained by alpha (h -
T0), a bond by the mean of its ends, and stretches from there, whatever its law. What deformation makes of the content
is left out. Both unknowns take the same steps: first the content, then the motion under its strains. What a change of
strain adds to the energy of bonds is booked as work: the mean of that at the displacements before and after a step, as
the forces of velocity Verlet are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.state import State
from pdsolve.steppers.protocol import Stepper


class Swelling:
    """Steps of a content and of the motion that it swells; n nodes."""

    def __init__(self, content: tuple[Stepper, State], motion: Stepper, bonds: BondList, model: Model) -> None:
        """`content` is its stepper and its state; `model` has the materials, each with alpha and T0."""
        (self._content, self._h), self._motion, self._bonds = content, motion, bonds
        self._alpha, self._T0 = coefficients(model)
        self.swell()

    def swell(self) -> NDArray[np.float64]:
        """Strain the bonds by the contents of now; those strains (n,)."""
        strain = np.asarray(self._alpha * (self._h.value[:, 0] - self._T0))
        self._bonds.swell(strain)
        return strain

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1 of both, in place; `state` is that of the motion."""
        before, held = self.swell(), self._held(state)
        for step in range(first, last):
            self._content.march(self._h, step, step + 1)
            strain = self.swell()
            state.work[:] += (self._held(state) - held) / 2
            self._motion.march(state, step, step + 1)
            self._bonds.swell(before)
            unstrained = self._held(state)
            self._bonds.swell(strain)
            before, held = strain, self._held(state)
            state.work[:] += (held - unstrained) / 2

    def _held(self, state: State) -> NDArray[np.float64]:
        """The energy densities (n,) of bonds, J/m^3."""
        return self._bonds.energies(state)[0]


def coefficients(model: Model) -> NDArray[np.float64]:
    """Strain for each unit of content, and the content without strain, of each node, (2, n)."""
    each = np.array([(material.alpha or 0.0, material.T0 or 0.0) for material in model.materials])
    return np.asarray(each[model.material_of].T)
