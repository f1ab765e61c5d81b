"""The nodes of a grid file as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import LARGEST, Document, GridError, NodeRecord, Point, Settings


@dataclass(frozen=True)
class Grid:
    """A checked grid as arrays, n nodes in the file's order."""

    ids: NDArray[np.int64]  # (n,) unique
    position: NDArray[np.float64]  # (n, 2) m
    delta: NDArray[np.float64]  # (n,) spacing, m
    border: NDArray[np.bool_]  # (n,) at the edge of the plate or of a hole
    hole_id: NDArray[np.int64]  # (n,) -1 where none
    cracks: NDArray[np.float64]  # (k, 4) segments x0, y0, x1, y1, m
    outline: tuple[NDArray[np.float64], ...] = ()  # rings (p, 2), m
    holes: tuple[NDArray[np.float64], ...] = ()  # rings (p, 2), m
    areas: NDArray[np.float64] | None = None  # (n,) m^2
    source: str = ""
    parameters: tuple[tuple[str, float | str], ...] = ()
    drawing: str = ""

    def __len__(self) -> int:
        return len(self.ids)


def grid_of(document: Document, name: str) -> Grid:
    """The document's nodes as arrays. Raises GridError for what types alone cannot rule out."""
    nodes = document.nodes
    if not nodes:
        raise GridError(f"{name}: $.nodes: found none, expected at least one")
    ids = np.array([node.id for node in nodes])
    first, counts = np.unique(ids, return_counts=True)
    if counts.max() > 1:
        raise GridError(f"{name}: $.nodes: id {first[counts.argmax()]} found {counts.max()} times, expected once")
    position = np.array([node.position for node in nodes])
    delta = np.array([node.delta for node in nodes])
    _check_nodes(name, position, delta)
    _check_shapes(name, document)
    if document.areas is not None and len(document.areas) != len(nodes):
        raise GridError(f"{name}: $.areas: found {len(document.areas)}, expected {len(nodes)}, one for each node")
    return Grid(
        ids=ids,
        position=position[:, :2].copy(),
        delta=delta[:, 0].copy(),
        border=np.array([node.border == "true" for node in nodes]),
        hole_id=np.array([node.hole_id for node in nodes]),
        cracks=np.array(document.notch, dtype=float).reshape(-1, 6)[:, [0, 1, 3, 4]],
        outline=_rings(document.outline),
        holes=_rings(document.holes),
        areas=None if document.areas is None else np.array(document.areas),
        source=document.source,
        parameters=tuple(document.parameters.items()),
        drawing=document.drawing,
    )


def _check_nodes(name: str, position: NDArray[np.float64], delta: NDArray[np.float64]) -> None:
    def refuse(bad: NDArray[np.bool_], field: str, found: NDArray[np.float64], expected: str) -> None:
        if bad.any():
            at = int(bad.argmax())
            raise GridError(f"{name}: $.nodes[{at}].{field}: found {found[at].tolist()}, expected {expected}")

    refuse(np.abs(position).max(axis=1) > LARGEST, "position", position, f"metres, at most {LARGEST:g}")
    refuse(delta.max(axis=1) > LARGEST, "delta", delta, f"metres, at most {LARGEST:g}")
    refuse(position[:, 2] != position[0, 2], "position", position, "the same z for all nodes")
    refuse(delta.min(axis=1) <= 0, "delta", delta, "positive numbers")
    refuse(delta[:, 0] != delta[:, 1], "delta", delta, "delta x equal to delta y")


def _check_shapes(name: str, document: Document) -> None:
    for key, shapes in (("notch", document.notch), ("outline", document.outline), ("holes", document.holes)):
        for number, shape in enumerate(shapes):
            numbers = np.abs(np.asarray(shape, dtype=float))
            if numbers.max(initial=0.0) > LARGEST:
                raise GridError(f"{name}: $.{key}[{number}]: found {numbers.max():g}, expected at most {LARGEST:g} m")
            if key != "notch" and len(shape) < 3:
                raise GridError(f"{name}: $.{key}[{number}]: found {len(shape)} points, expected at least 3")


def _rings(rings: Sequence[Sequence[Point]]) -> tuple[NDArray[np.float64], ...]:
    return tuple(np.array(ring, dtype=float).reshape(-1, 2) for ring in rings)


def document_of(grid: Grid, settings: Settings) -> Document:
    """The document that `grid` and `settings` are written as."""
    labels = np.where(grid.border, "true", "false").tolist()
    columns = zip(
        grid.ids.tolist(),
        labels,
        grid.position.tolist(),
        grid.hole_id.tolist(),
        grid.delta.tolist(),
        strict=True,
    )
    return Document(
        notch=tuple((x0, y0, 0.0, x1, y1, 0.0) for x0, y0, x1, y1 in grid.cracks.tolist()),
        nodes=tuple(NodeRecord(i, border, (x, y, 0.0), hole, (d, d, 1.0)) for i, border, (x, y), hole, d in columns),
        outline=tuple(tuple(map(tuple, ring.tolist())) for ring in grid.outline),
        holes=tuple(tuple(map(tuple, ring.tolist())) for ring in grid.holes),
        areas=None if grid.areas is None else tuple(grid.areas.tolist()),
        source=grid.source,
        drawing=grid.drawing,
        parameters=dict(grid.parameters),
        **{field: getattr(settings, field) for field in Settings.__struct_fields__},
    )
