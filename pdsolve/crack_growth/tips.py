"""Ends of cracks of particles, and obstacles of their paths.

Paths end at the edge of the plate or another crack and avoid nodes; and the room around a tip.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.document import Absorb, InitialDisplacement, InitialVelocity
from pdmesh.model.neighbours import tree_of
from pdmesh.model.visibility import SLACK, plate_of
from pdsolve.fracture.crack_particles import Particles, arms, links
from pdsolve.model import Model

CLEAR = 1e-3  # spacings: a crack passes nodes at no less
TURNS = np.radians(0.05) * np.repeat(np.arange(200), 2) * np.tile([1, -1], 200)  # tried so as to pass them
LEFT = 0.5  # of an arm: an edge or a crack this near ahead is gone on to
ACTED_ON = "nodes of a load or grip"  # what a crack does not come near
COVERED = 0.75  # spacings from the nearest node, in a plate without an outline


class CrackedPlate:
    """A plate with growing cracks."""

    def __init__(self, model: Model) -> None:
        grid = model.grid
        self._position, self._delta, self._tree = grid.position, grid.delta, tree_of(grid.position)
        self.slack = SLACK * float(grid.delta.min())
        shape = plate_of(grid, model.name)
        self._shape, self._edge = shape, None if shape is None else shape.boundary
        acting = [
            c for c in model.settings.conditions if not isinstance(c, InitialDisplacement | InitialVelocity | Absorb)
        ]
        self._acted_on = np.unique(np.concatenate([np.zeros(0, np.int64), *(model.selected(c) for c in acting)]))

    def inside(self, place: NDArray[np.float64], way: NDArray[np.float64]) -> bool:
        """Whether a tip that arrives along a unit vector is inside the plate, and not on its edge."""
        if self._edge is None:
            ahead = place + way * self._delta[self._tree.query(place)[1]] / 2
            distance, near = self._tree.query(ahead)
            return bool(distance <= COVERED * self._delta[near])
        point = shapely.Point(place)
        return bool(shapely.intersects(self._shape, point) and self._edge.distance(point) > 2 * self.slack)

    def end(
        self, start: NDArray[np.float64], angle: float, length: float, arms: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """End of an arm from a place (2,) at an angle, rad, over `length`, m; `arms` (k, 4) are the existing ones."""
        other_arms = arms[distance(start, arms) > self.slack]
        for turn in TURNS:
            way = np.array([np.cos(angle + turn), np.sin(angle + turn)])
            far = self._met(start, way, (1 + LEFT) * length, other_arms)
            # an obstacle not far beyond the length ends the arm
            place = np.asarray(start + (far.min() if len(far) else length) * way)
            middle, half = (start + place) / 2, np.hypot(*(place - start)) / 2
            spacing = self._delta[self._tree.query(middle)[1]]
            near = self._tree.query_ball_point(middle, half + spacing)
            points = shapely.points(self._position[near])
            if not shapely.dwithin(shapely.LineString([start, place]), points, CLEAR * spacing).any():
                return place  # past all nodes
        return place

    def ahead(
        self, start: NDArray[np.float64], way: NDArray[np.float64], reach: float, arms: NDArray[np.float64]
    ) -> bool:
        """Whether an edge or one of the `arms` (k, 4) lies ahead along a unit vector, within `reach`, m."""
        far = self._met(start, way, reach, arms[distance(start, arms) > self.slack])
        return len(far) > 0

    def _met(
        self, start: NDArray[np.float64], way: NDArray[np.float64], reach: float, other_arms: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distance to the first obstacle along a unit vector within `reach`, m."""
        long = shapely.LineString([start, start + reach * way])
        walls = [shapely.multilinestrings(other_arms.reshape(-1, 2, 2))] if len(other_arms) else []
        walls += [] if self._edge is None else [self._edge]
        met = [shapely.get_coordinates(shapely.intersection(long, wall)) for wall in walls]
        far = np.concatenate([np.zeros(0), *((places - start) @ way for places in met)])
        return np.asarray(far[far > self.slack])

    def room(self, tip: NDArray[np.float64], others: NDArray[np.float64]) -> tuple[float, str]:
        """Distance, m, from a tip to the first thing that is not the plate or its own crack, and its name.

        `others` (k, 4) are arms of other cracks, and other tips as arms of zero length.
        """
        obstacles = [(np.inf, "")]
        if self._edge is not None:
            obstacles.append((float(self._edge.distance(shapely.Point(tip))), "the edge of the plate"))
        if len(others):
            obstacles.append((float(distance(tip, others).min()), "another tip or crack"))
        if len(self._acted_on):
            places = self._position[self._acted_on]
            obstacles.append((float(np.hypot(*(places - tip).T).min()), ACTED_ON))
        return min(obstacles)


def distance(place: NDArray[np.float64], arms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of arms (k, 4) from a place (2,), m."""
    start, way = arms[:, :2], arms[:, 2:] - arms[:, :2]
    squared = (way**2).sum(axis=1)
    share = ((place - start) * way).sum(axis=1) / np.where(squared > 0, squared, 1.0)
    return np.asarray(np.hypot(*(start + share.clip(0, 1)[:, None] * way - place).T))


class Tip(NamedTuple):
    """The end of a crack."""

    particle: int
    back: NDArray[np.float64]  # (m, 2) m: places from the tip back to the next fork or end
    length: float  # m, of that way
    forked: bool  # whether it is a fork that it comes from

    @property
    def place(self) -> NDArray[np.float64]:
        """The place (2,) of the tip, m."""
        return np.asarray(self.back[0])

    def way(self, far: float) -> NDArray[np.float64]:
        """Unit vector of the tip's direction, from a point `far` m back along the crack."""
        steps = np.hypot(*np.diff(self.back, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        begin = [np.interp(min(far, along[-1]), along, column) for column in self.back.T]
        way = self.place - np.array(begin)
        return np.asarray(way / np.hypot(*way))


def tips_of(particles: Particles, ground: CrackedPlate) -> list[Tip]:
    """Ends of cracks inside the plate that lie on no other crack."""
    around, every = links(particles, ground.slack), arms(particles)
    tips = []
    for number, others in enumerate(around):
        if len(others) != 1:
            continue
        line = [number, around[number][0]]
        while len(around[line[-1]]) == 2:
            line.append(next(neighbour for neighbour in around[line[-1]] if neighbour != line[-2]))
        back = particles.place[line]
        tip = Tip(number, back, float(np.hypot(*np.diff(back, axis=0).T).sum()), len(around[line[-1]]) > 2)
        if not ground.inside(tip.place, tip.way(0.5 * tip.length)):
            continue
        on = distance(tip.place, every) <= ground.slack
        if on.sum() == 1:
            tips.append(tip)
    return tips
