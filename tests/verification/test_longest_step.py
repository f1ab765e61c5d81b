"""Steps as long as they may be: what the ledger misses then is not lost.

Its kinetic energy is that of whole steps' velocities. A mode of frequency w has (w dt / 2)^2 less of it there than it
should: near the bound nearly all, so that a plate under a sudden load seems to miss per cents.
With v^2 - (dt a / 2)^2, the product of both half steps' velocities, Verlet's steps keep the energy of a linear operator
to round-off (E. Hairer, C. Lubich, G. Wanner, Acta Numer. 12 (2003) 399-450).
"""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, Load, Run
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

CONDITIONS = (
    Displacement(box=(-1.0, -1.0, 0.5e-3, 1.0), x=0.0, y=0.0),
    Load(box=(22.5e-3, -1.0, 1.0, 1.0), body_force=(1e4, 0.0)),  # so small that bonds do not turn
)


def missed(material: dict[str, object], share: float, steps: int = 1500) -> tuple[float, float, float]:
    """Over the work of a sudden load, with a step of this share of the bound: the mean of what is missing in the first
    and in the last third, and the largest of what is missing with the velocities of half steps."""
    solid = msgspec.structs.replace(GLASS, **({"G0": 1e9} | material))
    model = plate(square_grid(24, 15), 3, material=solid, conditions=CONDITIONS)
    bound = prepare(model, Options(threads=1)).system.stable_time_step
    settings = msgspec.structs.replace(model.settings, run=Run(time_step=share * bound))
    system, state = prepare(dataclasses.replace(model, settings=settings), Options(threads=1, kernel="listed"))
    whole, half = [], []
    for step in range(5, steps + 1, 5):
        system.stepper.advance(state, step - 4, step + 1)
        now = compute_energy_balance_row(system, state, step)
        less = system.model.rho * system.area * ((share * bound / 2 * state.second) ** 2).sum(axis=1) / 2
        whole.append(now.kinetic + now.strain - now.work)
        half.append(whole[-1] - float(less.sum()))
    work, third = max(abs(compute_energy_balance_row(system, state, steps).work), 1e-300), len(whole) // 3
    most = float(np.ptp(half))  # what they begin with, of the load alone, stays
    return float(np.mean(whole[:third])) / work, float(np.mean(whole[-third:])) / work, most / work


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "material",
    [
        {},
        {"model": "ordinary", "nu": 0.3, "failure": "none"},
        pytest.param({"model": "correspondence", "nu": 0.3, "failure": "none"}, marks=pytest.mark.slow),
        {"model": "micropolar", "nu": 0.2, "failure": "none"},
    ],
    ids=["bond", "ordinary", "correspondence", "micropolar"],
)
def test_nothing_is_lost_near_the_longest_step(material: dict[str, object]) -> None:
    first, last, half = missed(material, 0.99)
    assert half <= 1e-10  # measured 5e-12, 4e-12 of bonds that turn, 2e-15, 8e-16
    assert 1e-3 <= -first <= 0.05  # measured 0.012, 0.012, 0.006, 0.004
    assert last == pytest.approx(first, rel=0.2)  # it does not grow
