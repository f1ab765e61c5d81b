"""The bonds of a problem as a sparse matrix: for statics, frequencies and stiffnesses, beside the marching solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import cg, spsolve

from pdsolve.bonds import Bonds
from pdsolve.system import Prepared


def sources(bonds: Bonds) -> NDArray[np.int64]:
    """Row (b,) of the node whose bond it is."""
    return np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))


def operator(bonds: Bonds) -> csr_matrix:
    """K (2n, 2n), N/m^4: minus the force densities for small displacements, node i at rows 2i and 2i + 1."""
    i, j, n = sources(bonds), bonds.neighbour.astype(np.int64), len(bonds.start) - 1
    length = np.hypot(*bonds.xi.T)
    unit = bonds.xi / length[:, None]
    rows, columns, values = [], [], []
    for a in (0, 1):
        for b in (0, 1):
            k = bonds.stiffness / length * unit[:, a] * unit[:, b]
            rows += [2 * i + a, 2 * i + a]
            columns += [2 * i + b, 2 * j + b]
            values += [k, -k]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return coo_matrix(entries, shape=(2 * n, 2 * n)).tocsr()


def weighted(problem: Prepared) -> csr_matrix:
    """K times the nodes' areas, symmetric in the conservative mode, N/m^2 (a force per unit thickness and length)."""
    return diags(np.repeat(problem.assembly.area, 2)) @ operator(problem.assembly.bonds)


def equilibrium(problem: Prepared, held: NDArray[np.bool_], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 2) at rest under the loads of time 0, the components `held` (n, 2) being those of `at`."""
    free = ~held.ravel()
    u = np.where(held, at, 0.0).ravel()
    symmetric = problem.system.options.mode == "conservative"
    area = np.repeat(problem.assembly.area, 2)
    K = weighted(problem) if symmetric else operator(problem.assembly.bonds)
    rest = (problem.system.drive.force.ravel() * (area if symmetric else 1.0) - K @ u)[free]
    inner = K[free][:, free]
    if not symmetric:
        u[free] += spsolve(inner.tocsc(), rest)
        return u.reshape(-1, 2)
    found, failed = cg(inner, rest, rtol=1e-10, maxiter=20000, M=diags(1 / inner.diagonal()))
    assert not failed
    u[free] += found
    return u.reshape(-1, 2)


def stiffness(bonds: Bonds, node: int) -> tuple[float, float, float]:
    """C11, C22 and C66 (= C12) of a node's bonds, Pa: of the energy c s^2 xi / 4 that is its half."""
    own = slice(bonds.start[node], bonds.start[node + 1])
    xi = bonds.xi[own]
    length = np.hypot(*xi.T)
    n_x, n_y = (xi / length[:, None]).T
    share = bonds.stiffness[own] * length / 2
    return tuple(float(np.sum(share * term)) for term in (n_x**4, n_y**4, (n_x * n_y) ** 2))  # type: ignore[return-value]
