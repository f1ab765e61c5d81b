"""Nodes of a grid file as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.contradictions import LEAST
from pdmesh.model.document import (
    FORMAT_VERSION,
    LARGEST,
    SPACE_VERSION,
    Document,
    GridError,
    Lattice,
    Settings,
    Vector,
)
from pdmesh.model.grid_file_nodes import NodeColumns, columns_of
from pdmesh.model.material import Material
from pdmesh.model.mechanical_conditions import REST, BodyNodes
from pdmesh.model.node_arrays import Bodies as Bodies
from pdmesh.model.node_arrays import Grid as Grid
from pdmesh.model.node_fields import columns_of as field_columns_of
from pdmesh.model.node_fields import records_of as field_records_of
from pdmesh.model.whole_lattice import WholeLattice
from pdmesh.model.whole_lattice import places as places

MOST_NODES = 4 * 10**8  # of a lattice
MOST_CELLS = 16  # that a node stands for; those at holes and corners have up to 2.2


def _materials_of(document: Document) -> tuple[Material, ...]:
    """The materials of a document, or none."""
    regions = tuple(region.material for region in document.regions)
    return regions if document.material is None else (document.material, *regions)


def grid_of(document: Document, name: str) -> Grid:
    """The document's nodes as arrays. Raises GridError for what the types alone cannot exclude."""
    nodes = document.nodes
    if document.lattice is not None:
        return _grid_of_lattice(document, document.lattice, name)
    if not len(nodes):
        raise GridError(f"{name}: $.nodes is empty; give at least one")
    ids, position, delta = nodes.id, nodes.position, nodes.delta
    first, counts = np.unique(ids, return_counts=True)
    if counts.max() > 1:
        raise GridError(f"{name}: $.nodes: id {first[counts.argmax()]} is there {counts.max()} times; use it once")
    d = document.dimension
    try:
        bodies, field_columns = (
            bodies_of(document.bodies, ids),
            field_columns_of(document.fields, len(nodes), _materials_of(document)),
        )
    except ValueError as error:
        raise GridError(f"{name}: {error}") from None
    _check_nodes(name, position, delta, d)
    _check_shapes(name, document)
    if document.areas is not None:
        if len(document.areas) != len(nodes):
            raise GridError(f"{name}: $.areas has {len(document.areas)} values; give {len(nodes)}, one for each node")
        most = MOST_CELLS * delta[:, 0] ** d
        for at in np.flatnonzero(np.array(document.areas) < LEAST).tolist():
            raise GridError(f"{name}: $.areas[{at}] is {document.areas[at]:g}; use {LEAST:g} m^{d} or more")
        for at in np.flatnonzero(np.array(document.areas) > most).tolist():
            raise GridError(
                f"{name}: $.areas[{at}] is {document.areas[at]:g}; use at most {most[at]:g} m^{d},"
                f" {MOST_CELLS} cells of the spacing {delta[at, 0]:g} m"
            )
    return Grid(
        ids=ids,
        position=position[:, :d].copy(),
        delta=delta[:, 0].copy(),
        border=nodes.border,
        hole_id=nodes.hole_id,
        cracks=_cracks(document),
        outline=_rings(document.outline, d),
        holes=_rings(document.holes, d),
        areas=None if document.areas is None else np.array(document.areas),
        source=document.source,
        parameters=tuple(document.parameters.items()),
        drawing=document.drawing,
        bodies=bodies,
        fields=field_columns,
    )


def _grid_of_lattice(document: Document, lattice: Lattice, name: str) -> Grid:
    """The grid of a document that holds a lattice in place of nodes. Raises GridError."""
    d = document.dimension
    if len(lattice.counts) != d or len(lattice.origin) != d:
        description = f"{len(lattice.origin)} numbers of its origin and layers {lattice.layers}"
        raise GridError(f"{name}: $.lattice has {description}; give {'3 and a number' if d == 3 else '2 and none'}")
    if len(document.nodes) or document.areas is not None or document.bodies:
        raise GridError(f"{name}: $.lattice cannot be combined with nodes, areas or bodies; leave them out")
    count = math.prod(lattice.counts)
    if count > MOST_NODES:
        raise GridError(f"{name}: $.lattice has {count} nodes; use at most {MOST_NODES}")
    ends = np.array([lattice.origin, np.array(lattice.counts) * lattice.spacing])
    if np.abs(ends).max() > LARGEST:
        raise GridError(f"{name}: $.lattice reaches {np.abs(ends).max():g} m; use at most {LARGEST:g} m")
    _check_shapes(name, document)
    try:
        field_columns = field_columns_of(document.fields, count, _materials_of(document))
    except ValueError as error:
        raise GridError(f"{name}: {error}") from None
    return whole_lattice(
        lattice,
        fields=field_columns,
        cracks=_cracks(document),
        outline=_rings(document.outline, d),
        source=document.source,
        parameters=tuple(document.parameters.items()),
        drawing=document.drawing,
    )


def whole_lattice(lattice: Lattice, **more: Any) -> Grid:
    """All nodes of a lattice; `more` are other fields of the grid."""
    return WholeLattice(lattice, **more)


def _check_nodes(name: str, position: NDArray[np.float64], delta: NDArray[np.float64], dimension: int) -> None:
    def refuse(bad: NDArray[np.bool_], field: str, values: NDArray[np.float64], expected: str) -> None:
        if bad.any():
            at = int(bad.argmax())
            raise GridError(f"{name}: $.nodes[{at}].{field} is {values[at].tolist()}; use {expected}")

    refuse(np.abs(position).max(axis=1) > LARGEST, "position", position, f"metres, at most {LARGEST:g}")
    refuse(delta.max(axis=1) > LARGEST, "delta", delta, f"metres, at most {LARGEST:g}")
    if dimension == 2:
        expected = f"the same z for all nodes of a plate (a body has version {SPACE_VERSION})"
        refuse(position[:, 2] != position[0, 2], "position", position, expected)
    refuse(delta.min(axis=1) <= 0, "delta", delta, "positive numbers")
    refuse(delta[:, 0] != delta[:, 1], "delta", delta, "delta x equal to delta y")
    if dimension == 3:
        refuse(delta[:, 0] != delta[:, 2], "delta", delta, "delta z equal to delta x in a body")


def _check_shapes(name: str, document: Document) -> None:
    _check_dimensions(name, document)
    for key, shapes in (("notch", document.notch), ("outline", document.outline), ("holes", document.holes)):
        for number, shape in enumerate(shapes):
            numbers = np.abs(np.asarray(shape, dtype=float))
            if numbers.max(initial=0.0) > LARGEST:
                raise GridError(f"{name}: $.{key}[{number}] reaches {numbers.max():g} m; use at most {LARGEST:g} m")
            if key != "notch" and len(shape) < 3:
                raise GridError(f"{name}: $.{key}[{number}] has {len(shape)} points; use at least 3")


def _check_dimensions(name: str, document: Document) -> None:
    """Raise GridError for shapes of a body in a plate, and vice versa."""
    space = document.dimension == 3
    d, model_kind = (3, "a body in space") if space else (2, "a plate")
    for number, crack in enumerate(document.notch):
        if len(crack) != (9 if space else 6):
            meant = "9 of a triangle" if space else "6 of a segment"
            raise GridError(f"{name}: $.notch[{number}] has {len(crack)} numbers; use {meant} in {model_kind}")
        if not space and crack[:2] == crack[3:5]:
            raise GridError(f"{name}: $.notch[{number}]: both ends are in one place; use a segment")
    for key, rings in (("outline", document.outline), ("holes", document.holes)):
        for number, ring in enumerate(rings):
            odd = next((point for point in ring if len(point) != d), None)
            if odd is not None:
                raise GridError(f"{name}: $.{key}[{number}]: a point has {len(odd)} numbers; use {d} in {model_kind}")
            if space and len(ring) != 3:
                raise GridError(f"{name}: $.{key}[{number}] has {len(ring)} points; use triangles in {model_kind}")
    if space and document.holes:
        raise GridError(
            f"{name}: $.holes has {len(document.holes)}; leave them out in {model_kind}: its surface has them"
        )


def _cracks(document: Document) -> NDArray[np.float64]:
    if document.dimension == 3:
        return np.array(document.notch, dtype=float).reshape(-1, 9)
    return np.array(document.notch, dtype=float).reshape(-1, 6)[:, [0, 1, 3, 4]]


def _rings(rings: Sequence[Sequence[Vector]], dimension: int) -> tuple[NDArray[np.float64], ...]:
    return tuple(np.array(ring, dtype=float).reshape(-1, dimension) for ring in rings)


def document_of(grid: Grid, settings: Settings) -> Document:
    """The document of a grid and its settings."""
    space = grid.dimension == 3
    cracks = grid.cracks.tolist()
    if grid.lattice is not None:  # it stands for the nodes
        nodes = columns_of(())
    else:
        n, d = grid.position.shape
        position, delta = np.zeros((n, 3)), np.ones((n, 3))
        position[:, :d], delta[:, :d] = grid.position, grid.delta[:, None]
        nodes = NodeColumns(grid.ids, grid.border, position, grid.hole_id, delta)
    return Document(
        notch=tuple(map(tuple, cracks) if space else ((x0, y0, 0.0, x1, y1, 0.0) for x0, y0, x1, y1 in cracks)),
        version=SPACE_VERSION if space else FORMAT_VERSION,
        nodes=nodes,
        lattice=grid.lattice,
        outline=tuple(tuple(map(tuple, ring.tolist())) for ring in grid.outline),
        holes=tuple(tuple(map(tuple, ring.tolist())) for ring in grid.holes),
        areas=None if grid.lattice is not None or grid.areas is None else tuple(grid.areas.tolist()),
        bodies=() if grid.bodies is None else records_of(grid.bodies, grid.ids),
        fields=field_records_of(grid.fields) if grid.fields else (),
        source=grid.source,
        drawing=grid.drawing,
        parameters=dict(grid.parameters),
        **{field: getattr(settings, field) for field in Settings.__struct_fields__},
    )


def bodies_of(records: tuple[BodyNodes, ...], ids: NDArray[np.int64]) -> Bodies | None:
    """The bodies of nodes with these ids (n,); None if there is one. Raises ValueError naming place and id."""
    if not records:
        return None
    number, order = np.zeros(len(ids), dtype=np.int64), np.argsort(ids)
    for at, record in enumerate(records):
        node_ids = np.array(record.nodes, dtype=np.int64)
        if not len(node_ids):
            raise ValueError(f"$.bodies[{at}].nodes is empty; give at least one")
        rows = order[np.searchsorted(ids, node_ids, sorter=order).clip(max=len(ids) - 1)]
        for wrong, said in (
            (ids[rows] != node_ids, "one of the grid's nodes"),
            (number[rows] > 0, "one of no other body"),
        ):
            if wrong.any():
                raise ValueError(f"$.bodies[{at}].nodes: id {node_ids[wrong.argmax()]} cannot be used; give {said}")
        number[rows] = at + 1
    return Bodies(number, (REST, *(record.name for record in records)))


def records_of(bodies: Bodies | None, ids: NDArray[np.int64]) -> tuple[BodyNodes, ...]:
    """The bodies as the grid file has them."""
    if bodies is None:
        return ()
    rest = enumerate(bodies.names[1:], start=1)
    return tuple(BodyNodes(name, tuple(ids[bodies.number == number].tolist())) for number, name in rest)
