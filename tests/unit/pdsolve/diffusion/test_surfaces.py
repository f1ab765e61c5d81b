"""Bonds near free surfaces and what is held: strips at rest, bars in space, edges, cracks, layers that part."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from diffusion_models import grid, ids, model
from messages import naming
from numpy.typing import NDArray

from pdmesh import Medium, Scene, box
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Concentration, Run, Settings
from pdsolve.diffusion.system import Transport, prepare
from pdsolve.model import Model, ModelError
from pdsolve.state import State

REST = Run(solver="implicit", time_step=1e7, steps=3)


def rest(of: Model, listed: bool = False) -> tuple[Transport, State]:
    """What is left after three steps of 1e7 s: 1e-7 of what is held at most."""
    system, state = prepare(of, 1, listed=listed)
    system.stepper.advance(state, 1, 4)
    return system, state


def strip(rows: int, layer: int = 4, height: int = 1, **more: object) -> Model:
    """Nodes of 40 columns between layers that hold 1 and 0, so many rows and, in space, layers high; spacing 1."""
    ratio = float(more.pop("ratio", 3.0))  # type: ignore[arg-type]
    axes = np.arange(-layer, 40 + layer) + 0.5, np.arange(rows) + 0.5, np.arange(height) + 0.5
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)[:, : 2 if height == 1 else 3]
    x = position[:, 0]
    held = Concentration(nodes=ids(x < 0), value=1.0), Concentration(nodes=ids(x > 40), value=0.0)
    medium = Medium(D=1.0, **more)  # type: ignore[arg-type]
    return model(position, 1.0, medium, ratio=ratio, conditions=held, run=REST)


def conducts(system: Transport, state: State, area: float) -> float:
    """The flux into the left layer over that of D."""
    out = np.zeros(len(state.value[:, 0]))
    system.operator.rates(state.value[:, 0], out)
    return -float((system.operator.volume * out)[system.model.grid.position[:, 0] < 0].sum()) * 40 / area


@pytest.mark.slow
@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize(("rows", "layer", "ratio", "power"), [(20, 4, 3, 1), (6, 1, 3, 0), (20, 7, 6, 2)])
def test_a_strip_conducts_D(listed: bool, rows: int, layer: int, ratio: int, power: int) -> None:
    """And the fall is straight up to the layers, of whatever thickness: 1e-6; uncorrected 20 rows conduct 0.917."""
    system, state = rest(strip(rows, layer, ratio=ratio, power=power), listed)
    assert conducts(system, state, rows) == pytest.approx(1.0, abs=1e-6)
    x = system.model.grid.position[:, 0]
    assert state.value[:, 0][system.free] == pytest.approx((1 - x / 40)[system.free], abs=1e-6)


def test_a_strip_without_correction() -> None:
    """A method as published: 0.917 of D with 20 rows, 0.939 with 40."""
    found = [conducts(*rest(strip(rows, surface_correction=False)), rows) for rows in (20, 40)]
    assert found == pytest.approx([0.917, 0.939], abs=1e-3)


@pytest.mark.slow
def test_a_bar_in_space_conducts_D() -> None:
    """12 nodes thick: 0.22 % off, which is its edges, where M is not positive; uncorrected 0.80."""
    system, state = rest(strip(12, height=12))
    assert conducts(system, state, 144) == pytest.approx(1.0, abs=3e-3)
    base = rest(strip(12, height=12, surface_correction=False))
    assert conducts(*base, 144) < 0.85


@pytest.mark.parametrize(("angle", "found"), [(45.0, 0.9885), (26.565, 0.9905), (33.0, 0.998)])
def test_a_strip_that_lies_across_the_lattice(angle: float, found: float) -> None:
    """Its edges are stairs: 0.9885 to 0.998 of D by its volume, uncorrected 0.90 to 0.915."""
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    axis = np.arange(-32, 32) + 0.5
    position = np.column_stack([one.ravel() for one in np.meshgrid(axis, axis)])
    u, v = position @ along, position @ (along[::-1] * [-1, 1])
    some = (np.abs(v) < 10) & (np.abs(u) < 24)
    position, u = position[some], u[some]
    held = Concentration(nodes=ids(u < -20), value=1.0), Concentration(nodes=ids(u > 20), value=0.0)
    system, state = rest(model(position, 1.0, Medium(D=1.0), conditions=held, run=REST))
    out = np.zeros(len(u))
    system.operator.rates(state.value[:, 0], out)
    flux = -float(out[u < -20].sum())
    assert flux * 40 / (system.free.sum() / 40) == pytest.approx(found, abs=2e-3)


def full(system: Transport, state: State) -> NDArray[np.float64]:
    """Volumes times rates by potentials (n, n)."""
    return np.asarray(-system.operator.tangent(state).toarray() * system.operator.volume[:, None])


@pytest.mark.slow
def test_bonds_stay_symmetric_and_positive() -> None:
    """With a hole, cut cells, a crack, a thin layer in the middle and corners: what nodes give each other is the same
    both ways (1e-14), and nothing flows from less to more; a step at the bound keeps between 0 and 1."""
    axis = np.arange(24) + 0.5
    position = np.column_stack([one.ravel() for one in np.meshgrid(axis, axis)])
    position = position[np.hypot(*(position - [6.0, 17.0]).T) > 3]
    x, y = position.T
    held = Concentration(nodes=ids(x < 1), value=1.0), Concentration(nodes=ids((x > 15) & (x < 17)), value=0.0)
    base = model(position, 1.0, Medium(D=1.0), conditions=held, run=Run(steps=50))
    areas = np.where(y < 1, 0.4, np.where(y > 23, 1.3, 1.0))
    cracks = np.array([[5.0, 6.3, 12.0, 9.1]])
    system, state = prepare(
        dataclasses.replace(base, grid=dataclasses.replace(base.grid, areas=areas, cracks=cracks)), 1
    )
    matrix = full(system, state)
    assert matrix == pytest.approx(matrix.T, abs=1e-14 * np.abs(matrix).max())
    assert np.abs(matrix.sum(axis=1)).max() < 1e-13 * np.abs(matrix).max()
    free = system.free
    leaves = -matrix.diagonal() / system.operator.volume
    assert (matrix - np.diag(matrix.diagonal()))[free].min() > -1e-14 * np.abs(matrix).max()
    assert system.bound == pytest.approx(1 / leaves[free].max(), rel=1e-12)
    dice = np.random.default_rng(3)
    state.value[:, 0][free] = dice.integers(0, 2, free.sum())
    system.stepper.advance(state, 1, 51)
    assert state.value[:, 0].min() >= 0
    assert state.value[:, 0].max() <= 1 + 1e-12


def test_a_layer_parts_what_is_on_both_sides() -> None:
    """Of one column of nodes: no bond goes from one side to the other; uncorrected many do."""
    position = np.column_stack([one.ravel() for one in np.meshgrid(np.arange(12) + 0.5, np.arange(12) + 0.5)])
    x = position[:, 0]
    held = (Concentration(nodes=ids((x > 6) & (x < 7)), value=0.0),)
    left, right = np.flatnonzero(x < 6), np.flatnonzero(x > 7)
    crossing = []
    for corrected in (True, False):
        medium = Medium(D=1.0, surface_correction=corrected)
        matrix = full(*prepare(model(position, 1.0, medium, conditions=held), 1))
        crossing.append(np.abs(matrix[np.ix_(left, right)]).max())
    assert crossing[0] < 1e-16  # measured 7e-18: a slot's conductance less that of the pair, to round-off
    assert crossing[1] > 0.01


def test_an_edge_of_a_plate_holds_where_it_is() -> None:
    """Of nodes on the edge, whatever the rows: the fall is straight from edge to edge, 1e-5; uncorrected 7 % off."""
    for rows in (1, 3):
        scene = Scene(box(0, 0, 4, 2), 0.1, medium=Medium(D=1.0), run=REST)
        scene = scene.hold("left", 1.0, rows=rows).hold("right", 0.0, rows=rows)
        system, state = rest(Model(*build_grid(scene)[:2]))
        assert state.value[:, 0] == pytest.approx(1 - system.model.grid.position[:, 0] / 4, abs=1e-5)


@pytest.mark.slow
def test_a_side_of_a_body_holds_where_it_is() -> None:
    """Of nodes half a spacing inside: the fall is straight from side to side, but for the edges of the bar."""
    axes = np.arange(16) + 0.5, np.arange(10) + 0.5, np.arange(10) + 0.5
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    x, y, z = position.T
    ends = []
    for value, some, way in ((1.0, x < 1, (-0.5, 0.0, 0.0)), (0.0, x > 15, (0.5, 0.0, 0.0))):
        ends.append(Concentration(nodes=ids(some), value=value, edge=(way,) * int(some.sum())))
    system, state = rest(model(position, 1.0, Medium(D=1.0), conditions=tuple(ends), run=REST))
    assert system.free.all()
    middle = (np.abs(y - 5) < 2) & (np.abs(z - 5) < 2)
    assert state.value[:, 0][middle] == pytest.approx((1 - x / 16)[middle], abs=2e-3)
    assert state.value[:, 0] == pytest.approx(1 - x / 16, abs=0.02)


def bar(**more: object) -> Model:
    """40 nodes in a row whose edge at 0 is held by a condition with `edge`."""
    position = np.column_stack([np.arange(40) + 0.5, np.zeros(40)])
    ways = more.pop("edge", ((-0.5, 0.0),))
    held = Concentration(nodes=(1,), value=2.0, edge=ways, **more)  # type: ignore[arg-type]
    run = Run(solver="implicit", time_step=1e3, steps=30)
    settings = Settings(physics="diffusion", medium=Medium(D=1.0), conditions=(held,), run=run)
    return Model(grid(position, 1.0), settings)


def test_an_edge_beside_nodes_is_in_the_books() -> None:
    """What comes through it is supplied; a profile holds for it; all is filled in the end."""
    system, state = prepare(bar(profile=((0.0, 0.0), (1e4, 1.0))), 1)
    system.stepper.advance(state, 1, 31)
    assert state.value[:, 0] == pytest.approx(2.0, rel=1e-3)
    inside = float((system.operator.volume * state.value[:, 0]).sum())
    assert float((system.operator.volume * state.work).sum()) == pytest.approx(inside, rel=1e-12)


@pytest.mark.parametrize("edge", [(), ((-0.5, 0.0), (0.5, 0.0)), ((-0.5, 0.0, 0.0),)])
def test_an_edge_that_does_not_fit_its_nodes_is_refused(edge: tuple[tuple[float, ...], ...]) -> None:
    with pytest.raises(ModelError, match=naming("$.conditions[0].edge", found="ways", expected=("1", "2"))) as refused:
        prepare(bar(edge=edge), 1)
    assert "\n" not in str(refused.value)


def test_nodes_without_bonds_stay_as_they_are() -> None:
    """Two nodes far apart, in tiles and listed, whose surfaces are corrected."""
    of = model(np.array([[0.5, 0.5], [50.5, 0.5]]), 1.0, Medium(D=1.0), run=Run(steps=2, time_step=0.1))
    for listed in (False, True):
        system, state = prepare(of, 1, listed=listed)
        state.value[:, 0] = 1.0, 2.0
        system.stepper.advance(state, 1, 3)
        assert state.value[:, 0].tolist() == [1.0, 2.0]
        assert not system.operator.tangent(state).toarray().any()
