"""Edges of a plate picked from outside, by words: sides, holes, places and directions.

    right                         the straight edge at the left, right, bottom or top of the plate
    hole nearest 12,5             the whole edge of the hole nearest to a place
    nearest 12,5                  the edge nearest to a place, from corner to corner
    normal 0,1                    all edges that face a direction, within a degree, except those of holes
    along 0,40 0,60               the outline between two places, the shorter way
    bearing 12,5 toward 0,1       the half of the hole nearest to a place that a force in this direction presses on

Places may stand in parentheses. The last word may be a unit; without it places are in the drawing's unit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString
from shapely.ops import substring

from pdmesh.model.document import LARGEST
from pdmesh.quantities import UNITS, Unit
from pdmesh.scene.shapes import Curve, SceneError, Surface, parts

SIDES = {"left": (0, -1), "right": (0, 1), "bottom": (1, -1), "top": (1, 1)}  # axis, end
CORNER = np.cos(np.radians(20))  # of the angle between neighbouring chords: edges end where they turn by more
FACING = np.cos(np.radians(1))
FORMS = {  # first words, and how many places follow
    "hole nearest": 1,
    "nearest": 1,
    "normal": 1,
    "along": 2,
    "bearing": 2,
}
EXPECTED = (
    f"one of {', '.join(SIDES)}, 'hole nearest X,Y', 'nearest X,Y', 'normal X,Y', 'along X,Y X,Y' or"
    " 'bearing X,Y toward X,Y'"
)
METRE = UNITS["m"]


def edge(shape: Surface, finest: float, words: str, place: str, unit: Unit = METRE) -> Curve:
    """The part of the outline of a plate of this `shape` that the words pick; `finest` is its finest spacing, m.

    Raises SceneError, beginning with `place`.
    """
    if words.strip() in SIDES:
        return _side(shape, finest, words.strip(), place)
    first, points = points_in(words, FORMS, 2, place, EXPECTED, unit)
    match first:
        case "hole nearest":
            return _hole(shape, points[0], place)
        case "nearest":
            return _nearest(shape, points[0])
        case "normal":
            return _facing(shape, points[0], place)
        case "along":
            return _along(shape, finest, points, place)
    # the half of a hole on the side to which a force points, cut at right angles to it through the hole's centre
    hole = shapely.Polygon(_hole(shape, points[0], place))
    (centre,), way = shapely.get_coordinates(hole.centroid), points[1] / np.hypot(*points[1])
    across, reach = np.array([-way[1], way[0]]), 2 * float(np.hypot(*np.ptp(shapely.get_coordinates(hole), axis=0)))
    side = centre + reach * across, centre - reach * across
    half = shapely.Polygon([*side, *(corner + reach * way for corner in side[::-1])])
    half_edge = shapely.line_merge(LineString(hole.exterior).intersection(half))
    if not isinstance(half_edge, LineString):
        x, y = centre
        raise SceneError(f"{place}: the hole at ({x:g}, {y:g}) m has a half in pieces; use a round one")
    return half_edge


def point_in(text: str, dimension: int, place: str, unit: Unit) -> tuple[float, ...]:
    """A place X,Y or, in space, X,Y,Z, m. Raises SceneError, beginning with `place`."""
    try:
        _, points = points_in(f"at {text}", {"at": 1}, dimension, place, "", unit)
    except SceneError:
        raise SceneError(f"{place}: cannot read '{text}'; use {','.join('XYZ'[:dimension])}, numbers") from None
    return tuple(points[0].tolist())


def points_in(
    words: str, forms: dict[str, int], dimension: int, place: str, expected: str, unit: Unit
) -> tuple[str, NDArray[np.float64]]:
    """The first words of a choice, one of `forms`, and the points (k, d) behind them; of a direction as they stand,
    of places in m.

    Raises SceneError, beginning with `place`, that says what was `expected`.
    """
    text = words.strip()
    *most, last = text.rsplit(maxsplit=1) or [""]
    if last in UNITS and most:
        text, unit = most[0], UNITS[last]
    first = next((form for form in forms if text.startswith(form + " ")), "")
    text = text.replace("toward", " ") if first == "bearing" else text
    try:
        rows = re.findall(r"[^\s()]+", re.sub(r"\s*,\s*", ",", text.removeprefix(first)))
        points = np.array([[float(number) for number in row.split(",")] for row in rows], dtype=float)
    except ValueError:
        points = np.zeros((0, 0))
    if not first or points.shape != (forms[first], dimension) or not (np.abs(points) <= LARGEST).all():
        raise SceneError(f"{place}: cannot read '{words}'; use {expected}")
    directions = {"normal": 0, "bearing": 1}.get(first, len(points))
    points[:directions] = unit.to_si(points[:directions])
    if not np.abs(points[directions:]).any(axis=1).all():
        raise SceneError(f"{place}: '{words}' has no direction; use one that is not 0")
    return first, points


def _side(shape: Surface, finest: float, name: str, place: str) -> Curve:
    axis, end = SIDES[name]
    reach = shape.bounds[axis + (2 if end > 0 else 0)]

    def on(chords: NDArray[np.float64]) -> NDArray[np.bool_]:
        ends = np.abs(chords[:, axis::2] - reach) <= 1e-9 * finest + 1e-12 * abs(reach)
        return np.asarray(ends.all(axis=1))

    return _merged(
        _chords(shape, on),
        f"{place}: the plate has no straight edge at the {name}; use points of a curve, or a shape such as box(x0,"
        " y0, x1, y1), in place of its name",
    )


def _facing(shape: Surface, way: NDArray[np.float64], place: str) -> Curve:
    def on(chords: NDArray[np.float64]) -> NDArray[np.bool_]:
        along = chords[:, 2:] - chords[:, :2]
        outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
        return np.asarray(outward @ way >= FACING * np.hypot(*way))

    x, y = way
    return _merged(_chords(shape, on), f"{place}: no edge faces ({x:g}, {y:g}); use another direction")


def _chords(shape: Surface, on: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> Iterable[NDArray[np.float64]]:
    """The chords (2, 2) of the exterior, counter-clockwise, for whose ends (k, 4) `on` is true."""
    for part in parts(shape):
        ring = shapely.get_coordinates(shapely.geometry.polygon.orient(part).exterior)
        ends = np.hstack([ring[:-1], ring[1:]])
        yield from ends[on(ends)].reshape(-1, 2, 2)


def _merged(chords: Iterable[NDArray[np.float64]], none: str) -> Curve:
    chord_list = list(chords)
    if not chord_list:
        raise SceneError(none)
    merged = shapely.line_merge(MultiLineString(chord_list))
    return merged if isinstance(merged, Curve) else MultiLineString(chord_list)


def _hole(shape: Surface, at: NDArray[np.float64], place: str) -> LineString:
    holes = [ring for part in parts(shape) for ring in part.interiors]
    if not holes:
        raise SceneError(f"{place}: the plate has no hole; add one, or use another edge")
    x, y = at
    nearest = min(holes, key=lambda ring: float(shapely.Polygon(ring).distance(shapely.Point(x, y))))
    return LineString(nearest)


def _nearest(shape: Surface, at: NDArray[np.float64]) -> LineString:
    """The edge nearest to a place, from one corner of its ring to the next."""
    x, y = at
    rings = [LineString(ring) for part in parts(shape) for ring in (part.exterior, *part.interiors)]
    ring = min(rings, key=lambda line: float(line.distance(shapely.Point(x, y))))
    points = shapely.get_coordinates(ring)[:-1]
    along = np.roll(points, -1, axis=0) - points  # chord k begins at point k
    along /= np.hypot(*along.T)[:, None]
    corners = np.flatnonzero((along * np.roll(along, 1, axis=0)).sum(axis=1) < CORNER)
    if not len(corners):
        return ring
    chords = shapely.linestrings(np.stack([points, np.roll(points, -1, axis=0)], axis=1))
    k = int(shapely.distance(chords, shapely.Point(x, y)).argmin())
    first = int(corners[np.searchsorted(corners, k, side="right") - 1])
    after = int(corners[np.searchsorted(corners, k, side="right") % len(corners)])
    count = (after - first) % len(points) or len(points)
    return LineString(points[(first + np.arange(count + 1)) % len(points)])


def _along(shape: Surface, finest: float, ends: NDArray[np.float64], place: str) -> LineString:
    rings = [LineString(ring) for part in parts(shape) for ring in (part.exterior, *part.interiors)]
    at = shapely.points(ends)
    away = np.array([shapely.distance(ring, at).max() for ring in rings])
    if away.min() > finest:
        ends_text = ", ".join(f"({x:g}, {y:g})" for x, y in ends)
        raise SceneError(
            f"{place}: {ends_text} m are not on one edge; use two places on one edge of the plate, within a spacing"
        )
    ring = rings[int(away.argmin())]
    first, last = sorted(shapely.line_locate_point(ring, at).tolist())
    ring_length = ring.length
    straight = substring(ring, first, last)
    if 2 * (last - first) > ring_length:
        around = [substring(ring, last, ring_length), substring(ring, 0, first)]
        straight = shapely.line_merge(MultiLineString([line for line in around if line.length > 0]))
    if not isinstance(straight, LineString) or not straight.length > 0:
        raise SceneError(f"{place}: the edge has length 0; use two places apart")
    return straight
