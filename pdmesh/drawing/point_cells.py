"""Points with volumes, as Peridigm and PeriLab have them, as cells: squares in a plane, cubes in space.

Points in space that are on no lattice get no cells: they are the nodes (`pdmesh.drawing.point_cloud`).

A text file of them has lines x y z block volume.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing.mesh_arrays import Block, Mesh
from pdmesh.drawing.text_fields import finite_number, text_lines
from pdmesh.model.neighbours import tree_of
from pdmesh.scene.shapes import SceneError

FLAT = 1e-9  # of the size of the points: z that still counts as one
ON = 1e-3  # of a spacing: how far a node may be from its place on a lattice
ALIKE = 1e-3  # relative: thicknesses and areas that are the same
OVERLAP = 1e-6  # of the area
LEAST, CLOSEST = 1e-180, 1e-60  # volume, and distance of two points: quotients and powers of them are finite
FINEST = 1e-9  # spacing, of the size of a lattice
ADVICE = "use in a plane the nodes of a lattice, each the middle of its cell (or the mesh they are made from)"
SQUARE = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
CUBE = np.array([(*corner, end) for end in (0, 1) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))])
COLUMNS = {5: ("x", "y", "z", "block", "volume"), 4: ("x", "y", "block", "volume")}
HEADER = re.compile(r"\s*#?\s*header\s*:", re.IGNORECASE)
LARGEST = 1e15  # number of a block
NAMES = {"block_id": "block", "block": "block", "volume": "volume", "vol": "volume", "x": "x", "y": "y", "z": "z"}


def with_cells(mesh: Mesh) -> Mesh:
    """The mesh with a cell around each point, if it has volumes and no other cells. Raises SceneError.

    A mesh whose points are on no lattice in space keeps its volumes and has no cells but points. The spacing is the
    distance of the points, and their volumes say how thick a plate is.
    """
    if not mesh.volumes or any(block.dimension and len(block.data) for block in mesh.cells):
        return replace(mesh, volumes=())
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(block.data[:, 0] for block in mesh.cells)])
    volume = np.concatenate([np.zeros(0), *mesh.volumes])
    unknown = int(np.isnan(volume).sum())
    if not len(rows):
        raise SceneError(
            f"no face and no solid is in it, but {len(mesh.points)} points; add triangles, quads or solids, or"
            " give points their volumes (a text file of lines x y z block volume)"
        )
    if unknown:
        raise SceneError(
            f"{unknown} points have no volume; use cells, or an attribute 'volume' of each point (or a text file of"
            " lines x y z block volume)"
        )
    if len(rows) < 2:
        raise SceneError("points: there are fewer than two; use the nodes of a plate or a body")
    for at in np.flatnonzero(~((volume > LEAST) & (volume < 1 / LEAST)))[:1].tolist():
        raise SceneError(f"point {at}: volume is {volume[at]:g}; use more than 0 and less than {1 / LEAST:g}")
    places = mesh.points[rows]
    size = np.ptp(places, axis=0)
    if places.shape[1] == 3 and size[2] > FLAT * size.max():
        # cubes with their corners in common
        lattice = _lattice(places, float(np.median(_apart(places))))
        if lattice is None:
            return mesh
        origin, side, at = lattice
        corner = (at[:, None] + CUBE).reshape(-1, 3)
        every, cells = np.unique(corner, axis=0, return_inverse=True)
        odd_volume = np.abs(volume / side**3 - 1) > ALIKE
        notes = [f"{int(odd_volume.sum())} nodes have another volume than {side**3:.6g}: those of cubes are taken"]
        points = origin + side * (every - 0.5)
        cubes = _with_blocks(mesh, "hexahedron", points, cells.reshape(-1, 8), None, notes if odd_volume.any() else [])
        return replace(cubes, spacing=side)
    return _squares(mesh, places[:, :2], volume)


def _squares(mesh: Mesh, places: NDArray[np.float64], volume: NDArray[np.float64]) -> Mesh:
    """A plate of squares, with the areas of its nodes."""
    apart = _apart(places)
    side, lattice = float(np.median(apart)), _lattice(places, float(np.median(apart)))
    thickness = float(np.median(volume / apart**2))
    notes = []
    if abs(thickness - 1) < ALIKE:
        thickness = 1.0
    else:
        notes = [f"volumes are areas times a thickness of {thickness:.6g}: nodes have the areas"]
    area = volume / thickness
    sides = np.full(len(places), side) if lattice is not None else np.sqrt(area)
    corners = places[:, None] + sides[:, None, None] * SQUARE
    if lattice is not None:
        origin, side, at = lattice
        corners = origin + side * (at[:, None] + SQUARE)
    else:
        union_area = shapely.union_all(shapely.polygons(corners)).area
        if abs(union_area - float(area.sum())) > OVERLAP * union_area:
            raise SceneError(f"points: neighbours are {apart.min():.4g} to {apart.max():.4g} apart; {ADVICE}")
    return _with_blocks(mesh, "quad", corners.reshape(-1, 2), np.arange(4 * len(places)).reshape(-1, 4), area, notes)


def _apart(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """The distance (n,) of each point to the nearest other. Raises SceneError for two at one place."""
    apart = tree_of(places).query(places, k=2)[0][:, 1]
    if not apart.min() > CLOSEST:
        at = ", ".join(f"{value:g}" for value in places[int(apart.argmin())])
        raise SceneError(f"points: two are at ({at}); use one at each place")
    return np.asarray(apart)


def _lattice(
    places: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], float, NDArray[np.int64]] | None:
    """Origin, spacing and numbers (n, d) of the points on their lattice; None if they are on none."""
    origin, size = places.min(axis=0), np.ptp(places, axis=0)
    axis = int(size.argmax())
    if spacing < FINEST * size[axis]:
        return None
    spacing = float(size[axis] / max(round(size[axis] / spacing), 1))
    spacing = float(f"{spacing:.9g}") if abs(float(f"{spacing:.9g}") / spacing - 1) < 1e-12 * len(places) else spacing
    share = (places - origin) / spacing
    at = np.rint(share)
    return (origin, spacing, at.astype(np.int64)) if np.abs(share - at).max() < ON else None


def _with_blocks(
    mesh: Mesh,
    kind: str,
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    areas: NDArray[np.float64] | None,
    notes: list[str],
) -> Mesh:
    """The mesh with these cells in place of its points, block by block, and the sets of those."""
    ends = np.cumsum([len(block.data) for block in mesh.cells])[:-1]
    blocks = tuple(Block(kind, block_cells) for block_cells in np.split(cells, ends))
    volumes = () if areas is None else tuple(np.split(areas, ends))
    return replace(mesh, points=points, cells=blocks, volumes=volumes, point_sets={}, notes=(*mesh.notes, *notes))


def read_table(path: Path) -> Mesh:
    """The points of the text file at `path`, blocks as sets "block_1". Raises SceneError and OSError.

    A first line ``header: x y block_id volume`` names the columns; without it they are x y z block volume, or x y block
    volume. ``#`` begins a comment.
    """
    names: tuple[str, ...] | None = None
    rows, numbers = [], []
    for number, line in enumerate(text_lines(path), start=1):
        if HEADER.match(line):
            if names is not None:
                raise SceneError(f"{path}: line {number}: a second or late 'header:'; use one, before the first point")
            text = line.partition(":")[2]
            names = tuple(NAMES.get(word.lower(), word) for word in text.replace(",", " ").split())
            if not {"x", "y", "block", "volume"} <= set(names) or len(set(names)) < len(names):
                wanted = "use the header: x y z block_id volume"
                raise SceneError(f"{path}: line {number}: cannot read '{text.strip():.60}'; {wanted}")
            continue
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            names = names or COLUMNS.get(len(words))
            row = [value for value in map(finite_number, words) if value is not None]
            if names is None or not len(row) == len(words) == len(names):
                wanted = " ".join(names or COLUMNS[5])
                raise SceneError(f"{path}: line {number}: cannot read '{' '.join(words):.60}'; use numbers {wanted}")
            rows.append(row)
            numbers.append(number)
    if names is None or not rows:
        raise SceneError(f"{path} has no points; use lines of x, y, z, block and volume")
    table = np.array(rows)
    of = {name: table[:, at] for at, name in enumerate(names)}
    exact = (of["block"] == np.rint(of["block"])) & (np.abs(of["block"]) < LARGEST)
    for at in np.flatnonzero(~exact)[:1].tolist():
        wanted = "a whole number of at most 15 digits"
        raise SceneError(f"{path}: line {numbers[at]}: block is {of['block'][at]:g}; use {wanted}")
    points = np.column_stack([of[axis] for axis in "xyz" if axis in of])
    cells = Block("vertex", np.arange(len(points))[:, None])
    order = np.argsort(of["block"], kind="stable")
    blocks, first = np.unique(of["block"][order].astype(np.int64), return_index=True)
    members = np.split(order, first[1:])
    sets = {f"block_{block}": [rows] for block, rows in zip(blocks.tolist(), members, strict=True)}
    return Mesh(points, (cells,), sets, volumes=(of["volume"],))
