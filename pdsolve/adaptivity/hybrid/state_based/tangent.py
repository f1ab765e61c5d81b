"""Tangent of the forces on the nodes of a plate with a fine zone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, coo_array, csr_array, diags_array, eye_array, kron, vstack

from pdsolve.adaptivity.hybrid.state_based.bilinear_cells import SLOPE, TWIST, of_gradients, twisting
from pdsolve.adaptivity.hybrid.state_based.families import MOMENT, SHEARED, THETA, Families, Sums

_twisting = getattr(twisting, "py_func", twisting)


class Cells(NamedTuple):
    """Coarse cells."""

    corners: NDArray[np.int64]  # (c, 4) nodes
    side: float  # m
    bulk: float  # K, Pa
    shear: float  # 2 mu, Pa


def tangent_of(
    families: Families, sums: Sums, cells: Cells, value: NDArray[np.float64], volume: NDArray[np.float64]
) -> csr_array:
    """Minus the derivative (2 n, 2 n), N/m^4, of the force densities at displacements `value` (n, 2), whose sums are
    gathered; `volume` (n,), m^2, is that of nodes."""
    count = len(value)
    pull = np.repeat(np.arange(len(families.rows)), 2), families.rows.ravel()
    moved = coo_array((families.w.ravel(), pull), (len(families.rows), count))
    tied = kron(vstack([eye_array(count), moved]), eye_array(2)).tocsr()
    found = tied.T @ _of_families(families, sums) @ tied + _of_cells(cells, value)
    return (diags_array(np.repeat(1 / volume, 2)) @ found).tocsr()


def _of_families(families: Families, sums: Sums) -> csr_array:
    """Minus the derivative of the forces, N, on points."""
    inner, pieces, V, dof = families.inner, families.pieces, families.volume, 2 * len(sums.u)
    ends = np.concatenate([inner.ends, pieces.ends]).astype(np.int64)
    xi, own = np.concatenate([inner.xi, pieces.xi]), np.concatenate([sums.inner, sums.pieces])
    a, b = (_terms(families, one, other) for one, other in ((inner.a, pieces.a), (inner.b, pieces.b)))
    k = np.concatenate([(V[inner.ends] * inner.b / inner.xi[:, 2:]).sum(axis=1), pieces.k])
    theta, sheared, moment = (sums.sites[:, one] for one in (THETA, SHEARED, MOMENT))
    stiff = diags_array(V * (families.bulk + moment / 4))
    mixed = a.T @ diags_array(V / 2) @ b
    by_e = diags_array(k) + a.T @ stiff @ a - mixed - mixed.T
    p = families.bulk * theta - (sheared - theta * moment / 2) / 2
    force = k * own[:, 0] + a.T @ (V * p) - b.T @ (V * theta / 2)
    count = len(ends)
    columns = (2 * ends[:, :, None] + np.arange(2)).reshape(count, 4)
    along = np.column_stack([-own[:, 1:], own[:, 1:]])
    across = np.column_stack([own[:, 2], -own[:, 1], -own[:, 2], own[:, 1]])
    rows = np.repeat(np.arange(count), 4)
    n, t = (csr_array((each.ravel(), (rows, columns.ravel())), shape=(count, dof)) for each in (along, across))
    tension = diags_array(force / (xi[:, 2] + own[:, 0]))
    return (n.T @ by_e @ n + t.T @ tension @ t).tocsr()


def _terms(families: Families, inner: NDArray[np.float64], pieces: NDArray[np.float64]) -> csr_array:
    """Terms of pieces in the sums of sites, (s, m + p)."""
    of, bonds = families.pieces, families.inner
    m, p = len(bonds.ends), len(of.ends)
    sites = len(families.volume)
    first = csr_array((inner.ravel(), (bonds.ends.ravel(), np.repeat(np.arange(m), 2))), shape=(sites, m))
    last = csr_array((pieces, (of.site, np.repeat(np.arange(p), np.diff(of.start)))), shape=(sites, p))
    return block_array([[first, last]]).tocsr()


def _of_cells(cells: Cells, value: NDArray[np.float64]) -> csr_array:
    """Minus the derivative of the forces, N, of coarse cells on nodes."""
    f = of_gradients(cells.corners, cells.side, value)
    strain = (np.einsum("cba,cbd->cad", f, f) - np.eye(2)) / 2
    trace = np.einsum("caa->c", strain)[:, None, None] * np.eye(2)
    stress = cells.bulk * trace + cells.shear * (strain - trace / 2)
    g = SLOPE / cells.side
    # change of the strain with the displacement d of corner n
    change = np.einsum("cda,nb->cndab", f, g)
    change = (change + change.transpose(0, 1, 2, 4, 3)) / 2
    spread = np.einsum("cndaa->cnd", change)
    own = cells.shear * np.einsum("cndab,cmeab->cndme", change, change)
    own += (cells.bulk - cells.shear / 2) * np.einsum("cnd,cme->cndme", spread, spread)
    own += np.einsum("na,cab,mb,de->cndme", g, stress, g, np.eye(2))
    own = cells.side**2 * own + _twisting(cells.bulk, cells.shear) * np.einsum("n,m,de->ndme", TWIST, TWIST, np.eye(2))
    at = (2 * cells.corners[:, :, None] + np.arange(2)).reshape(-1, 8)
    size = value.size
    rows, columns = np.repeat(at, 8, axis=1).ravel(), np.tile(at, 8).ravel()
    return coo_array((own.reshape(-1, 64).ravel(), (rows, columns)), (size, size)).tocsr()
