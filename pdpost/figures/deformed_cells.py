"""Cells of displaced nodes: corners that bonded cells share stay shared, so that no seam opens between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected
from pdsolve.measures.plate_geometry import VoronoiCells
from pdsolve.results import Families

SAME = 1e-4  # of the finest spacing: corners closer than this are one place
MEETING = 8  # cells at a corner, at most


def deformed_corner_offsets(
    cells: VoronoiCells,
    reference: NDArray[np.float64],
    position: NDArray[np.float64],
    spacing: NDArray[np.float64],
    gradients: NDArray[np.float64],
    families: Families,
) -> NDArray[np.float64]:
    """Offsets (c, 2), m, of the cells' corners from their displaced nodes at `position` (n, 2), m.

    A cell deforms by the gradient (n, 2, 2) of its node. Where cells meet whose nodes share an intact bond of
    `families`, the corner is at the mean of the places that the cells have for it. Cells without a common bond part.
    """
    rows = cells.node_rows
    corners = position[rows] + np.einsum("cab,cb->ca", gradients[rows], cells.corner_offsets)
    # an order in which equal corners follow each other, and the number of each corner's place
    rounded = np.round((cells.corner_offsets + reference[rows]) / (SAME * float(spacing.min()))).astype(np.int64)
    order = np.lexsort(rounded.T)
    new = np.append(True, (np.diff(rounded[order], axis=0) != 0).any(axis=1))[: len(order)]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.cumsum(new)
    count = len(reference)
    starts = np.repeat(np.arange(count), np.diff(families.start))
    bonds = np.sort(starts * count + families.neighbour)
    first, second = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for shift in range(1, MEETING):
        a, b = order[:-shift], order[shift:]
        meets = place[a] == place[b]
        if not meets.any():
            break
        a, b = a[meets], b[meets]
        codes = rows[a] * count + rows[b]
        at = np.minimum(np.searchsorted(bonds, codes), max(len(bonds) - 1, 0))
        joined = rows[a] == rows[b]
        joined |= bonds[at] == codes if len(bonds) else False
        first.append(a[joined])
        second.append(b[joined])
    a, b = np.concatenate(first), np.concatenate(second)
    group = connected(len(rows), a, b)
    groups = int(group.max(initial=-1)) + 1
    size = np.bincount(group, minlength=groups)
    mean = np.stack([np.bincount(group, axis, groups) / size for axis in corners.T], axis=1)
    return np.asarray(mean[group] - position[rows], dtype=np.float64)
