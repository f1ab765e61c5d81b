"""Models that several benchmarks solve: shipped scenes, and nodes on one lattice."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh import Body, Scene, build
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.document import Lattice
from pdmesh.model.node_grid import Grid, whole_lattice
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

GEOMETRIES = Path(__file__).parents[1] / "geometries"
BODIES = (  # in space
    *("ball_through_glass.py", "branching_block.py", "expanding_ring.py", "inclined_penny.py"),
    *("kalthoff_winkler_block.py", "lug.geo", "penny.geo", "screw.geo", "slanted_notch.py"),
)
SCENES = sorted(path for path in GEOMETRIES.iterdir() if path.suffix in (".geo", ".py"))
PLATES = [path for path in SCENES if path.name not in BODIES]


def scene_model(file: str, parameters: Iterable[tuple[str, str]] = ()) -> Model:
    """A shipped scene with values of its parameters, by their names. Raises SceneError."""
    scene = build_file(GEOMETRIES / file, list(parameters), trust=True)
    return Model(scene.grid, scene.settings, file)


def model_of(geometry: Scene | Body) -> Model:
    """The model of a plate or a body that is drawn in Python. Raises SceneError."""
    built = build(geometry)
    return Model(built.grid, built.settings)


def with_run(model: Model, **changes: object) -> Model:
    """The model with other settings of its run."""
    run = msgspec.structs.replace(model.settings.run, **changes)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))


def lattice_grid(*counts: int) -> Grid:
    """So many nodes along each of two or three axes, 1 mm apart, without cracks."""
    lattice = Lattice((0.0,) * len(counts), 1e-3, *counts)
    return whole_lattice(lattice, cracks=np.empty((0, 4 if len(counts) == 2 else 9)))


def grid_of_nodes(position: NDArray[np.float64], spacing: float, cracks: Iterable[Any] = (), **fields: Any) -> Grid:
    """Nodes at places (n, 2) or (n, 3), m, of one spacing, m, none of them at a border; `fields` are others of a grid.

    Each crack of a plate is (x, y) of its two ends, m.
    """
    count, dimension = position.shape
    return Grid(
        ids=np.arange(1, count + 1),
        position=position,
        delta=np.full(count, spacing),
        border=np.zeros(count, dtype=bool),
        hole_id=np.full(count, -1),
        cracks=np.array(list(cracks), dtype=float).reshape(-1, 4 if dimension == 2 else 9),
        **fields,
    )


def shaken(model: Model, options: Options, amplitude: float = 1e-10) -> PreparedRun:
    """A run of a model whose displacements, m, are small and random, so that nothing breaks."""
    prepared = prepare(model, options)
    prepared.state.value[:] = amplitude * np.random.default_rng(0).standard_normal(prepared.state.value.shape)
    return prepared
