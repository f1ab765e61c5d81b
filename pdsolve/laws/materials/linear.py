"""Hooke's solid for small strains and small rotations: sigma = lambda tr e I + 2 mu e, e = (H + H^T) / 2.

H is the gradient of the displacement. In plane stress e_zz = -lambda / (lambda + 2 mu) (e_xx + e_yy).
"""

from __future__ import annotations

from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.tensors import hooke, symmetric, with_zz


@njit(**INNER)
def strain(h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    e = symmetric(h)
    if plane_stress:
        return with_zz(e, -first / (first + 2 * shear) * (e[0] + e[1]))
    return e


@njit(**INNER)
def stress(h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    """The six components of the Cauchy stress, Pa, by Hooke's law of the small strain."""
    return hooke(first, shear, strain(h, first, shear, plane_stress))
