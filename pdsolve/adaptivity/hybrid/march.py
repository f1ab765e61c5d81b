"""Time steps by leapfrog (as in `pdsolve.steppers.verlet`) of free fine nodes and coarse nodes.

Every few steps, cells are refined near nodes with a broken or softened bond, near stretched coarse bonds, and near
clipped bonds that would soften or break before the next look.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.energy import (
    bond_piece_double_green_strain,
    bond_piece_elongation,
    double_green_strain_of_spring,
)
from pdsolve.adaptivity.hybrid.far_cells import divide_coarsest_cells
from pdsolve.adaptivity.hybrid.forces import interpolate_border_nodes, reset_job_counters, sum_forces_and_move_nodes
from pdsolve.adaptivity.hybrid.kicks_and_prescribed_velocities import (
    apply_prescribed_motions,
    half_kick_and_drift_all_lattices,
    restore_prescribed_velocities,
    store_constraint_forces,
)
from pdsolve.adaptivity.hybrid.node_constants import node_constant_at_place
from pdsolve.adaptivity.hybrid.precracks import is_unbreakable
from pdsolve.adaptivity.hybrid.regrid import (
    list_nodes_affected_by_new_cells,
    rebuild_node_lists,
    refine_cells,
)
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.row_histories import strain_off_straight
from pdsolve.numerics.thread_team import meet
from pdsolve.zone.cells import (
    AHEAD,
    EVERY,
    FINE,
    IDLE,
    lattice_coordinates,
    mark_and_list_new_fine_cells_near,
    place_on_finer_lattice,
    scale_coordinates,
)

DONE, ROOM, CLIP = 0, 1, 2  # how a march ends: at its last step; for want of room; as a clipped bond is over its limit
NEARLY = 0.9  # of the e at which a clipped bond softens or breaks
SPARE = 64  # rows: room for so many more is always kept


@njit(**INNER)
def _list_cells_to_refine_near_stretched_coarse_bonds(lattice, zone, displacement_buffer_index, count):  # type: ignore[no-untyped-def]
    """List the cells to refine near the nodes of a stretched coarse bond; returns their new `count`."""
    numbering, coarse, u, constants = (
        lattice.numbering,
        zone.coarse,
        zone.coarse.u[displacement_buffer_index],
        lattice.node_constants,
    )
    table, offsets = lattice.coarse_spring_table, lattice.coarse_neighbour_offsets
    for n in range(zone.counts.active_coarse_rows):
        row = coarse.active_rows[n]
        if coarse.has_large_stretch[row] == 0:
            continue
        for lane in range(ROW):
            q = row * ROW + lane
            if coarse.node_kinds[q] == IDLE or _is_coarse_node_unbreakable(lattice, q):
                continue
            p = place_on_finer_lattice(numbering.coarse, numbering.fine, 2, q)
            bound = lattice.strain_bounds[node_constant_at_place(constants, constants.material, p), 2]
            for k in range(len(offsets)):
                strain = double_green_strain_of_spring(coarse, table, offsets, u, q, k)
                if strain_off_straight(zone.history, strain) > bound and not _is_coarse_node_unbreakable(
                    lattice, q + offsets[k]
                ):
                    x = scale_coordinates(lattice_coordinates(numbering.coarse, q), 2)
                    count = mark_and_list_new_fine_cells_near(
                        numbering.cells, zone.cell_kinds, x, AHEAD, zone.new_cells, count
                    )
                    break
    return count


@njit(**INNER)
def _list_cells_to_refine_near_strained_bond_pieces(lattice, zone, displacement_buffer_index, count):  # type: ignore[no-untyped-def]
    """List the cells to refine near clipped bonds that would soften or break before the next look at the strain rates
    they have; returns the new `count`.

    Those that are strained less than coarse bonds that make cells fine do not count; those that are `NEARLY` there
    count at any rate.
    """
    (peak, _, bound), time = lattice.least_strain_bounds, EVERY * lattice.dt  # s, until the next look
    fine, coarse, pieces = zone.fine, zone.coarse, zone.clipped_pieces
    interpolate_border_nodes(
        fine.u[displacement_buffer_index],
        coarse.u[displacement_buffer_index],
        zone.border_nodes,
        zone.counts.border_nodes,
    )
    _set_border_velocities_to_interpolated(zone, 1.0)
    for n in range(zone.counts.clipped_pieces):
        spring, (eta_x, eta_y) = (
            pieces.springs[n],
            bond_piece_elongation(pieces, fine.u[displacement_buffer_index], coarse.u[displacement_buffer_index], n),
        )
        e, (v_x, v_y) = (
            bond_piece_double_green_strain(spring, eta_x, eta_y),
            bond_piece_elongation(pieces, fine.v, coarse.v, n),
        )
        eta_x, eta_y = eta_x + time * (v_x - spring.swelling_x), eta_y + time * (v_y - spring.swelling_y)
        soon = strain_off_straight(zone.history, bond_piece_double_green_strain(spring, eta_x, eta_y))
        e = strain_off_straight(zone.history, e)
        comes_near = e > bound and soon > peak
        if spring.is_breakable > 0 and (comes_near or e > NEARLY * peak):
            for side in range(2):
                count = _list_cells_to_refine_near_bond_piece_end(lattice, zone, pieces.ends[n, side], count)
    _set_border_velocities_to_interpolated(zone, 0.0)
    return count


@njit(**INNER)
def _set_border_velocities_to_interpolated(zone, factor):  # type: ignore[no-untyped-def]
    """Set the velocities of fine nodes on the border, which are 0 otherwise, to a `factor` times those of the places
    they lie on."""
    for n in range(zone.counts.border_nodes):
        node = zone.border_nodes[n]
        a, b, w = node.first_coarser_node, node.second_coarser_node, node.second_weight
        for axis in range(2):
            v = (1 - w) * zone.coarse.v[axis, a] + w * zone.coarse.v[axis, b]
            zone.fine.v[axis, node.border_node] = factor * v


@njit(**INNER)
def _list_cells_to_refine_near_bond_piece_end(lattice, zone, end, count):  # type: ignore[no-untyped-def]
    """List the cells to refine near the nodes that an end of a piece moves with; returns the new `count`."""
    numbering, x = lattice.numbering, lattice_coordinates(lattice.numbering.fine, end.first_node)
    if end.second_node < 0:
        return mark_and_list_new_fine_cells_near(numbering.cells, zone.cell_kinds, x, AHEAD, zone.new_cells, count)
    for q in (end.first_node, end.second_node):
        x = scale_coordinates(lattice_coordinates(numbering.coarse, q), 2)
        count = mark_and_list_new_fine_cells_near(numbering.cells, zone.cell_kinds, x, AHEAD, zone.new_cells, count)
    return count


@njit(**INNER)
def _is_coarse_node_unbreakable(lattice, q):  # type: ignore[no-untyped-def]
    """Whether the bonds of a coarse node are unbreakable."""
    return is_unbreakable(
        lattice,
        place_on_finer_lattice(lattice.numbering.coarse, lattice.numbering.fine, 2, q),
    )


@njit(**INNER)
def _refine_cells_if_due(lattice, zone, displacement_buffer_index, checks_stretches):  # type: ignore[no-untyped-def]
    """Refine where noted, or where found if it `checks_stretches`; or note that room is lacking."""
    counts, numbering, count = zone.counts, lattice.numbering, 0
    if checks_stretches:
        for p in zone.damaged_nodes[counts.refined_damaged_nodes : counts.damaged_nodes]:
            x = lattice_coordinates(numbering.fine, p)
            count = mark_and_list_new_fine_cells_near(numbering.cells, zone.cell_kinds, x, AHEAD, zone.new_cells, count)
        count = _list_cells_to_refine_near_stretched_coarse_bonds(lattice, zone, displacement_buffer_index, count)
        if zone.totals.clipped_strain > lattice.least_strain_bounds[2] / 2:
            count = _list_cells_to_refine_near_strained_bond_pieces(lattice, zone, displacement_buffer_index, count)
        counts.new_cells = count
        if counts.active_coarsest_rows > 0 and divide_coarsest_cells(lattice, zone, displacement_buffer_index):
            rebuild_node_lists(lattice, zone)
            counts.new_cells = count
            for c in zone.new_cells[:count]:
                zone.cell_kinds[c] = FINE
    is_due, rows = counts.cell_changes == 0 or counts.new_cells > 0, 0
    if is_due:
        rows = list_nodes_affected_by_new_cells(lattice, zone)
    # room for these rows, for new irregular ones, and for all bonds to break
    events = ROW * (counts.active_fine_rows + rows) * zone.fine.row_stiffness.shape[1]
    entries = counts.used_stiffness_rows + rows + SPARE
    has_room = entries <= len(zone.fine.row_stiffness) and counts.broken_bonds + events <= len(zone.break_events.step)
    counts.lacks_array_room = not has_room
    if has_room and is_due:
        refine_cells(lattice, zone, displacement_buffer_index)


@njit(**INNER)
def _drift_and_apply_prescribed_motions(  # type: ignore[no-untyped-def]
    lattice, zone, profiles, displacement_buffer_index, step, begins_sequence, ends_sequence
):
    """Begin a sequence by a drift and hold until the next step; at the start, only store the holding forces."""
    fine, coarse, holds, count = zone.fine, zone.coarse, zone.holds, zone.counts.prescribed_components
    if begins_sequence and ends_sequence:
        store_constraint_forces(fine, coarse, holds, count, profiles, lattice.dt)
    else:
        if begins_sequence:
            half_kick_and_drift_all_lattices(lattice, zone, displacement_buffer_index, begins_sequence)
        apply_prescribed_motions(
            fine,
            coarse,
            holds,
            count,
            zone.totals,
            lattice.dt,
            profiles,
            displacement_buffer_index,
            step,
            ends_sequence,
            begins_sequence,
        )
    if not ends_sequence:
        interpolate_border_nodes(
            coarse.u[1 - displacement_buffer_index],
            zone.far.u[1 - displacement_buffer_index],
            zone.tied_coarse_nodes,
            zone.counts.tied_nodes,
        )


@cached_njit(nogil=True, error_model="numpy")
def advance(lattice, zone, profiles, displacement_buffer_index, first_step, end_step, has_drifted, thread, barrier):  # type: ignore[no-untyped-def]
    """Take the steps `first_step` to `end_step` - 1; returns the end code, the step, and the displacement buffer.

    At the end, velocities are synchronous with displacements and all forces are kept. With `has_drifted`, it
    continues one that ended for lack of room. With `end_step` = `first_step`, nodes are derived from the cells if
    needed, and the initial forces computed. All threads call this together.
    """
    for step in range(first_step if has_drifted else first_step - 1, max(first_step, end_step)):
        begins_sequence, ends_sequence, largest = step < first_step, step == end_step - 1, 0.0
        if not begins_sequence or ends_sequence:
            if begins_sequence or step % EVERY == 0:
                if thread == 0:
                    _refine_cells_if_due(lattice, zone, displacement_buffer_index, step >= first_step + has_drifted)
                meet(barrier)
                if zone.counts.lacks_array_room != 0:
                    return ROOM, step, displacement_buffer_index
            sum_forces_and_move_nodes(
                lattice,
                zone,
                profiles,
                displacement_buffer_index,
                step,
                0.0 if begins_sequence else lattice.dt,
                ends_sequence,
                thread,
                barrier,
            )
            largest = zone.totals.clipped_strain
            meet(barrier)
        if thread == 0:
            reset_job_counters(zone)
            _drift_and_apply_prescribed_motions(
                lattice, zone, profiles, displacement_buffer_index, step, begins_sequence, ends_sequence
            )
        meet(barrier)
        if largest > lattice.least_strain_bounds[0]:
            return CLIP, step, displacement_buffer_index
        if not ends_sequence:
            displacement_buffer_index = 1 - displacement_buffer_index
    if thread == 0 and end_step > first_step:
        half_kick_and_drift_all_lattices(lattice, zone, displacement_buffer_index, end_step == first_step)
        restore_prescribed_velocities(zone.fine, zone.coarse, zone.holds, zone.counts.prescribed_components)
    return DONE, end_step - 1, displacement_buffer_index
