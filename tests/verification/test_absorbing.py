"""Edges that absorb waves: how much of a pulse's energy comes back from a layer of usual depth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from periodic_plates import joined
from plates import GLASS, plate, square_grid
from system_checks import accelerate, at_step

from pdmesh.model.document import Absorb
from pdmesh.scene.scene import DEEP
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

DELTA, RATIO = 1e-3, 4
HORIZON = RATIO * DELTA
WIDTH = 2 * HORIZON  # of the pulse exp(-(s / width)^2)
SPEED = {"P": (1.125 * GLASS.E / GLASS.rho) ** 0.5, "S": (0.375 * GLASS.E / GLASS.rho) ** 0.5}  # m/s


def send(problem: PreparedRun, kind: str, n: NDArray[np.float64], middle: NDArray[np.float64], across: float) -> None:
    """Put a pulse at `middle` that goes along n, and as 1 / e of it to both sides as `across`, m."""
    state, x = problem.state, problem.system.model.grid.position - middle
    s, q = x @ n / WIDTH, x @ [-n[1], n[0]] / across
    shape, along = 1e-6 * np.exp(-(s**2) - q**2), n if kind == "P" else np.array([-n[1], n[0]])
    state.value[:] = shape[:, None] * along
    state.rate[:] = (2 * s / WIDTH * SPEED[kind] * shape)[:, None] * along
    accelerate(problem)


def energy(problem: PreparedRun, edge: float) -> float:
    """Energy left of the layer, J/m."""
    system, state = problem.system, problem.state
    moving = system.model.rho / 2 * (state.rate.astype(float) ** 2).sum(axis=1)
    held = system.operator.energies(state)[0]
    return float(((moving + held) * system.area)[system.model.grid.position[:, 0] < edge].sum())


def layer(edge: float) -> Absorb:
    return Absorb(box=(edge + DELTA / 4, -1e3, 1e3, 1e3))


def straight_back(kind: str, deep: float) -> float:
    """The share of a pulse that meets a layer this deep (m) head-on."""
    edge = 12 * WIDTH
    grid = square_grid(round((edge + deep) / DELTA), 4 * RATIO, DELTA)
    conditions = (layer(edge),) if deep else ()
    problem = prepare(plate(grid, RATIO, conditions=conditions), Options(threads=1))
    problem = joined(problem, (-np.inf, 3.75 * DELTA, np.inf, 11.75 * DELTA))
    problem = at_step(problem, 0.5 * problem.system.stable_time_step)
    send(problem, kind, np.array([1.0, 0.0]), np.array([edge / 2, 0.0]), np.inf)
    sent = energy(problem, edge)
    problem.advance(1, round((edge + 2 * deep) / SPEED[kind] / problem.system.time_step) + 1)
    return energy(problem, edge) / sent


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("kind", "known"), [("P", 0.0051), ("S", 0.0074)])
def test_little_comes_straight_back(kind: str, known: float) -> None:
    found = straight_back(kind, DEEP * HORIZON)
    assert found < 0.01
    assert found == pytest.approx(known, rel=0.05)


def test_all_comes_back_without() -> None:
    assert straight_back("P", 0.0) == pytest.approx(1, abs=1e-3)


def slantwise(kind: str, deep: float) -> float:
    """The share left of a pulse, 16 of its widths across, that has met a layer this deep at 45 degrees."""
    across = 4 * WIDTH
    reach = 2.6 * across
    edge, height = 1.9 * reach, 5 * reach
    grid = square_grid(round((edge + deep) / DELTA), round(height / DELTA), DELTA)
    problem = prepare(plate(grid, RATIO, conditions=(layer(edge),)), Options())
    problem = at_step(problem, 0.6 * problem.system.stable_time_step)
    send(problem, kind, np.sqrt([0.5, 0.5]), np.array([edge - 0.9 * reach, 1.05 * reach]), across)
    sent = energy(problem, edge)
    problem.advance(1, round(3.2 * 0.9 * reach * np.sqrt(2) / SPEED[kind] / problem.system.time_step) + 1)
    return energy(problem, edge) / sent


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "known"), [("P", 0.0085), ("S", 0.0206)])
def test_what_comes_back_at_45_degrees(kind: str, known: float) -> None:
    """Above a layer four times as deep: what is left there are waves that the pulse sheds on its way."""
    usual, deeper = (slantwise(kind, times * DEEP * HORIZON) for times in (1, 4))
    assert usual - deeper == pytest.approx(known, rel=0.1)
