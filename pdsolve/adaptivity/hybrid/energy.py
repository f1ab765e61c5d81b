"""Energy of springs and clipped bonds, and kinetic energy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from pdsolve.codegen.inner_functions import INNER, is_none
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, same, unless_none
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import displaced
from pdsolve.lattice.layout import ONE, PLANE
from pdsolve.lattice.row_histories import energy_of_bond, energy_of_lanes, of_usual_rows
from pdsolve.zone.cells import FREE, IDLE
from pdsolve.zone.springs import INVERSE, STIFFNESS, X, Y


@njit(forceinline=True, **INNER)
def spring_double_green_strain(spring_table, k, eta_x, eta_y):  # type: ignore[no-untyped-def]
    """e of a spring: (|xi + eta|^2 - |xi|^2) / |xi|^2."""
    x, y, inverse = spring_table[k, 0], spring_table[k, 1], spring_table[k, 4]
    return inverse * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)


@njit(**INNER)
def double_green_strain_of_spring(nodes, spring_table, offsets, u, q, k):  # type: ignore[no-untyped-def]
    """e of spring k of a node; 0 if there is none."""
    entry, xi_x, xi_y = nodes.stiffness_index_of_row[q // ROW], spring_table[k, X], spring_table[k, Y]
    if entry >= 0 and nodes.row_stiffness[entry, k, q % ROW] == 0:
        return 0.0
    eta_x, eta_y = displaced(u, nodes.negative_half_swelling, xi_x, xi_y, q, q + offsets[k])
    return spring_double_green_strain(spring_table, k, eta_x, eta_y)


@njit(**INNER)
def half_energy_of_springs_of_node(nodes, history, spring_table, offsets, uses_green_strain, u, p):  # type: ignore[no-untyped-def]
    """Half of the energy of a node's springs, J/m; of coarse ones by Green's strain."""
    row, lane, energy = p // ROW, p % ROW, 0.0
    entry = nodes.stiffness_index_of_row[row]
    for k in range(len(offsets)):
        stiffness = nodes.row_stiffness[entry, k, lane] if entry >= 0 else spring_table[k, STIFFNESS]
        if stiffness == 0:
            continue
        xi_x, xi_y = spring_table[k, X], spring_table[k, Y]
        eta_x, eta_y = displaced(u, nodes.negative_half_swelling, xi_x, xi_y, p, p + offsets[k])
        e = spring_double_green_strain(spring_table, k, eta_x, eta_y)
        stretch = e * 0.5 if uses_green_strain else e / (np.sqrt(1 + e) + 1)
        energy += energy_of_bond(history, stiffness / spring_table[k, INVERSE], stretch, entry, k, lane) / 4
    return energy


def _relative_displacement(u: Any, negative_half_swelling: Any, x: Any, y: Any, p: Any, j: Any) -> Any:
    """How far the nodes j are displaced from the nodes p, in lanes from these places on; less what swelling takes."""


@overload(_relative_displacement, jit_options=INNER | {"forceinline": True})
def _overload_relative_displacement(u, negative_half_swelling, x, y, p, j):  # type: ignore[no-untyped-def]
    if is_none(negative_half_swelling):
        return lambda u, negative_half_swelling, x, y, p, j: _displacement_difference(u, p, j)

    def displacement_without_swelling(u, negative_half_swelling, x, y, p, j):  # type: ignore[no-untyped-def]
        eta_x, eta_y = _displacement_difference(u, p, j)
        both = beside(negative_half_swelling, ONE, p)[0] + beside(negative_half_swelling, ONE, j)[0]
        return eta_x + both * x, eta_y + both * y

    return displacement_without_swelling


@njit(forceinline=True, **INNER)
def _displacement_difference(u, p, j):  # type: ignore[no-untyped-def]
    displacement, neighbour_displacement = beside(u, PLANE, p), beside(u, PLANE, j)
    return neighbour_displacement[0] - displacement[0], neighbour_displacement[1] - displacement[1]


@njit(**INNER)
def store_half_spring_energies_of_row(nodes, history, spring_table, offsets, uses_green_strain, row, u, lane_sums):  # type: ignore[no-untyped-def]
    """Set s to half the energies of the springs of a row's lanes, J/m; of coarse ones by Green's strain."""
    entry, slots, none = nodes.stiffness_index_of_row[row], len(offsets), same(u, 0.0)
    for lane in range(0, ROW, across(lane_sums)):
        p, energy = np.int64(row * ROW + lane), none
        for k in range(slots):
            x, y = spring_table[k, X], spring_table[k, Y]
            eta_x, eta_y = _relative_displacement(u, nodes.negative_half_swelling, x, y, p, np.int64(p + offsets[k]))
            e = spring_table[k, INVERSE] * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
            w = same(u, spring_table[k, STIFFNESS])
            if entry >= 0:
                w = beside(nodes.row_stiffness, ONE, np.int64((entry * slots + k) * ROW + lane))[0]
                e = unless_none(w, e, none)
            stretch = e * 0.5 if uses_green_strain else e / (np.sqrt(1.0 + e) + 1.0)
            w = w / spring_table[k, INVERSE]
            if entry >= 0:
                stored = energy_of_lanes(history, w, stretch, entry, k, lane)
            else:
                stored = energy_of_lanes(of_usual_rows(history), w, stretch, entry, k, lane)
            energy = energy + stored * 0.25
        keep((energy,), lane_sums, lane)


@njit(forceinline=True, **INNER)
def _bond_piece_end_displacement(end, fine_u, coarse_u, axis):  # type: ignore[no-untyped-def]
    """Displacement of an end of a piece."""
    if end.second_node < 0:
        return fine_u[axis, end.first_node]
    w = end.second_weight
    return (1 - w) * coarse_u[axis, end.first_node] + w * coarse_u[axis, end.second_node]


@njit(forceinline=True, **INNER)
def bond_piece_elongation(pieces, fine_u, coarse_u, n):  # type: ignore[no-untyped-def]
    """How far the ends of a piece are displaced from each other, less what swelling takes, m."""
    first, second, spring = pieces.ends[n, 0], pieces.ends[n, 1], pieces.springs[n]
    eta_x = _bond_piece_end_displacement(second, fine_u, coarse_u, 0) - _bond_piece_end_displacement(
        first, fine_u, coarse_u, 0
    )
    eta_y = _bond_piece_end_displacement(second, fine_u, coarse_u, 1) - _bond_piece_end_displacement(
        first, fine_u, coarse_u, 1
    )
    return eta_x + spring.swelling_x, eta_y + spring.swelling_y


@njit(forceinline=True, **INNER)
def bond_piece_double_green_strain(spring, eta_x, eta_y):  # type: ignore[no-untyped-def]
    """e of a piece of a clipped bond."""
    return spring.inverse_square * (2 * (spring.xi_x * eta_x + spring.xi_y * eta_y) + eta_x * eta_x + eta_y * eta_y)


@njit(**INNER)
def bond_piece_energy(pieces, fine_u, coarse_u, n):  # type: ignore[no-untyped-def]
    """Energy of a piece of a clipped bond, J/m."""
    spring, (eta_x, eta_y) = pieces.springs[n], bond_piece_elongation(pieces, fine_u, coarse_u, n)
    e = bond_piece_double_green_strain(spring, eta_x, eta_y)
    return spring.stiffness / spring.inverse_square * e * e / 8


@njit(**INNER)
def kinetic_energy_of_node(nodes, p):  # type: ignore[no-untyped-def]
    """Kinetic energy of a node with a motion of its own, J/m."""
    return nodes.mass[p] / 2 * (nodes.v[0, p] ** 2 + nodes.v[1, p] ** 2)


@njit(**INNER)
def strain_and_kinetic_energy(lattice, zone, displacement_buffer_index, fine_nodes, coarse_nodes):  # type: ignore[no-untyped-def]
    """Strain and kinetic energy, J/m, of some nodes and of the pieces that some own; these fine nodes must be
    marked."""
    fine, coarse, energy = zone.fine, zone.coarse, 0.0
    u, coarse_u = fine.u[displacement_buffer_index], coarse.u[displacement_buffer_index]
    for p in fine_nodes:
        if fine.node_kinds[p] == IDLE:
            continue
        energy += half_energy_of_springs_of_node(
            fine, zone.history, lattice.spring_table, lattice.neighbour_offsets, False, u, p
        )
        if fine.node_kinds[p] == FREE:
            energy += kinetic_energy_of_node(fine, p)
    for q in coarse_nodes:
        if coarse.node_kinds[q] == FREE:
            energy += half_energy_of_springs_of_node(
                coarse, None, lattice.coarse_spring_table, lattice.coarse_neighbour_offsets, True, coarse_u, q
            ) + kinetic_energy_of_node(coarse, q)
    for n in range(zone.counts.clipped_pieces):
        if zone.is_node_marked[zone.clipped_pieces.springs[n].owner_node]:
            energy += bond_piece_energy(zone.clipped_pieces, u, coarse_u, n)
    return energy


@njit(**INNER)
def energy_of_supports(zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """Energy of the springs to the ground, J/m."""
    energy, u, coarse_u = 0.0, zone.fine.u[displacement_buffer_index], zone.coarse.u[displacement_buffer_index]
    for n in range(zone.counts.node_supports):
        on, entry = zone.supports.node_and_entry[n, 0], zone.supports.entries[zone.supports.node_and_entry[n, 1]]
        displacement = u[entry.axis, on] if on >= 0 else coarse_u[entry.axis, -1 - on]
        energy += zone.supports.node_share[n] * entry.value * displacement**2 / 2
    return energy


@cached_njit(error_model="numpy")
def store_strain_energies_of_lattices(lattice, zone, displacement_buffer_index, fine_energy, coarse_energy, far_energy):  # type: ignore[no-untyped-def]
    """Strain energies, J/m, of fine, coarse and far nodes, by their places; half of a piece's belongs to either end."""
    fine, coarse, pieces, s = zone.fine, zone.coarse, zone.clipped_pieces, zone.lane_sums[0]
    for row in fine.active_rows[: zone.counts.active_fine_rows]:
        store_half_spring_energies_of_row(
            fine,
            zone.history,
            lattice.spring_table,
            lattice.neighbour_offsets,
            False,
            row,
            fine.u[displacement_buffer_index],
            s,
        )
        for p in range(row * ROW, row * ROW + ROW):
            fine_energy[p] = s[p % ROW] if fine.node_kinds[p] != IDLE else 0.0
    lattices = (
        (
            coarse,
            zone.counts.active_coarse_rows,
            lattice.coarse_spring_table,
            lattice.coarse_neighbour_offsets,
            coarse_energy,
        ),
        (
            zone.far,
            zone.counts.active_coarsest_rows,
            lattice.coarsest_spring_table,
            lattice.coarsest_neighbour_offsets,
            far_energy,
        ),
    )
    for nodes, count, table, ways, energies in lattices:
        for row in nodes.active_rows[:count]:
            store_half_spring_energies_of_row(
                nodes, None, table, ways, True, row, nodes.u[displacement_buffer_index], s
            )
            for q in range(row * ROW, row * ROW + ROW):
                energies[q] = s[q % ROW] if nodes.node_kinds[q] != IDLE else 0.0
    for n in range(zone.counts.clipped_pieces):
        half = bond_piece_energy(pieces, fine.u[displacement_buffer_index], coarse.u[displacement_buffer_index], n) / 2
        for side in range(2):
            end = pieces.ends[n, side]
            if end.second_node < 0:
                fine_energy[end.first_node] += half
            else:
                coarse_energy[end.first_node] += (1 - end.second_weight) * half
                coarse_energy[end.second_node] += end.second_weight * half
