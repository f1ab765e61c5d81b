"""A block on an incline slides by g (sin a - mu cos a) t^2 / 2, and sticks where tan a < mu; the heat is mu N s."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bars import UNIT, grid_of

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, Load, Settings
from pdmesh.model.mechanical_conditions import Contact
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare

H, G, DURATION = 0.02, 1e-5, 60.0  # m, m/s^2, s


def cells(columns: int, rows: int, x: float, y: float) -> np.ndarray:
    """Nodes of a rectangle from a corner on."""
    along, up = np.meshgrid(x + H * (np.arange(columns) + 0.5), y + H * (np.arange(rows) + 0.5))
    return np.column_stack([along.ravel(), up.ravel()])


def slid(mu: float, angle: float) -> tuple[float, float, EnergyBalanceRow]:
    """How far a block of 15 x 6 nodes has come along a held one, m, the heat, J/m, and the ledger.

    It falls onto the held one, and would rattle there without a loss: friction makes 6 % less heat then.
    """
    grid = grid_of([cells(60, 4, 0, -4 * H), cells(15, 6, 0.2, 0)], H)
    below, block = tuple(grid.ids[:240].tolist()), tuple(grid.ids[240:].tolist())
    pull = Load(body_force=(G * np.sin(angle), -G * np.cos(angle)), nodes=block)
    conditions = (Displacement(x=0.0, y=0.0, nodes=below), pull)
    settings = Settings(material=UNIT, conditions=conditions, contact=Contact(friction=mu, restitution=0.5))
    system, state = prepared = prepare(Model(grid, settings), Options(threads=1))
    steps = int(DURATION / system.time_step)
    prepared.advance(1, steps + 1)
    assert system.contact is not None
    return (
        float(state.value[240:, 0].mean()),
        system.contact.friction(state),
        compute_energy_balance_row(system, state, steps),
    )


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_block_slides(mu: float) -> None:
    way, heat, last = slid(mu, 0.3)
    assert way == pytest.approx(G * (np.sin(0.3) - mu * np.cos(0.3)) * last.time**2 / 2, rel=0.01)  # 3e-9, .003
    assert heat == pytest.approx(mu * G * np.cos(0.3) * 90 * H**2 * way, rel=0.03)  # .019
    assert last.friction == heat
    assert abs(last.balance_error(0.0)) < 1e-3  # 8e-8, 2e-4


@pytest.mark.slow
def test_a_block_sticks() -> None:
    way, _, _ = slid(0.2, 0.1)
    assert way < 1e-4 * H  # 2e-5 H; without friction .1
