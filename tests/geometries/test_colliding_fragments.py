"""Halves of a bar that break apart, come back from walls and collide."""

from __future__ import annotations

import numpy as np
import pytest
from plates import shipped

from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import compute_ledger_row
from pdsolve.run.prepare import prepare


@pytest.mark.slow
def test_fragments_exchange_velocities_and_make_no_energy() -> None:
    built = shipped("colliding_fragments.py")
    system, state = both = prepare(Model(built.grid, built.settings), Options(threads=1))
    x, own = system.model.grid.position[:, 0], system.model.grid.bodies.number == 0  # type: ignore[union-attr]

    def speeds(step: int, to: float) -> tuple[float, float, int]:
        last = int(to / system.time_step)
        both.advance(step, last)
        return state.rate[own & (x < 0), 0].mean(), state.rate[own & (x > 0), 0].mean(), last

    left, right, step = speeds(1, 0.55e-3)  # back from the walls
    assert (left, right) == (pytest.approx(0.88, abs=0.03), pytest.approx(-0.88, abs=0.03))
    left, right, step = speeds(step, 0.75e-3)
    assert (left, right) == (pytest.approx(-0.82, abs=0.04), pytest.approx(0.82, abs=0.04))
    source, target = system.operator.bonds()
    assert not (own[source] & (x[source] * x[target] < 0)).any()
    entry = compute_ledger_row(system, state, step)
    assert abs(entry.balance_error(system.initial_energy)) < 3e-3  # 2.2e-3: bonds that break book their own energy
    momentum = (system.area * system.model.rho)[own] @ state.rate[own]
    assert np.abs(momentum).max() < 1e-6 * entry.kinetic
