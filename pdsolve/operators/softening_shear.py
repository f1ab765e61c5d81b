r"""Softening bonds with shear and rotations at rest: forces, consistent tangent and dissipation; see
`pdsolve.laws.cohesive_micropolar`.

A pair of nodes has one bond here. Symbols, of a bond of length xi:

    p = (s, gamma)   strains                  w = (s+, r gamma) / drive   derivative of the drive by p
    D = diag(1, r)   stiffness over C         B                           derivative of p by what both ends have

The force is C omega D p, whose derivative is C (omega D + (sigma' - omega) w w^T) where kappa grows: symmetric. Under
compression s+ is 0 and the first entry of D has no omega.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Assembly
from pdsolve.laws import law_named, law_of
from pdsolve.laws.cohesive_micropolar import shear_of
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.contact.touching_bonds import TouchingBonds
from pdsolve.operators.softening_bonds import Response, SofteningBonds

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]


class SofteningShear(SofteningBonds):
    """The bonds of n nodes with values (n, 3), each pair once, in the order of their nodes."""

    def __init__(self, law: Law, assembly: Assembly, model: Model) -> None:
        """Bonds that conserve momentum: area times stiffness is the same from both ends."""
        super().__init__(law, assembly)
        stiffness, ratio = shear_of(model, assembly.bonds)
        once = assembly.bonds.source < assembly.bonds.neighbour
        self.stiffness, self.ratio = stiffness[once] * assembly.area[self.source], ratio[once]
        self._root = np.sqrt(self.ratio)
        turn = 1 / np.broadcast_to(model.horizons, self._nodes)
        x, y = (self.xi / self.length[:, None]).T
        strain_matrices = np.zeros((2, len(x), 2, 3))  # B of the source and of the target
        for end, way, rows in ((0, -1, self.source), (1, 1, self.target)):
            strain_matrices[end, :, 0, 0], strain_matrices[end, :, 0, 1] = way * x / self.length, way * y / self.length
            strain_matrices[end, :, 1, 0], strain_matrices[end, :, 1, 1] = -way * y / self.length, way * x / self.length
            strain_matrices[end, :, 1, 2] = -turn[rows] / 2
        self._B = strain_matrices

    def _strains(self, value: Array) -> Array:
        """s and gamma (b, 2)."""
        source, target = value[self.source], value[self.target]
        return np.asarray(np.einsum("bpa,ba->bp", self._B[0], source) + np.einsum("bpa,ba->bp", self._B[1], target))

    def stretches(self, value: Array) -> Array:
        """Drives (b,) at these values (n, 3)."""
        s, gamma = self._strains(value).T
        return np.asarray(np.hypot(np.maximum(s, 0.0), self._root * gamma))

    def respond(self, value: Array) -> Response:
        """The response at values (n, 3) after the history `kappa`."""
        s, gamma = self._strains(value).T
        pulled = np.maximum(s, 0.0)
        drive = np.hypot(pulled, self._root * gamma)
        softened, c = self._soften(drive), self.stiffness
        toward = np.column_stack([pulled, self.ratio * gamma]) / np.where(drive > 0, drive, 1.0)[:, None]
        normal = c * np.where((s > 0) | (softened.kappa >= self.limit), softened.omega, 1.0)
        force = np.column_stack([normal * s, c * softened.omega * self.ratio * gamma])
        dissipated_energy, releases = (
            float(self.dissipated_energy(softened.kappa).sum()),
            c * self.length * softened.releases / 2,
        )
        secant, slope = c * softened.omega, c * softened.slope
        drives = softened.kappa, force, slope, secant, releases, dissipated_energy
        return Response(normal[:, None], self.length, *drives, toward, value.copy())

    def forces(self, response: Response) -> Array:
        """Forces (n, 3) of bonds and of supports on nodes, N/m."""
        return self._with_ground(response.value, self._pushed(-self.length[:, None] * response.force))

    def gradient(self, response: Response) -> Array:
        """Derivative (n, 3) of the spent energy by the values, N/m."""
        return self._pushed(response.releases[:, None] * response.toward)

    def _pushed(self, by_strain: Array) -> Array:
        """Sums (n, 3) at nodes of B^T times what belongs to strains (b, 2)."""
        out = np.zeros((self._nodes, 3))
        for B, rows in zip(self._B, (self.source, self.target), strict=True):
            parts = np.einsum("bpa,bp->ba", B, by_strain)
            for a in range(3):
                out[:, a] += np.bincount(rows, parts[:, a], self._nodes)
        return out

    def tangent(self, response: Response, secant: bool = False) -> csr_array:
        """Minus the derivative (n 3, n 3) of the forces by the values, N/m^2; `secant`: of straight bonds."""
        M = np.zeros((len(self.length), 2, 2))
        M[:, 0, 0], M[:, 1, 1] = response.along[:, 0], response.secant * self.ratio
        if not secant:
            M += (response.slope - response.secant)[:, None, None] * (
                response.toward[:, :, None] * response.toward[:, None, :]
            )
        M *= self.length[:, None, None]
        ends = (0, 0), (1, 1), (0, 1), (1, 0)
        return self._assembled(tuple(np.swapaxes(self._B[i], 1, 2) @ M @ self._B[j] for i, j in ends))


def softening_of(model: Model, assembly: Assembly, contact: RestingContact | None = None) -> SofteningBonds:
    """The softening bonds of a model, with shear if its law has it, or with what touches."""
    law = law_of(model)
    if law.pair is None:
        return SofteningShear(law, assembly, model)
    return SofteningBonds(law, assembly) if contact is None else TouchingBonds(law, assembly, contact)


def bonds_soften(model: Model) -> bool:
    """Whether the laws of a model's materials have bonds that soften before they break."""
    return any(law_named(material, model.place_of(k)).softens for k, material in enumerate(model.materials))
