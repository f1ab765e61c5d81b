"""Fragments of a plate: connected pieces of sound nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracked_nodes import damage_with_pre_cracks_at
from pdpost.measures.cracks import PIECE, cluster_nodes
from pdsolve.results import Results


class PlateFragment(NamedTuple):
    """One fragment of the plate."""

    node_count: int
    area: float  # m^2
    centre: tuple[float, float]  # m


class PlateFragments(NamedTuple):
    """All fragments; their areas, that of the crumbs and the cracked area add up to the plate's."""

    pieces: tuple[PlateFragment, ...]  # the largest first
    small_piece_count: int  # pieces of no more than 2 per cent of the nodes
    small_pieces_area: float  # m^2
    cracked_area: float  # m^2, of the cracked nodes, which belong to no piece


def find_plate_fragments(results: Results, step: int, threshold: float = CRACKED) -> PlateFragments:
    """The fragments after `step`: sound nodes linked along rows and columns, as in `cracks.plate_is_split`."""
    nodes, cracked = results.nodes(step), damage_with_pre_cracks_at(results, step) > threshold
    sound = np.flatnonzero(~cracked)
    piece = cluster_nodes(nodes.position[sound], nodes.delta[sound], link_distance=1.0)
    fragment_list, crumbs, small_pieces_area = [], 0, 0.0
    for number in range(int(piece.max(initial=-1)) + 1):
        rows = sound[piece == number]
        area = nodes.area[rows]
        if len(rows) > PIECE * len(cracked):
            x, y = (float(np.average(places, weights=area)) for places in nodes.position[rows].T)
            fragment_list.append(PlateFragment(len(rows), float(area.sum()), (x, y)))
        else:
            crumbs, small_pieces_area = crumbs + 1, small_pieces_area + float(area.sum())
    pieces = tuple(sorted(fragment_list, key=lambda one: (-one.area, one.centre)))
    return PlateFragments(pieces, crumbs, small_pieces_area, float(nodes.area[cracked].sum()))
