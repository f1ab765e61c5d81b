"""Beams: forces, moments and energy belong together, and a plate that marches keeps its energy."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import InitialVelocity, Run
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

BEAMS = msgspec.structs.replace(GLASS, model="micropolar", nu=0.2)


def made(*conditions: object, dt: float | None = None) -> PreparedRun:
    run = Run(time_step=dt)
    return prepare(plate(square_grid(11, 9), material=BEAMS, conditions=conditions, run=run), Options(threads=1))


@pytest.mark.slow
def test_forces_and_moments_are_minus_the_slope_of_energy_and_the_tangent_theirs() -> None:
    """Some bonds broken; along a random way of all unknowns."""
    system, state = made()
    random, area = np.random.default_rng(3), system.area[:, None]
    state.value[:] = 2e-6 * random.standard_normal(state.value.shape)
    out = np.zeros_like(state.value)
    system.operator.accumulate_force(state, out, 1, 0.0)
    assert len(system.operator.broken().step) > 0
    way, start, slope = random.standard_normal(out.shape), state.value.copy(), 0.0
    for side in (1, -1):
        state.value[:] = start + side * 1e-6 * way
        slope += side * float(np.sum(system.area * system.operator.energies(state)[0])) / 2e-6
    assert slope == pytest.approx(-float(np.sum(area * out * way)), rel=1e-9)  # energy is a square
    state.value[:] = way
    K = system.operator.tangent(state)
    system.operator.accumulate_force(state, out := np.zeros_like(way), 0, 0.0)
    assert K @ way.ravel() == pytest.approx(-out.ravel(), rel=1e-9, abs=1e-9 * np.abs(out).max())


@pytest.mark.slow
def test_a_turn_is_no_strain() -> None:
    """Of all nodes and of the plate by the same small angle."""
    system, state = made()
    x, y = system.model.grid.position.T
    horizon = system.model.horizons
    state.value[:] = 1e-6 * np.column_stack([-y, x, horizon])
    assert np.abs(system.operator.energies(state)[0]).max() <= 1e-20 * GLASS.E  # measured 0 to round-off
    fields = system.operator.fields(state)
    assert fields["rotation"] == pytest.approx(1e-6)


@pytest.mark.slow
def test_a_marching_plate_keeps_its_energy() -> None:
    start, lost = InitialVelocity(box=(-1.0, -1.0, 5e-3, 1.0), x=0.1), []
    for steps, dt in ((400, 1e-7), (800, 5e-8)):
        system, state = made(start, dt=dt)
        system.stepper.advance(state, 1, steps)
        found = compute_energy_balance_row(system, state, steps - 1)
        lost.append(abs(found.balance_error(system.initial_energy)))
        assert found.strain > 0
    assert lost[0] <= 1e-2
    assert lost[1] <= lost[0] / 3  # second order
