"""Models of diffusion that tests share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Horizon, Run, Settings, Solid
from pdmesh.model.medium import Medium
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model

CORRODING = Medium(D=1.0, C_solid=1.0, C_sat=0.2)


def grid(position: NDArray[np.float64], spacing: float) -> Grid:
    """Nodes at these places (n, d), m, of one spacing; cells are whole."""
    nodes = len(position)
    nowhere = np.full(nodes, -1)
    return Grid(np.arange(1, nodes + 1), position, np.full(nodes, spacing), nowhere > 0, nowhere, np.empty((0, 4)))


def lattice(spacing: float, reach: float, dimension: int) -> NDArray[np.float64]:
    """The nodes of a lattice around the origin, half a spacing from it, within `reach`; all in m."""
    side = int(reach / spacing) + 1
    along = (np.arange(-side, side) + 0.5) * spacing
    axes = np.meshgrid(*[along] * dimension, indexing="ij")[::-1]
    position = np.column_stack([axis.ravel() for axis in axes])
    return np.asarray(position[np.linalg.norm(position, axis=1) < reach])


def row(cells: int, spacing: float, before: int = 0) -> NDArray[np.float64]:
    """Nodes of a bar, the first `before` of them left of the origin."""
    return np.column_stack([(np.arange(-before, cells) + 0.5) * spacing, np.zeros(cells + before)])


def ids(which: NDArray[np.bool_]) -> tuple[int, ...]:
    """Of the nodes (n,) that are marked."""
    return tuple((np.flatnonzero(which) + 1).tolist())


def model(position: NDArray[np.float64], spacing: float, medium: Medium, ratio: float = 3.0, **more: object) -> Model:
    """A model of diffusion on these nodes."""
    settings = Settings(physics="diffusion", medium=medium, horizon=Horizon(ratio), **more)  # type: ignore[arg-type]
    return Model(grid(position, spacing), settings)


def disc(spacing: float, steps: int, medium: Medium = CORRODING, end: float = 2.5, every: int = 1) -> Model:
    """A disc of radius 1 that dissolves; from a radius of 3 on nothing is dissolved. Frames at `every` tenth."""
    position = lattice(spacing, 3 + 4 * spacing, 2)
    radius = np.linalg.norm(position, axis=1)
    conditions = Solid(nodes=ids(radius < 1)), Concentration(nodes=ids(radius >= 3), value=0.0)
    run = Run(steps=steps, time_step=end / steps, every=steps // every)
    return model(position, spacing, medium, conditions=conditions, run=run)
