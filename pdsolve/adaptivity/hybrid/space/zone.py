"""Which cells are fine at the start, and which become fine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import distances
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.zone.cells import (
    COARSE,
    FINE,
    RING,
    TIPS,
    VOID,
    ZoneNumbering,
    lattice_coordinates,
    mark_and_list_new_fine_cells_near,
)
from pdsolve.zone.start_cells import mask_cells_around_nodes, mask_occupied_and_uncut_cells

FLANKS = 8  # h: cells this near to the faces of a pre-crack are fine: none of their springs is cut


def initial_cell_kinds(
    numbering: ZoneNumbering,
    volume: NDArray[np.float64],
    has_node: NDArray[np.bool_],
    reach: int,
    cracks: NDArray[np.float64],
    unfit_nodes: NDArray[np.int64],
    steep_nodes: NDArray[np.int64],
) -> NDArray[np.uint8]:
    """Initial cells (c,): fine around pre-cracks, where a surface cuts cells, beside the fine nodes `unfit_nodes`
    (k, 3) and around `steep_nodes` (j, 3), coarse elsewhere.

    `volume` and `has_node` (z, y, x) are of fine nodes: cells over h^3, and whether there is one. `cracks` (t, 3, 3)
    are triangles in spacings from the first node. A face along cells cuts none, except at re-entrant edges.
    """
    counts = numbering.cells.counts[::-1]
    beyond = [(0, max(0, 2 * count + 1 - side)) for count, side in zip(counts, has_node.shape, strict=True)]
    has_node, volume = np.pad(has_node, beyond), np.pad(np.where(has_node, volume, 0.0), beyond)
    in_body, good = mask_occupied_and_uncut_cells(has_node, volume, (0, 0, 0), counts)
    cells = np.where(in_body, FINE, VOID).astype(np.uint8)
    cells[good] = COARSE
    if (in_body & ~good).any():
        cells[(_distance_in_spacings(in_body & ~good) <= reach + RING) & good] = FINE
    _refine_around_cracks(cells, cracks)
    cells = np.pad(cells, numbering.cells.margins[0], constant_values=VOID)
    cells[mask_cells_around_nodes(numbering, unfit_nodes) & (cells == COARSE)] = FINE
    if len(steep_nodes):
        away = _distance_in_spacings(mask_cells_around_nodes(numbering, steep_nodes))
        cells[(away <= reach + RING) & (cells == COARSE)] = FINE
    return cells.ravel()


def _distance_in_spacings(cells: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The distance (z, y, x) of all cells from those of a mask, in spacings."""
    from scipy import ndimage  # takes long to import

    return np.asarray(2 * ndimage.distance_transform_edt(~cells) - 1)


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
def refine_cells_within_radius(numbering, cells, sites, radius, new_cells):  # type: ignore[no-untyped-def]
    """Make coarse cells within `radius` of the fine nodes at these sites fine, and list their places in `new_cells`.

    Returns how many there are.
    """
    count = 0
    for site in sites:
        x = lattice_coordinates(numbering.fine, site)
        count = mark_and_list_new_fine_cells_near(numbering.cells, cells, x, radius, new_cells, count)
    return count
