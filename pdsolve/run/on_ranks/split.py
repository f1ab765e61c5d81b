"""Pieces of a plate or of a body whose nodes are on many ranks: each finds those of its own nodes, which are joined
where bonds go from one rank to another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.graphs import connected
from pdmesh.model.output_fields import CRACKED
from pdsolve.numerics.team import Team
from pdsolve.ranks.part import Part, broken
from pdsolve.run.measures import PIECE, compute_node_damage
from pdsolve.run.on_ranks.start import RankSystem


def count_fragments_over_ranks(team: Team, node_count: int) -> int:
    """Number of pieces of all `node_count`; see `pdsolve.run.measures.count_fragments`."""
    pairs = np.concatenate(team.everywhere(find_fragment_pairs_bonded_across_ranks), axis=1)
    labels, ends = np.unique(pairs, return_inverse=True)
    counts, alone = zip(*team.everywhere(count_local_nodes_of_fragments, labels, PIECE * node_count), strict=True)
    component = connected(len(labels), *ends.reshape(2, -1)) if len(labels) else np.zeros(0, dtype=np.int64)
    joined = np.bincount(component, weights=np.sum(counts, axis=0)) if len(labels) else np.zeros(0)
    return int(sum(alone)) + int((joined > PIECE * node_count).sum())


def find_fragment_pairs_bonded_across_ranks(team: Team) -> NDArray[np.int64]:
    """The pairs (2, k) of pieces, by the row of a node in the whole grid, that a bond joins to one of another rank."""
    part: Part = team.part
    subdomain: RankSystem = part.now
    local_rows, nodes = part.own, len(part.model.grid)
    sound = compute_node_damage(subdomain.system, broken(part)) <= CRACKED
    source, target = part.operator.bonds(local_rows.start, local_rows.stop)
    inside = (target >= local_rows.start) & (target < local_rows.stop)
    sound_bonds = inside & sound[source] & sound[target]
    number = connected(
        local_rows.stop - local_rows.start,
        source[sound_bonds] - local_rows.start,
        target[sound_bonds] - local_rows.start,
    )
    subdomain.pieces = np.unique(number, return_index=True)[1][number] + part.slab.first
    shared = np.zeros((2, nodes))  # what others know of ghosts: the pieces that they are of, and whether they count
    shared[:, local_rows] = subdomain.pieces, sound[local_rows]
    part.ghosts.receive_values(shared)
    across = ~inside & sound[source] & (shared[1, target] > 0)
    return np.unique(shared[0, np.array([source, target])[:, across]].astype(np.int64), axis=1)


def count_local_nodes_of_fragments(
    team: Team, piece_labels: NDArray[np.int64], least_node_count: float
) -> tuple[NDArray[np.int64], int]:
    """How many own nodes each of these pieces (k,) has, and how many others have more nodes than the
    `least_node_count`."""
    subdomain: RankSystem = team.part.now
    names, counts = np.unique(subdomain.pieces, return_counts=True)
    node_counts = np.zeros(len(piece_labels), dtype=np.int64)
    has_label = np.isin(names, piece_labels)
    node_counts[np.searchsorted(piece_labels, names[has_label])] = counts[has_label]
    return node_counts, int((counts[~has_label] > least_node_count).sum())
