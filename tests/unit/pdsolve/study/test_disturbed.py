"""Disturbances are as large as they are stated, the same for the same seed, and change nothing else."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Run
from pdsolve.model import Model, ModelError
from pdsolve.study.description import Repeat
from pdsolve.study.run_model import disturbed

DELTA = 1e-3
STEP = 5e-8


def cracked(*cracks: tuple[float, float, float, float], **run: object) -> Model:
    """A plate of 21 x 12 nodes from (0, 0) with these cracks."""
    grid = dataclasses.replace(square_grid(21, 12, DELTA), cracks=np.array(cracks).reshape(-1, 4))
    return plate(grid, run=Run(**{"steps": 1000, **run}))  # type: ignore[arg-type]


def test_a_notch_moves_across_itself_and_still_begins_at_the_edge() -> None:
    model = cracked((0.0, 5.5e-3, 8e-3, 5.5e-3))
    shifts = []
    for repetition in range(1, 40):
        ((x0, y0, x1, y1),) = disturbed(model, Repeat(notch=0.25), repetition, STEP).grid.cracks
        assert y0 == y1
        assert x0 == pytest.approx(-abs(y0 - 5.5e-3), abs=1e-15)  # drawn out by as much
        assert x1 == 8e-3
        shifts.append((y0 - 5.5e-3) / DELTA)
    assert -0.25 < min(shifts) < -0.2  # 39 draws
    assert 0.2 < max(shifts) < 0.25


def test_a_crack_with_a_kink_moves_as_one() -> None:
    model = cracked((3e-3, 5e-3, 8e-3, 5e-3), (8e-3, 5e-3, 10e-3, 8e-3), (12e-3, 2e-3, 12e-3, 4e-3))
    shift = disturbed(model, Repeat(notch=0.25), 1, STEP).grid.cracks - model.grid.cracks
    assert np.allclose(shift[0], shift[1], atol=1e-15)  # the first across: along y
    assert abs(shift[0, 1]) > 0
    assert shift[0, [0, 2]] == pytest.approx(0.0, abs=1e-18)
    assert shift[2] == pytest.approx([-shift[0, 1], 0.0, -shift[0, 1], 0.0], abs=1e-15)  # a crack of its own, upright


def test_a_step_is_shortened_and_the_run_is_as_long() -> None:
    for repetition in range(1, 20):
        run = disturbed(cracked(), Repeat(step=0.1), repetition, STEP).settings.run
        assert run.time_step is not None
        assert 0.9 * STEP <= run.time_step < STEP
        assert 0 <= run.steps * run.time_step - 1000 * STEP < run.time_step


def test_noise_has_its_deviation_and_leaves_the_edge_alone() -> None:
    model = cracked()
    moved = (disturbed(model, Repeat(noise=0.02), 1, STEP).grid.position - model.grid.position).reshape(12, 21, 2)
    assert not moved[[0, -1]].any()
    assert not moved[:, [0, -1]].any()
    assert moved[1:-1, 1:-1].std() == pytest.approx(0.02 * DELTA, rel=0.1)  # of 380 draws; found 0.0199


def test_the_same_seed_makes_the_same_run_and_another_another() -> None:
    model, some = cracked((0.0, 5.5e-3, 8e-3, 5.5e-3)), Repeat(seed=3, notch=0.1, step=0.1, noise=0.01)
    one, same, next_one, other = (
        disturbed(model, repeat, number, STEP)
        for repeat, number in ((some, 1), (some, 1), (some, 2), (msgspec.structs.replace(some, seed=4), 1))
    )
    assert one.to_json() == same.to_json()
    assert len({one.to_json(), next_one.to_json(), other.to_json()}) == 3
    assert disturbed(model, some, 0, STEP) is model


@pytest.mark.parametrize(
    ("model", "repeat", "said"),
    [
        (cracked(), Repeat(notch=0.1), naming("repeat.notch", found="pre-crack")),
        (cracked(solver="static"), Repeat(step=0.1), naming("repeat.step")),
        (
            cracked(adapt="hybrid"),
            Repeat(noise=0.1),
            naming("repeat.noise", found="run.adapt is hybrid", expected=("notch", "step")),
        ),
    ],
)
def test_what_cannot_be_disturbed_so_is_refused(model: Model, repeat: Repeat, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        disturbed(model, repeat, 1, STEP)
