"""Force densities and energies of active fine and coarse nodes, and where fine nodes are needed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from pdsolve.adaptivity.collocation.bond_breaking import add_release_forces_of_broken_bonds, break_bonds_of_row
from pdsolve.adaptivity.collocation.row_stiffness import COMPUTED, WHOLE, store_row_stiffness
from pdsolve.adaptivity.collocation.zone import COARSE
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import difference, elongation, sums_in, zeros
from pdsolve.lattice.layout import ONE, PLANE
from pdsolve.lattice.rows import own_weight, sum_by_roots, sum_wide


@cached_njit(error_model="numpy")
def interpolate_fictitious_nodes(zone):  # type: ignore[no-untyped-def]
    """Interpolate the displacements of the fictitious nodes."""
    field = zone.u
    for n in range(len(zone.fictitious_nodes)):
        p, i, j, k, m = zone.fictitious_nodes[n]
        for axis in range(2):
            field[axis, p] = 0.25 * ((field[axis, i] + field[axis, j]) + (field[axis, k] + field[axis, m]))


@cached_njit(error_model="numpy")
def mark_stretched_coarse_pairs(lattice, zone, kappa):  # type: ignore[no-untyped-def]
    """Mark both nodes of each coarse pair stretched beyond `kappa` times the critical stretch."""
    stretch = np.sqrt(1 + lattice.limit_double_green_strain) - 1
    hot = kappa * stretch * (kappa * stretch + 2)
    u, any_hot, largest = zone.u, False, zone.totals.largest_double_green_strain
    for q in zone.active_coarse_places:
        for s in range(len(lattice.coarse_stencil_place_offsets)):
            j = q + lattice.coarse_stencil_place_offsets[s]
            x, y = u[0, j] - u[0, q], u[1, j] - u[1, q]
            inverse = lattice.stencil_vector_constants[s, 2]
            e = (x * inverse + lattice.stencil_vector_constants[s, 0]) * x + (
                y * inverse + lattice.stencil_vector_constants[s, 1]
            ) * y
            if e > hot and not (lattice.no_fail[q] or lattice.no_fail[j]):
                zone.is_to_refine[q] = zone.is_to_refine[j] = any_hot = True
            if e > largest and zone.node_kinds[j] == COARSE:
                largest = e
    zone.totals.largest_double_green_strain = largest
    return any_hot


@cached_njit(error_model="numpy")
def sum_coarse_forces(lattice, zone):  # type: ignore[no-untyped-def]
    """Force densities of active coarse nodes from their stencils, of a row of places at once."""
    stiffness, ways, sums = lattice.stencil_stiffness, lattice.coarse_stencil_place_offsets, np.empty((2, ROW))
    for row in zone.rows_with_coarse_nodes:
        for lane in range(0, ROW, across(sums)):
            p, (x, y) = row * ROW + lane, zeros(zone.u, PLANE)
            for s in range(len(ways)):
                u, v = beside(zone.u, PLANE, p + ways[s])
                x = x + (u * stiffness[s, 0] + v * stiffness[s, 1])
                y = y + (u * stiffness[s, 1] + v * stiffness[s, 2])
            keep((x, y), sums, lane)
        for lane in range(ROW):
            if zone.node_kinds[row * ROW + lane] == COARSE:
                zone.f[0, row * ROW + lane], zone.f[1, row * ROW + lane] = sums[0, lane], sums[1, lane]


def _compile_row_sum(sum_row: Any) -> Any:
    """The forces on a row whose bonds have the stiffnesses (k, 16); `sum_row` is one of `pdsolve.lattice.rows`."""

    @njit(**INNER)
    def sum_forces_of_lanes(lattice, zone, row, stiffness, lane_sums):  # type: ignore[no-untyped-def]
        table, ways, limit, flags = (
            lattice.spring_table,
            lattice.neighbour_offsets,
            lattice.limit_double_green_strain,
            0,
        )
        for lane in range(0, ROW, across(zone.u)):
            p = row * ROW + lane
            if zone.stiffness_index_of_row[row] == WHOLE:
                flags |= sum_row(zone.u, PLANE, table, ways, None, None, None, None, row, lane, p, limit, lane_sums)
            else:
                cut = stiffness, zone.cut_bond_bits
                flags |= sum_row(zone.u, PLANE, table, ways, cut, None, None, None, row, lane, p, limit, lane_sums)
            keep(beside(sums_in(lane_sums, PLANE), PLANE, 0), zone.f, p)
        return flags

    return sum_forces_of_lanes


_sum_wide, _sum_by_roots = _compile_row_sum(sum_wide), _compile_row_sum(sum_by_roots)


@njit(**INNER)
def _sum_forces_of_row(lattice, zone, row, scratch, lane_sums):  # type: ignore[no-untyped-def]
    """Sum the force densities on the nodes of one row; returns whether a bond is over its limit."""
    index = zone.stiffness_index_of_row[row]
    if index == COMPUTED:
        store_row_stiffness(lattice, row, scratch)
    stiffness = scratch if index == COMPUTED else lattice.row_stiffness[max(index, 0)]
    flags = _sum_wide(lattice, zone, row, stiffness, lane_sums)
    if flags & 1:
        _sum_by_roots(lattice, zone, row, stiffness, lane_sums)
    return flags & 2 != 0


@cached_njit(nogil=True, error_model="numpy")
def sum_forces_of_fine_rows(lattice, zone, first, last):  # type: ignore[no-untyped-def]
    """Sum the force densities on the nodes of the rows `first` to `last` - 1 with fine nodes."""
    scratch, lane_sums = np.empty(lattice.row_stiffness.shape[1:]), np.empty(2 * ROW)
    for row in zone.rows_with_fine_nodes[first:last]:
        zone.has_bond_over_limit[row] = _sum_forces_of_row(lattice, zone, row, scratch, lane_sums)


@cached_njit(error_model="numpy")
def break_stretched_bonds(lattice, zone, step, dt):  # type: ignore[no-untyped-def]
    """Break bonds over their limit, book their energy, and recompute forces there; returns whether fine nodes are
    needed."""
    broken_before, zone.counts.refinement_due = zone.counts.broken_bonds, 0
    for row in zone.rows_with_fine_nodes:
        if zone.has_bond_over_limit[row]:
            break_bonds_of_row(lattice, zone, step, dt, row)
    if zone.counts.broken_bonds > broken_before:
        scratch, lane_sums = np.empty(lattice.row_stiffness.shape[1:]), np.empty(2 * ROW)
        for row in zone.rows_with_fine_nodes:
            if zone.has_bond_over_limit[row]:  # as have the rows of both ends of a bond that breaks
                _sum_forces_of_row(lattice, zone, row, scratch, lane_sums)
    add_release_forces_of_broken_bonds(lattice, zone, step, dt)
    return zone.counts.refinement_due != 0


@cached_njit(error_model="numpy")
def add_force_densities(force_density, places, out):  # type: ignore[no-untyped-def]
    """Add the force densities (2, places) of the nodes at some places to `out` (places, 2)."""
    for p in places:
        for axis in range(2):
            out[p, axis] += force_density[axis, p]


@cached_njit(error_model="numpy")
def store_strain_energy_densities(lattice, zone, rows, densities):  # type: ignore[no-untyped-def]
    """Store energy densities, J/m^3, of nodes in these rows and of active coarse nodes in `densities` (1, places).

    Those of coarse nodes are also half of each pair's, with the stencil as springs: the energy that motion conserves.
    """
    interpolate_fictitious_nodes(zone)
    scratch = np.empty(lattice.row_stiffness.shape[1:])
    for row in rows:
        index = zone.stiffness_index_of_row[row]
        if index == COMPUTED:
            store_row_stiffness(lattice, row, scratch)
        stiffness = scratch if index == COMPUTED else lattice.row_stiffness[max(index, 0)]
        _store_row_energy_densities(lattice, zone, row, stiffness, densities)
    u = zone.u
    for q in zone.active_coarse_places:
        energy = 0.0
        for s in range(len(lattice.coarse_stencil_place_offsets)):
            j = q + lattice.coarse_stencil_place_offsets[s]
            x, y = u[0, j] - u[0, q], u[1, j] - u[1, q]
            energy += (
                lattice.stencil_stiffness[s, 0] * x * x
                + 2 * lattice.stencil_stiffness[s, 1] * x * y
                + lattice.stencil_stiffness[s, 2] * y * y
            )
        densities[0, q] = energy / 4


@njit(**INNER)
def _store_row_energy_densities(lattice, zone, row, stiffness, densities):  # type: ignore[no-untyped-def]
    """Energy densities (1, places), J/m^3, of the nodes of a row: half of each bond's."""
    table, weights = lattice.spring_table, (stiffness, zone.cut_bond_bits)
    for lane in range(0, ROW, across(zone.u)):
        p, (energy,) = row * ROW + lane, zeros(zone.u, ONE)
        here = beside(zone.u, PLANE, p)
        for k in range(len(table)):
            eta = difference(beside(zone.u, PLANE, p + lattice.neighbour_offsets[k]), here)
            w, e = own_weight(weights, energy, elongation(eta, table[k]), row, k, lane)
            stretch = e / (np.sqrt(e + 1.0) + 1.0)
            energy = energy + w * (stretch * stretch) * (0.25 / table[k, 4])
        keep((energy,), densities, p)
