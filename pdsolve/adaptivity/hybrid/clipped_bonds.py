"""Whole bonds in fine cells, and the pieces of bonds that leave them.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, with the reference vector (t1 -
t0) xi. Under a linear field it pulls as the whole bond does. After A. V. Shapeev, Multiscale Model. Simul. 9 (2011)
905-932.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.nodes import coarse_carriers_on_edge
from pdsolve.adaptivity.hybrid.precracks import (
    full_bond_stiffness,
    is_bond_intact,
    is_unbreakable,
    peak_and_limit_strain,
)
from pdsolve.adaptivity.hybrid.springs import WINDOW
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.pair_laws.bilinear import intact_share
from pdsolve.zone.cells import EMPTY, FINE, IDLE, VOID, coordinates, place_at, shifted

EVERY = (1 << WINDOW**2) - 1  # all cells that bonds of a node could pass through


@njit(**INNER)
def _noncoarse_and_plate_cell_bits(lattice, cells, ix, iy):  # type: ignore[no-untyped-def]
    """The cells around a fine node that are not coarse, so that bonds are whole there, and those of the plate: a bit
    each, as `BondParts.side_cell_bits` has them."""
    whole_bond_bits, plate_bits, reach = np.uint64(EVERY), np.uint64(0), (lattice.family_reach + 1) // 2
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            cell_kind = cells[place_at(lattice.numbering.cells, ((ix >> 1) + x, (iy >> 1) + y))]
            bit = np.uint64(1) << np.uint64(WINDOW * (y + WINDOW // 2) + x + WINDOW // 2)
            whole_bond_bits &= np.uint64(EVERY) if cell_kind in (FINE, EMPTY) else ~bit
            plate_bits |= bit if cell_kind < VOID else np.uint64(0)
    return whole_bond_bits, plate_bits


@njit(forceinline=True, **INNER)
def _count_bond_sides_in_plate_whole_and_fine(lattice, place, k, whole_bond_bits, plate_bits):  # type: ignore[no-untyped-def]
    """On how many sides of a bond there are cells of the plate, on how many of them it is whole, and on how many it has
    a part in other cells than coarse ones."""
    sides = whole_sides = fine_sides = 0
    for side in range(2):
        bits = lattice.bond_parts.side_cell_bits[place, k, side]
        if plate_bits & bits != 0:
            sides += 1
            whole_sides += whole_bond_bits & bits == bits
            fine_sides += whole_bond_bits & bits != 0
    return sides, whole_sides, fine_sides


@njit(forceinline=True, **INNER)
def _is_bond_part_outside_coarse_cells(numbering, cells, bond_parts, x, y, part):  # type: ignore[no-untyped-def]
    """Whether a part of a bond lies in a fine cell and is not cut."""
    cell_kind = cells[place_at(numbering.cells, shifted((x, y), bond_parts.cell_offset[part]))]
    return cell_kind in (FINE, EMPTY)


@njit(**INNER)
def set_row_stiffness(lattice, zone, row):  # type: ignore[no-untyped-def]
    """Set the stiffnesses of the marked nodes of a row; returns whether all of the row are those of the table."""
    fine = zone.fine
    if not row_has_active_node(fine.node_kinds, row):
        return
    if lattice.softens_or_limits_vary and fine.stiffness_index_of_row[row] == -1:
        _initialize_threshold_strains(lattice, fine.threshold_strain[zone.counts.used_stiffness_rows], row)
    entry = find_or_reserve_stiffness_index(fine.stiffness_index_of_row, zone.counts, row)
    row_stiffness, same = fine.row_stiffness[entry], True
    for lane in range(ROW):
        p = row * ROW + lane
        if zone.is_node_marked[p]:
            _set_lane_stiffness(
                lattice, zone.cell_kinds, zone.broken_bond_bits, fine.node_kinds, p, row_stiffness, lane
            )
            if lattice.softens_or_limits_vary and zone.is_damaged[p]:
                _soften_lane_stiffness(lattice, p, row_stiffness, fine.threshold_strain[entry], lane)
    masks, alike = fine.spring_lane_masks[entry], not lattice.softens_or_limits_vary
    for k in range(len(lattice.family_dx)):
        full_stiffness, spring_lanes, half = lattice.spring_table[k, 5], 0, 0
        for lane in range(ROW):
            some = row_stiffness[k, lane]
            spring_lanes |= (some > 0) << lane
            half |= (some == 0.5 * full_stiffness) << lane
            alike &= some == full_stiffness or some == 0 or some == 0.5 * full_stiffness
            same &= some == full_stiffness
        masks[0, k], masks[1, k] = spring_lanes, half
    fine.uses_spring_lane_masks[entry] = alike
    fine.stiffness_index_of_row[row] = -2 - entry if same else entry


@njit(**INNER)
def _initialize_threshold_strains(lattice, threshold_strain, row):  # type: ignore[no-untyped-def]
    """Initialize the peaks of a row's bonds, below which they do not soften."""
    for k in range(len(lattice.family_dx)):
        for lane in range(ROW):
            p = row * ROW + lane
            j = p + lattice.neighbour_offsets[k]
            threshold_strain[k, lane] = (
                np.inf
                if is_unbreakable(lattice, p) or is_unbreakable(lattice, j)
                else peak_and_limit_strain(lattice, p, k)[0]
            )


@njit(**INNER)
def stretch_from_double_green_strain(double_green_strain):  # type: ignore[no-untyped-def]
    """The stretch s with e = s (s + 2)."""
    return double_green_strain / (np.sqrt(1 + double_green_strain) + 1)


@njit(**INNER)
def remaining_stiffness_share(largest_strain, peak_strain, limit_strain):  # type: ignore[no-untyped-def]
    """Remaining share of the stiffness of a bond that has been stretched to e."""
    if largest_strain <= peak_strain:
        return 1.0
    return intact_share(
        stretch_from_double_green_strain(largest_strain),
        stretch_from_double_green_strain(peak_strain),
        stretch_from_double_green_strain(limit_strain),
    )


@njit(**INNER)
def _soften_lane_stiffness(lattice, p, row_stiffness, threshold_strain, lane):  # type: ignore[no-untyped-def]
    """Reduce the stiffnesses of a node by the softening so far."""
    for k in range(len(lattice.family_dx)):
        peak, limit = peak_and_limit_strain(lattice, p, k)
        if row_stiffness[k, lane] > 0 and peak < threshold_strain[k, lane] < limit:
            row_stiffness[k, lane] *= remaining_stiffness_share(threshold_strain[k, lane], peak, limit)


@njit(**INNER)
def row_has_active_node(node_kinds, row):  # type: ignore[no-untyped-def]
    """Whether a row has a node that is not idle."""
    active = False
    for p in range(row * ROW, row * ROW + ROW):
        active |= node_kinds[p] != IDLE
    return active


@njit(**INNER)
def _set_lane_stiffness(lattice, cells, broken_bond_bits, node_kinds, p, row_stiffness, lane):  # type: ignore[no-untyped-def]
    ix, iy = coordinates(lattice.numbering.fine, p)
    place = ix % 2 + 2 * (iy % 2)
    row_stiffness[:, lane] = 0.0
    if node_kinds[p] == IDLE:
        return
    whole_bond_bits, plate_bits = _noncoarse_and_plate_cell_bits(lattice, cells, ix, iy)
    for k in range(len(lattice.family_dx)):
        if is_bond_intact(lattice, broken_bond_bits, p, k):
            sides, whole_sides, _ = _count_bond_sides_in_plate_whole_and_fine(
                lattice, place, k, whole_bond_bits, plate_bits
            )
            row_stiffness[k, lane] = full_bond_stiffness(lattice, p, k) * (whole_sides / sides if sides > 0 else 0.0)


@njit(**INNER)
def find_or_reserve_stiffness_index(stiffness_indices, counts, row):  # type: ignore[no-untyped-def]
    """Index of a row's own stiffnesses; a row that has none takes a new one."""
    stiffness_index = stiffness_indices[row]
    if stiffness_index >= 0:
        return stiffness_index
    if stiffness_index < -1:
        return -2 - stiffness_index
    counts.used_stiffness_rows += 1
    return counts.used_stiffness_rows - 1


@njit(**INNER)
def append_pieces_of_node(lattice, cells, broken_bond_bits, node_kinds, p, pieces, count):  # type: ignore[no-untyped-def]
    """Append the pieces of the bonds that a fine node owns; returns the new number of pieces."""
    numbering, bond_parts, half = lattice.numbering, lattice.bond_parts, len(lattice.family_dx) // 2
    ix, iy = coordinates(numbering.fine, p)
    x, y, place = ix >> 1, iy >> 1, ix % 2 + 2 * (iy % 2)
    whole_bond_bits, plate_bits = _noncoarse_and_plate_cell_bits(lattice, cells, ix, iy)
    if whole_bond_bits == EVERY:
        return count
    for k in range(half):
        sides, whole_sides, fine_sides = _count_bond_sides_in_plate_whole_and_fine(
            lattice, place, k, whole_bond_bits, plate_bits
        )
        if fine_sides == whole_sides or not is_bond_intact(lattice, broken_bond_bits, p, k):
            continue
        first = bond_parts.part_bounds_of_sides[place, k]
        for side in range(2):
            n, last = first[side], first[side + 1]
            if plate_bits & bond_parts.side_cell_bits[place, k, side] == 0:
                continue
            while n < last:
                if not _is_bond_part_outside_coarse_cells(numbering, cells, bond_parts, x, y, n):
                    n += 1
                    continue
                begin = n
                while n < last and _is_bond_part_outside_coarse_cells(numbering, cells, bond_parts, x, y, n):
                    n += 1
                if begin == first[side] and n == last:
                    continue
                _set_piece(lattice, node_kinds, p, k, begin, n - 1, pieces, count)
                pieces.spring_constants[count, 5] /= sides
                count += 1
    return count


@njit(**INNER)
def _set_piece(lattice, node_kinds, p, k, first, last, pieces, count):  # type: ignore[no-untyped-def]
    """Set the piece of bond k of fine node p from its part `first` to `last`."""
    pieces.owner_node[count] = p
    _set_piece_end(lattice, node_kinds, p, k, first, 0, pieces, count)
    _set_piece_end(lattice, node_kinds, p, k, last, 1, pieces, count)
    value, length = (
        pieces.spring_constants[count],
        lattice.bond_parts.begin_and_end_shares[last, 1] - lattice.bond_parts.begin_and_end_shares[first, 0],
    )
    value[2], value[3] = length * lattice.spring_table[k, 0], length * lattice.spring_table[k, 1]
    value[4] = lattice.spring_table[k, 4] / length**2
    value[5] = full_bond_stiffness(lattice, p, k) / length
    value[6] = 0.0 if is_unbreakable(lattice, p) or is_unbreakable(lattice, p + lattice.neighbour_offsets[k]) else 1.0


@njit(**INNER)
def _set_piece_end(lattice, node_kinds, p, k, part, side, pieces, count):  # type: ignore[no-untyped-def]
    """Set one end of a piece: a fine node, or a place between two coarse nodes."""
    numbering, bond_parts = lattice.numbering, lattice.bond_parts
    ix, iy = coordinates(numbering.fine, p)
    direction = bond_parts.part_end_edges[part, side, 2]
    end = pieces.end_nodes[count]
    if direction < 0:
        end[2 * side], end[2 * side + 1] = (
            place_at(numbering.fine, (ix + side * lattice.family_dx[k], iy + side * lattice.family_dy[k])),
            -1,
        )
        pieces.spring_constants[count, side] = 0.0
        return
    x, y = (ix >> 1) + bond_parts.part_end_edges[part, side, 0], (iy >> 1) + bond_parts.part_end_edges[part, side, 1]
    a, b, w = coarse_carriers_on_edge(
        lattice, node_kinds, x, y, direction, bond_parts.begin_and_end_shares_along_edge[part, side]
    )
    end[2 * side], end[2 * side + 1] = a, b
    pieces.spring_constants[count, side] = w


@njit(**INNER)
def replace_pieces_of_nodes(lattice, zone, affected_fine):  # type: ignore[no-untyped-def]
    """Replace the pieces owned by these fine nodes, given in order; all pieces stay ordered by owner."""
    old, new, count = zone.clipped_pieces, zone.spare_clipped_pieces, zone.counts.clipped_pieces
    remaining = pieces = count - count  # a plain 0 would be compiled for once more
    for p in affected_fine:
        pieces = append_pieces_of_node(
            lattice, zone.cell_kinds, zone.broken_bond_bits, zone.coarse.node_kinds, p, new, pieces
        )
        zone.is_node_marked[p] = True
    for n in range(count):
        if not zone.is_node_marked[old.owner_node[n]]:
            if n > remaining:
                _copy_piece(old, n, old, remaining)
            remaining += 1
    for p in affected_fine:
        zone.is_node_marked[p] = False
    at, n, m = remaining + pieces - 1, remaining - 1, pieces - 1
    while m >= 0:
        if n >= 0 and old.owner_node[n] > new.owner_node[m]:
            _copy_piece(old, n, old, at)
            n -= 1
        else:
            _copy_piece(new, m, old, at)
            m -= 1
        at -= 1
    zone.counts.clipped_pieces = remaining + pieces


@njit(forceinline=True, **INNER)
def _copy_piece(source, source_index, target, target_index):  # type: ignore[no-untyped-def]
    target.owner_node[target_index] = source.owner_node[source_index]
    for c in range(4):
        target.end_nodes[target_index, c] = source.end_nodes[source_index, c]
    for c in range(7):
        target.spring_constants[target_index, c] = source.spring_constants[source_index, c]
