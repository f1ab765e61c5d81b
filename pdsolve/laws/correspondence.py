"""Correspondence: a node's stress follows from the gradient fitted to its family, for any material.

S. A. Silling, M. Epton, O. Weckner, J. Xu, E. Askari, J. Elast. 88 (2007) 151-184, section 18. With w the neighbour's
cell times its influence, K = sum w xi xi^T and the gradient of the displacement H = (sum w eta xi^T) K^-1, the force
density is the sum over bonds of

    w [(A_i + A_j) xi + (Z_i + Z_j) eta]        A = P K^-1 - Z H

with the stress P and the stiffness Z against the deviation eta - H xi of a bond. Without Z, modes that H does not see
have no energy, such as neighbours that move against each other.

    silling   G c pi / (horizon sum w) in the plane, c = 9 E / pi horizon^3; in space G c 4 pi / 3 sum w, c = 12 E / pi
              horizon^4, times I (S. A. Silling, Comput. Methods Appl. Mech. Eng. 322 (2017) 42-57), by the lattice's
              own sums
    none      nothing

Families that lose bonds, and how bonds fail: `pdsolve.laws.gradient`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_arrays import Tabled
from pdsolve.laws.gradient import (
    CorrespondenceColumns,
    by_lanes,
    columns,
    deviation,
    fails_at,
    finish_sums_of,
    margin,
    may_fail_at,
    nodal_energy_at,
    piola_stress_from_sums,
    scale,
    stress_fields,
    torn_stiffness,
    update_after_breakage,
    update_history_at,
    watched,
)
from pdsolve.laws.law import Failure, Lanes, Law, NodeHistory, Sums
from pdsolve.laws.small_tensors import blank_square, mapped, product, square, summed, with_dyad


def rows(law: CorrespondenceColumns, dimension: int) -> int:
    """Width of `m`: A, H, sigma (in the plane xx, yy, zz, xy), J."""
    return 2 * dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(
    law: CorrespondenceColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """Stored fields (n,) by result column: stress, rotation, volume and the solid's history."""
    return stress_fields(law.d, law.solid, m, law.d * law.d)


def numbers(law, i, j, k):  # type: ignore[no-untyped-def]
    return law.weight[k], law.control[i] + law.control[j]


def initial_sums(law, xi, none):  # type: ignore[no-untyped-def]
    return blank_square(xi, none)


def accumulate(law, bond, c, sums):  # type: ignore[no-untyped-def]
    return with_dyad(sums, c[0], bond.eta, bond.xi)


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    P, d = piola_stress_from_sums(law, now, i, m, law.d * law.d), law.d
    for a in range(d):
        for b in range(d):
            total = -law.control[i] * m[i, d * (d + a) + b]
            for c in range(d):
                total += P[3 * a + c] * law.inverse[i, d * c + b]
            m[i, d * a + b] = total


def tabled(law: CorrespondenceColumns, bonds: Bonds) -> Tabled:
    """Data of bonds (b,) for the block kernels."""
    return watched(law, (law.weight, law.control[bonds.source] + law.control[bonds.neighbour]), nodal_count=4)


def standing(law: CorrespondenceColumns, rows: NDArray[np.int64]) -> NDArray[np.floating]:
    """Nodal constants for `finish_sums`: K^-1, lambda, mu, the share of the stress, whether it is above 0, Z."""
    share = law.share[rows]
    scalar_rows = law.solid.first[rows], law.solid.shear[rows], share, np.ceil(share), law.control[rows]
    return np.vstack([law.inverse[rows].T, *scalar_rows])


def finish_sums(law, sums, node_constants):  # type: ignore[no-untyped-def]
    H, P, s, J = finish_sums_of(law, sums, node_constants)
    Z, A = node_constants[8], product(P, node_constants[:4])
    return (
        *(A[0] - Z * H[0], A[1] - Z * H[1], A[2] - Z * H[2], A[3] - Z * H[3]),
        *(H[0], H[1], H[2], H[3], s[0], s[1], s[2], s[3], J),
    )


def nodal_numbers(law, xi, m, i):  # type: ignore[no-untyped-def]
    return square(m, i, 0, xi)


def bond_force(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    return mapped(c[0], summed(node_numbers, neighbour_numbers), bond.xi, c[1], bond.eta)


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return may_fail_at(law, i, m, 2 * law.d * law.d)


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return fails_at(law, bond, m, i, j, k, 2 * law.d * law.d)


def update_history(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    update_history_at(law, now, i, m, law.d * law.d, m[i, 0] * 0)


def nodal_energy(law, now, i, m):  # type: ignore[no-untyped-def]
    return nodal_energy_at(law, now, i, m, law.d * law.d, m[i, 0] * 0)


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    d, deviation_energy = len(bond.xi), bond.stretch * 0
    for a in range(d):
        rest = deviation(bond, m, i, d * d, a)
        deviation_energy += law.control[i] * rest * rest
    return law.weight[k] * deviation_energy / 2, 0.0


LAW = Law(
    columns_type=CorrespondenceColumns,
    columns=columns,
    passes=Sums(numbers, initial_sums, accumulate, finish_pass, nodal_numbers, bond_force),
    energy=energy,
    width=rows,
    scale=scale,
    failure=Failure(may_fail, fails),
    nodes=NodeHistory(("history",), update_history, nodal_energy),
    lanes=Lanes(finish_sums, margin, tabled, standing, by_lanes),
    update_after_breakage=update_after_breakage,
    torn_stiffness=torn_stiffness,
    fields=fields,
)
