"""Checks that the nodes of a grid file fit its shapes, which an edit or another program may have broken.

A file without an outline or without areas is checked for less.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import GridError, GridWarning
from pdmesh.model.node_grid import Grid
from pdmesh.model.triangulated_surface import distances, normals, volume
from pdmesh.model.visibility import plate_of

if TYPE_CHECKING:
    import shapely

SAME = {2: 1e-6, 3: 2e-2}  # of the whole: areas add up to round-off; volumes are counted with rays
OFF = 0.5  # spacings outside its shape that a node may be: chords of arcs cut off less
AROUND_ONE = 1.5  # spacings: nearly every node has another this near
LONG = 2.0  # spacings: a crack this long parts neighbours, wherever it is in the plate
AT_ONCE = 2**20  # pairs of nodes and faces
SLANT = (0.01732050807568877, 0.02912878474779199)  # of rays, so that they meet no edge that is along an axis

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def examine(grid: Grid, name: str = "grid") -> None:
    """Warn with GridWarning of inconsistencies in the grid of the file called `name`.

    Raises GridError if most nodes are outside the shapes, and for an invalid outline.
    """
    for message in _inconsistencies(grid, name):
        warnings.warn(message, GridWarning, stacklevel=2)


def _inconsistencies(grid: Grid, name: str) -> Iterator[str]:
    plate = plate_of(grid, name) if grid.dimension == 2 else None
    if grid.outline and grid.lattice is None:
        size = volume(grid.faces) if plate is None else float(plate.area)
        if grid.areas is not None:
            total, unit = float(grid.areas.sum()), f"m^{grid.dimension}"
            if abs(total - size) > SAME[grid.dimension] * size:
                yield (
                    f"{name}: $.areas: their sum is {total:.9g} {unit}, and the outline has {size:.9g} {unit};"
                    " correct one of them"
                )
        yield from _outside(grid, plate, name)
    elif grid.lattice is not None and grid.outline:
        # the lattice, or the box of its cells, is the rectangle of the outline
        out = 0.5 * float(grid.delta[0]) if grid.dimension == 3 else 0.0
        first, last = grid.part(np.array([0, len(grid) - 1])).position
        box = np.array([*(first - out), *(last + out)])
        corners = np.concatenate(grid.outline)
        expected = np.array([*corners.min(axis=0), *corners.max(axis=0)])
        if np.abs(box - expected).max() > OFF * float(grid.delta[0]):
            yield (
                f"{name}: $.lattice: it lies between {box.tolist()} m, and the outline between {expected.tolist()} m;"
                " make them agree"
            )
    yield from _cracks(grid, name)


def _outside(grid: Grid, plate: shapely.Geometry | None, name: str) -> Iterator[str]:
    if plate is None:
        # a ray from a place inside meets the surface an odd number of times
        nodes, corners = (place[..., :2] - place[..., 2:] * SLANT for place in (grid.position, grid.faces))
        order = np.argsort(nodes[:, 0])
        low, high = corners.min(axis=1), corners.max(axis=1)
        first, last = (np.searchsorted(nodes[order, 0], end[:, 0]) for end in (low, high))
        met = np.zeros(len(grid), dtype=np.int64)
        for chunk in np.split(np.arange(len(corners)), np.flatnonzero(np.diff(np.cumsum(last - first) // AT_ONCE)) + 1):
            count = (last - first)[chunk]
            face = np.repeat(chunk, count)
            row = order[np.arange(count.sum()) + np.repeat(first[chunk] - np.cumsum(count) + count, count)]
            in_bounds = (nodes[row, 1] >= low[face, 1]) & (nodes[row, 1] <= high[face, 1])
            row, face = row[in_bounds], face[in_bounds]
            first_edge, second_edge = corners[face, 1] - corners[face, 0], corners[face, 2] - corners[face, 0]
            from_first, area = nodes[row] - corners[face, 0], _cross(first_edge, second_edge)
            z = grid.faces[face, :, 2]
            with np.errstate(divide="ignore", invalid="ignore"):  # faces along the rays, which none meets
                s, t = _cross(from_first, second_edge) / area, _cross(first_edge, from_first) / area
                above = z[:, 0] + s * (z[:, 1] - z[:, 0]) + t * (z[:, 2] - z[:, 0]) > grid.position[row, 2]
                np.add.at(met, row[(s >= 0) & (t >= 0) & (s + t <= 1) & above], 1)
        away, out = np.zeros(len(grid)), np.flatnonzero(met % 2 == 0)
        if len(out):
            away[out] = distances(grid.position[out], grid.faces, OFF * float(grid.delta[out].max()))
    else:
        import shapely

        shapely.prepare(plate)
        away = np.zeros(len(grid))
        out = np.flatnonzero(~shapely.intersects_xy(plate, grid.position))
        away[out] = shapely.distance(plate, shapely.points(grid.position[out]))
    off = np.flatnonzero(away > OFF * grid.delta)
    if not len(off):
        return
    at = int(off[0])
    place = ", ".join(f"{value:.6g}" for value in grid.position[at])
    message = (
        f"{name}: $.nodes: {len(off)} are outside the outline or in a hole, the first {grid.ids[at]} at ({place})"
        " m; move them inside"
    )
    if 2 * len(off) > len(grid):
        raise GridError(f"{message}: most nodes are not of these shapes")
    yield message


def _cross(a: Array, b: Array) -> Array:
    """z components (p,) of the cross products of vectors (p, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _cracks(grid: Grid, name: str) -> Iterator[str]:
    """What there is to say of cracks that separate no neighbours."""
    if not len(grid.cracks):
        return
    corners = grid.cracks.reshape(len(grid.cracks), -1, grid.dimension)
    reach, least = AROUND_ONE * float(grid.delta.max()), LONG * float(grid.delta.min())
    if grid.dimension == 3:  # the triangles of a crack are many and near each other
        every = corners.reshape(-1, 3)
        grid = grid.part(grid.chosen(None, [*(every.min(axis=0) - reach), *(every.max(axis=0) + reach)]))
    for number, corner in enumerate(corners):
        if _size(corner) < least:
            continue
        rows = grid.chosen(None, [*(corner.min(axis=0) - reach), *(corner.max(axis=0) + reach)])
        nearby_nodes = grid.part(rows)
        spacing = float(nearby_nodes.delta.max(initial=0.0))
        if len(rows) and (
            _size(corner) < LONG * spacing or _parts(nearby_nodes.position, AROUND_ONE * nearby_nodes.delta, corner)
        ):
            continue
        yield (
            f"{name}: $.notch[{number}]: the crack parts no neighbouring nodes; put it between some (is it outside"
            " the plate, or along its edge?)"
        )


def _size(corner: Array) -> float:
    """Length of a segment (2, 2), root of twice the area of a triangle (3, 3), m."""
    if len(corner) == 2:
        return float(np.hypot(*(corner[1] - corner[0])))
    return float(np.sqrt(np.sqrt((normals(corner[None]) ** 2).sum())))


def _parts(position: Array, reach: Array, corner: Array) -> bool:
    """Whether nodes (n, d) within `reach` (n,) of a crack's segment or triangle lie on both of its sides."""
    way = position - corner[0]
    if len(corner) == 2:
        along = corner[1] - corner[0]
        share = way @ along / (along @ along)
        over_crack = (share >= 0) & (share <= 1)
        side = way @ (along[1], -along[0]) / np.hypot(*along)
    else:
        normal = normals(corner[None])[0]
        edges = np.roll(corner, -1, axis=0) - corner
        turned = [np.cross(edge, position - start) @ normal for edge, start in zip(edges, corner, strict=True)]
        over_crack = np.min(turned, axis=0) >= 0
        side = way @ normal / np.sqrt(normal @ normal)
    near = side[over_crack & (np.abs(side) <= reach)]
    return bool(len(near) and near.min() < 0 < near.max())
