"""The motion after a path: what it begins from, how long it is, and what it lets go."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace as Part
from typing import Any

import msgspec
import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Run, Spring
from pdsolve.model import Model
from pdsolve.run import initial_states
from pdsolve.run.initial_states import _explicit_model_with_constant_loads, prepare_motion_after_equilibrium_path
from pdsolve.run.system import PreparedRun

GROWS = ((0.0, 0.0), (2.0, 8.0))


@pytest.fixture
def path_model() -> Model:
    """A plate that is held on one side and pulled on the other."""
    held = Displacement(box=(-1.0, -1.0, 1.0, 1e-4), y=0.0, profile=GROWS)
    load = Load(box=(-1.0, 3e-3, 1.0, 1.0), body_force=(0.0, 1e9), profile=((0.0, 0.0), (1.0, 1.0)))
    return plate(square_grid(5, 5), conditions=(held, load), run=Run(solver="static", steps=7, after="motion"))


def test_loads_stay_at_what_they_are_at_a_factor(path_model: Model) -> None:
    model = _explicit_model_with_constant_loads(path_model, 0.25)
    assert [one.profile for one in model.settings.conditions] == [((0.0, 1.0),), ((0.0, 0.25),)]
    bed = Spring(box=(-1.0, -1.0, 1.0, 1e-4), body_stiffness=(1.0, 1.0))
    settings = msgspec.structs.replace(path_model.settings, conditions=(bed,))
    on_springs = _explicit_model_with_constant_loads(dataclasses.replace(path_model, settings=settings), 0.25)
    assert on_springs.settings.conditions == (bed,)
    run = model.settings.run
    assert (run.solver, run.after, run.time_step) == ("explicit", "path", None)


@dataclasses.dataclass
class System:
    """A system as far as the motion asks it; one node is held along x."""

    model: Model
    operator: Any
    drive: Any


@pytest.mark.parametrize(("ahead", "every", "entries"), [(2000, 40, 4), (20, 1, 1)])
def test_it_goes_on_from_the_path(
    ahead: int, every: int, entries: int, path_model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps count on; what is restored is the path's checkpoint and its breaks, before anything is let go: a body
    begins to move where nothing holds it."""
    done: list[tuple[Any, ...]] = []
    nodes = len(path_model.grid)
    drive = Part(force=np.full((nodes, 2), 10.0), holds=Part(node=np.array([1]), axis=np.array([0])))
    first: Any = Part(second=np.full((nodes, 2), np.nan))

    def force_densities(operator: Any, state: Any) -> np.ndarray[Any, Any]:
        done.append(("let go", operator, state))
        return np.arange(2.0 * nodes).reshape(nodes, 2)

    def prepare(model: Model, options: Any) -> PreparedRun:
        done.append(("prepare", model.settings.conditions[1].profile, *options[:4]))
        run = msgspec.structs.replace(model.settings.run, steps=ahead)
        settings = msgspec.structs.replace(model.settings, run=run)
        moving: Any = System(dataclasses.replace(model, settings=settings), "operator", drive)
        return PreparedRun(moving, first)

    monkeypatch.setattr(initial_states, "prepare", prepare)
    monkeypatch.setattr(initial_states, "model_of", lambda text, name: path_model)
    monkeypatch.setattr(initial_states, "restore_state", lambda *words: done.append(("restore", *words[1:])))
    monkeypatch.setattr(initial_states, "force_densities", force_densities)
    path: Any = Part(name="path.sqlite", model=lambda: "text", breaks=lambda: "breaks")
    path.checkpoint, path.meta, path.summary = lambda: (7, "kept"), lambda: {"mode": "thesis"}, lambda: {"lost": 0.5}
    (system, state), step = prepare_motion_after_equilibrium_path(path, 3)
    assert (state, step) == (first, 7)
    assert done == [
        ("prepare", ((0.0, 0.5),), "thesis", "float64", 3, "listed"),
        ("restore", first, 7, "kept", "breaks"),
        ("let go", "operator", first),
    ]
    expected = (np.arange(2.0 * nodes).reshape(nodes, 2) + 10.0) / path_model.rho[:, None]
    expected[1, 0] = 0.0
    assert np.array_equal(state.second, expected)
    run = system.model.settings.run
    assert (run.steps, run.every, run.ledger) == (7 + ahead, every, entries)


@pytest.mark.parametrize(
    ("status", "lost", "after", "follows"),
    [
        ("finished", 0.5, "motion", True),
        ("finished", 0.5, "path", False),
        ("finished", None, "motion", False),
        ("interrupted", 0.5, "motion", False),
    ],
)
def test_when_a_motion_follows(
    status: str, lost: float | None, after: str, follows: bool, path_model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = msgspec.structs.replace(path_model.settings.run, after=after)
    settings = msgspec.structs.replace(path_model.settings, run=run)
    monkeypatch.setattr(
        initial_states, "model_of", lambda text, name: dataclasses.replace(path_model, settings=settings)
    )
    path: Any = Part(name="", meta=lambda: {"status": status}, summary=lambda: {"lost": lost}, model=lambda: "")
    assert initial_states.needs_motion_after_path(path) is follows
