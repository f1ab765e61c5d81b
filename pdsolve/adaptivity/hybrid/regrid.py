"""Refinement of cells; only their surroundings are recomputed."""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import NEWLY
from pdsolve.adaptivity.hybrid.clipped_bonds import replace_bond_pieces_of_nodes, set_bond_stiffnesses_of_row
from pdsolve.adaptivity.hybrid.damping import remove_damping_of_component, set_damping_of_node
from pdsolve.adaptivity.hybrid.energy import energy_of_supports, strain_and_kinetic_energy
from pdsolve.adaptivity.hybrid.far_cells import set_all_coarsest_node_properties
from pdsolve.adaptivity.hybrid.forces import interpolate_border_nodes
from pdsolve.adaptivity.hybrid.node_constants import node_constant_at_place
from pdsolve.adaptivity.hybrid.nodes import (
    adjacent_coarse_cell,
    coarse_interpolation_nodes_of_border_node,
    interpolate_coarse_at_fine_place,
    list_active_rows,
    list_coarsest_rows_and_tied_coarse_nodes,
    set_coarse_node_properties,
    set_fine_node_kind_and_mass,
)
from pdsolve.adaptivity.hybrid.swelling import set_swelling_offsets_of_bond_pieces, swelling_offset_from_chord
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.zone.cells import (
    BORDER,
    COARSE,
    FAR,
    FINE,
    FREE,
    cell_corner,
    count_cells_of_kind_around,
    lattice_coordinates,
    place_number_at,
    place_on_finer_lattice,
    scale_coordinates,
)


@njit(**INNER)
def _mark_nodes_near_new_cells(lattice, zone):  # type: ignore[no-untyped-def]
    """Mark all places within the family's reach of the new cells; returns their range of columns and rows."""
    numbering, reach = lattice.numbering, lattice.family_reach + 2
    (x0, y0), x1, y1 = numbering.fine.counts, 0, 0
    for c in zone.new_cells[: zone.counts.new_cells]:
        x, y = scale_coordinates(lattice_coordinates(numbering.cells, c), 2)
        left_side, right = max(x - reach, 0), min(x + reach + 3, numbering.fine.counts[0])
        low, high = max(y - reach, 0), min(y + reach + 3, numbering.fine.counts[1])
        x0, y0, x1, y1 = min(x0, left_side), min(y0, low), max(x1, right), max(y1, high)
        for iy in range(low, high):
            for p in range(
                place_number_at(numbering.fine, (left_side, iy)), place_number_at(numbering.fine, (right, iy))
            ):
                zone.is_node_marked[p] = True
    return x0, y0, x1, y1


@njit(**INNER)
def list_nodes_affected_by_new_cells(lattice, zone):  # type: ignore[no-untyped-def]
    """List, in order, the nodes affected by the new cells; returns the number of affected rows of fine nodes.

    Affected are the fine nodes within the family's reach and the coarse nodes at corners; at the start, all of them.
    """
    numbering, (x0, y0, x1, y1) = lattice.numbering, _mark_nodes_near_new_cells(lattice, zone)
    affected_fine, rows, last = 0, 0, -1
    for iy in range(y0, y1):
        for p in range(place_number_at(numbering.fine, (x0, iy)), place_number_at(numbering.fine, (x1, iy))):
            if zone.is_node_marked[p]:
                zone.is_node_marked[p] = False
                if node_constant_at_place(lattice.node_constants, lattice.node_constants.mass, p) > 0:
                    zone.affected_fine_nodes[affected_fine] = p
                    rows += p // ROW != last
                    affected_fine, last = affected_fine + 1, p // ROW
    zone.counts.affected_fine_nodes = affected_fine
    _list_coarse_nodes_at_corners(numbering, zone, x0, y0, x1, y1)
    return rows


@njit(**INNER)
def _list_coarse_nodes_at_corners(numbering, zone, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """List, in order, the coarse nodes at the corners of the new cells; at the start, all coarse nodes that are
    not amid far cells.

    The new cells lie within these columns and rows of fine nodes.
    """
    begins, affected_coarse_count = zone.counts.cell_changes == 0, 0
    if begins:
        x0, y0, x1, y1 = 0, 0, numbering.fine.counts[0], numbering.fine.counts[1]
    for c in zone.new_cells[: zone.counts.new_cells]:
        p = place_number_at(numbering.fine, scale_coordinates(lattice_coordinates(numbering.cells, c), 2))
        for corner_place in (p, p + 2, p + 2 * numbering.fine.strides[1], p + 2 * numbering.fine.strides[1] + 2):
            zone.is_node_marked[corner_place] = True
    for iy in range(y0 + y0 % 2, y1, 2):
        for ix in range(x0 + x0 % 2, x1, 2):
            p = place_number_at(numbering.fine, (ix, iy))
            if zone.is_node_marked[p] or (
                begins and count_cells_of_kind_around(numbering, zone.cell_kinds, (ix, iy), FAR) < 4
            ):
                zone.is_node_marked[p] = False
                zone.affected_coarse_nodes[affected_coarse_count] = place_number_at(
                    numbering.coarse, (ix // 2, iy // 2)
                )
                affected_coarse_count += 1
    zone.counts.affected_coarse_nodes = affected_coarse_count


@njit(**INNER)
def refine_cells(lattice, zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Make the marked cells in `zone.new_cells` fine at displacements `displacement_buffer_index`.

    New nodes take the coarse displacements and velocities; the change of energy is booked.
    """
    counts, u, coarse_u = zone.counts, zone.fine.u[displacement_buffer_index], zone.coarse.u[displacement_buffer_index]
    new, affected_fine = zone.new_cells[: counts.new_cells], zone.affected_fine_nodes[: counts.affected_fine_nodes]
    affected_coarse = zone.affected_coarse_nodes[: counts.affected_coarse_nodes]
    interpolate_border_nodes(u, coarse_u, zone.border_nodes, counts.border_nodes)
    for p in affected_fine:
        zone.is_node_marked[p] = True
    for c in new:
        zone.cell_kinds[c] = COARSE
    of_supports = energy_of_supports(zone, displacement_buffer_index)
    before = strain_and_kinetic_energy(lattice, zone, displacement_buffer_index, affected_fine, affected_coarse)
    _interpolate_and_refine(lattice, zone, new, affected_fine, displacement_buffer_index)
    set_affected_node_properties(lattice, zone, affected_fine, affected_coarse, displacement_buffer_index)
    if zone.counts.cell_changes == 0:
        set_all_coarsest_node_properties(lattice, zone)
    replace_bond_pieces_of_nodes(lattice, zone, affected_fine)
    set_swelling_offsets_of_bond_pieces(lattice, zone)
    for p in affected_fine:
        zone.is_node_marked[p] = True
    zone.totals.refinement_energy += (
        strain_and_kinetic_energy(lattice, zone, displacement_buffer_index, affected_fine, affected_coarse) - before
    )
    for p in affected_fine:
        zone.is_node_marked[p] = False
    rebuild_node_lists(lattice, zone)
    zone.totals.refinement_energy += energy_of_supports(zone, displacement_buffer_index) - of_supports


@njit(**INNER)
def set_affected_node_properties(lattice, zone, affected_fine, affected_coarse, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of these nodes."""
    fine, coarse, last = zone.fine, zone.coarse, -1
    for p in affected_fine:
        mass = node_constant_at_place(lattice.node_constants, lattice.node_constants.mass, p)
        set_fine_node_kind_and_mass(lattice.numbering, mass, zone.cell_kinds, fine, p)
        set_damping_of_node(lattice, fine, p, p)
    for q in affected_coarse:
        set_coarse_node_properties(lattice, zone.cell_kinds, fine, coarse, q)
        p = place_on_finer_lattice(lattice.numbering.coarse, lattice.numbering.fine, 2, q)
        set_damping_of_node(lattice, coarse, q, p)
    for p in affected_fine:
        if fine.node_kinds[p] == BORDER:
            a, b, w = coarse_interpolation_nodes_of_border_node(lattice, coarse.node_kinds, p)
            off = swelling_offset_from_chord(lattice, fine.negative_half_swelling, a, b, w)
            for axis in range(2):
                fine.u[displacement_buffer_index, axis, p] = (
                    (1 - w) * coarse.u[displacement_buffer_index, axis, a]
                    + w * coarse.u[displacement_buffer_index, axis, b]
                    + off[axis]
                )
                fine.v[axis, p] = 0.0
    for p in affected_fine:
        if p // ROW != last:
            last = p // ROW
            set_bond_stiffnesses_of_row(lattice, zone, last)


@njit(**INNER)
def _interpolate_and_refine(lattice, zone, new_cells, affected_fine, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Give nodes that become free the motion of the coarse ones around them, then make the new cells fine."""
    numbering, fine, coarse, two = lattice.numbering, zone.fine, zone.coarse, zone.lane_sums[0, :2]
    for p in affected_fine:
        if fine.node_kinds[p] == FREE:
            continue
        ix, iy = lattice_coordinates(numbering.fine, p)
        x, y = adjacent_coarse_cell(numbering, zone.cell_kinds, ix, iy)
        if x < 0:
            continue
        interpolate_coarse_at_fine_place(
            lattice, coarse.node_kinds, coarse.u[displacement_buffer_index], ix, iy, x, y, two
        )
        off = 0.0, 0.0
        if ix % 2 != iy % 2 and not lattice.is_cell_cut[place_number_at(numbering.cells, (x, y))]:
            q = place_number_at(numbering.coarse, (ix // 2, iy // 2))
            off = swelling_offset_from_chord(
                lattice, fine.negative_half_swelling, q, q + (1 if ix % 2 else numbering.coarse.strides[1]), 0.5
            )
        fine.u[displacement_buffer_index, 0, p], fine.u[displacement_buffer_index, 1, p] = (
            two[0] + off[0],
            two[1] + off[1],
        )
        interpolate_coarse_at_fine_place(lattice, coarse.node_kinds, coarse.v, ix, iy, x, y, two)
        fine.v[0, p], fine.v[1, p] = two[0], two[1]
    for c in new_cells:
        zone.cell_kinds[c] = FINE


@njit(**INNER)
def _list_fine_rows_and_border_nodes(lattice, zone):  # type: ignore[no-untyped-def]
    """List rows with fine nodes, and border nodes."""
    fine, coarse, rows, borders = zone.fine, zone.coarse, 0, 0
    for row in range(len(fine.stiffness_index_of_row)):
        if fine.stiffness_index_of_row[row] == -1:
            continue
        fine.active_rows[rows] = row
        rows += 1
        for p in range(row * ROW, row * ROW + ROW):
            if fine.node_kinds[p] != BORDER:
                continue
            a, b, w = coarse_interpolation_nodes_of_border_node(lattice, coarse.node_kinds, p)
            node = zone.border_nodes[borders]
            node.border_node, node.first_coarser_node, node.second_coarser_node, node.second_weight = p, a, b, w
            node.swelling_x, node.swelling_y = swelling_offset_from_chord(lattice, fine.negative_half_swelling, a, b, w)
            fine.has_extra_forces[row] = coarse.has_extra_forces[a // ROW] = coarse.has_extra_forces[b // ROW] = True
            borders += 1
    zone.counts.active_fine_rows, zone.counts.border_nodes = rows, borders


@njit(**INNER)
def rebuild_node_lists(lattice, zone):  # type: ignore[no-untyped-def]
    """Rebuild the lists of rows, border nodes, loads and holds once cells have become others."""
    fine, coarse = zone.fine, zone.coarse
    zone.counts.cell_changes += 1
    zone.counts.refined_damaged_nodes = zone.counts.damaged_nodes
    zone.counts.new_cells = 0
    fine.has_extra_forces[:] = False
    coarse.has_extra_forces[:] = False
    zone.counts.active_coarse_rows = list_active_rows(coarse)
    list_coarsest_rows_and_tied_coarse_nodes(lattice, zone, zone.counts.active_coarse_rows)
    _list_fine_rows_and_border_nodes(lattice, zone)
    for n in range(zone.counts.clipped_pieces):
        for side in range(2):
            end = zone.clipped_pieces.ends[n, side]
            if end.second_node < 0:
                fine.has_extra_forces[end.first_node // ROW] = True
            else:
                coarse.has_extra_forces[end.first_node // ROW] = True
                coarse.has_extra_forces[end.second_node // ROW] = True
    zone.counts.node_loads = _distribute_loads(lattice.numbering, zone.cell_kinds, fine, coarse, zone.loads)
    zone.counts.node_supports = _distribute_loads(lattice.numbering, zone.cell_kinds, fine, coarse, zone.supports)
    zone.counts.prescribed_components = _list_prescribed_nodes(lattice.numbering, fine, coarse, zone.holds)


@njit(**INNER)
def _distribute_loads(numbering, cells, fine, coarse, loads):  # type: ignore[no-untyped-def]
    """Distribute loads, or springs to the ground, to moving nodes: those of others go to the coarse nodes around."""
    count = 0
    for n in range(len(loads.entries)):
        p = loads.entries[n].fine_place
        if fine.node_kinds[p] == FREE:
            loads.node_and_entry[count, 0], loads.node_and_entry[count, 1], loads.node_share[count] = p, n, 1.0
            fine.has_extra_forces[p // ROW] = True
            count += 1
            continue
        ix, iy = lattice_coordinates(numbering.fine, p)
        x, y = adjacent_coarse_cell(numbering, cells, ix, iy)
        wx, wy = (ix - 2 * x) / 2, (iy - 2 * y) / 2
        for number in range(4):
            column, row = cell_corner((x, y), number)
            w = (wx if column > x else 1 - wx) * (wy if row > y else 1 - wy)
            if w > 0:
                q = place_number_at(numbering.coarse, (column, row))
                loads.node_and_entry[count, 0], loads.node_and_entry[count, 1], loads.node_share[count] = -1 - q, n, w
                coarse.has_extra_forces[q // ROW] = True
                count += 1
    return count


@njit(**INNER)
def _list_prescribed_nodes(numbering, fine, coarse, holds):  # type: ignore[no-untyped-def]
    """List the moving nodes that are held.

    A fine node that did not move by itself has the velocity of the coarse ones around it since the last step.
    """
    count = 0
    for n in range(len(holds.entries)):
        entry, moved = holds.entries[n], holds.entries[n].node_moves
        p, entry.node_moves = entry.fine_place, 0
        ix, iy = lattice_coordinates(numbering.fine, p)
        if fine.node_kinds[p] == FREE:
            holds.node_and_entry[count, 0], holds.node_and_entry[count, 1] = p, n
            fine.has_extra_forces[p // ROW] = True
            remove_damping_of_component(fine, p, entry.axis)
            if moved == 0:
                entry.mean_speed_since_last_step, entry.force_on_prescribed_component = fine.v[entry.axis, p], 0.0
            entry.node_moves = max(moved, NEWLY)
            count += 1
        elif (
            ix % 2 == 0
            and iy % 2 == 0
            and coarse.node_kinds[place_number_at(numbering.coarse, (ix // 2, iy // 2))] == FREE
        ):
            q = place_number_at(numbering.coarse, (ix // 2, iy // 2))
            holds.node_and_entry[count, 0], holds.node_and_entry[count, 1] = -1 - q, n
            coarse.has_extra_forces[q // ROW] = True
            remove_damping_of_component(coarse, q, entry.axis)
            entry.node_moves = max(moved, NEWLY)
            count += 1
    return count
