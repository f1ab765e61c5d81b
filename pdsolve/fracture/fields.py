"""Exact fields around the tip of a straight crack with free faces, from two complex functions.

z = x + i y begins at the tip; the crack is the negative real axis. With Phi and Psi of N. I. Muskhelishvili (Some Basic
Problems of the Mathematical Theory of Elasticity, 1953, section 32),

    sxx + syy            = 4 Re Phi
    syy - sxx + 2 i sxy  = 2 (conj(z) Phi' + Psi)
    2 G d(u + i v)/dx    = kappa Phi - conj(Phi) - z conj(Phi') - conj(Psi)

Symbols: G shear modulus, Pa; kappa (3 - nu) / (1 + nu) in plane stress and 3 - 4 nu in plane strain; K1, K2 stress
intensities, Pa m^0.5; T the T-stress along the crack, Pa.

Plane-strain fields of modes 1, 2 and 3 around a crack front, laid along the circle that the front follows.

x = z1 + i z2 is the place in the plane across the front: z1 in the direction of growth, z2 along the normal of the
crack, which is the negative real axis. Components are along growth, normal and tangent (1, 2, 3). With phi' = Phi and
psi' = Psi of N. I. Muskhelishvili as above, the displacement of modes 1 and 2 is

    2 G (u1 + i u2) = kappa phi - z conj(Phi) - conj(psi),    kappa = 3 - 4 nu

and that of mode 3 is G u3 = 2 K3 Im sqrt(z / 2 pi).

Symbols: G shear modulus, Pa; K1, K2, K3 stress intensities, Pa m^0.5.
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


class FrontField(NamedTuple):
    """Displacement, its derivative along growth, and stress at n places."""

    u: NDArray[np.float64]  # (n, 3) m
    slope: NDArray[np.float64]  # (n, 3) du / dx1
    stress: NDArray[np.float64]  # (n, 3, 3) Pa


def front_field(z: Complex, solid: Elastic, K1: float, K2: float, K3: float) -> FrontField:
    """The singular field at z (n,) of three stress intensities; `solid` is in plane strain."""
    plane = intensities(z, solid, K1, K2)
    root = np.sqrt(z / (2 * np.pi))
    phi, prime = (K1 - 1j * K2) * root, (K1 - 1j * K2) / (2 * np.sqrt(2 * np.pi * z))
    psi = (K1 + 1j * K2) * root - phi / 2
    across = (solid.kappa * phi - z * prime.conj() - psi.conj()) / (2 * solid.shear)
    away = K3 / np.sqrt(2 * np.pi * z)
    xx, yy, xy = plane.stress.T
    stress = np.zeros((len(z), 3, 3))
    stress[:, 0, 0], stress[:, 1, 1], stress[:, 2, 2] = xx, yy, solid.nu * (xx + yy)
    for a, b, values in ((0, 1, xy), (0, 2, away.imag), (1, 2, away.real)):
        stress[:, a, b] = stress[:, b, a] = values
    u = np.column_stack([across.real, across.imag, 2 * K3 * root.imag / solid.shear])
    return FrontField(u, np.column_stack([plane.slope, away.imag / solid.shear]), stress)
