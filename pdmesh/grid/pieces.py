"""Pieces of a plate that bonds connect, and places where it is too thin for its nodes.

These are between holes, cracks and edges: a disc of the smallest allowed width is moved through the plate. Where an
edge, a hole or a crack is nearer than that to another one, the disc does not pass between them. Where the reachable
region falls apart, it does not pass a neck of a single edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROUND_OFF, Neighbours, chosen, connected, tree_of
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import SLACK, cracks_of, sight_of
from pdmesh.scene.shapes import near, parts

PAIRS = 2**20  # looked at together
NEXT = 4  # nodes around one of a mesh
SLIVER = 1e-3  # of a spacing squared: parts of a plate below are round-off
THINNEST = 3.0  # spacings that a ligament should have at least
ROUND = 32  # segments of a quarter circle; off by 3e-4 of its radius
EXACT = 1e-3  # of a width
STAGES = 4  # radii that are tried: what is behind a neck may be too small for the whole one
MOST_SIZES = 16  # spacings; those of a mesh are taken a factor of 2 apart


def faces_of(plate: shapely.Geometry, grid: Grid) -> list[shapely.Polygon]:
    """The parts into which pre-cracks divide a grid's plate."""
    if not len(grid.cracks):
        return list(parts(plate))
    # Ends are extended to cross the edges they are on; segments extended one by one overlap where they are short, and
    # overlaps take time squared
    by = SLACK * float(grid.delta.min())
    merged = shapely.line_merge(shapely.multilinestrings(grid.cracks.reshape(-1, 2, 2)))
    chains = []
    for line in shapely.get_parts(merged):
        points = shapely.get_coordinates(line)
        for end, inner in ((0, 1), (-1, -2)):
            way = points[end] - points[inner]
            length = float(np.hypot(*way))
            points[end] += by / length * way if length > 0 else 0.0
        chains.append(shapely.LineString(points))
    lines = shapely.union_all([plate.boundary, *chains])
    least = SLIVER * float(grid.delta.min()) ** 2
    shapely.prepare(plate)
    faces = [face for face in parts(shapely.polygonize(shapely.get_parts(lines))) if face.area > least]
    return [face for face in faces if plate.contains(face.representative_point())]


def pieces(grid: Grid, reach: float) -> NDArray[np.int64]:
    """The piece number (n,) of each node, from 0; bonds connect the nodes of a piece.

    A bond is at most `reach` mean spacings of its nodes long, as in the conservative mode, stays in the plate and
    crosses no pre-crack.
    """
    from scipy.ndimage import label

    neighbours = Neighbours(grid.position, grid.delta, reach * grid.delta, mutual=True)
    # Pieces from bonds that surely exist: those of nodes farther than a spacing from edges and cracks to the next
    # nodes, of at most two spacings. The bonds of all others, and of those at a lattice's edge, need checking.
    inner = ~(grid.border | near(grid.position, cracks_of(grid), grid.delta))
    number, needs_check = np.arange(len(grid)), np.ones(len(grid), dtype=bool)
    alone = np.ones(len(grid), dtype=bool)
    for rows in neighbours.maps():
        has_node = np.pad(rows >= 0, 1)
        full = (
            has_node[1:-1, 1:-1] & has_node[:-2, 1:-1] & has_node[2:, 1:-1] & has_node[1:-1, :-2] & has_node[1:-1, 2:]
        )
        alone[rows[has_node[1:-1, 1:-1]]] = False
        full[full] = inner[rows[full]]
        islands, count = label(full)
        inner_rows, island = rows[full], islands[full]
        first = np.zeros(count + 1, dtype=np.int64)
        first[island[::-1]] = inner_rows[::-1]
        number[inner_rows], needs_check[inner_rows] = first[island], False
    lone_rows = np.flatnonzero(alone & inner)
    if len(lone_rows) > NEXT:
        length, place = tree_of(grid.position[lone_rows]).query(grid.position[lone_rows], NEXT + 1)
        delta = grid.delta[lone_rows]
        sure = length <= np.minimum(2 * np.minimum(delta[:, None], delta[place]), reach * delta[:, None])
        piece = connected(len(lone_rows), np.repeat(np.arange(len(lone_rows)), sure.sum(axis=1)), place[sure])
        largest = piece == np.bincount(piece).argmax()
        number[lone_rows[largest]], needs_check[lone_rows[largest]] = lone_rows[largest][0], False
    rows_to_check = np.flatnonzero(needs_check)
    sight, links = sight_of(grid), [np.zeros((2, 0), dtype=np.int64)]
    for chunk in np.array_split(rows_to_check, int(len(rows_to_check) * (2 * reach) ** 2 / PAIRS) + 1):
        pairs = neighbours.pairs(chunk)
        mean = (grid.delta[pairs.source] + grid.delta[pairs.target]) / 2
        pairs = chosen(pairs, pairs.length <= reach * mean * (1 + ROUND_OFF))
        in_sight = sight.inside(pairs) & ~sight.cut(pairs)
        links.append(number[np.stack([pairs.source[in_sight], pairs.target[in_sight]])])
    piece = connected(len(grid), *np.concatenate(links, axis=1))[number]
    is_used = np.zeros(len(grid), dtype=bool)
    is_used[piece] = True
    return np.asarray((np.cumsum(is_used) - 1)[piece], dtype=np.int64)


class Ligament(NamedTuple):
    """A thin place of a plate."""

    place: tuple[float, float]  # m, its middle
    width: float  # m
    spacing: float  # m, of the nodes there


class _Gap(NamedTuple):
    width: float  # m
    middle: NDArray[np.float64]  # (k, 2) m, points along its middle


def ligaments(grid: Grid, faces: list[shapely.Polygon]) -> list[Ligament]:
    """Places where a plate is thinner than THINNEST local spacings, the thinnest first.

    `faces` are the parts into which its cracks divide the plate.
    """
    sizes = np.unique(grid.delta)
    # without points that are near their line: discs around a million points would take for ever to unite
    cracks = shapely.line_merge(shapely.multilinestrings(grid.cracks.reshape(-1, 2, 2)))
    cracks = shapely.simplify(cracks, EXACT * THINNEST / 2 * float(sizes[0]), preserve_topology=False)
    if len(sizes) > MOST_SIZES:
        sizes = np.exp2(np.unique(np.ceil(np.log2(sizes))))
    # gaps between two edges, holes or cracks that do not touch each other
    lines = shapely.get_parts(shapely.union_all([cracks, *(face.boundary for face in faces)]))
    number = connected(len(lines), *shapely.STRtree(lines).query(lines, predicate="intersects"))  # of those that touch
    edges = np.array([shapely.multilinestrings(lines[number == group]) for group in range(number.max() + 1)])
    plate, widest, gaps = shapely.union_all(faces), THINNEST * float(sizes[-1]), list[_Gap]()
    for first, second in shapely.STRtree(edges).query(edges, predicate="dwithin", distance=widest).T:
        line = shapely.shortest_line(edges[first], edges[second])
        middle = line.interpolate(0.5, normalized=True)
        if first < second and plate.contains(middle):
            gaps.append(_Gap(float(line.length), shapely.get_coordinates(middle)))
    lines = shapely.get_parts(cracks)
    tree = shapely.STRtree(lines)
    for face in faces:
        face_cracks = shapely.multilinestrings(lines[tree.query(face, predicate="intersects")])
        for size in sizes:
            gaps += _necks(face, face_cracks, THINNEST / 2 * float(size))
    distinct: list[Ligament] = []
    for ligament in sorted(_thin(gaps, grid), key=lambda ligament: ligament.width / ligament.spacing):
        if all(np.hypot(*np.subtract(ligament.place, thinner.place)) > ligament.spacing for thinner in distinct):
            distinct.append(ligament)
    return distinct


def _thin(gaps: list[_Gap], grid: Grid) -> Iterator[Ligament]:
    """Gaps that are too thin for their nodes, as ligaments."""
    if not gaps:
        return
    middles, margin = np.concatenate([gap.middle for gap in gaps]), 2 * float(grid.delta.max())
    low, high = middles.min(axis=0) - margin, middles.max(axis=0) + margin
    near = ((grid.position >= low) & (grid.position <= high)).all(axis=1)
    near_rows = np.flatnonzero(near) if near.any() else np.arange(len(grid))
    tree = tree_of(grid.position[near_rows])
    for gap in gaps:
        delta = grid.delta[near_rows[tree.query(gap.middle)[1]]]
        coarsest = np.flatnonzero(delta == delta.max())
        at = int(coarsest[len(coarsest) // 2])
        if gap.width < THINNEST * delta[at] * (1 - 2 * EXACT):
            x, y = gap.middle[at].tolist()
            yield Ligament((x, y), gap.width, float(delta[at]))


def _necks(face: shapely.Polygon, cracks: shapely.Geometry, radius: float) -> Iterator[_Gap]:
    """Necks of a face that a disc does not pass, although it or a smaller one fits on both sides."""

    def reached(disc: float) -> list[shapely.Polygon]:
        """The regions that the centre of a disc can reach in the face without touching the cracks."""
        middle = face.buffer(-disc, quad_segs=ROUND).difference(cracks.buffer(disc, quad_segs=ROUND))
        return [part for part in parts(middle) if part.area > (EXACT * disc) ** 2]

    radii = radius * (1 - EXACT) * np.linspace(0, 1, STAGES + 1)
    stages = [[face], *(reached(stage_radius) for stage_radius in radii[1:].tolist())]
    if not stages[-1]:
        middle, rim = shapely.get_coordinates(shapely.maximum_inscribed_circle(face))
        yield _Gap(2 * float(np.hypot(*(rim - middle))), middle[None])
    spans = list(zip(radii[:-1].tolist(), radii[1:].tolist(), stages[:-1], stages[1:], strict=True))
    while spans:
        low, high, before, after = spans.pop()
        if len(after) <= len(before):
            continue
        if high - low > EXACT * radius:
            half = (low + high) / 2
            between = reached(half)
            spans += [(low, half, before, between), (half, high, between, after)]
            continue
        for parent in before:
            rest = [child for child in after if parent.contains(child.representative_point())]
            joined, rest = rest[:1], rest[1:]
            while rest:
                lines = shapely.shortest_line(shapely.union_all(joined), rest)
                nearest = int(shapely.length(lines).argmin())
                yield _Gap(low + high, shapely.get_coordinates(shapely.segmentize(lines[nearest], radius / 2)))
                joined.append(rest.pop(nearest))
