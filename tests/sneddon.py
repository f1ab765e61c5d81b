"""Exact displacements around a penny-shaped crack under tension (I. N. Sneddon, Proc. R. Soc. Lond. A 187 (1946)
229-260)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def displacements(x: NDArray[np.float64], a: float, E: float, nu: float) -> NDArray[np.float64]:
    """Displacements (n, 3) at places (n, 3), off the axis, of a crack of radius `a` in z = 0 under unit tension.

    Above the crack 2 G u_r = (1 - 2 nu) F_r + z F_rz and 2 G u_z = -2 (1 - nu) F_z + z F_zz, with the harmonic F of a
    line of sources on the axis, up to the imaginary place i a.
    """
    r, z = np.hypot(x[:, 0], x[:, 1]), np.abs(x[:, 2])
    w = z + 1j * a
    root = np.sqrt(r**2 + w**2)
    log = np.log(w + root)
    F_r = ((w * root - r**2 * log) / 2 - z * root).imag / r
    F_z, F_zz = -(root - z * log).imag, -(w / root - log - z / root).imag
    F_rz = -(r / root - z * r / (root * (w + root))).imag
    share = 2 * (1 + nu) / (np.pi * E)
    outward = share * ((1 - 2 * nu) * F_r + z * F_rz)
    upward = share * (-2 * (1 - nu) * F_z + z * F_zz) * np.sign(x[:, 2])
    opened = np.column_stack([outward * x[:, 0] / r, outward * x[:, 1] / r, upward])
    return np.asarray(opened + x * np.array([-nu, -nu, 1.0]) / E)
