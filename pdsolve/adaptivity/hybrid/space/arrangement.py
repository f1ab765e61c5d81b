"""What follows from the cells: kinds of nodes, the bits of whole bonds, and the pieces of others.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, as in the plane. An end in a
fine cell is a node; one on the border moves with the coarse nodes around it, at most four. Bonds between cells belong
in equal shares to their sides.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.divisions import SIDES, WORD, BondDivisions
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.tile_bonds import INVERSE
from pdsolve.lattice.tiles import VOLUME, Tiles, pair_number, stiffness
from pdsolve.numerics.memory import aligned
from pdsolve.zone.cells import (
    COARSE,
    FREE,
    VOID,
    ZoneNumbering,
    along_each_axis,
    cell_of,
    coordinates,
    corner,
    count_cells_around,
    divided,
    fine_node_kind,
    multiplied,
    neighbour,
    place_at,
    position_number,
    shifted,
)

PARTS = 8  # of a bond, more than there are
BLOCK = 8  # spacings along a side of what is numbered together
ENDS = 4  # coarse nodes that an end moves with, at most


class FineLattice(NamedTuple):
    """The constant arrays of the fine lattice of a whole body."""

    numbering: ZoneNumbering
    tiles: Tiles  # with all bonds that are intact, those in coarse cells too
    divisions: BondDivisions  # of the upper half of the offsets
    reach: int  # spacings, along an axis
    node_volume: float  # h^3, m^3
    least_over_own_limit_strain_of_material_pair: NDArray[
        np.float64
    ]  # (p,) of pairs of materials: least e at which bonds break over theirs
    xi_row_of_piece_kind: NDArray[np.int32]  # (q,) row of `distinct_piece_xi` of a kind of pieces
    distinct_piece_xi: NDArray[np.float64]  # (g, 4) xi, m, from the near end to the far one, and 1 / |xi|^2


class ClippedPieces(NamedTuple):
    """The p pieces of clipped bonds, in the order of their near ends, then of their owners."""

    owner_site: NDArray[np.int32]  # (p,) site of the bond's lower node
    piece_kind: NDArray[np.int32]  # (p,) alike for pieces with the same xi; see `number_and_list_piece_vectors`
    near_end_place: NDArray[np.int64]  # (p,) the place of one end, a node if one is; see `_blockwise_place_number`
    far_end_place: NDArray[np.int64]  # (p,) of the other end
    stiffness: NDArray[np.float64]  # (p,) stiffness, N/m
    least_over_own_limit_strain: NDArray[
        np.float64
    ]  # (p,) least e at which bonds break over that of its own; 0 if it never breaks


def allocate_pieces(count: int) -> ClippedPieces:
    """Room for so many pieces."""
    owner, kind = np.empty((2, count), np.int32)
    return ClippedPieces(owner, kind, *np.empty((2, count), np.int64), *np.empty((2, count)))


def take_first_pieces(pieces: ClippedPieces, count: int) -> ClippedPieces:
    """So many of the first ones."""
    columns: list[Any] = [column[:count] for column in pieces]
    return ClippedPieces(*columns)


class PiecePoints(NamedTuple):
    """The q places at which pieces end, in the order in which pieces name them: nodes, or places on the border."""

    carrier_count: NDArray[np.int64]  # (q,) nodes that move it
    carrier_sites: NDArray[np.int32]  # (q, 4) their fine sites
    carrier_weights: NDArray[np.float64]  # (q, 4) their weights


@cached_njit(error_model="numpy")
def set_node_kinds(numbering, node_at_site, cells, sites, node_kinds, has_coarse_node):  # type: ignore[no-untyped-def]
    """Set `node_kinds` and `has_coarse_node` (n,) at the sites `sites`."""
    for site in sites:
        if node_at_site[site] < 0:
            continue
        x = coordinates(numbering.fine, site)
        node_kinds[site] = fine_node_kind(numbering, cells, x)
        has_coarse_node[site] = position_number(x) == 0 and count_cells_around(numbering, cells, x, COARSE) > 0


# The lowest of the cells around a fine node x that its bonds pass
_lowest_cell_around = along_each_axis(lambda along, axis, lowest_offset: (along >> 1) + lowest_offset[along % 2])


@njit(**INNER)
def _fill_bits_of_surrounding_cells(numbering, cells, divisions, x, coarse, fine):  # type: ignore[no-untyped-def]
    """Fill the bits (w,) of the `coarse` and the `fine` ones of the cells around a fine node; whether there are any."""
    some_coarse = some_fine = False
    coarse[:] = fine[:] = 0
    number, (left_side, front, low) = 0, _lowest_cell_around(x, divisions.lowest_cell_offset)
    for cz in range(low, low + divisions.cells_around_per_axis):
        for cy in range(front, front + divisions.cells_around_per_axis):
            row = place_at(numbering.cells, (left_side, cy, cz))
            for kind in cells[row : row + divisions.cells_around_per_axis]:
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


@njit(forceinline=True, **INNER)
def _cell_kind_of_part(numbering, cells, divisions, part, x):  # type: ignore[no-untyped-def]
    """The kind of the cell of a part of a bond of fine node x (3,)."""
    return cells[place_at(numbering.cells, shifted(cell_of(x), divisions.cell_offset[part]))]


@njit(**INNER)
def _count_sides_with_cells(numbering, cells, divisions, first, x):  # type: ignore[no-untyped-def]
    """Number of sides of a bond with cells."""
    sides = 0
    for side in range(SIDES):
        has_cells = False
        for part in range(first[side], first[side + 1]):
            has_cells |= _cell_kind_of_part(numbering, cells, divisions, part, x) != VOID
        sides += has_cells
    return sides


@cached_njit(error_model="numpy")
def store_bond_bits_and_pieces(fine, cells, bits, sites, pieces):  # type: ignore[no-untyped-def]
    """Set the bits of the whole bonds of nodes at the sites `sites`, which are in order, and list their pieces.

    Bonds are those of which a node is the lower end. Returns the number of pieces; those for which there is no room are
    only counted.
    """
    numbering, tiles, of, half, count = fine.numbering, fine.tiles, fine.divisions, len(fine.tiles.offsets) // 2, 0
    coarse_bits, fine_bits = np.empty((2, of.passed_cell_bits.shape[2]), np.uint64)
    for site in sites:
        if tiles.node[site] < 0:
            continue
        x = coordinates(numbering.fine, site)
        some_coarse, some_fine = _fill_bits_of_surrounding_cells(numbering, cells, of, x, coarse_bits, fine_bits)
        if not some_fine:
            continue
        tile, lane, place = site // ROW, np.uint16(site % ROW), position_number(x)
        for k in range(half):
            slot, passed = half + k, of.passed_cell_bits[place, k]
            if not (tiles.bits[tile, slot] >> lane) & np.uint16(1):
                continue
            if not some_coarse or not _have_common_bit(passed, coarse_bits):
                if not (bits[tile, slot] >> lane) & np.uint16(1):
                    _set_bond_bits(bits, site, site + tiles.offsets[slot], slot)
            elif _have_common_bit(passed, fine_bits):
                count = _append_pieces_outside_coarse_cells(fine, cells, site, x, k, pieces, count)
    return count


@njit(**INNER)
def _set_bond_bits(bits, site, target, slot):  # type: ignore[no-untyped-def]
    """Set both directions of a bond."""
    for end, number in ((site, slot), (target, bits.shape[1] - 1 - slot)):
        bits[end // ROW, number] |= np.uint16(1) << np.uint16(end % ROW)


@njit(**INNER)
def _append_pieces_outside_coarse_cells(fine, cells, site, x, k, pieces, count):  # type: ignore[no-untyped-def]
    """List the pieces of bond k of the node x (3,); returns how many there are then."""
    numbering, tiles, of = fine.numbering, fine.tiles, fine.divisions
    slot, first = len(tiles.offsets) // 2 + k, of.part_bounds_of_sides[position_number(x), k]
    sides = _count_sides_with_cells(numbering, cells, of, first, x)
    for side in range(SIDES):
        has_cells = False
        for part in range(first[side], first[side + 1]):
            has_cells |= _cell_kind_of_part(numbering, cells, of, part, x) != VOID
        part, last = first[side], first[side + 1]
        while has_cells and part < last:
            begin = part
            while part < last and _cell_kind_of_part(numbering, cells, of, part, x) != COARSE:
                part += 1
            if part > begin:
                if count < len(pieces.owner_site):
                    length = of.begin_and_end_shares[part - 1, 1] - of.begin_and_end_shares[begin, 0]
                    ends = _part_end_place(numbering, of, x, begin, 0), _part_end_place(numbering, of, x, part - 1, 1)
                    back = of.part_ends_at_node[part - 1, 1] and not of.part_ends_at_node[begin, 0]
                    pieces.owner_site[count], pieces.piece_kind[count] = (
                        site,
                        2 * (begin * PARTS + part - 1 - begin) + back,
                    )
                    pieces.near_end_place[count], pieces.far_end_place[count] = (ends[1], ends[0]) if back else ends
                    pieces.stiffness[count] = _bond_stiffness(fine, site, slot) / (sides * length)
                    i, j = tiles.node[site], tiles.node[site + tiles.offsets[slot]]
                    scale = fine.least_over_own_limit_strain_of_material_pair[pair_number(tiles, i, j)]
                    pieces.least_over_own_limit_strain[count] = (
                        0.0 if tiles.unbreakable[i] or tiles.unbreakable[j] else scale
                    )
                count += 1
            part += 1
    return count


@njit(**INNER)
def _bond_stiffness(fine, site, slot):  # type: ignore[no-untyped-def]
    """The stiffness of a whole bond, N/m."""
    tiles = fine.tiles
    at = tiles.margin + site
    w = stiffness(tiles, tiles.vectors[slot], site // ROW, at, tiles.offsets[slot])
    return tiles.cells[VOLUME, at] * fine.node_volume * w


# Where a part of a bond of fine node x begins or ends, h / unit: `at` (3,) from the corner of the node's cell
_place_in_units = along_each_axis(lambda along, axis, at, unit: unit * (along - along % 2) + at[axis])


@njit(**INNER)
def _part_end_place(numbering, divisions, x, part, side):  # type: ignore[no-untyped-def]
    """The place where a part of a bond of the node x (3,) begins, 0, or ends, 1."""
    unit = divisions.units_per_spacing
    return _blockwise_place_number(numbering, unit, _place_in_units(x, divisions.part_end_position[part, side], unit))


@njit(**INNER)
def _blockwise_place_number(numbering, unit, x):  # type: ignore[no-untyped-def]
    """The number of a place x (3,) in h / unit: block by block, so that what is near in space is near in memory."""
    (x, y, z), side = x, BLOCK * unit
    across, along = numbering.fine.counts[0] // BLOCK + 1, numbering.fine.counts[1] // BLOCK + 1
    block = (z // side * along + y // side) * across + x // side
    return ((block * side + z % side) * side + y % side) * side + x % side


@njit(**INNER)
def coordinates_of_place(numbering, unit, place):  # type: ignore[no-untyped-def]
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
def merge_pieces_into(old, is_owner_stale, new, order, merged):  # type: ignore[no-untyped-def]
    """Fill what is `merged` with the old pieces whose owners are not `is_owner_stale` (sites,) and with those `new`, in
    the `order` (q,) of their near ends."""
    at, n = 0, 0
    for m in order:
        while n < len(old.owner_site) and (
            old.near_end_place[n] < new.near_end_place[m]
            or (old.near_end_place[n] == new.near_end_place[m] and old.owner_site[n] < new.owner_site[m])
        ):
            at, n = at + _copy_piece(old, n, merged, at, not is_owner_stale[old.owner_site[n]]), n + 1
        at += _copy_piece(new, m, merged, at, True)
    while n < len(old.owner_site):
        at, n = at + _copy_piece(old, n, merged, at, not is_owner_stale[old.owner_site[n]]), n + 1


@njit(**INNER)
def _copy_piece(source, source_index, target, target_index, is_wanted):  # type: ignore[no-untyped-def]
    """Copy a piece if it is wanted; how many there are then."""
    if not is_wanted:
        return 0
    (
        target.owner_site[target_index],
        target.piece_kind[target_index],
        target.stiffness[target_index],
        target.least_over_own_limit_strain[target_index],
    ) = (
        source.owner_site[source_index],
        source.piece_kind[source_index],
        source.stiffness[source_index],
        source.least_over_own_limit_strain[source_index],
    )
    target.near_end_place[target_index], target.far_end_place[target_index] = (
        source.near_end_place[source_index],
        source.far_end_place[source_index],
    )
    return 1


@cached_njit(error_model="numpy")
def fill_piece_point_carriers(fine, node_kinds, places, points):  # type: ignore[no-untyped-def]
    """Fill in what moves the `places` (q,)."""
    numbering, unit = fine.numbering, fine.divisions.units_per_spacing
    for n in range(len(places)):
        x = coordinates_of_place(numbering, unit, places[n])
        sites, w = points.carrier_sites[n], points.carrier_weights[n]
        node, at_node = place_at(numbering.fine, divided(x, unit)), True
        for axis in range(3):
            at_node &= x[axis] % unit == 0
        if at_node and node_kinds[node] == FREE:
            _set_node_as_carrier(node, sites, w)
        else:
            _fill_coarse_interpolation_weights(numbering, x, 2 * unit, sites, w)
        points.carrier_count[n] = 0
        for m in range(ENDS):
            points.carrier_count[n] += w[m] > 0


def create_piece_points(fine: FineLattice, node_kinds: NDArray[np.uint8], places: NDArray[np.int64]) -> PiecePoints:
    """The points at these places (q,); `node_kinds` is of fine nodes."""
    count = len(places)
    points = PiecePoints(np.zeros(count, np.int64), np.zeros((count, ENDS), np.int32), np.zeros((count, ENDS)))
    fill_piece_point_carriers(fine, node_kinds, places, points)
    return points


def number_and_list_piece_vectors(
    divisions: BondDivisions, table: NDArray[np.floating], h: float
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The direction (q,) of each kind of pieces, and the xi, m, and 1 / |xi|^2 of each direction (g, 4).

    The kind of a piece is 2 PARTS times the number of its first part, plus twice that of those that follow it, plus 1
    if its near end is behind its far one.
    """
    begin = np.repeat(np.arange(len(divisions.begin_and_end_shares)), PARTS)
    last = np.minimum(
        begin + np.tile(np.arange(PARTS), len(divisions.begin_and_end_shares)), len(divisions.begin_and_end_shares) - 1
    )
    bond = np.searchsorted(divisions.part_bounds_of_sides[:, :, 0].ravel(), begin, side="right") - 1
    row = table[len(table) // 2 + bond % divisions.part_bounds_of_sides.shape[1]].astype(np.float64)
    length = divisions.begin_and_end_shares[last, 1] - divisions.begin_and_end_shares[begin, 0]
    length[length <= 0] = 1.0  # of no piece
    xi = np.column_stack([length[:, None] * row[:, :3], row[:, INVERSE] / length**2])
    _, which, direction = np.unique(np.round(xi[:, :3] / h, 9), axis=0, return_index=True, return_inverse=True)
    unique_xi = xi[which]
    both = np.stack([unique_xi, unique_xi * [-1, -1, -1, 1]], axis=1).reshape(-1, 4)
    return np.column_stack([2 * direction.ravel(), 2 * direction.ravel() + 1]).ravel().astype(np.int32), aligned(both)


@njit(**INNER)
def _set_node_as_carrier(node, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) of a node."""
    for n in range(ENDS):
        sites[n], w[n] = node, 0.0
    w[0] = 1.0


@njit(**INNER)
def _fill_coarse_interpolation_weights(numbering, x, cell_size, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (4,) of the coarse nodes that move a place x (3,) on the border of a cell; `cell_size`
    is 2 h in the unit of x."""
    count, cell = 0, divided(x, cell_size)
    for number in range(1 << len(x)):
        share = 1.0
        for axis in range(len(x)):
            along = x[axis] % cell_size / cell_size
            share *= along if number >> axis & 1 else 1 - along
        if share > 0 and count < ENDS:
            sites[count], w[count] = place_at(numbering.fine, multiplied(corner(cell, number), 2)), share
            count += 1
    for n in range(count, ENDS):
        sites[n], w[n] = sites[0], 0.0


@cached_njit(error_model="numpy")
def fill_border_carriers(numbering, border_sites, sites, w):  # type: ignore[no-untyped-def]
    """Fill the sites and weights (b, 4) by which fine nodes on the border, at the sites `border_sites` (b,), move."""
    for n in range(len(border_sites)):
        x = coordinates(numbering.fine, border_sites[n])
        _fill_coarse_interpolation_weights(numbering, x, 2, sites[n], w[n])


@cached_njit(error_model="numpy")
def gather_fine_values_to_coarse(fine, node_kinds, coarse_sites, fine_values, coarse_values):  # type: ignore[no-untyped-def]
    """Set `coarse_values` (k,) of coarse nodes at the fine sites `coarse_sites` to their shares of the `fine_values`
    (sites,) of all fine nodes that are not free."""
    numbering, tiles = fine.numbering, fine.tiles
    for n in range(len(coarse_sites)):
        x = coordinates(numbering.fine, coarse_sites[n])
        coarse_values[n] = 0.0
        for number in range(3 ** len(x)):
            near, share, inside = neighbour(x, 1, number), 1.0, True
            for axis in range(len(x)):
                inside &= 0 <= near[axis] < numbering.fine.counts[axis]
                share *= 1.0 if near[axis] == x[axis] else 0.5
            site = place_at(numbering.fine, near) if inside else -1
            if inside and tiles.node[site] >= 0 and node_kinds[site] != FREE:
                coarse_values[n] += share * fine_values[site]


@cached_njit(error_model="numpy")
def interpolate_at_fine_sites(numbering, row_at_site, node_values, fine_sites, fine_values):  # type: ignore[no-untyped-def]
    """Fill `fine_values` (k, 3) with those of fine nodes at the sites `fine_sites`, from `node_values` (n, 3).

    Nodes that were there before are those with a `row_at_site` (sites,) of at least 0; others lie in coarse cells, and
    have the mean of the coarse nodes that they lie between.
    """
    for n in range(len(fine_sites)):
        x, row, share = coordinates(numbering.fine, fine_sites[n]), row_at_site[fine_sites[n]], 1.0
        for axis in range(3):
            fine_values[n, axis] = node_values[row, axis] if row >= 0 else 0.0
            share /= 1 + (x[axis] & 1)
        for number in range(1 << len(x)):
            if row < 0 and number & ~position_number(x) == 0:
                end = place_at(numbering.fine, multiplied(corner(cell_of(x), number), 2))
                for axis in range(3):
                    fine_values[n, axis] += node_values[row_at_site[end], axis] * share


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


__all__ = [
    "ENDS",
    "ClippedPieces",
    "FineLattice",
    "PiecePoints",
    "allocate_pieces",
    "coordinates_of_place",
    "count_bonds_of_sites",
    "create_piece_points",
    "fill_border_carriers",
    "gather_fine_values_to_coarse",
    "interpolate_at_fine_sites",
    "list_bond_targets",
    "merge_pieces_into",
    "number_and_list_piece_vectors",
    "set_node_kinds",
    "store_bond_bits_and_pieces",
    "take_first_pieces",
]
