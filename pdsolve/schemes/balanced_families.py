"""Weights of correspondence families near borders of spacings, for which a uniform stress is in equilibrium.

With w the weight of a neighbour and K = sum w xi xi^T, a uniform stress P puts on a node the force density P r with

    r_i = sum_j w_ij (K_i^-1 + K_j^-1) xi_ij

In a lattice r is 0 by symmetry, beside another spacing it is not: stresses in a bar under tension come out between 0.7
and 1.3 of the applied one, and in a ply along its fibres between 0.3 and 2. Two steps mend this. The influence of a
pair goes as the mean of its horizons to the power -(d + 2), as then K is alike at all spacings. And the influences of
pairs near a border get factors, equal for both ends, so that forces stay opposite: of all factors that make r vanish,
those nearest to 1 by least squares, found by some steps as K follows the weights. Nodes whose family an edge or a
crack cuts stay as they are: there r is the pull of a free face.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import lsqr
from scipy.spatial import cKDTree

from pdmesh.model.lattice_calibration import hu_beta
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Paired

MOST_SPACINGS = 8  # of lattices; nodes of other meshes have each their own
STEPS = 8  # of the factors: each takes a quarter to a half of what was left of r
PRECISE = 1e-3  # of the right side: that a step of the factors leaves
LEAST = 0.05  # of the factors: bonds stay springs
COMPLETE = 0.95  # least share of the horizon's circle or sphere that cells of a complete family cover
CHUNK = 2_000_000  # pairs of nodes that are listed at a time


class BorderFactors(NamedTuple):
    """Factors of the influence of pairs near borders of spacings, by both ends' rows."""

    key: NDArray[np.int64]  # (p,) lower row times the number of nodes, plus the higher row; increases
    factor: NDArray[np.float64]  # (p,)

    def of(self, source: NDArray[np.int64], target: NDArray[np.int64], nodes: int) -> NDArray[np.float64]:
        """Factors (b,) of pairs, 1 away from borders."""
        if not len(self.key):
            return np.ones(len(source))
        key = np.minimum(source, target) * nodes + np.maximum(source, target)
        at = np.minimum(np.searchsorted(self.key, key), len(self.key) - 1)
        return np.where(self.key[at] == key, self.factor[at], 1.0)


NO_FACTORS = BorderFactors(np.zeros(0, np.int64), np.zeros(0))


def border_factors(
    grid: Grid,
    horizon: NDArray[np.float64],
    pairs: Callable[[NDArray[np.int64]], Paired],
    is_cut: Callable[[NDArray[np.int64]], NDArray[np.int64]],
    size: NDArray[np.float64],
) -> BorderFactors:
    """Factors of the pairs that `pairs` gives for rows; nodes have `horizon` (n,), m, and `size` (n,), m^d.

    `is_cut` gives those of some rows that an edge or a slit keeps from a node within their horizon.
    """
    spacings, level = np.unique(np.round(grid.delta / grid.delta.min(), 6), return_inverse=True)
    if not 1 < len(spacings) <= MOST_SPACINGS:
        return NO_FACTORS
    position, reach, nodes = grid.position, float(horizon.max()), len(grid)
    body = np.zeros(nodes) if grid.bodies is None else grid.bodies.number
    place = np.column_stack([position, 10 * reach * body])  # no bond goes to another body, which is far away so
    away = _distance_to_other_spacings(place, level, 3.5 * reach)
    near = away <= reach + 2 * horizon
    rows = np.flatnonzero(near)
    if not len(rows):
        return NO_FACTORS
    paired = pairs(rows)
    source, target = paired.pairs.source, paired.pairs.target
    xi, weight = position[target] - position[source], paired.weight
    incomplete = np.ones(nodes, dtype=bool)
    incomplete[rows] = _covered(place, grid, horizon, size, rows) < COMPLETE
    incomplete[source[~paired.intact]] = incomplete[is_cut(rows)] = True
    # a node's sum changes if its family or one that it belongs to has bonds to another spacing
    balanced = (away <= reach / 2 + 1.5 * horizon) & ~incomplete
    balanced[source[~near[target]]] = False  # the family of that neighbour is not known here
    free = (balanced[source] & (balanced | incomplete)[target]) | (balanced[target] & incomplete[source])
    low, high = np.minimum(source, target), np.maximum(source, target)
    key, pair = np.unique((low * nodes + high)[free], return_inverse=True)
    if not len(key):
        return NO_FACTORS
    factor, row = np.ones(len(key)), np.cumsum(balanced) - 1
    counts = np.flatnonzero(free & balanced[source])  # bonds that a balanced node sums and a factor changes
    column = np.full(len(source), -1)
    column[free] = pair
    for _ in range(STEPS):
        present = weight.copy()
        present[free] *= factor[pair]
        way = _ways(source, target, xi, present, nodes)
        r = np.zeros((nodes, xi.shape[1]))
        for axis, along in enumerate(way.T):
            r[:, axis] = np.bincount(source, present * along, minlength=nodes)
        entries = [
            (weight[counts] * along[counts], row[source[counts]] * len(way.T) + axis, column[counts])
            for axis, along in enumerate(way.T)
        ]
        value, at, of = (np.concatenate(part) for part in zip(*entries, strict=True))
        shape = int(balanced.sum()) * len(way.T), len(key)
        matrix = coo_matrix((value, (at, of)), shape).tocsr()
        factor += lsqr(matrix, -r[balanced].ravel(), atol=PRECISE, btol=PRECISE)[0]
        np.maximum(factor, LEAST, out=factor)
    return BorderFactors(key, factor)


def _distance_to_other_spacings(
    place: NDArray[np.float64], level: NDArray[np.int64], farthest: float
) -> NDArray[np.float64]:
    """Distance (n,), m, of each node to the nearest one of another level; infinite if it is `farthest` or more."""
    away = np.full(len(place), np.inf)
    for number in range(int(level.max()) + 1):
        others = np.flatnonzero(level != number)
        distance, _ = cKDTree(place[level == number]).query(place[others], distance_upper_bound=farthest)
        away[others] = np.minimum(away[others], distance)
    return away


def _ways(
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    xi: NDArray[np.float64],
    weight: NDArray[np.float64],
    nodes: int,
) -> NDArray[np.float64]:
    """(K_i^-1 + K_j^-1) xi (b, d) of bonds."""
    d = xi.shape[1]
    K = np.zeros((nodes, d, d))
    for a in range(d):
        for b in range(d):
            K[:, a, b] = np.bincount(source, weight * xi[:, a] * xi[:, b], minlength=nodes)
    inverse = np.zeros_like(K)
    regular = np.linalg.det(K) > 0
    inverse[regular] = np.linalg.inv(K[regular])
    way: NDArray[np.float64] = np.einsum("bij,bj->bi", inverse[source] + inverse[target], xi)
    return way


def _covered(
    place: NDArray[np.float64],
    grid: Grid,
    horizon: NDArray[np.float64],
    size: NDArray[np.float64],
    rows: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Share (k,) of the horizons of nodes that cells of their body cover."""
    d, tree, covered = grid.dimension, cKDTree(place), np.zeros(len(rows))
    ball = {2: np.pi, 3: 4 * np.pi / 3}[d]
    for alike in np.unique(horizon[rows]):
        chosen = np.flatnonzero(horizon[rows] == alike)
        radius = float(alike + grid.delta.max() / 2)
        cells = ball * (radius / grid.delta.min()) ** d
        for chunk in np.array_split(chosen, int(len(chosen) * cells / CHUNK) + 1):
            near = cKDTree(place[rows[chunk]]).sparse_distance_matrix(tree, radius, output_type="ndarray")
            share = hu_beta(near["v"], np.full(len(near), alike), grid.delta[near["j"]])
            covered[chunk] = np.bincount(near["i"], share * size[near["j"]], minlength=len(chunk))
    return np.asarray(covered / (ball * horizon[rows] ** d))
