"""Correspondence with a gradient for each bond, which controls all zero-energy modes.

T. Breitzman, K. Dayal, J. Mech. Phys. Solids 110 (2018) 409-425.

With H_m the mean of the gradients of both ends (see `pdsolve.laws.correspondence`), that of a bond is

    H = H_m + (eta - H_m xi) xi^T / |xi|^2        W_i = sum w / w_i W(H)        w_i = sum w of the intact bonds

and forces are its exact derivative: with P = W'(H), C = w (P_i / w_i + P_j / w_j), B_i = sum C (I - n n^T) / 2 and A_i
= B_i K_i^-1, the force density on i is the sum over bonds of C xi / |xi|^2 + w (A_i + A_j) xi. If one end has no
gradient, the other's is used. A bond fails by stress as in `correspondence`, by the mean of its ends' stresses, which
are those of their gradients. There is no history: plasticity and rates need other laws.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws import gradient
from pdsolve.laws.bond_arrays import AnyList, left
from pdsolve.laws.gradient import ENERGY
from pdsolve.laws.law import INLINE, Failure, IntermediatePass, Law, Passes
from pdsolve.laws.materials.solid import SolidColumns, energies, respond
from pdsolve.model import Model

STIFFENS = 1.8  # largest eigenvalue of torn families over that of the start


class BreitzmanDayalColumns(NamedTuple):
    """Columns of n nodes and b bonds, in d dimensions."""

    inverse: NDArray[np.floating]  # (n, d d) K^-1, 0 where there is none
    total: NDArray[np.floating]  # (n,) w_i
    weight: NDArray[np.floating]  # (b,) w, m^d
    limit: NDArray[np.floating]  # (b,)
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    solid: SolidColumns
    failure: int
    least: float  # the least limit of all
    horizon: NDArray[np.float64]  # (n,) m
    stiffest: NDArray[np.float64]  # (1,) as in `correspondence`
    share: NDArray[np.floating]  # (n,) likewise
    d: int


def columns(model: Model, bonds: Bonds) -> BreitzmanDayalColumns:
    """Columns of these bonds (b,) and their nodes."""
    nodal, nodes = gradient.columns(model, bonds), len(bonds.start) - 1
    total = np.bincount(bonds.source, bonds.weight, minlength=nodes).astype(bonds.xi.dtype)
    shared = {name: getattr(nodal, name) for name in BreitzmanDayalColumns._fields if name != "total"}
    return BreitzmanDayalColumns(total=total, **shared)


def update_after_breakage(law: BreitzmanDayalColumns, bonds: AnyList, rows: NDArray[np.int64]) -> None:
    """Recompute K^-1 and w of these nodes (k,) from the intact bonds; nodes of torn, stiffer families have no K^-1."""
    gradient.update_after_breakage(law, bonds, rows)  # type: ignore[arg-type]
    law.inverse[rows[law.share[rows] < 1]] = 0
    intact_bonds = left(bonds, law.weight, law.broken, rows)
    initial_total = np.bincount(intact_bonds.own, law.weight[intact_bonds.which], minlength=len(rows))
    law.total[rows] = np.maximum(
        np.bincount(intact_bonds.own, intact_bonds.weight, minlength=len(rows)), initial_total / 2
    )


def torn_stiffness(law: BreitzmanDayalColumns, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bound of the stiffness (n,) of nodes that have lost bonds, N/m^4: a bond left has more of the family's weight."""
    return STIFFENS * start


def rows(law: BreitzmanDayalColumns, dimension: int) -> int:
    """Width of `m`: A, H, sigma, J, as in `correspondence`."""
    return 2 * dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(
    law: BreitzmanDayalColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """Stored fields (n,) by result column: stress, rotation, volume and the solid's history."""
    return gradient.stress_fields(law.d, law.solid, m, law.d * law.d)


def first_pass(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        d = len(bond.xi)
        for a in range(d):
            for b in range(d):
                m[i, d * a + b] += law.weight[k] * bond.eta[a] * bond.xi[b]


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    d = law.d
    gradient.multiply_by_inverse(law, i, m, m, d * d)
    gradient.piola_stress(law, now, i, m, d * d)


def intermediate_pass(law, bond, now, i, j, k, m, more):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0 or law.inverse[i, 0] == 0:
        return
    d, share = len(bond.xi), _share(law, i, j)
    P = _stress(law, bond, now, m, i, j)
    for a in range(d):
        along = bond.length * 0 * bond.q
        for b in range(d):
            along += P[3 * a + b] * bond.xi[b] / (bond.length * bond.length)
        for b in range(d):
            more[i, d * a + b] += law.weight[k] * share * (P[3 * a + b] - along * bond.xi[b])


def finish_intermediate_pass(law, now, i, m, more):  # type: ignore[no-untyped-def]
    gradient.multiply_by_inverse(law, i, more, m, 0)


@njit(**INLINE)
def _share(law, i, j):  # type: ignore[no-untyped-def]
    """Share of node i in the mean gradient."""
    if law.inverse[i, 0] == 0:
        return 0.0
    return 0.5 if law.inverse[j, 0] != 0 else 1.0


@njit(**INLINE)
def _gradient(law, bond, m, i, j):  # type: ignore[no-untyped-def]
    """H of a bond, nine components."""
    d, s, t = len(bond.xi), _share(law, i, j), _share(law, j, i)
    squared, none = bond.length * bond.length, m[i, 0] * 0
    r0, r1, r2 = bond.eta[0] + none, bond.eta[1] + none, bond.eta[d - 1] + none
    g = d * d
    for b in range(d):
        r0 -= (s * m[i, g + b] + t * m[j, g + b]) * bond.xi[b]
        r1 -= (s * m[i, g + d + b] + t * m[j, g + d + b]) * bond.xi[b]
        r2 -= (s * m[i, g + g - d + b] + t * m[j, g + g - d + b]) * bond.xi[b]
    x, y = bond.xi[0] / squared, bond.xi[1] / squared
    xx, xy = s * m[i, g] + t * m[j, g] + r0 * x, s * m[i, g + 1] + t * m[j, g + 1] + r0 * y
    yx, yy = s * m[i, g + d] + t * m[j, g + d] + r1 * x, s * m[i, g + d + 1] + t * m[j, g + d + 1] + r1 * y
    if d == 2:
        return (xx, xy, none, yx, yy, none, none, none, none)
    z, e = bond.xi[d - 1] / squared, g + g - d
    return (
        xx,
        xy,
        s * m[i, g + d - 1] + t * m[j, g + d - 1] + r0 * z,
        yx,
        yy,
        s * m[i, g + d + d - 1] + t * m[j, g + d + d - 1] + r1 * z,
        s * m[i, e] + t * m[j, e] + r2 * x,
        s * m[i, e + 1] + t * m[j, e + 1] + r2 * y,
        s * m[i, e + d - 1] + t * m[j, e + d - 1] + r2 * z,
    )


@njit(**INLINE)
def _stress(law, bond, now, m, i, j):  # type: ignore[no-untyped-def]
    """P_i / w_i + P_j / w_j, nine components."""
    h = _gradient(law, bond, m, i, j)
    p, q = respond(law.solid, now.dt, i, h, h[0] * 0).P, respond(law.solid, now.dt, j, h, h[0] * 0).P
    a = 1 / law.total[i] if law.inverse[i, 0] != 0 or law.inverse[j, 0] != 0 else law.total[i] * 0
    b = 1 / law.total[j] if a != 0 else a
    return (
        a * p[0] + b * q[0],
        a * p[1] + b * q[1],
        a * p[2] + b * q[2],
        a * p[3] + b * q[3],
        a * p[4] + b * q[4],
        a * p[5] + b * q[5],
        a * p[6] + b * q[6],
        a * p[7] + b * q[7],
        a * p[8] + b * q[8],
    )


@njit(**INLINE)
def _component(law, bond, P, m, i, j, k, a):  # type: ignore[no-untyped-def]
    d, f = len(bond.xi), m[i, 0] * 0
    for b in range(d):
        f += P[3 * a + b] * bond.xi[b] / (bond.length * bond.length)
        f += (m[i, d * a + b] + m[j, d * a + b]) * bond.xi[b]
    return law.weight[k] * f


def accumulate_bond_force(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        P = _stress(law, bond, now, m, i, j)
        for a in range(len(bond.xi)):
            f[a] += _component(law, bond, P, m, i, j, k, a)


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return gradient.may_fail_at(law, i, m, 2 * law.d * law.d)


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.failure != ENERGY or law.broken[k] != 0 or bond.stretch <= 0:
        return gradient.fails_by_stretch_or_stress(law, bond, m, i, j, k, 2 * law.d * law.d)
    P, along = _stress(law, bond, now, m, i, j), bond.stretch * 0
    for a in range(len(bond.xi)):
        along += _component(law, bond, P, m, i, j, k, a) * (bond.xi[a] + bond.eta[a])
    return along * bond.stretch / bond.q > 2 * law.weight[k] * law.limit[k]


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0 or (law.inverse[i, 0] == 0 and law.inverse[j, 0] == 0):
        return 0.0, 0.0
    node_energy = energies(law.solid, now.dt, i, _gradient(law, bond, m, i, j), m[i, 0] * 0)[0]
    return law.weight[k] / law.total[i] * node_energy, 0.0


LAW = Law(
    columns_type=BreitzmanDayalColumns,
    columns=columns,
    passes=Passes(accumulate_bond_force, first_pass, finish_pass),
    energy=energy,
    width=rows,
    scale=gradient.scale,
    failure=Failure(may_fail, fails),
    again=IntermediatePass(intermediate_pass, finish_intermediate_pass),
    update_after_breakage=update_after_breakage,
    torn_stiffness=torn_stiffness,
    fields=fields,
)
