"""Scenes for adaptive grids: one lattice through the plate's corner, with no crack on its nodes.

A moving fine zone has the finest spacing of all zones, so no zone needs to be drawn. The solver's coarse cells are
twice as large and fit a plate whose edges carry nodes. A crack that meets a node is therefore moved, by at most half a
spacing, where other grids move the lattice.

For splitting cells, the lattice has the coarsest spacing.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString

from pdmesh.grid.lattice import CLEARANCE, COMFORT
from pdmesh.model.document import MOST_LEVELS
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.slits import Crack, Slit

SHARES = (0.0, 0.5, -0.5, 0.25, -0.25, 0.125, -0.125, 0.375, -0.375)  # of a spacing: how far one may be moved
WAYS = tuple(sorted(itertools.product(SHARES, repeat=2), key=lambda way: (np.count_nonzero(way), -abs(sum(way)))))
ON = 1e-6  # of a spacing: an end this near to the plate's edge lies on it


def nested(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene with the finest spacing everywhere and its cracks between nodes, and remarks on the changes.

    Raises SceneError for a crack that cannot be moved off the nodes.
    """
    notes = []
    if scene.zones or scene.refinements:
        notes.append(f"nodes of {scene.finest:g} m everywhere: the solver makes them coarser where it can")
    scene = scene.one_scale()
    cracks: list[Crack] = []
    for slit in scene.slits:
        way = _way(scene, slit)
        if any(way):
            notes.append(f"crack '{slit.name}': moved by ({way[0]:g}, {way[1]:g}) m, off the nodes")
        points = shapely.get_coordinates(slit.line) + way
        cracks.append(Crack(slit.name, LineString(points)))
    return replace(scene, cracks=tuple(cracks)), tuple(notes)


def undivided(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene with the coarsest spacing everywhere, whose cells may split to the finest, and remarks on the changes.

    Raises SceneError if the finest spacing needs too many splits.
    """
    ratio = scene.spacing / scene.finest
    if ratio == 1:
        return scene, ()
    levels = round(float(np.log2(ratio)))
    if levels > MOST_LEVELS:
        raise SceneError(f"run.adapt split: zones are {ratio:g} times finer; use at most {2**MOST_LEVELS}")
    run = msgspec.structs.replace(scene.run, split=msgspec.structs.replace(scene.run.split, levels=levels))
    note = f"nodes of {scene.spacing:g} m everywhere: the solver splits them down to {scene.finest:g} m where it must"
    return replace(scene, zones=(), refinements=(), run=run), (note,)


def _way(scene: Scene, slit: Slit) -> tuple[float, float]:
    """Displacement (x, y), m, that moves a crack off the nodes; an end on the plate's edge stays there if possible."""
    h, points = scene.finest, shapely.get_coordinates(slit.line)
    if _clearance(scene, points) >= CLEARANCE:
        return 0.0, 0.0
    edge = scene.shape.boundary
    mouths = [end for end in (0, -1) if edge.distance(shapely.Point(points[end])) <= ON * h]
    best: tuple[float, float, int] | None = None
    for number, way in enumerate(WAYS):
        trial_points = points + h * np.array(way)
        clear = _clearance(scene, trial_points)
        if clear < CLEARANCE:
            continue
        off = sum(float(edge.distance(shapely.Point(trial_points[end]))) for end in mouths) / h
        worth = (round(off, 6), -min(clear, COMFORT), number)
        best = worth if best is None else min(best, worth)
    if best is None:
        raise SceneError(
            f"crack '{slit.name}': a node of spacing {h:g} m lies on it wherever it is moved; put it between them"
        )
    x, y = WAYS[best[2]]
    return x * h, y * h


def _clearance(scene: Scene, points: NDArray[np.float64]) -> float:
    """Distance from the lattice's nearest node to a polyline (p, 2), in spacings."""
    h, corner = scene.finest, np.array(scene.whole.bounds[:2])
    line = LineString(points)
    places = shapely.get_coordinates(shapely.segmentize(line, h / 2))
    near = np.round((places - corner) / h)[:, None] + np.array(list(itertools.product((-1, 0, 1), repeat=2)))
    nodes = np.unique(near.reshape(-1, 2), axis=0) * h + corner
    return float(shapely.distance(shapely.points(nodes), line).min()) / h
