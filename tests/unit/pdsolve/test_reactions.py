"""What conditions push with, against statics: sigma = E strain, grips that balance, tractions times lengths."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from tampered_databases import tampered

from pdmesh.model.document import Acceleration, AnyCondition, Displacement, InitialVelocity, Load, Run, Velocity
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, resume, simulate

LEFT, RIGHT = (0.0, 0.0, 0.0, 10e-3), (30e-3, 0.0, 30e-3, 10e-3)
HEIGHT = 11e-3  # m, eleven rows of cells


def bar(*conditions: AnyCondition, steps: int = 100, every: int = 100, ledger: int = 10) -> Model:
    """A bar of 31 x 11 nodes, 1 mm apart."""
    run = Run(time_step=1e-7, steps=steps, every=every, ledger=ledger)
    return plate(square_grid(31, 11), conditions=conditions, run=run)


def of(results: Results, condition: int) -> np.ndarray:
    """The rows of one condition."""
    rows = results.reactions()
    return np.asarray(rows[rows["condition"] == condition])


def test_a_slow_pull_takes_E_times_strain_times_height() -> None:
    """A plate pulled softly by its end, over 30 of its periods: the stress of its middle's strain, in both grips.

    The lattice is 2.5 per cent too stiff along its rows at m = 4 (tests/verification/test_tension.py), surfaces add.
    """
    time = np.linspace(0, 3e-4, 41)
    soft = tuple(zip(time.tolist(), (0.5 - 0.5 * np.cos(np.pi * time / 3e-4)).tolist(), strict=True))
    still = Displacement(box=(0.0, 0.0, 0.0, 20e-3), x=0.0)
    pulled = Displacement(box=(30e-3, 0.0, 30e-3, 20e-3), x=3e-6, profile=soft)
    model = plate(square_grid(31, 21), 4.0, conditions=(still, pulled), run=Run(time_step=1e-7, steps=3000, every=3000))
    with simulate(model) as results:
        left, right = of(results, 0)[-1], of(results, 1)[-1]
        ux = results.field("ux", 3000).reshape(21, 31).mean(axis=0)
    strain = (ux[20] - ux[10]) / 10e-3
    assert right["displacement_x"] == pytest.approx(3e-6, rel=1e-12)
    assert right["force_x"] == pytest.approx(GLASS.E * strain * 21e-3, rel=0.04)  # measured +3.6 per cent
    assert left["force_x"] == pytest.approx(-right["force_x"], rel=0.01)  # measured 0.5 per cent
    assert right["force_y"] == 0.0  # free along y


@pytest.mark.parametrize(("mode", "share"), [("conservative", 1.0), ("thesis", None)])
def test_a_load_is_its_traction_times_the_length(mode: str, share: float | None) -> None:
    ramp = ((0.0, 0.0), (5e-6, 1.0))
    model = bar(
        Load(box=RIGHT, traction=(2e6, -1e6), rows=1, length=HEIGHT, profile=ramp), Displacement(box=LEFT, x=0.0, y=0.0)
    )
    with simulate(model, options=Options(mode)) as results:
        load = of(results, 0)
    assert load["step"].tolist() == list(range(0, 101, 10))
    factor = np.minimum(load["time"] / 5e-6, 1.0)
    if share is not None:
        assert load["force_x"] == pytest.approx(2e6 * HEIGHT * factor, rel=1e-12)
        assert load["force_y"] == pytest.approx(-1e6 * HEIGHT * factor, rel=1e-12)
    else:  # traction / (rows delta) at each node, as the thesis has it, on the areas of eq. 19
        assert load["force_x"][-1] == pytest.approx(2e6 / 1e-3 * 11e-6, rel=1e-12)


@pytest.mark.parametrize(
    "conditions",
    [
        (Displacement(box=LEFT, x=0.0, y=0.0), Load(box=RIGHT, body_force=(1e9, 2e8))),
        (Velocity(box=LEFT, x=-0.2, y=0.1), Velocity(box=RIGHT, x=0.1), Load(box=LEFT, body_force=(1e9, 0.0))),
        (Acceleration(box=LEFT, x=-1e6), InitialVelocity(box=RIGHT, x=0.1)),
    ],
)
def test_all_forces_together_change_the_momentum(conditions: tuple[AnyCondition, ...]) -> None:
    """Newton's second law for the plate: the sum of forces, by Verlet's trapezoidal rule, is the momentum gained."""
    with simulate(bar(*conditions, steps=40, every=40, ledger=1)) as results:
        books, rows = results.history(), results.reactions()
    for axis in "xy":
        force = np.bincount(rows["step"].astype(int), rows[f"force_{axis}"])
        gained = books[f"momentum_{axis}"][-1] - books[f"momentum_{axis}"][1]
        impulse = float((force[2:] + force[1:-1]).sum() / 2 * 1e-7)
        assert impulse == pytest.approx(gained, rel=1e-12, abs=1e-12)  # measured 2e-16


def test_conditions_keep_their_numbers_and_kinds() -> None:
    model = bar(
        InitialVelocity(box=LEFT, x=1.0), Velocity(box=RIGHT, y=0.5), Load(box=LEFT, body_force=(1.0, 0.0)), steps=10
    )
    with simulate(model) as results:
        rows = results.connection.execute("SELECT DISTINCT condition, kind FROM reaction ORDER BY 1").fetchall()
        moved = of(results, 1)["displacement_y"][-1]
    assert rows == [(1, "velocity"), (2, "load")]
    assert moved == pytest.approx(0.5 * 10 * 1e-7, rel=1e-12)


def test_a_resumed_run_gives_the_same_rows(tmp_path: Path) -> None:
    """Those after the last checkpoint, of a run that was killed, are not kept."""
    ramp = ((0.0, 0.0), (9e-6, 1.0))
    conditions = Displacement(box=LEFT, x=0.0), Load(box=RIGHT, traction=(1e6, 0.0), profile=ramp)
    model = bar(*conditions, every=30)
    path = tmp_path / "stopped.sqlite"
    simulate(model, path, watch=lambda progress: progress.step >= 30).close()
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT max(step) FROM reaction").fetchone()[0] < 100
    with tampered(path) as connection:
        connection.execute("INSERT INTO reaction VALUES (77, 0, 0, 'displacement', 1, 1, 1, 1, 1, 1)")
    with resume(path) as resumed, simulate(model) as whole:
        assert resumed.reactions().tolist() == whole.reactions().tolist()
        assert len(whole.reactions()) == 2 * 11
