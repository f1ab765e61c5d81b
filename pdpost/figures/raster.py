"""Many nodes as an image: each node paints the pixels of its square; a pixel with several nodes shows their mean.

Cells and plates are matplotlib curves.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from matplotlib.path import Path as Curve
from numpy.typing import NDArray

from pdsolve.measures.plate_geometry import VoronoiCells

TIE = 1e-6  # pixels: keeps an edge that two nodes share from rounding to either side of a pixel's centre
BLOCK = 1 << 18  # nodes at a time, so that memory stays small
FAR = 1e9  # pixels: further off is as far
Box = tuple[float, float, float, float]  # x0, y0, x1, y1


def averages(
    position: NDArray[np.float64], size: NDArray[np.float64], values: NDArray[np.float64], box: Box, columns: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """An image (rows, columns) of `box`, lowest row first, and a mask of the pixels that hold nodes.

    A node (n, 2) paints the pixels whose centres are within its square of side `size` (n,), and always the pixel that
    contains it. A pixel is the mean of the finite `values` (n,) of its nodes, NaN without any.
    """
    low, high = np.array(box[:2]), np.array(box[2:])
    rows = max(round(columns * float((high[1] - low[1]) / (high[0] - low[0]))), 1)
    shape = np.array([columns, rows])
    pixels = columns * rows
    total, finite_count, covered = np.zeros(pixels), np.zeros(pixels, dtype=np.int64), np.zeros(pixels, dtype=bool)
    for start in range(0, len(values), BLOCK):
        block = slice(start, start + BLOCK)
        place = ((position[block] - low) / (high - low) * shape).clip(-FAR, FAR)
        half = size[block, None] / 2 / (high - low) * shape
        pixel, node = _painted(place, half, shape)
        covered[pixel] = True
        painted = values[block][node]
        finite = np.isfinite(painted)
        total += np.bincount(pixel[finite], painted[finite], pixels)
        finite_count += np.bincount(pixel[finite], minlength=pixels)
    mean = np.divide(total, finite_count, out=np.full(pixels, np.nan), where=finite_count > 0)
    return mean.reshape(rows, columns), covered.reshape(rows, columns)


def _painted(
    place: NDArray[np.float64], half: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pixel index and node index of each painted pixel; nodes of one size are processed together. Lengths in pixels."""
    first = np.ceil(place - half - 0.5 - TIE).astype(np.int64)
    after = np.ceil(place + half - 0.5 - TIE).astype(np.int64)
    thin = after <= first
    first[thin] = np.floor(place[thin]).astype(np.int64)
    after[thin] = first[thin] + 1
    first, after = first.clip(0), np.minimum(after, shape)
    inside = np.flatnonzero((after > first).all(axis=1))
    corner = first[inside, 1] * shape[0] + first[inside, 0]
    span = (after - first)[inside]
    pixels, nodes = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    tall = int(span[:, 1].max(initial=0)) + 1
    kind = span[:, 0] * tall + span[:, 1]
    for size_number in np.flatnonzero(np.bincount(kind)).tolist():
        width, height = divmod(size_number, tall)
        alike = np.flatnonzero(kind == size_number)
        patch = (shape[0] * np.arange(height)[:, None] + np.arange(width)).ravel()
        pixels.append((corner[alike, None] + patch).ravel())
        nodes.append(np.repeat(inside[alike], width * height))
    return np.concatenate(pixels), np.concatenate(nodes)


def outlines(
    cell: VoronoiCells, position: NDArray[np.float64], corners: NDArray[np.float64] | None, factor: float
) -> list[Curve]:
    """The cells as curves (n) around nodes at `position` (n, 2), m, with lengths multiplied by `factor`.

    `corners` (c, 2) are the offsets of the corners from their nodes, m; by default those of the cells.
    """
    placed = factor * ((cell.corner_offsets if corners is None else corners) + position[cell.node_rows])
    codes = np.full(len(placed), Curve.LINETO, dtype=np.uint8)
    codes[np.append(True, cell.is_last_of_ring)[:-1]] = Curve.MOVETO
    codes[cell.is_last_of_ring] = Curve.CLOSEPOLY
    start = np.searchsorted(cell.node_rows, np.arange(len(position) + 1))
    return [Curve(placed[a:b], codes[a:b]) for a, b in pairwise(start.tolist())]


def around(shape: shapely.Geometry, factor: float) -> Curve:
    """A shape as one curve, its lengths multiplied by `factor`."""
    rings = shapely.get_rings(shapely.orient_polygons(shapely.get_parts(shape)))
    return Curve.make_compound_path(*(Curve(factor * shapely.get_coordinates(ring), closed=True) for ring in rings))
