"""Which cells are fine at the start, and which become fine."""

from __future__ import annotations

from itertools import product

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import distances
from pdsolve.adaptivity.hybrid.arrays import RING, TIPS
from pdsolve.adaptivity.hybrid.space.box import COARSE, FINE, VOID, CellBox, cell_place
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit

SAME = 1e-6  # of a cell: volumes this near are the same
FLANKS = 8  # h: cells this near to the faces of a pre-crack are fine: none of their springs is cut


def initial_cell_kinds(
    box: CellBox,
    volume: NDArray[np.float64],
    has_node: NDArray[np.bool_],
    reach: int,
    cracks: NDArray[np.float64],
    unfit_nodes: NDArray[np.int64],
) -> NDArray[np.uint8]:
    """Initial cells (c,): fine around pre-cracks, where a surface cuts cells and beside the fine nodes `unfit_nodes`
    (k, 3), coarse elsewhere.

    `volume` and `has_node` (z, y, x) are of fine nodes: cells over h^3, and whether there is one. `cracks` (t, 3, 3)
    are triangles in spacings from the first node. A face along cells cuts none, except at re-entrant edges.
    """
    full_cubes = _mask_full_cubes(has_node)
    around = np.zeros(has_node.shape, dtype=np.int8)
    for side in product((0, 1), repeat=3):
        around += np.pad(full_cubes, [(1 - s, s) for s in side])
    odd = has_node & ((np.abs(volume - around / 8) > SAME) | np.isin(around, (3, 5, 6, 7)))
    in_body, good = np.zeros((2, box.cells_z, box.cells_y, box.cells_x), dtype=bool)
    good[:] = True
    wide = [
        (0, max(0, 2 * count + 1 - side))
        for count, side in zip((box.cells_z, box.cells_y, box.cells_x), has_node.shape, strict=True)
    ]
    odd, has_node = (np.pad(mask, wide) for mask in (odd, has_node))
    solid = np.zeros_like(has_node)
    solid[tuple(slice(0, n) for n in full_cubes.shape)] = full_cubes
    for z, y, x in product(range(3), repeat=3):
        cell_nodes = np.s_[
            z : z + 2 * box.cells_z - 1 : 2, y : y + 2 * box.cells_y - 1 : 2, x : x + 2 * box.cells_x - 1 : 2
        ]
        in_body |= odd[cell_nodes]
        good &= ~odd[cell_nodes] & has_node[cell_nodes]
        if max(z, y, x) < 2:
            in_body |= solid[cell_nodes]
            good &= solid[cell_nodes]
    cells = np.where(in_body, FINE, VOID).astype(np.uint8)
    cells[good] = COARSE
    if (in_body & ~good).any():
        from scipy import ndimage  # takes long to import

        away = 2 * ndimage.distance_transform_edt(~(in_body & ~good)) - 1
        cells[(away <= reach + RING) & good] = FINE
    _refine_around_cracks(cells, cracks)
    for side in product((0, 1), repeat=3):
        z, y, x = ((unfit_nodes - side) // 2).clip(0, [box.cells_x - 1, box.cells_y - 1, box.cells_z - 1]).T[::-1]
        cells[z, y, x] = np.where(cells[z, y, x] == COARSE, FINE, cells[z, y, x])
    return np.pad(cells, box.void_margin, constant_values=VOID).ravel()


def _mask_full_cubes(has_node: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask of the cubes between nodes with a node at all eight corners, by their lowest one."""
    is_full = has_node
    for axis in range(3):
        low, high = (np.take(is_full, np.arange(is_full.shape[axis] - 1) + end, axis=axis) for end in (0, 1))
        is_full = low & high
    return is_full


def _refine_around_cracks(cells: NDArray[np.uint8], cracks: NDArray[np.float64]) -> None:
    """Make cells (z, y, x) fine near the faces and the edges of pre-cracks."""
    if not len(cracks):
        return
    where = np.argwhere(cells == COARSE)
    middle = np.asarray(2.0 * where[:, ::-1] + 1, dtype=np.float64)
    corner = np.sqrt(3.0)  # from the middle of a cell
    near = distances(middle, cracks, FLANKS + corner) < FLANKS + corner
    ends = cracks[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3)
    key = np.round(ends, 6)
    swap = np.array([tuple(a) > tuple(b) for a, b in key])
    key[swap] = key[swap][:, ::-1]
    _, first, count = np.unique(key.reshape(-1, 6), axis=0, return_index=True, return_counts=True)
    edges = ends[first[count == 1]]  # those of one triangle alone
    near |= distances(middle, edges[:, [0, 1, 1]], TIPS + corner) < TIPS + corner
    cells[tuple(where[near].T)] = FINE


@cached_njit(error_model="numpy")
def mark_and_list_new_fine_cells_in_balls(box, cells, places, radius, new_cells):  # type: ignore[no-untyped-def]
    """Make coarse cells within `radius` of the fine nodes `places` (k, 3) fine, and list them in `new_cells` (., 3).

    Returns how many there are.
    """
    count, half = 0, radius // 2 + 1
    for n in range(len(places)):
        x, y, z = places[n]
        for cz in range(max((z >> 1) - half, 0), min((z >> 1) + half + 1, box.cells_z)):
            for cy in range(max((y >> 1) - half, 0), min((y >> 1) + half + 1, box.cells_y)):
                for cx in range(max((x >> 1) - half, 0), min((x >> 1) + half + 1, box.cells_x)):
                    c = cell_place(box, cx, cy, cz)
                    away = (
                        _squared_distance_to_cell_along_axis(x, cx)
                        + _squared_distance_to_cell_along_axis(y, cy)
                        + _squared_distance_to_cell_along_axis(z, cz)
                    )
                    if cells[c] == COARSE and away < radius * radius:
                        cells[c] = FINE
                        new_cells[count, 0], new_cells[count, 1], new_cells[count, 2] = cx, cy, cz
                        count += 1
    return count


@njit(forceinline=True, **INNER)
def _squared_distance_to_cell_along_axis(x, cell):  # type: ignore[no-untyped-def]
    """The square of the distance between a coordinate and a cell."""
    away = max(abs(x - (2 * cell + 1)) - 1, 0)
    return away * away
