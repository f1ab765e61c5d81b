"""Steps of bodies in one sweep each, against Verlet with the same bonds."""

from __future__ import annotations

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from tiled_bodies import CASES, SOFT, body, changed

from pdmesh import Box
from pdmesh.model.document import Absorb, Acceleration, Displacement, Load, Velocity
from pdsolve.conditions import damping
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun
from pdsolve.steppers import verlet_tiles
from pdsolve.steppers.verlet import Verlet
from pdsolve.steppers.verlet_tiles import VerletTiles

STEPS, RAMP = 25, ((0.0, 0.0), (1e-4, 1.0))
BOTTOM, TOP, BACK = (-1, -1, -1, 9, 9, 0.1), (-1, -1, 0.5, 9, 9, 9), (-1, 0.6, -1, 9, 9, 9)


def driven(rate: float = 0.0) -> Model:
    """A body that softens: some of it is held, moved, pushed, pulled more and more, and absorbs; most of it is free."""
    block = body(Box((0, 0, 0), (1.0, 0.7, 0.6)), SOFT)
    conditions = (
        Displacement(box=BOTTOM, x=0.0, y=1e-4, profile=RAMP),
        Velocity(box=(0.2, -1, 0.2, 0.5, 0.1, 9), z=2.0, profile=RAMP),
        Acceleration(box=(0.6, -1, 0.2, 0.7, 0.1, 9), y=1e5),
        Load(box=(0.8, -1, 0.2, 9, 0.1, 9), body_force=(2e9, 1e8, 0.0), profile=RAMP, breakable=True),
        Load(box=TOP, body_force=(0.0, 0.0, 1e8), breakable=True),
        Absorb(box=BACK),
    )
    return changed(block, conditions=conditions, run=msgspec.structs.replace(block.settings.run, damping=rate))


def started(model: Model, threads: int = 1) -> PreparedRun:
    """A body whose nodes fly apart, so that bonds soften and break in each step."""
    prepared = prepare(model, Options(threads=threads))
    velocity = np.random.default_rng(1).standard_normal(prepared.state.rate.shape)
    prepared.state.rate[:] += 60 * velocity * (prepared.system.drive.force == 0)
    return prepared


def outcome(prepared: PreparedRun) -> list[np.ndarray]:
    """All arrays that steps change."""
    operator, state = prepared.system.operator, prepared.state
    broken = operator.broken()
    order = np.lexsort((broken.target, broken.source, broken.step))
    history = operator.checkpoint_arrays().values()
    return [*state, *operator.energies(state), *(column[order] for column in broken), *history]


def of_verlet(model: Model) -> list[np.ndarray]:
    prepared = started(model)
    system = prepared.system
    assert isinstance(system.stepper, VerletTiles)
    Verlet(system.operator, system.drive, model.rho, system.time_step, damping(system.model)).advance(
        prepared.state, 1, STEPS + 1
    )
    return outcome(prepared)


@pytest.mark.process
def test_each_bit_is_that_of_verlet_on_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """In marches of odd and even lengths, on two threads, with room for what breaks in one tile."""
    monkeypatch.setattr(verlet_tiles, "ROOM", 1)
    compare(driven(), 2, (1, 2, 20, STEPS + 1))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["damped", *CASES])
def test_each_bit_is_that_of_verlet(name: str) -> None:
    compare(driven(300.0) if name == "damped" else CASES[name](), 1, (1, STEPS + 1))


def compare(model: Model, threads: int, ends: tuple[int, ...]) -> None:
    """Steps in several marches against those of Verlet: the same arrays."""
    expected, prepared = of_verlet(model), started(model, threads)
    assert len(expected[8]) > 100  # bonds break: measured 3 000 to 200 000
    for first, last in pairwise(ends):
        prepared.advance(first, last)
    for one, other in zip(outcome(prepared), expected, strict=True):
        assert np.array_equal(one, other)
