"""Exact fields around the tip of a straight crack with free faces, from two complex functions.

z = x + i y begins at the tip; the crack is the negative real axis. With Phi and Psi of N. I. Muskhelishvili (Some Basic
Problems of the Mathematical Theory of Elasticity, 1953, section 32),

    sxx + syy            = 4 Re Phi
    syy - sxx + 2 i sxy  = 2 (conj(z) Phi' + Psi)
    2 G d(u + i v)/dx    = kappa Phi - conj(Phi) - z conj(Phi') - conj(Psi)

Symbols: G shear modulus, Pa; kappa (3 - nu) / (1 + nu) in plane stress and 3 - 4 nu in plane strain; K1, K2 stress
intensities, Pa m^0.5; T the T-stress along the crack, Pa.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Complex: TypeAlias = NDArray[np.complexfloating[Any, Any]]


class Elastic(NamedTuple):
    """An isotropic plate."""

    E: float  # Pa
    nu: float
    plane: str  # "stress" or "strain"

    @property
    def effective_modulus(self) -> float:
        """E' = E in plane stress, E / (1 - nu^2) in plane strain, Pa: J E' = K^2."""
        return self.E if self.plane == "stress" else self.E / (1 - self.nu**2)

    @property
    def shear(self) -> float:
        """The shear modulus G, Pa."""
        return self.E / (2 * (1 + self.nu))

    @property
    def kappa(self) -> float:
        """Kolosov's constant: (3 - nu) / (1 + nu) in plane stress, 3 - 4 nu in plane strain."""
        return (3 - self.nu) / (1 + self.nu) if self.plane == "stress" else 3 - 4 * self.nu


class TipField(NamedTuple):
    """Stress and displacement gradient at n places, along and across the crack."""

    stress: NDArray[np.float64]  # (n, 3) Pa: xx, yy, xy
    slope: NDArray[np.float64]  # (n, 2) du/dx and dv/dx


def intensities(z: Complex, plate: Elastic, K1: float, K2: float) -> TipField:
    """The singular field of stress intensities (M. L. Williams, J. Appl. Mech. 24 (1957) 109-114)."""
    root = 1 / (2 * np.sqrt(2 * np.pi * z))
    phi = (K1 - 1j * K2) * root
    return _field(z, plate, phi, -phi / (2 * z), (K1 + 1j * K2) * root - phi / 2)


def pushed(z: Complex, plate: Elastic, force: float) -> TipField:
    """The field of a force (N/m) at the tip along the crack: srr = -force cos(angle) / (pi r), other stresses 0.

    A. P. Kfouri, Int. J. Fract. 30 (1986) 301-315.
    """
    phi = -force / (4 * np.pi * z)
    return _field(z, plate, phi, -phi / z, -phi)


def _field(
    z: Complex,
    plate: Elastic,
    phi: Complex,
    derived: Complex,
    psi: Complex,
) -> TipField:
    """The field at z (n,) of Phi, its derivative and Psi."""
    total, rest = 4 * phi.real, 2 * (z.conj() * derived + psi)
    slope = (plate.kappa * phi - phi.conj() - z * derived.conj() - psi.conj()) / (2 * plate.shear)
    stress = np.column_stack([(total - rest.real) / 2, (total + rest.real) / 2, rest.imag / 2])
    return TipField(stress, np.column_stack([slope.real, slope.imag]))
