"""Softening and breaking of the bonds of fine nodes."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.clipped_bonds import own_entry, share_of, stretch_of
from pdsolve.adaptivity.hybrid.energy import strain_e
from pdsolve.adaptivity.hybrid.precracks import lasts, peak_and_limit
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.calls import added_force, broken_energy, second_share
from pdsolve.laws.pair_laws.bilinear import dissipated_share
from pdsolve.operators.simd_lattice.kernel import INNER, displaced


@njit(forceinline=True, **INNER)
def _book(zone, p, energy):  # type: ignore[no-untyped-def]
    """Book an energy, J/m, dissipated by a bond of node p."""
    zone.totals.dissipated += energy
    zone.spent[p] += energy


@njit(**INNER)
def _soften_on(ground, zone, p, entry, k, e, peak, limit):  # type: ignore[no-untyped-def]
    """Soften a bond stretched further than ever before, to e, and book the dissipated energy."""
    row_stiffness, edge, lane = zone.fine.own, zone.fine.edge, p % ROW
    past, now = edge[entry, k, lane], min(e, limit)
    peak_stretch, limit_stretch = stretch_of(peak), stretch_of(limit)
    full_stiffness = row_stiffness[entry, k, lane] / share_of(past, peak, limit)
    spent = dissipated_share(stretch_of(now), peak_stretch, limit_stretch)
    spent -= dissipated_share(stretch_of(max(past, peak)), peak_stretch, limit_stretch)
    _book(zone, p, full_stiffness / ground.table[k, 4] * peak_stretch * limit_stretch * spent / 4)
    row_stiffness[entry, k, lane] = full_stiffness * share_of(now, peak, limit)
    edge[entry, k, lane] = now


@njit(**INNER)
def _stir(zone, p):  # type: ignore[no-untyped-def]
    """Mark a node as having a softened or broken bond."""
    if not zone.stirred[p]:
        zone.stirred[p] = True
        zone.stirs[zone.counts.stirred_nodes] = p
        zone.counts.stirred_nodes += 1


@njit(**INNER)
def _note(zone, step, p, k, pull, growth):  # type: ignore[no-untyped-def]
    """Record a bond that breaks with a `pull` after some `growth` of its stretch."""
    n = zone.counts.broken_bonds
    zone.breaks.step[n], zone.breaks.node[n], zone.breaks.spring[n] = step, p, k
    zone.breaks.pull[n], zone.breaks.growth[n] = pull, growth
    zone.counts.broken_bonds += 1


@njit(**INNER)
def _own_row(zone, row):  # type: ignore[no-untyped-def]
    """Index of a row's own stiffnesses, which it gets if it has none."""
    if zone.fine.entry[row] < 0:
        zone.fine.entry[row] = own_entry(zone.fine.entry, zone.counts, row)
    return zone.fine.entry[row]


@njit(**INNER)
def _whole_and_edge(fine, entry, k, lane, stiffness, peak, limit):  # type: ignore[no-untyped-def]
    """Stiffness of a bond before it softened, and the largest e it has had above the peak, 0 if it was never there."""
    if peak == limit or fine.edge[entry, k, lane] <= peak:
        return stiffness, 0.0
    return stiffness / share_of(fine.edge[entry, k, lane], peak, limit), fine.edge[entry, k, lane]


@njit(**INNER)
def _stretch_before(ground, fine, p, j, k, eta_x, eta_y):  # type: ignore[no-untyped-def]
    """The stretch one step ago of bond k from p to j, whose ends are (eta_x, eta_y) further apart now, m."""
    eta_x -= ground.dt * (fine.v[0, j] - fine.v[0, p])
    eta_y -= ground.dt * (fine.v[1, j] - fine.v[1, p])
    return stretch_of(strain_e(ground.table, k, eta_x, eta_y))


@njit(**INNER)
def break_bonds(ground, zone, u, p0, count, step):  # type: ignore[no-untyped-def]
    """Soften and remove bonds of some nodes of a row, add the pulls that match their work to the forces f, and book the
    energy they dissipated.

    Half of a bond's energy is booked at each of its ends.
    """
    fine, half, row = zone.fine, len(ground.ways) // 2, p0 // ROW
    if not fine.touched[row]:
        fine.f[0, p0 : p0 + count] = fine.f[1, p0 : p0 + count] = 0.0
    for p in range(p0, p0 + count):
        for k in range(2 * half):
            entry, j, lane = fine.entry[row], p + ground.ways[k], p % ROW
            full_stiffness = fine.own[entry, k, lane] if entry >= 0 else ground.table[k, 5]
            if full_stiffness == 0 or lasts(ground, p) or lasts(ground, j):
                continue
            eta_x, eta_y = displaced(u, fine.shrink, ground.table[k, 0], ground.table[k, 1], p, j)
            e = strain_e(ground.table, k, eta_x, eta_y)
            peak, limit = peak_and_limit(ground, p, k)
            if e <= peak or (ground.varied and entry >= 0 and e <= fine.edge[entry, k, lane]):
                continue
            _stir(zone, p)
            entry = _own_row(zone, row)
            full_stiffness, past = _whole_and_edge(fine, entry, k, lane, full_stiffness, peak, limit)
            if peak < limit:
                _soften_on(ground, zone, p, entry, k, e, peak, limit)
            before, now = _stretch_before(ground, fine, p, j, k, eta_x, eta_y), stretch_of(e)
            worst, ends = stretch_of(past), (stretch_of(peak), stretch_of(limit))
            pull = added_force(ground.law, now, before, worst, *ends) * full_stiffness
            fine.f[0, p] += pull / (1 + now) * (ground.table[k, 0] + eta_x)
            fine.f[1, p] += pull / (1 + now) * (ground.table[k, 1] + eta_y)
            if e <= limit:
                continue
            fine.own[entry, k, lane] = 0.0
            fine.masks[entry, 0, k] &= ~(1 << lane)
            if k < half:
                zone.lost[p] |= np.uint64(1) << np.uint64(k)
            if peak == limit:  # else it is booked as it softens
                _book(zone, p, broken_energy(ground.law, full_stiffness / ground.table[k, 4] / 4, now, before, *ends))
            _note(zone, step, p, k, pull, now - before)


@njit(**INNER)
def pull_again(ground, zone, u, step):  # type: ignore[no-untyped-def]
    """Add the second pulls of the bonds that broke one step ago to the forces f, which have all others."""
    fine, breaks, n = zone.fine, zone.breaks, zone.counts.broken_bonds
    while n > 0 and breaks.step[n - 1] == step:
        n -= 1
    while n > 0 and breaks.step[n - 1] == step - 1:
        n -= 1
        p, k = breaks.node[n], breaks.spring[n]
        j, x, y = p + ground.ways[k], ground.table[k, 0], ground.table[k, 1]
        eta_x, eta_y = displaced(u, fine.shrink, x, y, p, j)
        now = stretch_of(strain_e(ground.table, k, eta_x, eta_y))
        growth = now - _stretch_before(ground, fine, p, j, k, eta_x, eta_y)
        pull = breaks.pull[n] * second_share(breaks.growth[n], growth) / (1 + now)
        fine.f[0, p] += pull * (x + eta_x)
        fine.f[1, p] += pull * (y + eta_y)
