"""Faces of a body in space picked from outside, by words.

right            one of left, right (along x), front, back (y), bottom, top (z)
nearest 1,2,3    the smooth face nearest to a place, of a hole too
normal 0,0,1     all triangles that face a direction, within a degree
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected
from pdmesh.model.triangulated_surface import distances
from pdmesh.quantities import Unit
from pdmesh.scene.edges import METRE, points_in
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import Sheet, Shell

SIDES = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1), "bottom": (2, -1), "top": (2, 1)}
CORNER = np.cos(np.radians(30))  # of the angle between neighbouring triangles: faces end where they turn by more
FACING = np.cos(np.radians(1))
FORMS = {"nearest": 1, "normal": 1}
EXPECTED = f"one of {', '.join(SIDES)}, 'nearest X,Y,Z' or 'normal X,Y,Z'"


def face(shell: Shell, words: str, place: str, unit: Unit = METRE) -> str | Sheet:
    """The side, or the part of a body's surface, that the words pick. Raises SceneError, beginning with `place`."""
    if words.strip() in SIDES:
        return words.strip()
    first, points = parsed(words, place, unit)
    triangles, at = shell.triangles, points[0]
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    turn = np.sign(np.einsum("ti,ti->", a, normal)) or 1.0  # of the volume: which way all triangles turn
    normal = turn * normal / np.where(size > 0, size, 1.0)[:, None]  # outward where the surface is closed
    if first == "normal":
        is_facing = normal @ at >= FACING * np.linalg.norm(at)
        if not is_facing.any():
            raise SceneError(f"{place}: no face faces {tuple(at.tolist())}; use another direction")
        return Sheet(triangles[is_facing])
    # number (t,) of the smooth part of the surface that each triangle belongs to
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    corner = np.unique(np.round(triangles.reshape(-1, 3) / (1e-9 * size)), axis=0, return_inverse=True)[1].reshape(
        -1, 3
    )
    ends = np.sort(np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort(ends.T)
    same = (ends[order[1:]] == ends[order[:-1]]).all(axis=1)
    first, second = owner[order[:-1][same]], owner[order[1:][same]]
    smooth = (normal[first] * normal[second]).sum(axis=1) >= CORNER
    patch = connected(len(triangles), first[smooth], second[smooth])
    away = np.array([distances(points, triangles[patch == k], np.inf)[0] for k in range(patch.max() + 1)])
    return Sheet(triangles[patch == away.argmin()])


def parsed(words: str, place: str, unit: Unit = METRE) -> tuple[str, NDArray[np.float64]]:
    """The first word of a choice that is no side, and the points (1, 3) behind it. Raises SceneError."""
    return points_in(words, FORMS, 3, place, EXPECTED, unit)
