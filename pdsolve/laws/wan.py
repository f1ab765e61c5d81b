"""Correspondence with a control after a solid's own elasticity, which wants no factor.

J. Wan, Z. Chen, X. Chu, H. Liu, Acta Mech. Sin. 35 (2019) 1021-1034: with C the tensor of elasticity the force density
of `pdsolve.laws.correspondence` has Z = C : K^-1. Where a family is not the same all around that makes a torque, as it
does not turn with the node.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.laws import correspondence
from pdsolve.laws.correspondence import closed, deviation, failing, lifted, looked_at, stressed
from pdsolve.laws.law import INNER, List, Tabled
from pdsolve.laws.materials.solid import holds, keep
from pdsolve.laws.materials.tensors import det
from pdsolve.laws.small import blank_square, halves, mapped_both, product, squares, summed, with_dyad
from pdsolve.model import Model

NODE_MEMORY = ("history",)


class Wan(correspondence.Law):
    """Columns of n nodes and b bonds, in d dimensions; those of the control are of no use."""


Law = Wan  # a name of its own: what is compiled for types of one name and one content is one, to linkers


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,) and their nodes."""
    return Law(*correspondence.columns(model, bonds))


def mend(law: Law, bonds: List, rows: NDArray[np.int64]) -> None:
    """K^-1 of these nodes (k,) from the bonds that are left."""
    correspondence.mend(law, bonds, rows)


def scale(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """How the resistance of nodes (n,) compares, N/m^4."""
    return correspondence.scale(law, bonds)


def rows(law: Law, dimension: int) -> int:
    """A, Z, and H, sigma, J as in `correspondence`."""
    return 3 * dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(law: Law, value: NDArray[np.floating], m: NDArray[np.floating]) -> dict[str, NDArray[np.float64]]:
    """As in `Operator`."""
    return correspondence.shown(law.d, law.solid, m, 2 * law.d * law.d)


def numbers(law, i, j, k):  # type: ignore[no-untyped-def]
    return (law.weight[k],)


def nothing(law, xi, none):  # type: ignore[no-untyped-def]
    return blank_square(xi, none)


def say(law, bond, c, sums):  # type: ignore[no-untyped-def]
    return with_dyad(sums, c[0], bond.eta, bond.xi)


def close(law, i, m):  # type: ignore[no-untyped-def]
    d = law.d
    g = d * d
    P = stressed(law, i, m, 2 * g)
    for a in range(d):
        for b in range(d):
            total = m[i, 0] * 0
            for c in range(d):
                total += P[3 * a + c] * law.inverse[i, d * c + b]
                total -= _control(law, i, a, c) * m[i, 2 * g + d * c + b]
            m[i, d * a + b] = total
            m[i, g + d * a + b] = _control(law, i, a, b)


@njit(**INNER)
def _control(law, i, a, b):  # type: ignore[no-untyped-def]
    """C : K^-1, one component of a node's."""
    found = 2 * law.solid.shear[i] * law.inverse[i, law.d * a + b]
    if a == b:
        first = law.solid.first[i]
        if law.solid.plane_stress:
            first *= 2 * law.solid.shear[i] / (first + 2 * law.solid.shear[i])
        for c in range(law.d):
            found += first * law.inverse[i, (law.d + 1) * c]
    return found


def tabled(law: Law, bonds: Bonds) -> Tabled:
    """What blocks want of bonds (b,)."""
    return correspondence.watched(law, (law.weight,), shown=8)


def standing(law: Law, rows: NDArray[np.int64]) -> NDArray[np.floating]:
    """What `finish` wants of nodes: K^-1, lambda, mu, and Z, four."""
    first, shear, K = law.solid.first[rows], law.solid.shear[rows], law.inverse[rows].T
    flat = first * (2 * shear / (first + 2 * shear)) if law.solid.plane_stress else first
    trace, double = flat * (K[0] + K[3]), 2 * shear
    return np.vstack([K, first, shear, double * K[0] + trace, double * K[1], double * K[2], double * K[3] + trace])


def by_lanes(law: Law) -> bool:
    """As in `correspondence`."""
    return correspondence.by_lanes(law)


def finish(law, sums, own):  # type: ignore[no-untyped-def]
    H, found = closed(law, sums, own)
    P, Z = found.P, own[6:]
    A, B = product((P[0], P[1], P[3], P[4]), own[:4]), product(Z, H)
    s = found.sigma
    return (
        *(A[0] - B[0], A[1] - B[1], A[2] - B[2], A[3] - B[3], Z[0], Z[1], Z[2], Z[3]),
        *(H[0], H[1], H[2], H[3], s[0], s[1], s[2], s[3], det(found.F)),
    )


def nears(law, bond, c, here, there):  # type: ignore[no-untyped-def]
    return looked_at(law, bond, c, here, there)


def shows(law, xi, m, i):  # type: ignore[no-untyped-def]
    return squares(m, i, xi)


def exchange(law, bond, c, here, there):  # type: ignore[no-untyped-def]
    A, Z = halves(here)
    B, Y = halves(there)
    return mapped_both(c[0], summed(A, B), bond.xi, summed(Z, Y), bond.eta)


def alert(law, i, m):  # type: ignore[no-untyped-def]
    return correspondence.may_fail(law, i, m, 3 * law.d * law.d)


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return failing(law, bond, m, i, j, k, 3 * law.d * law.d)


def remember(law, now, i, m):  # type: ignore[no-untyped-def]
    keep(law.solid, i, lifted(m, i, 2 * law.d * law.d, law.d))


def hold(law, i, m):  # type: ignore[no-untyped-def]
    return holds(law.solid, i, lifted(m, i, 2 * law.d * law.d, law.d))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    d, held = len(bond.xi), bond.stretch * 0
    at = 2 * d * d
    for a in range(d):
        for b in range(d):
            held += _control(law, i, a, b) * deviation(bond, m, i, at, a) * deviation(bond, m, i, at, b)
    return law.weight[k] * held / 2, 0.0
