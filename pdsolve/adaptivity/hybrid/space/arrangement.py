"""What follows from the cells: kinds of nodes, the bits of whole bonds, and the pieces of others.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, as in the plane. An end in a
fine cell is a node; one on the border moves with the coarse nodes around it, at most four. Bonds between cells belong
in equal shares to their sides.
"""

from __future__ import annotations

from math import lcm
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.record import Record
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.tile_bonds import INVERSE
from pdsolve.lattice.tiles import VOLUME, Tiles, pair_number, stiffness
from pdsolve.numerics.memory import aligned
from pdsolve.zone.bond_parts import WORD, BondPartsInCells, lowest_cell_around, next_parts_outside_coarse_cells
from pdsolve.zone.cells import (
    COARSE,
    FREE,
    VOID,
    ZoneNumbering,
    cell_corner,
    corner_number_in_cell,
    count_cells_of_kind_around,
    fine_node_kind,
    floor_divide,
    lattice_coordinates,
    neighbour,
    place_number_at,
    scale_coordinates,
    vectorize_over_axes,
)

PARTS = 8  # of a bond, more than there are
BLOCK = 8  # spacings along a side of what is numbered together
ENDS = 4  # coarse nodes that an end moves with, at most


class BondPartEnds(NamedTuple):
    """Where the p parts of bonds begin and end, in whole multiples of h / unit."""

    position: NDArray[np.int64]  # (p, 2, 3) from the corner of the node's cell
    is_at_node: NDArray[np.bool_]  # (p, 2)
    units_per_spacing: int


def locate_bond_part_ends(bond_parts: BondPartsInCells, reach: int) -> BondPartEnds:
    """The ends of the parts of bonds that reach so many spacings along an axis."""
    unit = lcm(*range(1, reach + 1))
    position = np.rint(2 * unit * (bond_parts.end_cells + bond_parts.end_shares_of_cell)).astype(np.int64)
    return BondPartEnds(position, (position % unit == 0).all(axis=2), unit)


class FineLattice(NamedTuple):
    """The constant arrays of the fine lattice of a whole body."""

    numbering: ZoneNumbering
    tiles: Tiles  # with all bonds that are intact, those in coarse cells too
    bond_parts: BondPartsInCells  # of the upper half of the offsets
    passed_cell_bits: NDArray[np.uint64]  # (8, k, w) bits of the cells that a bond passes, on any side
    part_ends: BondPartEnds
    reach: int  # spacings, along an axis
    node_volume: float  # h^3, m^3
    limit_strain_ratio_of_pair: NDArray[
        np.float64
    ]  # (p,) of pairs of materials: least e at which bonds soften or break over theirs
    xi_row_of_piece_kind: NDArray[np.int32]  # (q,) row of `distinct_piece_xi` of a kind of pieces
    distinct_piece_xi: NDArray[np.float64]  # (g, 4) xi, m, from the near end to the far one, and 1 / |xi|^2


class ClippedBondPiece(Record):
    """A piece of a clipped bond; pieces are in the order of their near ends, then of their owners."""

    owner_site: int  # of the bond's lower node
    piece_kind: int  # alike for pieces with the same xi; see `list_distinct_bond_piece_vectors`
    near_end_place: int  # the place of one end, a node if one is; see `_blockwise_place_number`
    far_end_place: int  # of the other end
    stiffness: float  # N/m
    limit_strain_ratio: float  # least e at which bonds break over that of its own; 0 if it never breaks


class BondPieceEndPoints(NamedTuple):
    """The q places at which pieces end, in the order in which pieces name them: nodes, or places on the border."""

    interpolation_node_count: NDArray[np.int64]  # (q,) nodes that move it
    interpolation_nodes: NDArray[np.int32]  # (q, 4) their fine sites
    interpolation_weights: NDArray[np.float64]  # (q, 4) their weights


@cached_njit(error_model="numpy")
def set_node_kinds(numbering, node_at_site, cells, sites, node_kinds, has_coarse_node):  # type: ignore[no-untyped-def]
    """Set `node_kinds` and `has_coarse_node` (n,) at the sites `sites`."""
    for site in sites:
        if node_at_site[site] < 0:
            continue
        x = lattice_coordinates(numbering.fine, site)
        node_kinds[site] = fine_node_kind(numbering, cells, x)
        has_coarse_node[site] = (
            corner_number_in_cell(x) == 0 and count_cells_of_kind_around(numbering, cells, x, COARSE) > 0
        )


@njit(**INNER)
def _fill_bit_masks_of_coarse_and_fine_cells_around(numbering, cells, bond_parts, x, coarse, fine):  # type: ignore[no-untyped-def]
    """Fill the bits (w,) of the `coarse` and the `fine` ones of the cells around a fine node; whether there are any."""
    some_coarse = some_fine = False
    coarse[:] = fine[:] = 0
    wide, (left_side, front, low) = (
        bond_parts.cells_around_per_axis,
        lowest_cell_around(x, bond_parts.lowest_cell_offset),
    )
    number = 0
    for cz in range(low, low + wide):
        for cy in range(front, front + wide):
            row = place_number_at(numbering.cells, (left_side, cy, cz))
            for kind in cells[row : row + wide]:
                if kind != VOID:
                    word, bit = number // WORD, np.uint64(1) << np.uint64(number % WORD)
                    if kind == COARSE:
                        coarse[word] |= bit
                        some_coarse = True
                    else:
                        fine[word] |= bit
                        some_fine = True
                number += 1
    return some_coarse, some_fine


@njit(forceinline=True, **INNER)
def _have_common_bit(bits_a, bits_b):  # type: ignore[no-untyped-def]
    """Whether two sets of bits (w,) have one in common."""
    both = np.uint64(0)
    for n in range(len(bits_b)):
        both |= bits_a[n] & bits_b[n]
    return both != 0


@cached_njit(error_model="numpy")
def mark_whole_bonds_and_list_bond_pieces(fine, cells, bits, sites, pieces):  # type: ignore[no-untyped-def]
    """Set the bits of the whole bonds of nodes at the sites `sites`, which are in order, and list their pieces.

    Bonds are those of which a node is the lower end. Returns the number of pieces; those for which there is no room are
    only counted.
    """
    numbering, tiles, half, count = fine.numbering, fine.tiles, len(fine.tiles.offsets) // 2, 0
    coarse_bits, fine_bits = np.empty((2, fine.passed_cell_bits.shape[2]), np.uint64)
    for site in sites:
        if tiles.node[site] < 0:
            continue
        x = lattice_coordinates(numbering.fine, site)
        some_coarse, some_fine = _fill_bit_masks_of_coarse_and_fine_cells_around(
            numbering, cells, fine.bond_parts, x, coarse_bits, fine_bits
        )
        if not some_fine:
            continue
        tile, lane, place = site // ROW, np.uint16(site % ROW), corner_number_in_cell(x)
        for k in range(half):
            slot, passed = half + k, fine.passed_cell_bits[place, k]
            if not (tiles.bits[tile, slot] >> lane) & np.uint16(1):
                continue
            if not some_coarse or not _have_common_bit(passed, coarse_bits):
                if not (bits[tile, slot] >> lane) & np.uint16(1):
                    _set_bond_bits(bits, site, site + tiles.offsets[slot], slot)
            elif _have_common_bit(passed, fine_bits):
                count = _append_bond_pieces(fine, cells, site, x, k, coarse_bits, fine_bits, pieces, count)
    return count


@njit(**INNER)
def _set_bond_bits(bits, site, target, slot):  # type: ignore[no-untyped-def]
    """Set both directions of a bond."""
    for end, number in ((site, slot), (target, bits.shape[1] - 1 - slot)):
        bits[end // ROW, number] |= np.uint16(1) << np.uint16(end % ROW)


@njit(**INNER)
def _append_bond_pieces(fine, cells, site, x, k, coarse_bits, fine_bits, pieces, count):  # type: ignore[no-untyped-def]
    """List the pieces of bond k of the node x (3,) in all cells but coarse ones; returns how many there are then."""
    parts, bounds, sides = fine.bond_parts, fine.bond_parts.part_bounds_of_sides[corner_number_in_cell(x), k], 0
    side_bits = parts.side_cell_bits[corner_number_in_cell(x), k]
    for side in range(len(side_bits)):
        sides += _have_common_bit(side_bits[side], coarse_bits) or _have_common_bit(side_bits[side], fine_bits)
    for side in range(len(side_bits)):
        if not (_have_common_bit(side_bits[side], coarse_bits) or _have_common_bit(side_bits[side], fine_bits)):
            continue
        begin, end = next_parts_outside_coarse_cells(
            fine.numbering.cells, cells, parts, x, bounds[side], bounds[side + 1], True
        )
        while begin < end:
            if count < len(pieces):
                _set_bond_piece(fine, site, x, k, begin, end - 1, sides, pieces[count])
            count += 1
            begin, end = next_parts_outside_coarse_cells(
                fine.numbering.cells, cells, parts, x, end, bounds[side + 1], True
            )
    return count


@njit(**INNER)
def _set_bond_piece(fine, site, x, k, first, last, sides, piece):  # type: ignore[no-untyped-def]
    """Set the piece of bond k of the node x (3,) from its part `first` to `last`, on one of so many sides."""
    tiles, at_node, slot = fine.tiles, fine.part_ends.is_at_node, len(fine.tiles.offsets) // 2 + k
    length = fine.bond_parts.begin_and_end_shares[last, 1] - fine.bond_parts.begin_and_end_shares[first, 0]
    near, far = _place_of_bond_part_end(fine, x, first, 0), _place_of_bond_part_end(fine, x, last, 1)
    back = at_node[last, 1] and not at_node[first, 0]
    piece.owner_site, piece.piece_kind = site, 2 * (first * PARTS + last - first) + back
    piece.near_end_place, piece.far_end_place = (far, near) if back else (near, far)
    place = tiles.margin + site
    density_factor = stiffness(tiles, tiles.vectors[slot], site // ROW, place, tiles.offsets[slot])
    piece.stiffness = tiles.cells[VOLUME, place] * fine.node_volume * density_factor / (sides * length)
    i, j = tiles.node[site], tiles.node[site + tiles.offsets[slot]]
    scale = fine.limit_strain_ratio_of_pair[pair_number(tiles, i, j)]
    piece.limit_strain_ratio = 0.0 if tiles.unbreakable[i] or tiles.unbreakable[j] else scale


# Where a part of a bond of fine node x begins or ends, h / unit: `at` (3,) from the corner of the node's cell
_place_in_units = vectorize_over_axes(lambda along, axis, at, unit: unit * (along - along % 2) + at[axis])


@njit(**INNER)
def _place_of_bond_part_end(fine, x, part, side):  # type: ignore[no-untyped-def]
    """The place where a part of a bond of the node x (3,) begins, 0, or ends, 1."""
    ends, unit = fine.part_ends, fine.part_ends.units_per_spacing
    return _blockwise_place_number(fine.numbering, unit, _place_in_units(x, ends.position[part, side], unit))


@njit(**INNER)
def _blockwise_place_number(numbering, unit, x):  # type: ignore[no-untyped-def]
    """The number of a place x (3,) in h / unit: block by block, so that what is near in space is near in memory."""
    (x, y, z), side = x, BLOCK * unit
    across, along = numbering.fine.counts[0] // BLOCK + 1, numbering.fine.counts[1] // BLOCK + 1
    block = (z // side * along + y // side) * across + x // side
    return ((block * side + z % side) * side + y % side) * side + x % side


@njit(**INNER)
def coordinates_of_blockwise_place_number(numbering, unit, place):  # type: ignore[no-untyped-def]
    """The place (x, y, z) in h / unit of a number."""
    side = BLOCK * unit
    across, along = numbering.fine.counts[0] // BLOCK + 1, numbering.fine.counts[1] // BLOCK + 1
    block, in_block = place // (side * side * side), place % (side * side * side)
    return (
        block % across * side + in_block % side,
        block // across % along * side + in_block // side % side,
        block // (across * along) * side + in_block // (side * side),
    )


@cached_njit(error_model="numpy")
def merge_bond_pieces_by_near_end(old, is_owner_stale, new, order, merged):  # type: ignore[no-untyped-def]
    """Fill what is `merged` with the old pieces whose owners are not `is_owner_stale` (sites,) and with those `new`, in
    the `order` (q,) of their near ends."""
    at, n = 0, 0
    for m in order:
        place, owner = new[m].near_end_place, new[m].owner_site
        while n < len(old) and (
            old[n].near_end_place < place or (old[n].near_end_place == place and old[n].owner_site < owner)
        ):
            if not is_owner_stale[old[n].owner_site]:
                merged[at] = old[n]
                at += 1
            n += 1
        merged[at] = new[m]
        at += 1
    for k in range(n, len(old)):
        if not is_owner_stale[old[k].owner_site]:
            merged[at] = old[k]
            at += 1


@cached_njit(error_model="numpy")
def fill_piece_end_interpolation_nodes(fine, node_kinds, places, points):  # type: ignore[no-untyped-def]
    """Fill in what moves the `places` (q,)."""
    numbering, unit = fine.numbering, fine.part_ends.units_per_spacing
    for n in range(len(places)):
        x = coordinates_of_blockwise_place_number(numbering, unit, places[n])
        sites, w = points.interpolation_nodes[n], points.interpolation_weights[n]
        node, at_node = place_number_at(numbering.fine, floor_divide(x, unit)), True
        for axis in range(3):
            at_node &= x[axis] % unit == 0
        if at_node and node_kinds[node] == FREE:
            sites[:], w[:], w[0] = node, 0.0, 1.0
        else:
            _fill_coarse_interpolation_weights(numbering, x, 2 * unit, sites, w)
        points.interpolation_node_count[n] = 0
        for m in range(ENDS):
            points.interpolation_node_count[n] += w[m] > 0


def create_bond_piece_end_points(
    fine: FineLattice, node_kinds: NDArray[np.uint8], places: NDArray[np.int64]
) -> BondPieceEndPoints:
    """The points at these places (q,); `node_kinds` is of fine nodes."""
    count = len(places)
    points = BondPieceEndPoints(np.zeros(count, np.int64), np.zeros((count, ENDS), np.int32), np.zeros((count, ENDS)))
    fill_piece_end_interpolation_nodes(fine, node_kinds, places, points)
    return points


def list_distinct_bond_piece_vectors(
    bond_parts: BondPartsInCells, table: NDArray[np.floating], h: float
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The direction (q,) of each kind of pieces, and the xi, m, and 1 / |xi|^2 of each direction (g, 4).

    The kind of a piece is 2 PARTS times the number of its first part, plus twice that of those that follow it, plus 1
    if its near end is behind its far one.
    """
    begin = np.repeat(np.arange(len(bond_parts.begin_and_end_shares)), PARTS)
    last = np.minimum(
        begin + np.tile(np.arange(PARTS), len(bond_parts.begin_and_end_shares)),
        len(bond_parts.begin_and_end_shares) - 1,
    )
    bond = np.searchsorted(bond_parts.part_bounds_of_sides[:, :, 0].ravel(), begin, side="right") - 1
    row = table[len(table) // 2 + bond % bond_parts.part_bounds_of_sides.shape[1]].astype(np.float64)
    length = bond_parts.begin_and_end_shares[last, 1] - bond_parts.begin_and_end_shares[begin, 0]
    length[length <= 0] = 1.0  # of no piece
    xi = np.column_stack([length[:, None] * row[:, :3], row[:, INVERSE] / length**2])
    _, which, direction = np.unique(np.round(xi[:, :3] / h, 9), axis=0, return_index=True, return_inverse=True)
    unique_xi = xi[which]
    both = np.stack([unique_xi, unique_xi * [-1, -1, -1, 1]], axis=1).reshape(-1, 4)
    return np.column_stack([2 * direction.ravel(), 2 * direction.ravel() + 1]).ravel().astype(np.int32), aligned(both)


@njit(**INNER)
def _fill_coarse_interpolation_weights(numbering, x, cell_size, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) of the coarse nodes that move a place x (3,) on the border of a cell; `cell_size`
    is 2 h in the unit of x."""
    count, cell = 0, floor_divide(x, cell_size)
    for number in range(1 << len(x)):
        share = 1.0
        for axis in range(len(x)):
            along = x[axis] % cell_size / cell_size
            share *= along if number >> axis & 1 else 1 - along
        if share > 0 and count < ENDS:
            sites[count], w[count] = (
                place_number_at(numbering.fine, scale_coordinates(cell_corner(cell, number), 2)),
                share,
            )
            count += 1
    for n in range(count, ENDS):
        sites[n], w[n] = sites[0], 0.0


@cached_njit(error_model="numpy")
def fill_border_interpolation_nodes(numbering, border_sites, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (b, 4) by which fine nodes on the border, at the sites `border_sites` (b,), move."""
    for n in range(len(border_sites)):
        x = lattice_coordinates(numbering.fine, border_sites[n])
        _fill_coarse_interpolation_weights(numbering, x, 2, sites[n], w[n])


@cached_njit(error_model="numpy")
def lump_fine_values_to_coarse_nodes(fine, node_kinds, coarse_sites, fine_values, coarse_values):  # type: ignore[no-untyped-def]
    """Set `coarse_values` (k,) of coarse nodes at the fine sites `coarse_sites` to their shares of the `fine_values`
    (sites,) of all fine nodes that are not free."""
    numbering, tiles = fine.numbering, fine.tiles
    for n in range(len(coarse_sites)):
        x = lattice_coordinates(numbering.fine, coarse_sites[n])
        coarse_values[n] = 0.0
        for number in range(3 ** len(x)):
            near, share, inside = neighbour(x, 1, number), 1.0, True
            for axis in range(len(x)):
                inside &= 0 <= near[axis] < numbering.fine.counts[axis]
                share *= 1.0 if near[axis] == x[axis] else 0.5
            site = place_number_at(numbering.fine, near) if inside else -1
            if inside and tiles.node[site] >= 0 and node_kinds[site] != FREE:
                coarse_values[n] += share * fine_values[site]


@cached_njit(nogil=True, error_model="numpy")
def count_bonds_of_sites(sites, row_at_site, offsets, bits):  # type: ignore[no-untyped-def]
    """Number (k,) of the bonds of nodes at these sites to nodes, which have a `row_at_site` of at least 0."""
    counts = np.zeros(len(sites), dtype=np.int64)
    for n in range(len(sites)):
        tile, lane = sites[n] // ROW, np.uint16(sites[n] % ROW)
        for slot in range(len(offsets)):
            if (bits[tile, slot] >> lane) & np.uint16(1) and row_at_site[sites[n] + offsets[slot]] >= 0:
                counts[n] += 1
    return counts


@cached_njit(nogil=True, error_model="numpy")
def list_bond_targets(sites, row_at_site, offsets, bits, target):  # type: ignore[no-untyped-def]
    """Fill the rows of the targets of these bonds."""
    at = 0
    for n in range(len(sites)):
        tile, lane = sites[n] // ROW, np.uint16(sites[n] % ROW)
        for slot in range(len(offsets)):
            if (bits[tile, slot] >> lane) & np.uint16(1) and row_at_site[sites[n] + offsets[slot]] >= 0:
                target[at] = row_at_site[sites[n] + offsets[slot]]
                at += 1
