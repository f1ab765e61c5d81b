"""Velocity Verlet: thesis, eq. 15 to 17. Explicit, second order, the time loop inside compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from pdsolve.bonds import Bonds
from pdsolve.kernels.bond_sums import force_on


@njit(cache=True)
def advance(bonds, motion, force, rho, dt, first, last):  # type: ignore[no-untyped-def]
    """Take the steps `first` to `last` - 1, of size `dt` (s), in place.

    `force` (n, 2) is the body force, N/m^3, and `rho` the density, kg/m^3.
    """
    for step in range(first, last):
        _drift(motion, force, dt)
        _accelerate(bonds, motion, force, rho, dt, step)
        _kick(motion, dt)


# A parallel loop only calls a function of its row, and no function holds two such loops: numba drops updates in
# place of a tuple's arrays and merges sweeps that must follow each other, without a word.


@njit(parallel=True, cache=True)
def _drift(motion, force, dt):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _drift_node(motion, force, dt, i)


@njit
def _drift_node(motion, force, dt, i):  # type: ignore[no-untyped-def]
    for axis in range(2):
        motion.v[i, axis] += dt / 2 * motion.a[i, axis]
        way = dt * motion.v[i, axis]
        motion.u[i, axis] += way
        motion.work[i] += force[i, axis] * way


@njit(parallel=True, cache=True)
def _accelerate(bonds, motion, force, rho, dt, step):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _accelerate_node(bonds, motion, force, rho, dt, step, i)


@njit
def _accelerate_node(bonds, motion, force, rho, dt, step, i):  # type: ignore[no-untyped-def]
    force_x, force_y = force_on(bonds, motion, i, step, dt)
    motion.a[i, 0] = (force_x + force[i, 0]) / rho
    motion.a[i, 1] = (force_y + force[i, 1]) / rho


@njit(parallel=True, cache=True)
def _kick(motion, dt):  # type: ignore[no-untyped-def]
    for i in prange(len(motion.u)):
        _kick_node(motion, dt, i)


@njit
def _kick_node(motion, dt, i):  # type: ignore[no-untyped-def]
    for axis in range(2):
        motion.v[i, axis] += dt / 2 * motion.a[i, axis]


def stability_bound(bonds: Bonds, rho: float) -> float:
    """Largest step that is surely stable, s: sqrt(2 rho / max_i sum_j stiffness / |xi|); infinite without bonds.

    S. A. Silling, E. Askari, Comput. Struct. 83 (2005) 1526-1535, for the bonds as they are. The true limit is
    1.5 to 1.7 times as large on square lattices.
    """
    per_bond = bonds.stiffness / np.hypot(bonds.xi[:, 0], bonds.xi[:, 1])
    sums = np.bincount(np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start)), per_bond)
    stiffest = float(sums.max(initial=0.0))
    return float(np.sqrt(2 * rho / stiffest)) if stiffest > 0 else float("inf")
