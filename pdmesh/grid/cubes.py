"""Lattices of cubes, and which of their centres a closed surface of triangles encloses.

The surface cuts lines along z, which pass through the centres. A line is inside between the first cut and the second,
between the third and the fourth, and so on. Lines are displaced by less than a millionth of a spacing, so that none
runs along an edge.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.scene.shapes import SceneError

ASIDE = np.array([1.234567e-7, 2.718281e-7])  # of a spacing: what lines are off their places
AT_ONCE = 2**22  # lines through the bounding boxes of triangles


class Cuts(NamedTuple):
    """Cuts of lines by the surface, c in all, ordered by line, then by height."""

    line: NDArray[np.int64]  # (c,)
    height: NDArray[np.float64]  # (c,) in spacings from the lattice's bottom
    leaves: NDArray[np.bool_]  # (c,) whether the line leaves the inside there


class Cubes(NamedTuple):
    """A lattice of cubes."""

    corner: NDArray[np.float64]  # (3,) m, of the first one
    spacing: float  # m
    size: NDArray[np.int64]  # (3,) how many along x, y, z

    def middles(self, at: NDArray[np.int64]) -> NDArray[np.float64]:
        """Centres (k, 3), m, of cubes (k, 3); mirrored cubes have bitwise mirrored centres."""
        decimals = 9 - int(np.floor(np.log10(self.spacing)))
        return np.asarray(np.round(self.corner + (at + 0.5) * self.spacing, decimals) + 0.0)


def inside(triangles: NDArray[np.float64], cubes: Cubes, place: str, slack: float = 0.0) -> NDArray[np.bool_]:
    """Mask (x, y, z) of the cubes with their centre inside the surface of triangles (t, 3, 3), m.

    With a `slack`, in spacings, centres that are less than that outside count too, whatever the direction. Raises
    SceneError, beginning with `place`, for a surface that does not close.
    """
    size = int(cubes.size[2])
    mask = np.zeros((int(cubes.size[0] * cubes.size[1]), size), dtype=bool)
    for aside in product((-slack, slack), repeat=2) if slack else ((0.0, 0.0),):
        cuts = _cuts(triangles, cubes._replace(corner=cubes.corner + cubes.spacing * np.array((*aside, 0.0))), place)
        middle = cuts.height - 0.5 + np.where(cuts.leaves, slack, -slack)
        first = np.clip(np.ceil(middle), 0, size).astype(np.int64)  # middle at or above a cut
        at = cuts.line * (size + 1) + first
        change = np.bincount(at, np.where(cuts.leaves, -1, 1), minlength=len(mask) * (size + 1))
        mask |= change.reshape(-1, size + 1).cumsum(axis=1)[:, :-1] > 0.5
    return mask.reshape(cubes.size)


def _cuts(triangles: NDArray[np.float64], cubes: Cubes, place: str) -> Cuts:
    """Cuts of the line through each column of cubes. Raises SceneError for an open surface."""
    wide = cubes.size[:2]
    flat = (triangles - cubes.corner) / cubes.spacing
    flat[..., :2] = flat[..., :2] - 0.5 - ASIDE  # lines at whole numbers
    first = np.clip(np.ceil(flat[..., :2].min(axis=1)), 0, wide).astype(np.int64)
    last = np.clip(np.floor(flat[..., :2].max(axis=1)) + 1, 0, wide).astype(np.int64)
    many = (last - first).clip(min=0)
    total = many[:, 0] * many[:, 1]
    cuts: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []
    triangle_rows = np.flatnonzero(total)
    for chunk in np.split(triangle_rows, np.flatnonzero(np.diff(np.cumsum(total[triangle_rows]) // AT_ONCE)) + 1):
        cuts.append(_crossed(flat, chunk, first, many, wide))
    line, height = (np.concatenate(column) for column in zip(*cuts, strict=True))
    order = np.lexsort((height, line))
    line, height = line[order], height[order]
    counts = np.bincount(line, minlength=int(wide[0] * wide[1]))
    if (counts % 2).any():
        odd = np.array(np.divmod(int((counts % 2).argmax()), int(wide[1])))
        x, y = cubes.corner[:2] + (odd + 0.5) * cubes.spacing
        raise SceneError(
            f"{place}: the surface is open, or crosses itself, near x = {x:g}, y = {y:g} m; use a closed one"
        )
    rank = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    return Cuts(line, height, rank % 2 == 1)


def _crossed(
    flat: NDArray[np.float64],
    chunk: NDArray[np.int64],
    first: NDArray[np.int64],
    many: NDArray[np.int64],
    wide: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Line numbers and heights of the cuts by some of the triangles."""
    total = many[chunk, 0] * many[chunk, 1]
    triangle = np.repeat(chunk, total)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(total) - total, total)
    x, y = np.divmod(number, many[triangle, 1])
    x, y = x + first[triangle, 0], y + first[triangle, 1]
    a, b, c = (flat[triangle, corner] for corner in range(3))
    weights = [_turn(b, c, x, y), _turn(c, a, x, y), _turn(a, b, x, y)]
    up = (weights[0] > 0) & (weights[1] > 0) & (weights[2] > 0)
    down = (weights[0] < 0) & (weights[1] < 0) & (weights[2] < 0)
    hit = up | down
    u, v, w = (weight[hit] for weight in weights)
    height = (u * a[hit, 2] + v * b[hit, 2] + w * c[hit, 2]) / (u + v + w)
    return (x * wide[1] + y)[hit], np.asarray(height)


def _turn(
    a: NDArray[np.float64], b: NDArray[np.float64], x: NDArray[np.int64], y: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Twice the signed area of the triangle a, b, (x, y); exchanging a and b changes exactly the sign."""
    swapped = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    p, q = np.where(swapped[:, None], b, a), np.where(swapped[:, None], a, b)
    twice = (q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0])
    return np.asarray(np.where(swapped, -twice, twice))
