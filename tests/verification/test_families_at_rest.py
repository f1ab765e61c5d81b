"""State-based bonds that break at rest, the worst first: a notched strip pulled apart, and what a run must keep."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from database_contents import contents
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Displacement, Run, Static
from pdsolve.model import Model
from pdsolve.run.simulation import Options, resume, simulate

pytestmark = pytest.mark.filterwarnings("ignore:.*snap-back:pdsolve.model.ModelWarning")
LAWS: dict[str, dict[str, Any]] = {
    "ordinary, stretch": {"model": "ordinary"},
    "ordinary, energy": {"model": "ordinary", "failure": "energy"},
    "correspondence, stretch": {"model": "correspondence"},
    "correspondence, energy": {"model": "correspondence", "failure": "energy"},
    "correspondence, stress": {"model": "correspondence", "failure": "stress", "strength": 8e7},
}
ONE = Options(threads=1)


def strip(apart: float = 5.4e-6, steps: int = 4, **material: Any) -> Model:
    """A strip of 24 x 16 mm with an edge notch of a third, whose long edges are moved apart by twice as much."""
    grid = dataclasses.replace(square_grid(24, 16), cracks=np.array([[-1.0, 7.5e-3, 7.5e-3, 7.5e-3]]))
    ends = [((-1, -1, 1, 1e-4), -apart), ((-1, 14.9e-3, 1, 1), apart)]
    conditions = tuple(Displacement(box=box, x=0.0, y=y, profile=((0.0, 0.0), (1.0, 1.0))) for box, y in ends)
    made = msgspec.structs.replace(GLASS, nu=0.2, **material)
    run = Run(solver="static", static=Static(load_steps=steps))
    return plate(grid, 3, material=made, conditions=conditions, run=run)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name != "ordinary, stretch" else name for name in LAWS]
)
def test_bonds_break_from_the_notch_and_energy_balances(name: str) -> None:
    model = strip(**LAWS[name])
    with simulate(model, None, ONE) as results:
        summary, broken = results.summary(), results.breaks()
    assert len(broken.step) > 0
    assert abs(summary["balance"]) < 1e-9  # measured 4e-15 to 2e-11
    rows = np.searchsorted(model.grid.ids, np.concatenate([broken.node, broken.neighbour]))
    x, y = model.grid.position[rows].T
    assert x.min() > 4e-3
    assert np.abs(y - 7.5e-3).max() < 4e-3


def shuffled(model: Model) -> Model:
    order = np.random.default_rng(3).permutation(len(model.grid))
    names = ("ids", "position", "delta", "border", "hole_id")
    return Model(
        dataclasses.replace(model.grid, **{name: getattr(model.grid, name)[order] for name in names}), model.settings
    )


@pytest.mark.slow
def test_the_order_of_nodes_and_threads_do_not_matter() -> None:
    found = []
    model = strip(**LAWS["ordinary, stretch"])
    for one, threads in ((model, 1), (shuffled(model), 1), (model, 2)):
        with simulate(one, None, Options(threads=threads)) as results:
            broken, force = results.breaks(), results.reactions()["force_y"]
            found.append((sorted(zip(*(each.tolist() for each in broken), strict=True)), force))
    assert found[0][0] == found[1][0] == found[2][0]
    assert np.abs(found[1][1] - found[0][1]).max() < 1e-7 * np.abs(found[0][1]).max()
    assert (found[2][1] == found[0][1]).all()


@pytest.mark.slow
def test_a_run_that_goes_on_is_the_same_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    whole, stopped = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    model = strip(5.6e-6, 6, **LAWS["ordinary, stretch"])
    simulate(model, whole, ONE).close()
    with simulate(model, stopped, ONE, watch=lambda progress: progress.step == 5) as results:
        assert results.meta()["status"] == "interrupted"
        assert len(results.breaks().step) > 0
    resume(stopped, 1).close()
    assert contents(stopped) == contents(whole)
