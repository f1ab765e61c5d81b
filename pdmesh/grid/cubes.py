"""Lattices of cubes: which of their centres, and what share of each, a closed surface of triangles encloses.

The surface cuts lines along z, which pass through the centres. A line is inside between the first cut and the second,
between the third and the fourth, and so on. Lines are displaced by less than a millionth of a spacing, so that none
runs along an edge.

Shares are exact: triangles are clipped at the sides of the cubes, so that each piece lies in one cube. The part of a
cube below a piece is a prism; prisms of pieces that face upwards count as positive, those of pieces that face downwards
as negative. The sum over a column of cubes is the enclosed volume, whatever the direction of the surface: faces
parallel to z have no prism, as their neighbours end where they stand.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.scene.shapes import SceneError

ASIDE = np.array([1.234567e-7, 2.718281e-7])  # of a spacing: what lines are off their places
AT_ONCE = 2**22  # lines through the bounding boxes of triangles
TRIANGLES_AT_ONCE = 2**15  # triangles, or about as many pieces of large ones
Polygons = NDArray[np.float64]  # (p, v, 3) convex; those of fewer corners repeat their last one


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


def shares(triangles: NDArray[np.float64], cubes: Cubes) -> NDArray[np.float64]:
    """Share (x, y, z) of each cube inside the closed surface of triangles (t, 3, 3), m, turned `outward`.

    Where the surface crosses itself, a share may be less than 0 or more than 1.
    """
    cube_volumes, above = np.zeros(cubes.size.prod()), np.zeros(cubes.size[:2].prod() * (cubes.size[2] + 1))
    corners = (triangles - cubes.corner) / cubes.spacing
    low, high = corners.min(axis=1), corners.max(axis=1)
    over_columns = ((high[:, :2] > low[:, :2]) & (high[:, :2] > 0) & (low[:, :2] < cubes.size[:2])).all(axis=1)
    corners = corners[over_columns & (high[:, 2] > 0)]
    pieces = np.ceil(np.ptp(corners, axis=1)[:, :2] + 1).prod(axis=1)
    for polygons in np.split(corners, np.flatnonzero(np.diff(np.cumsum(pieces) // TRIANGLES_AT_ONCE)) + 1):
        # the prisms below pieces of polygons, and their bases: by cube, and one on top
        column = np.zeros(len(polygons), dtype=np.int64)
        for axis in range(2):
            polygons, row, number = _sliced(polygons, axis, int(cubes.size[axis]))
            column = column[row] * cubes.size[axis] + number
        top = polygons[..., 2].min(axis=1) >= cubes.size[2]
        _add_bases(polygons[top], column[top] * (cubes.size[2] + 1) + cubes.size[2], above)
        polygons, column = polygons[~top], column[~top]
        over = polygons[..., 2].max(axis=1) > cubes.size[2]
        upper = _half(polygons[over], 2, np.full(over.sum(), float(cubes.size[2])), 1.0)
        _add_bases(upper, column[over] * (cubes.size[2] + 1) + cubes.size[2], above)
        polygons, row, number = _sliced(polygons, 2, int(cubes.size[2]))
        column = column[row]
        base, height = _bases(polygons)
        _count(column * (cubes.size[2] + 1) + number, base, above)
        _count(column * cubes.size[2] + number, base * (height - number), cube_volumes)
    above = above.reshape(-1, cubes.size[2] + 1)
    full = above[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]  # below the pieces in the cubes above each one
    return np.asarray((cube_volumes + full.ravel()).reshape(cubes.size))


def _add_bases(polygons: Polygons, at: NDArray[np.int64], above: NDArray[np.float64]) -> None:
    if len(polygons):
        _count(at, _bases(polygons)[0], above)


def _count(at: NDArray[np.int64], values: NDArray[np.float64], sums: NDArray[np.float64]) -> None:
    """Add values (k,) to the sums at these places."""
    if len(at):
        first = int(at.min())
        added = np.bincount(at - first, values)
        sums[first : first + len(added)] += added


def _bases(polygons: Polygons) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Areas (p,) of polygons seen along z, positive where they face upwards, and their mean heights."""
    start, way = polygons[:, :1], polygons[:, 1:] - polygons[:, :1]
    twice = way[:, :-1, 0] * way[:, 1:, 1] - way[:, :-1, 1] * way[:, 1:, 0]
    base = twice.sum(axis=1) / 2
    moment = (twice * (way[:, :-1, 2] + way[:, 1:, 2])).sum(axis=1) / 6
    return base, start[:, 0, 2] + np.divide(moment, base, out=np.zeros(len(base)), where=base != 0)


def _sliced(polygons: Polygons, axis: int, size: int) -> tuple[Polygons, NDArray[np.int64], NDArray[np.int64]]:
    """The pieces of polygons between neighbouring whole numbers from 0 to `size` along an axis.

    Also the polygon that each piece is of, and the lower of its two numbers.
    """
    along = polygons[..., axis]
    low, high = along.min(axis=1), along.max(axis=1)
    first = np.clip(np.floor(low), 0, size).astype(np.int64)
    last = np.clip(np.where(high > np.floor(low), np.ceil(high), np.floor(low) + 1), 0, size).astype(np.int64)
    count = last - first
    row = np.repeat(np.arange(len(polygons)), count)
    number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + first[row]
    pieces = polygons[row]
    for at, way, crossing in ((number, 1.0, low[row] < number), (number + 1, -1.0, high[row] > number + 1)):
        if crossing.any():
            clipped = _half(pieces[crossing], axis, at[crossing].astype(float), way)
            pieces = np.concatenate([pieces, np.repeat(pieces[:, -1:], clipped.shape[1] - pieces.shape[1], axis=1)], 1)
            pieces[crossing] = clipped
    return pieces, row, number


def _half(polygons: Polygons, axis: int, at: NDArray[np.float64], way: float) -> Polygons:
    """The parts of polygons, one corner longer, above a coordinate each (`way` = 1), or below it (-1).

    All polygons have corners on both sides. I. E. Sutherland, G. W. Hodgman, Commun. ACM 17 (1974) 32-42.
    """
    depth = way * (polygons[..., axis] - at[:, None])
    after, deeper = np.roll(polygons, -1, axis=1), np.roll(depth, -1, axis=1)
    inner, crosses = depth >= 0, (depth >= 0) != (deeper >= 0)
    share = np.divide(depth, depth - deeper, out=np.zeros_like(depth), where=crosses)
    met = polygons + share[..., None] * (after - polygons)
    met[..., axis] = at[:, None]
    double = len(polygons), 2 * polygons.shape[1]
    both = np.stack([polygons, met], axis=2).reshape(*double, 3)
    is_corner = np.stack([inner, crosses], axis=2).reshape(double)
    order = np.argsort(~is_corner, axis=1, kind="stable")
    number = np.minimum(np.arange(polygons.shape[1] + 1), is_corner.sum(axis=1, keepdims=True) - 1)
    corner = np.take_along_axis(order, number, axis=1)
    return np.asarray(np.take_along_axis(both, corner[..., None], axis=1))
