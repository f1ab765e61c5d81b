"""Faces and pre-cracks of a body that a pressure acts on, as triangles that turn anticlockwise as seen from outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import tree_of
from pdmesh.model.pressed_faces import Faces
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import Sheet

CLEARLY = 0.1  # of a spacing: a node this far from a face is on one side of it
BESIDE = 0.75  # of a spacing: a node this far from a place along a face is behind it or in front of it
MOST_INSIDE = 0.5  # of a sheet may have nodes on both sides, as corners that turn inwards have


def faces_of_sheet(sheet: Sheet, position: NDArray[np.float64], delta: NDArray[np.float64], place: str) -> Faces:
    """The triangles of a part of a body's surface with nodes at `position` (n, 3) with spacings `delta` (n,), m.

    Raises SceneError, beginning with `place`, for a sheet inside the body.
    """
    areas, triangles = sheet.areas, sheet.triangles
    triangles = triangles[areas > 0]
    a, b, c = triangles.transpose(1, 0, 2)
    middle, normal = triangles.mean(axis=1), np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    near = tree_of(position).query_ball_point(middle, 2 * float(delta.max()))
    face = np.repeat(np.arange(len(triangles)), [len(rows) for rows in near])
    node = np.concatenate([np.asarray(rows, dtype=np.int64) for rows in near])
    way = position[node] - middle[face]
    high = (way * normal[face]).sum(axis=1)
    along = np.sqrt(np.maximum((way**2).sum(axis=1) - high**2, 0.0))
    beside = (along < BESIDE * delta[node]) & (np.abs(high) <= delta[node]) & (np.abs(high) > CLEARLY * delta[node])
    in_front, behind = (np.bincount(face[beside & (sign * high > 0)], minlength=len(triangles)) > 0 for sign in (1, -1))
    sizes = areas[areas > 0]
    if sizes[in_front & behind].sum() > MOST_INSIDE * sizes.sum():
        x, y, z = middle[np.flatnonzero(in_front & behind)[0]]
        raise SceneError(
            f"{place}: ({x:g}, {y:g}, {z:g}) m is inside the body; use a face, or 'crack NAME' for both faces of a"
            " pre-crack"
        )
    is_turned = np.bincount(face, high, len(triangles)) > 0
    return _rows(np.where(is_turned[:, None, None], triangles[:, ::-1], triangles))


def faces_of_crack_sheet(sheet: Sheet) -> Faces:
    """The triangles of both faces of a pre-crack."""
    return _rows(np.concatenate([sheet.triangles, sheet.triangles[:, ::-1]]))


def _rows(triangles: NDArray[np.float64]) -> Faces:
    return tuple(map(tuple, triangles.reshape(-1, 9).tolist()))
