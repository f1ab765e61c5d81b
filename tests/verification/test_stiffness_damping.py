"""Damping proportional to stiffness: modes of a bar decay as they should, at steps that are stable."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import plate, square_grid
from scipy.sparse import diags_array
from scipy.sparse.linalg import eigsh

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Run
from pdsolve.model import Model, ModelError
from pdsolve.operators.stiffness_damping import damped_stable_time_step
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

RATIO = 0.05  # of critical damping, of the lowest mode
MODE = 3  # of a free plate: those below are rigid


def bar(**run: object) -> Model:
    """A free bar of 4 x 24 nodes."""
    return plate(square_grid(4, 24), run=Run(**run))  # type: ignore[arg-type]


def lowest_mode(prepared: PreparedRun) -> tuple[float, NDArray[np.float64]]:
    """The lowest angular frequency, 1/s, of a free bar that bends, and its mode (n, 2)."""
    (system, state), width = prepared, prepared.state.value.shape[1]
    mass = np.repeat(system.model.rho, width)
    scaled = diags_array(mass**-0.5) @ system.operator.tangent(state) @ diags_array(mass**-0.5)
    squares, modes = eigsh(scaled, k=MODE + 1, sigma=-1e8, v0=np.ones(len(mass)))
    order = np.argsort(squares)
    return float(np.sqrt(squares[order[MODE]])), (modes[:, order[MODE]] / mass**0.5).reshape(-1, width)


@pytest.mark.parametrize(
    ("kernel", "damping", "expected"), [("listed", 0.0, RATIO), (None, 0.0, RATIO), ("listed", 0.02, RATIO + 0.02)]
)
def test_a_mode_decays_by_its_damping_ratio(kernel: str | None, damping: float, expected: float) -> None:
    """By exp(-ratio w t) in displacement with the ratio beta w / 2, and alpha / (2 w) of what is proportional to mass.

    Rayleigh: u'' + (alpha + beta w^2) u' + w^2 u = 0.
    """
    omega, mode = lowest_mode(prepare(bar(), Options(threads=1, kernel=kernel)))
    model = bar(damping_time=2 * RATIO / omega, damping=2 * damping * omega)
    system, state = prepare(model, Options(threads=1, kernel=kernel))
    state.rate[:] = 1e-3 * mode / np.abs(mode).max()
    weight = mode * (system.model.rho * system.area)[:, None]
    periods = 3
    steps = round(periods * 2 * np.pi / omega / system.time_step)
    started = float((weight * state.rate).sum())
    system.stepper.advance(state, 1, steps + 1)
    time, damped_omega = steps * system.time_step, omega * np.sqrt(1 - expected**2)
    fraction = np.exp(-expected * omega * time)
    expected_rate = fraction * (
        np.cos(damped_omega * time) - expected * omega / damped_omega * np.sin(damped_omega * time)
    )
    assert float((weight * state.rate).sum()) / started == pytest.approx(expected_rate, rel=5e-3)


def test_the_energy_taken_is_booked() -> None:
    """Kinetic, strain and damped energy add up to what the bar began with; rigid motion is not damped."""
    omega, mode = lowest_mode(prepare(bar(), Options(threads=1)))
    system, state = prepare(bar(damping_time=2 * RATIO / omega), Options(threads=1))
    rows = []
    for rigid, motion in ((False, mode), (True, np.ones_like(mode))):
        system, state = prepare(bar(damping_time=2 * RATIO / omega), Options(threads=1))
        state.rate[:] = 1e-3 * motion / np.abs(motion).max()
        start = compute_energy_balance_row(system, state, 0).kinetic
        system.stepper.advance(state, 1, 401)
        row = compute_energy_balance_row(system, state, 400)
        assert row.kinetic + row.strain + row.damped == pytest.approx(start, rel=1e-3)
        rows.append(row.damped / start)
        assert rigid == (rows[-1] < 1e-12)
    assert rows[0] > 0.05


def test_a_bar_that_turns_is_not_damped() -> None:
    """Through a quarter turn: damping by the directions of the undeformed bonds took 99 % of the energy."""
    undamped = prepare(bar(), Options(threads=1)).system.stable_time_step
    system, state = prepare(bar(damping_time=0.5 * undamped), Options(threads=1))
    away = system.model.grid.position - system.model.grid.position.mean(axis=0)
    quarter = 4000  # steps
    turn = np.pi / 2 / (quarter * system.time_step)  # 1/s
    state.rate[:] = turn * np.column_stack([-away[:, 1], away[:, 0]])
    mass = system.model.rho * system.area

    def angular_momentum() -> float:
        place = away + state.value
        return float((mass * (place[:, 0] * state.rate[:, 1] - place[:, 1] * state.rate[:, 0])).sum())

    start, kinetic = angular_momentum(), compute_energy_balance_row(system, state, 0).kinetic
    system.stepper.advance(state, 1, quarter + 1)
    row = compute_energy_balance_row(system, state, quarter)
    direction = (away + state.value)[-1] - (away + state.value)[0]
    first = away[-1] - away[0]
    assert abs(float(first @ direction)) < 0.02 * float(first @ first)  # it has turned by 90 degrees
    assert angular_momentum() == pytest.approx(start, rel=1e-12)  # measured 3e-15
    assert row.kinetic == pytest.approx(kinetic, rel=1e-3)  # measured 4e-5


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_the_stable_step_is_that_of_lagging_velocities(ratio: float) -> None:
    """Of one mode: its step matrix has the spectral radius 1 at the stable step, and more beyond it."""
    omega, beta = 2.0, ratio
    step = damped_stable_time_step(2 / omega, beta)

    def radius(dt: float) -> float:
        """Of (u, v in the middle of the step before) to those a step later, with the damping force of that v."""
        force = np.array([-(omega**2), -beta * omega**2])
        rate = np.array([0.0, 1.0]) + dt * force
        return float(np.abs(np.linalg.eigvals(np.array([np.array([1.0, 0.0]) + dt * rate, rate]))).max())

    assert step == pytest.approx((np.sqrt(1 + (beta * omega / 2) ** 2) - beta * omega / 2) * 2 / omega)
    assert radius(step) == pytest.approx(1, abs=1e-9)
    assert radius(1.01 * step) > 1 + 1e-3


def test_the_step_of_a_run_is_stable() -> None:
    """With a time that halves it."""
    undamped = prepare(bar(), Options(threads=1)).system.stable_time_step
    system, state = prepare(bar(damping_time=0.75 * undamped), Options(threads=1))
    assert system.time_step == system.stable_time_step == pytest.approx(undamped / 2)
    state.rate[:] = np.random.default_rng(1).normal(size=state.rate.shape)
    start = compute_energy_balance_row(system, state, 0).kinetic
    system.stepper.advance(state, 1, 1001)
    assert compute_energy_balance_row(system, state, 1000).kinetic < start


def test_zones_are_refused() -> None:
    model = bar(damping_time=1e-7)
    run = msgspec.structs.replace(model.settings.run, adapt="hybrid")
    zoned = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with pytest.raises(ModelError, match="damping_time"):
        prepare(zoned, Options(threads=1))
