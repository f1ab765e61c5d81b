"""Paths of bonds that soften: quadratic convergence, runs that are killed, and bodies that nothing supports."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest
from database_contents import contents, kill_when
from messages import naming
from softening_bars import beam

from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import Model, ModelError, read_model
from pdsolve.options import Options
from pdsolve.rest.continuation import FEW, SofteningPathSteps
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume, simulate

ONE = Options(threads=1)
ROUND_OFF = 1e-11  # of the loads: residuals below are not compared


def notched(by: str = "displacement", **law: Any) -> Model:
    """A coarse notched beam of this law, solved to round-off."""
    model = beam(0.02, by, load_steps=80)
    assert model.settings.material is not None
    static = msgspec.structs.replace(model.settings.run.static, tolerance=1e-10)
    run = msgspec.structs.replace(model.settings.run, static=static)
    material = msgspec.structs.replace(model.settings.material, **law)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, material=material, run=run))


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"model": "micropolar", "nu": 0.2}], ids=["springs", "shear"])
def test_convergence_is_quadratic(law: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each residual is at most a multiple of the square of the one before, once it is decided which bonds load."""
    monkeypatch.setattr("pdsolve.rest.path.COARSEST", 1e-11)
    monkeypatch.setattr("pdsolve.rest.continuation.LEFT", 1e-11)
    prepared, found = prepare(notched(**law), ONE), dict[int, list[float]]()
    stepper = prepared.system.stepper
    assert isinstance(stepper, SofteningPathSteps)
    stepper.on_progress = lambda going: found.setdefault(going.step, []).append(going.residual)
    prepared.advance(1, 12)
    decided = [residuals for step, residuals in found.items() if step > 1 and len(residuals) <= FEW]
    near = [(before, after) for one in decided for before, after in pairwise(one) if before < 1e-3]
    assert len(near) > 8
    for before, after in near:
        assert after < 0.1 * before**2 + ROUND_OFF  # measured: at most 0.045 times the square


@pytest.mark.slow
def test_a_killed_path_goes_on_to_the_same_tables(tmp_path: Path) -> None:
    """kill -9 of the command amid the path."""
    document, path, whole = (tmp_path / name for name in ("beam.json", "killed.sqlite", "whole.sqlite"))
    model = beam(0.02)
    write_file(document_of(model.grid, model.settings), document)
    command = ["-m", "pdsolve", str(document), "--threads", "1", "-o", str(path)]
    kill_when(lambda results: results.checkpoint() is not None and len(results.frames()[0]) >= 6, path, command)
    resume(path, threads=1).close()
    simulate(read_model(document), whole, ONE).close()
    assert contents(path) == contents(whole)


@pytest.mark.parametrize("law", [{}, {"model": "micropolar", "nu": 0.2}], ids=["springs", "shear"])
def test_a_body_that_nothing_supports_is_refused(law: dict[str, Any]) -> None:
    """One node that holds it leaves it free to turn."""
    model = notched("load", **law)
    settings = msgspec.structs.replace(model.settings, conditions=model.settings.conditions[::2])
    with pytest.raises(ModelError, match=naming("$.conditions", found="the whole plate", expected="supports")):
        prepare(dataclasses.replace(model, settings=settings), ONE)
