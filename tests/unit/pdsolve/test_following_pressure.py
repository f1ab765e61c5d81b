"""Pressure that follows its faces, as an operator."""

from __future__ import annotations

import numpy as np
import pytest

from pdmesh import Body, Circle, Material, Scene, box, build
from pdmesh.model.document import Load
from pdmesh.model.load_resultants import nodal_forces
from pdmesh.model.pressed_faces import area_vectors
from pdmesh.scene.solids import Sheet, brick
from pdsolve.model import Model
from pdsolve.operators.following_pressure import FollowingPressure
from pdsolve.state import Unknown, zero_state

GLASS = Material(E=65e9, rho=2235, G0=204)
P = 1e6
RAMP = ((0.0, 0.0), (1.0, 2.0))


def holed(profile: tuple[tuple[float, float], ...] = ()) -> Model:
    plate = Scene(box(0, 0, 0.02, 0.016), 1e-3, GLASS).hole(Circle(0.0093, 0.0078, 0.004))
    built = build(plate.load("hole nearest 0.009,0.008", pressure=P, following=True, profile=profile))
    return Model(built.grid, built.settings)


def block() -> Model:
    """All faces of a block, which a sheet has."""
    shell = brick((0, 0, 0), (0.006, 0.005, 0.004))
    built = build(Body(shell, 1e-3, GLASS).load(Sheet(shell.triangles), pressure=P, following=True))
    return Model(built.grid, built.settings)


def operator_of(model: Model) -> FollowingPressure:
    loads = [load for load in model.settings.conditions if isinstance(load, Load)]
    return FollowingPressure(model, loads, model.grid.cells, (Unknown("u", model.grid.dimension, 2),))


def swept(operator: FollowingPressure, u: np.ndarray) -> float:
    """What faces enclose, out of the material, m^2 or m^3, with their corners moved."""
    size = 0.0
    for pressed in operator._pressed:
        x = pressed.pieces.corners + pressed.pieces.weights @ u[pressed.rows]
        middle = x[pressed.pieces.pieces].mean(axis=1)
        size += float((middle * area_vectors(x, pressed.pieces.pieces)).sum()) / x.shape[1]
    return size


@pytest.mark.parametrize("make", [holed, pytest.param(block, marks=pytest.mark.slow)])
def test_its_work_is_the_pressure_times_what_faces_sweep(make: type) -> None:
    """In the plane the force is linear in displacements, so that the trapezoidal rule is exact."""
    model = make()
    operator, volume = operator_of(model), model.grid.cells
    rng, shape = np.random.default_rng(3), model.grid.position.shape
    first, way = 1e-4 * rng.standard_normal(shape), 1e-6 * rng.standard_normal(shape)
    dead = np.zeros(shape)
    for load in model.settings.conditions:
        assert isinstance(load, Load)
        rows = model.selected(load)
        dead[rows] += nodal_forces(load, model.grid, rows)
    state = zero_state(*shape)
    state.value[:], state.rate[:] = first + way, way / 1e-7
    out = np.zeros(shape)
    operator.accumulate_force(state, out, 1, 1e-7)
    work = float(volume @ state.work + (dead * way).sum())
    assert work == pytest.approx(-P * (swept(operator, first + way) - swept(operator, first)), rel=1e-4)
    total = dead + volume[:, None] * out  # of closed faces, which may have any shape
    assert np.abs(total.sum(axis=0)).max() < 1e-10 * np.abs(total).sum()


def test_it_adds_nothing_to_what_has_not_moved_and_follows_its_profile() -> None:
    model = holed(RAMP)
    operator, shape = operator_of(model), model.grid.position.shape
    state, out = zero_state(*shape), np.zeros(shape)
    operator.accumulate_force(state, out, 1, 0.5)
    assert not out.any()
    state.value[:, 0] = 1e-3 * model.grid.position[:, 0]
    half, full = np.zeros(shape), np.zeros(shape)
    operator.accumulate_force(state, half, 1, 0.25)
    operator.accumulate_force(state, full, 2, 0.25)
    assert full == pytest.approx(2 * half, rel=1e-12)
    again = operator_of(model)
    again.restore(operator.checkpoint_arrays(), operator.broken())
    same = np.zeros(shape)
    again.accumulate_force(state, same, 0, 0.0)  # at the time of the last forces
    assert np.array_equal(same, full)


def test_its_bound_covers_its_stiffness() -> None:
    """No displacement of one node changes its own force by more than twice the bound."""
    model = holed()
    operator, shape = operator_of(model), model.grid.position.shape
    bound = operator.stiffness_bound()
    for row in np.flatnonzero(bound)[::7]:
        for axis in range(2):
            state, out = zero_state(*shape), np.zeros(shape)
            state.value[row, axis] = 1e-6
            operator.accumulate_force(state, out, 0, 0.0)
            assert np.abs(out[row]).max() <= 2e-6 * bound[row]


def test_a_face_that_grows_is_pressed_more() -> None:
    built = build(Body(brick((0, 0, 0), (0.006, 0.006, 0.006)), 1e-3, GLASS).load("top", pressure=P, following=True))
    operator = operator_of(Model(built.grid, built.settings))
    state, out = zero_state(*built.grid.position.shape), np.zeros(built.grid.position.shape)
    state.value[:, 0] = 0.1 * built.grid.position[:, 0]
    operator.accumulate_force(state, out, 0, 0.0)
    force = built.grid.cells @ out
    assert force == pytest.approx([0, 0, -P * 3.6e-5 * 0.1], rel=0.2, abs=1e-9)  # rims move as the nodes within
