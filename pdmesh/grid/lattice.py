"""A scene as nodes: one square lattice a spacing, aligned so that no crack meets a node.

Layout: every lattice passes through the lower left corner of the plate's bounding box, so that spacings 1, 2, 4 ...
nest. Nodes on an edge of the plate stay. Where two spacings meet, the coarser one owns the edge. Finer nodes on that
edge, or nearer than 3/4 of their spacing to a row of coarser ones, are dropped. The gap is one fine spacing, or 1.5
where one of the lattices is shifted.

Shift: if a crack comes nearer than 1/1000 of the spacing to a node of a lattice, the lattice moves by at most half a
spacing along each axis. It moves by half along y, x or both if that clears the crack, else by the number of eighths
that keeps the cracks farthest from the nodes. Every shift is reported.

Several bodies: nodes are the middles of squares that fill the bounding box of their body, so that two bodies that touch
as drawn have nodes one spacing apart.

Areas of nodes are those of Voronoi cells clipped by the plate, exactly.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.grid.zones import Level, levels
from pdmesh.model.document import Horizon, Settings
from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_grid import Grid, places
from pdmesh.scene.conditions import SLACK, Shift
from pdmesh.scene.heat import medium_of
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError, near

FRACTIONS = 2**20  # of the finest spacing: what nodes are rounded to, so that a lattice stays one in floating point
CLEARANCE = 1e-3  # of a spacing: a crack nearer to a node than this meets it
COMFORT = 0.1  # of a spacing: cracks this far from nodes are far enough
HALVES = ((0.0, 0.5), (0.5, 0.0), (0.5, 0.5))
EIGHTHS = tuple((x, y) for x, y in itertools.product((0.0, 0.125, -0.125, 0.25, -0.25, 0.375, -0.375, 0.5), repeat=2))
GAP = 0.75  # of a spacing: finer nodes nearer to a row of coarser ones are dropped
INTERIOR = 2.5  # of a spacing: so far from a level's edge, no neighbour on the lattice is missing


def cell_areas(
    position: NDArray[np.float64],
    shape: shapely.Geometry,
    delta: NDArray[np.float64],
    regular: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Areas (n,), m^2, of the Voronoi cells of `position` (n, 2) clipped by `shape`; their sum is its area.

    `delta` (n,) are the spacings, m. `regular` (n,) marks nodes with a full square cell whose whole neighbourhood is on
    one lattice; cells are constructed only for the others.
    """
    areas = delta**2
    rows = np.arange(len(position)) if regular is None else np.flatnonzero(~regular)
    if not len(rows):
        return areas
    needed = rows
    if regular is not None:  # cells are bounded by nodes within four spacings
        distance, _ = tree_of(position[rows]).query(position, distance_upper_bound=4 * float(delta.max()))
        needed = np.flatnonzero(distance <= 4 * delta)
    unit, origin = float(delta.min()), position.min(axis=0)
    points = np.round((position[needed] - origin) / unit * FRACTIONS) / FRACTIONS
    around = shapely.transform(shape, lambda corners: (corners - origin) / unit)
    cells = shapely.voronoi_polygons(shapely.multipoints(points), extend_to=around.envelope.buffer(4), ordered=True)
    cells = shapely.get_parts(cells)[np.searchsorted(needed, rows)]
    broken = ~shapely.is_valid(cells)
    cells[broken] = shapely.make_valid(cells[broken])
    shapely.prepare(around)
    outside = ~shapely.covers(around, cells)
    cells[outside] = shapely.intersection(cells[outside], around)
    areas[rows] = shapely.area(cells) * unit**2
    return areas


@dataclass(frozen=True)
class PlacedNodes:
    """The n nodes of a scene, the coarsest first."""

    position: NDArray[np.float64]  # (n, 2) m
    delta: NDArray[np.float64]  # (n,) m
    regular: NDArray[np.bool_]  # (n,) whose cell is the full square, delta^2
    shifts: tuple[Shift, ...]


def build_grid(scene: Scene) -> tuple[Grid, Settings, tuple[Shift, ...]]:
    """The nodes of a scene, the settings for their file, and the shifts of lattices.

    Raises SceneError if a spacing has no nodes, a crack cannot be cleared or a condition finds no node.
    """
    nodes = place_nodes(scene)
    areas = cell_areas(nodes.position, scene.shape, nodes.delta, nodes.regular)
    grid = grid_of_nodes(scene, nodes.position, nodes.delta, areas)
    return grid, settings_of(scene, grid, nodes.shifts), nodes.shifts


def place_nodes(scene: Scene, start: tuple[float, float] = (0.0, 0.0)) -> PlacedNodes:
    """The nodes of a scene's plate, on lattices moved by a share `start` of their spacing.

    Raises SceneError if a spacing has no nodes or a crack cannot be cleared.
    """
    points_by_level: list[NDArray[np.float64]] = []
    regular: list[NDArray[np.bool_]] = []
    rows: list[NDArray[np.float64]] = []
    shifts = []
    coarser: list[Level] = []
    for level in (every := levels(scene)):
        points, offset = _level_nodes(scene, level, coarser, start)
        if len(points) and rows:
            distance, _ = tree_of(np.concatenate(rows)).query(points, distance_upper_bound=GAP * level.spacing)
            points = points[~np.isfinite(distance)]
        if any(offset):
            shifts.append(Shift(level.spacing, offset))
        points_by_level.append(points)
        regular.append(~near(points, level.shape.boundary, INTERIOR * level.spacing))
        coarser.append(level)
        if len(coarser) < len(every):
            edge = points[~regular[-1]]
            if len(edge):  # with three more points between each two neighbours
                first, second = tree_of(edge).query_pairs(level.spacing * (1 + SLACK), output_type="ndarray").T
                between = [edge[first] + share * (edge[second] - edge[first]) for share in (0.25, 0.5, 0.75)]
                edge = np.concatenate([edge, *between])
            rows.append(edge)
    counts = [len(points) for points in points_by_level]
    if not sum(counts):
        raise SceneError(f"spacing: the plate has no node; use a spacing below {scene.spacing:g} m")
    delta = np.repeat([level.spacing for level in coarser], counts)
    for zone in scene.zones:
        inside = zone.shape.buffer(zone.spacing / 2)
        if not shapely.contains_xy(inside, np.concatenate(points_by_level)[delta <= zone.spacing * (1 + 1e-9)]).any():
            raise SceneError(f"zone '{zone.name}' has no node; use a spacing below {zone.spacing:g} m")
    return PlacedNodes(np.concatenate(points_by_level), delta, np.concatenate(regular), tuple(shifts))


def _level_nodes(
    scene: Scene, level: Level, coarser: list[Level], start: tuple[float, float]
) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Nodes (k, 2) of a level, row by row, and the shift of its lattice from `start`; both in m."""
    cracks = shapely.STRtree(shapely.linestrings(segments(scene).reshape(-1, 2, 2)))
    slack = SLACK * level.spacing
    inside = level.shape.buffer(slack, join_style="mitre")
    coarser_shapes = [coarser_level.shape.buffer(slack, join_style="mitre") for coarser_level in coarser]

    def placed(share: tuple[float, float]) -> NDArray[np.float64]:
        spacing = level.spacing
        origin = np.array(scene.whole.bounds[:2]) + spacing * np.array(share)
        low, high = np.array(level.shape.bounds[:2]), np.array(level.shape.bounds[2:])
        first = np.ceil((low - origin) / spacing - SLACK).astype(int)
        last = np.floor((high - origin) / spacing + SLACK).astype(int)
        x, y = (places(origin[axis], spacing, np.arange(first[axis], last[axis] + 1)) for axis in (0, 1))
        points = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        mask: NDArray[np.bool_] = shapely.contains_xy(inside, points)
        for shape in coarser_shapes:
            mask &= ~shapely.contains_xy(shape, points)
        return np.asarray(points[mask])

    def clearance(points: NDArray[np.float64]) -> float:
        _, distance = cracks.query_nearest(
            shapely.points(points), level.spacing, return_distance=True, all_matches=False
        )
        return float(distance.min(initial=level.spacing)) / level.spacing

    points = placed(start)
    if not len(cracks) or clearance(points) >= CLEARANCE:
        return points, (0.0, 0.0)
    best, chosen = 0.0, start
    for share in HALVES + EIGHTHS:
        trial_points = placed(share)
        free = clearance(trial_points)
        if free > best:
            best, chosen, points = free, share, trial_points
        if free >= COMFORT and share in HALVES:
            break
    if best < CLEARANCE:
        raise SceneError(
            f"cracks: a node of spacing {level.spacing:g} m lies on one for every shift of the lattice; put cracks"
            " between nodes"
        )
    return points, ((chosen[0] - start[0]) * level.spacing, (chosen[1] - start[1]) * level.spacing)


def segments(scene: Scene) -> NDArray[np.float64]:
    """The segments (k, 4) of all cracks of a scene, m."""
    lines = [shapely.get_coordinates(slit.line) for slit in scene.slits]
    return np.concatenate([np.empty((0, 4)), *(np.hstack([line[:-1], line[1:]]) for line in lines)])


def edges(
    scene: Scene, position: NDArray[np.float64], delta: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Mask (n,) of nodes with an edge within one spacing, and the number (n,) of the hole it belongs to, or -1."""
    within = delta * (1 - SLACK)
    hole_id = np.full(len(position), -1)
    for number, hole in enumerate(scene.holes):
        hole_id[near(position, hole.exterior, within)] = number
    return near(position, scene.shape.boundary, within), hole_id


def settings_of(scene: Scene, grid: Grid, shifts: tuple[Shift, ...] = ()) -> Settings:
    """Settings of a scene for the nodes of a grid on lattices with `shifts`; ids count from 1. Raises SceneError."""
    position, delta = grid.position, grid.delta
    return Settings(
        material=scene.material,
        horizon=Horizon(ratio=float(scene.horizon)),
        regions=tuple(region.on(position, delta, shifts) for region in scene.regions),
        conditions=tuple(condition.on(position, delta, shifts, grid.cells) for condition in scene.conditions),
        physics=scene.physics,
        medium=medium_of(scene.medium, scene.material),
        media=tuple(region.on(position, delta, shifts) for region in scene.media),
        area_rule=scene.area_rule,
        run=scene.run,
    )


def grid_of_nodes(
    scene: Scene, position: NDArray[np.float64], delta: NDArray[np.float64], areas: NDArray[np.float64]
) -> Grid:
    """The grid of a scene's plate with nodes (n, 2), spacings (n,), m, and areas (n,), m^2."""
    border, hole_id = edges(scene, position, delta)
    return Grid(
        ids=np.arange(1, len(position) + 1),
        position=position,
        delta=delta,
        border=border,
        hole_id=hole_id,
        cracks=segments(scene),
        outline=tuple(shapely.get_coordinates(part.exterior) for part in scene.parts),
        holes=tuple(shapely.get_coordinates(hole.exterior) for hole in scene.holes),
        areas=areas,
        source=scene.source,
        parameters=scene.parameters,
        drawing=scene.drawing,
    )
