"""Refinement of cells; only their surroundings are recomputed."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.clipped_bonds import replace_pieces, set_row_stiffness
from pdsolve.adaptivity.hybrid.damping import remove_damping, set_damping
from pdsolve.adaptivity.hybrid.energy import energy_of_nodes
from pdsolve.adaptivity.hybrid.far_cells import set_all_far_nodes
from pdsolve.adaptivity.hybrid.far_nodes import count_far_cells_around, list_active_rows, list_far_nodes
from pdsolve.adaptivity.hybrid.forces import interpolate_border_nodes
from pdsolve.adaptivity.hybrid.lattice import (
    BORDER,
    COARSE,
    FINE,
    FREE,
    cell_column,
    cell_place,
    cell_row,
    coarse_column,
    coarse_place,
    coarse_row,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.node_rows import value_at_node
from pdsolve.adaptivity.hybrid.nodes import (
    border_carriers,
    coarse_cell_beside,
    interpolate_coarse,
    set_coarse_node,
    set_fine_node,
)
from pdsolve.adaptivity.hybrid.swelling import offset_from_line, set_piece_reliefs
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER


@njit(**INNER)
def mark_cells_in_disc(at, cells, new, count, ix, iy, radius):  # type: ignore[no-untyped-def]
    """List the coarse cells within `radius` of a place (fine spacings); returns how many are listed then.

    They are marked as fine at once, so that none is listed twice; `refine_cells` takes them from the list.
    """
    for y in range(int(np.floor((iy - radius) / 2)), int(np.ceil((iy + radius) / 2))):
        for x in range(int(np.floor((ix - radius) / 2)), int(np.ceil((ix + radius) / 2))):
            if not (0 <= x < at.nx // 2 and 0 <= y < at.ny // 2):
                continue
            c = cell_place(at, x, y)
            if cells[c] != COARSE:
                continue
            away_x, away_y = max(abs(ix - (2 * x + 1)) - 1, 0), max(abs(iy - (2 * y + 1)) - 1, 0)
            if away_x * away_x + away_y * away_y < radius * radius:
                cells[c] = FINE
                new[count] = c
                count += 1
    return count


@njit(**INNER)
def _mark_reach_of_new_cells(ground, zone):  # type: ignore[no-untyped-def]
    """Mark all places within the family's reach of the new cells; returns their range of columns and rows."""
    at, reach = ground.at, ground.reach + 2
    x0, y0, x1, y1 = at.nx, at.ny, 0, 0
    for c in zone.new_cells[: zone.counts.new_cells]:
        x, y = 2 * cell_column(at, c), 2 * cell_row(at, c)
        left_side, right = max(x - reach, 0), min(x + reach + 3, at.nx + 1)
        low, high = max(y - reach, 0), min(y + reach + 3, at.ny + 1)
        x0, y0, x1, y1 = min(x0, left_side), min(y0, low), max(x1, right), max(y1, high)
        for iy in range(low, high):
            for p in range(fine_place(at, left_side, iy), fine_place(at, right, iy)):
                zone.mark[p] = True
    return x0, y0, x1, y1


@njit(**INNER)
def list_affected_nodes(ground, zone):  # type: ignore[no-untyped-def]
    """List, in order, the nodes affected by the new cells; returns the number of affected rows of fine nodes.

    Affected are the fine nodes within the family's reach and the coarse nodes at corners; at the start, all of them.
    """
    at, (x0, y0, x1, y1) = ground.at, _mark_reach_of_new_cells(ground, zone)
    dirty, rows, last = 0, 0, -1
    for iy in range(y0, y1):
        for p in range(fine_place(at, x0, iy), fine_place(at, x1, iy)):
            if zone.mark[p]:
                zone.mark[p] = False
                if value_at_node(ground.nodes, ground.nodes.mass, p) > 0:
                    zone.affected_nodes[dirty] = p
                    rows += p // ROW != last
                    dirty, last = dirty + 1, p // ROW
    zone.counts.dirty = dirty
    _list_corner_nodes(at, zone, x0, y0, x1, y1)
    return rows


@njit(**INNER)
def _list_corner_nodes(at, zone, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """List, in order, the coarse nodes at the corners of the new cells; at the start, all coarse nodes that are
    not amid far cells.

    The new cells lie within these columns and rows of fine nodes.
    """
    begins, around = zone.counts.regrids == 0, 0
    if begins:
        x0, y0, x1, y1 = 0, 0, at.nx + 1, at.ny + 1
    for c in zone.new_cells[: zone.counts.new_cells]:
        p = fine_place(at, 2 * cell_column(at, c), 2 * cell_row(at, c))
        for corner in (p, p + 2, p + 2 * at.stride, p + 2 * at.stride + 2):
            zone.mark[corner] = True
    for iy in range(y0 + y0 % 2, y1, 2):
        for ix in range(x0 + x0 % 2, x1, 2):
            p = fine_place(at, ix, iy)
            if zone.mark[p] or (begins and count_far_cells_around(at, zone.cells, ix // 2, iy // 2) < 4):
                zone.mark[p] = False
                zone.affected_coarse[around] = coarse_place(at, ix // 2, iy // 2)
                around += 1
    zone.counts.around = around


@njit(**INNER)
def refine_cells(ground, zone, now):  # type: ignore[no-untyped-def]
    """Make the marked cells in `zone.new_cells` fine at displacements `now`.

    New nodes take the coarse displacements and velocities; the change of energy is booked.
    """
    new, dirty, dirty_coarse = (
        zone.new_cells[: zone.counts.new_cells],
        zone.affected_nodes[: zone.counts.dirty],
        zone.affected_coarse,
    )
    dirty_coarse = dirty_coarse[: zone.counts.around]
    interpolate_border_nodes(zone.fine.u[now], zone.coarse.u[now], zone.border, zone.counts.border_nodes)
    for p in dirty:
        zone.mark[p] = True
    for c in new:
        zone.cells[c] = COARSE
    before = energy_of_nodes(ground, zone, now, dirty, dirty_coarse)
    _interpolate_new_nodes(ground, zone, new, dirty, now)
    set_affected_nodes(ground, zone, dirty, dirty_coarse, now)
    if zone.counts.regrids == 0:
        set_all_far_nodes(ground, zone)
    replace_pieces(ground, zone, dirty)
    set_piece_reliefs(ground, zone)
    for p in dirty:
        zone.mark[p] = True
    zone.totals.refinement += energy_of_nodes(ground, zone, now, dirty, dirty_coarse) - before
    for p in dirty:
        zone.mark[p] = False
    rebuild_lists(ground, zone)


@njit(**INNER)
def set_affected_nodes(ground, zone, dirty, dirty_coarse, now):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of these nodes."""
    fine, coarse, last = zone.fine, zone.coarse, -1
    for p in dirty:
        set_fine_node(ground.at, value_at_node(ground.nodes, ground.nodes.mass, p), zone.cells, fine, p)
        set_damping(ground, fine, p, p)
    for q in dirty_coarse:
        set_coarse_node(ground, zone.cells, fine, coarse, q)
        x, y = coarse_column(ground.at, q), coarse_row(ground.at, q)
        set_damping(ground, coarse, q, fine_place(ground.at, 2 * x, 2 * y))
    for p in dirty:
        if fine.kind[p] == BORDER:
            a, b, w = border_carriers(ground, coarse.kind, p)
            off = offset_from_line(ground, fine.shrink, a, b, w)
            for axis in range(2):
                fine.u[now, axis, p] = (1 - w) * coarse.u[now, axis, a] + w * coarse.u[now, axis, b] + off[axis]
                fine.v[axis, p] = 0.0
    for p in dirty:
        if p // ROW != last:
            last = p // ROW
            set_row_stiffness(ground, zone, last)


@njit(**INNER)
def _interpolate_new_nodes(ground, zone, new, dirty, now):  # type: ignore[no-untyped-def]
    """Give nodes that become free the motion of the coarse ones around them, then make the new cells fine."""
    at, fine, coarse, two = ground.at, zone.fine, zone.coarse, zone.s[0, :2]
    for p in dirty:
        if fine.kind[p] == FREE:
            continue
        ix, iy = fine_column(at, p), fine_row(at, p)
        x, y = coarse_cell_beside(at, zone.cells, ix, iy)
        if x < 0:
            continue
        interpolate_coarse(ground, coarse.kind, coarse.u[now], ix, iy, x, y, two)
        off = 0.0, 0.0
        if ix % 2 != iy % 2 and not ground.cut_cells[cell_place(at, x, y)]:
            q = coarse_place(at, ix // 2, iy // 2)
            off = offset_from_line(ground, fine.shrink, q, q + (1 if ix % 2 else at.coarse_stride), 0.5)
        fine.u[now, 0, p], fine.u[now, 1, p] = two[0] + off[0], two[1] + off[1]
        interpolate_coarse(ground, coarse.kind, coarse.v, ix, iy, x, y, two)
        fine.v[0, p], fine.v[1, p] = two[0], two[1]
    for c in new:
        zone.cells[c] = FINE


@njit(**INNER)
def _list_fine_rows(ground, zone):  # type: ignore[no-untyped-def]
    """List rows with fine nodes, and border nodes."""
    fine, coarse, rows, borders = zone.fine, zone.coarse, 0, 0
    for row in range(len(fine.entry)):
        if fine.entry[row] == -1:
            continue
        fine.rows[rows] = row
        rows += 1
        for p in range(row * ROW, row * ROW + ROW):
            if fine.kind[p] != BORDER:
                continue
            a, b, w = border_carriers(ground, coarse.kind, p)
            zone.border.node[borders], zone.border.w[borders] = p, w
            zone.border.end[borders, 0], zone.border.end[borders, 1] = a, b
            zone.border.off[borders] = offset_from_line(ground, fine.shrink, a, b, w)
            fine.touched[row] = coarse.touched[a // ROW] = coarse.touched[b // ROW] = True
            borders += 1
    zone.counts.fine_rows, zone.counts.border_nodes = rows, borders


@njit(**INNER)
def rebuild_lists(ground, zone):  # type: ignore[no-untyped-def]
    """Rebuild the lists of rows, border nodes, loads and holds once cells have become others."""
    fine, coarse = zone.fine, zone.coarse
    zone.counts.regrids += 1
    zone.counts.refined_nodes = zone.counts.stirred_nodes
    zone.counts.new_cells = 0
    fine.touched[:] = False
    coarse.touched[:] = False
    zone.counts.coarse_rows = list_active_rows(coarse)
    list_far_nodes(ground, zone, zone.counts.coarse_rows)
    _list_fine_rows(ground, zone)
    for n in range(zone.counts.pieces):
        for which in range(2):
            a, b = zone.pieces.end[n, 2 * which], zone.pieces.end[n, 2 * which + 1]
            if b < 0:
                fine.touched[a // ROW] = True
            else:
                coarse.touched[a // ROW] = coarse.touched[b // ROW] = True
    zone.counts.loads = _distribute_loads(ground.at, zone.cells, fine, coarse, zone.loads)
    zone.counts.holds = _list_prescribed_nodes(ground.at, fine, coarse, zone.holds)


@njit(**INNER)
def _distribute_loads(at, cells, fine, coarse, loads):  # type: ignore[no-untyped-def]
    """Distribute loads to moving nodes: those of idle and border nodes go to the coarse nodes around them."""
    count = 0
    for n in range(len(loads.entries)):
        p = loads.entries[n].place
        if fine.kind[p] == FREE:
            loads.node_and_entry[count, 0], loads.node_and_entry[count, 1], loads.share[count] = p, n, 1.0
            fine.touched[p // ROW] = True
            count += 1
            continue
        ix, iy = fine_column(at, p), fine_row(at, p)
        x, y = coarse_cell_beside(at, cells, ix, iy)
        for dy in range(2):
            for dx in range(2):
                wx, wy = (ix - 2 * x) / 2, (iy - 2 * y) / 2
                w = (wx if dx else 1 - wx) * (wy if dy else 1 - wy)
                if w > 0:
                    q = coarse_place(at, x + dx, y + dy)
                    loads.node_and_entry[count, 0], loads.node_and_entry[count, 1], loads.share[count] = -1 - q, n, w
                    coarse.touched[q // ROW] = True
                    count += 1
    return count


@njit(**INNER)
def _list_prescribed_nodes(at, fine, coarse, holds):  # type: ignore[no-untyped-def]
    """List the moving nodes that are held."""
    count = 0
    for n in range(len(holds.entries)):
        p = holds.entries[n].place
        ix, iy = fine_column(at, p), fine_row(at, p)
        if fine.kind[p] == FREE:
            holds.node_and_entry[count, 0], holds.node_and_entry[count, 1] = p, n
            fine.touched[p // ROW] = True
            remove_damping(fine, p, holds.entries[n].axis)
            count += 1
        elif ix % 2 == 0 and iy % 2 == 0 and coarse.kind[coarse_place(at, ix // 2, iy // 2)] == FREE:
            q = coarse_place(at, ix // 2, iy // 2)
            holds.node_and_entry[count, 0], holds.node_and_entry[count, 1] = -1 - q, n
            coarse.touched[q // ROW] = True
            remove_damping(coarse, q, holds.entries[n].axis)
            count += 1
    return count
