"""Visibility in space past cracks made of triangles: pairs cut by a triangle, and the path round the crack's front.

The front consists of the edges that belong to one triangle. If the triangles are coplanar, the shortest path round them
bends once, on the front. Past kinked cracks, a path of two legs is taken if one meets no triangle.

Symbols: a, b ends of a pair; t triangles (t, 3, 3), their corners; all in m.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import meets, normals

AT_ONCE = 1 << 18  # pairs times triangles that are looked at together
TOUCH = 1e-9  # of a triangle's size: corners this near are one
SHORT = 1e-4  # of a leg that ends on the front: that much is not looked at

Array = NDArray[np.float64]


def parted(a: Array, b: Array, triangles: Array) -> NDArray[np.bool_]:
    """Mask (p,) of the pairs (p, 3) whose segment meets a triangle (t, 3, 3), as defined in `meets`."""
    is_parted, normal = np.zeros(len(a), dtype=bool), normals(triangles)
    has_area = (normal != 0).any(axis=1)
    triangles, normal = triangles[has_area], normal[has_area]
    if not len(triangles):
        return is_parted
    for chunk in np.array_split(np.arange(len(a)), len(a) * len(triangles) // AT_ONCE + 1):
        pair, triangle = (
            index_grid.ravel() for index_grid in np.meshgrid(chunk, np.arange(len(triangles)), indexing="ij")
        )
        met = meets(a[pair], b[pair], triangles[triangle], normal[triangle])
        is_parted[chunk] = met.reshape(len(chunk), len(triangles)).any(axis=1)
    return is_parted


def front(triangles: Array, slack: float = TOUCH) -> Array:
    """Edges (e, 2, 3) that belong to one triangle; corners within `slack` of the triangles' size are one."""
    if not len(triangles):
        return np.zeros((0, 2, 3))
    size = np.sqrt(((triangles[:, 1] - triangles[:, 0]) ** 2).sum(axis=1)).max()
    places = triangles.reshape(-1, 3)
    _, number = np.unique(np.round(places / (slack * size)), axis=0, return_inverse=True)
    corners = number.reshape(-1, 3)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(ends[np.sort(first[count == 1])])


def around(a: Array, b: Array, triangles: Array, edges: Array) -> Array:
    """Length (p,) of the shortest path from a to b over a point of one of the `edges` (e, 2, 3), m.

    Its two legs meet no triangle; infinite if there is none. The edges are those of the front inside the body, without
    the crack's mouth.
    """
    shortest = np.full(len(a), np.inf)
    for edge in edges:
        # the point on the edge of the shortest path from a to b: straight when unfolded about the edge
        way = edge[1] - edge[0]
        length = float(np.sqrt(way @ way))
        unit = way / length
        along, off = [], []
        for end in (a, b):
            along.append((end - edge[0]) @ unit)
            off.append(np.sqrt(((end - edge[0] - along[-1][:, None] * unit) ** 2).sum(axis=1)))
        total = np.maximum(off[0] + off[1], TOUCH * length)
        at = np.clip((along[0] * off[1] + along[1] * off[0]) / total, 0.0, length)
        place = np.asarray(edge[0] + at[:, None] * unit)
        far = np.sqrt(((place - a) ** 2).sum(axis=1)) + np.sqrt(((place - b) ** 2).sum(axis=1))
        better = np.flatnonzero(far < shortest)
        for end in (a, b):
            short = place[better] + SHORT * (end[better] - place[better])
            better = better[~parted(end[better], short, triangles)]
        shortest[better] = far[better]
    return shortest


def apart(a: Array, b: Array, triangles: Array, edges: Array, gamma: float | None, farthest: float) -> Array:
    """Distances (p,) of pairs for their influence on each other, m; see `SightInSpace.apart`."""
    straight = np.sqrt(((b - a) ** 2).sum(axis=1))
    cut = parted(a, b, triangles)
    distance = np.where(cut, 2 * farthest, straight)
    if gamma is not None and cut.any():
        way = around(a[cut], b[cut], triangles, edges)
        with np.errstate(over="ignore"):
            far = np.maximum(way / straight[cut], 1) ** gamma * straight[cut]
        distance[cut] = np.minimum(far, 2 * farthest)
    return distance
