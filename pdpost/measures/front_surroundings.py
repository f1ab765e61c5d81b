"""The undisturbed room around a point of a crack front.

The room reaches to the first obstacle beside the front: anything that is not elastic body with one crack in the plane
of the arc. Only what is beside the piece of front that a tube belongs to counts.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pdpost.measures.front_places import CrackPointsAndFronts
from pdpost.measures.lattice_neighbours import NEAR, face_neighbour_pairs
from pdpost.measures.strain import elastic_constants_of_nodes
from pdpost.measures.tip_surroundings import UndisturbedRoom, nodes_of_loads_and_grips
from pdsolve.fracture.front_integrals import FrontPlace, across
from pdsolve.results import Results

BESIDE, SLANT = 1.5, 0.1  # spacings beside an arc's plane or circle, and of the distance: what is nearer is on it
AXIS = 0.95  # of an arc's radius


class FrontObstacles:
    """Obstacles to the fields around fronts after a step."""

    def __init__(self, results: Results, step: int, cracks: CrackPointsAndFronts) -> None:
        nodes = results.nodes(step)
        self._nodes, self._cracks, self._tree = nodes, cracks, cKDTree(nodes.position)
        self._elastic = elastic_constants_of_nodes(results, step)
        # those faces of nodes' cubes that other cubes do not cover
        pairs, count = face_neighbour_pairs(nodes), len(nodes.ids)
        way = nodes.position[pairs[:, 1]] - nodes.position[pairs[:, 0]]
        axis = np.abs(way).argmax(axis=1)
        ahead = way[np.arange(len(pairs)), axis] > 0
        shared = nodes.delta[pairs].min(axis=1) ** 2
        covered = np.zeros((6, count))
        for side in range(6):
            for end in (0, 1):
                side_pairs = (axis == side % 3) & (ahead == ((side < 3) == (end == 0)))
                covered[side] += np.bincount(pairs[side_pairs, end], shared[side_pairs], count)
        sides, row = np.nonzero(covered < (1 - NEAR) * nodes.delta**2)
        middles = nodes.position[row]
        middles[np.arange(len(row)), sides % 3] += np.where(sides < 3, 0.5, -0.5) * nodes.delta[row]
        self._held, self._surface = nodes_of_loads_and_grips(results, nodes), middles

    def find_undisturbed_room(
        self, front_place: FrontPlace, half_length: float, largest_radius: float
    ) -> UndisturbedRoom:
        """The room around a point of a front, `largest_radius` m at most, for a tube of the half length `half_length`,
        m."""
        near = np.array(
            self._tree.query_ball_point(front_place.place, np.hypot(largest_radius, half_length + largest_radius)),
            dtype=np.int64,
        )
        nodes, nearest = self._nodes, int(self._tree.query(front_place.place)[1])
        spacing = float(nodes.delta[nearest])
        E, nu, _ = self._elastic
        other_material = (E[near] != E[nearest]) | (nu[near] != nu[nearest])
        rooms = [UndisturbedRoom(largest_radius, "")]
        if front_place.curvature:
            rooms.append(UndisturbedRoom(AXIS / abs(front_place.curvature), "the middle of the front's arc"))
        points = self._cracks.surface_points
        x, y, _, _ = across(points, front_place)
        slack = np.maximum(BESIDE * spacing, SLANT * np.hypot(x, y))
        behind = (np.abs(y) < slack) & (x < slack)  # of the crack whose front has the arc
        ahead = np.concatenate(self._cracks.front_lines)
        x, y, s, _ = across(ahead, front_place)
        on_arc = np.hypot(x, y) < np.maximum(BESIDE * spacing, SLANT * np.abs(s))
        for places, what in (
            (self._surface, "the surface of the body"),
            (points[~behind], "another crack or a bend of this one"),
            (ahead[~on_arc], "another front or a bend of this one"),
            (nodes.position[near[self._held[near]]], "nodes of a load or grip"),
            (nodes.position[near[other_material]], "another material"),
        ):
            x, y, s, _ = across(places, front_place)
            in_tube = np.abs(s) < half_length
            if in_tube.any():
                rooms.append(UndisturbedRoom(float(np.hypot(x, y)[in_tube].min()), what))
        return min(rooms)
