"""The sum over a node's bonds, written once: the textbook loop over a list of neighbours.

Symbols, for the bond i -> j:
    xi      x_j - x_i, reference vector, m            eta     u_j - u_i, m
    e       (2 xi.eta + eta.eta) / xi.xi              q       sqrt(1 + e) = |xi + eta| / |xi|
    s       q - 1 = e / (q + 1), the stretch, free of cancellation for small displacements
The force density on i is stiffness * s * (xi + eta) / |xi + eta|.

A bond that breaks does so in the step whose displacements first exceed its limit; from then on it carries
nothing. Verlet takes exactly 1/2 c xi s_n s_(n+1) out of the motion at that moment (s_n of the last intact
step, s_(n+1) at detection), so that is what is booked as dissipated. A row is summed by one thread in the order
of its neighbours: the result does not depend on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pdsolve.laws.brittle import breaks


class Motion(NamedTuple):
    """Everything that changes with time; n nodes, b bonds."""

    u: NDArray[np.floating]  # (n, 2) displacement, m
    v: NDArray[np.floating]  # (n, 2) velocity, m/s; half a step behind within a step
    a: NDArray[np.floating]  # (n, 2) acceleration, m/s^2
    broken: NDArray[np.int32]  # (b,) step in which the bond broke, 0 while intact
    dissipated: NDArray[np.float64]  # (n,) spent by the node's bonds so far, J/m^3
    work: NDArray[np.float64]  # (n,) done by the body force so far, J/m^3


@njit
def deformed(bonds, u, i, k):  # type: ignore[no-untyped-def]
    """Neighbour, deformed vector and stretch of bond k of node i."""
    j = bonds.neighbour[k]
    xi_x, xi_y = bonds.xi[k, 0], bonds.xi[k, 1]
    eta_x, eta_y = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1]
    squared = xi_x * xi_x + xi_y * xi_y
    e = (2 * (xi_x * eta_x + xi_y * eta_y) + eta_x * eta_x + eta_y * eta_y) / squared
    q = np.sqrt(1 + e)
    length = np.sqrt(squared)
    return j, (xi_x + eta_x) / (length * q), (xi_y + eta_y) / (length * q), e / (q + 1), length


@njit
def force_on(bonds, motion, i, step, dt):  # type: ignore[no-untyped-def]
    """Force density (x, y), N/m^3, on node i; bonds over their limit break in this `step` of size `dt`, s.

    Within a step v is the mean velocity since the last one, so u - dt v are the displacements before it.
    """
    u, v = motion.u, motion.v
    force_x = force_y = u[i, 0] * 0
    for k in range(bonds.start[i], bonds.start[i + 1]):
        if motion.broken[k] != 0:
            continue
        j, n_x, n_y, stretch, length = deformed(bonds, u, i, k)
        if breaks(stretch, bonds.limit[k]):
            motion.broken[k] = step
            before_x = bonds.xi[k, 0] + u[j, 0] - u[i, 0] - dt * (v[j, 0] - v[i, 0])
            before_y = bonds.xi[k, 1] + u[j, 1] - u[i, 1] - dt * (v[j, 1] - v[i, 1])
            before = np.sqrt(before_x * before_x + before_y * before_y) / length - 1
            motion.dissipated[i] += bonds.stiffness[k] * length * before * stretch / 4
            continue
        pull = bonds.stiffness[k] * stretch
        force_x += pull * n_x
        force_y += pull * n_y
    return force_x, force_y


@njit(parallel=True, cache=True)
def strain_energy_density(bonds, motion, density):  # type: ignore[no-untyped-def]
    """Fill `density` (n,), J/m^3: half of each intact bond's energy belongs to the node."""
    for i in prange(len(density)):
        total = 0.0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            if motion.broken[k] == 0:
                _, _, _, stretch, length = deformed(bonds, motion.u, i, k)
                total += bonds.stiffness[k] * length * stretch * stretch / 4
        density[i] = total
