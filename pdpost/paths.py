"""The lines that cracks have drawn: one polyline a branch, their forks, and how far two sets of lines are apart.

A path is the skeleton of a cluster of cracked nodes. Their distance from where the crack began, along the crack, is
cut into slabs; each connected part of a slab becomes a point, the mean of its nodes weighted by damage, and is linked
to the parts of the next slab that it touches (A. Verroust, F. Lazarus, The Visual Computer 16 (2000) 15-25). That
follows cracks that turn, fork and meet, and does not ask for a direction. Nodes cracked from the start, by a
pre-crack, are left out: the path begins at the pre-crack's tip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from pdpost.cracks import CRACKED, DIRECTIONS, LINKED, ROUND_OFF, cracked_since, damage_at, tips
from pdsolve.results import Results

SLAB = 2.0  # local spacings, along the crack
SHORTEST = 5.0  # local spacings: shorter ends are the crack's rough edge, shorter clusters are crumbs
NEAR_TIP = 3.0  # spacings within which a path begins at the tip of a pre-crack
ARM = 10.0  # local spacings of an arm that its direction is measured over
LONG = 0.4  # of the longest: shorter branches are no main ones
SAMPLES = 2000  # points of a set of lines that distances are measured from

Polyline = NDArray[np.float64]  # (k, 2) m


class PathError(ValueError):
    """Paths that cannot be compared."""


@dataclass(frozen=True)
class Branch:
    """A crack from its beginning, or from a fork, to its end or to the next fork; k points."""

    points: Polyline  # (k, 2) m
    since: NDArray[np.float64]  # (k,) step in which the crack came past, a mean; -1 at the tip of a pre-crack
    along: NDArray[np.float64]  # (k,) length from the beginning of the crack, m, over its parents
    begin: int  # number of the joint it begins at
    end: int  # number of the joint it ends at

    @property
    def length(self) -> float:
        """Its own length, m."""
        return float(self.along[-1] - self.along[0])


@dataclass(frozen=True)
class Fork:
    """A place where a crack becomes several."""

    place: tuple[float, float]  # m
    step: int  # in which the crack came there
    angle: float  # degrees between the outer arms
    arms: tuple[float, ...]  # degrees of each arm from the direction the crack came with, to the left positive


@dataclass
class _Skeleton:
    """Points of all cracks and their links; p points."""

    points: list[NDArray[np.float64]]  # (p, 2) m
    since: list[float]  # (p,) as in Branch
    level: list[float]  # (p,) spacings along the crack from where it began
    links: list[set[int]]  # (p,) points each is linked to
    begins: set[int]  # points where cracks begin

    def add(
        self,
        position: NDArray[np.float64],
        weight: NDArray[np.float64],
        since: NDArray[np.int64],
        level: NDArray[np.float64],
    ) -> int:
        """A point in the middle of nodes; its number."""
        self.points.append(np.average(position, axis=0, weights=weight))
        layer = np.floor(level + ROUND_OFF)  # widen as they will, the crack came past with the first of each layer
        self.since.append(float(np.mean([since[layer == number].min() for number in np.unique(layer)])))
        self.level.append(float(level.mean()))
        return len(self.points) - 1

    def join(self, one: int, other: int) -> None:
        """Link two points, the second perhaps new."""
        while len(self.links) < len(self.points):
            self.links.append(set())
        self.links[one].add(other)
        self.links[other].add(one)

    def part(self, one: int, other: int) -> None:
        """Take a link away."""
        self.links[one].discard(other)
        self.links[other].discard(one)


def path(results: Results, step: int, threshold: float = CRACKED) -> list[Polyline]:
    """The path of the cracks after `step`, a polyline (k, 2), m, for each branch; the longest first."""
    return [branch.points for branch in branches(results, step, threshold)]


def branches(results: Results, step: int, threshold: float = CRACKED) -> list[Branch]:
    """All branches of the cracks after `step`, the longest first."""
    return _branches(_skeleton(results, step, threshold))


def forks(branches: Sequence[Branch], spacing: float) -> list[Fork]:
    """Where one of the `branches` ends and two or more begin, in the order of time; `spacing`, m, is of the nodes.

    Directions are those of straight lines through the 10 spacings next to the fork.
    """
    found = []
    for joint in sorted({branch.begin for branch in branches}):
        arms = [branch for branch in branches if branch.begin == joint]
        stems = [branch for branch in branches if branch.end == joint]
        if len(arms) < 2 or not stems:
            continue
        reach = ARM * spacing
        came = _heading(stems[0].points[::-1], reach) * -1
        ways = [_heading(arm.points, reach) for arm in arms]
        angles = sorted(float(np.degrees(np.arctan2(came[0] * w[1] - came[1] * w[0], came @ w))) for w in ways)
        place = arms[0].points[0]
        step = round(float(stems[0].since[-1]))
        found.append(Fork((float(place[0]), float(place[1])), step, angles[-1] - angles[0], tuple(angles)))
    return sorted(found, key=lambda fork: fork.step)


def distance(one: Sequence[Polyline], other: Sequence[Polyline]) -> tuple[float, float]:
    """How far two sets of lines are apart, m: the mean over the length of both, and the Hausdorff distance.

    The mean is that of the two means from one set to the nearest points of the other. Both are measured at some
    2000 points of each set. Raises PathError where one is empty.
    """
    if not one or not other:
        raise PathError("found no path of a crack, expected one in both runs")
    there, back = _from_to(one, other), _from_to(other, one)
    return (there[0] + back[0]) / 2, max(there[1], back[1])


def heading(lines: Sequence[Polyline]) -> str:
    """Where a crack runs: the name in `cracks.DIRECTIONS` that most of its length goes by; "right" without any.

    Lines shorter than 0.4 of the longest do not count; of directions within a tenth of each other it is the first.
    """
    way = np.array(list(DIRECTIONS.values()))
    lengths = np.zeros(len(way))
    sizes = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines]
    for line, size in zip(lines, sizes, strict=True):
        if size >= LONG * max(sizes):
            lengths[int((way @ (line[-1] - line[0])).argmax())] += size
    return list(DIRECTIONS)[int((lengths >= 0.9 * lengths.max()).argmax())]


def _from_to(lines: Sequence[Polyline], others: Sequence[Polyline]) -> tuple[float, float]:
    """Mean and largest distance of points of `lines` from the nearest points of `others`, m."""
    points, weight = _samples(lines)
    start = np.concatenate([line[:-1] if len(line) > 1 else line for line in others])
    end = np.concatenate([line[1:] if len(line) > 1 else line for line in others])
    way = end - start
    squared = np.maximum((way**2).sum(axis=1), 1e-300)
    nearest = np.empty(len(points))
    for at in range(0, len(points), 256):
        from_start = points[at : at + 256, None, :] - start
        share = ((from_start * way).sum(axis=2) / squared).clip(0, 1)
        nearest[at : at + 256] = np.hypot(*(from_start - share[..., None] * way).transpose(2, 0, 1)).min(axis=1)
    return float(np.average(nearest, weights=weight)), float(nearest.max())


def _samples(lines: Sequence[Polyline]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of lines, their corners among them, and the length that each stands for."""
    pieces = [np.hypot(*np.diff(line, axis=0).T) for line in lines]
    whole = sum(float(piece.sum()) for piece in pieces)
    if whole == 0:
        points = np.concatenate(list(lines))
        return points, np.ones(len(points))
    found, weights = [], []
    for line, lengths in zip(lines, pieces, strict=True):
        for start, end, length in zip(line[:-1], line[1:], lengths, strict=True):
            parts = max(1, int(np.ceil(SAMPLES * length / whole)))
            found.append(start + np.linspace(0, 1, parts + 1)[:, None] * (end - start))
            weight = np.full(parts + 1, length / parts)
            weight[[0, -1]] /= 2
            weights.append(weight)
    return np.concatenate(found), np.concatenate(weights)


def _heading(points: Polyline, reach: float) -> NDArray[np.float64]:
    """The unit vector that a line leaves its first point with, over `reach` (m) of it."""
    far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    near = points[far <= max(reach, far[1] * (1 + ROUND_OFF))]
    near = near[1:] if len(near) > 3 else near  # the fork itself lies between its arms
    _, _, axes = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)
    way: NDArray[np.float64] = axes[0] * (1.0 if axes[0] @ (near[-1] - near[0]) >= 0 else -1.0)
    return way


def _skeleton(results: Results, step: int, threshold: float) -> _Skeleton:
    """Slabs of cracked nodes as points; ends that are too short cut off, those that stay led to the last node."""
    nodes, since, damage = results.nodes(), cracked_since(results, threshold), damage_at(results, step)
    grown = np.flatnonzero((since > 0) & (since <= step))
    position, delta, when, weight = nodes.position[grown], nodes.delta[grown], since[grown], damage[grown]
    graph = _neighbours(position, delta)
    begins = _beginnings(graph, when)
    level = dijkstra(graph, indices=begins, min_only=True) if len(begins) else np.zeros(0)
    part, linked = _parts(graph, np.floor((level + ROUND_OFF) / SLAB).astype(np.int64))
    skeleton = _Skeleton([], [], [], linked, {int(number) for number in part[begins]})
    for members in _members(part, len(linked)):
        skeleton.add(position[members], weight[members], when[members], level[members])
    _prune(skeleton)
    for number, members in enumerate(_members(part, len(linked))):
        if len(linked[number]) == 1:  # an end: on to its last nodes
            far = -level[members] if number in skeleton.begins else level[members]
            if far.max() - far.mean() < 0.25:
                continue
            last = members[far >= far.max() - 0.5]
            new = skeleton.add(position[last], weight[last], when[last], level[last])
            skeleton.join(number, new)
            if number in skeleton.begins:
                skeleton.begins ^= {number, new}
    _reach_tips(skeleton, results.cracks(), float(nodes.delta.min()))
    return skeleton


def _neighbours(position: NDArray[np.float64], delta: NDArray[np.float64]) -> csr_matrix:
    """Nodes within 1.5 spacings of each other, and how many of their spacings they are apart."""
    size = len(position)
    if not size:
        return csr_matrix((0, 0))
    near = cKDTree(position).query_pairs((LINKED + ROUND_OFF) * float(delta.max()), output_type="ndarray")
    far = np.hypot(*(position[near[:, 0]] - position[near[:, 1]]).T)
    close = far <= (LINKED + ROUND_OFF) * delta[near].max(axis=1, initial=0.0)
    near, far = near[close], far[close] / delta[near[close]].mean(axis=1)
    return csr_matrix((np.tile(far, 2), (near.T.ravel(), near[:, ::-1].T.ravel())), (size, size))


def _beginnings(graph: csr_matrix, when: NDArray[np.int64]) -> NDArray[np.int64]:
    """The nodes at which the clusters begin: in each the one that cracked first, with those near it of that step."""
    if not len(when):
        return np.zeros(0, dtype=np.int64)
    cluster = connected_components(graph, directed=False)[1]
    order = np.lexsort((when, cluster))
    first = order[np.unique(cluster[order], return_index=True)[1]]
    near = dijkstra(graph, indices=first, min_only=True, limit=SLAB + ROUND_OFF)
    return np.flatnonzero(np.isfinite(near) & (when == when[first][cluster]))


def _parts(graph: csr_matrix, slab: NDArray[np.int64]) -> tuple[NDArray[np.int64], list[set[int]]]:
    """The connected part of a slab that each node belongs to, and the parts that each part touches."""
    links = graph.tocoo()
    inside = slab[links.row] == slab[links.col]
    same = coo_matrix((np.ones(int(inside.sum())), (links.row[inside], links.col[inside])), graph.shape)
    if not len(slab):
        return slab, []
    count, part = connected_components(same, directed=False)
    linked: list[set[int]] = [set() for _ in range(count)]
    for a, b in zip(part[links.row[~inside]].tolist(), part[links.col[~inside]].tolist(), strict=True):
        linked[a].add(b)
    return part.astype(np.int64), linked


def _members(part: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    """The nodes of each part."""
    order = np.argsort(part, kind="stable")
    return np.split(order, np.cumsum(np.bincount(part, minlength=count))[:-1]) if count else []


def _prune(skeleton: _Skeleton) -> None:
    """Take off short ends, one of two short ways between the same joints, and clusters that are short as a whole.

    The shortest go first; of those that share a joint one at a time, as the rest may then be part of something longer.
    """
    while short := sorted(_short(skeleton)):
        touched: set[int] = set()
        for _, chain in short:
            if touched.isdisjoint((chain[0], chain[-1])):
                touched |= {chain[0], chain[-1]}
                for one, other in pairwise(chain):
                    skeleton.part(one, other)
    for chain in _chains(skeleton):
        alone = all(len(skeleton.links[end]) == 1 for end in (chain[0], chain[-1]))
        if alone and max(skeleton.level[number] for number in chain) < SHORTEST:
            for one, other in pairwise(chain):
                skeleton.part(one, other)


def _short(skeleton: _Skeleton) -> Iterator[tuple[float, list[int]]]:
    """Chains, with their lengths in spacings, that are too short and lead nowhere, or where another one leads too."""
    ways: set[tuple[int, int]] = set()
    for chain in _chains(skeleton):
        length = abs(skeleton.level[chain[-1]] - skeleton.level[chain[0]])
        ends = [end for end in (chain[0], chain[-1]) if len(skeleton.links[end]) == 1]
        loose = len(ends) == 1 and ends[0] not in skeleton.begins
        way = min(chain[0], chain[-1]), max(chain[0], chain[-1])
        if length < SHORTEST and (loose or way in ways):
            yield length, chain
        ways.add(way)


def _chains(skeleton: _Skeleton) -> list[list[int]]:
    """Points from joint to joint, from the lower level to the higher; joints begin, end or fork cracks."""
    links = skeleton.links
    joints = {at for at, linked in enumerate(links) if linked and (len(linked) != 2 or at in skeleton.begins)}
    found = []
    for joint in sorted(joints):
        for following in sorted(links[joint]):
            chain = [joint, following]
            while chain[-1] not in joints:
                chain.append(next(at for at in sorted(links[chain[-1]]) if at != chain[-2]))
            back = skeleton.level[chain[-1]], chain[-1], chain[-2]
            if (skeleton.level[joint], joint, following) <= back:
                found.append(chain)
    return found


def _reach_tips(skeleton: _Skeleton, cracks: NDArray[np.float64], spacing: float) -> None:
    """Lead cracks that begin or end near the tip of a pre-crack to that tip."""
    ends = [at for at, linked in enumerate(skeleton.links) if len(linked) == 1]
    for tip, _ in tips(cracks):
        if not ends:
            return
        far = np.hypot(*(np.array([skeleton.points[at] for at in ends]) - tip).T)
        nearest = ends[int(far.argmin())]
        if far.min() <= NEAR_TIP * spacing:
            there = skeleton.since[nearest]
            new = skeleton.add(tip[None], np.ones(1), np.array([-1]), np.array([skeleton.level[nearest]]))
            skeleton.join(nearest, new)
            ends.remove(nearest)
            if nearest in skeleton.begins:
                skeleton.begins ^= {nearest, new}
                skeleton.level[new] = -1.0
            else:
                skeleton.since[new] = there
                skeleton.level[new] += 1.0


def _branches(skeleton: _Skeleton) -> list[Branch]:
    """The chains as lines, each measured on from where its parent ends; the longest first."""
    chains = sorted(_chains(skeleton), key=lambda chain: (skeleton.level[chain[0]], chain))
    reached: dict[int, float] = {}
    found = []
    for chain in chains:
        points = np.array([skeleton.points[number] for number in chain])
        since = np.array([skeleton.since[number] for number in chain])
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        along += reached.get(chain[0], 0.0)
        reached.setdefault(chain[-1], float(along[-1]))
        found.append(Branch(points, since, along, chain[0], chain[-1]))
    return sorted(found, key=lambda branch: -branch.length)
