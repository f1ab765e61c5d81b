"""Compressible neo-Hooke: W = mu / 2 (tr F^T F - 3) - mu ln J + lambda / 2 (ln J)^2.

P = mu (F - F^-T) + lambda ln J F^-T. In plane stress P_zz = 0 is solved for F_zz by Newton's method.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.tensors import det, inverse

ROUNDS = 25
NEAR = 1e-15


@njit(**INNER)
def stretch_zz(F, first, shear):  # type: ignore[no-untyped-def]
    """F_zz of plane stress: mu (c^2 - 1) + lambda ln(c A) = 0, A the determinant in the plane."""
    area = F[0] * F[4] - F[1] * F[3]
    c = area * 0 + 1
    for _ in range(ROUNDS):
        step = (shear * (c * c - 1) + first * np.log(c * area)) / (2 * shear * c + first / c)
        if step.real >= c.real:  # not to leave what has a logarithm
            step = c / 2
        c -= step
        if abs(step) < NEAR * abs(c):
            break
    return c - (shear * (c * c - 1) + first * np.log(c * area)) / (2 * shear * c + first / c)


@njit(**INNER)
def stress(F, first, shear):  # type: ignore[no-untyped-def]
    """P, nine."""
    G, c = inverse(F), first * np.log(det(F)) - shear
    return (
        shear * F[0] + c * G[0],
        shear * F[1] + c * G[3],
        shear * F[2] + c * G[6],
        shear * F[3] + c * G[1],
        shear * F[4] + c * G[4],
        shear * F[5] + c * G[7],
        shear * F[6] + c * G[2],
        shear * F[7] + c * G[5],
        shear * F[8] + c * G[8],
    )


@njit(**INNER)
def energy(F, first, shear):  # type: ignore[no-untyped-def]
    squared = F[0] ** 2 + F[1] ** 2 + F[2] ** 2 + F[3] ** 2 + F[4] ** 2 + F[5] ** 2 + F[6] ** 2 + F[7] ** 2 + F[8] ** 2
    log = np.log(det(F))
    return shear / 2 * (squared - 3) - shear * log + first / 2 * log * log
