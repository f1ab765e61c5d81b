"""Correspondence with gradients of higher order: those of the polynomial fitted to a node's family.

With w the neighbour's cell times its influence and p monomials of xi up to some degree, over the horizon, the fit is c
= argmin sum w |eta - c p(xi)|^2, by QR: sqrt(w) p = Q R. With the constant term, the node itself is part of its family,
with the weight of its nearest neighbour, and the polynomial need not pass through it. The gradient H is linear in eta,
H = sum_r a_r t_r^T with the components a_r = sum sqrt(w) Q_r eta of the displacement and t_r from R^-1. The force from
a stress P is

    T_ij = sqrt(w) sum_r (P t_r - Z a_r) Q_r + Z w eta        f = sum T_ij - V_j / V_i T_ji

where Z (`pdsolve.laws.correspondence`) controls the part that the polynomial does not fit. First order without the
constant term is the law of that file. A family that cannot determine the order, as beside a crack, has the highest
possible one. One that has lost bonds has the highest one with which it is no stiffer than `BESIDE` allows at the stable
step of the start, or than a family of first order at the start; stiffer ones of first order have a share of their
stress, as in that file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds, find
from pdsolve.laws import gradient
from pdsolve.laws.bond_arrays import AnyList, list_of
from pdsolve.laws.gradient import BESIDE, ENERGY, FAILURES, NEVER, POWER, ROUND
from pdsolve.laws.law import INLINE, INNER, Failure, Law, NodeHistory, Passes
from pdsolve.laws.materials.solid import SolidColumns, solid_of
from pdsolve.model import Model, ModelError

CARRIED = 1e-5  # of the largest diagonal entry of R: with less, a family does not tell a monomial from others


class HigherOrderCorrespondenceColumns(NamedTuple):
    """Columns of n nodes and b bonds, in d dimensions, with p components of a fit."""

    q: NDArray[np.floating]  # (b, p) Q
    own: NDArray[np.floating]  # (n, p) Q of the node itself, with the constant term
    t: NDArray[np.floating]  # (n, p, d) t_r, 1/m; 0 from the order on that is not carried
    root: NDArray[np.floating]  # (b,) sqrt(w)
    back: NDArray[np.int64]  # (b,) the bond the other way
    control: NDArray[np.floating]  # (n,) Z
    weight: NDArray[np.floating]  # (b,) w, m^d
    itself: NDArray[np.floating]  # (n,) sqrt(w) of the node itself, 0 without the constant term
    limit: NDArray[np.floating]  # (b,)
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    solid: SolidColumns
    history: NDArray[np.floating]
    horizon: NDArray[np.float64]  # (n,) m
    failure: int
    least: float
    order: int
    carried: NDArray[np.int64]  # (n,) the order that each node's family carries
    share: NDArray[np.floating]  # (n,) of the stress, as in `correspondence`
    stiffest: NDArray[np.float64]  # (1,) largest q, times the horizon squared, of families that have lost bonds
    d: int


def columns(model: Model, bonds: Bonds) -> HigherOrderCorrespondenceColumns:
    """Columns of these bonds (b,) and their nodes. Raises ModelError for an order that no family can determine."""
    kind, d, nodes = bonds.xi.dtype, bonds.xi.shape[1], len(bonds.start) - 1
    source, first = bonds.source, model.materials[0]
    total = np.bincount(source, bonds.weight, minlength=nodes).astype(float)
    solid, constant = solid_of(model, kind, d), first.constant_term
    wide = len(powers(first.order, d)) + constant
    back = find(bonds, bonds.neighbour.astype(np.int64), source)
    itself = np.zeros(nodes)
    if constant:
        np.maximum.at(itself, bonds.neighbour, np.sqrt(bonds.weight))
    law = HigherOrderCorrespondenceColumns(
        q=np.zeros((len(source), wide), kind),
        own=np.zeros((nodes, wide), kind),
        t=np.zeros((nodes, wide, d), kind),
        root=np.sqrt(bonds.weight),
        back=back,
        control=(gradient.silling(model, total, d) if first.control == "silling" else np.zeros(nodes)).astype(kind),
        weight=bonds.weight,
        itself=itself.astype(kind),
        limit=bonds.limit,
        broken=np.zeros(len(bonds.limit), np.int32),
        solid=solid,
        history=solid.history,
        horizon=np.broadcast_to(model.horizons, (nodes,)).copy(),
        failure=FAILURES.get(first.failure, NEVER),
        least=float(bonds.limit.min(initial=np.inf)),
        order=first.order,
        carried=np.zeros(nodes, np.int64),
        share=np.zeros(nodes, kind),
        stiffest=np.full(1, np.inf),
        d=d,
    )
    every, listed = np.arange(nodes), list_of(bonds)
    first_order = _refit(law._replace(order=1), listed, every)
    law.stiffest[0] = max(_refit(law, listed, every) / BESIDE, first_order) * (1 + ROUND)
    if nodes and law.carried.max() < first.order:
        raise ModelError(
            f"{model.place_of(0)}.order is {first.order}; use {law.carried.max()} at most, which is what families"
            f" of a horizon of {model.settings.horizon.ratio:g} spacings carry"
        )
    return law


def powers(order: int, d: int) -> NDArray[np.int64]:
    """Exponents (p, d) of all monomials up to an order, without the constant one, by degree."""
    every = np.stack(np.meshgrid(*[np.arange(order + 1)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    degree = every.sum(axis=1)
    allowed = np.flatnonzero((degree > 0) & (degree <= order))
    return every[allowed[np.lexsort((*(-every[allowed].T[::-1]), degree[allowed]))]]


def fit(
    xi: NDArray[np.float64], root: NDArray[np.float64], order: int, itself: float, horizon: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Q (k, p) and t (p, d) of a family with bonds `xi` (k, d) and roots of weights (k,), and its possible order.

    With a weight of the node `itself`, Q has its row last, and the constant term is the first of the components.
    """
    d, constant = xi.shape[1], itself > 0
    e, points, roots = powers(order, d), xi / horizon, root
    if constant:
        points, roots = np.vstack([points, np.zeros((1, d))]), np.append(root, itself)
    monomials = (points[:, None, :] ** e).prod(axis=2)
    if constant:
        monomials = np.column_stack([np.ones(len(points)), monomials])
    degree = np.concatenate([np.zeros(int(constant), dtype=np.int64), e.sum(axis=1)])
    wide = monomials.shape[1]
    Q, t = np.zeros((len(points), wide)), np.zeros((wide, d))
    for carried in range(order, 0, -1):
        p = int((degree <= carried).sum())
        if p > len(points):
            continue
        basis, R = np.linalg.qr(roots[:, None] * monomials[:, :p])
        if np.abs(np.diag(R)).min() > CARRIED * np.abs(np.diag(R)).max():
            Q[:, :p], t[:p] = basis, np.linalg.inv(R)[constant : constant + d].T / horizon
            return Q, t, carried
    return Q, t, 0


def update_after_breakage(law: HigherOrderCorrespondenceColumns, bonds: AnyList, rows: NDArray[np.int64]) -> None:
    """Refit these nodes (k,) to the intact bonds."""
    _refit(law, bonds, rows)


def _refit(law: HigherOrderCorrespondenceColumns, bonds: AnyList, rows: NDArray[np.int64]) -> float:
    """Refit these nodes (k,) to the intact bonds; returns q times the horizon squared of the stiffest."""
    most = 0.0
    for i in rows.tolist():
        bond_range = slice(bonds.start[i], bonds.start[i + 1])
        intact = law.broken[bond_range] == 0
        xi = np.column_stack([x[bond_range][intact] for x in bonds.xi]).astype(float)
        root, itself, order = law.root[bond_range][intact].astype(float), float(law.itself[i]), law.order
        limit = np.inf if intact.all() else law.stiffest[0]
        while True:
            Q, t, order = fit(xi, root, order, itself, law.horizon[i])
            q = gradient.stiffness_of(root[:, None] * (Q[: len(xi)] @ t)) * law.horizon[i] ** 2
            if q <= limit or order == 1:
                break
            order -= 1
        if order == 0 and not intact.all():
            linear, roots = xi / law.horizon[i], root
            if itself > 0:
                linear, roots = np.vstack([linear, np.zeros((1, xi.shape[1]))]), np.append(root, itself)
                linear = np.column_stack([np.ones(len(linear)), linear])
            U, sizes, _ = np.linalg.svd(roots[:, None] * linear, full_matrices=False)
            Q = np.asarray(U[:, sizes > CARRIED * sizes.max(initial=0.0)])
        share = 0.0 if order == 0 else 1.0 if q <= limit else (limit / q) ** POWER
        law.share[i] = np.floor(share) if law.history.shape[1] else share
        most = max(most, q)
        law.carried[i] = order
        law.q[bond_range] = law.own[i] = law.t[i] = 0
        law.q[bond_range][intact, : Q.shape[1]] = Q[: len(xi)]
        law.own[i, : Q.shape[1]] = Q[len(xi)] if len(Q) > len(xi) else 0
        law.t[i, : len(t)] = t
    return most


def scale(law: HigherOrderCorrespondenceColumns, bonds: Bonds) -> NDArray[np.float64]:
    """Relative stiffness of nodes (n,), N/m^4."""
    return np.asarray((law.solid.first + 2 * law.solid.shear) / law.horizon**2)


def rows(law: HigherOrderCorrespondenceColumns, dimension: int) -> int:
    """Width of `m`: force components, a_r, H, sigma, J."""
    return 2 * dimension * int(law.q.shape[1]) + dimension**2 + (4 if dimension == 2 else 6) + 1


def fields(
    law: HigherOrderCorrespondenceColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """Stored fields (n,) by result column: stress, rotation, volume and the solid's history."""
    return gradient.stress_fields(law.d, law.solid, m, 2 * law.d * law.q.shape[1])


def first_pass(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        d, p = len(bond.xi), law.q.shape[1]
        for r in range(p):
            w = law.root[k] * law.q[k, r]
            for a in range(d):
                m[i, d * (p + r) + a] += w * bond.eta[a]


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    d, p = law.d, law.q.shape[1]
    at = 2 * d * p
    for a in range(d):
        for b in range(d):
            total = m[i, 0] * 0
            for r in range(p):
                total += m[i, d * (p + r) + a] * law.t[i, r, b]
            m[i, at + d * a + b] = total
    P = gradient.piola_stress(law, now, i, m, at)
    z = law.control[i]
    for r in range(p):
        for a in range(d):
            total = -z * m[i, d * (p + r) + a]
            for b in range(d):
                total += P[3 * a + b] * law.t[i, r, b]
            m[i, d * r + a] = total


@njit(**INLINE)
def _component(law, bond, m, i, j, k, a):  # type: ignore[no-untyped-def]
    """Component a of the force density of bond k on node i, N/m^3."""
    d, f, reverse_bond = len(bond.xi), m[i, 0] * 0, law.back[k]
    g = m[i, 0] * 0
    for r in range(law.q.shape[1]):
        f += m[i, d * r + a] * law.q[k, r]
        g += m[j, d * r + a] * law.q[reverse_bond, r]
    w, v = law.weight[k], law.weight[reverse_bond]
    z = w * (law.control[i] + law.control[j]) * bond.eta[a]
    return law.root[k] * f + z - w / v * law.root[reverse_bond] * g


def accumulate_bond_force(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        for a in range(len(bond.xi)):
            f[a] += _component(law, bond, m, i, j, k, a)


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return gradient.may_fail_at(law, i, m, _stresses(law))


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.failure != ENERGY or law.broken[k] != 0 or bond.stretch <= 0:
        return gradient.fails_by_stretch_or_stress(law, bond, m, i, j, k, _stresses(law))
    along = bond.stretch * 0
    for a in range(len(bond.xi)):
        along += _component(law, bond, m, i, j, k, a) * (bond.xi[a] + bond.eta[a])
    return along * bond.stretch / bond.q > 2 * law.weight[k] * law.limit[k]


@njit(**INNER)
def _stresses(law):  # type: ignore[no-untyped-def]
    """Position of stresses in `m`."""
    return 2 * law.d * law.q.shape[1] + law.d * law.d


def update_history(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    gradient.update_history_at(law, now, i, m, _stresses(law) - law.d * law.d, m[i, 0] * 0)


def nodal_energy(law, now, i, m):  # type: ignore[no-untyped-def]
    strain_energy, spent = gradient.nodal_energy_at(law, now, i, m, _stresses(law) - law.d * law.d, m[i, 0] * 0)
    if law.itself[i] > 0:
        for a in range(law.d):
            missed = _missed(law, m, i, law.own[i], law.itself[i], strain_energy * 0, a)
            strain_energy += law.control[i] * missed * missed / 2
    return strain_energy, spent


@njit(**INNER)
def _missed(law, m, i, q, root, eta, a):  # type: ignore[no-untyped-def]
    """sqrt(w) times a component of the residual of node i's polynomial."""
    d, p = law.d, law.q.shape[1]
    rest = root * eta
    for r in range(p):
        rest -= q[r] * m[i, d * (p + r) + a]
    return rest


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    square_sum = bond.stretch * 0
    for a in range(len(bond.xi)):
        missed = _missed(law, m, i, law.q[k], law.root[k], bond.eta[a], a)
        square_sum += missed * missed
    return law.control[i] * square_sum / 2, 0.0


LAW = Law(
    columns_type=HigherOrderCorrespondenceColumns,
    columns=columns,
    passes=Passes(accumulate_bond_force, first_pass, finish_pass),
    energy=energy,
    width=rows,
    scale=scale,
    failure=Failure(may_fail, fails),
    nodes=NodeHistory(("history",), update_history, nodal_energy),
    update_after_breakage=update_after_breakage,
    torn_stiffness=gradient.torn_stiffness,
    fields=fields,
)
