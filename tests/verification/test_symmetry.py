"""A run does not know left from right, up from down, one numbering from another, millimetres from metres."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, interface_grid, plate, square_grid
from system_checks import broken

from pdmesh.model.document import Load, Material, Run
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import list_breaks_since
from pdsolve.run.system import PreparedRun

MODES = ("thesis", "conservative")
LAWS = {"brittle": GLASS, "bilinear": msgspec.structs.replace(GLASS, law="bilinear", kr=3.0)}
SIDE = 24
PULL = 4e10


def turned(points: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) by a turn or a mirror of whole numbers, exactly."""
    return np.asarray(points @ turn.T + 0.0)


def cracked(turn: NDArray[np.float64], order: NDArray[np.int64] | None, material: Material, grid: Grid) -> Model:
    """A plate around the origin with a crack to its side, torn off the axes; all of it turned, and renumbered."""
    position = turned(grid.position, turn)
    segment = turned(np.array([[-0.03, 1e-4], [-2e-3, 1e-4]]), turn)
    top = np.flatnonzero(grid.position[:, 1] > grid.position[:, 1].max() - 2.5e-3)
    bottom = np.flatnonzero(grid.position[:, 1] < grid.position[:, 1].min() + 2.5e-3)
    up = turned(np.array([[0.2, 1.0]]), turn)[0] * PULL
    model_grid = dataclasses.replace(grid, position=position, cracks=segment.reshape(1, 4))
    if order is not None:
        columns = {n: getattr(model_grid, n)[order] for n in ("ids", "position", "delta", "border", "hole_id")}
        model_grid = dataclasses.replace(model_grid, **columns)
    loads = (
        Load(nodes=tuple(grid.ids[top].tolist()), body_force=(up[0], up[1])),
        Load(nodes=tuple(grid.ids[bottom].tolist()), body_force=(-up[0], -up[1])),
    )
    return plate(model_grid, 3, material=material, conditions=loads, run=Run(time_step=4e-8))


def run(model: Model, mode: str, steps: int = 150) -> PreparedRun:
    """The problem after some steps, with bonds broken and bonds left."""
    problem = prepare(model, Options(mode, threads=1))
    problem.advance(1, steps + 1)
    gone = len(broken(problem).step)
    assert 50 < gone < problem.system.directed_bond_count / 2
    return problem


def grid_of(scales: int) -> Grid:
    """A plate around the origin: a square lattice, or fine nodes left and coarse ones right."""
    if scales == 1:
        return square_grid(SIDE, SIDE, x0=-(SIDE - 1) / 2e3, y0=-(SIDE - 1) / 2e3)
    grid = interface_grid(20, 7, 12)
    return dataclasses.replace(grid, position=grid.position - grid.position.mean(axis=0).round(4) * [0, 1] - [0, 0.0])


IDENTITY = np.eye(2)
TURNS = {
    "left and right": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "up and down": np.array([[1.0, 0.0], [0.0, -1.0]]),
    "a quarter turn": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "a half turn": -np.eye(2),
    "x and y swapped": np.array([[0.0, 1.0], [1.0, 0.0]]),
}


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("scales", [1, 2])
def test_a_run_turns_with_its_plate(mode: str, law: str, turn: str, scales: int) -> None:
    """The same nodes in the same order, mirrored or turned: the same numbers to round-off, the same bonds broken."""
    plain = run(cracked(IDENTITY, None, LAWS[law], grid_of(scales)), mode)
    other = run(cracked(TURNS[turn], None, LAWS[law], grid_of(scales)), mode)
    expected = turned(plain.state.value, TURNS[turn])
    assert np.abs(other.state.value - expected).max() <= 1e-12 * np.abs(expected).max()  # measured 2e-14
    assert all(map(np.array_equal, list_breaks_since(other.system, 0), list_breaks_since(plain.system, 0)))


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scales", [1, 2])
def test_a_run_does_not_depend_on_the_numbering(mode: str, law: str, scales: int) -> None:
    """Nodes shuffled: sums in another order, so to round-off; bonds break in the same steps."""
    grid = grid_of(scales)
    order = np.random.default_rng(5).permutation(len(grid))
    plain = run(cracked(IDENTITY, None, LAWS[law], grid), mode)
    other = run(cracked(IDENTITY, order, LAWS[law], grid), mode)
    assert (
        np.abs(other.state.value - plain.state.value[order]).max() <= 1e-12 * np.abs(plain.state.value).max()
    )  # measured 2e-14
    assert np.array_equal(compute_node_damage(other.system), compute_node_damage(plain.system)[order])


@pytest.mark.parametrize("mode", MODES)
def test_a_symmetric_run_stays_symmetric(mode: str) -> None:
    """Crack and load on the axis: both halves of the plate agree."""
    grid = dataclasses.replace(
        square_grid(SIDE, SIDE, x0=0.0, y0=-(SIDE - 1) / 2e3), cracks=np.array([[-1e-3, 0.0, 8.2e-3, 0.0]])
    )
    loads = tuple(
        Load(box=(-1.0, min(a, b), 1.0, max(a, b)), body_force=(0.0, np.sign(a) * PULL))
        for a, b in ((9.4e-3, 1.0), (-9.4e-3, -1.0))
    )
    problem = run(plate(grid, 3, conditions=loads, run=Run(time_step=4e-8)), mode)
    u, damaged = problem.state.value.reshape(SIDE, SIDE, 2), compute_node_damage(problem.system).reshape(SIDE, SIDE)
    assert np.abs(u[..., 0] - u[::-1, :, 0]).max() <= 1e-12 * np.abs(u).max()  # measured 4e-15
    assert np.abs(u[..., 1] + u[::-1, :, 1]).max() <= 1e-12 * np.abs(u).max()  # measured 2e-14
    assert np.array_equal(damaged, damaged[::-1])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("law", LAWS)
def test_a_run_has_no_length_of_its_own(mode: str, law: str) -> None:
    """Everything 1024 times as large and slow, G0 as well: the same stretches, bit for bit, but for round-off in x."""
    small = cracked(IDENTITY, None, LAWS[law], grid_of(1))
    scale = 1024.0
    grid = small.grid
    large_grid = dataclasses.replace(
        grid, position=scale * grid.position, delta=scale * grid.delta, cracks=scale * grid.cracks
    )
    material = msgspec.structs.replace(LAWS[law], G0=scale * GLASS.G0)
    loads = tuple(
        msgspec.structs.replace(load, body_force=tuple(b / scale for b in load.body_force))  # type: ignore[union-attr]
        for load in small.settings.conditions
    )
    large = plate(large_grid, 3, material=material, conditions=loads, run=Run(time_step=4e-8 * scale))
    a, b = run(small, mode), run(large, mode)
    assert np.abs(b.state.value / scale - a.state.value).max() <= 1e-12 * np.abs(a.state.value).max()  # measured 0
    assert all(map(np.array_equal, list_breaks_since(a.system, 0), list_breaks_since(b.system, 0)))
