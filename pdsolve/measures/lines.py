"""A field along a straight line: linear between bonded nodes, elsewhere that of the nearest node."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from pdsolve.measures import fields
from pdsolve.measures.crack_faces import NEAR
from pdsolve.measures.plate_geometry import read_plate_geometry
from pdsolve.measures.strain import families_without_broken_bonds
from pdsolve.results import Nodes, Results, ResultsError

AROUND = 3.0  # of the coarsest spacing: nodes further from the line do not count
PER_SPACING = 2  # points for the finest spacing
MOST = 5000  # points
LONGEST = 10.0  # of the part's diagonal: a longer line has been meant in other units
SHEARED = np.array([[1.0, 2e-3, 3e-3], [0.0, 1.0, 5e-3], [0.0, 0.0, 1.0]])  # a cubic lattice, so that no eight nodes
# are on one sphere, of which Delaunay's tetrahedra would be any


class FieldAlongLine(NamedTuple):
    """A field at k places of a line."""

    points: NDArray[np.float64]  # (k, d) m
    distance_from_start: NDArray[np.float64]  # (k,) m, from the start
    component_values: dict[str, NDArray[np.float64]]  # (k,) each, SI; a scalar's under ""; NaN where there is none


def sample_field_along_line(
    results: Results, field_name: str, step: int, start: tuple[float, ...], end: tuple[float, ...]
) -> FieldAlongLine:
    """All components of the field `field_name` after `step`, at two places a spacing from `start` to `end`, m.

    A value is linear in the triangle of three nodes (in a body the tetrahedron of four) that are all bonded to each
    other. Where bonds are cut or broken, and at the edge, it is that of the nearest node. It is NaN off the plate or
    the body and where the nearest node's value is unreliable (see `fields.find_unreliable_nodes`). Raises ResultsError
    for ends of another dimension, a line without length, outside or far longer than the part, and for a frame without
    the field.
    """
    for word, place in (("--from", start), ("--to", end)):
        if len(place) != results.dimension:
            raise ResultsError(f"{word} has {len(place)} numbers; use {results.dimension}, a place in m")
    ends = np.array([start, end], dtype=float)
    length = float(np.sqrt(((ends[1] - ends[0]) ** 2).sum()))
    if not length > 0:
        raise ResultsError(f"--to is {_format_coordinates(end)}, where the line begins; use another place")
    nodes = results.nodes(step)
    size = float(np.linalg.norm(np.ptp(nodes.position, axis=0)))
    if length > LONGEST * size:
        raise ResultsError(
            f"the line from {_format_coordinates(start)} to {_format_coordinates(end)} is {length:g} m long,"
            f" and the part {size:.3g} m; use some of {_format_coordinates(_bounding_box(results, nodes))} (m),"
            " or write units such as 20mm"
        )
    from_start, way = nodes.position - ends[0], ends[1] - ends[0]
    foot = (from_start @ way / (way @ way)).clip(0, 1)  # on the line, of each node
    distance = np.sqrt(((from_start - foot[:, None] * way) ** 2).sum(axis=1))
    rows = np.flatnonzero(distance <= AROUND * nodes.delta.max())
    count = min(int(np.ceil(PER_SPACING * length / nodes.delta[rows].min(initial=length))) + 1, MOST)
    share = np.linspace(0, 1, max(count, 2))
    places = ends[0] + share[:, None] * way
    if results.dimension == 3:  # in the cube of the nearest node
        away, nearest = cKDTree(nodes.position).query(places, p=np.inf)
        on = away <= (0.5 + NEAR) * nodes.delta[nearest]
    else:
        slack = 1e-6 * float(nodes.delta.min())
        on = shapely.dwithin(read_plate_geometry(results).plate_shape, shapely.points(places), slack)
    if not len(rows) or not on.any():
        raise ResultsError(
            f"{results.name}: no place from {_format_coordinates(start)} to {_format_coordinates(end)} is in the"
            f" {'body' if results.dimension == 3 else 'plate'}; use some of"
            f" {_format_coordinates(_bounding_box(results, nodes))}"
        )
    node_values = fields.all_field_components(results, field_name, step)
    silent = fields.find_unreliable_nodes(results, field_name, step)[rows]
    corners, weights = _interpolation_rows_and_weights(results, nodes, rows, places, step)
    line_values = {}
    for part, values in node_values.items():
        row_values = np.where(silent, np.nan, values[rows])
        at = np.einsum("kc,kc->k", row_values[corners], weights)
        nearest = row_values[corners[np.arange(len(corners)), weights.argmax(axis=1)]]
        line_values[part] = np.where(on, np.where(np.isfinite(at), at, nearest), np.nan)
    return FieldAlongLine(places, share * length, line_values)


def _format_coordinates(numbers: Iterable[float]) -> str:
    return ",".join(f"{number:g}" for number in numbers)


def _bounding_box(results: Results, nodes: Nodes) -> tuple[float, ...]:
    """The corners of the box around a plate or around the cubes of a body, m."""
    if results.dimension == 2:
        return tuple(map(float, read_plate_geometry(results).plate_shape.bounds))
    half = nodes.delta[:, None] / 2
    return (*(nodes.position - half).min(axis=0).tolist(), *(nodes.position + half).max(axis=0).tolist())


def _interpolation_rows_and_weights(
    results: Results, nodes: Nodes, rows: NDArray[np.int64], places: NDArray[np.float64], step: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each place, d + 1 indices into `rows` (k, d + 1) and their weights (k, d + 1)."""
    unit, origin = float(nodes.delta.min()), nodes.position[rows].mean(axis=0)
    points, targets = (nodes.position[rows] - origin) / unit, (places - origin) / unit
    nearest, d = cKDTree(points).query(targets)[1], results.dimension
    corners, weights = np.repeat(nearest[:, None], d + 1, axis=1), np.tile([1.0] + d * [0.0], (len(places), 1))
    if d == 3:
        points, targets = points @ SHEARED, targets @ SHEARED
    try:
        mesh = Delaunay(points)
    except (QhullError, ValueError):  # fewer than d + 1, or all on a line or a plane
        return corners, weights
    simplex = mesh.find_simplex(targets)
    inside = np.flatnonzero(simplex >= 0)
    simplex_corners = mesh.simplices[simplex[inside]]
    start, neighbour = families_without_broken_bonds(results, results.families(step), step)
    count, corner_rows = len(nodes.ids), rows[simplex_corners]
    keys = np.repeat(np.arange(count), np.diff(start)) * count + neighbour  # rising but for neighbours' order
    bonded = np.ones(len(inside), dtype=bool)  # all corners to each other
    for one, other in combinations(corner_rows.T, 2):
        bonded &= np.isin(one * count + other, keys)
    inside, simplex_corners = inside[bonded], simplex_corners[bonded]
    turn = mesh.transform[simplex[inside]]
    first = np.einsum("kab,kb->ka", turn[:, :d], targets[inside] - turn[:, d])
    corners[inside] = simplex_corners
    weights[inside] = np.column_stack([first, 1 - first.sum(axis=1)])
    return corners, weights
