"""Spacing by place: zones grown by the visibility principle and graded so that spacings change by one step.

After F. Bobaru et al., Int. J. Numer. Meth. Engng 77 (2009) 852-877: the refined region is the zone and everything
within the old, coarser horizon of it. No node then interacts with a region more than one step finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pdmesh.scene.checks import limit_nodes
from pdmesh.scene.plate import Zone
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError, Surface, concave_points, grown, parts

SLACK = 1e-6  # of a spacing, of a horizon: who is that near sees
SLIVER = 1e-9  # of a spacing squared: parts of a level below are round-off


@dataclass(frozen=True)
class Level:
    """The part of the plate with nodes of one spacing."""

    spacing: float  # m
    shape: Surface


def levels(scene: Scene) -> tuple[Level, ...]:
    """Parts of the plate by spacing, the coarsest first; their union is the plate.

    A level consists of the zones that ask for it and of the finer levels and growing zones, grown by the horizon of the
    next coarser spacing. Grown shapes end on lines of the coarser lattice.
    """
    zones = [*scene.zones]
    for request in scene.refinements:
        target = {
            "crack": lambda: shapely.union_all([slit.line for slit in scene.slits]),
            "notch": lambda: shapely.multipoints(concave_points(scene.shape)),
            "hole": lambda: shapely.union_all([hole.exterior for hole in scene.holes]),
        }[request.target]()
        if target.is_empty:
            raise SceneError(f"refine {request.target}: the scene has none; add one, or leave it out")
        refined = grown(target, request.distance)
        zones.append(Zone(f"around {request.target}", refined, request.spacing or scene.finest))
    steps = [round(float(np.log2(scene.spacing / zone.spacing))) for zone in zones]
    finer: Surface = shapely.Polygon()
    level_list: list[Level] = []
    for step in range(max(steps, default=0), 0, -1):
        step_zones = [zone for zone, its in zip(zones, steps, strict=True) if its == step]
        for zone in step_zones:
            limit_nodes(zone.shape.intersection(scene.shape), zone.spacing, f"zone '{zone.name}': spacing")
        old = scene.spacing / 2 ** (step - 1)
        to_grow = shapely.union_all([finer, *(zone.shape for zone in step_zones if zone.grown)]).intersection(
            scene.shape
        )
        around = _reached(to_grow, scene, old) if not to_grow.is_empty else to_grow
        level_shape = shapely.union_all([around, *(zone.shape for zone in step_zones)]).intersection(scene.shape)
        level_list.append(_level(old / 2, level_shape, finer))
        finer = level_shape
    level_list.append(_level(scene.spacing, scene.shape, finer))
    return tuple(level for level in reversed(level_list) if not level.shape.is_empty)


def _level(spacing: float, shape: Surface, finer: Surface) -> Level:
    remainder = [part for part in parts(shape.difference(finer)) if part.area > SLIVER * spacing**2]
    return Level(spacing, shapely.union_all(remainder) if remainder else shapely.Polygon())


def _reached(shape: Surface, scene: Scene, spacing: float) -> Surface:
    """Cells of the lattice of this spacing that lie within its horizon of the shape."""
    reach = scene.horizon * spacing * (1 + SLACK)
    origin = np.array(scene.whole.bounds[:2])
    low, high = np.reshape(shape.bounds, (2, 2))
    first = np.floor((low - reach - origin) / spacing).astype(int)
    last = np.ceil((high + reach - origin) / spacing).astype(int)
    limit_nodes(shapely.box(*(first * spacing), *(last * spacing)), spacing, "zones: coarser spacing around them")
    x, y = (origin[axis] + spacing * np.arange(first[axis], last[axis] + 1) for axis in (0, 1))
    shapely.prepare(shape)
    inset = SLACK * spacing
    x0, y0 = np.meshgrid(x[:-1] + inset, y[:-1] + inset)
    cells = shapely.box(x0, y0, x0 + spacing - 2 * inset, y0 + spacing - 2 * inset)
    near = shapely.dwithin(shape, cells, reach)
    runs = []
    for row in range(len(y) - 1):
        ends = np.flatnonzero(np.diff(np.concatenate([[False], near[row], [False]]).astype(int)))
        runs += [shapely.box(x[start], y[row], x[stop], y[row + 1]) for start, stop in ends.reshape(-1, 2)]
    return shapely.union_all(runs)
