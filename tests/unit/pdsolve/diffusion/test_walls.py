"""Walls of single nodes, from faces beside them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import Pairs
from pdsolve.diffusion.walls import Edges, Faces, walls


class Lone:
    """Nodes without bonds, far from each other."""

    position = np.array([[0.0, 0.0], [0.0, 20.0], [0.0, 40.0]])
    delta, reach, diffusivity = np.ones(3), np.full(3, 3.0), np.ones(3)

    def of(self, rows: NDArray[np.int64]) -> tuple[Pairs, NDArray[np.float64]]:
        none = np.zeros(0, dtype=np.int64)
        return Pairs(none, none, np.zeros(0)), np.zeros(0)

    def conductance(self, pairs: Pairs) -> NDArray[np.float64]:
        return np.zeros(len(pairs.length))


class Uneven(Lone):
    """Nodes of which the last one alone reaches far."""

    reach = np.array([3.0, 3.0, 10.0])


def test_nodes_out_of_reach_of_all_faces_have_no_wall() -> None:
    """The reach of a prescribed node, which is larger, includes the face; that of the free ones does not."""
    face = Faces(np.array([[-5.0, 0.0]]), np.array([[-1.0, 0.0]]), np.ones(1), np.zeros(1, dtype=np.int64), np.zeros(1))
    for beyond in (0.0, 2.0):
        edges = Edges(np.zeros(3, dtype=bool), face._replace(beyond=np.array([beyond])), np.array([1.0]), 0.25)
        wall_list = walls(Uneven(), np.array([True, True, False]), edges)
        assert not np.isfinite([wall.depth for wall in wall_list]).any()


def test_of_two_walls_in_one_direction_the_nearer_one_counts() -> None:
    """To the left of two nodes a value is held and exchanged; of the third one it is held, and exchanged above it."""
    held = np.array([[-0.5, 0.0], [-1.2, 20.0], [-0.5, 40.0]])
    exchanged = np.array([[-1.2, 0.0], [-0.5, 20.0], [0.0, 40.5]])
    left, above = [-1.0, 0.0], [0.0, 1.0]
    normal = np.array([left, left, left, left, left, above])
    beyond = np.array([0.0, 0.0, 0.0, 2.0, 2.0, 2.0])
    faces = Faces(np.concatenate([held, exchanged]), normal, np.ones(6), np.array([0, 0, 0, 1, 1, 1]), beyond)
    edges = Edges(np.zeros(3, dtype=bool), faces, np.array([0.0, 3.0]), 0.25)
    first, second, *others = walls(Lone(), np.ones(3, dtype=bool), edges)
    assert first.depth.tolist() == [0.5, np.inf, 0.5]
    assert second.depth.tolist() == [np.inf, 0.5, 0.5]
    assert first.edge.tolist() == [0, -1, 0]
    assert second.beyond.tolist() == [0.0, 2.0, 2.0]
    assert second.normal.tolist() == [[0, 0], left, above]
    assert not np.isfinite([wall.depth for wall in others]).any()
