"""Damping and layers that absorb, in a plate whose fine zone moves."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate
from zoned_plates import again, rectangle, struck

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Absorb, Displacement, Run
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.conditions import initial_velocity
from pdsolve.model import Model
from pdsolve.numerics.thread_team import cores
from pdsolve.options import Options
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun, create_system_if_zone_changed
from pdsolve.zone.cells import COARSE, FINE

FLAT = Displacement(box=(-1.0, -1.0, 1.0, 1.0), y=0.0)
LAYER = Absorb(box=(0.08 - 1e-5, -1.0, 1.0, 1.0))  # a fifth of the plate


def damped(adapt: str, damping: float = 3e3) -> Model:
    """The struck plate of steel, damped, with a layer at the edge opposite to the struck one."""
    model = struck(adapt)
    run = msgspec.structs.replace(model.settings.run, damping=damping)
    conditions = (*model.settings.conditions, LAYER)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run, conditions=conditions))


def hybrid(problem: PreparedRun) -> HybridEngine:
    """The operator of a hybrid run."""
    found = problem.system.moving_zone_operator
    assert found is not None
    return found.engine


def ledger(problem: PreparedRun, step: int) -> EnergyBalanceRow:
    """The books of the nodes there are now."""
    change = create_system_if_zone_changed(problem.system) if problem.system.moving_zone_operator is not None else None
    system, state = problem if change is None else (change.system, change.state)
    return compute_energy_balance_row(system, state, step)


@pytest.mark.slow
def test_fine_everywhere_it_is_the_uniform_plate() -> None:
    """With all cells fine, the motion and the energy taken are those of the uniform plate."""
    one, other = prepare(damped("hybrid"), Options(threads=1)), prepare(damped("none"), Options(threads=1))
    run = hybrid(one)
    run.zone.cell_kinds[run.zone.cell_kinds == COARSE] = FINE
    run.initialize_motion_and_forces(initial_velocity(damped("hybrid")))
    for problem in (one, other):
        problem.advance(1, 31)
    place = run.plate.fine_places
    scale = np.abs(other.state.rate).max()
    assert np.abs(run.zone.fine.v[:, place].T - other.state.rate).max() < 1e-12 * scale  # 1.6e-14
    fine, uniform = ledger(one, 30), ledger(other, 30)
    assert uniform.damped > 0.01 * uniform.work
    assert fine.damped == pytest.approx(uniform.damped, rel=1e-9)
    assert fine.work == pytest.approx(uniform.work, rel=1e-9)


@pytest.mark.slow
def test_the_books_balance() -> None:
    """What damping takes is near that of the uniform plate, and the energy is all there."""
    found = {}
    for adapt in ("none", "hybrid"):
        problem = prepare(damped(adapt), Options(threads=1))
        problem.advance(1, 121)  # before a crossed cell becomes fine, which costs some tenths of a per cent
        found[adapt] = ledger(problem, 120)
    one, other = found["hybrid"], found["none"]
    assert one.damped > 0.2 * one.work
    assert one.damped / one.work == pytest.approx(other.damped / other.work, rel=0.02)  # 0.2456, 0.2429
    assert abs(one.balance_error(0.0)) < 3e-3  # 1.6e-3


def returned(*conditions: Any) -> float:
    """The share of the energy of a pulse in a coarse strip that is left after it has met the far edge."""
    grid = rectangle(160, 8, 1e-3)
    model = plate(grid, 4, conditions=(FLAT, *conditions), run=Run(steps=400, every=400, adapt="hybrid"))
    problem = prepare(model, Options(threads=1))
    run = hybrid(problem)
    run.zone.cell_kinds[run.zone.cell_kinds == FINE] = COARSE
    shown = again(run)
    speed, width = (1.125 * GLASS.E / GLASS.rho) ** 0.5, 8e-3

    def shape(x: Any, times: float) -> Any:
        s = (x - 0.06) / width
        return 1e-7 * np.exp(-(s**2)) * (1.0, 2 * s / width * speed)[int(times)]

    shown.put(*(lambda x, y, n=n: np.array([shape(x, n), 0 * x]) for n in (0, 1)))
    sent = shown.energy()
    shown.advance(1, round(0.17 / speed / shown.lattice.dt) + 1)
    return shown.energy() / sent


@pytest.mark.slow
def test_a_layer_absorbs_a_pulse() -> None:
    """In coarse cells: without a layer all of it comes back, with one of 48 mm as
    little as in fine nodes (`test_absorbing`)."""
    assert returned() == pytest.approx(1.0, abs=1e-3)  # 1.0002
    assert returned(Absorb(box=(0.112 + 2.5e-4, -1.0, 1.0, 1.0))) == pytest.approx(0.0051, rel=0.05)  # 0.0052


@pytest.mark.slow
def test_it_goes_on_to_the_same_bits() -> None:
    """From a checkpoint, and whether or not a march is interrupted between."""
    whole = prepare(damped("hybrid"), Options(threads=1))
    whole.advance(1, 91)
    kept = hybrid(whole).checkpoint_arrays()
    whole.advance(91, 101)
    whole.advance(101, 131)
    resumed = prepare(damped("hybrid"), Options(threads=1))
    hybrid(resumed).restore(kept)
    hybrid(resumed).advance(91, 131)
    same(hybrid(whole), hybrid(resumed))


@pytest.mark.slow
@pytest.mark.skipif(cores() < 2, reason="one core")
def test_threads_do_not_show() -> None:
    """One thread and two come to the same bits."""
    runs = []
    for threads in (1, 2):
        problem = prepare(damped("hybrid"), Options(threads=threads))
        problem.advance(1, 101)
        problem.advance(101, 131)
        runs.append(hybrid(problem))
    same(*runs)


def same(one: HybridEngine, other: HybridEngine) -> None:
    """Assert that all that a checkpoint has is the same, to the bit."""
    found, kept = one.checkpoint_arrays(), other.checkpoint_arrays()
    assert len(found["fine_damped"]) > 0
    assert len(found["coarse_damped"]) > 0
    assert found.keys() == kept.keys()
    for name, values in found.items():
        assert np.array_equal(values, kept[name]), name
