"""Whole bonds in fine cells, and the pieces of bonds that leave them.

A piece from t0 to t1 of a bond is a spring of stiffness k / (t1 - t0) between its ends, with the reference vector (t1 -
t0) xi. Under a linear field it pulls as the whole bond does. After A. V. Shapeev, Multiscale Model. Simul. 9 (2011)
905-932.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.nodes import coarse_interpolation_nodes_on_edge
from pdsolve.adaptivity.hybrid.precracks import (
    full_bond_stiffness,
    is_bond_intact,
    is_unbreakable,
    peak_and_limit_strain,
)
from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.row_histories import begin_bond, is_usual
from pdsolve.laws.calls import pair_of
from pdsolve.laws.pair_laws.bilinear import intact_share
from pdsolve.zone.bond_parts import lowest_cell_around, next_parts_outside_coarse_cells
from pdsolve.zone.cells import (
    EMPTY,
    FINE,
    IDLE,
    VOID,
    add_step,
    cell_at,
    corner_number_in_cell,
    lattice_coordinates,
    place_number_at,
)
from pdsolve.zone.springs import INVERSE, X, Y

EVERY = np.uint64(2**64 - 1)  # all cells that bonds of a node could pass through


@njit(**INNER)
def _bit_masks_of_fine_and_plate_cells_around(lattice, cells, x):  # type: ignore[no-untyped-def]
    """The cells around fine node x (2,) that are not coarse, so that bonds are whole there, and those of the plate: a
    bit each, as `BondPartsInCells.side_cell_bits` has them."""
    unclipped_bond_bits, plate_bits, bit = EVERY, np.uint64(0), np.uint64(1)
    bond_parts = lattice.bond_parts
    (left_side, low), wide = lowest_cell_around(x, bond_parts.lowest_cell_offset), bond_parts.cells_around_per_axis
    for row in range(low, low + wide):
        first = place_number_at(lattice.numbering.cells, (left_side, row))
        for c in range(first, first + wide):
            cell_kind = cells[c]
            unclipped_bond_bits &= EVERY if cell_kind in (FINE, EMPTY) else ~bit
            plate_bits |= bit if cell_kind < VOID else np.uint64(0)
            bit <<= np.uint64(1)
    return unclipped_bond_bits, plate_bits


@njit(forceinline=True, **INNER)
def _count_sides_with_plate_whole_bond_and_parts(lattice, position, k, unclipped_bond_bits, plate_bits):  # type: ignore[no-untyped-def]
    """On how many sides of a bond there are cells of the plate, on how many of them it is whole, and on how many it has
    a part in other cells than coarse ones."""
    sides = whole_sides = fine_sides = 0
    for side in range(2):
        bits = lattice.bond_parts.side_cell_bits[position, k, side, 0]
        if plate_bits & bits != 0:
            sides += 1
            whole_sides += unclipped_bond_bits & bits == bits
            fine_sides += unclipped_bond_bits & bits != 0
    return sides, whole_sides, fine_sides


@njit(**INNER)
def set_bond_stiffnesses_of_row(lattice, zone, row):  # type: ignore[no-untyped-def]
    """Set the stiffnesses of the marked nodes of a row; returns whether all of the row are those of the table."""
    fine = zone.fine
    if not row_has_active_node(fine.node_kinds, row):
        return
    if lattice.softens_or_limits_vary and fine.stiffness_index_of_row[row] == -1:
        _initialize_thresholds_and_histories(lattice, fine, zone.history, zone.counts.used_stiffness_rows, row)
    entry = find_or_reserve_stiffness_index(fine.stiffness_index_of_row, zone.counts, row)
    row_stiffness, same = fine.row_stiffness[entry], True
    for lane in range(ROW):
        p = row * ROW + lane
        if zone.is_node_marked[p]:
            _set_bond_stiffnesses_of_node(
                lattice, zone.cell_kinds, zone.broken_bond_bits, fine.node_kinds, p, row_stiffness, lane
            )
            if lattice.softens_or_limits_vary and zone.is_damaged[p]:
                _soften_bond_stiffnesses_of_node(zone.history, lattice, fine, p, entry, lane)
    masks, alike = fine.spring_lane_masks[entry], not lattice.softens_or_limits_vary
    for k in range(len(lattice.family_dx)):
        full_stiffness, spring_lanes, half = lattice.spring_table[k, 5], 0, 0
        for lane in range(ROW):
            some = row_stiffness[k, lane]
            spring_lanes |= (some > 0) << lane
            half |= (some == 0.5 * full_stiffness) << lane
            alike &= some == full_stiffness or some == 0 or some == 0.5 * full_stiffness
            same &= some == full_stiffness and is_usual(zone.history, entry, k, lane)
        masks[0, k], masks[1, k] = spring_lanes, half
    fine.uses_spring_lane_masks[entry] = alike
    fine.stiffness_index_of_row[row] = -2 - entry if same else entry


@njit(**INNER)
def _initialize_thresholds_and_histories(lattice, fine, history, entry, row):  # type: ignore[no-untyped-def]
    """Initialize the e of a row's bonds up to which nothing happens to them, and what their law remembers."""
    for k in range(len(lattice.family_dx)):
        for lane in range(ROW):
            p = row * ROW + lane
            j = p + lattice.neighbour_offsets[k]
            peak, limit = peak_and_limit_strain(lattice, p, k)
            if is_unbreakable(lattice, p) or is_unbreakable(lattice, j):
                peak = limit = np.inf
            fine.threshold_strain[entry, k, lane] = strain_of_first_change(lattice, peak, limit)
            begin_bond(history, entry, k, lane, stretch_of_limit(peak), stretch_of_limit(limit))


@overloaded(INNER)
def strain_of_first_change(lattice, peak, limit):  # type: ignore[no-untyped-def]
    """The e beyond which a bond softens, or breaks under a law that does not soften."""
    columns = lattice.types[lattice.instance_class._fields.index("empty_law_columns")]
    if pair_of(columns).softening is None:
        return lambda lattice, peak, limit: limit
    return lambda lattice, peak, limit: peak


@njit(**INNER)
def stretch_of_limit(double_green_strain):  # type: ignore[no-untyped-def]
    """The stretch of a peak or a limit, which may be infinite."""
    if double_green_strain == np.inf:
        return np.inf
    return stretch_from_double_green_strain(double_green_strain)


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
def _reduce_stiffnesses(lattice, fine, p, entry, lane):  # type: ignore[no-untyped-def]
    row_stiffness, threshold_strain = fine.row_stiffness[entry], fine.threshold_strain[entry]
    for k in range(len(lattice.family_dx)):
        peak, limit = peak_and_limit_strain(lattice, p, k)
        if row_stiffness[k, lane] > 0 and peak < threshold_strain[k, lane] < limit:
            row_stiffness[k, lane] *= remaining_stiffness_share(threshold_strain[k, lane], peak, limit)


@overloaded(INNER)
def _soften_bond_stiffnesses_of_node(history, lattice, fine, p, entry, lane):  # type: ignore[no-untyped-def]
    """Reduce the stiffnesses of a node by the softening so far, unless its bonds' histories have it."""
    if is_none(history):
        return lambda history, lattice, fine, p, entry, lane: _reduce_stiffnesses(lattice, fine, p, entry, lane)
    return lambda history, lattice, fine, p, entry, lane: None


@njit(**INNER)
def row_has_active_node(node_kinds, row):  # type: ignore[no-untyped-def]
    """Whether a row has a node that is not idle."""
    active = False
    for p in range(row * ROW, row * ROW + ROW):
        active |= node_kinds[p] != IDLE
    return active


@njit(**INNER)
def _set_bond_stiffnesses_of_node(lattice, cells, broken_bond_bits, node_kinds, p, row_stiffness, lane):  # type: ignore[no-untyped-def]
    x = lattice_coordinates(lattice.numbering.fine, p)
    position = corner_number_in_cell(x)
    row_stiffness[:, lane] = 0.0
    if node_kinds[p] == IDLE:
        return
    unclipped_bond_bits, plate_bits = _bit_masks_of_fine_and_plate_cells_around(lattice, cells, x)
    for k in range(len(lattice.family_dx)):
        if is_bond_intact(lattice, broken_bond_bits, p, k):
            sides, whole_sides, _ = _count_sides_with_plate_whole_bond_and_parts(
                lattice, position, k, unclipped_bond_bits, plate_bits
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
def append_bond_pieces_of_node(lattice, cells, broken_bond_bits, node_kinds, p, pieces, count):  # type: ignore[no-untyped-def]
    """Append the pieces of the bonds that a fine node owns; returns the new number of pieces."""
    numbering, bond_parts, half = lattice.numbering, lattice.bond_parts, len(lattice.family_dx) // 2
    x = lattice_coordinates(numbering.fine, p)
    position = corner_number_in_cell(x)
    unclipped_bond_bits, plate_bits = _bit_masks_of_fine_and_plate_cells_around(lattice, cells, x)
    if unclipped_bond_bits == EVERY:
        return count
    for k in range(half):
        sides, whole_sides, fine_sides = _count_sides_with_plate_whole_bond_and_parts(
            lattice, position, k, unclipped_bond_bits, plate_bits
        )
        if fine_sides == whole_sides or not is_bond_intact(lattice, broken_bond_bits, p, k):
            continue
        for side in range(2):
            if plate_bits & bond_parts.side_cell_bits[position, k, side, 0] == 0:
                continue
            first, last = (
                bond_parts.part_bounds_of_sides[position, k, side],
                bond_parts.part_bounds_of_sides[position, k, side + 1],
            )
            begin, end = next_parts_outside_coarse_cells(numbering.cells, cells, bond_parts, x, first, last, False)
            while begin < end:
                if begin > first or end < last:
                    _set_bond_piece(lattice, node_kinds, p, k, begin, end - 1, pieces, count)
                    pieces.springs[count].stiffness /= sides
                    count += 1
                begin, end = next_parts_outside_coarse_cells(numbering.cells, cells, bond_parts, x, end, last, False)
    return count


@njit(**INNER)
def _set_bond_piece(lattice, node_kinds, p, k, first, last, pieces, count):  # type: ignore[no-untyped-def]
    """Set the piece of bond k of fine node p from its part `first` to `last`."""
    spring, shares, j = pieces.springs[count], lattice.bond_parts.begin_and_end_shares, p + lattice.neighbour_offsets[k]
    _set_bond_piece_end(lattice, node_kinds, p, k, first, 0, pieces.ends[count, 0])
    _set_bond_piece_end(lattice, node_kinds, p, k, last, 1, pieces.ends[count, 1])
    spring.owner_node, length = p, shares[last, 1] - shares[first, 0]
    spring.xi_x, spring.xi_y = length * lattice.spring_table[k, X], length * lattice.spring_table[k, Y]
    spring.inverse_square = lattice.spring_table[k, INVERSE] / length**2
    spring.stiffness = full_bond_stiffness(lattice, p, k) / length
    spring.is_breakable = 0.0 if is_unbreakable(lattice, p) or is_unbreakable(lattice, j) else 1.0


@njit(**INNER)
def _set_bond_piece_end(lattice, node_kinds, p, k, part, side, end):  # type: ignore[no-untyped-def]
    """Set one end of a piece: a fine node, or a place between two coarse nodes."""
    bond_parts = lattice.bond_parts
    if bond_parts.begin_and_end_shares[part, side] == side:
        end.first_node, end.second_node, end.second_weight = p + side * lattice.neighbour_offsets[k], -1, 0.0
        return
    x, y = add_step(cell_at(lattice_coordinates(lattice.numbering.fine, p)), bond_parts.end_cells[part, side])
    along = bond_parts.end_shares_of_cell[part, side]
    direction, w = 0 if along[0] > 0 else 1, max(along[0], along[1])
    a, b, second_weight = coarse_interpolation_nodes_on_edge(lattice, node_kinds, x, y, direction, w)
    end.first_node, end.second_node, end.second_weight = a, b, second_weight


@njit(**INNER)
def replace_bond_pieces_of_nodes(lattice, zone, affected_fine):  # type: ignore[no-untyped-def]
    """Replace the pieces owned by these fine nodes, given in order; all pieces stay ordered by owner."""
    old, new, count = zone.clipped_pieces, zone.spare_clipped_pieces, zone.counts.clipped_pieces
    remaining = pieces = count - count  # a plain 0 would be compiled for once more
    for p in affected_fine:
        pieces = append_bond_pieces_of_node(
            lattice, zone.cell_kinds, zone.broken_bond_bits, zone.coarse.node_kinds, p, new, pieces
        )
        zone.is_node_marked[p] = True
    for n in range(count):
        if not zone.is_node_marked[old.springs[n].owner_node]:
            if n > remaining:
                _copy_bond_piece(old, n, old, remaining)
            remaining += 1
    for p in affected_fine:
        zone.is_node_marked[p] = False
    at, n, m = remaining + pieces - 1, remaining - 1, pieces - 1
    while m >= 0:
        if n >= 0 and old.springs[n].owner_node > new.springs[m].owner_node:
            _copy_bond_piece(old, n, old, at)
            n -= 1
        else:
            _copy_bond_piece(new, m, old, at)
            m -= 1
        at -= 1
    zone.counts.clipped_pieces = remaining + pieces


@njit(forceinline=True, **INNER)
def _copy_bond_piece(source, source_index, target, target_index):  # type: ignore[no-untyped-def]
    target.springs[target_index] = source.springs[source_index]
    for side in range(2):
        target.ends[target_index, side] = source.ends[source_index, side]
