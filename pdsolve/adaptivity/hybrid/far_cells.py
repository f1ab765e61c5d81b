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
from pdsolve.adaptivity.hybrid.energy import compact_spring_energy, kinetic_energy, strain_e
from pdsolve.adaptivity.hybrid.far_nodes import count_far_cells_around, interpolate_far, set_far_node
from pdsolve.adaptivity.hybrid.lattice import (
    AROUND,
    BELOW,
    BORDER,
    COARSE,
    FAR,
    FREE,
    IDLE,
    LEFT,
    cell_column,
    cell_place,
    cell_row,
    coarse_column,
    coarse_place,
    coarse_row,
    far_column,
    far_place,
    far_row,
    fine_place,
)
from pdsolve.adaptivity.hybrid.nodes import set_coarse_node
from pdsolve.adaptivity.hybrid.precracks import lasts
from pdsolve.codegen.vector_code import ROW
from pdsolve.numerics.dilation import in_square
from pdsolve.operators.simd_lattice.kernel import INNER, displaced

WORTH_FAR = 2**20  # cells of 2 h: in smaller plates the steps of far ones cost too little to save
AWAY = 16  # cells of 2 h between what is not a plain coarse cell and far ones, at the start
NEAR = 12  # likewise where cells become fine or far springs are stretched


def add_far_cells(
    plate: HybridPlate, ground: LatticeConstants, cells: NDArray[np.uint8], driven_places: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """The cells (c,) with far ones away from outlines, cracks, fine cells and the `driven_places` places of fine nodes.

    There are none in small plates, and none of several materials, or where nodes are damped.
    """
    at = plate.at
    rows, columns = at.ny // 2, at.nx // 2
    if rows * columns < WORTH_FAR or ground.cell.shape[1] > 1 or ground.nodes.damping is not None:
        return cells
    new_cells = cells.reshape(-1, at.cell_stride).copy()
    inner = new_cells[AROUND : AROUND + rows, AROUND : AROUND + columns]
    cut = ground.cut_cells.reshape(new_cells.shape)[AROUND : AROUND + rows, AROUND : AROUND + columns]
    odd = (inner != COARSE) | cut
    y, x = np.divmod(driven_places, at.stride)
    odd[((y - BELOW) // 2).clip(max=rows - 1), ((x - LEFT) // 2).clip(max=columns - 1)] = True
    odd = in_square(odd, AWAY)[: rows // 2 * 2, : columns // 2 * 2]
    far = ~(odd[::2, ::2] | odd[1::2, ::2] | odd[::2, 1::2] | odd[1::2, 1::2])
    for row in (0, 1):
        for column in (0, 1):
            inner[row : rows // 2 * 2 : 2, column : columns // 2 * 2 : 2][far] = FAR
    return new_cells.ravel()


@njit(**INNER)
def _list_far_cells_near(at, cells, x, y, listed, count):  # type: ignore[no-untyped-def]
    """List the far cells near cell x, y, which become coarse; returns how many are listed then."""
    for row in range(max(y - NEAR, 0) // 2, (min(y + NEAR, at.ny // 2 - 1)) // 2 + 1):
        for column in range(max(x - NEAR, 0) // 2, (min(x + NEAR, at.nx // 2 - 1)) // 2 + 1):
            c = cell_place(at, 2 * column, 2 * row)
            if cells[c] == FAR:
                cells[c] = cells[c + 1] = cells[c + at.cell_stride] = cells[c + at.cell_stride + 1] = COARSE
                listed[count] = c
                count += 1
    return count


@njit(**INNER)
def _list_stretched_far_cells(ground, zone, now, count):  # type: ignore[no-untyped-def]
    """List the far cells near stretched far springs."""
    at, far, table = ground.at, zone.far, ground.far_table
    for row in far.rows[: zone.counts.far_rows]:
        if far.wide[row] == 0:
            continue
        for lane in range(ROW):
            q, entry = row * ROW + lane, far.entry[row]
            p = fine_place(at, 4 * far_column(at, q), 4 * far_row(at, q))
            if far.kind[q] == IDLE or lasts(ground, p):
                continue
            for k in range(8):
                if entry >= 0 and far.own[entry, k, lane] == 0:
                    continue
                eta_x, eta_y = displaced(far.u[now], far.shrink, table[k, 0], table[k, 1], q, q + ground.far_ways[k])
                if strain_e(table, k, eta_x, eta_y) > ground.least[2]:
                    x, y = 2 * far_column(at, q), 2 * far_row(at, q)
                    count = _list_far_cells_near(at, zone.cells, x, y, zone.affected_nodes, count)
                    break
    return count


@njit(**INNER)
def divide_far_cells(ground, zone, now):  # type: ignore[no-untyped-def]
    """Make far cells coarse near `zone.new_cells` and near stretched far springs; returns whether there were any.

    Nodes that come take the motion between far ones; the change of energy is booked. Nodes are to be listed then.
    """
    at, new, count = ground.at, zone.new_cells[: zone.counts.new_cells], 0
    for c in new:
        count = _list_far_cells_near(at, zone.cells, cell_column(at, c), cell_row(at, c), zone.affected_nodes, count)
    count = _list_stretched_far_cells(ground, zone, now, count)
    if count == 0:
        return False
    for c in new:
        zone.cells[c] = COARSE
    _list_nodes_of_far_cells(at, zone, zone.affected_nodes[:count])
    before = _energy_of_listed(ground, zone, now)
    _interpolate_new_coarse(ground, zone, now)
    set_listed_nodes(ground, zone)
    zone.totals.refinement += _energy_of_listed(ground, zone, now) - before
    return True


@njit(**INNER)
def _list_nodes_of_far_cells(at, zone, blocks):  # type: ignore[no-untyped-def]
    """List the coarse and far nodes of these cells of 4 h."""
    around = far = 0
    for c in blocks:
        x, y = cell_column(at, c), cell_row(at, c)
        for n in range(9):
            p = fine_place(at, 2 * (x + n % 3), 2 * (y + n // 3))
            if not zone.mark[p]:
                zone.mark[p] = True
                zone.affected_coarse[around] = coarse_place(at, x + n % 3, y + n // 3)
                around += 1
                if n % 3 != 1 and n // 3 != 1:
                    zone.affected_far[far] = far_place(at, (x + n % 3) // 2, (y + n // 3) // 2)
                    far += 1
    zone.counts.around, zone.counts.far_around = around, far
    for q in zone.affected_coarse[:around]:
        zone.mark[fine_place(at, 2 * coarse_column(at, q), 2 * coarse_row(at, q))] = False


@njit(**INNER)
def _energy_of_listed(ground, zone, now):  # type: ignore[no-untyped-def]
    """Energy, J/m, of the listed nodes."""
    coarse, far, energy = zone.coarse, zone.far, 0.0
    for q in zone.affected_coarse[: zone.counts.around]:
        if coarse.kind[q] != IDLE:
            energy += compact_spring_energy(coarse, ground.coarse_table, ground.coarse_ways, coarse.u[now], q)
        if coarse.kind[q] == FREE:
            energy += kinetic_energy(coarse, q)
    for q in zone.affected_far[: zone.counts.far_around]:
        if far.kind[q] == FREE:
            energy += compact_spring_energy(far, ground.far_table, ground.far_ways, far.u[now], q) + kinetic_energy(
                far, q
            )
    return energy


@njit(**INNER)
def _interpolate_new_coarse(ground, zone, now):  # type: ignore[no-untyped-def]
    """Give the listed coarse nodes that are not free the motion of far ones."""
    at, coarse, far, two = ground.at, zone.coarse, zone.far, zone.s[0, :2]
    for q in zone.affected_coarse[: zone.counts.around]:
        if coarse.kind[q] == FREE:
            continue
        x, y = coarse_column(at, q), coarse_row(at, q)
        for values, coarse_values in ((far.u[now], coarse.u[now]), (far.v, coarse.v)):
            interpolate_far(at, values, x, y, two)
            coarse_values[0, q], coarse_values[1, q] = two[0], two[1]


@njit(**INNER)
def set_listed_nodes(ground, zone):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of the listed nodes; tied ones have no motion of their own."""
    for q in zone.affected_coarse[: zone.counts.around]:
        set_coarse_node(ground, zone.cells, zone.fine, zone.coarse, q)
        if zone.coarse.kind[q] == BORDER:
            zone.coarse.v[0, q] = zone.coarse.v[1, q] = 0.0
    for q in zone.affected_far[: zone.counts.far_around]:
        set_far_node(ground, zone, q)
        if zone.far.kind[q] == IDLE:
            zone.far.v[0, q] = zone.far.v[1, q] = 0.0


@njit(**INNER)
def set_all_far_nodes(ground, zone):  # type: ignore[no-untyped-def]
    """Set kinds, masses and springs of all far nodes, once those of coarse nodes are set."""
    at = ground.at
    for y in range(at.ny // 4 + 1):
        for x in range(at.nx // 4 + 1):
            if count_far_cells_around(at, zone.cells, 2 * x, 2 * y) > 0:
                set_far_node(ground, zone, far_place(at, x, y))
