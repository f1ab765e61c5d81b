"""Force densities of active fine and coarse nodes, bonds that break, and where fine nodes are needed."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.collocation.simd_rows import (
    bond_stiffness_over_own_cell_share,
    break_bond,
    double_green_strain_of_bond,
    double_green_strain_one_step_ago,
    is_bond_over_limit,
    store_row_energy_densities,
    store_row_forces,
    store_row_forces_by_square_roots,
)
from pdsolve.adaptivity.collocation.zone import COARSE, FINE
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.calls import added_force, broken_energy, second_share


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
    u, any_hot = zone.u, False
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
            if zone.node_kinds[j] == COARSE:
                zone.totals.largest_double_green_strain = max(zone.totals.largest_double_green_strain, e)
    return any_hot


@cached_njit(error_model="numpy")
def sum_coarse_forces(lattice, zone):  # type: ignore[no-untyped-def]
    """Force densities of active coarse nodes from their stencils."""
    u = zone.u
    for q in zone.active_coarse_places:
        x, y = 0.0, 0.0
        for s in range(len(lattice.coarse_stencil_place_offsets)):
            j = q + lattice.coarse_stencil_place_offsets[s]
            x += lattice.stencil_stiffness[s, 0] * u[0, j] + lattice.stencil_stiffness[s, 1] * u[1, j]
            y += lattice.stencil_stiffness[s, 1] * u[0, j] + lattice.stencil_stiffness[s, 2] * u[1, j]
        zone.f[0, q], zone.f[1, q] = x, y


@cached_njit(nogil=True, error_model="numpy")
def sum_forces_of_fine_rows(lattice, zone, first, last):  # type: ignore[no-untyped-def]
    """Sum the force densities on the nodes of the rows `first` to `last` - 1 with fine nodes."""
    for n in range(first, last):
        zone.bond_over_bound_bits[n] = _sum_forces_of_row(lattice, zone, zone.rows_with_fine_nodes[n])


@njit(**INNER)
def _sum_forces_of_row(lattice, zone, row):  # type: ignore[no-untyped-def]
    """Sum the force densities on the nodes of one row; returns a bit for each node with a bond over its bound."""
    over, exact = store_row_forces(
        lattice, zone.cut_bond_bits, zone.simd_row_kinds[row], zone.break_and_accuracy_bounds, zone.u, zone.f, row
    )
    if not exact:
        store_row_forces_by_square_roots(lattice, zone.cut_bond_bits, zone.simd_row_kinds[row], zone.u, zone.f, row)
    return over


@cached_njit(error_model="numpy")
def break_stretched_bonds(lattice, zone, step, dt):  # type: ignore[no-untyped-def]
    """Break bonds over their limit, book their energy, and recompute forces there; returns whether fine nodes are
    needed."""
    any_broken = False
    zone.counts.refinement_due = 0
    for n in range(len(zone.rows_with_fine_nodes)):
        if zone.bond_over_bound_bits[n] == 0:
            continue
        for p in range(zone.rows_with_fine_nodes[n] * ROW, zone.rows_with_fine_nodes[n] * ROW + ROW):
            if not (zone.bond_over_bound_bits[n] >> (p % ROW)) & 1:
                continue
            for k in range(len(lattice.neighbour_offsets)):
                if not is_bond_over_limit(lattice, zone, zone.u, p, k):
                    continue
                any_broken = True
                _break_bond_and_book_energy(lattice, zone, step, dt, p, k)
    if any_broken:
        for row in zone.rows_with_fine_nodes:
            if zone.has_new_breaks[row]:
                _sum_forces_of_row(lattice, zone, row)
        zone.has_new_breaks[:] = 0
    _add_forces_of_newly_broken_bonds(lattice, zone, step, dt)
    return zone.counts.refinement_due != 0


@njit(**INNER)
def _add_forces_of_newly_broken_bonds(lattice, zone, step, dt):  # type: ignore[no-untyped-def]
    """Let the bonds that broke in this step pull once, and those of the last step a second time."""
    breaks, n = zone.break_events, zone.counts.broken_bonds
    while n > 0 and breaks.step[n - 1] >= step - 1:
        n -= 1
        p, k = breaks.node[n], breaks.bond_number[n]
        stretch, before, _ = _stretch_now_before_and_limit(lattice, zone, dt, p, k)
        share = 1.0 if breaks.step[n] == step else second_share(breaks.stretch_growth_at_break[n], stretch - before)
        _add_force_of_broken_bond(lattice, zone, p, k, breaks.force_at_break[n] * share / (1 + stretch))


@njit(**INNER)
def _stretch_now_before_and_limit(lattice, zone, dt, p, k):  # type: ignore[no-untyped-def]
    """The stretch of bond k of node p now and one step ago, and its limit."""
    e, e0 = (
        double_green_strain_of_bond(lattice, zone.u, p, k),
        double_green_strain_one_step_ago(lattice, zone.u, zone.v, dt, p, k),
    )
    return (
        e / (1 + np.sqrt(1 + e)),
        e0 / (1 + np.sqrt(1 + e0)),
        lattice.limit_double_green_strain / (1 + np.sqrt(1 + lattice.limit_double_green_strain)),
    )


@njit(**INNER)
def _add_force_of_broken_bond(lattice, zone, p, k, pull):  # type: ignore[no-untyped-def]
    """Add a pull of bond k of node p, which has broken, to the forces on both its ends."""
    j, half = p + lattice.neighbour_offsets[k], len(lattice.neighbour_offsets) // 2
    for axis in range(2):
        along = pull * (lattice.spring_table[k, axis] + zone.u[axis, j] - zone.u[axis, p])
        zone.f[axis, p] += bond_stiffness_over_own_cell_share(lattice, p, k) * along
        zone.f[axis, j] -= bond_stiffness_over_own_cell_share(lattice, j, k + half if k < half else k - half) * along


@njit(**INNER)
def _break_bond_and_book_energy(lattice, zone, step, dt, p, k):  # type: ignore[no-untyped-def]
    """Break bond k of node p, and book the energy it has dissipated."""
    j, half, count = p + lattice.neighbour_offsets[k], len(lattice.neighbour_offsets) // 2, zone.counts.broken_bonds
    stretch, before, limit = _stretch_now_before_and_limit(lattice, zone, dt, p, k)
    area = lattice.cell_area_share[0, p] * lattice.spacing**2
    spring = bond_stiffness_over_own_cell_share(lattice, p, k) * area / lattice.spring_table[k, 4]
    energy = broken_energy(lattice.bond_law, spring / 4, stretch, before, limit, limit)
    zone.totals.dissipated_energy += 2 * energy
    for node in (p, j) if zone.node_kinds[j] == FINE else (p, p):
        zone.node_dissipation[node] += energy
    break_bond(lattice, zone, p, k)
    zone.has_new_breaks[p // ROW] = zone.has_new_breaks[j // ROW] = 1
    zone.break_events.step[count] = step
    zone.break_events.node[count], zone.break_events.bond_number[count] = (p, k) if k < half else (j, k - half)
    zone.break_events.force_at_break[count] = added_force(lattice.bond_law, stretch, before, 0.0, limit, limit)
    zone.break_events.stretch_growth_at_break[count] = stretch - before
    zone.counts.broken_bonds += 1
    if zone.node_kinds[j] != FINE:
        zone.counts.refinement_due = 1
        _mark_coarse_nodes_around_to_refine(lattice, zone, j)


@njit(**INNER)
def _mark_coarse_nodes_around_to_refine(lattice, zone, p):  # type: ignore[no-untyped-def]
    """Mark the coarse nodes that a node lies on or between."""
    numbering = lattice.numbering
    right, up = (
        (p % numbering.row_stride - numbering.left_margin) % 2,
        (p // numbering.row_stride - numbering.row_margin) % 2,
    )
    corner = p - right - up * numbering.row_stride
    for y in range(up + 1):
        for x in range(right + 1):
            zone.is_to_refine[corner + 2 * x + 2 * y * numbering.row_stride] = True


@cached_njit(error_model="numpy")
def add_force_densities(zone, out):  # type: ignore[no-untyped-def]
    """Add the force densities of active nodes to `out` (places, 2)."""
    for row in zone.rows_with_fine_nodes:
        for p in range(row * ROW, row * ROW + ROW):
            if zone.node_kinds[p] == FINE:
                for axis in range(2):
                    out[p, axis] += zone.f[axis, p]
    for p in zone.active_coarse_places:
        for axis in range(2):
            out[p, axis] += zone.f[axis, p]


@cached_njit(error_model="numpy")
def store_strain_energy_densities(lattice, zone, rows, densities):  # type: ignore[no-untyped-def]
    """Store energy densities, J/m^3, of nodes in these rows and of active coarse nodes in `densities` (1, places).

    Those of coarse nodes are also half of each pair's, with the stencil as springs: the energy that motion conserves.
    """
    interpolate_fictitious_nodes(zone)
    for row in rows:
        store_row_energy_densities(lattice, zone.cut_bond_bits, zone.simd_row_kinds[row], zone.u, densities, row)
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
