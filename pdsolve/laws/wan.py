"""Correspondence with a control derived from the solid's own elasticity, without a factor to choose.

J. Wan, Z. Chen, X. Chu, H. Liu, Acta Mech. Sin. 35 (2019) 1021-1034: with the elasticity tensor C, the force density of
`pdsolve.laws.correspondence` has Z = C : K^-1. Z is anisotropic if a family is; it is that of the whole family, also
once bonds are lost, so that what is left is no stiffer. With a solid for large rotations (svk,
neo hooke, rates), Z rotates with the node: with F = I + H = R U, and M the sum of w z z^T, z = eta - H xi,

    R Z R^T in place of Z        P + R [g] in place of P        (tr U I - U) g = axial vector of Z R^T M R

where [g] is the cross product with g. The second is the derivative of the energy w z . R Z R^T z / 2 through R: forces
are derived from an energy, and angular momentum is conserved.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws import gradient
from pdsolve.laws.bond_arrays import AnyList, Tabled
from pdsolve.laws.gradient import (
    deviation,
    fails_at,
    finish_sums_of,
    lifted,
    nodal_energy_at,
    piola_stress_from_sums,
    update_history_at,
)
from pdsolve.laws.law import INLINE, INNER, Failure, Lanes, Law, NodeHistory, Sums
from pdsolve.laws.materials.solid import NEO_HOOKE, SVK
from pdsolve.laws.materials.tensors import difference, full, grown, inverse, rotation, symmetric, transposed
from pdsolve.laws.small_tensors import (
    blank_square,
    blank_symmetric,
    halves,
    mapped_both,
    product,
    squares,
    summed,
    with_dyad,
    with_square,
)
from pdsolve.model import Model


class WanCorrespondenceColumns(gradient.CorrespondenceColumns):
    """Columns of n nodes and b bonds, in d dimensions; `control` (n, d d) is K^-1 of whole families."""


def columns(model: Model, bonds: Bonds) -> WanCorrespondenceColumns:
    """Columns of these bonds (b,) and their nodes."""
    law = gradient.columns(model, bonds)
    return WanCorrespondenceColumns(*law._replace(control=law.inverse.copy()))


def update_after_breakage(law: WanCorrespondenceColumns, bonds: AnyList, rows: NDArray[np.int64]) -> None:
    """Recompute K^-1 and the share of the stress of these nodes (k,); those without a share have no gradient."""
    gradient.update_after_breakage(law, bonds, rows)
    law.inverse[rows[law.share[rows] == 0]] = 0


def rows(law: WanCorrespondenceColumns, dimension: int) -> int:
    """Width of `m`: A, Z, and H, sigma, J as in `correspondence`."""
    return 3 * dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(
    law: WanCorrespondenceColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """Stored fields (n,) by result column: stress, rotation, volume and the solid's history."""
    return gradient.stress_fields(law.d, law.solid, m, 2 * law.d * law.d)


def numbers(law, i, j, k):  # type: ignore[no-untyped-def]
    return (law.weight[k],)


def initial_sums(law, xi, none):  # type: ignore[no-untyped-def]
    return blank_square(xi, none) + blank_symmetric(xi, none)


def accumulate(law, bond, c, sums):  # type: ignore[no-untyped-def]
    A, B = with_square(sums, c[0], bond.eta)
    return with_dyad(A, c[0], bond.eta, bond.xi) + B


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    d = law.d
    g = d * d
    P, Z = piola_stress_from_sums(law, now, i, m, 2 * g), _control(law, i, m)
    if law.solid.rate or law.solid.kind[i] == SVK or law.solid.kind[i] == NEO_HOOKE:
        P, Z = _turned(law, i, m, P, Z)
    for a in range(d):
        for b in range(d):
            total = m[i, 0] * 0
            for c in range(d):
                total += P[3 * a + c] * law.inverse[i, d * c + b]
                total -= Z[3 * a + c] * m[i, 2 * g + d * c + b]
            m[i, d * a + b] = total
    for a in range(d):
        for b in range(d):
            m[i, g + d * a + b] = Z[3 * a + b]


@njit(**INNER)
def _control(law, i, m):  # type: ignore[no-untyped-def]
    """C : K^-1 of a node, nine components, of the number type of m; nothing without a share of the stress."""
    d, none = law.d, m[i, 0] * 0
    if law.share[i] == 0:
        return (none, none, none, none, none, none, none, none, none)
    twice, first, trace = 2 * law.solid.shear[i], law.solid.first[i], none
    if law.solid.plane_stress:
        first *= twice / (first + twice)
    for c in range(d):
        trace += first * law.control[i, (d + 1) * c]
    k = law.control[i]
    if d == 2:
        xx, yy, xy = trace + twice * k[0], trace + twice * k[3], none + twice * k[1]
        return (xx, xy, none, xy, yy, none, none, none, none)
    xx, yy, zz = trace + twice * k[0], trace + twice * k[4], trace + twice * k[8]
    xy, xz, yz = none + twice * k[1], none + twice * k[2], none + twice * k[5]
    return (xx, xy, xz, xy, yy, yz, xz, yz, zz)


@njit(**INNER)
def _turned(law, i, m, P, Z):  # type: ignore[no-untyped-def]
    """P and Z of a rotated node, nine components each, from its sums and the gradient behind them."""
    d, none = law.d, m[i, 0] * 0
    g = d * d
    h = lifted(m, i, 2 * g, d)
    if d == 2:
        sums = (m[i, 0], m[i, 1], m[i, 2], m[i, 3], m[i, 4], m[i, 5], m[i, 6])
        p, z = _turned_in_the_plane(sums, (h[0], h[1], h[3], h[4]), (P[0], P[1], P[3], P[4]), (Z[0], Z[1], Z[3], Z[4]))
        return (p[0], p[1], none, p[2], p[3], none, none, none, P[8]), (
            *(z[0], z[1], none, z[2], z[3], none),
            *(none, none, none),
        )
    S = (m[i, g], m[i, g + 1], m[i, g + 2], m[i, g + 3], m[i, g + 4], m[i, g + 5])
    R = rotation(grown(h))
    back = transposed(R)
    M = difference(full(S), full(symmetric(product(lifted(m, i, 0, d), transposed(h)))))
    N = product(Z, product(product(back, M), R))
    U = symmetric(product(back, grown(h)))
    G = inverse(full((U[1] + U[2], U[0] + U[2], U[0] + U[1], -U[3], -U[4], -U[5])))
    t = (N[5] - N[7], N[6] - N[2], N[1] - N[3])
    x = G[0] * t[0] + G[1] * t[1] + G[2] * t[2]
    y = G[3] * t[0] + G[4] * t[1] + G[5] * t[2]
    z = G[6] * t[0] + G[7] * t[1] + G[8] * t[2]
    return summed(P, product(R, (none, -z, y, z, none, -x, -y, x, none))), product(product(R, Z), back)


@njit(**INLINE)
def _turned_in_the_plane(sums, H, P, Z):  # type: ignore[no-untyped-def]
    """P and Z of a rotated node in the plane, four components each."""
    c, s = 2.0 + H[0] + H[3], H[2] - H[1]
    once = 1.0 / np.sqrt(c * c + s * s)  # 1 / tr U
    c, s = c * once, s * once
    R = (c, s * -1.0, s, c)
    Z = product(product(R, Z), (c, s, s * -1.0, c))
    xx = sums[4] - (sums[0] * H[0] + sums[1] * H[1])
    xy = sums[5] - (sums[0] * H[2] + sums[1] * H[3])
    yy = sums[6] - (sums[2] * H[2] + sums[3] * H[3])
    g = (Z[0] * xy + Z[1] * yy - Z[2] * xx - Z[3] * xy) * once
    return (P[0] - g * s, P[1] - g * c, P[2] + g * c, P[3] - g * s), Z


def tabled(law: WanCorrespondenceColumns, bonds: Bonds) -> Tabled:
    """Data of bonds (b,) for the block kernels."""
    return gradient.watched(law, (law.weight,), nodal_count=8)


def standing(law: WanCorrespondenceColumns, rows: NDArray[np.int64]) -> NDArray[np.floating]:
    """Nodal constants for `finish_sums`: K^-1, lambda, mu, the share of the stress, whether it is above 0, and Z."""
    first, shear, share = law.solid.first[rows], law.solid.shear[rows], law.share[rows]
    flat = first * (2 * shear / (first + 2 * shear)) if law.solid.plane_stress else first
    K = np.where(share > 0, law.control[rows].T, 0)
    trace, double = flat * (K[0] + K[3]), 2 * shear
    Z = double * K[0] + trace, double * K[1], double * K[2], double * K[3] + trace
    return np.vstack([law.inverse[rows].T, first, shear, share, np.ceil(share), *Z])


def finish_sums(law, sums, node_constants):  # type: ignore[no-untyped-def]
    H, P, s, J = finish_sums_of(law, sums[:4], node_constants)
    Z = node_constants[8:]
    if law.solid.kind[0] == SVK:
        P, Z = _turned_in_the_plane(sums, H, P, Z)
    A, B = product(P, node_constants[:4]), product(Z, H)
    return (
        *(A[0] - B[0], A[1] - B[1], A[2] - B[2], A[3] - B[3], Z[0], Z[1], Z[2], Z[3]),
        *(H[0], H[1], H[2], H[3], s[0], s[1], s[2], s[3], J),
    )


def nodal_numbers(law, xi, m, i):  # type: ignore[no-untyped-def]
    return squares(m, i, xi)


def bond_force(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    A, Z = halves(node_numbers)
    B, Y = halves(neighbour_numbers)
    return mapped_both(c[0], summed(A, B), bond.xi, summed(Z, Y), bond.eta)


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return gradient.may_fail_at(law, i, m, 3 * law.d * law.d)


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return fails_at(law, bond, m, i, j, k, 3 * law.d * law.d)


def update_history(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    update_history_at(law, now, i, m, 2 * law.d * law.d, m[i, 0] * 0)


def nodal_energy(law, now, i, m):  # type: ignore[no-untyped-def]
    return nodal_energy_at(law, now, i, m, 2 * law.d * law.d, m[i, 0] * 0)


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    d, deviation_energy = len(bond.xi), bond.stretch * 0
    at = 2 * d * d
    for a in range(d):
        for b in range(d):
            deviation_energy += m[i, d * (d + a) + b] * deviation(bond, m, i, at, a) * deviation(bond, m, i, at, b)
    return law.weight[k] * deviation_energy / 2, 0.0


LAW = Law(
    columns_type=WanCorrespondenceColumns,
    columns=columns,
    passes=Sums(numbers, initial_sums, accumulate, finish_pass, nodal_numbers, bond_force),
    energy=energy,
    width=rows,
    scale=gradient.scale,
    failure=Failure(may_fail, fails),
    nodes=NodeHistory(("history",), update_history, nodal_energy),
    lanes=Lanes(finish_sums, gradient.margin, tabled, standing, gradient.by_lanes),
    update_after_breakage=update_after_breakage,
    torn_stiffness=gradient.torn_stiffness,
    fields=fields,
)
