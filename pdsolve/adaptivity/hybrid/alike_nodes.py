"""Which nodes of a rectangle have bonds that are alike: those that lie in the same way to all edges and pre-cracks that
are near."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.coarse_cells import Plate

SAME = 1e-9  # of its area: an outline that encloses so much of a rectangle is that


def first_alike(plate: Plate, rows: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Number (s,) of the first of these rows (s,) of the grid with the same bonds, and neighbours with the same bonds,
    but for round-off, in families of this `reach`, h."""
    every = np.arange(len(rows))
    if not _is_rectangle(plate):
        return every
    far, (nx, ny) = 2 * reach + 2, plate.counts
    y, x = np.divmod(rows, nx)
    kind = np.zeros(len(rows), dtype=np.int64)
    for away in (x, nx - 1 - x, y, ny - 1 - y):
        kind = (far + 1) * kind + np.minimum(away, far)
    at = np.column_stack([x, y]) + np.array(plate.first)
    for crack in plate.cracks:
        near = np.flatnonzero(distance(at, crack) < 1.5 * far)
        beside = np.zeros(len(rows), dtype=np.int64)
        beside[near] = 1 + (_beside(at[near], crack, 2 * far) if (crack[:2] == crack[2:]).any() else near)
        kind = np.unique(kind, return_inverse=True)[1] * (1 + beside.max(initial=0)) + beside
    _, first, which = np.unique(kind, return_index=True, return_inverse=True)
    return np.asarray(first[which])


def _beside(at: NDArray[np.int64], crack: NDArray[np.float64], far: int) -> NDArray[np.int64]:
    """A number for each of these places (k, 2) that tells how they lie to a crack along an axis, up to `far` from its
    ends."""
    found = np.zeros(len(at), dtype=np.int64)
    for end in (crack[:2], crack[2:]):
        for away in np.clip(at - np.floor(end).astype(np.int64), -far, far).T:
            found = (2 * far + 1) * found + away + far
    return found


def _is_rectangle(plate: Plate) -> bool:
    """Whether nodes, of one material, fill a rectangle from which nothing is cut."""
    grid = plate.model.grid
    if plate.listed is not None or plate.model.settings.regions or len(grid.holes) or grid.bodies is not None:
        return False
    rings = [np.asarray(ring) for ring in grid.outline]
    if len(rings) != 1:
        return not rings
    x, y = rings[0].T
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    return bool(abs(area - np.ptp(x) * np.ptp(y)) < SAME * area)


def distance(at: NDArray[np.number], segment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (k,) of places (k, 2) from a segment (4,), in one unit."""
    start, way = segment[:2], segment[2:] - segment[:2]
    share = np.clip((at - start) @ way / max(float(way @ way), np.finfo(float).tiny), 0.0, 1.0)
    return np.asarray(np.hypot(*(at - start - share[:, None] * way).T))
