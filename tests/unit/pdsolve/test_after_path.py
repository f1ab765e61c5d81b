"""The motion after a path: what it begins from, how long it is, and what it lets go."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace as Part
from typing import Any

import msgspec
import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Run
from pdsolve.model import Model
from pdsolve.run import after_path
from pdsolve.run.after_path import _model_in_motion, _set_first_accelerations, prepare_motion_after
from pdsolve.run.system import Prepared

GROWS = ((0.0, 0.0), (2.0, 8.0))


@pytest.fixture
def path_model() -> Model:
    """A plate that is held on one side and pulled on the other."""
    held = Displacement(box=(-1.0, -1.0, 1.0, 1e-4), y=0.0, profile=GROWS)
    load = Load(box=(-1.0, 3e-3, 1.0, 1.0), body_force=(0.0, 1e9), profile=((0.0, 0.0), (1.0, 1.0)))
    return plate(square_grid(5, 5), conditions=(held, load), run=Run(solver="static", steps=7, after="motion"))


def test_loads_stay_at_what_they_are_at_a_factor(path_model: Model) -> None:
    model = _model_in_motion(path_model, 0.25)
    assert [one.profile for one in model.settings.conditions] == [((0.0, 1.0),), ((0.0, 0.25),)]
    run = model.settings.run
    assert (run.solver, run.after, run.time_step) == ("explicit", "path", None)


def test_a_body_begins_to_move_where_nothing_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(after_path, "force_densities", lambda operator, state: np.array([[1.0, 2.0], [3.0, 4.0]]))
    drive = Part(force=np.array([[10.0, 20.0], [30.0, 40.0]]), holds=Part(node=np.array([1]), axis=np.array([0])))
    system: Any = Part(operator=None, drive=drive, model=Part(rho=np.array([1.0, 2.0])))
    state: Any = Part(second=np.full((2, 2), np.nan))
    _set_first_accelerations(system, state)
    assert state.second.tolist() == [[11.0, 22.0], [0.0, 22.0]]


@dataclasses.dataclass
class System:
    """A system as far as the motion asks it."""

    model: Model


@pytest.mark.parametrize(("ahead", "every", "entries"), [(2000, 40, 4), (20, 1, 1)])
def test_it_goes_on_from_the_path(
    ahead: int, every: int, entries: int, path_model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps count on; what is restored is the path's checkpoint and its breaks, before anything is let go."""
    done: list[tuple[Any, ...]] = []

    def prepare(model: Model, options: Any) -> Prepared:
        done.append(("prepare", model.settings.conditions[1].profile, *options[:4]))
        run = msgspec.structs.replace(model.settings.run, steps=ahead)
        settings = msgspec.structs.replace(model.settings, run=run)
        return Prepared(System(dataclasses.replace(model, settings=settings)), "state")  # type: ignore[arg-type]

    monkeypatch.setattr(after_path, "prepare", prepare)
    monkeypatch.setattr(after_path, "model_of", lambda text, name: path_model)
    monkeypatch.setattr(after_path, "restore_state", lambda *words: done.append(("restore", *words[1:])))
    monkeypatch.setattr(after_path, "_set_first_accelerations", lambda system, state: done.append(("let go", state)))
    path: Any = Part(name="path.sqlite", model=lambda: "text", breaks=lambda: "breaks")
    path.checkpoint, path.meta, path.summary = lambda: (7, "kept"), lambda: {"mode": "thesis"}, lambda: {"lost": 0.5}
    (system, state), step = prepare_motion_after(path, 3)
    assert (state, step) == ("state", 7)
    assert done == [
        ("prepare", ((0.0, 0.5),), "thesis", "float64", 3, "listed"),
        ("restore", "state", 7, "kept", "breaks"),
        ("let go", "state"),
    ]
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
    monkeypatch.setattr(after_path, "model_of", lambda text, name: dataclasses.replace(path_model, settings=settings))
    path: Any = Part(name="", meta=lambda: {"status": status}, summary=lambda: {"lost": lost}, model=lambda: "")
    assert after_path.is_motion_to_follow(path) is follows
