"""A model with a small disturbance: displaced pre-cracks, a shorter time step, or displaced nodes.

The disturbances do not change the problem, but they change how a crack branches.
"""

from __future__ import annotations

import math
from dataclasses import replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import in_steps
from pdmesh.model.graphs import connected
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model, ModelError
from pdsolve.study.description import Repeat

NEAR = 1e-6  # of a spacing: an end this near to the edge of the plate is on it


def disturbed(model: Model, repeat: Repeat, repetition: int, time_step: float) -> Model:
    """The model of a repetition; `time_step`, s, is that of the undisturbed run. Repetition 0 is undisturbed.

    Equal seed and repetition give equal draws. Raises ModelError for a model that cannot be disturbed.
    """
    if repetition == 0:
        return model
    draw = np.random.default_rng([repeat.seed, repetition])
    across, shorter = draw.uniform(-1, 1), draw.uniform(0, 1)
    grid, settings = model.grid, model.settings
    if repeat.step:
        if settings.run.solver == "static":
            raise ModelError(f"{model.name}: repeat.step cannot be used in quasi-static analysis; use notch or noise")
        step = time_step * (1 - repeat.step * shorter)
        run = in_steps(settings.run, time_step)
        steps = math.ceil(run.steps * time_step / step - NEAR)
        settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(run, time_step=step, steps=steps))
    if repeat.notch:
        if not len(grid.cracks):
            raise ModelError(
                f"{model.name}: repeat.notch: there is no pre-crack to move; add one, or use step or noise"
            )
        if grid.dimension == 3:
            raise ModelError(f"{model.name}: repeat.notch cannot be used for a body in space; use step or noise")
        grid = replace(grid, cracks=_moved(grid, repeat.notch * across * float(grid.delta.min())))
    if repeat.noise:
        if settings.run.adapt != "none":
            raise ModelError(
                f"{model.name}: repeat.noise cannot be used with run.adapt {settings.run.adapt}; use notch or step"
            )
        low, high = grid.position.min(axis=0), grid.position.max(axis=0)  # a bare list of nodes marks none as border
        outermost = ((grid.position == low) | (grid.position == high)).any(axis=1)
        inside = ~(grid.border | outermost)  # a node outside the outline has no bonds
        noise = draw.standard_normal(grid.position.shape) * (repeat.noise * grid.delta * inside)[:, None]
        grid = replace(grid, position=grid.position + noise, lattice=None)
    return replace(model, grid=grid, settings=settings)


def _moved(grid: Grid, far: float) -> NDArray[np.float64]:
    """Pre-cracks (k, 4), each moved by `far`, m, across its first segment, with kinks and forks as one.

    An end on the plate's edge stays there: the crack is extended.
    """
    import shapely

    ends = grid.cracks.reshape(-1, 2)  # of segment i: 2 i and 2 i + 1
    owner = np.repeat(np.arange(len(grid.cracks)), 2)
    _, place = np.unique(np.round(ends / (NEAR * float(grid.delta.min()))), axis=0, return_inverse=True)
    first = np.full(place.max() + 1, -1)
    first[place[::-1]] = owner[::-1]
    part = connected(len(grid.cracks), owner, first[place])
    along = np.diff(grid.cracks.reshape(-1, 2, 2), axis=1)[:, 0]
    along /= np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    leader = along[np.unique(part, return_index=True)[1]][part]
    shift = far * np.column_stack([-leader[:, 1], leader[:, 0]])
    outward = np.stack([-along, along], axis=1).reshape(-1, 2)
    # The plate's edge and those of holes; for a bare list of nodes, its bounding box
    rings = [*grid.outline, *grid.holes]
    if not rings:
        low, high = grid.position.min(axis=0), grid.position.max(axis=0)
        rings = [np.array([low, (high[0], low[1]), high, (low[0], high[1])])]
    edges = shapely.MultiLineString([np.vstack([ring, ring[:1]]) for ring in rings])
    is_on_edge = np.asarray(shapely.dwithin(edges, shapely.points(ends), NEAR * float(grid.delta.min())))
    drawn_out = (abs(far) * is_on_edge)[:, None] * outward
    return np.asarray((ends + np.repeat(shift, 2, axis=0) + drawn_out).reshape(-1, 4))
