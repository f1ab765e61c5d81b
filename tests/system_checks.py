"""What tests ask of a prepared system, whatever its operator."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigsh

from pdsolve.bonds.assembly import Bonds, in_precision
from pdsolve.model import ModelWarning
from pdsolve.rest.equilibrium import EquilibriumConditions
from pdsolve.rest.newton import Newton
from pdsolve.run.assembly import prepare_explicit_motion
from pdsolve.run.subdomain import make_checkpoint
from pdsolve.run.system import PreparedRun
from pdsolve.state import Broken

SMALL = 1e-6


def by_row_sum(tangent: csr_array) -> NDArray[np.float64]:
    """The smallest mass (n w,), N/m^4 s^2, at which a step of 1 s is surely stable, by Gershgorin's circles.

    It is a quarter of the row sums of |K|.
    """
    return np.asarray(abs(tangent).sum(axis=1)).ravel() / 4


def bonds_of(problem: PreparedRun) -> Bonds:
    """All its bonds at the start in one list, in the run's precision."""
    system = problem.system
    return in_precision(system.scheme.fill(system.model).whole().bonds, system.options.precision)


def forces(problem: PreparedRun, step: int = 1, dt: float = 1e-8) -> NDArray[np.float64]:
    """Force densities (n, w), N/m^3, of the state as it is; what is over its limit breaks in this `step` of `dt`, s."""
    out = np.zeros(problem.state.value.shape)
    problem.system.operator.accumulate_force(problem.state, out, step, dt)
    return out


def broken(problem: PreparedRun, after: int = 0) -> Broken:
    """The bonds broken after a step, in the order of steps, sources and targets, whatever the operator's own."""
    found = problem.system.operator.broken(after)
    order = np.lexsort((found.target, found.source, found.step))
    return Broken(*(column[order] for column in found))


def worst(problem: PreparedRun) -> NDArray[np.floating]:
    """The largest stretches that softened bonds remember, in the order of sources and targets."""
    kept = problem.system.operator.checkpoint_arrays()
    return kept["worst"][np.lexsort((kept["worst_target"], kept["worst_source"]))] if "worst" in kept else np.zeros(0)


def kept(problem: PreparedRun) -> dict[str, NDArray[Any]]:
    """A copy of what a checkpoint has."""
    return {name: values.copy() for name, values in make_checkpoint(*problem).items()}


def at_step(problem: PreparedRun, dt: float) -> PreparedRun:
    """The same from its start with steps of `dt`, s, be it stable or not."""
    system = problem.system
    run = msgspec.structs.replace(system.model.settings.run, time_step=dt)
    settings = msgspec.structs.replace(system.model.settings, run=run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return prepare_explicit_motion(
            dataclasses.replace(system.model, settings=settings), system.options, system.scheme
        )


def sources(bonds: Bonds) -> NDArray[np.int64]:
    """Row (b,) of the node whose bond it is."""
    return np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))


def matrix(problem: PreparedRun) -> csr_array:
    """K (2n, 2n), N/m^4: minus the force densities for small displacements, node i at rows 2i and 2i + 1."""
    rest = problem.state._replace(value=np.zeros(problem.state.value.shape))
    return problem.system.operator.tangent(rest)


def weighted(problem: PreparedRun) -> csr_array:
    """K times the nodes' areas, symmetric in the conservative mode, N/m^2 (a force per unit thickness and length)."""
    return diags_array(np.repeat(problem.system.area, 2)) @ matrix(problem)


def true_limit(problem: PreparedRun) -> float:
    """2 / omega_max, s, of a symmetric operator: what the step must be below."""
    mass = np.repeat(problem.system.model.rho * problem.system.area, 2)
    K = weighted(problem)
    scaled = diags_array(mass**-0.5) @ (K + K.T) / 2 @ diags_array(mass**-0.5)
    start = np.random.default_rng(1).standard_normal(len(mass))
    return float(2 / np.sqrt(eigsh(scaled, k=1, which="LA", v0=start, return_eigenvectors=False)[0]))


def equilibrium(problem: PreparedRun, held: NDArray[np.bool_], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 2) at rest under the loads of time 0, the components `held` (n, 2) being those of `at`: by
    Newton's method on a millionth of them, where the plate is as good as linear."""
    system, state = problem.system, problem.state
    rest = state._replace(value=np.zeros(state.value.shape), rate=np.zeros(state.value.shape))
    newton = Newton(system.operator, system.area, 1e-9, free_component_count=int((~held).sum()))
    newton.solve_equilibrium(
        rest, EquilibriumConditions(SMALL * system.drive.force, held, SMALL * np.where(held, at, 0.0)), lambda *_: None
    )
    return np.asarray(rest.value / SMALL)


def accelerate(problem: PreparedRun) -> None:
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
