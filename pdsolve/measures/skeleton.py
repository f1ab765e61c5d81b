"""The centre lines of cracked nodes as a graph: points along each crack, linked from its origin to its ends.

The nodes of a crack are cut into slabs by their level, the distance along the crack. Each connected part of a slab
becomes a point, linked to the parts it touches in the slabs before and after (A. Verroust, F. Lazarus, The Visual
Computer 16 (2000) 15-25). This follows cracks that turn, fork and meet, without a given direction. Short ends are the
rough edge of the crack and are removed; several of equal length are removed together. Short ways between the same two
points are merged. Symmetric input therefore gives a symmetric graph.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pdsolve.measures.crack_labels import SHORTEST, CrackedNodes
from pdsolve.measures.cracked_nodes import ROUND_OFF

SLAB = 2.0  # local spacings, along the crack

Chain = list[int]  # numbers of parts from joint to joint, away from where the crack began


class CrackSkeleton:
    """Parts of slabs and their links; a removed part has no links."""

    def __init__(self, cracked: CrackedNodes) -> None:
        mine = np.flatnonzero(cracked.crack_number >= 0)
        self.level = cracked.spacings_from_origin
        slab = np.floor((cracked.spacings_from_origin[mine] + ROUND_OFF) / SLAB).astype(np.int64)
        crack = cracked.crack_number[mine]
        links = cracked.touching_distances[mine][:, mine].tocoo()
        node, neighbour = links.coords
        of_one_crack = crack[node] == crack[neighbour]
        inside, across = (of_one_crack & (np.abs(slab[node] - slab[neighbour]) == apart) for apart in (0, 1))
        same = coo_array((np.ones(int(inside.sum())), (node[inside], neighbour[inside])), links.shape)
        count, part = connected_components(same, directed=False) if len(mine) else (0, mine)
        order = np.argsort(part, kind="stable")
        groups = np.split(mine[order], np.cumsum(np.bincount(part, minlength=count))[:-1]) if count else []
        self.members: list[NDArray[np.int64]] = groups  # rows of the cracked nodes
        self.slab: list[int] = slab[order[np.searchsorted(part[order], np.arange(count))]].tolist()
        self.begins = {at for at, group in enumerate(groups) if self.level[group].min() == 0}
        self.links: list[set[int]] = [set() for _ in groups]
        for a, b in zip(part[node[across]].tolist(), part[neighbour[across]].tolist(), strict=True):
            self.links[a].add(b)

    def find_chains_between_joints(self) -> list[Chain]:
        """All parts as chains from joint to joint; joints are where cracks begin, end, fork and meet."""
        joints = {
            at
            for at, links in enumerate(self.links)
            if links and (at in self.begins or len(links) != 2 or len(self._linked_parts_further_from_origin(at)) != 1)
        }
        chains = []
        for joint in sorted(joints):
            for following in sorted(self._linked_parts_further_from_origin(joint)):
                chain = [joint, following]
                while chain[-1] not in joints:
                    chain += self._linked_parts_further_from_origin(chain[-1])
                chains.append(chain)
        return chains

    def is_dead_end(self, part: int) -> bool:
        """Whether a crack ends at a part without meeting another."""
        return len(self.links[part]) == 1 and part not in self.begins

    def remove_short_chains(self) -> None:
        """Remove short ends, merge short ways between the same joints, and drop cracks that are short as a whole.

        The shortest go first. Of those that share a joint, one length is removed at a time, as the rest may then be
        part of a longer chain.
        """
        while short := sorted(self._find_removable_short_chains()):
            touched: dict[int, float] = {}
            for length, chain, way in short:
                ends = chain[0], chain[-1]
                if any(abs(touched.get(end, length) - length) > ROUND_OFF for end in ends):
                    continue
                touched |= dict.fromkeys(ends, length)
                self._unlink_chain(chain)
                if way:  # where its nodes go, slab by slab
                    for part, into in zip(chain[1:-1], way[1:-1], strict=True):
                        self.members[into] = np.concatenate([self.members[into], self.members[part]])
        for chain in self.find_chains_between_joints():
            if (
                len(self.links[chain[0]]) == 1
                and self.is_dead_end(chain[-1])
                and self._length_in_spacings(chain) < SHORTEST
            ):
                self._unlink_chain(chain)

    def _linked_parts_further_from_origin(self, part: int) -> list[int]:
        """The parts that follow one, away from the crack's origin."""
        return [neighbour for neighbour in self.links[part] if self.slab[neighbour] > self.slab[part]]

    def _length_in_spacings(self, chain: Chain) -> float:
        """Length of a chain in spacings, up to its last node if it ends there."""
        last = self.level[self.members[chain[-1]]]
        first = 0.0 if chain[0] in self.begins else float(self.level[self.members[chain[0]]].mean())
        return float(last.max() if self.is_dead_end(chain[-1]) else last.mean()) - first

    def _find_removable_short_chains(self) -> Iterator[tuple[float, Chain, Chain]]:
        """Pairs of a short chain and itself if it is a dead end, or another chain that joins the same two joints."""
        ways: dict[tuple[int, int], Chain] = {}
        for chain in self.find_chains_between_joints():
            length, way = self._length_in_spacings(chain), (chain[0], chain[-1])
            loose = self.is_dead_end(chain[-1]) and len(self.links[chain[0]]) > 1
            if length < SHORTEST and (loose or way in ways):
                yield length, chain, ways.get(way, [])
            ways.setdefault(way, chain)

    def _unlink_chain(self, chain: Chain) -> None:
        for part, next_part in pairwise(chain):
            self.links[part].discard(next_part)
            self.links[next_part].discard(part)
