"""The arrays of a body with a fine zone, and how they follow from its cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space import arrangement, coarse_springs
from pdsolve.adaptivity.hybrid.space.arrangement import ClippedBondPiece, FineLattice
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import Drive
from pdsolve.lattice import tile_bonds
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tiles import Tiles
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.numerics.memory import aligned
from pdsolve.zone.cells import FINE, ZoneNumbering, lattice_coordinates

ROOM = 16  # pieces of a node, about


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
    stiffness_over_density: float = 0.0  # 1/s^2, of all nodes of any zone: `Operator.stiffness_bound` over density
    solid_cell_count: int = 1  # cells that are not void
    full_drive: Drive | None = None  # conditions on all fine nodes
    damping_rates: NDArray[np.float64] = np.zeros(0)  # (n,) 1/s, of all fine nodes


class BodyZone(NamedTuple):
    """What follows from the cells; arrays are changed in place, others replaced."""

    cell_kinds: NDArray[np.uint8]  # (c,)
    node_kinds: NDArray[np.uint8]  # (sites,) of fine nodes
    has_coarse_node: NDArray[np.bool_]  # (sites,) whether a coarse node is there
    fine_tiles: Tiles  # of bonds whole in fine cells
    coarse_springs: Tiles  # of coarse cells
    clipped_pieces: NDArray[ClippedBondPiece]
    coarse_u: NDArray[np.floating]  # (3, m) displacements of coarse sites, m


class ZoneHistory(NamedTuple):
    """Books of a run whose operator is created anew when cells become fine."""

    refinement_energy: float  # J, in the plane per unit thickness: energy that refining has made
    largest_clipped_strain: float  # of clipped bonds: e, or stretch over that at which they soften or break


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


def _copy_tiles(tiles: Tiles) -> Tiles:
    return tiles._replace(
        bits=tiles.bits.copy(), node=tiles.node.copy(), kind=tiles.kind.copy(), memory=tiles.memory.copy()
    )


def zone_after_refinement(full_body: FullBody, zone: BodyZone, new_cells: NDArray[np.int64]) -> BodyZone:
    """The zone after the cells `new_cells` (k, 3), which are fine already, have become so.

    Bits and numbers are new arrays: results may still ask for bonds of before.
    """
    fine, numbering = full_body.fine_lattice, full_body.fine_lattice.numbering
    dirty = np.flatnonzero(
        mask_near_cells(numbering, new_cells, fine.reach - 1, 0)
    )  # lower ends of bonds that pass these cells
    arrangement.set_node_kinds(
        numbering, fine.tiles.node, zone.cell_kinds, dirty, zone.node_kinds, zone.has_coarse_node
    )
    zone = zone._replace(fine_tiles=_copy_tiles(zone.fine_tiles), coarse_springs=_copy_tiles(zone.coarse_springs))
    new_pieces = np.empty(2 * len(zone.clipped_pieces) + ROOM * len(dirty), ClippedBondPiece.fields())
    count = arrangement.mark_whole_bonds_and_list_bond_pieces(
        fine, zone.cell_kinds, zone.fine_tiles.bits, dirty, new_pieces
    )
    if count > len(new_pieces):
        new_pieces = np.empty(count, ClippedBondPiece.fields())
        arrangement.mark_whole_bonds_and_list_bond_pieces(
            fine, zone.cell_kinds, zone.fine_tiles.bits, dirty, new_pieces
        )
    stale = np.zeros(len(zone.node_kinds), dtype=bool)
    stale[dirty] = True
    old, new_pieces = zone.clipped_pieces, new_pieces[:count]
    ordered = np.empty(len(old) - np.count_nonzero(stale[old["owner_site"]]) + count, ClippedBondPiece.fields())
    order = np.argsort(new_pieces["near_end_place"], kind="stable")
    arrangement.merge_bond_pieces_by_near_end(old, stale, new_pieces, order, ordered)
    moduli, ways, corners = (
        full_body.relative_cell_modulus,
        full_body.coarse_sites.ways,
        coarse_nodes_at_cell_corners(new_cells),
    )
    coarse_springs.set_coarse_springs(numbering, zone.cell_kinds, moduli, ways, corners, zone.coarse_springs)
    return zone._replace(clipped_pieces=ordered)


def create_body_zone(
    full_body: FullBody, cells: NDArray[np.uint8], springs: Tiles, kind: type[np.floating]
) -> BodyZone:
    """The zone of cells (c,), whose motion has the precision `kind`."""
    fine, count = full_body.fine_lattice, len(full_body.fine_sites.node)
    numbering = fine.numbering
    tiles, springs = (tile_bonds.in_precision(_copy_tiles(each), kind) for each in (fine.tiles, springs))
    tiles.bits[:] = 0
    zone = BodyZone(
        cell_kinds=cells,
        node_kinds=np.zeros(count, dtype=np.uint8),
        has_coarse_node=np.zeros(count, dtype=np.bool_),
        fine_tiles=tiles,
        coarse_springs=springs,
        clipped_pieces=np.empty(0, ClippedBondPiece.fields()),
        coarse_u=aligned(np.zeros((3, full_body.coarse_sites.size), kind)),
    )
    arrangement.set_node_kinds(
        numbering, fine.tiles.node, cells, np.arange(count), zone.node_kinds, zone.has_coarse_node
    )
    fine_cells = np.flatnonzero(cells == FINE)
    corners = np.column_stack(lattice_coordinates(numbering.coarse, np.arange(numbering.coarse.place_count)))
    moduli, ways = full_body.relative_cell_modulus, full_body.coarse_sites.ways
    coarse_springs.set_coarse_springs(numbering, cells, moduli, ways, corners, springs)
    if not len(fine_cells):
        return zone
    return zone_after_refinement(full_body, zone, np.column_stack(lattice_coordinates(numbering.cells, fine_cells)))
