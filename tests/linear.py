"""Statics and frequencies of a prepared system, beside the marching solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg, eigsh, spsolve

from pdsolve.bonds import Bonds
from pdsolve.system import Prepared


def sources(bonds: Bonds) -> NDArray[np.int64]:
    """Row (b,) of the node whose bond it is."""
    return np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))


def matrix(problem: Prepared) -> csr_array:
    """K (2n, 2n), N/m^4: minus the force densities for small displacements, node i at rows 2i and 2i + 1."""
    rest = problem.state._replace(value=np.zeros(problem.state.value.shape))
    return problem.system.operator.tangent(rest)


def weighted(problem: Prepared) -> csr_array:
    """K times the nodes' areas, symmetric in the conservative mode, N/m^2 (a force per unit thickness and length)."""
    return diags_array(np.repeat(problem.system.area, 2)) @ matrix(problem)


def true_limit(problem: Prepared) -> float:
    """2 / omega_max, s, of a symmetric operator: what the step must be below."""
    mass = np.repeat(problem.system.model.rho * problem.system.area, 2)
    K = weighted(problem)
    scaled = diags_array(mass**-0.5) @ (K + K.T) / 2 @ diags_array(mass**-0.5)
    start = np.random.default_rng(1).standard_normal(len(mass))
    return float(2 / np.sqrt(eigsh(scaled, k=1, which="LA", v0=start, return_eigenvectors=False)[0]))


def equilibrium(problem: Prepared, held: NDArray[np.bool_], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 2) at rest under the loads of time 0, the components `held` (n, 2) being those of `at`."""
    free = ~held.ravel()
    u = np.where(held, at, 0.0).ravel()
    symmetric = problem.system.operator.symmetric
    area = np.repeat(problem.system.area, 2)
    K = weighted(problem) if symmetric else matrix(problem)
    rest = (problem.system.drive.force.ravel() * (area if symmetric else 1.0) - K @ u)[free]
    inner = K[free][:, free]
    if not symmetric:
        u[free] += spsolve(inner.tocsc(), rest)
        return u.reshape(-1, 2)
    found, failed = cg(inner, rest, rtol=1e-10, maxiter=20000, M=diags_array(1 / inner.diagonal()))
    assert not failed
    u[free] += found
    return u.reshape(-1, 2)


def accelerate(problem: Prepared) -> None:
    """Give all nodes the accelerations that belong to their small displacements."""
    state = problem.state
    pull = matrix(problem) @ state.value.astype(float).ravel()
    state.second[:] = -pull.reshape(-1, 2) / problem.system.model.rho[:, None]


def stiffness(bonds: Bonds, node: int) -> tuple[float, float, float]:
    """C11, C22 and C66 (= C12) of a node's bonds, Pa: of the energy c s^2 xi / 4 that is its half."""
    own = slice(bonds.start[node], bonds.start[node + 1])
    xi = bonds.xi[own]
    length = np.hypot(*xi.T)
    n_x, n_y = (xi / length[:, None]).T
    share = bonds.stiffness[own] * length / 2
    return tuple(float(np.sum(share * term)) for term in (n_x**4, n_y**4, (n_x * n_y) ** 2))  # type: ignore[return-value]
