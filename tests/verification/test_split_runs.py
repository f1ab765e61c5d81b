"""Runs whose cells split where energy is and merge behind it: momentum, energy, mirrors, the same bits after a stop."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents, kill_when
from plates import plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import InitialVelocity, Load, Run, Split, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import Model, read_model
from pdsolve.results import Results
from pdsolve.run.cell_splitting import expect_quadtree_operator
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, Progress, resume, simulate
from pdsolve.run.system import System
from pdsolve.state import State

MODES = ("thesis", "conservative")


def flung(levels: int = 1, damping: float = 0.0) -> Model:
    """A plate whose left end moves at the start: what splits follows the wave, and merges behind it."""
    split = Split(floor=0.0, threshold=0.3, merge=0.1, hold=2, every=5, levels=levels)
    end = InitialVelocity(box=(-1.0, -1.0, 4.1e-3, 1.0), x=1.0, y=0.3)
    run = Run(adapt="split", steps=120, every=10, split=split, damping=damping)
    return plate(square_grid(28, 10), 3, conditions=(end,), run=run)


def kept(system: System, state: State, found: EnergyBalanceRow, initial: float) -> float:
    """What Verlet keeps, over the energy at the start: the ledger's balance with velocities of half steps."""
    mass = system.model.rho * system.area
    swing = float((mass * (state.second**2).sum(axis=1)).sum()) * system.time_step**2 / 8
    return found.balance_error(initial) - swing / initial


@pytest.mark.slow
@pytest.mark.parametrize("levels", [1, 2])
def test_momentum_and_energy_are_booked_to_the_last(levels: int) -> None:
    """A wave goes up and down a plate, cells split and merge: momentum to round-off, energy to what is nonlinear."""
    system, state = prepare(flung(levels), Options(threads=1))
    adapt, initial, counts = system.regridder, system.initial_energy, []
    momentum = np.array(compute_energy_balance_row(system, state, 0)[6:8])
    for step in range(0, 120, adapt.steps_between_checks):
        before = compute_energy_balance_row(system, state, step)
        change = adapt.change_nodes(system, state, step)
        if change is not None:
            system, state, _ = change
            after = compute_energy_balance_row(system, state, step)
            assert after[6:8] == pytest.approx(before[6:8], abs=1e-15)
            assert system.area.sum() == pytest.approx(280e-6, rel=1e-13)
        counts.append(len(system.model.grid))
        system.stepper.advance(state, step + 1, step + adapt.steps_between_checks + 1)
        level = expect_quadtree_operator(system).cells.level
        assert np.array_equal(system.model.horizons, 3 * 1e-3 / 2.0**level)
    found = compute_energy_balance_row(system, state, 120)
    assert min(np.diff(counts)) < 0 < max(np.diff(counts))
    assert found[6:8] == pytest.approx(momentum, abs=1e-14 * np.abs(momentum).max())
    assert found.refinement / initial > 0.003  # measured 0.03 of it
    assert abs(kept(system, state, found, initial)) < 1e-5  # measured 1e-6
    assert 0.0 < found.fine_share < 1.0


@pytest.mark.slow
def test_what_damping_takes_is_not_what_splitting_loses() -> None:
    """The same plate, damped: measured 3e-6 amiss, and 0.026 where splitting is said to make what damping takes."""
    system, state = prepare(flung(damping=3e4), Options(threads=1))
    adapt, initial = system.regridder, system.initial_energy
    for step in range(0, 120, adapt.steps_between_checks):
        change = adapt.change_nodes(system, state, step)
        if change is not None:
            system, state, _ = change
        system.stepper.advance(state, step + 1, step + adapt.steps_between_checks + 1)
    found = compute_energy_balance_row(system, state, 120)
    assert found.damped > 0.2 * initial
    assert found.dissipated == 0
    assert abs(kept(system, state, found, initial)) < 2e-5


def torn() -> Model:
    """A cracked plate torn apart, bonds breaking, in 100 steps."""
    grid = dataclasses.replace(square_grid(36, 16, y0=-7.5e-3), cracks=1e-3 * np.array([[-1.0, 0.0, 12.0, 0.0]]))
    pull = 2e10
    ends = (
        Load(box=(-1.0, 5.9e-3, 1.0, 1.0), body_force=(0.0, pull), breakable=False),
        Load(box=(-1.0, -1.0, 1.0, -5.9e-3), body_force=(0.0, -pull), breakable=False),
    )
    split = Split(threshold=0.5, floor=0.1, hold=2, every=5)
    return plate(grid, 3, conditions=ends, run=Run(time_step=4e-8, steps=100, every=20, adapt="split", split=split))


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_an_interrupted_run_goes_on_to_the_same_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    """Before nodes change, after that, at a frame, between two; nodes are those of each frame, and mirrored."""
    whole, path, options = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", Options(mode, threads=1)
    with simulate(torn(), whole, options) as results:
        nodes, told = results.nodes(), results.summary()
        counts = np.diff([len(results.nodes(int(step)).ids) for step in results.epochs()])
        assert min(counts) < 0 < max(counts)
        assert len(counts) > 7
        assert told["broken_bonds"] > 150
        places = {tuple(place) for place in nodes.position.round(9).tolist()}
        assert places == {(x, -y) for x, y in places}
        assert nodes.area.sum() == pytest.approx(576e-6, rel=1e-12)
        assert results.history()["refinement"][-1] == told["split"]["refinement"] != 0.0
        lives, breaks = results.lives(), results.breaks()
        ends = (lives.at(side, breaks.step) for side in (breaks.node, breaks.neighbour))
        assert min((row >= 0).all() for row in ends)
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    for number, stop in enumerate((1, 25, 26, 60, 83)):

        def watch(progress: Progress, stop: int = stop) -> bool:
            return progress.step == stop

        if number == 0:
            simulate(torn(), path, options, watch).close()
        else:
            resume(path, watch=watch).close()
        with Results.open(path) as results:
            assert results.checkpoint()[0] == stop
    resume(path).close()
    assert contents(path) == contents(whole)


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_tables(tmp_path: Path) -> None:
    """kill -9 of the command while cells split and merge."""
    document, path, whole = (tmp_path / name for name in ("plate.json", "killed.sqlite", "whole.sqlite"))
    write_file(document_of(flung().grid, flung().settings), document)
    command = ["-m", "pdsolve", str(document), "--threads", "1", "-o", str(path)]
    kill_when(lambda results: len(results.frames()[0]) >= 3, path, command)
    resume(path, threads=1).close()
    simulate(read_model(document), whole, Options(threads=1)).close()
    assert contents(path) == contents(whole)
