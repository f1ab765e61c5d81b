"""J2 plasticity with linear isotropic hardening, by radial return (J. C. Simo, T. J. R. Hughes, Computational
Inelasticity, 1998, boxes 3.1 and 3.2; plane stress by Newton's method for e_zz).

    f = |s| - sqrt(2/3) (sigma_y + H alpha)    more = f / (2 mu + 2/3 H)    alpha += sqrt(2/3) more
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.tensors import contracted

ROUNDS = 30
NEAR = 1e-12  # of the yield stress: sigma_zz that counts as none
ROOT = np.sqrt(2 / 3)


@njit(**INNER)
def returned(trial, alpha, shear, yields, hardening):  # type: ignore[no-untyped-def]
    """The stress, six components, and the plastic increment `more`, from a trial stress."""
    p = (trial[0] + trial[1] + trial[2]) / 3
    s = (trial[0] - p, trial[1] - p, trial[2] - p, trial[3], trial[4], trial[5])
    size = np.sqrt(contracted(s, s))
    over = size - ROOT * (yields + hardening * alpha)
    if over.real <= 0:
        return trial, over * 0
    more = over / (2 * shear + 2 * hardening / 3)
    c = 1 - 2 * shear * more / size
    return (p + c * s[0], p + c * s[1], p + c * s[2], c * s[3], c * s[4], c * s[5]), more


@njit(**INNER)
def thinned(trial, alpha, first, shear, yields, hardening):  # type: ignore[no-untyped-def]
    """The strain zz to add for a trial stress, six components, so that the stress zz vanishes."""
    bulk = first + 2 * shear / 3
    stiff = first + 2 * shear
    zz = -trial[2] / stiff
    for _ in range(ROUNDS):
        here = (trial[0] + first * zz, trial[1] + first * zz, trial[2] + stiff * zz, trial[3], trial[4], trial[5])
        found, more = returned(here, alpha, shear, yields, hardening)
        slope = here[0] * 0 + stiff
        if more.real > 0:
            p = (here[0] + here[1] + here[2]) / 3
            s = (here[0] - p, here[1] - p, here[2] - p, here[3], here[4], here[5])
            size = np.sqrt(contracted(s, s))
            c, n = 1 - 2 * shear * more / size, s[2] / size
            slope = bulk + 4 / 3 * shear * c - 2 * shear * (1 / (1 + hardening / (3 * shear)) - (1 - c)) * n * n
        zz -= found[2] / slope
        if abs(found[2].real) <= NEAR * yields and abs(found[2]) <= 1e3 * NEAR * yields:
            break
    return zz
