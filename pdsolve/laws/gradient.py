"""What laws share that fit a gradient to a node's family: columns, fit, stress, failure, history and energy.

With w the neighbour's cell times its influence, K = sum w xi xi^T, the gradient of the displacement of a node is H =
(sum w eta xi^T) K^-1. `pdsolve.laws.correspondence` has the forces that follow.

A bond fails by the largest principal value of the mean of its ends' stresses, by its stretch, or by its energy, half of
its force times its elongation. A node whose intact bonds nearly lie on a line, or are gone, has no stress of its own;
only the control of deviations remains there. A family that has lost bonds can be stiffer than all families were at the
start: with g = w K^-1 xi, so that H = sum eta g^T, its stiffness goes as q = sum g^2 + (sum g)^2. Above the q of a
straight face along an axis, it has the share (q_face / q)^`POWER` of its stress; in a solid with a history, it has none
of it. H is still fitted there, so that the control resists no rotation. Torn families side by side can be `BESIDE`
times as stiff as one. That is no more than an intact body mostly is, so that the stable step stays the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_arrays import AnyList, Left, Tabled, left, list_of, shapes
from pdsolve.laws.calls import bond_force as force_of
from pdsolve.laws.calls import nodal_numbers as nodal_numbers_of
from pdsolve.laws.calls import numbers as numbers_of
from pdsolve.laws.law import INLINE, INNER
from pdsolve.laws.materials.orthotropic import crossing, equivalent, least_moduli
from pdsolve.laws.materials.solid import (
    ALPHA_RATE,
    ALPHA_TOTAL,
    J2,
    LINEAR,
    ORTHOTROPIC,
    SVK,
    SolidColumns,
    dissipated,
    elastic,
    energies,
    respond,
    solid_of,
    update_history_of,
)
from pdsolve.laws.materials.tensors import det
from pdsolve.laws.small_tensors import product, square
from pdsolve.model import Model

NEVER, STRETCH, ENERGY, STRESS = range(4)
FAILURES = {"stretch": STRETCH, "energy": ENERGY, "stress": STRESS}
BESIDE = 2.0  # largest eigenvalue of torn families over (lambda + 2 mu) q; measured 1.8 to 2.1 with default influences
POWER = 8  # with less, families just above the limit are stiffer side by side; with more, they differ by round-off
ROUND = 1e-4  # q of equal families differ by less, even in single precision
FLAT = 0.01  # least over sum of a family's moments: less is as good as a line
LINE = 1e-4  # likewise: less is a line, or single bonds, to round-off


class CorrespondenceColumns(NamedTuple):
    """Columns of n nodes and b bonds, in d dimensions."""

    inverse: NDArray[np.floating]  # (n, d d) K^-1, 0 where there is none
    share: NDArray[np.floating]  # (n,) of their stress that torn families have; 1 of intact ones
    control: NDArray[np.floating]  # (n,) Z of silling, N/m^6 in the plane
    weight: NDArray[np.floating]  # (b,) w, m^d
    limit: NDArray[np.floating]  # (b,) of the stretch, the energy or the stress, at which the bond fails
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    solid: SolidColumns
    history: NDArray[np.floating]  # that of the solid
    failure: int
    least: float  # the least limit of all
    d: int
    horizon: NDArray[np.float64]  # (n,) m
    # (1,) largest q, times the horizon squared, with which torn families have all of their stress
    stiffest: NDArray[np.float64]


def columns(model: Model, bonds: Bonds) -> CorrespondenceColumns:
    """Columns of these bonds (b,) and their nodes."""
    kind, d, nodes = bonds.xi.dtype, bonds.xi.shape[1], len(bonds.start) - 1
    source = bonds.source
    total = np.bincount(source, bonds.weight, minlength=nodes).astype(float)
    solid, first = solid_of(model, kind, d), model.materials[0]
    control = silling(model, total, d) if first.control == "silling" else np.zeros(nodes)
    law = CorrespondenceColumns(
        inverse=np.zeros((nodes, d * d), kind),
        share=np.zeros(nodes, kind),
        control=control.astype(kind),
        weight=bonds.weight,
        limit=bonds.limit,
        broken=np.zeros(len(bonds.limit), np.int32),
        solid=solid,
        history=solid.history,
        failure=FAILURES.get(first.failure, NEVER),
        least=float(bonds.limit.min(initial=np.inf)),
        d=d,
        horizon=np.broadcast_to(model.horizons, (nodes,)).astype(float),
        stiffest=np.full(1, np.inf),
    )
    every, listed = np.arange(nodes), list_of(bonds)
    update_after_breakage(law, listed, every)
    law.stiffest[0] = _largest_stiffness(law, listed) * (1 + ROUND)
    return law


def silling(model: Model, total: NDArray[np.float64], d: int) -> NDArray[np.float64]:
    """Z (n,) of nodes with these total weights (n,)."""
    horizon = np.broadcast_to(model.horizons, total.shape)
    E, G = least_moduli(model), model.node_values("control_factor")
    strength = 9 * E / (horizon**2) if d == 2 else 16 * E / (horizon**2)
    return np.divide(G * strength, total, out=np.zeros(len(total)), where=total > 0)


def update_after_breakage(law: CorrespondenceColumns, bonds: AnyList, rows: NDArray[np.int64]) -> None:
    """Recompute K^-1 and the share of the stress of these nodes (k,) from the intact bonds."""
    intact_bonds = left(bonds, law.weight, law.broken, rows)
    K = shapes(bonds, intact_bonds, len(rows))
    values, ways = np.linalg.eigh(K)
    total = values.sum(axis=1, keepdims=True)
    sound = values[:, 0] > FLAT * total[:, 0]
    torn = np.bincount(intact_bonds.own, law.broken[intact_bonds.which] != 0, minlength=len(rows)) > 0
    usable = torn[:, None] & (values > LINE * total)
    scaled = ways * np.divide(1.0, values, out=np.zeros_like(values), where=usable)[:, None, :]
    law.inverse[rows] = (scaled @ ways.transpose(0, 2, 1)).reshape(-1, law.d * law.d)
    law.inverse[rows[sound]] = np.linalg.inv(K[sound]).reshape(-1, law.d * law.d)
    law.share[rows] = sound
    if np.isfinite(law.stiffest[0]):
        share = (
            law.stiffest[0] / np.maximum(_stiffness(law, bonds, intact_bonds, rows), law.stiffest[0] or 1.0)
        ) ** POWER
        share = np.where(torn, np.floor(share) if law.solid.history.shape[1] else share, 1.0)
        law.share[rows[sound]] = share[sound]


def _largest_stiffness(law: CorrespondenceColumns, bonds: AnyList) -> float:
    """q, times the horizon squared, of a straight face along an axis, but no more than the largest at the start."""
    every = np.arange(len(law.share))
    q = _stiffness(law, bonds, left(bonds, law.weight, law.broken, every), every)
    sound = np.flatnonzero(law.share > 0)
    if not len(sound):
        return 0.0
    inner = sound[q[sound].argmin()]
    bond_range = slice(bonds.start[inner], bonds.start[inner + 1])
    xi, weight = np.column_stack([x[bond_range] for x in bonds.xi]).astype(float), law.weight[bond_range].astype(float)
    faces = [0.0]
    for side in (*np.eye(law.d), *-np.eye(law.d)):
        half = weight * (xi @ side >= -ROUND * law.horizon[inner])
        K = (half * xi.T) @ xi
        if np.linalg.eigvalsh(K)[0] > FLAT * np.trace(K):
            faces.append(stiffness_of(half[:, None] * xi @ np.linalg.inv(K)) * law.horizon[inner] ** 2)
    return min(float(q[sound].max()), max(faces) or np.inf)


def stiffness_of(g: NDArray[np.float64]) -> float:
    """q of a family whose gradient is the sum of eta g^T, g (k, d)."""
    return float((g**2).sum() + (g.sum(axis=0) ** 2).sum())


def _stiffness(
    law: CorrespondenceColumns, bonds: AnyList, intact_bonds: Left, rows: NDArray[np.int64]
) -> NDArray[np.float64]:
    """q times the horizon squared of these nodes (k,), from their intact bonds."""
    inverse = law.inverse[rows].astype(float).reshape(-1, law.d, law.d)
    xi = np.array([x[intact_bonds.which] for x in bonds.xi], dtype=float)
    g = intact_bonds.weight * np.einsum("kab,bk->ak", inverse[intact_bonds.own], xi)
    sums = np.array([np.bincount(intact_bonds.own, component, minlength=len(rows)) for component in g])
    q = np.bincount(intact_bonds.own, (g**2).sum(axis=0), minlength=len(rows)) + (sums**2).sum(axis=0)
    return np.asarray(q * law.horizon[rows] ** 2)


def torn_stiffness(law: CorrespondenceColumns, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bound of the stiffness (n,) of nodes that have lost bonds, N/m^4."""
    first, twice = (np.asarray(moduli, dtype=float) for moduli in (law.solid.first, 2 * law.solid.shear))
    if law.solid.plane_stress:
        first = first * twice / (first + twice)
    return np.asarray(BESIDE / 2 * (first + twice) * law.stiffest[0] / law.horizon**2)


def scale(law: CorrespondenceColumns, bonds: Bonds) -> NDArray[np.float64]:
    """Relative stiffness of nodes (n,), N/m^4."""
    trace = law.inverse[:, :: law.d + 1].sum(axis=1)
    total = np.bincount(bonds.source, law.weight, minlength=len(trace))
    usual = np.median(trace * total)
    return np.asarray((law.solid.first + 2 * law.solid.shear) * usual + 0 * trace)


def stress_fields(d: int, solid: SolidColumns, m: NDArray[np.floating], at: int) -> dict[str, NDArray[np.float64]]:
    """Fields (n,) of nodes with gradients in m from `at` on: stress, rotation in the plane, J, alpha."""
    H, rest = m[:, at : at + d * d].astype(float), m[:, at + d * d :].astype(float)
    field_columns = {"sxx": rest[:, 0], "syy": rest[:, 1], "sxy": rest[:, 3], "szz": rest[:, 2]}
    if d == 3:
        field_columns |= {"sxz": rest[:, 4], "syz": rest[:, 5]}
    else:
        field_columns["rotation"] = np.arctan2(H[:, d] - H[:, 1], 2 + H[:, 0] + H[:, d + 1])
    field_columns["J"] = rest[:, 4 if d == 2 else 6]
    if solid.history.shape[1] and (solid.kind == J2).any():
        field_columns["plastic"] = solid.history[:, ALPHA_RATE if solid.rate else ALPHA_TOTAL].astype(float)
    return field_columns


@njit(**INLINE)
def multiply_by_inverse(law, i, sums, products, at):  # type: ignore[no-untyped-def]
    """Store the `sums` (n, d d) of node i times its K^-1 in `products` (n, .) from the column `at` on."""
    d = law.d
    for a in range(d):
        for b in range(d):
            total = sums[i, 0] * 0
            for c in range(d):
                total += sums[i, d * a + c] * law.inverse[i, d * c + b]
            products[i, at + d * a + b] = total


@njit(**INLINE)
def piola_stress_from_sums(law, now, i, m, at):  # type: ignore[no-untyped-def]
    """Compute the gradient of node i from its sums; stores it in m[i] from `at` on, then stress and J; returns P."""
    multiply_by_inverse(law, i, m, m, at)
    return piola_stress(law, now, i, m, at)


@njit(**INLINE)
def piola_stress(law, now, i, m, at):  # type: ignore[no-untyped-def]
    """P, nine components, of the gradient in m[i] from `at` on; stores stress and J behind it."""
    d, share = law.d, law.share[i]
    last, none = at + d * d, m[i, at] * 0
    if share == 0:  # whose gradient may be any
        for a in range(4 if d == 2 else 6):
            m[i, last + a] = none
        m[i, last + (4 if d == 2 else 6)] = none + 1
        return (none, none, none, none, none, none, none, none, none)
    response = respond(law.solid, now.dt, i, lifted(m, i, at, d), none)
    for a in range(4 if d == 2 else 6):
        m[i, last + a] = share * response.sigma[a]
    F, P = response.F, response.P
    m[i, last + (4 if d == 2 else 6)] = (
        F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) + F[2] * (F[3] * F[7] - F[4] * F[6])
    )
    return (
        *(share * P[0], share * P[1], share * P[2], share * P[3], share * P[4]),
        *(share * P[5], share * P[6], share * P[7], share * P[8]),
    )


@njit(**INLINE)
def lifted(m, i, at, d):  # type: ignore[no-untyped-def]
    """The gradient in m[i] from `at` on, nine components."""
    none = m[i, at] * 0
    if d == 2:
        xx, xy, yx, yy = square(m, i, at, (none, none))
        return (xx, xy, none, yx, yy, none, none, none, none)
    return square(m, i, at, (none, none, none))


def watched(law: CorrespondenceColumns, columns: tuple[NDArray[np.floating], ...], nodal_count: int) -> Tabled:
    """These columns, with the limits for failure of single bonds."""
    if law.failure in (NEVER, STRESS):
        return Tabled(columns, tuple(range(len(columns))), nodal_count, False)
    limit = law.limit if law.failure == STRETCH else 2 * law.weight * law.limit
    return Tabled((*columns, limit), tuple(range(len(columns) + 1)), nodal_count, True)


def margin(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    """The stretch or energy of a bond and its limit."""
    f = force_of(law, bond, c, node_numbers, neighbour_numbers)
    along = f[0] * (bond.xi[0] + bond.eta[0]) + f[1] * (bond.xi[1] + bond.eta[1])
    failure_measure = along * bond.elongation * bond.inverse
    if law.failure == STRETCH:
        failure_measure = bond.stretch
    return failure_measure, c[len(c) - 1]


def by_lanes(law: CorrespondenceColumns) -> bool:
    """Whether nodes can be finished in lanes: all of one solid without a history."""
    kind = law.solid.kind
    return not law.solid.rate and bool((kind == kind[0]).all()) and kind[0] in (LINEAR, SVK)


@njit(**INLINE)
def finish_sums_of(law, sums, node_constants):  # type: ignore[no-untyped-def]
    """Gradient of a node, P and stress, four components each, and J, from its sums and constants."""
    H, none, share, any_share = product(sums, node_constants[:4]), sums[0] * 0.0, node_constants[6], node_constants[7]
    h = (any_share * H[0], any_share * H[1], none, any_share * H[2], any_share * H[3], none, none, none, none)
    response = elastic(law.solid.kind[0], h, node_constants[4], node_constants[5], law.solid.plane_stress)
    P, s = response.P, response.sigma
    P = (share * P[0], share * P[1], share * P[3], share * P[4])
    return H, P, (share * s[0], share * s[1], share * s[2], share * s[3]), det(response.F)


@njit(**INNER)
def may_fail_at(law, i, m, at):  # type: ignore[no-untyped-def]
    """Whether a bond of node i may fail, given its stress in m from `at` on."""
    if law.failure == STRESS:  # the largest principal value is convex: of a mean, one end has no less
        return _failure_stress(law, m, i, at) > law.least
    return law.failure != NEVER


@njit(**INLINE)
def fails_by_stretch_or_stress(law, bond, m, i, j, k, at):  # type: ignore[no-untyped-def]
    """Whether a bond fails by stress, given the stresses in m from `at` on, or by stretch."""
    if law.broken[k] != 0:
        return False
    if law.failure == STRESS:
        if len(law.solid.ply) == 0:
            return principal(law, m, i, j, at) > law.limit[k]
        of_ends = _failure_stress_across(law, bond, m, i, at) + _failure_stress_across(law, bond, m, j, at)
        return of_ends / 2 > law.limit[k]
    return law.failure == STRETCH and bond.stretch > 0 and bond.stretch > law.limit[k]


@njit(**INLINE)
def fails_at(law, bond, m, i, j, k, at):  # type: ignore[no-untyped-def]
    """Whether a bond fails, given the stresses in m from `at` on."""
    if law.failure != ENERGY or law.broken[k] != 0 or bond.stretch <= 0:
        return fails_by_stretch_or_stress(law, bond, m, i, j, k, at)
    c = numbers_of(law, i, j, k)
    node_numbers, neighbour_numbers = nodal_numbers_of(law, bond.xi, m, i), nodal_numbers_of(law, bond.xi, m, j)
    f, along = force_of(law, bond, c, node_numbers, neighbour_numbers), bond.stretch * 0
    for a in range(len(bond.xi)):
        along += f[a] * (bond.xi[a] + bond.eta[a])
    return along * bond.stretch / bond.q > 2 * law.weight[k] * law.limit[k]


@njit(**INNER)
def update_history_at(law, now, i, m, at, deviation_square):  # type: ignore[no-untyped-def]
    """Update the history of node i by the gradient in m[i] from `at` on; a node without stress has none."""
    if law.share[i] != 0:
        update_history_of(law.solid, now.dt, i, lifted(m, i, at, law.d), deviation_square)


@njit(**INNER)
def nodal_energy_at(law, now, i, m, at, deviation_square):  # type: ignore[no-untyped-def]
    """Energy densities, J/m^3, that node i stores and has dissipated, with the gradient in m[i] from `at` on."""
    if law.share[i] == 0:
        return m[i, 0] * 0, m[i, 0] * 0 + dissipated(law.solid, i)
    strain_energy, spent = energies(law.solid, now.dt, i, lifted(m, i, at, law.d), deviation_square)
    return law.share[i] * strain_energy, spent


@njit(**INNER)
def deviation(bond, m, i, at, a):  # type: ignore[no-untyped-def]
    """A component of eta - H xi, with H in m[i] from `at` on."""
    rest = bond.eta[a]
    for b in range(len(bond.xi)):
        rest -= m[i, at + len(bond.xi) * a + b] * bond.xi[b]
    return rest


@njit(**INNER)
def principal(law, m, i, j, at):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two nodes' stresses, given in m from `at` on."""
    if law.d == 2:
        none = m[i, at] * 0
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], none, none)
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], none, none)
    else:
        s = (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3], m[i, at + 4], m[i, at + 5])
        t = (m[j, at], m[j, at + 1], m[j, at + 2], m[j, at + 3], m[j, at + 4], m[j, at + 5])
    return largest(law.d, s, t)


@njit(**INNER)
def _failure_stress(law, m, i, at):  # type: ignore[no-untyped-def]
    """The stress of a node, given in m from `at` on, by which some of its bonds fail."""
    if law.solid.kind[i] != ORTHOTROPIC:
        return principal(law, m, i, i, at)
    fibres, matrix = equivalent(law.solid.ply[i], law.d, m[i], at)
    return max(fibres, matrix)


@njit(**INNER)
def _failure_stress_across(law, bond, m, i, at):  # type: ignore[no-untyped-def]
    """The stress of a node by which a bond fails; the less it crosses the fibres, the more the matrix may have."""
    if law.solid.kind[i] == ORTHOTROPIC:
        fibres, matrix = equivalent(law.solid.ply[i], law.d, m[i], at)
        return max(fibres, matrix * crossing(law.solid.ply[i], bond.xi))
    return _failure_stress(law, m, i, at)


@njit(**INNER)
def largest(d, s, t):  # type: ignore[no-untyped-def]
    """The largest principal value of the mean of two stresses, six components each; in the plane, of in-plane ones."""
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
