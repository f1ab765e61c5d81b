"""Forces on all nodes that move: those of loads, of clipped bonds, of fine rows and of coarse rows.

Rows are kicked and drifted on at once, as the displacements of two steps are kept in turn. Forces on border nodes go to
the coarse nodes they move with, before these are moved.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptive.arrays import (
    AXIS,
    BORDERS,
    BREAKS,
    CLIPPED,
    COARSE_ROWS,
    DISSIPATED,
    LARGEST,
    LOADS,
    PIECES,
    PROFILE,
    ROWS,
    STIRS,
    VALUE,
    WORK,
)
from pdsolve.adaptive.clip import own_entry, share_of, stretch_of
from pdsolve.adaptive.energy import place_of, strain_e
from pdsolve.adaptive.precracks import peak_and_limit
from pdsolve.adaptive.rows import (
    sum_edges,
    sum_edges_wide,
    sum_green,
    sum_green_own,
    sum_own,
    sum_own_wide,
    sum_whole,
    sum_whole_wide,
)
from pdsolve.conditions import factor_at
from pdsolve.laws.bilinear import spent_share
from pdsolve.operators.blocks.kernel import INNER, across
from pdsolve.operators.blocks.lanes import ROW
from pdsolve.operators.blocks.vectors import kick_and_drift


@njit(forceinline=True, **INNER)
def _clipped(zone, u, uc, f, fc):  # type: ignore[no-untyped-def]
    """Add the forces of clipped bonds; returns the largest e of those that could break."""
    pieces, largest = zone.pieces, 0.0
    end, value = pieces.end, pieces.value
    for n in range(zone.number[PIECES]):
        eta_x = place_of(u, uc, pieces, n, 1, 0) - place_of(u, uc, pieces, n, 0, 0)
        eta_y = place_of(u, uc, pieces, n, 1, 1) - place_of(u, uc, pieces, n, 0, 1)
        x, y = value[n, 2], value[n, 3]
        e = value[n, 4] * (2 * (x * eta_x + y * eta_y) + eta_x * eta_x + eta_y * eta_y)
        largest = max(largest, e * value[n, 6])
        pull = value[n, 5] * e / 2
        px, py = pull * (x + eta_x), pull * (y + eta_y)
        for which, sign in ((0, 1.0), (1, -1.0)):
            a, b, w = end[n, 2 * which], end[n, 2 * which + 1], value[n, which]
            if b < 0:
                f[0, a] += sign * px
                f[1, a] += sign * py
            else:
                fc[0, a] += (1 - w) * sign * px
                fc[1, a] += (1 - w) * sign * py
                fc[0, b] += w * sign * px
                fc[1, b] += w * sign * py
    return largest


@njit(**INNER)
def _sum_far(ground, fine, u, row, lane0, count, s):  # type: ignore[no-untyped-def]
    """Forces on lanes one by one, whatever the stretch."""
    entry = fine.entry[row]
    for lane in range(lane0, lane0 + count):
        p, fx, fy = row * ROW + lane, 0.0, 0.0
        for k in range(len(ground.ways)):
            pull = fine.own[entry, k, lane] if entry >= 0 else ground.table[k, 5]
            if pull == 0:
                continue
            j = p + ground.ways[k]
            eta_x, eta_y = u[0, j] - u[0, p], u[1, j] - u[1, p]
            e = strain_e(ground.table, k, eta_x, eta_y)
            pull *= e / (1 + e + np.sqrt(1 + e))
            fx += pull * (ground.table[k, 0] + eta_x)
            fy += pull * (ground.table[k, 1] + eta_y)
        s[lane - lane0], s[ROW + lane - lane0] = fx, fy


@njit(**INNER)
def _soften_on(ground, zone, entry, k, lane, e, peak, limit):  # type: ignore[no-untyped-def]
    """Soften a bond that is stretched to e, further than ever, and book what it spends."""
    own, edge = zone.fine.own, zone.fine.edge
    past, now = edge[entry, k, lane], min(e, limit)
    peak_stretch, limit_stretch = stretch_of(peak), stretch_of(limit)
    whole = own[entry, k, lane] / share_of(past, peak, limit)
    spent = spent_share(stretch_of(now), peak_stretch, limit_stretch)
    spent -= spent_share(stretch_of(max(past, peak)), peak_stretch, limit_stretch)
    zone.total[DISSIPATED] += whole / ground.table[k, 4] * peak_stretch * limit_stretch * spent / 4
    own[entry, k, lane] = whole * share_of(now, peak, limit)
    edge[entry, k, lane] = now


@njit(**INNER)
def _stir(zone, p):  # type: ignore[no-untyped-def]
    """Note a node one of whose bonds has softened or broken."""
    if not zone.stirred[p]:
        zone.stirred[p] = True
        zone.stirs[zone.number[STIRS]] = p
        zone.number[STIRS] += 1


@njit(**INNER)
def _note(zone, step, p, k):  # type: ignore[no-untyped-def]
    """Note a bond that breaks."""
    n = zone.number[BREAKS]
    zone.breaks.step[n], zone.breaks.node[n], zone.breaks.spring[n] = step, p, k
    zone.number[BREAKS] += 1


@njit(forceinline=True, **INNER)
def _ends(p, j, lane0, count):  # type: ignore[no-untyped-def]
    """For how many of its two ends what a bond spends is booked at node p: velocities of lanes before are new ones."""
    first = p // ROW * ROW + lane0
    return (j >= first) + (j >= first + count)


@njit(**INNER)
def _break(ground, zone, u, row, lane0, count, step):  # type: ignore[no-untyped-def]
    """Take out the bonds of some lanes that are over their limit, and book what they spent; returns whether any was."""
    fine, half, some = zone.fine, len(ground.ways) // 2, False
    for lane in range(lane0, lane0 + count):
        p = row * ROW + lane
        for k in range(2 * half):
            entry, j = fine.entry[row], p + ground.ways[k]
            stiffness = fine.own[entry, k, lane] if entry >= 0 else ground.table[k, 5]
            if stiffness == 0 or ground.lasting[p] or ground.lasting[j]:
                continue
            eta_x, eta_y = u[0, j] - u[0, p], u[1, j] - u[1, p]
            e = strain_e(ground.table, k, eta_x, eta_y)
            peak, limit = peak_and_limit(ground, p, k)
            if e <= peak or (ground.varied and entry >= 0 and e <= fine.edge[entry, k, lane]):
                continue
            some = True
            _stir(zone, p)
            if entry < 0:
                entry = own_entry(fine.entry, zone.number, row)
                fine.entry[row] = entry
            if peak < limit:
                _soften_on(ground, zone, entry, k, lane, e, peak, limit)
                if e <= limit:
                    continue
            fine.own[entry, k, lane] = 0.0
            if k < half:
                zone.bits[p] &= ~(np.uint64(1) << np.uint64(k))
            if peak == limit:
                eta_x -= ground.dt * (fine.v[0, j] - fine.v[0, p])
                eta_y -= ground.dt * (fine.v[1, j] - fine.v[1, p])
                spent = stretch_of(e) * stretch_of(strain_e(ground.table, k, eta_x, eta_y))
                zone.total[DISSIPATED] += _ends(p, j, lane0, count) * stiffness / ground.table[k, 4] * spent / 4
            _note(zone, step, p, k)
    return some


@njit(forceinline=True, **INNER)
def _sum_wide(ground, fine, u, entry, at, p, s):  # type: ignore[no-untyped-def]
    """Forces on some lanes, |e| up to WIDE."""
    table, ways, slots = ground.table, ground.ways, len(ground.ways)
    if entry < 0:
        return sum_whole_wide(u, table, ways, fine.own, slots, at, p, ground.least[0], s)
    if ground.varied:
        return sum_edges_wide(u, table, ways, fine.own, fine.edge, slots, at, p, 0.0, s)
    return sum_own_wide(u, table, ways, fine.own, slots, at, p, ground.least[0], s)


@njit(forceinline=True, **INNER)
def _sum_row(ground, zone, u, row, lane, step, s):  # type: ignore[no-untyped-def]
    """Forces on some lanes of a fine row, from `lane` on."""
    fine, p, slots, entry = zone.fine, row * ROW + lane, len(ground.ways), zone.fine.entry[row]
    table, ways, own, limit = ground.table, ground.ways, fine.own, ground.least[0]
    at, found = entry * slots * ROW + lane, 1
    if fine.wide[row] == 0:
        if entry < 0:
            found = sum_whole(u, table, ways, own, slots, at, p, limit, s)
        elif ground.varied:
            found = sum_edges(u, table, ways, own, fine.edge, slots, at, p, 0.0, s)
        else:
            found = sum_own(u, table, ways, own, slots, at, p, limit, s)
    if found & 1:
        fine.wide[row] = 1
        found = _sum_wide(ground, fine, u, entry, at, p, s)
    if found > 0:
        if found & 2:
            _break(ground, zone, u, row, lane, across(s), step)
        entry = fine.entry[row]
        at = entry * slots * ROW + lane
        found = _sum_wide(ground, fine, u, entry, at, p, s)
        if found & 1:
            _sum_far(ground, fine, u, row, lane, across(s), s)


@njit(**INNER)
def _add_touched(f, p, count, s):  # type: ignore[no-untyped-def]
    """Put all forces together, in s and in f."""
    for k in range(count):
        s[k] += f[0, p + k]
        s[ROW + k] += f[1, p + k]
        f[0, p + k], f[1, p + k] = s[k], s[ROW + k]


@njit(**INNER)
def _keep(f, p, count, s):  # type: ignore[no-untyped-def]
    for k in range(count):
        f[0, p + k], f[1, p + k] = s[k], s[ROW + k]


@njit(**INNER)
def _sweep_fine(ground, zone, now, dt, step, ends, s):  # type: ignore[no-untyped-def]
    """Forces on all fine rows; kick and drift unless a sequence `ends`, then they are kept."""
    fine, wide = zone.fine, across(s)
    u, after = fine.u[now], fine.u[1 - now]
    for n in range(zone.number[ROWS]):
        row = fine.rows[n]
        for lane in range(0, ROW, wide):
            p = row * ROW + lane
            _sum_row(ground, zone, u, row, lane, step, s)
            if fine.touched[row]:
                _add_touched(fine.f, p, wide, s)
            elif ends:
                _keep(fine.f, p, wide, s)
            if not ends:
                kick_and_drift(u, after, fine.v, fine.light, dt, dt / 2, p, s)


@njit(**INNER)
def _sweep_coarse(ground, coarse, count, now, dt, ends, s):  # type: ignore[no-untyped-def]
    """The same for coarse rows; notes those with a hot bond."""
    wide = across(s)
    u, after = coarse.u[now], coarse.u[1 - now]
    table, ways, own, limit = ground.coarse_table, ground.coarse_ways, coarse.own, ground.least[2]
    for n in range(count):
        row, hot = coarse.rows[n], 0
        entry = coarse.entry[row]
        for lane in range(0, ROW, wide):
            q = row * ROW + lane
            if entry >= 0:
                hot |= sum_green_own(u, table, ways, own, 8, entry * 8 * ROW + lane, q, limit, s)
            else:
                hot |= sum_green(u, table, ways, own, 8, 0, q, limit, s)
            if coarse.touched[row]:
                _add_touched(coarse.f, q, wide, s)
            elif ends:
                _keep(coarse.f, q, wide, s)
            if not ends:
                kick_and_drift(u, after, coarse.v, coarse.light, dt, dt / 2, q, s)
        coarse.wide[row] = hot > 0


@njit(**INNER)
def _clear(nodes, count):  # type: ignore[no-untyped-def]
    """No forces on touched rows."""
    for n in range(count):
        row = nodes.rows[n]
        if nodes.touched[row]:
            for p in range(row * ROW, row * ROW + ROW):
                nodes.f[0, p] = nodes.f[1, p] = 0.0


@njit(**INNER)
def _pass_on(f, fc, border, count):  # type: ignore[no-untyped-def]
    """Give forces on border nodes to the coarse ones they move with."""
    for n in range(count):
        p, a, b, w = border.node[n], border.end[n, 0], border.end[n, 1], border.w[n]
        for axis in range(2):
            fc[axis, a] += (1 - w) * f[axis, p]
            fc[axis, b] += w * f[axis, p]


@njit(**INNER)
def follow(u, uc, border, count):  # type: ignore[no-untyped-def]
    """Put border nodes where the coarse ones are."""
    for n in range(count):
        p, a, b, w = border.node[n], border.end[n, 0], border.end[n, 1], border.w[n]
        for axis in range(2):
            u[axis, p] = (1 - w) * uc[axis, a] + w * uc[axis, b]


@njit(**INNER)
def _load(count, loads, fine, coarse, total, profiles, time, dt):  # type: ignore[no-untyped-def]
    """Add the loads of `time`, and the work of loads since the last step: by the mean of both times."""
    last, now, then = -1, 0.0, 0.0
    for n in range(count):
        on, e = loads.on[n, 0], loads.on[n, 1]
        axis, profile, value = loads.what[e, AXIS], loads.what[e, PROFILE], loads.part[n] * loads.value[e, VALUE]
        if profile != last:
            last = profile
            now, then = factor_at(profiles, profile, time), factor_at(profiles, profile, time - dt)
        after, before = value * now, value * then
        if on >= 0:
            fine.f[axis, on] += after
            total[WORK] += (before + after) / 2 * dt * fine.v[axis, on]
        else:
            coarse.f[axis, -1 - on] += after
            total[WORK] += (before + after) / 2 * dt * coarse.v[axis, -1 - on]


@njit(**INNER)
def forces(ground, zone, profiles, now, step, ends):  # type: ignore[no-untyped-def]
    """All forces at the displacements `now`, those of `step`; kick and drift unless the sequence `ends`."""
    fine, coarse, dt = zone.fine, zone.coarse, ground.dt
    _clear(fine, zone.number[ROWS])
    _clear(coarse, zone.number[COARSE_ROWS])
    _load(zone.number[LOADS], zone.loads, fine, coarse, zone.total, profiles, step * dt, dt if step > 0 else 0.0)
    follow(fine.u[now], coarse.u[now], zone.border, zone.number[BORDERS])
    largest = _clipped(zone, fine.u[now], coarse.u[now], fine.f, coarse.f)
    zone.total[CLIPPED] = largest
    zone.total[LARGEST] = max(zone.total[LARGEST], largest)
    _sweep_fine(ground, zone, now, dt, step, ends, zone.s)
    _pass_on(fine.f, coarse.f, zone.border, zone.number[BORDERS])
    _sweep_coarse(ground, coarse, zone.number[COARSE_ROWS], now, dt, ends, zone.s)
