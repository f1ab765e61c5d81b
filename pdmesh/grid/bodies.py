"""The grid of a body in space, and its settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.grid.bodies_beside import joined
from pdmesh.grid.cubic import Cubic, Scattered, place_nodes
from pdmesh.grid.lattice import CLEARANCE
from pdmesh.grid.pressed_sheets import faces_of_crack_sheet, faces_of_sheet
from pdmesh.model.document import (
    ON_ONE_LATTICE,
    AnyCondition,
    Concentration,
    Exchange,
    Horizon,
    InitialVelocity,
    Lattice,
    Load,
    Material,
    Region,
    Selection,
    Settings,
    Spring,
)
from pdmesh.model.mechanical_conditions import REST
from pdmesh.model.node_grid import Grid, whole_lattice
from pdmesh.model.pressed_faces import nodal_areas
from pdmesh.model.triangulated_surface import distances, ways_to
from pdmesh.scene.body import Body, CrackFace, SolidCondition, Where
from pdmesh.scene.conditions import describe
from pdmesh.scene.faces import SIDES, face
from pdmesh.scene.functions_of_place import sampled
from pdmesh.scene.heat import medium_of
from pdmesh.scene.pressed_edges import CRACK, named_crack
from pdmesh.scene.shapes import SceneError, errors_at
from pdmesh.scene.solids import Sheet, Shell

S = TypeVar("S", bound=Selection)

MANY = 100_000  # nodes of a box, whose file holds a lattice in place of them
SLACK = 1e-6  # of a spacing: what still counts as on a side
FAR = 2.0  # spacings: a point farther from all nodes is beside the body
MOVED = 1 / 32  # of a spacing: how far from all nodes a crack is that was moved


class BodyNodes(NamedTuple):
    """All nodes of all levels; n of them."""

    levels: Sequence[Cubic | Scattered]
    position: NDArray[np.float64]  # (n, 3) m
    delta: NDArray[np.float64]  # (n,) m

    def within(self, shell: Shell, place: str) -> NDArray[np.bool_]:
        """Which nodes (n,) are in a solid. Raises SceneError, beginning with `place`."""
        return np.concatenate([level.within(shell, place) for level in self.levels])


def build_body(body: Body) -> tuple[Grid, Settings, tuple[str, ...]]:
    """The nodes of a body whose solids are shells, and of those beside it, what is done to them, and remarks.

    Raises SceneError.
    """
    grid, settings, remarks = _beside(body) if body.bodies else _alone(body)
    if body.run.gaps:
        body_nodes = BodyNodes([], grid.position, grid.delta)
        for gap in body.run.gaps:
            for end in gap.ends:
                _at(end, f"gap '{gap.name}'", body_nodes)
    return grid, settings, remarks


def _beside(body: Body) -> tuple[Grid, Settings, tuple[str, ...]]:
    """Grid, settings and remarks of a body and of those beside it."""
    every = [_alone(replace(body, bodies=()), lists=True)]
    for other_body in body.bodies:
        with errors_at(f"body '{other_body.name}'"):
            every.append(_alone(replace(other_body.body, run=body.run), lists=True))
    _refuse_overlap(
        [(REST, replace(body, bodies=())), *((other_body.name, other_body.body) for other_body in body.bodies)]
    )
    grid = joined([part_grid for part_grid, _, _ in every], (REST, *(other_body.name for other_body in body.bodies)))
    settings, regions, conditions = every[0][1], [*every[0][1].regions], [*every[0][1].conditions]
    first = len(every[0][0])
    for other_body, (body_grid, more, _) in zip(body.bodies, every[1:], strict=True):
        nodes = tuple(range(first + 1, first + len(body_grid) + 1))
        if other_body.body.material not in (None, body.material):
            regions.append(Region(name=other_body.name, material=in_space(other_body.body.material), nodes=nodes))
        if any((*other_body.velocity, *other_body.spin)):
            (x, y, z), (about_x, about_y, about_z) = other_body.velocity, other_body.spin
            spin = (about_x, about_y, about_z) if any(other_body.spin) else 0.0
            conditions.append(InitialVelocity(name=other_body.name, x=x, y=y, z=z, spin=spin, nodes=nodes))
        if other_body.rigid is not None:
            conditions.append(msgspec.structs.replace(other_body.rigid, nodes=nodes))
        regions += [_further(item, first) for item in more.regions]
        conditions += [_further(item, first) for item in more.conditions]
        first += len(body_grid)
    settings = msgspec.structs.replace(settings, regions=tuple(regions), conditions=tuple(conditions))
    return grid, settings, tuple(remark for _, _, remarks in every for remark in remarks)


def _refuse_overlap(bodies: list[tuple[str, Body]]) -> None:
    """Raise SceneError for two bodies of which one has nodes in the other."""
    for (name, first), (second_name, second) in permutations(bodies, 2):
        theirs, own_triangles = second.shell.triangles, first.shell.triangles
        low, high = (
            np.stack([end(triangles, axis=(0, 1)) for triangles in (own_triangles, theirs)]) for end in (np.min, np.max)
        )
        if not (high.min(axis=0) - low.max(axis=0) > SLACK * first.spacing).all():
            continue
        place = f"body '{name if second_name == REST else second_name}'"
        for level in _levels(first):
            within = level.within(second.shell, place)
            inner = level.position[within]
            if len(inner):
                deep = distances(inner, theirs, float(np.ptp(theirs, axis=(0, 1)).max())).max()
                rest = second_name if name != REST and second_name == REST else name
                raise SceneError(
                    f"{place} is {deep + float(level.delta.max()) / 2:.4g} m deep in body '{rest}'; bodies may touch"
                    " at most"
                )


def _further(item: S, first: int) -> S:
    """A condition or region whose nodes have ids `first` larger."""
    return msgspec.structs.replace(item, nodes=tuple(node + first for node in item.nodes or ()))


def _alone(body: Body, lists: bool = False) -> tuple[Grid, Settings, tuple[str, ...]]:
    """Grid, settings and notes of a body without others; `lists`: its nodes are listed, though a lattice would do."""
    notes: tuple[str, ...] = ()
    if body.run.adapt in ON_ONE_LATTICE and body.zones:
        notes = (f"nodes of {body.finest:g} m everywhere: the solver makes them coarser where it can",)
        body = replace(body, spacing=body.finest, zones=())
    levels = _levels(body)
    delta = np.concatenate([level.delta for level in levels])
    body_nodes = BodyNodes(levels, np.concatenate([level.position for level in levels]), delta)
    cleared = [_clear_of_nodes(crack, body_nodes) for crack in body.cracks]
    body = replace(body, cracks=tuple(crack for crack, _ in cleared))
    settings = Settings(
        material=None if body.material is None else in_space(body.material),
        horizon=Horizon(ratio=float(body.horizon)),
        regions=tuple(
            msgspec.structs.replace(
                part.region,
                nodes=_nodes(part.solid, f"material '{part.region.name}'", body_nodes),
                material=in_space(part.region.material),
            )
            for part in body.regions
        ),
        conditions=tuple(_condition(condition, body, body_nodes) for condition in body.conditions),
        physics=body.physics,
        medium=medium_of(body.medium, body.material),
        media=tuple(
            msgspec.structs.replace(part.region, nodes=_nodes(part.solid, f"medium '{part.region.name}'", body_nodes))
            for part in body.media
        ),
        contact=body.touching,
        run=body.run,
    )
    cracks = np.concatenate([np.zeros((0, 9)), *(crack.sheet.triangles.reshape(-1, 9) for crack, _ in cleared)])
    grid = _grid(body, body_nodes, cracks, lists)
    return grid, settings, notes + tuple(remark for _, remarks in cleared for remark in remarks)


def _levels(body: Body) -> Sequence[Cubic | Scattered]:
    """The nodes of a body: its own, or those placed in its solid. Raises SceneError."""
    return place_nodes(body) if body.nodes is None else [Scattered.of(body)]


def _grid(body: Body, body_nodes: BodyNodes, cracks: NDArray[np.float64], lists: bool) -> Grid:
    """The nodes of a body with triangles (k, 9) of cracks, m: those of a large box as a lattice,
    if not `lists`."""
    levels, count = body_nodes.levels, len(body_nodes.delta)
    said: dict[str, Any] = {
        "cracks": cracks,
        "outline": tuple(body.shell.triangles),
        "source": body.source,
        "parameters": body.parameters,
        "drawing": body.drawing,
    }
    first = levels[0]
    if not lists and count >= MANY and len(levels) == 1 and isinstance(first, Cubic) and first.whole:
        columns, rows, layers = (np.ptp(first.at, axis=0) + 1).tolist()
        origin = tuple(body_nodes.position[0].tolist())
        return whole_lattice(Lattice(origin, first.cubes.spacing, columns, rows, layers), **said)
    return Grid(
        ids=np.arange(1, count + 1),
        position=body_nodes.position,
        delta=body_nodes.delta,
        border=np.concatenate([level.border for level in levels]),
        hole_id=np.full(count, -1),
        areas=np.concatenate([level.volume for level in levels]),
        **said,
    )


def in_space(material: Material) -> Material:
    """A material with three-dimensional stress and strain (`plane` is "space")."""
    return msgspec.structs.replace(material, plane="space")


def _clear_of_nodes(crack: CrackFace, body_nodes: BodyNodes) -> tuple[CrackFace, tuple[str, ...]]:
    """A crack that passes between nodes, and a remark if it had to be moved across its faces for that.

    It moves by the least sixteenths of the finest spacing, fewer than eight, that are enough. Raises SceneError for a
    crack that is none, is beside the body, or meets nodes wherever it is moved.
    """
    triangles, place = crack.sheet.triangles, f"crack '{crack.name}'"
    if not crack.sheet.areas.all():
        flat = int(np.flatnonzero(crack.sheet.areas == 0)[0])
        raise SceneError(f"{place}: triangle {flat} has no area; use three corners apart")
    near = distances(body_nodes.position, triangles, float(body_nodes.delta.max()))
    if not (near < body_nodes.delta).any():
        raise SceneError(f"{place} is outside the body; put it inside")
    on = np.flatnonzero(near < CLEARANCE * body_nodes.delta)
    if not len(on):
        return crack, ()
    near_rows = np.flatnonzero(near < 2 * body_nodes.delta)
    spacing = float(body_nodes.delta[near_rows].min())
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    _, axes = np.linalg.eigh(np.einsum("ti,tj->ij", normal, normal / np.linalg.norm(normal, axis=1, keepdims=True)))
    across = axes[:, -1]  # most of the sheet, with its largest component positive
    across = across * np.sign(across[np.abs(across).argmax()])
    for sixteenths in (sign * step for step in range(1, 8) for sign in (1, -1)):
        shifted_triangles = triangles + sixteenths / 16 * spacing * across
        apart = distances(body_nodes.position[near_rows], shifted_triangles, spacing)
        if (apart >= MOVED * body_nodes.delta[near_rows]).all():
            way = ", ".join(f"{step + 0.0:.3g}" for step in sixteenths / 16 * spacing * across)
            remark = f"{place}: moved by ({way}) m, as it met {len(on)} nodes"
            return replace(crack, sheet=Sheet(shifted_triangles)), (remark,)
    x, y, z = body_nodes.position[on[0]]
    raise SceneError(
        f"{place} runs through {len(on)} nodes, the first at ({x:g}, {y:g}, {z:g}) m; put it between nodes, which"
        " are the middles of cubes around the body's own, by a move of less than half a spacing"
    )


def _nodes(solid: object, place: str, body_nodes: BodyNodes) -> tuple[int, ...]:
    """The ids of those in a solid. Raises SceneError, beginning with `place`."""
    assert isinstance(solid, Shell)
    rows = np.flatnonzero(body_nodes.within(solid, place))
    if not len(rows):
        raise SceneError(
            f"{place}: no node is in its solid, {_nearest(solid.triangles, body_nodes)}; enlarge the solid, or use"
            " finer nodes"
        )
    return tuple((rows + 1).tolist())


def _nearest(triangles: NDArray[np.float64], body_nodes: BodyNodes) -> str:
    """Where the node nearest to triangles (t, 3, 3) is, for a message."""
    x, y, z = body_nodes.position[distances(body_nodes.position, triangles, np.inf).argmin()]
    return f"the nearest is at ({x:g}, {y:g}, {z:g}) m"


def _condition(condition: SolidCondition, body: Body, body_nodes: BodyNodes) -> AnyCondition:
    action, where, place = condition.action, condition.where, describe(condition.action)
    of_crack = isinstance(where, str) and where.startswith(CRACK)
    if isinstance(where, str):
        if where.startswith(CRACK):
            where = Sheet(np.concatenate([crack.sheet.triangles for crack in named_crack(where, body.cracks, place)]))
        else:
            where = face(body.shell, where, place)
    at_place, surface = _found(where, condition, body, body_nodes)
    rows = np.flatnonzero(at_place)
    if not len(rows):
        within = "in its solid" if isinstance(where, Shell) else f"within {condition.rows} rows"
        nearest = f", {_nearest(where.triangles, body_nodes)}" if isinstance(where, Shell | Sheet) else ""
        raise SceneError(f"{place}: no node is {within}{nearest}; use a larger region, or finer nodes")
    changed: dict[str, object] = {"nodes": tuple((rows + 1).tolist())}
    if isinstance(action, Load) and action.traction is not None:
        changed |= {"rows": condition.rows, "surface": surface}
    if isinstance(action, Load) and action.pressure is not None:
        changed |= _pressed(where, of_crack, action, body, body_nodes, rows)
    if isinstance(action, Spring) and action.stiffness is not None:
        changed |= {"rows": condition.rows, "surface": surface}
    if isinstance(action, Concentration | Exchange) and isinstance(where, str):
        axis, end = SIDES[where]
        way = np.zeros((len(rows), 3))
        way[:, axis] = float(body.shell.bounds[(end + 1) // 2, axis]) - body_nodes.position[rows, axis]
        changed["edge"] = tuple(map(tuple, way.tolist()))
    if isinstance(action, Concentration | Exchange) and isinstance(where, Sheet):
        way, above = ways_to(body_nodes.position[rows], where.triangles, np.inf)
        rows, way = (rows[above], way[above]) if above.any() else (rows, way)
        changed |= {"nodes": tuple((rows + 1).tolist()), "edge": tuple(map(tuple, way.tolist()))}
    return sampled(msgspec.structs.replace(action, **changed), condition.functions, body_nodes.position[rows], place)


def _pressed(
    where: Where, of_crack: bool, load: Load, body: Body, body_nodes: BodyNodes, rows: NDArray[np.int64]
) -> dict[str, object]:
    """What a pressure on a side, a sheet or both faces of a pre-crack has of its nodes, `rows` (k,).

    Raises SceneError.
    """
    sheet = _flat_side(where, body) if isinstance(where, str) else where
    assert isinstance(sheet, Sheet)
    if not len(sheet.triangles):
        raise SceneError(f"{describe(load)}: the body has no flat face there; use 'nearest X,Y,Z' or a sheet")
    at_rows = body_nodes.position[rows], body_nodes.delta[rows]
    faces = faces_of_crack_sheet(sheet) if of_crack else faces_of_sheet(sheet, *at_rows, describe(load))
    volume = np.concatenate([level.volume for level in body_nodes.levels])[rows]
    vectors = nodal_areas(faces, *at_rows, volume)
    changed: dict[str, object] = {"area_vectors": tuple(map(tuple, vectors.tolist()))}
    return changed | ({"faces": faces} if load.following or of_crack else {})


def _found(
    where: Where, condition: SolidCondition, body: Body, body_nodes: BodyNodes
) -> tuple[NDArray[np.bool_], float | None]:
    """The nodes (n,) of a place, and its area, m^2, if it is a flat side or a sheet. Raises SceneError."""
    action, place = condition.action, describe(condition.action)
    if isinstance(where, Sheet):
        reach = condition.rows * body_nodes.delta * (1 - SLACK)
        return distances(body_nodes.position, where.triangles, float(reach.max())) < reach, where.area
    if isinstance(where, str):
        axis, end = SIDES[where]
        side = float(body.shell.bounds[(end + 1) // 2, axis])
        away = (side - body_nodes.position[:, axis]) * end
        flat = _flat_side(where, body)
        area = flat.area if len(flat.triangles) else None
        return away < condition.rows * body_nodes.delta * (1 - SLACK), area
    what = "at a point" if isinstance(where, shapely.Point) else "in a solid"
    if isinstance(action, Load) and action.traction is not None:
        raise SceneError(
            f"{place}: a traction {what} is not possible; use a force or a body force there, or a side or a sheet"
        )
    if isinstance(action, Spring) and action.stiffness is not None:
        raise SceneError(f"{place}: a stiffness {what} is not possible; use a body_stiffness, or a side or a sheet")
    if isinstance(where, shapely.Point):
        return _at(where.coords[0], place, body_nodes), None
    assert isinstance(where, Shell)
    return body_nodes.within(where, place), None


def _flat_side(side: str, body: Body) -> Sheet:
    """The triangles of a body's surface that lie in the plane of a side of its box, of which there may be none."""
    axis, end = SIDES[side]
    triangles = body.shell.triangles
    at = float(body.shell.bounds[(end + 1) // 2, axis])
    return Sheet(triangles[(np.abs(triangles[..., axis] - at) <= SLACK * body.finest).all(axis=1)])


def _at(point: Sequence[float], place: str, body_nodes: BodyNodes) -> NDArray[np.bool_]:
    """The node (n,) nearest to a point. Raises SceneError, beginning with `place`, for a point away from all nodes."""
    away = np.linalg.norm(body_nodes.position - point, axis=1)
    nearest = int(away.argmin())
    if away[nearest] > FAR * body_nodes.delta[nearest]:
        x, y, z = body_nodes.position[nearest]
        raise SceneError(
            f"{place}: ({', '.join(f'{value:g}' for value in point)}) m is away from the body, whose nearest node"
            f" is at ({x:g}, {y:g}, {z:g}) m; put it in the body"
        )
    return np.asarray(np.arange(len(away)) == nearest)
