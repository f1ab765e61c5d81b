"""Runs of bodies whose fine zone moves: kills, first bonds, prescribed motion."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents, kill_when
from zoned_blocks import GLASS, block

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh import Body, Box, Run, build
from pdmesh.model.document import InitialVelocity, Velocity, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate

RAMP = ((0.0, 0.0), (4e-6, 1.0))
MOTIONS = {
    "sheet between coarse nodes": Velocity(box=(-1.0, -1.0, 0.0209, 1.0, 1.0, 0.0211), z=1.0, profile=RAMP),
    "two rows of a face": Velocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 0.0011), z=1.0, profile=RAMP),
    "half, from between coarse nodes": InitialVelocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 0.0211), z=1.0),
    "half, of the place": Velocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 0.0201), z="1 + cos(pi * x / 1e-3) / 2"),
    "half, from coarse nodes": InitialVelocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 0.0201), z=1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_motion_may_be_prescribed_anywhere(name: str) -> None:
    """Where coarse nodes do not have it, cells are fine: momentum and work are those of fine nodes everywhere."""
    momentum, end = [], []
    lasting = msgspec.structs.replace(GLASS, G0=1e9)
    for adapt in ("none", "hybrid"):
        body = Body(Box((0, 0, 0), (0.012, 0.012, 0.04)), 1e-3, lasting, run=Run(steps=60, time_step=1e-7))
        built = build(body.adapt("hybrid"))
        run = msgspec.structs.replace(built.settings.run, adapt=adapt)
        model = Model(built.grid, msgspec.structs.replace(built.settings, run=run, conditions=(MOTIONS[name],)))
        system, state = prepare(model, Options(threads=1))
        momentum.append(float((state.rate[:, 2] * system.model.rho * system.area).sum()))
        system.stepper.advance(state, 1, 61)
        found = compute_energy_balance_row(system, state, 60)
        end.append((found.work, found.momentum_z, found.kinetic))
    np.testing.assert_allclose(*momentum, rtol=1e-12)
    np.testing.assert_allclose(*np.array(end)[:, :2], rtol=0.02)  # 0.016 at most
    np.testing.assert_allclose(*np.array(end)[:, 2], rtol=0.05)  # 0.033


@pytest.fixture(scope="module")
def model_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The block as a file, in steps of which the last ones break bonds."""
    path, model = tmp_path_factory.mktemp("block") / "block.json", block("hybrid", 180)
    write_file(document_of(model.grid, model.settings), path)
    return path


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_tables(model_file: Path, tmp_path: Path) -> None:
    """Killed after cells have become fine around broken bonds."""
    words, whole, killed = (
        [str(model_file), "--threads", "1", "-q"],
        tmp_path / "whole.sqlite",
        tmp_path / "killed.sqlite",
    )
    words += ["--set", "run.every=4"]
    assert pdsolve([*words, "-o", str(whole)]) == 0

    def met(results: Results) -> bool:
        return bool(len(results.breaks().step))

    kill_when(met, killed, ["-m", "pdsolve", *words, "-o", str(killed)])
    with Results.open(killed) as results:
        assert results.meta()["status"] == "running"
    assert pdsolve(["--resume", str(killed), "--threads", "1", "-q"]) == 0
    assert contents(killed) == contents(whole)


@pytest.mark.slow
def test_the_first_bond_breaks_within_the_range_of_uniform_runs() -> None:
    """Whose time it breaks at depends on their step."""
    first = []
    for adapt, step in (("hybrid", 1.05e-7), ("none", 0.5e-7), ("none", 0.7e-7), ("none", 0.9e-7), ("none", 1.05e-7)):
        model = block(adapt)
        run = msgspec.structs.replace(model.settings.run, time_step=step, steps=round(1.15e-5 / step))
        model = Model(model.grid, msgspec.structs.replace(model.settings, run=run))
        with simulate(model, None, Options(threads=1)) as results:
            first.append(step * int(results.breaks().step.min()))
    # 9.87 us; 9.87 to 9.90 us
    assert min(first[1:]) - 1e-9 <= first[0] <= max(first[1:]) + 1e-9
