"""Tangent of fine bonds and coarse stencils; fictitious nodes move with their parents by their weights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array, kron

from pdsolve.adaptivity.collocation.engine import CollocationEngine
from pdsolve.adaptivity.collocation.layout import list_bonds
from pdsolve.adaptivity.collocation.row_stiffness import stiffness_of_bonds
from pdsolve.adaptivity.collocation.zone import COARSE, FINE
from pdsolve.operators.tangent import of_springs


def assemble_tangent(
    engine: CollocationEngine,
    node_kinds: NDArray[np.uint8],
    row_at_place: NDArray[np.int64],
    value: NDArray[np.float64],
) -> csr_array:
    """Minus the derivative (2 n, 2 n), N/m^4, of the force densities by the values (n, 2).

    `node_kinds` (places,) is the kind of each place, `row_at_place` (places,) the row of each active one.
    """
    lattice, zone, nodes = engine.lattice, engine.zone, len(value)
    between = zone.fictitious_nodes
    active = np.flatnonzero(row_at_place >= 0)
    point = np.full(len(row_at_place), -1, dtype=np.int64)  # active nodes come first, in their order
    point[active], point[between[:, 0]] = row_at_place[active], nodes + np.arange(len(between))
    weights = np.repeat([1.0, 0.25], [nodes, 4 * len(between)])
    follows = np.concatenate([np.arange(nodes), np.repeat(nodes + np.arange(len(between)), 4)])
    parents = np.concatenate([np.arange(nodes), row_at_place[between[:, 1:]].ravel()])
    points = coo_array((weights, (follows, parents)), (nodes + len(between), nodes)).tocsr()

    fine = active[node_kinds[active] == FINE]
    node, k = list_bonds(lattice, zone.cut_bond_bits, np.ones(len(row_at_place), dtype=np.bool_), fine)
    xi = lattice.spring_table[k, :2]
    pull = stiffness_of_bonds(lattice, fine[node], k) * np.sqrt((xi**2).sum(axis=1))
    source, target = point[fine[node]], point[fine[node] + lattice.neighbour_offsets[k]]
    matrix = of_springs(source, target, xi, pull, points @ value)

    coarse = active[node_kinds[active] == COARSE]
    xx, xy, yy = (-lattice.stencil_stiffness).T
    theta = np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1)  # (s, 2, 2)
    centre_points = np.repeat(point[coarse], len(theta))
    stencil_points = point[(coarse[:, None] + lattice.coarse_stencil_place_offsets).ravel()]
    a, b = (index.ravel() for index in np.indices((2, 2)))
    rows, columns = (2 * centre_points[:, None] + a).ravel(), (2 * stencil_points[:, None] + b).ravel()
    matrix += coo_array((np.tile(theta.ravel(), len(coarse)), (rows, columns)), matrix.shape).tocsr()
    return (matrix[: 2 * nodes] @ kron(points, eye_array(2)).tocsr()).tocsr()
