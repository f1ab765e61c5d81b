"""Arrays of listed bonds and of the state for compiled loops, and one deformed bond."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds

# Of functions that only compiled code calls: no references are counted, and divisions are numpy's
INNER: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
INLINE = INNER | {
    "forceinline": True
}  # of those that see every bond: to pass a law's columns on takes longer than to use them


class List(NamedTuple):
    """Bonds for compiled loops, those of node i at start[i]:start[i + 1]; b of them, in d dimensions."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: tuple[NDArray[np.floating], ...]  # d times (b,), m; a tuple, as compilers know its length
    length: NDArray[np.floating]  # (b,) |xi|, m


class SwollenList(NamedTuple):
    """Bonds as `List` has them, of nodes that heat or a solvent swells: a bond stretches from its swollen length."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: tuple[NDArray[np.floating], ...]  # d times (b,), m, before swelling
    length: NDArray[np.floating]  # (b,) |xi|, m
    swell: NDArray[np.floating]  # (n,) strain of a free node: alpha (T - T0) of heat; a bond has the mean of its ends


AnyList = List | SwollenList


class Links(NamedTuple):
    """Bonds along which a scalar flows, those of node i at start[i]:start[i + 1]; b of them, without vectors."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: tuple[()] = ()


def list_of(bonds: Bonds) -> List:
    """Bonds (b,) for compiled loops."""
    length = np.sqrt((bonds.xi**2).sum(axis=1))
    return List(bonds.start, bonds.neighbour, tuple(np.ascontiguousarray(x) for x in bonds.xi.T), length)


class Left(NamedTuple):
    """The bonds (b,) of k nodes, and the weights of those that are intact."""

    own: NDArray[np.int64]  # (b,) which of the k nodes
    which: NDArray[np.int64]  # (b,)
    weight: NDArray[np.float64]  # (b,) 0 where broken


def left(bonds: AnyList, weight: NDArray[np.floating], broken: NDArray[np.int32], rows: NDArray[np.int64]) -> Left:
    """The intact bonds of these nodes (k,)."""
    counts = bonds.start[rows + 1] - bonds.start[rows]
    which = (
        np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(bonds.start[rows], counts)
    )
    row = np.repeat(np.arange(len(rows)), counts)
    return Left(row, which, np.where(broken[which] == 0, weight[which], 0.0).astype(float))


def shapes(bonds: AnyList, intact_bonds: Left, nodes: int) -> NDArray[np.float64]:
    """Shape tensors K (k, d, d) of so many nodes, from the intact bonds."""
    d, xi = len(bonds.xi), [x[intact_bonds.which].astype(float) for x in bonds.xi]
    K = np.empty((nodes, d, d))
    for a in range(d):
        for b in range(a, d):
            K[:, a, b] = K[:, b, a] = np.bincount(
                intact_bonds.own, intact_bonds.weight * xi[a] * xi[b], minlength=nodes
            )
    return K


class Tabled(NamedTuple):
    """Data of b bonds for the block kernels."""

    columns: tuple[NDArray[np.floating], ...]  # (b,) each, those of `numbers` and what `margin` wants more
    alike: tuple[int, ...]  # columns of one number here are quantities of one kind: bonds have each other's
    nodal_count: int  # how many `nodal_numbers` a node has
    watched: bool  # whether `margin` has to be looked at


class Now(NamedTuple):
    """The state at a step for compiled loops; n nodes, w components of all unknowns."""

    value: NDArray[Any]  # (n, w)
    rate: NDArray[Any]  # (n, w) per s; within a step the mean since the last one
    step: int
    dt: float  # s since the history of nodes, 0 in quasi-static analysis and for energies and fields


class Bond(NamedTuple):
    """One deformed bond: reference vector, relative displacement, lengths and stretch."""

    xi: tuple[Any, ...]
    eta: tuple[Any, ...]
    length: Any  # |xi|, m
    q: Any
    stretch: Any
    elongation: Any  # |xi + eta| - |xi|, m
    inverse: Any  # 1 / |xi + eta|, 1/m


@njit(**INNER)
def deformed(bonds, value, i, j, k):  # type: ignore[no-untyped-def]
    """Bond k, from node i to node j, at these values."""
    xi = reference(bonds.xi, k)
    eta = _displaced(bonds, value, xi, i, j)
    squared, along, more = xi[0] * xi[0], xi[0] * eta[0], eta[0] * eta[0]
    for a in range(1, len(xi)):
        squared += xi[a] * xi[a]
        along += xi[a] * eta[a]
    more += 2 * along
    for a in range(1, len(xi)):
        more += eta[a] * eta[a]
    e, length, now = more / squared, bonds.length[k], np.sqrt(squared + more)
    q, reach = np.sqrt(1 + e), now + length
    once = 1 / (now * reach)  # one division for two
    return Bond(xi, eta, length, q, e / (q + 1), more * now * once, reach * once)


class Ends(NamedTuple):
    """What the nodes of a bond have, as many values each; numbers, or lanes of many bonds."""

    near_end: tuple[Any, ...]
    far_end: tuple[Any, ...]


def bond_at(bonds: Any, value: Any, i: Any, j: Any, k: Any) -> Bond | Ends:
    """Bond k, from node i to node j, at these values: deformed, or of `Links` what its ends have."""
    if isinstance(bonds, Links):
        return Ends(reference(value, i), reference(value, j))
    bond: Bond = deformed(bonds, value, i, j, k)
    return bond


@overload(bond_at, jit_options=INNER)
def _bond_at(bonds, value, i, j, k):  # type: ignore[no-untyped-def]
    if bonds.instance_class is Links:
        return lambda bonds, value, i, j, k: Ends(reference(value, i), reference(value, j))
    return lambda bonds, value, i, j, k: deformed(bonds, value, i, j, k)


@njit(**INNER)
def stretch_before(bond, now, i, j):  # type: ignore[no-untyped-def]
    """The stretch of the bond from i to j one step ago."""
    along, more = now.dt * 0, now.dt * 0
    for a in range(len(bond.xi)):
        eta = bond.eta[a] - now.dt * (now.rate[j, a] - now.rate[i, a])
        along += bond.xi[a] * eta
        more += eta * eta
    e = (2 * along + more) / (bond.length * bond.length)
    return e / (np.sqrt(1 + e) + 1)


def _displaced(bonds: AnyList, value: NDArray[Any], xi: Any, i: int, j: int) -> tuple[Any, ...]:
    """What stretches a bond: the displacements of its ends, less what swelling alone would make of it."""
    eta = _difference(bonds.xi, value, i, j)
    return eta if isinstance(bonds, List) else _less(eta, (bonds.swell[i] + bonds.swell[j]) / 2, xi)


@overload(_displaced, jit_options=INNER)
def _displaced_of(bonds, value, xi, i, j):  # type: ignore[no-untyped-def]
    if "swell" not in bonds.fields:
        return lambda bonds, value, xi, i, j: _difference(bonds.xi, value, i, j)
    return lambda bonds, value, xi, i, j: _less(
        _difference(bonds.xi, value, i, j), (bonds.swell[i] + bonds.swell[j]) / 2, xi
    )


def _less(eta: tuple[Any, ...], free: Any, xi: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(component - free * x for component, x in zip(eta, xi, strict=True))


@overload(_less, jit_options=INNER)
def _less_of(eta, free, xi):  # type: ignore[no-untyped-def]
    if len(xi) == 2:
        return lambda eta, free, xi: (eta[0] - free * xi[0], eta[1] - free * xi[1])
    return lambda eta, free, xi: (eta[0] - free * xi[0], eta[1] - free * xi[1], eta[2] - free * xi[2])


def reference(xi: tuple[NDArray[Any], ...], k: int) -> tuple[Any, ...]:
    """Entry k of each of some arrays, as a tuple."""
    return tuple(component[k] for component in xi)


def _difference(xi: tuple[NDArray[Any], ...], value: NDArray[Any], i: int, j: int) -> tuple[Any, ...]:
    return tuple(value[j, : len(xi)] - value[i, : len(xi)])


@overload(reference, jit_options=INNER)
def _reference_of(xi, k):  # type: ignore[no-untyped-def]
    if len(xi) < 3:
        return (lambda xi, k: (xi[0][k],)) if len(xi) == 1 else lambda xi, k: (xi[0][k], xi[1][k])
    return lambda xi, k: (xi[0][k], xi[1][k], xi[2][k])


@overload(_difference, jit_options=INNER)
def _difference_of(xi, value, i, j):  # type: ignore[no-untyped-def]
    if len(xi) == 2:
        return lambda xi, value, i, j: (value[j, 0] - value[i, 0], value[j, 1] - value[i, 1])
    return lambda xi, value, i, j: (value[j, 0] - value[i, 0], value[j, 1] - value[i, 1], value[j, 2] - value[i, 2])
