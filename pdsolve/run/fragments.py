"""Pieces of a plate or of a body whose nodes are on many ranks: each finds those of its own nodes, which are joined
where bonds go from one rank to another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.graphs import connected
from pdmesh.model.output_fields import CRACKED
from pdsolve.numerics.team import Team
from pdsolve.run.measures import PIECE, compute_node_damage
from pdsolve.run.subdomain import Subdomain


class LocalPieces(NamedTuple):
    """Pieces of a rank's own nodes, each by the row, among all nodes, of one of its nodes."""

    names: NDArray[np.int64]  # (p,)
    node_counts: NDArray[np.int64]  # (p,)
    joined: NDArray[np.int64]  # (2, k) pairs of pieces that a bond joins, the other one of another rank


def count_fragments(team: Team) -> int:
    """Number of pieces: connected components of intact bonds without cracked nodes, of at least a share of nodes."""
    local: list[LocalPieces] = team.everywhere(find_local_pieces)
    names = np.concatenate([pieces.names for pieces in local])
    joined, order = np.concatenate([pieces.joined for pieces in local], axis=1), np.argsort(names)
    component = connected(len(names), *order[np.searchsorted(names, joined, sorter=order)])
    nodes = np.bincount(component, weights=np.concatenate([pieces.node_counts for pieces in local]))
    return int((nodes > PIECE * team.subdomain.node_count).sum())


def find_local_pieces(team: Team) -> LocalPieces:
    """The pieces of own nodes."""
    subdomain: Subdomain = team.subdomain
    own, system, begin = subdomain.own, subdomain.system, subdomain.begin
    sound = compute_node_damage(system, subdomain.broken()) <= CRACKED
    source, target = system.operator.bonds(own.start, own.stop)
    inside = (target >= own.start) & (target < own.stop)
    sound_bonds = inside & sound[source] & sound[target]
    number = connected(own.stop - own.start, source[sound_bonds] - own.start, target[sound_bonds] - own.start)
    _, first, inverse, counts = np.unique(number, return_index=True, return_inverse=True, return_counts=True)
    names = first + begin + own.start
    if subdomain.part is None:
        return LocalPieces(names, counts, np.zeros((2, 0), dtype=np.int64))
    shared = np.zeros(
        (2, len(sound))
    )  # what others know of ghosts: the pieces that they are of, and whether they count
    shared[:, own] = names[inverse], sound[own]
    subdomain.part.ghosts.receive_values(shared)
    across = ~inside & sound[source] & (shared[1, target] > 0)
    joined = np.unique(shared[0, np.array([source, target])[:, across]].astype(np.int64), axis=1)
    return LocalPieces(names, counts, joined)
