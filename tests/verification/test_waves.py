"""Waves without edges: the lattice's dispersion in the marching solver, and the speeds of long waves."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from periodic_plates import joined
from plates import GLASS, plate, square_grid
from system_checks import accelerate, at_step

from pdmesh.model.document import Material
from pdmesh.model.lattice_calibration import calibration, hu_beta, offsets
from pdmesh.model.material_constants import micromodulus
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

UNIT = Material(E=1.0, rho=1.0, G0=1.0)


def symbol(m: float, profile: str, k: tuple[float, float], partial: bool) -> np.ndarray:
    """sum c n n^T (1 - cos k.xi) / |xi| (2, 2) of a lattice of spacing 1 with partial cells, or with whole ones up to
    the horizon: omega^2 rho, for E = 1."""
    material = msgspec.structs.replace(UNIT, micromodulus=profile)
    xi = offsets(m + 0.5 if partial else m)
    length, horizon = np.hypot(*xi.T), np.full(len(xi), float(m))
    c = micromodulus(material, length, horizon)
    if partial:
        c *= hu_beta(length, horizon, np.ones(len(xi)))
    n = xi / length[:, None]
    weight = c / length * (1 - np.cos(xi @ np.array(k)))
    return np.asarray(np.einsum("b,bi,bj->ij", weight, n, n))


# m, micromodulus: speeds of long waves with partial cells, in sqrt(E / rho); the continuum has 1.0607 and 0.6124
SPEEDS = {(3, "constant"): (1.0779, 0.6070), (4, "constant"): (1.0690, 0.6135), (4, "conical"): (1.0505, 0.6002)}


@pytest.mark.parametrize(("m", "profile"), SPEEDS)
def test_speeds_of_long_waves(m: int, profile: str) -> None:
    """c_P and c_S of the uncalibrated lattice along a row, to the four printed digits."""
    k = 1e-3
    found = np.sqrt(np.diag(symbol(m, profile, (k, 0.0), True))) / k
    assert found == pytest.approx(SPEEDS[m, profile], abs=6e-5)  # measured: all digits


def ring(m: int, profile: str, nodes: int) -> PreparedRun:
    """A strip of the conservative mode's lattice that repeats itself upwards every row and along x after `nodes`."""
    side = nodes + 6 * m + 8
    material = msgspec.structs.replace(GLASS, micromodulus=profile)
    whole = prepare(plate(square_grid(side, 6 * m + 9), m, material=material), Options(threads=1))
    x0, y0 = 1e-3 * (3 * m + 4), 1e-3 * (3 * m + 4)
    return joined(whole, (x0, y0, x0 + 1e-3 * nodes, y0 + 1e-3))


def frequency(problem: PreparedRun, waves: int, axis: int, periods: float, share: float) -> tuple[float, float]:
    """Angular frequency of a standing wave of `waves` in the ring, marched at `share` of the bound, and the step."""
    nodes = len(problem.system.model.grid)
    problem = at_step(problem, share * problem.system.stable_time_step)
    x, state = np.arange(nodes), problem.state
    shape = np.cos(2 * np.pi * waves * x / nodes)
    state.value[:, axis] = 1e-12 * shape  # small: a wave of finite size changes its own frequency
    accelerate(problem)
    guess = np.sqrt(-state.second[0, axis] / state.value[0, axis])
    seen = []
    steps = round(periods * 2 * np.pi / guess / problem.system.time_step)
    for step in range(1, steps + 1):
        problem.advance(step, step + 1)
        seen.append(float(state.value[:, axis] @ shape) / float(shape @ shape) / 1e-12)
    # cos((n + 1) w dt) + cos((n - 1) w dt) = 2 cos(w dt) cos(n w dt), by least squares
    c = np.array([1.0, *seen])
    cosine = float((c[2:] + c[:-2]) @ c[1:-1] / (2 * c[1:-1] @ c[1:-1]))
    return float(np.arccos(cosine)) / problem.system.time_step, problem.system.time_step


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("m", "profile"), SPEEDS)
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("waves", [1, 5, 12, 24])
def test_dispersion(m: int, profile: str, axis: int, waves: int) -> None:
    """A standing wave (axis 0: P, 1: S) marched by the solver has the lattice's frequency, less Verlet's own error.

    Verlet turns omega into 2 asin(omega dt / 2) / dt. 48 nodes: waves of 48, 9.6, 4 and 2 spacings.
    """
    problem = ring(m, profile, 48)
    omega, dt = frequency(problem, waves, axis, 3.0, 0.8)
    partial = profile == "constant"  # the conservative mode counts a conical family's cells in full
    factor = calibration(m, problem.system.model.materials[0], partial).stiffness
    rho_omega2 = factor * symbol(m, profile, (2 * np.pi * waves / 48, 0.0), partial)[axis, axis]
    lattice = np.sqrt(rho_omega2 * GLASS.E / GLASS.rho) / 1e-3
    assert omega == pytest.approx(2 / dt * np.arcsin(lattice * dt / 2), rel=1e-10)  # measured 5e-14
    if waves == 1:  # and nearly the speed of the continuum
        classical = np.sqrt((1.125, 0.375)[axis] * GLASS.E / GLASS.rho)
        assert omega / (2 * np.pi / 48e-3) == pytest.approx(classical, rel=0.015)  # measured 1.4e-2
