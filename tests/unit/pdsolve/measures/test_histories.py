"""Histories against the numbers of the database; probes before frames; what is outside is refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Load, Material, Region, Run, Velocity
from pdsolve.measures.histories import mean_history_in_box, nearest_node_history, node_history
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import simulate


def test_a_probe_is_finer_than_frames(small_plate: Model) -> None:
    """Probed every 5 steps, frames every 20: the probe has them, its neighbour has frames alone."""
    run = msgspec.structs.replace(small_plate.settings.run, probes=((7e-3, 0.5e-3),), ledger=5)
    settings = msgspec.structs.replace(small_plate.settings, run=run)
    with simulate(Model(small_plate.grid, settings)) as results:
        here, there = nearest_node_history(results, (7.1e-3, 0.5e-3)), nearest_node_history(results, (8.1e-3, 0.5e-3))
        faster = node_history(results, here.node_ids[0], "acceleration", "x")
        u = results.field("ux", 60)[here.node_ids[0] - 1], results.field("uy", 60)[here.node_ids[0] - 1]
    assert (here.source, there.source) == ("probe", "frames")
    assert here.time == pytest.approx(np.arange(0, 61, 5) * 50e-9)
    assert there.time == pytest.approx(np.arange(0, 61, 20) * 50e-9)
    assert here.value[-1] == pytest.approx(np.hypot(*u), rel=1e-6)
    assert here.distance_from_place == pytest.approx(0.1e-3)
    assert len(faster.value) == 13  # fields of frames have no acceleration here


@pytest.mark.slow
@pytest.mark.parametrize(("component", "value"), [("x", 3.0), ("y", -4.0), ("magnitude", 5.0)])
def test_components(component: str, value: float) -> None:
    """Nodes moved at (3, -4) m/s."""
    everything = Velocity(box=(0.0, 0.0, 1.0, 1.0), x=3.0, y=-4.0)
    model = plate(square_grid(8, 8), conditions=(everything,), run=Run(time_step=1e-8, steps=4, every=2))
    with simulate(model) as results:
        curve = node_history(results, 7, "velocity", component)
        moved = node_history(results, 7, "displacement", component)
    assert curve.value == pytest.approx([value] * 3)
    assert moved.value == pytest.approx([0, 2e-8 * value, 4e-8 * value])


def test_the_mean_of_a_box_and_its_range(small_results: Path) -> None:
    with Results.open(small_results) as results:
        curve = mean_history_in_box(results, (5e-3, 2e-3, 0.0, 0.0), "displacement", "y")  # corners in any order
        nodes = results.nodes()
        inside = (nodes.position[:, 0] < 5.1e-3) & (nodes.position[:, 1] > 0) & (nodes.position[:, 1] < 2e-3)
        uy, areas = results.field("uy", 60)[inside].astype(float), nodes.area[inside]
    assert len(curve.node_ids) == inside.sum() == 12
    assert (curve.value[-1], curve.smallest[-1], curve.largest[-1]) == pytest.approx(
        (np.average(uy, weights=areas), uy.min(), uy.max())
    )
    assert curve.smallest[-1] < curve.value[-1] < curve.largest[-1]


def test_the_mean_velocity_of_a_body_is_its_momentum_over_its_mass() -> None:
    """Of cells of two sizes and of two densities, one half of which is pushed."""
    grid = square_grid(8, 8)
    areas = np.where(grid.position[:, 1] < 4e-3, 1.0, 0.5) * grid.delta**2
    grid = dataclasses.replace(grid, areas=areas)
    left = (-1.0, -1.0, 4e-3, 1.0)
    heavy = Region(box=left, material=Material(E=65e9, rho=8000.0, G0=200.0))
    push = Load(box=left, body_force=(1e10, 0.0))
    model = plate(grid, conditions=(push,), regions=(heavy,), run=Run(time_step=1e-8, steps=4, every=4))
    with simulate(model, None, Options(threads=1)) as results:
        mean = mean_history_in_box(results, (-1.0, -1.0, 1.0, 1.0), "velocity", "x").value[-1]
        momentum = results.history()["momentum_x"][-1]
        assert results.nodes().area == pytest.approx(areas)
    mass = float((areas * model.rho).sum())
    assert mean == pytest.approx(momentum / mass, rel=1e-5)


def test_a_place_a_spacing_and_a_half_off_is_outside(small_results: Path) -> None:
    with Results.open(small_results) as results:
        assert nearest_node_history(results, (21.4e-3, 0.5e-3)).distance_from_place == pytest.approx(1.4e-3)
        with pytest.raises(ResultsError, match=naming(found=("0.0216,0.0005", "0.0016 m"))):
            nearest_node_history(results, (21.6e-3, 0.5e-3))
