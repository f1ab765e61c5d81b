"""Sums of sites over the pieces of bonds, and the forces of pieces.

With e = |x + y| - |x| of a piece of length l from x to x + y, and sums over the pieces of a site of

    theta = sum a e      q = sum b e      m = sum b l      p = K theta - (q - theta m / 2) / 2

the energy is  sum over pieces k e^2 / 2  +  sum over sites V ((K + m / 4) theta^2 / 2 - theta q / 2),  and a piece has
the force  k e + sum over its sites V (a p - b theta / 2).  Of a whole bond between free nodes this is that of
`pdsolve.laws.ordinary`, with a = D, b = 2 mu S l and k = V (2 mu S) of both ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER

THETA, SHEARED, MOMENT = range(3)  # of `Sums.sites`; then p in place of the second


class Inner(NamedTuple):
    """The m whole bonds between free nodes."""

    bond: NDArray[np.int64]  # (m,) of the plate
    ends: NDArray[np.int32]  # (m, 2) nodes
    xi: NDArray[np.float64]  # (m, 3) m, and its length
    a: NDArray[np.float64]  # (m, 2) at either end, 1/m
    b: NDArray[np.float64]  # (m, 2) Pa/m
    limit: NDArray[np.float64]  # (m,) stretch


class Pieces(NamedTuple):
    """The p other pieces, and their w weights at sites."""

    bond: NDArray[np.int64]  # (p,) of the plate
    ends: NDArray[np.int32]  # (p, 2) points
    xi: NDArray[np.float64]  # (p, 3) m, and its length
    k: NDArray[np.float64]  # (p,) N/m, per unit thickness
    limit: NDArray[np.float64]  # (p,) stretch
    start: NDArray[np.int64]  # (p + 1,)
    site: NDArray[np.int64]  # (w,)
    a: NDArray[np.float64]  # (w,) 1/m
    b: NDArray[np.float64]  # (w,) Pa/m


class Families(NamedTuple):
    """What n nodes and s sites have to do with each other: free nodes are sites under their own numbers."""

    bulk: float  # K, Pa
    volume: NDArray[np.float64]  # (s,) V, m^2
    inner: Inner
    pieces: Pieces
    rows: NDArray[np.int64]  # (q, 2) nodes that points on the border move with, which are numbered after nodes
    w: NDArray[np.float64]  # (q, 2) their weights


class Sums(NamedTuple):
    """Room for what is found at displacements."""

    u: NDArray[np.float64]  # (n + q, 2) m, of points
    sites: NDArray[np.float64]  # (s, 3)
    inner: NDArray[np.float64]  # (m, 3) e and the direction of bonds between free nodes
    pieces: NDArray[np.float64]  # (p, 3) likewise
    force: NDArray[np.float64]  # (n + q, 2) N, on points


def sums_of(families: Families, nodes: int) -> Sums:
    """Room for the sums of so many nodes."""
    points = nodes + len(families.rows)
    return Sums(
        np.zeros((points, 2)),
        np.zeros((len(families.volume), 3)),
        np.zeros((len(families.inner.ends), 3)),
        np.zeros((len(families.pieces.ends), 3)),
        np.zeros((points, 2)),
    )


@njit(**INNER)
def _extend(u, i, j, xi, found):  # type: ignore[no-untyped-def]
    """Fill in e and the direction (3,) of a piece; returns its stretch."""
    x, y = xi[0] + u[j, 0] - u[i, 0], xi[1] + u[j, 1] - u[i, 1]
    eta_x, eta_y = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1]
    now = np.sqrt(x * x + y * y)
    e = (2 * (xi[0] * eta_x + xi[1] * eta_y) + eta_x * eta_x + eta_y * eta_y) / (now + xi[2])
    found[0], found[1], found[2] = e, x / now, y / now
    return e / xi[2]


@cached_njit(nogil=True, error_model="numpy")
def gather(families, value, sums, gone):  # type: ignore[no-untyped-def]
    """Fill in the sums at displacements `value` (n, 2), m, and list in `gone` (m,) bonds between free nodes that are
    over their limits; returns how many, and the largest stretch of other pieces over their limits."""
    inner, pieces, sites, u = families.inner, families.pieces, sums.sites, sums.u
    nodes, count, largest = len(value), 0, 0.0
    u[:nodes] = value
    for q in range(len(families.rows)):
        i, j = families.rows[q]
        for axis in range(2):
            u[nodes + q, axis] = families.w[q, 0] * value[i, axis] + families.w[q, 1] * value[j, axis]
    sites[:] = 0
    for n in range(len(inner.ends)):
        i, j, found = inner.ends[n, 0], inner.ends[n, 1], sums.inner[n]
        if _extend(u, i, j, inner.xi[n], found) > inner.limit[n]:
            gone[count] = n
            count += 1
        for end, site in enumerate((i, j)):
            sites[site, THETA] += inner.a[n, end] * found[0]
            sites[site, SHEARED] += inner.b[n, end] * found[0]
            sites[site, MOMENT] += inner.b[n, end] * inner.xi[n, 2]
    for n in range(len(pieces.ends)):
        found = sums.pieces[n]
        stretch = _extend(u, pieces.ends[n, 0], pieces.ends[n, 1], pieces.xi[n], found)
        largest = max(largest, stretch / pieces.limit[n])
        for at in range(pieces.start[n], pieces.start[n + 1]):
            site = pieces.site[at]
            sites[site, THETA] += pieces.a[at] * found[0]
            sites[site, SHEARED] += pieces.b[at] * found[0]
            sites[site, MOMENT] += pieces.b[at] * pieces.xi[n, 2]
    return count, largest


@njit(**INNER)
def _pressure(bulk, sums):  # type: ignore[no-untyped-def]
    """p of a site."""
    return bulk * sums[THETA] - (sums[SHEARED] - sums[THETA] * sums[MOMENT] / 2) / 2


@cached_njit(nogil=True, error_model="numpy")
def pull(families, sums, force):  # type: ignore[no-untyped-def]
    """Add the forces on nodes, N per unit thickness, to `force` (n, 2), from the sums."""
    inner, pieces, sites, volume = families.inner, families.pieces, sums.sites, families.volume
    points = sums.force
    points[:] = 0
    for site in range(len(sites)):
        p = _pressure(families.bulk, sites[site])
        sites[site, SHEARED], sites[site, MOMENT] = volume[site] * p, volume[site] * sites[site, THETA] / 2
    for n in range(len(inner.ends)):
        found, f = sums.inner[n], 0.0
        for end in range(2):
            site = inner.ends[n, end]
            f += inner.a[n, end] * sites[site, SHEARED]
            f += inner.b[n, end] * (volume[site] * found[0] / inner.xi[n, 2] - sites[site, MOMENT])
        _act(points, inner.ends[n, 0], inner.ends[n, 1], f, found)
    for n in range(len(pieces.ends)):
        found = sums.pieces[n]
        f = pieces.k[n] * found[0]
        for at in range(pieces.start[n], pieces.start[n + 1]):
            site = pieces.site[at]
            f += pieces.a[at] * sites[site, SHEARED] - pieces.b[at] * sites[site, MOMENT]
        _act(points, pieces.ends[n, 0], pieces.ends[n, 1], f, found)
    _pass_on(families, points, force)


@njit(**INNER)
def _pass_on(families, points, force):  # type: ignore[no-untyped-def]
    """Add the forces on points to those on nodes (n, 2)."""
    nodes = len(force)
    for i in range(nodes):
        for axis in range(2):
            force[i, axis] += points[i, axis]
    for q in range(len(families.rows)):
        for m in range(2):
            for axis in range(2):
                force[families.rows[q, m], axis] += families.w[q, m] * points[nodes + q, axis]


@njit(**INNER)
def _act(points, i, j, f, found):  # type: ignore[no-untyped-def]
    """Add a piece's force."""
    for axis in range(2):
        points[i, axis] += f * found[1 + axis]
        points[j, axis] -= f * found[1 + axis]


@cached_njit(nogil=True, error_model="numpy")
def hold(families, sums, held, on_border):  # type: ignore[no-untyped-def]
    """Add the energies of free nodes, J per unit thickness, to `held` (n,), those of other sites and of pieces to
    `on_border` (n + q + s,), from the sums: of points, then of sites."""
    inner, pieces, sites, volume = families.inner, families.pieces, sums.sites, families.volume
    nodes, points = len(held), len(sums.u)
    for site in range(len(sites)):
        theta, sheared, moment = sites[site]
        own = volume[site] * ((families.bulk + moment / 4) * theta * theta / 2 - theta * sheared / 2)
        if site < nodes:
            held[site] += own
        else:
            on_border[points + site] += own
    for n in range(len(inner.ends)):
        for end in range(2):
            site, e = inner.ends[n, end], sums.inner[n, 0]
            held[site] += volume[site] * inner.b[n, end] / inner.xi[n, 2] * e * e / 2
    for n in range(len(pieces.ends)):
        for end in range(2):
            on_border[pieces.ends[n, end]] += pieces.k[n] * sums.pieces[n, 0] ** 2 / 4
