"""A scene becomes nodes: one square lattice a zone, aligned so that no crack meets a node.

Layout: the lattice of every zone passes through the lower left corner of the plate's bounding box, so that
lattices of spacings 1, 2, 4 ... nest. Nodes on an edge of the plate stay. Where two zones share an edge the
coarser one owns it; fine nodes on it are dropped. A zone whose lattice a crack would hit is shifted by half a
spacing, and the shift is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.areas import cell_areas
from pdmesh.grid import Grid, Load, Settings
from pdmesh.scene import Scene, SceneError, Traction, Zone

SLACK = 1e-6  # of a spacing: what still counts as lying on an edge
CLEARANCE = 1e-3  # of a spacing: a crack nearer to a node than this meets it
SHIFTS = ((0.0, 0.0), (0.0, 0.5), (0.5, 0.0), (0.5, 0.5), (0.25, 0.25), (0.25, 0.0), (0.0, 0.25))


@dataclass(frozen=True)
class Shift:
    """A zone's lattice was moved so that no crack meets a node."""

    zone: str
    offset: tuple[float, float]  # m


def build_grid(scene: Scene) -> tuple[Grid, Settings, tuple[Shift, ...]]:
    """The nodes of a scene, the settings that go into their file, and the shifts of lattices.

    Raises SceneError if a zone stays without nodes, a crack cannot be cleared or a load finds no node.
    """
    lattices, shifts = [], []
    for zone in scene.zones:
        points, offset = _zone_nodes(scene, zone)
        if not len(points):
            raise SceneError(f"zone '{zone.name}': found no node, expected a spacing below {zone.spacing:g} m")
        lattices.append(points)
        if any(offset):
            shifts.append(Shift(zone.name, offset))
    position = np.concatenate(lattices)
    zone_of = np.repeat(np.arange(len(lattices)), [len(points) for points in lattices])
    delta = np.array([zone.spacing for zone in scene.zones])[zone_of]
    border, hole_id = _edges(scene, position, delta)
    grid = Grid(
        ids=np.arange(1, len(position) + 1),
        position=position,
        delta=delta,
        border=border,
        hole_id=hole_id,
        cracks=_segments(scene),
        outline=tuple(shapely.get_coordinates(part.exterior) for part in scene.parts),
        holes=tuple(shapely.get_coordinates(hole.exterior) for hole in scene.holes),
        areas=cell_areas(position, scene.shape),
        source=scene.source,
        parameters=scene.parameters,
    )
    conditions = tuple(_load(traction, scene, position, zone_of) for traction in scene.tractions)
    settings = Settings(material=scene.material, horizon=scene.horizon, conditions=conditions, run=scene.run)
    return grid, settings, tuple(shifts)


def _zone_nodes(scene: Scene, zone: Zone) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """The zone's nodes (k, 2), row by row, and the shift of its lattice; both in m."""
    cracks = shapely.union_all([crack.line for crack in scene.cracks])
    for share in SHIFTS:
        points = _covered(scene, zone, share)
        if cracks.is_empty or not len(points):
            return points, (0.0, 0.0)
        if not shapely.dwithin(shapely.points(points), cracks, CLEARANCE * zone.spacing).any():
            return points, (share[0] * zone.spacing, share[1] * zone.spacing)
    raise SceneError(
        f"zone '{zone.name}': found nodes on a crack for every shift tried, expected a crack between nodes"
    )


def _covered(scene: Scene, zone: Zone, share: tuple[float, float]) -> NDArray[np.float64]:
    spacing, slack = zone.spacing, SLACK * zone.spacing
    origin = np.array(scene.shape.bounds[:2]) + spacing * np.array(share)
    low, high = np.array(zone.shape.bounds[:2]), np.array(zone.shape.bounds[2:])
    first = np.ceil((low - origin) / spacing - SLACK).astype(int)
    last = np.floor((high - origin) / spacing + SLACK).astype(int)
    columns, rows = (np.arange(first[axis], last[axis] + 1) for axis in (0, 1))
    decimals = 9 - int(np.floor(np.log10(spacing)))  # mirrored nodes get mirrored bits
    across, along = np.round(origin[0] + columns * spacing, decimals), np.round(origin[1] + rows * spacing, decimals)
    x, y = (grid.ravel() for grid in np.meshgrid(across, along))
    inside = shapely.contains_xy(zone.shape.buffer(slack, join_style="mitre"), x, y)
    for other in scene.zones:
        if other.spacing > spacing:
            inside &= ~shapely.contains_xy(other.shape.buffer(slack, join_style="mitre"), x, y)
    return np.column_stack([x[inside], y[inside]]) + 0.0


def _segments(scene: Scene) -> NDArray[np.float64]:
    lines = [np.asarray(crack.line.coords)[:, :2] for crack in scene.cracks]
    return np.concatenate([np.empty((0, 4)), *(np.hstack([line[:-1], line[1:]]) for line in lines)])


def _edges(
    scene: Scene, position: NDArray[np.float64], delta: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Which nodes have an edge within one spacing (n,), and the number of the hole it belongs to (n,), or -1."""
    points = shapely.points(position)
    within = delta * (1 - SLACK)
    border = shapely.dwithin(points, scene.shape.boundary, within)
    hole_id = np.full(len(position), -1)
    for number, hole in enumerate(scene.holes):
        hole_id[shapely.dwithin(points, hole.exterior, within)] = number
    return border, hole_id


def _load(traction: Traction, scene: Scene, position: NDArray[np.float64], zone_of: NDArray[np.int64]) -> Load:
    loaded = np.zeros(len(position), dtype=bool)
    for number, zone in enumerate(scene.zones):
        depth, slack = traction.rows * zone.spacing, SLACK * zone.spacing
        strip = traction.edge.buffer(depth - 2 * slack, cap_style="flat", join_style="mitre").buffer(slack)
        loaded |= shapely.contains_xy(strip, position) & (zone_of == number)
    if not loaded.any():
        raise SceneError(f"load '{traction.name}': found no node within {traction.rows} rows, expected some")
    return Load(
        name=traction.name,
        nodes=tuple((np.flatnonzero(loaded) + 1).tolist()),
        traction=traction.value,
        rows=traction.rows,
        length=traction.edge.length,
    )
