"""A mesh as arrays: points, blocks of cells with meshio's names of their types, and named sets of both.

The sets are groups of a drawing by their own names, or by the parameters that are set for them. A plane mesh
has edges where its cells end, and slits where nodes are double.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing.parameters import MATERIAL, PREFIX
from pdmesh.model.neighbours import connected, tree_of
from pdmesh.scene.shapes import near

Rows = NDArray[np.int64]
QUADS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
LINES = {"line": 2, "line3": 2}
POINTS = {"vertex": 1}
# Faces of solids by their corners, in the order in which Abaqus numbers them
SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}
CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
MOST_SAID = 4  # names of groups without effect that are listed
PLANE = f"{PREFIX}Material/{MATERIAL['plane']}"
COINCIDENT = 1e-9  # of the size of a mesh: points this near are at one place
ON = 1e-6  # of an edge: what counts as on a line
FEW = 3  # cells: fewer that have no common point may well be parts of their own


class Block(NamedTuple):
    """Cells of one type: the points of each, (k, corners)."""

    type: str
    data: Rows

    @property
    def shape(self) -> str:
        """The type without its order: "hexahedron" of "hexahedron20"."""
        return self.type.rstrip("0123456789")

    @property
    def dimension(self) -> int | None:
        """The dimension of the cells; None for a type that is not read."""
        by_dimension = (POINTS, LINES, QUADS)
        for dimension, types in enumerate(by_dimension):
            if self.type in types:
                return dimension
        return 3 if self.shape in SIDES else None

    @property
    def corners(self) -> Rows:
        """The cells without the points between their corners."""
        count = (POINTS | LINES | QUADS).get(self.type) or CORNERS[self.shape]
        return self.data[:, :count]


@dataclass(frozen=True)
class Mesh:
    """Points and cells, with named sets of both."""

    points: NDArray[np.float64]  # (n, 2 or 3)
    cells: tuple[Block, ...]
    cell_sets: dict[str, list[Rows]] = field(default_factory=dict)  # by name: rows of each block
    point_sets: dict[str, Rows] = field(default_factory=dict)
    volumes: tuple[NDArray[np.float64], ...] = ()  # of the cells of each block, where they are points; NaN: unknown
    spacing: float | None = None  # of points that were made cells
    parts: Rows | None = None  # the part that each point is of, if the file has several
    plane: str = ""  # "stress" or "strain", if the file says so
    notes: tuple[str, ...] = ()  # on what the file says and the mesh leaves out

    def of_dimension(self, dimension: int) -> tuple[list[Block], dict[str, list[Rows]]]:
        """The blocks of cells of this dimension, and the rows of each that are in a set."""
        chosen = [at for at, block in enumerate(self.cells) if block.dimension == dimension and len(block.data)]
        sets = {name: [members[number] for number in chosen] for name, members in self.cell_sets.items()}
        return [self.cells[number] for number in chosen], sets


def group_names(
    name: str, dimension: int, kinds: Mapping[str, tuple[Collection[int], str | None]], values: Iterable[str]
) -> list[str]:
    """The groups that a set of cells is: "load:top" as it is named, "top" where parameters below Loads/top are set."""
    if ":" in name:
        return [name]
    folders = {word.removeprefix(PREFIX).rpartition("/")[0] for word in values}
    return [
        f"{kind}:{name}"
        for kind, (dimensions, folder) in kinds.items()
        if kind != "zone" and folder and dimension in dimensions and f"{folder}/{name}" in folders
    ]


def unused(what: str, names: Collection[str], advice: str) -> list[str]:
    """One remark on sets that have no effect; `advice` has NAME where the first of their names belongs."""
    if not names:
        return []
    first, *_ = listed = list(names)
    shown = ", ".join(f"'{name}'" for name in listed[:MOST_SAID])
    more = f" and {len(listed) - MOST_SAID} more" if len(listed) > MOST_SAID else ""
    return [f"{what}{'s' * (len(listed) > 1)} {shown}{more}: {advice.replace('NAME', first)}"]


def with_plane(values: dict[str, Any], plane: str) -> tuple[dict[str, Any], list[str]]:
    """The values with plane stress or strain as the elements have it, and a remark on that."""
    plane_setting = values.get(PLANE)
    if not plane or (plane_setting is None and plane == "stress"):
        return values, []
    if plane_setting is not None:
        differs = f"warning: elements are of plane {plane}, {PLANE} is {plane_setting}, which counts"
        return values, [differs] if plane_setting != plane else []
    if any(name.startswith(f"{PREFIX}Material/") for name in values):
        return values | {PLANE: plane}, [f"plane {plane}, as the elements have it"]
    return values, [f"elements are of plane {plane}: --set Material/{MATERIAL['plane']}={plane} with the material"]


def joined(points: NDArray[np.float64]) -> Rows:
    """For each point (n, d) the first at its place."""
    size = float(np.ptp(points, axis=0).max())
    pairs = tree_of(points).query_pairs(COINCIDENT * size, output_type="ndarray")
    if not len(pairs):
        return np.arange(len(points))
    part = connected(len(points), *pairs.T)
    _, first = np.unique(part, return_index=True)
    return np.asarray(first[part], dtype=np.int64)


def ends_of(blocks: Iterable[Block], of_place: Rows) -> tuple[Rows, bool]:
    """Edges (k, 2), as points, that belong to one cell alone; and whether no two cells have a point in common.

    In the latter case cells that touch are joined, as such a file says nothing of slits.
    """
    sides = []
    for block in blocks:
        ends = np.stack([block.corners, np.roll(block.corners, -1, axis=1)], axis=2).reshape(-1, 2)
        sides.append(ends[ends[:, 0] != ends[:, 1]])
    edges = np.concatenate(sides)
    alone, shared = _once(edges)
    _, touching = _once(of_place[edges])
    if not shared and touching and sum(len(block.data) for block in blocks) >= FEW:
        return _once(of_place[edges])[0], True
    return alone, False


def _once(edges: Rows) -> tuple[Rows, bool]:
    """The edges that are there once, and whether there are others."""
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[np.sort(first[count == 1])], bool((count > 1).any())


def doubled(ends: Rows, of_place: Rows) -> NDArray[np.bool_]:
    """Which edges (k, 2) of one cell alone are at the place of another, of other points."""
    _, inverse, count = np.unique(np.sort(of_place[ends], axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()] > 1)


def along(places: NDArray[np.float64], ends: Rows, line: shapely.Geometry) -> NDArray[np.bool_]:
    """Which edges (k, 2), between `places` (n, 2), are on a line."""
    edges = places[ends]
    slack = ON * float(np.median(np.hypot(*(edges[:, 1] - edges[:, 0]).T)))
    on_line = near(edges.mean(axis=1), line, slack)
    for end in range(2):
        on_line &= near(edges[:, end], line, slack)
    return on_line


def slits(
    places: NDArray[np.float64], ends: Rows, plate: shapely.Geometry, cracks: Sequence[shapely.Geometry]
) -> list[NDArray[np.float64]]:
    """Lines, points (k, 2), of those edges (k, 2) between `places` (n, 2) that are inside a plate, and no `cracks`."""
    edge = plate.boundary
    ends = ends[~along(places, ends, edge)] if len(ends) else ends
    if not len(ends):
        return []
    lines = places[ends]
    slack = ON * float(np.median(np.hypot(*(lines[:, 1] - lines[:, 0]).T)))
    around = shapely.union_all([edge, *cracks]).buffer(2 * slack)
    inner = shapely.difference(shapely.linestrings(lines), around)
    inner = shapely.get_parts(inner)
    inner = inner[shapely.length(inner) > 10 * slack]
    if not len(inner):
        return []
    far, nearest = tree_of(places).query(shapely.get_coordinates(inner))
    onto_nodes = np.where((far <= 4 * slack)[:, None], places[nearest], shapely.get_coordinates(inner))
    inner = shapely.set_coordinates(inner, onto_nodes)  # ends are put back where they were cut off from
    merged = shapely.line_merge(shapely.union_all(inner))
    return [shapely.get_coordinates(line) for line in shapely.get_parts(merged)]


def slit_remark(lines: Sequence[NDArray[np.float64]], unit: str) -> list[str]:
    """One remark on the slits of a mesh, lengths in its `unit`."""
    if not lines:
        return []
    length = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines]
    longest = lines[int(np.argmax(length))]
    (x0, y0), (x1, y1) = longest[0], longest[-1]
    way = f"from ({x0:.6g}, {y0:.6g}) to ({x1:.6g}, {y1:.6g}) {unit}"
    if len(lines) == 1:
        return [f"double nodes {way}: a pre-crack of {sum(length):.6g} {unit}"]
    return [f"double nodes: {len(lines)} pre-cracks of {sum(length):.6g} {unit} in all, the longest {way}"]
