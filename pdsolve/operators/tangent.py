"""Derivatives of a law's forces by complex steps: exact to round-off, without further functions of the law.

J. R. R. A. Martins, P. Sturdza, J. J. Alonso, ACM Trans. Math. Softw. 29 (2003) 245-262: f'(x) = Im f(x + i h) / h
contains no difference, so that h may be arbitrarily small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.laws.bond_arrays import AnyList, List, Now, deformed
from pdsolve.laws.calls import accumulate_bond_force
from pdsolve.laws.law import Law

STEP = 1e-30  # m; its square is lost beside any length


def of_springs(
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    xi: NDArray[np.float64],
    pull: NDArray[np.float64],
    value: NDArray[np.floating],
) -> csr_array:
    """Minus the derivative (n d, n d) of the forces pull (1 / |xi| - 1 / |y|) y, y = xi + eta, of linear bonds.

    `source` and `target` (b,) are their nodes, `xi` (b, d) m, `pull` (b,) N/m^3 for a unit stretch, `value` (n, d) m.
    """
    y = xi + value[target].astype(np.float64) - value[source]
    length, now = np.sqrt((xi**2).sum(axis=1)), np.sqrt((y**2).sum(axis=1))
    slope = (1 / length - 1 / now)[:, None, None] * np.eye(xi.shape[1]) + y[:, :, None] * y[:, None, :] / now[
        :, None, None
    ] ** 3
    return _matrix(len(value), source, target, -pull[:, None, None] * slope, pull[:, None, None] * slope)


def of_green_springs(
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    xi: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    value: NDArray[np.floating],
) -> csr_array:
    """Minus the derivative (n d, n d) of the forces k e / 2 y, y = xi + eta, of springs with Green's strain.

    e = (|y|^2 - |xi|^2) / |xi|^2; `stiffness` k (b,); other arguments are those of `of_springs`.
    """
    y = xi + value[target].astype(np.float64) - value[source]
    square = (xi**2).sum(axis=1)
    half = ((y**2).sum(axis=1) / square - 1) / 2
    slope = half[:, None, None] * np.eye(xi.shape[1]) + y[:, :, None] * y[:, None, :] / square[:, None, None]
    return _matrix(len(value), source, target, -stiffness[:, None, None] * slope, stiffness[:, None, None] * slope)


def of_pairs(bonds: AnyList, columns: Any, now: Now) -> csr_array:
    """Minus the derivative (n w, n w) of the forces of a pair law; `now` holds complex values."""
    nodes, width = now.value.shape
    by_node, by_neighbour = (np.zeros((len(bonds.neighbour), width, width)) for _ in range(2))
    _slopes(bonds, columns, now, np.empty((nodes, 0), dtype=now.value.dtype), STEP, by_node, by_neighbour)
    source = np.repeat(np.arange(nodes), np.diff(bonds.start))
    return _matrix(nodes, source, bonds.neighbour.astype(np.int64), by_node, by_neighbour)


def of_curves(
    law: Law,
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    xi: NDArray[np.float64],
    numbers: Sequence[NDArray[np.float64]],
    value: NDArray[np.floating],
) -> csr_array:
    """The tangent (n w, n w), N/m^4, of intact bonds (b,) of a pair law that is not linear, at values (n, w).

    `numbers` are stiffness, peak, limit and largest stretch (b,) each.
    """
    order = np.argsort(source, kind="stable")
    source, target, xi = source[order], target[order], xi[order]
    stiffness, peak, limit, worst = (column[order] for column in numbers)
    columns = law.columns_type(stiffness, peak, limit, worst, np.zeros(len(source), np.int32), np.zeros(0))
    start, length = np.searchsorted(source, np.arange(len(value) + 1)), np.sqrt((xi**2).sum(axis=1))
    bonds = List(start, target.astype(np.int32), tuple(np.ascontiguousarray(x) for x in xi.T), length)
    complex_value = value.astype(np.complex128)
    return of_pairs(bonds, columns, Now(complex_value, complex_value, 0, 0.0))


def of_followers(parents: NDArray[np.integer], weights: NDArray[np.float64], nodes: int) -> csr_array:
    """Weights (k, nodes) by which k points move with their `parents` (k, m), rows of nodes, by `weights` (k, m)."""
    followers = np.repeat(np.arange(len(parents)), parents.shape[1])
    return coo_array((weights.ravel(), (followers, parents.ravel())), (len(parents), nodes)).tocsr()


def of_blocks(
    source: NDArray[np.int64], target: NDArray[np.int64], blocks: NDArray[np.float64], nodes: int
) -> csr_array:
    """Minus the derivative (n w, n w) of forces linear in values: those of `target` (b,) times `blocks` (b, w, w)."""
    return _matrix(nodes, source, target, np.zeros_like(blocks), blocks)


def _matrix(
    nodes: int,
    source: NDArray[np.int64],
    target: NDArray[np.int64],
    by_node: NDArray[np.float64],
    by_neighbour: NDArray[np.float64],
) -> csr_array:
    """Minus the sum of bonds' derivatives (b, w, w) by the values of their own node and of the other one."""
    width = by_node.shape[1]
    a, b = (index.ravel() for index in np.indices((width, width)))
    row = (width * source[:, None] + a).ravel()
    column = np.concatenate([(width * node[:, None] + b).ravel() for node in (source, target)])
    values = -np.concatenate([by_node.ravel(), by_neighbour.ravel()])
    return coo_array((values, (np.tile(row, 2), column)), (width * nodes, width * nodes)).tocsr()


def of_passes(
    bonds: AnyList,
    pulls: Callable[[NDArray[np.complex128]], NDArray[np.complex128]],
    value: NDArray[np.complex128],
    far: int,
) -> csr_array:
    """Minus the derivative (n w, n w) of any law's forces `pulls` at values (n, w), which reach `far` bonds.

    Nodes without a common dependent node are perturbed together (A. R. Curtis, M. J. D. Powell, J. K. Reid, IMA J.
    Appl. Math. 13 (1974) 117-119).
    """
    nodes, width = value.shape
    bonded = np.ones(len(bonds.neighbour)), bonds.neighbour, bonds.start
    near = direct = (csr_array(bonded, (nodes, nodes)) + eye_array(nodes)).tocsr()
    for _ in range(far - 1):  # pairs of nodes at most `far` bonds apart
        near = (near @ direct).tocsr()
    colour = _colours(near.indptr, near.indices)
    i, rows, columns_of, values = np.repeat(np.arange(nodes), np.diff(near.indptr)), [], [], []
    for number in range(int(colour.max()) + 1):
        perturbed = colour[near.indices] == number
        for b in range(width):
            value[colour == number, b] += 1j * STEP
            slope = -pulls(value)[i[perturbed]].imag / STEP
            value[colour == number, b] -= 1j * STEP
            rows.append((width * i[perturbed][:, None] + np.arange(width)).ravel())
            columns_of.append(np.repeat(width * near.indices[perturbed] + b, width))
            values.append(slope.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns_of))
    return coo_array(entries, (width * nodes, width * nodes)).tocsr()


@cached_njit(error_model="numpy")
def _slopes(bonds, law, now, m, step, by_node, by_neighbour):  # type: ignore[no-untyped-def]
    """Fill (b, w, w) with the derivatives of each bond's force by the values of its node and its neighbour."""
    f = np.empty(by_node.shape[1], dtype=now.value.dtype)
    for i in range(len(bonds.start) - 1):
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            for a in range(len(f)):
                _slope(bonds, law, now, m, step, i, j, k, i, a, f, by_node)
                _slope(bonds, law, now, m, step, i, j, k, j, a, f, by_neighbour)


@njit(error_model="numpy")
def _slope(bonds, law, now, m, step, i, j, k, node, a, f, slope):  # type: ignore[no-untyped-def]
    """Column a of a bond's derivative by the values of a node."""
    before = now.value[node, a]
    now.value[node, a] = before + 1j * step
    f[:] = 0
    accumulate_bond_force(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k, f)
    now.value[node, a] = before
    for c in range(len(f)):
        slope[k, c, a] = f[c].imag / step


@cached_njit()
def _colours(start, near):  # type: ignore[no-untyped-def]
    """Colours (n,) such that no node is near two of one colour; `start` and `near` are those of a csr matrix."""
    nodes = len(start) - 1
    colour, used_by = np.full(nodes, -1), np.full(nodes + 1, -1)
    for i in range(nodes):
        for p in range(start[i], start[i + 1]):
            for q in range(start[near[p]], start[near[p] + 1]):
                if colour[near[q]] >= 0:
                    used_by[colour[near[q]]] = i
        while used_by[colour[i] + 1] == i:
            colour[i] += 1
        colour[i] += 1
    return colour
