"""The crack that each cracked node belongs to, and when that crack reached it, from the step each node cracked in.

Nodes are added in the order in which they cracked. A patch of touching nodes that grows to `SHORTEST` spacings is a
crack. A patch that meets a crack before it has grown so far is part of that crack: material that broke a little ahead
of it or beside it. Two cracks that meet stay two, as in the persistent homology of the basins of a function (H.
Edelsbrunner, J. Harer, Computational Topology, 2010, chapter VII). Then each crack spreads from its origin over the
nodes that touch it. A node takes the front that reaches it first, then the older of two cracks, then the shorter of two
ways. Nodes that crack in one step are added together, so that symmetric input gives symmetric labels.
"""

from __future__ import annotations

import heapq
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from pdsolve.measures.cracked_nodes import LINKED, ROUND_OFF, first_cracked_step_of_nodes, separation_at
from pdsolve.results import Results

ABREAST = 0.5  # local spacings: nodes no further apart along a crack are beside each other
SHORTEST = 5.0  # local spacings: shorter ends are the crack's rough edge, shorter patches are crumbs


class CrackedNodes(NamedTuple):
    """The c nodes that have cracked since the start, and the cracks they belong to."""

    position: NDArray[np.float64]  # (c, 2) m
    spacing: NDArray[np.float64]  # (c,) spacing, m
    damage_with_pre_cracks: NDArray[np.float64]  # (c,)
    crack_number: NDArray[np.int64]  # (c,) number of the crack; -1: none, a crumb
    crack_arrival_step: NDArray[np.int64]  # (c,) in which the crack came to the node, or joined it if it cracked ahead
    spacings_from_origin: NDArray[np.float64]  # (c,) spacings from where the crack began, along the way it came
    touching_distances: csr_array  # (c, c) spacings between nodes that touch


class _CrackOrigin(NamedTuple):
    """The origin of a crack."""

    first_cracked_step: int
    origin_nodes: list[int]


def label_cracked_nodes(results: Results, step: int, threshold: float | None = None) -> CrackedNodes:
    """The nodes cracked after `step`, without those cracked at the start, each assigned to a crack."""
    nodes, since = results.nodes(step), first_cracked_step_of_nodes(results, threshold, step)
    rows = np.flatnonzero((since > 0) & (since <= step))
    position, delta = nodes.position[rows], nodes.delta[rows]
    # a graph of the nodes within 1.5 times the larger spacing of each other, its weights distances in mean spacings
    near = cKDTree(position).query_pairs((LINKED + ROUND_OFF) * float(delta.max(initial=0.0)), output_type="ndarray")
    far = np.hypot(*(position[near[:, 0]] - position[near[:, 1]]).T)
    close = far <= (LINKED + ROUND_OFF) * delta[near].max(axis=1, initial=0.0)
    near, far = near[close], far[close] / delta[near[close]].mean(axis=1)
    ends = near.T.ravel(), near[:, ::-1].T.ravel()
    links = csr_array((np.tile(far, 2), ends), (len(rows), len(rows)))
    cracked_step = since[rows]
    patches = _NodePatchUnionFind(position, delta, cracked_step)
    roots = []
    # pairs of touching nodes, grouped by the step from which both are cracked
    touching = links.tocoo()
    once = touching.row < touching.col
    node, neighbour = touching.row[once], touching.col[once]
    both_cracked = np.maximum(cracked_step[node], cracked_step[neighbour])
    order = np.argsort(both_cracked, kind="stable")
    steps_and_pairs = zip(both_cracked[order].tolist(), node[order].tolist(), neighbour[order].tolist(), strict=True)
    for _, group in groupby(steps_and_pairs, key=lambda row: row[0]):
        apart = {
            (min(pair), max(pair))
            for _, a, b in group
            if len(pair := {patches.find_representative(a), patches.find_representative(b)}) > 1
        }
        for together in _connected_components_of_pairs(apart):
            root = patches.join_patches(together)
            if root is not None:
                roots.append(root)
    spread = _label_nodes_by_first_arriving_crack(
        links, cracked_step, sorted(roots, key=lambda root: (root.first_cracked_step, min(root.origin_nodes)))
    )
    return CrackedNodes(position, delta, separation_at(results, step)[rows], *spread, links)


class _NodePatchUnionFind:
    """A union-find of touching nodes, joined step by step; each patch is represented by one of its nodes."""

    def __init__(
        self, position: NDArray[np.float64], spacing: NDArray[np.float64], cracked_step: NDArray[np.int64]
    ) -> None:
        self.position, self.delta = position, spacing
        self.parent = list(range(len(cracked_step)))
        self.members = [[node] for node in self.parent]
        self.roots: list[_CrackOrigin | None] = [
            _CrackOrigin(step, [node]) for node, step in enumerate(cracked_step.tolist())
        ]

    def find_representative(self, node: int) -> int:
        """The representative node of a node's patch."""
        while self.parent[node] != node:
            self.parent[node] = self.parent[self.parent[node]]
            node = self.parent[node]
        return node

    def join_patches(self, patches: list[int]) -> _CrackOrigin | None:
        """Join several patches; returns the origin if the result becomes a crack. The root of a crack is None."""
        largest = max(patches, key=lambda patch: len(self.members[patch]))
        roots = [self.roots[patch] for patch in patches]
        for patch in patches:
            if patch != largest:
                self.parent[patch] = largest
                self.members[largest] += self.members[patch]
                self.members[patch] = []
        self.roots[largest] = None
        known_roots = [root for root in roots if root is not None]
        if len(known_roots) < len(roots):
            return None
        first = min(root.first_cracked_step for root in known_roots)
        began = _CrackOrigin(
            first, [node for root in known_roots if root.first_cracked_step == first for node in root.origin_nodes]
        )
        rows = self.members[largest]
        far = np.hypot(*(self.position[rows] - self.position[began.origin_nodes].mean(axis=0)).T)
        if (far >= SHORTEST * self.delta[rows]).any():
            # the nodes that cracked first or, if they are many, those furthest from the centre of the crack
            nodes = began.origin_nodes
            apart = np.hypot(*(self.position[nodes] - self.position[nodes].mean(axis=0)).T)
            if not (apart <= SHORTEST / 2 * self.delta[nodes]).all():
                off = np.hypot(*(self.position[nodes] - self.position[rows].mean(axis=0)).T)
                is_far = off >= off.max() - ABREAST * self.delta[nodes]
                nodes = [node for node, far in zip(nodes, is_far, strict=True) if far]
            return _CrackOrigin(first, nodes)
        self.roots[largest] = began
        return None


def _connected_components_of_pairs(pairs: set[tuple[int, int]]) -> list[list[int]]:
    """The parts of a small graph."""
    linked: dict[int, set[int]] = {}
    for first, second in pairs:
        linked.setdefault(first, set()).add(second)
        linked.setdefault(second, set()).add(first)
    parts = []
    while linked:
        part, ahead = [], {min(linked)}
        while ahead:
            at = ahead.pop()
            part.append(at)
            ahead |= linked.pop(at) & linked.keys()
        parts.append(sorted(part))
    return parts


def _label_nodes_by_first_arriving_crack(
    touching_distances: csr_array, cracked_step: NDArray[np.int64], origins: list[_CrackOrigin]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Let the cracks spread from their roots; returns crack, reached and level (c,) of `CrackedNodes`.

    Two cracks of equal age that meet in one step are one crack with two origins.
    """
    count = len(cracked_step)
    crack, reached, level = np.full(count, -1), np.full(count, -1), np.full(count, np.inf)
    same = list(range(len(origins)))  # the crack that each root's is a part of

    def find_merged_crack(number: int) -> int:
        while same[number] != number:
            number = same[number]
        return number

    def merge_cracks(first_crack: int, second_crack: int) -> None:
        older, younger = sorted((find_merged_crack(first_crack), find_merged_crack(second_crack)))
        same[younger] = older

    heap = [
        (int(cracked_step[node]), root.first_cracked_step, 0.0, node, at)
        for at, root in enumerate(origins)
        for node in root.origin_nodes
    ]
    heapq.heapify(heap)
    start, near, apart, cracked = (
        part.tolist()
        for part in (touching_distances.indptr, touching_distances.indices, touching_distances.data, cracked_step)
    )
    while heap:
        step, age, far, node, number = heapq.heappop(heap)
        if crack[node] >= 0:
            is_as_old = (reached[node], origins[crack[node]].first_cracked_step) == (step, age)
            if is_as_old and far - level[node] < ROUND_OFF:
                merge_cracks(int(crack[node]), number)
            continue
        crack[node], reached[node], level[node] = number, step, far
        for link in range(start[node], start[node + 1]):
            neighbour = near[link]
            its = int(crack[neighbour])
            if its < 0:
                heapq.heappush(heap, (max(step, cracked[neighbour]), age, far + apart[link], neighbour, number))
            elif (reached[neighbour], origins[its].first_cracked_step) == (step, age):
                merge_cracks(its, number)
    crack_of_root = np.array([*(find_merged_crack(at) for at in range(len(origins))), -1])
    return crack_of_root[crack], reached, level
