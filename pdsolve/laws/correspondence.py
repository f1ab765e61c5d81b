"""Correspondence: a node's stress follows the gradient that its family shows, whatever the material.

S. A. Silling, M. Epton, O. Weckner, J. Xu, E. Askari, J. Elast. 88 (2007) 151-184, section 18. With w the neighbour's
cell times its influence, K = sum w xi xi^T and the gradient of the displacement H = (sum w eta xi^T) K^-1, the force
density is the sum over bonds of

    w [(A_i + A_j) xi + (Z_i + Z_j) eta]        A = P K^-1 - Z H

with P the stress, and Z what the deviation eta - H xi of a bond is held back with: modes that H does not see, as those
in which neighbours move against each other, have no energy without it.

    silling   G c pi / (horizon sum w) in the plane, c = 9 E / pi horizon^3; in space G c 4 pi / 3 sum w, c = 12 E / pi
              horizon^4, times I (S. A. Silling, Comput. Methods Appl. Mech. Eng. 322 (2017) 42-57), by the lattice's
              own sums
    wan       C : K^-1, C the tensor of elasticity (J. Wan, Z. Chen, X. Chu, H. Liu, Acta Mech. Sin. 35 (2019)
              1021-1034); where a family is not the same all around it makes a torque, as it does not turn with the node
    none      nothing

A bond fails by the largest principal value of the mean of its ends' stresses, by its stretch, or by its energy, half of
its force times its elongation. A node whose bonds left nearly lie on a line, or are gone, has no stress of its own:
what holds back deviations is all that is left there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds import Bonds
from pdsolve.laws.law import INLINE, INNER, List
from pdsolve.laws.materials.solid import ALPHA_RATE, ALPHA_TOTAL, J2, Solid, holds, keep, respond, solid_of
from pdsolve.model import Model

NODE_MEMORY = ("history",)
NEVER, STRETCH, ENERGY, STRESS = range(4)
FAILURES = {"stretch": STRETCH, "energy": ENERGY, "stress": STRESS}
FLAT = 0.01  # least over sum of a family's moments: less is as good as a line


class Law(NamedTuple):
    """Columns of n nodes and b bonds, in d dimensions."""

    inverse: NDArray[np.floating]  # (n, d d) K^-1, 0 where there is none
    control: NDArray[np.floating]  # (n,) Z of silling, N/m^6 in the plane
    weight: NDArray[np.floating]  # (b,) w, m^d
    limit: NDArray[np.floating]  # (b,) of the stretch, the energy or the stress, at which the bond fails
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    solid: Solid
    history: NDArray[np.floating]  # that of the solid
    failure: int
    least: float  # the least limit of all
    wan: bool
    d: int


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,) and their nodes."""
    kind, d, nodes = bonds.xi.dtype, bonds.xi.shape[1], len(bonds.start) - 1
    own = np.repeat(np.arange(nodes), np.diff(bonds.start))
    total = np.bincount(own, bonds.weight, minlength=nodes).astype(float)
    solid, first = solid_of(model, kind, d), model.materials[0]
    control = silling(model, total, d) if first.control == "silling" else np.zeros(nodes)
    law = Law(
        inverse=np.zeros((nodes, d * d), kind),
        control=control.astype(kind),
        weight=bonds.weight,
        limit=bonds.limit,
        broken=np.zeros(len(bonds.limit), np.int32),
        solid=solid,
        history=solid.history,
        failure=FAILURES.get(first.failure, NEVER),
        least=float(bonds.limit.min(initial=np.inf)),
        wan=first.control == "wan",
        d=d,
    )
    mend(law, List(bonds.start, bonds.neighbour, tuple(bonds.xi.T)), np.arange(nodes))
    return law


def silling(model: Model, total: NDArray[np.float64], d: int) -> NDArray[np.float64]:
    """Z (n,) of nodes whose weights have this `total` (n,)."""
    horizon = np.broadcast_to(model.horizons, total.shape)
    E, G = (
        np.array([getattr(m, name) for m in model.materials])[model.material_of] for name in ("E", "control_factor")
    )
    strength = 9 * E / (horizon**2) if d == 2 else 16 * E / (horizon**2)
    return np.divide(G * strength, total, out=np.zeros(len(total)), where=total > 0)


def mend(law: Law, bonds: List, rows: NDArray[np.int64]) -> None:
    """K^-1 of these nodes (k,) from the bonds that are left."""
    K = shapes(bonds, law.weight, law.broken, rows)
    values = np.linalg.eigvalsh(K)
    sound = values[:, 0] > FLAT * values.sum(axis=1)
    law.inverse[rows] = 0
    law.inverse[rows[sound]] = np.linalg.inv(K[sound]).reshape(-1, law.d * law.d)


def shapes(
    bonds: List, weight: NDArray[np.floating], broken: NDArray[np.int32], rows: NDArray[np.int64]
) -> NDArray[np.float64]:
    """K (k, d, d) of these nodes, from the bonds that are left."""
    counts = bonds.start[rows + 1] - bonds.start[rows]
    which = (
        np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(bonds.start[rows], counts)
    )
    own, d = np.repeat(np.arange(len(rows)), counts), len(bonds.xi)
    w = np.where(broken[which] == 0, weight[which], 0.0).astype(float)
    xi = [x[which].astype(float) for x in bonds.xi]
    K = np.empty((len(rows), d, d))
    for a in range(d):
        for b in range(a, d):
            K[:, a, b] = K[:, b, a] = np.bincount(own, w * xi[a] * xi[b], minlength=len(rows))
    return K


def scale(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """How the resistance of nodes (n,) compares, N/m^4."""
    trace = law.inverse[:, :: law.d + 1].sum(axis=1)
    own = np.repeat(np.arange(len(trace)), np.diff(bonds.start))
    total = np.bincount(own, law.weight, minlength=len(trace))
    usual = np.median(trace * total)
    return np.asarray((law.solid.first + 2 * law.solid.shear) * usual + 0 * trace)


def rows(law: Law, dimension: int) -> int:
    """A, H, sigma (in the plane xx, yy, zz, xy), J."""
    return 2 * dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(law: Law, value: NDArray[np.floating], m: NDArray[np.floating]) -> dict[str, NDArray[np.float64]]:
    """As in `Operator`."""
    return shown(law.d, law.solid, m, law.d * law.d)


def shown(d: int, solid: Solid, m: NDArray[np.floating], at: int) -> dict[str, NDArray[np.float64]]:
    """Fields (n,) of nodes whose gradients are in m from `at` on: stress, rotation in the plane, J, alpha."""
    H, rest = m[:, at : at + d * d].astype(float), m[:, at + d * d :].astype(float)
    found = {"sxx": rest[:, 0], "syy": rest[:, 1], "sxy": rest[:, 3], "szz": rest[:, 2]}
    found["rotation"] = np.arctan2(H[:, d] - H[:, 1], 2 + H[:, 0] + H[:, d + 1])
    found["J"] = rest[:, 4 if d == 2 else 6]
    if solid.history.shape[1] and (solid.kind == J2).any():
        found["plastic"] = solid.history[:, ALPHA_RATE if solid.rate else ALPHA_TOTAL].astype(float)
    return found


def gather(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        d, w = len(bond.xi), law.weight[k]
        for a in range(d):
            for b in range(d):
                m[i, d * a + b] += w * bond.eta[a] * bond.xi[b]


def close(law, i, m):  # type: ignore[no-untyped-def]
    d = law.d
    g = d * d
    for a in range(d):
        for b in range(d):
            total = m[i, 0] * 0
            for c in range(d):
                total += m[i, d * a + c] * law.inverse[i, d * c + b]
            m[i, g + d * a + b] = total
    P = answer(law, i, m, g)
    for a in range(d):
        for b in range(d):
            total = m[i, 0] * 0
            for c in range(d):
                total += P[3 * a + c] * law.inverse[i, d * c + b]
                if law.wan:
                    total -= _wan(law, i, a, c) * m[i, g + d * c + b]
            m[i, d * a + b] = total - law.control[i] * m[i, g + d * a + b]


@njit(**INNER)
def answer(law, i, m, at):  # type: ignore[no-untyped-def]
    """P, nine, of the gradient in m[i] from `at` on; puts stress and J behind it."""
    d = law.d
    found = respond(law.solid, i, lifted(m, i, at, d))
    last = at + d * d
    for a in range(4 if d == 2 else 6):
        m[i, last + a] = found.sigma[a]
    F = found.F
    m[i, last + (4 if d == 2 else 6)] = (
        F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) + F[2] * (F[3] * F[7] - F[4] * F[6])
    )
    return found.P


@njit(**INNER)
def lifted(m, i, at, d):  # type: ignore[no-untyped-def]
    """The gradient in m[i] from `at` on, nine."""
    none = m[i, at] * 0
    if d == 2:
        return (m[i, at], m[i, at + 1], none, m[i, at + 2], m[i, at + 3], none, none, none, none)
    return (
        m[i, at],
        m[i, at + 1],
        m[i, at + 2],
        m[i, at + 3],
        m[i, at + 4],
        m[i, at + 5],
        m[i, at + 6],
        m[i, at + 7],
        m[i, at + 8],
    )


@njit(**INNER)
def _wan(law, i, a, b):  # type: ignore[no-untyped-def]
    """C : K^-1, one component of a node's."""
    found = 2 * law.solid.shear[i] * law.inverse[i, law.d * a + b]
    if a == b:
        first = law.solid.first[i]
        if law.solid.plane_stress:
            first *= 2 * law.solid.shear[i] / (first + 2 * law.solid.shear[i])
        for c in range(law.d):
            found += first * law.inverse[i, (law.d + 1) * c]
    return found


@njit(**INLINE)
def _component(law, bond, m, i, j, k, a):  # type: ignore[no-untyped-def]
    """One component of the force density of bond k on node i."""
    d = len(bond.xi)
    f = (law.control[i] + law.control[j]) * bond.eta[a]
    for b in range(d):
        f += (m[i, d * a + b] + m[j, d * a + b]) * bond.xi[b]
        if law.wan:
            f += (_wan(law, i, a, b) + _wan(law, j, a, b)) * bond.eta[b]
    return law.weight[k] * f


def pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        for a in range(len(bond.xi)):
            f[a] += _component(law, bond, m, i, j, k, a)


@njit(**INNER)
def principal(law, m, i, j, at):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two nodes' stresses, which are in m from `at` on."""
    if law.d == 2:
        none = m[i, at] * 0
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], none, none)
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], none, none)
    else:
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], m[i, at + 4], m[i, at + 5])
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], m[j, at + 4], m[j, at + 5])
    return largest(law.d, s, t)


@njit(**INNER)
def largest(d, s, t):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two stresses, six each; in the plane, of those in it."""
    xx, yy, zz, xy = (s[0] + t[0]) / 2, (s[1] + t[1]) / 2, (s[2] + t[2]) / 2, (s[3] + t[3]) / 2
    if d == 2:
        return (xx + yy) / 2 + np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    xz, yz = (s[4] + t[4]) / 2, (s[5] + t[5]) / 2
    q = (xx + yy + zz) / 3  # O. K. Smith, Commun. ACM 4 (1961) 168
    a, b, c = xx - q, yy - q, zz - q
    p = np.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p == 0:
        return q
    half = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (2 * p * p * p)
    return q + 2 * p * np.cos(np.arccos(min(1.0, max(-1.0, half))) / 3)


def alert(law, i, m):  # type: ignore[no-untyped-def]
    if law.failure == STRESS:  # the largest principal value is convex: of a mean, one end has no less
        return principal(law, m, i, i, 2 * law.d * law.d) > law.least
    return law.failure != NEVER


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return False
    if law.failure == STRESS:
        return principal(law, m, i, j, 2 * law.d * law.d) > law.limit[k]
    if bond.stretch <= 0:
        return False
    if law.failure == STRETCH:
        return bond.stretch > law.limit[k]
    along = bond.stretch * 0
    for a in range(len(bond.xi)):
        along += _component(law, bond, m, i, j, k, a) * (bond.xi[a] + bond.eta[a])
    return along * bond.stretch / bond.q > 2 * law.weight[k] * law.limit[k]


def remember(law, now, i, m):  # type: ignore[no-untyped-def]
    keep(law.solid, i, lifted(m, i, law.d * law.d, law.d))


def hold(law, i, m):  # type: ignore[no-untyped-def]
    return holds(law.solid, i, lifted(m, i, law.d * law.d, law.d))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    d, held = len(bond.xi), bond.stretch * 0
    for a in range(d):
        rest = deviation(bond, m, i, d * d, a)
        held += law.control[i] * rest * rest
        if law.wan:
            for b in range(d):
                held += _wan(law, i, a, b) * rest * deviation(bond, m, i, d * d, b)
    return law.weight[k] * held / 2, 0.0


@njit(**INNER)
def deviation(bond, m, i, at, a):  # type: ignore[no-untyped-def]
    """A component of eta - H xi, H in m[i] from `at` on."""
    rest = bond.eta[a]
    for b in range(len(bond.xi)):
        rest -= m[i, at + len(bond.xi) * a + b] * bond.xi[b]
    return rest
