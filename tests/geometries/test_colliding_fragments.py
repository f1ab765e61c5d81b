"""Halves of a bar that break apart, come back from walls and collide."""

from __future__ import annotations

import numpy as np
import pytest
from plates import GEOMETRIES, shipped

from benchmarks.balance_rows import compute_energy_balance_row
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

SPEEDS = (0.8, 0.9, 1.0, 1.05, 1.1, 1.2)  # m/s: of each half; 1 m/s is the scene's own


@pytest.mark.slow
def test_fragments_exchange_velocities_and_make_no_energy() -> None:
    """Halves that bounce and collide, over six speeds, as rubble of the tear and of the collision is chaotic."""
    assert "speed = 1.0 " in (GEOMETRIES / "colliding_fragments.py").read_text()
    bounced, exchanged = np.transpose([_collide(speed) for speed in SPEEDS])
    assert (bounced.mean(), bounced.std()) == (pytest.approx(0.874, abs=0.02), pytest.approx(0.029, abs=0.02))
    assert (exchanged.mean(), exchanged.std()) == (pytest.approx(0.764, abs=0.04), pytest.approx(0.037, abs=0.03))


def _collide(speed: float) -> tuple[float, float]:
    """Mean speeds of the halves over their first one: back from the walls, and after they have met."""
    built = shipped("colliding_fragments.py", [("speed", str(speed))])
    system, state = both = prepare(Model(built.grid, built.settings), Options(threads=1))
    x, own = system.model.grid.position[:, 0], system.model.grid.bodies.number == 0  # type: ignore[union-attr]

    def advance(step: int, to: float) -> tuple[float, float, int]:
        last = int(to / speed / system.time_step)
        both.advance(step, last)
        momentum = (system.area * system.model.rho)[own] @ state.rate[own]
        left, right = (state.rate[own & side, 0].mean() / speed for side in (x < 0, x > 0))
        assert np.abs(momentum).max() < 1e-6 * compute_energy_balance_row(system, state, last).kinetic
        assert (left, right) == (pytest.approx(-right, rel=1e-6), pytest.approx(-left, rel=1e-6))
        return left, compute_energy_balance_row(system, state, last).balance_error(system.initial_energy), last

    bounced, balance, step = advance(1, 0.55e-3)
    assert bounced > 0
    assert abs(balance) < 8e-3  # 1.5e-4 to 5.4e-3: bonds that break book their own energy
    exchanged, balance, step = advance(step, 0.75e-3)
    assert exchanged < 0
    assert abs(balance) < 4e-2  # 1.1e-3 to 2.9e-2, the most in rubble
    source, target = system.operator.bonds()
    assert not (own[source] & (x[source] * x[target] < 0)).any()
    return bounced, -exchanged
