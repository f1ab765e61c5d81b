"""What every stepper keeps: the last step that it took, and a memory from which another one goes on bit by bit."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.kinds_of_run import KINDS
from pdsolve.run import simulation
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import list_breaks_since
from pdsolve.run.subdomain import make_checkpoint, restore_state
from pdsolve.run.system import PreparedRun
from pdsolve.state import State

NODES_CHANGE = {"hybrid", "collocation", "split"}  # whose nodes a checkpoint restores first; see tests/formats
STEPS = 2  # before the checkpoint, and after it
MANY = 1000  # steps, more than a life of the kinds here has
pytestmark = pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")  # bodies this small jump
QUICK = ("at rest", "bonds", "diffusion", "dissolution, implicit", "fatigue", "fatigue by K", "heat at rest")
KINDS_OF_STEPPER = [
    pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in sorted(KINDS.keys() - NODES_CHANGE)
]


def prepared_kind(kind: str) -> PreparedRun:
    """A small run of this kind, ready to march."""
    model, options = KINDS[kind]()
    return prepare(model, options)


@pytest.mark.parametrize("kind", KINDS_OF_STEPPER)
def test_a_restored_stepper_goes_on_bit_by_bit(kind: str) -> None:
    """A second run, restored from a checkpoint of the first, ends with the same state, checkpoint and summary."""
    first, second = prepared_kind(kind), prepared_kind(kind)
    stepper = first.system.stepper
    assert stepper.advance(first.state, 1, STEPS + 1) == STEPS
    stepper.synchronize()
    checkpoint = {name: values.copy() for name, values in make_checkpoint(*first).items()}
    restore_state(*second, STEPS, checkpoint, list_breaks_since(first.system, 0))
    for run in (first, second):
        last = run.system.stepper.advance(run.state, STEPS + 1, 2 * STEPS + 1)
        assert last == 2 * STEPS or run.system.stepper.finished
        run.system.stepper.synchronize()
    ends = [make_checkpoint(*run) for run in (first, second)]
    assert ends[0].keys() == ends[1].keys() >= set(State._fields)
    for name, values in ends[0].items():
        assert values.tobytes() == ends[1][name].tobytes(), name
    assert json.dumps(first.system.stepper.summary()) == json.dumps(second.system.stepper.summary())


def test_a_life_that_has_ended_returns_its_last_step() -> None:
    """However many steps are asked for, so that a checkpoint after the step returned holds as many."""
    first, second = prepared_kind("fatigue"), prepared_kind("fatigue")
    last = first.system.stepper.advance(first.state, 1, MANY)
    assert first.system.stepper.finished
    assert last == len(first.system.stepper.summary()["fatigue_steps"]) < MANY - 1
    assert first.system.stepper.advance(first.state, last + 1, MANY) == last
    checkpoint = {name: values.copy() for name, values in make_checkpoint(*first).items()}
    restore_state(*second, last, checkpoint, list_breaks_since(first.system, 0))


@pytest.mark.parametrize("kind", QUICK)
def test_profiles_follow_the_time_or_a_load_factor(kind: str) -> None:
    """A time integration has no load factor; that of a path or a cycle is finite."""
    system, state = prepared_kind(kind)
    system.stepper.advance(state, 1, 2)
    factor = system.stepper.load_factor
    expected = system.time_step if factor is None else factor
    assert np.isfinite(expected)
    assert system.profile_time_or_load_factor(1) == expected


@pytest.mark.parametrize("kind", ["bonds", "heat at rest", "fatigue", "fatigue by K"])
def test_a_stepper_forgets_its_run(kind: str) -> None:
    """Nobody is told of equilibria after a run, so that its system and state are freed with the last reference."""
    system, state = prepared_kind(kind)
    simulation.run(system, state).close()
    assert system.stepper.on_progress is None
    assert system.stepper.inner is None or system.stepper.inner.on_progress is None
