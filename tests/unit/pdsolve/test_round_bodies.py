"""Rigid discs and balls with round surfaces: spin, angle, friction, restitution, checkpoints, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contact_bars import UNIT
from messages import naming
from shapely import Point

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh import Body, Box, GridError, Material, Scene, Sphere, box, build
from pdmesh.model.document import Run
from pdsolve import Results, simulate
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume

H, R, MASS, V, SPIN = 0.01, 0.1, 0.03, 5e-3, 0.05
WALL = ("x", "y", "spin")


def struck(radius: float | None = R, run: Run | None = None, x: float = 0.3, sink: float = -1e-3, **more: Any) -> Model:
    """A disc that turns and meets a wall at 45 degrees; the plate is far away."""
    scene = Scene(box(2, 0, 2.1, 0.1), H, UNIT, run=run or Run()).rigid(box(0, 0, 0.8, 0.04), "wall", held=WALL)
    disc = Point(x, 0.04 + R - sink).buffer(R, 64)
    scene = scene.rigid(disc, "disc", MASS, (V, -V), SPIN, radius=radius).contact(**more)
    built = build(scene)
    return Model(built.grid, built.settings)


def bounced(model: Model, steps: int) -> tuple[np.ndarray, float, EnergyBalanceRow, float]:
    """Velocity of the last body, m/s, its spin, rad/s, the ledger, and the energy at the start; of a plate."""
    system, state = prepared = prepare(model, Options(threads=1))
    prepared.advance(1, steps + 1)
    assert model.grid.bodies is not None
    own = model.grid.bodies.number == model.grid.bodies.number.max()
    arm, way = (model.grid.position + state.value)[own], state.rate[own]
    speed, arm = way.mean(axis=0), arm - arm.mean(axis=0)
    spin = float((arm[:, 0] @ way[:, 1] - arm[:, 1] @ way[:, 0]) / (arm**2).sum())
    return speed, spin, compute_energy_balance_row(system, state, steps), system.initial_energy


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.3, 0.3025, 0.305])
def test_a_disc_keeps_its_spin_and_leaves_a_wall_by_the_angle_at_which_it_came(x: float) -> None:
    speed, spin, last, begun = bounced(struck(x=x), 300)
    assert spin == pytest.approx(SPIN, rel=1e-6)  # 4e-8: the mean of velocities over a step in which it turns
    assert speed == pytest.approx([V, V], rel=0.012)  # .0096, .0005, .009: the wall's nodes are a spacing apart
    assert abs(last.balance_error(begun)) < 1e-3  # 1e-4


@pytest.mark.slow
def test_friction_turns_a_disc_by_as_much_as_it_slows_it() -> None:
    """It slides all the while: mu (1 + e) v along the wall, and that times m R about the centre."""
    mu, model = 0.3, struck(friction=0.3)
    speed, spin, last, begun = bounced(model, 300)
    own = model.grid.bodies.number == 2  # type: ignore[union-attr]
    arm, cell = model.grid.position[own] - model.grid.position[own].mean(axis=0), model.grid.cells[own]
    inertia = MASS * (cell @ (arm**2).sum(axis=1)) / cell.sum()
    assert speed[0] == pytest.approx(V - 2 * mu * V, rel=0.04)  # .033 of what it keeps
    assert (spin - SPIN) * inertia == pytest.approx(MASS * R * (speed[0] - V), rel=0.03)  # .019: what the angle is off
    assert last.friction > 0.4 * begun
    assert abs(last.balance_error(begun)) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.3, 0.6])
@pytest.mark.parametrize("radius", [None, R])
def test_bodies_rebound_with_their_restitution(radius: float | None, e: float) -> None:
    """Of a block, by its nodes, and of a disc: measured .2997, .6000 and .2956, .5949."""
    if radius is None:
        scene = Scene(box(2, 0, 2.1, 0.1), H, UNIT).rigid(box(0, 0, 0.4, 0.04), "wall", held=WALL)
        scene = scene.rigid(box(0.1, 0.041, 0.2, 0.141), "block", MASS, (0.0, -V)).contact(restitution=e)
        built = build(scene)
        model = Model(built.grid, built.settings)
    else:
        model = struck(restitution=e)
    speed, _, last, begun = bounced(model, 800)
    assert speed[1] == pytest.approx(e * V, rel=0.02)
    assert last.dissipated == pytest.approx((1 - e**2) * MASS * V**2 / 2, rel=0.02)
    assert abs(last.balance_error(begun)) < 2e-3  # .0011


@pytest.mark.slow
def test_a_ball_keeps_its_spin_on_a_block_in_space() -> None:
    unit = Material(E=1.0, rho=1.0, G0=1e9, plane="space")
    spin = (0.05, 0.02, -0.03)
    block = Body(Box((0, 0, -0.3), (1, 1, 0)), 0.1, unit).fix("bottom")
    body = block.rigid(Sphere((0.5, 0.5, 0.31), 0.3), "ball", 0.05, (1e-3, 2e-3, -4e-3), spin, spacing=0.1, radius=0.3)
    built = build(body)
    system, state = prepared = prepare(Model(built.grid, built.settings), Options(threads=1))
    assert system.contact is not None
    steps = int(12 / system.time_step)
    prepared.advance(1, steps + 1)
    rigid = system.contact.rigid
    assert rigid.motion.momentum[0] == pytest.approx(rigid.bodies[0].inertia @ np.array(spin), rel=1e-12)
    own = system.model.grid.rigid
    assert state.rate[own].mean(axis=0)[2] > 2e-3
    assert abs(compute_energy_balance_row(system, state, steps).balance_error(system.initial_energy)) < 5e-3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*contact.restitution.*with bodies that deform")
def test_a_resumed_run_has_the_same_bits(tmp_path: Path) -> None:
    model = struck(run=Run(steps=240, every=20, ledger=20), friction=0.005, restitution=0.8)
    whole, count = simulate(model, options=Options(threads=1)), 0

    def stop(_: object) -> bool:
        nonlocal count
        count += 1
        return count > 4

    path = tmp_path / "stopped.sqlite"
    simulate(model, path, Options(threads=1), stop).close()
    resume(path, threads=2)
    with Results.open(path) as again:
        for name in ("ux", "uy", "vx", "vy"):
            assert np.array_equal(whole.field(name, 240), again.field(name, 240))
        assert np.array_equal(whole.reactions(), again.reactions())
        assert whole.history()["friction"][-1] == again.history()["friction"][-1] > 0


def test_what_no_round_body_can_be_is_refused() -> None:
    for radius in (0.8 * R, 1.3 * R):
        named = naming("$.conditions[1].radius", found=f"{radius:g} m", expected="0.09925")
        with pytest.raises(GridError, match=named):
            struck(radius=radius)
    with pytest.raises(ModelError, match=naming("$.bodies", found=("disc", "wall", "0.00587 m"))):
        prepare(moved(struck(), -7e-3), Options(threads=1))


def moved(model: Model, way: float) -> Model:
    """The model with its last body nearer to the wall by `-way`, m."""
    grid = model.grid
    assert grid.bodies is not None
    shift = np.where((grid.bodies.number == 2)[:, None], [0.0, way], 0.0)
    return replace(model, grid=replace(grid, position=grid.position + shift))


def test_a_round_body_touches_the_drawn_circle_of_another() -> None:
    """A disc that deforms goes 0.1 of a spacing deep into a rigid one; its top node is 0.1, not 0.5, under its top."""
    radius, gap = 6.3 * H, 0.3 * H
    scene = Scene(Point(0, 0).buffer(radius, 64), H, UNIT)
    scene = scene.rigid(Point(0, radius + R + gap).buffer(R, 64), "disc", MASS, radius=R).contact()
    built = build(scene)
    system, state = prepare(Model(built.grid, built.settings), Options(threads=1))
    contact: Any = system.contact
    contact.round.search(np.zeros_like(state.value), np.arange(len(built.grid)), H, np.zeros(len(built.grid)))
    for deep in (-0.1, 0.1):
        moved = np.zeros_like(state.value)
        moved[built.grid.bodies.number == 0, 1] = gap + deep * H  # type: ignore[union-attr]
        depth = float(contact.round._pressed(0, moved).depth.max(initial=0.0))
        assert depth == pytest.approx(max(deep, 0.0) * H, abs=0.02 * H)
