"""A plate and other bodies beside it: each on lattices of its own, in one grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import msgspec
import numpy as np

from pdmesh.grid.lattice import build_grid, cell_areas, grid_of_nodes, place_nodes, settings_of
from pdmesh.model.document import InitialVelocity, Region, RigidBody, Settings
from pdmesh.model.mechanical_conditions import REST
from pdmesh.model.node_grid import Bodies, Grid
from pdmesh.scene.conditions import Shift
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import errors_at

MIDDLES = (0.5, 0.5)  # of a spacing: nodes are in the middle of their squares


def build_scene(scene: Scene) -> tuple[Grid, Settings, tuple[Shift, ...]]:
    """The nodes of a scene with all of its bodies, the settings for their file, and the shifts of lattices.

    Raises SceneError if a body or a spacing has no nodes, a crack cannot be cleared or a condition finds no node.
    """
    if not scene.bodies:
        grid, settings, plate_shifts = build_grid(scene)
        return grid, msgspec.structs.replace(settings, contact=scene.touching), plate_shifts
    run = msgspec.structs.replace(scene.run, gaps=())
    alone = [replace(scene, bodies=(), regions=(), media=(), conditions=(), run=run)]
    for body in scene.bodies:
        material = body.material or scene.material
        with errors_at(f"body '{body.name}'"):
            plate = Scene(body.shape, body.spacing, material, scene.horizon, units=scene.units, medium=scene.medium)
        alone.append(plate)
    grids: list[Grid] = []
    shifts: list[Shift] = []
    for body_scene in alone:
        nodes = place_nodes(body_scene, MIDDLES)
        areas = cell_areas(nodes.position, body_scene.shape, nodes.delta, nodes.regular)
        grids.append(grid_of_nodes(body_scene, nodes.position, nodes.delta, areas))
        shifts += nodes.shifts
    grid = joined(grids, (REST, *(body.name for body in scene.bodies)))
    settings = settings_of(scene, grid, tuple(shifts))
    # materials and motions of the bodies beside the plate
    regions: list[Region] = []
    moves: list[InitialVelocity | RigidBody] = []
    assert grid.bodies is not None
    for number, body in enumerate(scene.bodies, start=1):
        node_ids = tuple(grid.ids[grid.bodies.number == number].tolist())
        if body.material is not None:
            regions.append(Region(name=body.name, material=body.material, nodes=node_ids))
        if any(body.velocity) or body.spin:
            x, y = map(float, body.velocity)
            moves.append(InitialVelocity(name=body.name, x=x, y=y, spin=float(body.spin), nodes=node_ids))
        if body.rigid is not None:
            moves.append(msgspec.structs.replace(body.rigid, nodes=node_ids))
    settings = msgspec.structs.replace(
        settings,
        regions=(*regions, *settings.regions),
        conditions=(*moves, *settings.conditions),
        contact=scene.touching,
    )
    return grid, settings, tuple(shifts)


def joined(grids: list[Grid], names: tuple[str, ...]) -> Grid:
    """The nodes of all bodies as one grid."""
    counts, first = [len(grid) for grid in grids], grids[0]
    holes = np.cumsum([0, *(len(grid.holes) for grid in grids[:-1])])
    return replace(
        first,
        ids=np.arange(1, sum(counts) + 1),
        position=np.concatenate([grid.position for grid in grids]),
        delta=np.concatenate([grid.delta for grid in grids]),
        border=np.concatenate([grid.border for grid in grids]),
        hole_id=np.concatenate(
            [np.where(grid.hole_id < 0, -1, grid.hole_id + more) for grid, more in zip(grids, holes, strict=True)]
        ),
        outline=tuple(ring for grid in grids for ring in grid.outline),
        holes=tuple(ring for grid in grids for ring in grid.holes),
        areas=np.concatenate([grid.cells for grid in grids]),
        cracks=np.concatenate([grid.cracks for grid in grids]),
        bodies=Bodies(np.repeat(np.arange(len(grids)), counts), names),
    )


def each_alone(grid: Grid, settings: Settings) -> Iterator[tuple[Grid, Settings]]:
    """Each body of a plane grid by itself, with its part of the outline, and the settings without conditions."""
    import shapely

    assert grid.bodies is not None
    plain = msgspec.structs.replace(settings, conditions=())
    for number in range(len(grid.bodies.names)):
        body_rows = np.flatnonzero(grid.bodies.number == number)
        nodes = shapely.multipoints(grid.position[body_rows])
        mine = [ring for ring in grid.outline if shapely.Polygon(ring).intersects(nodes)]
        holes = [
            ring
            for ring in grid.holes
            if shapely.MultiPolygon(map(shapely.Polygon, mine)).contains(shapely.Polygon(ring))
        ]
        yield (
            replace(
                grid,
                ids=np.arange(1, len(body_rows) + 1),
                position=grid.position[body_rows],
                delta=grid.delta[body_rows],
                border=grid.border[body_rows],
                hole_id=grid.hole_id[body_rows],
                areas=grid.cells[body_rows],
                outline=tuple(mine),
                holes=tuple(holes),
                cracks=grid.cracks if number == 0 else grid.cracks[:0],
                bodies=None,
            ),
            plain,
        )
