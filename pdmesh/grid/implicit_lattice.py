"""A plate on a single lattice so large that its file holds the lattice in place of the nodes.

It is a rectangle of one material with nodes on its edges, to be solved with a moving fine zone, so that no step needs
arrays of all its bonds. Reports on its grid are made from the same plate with a larger spacing.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import shapely

from pdmesh.grid.lattice import build_grid, segments
from pdmesh.model.document import ON_ONE_LATTICE, Horizon, Lattice, Settings
from pdmesh.model.node_grid import Grid, places, whole_lattice
from pdmesh.scene.scene import Scene

MANY = 50_000  # nodes
FEW = 200  # nodes along the longer side of the plate that stands for it
ON = 1e-6  # of a spacing: what still counts as on the lattice


def lattice_of(scene: Scene) -> Lattice | None:
    """The lattice of a scene whose file holds the lattice; None if the file lists the nodes."""
    if scene.run.adapt not in ON_ONE_LATTICE or scene.zones or scene.refinements or scene.regions:
        return None
    if scene.medium is not None:  # which is conducted on all nodes
        return None
    x0, y0, x1, y1 = scene.whole.bounds
    if shapely.symmetric_difference(scene.shape, shapely.box(x0, y0, x1, y1)).area > ON * scene.spacing**2:
        return None
    sides = np.array([x1 - x0, y1 - y0]) / scene.spacing
    counts = np.round(sides).astype(int)
    if np.abs(sides - counts).max() > ON or np.prod(counts + 1) < MANY:
        return None
    return Lattice((x0, y0), scene.spacing, *(counts + 1).tolist())


def build(scene: Scene, lattice: Lattice) -> tuple[Grid, Settings]:
    """Grid and settings of a scene on an implicit lattice. Raises SceneError if a condition finds no node."""
    grid = whole_lattice(
        lattice,
        cracks=segments(scene),
        outline=tuple(shapely.get_coordinates(part.exterior) for part in scene.parts),
        source=scene.source,
        parameters=scene.parameters,
        drawing=scene.drawing,
    )
    conditions = []
    for condition in scene.conditions:  # whose nodes are searched only near its place
        h, reach = lattice.spacing, condition.place.rows + 1
        low, high = np.reshape(condition.place.shape.bounds, (2, 2))
        most = np.array([lattice.columns, lattice.rows])
        first = np.clip(np.floor((low - lattice.origin) / h).astype(int) - reach, 0, most)
        last = np.clip(np.ceil((high - lattice.origin) / h).astype(int) + reach + 1, 0, most)
        columns, rows = (np.arange(begin, end) for begin, end in zip(first, last, strict=True))
        x, y = (places(begin, h, numbers) for begin, numbers in zip(lattice.origin, (columns, rows), strict=True))
        position = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        ids = (rows[:, None] * lattice.columns + columns + 1).ravel()
        placed = condition.on(position, np.full(len(position), h))
        node_ids = tuple(ids[np.array(placed.nodes) - 1].tolist())
        conditions.append(msgspec.structs.replace(placed, nodes=node_ids))
    settings = Settings(
        material=scene.material,
        horizon=Horizon(ratio=float(scene.horizon)),
        conditions=tuple(conditions),
        area_rule=scene.area_rule,
        run=scene.run,
    )
    return grid, settings


def stand_in(scene: Scene) -> tuple[Grid, Settings]:
    """Grid and settings of the same plate with few nodes. Raises SceneError as `build_grid` does."""
    x0, y0, x1, y1 = scene.whole.bounds
    grid, settings, _ = build_grid(replace(scene, spacing=max(x1 - x0, y1 - y0) / FEW))
    return grid, settings
