"""State-based laws as one would write them first: as a bond list in numpy, and as loops over families in numba.

Each takes what `bonds_of` finds of a plate in plane stress and displacements (n, 2), m, and returns force densities
(n, 2), N/m^3, of linear solids. The loops visit each bond from both of its ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.material_constants import bulk_modulus, lame
from pdsolve.laws.correspondence import silling
from pdsolve.run.system import System


class Textbook(NamedTuple):
    """The bonds of n nodes, b of them; those of node i at start[i]:start[i + 1]."""

    start: NDArray[np.int64]  # (n + 1,)
    i: NDArray[np.int64]  # (b,)
    j: NDArray[np.int64]  # (b,)
    xi: NDArray[np.float64]  # (b, 2) m
    length: NDArray[np.float64]  # (b,) m
    influence: NDArray[np.float64]  # (b,)
    volume: NDArray[np.float64]  # (n,) m^2
    inverse: NDArray[np.float64]  # (n, 2, 2) K^-1, 1/m^4
    control: NDArray[np.float64]  # (n,) of Silling's, N/m^6
    m: NDArray[np.float64]  # (n,) sum of influence times length squared, m^4
    intact: NDArray[np.bool_]  # (b,)
    first: float  # lambda / (1 + lambda / 2 mu) of plane stress, Pa
    shear: float  # mu, Pa
    bulk: float  # K of the plane, Pa


def bonds_of(system: System) -> Textbook:
    """The bonds of a plate of one spacing."""
    bonds, model = system.scheme.fill(system.model).whole().bonds, system.model
    material, nodes = model.materials[0], len(bonds.start) - 1
    i, xi = np.repeat(np.arange(nodes), np.diff(bonds.start)), bonds.xi.astype(float)
    volume = system.model.grid.delta**2
    squared, w = (xi**2).sum(axis=1), bonds.weight.astype(float)
    K = np.empty((nodes, 2, 2))
    for a in range(2):
        for b in range(2):
            K[:, a, b] = np.bincount(i, w * xi[:, a] * xi[:, b], minlength=nodes)
    first, shear = lame(material.E, material.nu or 0.0)
    return Textbook(
        start=bonds.start,
        i=i,
        j=bonds.neighbour.astype(np.int64),
        xi=xi,
        length=np.sqrt(squared),
        influence=w / volume[bonds.neighbour],
        volume=volume,
        inverse=np.linalg.inv(K),
        control=silling(model, np.bincount(i, w, minlength=nodes), 2),
        m=np.bincount(i, w * squared, minlength=nodes),
        intact=np.ones(len(i), dtype=np.bool_),
        first=2 * shear * first / (first + 2 * shear),
        shear=shear,
        bulk=bulk_modulus(material.E, material.nu or 0.0, "stress"),
    )


def correspondence_in_numpy(t: Textbook, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """With Silling's control."""
    n, w = len(u), t.influence * t.volume[t.j] * t.intact
    eta = u[t.j] - u[t.i]
    H = np.empty((n, 2, 2))
    for a in range(2):
        for b in range(2):
            H[:, a, b] = np.bincount(t.i, w * eta[:, a] * t.xi[:, b], minlength=n)
    H = H @ t.inverse
    trace = H[:, 0, 0] + H[:, 1, 1]
    P = t.first * trace[:, None, None] * np.eye(2) + t.shear * (H + H.transpose(0, 2, 1))
    A = P @ t.inverse
    own = np.einsum("bac,bc->ba", A[t.i] + A[t.j], t.xi)
    for end in (t.i, t.j):
        own += t.control[end, None] * (eta - np.einsum("bac,bc->ba", H[end], t.xi))
    return np.column_stack([np.bincount(t.i, w * own[:, a], minlength=n) for a in range(2)])


def ordinary_in_numpy(t: Textbook, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """As published, without corrections."""
    n, w = len(u), t.influence * t.volume[t.j] * t.intact
    y = t.xi + u[t.j] - u[t.i]
    now = np.hypot(y[:, 0], y[:, 1])
    e = now - t.length
    theta = 2 / t.m * np.bincount(t.i, w * t.length * e, minlength=n)
    pull = np.zeros(len(e))
    for end in (t.i, t.j):
        p = 2 * t.bulk * theta[end]
        pull += (p * t.length + 8 * t.shear * (e - theta[end] * t.length / 2)) / t.m[end]
    pull *= w / now
    return np.column_stack([np.bincount(t.i, pull * y[:, a], minlength=n) for a in range(2)])


def correspondence_in_loops(t: Textbook, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """With Silling's control."""
    H, A = np.empty((2, len(u), 2, 2))
    f = np.empty_like(u)
    _gradients(t, u, H, A)
    _correspond(t, u, H, A, f)
    return f


def ordinary_in_loops(t: Textbook, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """As published, without corrections."""
    theta, f = np.empty(len(u)), np.empty_like(u)
    _dilate(t, u, theta)
    _pull(t, u, theta, f)
    return f


@njit(cache=True, error_model="numpy")
def _gradients(t, u, H, A):  # type: ignore[no-untyped-def]
    for i in range(len(u)):
        xx = xy = yx = yy = 0.0
        for k in range(t.start[i], t.start[i + 1]):
            if t.intact[k]:
                j = t.j[k]
                w = t.influence[k] * t.volume[j]
                x, y = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1]
                xx += w * x * t.xi[k, 0]
                xy += w * x * t.xi[k, 1]
                yx += w * y * t.xi[k, 0]
                yy += w * y * t.xi[k, 1]
        inverse, h = t.inverse[i], H[i]
        h[0, 0], h[0, 1] = xx * inverse[0, 0] + xy * inverse[1, 0], xx * inverse[0, 1] + xy * inverse[1, 1]
        h[1, 0], h[1, 1] = yx * inverse[0, 0] + yy * inverse[1, 0], yx * inverse[0, 1] + yy * inverse[1, 1]
        p = t.first * (h[0, 0] + h[1, 1])
        sxx, syy, sxy = p + 2 * t.shear * h[0, 0], p + 2 * t.shear * h[1, 1], t.shear * (h[0, 1] + h[1, 0])
        for b in range(2):
            A[i, 0, b] = sxx * inverse[0, b] + sxy * inverse[1, b]
            A[i, 1, b] = sxy * inverse[0, b] + syy * inverse[1, b]


@njit(cache=True, error_model="numpy")
def _correspond(t, u, H, A, f):  # type: ignore[no-untyped-def]
    for i in range(len(u)):
        fx = fy = 0.0
        for k in range(t.start[i], t.start[i + 1]):
            if t.intact[k]:
                j = t.j[k]
                x, y, w = t.xi[k, 0], t.xi[k, 1], t.influence[k] * t.volume[j]
                eta_x, eta_y = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1]
                for end in (i, j):
                    h, a, z = H[end], A[end], t.control[end]
                    fx += w * (a[0, 0] * x + a[0, 1] * y + z * (eta_x - h[0, 0] * x - h[0, 1] * y))
                    fy += w * (a[1, 0] * x + a[1, 1] * y + z * (eta_y - h[1, 0] * x - h[1, 1] * y))
        f[i, 0], f[i, 1] = fx, fy


@njit(cache=True, error_model="numpy")
def _dilate(t, u, theta):  # type: ignore[no-untyped-def]
    for i in range(len(u)):
        total = 0.0
        for k in range(t.start[i], t.start[i + 1]):
            if t.intact[k]:
                j = t.j[k]
                x, y = t.xi[k, 0] + u[j, 0] - u[i, 0], t.xi[k, 1] + u[j, 1] - u[i, 1]
                total += t.influence[k] * t.volume[j] * t.length[k] * (np.sqrt(x * x + y * y) - t.length[k])
        theta[i] = 2 / t.m[i] * total


@njit(cache=True, error_model="numpy")
def _pull(t, u, theta, f):  # type: ignore[no-untyped-def]
    for i in range(len(u)):
        fx = fy = 0.0
        for k in range(t.start[i], t.start[i + 1]):
            if t.intact[k]:
                j = t.j[k]
                x, y = t.xi[k, 0] + u[j, 0] - u[i, 0], t.xi[k, 1] + u[j, 1] - u[i, 1]
                now = np.sqrt(x * x + y * y)
                e, pull = now - t.length[k], 0.0
                for end in (i, j):
                    p = 2 * t.bulk * theta[end] * t.length[k]
                    pull += (p + 8 * t.shear * (e - theta[end] * t.length[k] / 2)) / t.m[end]
                pull *= t.influence[k] * t.volume[j] / now
                fx += pull * x
                fy += pull * y
        f[i, 0], f[i, 1] = fx, fy
