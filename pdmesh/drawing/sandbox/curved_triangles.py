"""Volumes between the first node and curved triangles of a mesh from Gmsh, whose module is an argument.

A side of a triangle is bent through the place midway on its curve or its surface. Midway is meant in parameters, which
are ambiguous at seams and poles: there the place nearest to the straight side's middle counts.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Nodes = NDArray[np.int64]
A, B = 0.445948490915965, 0.091576213509771  # a rule of six places, exact to degree 4 (Dunavant 1985)
RULE = [(A, A), (1 - 2 * A, A), (A, 1 - 2 * A), (B, B), (1 - 2 * B, B), (B, 1 - 2 * B)]
WEIGHTS = [0.223381589678011 / 2] * 3 + [0.109951743655322 / 2] * 3
BENT = 0.3  # of a side: a middle this far off is not that of its curve


def cones(gmsh: Any, places: Array, tags: Nodes, triangles: dict[int, Nodes]) -> dict[int, Array]:
    """Volumes (t,) between the first place and triangles by surface, positive if seen counterclockwise.

    `places` (n, 3) are those of the nodes with these `tags`, whose numbers `triangles` (t, 3) have.
    """
    number = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    keys, middles = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _, curve in gmsh.model.getEntities(1):
        sides = number[np.asarray(gmsh.model.mesh.getElementsByType(1, curve)[1], dtype=np.int64)].reshape(-1, 2)
        keys.append(_keys(sides, len(tags)))
        middles.append(_midway(gmsh, (1, curve), sides, places, number))
    on_curves, first = np.unique(np.concatenate(keys), return_index=True)
    bent = np.concatenate(middles)[first]
    volumes = {}
    for face, corners in triangles.items():
        sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
        middle, key = _midway(gmsh, (2, face), sides, places, number), _keys(sides, len(tags))
        at = np.searchsorted(on_curves, key)
        shared = np.append(on_curves, -1)[at] == key
        middle[shared] = bent[at[shared]]
        volumes[face] = _cone(np.concatenate([places[corners], middle.reshape(-1, 3, 3)], axis=1) - places[0])
    return volumes


def _keys(sides: Nodes, count: int) -> Nodes:
    """A number (s,) for each pair of nodes (s, 2), the same in both orders."""
    return np.asarray(sides.min(axis=1) * count + sides.max(axis=1))


def _midway(gmsh: Any, entity: tuple[int, int], sides: Nodes, places: Array, number: Nodes) -> Array:
    """The places (s, 3) midway on a curve or surface between pairs of nodes (s, 2)."""
    dimension, tag = entity
    tags, _, parameters = gmsh.model.mesh.getNodes(dimension, tag, includeBoundary=True, returnParametricCoord=True)
    straight: Array = places[sides].mean(axis=1)
    if len(parameters) != dimension * len(tags) or not len(sides):
        return straight
    at = np.zeros((len(places), dimension))
    at[number[np.asarray(tags, dtype=np.int64)]] = np.reshape(parameters, (-1, dimension))
    low, high = gmsh.model.getParametrizationBounds(dimension, tag)
    ends, half = at[sides], (np.array(high) - np.array(low)) / 2
    middle: Array = np.reshape(gmsh.model.getValue(dimension, tag, ends.mean(axis=1).ravel()), (-1, 3))
    length = np.linalg.norm(np.diff(places[sides], axis=1)[:, 0], axis=1)
    off = np.linalg.norm(middle - straight, axis=1)
    bent_sides = np.flatnonzero(off > BENT * length)
    ends = ends[bent_sides]
    mean = ends.mean(axis=1)
    choices = [mean, mean - half, mean + half, ends[:, 0], ends[:, 1]]
    for which in product(range(len(choices)), repeat=dimension) if len(bent_sides) else ():
        trial_parameters = np.clip(np.stack([choices[k][:, axis] for axis, k in enumerate(which)], axis=1), low, high)
        tried = np.reshape(gmsh.model.getValue(dimension, tag, trial_parameters.ravel()), (-1, 3))
        away = np.linalg.norm(tried - straight[bent_sides], axis=1)
        nearer = away < off[bent_sides]
        middle[bent_sides[nearer]], off[bent_sides[nearer]] = tried[nearer], away[nearer]
    middle[off > BENT * length] = straight[off > BENT * length]
    return middle


def _cone(nodes: Array) -> Array:
    """Volumes (t,) between the origin and triangles of six nodes (t, 6, 3): corners, and the middles of sides."""
    total = np.zeros(len(nodes))
    for (u, v), weight in zip(RULE, WEIGHTS, strict=True):
        w = 1 - u - v
        shape = np.array([w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w])
        along = np.array([1 - 4 * w, 4 * u - 1, 0, 4 * (w - u), 4 * v, -4 * v])
        across = np.array([1 - 4 * w, 0, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)])
        at, tangent_u, tangent_v = (np.einsum("k,tkx->tx", row, nodes) for row in (shape, along, across))
        total += weight * (at * np.cross(tangent_u, tangent_v)).sum(axis=1) / 3
    return total
