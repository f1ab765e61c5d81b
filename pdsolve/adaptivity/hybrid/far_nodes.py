"""Far nodes, 4 h apart, and the coarse nodes on their border, which move with them."""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.lattice import (
    BORDER,
    FAR,
    FREE,
    IDLE,
    cell_place,
    coarse_column,
    coarse_place,
    coarse_row,
    far_column,
    far_place,
    far_row,
)
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW


@njit(forceinline=True, **INNER)
def is_far_cell(numbering, cells, x, y):  # type: ignore[no-untyped-def]
    """Whether the cell of 4 h whose lower left corner is far node x, y, is one."""
    return cells[cell_place(numbering, 2 * x, 2 * y)] == FAR


@njit(**INNER)
def count_far_cells_around(numbering, cells, x, y):  # type: ignore[no-untyped-def]
    """Number of cells of 2 h around coarse node x, y, that are far."""
    count = 0
    for sy in (-1, 0):
        for sx in (-1, 0):
            count += cells[cell_place(numbering, x + sx, y + sy)] == FAR
    return count


@njit(forceinline=True, **INNER)
def far_carriers_of_coarse_node(numbering, x, y):  # type: ignore[no-untyped-def]
    """The far nodes that coarse node x, y on their border moves with, and the share of the second."""
    first = far_place(numbering, x // 2, y // 2)
    if x % 2 == 0 and y % 2 == 0:
        return first, first, 0.0
    return first, first + (1 if x % 2 else numbering.far_row_stride), 0.5


@njit(**INNER)
def interpolate_far_at_coarse_node(numbering, values, x, y, out):  # type: ignore[no-untyped-def]
    """Interpolate values (2, .) of far nodes at coarse node x, y, into out (2,)."""
    q, wx, wy = far_place(numbering, x // 2, y // 2), 0.5 * (x % 2), 0.5 * (y % 2)
    right, above = (1 if wx > 0 else 0), (numbering.far_row_stride if wy > 0 else 0)
    for axis in range(2):
        low = (1 - wx) * values[axis, q] + wx * values[axis, q + right]
        high = (1 - wx) * values[axis, q + above] + wx * values[axis, q + above + right]
        out[axis] = (1 - wy) * low + wy * high


@njit(**INNER)
def set_coarsest_node_properties(lattice, zone, q):  # type: ignore[no-untyped-def]
    """Kind, mass and springs of a far node; its row gets its own stiffnesses when they first differ."""
    numbering, far, x, y = lattice.numbering, zone.far, far_column(lattice.numbering, q), far_row(lattice.numbering, q)
    row, mass = q // ROW, 0.0
    for sy in (-1, 0):
        for sx in (-1, 0):
            mass += (
                4 * lattice.coarse_cell_constants[2, 0]
                if is_far_cell(numbering, zone.cell_kinds, x + sx, y + sy)
                else 0.0
            )
    far.node_kinds[q] = FREE if mass > 0 else IDLE
    for k in range(8):
        stiffness = _far_spring_stiffness(lattice, zone.cell_kinds, x, y, k)
        if far.stiffness_index_of_row[row] < 0 and stiffness != lattice.far_spring_table[k, 5]:
            far.stiffness_index_of_row[row] = row
            for slot in range(8):
                for lane in range(ROW):
                    far.row_stiffness[row, slot, lane] = (
                        lattice.far_spring_table[slot, 5] if far.node_kinds[row * ROW + lane] == FREE else 0.0
                    )
        if far.stiffness_index_of_row[row] >= 0:
            far.row_stiffness[row, k, q % ROW] = stiffness
    if mass > 0:
        mass += _mass_passed_by_coarse_nodes(numbering, zone.coarse, q)
    far.mass[q] = mass
    far.inverse_mass[q] = 1 / mass if mass > 0 else 0.0


@njit(**INNER)
def _mass_passed_by_coarse_nodes(numbering, coarse, q):  # type: ignore[no-untyped-def]
    """Mass that coarse nodes pass to far node q."""
    x, y, mass = 2 * far_column(numbering, q), 2 * far_row(numbering, q), 0.0
    for n in range(9):
        column, row = x + n % 3 - 1, y + n // 3 - 1
        p = coarse_place(numbering, column, row)
        if coarse.node_kinds[p] == BORDER:
            a, b, w = far_carriers_of_coarse_node(numbering, column, row)
            mass += coarse.mass[p] * ((1 - w if a == q else 0.0) + (w if b == q else 0.0))
    return mass


@njit(**INNER)
def _far_spring_stiffness(lattice, cells, x, y, k):  # type: ignore[no-untyped-def]
    """Stiffness of spring k of far node x, y: half from each cell of 4 h along an edge."""
    numbering, dx, dy = lattice.numbering, lattice.coarse_dx[k], lattice.coarse_dy[k]
    x0, y0 = x + min(dx, 0), y + min(dy, 0)
    if dx != 0 and dy != 0:
        return lattice.coarse_cell_constants[1, 0] if is_far_cell(numbering, cells, x0, y0) else 0.0
    far_across = is_far_cell(numbering, cells, x0 - (dy != 0), y0 - (dx != 0))
    return 0.5 * lattice.coarse_cell_constants[0, 0] * (is_far_cell(numbering, cells, x0, y0) + far_across)


@njit(**INNER)
def list_active_rows(nodes):  # type: ignore[no-untyped-def]
    """List rows with nodes that are not idle; returns how many."""
    rows = 0
    for row in range(len(nodes.stiffness_index_of_row)):
        for q in range(row * ROW, row * ROW + ROW):
            if nodes.node_kinds[q] != IDLE:
                nodes.active_rows[rows] = row
                rows += 1
                break
    return rows


@njit(**INNER)
def list_far_rows_and_tied_nodes(lattice, zone, coarse_row_count):  # type: ignore[no-untyped-def]
    """List rows with far nodes, and the coarse nodes tied to them, in so many rows."""
    coarse, far, tied, count = zone.coarse, zone.far, zone.tied_coarse_nodes, 0
    zone.counts.active_far_node_rows = list_active_rows(far)
    zone.counts.tied_nodes = 0
    if zone.counts.active_far_node_rows == 0:
        return
    far.has_extra_forces[:] = False
    for row in coarse.active_rows[:coarse_row_count]:
        for q in range(row * ROW, row * ROW + ROW):
            if coarse.node_kinds[q] != BORDER:
                continue
            a, b, w = far_carriers_of_coarse_node(
                lattice.numbering, coarse_column(lattice.numbering, q), coarse_row(lattice.numbering, q)
            )
            (
                tied.border_node[count],
                tied.carrier_nodes[count, 0],
                tied.carrier_nodes[count, 1],
                tied.second_carrier_weight[count],
            ) = q, a, b, w
            coarse.has_extra_forces[row] = far.has_extra_forces[a // ROW] = far.has_extra_forces[b // ROW] = True
            count += 1
    zone.counts.tied_nodes = count
