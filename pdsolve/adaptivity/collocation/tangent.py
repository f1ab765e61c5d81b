"""Tangent of fine bonds and coarse stencils; fictitious nodes move with their parents by their weights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron, vstack

from pdsolve.adaptivity.collocation.engine import CollocationEngine
from pdsolve.adaptivity.collocation.layout import list_bonds
from pdsolve.adaptivity.collocation.row_stiffness import stiffness_of_bonds
from pdsolve.adaptivity.collocation.zone import COARSE, FINE
from pdsolve.operators.tangent import of_blocks, of_followers, of_springs


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
    fictitious, parents = zone.fictitious_nodes[:, 0], row_at_place[zone.fictitious_nodes[:, 1:]]
    point = row_at_place.copy()  # active nodes come first, in their order
    point[fictitious] = nodes + np.arange(len(fictitious))
    points = vstack([eye_array(nodes), of_followers(parents, np.full(parents.shape, 0.25), nodes)]).tocsr()

    fine, coarse = (np.flatnonzero((row_at_place >= 0) & (node_kinds == kind)) for kind in (FINE, COARSE))
    node, k = list_bonds(lattice, zone.cut_bond_bits, np.ones(len(point), dtype=np.bool_), fine)
    xi = lattice.spring_table[k, :2]
    pull = stiffness_of_bonds(lattice, fine[node], k) * np.sqrt((xi**2).sum(axis=1))
    source, target = point[fine[node]], point[fine[node] + lattice.neighbour_offsets[k]]
    matrix = of_springs(source, target, xi, pull, points @ value)

    stencils = point[coarse[:, None] + lattice.coarse_stencil_place_offsets]
    theta = np.tile(lattice.stencil_stiffness[:, [0, 1, 1, 2]].reshape(-1, 2, 2), (len(coarse), 1, 1))
    matrix += of_blocks(
        np.repeat(point[coarse], stencils.shape[1]), stencils.ravel(), theta, len(value) + len(fictitious)
    )
    return (matrix[: 2 * nodes] @ kron(points, eye_array(2)).tocsr()).tocsr()
