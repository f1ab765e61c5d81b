"""A field along a straight line: linear between bonded nodes, elsewhere that of the nearest node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from pdpost.measures import fields
from pdpost.measures.plate_geometry import plate
from pdpost.measures.segments import distances
from pdpost.measures.strain import intact
from pdsolve.results import Nodes, Results, ResultsError

AROUND = 3.0  # of the coarsest spacing: nodes further from the line do not count
PER_SPACING = 2  # points for the finest spacing
MOST = 5000  # points


class Line(NamedTuple):
    """A field at k places of a line."""

    place: NDArray[np.float64]  # (k, 2) m
    along: NDArray[np.float64]  # (k,) m, from the start
    values: dict[str, NDArray[np.float64]]  # (k,) each, SI, by component, a scalar's under ""; NaN where there is none


def line(results: Results, name: str, step: int, start: tuple[float, float], end: tuple[float, float]) -> Line:
    """All components of the field `name` after `step`, at two places a spacing from `start` to `end`, m.

    A value is linear in the triangle of three nodes that are all bonded to each other. Where bonds are cut or broken,
    and at the edge of the plate, it is that of the nearest node. It is NaN off the plate and where the nearest node's
    value is unreliable (see `fields.torn`). Raises ResultsError for a line without length or outside the plate, and for
    a frame without the field.
    """
    ends = np.array([start, end], dtype=float)
    length = float(np.hypot(*(ends[1] - ends[0])))
    if not length > 0:
        raise ResultsError(f"--to: found {end[0]:g},{end[1]:g}, where the line begins, expected another place")
    nodes = results.nodes(step)
    rows = np.flatnonzero(distances(nodes.position, ends[:1], ends[1:]) <= AROUND * nodes.delta.max())
    count = min(int(np.ceil(PER_SPACING * length / nodes.delta[rows].min(initial=length))) + 1, MOST)
    share = np.linspace(0, 1, max(count, 2))
    places = ends[0] + share[:, None] * (ends[1] - ends[0])
    on = _on_plate(results, nodes, places)
    if not len(rows) or not on.any():
        x0, y0, x1, y1 = plate(results).shape.bounds
        raise ResultsError(
            f"{results.name}: found no place of the plate from {start[0]:g},{start[1]:g} to {end[0]:g},{end[1]:g},"
            f" expected some of {x0:g},{y0:g},{x1:g},{y1:g}"
        )
    known = fields.components(results, name, step)
    silent = fields.torn(results, name, step)[rows]
    corners, weights = _weights(results, nodes, rows, places, step)
    found = {}
    for part, values in known.items():
        own = np.where(silent, np.nan, values[rows])
        at = np.einsum("kc,kc->k", own[corners], weights)
        nearest = own[corners[np.arange(len(corners)), weights.argmax(axis=1)]]
        found[part] = np.where(on, np.where(np.isfinite(at), at, nearest), np.nan)
    return Line(places, share * length, found)


def _on_plate(results: Results, nodes: Nodes, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    slack = 1e-6 * float(nodes.delta.min())
    return np.asarray(shapely.dwithin(plate(results).shape, shapely.points(places), slack))


def _weights(
    results: Results, nodes: Nodes, rows: NDArray[np.int64], places: NDArray[np.float64], step: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each place, three indices into `rows` (k, 3) and their weights (k, 3)."""
    unit, origin = float(nodes.delta.min()), nodes.position[rows].mean(axis=0)
    points, targets = (nodes.position[rows] - origin) / unit, (places - origin) / unit
    nearest = cKDTree(points).query(targets)[1]
    corners, weights = np.repeat(nearest[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (len(places), 1))
    try:
        mesh = Delaunay(points)
    except (QhullError, ValueError):  # fewer than three, or all on a line
        return corners, weights
    simplex = mesh.find_simplex(targets)
    inside = np.flatnonzero(simplex >= 0)
    some = mesh.simplices[simplex[inside]]
    bonded = _bonded(results, rows, some, len(nodes.ids), step)
    inside, some = inside[bonded], some[bonded]
    turn = mesh.transform[simplex[inside]]
    first = np.einsum("kab,kb->ka", turn[:, :2], targets[inside] - turn[:, 2])
    corners[inside] = some
    weights[inside] = np.column_stack([first, 1 - first.sum(axis=1)])
    return corners, weights


def _bonded(
    results: Results, rows: NDArray[np.int64], corners: NDArray[np.int64], count: int, step: int
) -> NDArray[np.bool_]:
    """Whether the three nodes of each triangle (k, 3) are all bonded to each other after `step`."""
    start, neighbour = intact(results, results.families(step), step)
    keys = np.repeat(np.arange(count), np.diff(start)) * count + neighbour  # rising but for neighbours' order
    whole = np.ones(len(corners), dtype=bool)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        whole &= np.isin(rows[corners[:, one]] * count + rows[corners[:, other]], keys)
    return whole
