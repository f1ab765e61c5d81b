"""Geometry of a plate for figures: its edges, its pre-cracks, and the clipped Voronoi cell of each node."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.document import Run
from pdsolve.measures.embedded_model import read
from pdsolve.results import Nodes, Results, ResultsError

CLOSED = 0.3  # of the coarsest spacing: gaps between nodes up to twice as wide are of a plate without an outline
ALIKE = 2.0  # of the larger spacing: how far the plates of two results of one scene may differ
MANY = 20_000  # nodes; more are not drawn one by one
FRACTIONS = 2**20  # of the finest spacing: what nodes are rounded to, so that a lattice stays one in floating point


Ring: TypeAlias = Annotated[list[tuple[float, float]], msgspec.Meta(min_length=3)]  # m


class PlateGeometry(NamedTuple):
    """What a figure shows of a model besides its nodes, m."""

    outline_and_holes: tuple[NDArray[np.float64], ...]  # (k, 2) each: outline and holes; none if the model has none
    pre_cracks: NDArray[np.float64]  # (k, 4) segments of pre-cracks
    plate_shape: shapely.Geometry  # all that is plate
    has_moving_zone: bool  # whether a zone of finer nodes moves
    has_splitting_cells: bool  # whether its cells split, so that there are zones within zones


class VoronoiCells(NamedTuple):
    """The cells of n nodes. The rings of a node are consecutive; a ring's last corner is its first."""

    corner_offsets: NDArray[np.float64]  # (c, 2) m, from their nodes
    is_last_of_ring: NDArray[np.bool_]  # (c,) whether a corner is the last of its ring
    node_rows: NDArray[np.int64]  # (c,) rows of the nodes, rising; a node outside the plate has no cell


class _OutlineGridFileKeys(msgspec.Struct):
    """The keys of the grid file that shape the plate."""

    outline: list[Ring] = []
    holes: list[Ring] = []
    run: Run = Run()


def read_plate_geometry(results: Results) -> PlateGeometry:
    """The plate of a run.

    Without an outline it is the union of its nodes' squares at the start, with gaps between spacings closed; for many
    nodes, their bounding box.
    """
    geometry = read(results, _OutlineGridFileKeys)
    edges = tuple(np.array(ring) for ring in (*geometry.outline, *geometry.holes))
    if edges:
        outer, holes = (
            shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in rings])
            for rings in (edges[: len(geometry.outline)], edges[len(geometry.outline) :])
        )
        shape = shapely.difference(outer, holes)
    else:
        nodes = results.nodes(0)
        half, reach = nodes.delta[:, None] / 2, CLOSED * float(nodes.delta.max())
        low, high = nodes.position - half, nodes.position + half
        if len(half) > MANY:
            shape = shapely.box(*low.min(axis=0), *high.max(axis=0))
        else:
            squares = shapely.union_all(shapely.box(*low.T, *high.T))
            shape = squares.buffer(reach, join_style="mitre").buffer(-reach, join_style="mitre")
    shapely.prepare(shape)
    return PlateGeometry(edges, results.cracks(), shape, geometry.run.adapt != "none", geometry.run.adapt == "split")


def expect_same_plate(results: Results, reference: Results) -> None:
    """Raise ResultsError if two plates differ by more than a strip of two of the larger spacings."""
    shape, expected = read_plate_geometry(results).plate_shape, read_plate_geometry(reference).plate_shape
    reach = ALIKE / 2 * max(float(run.nodes(0).delta.max()) for run in (results, reference))
    off = shapely.symmetric_difference(shape, expected).buffer(-reach)
    if off.is_empty:
        return
    x0, y0, x1, y1 = shape.bounds
    a0, b0, a1, b1 = expected.bounds
    place = shapely.point_on_surface(off)
    raise ResultsError(
        f"{results.name} is a plate from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m, and {reference.name} one from ({a0:g},"
        f" {b0:g}) to ({a1:g}, {b1:g}) m; compare runs of one plate (they differ at ({place.x:.4g}, {place.y:.4g})"
        " m)"
    )


def clipped_voronoi_cells(nodes: Nodes, plate_shape: shapely.Geometry) -> VoronoiCells:
    """The Voronoi cell of each node, clipped by `plate_shape`.

    Raises ResultsError for coincident nodes.
    """
    if not len(nodes.ids):
        return VoronoiCells(np.zeros((0, 2)), np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int64))
    unit, origin = float(nodes.delta.min()), nodes.position.min(axis=0)
    points = np.round((nodes.position - origin) / unit * FRACTIONS) / FRACTIONS
    around = shapely.transform(plate_shape, lambda corners: (corners - origin) / unit)
    frame = shapely.union(around.envelope, shapely.multipoints(points).envelope).envelope.buffer(4)
    try:
        polygons = shapely.voronoi_polygons(shapely.multipoints(points), extend_to=frame, ordered=True)
    except shapely.errors.GEOSException as error:
        raise ResultsError(f"nodes: some have no cell ({error}); move them apart") from None
    polygons = shapely.get_parts(polygons)
    shapely.prepare(around)
    outside = ~shapely.covers(around, polygons)
    polygons[outside] = shapely.intersection(shapely.make_valid(polygons[outside]), around)
    parts, node = shapely.get_parts(polygons, return_index=True)
    is_surface = shapely.get_dimensions(parts) == 2
    rings, ring_of = shapely.get_rings(shapely.orient_polygons(parts[is_surface]), return_index=True)
    corners, corner_of = shapely.get_coordinates(rings, return_index=True)
    owner = node[is_surface][ring_of][corner_of]
    closes = np.append(np.diff(corner_of) > 0, True)[: len(corners)]
    return VoronoiCells((corners - points[owner]) * unit, closes, owner)
