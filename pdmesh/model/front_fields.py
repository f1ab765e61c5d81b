"""Plane-strain fields of modes 1, 2 and 3 around a crack front, laid along the circle that the front follows.

x = z1 + i z2 is the place in the plane across the front: z1 in the direction of growth, z2 along the normal of the
crack, which is the negative real axis. Components are along growth, normal and tangent (1, 2, 3). With phi' = Phi and
psi' = Psi of N. I. Muskhelishvili (see `tip_fields`), the displacement of modes 1 and 2 is

    2 G (u1 + i u2) = kappa phi - z conj(Phi) - conj(psi),    kappa = 3 - 4 nu

and that of mode 3 is G u3 = 2 K3 Im sqrt(z / 2 pi).

Symbols: G shear modulus, Pa; K1, K2, K3 stress intensities, Pa m^0.5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.tip_fields import Complex, Elastic, intensities


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
