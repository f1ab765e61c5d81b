"""Cells of 4 h far from all that happens: which there are at the start, and how they become four of 2 h.

A compact cell is a conforming element: with bilinear displacements along its edges, springs of 4 h beside those of 2 h
are exact for linear fields. Far cells never come back.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.arrays import LatticeConstants
from pdsolve.adaptivity.hybrid.coarse_cells import HybridPlate
from pdsolve.adaptivity.hybrid.energy import (
    double_green_strain_of_spring,
    half_energy_of_springs_of_node,
    kinetic_energy_of_node,
)
from pdsolve.adaptivity.hybrid.nodes import (
    interpolate_bilinear,
    set_coarse_node_properties,
    set_coarsest_node_properties,
)
from pdsolve.adaptivity.hybrid.precracks import is_unbreakable
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.row_histories import strain_off_straight
from pdsolve.numerics.dilation import in_square
from pdsolve.zone.cells import (
    BORDER,
    COARSE,
    FAR,
    FREE,
    IDLE,
    count_cells_of_kind_around,
    lattice_coordinates,
    place_number_at,
    place_on_finer_lattice,
    scale_coordinates,
)

WORTH_FAR = 2**20  # cells of 2 h: in smaller plates the steps of far ones cost too little to save
AWAY = 16  # cells of 2 h between what is not a plain coarse cell and far ones, at the start
NEAR = 12  # likewise where cells become fine or far springs are stretched


def coarsen_cells_away_from_cracks_edges_and_loads(
    plate: HybridPlate, lattice: LatticeConstants, cells: NDArray[np.uint8], loaded_places: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """The cells (c,) with far ones away from outlines, cracks, fine cells and the `loaded_places` places of fine nodes.

    There are none in small plates, and none of several materials, or where nodes are damped.
    """
    numbering = plate.numbering
    columns, rows = numbering.cells.counts
    if (
        rows * columns < WORTH_FAR
        or lattice.coarse_cell_constants.shape[1] > 1
        or lattice.node_constants.damping is not None
    ):
        return cells
    new_cells = cells.reshape(numbering.cells.shape).copy()
    inner = new_cells[numbering.cells.inner]
    odd = (inner != COARSE) | lattice.is_cell_cut.reshape(new_cells.shape)[numbering.cells.inner]
    x, y = lattice_coordinates(numbering.fine, loaded_places)
    odd[(y // 2).clip(max=rows - 1), (x // 2).clip(max=columns - 1)] = True
    odd = in_square(odd, AWAY)[: rows // 2 * 2, : columns // 2 * 2]
    far = ~(odd[::2, ::2] | odd[1::2, ::2] | odd[::2, 1::2] | odd[1::2, 1::2])
    for row in (0, 1):
        for column in (0, 1):
            inner[row : rows // 2 * 2 : 2, column : columns // 2 * 2 : 2][far] = FAR
    return new_cells.ravel()


@njit(**INNER)
def _divide_coarsest_cells_near(numbering, cells, x, y, listed, count):  # type: ignore[no-untyped-def]
    """List the far cells near cell x, y, which become coarse; returns how many are listed then."""
    columns, rows = numbering.cells.counts
    for row in range(max(y - NEAR, 0) // 2, min(y + NEAR, rows - 1) // 2 + 1):
        for column in range(max(x - NEAR, 0) // 2, min(x + NEAR, columns - 1) // 2 + 1):
            c = place_number_at(numbering.cells, (2 * column, 2 * row))
            if cells[c] == FAR:
                cells[c] = cells[c + 1] = cells[c + numbering.cells.strides[1]] = cells[
                    c + numbering.cells.strides[1] + 1
                ] = COARSE
                listed[count] = c
                count += 1
    return count


@njit(**INNER)
def _divide_stretched_coarsest_cells(lattice, zone, displacement_buffer_index, count):  # type: ignore[no-untyped-def]
    """List the far cells near stretched far springs."""
    numbering, far, u = lattice.numbering, zone.far, zone.far.u[displacement_buffer_index]
    table, offsets = lattice.coarsest_spring_table, lattice.coarsest_neighbour_offsets
    for row in far.active_rows[: zone.counts.active_coarsest_rows]:
        if far.has_large_stretch[row] == 0:
            continue
        for lane in range(ROW):
            q = row * ROW + lane
            p = place_on_finer_lattice(numbering.far, numbering.fine, 4, q)
            if far.node_kinds[q] == IDLE or is_unbreakable(lattice, p):
                continue
            for k in range(len(offsets)):
                e = double_green_strain_of_spring(far, table, offsets, u, q, k)
                if strain_off_straight(zone.history, e) > lattice.least_strain_bounds[2]:
                    x, y = scale_coordinates(lattice_coordinates(numbering.far, q), 2)
                    count = _divide_coarsest_cells_near(
                        numbering, zone.cell_kinds, x, y, zone.affected_fine_nodes, count
                    )
                    break
    return count


@njit(**INNER)
def divide_coarsest_cells(lattice, zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Make far cells coarse near `zone.new_cells` and near stretched far springs; returns whether there were any.

    Nodes that come take the motion between far ones; the change of energy is booked. Nodes are to be listed then.
    """
    numbering, new, count = lattice.numbering, zone.new_cells[: zone.counts.new_cells], 0
    for c in new:
        count = _divide_coarsest_cells_near(
            numbering, zone.cell_kinds, *lattice_coordinates(numbering.cells, c), zone.affected_fine_nodes, count
        )
    count = _divide_stretched_coarsest_cells(lattice, zone, displacement_buffer_index, count)
    if count == 0:
        return False
    for c in new:
        zone.cell_kinds[c] = COARSE
    _list_nodes_of_coarsest_cells(numbering, zone, zone.affected_fine_nodes[:count])
    before = _total_energy_of_affected_nodes(lattice, zone, displacement_buffer_index)
    _interpolate_new_coarse_nodes(lattice, zone, displacement_buffer_index)
    set_affected_coarse_and_coarsest_node_properties(lattice, zone)
    zone.totals.refinement_energy += _total_energy_of_affected_nodes(lattice, zone, displacement_buffer_index) - before
    return True


@njit(**INNER)
def _list_nodes_of_coarsest_cells(numbering, zone, blocks):  # type: ignore[no-untyped-def]
    """List the coarse and far nodes of these cells of 4 h."""
    around = far = 0
    for c in blocks:
        x, y = lattice_coordinates(numbering.cells, c)
        for n in range(9):
            p = place_number_at(numbering.fine, (2 * (x + n % 3), 2 * (y + n // 3)))
            if not zone.is_node_marked[p]:
                zone.is_node_marked[p] = True
                zone.affected_coarse_nodes[around] = place_number_at(numbering.coarse, (x + n % 3, y + n // 3))
                around += 1
                if n % 3 != 1 and n // 3 != 1:
                    zone.affected_coarsest_nodes[far] = place_number_at(
                        numbering.far, ((x + n % 3) // 2, (y + n // 3) // 2)
                    )
                    far += 1
    zone.counts.affected_coarse_nodes, zone.counts.affected_coarsest_nodes = around, far
    for q in zone.affected_coarse_nodes[:around]:
        zone.is_node_marked[place_on_finer_lattice(numbering.coarse, numbering.fine, 2, q)] = False


@njit(**INNER)
def _total_energy_of_affected_nodes(lattice, zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Energy, J/m, of the listed nodes."""
    coarse, far, energy = zone.coarse, zone.far, 0.0
    for q in zone.affected_coarse_nodes[: zone.counts.affected_coarse_nodes]:
        if coarse.node_kinds[q] != IDLE:
            energy += half_energy_of_springs_of_node(
                coarse,
                None,
                lattice.coarse_spring_table,
                lattice.coarse_neighbour_offsets,
                True,
                coarse.u[displacement_buffer_index],
                q,
            )
        if coarse.node_kinds[q] == FREE:
            energy += kinetic_energy_of_node(coarse, q)
    for q in zone.affected_coarsest_nodes[: zone.counts.affected_coarsest_nodes]:
        if far.node_kinds[q] == FREE:
            energy += half_energy_of_springs_of_node(
                far,
                None,
                lattice.coarsest_spring_table,
                lattice.coarsest_neighbour_offsets,
                True,
                far.u[displacement_buffer_index],
                q,
            ) + kinetic_energy_of_node(far, q)
    return energy


@njit(**INNER)
def _interpolate_new_coarse_nodes(lattice, zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Give the listed coarse nodes that are not free the motion of far ones."""
    numbering, coarse, far, two = lattice.numbering, zone.coarse, zone.far, zone.lane_sums[0, :2]
    for q in zone.affected_coarse_nodes[: zone.counts.affected_coarse_nodes]:
        if coarse.node_kinds[q] == FREE:
            continue
        x, y = lattice_coordinates(numbering.coarse, q)
        for values, coarse_values in (
            (far.u[displacement_buffer_index], coarse.u[displacement_buffer_index]),
            (far.v, coarse.v),
        ):
            interpolate_bilinear(numbering.far, values, x, y, x // 2, y // 2, two)
            coarse_values[0, q], coarse_values[1, q] = two[0], two[1]


@njit(**INNER)
def set_affected_coarse_and_coarsest_node_properties(lattice, zone):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of the listed nodes; tied ones have no motion of their own."""
    for q in zone.affected_coarse_nodes[: zone.counts.affected_coarse_nodes]:
        set_coarse_node_properties(lattice, zone.cell_kinds, zone.fine, zone.coarse, q)
        if zone.coarse.node_kinds[q] == BORDER:
            zone.coarse.v[0, q] = zone.coarse.v[1, q] = 0.0
    for q in zone.affected_coarsest_nodes[: zone.counts.affected_coarsest_nodes]:
        set_coarsest_node_properties(lattice, zone, q)
        if zone.far.node_kinds[q] == IDLE:
            zone.far.v[0, q] = zone.far.v[1, q] = 0.0


@njit(**INNER)
def set_all_coarsest_node_properties(lattice, zone):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of all far nodes, once those of coarse nodes are set."""
    numbering = lattice.numbering
    for y in range(numbering.far.counts[1]):
        for x in range(numbering.far.counts[0]):
            if count_cells_of_kind_around(numbering, zone.cell_kinds, (4 * x, 4 * y), FAR) > 0:
                set_coarsest_node_properties(lattice, zone, place_number_at(numbering.far, (x, y)))
