"""The sum over a node's bonds, written once: the textbook loop over a list of neighbours.

Symbols, for the bond i -> j:
    xi      x_j - x_i, reference vector, m            eta     u_j - u_i, m
    e       (2 xi.eta + eta.eta) / xi.xi              q       sqrt(1 + e) = |xi + eta| / |xi|
    s       q - 1 = e / (q + 1), the stretch, free of cancellation for small displacements
The force density on i is stiffness * share * s * (xi + eta) / |xi + eta|, share the stiffness damage has left.

A bond breaks in the step whose displacements first exceed its limit; from then on it carries nothing. Where it
breaks brittly, Verlet takes exactly c xi s_n s_(n+1) / 2 out of the motion at that moment (s_n of the last intact
step, s_(n+1) at detection), so that is what is booked as dissipated. A row is summed by one thread in the order
of its neighbours: the result does not depend on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pdsolve.laws.bilinear import intact_share, spent_share


class Motion(NamedTuple):
    """Everything that changes with time; n nodes, b bonds."""

    u: NDArray[np.floating]  # (n, 2) displacement, m
    v: NDArray[np.floating]  # (n, 2) velocity, m/s; within a step the mean velocity since the last one
    a: NDArray[np.floating]  # (n, 2) acceleration, m/s^2
    broken: NDArray[np.int32]  # (b,) step in which the bond broke, 0 while intact
    worst: NDArray[np.floating]  # (b,) largest stretch above the peak, 0 if never there; (0,) if no bond softens
    dissipated: NDArray[np.float64]  # (n,) spent by the node's broken bonds so far, J/m^3
    work: NDArray[np.float64]  # (n,) done on the node by loads and holds so far, J/m^3


@njit
def deformed(bonds, u, i, k):  # type: ignore[no-untyped-def]
    """Direction (x, y), stretch and reference length of bond k of node i."""
    j = bonds.neighbour[k]
    xi_x, xi_y = bonds.xi[k, 0], bonds.xi[k, 1]
    eta_x, eta_y = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1]
    squared = xi_x * xi_x + xi_y * xi_y
    e = (2 * (xi_x * eta_x + xi_y * eta_y) + eta_x * eta_x + eta_y * eta_y) / squared
    q = np.sqrt(1 + e)
    length = np.sqrt(squared)
    return (xi_x + eta_x) / (length * q), (xi_y + eta_y) / (length * q), e / (q + 1), length


@njit
def stretch_before(bonds, motion, i, k, dt, length):  # type: ignore[no-untyped-def]
    """Stretch of bond k of node i one step ago."""
    j, u, v = bonds.neighbour[k], motion.u, motion.v
    x = bonds.xi[k, 0] + u[j, 0] - u[i, 0] - dt * (v[j, 0] - v[i, 0])
    y = bonds.xi[k, 1] + u[j, 1] - u[i, 1] - dt * (v[j, 1] - v[i, 1])
    return np.sqrt(x * x + y * y) / length - 1


@njit
def force_on(bonds, motion, i, step, dt):  # type: ignore[no-untyped-def]
    """Force density (x, y), N/m^3, on node i; bonds over their limit break in this `step` of size `dt`, s."""
    softens = len(motion.worst) > 0
    force_x = force_y = motion.u[i, 0] * 0
    for k in range(bonds.start[i], bonds.start[i + 1]):
        if motion.broken[k] != 0:
            continue
        n_x, n_y, stretch, length = deformed(bonds, motion.u, i, k)
        pull = bonds.stiffness[k] * stretch
        if stretch > bonds.limit[k]:
            motion.broken[k] = step
            if softens and bonds.peak[k] < bonds.limit[k]:
                spent = bonds.peak[k] * bonds.limit[k]
            else:
                spent = stretch * stretch_before(bonds, motion, i, k, dt, length)
            motion.dissipated[i] += bonds.stiffness[k] * length * spent / 4
            continue
        if softens:
            if stretch > bonds.peak[k] and stretch > motion.worst[k]:
                motion.worst[k] = stretch
            if motion.worst[k] > 0:
                pull *= intact_share(motion.worst[k], bonds.peak[k], bonds.limit[k])
        force_x += pull * n_x
        force_y += pull * n_y
    return force_x, force_y


@njit(parallel=True, cache=True)
def energy_densities(bonds, motion, strain, softened):  # type: ignore[no-untyped-def]
    """Fill (n,) arrays with the energy the nodes' intact bonds hold and have spent on softening, J/m^3.

    Half of a bond's energy belongs to each of its nodes.
    """
    for i in prange(len(strain)):
        strain[i], softened[i] = _energies_of(bonds, motion, i)


@njit
def _energies_of(bonds, motion, i):  # type: ignore[no-untyped-def]
    softens = len(motion.worst) > 0
    strain = softened = 0.0
    for k in range(bonds.start[i], bonds.start[i + 1]):
        if motion.broken[k] == 0:
            _, _, stretch, length = deformed(bonds, motion.u, i, k)
            quarter = bonds.stiffness[k] * length / 4
            if softens and motion.worst[k] > 0:
                worst, peak, limit = motion.worst[k], bonds.peak[k], bonds.limit[k]
                softened += quarter * peak * limit * spent_share(worst, peak, limit)
                quarter *= intact_share(worst, peak, limit)
            strain += quarter * stretch * stretch
    return strain, softened
