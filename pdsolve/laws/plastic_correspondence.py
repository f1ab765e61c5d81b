"""Correspondence of solids that flow: the control of zero-energy modes yields with its node.

A control that stays elastic makes bodies stronger the further they flow, wherever the plastic strain varies. Here a
bond's deviation z = eta - H xi (`pdsolve.laws.correspondence`) has a plastic part p. With F = I + H = R U, and Z the
control tensor of the node (silling: a multiple of I; wan: C : K^-1), elastic deviations and their energy density are

    y = R^T z - p        psi = sum w y . Z y / 2

The node yields by |s|^2 + ease 4 mu psi, the return to the yield surface scales y by c (`pdsolve.laws.materials.j2`),
and p grows by (1 - c) y. This is associated flow: the tangent is symmetric, and the energy dissipated is the integral
of the yield stress over alpha. While a node flows, its control is as strong, over the secant stiffness of the solid, as
silling's with a factor of 1/8 (`FLOWING`). R is I in solids for small strains; in others, the derivative of psi through
R adds R [g] to P, as in `pdsolve.laws.wan`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds, find
from pdsolve.laws import gradient
from pdsolve.laws.bond_arrays import AnyList, deformed, left, reference
from pdsolve.laws.gradient import fails_at, lifted, nodal_energy_at, update_history_at
from pdsolve.laws.law import INNER, Failure, Law, NodeHistory, Sums
from pdsolve.laws.materials.solid import NEO_HOOKE, ORTHOTROPIC, SVK, SolidColumns, respond
from pdsolve.laws.materials.tensors import (
    contracted,
    det,
    difference,
    full,
    grown,
    inverse,
    rotation,
    symmetric,
    transposed,
)
from pdsolve.laws.small_tensors import blank_moments, mapped, mapped_both, product, square, summed, with_moments
from pdsolve.model import Model

LINEAR_PART = 1e-5  # of the terms of a sum: more is not round-off, even in single precision


class PlasticCorrespondenceColumns(NamedTuple):
    """Columns of n nodes and b bonds, in d dimensions."""

    inverse: NDArray[np.floating]  # (n, d d) K^-1, 0 where there is none
    share: NDArray[np.floating]  # (n,) of the stress, 1 or 0 of nodes that have lost bonds, as in `correspondence`
    whole: NDArray[np.floating]  # (n, d d) Z of the family at the start, N/m^6 in the plane
    control: NDArray[np.floating]  # (n, d d) likewise, 0 of nodes that have lost bonds and have no stress
    weight: NDArray[np.floating]  # (b,) w, m^d
    slip: NDArray[np.floating]  # (d, b) p, the plastic part of a deviation, m, unrotated
    slips: tuple[NDArray[np.floating], ...]  # its rows
    back: NDArray[np.int64]  # (b,) the bond the other way
    limit: NDArray[np.floating]  # (b,) of the stretch, the energy or the stress, at which the bond fails
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    solid: SolidColumns
    history: NDArray[np.floating]  # that of the solid
    failure: int
    least: float  # the least limit of all
    horizon: NDArray[np.float64]  # (n,) m
    stiffest: NDArray[np.float64]  # (1,) as in `correspondence`
    d: int


def columns(model: Model, bonds: Bonds) -> PlasticCorrespondenceColumns:
    """Columns of these bonds (b,) and their nodes."""
    elastic, source, slip = gradient.columns(model, bonds), bonds.source, np.zeros_like(bonds.xi.T, order="C")
    shared = {name: getattr(elastic, name) for name in PlasticCorrespondenceColumns._fields if hasattr(elastic, name)}
    d, unit = elastic.d, np.eye(elastic.d).ravel()
    if model.materials[0].control != "wan":
        initial_control = np.asarray(elastic.control[:, None] * unit, elastic.control.dtype)
    else:
        first, twice = elastic.solid.first, 2 * elastic.solid.shear
        if elastic.solid.plane_stress:
            first = first * twice / (first + twice)
        trace = first * elastic.inverse[:, :: d + 1].sum(axis=1)
        initial_control = np.asarray(trace[:, None] * unit + twice[:, None] * elastic.inverse, elastic.control.dtype)
    return PlasticCorrespondenceColumns(
        **shared
        | {
            "whole": initial_control,
            "control": initial_control.copy(),
            "slip": slip,
            "slips": tuple(slip),
            "back": find(bonds, bonds.neighbour.astype(np.int64), source),
        }
    )


def update_after_breakage(law: PlasticCorrespondenceColumns, bonds: AnyList, rows: NDArray[np.int64]) -> None:
    """Recompute K^-1 and Z of these nodes (k,) from the intact bonds, and what of p has no linear part of theirs."""
    gradient.update_after_breakage(law, bonds, rows)  # type: ignore[arg-type]
    intact_bonds, d = left(bonds, law.weight, law.broken, rows), law.d
    torn = np.bincount(intact_bonds.own, law.broken[intact_bonds.which] != 0, minlength=len(rows)) > 0
    without = rows[torn & (law.share[rows] == 0)]
    law.control[rows], law.control[without], law.inverse[without] = law.whole[rows], 0, 0
    xi, slip = (np.array([x[intact_bonds.which] for x in of], dtype=float) for of in (bonds.xi, law.slips))
    sums, sizes = np.empty((2, len(rows), d, d))
    for a in range(d):
        for b in range(d):
            terms = intact_bonds.weight * slip[a] * xi[b]
            sums[:, a, b] = np.bincount(intact_bonds.own, terms, minlength=len(rows))
            sizes[:, a, b] = np.bincount(intact_bonds.own, np.abs(terms), minlength=len(rows))
    # p without a linear part stays to the bit, as in runs that go on
    has_linear_part = np.asarray(np.abs(sums) > LINEAR_PART * sizes).any(axis=(1, 2))
    linear = np.where(np.reshape(has_linear_part, (-1, 1, 1)), sums @ law.inverse[rows].reshape(-1, d, d), 0.0)[
        intact_bonds.own
    ]
    law.slip[:, intact_bonds.which] = slip - np.einsum("kab,bk->ak", linear, xi)


def width(law: PlasticCorrespondenceColumns, dimension: int) -> int:
    """Width of `m`: A, c R Z R^T, c R Z, and H, sigma, J as in `correspondence`, c, 4 mu psi."""
    return 4 * dimension**2 + (4 if dimension == 2 else 6) + 3


def fields(
    law: PlasticCorrespondenceColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """Stored fields (n,) by result column: stress, rotation, volume and the solid's history."""
    return gradient.stress_fields(law.d, law.solid, m, 3 * law.d * law.d)


def numbers(law, i, j, k):  # type: ignore[no-untyped-def]
    return law.weight[k], reference(law.slips, k), reference(law.slips, law.back[k])


def initial_sums(law, xi, none):  # type: ignore[no-untyped-def]
    return blank_moments(xi, none)


def accumulate(law, bond, c, sums):  # type: ignore[no-untyped-def]
    return with_moments(sums, c[0], bond.eta, bond.xi, c[1])


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    d = law.d
    g = d * d
    back, Z = lifted(law.inverse, i, 0, d), lifted(law.control, i, 0, d)
    S, B, D, C = _moments(m, i, d)
    h = product(S, back)
    R = _rotation(law, i, h)
    M = product(transposed(R), product(difference(full(B), full(symmetric(product(S, transposed(h))))), R))
    D = product(D, R)
    E = difference(summed(M, full(C)), summed(D, transposed(D)))  # sum of w y y^T
    deviation_square = 2 * law.solid.shear[i] * contracted(symmetric(Z), symmetric(E))
    if deviation_square.real < 0:  # round-off of sums that cancel
        deviation_square *= 0
    P = _put_response(law, now, i, m, 3 * g, h, deviation_square)
    c = m[i, _behind(law)]
    if _turns(law, i):
        N = product(Z, difference(M, D))
        U, none = symmetric(product(transposed(R), grown(h))), h[0] * 0
        G = inverse(full((U[1] + U[2], U[0] + U[2], U[0] + U[1], -U[3], -U[4], -U[5])))
        t = (c * (N[5] - N[7]), c * (N[6] - N[2]), c * (N[1] - N[3]))
        x = G[0] * t[0] + G[1] * t[1] + G[2] * t[2]
        y = G[3] * t[0] + G[4] * t[1] + G[5] * t[2]
        z = G[6] * t[0] + G[7] * t[1] + G[8] * t[2]
        P = summed(P, product(R, (none, -z, y, z, none, -x, -y, x, none)))
    RZ = product(R, Z)
    Y = product(RZ, transposed(R))
    A = difference(product(P, back), _scaled(c, product(Y, h)))
    for a in range(d):
        for b in range(d):
            m[i, d * a + b] = A[3 * a + b]
            m[i, g + d * a + b] = c * Y[3 * a + b]
            m[i, 2 * g + d * a + b] = c * RZ[3 * a + b]


@njit(**INNER)
def _moments(m, i, d):  # type: ignore[no-untyped-def]
    """Sums of w eta xi^T, w eta eta^T, w p eta^T and w p p^T of a node: nine, six, nine and six components."""
    none = m[i, 0] * 0
    if d == 2:
        B, C = (m[i, 4], m[i, 6], none, m[i, 5], none, none), (m[i, 11], m[i, 13], none, m[i, 12], none, none)
        return lifted(m, i, 0, d), B, lifted(m, i, 7, d), C
    B = (m[i, 9], m[i, 10], m[i, 11], m[i, 12], m[i, 13], m[i, 14])
    C = (m[i, 24], m[i, 25], m[i, 26], m[i, 27], m[i, 28], m[i, 29])
    return lifted(m, i, 0, d), B, lifted(m, i, 15, d), C


@njit(**INNER)
def _turns(law, i):  # type: ignore[no-untyped-def]
    """Whether the solid of node i is for large rotations."""
    kind = law.solid.kind[i]
    return law.solid.rate or kind in (SVK, NEO_HOOKE, ORTHOTROPIC)


@njit(**INNER)
def _rotation(law, i, h):  # type: ignore[no-untyped-def]
    """R of node i, nine components."""
    if _turns(law, i):
        return rotation(grown(h))
    none = h[0] * 0
    unit = none + 1
    return (unit, none, none, none, unit, none, none, none, unit)


@njit(**INNER)
def _scaled(c, A):  # type: ignore[no-untyped-def]
    return (c * A[0], c * A[1], c * A[2], c * A[3], c * A[4], c * A[5], c * A[6], c * A[7], c * A[8])


@njit(**INNER)
def _put_response(law, now, i, m, at, h, deviation_square):  # type: ignore[no-untyped-def]
    """Respond to the gradient h; stores it in m[i] from `at` on, then stress, J, c and `deviation_square`."""
    d, response, share = law.d, respond(law.solid, now.dt, i, h, deviation_square), law.share[i]
    for a in range(d):
        for b in range(d):
            m[i, at + d * a + b] = h[3 * a + b]
    at += d * d
    for a in range(4 if d == 2 else 6):
        m[i, at + a] = share * response.sigma[a]
    at += 4 if d == 2 else 6
    m[i, at], m[i, at + 1], m[i, at + 2] = (
        det(response.F),
        1 / (1 + law.solid.ease * response.flow * share),
        deviation_square,
    )
    return _scaled(share, response.P)


def nodal_numbers(law, xi, m, i):  # type: ignore[no-untyped-def]
    g = len(xi) * len(xi)
    return square(m, i, 0, xi), square(m, i, g, xi), square(m, i, 2 * g, xi)


def bond_force(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    w, p, q = c
    f = mapped_both(
        w,
        summed(node_numbers[0], neighbour_numbers[0]),
        bond.xi,
        summed(node_numbers[1], neighbour_numbers[1]),
        bond.eta,
    )
    return summed(f, summed(mapped(-w, node_numbers[2], p, w * 0, p), mapped(w, neighbour_numbers[2], q, w * 0, q)))


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return gradient.may_fail_at(law, i, m, 4 * law.d * law.d)


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return fails_at(law, bond, m, i, j, k, 4 * law.d * law.d)


@njit(**INNER)
def _behind(law):  # type: ignore[no-untyped-def]
    """Position of c in `m`; 4 mu psi follows it."""
    return 4 * law.d * law.d + (5 if law.d == 2 else 7)


def update_history(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    d, at = law.d, _behind(law)
    h = lifted(m, i, 3 * d * d, d)
    if m[i, at] < 1:
        back = transposed(_rotation(law, i, h))
        for k in range(bonds.start[i], bonds.start[i + 1]):
            bond = deformed(bonds, now.value, i, bonds.neighbour[k], k)
            for a in range(d):
                y = -law.slip[a, k]
                for b in range(d):
                    z = bond.eta[b]
                    for c in range(d):
                        z -= h[3 * b + c] * bond.xi[c]
                    y += back[3 * a + b] * z
                law.slip[a, k] += (1 - m[i, at]) * y
    update_history_at(law, now, i, m, 3 * d * d, m[i, at + 1])


def nodal_energy(law, now, i, m):  # type: ignore[no-untyped-def]
    return nodal_energy_at(law, now, i, m, 3 * law.d * law.d, m[i, _behind(law) + 1])


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    d, deviation_energy = len(bond.xi), bond.stretch * 0
    g, c = d * d, m[i, _behind(law)]
    for a in range(d):
        for b in range(d):
            z, p = gradient.deviation(bond, m, i, 3 * g, a), law.slip[a, k]
            deviation_energy += c * m[i, g + d * a + b] * z * gradient.deviation(bond, m, i, 3 * g, b)
            deviation_energy -= 2 * c * m[i, 2 * g + d * a + b] * z * law.slip[b, k]
            deviation_energy += c * c * law.control[i, d * a + b] * p * law.slip[b, k]
    return law.weight[k] * deviation_energy / 2, 0.0


LAW = Law(
    columns_type=PlasticCorrespondenceColumns,
    columns=columns,
    passes=Sums(numbers, initial_sums, accumulate, finish_pass, nodal_numbers, bond_force),
    energy=energy,
    width=width,
    scale=gradient.scale,
    failure=Failure(may_fail, fails),
    nodes=NodeHistory(("history", "slip"), update_history, nodal_energy),
    update_after_breakage=update_after_breakage,
    torn_stiffness=gradient.torn_stiffness,
    fields=fields,
)
