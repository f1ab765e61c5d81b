"""Building and solving the cases of the thesis."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.claims import Case
from pdmesh.__main__ import main as pdmesh
from pdsolve.model import Model, read_model
from pdsolve.run.simulation import Options, simulate

GEOMETRIES = Path(__file__).parent.parent / "geometries"
BODIES = (
    "ball_through_glass.py",
    "branching_block.py",
    "expanding_ring.py",
    "inclined_penny.py",
    "kalthoff_winkler_block.py",
    "lug.geo",
    "penny.geo",
    "screw.geo",
    "slanted_notch.py",
)  # in space
PLATES = sorted(path for path in GEOMETRIES.iterdir() if path.suffix in (".geo", ".py") and path.name not in BODIES)


def built(case: Case, folder: Path) -> Model:
    """The model of a case, built in `folder` unless it is there already."""
    path = folder / f"{case.name}.json"
    if not path.exists():
        overrides = [
            word
            for name, value in case.parameters
            for word in ((name, value) if name.startswith("--") else ("--set", f"{name}={value}"))
        ]
        code = pdmesh(["build", str(GEOMETRIES / case.scene), "-o", str(path), "-q", "--trust", *overrides])
        if code:
            raise RuntimeError(f"{case.scene} could not be built")
    model = read_model(path)
    if not case.noise:
        return model
    grid = model.grid
    noise = case.noise * np.random.default_rng(0).standard_normal(grid.position.shape)
    noise[grid.border] = 0.0  # a node outside the outline has no bonds
    return dataclasses.replace(model, grid=dataclasses.replace(grid, position=grid.position + noise))


def solved(case: Case, mode: str, folder: Path) -> Path:
    """The results of a case in a mode, solved in `folder` unless they are there already."""
    path = folder / f"{case.name}.{mode}.sqlite"
    if not path.exists():
        simulate(built(case, folder), path, Options(mode)).close()
    return path


def first_steps(case: Case, mode: str, folder: Path, steps: tuple[int, ...]) -> Path:
    """The accelerations of the first steps of a case."""
    path = folder / f"{case.name}.{mode}.first.sqlite"
    if not path.exists():
        model = built(case, folder)
        every = int(np.gcd.reduce(steps))
        run = msgspec.structs.replace(
            model.settings.run, steps=max(steps), every=every, fields=("ax", "ay", "uy", "damage")
        )
        settings = msgspec.structs.replace(model.settings, run=run)
        simulate(dataclasses.replace(model, settings=settings), path, Options(mode)).close()
    return path
