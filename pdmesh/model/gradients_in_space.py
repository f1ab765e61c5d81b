"""Gradients in space fitted to the differences of a family, the strain from them, and Hooke's stress.

The gradient H of a node is the weighted least-squares fit of eta = H xi to its bonds: xi is the bond, eta the
difference of values, the weight the neighbour's volume over |xi|. It is exact for affine values, at surfaces too.
Symmetric tensors are (n, 6) in the order xx, yy, xy, zz, xz, yz.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.gradients import Stiffness

BLOCK = 1 << 12  # nodes at a time, so that memory stays small
FLAT = 1e-6  # det / trace^3 of a family's shape below which its bonds lie in a plane; a full family has 1/27
PAIRS = ((0, 0), (1, 1), (0, 1), (2, 2), (0, 2), (1, 2))


def gradients_in_space(
    position: NDArray[np.float64],
    volume: NDArray[np.float64],
    values: NDArray[np.float64],
    start: NDArray[np.int64],
    neighbour: NDArray[np.int64],
    rows: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """The gradient (r, k, 3) of nodal values (n, k), fitted to bonds; NaN without bonds, or with bonds in a plane.

    Nodes are at `position` (n, 3), m, with volumes (n,), m^3. The bonds of `rows` (r,), by default all, lead to
    `neighbour` (b,); those of the i-th of them are start[i]:start[i + 1].
    """
    rows = np.arange(len(position)) if rows is None else rows
    count = len(rows)
    found = np.full((count, values.shape[1], 3), np.nan)
    for first in range(0, count, BLOCK):
        last = min(first + BLOCK, count)
        near, bonds = neighbour[start[first] : start[last]], np.diff(start[first : last + 1])
        if not len(near):
            continue
        own = np.repeat(rows[first:last], bonds)
        xi = position[near] - position[own]
        weighted = xi * (volume[near] / np.sqrt((xi * xi).sum(axis=1)))[:, None]
        whole = np.flatnonzero(bonds > 0)
        begins = (start[first:last] - start[first])[whole]
        shape = np.empty((len(whole), 3, 3))
        for a, b in PAIRS:
            shape[:, a, b] = shape[:, b, a] = np.add.reduceat(weighted[:, a] * xi[:, b], begins)
        solid = np.linalg.det(shape) > FLAT * np.trace(shape, axis1=1, axis2=2) ** 3
        inverse = np.linalg.inv(shape[solid])
        for k in range(values.shape[1]):
            eta = values[near, k] - values[own, k]
            moment = np.column_stack([np.add.reduceat(eta * weighted[:, a], begins) for a in range(3)])
            found[first + whole[solid], k] = np.einsum("na,nab->nb", moment[solid], inverse)
    return found


def green_in_space(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Green's strain (n, 6) from displacement gradients (n, 3, 3)."""
    turned = gradient.transpose(0, 2, 1)
    strain = (gradient + turned + turned @ gradient) / 2
    return np.column_stack([strain[:, a, b] for a, b in PAIRS])


def hooke_in_space(strain: NDArray[np.float64], elastic: Stiffness) -> NDArray[np.float64]:
    """Stress (n, 6), Pa, from strains (n, 6)."""
    E, nu, _ = elastic
    normal = np.array([a == b for a, b in PAIRS], dtype=float)
    pressure = E * nu / ((1 + nu) * (1 - 2 * nu)) * (strain @ normal)
    return np.asarray(pressure[:, None] * normal + (E / (1 + nu))[:, None] * strain)
