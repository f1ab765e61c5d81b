"""Segments between nodes that meet a surface of many small triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from pdmesh.model.neighbours import Pairs
from pdmesh.model.triangulated_surface import Screen, meets, normals


def test_small_triangles_are_met_as_each_alone_is() -> None:
    """A ball with bumps: what is left out before the test of a segment and a triangle meets none."""
    way = np.random.default_rng(0).standard_normal((150, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    corners = 3.5 * way * (1 + 0.2 * np.sin(5 * way[:, :1]) * np.cos(4 * way[:, 1:2]))
    triangles = corners[ConvexHull(way).simplices]
    along = np.arange(-3.0, 4.0)
    position = np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
    position = position[np.linalg.norm(position, axis=1) < 3.7]
    i, j = cKDTree(position).query_pairs(3.0, output_type="ndarray").T
    order = np.argsort(i, kind="stable")
    i, j = i[order], j[order]
    pairs = Pairs(i, j, np.linalg.norm(position[i] - position[j], axis=1))
    expected = np.zeros(len(i), dtype=bool)
    for triangle, normal in zip(triangles, normals(triangles), strict=True):
        expected |= meets(position[i], position[j], triangle[None], normal[None])
    found = Screen(triangles, position, np.ones(len(position))).met(pairs)
    assert 100 < expected.sum() < len(i) - 100
    assert (found == expected).all()
