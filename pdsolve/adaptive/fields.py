"""What the whole fine lattice would show: free nodes as they are, all others between the coarse nodes around them."""

from __future__ import annotations

from numba import njit

from pdsolve.adaptive.arrays import COARSE_ROWS
from pdsolve.adaptive.energy import coarse_held, fine_held
from pdsolve.adaptive.lattice import FREE, fine_column, fine_row, share
from pdsolve.adaptive.nodes import coarse_cell_at, interpolate
from pdsolve.operators.blocks.kernel import INNER
from pdsolve.operators.blocks.lanes import ROW


@njit(cache=True, error_model="numpy")
def show(ground, zone, now, place, scratch, value, rate, second, held):  # type: ignore[no-untyped-def]
    """Displacements, velocities and accelerations (n, 2) and densities of held energy (n,) of the fine places (n,).

    `scratch` (2, q) is for coarse nodes.
    """
    fine, coarse = zone.fine, zone.coarse
    _accelerations(zone, scratch)
    for n in range(len(place)):
        _take(ground, zone, fine.u[now], coarse.u[now], place[n], value[n], zone.s)
        _take(ground, zone, fine.v, coarse.v, place[n], rate[n], zone.s)
        _take(ground, zone, fine.f, scratch, place[n], second[n], zone.s)
        if fine.kind[place[n]] == FREE:
            for axis in range(2):
                second[n, axis] *= fine.light[place[n]]
    _densities(ground, zone, now, scratch)
    for n in range(len(place)):
        p = place[n]
        ix, iy = fine_column(ground.at, p), fine_row(ground.at, p)
        if fine.kind[p] == FREE:
            held[n] = fine_held(ground, fine, fine.u[now], p) / (share(ground.at, ix, iy) * ground.h**2)
        else:
            x, y = coarse_cell_at(ground.at, zone.cells, ix, iy)
            interpolate(ground, coarse.kind, scratch, ix, iy, x, y, zone.s)
            held[n] = zone.s[0]


@njit(**INNER)
def _accelerations(zone, out):  # type: ignore[no-untyped-def]
    coarse = zone.coarse
    for n in range(zone.number[COARSE_ROWS]):
        row = coarse.rows[n]
        for q in range(row * ROW, row * ROW + ROW):
            for axis in range(2):
                out[axis, q] = coarse.f[axis, q] * coarse.light[q]


@njit(**INNER)
def _densities(ground, zone, now, out):  # type: ignore[no-untyped-def]
    coarse = zone.coarse
    for n in range(zone.number[COARSE_ROWS]):
        row = coarse.rows[n]
        for q in range(row * ROW, row * ROW + ROW):
            area = coarse.mass[q] / ground.cell_mass * ground.h**2
            out[0, q] = coarse_held(ground, coarse, coarse.u[now], q) / area if coarse.kind[q] == FREE else 0.0
            out[1, q] = 0.0


@njit(**INNER)
def _take(ground, zone, fine, coarse, p, out, two):  # type: ignore[no-untyped-def]
    ix, iy = fine_column(ground.at, p), fine_row(ground.at, p)
    if zone.fine.kind[p] == FREE:
        out[0], out[1] = fine[0, p], fine[1, p]
        return
    x, y = coarse_cell_at(ground.at, zone.cells, ix, iy)
    interpolate(ground, zone.coarse.kind, coarse, ix, iy, x, y, two)
    out[0], out[1] = two[0], two[1]
