"""The front of cracks in a body: where their surface ends in the solid, and how fast it went over each face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from pdpost.measures.crack_faces import CrackSurface

AROUND = 4.0  # face sizes: how far faces are that a speed is fitted to
FEWEST = 12  # faces that a speed is fitted to
FLAT = 0.1  # of the widest scatter of faces: across the surface times have no slope
KNOWN = 0.5  # share of the scatter of times that a plane must explain

Polyline = NDArray[np.float64]  # (k, 3) m


def front_edges_at(cracks: CrackSurface, time: float) -> NDArray[np.int64]:
    """The edges (k,) inside the body where the surface that is open at `time`, s, ends."""
    open_now = cracks.opening_time <= time
    uses = np.bincount(cracks.face_edges[open_now].ravel(), minlength=len(cracks.edge_corners))
    return np.flatnonzero((uses == 1) & cracks.edge_is_inside_body)


def front_lines_at(cracks: CrackSurface, time: float) -> list[Polyline]:
    """The front at `time`, s, as lines; the longest first, closed ones end where they begin."""
    edges = cracks.edge_corners[front_edges_at(cracks, time)]
    lines = [cracks.corners[chain] for chain in chain_edges(edges)]
    return sorted(lines, key=lambda line: -line_length(line))


def line_length(line: Polyline) -> float:
    """The length of a line, m."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def chain_edges(edges: NDArray[np.int64]) -> list[list[int]]:
    """Edges (k, 2) between corners as chains of corners; each edge is in one, chains end where not two edges meet."""
    at: dict[int, list[int]] = {}
    for number, ends in enumerate(edges.tolist()):
        for corner in ends:
            at.setdefault(corner, []).append(number)
    used, corner_chains = set(), []
    ends_first = sorted(at, key=lambda corner: (len(at[corner]) == 2, corner))
    for start in ends_first:
        for number in at[start]:
            if number in used:
                continue
            chain, end_corner, way = [start], start, number
            while True:
                used.add(way)
                first_corner, second_corner = edges[way].tolist()
                end_corner = second_corner if end_corner == first_corner else first_corner
                chain.append(end_corner)
                further = [edge for edge in at[end_corner] if edge not in used]
                if len(at[end_corner]) != 2 or not further:
                    break
                way = further[0]
            corner_chains.append(chain)
    return corner_chains


def estimate_front_speed_at_faces(cracks: CrackSurface) -> NDArray[np.float64]:
    """The speed (f,) at which the front went over each face, m/s: one over the slope of the opening times around it.

    NaN of pre-cracks, and where a plane through these times explains less than half of their scatter.
    """
    speed, new_faces = np.full(len(cracks.face_corners), np.nan), np.flatnonzero(cracks.face_opened_during_run)
    if len(new_faces) < FEWEST:
        return speed
    place, time = cracks.face_centres[new_faces], cracks.opening_time[new_faces]
    size = float(np.sqrt(np.median(cracks.face_area[new_faces])))
    near = cKDTree(place).query_pairs(AROUND * size, output_type="ndarray")
    face, neighbour = np.concatenate([near, near[:, ::-1]]).T
    face_numbers = np.arange(len(new_faces))
    graph = csr_array(
        (np.ones(2 * len(near) + len(face_numbers)), (np.r_[face, face_numbers], np.r_[neighbour, face_numbers])),
        shape=(len(face_numbers),) * 2,
    )
    count = graph.sum(axis=1)
    columns = np.column_stack([place, time])
    mean = (graph @ columns) / count[:, None]
    products = (columns[:, :, None] * columns[:, None, :]).reshape(-1, 16)
    scatter = (graph @ products / count[:, None]).reshape(-1, 4, 4) - mean[:, :, None] * mean[:, None, :]
    spread, late = scatter[:, :3, :3], scatter[:, :3, 3]
    values, axes = np.linalg.eigh(spread)
    flat = values <= FLAT * values[:, 2:]
    inverse = np.where(flat, 0.0, 1 / np.where(flat, 1.0, values))
    slope = np.einsum("fij,fj,fkj,fk->fi", axes, inverse, axes, late)
    explained = (slope * late).sum(axis=1)
    steepness = np.linalg.norm(slope, axis=1)
    sure = (count >= FEWEST) & (explained > KNOWN * scatter[:, 3, 3]) & (steepness > 0)
    speed[new_faces[sure]] = 1 / steepness[sure]
    return speed
