"""Softening and breaking of the bonds of fine nodes."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.clipped_bonds import (
    find_or_reserve_stiffness_index,
    remaining_stiffness_share,
    strain_of_first_change,
    stretch_from_double_green_strain,
)
from pdsolve.adaptivity.hybrid.energy import spring_double_green_strain
from pdsolve.adaptivity.hybrid.precracks import is_unbreakable, peak_and_limit_strain
from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import displaced
from pdsolve.lattice.row_histories import soften_bond
from pdsolve.laws.calls import added_force, broken_energy, dissipated_energy, second_share, total_dissipated_energy
from pdsolve.laws.pair_laws.bilinear import dissipated_share


@njit(forceinline=True, **INNER)
def _record_node_dissipation(zone, p, energy):  # type: ignore[no-untyped-def]
    """Book an energy, J/m, dissipated by a bond of node p."""
    zone.totals.dissipated_energy += energy
    zone.node_dissipation[p] += energy


@njit(**INNER)
def _soften_bilinear_bond(lattice, zone, p, stiffness_index, k, e, ends):  # type: ignore[no-untyped-def]
    peak, limit = ends
    row_stiffness, threshold_strain, lane = zone.fine.row_stiffness, zone.fine.threshold_strain, p % ROW
    past, now = threshold_strain[stiffness_index, k, lane], min(e, limit)
    peak_stretch, limit_stretch = stretch_from_double_green_strain(peak), stretch_from_double_green_strain(limit)
    full_stiffness = row_stiffness[stiffness_index, k, lane] / remaining_stiffness_share(past, peak, limit)
    spent = dissipated_share(stretch_from_double_green_strain(now), peak_stretch, limit_stretch)
    spent -= dissipated_share(stretch_from_double_green_strain(max(past, peak)), peak_stretch, limit_stretch)
    _record_node_dissipation(
        zone, p, full_stiffness / lattice.spring_table[k, 4] * peak_stretch * limit_stretch * spent / 4
    )
    row_stiffness[stiffness_index, k, lane] = full_stiffness * remaining_stiffness_share(now, peak, limit)
    threshold_strain[stiffness_index, k, lane] = now


@njit(**INNER)
def _soften_bond_of_law(lattice, zone, p, stiffness_index, k, e, ends):  # type: ignore[no-untyped-def]
    peak, limit = ends
    fine, law, lane = zone.fine, lattice.empty_law_columns, p % ROW
    past, now = fine.threshold_strain[stiffness_index, k, lane], stretch_from_double_green_strain(min(e, limit))
    ends = stretch_from_double_green_strain(peak), stretch_from_double_green_strain(limit)
    scale = fine.row_stiffness[stiffness_index, k, lane] / lattice.spring_table[k, 4] / 4
    spent = total_dissipated_energy(law, scale, *ends) if e > limit else dissipated_energy(law, scale, now, *ends)
    if past > peak:
        spent -= dissipated_energy(law, scale, stretch_from_double_green_strain(past), *ends)
    _record_node_dissipation(zone, p, spent)
    soften_bond(zone.history, stiffness_index, k, lane, now, *ends)
    fine.threshold_strain[stiffness_index, k, lane] = min(e, limit)


@overloaded(INNER)
def _soften_bond(history, lattice, zone, p, stiffness_index, k, e, ends):  # type: ignore[no-untyped-def]
    """Soften a bond with these e of its peak and its limit, stretched further than ever before, to e, and book the
    dissipated energy."""
    soften = _soften_bilinear_bond if is_none(history) else _soften_bond_of_law
    return lambda history, lattice, zone, p, stiffness_index, k, e, ends: soften(
        lattice, zone, p, stiffness_index, k, e, ends
    )


@njit(**INNER)
def _mark_damaged_node(zone, p):  # type: ignore[no-untyped-def]
    """Mark a node as having a softened or broken bond."""
    if not zone.is_damaged[p]:
        zone.is_damaged[p] = True
        zone.damaged_nodes[zone.counts.damaged_nodes] = p
        zone.counts.damaged_nodes += 1


@njit(**INNER)
def _record_break(zone, step, p, k, breaking_force, stretch_growth):  # type: ignore[no-untyped-def]
    """Record a bond that breaks with a `breaking_force` after some `stretch_growth` of its stretch."""
    n = zone.counts.broken_bonds
    zone.break_events.step[n], zone.break_events.node[n], zone.break_events.bond_number[n] = step, p, k
    zone.break_events.force_at_break[n], zone.break_events.stretch_growth_at_break[n] = breaking_force, stretch_growth
    zone.counts.broken_bonds += 1


@njit(**INNER)
def _unsoftened_stiffness_and_history(fine, history, stiffness_index, k, lane, stiffness, peak, limit):  # type: ignore[no-untyped-def]
    """Stiffness of a bond before it softened, and the largest e it has had above the peak, 0 if it was never there."""
    if peak == limit:  # thresholds of brittle bonds alone have no rows
        return stiffness, 0.0
    past = fine.threshold_strain[stiffness_index, k, lane]
    if past <= peak:
        return stiffness, 0.0
    return _unsoftened_stiffness(history, stiffness, past, peak, limit), past


@overloaded(INNER)
def _unsoftened_stiffness(history, stiffness, past, peak, limit):  # type: ignore[no-untyped-def]
    if is_none(history):
        return lambda history, stiffness, past, peak, limit: stiffness / remaining_stiffness_share(past, peak, limit)
    return lambda history, stiffness, past, peak, limit: stiffness


@njit(**INNER)
def _previous_stretch(lattice, fine, p, j, k, eta_x, eta_y):  # type: ignore[no-untyped-def]
    """The stretch one step ago of bond k from p to j, whose ends are (eta_x, eta_y) further apart now, m."""
    eta_x -= lattice.dt * (fine.v[0, j] - fine.v[0, p])
    eta_y -= lattice.dt * (fine.v[1, j] - fine.v[1, p])
    return stretch_from_double_green_strain(spring_double_green_strain(lattice.spring_table, k, eta_x, eta_y))


@njit(**INNER)
def soften_and_break_bonds(lattice, zone, u, first_node, count, step):  # type: ignore[no-untyped-def]
    """Soften and remove bonds of some nodes of a row, add the pulls that match their work to the forces f, and book the
    energy they dissipated.

    Half of a bond's energy is booked at each of its ends.
    """
    fine, half, row = zone.fine, len(lattice.neighbour_offsets) // 2, first_node // ROW
    if not fine.has_extra_forces[row]:
        fine.f[0, first_node : first_node + count] = fine.f[1, first_node : first_node + count] = 0.0
    for p in range(first_node, first_node + count):
        for k in range(2 * half):
            entry, j, lane = fine.stiffness_index_of_row[row], p + lattice.neighbour_offsets[k], p % ROW
            full_stiffness = fine.row_stiffness[entry, k, lane] if entry >= 0 else lattice.spring_table[k, 5]
            if full_stiffness == 0 or is_unbreakable(lattice, p) or is_unbreakable(lattice, j):
                continue
            x, y = lattice.spring_table[k, 0], lattice.spring_table[k, 1]
            eta_x, eta_y = displaced(u, fine.negative_half_swelling, x, y, p, j)
            e = spring_double_green_strain(lattice.spring_table, k, eta_x, eta_y)
            peak, limit = peak_and_limit_strain(lattice, p, k)
            first = strain_of_first_change(lattice, peak, limit)
            if e <= first or (
                lattice.softens_or_limits_vary and entry >= 0 and e <= fine.threshold_strain[entry, k, lane]
            ):
                continue
            _mark_damaged_node(zone, p)
            entry = find_or_reserve_stiffness_index(fine.stiffness_index_of_row, zone.counts, row)
            fine.stiffness_index_of_row[row] = entry
            full_stiffness, past = _unsoftened_stiffness_and_history(
                fine, zone.history, entry, k, lane, full_stiffness, first, limit
            )
            if first < limit:
                _soften_bond(zone.history, lattice, zone, p, entry, k, e, (peak, limit))
            before = _previous_stretch(lattice, fine, p, j, k, eta_x, eta_y)
            now, worst = stretch_from_double_green_strain(e), stretch_from_double_green_strain(past)
            ends = stretch_from_double_green_strain(peak), stretch_from_double_green_strain(limit)
            breaking_force = added_force(lattice.empty_law_columns, now, before, worst, *ends) * full_stiffness
            fine.f[0, p] += breaking_force / (1 + now) * (x + eta_x)
            fine.f[1, p] += breaking_force / (1 + now) * (y + eta_y)
            if e <= limit:
                continue
            fine.row_stiffness[entry, k, lane] = 0.0
            fine.spring_lane_masks[entry, 0, k] &= ~(1 << lane)
            if k < half:
                zone.broken_bond_bits[p] |= np.uint64(1) << np.uint64(k)
            if first == limit:  # else it is booked as it softens
                scale = full_stiffness / lattice.spring_table[k, 4] / 4
                energy = broken_energy(lattice.empty_law_columns, scale, now, before, *ends)
                _record_node_dissipation(zone, p, energy)
            _record_break(zone, step, p, k, breaking_force, now - before)


@njit(**INNER)
def add_second_release_forces(lattice, zone, u, step):  # type: ignore[no-untyped-def]
    """Add the second pulls of the bonds that broke one step ago to the forces f, which have all others."""
    fine, breaks, n = zone.fine, zone.break_events, zone.counts.broken_bonds
    while n > 0 and breaks.step[n - 1] == step:
        n -= 1
    while n > 0 and breaks.step[n - 1] == step - 1:
        n -= 1
        p, k = breaks.node[n], breaks.bond_number[n]
        j, x, y = p + lattice.neighbour_offsets[k], lattice.spring_table[k, 0], lattice.spring_table[k, 1]
        eta_x, eta_y = displaced(u, fine.negative_half_swelling, x, y, p, j)
        now = stretch_from_double_green_strain(spring_double_green_strain(lattice.spring_table, k, eta_x, eta_y))
        stretch_growth = now - _previous_stretch(lattice, fine, p, j, k, eta_x, eta_y)
        breaking_force = (
            breaks.force_at_break[n] * second_share(breaks.stretch_growth_at_break[n], stretch_growth) / (1 + now)
        )
        fine.f[0, p] += breaking_force * (x + eta_x)
        fine.f[1, p] += breaking_force * (y + eta_y)
