"""St Venant-Kirchhoff: S = lambda tr E I + 2 mu E, E = (F^T F - I) / 2, P = F S.

In plane stress E_zz = -lambda / (lambda + 2 mu) (E_xx + E_yy). The material is unstable in strong compression: the
stress vanishes at F = 0.
"""

from __future__ import annotations

from numba import njit

from pdsolve.laws.law import INNER
from pdsolve.laws.materials.tensors import full, grown, hooke, symmetric, transposed, with_zz
from pdsolve.laws.small_tensors import product


@njit(**INNER)
def green(h):  # type: ignore[no-untyped-def]
    """Green's strain E, six components, of the displacement gradient h."""
    square, e = symmetric(product(transposed(h), h)), symmetric(h)
    return (
        e[0] + square[0] / 2,
        e[1] + square[1] / 2,
        e[2] + square[2] / 2,
        e[3] + square[3] / 2,
        e[4] + square[4] / 2,
        e[5] + square[5] / 2,
    )


@njit(**INNER)
def strain(h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    """The six components of Green's strain; in plane stress zz is what makes the stress across the plane zero."""
    E = green(h)
    if plane_stress:
        return with_zz(E, -first / (first + 2 * shear) * (E[0] + E[1]))
    return E


@njit(**INNER)
def stress(h, first, shear, plane_stress):  # type: ignore[no-untyped-def]
    """P, nine components; in plane stress the out-of-plane ones are omitted, as they vanish."""
    S = hooke(first, shear, strain(h, first, shear, plane_stress))
    return product(grown(h), full(S))
