"""Visibility: pairs of nodes without those separated by a pre-crack, a hole or the outline.

A pair separated by a crack may count as far apart as the path round its tips (D. Organ, M. Fleming, T. Terry, T.
Belytschko, Comput. Mech. 18 (1996) 225-235). The influence between nodes is then continuous around a tip.

shapely is imported only if there are obstacles, so that a bare list of nodes is solved without it.

In space cracks are made of triangles. The front consists of the edges that belong to one triangle. If the triangles are
coplanar, the shortest path round them bends once, on the front. Past kinked cracks, a path of two legs is taken if one
meets no triangle.

Symbols: a, b ends of a pair; t triangles (t, 3, 3), their corners; all in m.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.detours import Detours
from pdmesh.model.document import GridError
from pdmesh.model.neighbours import ROUND_OFF, Pairs, tree_of
from pdmesh.model.node_grid import Bodies, Grid
from pdmesh.model.triangulated_surface import Screen, distances, facing, meets, normals

if TYPE_CHECKING:
    import shapely
    from scipy.spatial import cKDTree

AT_ONCE = 1 << 18  # pairs times triangles that are looked at together
TOUCH = 1e-9  # of a triangle's size: corners this near are one
SHORT = 1e-4  # of a leg that ends on the front: that much is not looked at
Array = NDArray[np.float64]
SLACK = 1e-6  # of a spacing: a bond along an edge does not leave the plate, one at the tip of a crack is cut
LOOKS = 24  # places along a bond where the nodes are asked whether it is inside the plate
COVERED = 0.75  # spacings from the nearest node; the middle of a square of nodes is 0.707 away from them
CONVEX = 1e-9  # of its area: a plate this little smaller than its hull has no void that a bond could cross


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


class BondObstacles(Protocol):
    """Edges, holes and cracks between the nodes of a grid."""

    @property
    def clear(self) -> bool:
        """Whether it is known that nothing separates any pair."""

    def near(self, far: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes with a pair of length `far`, m, that something may separate."""

    def inside(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs whose segment stays in the plate or the body."""

    def cut(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs that a pre-crack separates."""

    def apart(self, pairs: Pairs, gamma: float | None, farthest: float) -> NDArray[np.float64]:
        """Distances (b,), m, that determine the influence of pairs on each other; see `Sight.apart`."""


def sight_of(grid: Grid, name: str = "grid") -> BondObstacles:
    """The obstacles of the grid called `name`. Raises GridError for an invalid outline."""
    return Sight(grid, name) if grid.dimension == 2 else SightInSpace(grid)


class SightInSpace:
    """Obstacles between the nodes of a body: its surface if it is not convex, and the triangles of its cracks."""

    def __init__(self, grid: Grid) -> None:
        self._position, self._delta, self._faces = grid.position, grid.delta, grid.faces
        self._triangles = grid.cracks.reshape(-1, 3, 3)
        every = facing(grid.faces), self._triangles
        self._surface, self._cracks = (Screen(triangles, grid.position, grid.delta) for triangles in every)
        self._convex, self._bodies = not len(every[0]), grid.bodies

    @property
    def clear(self) -> bool:
        """Whether nothing separates any pair: the body is convex and has no crack."""
        return self._convex and not len(self._triangles) and self._bodies is None

    def near(self, far: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes with a pair of length `far`, m, that something may separate."""
        far *= 1 + ROUND_OFF
        mask = np.asarray(self._surface.near(far) | self._cracks.near(far))
        number = np.zeros(len(mask), dtype=np.int64) if self._bodies is None else self._bodies.number
        for body_number in range(1, int(number.max(initial=0)) + 1):
            in_body = number == body_number
            for side, others in ((in_body, ~in_body), (~in_body, in_body)):
                distance, _ = tree_of(self._position[side]).query(self._position[others], distance_upper_bound=far)
                mask[np.flatnonzero(others)[np.isfinite(distance)]] = True
        return mask

    def inside(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of one body whose segment does not touch the surface."""
        return ~_parted(self._bodies, pairs) & ~self._surface.met(pairs)

    def cut(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs that a pre-crack separates; touching its edge counts."""
        return self._cracks.met(pairs)

    def apart(self, pairs: Pairs, gamma: float | None, farthest: float) -> NDArray[np.float64]:
        """Distances (b,), m, that determine the influence of pairs: straight, or twice `farthest` across a crack.

        With a `gamma` it is ((s1 + s2) / s0)^gamma s0 if that is less, where s0 is the straight distance and s1 + s2
        the shortest path round the crack's edge.
        """
        cut = self.cut(pairs)
        distance = np.where(cut, 2 * farthest, pairs.length)
        if gamma is not None and cut.any():
            a, b = (self._position[nodes[cut]] for nodes in (pairs.source, pairs.target))
            distance[cut] = apart(a, b, self._triangles, self._front, gamma, farthest)
        return distance

    @cached_property
    def _front(self) -> NDArray[np.float64]:
        """The edges (e, 2, 3) of cracks that are inside the body."""
        edges = front(self._triangles)
        smallest = float(self._delta.min())
        return edges[distances(edges.mean(axis=1), self._faces, smallest) > SLACK * smallest]


class Sight:
    """Obstacles between the nodes of the plate called `name`. Raises GridError for an invalid outline."""

    def __init__(self, grid: Grid, name: str = "grid") -> None:
        self._grid = grid
        self._cracks = cracks_of(grid) if len(grid.cracks) else None
        self._void = _void_around(plate_of(grid, name), grid)
        if self._cracks is not None or self._void is not None:
            import shapely

            shapely.prepare([self._cracks, self._void])

    @property
    def clear(self) -> bool:
        """Whether nothing separates any pair: the plate is convex and has no crack."""
        void, grid = self._void, self._grid
        nothing = not (grid.border.any() or (grid.hole_id >= 0).any()) if void is None else bool(void.is_empty)
        return nothing and self._cracks is None and grid.bodies is None

    @cached_property
    def _tree(self) -> cKDTree:
        return tree_of(self._grid.position)

    def near(self, far: float) -> NDArray[np.bool_]:
        """Mask (n,) of nodes with a pair that something may separate: all, unless nothing does."""
        return np.full(len(self._grid), not self.clear)

    def inside(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of one body whose segment neither leaves the outline nor meets a hole.

        Without an outline, the nodes define the plate: a bond of a node marked as border or as near a hole must not
        pass through a place that no node's cell covers.
        """
        grid, parted = self._grid, _parted(self._grid.bodies, pairs)
        if self._void is not None:
            return ~(parted | self._meet(pairs, self._void))
        marked = grid.border | (grid.hole_id >= 0)
        candidates = np.flatnonzero(marked[pairs.source] | marked[pairs.target])
        if len(candidates):
            i, j = np.sort(np.column_stack([pairs.source[candidates], pairs.target[candidates]]), axis=1).T
            widest = np.maximum(grid.delta[i], grid.delta[j])
            for share in np.linspace(0, 1, LOOKS + 2)[1:-1]:
                distance, _ = self._tree.query(grid.position[i] + share * (grid.position[j] - grid.position[i]))
                parted[candidates] |= distance > COVERED * widest
        return ~parted

    def parted(self, pairs: Pairs, segments: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (b,) of pairs that the segments (k, 4) of a crack separate; segments are extended by a slack at both
        ends."""
        if not len(segments):
            return np.zeros(len(pairs.source), dtype=bool)
        return self._meet(pairs, _lengthened(segments.reshape(-1, 2, 2), SLACK * float(self._grid.delta.min())))

    def cut(self, pairs: Pairs) -> NDArray[np.bool_]:
        """Mask (b,) of pairs that a pre-crack separates; touching its tip counts, independently of round-off."""
        return np.zeros(len(pairs.source), dtype=bool) if self._cracks is None else self._meet(pairs, self._cracks)

    def apart(self, pairs: Pairs, gamma: float | None, farthest: float) -> NDArray[np.float64]:
        """Distances (b,), m, that determine the influence of pairs: straight, or twice `farthest` across a crack.

        With a `gamma`, the distance across a crack is ((s1 + s2) / s0)^gamma s0 if that is less, where s0 is the
        straight distance and s1 + s2 the shortest path round the tips. (i, j) and (j, i) give the same.
        """
        cut = self.cut(pairs)
        distance = np.where(cut, 2 * farthest, pairs.length)
        which = np.flatnonzero(cut)
        if gamma is None or not len(which):
            return distance
        slack = SLACK * float(self._grid.delta.min())
        segments = self._grid.cracks.reshape(-1, 2, 2)
        detours = Detours(segments, slack, farthest * (1 + ROUND_OFF), self._inside_the_plate, self._void)
        ends = np.sort(np.column_stack([pairs.source[which], pairs.target[which]]), axis=1)
        rows, number = np.unique(ends, return_inverse=True)
        way = detours.around(self._grid.position[rows], *number.reshape(-1, 2).T)
        straight = pairs.length[which]
        with np.errstate(over="ignore"):
            distance[which] = np.minimum(np.maximum(way / straight, 1) ** gamma * straight, 2 * farthest)
        return distance

    def _inside_the_plate(self, places: NDArray[np.float64], headings: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (v,) of places (v, 2) inside the plate, at which cracks end or bend.

        Without an outline, a crack that ends within three quarters of a spacing of the last nodes ends on the edge.
        """
        import shapely

        plate, smallest = plate_of(self._grid), float(self._grid.delta.min())
        if plate is not None:
            edge = shapely.distance(plate.boundary, shapely.points(places))
            return np.asarray(shapely.intersects_xy(plate, places) & (edge > SLACK * smallest))
        distance, near = self._tree.query(places + smallest / 2 * headings)
        return np.asarray(distance <= COVERED * self._grid.delta[near])

    def _meet(self, pairs: Pairs, obstacle: shapely.Geometry) -> NDArray[np.bool_]:
        """Mask (b,) of pairs whose segment meets the obstacle; (i, j) and (j, i) give the same answer."""
        import shapely

        met = np.zeros(len(pairs.source), dtype=bool)
        if obstacle.is_empty or not len(met):
            return met
        position, farthest = self._grid.position, pairs.length.max() * (1 + ROUND_OFF)
        starts = np.flatnonzero(np.diff(pairs.source, prepend=-1))
        near = shapely.dwithin(obstacle, shapely.points(position[pairs.source[starts]]), farthest)
        candidates = np.flatnonzero(np.repeat(near, np.diff(starts, append=len(met))))
        ends = np.sort(np.column_stack([pairs.source[candidates], pairs.target[candidates]]), axis=1)
        met[candidates] = shapely.intersects(obstacle, shapely.linestrings(position[ends]))
        return met


def _parted(bodies: Bodies | None, pairs: Pairs) -> NDArray[np.bool_]:
    """Mask (b,) of pairs of different bodies."""
    return np.zeros(len(pairs.source), dtype=bool) if bodies is None else bodies.parted(pairs.source, pairs.target)


def cracks_of(grid: Grid) -> shapely.Geometry:
    """Pre-cracks of a grid as lines, slightly extended so that they cross the edges they end on."""
    return _lengthened(grid.cracks.reshape(-1, 2, 2), SLACK * float(grid.delta.min()))


def _lengthened(segments: NDArray[np.float64], by: float) -> shapely.Geometry:
    """Segments (k, 2, 2) as lines, extended by `by` m at both ends."""
    import shapely

    way = np.diff(segments, axis=1)
    length = np.hypot(way[..., :1], way[..., 1:])
    longer = by * way / np.where(length > 0, length, 1.0)
    return shapely.multilinestrings(segments + longer * np.array([[-1.0], [1.0]]))


def plate_of(grid: Grid, name: str = "grid") -> shapely.Geometry | None:
    """The plate that a grid's outline and holes describe; None without an outline.

    Raises GridError, beginning with `name`, for a ring that crosses itself or has no inside.
    """
    if not grid.outline:
        return None
    import shapely

    rings: dict[str, list[shapely.Polygon]] = {}
    for key, corners in (("outline", grid.outline), ("holes", grid.holes)):
        rings[key] = [shapely.Polygon(ring) for ring in corners]
        for number, ring in enumerate(rings[key]):
            if not ring.is_valid or not ring.area > 0:
                reason = shapely.is_valid_reason(ring) if not ring.is_valid else "no inside"
                raise GridError(f"{name}: $.{key}[{number}]: {reason}; use a ring that does not cross itself")
    holes = np.array(rings["holes"])
    return shapely.union_all(  # a part of the plate may be in a hole of another
        [part.difference(shapely.union_all(holes[~shapely.contains(holes, part)])) for part in rings["outline"]]
    )


def _void_around(plate: shapely.Geometry | None, grid: Grid) -> shapely.Geometry | None:
    """The region outside the plate within reach of bonds; empty if no bond gets there, None for a plate without
    outline."""
    if plate is None:
        return None
    import shapely

    slack = SLACK * float(grid.delta.min())
    if plate.convex_hull.area - plate.area < CONVEX * plate.area:
        inside = plate.buffer(slack, join_style="mitre")
        shapely.prepare(inside)
        if shapely.contains_xy(inside, grid.position).all():
            return shapely.Polygon()
    around = shapely.box(*plate.bounds).buffer(float(grid.delta.max()))
    return around.difference(plate).buffer(-slack, join_style="mitre")
