"""Fine cells far behind crack tips become coarse again; what has broken cuts their springs.

The coarse nodes take the displacements of the fine nodes there, their momentum and kinetic energy. All that is new is
tried before: where it would be stretched, cells stay fine, so that no bond breaks by the change.
"""

from __future__ import annotations

from numba import njit

from pdsolve.adaptivity.hybrid.arrays import AROUND, BORDERS, DIRTY, NEW, PIECES, REFINEMENT, STIRS
from pdsolve.adaptivity.hybrid.clipped_bonds import put_pieces
from pdsolve.adaptivity.hybrid.crack_faces import joined_to, share
from pdsolve.adaptivity.hybrid.energy import energy_of, piece_e, strain_e
from pdsolve.adaptivity.hybrid.forces import follow
from pdsolve.adaptivity.hybrid.lattice import (
    COARSE,
    EMPTY,
    FINE,
    FREE,
    cell_column,
    cell_row,
    coarse_column,
    coarse_place,
    coarse_row,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.node_rows import of_node
from pdsolve.adaptivity.hybrid.nodes import border_end, set_coarse, set_fine, touches
from pdsolve.adaptivity.hybrid.precracks import lasts
from pdsolve.adaptivity.hybrid.regrid import finish, mark_dirty, mark_disc, set_nodes
from pdsolve.adaptivity.hybrid.wake_cells import is_stretched, list_cells
from pdsolve.adaptivity.hybrid.wake_motion import kinetic_of, of_quarters, quarter, sharpen
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER, displaced

TRIED = EMPTY + 1  # cells that are to be coarse, for the time being


@njit(**INNER)
def coarsen(ground, zone, now, step):  # type: ignore[no-untyped-def]
    """Make fine cells coarse that may be so at displacements `now`; momentum stays, the change of energy is booked."""
    zone.number[NEW] = list_cells(ground, zone, now, step)
    if zone.number[NEW] == 0:
        return
    mark_dirty(ground, zone)
    dirty, around = zone.dirty[: zone.number[DIRTY]], zone.around[: zone.number[AROUND]]
    follow(zone.fine.u[now], zone.coarse.u[now], zone.border, zone.number[BORDERS])
    for p in dirty:
        zone.mark[p] = True
    before = energy_of(ground, zone, now, dirty, around)
    moving = kinetic_of(zone, dirty, around)
    _lay_by(zone, dirty, around, now)
    while True:
        tried = zone.number[NEW]
        _try(ground, zone, dirty, around, now)
        failed = _look_for_failed(ground, zone, dirty, around, now)
        if failed == 0 or tried == 0:
            break
        _keep_fine(ground.at, zone, failed, ground.reach)
        _take_back(ground, zone, dirty, around, now, tried)
    sharpen(ground, zone, dirty, around, now, moving)
    for p in dirty:
        zone.mark[p] = True
    zone.total[REFINEMENT] += energy_of(ground, zone, now, dirty, around) - before
    _forget(zone)
    for p in dirty:
        zone.mark[p] = False
    finish(ground, zone)


@njit(**INNER)
def _forget(zone):  # type: ignore[no-untyped-def]
    """Forget what has broken of marked nodes, which are near the new border: they are noted again if more breaks."""
    count = 0
    for n in range(zone.number[STIRS]):
        p = zone.stirs[n]
        if zone.mark[p]:
            zone.stirred[p] = False
        else:
            zone.stirs[count] = p
            count += 1
    zone.number[STIRS] = count


@njit(**INNER)
def _lay_by(zone, dirty, around, now):  # type: ignore[no-untyped-def]
    """Lay by the motion of these nodes, where there will be that of the next step, and forces."""
    for nodes, places in ((zone.fine, dirty), (zone.coarse, around)):
        for axis in range(2):
            for p in places:
                nodes.u[1 - now, axis, p] = nodes.u[now, axis, p]
                nodes.f[axis, p] = nodes.v[axis, p]


@njit(**INNER)
def _take_back(ground, zone, dirty, around, now, tried):  # type: ignore[no-untyped-def]
    """Give these nodes the kinds, masses and motion that they had when the `tried` cells were fine."""
    fine, coarse, at = zone.fine, zone.coarse, ground.at
    for c in zone.new[:tried]:
        zone.cells[c] = FINE
    for p in dirty:
        set_fine(at, of_node(ground.nodes, ground.nodes.mass, p), zone.cells, fine, p)
    for q in around:
        set_coarse(ground, zone.cells, zone.lost, fine, coarse, q)
    for nodes, places in ((fine, dirty), (coarse, around)):
        for axis in range(2):
            for p in places:
                nodes.u[now, axis, p] = nodes.u[1 - now, axis, p]
                nodes.v[axis, p] = nodes.f[axis, p]


@njit(**INNER)
def _try(ground, zone, dirty, around, now):  # type: ignore[no-untyped-def]
    """Make the listed cells coarse. Coarse nodes take the displacement of the fine node there, and momentum."""
    at, fine, coarse = ground.at, zone.fine, zone.coarse
    _hand_over(ground, zone, dirty, around)
    for q in around:
        if coarse.kind[q] != FREE:
            p = fine_place(at, 2 * coarse_column(at, q), 2 * coarse_row(at, q))
            for axis in range(2):
                coarse.u[now, axis, q] = fine.u[now, axis, p]
    for p in dirty:
        zone.mark[p] = True
    set_nodes(ground, zone, dirty, around, now)
    put_pieces(ground, zone, dirty)
    for q in around:
        for axis in range(2):
            coarse.v[axis, q] *= coarse.light[q]


@njit(**INNER)
def _hand_over(ground, zone, dirty, around):  # type: ignore[no-untyped-def]
    """Turn the velocities of coarse nodes into the momenta that they have once the listed cells, still fine, are
    coarse."""
    at, fine, coarse, new = ground.at, zone.fine, zone.coarse, zone.new[: zone.number[NEW]]
    for q in around:
        held = coarse.mass[q] if coarse.kind[q] == FREE else 0.0
        coarse.v[0, q] *= held
        coarse.v[1, q] *= held
    for c in new:
        x, y = cell_column(at, c), cell_row(at, c)
        for n in range(9):
            p = fine_place(at, 2 * x + n % 3, 2 * y + n // 3)
            if fine.kind[p] == FREE:
                joined, mass = joined_to(ground, zone.lost, x, y, n), of_quarters(ground, zone.cells, x, y, n)
                for corner in range(4):
                    q = coarse_place(at, x + corner % 2, y + corner // 2)
                    _add(coarse.v, q, share(joined, n, corner) * mass, fine.v, p)
    for c in new:
        zone.cells[c] = COARSE
    for p in dirty:
        ix, iy = fine_column(at, p), fine_row(at, p)
        if fine.kind[p] != FREE or touches(at, zone.cells, ix, iy, COARSE) == 0:
            continue
        mass = touches(at, zone.cells, ix, iy, FINE) * quarter(ground, zone.cells, p)
        if mass > 0:
            a, b, w = border_end(ground, zone.lost, coarse.kind, p)
            w = max(w, 0.0)
            _add(coarse.v, a, (1 - w) * mass, fine.v, p)
            _add(coarse.v, b, w * mass, fine.v, p)


@njit(forceinline=True, **INNER)
def _add(momentum, q, mass, v, p):  # type: ignore[no-untyped-def]
    """Add that of a mass with the velocity of node p to the momentum of node q."""
    momentum[0, q] += mass * v[0, p]
    momentum[1, q] += mass * v[1, p]


@njit(**INNER)
def _look_for_failed(ground, zone, dirty, around, now):  # type: ignore[no-untyped-def]
    """List the fine places at which a spring, a piece or a bond of a border node is stretched; returns how many."""
    at, fine, pieces, failed, count = ground.at, zone.fine, zone.pieces, zone.failed, 0
    for q in around:
        if _is_spring_stretched(ground, zone.coarse, zone.coarse.u[now], q):
            failed[count] = fine_place(at, 2 * coarse_column(at, q), 2 * coarse_row(at, q))
            count += 1
    for p in dirty:
        zone.mark[p] = True
        if is_stretched(ground, fine, fine.u[now], p, True):
            failed[count] = p
            count += 1
    for n in range(zone.number[PIECES]):
        here = zone.mark[pieces.owner[n]] and pieces.value[n, 6] != 0
        listed = count > 0 and failed[count - 1] == pieces.owner[n]  # as pieces are ordered by their owners
        if here and not listed and piece_e(pieces, fine.u[now], zone.coarse.u[now], n) > ground.calm:
            failed[count] = pieces.owner[n]
            count += 1
    for p in dirty:
        zone.mark[p] = False
    return count


@njit(**INNER)
def _is_spring_stretched(ground, coarse, u, q):  # type: ignore[no-untyped-def]
    """Whether a spring of a coarse node is stretched beyond what is calm."""
    at, entry, table = ground.at, coarse.entry[q // ROW], ground.coarse_table
    if coarse.kind[q] != FREE or lasts(ground, fine_place(at, 2 * coarse_column(at, q), 2 * coarse_row(at, q))):
        return False
    for k in range(8):
        if entry < 0 or coarse.own[entry, k, q % ROW] > 0:
            eta_x, eta_y = displaced(u, coarse.shrink, table[k, 0], table[k, 1], q, q + ground.coarse_ways[k])
            if strain_e(table, k, eta_x, eta_y) > ground.calm:
                return True
    return False


@njit(**INNER)
def _keep_fine(at, zone, failed, reach):  # type: ignore[no-untyped-def]
    """Take the cells near `failed` places from the list; all, if there are none."""
    cells, new, tried = zone.cells, zone.new, zone.number[NEW]
    for c in new[:tried]:
        cells[c] = TRIED
    count = tried
    for n in range(failed):
        p = zone.failed[n]
        count = mark_disc(at, cells, new, count, fine_column(at, p), fine_row(at, p), reach, TRIED, FINE)
    kept = 0
    for n in range(tried):
        c = new[n]
        if cells[c] == TRIED and count > tried:
            new[kept], new[n] = c, new[kept]
            kept += 1
    zone.number[NEW] = kept
