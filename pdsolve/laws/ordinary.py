"""A linear ordinary state-based solid of any Poisson's ratio.

S. A. Silling, M. Epton, O. Weckner, J. Xu, E. Askari, J. Elast. 88 (2007) 151-184, section 15, with bond weights that
make it exact for incomplete families, in the way of J. A. Mitchell, S. A. Silling, D. J. Littlewood, J. Mech. Mater.
Struct. 10 (2015) 539-557 (position-aware linear solid). In d dimensions, per unit thickness in the plane, the energy
density of node i is

    W = K theta^2 / 2 + mu sum S_ij (e - theta |xi| / d)^2        theta = sum D_ij e        e = |xi + eta| - |xi|

with the bulk modulus K (in the plane E / 2 (1 - nu) for plane stress and lambda + mu for plane strain) and the shear
modulus mu. With w the neighbour's cell times its influence and n = xi / |xi|, the weights are

    D_ij = w |xi| (n . B n)        such that theta is the trace of any uniform strain
    S_ij = w sum A_ab y_a y_b      such that the rest of W is mu times the square of any traceless one

where y are the components of n n^T in a basis of traceless tensors, and B, A the smallest that satisfy it. The S of a
bond is at least a tenth of the mean. Where this raises some, all of the node are scaled down so that W is right in the
mean of all traceless strains. This happens at edges and corners of bodies, where no positive weights are exact. In a
full family the weights are d w |xi| / m and d (d + 2) w / 2 m, m = sum w |xi|^2, apart from the anisotropy of the
lattice. Bonds cut by pre-cracks have no weight. Bonds that fail in a run are not corrected for.

The force density is the sum over bonds of (t_i + t_j) along the deformed bond, t_i = D p + 2 mu S (e - theta |xi| / d),
p = K theta - 2 mu / d sum S |xi| (e - theta |xi| / d). A bond fails if its stretch or its energy (t_i + t_j) e / 2 w
exceeds the limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.material_constants import bulk_modulus
from pdsolve.bonds.assembly import Bonds, find
from pdsolve.laws.bond_arrays import Tabled
from pdsolve.laws.calls import nodal_numbers as nodal_numbers_of
from pdsolve.laws.calls import numbers as numbers_of
from pdsolve.laws.law import INLINE, Failure, Lanes, Law, Sums
from pdsolve.laws.small_tensors import along
from pdsolve.model import Model

ROWS = 3  # theta, p, and what p is made of
NEVER, STRETCH, ENERGY = range(3)
TOGETHER = 4096  # nodes whose weights are found at once
LEAST = 0.1  # of the mean shear weight: less leaves a bond without stiffness of its own
KNOWN = 1e-6  # of the largest: smaller eigenvalues of moments are round-off, or of ways that families do not reach


class OrdinaryStateBasedColumns(NamedTuple):
    """Columns of n nodes and b bonds."""

    bulk: NDArray[np.floating]  # (n,) K, Pa
    shear: NDArray[np.floating]  # (n,) 2 mu, Pa
    dilating: NDArray[np.floating]  # (b,) D_ij, 1/m
    dilating_back: NDArray[np.floating]  # (b,) D_ji V_j / V_i
    shearing: NDArray[np.floating]  # (b,) 2 mu_i S_ij, Pa/m^2
    shearing_back: NDArray[np.floating]  # (b,) 2 mu_j S_ji V_j / V_i
    weight: NDArray[np.floating]  # (b,) w, m^d
    limit: NDArray[np.floating]  # (b,) stretch or energy, J/m^(3 d), at which the bond fails
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    failure: int  # what it fails by
    d: int  # dimensions


def columns(model: Model, bonds: Bonds, corrected: bool = True) -> OrdinaryStateBasedColumns:
    """Columns of these bonds (b,) and their nodes; not `corrected`: as published, for comparison."""
    dimension, exact = bonds.xi.shape[1], bonds._replace(xi=bonds.xi.astype(float), weight=bonds.weight.astype(float))
    E, nu, plane = model.node_values("E"), model.node_values("nu"), model.materials[0].plane
    bulk, shear = bulk_modulus(E, nu, plane), E / (1 + nu)  # K and 2 mu, Pa
    dilating, shearing = (_weights if corrected else _plain_weights)(exact)
    source = bonds.source
    back = find(bonds, bonds.neighbour.astype(np.int64), source)
    ratio = exact.weight / exact.weight[back]  # V_j / V_i, as influence and share are the same both ways
    shearing = shear[source] * shearing
    every = bulk, shear, dilating, dilating[back] * ratio, shearing, shearing[back] * ratio
    kind = bonds.xi.dtype
    numbers = [np.asarray(column, dtype=kind) for column in every]
    return OrdinaryStateBasedColumns(
        bulk=numbers[0],
        shear=numbers[1],
        dilating=numbers[2],
        dilating_back=numbers[3],
        shearing=numbers[4],
        shearing_back=numbers[5],
        weight=bonds.weight,
        limit=bonds.limit,
        broken=np.zeros(len(bonds.limit), np.int32),
        failure={"stretch": STRETCH, "energy": ENERGY}.get(model.materials[0].failure, NEVER),
        d=dimension,
    )


def rows(law: OrdinaryStateBasedColumns, dimension: int) -> int:
    """The width of `m`: the numbers that a node has between the two passes."""
    return ROWS


def _plain_weights(bonds: Bonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """D and S (b,) as if all families were full."""
    source, d = bonds.source, bonds.xi.shape[1]
    squared = (bonds.xi**2).sum(axis=1)
    m = np.bincount(source, bonds.weight * squared, minlength=len(bonds.start) - 1)[source]
    return d / m * bonds.weight * np.sqrt(squared), d * (d + 2) / (2 * m) * bonds.weight


def _weights(bonds: Bonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """D and S (b,) of the actual families, found for a few nodes at a time: in space it takes 0.6 kB a bond."""
    weights = np.empty((2, len(bonds.weight)))
    for node in range(0, len(bonds.start) - 1, TOGETHER):
        start = bonds.start[node : node + TOGETHER + 1]
        bond_range = slice(start[0], start[-1])
        part = bonds._replace(start=start - start[0], xi=bonds.xi[bond_range], weight=bonds.weight[bond_range])
        source, d, nodes = part.source, part.xi.shape[1], len(part.start) - 1
        length = np.sqrt((part.xi**2).sum(axis=1))
        # Components of n n^T, off-diagonal ones doubled, and of its traceless part in an orthonormal basis
        n = part.xi / length[:, None]
        off = [n[:, a] * n[:, b] for a in range(d) for b in range(a + 1, d)]
        traceless = [(n[:, 0] ** 2 - n[:, 1] ** 2) / np.sqrt(2)]
        if d == 3:
            traceless.append((n[:, 0] ** 2 + n[:, 1] ** 2 - 2 * n[:, 2] ** 2) / np.sqrt(6))
        root = np.sqrt(2)
        nn, y = (
            np.column_stack([*(n.T**2), *(2 * x for x in off)]),
            np.column_stack([*traceless, *(root * x for x in off)]),
        )
        share, trace = part.weight * length**2, np.zeros(nn.shape[1])
        trace[:d] = 1
        B = _least(_moments(source, nodes, share, nn), np.broadcast_to(trace, (nodes, len(trace))))
        dilating = part.weight * length * np.einsum("ba,ba->b", nn, B[source])
        first, second = np.triu_indices(y.shape[1])
        products = y[:, first] * y[:, second]
        wanted = np.broadcast_to((first == second).astype(float), (nodes, len(first)))
        A = _least(_moments(source, nodes, share, products), wanted)
        factor = np.einsum("ba,ba->b", products, A[source])
        least = LEAST * d * (d + 2) / (2 * np.bincount(source, share, minlength=nodes)[source])
        shearing = np.maximum(factor, least)
        raised = np.bincount(source, factor < least, minlength=nodes) > 0
        mean = np.bincount(source, share * shearing * (y**2).sum(axis=1), minlength=nodes) / y.shape[1]
        weights[:, bond_range] = dilating, part.weight * shearing / np.where(raised, mean, 1.0)[source]
    return weights[0], weights[1]


def _moments(
    source: NDArray[np.int64], nodes: int, share: NDArray[np.float64], p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The sums (n, k, k) of share p p^T over each node's bonds."""
    size = p.shape[1]
    moments = np.empty((nodes, size, size))
    for a in range(size):
        for b in range(a, size):
            moments[:, a, b] = moments[:, b, a] = np.bincount(source, share * p[:, a] * p[:, b], minlength=nodes)
    return moments


def _least(moments: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest x (n, k) with moments (n, k, k) x = wanted (n, k), as far as it exists."""
    values, vectors = np.linalg.eigh(moments)
    significant = values > KNOWN * values[:, -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=significant & (values > 0))
    return np.asarray(np.einsum("nab,nb,ncb,nc->na", vectors, inverse, vectors, wanted, optimize=True))


def scale(law: OrdinaryStateBasedColumns, bonds: Bonds) -> NDArray[np.float64]:
    """Relative stiffness of nodes (n,), N/m^4."""
    source, nodes = bonds.source, len(bonds.start) - 1
    squared = np.bincount(source, law.weight * (bonds.xi**2).sum(axis=1), minlength=nodes)
    weight = np.bincount(source, law.weight, minlength=nodes)
    return np.asarray((law.bulk + law.shear) * np.divide(weight, squared, out=np.zeros(nodes), where=squared > 0))


def numbers(law, i, j, k):  # type: ignore[no-untyped-def]
    return (law.shearing[k], law.shearing_back[k], law.dilating[k], law.dilating_back[k])


def initial_sums(law, xi, none):  # type: ignore[no-untyped-def]
    return none, none, none


def accumulate(law, bond, c, sums):  # type: ignore[no-untyped-def]
    e, moment = bond.elongation, c[0] * bond.length
    return sums[0] + c[2] * e, sums[1] + moment * e, sums[2] + moment * bond.length


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    m[i, 1] = pressure(law.bulk[i], law.d, m[i, 0], m[i, 1], m[i, 2])


@njit(**INLINE)
def pressure(bulk, d, theta, sheared, moment):  # type: ignore[no-untyped-def]
    """The pressure p of a node from its dilatation, sheared sum and moment."""
    return bulk * theta - (sheared - theta * moment / d) / d


def tabled(law: OrdinaryStateBasedColumns, bonds: Bonds) -> Tabled:
    """Data of bonds (b,) for the block kernels."""
    columns = law.shearing, law.shearing_back, law.dilating, law.dilating_back
    if law.failure == NEVER:
        return Tabled(columns, (0, 0, 1, 1), nodal_count=2, watched=False)
    limit = law.limit if law.failure == STRETCH else 2 * law.weight * law.limit
    return Tabled((*columns, limit), (0, 0, 1, 1, 2), nodal_count=2, watched=True)


def standing(law: OrdinaryStateBasedColumns, rows: NDArray[np.int64]) -> NDArray[np.floating]:
    """Nodal constants for `finish_sums`: K."""
    return law.bulk[None, rows]


def by_lanes(law: OrdinaryStateBasedColumns) -> bool:
    """True: nodes can always be finished in lanes."""
    return True


def finish_sums(law, sums, node_constants):  # type: ignore[no-untyped-def]
    return sums[0], pressure(node_constants[0], law.d, sums[0], sums[1], sums[2]), sums[2]


def margin(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    failure_measure = both(law, bond, c, node_numbers, neighbour_numbers) * bond.elongation
    if law.failure == STRETCH:
        failure_measure = bond.stretch
    return failure_measure, c[len(c) - 1]


def nodal_numbers(law, xi, m, i):  # type: ignore[no-untyped-def]
    return m[i, 0], m[i, 1]


def bond_force(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    force = both(law, bond, c, node_numbers, neighbour_numbers) * bond.inverse
    return along(force, bond.xi, bond.eta)


@njit(**INLINE)
def both(law, bond, c, node_numbers, neighbour_numbers):  # type: ignore[no-untyped-def]
    """t_i + t_j of a bond, N/m^3 in the plane."""
    e, part = bond.elongation, bond.length / law.d
    t_i = c[2] * node_numbers[1] + c[0] * (e - node_numbers[0] * part)
    t_j = c[3] * neighbour_numbers[1] + c[1] * (e - neighbour_numbers[0] * part)
    return t_i + t_j


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return law.failure != NEVER


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0 or bond.stretch <= 0:
        return False
    if law.failure == STRETCH:
        return bond.stretch > law.limit[k]
    c = numbers_of(law, i, j, k)
    t = both(law, bond, c, nodal_numbers_of(law, bond.xi, m, i), nodal_numbers_of(law, bond.xi, m, j))
    return t * bond.elongation > 2 * law.weight[k] * law.limit[k]


def failure_stretch(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.failure == STRETCH:
        return law.limit[k]
    c = numbers_of(law, i, j, k)
    t = both(law, bond, c, nodal_numbers_of(law, bond.xi, m, i), nodal_numbers_of(law, bond.xi, m, j))
    return bond.stretch * np.sqrt(2 * law.weight[k] * law.limit[k] / (t * bond.elongation))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    e = bond.length * bond.stretch
    rest = e - m[i, 0] * bond.length / law.d
    # K theta^2 / 2 is the sum over bonds of K theta D e / 2
    return (law.bulk[i] * m[i, 0] * law.dilating[k] * e + law.shearing[k] * rest * rest) / 2, 0.0


LAW = Law(
    columns_type=OrdinaryStateBasedColumns,
    columns=columns,
    passes=Sums(numbers, initial_sums, accumulate, finish_pass, nodal_numbers, bond_force),
    energy=energy,
    width=rows,
    scale=scale,
    failure=Failure(may_fail, fails, failure_stretch),
    lanes=Lanes(finish_sums, margin, tabled, standing, by_lanes, in_space=True),
)
