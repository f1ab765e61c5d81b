"""J2 plasticity with linear isotropic hardening, by radial return (J. C. Simo, T. J. R. Hughes, Computational
Inelasticity, 1998, boxes 3.1 and 3.2; plane stress by Newton's method for e_zz).

    f = |s| - sqrt(2/3) (sigma_y + H alpha)    more = f / (2 mu + 2/3 H)    alpha += sqrt(2/3) more

Elastic deviations that yield with the stress (`pdsolve.laws.plastic_correspondence`) have an energy density b / (4 mu),
and flow `ease` times as fast:

    f = sqrt(|s|^2 + ease b) - sqrt(2/3) (sigma_y + H alpha)    s = s' / (1 + x)    b = b' / (1 + ease x)^2

of the trial s', b', with x = 2 mu more / sqrt(|s|^2 + ease b), found by Newton's method.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.tensors import contracted

ROUNDS = 30
NEAR = 1e-12  # of the yield stress: sigma_zz that counts as none
CLOSE = 1e-9  # change of x in the last round, whose square is lost
ROOT = np.sqrt(2 / 3)


@njit(**INNER)
def returned(trial, alpha, shear, yields, hardening, deviation_square, ease):  # type: ignore[no-untyped-def]
    """The stress, six components, the plastic increment `more`, and x, from a trial stress and b."""
    p = (trial[0] + trial[1] + trial[2]) / 3
    s = (trial[0] - p, trial[1] - p, trial[2] - p, trial[3], trial[4], trial[5])
    square, b = contracted(s, s), ease * deviation_square
    x, limit = square * 0, ROOT * (yields + hardening * alpha)
    size = np.sqrt(square + b)
    if (size - limit).real <= 0:
        return trial, x, x
    soft = hardening / (3 * shear)
    for _ in range(ROUNDS):  # of 1 / sqrt(...) = (1 - soft x) / limit, which is nearly a line
        c, e = 1 / (1 + x), 1 / (1 + ease * x)
        size = 1 / np.sqrt(square * c * c + b * e * e)
        slope = size * size * size * (square * c * c * c + ease * b * e * e * e) + soft / limit
        change = (size - (1 - soft * x) / limit) / slope
        x -= change
        if abs(change.real) <= CLOSE * (1 + abs(x.real)):
            break
    c, more = 1 / (1 + x), x * limit / (1 - soft * x) / (2 * shear)
    return (p + c * s[0], p + c * s[1], p + c * s[2], c * s[3], c * s[4], c * s[5]), more, x


@njit(**INNER)
def thinned(trial, alpha, first, shear, yields, hardening, deviation_square, ease):  # type: ignore[no-untyped-def]
    """The strain zz to add for a trial stress, six components, so that the stress zz vanishes."""
    bulk, soft = first + 2 * shear / 3, hardening / (3 * shear)
    stiff = first + 2 * shear
    zz = -trial[2] / stiff
    for _ in range(ROUNDS):
        shifted_trial = (
            trial[0] + first * zz,
            trial[1] + first * zz,
            trial[2] + stiff * zz,
            trial[3],
            trial[4],
            trial[5],
        )
        stress, more, x = returned(shifted_trial, alpha, shear, yields, hardening, deviation_square, ease)
        slope = shifted_trial[0] * 0 + stiff
        if more.real > 0:
            p = (shifted_trial[0] + shifted_trial[1] + shifted_trial[2]) / 3
            s = (
                shifted_trial[0] - p,
                shifted_trial[1] - p,
                shifted_trial[2] - p,
                shifted_trial[3],
                shifted_trial[4],
                shifted_trial[5],
            )
            c, e = 1 / (1 + x), 1 / (1 + ease * x)
            square, b = contracted(s, s) * c * c, ease * deviation_square * e * e
            steep = square * c + ease * b * e + (square + b) * soft / (1 - soft * x)
            slope = bulk + 4 / 3 * shear * c - 2 * shear * s[2] * s[2] * c * c * c * c / steep
        zz -= stress[2] / slope
        if abs(stress[2].real) <= NEAR * yields and abs(stress[2]) <= 1e3 * NEAR * yields:
            break
    return zz
