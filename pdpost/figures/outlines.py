"""Cells and plates as matplotlib curves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from matplotlib.path import Path as Curve
from numpy.typing import NDArray

from pdpost.measures.plate_geometry import VoronoiCells


def outlines(
    cell: VoronoiCells, position: NDArray[np.float64], turned: NDArray[np.float64] | None, factor: float
) -> list[Curve]:
    """The cells as curves (n) around nodes at `position` (n, 2), m, with lengths multiplied by `factor`.

    `turned` (n, 2, 2) is the linear map of each cell.
    """
    corners = (
        cell.corner_offsets if turned is None else np.einsum("cab,cb->ca", turned[cell.node_rows], cell.corner_offsets)
    )
    placed = factor * (corners + position[cell.node_rows])
    codes = np.full(len(placed), Curve.LINETO, dtype=np.uint8)
    codes[np.append(True, cell.is_last_of_ring)[:-1]] = Curve.MOVETO
    codes[cell.is_last_of_ring] = Curve.CLOSEPOLY
    start = np.searchsorted(cell.node_rows, np.arange(len(position) + 1))
    return [Curve(placed[a:b], codes[a:b]) for a, b in pairwise(start.tolist())]


def around(shape: shapely.Geometry, factor: float) -> Curve:
    """A shape as one curve, its lengths multiplied by `factor`."""
    rings = shapely.get_rings(shapely.orient_polygons(shapely.get_parts(shape)))
    return Curve.make_compound_path(*(Curve(factor * shapely.get_coordinates(ring), closed=True) for ring in rings))
