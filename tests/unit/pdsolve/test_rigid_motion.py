"""Rigid bodies: free and prescribed motion, momentum, energy and work, checkpoints, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from contact_bars import UNIT
from messages import naming
from scipy.spatial.distance import pdist

from benchmarks.balance_rows import compute_condition_forces, compute_energy_balance_row
from pdmesh import Scene, SceneError, box, build
from pdmesh.model.document import Displacement, Load, RigidBody, Run, Velocity
from pdsolve import Results, simulate
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume
from pdsolve.run.system import PreparedRun

H, MASS, V = 0.01, 0.02, 1e-2


def falling(gap: float = 0.5 * H, friction: float = 0.0, run: Run | None = None, **more: Any) -> Model:
    """A rigid block above a beam that is free."""
    scene = Scene(box(0, 0, 1, 0.1), H, UNIT, run=run or Run())
    block = box(0.45, 0.1 + gap, 0.55, 0.2 + gap)
    built = build(scene.rigid(block, "block", **({"mass": MASS, "velocity": (0.0, -V)} | more)).contact(friction))
    return Model(built.grid, built.settings)


def momentum(prepared: PreparedRun) -> np.ndarray:
    """Momentum along x and y, and about the origin."""
    system, state = prepared
    mass, x = system.area * system.model.rho, system.model.grid.position + state.value
    turning = mass @ (x[:, 0] * state.rate[:, 1] - x[:, 1] * state.rate[:, 0])
    return np.array([*(mass @ state.rate), turning])


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("kernel", [None, "listed"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_rigid_block_that_turns_and_hits_a_beam_conserves_momentum_and_energy(
    kernel: str | None, friction: float
) -> None:
    prepared = prepare(falling(spin=0.2, friction=friction), Options(threads=1, kernel=kernel))
    (system, state), before = prepared, momentum(prepared)
    rows = system.model.grid.bodies.number == 1  # type: ignore[union-attr]
    prepared.advance(1, 501)
    assert state.rate[rows, 1].mean() > 0
    assert np.abs(momentum(prepared) - before)[:2].max() < 1e-13 * MASS * V
    assert abs(momentum(prepared) - before)[2] < 2e-3 * MASS * V  # .0012: friction acts across the gap
    assert abs(compute_energy_balance_row(system, state, 500).balance_error(system.initial_energy)) < 5e-3  # .002
    x = system.model.grid.position[rows]
    assert np.abs(pdist(x + state.value[rows]) - pdist(x)).max() < 1e-15


@pytest.mark.slow
def test_a_rigid_body_alone_flies_on_and_turns_about_its_centre() -> None:
    w, v = 0.7, (3e-3, 2e-2)
    prepared = prepare(falling(gap=0.3, velocity=v, spin=w), Options(threads=1))
    (system, state), steps = prepared, 400
    prepared.advance(1, steps + 1)
    t = steps * system.time_step
    rows = np.flatnonzero(system.model.grid.bodies.number == 1)  # type: ignore[union-attr]
    arm = system.model.grid.position[rows] - system.model.grid.position[rows].mean(axis=0)
    turn = np.array([[np.cos(w * t), -np.sin(w * t)], [np.sin(w * t), np.cos(w * t)]])
    assert state.value[rows] == pytest.approx(np.array(v) * t + arm @ turn.T - arm, abs=1e-14)
    assert state.rate[rows] == pytest.approx(np.array(v) + w * (arm @ turn.T)[:, ::-1] * [-1, 1], abs=1e-6)
    assert compute_energy_balance_row(system, state, steps).balance_error(system.initial_energy) == pytest.approx(
        0, abs=2e-5
    )  # (w dt)^2 / 4


@pytest.mark.slow
def test_a_rigid_body_falls_and_turns_under_loads() -> None:
    """A body force on its right half: half of it acts, a quarter of its width beside the centre."""
    model, g = falling(gap=0.3, velocity=(0.0, 0.0)), 0.01
    right = tuple(model.grid.ids[(model.grid.bodies.number == 1) & (model.grid.position[:, 0] > 0.5)].tolist())  # type: ignore[union-attr]
    load = Load(nodes=right, body_force=(0.0, -g * MASS / 0.01))
    settings = msgspec.structs.replace(model.settings, conditions=(*model.settings.conditions, load))
    prepared = prepare(replace(model, settings=settings), Options(threads=1))
    system, state = prepared
    prepared.advance(1, 201)
    t, rows = 200 * system.time_step, np.flatnonzero(model.grid.bodies.number == 1)  # type: ignore[union-attr]
    speed, place = state.rate[rows], model.grid.position[rows] + state.value[rows]
    assert speed.mean(axis=0) == pytest.approx([0, -g / 2 * t], abs=1e-12)
    arm = place - place.mean(axis=0)
    spin = np.linalg.lstsq(np.concatenate([-arm[:, 1], arm[:, 0]])[:, None], (speed - speed.mean(axis=0)).T.ravel())[0]
    inertia = MASS * (2 * 0.1**2 / 12) * (1 - 1 / 10**2)  # of its 10 by 10 nodes
    assert spin[0] == pytest.approx(-MASS * g / 2 * 0.025 * t / inertia, rel=0.01)  # while it has turned by .1
    found = compute_energy_balance_row(system, state, 200)
    assert found.kinetic == pytest.approx(found.work, rel=1e-5)


@pytest.mark.slow
def test_a_held_body_keeps_its_velocity_and_its_work_is_booked() -> None:
    model = falling(mass=None, held=("x", "y", "spin"), profile=((0.0, 1.0), (2.0, 1.0), (4.0, 0.0)))
    prepared = prepare(model, Options(threads=1))
    system, state = prepared
    last = 1 + int(8 / system.time_step)
    prepared.advance(1, last)
    rows = system.model.grid.bodies.number == 1  # type: ignore[union-attr]
    assert state.value[rows, 1] == pytest.approx(-3 * V, rel=1e-3)
    assert state.value[rows, 0] == pytest.approx(0, abs=1e-15)
    entry = compute_energy_balance_row(system, state, last - 1)
    assert entry.work > 1e-7
    assert abs(entry.balance_error(system.initial_energy)) < 5e-3


@pytest.mark.slow
def test_the_reaction_of_a_rigid_body_is_its_force_on_what_it_touches() -> None:
    prepared = prepare(falling(), Options(threads=1))
    system, state = prepared
    rows, pushed, before = system.model.grid.bodies.number == 1, 0.0, -V  # type: ignore[union-attr]
    for step in range(1, 301):
        prepared.advance(step, step + 1)
        (found,) = compute_condition_forces(system, state, step, step * system.time_step)
        assert found.kind == "rigid"
        pushed -= found.force_y * system.time_step
    # the last velocity holds half of the last force
    assert pushed == pytest.approx(MASS * (state.rate[rows, 1].mean() - before), rel=1e-12)
    assert pushed > 0.8 * MASS * V
    assert found.displacement_y == pytest.approx(state.value[rows, 1].mean(), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("held", [(), ("x", "spin")])
def test_a_resumed_run_with_rigid_bodies_has_the_same_bits(held: tuple[str, ...], tmp_path: Path) -> None:
    model = falling(spin=0.02, friction=0.02, held=held, run=Run(steps=240, every=20, ledger=20))
    whole, count = simulate(model, options=Options(threads=1)), 0

    def stop(_: object) -> bool:
        nonlocal count
        count += 1
        return count > 6

    path = tmp_path / "stopped.sqlite"
    simulate(model, path, Options(threads=1), stop).close()
    resume(path, threads=2)
    with Results.open(path) as again:
        for name in ("ux", "uy", "vx", "vy"):
            assert np.array_equal(whole.field(name, 240), again.field(name, 240))
        assert np.array_equal(whole.reactions(), again.reactions())


def rigid(**changed: Any) -> Model:
    """The model of a falling block whose own condition is changed."""
    model = falling()
    (body,) = model.settings.conditions
    settings = msgspec.structs.replace(model.settings, conditions=(msgspec.structs.replace(body, **changed),))
    return Model(replace(model.grid, bodies=model.grid.bodies._replace(rigid=())), settings)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"mass": None}, "$.conditions[0].mass"),
        ({"mass": None, "held": ("x", "y")}, "$.conditions[0].mass"),
        ({"held": ("z",)}, "$.conditions[0].held"),
        ({"spin": (0.0, 0.0, 1.0)}, "$.conditions[0].spin"),
        ({"nodes": None, "box": (0.0, 0.0, 1.0, 1.0)}, "$.conditions[0]"),
        ({"nodes": (1001, 1002)}, "$.conditions[0]"),
    ],
)
def test_what_no_rigid_body_can_be_is_refused(changed: dict[str, Any], named: str) -> None:
    with pytest.raises(ModelError, match=naming(named)):
        rigid(**changed)


def test_conditions_of_a_rigid_body_and_its_contact_are_its_own() -> None:
    model = falling()
    for own in (Displacement(box=(0.4, 0.15, 0.6, 0.2), x=0.0), Velocity(box=(0.4, 0.15, 0.6, 0.2), y=0.0)):
        settings = msgspec.structs.replace(model.settings, conditions=(*model.settings.conditions, own))
        with pytest.raises(ModelError, match=naming("$.conditions[1]", found="rigid", expected="held")):
            replace(model, settings=settings)
    with pytest.raises(ModelError, match=naming("$.contact")):
        prepare(replace(model, settings=msgspec.structs.replace(model.settings, contact=None)), Options())
    with pytest.raises(ModelError, match=naming("$.conditions[0]", "static", found="rigid")):
        prepare(replace(model, settings=msgspec.structs.replace(model.settings, run=Run(solver="static"))), Options())


def test_a_scene_refuses_a_free_body_without_mass() -> None:
    with pytest.raises(SceneError, match=naming("body 'block'", "mass", expected="kg/m")):
        Scene(box(0, 0, 1, 0.1), H, UNIT).rigid(box(0, 0.2, 0.1, 0.3), "block")
    with pytest.raises(SceneError, match=naming("block", "velocity")):
        Scene(box(0, 0, 1, 0.1), H, UNIT).rigid(box(0, 0.2, 0.1, 0.3), "block", 1.0, (1.0,))  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=naming("block", "held")):
        Scene(box(0, 0, 1, 0.1), H, UNIT).rigid(box(0, 0.2, 0.1, 0.3), "block", held=("w",))


def test_the_file_holds_the_rigid_body() -> None:
    model = falling(spin=0.1, held=("x",))
    (body,) = model.settings.conditions
    assert isinstance(body, RigidBody)
    assert (body.mass, body.y, body.spin, body.held) == (MASS, -V, 0.1, ("x",))
    assert model.rho[model.selected(body)] @ model.grid.cells[model.selected(body)] == pytest.approx(MASS, rel=1e-14)
