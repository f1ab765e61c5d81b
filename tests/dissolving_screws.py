"""The dissolving screw of the multi-adaptive source, scaled: radius 1, height 4, a slot; held from a radius of 6 on."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Run, Settings, Solid
from pdmesh.model.medium import Medium
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model

END = 2.0  # radius^2 / D


def lattice(spacing: float, reach: float) -> NDArray[np.float64]:
    """The middles (n, 3) of cubes around the origin that are within `reach` of it."""
    side = int(reach / spacing) + 1
    along = (np.arange(-side, side) + 0.5) * spacing
    z, y, x = (axis.ravel() for axis in np.meshgrid(along, along, along, indexing="ij"))
    there = np.sqrt(x**2 + y**2 + z**2) < reach
    return np.column_stack([x[there], y[there], z[there]])


def screw(spacing: float, steps: int, coarse: bool = False) -> Model:
    """The screw in liquid; `coarse`: outside of a cylinder around it nodes are twice as far apart, by collocation."""
    widest = 2 * spacing if coarse else spacing
    position = lattice(widest, 6 + 4 * widest)
    delta = np.full(len(position), widest)
    if coarse:
        near = (np.hypot(*position[:, :2].T) < 2.1) & (np.abs(position[:, 2]) < 3.1)
        corners = np.array(list(product((-0.5, 0.5), repeat=3))) * spacing
        fine = (position[near, None, :] + corners).reshape(-1, 3)
        position = np.concatenate([fine[np.lexsort(fine.T)], position[~near]])
        delta = np.concatenate([np.full(len(fine), spacing), delta[~near]])
    x, y, z = position.T
    nodes = len(x)
    solid = (np.hypot(x, y) < 1) & (np.abs(z) < 2) & ~((np.abs(y) < 0.25) & (z > 1.5))
    held = np.sqrt(x**2 + y**2 + z**2) >= 6
    nowhere = np.full(nodes, -1)
    grid = Grid(np.arange(1, nodes + 1), position, delta, nowhere > 0, nowhere, np.empty((0, 9)))
    dissolves = Solid(nodes=tuple((np.flatnonzero(solid) + 1).tolist()))
    clean = Concentration(nodes=tuple((np.flatnonzero(held) + 1).tolist()), value=0.0)
    run = Run(steps=steps, time_step=END / steps, every=steps, adapt="collocation" if coarse else "none")
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.2)
    return Model(grid, Settings(physics="diffusion", medium=medium, conditions=(dissolves, clean), run=run))
