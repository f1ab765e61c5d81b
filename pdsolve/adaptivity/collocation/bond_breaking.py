"""Bonds of fine nodes that break: at both of their ends at once."""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.collocation.layout import is_bond_cut, mark_bond_cut
from pdsolve.adaptivity.collocation.row_stiffness import UNCORRECTED, WHOLE, bond_stiffness
from pdsolve.adaptivity.collocation.zone import FINE
from pdsolve.adaptivity.hybrid.clipped_bonds import stretch_from_double_green_strain
from pdsolve.adaptivity.hybrid.energy import spring_double_green_strain
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.calls import added_force, broken_energy, second_share


@njit(**INNER)
def break_bonds_of_row(lattice, zone, step, dt, row):  # type: ignore[no-untyped-def]
    """Break the bonds of a row over their limit, and book their energy."""
    for p in range(row * ROW, row * ROW + ROW):
        if zone.node_kinds[p] != FINE or lattice.no_fail[p]:
            continue
        for k in range(len(lattice.neighbour_offsets)):
            if _double_green_strain(lattice, zone.u, p, k) > lattice.limit_double_green_strain and not (
                is_bond_cut(zone.cut_bond_bits, p, k) or lattice.no_fail[p + lattice.neighbour_offsets[k]]
            ):
                _break_bond_and_record_energy(lattice, zone, step, dt, p, k)


@njit(**INNER)
def add_release_forces_of_broken_bonds(lattice, zone, step, dt):  # type: ignore[no-untyped-def]
    """Let the bonds that broke in this step pull once, and those of the last step a second time."""
    breaks, n = zone.break_events, zone.counts.broken_bonds
    while n > 0 and breaks.step[n - 1] >= step - 1:
        n -= 1
        p, k = breaks.node[n], breaks.bond_number[n]
        stretch, before = _stretch(lattice, zone, p, k), _previous_stretch(lattice, zone, dt, p, k)
        share = 1.0 if breaks.step[n] == step else second_share(breaks.stretch_growth_at_break[n], stretch - before)
        _add_force_of_broken_bond(lattice, zone, p, k, breaks.force_at_break[n] * share / (1 + stretch))


@njit(**INNER)
def _double_green_strain(lattice, u, p, k):  # type: ignore[no-untyped-def]
    """e of bond k of node p."""
    j = p + lattice.neighbour_offsets[k]
    return spring_double_green_strain(lattice.spring_table, k, u[0, j] - u[0, p], u[1, j] - u[1, p])


@njit(**INNER)
def _stretch(lattice, zone, p, k):  # type: ignore[no-untyped-def]
    """The stretch of bond k of node p."""
    return stretch_from_double_green_strain(_double_green_strain(lattice, zone.u, p, k))


@njit(**INNER)
def _previous_stretch(lattice, zone, dt, p, k):  # type: ignore[no-untyped-def]
    """The stretch of bond k of node p a time step `dt` ago."""
    j, u, v = p + lattice.neighbour_offsets[k], zone.u, zone.v
    x, y = u[0, j] - dt * v[0, j] - (u[0, p] - dt * v[0, p]), u[1, j] - dt * v[1, j] - (u[1, p] - dt * v[1, p])
    return stretch_from_double_green_strain(spring_double_green_strain(lattice.spring_table, k, x, y))


@njit(**INNER)
def _neighbour_and_reverse_bond(lattice, p, k):  # type: ignore[no-untyped-def]
    """The neighbour at the other end of bond k of node p, and the bond's number there."""
    half = len(lattice.neighbour_offsets) // 2
    return p + lattice.neighbour_offsets[k], k + half if k < half else k - half


@njit(**INNER)
def _add_force_of_broken_bond(lattice, zone, p, k, breaking_force):  # type: ignore[no-untyped-def]
    """Add a pull of bond k of node p, which has broken, to the forces on both its ends."""
    j, back = _neighbour_and_reverse_bond(lattice, p, k)
    for axis in range(2):
        along = breaking_force * (lattice.spring_table[k, axis] + zone.u[axis, j] - zone.u[axis, p])
        zone.f[axis, p] += bond_stiffness(lattice, p, k) * along
        zone.f[axis, j] -= bond_stiffness(lattice, j, back) * along


@njit(**INNER)
def _break_bond_and_record_energy(lattice, zone, step, dt, p, k):  # type: ignore[no-untyped-def]
    """Break bond k of node p, and book the energy it has dissipated."""
    (j, back), breaks, count = _neighbour_and_reverse_bond(lattice, p, k), zone.break_events, zone.counts.broken_bonds
    stretch, before = _stretch(lattice, zone, p, k), _previous_stretch(lattice, zone, dt, p, k)
    limit = stretch_from_double_green_strain(lattice.limit_double_green_strain)
    area = lattice.cell_area_share[0, p] * lattice.spacing**2
    spring = bond_stiffness(lattice, p, k) * area / lattice.spring_table[k, 4]
    energy = broken_energy(lattice.empty_law_columns, spring / 4, stretch, before, limit, limit)
    zone.totals.dissipated_energy += 2 * energy
    for node in (p, j) if zone.node_kinds[j] == FINE else (p, p):
        zone.node_dissipation[node] += energy
    cut_bond(lattice, zone, p, k)
    zone.has_bond_over_limit[j // ROW] = True  # by round-off it could have none
    breaks.step[count] = step
    breaks.node[count], breaks.bond_number[count] = (p, k) if k < back else (j, back)
    breaks.force_at_break[count] = added_force(lattice.empty_law_columns, stretch, before, 0.0, limit, limit)
    breaks.stretch_growth_at_break[count] = stretch - before
    zone.counts.broken_bonds += 1
    if zone.node_kinds[j] != FINE:
        zone.counts.refinement_due = 1
        zone.is_to_refine[j] = True


@njit(**INNER)
def cut_bond(lattice, zone, p, k):  # type: ignore[no-untyped-def]
    """Cut bond k of node p at both of its ends."""
    for node, number in ((p, k), _neighbour_and_reverse_bond(lattice, p, k)):
        mark_bond_cut(zone.cut_bond_bits, node, number)
        if zone.stiffness_index_of_row[node // ROW] == WHOLE:
            zone.stiffness_index_of_row[node // ROW] = UNCORRECTED
