"""Gradients fitted to the differences of a family, the strain from them, and Hooke's stress.

The gradient H of a node is the weighted least-squares fit of eta = H xi to its bonds: xi is the bond, eta the
difference of values, the weight the neighbour's area over |xi|. It is exact for affine values, at edges too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BLOCK = 1 << 15  # nodes at a time, so that memory stays small
FLAT = 1e-6  # det / trace^2 of a family's shape below which its bonds lie on a line; a full family has 0.25


def gradients_of(
    position: NDArray[np.float64],
    area: NDArray[np.float64],
    values: NDArray[np.float64],
    start: NDArray[np.int64],
    neighbour: NDArray[np.int64],
    rows: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """The gradient (r, k, 2) of nodal values (n, k), fitted to bonds; NaN without bonds, or with bonds on a line.

    Nodes are at `position` (n, 2), m, with areas (n,), m^2. The bonds of `rows` (r,), by default all, lead to
    `neighbour` (b,); those of row r are start[r]:start[r + 1].
    """
    rows = np.arange(len(position)) if rows is None else rows
    found = np.full((len(rows), values.shape[1], 2), np.nan)
    for first, last in _blocks(len(rows)):
        near = neighbour[start[first] : start[last]]
        count = np.diff(start[first : last + 1])
        own = np.repeat(np.arange(last - first), count)
        here = rows[first:last]
        x, y = (position[near] - np.repeat(position[here], count, axis=0)).T
        weight = area[near] / np.hypot(x, y)

        def total(product: NDArray[np.float64], own: NDArray[np.int64] = own, nodes: int = last - first) -> NDArray:  # type: ignore[type-arg]
            return np.bincount(own, product, minlength=nodes).astype(float)  # of none, bincount makes integers

        xx, xy, yy = total(weight * x * x), total(weight * x * y), total(weight * y * y)
        det = xx * yy - xy * xy
        flat = det <= FLAT * (xx + yy) ** 2
        det[flat] = np.nan
        for k in range(values.shape[1]):
            eta = weight * (values[near, k] - np.repeat(values[here, k], count))
            with_x, with_y = total(eta * x), total(eta * y)
            found[first:last, k, 0] = (with_x * yy - with_y * xy) / det
            found[first:last, k, 1] = (with_y * xx - with_x * xy) / det
    return found


def green(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Green's strain (n, 3), xx, yy, xy, from displacement gradients (n, 2, 2)."""
    (a, b), (c, d) = gradient.transpose(1, 2, 0)
    return np.column_stack(
        [a + (a * a + c * c) / 2, d + (b * b + d * d) / 2, (b + c + a * b + c * d) / 2],
    )


class Stiffness(NamedTuple):
    """The elastic constants of nodes, for stress from strain."""

    E: NDArray[np.float64]  # (n,) Young's modulus, Pa
    nu: NDArray[np.float64]  # (n,) Poisson's ratio of the material's model
    plane: str  # stress or strain


def hooke(
    strain: NDArray[np.float64], elastic: Stiffness, free: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """Stress (n, 4), xx, yy, xy, zz, Pa, from strains (n, 3); `free` (n,) is that of no stress in a free body."""
    modulus, nu, plane = elastic
    within = free if plane == "stress" else (1 + nu) * free
    within = within + within**2 / 2  # Green's
    xx, yy, xy = strain[:, 0] - within, strain[:, 1] - within, strain[:, 2]
    if plane == "stress":
        factor, out = modulus / (1 - nu**2), 0 * nu
        sxx, syy = factor * (xx + nu * yy), factor * (yy + nu * xx)
    else:
        factor, out = modulus / ((1 + nu) * (1 - 2 * nu)), nu
        sxx, syy = factor * ((1 - nu) * xx + nu * yy), factor * ((1 - nu) * yy + nu * xx)
    szz = out * (sxx + syy) - (0.0 if plane == "stress" else modulus * free)
    return np.column_stack([sxx, syy, modulus / (1 + nu) * xy, szz])


def thinning(
    strain: NDArray[np.float64], elastic: Stiffness, free: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """The out-of-plane strain zz (n,) that accompanies in-plane strains (n, 3); `free` is that of `hooke`."""
    if elastic.plane != "stress":
        return np.zeros(len(strain))
    nu = elastic.nu
    return (strain[:, 0] + strain[:, 1] - 2 * free) * (-nu / (1 - nu)) + free


def _blocks(count: int) -> Iterator[tuple[int, int]]:
    for first in range(0, count, BLOCK):
        yield first, min(first + BLOCK, count)
