"""Which cells of a lattice are whole, and which contain some of its nodes; in arrays whose last axis is x."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from pdsolve.zone.cells import ZoneNumbering, cell_around, place_number_at

SAME = 1e-6  # of the cube of a spacing: volumes this near are the same
REENTRANT = (3, 5, 6, 7)  # full cubes around a node on an edge or at a corner where a surface turns inwards


def mask_cubes_with_nodes_at_all_corners(has_node: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask of the cubes of a spacing with a node at all corners, by their lowest one; squares in the plane."""
    is_full = has_node.copy()
    for axis in range(has_node.ndim):
        along = np.moveaxis(is_full, axis, 0)
        along[:-1] &= along[1:]
        along[-1:] = False
    return is_full


def count_full_cubes_around_nodes(has_node: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Number of such cubes around each place."""
    counts = mask_cubes_with_nodes_at_all_corners(has_node).astype(np.int8)
    for axis in range(has_node.ndim):
        along = np.moveaxis(counts, axis, 0)
        along[1:] += along[:-1]
    return counts


def mask_occupied_and_uncut_cells(
    has_node: NDArray[np.bool_], volume: NDArray[np.float64], first: tuple[int, ...], counts: tuple[int, ...]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks (counts) of the cells with some of the nodes, and of those that no surface cuts.

    `volume` is that of nodes over a whole one. `first` is where the lowest corner of the first cell is in both. A
    surface along cells cuts none, except at re-entrant edges and corners.
    """
    around, full_cubes = count_full_cubes_around_nodes(has_node), mask_cubes_with_nodes_at_all_corners(has_node)
    odd = (np.abs(volume - around / np.float32(2**has_node.ndim)) > SAME) | has_node & np.isin(around, REENTRANT)
    has_nodes, is_whole = np.zeros(counts, dtype=bool), np.ones(counts, dtype=bool)
    for step in product(range(3), repeat=has_node.ndim):
        ends = zip(first, step, counts, strict=True)
        at_step = tuple(slice(begin + s, begin + s + 2 * count - 1, 2) for begin, s, count in ends)
        has_nodes |= odd[at_step] & has_node[at_step]
        is_whole &= ~odd[at_step]
        if max(step) < 2:
            has_nodes |= full_cubes[at_step]
            is_whole &= full_cubes[at_step]
    return has_nodes, is_whole


def mask_cells_around_nodes(numbering: ZoneNumbering, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of all cells with one of the fine nodes (k, d) inside or at their border."""
    is_near, x = np.zeros(numbering.cells.place_count, dtype=bool), tuple(nodes.T)
    for number in range(2 ** len(x)):
        is_near[place_number_at(numbering.cells, cell_around(x, number))] = True
    return is_near.reshape(numbering.cells.shape)
