"""Where the groups and parameters of a plate's drawing place things: points, curves, surfaces, boxes and edges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import LineString, MultiLineString

from pdmesh.drawing.group_names import picked
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.model.document import LARGEST
from pdmesh.quantities import Unit
from pdmesh.scene.edges import point_in
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import Curve, SceneError, Surface, parts


@dataclass(frozen=True)
class Group:
    """A group: curves as points (k, 3) in the drawing's unit, and surfaces as lists of such curves."""

    name: str
    dimension: int
    curves: tuple[Any, ...] = ()
    surfaces: tuple[tuple[Any, ...], ...] = ()
    number: int = 0


def in_metres(group: Group, unit: Unit) -> Group:
    """The group with its coordinates in metres."""
    curves, *surfaces = (
        tuple(unit.metres(np.asarray(curve, dtype=float)) for curve in curve_list)
        for curve_list in (group.curves, *group.surfaces)
    )
    return replace(group, curves=curves, surfaces=tuple(surfaces))


def places(
    scene: Scene, groups: Mapping[str, Group], parameters: Parameters, kind: str, top: str
) -> list[tuple[str, Curve | Surface | shapely.Point, str]]:
    """Name, place and parameter folder of each condition of a kind, whose folders are below `top`."""
    condition_places: list[tuple[str, Curve | Surface | shapely.Point, str]] = []
    for name, group in groups.items():
        place = f"{kind} '{name}'"
        if group.dimension == 2:
            where: Curve | Surface | shapely.Point = surface_of(place, group)
        elif group.dimension == 1:
            where = MultiLineString(lines_of(place, group.curves))
        elif len(group.curves) == 1:
            where = shapely.Point(point_of(group.curves[0]))
        else:
            raise SceneError(f"{place} has {len(group.curves)} points; use one, as it is a support at one node")
        condition_places.append((name, where, f"{top}/{name}"))
    for name in sorted(parameters.below(top) - set(groups)):
        condition_places.append((name, _picked(scene, parameters, f"{top}/{name}"), f"{top}/{name}"))
    return condition_places


def _picked(scene: Scene, parameters: Parameters, folder: str) -> Curve | Surface | shapely.Point:
    word, *others = picked(parameters, folder)
    name, text = f"{folder}/{word}", parameters.text(f"{folder}/{word}")
    if others:
        raise SceneError(f"parameter '{PREFIX}{folder}/{others[0]}' cannot be combined with a {word}; use one of them")
    match word:
        case "Box":
            place = PREFIX + name
            try:
                x0, y0, x1, y1 = (parameters.unit.metres(float(number)) for number in text.split())
            except ValueError:
                raise SceneError(f"parameter '{place}' is '{text}'; use four numbers 'x0 y0 x1 y1'") from None
            if not (-LARGEST <= x0 < x1 <= LARGEST and -LARGEST <= y0 < y1 <= LARGEST):
                raise SceneError(f"parameter '{place}' is '{text}'; use x0 < x1 and y0 < y1, at most {LARGEST:g} m")
            return shapely.box(x0, y0, x1, y1)
        case "Edge":
            return scene.edge(text, f"parameter '{PREFIX}{name}'", parameters.unit)
    return shapely.Point(*point_in(text, 2, f"parameter '{PREFIX}{name}'", parameters.unit))


def point_of(curve: Any) -> tuple[float, float]:
    """The first point of a curve, x and y, m."""
    x, y = np.asarray(curve)[0, :2].tolist()
    return x, y


def lines_of(place: str, curves: Iterable[Any]) -> list[LineString]:
    """Curves, points (k, 3), as lines joined where they meet. Raises SceneError."""
    lines = [LineString(np.asarray(points)[:, :2]) for points in curves]
    lines = [line for line in lines if line.length > 0]
    if not lines:
        raise SceneError(f"{place} has no curve of any length; add one")
    merged = shapely.line_merge(MultiLineString(lines))
    return list(merged.geoms) if isinstance(merged, MultiLineString) else [merged]


def surface_of(place: str, group: Group) -> Surface:
    """The union of the faces of a group. Raises SceneError."""
    return shapely.union_all([face(curves, place) for curves in group.surfaces])


def face(curves: Iterable[Any], place: str) -> shapely.Polygon:
    """The face bounded by curves, points (k, 2 or 3). Raises SceneError if they do not close, or cross."""
    lines = lines_of(place, curves)
    polygons, cuts, dangles, _ = shapely.polygonize_full(lines)
    crossing = [line for line in lines if not line.is_simple]
    if crossing or not MultiLineString(lines).is_simple:
        reason = shapely.is_valid_reason(shapely.Polygon(crossing[0])) if crossing else "curves that cross"
        raise SceneError(f"{place}: {reason}; use an outline that does not cross itself")
    for loose in (dangles, cuts):
        if not loose.is_empty:
            x, y = shapely.get_coordinates(loose)[0]
            raise SceneError(f"{place}: the outline is open at ({x:g}, {y:g}) m; use closed curves")
    faces = parts(polygons)
    if not faces:
        raise SceneError(f"{place}: the outline does not close; use closed curves")
    return max(faces, key=lambda part: float(shapely.Polygon(part.exterior).area))
