"""What stays of a body with a fine zone, and which of its nodes are near cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space import arrangement
from pdsolve.adaptivity.hybrid.space.arrangement import FineLattice
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive, Entries
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tiles import Tiles
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.zone.cells import ZoneNumbering


class FullBody(NamedTuple):
    """The body with all its fine nodes.

    Bits are those of bonds not broken when cells last became fine; all else is constant.
    """

    law: Law
    model: Model | None  # None of a block alone
    fine_lattice: FineLattice
    fine_sites: Sites
    coarse_sites: Sites  # of coarse nodes
    precrack_cut_counts_of_places: NDArray[np.int64]  # (n,) bonds of each fine node that pre-cracks cut
    relative_cell_modulus: NDArray[np.float64]  # (c,) stiffness of coarse cells over that of the first material
    refinement_stretch: NDArray[np.float64]  # (sites,) of springs of a coarse node; beyond it cells around become fine
    either_way: bool = False  # whether they make cells fine where they are so much shorter, too
    stiffness_over_density: float = 0.0  # 1/s^2, of all nodes of any zone: `Operator.stiffness_bound` over density
    solid_cell_count: int = 1  # cells that are not void
    full_drive: Drive | None = None  # conditions on all fine nodes
    damping_rates: NDArray[np.float64] = np.zeros(0)  # (n,) 1/s, of all fine nodes
    ground_springs: Entries | None = None  # of all fine nodes, N/m^4
    swells: bool = False  # whether heat or a solvent swells it


def list_bonds_of_sites(
    sites: NDArray[np.int64], rows: NDArray[np.int64], row_at_site: NDArray[np.int32], tiles: Tiles
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Source and target rows (k,) of the bonds of nodes at these sites, whose rows are `rows`."""
    count = arrangement.count_bonds_of_sites(sites, row_at_site, tiles.offsets, tiles.bits)
    target = np.zeros(int(count.sum()), dtype=np.int64)
    arrangement.list_bond_targets(sites, row_at_site, tiles.offsets, tiles.bits, target)
    return np.repeat(rows, count), target


def mask_near_cells(
    numbering: ZoneNumbering, new_cells: NDArray[np.int64], reach: int, reach_above: int | None = None
) -> NDArray[np.bool_]:
    """Mask (sites,) of fine nodes within `reach` spacings of cells (k, 3), above them along z within `reach_above`."""
    marked = np.zeros(-(-numbering.fine.place_count // ROW) * ROW, dtype=np.bool_)
    inside = marked[: numbering.fine.place_count].reshape(numbering.fine.shape)
    _mark_sites_near_cells(new_cells, reach, reach if reach_above is None else reach_above, inside)
    return marked


@cached_njit(error_model="numpy")
def _mark_sites_near_cells(new_cells, reach, reach_above, marked):  # type: ignore[no-untyped-def]
    for n in range(len(new_cells)):
        x, y, z = 2 * new_cells[n, 0], 2 * new_cells[n, 1], 2 * new_cells[n, 2]
        for dz in range(max(z - reach, 0), min(z + reach_above + 3, marked.shape[0])):
            for dy in range(max(y - reach, 0), min(y + reach + 3, marked.shape[1])):
                marked[dz, dy, max(x - reach, 0) : x + reach + 3] = True


def coarse_nodes_at_cell_corners(new_cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The coarse nodes (k, 3) at the corners of cells (j, 3), each once."""
    return np.unique((new_cells[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3), axis=0)
