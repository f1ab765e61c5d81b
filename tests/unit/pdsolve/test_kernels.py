"""Forces against a few lines of numpy, and the books of a breaking bond."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from plates import plate, square_grid, two_scale_grid
from system_checks import bonds_of, forces

from pdmesh.model.document import Run
from pdsolve.bonds.assembly import Bonds, stiffness_bound
from pdsolve.conditions import drive
from pdsolve.laws.pair_laws import brittle
from pdsolve.operators.bond_list import BondList
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun
from pdsolve.state import State
from pdsolve.steppers.verlet import Verlet


def random_problem(mode: str = "conservative", precision: str = "float64", size: float = 1e-7) -> PreparedRun:
    """A two-scale plate with random displacements of this size, m."""
    problem = prepare(plate(two_scale_grid(), run=Run(time_step=1e-8)), Options(mode, precision))
    problem.state.value[:] = size * np.random.default_rng(1).standard_normal(problem.state.value.shape)
    return problem


def numpy_forces(problem: PreparedRun) -> np.ndarray:
    """The same from the definition, |xi + eta| - |xi| over |xi|."""
    bonds, u = bonds_of(problem), problem.state.value.astype(float)
    source = np.repeat(np.arange(len(u)), np.diff(bonds.start))
    reference = bonds.xi.astype(float)
    y = reference + u[bonds.neighbour] - u[source]
    xi, length = np.hypot(*reference.T), np.hypot(*y.T)
    pull = bonds.stiffness * (length - xi) / xi / length
    return np.column_stack([np.bincount(source, pull * y[:, axis], minlength=len(u)) for axis in (0, 1)])


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_forces_are_those_of_the_definition(mode: str) -> None:
    problem = random_problem(mode)
    expected = numpy_forces(problem)
    assert np.abs(forces(problem) - expected).max() <= 1e-10 * np.abs(expected).max()  # measured 3e-12


def test_single_precision_loses_nothing_to_cancellation() -> None:
    problem = random_problem(precision="float32")
    expected = numpy_forces(problem)
    assert np.abs(forces(problem) - expected).max() <= 3e-6 * np.abs(expected).max()  # measured 4e-7


def test_a_translation_and_a_turn_make_no_force() -> None:
    problem = random_problem(size=0.0)
    x = problem.system.model.grid.position
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    scale = np.abs(numpy_forces(random_problem(size=1e-3 * 1e-3))).max()
    problem.state.value[:] = x @ turn.T - x + [1e-3, 2e-3]
    assert np.abs(forces(problem)).max() <= 1e-8 * scale  # measured 6e-10


def two_nodes(stiffness: float, dt: float) -> tuple[BondList, Verlet, State]:
    """Two nodes 1 mm apart with a bond each way that is gone at a stretch of 1e-3, flying apart; no loads."""
    limits = np.full(2, 1e-3)
    bonds = Bonds(
        start=np.array([0, 1, 2]),
        neighbour=np.array([1, 0], dtype=np.int32),
        xi=np.array([[1e-3, 0.0], [-1e-3, 0.0]]),
        stiffness=np.full(2, stiffness),
        peak=limits,
        limit=limits,
        weight=np.ones(2),
    )
    model = plate(square_grid(2, 1))
    operator = BondList(brittle.LAW, model, bonds, symmetric=True)
    v = np.array([[-1.0, 0.0], [1.0, 0.0]])
    state = State(np.zeros((2, 2)), v, np.zeros((2, 2)), *np.zeros((3, 2)))
    return operator, Verlet(operator, drive(model, np.ones(2), True, np.float64), np.full(2, 1e3), dt), state


@pytest.mark.parametrize("dt", [8e-8, 4e-8, 2e-8, 1e-8])
def test_a_breaking_bond_takes_its_energy_along(dt: float) -> None:
    """What is booked, c xi s0^2 / 2, is what the motion loses, but for the square of the time step."""
    operator, verlet, state = two_nodes(1e12, dt)
    start = 1e3 / 2 * float((state.rate**2).sum())
    verlet.advance(state, 1, round(4e-6 / dt) + 1)
    assert len(set(operator.broken().step)) == 1
    spent = float(state.dissipated.sum())
    assert spent == pytest.approx(1e12 * 1e-3 * 1e-3**2 / 2, rel=1e-12)
    lost = start - 1e3 / 2 * float((state.rate**2).sum())
    assert lost == pytest.approx(spent, rel=6e-4 * (dt / 4e-8) ** 2)  # measured 2.4e-3, 4.6e-4, 5.8e-5, 2.8e-7


def test_a_bond_breaks_in_the_first_step_over_its_limit() -> None:
    operator, verlet, state = two_nodes(0.0, 0.95e-7)
    verlet.advance(state, 1, 20)
    assert operator.broken().step.tolist() == [6, 6]  # the stretch grows by 1.9e-4 a step


def test_the_bound_of_a_full_lattice() -> None:
    """By hand: the largest eigenvalue of sum k n n^T, and Silling and Askari's sum k, of the worst node."""
    problem = prepare(plate(two_scale_grid()), Options())
    bonds = bonds_of(problem)
    length = np.hypot(*bonds.xi.T)
    k, n = bonds.stiffness / length, bonds.xi / length[:, None]
    rows = list(pairwise(bonds.start))
    largest = max(np.linalg.eigvalsh(np.einsum("b,bi,bj->ij", k[a:b], n[a:b], n[a:b]))[-1] for a, b in rows)
    sum_of_all = max(k[a:b].sum() for a, b in rows)
    symmetric, any_bonds = (stiffness_bound(bonds, bonds.stiffness, kind).max() for kind in (True, False))
    assert symmetric == pytest.approx(largest, rel=1e-14)
    assert any_bonds == pytest.approx(sum_of_all, rel=1e-14)
    assert (
        problem.system.time_step
        == problem.system.stable_time_step
        == pytest.approx((2 * 2235.0 / largest) ** 0.5, rel=1e-14)
    )
