"""Tangent of forces between points that move with nodes.

All bonds, springs of coarse cells and pieces of clipped bonds are springs between points. A point moves with nodes by
weights, and passes its forces to them by the same weights.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array, kron

from pdsolve.laws.law import Law
from pdsolve.operators.tangent import of_curves, of_green_springs, of_springs


class BondCurves(NamedTuple):
    """The law of bonds (b,), and what it needs of them."""

    law: Law
    peak: NDArray[np.float64]
    limit: NDArray[np.float64]
    worst: NDArray[np.float64]  # largest stretch above the peak, 0 if never there


class SpringsBetweenPoints(NamedTuple):
    """Springs (b,) that pull their source towards their target."""

    source: NDArray[np.int64]  # points
    target: NDArray[np.int64]
    xi: NDArray[np.float64]  # (b, d) m
    stiffness: NDArray[np.float64]  # of Green's strain force over |xi| and strain, of others force over stretch
    uses_green_strain: bool
    curve: BondCurves | None = None  # of bonds whose force is no straight line


def tangent_of_springs(
    point_weights: csr_array, value: NDArray[np.floating], springs: Iterable[SpringsBetweenPoints]
) -> csr_array:
    """Minus the derivative (d n, d n) of the forces on n nodes by their displacements `value` (n, d), m.

    `point_weights` (p, n) are those by which points move with nodes. Forces are N, in the plane N/m.
    """
    u, axes = point_weights @ value, value.shape[1]
    matrix = csr_array((axes * len(u), axes * len(u)))
    for each in springs:
        if each.curve is not None:
            law, *history = each.curve
            matrix += of_curves(law, each.source, each.target, each.xi, (each.stiffness, *history), u)
            continue
        of = of_green_springs if each.uses_green_strain else of_springs
        matrix += of(each.source, each.target, each.xi, each.stiffness, u)
    points = kron(point_weights, eye_array(axes)).tocsr()
    return (points.T @ matrix @ points).tocsr()


def tangent_of_ground_springs(
    row: NDArray[np.integer], axis: NDArray[np.integer], stiffness: NDArray[np.float64], shape: tuple[int, ...]
) -> csr_array:
    """Minus the derivative, N/m^4 or N/m, of forces by displacements of `shape`, of springs (b,) to the ground."""
    at, size = shape[1] * row.astype(np.int64) + axis, shape[0] * shape[1]
    return coo_array((stiffness, (at, at)), shape=(size, size)).tocsr()
