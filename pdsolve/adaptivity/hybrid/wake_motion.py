"""Velocities of coarse nodes that were fine: as means they are those of a smoothed motion, which is undone.

Momentum stays to round-off, and kinetic energy: what short waves of fine nodes had, the shortest of coarse nodes take.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.hybrid.arrays import NEW
from pdsolve.adaptivity.hybrid.crack_faces import joined_to, share
from pdsolve.adaptivity.hybrid.energy import kinetic
from pdsolve.adaptivity.hybrid.lattice import (
    COARSE,
    FINE,
    FREE,
    cell_column,
    cell_row,
    coarse_place,
    fine_column,
    fine_place,
    fine_row,
)
from pdsolve.adaptivity.hybrid.node_rows import of_node
from pdsolve.adaptivity.hybrid.nodes import touches
from pdsolve.operators.simd_lattice.kernel import INNER

SHARP = (
    0.5  # of what a mean lacks besides its own mean: then waves of wave number k lose no energy to the order (k h)^2
)
MOST = 4.0  # of what is rough twice, which has the order (k h)^4


@njit(**INNER)
def kinetic_of(zone, dirty, around):  # type: ignore[no-untyped-def]
    """Kinetic energy of these fine and coarse nodes, J/m."""
    found = 0.0
    for nodes, places in ((zone.fine, dirty), (zone.coarse, around)):
        for p in places:
            if nodes.kind[p] == FREE:
                found += kinetic(nodes, p)
    return found


@njit(**INNER)
def sharpen(ground, zone, dirty, around, now, before):  # type: ignore[no-untyped-def]
    """Give the nodes around the cells that have become coarse the kinetic energy `before`, J/m, if they have less.

    Overwrites forces, and displacements of the next step.
    """
    coarse = zone.coarse
    v, one, two = coarse.v, coarse.f, coarse.u[1 - now]
    _rough(ground, zone, around, v, one)
    _add(v, one, SHARP, around)
    _rough(ground, zone, around, v, one)
    _rough(ground, zone, around, one, two)
    lacks, both, square = before - kinetic_of(zone, dirty, around), 0.0, 0.0
    for axis in range(2):
        for q in around:
            both += coarse.mass[q] * two[axis, q] * v[axis, q]
            square += coarse.mass[q] * two[axis, q] ** 2
    if lacks > 0 and square > 0:
        _add(v, two, min((np.sqrt(both**2 + 2 * square * lacks) - both) / square, MOST), around)


@njit(**INNER)
def _add(v, other, times, around):  # type: ignore[no-untyped-def]
    """Add `times` other values (2, q) to those of the nodes around."""
    for axis in range(2):
        for q in around:
            v[axis, q] += times * other[axis, q]


@njit(**INNER)
def _rough(ground, zone, around, v, out):  # type: ignore[no-untyped-def]
    """Set out (2, q) to how far v (2, q) is from the means of its interpolation in listed cells; its momentum is 0."""
    at, light = ground.at, zone.coarse.light
    for q in around:
        out[0, q] = out[1, q] = 0.0
    for c in zone.new[: zone.number[NEW]]:
        x, y = cell_column(at, c), cell_row(at, c)
        for n in range(9):
            mass = of_quarters(ground, zone.cells, x, y, n)
            joined = joined_to(ground, zone.lost, x, y, n)
            for axis in range(2):
                mean = 0.0
                for corner in range(4):
                    q = coarse_place(at, x + corner % 2, y + corner // 2)
                    mean += share(joined, n, corner) * v[axis, q]
                for corner in range(4):
                    q = coarse_place(at, x + corner % 2, y + corner // 2)
                    out[axis, q] += share(joined, n, corner) * mass * (v[axis, q] - mean)
    for q in around:
        out[0, q] *= light[q]
        out[1, q] *= light[q]


@njit(**INNER)
def of_quarters(ground, cells, x, y, n):  # type: ignore[no-untyped-def]
    """Mass that node n (3 y + x) of a cell has in it."""
    p = fine_place(ground.at, 2 * x + n % 3, 2 * y + n // 3)
    return (1 + n % 3 % 2) * (1 + n // 3 % 2) * quarter(ground, cells, p)


@njit(**INNER)
def quarter(ground, cells, p):  # type: ignore[no-untyped-def]
    """Mass of a fine node in each square around it."""
    ix, iy = fine_column(ground.at, p), fine_row(ground.at, p)
    squares = touches(ground.at, cells, ix, iy, FINE) + touches(ground.at, cells, ix, iy, COARSE)
    return of_node(ground.nodes, ground.nodes.mass, p) / squares
