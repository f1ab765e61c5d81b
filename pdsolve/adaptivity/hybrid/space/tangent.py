"""Tangent of the forces on the nodes of a body with a fine zone: fine bonds, coarse springs, pieces of clipped bonds.

All of them are springs between points: nodes, fine nodes on the border, and those at which pieces end, in this order. A
point moves with nodes by weights, and passes its forces to them by the same weights.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack

from pdsolve.lattice import tile_bonds
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tiles import Tiles
from pdsolve.operators.tangent import of_followers, of_springs

if TYPE_CHECKING:
    from pdsolve.adaptivity.hybrid.space.layout import SpringNetwork


def assemble_tangent(network: SpringNetwork, value: NDArray[np.float64]) -> csr_array:
    """Minus the derivative (3 n, 3 n), N/m^4, of the force densities (n, 3) at `value`."""
    nodes = len(value)
    points = vstack(
        [
            eye_array(nodes),
            *(
                of_followers(rows, w, nodes)
                for rows, w in (network.border_interpolation_nodes, network.piece_end_interpolation_nodes)
            ),
        ]
    ).tocsr()
    u, last = points @ value, points.shape[0]
    matrix = csr_array((3 * last, 3 * last))
    for tiles, sites, rows, volume, share in (network.fine_bonds, network.coarse_springs):
        matrix += _tangent_of_tile_bonds(tiles, sites, rows, volume, u, share)
    near, far = (last - len(network.piece_end_interpolation_nodes[0]) + network.piece_end_points.astype(np.int64)).T
    pull = network.piece_stiffness * np.sqrt((network.piece_xi**2).sum(axis=1))
    for first, second, sign in ((near, far, 1.0), (far, near, -1.0)):
        matrix += of_springs(first, second, sign * network.piece_xi, pull, u)
    tied, density = kron(points, eye_array(3)).tocsr(), diags_array(np.repeat(1 / network.node_volume, 3))
    return (density @ (tied.T @ matrix @ tied)).tocsr()


def _tangent_of_tile_bonds(
    tiles: Tiles,
    sites: Sites,
    rows: NDArray[np.int64],
    volume: NDArray[np.float64],
    u: NDArray[np.float64],
    uses_shares: bool,
) -> csr_array:
    """Minus the derivative of the forces, N, on points, of the bonds of `rows`; `volume` is what densities are of."""
    source, target, slot = tile_bonds.list_bonds(sites, tiles.bits, rows)
    xi, pull = tile_bonds.springs_of_bonds(tiles, sites, source, target, slot)
    if uses_shares:
        tile, lane = np.divmod(sites.site[source] - sites.margin, tiles.share.shape[2])
        pull *= tiles.share[tile, slot, lane]
    return of_springs(source, target, xi, pull * volume[source], u)
