"""Measures of nodes that are born and die: since when they are cracked, of what they are, how they moved."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from damaged_results import alone
from new_databases import create_writer
from numpy.typing import NDArray
from plates import square_grid

from pdsolve.measures import histories, strain, tradeoff
from pdsolve.measures.cracked_nodes import (
    damage_with_pre_cracks_at,
    damage_without_pre_cracks_at,
    first_cracked_step_of_nodes,
)
from pdsolve.results import Breaks, Epoch, FrameRecord, Nodes, Results
from pdsolve.run.measures import EnergyBalanceRow

NO_BREAKS = Breaks(*np.zeros((3, 0), dtype=np.int64))


def row(ids: list[int], x: list[float], delta: float, cut: list[int]) -> Nodes:
    """Nodes in a row at these places, mm, with ten bonds each."""
    count = len(ids)
    place = 1e-3 * np.column_stack([x, np.zeros(count)])
    size = np.full(count, 1e-3 * delta)
    return Nodes(np.array(ids), place, size, size**2, np.full(count, 10), np.array(cut))


def epoch(step: int, first: int, born: Nodes, died: list[int], nodes: int) -> Epoch:
    """One of nodes without bonds."""
    return Epoch(step, first, born, alone(0, len(born.ids)), np.array(died, dtype=np.int64), nodes, 0)


def test_a_node_that_is_born_cracked_is_so_since_the_one_before() -> None:
    """Five nodes of 1 mm: cracked at 5; cut by a pre-crack; hurt but whole; sound; cut, but not so much. All split in
    two at 10, and the first two parts merge at 20."""
    nodes = row([1, 2, 3, 4, 5], [0, 1, 2, 3, 4], 1.0, [0, 4, 0, 0, 3])
    parts = row(list(range(11, 21)), list(np.arange(10) / 2 - 0.25), 0.5, [5, 0, 4, 4, 4, 0, 0, 0, 4, 0])
    merged = row([1], [0], 1.0, [4])
    writer = create_writer(None, nodes, alone, np.empty((0, 4)), {"time_step": 1e-6, "model": "{}"})
    broken = [(5, 1, 2)] * 4 + [(7, 3, 2)] * 2 + [(12, 17, 2)] * 4 + [(25, 1, 2)]
    changes = [epoch(10, 5, parts, [0, 1, 2, 3, 4], 10), epoch(20, 15, merged, [5, 6], 9)]
    writer.write(
        FrameRecord(30, 3e-5, {}, Breaks(*np.array(broken).T), [], [], {}, epochs=changes, rows=np.arange(7, 16))
    )
    results = Results(writer.connection, "memory")
    assert first_cracked_step_of_nodes(results, step=9).tolist() == [5, 0, -1, -1, -1]
    assert first_cracked_step_of_nodes(results, step=15).tolist() == [5, -1, 0, 0, 10, -1, 12, -1, 0, -1]
    assert first_cracked_step_of_nodes(results).tolist() == [0, 0, 10, -1, 12, -1, 0, -1, 5]
    assert damage_with_pre_cracks_at(results, 11).tolist() == [0.5, 0, 0.4, 0.4, 0.4, 0, 0, 0, 0.4, 0]
    assert damage_with_pre_cracks_at(results, 24)[-1] == 0.4
    assert damage_with_pre_cracks_at(results, 25)[-1] == 0.5
    assert damage_without_pre_cracks_at(results, 9).tolist() == pytest.approx(
        [0.4, 0, 0.2, 0, 0]
    )  # of what pre-cracks left
    assert damage_without_pre_cracks_at(results, 11).tolist() == [
        0.5,
        0,
        0.4,
        0.4,
        0.4,
        0,
        0,
        0,
        0.4,
        0,
    ]  # there is none in the model


def test_a_node_that_is_born_beside_a_pre_crack_has_its_own_damage_alone() -> None:
    """A row of nodes 1 mm apart, a crack between the first two: of the 4 bonds that the second one, born anew at step
    10, lacks, the crack cut 1, and 3 of the other 9 broke before."""
    nodes = row([1, 2, 3, 4], [0, 1, 2, 3], 1.0, [3, 1, 1, 1])
    crack = np.array([[0.5e-3, -1e-3, 0.5e-3, 1e-3]])
    writer = create_writer(None, nodes, alone, crack, {"time_step": 1e-6, "model": "{}"})
    born = row([5], [1], 1.0, [4])
    changes = [epoch(10, 4, born, [1], 4)]
    writer.write(FrameRecord(30, 3e-5, {}, NO_BREAKS, [], [], {}, epochs=changes, rows=np.array([0, 2, 3, 4])))
    results = Results(writer.connection, "memory")
    assert damage_without_pre_cracks_at(results, 5).tolist() == [0, 0, 0, 0]
    assert damage_with_pre_cracks_at(results, 30).tolist() == [0.3, 0.1, 0.1, 0.4]
    assert damage_without_pre_cracks_at(results, 30) == pytest.approx([0, 0, 0, 3 / 9])


def test_who_is_born_is_of_the_material_of_the_nearest_at_the_start() -> None:
    nodes = row([1, 2], [0, 1], 1.0, [0, 0])
    region = {"material": {"E": 2.0, "rho": 1.0, "G0": 1.0}, "nodes": [2]}
    model = {"material": {"E": 1.0, "rho": 1.0, "G0": 1.0}, "regions": [region]}
    writer = create_writer(None, nodes, alone, np.empty((0, 4)), {"time_step": 1e-6, "model": json.dumps(model)})
    parts = row([3, 4], [0.75, 1.25], 0.5, [0, 0])
    writer.write(
        FrameRecord(5, 5e-6, None, NO_BREAKS, [], [], {}, epochs=[epoch(3, 2, parts, [1], 3)], rows=np.array([0, 2, 3]))
    )
    results = Results(writer.connection, "memory")
    assert strain.elastic_constants_of_nodes(results, 0)[0].tolist() == [1.0, 2.0]
    assert strain.elastic_constants_of_nodes(results, 5)[0].tolist() == [1.0, 2.0, 2.0]


def split(path: Path, at: int, side: int = 8) -> Results:
    """A square of nodes 1 mm apart, stretched evenly in time in frames of 10 steps, that split into four after `at`."""
    delta = 8e-3 / side
    grid = square_grid(side, side, delta, x0=delta / 2, y0=delta / 2)
    fine = square_grid(2 * side, 2 * side, delta / 2, x0=delta / 4, y0=delta / 4)
    count = side * side
    start, later = (
        Nodes(ids, one.position, one.delta, one.delta**2, np.full(len(ids), 10), np.zeros(len(ids), dtype=np.int64))
        for one, ids in ((grid, grid.ids), (fine, count + fine.ids))
    )
    model = {"material": {"E": 1.0, "rho": 1.0, "G0": 1.0}}
    writer = create_writer(
        path, start, alone, np.empty((0, 4)), {"time_step": 1e-7, "initial_energy": 0.0, "model": json.dumps(model)}
    )
    for step in range(0, 50, 10):
        whole = step <= at
        x, y = (start if whole else later).position.T
        fields: dict[str, NDArray[np.floating]] = {"ux": step * (1e-3 * x - 2e-3 * y), "uy": step * 1e-3 * x}
        new = step - 10 <= at < step
        changes = [epoch(at + 1, count, later, list(range(count)), 4 * count)] if new else []
        rows = None if whole else count + np.arange(4 * count)
        books = [EnergyBalanceRow(step, 1e-7 * step, *[0.0] * 6, 0)]
        writer.write(FrameRecord(step, 1e-7 * step, fields, NO_BREAKS, books, [], {}, epochs=changes, rows=rows))
    writer.write_meta({"summary": json.dumps({"wall_time": 1.0, "steps": 40})})
    writer.close("finished")
    return Results.open(path)


def test_histories_are_of_those_there_are(tmp_path: Path) -> None:
    """A node that dies, one that is born, a place, a box."""
    with split(tmp_path / "a.sqlite", 15) as results:
        dies, born = histories.node_history(results, 1), histories.node_history(results, 65)
        assert np.isfinite(dies.value).tolist() == [True, True, False, False, False]
        assert np.isfinite(born.value).tolist() == [False, False, True, True, True]
        here = histories.nearest_node_history(results, (0.3e-3, 0.3e-3), component="x")
        x = np.array([0.5e-3, 0.5e-3, 0.25e-3, 0.25e-3, 0.25e-3])
        assert here.value == pytest.approx(-1e-3 * x * 10 * np.arange(5), rel=1e-6)
        assert (here.node_ids, here.label) == ((1, 65), "nearest of 2 nodes")
        mean = histories.mean_history_in_box(results, (0, 0, 1e-3, 1e-3), component="y")
        assert mean.value == pytest.approx(0.5e-6 * 10 * np.arange(5), rel=1e-6)
        assert len(mean.node_ids) == 5


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("at", [15, 35, 38])
def test_displacements_are_compared_where_nodes_change_in_between(tmp_path: Path, at: int) -> None:
    """What is linear in space and time is the same on all clouds, but at the edges of the coarser one."""
    with split(tmp_path / "a.sqlite", at) as one, split(tmp_path / "b.sqlite", 99) as other:
        for results, reference in ((one, other), (other, one)):
            error = tradeoff.relative_displacement_error(results, reference)
            assert error is not None
            assert error < 1e-6  # measured 4e-8: single precision
        moved = tradeoff._interpolate_displacement_at(one, 3.5e-6)
        nodes = one.nodes(40)
        inside = np.isfinite(moved).all(axis=1)
        x, y = nodes.position[inside].T
        assert moved[inside] == pytest.approx(35 * np.column_stack([1e-3 * x - 2e-3 * y, 1e-3 * x]), rel=1e-5, abs=1e-9)
        assert inside.mean() > 0.7
