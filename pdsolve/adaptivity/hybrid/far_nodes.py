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
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER


@njit(forceinline=True, **INNER)
def is_far_cell(at, cells, x, y):  # type: ignore[no-untyped-def]
    """Whether the cell of 4 h whose lower left corner is far node x, y, is one."""
    return cells[cell_place(at, 2 * x, 2 * y)] == FAR


@njit(**INNER)
def count_far_cells_around(at, cells, x, y):  # type: ignore[no-untyped-def]
    """Number of cells of 2 h around coarse node x, y, that are far."""
    count = 0
    for sy in (-1, 0):
        for sx in (-1, 0):
            count += cells[cell_place(at, x + sx, y + sy)] == FAR
    return count


@njit(forceinline=True, **INNER)
def far_carriers(at, x, y):  # type: ignore[no-untyped-def]
    """The far nodes that coarse node x, y on their border moves with, and the share of the second."""
    first = far_place(at, x // 2, y // 2)
    if x % 2 == 0 and y % 2 == 0:
        return first, first, 0.0
    return first, first + (1 if x % 2 else at.far_stride), 0.5


@njit(**INNER)
def interpolate_far(at, values, x, y, out):  # type: ignore[no-untyped-def]
    """Interpolate values (2, .) of far nodes at coarse node x, y, into out (2,)."""
    q, wx, wy = far_place(at, x // 2, y // 2), 0.5 * (x % 2), 0.5 * (y % 2)
    right, above = (1 if wx > 0 else 0), (at.far_stride if wy > 0 else 0)
    for axis in range(2):
        low = (1 - wx) * values[axis, q] + wx * values[axis, q + right]
        high = (1 - wx) * values[axis, q + above] + wx * values[axis, q + above + right]
        out[axis] = (1 - wy) * low + wy * high


@njit(**INNER)
def set_far_node(ground, zone, q):  # type: ignore[no-untyped-def]
    """Kind, mass and springs of a far node; its row gets its own stiffnesses when they first differ."""
    at, far, x, y = ground.at, zone.far, far_column(ground.at, q), far_row(ground.at, q)
    row, mass = q // ROW, 0.0
    for sy in (-1, 0):
        for sx in (-1, 0):
            mass += 4 * ground.cell[2, 0] if is_far_cell(at, zone.cells, x + sx, y + sy) else 0.0
    far.kind[q] = FREE if mass > 0 else IDLE
    for k in range(8):
        stiffness = _far_spring_stiffness(ground, zone.cells, x, y, k)
        if far.entry[row] < 0 and stiffness != ground.far_table[k, 5]:
            far.entry[row] = row
            for slot in range(8):
                for lane in range(ROW):
                    far.own[row, slot, lane] = ground.far_table[slot, 5] if far.kind[row * ROW + lane] == FREE else 0.0
        if far.entry[row] >= 0:
            far.own[row, k, q % ROW] = stiffness
    if mass > 0:
        mass += _mass_from_coarse(at, zone.coarse, q)
    far.mass[q] = mass
    far.inverse_mass[q] = 1 / mass if mass > 0 else 0.0


@njit(**INNER)
def _mass_from_coarse(at, coarse, q):  # type: ignore[no-untyped-def]
    """Mass that coarse nodes pass to far node q."""
    x, y, mass = 2 * far_column(at, q), 2 * far_row(at, q), 0.0
    for n in range(9):
        column, row = x + n % 3 - 1, y + n // 3 - 1
        p = coarse_place(at, column, row)
        if coarse.kind[p] == BORDER:
            a, b, w = far_carriers(at, column, row)
            mass += coarse.mass[p] * ((1 - w if a == q else 0.0) + (w if b == q else 0.0))
    return mass


@njit(**INNER)
def _far_spring_stiffness(ground, cells, x, y, k):  # type: ignore[no-untyped-def]
    """Stiffness of spring k of far node x, y: half from each cell of 4 h along an edge."""
    at, dx, dy = ground.at, ground.coarse_dx[k], ground.coarse_dy[k]
    x0, y0 = x + min(dx, 0), y + min(dy, 0)
    if dx != 0 and dy != 0:
        return ground.cell[1, 0] if is_far_cell(at, cells, x0, y0) else 0.0
    far_across = is_far_cell(at, cells, x0 - (dy != 0), y0 - (dx != 0))
    return 0.5 * ground.cell[0, 0] * (is_far_cell(at, cells, x0, y0) + far_across)


@njit(**INNER)
def list_active_rows(nodes):  # type: ignore[no-untyped-def]
    """List rows with nodes that are not idle; returns how many."""
    rows = 0
    for row in range(len(nodes.entry)):
        for q in range(row * ROW, row * ROW + ROW):
            if nodes.kind[q] != IDLE:
                nodes.rows[rows] = row
                rows += 1
                break
    return rows


@njit(**INNER)
def list_far_nodes(ground, zone, coarse_rows):  # type: ignore[no-untyped-def]
    """List rows with far nodes, and the coarse nodes tied to them, in so many rows."""
    coarse, far, tied, count = zone.coarse, zone.far, zone.tied, 0
    zone.counts.far_rows = list_active_rows(far)
    zone.counts.tied_nodes = 0
    if zone.counts.far_rows == 0:
        return
    far.touched[:] = False
    for row in coarse.rows[:coarse_rows]:
        for q in range(row * ROW, row * ROW + ROW):
            if coarse.kind[q] != BORDER:
                continue
            a, b, w = far_carriers(ground.at, coarse_column(ground.at, q), coarse_row(ground.at, q))
            tied.node[count], tied.end[count, 0], tied.end[count, 1], tied.w[count] = q, a, b, w
            coarse.touched[row] = far.touched[a // ROW] = far.touched[b // ROW] = True
            count += 1
    zone.counts.tied_nodes = count
