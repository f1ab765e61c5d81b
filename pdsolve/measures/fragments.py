"""Fragments: of a plate connected pieces of sound nodes, of a body nodes connected by neighbours that did not part."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected
from pdsolve.measures.crack_faces import FaceNeighbourPairs
from pdsolve.measures.cracked_nodes import cracked_damage_of, separation_at
from pdsolve.measures.cracks import PIECE, cluster_nodes
from pdsolve.measures.embedded_model import read
from pdsolve.measures.strain import constants_of_nodes
from pdsolve.results import Results

SMALLEST = 27  # nodes: less is a crumb


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
    body_count: int = 1  # bodies that touch: a whole one is a piece, too


def find_plate_fragments(results: Results, step: int, threshold: float | None = None) -> PlateFragments:
    """The fragments after `step`: sound nodes linked along rows and columns, as in `cracks.plate_is_split`."""
    nodes, threshold = results.nodes(step), cracked_damage_of(results, threshold)
    cracked = separation_at(results, step) > threshold
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
    cracked_area, bodies = float(nodes.area[cracked].sum()), 1 + len(read(results, _BodiesGridFileKeys).bodies)
    return PlateFragments(pieces, crumbs, small_pieces_area, cracked_area, bodies)


class _BodiesGridFileKeys(msgspec.Struct):
    """The key of the grid file that has the bodies beside the first one."""

    bodies: list[Any] = []


class BodyFragment(NamedTuple):
    """One fragment of a body."""

    node_count: int
    volume: float  # m^3
    mass: float  # kg
    centre: tuple[float, float, float]  # m, at the start
    velocity: tuple[float, float, float] | None  # m/s, of its centre of mass; None in a frame without velocities


class BodyFragments(NamedTuple):
    """All fragments. Their masses and that of the crumbs add up to the body's."""

    pieces: tuple[BodyFragment, ...]  # the heaviest first
    small_piece_count: int  # pieces of fewer than 27 nodes
    small_pieces_mass: float  # kg


def node_masses(results: Results, step: int) -> NDArray[np.float64]:
    """The mass (n,) of the nodes of a body, kg. Raises ResultsError."""
    of_nodes, _ = constants_of_nodes(results, step)
    return np.asarray(of_nodes("rho") * results.nodes(step).area)


def fragment_number_of_nodes(neighbour_pairs: FaceNeighbourPairs) -> NDArray[np.int64]:
    """The number (n,) of the piece that each node is in."""
    return connected(len(neighbour_pairs.node_is_uncracked), *neighbour_pairs.node_rows[~neighbour_pairs.is_opened].T)


def find_body_fragments(results: Results, step: int, neighbour_pairs: FaceNeighbourPairs) -> BodyFragments:
    """The fragments of a body after `step`, from the neighbours that parted."""
    nodes, mass = results.nodes(step), node_masses(results, step)
    piece = fragment_number_of_nodes(neighbour_pairs)
    count = np.bincount(piece)
    large = count >= SMALLEST
    names = ("vx", "vy", "vz")
    is_stored = set(names) <= set(results.stored(step) if step in results.frames()[0] else ())
    velocity = [results.field(name, step).astype(float) for name in names] if is_stored else []
    columns = np.column_stack([np.ones(len(mass)), nodes.position, *velocity])
    sums = np.column_stack([np.bincount(piece, mass * column) for column in columns.T])
    volume = np.bincount(piece, nodes.area)
    pieces = [
        BodyFragment(
            int(count[number]),
            float(volume[number]),
            float(sums[number, 0]),
            _mean_vector_from_mass_weighted_sums(sums[number], 1),
            _mean_vector_from_mass_weighted_sums(sums[number], 4) if velocity else None,
        )
        for number in np.flatnonzero(large)
    ]
    pieces.sort(key=lambda each: (-each.mass, each.centre))
    return BodyFragments(tuple(pieces), int((~large).sum()), float(sums[~large, 0].sum()))


def _mean_vector_from_mass_weighted_sums(sums: NDArray[np.float64], first_column: int) -> tuple[float, float, float]:
    """Three components of a mean, from sums weighted by mass."""
    x, y, z = (float(component) for component in sums[first_column : first_column + 3] / sums[0])
    return x, y, z
