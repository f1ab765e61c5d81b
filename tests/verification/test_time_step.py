"""The largest stable time step: from the frequencies of the bonds, beside the bound that the solver goes by."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from periodic_plates import joined
from plates import GLASS, interface_grid, plate, square_grid
from scipy.sparse.linalg import eigs
from system_checks import accelerate, at_step, matrix, true_limit

from pdmesh.model.lattice_calibration import calibration
from pdmesh.reports.bonds_and_step import SURFACES, stable_step
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

ONE = Options(threads=1)
UNBREAKABLE = msgspec.structs.replace(GLASS, G0=1e12)


def growth(problem: PreparedRun, time_step: float, steps: int) -> float:
    """Largest displacement after some steps over that of a random start."""
    problem = at_step(problem, time_step)
    state = problem.state
    state.value[:] = 1e-60 * np.random.default_rng(1).standard_normal(state.value.shape)
    state.rate[:] = 0
    accelerate(problem)
    start = np.abs(state.value).max()
    problem.advance(1, steps + 1)
    return float(np.abs(state.value).max() / start)


def problem_of(scales: int, m: int, profile: str, mode: str = "conservative") -> PreparedRun:
    """A free plate of one or two scales."""
    grid = square_grid(25, 25) if scales == 1 else interface_grid(20, 8, 10)
    return prepare(
        plate(grid, m, material=msgspec.structs.replace(UNBREAKABLE, micromodulus=profile)), Options(mode, threads=1)
    )


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("scales", [1, 2])
@pytest.mark.parametrize(("m", "profile"), [(3, "constant"), (4, "constant"), (3, "conical"), (4, "conical")])
def test_the_bound_is_safe_and_not_far_off(scales: int, m: int, profile: str) -> None:
    """Published: the true limit is 1.6 to 1.73 times the bound of Silling and Askari. Symmetric bonds have the root of
    2 more of it within a lattice, and less at corrected edges."""
    problem = problem_of(scales, m, profile)
    limit = true_limit(problem)
    assert 1.1 <= limit / problem.system.stable_time_step <= 1.3  # measured 1.15 to 1.27
    assert growth(problem, 0.98 * limit, 400) < 50  # measured 0.54 to 0.82
    assert growth(problem, 1.02 * limit, 100) > 1e10  # measured 8e15 and more


@pytest.mark.slow
def test_the_bound_is_safe_whatever_pre_cracks_cut() -> None:
    """Plates that random cracks go through, some nodes with a bond or two left: stiffer, and known to be."""
    random = np.random.default_rng(0)
    whole = prepare(plate(square_grid(12, 12), 3, material=UNBREAKABLE), ONE).system.stable_time_step
    found = []
    for _ in range(60):
        start = random.uniform(0, 11e-3, (random.integers(1, 7), 2))
        cracks = np.column_stack([start, start + random.uniform(-6e-3, 6e-3, start.shape)])
        grid = dataclasses.replace(square_grid(12, 12), cracks=cracks)
        problem = prepare(plate(grid, 3, material=UNBREAKABLE), ONE)
        found.append((true_limit(problem) / problem.system.stable_time_step, problem.system.stable_time_step / whole))
    limits, bounds = np.array(found).T
    assert limits.min() >= 1 - 1e-9  # measured 1.000, where two nodes have only each other
    assert limits.max() <= 1.3  # measured 1.212
    assert bounds.min() >= 0.6  # measured 0.656


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("m", "profile"), [(3, "constant"), (4, "constant"), (3, "conical"), (4, "conical")])
def test_the_step_that_pdmesh_plans_with_is_the_shorter_one(m: int, profile: str) -> None:
    """Inside a lattice `pdmesh` has the solver's bound to round-off; what it takes off for edges is enough."""
    material = msgspec.structs.replace(UNBREAKABLE, micromodulus=profile)
    planned = stable_step(material, m, 1e-3)
    for scales in (1, 2):
        assert 0.94 <= planned / problem_of(scales, m, profile).system.stable_time_step <= 1  # measured 0.949 to 0.960
    whole = prepare(plate(square_grid(36, 36), m, material=material), Options(threads=1))
    endless = joined(whole, (12e-3, 12e-3, 24e-3, 24e-3))
    assert planned / SURFACES == pytest.approx(endless.system.stable_time_step, rel=1e-12)  # measured 1e-15


@pytest.mark.parametrize("scales", [1, 2])
def test_the_bound_of_one_sided_bonds(scales: int) -> None:
    """The thesis mode's operator is not symmetric; its bound holds for the largest eigenvalue's modulus."""
    problem = problem_of(scales, 4, "conical", "thesis")
    largest = np.abs(eigs(matrix(problem) / GLASS.rho, k=1, which="LM", return_eigenvectors=False))
    limit = float(2 / np.sqrt(largest[0]))
    assert 1.5 <= limit / problem.system.stable_time_step <= 1.8  # measured 1.66


def test_the_periodic_lattice() -> None:
    """12 x 12 nodes, m = 3, constant: 2 / omega_max = 1.9090 spacings * sqrt(rho / E), published."""
    material = msgspec.structs.replace(UNBREAKABLE, micromodulus="constant")
    whole = prepare(plate(square_grid(32, 32), 3, material=material), Options(threads=1))
    problem = joined(whole, (10e-3, 10e-3, 22e-3, 22e-3))
    unit = 1e-3 * (GLASS.rho / GLASS.E) ** 0.5 / calibration(3, material).stiffness ** 0.5
    limit = true_limit(problem)
    assert limit / unit == pytest.approx(1.9090, abs=5e-5)  # measured 1.9090
    assert growth(problem, 0.98 * limit, 600) < 50  # measured 0.69
    assert growth(problem, 1.02 * limit, 600) > 1e50  # measured 1e61
