"""Compressible neo-Hooke: W = mu / 2 (tr F^T F - 3) - mu ln J + lambda / 2 (ln J)^2.

P = mu (F - F^-T) + lambda ln J F^-T. It is written in Green's strain to avoid cancellation in rotated bodies: C = I + 2
E, ln J = ln(det C) / 2, W = mu (tr E - ln J) + lambda / 2 (ln J)^2, P = F S, S = C^-1 (2 mu E + lambda ln J I). In
plane stress S_zz = 0 is solved for E_zz.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.svk import green
from pdsolve.laws.materials.tensors import full, grown, inverse, with_zz
from pdsolve.laws.small_tensors import product

ROUNDS = 25
NEAR = 1e-15


@njit(**INNER)
def log_of_one_and(x):  # type: ignore[no-untyped-def]
    """ln(1 + x) without cancellation for small x, real or complex."""
    u = 1 + x
    return x if u == 1 else np.log(u) * x / (u - 1)


@njit(**INNER)
def strain(h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    """E, six components; in plane stress with x = 2 E_zz from 2 mu x + lambda (ln(1 + x) + ln A) = 0, A = det C
    in-plane."""
    E = green(h)
    if not plane_stress:
        return E
    area = log_of_one_and(2 * (E[0] + E[1]) + 4 * (E[0] * E[1] - E[3] * E[3]))
    x = -first / (first + 2 * shear) * area
    if x.real <= -0.5:
        x = x * 0 - 0.5
    for _ in range(ROUNDS):
        step = (2 * shear * x + first * (log_of_one_and(x) + area)) / (2 * shear + first / (1 + x))
        if step.real >= 1 + x.real:  # not to leave what has a logarithm
            step = (1 + x) / 2
        x -= step
        if abs(step) <= NEAR * abs(x):
            break
    x -= (2 * shear * x + first * (log_of_one_and(x) + area)) / (2 * shear + first / (1 + x))
    return with_zz(E, x / 2)


@njit(**INNER)
def _log_of_volume(E):  # type: ignore[no-untyped-def]
    """ln J of Green's strain E, without cancellation for small strains."""
    second = E[0] * E[1] + E[1] * E[2] + E[0] * E[2] - E[3] * E[3] - E[4] * E[4] - E[5] * E[5]
    third = E[2] * (E[0] * E[1] - E[3] * E[3]) - E[0] * E[5] * E[5] - E[1] * E[4] * E[4] + 2 * E[3] * E[4] * E[5]
    return log_of_one_and(2 * (E[0] + E[1] + E[2]) + 4 * second + 8 * third) / 2


@njit(**INNER)
def stress(h, E, first, shear):  # type: ignore[no-untyped-def]
    """P, nine components, of a gradient and its strain; in plane stress the out-of-plane ones are omitted, as they
    vanish."""
    p, s = first * _log_of_volume(E), 2 * shear
    S = full((s * E[0] + p, s * E[1] + p, s * E[2] + p, s * E[3], s * E[4], s * E[5]))
    C = grown(full((2 * E[0], 2 * E[1], 2 * E[2], 2 * E[3], 2 * E[4], 2 * E[5])))
    return product(grown(h), product(inverse(C), S))


@njit(**INNER)
def energy(E, first, shear):  # type: ignore[no-untyped-def]
    log = _log_of_volume(E)
    return shear * (E[0] + E[1] + E[2] - log) + first / 2 * log * log
