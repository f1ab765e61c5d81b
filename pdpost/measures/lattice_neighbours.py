"""Nodes of a body whose cubes share a face, in lattices of one or of nested spacings."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdsolve.results import Nodes

NEAR = 1e-3  # of a spacing: by how much a cube may be off


def face_neighbour_pairs(nodes: Nodes) -> NDArray[np.int64]:
    """Pairs (b, 2) of rows of nodes whose cubes share a face, the smaller row first, sorted."""
    levels = [np.flatnonzero(nodes.delta == spacing) for spacing in np.unique(nodes.delta)]
    trees = [cKDTree(nodes.position[rows]) for rows in levels]
    level_pairs = [np.zeros((0, 2), dtype=np.int64)]
    for rows, tree in zip(levels, trees, strict=True):
        level_pairs.append(rows[tree.query_pairs((1 + NEAR) * nodes.delta[rows[0]], output_type="ndarray")])
    for (rows, tree), (others, second_tree) in itertools.combinations(zip(levels, trees, strict=True), 2):
        first_spacing, second_spacing = nodes.delta[rows[0]], nodes.delta[others[0]]
        reach = np.hypot((first_spacing + second_spacing) / 2, np.sqrt(2) * (second_spacing - first_spacing) / 2)
        near = tree.sparse_distance_matrix(second_tree, (1 + NEAR) * reach, output_type="ndarray")
        level_pairs.append(np.column_stack([rows[near["i"]], others[near["j"]]]))
    pairs = np.sort(np.concatenate(level_pairs), axis=1)
    half = nodes.delta[pairs].sum(axis=1)[:, None] / 2
    way = np.sort(np.abs(np.diff(nodes.position[pairs], axis=1)[:, 0]), axis=1) / half
    pairs = pairs[(np.abs(way[:, 2] - 1) < NEAR) & (way[:, 1] < 1 - NEAR)]  # touch along one axis, overlap along others
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])])
