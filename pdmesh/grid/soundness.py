"""Checks that a grid represents the drawn plate: connected where it is, supported where loaded, nowhere too thin.

Supports balance the forces on each piece of a plate, so that it neither flies off nor turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.grid.pieces import THINNEST, Ligament, faces_of, ligaments, pieces
from pdmesh.model.document import Acceleration, AnyCondition, Displacement, Load, Pin, Settings, Spring, Velocity
from pdmesh.model.lattice_calibration import has_partial_cells
from pdmesh.model.load_resultants import nodal_forces
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import plate_of
from pdmesh.scene.shapes import SceneError, near

UNBALANCED = 0.05  # of the forces on a piece: what is less may come from nodes that are not quite on edges
NOTHING = 1e-12  # of the largest: what does not resist a rigid motion at all
CRUMB = 9  # nodes; a piece of fewer that nothing acts on is only warned of
ON = 1e-6  # of a spacing: what still counts as in a part
MOST_SAID = 3  # ligaments that are named one by one


def unheld(grid: Grid, settings: Settings, number: NDArray[np.int64]) -> Iterator[tuple[int, float]]:
    """Pieces with forces that neither balance nor are supported, and the unbalanced force, N/m.

    `number` (n,) is the piece of each node; ids count from 1. Forces with different profiles do not balance each other.
    """
    loads = [condition for condition in settings.conditions if isinstance(condition, Load)]
    loaded = [np.unique(number[rows_of(load)]) for load in loads]
    for piece in np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *loaded])):
        inside = number == piece
        acted_on = np.concatenate([rows_of(condition) for condition in settings.conditions])
        motions = _Motions(grid.position, grid.position[acted_on[inside[acted_on]]])
        free = _free_motions(settings, motions, inside)
        for profile in dict.fromkeys(load.profile for load in loads):
            residual, total = np.zeros(3), 0.0
            for load in loads:
                if load.profile == profile:
                    rows = rows_of(load)
                    force = np.where(inside[rows, None], nodal_forces(load, grid, rows), 0.0)
                    residual += np.einsum("ni,nij->j", force, motions.of(rows))
                    total += float(np.hypot(*force.T).sum())
            unbalanced = float(np.linalg.norm(free @ residual))
            if unbalanced > UNBALANCED * total:
                yield int(piece), unbalanced
                break


def rows_of(condition: AnyCondition) -> NDArray[np.int64]:
    """Rows of the nodes of a condition."""
    return np.array(condition.nodes or (), dtype=np.int64) - 1


class _Motions:
    """Rigid motions of equal size: along x, along y, and a rotation about the centre of `reference_position` (k, 2)."""

    def __init__(self, position: NDArray[np.float64], reference_position: NDArray[np.float64]) -> None:
        self._position, self._middle = position, reference_position.mean(axis=0)
        self._size = float(np.ptp(reference_position, axis=0).max()) / 2 or 1.0

    def of(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Displacements (k, 2, 3) of these nodes in each rigid motion."""
        return self.at(self._position[rows])

    def at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements (k, 2, 3) of places (k, 2), m, in each rigid motion."""
        turn = (places - self._middle) / self._size
        motions = np.zeros((len(places), 2, 3))
        motions[:, 0, 0] = motions[:, 1, 1] = 1.0
        motions[:, 0, 2], motions[:, 1, 2] = -turn[:, 1], turn[:, 0]
        return motions


def _free_motions(settings: Settings, motions: _Motions, inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Projection (3, 3) onto the rigid motions that no support resists."""
    resistance = np.zeros((3, 3))
    for condition in settings.conditions:
        for axis, constraint in enumerate(_held(condition)):
            rows = rows_of(condition)
            way = motions.of(rows[inside[rows]])[:, axis]
            if isinstance(condition, Pin):  # whose ring turns about its centre
                way = motions.at(np.array([condition.centre]))[:, axis] * len(way)
            resistance += way.T @ way * constraint
    strength, ways = np.linalg.eigh(resistance)
    free = ways[:, strength <= NOTHING * max(strength.max(), NOTHING)]
    return np.asarray(free @ free.T)


def _held(condition: AnyCondition) -> tuple[bool, ...]:
    """Whether a condition resists motions along x and y; a pin does at its centre."""
    if isinstance(condition, Displacement | Velocity | Acceleration):
        return condition.x is not None, condition.y is not None
    if isinstance(condition, Spring):
        along = condition.stiffness or condition.body_stiffness or ()
        return tuple(value > 0 for value in along[:2])
    return (True, True) if isinstance(condition, Pin) else ()


class _Piece(NamedTuple):
    """Nodes connected by bonds."""

    rows: NDArray[np.int64]
    face: int  # of the plate, that it is in

    def describe(self, grid: Grid) -> str:
        x, y = grid.position[self.rows].mean(axis=0)
        return f"{len(self.rows)} node{'s' * (len(self.rows) > 1)} around ({x:.6g}, {y:.6g}) m"


def remarks(grid: Grid, settings: Settings) -> tuple[str, ...]:
    """Warnings about a grid whose node ids count from 1.

    Raises SceneError if bonds fail to connect what the drawing connects, or a part of it has no node.
    """
    plate = plate_of(grid)
    if plate is None:
        return ()
    faces = faces_of(plate, grid)
    thin = ligaments(grid, faces)
    materials = [settings.material, *(region.material for region in settings.regions)]
    partial = any(material is not None and has_partial_cells(material) for material in materials)
    number = pieces(grid, settings.horizon.ratio + 0.5 * partial)
    order = np.argsort(number, kind="stable")
    rows = np.split(order, np.cumsum(np.bincount(number))[:-1])
    inner = [piece_rows[grid.border[piece_rows].argmin()] for piece_rows in rows]  # edges may be those of several faces
    face = shapely.STRtree(faces).nearest(shapely.points(grid.position[inner]))
    piece_list = [_Piece(piece_rows, int(at)) for piece_rows, at in zip(rows, face, strict=True)]
    piece_list = sorted(piece_list, key=lambda piece: -len(piece.rows))
    said = [*_loose(grid, settings, piece_list, thin), *_bare(grid, piece_list, faces)]
    if len(faces) > len(shapely.get_parts(plate)):  # which may be intended
        parts = "; ".join(piece.describe(grid) for piece in _largest(piece_list).values())
        said.append(f"the cracks cut the plate into pieces: {parts}")
    number = np.zeros(len(grid), dtype=np.int64)
    for at, piece in enumerate(piece_list):
        number[piece.rows] = at
    said += [
        f"warning: {force:.3g} N/m on {piece_list[at].describe(grid)} act without supports and without balance, and"
        " they fly off or turn; add a fix, a move or an opposite load"
        for at, force in unheld(grid, settings, number)
    ]
    said += [
        f"warning: the plate is {width:.2g} m wide at ({x:.6g}, {y:.6g}) m, {width / spacing:.2g} spacings of"
        f" {spacing:g} m, and {THINNEST:g} are needed: use finer nodes there"
        for (x, y), width, spacing in thin[:MOST_SAID]
    ]
    said += [f"warning: {len(thin) - MOST_SAID} more places are as thin"] * (len(thin) > MOST_SAID)
    return tuple(said)


def _largest(pieces: list[_Piece]) -> dict[int, _Piece]:
    """The largest piece of each part of the plate."""
    largest: dict[int, _Piece] = {}
    for piece in pieces:
        largest.setdefault(piece.face, piece)
    return largest


def _loose(grid: Grid, settings: Settings, pieces: list[_Piece], thin: list[Ligament]) -> list[str]:
    """Warnings of loose crumbs. Raises SceneError for larger pieces that only the drawing connects to others."""
    acted_on = np.zeros(len(grid), dtype=bool)
    for condition in settings.conditions:
        acted_on[rows_of(condition)] = True
    largest = _largest(pieces)
    warnings = []
    for piece in pieces:
        if piece is largest[piece.face]:
            continue
        nodes = shapely.multipoints(grid.position[piece.rows])
        reach = THINNEST * float(grid.delta[piece.rows].max())
        near_by = [ligament for ligament in thin if nodes.distance(shapely.Point(ligament.place)) <= reach]
        where = "which is too thin there; use finer nodes, or a gap or a crack that parts them"
        if near_by:
            (x, y), width, spacing = near_by[0]
            where = (
                f"which is {width:.2g} m wide at ({x:.6g}, {y:.6g}) m, where nodes are {spacing:g} m apart; use"
                f" {width / THINNEST:.2g} m there, or a gap or a crack that parts them"
            )
        said = f"no bond joins {piece.describe(grid)} to the rest of the plate, {where}"
        if len(piece.rows) >= CRUMB or acted_on[piece.rows].any():
            raise SceneError(f"plate: {said}")
        warnings.append(f"warning: {said}")
    return warnings


def _bare(grid: Grid, pieces: list[_Piece], faces: list[shapely.Polygon]) -> list[str]:
    """Warnings of small parts of the plate without a node. Raises SceneError for larger ones."""
    warnings = []
    for number in sorted(set(range(len(faces))) - {piece.face for piece in pieces}):
        face = faces[number]
        x, y = shapely.get_coordinates(face.representative_point())[0]
        part = f"a part of the plate around ({x:.6g}, {y:.6g}) m, {face.area:.3g} m^2"
        if near(grid.position, face, ON * float(grid.delta.min())).any():
            warnings.append(f"warning: {part}, has no node: it touches another part in a point, where bonds join them")
            continue
        spacing = float(grid.delta[np.hypot(*(grid.position - (x, y)).T).argmin()])
        said = f"no node is in {part}; use finer nodes, which are {spacing:g} m apart there"
        if face.area >= CRUMB * spacing**2:
            raise SceneError(f"plate: {said}")
        warnings.append(f"warning: {said}")
    return warnings
