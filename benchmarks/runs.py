"""Models and results of the cases of the thesis."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np

from benchmarks.claims import Case
from benchmarks.models import scene_model, with_run
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate


@functools.cache
def case_model(case: Case) -> Model:
    """The model of a case of the thesis."""
    model = scene_model(case.scene, case.parameters)
    if not case.noise:
        return model
    noise = case.noise * np.random.default_rng(0).standard_normal(model.grid.position.shape)
    noise[model.grid.border] = 0.0  # a node outside the outline has no bonds
    return dataclasses.replace(model, grid=dataclasses.replace(model.grid, position=model.grid.position + noise))


def solved(case: Case, mode: str, folder: Path) -> Path:
    """The results of a case in a mode, solved in `folder` unless they are there already."""
    path = folder / f"{case.name}.{mode}.sqlite"
    if not path.exists():
        simulate(case_model(case), path, Options(mode)).close()
    return path


def first_steps(case: Case, mode: str, folder: Path, steps: tuple[int, ...]) -> Path:
    """The accelerations of the first steps of a case."""
    path = folder / f"{case.name}.{mode}.first.sqlite"
    if not path.exists():
        every = int(np.gcd.reduce(steps))
        model = with_run(case_model(case), steps=max(steps), every=every, fields=("ax", "ay", "uy", "damage"))
        simulate(model, path, Options(mode)).close()
    return path
