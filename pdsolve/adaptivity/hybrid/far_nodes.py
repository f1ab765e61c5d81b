"""Far nodes, 4 h apart, and the coarse nodes on their border, which move with them."""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.nodes import set_spring_stiffness
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.zone.cells import BORDER, FAR, FREE, IDLE, coordinates, place_at


@njit(forceinline=True, **INNER)
def is_far_cell(numbering, cells, x, y):  # type: ignore[no-untyped-def]
    """Whether the cell of 4 h whose lower left corner is far node x, y, is one."""
    return cells[place_at(numbering.cells, (2 * x, 2 * y))] == FAR


@njit(forceinline=True, **INNER)
def far_carriers_of_coarse_node(numbering, x, y):  # type: ignore[no-untyped-def]
    """The far nodes that coarse node x, y on their border moves with, and the share of the second."""
    first = place_at(numbering.far, (x // 2, y // 2))
    if x % 2 == 0 and y % 2 == 0:
        return first, first, 0.0
    return first, first + (1 if x % 2 else numbering.far.strides[1]), 0.5


@njit(**INNER)
def set_coarsest_node_properties(lattice, zone, q):  # type: ignore[no-untyped-def]
    """Kind, mass and springs of a far node."""
    (x, y), far, mass = coordinates(lattice.numbering.far, q), zone.far, 0.0
    for sy in (-1, 0):
        for sx in (-1, 0):
            is_far = is_far_cell(lattice.numbering, zone.cell_kinds, x + sx, y + sy)
            mass += 4 * lattice.coarse_cell_constants[2, 0] if is_far else 0.0
    far.node_kinds[q] = FREE if mass > 0 else IDLE
    for k in range(len(lattice.coarse_dx)):
        stiffness = _far_spring_stiffness(lattice, zone.cell_kinds, x, y, k)
        set_spring_stiffness(far, q, k, stiffness, lattice.far_spring_table)
    if mass > 0:
        mass += _mass_passed_by_coarse_nodes(lattice.numbering, zone.coarse, q)
    far.mass[q] = mass
    far.inverse_mass[q] = 1 / mass if mass > 0 else 0.0


@njit(**INNER)
def _mass_passed_by_coarse_nodes(numbering, coarse, q):  # type: ignore[no-untyped-def]
    """Mass that coarse nodes pass to far node q."""
    (x, y), mass = coordinates(numbering.far, q), 0.0
    for n in range(9):
        column, row = 2 * x + n % 3 - 1, 2 * y + n // 3 - 1
        p = place_at(numbering.coarse, (column, row))
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
            a, b, w = far_carriers_of_coarse_node(lattice.numbering, *coordinates(lattice.numbering.coarse, q))
            (
                tied.border_node[count],
                tied.carrier_nodes[count, 0],
                tied.carrier_nodes[count, 1],
                tied.second_carrier_weight[count],
            ) = q, a, b, w
            coarse.has_extra_forces[row] = far.has_extra_forces[a // ROW] = far.has_extra_forces[b // ROW] = True
            count += 1
    zone.counts.tied_nodes = count
