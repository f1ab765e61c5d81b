"""Exact areas of nodes: Voronoi cells clipped by the plate."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of

FRACTIONS = 2**20  # of the finest spacing: what nodes are rounded to, so that a lattice stays one in floating point


def cell_areas(
    position: NDArray[np.float64],
    shape: shapely.Geometry,
    delta: NDArray[np.float64],
    regular: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Areas (n,), m^2, of the Voronoi cells of `position` (n, 2) clipped by `shape`; their sum is its area.

    `delta` (n,) are the spacings, m. `regular` (n,) marks nodes with a full square cell whose whole neighbourhood is on
    one lattice; cells are constructed only for the others.
    """
    areas = delta**2
    rows = np.arange(len(position)) if regular is None else np.flatnonzero(~regular)
    if not len(rows):
        return areas
    needed = rows
    if regular is not None:  # cells are bounded by nodes within four spacings
        distance, _ = tree_of(position[rows]).query(position, distance_upper_bound=4 * float(delta.max()))
        needed = np.flatnonzero(distance <= 4 * delta)
    unit, origin = float(delta.min()), position.min(axis=0)
    points = np.round((position[needed] - origin) / unit * FRACTIONS) / FRACTIONS
    around = shapely.transform(shape, lambda corners: (corners - origin) / unit)
    cells = shapely.voronoi_polygons(shapely.multipoints(points), extend_to=around.envelope.buffer(4), ordered=True)
    cells = shapely.get_parts(cells)[np.searchsorted(needed, rows)]
    broken = ~shapely.is_valid(cells)
    cells[broken] = shapely.make_valid(cells[broken])
    shapely.prepare(around)
    outside = ~shapely.covers(around, cells)
    cells[outside] = shapely.intersection(cells[outside], around)
    areas[rows] = shapely.area(cells) * unit**2
    return areas
