"""Uniform strain must make no force inside a plate; where spacings meet it does, and this is how much."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, interface_grid, plate, square_grid
from system_checks import bonds_of, broken, matrix

from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

UNBREAKABLE = msgspec.structs.replace(GLASS, G0=1e12)
STRAINS = {"xx": [[1.0, 0.0], [0.0, 0.0]], "yy": [[0.0, 0.0], [0.0, 1.0]], "xy": [[0.0, 0.5], [0.5, 0.0]]}


def residual(problem: PreparedRun, strain: str, delta: float) -> NDArray[np.float64]:
    """Force densities (n, 2) under a small uniform strain, in E * strain / delta."""
    position, E = problem.system.model.grid.position, problem.system.model.materials[0].E
    u = position @ np.array(STRAINS[strain]).T
    return np.asarray((matrix(problem) @ u.ravel()).reshape(-1, 2) * delta / E)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("m", [3, 4])
def test_no_force_inside_one_scale(mode: str, profile: str, m: int) -> None:
    """Three horizons from the edges, beyond the reach of the surface correction, for the three strains."""
    side = 6 * (m + 1) + 3
    model = plate(square_grid(side, side), m, material=msgspec.structs.replace(GLASS, micromodulus=profile))
    problem = prepare(model, Options(mode))
    for strain in STRAINS:
        force = residual(problem, strain, 1e-3).reshape(side, side, 2)
        deep = 3 * (m + 1)
        assert np.abs(force[deep:-deep, deep:-deep]).max() <= 1e-13  # measured 9e-15
        assert np.abs(force).max() > 0.01  # the edges, which no load holds


def marched(problem: PreparedRun, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force densities (n, 2) by the kernel that marches: of one step from rest, in which nothing moves yet."""
    problem.state.value[:] = u
    problem.advance(1, 2)
    assert np.array_equal(problem.state.value, u)
    assert not len(broken(problem).step)
    return np.asarray(problem.system.model.rho[:, None] * problem.state.second)


@pytest.mark.parametrize("kernel", ["blocks", "listed"])
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_finite_uniform_strain_inside_one_scale(mode: str, kernel: str) -> None:
    """The same by the marching kernels, at 1 per cent of strain, where bonds are no longer linear."""
    side = 27
    problem = prepare(plate(square_grid(side, side), 4, material=UNBREAKABLE), Options(mode, kernel=kernel))
    assert problem.system.operator.name == kernel
    force = marched(problem, problem.system.model.grid.position @ np.array([[0.004, 0.003], [-0.001, 0.006]]).T)
    pull = bonds_of(problem).stiffness.max() * 0.004
    assert np.abs(force[(side * side - 1) // 2]).max() <= 1e-12 * pull  # measured 2e-14
    assert np.abs(force).max() > pull  # the edges


# Largest force at an interface of 1 and 2 mm, in E * strain / 2 mm, for the strains xx, yy and xy. Neither mode passes
# this patch test: the horizon changes there, and only a wave much longer than it does not mind.
INTERFACE = {
    ("thesis", 3, "constant"): (0.4494, 0.1066, 0.1066),
    ("thesis", 4, "constant"): (0.1369, 0.1160, 0.1160),
    ("thesis", 4, "conical"): (0.4018, 0.1920, 0.1920),
    ("conservative", 3, "constant"): (0.2826, 0.0889, 0.0889),
    ("conservative", 4, "constant"): (0.2017, 0.0917, 0.0917),
    ("conservative", 4, "conical"): (0.2725, 0.0916, 0.0916),
}


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("mode", "m", "profile"), INTERFACE)
def test_force_at_an_interface(mode: str, m: int, profile: str) -> None:
    """Written down, not wished for: a change of the scheme shows here."""
    columns = 6 * (m + 1)
    grid = interface_grid(2 * columns, columns, 4 * m + 8)
    material = msgspec.structs.replace(GLASS, micromodulus=profile)
    problem = prepare(plate(grid, m, material=material), Options(mode))
    x, y = grid.position.T
    near = (np.abs(x) < 6e-3 * m) & (np.abs(y - np.median(y)) < 2e-3)  # a period of rows, far from the edges
    found = [float(np.abs(residual(problem, strain, 2e-3)[near]).max()) for strain in STRAINS]
    assert found == pytest.approx(INTERFACE[mode, m, profile], abs=1e-4)


@pytest.mark.parametrize("kernel", ["blocks", "listed"])
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_a_rigid_motion_makes_no_force_at_an_interface(mode: str, kernel: str) -> None:
    """A turn by 40 degrees and a shift, by the marching kernels, at all nodes."""
    problem = prepare(plate(interface_grid(12, 6, 8), 3), Options(mode, kernel=kernel))
    assert problem.system.operator.name == kernel
    x, angle = problem.system.model.grid.position, np.radians(40)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    force = marched(problem, x @ turn.T - x + [1e-3, -2e-3])
    assert np.abs(force).max() <= 1e-12 * bonds_of(problem).stiffness.max()  # measured 1e-14
