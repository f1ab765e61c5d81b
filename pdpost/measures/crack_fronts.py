"""The front of cracks in a body: where their surface ends in the solid, and how fast it went over each face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from pdpost.measures.crack_faces import Surface

AROUND = 4.0  # face sizes: how far faces are that a speed is fitted to
FEWEST = 12  # faces that a speed is fitted to
FLAT = 0.1  # of the widest scatter of faces: across the surface times have no slope
KNOWN = 0.5  # share of the scatter of times that a plane must explain

Polyline = NDArray[np.float64]  # (k, 3) m


def front_edges(found: Surface, time: float) -> NDArray[np.int64]:
    """The edges (k,) inside the body where the surface that is open at `time`, s, ends."""
    open_now = found.time <= time
    uses = np.bincount(found.sides[open_now].ravel(), minlength=len(found.edges))
    return np.flatnonzero((uses == 1) & found.inside)


def fronts(found: Surface, time: float) -> list[Polyline]:
    """The front at `time`, s, as lines; the longest first, closed ones end where they begin."""
    edges = found.edges[front_edges(found, time)]
    lines = [found.corners[chain] for chain in chains(edges)]
    return sorted(lines, key=lambda line: -length(line))


def length(line: Polyline) -> float:
    """The length of a line, m."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def chains(edges: NDArray[np.int64]) -> list[list[int]]:
    """Edges (k, 2) between corners as chains of corners; each edge is in one, chains end where not two edges meet."""
    at: dict[int, list[int]] = {}
    for number, ends in enumerate(edges.tolist()):
        for corner in ends:
            at.setdefault(corner, []).append(number)
    used, found = set(), []
    ends_first = sorted(at, key=lambda corner: (len(at[corner]) == 2, corner))
    for start in ends_first:
        for number in at[start]:
            if number in used:
                continue
            chain, here, way = [start], start, number
            while True:
                used.add(way)
                one, other = edges[way].tolist()
                here = other if here == one else one
                chain.append(here)
                further = [each for each in at[here] if each not in used]
                if len(at[here]) != 2 or not further:
                    break
                way = further[0]
            found.append(chain)
    return found


def speeds(found: Surface) -> NDArray[np.float64]:
    """The speed (f,) at which the front went over each face, m/s: one over the slope of the opening times around it.

    NaN of pre-cracks, and where a plane through these times explains less than half of their scatter.
    """
    speed, grown = np.full(len(found.faces), np.nan), np.flatnonzero(found.grown)
    if len(grown) < FEWEST:
        return speed
    place, time = found.middle[grown], found.time[grown]
    size = float(np.sqrt(np.median(found.area[grown])))
    near = cKDTree(place).query_pairs(AROUND * size, output_type="ndarray")
    one, other = np.concatenate([near, near[:, ::-1]]).T
    own = np.arange(len(grown))
    graph = csr_array((np.ones(2 * len(near) + len(own)), (np.r_[one, own], np.r_[other, own])), shape=(len(own),) * 2)
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
    speed[grown[sure]] = 1 / steepness[sure]
    return speed
