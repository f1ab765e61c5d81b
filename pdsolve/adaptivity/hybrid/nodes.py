"""Fine, coarse and far nodes: their kinds, masses, springs and interpolation, and the initial motion of new ones.

Far nodes are 4 h apart; coarse nodes on the border of far cells move with them.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.precracks import is_visible
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.zone.cells import (
    BORDER,
    COARSE,
    FAR,
    FINE,
    FREE,
    IDLE,
    cell_around,
    cell_corner,
    count_cells_of_kind_around,
    fine_node_kind,
    lattice_coordinates,
    place_number_at,
)
from pdsolve.zone.springs import STIFFNESS


@njit(**INNER)
def set_fine_node_kind_and_mass(numbering, mass, cells, fine, p):  # type: ignore[no-untyped-def]
    """Set kind and mass of a fine node with the whole cell `mass`."""
    x = lattice_coordinates(numbering.fine, p)
    fine.node_kinds[p] = IDLE if mass == 0 else fine_node_kind(numbering, cells, x)
    fine_quarters = count_cells_of_kind_around(numbering, cells, x, FINE)
    coarse_quarters = count_cells_of_kind_around(numbering, cells, x, COARSE)
    fine.mass[p] = mass * fine_quarters / (fine_quarters + coarse_quarters) if fine_quarters > 0 else 0.0
    fine.inverse_mass[p] = 1 / fine.mass[p] if fine.node_kinds[p] == FREE else 0.0


@njit(**INNER)
def coarse_interpolation_nodes_on_edge(lattice, node_kinds, x, y, direction, w):  # type: ignore[no-untyped-def]
    """The coarse nodes that a place on an edge moves with, and the share of the second.

    Where a pre-crack cuts the edge, the place moves with nodes on its own side. It is extrapolated from the two next
    ones, so that a rotating face is not stretched, or follows one where there are no two. `node_kinds` are of coarse
    nodes.
    """
    q = place_number_at(lattice.numbering.coarse, (x, y))
    if w == 0:
        return q, q, 0.0
    step = 1 if direction == 0 else lattice.numbering.coarse.strides[1]
    second, cut = q + step, lattice.edge_cut_position[direction, q]
    if cut == 0:
        return q, second, w
    if w < cut:
        inner = q - step
        can_extrapolate = node_kinds[inner] == FREE and lattice.edge_cut_position[direction, inner] == 0
        return (q, inner, -w) if can_extrapolate else (q, q, 0.0)
    inner = second + step
    can_extrapolate = node_kinds[inner] == FREE and lattice.edge_cut_position[direction, second] == 0
    return (second, inner, w - 1) if can_extrapolate else (second, second, 0.0)


@njit(**INNER)
def coarse_interpolation_nodes_of_border_node(lattice, node_kinds, p):  # type: ignore[no-untyped-def]
    """The coarse nodes that fine node p, on a line between cells, moves with, and the share of the second; see
    `coarse_interpolation_nodes_on_edge`."""
    ix, iy = lattice_coordinates(lattice.numbering.fine, p)
    odd_x, odd_y = ix % 2, iy % 2
    return coarse_interpolation_nodes_on_edge(
        lattice, node_kinds, ix // 2, iy // 2, 0 if odd_x else 1, 0.5 * (odd_x + odd_y)
    )


@njit(**INNER)
def set_spring_stiffness(nodes, q, k, stiffness, spring_table):  # type: ignore[no-untyped-def]
    """Set the stiffness of a coarse or far node's spring; its row gets its own stiffnesses when they first differ from
    those of the table."""
    row = q // ROW
    if nodes.stiffness_index_of_row[row] < 0 and stiffness != spring_table[k, STIFFNESS]:
        nodes.stiffness_index_of_row[row] = row
        for slot in range(len(spring_table)):
            for lane in range(ROW):
                nodes.row_stiffness[row, slot, lane] = (
                    spring_table[slot, STIFFNESS] if nodes.node_kinds[row * ROW + lane] != IDLE else 0.0
                )
    if nodes.stiffness_index_of_row[row] >= 0:
        nodes.row_stiffness[row, k, q % ROW] = stiffness


@njit(**INNER)
def set_coarse_node_properties(lattice, cells, fine, coarse, q):  # type: ignore[no-untyped-def]
    """Kind, mass and springs of a coarse node, which is on the border next to far cells."""
    numbering, mass = lattice.numbering, 0.0
    x, y = lattice_coordinates(numbering.coarse, q)
    for sy in (-1, 0):
        for sx in (-1, 0):
            c = place_number_at(numbering.cells, (x + sx, y + sy))
            if cells[c] == COARSE:
                mass += lattice.coarse_cell_constants[
                    2, lattice.constants_index_of_cell[c]
                ] * corner_area_over_quarter_cell(lattice, x + sx, y + sy, -sx, -sy)
    tied = count_cells_of_kind_around(numbering, cells, (2 * x, 2 * y), FAR) > 0
    coarse.node_kinds[q] = IDLE if mass == 0 else BORDER if tied else FREE
    for k in range(len(lattice.coarse_dx)):
        stiffness = coarse_spring_stiffness(lattice, cells, q, x, y, k)
        set_spring_stiffness(coarse, q, k, stiffness, lattice.coarse_spring_table)
    if mass > 0:
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                p = place_number_at(numbering.fine, (2 * x + dx, 2 * y + dy))
                if fine.node_kinds[p] == BORDER:
                    a, b, w = coarse_interpolation_nodes_of_border_node(lattice, coarse.node_kinds, p)
                    w = max(w, 0.0)  # mass goes to the next one
                    mass += fine.mass[p] * ((1 - w if a == q else 0.0) + (w if b == q else 0.0))
    coarse.mass[q] = mass
    coarse.inverse_mass[q] = 1 / mass if mass > 0 and not tied else 0.0


@njit(**INNER)
def coarse_spring_stiffness(lattice, cells, q, x, y, k):  # type: ignore[no-untyped-def]
    """Stiffness of coarse spring k of a node: half from each coarse cell along an edge; 0 if a pre-crack cuts it."""
    numbering = lattice.numbering
    dx, dy = lattice.coarse_dx[k], lattice.coarse_dy[k]
    owner, which = (q, k) if k < 4 else (q + lattice.coarse_neighbour_offsets[k], k - 4)
    if (lattice.cut_coarse_spring_bits[owner] >> which) & 1:
        return 0.0
    x0, y0 = x + min(dx, 0), y + min(dy, 0)
    c = place_number_at(numbering.cells, (x0, y0))
    if dx != 0 and dy != 0:
        return lattice.coarse_cell_constants[1, lattice.constants_index_of_cell[c]] if cells[c] == COARSE else 0.0
    along_y = 1 if dy != 0 else 0
    first = _cell_edge_stiffness(lattice, cells, x0, y0, along_y, 0)
    return first + _cell_edge_stiffness(lattice, cells, x0 - along_y, y0 - 1 + along_y, along_y, 1)


@njit(**INNER)
def _cell_edge_stiffness(lattice, cells, x, y, along_y, second):  # type: ignore[no-untyped-def]
    """Stiffness of the first or `second` of two edges of a cell that are parallel to an axis.

    Of a cell that a pre-crack crosses between them, each is that of a free strip: k = w (C11 - C66^2 / C11) for the
    width w over the cell's.
    """
    c = place_number_at(lattice.numbering.cells, (x, y))
    if cells[c] != COARSE:
        return 0.0
    constants, n = lattice.coarse_cell_constants, lattice.constants_index_of_cell[c]
    k1, k2 = constants[0, n], constants[1, n]
    across = _crack_position_across_cell(lattice, x, y, along_y)
    if across == 0:
        return 0.5 * k1
    return (1 - across if second else across) * (k1 + k2 - k2 * k2 / (k1 + k2))


@njit(**INNER)
def _crack_position_across_cell(lattice, x, y, along_y):  # type: ignore[no-untyped-def]
    """Where, from the first of a cell's edges parallel to an axis to the second, a pre-crack crosses between them; 0:
    nowhere."""
    q = place_number_at(lattice.numbering.coarse, (x, y))
    opposite = q + (lattice.numbering.coarse.strides[1] if along_y else 1)
    first, second = lattice.edge_cut_position[1 - along_y, q], lattice.edge_cut_position[1 - along_y, opposite]
    return (first + second) / 2 if first > 0 and second > 0 else 0.0


@njit(**INNER)
def corner_area_over_quarter_cell(lattice, x, y, right, above):  # type: ignore[no-untyped-def]
    """Share of a corner in its cell's area, over a quarter: corners on a side of a pre-crack have the side's."""
    if not lattice.is_cell_cut[place_number_at(lattice.numbering.cells, (x, y))]:
        return 1.0
    for along_y, second in ((0, above), (1, right)):
        across = _crack_position_across_cell(lattice, x, y, along_y)
        if across > 0:
            return 2 * (1 - across if second else across)
    q, stride = place_number_at(lattice.numbering.coarse, (x, y)), lattice.numbering.coarse.strides[1]
    low, high = lattice.edge_cut_position[0, q], lattice.edge_cut_position[0, q + stride]
    near, far = lattice.edge_cut_position[1, q], lattice.edge_cut_position[1, q + 1]
    for number in range(4):
        is_right, is_above = number % 2, number // 2
        along, up = (high if is_above else low), (far if is_right else near)
        if along > 0 and up > 0:
            area = (1 - along if is_right else along) * (1 - up if is_above else up) / 2
            return 4 * area if (is_right, is_above) == (right, above) else 4 * (1 - area) / 3
    return 1.0


@njit(**INNER)
def interpolate_coarse_at_fine_place(lattice, node_kinds, values, ix, iy, x, y, out):  # type: ignore[no-untyped-def]
    """Interpolate values (2, q) of coarse nodes, with kinds `node_kinds`, at a fine place of cell x, y, into out (2,).

    In a cell crossed by a pre-crack, values are extrapolated from a neighbouring cell on the place's own side; without
    one, they are the mean over the visible corners.
    """
    numbering = lattice.numbering
    if not lattice.is_cell_cut[place_number_at(numbering.cells, (x, y))]:
        interpolate_bilinear(numbering.coarse, values, ix, iy, x, y, out)
        return
    for dx, dy in ((0, -1), (0, 1), (-1, 0), (1, 0)):
        if lattice.is_cell_cut[place_number_at(numbering.cells, (x + dx, y + dy))]:
            continue
        q, stride, active = place_number_at(numbering.coarse, (x + dx, y + dy)), numbering.coarse.strides[1], True
        for corner in (q, q + 1, q + stride, q + stride + 1):
            active &= node_kinds[corner] == FREE
        if active and is_visible(lattice.precrack_segments, ix, iy, 2.0 * (x + dx) + 1, 2.0 * (y + dy) + 1):
            interpolate_bilinear(numbering.coarse, values, ix, iy, x + dx, y + dy, out)
            return
    _average_visible_corners(numbering, lattice.precrack_segments, values, ix, iy, x, y, out)


@njit(**INNER)
def interpolate_bilinear(numbering, values, ix, iy, x, y, out):  # type: ignore[no-untyped-def]
    """Bilinear interpolation or extrapolation from the corners of cell x, y, of a lattice at a node of the twice finer
    one."""
    wx, wy, q, stride = (ix - 2 * x) / 2, (iy - 2 * y) / 2, place_number_at(numbering, (x, y)), numbering.strides[1]
    for axis in range(2):
        low = values[axis, q] if wx == 0 else (1 - wx) * values[axis, q] + wx * values[axis, q + 1]
        q2 = q + stride
        high = values[axis, q2] if wx == 0 else (1 - wx) * values[axis, q2] + wx * values[axis, q2 + 1]
        out[axis] = low if wy == 0 else (1 - wy) * low + wy * high


@njit(**INNER)
def _average_visible_corners(numbering, cracks, values, ix, iy, x, y, out):  # type: ignore[no-untyped-def]
    """Mean of the corners visible from the place, or the nearest corner if none is."""
    wx, wy, total = (ix - 2 * x) / 2, (iy - 2 * y) / 2, 0.0
    out[0] = out[1] = 0.0
    for number in range(4):
        column, row = cell_corner((x, y), number)
        w = (wx if column > x else 1 - wx) * (wy if row > y else 1 - wy)
        if w == 0 or not is_visible(cracks, ix, iy, 2.0 * column, 2.0 * row):
            continue
        q = place_number_at(numbering.coarse, (column, row))
        total += w
        out[0] += w * values[0, q]
        out[1] += w * values[1, q]
    if total > 0:
        out[0] /= total
        out[1] /= total
        return
    q = place_number_at(numbering.coarse, (x + (wx > 0.5), y + (wy > 0.5)))
    out[0], out[1] = values[0, q], values[1, q]


@njit(**INNER)
def adjacent_coarse_cell(numbering, cells, ix, iy):  # type: ignore[no-untyped-def]
    """Lower left corner of a coarse cell that contains or touches a fine node; (-1, -1) without one."""
    for number in (3, 2, 1, 0):
        x, y = cell_around((ix, iy), number)
        if cells[place_number_at(numbering.cells, (x, y))] == COARSE:
            return x, y
    return -1, -1


@njit(forceinline=True, **INNER)
def is_coarsest_cell(numbering, cells, x, y):  # type: ignore[no-untyped-def]
    """Whether the cell of 4 h whose lower left corner is far node x, y, is one."""
    return cells[place_number_at(numbering.cells, (2 * x, 2 * y))] == FAR


@njit(forceinline=True, **INNER)
def coarsest_interpolation_nodes_of_coarse_node(numbering, x, y):  # type: ignore[no-untyped-def]
    """The far nodes that coarse node x, y on their border moves with, and the share of the second."""
    first = place_number_at(numbering.far, (x // 2, y // 2))
    if x % 2 == 0 and y % 2 == 0:
        return first, first, 0.0
    return first, first + (1 if x % 2 else numbering.far.strides[1]), 0.5


@njit(**INNER)
def set_coarsest_node_properties(lattice, zone, q):  # type: ignore[no-untyped-def]
    """Kind, mass and springs of a far node."""
    (x, y), far, mass = lattice_coordinates(lattice.numbering.far, q), zone.far, 0.0
    for sy in (-1, 0):
        for sx in (-1, 0):
            is_far = is_coarsest_cell(lattice.numbering, zone.cell_kinds, x + sx, y + sy)
            mass += 4 * lattice.coarse_cell_constants[2, 0] if is_far else 0.0
    far.node_kinds[q] = FREE if mass > 0 else IDLE
    for k in range(len(lattice.coarse_dx)):
        stiffness = _coarsest_spring_stiffness(lattice, zone.cell_kinds, x, y, k)
        set_spring_stiffness(far, q, k, stiffness, lattice.coarsest_spring_table)
    if mass > 0:
        passed_mass = 0.0
        for n in range(9):
            column, row = 2 * x + n % 3 - 1, 2 * y + n // 3 - 1
            p = place_number_at(lattice.numbering.coarse, (column, row))
            if zone.coarse.node_kinds[p] == BORDER:
                a, b, w = coarsest_interpolation_nodes_of_coarse_node(lattice.numbering, column, row)
                passed_mass += zone.coarse.mass[p] * ((1 - w if a == q else 0.0) + (w if b == q else 0.0))
        mass += passed_mass
    far.mass[q] = mass
    far.inverse_mass[q] = 1 / mass if mass > 0 else 0.0


@njit(**INNER)
def _coarsest_spring_stiffness(lattice, cells, x, y, k):  # type: ignore[no-untyped-def]
    """Stiffness of spring k of far node x, y: half from each cell of 4 h along an edge."""
    numbering, dx, dy = lattice.numbering, lattice.coarse_dx[k], lattice.coarse_dy[k]
    x0, y0 = x + min(dx, 0), y + min(dy, 0)
    if dx != 0 and dy != 0:
        return lattice.coarse_cell_constants[1, 0] if is_coarsest_cell(numbering, cells, x0, y0) else 0.0
    far_across = is_coarsest_cell(numbering, cells, x0 - (dy != 0), y0 - (dx != 0))
    return 0.5 * lattice.coarse_cell_constants[0, 0] * (is_coarsest_cell(numbering, cells, x0, y0) + far_across)


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
def list_coarsest_rows_and_tied_coarse_nodes(lattice, zone, coarse_row_count):  # type: ignore[no-untyped-def]
    """List rows with far nodes, and the coarse nodes tied to them, in so many rows."""
    coarse, far, tied, count = zone.coarse, zone.far, zone.tied_coarse_nodes, 0
    zone.counts.active_coarsest_rows = list_active_rows(far)
    zone.counts.tied_nodes = 0
    if zone.counts.active_coarsest_rows == 0:
        return
    far.has_extra_forces[:] = False
    for row in coarse.active_rows[:coarse_row_count]:
        for q in range(row * ROW, row * ROW + ROW):
            if coarse.node_kinds[q] != BORDER:
                continue
            a, b, w = coarsest_interpolation_nodes_of_coarse_node(
                lattice.numbering, *lattice_coordinates(lattice.numbering.coarse, q)
            )
            node = tied[count]
            node.border_node, node.first_coarser_node, node.second_coarser_node, node.second_weight = q, a, b, w
            coarse.has_extra_forces[row] = far.has_extra_forces[a // ROW] = far.has_extra_forces[b // ROW] = True
            count += 1
    zone.counts.tied_nodes = count
