"""What damping takes is booked apart from what bonds spend, to round-off, and outlives an interruption."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from database_contents import contents
from node_clouds import idle
from numpy.typing import NDArray
from plates import plate, square_grid

from pdmesh.model.document import Absorb, InitialVelocity, Run, Velocity
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.state import State, zero_state
from pdsolve.steppers.verlet import Verlet

pytestmark = pytest.mark.filterwarnings("ignore:.*which no crack dissipated")
RATE = 3e5  # 1/s
EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)


def drifting(**run: Any) -> Model:
    """A free plate that moves as one."""
    moving = (InitialVelocity(box=EVERYWHERE, x=3.0, y=-4.0),)
    return plate(square_grid(9, 5), conditions=moving, run=Run(time_step=1e-7, steps=40, every=40, ledger=1, **run))


@pytest.mark.slow
@pytest.mark.parametrize(("precision", "off"), [("float64", 1e-12), ("float32", 1e-5)])
def test_a_plate_that_drifts_loses_what_is_booked(precision: str, off: float) -> None:
    """Its velocity falls by (1 - c dt / 2) / (1 + c dt / 2) a step; what Verlet keeps is m (dt a)^2 / 8 less than the
    kinetic energy, a being c v."""
    with simulate(drifting(damping=RATE), None, Options(precision=precision, threads=1)) as results:
        history, begun = results.history(), results.meta()["initial_energy"]
    half = RATE * 1e-7 / 2
    slower = ((1 - half) / (1 + half)) ** history["step"]
    assert history["kinetic"] == pytest.approx(begun * slower**2, rel=10 * off)
    kept = 1 - half**2
    assert history["kinetic"] * kept + history["damped"] == pytest.approx(begun * kept, rel=off)
    assert history["damped"][-1] > 0.5 * begun
    assert not history["dissipated"].any()
    assert not history["strain"].max() > off * begun


@pytest.mark.slow
def test_a_bar_that_swings_balances_as_well_as_an_undamped_one() -> None:
    """Pulled and let swing: what is amiss falls with the step's square, damped or not."""
    pull = (InitialVelocity(box=(4.5e-3, -1.0, 1.0, 1.0), x=1.0), Velocity(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0))
    amiss = []
    for step, damping in ((4e-8, 0.0), (4e-8, RATE), (2e-8, RATE)):
        run = Run(time_step=step, steps=round(1.6e-5 / step), every=1000, ledger=1, damping=damping)
        with simulate(plate(square_grid(10, 4), conditions=pull, run=run), None, Options(threads=1)) as results:
            history, begun = results.history(), results.meta()["initial_energy"]
        there = history["kinetic"] + history["strain"] + history["damped"] - history["work"] - begun
        amiss.append(np.abs(there).max() / begun)
        assert not history["dissipated"].any()
        assert (history["damped"][-1] > 0.5 * begun) == (damping > 0)
    assert amiss[1] < 1.5 * amiss[0]
    assert amiss[2] == pytest.approx(amiss[1] / 4, rel=0.2)


@pytest.mark.slow
def test_a_layer_takes_what_a_pulse_carries() -> None:
    """A strip that half moves sends its energy into the layers at both ends, and is left with little."""
    ends = tuple(Absorb(box=(x, -1.0, x + 0.02, 1.0)) for x in (-1e-4, 0.06 - 1e-4))
    struck = (InitialVelocity(box=(0.035, -1.0, 0.045, 1.0), x=1.0), *ends)
    run = Run(time_step=5e-8, steps=600, every=600)
    with simulate(plate(square_grid(81, 4), conditions=struck, run=run), None, Options(threads=1)) as results:
        last, begun, summary = results.history()[-1], results.meta()["initial_energy"], results.summary()
    left = last["kinetic"] + last["strain"]
    assert left < 0.1 * begun
    assert last["damped"] == pytest.approx(begun - left, rel=1e-3)
    assert last["dissipated"] == 0
    assert summary["energy"]["damped"] == last["damped"]


@pytest.mark.slow
def test_an_interrupted_run_books_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = drifting(damping=RATE)
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    stopped, whole = tmp_path / "stopped.sqlite", tmp_path / "whole.sqlite"
    simulate(model, stopped, Options(threads=1), lambda progress: progress.step == 17).close()
    with Results.open(stopped) as results:
        assert results.checkpoint()[1]["damped"].all()
    resume(stopped, 1).close()
    simulate(model, whole, Options(threads=1)).close()
    assert contents(stopped) == contents(whole)


class Joining:
    """Two nodes without forces, the second of which is given the motion of the first amid a step."""

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Give it."""
        for field in state[:3]:
            field[1] = field[0]


def test_a_node_that_is_born_amid_a_step_is_damped_as_its_twin() -> None:
    """By the velocities of both ends of the step, of which it had none at the beginning."""
    state, rho, damping = zero_state(2, 2), np.full(2, 1e3), np.full(2, RATE)
    state.rate[0] = 3.0, -4.0
    state.second[0] = -RATE * state.rate[0]
    Verlet(Joining(), idle(2, 2), rho, 1e-7, damping).advance(state, 1, 2)
    assert state.damped[0] > 0
    for field in (*state[:3], state.damped):
        assert np.array_equal(field[1], field[0])


ACTIVE = np.array([0, 3])


class Pulling:
    """A constant force on the active ones of five nodes."""

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add it."""
        out[ACTIVE] += 1e8


@pytest.mark.parametrize("damping", [0.0, RATE])
def test_idle_rows_stay_as_they_are_and_active_ones_move_as_always(damping: float) -> None:
    """To the bit, damped or not."""
    rho, rates, states = np.full(5, 1e3), np.full(5, damping), []
    for rows in (None, ACTIVE):
        state = zero_state(5, 2)
        for field in state[:3]:
            field[:] = np.random.default_rng(0).standard_normal((5, 2))
        states.append([field.copy() for field in state])
        Verlet(Pulling(), idle(5, 2), rho, 1e-7, rates, active_rows=lambda rows=rows: rows).advance(state, 1, 4)
        states.append(list(state))
    _, moved, begun, found = states
    for one, first, field in zip(found, begun, moved, strict=True):
        assert np.array_equal(one[ACTIVE], field[ACTIVE])
        assert np.array_equal(one[[1, 2, 4]], first[[1, 2, 4]])
    assert not np.array_equal(moved[0], begun[0])
